#include "tiles/sources.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <mutex>
#include <numeric>
#include <queue>
#include <stdexcept>
#include <utility>
#include <vector>

#include "lib/error.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/georeference.hpp"
#include "tiles/needed_posts.hpp"
#include "tiles/raster_file.hpp"
#include "tiles/registered_layer.hpp"
#include "tiles/tile_ledger.hpp"
#include "tiles/tile_store.hpp"

namespace wedgescope {
namespace {

/// Lowest and highest of many floats, NaN left out; in lanes, so that no comparison waits for the one before.
class Range {
public:
    /// Returns the number of NaN.
    std::uint64_t add(const std::vector<float>& values) {
        std::uint32_t none[lanes] = {};
        const std::size_t whole = values.size() / lanes * lanes;
        for (std::size_t i = 0; i < whole; i += lanes)
            for (std::size_t k = 0; k < lanes; ++k) {
                const float z = values[i + k];
                none[k] += z != z;
                low_[k] = z < low_[k] ? z : low_[k];
                high_[k] = z > high_[k] ? z : high_[k];
            }
        for (std::size_t i = whole; i < values.size(); ++i) {
            const float z = values[i];
            none[0] += z != z;
            low_[0] = z < low_[0] ? z : low_[0];
            high_[0] = z > high_[0] ? z : high_[0];
        }
        return std::accumulate(std::begin(none), std::end(none), std::uint64_t{0});
    }
    float lowest() const { return *std::min_element(low_.begin(), low_.end()); }
    float highest() const { return *std::max_element(high_.begin(), high_.end()); }

private:
    static constexpr std::size_t lanes = 16;
    static std::array<float, lanes> filled(float value) {
        std::array<float, lanes> out;
        out.fill(value);
        return out;
    }
    std::array<float, lanes> low_ = filled(std::numeric_limits<float>::infinity());
    std::array<float, lanes> high_ = filled(-std::numeric_limits<float>::infinity());
};

class DirectSource final : public WedgeSource {
public:
    explicit DirectSource(const DataBaseParams& params) : params_(params) {
        std::unique_ptr<RasterLayer> culture, height;
        if (is_tile_store(params_.dem)) {
            // A quarter is left to GDAL, for layers beside the store and for what is written.
            GdalSession::set_cache_bytes(params_.cache_bytes / 4);
            store_ = std::make_unique<TileStore>(params_.dem, params_.cache_bytes / 4 * 3);
            terrain_ = store_->layer(StoreLayerKind::dem);
            if (params_.culture.empty()) {
                culture = store_->layer(StoreLayerKind::culture);
                if (!params_.legend) params_.legend = store_->legend();
            }
            if (params_.culture_height.empty()) {
                height = store_->layer(StoreLayerKind::culture_height);
                map_ = store_->block_map(params_.culture_height_scale);
            }
        } else {
            terrain_ = std::make_unique<RasterFile>("dem", params_.dem);
        }
        if (!params_.culture.empty()) culture = std::make_unique<RasterFile>("culture", params_.culture);
        if (!params_.culture_height.empty())
            height = std::make_unique<RasterFile>("culture-height", params_.culture_height);

        const RasterFacts& facts = terrain_->facts();
        if (facts.columns < 2 || facts.rows < 2)
            throw DataError(
                text(facts.named(), " has ", facts.columns, " x ", facts.rows, " posts; accepted: at least 2 x 2"));
        data_base_ = describe(facts);
        data_base_.default_class = params_.default_class;
        ledger_ = std::make_unique<TileLedger>(facts);
        if (culture) open_culture(std::move(culture));
        if (!height) return;
        if (!(params_.culture_height_scale >= 0) || !std::isfinite(params_.culture_height_scale))
            throw InputError(
                text("culture-height-scale is ", params_.culture_height_scale, "; accepted: a number from 0 up"));
        height_ = std::make_unique<RegisteredLayer>(std::move(height), facts);
        data_base_.has_culture_height = true;
    }

    const DataBase& data_base() const override { return data_base_; }

