#include "lib/sweep.hpp"

#include <limits>

#include "lib/lanes.hpp"

namespace wedgescope {

WEDGESCOPE_LANES
void sight_lanes(std::size_t n, double sensor_m, double bins_per_metre, bool range_is_ground,
                 const double* __restrict inverse_radius, const SampleLanes& samples) noexcept {
    const double* __restrict arc_m = samples.arc_m, * __restrict height_m = samples.height_m;
    double *__restrict up_m = samples.up_m, *__restrict out_m = samples.out_m, *__restrict range_m = samples.range_m,
           *__restrict sine = samples.sine, *__restrict x = samples.x;
    const double arc_bins = range_is_ground ? bins_per_metre : 0, range_bins = range_is_ground ? 0 : bins_per_metre;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const SightLine p = sight_line(sensor_m, arc_m[i], height_m[i], inverse_radius[i]);
        up_m[i] = p.up_m;
        out_m[i] = p.out_m;
        range_m[i] = p.range_m;
        sine[i] = p.sine;
        x[i] = p.range_m * range_bins + arc_m[i] * arc_bins;
    }
}

WEDGESCOPE_LANES
Rises rise_lanes(std::size_t n, const SampleLanes& from, const SampleLanes& to, const double* __restrict mode,
                 double* __restrict horizon, const double* __restrict void_horizon, const double* __restrict bump_m,
                 double* __restrict seen_least, double* __restrict seen_most, double* __restrict sine0,
                 double* __restrict code) noexcept {
    const double* __restrict sine = to.sine, * __restrict arc0 = from.arc_m, * __restrict arc1 = to.arc_m, * __restrict x0 = from.x, * __restrict x1 = to.x, * __restrict up0 = from.up_m, * __restrict up1 = to.up_m, * __restrict out0 = from.out_m, * __restrict out1 = to.out_m, * __restrict range0 = from.range_m, * __restrict last_sine = from.sine;
    std::int64_t plains = 0, nothing = 0;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double s = sine[i], h = horizon[i], m = mode[i];
        const double bump = bump_m[i], swing = 4 * (bump < 0 ? -bump : bump);
        const bool straight = swing * out0[i] <= up1[i] * out0[i] - up0[i] * out1[i];
        const bool rising = (m == mode_visible) & (s > h) & (arc0[i] != arc1[i]);
        const bool plain = rising & straight & (h >= void_horizon[i]);
        const double higher = s > last_sine[i] ? s : last_sine[i];
        const bool below = (s <= h) & (higher * range0[i] + bump * 1.02 <= h * range0[i]);
        const bool none = (arc0[i] == arc1[i]) | (m == mode_done);  // no sample here: whatever the spoke's neighbours do
        const bool quiet = ((m == mode_hidden) & below) | none;
        const double c = quiet ? 0.0 : plain ? 1.0 : 2.0;
        code[i] = c;
        plains += plain ? 1 : 0;
        nothing += c == 0 ? 1 : 0;
        sine0[i] = h;
        horizon[i] = plain ? s : h;
        const double near = x0[i] < x1[i] ? x0[i] : x1[i], far = x0[i] < x1[i] ? x1[i] : x0[i];
        const double least = near < seen_least[i] ? near : seen_least[i],
                     most = far > seen_most[i] ? far : seen_most[i];
        seen_least[i] = plain ? least : seen_least[i];
        seen_most[i] = plain ? most : seen_most[i];
    }
    return {plains, static_cast<std::int64_t>(n) - plains - nothing};
}

double ray_range_m(double sensor_m, double arc_m, double sine, double inverse_radius) {
    // r = (Re + hs) sin(theta) / cos(e + theta)
    const double theta = arc_m * inverse_radius, x = theta * theta;
    const double sinc = 1 - x * (1.0 / 6) * (1 - x * (1.0 / 20) * (1 - x * (1.0 / 42)));
    const double versine = 1 - x * (1.0 / 12) * (1 - x * (1.0 / 30) * (1 - x * (1.0 / 56)));
    const double cosine = std::sqrt(1 - sine * sine);
    const double below = cosine * (1 - 0.5 * x * versine) - sine * theta * sinc;
    if (!(below > 0)) return std::numeric_limits<double>::infinity();
    return (1 + sensor_m * inverse_radius) * arc_m * sinc / below;
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
