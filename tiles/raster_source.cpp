#include "tiles/raster_source.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <array>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <queue>
#include <stdexcept>
#include <utility>

#include "lib/culture.hpp"
#include "lib/error.hpp"
#include "lib/threads.hpp"
#include "lib/transpose.hpp"
#include "tiles/cache_need.hpp"
#include "tiles/checksum.hpp"
#include "tiles/detail_map_file.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/georeference.hpp"
#include "tiles/tiff_layer.hpp"

namespace wedgescope {
namespace {

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

}  // namespace

RasterSource::RasterSource(const DataBaseParams& params) : params_(params) {
    std::unique_ptr<RasterLayer> culture, height;
    tiles_ = std::make_shared<TileCache>(tile_cache_share(params_.cache_bytes));
    class_layer_ = tiles_->new_layer();
    if (is_tile_store(params_.dem)) {
        store_ = std::make_unique<TileStore>(params_.dem, tiles_);
        terrain_ = store_->layer(StoreLayerKind::dem);
        if (params_.culture.empty()) {
            culture = store_->layer(StoreLayerKind::culture);
            try {
                if (!params_.legend) params_.legend = store_->legend(params_.materials);
            } catch (const Error&) {
                if (params_.classes) throw;
            }
            if (!params_.legend && !params_.classes) culture.reset();
        }
        if (params_.culture_height.empty()) {
            has_detail_ = store_->has_detail_map();
            height = store_->layer(StoreLayerKind::culture_height);
            map_ = store_->block_map(params_.culture_height_scale);
        }
    } else {
        terrain_ = open_raster("dem", params_.dem, tiles_);
    }
    if (!params_.culture.empty()) culture = open_raster("culture", params_.culture, tiles_);
    if (!params_.culture_height.empty()) height = open_raster("culture-height", params_.culture_height, tiles_);

    if (!map_ && params_.ground) {
        map_ = params_.ground->block_map(params_.culture_height_scale);
        has_detail_ = of_ground_ = true;
    }

    const RasterFacts& facts = terrain_->facts();
    check_terrain_size(facts);
    data_base_ = describe(facts);
    data_base_.default_class = params_.default_class;
    ledger_ = std::make_unique<TileLedger>(facts);
    if (culture) open_culture(std::move(culture));
    if (height) open_height(std::move(height));
    bool any_tiles = false;
    for (const RasterLayer* layer : readers()) any_tiles |= layer->fills_tile_cache();
    if (any_tiles) {
        const auto all = readers();
        const std::size_t share = tiles_->most_bytes(),
                          needed = cache_need({all.begin(), all.end()}, params_, class_bytes_of_strips()).tile_bytes;
        GdalSession::set_cache_bytes(params_.cache_bytes - share);
        tiles_->limit(needed);
        if (params_.by_strips) limit_tiles(share + params_.more_cache_bytes);
        params_.cache_bytes += tiles_->most_bytes();
        params_.cache_bytes -= share;
    } else if (culture_) {                     // classes alone, in what GDAL leaves with all of its layers decoded
        constexpr double beside_blocks = 1.1;  // what GDAL notes of each; strips may be short
        double left = static_cast<double>(params_.cache_bytes);
        for (const RasterLayer* layer : readers()) {
            const RasterFacts& f = layer->facts();
            left -= beside_blocks * static_cast<double>(f.columns) * static_cast<double>(f.rows) * f.type_bytes *
                    params_.threads;
        }
        tiles_->limit(static_cast<std::size_t>(std::clamp(left, 0.0, class_bytes_of_strips())));
        GdalSession::set_cache_bytes(params_.cache_bytes - tiles_->most_bytes());
    }
}

void RasterSource::open_height(std::unique_ptr<RasterLayer> raster) {
    if (!(params_.culture_height_scale >= 0) || !std::isfinite(params_.culture_height_scale))
        throw InputError(
            text("culture-height-scale is ", params_.culture_height_scale, "; accepted: a number from 0 up"));
    height_ = std::make_unique<RegisteredLayer>(std::move(raster), terrain_->facts());
    data_base_.has_culture_height = true;
    data_base_.post_bytes += height_->facts().type_bytes;
}

Chunk RasterSource::load(const ChunkRequest& request) {
    Chunk chunk = begun_chunk(data_base_, request);
    const Window& all = request.window;
    if (request.looked_at) chunk.window = intersection(all, *request.looked_at);
    const Window& window = chunk.window;
    if (const auto height = request.flat_m(); height || window.empty()) {
        pass_surface(request, all);
        chunk.flat = true;
        if (!window.empty()) chunk.surface_m.assign(static_cast<std::size_t>(chunk.minor_count()), *height);
        return chunk;
    }
    for (const Window& rest : {Window{all.columns, {all.rows.begin, window.rows.begin}},
                               Window{all.columns, {window.rows.end, all.rows.end}},
                               Window{{all.columns.begin, window.columns.begin}, window.rows},
                               Window{{window.columns.end, all.columns.end}, window.rows}})
        if (!rest.empty()) pass_surface(request, rest);
    if (request.level > 0) {
        load_level(chunk, request);
    } else {
        load_surface(chunk, NeededPosts(request));
    }
    note_surface(chunk.surface_m);
    return chunk;
}

LoadCost RasterSource::cost(const ChunkRequest& request) const {
    const auto posts = static_cast<std::uint64_t>(request.window.posts());
    LoadCost cost{posts, posts * static_cast<std::uint64_t>(terrain_->facts().type_bytes), posts * sizeof(float), 0};
    const std::int64_t width = request.window.columns.size(), rows = request.window.rows.size();
    // The window may be cut to a narrower one, which has more rows in a slab.
    const auto slab = static_cast<std::size_t>(
        std::min(width * rows, std::max(near_posts, width * slab_rows(width, request.lines_are_columns))));
    cost.beside_bytes = request.lines_are_columns ? slab * sizeof(float) : 0;
    if (request.level > 0) {
        cost.beside_bytes += terrain_->level_bytes();
    } else if (height_) {
        const double cells = std::fabs(height_->columns().scale * height_->rows().scale);
        cost.bytes += static_cast<std::uint64_t>(static_cast<double>(posts) * cells) *
                      static_cast<std::uint64_t>(height_->facts().type_bytes);
        cost.chunk_bytes *= 2;
        cost.beside_bytes += (slab + std::max(slab, static_cast<std::size_t>(near_posts))) * sizeof(float);
    }
    cost.beside_bytes += reader_bytes();
    return cost;
}

CultureCells RasterSource::load_classes(const Window& window) {
    if (!culture_) throw std::out_of_range("load_classes: there is no culture");
    CultureCells cells;
    cells.window = window;
    const auto type_bytes = static_cast<std::uint64_t>(culture_->facts().type_bytes);
    const std::optional<TileCache::Key> key = class_tile(window);
    if (const TileCache::Tile kept = key ? tiles_->find(*key) : nullptr) {
        static_assert(sizeof(ClassId) == 1);
        const auto* const classes = reinterpret_cast<const ClassId*>(kept->data());
        cells.classes.assign(classes, classes + kept->size());
        cells.bytes_read = static_cast<std::uint64_t>(culture_->touch_codes(window)) * type_bytes;
        return cells;
    }
    cells.classes.assign(static_cast<std::size_t>(window.posts()), params_.default_class);
    bool any_unknown = false;
    const std::int64_t read =
        culture_->read_codes(window, [&](std::int64_t row, std::int64_t at, const std::int32_t* codes, std::int64_t n) {
            any_unknown |= find_classes(codes, n, cells.classes.data() + row * window.columns.size() + at);
        });
    cells.bytes_read = static_cast<std::uint64_t>(read) * type_bytes;
    if (any_unknown) {
        cells.codes.assign(cells.classes.size(), void_code);
        culture_->read_codes(window, [&](std::int64_t row, std::int64_t at, const std::int32_t* codes, std::int64_t n) {
            std::copy_n(codes, n, cells.codes.data() + row * window.columns.size() + at);
        });
    } else if (key && cells.classes.size() <= tiles_->most_bytes()) {
        auto kept = std::make_shared<RawVector<std::byte>>(cells.classes.size());
        std::memcpy(kept->data(), cells.classes.data(), cells.classes.size());
        tiles_->add(*key, std::move(kept));
    }
    return cells;
}

std::optional<TileCache::Key> RasterSource::class_tile(const Window& window) const {
    const std::int64_t wide = data_base_.culture_tile_columns, high = data_base_.culture_tile_rows,
                       column = window.columns.begin / wide, row = window.rows.begin / high;
    if (column < 0 || row < 0 || window != Culture::cells_of_tile(data_base_, column, row)) return std::nullopt;
    const std::int64_t across = (data_base_.culture_columns + wide - 1) / wide,
                       down = (data_base_.culture_rows + high - 1) / high;
    if (column >= across || row >= down) return std::nullopt;
    return TileCache::Key{class_layer_, static_cast<std::uint64_t>(row * across + column)};
}

void RasterSource::read_bare_terrain(const Window& posts, float* heights_m) {
    const auto beyond = [](Interval of, std::int64_t size) { return of.begin < 0 || of.end > size; };
    if (beyond(posts.rows, data_base_.rows) || (!data_base_.cyclic && beyond(posts.columns, data_base_.columns)))
        throw std::out_of_range("read_bare_terrain: post outside the raster");
    if (params_.stop) params_.stop->check();  // a block may take long
    for (const Run& run : terrain_runs(posts.columns))
        terrain_->read_heights({run.source, posts.rows}, heights_m + run.at, posts.columns.size());
}

Extremes RasterSource::extremes() {
    const std::lock_guard lock(extremes_mutex_);
    if (!extremes_) extremes_ = find_extremes();
    return *extremes_;
}

std::uint64_t RasterSource::fingerprint(const std::vector<Window>& posts) {
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

DetailMap* RasterSource::detail_map() {
    if (!has_detail_) return nullptr;
    const std::lock_guard lock(detail_mutex_);
    if (!detail_) {
        const double scale = params_.culture_height_scale;
        detail_ = of_ground_ ? params_.ground->detail_map(scale) : TileStore(params_.dem).detail_map(scale);
    }
    return detail_.get();
}

SourceReport RasterSource::report() const {
    SourceReport r;
    r.lowest_m = lowest_m_;
    r.raised_posts = raised_posts_;
    if (r.raised_posts > 0)
        r.mean_culture_m = static_cast<double>(raised_cm_) / 100 / static_cast<double>(r.raised_posts);
    return r;
}

void RasterSource::note_surface(const RawVector<float>& heights_m) {
    constexpr std::size_t enough = 1024;
    const std::size_t step = std::max(noted_step, heights_m.size() / enough | 1);
    float lowest = std::numeric_limits<float>::infinity();
    for (std::size_t i = 0; i < heights_m.size(); i += step) lowest = std::min(lowest, heights_m[i]);
    for (float before = lowest_m_; lowest < before && !lowest_m_.compare_exchange_weak(before, lowest);) {
    }
}

void RasterSource::note_culture(const std::vector<float>& heights_m) {
    std::uint64_t posts = 0, sum_cm = 0;
    for (std::size_t i = 0; i < heights_m.size(); i += noted_step) {
        if (!(heights_m[i] > 0 && heights_m[i] < 1e6F)) continue;  // what does not count, and what is no height
        ++posts;
        sum_cm += static_cast<std::uint64_t>(100 * static_cast<double>(heights_m[i]));
    }
    raised_posts_ += posts;
    raised_cm_ += sum_cm;
}

Skipped RasterSource::skipped() const {
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

std::size_t RasterSource::cache_bytes() const {
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

std::size_t RasterSource::reader_bytes() const {
    ReaderBytes all;
    for (const RasterLayer* layer : readers()) {
        const ReaderBytes own = layer->reader_bytes();
        all = {std::max(all.decoded, own.decoded), all.packed + own.packed};
    }
    return all.decoded + all.packed;
}

double RasterSource::class_bytes_of_strips() const {
    if (!culture_) return 0;
    const DataBase& d = data_base_;
    const Tiling tiling{static_cast<double>(d.culture_columns), static_cast<double>(d.culture_rows),
                        static_cast<double>(d.culture_tile_columns), static_cast<double>(d.culture_tile_rows),
                        sizeof(ClassId)};
    const double tile = tiling.wide * tiling.high * tiling.value_bytes + TileCache::entry_bytes,
                 all = tile * std::ceil(tiling.columns / tiling.wide) * std::ceil(tiling.rows / tiling.high);
    return std::min(all, strip_bytes(tiling, culture_->columns().scale, culture_->rows().scale));
}

void RasterSource::limit_tiles(std::size_t most_bytes) {
    double bytes = class_bytes_of_strips();
    bool any_packed = false;
    const auto add = [&](const RasterLayer& layer, double columns_a_post, double rows_a_post) {
        if (!layer.fills_tile_cache()) return;
        const RasterFacts& f = layer.facts();
        const Tiling tiling = tiling_of(f);
        const double strips = strip_bytes(tiling, columns_a_post, rows_a_post);
        any_packed |= f.packed();
        // The system has tiles that are not packed at hand; a copy's fresh pages cost more than a tile that is read again.
        constexpr double few = 16, least = 4 << 20;
        const double some = few * (tiling.wide * tiling.high * tiling.value_bytes + TileCache::entry_bytes);
        // What spans the raster is asked for again along each column.
        const bool kept = f.packed() || f.block_columns >= f.columns;
        bytes += kept ? strips : std::min(strips, std::max(least, some));
    };
    add(*terrain_, 1, 1);
    for (auto* layer : {culture_.get(), height_.get()})
        if (layer) add(layer->raster(), layer->columns().scale, layer->rows().scale);
    // Tiles that are unpacked for every strip anew cost more than the memory that holds them.
    const auto most = static_cast<double>(any_packed ? most_bytes : tiles_->most_bytes());
    tiles_->limit(static_cast<std::size_t>(std::min(bytes, most)));
}

std::vector<RasterLayer*> RasterSource::readers() const {
    std::vector<RasterLayer*> all{terrain_.get()};
    if (height_) all.push_back(&height_->raster());
    if (culture_) all.push_back(&culture_->raster());
    return all;
}

std::size_t RasterSource::ledger_bytes() const {
    std::size_t bytes = ledger_->bytes();
    for (const auto* layer : {culture_.get(), height_.get()})
        if (layer) bytes += layer->ledger().bytes();
    return bytes;
}

void RasterSource::open_culture(std::unique_ptr<RasterLayer> raster) {
    if (!params_.legend)
        throw InputError(
            "culture needs culture-legend; accepted: fbfm40, nlcd, worldcover, smc, rat (its own attribute table) or a "
            "CSV file of code,material");
    culture_ = std::make_unique<RegisteredLayer>(std::move(raster), terrain_->facts());
    const RasterFacts& facts = culture_->facts();
    refuse_scaled_codes(facts);
    data_base_.has_culture = true;
    data_base_.culture_name = facts.path;
    data_base_.legend_name = params_.legend->name();
    std::string words;
    for (const auto& [code, id] : params_.legend->classes()) words += text(code, ",", static_cast<int>(id), "\n");
    data_base_.legend_sum = checksum(words);
    data_base_.culture_column_offset = culture_->columns().offset;
    data_base_.culture_column_scale = culture_->columns().scale;
    data_base_.culture_row_offset = culture_->rows().offset;
    data_base_.culture_row_scale = culture_->rows().scale;
    data_base_.culture_columns = facts.columns;
    data_base_.culture_rows = facts.rows;
    data_base_.culture_tile_columns = std::clamp<std::int64_t>(facts.unit_columns(), 64, 512);
    data_base_.culture_tile_rows = std::clamp<std::int64_t>(facts.unit_rows(), 64, 512);
    class_of_.resize(table_size, unknown_class);
    for (const auto& [code, id] : params_.legend->classes())
        if (place_in_table(code) < table_size) class_of_[place_in_table(code)] = id;
}

std::vector<Run> RasterSource::terrain_runs(Interval columns) const {
    if (!data_base_.cyclic || (columns.begin >= 0 && columns.end <= data_base_.columns))
        return {{0, columns.size(), columns}};
    std::vector<std::int64_t> source(static_cast<std::size_t>(columns.size()));
    for (std::size_t i = 0; i < source.size(); ++i)
        source[i] = data_base_.real_column(columns.begin + static_cast<std::int64_t>(i));
    return runs(source, 1);
}

std::int64_t RasterSource::slab_rows(std::int64_t width, bool turned) const {
    const std::int64_t block = data_base_.block_rows, high = (turned ? near_posts : slab_posts) / width;
    return high >= block ? high / block * block : std::max<std::int64_t>(1, std::min(block, slab_posts / width));
}

std::vector<Interval> RasterSource::slabs(Interval rows, std::int64_t width, bool turned) const {
    const std::int64_t block = data_base_.block_rows, high = slab_rows(width, turned);
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

void RasterSource::turn(const Window& all, const Window& some, const float* from, float* to, std::int64_t minor) {
    const std::int64_t width = all.columns.size(), c = some.columns.begin - all.columns.begin,
                       r = some.rows.begin - all.rows.begin;
    transpose_floats(from + r * width + c, static_cast<std::size_t>(width), static_cast<std::size_t>(some.rows.size()),
                     static_cast<std::size_t>(some.columns.size()), to + c * minor + r,
                     static_cast<std::size_t>(minor));
}

void RasterSource::load_level(Chunk& chunk, const ChunkRequest& request) {
    const NeededPosts needed(request);
    const Interval columns = chunk.window.columns, rows = chunk.window.rows;
    const std::int64_t width = columns.size(), minor = chunk.minor_count();
    chunk.surface_m.resize(static_cast<std::size_t>(chunk.window.posts()));
    RawVector<float> slab;
    for (const Interval part : slabs(rows, width, chunk.lines_are_columns)) {
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
        const Window whole{columns, part};
        needed.fill(whole, {surface, width, false});
        if (chunk.lines_are_columns) turn(whole, whole, slab.data(), chunk.surface_m.data() + first, minor);
    }
    pass_surface(request, chunk.window);
    chunk.bytes_read += chunk.posts_read * static_cast<std::uint64_t>(terrain_->facts().type_bytes);
    level_posts_ += chunk.posts_read;
}

void RasterSource::load_surface(Chunk& chunk, const NeededPosts& needed) {
    const Interval columns = chunk.window.columns, rows = chunk.window.rows;
    const std::int64_t width = columns.size(), minor = chunk.minor_count();
    const auto posts = static_cast<std::size_t>(chunk.window.posts());
    const std::vector<Run> terrain = terrain_runs(columns);
    RegisteredLayer::Plan plan;
    if (height_) plan = height_->plan(columns);
    chunk.surface_m.resize(posts);
    const auto most =
        static_cast<std::size_t>(width * std::min(rows.size(), slab_rows(width, chunk.lines_are_columns)));
    RawVector<float> slab;
    if (chunk.lines_are_columns) slab.reserve(most);
    std::vector<float> culture, scratch;
    if (height_) culture.reserve(most);
    std::vector<Window> filled;
    for (const Interval part : slabs(rows, width, chunk.lines_are_columns)) {
        const auto n = static_cast<std::size_t>(part.size() * width);
        const std::int64_t first = part.begin - rows.begin;
        float* surface = chunk.surface_m.data() + first * width;
        if (chunk.lines_are_columns) {
            slab.resize(n);
            surface = slab.data();
        }
        const Window whole{columns, part};
        filled.clear();
        for (const Run& run : terrain)
            chunk.posts_read += read_terrain(run, columns.begin, part, needed, surface, width, filled);
        if (culture_) pass_layer(*culture_, whole, needed);
        if (height_) {
            culture.resize(n);
            const std::int64_t cells =
                height_->read_heights(plan, part, params_.culture_height_scale, needed, culture.data(), scratch);
            chunk.bytes_read += static_cast<std::size_t>(cells * height_->facts().type_bytes);
            for (std::size_t i = 0; i < n; ++i) surface[i] += culture[i];
            needed.fill(whole, {surface, width, false});
            needed.fill(whole, {culture.data(), width, false}, 0.0F);
            filled.assign(1, whole);
            if (std::any_of(culture.begin(), culture.end(), [](float h) { return h != 0; })) {
                note_culture(culture);
                if (chunk.culture_height_m.empty()) chunk.culture_height_m.assign(posts, 0);
                if (chunk.lines_are_columns)
                    turn(whole, whole, culture.data(), chunk.culture_height_m.data() + first, minor);
                else
                    std::copy(culture.begin(), culture.end(), chunk.culture_height_m.begin() + first * width);
            }
        }
        if (chunk.lines_are_columns) {
            float* const to = chunk.surface_m.data() + first;
            for (const Window& window : filled) turn(whole, window, slab.data(), to, minor);
            if (!height_) needed.fill(whole, {to, minor, true});
        } else if (!height_) {
            needed.fill(whole, {surface, width, false});
        }
    }
    chunk.bytes_read += chunk.posts_read * static_cast<std::uint64_t>(terrain_->facts().type_bytes);
}

std::uint64_t RasterSource::read_terrain(const Run& run, std::int64_t first, Interval rows, const NeededPosts& needed,
                                         float* out, std::int64_t stride, std::vector<Window>& filled) {
    const std::int64_t shift = first + run.at - run.source.begin;
    if (needed.all()) {
        ledger_->touch({run.source, rows});
        terrain_->read_heights({run.source, rows}, out + run.at, stride);
        filled.push_back({{run.source.begin + shift, run.source.end + shift}, rows});
        return static_cast<std::uint64_t>(run.source.size() * rows.size());
    }
    // From tiles that stay unpacked only what is needed, one after the other; from others not in many pieces.
    const RasterFacts& facts = terrain_->facts();
    const bool unpacked =
        terrain_->fills_tile_cache() &&
        tiles_->keeps(static_cast<std::size_t>(facts.block_columns * facts.block_rows * facts.type_bytes));
    std::uint64_t read = 0;
    for_each_tile_run(
        facts, {run.source, rows},
        [&](const Window& cells) {
            return needed.reason({{cells.columns.begin + shift, cells.columns.end + shift}, cells.rows});
        },
        [&](const Window& cells) {
            ledger_->touch(cells);
            const auto moved = [](const Window& w, std::int64_t by) {
                return Window{{w.columns.begin + by, w.columns.end + by}, w.rows};
            };
            const auto take = [&](const Window& posts) {
                terrain_->read_heights(moved(posts, -shift),
                                       out + (posts.rows.begin - rows.begin) * stride + posts.columns.begin - first,
                                       stride);
                filled.push_back(posts);
            };
            if (unpacked)
                needed.each_run(moved(cells, shift), take);
            else
                needed.each_part(moved(cells, shift), take);
            read += static_cast<std::uint64_t>(cells.posts());
        },
        [&](const Window& cells, Skip why) { ledger_->pass(cells, why); }, unpacked);
    return read;
}

void RasterSource::pass_surface(const ChunkRequest& request, const Window& window) {
    const NeededPosts needed(request);
    if (request.level > 0) return pass_level(request.level, window, needed);
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

void RasterSource::pass_level(int level, const Window& window, const NeededPosts& needed) {
    const auto why = [&](const Window& posts) {
        const Skip reason = needed.reason(posts);
        return reason == Skip::none ? Skip::detail : reason;
    };
    // In pieces that lie in one tile of the file.
    const auto unit = [&](std::int64_t tile) { return std::max<std::int64_t>(1, tile >> level); };
    const std::int64_t wide = unit(terrain_->facts().unit_columns()), high = unit(terrain_->facts().unit_rows());
    for (std::int64_t r = window.rows.begin; r < window.rows.end;) {
        const std::int64_t r_end = std::min(window.rows.end, (r / high + 1) * high);
        for (std::int64_t c = window.columns.begin; c < window.columns.end;) {
            const std::int64_t c_end = std::min(window.columns.end, (c / wide + 1) * wide);
            const Window posts{{c, c_end}, {r, r_end}};
            const Skip reason = why(posts);
            ledger_->pass(raster_posts(posts, level), reason);
            if (culture_) culture_->pass(raster_posts(posts, level), reason == Skip::detail ? Skip::culture : reason);
            if (height_) height_->pass(raster_posts(posts, level), reason);
            c = c_end;
        }
        r = r_end;
    }
}

void RasterSource::pass_layer(RegisteredLayer& layer, const Window& posts, const NeededPosts& needed) {
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

bool RasterSource::find_classes(const std::int32_t* __restrict codes, std::int64_t n,
                                ClassId* __restrict classes) const {
    const ClassId* __restrict const table = class_of_.data();  // bytes that are written could be anything else
    std::uint32_t beyond = 0;
    for (std::int64_t i = 0; i < n; ++i) beyond |= place_in_table(codes[i]) < table_size ? 0U : 1U;
    if (beyond) {
        for (std::int64_t i = 0; i < n; ++i) {
            const std::uint32_t at = place_in_table(codes[i]);
            classes[i] = at < table_size ? table[at] : class_beyond_table(codes[i]);
        }
    } else {
        for (std::int64_t i = 0; i < n; ++i) classes[i] = table[place_in_table(codes[i])];
    }
    std::uint8_t unknown = 0;
    for (std::int64_t i = 0; i < n; ++i) unknown |= classes[i] == unknown_class ? 1 : 0;
    return unknown != 0;
}

ClassId RasterSource::class_beyond_table(std::int32_t code) const {
    if (code == void_code) return params_.default_class;
    return params_.legend->find(code).value_or(unknown_class);
}

Extremes RasterSource::find_extremes() {
    if (const auto known = bare_extremes(); known && (!height_ || map_)) return known_extremes(*known);
    const RasterFacts& facts = terrain_->facts();
    // Each thread looks at its share of what one would, or at a whole block; beside what is decoded they hold no more than is granted
    // for that.
    constexpr std::int64_t least = slab_posts / 8;
    const std::int64_t block = std::clamp(
        facts.unit_columns() * std::min(facts.unit_rows(), terrain_->rows_decoded_together()), least, slab_posts);
    const auto posts_each = [&](int threads) { return std::max(slab_posts / threads, block); };
    const auto held_bytes = [&](int threads) {
        const std::size_t buffers = 3 * sizeof(float) * static_cast<std::size_t>(posts_each(threads));
        return static_cast<std::size_t>(threads) * (reader_bytes() + buffers);
    };
    int threads = at_hand(params_.threads);
    while (threads > 1 && held_bytes(threads) > params_.cache_bytes) --threads;
    const std::int64_t posts = posts_each(threads);
    std::vector<Window> windows;
    for_each_window(facts, facts.own_columns(), posts, [&](const Window& window) { windows.push_back(window); });
    const ChunkRequest everything;
    const NeededPosts all(everything);
    PostExtremes bare, surface;
    std::mutex mutex;  // of these
    std::exception_ptr error;
    std::size_t failed = windows.size();  // the first in the file's order, so that no order of threads shows
    const auto look = [&](const Window& window) {
        if (params_.stop) params_.stop->check();
        const auto n = static_cast<std::size_t>(window.posts());
        std::vector<float> terrain(n), culture, scratch;
        terrain_->read_heights(window, terrain.data(), window.columns.size());
        const PostExtremes own = post_extremes(terrain.data(), window, window);
        PostExtremes own_surface;
        if (height_) {
            culture.resize(n);
            height_->read_heights(height_->plan(window.columns), window.rows, params_.culture_height_scale, all,
                                  culture.data(), scratch);
            for (std::size_t i = 0; i < n; ++i) terrain[i] += culture[i];
            own_surface = post_extremes(terrain.data(), window, window);
        }
        const std::lock_guard lock(mutex);
        bare.add(own);
        surface.add(own_surface);
    };
    const auto look_at = [&](std::size_t i) {
        try {
            {
                const std::lock_guard lock(mutex);
                if (i > failed) return;
            }
            look(windows[i]);
        } catch (...) {
            const std::lock_guard lock(mutex);
            if (i < failed) failed = i, error = std::current_exception();
        }
    };
    if (threads == 1) {
        for (std::size_t i = 0; i < failed; ++i) look_at(i);
    } else {
        Threads(threads, false).execute([&] {
            tbb::parallel_for(
                tbb::blocked_range<std::size_t>(0, windows.size(), 1),
                [&](const auto& part) {
                    for (std::size_t i = part.begin(); i < part.end(); ++i) look_at(i);
                },
                tbb::simple_partitioner());
        });
    }
    if (error) std::rethrow_exception(error);
    Extremes out = extremes_of(bare);
    if (out.any_valid && height_) out.highest_m = surface.highest_m;
    return out;
}

Extremes RasterSource::known_extremes(Extremes out) {
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

}  // namespace wedgescope
