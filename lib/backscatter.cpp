#include "lib/backscatter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "lib/error.hpp"
#include "lib/require_angle.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {
namespace {

constexpr double right_angle = std::numbers::pi / 2;

/// Radians, from least_grazing up.
double grazing_rad(const char* key, Angle grazing) {
    require_angle(key, grazing, 0, 90);
    return std::clamp(grazing.rad(), least_grazing.rad(), right_angle);
}

Decibel clamped(Decibel sigma0) { return std::min(sigma0, most_sigma0); }

}  // namespace

Decibel gamma_at(Decibel gamma10, double frequency_hz) {
    require_above("frequency of constant gamma", frequency_hz / 1e9, 0, "GHz");
    return Decibel(gamma10.db() + 5 * std::log10(frequency_hz / 10e9));
}

Decibel constant_gamma_sigma0(Decibel gamma10, double frequency_hz, Angle grazing) {
    require_angle("grazing angle of constant gamma", grazing, 0, 90);
    return Decibel(gamma_at(gamma10, frequency_hz).db() + 10 * std::log10(std::max(0.0, std::sin(grazing.rad()))));
}

// ---------------------------------------------------------------------------------------------- Ulaby & Dobson

namespace {

struct UlabyDobsonRow {
    double p1, p2, p3, p4, p5, p6;
};
// Physics 4.2: [class][band][HH, VV].
constexpr UlabyDobsonRow ulaby_dobson_rows[4][3][2] = {
    {{{-24.855, 26.351, 1.146, 0.204, 0, 0}, {-24.951, 28.742, 1.045, -1.681, 0, 0}},
     {{4.337, 6.666, -0.107, -29.709, 0.863, -1.365}, {-42.553, 48.823, 0.722, 5.808, 3.000, -3.142}},
     {{-95.843, 94.457, 0.144, -2.351, -3.556, 2.080}, {-98.320, 99.000, 0.129, -0.791, 5.000, -3.142}}},
    {{{-15.750, 17.931, 2.369, -1.502, 4.592, -3.142}, {-93.606, 99.000, 0.220, -5.509, -2.964, 1.287}},
     {{-33.288, 32.980, 0.510, -1.343, 4.874, -3.142}, {-22.177, 21.891, 1.054, -1.916, 4.555, -2.866}},
     {{-88.494, 99.000, 0.246, 10.297, -1.360, 3.142}, {-16.263, 16.074, 1.873, 1.296, 5.000, -0.695}}},
    {{{-91.950, 99.000, 0.270, 6.980, 1.922, -3.142}, {-91.133, 99.000, 0.294, 8.107, 2.112, -3.142}},
     {{-99.000, 97.280, 0.107, -0.538, 5.000, -2.688}, {-99.000, 97.682, 0.113, -0.779, 5.000, -2.076}},
     {{-99.000, 98.254, 0.098, -0.710, 5.000, -2.225}, {-99.000, 98.741, 0.103, -0.579, 5.000, -2.210}}},
    {{{-87.727, 99.000, 0.322, 10.188, -1.747, 3.142}, {-88.593, 99.000, 0.326, 9.574, 1.969, -3.142}},
     {{-99.000, 97.417, 0.114, -0.837, 5.000, -2.984}, {-99.000, 97.370, 0.119, -1.171, 5.000, -2.728}},
     {{-99.000, 97.863, 0.105, -0.893, 5.000, -2.657}, {-99.000, 97.788, 0.105, -1.017, 5.000, -3.142}}},
};

/// The fit itself, dB, at up to 80 degrees of incidence.
double ulaby_dobson_fit_db(const UlabyDobsonRow& row, double incidence_rad) {
    return row.p1 + row.p2 * std::exp(-row.p3 * incidence_rad) + row.p4 * std::cos(row.p5 * incidence_rad + row.p6);
}

/// Linear, of angles that were checked.
double ulaby_dobson(UlabyDobsonClass surface, UlabyDobsonBand band, Polarisation polarisation, double psi) {
    const double fitted = std::max(psi, ulaby_dobson_least.rad());
    const double slope = psi < fitted ? std::sin(psi) / std::sin(fitted) : 1;
    return of_polarisation(polarisation,
                           [&](Polarisation hh_or_vv) {
                               const auto& rows = ulaby_dobson_rows[static_cast<int>(surface)][static_cast<int>(band)];
                               const UlabyDobsonRow& row = rows[hh_or_vv == Polarisation::vv];
                               return clamped(Decibel(ulaby_dobson_fit_db(row, right_angle - fitted))).ratio();
                           }) *
           slope;
}

}  // namespace

