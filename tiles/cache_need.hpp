// CacheNeed: what it takes to hold the layers of a data base decoded, so that each block of a file is decoded once.
// For the .cpp files of this folder only. Leaves what follows from it to source_choice.hpp and raster_source.hpp.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
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

/// How a layer is cut into tiles.
struct Tiling {
    double columns, rows, wide, high, value_bytes;
};
inline Tiling tiling_of(const RasterFacts& f) {
    return {static_cast<double>(f.columns), static_cast<double>(f.rows), static_cast<double>(f.block_columns),
            static_cast<double>(f.block_rows), static_cast<double>(f.type_bytes)};
}
/// Decoded tiles under the strips of posts that coverage and simulate ask for next, all round the sensor. `columns_a_post`: of the layer.
inline double strip_bytes(const Tiling& tiling, double columns_a_post, double rows_a_post) {
    constexpr double strip = 256, sides = 2, spare = 1.25;  // posts; two strips each way
    const double wide = std::max(tiling.wide, strip * std::fabs(columns_a_post)),
                 high = std::max(tiling.high, strip * std::fabs(rows_a_post)),
                 tile = tiling.wide * tiling.high * tiling.value_bytes;
    return sides * spare * tiling.value_bytes * (1 + TileCache::entry_bytes / tile) *
           (tiling.columns * high + tiling.rows * wide);
}

/// Of layers of packed tiles that are wider and higher than a strip: each is unpacked again for every strip that it lies under, as
/// long as not all tiles under the strips can be held. True where they cannot. `range_m`: how far the scene looks, where it says so;
/// `bytes`: what they would take.
inline bool unpacks_again(const std::vector<const RasterLayer*>& layers, const DataBaseParams& params,
                          std::optional<double> range_m, double& bytes) {
    constexpr std::int64_t strip = 256;
    double tiles = 0, by_gdal = 0;
    for (const RasterLayer* layer : layers) {
        const RasterFacts& f = layer->facts();
        // Of other formats that GDAL reads it does not always say.
        const bool packed = f.packed() || (f.driver == "VRT" ? f.behind_packed : layer->fills_gdal_cache());
        if (!packed) continue;
        if (std::min(f.decoded_columns(), f.decoded_rows()) <= strip) continue;
        Tiling tiling = tiling_of(f);
        tiling.wide = static_cast<double>(f.decoded_columns());
        tiling.high = static_cast<double>(f.decoded_rows());
        if (range_m) {
            constexpr double least_m_a_degree = 111320.0 / 2;  // up to 60 north and south
            const double unit_m = f.geographic ? least_m_a_degree : f.metres_per_unit;
            tiling.columns = std::min(tiling.columns, 2 * *range_m / (std::fabs(f.step_x) * unit_m) + tiling.wide);
            tiling.rows = std::min(tiling.rows, 2 * *range_m / (std::fabs(f.step_y) * unit_m) + tiling.high);
        }
        const double within = (tiling.columns + tiling.wide) * (tiling.rows + tiling.high) * tiling.value_bytes,
                     ring = std::min({layer->all_bytes(), within, strip_bytes(tiling, 1, 1)});
        if (layer->fills_tile_cache())
            tiles += ring;
        else if (layer->fills_gdal_cache())
            by_gdal += ring * params.threads;
    }
    bytes = tiles + by_gdal;
    const std::size_t share = tile_cache_share(params.cache_bytes);
    const double most = params.by_strips ? static_cast<double>(share + params.more_cache_bytes)
                                         : static_cast<double>(share),
                 left = static_cast<double>(tiles > 0 ? params.cache_bytes - share : params.cache_bytes);
    return tiles > most || by_gdal > left;
}

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
