#include "lib/sea.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "lib/require_angle.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {
namespace {

constexpr double right_angle = std::numbers::pi / 2;
constexpr double nothing_db = -std::numeric_limits<double>::infinity();
// 45 nepers below the vertical: where the mirror of calm water ends.
constexpr Angle calm_cone = Angle::degrees(78);
constexpr Angle nrl_least = Angle::degrees(0.1), nrl_most = Angle::degrees(60);

void require_sea_state(double sea_state) { require_within("sea state", sea_state, 0, 6, ""); }

void require_nrl(double frequency_hz, double sea_state) {
    require_within("frequency of NRL sea", frequency_hz / 1e9, 0.5, 35, "GHz");
    require_sea_state(sea_state);
}

/// dB, of numbers that were checked.
double nrl_db(double frequency_hz, bool vertical, double sea_state, double psi) {
    struct Row {
        double c1, c2, c3, c4, c5;
    };
    // As in the report's program; its table rounds some of them.
    constexpr Row hh{-73.00, 20.781, 7.351, 25.65, 0.00540}, vv{-50.796, 25.93, 0.7093, 21.588, 0.00211};
    const Row& c = vertical ? vv : hh;
    const double grazing = std::clamp(psi, nrl_least.rad(), nrl_most.rad()), deg = Angle::radians(grazing).deg();
    return c.c1 + c.c2 * std::log10(std::sin(grazing)) +
           (27.5 + c.c3 * deg) * std::log10(frequency_hz / 1e9) / (1 + 0.95 * deg) +
           c.c4 * std::pow(1 + sea_state, 1 / (2 + 0.085 * deg + 0.033 * sea_state)) + c.c5 * deg * deg;
}

double nrl(double frequency_hz, Polarisation polarisation, double sea_state, double psi) {
    return of_polarisation(polarisation, [&](Polarisation hh_or_vv) {
        return Decibel(nrl_db(frequency_hz, hh_or_vv == Polarisation::vv, sea_state, psi)).ratio();
    });
}

double quasi_specular(double reflectivity, double slope, double psi) {
    const double sine = std::sin(psi), square = sine * sine;
    return reflectivity / (slope * square * square) * std::exp(-(1 - square) / (square * slope));
}

/// k of GIT's contrast of upwind and downwind, exp(k cos(phi)); grazing angle in radians.
double upwind_exponent(double frequency_hz, double psi, double high_band_hz) {
    const double lambda = speed_of_light_m_s / frequency_hz;
    return (frequency_hz >= high_band_hz ? 0.25 * std::pow(lambda, -0.33) : 0.2 * std::pow(lambda + 0.015, -0.4)) *
           std::max(0.0, 1 - 2.8 * psi);
}
constexpr double git_high_band_hz = 10e9;
constexpr double windless_psi = 1 / 2.8;

/// Mirrors and waves together, linear.
double sea(double frequency_hz, Polarisation polarisation, double sea_state, double reflectivity, double slope,
           double psi) {
    const double waves = nrl(frequency_hz, polarisation, sea_state, psi);
    if (psi <= nrl_most.rad()) return waves;
    const double mirror =
        quasi_specular(reflectivity, slope, psi) - quasi_specular(reflectivity, slope, nrl_most.rad());
    return waves + of_polarisation(polarisation, [&](Polarisation) { return std::max(0.0, mirror); });
}

}  // namespace

double wind_speed_m_s(double sea_state) {
    require_sea_state(sea_state);
    return 3.16 * std::pow(sea_state, 0.8);
}

double mean_wave_height_m(double wind_m_s) {
    require_within("wind speed", wind_m_s, 0, 50, "m/s");
    return 4.52e-3 * std::pow(wind_m_s, 2.5);
}

double significant_wave_height_m(double sea_state) {
    require_sea_state(sea_state);
    return 0.04 + 0.1 * std::pow(sea_state, 2.1);
}

double rms_wave_height_m(double sea_state) {
    const double significant_m = significant_wave_height_m(sea_state);
    return sea_state == 0 ? 0 : 0.25 * significant_m;
}

double mean_square_slope(double wind_m_s) {
    require_within("wind speed", wind_m_s, 0, 50, "m/s");
    return 0.003 + 5.12e-3 * wind_m_s;
}

Decibel nrl_sea_sigma0(double frequency_hz, Polarisation polarisation, double sea_state, Angle grazing) {
    require_nrl(frequency_hz, sea_state);
    require_angle("grazing angle of NRL sea", grazing, 0, 90);
    return Decibel::from_ratio(nrl(frequency_hz, polarisation, sea_state, grazing.rad()));
}

