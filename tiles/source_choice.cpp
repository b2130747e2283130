#include "tiles/source_choice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "lib/error.hpp"
#include "tiles/cache_need.hpp"
#include "tiles/file_stamp.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/tiff_layer.hpp"
#include "tiles/tile_store.hpp"

namespace wedgescope {
namespace {

/// How a raster is cut, and how many posts its windows would decode for each one asked for.
struct Cut {
    std::int64_t columns = 0, rows = 0;
    std::string compression;
    double decoded = 1;
};
Cut cut_of(const RasterLayer& raster) {
    const RasterFacts& f = raster.facts();
    Cut cut{f.block_columns, f.block_rows, f.compression, raster.decoded_a_post()};
    if (f.driver != "VRT") return cut;
    // The first raster it is made of tells more than the blocks it shows.
    GdalErrors quiet;
    const DatasetHandle vrt = open_dataset(f.path);
    if (!vrt) return cut;
    find_file_behind(*vrt, [&](const std::string& file) {
        const DatasetHandle part = open_dataset(file);
        if (!part || part->GetRasterCount() < 1 || EQUAL(part->GetDriver()->GetDescription(), "VRT")) return false;
        int columns = 0, rows = 0;
        part->GetRasterBand(1)->GetBlockSize(&columns, &rows);
        cut.columns = columns;
        cut.rows = rows;
        if (const char* c = part->GetMetadataItem("COMPRESSION", "IMAGE_STRUCTURE")) cut.compression = c;
        cut.decoded = raster.decoded_a_post(columns, rows);
        return true;
    });
    return cut;
}

/// By the rasters, and how far the scene looks where it says so.
SourceChoice choose_by_shape(const DataBaseParams& params, SourceKind asked, std::optional<double> range_m,
                             std::size_t memory_bytes) {
    const bool store = is_tile_store(params.dem);
    const auto tiles = std::make_shared<TileCache>(tile_cache_share(params.cache_bytes));
    std::vector<std::unique_ptr<RasterLayer>> opened;
    const auto open = [&](const char* role, const std::string& path) {
        if (!path.empty()) opened.push_back(open_raster(role, path, tiles));
    };
    if (!store) open("dem", params.dem);
    open("culture", params.culture);
    open("culture-height", params.culture_height);
    if (opened.empty()) return {asked == SourceKind::spilled, false, store ? "a tile store" : "no raster", ""};
    Cut worst;
    ReaderBytes reader;
    std::vector<const RasterLayer*> layers;
    for (const auto& layer : opened) {
        layers.push_back(layer.get());
        const ReaderBytes own = layer->reader_bytes();
        reader = {std::max(reader.decoded, own.decoded), reader.packed + own.packed};
        Cut cut = cut_of(*layer);
        if (worst.columns == 0 || cut.decoded > worst.decoded) worst = std::move(cut);
    }
    const std::string shape = text(worst.columns == 1 ? "columns"
                                   : worst.rows <= 16 ? "rows"
                                                      : "tiles",
                                   " of ", worst.columns, " x ", worst.rows,
                                   worst.compression.empty() ? std::string() : ", " + worst.compression);
    if (asked == SourceKind::direct_for_memory) return {false, false, shape + "; sorted it would take more memory", ""};
    if (asked != SourceKind::automatic) return {asked == SourceKind::spilled, false, "as asked for; " + shape, ""};
    const CacheNeed need = cache_need(layers, params);
    if (need.fits) {
        const auto mib = static_cast<std::uint64_t>(std::ceil(need.bytes / 1048576));
        return {false, false, mib == 0 ? shape : text(shape, "; all ", mib, " MiB fit into the cache"), ""};
    }
    const bool whole = std::any_of(layers.begin(), layers.end(),
                                   [](const RasterLayer* layer) { return layer->facts().packed_as_a_whole(); });
    if (whole) return {true, false, text(shape, "; each is decoded behind all above it"), ""};
    const bool lines =
        std::any_of(layers.begin(), layers.end(), [](const RasterLayer* layer) { return layer->facts().is_text(); });
    if (lines) return {true, false, text(shape, "; lines of text are read once"), ""};
    // Beside images and chunks there must be room for a block, every time that something is read.
    constexpr double most_decoded = RasterLayer::most_decoded_a_post;
    if (worst.decoded <= most_decoded && reader.decoded + reader.packed > memory_bytes / 4)
        return {
            true, false,
            text(shape, "; to read one takes ", (reader.decoded + reader.packed) >> 20, " MiB of ", memory_bytes >> 20),
            ""};
    if (double bytes = 0; unpacks_again(layers, params, range_m, bytes))
        return {true, false,
                text(shape, "; those round the sensor take ", static_cast<std::uint64_t>(bytes) >> 20,
                     " MiB, and would be unpacked for each strip anew"),
                "", true};
    if (worst.decoded <= most_decoded) return {false, false, shape, ""};
    return {
        true, false,
        text(shape, "; a window would decode ", fmt::format("{:.0f}", worst.decoded), " times the posts it asks for"),
        ""};
}

}  // namespace

SourceChoice choose_source(const DataBaseParams& params, SourceKind asked, const Scene& scene,
                           std::size_t memory_bytes) {
    SourceChoice choice = choose_by_shape(params, asked, scene.range_m, memory_bytes);
    std::error_code ignored;
    if (asked == SourceKind::direct || asked == SourceKind::direct_for_memory || !is_tile_store(params.dem) ||
        !std::filesystem::exists(kept_path(params.dem), ignored))
        return choice;
    try {
        SpillOptions options;
        options.memory_bytes = memory_bytes;
        open_kept_spill(params, scene, params.dem, options);
        return {true, true, text("a tile store; sorted for this point in '", kept_path(params.dem), "'"), ""};
    } catch (const UnfitSpill& e) {
        choice.unfit = e.what();
    } catch (const TooLittleMemory& e) {
        choice.unfit = e.what();
    }
    return choice;
}

std::unique_ptr<WedgeSource> open_source(const SourceChoice& choice, const DataBaseParams& params, const Scene& scene,
                                         const SpillOptions& options) {
    if (choice.kept) return open_kept_spill(params, scene, params.dem, options);
    return choice.spilled ? open_spilled_source(params, scene, options) : open_direct_source(params);
}

}  // namespace wedgescope
