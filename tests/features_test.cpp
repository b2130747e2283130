// What features say: fields, classes, heights, sides and axes, what is wrong with them, and what a radar sees of them.
#include <catch2/catch.hpp>

#include <gdal_priv.h>
#include <ogrsf_frmts.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "lib/error.hpp"
#include "tests/burnt_features.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/json.hpp"
#include "tests/program.hpp"
#include "tests/refusal.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/store_check.hpp"
#include "tiles/tile_store.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using Strings = std::vector<std::string>;

namespace {

const GdalSession session(std::size_t{16} << 20, {});

}  // namespace

TEST_CASE("features of a wrong field, class, height or layer are named", "[features]") {
    const Folder folder;
    const auto says = [&](const nlohmann::json& fields, const Strings& words) {
        GeoJson file;
        file.add("Point", {{5.5, 5.5}}, {{"SMC", 1}, {"height", 3}});
        file.add("Point", {{6.5, 6.5}}, fields).write(folder / "f.json");
        const std::string found = refusal([&] { write_tile_store(into(folder / "store", folder / "f.json")); });
        for (const std::string& word : words) CHECK_THAT(found, Contains(word));
        CHECK_FALSE(std::filesystem::exists(folder / "store"));
        CHECK_FALSE(std::filesystem::exists(folder / "store.part"));
    };
    says({{"SMC", 15}}, {"features '", "f.json', layer 'f', feature 1: SMC is '15'", "legend smc", "metal"});
    says({{"material", "mud"}}, {"material is 'mud'", "marsh"});
    says({{"height", -1}}, {"height is '-1'", "metres from 0"});
    says({{"height", 1e6}}, {"height is '1000000"});
    says({{"HGT", "tall"}, {"height", nullptr}}, {"HGT is 'tall'"});

    GeoJson().add("Point", {{5.5, 5.5}}, {{"colour", 1}}).write(folder / "plain.json");
    CHECK_THAT(refusal([&] { write_tile_store(into(folder / "store", folder / "plain.json")); }),
               Contains("no field for a material or a height") && Contains("colour"));
    CHECK_THAT(refusal([&] { write_tile_store(into(folder / "store", folder / "none.json")); }),
               Contains("none.json' cannot be opened"));
    GeoJson().add("Point", {{5.5, 5.5}}, {{"SMC", 1}}).write(folder / "good.json");
    TileStoreParams named = into(folder / "store", folder / "good.json");
    named.features->layer = "roads";
    CHECK_THAT(refusal([&] { write_tile_store(named); }), Contains("features-layer is 'roads'") && Contains("good"));
    // A raster whose own codes are those of features.
    Drawing codes;
    codes.columns = codes.rows = 40;
    codes.type = GDT_UInt16;
    codes.geotransform = {west, step, 0, north, 0, -step};
    codes.value = [](int c, int r) { return c == 7 && r == 9 ? 30014 : 98; };
    draw(folder / "codes.tif", codes);
    CHECK_THAT(refusal([&] { write_tile_store(into(folder / "store", folder / "good.json", folder / "codes.tif")); }),
               Contains("codes.tif': code at column 7, row 9 is 30014") && Contains("good.json"));
    CHECK_THAT(refusal([&] { with_features(Legend("x", {{30254, 1}, {30003, 2}}), {}); }), Contains("code 30003"));
}

TEST_CASE("features that all lie off the terrain are remarked on", "[features]") {
    const Folder folder;
    GeoJson far, near;
    far.add_box(90000, 5, 90010, 9, {{"SMC", 1}}).write(folder / "far.json");
    near.add_box(90000, 5, 90010, 9, {{"SMC", 1}}).add("Point", {{5.5, 5.5}}, {{"SMC", 1}}).write(folder / "near.json");
    CHECK(write_tile_store(into(folder / "far", folder / "far.json")).features_lie_elsewhere);
    CHECK_FALSE(write_tile_store(into(folder / "near", folder / "near.json")).features_lie_elsewhere);
    const Ended ended = wedgescope::test::run_program(
        {WEDGESCOPE_PROGRAM, "tile", dem, folder / "again", "--features", folder / "far.json"}, folder / "err");
    CHECK(ended.code == 0);
    CHECK_THAT(ended.err, Contains("none lies on a cell of the terrain"));
}

