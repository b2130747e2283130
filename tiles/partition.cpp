#include "tiles/partition.hpp"

#include <tbb/parallel_pipeline.h>

#include <GeographicLib/Geodesic.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "lib/error.hpp"
#include "lib/handover.hpp"
#include "lib/threads.hpp"

namespace wedgescope {
namespace {

constexpr double pi = std::numbers::pi, turn = 2 * pi;
constexpr std::int64_t most_window_posts = std::int64_t{1} << 22;
constexpr std::size_t bytes_a_post = 13;  ///< on its way: height, culture height, packed, mask

std::int64_t up(std::int64_t v, std::int64_t unit) { return (v + unit - 1) / unit; }

/// Blocks that hold the posts of a window.
Window in_blocks(const Window& posts, std::int64_t edge) {
    return {{block_along(posts.columns.begin, edge), up(posts.columns.end, edge)},
            {block_along(posts.rows.begin, edge), up(posts.rows.end, edge)}};
}

/// Cuts the hull down to what is needed.
BlockSet trimmed(const Window& all, std::int64_t edge, const std::vector<bool>& needed) {
    BlockSet out;
    out.edge = edge;
    for (std::int64_t r = 0; r < all.rows.size(); ++r)
        for (std::int64_t c = 0; c < all.columns.size(); ++c)
            if (needed[static_cast<std::size_t>(r * all.columns.size() + c)])
                out.blocks = hull(out.blocks, {{c, c + 1}, {r, r + 1}});
    out.needed.resize(static_cast<std::size_t>(out.blocks.posts()));
    for (std::int64_t r = out.blocks.rows.begin; r < out.blocks.rows.end; ++r)
        for (std::int64_t c = out.blocks.columns.begin; c < out.blocks.columns.end; ++c)
            out.needed[out.at(c, r)] = needed[static_cast<std::size_t>(r * all.columns.size() + c)];
    return out;
}

/// A post as seen from the nadir: ground range, azimuth, and where it is (metres, or degrees in geodesic geometry).
struct Direction {
    double arc_m = 0, azimuth_rad = 0, x = 0, y = 0;
    bool known = true;  ///< else PROJ has no answer
};
Direction direction(const DataBase& db, const PartitionScope& s, double column, double row) {
    if (!s.geodesic) {
        const double dx = (column - s.nadir.column) * db.step_x * db.metres_per_unit,
                     dy = (row - s.nadir.row) * db.step_y * db.metres_per_unit;
        return {std::hypot(dx, dy), std::atan2(dx, dy), dx, dy};
    }
    const auto ll = db.lat_lon(column, row);
    if (!ll) return {0, 0, 0, 0, false};
    double arc = 0, azimuth = 0, back = 0;
    GeographicLib::Geodesic::WGS84().Inverse(s.lat_deg, s.lon_deg, ll->first, ll->second, arc, azimuth, back);
    return {arc, azimuth * pi / 180, ll->second, ll->first};
}
double apart(const PartitionScope& s, const Direction& a, const Direction& b) {
    if (!s.geodesic) return std::hypot(a.x - b.x, a.y - b.y);
    double arc = 0;
    GeographicLib::Geodesic::WGS84().Inverse(a.y, a.x, b.y, b.x, arc);
    return arc;
}

}  // namespace

PartitionScope scope_of(const ResolvedScene& s) {
    PartitionScope scope;
    scope.nadir = s.nadir;
    scope.geodesic = s.geometry == Geometry::geodesic;
    scope.lat_deg = s.lat_deg;
    scope.lon_deg = s.lon_deg;
    // The arc of a slant range, as the engine bounds it, and a little more.
    const double range = s.scene.range_m ? outermost_m(s) : 0, theta = range * s.earth.inverse_radius();
    scope.reach_m = range * (1.001 + theta * theta / 4);
    scope.from_rad = static_cast<double>(s.swept.azimuth_bins.begin) * s.swept.azimuth_step_rad();
    scope.width_rad = static_cast<double>(s.swept.azimuth_bins.size()) * s.swept.azimuth_step_rad();
    return scope;
}

BlockSet all_blocks(std::int64_t columns, std::int64_t rows, std::int64_t edge) {
    BlockSet out;
    out.edge = edge;
    out.blocks = {{0, up(columns, edge)}, {0, up(rows, edge)}};
    out.needed.assign(static_cast<std::size_t>(out.blocks.posts()), true);
    return out;
}

namespace {

/// Which squares of `edge` posts have posts in scope, corner by corner.
class ScopeTest {
public:
    /// `bulge`: how far, in diagonals, a post of a square may be from all of its corners.
    ScopeTest(const DataBase& db, const PartitionScope& scope, std::int64_t edge, double bulge)
        : db_(db), scope_(scope), edge_(edge), bulge_(bulge), width_(static_cast<std::size_t>(up(db.columns, edge))),
          height_(static_cast<std::size_t>(up(db.rows, edge))) {}

