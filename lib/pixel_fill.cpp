#include "lib/pixel_fill.hpp"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "lib/rounding.hpp"

namespace wedgescope {

std::vector<double> paint_cells(const ReceivedPower& received, const DisplaySetting& setting, const Frame& frame) {
    const PolarGrid& grid = received.grid();
    const auto pixels = static_cast<std::size_t>(frame.width * frame.height);
    std::vector<double> power_w(pixels, 0);
    std::vector<std::uint32_t> cells(pixels, 0);

    constexpr int pixel_bits = 20;
    std::vector<double> radius_pixels(grid.range_count(), -1);  // below 0: not shown
    for (std::size_t j = 0; j < grid.range_count(); ++j) {
        const double range_m = grid.range_of_column_m(j);
        if (range_m < setting.range_start_m || range_m > setting.range_m) continue;
        if (const auto radius_m = display_radius_m(setting, range_m))
            radius_pixels[j] = *radius_m / frame.metres_per_pixel;
    }
    for (std::size_t i = 0; i < grid.azimuth_count(); ++i) {
        const double azimuth_rad =
            grid.azimuth_rad(grid.azimuth_bins.begin + static_cast<std::int64_t>(i)) - frame.up_azimuth_rad;
        const double right = std::sin(azimuth_rad), up = std::cos(azimuth_rad);
        for (std::size_t j = 0; j < grid.range_count(); ++j) {
            if (radius_pixels[j] < 0) continue;
            // libm's last bit must not move a cell to the next pixel.
            const auto column = static_cast<std::int64_t>(
                std::floor(rounded(frame.centre_column + radius_pixels[j] * right, pixel_bits)));
            const auto row =
                static_cast<std::int64_t>(std::floor(rounded(frame.centre_row - radius_pixels[j] * up, pixel_bits)));
            if (column < 0 || column >= frame.width || row < 0 || row >= frame.height) continue;
            const auto at = static_cast<std::size_t>(row * frame.width + column);
            power_w[at] += static_cast<double>(received.watts(i * grid.range_count() + j, j));
            ++cells[at];
        }
    }
    for (std::size_t at = 0; at < pixels; ++at)
        power_w[at] = cells[at] > 0 ? power_w[at] / static_cast<double>(cells[at]) : -1;
    return power_w;
}

void fill_holes(std::vector<double>& power_w, const Frame& frame, std::vector<std::uint32_t> holes) {
    std::vector<double> found;
    while (!holes.empty()) {
        found.resize(holes.size());
        oneapi::tbb::parallel_for(
            oneapi::tbb::blocked_range<std::size_t>(0, holes.size(), 4096), [&](const auto& part) {
                for (std::size_t k = part.begin(); k < part.end(); ++k) {
                    const std::int64_t column = holes[k] % frame.width, row = holes[k] / frame.width;
                    double sum = 0;
                    int count = 0;
                    for (std::int64_t r = std::max<std::int64_t>(0, row - 1); r < std::min(row + 2, frame.height); ++r)
                        for (std::int64_t c = std::max<std::int64_t>(0, column - 1);
                             c < std::min(column + 2, frame.width); ++c) {
                            const double beside_w = power_w[static_cast<std::size_t>(r * frame.width + c)];
                            if (beside_w < 0) continue;
                            sum += beside_w;
                            ++count;
                        }
                    found[k] = count > 0 ? sum / count : -1;
                }
            });
        std::size_t left = 0;
        for (std::size_t k = 0; k < holes.size(); ++k) {
            power_w[holes[k]] = found[k];
            if (found[k] < 0) holes[left++] = holes[k];
        }
        if (left == holes.size()) return;
        holes.resize(left);
    }
}

}  // namespace wedgescope
