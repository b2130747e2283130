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

namespace {

/// Calls of(place) for the pixels round one, itself too.
template <class Of>
void for_each_round(std::size_t place, const Frame& frame, const Of& of) {
    const std::int64_t column = static_cast<std::int64_t>(place) % frame.width,
                       row = static_cast<std::int64_t>(place) / frame.width;
    for (std::int64_t r = std::max<std::int64_t>(0, row - 1); r < std::min(row + 2, frame.height); ++r)
        for (std::int64_t c = std::max<std::int64_t>(0, column - 1); c < std::min(column + 2, frame.width); ++c)
            of(static_cast<std::size_t>(r * frame.width + c));
}

}  // namespace

void fill_holes(std::vector<double>& power_w, const Frame& frame, std::vector<std::uint32_t> holes, const Stop* stop) {
    if (holes.empty()) return;
    std::vector<std::uint8_t> waits(power_w.size(), 0);
    for (const std::uint32_t hole : holes) waits[hole] = 1;
    const auto mean_round = [&](std::uint32_t hole) {
        double sum = 0;
        int count = 0;
        for_each_round(hole, frame, [&](std::size_t at) {
            if (power_w[at] < 0) return;
            sum += power_w[at];
            ++count;
        });
        return count > 0 ? sum / count : -1;
    };
    std::vector<double> found;
    std::vector<std::uint32_t> next;
    next.reserve(holes.size());
    // All in the first pass, then those beside what the last one filled: no others have a neighbour now.
    for (; !holes.empty(); holes.swap(next)) {
        if (stop) stop->check();
        found.resize(holes.size());
        const oneapi::tbb::blocked_range<std::size_t> all(0, holes.size(), 4096);
        oneapi::tbb::parallel_for(all, [&](const auto& part) {
            for (std::size_t k = part.begin(); k < part.end(); ++k) found[k] = mean_round(holes[k]);
        });
        for (std::size_t k = 0; k < holes.size(); ++k) {
            waits[holes[k]] = found[k] < 0 ? 1 : 0;
            power_w[holes[k]] = found[k];
        }
        next.clear();
        for (const std::uint32_t hole : holes) {
            if (power_w[hole] < 0) continue;
            for_each_round(hole, frame, [&](std::size_t at) {
                if (!waits[at]) return;
                waits[at] = 0;
                next.push_back(static_cast<std::uint32_t>(at));
            });
        }
    }
}

}  // namespace wedgescope
