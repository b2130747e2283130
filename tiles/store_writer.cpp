#include <tbb/parallel_for_each.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>

#include "lib/error.hpp"
#include "lib/post_extremes.hpp"
#include "lib/threads.hpp"
#include "tiles/block_map_file.hpp"
#include "tiles/burnt_layer.hpp"
#include "tiles/checksum.hpp"
#include "tiles/code_counts.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/mosaic.hpp"
#include "tiles/plain_file.hpp"
#include "tiles/raster_driver.hpp"
#include "tiles/registered_layer.hpp"
#include "tiles/sheet_writer.hpp"
#include "tiles/sided_layer.hpp"
#include "tiles/sources.hpp"
#include "tiles/store_manifest.hpp"
#include "tiles/store_vrt.hpp"
#include "tiles/tile_store.hpp"
#include "tiles/unfinished_store.hpp"

namespace wedgescope {
namespace {

namespace fs = std::filesystem;
using json = nlohmann::ordered_json;

constexpr std::int64_t unit_posts = std::int64_t{1} << 20;  ///< read and tiled at a time, about

/// One layer on its way into the store: rasters, or a culture layer with features burnt over it.
struct Layer {
    StoreLayerKind kind;
    std::unique_ptr<Mosaic> input;  ///< null: burnt
    std::unique_ptr<BurntLayer> burnt;
    std::vector<StoreSource> burnt_sources;
    StoreLayerEntry entry;
    std::vector<std::string> creation;
    std::vector<std::uint64_t> before;  ///< fingerprints of what it is made of when that was opened

    Layer(StoreLayerKind k, const std::string& role, const std::vector<std::string>& paths)
        : kind(k), input(std::make_unique<Mosaic>(role, paths)) {}
    Layer(StoreLayerKind k, std::unique_ptr<BurntLayer> layer, std::vector<StoreSource> sources)
        : kind(k), burnt(std::move(layer)), burnt_sources(std::move(sources)) {}

    bool codes() const { return kind == StoreLayerKind::culture; }
    const RasterFacts& facts() const { return burnt ? burnt->facts() : input->facts(); }
    bool single() const { return burnt || input->single(); }
    bool resampled() const { return !burnt && input->resampled(); }
    std::vector<StoreSource> sources() const { return burnt ? burnt_sources : input->sources(); }
    std::vector<std::uint64_t> fingerprints() {
        return burnt ? std::vector{burnt->fingerprint({})} : input->fingerprints();
    }
    ReaderBytes reader_bytes() const { return burnt ? burnt->reader_bytes() : input->reader_bytes(); }
    std::vector<std::size_t> pieces_in(const Window& window) const {
        return burnt ? std::vector<std::size_t>{0} : input->pieces_in(window);
    }
    void read(const Window& window, const Window& counted, Mosaic::Kind as, const std::vector<std::size_t>& pieces,
              Mosaic::Posts& out) {
        if (!burnt) return input->read(window, counted, as, pieces, out);
        const auto n = static_cast<std::size_t>(window.posts());
        out.stored.resize(n * static_cast<std::size_t>(facts().type_bytes));
        if (codes()) {
            out.codes.resize(n);
            burnt->read_codes(window, out.codes.data());
            burnt->store(out.codes, out.stored);
        } else {
            out.heights.resize(n);
            burnt->read_heights(window, out.heights.data(), window.columns.size());
            burnt->store(out.heights, out.stored);
        }
    }
};

struct Job {
    Layer* layer;
    std::int64_t column, row;  ///< of the sheet
    std::size_t place;         ///< in the layer's list
};

/// What a job leaves.
struct Done {
    bool made = false, reused = false;
    StoreSheet sheet;
    ValueFacts values;
    Disagreement disagreement;
};

class StoreWriter {
public:
    explicit StoreWriter(const TileStoreParams& params);
    TileStoreSummary run();

private:
    void open_layers();
    bool is_burnt(StoreLayerKind kind) const;
    std::unique_ptr<BurntLayer> burnt(StoreLayerKind kind) const;
    void choose_creation(Layer& layer) const;
    std::size_t job_bytes(const Layer& layer, std::size_t sheets = 1) const;
    std::size_t most_job_bytes() const;
    int jobs_at_once() const;
    std::size_t decoded_under_bands(int jobs, std::int64_t more_rows) const;
    void widen_cache();
    std::string plan() const;
    std::int64_t band_rows() const;
    std::int64_t sheets_together(const Layer& layer) const;
    void make_sheets();
    void make(const std::vector<Job>& row);
    void add_progress(std::int64_t posts);
    Done& done_of(const Job& job);
    class Sheet;
    void add_codes(const std::int32_t* codes, const Window& given, const Window& own, Done& done,
                   CodeCounts& unknown) const;
    void add_unknown(const CodeCounts& codes);
    void add_heights(const Layer& layer, const float* heights, const Window& given, const Window& own,
                     Done& done) const;
    bool finished_before(const Job& job, Done& done);
    Window with_next(const Window& posts) const;
    void finish();
    TileStoreSummary summary() const;
    std::string inside(const std::string& file) const { return folder_.inside(file); }

