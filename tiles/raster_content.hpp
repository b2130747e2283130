// Raster content: arrays in memory, and all that a raster file tells of them. For the .cpp files of this folder only.
// Leaves what the arrays mean to polar_raster.cpp, picture.cpp and coverage_raster.cpp, and files to raster_writer.hpp.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tiles/gdal_handle.hpp"
#include "tiles/geolocation_array.hpp"
#include "tiles/raster_metadata.hpp"

namespace wedgescope {

struct BandContent {
    const void* cells = nullptr;  ///< rows x columns, row after row
    std::string description, unit;
    std::optional<double> no_data;
    std::vector<std::string> categories;
    bool alpha = false;  ///< 0 transparent, 255 opaque
};

struct RasterContent {
    std::int64_t columns = 0, rows = 0;
    GDALDataType type = GDT_Float32;
    /// Codes and counts that stay the same over many posts. Bytes, as a mask's, are packed by runs, which every reader of TIFF
    /// knows and which takes a tenth of DEFLATE's time; others by DEFLATE at its fastest.
    bool patches = false;
    /// Floats without the prediction of neighbours, which takes as long to undo as all other unpacking: for what is read again and
    /// again and mostly empty, so that it hardly takes more room.
    bool quick_to_read = false;
    std::vector<std::uint8_t> codes;  ///< all values of a band of codes, which nothing may change; else empty
    /// Is it a value of the bands that says something, and so may not be declared as no data, as some drivers do by themselves?
    std::function<bool(double value)> means_something;  ///< none: floats, which drivers leave alone
    double means_nothing = 0;                           ///< one that does not; with means_something
    std::vector<BandContent> bands;
    Metadata metadata;
    std::optional<std::array<double, 6>> geotransform;
    std::string crs;  ///< anything GDAL understands; empty: none
    std::optional<GeolocationGrid> geolocation;
    int threads = 1;  ///< that may pack it
};

/// That a band holds the codes of states.
void set_states(RasterContent& content);

}  // namespace wedgescope
