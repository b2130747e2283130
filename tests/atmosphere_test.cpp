// Air, gases, cloud and fog, against the reference's self-check values and ITU's own validation examples.
#include <catch2/catch.hpp>

#include <cmath>
#include <limits>

#include "lib/atmosphere.hpp"
#include "tests/refusal.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using test::refusal;

namespace {
const Air sea_level = air_of(288.15, 1013.25, 7.5);
}

TEST_CASE("the reference atmosphere at 4 km comes out", "[atmosphere]") {
    // Self-check values of the physics reference, section 11, to the digits printed there.
    const Air air = standard_air(4000, 7.5);
    CHECK_THAT(air.temperature_k, WithinAbs(262.16635, 5e-6));
    CHECK_THAT(air.dry_pressure_hpa, WithinAbs(616.60439, 5e-6));
    CHECK_THAT(air.vapour_g_m3, WithinAbs(1.015015, 5e-7));
    CHECK_THAT(air.vapour_pressure_hpa, WithinRel(1.015015 * 262.16635 / 216.7, 1e-6));
}

TEST_CASE("at sea level the air is at 15 C and 1013.25 hPa, with the humidity asked for", "[atmosphere]") {
    for (const double rho : {0.5, 7.5, 20.0}) {
        const Air air = standard_air(0, rho);
        CHECK(air.temperature_k == 288.15);
        CHECK(air.dry_pressure_hpa == 1013.25);
        CHECK(air.vapour_g_m3 == rho);
        CHECK_THAT(air.vapour_pressure_hpa, WithinRel(rho * 288.15 / 216.7, 1e-15));
    }
}

TEST_CASE("temperature and pressure join where the atmosphere changes its law", "[atmosphere]") {
    // The pressures of the US standard atmosphere 1976 at these geopotential heights, six digits.
    const double pressures[][2] = {
        {11e3, 226.321}, {20e3, 54.7489}, {32e3, 8.68019}, {47e3, 1.10906}, {51e3, 0.669389}};
    for (const auto& [height, pressure] : pressures) {
        const Air below = standard_air(geometric_height_m(height) - 0.01, 7.5),
                  above = standard_air(geometric_height_m(height) + 0.01, 7.5);
        CHECK_THAT(below.dry_pressure_hpa, WithinRel(pressure, 1e-4));
        CHECK_THAT(above.dry_pressure_hpa, WithinRel(pressure, 1e-4));
        CHECK_THAT(below.temperature_k, WithinAbs(above.temperature_k, 1e-4));
    }
    CHECK_THAT(geopotential_height_m(geometric_height_m(11e3)), WithinRel(11e3, 1e-14));
    // (6356.766 * 80) / (6356.766 + 80) km'
    CHECK_THAT(geopotential_height_m(80e3), WithinRel(79005.7, 1e-6));
}

TEST_CASE("vapour halves every 1386 m, and never falls below a mixing ratio of two millionths", "[atmosphere]") {
    CHECK_THAT(standard_air(2000 * std::log(2.0), 20).vapour_g_m3, WithinRel(10, 1e-12));
    for (const double height : {30e3, 40e3, 60e3}) {
        const Air air = standard_air(height, 7.5);
        CHECK_THAT(air.vapour_pressure_hpa / air.dry_pressure_hpa, WithinRel(2e-6, 1e-12));
    }
    CHECK(standard_air(0, 0).vapour_g_m3 > 0);
}

TEST_CASE("the air below -1000 m is that of -1000 m", "[atmosphere]") {
    CHECK(standard_air(-11000, 7.5).dry_pressure_hpa == standard_air(-1000, 7.5).dry_pressure_hpa);
    CHECK(standard_air(-400, 7.5).dry_pressure_hpa > 1013.25);
    CHECK(standard_air(-400, 7.5).vapour_g_m3 > 7.5);
}

TEST_CASE("gases at 10 and 60 GHz come out to the reference's digits", "[atmosphere]") {
    const GasAttenuation ten = gas_attenuation(10e9, sea_level), sixty = gas_attenuation(60e9, sea_level);
    CHECK_THAT(ten.oxygen_db_km, WithinAbs(0.008224417, 5e-10));
    CHECK_THAT(ten.vapour_db_km, WithinAbs(0.005974125, 5e-10));
    CHECK_THAT(sixty.oxygen_db_km, WithinAbs(14.6234748, 5e-8));
    CHECK_THAT(sixty.vapour_db_km, WithinAbs(0.1548418, 5e-8));
    CHECK(ten.db_km() == ten.oxygen_db_km + ten.vapour_db_km);
}

TEST_CASE("gases at the frequencies of ITU's validation examples come out to twelve digits", "[atmosphere]") {
    // ITU-R study group 3, validation examples CG-3M3J-13-ValEx for P.676-13 Annex 1: 1013.25 hPa dry, 7.5 g/m^3, 288.15 K.
    const double rows[][3] = {{12, 0.00869826406877357, 0.00953538822024593},
                              {20, 0.0118835504778076, 0.0970473048151117},
                              {60, 14.6234747964861, 0.154841840636247},
                              {90, 0.0388697110724235, 0.341973394422181},
                              {130, 0.0415090835995228, 0.751844703646129}};
    for (const auto& [ghz, oxygen, vapour] : rows) {
        const GasAttenuation found = gas_attenuation(ghz * 1e9, sea_level);
        CHECK_THAT(found.oxygen_db_km, WithinRel(oxygen, 1e-12));
        CHECK_THAT(found.vapour_db_km, WithinRel(vapour, 1e-12));
    }
}

