#include "lib/beam.hpp"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "lib/error.hpp"
#include "lib/lanes.hpp"

namespace wedgescope {
namespace {

constexpr double least_cosine = 0.5;
constexpr double gaussian_cut_beamwidths = 2.24;
// sin(u)/u falls to 1/sqrt 2 at this u: half power of a uniform aperture.
constexpr double uniform_half_power_u = 1.39155737825151;
constexpr double uniform_cut_u = 5 * std::numbers::pi;

double cut_rad(const AntennaParams& antenna) {
    const double beam_rad = antenna.beam.rad();
    if (antenna.azimuth == AzimuthPattern::gaussian) return gaussian_cut_beamwidths * beam_rad;
    return uniform_cut_u / (2 * uniform_half_power_u) * beam_rad;
}

/// Neighbours a side that can return power at all, of a beam drawn `scale` times as wide; each bin once round the circle.
std::int64_t neighbour_bins(const AntennaParams& antenna, double scale, std::int64_t circle_bins) {
    const double step_rad = 2 * std::numbers::pi / static_cast<double>(circle_bins);
    const double reach = std::floor(cut_rad(antenna) * scale / least_cosine / step_rad);
    return static_cast<std::int64_t>(std::min(reach, static_cast<double>(circle_bins / 2)));
}

/// The bin straight behind: on a circle of even count one bin, not one a side.
bool opposite(std::int64_t offset, std::int64_t circle_bins) { return 2 * offset == circle_bins; }

WEDGESCOPE_LANES_PART void take_own(const float* weight, const float* echo, double* sum, std::size_t n) noexcept {
    for (std::size_t j = 0; j < n; ++j) sum[j] = static_cast<double>(weight[j]) * static_cast<double>(echo[j]);
}

WEDGESCOPE_LANES_PART void add_one(const float* weight, const float* echo, double* sum, std::size_t n) noexcept {
    for (std::size_t j = 0; j < n; ++j) sum[j] += static_cast<double>(weight[j]) * static_cast<double>(echo[j]);
}

WEDGESCOPE_LANES_PART void add_pair(const float* weight, const float* left, const float* right, double* sum,
                                    std::size_t n) noexcept {
    for (std::size_t j = 0; j < n; ++j)
        sum[j] += static_cast<double>(weight[j]) * (static_cast<double>(left[j]) + static_cast<double>(right[j]));
}

WEDGESCOPE_LANES_PART void add_scaled(double weight, const double* in, double* sum, std::size_t n) noexcept {
    for (std::size_t j = 0; j < n; ++j) sum[j] += weight * in[j];
}

/// Integral from -1 of the unit hat 1 - |x|.
double hat_integral(double x) {
    if (x <= -1) return 0;
    if (x >= 1) return 1;
    return x < 0 ? 0.5 * (1 + x) * (1 + x) : 1 - 0.5 * (1 - x) * (1 - x);
}

/// How the echo of a bin of ground range lies in it, 0 to 1 from its near edge: that of level ground grows as the arc does,
/// which tells in the first bins from the nadir.
class EchoInBin {
public:
    /// `bin`: counted from the nadir.
    explicit EchoInBin(double bin) : bin_(bin), whole_(bin + 0.5) {}
    /// Nearer than x; the mean of that over an interval.
    double before(double x) const { return x <= 0 ? 0 : x >= 1 ? 1 : x * (bin_ + 0.5 * x) / whole_; }
    double mean_before(double from, double to) const {
        if (to - from < 1e-9) return before(0.5 * (from + to));
        return (integral(to) - integral(from)) / (to - from);
    }

private:
    double integral(double x) const {
        if (x <= 0) return 0;
        const double u = std::min(x, 1.0);
        return u * u * (0.5 * bin_ + u / 6) / whole_ + (x - u);
    }

