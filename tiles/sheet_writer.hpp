// SheetWriter: one sheet of a store layer: a tiled GeoTIFF with its overviews, and the checksums of both.
// For the .cpp files of this folder only. Leaves where the posts come from to store_writer.cpp.
//
// Overviews: a post for each 2 x 2 posts of the one before that begin at an even column and row (of the sheet), so aligned
// to the raster. Heights: the post at that even column and row itself, a void if it is one, so that an overview holds heights
// of the ground and no means. Codes: the most frequent of the four, the first in the raster's order of several; void only
// where all are.
// Memory: a quarter of the sheet's posts and two tiles (sheet_writer_bytes()).
#pragma once
#include <cstddef>
#include <string>
#include <vector>

#include "tiles/gdal_handle.hpp"
#include "tiles/store_manifest.hpp"

namespace wedgescope {

class SheetWriter {
public:
    /// `facts`: of the layer, block_columns its tiles. `creation`: options K=V. IoError, InputError (a bad option).
    SheetWriter(const RasterFacts& facts, bool codes, const Window& posts, std::string path,
                const std::vector<std::string>& creation);
    ~SheetWriter();

    /// Values of the tile at `column`, `row` (of tiles of the sheet), rows `stride` values apart.
    void write(std::int64_t column, std::int64_t row, const std::byte* values, std::int64_t stride);
    /// Overviews, close, and all tiles read back and compared. The file is on disk then.
    SheetSums finish();

private:
    void write_tile(int level, std::int64_t column, std::int64_t row, const std::byte* values, std::int64_t stride);

    RasterFacts facts_;
    bool codes_;
    Window posts_;
    std::string path_;
    SheetSums sums_;
    DatasetHandle dataset_;
    std::vector<std::byte> half_, tile_;
};

/// What a writer holds.
std::size_t sheet_writer_bytes(const RasterFacts& facts);

}  // namespace wedgescope