    using WedgeSource::load;
    Chunk load(const ChunkRequest& request) override {
        const Window& window = request.window;
        if (window.empty() || window.rows.begin < 0 || window.rows.end > data_base_.rows ||
            (!data_base_.cyclic && (window.columns.begin < 0 || window.columns.end > data_base_.columns)))
            throw std::out_of_range("load: window outside the raster");
        Chunk chunk;
        chunk.window = window;
        chunk.lines_are_columns = request.lines_are_columns;
        if (const auto height = request.flat_m()) {
            pass_surface(request);
            chunk.flat = true;
            chunk.surface_m.assign(static_cast<std::size_t>(chunk.minor_count()), *height);
        } else {
            load_surface(chunk, NeededPosts(request));
        }
        return chunk;
    }

    LoadCost cost(const ChunkRequest& request) const override {
        const auto posts = static_cast<std::uint64_t>(request.window.posts());
        LoadCost cost{posts, posts * static_cast<std::uint64_t>(terrain_->facts().type_bytes), posts * sizeof(float),
                      0};
        const std::int64_t width = request.window.columns.size(), rows = request.window.rows.size();
        const auto slab =
            static_cast<std::size_t>(width * std::min(rows, std::max<std::int64_t>(1, slab_posts / width)));
        cost.beside_bytes = request.lines_are_columns ? slab * sizeof(float) : 0;
        if (height_) {
            const double cells = std::fabs(height_->columns().scale * height_->rows().scale);
            cost.bytes += static_cast<std::uint64_t>(static_cast<double>(posts) * cells) *
                          static_cast<std::uint64_t>(height_->facts().type_bytes);
            cost.chunk_bytes *= 2;
            cost.beside_bytes += 2 * slab * sizeof(float);
        }
        if (store_) {  // one tile as it is decoded, and packed
            const RasterFacts& f = terrain_->facts();
            cost.beside_bytes += static_cast<std::size_t>(2 * f.block_columns * f.block_rows * f.type_bytes);
        }
        return cost;
    }

    std::uint64_t class_bytes(const Window& cells) const override {
        return WedgeSource::class_bytes(cells) * static_cast<std::uint64_t>(culture_->facts().type_bytes);
    }

    CultureCells load_classes(const Window& window) override {
        if (!culture_) throw std::out_of_range("load_classes: there is no culture");
        CultureCells cells;
        cells.window = window;
        cells.classes.assign(static_cast<std::size_t>(window.posts()), params_.default_class);
        bool any_unknown = false;
        const std::int64_t read = culture_->read_codes(
            window, [&](std::int64_t row, std::int64_t at, const std::int32_t* codes, std::int64_t n) {
                ClassId* to = cells.classes.data() + row * window.columns.size() + at;
                bool unknown = false;
                for (std::int64_t i = 0; i < n; ++i) {
                    const ClassId id = class_of(codes[i]);
                    unknown |= id == unknown_class;
                    to[i] = id;
                }
                any_unknown |= unknown;
            });
        cells.bytes_read = static_cast<std::uint64_t>(read * culture_->facts().type_bytes);
        if (!any_unknown) return cells;
        cells.codes.assign(cells.classes.size(), void_code);
        culture_->read_codes(window, [&](std::int64_t row, std::int64_t at, const std::int32_t* codes, std::int64_t n) {
            std::copy_n(codes, n, cells.codes.data() + row * window.columns.size() + at);
        });
        return cells;
    }

    float bare_terrain_m(std::int64_t column, std::int64_t row) override {
        if (data_base_.cyclic) column = wrapped(column);
        if (column < 0 || column >= data_base_.columns || row < 0 || row >= data_base_.rows)
            throw std::out_of_range("bare_terrain_m: post outside the raster");
        float z = 0;
        terrain_->read_heights({{column, column + 1}, {row, row + 1}}, &z, 1);
        return z;
    }

    Extremes extremes() override {
        const std::lock_guard lock(extremes_mutex_);
        if (!extremes_) extremes_ = find_extremes();
        return *extremes_;
    }

    BlockMap* block_map() override { return map_.get(); }

    Skipped skipped() const override {
        Skipped sum{};
        ledger_->add_to(sum);
        for (const auto* layer : {culture_.get(), height_.get()})
            if (layer) layer->ledger().add_to(sum);
        return sum;
    }