    const TileStoreParams& params_;
    std::size_t cache_bytes_ = params_.cache_bytes;
    int most_jobs_ = std::numeric_limits<int>::max();
    UnfinishedStore folder_;  ///< where it is made
    std::vector<std::unique_ptr<Layer>> layers_;
    std::shared_ptr<FeatureFile> features_;    ///< null: none
    std::unique_ptr<RegisteredLayer> height_;  ///< culture height at the terrain's posts
    std::unique_ptr<BlockMapWriter> map_;
    std::unique_ptr<DetailMapWriter> detail_;
    std::vector<std::vector<Done>> done_;
    std::mutex mutex_;
    CodeCounts unknown_codes_;  ///< of all sheets that are done: one that is leaves its own only in its sums
    std::uint64_t posts_done_ = 0, posts_ = 0;
    StoreManifest manifest_;
};

StoreWriter::StoreWriter(const TileStoreParams& params) : params_(params), folder_(params.output) {
    if (params_.tile_posts < 64 || params_.tile_posts > 2048 || (params_.tile_posts & (params_.tile_posts - 1)) != 0)
        throw InputError(
            text("tile-size is ", params_.tile_posts, "; accepted: 64, 128, 256, 512, 1024 or 2048 posts"));
}

void StoreWriter::open_layers() {
    if (params_.dems.empty()) throw InputError("tile needs at least one terrain raster and the folder to write");
    layers_.push_back(std::make_unique<Layer>(StoreLayerKind::dem, "dem", params_.dems));
    const RasterFacts& terrain = layers_[0]->facts();
    check_terrain_size(terrain);
    if (params_.features) features_ = std::make_shared<FeatureFile>(*params_.features, terrain);
    const auto add = [&](StoreLayerKind kind, const char* role, const std::string& path) {
        if (!is_burnt(kind)) {
            layers_.push_back(std::make_unique<Layer>(kind, role, std::vector{path}));
            return;
        }
        std::vector<StoreSource> sources;
        if (!path.empty()) sources = Mosaic(role, {path}).sources();
        if (kind == StoreLayerKind::culture && params_.sides)
            for (const StoreSource& one : Mosaic("directivity", {params_.sides->path}).sources())
                sources.push_back(one);
        if (features_) sources.push_back(features_->source());
        layers_.push_back(std::make_unique<Layer>(kind, burnt(kind), std::move(sources)));
    };
    if (!params_.culture.empty()) {
        add(StoreLayerKind::culture, "culture", params_.culture);
        const BurntLayer* const over = layers_.back()->burnt.get();
        refuse_scaled_codes(over ? over->below()->facts() : layers_.back()->facts());
        // Only to be refused if it does not fit.
        const RegisteredLayer check(std::make_unique<RasterFile>("culture", params_.culture), terrain);
    } else if (is_burnt(StoreLayerKind::culture)) {
        add(StoreLayerKind::culture, "culture", "");
    }
    if (is_burnt(StoreLayerKind::culture_height)) {
        add(StoreLayerKind::culture_height, "culture-height", params_.culture_height);
        height_ = std::make_unique<RegisteredLayer>(burnt(StoreLayerKind::culture_height), terrain);
    } else if (!params_.culture_height.empty()) {
        add(StoreLayerKind::culture_height, "culture-height", params_.culture_height);
        height_ = std::make_unique<RegisteredLayer>(
            std::make_unique<RasterFile>("culture-height", params_.culture_height), terrain);
    }
    for (const auto& layer : layers_) {
        StoreLayerEntry& entry = layer->entry;
        entry.kind = layer->kind;
        entry.facts = layer->facts();
        entry.facts.block_columns = entry.facts.block_rows = params_.tile_posts;
        entry.vrt = text(name(layer->kind), ".vrt");
        entry.sources = layer->sources();
        layer->before = layer->fingerprints();
        choose_creation(*layer);
        posts_ += static_cast<std::uint64_t>(entry.facts.columns * entry.facts.rows);
    }
}

bool StoreWriter::is_burnt(StoreLayerKind kind) const {
    if (kind == StoreLayerKind::culture && params_.sides) return true;
    if (!features_) return false;
    return kind == StoreLayerKind::culture ? features_->has_materials()
                                           : kind == StoreLayerKind::culture_height && features_->has_heights();
}

std::unique_ptr<BurntLayer> StoreWriter::burnt(StoreLayerKind kind) const {
    const bool codes = kind == StoreLayerKind::culture;
    const std::string& path = codes ? params_.culture : params_.culture_height;
    std::unique_ptr<RasterLayer> below;
    if (!path.empty()) below = std::make_unique<RasterFile>(codes ? "culture" : "culture-height", path);
    if (codes && params_.sides) below = std::make_unique<SidedLayer>(std::move(below), *params_.sides);
    return std::make_unique<BurntLayer>(kind, std::move(below), layers_[0]->facts(), features_,
                                        params_.culture_height_scale);
}

void StoreWriter::choose_creation(Layer& layer) const {
    std::map<std::string, std::string> given;
    for (const std::string& option : params_.creation) {
        const auto equals = option.find('=');
        std::string key = option.substr(0, equals);
        std::transform(key.begin(), key.end(), key.begin(), [](unsigned char c) { return std::toupper(c); });
        for (const char* own : {"TILED", "BLOCKXSIZE", "BLOCKYSIZE", "INTERLEAVE", "PROFILE", "NBITS", "PIXELTYPE",
                                "SPARSE_OK", "NUM_THREADS", "PHOTOMETRIC", "ALPHA", "TFW", "WORLDFILE", "GEOTIFF_KEYS"})
            if (key == own)
                throw InputError(text("co is '", option, "'; ", own, " is not open to choice in a tile store",
                                      key.starts_with("BLOCK") || key == "TILED" ? " (tile-size is)" : ""));
        given[key] = equals == std::string::npos ? "" : option.substr(equals + 1);
    }
    const RasterFacts& facts = layer.entry.facts;
    const bool small = facts.columns * facts.rows <= params_.most_as_it_is / facts.type_bytes;
    if (!given.contains("COMPRESS"))
        given["COMPRESS"] = small && !given.contains("ZSTD_LEVEL") && !given.contains("PREDICTOR") ? "NONE" : "ZSTD";
    const std::string& compress = given["COMPRESS"];
    if (EQUAL(compress.c_str(), "ZSTD")) given.try_emplace("ZSTD_LEVEL", text(1));
    const bool predicts =
        EQUAL(compress.c_str(), "ZSTD") || EQUAL(compress.c_str(), "DEFLATE") || EQUAL(compress.c_str(), "LZW");
    const bool floats = facts.type == GDT_Float32 || facts.type == GDT_Float64;
    const auto order = given.find("ENDIANNESS");
    const bool readable = !floats || order == given.end() || !swaps_bytes(order->second);
    if (!readable && given.contains("PREDICTOR") && given["PREDICTOR"] == "3") refuse_predictor(order->second);
    if (predicts && !given.contains("PREDICTOR") && !layer.codes() && readable)
        given["PREDICTOR"] = text(floats ? 3 : 2);
    layer.creation.clear();
    for (const auto& [key, value] : given) layer.creation.push_back(key + "=" + value);
    layer.entry.facts.compression = compress;
}

std::size_t StoreWriter::job_bytes(const Layer& layer, std::size_t sheets) const {
    const std::int64_t tile = params_.tile_posts;
    const auto unit = static_cast<std::size_t>(std::max(unit_posts, tile * tile) + 2 * (sheet_posts + tile) + 1);
    std::size_t post = static_cast<std::size_t>(layer.entry.facts.type_bytes) + sizeof(float);
    if (!layer.single()) post += sizeof(float) + sizeof(std::int32_t);
    if (layer.resampled()) post += sizeof(float);
    if (layer.burnt) post += FeatureFile::cell_bytes + (params_.sides ? sizeof(std::int32_t) : 0);
    std::size_t bytes = sheet_writer_bytes(layer.entry.facts);
    if (layer.kind == StoreLayerKind::dem)
        bytes += 4 * page_blocks * page_blocks * sizeof(BlockBounds) +
                 detail_page_blocks * detail_page_blocks * sizeof(Residuals);
    // Counts of each sheet, and what becomes of them: words on their way into its sums, and those of all.
    if (layer.codes() && params_.legend) {
        const RasterFacts& f = layer.entry.facts;
        bytes += 2 * CodeCounts::bytes(f.columns * f.rows, f.type_bytes);
    }
    bytes *= sheets;
    if (layer.kind == StoreLayerKind::dem && height_) {
        post += sizeof(float);
        bytes += static_cast<std::size_t>(2 * slab_posts) * sizeof(float);
        if (is_burnt(StoreLayerKind::culture_height))
            bytes += static_cast<std::size_t>(slab_posts) * FeatureFile::cell_bytes;
    }
    // Blocks as they are decoded, one layer at a time; what its handles keep of each layer's packed ones.
    bytes += layer.reader_bytes().decoded + (height_ ? height_->raster().reader_bytes().packed : 0);
    for (const auto& other : layers_) bytes += other->reader_bytes().packed;
    return bytes + unit * post;
}

std::size_t StoreWriter::most_job_bytes() const {
    std::size_t most = 0;
    for (const auto& layer : layers_) most = std::max(most, job_bytes(*layer));
    return most;
}

int StoreWriter::jobs_at_once() const {
    const std::size_t most = most_job_bytes();
    const std::size_t fixed = cache_bytes_;
    if (params_.memory_bytes < fixed + most) {
        // The cache is an eighth of what is granted, or less.
        const RasterFacts& own = layers_[0]->facts();
        throw TooLittleMemory(
            params_.memory_bytes, most * 8 / 7 + 1, text("tiling ", own.named()),
            layers_[0]->single() ? text(" (blocks of ", own.block_columns, " x ", own.block_rows, " posts)") : "");
    }
    const std::size_t fit = (params_.memory_bytes - fixed) / most;
    return static_cast<int>(
        std::min(fit, static_cast<std::size_t>(std::min(most_jobs_, std::max(1, params_.threads)))));
}

/// Of blocks as they are decoded those under a band of a sheet for each job, and `more_rows` rows of blocks below them.
std::size_t StoreWriter::decoded_under_bands(int jobs, std::int64_t more_rows) const {
    const auto count = [](std::int64_t posts, std::int64_t block) { return (posts + block - 1) / block; };
    const auto of = [&](const RasterFacts& f) {
        const std::int64_t wide = f.block_columns, high = f.block_rows,
                           across = std::min(count(sheet_posts, wide) + 1, count(f.columns, wide)),
                           down = std::min(count(band_rows(), high) + more_rows, count(f.rows, high));
        constexpr std::int64_t beside = 4096;  // what GDAL notes of a block
        return static_cast<std::size_t>(across * down) * static_cast<std::size_t>(wide * high * f.type_bytes + beside);
    };
    std::size_t most = 0;
    for (const auto& layer : layers_) {
        if (layer->burnt) continue;
        const bool with_heights = layer->kind == StoreLayerKind::dem && height_;
        most = std::max(most, of(layer->facts()) + (with_heights ? of(height_->facts()) : 0));
    }
    return static_cast<std::size_t>(jobs) * most;
}

/// A block that the cache does not hold from band to band is decoded again for each: where there is memory the cache grows until
/// it does, for fewer jobs at once if need be.
void StoreWriter::widen_cache() {
    const int most = jobs_at_once();
    for (int jobs = most; jobs >= std::max(1, most / 4); --jobs)
        for (const std::int64_t more_rows : {1, 0}) {
            const std::size_t wanted = decoded_under_bands(jobs, more_rows),
                              room = params_.memory_bytes - static_cast<std::size_t>(jobs) * most_job_bytes();
            if (wanted > room) continue;
            most_jobs_ = jobs;
            if (wanted <= cache_bytes_) return;
            cache_bytes_ = wanted;
            return GdalSession::set_cache_bytes(wanted);
        }
}

/// Of whole tiles and blocks of the detail map.
std::int64_t StoreWriter::band_rows() const { return std::max<std::int64_t>(params_.tile_posts, detail_posts); }

/// Sheets of a row that are made side by side, band by band: where packed strips (or lines of text) are wider than a sheet, each is
/// decoded once for all of them while the cache holds it. As many as memory has room for, and a job for each thread.
std::int64_t StoreWriter::sheets_together(const Layer& layer) const {
    const RasterFacts& own = layer.facts();
    if (layer.burnt || !layer.single() || own.block_columns <= sheet_posts || !(own.packed() || own.is_text()))
        return 1;
    const auto threads = static_cast<std::size_t>(jobs_at_once());
    const auto band = static_cast<std::size_t>((band_rows() + 2 * own.block_rows) * own.columns * own.type_bytes);
    if (band * threads * (height_ ? 2 : 1) > cache_bytes_) return 1;
    const std::int64_t across = layer.entry.sheet_columns(), rows = layer.entry.sheet_rows(),
                       jobs_a_row = std::min(across, (static_cast<std::int64_t>(threads) + rows - 1) / rows);
    std::int64_t together = (across + jobs_a_row - 1) / jobs_a_row;
    const std::size_t room = params_.memory_bytes - cache_bytes_;
    while (together > 1 && threads * job_bytes(layer, static_cast<std::size_t>(together)) > room) --together;
    return together;
}

std::string StoreWriter::plan() const {
    json out{{"format", "wedgescope-store-plan-3"}, {"software", params_.software}, {"layers", json::array()}};
    for (const auto& layer : layers_) {
        const RasterFacts& f = layer->entry.facts;
        json one{{"name", name(layer->kind)},
                 {"columns", f.columns},
                 {"rows", f.rows},
                 {"type", type_name(f.type)},
                 {"no_data", f.has_no_data ? text(f.no_data) : "none"},
                 {"tile_size", f.block_columns},
                 {"co", layer->creation},
                 {"sources", json::array()}};
        // With what lies behind and beside the files: parts of a mosaic, side files that tell scale, place or CRS.
        for (const std::uint64_t files : layer->before) one["files"].push_back(hex(files));
        for (const StoreSource& s : layer->entry.sources)
            one["sources"].push_back({{"path", s.path}, {"bytes", s.bytes}, {"mtime_s", s.mtime_s}});
        out["layers"].push_back(one);
    }
    out["legend"] = {{"name", params_.legend_name}, {"csv", params_.legend_csv}};
    if (params_.culture_height_scale != 1) out["culture_height_scale"] = params_.culture_height_scale;
    if (params_.features)
        out["features"] = {{"path", params_.features->path},
                           {"layer", params_.features->layer},
                           {"touch", params_.features->touch},
                           {"legend", params_.features->legend.csv(params_.features->materials)},
                           {"height_unit_m", params_.culture_height_scale},
                           {"class_table", params_.features->materials.own()},
                           {"axis_step_deg", params_.features->axis_step_deg},
                           {"fingerprint", hex(features_->fingerprint())}};
    if (params_.sides)
        out["directivity"] = {{"path", params_.sides->path},
                              {"class_table", params_.sides->materials.own()},
                              {"axis_step_deg", params_.sides->axis_step_deg}};
    return out.dump(1, ' ', false, json::error_handler_t::replace) + "\n";
}

bool StoreWriter::finished_before(const Job& job, Done& done) {
    const StoreLayerEntry& entry = job.layer->entry;
    const Window posts = entry.posts(job.column, job.row);
    const std::string sums_path = inside(done.sheet.sums), path = inside(done.sheet.file);
    std::error_code error;
    if (!fs::exists(sums_path, error) || !fs::exists(path, error)) return false;
    try {
        const SheetSums sums = read_sums(sums_path, std::nullopt);
        if (sums.columns != posts.columns.size() || sums.rows != posts.rows.size() || sums.tile != params_.tile_posts ||
            sums.file_bytes != file_bytes(path) || sums.file_checksum != file_checksum(path))
            return false;
        if (job.layer->kind == StoreLayerKind::dem) {
            const Window pages = block_pages_of(posts);
            for (std::int64_t r = pages.rows.begin; r < pages.rows.end; ++r)
                for (std::int64_t c = pages.columns.begin; c < pages.columns.end; ++c)
                    if (!map_->holds(0, c, r)) return false;
            if (!detail_->holds(job.column, job.row)) return false;
        }
        done.sheet.bytes = sums.file_bytes;
        done.sheet.sums_checksum = file_checksum(sums_path);
        done.values = sums.values;
        done.disagreement = sums.disagreement;
        add_unknown(sums.codes);
    } catch (const Error&) {
        return false;
    }
    done.made = done.reused = true;
    return true;
}

/// With the posts to the right and below that its blocks need too.
Window StoreWriter::with_next(const Window& posts) const {
    const RasterFacts& f = layers_[0]->entry.facts;
    return {{posts.columns.begin, std::min(posts.columns.end + 1, f.columns)},
            {posts.rows.begin, std::min(posts.rows.end + 1, f.rows)}};
}

/// What the codes of the cells `own`, part of `given`, say of the layer.
void StoreWriter::add_codes(const std::int32_t* codes, const Window& given, const Window& own, Done& done,
                            CodeCounts& unknown) const {
    const std::int64_t width = given.columns.size();
    for (std::int64_t y = own.rows.begin; y < own.rows.end; ++y)
        for (std::int64_t x = own.columns.begin; x < own.columns.end; ++x) {
            const std::int32_t code = codes[(y - given.rows.begin) * width + x - given.columns.begin];
            if (code == void_code) {
                ++done.values.voids;
                continue;
            }
            done.values.lowest = std::min(done.values.lowest, static_cast<float>(code));
            done.values.highest = std::max(done.values.highest, static_cast<float>(code));
            if (params_.legend && !params_.legend->find(code)) unknown.add(code, 1);
        }
}

void StoreWriter::add_unknown(const CodeCounts& codes) {
    if (codes.empty()) return;
    const std::lock_guard lock(mutex_);
    unknown_codes_.add(codes);
}

/// The same of heights.
void StoreWriter::add_heights(const Layer& layer, const float* heights, const Window& given, const Window& own,
                              Done& done) const {
    const PostExtremes found = post_extremes(heights, given, own);
    done.values.voids += found.voids;
    done.values.lowest = std::min(done.values.lowest, found.lowest_m);
    done.values.highest = std::max(done.values.highest, found.highest_m);
    if (layer.kind != StoreLayerKind::culture_height) return;
    const double scale = params_.culture_height_scale;
    const float most = highest_culture(scale);
    if (!(found.lowest_m < 0) && !(found.highest_m > most)) return;
    for (std::int64_t row = own.rows.begin; row < own.rows.end; ++row)
        for (std::int64_t column = own.columns.begin; column < own.columns.end; ++column)
            if (const float z = heights[given.at(column, row)]; z < 0 || z > most)
                refuse_culture(layer.facts(), column, row, z, scale);
}

/// A sheet on its way: a band of tiles after the other, from the top.
class StoreWriter::Sheet {
public:
    Sheet(StoreWriter& store, const Job& job, std::vector<std::size_t> pieces)
        : store_(store), job_(job), layer_(*job.layer), pieces_(std::move(pieces)), done_(store.done_of(job)),
          posts_(layer_.entry.posts(job.column, job.row)), path_(store.inside(done_.sheet.file)),
          pages_posts_(block_pages_of(posts_)),
          writer_(layer_.entry.facts, layer_.codes(), posts_, temporary(), layer_.creation) {
        if (!is_dem()) return;
        pages_.assign(static_cast<std::size_t>(pages_posts_.posts()), BlockPage(page_blocks * page_blocks));
        detail_.resize(detail_page_blocks * detail_page_blocks);
    }

