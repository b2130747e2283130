// Permittivities and Fresnel's coefficients, against published values and Fresnel's own forms.
#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>
#include <random>

#include "lib/dielectric.hpp"
#include "lib/error.hpp"

using namespace wedgescope;
using Catch::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

TEST_CASE("sea water has the permittivity and the emissivities that Klein and Swift give", "[dielectric]") {
    const Permittivity sea = water_permittivity(10.7e9, {15, 32});
    CHECK_THAT(sea.real(), WithinAbs(51.4263, 5e-5));
    CHECK_THAT(sea.imag(), WithinAbs(-39.6006, 5e-5));
    const FresnelPowers at_50 = fresnel_powers(sea, Angle::degrees(50));
    CHECK_THAT(1 - at_50.h, WithinAbs(0.261614, 5e-7));
    CHECK_THAT(1 - at_50.v, WithinAbs(0.520293, 5e-7));
    CHECK_THAT(normal_reflectivity(water_permittivity(13.575e9, {20, 35})), WithinAbs(0.6173, 5e-5));
}

TEST_CASE("fresh water does not conduct and is slow to follow", "[dielectric]") {
    // Handbooks' static permittivity of pure water: 87.9 at 0 C, 80.2 at 20 C.
    const Permittivity slow = water_permittivity(1e6, {20, 0});
    CHECK_THAT(slow.real(), WithinAbs(80.2, 0.15));
    CHECK_THAT(slow.imag(), WithinAbs(0, 0.01));
    CHECK_THAT(water_permittivity(1e6, {0, 0}).real(), WithinAbs(87.9, 1));
    // Debye: the loss is largest, half of the step, at the relaxation frequency, 17 GHz at 20 C.
    const Permittivity relaxing = water_permittivity(17e9, {20, 0});
    CHECK_THAT(relaxing.imag(), WithinRel(-0.5 * (80.1 - 4.9), 0.01));
    // Salt: sigma / (2 pi f eps_0), 4.8 S/m for sea water at 20 C, is most of the loss at low frequencies.
    CHECK_THAT(water_permittivity(1e8, {20, 35}).imag(),
               WithinRel(-4.79 / (2 * std::numbers::pi * 1e8 * 8.854e-12), 0.02));
}

TEST_CASE("a smooth surface without loss reflects as Fresnel's sines and tangents say", "[dielectric]") {
    for (const double permittivity : {1.5, 2.6, 3.5, 20.0})
        for (double deg = 1; deg < 90; deg += 4.7) {
            const double i = Angle::degrees(deg).rad(), t = std::asin(std::sin(i) / std::sqrt(permittivity));
            const FresnelAmplitudes both = fresnel_amplitudes(permittivity, Angle::degrees(deg));
            CHECK_THAT(both.h.real(), WithinAbs(-std::sin(i - t) / std::sin(i + t), 1e-12));
            CHECK_THAT(both.v.real(), WithinAbs(std::tan(i - t) / std::tan(i + t), 1e-12));
            CHECK(both.h.imag() == 0);
        }
    CHECK_THAT(normal_reflectivity(4), WithinRel(1.0 / 9, 1e-14));
    CHECK(normal_reflectivity(1) == 0);
}

TEST_CASE("at Brewster's angle V is not reflected, and without loss that is exact", "[dielectric]") {
    for (const double permittivity : {2.6, 5.3, 80.0}) {
        const Angle brewster = brewster_incidence(permittivity);
        CHECK(fresnel_powers(permittivity, brewster).v < 1e-28);
        CHECK(fresnel_powers(permittivity, brewster).h > 0.19);
    }
    // Sea water at Ku: a minimum at 6 to 8 degrees of grazing.
    const Permittivity sea = water_permittivity(16.5e9, {15, 35});
    double least = 1, at_deg = 0;
    for (double grazing = 1; grazing < 30; grazing += 0.05) {
        const double v = fresnel_powers(sea, Angle::degrees(90 - grazing)).v;
        if (v < least) least = v, at_deg = grazing;
    }
    CHECK(at_deg > 6);
    CHECK(at_deg < 8);
    CHECK(least < 0.1);
    CHECK_THAT(90 - brewster_incidence(sea).deg(), WithinAbs(at_deg, 0.5));
}

TEST_CASE("no surface reflects more than it gets, and H never less than V", "[dielectric]") {
    std::mt19937 random(20240611);
    std::uniform_real_distribution<double> exponent(0, 3), part(0, 1);
    for (int k = 0; k < 20000; ++k) {
        const Permittivity permittivity(std::pow(10, exponent(random)),
                                        k % 5 == 0 ? 0.0 : -std::pow(10, 2 * exponent(random) - 3));
        const Angle incidence = Angle::degrees(k % 7 == 0 ? 90 * std::round(part(random)) : 90 * part(random));
        const FresnelPowers powers = fresnel_powers(permittivity, incidence);
        CAPTURE(permittivity, incidence.deg());
        REQUIRE(powers.h <= 1);
        REQUIRE(powers.v <= powers.h + 1e-12);
        REQUIRE(powers.v >= 0);
    }
    const FresnelPowers edge_on = fresnel_powers({20, -10}, Angle::degrees(90));
    CHECK_THAT(edge_on.h, WithinAbs(1, 1e-12));
    CHECK_THAT(edge_on.v, WithinAbs(1, 1e-12));
}

TEST_CASE("what no dielectric is, is refused by name", "[dielectric]") {
    CHECK_THROWS_AS(water_permittivity(41e9, {15, 35}), InputError);
    CHECK_THROWS_WITH(water_permittivity(41e9, {15, 35}),
                      Contains("frequency") && Contains("41 GHz") && Contains("40"));
    CHECK_THROWS_WITH(water_permittivity(0, {15, 35}), Contains("above 0"));
    CHECK_THROWS_WITH(water_permittivity(1e9, {36, 35}), Contains("temperature is 36 C") && Contains("at most 35"));
    CHECK_THROWS_WITH(water_permittivity(1e9, {-1, 35}), Contains("at least 0"));
    CHECK_THROWS_WITH(water_permittivity(1e9, {15, 41}), Contains("salinity is 41 ppt") && Contains("at most 40"));
    CHECK_THROWS_WITH(fresnel_powers({3, 1}, Angle::degrees(10)), Contains("3 + j 1") && Contains("e''"));
    CHECK_THROWS_WITH(fresnel_powers({0.5, 0}, Angle::degrees(10)), Contains("permittivity is 0.5"));
    CHECK_THROWS_WITH(fresnel_powers({3, 0}, Angle::degrees(91)), Contains("incidence is 91 deg"));
    CHECK_THROWS_AS(fresnel_powers({3, 0}, Angle::degrees(std::nan(""))), InputError);
    CHECK_THROWS_AS(fresnel_powers({std::nan(""), 0}, Angle::degrees(1)), InputError);
    CHECK_NOTHROW(fresnel_powers({3, 0}, Angle::degrees(90)));
}

TEST_CASE("grounds are known by name", "[dielectric]") {
    CHECK(permittivity_by_name("permittivity", "dry-soil") == Permittivity(3.5, 0));
    CHECK(permittivity_by_name("permittivity", "wet-soil") == Permittivity(20, -10));
    CHECK(permittivity_by_name("permittivity", "concrete") == Permittivity(5.3, -0.3));
    CHECK_THROWS_WITH(permittivity_by_name("permittivity", "cheese"),
                      Contains("permittivity is 'cheese'") && Contains("dry-sand") && Contains("asphalt"));
    for (const Dielectric& dielectric : dielectric_table()) CHECK(normal_reflectivity(dielectric.permittivity) < 0.5);
}
