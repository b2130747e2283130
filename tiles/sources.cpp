#include "tiles/sources.hpp"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <locale>
#include <mutex>
#include <numeric>
#include <queue>
#include <sstream>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "lib/detail.hpp"
#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "lib/transpose.hpp"
#include "tiles/checksum.hpp"
#include "tiles/detail_map_file.hpp"
#include "tiles/file_stamp.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/georeference.hpp"
#include "tiles/ground_map.hpp"
#include "tiles/needed_posts.hpp"
#include "tiles/partition.hpp"
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

/// Cells that may be read for these posts; all columns where a window leaves a raster that spans the circle.
std::vector<Window> cells_under(const Axis& columns, const Axis& rows, const std::vector<Window>& posts) {
    constexpr std::int64_t margin = 2;
    const auto side = [](const Axis& axis, Interval part) {
        const Interval all{0, axis.cells}, under = axis.under({part.begin - margin, part.end + margin});
        return axis.circle > 0 && intersection(under, all) != under ? all : intersection(under, all);
    };
    std::vector<Window> cells;
    for (const Window& window : posts)
        if (const Window under{side(columns, window.columns), side(rows, window.rows)}; !under.empty())
            cells.push_back(under);
    return cells;
}

/// Chunks of whatever layers there are: rasters, a store's, or blocks that a partition put in their place.
class RasterSource : public WedgeSource {
public:
    explicit RasterSource(const DataBaseParams& params) : params_(params) {
        std::unique_ptr<RasterLayer> culture, height;
        if (is_tile_store(params_.dem)) {
            // A quarter is left to GDAL, for layers beside the store and for what is written.
            GdalSession::set_cache_bytes(params_.cache_bytes - store_share(params_.cache_bytes));
            store_ = std::make_unique<TileStore>(params_.dem, store_share(params_.cache_bytes));
            terrain_ = store_->layer(StoreLayerKind::dem);
            if (params_.culture.empty()) {
                culture = store_->layer(StoreLayerKind::culture);
                if (!params_.legend) params_.legend = store_->legend(params_.materials);
            }
            if (params_.culture_height.empty()) {
                has_detail_ = store_->has_detail_map();
                height = store_->layer(StoreLayerKind::culture_height);
                map_ = store_->block_map(params_.culture_height_scale);
            }
        } else {
            terrain_ = std::make_unique<RasterFile>("dem", params_.dem);
        }
        if (!params_.culture.empty()) culture = std::make_unique<RasterFile>("culture", params_.culture);
        if (!params_.culture_height.empty())
            height = std::make_unique<RasterFile>("culture-height", params_.culture_height);

        if (!map_ && params_.ground) {
            map_ = params_.ground->block_map(params_.culture_height_scale);
            has_detail_ = of_ground_ = true;
        }

        const RasterFacts& facts = terrain_->facts();
        if (facts.columns < 2 || facts.rows < 2)
            throw DataError(
                text(facts.named(), " has ", facts.columns, " x ", facts.rows, " posts; accepted: at least 2 x 2"));
        if (params_.by_strips && !culture && !height) limit_cache(strips_bytes(facts));
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
        data_base_.post_bytes += height_->facts().type_bytes;
    }

    const DataBase& data_base() const override { return data_base_; }

