// Ground: finds or makes the ground map of plain rasters for a command, where it pays or is asked for.
// Leaves the map to tiles/ground_map.hpp.
#pragma once
#include <cstddef>
#include <string>

#include "lib/stop.hpp"
#include "tools/settings.hpp"

namespace wedgescope {

/// When to make a map for a run, beside using one that is kept already and keeping one where `keep-map` asks for that.
struct GroundUse {
    bool levels = false;  ///< where levels of detail are possible, so that a plain raster has those of a store
    bool many = false;    ///< many scenes: where the raster stays in memory for them
    bool whole = false;   ///< scenes from other places too: a map of all the raster, not of the ground in one's range
};

/// So many make a map of the whole raster pay.
inline constexpr std::size_t many_scenes = 4;

/// True if find_ground() would find or make one; reads nothing of the terrain. Errors as of GroundMap::check_place.
bool expects_ground(const Settings& settings, GroundUse use, const Stop& stop);

/// Sets settings.ground: null where a tile store knows its ground itself, or there is no need. `settings`: with the place
/// of the scene, or of the first of many. Returns why a map that lies beside the raster is not used; mostly
/// empty. A kept map that is damaged is made anew where `keep-map` asks for one; else it is read until the damage is met.
/// Errors as of GroundMap::check_place and make.
std::string find_ground(Settings& settings, GroundUse use, const Stop& stop);

}  // namespace wedgescope
