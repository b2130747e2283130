// Raster: one GDAL raster, opened and checked: grid, CRS, no-data, scale and unit; and what it holds, counted.
// Leaves chunks to sources.hpp and output to picture.hpp and polar_raster.hpp.
#pragma once
#include <cstdint>
#include <optional>
#include <string>

#include "lib/stop.hpp"
#include "tiles/code_counts.hpp"

namespace wedgescope {

/// What a polar raster (echo, power, states) tells of its bins: rows in azimuth, columns in range.
struct PolarAxes {
    double azimuth_start_deg = 0, azimuth_step_deg = 0;  ///< of the first bin's near edge, from north
    double range_start_m = 0, range_step_m = 0;
    bool frames = false;     ///< each band is one, of a track
    std::string range_kind;  ///< slant, ground
};

/// What `info` says of a raster. Counting reads it once, block by block.
struct RasterSummary {
    std::string path, driver, data_type, crs_name, unit;
    std::optional<double> unit_m;  ///< metres of that unit; none: no unit of length that we know
    int bands = 1;                 ///< of which the first is told of
    std::int64_t columns = 0, rows = 0, block_columns = 0, block_rows = 0;
    double origin_x = 0, origin_y = 0, step_x = 0, step_y = 0;  ///< of the first cell's outer corner; CRS units
    bool geographic = false, has_crs = false, has_no_data = false;
    double no_data = 0;
    double west = 0, east = 0, south = 0,
           north = 0;  ///< WGS84 degrees, of the edge; only with a CRS. NaN: its edge has no place on earth
    std::string compression;
    std::uint64_t void_posts = 0;
    double lowest = 0, highest = 0, mean = 0;  ///< of valid posts, metres (scale, offset and unit applied)
    CodeCounts codes;                          ///< of valid cells; only when asked for (culture)
    std::optional<PolarAxes> polar;            ///< none: no polar raster
};

/// What summarise_raster holds of one at the most, beside GDAL's cache. IoError, DataError.
std::size_t summary_bytes(const std::string& path);

/// IoError / DataError naming the file and, for a bad value, the post (column, row); Interrupted, looked at every few
/// MiB.
RasterSummary summarise_raster(const std::string& path, bool count_codes, const Stop* stop = nullptr);

}  // namespace wedgescope
