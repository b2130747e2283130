// Shade: what is seen -> returned power: antenna pattern, spreading, backscatter of the class.
// Leaves what is seen to front.hpp and cells to deposit.hpp.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lib/deposit.hpp"
#include "lib/material.hpp"
#include "lib/path_loss.hpp"
#include "lib/sensor.hpp"
#include "lib/sweep.hpp"

namespace wedgescope {

/// One-way elevation pattern g_el of the depression in the antenna's frame, with floor. Source: physics "Antenna
/// patterns".
double elevation_pattern(const AntennaParams& antenna, double depression_rad);

/// g_el^2 (two-way) over the sine of the elevation, in [-1, 1], linear between entries. `error` bounds |table - exact|
/// / exact above the floor and more than 3 degrees from the vertical, found when it is built (0.0005 wanted). A pattern of points
/// is looked at where it bends too; only the two entries beside a drop do not count: an end that stands above the floor, or where a shaped one stops.
class PatternTable {
public:
    explicit PatternTable(const AntennaParams& antenna);
    const float* data() const { return values_.data(); }
    int intervals() const { return intervals_; }
    double most() const { return most_; }    ///< largest entry
    double error() const { return error_; }  ///< relative
    const std::array<PatternDrop, 2>& drops() const { return drops_; }
    /// Where a piece that is a short_rise() is too long for power_lanes(): by more than 3 % of its mean, or of a millionth of
    /// most() (a thousandth above the horizon); and the part of it by which half a percent is kept all over there.
    const PatternLobe& lobe() const { return lobe_; }
    /// Whether a piece that is a short_rise() is short enough for power_lanes() where it lies: to half a percent in lobe().
    bool straight_over(double sine0, double sine1) const;
    /// Whether a drop lies between two sines, and whether they have to do with the entries beside one.
    bool passes_drop(double sine0, double sine1) const;
    bool meets_drop(double sine0, double sine1) const;
    double at(double sine) const;
    /// How it changes there with the sine.
    double slope(double sine) const;

private:
    struct Entries {
        double first, second, part;  ///< the two beside a sine, and how far from the first to the second that lies
    };
    Entries beside(double sine) const;
    void find_lobe();
    int intervals_ = 0;
    std::vector<float> values_;
    double most_ = 0, error_ = 0;
    std::array<PatternDrop, 2> drops_;
    PatternLobe lobe_;
    std::vector<float> parts_;  ///< of a short_rise() that ends in each of equal steps of the sine; none without a lobe
};

/// K of the radar equation: P_t G_0^2 lambda^2 / ((4 pi)^3 L_s); echo = K g^2 sigma / r^4.
double radar_constant(const RadarParams& radar);

/// Pieces that are visible all the way, in lanes.
struct Shading {
    const double *horizon, *sine;       ///< in: elevation of start and end: the old horizon and the new one
    const double *range0_m, *range1_m;  ///< in: of start and end
    const double *rise, *swing;         ///< in: as StepLanes
    bool range_is_ground;               ///< in: bins count ground range
    double* power;                      ///< out, as WedgeCells::Portion, without backscatter
    float* bow;                         ///< out, as there
};
/// power = K mean(g_el^2 / r^2) (new horizon - old horizon), r at least 1 m, as the quantum takes it. The mean is to second order
/// that of a pattern going with sine^-4 which has the value and the slope of this one in the piece's middle, and of a range whose
/// inverse goes with the sine, as over any straight surface. It lies in range as
/// the surface's rise over the rays does, a parabola, and as what falls on it and comes back: echo_bow().
void power_lanes(std::size_t n, const Shading& shading, const PatternTable& pattern, double constant) noexcept;

/// The facets of neighbouring pieces, each taken straight from its start to its end and tilted across as the cell it runs
/// through is at its middle.
struct FacetLanes {
    SampleLanes from, to;          ///< in
    const float *behind, *ahead;   ///< in: of the cells, as CellLanes has them
    const double *across, *slant;  ///< in: tangent of the spoke's angle to the major axis, in metres, and its secant
    double minor_post_m;           ///< metres of a post along the lines, at the sensor
    double* variable;              ///< out: law_variable() of the sine of the local grazing angle
};
/// With z_s the rise of the surface along the spoke and z_t across it (metres a metre),
///   sin psi_l = sin alpha sqrt((1 + z_s^2) / (1 + z_s^2 + z_t^2)),
/// alpha the angle between piece and ray in the sensor's vertical plane: the facet normal times the direction to the sensor
/// (physics "Slopes"). Where a post of the cell is missing, z_t is 0. The metres of a post are those at the sensor: at 60
/// degrees of latitude 100 km away z_t is wrong by 3 %.
void facet_lanes(std::size_t n, const FacetLanes& facets) noexcept;

/// Their powers times loss.factor() of the middle of each.
void weaken_lanes(std::size_t n, const Shading& shading, const double* inverse_radius,
                  const PathLossTable& loss) noexcept;

/// How much the cosine of the elevation grows from a piece's middle to either end, over its value there; 0 of a piece that
/// stands upright below the sensor.
double cosine_growth(double sine0, double sine1) noexcept;

/// The bow of a portion by range and pattern alone: g_el^2 / r^4 over its value at the middle is 1 + bow (1 - 2 u) at part
/// u of the way, to first order. In bins of ground range (gpi-true) the echo also falls towards the nadir, as the cosine of the
/// elevation does: a step of ground is seen under d(sin e) = cos e (z_s out - up) / r^2. Left out: what weather takes on the way.
double echo_bow(double sine0, double sine1, double range0_m, double range1_m, const PatternTable& pattern,
                bool range_is_ground) noexcept;

/// The same power of one piece.
double piece_power(double sine0, double sine1, double range0_m, double range1_m, const PatternTable& pattern,
                   double constant) noexcept;

}  // namespace wedgescope