    double bin_, whole_;
};

/// d_j, of the level surface at a range (an arc where range bins are ground).
double depression_rad(const BeamSetting& setting, double range_m) {
    return setting.range_is_ground
               ? setting.earth.sight(setting.sensor_m, setting.reference_m, range_m).depression_rad
               : level_depression_rad(setting.earth, setting.sensor_m, setting.reference_m, range_m);
}

/// The pulse of one range bin, in bins.
struct PulseOfBin {
    std::vector<double> weights;
    double length;  ///< what they add up to
};
/// Of bins of slant range, where the pulse is as long everywhere.
PulseOfBin slant_pulse(const BeamSetting& setting, double scale, double range_bin_m) {
    const double length = setting.pulse_extent_m * scale / range_bin_m;
    return {pulse_weights(length), length};
}
/// Of one of ground range. The near end of what the pulse lights goes on evenly over a part of the bin; where it leaves the nadir,
/// as a square root, the parts are small.
PulseOfBin ground_pulse(const BeamSetting& setting, double scale, double range_bin_m, std::int64_t range_bin) {
    const auto length_at = [&](double part) {
        const double arc_m = (static_cast<double>(range_bin) + part) * range_bin_m;
        return static_cast<double>(static_cast<float>(pulse_on_ground_m(setting, scale, arc_m) / range_bin_m));
    };
    std::vector<double> lengths{length_at(0), length_at(1)};
    constexpr double even = 1.0 / 16;
    const auto first = static_cast<double>(range_bin);
    const bool leaves_nadir = lengths[0] > first * (1 - 1e-6) && lengths[1] < (first + 1) * (1 - 1e-6);
    if (leaves_nadir || std::abs(lengths[1] - lengths[0]) > even) {
        lengths.pop_back();
        for (double part = even; part <= 1; part += even) lengths.push_back(length_at(part));
    }
    const std::size_t parts = lengths.size() - 1;
    const double share = 1 / static_cast<double>(parts);
    PulseOfBin pulse{{}, 0};
    for (double m = 0; m < *std::max_element(lengths.begin(), lengths.end()) + 1; ++m) {
        const EchoInBin echo(std::max(0.0, first - m));  // of the m-th bin nearer
        double behind = 0;                               // its near end
        for (std::size_t p = 0; p < parts; ++p) {
            const double from = m + static_cast<double>(p) * share;
            behind += share * echo.mean_before(from - lengths[p], from + share - lengths[p + 1]);
        }
        pulse.weights.push_back(std::max(0.0, echo.mean_before(m, m + 1) - behind));
        pulse.length += pulse.weights.back();
    }
    while (pulse.weights.size() > 1 && !(pulse.weights.back() > 0)) pulse.weights.pop_back();
    return pulse;
}

}  // namespace

double two_way_azimuth_pattern(const AntennaParams& antenna, double offset_rad) {
    if (!(std::abs(offset_rad) <= cut_rad(antenna))) return 0;
    const double beamwidths = offset_rad / antenna.beam.rad();
    if (antenna.azimuth == AzimuthPattern::gaussian) return std::exp(-8 * std::numbers::ln2 * beamwidths * beamwidths);
    const double u = 2 * uniform_half_power_u * beamwidths;
    if (std::abs(u) < 1e-8) return 1;
    const double field = std::sin(u) / u;
    return field * field * field * field;
}

double one_way_azimuth_pattern(const AntennaParams& antenna, double offset_rad) {
    return std::sqrt(two_way_azimuth_pattern(antenna, offset_rad));
}

std::int64_t skirt_bins(const BeamSetting& setting, std::int64_t circle_bins) {
    return setting.beam_width_error ? neighbour_bins(setting.antenna, setting.beam_width_scale, circle_bins) : 0;
}

std::int64_t lead_in_bins(const BeamSetting& setting, double range_bin_m) {
    if (!setting.pulse_length_error) return 0;
    double longest_m = setting.pulse_extent_m * setting.pulse_length_scale;
    if (setting.range_is_ground) {
        // Where its near end touches the nadir.
        const double height_m = std::abs(setting.sensor_m - setting.reference_m);
        const auto arc_m = setting.earth.arc_m(setting.sensor_m, setting.reference_m, height_m + longest_m);
        longest_m = arc_m ? *arc_m : std::numbers::pi / setting.earth.inverse_radius();
        // From there on it grows shorter, and on a curved earth longer again: up to the farthest arc that resolve() takes.
        if (setting.earth.inverse_radius() > 0)
            longest_m =
                std::max(longest_m, pulse_on_ground_m(setting, setting.pulse_length_scale, setting.earth.farthest_m()));
    }
    const double bins = longest_m / range_bin_m;
    return static_cast<std::int64_t>(std::ceil(setting.range_is_ground ? static_cast<float>(bins) : bins));
}

double pulse_on_ground_m(const BeamSetting& setting, double scale, double arc_m) {
    const double far_m = setting.earth.slant_range_m(setting.sensor_m, setting.reference_m, arc_m);
    const double begin_m = far_m - setting.pulse_extent_m * scale;
    if (!(begin_m > 0)) return arc_m;
    const auto near_m = setting.earth.arc_m(setting.sensor_m, setting.reference_m, begin_m);
    return near_m ? std::max(0.0, arc_m - *near_m) : arc_m;
}

std::vector<double> pulse_weights(double width_bins) {
    std::vector<double> weights;
    // Bin m nearer feeds this one while m < width + 1.
    for (double m = 0; m < width_bins + 1; ++m) weights.push_back(hat_integral(m) - hat_integral(m - width_bins));
    while (weights.size() > 1 && !(weights.back() > 0)) weights.pop_back();
    return weights;
}

double level_cosine(const BeamSetting& setting, double range_m) {
    return std::max(least_cosine, std::cos(depression_rad(setting, range_m)));
}

Resolution::Resolution(const BeamSetting& setting, std::int64_t circle_bins, double range_bin_m, Interval outputs,
                       Of of)
    : circle_bins_(circle_bins),
      outputs_(outputs), sources_{std::max<std::int64_t>(0, outputs.begin - lead_in_bins(setting, range_bin_m)),
                                  outputs.end},
      skirt_(skirt_bins(setting, circle_bins)), pulse_per_bin_(setting.range_is_ground) {
    const double step_rad = 2 * std::numbers::pi / static_cast<double>(circle_bins);
    const std::int64_t neighbours = neighbour_bins(setting.antenna, 1, circle_bins);
    const auto n = static_cast<std::size_t>(sources_.size());
    const auto offsets = static_cast<std::size_t>(skirt_) + 1;
    const auto root = [of](double power) { return of == Of::power ? power : std::sqrt(power); };

    azimuth_.assign(offsets * n, 0.0f);
    oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::size_t>(0, n, 64), [&](const auto& bins) {
        for (std::size_t j = bins.begin(); j < bins.end(); ++j) {
            const double cosine =
                level_cosine(setting, middle_of_bin(sources_.begin + static_cast<std::int64_t>(j), range_bin_m));
            const auto pattern = [&](std::int64_t offset, double scale) {
                return two_way_azimuth_pattern(setting.antenna,
                                               static_cast<double>(offset) * step_rad * cosine / scale);
            };
            const auto total = [&](std::int64_t widest, double scale) {
                double sum = 0;
                for (std::int64_t offset = 0; offset <= widest; ++offset)
                    sum += (offset == 0 || opposite(offset, circle_bins) ? 1.0 : 2.0) * pattern(offset, scale);
                return sum;
            };
            if (!setting.beam_width_error) {
                azimuth_[j] = static_cast<float>(root(total(neighbours, 1)));
                continue;
            }
            const double scale = setting.beam_width_scale;
            // What the true beam gathers, bin by bin: so the narrowest gives what BWE off gives.
            const double level = scale == 1 ? 1 : total(neighbours, 1) / total(skirt_, scale);
            for (std::int64_t offset = 0; offset <= skirt_; ++offset)
                azimuth_[static_cast<std::size_t>(offset) * n + j] =
                    static_cast<float>(root(pattern(offset, scale) * level));
        }
    });
    reach_.assign(offsets, n);
    for (std::size_t offset = 0; offset < offsets; ++offset)
        while (reach_[offset] > 0 && azimuth_[offset * n + reach_[offset] - 1] == 0) --reach_[offset];

