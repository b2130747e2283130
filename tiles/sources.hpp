// Sources: the WedgeSources. Direct: windows of rasters, read near to far as the engine asks.
// Leaves the sequential partition with spill to partition.hpp (to come).
//
// Memory: a source holds one GDAL handle per reading thread and layer, and GDAL's own block cache, whose size the
// session sets; chunks belong to whoever asked for them. While it reads, load() takes up to 16 MiB beside its chunk.
#pragma once
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "lib/material.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

struct DataBaseParams {
    std::string dem;
    std::string culture;         ///< empty: none
    std::string culture_height;  ///< empty: none
    double culture_height_scale = 1;
    std::optional<Legend> legend;  ///< needed with culture
    ClassId default_class = 4;     ///< no culture, or its no-data
    std::size_t cache_bytes = 0;   ///< what the session grants GDAL's block cache
};

/// Opens and checks everything that can be checked without reading posts. DataError or IoError naming the file.
std::unique_ptr<WedgeSource> open_direct_source(const DataBaseParams& params);

}  // namespace wedgescope