TEST_CASE("names that a shapefile has cut are those fields too, and fields that are left out are named", "[features]") {
    const Folder folder;
    GeoJson file;
    file.add_box(100, 100, 110, 110,
                 {{"surface_material_category", 1},
                  {"predominant_height", 12},
                  {"directivity", "uni"},
                  {"axis", 90},
                  {"owner", "x"},
                  {"height_ft", 40}});
    file.write(folder / "f.geojson");
    GDALAllRegister();
    GDALDataset* const in =
        GDALDataset::FromHandle(GDALOpenEx((folder / "f.geojson").c_str(), GDAL_OF_VECTOR, nullptr, nullptr, nullptr));
    REQUIRE(in);
    GDALDataset* const out = GetGDALDriverManager()
                                 ->GetDriverByName("ESRI Shapefile")
                                 ->CreateCopy((folder / "f.shp").c_str(), in, FALSE, nullptr, nullptr, nullptr);
    REQUIRE(out);
    GDALClose(out);
    GDALClose(in);
    for (const std::string name : {"geojson", "shp"}) {
        const Ended ended = wedgescope::test::run_program(
            {WEDGESCOPE_PROGRAM, "tile", dem, folder / ("of_" + name), "--features", folder / ("f." + name)},
            folder / "err");
        INFO(ended.err);
        REQUIRE(ended.code == 0);
        CHECK_THAT(ended.err, Contains("fields that are left out: 'height_ft', 'owner'\n"));
    }
    for (const char* layer : {"/culture.vrt", "/culture_height.vrt"})
        CHECK(cells_of(folder / "of_shp" + layer).values == cells_of(folder / "of_geojson" + layer).values);
    CHECK(cells_of(folder / "of_shp/culture_height.vrt").at(105, 105) == 12);
    CHECK(std::filesystem::exists(folder / "of_shp/classes.csv"));
}

TEST_CASE("options of features are checked", "[features]") {
    const Folder folder;
    const std::string file = GeoJson().add("Point", {{5.5, 5.5}}, {{"SMC", 1}}).write(folder / "f.json");
    const auto refuses = [&](const Strings& more, int code, const Strings& words) {
        Strings all{WEDGESCOPE_PROGRAM, "tile", dem, folder / "store"};
        all.insert(all.end(), more.begin(), more.end());
        const Ended ended = wedgescope::test::run_program(all, folder / "err");
        INFO(ended.err);
        CHECK(ended.code == code);
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
        for (const std::string& word : words) CHECK_THAT(ended.err, Contains(word));
        CHECK_FALSE(std::filesystem::exists(folder / "store"));
    };
    refuses({"--features-touch", "on"}, 2, {"features-touch is given without features"});
    refuses({"--features-layer", "x"}, 2, {"features-layer is given without features"});
    refuses({"--features", dem}, 1, {"features '", "inland_empire_dem.tif' cannot be opened"});
    refuses({"--features", file, "--features-legend", "none"}, 1, {"features-legend 'none' is none of"});
    refuses({"--features", file, "--features-layer", "roads"}, 2, {"features-layer is 'roads'"});
    refuses({"--features", file, "--culture-height-scale", "0"}, 2, {"culture-height-scale is 0"});
    refuses({"--features", file, "--culture", data + "/inland_empire_culture.tif"}, 2, {"without culture-legend"});
}