UlabyDobsonBand ulaby_dobson_band(double frequency_hz) {
    require_within("frequency of Ulaby-Dobson", frequency_hz / 1e9, 1, 18, "GHz");
    return frequency_hz < 8e9 ? UlabyDobsonBand::c : frequency_hz < 12e9 ? UlabyDobsonBand::x : UlabyDobsonBand::ku;
}

Decibel ulaby_dobson_sigma0(UlabyDobsonClass surface, double frequency_hz, Polarisation polarisation, Angle grazing) {
    return Decibel::from_ratio(ulaby_dobson(surface, ulaby_dobson_band(frequency_hz), polarisation,
                                            grazing_rad("grazing angle of Ulaby-Dobson", grazing)));
}

BackscatterLaw ulaby_dobson_law(UlabyDobsonClass surface, double frequency_hz, Polarisation polarisation) {
    const UlabyDobsonBand band = ulaby_dobson_band(frequency_hz);
    return BackscatterLaw([=](Angle grazing) { return ulaby_dobson(surface, band, polarisation, grazing.rad()); },
                          ulaby_dobson_least);
}

// ---------------------------------------------------------------------------------------------- Oh

namespace {

double checked_ks(const BareSoil& soil, double frequency_hz) {
    require_within("frequency of Oh", frequency_hz / 1e9, 1, 18, "GHz");
    require_above("rms height of Oh", soil.rms_height_m, 0, "m");
    const double ks = 2 * std::numbers::pi * frequency_hz / speed_of_light_m_s * soil.rms_height_m;
    require_within("k s (2 pi rms height / wavelength) of Oh", ks, 0.1, 6, "");
    return ks;
}

struct OhPowers {
    double vv, hh, hv;
};

/// Linear, of numbers that were checked.
OhPowers oh(Permittivity permittivity, double normal, double ks, double psi) {
    const double fitted = std::max(psi, oh_least.rad()), incidence = right_angle - fitted;
    const double slope = psi < fitted ? std::sin(psi) / std::sin(fitted) : 1;
    const FresnelPowers smooth = fresnel_powers(permittivity, Angle::radians(incidence));
    // A permittivity of 1 reflects nothing: 0 / 0 in the exponent, but nothing in front of it.
    const double exponent = normal > 0 ? 1 / (3 * normal) : std::numeric_limits<double>::infinity();
    const double root_p = 1 - std::pow(incidence / right_angle, exponent) * std::exp(-ks);
    const double q = 0.23 * std::sqrt(normal) * (1 - std::exp(-ks));
    const double g = 0.7 * (1 - std::exp(-0.65 * std::pow(ks, 1.8)));
    const double cosine = std::cos(incidence);
    const double vv = g * cosine * cosine * cosine / root_p * (smooth.v + smooth.h) * slope;
    return {vv, vv * root_p * root_p, vv * q};
}

double oh(Permittivity permittivity, double normal, double ks, Polarisation polarisation, double psi) {
    const OhPowers powers = oh(permittivity, normal, ks, psi);
    return of_polarisation(polarisation, [&](Polarisation hh_or_vv) {
        return std::min(most_sigma0.ratio(), hh_or_vv == Polarisation::vv ? powers.vv : powers.hh);
    });
}

}  // namespace

OhSigma0 oh_sigma0(const BareSoil& soil, double frequency_hz, Angle grazing) {
    const double ks = checked_ks(soil, frequency_hz), psi = grazing_rad("grazing angle of Oh", grazing);
    const OhPowers powers = oh(soil.permittivity, normal_reflectivity(soil.permittivity), ks, psi);
    const auto decibel = [](double power) { return clamped(Decibel::from_ratio(power)); };
    return {decibel(powers.vv), decibel(powers.hh), decibel(powers.hv)};
}

Decibel oh_sigma0(const BareSoil& soil, double frequency_hz, Polarisation polarisation, Angle grazing) {
    const double ks = checked_ks(soil, frequency_hz), psi = grazing_rad("grazing angle of Oh", grazing);
    return Decibel::from_ratio(oh(soil.permittivity, normal_reflectivity(soil.permittivity), ks, polarisation, psi));
}

