// Sources: the WedgeSources. Direct: windows of rasters, read near to far as the engine asks. Spilled: the same posts
// after one sequential pass, from blocks in wedge buckets. Both hand out the same bits.
// Leaves which of them serves to source_choice.hpp, the pass to partition.hpp and the blocks' file to spill.hpp. The first
// is raster_source.cpp, the second and kept spills spilled_source.cpp.
//
// Memory: a direct source holds GDAL's own block cache, whose size the session sets, and for each reading thread and layer
// one GDAL handle: the block that it decodes, which the cache keeps even where it is larger than all of the cache, and
// that block as the file holds it (reader_bytes). Where layers' tiles are decoded without GDAL (stores, plain packed GeoTIFFs)
// three quarters of the cache are theirs. Classes of culture tiles are kept in these too, or in what GDAL's cache need not
// hold of layers that it reads. Chunks belong to whoever asked for them. While it reads, load() takes
// up to 16 MiB beside its chunk.
// A spilled source holds at most a quarter of the memory in blocks, an eighth in its index and a sixteenth in its block
// map (without which it does when that would be larger); during the pass another quarter for the windows in flight, GDAL's
// cache and what readers hold; of these fewer where they would not fit.
#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "lib/material.hpp"
#include "lib/scene.hpp"
#include "lib/stop.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

class GroundMap;

struct DataBaseParams {
    std::string dem;
    std::string culture;         ///< empty: none
    std::string culture_height;  ///< empty: none
    double culture_height_scale = 1;
    std::optional<Legend> legend;  ///< needed with culture
    bool classes = true;           ///< they are asked for; if not, a store's culture that has no legend is left alone
    Materials materials;           ///< that the legend of a store names
    ClassId default_class = 4;     ///< no culture, or its no-data
    std::size_t cache_bytes = 0;   ///< what the session grants for decoded blocks, GDAL's and our own
    /// Up to so much more for decoded strips where that holds all of them: each window along a column asks for them anew.
    std::size_t more_cache_bytes = 0;
    int threads = 1;  ///< that may read at a time: what GDAL decodes each decodes for itself
    /// What is known of the ground of plain rasters; null: nothing. A tile store has its own.
    std::shared_ptr<const GroundMap> ground;
    /// Posts will be asked for about once each, strip by strip outward from one point: decoded tiles beyond a few strips
    /// would only fill pages with what nobody asks for again.
    bool by_strips = false;
    bool expects_ground = false;  ///< one will be given when posts are read: to be counted among what is held
    /// Looked at before bare terrain is read, and while all posts are read for their extremes.
    const Stop* stop = nullptr;
};

/// Opens and checks everything that can be checked without reading posts. DataError or IoError naming the file.
std::unique_ptr<WedgeSource> open_direct_source(const DataBaseParams& params);

/// Azimuths from north, clockwise.
struct Arc {
    double from_rad = 0, width_rad = 0;
};

struct SpillOptions {
    std::string temp_folder;  ///< empty: temporary_folder()
    bool all_round = false;   ///< for what lies on the raster's own posts: whatever the sector
    bool all_of_it =
        false;  ///< for coverage: without a range all of the raster; else the range follows from the terrain
    std::optional<Arc> only;  ///< not the whole of the scene's sector: what wedges in these azimuths may need
    std::size_t memory_bytes = std::size_t{1} << 30;
    int threads = 1;
    Stop* stop = nullptr;
    Timeline* timeline = nullptr;          ///< told of the pass and of what goes to the spill and comes back
    std::function<void(double)> progress;  ///< called with 0..1 from one thread at a time
};

/// Reads what `scene` may need in one pass. Posts out of its reach or sector come out void, and so they stand in the block
/// map. InputError where the memory is too small; IoError (disk full, no folder, ...); DataError; Interrupted.
std::unique_ptr<WedgeSource> open_spilled_source(const DataBaseParams& params, const Scene& scene,
                                                 const SpillOptions& options);

/// Plans instead: cost and held memory are those of the spilled source, its report says what the pass would read and spill
/// (blocks at the width of their type; flat ones get narrower), and no pass is made: nothing is read. `range_given`: else
/// the scene's range is a guess, and the pass has to find it. Errors as above.
std::unique_ptr<WedgeSource> forecast_spilled_source(const DataBaseParams& params, const ResolvedScene& scene,
                                                     bool range_given, const SpillOptions& options);

/// The rasters unread: all ground at one height (NaN: void), extremes as guessed. To resolve a scene and plan it where
/// reading a post would already take too much.
std::unique_ptr<WedgeSource> open_unread_source(const DataBaseParams& params, float ground_m, const Extremes& guess);

/// Name of a kept spill in its folder.
inline constexpr const char* kept_spill_name = "wedges.spill";
/// Its path in a folder.
std::string kept_path(const std::string& folder);
/// A kept spill for another scene, or other rasters.
class UnfitSpill : public DataError {
public:
    using DataError::DataError;
};
/// The whole of the rasters, sorted round a point for scenes from there, in a file of its own in `folder` that appears
/// when it is whole; an older one is replaced. Errors as above.
void keep_spill(const DataBaseParams& params, const PlatformParams& point, const std::string& folder,
                const SpillOptions& options);
/// InputError naming a kept spill in `folder` that was made for a point more than one post away. One that cannot be
/// read is nothing that would be lost.
void refuse_other_kept_spill(const DataBaseParams& params, const PlatformParams& point, const std::string& folder);
/// Opens it for a scene. UnfitSpill naming it where it was made for a point more than one post away, of other rasters or
/// before they were changed; DataError where it is damaged, IoError where it cannot be read.
std::unique_ptr<WedgeSource> open_kept_spill(const DataBaseParams& params, const Scene& scene,
                                             const std::string& folder, const SpillOptions& options);

}  // namespace wedgescope
