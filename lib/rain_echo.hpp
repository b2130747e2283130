// Rain echo: what the rain itself sends back into each range bin, as it reaches the receiver.
// Leaves what rain does to the echoes behind it to path_loss.hpp and drops to rain.hpp.
//
// Rain of one rate fills the layer between a level surface at the reference height and the rain's top, all round; hills
// do not hide it, the level surface does (beyond its horizon only rain above the ray that grazes it is seen) [P].
#pragma once
#include <vector>

#include "lib/earth.hpp"
#include "lib/interval.hpp"
#include "lib/path_loss.hpp"
#include "lib/sensor.hpp"
#include "lib/shade.hpp"

namespace wedgescope {

struct RainEchoParams {
    RadarParams radar{};
    Earth earth{};
    double sensor_m = 0;      ///< above sea level, -1000 to 1e6
    double reference_m = 0;   ///< level surface below the rain
    double most_range_m = 0;  ///< slant, above 0
    bool circular = false;    ///< polarisation: less by rain_cancellation()
};

/// The rain's echo after beam and pulse, the same in every azimuth: with K of radar_constant(), eta of
/// rain_cross_section_per_m() (over the cancellation where circular) and y the sine of the elevation e,
///   p(r) = K eta theta_2 / r^2  integral of g_el(e)^2 / (L_a(r, y) max(cos e, 1/2)) dy     watts a metre of range
/// over what is wet at range r; theta_2 = integral of the two-way azimuth pattern, as the beam of a row sums it, which the
/// fan beam widens by 1 / cos e (at most 2). Echoes reach the receiver as the pulse's sum, P(r) = integral of p over
/// (r - c tau/2, r]; rain nearer than c tau/2, lit while the pulse is still being sent, is left out [P].
/// Relative error below 0.2 % against the integral with the exact loss and pattern, beside that of the loss table itself.
/// Source: physics "Rain volume echo".
class RainEcho {
public:
    /// `loss`: of the same weather, earth and sensor; a table whose highest point is below the rain's top takes the gases of
    /// the way to rain above it as to that height. `pattern`: of the radar's antenna. InputError as validate() of the radar, or
    /// for a range or a height outside what is accepted.
    RainEcho(const Weather& weather, const PathLossTable& loss, const PatternTable& pattern,
             const RainEchoParams& params);

    /// P(r): watts at the slant range `range_m`, 0 beyond the largest range.
    double power_w(double range_m) const;
    /// Watts of a run of slant range bins, as the power image holds them: cell j is the mean of P over the bin. With PLE off
    /// the same total falls into the own bin.
    std::vector<double> bins_w(Interval range_bins, double range_bin_m) const;
    /// p(r), watts a metre.
    double density_w_m(double range_m) const;

private:
    double between_w(double near_m, double far_m) const;  // the integral of p

    double pulse_extent_m_ = 0;
    bool pulse_length_error_ = true;
    std::vector<double> range_m_;  // knots, from c tau / 2 on
    std::vector<double> wet_w_m_;  // p r^2 at the knots, linear between
};

}  // namespace wedgescope
