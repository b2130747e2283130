#include "lib/intensity_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "lib/require_angle.hpp"

namespace wedgescope {
namespace {

// Asymptotic series (Abramowitz & Stegun 6.3.18, 6.4.12) from 10 up, where eight terms give all digits; below that by
// recurrence.
double digamma(double x) {
    double sum = 0;
    for (; x < 10; ++x) sum -= 1 / x;
    const double y = 1 / (x * x);
    return sum + std::log(x) - 0.5 / x -
           y * (1.0 / 12 - y * (1.0 / 120 - y * (1.0 / 252 - y * (1.0 / 240 - y * (1.0 / 132 - y * 691.0 / 32760)))));
}

double trigamma(double x) {
    double sum = 0;
    for (; x < 10; ++x) sum += 1 / (x * x);
    const double y = 1 / (x * x);
    return sum + 1 / x + 0.5 * y +
           y / x * (1.0 / 6 - y * (1.0 / 30 - y * (1.0 / 42 - y * (1.0 / 30 - y * (5.0 / 66 - y * 691.0 / 2730)))));
}

void require_shape(double shape) { require_within("shape of the K distribution", shape, 0.01, 1e4, ""); }

}  // namespace

SpeckleMoments speckle_moments(double looks) {
    require_above_to("looks", looks, 0, 1e9, "");
    constexpr double db_per_neper = 10 / std::numbers::ln10;
    return {Decibel(db_per_neper * (digamma(looks) - std::log(looks))), db_per_neper * std::sqrt(trigamma(looks))};
}

double k_distribution_exceedance(double shape, double ratio) {
    require_shape(shape);
    require_within("ratio to the mean of the K distribution", ratio, 0, 1e12, "");
    // 2 z^(nu/2) K_nu(2 sqrt z) is the integral of exp(nu w - e^w - z e^-w) over all w, z = nu t: an analytic integrand
    // that ends like e^-e^|w|, for which the trapezoid rule is as good as exact, whatever nu. (Bessel functions by
    // themselves leave the range of doubles at nu of 200.)
    const double z = shape * ratio;
    if (z == 0) return 1;
    const auto exponent = [&](double w) { return shape * w - std::exp(w) - z * std::exp(-w); };
    // Its peak: e^w = (nu + sqrt(nu^2 + 4 z)) / 2.
    const double peak = std::log(0.5 * (shape + std::sqrt(shape * shape + 4 * z))), most = exponent(peak);
    const double step = std::min(0.125, 0.4 / std::sqrt(shape));
    double sum = 0;
    for (const double way : {-step, step}) {
        for (double w = way > 0 ? peak : peak - step;; w += way) {
            const double below = exponent(w) - most;
            if (below < -60) break;
            sum += std::exp(below);
        }
    }
    return std::min(1.0, step * sum * std::exp(most - std::lgamma(shape)));
}

double k_distribution_second_moment(double shape) {
    require_shape(shape);
    return 2 * (1 + 1 / shape);
}

double sea_clutter_shape(const SeaClutterCell& cell) {
    require_above("area of a sea clutter cell", cell.area_m2, 0, "m2");
    require_angle("grazing angle of a sea clutter cell", cell.grazing, 0.1, 10);
    require_angle("look direction from the swell", cell.from_swell, -360, 360);
    const double swell = cell.swell ? std::cos(2 * cell.from_swell.rad()) / 3 : 0;
    return std::pow(10, 2.0 / 3 * std::log10(cell.grazing.deg()) + 0.625 * std::log10(cell.area_m2) -
                            (cell.vertical ? 1.39 : 2.09) - swell);
}

}  // namespace wedgescope
