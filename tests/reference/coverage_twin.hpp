// The plain twin of coverage's two hot loops: one spoke, one post after the other, in the same single precision, so that
// it must give the same bits as the lanes of lib/coverage_lanes.cpp on every instruction set. What each number is:
// lib/coverage_lanes.hpp.
#pragma once
#include <cmath>
#include <limits>
#include <utility>

#include "lib/coverage_lanes.hpp"

namespace wedgescope::twin {

inline float chosen(bool holds, float a, float b) { return holds ? a : b; }

/// How high a spoke's tangent rises inside a cell, between two places that many lines back; NaN where the surface's course is
/// no hill. `z`, `zb`: its left posts on the line and on the one behind; `part`, `across`: posts from there to where the spoke
/// crosses the line, and to there from where it crossed the one behind.
inline float highest_inside(const float* z, const float* zb, float part, float across, float from, float to,
                            float lifts, float drops, float distance, const Lift& lift) {
    const float ahead = z[1] - z[0], twist = ahead - (zb[1] - zb[0]);
    const float up = (z[0] - lift.sensor_m) + part * ahead, step = (zb[0] - z[0]) - part * twist - across * ahead,
                bend = across * twist;
    const float more = (distance * step + up) / bend, sum = distance * distance + more, square = sum > 0 ? sum : 0.0F;
    const float top = 0 - more / (distance + std::sqrt(square)), tau = top > from ? (top < to ? top : to) : from;
    const auto higher = [](float a, float b) { return a > b ? a : b; };
    const float posts = higher(higher(z[0], z[1]), higher(zb[0], zb[1])) - lift.sensor_m;
    const float found = up + tau * (step + tau * bend), there = found < posts ? found : posts;
    const float nearer = 1 - tau * (1 / distance), place = part - tau * across;
    if (!(bend < 0 && place > -0x1p-10F && place < 1 + 0x1p-10F)) return std::numeric_limits<float>::quiet_NaN();
    return lift.w(there) * lifts / nearer - drops * nearer;
}

template <Between between_lines>
inline void raise(const RaiseLanes& lanes, const Lift& lift) noexcept {
    constexpr bool cross = between_lines != Between::nothing, course = between_lines == Between::course;
    const float* posts = lanes.posts;
    const float* behind = lanes.behind;
    float* horizon = lanes.horizon;
    constexpr float none = std::numeric_limits<float>::quiet_NaN();
    const float inverse_distance = 1 / lanes.distance, bow = lanes.bow;
    for (std::size_t g = 0; g < lanes.groups; ++g) {
        const double at = lanes.at[g];
        const auto base = static_cast<std::int64_t>(std::floor(at));
        const float part = static_cast<float>(at - static_cast<double>(base)),
                    step = static_cast<float>((lanes.at[g + 1] - at) * (1.0 / knot_step));
        const float first_lift = lanes.lift[g], lift_step = (lanes.lift[g + 1] - first_lift) * (1.0F / knot_step),
                    down = lanes.drop[g], down_step = (lanes.drop[g + 1] - down) * (1.0F / knot_step);
        const float* z = posts + (base - lanes.origin);
        const float* zb = behind + (base - lanes.origin);
        float* h = horizon + g * knot_step;
        const float back = cross ? static_cast<float>(lanes.at_behind[g] - static_cast<double>(base)) : 0,
                    back_step =
                        cross ? static_cast<float>((lanes.at_behind[g + 1] - lanes.at_behind[g]) * (1.0 / knot_step))
                              : 0;
        for (int l = 0; l < static_cast<int>(knot_step); ++l) {
            const float lane = static_cast<float>(l), y = part + lane * step;
            const int i = static_cast<int>(y);
            const float f = y - static_cast<float>(i), a = z[i], b = z[i + 1];
            const float up_a = a - lift.sensor_m, between = up_a + f * (b - a);
            const float above = f == 0 ? up_a : between;
            const float lifts = first_lift + lane * lift_step,
                        drops = down + lane * (down_step + bow * (lane - static_cast<float>(knot_step)));
            const float tangent = lift.w(above) * lifts - drops;
            float old = h[l];
            if (cross) {
                const float y0 = back + lane * back_step, low = y0 < y ? y0 : y, high = y0 < y ? y : y0;
                // Positions are above -17 here: rounded down by way of positive numbers.
                const int c = static_cast<int>(high + 32) - 32;
                const float column = static_cast<float>(c);
                const bool met = (column > low) & (column < high);
                const float tau = (y - column) / (chosen(met, y - y0, 1.0F));  // lines back
                const float most_back = lanes.distance * (1 - 0x1p-8F), begins = most_back < 1 ? most_back : 1;
                const bool counts = met & (!course | (tau < begins));
                const int at_column = c & -static_cast<int>(met);
                const float ahead = z[at_column], there = (ahead - lift.sensor_m) + tau * (zb[at_column] - ahead);
                // lift and drop at a line tau nearer.
                const float nearer = 1 - tau * inverse_distance;
                const float crossing = lift.w(chosen(counts, there, none)) * lifts / nearer - drops * nearer;
                old = crossing > old ? crossing : old;
                if (course) {
                    const bool leftwards = met ? y < y0 : high == column;
                    const auto take = [&](bool on_left, float from, float to) {
                        const float offset = y - column;
                        const float inside =
                            highest_inside(z + c - on_left, zb + c - on_left, on_left ? offset + 1 : offset, y - y0,
                                           from, to, lifts, drops, lanes.distance, lift);
                        old = inside > old ? inside : old;
                    };
                    take(leftwards, 0, counts ? tau : begins);
                    if (counts) take(!leftwards, tau, begins);
                }
            }
            h[l] = tangent > old ? tangent : old;
        }
    }
}

template <bool raised, bool wanted, bool nearest>
inline void test(const TestLanes& lanes, const Lift& how) noexcept {
    const Lift lift = how;
    const float* horizon = lanes.horizon;
    const int last_spoke = lanes.spokes - 2;
    const float target = raised ? lanes.target_m : 0;
    const float slope_step = static_cast<float>(1 / lanes.distance);
    const float inverse_distance = slope_step;
    for (std::size_t g = 0; g < lanes.groups; ++g) {
        const std::int64_t first = lanes.first + static_cast<std::int64_t>(g * knot_step);
        const double from = lanes.from[g], width = lanes.from[g + 1] - from;
        const double per_post = width > 0 ? 1 / width : 0;
        const double lead = from - static_cast<double>(first);
        const auto line = [&](double a, double b) {
            const double step = (b - a) * per_post;
            return std::pair(static_cast<float>(a - lead * step), static_cast<float>(step));
        };
        const double spoke_step = (lanes.at[g + 1] - lanes.at[g]) * per_post, spoke0 = lanes.at[g] - lead * spoke_step;
        const double whole = std::floor(spoke0);
        const float spoke = static_cast<float>(spoke0 - whole), spokes_step = static_cast<float>(spoke_step);
        const int spoke_base = static_cast<int>(static_cast<std::int64_t>(whole) - lanes.first_spoke);
        const auto [lift0, lift1] = line(static_cast<double>(lanes.lift[g]), static_cast<double>(lanes.lift[g + 1]));
        const auto [drop0, drop1] = line(static_cast<double>(lanes.drop[g]), static_cast<double>(lanes.drop[g + 1]));
        const auto [ray0, ray1] = line(static_cast<double>(lanes.ray[g]), static_cast<double>(lanes.ray[g + 1]));
        const auto [rise0, rise1] = line(static_cast<double>(lanes.rise[g]), static_cast<double>(lanes.rise[g + 1]));
        const float bow = static_cast<float>(lanes.bow * spoke_step * spoke_step), begins = static_cast<float>(lead),
                    ends = static_cast<float>(lead + width);
        const float slope0 = static_cast<float>((static_cast<double>(first) - lanes.nadir) / lanes.distance);
        const float* z = lanes.posts + (first - lanes.origin);
        const float* zb = lanes.behind + (first - lanes.origin);
        std::uint8_t* state = lanes.state + (first - lanes.origin);
        float* raise_m = wanted ? lanes.raise_m + (first - lanes.origin) : nullptr;
        float* tangent_out = wanted && lanes.tangent ? lanes.tangent + (first - lanes.origin) : nullptr;
        alignas(64) float tangents[knot_step];
        for (int l = 0; l < static_cast<int>(knot_step); ++l) {
            const float lane = static_cast<float>(l), k = spoke + lane * spokes_step;
            const int down = static_cast<int>(k), up = down + spoke_base, over_first = up > 0 ? up : 0,
                      kept = over_first < last_spoke ? over_first : last_spoke;
            const float f = k - static_cast<float>(down);
            const float left = horizon[kept], right = horizon[kept + 1];
            // A spoke that has met no ground runs outside the raster, and so does the post's ray.
            const bool free = (left < 0.5F * no_horizon_f) | (right < 0.5F * no_horizon_f);
            const float between = left + f * (right - left), level = chosen(free, no_horizon_f, between);

            const float height = z[l], up_m = height - lift.sensor_m, w = lift.w(raised ? up_m + target : up_m);
            const float bends = bow * ((lane - begins) * (lane - ends));
            const float lifts = lift0 + lane * lift1, drops = drop0 + lane * drop1 + bends;
            const float high = w * lifts, tangent = high - drops;
            // The own cell, the one on the sensor's side, along the straight chord: its course u = 0..1 from the line
            // behind to the post is a parabola, and so is how high the ray runs above it.
            const float slope = slope0 + lane * slope_step, across = slope < 0 ? -slope : slope;
            const float left_post = z[l - 1], right_post = z[l + 1], left_back = zb[l - 1], right_back = zb[l + 1];
            const float beside = chosen(slope < 0, right_post, left_post),
                        corner = chosen(slope < 0, right_back, left_back), back = zb[l];
            const float to_corner = across * (corner - back), to_beside = across * (height - beside);
            const float step = height - back, to_entry = across > 0 ? step - to_corner : step;
            const float climbs = across > 0 ? step + to_beside : step;
            const float growth = lift.growth(height), ray_w = w * (ray0 + lane * ray1),
                        ray_rise = rise0 + lane * rise1 + bends, ray = ray_w + ray_rise;
            const float stands = target * growth;
            const float step_size = step < 0 ? -step : step, size = step == step ? step_size : 0.0F,
                        side = across > 0
                                   ? (to_beside < 0 ? -to_beside : to_beside) + (to_corner < 0 ? -to_corner : to_corner)
                                   : 0.0F;
            const float relief = size + (side == side ? side : 0.0F);
            const float cell_slack = ((ray_w < 0 ? -ray_w : ray_w) + ray_rise + relief) * level_slack;
            // Spokes' positions are good to place_slack of a post.
            const float slack = ((high < 0 ? -high : high) + drops) * level_slack + relief * lifts * place_slack;
            const float over = tangent + slack - level;                // below 0: hidden
            const float steeper = climbs * growth - ray + cell_slack;  // at the post; below 0: a back slope
            const float above0 = stands - ray + ray_rise * inverse_distance + to_entry * growth + cell_slack;
            // Where the way through the cell begins: at the line behind, or above the sensor.
            const float starts = nearest ? 1 - static_cast<float>(lanes.distance) : 0.0F;
            const bool enters_below = !nearest & (above0 < 0);
            const bool void_post = height != height;
            bool hidden = over < 0;
            if (raised) {
                const float b = stands - above0, bend = -steeper - b, tilt = b - bend;  // above0 + tilt u + bend u^2
                const bool dips = (bend > 0) & (tilt + 2 * bend * starts < 0) & (tilt + 2 * bend > 0) &
                                  (4 * bend * above0 < tilt * tilt);
                hidden = hidden | enters_below | dips;
            } else {
                hidden = hidden | enters_below | ((steeper < 0) & (above0 == above0));
            }
            const int seen = 2 - static_cast<int>(hidden), valid = -static_cast<int>(!void_post);
            state[l] = static_cast<std::uint8_t>(seen & valid);
            if (wanted) {
                // What would lift the post to its horizon, and its ray out of its own cell.
                const float stands_at = raised ? height + target : height;
                const float to_horizon = over < 0 ? lift.climb(stands_at, -over / lifts) : 0.0F;
                const float b = stands - above0, bend = -steeper - b, tilt = b - bend;
                // That hidden by most, over how far it is.
                const float before = static_cast<float>(lanes.distance) - 1,
                            least_way = 1 - static_cast<float>(lanes.distance) * (1 - 0x1p-8F),
                            enters = least_way > 0 ? least_way : 0;
                const float more = (above0 - tilt * before) / bend, square = before * before + more,
                            way = std::sqrt(square > 0 ? square : 0.0F),
                            top = nearest ? way - before : more / (way + before);
                const float u = (bend > 0) & (top > enters) ? (top < 1 ? top : 1) : enters;
                const float least = above0 + u * (tilt + u * bend);
                const float moves = 1 - (1 - u) * inverse_distance;  // of the ray there, when the post rises
                const float out_of_cell = least < 0 ? lift.climb(stands_at, -least / moves) : 0.0F;
                const float most = to_horizon > out_of_cell ? to_horizon : out_of_cell;
                const float some = most > 0.001F ? most : 0.001F;
                raise_m[l] = chosen(hidden, some, 0.0F);
                tangents[l] = tangent;
            }
        }
        if (wanted && tangent_out)
            for (std::size_t l = 0; l < knot_step; ++l) tangent_out[l] = tangents[l];
    }
}

template <bool raised, bool wanted>
inline void test_line(const TestLanes& lanes, const Lift& lift) noexcept {
    lanes.nearest ? test<raised, wanted, true>(lanes, lift) : test<raised, wanted, false>(lanes, lift);
}

}  // namespace wedgescope::twin
