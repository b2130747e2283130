// What a tile store holds, by its manifest alone, and whether all of it is still as it was written.
// Leaves making and reading stores to tile_store.hpp.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "lib/scene.hpp"
#include "lib/stop.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

struct StoreDescription {
    struct Layer {
        std::string name, type, compression, crs_name, unit;
        bool has_crs = false, geographic = false, has_no_data = false;
        double no_data = 0;
        std::int64_t columns = 0, rows = 0, tile = 0;
        double origin_x = 0, origin_y = 0, step_x = 0, step_y = 0;
        std::uint64_t sheets = 0, tiles = 0, bytes = 0;  ///< tiles without overviews; bytes of all files
        std::uint64_t void_posts = 0;
        double lowest = 0, highest = 0;  ///< metres (codes for culture); only if not all are void
        std::vector<std::string> sources;
    };
    std::string path, software, legend;
    std::optional<double> culture_height_scale;  ///< metres in one unit of culture height, where it was told
    std::int64_t version = 0;
    std::vector<Layer> layers;  ///< dem first
    int block_levels = 0;
    std::uint64_t block_map_bytes = 0;
    struct Kept {
        std::uint64_t bytes = 0;
        std::optional<LatLon> latlon;
        IndexPosition nadir;  ///< on the dem's posts
        std::string damage;  ///< why it cannot be read; empty: it can
    };
    std::optional<Kept> kept;  ///< a spill that stands in the store, for scenes from its point
};
/// IoError, DataError naming the manifest.
StoreDescription describe_store(const std::string& path);

struct StoreVerdict {
    std::uint64_t files = 0, bytes = 0;  ///< read
    std::vector<std::string> damage;     ///< one line for each file, page or tile
};
/// Reads every byte once. Damage is listed, not thrown; Interrupted if asked to stop. Memory: one sheet's checksums,
/// one tile, one page.
StoreVerdict verify_store(const std::string& path, const Stop* stop, const std::function<void(double)>& progress);

}  // namespace wedgescope
