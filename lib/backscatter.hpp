// Backscatter: what a unit of land surface returns, sigma0 of grazing angle, frequency and polarisation; and the table
// that a class' law becomes for the sweep.
// Leaves water to sea.hpp and which class follows which law to material.hpp.
//
// Every sigma0 is that of a unit of true surface, as a Decibel (its ratio() is linear; "nothing" is minus infinity, ratio
// 0). Grazing angles are local, from the tangent plane, 0 to 90 degrees; below 0.05 they are taken as 0.05, and sigma0
// ends at +10 dB, but for constant gamma, which needs neither. InputError names the model, what was found and what is
// accepted. Source: physics "Land backscatter".
#pragma once
#include <functional>
#include <optional>
#include <vector>

#include "lib/angle.hpp"
#include "lib/decibel.hpp"
#include "lib/dielectric.hpp"
#include "lib/polarisation.hpp"

namespace wedgescope {

inline constexpr Angle least_grazing = Angle::degrees(0.05);
inline constexpr Decibel most_sigma0{10};

/// Gamma at a frequency above 0, from that at 10 GHz: gamma10 + 5 log10(f / 10 GHz).
Decibel gamma_at(Decibel gamma10, double frequency_hz);
/// gamma sin(grazing).
Decibel constant_gamma_sigma0(Decibel gamma10, double frequency_hz, Angle grazing);

/// Ulaby & Dobson (1989): mean fits, 1 to 18 GHz.
enum class UlabyDobsonClass { soil, grass, shrubs, short_vegetation };
/// The rows of C serve from 1 GHz (those of L and S are not in the table), of X from 8, of Ku from 12 to 18; laws do not
/// blend at the borders.
enum class UlabyDobsonBand { c, x, ku };
UlabyDobsonBand ulaby_dobson_band(double frequency_hz);
/// P1 + P2 exp(-P3 inc) + P4 cos(P5 inc + P6) down to 10 degrees of grazing, below that in proportion to its sine.
Decibel ulaby_dobson_sigma0(UlabyDobsonClass surface, double frequency_hz, Polarisation polarisation, Angle grazing);
inline constexpr Angle ulaby_dobson_least = Angle::degrees(10);  ///< grazing

/// Bare soil of Oh, Sarabandi & Ulaby (1992).
struct BareSoil {
    Permittivity permittivity{3.5, 0};
    double rms_height_m = 0.01;
};
struct OhSigma0 {
    Decibel vv, hh, hv;
};
/// 1 to 18 GHz (measured up to X band; beyond that only k s counts [P]), 0.1 <= k s <= 6. The fit ends at 70 degrees of
/// incidence; at smaller grazing angles it goes on in proportion to their sine [P], up to 90 as it stands.
OhSigma0 oh_sigma0(const BareSoil& soil, double frequency_hz, Angle grazing);
Decibel oh_sigma0(const BareSoil& soil, double frequency_hz, Polarisation polarisation, Angle grazing);
inline constexpr Angle oh_least = Angle::degrees(20);  ///< grazing

/// GIT land (for `evaluate`): the coefficients of X band, 8 to 12 GHz.
enum class GitLandClass { soil, grass, crops, trees, urban, wet_snow, dry_snow };
/// A (psi + C)^B exp(-D / (1 + 0.1 s / lambda)); only soil depends on the rms height s, at least 0.
Decibel git_land_sigma0(GitLandClass surface, double frequency_hz, double rms_height_m, Angle grazing);

/// Morchin (for `evaluate`), 0.3 to 8 GHz: a peak round the vertical on top of a constant gamma.
enum class MorchinClass { desert, farmland, wooded_hills, mountains };
Decibel morchin_sigma0(MorchinClass surface, double frequency_hz, Angle grazing);

/// Billingsley's interim model of rural low relief (for `evaluate`), of the depression angle, 0 to 90 degrees.
struct Billingsley {
    Decibel mean_strength;
    double weibull_spread = 0;  ///< a_w
};
Billingsley billingsley_low_relief(Angle depression);

/// What a class returns at one frequency and polarisation, as the sweep needs it: a piece of surface that shows the
/// projected area a returns factor(sine of its local grazing angle) times a, where the factor is sigma0 / sine. Below the
/// angle where a law begins the factor stays what it is there: sigma0 goes on in proportion to the sine, so that
/// what is seen edge-on returns nothing [P].
class BackscatterLaw {
public:
    static BackscatterLaw constant_gamma(double gamma);  ///< linear, at least 0; 0 returns nothing
    /// sigma0 linear, asked for grazing angles from `least` (above 0) to 90 degrees.
    ///   corner  between the two, where the law bends sharply, if it does
    BackscatterLaw(std::function<double(Angle grazing)> sigma0, Angle least, std::optional<Angle> corner = {})
        : sigma0_(std::move(sigma0)), least_(least), corner_(corner) {}

