#include "tools/doubts.hpp"

#include <fmt/format.h>

#include <cmath>

namespace wedgescope {

std::array<std::string, doubt_count> doubts(const RunResult& r) {
    std::array<std::string, doubt_count> lines;
    const auto count = [&](State s) { return r.report.states[static_cast<std::size_t>(s)]; };
    const double range_km = r.scene.scene.range_m.value_or(0) * 1e-3;
    if (count(State::seen) + count(State::unknown) == 0 && count(State::shadow) == 0)
        lines[nothing_there] =
            fmt::format("nothing of the terrain lies within the range of {:.4g} km and the sector", range_km);
    else if (count(State::seen) + count(State::unknown) == 0)
        lines[nothing_seen] = "no ground is seen: all within range and sector is hidden or void";
    else if (r.scope.lit == 0)
        lines[nothing_lit] = r.scene.scene.receiver.minimum_range_m.value_or(0) * 1e-3 >= range_km
                                 ? "minimum-range is beyond the range: nothing is received"
                                 : "every echo stays below the tube's black level (a higher if-gain shows more)";
    const double step_deg = Angle::radians(r.scene.swept.azimuth_step_rad()).deg(),
                 beam_deg = r.scene.scene.radar.antenna.beam.deg();
    if (r.scene.scene.radar.beam_width_error && step_deg > 0.5001 * beam_deg)
        lines[wide_bins] = fmt::format(
            "azimuth bins of {:.4g} deg are wider than half the beam of {:.4g} deg: powers come out too "
            "high (azimuth-bins {:.0f} or more)",
            step_deg, beam_deg, std::ceil(720 / beam_deg));
    return lines;
}

}  // namespace wedgescope
