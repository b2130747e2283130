// Ground: finds or makes the ground map of plain rasters for a command, where it pays or is asked for.
// Leaves the map to tiles/ground_map.hpp.
#pragma once
#include <string>

#include "lib/stop.hpp"
#include "tools/settings.hpp"

namespace wedgescope {

/// What to do for the scenes of a command, beside using a map that is kept already.
enum class GroundUse {
    look,  ///< nothing
    keep,  ///< make one and keep it, where `keep-map` asks for that
    levels,  ///< and make one for this run where levels of detail are possible, so that a plain raster has those of a store
};

/// Sets settings.ground: null where a tile store knows its ground itself, or there is no need. For `levels`, of a single
/// scene in its place and range, or where `all` of the ground will be asked for of all the raster. Returns why a map that
/// lies beside the raster is not used; mostly empty. Errors as of GroundMap::make.
std::string find_ground(Settings& settings, GroundUse use, bool all, const Stop& stop);

}  // namespace wedgescope
