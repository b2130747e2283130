#include "lib/rain.hpp"

#include <cmath>
#include <numbers>
#include <span>

#include "lib/sensor.hpp"

namespace wedgescope {
namespace {

struct Bell {
    double a, b, c;
};

// ITU-R P.838-3, tables 1 to 4. The last two bells of alpha_V nearly cancel: all digits count.
constexpr Bell k_h[] = {{-5.33980, -0.10008, 1.13098},
                        {-0.35351, 1.26970, 0.45400},
                        {-0.23789, 0.86036, 0.15354},
                        {-0.94158, 0.64552, 0.16817}};
constexpr Bell k_v[] = {{-3.80595, 0.56934, 0.81061},
                        {-3.44965, -0.22911, 0.51059},
                        {-0.39902, 0.73042, 0.11899},
                        {0.50167, 1.07319, 0.27195}};
constexpr Bell alpha_h[] = {{-0.14318, 1.82442, -0.55187},
                            {0.29591, 0.77564, 0.19822},
                            {0.32177, 0.63773, 0.13164},
                            {-5.37610, -0.96230, 1.47828},
                            {16.1721, -3.29980, 3.43990}};
constexpr Bell alpha_v[] = {{-0.07771, 2.33840, -0.76284},
                            {0.56727, 0.95545, 0.54039},
                            {-0.20238, 1.14520, 0.26809},
                            {-48.2991, 0.791669, 0.116226},
                            {48.5833, 0.791459, 0.116479}};

double regression(std::span<const Bell> bells, double m, double c, double x) {
    double sum = m * x + c;
    for (const Bell& bell : bells) {
        const double u = (x - bell.b) / bell.c;
        sum += bell.a * std::exp(-u * u);
    }
    return sum;
}

void require_rate(double rate_mm_h) { require_within("rain", rate_mm_h, 0, most_rain_mm_h, "mm/h"); }

}  // namespace

std::optional<double> rain_rate_mm_h(std::string_view category) {
    for (const RainCategory& known : rain_categories)
        if (category == known.name) return known.rate_mm_h;
    return std::nullopt;
}

RainLaw rain_law(double frequency_hz, Angle elevation, Angle tilt) {
    require_within("frequency", frequency_hz / 1e9, 1, 1000, "GHz");
    require_within("elevation", elevation.deg(), -90, 90, "deg");
    require_within("polarisation tilt", tilt.deg(), -90, 90, "deg");
    const double x = std::log10(frequency_hz / 1e9);
    const double kh = std::pow(10.0, regression(k_h, -0.18961, 0.71147, x)),
                 kv = std::pow(10.0, regression(k_v, -0.16398, 0.63297, x)),
                 ah = regression(alpha_h, 0.67849, -1.95537, x), av = regression(alpha_v, -0.053739, 0.83433, x);
    const double cosine = std::cos(elevation.rad()), w = cosine * cosine * std::cos(2 * tilt.rad());
    const double k = (kh + kv + (kh - kv) * w) / 2;
    return {k, (kh * ah + kv * av + (kh * ah - kv * av) * w) / (2 * k)};
}

double rain_attenuation_db_km(double frequency_hz, double rate_mm_h, Angle elevation, Angle tilt) {
    require_rate(rate_mm_h);
    const RainLaw law = rain_law(frequency_hz, elevation, tilt);
    return rate_mm_h > 0 ? law.k * std::pow(rate_mm_h, law.alpha) : 0;
}

double rain_reflectivity_mm6_m3(double rate_mm_h) {
    require_rate(rate_mm_h);
    return 200 * std::pow(rate_mm_h, 1.6);
}

double rain_cross_section_per_m(double frequency_hz, double rate_mm_h) {
    require_within("frequency", frequency_hz / 1e9, 1, 1000, "GHz");
    constexpr double water_factor = 0.93;  // |K|^2 of liquid water
    constexpr double m3_per_mm6_m3 = 1e-18;
    const double lambda2 = std::pow(speed_of_light_m_s / frequency_hz, 2);
    return std::pow(std::numbers::pi, 5) * water_factor * rain_reflectivity_mm6_m3(rate_mm_h) * m3_per_mm6_m3 /
           (lambda2 * lambda2);
}

Decibel rain_cancellation(double rate_mm_h) {
    require_rate(rate_mm_h);
    constexpr double most_db = 18, round_up_to_mm_h = 4, db_a_factor_of_4 = 3;
    if (rate_mm_h <= round_up_to_mm_h) return Decibel(most_db);
    return Decibel(most_db - db_a_factor_of_4 * std::log2(rate_mm_h / round_up_to_mm_h) / 2);
}

}  // namespace wedgescope