    const std::int64_t kinds = pulse_per_bin_ ? outputs_.size() : 1;
    for (std::int64_t k = 0; k < kinds; ++k) {
        const auto pulse = [&](double scale) {
            return pulse_per_bin_ ? ground_pulse(setting, scale, range_bin_m, outputs_.begin + k)
                                  : slant_pulse(setting, scale, range_bin_m);
        };
        std::vector<double> weights;
        if (!setting.pulse_length_error) {
            // Its length falls into the own bin: on ground range what it would light of an even slope of that depression.
            // Without the beam's least cosine: below the sensor bins hold the less ground the longer the pulse lies on it.
            double length = setting.pulse_extent_m / range_bin_m;
            if (pulse_per_bin_)
                length = static_cast<double>(static_cast<float>(
                    length / std::cos(depression_rad(setting, middle_of_bin(outputs_.begin + k, range_bin_m)))));
            weights.push_back(length);
        } else {
            PulseOfBin drawn = pulse(setting.pulse_length_scale);
            weights = std::move(drawn.weights);
            if (setting.pulse_length_scale != 1) {
                const double level = pulse(1).length / drawn.length;
                for (double& weight : weights) weight *= level;
            }
        }
        for (double& weight : weights) weight = root(weight);
        pulse_.push_back(std::move(weights));
    }
}

