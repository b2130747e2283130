#include "lib/course.hpp"

#include <cassert>

namespace wedgescope {
namespace {

template <bool ground>
WEDGESCOPE_LANES_PART void cut(std::size_t n, const StepScene& scene, Cuts& cuts) noexcept {
    const double *__restrict horizon = cuts.horizon.data(), *__restrict on_horizon = cuts.on_horizon.data(),
                 *__restrict arc0 = cuts.arc0.data(), *__restrict up0 = cuts.up0.data(),
                 *__restrict out0 = cuts.out0.data(), *__restrict range0 = cuts.range0.data(),
                 *__restrict x0 = cuts.x0.data(), *__restrict arc1 = cuts.arc1.data(),
                 *__restrict up1 = cuts.up1.data(), *__restrict out1 = cuts.out1.data(),
                 *__restrict range1 = cuts.range1.data(), *__restrict sine1 = cuts.sine1.data(),
                 *__restrict x1 = cuts.x1.data(), *__restrict bump_m = cuts.bump_m.data(),
                 *__restrict inverse_radius = cuts.inverse_radius.data(),
                 *__restrict hidden_from = cuts.hidden_from.data();
    double *__restrict seen = cuts.seen.data(), *__restrict hides = cuts.hides.data(),
                       *__restrict begin = cuts.begin.data(), *__restrict end = cuts.end.data(),
                       *__restrict bow = cuts.bow.data(), *__restrict range_out = cuts.range_out.data(),
                       *__restrict x_out = cuts.x_out.data(), *__restrict range_top = cuts.range_top.data(),
                       *__restrict sine_top = cuts.sine_top.data(), *__restrict x_top = cuts.x_top.data(),
                       *__restrict shadow0 = cuts.shadow0.data(), *__restrict shadow1 = cuts.shadow1.data(),
                       *__restrict plain = cuts.plain.data();
    const double sensor_m = scene.sensor_m, bins = scene.bins_per_metre, range_bins = ground ? 0 : bins,
                 low0 = scene.drops[0].low, high0 = scene.drops[0].high, low1 = scene.drops[1].low,
                 high1 = scene.drops[1].high, lobe_low = scene.lobe.low, lobe_high = scene.lobe.high,
                 lobe_part = scene.lobe.part;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        // course(): every way is gone, and the one that holds is taken.
        const double h = horizon[i], cosine = std::sqrt(1 - h * h);
        const double over0 = up0[i] * cosine - out0[i] * h, f1 = up1[i] * cosine - out1[i] * h,
                     swing = 4 * bump_m[i] * cosine, c = (1 - on_horizon[i]) * over0, a = -swing, b = f1 - c + swing;
        const bool climbs = b > 0, starts = (c > 0) | ((c == 0) & climbs);
        const double discriminant = b * b - 4 * a * c, root = std::sqrt(discriminant);
        const double over = climbs ? -2 * c : root - b, under = climbs ? b + root : 2 * a, u = over / under,
                     later = u > 0 ? u : 0.0;
        const bool comes = starts | ((discriminant >= 0) & (climbs | (a > 0)) & (u < 1));
        const double from = starts ? 0.0 : later;
        const double turns = -b / (2 * a);
        const bool falls = (a < 0) & (turns < 1);
        const double to = falls ? turns : 1.0;
        const bool shows = comes & (to > from) & (falls | (f1 > 0));
        const double length = to - from, risen = (b + a * (from + to)) * length, bent = -a * length * length / risen,
                     least = bent > -1 ? bent : -1.0, most = least < 1 ? least : 1.0;
        seen[i] = shows ? 1.0 : 0.0;
        hides[i] = shows & falls ? 1.0 : 0.0;
        begin[i] = from;
        end[i] = to;
        bow[i] = risen > 0 ? most : 0.0;
    }
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double h = horizon[i], bump = bump_m[i], from = begin[i], to = end[i];
        const bool inside = from > 0, falls = to < 1;
        const double raise_out = bump * 4 * from * (1 - from), up_out = linear(up0[i], up1[i], from) + raise_out,
                     out_out = linear(out0[i], out1[i], from), far_out = std::sqrt(up_out * up_out + out_out * out_out),
                     way_out = linear(x0[i], x1[i], from);
        const double raise_top = bump * 4 * to * (1 - to), up_top = linear(up0[i], up1[i], to) + raise_top,
                     out_top = linear(out0[i], out1[i], to), far_top = std::sqrt(up_top * up_top + out_top * out_top),
                     way_top = linear(x0[i], x1[i], to), slope_top = up_top / far_top;
        const double range = inside ? far_out : range0[i], last = falls ? far_top : range1[i],
                     top = falls ? slope_top : sine1[i];
        const double x_inside = ground ? way_out : far_out * bins, x_falls = ground ? way_top : far_top * bins;
        range_out[i] = range;
        x_out[i] = inside ? x_inside : x0[i];
        range_top[i] = last;
        sine_top[i] = top;
        x_top[i] = falls ? x_falls : x1[i];

