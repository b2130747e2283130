// Rain: what falling drops take from a wave per kilometre, and what a volume of them sends back.
// Leaves the layer that it fills to path_loss.hpp and the beam in it to rain_echo.hpp.
#pragma once
#include <array>
#include <optional>
#include <string_view>

#include "lib/angle.hpp"
#include "lib/decibel.hpp"

namespace wedgescope {

/// The rain rates of the paper's six words, mm/h [P].
struct RainCategory {
    const char* name;
    double rate_mm_h;
};
inline constexpr std::array<RainCategory, 6> rain_categories{
    {{"clear", 0}, {"drizzle", 0.25}, {"light", 1}, {"moderate", 4}, {"heavy", 16}, {"excessive", 40}}};
/// Nothing for a word that is none of them.
std::optional<double> rain_rate_mm_h(std::string_view category);

inline constexpr double most_rain_mm_h = 500;

/// Where rain ends below, at a slant range: rays that fall below this height there meet ground on their way.
struct RainFloor {
    double range_m, height_m;
    friend bool operator==(const RainFloor&, const RainFloor&) = default;
};

/// Tilt of the polarisation from the horizontal, as the rain's attenuation takes it.
inline constexpr Angle horizontal_tilt = Angle::degrees(0), vertical_tilt = Angle::degrees(90),
                       circular_tilt = Angle::degrees(45);

/// gamma_R = k R^alpha: dB/km one way, R in mm/h.
struct RainLaw {
    double k, alpha;
};
/// Of a ray of this elevation (either sign) and polarisation tilt, 1 GHz to 1000 GHz; InputError outside.
/// Source: physics "Rain attenuation", ITU-R P.838-3.
RainLaw rain_law(double frequency_hz, Angle elevation, Angle tilt);

/// k R^alpha; exactly 0 without rain. InputError unless the rate is 0 to 500 mm/h.
double rain_attenuation_db_km(double frequency_hz, double rate_mm_h, Angle elevation, Angle tilt);

/// Z = 200 R^1.6, mm^6/m^3; InputError unless the rate is 0 to 500 mm/h. Source: physics "Rain volume echo".
double rain_reflectivity_mm6_m3(double rate_mm_h);

/// eta: radar cross-section per volume, m^-1, of drops much smaller than the wavelength (to Ku within about 2 dB), before
/// any cancellation. InputError unless 1 GHz to 1000 GHz and 0 to 500 mm/h. Source: physics "Rain volume echo".
double rain_cross_section_per_m(double frequency_hz, double rate_mm_h);

/// Integrated cancellation ratio: how much less of the rain's echo comes back with circular polarisation. 18 dB up to
/// 4 mm/h, 3 dB less for each factor of 4 above [U, P]. InputError unless the rate is 0 to 500 mm/h.
Decibel rain_cancellation(double rate_mm_h);

}  // namespace wedgescope
