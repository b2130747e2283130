// Coverage lanes: the two hot loops of coverage: spokes take a line of posts, and posts test themselves against spokes.
// Leaves where lines and spokes lie to coverage_sweep.cpp. Plain loops over contiguous arrays, compiled for several
// instruction sets.
//
// What is compared is the tangent of the elevation angle times f(m), metres a post of the spoke, which is constant along
// it. With w = (h - hs) / (1 + h / Re), theta = s / Re and the arc s = d f (1 + stretch) the exact tangent (physics
// "Effective earth") is
//     tan e = w / (Re sin theta) - tan(theta / 2)
//     f tan e = w lift - drop     lift = 1 / (d (1 + stretch) sinc theta)     drop = f tan(theta / 2)
// so neither root nor division is left for the single sample. Everything smooth (positions, lift, drop) is exact at
// knots, every 16th spoke or post, and linear between them; but for drop, whose f^2 is a parabola in m (half a line of
// posts would be lost at the sea's horizon).
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "lib/lanes.hpp"
#include "lib/quartic.hpp"

namespace wedgescope {

inline constexpr std::size_t knot_step = 16;
inline constexpr float no_horizon_f = -1e30F;  ///< of a spoke that has met no ground
/// What rounding may add to a tangent, relative to its two terms: so that what is level with its horizon is seen.
inline constexpr float level_slack = 0x1p-21F;
/// And to a position, posts.
inline constexpr float place_slack = 0x1p-19F;

/// Height above the sensor to w: float, 1 / (1 + x) as 1 - x + x^2 - x^3, off by x^4: for heights up to 1e5 m over an earth of
/// 4/3 by 2e-8.
/// What is subtracted from the sensor's height first keeps its last bits.
struct Lift {
    float sensor_m = 0, inverse_radius = 0;
    float w(float up_m) const {
        const float x = (up_m + sensor_m) * inverse_radius;
        return up_m * ((1 - x) * (1 + x * x));
    }
    /// dw / dh.
    float growth(float height_m) const { return (1 + sensor_m * inverse_radius) * (1 - 2 * height_m * inverse_radius); }
    /// The way up from `height_m` on which w grows by `more`: the root of growth d - bend d^2 + d^3 / Re^2 = more by repeated
    /// substitution, within 4 (d / Re)^3 of itself: 7e-6 at 100 km, Re 4/3 of the earth's.
    float climb(float height_m, float more) const {
        const float steep = growth(height_m),
                    bend = (1 + sensor_m * inverse_radius) * inverse_radius * (1 - 3 * height_m * inverse_radius),
                    square = inverse_radius * inverse_radius;
        const float first = more / steep, second = (more + first * first * (bend - square * first)) / steep;
        return (more + second * second * (bend - square * second)) / steep;
    }
};

/// Values at the knots of a line.
struct KnotLanes {
    double* at;     ///< spokes: raster position along the line; posts: spoke, as a number
    double* slope;  ///< posts only: m
    double* along;  ///< posts only: d (1 + stretch), so that the arc is along f(m)
    float *lift = nullptr, *drop = nullptr;
    /// Posts only: what a level ray climbs in w a line outwards is w ray + rise.
    float *ray = nullptr, *rise = nullptr;

