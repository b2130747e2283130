// Raster driver: which of GDAL's drivers writes an output, and with which creation options. For the .cpp files of this folder only.
// Leaves what a driver makes of a raster to driver_trial.hpp.
#pragma once
#include <cpl_string.h>

#include <string>

#include "tiles/gdal_handle.hpp"
#include "tiles/raster_format.hpp"

namespace wedgescope {

/// Is it a GeoTIFF with no creation options, of which it is known what it keeps?
bool is_usual_geotiff(const std::string& path, const RasterFormat& format);
/// Of such a file ("PNG", "GTiff") is nothing asked that GDAL's own driver would have to do?
bool needs_no_driver(const char* driver, const std::string& final_path, const RasterFormat& format);

/// By what is said or by the ending. InputError where no driver writes such rasters, or not with values of that type.
GDALDriver& driver_for(const std::string& path, GDALDataType type, const RasterFormat& format);
/// GDAL_DCAP_CREATE and the like.
bool has_capability(GDALDriver& driver, const char* capability);

/// Does a GeoTIFF with that ENDIANNESS hold bytes in another order than this machine's? GDAL 3.6 writes floats with PREDICTOR=3 so and
/// reads something else.
bool swaps_bytes(const std::string& endianness);
/// InputError for that predictor, where the user gave it.
[[noreturn]] void refuse_predictor(const std::string& endianness);

struct RasterPacking {
    bool patches = false, quick_to_read = false;  ///< as of a RasterContent
};
/// Ours, and the user's, which go before them. InputError for one that is none, or that GDAL's own list for the driver refuses.
CPLStringList creation_options(GDALDriver& driver, GDALDataType type, RasterPacking packing,
                               const RasterFormat& format);

}  // namespace wedgescope
