// TileDecoder: values of a sheet's tiles, decoded here where they are packed as the store packs them by default (ZSTD or
// nothing; no predictor, horizontal or floating point): libtiff takes two to three times as long. Offers what it found:
// of a store whether that is what was stored only the checksum tells, so a layout that it takes wrongly costs time, never a bit;
// of other files who opened them must know their layout (plain_tiff.hpp).
// For the .cpp files of this folder only. Leaves every other layout, and naming damage, to GDAL (store_layer.hpp).
//
// Memory: for each reading thread one tile as the file holds it, and 160 KB of the decoder's.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "lib/raw_vector.hpp"
#include "tiles/plain_file.hpp"
#include "tiles/tiff_index.hpp"

namespace wedgescope {

class TileDecoder {
public:
    /// Null if the sheet, of one band of such values in square tiles, is packed otherwise.
    static std::optional<TileDecoder> of(const std::string& path, TiffIndex sheet, std::size_t type_bytes);

    /// A tile of the sheet (level 0) or of an overview: [edge x edge] values. False where it cannot be decoded here, or
    /// `right` says that these are not what was packed.
    bool decode(int level, std::int64_t column, std::int64_t row, RawVector<std::byte>& values,
                const std::function<bool()>& right) const;

private:
    TileDecoder(const std::string& path, TiffIndex sheet, std::size_t type_bytes)
        : file_(std::make_unique<PlainFile>(path, PlainFile::Use::read)), sheet_(std::move(sheet)),
          edge_(sheet_.levels[0].tile_columns), type_bytes_(type_bytes) {}
    bool unpack(bool zstd, std::uint64_t at, std::size_t count, RawVector<std::byte>& values) const;
    void undo(std::uint16_t predictor, RawVector<std::byte>& values) const;

    std::unique_ptr<PlainFile> file_;
    TiffIndex sheet_;
    std::int64_t edge_;
    std::size_t type_bytes_;
};

}  // namespace wedgescope
