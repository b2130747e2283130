// Sweep: what is seen along a spoke: elevation of samples and which of them raise the horizon.
// Leaves what comes out between samples to course.hpp, the state of the spokes to front.hpp and power to shade.hpp.
//
// Elevations are kept as their sine: monotone in the tangent, finite at the nadir, and what the deposit telescopes.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "lib/sample.hpp"

namespace wedgescope {

/// A point in the sensor's vertical plane: `up_m` above and `out_m` along its local horizontal.
///   up  = (h - hs) - q (Re + h)    out = (Re + h) sin(theta)    theta = s / Re, q = 2 sin^2(theta / 2)
/// without cancellation (physics "Effective earth"), by series in theta^2 (error < 1e-15 relative for theta <= 0.15;
/// arcs beyond 0.3 are refused by resolve()). Flat: inverse radius 0.
struct SightLine {
    double up_m, out_m, range_m, sine;
};

/// `near`: theta at most near_theta, where two terms do (error < 2e-13 relative).
inline constexpr double near_theta = 0.03;
template <bool near = false>
inline SightLine sight_line(double sensor_m, double arc_m, double height_m, double inverse_radius) {
    const double theta = arc_m * inverse_radius;
    const double x = theta * theta;
    const double more_sinc = near ? 1 : 1 - x * (1.0 / 42) * (1 - x * (1.0 / 72)),
                 more_versine = near ? 1 : 1 - x * (1.0 / 56) * (1 - x * (1.0 / 90));
    const double sinc = 1 - x * (1.0 / 6) * (1 - x * (1.0 / 20) * more_sinc);
    const double versine = 1 - x * (1.0 / 12) * (1 - x * (1.0 / 30) * more_versine);
    const double growth = 1 + height_m * inverse_radius;
    SightLine p;
    p.out_m = arc_m * sinc * growth;
    p.up_m = (height_m - sensor_m) - 0.5 * arc_m * theta * versine * growth;
    p.range_m = std::sqrt(p.up_m * p.up_m + p.out_m * p.out_m);
    p.sine = p.up_m / p.range_m;
    return p;
}

/// What a spoke does between two samples; numbers, so that they run in lanes beside sines.
using SpokeMode = double;
inline constexpr SpokeMode mode_hidden = 0, mode_visible = 1, mode_gap = 2, mode_done = 3;

/// The last sample of a run of spokes, or the next one.
struct SampleLanes {
    double *part,
        *minor;  ///< of the way from the line behind (0) to the line ahead (1); raster position along the lines
    double *arc_m, *height_m;
    double *up_m, *out_m, *range_m, *sine;
    double* x;  ///< range coordinate: slant range (arc for gpi-true) in bins
};

/// Whether the sine of a piece's elevation rises so little, up to `sine`, that the antenna's pattern is all but straight over it:
/// by a tenth of the sum of its size and 0.05. A pattern that goes with sine^-4 is then a fifth off its middle at either end, more towards the
/// horizon. A tower's front rises more, seen from a few times its height; a cliff may pass the sensor by.
inline constexpr double most_sine_part = 0.1, most_sine_offset = 0.05;
inline bool short_rise(double sine_step, double sine, double part = most_sine_part) {
    return sine_step <= part * ((sine < 0 ? -sine : sine) + most_sine_offset);
}

/// Sines of elevation between which the antenna's pattern bends more than over a short_rise() is all but straight, and the part
/// of a short_rise() that is short enough there. Infinite: nowhere.
struct PatternLobe {
    double low = std::numeric_limits<double>::infinity(), high = low, part = most_sine_part;
};
/// Whether a piece between two sines of elevation is short where that counts.
inline bool short_in_lobe(double sine0, double sine1, double low, double high, double part) {
    return (sine0 >= high) | (sine1 <= low) | short_rise(sine1 - sine0, sine1, part);
}

/// Whether the sine of the incidence on level ground, which is the cosine of the elevation, changes by at most `most` between two
/// sines of elevation, or they are so far from the vertical that no lobe of a law lies there.
inline constexpr double upright_sine = -0.7;
inline bool short_turn(double sine0, double sine1, double most) {
    if (sine0 > upright_sine) return true;
    const double square0 = 1 - sine0 * sine0, square1 = 1 - sine1 * sine1,
                 turned = std::sqrt(square1 > 0 ? square1 : 0.0) - std::sqrt(square0 > 0 ? square0 : 0.0);
    return (turned < 0 ? -turned : turned) <= most;
}

/// Where the antenna's pattern drops at once, as a sine of elevation, and the entries of its table on either side: between them
/// that is not to be had by interpolation. Infinite: nowhere.
struct PatternDrop {
    double sine = std::numeric_limits<double>::infinity(), low = sine, high = sine;
};
/// Whether a piece between two sines of elevation lies between the entries in part.
inline bool meets_drop(double sine0, double sine1, double low, double high) { return (sine0 < high) & (sine1 > low); }

/// Whether a piece that rises to `sine` may be taken at its middle, and what it returns laid out in range to first order: the ranges
/// of its ends differ by at most an eighth, and it is a short_rise(). Ranges below a metre count as a metre.
inline constexpr double most_range_ratio = 1.125;
inline bool one_range(double range0_m, double range1_m, double sine_step, double sine) {
    const double a = range0_m > 1 ? range0_m : 1, b = range1_m > 1 ? range1_m : 1;
    return (a < b ? b : a) <= most_range_ratio * (a < b ? a : b) && short_rise(sine_step, sine);
}

/// Whether a piece's bump moves its middle in range by a tenth of a bin at the most from half-way between its ends, as it
/// does to a tower's flank seen from above.
inline constexpr double most_range_bump = 0.1;
inline bool straight_range(double bump_m, double sine, double bins_per_metre) {
    const double moved = bump_m * sine * bins_per_metre;
    return (moved < 0 ? -moved : moved) <= most_range_bump;
}

/// Whether a piece seen from above, all but across the line of sight, is not laid out in range by its ends: the ranges within it
/// turn round near by, where the first ground below the sensor is met, and what it returns crowds there. `across`: of its ends,
/// up1 out0 - up0 out1, so that its middle lies across^2 / (8 r^3) nearer than half-way; its bump moves it too. `way_bins`: between
/// the ranges of its ends.
inline constexpr double turning_sine = -0.5, most_turned_part = 0.1, most_turned_bins = 0.002;
inline bool turns_in_range(double across, double range_m, double bump_m, double sine, double way_bins,
                           double bins_per_metre) {
    // All times 8 r^3.
    const double scale = 8 * (range_m * range_m * range_m),
                 sum = (bump_m * sine * scale - across * across) * bins_per_metre, moved = sum < 0 ? -sum : sum,
                 way = way_bins < 0 ? -way_bins : way_bins;
    return (sine < turning_sine) & (moved > most_turned_part * (way * scale)) & (moved > most_turned_bins * scale);
}

/// What the steps of a scene share.
struct StepScene {
    double sensor_m = 0;
    double bins_per_metre = 0;
    bool range_is_ground = false;
    bool exact_course = false;  ///< else pieces are straight
    double most_theta = 0;      ///< no spoke is followed farther
    double most_rise = most_sine_part;  ///< of a short_rise(); 0: none is, each piece that rises is a change
    std::array<PatternDrop, 2> drops{};  ///< a piece that has to do with one is a change
    PatternLobe lobe{};                  ///< one too long for it too
};
/// Samples on one line, where their minor and arc_m say: height_m and what follows from it, exactly as a step there has it.
///   cell[n]            in: raster index along the line of the post at or before each
///   posts[2 n]         in: heights of that post and of the next, metres; NaN: none
///   inverse_radius[n]  in
void sight_lanes(std::size_t n, const StepScene& scene, const double* cell, const float* posts,
                 const double* inverse_radius, const SampleLanes& samples) noexcept;

/// Where the next samples lie: on the other axis' lines (a whole number along the line, or where the last sample was)
/// or on the line ahead.
enum class StepTo { crossing, line };

/// Spokes that step from their last samples to the next ones.
struct StepLanes {
    SampleLanes from, to;                         ///< in; of `to` only part, minor, arc_m in, the others out
    CellLanes posts;                              ///< in: round the pieces
    const double* mode;                           ///< in: SpokeMode
    const double *inverse_radius, *void_horizon;  ///< in
    double* horizon;                              ///< in, out: sine
    double *seen_least, *seen_most;               ///< in, out: range coordinates of the visible run so far
    /// Out: how far the surface stands above the straight piece half-way: along a straight way through a cell it is a
    /// parabola, lin(u) + bump 4 u (1 - u). 0 where a post of the cell is missing.
    double* bump_m;
    /// Out: how the piece rises over the ray to its start, up1 out0 - up0 out1, and what its bump adds, 4 bump out0.
    double *rise, *swing;
    double* sine0;  ///< out: the old horizon
    double* code;   ///< out: what the sample does to its spoke, below
};
/// code: 0 nothing (stays hidden, or no sample here), 1 it raises the horizon of a visible spoke (done here: horizon,
/// seen_least, seen_most), 2 something changes: see Front. A visible piece is plain (1) if its course rises all the way
/// (|4 bump| at most what it rises over the ray of the horizon), lies at one_range, runs in a straight_range that does not turn,
/// meets no drop of the pattern and does not begin below the sensor; a hidden one stays hidden if not even its bump can reach
/// the horizon.
struct Rises {
    int plain = 0, changes = 0;  ///< how many have code 1, and 2
};
Rises step_lanes(StepTo target, std::size_t n, const StepScene& scene, const StepLanes& lanes) noexcept;

/// Spokes' plain pieces (code 1) up to the other axis' lines, `first`, and from there to the line ahead, `second`. Where a spoke
/// has both they become one, with what both rise and the middle of that where theirs is, if there is such a parabola: as `second`,
/// with code 0 for the first.
struct JoinLanes {
    struct Part {
        double *sine0, *rise, *swing, *code;  ///< as StepLanes
    };
    Part first, second;                 ///< in, out; of the first only code is written
    const double *range0, *x0;          ///< in: where the first ones start
    const double *range_m, *x;          ///< in: where they end and the second ones start
    const double *range1, *sine1, *x1;  ///< in: where those end
    double *start_range, *start_x;      ///< out: where the second ones, joined or not, start
    PatternLobe lobe{};                 ///< in
};
/// How many of `first` stay alone.
int join_lanes(std::size_t n, const JoinLanes& lanes) noexcept;

}  // namespace wedgescope
