// TiffLayer: a plain tiled GeoTIFF as a layer, read without GDAL, which takes longer to be loaded than such a run takes
// over the posts. For the .cpp files of this folder only. Leaves every file of which GDAL may know more than its first
// directory says to raster_file.hpp.
//
// Memory: where each tile lies (idle_bytes). Of packed tiles a TileCache that others may share, and for each thread that reads one
// tile and what unpacks it (reader_bytes). Of tiles as they are only rows that are asked for, a few at a time: the system's own
// cache has them already, and to fill another takes longer than to read them again.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "tiles/plain_file.hpp"
#include "tiles/raster_layer.hpp"
#include "tiles/tiff_index.hpp"
#include "tiles/tile_cache.hpp"
#include "tiles/tile_decoder.hpp"

namespace wedgescope {

class TiffLayer final : public RasterLayer {
public:
    /// Null if `path` is anything but a TIFF that is read here as GDAL reads it: one band of usual numbers in tiles, packed as
    /// libtiff unpacks it; its corner and cells by one tie point and a scale; in WGS84, as degrees or UTM, by EPSG's code; without
    /// mask, scale, offset or unit; no file beside it that would tell GDAL more, and no configuration of GDAL's.
    /// Packed tiles go through `cache`, which must have room for some; null: none is kept.
    static std::unique_ptr<TiffLayer> of(const std::string& role, const std::string& path,
                                         std::shared_ptr<TileCache> cache = nullptr);

    ~TiffLayer() override;
    void read_values(const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) override;
    ReaderBytes reader_bytes() const override;
    std::size_t idle_bytes() const override { return index_bytes(); }
    bool fills_tile_cache() const override { return !file_; }
    /// As RasterFile's.
    std::uint64_t fingerprint(const std::vector<Window>& cells) override;

private:
    struct Contents;
    struct Reader;
    static std::optional<Contents> contents(const std::string& role, const std::string& path);
    TiffLayer(Contents contents, std::shared_ptr<TileCache> cache);

    std::size_t index_bytes() const { return 2 * sizeof(std::uint64_t) * index_.offsets.size(); }
    bool is_blank(std::int64_t column, std::int64_t row) const { return index_.byte_counts[tile_number(column, row)] == 0; }
    std::size_t tile_number(std::int64_t column, std::int64_t row) const {
        return static_cast<std::size_t>(row * ((facts_.columns - 1) / facts_.block_columns + 1) + column);
    }
    [[noreturn]] void fail(std::int64_t column, std::int64_t row, const std::string& reason) const;
    std::size_t tile_bytes() const;
    std::size_t row_bytes() const { return static_cast<std::size_t>(facts_.block_columns * facts_.type_bytes); }
    /// Of tiles as they are, so that they stay in a core's own cache.
    std::size_t rows_at_a_time() const {
        constexpr std::size_t together = std::size_t{1} << 17;
        return std::clamp<std::size_t>(together / row_bytes(), 1, static_cast<std::size_t>(facts_.block_rows));
    }
    TileCache::Tile tile(std::int64_t column, std::int64_t row);
    std::unique_ptr<Reader> lend();
    void unpack(std::int64_t column, std::int64_t row, RawVector<std::byte>& values);

    std::shared_ptr<TileCache> cache_;
    int cached_as_;
    TiffIndex::Level index_;
    std::unique_ptr<PlainFile> file_;     ///< of tiles as they are; null: they are packed
    std::optional<TileDecoder> decoder_;  ///< of packed ones; else libtiff
    std::mutex mutex_;
    std::vector<std::unique_ptr<Reader>> free_;
};

/// Does open_raster() read it so? Then it is made of this file alone.
bool reads_without_gdal(const std::string& path);
/// A raster, opened and checked: without GDAL where that will do. IoError, DataError.
std::unique_ptr<RasterLayer> open_raster(const std::string& role, const std::string& path,
                                         std::shared_ptr<TileCache> cache = nullptr);

}  // namespace wedgescope