    using WedgeSource::load;
    Chunk load(const ChunkRequest& request) override {
        const Window& window = request.window;
        if (window.empty() || window.rows.begin < 0 || window.rows.end > posts_at(data_base_.rows, request.level) ||
            (!data_base_.cyclic &&
             (window.columns.begin < 0 || window.columns.end > posts_at(data_base_.columns, request.level))))
            throw std::out_of_range("load: window outside the raster");
        Chunk chunk;
        chunk.window = window;
        chunk.lines_are_columns = request.lines_are_columns;
        if (const auto height = request.flat_m()) {
            pass_surface(request);
            chunk.flat = true;
            chunk.surface_m.assign(static_cast<std::size_t>(chunk.minor_count()), *height);
        } else if (request.level > 0) {
            load_level(chunk, request);
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
        if (request.level > 0) {
            cost.beside_bytes += terrain_->level_bytes();
        } else if (height_) {
            const double cells = std::fabs(height_->columns().scale * height_->rows().scale);
            cost.bytes += static_cast<std::uint64_t>(static_cast<double>(posts) * cells) *
                          static_cast<std::uint64_t>(height_->facts().type_bytes);
            cost.chunk_bytes *= 2;
            cost.beside_bytes += 2 * slab * sizeof(float);
        }
        cost.beside_bytes += reader_bytes();
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

    std::uint64_t fingerprint(const std::vector<Window>& posts) override {
        Checksum sum;
        Axis columns, rows;
        columns.cells = data_base_.columns;
        columns.circle = static_cast<double>(data_base_.cycle_columns);
        rows.cells = data_base_.rows;
        sum.add(terrain_->fingerprint(cells_under(columns, rows, posts)));
        for (auto* layer : {culture_.get(), height_.get()})
            sum.add(layer ? layer->raster().fingerprint(cells_under(layer->columns(), layer->rows(), posts)) : 0);
        return sum.value();
    }

    BlockMap* block_map() override { return map_.get(); }
    /// Opened when it is asked for: whoever uses no levels needs no such file.
    DetailMap* detail_map() override {
        if (!has_detail_) return nullptr;
        const std::lock_guard lock(detail_mutex_);
        if (!detail_) {
            const double scale = params_.culture_height_scale;
            detail_ = of_ground_ ? params_.ground->detail_map(scale) : TileStore(params_.dem, 0).detail_map(scale);
        }
        return detail_.get();
    }

    Skipped skipped() const override {
        Skipped sum{};
        ledger_->add_to(sum);
        for (const auto* layer : {culture_.get(), height_.get()})
            if (layer) layer->ledger().add_to(sum);
        // Tiles that only levels were read of are not saved whole.
        SkipCount& detail = sum[static_cast<std::size_t>(Skip::detail)];
        const std::uint64_t read = std::min(detail.posts, level_posts_.load());
        detail.posts -= read;
        detail.bytes -= std::min(detail.bytes, read * static_cast<std::uint64_t>(terrain_->facts().type_bytes));
        return sum;
    }

    std::size_t cache_bytes() const override {
        // Of a store also pages of the block map and the sheets that wait open.
        constexpr std::size_t pages = (std::size_t{4} << 20) + DetailMapFile::most_bytes;
        std::size_t idle = 0;
        for (const RasterLayer* layer : readers()) idle += layer->idle_bytes();
        // And what culling and levels by a map that is yet to be made may take of the sweep's share.
        constexpr std::size_t to_come = std::size_t{2} << 20;
        const bool expected = params_.expects_ground && !of_ground_;
        return params_.cache_bytes + ledger_bytes() + idle + (store_ || of_ground_ || expected ? pages : 0) +
               (expected ? to_come : 0);
    }
    std::size_t filled_bytes(std::uint64_t bytes_read) const override {
        const std::size_t cache = params_.cache_bytes;
        return cache_bytes() - cache + static_cast<std::size_t>(std::min<std::uint64_t>(cache, bytes_read));
    }
    std::size_t held_bytes() const override {
        const auto blocks = static_cast<std::size_t>(GDALGetCacheUsed64()), tiles = store_ ? store_->cached_bytes() : 0;
        return filled_bytes(blocks + tiles);
    }

    /// One layer is read at a time, but a handle keeps its buffers.
    std::size_t reader_bytes() const override {
        ReaderBytes all;
        for (const RasterLayer* layer : readers()) {
            const ReaderBytes own = layer->reader_bytes();
            all = {std::max(all.decoded, own.decoded), all.packed + own.packed};
        }
        return all.decoded + all.packed;
    }

protected:
    /// A quarter is left to GDAL, for layers beside the store and for what is written.
    static std::size_t store_share(std::size_t cache_bytes) { return cache_bytes / 4 * 3; }

    /// A cache for the blocks under one strip in each of the four quadrants, and some more.
    static std::size_t strips_bytes(const RasterFacts& facts) {
        constexpr std::int64_t strip = 256;
        const double posts =
            static_cast<double>(facts.columns) * static_cast<double>(std::max(facts.block_rows, strip)) +
            static_cast<double>(facts.rows) * static_cast<double>(std::max(facts.block_columns, strip));
        return static_cast<std::size_t>(2 * posts * 1.25 * static_cast<double>(facts.type_bytes) * 4 / 3);
    }

    void limit_cache(std::size_t bytes) {
        if (bytes >= params_.cache_bytes) return;
        params_.cache_bytes = bytes;
        GdalSession::set_cache_bytes(store_ ? bytes - store_share(bytes) : bytes);
        if (store_) store_->limit_cache(store_share(bytes));
    }

    std::vector<RasterLayer*> readers() const {
        std::vector<RasterLayer*> all{terrain_.get()};
        if (height_) all.push_back(&height_->raster());
        if (culture_) all.push_back(&culture_->raster());
        return all;
    }

    std::size_t ledger_bytes() const {
        std::size_t bytes = ledger_->bytes();
        for (const auto* layer : {culture_.get(), height_.get()})
            if (layer) bytes += layer->ledger().bytes();
        return bytes;
    }

    void open_culture(std::unique_ptr<RasterLayer> raster) {
        if (!params_.legend)
            throw InputError(
                "culture needs culture-legend; accepted: fbfm40, nlcd, worldcover, smc, rat (its own attribute table) "
                "or a "
                "CSV file of code,material");
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
        for (const auto& [code, id] : params_.legend->classes())
            if (code >= table_begin && code < table_begin + table_size)
                class_of_[static_cast<std::size_t>(code - table_begin)] = id;
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
        const auto columns = static_cast<std::size_t>(width);
        transpose_floats(from, columns, static_cast<std::size_t>(rows), columns, to + at,
                         static_cast<std::size_t>(minor));
    }

    /// Posts of a level of detail: bare terrain, for levels are used where no culture height stands.
    void load_level(Chunk& chunk, const ChunkRequest& request) {
        const NeededPosts needed(request);
        const Interval columns = chunk.window.columns, rows = chunk.window.rows;
        const std::int64_t width = columns.size(), minor = chunk.minor_count();
        chunk.surface_m.resize(static_cast<std::size_t>(chunk.window.posts()));
        RawVector<float> slab;
        for (const Interval part : slabs(rows, width)) {
            const std::int64_t first = part.begin - rows.begin;
            float* surface = chunk.surface_m.data() + first * width;
            if (chunk.lines_are_columns) {
                slab.resize(static_cast<std::size_t>(part.size() * width));
                surface = slab.data();
            }
            for_each_tile_run(
                terrain_->facts(), {columns, part}, [&](const Window& posts) { return needed.reason(posts); },
                [&](const Window& posts) {
                    terrain_->read_level(
                        request.level, posts,
                        surface + (posts.rows.begin - part.begin) * width + posts.columns.begin - columns.begin, width);
                    chunk.posts_read += static_cast<std::uint64_t>(posts.posts());
                },
                [](const Window&, Skip) {});
            needed.fill({columns, part}, surface, nullptr);
            if (chunk.lines_are_columns) turn(slab.data(), part.size(), width, chunk.surface_m.data(), minor, first);
        }
        pass_surface(request);
        chunk.bytes_read += chunk.posts_read * static_cast<std::uint64_t>(terrain_->facts().type_bytes);
        level_posts_ += chunk.posts_read;
    }

    void load_surface(Chunk& chunk, const NeededPosts& needed) {
        const Interval columns = chunk.window.columns, rows = chunk.window.rows;
        const std::int64_t width = columns.size(), minor = chunk.minor_count();
        const auto posts = static_cast<std::size_t>(chunk.window.posts());
        const std::vector<Run> terrain = terrain_runs(columns);
        RegisteredLayer::Plan plan;
        if (height_) plan = height_->plan(columns);
        chunk.surface_m.resize(posts);
        RawVector<float> slab;
        std::vector<float> culture, scratch;
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
                if (chunk.culture_height_m.empty()) chunk.culture_height_m.assign(posts, 0);
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
                const auto moved = [](const Window& w, std::int64_t by) {
                    return Window{{w.columns.begin + by, w.columns.end + by}, w.rows};
                };
                needed.each_part(moved(cells, shift), [&](const Window& posts) {
                    terrain_->read_heights(moved(posts, -shift),
                                           out + (posts.rows.begin - rows.begin) * stride + posts.columns.begin - first,
                                           stride);
                });
                read += static_cast<std::uint64_t>(cells.posts());
            },
            [&](const Window& cells, Skip why) { ledger_->pass(cells, why); });
        return read;
    }