BackscatterLaw oh_law(const BareSoil& soil, double frequency_hz, Polarisation polarisation) {
    const double ks = checked_ks(soil, frequency_hz), normal = normal_reflectivity(soil.permittivity);
    return BackscatterLaw([permittivity = soil.permittivity, normal, ks, polarisation](
                              Angle grazing) { return oh(permittivity, normal, ks, polarisation, grazing.rad()); },
                          oh_least);
}

// ---------------------------------------------------------------------------------------------- for `evaluate`

Decibel git_land_sigma0(GitLandClass surface, double frequency_hz, double rms_height_m, Angle grazing) {
    struct Row {
        double a, b, c, d;
    };
    constexpr std::array<Row, 7> rows = {{{0.25, 0.83, 0.0013, 2.3},  // soil
                                          {0.023, 1.5, 0.012, 0},     // grass
                                          {0.006, 1.5, 0.012, 0},     // crops
                                          {0.002, 0.64, 0.002, 0},    // trees
                                          {2.0, 1.8, 0.015, 0},       // urban
                                          {0.0246, 1.7, 0.0016, 0},   // wet snow
                                          {0.195, 1.7, 0.0016, 0}}};  // dry snow
    require_within("frequency of GIT land", frequency_hz / 1e9, 8, 12, "GHz");
    require_within("rms height of GIT land", rms_height_m, 0, 1000, "m");
    const Row& row = rows[static_cast<std::size_t>(surface)];
    const double psi = grazing_rad("grazing angle of GIT land", grazing), lambda = speed_of_light_m_s / frequency_hz;
    return clamped(Decibel::from_ratio(row.a * std::pow(psi + row.c, row.b) *
                                       std::exp(-row.d / (1 + 0.1 * rms_height_m / lambda))));
}

Decibel morchin_sigma0(MorchinClass surface, double frequency_hz, Angle grazing) {
    struct Row {
        double a, b, b0;
    };
    constexpr std::array<Row, 4> rows = {{{0.00126, right_angle, 0.14},  // desert
                                          {0.004, right_angle, 0.2},     // farmland
                                          {0.0126, right_angle, 0.4},    // wooded hills
                                          {0.04, 1.24, 0.5}}};           // mountains
    require_within("frequency of Morchin", frequency_hz / 1e9, 0.3, 8, "GHz");
    const Row& row = rows[static_cast<std::size_t>(surface)];
    const double psi = grazing_rad("grazing angle of Morchin", grazing), lambda = speed_of_light_m_s / frequency_hz;
    const double u = std::sqrt(frequency_hz / 1e9) / 4.7;
    const double width = std::tan(row.b0), away = std::tan(row.b - psi) / width;
    return clamped(Decibel::from_ratio(row.a * std::sin(psi) / lambda + u / (width * width) * std::exp(-away * away)));
}

Billingsley billingsley_low_relief(Angle depression) {
    require_angle("depression of Billingsley", depression, 0, 90);
    struct Row {
        double below_deg, mean_db, spread;
    };
    constexpr double at_four = 4 + 1e-9;  // the next row is of more than that
    constexpr std::array<Row, 4> rows = {{{0.25, -33, 3.8}, {0.75, -32, 3.5}, {1.5, -30, 3.0}, {at_four, -27, 2.7}}};
    for (const Row& row : rows)
        if (depression.deg() < row.below_deg) return {Decibel(row.mean_db), row.spread};
    return {Decibel(-25), 2.6};
}

// ---------------------------------------------------------------------------------------------- laws and tables

BackscatterLaw BackscatterLaw::constant_gamma(double gamma) {
    require_within("gamma", gamma, 0, 1e15, "");
    return BackscatterLaw(gamma);
}

double BackscatterLaw::factor(Angle grazing) const {
    if (gamma_) return *gamma_;
    const double psi = std::clamp(grazing.rad(), least_.rad(), right_angle);
    return sigma0_(Angle::radians(psi)) / std::sin(psi);
}

double BackscatterLaw::factor(double sine) const {
    return factor(Angle::radians(std::asin(std::clamp(sine, 0.0, 1.0))));
}

