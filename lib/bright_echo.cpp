#include "lib/bright_echo.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "lib/far_shore.hpp"
#include "lib/raised_source.hpp"
#include "lib/shade.hpp"

namespace wedgescope {
namespace {

/// Linear gamma of what returns most of the ground; infinite where it hangs on the angle.
double most_gamma(const Scene& scene, const DataBase& db) {
    if (may_need_facets(laws_of(scene))) return infinite;
    const std::vector<ClassGamma> classes = gamma_table(scene.materials, scene.radar.frequency_hz, scene.gamma);
    if (!db.has_culture && !db.has_culture_height) return classes[db.default_class].ground;
    double most = 0;
    for (const ClassGamma& of : classes) most = std::max({most, of.ground, of.wall});
    return most;
}

}  // namespace

RadarParams like_bins_of(const ResolvedScene& scene) {
    const RadarParams usual;
    RadarParams radar = scene.scene.radar;
    constexpr double bins = 4;  // a beam and a pulse
    const double beam_rad = bins * 2 * std::numbers::pi / static_cast<double>(scene.swept.circle_bins),
                 pulses = bins * scene.swept.range_bin_m / usual.pulse_extent_m();
    radar.antenna.beam = Angle::radians(std::max(beam_rad, usual.antenna.beam.rad()));
    radar.pulse_s = std::max(1.0, pulses) * usual.pulse_s;
    radar.bandwidth_hz = usual.bandwidth_hz;
    radar.noise_figure = usual.noise_figure;
    return radar;
}

BrightEcho::BrightEcho(const ResolvedScene& scene, const DataBase& data_base)
    : radar_(like_bins_of(scene)), earth_(scene.earth), height_m_(std::max(0.0, scene.sensor_m - scene.reference_m)),
      gamma_(lights_far_shores(scene.scene, data_base) ? infinite : most_gamma(scene.scene, data_base)) {}

double BrightEcho::over_noise(double range_m) const {
    if (!known()) return infinite;
    constexpr double slope = 0.5, relief_m = 1500;
    const double sunk = 0.5 * range_m * earth_.inverse_radius();
    const auto depression = [&](double below_m) {
        return std::clamp(std::atan2(below_m, range_m) + sunk, -std::numbers::pi / 2, std::numbers::pi / 2);
    };
    const AntennaParams& antenna = radar_.antenna;
    const double least = depression(height_m_ - relief_m), most = depression(height_m_ + relief_m),
                 peak = antenna.tilt.rad() + antenna.knee.rad();
    double gain = elevation_pattern(antenna, std::clamp(peak, least, most));
    constexpr int steps = 64;
    for (int i = 0; i <= steps; ++i)
        gain = std::max(gain, elevation_pattern(antenna, least + (most - least) * i / steps));
    const double echo_w = radar_constant(radar_) * gamma_ * gain * gain * antenna.beam.rad() * radar_.pulse_extent_m() *
                          (height_m_ / range_m + slope) / (range_m * range_m * range_m);
    return echo_w / radar_.noise_power_w();
}

}  // namespace wedgescope
