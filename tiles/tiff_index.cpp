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
    level.strips = !TIFFIsTiled(file);
    level.columns = field<std::uint32_t>(file, TIFFTAG_IMAGEWIDTH);
    level.rows = field<std::uint32_t>(file, TIFFTAG_IMAGELENGTH);
    level.tile_columns =
        level.strips ? field<std::uint32_t>(file, TIFFTAG_IMAGEWIDTH) : field<std::uint32_t>(file, TIFFTAG_TILEWIDTH);
    level.tile_rows = level.strips ? std::min(field<std::uint32_t>(file, TIFFTAG_ROWSPERSTRIP),
                                              field<std::uint32_t>(file, TIFFTAG_IMAGELENGTH))
                                   : field<std::uint32_t>(file, TIFFTAG_TILELENGTH);
    level.bands = field<std::uint16_t>(file, TIFFTAG_SAMPLESPERPIXEL);
    level.bits = field<std::uint16_t>(file, TIFFTAG_BITSPERSAMPLE);
    level.compression = field<std::uint16_t>(file, TIFFTAG_COMPRESSION);
    // Of packings that know none libtiff gives no value.
    if (std::uint16_t predictor = 0; TIFFGetField(file, TIFFTAG_PREDICTOR, &predictor)) level.predictor = predictor;
    const std::uint32_t tiles = level.strips ? TIFFNumberOfStrips(file) : TIFFNumberOfTiles(file);
    const std::uint64_t *offsets = nullptr, *byte_counts = nullptr;
    if (!TIFFGetField(file, level.strips ? TIFFTAG_STRIPOFFSETS : TIFFTAG_TILEOFFSETS, &offsets) || !offsets ||
        !TIFFGetField(file, level.strips ? TIFFTAG_STRIPBYTECOUNTS : TIFFTAG_TILEBYTECOUNTS, &byte_counts) ||
        !byte_counts)
        return std::nullopt;
    level.offsets.assign(offsets, offsets + tiles);
    level.byte_counts.assign(byte_counts, byte_counts + tiles);
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
