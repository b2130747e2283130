// Model inputs: those that models of several families share, and what they amount to.
// Leaves the models to models_*.cpp.
#pragma once
#include <vector>

#include "lib/earth.hpp"
#include "lib/sensor.hpp"
#include "tools/model.hpp"

namespace wedgescope {

/// One list after the other.
std::vector<ModelInput> joined(std::vector<ModelInput> first, const std::vector<ModelInput>& more);
/// A height in metres above sea level.
ModelInput height_input(const char* name, const char* meaning);
/// `k`, a number or flat, 4/3 by default.
ModelInput earth_factor_input();
/// `R`, the radius that k multiplies.
ModelInput earth_radius_input();
/// Of `k` and `R`.
Earth earth_of(const Arguments& arguments);

/// `antenna`, `beta_0`, `theta_el`, `p`, `tilt`, `g_floor`.
std::vector<ModelInput> elevation_pattern_inputs();
/// Of these. NoSolution where a shaped law is to have its knee at or above the horizontal.
AntennaParams elevation_antenna(const Arguments& arguments);
/// `pattern` and `theta_3`, and the antenna of these.
std::vector<ModelInput> azimuth_pattern_inputs();
AntennaParams azimuth_antenna(const Arguments& arguments);

}  // namespace wedgescope
