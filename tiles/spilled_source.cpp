#include "tiles/sources.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <type_traits>
#include <utility>

#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "lib/large_blocks.hpp"
#include "tiles/detail_map_file.hpp"
#include "tiles/file_stamp.hpp"
#include "tiles/kept_description.hpp"
#include "tiles/partition.hpp"
#include "tiles/raster_source.hpp"
#include "tiles/spill.hpp"

namespace wedgescope {
namespace {

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
        // resolve() refuses a range beyond Earth::farthest_radii.
        constexpr double largest_radius_m = 1.025 * 6.4e6;
        scope.reach_m.reset();
        if (scene.scene.earth_k && !options.all_of_it)
            scope.reach_m = Earth::farthest_radii * *scene.scene.earth_k * largest_radius_m;
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

/// The pass goes through files in their order.
DataBaseParams read_once(DataBaseParams params) {
    params.more_cache_bytes = 0;
    return params;
}

/// The files of the rasters, which are to stay as they are while a pass reads them.
class FilesAtRest {
public:
    explicit FilesAtRest(const DataBaseParams& params) {
        for (const std::string* path : {&params.dem, &params.culture, &params.culture_height})
            if (!path->empty()) files_.emplace_back(*path, file_stamps(*path));
    }
    void check() const {
        for (const auto& [path, stamps] : files_)
            if (file_stamps(path) != stamps)
                throw DataError(text("'", path, "' changed while it was read; run again when it is at rest"));
    }

private:
    std::vector<std::pair<std::string, std::vector<FileStamp>>> files_;
};

/// Of all blocks that are needed, none narrower than its type.
std::uint64_t widest_bytes(const std::vector<LayerPass>& passes) {
    std::uint64_t bytes = 0;
    for (const LayerPass& layer : passes) {
        const BlockSet& blocks = layer.blocks;
        bytes += static_cast<std::uint64_t>(std::count(blocks.needed.begin(), blocks.needed.end(), true) * blocks.edge *
                                            blocks.edge * std::min(layer.in.facts().type_bytes, 4));
    }
    return bytes;
}

class PartitionedSource final : public RasterSource {
public:
    /// `extremes`: take them on the way, over the whole raster.
    static std::unique_ptr<PartitionedSource> passed(const DataBaseParams& params, const PartitionScope& scope,
                                                     bool extremes, const SpillOptions& options) {
        std::unique_ptr<PartitionedSource> made(new PartitionedSource(params));
        const auto start = std::chrono::steady_clock::now();
        made->partition(scope, extremes, options, nullptr);
        made->seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        return made;
    }
    /// From a spill that was kept.
    static std::unique_ptr<PartitionedSource> reopened(const DataBaseParams& params, const std::string& path,
                                                       const IndexPosition& nadir, const SpillOptions& options) {
        std::unique_ptr<PartitionedSource> made(new PartitionedSource(params));
        made->reopen(path, nadir, options);
        made->kept_ = path;
        return made;
    }
    /// What passed() would make, without a pass.
    static std::unique_ptr<PartitionedSource> forecast(const DataBaseParams& params, const PartitionScope& scope,
                                                       bool extremes, const SpillOptions& options) {
        std::unique_ptr<PartitionedSource> made(new PartitionedSource(params));
        made->foresee(scope, extremes, options);
        return made;
    }
    /// A pass over all of the rasters into a spill that stays at `path`, made for a point.
    static void keep(const DataBaseParams& params, const PartitionScope& scope, const SpillOptions& options,
                     const std::string& path, const std::optional<LatLon>& latlon) {
        const Keep keep{path, latlon};
        PartitionedSource(params).partition(scope, true, options, &keep);
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

    void read_bare_terrain(const Window& posts, float* heights_m) override {
        const std::vector<Run> parts = terrain_runs(posts.columns);
        if (!terrain_blocks_ || std::all_of(parts.begin(), parts.end(), [&](const Run& part) {
                return terrain_blocks_->holds({part.source, posts.rows});
            }))
            return RasterSource::read_bare_terrain(posts, heights_m);
        ask_direct([&](WedgeSource& rasters) {
            rasters.read_bare_terrain(posts, heights_m);
            return true;
        });
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
        SourceReport r = RasterSource::report();
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
    explicit PartitionedSource(const DataBaseParams& params) : RasterSource(read_once(params)) {}

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

    /// A spill that is to stay.
    struct Keep {
        const std::string& path;
        const std::optional<LatLon>& latlon;  ///< of the point that it is made for
    };
    struct StoredBounds {
        float lowest_m, highest_m, culture_m;
        std::uint32_t voids;
    };

    /// `keep`: the path of a spill that stays; empty: none does.
    void lay_out(Passes& made, const PartitionScope& scope, bool extremes, const SpillOptions& options,
                 const std::string& keep);
    /// The pass. `keep`: null where no spill stays.
    void partition(const PartitionScope& scope, bool extremes, const SpillOptions& options, const Keep* keep);
    /// Reads the rasters, and puts the spill's blocks in their place.
    void run_passes(const Passes& made);
    void keep_for(const IndexPosition& nadir, const Keep& keep);
    /// Posts and classes are asked for by the spill's blocks.
    void take_block_edges(const Passes& made);
    void foresee(const PartitionScope& scope, bool extremes, const SpillOptions& options);
    void reopen(const std::string& path, const IndexPosition& nadir, const SpillOptions& options);

    // A kept spill: the layers' blocks, the finest level of the block map as one more layer, and a KeptDescription.

    static constexpr const char* map_layer = "block map";
    static constexpr std::int64_t map_edge = 64;
    void put_map();
    void take_map(std::size_t layer);
    /// What a layer is made of: of a store's the fingerprint of its checksums, so that the store may be moved; else its
    /// files as lines: role, size, time of change, path.
    std::string files(RasterLayer& layer) const;
    std::unique_ptr<RasterLayer> replace_terrain(std::unique_ptr<SpilledLayer> blocks);
    /// Places on the terrain's grid of the corners of a block of the terrain's or of a layer's own posts.
    static std::array<IndexPosition, 4> corners(const Window& posts, const RegisteredLayer* layer);
    /// Blocks of a layer that lie under needed blocks of the terrain.
    static BlockSet blocks_under(const RegisteredLayer& layer, const BlockSet& terrain, bool all,
                                 std::size_t memory_bytes);

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

void PartitionedSource::lay_out(Passes& made, const PartitionScope& scope, bool extremes, const SpillOptions& options,
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

void PartitionedSource::partition(const PartitionScope& scope, bool extremes, const SpillOptions& options,
                                  const Keep* keep) {
    const FilesAtRest files(params_);
    Passes made;
    lay_out(made, scope, extremes, options, keep ? keep->path : "");
    spill_->expect(widest_bytes(made.layers));
    Survey survey(data_base_, made.terrain, made.with_map);
    LayerPass& terrain_pass = made.layers[height_ ? 1 : 0];
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
    for (const LayerPass& layer : made.layers) total += posts_of_pass(layer, made.pass);
    made.pass.progress = [&](std::uint64_t posts) {
        done += posts;
        if (options.progress) options.progress(static_cast<double>(done) / static_cast<double>(total));
    };
    run_passes(made);
    files.check();
    if (extremes) extremes_ = survey.extremes();
    map_ = survey.take_map();
    if (keep)
        keep_for(scope.nadir, *keep);
    else
        spill_->seal();
    if (height_) height_->forget();
    store_.reset();
    tiles_->limit(0);
    take_block_edges(made);
    if (options.timeline) options.timeline->memory(cache_bytes());
    trim_freed_memory();  // what the pass held is the engine's now
}

void PartitionedSource::run_passes(const Passes& made) {
    std::vector<std::unique_ptr<RasterLayer>> rasters;   // until the end: a pass may still read from one
    std::vector<RasterLayer::Fingerprint> fingerprints;  // before anything is read
    for (const LayerPass& layer : made.layers) fingerprints.push_back(layer.in.fingerprint_now());
    for (std::size_t i = 0; i < made.layers.size(); ++i) {
        const LayerPass& layer = made.layers[i];
        const PassDone done = run_pass(layer, made.pass);
        pass_bytes_ += done.read_bytes;
        const std::size_t cached = GdalSession::cache_used_bytes() + tiles_->bytes();
        pass_peak_bytes_ = std::max(pass_peak_bytes_, done.held_bytes + spill_->index_bytes() + map_bytes_ + cached +
                                                          forecast_.readers * RasterSource::reader_bytes());
        auto blocks = std::make_unique<SpilledLayer>(layer.in.facts(), fingerprints[i], spill_, layer.layer);
        if (height_ && &layer.in == &height_->raster())
            rasters.push_back(height_->replace(std::move(blocks)));
        else if (culture_ && &layer.in == &culture_->raster())
            rasters.push_back(culture_->replace(std::move(blocks)));
        else
            rasters.push_back(replace_terrain(std::move(blocks)));
    }
}

void PartitionedSource::keep_for(const IndexPosition& nadir, const Keep& keep) {
    if (map_) put_map();
    KeptDescription made_for{keep.latlon, nadir, params_.culture_height_scale, *extremes_, ""};
    for (RasterLayer* layer : readers()) made_for.files += files(*layer);
    spill_->keep(made_for.lines());
}

void PartitionedSource::take_block_edges(const Passes& made) {
    data_base_.block_columns = data_base_.block_rows = made.terrain.edge;
    if (culture_) data_base_.culture_tile_columns = data_base_.culture_tile_rows = made.culture.edge;
}

void PartitionedSource::foresee(const PartitionScope& scope, bool extremes, const SpillOptions& options) {
    Passes made;
    lay_out(made, scope, extremes, options, "");
    take_block_edges(made);
    // The ledgers will be of the blocks.
    for (const LayerPass& layer : made.layers) {
        const RasterFacts& f = layer.in.facts();
        forecast_ledgers_ += static_cast<std::size_t>(all_blocks(f.columns, f.rows, layer.blocks.edge).blocks.posts());
    }
}

void PartitionedSource::put_map() {
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

void PartitionedSource::take_map(std::size_t layer) {
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
                    finest[static_cast<std::size_t>(y * f.posts_columns + x)] = {b.lowest_m, b.highest_m, b.culture_m,
                                                                                 static_cast<Voids>(b.voids)};
                }
        }
    map_ = map_from_finest(data_base_, std::move(finest));
}

std::string PartitionedSource::files(RasterLayer& layer) const {
    const RasterFacts& f = layer.facts();
    const bool given =
        f.role == "culture" ? !params_.culture.empty() : f.role == "culture-height" && !params_.culture_height.empty();
    if (!given && is_tile_store(params_.dem)) return text("file ", f.role, " in store ", layer.fingerprint({}), '\n');
    std::string lines;
    for (const FileStamp& s : file_stamps(f.path)) {
        std::error_code none;
        const std::filesystem::path whole = std::filesystem::weakly_canonical(s.file, none);
        lines += text("file ", f.role, ' ', s.bytes, ' ', s.changed_s, ' ', s.changed_ns, ' ',
                      none ? s.file : whole.string(), '\n');
    }
    return lines;
}

void PartitionedSource::reopen(const std::string& path, const IndexPosition& nadir, const SpillOptions& options) {
    const std::size_t memory_bytes = options.memory_bytes;
    spill_ = Spill::open_kept(path, options.timeline);
    const auto refuse = [&](const std::string& why, const char* way_out = "tile --around makes it anew") {
        throw UnfitSpill(text("the kept spill '", path, "' ", why, "; ", way_out));
    };
    if (spill_->index_bytes() > memory_bytes / 8)
        throw TooLittleMemory(memory_bytes, spill_->index_bytes() * 8,
                              text("the index of the kept spill '", path, "'"));
    const KeptDescription made = KeptDescription::of(*spill_);
    if (!same_point(made.nadir, nadir))
        refuse(fmt::format("was made for column {:.2f}, row {:.2f}; the sensor stands over column {:.2f}, row {:.2f}",
                           made.nadir.column, made.nadir.row, nadir.column, nadir.row),
               "tile --overwrite --around replaces it");
    const auto take = [&](RasterLayer& raster) {
        const RasterFacts& f = raster.facts();
        std::size_t number = 0;
        while (number < spill_->layer_count() && spill_->layer(number).name != f.role) ++number;
        if (number == spill_->layer_count()) refuse(text("holds no ", f.role));
        const SpillLayer& layer = spill_->layer(number);
        if (made.files_of(f.role) != files(raster) || layer.posts_columns != f.columns || layer.posts_rows != f.rows)
            refuse(text("was made of another raster than ", f.named(), ", or before that was changed"));
        return std::make_unique<SpilledLayer>(f, raster.fingerprint_now(), spill_, number);
    };
    if (height_ && made.culture_height_scale != params_.culture_height_scale)
        refuse(text("was made with culture-height-scale ", made.culture_height_scale, ", not ",
                    params_.culture_height_scale));
    const bool culture_then = !made.files_of("culture-height").empty();
    if (culture_then != static_cast<bool>(height_))
        refuse(culture_then ? "was made with a culture-height" : "holds no culture-height");
    replace_terrain(take(*terrain_));
    if (height_) height_->replace(take(height_->raster()));
    if (culture_) culture_->replace(take(culture_->raster()));
    std::unique_ptr<BlockMap> of_store = std::move(map_);
    extremes_ = made.extremes;
    map_bytes_ = Survey::map_bytes(all_blocks(data_base_.columns, data_base_.rows, block_posts));
    for (std::size_t i = 0; i < spill_->layer_count(); ++i)
        if (spill_->layer(i).name == map_layer && map_bytes_ <= memory_bytes / 16) take_map(i);
    if (!map_) {
        constexpr std::size_t pages = std::size_t{4} << 20;  // a store's map is read page by page
        map_bytes_ = of_store ? pages : 0;
        map_ = std::move(of_store);
    }
    store_.reset();
    tiles_->limit(0);
    data_base_.block_columns = data_base_.block_rows = terrain_->facts().block_rows;
    if (culture_) data_base_.culture_tile_columns = data_base_.culture_tile_rows = culture_->facts().block_rows;
}

std::unique_ptr<RasterLayer> PartitionedSource::replace_terrain(std::unique_ptr<SpilledLayer> blocks) {
    terrain_blocks_ = blocks.get();
    ledger_ = std::make_unique<TileLedger>(blocks->facts());
    return std::exchange(terrain_, std::move(blocks));
}

std::array<IndexPosition, 4> PartitionedSource::corners(const Window& posts, const RegisteredLayer* layer) {
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

BlockSet PartitionedSource::blocks_under(const RegisteredLayer& layer, const BlockSet& terrain, bool all,
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

}  // namespace

std::unique_ptr<WedgeSource> open_spilled_source(const DataBaseParams& params, const Scene& scene,
                                                 const SpillOptions& options) {
    const bool range_given = scene.range_m.has_value();
    const PartitionScope scope = scope_of_pass(placed(scene, *open_direct_source(params)), range_given, options);
    return PartitionedSource::passed(params, scope, !range_given && !options.all_of_it, options);
}

std::unique_ptr<WedgeSource> forecast_spilled_source(const DataBaseParams& params, const ResolvedScene& scene,
                                                     bool range_given, const SpillOptions& options) {
    const PartitionScope scope = scope_of_pass(scene, range_given, options);
    return PartitionedSource::forecast(params, scope, !range_given && !options.all_of_it, options);
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

}  // namespace

void keep_spill(const DataBaseParams& params, const PlatformParams& point, const std::string& folder,
                const SpillOptions& options) {
    const ResolvedScene place = place_of(params, point);
    PartitionScope scope = scope_of(place);
    scope.reach_m.reset();
    scope.width_rad = PartitionScope{}.width_rad;
    std::optional<LatLon> latlon;
    if (place.has_lat_lon) latlon = {place.lat_deg, place.lon_deg};
    PartitionedSource::keep(params, scope, options, kept_path(folder), latlon);
}

void refuse_other_kept_spill(const DataBaseParams& params, const PlatformParams& point, const std::string& folder) {
    const std::string path = kept_path(folder);
    std::error_code ignored;
    if (!std::filesystem::exists(path, ignored)) return;
    KeptDescription made;
    try {
        made = KeptDescription::of(*Spill::open_kept(path));
    } catch (const Error&) {
        return;
    }
    if (same_point(made.nadir, scope_of(place_of(params, point)).nadir)) return;
    std::string where;
    if (const auto& at = made.latlon)
        where = fmt::format("latitude {:.6f}, longitude {:.6f}: ", at->lat_deg, at->lon_deg);
    throw InputError(
        fmt::format("the kept spill '{}' stands, made for another point ({}column {:.2f}, row {:.2f}); "
                    "--overwrite replaces it",
                    path, where, made.nadir.column, made.nadir.row));
}

std::unique_ptr<WedgeSource> open_kept_spill(const DataBaseParams& params, const Scene& scene,
                                             const std::string& folder, const SpillOptions& options) {
    const IndexPosition nadir = placed(scene, *open_direct_source(params)).nadir;
    return PartitionedSource::reopened(params, kept_path(folder), nadir, options);
}

}  // namespace wedgescope