    /// Those of posts from the i-th on.
    KnotLanes from(std::size_t i) const {
        if (!lift) return {at + i, slope + i, along + i};
        return {at + i, slope + i, along + i, lift + i, drop + i, ray + i, rise + i};
    }
};

/// One line as its knots need it.
struct LineForm {
    double distance = 0, nadir_minor = 0;
    std::array<double, 3> square{};     ///< f^2 = sum square[n] m^n
    std::array<double, 3> curvature{};  ///< f^2 / Re
};
/// sum c[n] m^n: of LineForm::square and curvature.
WEDGESCOPE_LANES_PART double quadratic(const std::array<double, 3>& c, double m) noexcept {
    return c[0] + m * (c[1] + m * c[2]);
}
/// Second-order coefficient of drop in m.
inline double bow_per_slope(const LineForm& line) { return 0.5 * line.distance * line.curvature[2]; }
/// Part of a line on which bend and stretch are one polynomial (SpokeMap::LinePiece).
struct PieceForm {
    double middle = 0, scale = 1;
    Quartic bend{}, stretch{};
};

/// What spokes first, first + 16, ... of K have on every line: k / K, f^2 / Re^2, f^2 / Re.
struct FanLanes {
    double *slope, *turn, *curvature;
};
void spoke_fan(const LineForm& line, std::int64_t spokes, std::int64_t first, std::size_t n,
               const FanLanes& out) noexcept;
/// Knots of a fan's spokes.
void spoke_knots(const LineForm& line, const PieceForm& piece, const FanLanes& fan, std::size_t n,
                 const KnotLanes& out) noexcept;
/// Where a spoke of slope k / K crosses the line: KnotLanes::at of spoke_knots(), bit for bit.
double spoke_place(const LineForm& line, const PieceForm& piece, double slope) noexcept;
/// Knots at places `minor`[n] along the line; where `lift` is null, only at, slope and along.
void post_knots(const LineForm& line, const PieceForm& piece, std::int64_t spokes, const double* minor, std::size_t n,
                const KnotLanes& out) noexcept;

/// Posts of a line: post j is at[j - origin]; readable line_margin posts beyond either end, NaN there and where it is void.
using PostLine = const float*;
/// A group of spokes may begin where a line ends, with four posts from spoke to spoke (the least of `spokes-per-post` is a
/// quarter), and what a few registers hold is loaded at once.
inline constexpr std::int64_t line_margin = 4 * static_cast<std::int64_t>(knot_step) + 40;
/// Readable beyond the last spoke of a horizon.
inline constexpr std::size_t horizon_margin = 17;

/// What spokes look at between the line behind and the one they take: nothing, where they crossed the other axis' line, or that
/// and the surface's course in between, a parabola through each cell. On the first line the course begins at the sensor.
enum class Between { nothing, crossings, course };

/// Groups of 16 spokes take a line: horizon = max(horizon, surface where they cross it, what is looked at between).
///   at, lift, drop  [groups + 1]  knots;  at_behind  positions on the line behind, but where nothing is between
///   horizon         [16 groups]
/// Knots are finite, and far within 2^31 of the origin. A crossing between two posts is void if one of them is.
struct RaiseLanes {
    std::size_t groups;
    std::int64_t origin;
    const double *at, *at_behind;
    const float *lift, *drop;
    PostLine posts, behind;
    float distance;
    float bow;  ///< of drop, per spoke squared: bow_per_slope / K^2
    float* horizon;
};
void raise_lanes(const RaiseLanes& lanes, const Lift& lift, Between between) noexcept;

/// Posts test themselves, in groups of 16.
struct TestLanes {
    std::size_t groups;
    std::int64_t origin;  ///< of the lines and of what comes out
    std::int64_t first;   ///< post of the first group's first lane
    const double* from;   ///< [groups + 1] where the knots stand: posts
    const double* at;     ///< spoke at the knots
    const float *lift, *drop, *ray, *rise;
    double nadir, distance;  ///< post below which the sensor stands; posts from it to the line
    double bow;              ///< of drop, per spoke squared
    PostLine posts, behind;
    const float* horizon;  ///< [spokes], of spoke first_spoke on
    std::int64_t first_spoke;
    std::int32_t spokes;
    bool nearest;  ///< the sensor is between the line behind and this one
    /// At least what any post's cell counts as relief: |step to the line behind| + |slope| (|step on the line| + |step on the
    /// line behind|); infinite: nothing is known.
    float most_relief_m = std::numeric_limits<float>::infinity();
    float target_m;
    std::uint8_t* state;  ///< out, by post: codes of State no_data, shadow, seen
    float* raise_m;       ///< out, by post: metres to be seen; may be null
    float* tangent;       ///< out, by post: f tan e; may be null
};
void test_lanes(const TestLanes& lanes, const Lift& lift) noexcept;

/// The least of each group's 16 horizons: horizon [16 groups], least [groups].
void least_of_groups(const float* horizon, std::size_t groups, float* least) noexcept;

inline constexpr std::size_t coverage_states = 5;
/// Adds how many posts have each state.
void count_states(const std::uint8_t* states, std::size_t n,
                  std::array<std::uint64_t, coverage_states>& counts) noexcept;
/// bytes = value[state].
void paint_mask(const std::uint8_t* states, std::size_t n, const std::array<std::uint8_t, coverage_states>& value,
                std::uint8_t* bytes) noexcept;

}  // namespace wedgescope
