#include "lib/sensor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

// Twelve digits hide that 1.5 degrees is not exactly 1.5 after a turn through radians.
std::string written(double value) { return fmt::format("{:.12g}", value); }

/// Between points of a pattern. What is steeper no PatternTable resolves: at this slope its error between points is some 1e-4, at
/// a needle's tip up to 0.02 (0.09 dB).
constexpr double most_pattern_slope_db_deg = 500;

std::string found(const char* key, double value, const char* unit) {
    return text(key, " is ", written(value), *unit ? " " : "", unit, "; it must be ");
}

}  // namespace

void require_above(const char* key, double value, double low, const char* unit) {
    if (value > low && std::isfinite(value)) return;
    throw InputError(found(key, value, unit) + "above " + written(low) + (value > low ? " and finite" : ""));
}

void require_within(const char* key, double value, double low, double high, const char* unit) {
    if (value >= low && value <= high) return;
    throw InputError(found(key, value, unit) + text("at least ", written(low), " and at most ", written(high)));
}

void require_above_to(const char* key, double value, double low, double high, const char* unit) {
    if (value > low && value <= high) return;
    throw InputError(found(key, value, unit) + text("above ", written(low), " and at most ", written(high)));
}

double RadarParams::wavelength_m() const { return speed_of_light_m_s / frequency_hz; }

double RadarParams::noise_bandwidth_hz() const { return bandwidth_hz.value_or(1.2 / pulse_s); }

double RadarParams::noise_power_w() const {
    return boltzmann_j_k * standard_temperature_k * noise_bandwidth_hz() * noise_figure.ratio();
}

double RadarParams::pulse_extent_m() const { return 0.5 * speed_of_light_m_s * pulse_s; }

std::int64_t default_azimuth_bins(const RadarParams& radar) {
    return std::max<std::int64_t>(1, std::llround(4 * 360 / radar.antenna.beam.deg()));
}

double default_range_bin_m(const RadarParams& radar) { return radar.pulse_extent_m() / 4; }

std::optional<PatternFault> pattern_fault(std::span<const PatternPoint> points) {
    if (points.size() < 2 || points.size() > most_pattern_points)
        return PatternFault{points.empty() ? 0 : points.size() - 1,
                            text("there ", points.size() == 1 ? "is 1 point" : text("are ", points.size(), " points"),
                                 "; accepted: from 2 to ", most_pattern_points)};
    for (std::size_t i = 0; i < points.size(); ++i) {
        const double beta = points[i].depression.deg(), gain = points[i].gain.db();
        if (!(std::abs(beta) <= 90 + 1e-9))
            return PatternFault{i, text("the depression is ", written(beta), " deg; accepted: from -90 to 90 deg")};
        if (!(gain >= -200 && gain <= 0))
            return PatternFault{i, text("the gain is ", written(gain),
                                        " dB; accepted: from -200 to 0 dB, as it is relative to the peak")};
        if (i == 0) continue;
        const double before = points[i - 1].depression.deg(), step_db = std::abs(gain - points[i - 1].gain.db());
        if (!(beta - before > least_pattern_step_deg * (1 - 1e-6)))
            return PatternFault{
                i, text("the depression is ", written(beta), " deg after ", written(before),
                        " deg; accepted: ascending, ", written(least_pattern_step_deg), " deg or more apart")};
        if (step_db > most_pattern_slope_db_deg * (beta - before) * (1 + 1e-6))
            return PatternFault{i,
                                text("the gain changes by ", written(step_db), " dB in ", written(beta - before),
                                     " deg; accepted: at most ", written(most_pattern_slope_db_deg), " dB a degree")};
    }
    return std::nullopt;
}

void validate(const RadarParams& radar) {
    require_within("frequency", radar.frequency_hz, 1e6, 1e12, "Hz");
    require_within("transmit-power", radar.transmit_power_w, 1e-3, 1e9, "W");
    require_within("gain", radar.gain.db(), -100, 100, "dB");
    require_within("losses", radar.losses.db(), 0, 100, "dB");
    require_within("pulse", radar.pulse_s, 1e-10, 1e-3, "s");
    require_within("noise-figure", radar.noise_figure.db(), 0, 100, "dB");
    if (radar.bandwidth_hz) require_above("bandwidth", *radar.bandwidth_hz, 0, "Hz");
    require_within("bwe-scale", radar.beam_width_scale, 0.1, 20, "");
    require_within("ple-scale", radar.pulse_length_scale, 0.1, 20, "");

    const AntennaParams& antenna = radar.antenna;
    require_within("beam", antenna.beam.deg(), 0.002, 90, "deg");
    // The shaped patterns divide by the sine of the angle below the knee.
    if (antenna.elevation == ElevationPattern::gaussian || antenna.elevation == ElevationPattern::points)
        require_within("antenna-knee", antenna.knee.deg(), -90, 90, "deg");
    else if (!(antenna.knee.deg() > 0 && antenna.knee.deg() < 90))
        throw InputError(found("antenna-knee", antenna.knee.deg(), "deg") +
                         "above 0 and below 90 for the patterns csc2 and cos-csc2");
    require_above_to("antenna-width", antenna.width.deg(), 0, 180, "deg");
    require_within("antenna-exponent", antenna.exponent, 0, 10, "");
    require_within("antenna-floor", antenna.floor.db(), -200, 0, "dB");
    require_within("tilt", antenna.tilt.deg(), -90, 90, "deg");
    if (antenna.elevation != ElevationPattern::points) return;
    if (const auto fault = pattern_fault(antenna.points))
        throw InputError(text("antenna, point ", fault->point + 1, ": ", fault->what));
}

void validate(const ReceiverParams& receiver) {
    require_within("if-gain", receiver.if_gain.db(), -200, 300, "dB");
    require_within("video-gain", receiver.video_gain.db(), -100, 100, "dB");
    if (receiver.stc_range_m) require_above("stc-range", *receiver.stc_range_m, 0, "m");
    require_within("stc-exponent", receiver.stc_exponent, 0, 10, "");
    require_within("stc-max", receiver.stc_max.db(), 0, 200, "dB");
    require_above_to("dynamic-range", receiver.dynamic_range.db(), 0, 200, "dB");
    if (receiver.mds_dbm) require_within("mds", *receiver.mds_dbm, -300, 200, "dBm");
    if (receiver.minimum_range_m) require_within("minimum-range", *receiver.minimum_range_m, 0, 1e7, "m");
    require_within("display-gamma", receiver.display_gamma, 0.1, 10, "");
    require_within("speckle", receiver.speckle_looks, 0, 10000, "");
}

}  // namespace wedgescope
