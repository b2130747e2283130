// Dielectric: permittivities of water and of ground, and how a smooth surface of them reflects.
// Leaves what rough surfaces return to backscatter.hpp and sea.hpp.
#pragma once
#include <complex>
#include <string>
#include <vector>

#include "lib/angle.hpp"

namespace wedgescope {

/// Relative, e' - j e'' (time factor exp(+j w t)): the real part at least 1, the imaginary part at most 0.
using Permittivity = std::complex<double>;

/// What a half space reflects of a plane wave, for horizontal and for vertical polarisation.
struct FresnelAmplitudes {
    std::complex<double> h, v;  ///< of the electric field
};
struct FresnelPowers {
    double h = 0, v = 0;  ///< |amplitude|^2, in [0, 1]; the emissivity of a smooth surface is 1 minus that
};

/// H = (cos i - s) / (cos i + s), V = (eps cos i - s) / (eps cos i + s), s = sqrt(eps - sin^2 i) with Im s <= 0.
///   incidence  from the normal, 0 to 90 degrees
/// InputError: a permittivity or an incidence out of range. Source: physics 8.2.
FresnelAmplitudes fresnel_amplitudes(Permittivity permittivity, Angle incidence);
FresnelPowers fresnel_powers(Permittivity permittivity, Angle incidence);
/// |(1 - sqrt eps) / (1 + sqrt eps)|^2: the same for both polarisations.
double normal_reflectivity(Permittivity permittivity);
/// Where V is reflected least, not at all without loss: incidence atan sqrt |eps|.
Angle brewster_incidence(Permittivity permittivity);

/// Temperature and salinity of water.
struct Water {
    double temperature_c = 15;  ///< 0 to 35
    double salinity_ppt = 35;   ///< 0 to 40; 0: fresh
};
inline constexpr Water fresh_water{15, 0};

/// Klein & Swift (1977), above 0 to 40 GHz. InputError naming what is out of range. Source: physics 8.3.
Permittivity water_permittivity(double frequency_hz, const Water& water);

/// Representative permittivities of ground and of what is built [U] (physics 8.4).
struct Dielectric {
    const char* name;
    Permittivity permittivity;
};
const std::vector<Dielectric>& dielectric_table();
/// InputError naming `key` and the accepted words.
Permittivity permittivity_by_name(const std::string& key, const std::string& name);

}  // namespace wedgescope
