// Rain: attenuation and echo of a volume, against ITU's tables and the reference's self-check values.
#include <catch2/catch.hpp>

#include <cmath>

#include "lib/rain.hpp"
#include "tests/refusal.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using test::refusal;

namespace {
const Angle level = Angle::degrees(0);
}

TEST_CASE("k and alpha are those of P.838-3's table 5", "[rain]") {
    // GHz, k_H, alpha_H, k_V, alpha_V, and half of the last digit of k as printed.
    const double rows[][6] = {{1, 0.0000259, 0.9691, 0.0000308, 0.8592, 5e-8},
                              {10, 0.01217, 1.2571, 0.01129, 1.2156, 5e-6},
                              {20, 0.09164, 1.0568, 0.09611, 0.9847, 5e-6},
                              {30, 0.2403, 0.9485, 0.2291, 0.9129, 5e-5},
                              {100, 1.3671, 0.6815, 1.3680, 0.6765, 5e-5}};
    for (const auto& [ghz, kh, ah, kv, av, half_digit] : rows) {
        const RainLaw h = rain_law(ghz * 1e9, level, horizontal_tilt), v = rain_law(ghz * 1e9, level, vertical_tilt);
        CHECK_THAT(h.k, WithinAbs(kh, half_digit));
        CHECK_THAT(h.alpha, WithinAbs(ah, 5e-5));
        CHECK_THAT(v.k, WithinAbs(kv, half_digit));
        CHECK_THAT(v.alpha, WithinAbs(av, 5e-5));
    }
}

TEST_CASE("rain on slant ways comes out as in ITU's validation examples, to twelve digits", "[rain]") {
    // ITU-R study group 3, validation examples for P.838-3: GHz, mm/h, elevation, tilt; k, alpha, gamma.
    const double rows[][7] = {
        {14.25, 26.48052, 31.076991235657, 0, 0.0397548797329313, 1.12418042813791, 1.58130839366869},
        {29, 26.48052, 31.076991235657, 0, 0.22106803684893, 0.953200051046016, 5.02180188909084},
        {14.25, 63.62668149, 48.2411705405115, 90, 0.0422647354773402, 1.07871664199312, 3.72901263518665}};
    for (const auto& [ghz, rate, elevation, tilt, k, alpha, gamma] : rows) {
        const RainLaw law = rain_law(ghz * 1e9, Angle::degrees(elevation), Angle::degrees(tilt));
        CHECK_THAT(law.k, WithinRel(k, 1e-12));
        CHECK_THAT(law.alpha, WithinRel(alpha, 1e-12));
        CHECK_THAT(rain_attenuation_db_km(ghz * 1e9, rate, Angle::degrees(elevation), Angle::degrees(tilt)),
                   WithinRel(gamma, 1e-12));
    }
}

TEST_CASE("circular polarisation at 16 GHz has the reference's k and alpha, at any elevation", "[rain]") {
    for (const double elevation : {-80.0, 0.0, 30.0}) {
        const RainLaw law = rain_law(16e9, Angle::degrees(elevation), circular_tilt);
        CHECK_THAT(law.k, WithinAbs(0.05590463, 5e-9));
        CHECK_THAT(law.alpha, WithinAbs(1.06570970, 5e-9));
    }
}

TEST_CASE("polarisation matters less the steeper the ray, and not at all straight down", "[rain]") {
    const auto k = [](double elevation, Angle tilt) { return rain_law(20e9, Angle::degrees(elevation), tilt).k; };
    const double across = std::abs(k(0, horizontal_tilt) - k(0, vertical_tilt));
    CHECK_THAT(std::abs(k(-60, horizontal_tilt) - k(-60, vertical_tilt)), WithinRel(0.25 * across, 1e-9));
    CHECK_THAT(k(-90, horizontal_tilt), WithinRel(k(-90, vertical_tilt), 1e-14));
    CHECK(k(-30, horizontal_tilt) == k(30, horizontal_tilt));
    // k alpha mixes as k does: straight down both polarisations are the circular one.
    CHECK_THAT(rain_law(20e9, Angle::degrees(-90), horizontal_tilt).alpha,
               WithinRel(rain_law(20e9, level, circular_tilt).alpha, 1e-12));
}

