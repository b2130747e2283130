// PlainTiff: what the first directory of a GeoTIFF says of its raster, where GDAL would know no more. For the .cpp files of this
// folder only. Leaves the posts to tiff_layer.hpp, and every file that is in any doubt to raster_file.hpp.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "tiles/raster_layer.hpp"
#include "tiles/tiff_index.hpp"

namespace wedgescope {

struct PlainTiff {
    RasterFacts facts;
    TiffIndex::Level tiles;
    bool swapped = false;  ///< its numbers have the other order of bytes

    /// Nothing if `path` is anything but a TIFF that says what GDAL would say of it: one band of usual numbers in tiles or strips, packed as
    /// libtiff unpacks them; its corner and cells by one tie point and a scale; in WGS84, as degrees or UTM, by EPSG's code; without
    /// mask, scale or offset, with no unit or one of length; no file beside it that would tell GDAL more, no configuration of GDAL's, and nothing that
    /// libtiff complains of.
    static std::optional<PlainTiff> of(const std::string& role, const std::string& path);
    /// What GDAL told of a raster, and where libtiff finds its posts; nothing where they are not one band of usual numbers in tiles
    /// or strips of a file, without a mask, packed as libtiff unpacks them, or libtiff complains.
    static std::optional<PlainTiff> as_told(const RasterFacts& told);
    /// What such a raster is made of: itself, and overviews if they lie beside it.
    static std::vector<std::string> files(const std::string& path);
};

}  // namespace wedgescope
