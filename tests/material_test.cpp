// The class table and the legends, against the published legends.
#include <catch2/catch.hpp>

#include <string>

#include "lib/error.hpp"
#include "lib/material.hpp"

using namespace wedgescope;
using Catch::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {
std::string material_of(const std::string& legend, int code) {
    const auto id = Legend::built_in(legend).value().find(code);
    return id ? material_table()[*id].name : "unknown";
}
}  // namespace

TEST_CASE("the table holds the sixteen classes in their order", "[material]") {
    REQUIRE(material_table().size() == 16);
    CHECK(material_by_name("material", "water") == 0);
    CHECK(material_by_name("material", "soil") == 4);
    CHECK(material_by_name("material", "urban") == 11);
    CHECK(material_by_name("material", "part-metal") == 14);
    CHECK(material_by_name("material", "metal") == 15);
    CHECK_THROWS_AS(material_by_name("material", "mud"), InputError);
    CHECK_THROWS_WITH(material_by_name("material", "mud"),
                      Contains("material is 'mud'") && Contains("marsh") && Contains("part-metal"));
}

TEST_CASE("gamma is the table's at 10 GHz and grows 5 dB a decade", "[material]") {
    const auto at_10 = gamma_table(10e9, std::nullopt);
    CHECK_THAT(at_10[4].ground, WithinRel(0.0199526, 1e-5));  // -17 dB, six digits
    CHECK_THAT(at_10[4].wall, WithinRel(0.158489, 1e-5));     // -8 dB
    CHECK_THAT(at_10[15].wall, WithinRel(31.6228, 1e-5));     // 15 dB
    CHECK(at_10[5].wall == at_10[5].ground);                  // no wall of its own
    const auto at_100 = gamma_table(100e9, std::nullopt);
    for (std::size_t id = 1; id < 16; ++id) {
        CHECK_THAT(10 * std::log10(at_100[id].ground / at_10[id].ground), WithinAbs(5, 1e-12));
        CHECK_THAT(10 * std::log10(at_100[id].wall / at_10[id].wall), WithinAbs(5, 1e-12));
    }
}

TEST_CASE("calm water returns nothing", "[material]") {
    const auto gammas = gamma_table(16.5e9, std::nullopt);
    CHECK(gammas[0].ground == 0);
    CHECK(gammas[0].wall == 0);
}

TEST_CASE("one constant gamma replaces all, walls and water too, and keeps the frequency law", "[material]") {
    for (const ClassGamma& gamma : gamma_table(40e9, Decibel(-20))) {
        CHECK_THAT(gamma.ground, WithinRel(0.02, 1e-12));  // -20 dB times sqrt 4
        CHECK(gamma.wall == gamma.ground);
    }
}

TEST_CASE("LANDFIRE's fuel models become their materials", "[material]") {
    CHECK(material_of("fbfm40", 91) == "suburban");
    CHECK(material_of("fbfm40", 92) == "snow");
    CHECK(material_of("fbfm40", 93) == "crops");
    CHECK(material_of("fbfm40", 98) == "water");
    CHECK(material_of("fbfm40", 99) == "soil");
    for (int code = 101; code <= 109; ++code) CHECK(material_of("fbfm40", code) == "grass");
    for (const int code : {121, 122, 123, 124, 141, 142, 143, 144, 145, 146, 147, 148, 149})
        CHECK(material_of("fbfm40", code) == "shrub");
    for (const int code : {161, 162, 163, 164, 165, 181, 182, 183, 184, 185, 186, 187, 188, 189, 201, 202, 203, 204})
        CHECK(material_of("fbfm40", code) == "trees");
    for (const int code : {0, 90, 94, 100, 110, 120, 150, 190, 205, -9999, 32767})
        CHECK(material_of("fbfm40", code) == "unknown");
}

TEST_CASE("NLCD, WorldCover and DFAD codes become their materials, and only theirs", "[material]") {
    CHECK(material_of("nlcd", 11) == "water");
    CHECK(material_of("nlcd", 12) == "snow");
    CHECK(material_of("nlcd", 22) == "suburban");
    CHECK(material_of("nlcd", 24) == "urban");
    CHECK(material_of("nlcd", 31) == "sand");
    CHECK(material_of("nlcd", 43) == "trees");
    CHECK(material_of("nlcd", 52) == "shrub");
    CHECK(material_of("nlcd", 71) == "grass");
    CHECK(material_of("nlcd", 81) == "grass");
    CHECK(material_of("nlcd", 82) == "crops");
    CHECK(material_of("nlcd", 90) == "trees");
    CHECK(material_of("nlcd", 95) == "marsh");
    for (const int code : {0, 13, 32, 83, 85, 91, 92, 250}) CHECK(material_of("nlcd", code) == "unknown");

    CHECK(material_of("worldcover", 10) == "trees");
    CHECK(material_of("worldcover", 20) == "shrub");
    CHECK(material_of("worldcover", 30) == "grass");
    CHECK(material_of("worldcover", 40) == "crops");
    CHECK(material_of("worldcover", 50) == "urban");
    CHECK(material_of("worldcover", 60) == "sand");
    CHECK(material_of("worldcover", 70) == "snow");
    CHECK(material_of("worldcover", 80) == "water");
    CHECK(material_of("worldcover", 90) == "marsh");
    CHECK(material_of("worldcover", 95) == "trees");
    CHECK(material_of("worldcover", 100) == "grass");
    for (const int code : {0, 11, 111, 126}) CHECK(material_of("worldcover", code) == "unknown");

    const char* dfad[] = {"metal", "part-metal", "urban", "suburban", "soil",  "water", "sand",
                          "rock",  "concrete",   "soil",  "marsh",    "trees", "snow",  "asphalt"};
    for (int code = 1; code <= 14; ++code) CHECK(material_of("smc", code) == dfad[code - 1]);
    CHECK(material_of("smc", 15) == "unknown");
    CHECK_FALSE(Legend::built_in("corine"));
}

TEST_CASE("a legend can be a table of words or class numbers", "[material]") {
    const Legend legend = Legend::from_csv(
        "my.csv", "\xEF\xBB\xBF# mine\r\ncode,material\r\n 1 , water\r\n\r\n-7,\"part-metal\" # a roof\r\n300,5");
    CHECK(legend.find(1) == ClassId{0});
    CHECK(legend.find(-7) == ClassId{14});
    CHECK(legend.find(300) == ClassId{5});
    CHECK_FALSE(legend.find(2));
    CHECK(legend.name() == "my.csv");
}

TEST_CASE("a wrong legend line is named", "[material]") {
    const auto read = [](const char* content) { return Legend::from_csv("my.csv", content); };
    CHECK_THROWS_WITH(read("1,water\n2,mud\n"), Contains("my.csv, line 2") && Contains("'mud'") && Contains("marsh"));
    CHECK_THROWS_WITH(read("1,water\n2\n"), Contains("line 2") && Contains("comma"));
    CHECK_THROWS_WITH(read("1,water\nx,soil\n"), Contains("line 2") && Contains("'x'"));
    CHECK_THROWS_WITH(read("1.5,water\n"), Contains("line 1") && Contains("'1.5'"));
    CHECK_THROWS_WITH(read("1,water\n# c\n1,soil\n"), Contains("line 3") && Contains("code 1"));
    CHECK_THROWS_WITH(read("1,16\n"), Contains("line 1") && Contains("'16'"));
    CHECK_THROWS_WITH(read("99999999999,water\n"), Contains("line 1"));
    CHECK_THROWS_WITH(read("# nothing\n"), Contains("my.csv"));
    CHECK_THROWS_AS(read("1,mud\n"), InputError);
}
