#include "lib/refine.hpp"

#include <algorithm>

#include "lib/lanes.hpp"

namespace wedgescope {
namespace {

/// Bins of fewer bright cells count as if they had so many: a few say little about a picture.
constexpr double least_cells = 16;

constexpr std::size_t together = Refinement::pulse_bins, lanes = 2 * lane_step;

/// Of a row's cells: squares of differences in dB, and how many are bright; each lane's apart, so that every target adds in
/// one order.
struct Doubt {
    float square[lanes] = {}, bright[lanes] = {};
};

/// Of the watts of both halves of n cells (whole registers, and `together` more): the square of half their difference in
/// dB where this is above `least`, and 1 where the mean of what both say of the whole is above the floor. Of echoes that arrive
/// together, from each cell on, their mean. Half of 10 lg (a / b) is (10 / ln 10) artanh((a - b) / (a + b)), here by its Pade
/// approximant (to 1 % up to 7 dB, 8 dB at the most): the same bits everywhere.
WEDGESCOPE_LANES_PART Doubt differences(std::size_t n, float floor, float least, const float* __restrict even,
                                        const float* __restrict odd) noexcept {
    constexpr float scale = 2 / static_cast<float>(together);
    Doubt sums;
    for (std::size_t j = 0; j < n; j += lanes)
        for (std::size_t i = 0; i < lanes; ++i) {
            float a = 0, b = 0;
            for (std::size_t k = 0; k < together; ++k) {
                a += even[j + i + k];
                b += odd[j + i + k];
            }
            a *= scale;
            b *= scale;
            const float y = (a - b) / (a + b + 2 * floor), y2 = y * y;
            const float db = 4.342945F * y * (15 - 4 * y2) / (15 - 9 * y2);
            sums.square[i] += db * db > least * least ? db * db : 0.0F;
            sums.bright[i] += a + b > 2 * floor ? 1.0F : 0.0F;
        }
    return sums;
}

}  // namespace

std::vector<Interval> rows_in_doubt(const WedgeCells& cells, const std::vector<Interval>& among,
                                    const Refinement& refinement) {
    const std::size_t from = std::min(refinement.lead_in, cells.columns()), n = whole_registers(cells.columns() - from);
    std::vector<float> even(from + n + together), odd(from + n + together);
    std::vector<Interval> found;
    for (const Interval rows : among)
        for (std::int64_t row = rows.begin; row < rows.end; ++row) {
            cells.halves(static_cast<std::size_t>(row), even.data(), odd.data());
            const Doubt doubt =
                on_target<differences>(n, static_cast<float>(refinement.floor_w),
                                       static_cast<float>(refinement.cell_db), even.data() + from, odd.data() + from);
            double sum = 0, count = 0;
            for (std::size_t i = 0; i < lanes; ++i) {
                sum += static_cast<double>(doubt.square[i]);
                count += static_cast<double>(doubt.bright[i]);
            }
            if (!(sum > refinement.least_db * refinement.least_db * std::max(count, least_cells))) continue;
            if (found.empty() || found.back().end != row) found.push_back({row, row});
            found.back().end = row + 1;
        }
    return found;
}

}  // namespace wedgescope
