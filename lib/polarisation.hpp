// Polarisation: of the wave that a set sends and receives.
// Leaves what a surface does to it to dielectric.hpp, backscatter.hpp and sea.hpp.
#pragma once

namespace wedgescope {

/// Horizontal or vertical both ways, or circular of one sense both ways (which rain hardly answers to).
enum class Polarisation { hh, vv, circular };

constexpr const char* word(Polarisation polarisation) {
    return polarisation == Polarisation::hh ? "hh" : polarisation == Polarisation::vv ? "vv" : "circular";
}

/// A law that is given for HH and VV, as a linear power, for any polarisation: circular is 3 dB (a half) below the mean
/// of the two powers [P]. `law(Polarisation)` is asked for hh and vv only.
template <class Law>
double of_polarisation(Polarisation polarisation, const Law& law) {
    if (polarisation != Polarisation::circular) return law(polarisation);
    return 0.25 * (law(Polarisation::hh) + law(Polarisation::vv));
}

}  // namespace wedgescope