    std::size_t cache_bytes() const override {
        // Of a store also pages of the block map and the sheets that wait open, 4 MiB each at the most.
        constexpr std::size_t of_store = std::size_t{8} << 20;
        std::size_t bytes = params_.cache_bytes + ledger_->bytes() + (store_ ? of_store : 0);
        for (const auto* layer : {culture_.get(), height_.get()})
            if (layer) bytes += layer->ledger().bytes();
        return bytes;
    }

private:
    void open_culture(std::unique_ptr<RasterLayer> raster) {
        if (!params_.legend)
            throw InputError(
                "culture needs culture-legend; accepted: fbfm40, nlcd, worldcover, smc or a CSV file of code,material");
        culture_ = std::make_unique<RegisteredLayer>(std::move(raster), terrain_->facts());
        const RasterFacts& facts = culture_->facts();
        if (facts.scale != 1 || facts.offset != 0)
            throw DataError(text(facts.named(), " has band scale ", facts.scale, " and offset ", facts.offset,
                                 "; accepted: plain codes, scale 1 and offset 0"));
        data_base_.has_culture = true;
        data_base_.culture_name = facts.path;
        data_base_.legend_name = params_.legend ? params_.legend->name() : "none";
        data_base_.culture_column_offset = culture_->columns().offset;
        data_base_.culture_column_scale = culture_->columns().scale;
        data_base_.culture_row_offset = culture_->rows().offset;
        data_base_.culture_row_scale = culture_->rows().scale;
        data_base_.culture_columns = facts.columns;
        data_base_.culture_rows = facts.rows;
        data_base_.culture_tile_columns = std::clamp<std::int64_t>(facts.block_columns, 64, 512);
        data_base_.culture_tile_rows = std::clamp<std::int64_t>(facts.block_rows, 64, 512);
        class_of_.resize(table_size, unknown_class);
        for (std::int32_t code = table_begin; code < table_begin + table_size; ++code)
            if (const auto id = params_.legend->find(code))
                class_of_[static_cast<std::size_t>(code - table_begin)] = *id;
    }

    std::int64_t wrapped(std::int64_t column) const {
        const std::int64_t cycle = data_base_.cycle_columns;
        const std::int64_t rest = column % cycle;
        return rest < 0 ? rest + cycle : rest;
    }

    /// The terrain columns of a window, in runs that can be read.
    std::vector<Run> terrain_runs(Interval columns) const {
        if (!data_base_.cyclic || (columns.begin >= 0 && columns.end <= data_base_.columns))
            return {{0, columns.size(), columns}};
        std::vector<std::int64_t> source(static_cast<std::size_t>(columns.size()));
        for (std::size_t i = 0; i < source.size(); ++i)
            source[i] = wrapped(columns.begin + static_cast<std::int64_t>(i));
        return runs(source, 1);
    }

    /// Rows read at a time for a window so wide: whole rows of blocks where they fit.
    std::vector<Interval> slabs(Interval rows, std::int64_t width) const {
        const std::int64_t block = data_base_.block_rows;
        std::int64_t high = std::max<std::int64_t>(1, slab_posts / width);
        if (high >= block) high = high / block * block;
        std::vector<Interval> found;
        for (std::int64_t r = rows.begin; r < rows.end;) {
            std::int64_t end = r + high;
            if (high >= block) end -= end % block;  // to the next edge of blocks
            end = std::min(end, rows.end);
            found.push_back({r, end});
            r = end;
        }
        return found;
    }

    /// Row-major `from` (rows x width) into lines of columns of `minor` posts, from post `at` of each line on.
    static void turn(const float* from, std::int64_t rows, std::int64_t width, float* to, std::int64_t minor,
                     std::int64_t at) {
        constexpr std::int64_t edge = 16;  // 16 floats fill a cache line
        for (std::int64_t r0 = 0; r0 < rows; r0 += edge)
            for (std::int64_t c0 = 0; c0 < width; c0 += edge) {
                const std::int64_t r1 = std::min(r0 + edge, rows), c1 = std::min(c0 + edge, width);
                for (std::int64_t c = c0; c < c1; ++c)
                    for (std::int64_t r = r0; r < r1; ++r) to[c * minor + at + r] = from[r * width + c];
            }
    }

