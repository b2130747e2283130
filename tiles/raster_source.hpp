// RasterSource: the WedgeSource over raster layers: chunks of rasters, of a store's layers, or of what stands in their
// place. For the .cpp files of this folder only. Leaves sorting into wedges to spilled_source.cpp, what a layer is to
// raster_layer.hpp.
#pragma once
#include <algorithm>
#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "lib/detail.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/ground_map.hpp"
#include "tiles/needed_posts.hpp"
#include "tiles/registered_layer.hpp"
#include "tiles/sources.hpp"
#include "tiles/tile_cache.hpp"
#include "tiles/tile_ledger.hpp"
#include "tiles/tile_store.hpp"

namespace wedgescope {

/// Chunks of whatever layers there are: rasters, a store's, or blocks that a partition put in their place.
class RasterSource : public WedgeSource {
public:
    explicit RasterSource(const DataBaseParams& params);

    const DataBase& data_base() const override { return data_base_; }

    using WedgeSource::load;
    Chunk load(const ChunkRequest& request) override;

    LoadCost cost(const ChunkRequest& request) const override;

    std::uint64_t class_bytes(const Window& cells) const override {
        return WedgeSource::class_bytes(cells) * static_cast<std::uint64_t>(culture_->facts().type_bytes);
    }

    CultureCells load_classes(const Window& window) override;

    void read_bare_terrain(const Window& posts, float* heights_m) override;

    Extremes extremes() override;

    std::uint64_t fingerprint(const std::vector<Window>& posts) override;

    BlockMap* block_map() override { return map_.get(); }
    /// Opened when it is asked for: whoever uses no levels needs no such file.
    DetailMap* detail_map() override;

    Skipped skipped() const override;

    SourceReport report() const override;

    std::size_t cache_bytes() const override;
    std::size_t filled_bytes(std::uint64_t bytes_read) const override {
        const std::size_t cache = params_.cache_bytes;
        return cache_bytes() - cache + static_cast<std::size_t>(std::min<std::uint64_t>(cache, bytes_read));
    }
    std::size_t held_bytes() const override { return filled_bytes(GdalSession::cache_used_bytes() + tiles_->bytes()); }

    /// One layer is read at a time, but a handle keeps its buffers.
    std::size_t reader_bytes() const override;

protected:
    /// Of the tiles that are kept those under one strip in each of the four quadrants, and a quarter more; of tiles that are
    /// not packed a few. Up to `most_bytes` where packed ones need it.
    void limit_tiles(std::size_t most_bytes);
    double class_bytes_of_strips() const;
    /// Classes of a whole tile of culture, as fronts ask for them, are kept: by which number. None for other windows.
    std::optional<TileCache::Key> class_tile(const Window& window) const;

    std::vector<RasterLayer*> readers() const;

    std::size_t ledger_bytes() const;

    void open_culture(std::unique_ptr<RasterLayer> raster);
    void open_height(std::unique_ptr<RasterLayer> raster);

    /// The terrain columns of a window, in runs that can be read.
    std::vector<Run> terrain_runs(Interval columns) const;

    /// Rows of a window so wide that are read at a time: whole rows of blocks where they fit. Fewer where they are then turned,
    /// for lines are columns.
    std::int64_t slab_rows(std::int64_t width, bool turned) const;
    /// These, cut at the edges of blocks.
    std::vector<Interval> slabs(Interval rows, std::int64_t width, bool turned) const;

    /// Some of the posts of `all`, which lie row after row from `from` on, into lines of columns of `minor` posts, of which `to` has the
    /// first of `all`.
    static void turn(const Window& all, const Window& some, const float* from, float* to, std::int64_t minor);

    /// Posts of a level of detail: bare terrain, for levels are used where no culture height stands.
    void load_level(Chunk& chunk, const ChunkRequest& request);

    void load_surface(Chunk& chunk, const NeededPosts& needed);
    /// Some of them, each time they are loaded, for the report.
    void note_surface(const RawVector<float>& heights_m);
    void note_culture(const std::vector<float>& heights_m);
    static constexpr std::size_t noted_step = 61;  ///< in step with few widths

    /// What is needed of one run of the columns that begin at `first`; returns posts of tiles read, adds the rectangles of posts
    /// that were filled.
    std::uint64_t read_terrain(const Run& run, std::int64_t first, Interval rows, const NeededPosts& needed, float* out,
                               std::int64_t stride, std::vector<Window>& filled);

    /// Notes why nothing of a request's posts is read.
    void pass_surface(const ChunkRequest& request, const Window& window);

    /// And of a request for a level: what it keeps is left out for the level's sake, the rest for its own reason.
    void pass_level(int level, const Window& window, const NeededPosts& needed);

    /// Notes why a layer under these posts may stay unread: for the ground's reason, or because nothing sees it.
    static void pass_layer(RegisteredLayer& layer, const Window& posts, const NeededPosts& needed);

    /// Of n codes; true if some have none.
    bool find_classes(const std::int32_t* codes, std::int64_t n, ClassId* classes) const;
    ClassId class_beyond_table(std::int32_t code) const;

    Extremes find_extremes();

    /// Of the bare terrain, where a store or a map knows them.
    std::optional<Extremes> bare_extremes() const {
        if (store_) return store_->terrain_extremes();
        return of_ground_ ? params_.ground->terrain_extremes() : std::nullopt;
    }

    /// From what is known beforehand; with culture height a few blocks are read, the most promising first.
    Extremes known_extremes(Extremes out);

    static constexpr std::int32_t table_begin = -32768;
    static constexpr std::uint32_t table_size = 32768 + 65536;
    /// Of a code; table_size or more: it has none.
    static std::uint32_t place_in_table(std::int32_t code) {
        return static_cast<std::uint32_t>(code) - static_cast<std::uint32_t>(table_begin);
    }

    DataBaseParams params_;
    std::shared_ptr<TileCache> tiles_;
    int class_layer_ = 0;               ///< in these
    std::unique_ptr<TileStore> store_;  ///< null: plain rasters
    std::unique_ptr<BlockMap> map_;
    bool has_detail_ = false, of_ground_ = false;  ///< it is there; of params_.ground
    std::mutex detail_mutex_;
    std::atomic<std::uint64_t> level_posts_{0};  ///< read of levels above 0
    std::atomic<float> lowest_m_{std::numeric_limits<float>::infinity()};  ///< of some of those that were loaded
    std::atomic<std::uint64_t> raised_posts_{0};  ///< some of those that culture height stands on
    std::atomic<std::uint64_t> raised_cm_{0};     ///< and its sum
    std::unique_ptr<DetailMap> detail_;
    std::unique_ptr<RasterLayer> terrain_;
    std::unique_ptr<TileLedger> ledger_;  ///< of the terrain
    std::unique_ptr<RegisteredLayer> culture_, height_;
    std::vector<ClassId> class_of_;  ///< of codes from table_begin on
    DataBase data_base_;
    std::mutex extremes_mutex_;
    std::optional<Extremes> extremes_;
};

}  // namespace wedgescope
