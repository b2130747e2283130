// Raster writer: arrays in memory -> one raster file of any GDAL driver, with a geolocation array beside it if asked.
// For the .cpp files of this folder only. Leaves what is written to raster_content.hpp, and which driver does it, and how, to
// raster_driver.hpp.
#pragma once
#include <string>

#include "tiles/gdal_handle.hpp"
#include "tiles/output_file.hpp"
#include "tiles/raster_content.hpp"
#include "tiles/raster_format.hpp"

namespace wedgescope {

/// To file.temporary_path() and its side files; the caller commits. InputError for a driver, extension or creation
/// option that will not do; IoError naming the final file if anything was not written.
void write_raster(const RasterContent& content, const OutputFile& file, const RasterFormat& format);

/// The same, but empty, to be written piece by piece; closed by close_raster. `cells` of the bands are not used; neither is
/// a geolocation grid. InputError too for a driver that writes whole rasters only.
DatasetHandle create_raster(const RasterContent& content, const OutputFile& file, const RasterFormat& format);
/// IoError naming the final file if anything was not written.
void close_raster(DatasetHandle dataset, const std::string& final_path);

}  // namespace wedgescope
