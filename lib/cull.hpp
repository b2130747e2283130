// Cull: bounds on what ground can be seen, so that blocks below the horizon need not be read or swept.
// Leaves which spokes cross a block to front.hpp and the bounds of the terrain to block_map.hpp.
#pragma once
#include <algorithm>
#include <cmath>

#include "lib/sweep.hpp"

namespace wedgescope {

/// No ground of at most `height_m` at arcs from `near_arc_m` to `far_arc_m` stands higher (sine of the elevation) over
/// an earth of this curvature; nor do the straight pieces between its samples, which run below the curved ground. The
/// margin covers rounding: 1e-9 is 0.4 mm at 400 km. Level ground rises in view up to where the sight line touches it,
/// at cos(theta) = (Re + h) / (Re + hs), elevation -theta, and sinks beyond.
inline double highest_sine(double sensor_m, double height_m, double near_arc_m, double far_arc_m,
                           double inverse_radius) {
    constexpr double margin = 1e-9;
    const double cosine = (1 + height_m * inverse_radius) / (1 + sensor_m * inverse_radius);
    const auto at = [&](double arc_m) { return sight_line(sensor_m, arc_m, height_m, inverse_radius).sine + margin; };
    if (height_m >= sensor_m) return near_arc_m > 0 ? at(near_arc_m) : 1;
    const double far = far_arc_m * inverse_radius, near = near_arc_m * inverse_radius;
    if (1 - 0.5 * far * far >= cosine) return at(far_arc_m);                                      // all before it
    if (1 - 0.5 * near * near * (1 - near * near * (1.0 / 12)) <= cosine) return at(near_arc_m);  // all behind it
    return margin - std::sqrt(std::max(0.0, 1 - cosine * cosine));
}

}  // namespace wedgescope
