// Value trial: does a driver give back the values of a raster as they are? For the .cpp files of this folder only.
// Leaves their place to place_trial.hpp.
#pragma once
#include <cpl_string.h>

#include <string>

#include "tiles/gdal_handle.hpp"
#include "tiles/raster_content.hpp"
#include "tiles/raster_format.hpp"

namespace wedgescope {

/// Of codes one that is a little off is another. True if the driver gives them back, or writes nothing in memory by its
/// own word; false if it made no file there, as some cannot. InputError where it changes them, or declares one as no data.
bool keeps_codes(GDALDriver& driver, const CPLStringList& options, const RasterFormat& format,
                 const RasterContent& wanted, const std::string& final_path);
/// `why`: goes on from the driver's name. InputError.
[[noreturn]] void refuse_codes(GDALDriver& driver, const RasterFormat& format, const std::string& final_path,
                               const char* why);

/// Values that are no codes. Counts must come back as they are, and none be declared as no data; floats nearly, as options that
/// round them may ask for: metres up to 2000 km within a tenth, degrees and dBm within 0.1 of them. InputError.
void check_values(GDALDriver& driver, const CPLStringList& options, const RasterFormat& format,
                  const RasterContent& wanted, const std::string& final_path);

}  // namespace wedgescope