        const double near = range > 1 ? range : 1.0, far = last > 1 ? last : 1.0, length = to - from,
                     bent = bump * length * length, across = up_top * out_out - up_out * out_top,
                     way = (last - range) * range_bins;
        const bool together = (far <= most_range_ratio * near) & (near <= most_range_ratio * far) &
                              short_rise(top - h, top) & straight_range(bent, top, range_bins) &
                              !turns_in_range(across, last, bent, top, way, range_bins) &
                              !meets_drop(h, top, low0, high0) & !meets_drop(h, top, low1, high1) &
                              short_in_lobe(h, top, lobe_low, lobe_high, lobe_part) & (arc0[i] > 0);
        plain[i] = together ? 1.0 : 0.0;
    }
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double h = horizon[i], hidden_to = arc0[i] + begin[i] * (arc1[i] - arc0[i]);
        const double ray0 = ray_range_m(sensor_m, hidden_from[i], h, inverse_radius[i]),
                     ray1 = ray_range_m(sensor_m, hidden_to, h, inverse_radius[i]);
        shadow0[i] = ground ? hidden_from[i] * bins : ray0 * bins;
        shadow1[i] = ground ? hidden_to * bins : ray1 * bins;
    }
}

WEDGESCOPE_LANES_PART void any_cut(std::size_t n, const StepScene& scene, Cuts& cuts) noexcept {
    return scene.range_is_ground ? cut<true>(n, scene, cuts) : cut<false>(n, scene, cuts);
}

}  // namespace

void cut_pieces(std::size_t n, const StepScene& scene, Cuts& cuts) noexcept {
    assert(n <= Cuts::most);
    on_target<any_cut>((n + lane_step - 1) / lane_step * lane_step, scene, cuts);
}

Course course(double sine, double up0, double out0, double up1, double out1, double bump_m, bool from_ray) {
    // Height over the ray: f(u) = c + b u + a u^2.
    const double cosine = std::sqrt(1 - sine * sine);
    const double f0 = from_ray ? 0 : up0 * cosine - out0 * sine, f1 = up1 * cosine - out1 * sine,
                 swing = 4 * bump_m * cosine;
    const double a = -swing, b = f1 - f0 + swing, c = f0;
    Course course;
    if (c > 0 || (c == 0 && b > 0)) {
        course.begin = 0;
    } else {
        // Where it comes up through the ray: (-b + sqrt(b^2 - 4 a c)) / (2 a), without cancellation.
        const double discriminant = b * b - 4 * a * c;
        if (!(discriminant >= 0)) return course;
        const double root = std::sqrt(discriminant);
        const double u = b > 0 ? -2 * c / (b + root) : a > 0 ? (root - b) / (2 * a) : 1;
        if (!(u < 1)) return course;
        course.begin = u > 0 ? u : 0;
    }
    course.seen = true;
    const double peak = a < 0 ? -b / (2 * a) : 1;
    if (peak < 1) {
        if (!(peak > course.begin)) return {};
        course.end = peak;
        course.hides = true;
    } else if (!(f1 > 0)) {
        return {};
    }
    const double length = course.end - course.begin, risen = (b + a * (course.begin + course.end)) * length;
    const double bow = risen > 0 ? -a * length * length / risen : 0;
    course.bow = bow < -1 ? -1 : bow > 1 ? 1 : bow;
    return course;
}

}  // namespace wedgescope
