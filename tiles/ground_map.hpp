// GroundMap: what a tile store knows of its ground beforehand, for plain rasters: their block map and detail map, made in
// one pass over the posts. For one run, in a file without a name; or kept beside the terrain, as RASTER.ground.
// Leaves when it pays to the tools, and what the maps mean to lib/block_map.hpp and lib/detail.hpp.
//
// Format of a kept one: a header of 128 bytes ("wedgescope-ground-2\n", zeros to byte 32, columns, rows, checksums of the
// files of the terrain and of the culture height (0: none), 1 if any post is valid, voids, lowest and highest height as
// doubles, zeros, XXH3 of all that); then a block map and a detail map (paged_file.hpp). It fits while names, sizes and
// times of change of the rasters' files stay the same.
// Memory while it is made: a strip of 129 rows of 4097 posts a thread (4 MiB with culture heights), and what GDAL caches; of rasters
// in wide strips also 129 rows of them all, where that fits half of the memory.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "lib/block_map.hpp"
#include "lib/detail.hpp"
#include "lib/interval.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

class Stop;
struct DataBaseParams;
struct FilePart;

class GroundMap {
public:
    ~GroundMap();
    GroundMap(const GroundMap&) = delete;
    GroundMap& operator=(const GroundMap&) = delete;

    /// `culture_height_scale`: of the culture heights, whose unscaled ones it holds.
    std::unique_ptr<BlockMap> block_map(double culture_height_scale) const;
    std::unique_ptr<DetailMap> detail_map(double culture_height_scale) const;
    /// Of the bare terrain; none if it was made for a part of it.
    const std::optional<Extremes>& terrain_extremes() const { return extremes_; }
    /// Its path; empty: for this run alone.
    const std::string& path() const { return path_; }

    struct MakeParams {
        std::string temp_folder;      ///< empty: temporary_folder()
        bool keep = false;            ///< beside the terrain; else gone with the process
        std::optional<Window> posts;  ///< ground that is asked for; none: all of it. The rest stands as void
        std::size_t memory_bytes = std::size_t{1} << 30;
        int threads = 1;
        const Stop* stop = nullptr;
        std::function<void(double)> progress;  ///< called with 0..1 from one thread at a time
    };
    /// Reads the ground. `rasters.ground` is not looked at. IoError, DataError, Interrupted; nothing is left of a kept one
    /// that is not whole.
    static std::shared_ptr<const GroundMap> make(const DataBaseParams& rasters, const MakeParams& params);
    /// The kept one that fits these rasters; null: there is none. `unfit`: says why not where one lies there.
    static std::shared_ptr<const GroundMap> kept(const DataBaseParams& rasters, std::string* unfit = nullptr);
    /// InputError if what lies where it would be kept is no ground map: not ours to replace. A map that is empty, cut, stale or
    /// damaged behind its first bytes is. IoError.
    static void check_place(const DataBaseParams& rasters);
    /// Reads all pages: false if one is damaged. Of one that is kept: a hundredth of its raster.
    /// Interrupted, IoError.
    bool whole(const Stop& stop) const;
    /// Where it is kept.
    static std::string kept_path(const DataBaseParams& rasters);

private:
    GroundMap(std::unique_ptr<FilePart> blocks, std::int64_t columns, std::int64_t rows, bool partial);

    std::unique_ptr<FilePart> part_;  ///< of the block map; the detail map's follows
    std::int64_t columns_, rows_;
    bool partial_;
    std::optional<Extremes> extremes_;
    std::string path_;
};

}  // namespace wedgescope
