#include "tiles/tiff_index.hpp"

#include <algorithm>
#include <utility>

#include "tiles/tiff_handle.hpp"

namespace wedgescope {
namespace {

template <class T>
T field(TIFF* file, std::uint32_t tag) {
    T value = 0;
    TIFFGetFieldDefaulted(file, tag, &value);
    return value;
}

}  // namespace

std::optional<TiffIndex::Level> TiffIndex::level_of(TIFF* file) {
    TiffIndex::Level level;
    level.columns = field<std::uint32_t>(file, TIFFTAG_IMAGEWIDTH);
    level.rows = field<std::uint32_t>(file, TIFFTAG_IMAGELENGTH);
    level.strips = !TIFFIsTiled(file);
    if (level.strips) {
        level.tile_columns = static_cast<std::uint32_t>(level.columns);
        level.tile_rows =
            std::min(field<std::uint32_t>(file, TIFFTAG_ROWSPERSTRIP), static_cast<std::uint32_t>(level.rows));
    } else {
        level.tile_columns = field<std::uint32_t>(file, TIFFTAG_TILEWIDTH);
        level.tile_rows = field<std::uint32_t>(file, TIFFTAG_TILELENGTH);
    }
    level.bands = field<std::uint16_t>(file, TIFFTAG_SAMPLESPERPIXEL);
    level.bits = field<std::uint16_t>(file, TIFFTAG_BITSPERSAMPLE);
    level.compression = field<std::uint16_t>(file, TIFFTAG_COMPRESSION);
    // Of packings that know none libtiff gives no value.
    if (std::uint16_t predictor = 0; TIFFGetField(file, TIFFTAG_PREDICTOR, &predictor)) level.predictor = predictor;
    const auto numbers = [&](std::uint32_t of_tiles, std::uint32_t of_strips, std::vector<std::uint64_t>& to) {
        const std::uint64_t* found = nullptr;
        if (!TIFFGetField(file, level.strips ? of_strips : of_tiles, &found) || !found) return false;
        to.assign(found, found + (level.strips ? TIFFNumberOfStrips(file) : TIFFNumberOfTiles(file)));
        return true;
    };
    if (!numbers(TIFFTAG_TILEOFFSETS, TIFFTAG_STRIPOFFSETS, level.offsets) ||
        !numbers(TIFFTAG_TILEBYTECOUNTS, TIFFTAG_STRIPBYTECOUNTS, level.byte_counts))
        return std::nullopt;
    return level;
}

std::optional<TiffIndex> TiffIndex::of(const std::string& path) {
    // Who asks falls back on GDAL, which says it again.
    const TiffReader opened = read_tiff(path);
    TIFF* const file = opened.get();
    if (!file) return std::nullopt;
    TiffIndex index;
    do {
        const auto kind = field<std::uint32_t>(file, TIFFTAG_SUBFILETYPE);
        if (!index.levels.empty() && kind != FILETYPE_REDUCEDIMAGE) continue;  // a mask
        auto level = level_of(file);
        if (!level || level->strips) return std::nullopt;
        index.levels.push_back(std::move(*level));
    } while (TIFFReadDirectory(file));
    return index;
}

}  // namespace wedgescope
