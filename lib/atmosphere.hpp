// Atmosphere: the air at a height, and what gases, cloud and fog take from a wave of one frequency per kilometre.
// Leaves rain to rain.hpp and the way of a ray through the air to path_loss.hpp.
#pragma once
#include "lib/dielectric.hpp"

namespace wedgescope {

/// Air of one place.
struct Air {
    double temperature_k = 288.15;
    double dry_pressure_hpa = 1013.25;  ///< without the vapour's
    double vapour_g_m3 = 0;             ///< density of the water vapour
    double vapour_pressure_hpa = 0;     ///< rho T / 216.7
};

/// Air of given temperature (150 to 400 K), dry pressure (0 to 2000 hPa) and vapour density (0 to 500 g/m^3).
/// InputError outside of these.
Air air_of(double temperature_k, double dry_pressure_hpa, double vapour_g_m3);

inline constexpr double normal_vapour_g_m3 = 7.5;  ///< at sea level: `normal` of the paper
inline constexpr double high_vapour_g_m3 = 20;     ///< `high` [P]
inline constexpr double most_vapour_g_m3 = 100;
/// Air below this height counts as air of this height.
inline constexpr double lowest_air_m = -1000;

/// Mean annual global reference atmosphere at a geometric height above sea level of at most 1e6 m, with
/// rho = rho0 exp(-h / 2 km) of vapour (rho0 from 0 to 100 g/m^3), at least a mixing ratio of 2e-6. Above 51 km' the
/// temperature of 47 km' is kept [P]. InputError for NaN and for what is above.
/// Source: physics "Reference atmosphere", ITU-R P.835-6.
Air standard_air(double height_m, double vapour_at_sea_level_g_m3);

/// Geopotential height h' = 6356.766 h / (6356.766 + h), both in metres, and back.
double geopotential_height_m(double height_m);
double geometric_height_m(double geopotential_m);

struct GasAttenuation {
    double oxygen_db_km;  ///< with the dry continuum
    double vapour_db_km;
    double db_km() const { return oxygen_db_km + vapour_db_km; }
};
/// Line by line at 1 GHz to 1000 GHz; InputError outside. One way. Source: physics "Gaseous attenuation",
/// ITU-R P.676-13 Annex 1.
GasAttenuation gas_attenuation(double frequency_hz, const Air& air);

/// Of liquid water, by the double Debye model: 1 GHz to 1000 GHz, 200 to 350 K; InputError outside. Source: physics "Cloud and fog".
Permittivity cloud_water_permittivity(double frequency_hz, double temperature_k);

/// K_l of droplets much smaller than the wavelength: dB/km for each g/m^3 of liquid water, one way. 1 GHz to 200 GHz,
/// 200 to 350 K; InputError outside. Source: physics "Cloud and fog", ITU-R P.840-8.
double cloud_attenuation_db_km(double frequency_hz, double temperature_k);

inline constexpr double medium_fog_g_m3 = 0.05;  ///< visibility 300 m
inline constexpr double thick_fog_g_m3 = 0.5;    ///< visibility 50 m

}  // namespace wedgescope
