// Polar rasters: echo, power and states as GeoTIFF (or any GDAL driver): one row an azimuth bin, clockwise, one column
// a range bin, with the metadata of the design's contract and a geolocation array in `<file>.geoloc.tif`, so that
// `gdalwarp -geoloc` works. Leaves pictures to picture.hpp.
//
// Memory: the images are written as they lie in memory (power in dBm, and states beside an echo, are converted: one
// float a cell); the geolocation array takes at most 8 MiB.
#pragma once
#include "lib/engine.hpp"
#include "tiles/output_file.hpp"
#include "tiles/raster_format.hpp"
#include "tiles/raster_metadata.hpp"

namespace wedgescope {

/// How far the places of a geolocation array may be off for want of a geodesic each, in range bins or pixels.
inline constexpr double place_error = 0.01;

enum class PowerUnit { watt, dbm };
inline constexpr float no_dbm = -9999;  ///< stands for 0 W
/// Rounded to 0.001 dB.
float power_in_dbm(float watts);

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