    std::size_t width() const { return width_; }
    std::size_t height() const { return height_; }
    /// Of those that may(column, row) lets through.
    template <class May>
    std::vector<bool> inside(const May& may) const {
        std::vector<bool> found(width_ * height_, false);
        std::vector<std::optional<Direction>> above, below(width_ + 1);
        for (std::size_t r = 0; r < height_; ++r) {
            above = std::exchange(below, std::vector<std::optional<Direction>>(width_ + 1));
            const auto corner = [&](std::vector<std::optional<Direction>>& line, std::size_t c, std::size_t at) {
                if (!line[c]) line[c] = direction(db_, scope_, column(c), row(at));
                return *line[c];
            };
            for (std::size_t c = 0; c < width_; ++c)
                if (may(c, r))
                    found[r * width_ + c] = wanted({corner(above, c, r), corner(above, c + 1, r),
                                                    corner(below, c, r + 1), corner(below, c + 1, r + 1)},
                                                   c, r);
        }
        return found;
    }

private:
    double column(std::size_t i) const {
        return static_cast<double>(std::min(static_cast<std::int64_t>(i) * edge_, db_.columns - 1));
    }
    double row(std::size_t i) const {
        return static_cast<double>(std::min(static_cast<std::int64_t>(i) * edge_, db_.rows - 1));
    }
    bool wanted(const std::array<Direction, 4>& corners, std::size_t c, std::size_t r) const {
        double nearest = std::numeric_limits<double>::infinity();
        for (const Direction& d : corners) {
            if (!d.known) return true;
            nearest = std::min(nearest, d.arc_m);
        }
        const double half_m =
            bulge_ * std::max(apart(scope_, corners[0], corners[3]), apart(scope_, corners[1], corners[2]));
        nearest -= half_m;
        if (nearest <= half_m) return true;
        if (scope_.nadir.column >= column(c) && scope_.nadir.column <= column(c + 1) && scope_.nadir.row >= row(r) &&
            scope_.nadir.row <= row(r + 1))
            return true;
        if (scope_.reach_m && nearest > *scope_.reach_m) return false;
        if (scope_.all_round()) return true;
        double lo = 0, hi = 0;
        for (const Direction& d : corners) {
            const double off = std::remainder(d.azimuth_rad - corners[0].azimuth_rad, turn);
            lo = std::min(lo, off);
            hi = std::max(hi, off);
        }
        double begin = std::fmod(corners[0].azimuth_rad + lo - scope_.from_rad, turn);
        if (begin < 0) begin += turn;
        return begin <= scope_.width_rad || begin + (hi - lo) >= turn;
    }

