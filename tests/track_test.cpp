// Tracks: the rows of a table, and where the sensor is between them.
// Leaves the pictures of the rows to track_frames.cpp, scans to track_scan.cpp, power stacks to track_power_stack.cpp, and
// who works on which frame to side_by_side_test.cpp.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <istream>
#include <iterator>
#include <numbers>
#include <streambuf>
#include <string>

#include "lib/track.hpp"
#include "tests/refusal.hpp"
#include "tests/tracks.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;

namespace {

std::string refused(const std::string& content) {
    return refusal<InputError>([&] { read(content); });
}

}  // namespace

TEST_CASE("between two rows a sensor moves evenly along the geodesic, and past the last one the last leg goes on",
          "[track]") {
    // Along the equator, and due east 60 s of 0.01 degrees.
    const Track track = read("time,lat,lon,altitude-msl\n10,0,20,1000\n70,0,20.01,1600\n130,0,20.01,1600\n");
    const PlatformParams base;
    const auto place = [&](std::size_t row, double s) { return *track.after(base, row, s).latlon; };
    CHECK(place(0, 0).lon_deg == 20);
    CHECK_THAT(place(0, 15).lon_deg, WithinAbs(20.0025, 1e-12));
    CHECK_THAT(place(0, 15).lat_deg, WithinAbs(0, 1e-12));
    CHECK_THAT(track.after(base, 0, 15).altitude_m, WithinAbs(1150, 1e-9));
    CHECK(track.after(base, 0, 15).heading.deg() == Angle::degrees(7).deg());
    CHECK(place(0, 90).lon_deg == 20.01);  // stands, to the last bit
    CHECK(place(2, 30).lon_deg == 20.01);

    // 60 degrees north the great circle between two points of one latitude bends to the pole: half-way between 0 and 40
    // degrees of longitude atan(tan 60 / cos 20) on a sphere; the ellipsoid's is within a tenth of a degree of it.
    const Track far = read("time,lat,lon,altitude-msl\n0,60,0,1000\n10,60,40,1000\n");
    const LatLon middle = *far.after(base, 0, 5).latlon;
    CHECK_THAT(middle.lon_deg, WithinAbs(20, 1e-9));
    CHECK_THAT(middle.lat_deg, WithinAbs(std::atan(std::tan(std::numbers::pi / 3) / std::cos(std::numbers::pi / 9)) *
                                             180 / std::numbers::pi,
                                         0.1));

    const Track plane = read("time,x,y,altitude-agl\n0,100,200,10\n4,140,160,30\n");
    CHECK(plane.after(base, 0, 1).xy->x == 110);
    CHECK(plane.after(base, 0, 1).xy->y == 190);
    CHECK(plane.after(base, 1, 2).xy->x == 160);
    CHECK(plane.after(base, 1, 2).altitude_m == 40);
    CHECK(plane.after(base, 1, 2).altitude_above == AltitudeAbove::ground);
}

TEST_CASE("on a raster in degrees a sensor flies the shorter way round, in x and y too", "[track]") {
    const PlatformParams base;
    constexpr double circle = 360;
    for (const double far : {-179.75, 180.25, 540.25}) {
        const Track track = read(text("time,x,y,altitude-msl\n0,179.75,10,1000\n10,", far, ",10,1000\n"));
        INFO("to " << far);
        CHECK(track.after(base, 0, 5, circle).xy->x == 180);
        CHECK(track.after(base, 0, 7.5, circle).xy->x == 180.125);
        CHECK(track.after(base, 1, 0, circle).xy->x == far);
        CHECK(track.after(base, 1, 5, circle).xy->x == far + 0.25);
    }
    const Track back = read("time,x,y,altitude-msl\n0,-179.5,10,1000\n10,179.5,12,1000\n20,-180.5,12,1000\n");
    CHECK(back.after(base, 0, 2.5, circle).xy->x == -179.75);
    CHECK(back.after(base, 0, 2.5, circle).xy->y == 10.5);
    CHECK(back.after(base, 1, 5, circle).xy->x == 179.5);  // stands: it is the same place
    // Metres do not come round.
    const Track plane = read("time,x,y,altitude-msl\n0,0,0,1000\n10,400,0,1000\n");
    CHECK(plane.after(base, 0, 5).xy->x == 200);
}

TEST_CASE("a table of a track names its columns and units in its first line", "[track]") {
    const Track track = read(
        "# recorded\nheading, altitude-msl [ft] ,time,lat [deg],lon\n"
        "\n 90,1000, 5 ,33.5,-117\n1rad,500m,5.5,33.5,-117.25\n");
    REQUIRE(track.size() == 2);
    CHECK_THAT(track[0].altitude_m, WithinAbs(304.8, 1e-9));
    CHECK(track[0].heading.deg() == 90);
    CHECK(track[0].line == 4);
    CHECK(track[1].altitude_m == 500);
    CHECK(track[1].heading.rad() == 1);
    CHECK(track[1].second == -117.25);
    CHECK(track.at({}, 1).altitude_above == AltitudeAbove::sea_level);
    CHECK(read("time,x,y,altitude-agl\n0,1,2,3\n")[0].heading.deg() == Angle::degrees(7).deg());
    CHECK(read("time,x,y,height\n0,1,2,3\n").at({}, 0).altitude_above == AltitudeAbove::ground);
    CHECK(read("time,x,y,Altitude [ft]\n0,1,2,1000\n").at({}, 0).altitude_above == AltitudeAbove::sea_level);
    CHECK(read("\xef\xbb\xbftime,x,y,altitude-agl\r\n0,1,2,3\r\n").size() == 1);
    // Names in any case of letters, and those of a table of observers.
    const Track other = read("Time,Latitude,LONGITUDE,Altitude_MSL [ft],Heading\n0,33.5,-117,1000,90\n");
    CHECK(other[0].first == 33.5);
    CHECK(other[0].second == -117);
    CHECK_THAT(other[0].altitude_m, WithinAbs(304.8, 1e-9));
    CHECK(other[0].heading.deg() == 90);
}

