#include "lib/sweep.hpp"

#include "lib/lanes.hpp"

namespace wedgescope {

namespace {

template <StepTo target, bool near_sensor>
WEDGESCOPE_LANES_PART void step(std::size_t n, const StepScene& scene, const StepLanes& lanes) noexcept {
    const SampleLanes &from = lanes.from, &to = lanes.to;
    const double* __restrict part0 = from.part, * __restrict minor0 = from.minor, * __restrict arc0 = from.arc_m, * __restrict height0 = from.height_m, * __restrict up0 = from.up_m, * __restrict out0 = from.out_m, * __restrict range0 = from.range_m, * __restrict last_sine = from.sine, * __restrict x0 = from.x;
    const double* __restrict part1 = to.part, * __restrict minor1 = to.minor, * __restrict arc1 = to.arc_m;
    double* __restrict height1 = to.height_m, * __restrict up1 = to.up_m, * __restrict out1 = to.out_m, * __restrict range1 = to.range_m, * __restrict sine1 = to.sine, * __restrict x1 = to.x;
    const double* __restrict cell = lanes.posts.cell;
    const float* __restrict behind = lanes.posts.behind, * __restrict ahead = lanes.posts.ahead;
    const double *__restrict mode = lanes.mode, *__restrict inverse_radius = lanes.inverse_radius,
                 *__restrict void_horizon = lanes.void_horizon;
    double *__restrict horizon = lanes.horizon, *__restrict seen_least = lanes.seen_least,
           *__restrict seen_most = lanes.seen_most, *__restrict bump_m = lanes.bump_m, *__restrict rise = lanes.rise,
           *__restrict swing = lanes.swing, *__restrict sine0 = lanes.sine0, *__restrict code = lanes.code;
    const double sensor_m = scene.sensor_m, arc_bins = scene.range_is_ground ? scene.bins_per_metre : 0,
                 range_bins = scene.range_is_ground ? 0 : scene.bins_per_metre,
                 quarter = scene.exact_course ? -0.25 : 0.0, most_rise = scene.most_rise, low0 = scene.drops[0].low,
                 high0 = scene.drops[0].high, low1 = scene.drops[1].low, high1 = scene.drops[1].high,
                 lobe_low = scene.lobe.low, lobe_high = scene.lobe.high, lobe_part = scene.lobe.part;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const bool stands = arc0[i] == arc1[i];  // no sample here: whatever the spoke's neighbours do
        const double zb0 = static_cast<double>(behind[2 * i]), zb1 = static_cast<double>(behind[2 * i + 1]),
                     za0 = static_cast<double>(ahead[2 * i]), za1 = static_cast<double>(ahead[2 * i + 1]);
        const bool lower = minor1[i] == cell[i];
        const double there = target == StepTo::line ? linear(za0, za1, minor1[i] - cell[i])
                                                    : linear(lower ? zb0 : zb1, lower ? za0 : za1, part1[i]);
        const double z = stands ? height0[i] : there;
        const SightLine p = sight_line<near_sensor>(sensor_m, arc1[i], z, inverse_radius[i]);
        const double x = p.range_m * range_bins + arc1[i] * arc_bins, s = p.sine;
        height1[i] = z;
        up1[i] = p.up_m;
        out1[i] = p.out_m;
        range1[i] = p.range_m;
        sine1[i] = s;
        x1[i] = x;

        const double bent = quarter * ((za1 - za0) - (zb1 - zb0)) * (part1[i] - part0[i]) * (minor1[i] - minor0[i]);
        const double bump = bent == bent ? bent : 0.0, risen = p.up_m * out0[i] - up0[i] * p.out_m,
                     swung = 4 * bump * out0[i];
        bump_m[i] = bump;
        rise[i] = risen;
        swing[i] = swung;

        const double h = horizon[i], m = mode[i];
        const bool straight = (swung < 0 ? -swung : swung) <= risen, visible = m == mode_visible, above = s > h;
        // one_range, but for what lies within a metre: that is left to Front.
        const bool together = (p.range_m <= most_range_ratio * range0[i]) &
                              (range0[i] <= most_range_ratio * p.range_m) & short_rise(s - h, s, most_rise) &
                              straight_range(bump, s, range_bins) & !meets_drop(h, s, low0, high0) &
                              !meets_drop(h, s, low1, high1) & short_in_lobe(h, s, lobe_low, lobe_high, lobe_part);
        // The way out from below the sensor is left to Front too.
        const bool plain = visible & above & !stands & (arc0[i] > 0) & straight & (h >= void_horizon[i]) & together;
        const double higher = s > last_sine[i] ? s : last_sine[i];
        const bool below = (s <= h) & (higher * range0[i] + bump * 1.02 <= h * range0[i]);
        const bool quiet = ((m == mode_hidden) & below) | stands | (m == mode_done);
        const double c = quiet ? 0.0 : plain ? 1.0 : 2.0;
        code[i] = c;
        sine0[i] = h;
        horizon[i] = c == 1 ? s : h;
        const double near = x0[i] < x ? x0[i] : x, far = x0[i] < x ? x : x0[i];
        const double least = near < seen_least[i] ? near : seen_least[i],
                     most = far > seen_most[i] ? far : seen_most[i];
        seen_least[i] = c == 1 ? least : seen_least[i];
        seen_most[i] = c == 1 ? most : seen_most[i];
    }
}

/// Some sample is seen so steeply from above that ranges may turn in its piece.
WEDGESCOPE_LANES_PART bool any_steep(std::size_t n, const double* __restrict sine) noexcept {
    int steep = 0;
    for (std::size_t i = 0; i < n; ++i) steep += sine[i] < turning_sine ? 1 : 0;
    return steep > 0;
}

/// Plain pieces whose ranges turn round are changes.
WEDGESCOPE_LANES_PART void take_out_turns(std::size_t n, const StepScene& scene, const StepLanes& lanes) noexcept {
    const double *__restrict up0 = lanes.from.up_m, *__restrict out0 = lanes.from.out_m, *__restrict x0 = lanes.from.x,
                 *__restrict up1 = lanes.to.up_m, *__restrict out1 = lanes.to.out_m, *__restrict x1 = lanes.to.x,
                 *__restrict range1 = lanes.to.range_m, *__restrict sine1 = lanes.to.sine,
                 *__restrict bump_m = lanes.bump_m, *__restrict sine0 = lanes.sine0;
    double* __restrict horizon = lanes.horizon, * __restrict code = lanes.code;
    const double bins = scene.bins_per_metre;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double across = up1[i] * out0[i] - up0[i] * out1[i];
        const bool out = (code[i] == 1) & turns_in_range(across, range1[i], bump_m[i], sine1[i], x1[i] - x0[i], bins);
        code[i] = out ? 2.0 : code[i];
        horizon[i] = out ? sine0[i] : horizon[i];
    }
}

