// Models of physics 1: the effective earth, the horizon, geodesics.
#include <GeographicLib/Geodesic.hpp>

#include <algorithm>
#include <numbers>

#include "lib/earth.hpp"
#include "lib/facet.hpp"
#include "tools/model_inputs.hpp"
#include "tools/models.hpp"

namespace wedgescope {
namespace {

constexpr double lowest_m = -10e3, highest_m = 1e6;
constexpr double longest_geodesic_m = 20003932;  // half a meridian of WGS84

double arc(const Arguments& a) {
    if (const auto s = earth_of(a).arc_m(a["hs"], a["h"], a["r"])) return *s;
    throw NoSolution(text("no point of height ", a["h"], " m is at slant range ", a["r"], " m of an antenna at height ",
                          a["hs"], " m"));
}

/// Degrees for GeographicLib, which takes no latitude beyond 90.
double degrees(const Arguments& a, const char* name) { return a.angle(name).deg(); }
double latitude(const Arguments& a, const char* name) { return std::clamp(degrees(a, name), -90.0, 90.0); }
ModelInput latitude_of(const char* name, const char* meaning) { return number(name, "deg", meaning, -90, 90); }
ModelInput turn(const char* name, const char* meaning) { return number(name, "deg", meaning, -360, 360); }

double rad(double deg) { return Angle::degrees(deg).rad(); }

}  // namespace

std::vector<ModelInput> joined(std::vector<ModelInput> first, const std::vector<ModelInput>& more) {
    first.insert(first.end(), more.begin(), more.end());
    return first;
}

ModelInput height_input(const char* name, const char* meaning) {
    return number(name, "m", meaning, lowest_m, highest_m);
}
ModelInput earth_factor_input() {
    return number("k", "", "factor of the earth's radius", 0.1, 1e6).or_word("flat").by_default("4/3");
}
ModelInput earth_radius_input() {
    return number("R", "m", "radius of the earth before the factor (default R1, the mean radius)", 1e5, 1e8)
        .by_default(mean_radius_m);
}
Earth earth_of(const Arguments& a) { return a.word("k") ? Earth() : Earth(a["k"] * a["R"]); }

std::vector<Model> geometry_models() {
    return {
        {"sight",
         "slant range, depression and grazing angle of a point over the effective earth",
         "physics 1.1 [V2: Skolnik; Long]",
         {height_input("hs", "height of the antenna above sea level"), height_input("h", "height of the point"),
          number("s", "m", "arc between them along the surface", 0, longest_geodesic_m), earth_factor_input(),
          earth_radius_input()},
         {{"r", "m", "slant range"},
          {"delta", "deg", "depression at the antenna, positive down"},
          {"psi", "deg", "grazing angle at the point, of the horizontal plane"},
          {"theta", "deg", "angle at the earth's centre"}},
         [](const Arguments& a) -> std::vector<double> {
             if (a["s"] * earth_of(a).inverse_radius() > std::numbers::pi)
                 throw NoSolution("the arc is longer than half the way round the effective earth");
             const Earth::Sight sight = earth_of(a).sight(a["hs"], a["h"], a["s"]);
             return {sight.slant_range_m, sight.depression_rad, sight.grazing_rad,
                     a["s"] * earth_of(a).inverse_radius()};
         },
         "hs=3000m h=250m s=20km"},
        {"arc",
         "arc, depression and grazing angle of a point at a slant range over the effective earth",
         "physics 1.1 [V2: Skolnik; Long]",
         {height_input("hs", "height of the antenna above sea level"), height_input("h", "height of the point"),
          number("r", "m", "slant range", 0, 1e7), earth_factor_input(), earth_radius_input()},
         {{"s", "m", "arc along the surface"},
          {"delta", "deg", "depression at the antenna, positive down"},
          {"psi", "deg", "grazing angle at the point, of the horizontal plane"}},
         [](const Arguments& a) -> std::vector<double> {
             const double s = arc(a);
             const Earth::Sight sight = earth_of(a).sight(a["hs"], a["h"], s);
             return {s, sight.depression_rad, sight.grazing_rad};
         },
         "hs=300m h=0m r=1km k=1 R=8477.362km"},
        {"ray",
         "height of a straight ray over the effective earth, and the arc below it",
         "physics 1.1 [V2: Skolnik; Long]",
         {height_input("hs", "height of the antenna above sea level"),
          number("delta", "deg", "depression at the antenna, positive down", -90, 90),
          number("t", "m", "distance from the antenna along the ray", 0, 1e7), earth_factor_input(),
          earth_radius_input()},
         {{"h", "m", "height of the ray there"}, {"s", "m", "arc along the surface"}},
         [](const Arguments& a) -> std::vector<double> {
             const Earth::RayPoint point = earth_of(a).ray_point(a["hs"], a["delta"], a["t"]);
             return {point.height_m, point.arc_m};
         },
         "hs=7000ft delta=1.5deg t=30nmi"},
        {"horizon",
         "radar horizon of an antenna, and how far away it sees a target of some height",
         "physics 1.2 [V2]",
         {number("h", "m", "height of the antenna above sea level", 0, highest_m),
          number("h_t", "m", "height of the target", 0, highest_m).by_default("0m"),
          number("k", "", "factor of the earth's radius", 0.1, 1e6).by_default("4/3"), earth_radius_input()},
         {{"s_h", "m", "arc to the horizon"},
          {"t_h", "m", "length of the line of sight to it"},
          {"theta_h", "deg", "its depression (dip)"},
          {"s_t", "m", "arc to the target where it comes into sight"}},
         [](const Arguments& a) -> std::vector<double> {
             const Earth e = earth_of(a);
             const double s = e.horizon_arc_m(a["h"]);
             return {s, e.horizon_distance_m(a["h"]), s * e.inverse_radius(), s + e.horizon_arc_m(a["h_t"])};
         },
         "h=3000m"},
        {"facet",
         "local grazing angle and areas of sloping ground",
         "physics 1.3 [V2: vector geometry]",
         {above("psi", "deg", "grazing angle of the horizontal plane there", -90, 90),
          turn("A", "azimuth of the outgoing ray at the point, from north").by_default("0deg"),
          number("dz_dx", "", "slope towards east", -1000, 1000).by_default("0"),
          number("dz_dy", "", "slope towards north", -1000, 1000).by_default("0")},
         {{"psi_l", "deg", "local grazing angle; not above 0: the facet shadows itself"},
          {"a_true", "", "true area over plan area, 1 / n_up"},
          {"a_seen", "", "area projected on the plane normal to the ray, over plan area; 0 where it shadows itself"}},
         [](const Arguments& a) -> std::vector<double> {
             const Facet facet = facet_of(a.angle("psi"), a.angle("A"), a["dz_dx"], a["dz_dy"]);
             return {facet.local_grazing.rad(), facet.true_area, facet.projected_area()};
         },
         "psi=5deg A=90deg dz_dx=0.2"},
        {"earth-radius",
         "radii of curvature of WGS84 at a latitude, and the effective one towards an azimuth",
         "physics 1.1 [V2]",
         {latitude_of("lat", "latitude"), turn("A", "azimuth from north"),
          number("k", "", "factor of the earth's radius", 0.1, 1e6).by_default("4/3")},
         {{"M", "m", "radius along the meridian"},
          {"N", "m", "radius across it"},
          {"R", "m", "Euler radius towards the azimuth"},
          {"Re", "m", "effective radius k R"}},
         [](const Arguments& a) -> std::vector<double> {
             const EllipsoidRadii radii = ellipsoid_radii(a["lat"]);
             const double euler_m = euler_radius_m(a["lat"], a["A"]);
             return {radii.meridian_m, radii.normal_m, euler_m, a["k"] * euler_m};
         },
         "lat=34deg A=45deg"},
        {"geodesic-inverse",
         "length of the WGS84 geodesic between two points, and its azimuths",
         "physics 1.5 [V2: Karney 2013, GeographicLib]",
         {latitude_of("lat1", "latitude of the first point"), turn("lon1", "its longitude"),
          latitude_of("lat2", "latitude of the second point"), turn("lon2", "its longitude")},
         {{"s", "m", "length"},
          {"az1", "deg", "azimuth at the first point"},
          {"az2", "deg", "azimuth at the second point, onwards"}},
         [](const Arguments& a) -> std::vector<double> {
             double s = 0, az1 = 0, az2 = 0;
             GeographicLib::Geodesic::WGS84().Inverse(latitude(a, "lat1"), degrees(a, "lon1"), latitude(a, "lat2"),
                                                      degrees(a, "lon2"), s, az1, az2);
             return {s, rad(az1), rad(az2)};
         },
         "lat1=40.6deg lon1=-73.8deg lat2=51.6deg lon2=-0.5deg"},
        {"geodesic-direct",
         "where a WGS84 geodesic of some azimuth and length ends",
         "physics 1.5 [V2: Karney 2013, GeographicLib]",
         {latitude_of("lat1", "latitude of the first point"), turn("lon1", "its longitude"),
          turn("az1", "azimuth there"), number("s", "m", "length", 0, longest_geodesic_m)},
         {{"lat2", "deg", "latitude of the second point"},
          {"lon2", "deg", "its longitude"},
          {"az2", "deg", "azimuth there, onwards"}},
         [](const Arguments& a) -> std::vector<double> {
             double lat2 = 0, lon2 = 0, az2 = 0;
             GeographicLib::Geodesic::WGS84().Direct(latitude(a, "lat1"), degrees(a, "lon1"), degrees(a, "az1"), a["s"],
                                                     lat2, lon2, az2);
             return {rad(lat2), rad(lon2), rad(az2)};
         },
         "lat1=33.9deg lon1=-117.4deg az1=45deg s=30nmi"},
    };
}

}  // namespace wedgescope