TEST_CASE("rain takes k R^alpha, more the heavier it is, and the shorter the wave up to 35 GHz", "[rain]") {
    const RainLaw law = rain_law(9.4e9, level, horizontal_tilt);
    CHECK_THAT(rain_attenuation_db_km(9.4e9, 16, level, horizontal_tilt),
               WithinRel(law.k * std::pow(16, law.alpha), 1e-15));
    for (const Angle tilt : {horizontal_tilt, vertical_tilt, circular_tilt}) {
        double before = 0;
        for (const RainCategory& category : rain_categories) {
            const double now = rain_attenuation_db_km(16.5e9, category.rate_mm_h, level, tilt);
            CHECK((category.rate_mm_h == 0 ? now == 0 : now > before));
            before = now;
        }
        before = 0;
        for (double ghz = 1; ghz <= 35; ghz += 0.5) {
            const double now = rain_attenuation_db_km(ghz * 1e9, 4, level, tilt);
            CHECK(now > before);
            before = now;
        }
    }
}

TEST_CASE("the paper's words for rain are rates", "[rain]") {
    CHECK(rain_rate_mm_h("clear") == 0.0);
    CHECK(rain_rate_mm_h("drizzle") == 0.25);
    CHECK(rain_rate_mm_h("light") == 1.0);
    CHECK(rain_rate_mm_h("moderate") == 4.0);
    CHECK(rain_rate_mm_h("heavy") == 16.0);
    CHECK(rain_rate_mm_h("excessive") == 40.0);
    CHECK(!rain_rate_mm_h("wet"));
}

TEST_CASE("2 mm/h at 9 GHz returns what the reference says", "[rain]") {
    CHECK_THAT(rain_reflectivity_mm6_m3(2), WithinAbs(606.2866, 5e-5));
    CHECK_THAT(rain_cross_section_per_m(9e9, 2), WithinAbs(1.401514e-7, 5e-14));
    CHECK(rain_cross_section_per_m(9e9, 0) == 0);
    // Rayleigh: the fourth power of the frequency; Marshall and Palmer: the 1.6th of the rate.
    CHECK_THAT(rain_cross_section_per_m(18e9, 2) / rain_cross_section_per_m(9e9, 2), WithinRel(16, 1e-12));
    CHECK_THAT(rain_cross_section_per_m(9e9, 20) / rain_cross_section_per_m(9e9, 2),
               WithinRel(std::pow(10, 1.6), 1e-12));
}

TEST_CASE("circular polarisation takes 18 dB of the rain's echo, less where drops flatten", "[rain]") {
    CHECK(rain_cancellation(0).db() == 18);
    CHECK(rain_cancellation(0.25).db() == 18);
    CHECK(rain_cancellation(4).db() == 18);
    CHECK_THAT(rain_cancellation(8).db(), WithinAbs(16.5, 1e-12));
    CHECK_THAT(rain_cancellation(16).db(), WithinAbs(15, 1e-12));
    CHECK_THAT(rain_cancellation(64).db(), WithinAbs(12, 1e-12));
    CHECK_THAT(rain_cancellation(40).db(), WithinAbs(18 - 3 * std::log(10.0) / std::log(4.0), 1e-12));
    CHECK(rain_cancellation(most_rain_mm_h).db() > 0);
}

TEST_CASE("rates, frequencies and angles that no rain has are refused by name", "[rain]") {
    CHECK(refusal<InputError>([] { rain_reflectivity_mm6_m3(-1); }) ==
          "rain is -1 mm/h; it must be at least 0 and at most 500");
    CHECK(refusal<InputError>([] { rain_cancellation(501); }) ==
          "rain is 501 mm/h; it must be at least 0 and at most 500");
    CHECK(refusal<InputError>([] { rain_law(0.5e9, level, horizontal_tilt); }) ==
          "frequency is 0.5 GHz; it must be at least 1 and at most 1000");
    CHECK(refusal<InputError>([] { rain_law(9e9, Angle::degrees(91), horizontal_tilt); }) ==
          "elevation is 91 deg; it must be at least -90 and at most 90");
    CHECK(refusal<InputError>([] { rain_law(9e9, level, Angle::degrees(135)); }) ==
          "polarisation tilt is 135 deg; it must be at least -90 and at most 90");
    CHECK(refusal<InputError>([] { rain_cross_section_per_m(2e12, 1); }) != test::nothing_refused);
    CHECK(refusal<InputError>([] { rain_attenuation_db_km(9e9, NAN, level, horizontal_tilt); }) !=
          test::nothing_refused);
}
