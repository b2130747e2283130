// TileStore: a data base on disk that was tiled once: sheets of tiles under a VRT a layer, checksums, block map and
// the manifest that names them. Opens one for reading, and makes one from rasters.
// Leaves the files' formats to store_manifest.hpp and block_map_file.hpp, chunks to sources.hpp.
//
// Memory: decoded tiles up to `cache_bytes`, shared by all layers and threads; one tile a reading thread beside it; at
// most 16 open sheets a layer (`StoreLayer::idle_bytes`); pages of the block map (BlockMapFile).
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lib/stop.hpp"
#include "lib/wedge_source.hpp"
#include "tiles/code_counts.hpp"
#include "tiles/features.hpp"

namespace wedgescope {

class BlockMapFile;
struct FilePart;
class RasterLayer;
struct StoreManifest;
class TileCache;

enum class StoreLayerKind { dem, culture, culture_height };
/// "dem", "culture", "culture_height": also names of folders and VRTs in the store.
const char* name(StoreLayerKind kind);

/// A folder with a manifest.
bool is_tile_store(const std::string& path);

/// The folder in which a store of that name is made before it is put in place.
std::string unfinished_store(const std::string& output);

/// The class table that a store with features of a side of their own keeps: a CSV that scenes over it read.
inline constexpr const char* store_classes_name = "classes.csv";
/// Its path; empty: no tile store, or one without.
std::string store_classes(const std::string& store);
/// Metres in one unit of its culture heights, where it was told when it was made; nothing for what is no tile store too. As
/// TileStore's constructor.
std::optional<double> store_height_scale(const std::string& store);

class TileStore {
public:
    /// Reads the manifest only. Its layers' tiles go through `cache`; null: none is kept. IoError, DataError naming the file.
    explicit TileStore(std::string path, std::shared_ptr<TileCache> cache = nullptr);
    ~TileStore();

    const StoreManifest& manifest() const { return *manifest_; }
    /// Null if the store has no such layer.
    std::unique_ptr<RasterLayer> layer(StoreLayerKind kind) const;
    /// `scale`: metres in one unit of the stored culture height.
    std::unique_ptr<BlockMap> block_map(double scale) const;
    /// False in a store made before there were levels of detail as they are now.
    bool has_detail_map() const;
    std::unique_ptr<DetailMap> detail_map(double scale) const;
    /// InputError where it names a material that is none of these.
    std::optional<Legend> legend(const Materials& materials) const;
    /// Of the bare terrain.
    Extremes terrain_extremes() const;

private:
    FilePart inside(const std::string& name) const;
    std::unique_ptr<BlockMapFile> bounds(double scale, std::size_t kept) const;
    /// DataError where a map is another than the manifest's.
    void require(std::uint64_t found, const std::optional<std::uint64_t>& named, const char* what,
                 const std::string& name) const;

    std::string path_;
    std::unique_ptr<StoreManifest> manifest_;
    std::shared_ptr<TileCache> cache_;
};

struct TileStoreParams {
    std::vector<std::string> dems;          ///< where several hold a post, the first with a value there wins
    std::string culture, culture_height;    ///< empty: none
    double culture_height_scale = 1;        ///< metres in one unit of culture height; kept in the store
    std::string legend_name, legend_csv;    ///< kept in the store; csv empty for a built-in one
    std::optional<Legend> legend;           ///< the same, for naming codes that it does not know
    std::optional<FeatureParams> features;  ///< burnt over culture and culture height, or these are made of them alone
    std::optional<SideRasterParams> sides;  ///< of culture's cells; only with culture
    std::string class_table;                ///< CSV, kept in the store as store_classes_name; empty: none
    std::string output;                     ///< the folder
    std::int64_t tile_posts = 256;          ///< a power of two from 64 to 2048
    std::vector<std::string> creation;      ///< GeoTIFF creation options K=V
    /// Bytes of a layer's posts that are kept as they are where `creation` says nothing: what the system's cache holds is read
    /// sooner unpacked. Larger layers are packed by ZSTD, level 1, with a predictor.
    std::int64_t most_as_it_is = std::int64_t{1} << 31;
    std::size_t memory_bytes = std::size_t{1} << 30;
    std::size_t cache_bytes = 0;  ///< of these, what the session grants GDAL's block cache
    int threads = 1;
    bool overwrite = false;  ///< replace a store that stands there
    bool resume = false;     ///< go on with `output`.part if it is there
    Stop* stop = nullptr;
    std::function<void(double)> progress;  ///< called with 0..1 from one thread at a time
    std::string software;
};

struct TileStoreSummary {
    struct Layer {
        std::string name, type;
        std::int64_t columns = 0, rows = 0;
        std::uint64_t sheets = 0, reused = 0, bytes = 0;
        float lowest = std::numeric_limits<float>::infinity();  ///< metres, of culture its codes; +inf: all is void
    };
    std::vector<Layer> layers;
    std::string note;                 ///< what was done to unlike rasters; empty: nothing
    std::uint64_t disagreements = 0;  ///< posts that two rasters hold with unlike heights
    std::uint64_t interpolated = 0;   ///< of these, where one of the two has no post of its own
    float largest_m = 0;
    std::string largest_where;  ///< files, column and row of the store
    CodeCounts unknown_codes;   ///< that the legend does not know
    bool features_lie_elsewhere = false;  ///< not one cell has a feature
    std::vector<std::string> feature_fields_left_out;
};

/// InputError where what stands at the output, or an earlier run left there, may not be replaced; IoError. Looks at nothing else.
void check_store_output(const std::string& output, bool overwrite, bool resume);
/// InputError for options, an output that stands already or too small a memory; IoError and DataError naming file and
/// post. Until it is whole the store is `output`.part; that is kept after an interruption or a failure of the machine
/// if a sheet is done, for `resume`.
TileStoreSummary write_tile_store(const TileStoreParams& params);

}  // namespace wedgescope
