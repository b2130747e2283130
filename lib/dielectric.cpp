#include "lib/dielectric.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "lib/error.hpp"
#include "lib/require_angle.hpp"

namespace wedgescope {
namespace {

constexpr double vacuum_permittivity_f_m = 8.8541878128e-12;

void require_permittivity(Permittivity permittivity) {
    const double real = permittivity.real(), loss = -permittivity.imag();
    if (real >= 1 && loss >= 0 && std::isfinite(real) && std::isfinite(loss)) return;
    throw InputError(text("permittivity is ", real, loss < 0 ? " + j " : " - j ", std::abs(loss),
                          "; it must be e' - j e'' with e' at least 1 and e'' at least 0"));
}

}  // namespace

FresnelAmplitudes fresnel_amplitudes(Permittivity permittivity, Angle incidence) {
    require_permittivity(permittivity);
    require_angle("incidence", incidence, 0, 90);
    const double cosine = std::max(0.0, std::cos(incidence.rad())), sine = std::sin(incidence.rad());
    // eps lies on or below the real axis, and so does the principal root of what is left of it; but the sign of a zero
    // decides below the negative half of the axis.
    std::complex<double> s = std::sqrt(permittivity - sine * sine);
    if (s.imag() > 0) s = -s;
    return {(cosine - s) / (cosine + s), (permittivity * cosine - s) / (permittivity * cosine + s)};
}

FresnelPowers fresnel_powers(Permittivity permittivity, Angle incidence) {
    const FresnelAmplitudes amplitudes = fresnel_amplitudes(permittivity, incidence);
    return {std::norm(amplitudes.h), std::norm(amplitudes.v)};
}

double normal_reflectivity(Permittivity permittivity) { return fresnel_powers(permittivity, Angle::radians(0)).h; }

Angle brewster_incidence(Permittivity permittivity) {
    require_permittivity(permittivity);
    return Angle::radians(std::atan(std::sqrt(std::abs(permittivity))));
}

Permittivity water_permittivity(double frequency_hz, const Water& water) {
    require_above_to("frequency of water's permittivity", frequency_hz / 1e9, 0, 40, "GHz");
    require_within("water temperature", water.temperature_c, 0, 35, "C");
    require_within("water salinity", water.salinity_ppt, 0, 40, "ppt");
    const double t = water.temperature_c, t2 = t * t, t3 = t2 * t;
    const double salt = water.salinity_ppt, salt2 = salt * salt, salt3 = salt2 * salt;
    const double still = (87.134 - 1.949e-1 * t - 1.276e-2 * t2 + 2.491e-4 * t3) *
                         (1 + 1.613e-5 * salt * t - 3.656e-3 * salt + 3.210e-5 * salt2 - 4.232e-7 * salt3);
    const double relaxation_s = (1.768e-11 - 6.086e-13 * t + 1.104e-14 * t2 - 8.111e-17 * t3) *
                                (1 + 2.282e-5 * salt * t - 7.638e-4 * salt - 7.760e-6 * salt2 + 1.105e-8 * salt3);
    const double d = 25 - t;
    const double b = 2.033e-2 + 1.266e-4 * d + 2.464e-6 * d * d - salt * (1.849e-5 - 2.551e-7 * d + 2.551e-8 * d * d);
    const double conductivity_s_m =
        salt * (0.182521 - 1.46192e-3 * salt + 2.09324e-5 * salt2 - 1.28205e-7 * salt3) * std::exp(-d * b);
    const double omega = 2 * std::numbers::pi * frequency_hz, fast = 4.9;
    const std::complex<double> relaxed = (still - fast) / std::complex<double>(1, omega * relaxation_s);
    return fast + relaxed - std::complex<double>(0, conductivity_s_m / (omega * vacuum_permittivity_f_m));
}

const std::vector<Dielectric>& dielectric_table() {
    static const std::vector<Dielectric> table = {
        {"dry-sand", {2.6, 0}},    {"dry-soil", {3.5, 0}},  {"asphalt", {3.2, 0}},
        {"concrete", {5.3, -0.3}}, {"wet-soil", {20, -10}},
    };
    return table;
}

Permittivity permittivity_by_name(const std::string& key, const std::string& name) {
    std::string words;
    for (const Dielectric& dielectric : dielectric_table()) {
        if (name == dielectric.name) return dielectric.permittivity;
        words += (words.empty() ? "" : ", ") + std::string(dielectric.name);
    }
    throw InputError(text(key, " is '", name, "'; it must be one of ", words));
}

}  // namespace wedgescope