    void load_surface(Chunk& chunk, const NeededPosts& needed) {
        const Interval columns = chunk.window.columns, rows = chunk.window.rows;
        const std::int64_t width = columns.size(), minor = chunk.minor_count();
        const auto posts = static_cast<std::size_t>(chunk.window.posts());
        const std::vector<Run> terrain = terrain_runs(columns);
        RegisteredLayer::Plan plan;
        if (height_) plan = height_->plan(columns);
        chunk.surface_m.resize(posts);
        std::vector<float> slab, culture, scratch;
        for (const Interval part : slabs(rows, width)) {
            const auto n = static_cast<std::size_t>(part.size() * width);
            const std::int64_t first = part.begin - rows.begin;
            float* surface = chunk.surface_m.data() + first * width;
            if (chunk.lines_are_columns) {
                slab.resize(n);
                surface = slab.data();
            }
            for (const Run& run : terrain)
                chunk.posts_read += read_terrain(run, columns.begin, part, needed, surface, width);
            if (culture_) pass_layer(*culture_, {columns, part}, needed);
            if (height_) {
                culture.resize(n);
                const std::int64_t read =
                    height_->read_heights(plan, part, params_.culture_height_scale, needed, culture.data(), scratch);
                chunk.bytes_read += static_cast<std::size_t>(read * height_->facts().type_bytes);
                for (std::size_t i = 0; i < n; ++i) surface[i] += culture[i];
            }
            needed.fill({columns, part}, surface, height_ ? culture.data() : nullptr);
            if (height_ && std::any_of(culture.begin(), culture.end(), [](float h) { return h != 0; })) {
                chunk.culture_height_m.resize(posts);
                if (chunk.lines_are_columns)
                    turn(culture.data(), part.size(), width, chunk.culture_height_m.data(), minor, first);
                else
                    std::copy(culture.begin(), culture.end(), chunk.culture_height_m.begin() + first * width);
            }
            if (chunk.lines_are_columns) turn(slab.data(), part.size(), width, chunk.surface_m.data(), minor, first);
        }
        chunk.bytes_read += chunk.posts_read * static_cast<std::uint64_t>(terrain_->facts().type_bytes);
    }

    /// What is needed of one run of the columns that begin at `first`; returns posts read.
    std::uint64_t read_terrain(const Run& run, std::int64_t first, Interval rows, const NeededPosts& needed, float* out,
                               std::int64_t stride) {
        const std::int64_t shift = first + run.at - run.source.begin;
        if (needed.all()) {
            ledger_->touch({run.source, rows});
            terrain_->read_heights({run.source, rows}, out + run.at, stride);
            return static_cast<std::uint64_t>(run.source.size() * rows.size());
        }
        std::uint64_t read = 0;
        for_each_tile_run(
            terrain_->facts(), {run.source, rows},
            [&](const Window& cells) {
                return needed.reason({{cells.columns.begin + shift, cells.columns.end + shift}, cells.rows});
            },
            [&](const Window& cells) {
                ledger_->touch(cells);
                terrain_->read_heights(
                    cells, out + (cells.rows.begin - rows.begin) * stride + cells.columns.begin + shift - first,
                    stride);
                read += static_cast<std::uint64_t>(cells.posts());
            },
            [&](const Window& cells, Skip why) { ledger_->pass(cells, why); });
        return read;
    }

    /// Notes why nothing of a request's posts is read.
    void pass_surface(const ChunkRequest& request) {
        const NeededPosts needed(request);
        const Window& window = request.window;
        for (const Run& run : terrain_runs(window.columns)) {
            const std::int64_t shift = window.columns.begin + run.at - run.source.begin;
            const auto reason = [&](const Window& cells) {
                return needed.reason({{cells.columns.begin + shift, cells.columns.end + shift}, cells.rows});
            };
            for_each_tile_run(
                terrain_->facts(), {run.source, window.rows}, reason, [](const Window&) {},
                [&](const Window& cells, Skip why) { ledger_->pass(cells, why); });
        }
        for (auto* layer : {culture_.get(), height_.get()})
            if (layer) pass_layer(*layer, window, needed);
    }

    /// Notes why a layer under these posts may stay unread: for the ground's reason, or because nothing sees it.
    static void pass_layer(RegisteredLayer& layer, const Window& posts, const NeededPosts& needed) {
        const auto pass = [&](const Window& part) {
            const Skip why = needed.reason(part);
            layer.pass(part, why == Skip::none ? Skip::culture : why);
        };
        if (needed.all()) return pass(posts);
        const Window blocks = blocks_of(posts);
        for (std::int64_t r = blocks.rows.begin; r < blocks.rows.end; ++r)
            for (std::int64_t c = blocks.columns.begin; c < blocks.columns.end; ++c)
                pass({intersection(posts.columns, {c * block_posts, (c + 1) * block_posts}),
                      intersection(posts.rows, {r * block_posts, (r + 1) * block_posts})});
    }

