#include "lib/refine.hpp"

#include <algorithm>
#include <cmath>

#include "lib/bright_echo.hpp"
#include "lib/engine.hpp"
#include "lib/lanes.hpp"
#include "lib/rounding.hpp"

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

bool refines(const Scene& scene) { return scene.refine && !scene.spokes_per_post && !scene.spokes_per_bin; }

Refinement refinement_of(const ResolvedScene& s, const Sampling& sampling) {
    Refinement refinement;
    if (!refines(s.scene)) return refinement;
    // What all of a bin's spokes make of it is off by half to a ninth of half the difference of its halves. The thresholds: docs/accuracy.md,
    // "Bins in doubt". Of n spokes one half may have one more than the other.
    const double promised_db = promised_error(s.scene.quality).rms_db, n = std::max(2.0, sampling.spokes_per_bin),
                 uneven = rounded_significand((n + 1) / (n - 1), 20);
    refinement.least_db = std::min(4 * promised_db, 0.8);
    refinement.cell_db = std::max(std::min(15 * promised_db, 2.0), rounded_significand(5 * std::log10(uneven), 20));
    // Bins of a pulse, whose echoes add up in the middle of the beam: this floor under their mean is 10 dB over the noise.
    constexpr double bins = static_cast<double>(Refinement::pulse_bins), over_noise = 10;
    RadarParams radar = like_bins_of(s);
    radar.pulse_s = bins * s.swept.range_bin_m / RadarParams{}.pulse_extent_m() * RadarParams{}.pulse_s;
    refinement.floor_w = rounded_significand(over_noise / bins * radar.noise_power_w(), 24);
    refinement.lead_in = static_cast<std::size_t>(s.shown.range_bins.begin - s.swept.range_bins.begin);
    return refinement;
}

}  // namespace wedgescope
