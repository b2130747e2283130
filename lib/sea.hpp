// Sea: what water returns, from waves and from its mirror, and how it brightens a far shore.
// Leaves land to backscatter.hpp and the permittivity of water to dielectric.hpp.
//
// Grazing angles are local, from the tangent plane, 0 to 90 degrees. InputError names the model, what was found and what
// is accepted. Source: physics "Sea and water backscatter".
#pragma once
#include <vector>

#include "lib/backscatter.hpp"
#include "lib/dielectric.hpp"
#include "lib/polarisation.hpp"

namespace wedgescope {

// Sea states are Douglas', 0 to 6, whole or between. Wind is that of a fully risen sea.
/// 3.16 SS^0.8, m/s.
double wind_speed_m_s(double sea_state);
/// h_av = 4.52e-3 V^2.5, m: the mean height of waves.
double mean_wave_height_m(double wind_m_s);
/// h_1/3 = 0.04 + 0.1 SS^2.1, m; 1.6 times the mean height.
double significant_wave_height_m(double sea_state);
/// Of the surface: a quarter of the significant height; 0 at sea state 0, which is calm inland water [P].
double rms_wave_height_m(double sea_state);
/// Total, of a clean sea (Cox & Munk): 0.003 + 5.12e-3 U.
double mean_square_slope(double wind_m_s);
inline constexpr double calm_mean_square_slope = 0.001;  ///< of calm inland water [P]

/// Gregers-Hansen & Mital (2012), mean over wind directions: 0.5 to 35 GHz; grazing angles outside 0.1 to 60 degrees are
/// taken as the nearer of these. Sea state 0 (wind below 2 m/s) is not nothing.
Decibel nrl_sea_sigma0(double frequency_hz, Polarisation polarisation, double sea_state, Angle grazing);

/// What GIT's model needs of the sea.
struct GitSea {
    double wave_height_m = 0;  ///< mean; 0: no echo; at most 20
    double wind_m_s = 0;       ///< at most 50
    /// A fully risen sea; state 0 returns no echo.
    static GitSea risen(double sea_state);
};
/// Horst, Dyer & Tuley (1978) (for `evaluate`): 1 to 100 GHz, grazing angles to 15 degrees, below 0.05 taken as 0.05.
///   from_upwind      look direction minus upwind: 0 looks into the wind
///   high_band_hz     where the formulas of the upper band begin: 10 GHz, or 12, so that all of X band has one form
Decibel git_sea_sigma0(double frequency_hz, Polarisation polarisation, const GitSea& sea, Angle grazing,
                       Angle from_upwind, double high_band_hz = 10e9);

/// What the wind's direction makes of the sea's echo, 1 in the mean over azimuth [P]: GIT's contrast exp(k cos(phi)) over that
/// mean, I_0(k); k falls with the grazing angle, to nothing at 1/2.8 rad (20.5 degrees).
///   from_upwind  look direction minus upwind: 0 looks into the wind
double wind_factor(double frequency_hz, Angle grazing, Angle from_upwind);

/// wind_factor() as loops need it: over law_variable() of the grazing angle and cos(from_upwind), linear between entries, which
/// are rounded to float.
class WindTable {
public:
    WindTable() = default;  ///< 1
    explicit WindTable(double frequency_hz);
    double most() const { return most_; }
    double error() const { return error_; }  ///< largest |table / factor - 1|, found when it is built
    double at(double variable, double cosine) const noexcept;

private:
    static constexpr int rows = 64, columns = 64;  // intervals of the variable, of the cosine
    double scale_ = 0, most_ = 1, error_ = 0;      // intervals a unit of the variable
    std::vector<float> entries_;
};

/// Geometric optics: |Gamma_0|^2 / mss sec^4 exp(-tan^2 / mss) of the incidence angle, for HH and VV alike.
///   reflectivity  at normal incidence, of power, 0 to 1;  slope  mean-square, above 0
Decibel quasi_specular_sigma0(double reflectivity, double slope, Angle grazing);

/// nrl_sea_sigma0 up to 60 degrees of grazing; above that its value there plus what the quasi-specular echo exceeds its own
/// value there by [P]: continuous, and at the vertical it is the mirror that counts.
Decibel sea_sigma0(double frequency_hz, Polarisation polarisation, double sea_state, const Water& water, Angle grazing);

/// `nrl`: sea_sigma0 (below 0.1 degree in proportion to the sine), nothing at all at sea state 0: the default of a scene.
BackscatterLaw sea_nrl_law(double frequency_hz, Polarisation polarisation, double sea_state, const Water& water = {});
/// `calm`: the quasi-specular echo of calm inland water alone, nothing more than 12 degrees from the vertical.
BackscatterLaw sea_calm_law(double frequency_hz, Polarisation polarisation, const Water& water = fresh_water);

/// What a bank (or wall) behind water returns more by the ways over the water: the mean of four paths with random
/// phases, 1 + 4 rho^2 + rho^4, 1 to 6, rho = |Gamma(grazing)| exp(-2 (2 pi rms_height sin(grazing) / wavelength)^2).
/// Circular: rho^2 is the mean of H's and V's [P].
///   grazing  of the ray on the level water;  rms_height_m  of its surface, at least 0
double far_shore_gain(Permittivity water, double frequency_hz, Polarisation polarisation, double rms_height_m,
                      Angle grazing);
/// Ground distance of water in front of a bank of this height that those ways need: height / tan(grazing), m.
double far_shore_reach_m(double bank_height_m, Angle grazing);

}  // namespace wedgescope