namespace {

constexpr double wanted_db = 0.01;

/// u^2 4 c = x (1 - u^2), so the tangent of the grazing angle is 4 u^2 / (1 - u^2).
Angle grazing_at(double u) { return Angle::radians(std::atan2(law_bend * u * u, (1 - u) * (1 + u))); }

}  // namespace

double law_variable(double sine) noexcept {
    const double x = sine > 0 ? (sine < 1 ? sine : 1.0) : 0.0;
    return std::sqrt(x / (x + law_bend * std::sqrt((1 - x) * (1 + x))));
}

double BackscatterTable::at(double sine) const {
    if (constant_) return *constant_;
    const double reached = (law_variable(sine) - begin_) * scale_, place = reached > 0 ? reached : 0.0;
    const int whole = static_cast<int>(place), i = whole < intervals() ? whole : intervals() - 1;
    const double a = static_cast<double>(entries_[static_cast<std::size_t>(i)]),
                 b = static_cast<double>(entries_[static_cast<std::size_t>(i) + 1]);
    return a + (place - i) * (b - a);
}

BackscatterTable::BackscatterTable(const BackscatterLaw& law, int intervals) : constant_() {
    // Sines are libm's: what comes of them is rounded, as the entries are. (Not by a cast to float and back: where two such
    // numbers are stored side by side, GCC 12's vectoriser of straight code, at -O2, leaves the cast out.)
    const auto rounded = [](double value) { return rounded_significand(value, 24); };
    begin_ = rounded(law_variable(std::sin(law.least().rad())));
    scale_ = rounded(intervals / (1 - begin_));
    if (law.corner()) {
        const double corner = law_variable(std::sin(law.corner()->rad())) - begin_;
        scale_ = rounded(std::max(1.0, std::nearbyint(scale_ * corner)) / corner);
    }
    // The last entry may be short of the vertical by a thousandth of an interval, which then goes on as it is.
    const double places = (1 - begin_) * scale_, last = std::ceil(places - 1e-3);
    entries_.resize(static_cast<std::size_t>(last) + 1);
    for (std::size_t i = 0; i + 1 < entries_.size(); ++i)
        entries_[i] = static_cast<float>(law.factor(grazing_at(begin_ + static_cast<double>(i) / scale_)));
    // The last one is such that the vertical is met.
    const double before = static_cast<double>(entries_[entries_.size() - 2]), vertical = law.factor(1.0);
    entries_.back() = static_cast<float>(before + (vertical - before) / (places - (last - 1)));
    most_ = std::max(static_cast<double>(*std::max_element(entries_.begin(), entries_.end() - 1)), at(1));
}

/// The largest error at `points` places in each interval; gives up where it passes `enough_db`.
double BackscatterTable::misfit_db(const BackscatterLaw& law, int points, double enough_db) const {
    double worst = 0;
    for (int i = intervals() - 1; i >= 0 && worst <= enough_db; --i)
        for (int k = 0; k < points; ++k) {
            const Angle grazing = grazing_at(std::min(1.0, begin_ + (i + (k + 0.5) / points) / scale_));
            const double exact = law.factor(grazing);
            if (exact < faintest) continue;
            worst = std::max(worst, std::abs(10 * std::log10(at(std::sin(grazing.rad())) / exact)));
        }
    return worst;
}

BackscatterTable::BackscatterTable(const BackscatterLaw& law) {
    if (law.gamma()) {
        constant_ = most_ = *law.gamma();
        entries_.assign(2, static_cast<float>(*law.gamma()));
        return;
    }
    constexpr int most_intervals = 8192;
    BackscatterTable best;
    double best_error = std::numeric_limits<double>::infinity();
    for (int n = 32; best_error > wanted_db;) {
        const bool last = n >= most_intervals;
        if (last) n = most_intervals;
        BackscatterTable table(law, n);
        const double enough = last ? std::numeric_limits<double>::infinity() : wanted_db;
        double error = table.misfit_db(law, 4, enough);
        if (last || error <= wanted_db) error = table.misfit_db(law, 16, enough);
        if (last || error <= wanted_db) {
            best_error = error;
            best = std::move(table);
            if (last) break;
        } else {
            // The error falls with the square of the width; what was found need not be the largest.
            n += std::max(1 + n / 16, static_cast<int>(n * std::min(1.0, 0.9 * std::sqrt(error / wanted_db) - 1)));
        }
    }
    *this = std::move(best);
    error_db_ = best_error;
}

}  // namespace wedgescope
