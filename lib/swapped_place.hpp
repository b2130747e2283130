// A sensor's latitude and longitude given the wrong way round, for the end of messages that say it is nowhere near the
// terrain. Leaves the messages to their places.
#pragma once
#include "lib/scene.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

/// " (LAT,LON swapped?)" where the place lies outside of the raster, and would lie in it with the two swapped; else "".
const char* swapped_hint(const PlatformParams& platform, const DataBase& data_base);

}  // namespace wedgescope
