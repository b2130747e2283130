// Partition: one sequential pass over a raster, in the order in which its file is best read, that sorts its posts into
// blocks and the blocks into wedge buckets of a spill; and the reader that hands the same posts out again.
// For the .cpp files of this folder only. Leaves the file to spill.hpp, the bytes of a block to packed_block.hpp.
//
// Memory: of a layer one bit for each block of the scene's hull; of a pass `memory_bytes` for the windows in flight (never
// less than one block for each thread) and what GDAL needs to decode one block of the file. Windows are whole rows of
// blocks; where a row does not fit, blocks get fewer posts a side (block_edge), and where not even 32 rows fit the rows
// are read in parts, one after the other.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <numbers>
#include <optional>
#include <vector>

#include "lib/engine.hpp"
#include "lib/wedge_source.hpp"
#include "tiles/packed_block.hpp"
#include "tiles/raster_layer.hpp"
#include "tiles/spill.hpp"

namespace wedgescope {

/// Posts a side of a block; measured, see docs/out_of_core.md.
inline constexpr std::int64_t spill_edge = 128;

/// The ground that a scene may need.
struct PartitionScope {
    IndexPosition nadir;
    bool geodesic = false;
    double lat_deg = 0, lon_deg = 0;       ///< geodesic only
    std::optional<double> reach_m;         ///< ground range; none: the whole raster
    double from_rad = 0, width_rad = 7.0;  ///< azimuths, clockwise; 2 pi and more: all round
    bool all_round() const { return width_rad >= 2 * std::numbers::pi - 1e-9; }
};
PartitionScope scope_of(const ResolvedScene& scene);

/// Blocks of one layer that are needed.
struct BlockSet {
    std::int64_t edge = spill_edge;
    Window blocks;             ///< the hull
    std::vector<bool> needed;  ///< row after row of the hull

    bool contains(std::int64_t column, std::int64_t row) const {
        return blocks.contains(column, row) && needed[at(column, row)];
    }
    std::size_t at(std::int64_t column, std::int64_t row) const { return blocks.at(column, row); }
    bool any() const { return !blocks.empty(); }
};

/// All blocks of a raster of so many posts.
BlockSet all_blocks(std::int64_t columns, std::int64_t rows, std::int64_t edge);
/// Those in which a post within reach and sector may lie, and all that touch one of these.
BlockSet blocks_in_scope(const DataBase& data_base, const PartitionScope& scope, std::int64_t edge);
/// spill_edge, or less where a row of such blocks would not fit into a pass of `memory_bytes`.
std::int64_t block_edge(const RasterFacts& facts, std::size_t memory_bytes);

/// Sectors round the nadir in index space: azimuth decides the bucket, distance the order.
struct WedgeBuckets {
    IndexPosition nadir;
    int count = 1;
    struct Place {
        int bucket = 0;
        double distance = 0;
    };
    /// Of a block, by its corners' places on the terrain's grid: the first sector, clockwise, that one of them lies in.
    Place place(const std::array<IndexPosition, 4>& corners) const;
};

struct PassParams {
    std::size_t memory_bytes = std::size_t{64} << 20;
    int threads = 1;
    Stop* stop = nullptr;
    Timeline* timeline = nullptr;
    std::size_t fixed_bytes = 0;  ///< held beside blocks and windows in flight, as the timeline is told
    std::function<void(std::uint64_t posts)> progress;  ///< called with the posts read since the last call
};

/// A block map held in memory, over the hull of what is needed; all void elsewhere.
class GrownMap;
/// One made of its finest level, as a survey's map gave it: rows of the whole raster's blocks.
std::unique_ptr<BlockMap> map_from_finest(const DataBase& data_base, std::vector<BlockBounds> finest);

/// What the pass learns of the terrain on the way: extremes and block map. One thread at a time adds.
class Survey {
public:
    /// `needed`: posts elsewhere count as void in the map, as they will be read. Without `with_map` only extremes.
    Survey(const DataBase& data_base, const BlockSet& needed, bool with_map);
    ~Survey();
    Survey(const Survey&) = delete;
    Survey& operator=(const Survey&) = delete;

    /// Bounds over one window of whole blocks; nothing is shared, so that threads may take them side by side.
    struct Part;
    std::unique_ptr<Part> look(const Window& window, const float* terrain, const float* culture) const;
    void add(const Part& part);
    /// After the last part. Null without a map.
    std::unique_ptr<BlockMap> take_map();
    Extremes extremes() const { return extremes_of(found_); }

    /// Of a whole raster's or a hull's map, all levels.
    static std::size_t map_bytes(const BlockSet& needed);

private:
    const DataBase& data_base_;
    const BlockSet& needed_;
    std::unique_ptr<GrownMap> map_;
    PostExtremes found_;  ///< the highest with culture
};

/// One layer on its way into the spill.
struct LayerPass {
    RasterLayer& in;
    bool codes = false;
    const BlockSet& blocks;
    bool read_all = false;  ///< also what is not needed (for the survey's extremes)
    Spill& spill;
    std::size_t layer = 0;
    std::function<WedgeBuckets::Place(const Window& posts)> place;
    Survey* survey = nullptr;
    /// Scaled culture heights at the posts of a window, for the survey; may be empty.
    std::function<void(const Window&, std::vector<float>&)> culture;
};
struct PassDone {
    std::uint64_t read_bytes = 0;  ///< decoded
    std::size_t held_bytes = 0;    ///< blocks and windows in flight, the most at a time
};
/// IoError, DataError; Interrupted when asked to stop.
PassDone run_pass(const LayerPass& layer, const PassParams& params);
/// Posts that run_pass will read, for progress.
std::uint64_t posts_of_pass(const LayerPass& layer, const PassParams& params);

/// What passes over these layers, one after the other, come to, without reading: blocks as wide as their layer's type.
struct PassForecast {
    std::uint64_t read_bytes = 0;     ///< decoded
    std::uint64_t spilled_bytes = 0;  ///< written to the file
    std::size_t held_bytes = 0;       ///< blocks that stay in memory
    std::size_t window_bytes = 0;     ///< windows in flight, at the most
    std::size_t readers = 0;          ///< threads that read at the same time, at the most
};
/// `spill_bytes`: the spill's share of memory.
PassForecast forecast_passes(const std::vector<LayerPass>& layers, const PassParams& params, std::size_t spill_bytes,
                             int buckets);

/// A layer read back from a spill: the same posts, where they were stored; void elsewhere.
class SpilledLayer final : public RasterLayer {
public:
    /// `fingerprint`: of the raster that the spill was made of.
    SpilledLayer(const RasterFacts& facts, Fingerprint fingerprint, std::shared_ptr<Spill> spill, std::size_t layer);

    void read_heights(const Window& window, float* out, std::int64_t stride) override;
    void read_codes(const Window& window, std::int32_t* out) override;
    /// Blocks hold heights and codes, not what the file stored: an error of the caller's.
    void read_values(const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) override;

    std::uint64_t fingerprint(const std::vector<Window>& cells) override { return fingerprint_(cells); }
    Fingerprint fingerprint_now() override { return fingerprint_; }

    bool holds(const Window& posts) const;  ///< all of their blocks

private:
    template <class Value, class Unpack>
    void read(const Window& window, Value none, Value* out, std::int64_t stride, Unpack&& unpack);

    Fingerprint fingerprint_;
    PackScale scale_;
    std::shared_ptr<Spill> spill_;
    std::size_t layer_;
};

}  // namespace wedgescope
