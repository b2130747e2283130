// Cull: bounds on what ground can be seen, so that blocks below the horizon need not be read or swept, nor spokes sampled
// on lines where they stay below theirs.
// Leaves which spokes cross a block to front.hpp and the bounds of the terrain to block_map.hpp.
#pragma once
#include <algorithm>
#include <cmath>

#include "lib/sample.hpp"
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

/// Of a bound for several spokes by the least of their inverse radii: the least curvature shows the most ground; what it
/// changes beside is below 4e-6.
inline constexpr double together_margin = 1e-5;

/// Spokes from one line to the next: raster index along the lines and arc there; what they have seen so far.
struct PassingLanes {
    static constexpr std::size_t most = 64;
    const double *minor0, *minor1, *arc0_m, *arc1_m;
    const double *mode, *horizon;  ///< SpokeMode; sine
    const double* inverse_radius;
};
/// Are n spokes of these SpokeModes all hidden or done?
bool none_sees(std::size_t n, const double* mode) noexcept;
/// Of n spokes that none_sees() of, n <= PassingLanes::most: does the ground between two neighbouring lines stay below
/// the horizons of those that are not done: the highest post of the cells that a spoke may run through, wherever in these
/// it stands? False where one of these posts is void, or a line's window does not reach from the first spoke to the last.
/// A handful of operations a spoke, no root, no division; refuses what is too near to say.
bool pass_hidden(std::size_t n, double sensor_m, const LinePosts& behind, const LinePosts& ahead,
                 const PassingLanes& lanes) noexcept;

}  // namespace wedgescope