    const DataBase& db_;
    const PartitionScope& scope_;
    std::int64_t edge_;
    double bulge_;
    std::size_t width_, height_;
};

}  // namespace

BlockSet blocks_in_scope(const DataBase& db, const PartitionScope& scope, std::int64_t edge) {
    if (!scope.reach_m && scope.all_round()) return all_blocks(db.columns, db.rows, edge);
    // No post is farther from all corners than half a diagonal, and a bit where the sides are curved.
    constexpr double bulge = 0.55;
    const ScopeTest test(db, scope, edge, bulge);
    // Squares of many blocks first, where they are small on the earth: a corner takes a geodesic, and of a large raster most lie
    // beyond the reach.
    constexpr std::int64_t many = 16;
    constexpr double wide_bulge = 0.8, small_m = 300e3;
    std::vector<bool> squares;
    const ScopeTest coarse(db, scope, many * edge, wide_bulge);
    if (static_cast<double>(many * edge) * db.longer_post_m() <= small_m)
        squares = coarse.inside([](std::size_t, std::size_t) { return true; });
    const std::vector<bool> inside = test.inside([&](std::size_t c, std::size_t r) {
        if (squares.empty()) return true;
        // A block beside a square counts with it: sides bend.
        constexpr std::size_t side = many;
        for (std::size_t y = (r - std::min<std::size_t>(r, 1)) / side;
             y <= std::min((r + 1) / side, coarse.height() - 1); ++y)
            for (std::size_t x = (c - std::min<std::size_t>(c, 1)) / side;
                 x <= std::min((c + 1) / side, coarse.width() - 1); ++x)
                if (squares[y * coarse.width() + x]) return true;
        return false;
    });
    // One block more all round: what a wedge takes beside its own spokes, and what rounding makes of the edge.
    const std::size_t width = test.width(), height = test.height();
    std::vector<bool> needed(width * height, false);
    for (std::size_t r = 0; r < height; ++r)
        for (std::size_t c = 0; c < width; ++c) {
            if (!inside[r * width + c]) continue;
            for (std::size_t y = r > 0 ? r - 1 : 0; y <= std::min(r + 1, height - 1); ++y) {
                for (std::size_t x = c > 0 ? c - 1 : 0; x <= std::min(c + 1, width - 1); ++x)
                    needed[y * width + x] = true;
                // Across the seam; the last block may be a narrow one.
                if (db.cyclic && (c < 2 || c + 2 >= width))
                    for (std::size_t x : {std::size_t{0}, std::min<std::size_t>(1, width - 1),
                                          width - std::min<std::size_t>(2, width), width - 1})
                        needed[y * width + x] = true;
            }
        }
    return trimmed({{0, static_cast<std::int64_t>(width)}, {0, static_cast<std::int64_t>(height)}}, edge, needed);
}

std::int64_t block_edge(const RasterFacts& facts, std::size_t memory_bytes) {
    const bool by_columns = facts.unit_columns() < facts.unit_rows();
    const std::int64_t along = by_columns ? facts.rows : facts.columns;
    const std::int64_t file_along = by_columns ? facts.unit_rows() : facts.unit_columns();
    if (2 * file_along <= along) return spill_edge;  // the file itself is cut that way
    std::int64_t edge = spill_edge;
    while (edge > block_posts && static_cast<std::size_t>(edge * along) * bytes_a_post > memory_bytes) edge /= 2;
    return edge;
}

WedgeBuckets::Place WedgeBuckets::place(const std::array<IndexPosition, 4>& corners) const {
    IndexPosition middle;
    for (const IndexPosition& p : corners) {
        middle.column += p.column / 4;
        middle.row += p.row / 4;
    }
    const auto angle = [&](const IndexPosition& p) { return std::atan2(p.row - nadir.row, p.column - nadir.column); };
    const double centre = angle(middle);
    double first = 0;
    for (const IndexPosition& p : corners) first = std::min(first, std::remainder(angle(p) - centre, turn));
    double part = std::fmod((centre + first) / turn + 2, 1.0);
    return {std::clamp(static_cast<int>(part * count), 0, count - 1),
            std::hypot(middle.column - nadir.column, middle.row - nadir.row)};
}

// ---------------------------------------------------------------- what the pass learns on the way

namespace {

/// Bounds while they grow: nothing seen yet is neither valid nor void.
struct Bounds {
    float lowest = std::numeric_limits<float>::infinity(), highest = -std::numeric_limits<float>::infinity();
    float culture = 0;
    std::uint8_t valid = 0, voids = 0;

    void add(const Bounds& o) {
        lowest = std::min(lowest, o.lowest);
        highest = std::max(highest, o.highest);
        culture = std::max(culture, o.culture);
        valid |= o.valid;
        voids |= o.voids;
    }
    BlockBounds block() const {
        return {lowest, highest, culture, voids == 0 ? Voids::none : valid == 0 ? Voids::all : Voids::some};
    }
};

Bounds bounds_of(const Window& posts, const Window& window, const float* terrain, const float* culture) {
    const PostExtremes bare = post_extremes(terrain, window, posts);
    Bounds b;
    b.lowest = bare.lowest_m;
    b.highest = bare.highest_m;
    if (culture) b.culture = std::max(b.culture, post_extremes(culture, window, posts).highest_m);
    b.voids = bare.voids > 0;
    b.valid = bare.voids < static_cast<std::size_t>(posts.posts());
    return b;
}

}  // namespace

struct Survey::Part {
    struct Block {
        std::int64_t column = 0, row = 0;
        Bounds own, first_column, first_row, corner;
    };
    std::vector<Block> blocks;
    PostExtremes extremes;  ///< the highest with culture
};

class GrownMap final : public BlockMap {
public:
    GrownMap(const DataBase& db, const BlockSet& needed) {
        const std::int64_t fine = needed.edge / block_posts;
        columns_ = up(db.columns, block_posts);
        rows_ = up(db.rows, block_posts);
        cyclic_ = db.cyclic;
        const Window hull{{needed.blocks.columns.begin * fine, std::min(needed.blocks.columns.end * fine, columns_)},
                          {needed.blocks.rows.begin * fine, std::min(needed.blocks.rows.end * fine, rows_)}};
        levels_.push_back({hull, std::vector<BlockBounds>()});
        growing_.resize(static_cast<std::size_t>(hull.posts()));
    }
    GrownMap(const DataBase& db, std::vector<BlockBounds> finest)
        : columns_(up(db.columns, block_posts)), rows_(up(db.rows, block_posts)), cyclic_(db.cyclic) {
        levels_.push_back({{{0, columns_}, {0, rows_}}, std::move(finest)});
        add_levels();
    }

