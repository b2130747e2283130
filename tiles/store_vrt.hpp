// The VRT of a store layer: its sheets as one raster for any GDAL program.
// For the .cpp files of this folder only. We read sheets ourselves (store_layer.hpp).
#pragma once
#include <string>

#include "tiles/store_manifest.hpp"

namespace wedgescope {

/// To be written beside the folder of the sheets. `scale`: what others are to multiply values by too (culture-height-scale).
std::string vrt_text(const StoreLayerEntry& layer, double scale = 1);
/// Is this the same VRT with statistics or histograms that a GDAL program put into it, but for how that writes numbers and the
/// CRS?
bool is_vrt_of(const std::string& words, const StoreLayerEntry& layer, double scale = 1);

}  // namespace wedgescope
