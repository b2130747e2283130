// TileDecoder: values of a sheet's tiles, decoded here where they are packed as the store packs them by default (ZSTD or
// nothing; no predictor, horizontal or floating point): libtiff takes two to three times as long. Offers what it found:
// whether that is what was stored only the checksum tells, so a layout that it takes wrongly costs time, never a bit.
// For the .cpp files of this folder only. Leaves every other layout, and naming damage, to GDAL (store_layer.hpp).
//
// Memory: for each reading thread one tile as the file holds it, and 160 KB of the decoder's.
#pragma once
#include <gdal_priv.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lib/raw_vector.hpp"
#include "tiles/plain_file.hpp"

namespace wedgescope {

class TileDecoder {
public:
    /// Null if the file is packed otherwise. `band`: the sheet's first.
    static std::optional<TileDecoder> of(const std::string& path, GDALDataset& sheet, std::int64_t edge,
                                         std::size_t type_bytes, bool floating);

    /// Tile of a band (the sheet's or of an overview): [edge x edge] values. False where it cannot be decoded here, or
    /// `right` says no to all that it may be.
    bool decode(GDALRasterBand& band, std::int64_t column, std::int64_t row, RawVector<std::byte>& values,
                const std::function<bool()>& right);

private:
    enum class Predictor { none, horizontal, floating };
    TileDecoder(const std::string& path, std::int64_t edge, std::size_t type_bytes)
        : file_(std::make_unique<PlainFile>(path, PlainFile::Use::read)), edge_(edge), type_bytes_(type_bytes) {}
    bool unpack(std::uint64_t at, std::size_t count, RawVector<std::byte>& values) const;
    void undo(Predictor predictor, RawVector<std::byte>& values) const;

    std::unique_ptr<PlainFile> file_;
    std::int64_t edge_;
    std::size_t type_bytes_;
    bool zstd_ = false;
    std::vector<Predictor> likely_;  ///< the one that was right last in front
};

}  // namespace wedgescope
