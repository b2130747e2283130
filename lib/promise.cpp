#include "lib/promise.hpp"

#include <fmt/format.h>

#include "lib/engine.hpp"

namespace wedgescope {
Promise promise_of(const ResolvedScene& resolved) {
    constexpr double posts = 2;
    constexpr double about = 1.01;  // four, but for a hundredth: bins in round numbers: 37.5 m for a pulse of 149.9 m
    const Scene& scene = resolved.scene;
    const RadarParams& radar = scene.radar;
    const double post_m = resolved.longer_post_m, pulse_m = radar.pulse_extent_m(), beam_deg = radar.antenna.beam.deg(),
                 step_deg = Angle::radians(resolved.shown.azimuth_step_rad()).deg(), bin_m = resolved.shown.range_bin_m;
    Promise promise{promised_error(scene.quality), posts * post_m / radar.antenna.beam.rad(), {}};
    const auto lack = [&](bool lacks, std::string why) {
        if (lacks) promise.lacks.push_back(std::move(why));
    };
    lack(pulse_m < posts * post_m,
         fmt::format("c tau / 2 is {:.4g} m, {:.1f} posts (2 or more)", pulse_m, pulse_m / post_m));
    // `auto` may make fewer of them, whole ones.
    lack(resolved.shown.circle_bins < default_azimuth_bins(radar) && about * beam_deg / step_deg < 4,
         fmt::format("{:.2f} azimuth bins lie in the beam (4 or more)", beam_deg / step_deg));
    lack(bin_m > about * default_range_bin_m(radar),
         fmt::format("{:.2f} range bins lie in c tau / 2 (4 or more)", pulse_m / bin_m));
    lack(!radar.beam_width_error, "bwe is off");
    lack(!radar.pulse_length_error, "ple is off");
    lack(scene.spokes_per_post.has_value(), "spokes-per-post is given");
    lack(scene.spokes_per_bin.has_value(), "spokes-per-bin is given");
    lack(!scene.refine, "refine is off");
    lack(scene.spoke_lead.has_value(), "spoke-lead is given");
    lack(scene.crossings.has_value(), "crossings is given");
    lack(scene.curved_course.has_value(), "course is given");
    return promise;
}

}  // namespace wedgescope
