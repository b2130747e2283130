// The law of directivity, against its values by hand (physics 7.2).
#include <catch2/catch.hpp>

#include "lib/directivity.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {
double gain(Directivity directivity, double to_radar_deg, double normal_deg) {
    return directivity_gain(directivity, Angle::degrees(to_radar_deg), Angle::degrees(normal_deg));
}
}  // namespace

TEST_CASE("what is omnidirectional returns the same to every azimuth", "[directivity]") {
    for (double azimuth = -720; azimuth <= 720; azimuth += 37) CHECK(gain(Directivity::omni, azimuth, 10) == 1);
}

TEST_CASE("one side returns all of it to its normal, a quarter at 45 degrees and a hundredth behind", "[directivity]") {
    CHECK(gain(Directivity::uni, 30, 30) == 1);
    // cos^4: (1/sqrt 2)^4 = 1/4, (sqrt 3 / 2)^4 = 9/16, (1/2)^4 = 1/16.
    CHECK_THAT(gain(Directivity::uni, 75, 30), WithinRel(0.25, 1e-12));
    CHECK_THAT(gain(Directivity::uni, -15, 30), WithinRel(0.25, 1e-12));
    CHECK_THAT(gain(Directivity::uni, 60, 30), WithinRel(0.5625, 1e-12));
    CHECK_THAT(gain(Directivity::uni, 90, 30), WithinRel(0.0625, 1e-12));
    for (const double behind : {120.0, 150.0, 210.0, 240.0, 299.0}) CHECK(gain(Directivity::uni, behind, 30) == 0.01);
    // cos^4 D = 0.01 at D = acos(0.01^(1/4)) = 71.565 degrees: 0.01^(1/4) = 1 / sqrt 10, tan D = 3.
    CHECK(gain(Directivity::uni, 71.6, 0) == 0.01);
    CHECK(gain(Directivity::uni, 71.5, 0) > 0.01);
}

TEST_CASE("two sides return the same to both normals", "[directivity]") {
    for (const double azimuth : {0.0, 20.0, 45.0, 60.0, 89.0}) {
        CHECK_THAT(gain(Directivity::bi, azimuth, 0), WithinRel(gain(Directivity::uni, azimuth, 0), 1e-12));
        CHECK_THAT(gain(Directivity::bi, azimuth + 180, 0), WithinRel(gain(Directivity::bi, azimuth, 0), 1e-12));
    }
    CHECK(gain(Directivity::bi, 90, 0) == 0.01);
    CHECK_THAT(gain(Directivity::bi, 210, 30), WithinRel(1, 1e-12));
}

TEST_CASE("whole turns do not count", "[directivity]") {
    for (const auto kind : {Directivity::uni, Directivity::bi})
        for (double azimuth = 0; azimuth < 360; azimuth += 13)
            CHECK_THAT(gain(kind, azimuth + 720, 17 - 360), WithinAbs(gain(kind, azimuth, 17), 1e-12));
}
