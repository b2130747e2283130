// Picture files: the scope as PNG, GeoTIFF or another GDAL raster driver, with georeference where it is a map
// (north-up gpi and gpi-true without rings and azimuth marks: azimuthal equidistant round the sensor) and a geolocation array
// where it is not; with alpha a second channel, transparent where the data base has no data. Leaves text (legends) to the
// helper program.
#pragma once
#include "lib/engine.hpp"
#include "tiles/output_file.hpp"
#include "tiles/polar_raster.hpp"

namespace wedgescope {

void write_scope(const RunResult& run, OutputFile& file, const RasterFormat& format);

}  // namespace wedgescope