void Resolution::row(std::int64_t azimuth_bin, const SourceRow& source, std::vector<double>& scratch,
                     std::span<double> out, const FilledParts* filled) const {
    // Part by part, of source bins and then of outputs, so that shadows, which are most of a low sensor's picture, cost little.
    constexpr std::size_t part = 512;
    const auto n = static_cast<std::size_t>(sources_.size()), outputs = static_cast<std::size_t>(outputs_.size()),
               first = static_cast<std::size_t>(outputs_.begin - sources_.begin);  // output 0 among the sources
    scratch.resize(n);
    double* const beam = scratch.data();
    std::size_t last = 0;  // one past the last source bin that may not be 0, so far
    std::vector<std::size_t> last_of((n + part - 1) / part);
    const auto holds_some = [&](std::int64_t bin, std::size_t begin, std::size_t end) {
        return !filled || filled->any(bin, sources_.begin + static_cast<std::int64_t>(begin),
                                      sources_.begin + static_cast<std::int64_t>(end));
    };
    for (std::size_t begin = 0; begin < n; begin += part) {
        const std::size_t end = std::min(begin + part, n);
        bool any = false;
        if (holds_some(azimuth_bin, begin, end)) {
            on_target<take_own>(azimuth_.data() + begin, source(bins_after(azimuth_bin, 0, circle_bins_)) + begin,
                                beam + begin, end - begin);
            any = true;
        } else {
            std::fill(beam + begin, beam + end, 0.0);
        }
        for (std::int64_t offset = 1; offset <= skirt_; ++offset) {
            const auto index = static_cast<std::size_t>(offset);
            const std::size_t reach = std::min(reach_[index], end);
            if (reach <= begin) continue;
            const float* const weight = azimuth_.data() + index * n + begin;
            const bool pair = !opposite(offset, circle_bins_);
            const bool on_right = holds_some(azimuth_bin + offset, begin, reach),
                       on_left = pair && holds_some(azimuth_bin - offset, begin, reach);
            if (!on_right && !on_left) continue;
            any = true;
            const float* const right = source(bins_after(azimuth_bin + offset, 0, circle_bins_)) + begin;
            if (pair)
                on_target<add_pair>(weight, source(bins_after(azimuth_bin - offset, 0, circle_bins_)) + begin, right,
                                    beam + begin, reach - begin);
            else
                on_target<add_one>(weight, right, beam + begin, reach - begin);
        }
        if (any) last = end;
        last_of[begin / part] = last;
    }

    if (pulse_per_bin_) {
        for (std::size_t j = 0; j < outputs; ++j) {
            const std::vector<double>& pulse = pulse_[j];
            const std::size_t bins = std::min(pulse.size(), first + j + 1);
            out[j] = 0;
            for (std::size_t m = 0; m < bins; ++m) out[j] += pulse[m] * beam[first + j - m];
        }
        return;
    }
    const std::vector<double>& pulse = pulse_.front();
    for (std::size_t begin = 0; begin < outputs; begin += part) {
        const std::size_t end = std::min(begin + part, outputs);
        std::fill(out.begin() + static_cast<std::ptrdiff_t>(begin), out.begin() + static_cast<std::ptrdiff_t>(end),
                  0.0);
        // Sources that feed it: from the pulse's length before it to its last bin.
        const std::size_t lead = pulse.size() - 1, nearest = first + begin > lead ? first + begin - lead : 0;
        if (last_of[(first + end - 1) / part] <= nearest) continue;
        for (std::size_t m = 0; m < pulse.size(); ++m) {
            const std::size_t skip = std::max(begin, m > first ? m - first : 0);  // those that would reach below 0 m
            if (skip < end) on_target<add_scaled>(pulse[m], beam + (first + skip - m), out.data() + skip, end - skip);
        }
    }
}

