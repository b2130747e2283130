#include "lib/raised_source.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lib/culture.hpp"

namespace wedgescope {
namespace {

/// Neighbouring posts along one axis whose culture cells lie in one tile.
struct TileRun {
    Interval posts, cells;
};

/// Culture cells of posts along one axis, and the runs that they fall into.
struct CellsAlong {
    std::vector<std::int64_t> cells;
    std::vector<TileRun> runs;
};

CellsAlong cells_along(Interval posts, std::int64_t post, double offset, double scale, std::int64_t edge) {
    const auto tile_of = [&](std::int64_t cell) { return (cell >= 0 ? cell : cell - edge + 1) / edge; };
    CellsAlong out;
    out.cells.reserve(static_cast<std::size_t>(posts.size()));
    for (std::int64_t p = posts.begin; p < posts.end; ++p) {
        const auto cell = static_cast<std::int64_t>(std::floor(offset + scale * static_cast<double>(p * post)));
        out.cells.push_back(cell);
        if (out.runs.empty() || tile_of(out.runs.back().cells.begin) != tile_of(cell))
            out.runs.push_back({{p, p}, {cell, cell + 1}});
        TileRun& run = out.runs.back();
        run.posts.end = p + 1;
        run.cells = {std::min(run.cells.begin, cell), std::max(run.cells.end, cell + 1)};
    }
    return out;
}

/// The blocks of a request some post of which may be asked for: those needed and those beside one.
class Wanted {
public:
    explicit Wanted(const ChunkRequest& request) : blocks_(request.blocks), all_(request.skip.empty()) {
        if (all_) return;
        wanted_.assign(request.skip.size(), false);
        static_assert(ChunkRequest::margin < block_posts);
        for (std::int64_t r = blocks_.rows.begin; r < blocks_.rows.end; ++r)
            for (std::int64_t c = blocks_.columns.begin; c < blocks_.columns.end; ++c) {
                if (request.skip[blocks_.at(c, r)] != Skip::none) continue;
                const Window near = intersection({{c - 1, c + 2}, {r - 1, r + 2}}, blocks_);
                for (std::int64_t y = near.rows.begin; y < near.rows.end; ++y)
                    for (std::int64_t x = near.columns.begin; x < near.columns.end; ++x)
                        wanted_[blocks_.at(x, y)] = true;
            }
    }
    bool all() const { return all_; }
    /// Of one post.
    bool has(std::int64_t column, std::int64_t row) const {
        return all_ || wanted_[blocks_.at(column / block_posts, row / block_posts)];
    }
    bool any(const Window& posts) const {
        if (all_) return true;
        const Window blocks = blocks_of(posts);
        for (std::int64_t r = blocks.rows.begin; r < blocks.rows.end; ++r)
            for (std::int64_t c = blocks.columns.begin; c < blocks.columns.end; ++c)
                if (wanted_[blocks_.at(c, r)]) return true;
        return false;
    }

private:
    Window blocks_;
    bool all_;
    std::vector<bool> wanted_;
};

}  // namespace

class RaisedSource::Map final : public BlockMap {
public:
    Map(BlockMap& below, float most_m) : below_(below), most_m_(most_m) {}
    int levels() const override { return below_.levels(); }
    BlockWindow read(int level, const Window& blocks) override {
        BlockWindow out = below_.read(level, blocks);
        for (BlockBounds& b : out.bounds)
            if (b.voids != Voids::all) b.culture_m = std::max(b.culture_m, most_m_);
        return out;
    }

private:
    BlockMap& below_;
    float most_m_;
};

RaisedSource::RaisedSource(WedgeSource& below, std::vector<float> raises_m)
    : below_(below), raises_m_(std::move(raises_m)) {
    raises_m_.resize(std::size_t{unknown_class} + 1);
    if (BlockMap* map = below_.block_map())
        map_ = std::make_unique<Map>(*map, *std::max_element(raises_m_.begin(), raises_m_.end()));
}

RaisedSource::~RaisedSource() = default;

BlockMap* RaisedSource::block_map() { return map_.get(); }

std::size_t RaisedSource::tile_bytes() const {
    const DataBase& db = data_base();
    return db.has_culture ? static_cast<std::size_t>(db.culture_tile_columns * db.culture_tile_rows) *
                                (sizeof(ClassId) + sizeof(std::int32_t))
                          : 0;
}

LoadCost RaisedSource::cost(const ChunkRequest& request) const {
    LoadCost cost = below_.cost(request);
    const DataBase& db = data_base();
    if (!db.has_culture) return cost;
    const double cells = std::fabs(db.culture_column_scale * db.culture_row_scale);
    const std::uint64_t a_cell = below_.class_bytes({{0, 1}, {0, 1}});
    const auto posts = static_cast<double>(request.window.posts() << (2 * request.level));
    cost.bytes += static_cast<std::uint64_t>(posts * cells) * a_cell;
    cost.beside_bytes += tile_bytes();
    return cost;
}

Chunk RaisedSource::load(const ChunkRequest& request) {
    Chunk chunk = below_.load(request);
    if (chunk.flat) return chunk;
    const DataBase& db = data_base();
    const auto lift = [&](std::size_t at, ClassId id) {
        const float raise = raises_m_[id];
        if (!(raise > 0)) return;
        if (!chunk.culture_height_m.empty() && chunk.culture_height_m[at] > 0)
            chunk.culture_height_m[at] = 0;
        else
            chunk.surface_m[at] += raise;
    };
    if (!db.has_culture) {
        for (std::size_t at = 0; at < chunk.surface_m.size(); ++at) lift(at, db.default_class);
        return chunk;
    }
    const Window& window = chunk.window;
    const std::int64_t post = std::int64_t{1} << request.level;
    const CellsAlong columns = cells_along(window.columns, post, db.culture_column_offset, db.culture_column_scale,
                                           db.culture_tile_columns),
                     rows = cells_along(window.rows, post, db.culture_row_offset, db.culture_row_scale,
                                        db.culture_tile_rows);
    const Wanted wanted(request);
    // Steps from column to column and from row to row.
    const std::int64_t across = chunk.lines_are_columns ? window.rows.size() : 1,
                       down = chunk.lines_are_columns ? 1 : window.columns.size();
    for (const TileRun& high : rows.runs)
        for (const TileRun& wide : columns.runs) {
            if (!wanted.any({wide.posts, high.posts})) continue;
            const CultureCells tile = below_.load_classes({wide.cells, high.cells});
            chunk.bytes_read += tile.bytes_read;
            chunk.bytes_spilled += tile.bytes_spilled;
            for (std::int64_t r = high.posts.begin; r < high.posts.end; ++r) {
                const std::int64_t cell_row = rows.cells[static_cast<std::size_t>(r - window.rows.begin)];
                const ClassId* const line = tile.classes.data() + (cell_row - high.cells.begin) * wide.cells.size();
                for (std::int64_t c = wide.posts.begin; c < wide.posts.end; ++c)
                    if (wanted.has(c, r))
                        lift(
                            static_cast<std::size_t>((r - window.rows.begin) * down +
                                                     (c - window.columns.begin) * across),
                            line[columns.cells[static_cast<std::size_t>(c - window.columns.begin)] - wide.cells.begin]);
            }
        }
    return chunk;
}

std::vector<float> raises_m(const Scene& scene, const DataBase& db) {
    std::vector<float> raises = raises_m(scene);
    if (!raises.empty() && !db.has_culture && !(raises[db.default_class] > 0)) raises.clear();
    return raises;
}

SceneSource::SceneSource(WedgeSource& source, const Scene& scene) : source_(&source) {
    std::vector<float> raises = raises_m(scene, source.data_base());
    if (!raises.empty()) raised_.emplace(source, std::move(raises));
}

}  // namespace wedgescope
