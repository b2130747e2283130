#include "lib/fluctuation.hpp"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>

#include "lib/random.hpp"
#include "lib/receiver.hpp"

namespace wedgescope {
namespace {

enum Stream : std::uint32_t { speckle_stream = 1, noise_stream = 2 };

struct ComplexNormal {
    float re, im;  ///< mean power re^2 + im^2 of 1
};

ComplexNormal draw(std::uint64_t seed, std::int64_t range_bin, std::int64_t azimuth, std::uint32_t look,
                   Stream stream) {
    const PhiloxBlock x =
        philox({static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)},
               {static_cast<std::uint32_t>(range_bin), static_cast<std::uint32_t>(azimuth), look, stream});
    // Box-Muller; libm's results are rounded to float before they meet anything else.
    const double radius = std::sqrt(-std::log(uniform(x[0])));
    const double angle = 2 * std::numbers::pi * uniform(x[1]);
    return {static_cast<float>(radius * std::cos(angle)), static_cast<float>(radius * std::sin(angle))};
}

/// A complex field, rows of equal length.
template <class T>
struct Field {
    std::size_t length = 0;
    std::vector<T> re, im;
    Field(std::size_t rows, std::size_t n) : length(n), re(rows * n), im(rows * n) {}
};

/// Thermal noise of the dwells: complex, mean power `power_w`, correlated over the pulse in range.
class Noise {
public:
    Noise(const BeamSetting& beam, const PolarGrid& grid, Interval range_bins, const FluctuationSetting& setting)
        : setting_(setting), range_bins_(range_bins) {
        const double bins = beam.antenna.beam.rad() / grid.azimuth_step_rad();
        dwell_bins_ = std::max<std::int64_t>(1, std::llround(bins));
        const std::int64_t kinds = beam.range_is_ground ? range_bins.size() : 1;
        for (std::int64_t k = 0; k < kinds; ++k) {
            const double range_m = grid.range_m(range_bins.begin + k);
            const double pulse_m = beam.range_is_ground ? pulse_on_ground_m(beam, 1, range_m) : beam.pulse_extent_m;
            std::vector<double> weights = pulse_weights(static_cast<float>(pulse_m / grid.range_bin_m));
            const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
            for (double& weight : weights) weight = std::sqrt(setting.noise_power_w * weight / total);
            longest_ = std::max(longest_, weights.size());
            weights_.push_back(std::move(weights));
        }
    }

    std::int64_t dwell(std::int64_t azimuth_bin) const { return azimuth_bin / dwell_bins_; }

    void fill(std::int64_t dwell, std::uint32_t look, double* re, double* im) const {
        const auto lead = static_cast<std::int64_t>(longest_) - 1;
        const auto n = static_cast<std::size_t>(range_bins_.size());
        std::vector<ComplexNormal> white;
        white.reserve(n + longest_);
        // Range bins below 0 m too: noise does not begin at the radar.
        for (std::int64_t j = range_bins_.begin - lead; j < range_bins_.end; ++j)
            white.push_back(draw(setting_.seed, j, dwell, look, noise_stream));
        for (std::size_t j = 0; j < n; ++j) {
            const std::vector<double>& weights = weights_[weights_.size() == 1 ? 0 : j];
            double sum_re = 0, sum_im = 0;
            for (std::size_t m = 0; m < weights.size(); ++m) {
                const ComplexNormal& z = white[j + static_cast<std::size_t>(lead) - m];
                sum_re += weights[m] * z.re;
                sum_im += weights[m] * z.im;
            }
            re[j] = sum_re;
            im[j] = sum_im;
        }
    }

private:
    const FluctuationSetting& setting_;
    Interval range_bins_;
    std::int64_t dwell_bins_ = 1;
    std::size_t longest_ = 1;
    std::vector<std::vector<double>> weights_;  ///< for all range bins or for each
};

/// Those that the rows of an image lie in.
struct Dwells {
    std::vector<std::int64_t> all;
    std::vector<std::size_t> of_row;  ///< places in `all`
};
Dwells dwells_of(const PolarGrid& grid, const Noise& noise) {
    Dwells found;
    for (std::int64_t bin = grid.azimuth_bins.begin; bin < grid.azimuth_bins.end; ++bin) {
        const std::int64_t dwell = noise.dwell(bin % grid.circle_bins);
        // Round the circle the last bins may lie in the first ones' dwell.
        const bool first = !found.all.empty() && dwell == found.all.front();
        if (!first && (found.all.empty() || dwell != found.all.back())) found.all.push_back(dwell);
        found.of_row.push_back(first ? 0 : found.all.size() - 1);
    }
    return found;
}

}  // namespace

