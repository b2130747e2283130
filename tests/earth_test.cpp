// Lines of sight over the effective earth, against closed forms and published numbers.
#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>

#include "lib/angle.hpp"
#include "lib/earth.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {
const Earth four_thirds(4.0 / 3 * mean_radius_m);
double deg(double rad) { return Angle::radians(rad).deg(); }
}  // namespace

TEST_CASE("the worked example of a 250 m hill 20 km from an antenna at 3000 m comes out", "[earth]") {
    // Self-check values of the physics reference, section 11, to the digits printed there.
    const Earth::Sight sight = four_thirds.sight(3000, 250, 20000);
    CHECK_THAT(sight.slant_range_m, WithinAbs(20191.962666, 1e-6));
    CHECK_THAT(deg(sight.depression_rad), WithinAbs(7.895043, 1e-6));
    CHECK_THAT(deg(sight.grazing_rad), WithinAbs(7.760145, 1e-6));
}

TEST_CASE("the published depression and grazing angle of a 300 m antenna at 1 km slant range come out", "[earth]") {
    const Earth earth(8.477362e6);
    const auto arc = earth.arc_m(300, 0, 1000);
    REQUIRE(arc);
    const Earth::Sight sight = earth.sight(300, 0, *arc);
    CHECK_THAT(deg(sight.depression_rad), WithinAbs(17.4608, 5e-5));  // printed with four decimals
    CHECK_THAT(deg(sight.grazing_rad), WithinAbs(17.4544, 5e-5));
    CHECK_THAT(deg(level_depression_rad(earth, 300, 0, 1000)), WithinAbs(17.4608, 5e-5));
}

TEST_CASE("depression less grazing is the angle at the earth's centre", "[earth]") {
    for (const double arc : {0.01, 3.0, 100.0, 12345.0, 4e5, 3e6})
        for (const double height : {-400.0, 0.0, 850.0, 8848.0}) {
            const Earth::Sight sight = four_thirds.sight(9000, height, arc);
            // A few last bits of an angle of up to pi/2.
            CHECK_THAT(sight.depression_rad - sight.grazing_rad, WithinAbs(arc * four_thirds.inverse_radius(), 1e-15));
        }
}

TEST_CASE("slant range obeys the law of cosines", "[earth]") {
    const double re = 4.0 / 3 * mean_radius_m;
    const double arc = 300e3, hs = 10000, h = 1500;
    const double a = re + hs, b = re + h;
    const double expected = std::sqrt(a * a + b * b - 2 * a * b * std::cos(arc / re));
    // The textbook form loses digits: 1e-16 (Re / r)^2 of r.
    CHECK_THAT(four_thirds.sight(hs, h, arc).slant_range_m, WithinRel(expected, 1e-11));
    CHECK(four_thirds.slant_range_m(hs, h, arc) == four_thirds.sight(hs, h, arc).slant_range_m);
}

TEST_CASE("the horizon of a 3000 m antenna lies 225.7 km away", "[earth]") {
    CHECK_THAT(four_thirds.horizon_arc_m(3000), WithinAbs(225727.878, 1e-3));
    CHECK(four_thirds.horizon_arc_m(0) == 0);
    // The rule of thumb 4.12 sqrt(h) km, a number of three digits.
    CHECK_THAT(four_thirds.horizon_arc_m(100), WithinRel(41200, 1e-3));
    CHECK(std::isinf(Earth().horizon_arc_m(3000)));
    // There the line of sight touches the surface.
    CHECK_THAT(four_thirds.sight(3000, 0, four_thirds.horizon_arc_m(3000)).grazing_rad, WithinAbs(0, 1e-12));
}

