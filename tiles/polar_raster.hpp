// Polar rasters: echo, power and states as GeoTIFF (or any GDAL driver): one row an azimuth bin, clockwise, one column
// a range bin, with the metadata of the design's contract and a geolocation array in `<file>.geoloc.tif`, so that
// `gdalwarp -geoloc` works. Leaves pictures to picture.hpp.
//
// Memory: the images are written as they lie in memory (power in dBm, and states beside an echo, are converted: one
// float a cell); the geolocation array takes at most 8 MiB.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "lib/engine.hpp"
#include "tiles/output_file.hpp"

namespace wedgescope {

using Metadata = std::vector<std::pair<std::string, std::string>>;

struct RasterFormat {
    std::string driver;                 ///< empty: from the file name's extension
    std::vector<std::string> creation;  ///< K=V
    bool reproducible = false;          ///< the same bytes every time
    std::string version;                ///< of the program, for metadata
    std::string scene_json;             ///< SCENE_JSON
    std::string crs_wkt;                ///< DataBase::crs_wkt, for grid geometry; empty: none
    double metres_per_unit = 1;         ///< DataBase::metres_per_unit
};

enum class OutputLayer { scope, masked_scope, echo, power, states };
/// InputError where a layer could not be written so: driver, extension, type of values, creation option, a picture in grey, with an
/// alpha channel if it is a masked scope, or codes (states) that a driver with loss would change.
void check_output(const OutputFile& file, OutputLayer layer, const RasterFormat& format);

/// What a power image would not keep in such a file, in words that go on from its name; empty: nothing. InputError where GDAL
/// refuses the creation options.
std::string power_losses(const OutputFile& file, const RasterFormat& format);

/// True where a file of that name would be one, whatever else may be wrong with it.
bool is_geotiff(const std::string& path, const RasterFormat& format);

/// How far the places of a geolocation array may be off for want of a geodesic each, in range bins or pixels.
inline constexpr double place_error = 0.01;

enum class PowerUnit { watt, dbm };
inline constexpr float no_dbm = -9999;  ///< stands for 0 W
/// Rounded to 0.001 dB.
float power_in_dbm(float watts);

/// At most 15 significant digits, as metadata have them.
std::string fifteen_digits(double value);
/// What a polar raster of these bins tells of itself and its scene.
Metadata polar_metadata(const ResolvedScene& scene, const PolarGrid& grid, const RasterFormat& format);

/// Band 1 echo (W), band 2 state (its codes), on scene.swept. Float32 both: a GeoTIFF has one type for all its bands.
void write_echo(const RunResult& run, OutputFile& file, const RasterFormat& format);
/// Float32 on scene.shown; watts (no no-data value) or dBm rounded to 0.001 dB, where 0 W is the declared no-data
/// value -9999.
void write_power(const RunResult& run, PowerUnit unit, OutputFile& file, const RasterFormat& format);
/// Byte with category names on scene.shown. 0 ("no data") is a state, not declared as GDAL's no-data.
void write_states(const RunResult& run, OutputFile& file, const RasterFormat& format);

}  // namespace wedgescope