PolarImage<float> received_power(const PolarImage<float>& echo, const PolarImage<float>& power, const BeamSetting& beam,
                                 const FluctuationSetting& setting, PolarImage<float>&& used, const EchoAround& around,
                                 const Stop* stop) {
    const auto each = [&](std::size_t n, const auto& body) {
        oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::size_t>(0, n), [&](const auto& range) {
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                if (stop) stop->check();
                body(i);
            }
        });
    };
    const PolarGrid& grid = power.grid;
    PolarImage<float> received(grid, std::move(used));
    const std::size_t rows = grid.azimuth_count();
    const bool speckle = setting.speckle_looks > 0;
    if (!speckle && !setting.noise) {
        each(rows, [&](std::size_t i) {
            const float* const from = power.row(i);
            float* const to = received.row(i);
            for (std::size_t j = 0; j < grid.range_count(); ++j)
                to[j] = with_mean_noise(from[j], setting.noise_power_w);
        });
        return received;
    }

    const auto looks = static_cast<std::uint32_t>(std::max(1, setting.speckle_looks));
    const double mean_noise_w = setting.noise ? 0 : setting.noise_power_w;
    const std::size_t echo_rows = speckle ? echo.grid.azimuth_count() : 0;
    std::optional<FilledParts> parts;
    if (speckle && around.empty()) parts.emplace(echo);
    const FilledParts* const filled = parts ? &*parts : nullptr;
    // A strip of ranges at a time, all azimuths of it: memory does not grow with the image.
    const std::int64_t bytes_per_cell = 32;
    const std::int64_t strip =
        strip_bins(beam, grid, static_cast<std::int64_t>(std::max(rows, echo_rows)), bytes_per_cell);
    for (std::int64_t begin = grid.range_bins.begin; begin < grid.range_bins.end; begin += strip) {
        const Interval outputs{begin, std::min(begin + strip, grid.range_bins.end)};
        const auto n = static_cast<std::size_t>(outputs.size());
        const auto offset = static_cast<std::size_t>(begin - grid.range_bins.begin);
        const Resolution resolution(beam, grid.circle_bins, grid.range_bin_m, outputs, Resolution::Of::amplitude);
        if (speckle) require_sources(echo.grid, grid, resolution);
        const std::int64_t source_begin = resolution.sources().begin;
        const auto sources = static_cast<std::size_t>(resolution.sources().size());
        std::optional<Noise> noise;
        Dwells dwells;
        if (setting.noise) {
            noise.emplace(beam, grid, outputs, setting);
            dwells = dwells_of(grid, *noise);
        }

        Field<float> ground(echo_rows, sources);
        Field<double> thermal(dwells.all.size(), n);
        std::vector<double> intensity(rows * n, 0.0);
        for (std::uint32_t look = 0; look < looks; ++look) {
            each(echo_rows, [&](std::size_t i) {
                const std::int64_t azimuth =
                    (echo.grid.azimuth_bins.begin + static_cast<std::int64_t>(i)) % grid.circle_bins;
                const float* const cells = echo.row(i) + (source_begin - echo.grid.range_bins.begin);
                float* const re = ground.re.data() + i * sources;
                float* const im = ground.im.data() + i * sources;
                const EchoAround::Place at =
                    around.empty() ? EchoAround::Place{} : around.at(azimuth, grid.circle_bins);
                const auto more = [&](std::size_t ray) {
                    return around.empty() ? nullptr
                                          : around.rays[ray].data() + (source_begin - echo.grid.range_bins.begin);
                };
                const float *const first = more(at.first), *const second = more(at.second);
                for (std::size_t j = 0; j < sources; ++j) {
                    re[j] = im[j] = 0;
                    const float cell = first ? cells[j] + (first[j] + at.part * (second[j] - first[j])) : cells[j];
                    if (!(cell > 0)) continue;
                    const ComplexNormal z =
                        draw(setting.seed, source_begin + static_cast<std::int64_t>(j), azimuth, look, speckle_stream);
                    const float amplitude = std::sqrt(cell);
                    re[j] = amplitude * z.re;
                    im[j] = amplitude * z.im;
                }
            });
            each(dwells.all.size(), [&](std::size_t d) {
                noise->fill(dwells.all[d], look, thermal.re.data() + d * n, thermal.im.data() + d * n);
            });

            each(rows, [&](std::size_t i) {
                const std::int64_t azimuth =
                    (grid.azimuth_bins.begin + static_cast<std::int64_t>(i)) % grid.circle_bins;
                std::vector<double> re(n), im(n), scratch;
                if (speckle) {
                    const auto rows_of = [&](const std::vector<float>& field) -> Resolution::SourceRow {
                        return [&echo, sources, cells = field.data()](std::int64_t bin) {
                            return cells + echo.grid.row_of(bin) * sources;
                        };
                    };
                    resolution.row(azimuth, rows_of(ground.re), scratch, re, filled);
                    resolution.row(azimuth, rows_of(ground.im), scratch, im, filled);
                } else {
                    const float* const mean = power.row(i) + offset;
                    for (std::size_t j = 0; j < n; ++j) re[j] = std::sqrt(static_cast<double>(mean[j]));
                }
                if (setting.noise) {
                    const std::size_t dwell = dwells.of_row[i] * n;
                    for (std::size_t j = 0; j < n; ++j) {
                        re[j] += thermal.re[dwell + j];
                        im[j] += thermal.im[dwell + j];
                    }
                }
                double* const sum = intensity.data() + i * n;
                for (std::size_t j = 0; j < n; ++j) sum[j] += re[j] * re[j] + im[j] * im[j];
            });
        }
        for (std::size_t i = 0; i < rows; ++i)
            for (std::size_t j = 0; j < n; ++j)
                received.row(i)[offset + j] = static_cast<float>(intensity[i * n + j] / looks + mean_noise_w);
    }
    return received;
}

}  // namespace wedgescope