    Bounds* growing(std::int64_t column, std::int64_t row) {
        if (cyclic_ && column < 0) column += columns_;
        const Window& hull = levels_[0].hull;
        if (!hull.contains(column, row)) return nullptr;
        return &growing_[hull.at(column, row)];
    }

    /// After the last post: what lies beside what was read, then the coarser levels.
    void finish(const DataBase& db, const BlockSet& needed) {
        const std::int64_t fine = needed.edge / block_posts;
        const Window hull = levels_[0].hull;
        const auto is_needed = [&](std::int64_t c, std::int64_t r) { return needed.contains(c / fine, r / fine); };
        Level& first = levels_[0];
        first.bounds.resize(growing_.size());
        for (std::int64_t r = hull.rows.begin; r < hull.rows.end; ++r)
            for (std::int64_t c = hull.columns.begin; c < hull.columns.end; ++c) {
                if (!is_needed(c, r)) continue;
                Bounds& b = growing_[hull.at(c, r)];
                std::int64_t right = c + 1;
                if (right >= columns_) right = db.cyclic ? 0 : -1;
                const std::int64_t under = r + 1 < rows_ ? r + 1 : -1;
                for (const auto& [x, y] : {std::pair(right, r), std::pair(c, under), std::pair(right, under)})
                    if (x >= 0 && y >= 0 && !is_needed(x, y)) b.voids = 1;
                first.bounds[hull.at(c, r)] = b.block();
            }
        growing_.clear();
        growing_.shrink_to_fit();
        add_levels();
    }

    int levels() const override { return static_cast<int>(levels_.size()); }
    BlockWindow read(int level, const Window& blocks) override {
        BlockWindow out;
        out.blocks = blocks;
        out.bounds.reserve(static_cast<std::size_t>(blocks.posts()));
        const Level& l = levels_.at(static_cast<std::size_t>(level));
        for (std::int64_t r = blocks.rows.begin; r < blocks.rows.end; ++r)
            for (std::int64_t c = blocks.columns.begin; c < blocks.columns.end; ++c)
                out.bounds.push_back(bounds(l, c, r));
        return out;
    }

private:
    struct Level {
        Window hull;
        std::vector<BlockBounds> bounds;
    };

    void add_levels() {
        std::int64_t columns = columns_, rows = rows_;
        while (columns > 64 || rows > 64) {
            const Level& finer = levels_.back();
            Level level;
            level.hull = {{finer.hull.columns.begin / 2, up(finer.hull.columns.end, 2)},
                          {finer.hull.rows.begin / 2, up(finer.hull.rows.end, 2)}};
            level.bounds.resize(static_cast<std::size_t>(level.hull.posts()));
            for (std::int64_t r = level.hull.rows.begin; r < level.hull.rows.end; ++r)
                for (std::int64_t c = level.hull.columns.begin; c < level.hull.columns.end; ++c) {
                    BlockBounds& b = level.bounds[level.hull.at(c, r)];
                    bool any = false;
                    for (std::int64_t y = 2 * r; y < std::min(2 * r + 2, rows); ++y)
                        for (std::int64_t x = 2 * c; x < std::min(2 * c + 2, columns); ++x) {
                            const BlockBounds child = bounds(finer, x, y);
                            if (any)
                                b.add(child);
                            else
                                b = child;
                            any = true;
                        }
                }
            levels_.push_back(std::move(level));
            columns = up(columns, 2);
            rows = up(rows, 2);
        }
    }

    static BlockBounds bounds(const Level& level, std::int64_t c, std::int64_t r) {
        if (!level.hull.contains(c, r)) return {};
        return level.bounds[level.hull.at(c, r)];
    }

