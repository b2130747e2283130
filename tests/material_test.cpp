// The class table and the legends, against the published legends.
#include <catch2/catch.hpp>

#include <iterator>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "lib/error.hpp"
#include "lib/material.hpp"

using namespace wedgescope;
using Catch::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {
using Strings = std::vector<std::string>;

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

TEST_CASE("the shipped table is that of physics 7.4", "[material]") {
    constexpr double none = -1000;
    using enum UlabyDobsonClass;
    struct Row {
        const char* name;
        double gamma, wall;
        std::optional<UlabyDobsonClass> vegetation;
    };
    const Row rows[] = {{"water", none, none, {}},
                        {"snow", -15, none, soil},
                        {"sand", -20, none, soil},
                        {"rock", -12, none, soil},
                        {"soil", -17, -8, soil},
                        {"grass", -16, none, grass},
                        {"crops", -15, none, short_vegetation},
                        {"shrub", -15, none, shrubs},
                        {"trees", -12, -10, shrubs},
                        {"marsh", -18, none, short_vegetation},
                        {"suburban", -7, 0, {}},
                        {"urban", -2, 5, {}},
                        {"concrete", -20, 5, {}},
                        {"asphalt", -22, none, {}},
                        {"part-metal", 3, 10, {}},
                        {"metal", 6, 15, {}}};
    const Materials shipped;
    REQUIRE(shipped.size() == std::size(rows));
    for (std::size_t id = 0; id < shipped.size(); ++id) {
        INFO(rows[id].name);
        CHECK(shipped[id].name == rows[id].name);
        CHECK(shipped[id].gamma10_db.value_or(none) == rows[id].gamma);
        CHECK(shipped[id].gamma_wall10_db.value_or(none) == rows[id].wall);
        CHECK(shipped[id].ulaby_dobson == rows[id].vegetation);
        CHECK(shipped[id].directivity == Directivity::omni);
        CHECK(shipped[id].axis_deg == 0);
        CHECK(shipped[id].bare_soil.has_value() == (id == 2 || id == 4));
        CHECK(shipped[id].structures.has_value() == (id == 8 || id == 10 || id == 11));
    }
    CHECK(shipped[2].bare_soil->permittivity == permittivity_by_name("", "dry-sand"));
    CHECK(shipped[2].bare_soil->rms_height_m == 0.005);
    CHECK(shipped[4].bare_soil->permittivity == permittivity_by_name("", "dry-soil"));
    CHECK(shipped[4].bare_soil->rms_height_m == 0.01);
    CHECK(shipped[8].structures == Structures{2500, 10, 12});
    CHECK(shipped[10].structures == Structures{800, 12, 6});
    CHECK(shipped[11].structures == Structures{600, 20, 10});
    CHECK_THAT(shipped[11].structures->walls(), WithinRel(0.12, 1e-12));
    CHECK_THAT(shipped[11].structures->raise_m(), WithinRel(2.4, 1e-12));
    CHECK(Structures{1e6, 30, 4}.raise_m() == 4);  // no more than all of the ground is covered
    CHECK(shipped.own().empty());
}

TEST_CASE("a table's rows replace classes and add others, and what they leave out stays", "[material]") {
    const Materials own =
        Materials::from_csv("my.csv",
                            "\xEF\xBB\xBF# fields\r\nname , gamma10_db,directivity,axis_deg\r\n"
                            "corn,-14\r\n\r\nsoil,-10 # wet\r\nfence,3.5,bi,-30\r\nurban,,uni,90\r\n");
    REQUIRE(own.size() == 18);
    CHECK(own.find("corn") == ClassId{16});
    CHECK(own[16].gamma10_db == -14.0);
    CHECK_FALSE(own[16].gamma_wall10_db);
    CHECK_FALSE(own[16].ulaby_dobson);
    CHECK(own[4].gamma10_db == -10.0);
    CHECK(own[4].gamma_wall10_db == -8.0);  // not a column of the file
    CHECK(own[4].bare_soil);
    CHECK(own[17].directivity == Directivity::bi);
    CHECK(own[17].axis_deg == -30);
    CHECK_FALSE(own[11].gamma10_db);  // an empty cell is none
    CHECK(own[11].gamma_wall10_db == 5.0);
    CHECK(own[11].directivity == Directivity::uni);
    for (const std::size_t id : {0u, 3u, 8u, 15u}) CHECK(own[id].gamma10_db == material_table()[id].gamma10_db);
    CHECK(material_table().size() == 16);
    CHECK_THROWS_WITH(own.by_name("material", "mud"), Contains("material is 'mud'") && Contains("metal, corn, fence"));

    const auto gammas = gamma_table(own, 10e9, std::nullopt);
    REQUIRE(gammas.size() == 18);
    CHECK_THAT(gammas[16].ground, WithinRel(0.0398107, 1e-5));  // -14 dB
    CHECK(gammas[16].wall == gammas[16].ground);
    CHECK(gammas[11].ground == 0);
    CHECK_THAT(gammas[11].wall, WithinRel(3.16228, 1e-5));  // walls alone
    // In the columns' order a file needs no line that names them.
    const Materials plain = Materials::from_csv("my.csv", "corn,-14,-9,short,5 0.25,0.02,uni,12.5\nrye,-13");
    CHECK(plain[16].gamma_wall10_db == -9.0);
    CHECK(plain[16].ulaby_dobson == UlabyDobsonClass::short_vegetation);
    CHECK(plain[16].bare_soil->permittivity == Permittivity(5, -0.25));
    CHECK(plain[16].bare_soil->rms_height_m == 0.02);
    CHECK(plain[16].axis_deg == 12.5);
    CHECK(plain.find("rye") == ClassId{17});
    // Structures: one number of the three may be replaced, all may go, and classes without may get them.
    const Materials built = Materials::from_csv(
        "my.csv",
        "name,structures_km2,structure_height_m,structure_width_m\nurban,700,25,20\ntrees,,,\nmetal,2,30,15.5\n");
    CHECK(built[11].structures == Structures{700, 20, 25});
    CHECK_FALSE(built[8].structures);
    CHECK(built[15].structures == Structures{2, 15.5, 30});
    CHECK(Materials::from_csv("my.csv", "name,structure_height_m\nurban,25\n")[11].structures ==
          Structures{600, 20, 25});
}

TEST_CASE("a table's own rows in one line read back as the same table", "[material]") {
    const Materials own = Materials::from_csv(
        "my.csv",
        "corn,-14.1,,short,wet-soil,0.02,uni,0.1\nsoil,-17,-8\nmetal,6.25\nsand,-20,,soil,,,bi,-0.3\nvoid,\n"
        "masts,0,10,,,,,,12.5,0.75,60\n");
    CHECK(own.own().find('\n') == std::string::npos);
    CHECK(is_inline_table(own.own()));
    CHECK_THAT(own.own(), !Contains("soil,-17"));  // as it was
    const Materials again = Materials::from_csv("class-table", own.own());
    CHECK(again.own() == own.own());
    REQUIRE(again.size() == own.size());
    for (std::size_t id = 0; id < own.size(); ++id) {
        INFO(own[id].name);
        CHECK(again[id].name == own[id].name);
        CHECK(again[id].gamma10_db == own[id].gamma10_db);
        CHECK(again[id].gamma_wall10_db == own[id].gamma_wall10_db);
        CHECK(again[id].ulaby_dobson == own[id].ulaby_dobson);
        CHECK(again[id].directivity == own[id].directivity);
        CHECK(again[id].axis_deg == own[id].axis_deg);
        CHECK(again[id].structures == own[id].structures);
        REQUIRE(again[id].bare_soil.has_value() == own[id].bare_soil.has_value());
        if (!own[id].bare_soil) continue;
        CHECK(again[id].bare_soil->permittivity == own[id].bare_soil->permittivity);
        CHECK(again[id].bare_soil->rms_height_m == own[id].bare_soil->rms_height_m);
    }
    CHECK_FALSE(is_inline_table("my.csv"));
    CHECK_FALSE(is_inline_table("fields;new.csv"));
    // Rows as shipped are no rows of its own.
    CHECK(Materials::from_csv("my.csv", "soil,-17,-8\nwater").own().empty());
}

TEST_CASE("columns of a class table are named in any case of letters", "[material]") {
    const Materials table = Materials::from_csv("my.csv", "Name,GAMMA10_dB,Ulaby_Dobson\nCorn,-14,short\n");
    const Material& corn = table.rows().at(table.find("corn").value());
    CHECK(corn.gamma10_db == -14);
    CHECK(corn.ulaby_dobson == UlabyDobsonClass::short_vegetation);
}

TEST_CASE("a wrong row of a class table is named", "[material]") {
    const auto says = [](const std::string& content, const Strings& words) {
        INFO(content);
        try {
            Materials::from_csv("my.csv", content);
            FAIL("nothing was refused");
        } catch (const InputError& e) {
            for (const std::string& word : words) CHECK_THAT(e.what(), Contains(word));
            CHECK_THAT(e.what(), !Contains("\n"));
        }
    };
    says("", {"my.csv names no class", "gamma10_db"});
    says("name,gamma10_db\n", {"my.csv names no class"});
    says("corn,-14\nrye,x\n", {"my.csv, line 2", "gamma10_db is 'x'", "-100", "100", "dB"});
    says("corn,101", {"line 1", "'101'"});
    says("corn,nan", {"'nan'"});
    says("name,gamma,x\ncorn,1,1", {"line 1", "column 2 is 'gamma'", "gamma10_db"});
    says("name,gamma10_db,gamma10_db\n", {"column 3", "one before"});
    says("name,gamma10_db\ncorn,1,2\n", {"line 2", "3 columns", "at most 2"});
    says("gamma10_db,name\n-5,trees\n", {"line 1", "column 2 is 'name', which must be the first"});
    says("17,-3", {"name is '17'", "letter"});
    says("sweet corn,-3", {"'sweet corn'"});
    says("corn,-3\ncorn,-4", {"line 2", "'corn' has a row already"});
    says("trees,-3\nTrees,-4", {"line 2", "'Trees' has a row already"});
    says("name,ulaby_dobson\ncorn,short", {"'corn' has an ulaby_dobson and no gamma10_db", "is water"});
    says("name,gamma10_db,directivity\nmast,3,uni", {"'mast' is uni without an axis_deg"});
    says("corn,-3,,tall", {"ulaby_dobson is 'tall'", "shrubs"});
    says("corn,-3,,,clay", {"soil_permittivity", "one is given"});
    says("corn,-3,,,clay,0.01", {"soil_permittivity is 'clay'", "dry-sand"});
    says("corn,-3,,,0.5 0,0.01", {"soil_permittivity is '0.5 0'"});
    says("corn,-3,,,5,2", {"soil_rms_m is '2'"});
    says("corn,-3,,,,,left", {"directivity is 'left'", "omni, uni, bi"});
    says("corn,-3,,,,,uni,361", {"axis_deg is '361'"});
    says("name,gamma10_db;corn,x", {"my.csv, row 2", "'x'"});
    says("name,structures_km2\ncorn,5", {"line 2", "structures_km2", "1 is given", "all three, or none"});
    says("name,structure_width_m\nurban,", {"line 2", "2 are given"});
    says("name,structures_km2\nurban,0", {"structures_km2 is '0'", "0.001"});
    says("name,structure_height_m\nurban,2km", {"structure_height_m is '2km'", "metres"});
    std::string many;
    for (int i = 0; i < 239; ++i) many += "class" + std::to_string(i) + ",-1\n";
    CHECK(Materials::from_csv("my.csv", many).size() == 255);
    says(many + "more,-1\n", {"line 240", "'more' is one class too many", "255"});
}

TEST_CASE("a legend names classes of a table of one's own", "[material]") {
    const Materials own = Materials::from_csv("my.csv", "corn,-14");
    const Legend legend = Legend::from_csv("codes.csv", "1,corn\n2,16\n3,soil", own);
    CHECK(legend.find(1) == ClassId{16});
    CHECK(legend.find(2) == ClassId{16});
    CHECK(legend.csv(own) == "1,corn\n2,corn\n3,soil\n");
    CHECK_THROWS_WITH(Legend::from_csv("codes.csv", "1,corn"), Contains("'corn'") && Contains("class-table"));
    CHECK_THROWS_WITH(Legend::from_csv("codes.csv", "1,17", own), Contains("0 to 16"));
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
    // Every code of physics 7.4, and none beside.
    const std::map<std::string, std::map<std::string, std::set<int>>> table = {{"nlcd",
                                                                                {{"water", {11}},
                                                                                 {"snow", {12}},
                                                                                 {"sand", {31}},
                                                                                 {"grass", {71, 72, 73, 74, 81}},
                                                                                 {"crops", {82}},
                                                                                 {"shrub", {51, 52}},
                                                                                 {"trees", {41, 42, 43, 90}},
                                                                                 {"marsh", {95}},
                                                                                 {"suburban", {21, 22}},
                                                                                 {"urban", {23, 24}}}},
                                                                               {"worldcover",
                                                                                {{"water", {80}},
                                                                                 {"snow", {70}},
                                                                                 {"sand", {60}},
                                                                                 {"grass", {30, 100}},
                                                                                 {"crops", {40}},
                                                                                 {"shrub", {20}},
                                                                                 {"trees", {10, 95}},
                                                                                 {"marsh", {90}},
                                                                                 {"urban", {50}}}},
                                                                               {"smc",
                                                                                {{"metal", {1}},
                                                                                 {"part-metal", {2}},
                                                                                 {"urban", {3}},
                                                                                 {"suburban", {4}},
                                                                                 {"soil", {5, 10}},
                                                                                 {"water", {6}},
                                                                                 {"sand", {7}},
                                                                                 {"rock", {8}},
                                                                                 {"concrete", {9}},
                                                                                 {"marsh", {11}},
                                                                                 {"trees", {12}},
                                                                                 {"snow", {13}},
                                                                                 {"asphalt", {14}}}}};
    for (const auto& [legend, classes] : table)
        for (int code = -10; code <= 400; ++code) {
            std::string expected = "unknown";
            for (const auto& [name, codes] : classes)
                if (codes.contains(code)) expected = name;
            INFO(legend << " " << code);
            CHECK(material_of(legend, code) == expected);
        }

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

TEST_CASE("each cell of a legend or a class table may stand in quotes", "[material]") {
    const Legend legend = Legend::from_csv("my.csv", "\"code\",\"material\"\r\n\"1\",\"water\"\r\n\"2\",soil\n");
    CHECK(legend.find(1) == ClassId{0});
    CHECK(legend.find(2));
    const Materials table = Materials::from_csv("my.csv", "\"name\",\"gamma10_db\"\n\"corn\",\"-14\"\n");
    CHECK(table.rows().at(table.find("corn").value()).gamma10_db == -14);
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
