// TiffIndex: where the tiles of a TIFF and of its overviews lie and how they are packed, as libtiff reads it: GDAL, which
// tells the same, takes longer to be loaded than many a run. For the .cpp files of this folder only. Leaves reading tiles to
// tile_decoder.hpp, and every file that is not as expected to GDAL.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

struct tiff;  // libtiff's TIFF

namespace wedgescope {

struct TiffIndex {
    struct Level {
        std::int64_t columns = 0, rows = 0;
        std::uint32_t tile_columns = 0, tile_rows = 0;
        bool strips = false;  ///< tiles as wide as the raster; the last has no rows below it
        std::uint16_t bands = 1, bits = 0;                ///< of a value
        std::uint16_t compression = 0, predictor = 1;     ///< COMPRESSION_*, PREDICTOR_*
        std::vector<std::uint64_t> offsets, byte_counts;  ///< of tiles, row after row
    };
    std::vector<Level> levels;  ///< the raster, then its overviews as the file holds them

    /// Nothing if libtiff cannot read the file, or a level of it is in strips.
    static std::optional<TiffIndex> of(const std::string& path);
    /// The tiles, or strips, of the directory at which a file is open; nothing if it says not where they are.
    static std::optional<Level> level_of(tiff* file);
};

}  // namespace wedgescope
