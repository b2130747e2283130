// Surroundings: what some hundred posts round a sensor say of the ground that it looks at, once a scene: how high it stands, how
// rough it is, and where rain ends on it. Leaves what follows for spokes to engine.hpp (sampling_of) and for rain to rain_echo.hpp.
#pragma once
#include <vector>

#include "lib/engine.hpp"

namespace wedgescope {

/// ResolvedScene::clearance_m and roughness, by a few hundred posts of the sector up to 640 posts away. What the source throws.
void look_around(ResolvedScene& scene, WedgeSource& source);

/// ResolvedScene::rain_floor, by some thousand posts: in each azimuth rays are cut off by the highest ground, as the sensor sees it, on
/// their way. All round and at distances of their own, so that sector and range change nothing within them. What the source throws.
std::vector<std::vector<RainFloor>> rain_floor(const ResolvedScene& scene, WedgeSource& source);

}  // namespace wedgescope