GitSea GitSea::risen(double sea_state) {
    const double wind = wind_speed_m_s(sea_state);
    return {mean_wave_height_m(wind), wind};
}

Decibel git_sea_sigma0(double frequency_hz, Polarisation polarisation, const GitSea& sea, Angle grazing,
                       Angle from_upwind, double high_band_hz) {
    require_within("frequency of GIT sea", frequency_hz / 1e9, 1, 100, "GHz");
    require_within("mean wave height of GIT sea", sea.wave_height_m, 0, 20, "m");
    require_within("wind speed of GIT sea", sea.wind_m_s, 0, 50, "m/s");
    require_angle("grazing angle of GIT sea", grazing, 0, 15);
    require_angle("look direction from upwind of GIT sea", from_upwind, -360, 360);
    require_within("upper band of GIT sea", high_band_hz / 1e9, 10, 12, "GHz");
    if (sea.wave_height_m == 0 || sea.wind_m_s == 0) return Decibel(nothing_db);

    const double lambda = speed_of_light_m_s / frequency_hz, psi = std::max(grazing.rad(), least_grazing.rad()),
                 h = sea.wave_height_m, wind = sea.wind_m_s;
    const bool high = frequency_hz >= high_band_hz;
    const double roughness = (14.4 * lambda + 5.5) * psi * h / lambda, fourth = std::pow(roughness, 4);
    const double multipath = fourth / (1 + fourth);  // A_i
    const double upwind =
        std::exp(upwind_exponent(frequency_hz, psi, high_band_hz) * std::cos(from_upwind.rad()));  // A_u
    const double q = high ? 1.93 * std::pow(lambda, -0.04) : 1.1 * std::pow(lambda + 0.015, -0.4);
    const double speed = std::pow(1.94 * wind / (1 + wind / 15.4), q);  // A_w
    const double hh =
        (high ? 5.78e-6 * std::pow(psi, 0.547) : 3.9e-6 * lambda * std::pow(psi, 0.4)) * multipath * upwind * speed;
    const double more_db =
        high ? -1.38 * std::log(h) + 3.43 * std::log(lambda) + 1.31 * std::log(psi) + 18.55
        : frequency_hz < 3e9
            ? -1.73 * std::log(h + 0.015) + 3.76 * std::log(lambda) + 2.46 * std::log(psi + 1e-4) + 22.2
            : -1.05 * std::log(h + 0.015) + 1.09 * std::log(lambda) + 1.27 * std::log(psi + 1e-4) + 9.70;
    return Decibel::from_ratio(of_polarisation(polarisation, [&](Polarisation hh_or_vv) {
        return hh_or_vv == Polarisation::vv ? hh * Decibel(more_db).ratio() : hh;
    }));
}

double wind_factor(double frequency_hz, Angle grazing, Angle from_upwind) {
    require_within("frequency of the wind's contrast", frequency_hz / 1e9, 0.5, 100, "GHz");
    require_angle("grazing angle of the wind's contrast", grazing, 0, 90);
    require_angle("look direction from upwind", from_upwind, -360, 360);
    const double k = upwind_exponent(frequency_hz, grazing.rad(), git_high_band_hz);
    return std::exp(k * std::cos(from_upwind.rad())) / std::cyl_bessel_i(0.0, k);
}

WindTable::WindTable(double frequency_hz) {
    // tan(psi) = 4 u^2 / (1 - u^2), law_variable()'s inverse; the first entry is at u = 0, the last where the contrast ends.
    const auto grazing = [](double u) { return std::atan(law_bend * u * u / (1 - u * u)); };
    const double last = law_variable(std::sin(windless_psi));
    scale_ = rows / last;
    const auto exact = [&](double row, double column) {
        const double k = upwind_exponent(frequency_hz, grazing(row / rows * last), git_high_band_hz);
        return std::exp(k * (2 * column / columns - 1)) / std::cyl_bessel_i(0.0, k);
    };
    for (int i = 0; i <= rows; ++i)
        for (int j = 0; j <= columns; ++j) entries_.push_back(i == rows ? 1.0F : static_cast<float>(exact(i, j)));
    scale_ = rounded_significand(scale_, 24);
    most_ = static_cast<double>(*std::max_element(entries_.begin(), entries_.end()));
    for (int i = 0; i < rows; ++i)
        for (int j = 0; j < columns; ++j)
            error_ = std::max(
                error_, std::abs(at((i + 0.5) / scale_, 2 * (j + 0.5) / columns - 1) / exact(i + 0.5, j + 0.5) - 1));
}

