// Rain echo: what the rain itself sends back into each range bin.
// Leaves what rain does to the echoes behind it to path_loss.hpp, drops to rain.hpp, beam and pulse to beam.hpp.
//
// Rain of one rate fills the layer below the rain's top, all round, down to the floor that is given or to a level surface at the
// reference height, which hides what lies beyond its horizon, but for what is above the ray that grazes it [P].
#pragma once
#include <span>
#include <vector>

#include "lib/earth.hpp"
#include "lib/path_loss.hpp"
#include "lib/rain.hpp"
#include "lib/sensor.hpp"
#include "lib/shade.hpp"

namespace wedgescope {

/// The height that rain reaches down to at all: the floor's least, or that of the level surface where there is none.
double lowest_rain_m(const std::vector<RainFloor>& floor, double reference_m);

struct RainEchoParams {
    RadarParams radar{};
    Earth earth{};
    double sensor_m = 0;      ///< above sea level, -1000 to 1e6
    double reference_m = 0;   ///< level surface below the rain
    double most_range_m = 0;  ///< slant, above 0
    /// In place of that surface and its horizon, by range ascending, straight lines between; empty: there is none.
    std::vector<RainFloor> floor{};
};

/// The rain's echo before beam and pulse, the same in every azimuth: with K of radar_constant(), eta of
/// rain_cross_section_per_m() (over the cancellation where the polarisation is circular) and y the sine of the elevation e,
///   p(r) = K eta / r^2  integral of g_el(e)^2 / (L_a(r, y) max(cos e, 1/2)) dy     W m^-1 rad^-1
/// over what is wet at range r: watts a metre of range and radian across the beam, which the fan beam widens by 1 / cos e (at
/// most 2). Rain nearer than c tau/2, lit while the pulse is still being sent, is left out [P].
/// Relative error below 0.2 % against the integral with the exact loss and pattern, beside that of the loss table itself.
/// Source: physics "Rain volume echo".
class RainEcho {
public:
    /// `loss`: of the same weather, earth and sensor; a table whose highest point is below the rain's top takes the gases of
    /// the way to rain above it as to that height. `pattern`: of the radar's antenna. InputError as validate() of the radar, or
    /// for a range or a height outside what is accepted.
    RainEcho(const Weather& weather, const PathLossTable& loss, const PatternTable& pattern,
             const RainEchoParams& params);

    /// p(r), W m^-1 rad^-1, 0 beyond the largest range.
    double density_w_m_rad(double range_m) const;
    /// Watts of the cells of one azimuth bin, before the beam widens them: cell j is the integral of p from slant range
    /// edges_m[j] to edges_m[j + 1] (ascending) times the bin's width.
    std::vector<float> cells_w(std::span<const double> edges_m, double azimuth_step_rad) const;

private:
    double between_w_rad(double near_m, double far_m) const;  // the integral of p

    std::vector<double> range_m_;      // knots, from c tau / 2 on
    std::vector<double> wet_w_m_rad_;  // p r^2 at the knots, linear between
};

}  // namespace wedgescope
