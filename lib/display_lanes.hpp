// Display lanes: where the pixels of a row come from, many side by side. Leaves what they show to display.cpp.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

namespace wedgescope {

/// Pixels at a time.
inline constexpr std::size_t pixel_lanes = 256;

/// What all pixels of a picture share.
struct PixelScene {
    double centre_column = 0, metres_per_pixel = 0, up_azimuth_rad = 0;
    /// Range on the display's own scale from the radius on the tube: sqrt(rise^2 + s^2 growth w(s^2 / Re^2)) for gpi, w the
    /// squared chord over the squared arc; else radius + delay.
    bool chord = false;
    double rise_m = 0, growth = 1, inverse_radius = 0, delay_m = 0;
    double least_range_m = 0, most_range_m = 0, most_radius_m = 0;
    double bins_per_metre = 0, bins_per_radian = 0;
    double first_azimuth = 0, first_range = 0;
    std::int32_t circle_bins = 0, azimuth_bins = 0, range_bins = 0;
    bool wraps = false;  ///< the azimuth bins go round the circle
    // What may add light: rings, marks beyond a radius, edges of the sector.
    bool light = false;
    double ring_step_m = 1, mark_radius_m = 0, sector_rad = 0;  ///< sector: its width; 0: none
};

/// A value between the centres of two bins: (1 - share) of the first + share of the second.
struct PixelBins {
    std::array<std::int32_t, pixel_lanes> first, second, nearest;
    std::array<double, pixel_lanes> share;
};

struct PixelRow {
    std::array<double, pixel_lanes> radius_m, range_m, azimuth_rad;
    std::array<double, pixel_lanes> azimuth_position;  ///< in bins from the first one
    PixelBins azimuth, range;
    std::array<std::int32_t, pixel_lanes> shown;  ///< 1: lies in the picture's range and sector
    std::array<std::int32_t, pixel_lanes> light;  ///< 1: something may shine there beside the ground
};

/// Pixels column, column + 1, ... (n of them) of the row whose middle is `y_m` above the tube's centre. Of pixels that are not
/// shown the bins are any of the image's. Only + - * / and square roots: the azimuth by a series with an error below 1e-10,
/// the chord by one with an error below 1e-12 relative for arcs up to 0.3 Re; positions rounded to 2^-20 bin.
void place_pixels(std::size_t n, std::int64_t column, double y_m, const PixelScene& scene, PixelRow& out) noexcept;

}  // namespace wedgescope