TEST_CASE("a bad line of a track is named with what was found and what is accepted", "[track]") {
    const std::string head = "time,lat,lon,altitude-msl,heading\n";
    CHECK(refused("") ==
          "track 't.csv' is empty; accepted: a line that names the columns time, lat and lon or x and y, one of "
          "altitude-msl (or altitude), altitude-agl (or height) and altitude-hae, and heading, with a unit in brackets "
          "where it is not s, m or deg");
    CHECK_THAT(refused(head), Contains("has no rows"));
    std::string rows = head;
    for (int i = 0; i < 100000; ++i) rows += std::to_string(i) + ",33,-117,1000,0\n";
    CHECK(refused(rows) == test::nothing_refused);
    CHECK_THAT(refused(rows + "100000,33,-117,1000,0\n"), Contains("split the file"));
    CHECK_THAT(refused("time,lat,lon,alt\n"), Contains("line 1: column 4 is 'alt'; accepted: time, lat and lon"));
    CHECK_THAT(refused("time,lat,lon\n"), Contains("line 1: no column is an altitude"));
    CHECK_THAT(refused("lat,lon,altitude-msl\n"), Contains("no column is time"));
    CHECK_THAT(refused("time,lat,altitude-msl\n"), Contains("of lat and lon one is missing"));
    CHECK_THAT(refused("time,lat,lon,x,y,altitude-msl\n"), Contains("there are columns lat, lon and x, y"));
    CHECK_THAT(refused("time,lat,lon,altitude-msl,altitude-agl\n"), Contains("two columns of altitude"));
    CHECK_THAT(refused("time,lat,lat,lon,altitude-msl\n"), Contains("column 3 is 'lat', and so is one before"));
    CHECK_THAT(refused("time,lat,lon,altitude-msl [parsec]\n"), Contains("accepted units: "));
    CHECK_THAT(refused("time,lat,lon,altitude-msl [ft\n"), Contains("accepted units: "));
    CHECK(refused(head + "0,33,-117,abc,0\n") ==
          "track 't.csv', line 2, column altitude-msl is 'abc'; it must be a number (m), "
          "or one with a unit: m, km, ft, kft, nmi, mi, yd");
    CHECK(refused(head + "0,33,-117,1000,0\n1,93,-117,1000,0\n") ==
          "track 't.csv', line 3, column lat is '93'; it must be from -90 to 90 degrees");
    CHECK_THAT(refused(head + "0,33,-117,1000,400\n"),
               Contains("column heading is '400'; it must be from -360deg to 360deg"));
    CHECK_THAT(refused(head + "0,33,-117,1000,nan\n"), Contains("column heading is 'nan'"));
    CHECK_THAT(refused(head + "-1e308,33,-117,1000,0\n1e308,33,-117,1000,0\n"),
               Contains("column time is '-1e308'; it must be from -1e15 to 1e15 seconds"));
    CHECK_THAT(refused(head + "0,33,-117,2000km,0\n"), Contains("from -10km to 1000km"));
    CHECK(refused(head + "0,33,-117,1000,0\n1,33,-117,1000,\"0\n\"\n") ==
          "track 't.csv', line 3: cell 5 begins with a double quote that nothing closes; a quoted cell must end on its "
          "line");
    CHECK_THAT(refused(head + "0,33,-117,1000\n"), Contains("line 2 has 4 columns; accepted: 5"));
    CHECK_THAT(refused(head + "0,33,-117,1000,0\n\n# x\n0,33,-117,1000,0\n"),
               Contains("line 5, column time is 0 s; it must be more than the 0 s of the row before"));
    CHECK_THAT(refused(head + std::string(5000, '1')),
               Contains("line 2 has more than 4096 characters; accepted: at most so many"));
    CHECK(read(head + std::string(4075, ' ') + "0,33,-117,1000,0 \n").size() == 1);  // 4092 characters
    CHECK(read(head + "0,33,-117,1000,0").size() == 1);
    CHECK_THAT(refused("time,lat,lon,altitude-msl\r0,33,-117,1000\r"),
               Contains("line 1 has a carriage return before its end"));
    CHECK(read(head + std::string(4080, ' ') + "0,33,-117,1000,0").size() == 1);  // 4096
    CHECK_THAT(refused(head + std::string(4081, ' ') + "0,33,-117,1000,0"), Contains("line 2 has more than 4096"));
    CHECK_THAT(refused(head + std::string(4081, ' ') + "0,33,-117,1000,0\n"), Contains("line 2 has more than 4096"));
}

TEST_CASE("of a file without line ends no more is read than a line may have", "[track]") {
    struct Endless : std::streambuf {
        char part[512];
        std::size_t given = 0;
        int_type underflow() override {
            std::fill(std::begin(part), std::end(part), '1');
            if (given >= std::size_t{64} << 20) return traits_type::eof();
            given += sizeof part;
            setg(part, part, part + sizeof part);
            return traits_type::to_int_type(*part);
        }
    } endless;
    std::istream in(&endless);
    CHECK_THAT(refusal<InputError>([&] { track_from("t.csv", in, {}); }), Contains("line 1 has more than 4096"));
    CHECK(endless.given < 6000);
}