    ClassId class_of(std::int32_t code) const {
        const std::int64_t at = static_cast<std::int64_t>(code) - table_begin;
        if (at >= 0 && at < table_size) return class_of_[static_cast<std::size_t>(at)];
        if (code == void_code) return params_.default_class;
        return params_.legend->find(code).value_or(unknown_class);
    }

    Extremes find_extremes() {
        if (store_ && (!height_ || map_)) return store_extremes();
        Extremes out;
        Range bare, surface;
        std::vector<float> terrain, culture, scratch;
        const ChunkRequest everything;
        const NeededPosts all(everything);
        for_each_window(terrain_->facts(), terrain_->facts().own_columns(), slab_posts, [&](const Window& window) {
            const auto n = static_cast<std::size_t>(window.posts());
            terrain.resize(n);
            terrain_->read_heights(window, terrain.data(), window.columns.size());
            out.void_posts += bare.add(terrain);
            if (!height_) return;
            culture.resize(n);
            height_->read_heights(height_->plan(window.columns), window.rows, params_.culture_height_scale, all,
                                  culture.data(), scratch);
            for (std::size_t i = 0; i < n; ++i) terrain[i] += culture[i];
            surface.add(terrain);
        });
        out.any_valid = bare.lowest() <= bare.highest();
        if (out.any_valid) {
            out.lowest_m = bare.lowest();
            out.highest_m = height_ ? surface.highest() : bare.highest();
        }
        return out;
    }

    /// From what the store knows; with culture height a few blocks are read, the most promising first.
    Extremes store_extremes() {
        Extremes out = store_->terrain_extremes();
        if (!height_ || !out.any_valid) return out;
        struct Candidate {
            float bound;
            int level;
            std::int64_t column, row;
            bool operator<(const Candidate& other) const { return bound < other.bound; }
        };
        std::priority_queue<Candidate> candidates;
        const Interval all_columns{0, terrain_->facts().own_columns()}, all_rows{0, data_base_.rows};
        const auto add = [&](int level, const Window& blocks) {
            const BlockWindow found = map_->read(level, blocks);
            for (std::int64_t r = blocks.rows.begin; r < blocks.rows.end; ++r)
                for (std::int64_t c = blocks.columns.begin; c < blocks.columns.end; ++c) {
                    const BlockBounds& b = found.at(c, r);
                    if (b.voids != Voids::all) candidates.push({b.highest_m + b.culture_m, level, c, r});
                }
        };
        const int top = map_->levels() - 1;
        add(top, blocks_of({{0, data_base_.columns}, all_rows}, top));
        float highest = out.highest_m;  // of the bare terrain
        while (!candidates.empty() && candidates.top().bound > highest) {
            const Candidate c = candidates.top();
            candidates.pop();
            const std::int64_t edge = block_posts << c.level;
            const Window posts{intersection(all_columns, {c.column * edge, (c.column + 1) * edge}),
                               intersection(all_rows, {c.row * edge, (c.row + 1) * edge})};
            if (posts.empty()) continue;
            if (c.level > 0) {
                add(c.level - 1, blocks_of(posts, c.level - 1));
                continue;
            }
            for (const float z : load(posts, false).surface_m) highest = z > highest ? z : highest;
        }
        out.highest_m = highest;
        return out;
    }

    static constexpr std::int32_t table_begin = -32768, table_size = 32768 + 65536;

    DataBaseParams params_;
    std::unique_ptr<TileStore> store_;  ///< null: plain rasters
    std::unique_ptr<BlockMap> map_;
    std::unique_ptr<RasterLayer> terrain_;
    std::unique_ptr<TileLedger> ledger_;  ///< of the terrain
    std::unique_ptr<RegisteredLayer> culture_, height_;
    std::vector<ClassId> class_of_;  ///< of codes from table_begin on
    DataBase data_base_;
    std::mutex extremes_mutex_;
    std::optional<Extremes> extremes_;
};

}  // namespace

std::unique_ptr<WedgeSource> open_direct_source(const DataBaseParams& params) {
    if (params.dem.empty()) throw InputError("dem is missing; accepted: the path of a raster of heights");
    return std::make_unique<DirectSource>(params);
}

}  // namespace wedgescope
