// Moments and tails of speckle and of K-distributed clutter, against closed forms and integrals.
#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>

#include "lib/error.hpp"
#include "lib/intensity_statistics.hpp"

using namespace wedgescope;
using Catch::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

TEST_CASE("a log amplifier reads speckle low", "[statistics]") {
    constexpr double db = 10 / std::numbers::ln10, euler = 0.57721566490153286;
    const SpeckleMoments one = speckle_moments(1);
    CHECK_THAT(one.mean.db(), WithinAbs(-2.507, 5e-4));
    CHECK_THAT(one.deviation_db, WithinAbs(5.570, 5e-4));
    // digamma(1) = -Euler's constant, trigamma(1) = pi^2 / 6; each look more adds 1 / N and takes 1 / N^2 away.
    double digamma = -euler, trigamma = std::numbers::pi * std::numbers::pi / 6;
    for (int looks = 1; looks <= 100; ++looks) {
        const SpeckleMoments many = speckle_moments(looks);
        CHECK_THAT(many.mean.db(), WithinAbs(db * (digamma - std::log(looks)), 1e-12));
        CHECK_THAT(many.deviation_db, WithinRel(db * std::sqrt(trigamma), 1e-12));
        digamma += 1.0 / looks;
        trigamma -= 1.0 / looks / looks;
    }
    // Half a look: digamma(1/2) = -Euler - 2 ln 2, trigamma(1/2) = pi^2 / 2.
    const SpeckleMoments half = speckle_moments(0.5);
    CHECK_THAT(half.mean.db(), WithinAbs(db * (-euler - std::log(2)), 1e-12));
    CHECK_THAT(half.deviation_db, WithinRel(db * std::numbers::pi / std::numbers::sqrt2, 1e-12));
    CHECK_THROWS_AS(speckle_moments(0), InputError);
    CHECK_THROWS_WITH(speckle_moments(-1), Contains("looks is -1") && Contains("above 0"));
}

TEST_CASE("the K distribution exceeds as its Bessel function says", "[statistics]") {
    CHECK_THAT(k_distribution_exceedance(1.5, 2), WithinAbs(0.1397314, 5e-8));
    // K of order n + 1/2 has a closed form.
    for (const double t : {1e-6, 0.01, 0.5, 1.0, 2.0, 10.0, 100.0}) {
        const double x1 = 2 * std::sqrt(0.5 * t);  // nu = 1/2: P = e^-x
        CHECK_THAT(k_distribution_exceedance(0.5, t), WithinRel(std::exp(-x1), 1e-11));
        const double x3 = 2 * std::sqrt(1.5 * t);  // nu = 3/2: P = (1 + x) e^-x
        CHECK_THAT(k_distribution_exceedance(1.5, t), WithinRel((1 + x3) * std::exp(-x3), 1e-11));
        const double x5 = 2 * std::sqrt(2.5 * t);  // nu = 5/2: P = (1 + x + x^2 / 3) e^-x
        CHECK_THAT(k_distribution_exceedance(2.5, t), WithinRel((1 + x5 + x5 * x5 / 3) * std::exp(-x5), 1e-11));
    }
    for (const double shape : {0.01, 0.1, 1.0, 37.5, 10000.0}) CHECK(k_distribution_exceedance(shape, 0) == 1);
    // Many facets are speckle.
    CHECK_THAT(k_distribution_exceedance(10000, 3), WithinRel(std::exp(-3), 1e-3));
    CHECK(k_distribution_exceedance(10000, 3) > std::exp(-3));
    CHECK(k_distribution_exceedance(0.1, 10) > k_distribution_exceedance(1, 10));
}

TEST_CASE("the K distribution's moments are integrals of its tail", "[statistics]") {
    for (const double shape : {0.3, 1.5, 6.0, 80.0}) {
        // E[I] = int P dt, E[I^2] = int 2 t P dt, over ln t.
        double mean = 0, square = 0;
        const double step = 0.01;
        for (double w = -60; w < 12; w += step) {
            const double t = std::exp(w), p = k_distribution_exceedance(shape, t);
            mean += p * t * step;
            square += 2 * t * p * t * step;
        }
        CHECK_THAT(mean, WithinRel(1, 1e-9));
        CHECK_THAT(square, WithinRel(k_distribution_second_moment(shape), 1e-9));
    }
    CHECK(k_distribution_second_moment(1) == 4);
    CHECK_THAT(k_distribution_second_moment(10000), WithinAbs(2, 3e-4));
    CHECK_THROWS_WITH(k_distribution_second_moment(0), Contains("shape of the K distribution is 0"));
    CHECK_THROWS_AS(k_distribution_exceedance(1, -1), InputError);
    CHECK_THROWS_AS(k_distribution_exceedance(20000, 1), InputError);
}

TEST_CASE("the sea is spikier in small cells, at small angles and in H", "[statistics]") {
    const auto shape = [](bool vertical, double area_m2, double deg) {
        return sea_clutter_shape({.vertical = vertical, .area_m2 = area_m2, .grazing = Angle::degrees(deg)});
    };
    CHECK_THAT(shape(true, 1000, 2), WithinAbs(4.849385, 5e-7));
    CHECK_THAT(shape(true, 1000, 2) / shape(false, 1000, 2), WithinRel(std::pow(10, 0.7), 1e-12));
    CHECK(shape(true, 100, 2) < shape(true, 1000, 2));
    CHECK(shape(true, 1000, 1) < shape(true, 1000, 2));
    const auto swell = [](double deg) {
        return sea_clutter_shape({.vertical = true,
                                  .area_m2 = 1000,
                                  .grazing = Angle::degrees(2),
                                  .swell = true,
                                  .from_swell = Angle::degrees(deg)});
    };
    CHECK_THAT(swell(0), WithinRel(4.849385 * std::pow(10, -1.0 / 3), 1e-6));
    CHECK_THAT(swell(90), WithinRel(4.849385 * std::pow(10, 1.0 / 3), 1e-6));
    CHECK_THAT(swell(45), WithinRel(4.849385, 1e-6));
    CHECK_THROWS_WITH(shape(true, 1000, 11), Contains("sea clutter cell is 11 deg") && Contains("at most 10"));
    CHECK_THROWS_WITH(shape(true, 0, 2), Contains("area of a sea clutter cell is 0 m2"));
}