    const Window& posts() const { return posts_; }
    void add_band(Interval rows, Mosaic::Posts& posts);
    void finish();

private:
    bool is_dem() const { return layer_.kind == StoreLayerKind::dem; }
    std::string temporary() const { return path_ + ".tmp"; }
    BlockBounds& bounds(std::vector<BlockPage>& pages, std::int64_t column, std::int64_t row) const {
        const std::int64_t pc = column / page_blocks - pages_posts_.columns.begin,
                           pr = row / page_blocks - pages_posts_.rows.begin;
        return pages[static_cast<std::size_t>(pr * pages_posts_.columns.size() + pc)]
                    [static_cast<std::size_t>(row % page_blocks * page_blocks + column % page_blocks)];
    }
    void bound(const Window& unit, const Mosaic::Posts& posts, const Window& given, std::vector<BlockPage>& pages);
    void close_circle(const Window& unit, const Window& given);

    StoreWriter& store_;
    const Job job_;
    Layer& layer_;
    const std::vector<std::size_t> pieces_;
    Done done_;
    CodeCounts unknown_codes_;  ///< that the legend does not know
    const Window posts_;
    const std::string path_;
    const Window pages_posts_;  ///< pages of the block map, in pages
    SheetWriter writer_;
    std::vector<BlockPage> pages_;
    DetailPage detail_;
};

void StoreWriter::Sheet::add_band(Interval rows, Mosaic::Posts& posts) {
    const RasterFacts& facts = layer_.entry.facts;
    const Mosaic::Kind kind = layer_.codes() ? Mosaic::Kind::codes : Mosaic::Kind::heights;
    const std::int64_t tile = store_.params_.tile_posts,
                       across = std::max<std::int64_t>(1, unit_posts / (tile * rows.size())) * tile;
    for (std::int64_t c = posts_.columns.begin; c < posts_.columns.end; c += across) {
        if (store_.params_.stop) store_.params_.stop->check();
        const Window unit{{c, std::min(c + across, posts_.columns.end)}, rows};
        const Window given = is_dem() ? store_.with_next(unit) : unit;
        posts.disagreement = {};
        layer_.read(given, unit, kind, pieces_, posts);
        done_.disagreement.add(posts.disagreement);
        const std::int64_t width = given.columns.size();
        const Window own{intersection(unit.columns, {0, facts.own_columns()}), unit.rows};
        if (layer_.codes())
            store_.add_codes(posts.codes.data(), given, own, done_, unknown_codes_);
        else if (!own.columns.empty())
            store_.add_heights(layer_, posts.heights.data(), given, own, done_);
        for (std::int64_t y = unit.rows.begin; y < unit.rows.end; y += tile)
            for (std::int64_t x = unit.columns.begin; x < unit.columns.end; x += tile)
                writer_.write(
                    (x - posts_.columns.begin) / tile, (y - posts_.rows.begin) / tile,
                    posts.stored.data() + ((y - given.rows.begin) * width + x - given.columns.begin) * facts.type_bytes,
                    width);
        if (!is_dem()) continue;
        bound(unit, posts, given, pages_);
        find_residuals(unit, given, posts.heights.data(), posts_, detail_);
        if (facts.cycle_columns() == facts.columns && unit.columns.end == facts.columns) close_circle(unit, given);
    }
}

/// The post after the last column is column 0: it widens the bounds of the last blocks.
void StoreWriter::Sheet::close_circle(const Window& unit, const Window& given) {
    const std::int64_t columns = layer_.entry.facts.columns;
    const Window first{{0, 1}, given.rows}, as_if{{columns, columns + 1}, given.rows};
    Mosaic::Posts edge;
    layer_.read(first, {}, Mosaic::Kind::heights, layer_.pieces_in(first), edge);
    const Window last_blocks{{(columns - 1) / block_posts * block_posts, columns}, unit.rows};
    std::vector<BlockPage> edge_pages(pages_.size(), BlockPage(page_blocks * page_blocks));
    bound(last_blocks, edge, as_if, edge_pages);
    const Window blocks = blocks_of(last_blocks);
    for (std::int64_t b = blocks.rows.begin; b < blocks.rows.end; ++b)
        bounds(pages_, blocks.columns.begin, b).add(bounds(edge_pages, blocks.columns.begin, b));
}

void StoreWriter::Sheet::bound(const Window& unit, const Mosaic::Posts& posts, const Window& given,
                               std::vector<BlockPage>& pages) {
    std::vector<float> culture, scratch;
    const ChunkRequest everything;
    const NeededPosts all(everything);
    RegisteredLayer* const height = store_.height_.get();
    if (height) {
        culture.resize(static_cast<std::size_t>(given.posts()));
        height->read_heights(height->plan(given.columns), given.rows, 1, all, culture.data(), scratch);
    }
    bound_blocks(unit, given, posts.heights.data(), height ? culture.data() : nullptr,
                 [&](std::int64_t c, std::int64_t r) -> BlockBounds& { return bounds(pages, c, r); });
}

void StoreWriter::Sheet::finish() {
    SheetSums sums = writer_.finish();
    sums.values = done_.values;
    sums.disagreement = done_.disagreement;
    sums.codes = std::move(unknown_codes_);
    if (is_dem()) {
        std::size_t i = 0;
        for (std::int64_t r = pages_posts_.rows.begin; r < pages_posts_.rows.end; ++r)
            for (std::int64_t c = pages_posts_.columns.begin; c < pages_posts_.columns.end; ++c)
                store_.map_->write(0, c, r, pages_[i++]);
        store_.detail_->write(job_.column, job_.row, detail_);
        store_.map_->sync();
        store_.detail_->sync();
    }
    rename_path(temporary(), path_);
    const std::string content = sums_text(sums);
    replace_file(store_.inside(done_.sheet.sums), content);
    done_.sheet.bytes = sums.file_bytes;
    done_.sheet.sums_checksum = checksum(content);
    done_.made = true;
    store_.add_unknown(sums.codes);
    store_.done_of(job_) = std::move(done_);
}

Done& StoreWriter::done_of(const Job& job) {
    std::size_t index = 0;
    while (layers_[index].get() != job.layer) ++index;
    return done_[index][job.place];
}

void StoreWriter::add_progress(std::int64_t posts) {
    const std::lock_guard lock(mutex_);
    posts_done_ += static_cast<std::uint64_t>(posts);
    if (params_.progress) params_.progress(static_cast<double>(posts_done_) / static_cast<double>(posts_));
}

/// Sheets of a row side by side, all of one layer.
void StoreWriter::make(const std::vector<Job>& row) {
    if (params_.stop) params_.stop->check();
    std::vector<std::unique_ptr<Sheet>> sheets;
    for (const Job& job : row) {
        Layer& layer = *job.layer;
        Done& done = done_of(job);
        done.sheet.column = job.column;
        done.sheet.row = job.row;
        const std::string stem = text(name(layer.kind), "/c", job.column, "_r", job.row);
        done.sheet.file = stem + ".tif";
        done.sheet.sums = stem + ".sum";
        const Window posts = layer.entry.posts(job.column, job.row);
        if (params_.stop) params_.stop->check();  // what stands is read through
        if (!finished_before(job, done)) {
            const bool dem = layer.kind == StoreLayerKind::dem;
            std::vector<std::size_t> pieces = layer.pieces_in(dem ? with_next(posts) : posts);
            if (!pieces.empty()) {
                sheets.push_back(std::make_unique<Sheet>(*this, job, std::move(pieces)));
                continue;
            }
            // Nothing but voids: the sheet is left out.
            const std::int64_t own = intersection(posts.columns, {0, layer.entry.facts.own_columns()}).size();
            done.values.voids = static_cast<std::uint64_t>(own * posts.rows.size());
            const Window pages = block_pages_of(posts);
            for (std::int64_t r = pages.rows.begin; dem && r < pages.rows.end; ++r)
                for (std::int64_t c = pages.columns.begin; c < pages.columns.end; ++c)
                    map_->write(0, c, r, BlockPage(page_blocks * page_blocks));
            if (dem) detail_->write(job.column, job.row, DetailPage(detail_page_blocks * detail_page_blocks));
        }
        add_progress(posts.posts());
    }
    if (sheets.empty()) return;
    const std::int64_t band = band_rows();
    const Interval rows = sheets.front()->posts().rows;
    Mosaic::Posts posts;
    for (std::int64_t r = rows.begin; r < rows.end; r += band)
        for (const auto& sheet : sheets) {
            const Interval some{r, std::min(r + band, rows.end)};
            sheet->add_band(some, posts);
            add_progress(sheet->posts().columns.size() * some.size());
        }
    for (const auto& sheet : sheets) sheet->finish();
}

void StoreWriter::make_sheets() {
    std::vector<std::vector<Job>> rows;
    for (const auto& layer : layers_) {
        const StoreLayerEntry& entry = layer->entry;
        const std::int64_t together = sheets_together(*layer);
        std::size_t place = 0;
        for (std::int64_t r = 0; r < entry.sheet_rows(); ++r)
            for (std::int64_t c = 0; c < entry.sheet_columns(); ++c) {
                if (c % together == 0) rows.emplace_back();
                rows.back().push_back({layer.get(), c, r, place++});
            }
        done_.emplace_back(place);
    }
    Threads threads(jobs_at_once());
    threads.execute([&] { tbb::parallel_for_each(rows.begin(), rows.end(), [&](const auto& row) { make(row); }); });
}

void StoreWriter::finish() {
    map_->finish();
    manifest_.software = params_.software;
    manifest_.legend_name = params_.legend_name;
    manifest_.legend_csv = params_.legend_csv;
    manifest_.block_map = store_map_name;
    manifest_.block_map_checksum = file_checksum(inside(store_map_name));
    manifest_.detail_map = store_detail_name;
    manifest_.detail_map_checksum = file_checksum(inside(store_detail_name));
    manifest_.plan = store_plan_name;
    manifest_.plan_checksum = file_checksum(inside(store_plan_name));
    for (std::size_t i = 0; i < layers_.size(); ++i) {
        StoreLayerEntry& entry = layers_[i]->entry;
        for (const Done& done : done_[i]) {
            entry.values.add(done.values);
            if (done.made) entry.sheets.push_back(done.sheet);
        }
        const double scale = entry.kind == StoreLayerKind::culture_height ? params_.culture_height_scale : 1;
        if (scale != 1) manifest_.height_scale = scale;
        const std::string vrt = vrt_text(entry, scale);
        replace_file(inside(entry.vrt), vrt);
        entry.vrt_checksum = checksum(vrt);
        // A raster that changed meanwhile is in the store partly old, partly new.
        const std::vector<std::uint64_t> now = layers_[i]->fingerprints();
        for (std::size_t k = 0; k < now.size(); ++k)
            if (now[k] != layers_[i]->before[k])
                throw DataError(text(entry.facts.role, " '", entry.sources[k].path, "' changed while it was read"));
        manifest_.layers.push_back(entry);
        sync_directory(inside(name(layers_[i]->kind)));
    }
    const auto part = [&](const char* name) { return whole_file(inside(name), PlainFile::Use::read); };
    manifest_.block_map_imprint = BlockMapFile(part(store_map_name), manifest_.map_shape(), 1).imprint();
    manifest_.detail_map_imprint = DetailMapFile(part(store_detail_name), manifest_.detail_shape(), nullptr).imprint();
    manifest_.class_table = !params_.class_table.empty();
    if (manifest_.class_table) replace_file(inside(store_classes_name), params_.class_table);
    replace_file(inside(manifest_name), manifest_text(manifest_));
    sync_directory(folder_.folder());
}

TileStoreSummary StoreWriter::summary() const {
    TileStoreSummary out;
    out.note = layers_[0]->input->note();
    Disagreement all;
    for (std::size_t i = 0; i < layers_.size(); ++i) {
        const RasterFacts& f = layers_[i]->entry.facts;
        TileStoreSummary::Layer layer{name(layers_[i]->kind), type_name(f.type), f.columns, f.rows};
        for (const Done& done : done_[i]) {
            layer.sheets += done.made;
            layer.reused += done.reused;
            layer.bytes += done.sheet.bytes;
            layer.lowest = std::min(layer.lowest, done.values.lowest);
            all.add(done.disagreement);
        }
        out.layers.push_back(layer);
    }
    out.unknown_codes = unknown_codes_;
    const bool all_made =
        std::none_of(out.layers.begin(), out.layers.end(), [](const auto& l) { return l.reused > 0; });
    out.features_lie_elsewhere = features_ && all_made && !features_->burnt();
    if (features_) out.feature_fields_left_out = features_->left_out();
    out.disagreements = all.posts;
    out.interpolated = all.interpolated;
    out.largest_m = all.largest_m;
    if (all.posts > 0)
        out.largest_where = text("between '", layers_[0]->input->path(static_cast<std::size_t>(all.kept_file)),
                                 "' (kept) and '", layers_[0]->input->path(static_cast<std::size_t>(all.other_file)),
                                 "' at column ", all.column, ", row ", all.row);
    return out;
}

TileStoreSummary StoreWriter::run() {
    folder_.check(params_.overwrite, params_.resume);
    open_layers();
    widen_cache();  // too small a memory is refused before any work
    struct GivenCache {
        std::size_t bytes;
        ~GivenCache() { GdalSession::set_cache_bytes(bytes); }
    } const given{params_.cache_bytes};
    const auto close = [&](bool keep_sheets) {
        map_.reset();
        detail_.reset();
        return folder_.close(keep_sheets);
    };
    const std::string kept = text("; finished sheets are kept in '", folder_.folder(), "' (--resume goes on)");
    bool finished = false;
    try {
        folder_.open(plan(), params_.resume);
        for (const auto& layer : layers_) folder_.make_folder(name(layer->kind));
        map_ = std::make_unique<BlockMapWriter>(
            whole_file(inside(store_map_name), PlainFile::Use::write),
            BlockMapShape{layers_[0]->entry.facts.columns, layers_[0]->entry.facts.rows});
        detail_ = std::make_unique<DetailMapWriter>(
            whole_file(inside(store_detail_name), PlainFile::Use::write),
            DetailMapShape{layers_[0]->entry.facts.columns, layers_[0]->entry.facts.rows});
        make_sheets();
        finish();
        finished = true;
        folder_.move_into_place(params_.overwrite);
    } catch (const Interrupted& e) {
        if (close(true)) throw Interrupted(e.signal(), kept);
        throw;
    } catch (const InputError& e) {  // what stands at the output by then is no reason to make all of it again
        if (close(finished)) throw InputError(text(e.what(), kept));
        throw;
    } catch (const IoError& e) {
        if (close(true)) throw IoError(text(e.what(), kept));
        throw;
    } catch (const std::bad_alloc&) {
        if (close(true)) throw IoError("out of memory" + kept);
        throw;
    } catch (...) {
        close(false);
        throw;
    }
    return summary();
}

}  // namespace

void check_store_output(const std::string& output, bool overwrite, bool resume) {
    UnfinishedStore(output).check(overwrite, resume);
}

TileStoreSummary write_tile_store(const TileStoreParams& params) { return StoreWriter(params).run(); }

}  // namespace wedgescope
