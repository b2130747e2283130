#include "lib/display_lanes.hpp"

#include <cmath>
#include <numbers>

#include "lib/lanes.hpp"

namespace wedgescope {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double tan_eighth = 0.41421356237309503;  // of pi / 8

/// To a multiple of 2^-20 by adding 1.5 2^32: to nearest even, for numbers below 2^31.
WEDGESCOPE_LANES_PART double to_grid(double value) {
    constexpr double magic = 6442450944.0;
    return (value + magic) - magic;
}

/// atan(t) for |t| <= tan(pi / 8): its power series to t^23.
WEDGESCOPE_LANES_PART double small_atan(double t) {
    const double x = t * t;
    return t * (1 + x * (-1.0 / 3 +
                         x * (1.0 / 5 +
                              x * (-1.0 / 7 +
                                   x * (1.0 / 9 +
                                        x * (-1.0 / 11 +
                                             x * (1.0 / 13 +
                                                  x * (-1.0 / 15 +
                                                       x * (1.0 / 17 +
                                                            x * (-1.0 / 19 + x * (1.0 / 21 + x * (-1.0 / 23))))))))))));
}

WEDGESCOPE_LANES_PART void place(std::size_t n, std::int64_t column, double y_m, const PixelScene& scene,
                                 PixelRow& out) noexcept {
    const PixelScene s = scene;
    double* __restrict radius_m = out.radius_m.data(), * __restrict range_m = out.range_m.data(),
                       * __restrict azimuth_rad = out.azimuth_rad.data(),
                       * __restrict azimuth_position = out.azimuth_position.data(),
                       * __restrict azimuth_share = out.azimuth.share.data(),
                       * __restrict range_share = out.range.share.data();
    std::int32_t* __restrict azimuth_first = out.azimuth.first.data(), * __restrict azimuth_second = out.azimuth.second.data(),
                             * __restrict azimuth_nearest = out.azimuth.nearest.data(),
                             * __restrict range_first = out.range.first.data(), * __restrict range_second = out.range.second.data(),
                             * __restrict range_nearest = out.range.nearest.data(), * __restrict shown = out.shown.data(),
                             * __restrict light = out.light.data();
    const double up = y_m < 0 ? -y_m : y_m, circle = static_cast<double>(s.circle_bins),
                 azimuths = static_cast<double>(s.azimuth_bins), ranges = static_cast<double>(s.range_bins);
    const double behind = y_m < 0 ? 1 : 0, chord = s.chord ? 1 : 0, wraps = s.wraps ? 1 : 0;
    const double curvature = s.inverse_radius * s.inverse_radius, square_rise = s.rise_m * s.rise_m;
    const double first_column = static_cast<double>(column) + 0.5 - s.centre_column;
    const auto width = static_cast<std::int32_t>(n);
    WEDGESCOPE_INDEPENDENT
    for (std::int32_t i = 0; i < width; ++i) {
        const double x = (first_column + static_cast<double>(i)) * s.metres_per_pixel;
        const double square = x * x + y_m * y_m, radius = std::sqrt(square);
        const double t = square * curvature;
        const double bend = 1 - t * (1.0 / 12) * (1 - t * (1.0 / 30) * (1 - t * (1.0 / 56) * (1 - t * (1.0 / 90))));
        const double slant = std::sqrt(square_rise + square * s.growth * bend);
        const double range = chord > 0 ? slant : radius + s.delay_m;
        // Azimuth from the picture's up direction, clockwise.
        const double right = x < 0 ? -x : x, low = right < up ? right : up, high = right < up ? up : right;
        const bool wide = low > tan_eighth * high;
        const double over = wide ? low - high : low, under = wide ? low + high : high;
        const double octant = (wide ? pi / 4 : 0) + small_atan(over / (under > 0 ? under : 1.0));
        const double quarter = right < up ? octant : pi / 2 - octant, half = behind > 0 ? pi - quarter : quarter;
        const double azimuth = (x < 0 ? -half : half) + s.up_azimuth_rad;
        double place = to_grid(azimuth * s.bins_per_radian) - s.first_azimuth;
        place = place < 0 ? place + circle : place;
        place = place < 0 ? place + circle : place;
        place = place >= circle ? place - circle : place;
        place = place >= circle ? place - circle : place;
        const double round = place >= azimuths ? wraps > 0 ? 1.0 : 0.0 : 1.0;
        place = place >= azimuths ? 0.0 : place;
        const double good =
            radius <= s.most_radius_m ? range >= s.least_range_m ? range <= s.most_range_m ? round : 0.0 : 0.0 : 0.0;
        radius_m[i] = radius;
        range_m[i] = range;
        azimuth_rad[i] = azimuth;
        azimuth_position[i] = place;
        shown[i] = good > 0 ? 1 : 0;

        // One more than the bin below the centre before it: never below 0.
        const double from = place + 0.5;
        const auto next = static_cast<std::int32_t>(from);
        const std::int32_t before = next - 1;
        const std::int32_t outer = s.azimuth_bins - 1;
        const std::int32_t low_end = wraps > 0 ? outer : 0, high_end = wraps > 0 ? 0 : outer;
        azimuth_first[i] = before < 0 ? low_end : before > outer ? outer : before;
        azimuth_second[i] = next > outer ? high_end : next;
        azimuth_share[i] = from - static_cast<double>(next);
        const auto own = static_cast<std::int32_t>(place);
        azimuth_nearest[i] = own > outer ? outer : own;

        const double exact = to_grid((good > 0 ? range : s.least_range_m) * s.bins_per_metre) - s.first_range;
        const double along = exact < 0 ? 0.0 : exact > ranges ? ranges : exact;
        const double from_range = along + 0.5;
        const auto next_range = static_cast<std::int32_t>(from_range);
        const std::int32_t farthest = s.range_bins - 1, nearer = next_range - 1;
        range_first[i] = nearer < 0 ? 0 : nearer > farthest ? farthest : nearer;
        range_second[i] = next_range > farthest ? farthest : next_range;
        range_share[i] = from_range - static_cast<double>(next_range);
        const auto own_range = static_cast<std::int32_t>(along);
        range_nearest[i] = own_range > farthest ? farthest : own_range;
    }
    if (!s.light) return;
    const double bins_wide = s.sector_rad * s.bins_per_radian, radians_per_bin = 1 / s.bins_per_radian;
    const double per_ring = 1 / s.ring_step_m;
    WEDGESCOPE_INDEPENDENT
    for (std::int32_t i = 0; i < width; ++i) {
        const double rings = radius_m[i] * per_ring;
        const double off = rings - static_cast<double>(static_cast<std::int32_t>(rings + 0.5));
        const double from_ring = (off < 0 ? -off : off) * s.ring_step_m;
        const double left = azimuth_position[i], right = bins_wide - left, edge = left < right ? left : right;
        const double from_edge = bins_wide > 0 ? radius_m[i] * (edge * radians_per_bin) : 1e30;
        // A little more than the pixel that a line is wide.
        const double reach = 1.001 * s.metres_per_pixel;
        const double any = from_ring < reach               ? 1.0
                           : from_edge < 2 * reach         ? 1.0
                           : radius_m[i] > s.mark_radius_m ? 1.0
                                                           : 0.0;
        light[i] = any > 0 ? 1 : 0;
    }
}

}  // namespace

void place_pixels(std::size_t n, std::int64_t column, double y_m, const PixelScene& scene, PixelRow& out) noexcept {
    on_target<place>(n, column, y_m, scene, out);
}

}  // namespace wedgescope
