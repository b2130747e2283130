// TIFF file: one band of bytes as a GeoTIFF in tiles, packed by runs, written by libtiff tile by tile. To any
// reader it is what GDAL's driver would write; but GDAL is not asked, so that a program that only writes this need not load it.
// Leaves names, what the bytes mean, and every other CRS, type or packing to raster_writer.hpp.
//
// Memory: a packed tile, and two numbers a tile of the file for where it stands.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tiles/crs.hpp"

namespace wedgescope {

struct TiffContent {
    std::int64_t columns = 0, rows = 0;
    std::string description;  ///< of the band
    std::vector<std::pair<std::string, std::string>>
        metadata;                                       ///< no key twice, none that GDAL keeps elsewhere (TIFFTAG_...)
    std::optional<std::array<double, 6>> geotransform;  ///< in GDAL's order
    std::optional<GeoTiffCrs> crs;
};

class TiffFile {
public:
    static constexpr std::int64_t edge = 256;  ///< cells a side of a tile

    /// IoError, here and below, names the output as `final_path`.
    TiffFile(const std::string& path, TiffContent content, std::string final_path);
    ~TiffFile();
    TiffFile(const TiffFile&) = delete;
    TiffFile& operator=(const TiffFile&) = delete;

    /// Tiles stand in the file in the order they come, each once. `cells`: edge x edge, row after row; what lies beyond the
    /// raster's edges is kept as it comes, and nobody reads it.
    void write_tile(std::int64_t column, std::int64_t row, const std::uint8_t* cells);
    /// Tiles that did not come hold 0. Nothing more can be written.
    void close(std::optional<std::uint8_t> no_data);

private:
    struct Open;
    std::unique_ptr<Open> open_;
};

}  // namespace wedgescope
