// StoreLayer: one layer of a tile store, read tile by tile, each tile checked against its checksum as it is decoded.
// For the .cpp files of this folder only. Leaves which tiles are needed to raster_source.cpp.
//
// Memory: TileCache, and for each reading thread one sheet's handle and one tile; at most 16 handles wait open,
// fewer where tiles are large (idle_bytes).
#pragma once
#include <algorithm>
#include <cstddef>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lib/raw_vector.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/store_manifest.hpp"
#include "tiles/tile_cache.hpp"
#include "tiles/tile_decoder.hpp"

namespace wedgescope {

/// One sheet, opened for reading its tiles.
class SheetReader {
public:
    /// By GDAL: what any GDAL program reads.
    enum class By { gdal, whatever_is_fastest };
    /// IoError / DataError naming the file if it or its checksums are not as the manifest says.
    SheetReader(const std::string& folder, const StoreLayerEntry& layer, const StoreSheet& sheet, By by = By::gdal);
    /// A sheet whose sums are known; `posts`: of the layer.
    SheetReader(std::string path, const RasterFacts& layer, const Window& posts, SheetSums sums, By by = By::gdal);

    const SheetSums& sums() const { return sums_; }
    const std::string& path() const { return path_; }
    /// Values of a tile as stored, row after row, cut at the sheet's edge. IoError / DataError naming file and tile.
    RawVector<std::byte> tile(int level, std::int64_t column, std::int64_t row);

private:
    void open();
    bool decoded_here(int level, std::int64_t column, std::int64_t row, RawVector<std::byte>& values,
                      const std::function<bool()>& right);

    std::string path_;
    RasterFacts facts_;
    SheetSums sums_;
    std::optional<TileDecoder> decoder_;
    DatasetHandle dataset_;  ///< null while the decoder does
    Window posts_;
};

class StoreLayer final : public RasterLayer {
public:
    StoreLayer(std::string folder, const StoreLayerEntry& entry, std::shared_ptr<TileCache> cache);
    void read_values(const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) override {
        read_values(0, window, out, type, line_bytes);
    }
    /// From the overviews, whose posts are those that the level keeps.
    void read_level(int level, const Window& window, float* out, std::int64_t stride) override;
    std::size_t level_bytes() const override { return level_line * sizeof(float); }

    /// By the checksums of the sheets' sums, in the manifest: wherever the store lies, and not before another version.
    std::uint64_t fingerprint(const std::vector<Window>& cells) override;
    Fingerprint fingerprint_now() override;

    /// Values of a tile, the tile as the file holds it, and what unpacking takes.
    ReaderBytes reader_bytes() const override {
        const auto tile = static_cast<std::size_t>(facts_.block_columns * facts_.block_rows * facts_.type_bytes);
        // And where each tile of a sheet and of its overviews lies.
        const auto across = static_cast<std::size_t>(sheet_posts / facts_.block_columns + 1);
        return {tile, 2 * tile + 2 * across * across * 2 * sizeof(std::uint64_t)};
    }
    bool fills_tile_cache() const override { return true; }
    /// Of the sheets that wait open, each with a tile's buffer.
    std::size_t idle_bytes() const override { return most_idle() * reader_bytes().packed; }

private:
    using Sheets = std::map<std::pair<std::int64_t, std::int64_t>, const StoreSheet*>;  ///< by column and row

    static std::uint64_t fingerprint(const StoreLayerEntry& entry, const Sheets& sheets,
                                     const std::vector<Window>& cells);
    static constexpr std::int64_t level_line = 4096;  ///< posts that read_level() holds for itself
    /// The coarsest level of which a whole sheet holds a whole tile.
    int deepest() const;
    std::size_t most_idle() const {
        constexpr std::size_t most = 16, together = std::size_t{8} << 20;
        return std::min(together / reader_bytes().packed, most);
    }
    void read_values(int level, const Window& window, void* out, GDALDataType type, std::int64_t line_bytes);
    /// Of a level that has a whole tile or more in a whole sheet.
    void thin(RawVector<std::byte>& values, const SheetSums& sums, int own, int level) const;
    TileCache::Tile tile(int level, std::int64_t column, std::int64_t row);

    std::string folder_;
    std::shared_ptr<const StoreLayerEntry> entry_;
    Sheets sheets_;
    std::shared_ptr<TileCache> cache_;
    int cached_as_;
    std::mutex mutex_;
    std::list<std::pair<const StoreSheet*, std::unique_ptr<SheetReader>>> idle_;  ///< the last used in front
};

/// Opens a sheet's GeoTIFF, and nothing beside it. Null with the reason in `errors`.
DatasetHandle open_sheet(const std::string& path);

}  // namespace wedgescope