TEST_CASE("a radar sees burnt metal by its gamma, and nothing else changes", "[features][long]") {
    const Folder folder;
    const auto run = [&](const Strings& arguments) {
        Strings all{WEDGESCOPE_PROGRAM};
        all.insert(all.end(), arguments.begin(), arguments.end());
        const Ended ended = wedgescope::test::run_program(all, folder / "err");
        INFO(ended.err);
        REQUIRE(ended.code == 0);
    };
    // North of the sensor at post (800, 800): 100 to 150 posts off, ten to either side.
    GeoJson().add_box(790, 650, 811, 700, {{"SMC", 1}}).write(folder / "metal.json");
    GeoJson().add("Point", {{5.5, 5.5}}, {{"SMC", 1}}).write(folder / "away.json");  // classes take spokes of their own
    GeoJson().add("Point", {{800.5, 650.5}}, {{"SMC", 1}, {"HGT", 300}}).write(folder / "tower.json");
    GeoJson().add("Point", {{5.5, 5.5}}, {{"SMC", 1}, {"HGT", 300}}).write(folder / "far.json");
    run({"tile", dem, folder / "plain", "--features", folder / "away.json", "-q"});
    run({"tile", dem, folder / "far", "--features", folder / "far.json", "-q"});
    run({"tile", dem, folder / "metal", "--features", folder / "metal.json", "-q"});
    run({"tile", dem, folder / "tower", "--features", folder / "tower.json", "-q"});
    const auto echo = [&](const std::string& store, const Strings& more = {}) {
        Strings arguments{"simulate",
                          "--dem",
                          folder / store,
                          "--xy",
                          "453732.925899,3740078.07702",
                          "--altitude-agl",
                          "1500m",
                          "--refine",
                          "off",
                          "--geometry",
                          "grid",
                          "--range",
                          "7km",
                          "--azimuth-bins",
                          "360",
                          "--range-bin",
                          "60m",
                          "--echo",
                          folder / (store + ".tif"),
                          "--overwrite",
                          "-q"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        run(arguments);
        return cells_of(folder / (store + ".tif"));
    };
    const Cells plain = echo("plain"), bright = echo("metal");
    REQUIRE(plain.values.size() == bright.values.size());
    const float most = *std::max_element(plain.values.begin(), plain.values.end());
    // Metal 6 dB, soil -17 dB.
    const double step_up = std::pow(10.0, 2.3);
    int full = 0, same = 0, outside = 0, beyond = 0;
    for (int a = 0; a < plain.rows; ++a)
        for (int j = 0; j < plain.columns; ++j) {
            if (plain.at(j, a) < 1e-4F * most) continue;
            const double ratio = static_cast<double>(bright.at(j, a)) / static_cast<double>(plain.at(j, a));
            full += std::fabs(ratio / step_up - 1) < 1e-3;
            same += std::fabs(ratio - 1) < 1e-4;
            beyond += ratio < 1 - 1e-3 || ratio > step_up * (1 + 1e-3);
            // 3000 to 4500 m along the ground, from 2985 by half a post more; 315 m to either side: 6.1 degrees.
            const bool there = (a <= 7 || a >= 352) && j * 60 > 2900 && j * 60 < 5500;
            outside += !there && std::fabs(ratio - 1) > 1e-3;
        }
    CHECK(beyond == 0);
    CHECK(outside == 0);
    CHECK(full > 50);
    CHECK(same > 10000);

    // A tower of one cell hides what is behind it and shows its wall; culled or not it does the same.
    const Cells far = echo("far"), tower = echo("tower"), uncut = echo("tower", {"--no-cull"});
    CHECK(tower.values == uncut.values);
    CHECK(tower.values != far.values);
    outside = 0;
    for (int a = 5; a < 355; ++a)
        for (int j = 0; j < plain.columns; ++j) outside += tower.at(j, a) != far.at(j, a);
    CHECK(outside == 0);
}

TEST_CASE("a feature with a side of its own becomes a class of its own", "[features]") {
    const Folder folder;
    GeoJson file;
    file.add_box(100, 100, 110, 110, {{"material", "metal"}, {"directivity", "uni"}, {"axis", 90.4}});
    file.add_box(120, 100, 130, 110, {{"SMC", 1}, {"directivity", "2"}, {"axis_deg", "-100"}});
    file.add_box(140, 100, 150, 110, {{"SMC", 1}, {"directivity", "Omni-directional"}});
    file.add_box(160, 100, 170, 110, {{"SMC", 1}});
    file.add_box(180, 100, 190, 110, {{"height", 5}, {"directivity", "uni"}, {"axis", 10}});  // no material
    file.add_box(200, 100, 210, 110, {{"SMC", 3}, {"directivity", "1"}, {"axis", 359.7}});
    file.write(folder / "f.json");
    const FeatureParams plain{folder / "f.json", "", false, *Legend::built_in("smc"), {}};
    const SidedClasses classes = sided_classes({}, plain, std::nullopt);
    FeatureParams params = plain;
    params.materials = classes.materials;
    params.axis_step_deg = classes.axis_step_deg;
    CHECK(params.axis_step_deg == 1);
    REQUIRE(params.materials.size() == 19);
    const auto row = [&](const char* name) { return params.materials[params.materials.by_name("material", name)]; };
    CHECK(row("metal-uni-090").directivity == Directivity::uni);
    CHECK(row("metal-uni-090").axis_deg == 90);
    CHECK(row("metal-uni-090").gamma10_db == 6.0);
    CHECK(row("metal-uni-090").gamma_wall10_db == 15.0);
    CHECK(row("metal-bi-080").axis_deg == 80);
    CHECK(row("urban-uni-000").directivity == Directivity::uni);
    CHECK(row("urban-uni-000").structures == material_table()[urban].structures);

    TileStoreParams store = into(folder / "store", folder / "f.json");
    store.features = params;
    store.legend = with_features(std::nullopt, params.materials);
    write_tile_store(store);
    const Cells codes = cells_of(folder / "store/culture.vrt");
    const auto id = [&](const char* name) { return static_cast<float>(params.materials.by_name("material", name)); };
    CHECK(codes.at(105, 105) == id("metal-uni-090"));
    CHECK(codes.at(125, 105) == id("metal-bi-080"));
    CHECK(codes.at(145, 105) == metal);
    CHECK(codes.at(165, 105) == metal);
    CHECK(codes.at(185, 105) == 255);
    CHECK(codes.at(205, 105) == id("urban-uni-000"));
    // Where the class itself has a side, that is the feature's too unless it says otherwise.
    FeatureParams sided = plain;
    sided.materials = Materials::from_csv("table", "name,directivity,axis_deg\nmetal,uni,90\n");
    const SidedClasses same = sided_classes(sided.materials, sided, std::nullopt);
    CHECK(same.materials.size() == 19);
    CHECK_FALSE(same.materials.find("metal-uni-090"));
    CHECK(same.materials.find("metal-omni"));
    // What the table of an earlier store says of such a class stays, unless it looks another way; water has no side.
    FeatureParams again = plain;
    again.materials = Materials::from_csv(
        "table", "name,gamma10_db,directivity,axis_deg\nmetal-uni-090,-40,uni,90\nmetal-omni,-30,omni,\n");
    const SidedClasses kept = sided_classes(again.materials, again, std::nullopt);
    CHECK(kept.sides == 3);
    CHECK(kept.materials.size() == 20);
    CHECK(kept.materials[kept.materials.by_name("material", "metal-uni-090")].gamma10_db == -40.0);
    again.materials = Materials::from_csv("table", "name,gamma10_db,directivity,axis_deg\nmetal-uni-090,-40,uni,80\n");
    CHECK_THROWS_WITH(sided_classes(again.materials, again, std::nullopt),
                      Contains("'metal-uni-090' with another side"));
    GeoJson()
        .add("Point", {{5.5, 5.5}}, {{"material", "water"}, {"directivity", "uni"}, {"axis", 3}})
        .write(folder / "w.json");
    CHECK(sided_classes({}, FeatureParams{folder / "w.json", "", false, *Legend::built_in("smc"), {}}, std::nullopt)
              .sides == 0);
    // A name that grows too long is refused before anything is written.
    FeatureParams wordy = plain;
    wordy.path = folder / "l.json";
    wordy.materials = Materials::from_csv("table", "name,gamma10_db\na-name-of-one-and-forty-letters-and-no-more,-4\n");
    GeoJson()
        .add("Point", {{5.5, 5.5}},
             {{"material", "a-name-of-one-and-forty-letters-and-no-more"}, {"directivity", "uni"}, {"axis", 3}})
        .write(folder / "l.json");
    CHECK_THROWS_WITH(sided_classes(wordy.materials, wordy, std::nullopt), Contains("at most 48 characters"));
    // Without any directivity there is nothing to add.
    GeoJson().add("Point", {{5.5, 5.5}}, {{"SMC", 1}, {"axis", 3}}).write(folder / "plain.json");
    CHECK(sided_classes({}, FeatureParams{folder / "plain.json", "", false, *Legend::built_in("smc"), {}}, std::nullopt)
              .axis_step_deg == 0);
}

TEST_CASE("axes of more classes than there is room for are rounded", "[features]") {
    const Folder folder;
    GeoJson file;
    for (int i = 0; i < 360; ++i)
        file.add("Point", {{i + 0.5, 5.5}}, {{"SMC", 1 + i % 2}, {"directivity", i % 3 ? "uni" : "bi"}, {"axis", i}});
    file.write(folder / "f.json");
    FeatureParams params{folder / "f.json", "", false, *Legend::built_in("smc"), {}};
    const SidedClasses classes = sided_classes({}, params, std::nullopt);
    params.materials = classes.materials;
    params.axis_step_deg = classes.axis_step_deg;
    // In steps of one degree and of two 240 axes of uni and 60 of bi; in steps of three 120 and 60.
    CHECK(params.axis_step_deg == 3);
    CHECK(params.materials.size() <= 255);
    for (std::size_t id = 16; id < params.materials.size(); ++id)
        CHECK(std::fmod(params.materials[id].axis_deg, 3) == 0);
    TileStoreParams store = into(folder / "store", folder / "f.json");
    store.features = params;
    store.legend = with_features(std::nullopt, params.materials);
    write_tile_store(store);
    const Cells codes = cells_of(folder / "store/culture.vrt");
    int wrong = 0;
    for (int i = 0; i < 360; ++i) {
        const Material& m = params.materials[static_cast<std::size_t>(codes.at(i, 5))];
        const bool bi = i % 3 == 0;
        const double off = std::remainder(m.axis_deg - i, bi ? 180 : 360);
        wrong += m.directivity != (bi ? Directivity::bi : Directivity::uni) || std::fabs(off) > 1.5 ||
                 m.gamma10_db != material_table()[static_cast<std::size_t>(15 - i % 2)].gamma10_db;
    }
    CHECK(wrong == 0);
}

TEST_CASE("a feature's wrong side is named", "[features]") {
    const Folder folder;
    const auto says = [&](const nlohmann::json& fields, const Strings& words) {
        GeoJson file;
        file.add("Point", {{5.5, 5.5}}, {{"SMC", 1}});
        file.add("Point", {{6.5, 6.5}}, fields).write(folder / "f.json");
        const Ended ended = wedgescope::test::run_program(
            {WEDGESCOPE_PROGRAM, "tile", dem, folder / "store", "--features", folder / "f.json"}, folder / "err");
        INFO(ended.err);
        CHECK(ended.code == 1);
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
        for (const std::string& word : words) CHECK_THAT(ended.err, Contains(word));
        CHECK_FALSE(std::filesystem::exists(folder / "store"));
    };
    says({{"SMC", 1}, {"directivity", "left"}, {"axis", 3}},
         {"feature 1: directivity is 'left'", "omni, uni or bi, or 1 (uni), 2 (bi), 3 (omni)"});
    says({{"SMC", 1}, {"directivity", "uni"}},
         {"feature 1: directivity is 'uni'", "axis, degrees clockwise from north"});
    says({{"SMC", 1}, {"directivity", "bi"}, {"axis", 361}}, {"axis is '361'", "degrees from -360 to 360"});
    says({{"SMC", 1}, {"directivity", 3}, {"axis", "x"}, {"material", "mud"}}, {"material is 'mud'"});
}

TEST_CASE("a radar sees a burnt feature by its side, and a scene over the store needs no table", "[features][long]") {
    const Folder folder;
    const auto run = [&](const Strings& arguments, int code = 0) {
        Strings all{WEDGESCOPE_PROGRAM};
        all.insert(all.end(), arguments.begin(), arguments.end());
        const Ended ended = wedgescope::test::run_program(all, folder / "err");
        INFO(ended.err);
        REQUIRE(ended.code == code);
        return ended.err;
    };
    // Metal north of the sensor at post (800, 800), alike; looking to the south, north and west; and beside these what is not.
    const auto box = [&](const char* name, const nlohmann::json& more) {
        nlohmann::json fields{{"SMC", 1}};
        fields.update(more);
        GeoJson().add_box(790, 650, 811, 700, fields).write(folder / (std::string(name) + ".json"));
        run({"tile", dem, folder / name, "--features", folder / (std::string(name) + ".json"), "-q"});
    };
    box("omni", nlohmann::json::object());
    box("south", {{"directivity", "uni"}, {"axis", 180}});
    box("north", {{"directivity", "uni"}, {"axis", 0}});
    box("both", {{"directivity", "bi"}, {"axis", 0}});
    box("aside", {{"directivity", "bi"}, {"axis", -45}});
    CHECK_FALSE(std::filesystem::exists(folder / "omni/classes.csv"));
    CHECK(std::filesystem::exists(folder / "south/classes.csv"));
    CHECK(verify_store(folder / "south", nullptr, {}).damage.empty());
    std::filesystem::rename(folder / "south/classes.csv", folder / "classes.csv");
    CHECK_THAT(verify_store(folder / "south", nullptr, {}).damage.at(0), Contains("south/classes.csv' is missing"));
    std::filesystem::rename(folder / "classes.csv", folder / "south/classes.csv");
    const Strings place{"--xy",
                        "453732.925899,3740078.07702",
                        "--altitude-agl",
                        "1500m",
                        "--geometry",
                        "grid",
                        "--range",
                        "7km",
                        "--azimuth-bins",
                        "360",
                        "--range-bin",
                        "60m",
                        "-q"};
    const auto echo = [&](const std::string& store, const Strings& more = {}, const std::string& name = "") {
        const std::string out = folder / ((name.empty() ? store : name) + ".tif");
        Strings arguments{"simulate", "--dem", folder / store, "--echo", out};
        arguments.insert(arguments.end(), place.begin(), place.end());
        arguments.insert(arguments.end(), more.begin(), more.end());
        run(arguments);
        return cells_of(out);
    };
    const Cells alike = echo("omni"), south = echo("south"), north = echo("north"), both = echo("both"),
                aside = echo("aside");
    // A cell full of metal, 3300 to 4300 m along the ground, at half a degree: the gain of its side there.
    const auto ratio = [&](const Cells& a, int row, int j) {
        return static_cast<double>(a.at(j, row)) / static_cast<double>(alike.at(j, row));
    };
    for (const int row : {0, 1, 2, 358, 359}) {
        const double azimuth = (row + 0.5) * std::acos(-1.0) / 180;
        for (const int j : {62, 66, 70}) {
            INFO(row << ", " << j);
            CHECK_THAT(ratio(south, row, j), WithinRel(std::pow(std::cos(azimuth), 4), 2e-3));
            CHECK_THAT(ratio(north, row, j), WithinRel(0.01, 2e-3));
            CHECK_THAT(ratio(both, row, j), WithinRel(std::pow(std::cos(azimuth), 4), 2e-3));
            CHECK_THAT(ratio(aside, row, j), WithinRel(std::pow(std::cos(azimuth + std::acos(-1.0) / 4), 4), 5e-3));
        }
    }
    // Elsewhere it is the same to the bit; and so is the picture however it is come by.
    for (int row = 20; row < 340; ++row)
        for (int j = 0; j < alike.columns; ++j)
            if (south.at(j, row) != alike.at(j, row)) FAIL(row << ", " << j);
    CHECK(echo("south", {"--source", "spilled", "--wedges", "7"}, "spilled").values == south.values);
    CHECK(echo("south", {"--class-table", folder / "south/classes.csv", "--no-cull"}, "given").values == south.values);
    // The layer response has it, post by post.
    const auto response = [&](const std::string& store) {
        Strings arguments{"coverage", "--layer", "response"};
        for (std::size_t i = 0; i < 8; ++i) arguments.push_back(place[i]);
        arguments.insert(arguments.end(), {"-q", folder / store, folder / (store + "_dbm.tif")});
        run(arguments);
        return cells_of(folder / (store + "_dbm.tif"));
    };
    const Cells dbm = response("omni"), dbm_north = response("north");
    CHECK_THAT(static_cast<double>(dbm.at(800, 675) - dbm_north.at(800, 675)), WithinAbs(20, 1e-3));
    CHECK(dbm.at(800, 720) == dbm_north.at(800, 720));
    // A table of one's own without these classes is refused, and says where they are.
    std::ofstream(folder / "mine.csv") << "corn,-14\n";
    Strings own{"simulate",         "--dem",         folder / "south",   "--echo",
                folder / "own.tif", "--class-table", folder / "mine.csv"};
    own.insert(own.end(), place.begin(), place.end());
    const std::string refused = run(own, 2);
    CHECK_THAT(refused, Contains("'metal-uni-180'") && Contains("south/classes.csv"));
    // A scope needs neither, and a spill can be kept round a point.
    run({"scope", folder / "south.tif", "-o", folder / "scope.png", "-q"});
    run({"tile", "--around", "33.8,-117.5", folder / "south", "-q"});
}

TEST_CASE("a raster says which side of culture's cells reflects, and features lie over it", "[features][long]") {
    const Folder folder;
    const auto run = [&](const Strings& arguments, int code = 0) {
        Strings all{WEDGESCOPE_PROGRAM};
        all.insert(all.end(), arguments.begin(), arguments.end());
        const Ended ended = wedgescope::test::run_program(all, folder / "err");
        INFO(ended.err);
        REQUIRE(ended.code == code);
        return ended.err;
    };
    // Codes of smc: metal, brick and no data in stripes of rows; sides in blocks of columns.
    Drawing culture;
    culture.columns = culture.rows = 200;
    culture.type = GDT_Byte;
    culture.no_data = 0;
    culture.geotransform = {x_at(700), step, 0, y_at(600), 0, -step};
    culture.value = [](int, int r) { return r < 80 ? 1 : r < 160 ? 3 : 0; };
    draw(folder / "culture.tif", culture);
    Drawing side = culture;
    side.type = GDT_Int16;
    side.no_data = -1;
    side.value = [](int c, int) { return c < 40 ? 180 : c < 80 ? 360 + 45 : c < 120 ? 540 : c < 160 ? 359 : -1; };
    draw(folder / "side.tif", side);
    GeoJson().add_box(710, 610, 720, 620, {{"SMC", 1}, {"directivity", "uni"}, {"axis", 90}}).write(folder / "f.json");
    const Strings tile{"tile",
                       dem,
                       folder / "store",
                       "--culture",
                       folder / "culture.tif",
                       "--culture-legend",
                       "smc",
                       "--directivity",
                       folder / "side.tif",
                       "-q"};
    Strings both = tile;
    both.insert(both.end(), {"--features", folder / "f.json", "--around", "33.8,-117.5"});
    run(both);
    const Cells codes = cells_of(folder / "store/culture.vrt");
    CHECK(codes.type == "Int16");
    std::ifstream file(folder / "store/classes.csv");
    const Materials table = Materials::from_csv("classes.csv", std::string(std::istreambuf_iterator<char>(file), {}));
    CHECK(table.size() == 16 + 3 + 3 + 1);
    const auto code = [&](const char* name) { return 30000 + static_cast<int>(table.by_name("material", name)); };
    int wrong = 0;
    for (int r = 0; r < 200; ++r)
        for (int c = 0; c < 200; ++c) {
            int expected = r < 80 ? 1 : r < 160 ? 3 : INT16_MIN;
            const bool bricks = r >= 80;
            if (r < 160) {
                if (c < 40)
                    expected = code(bricks ? "urban-uni-180" : "metal-uni-180");
                else if (c < 80)
                    expected = code(bricks ? "urban-bi-045" : "metal-bi-045");
                else if (c >= 120 && c < 160)
                    expected = code(bricks ? "urban-uni-359" : "metal-uni-359");
            }
            if (c >= 10 && c < 20 && r >= 10 && r < 20) expected = code("metal-uni-090");
            wrong += static_cast<int>(codes.at(c, r)) != expected;
        }
    CHECK(wrong == 0);
    // The sensor south of it: what looks south returns as if it looked everywhere, what looks north a hundredth.
    Strings plain = tile;
    plain[2] = folder / "plain";
    plain.erase(plain.begin() + 7, plain.begin() + 9);
    run(plain);
    run({tile[0], tile[1], folder / "sided", tile[3], tile[4], tile[5], tile[6], tile[7], tile[8], "-q"});
    const auto echo = [&](const std::string& store) {
        run({"simulate", "--dem", folder / store, "--xy", text(x_at(720.5), ",", y_at(720.5)), "--altitude-agl",
             "1500m", "--geometry", "grid", "--range", "4km", "--azimuth-bins", "720", "--range-bin", "60m", "--echo",
             folder / (store + ".tif"), "--overwrite", "-q"});
        return cells_of(folder / (store + ".tif"));
    };
    // Due north metal 40 to 120 posts away, brick nearer; the column of the sensor is one that looks south.
    const Cells alike = echo("plain"), sided = echo("sided");
    for (const int j : {32, 45, 55}) {
        INFO(j);
        CHECK_THAT(static_cast<double>(sided.at(j, 0)) / static_cast<double>(alike.at(j, 0)), WithinRel(1.0, 1e-3));
    }
    // Due south too, bricks turned away from it.
    CHECK_THAT(static_cast<double>(sided.at(30, 360)) / static_cast<double>(alike.at(30, 360)), WithinRel(0.01, 1e-3));

    // What is wrong is named.
    const auto refused = [&](const Drawing& raster, int exit_code) {
        draw(folder / "side.tif", raster);
        Strings again = tile;
        again[2] = folder / "none";
        const std::string said = run(again, exit_code);
        CHECK_FALSE(std::filesystem::exists(folder / "none"));
        CHECK(std::count(said.begin(), said.end(), '\n') == 1);
        return said;
    };
    side.value = [](int c, int r) { return c == 7 && r == 9 ? 541 : -1; };
    CHECK_THAT(refused(side, 1), Contains("side.tif': value at column 7, row 9 is 541") && Contains("0 to 359 (uni"));
    side.value = [](int, int) { return 10; };
    side.scale = 2;
    CHECK_THAT(refused(side, 1), Contains("side.tif' has band scale 2 and offset 0; accepted: plain codes"));
    side.scale = 1;
    const std::string crs = std::exchange(side.crs, "EPSG:32612");
    CHECK_THAT(refused(side, 1), Contains("side.tif' is in CRS 'EPSG:32612'") && Contains("that of the culture"));
    side.crs = crs;
    side.geotransform = {x_at(701), step, 0, y_at(600), 0, -step};
    CHECK_THAT(refused(side, 1), Contains("side.tif' has another grid than culture '"));
    CHECK_THAT(run({"tile", dem, folder / "none", "--directivity", folder / "side.tif"}, 2),
               Contains("directivity is given without culture"));
    // None of its own: the raster as it is.
    side.geotransform = culture.geotransform;
    side.value = [](int, int) { return 540; };
    draw(folder / "side.tif", side);
    Strings omni = tile;
    omni[2] = folder / "omni";
    run(omni);
    CHECK(cells_of(folder / "omni/culture.vrt").type == "Byte");
}
