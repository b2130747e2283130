// TiffLayer: a plain GeoTIFF as a layer, read without GDAL, which takes longer to be loaded than such a run takes
// over the posts. For the .cpp files of this folder only. Leaves what the file says to plain_tiff.hpp, and every other file to
// raster_file.hpp.
//
// Memory: where each tile lies (idle_bytes). Of packed tiles a TileCache that others may share, and for each thread that reads one
// tile and what unpacks it (reader_bytes). Of whole tiles as they are only rows that are asked for, a few at a time, of strips what is
// asked for of each row: the system's own cache has them already, and to fill another takes longer than to read them again. Below, a
// strip is a tile as wide as the raster.
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
#include "tiles/plain_tiff.hpp"
#include "tiles/raster_file.hpp"
#include "tiles/raster_layer.hpp"
#include "tiles/tile_cache.hpp"
#include "tiles/tile_decoder.hpp"

namespace wedgescope {

class TiffLayer final : public RasterLayer {
public:
    /// Null if `path` is no PlainTiff. Packed tiles go through `cache`; null too if that has no room for some. Without a cache none is
    /// kept.
    static std::unique_ptr<TiffLayer> of(const std::string& role, const std::string& path,
                                         std::shared_ptr<TileCache> cache = nullptr);
    /// The posts of a raster of which GDAL told the rest, which it goes on to watch (fingerprint()). Null as above; then it is left alone.
    static std::unique_ptr<TiffLayer> of(std::unique_ptr<RasterFile>& told, std::shared_ptr<TileCache> cache = nullptr);

    ~TiffLayer() override;
    void read_values(const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) override;
    ReaderBytes reader_bytes() const override;
    std::size_t idle_bytes() const override { return (decoder_ ? 2 : 1) * index_bytes(); }
    std::int64_t rows_decoded_together() const override { return file_ ? 1 : facts_.block_rows; }
    bool fills_tile_cache() const override { return !file_; }
    bool fills_gdal_cache() const override { return false; }
    /// As RasterFile's.
    std::uint64_t fingerprint(const std::vector<Window>& cells) override;

private:
    struct Reader;
    TiffLayer(PlainTiff plain, std::shared_ptr<TileCache> cache);
    static std::unique_ptr<TiffLayer> of(std::optional<PlainTiff> found, std::shared_ptr<TileCache> cache);

    std::size_t index_bytes() const { return 2 * sizeof(std::uint64_t) * index_.offsets.size(); }
    bool is_blank(std::int64_t column, std::int64_t row) const { return index_.byte_counts[tile_number(column, row)] == 0; }
    std::size_t tile_number(std::int64_t column, std::int64_t row) const {
        return static_cast<std::size_t>(row * ((facts_.columns - 1) / facts_.block_columns + 1) + column);
    }
    [[noreturn]] void fail(std::int64_t column, std::int64_t row, const std::string& reason) const;
    std::size_t tile_bytes() const;
    /// Of the raster in a row of tiles; of the last one fewer, and a strip holds no others.
    std::int64_t rows_in(std::int64_t row) const {
        return std::min(facts_.block_rows, facts_.rows - row * facts_.block_rows);
    }
    void read_as_is(std::int64_t column, std::int64_t row, const Window& part, RawVector<std::byte>& values);
    std::size_t row_bytes() const { return static_cast<std::size_t>(facts_.block_columns * facts_.type_bytes); }
    /// Of tiles as they are, so that they stay in a core's own cache.
    std::size_t rows_at_a_time() const {
        constexpr std::size_t together = std::size_t{1} << 17;
        return std::clamp<std::size_t>(together / row_bytes(), 1, static_cast<std::size_t>(facts_.block_rows));
    }
    TileCache::Tile tile(std::int64_t column, std::int64_t row);
    std::unique_ptr<Reader> lend();
    void unpack(std::int64_t column, std::int64_t row, RawVector<std::byte>& values);

    std::unique_ptr<RasterFile> told_by_;  ///< null: libtiff told all
    std::shared_ptr<TileCache> cache_;
    int cached_as_;
    TiffIndex::Level index_;
    std::unique_ptr<PlainFile> file_;     ///< of tiles as they are; null: they are packed
    std::optional<TileDecoder> decoder_;  ///< of packed ones; else libtiff
    std::mutex mutex_;
    std::vector<std::unique_ptr<Reader>> free_;
};

/// A raster, opened and checked: without GDAL where that will do; else its posts where these are plain. IoError, DataError.
std::unique_ptr<RasterLayer> open_raster(const std::string& role, const std::string& path,
                                         std::shared_ptr<TileCache> cache = nullptr);

}  // namespace wedgescope