    std::int64_t columns_ = 0, rows_ = 0;
    bool cyclic_ = false;
    std::vector<Bounds> growing_;
    std::vector<Level> levels_;
};

std::size_t Survey::map_bytes(const BlockSet& needed) {
    const std::int64_t fine = needed.edge / block_posts;
    // Level 0 twice, while it becomes what is read; a third more for all coarser levels.
    return static_cast<std::size_t>(needed.blocks.posts() * fine * fine) *
           (sizeof(Bounds) + sizeof(BlockBounds) * 4 / 3);
}

Survey::Survey(const DataBase& data_base, const BlockSet& needed, bool with_map)
    : data_base_(data_base), needed_(needed) {
    if (with_map) map_ = std::make_unique<GrownMap>(data_base, needed);
}
Survey::~Survey() = default;

std::unique_ptr<BlockMap> map_from_finest(const DataBase& data_base, std::vector<BlockBounds> finest) {
    return std::make_unique<GrownMap>(data_base, std::move(finest));
}

std::unique_ptr<Survey::Part> Survey::look(const Window& window, const float* terrain, const float* culture) const {
    auto part = std::make_unique<Part>();
    // Each post of the circle once: the last column may repeat the first.
    const std::int64_t last = data_base_.cyclic ? data_base_.cycle_columns : data_base_.columns;
    const Window own{intersection(window.columns, {0, last}), window.rows};
    part->extremes = post_extremes(terrain, window, own);
    for (std::int64_t r = own.rows.begin; culture && r < own.rows.end; ++r) {
        const std::size_t first = window.at(own.columns.begin, r);
        for (std::size_t i = first; i < first + static_cast<std::size_t>(own.columns.size()); ++i) {
            const float top = terrain[i] + culture[i];
            part->extremes.highest_m = top > part->extremes.highest_m ? top : part->extremes.highest_m;
        }
    }
    if (!map_) return part;
    const Window blocks = blocks_of(window);
    const std::int64_t fine = needed_.edge / block_posts;
    for (std::int64_t r = blocks.rows.begin; r < blocks.rows.end; ++r)
        for (std::int64_t c = blocks.columns.begin; c < blocks.columns.end; ++c) {
            if (!needed_.contains(c / fine, r / fine)) continue;
            const Interval columns = intersection({c * block_posts, (c + 1) * block_posts}, window.columns),
                           rows = intersection({r * block_posts, (r + 1) * block_posts}, window.rows);
            const Interval one_column{columns.begin, columns.begin + 1}, one_row{rows.begin, rows.begin + 1};
            part->blocks.push_back({c, r, bounds_of({columns, rows}, window, terrain, culture),
                                    bounds_of({one_column, rows}, window, terrain, culture),
                                    bounds_of({columns, one_row}, window, terrain, culture),
                                    bounds_of({one_column, one_row}, window, terrain, culture)});
        }
    return part;
}

void Survey::add(const Part& part) {
    found_.add(part.extremes);
    for (const Part::Block& b : part.blocks) {
        const auto give = [&](std::int64_t column, std::int64_t row, const Bounds& bounds) {
            if (row < 0) return;
            if (Bounds* to = map_->growing(column, row)) to->add(bounds);
        };
        give(b.column, b.row, b.own);
        give(b.column - 1, b.row, b.first_column);
        give(b.column, b.row - 1, b.first_row);
        give(b.column - 1, b.row - 1, b.corner);
    }
}

std::unique_ptr<BlockMap> Survey::take_map() {
    if (map_) map_->finish(data_base_, needed_);
    return std::move(map_);
}

// ---------------------------------------------------------------- the pass

namespace {

/// How a pass goes through a raster: windows one beside the other along what one row of file blocks runs over, row after row
/// across; and parts of the file whose windows come one after the other, so that a file's block which no window can hold is
/// decoded once for all of its own. In posts.
struct WindowShape {
    bool by_columns;          ///< a row of file blocks runs down
    std::int64_t high, wide;  ///< of a window, across and along
    std::int64_t part_high, part_wide;
};
WindowShape window_shape(const RasterFacts& f, std::int64_t edge, const Window& wanted, std::int64_t most_posts) {
    const bool by_columns = f.decoded_columns() < f.decoded_rows();
    const std::int64_t along = (by_columns ? wanted.rows : wanted.columns).size(),
                       file_across = by_columns ? f.decoded_columns() : f.decoded_rows(),
                       file_along = by_columns ? f.decoded_rows() : f.decoded_columns(),
                       file_high = up(file_across, edge) * edge, file_wide = up(file_along, edge) * edge;
    const bool cut_along = file_along < along;
    WindowShape s{by_columns, file_high, along, 0, along};
    if (s.high * s.wide <= most_posts) {
        s.high *= std::max<std::int64_t>(1, most_posts / (s.high * s.wide));
    } else if (cut_along && s.high * file_wide <= most_posts) {
        s.wide = most_posts / s.high / file_wide * file_wide;
    } else {
        s.part_high = file_high;
        if (cut_along) s.part_wide = file_wide;
        s.wide = std::min(s.wide, s.part_wide);
        s.high = std::clamp(most_posts / s.wide / edge * edge, edge, file_high);
        if (s.high * s.wide > most_posts) s.wide = std::max(edge, most_posts / s.high / edge * edge);
    }
    s.part_high = std::max(s.part_high, s.high);
    return s;
}

/// Calls of(piece) for the pieces of an interval, in order. Edges at whole multiples, so that the file's blocks are cut by none.
template <class Of>
void for_each_piece(Interval whole, std::int64_t size, const Of& of) {
    for (Interval piece{whole.begin, whole.begin}; piece.end < whole.end;) {
        const std::int64_t next = size >= whole.size() ? whole.end : (block_along(piece.end, size) + 1) * size;
        piece = {piece.end, std::min(next, whole.end)};
        of(piece);
    }
}

/// Windows of whole blocks in the order of the file; together all that must be read.
std::vector<Window> windows_of(const LayerPass& layer, std::int64_t most_posts) {
    const RasterFacts& f = layer.in.facts();
    const std::int64_t edge = layer.blocks.edge;
    const Window all{{0, f.columns}, {0, f.rows}};
    const auto posts_of = [edge](const Window& blocks) {
        return Window{{blocks.columns.begin * edge, blocks.columns.end * edge},
                      {blocks.rows.begin * edge, blocks.rows.end * edge}};
    };
    const Window wanted = layer.read_all ? all : intersection(posts_of(layer.blocks.blocks), all);
    std::vector<Window> windows;
    if (wanted.empty()) return windows;
    const auto add = [&](Window w) {
        if (!layer.read_all) {
            // Only the hull of the blocks needed here.
            const Window blocks = in_blocks(w, edge);
            Window needed;
            for (std::int64_t r = blocks.rows.begin; r < blocks.rows.end; ++r)
                for (std::int64_t c = blocks.columns.begin; c < blocks.columns.end; ++c)
                    if (layer.blocks.contains(c, r)) needed = hull(needed, {{c, c + 1}, {r, r + 1}});
            w = intersection(posts_of(needed), w);
        }
        if (!w.empty()) windows.push_back(w);
    };
    const WindowShape shape = window_shape(f, edge, wanted, most_posts);
    const Interval across = shape.by_columns ? wanted.columns : wanted.rows,
                   along = shape.by_columns ? wanted.rows : wanted.columns;
    for_each_piece(across, shape.part_high, [&](Interval down) {
        for_each_piece(along, shape.part_wide, [&](Interval over) {
            for_each_piece(down, shape.high, [&](Interval a) {
                for_each_piece(over, shape.wide, [&](Interval b) {
                    add(shape.by_columns ? Window{a, b} : Window{b, a});
                });
            });
        });
    });
    return windows;
}

/// Blocks of the file that windows of several threads cannot hold: each would decode them anew, so one reader goes through them.
bool one_by_one(const LayerPass& layer, std::int64_t most_posts) {
    const RasterFacts& f = layer.in.facts();
    const std::int64_t edge = layer.blocks.edge;
    return std::min(f.decoded_rows(), f.decoded_columns()) > edge &&
           f.decoded_rows() * f.decoded_columns() > most_posts;
}

std::size_t tokens_of(const LayerPass& layer, const PassParams& params) {
    const std::size_t threads = static_cast<std::size_t>(std::max(1, params.threads)),
                      tokens = threads + (threads > 1 ? 1 : 0);
    return one_by_one(layer, static_cast<std::int64_t>(params.memory_bytes / (tokens * bytes_a_post))) ? 1 : tokens;
}

std::int64_t posts_a_window(const LayerPass& layer, const PassParams& params) {
    const std::size_t tokens = tokens_of(layer, params);
    return std::clamp<std::int64_t>(static_cast<std::int64_t>(params.memory_bytes / (tokens * bytes_a_post)),
                                    layer.blocks.edge * layer.blocks.edge, most_window_posts);
}

struct Packed {
    struct Block {
        std::int64_t column = 0, row = 0;
        std::vector<std::byte> bytes;
    };
    std::vector<Block> blocks;
    std::unique_ptr<Survey::Part> seen;
};

std::unique_ptr<Packed> read_and_pack(const LayerPass& layer, const Window& window, Timeline* timeline) {
    auto out = std::make_unique<Packed>();
    const RasterFacts& f = layer.in.facts();
    const PackScale scale{f.scale, f.offset, f.unit_m};
    const auto posts = static_cast<std::size_t>(window.posts());
    std::vector<float> heights, culture;
    std::vector<std::int32_t> codes;
    Span reading(timeline, "pass read", "disk");
    reading.add_bytes(posts * static_cast<std::size_t>(f.type_bytes));
    if (layer.codes) {
        codes.resize(posts);
        layer.in.read_codes(window, codes.data());
    } else {
        heights.resize(posts);
        layer.in.read_heights(window, heights.data(), window.columns.size());
    }
    reading.end();
    const Span packing(timeline, "pass pack", "cpu");
    if (layer.survey) {
        if (layer.culture) layer.culture(window, culture);
        out->seen = layer.survey->look(window, heights.data(), culture.empty() ? nullptr : culture.data());
        culture = {};
    }
    const std::int64_t edge = layer.blocks.edge, stride = window.columns.size();
    const Window blocks = in_blocks(window, edge);
    for (std::int64_t r = blocks.rows.begin; r < blocks.rows.end; ++r)
        for (std::int64_t c = blocks.columns.begin; c < blocks.columns.end; ++c) {
            if (!layer.blocks.contains(c, r)) continue;
            const Window block{intersection({c * edge, (c + 1) * edge}, window.columns),
                               intersection({r * edge, (r + 1) * edge}, window.rows)};
            const std::int64_t at =
                (block.rows.begin - window.rows.begin) * stride + block.columns.begin - window.columns.begin;
            Packed::Block& packed = out->blocks.emplace_back();
            packed.column = c;
            packed.row = r;
            if (layer.codes)
                pack_codes(codes.data() + at, stride, block.columns.size(), block.rows.size(), packed.bytes);
            else
                pack_heights(heights.data() + at, stride, block.columns.size(), block.rows.size(), scale, packed.bytes);
        }
    return out;
}

}  // namespace

std::uint64_t posts_of_pass(const LayerPass& layer, const PassParams& params) {
    std::uint64_t posts = 0;
    for (const Window& w : windows_of(layer, posts_a_window(layer, params)))
        posts += static_cast<std::uint64_t>(w.posts());
    return posts;
}

namespace {

/// Bytes of a packed post: integers of two bytes and more hold heights and codes of 16 bits.
std::int64_t packed_width(const LayerPass& layer) {
    const RasterFacts& f = layer.in.facts();
    if (f.type_bytes == 1) return 1;
    return layer.codes || GDALDataTypeIsInteger(f.type) ? 2 : 4;
}

}  // namespace

PassForecast forecast_passes(const std::vector<LayerPass>& layers, const PassParams& params, std::size_t spill_bytes,
                             int buckets) {
    PassForecast sum;
    struct Bucket {
        std::size_t bytes = 0, blocks = 0;
    };
    std::vector<Bucket> held(static_cast<std::size_t>(buckets));
    for (const LayerPass& layer : layers) {
        const std::int64_t edge = layer.blocks.edge, width = packed_width(layer);
        const std::vector<Window> windows = windows_of(layer, posts_a_window(layer, params));
        const std::size_t at_once = std::min(windows.size(), tokens_of(layer, params));
        sum.readers = std::max(sum.readers, std::min(at_once, static_cast<std::size_t>(std::max(1, params.threads))));
        for (const Window& window : windows) {
            sum.window_bytes =
                std::max(sum.window_bytes, at_once * static_cast<std::size_t>(window.posts()) * bytes_a_post);
            sum.read_bytes += static_cast<std::uint64_t>(window.posts() * layer.in.facts().type_bytes);
            const Window blocks = in_blocks(window, edge);
            for (std::int64_t r = blocks.rows.begin; r < blocks.rows.end; ++r)
                for (std::int64_t c = blocks.columns.begin; c < blocks.columns.end; ++c) {
                    if (!layer.blocks.contains(c, r)) continue;
                    const Window posts = layer.spill.layer(layer.layer).posts(c, r);
                    const std::size_t bytes =
                        1 + static_cast<std::size_t>(posts.posts() * width) + Spill::held_overhead;
                    Bucket& bucket = held[static_cast<std::size_t>(layer.place(posts).bucket)];
                    bucket.bytes += bytes;
                    ++bucket.blocks;
                    sum.held_bytes += bytes;
                    while (sum.held_bytes > spill_bytes) {
                        Bucket& most =
                            *std::max_element(held.begin(), held.end(),
                                              [](const Bucket& x, const Bucket& y) { return x.bytes < y.bytes; });
                        if (sum.spilled_bytes == 0) sum.spilled_bytes = Spill::header_bytes;
                        sum.spilled_bytes += most.bytes - most.blocks * (Spill::held_overhead - Spill::file_overhead);
                        sum.held_bytes -= most.bytes;
                        most = {};
                    }
                }
        }
    }
    return sum;
}

PassDone run_pass(const LayerPass& layer, const PassParams& params) {
    const std::vector<Window> windows = windows_of(layer, posts_a_window(layer, params));
    // A pipeline that an error stops drops what waits between its filters without destroying it: so what passes
    // through it is the number of a window, and what was packed is owned here.
    std::vector<std::unique_ptr<Packed>> packed(windows.size());
    std::size_t next = 0;
    PassDone done;
    std::atomic<std::size_t> in_flight{0};  // posts
    Handover handover;
    Span span(params.timeline, "pass", "stage");
    const auto note_memory = [&] {
        if (params.timeline)
            params.timeline->memory(params.fixed_bytes + layer.spill.bytes_held() + in_flight * bytes_a_post);
    };
    const auto give = [&](tbb::flow_control& control) -> std::size_t {
        const Handover::Task task(handover);
        if (params.stop) params.stop->check();
        if (next >= windows.size()) {
            control.stop();
            return {};
        }
        return next++;
    };
    const auto pack = [&](std::size_t i) {
        const Handover::Task task(handover);
        in_flight += static_cast<std::size_t>(windows[i].posts());
        note_memory();
        packed[i] = read_and_pack(layer, windows[i], params.timeline);
        return i;
    };
    const auto take = [&](std::size_t i) {
        const Handover::Task task(handover);
        const std::unique_ptr<Packed> taken = std::move(packed[i]);
        for (const Packed::Block& b : taken->blocks) {
            const WedgeBuckets::Place place = layer.place(layer.spill.layer(layer.layer).posts(b.column, b.row));
            layer.spill.put(layer.layer, b.column, b.row, place.bucket, place.distance, b.bytes);
        }
        if (taken->seen) layer.survey->add(*taken->seen);
        const auto n = static_cast<std::uint64_t>(windows[i].posts());
        done.read_bytes += n * static_cast<std::uint64_t>(layer.in.facts().type_bytes);
        done.held_bytes = std::max(done.held_bytes, layer.spill.bytes_held() + in_flight * bytes_a_post);
        in_flight -= static_cast<std::size_t>(n);
        note_memory();
        if (params.progress) params.progress(n);
    };
    Threads threads(std::max(1, params.threads));
    handover.pass();
    threads.execute([&] {
        tbb::parallel_pipeline(tokens_of(layer, params),
                               tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order, give) &
                                   tbb::make_filter<std::size_t, std::size_t>(tbb::filter_mode::parallel, pack) &
                                   tbb::make_filter<std::size_t, void>(tbb::filter_mode::serial_in_order, take));
    });
    handover.pass();
    span.add_bytes(done.read_bytes);
    return done;
}

