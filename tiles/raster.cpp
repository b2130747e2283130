#include "tiles/raster.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "lib/error.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/raster_file.hpp"

namespace wedgescope {
namespace {

constexpr std::int64_t most_posts = std::int64_t{1} << 20;  // a few MiB at a time

void find_bounds(const RasterFacts& facts, RasterSummary& summary) {
    const double x0 = std::min(facts.corner_x, facts.edge_x()), x1 = std::max(facts.corner_x, facts.edge_x());
    const double y0 = std::min(facts.corner_y, facts.edge_y()), y1 = std::max(facts.corner_y, facts.edge_y());
    if (facts.wgs84_lat_lon) {
        summary.west = x0;
        summary.east = x1;
        summary.south = y0;
        summary.north = y1;
        return;
    }
    GdalErrors errors;
    const OGRSpatialReference own = in_gdal(*facts.crs), wgs84 = in_gdal(Crs::wgs84());
    const std::unique_ptr<OGRCoordinateTransformation> to_wgs84(OGRCreateCoordinateTransformation(&own, &wgs84));
    if (!to_wgs84)
        throw DataError(
            text(facts.named(), ": PROJ cannot turn its CRS into latitude and longitude: ", errors.reason()));
    if (!to_wgs84->TransformBounds(x0, y0, x1, y1, &summary.west, &summary.south, &summary.east, &summary.north, 21))
        summary.west = summary.east = summary.south = summary.north = std::numeric_limits<double>::quiet_NaN();
}

std::optional<PolarAxes> polar_axes(const std::string& path) {
    GdalErrors quiet;
    const DatasetHandle file = open_dataset(path);
    if (!file) return std::nullopt;
    PolarAxes axes;
    // In a stack each frame looks its own way.
    const auto item_of = [&](const char* name) {
        const char* const words = file->GetMetadataItem(name);
        return words || file->GetRasterCount() == 0 ? words : file->GetRasterBand(1)->GetMetadataItem(name);
    };
    for (const auto& [item, number] : {std::pair{"AZIMUTH_START_DEG", &axes.azimuth_start_deg},
                                       {"AZIMUTH_STEP_DEG", &axes.azimuth_step_deg},
                                       {"RANGE_START_M", &axes.range_start_m},
                                       {"RANGE_STEP_M", &axes.range_step_m}}) {
        const char* const words = item_of(item);
        if (!words) return std::nullopt;
        *number = CPLAtof(words);
    }
    axes.frames = item_of("FRAME") != nullptr;
    if (const char* kind = file->GetMetadataItem("RANGE_KIND")) axes.range_kind = kind;
    return axes;
}

}  // namespace

std::size_t summary_bytes(const std::string& path) {
    const ReaderBytes reader = RasterFile("raster", path).reader_bytes();
    // A window's values, and its mask.
    constexpr std::size_t window = static_cast<std::size_t>(most_posts) * (sizeof(double) + sizeof(float) + 1);
    return reader.decoded + reader.packed + window;
}

RasterSummary summarise_raster(const std::string& path, bool count_codes, const Stop* stop) {
    RasterFile file("raster", path);
    const RasterFacts& facts = file.facts();
    RasterSummary summary;
    summary.path = path;
    summary.driver = facts.driver;
    summary.bands = facts.bands;
    summary.data_type = facts.signed_byte ? "Int8" : type_name(facts.type);
    summary.unit = facts.unit;
    summary.unit_m = unit_in_metres(facts.unit);
    summary.columns = facts.columns;
    summary.rows = facts.rows;
    summary.block_columns = facts.block_columns;
    summary.block_rows = facts.block_rows;
    summary.origin_x = facts.corner_x;
    summary.origin_y = facts.corner_y;
    summary.step_x = facts.step_x;
    summary.step_y = facts.step_y;
    summary.geographic = facts.geographic;
    summary.has_crs = facts.crs != nullptr;
    summary.has_no_data = facts.has_no_data;
    summary.no_data = facts.no_data;
    summary.compression = facts.compression;
    summary.polar = polar_axes(path);
    if (facts.crs) {
        summary.crs_name = facts.crs->titled();
        find_bounds(facts, summary);
    }

    double lowest = std::numeric_limits<double>::infinity(), highest = -lowest, sum = 0;
    std::uint64_t valid = 0;
    const auto count = [&](double value) {
        lowest = std::min(lowest, value);
        highest = std::max(highest, value);
        sum += value;
        ++valid;
    };
    std::vector<float> heights;
    std::vector<std::int32_t> codes;
    for_each_window(facts, facts.columns, most_posts, [&](const Window& window) {
        if (stop) stop->check();
        const auto posts = static_cast<std::size_t>(window.posts());
        const std::uint64_t before = valid;
        if (count_codes) {
            codes.resize(posts);
            file.read_codes(window, codes.data());
            for (std::size_t i = 0; i < posts;) {  // runs: neighbours are mostly alike
                std::size_t end = i + 1;
                while (end < posts && codes[end] == codes[i]) ++end;
                if (codes[i] != void_code) {
                    summary.codes.add(codes[i], end - i);
                    for (std::size_t k = i; k < end; ++k) count(codes[i]);
                }
                i = end;
            }
        } else {
            heights.resize(posts);
            file.read_heights(window, heights.data(), window.columns.size());
            for (float z : heights)
                if (!std::isnan(z)) count(static_cast<double>(z));
        }
        summary.void_posts += posts - (valid - before);
    });
    if (valid > 0) {
        summary.lowest = lowest;
        summary.highest = highest;
        summary.mean = sum / static_cast<double>(valid);
    }
    return summary;
}

}  // namespace wedgescope