WEDGESCOPE_LANES_PART Rises count_rises(std::size_t n, const double* __restrict code) noexcept {
    int plains = 0, changes = 0;
    for (std::size_t i = 0; i < n; ++i) plains += code[i] == 1 ? 1 : 0;
    for (std::size_t i = 0; i < n; ++i) changes += code[i] == 2 ? 1 : 0;
    return {plains, changes};
}

template <bool near_sensor>
WEDGESCOPE_LANES_PART void sight(std::size_t n, const StepScene& scene, const double* __restrict cell,
                                 const float* __restrict posts, const double* __restrict inverse_radius,
                                 const SampleLanes& samples) noexcept {
    const double* __restrict minor = samples.minor, * __restrict arc = samples.arc_m;
    double *__restrict height = samples.height_m, *__restrict up = samples.up_m, *__restrict out = samples.out_m,
           *__restrict range = samples.range_m, *__restrict sine = samples.sine, *__restrict x = samples.x;
    const double sensor_m = scene.sensor_m, arc_bins = scene.range_is_ground ? scene.bins_per_metre : 0,
                 range_bins = scene.range_is_ground ? 0 : scene.bins_per_metre;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double z =
            linear(static_cast<double>(posts[2 * i]), static_cast<double>(posts[2 * i + 1]), minor[i] - cell[i]);
        const SightLine p = sight_line<near_sensor>(sensor_m, arc[i], z, inverse_radius[i]);
        height[i] = z;
        up[i] = p.up_m;
        out[i] = p.out_m;
        range[i] = p.range_m;
        sine[i] = p.sine;
        x[i] = p.range_m * range_bins + arc[i] * arc_bins;
    }
}

