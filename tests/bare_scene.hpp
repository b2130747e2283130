// A bare set: a scene whose echoes are sums that can be written down, its run in one thread, and the sum of an image.
#pragma once
#include <cstdint>

#include "lib/engine.hpp"

namespace wedgescope::test {

/// Gain and loss 1 in all directions, no beam and no pulse, sampled exactly: a cell's echo is K sigma / r^4 of what lies in it.
inline Scene bare_scene(double x, double y, double altitude_m, double range_m) {
    Scene s;
    s.platform.xy = PointXY{x, y};
    s.platform.altitude_m = altitude_m;
    s.range_m = range_m;
    s.azimuth_bins = 360;
    s.range_bin_m = 50;
    s.quality = Quality::exact;
    s.refine = false;  // sums over all cells do not need it
    s.radar.antenna.elevation = ElevationPattern::gaussian;
    s.radar.antenna.floor = Decibel(0);
    s.radar.beam_width_error = s.radar.pulse_length_error = false;
    s.display.size = 64;
    return s;
}

/// A bare set over one gamma: E r^2 = K gamma (solid angle).
inline Scene scene_of_one_gamma(double x, double y, double altitude_m, double range_m) {
    Scene s = bare_scene(x, y, altitude_m, range_m);
    s.gamma = Decibel(-15);
    return s;
}

inline RunResult simulate(const Scene& scene, WedgeSource& source, std::int64_t wedges = 0, int threads = 1,
                          bool cull = true) {
    EngineParams params;
    params.threads = threads;
    params.wedges = wedges;
    params.cull = cull;
    return run(resolve(scene, source), source, params);
}

inline double sum_of(const PolarImage<float>& image) {
    double sum = 0;
    for (const float cell : image.cells) sum += static_cast<double>(cell);
    return sum;
}

}  // namespace wedgescope::test
