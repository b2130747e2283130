// Course: what of a piece of surface comes up over the horizon of its spoke, one piece at a time and many in lanes.
// Leaves the samples at its ends to sweep.hpp and what becomes of the spoke to front.hpp.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "lib/lanes.hpp"
#include "lib/sweep.hpp"

namespace wedgescope {

/// Slant range at which the straight ray of elevation `sine` passes over arc s; infinite if it never does.
///   r = (Re + hs) sin(theta) / cos(e + theta)
inline double ray_range_m(double sensor_m, double arc_m, double sine, double inverse_radius) {
    const double theta = arc_m * inverse_radius, x = theta * theta;
    const double sinc = 1 - x * (1.0 / 6) * (1 - x * (1.0 / 20) * (1 - x * (1.0 / 42)));
    const double versine = 1 - x * (1.0 / 12) * (1 - x * (1.0 / 30) * (1 - x * (1.0 / 56)));
    const double cosine = std::sqrt(1 - sine * sine);
    const double below = cosine * (1 - 0.5 * x * versine) - sine * theta * sinc;
    const double range = (1 + sensor_m * inverse_radius) * arc_m * sinc / below;
    return below > 0 ? range : std::numeric_limits<double>::infinity();
}

/// The part of a piece that rises above the old horizon: from `begin` to `end` of the way (0..1); it then falls behind
/// itself (`hides`) or goes on to be seen at the piece's end.
struct Course {
    bool seen = false;
    double begin = 0, end = 1;
    bool hides = false;
    double bow = 0;  ///< of that part, as WedgeCells::Portion
};
/// Of a piece from (up0, out0) to (up1, out1) with `bump_m` over its middle, against the ray of elevation `sine`.
/// `from_ray`: the piece starts on the ray.
Course course(double sine, double up0, double out0, double up1, double out1, double bump_m, bool from_ray);

/// Pieces whose spokes' horizons may cut them, closed up: the first n of each column.
struct Cuts {
    static constexpr std::size_t most = 64;
    using Column = std::array<double, whole_registers(most)>;
    /// In: the horizon's sine, and 1 where the spoke is in view and so the piece starts on it, else 0.
    alignas(64) Column horizon, on_horizon;
    /// In: its ends as SampleLanes, its bump as StepLanes; 1 / effective radius.
    Column arc0, up0, out0, range0, x0, arc1, up1, out1, range1, sine1, x1, bump_m, inverse_radius;
    Column hidden_from;  ///< in: arc from where the spoke is hidden up to this piece's `begin`
    Column seen, hides;  ///< out: 0 or 1, as Course
    Column begin, end, bow;
    /// Out, where it comes out (0: there, the horizon is its sine) and where it is the highest in view.
    Column range_out, x_out, range_top, sine_top, x_top;
    Column shadow0, shadow1;  ///< out: range coordinates of the ray of the horizon where it is hidden
    /// Out: 1 where that part lies at one_range, runs in a straight_range that does not turn, meets no drop of the pattern and does
    /// not begin below the sensor, else 0.
    Column plain;
};
/// As course(), of n <= Cuts::most pieces, and where their ends lie. All columns must hold numbers, of whatever value, up to whole
/// registers. The same bits on every target.
void cut_pieces(std::size_t n, const StepScene& scene, Cuts& cuts) noexcept;

}  // namespace wedgescope