TEST_CASE("gases absorb at their lines: vapour at 22 and 183 GHz, oxygen at 60 and 119", "[atmosphere]") {
    const auto vapour = [](double ghz) { return gas_attenuation(ghz * 1e9, sea_level).vapour_db_km; };
    const auto oxygen = [](double ghz) { return gas_attenuation(ghz * 1e9, sea_level).oxygen_db_km; };
    CHECK(vapour(22.235) > 1.5 * vapour(18));
    CHECK(vapour(22.235) > 1.5 * vapour(28));
    CHECK(vapour(183.31) > 10 * vapour(150));
    CHECK(oxygen(60) > 100 * oxygen(35));
    CHECK(oxygen(118.75) > 10 * oxygen(100));
}

TEST_CASE("no air, no absorption; no vapour, none by vapour", "[atmosphere]") {
    const GasAttenuation empty = gas_attenuation(10e9, air_of(250, 0, 0));
    CHECK(empty.oxygen_db_km == 0);
    CHECK(empty.vapour_db_km == 0);
    CHECK(gas_attenuation(10e9, air_of(288.15, 1013.25, 0)).vapour_db_km == 0);
    // More vapour absorbs more, somewhat over in proportion: it broadens its own lines.
    const double normal = gas_attenuation(16.5e9, sea_level).vapour_db_km,
                 high = gas_attenuation(16.5e9, air_of(288.15, 1013.25, 20)).vapour_db_km;
    CHECK(high > normal * 20 / 7.5);
    CHECK(high < normal * 20 / 7.5 * 1.2);
}

TEST_CASE("cloud water at 30 GHz and 280 K takes what the reference says", "[atmosphere]") {
    CHECK_THAT(cloud_attenuation_db_km(30e9, 280), WithinAbs(0.6419384, 5e-8));
}

TEST_CASE("small droplets absorb by the imaginary part of (e - 1) / (e + 2)", "[atmosphere]") {
    // Rayleigh: gamma = 0.4343 * 6 pi / lambda[cm] Im(-K) M dB/km, M in g/m^3 (Battan; 6 pi 0.4343 f / 29.979 = 0.27306 f):
    // 0.819 f / (e'' (1 + eta^2)) is 3 times 0.273 f e'' / ((e' + 2)^2 + e''^2), three digits.
    for (const double ghz : {3.0, 9.4, 16.5, 35.0, 94.0, 200.0})
        for (const double kelvin : {264.0, 273.15, 293.0}) {
            const Permittivity e = cloud_water_permittivity(ghz * 1e9, kelvin);
            const double im = -3 * e.imag() / ((e.real() + 2) * (e.real() + 2) + e.imag() * e.imag());
            CHECK_THAT(cloud_attenuation_db_km(ghz * 1e9, kelvin), WithinRel(0.27306 * ghz * im, 1e-3));
        }
    // Static limit at 300 K: 77.66.
    CHECK_THAT(cloud_water_permittivity(1e9, 300).real(), WithinRel(77.66, 5e-3));
    CHECK_THAT(-cloud_water_permittivity(1e9, 300).imag(), WithinRel((77.66 - 5.21) / 20.2, 0.02));
}

TEST_CASE("both ends of the models' ranges are in them", "[atmosphere]") {
    CHECK(gas_attenuation(1e9, sea_level).db_km() > 0);
    CHECK(gas_attenuation(1e12, sea_level).db_km() > 0);
    CHECK(cloud_attenuation_db_km(200e9, 280) > 0);
}

TEST_CASE("what lies outside of the models' ranges is refused by name", "[atmosphere]") {
    CHECK(refusal<InputError>([] { gas_attenuation(0.9e9, sea_level); }) ==
          "frequency is 0.9 GHz; it must be at least 1 and at most 1000");
    CHECK(refusal<InputError>([] { cloud_attenuation_db_km(201e9, 280); }) ==
          "frequency is 201 GHz; it must be at least 1 and at most 200");
    CHECK(refusal<InputError>([] { standard_air(0, 101); }) ==
          "humidity is 101 g/m^3; it must be at least 0 and at most 100");
    CHECK(refusal<InputError>([] { standard_air(2e6, 1); }) ==
          "height is 2000000 m; it must be at least -1000 and at most 1000000");
    CHECK(refusal<InputError>([] { air_of(100, 1013, 1); }) ==
          "temperature is 100 K; it must be at least 150 and at most 400");
    CHECK(refusal<InputError>([] { cloud_attenuation_db_km(30e9, 400); }) ==
          "temperature is 400 K; it must be at least 200 and at most 350");
    const double nan = std::numeric_limits<double>::quiet_NaN();
    CHECK(refusal<InputError>([&] { standard_air(nan, 7.5); }) != test::nothing_refused);
    CHECK(refusal<InputError>([&] { gas_attenuation(nan, sea_level); }) != test::nothing_refused);
}