namespace {

WEDGESCOPE_LANES_PART std::uint8_t some(const float* from, std::size_t n) noexcept {
    std::uint32_t bits = 0;
    for (std::size_t j = 0; j < n; ++j) bits |= std::bit_cast<std::uint32_t>(from[j]);
    return bits != 0;
}

}  // namespace

FilledParts::FilledParts(const PolarImage<float>& image)
    : grid_(image.grid), parts_((image.grid.range_count() + bins - 1) / bins),
      filled_(image.grid.azimuth_count() * parts_) {
    oneapi::tbb::parallel_for(
        oneapi::tbb::blocked_range<std::size_t>(0, grid_.azimuth_count(), 16), [&](const auto& rows) {
            constexpr auto part = static_cast<std::size_t>(bins);
            for (std::size_t i = rows.begin(); i < rows.end(); ++i)
                for (std::size_t p = 0; p < parts_; ++p)
                    filled_[i * parts_ + p] =
                        on_target<some>(image.row(i) + p * part, std::min(part, grid_.range_count() - p * part));
        });
}

std::int64_t strip_bins(const BeamSetting& setting, const PolarGrid& grid, std::int64_t rows,
                        std::int64_t bytes_per_cell) {
    constexpr std::int64_t bytes = std::int64_t{8} << 20;
    const std::int64_t weights = (skirt_bins(setting, grid.circle_bins) + 1) * std::int64_t{sizeof(float)};
    const std::int64_t fits = bytes / (weights + rows * bytes_per_cell);
    // As wide as the lead-in, which each strip has to read again, but no wider than the near caches like.
    const std::int64_t lead = lead_in_bins(setting, grid.range_bin_m),
                       bins = std::clamp<std::int64_t>(std::max(fits, lead), 64, 4096);
    if (!setting.range_is_ground) return bins;
    // Each bin has a pulse of its own, and so has its noise.
    const std::int64_t pulses = 2 * bytes / (2 * (lead + 1) * std::int64_t{sizeof(double)});
    return std::clamp<std::int64_t>(pulses, std::min<std::int64_t>(bins, 64), bins);
}