TEST_CASE("a ray passes through the point that it was sent to", "[earth]") {
    for (const Earth& earth : {four_thirds, Earth()})
        for (const double arc : {0.5, 50.0, 5000.0, 5e5})
            for (const double height : {-400.0, 0.0, 8848.0}) {
                const Earth::Sight sight = earth.sight(2134, height, arc);
                const Earth::RayPoint point = earth.ray_point(2134, sight.depression_rad, sight.slant_range_m);
                // A last bit of the depression, 1e-16 or so, is r times that across the ray.
                CHECK_THAT(point.height_m, WithinAbs(height, 1e-12 + 1e-15 * sight.slant_range_m));
                CHECK_THAT(point.arc_m, WithinAbs(arc, 1e-12 + 1e-15 * sight.slant_range_m));
            }
    // By hand, over a plane.
    const Earth::RayPoint below = Earth().ray_point(1000, std::numbers::pi / 6, 400);
    CHECK_THAT(below.height_m, WithinAbs(800, 1e-12));
    CHECK_THAT(below.arc_m, WithinAbs(200 * std::sqrt(3.0), 1e-12));
    // A ray along the horizon's line of sight touches the surface at its end, and h = hs + t^2/(2 Re) where it starts level.
    const double tangent = four_thirds.horizon_distance_m(3000);
    const double dip = four_thirds.horizon_arc_m(3000) * four_thirds.inverse_radius();
    CHECK_THAT(four_thirds.ray_point(3000, dip, tangent).height_m, WithinAbs(0, 1e-8));
    CHECK_THAT(tangent, WithinRel(std::sqrt(3000 * (2 / four_thirds.inverse_radius() + 3000)), 1e-15));
    CHECK_THAT(four_thirds.ray_point(0, 0, 1000).height_m, WithinRel(1e6 / 2 * four_thirds.inverse_radius(), 1e-8));
}

TEST_CASE("slant range turns back into the arc it came from, near and far", "[earth]") {
    for (const Earth& earth : {four_thirds, Earth()})
        for (const double arc : {0.5, 50.0, 5000.0, 5e5}) {
            const double slant = earth.slant_range_m(2134, 838, arc);
            const auto back = earth.arc_m(2134, 838, slant);
            REQUIRE(back);
            // At half a metre from under the sensor a last bit of the range, 2e-13 m, is r/s times that on the ground.
            CHECK_THAT(*back, WithinAbs(arc, 1e-9 + 1e-14 * arc));
        }
}

TEST_CASE("nothing on the ground is nearer than the altitude", "[earth]") {
    CHECK_FALSE(four_thirds.arc_m(3000, 0, 2999.9));
    CHECK(four_thirds.arc_m(3000, 0, 3000) == 0.0);
    CHECK_FALSE(Earth().arc_m(3000, 0, 2999.9));
    CHECK_FALSE(four_thirds.arc_m(3000, 0, 3 * mean_radius_m));  // past the antipode
    CHECK(level_depression_rad(four_thirds, 3000, 0, 100) == Approx(std::numbers::pi / 2));
}

TEST_CASE("over a plane the sight is a right triangle", "[earth]") {
    const Earth::Sight sight = Earth().sight(700, 400, 400);
    CHECK(sight.slant_range_m == 500);
    CHECK_THAT(std::sin(sight.depression_rad), WithinRel(0.6, 1e-15));
    CHECK(sight.depression_rad == sight.grazing_rad);
    CHECK(Earth().arc_m(700, 400, 500) == 400.0);
    // A very large sphere is nearly the plane: drop s^2/2R = 8e-11 m.
    CHECK_THAT(Earth(1e15).sight(700, 400, 400).slant_range_m, WithinAbs(500, 1e-9));
}

TEST_CASE("the ellipsoid's radii are those of WGS84", "[earth]") {
    // NIMA TR8350.2: at the equator M = b^2/a, N = a; at the pole both are a^2/b = 6399593.6258 m.
    const double b = 6356752.3142;
    const EllipsoidRadii equator = ellipsoid_radii(0);
    CHECK_THAT(equator.meridian_m, WithinAbs(b * b / 6378137, 1e-3));
    CHECK_THAT(equator.normal_m, WithinAbs(6378137, 1e-9));
    const EllipsoidRadii pole = ellipsoid_radii(std::numbers::pi / 2);
    CHECK_THAT(pole.meridian_m, WithinAbs(6399593.6258, 1e-3));
    CHECK_THAT(pole.normal_m, WithinAbs(6399593.6258, 1e-3));
    const double lat = Angle::degrees(45).rad();
    const EllipsoidRadii middle = ellipsoid_radii(lat);
    CHECK_THAT(euler_radius_m(lat, 0), WithinRel(middle.meridian_m, 1e-15));
    CHECK_THAT(euler_radius_m(lat, std::numbers::pi / 2), WithinRel(middle.normal_m, 1e-15));
    // Halfway the curvature is the mean of the two.
    CHECK_THAT(1 / euler_radius_m(lat, std::numbers::pi / 4),
               WithinRel(0.5 * (1 / middle.meridian_m + 1 / middle.normal_m), 1e-14));
}
