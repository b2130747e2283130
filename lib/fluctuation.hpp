// Fluctuation: speckle of the ground and thermal noise of the receiver, drawn per resolution cell.
// Leaves the means to beam.hpp; off (0 looks, no noise) the power image passes unchanged.
#pragma once
#include "lib/beam.hpp"

namespace wedgescope {

struct FluctuationSetting {
    int speckle_looks = 0;     ///< 0: none
    bool noise = false;        ///< thermal noise fluctuates; off: the receiver adds its mean
    double noise_power_w = 0;  ///< k T0 B F
    std::uint64_t seed = 1;
};

/// Received power (signal + thermal noise), watts, over the grid of `power`.
///  * neither: power + mean noise.
///  * speckle: for each look one complex normal per echo cell times the square root of its echo, filtered by the
///    two-way voltage beam and the pulse (weights: square roots of the power weights), squared, looks averaged;
///    the mean is the power image.
///  * noise: a complex normal field correlated over tau in range and independent from beam dwell to beam dwell (one
///    dwell = one beamwidth of azimuth bins, held constant within it), added to the complex signal when speckle is on;
///    with speckle off added to a signal of fixed amplitude sqrt(power).
/// Draws are keyed by (seed; global range bin, global azimuth bin, look, stream). Source: physics "Fluctuation
/// statistics and random numbers".
/// `used`: an image whose memory may serve again. `around`: as power_image() had it. `stop`: looked at between rows.
PolarImage<float> received_power(const PolarImage<float>& echo, const PolarImage<float>& power, const BeamSetting& beam,
                                 const FluctuationSetting& setting, PolarImage<float>&& used = {},
                                 const EchoAround& around = {}, const Stop* stop = nullptr);

}  // namespace wedgescope