    std::optional<double> gamma() const { return gamma_; }  ///< of a constant gamma
    Angle least() const { return least_; }
    std::optional<Angle> corner() const { return corner_; }
    /// Sines below 0 are taken as 0, above 1 as 1.
    double factor(double sine) const;
    double factor(Angle grazing) const;

private:
    explicit BackscatterLaw(double gamma) : gamma_(gamma) {}
    std::optional<double> gamma_;
    std::function<double(Angle)> sigma0_;
    Angle least_ = least_grazing;
    std::optional<Angle> corner_;
};

BackscatterLaw ulaby_dobson_law(UlabyDobsonClass surface, double frequency_hz, Polarisation polarisation);
BackscatterLaw oh_law(const BareSoil& soil, double frequency_hz, Polarisation polarisation);

/// What tables of laws run over: of the sine x of the grazing angle
///   u = sqrt(x / (x + 4 c)), c = sqrt(1 - x^2);
/// near the vertical u runs with the incidence angle, near grazing with the square root of the sine, which are where laws
/// change fastest. Only + - * / and sqrt, so the same bits on every machine. One for all laws, so that a piece of ground has
/// one, whatever its class. Sines below 0 are taken as 0, above 1 as 1.
inline constexpr double law_bend = 4;
double law_variable(double sine) noexcept;

/// A law's factor over law_variable(), linear between entries, which are rounded to float. An entry stands on the law's
/// corner, so the last one may stand beyond the vertical. There are as many entries as keep `error_db` within 0.01.
class BackscatterTable {
public:
    BackscatterTable() = default;  ///< returns nothing
    explicit BackscatterTable(const BackscatterLaw& law);

    /// The factor at a sine; below 0 as at 0, above 1 as at 1.
    double at(double sine) const;
    /// Of a constant gamma the exact number, for every angle; then there is one entry (twice).
    std::optional<double> constant() const { return constant_; }
    double most() const { return most_; }          ///< largest factor, of all angles
    double error_db() const { return error_db_; }  ///< largest |table / law|, where the factor is `faintest` or more
    static constexpr double faintest = 1e-8;

    /// For loops that do the same as at(): place = max((law_variable() - begin) scale, 0), entry i = place rounded down, at most
    /// intervals - 1; entries[i] + (place - i) (entries[i + 1] - entries[i]).
    const float* data() const { return entries_.data(); }
    int intervals() const { return static_cast<int>(entries_.size()) - 1; }
    double begin() const { return begin_; }
    double scale() const { return scale_; }

private:
    /// About `intervals` of them.
    BackscatterTable(const BackscatterLaw& law, int intervals);
    double misfit_db(const BackscatterLaw& law, int points, double enough_db) const;

    std::optional<double> constant_ = 0;
    std::vector<float> entries_{0, 0};
    double begin_ = 0, scale_ = 0, most_ = 0, error_db_ = 0;
};

}  // namespace wedgescope