WEDGESCOPE_LANES_PART void any_sight(std::size_t n, const StepScene& scene, const double* cell, const float* posts,
                                     const double* inverse_radius, const SampleLanes& samples) noexcept {
    if (scene.most_theta <= near_theta) return sight<true>(n, scene, cell, posts, inverse_radius, samples);
    sight<false>(n, scene, cell, posts, inverse_radius, samples);
}

WEDGESCOPE_LANES_PART Rises any_step(StepTo target, std::size_t n, const StepScene& scene,
                                     const StepLanes& lanes) noexcept {
    const bool near_sensor = scene.most_theta <= near_theta;
    if (target == StepTo::line)
        near_sensor ? step<StepTo::line, true>(n, scene, lanes) : step<StepTo::line, false>(n, scene, lanes);
    else
        near_sensor ? step<StepTo::crossing, true>(n, scene, lanes) : step<StepTo::crossing, false>(n, scene, lanes);
    if (!scene.range_is_ground && any_steep(n, lanes.to.sine)) take_out_turns(n, scene, lanes);
    return count_rises(n, lanes.code);
}

WEDGESCOPE_LANES_PART int join(std::size_t n, const JoinLanes& lanes) noexcept {
    const double *__restrict horizon = lanes.first.sine0, *__restrict rise0 = lanes.first.rise,
                 *__restrict swing0 = lanes.first.swing;
    double *__restrict code0 = lanes.first.code, *__restrict sine0 = lanes.second.sine0, *__restrict rise = lanes.second.rise,
           *__restrict swing = lanes.second.swing;
    const double* __restrict code1 = lanes.second.code, * __restrict range0 = lanes.range0, * __restrict x0 = lanes.x0, * __restrict range = lanes.range_m, * __restrict x = lanes.x, * __restrict range1 = lanes.range1, * __restrict sine1 = lanes.sine1, * __restrict x1 = lanes.x1;
    double* __restrict start_range = lanes.start_range, * __restrict start_x = lanes.start_x;
    const double lobe_low = lanes.lobe.low, lobe_high = lanes.lobe.high, lobe_part = lanes.lobe.part;
    int alone = 0;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        // In parts of what both rise and of the way that both go. The middle of a piece of bow b lies b/6 before its half-way
        // point.
        const double way = x1[i] - x0[i], first = (x[i] - x0[i]) / way, second = 1 - first,
                     most = sine1[i] - horizon[i], upto = (sine0[i] - horizon[i]) / most, beyond = 1 - upto;
        const double bow =
            3 * (second - beyond) + upto * first * (swing0[i] / rise0[i]) + beyond * second * (swing[i] / rise[i]);
        const bool both = (code0[i] == 1) & (code1[i] == 1) & (first >= 0) & (first <= 1) & (bow >= -1) & (bow <= 1) &
                          (range1[i] <= most_range_ratio * range0[i]) & (range0[i] <= most_range_ratio * range1[i]) &
                          short_rise(most, sine1[i]) &
                          short_in_lobe(horizon[i], sine1[i], lobe_low, lobe_high, lobe_part);
        code0[i] = both ? 0.0 : code0[i];
        sine0[i] = both ? horizon[i] : sine0[i];
        rise[i] = both ? 1.0 : rise[i];
        swing[i] = both ? bow : swing[i];
        start_range[i] = both ? range0[i] : range[i];
        start_x[i] = both ? x0[i] : x[i];
    }
    for (std::size_t i = 0; i < n; ++i) alone += code0[i] == 1 ? 1 : 0;
    return alone;
}

}  // namespace

int join_lanes(std::size_t n, const JoinLanes& lanes) noexcept { return on_target<join>(n, lanes); }

Rises step_lanes(StepTo target, std::size_t n, const StepScene& scene, const StepLanes& lanes) noexcept {
    return on_target<any_step>(target, n, scene, lanes);
}

void sight_lanes(std::size_t n, const StepScene& scene, const double* cell, const float* posts,
                 const double* inverse_radius, const SampleLanes& samples) noexcept {
    on_target<any_sight>(n, scene, cell, posts, inverse_radius, samples);
}

}  // namespace wedgescope
