// Directivity: how the echo of what is built depends on the azimuth that it is looked at from.
// Leaves which class has which to material.hpp.
#pragma once
#include "lib/angle.hpp"

namespace wedgescope {

enum class Directivity {
    omni,  ///< alike from everywhere
    uni,   ///< one reflecting side
    bi,    ///< two, back to back
};

inline constexpr double directivity_exponent = 4;  ///< m
inline constexpr double least_directivity = 0.01;  ///< D_min

/// Factor on the radar cross-section, in [D_min, 1]; with D the azimuth from the feature to the radar less that of the
/// outward normal:
///   omni 1; uni max(D_min, max(0, cos D)^m); bi max(D_min, |cos D|^m).
/// Any azimuths, whole turns do not count. Source: physics 7.2 [meaning V1; law P].
double directivity_gain(Directivity directivity, Angle to_radar, Angle normal);

/// omni, uni, bi.
const char* word(Directivity directivity);

}  // namespace wedgescope