    /// Notes why nothing of a request's posts is read.
    void pass_surface(const ChunkRequest& request) {
        const NeededPosts needed(request);
        const Window& window = request.window;
        if (request.level > 0) return pass_level(request, needed);
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

    /// And of a request for a level: what it keeps is left out for the level's sake, the rest for its own reason.
    void pass_level(const ChunkRequest& request, const NeededPosts& needed) {
        const int level = request.level;
        const auto why = [&](const Window& posts) {
            const Skip reason = needed.reason(posts);
            return reason == Skip::none ? Skip::detail : reason;
        };
        // In pieces that lie in one tile of the file.
        const auto unit = [&](std::int64_t tile) { return std::max<std::int64_t>(1, tile >> level); };
        const std::int64_t wide = unit(terrain_->facts().block_columns), high = unit(terrain_->facts().block_rows);
        const Window& window = request.window;
        for (std::int64_t r = window.rows.begin; r < window.rows.end;) {
            const std::int64_t r_end = std::min(window.rows.end, (r / high + 1) * high);
            for (std::int64_t c = window.columns.begin; c < window.columns.end;) {
                const std::int64_t c_end = std::min(window.columns.end, (c / wide + 1) * wide);
                const Window posts{{c, c_end}, {r, r_end}};
                const Skip reason = why(posts);
                ledger_->pass(raster_posts(posts, level), reason);
                if (culture_)
                    culture_->pass(raster_posts(posts, level), reason == Skip::detail ? Skip::culture : reason);
                if (height_) height_->pass(raster_posts(posts, level), reason);
                c = c_end;
            }
            r = r_end;
        }
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
        if (const auto known = bare_extremes(); known && (!height_ || map_)) return known_extremes(*known);
        Extremes out;
        Range bare, surface;
        std::vector<float> terrain, culture, scratch;
        const ChunkRequest everything;
        const NeededPosts all(everything);
        for_each_window(terrain_->facts(), terrain_->facts().own_columns(), slab_posts, [&](const Window& window) {
            if (params_.stop) params_.stop->check();
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

    /// Of the bare terrain, where a store or a map knows them.
    std::optional<Extremes> bare_extremes() const {
        if (store_) return store_->terrain_extremes();
        return of_ground_ ? params_.ground->terrain_extremes() : std::nullopt;
    }

    /// From what is known beforehand; with culture height a few blocks are read, the most promising first.
    Extremes known_extremes(Extremes out) {
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
    bool has_detail_ = false, of_ground_ = false;  ///< it is there; of params_.ground
    std::mutex detail_mutex_;
    std::atomic<std::uint64_t> level_posts_{0};  ///< read of levels above 0
    std::unique_ptr<DetailMap> detail_;
    std::unique_ptr<RasterLayer> terrain_;
    std::unique_ptr<TileLedger> ledger_;  ///< of the terrain
    std::unique_ptr<RegisteredLayer> culture_, height_;
    std::vector<ClassId> class_of_;  ///< of codes from table_begin on
    DataBase data_base_;
    std::mutex extremes_mutex_;
    std::optional<Extremes> extremes_;
};

/// The same rasters, none of whose posts is read.
class UnreadSource final : public RasterSource {
public:
    UnreadSource(const DataBaseParams& params, float ground_m, const Extremes& guess)
        : RasterSource(params), ground_m_(ground_m) {
        extremes_ = guess;
    }
    using WedgeSource::load;
    Chunk load(const ChunkRequest& request) override {
        Chunk chunk;
        chunk.window = request.window;
        chunk.lines_are_columns = request.lines_are_columns;
        chunk.surface_m.assign(static_cast<std::size_t>(request.window.posts()), ground_m_);
        return chunk;
    }
    float bare_terrain_m(std::int64_t, std::int64_t) override { return ground_m_; }

private:
    float ground_m_;
};

// ---------------------------------------------------------------- spilled

/// A scene in its place, before any of the terrain but below the sensor is read: where its range is to follow from the terrain,
/// with any range.
ResolvedScene placed(Scene scene, WedgeSource& source) {
    if (!scene.range_m) scene.range_m = scene.range_start_m + 1;
    return resolve(scene, source);
}

/// What a pass is to keep for a scene; `range_given`: else its range is to follow from the terrain, and any is possible.
PartitionScope scope_of_pass(const ResolvedScene& scene, bool range_given, const SpillOptions& options) {
    PartitionScope scope = scope_of(scene);
    if (!range_given) {
        // resolve() refuses a range beyond 0.3 radii.
        constexpr double largest_radius_m = 6.4e6;
        scope.reach_m.reset();
        if (scene.scene.earth_k && !options.all_of_it)
            scope.reach_m = 0.3 * 1.025 * *scene.scene.earth_k * largest_radius_m;
    }
    if (options.only) {
        scope.from_rad = options.only->from_rad;
        scope.width_rad = options.only->width_rad;
    }
    if (options.all_round) scope.width_rad = PartitionScope{}.width_rad;
    if (options.all_round && scene.scene.ground_range_m) {
        const double limit_m = 1.001 * *scene.scene.ground_range_m;
        scope.reach_m = std::min(scope.reach_m.value_or(limit_m), limit_m);
    }
    return scope;
}

class PartitionedSource final : public RasterSource {
public:
    /// `extremes`: take them on the way, over the whole raster.
    /// `keep`: the path of a spill that stays; empty: none does. `about`: lines for the start of its description.
    PartitionedSource(const DataBaseParams& params, const PartitionScope& scope, bool extremes,
                      const SpillOptions& options, const std::string& keep, const std::string& about = "")
        : RasterSource(params) {
        const auto start = std::chrono::steady_clock::now();
        partition(scope, extremes, options, keep, about);
        seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    }
    /// From a spill that was kept.
    PartitionedSource(const DataBaseParams& params, const std::string& path, const IndexPosition& nadir,
                      const SpillOptions& options)
        : RasterSource(params) {
        reopen(path, nadir, options);
        kept_ = path;
    }
    /// A forecast of the first.
    PartitionedSource(const DataBaseParams& params, const PartitionScope& scope, bool extremes,
                      const SpillOptions& options)
        : RasterSource(params) {
        Passes made;
        lay_out(made, scope, extremes, options, "");
        data_base_.block_columns = data_base_.block_rows = made.terrain.edge;
        if (culture_) data_base_.culture_tile_columns = data_base_.culture_tile_rows = made.culture.edge;
        // The ledgers will be of the blocks.
        for (const LayerPass& layer : made.layers) {
            const RasterFacts& f = layer.in.facts();
            forecast_ledgers_ +=
                static_cast<std::size_t>(all_blocks(f.columns, f.rows, layer.blocks.edge).blocks.posts());
        }
    }

    using WedgeSource::load;
    Chunk load(const ChunkRequest& request) override {
        const std::uint64_t before = Spill::bytes_read_here();
        Chunk chunk = RasterSource::load(request);
        chunk.bytes_spilled = Spill::bytes_read_here() - before;
        return chunk;
    }
    CultureCells load_classes(const Window& window) override {
        const std::uint64_t before = Spill::bytes_read_here();
        CultureCells cells = RasterSource::load_classes(window);
        cells.bytes_spilled = Spill::bytes_read_here() - before;
        return cells;
    }

    float bare_terrain_m(std::int64_t column, std::int64_t row) override {
        const std::int64_t at = data_base_.cyclic ? wrapped(column) : column;
        return !terrain_blocks_ || terrain_blocks_->holds(at, row)
                   ? RasterSource::bare_terrain_m(column, row)
                   : ask_direct([&](WedgeSource& rasters) { return rasters.bare_terrain_m(column, row); });
    }

    Extremes extremes() override {
        {
            const std::lock_guard lock(extremes_mutex_);
            if (extremes_) return *extremes_;
        }
        if (!terrain_blocks_) return RasterSource::extremes();
        return ask_direct([](WedgeSource& rasters) { return rasters.extremes(); });
    }

    SourceReport report() const override {
        SourceReport r;
        r.kind = "spilled";
        r.partition_s = seconds_;
        r.partition_bytes = pass_bytes_;
        r.held_bytes = spill_->bytes_held();
        r.spilled_bytes = kept_.empty() ? spill_->bytes_spilled() : 0;
        r.spill_read_bytes = spill_->bytes_read();
        r.planned_partition_bytes = forecast_.read_bytes;
        r.planned_spilled_bytes = forecast_.spilled_bytes;
        r.pass_peak_bytes = pass_peak_bytes_;
        r.planned_pass_peak_bytes = planned_pass_peak_bytes_;
        r.kept = kept_;
        return r;
    }

    /// As forecast before the pass, however narrow the blocks came out: a run is planned as it was foretold.
    std::size_t cache_bytes() const override {
        const std::size_t forecast = forecast_.spilled_bytes > 0 ? share_ : forecast_.held_bytes;
        return std::max(forecast, block_bytes()) + beside_blocks_bytes();
    }
    std::size_t filled_bytes(std::uint64_t) const override { return cache_bytes(); }
    std::size_t held_bytes() const override { return block_bytes() + beside_blocks_bytes(); }
    std::size_t reader_bytes() const override { return 0; }  // the rasters are closed after the pass

private:
    /// Of a spill that has gone to disk its whole share: how much of it the last bucket left is no matter for a budget.
    std::size_t block_bytes() const {
        return kept_.empty() && spill_->bytes_spilled() > 0 ? share_ : spill_->bytes_held();
    }
    std::size_t beside_blocks_bytes() const {
        return spill_->index_bytes() + map_bytes_ +
               (has_detail_ || params_.expects_ground ? DetailMapFile::most_bytes : 0) +
               (terrain_blocks_ ? ledger_bytes() : forecast_ledgers_);
    }

    /// What will be read and where it will go.
    struct Passes {
        PassParams pass;
        BlockSet terrain, height, culture;
        std::vector<LayerPass> layers;
        bool with_map = false;
    };

    void lay_out(Passes& made, const PartitionScope& scope, bool extremes, const SpillOptions& options,
                 const std::string& keep) {
        const std::size_t share = share_ = options.memory_bytes / 4;
        auto& [pass, terrain, height, culture, passes, with_map] = made;
        pass.memory_bytes = share;
        pass.threads = options.threads;
        pass.stop = options.stop;
        pass.timeline = options.timeline;
        // What is needed of each layer.
        terrain = blocks_in_scope(data_base_, scope, block_edge(terrain_->facts(), share));
        if (height_) height = blocks_under(*height_, terrain, extremes, share);
        if (culture_) culture = blocks_under(*culture_, terrain, false, share);

        SpillParams params;
        params.folder = options.temp_folder;
        params.keep = keep;
        params.memory_bytes = share;
        params.buckets = static_cast<int>(std::clamp<std::size_t>(share >> 21, 4, 64));
        params.timeline = options.timeline;
        spill_ = std::make_shared<Spill>(params);
        const WedgeBuckets buckets{scope.nadir, params.buckets};

        const auto add = [&](RasterLayer& in, bool codes, const BlockSet& blocks, const RegisteredLayer* registered) {
            const RasterFacts& f = in.facts();
            LayerPass layer{in, codes, blocks, false, *spill_, 0, {}, nullptr, {}};
            layer.layer = spill_->add_layer({f.role, blocks.edge, f.columns, f.rows, blocks.blocks});
            layer.place = [this, buckets, registered](const Window& posts) {
                return buckets.place(corners(posts, registered));
            };
            passes.push_back(std::move(layer));
        };
        // Culture heights first: the terrain's survey looks them up.
        if (height_) add(height_->raster(), false, height, height_.get());
        add(*terrain_, false, terrain, nullptr);
        if (culture_) add(culture_->raster(), true, culture, culture_.get());
        if (spill_->index_bytes() > options.memory_bytes / 8)
            throw TooLittleMemory(options.memory_bytes, spill_->index_bytes() * 8, "the index of the spilled blocks");
        passes[height_ ? 1 : 0].read_all = extremes;

        map_bytes_ = Survey::map_bytes(terrain);
        with_map = map_bytes_ <= options.memory_bytes / 16;
        if (!with_map) map_bytes_ = 0;
        for (;;) {
            forecast_ = forecast_passes(passes, pass, share, params.buckets);
            const std::size_t blocks = forecast_.spilled_bytes > 0 ? share : forecast_.held_bytes;
            pass.fixed_bytes = spill_->index_bytes() + map_bytes_ +
                               std::min<std::size_t>(params_.cache_bytes, forecast_.read_bytes) +
                               forecast_.readers * RasterSource::reader_bytes();
            planned_pass_peak_bytes_ = blocks + forecast_.window_bytes + pass.fixed_bytes;
            constexpr std::size_t smallest = std::size_t{1} << 20;
            if (planned_pass_peak_bytes_ <= options.memory_bytes) break;
            if (pass.threads > 1)
                --pass.threads;
            else if (pass.memory_bytes > smallest)
                pass.memory_bytes /= 2;
            else
                break;
        }
        // Budgets are whole MiB; what is less is no promise.
        if (planned_pass_peak_bytes_ > std::max(options.memory_bytes, std::size_t{1} << 20)) {
            const RasterFacts& f = terrain_->facts();
            throw TooLittleMemory(
                options.memory_bytes, planned_pass_peak_bytes_, "sorting the terrain into wedges",
                text(" (", f.named(), " is stored in blocks of ", f.block_columns, " x ", f.block_rows, " posts)"));
        }
    }

    void partition(const PartitionScope& scope, bool extremes, const SpillOptions& options, const std::string& keep,
                   const std::string& about) {
        std::vector<std::string> paths{params_.dem};
        for (const std::string& path : {params_.culture, params_.culture_height})
            if (!path.empty()) paths.push_back(path);
        std::vector<std::vector<FileStamp>> before;
        for (const std::string& path : paths) before.push_back(file_stamps(path));

        Passes made;
        lay_out(made, scope, extremes, options, keep);
        auto& [pass, terrain, height, culture, passes, with_map] = made;
        std::uint64_t expected = 0;
        for (const LayerPass& layer : passes) {
            const BlockSet& blocks = layer.blocks;
            expected +=
                static_cast<std::uint64_t>(std::count(blocks.needed.begin(), blocks.needed.end(), true) * blocks.edge *
                                           blocks.edge * std::min(layer.in.facts().type_bytes, 4));
        }
        spill_->expect(expected);

        Survey survey(data_base_, terrain, with_map);
        LayerPass& terrain_pass = passes[height_ ? 1 : 0];
        terrain_pass.survey = &survey;
        if (height_)
            terrain_pass.culture = [this](const Window& window, std::vector<float>& out) {
                std::vector<float> scratch;
                const ChunkRequest everything;
                out.resize(static_cast<std::size_t>(window.posts()));
                height_->read_heights(height_->plan(window.columns), window.rows, params_.culture_height_scale,
                                      NeededPosts(everything), out.data(), scratch);
            };

        std::uint64_t total = 0, done = 0;
        for (const LayerPass& layer : passes) total += posts_of_pass(layer, pass);
        pass.progress = [&](std::uint64_t posts) {
            done += posts;
            if (options.progress) options.progress(static_cast<double>(done) / static_cast<double>(total));
        };
        std::vector<std::unique_ptr<RasterLayer>> rasters;  // until the end: a pass may still read from one
        std::vector<std::uint64_t> fingerprints;            // before anything is read
        for (const LayerPass& layer : passes) fingerprints.push_back(layer.in.fingerprint({}));
        for (const LayerPass& layer : passes) {
            const PassDone done_here = run_pass(layer, pass);
            pass_bytes_ += done_here.read_bytes;
            const std::size_t cached =
                static_cast<std::size_t>(GDALGetCacheUsed64()) + (store_ ? store_->cached_bytes() : 0);
            pass_peak_bytes_ =
                std::max(pass_peak_bytes_, done_here.held_bytes + spill_->index_bytes() + map_bytes_ + cached +
                                               forecast_.readers * RasterSource::reader_bytes());
            auto blocks = std::make_unique<SpilledLayer>(
                layer.in.facts(), fingerprints[static_cast<std::size_t>(&layer - passes.data())], spill_, layer.layer);
            if (height_ && &layer.in == &height_->raster())
                rasters.push_back(height_->replace(std::move(blocks)));
            else if (culture_ && &layer.in == &culture_->raster())
                rasters.push_back(culture_->replace(std::move(blocks)));
            else
                rasters.push_back(replace_terrain(std::move(blocks)));
        }
        for (std::size_t i = 0; i < paths.size(); ++i)
            if (file_stamps(paths[i]) != before[i])
                throw DataError(text("'", paths[i], "' changed while it was read; run again when it is at rest"));
        rasters.clear();
        if (extremes) extremes_ = survey.extremes();
        map_ = survey.take_map();
        if (keep.empty()) {
            spill_->seal();
        } else {
            if (map_) put_map();
            spill_->keep(about + description(scope.nadir));
        }
        if (height_) height_->forget();
        store_.reset();
        data_base_.block_columns = data_base_.block_rows = terrain.edge;
        if (culture_) data_base_.culture_tile_columns = data_base_.culture_tile_rows = culture.edge;
        if (options.timeline) options.timeline->memory(cache_bytes());
        ::malloc_trim(0);  // what the pass held is the engine's now
    }

    // A kept spill: the layers' blocks, the finest level of the block map as one more layer, and a description, line
    // by line: what it was made for and of.

    static constexpr const char* map_layer = "block map";
    static constexpr std::int64_t map_edge = 64;
    struct StoredBounds {
        float lowest_m, highest_m, culture_m;
        std::uint32_t voids;
    };

    void put_map() {
        const BlockWindow finest = map_->read(0, blocks_of({{0, data_base_.columns}, {0, data_base_.rows}}));
        const std::int64_t columns = finest.blocks.columns.size(), rows = finest.blocks.rows.size();
        const BlockSet all = all_blocks(columns, rows, map_edge);
        const std::size_t layer = spill_->add_layer({map_layer, map_edge, columns, rows, all.blocks});
        for (std::int64_t r = 0; r < all.blocks.rows.end; ++r)
            for (std::int64_t c = 0; c < all.blocks.columns.end; ++c) {
                const Window part = spill_->layer(layer).posts(c, r);
                std::vector<StoredBounds> stored;
                for (std::int64_t y = part.rows.begin; y < part.rows.end; ++y)
                    for (std::int64_t x = part.columns.begin; x < part.columns.end; ++x) {
                        const BlockBounds& b = finest.at(x, y);
                        stored.push_back({b.lowest_m, b.highest_m, b.culture_m, static_cast<std::uint32_t>(b.voids)});
                    }
                spill_->put(layer, c, r, 0, 0, std::as_bytes(std::span(stored)));
            }
    }

    void take_map(std::size_t layer) {
        const SpillLayer& f = spill_->layer(layer);
        std::vector<BlockBounds> finest(static_cast<std::size_t>(f.posts_columns * f.posts_rows));
        std::vector<std::byte> buffer;
        for (std::int64_t r = 0; r < f.blocks.rows.end; ++r)
            for (std::int64_t c = 0; c < f.blocks.columns.end; ++c) {
                const Window part = f.posts(c, r);
                const std::span<const std::byte> bytes = spill_->get(layer, c, r, buffer);
                if (bytes.size() != static_cast<std::size_t>(part.posts()) * sizeof(StoredBounds))
                    throw DataError("the kept spill's block map is no map of its raster");
                std::size_t at = 0;
                for (std::int64_t y = part.rows.begin; y < part.rows.end; ++y)
                    for (std::int64_t x = part.columns.begin; x < part.columns.end; ++x, at += sizeof(StoredBounds)) {
                        StoredBounds b;
                        std::memcpy(&b, bytes.data() + at, sizeof b);
                        finest[static_cast<std::size_t>(y * f.posts_columns + x)] = {
                            b.lowest_m, b.highest_m, b.culture_m, static_cast<Voids>(b.voids)};
                    }
            }
        map_ = map_from_finest(data_base_, std::move(finest));
    }

    /// What a layer is made of: of a store's the fingerprint of its checksums, so that the store may be moved; else its
    /// files as lines: role, size, time of change, path.
    std::string files(RasterLayer& layer) const {
        const RasterFacts& f = layer.facts();
        const bool given = f.role == "culture" ? !params_.culture.empty()
                                               : f.role == "culture-height" && !params_.culture_height.empty();
        if (!given && is_tile_store(params_.dem))
            return text("file ", f.role, " in store ", layer.fingerprint({}), '\n');
        std::string lines;
        for (const FileStamp& s : file_stamps(f.path)) {
            std::error_code none;
            const std::filesystem::path whole = std::filesystem::weakly_canonical(s.file, none);
            lines += text("file ", f.role, ' ', s.bytes, ' ', s.changed_s, ' ', s.changed_ns, ' ',
                          none ? s.file : whole.string(), '\n');
        }
        return lines;
    }

    std::string description(const IndexPosition& nadir) const {
        const Extremes& e = *extremes_;
        std::string lines =
            text("nadir ", nadir.column, ' ', nadir.row, '\n', "culture-height-scale ", params_.culture_height_scale,
                 '\n', "extremes ", e.lowest_m, ' ', e.highest_m, ' ', e.void_posts, ' ', e.any_valid ? 1 : 0, '\n');
        for (RasterLayer* layer : readers()) lines += files(*layer);
        return lines;
    }

    void reopen(const std::string& path, const IndexPosition& nadir, const SpillOptions& options) {
        const std::size_t memory_bytes = options.memory_bytes;
        spill_ = Spill::open_kept(path, options.timeline);
        const auto refuse = [&](const std::string& why, const char* way_out = "tile --around makes it anew") {
            throw UnfitSpill(text("the kept spill '", path, "' ", why, "; ", way_out));
        };
        if (spill_->index_bytes() > memory_bytes / 8)
            throw TooLittleMemory(memory_bytes, spill_->index_bytes() * 8,
                                  text("the index of the kept spill '", path, "'"));
        IndexPosition made_for;
        double scale = 1;
        Extremes e;
        std::string made_of;
        std::istringstream lines(spill_->description());
        lines.imbue(std::locale::classic());
        for (std::string line; std::getline(lines, line);) {
            std::istringstream words(line);
            words.imbue(std::locale::classic());
            std::string word;
            int valid = 0;
            words >> word;
            if (word == "nadir") words >> made_for.column >> made_for.row;
            if (word == "culture-height-scale") words >> scale;
            if (word == "extremes") {
                words >> e.lowest_m >> e.highest_m >> e.void_posts >> valid;
                e.any_valid = valid != 0;
            }
            if (word == "file") made_of += line + '\n';
        }
        if (std::fabs(made_for.column - nadir.column) > 1 || std::fabs(made_for.row - nadir.row) > 1)
            refuse(
                fmt::format("was made for column {:.2f}, row {:.2f}; the sensor stands over column {:.2f}, row {:.2f}",
                            made_for.column, made_for.row, nadir.column, nadir.row),
                "tile --overwrite --around replaces it");
        const auto take = [&](RasterLayer& raster) {
            const RasterFacts& f = raster.facts();
            std::size_t number = 0;
            while (number < spill_->layer_count() && spill_->layer(number).name != f.role) ++number;
            if (number == spill_->layer_count()) refuse(text("holds no ", f.role));
            const SpillLayer& layer = spill_->layer(number);
            std::string then;
            std::istringstream all(made_of);
            for (std::string line; std::getline(all, line);)
                if (line.starts_with(text("file ", f.role, ' '))) then += line + '\n';
            if (then != files(raster) || layer.posts_columns != f.columns || layer.posts_rows != f.rows)
                refuse(text("was made of another raster than ", f.named(), ", or before that was changed"));
            return std::make_unique<SpilledLayer>(f, raster.fingerprint({}), spill_, number);
        };
        if (height_ && scale != params_.culture_height_scale)
            refuse(text("was made with culture-height-scale ", scale, ", not ", params_.culture_height_scale));
        const bool culture_then = made_of.find("file culture-height ") != std::string::npos;
        if (culture_then != static_cast<bool>(height_))
            refuse(culture_then ? "was made with a culture-height" : "holds no culture-height");
        replace_terrain(take(*terrain_));
        if (height_) height_->replace(take(height_->raster()));
        if (culture_) culture_->replace(take(culture_->raster()));
        std::unique_ptr<BlockMap> of_store = std::move(map_);
        extremes_ = e;
        map_bytes_ = Survey::map_bytes(all_blocks(data_base_.columns, data_base_.rows, block_posts));
        for (std::size_t i = 0; i < spill_->layer_count(); ++i)
            if (spill_->layer(i).name == map_layer && map_bytes_ <= memory_bytes / 16) take_map(i);
        if (!map_) {
            constexpr std::size_t pages = std::size_t{4} << 20;  // a store's map is read page by page
            map_bytes_ = of_store ? pages : 0;
            map_ = std::move(of_store);
        }
        store_.reset();
        data_base_.block_columns = data_base_.block_rows = terrain_->facts().block_rows;
        if (culture_) data_base_.culture_tile_columns = data_base_.culture_tile_rows = culture_->facts().block_rows;
    }

    std::unique_ptr<RasterLayer> replace_terrain(std::unique_ptr<SpilledLayer> blocks) {
        terrain_blocks_ = blocks.get();
        ledger_ = std::make_unique<TileLedger>(blocks->facts());
        return std::exchange(terrain_, std::move(blocks));
    }

    /// Places on the terrain's grid of the corners of a block of the terrain's or of a layer's own posts.
    static std::array<IndexPosition, 4> corners(const Window& posts, const RegisteredLayer* layer) {
        std::array<IndexPosition, 4> found;
        std::size_t i = 0;
        for (const std::int64_t r : {posts.rows.begin, posts.rows.end - 1})
            for (const std::int64_t c : {posts.columns.begin, posts.columns.end - 1}) {
                IndexPosition p{static_cast<double>(c), static_cast<double>(r)};
                if (layer)
                    p = {(p.column + 0.5 - layer->columns().offset) / layer->columns().scale,
                         (p.row + 0.5 - layer->rows().offset) / layer->rows().scale};
                found[i++] = p;
            }
        return found;
    }

    /// Blocks of a layer that lie under needed blocks of the terrain.
    static BlockSet blocks_under(const RegisteredLayer& layer, const BlockSet& terrain, bool all,
                                 std::size_t memory_bytes) {
        const RasterFacts& f = layer.facts();
        BlockSet set = all_blocks(f.columns, f.rows, block_edge(f, memory_bytes));
        if (all) return set;
        const auto under = [&](const Axis& axis, Interval blocks) {
            std::vector<std::vector<std::int64_t>> found;
            for (std::int64_t b = blocks.begin; b < blocks.end; ++b) {
                // A post more on either side, as the engine's classes are asked for places between posts.
                const Interval cells = axis.under({b * terrain.edge - 2, (b + 1) * terrain.edge + 3});
                std::vector<std::int64_t>& list = found.emplace_back();
                for (std::int64_t i = cells.begin - 1; i <= cells.end; ++i)
                    if (const std::int64_t cell = axis.inside(i); cell >= 0) {
                        const std::int64_t block = cell / set.edge;
                        if (list.empty() || list.back() != block) list.push_back(block);
                    }
            }
            return found;
        };
        const auto columns = under(layer.columns(), terrain.blocks.columns),
                   rows = under(layer.rows(), terrain.blocks.rows);
        set.needed.assign(set.needed.size(), false);
        for (std::size_t r = 0; r < rows.size(); ++r)
            for (std::size_t c = 0; c < columns.size(); ++c)
                if (terrain.needed[r * columns.size() + c])
                    for (const std::int64_t y : rows[r])
                        for (const std::int64_t x : columns[c]) set.needed[set.at(x, y)] = true;
        return set;
    }

    /// For what the blocks do not hold; DataError if the rasters are no longer those that the blocks are of.
    template <class Ask>
    std::invoke_result_t<Ask, WedgeSource&> ask_direct(Ask&& ask) {
        const std::lock_guard lock(direct_mutex_);
        if (!direct_) direct_ = open_direct_source(params_);
        const auto found = ask(*direct_);
        check_unchanged(*direct_, fingerprint({}));
        return found;
    }

    std::shared_ptr<Spill> spill_;
    SpilledLayer* terrain_blocks_ = nullptr;  ///< terrain_
    std::size_t map_bytes_ = 0;
    PassForecast forecast_;
    std::size_t pass_peak_bytes_ = 0, planned_pass_peak_bytes_ = 0, share_ = 0, forecast_ledgers_ = 0;
    std::string kept_;  ///< path of the kept spill that is read; empty: none
    double seconds_ = 0;
    std::uint64_t pass_bytes_ = 0;
    std::mutex direct_mutex_;
    std::unique_ptr<WedgeSource> direct_;
};

}  // namespace

std::unique_ptr<WedgeSource> open_direct_source(const DataBaseParams& params) {
    if (params.dem.empty()) throw InputError("dem is missing; accepted: the path of a raster of heights");
    return std::make_unique<RasterSource>(params);
}

std::unique_ptr<WedgeSource> open_spilled_source(const DataBaseParams& params, const Scene& scene,
                                                 const SpillOptions& options) {
    const bool range_given = scene.range_m.has_value();
    const PartitionScope scope = scope_of_pass(placed(scene, *open_direct_source(params)), range_given, options);
    return std::make_unique<PartitionedSource>(params, scope, !range_given && !options.all_of_it, options, "");
}

std::unique_ptr<WedgeSource> forecast_spilled_source(const DataBaseParams& params, const ResolvedScene& scene,
                                                     bool range_given, const SpillOptions& options) {
    const PartitionScope scope = scope_of_pass(scene, range_given, options);
    return std::make_unique<PartitionedSource>(params, scope, !range_given && !options.all_of_it, options);
}

std::unique_ptr<WedgeSource> open_unread_source(const DataBaseParams& params, float ground_m, const Extremes& guess) {
    return std::make_unique<UnreadSource>(params, ground_m, guess);
}

std::string kept_path(const std::string& folder) { return (std::filesystem::path(folder) / kept_spill_name).string(); }

namespace {

/// A scene that has nothing but its place.
ResolvedScene place_of(const DataBaseParams& params, const PlatformParams& point) {
    Scene scene;
    scene.platform.latlon = point.latlon;
    scene.platform.xy = point.xy;
    scene.platform.altitude_m = 9e5;
    scene.range_m = 1;
    return resolve(scene, *open_direct_source(params));
}

bool same_point(const IndexPosition& a, const IndexPosition& b) {
    return std::fabs(a.column - b.column) <= 1 && std::fabs(a.row - b.row) <= 1;
}

}  // namespace

void keep_spill(const DataBaseParams& params, const PlatformParams& point, const std::string& folder,
                const SpillOptions& options) {
    const ResolvedScene place = place_of(params, point);
    PartitionScope scope = scope_of(place);
    scope.reach_m.reset();
    scope.width_rad = 7;
    const std::string about =
        place.has_lat_lon ? text("latlon ", place.lat_deg, ' ', place.lon_deg, '\n') : std::string();
    const PartitionedSource made(params, scope, true, options, kept_path(folder), about);
}

void refuse_other_kept_spill(const DataBaseParams& params, const PlatformParams& point, const std::string& folder) {
    const std::string path = kept_path(folder);
    std::error_code ignored;
    if (!std::filesystem::exists(path, ignored)) return;
    IndexPosition made_for;
    std::string where;
    try {
        std::istringstream lines(Spill::open_kept(path)->description());
        lines.imbue(std::locale::classic());
        double lat_deg = 0, lon_deg = 0;
        for (std::string word; lines >> word; lines.ignore(std::numeric_limits<std::streamsize>::max(), '\n')) {
            if (word == "nadir") lines >> made_for.column >> made_for.row;
            if (word == "latlon" && lines >> lat_deg >> lon_deg)
                where = fmt::format("latitude {:.6f}, longitude {:.6f}: ", lat_deg, lon_deg);
        }
    } catch (const Error&) {
        return;
    }
    if (same_point(made_for, scope_of(place_of(params, point)).nadir)) return;
    throw InputError(
        fmt::format("the kept spill '{}' stands, made for another point ({}column {:.2f}, row {:.2f}); "
                    "--overwrite replaces it",
                    path, where, made_for.column, made_for.row));
}

std::unique_ptr<WedgeSource> open_kept_spill(const DataBaseParams& params, const Scene& scene,
                                             const std::string& folder, const SpillOptions& options) {
    const IndexPosition nadir = placed(scene, *open_direct_source(params)).nadir;
    return std::make_unique<PartitionedSource>(params, kept_path(folder), nadir, options);
}

}  // namespace wedgescope