namespace {

/// Bins of a strip of an image that is made in place: two of them stand beside it, as wide as the near caches like and no narrower
/// than the lead-in, which each has to read again.
std::int64_t strip_in_place(const BeamSetting& setting, const PolarGrid& grid) {
    constexpr std::size_t bytes = std::size_t{1} << 20;
    const auto fits = static_cast<std::int64_t>(bytes / sizeof(float) / std::max<std::size_t>(grid.azimuth_count(), 1));
    const std::int64_t strip = std::max({fits, lead_in_bins(setting, grid.range_bin_m), std::int64_t{64}});
    return setting.range_is_ground ? std::min(strip, strip_bins(setting, grid, 0, 0))
                                   : strip;  // each bin has its pulse
}

}  // namespace

std::size_t weight_bytes(const BeamSetting& setting, const PolarGrid& grid) {
    const std::int64_t strip = std::max(strip_bins(setting, grid, 0, 0), strip_in_place(setting, grid)),
                       lead = lead_in_bins(setting, grid.range_bin_m),
                       sources = std::min(strip + lead, grid.range_bins.end);  // none lie before the sensor
    const auto azimuths = static_cast<std::size_t>(skirt_bins(setting, grid.circle_bins) + 1);
    const auto pulses = static_cast<std::size_t>(setting.range_is_ground ? std::min(strip, grid.range_bins.end) : 1);
    return azimuths * static_cast<std::size_t>(sources) * sizeof(float) +
           pulses * static_cast<std::size_t>(lead + 1) * sizeof(double);
}

EchoAround::Place EchoAround::at(std::int64_t azimuth_bin, std::int64_t circle_bins) const {
    const auto n = static_cast<std::int64_t>(rays.size());
    const std::int64_t bin = bins_after(azimuth_bin, 0, circle_bins),
                       halves = (2 * bin + 1) * n,  // of a bin, times rays
        first = halves / (2 * circle_bins);
    const double part = static_cast<double>(halves - first * 2 * circle_bins) / static_cast<double>(2 * circle_bins);
    return {static_cast<std::size_t>(first), static_cast<std::size_t>((first + 1) % n), static_cast<float>(part)};
}

namespace {

/// The power image, a strip of ranges at a time.
class Gathering {
public:
    Gathering(const PolarImage<float>& echo, const PolarGrid& shown, const BeamSetting& setting,
              const EchoAround& around, const Stop* stop)
        : echo_(echo), shown_(shown), setting_(setting), around_(around), stop_(stop), filled_(echo) {
        for (const std::vector<float>& ray : around.rays)
            if (!ray.empty() && ray.size() != echo.grid.range_count())
                throw Error("what is around has other range bins than the echo image");
    }

    /// Of the range bins of `strip`, the i-th azimuth shown to where to(i) says, called right before.
    template <class To>
    void gather(Interval strip, To&& to) const {
        const Resolution resolution(setting_, shown_.circle_bins, shown_.range_bin_m, strip, Resolution::Of::power);
        require_sources(echo_.grid, shown_, resolution);
        const auto skip = static_cast<std::size_t>(resolution.sources().begin - echo_.grid.range_bins.begin);
        const Resolution::SourceRow source = [&](std::int64_t azimuth_bin) {
            return echo_.row(echo_.grid.row_of(azimuth_bin)) + skip;
        };
        // Much the same all over the beam, so beam and pulse make one row of each ray.
        std::vector<std::vector<double>> more(around_.rays.size());
        std::vector<double> beside;
        for (std::size_t k = 0; k < more.size(); ++k) {
            if (around_.rays[k].empty()) continue;
            more[k].resize(static_cast<std::size_t>(strip.size()));
            const float* const from = around_.rays[k].data() + skip;
            resolution.row(
                0, [&](std::int64_t) { return from; }, beside, more[k]);
        }
        oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::size_t>(0, shown_.azimuth_count(), 4),
                                  [&](const auto& rows) {
                                      std::vector<double> scratch;
                                      std::vector<double> sums(static_cast<std::size_t>(strip.size()));
                                      for (std::size_t i = rows.begin(); i < rows.end(); ++i) {
                                          if (stop_) stop_->check();
                                          const std::int64_t azimuth =
                                              shown_.azimuth_bins.begin + static_cast<std::int64_t>(i);
                                          resolution.row(azimuth, source, scratch, sums, &filled_);
                                          float* const out = to(i);
                                          if (!more.empty()) {
                                              const EchoAround::Place at = around_.at(azimuth, shown_.circle_bins);
                                              const double part = at.part;
                                              const std::vector<double>&a = more[at.first], &b = more[at.second];
                                              for (std::size_t j = 0; j < sums.size(); ++j)
                                                  sums[j] += a[j] + part * (b[j] - a[j]);
                                          }
                                          for (std::size_t j = 0; j < sums.size(); ++j)
                                              out[j] = static_cast<float>(sums[j]);
                                      }
                                  });
    }

private:
    const PolarImage<float>& echo_;
    const PolarGrid& shown_;
    const BeamSetting& setting_;
    const EchoAround& around_;
    const Stop* stop_;
    FilledParts filled_;
};

}  // namespace