double WindTable::at(double variable, double cosine) const noexcept {
    const double row = variable > 0 ? variable * scale_ : 0.0;
    if (!(row < rows) || entries_.empty()) return 1;
    const double column = 0.5 * columns * ((cosine < -1 ? -1 : cosine > 1 ? 1 : cosine) + 1);
    const int i = static_cast<int>(row), whole = static_cast<int>(column), j = whole < columns ? whole : columns - 1;
    const float* const entry = entries_.data() + i * (columns + 1) + j;
    const double part = column - j, here = static_cast<double>(entry[0]),
                 next = static_cast<double>(entry[columns + 1]),
                 a = here + part * (static_cast<double>(entry[1]) - here),
                 b = next + part * (static_cast<double>(entry[columns + 2]) - next);
    return a + (row - i) * (b - a);
}

Decibel quasi_specular_sigma0(double reflectivity, double slope, Angle grazing) {
    require_within("reflectivity of the quasi-specular echo", reflectivity, 0, 1, "");
    require_above("mean-square slope of the quasi-specular echo", slope, 0, "");
    require_angle("grazing angle of the quasi-specular echo", grazing, 0, 90);
    return Decibel::from_ratio(
        quasi_specular(reflectivity, slope, std::clamp(grazing.rad(), least_grazing.rad(), right_angle)));
}

Decibel sea_sigma0(double frequency_hz, Polarisation polarisation, double sea_state, const Water& water,
                   Angle grazing) {
    require_nrl(frequency_hz, sea_state);
    require_angle("grazing angle of sea", grazing, 0, 90);
    return Decibel::from_ratio(sea(frequency_hz, polarisation, sea_state,
                                   normal_reflectivity(water_permittivity(frequency_hz, water)),
                                   mean_square_slope(wind_speed_m_s(sea_state)), grazing.rad()));
}

BackscatterLaw sea_nrl_law(double frequency_hz, Polarisation polarisation, double sea_state, const Water& water) {
    require_sea_state(sea_state);
    if (sea_state == 0) return BackscatterLaw::constant_gamma(0);
    require_nrl(frequency_hz, sea_state);
    const double reflectivity = normal_reflectivity(water_permittivity(frequency_hz, water)),
                 slope = mean_square_slope(wind_speed_m_s(sea_state));
    return BackscatterLaw(
        [=](Angle grazing) { return sea(frequency_hz, polarisation, sea_state, reflectivity, slope, grazing.rad()); },
        nrl_least, nrl_most);
}

BackscatterLaw sea_calm_law(double frequency_hz, Polarisation polarisation, const Water& water) {
    const double reflectivity = normal_reflectivity(water_permittivity(frequency_hz, water));
    return BackscatterLaw(
        [=](Angle grazing) {
            if (grazing <= calm_cone) return 0.0;
            return of_polarisation(polarisation, [&](Polarisation) {
                return quasi_specular(reflectivity, calm_mean_square_slope, grazing.rad());
            });
        },
        calm_cone);
}

double far_shore_gain(Permittivity water, double frequency_hz, Polarisation polarisation, double rms_height_m,
                      Angle grazing) {
    require_above("frequency of the far shore", frequency_hz / 1e9, 0, "GHz");
    require_within("rms wave height of the far shore", rms_height_m, 0, 100, "m");
    require_angle("grazing angle of the far shore", grazing, 0, 90);
    const double psi = std::clamp(grazing.rad(), 0.0, right_angle);
    const FresnelPowers smooth = fresnel_powers(water, Angle::radians(right_angle - psi));
    const double power = polarisation == Polarisation::hh   ? smooth.h
                         : polarisation == Polarisation::vv ? smooth.v
                                                            : 0.5 * (smooth.h + smooth.v);
    const double phase = 2 * std::numbers::pi * rms_height_m * std::sin(psi) * frequency_hz / speed_of_light_m_s;
    const double rho2 = power * std::exp(-4 * phase * phase);
    return 1 + 4 * rho2 + rho2 * rho2;
}

double far_shore_reach_m(double bank_height_m, Angle grazing) {
    require_within("bank height of the far shore", bank_height_m, 0, 10000, "m");
    require_angle("grazing angle of the far shore", grazing, 0, 90);
    constexpr double least_rad = 1e-6;  // so that it stays finite
    return bank_height_m / std::tan(std::max(grazing.rad(), least_rad));
}

}  // namespace wedgescope
