// CacheNeed: what it takes to hold the layers of a data base decoded, so that each block of a file is decoded once.
// For the .cpp files of this folder only. Leaves what follows from it to source_choice.hpp and raster_source.hpp.
#pragma once
#include <cmath>
#include <cstddef>
#include <vector>

#include "tiles/raster_layer.hpp"
#include "tiles/sources.hpp"
#include "tiles/tile_cache.hpp"

namespace wedgescope {

struct CacheNeed {
    double bytes = 0;            ///< of all layers
    bool fits = false;           ///< into what is granted
    std::size_t tile_bytes = 0;  ///< for the TileCache: its share; where that does not do for strips, what they take
};

/// Of layers opened with a TileCache of tile_cache_share().
inline CacheNeed cache_need(const std::vector<const RasterLayer*>& layers, const DataBaseParams& params) {
    double own = 0, by_gdal = 0;
    bool any_tiles = false, any_strips = false;
    for (const RasterLayer* layer : layers) {
        const RasterFacts& f = layer->facts();
        if (layer->fills_tile_cache()) {
            const double all = layer->all_bytes(),
                         tile = static_cast<double>(f.block_columns * f.block_rows * f.type_bytes);
            own += all + all / tile * TileCache::entry_bytes;
            any_tiles = true;
            any_strips |= layer->decoded_a_post() > RasterLayer::most_decoded_a_post;
        } else if (layer->fills_gdal_cache()) {
            by_gdal += layer->all_bytes();
        }
    }
    CacheNeed need;
    need.bytes = own + by_gdal;
    const std::size_t share = tile_cache_share(params.cache_bytes);
    need.tile_bytes = share;
    if (any_strips && own > static_cast<double>(share) && own <= static_cast<double>(share + params.more_cache_bytes))
        need.tile_bytes = static_cast<std::size_t>(std::ceil(own));
    // Of what GDAL decodes each thread's handle holds its own.
    const std::size_t left = any_tiles ? params.cache_bytes - share : params.cache_bytes;
    need.fits = own <= static_cast<double>(need.tile_bytes) && by_gdal * params.threads <= static_cast<double>(left);
    return need;
}

}  // namespace wedgescope