PolarImage<float> power_image(const PolarImage<float>& echo, const PolarGrid& shown, const BeamSetting& setting,
                              PolarImage<float>&& used, const EchoAround& around, const Stop* stop) {
    PolarImage<float> power(shown, std::move(used));
    if (shown.cells() == 0) return power;
    const Gathering gathering(echo, shown, setting, around, stop);
    const std::int64_t strip = strip_bins(setting, shown, 0, 0);
    for (std::int64_t begin = shown.range_bins.begin; begin < shown.range_bins.end; begin += strip)
        gathering.gather({begin, std::min(begin + strip, shown.range_bins.end)},
                         [&](std::size_t i) { return power.row(i) + (begin - shown.range_bins.begin); });
    return power;
}

PolarImage<float> power_in_place(PolarImage<float>&& echo, const BeamSetting& setting, const EchoAround& around,
                                 const Stop* stop) {
    PolarImage<float> image = std::move(echo);
    const PolarGrid grid = image.grid;
    if (grid.cells() == 0) return image;
    const std::int64_t strip = strip_in_place(setting, grid);
    if (4 * strip > grid.range_bins.size()) return power_image(image, grid, setting, {}, around, stop);
    const Gathering gathering(image, grid, setting, around, stop);
    PolarGrid part = grid;
    part.range_bins = {0, strip};
    PolarImage<float> gathered(part, {}), waiting(part, {});
    // From far to near, for an echo reaches only farther bins: a strip is put where its echoes were while the next one, which
    // needs none of these, is gathered.
    Interval last{grid.range_bins.end, grid.range_bins.end};
    const auto put = [&](std::size_t i) {
        std::copy_n(waiting.row(i), last.size(), image.row(i) + (last.begin - grid.range_bins.begin));
    };
    while (last.begin > grid.range_bins.begin) {
        const Interval own{std::max(last.begin - strip, grid.range_bins.begin), last.begin};
        gathering.gather(own, [&](std::size_t i) {
            put(i);
            return gathered.row(i);
        });
        std::swap(gathered, waiting);
        last = own;
    }
    for (std::size_t i = 0; i < grid.azimuth_count(); ++i) put(i);
    return image;
}

void require_sources(const PolarGrid& echo, const PolarGrid& shown, const Resolution& resolution) {
    if (echo.circle_bins != shown.circle_bins || echo.range_bin_m != shown.range_bin_m)
        throw InputError("the echo image has other azimuth or range bins than the power image asked for");
    const Interval range = resolution.sources();
    const bool range_held = range.begin >= echo.range_bins.begin && range.end <= echo.range_bins.end;
    const Interval gathered{shown.azimuth_bins.begin - resolution.skirt(), shown.azimuth_bins.end + resolution.skirt()};
    if (!range_held || !echo.holds_azimuths(gathered))
        throw InputError(
            "the echo image is too narrow for this beam and pulse: it must hold what is shown, "
            "the beam's skirt to both sides and the pulse's length before it");
}

}  // namespace wedgescope