// ---------------------------------------------------------------- reading back

SpilledLayer::SpilledLayer(const RasterFacts& facts, Fingerprint fingerprint, std::shared_ptr<Spill> spill,
                           std::size_t layer)
    : fingerprint_(std::move(fingerprint)), scale_{facts.scale, facts.offset, facts.unit_m}, spill_(std::move(spill)),
      layer_(layer) {
    facts_ = facts;
    facts_.block_columns = facts_.block_rows = spill_->layer(layer).edge;
    facts_.rows_in_parts = false;
    prepare();
}

void SpilledLayer::read_values(const Window&, void*, GDALDataType, std::int64_t) {
    throw std::logic_error("SpilledLayer::read_values: a spill does not hold values as stored");
}

bool SpilledLayer::holds(const Window& posts) const {
    const Window blocks = in_blocks(posts, spill_->layer(layer_).edge);
    for (std::int64_t row = blocks.rows.begin; row < blocks.rows.end; ++row)
        for (std::int64_t column = blocks.columns.begin; column < blocks.columns.end; ++column)
            if (!spill_->holds(layer_, column, row)) return false;
    return true;
}

template <class Value, class Unpack>
void SpilledLayer::read(const Window& window, Value none, Value* out, std::int64_t stride, Unpack&& unpack) {
    if (window.empty()) return;
    static thread_local std::vector<std::byte> buffer;
    const SpillLayer& layer = spill_->layer(layer_);
    const Window blocks = in_blocks(window, layer.edge);
    for (std::int64_t r = blocks.rows.begin; r < blocks.rows.end; ++r)
        for (std::int64_t c = blocks.columns.begin; c < blocks.columns.end; ++c) {
            const Window block = layer.posts(c, r);
            const Window part = intersection(block, window);
            Value* to =
                out + (part.rows.begin - window.rows.begin) * stride + part.columns.begin - window.columns.begin;
            const std::span<const std::byte> bytes = spill_->get(layer_, c, r, buffer);
            if (bytes.empty()) {
                for (std::int64_t y = 0; y < part.rows.size(); ++y)
                    std::fill_n(to + y * stride, part.columns.size(), none);
                continue;
            }
            const Window inside{{part.columns.begin - block.columns.begin, part.columns.end - block.columns.begin},
                                {part.rows.begin - block.rows.begin, part.rows.end - block.rows.begin}};
            if (!unpack(bytes, block, inside, to))
                throw DataError(text("the spill of ", facts_.named(), ": block at column ", block.columns.begin,
                                     ", row ", block.rows.begin, " is no block of its size"));
        }
}

void SpilledLayer::read_heights(const Window& window, float* out, std::int64_t stride) {
    read(window, std::numeric_limits<float>::quiet_NaN(), out, stride,
         [&](std::span<const std::byte> bytes, const Window& block, const Window& inside, float* to) {
             return unpack_heights(bytes, block.columns.size(), block.rows.size(), scale_, inside, to, stride);
         });
}

void SpilledLayer::read_codes(const Window& window, std::int32_t* out) {
    const std::int64_t stride = window.columns.size();
    read(window, void_code, out, stride,
         [&](std::span<const std::byte> bytes, const Window& block, const Window& inside, std::int32_t* to) {
             return unpack_codes(bytes, block.columns.size(), block.rows.size(), inside, to, stride);
         });
}

}  // namespace wedgescope
