// CacheNeed: what it takes to hold the layers of a data base decoded, so that each block of a file is decoded once.
// For the .cpp files of this folder only. Leaves what follows from it to source_choice.hpp and raster_source.hpp.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "tiles/raster_layer.hpp"
#include "tiles/sources.hpp"
#include "tiles/tile_cache.hpp"

namespace wedgescope {

struct CacheNeed {
    double bytes = 0;   ///< of all layers that are kept decoded, each once
    bool fits = false;  ///< into what is granted; of layers read as they are those of which windows read too much
    std::size_t tile_bytes = 0;  ///< for the TileCache: its share; more where that lets it hold all strips
};

/// Of layers opened with a TileCache of tile_cache_share(). `class_bytes`: what it shall hold of classes too.
inline CacheNeed cache_need(const std::vector<const RasterLayer*>& layers, const DataBaseParams& params,
                            double class_bytes = 0) {
    double tiles = 0, strips = 0, by_gdal = 0, as_is = 0;
    for (const RasterLayer* layer : layers) {
        const RasterFacts& f = layer->facts();
        const double all = layer->all_bytes();
        if (layer->fills_tile_cache()) {
            // What spans the raster each window along a column asks for anew.
            const double block = static_cast<double>(f.block_columns * f.block_rows * f.type_bytes);
            (f.block_columns >= f.columns ? strips : tiles) += all + all / block * TileCache::entry_bytes;
        } else if (layer->fills_gdal_cache()) {
            by_gdal += all;
        } else if (layer->decoded_a_post() > RasterLayer::most_decoded_a_post) {
            as_is += all;
        }
    }
    CacheNeed need;
    need.bytes = tiles + strips + by_gdal;
    const std::size_t share = tile_cache_share(params.cache_bytes);
    need.tile_bytes = share;
    const auto granted = static_cast<double>(share), most = granted + static_cast<double>(params.more_cache_bytes),
               wanted = strips + std::min(tiles, granted);
    if (strips > 0 && wanted <= most)
        need.tile_bytes = std::max(share, static_cast<std::size_t>(std::ceil(std::min(most, wanted + class_bytes))));
    // Of what GDAL decodes each thread's handle holds its own.
    const std::size_t left = tiles + strips > 0 ? params.cache_bytes - share : params.cache_bytes;
    need.fits = tiles + strips <= static_cast<double>(need.tile_bytes) &&
                by_gdal * params.threads <= static_cast<double>(left) &&
                as_is <= static_cast<double>(params.cache_bytes);
    return need;
}

}  // namespace wedgescope
