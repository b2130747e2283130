// The class table, and legends that rasters carry themselves, from outside: what a file says is what the ground returns, and an
// echo image and a work folder know it by its values.
#include <catch2/catch.hpp>

#include <gdal_priv.h>
#include <gdal_rat.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "lib/material.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/file_content.hpp"
#include "tests/json.hpp"
#include "tests/program.hpp"
#include "tests/words.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinRel;
using wedgescope::test::draw;
using wedgescope::test::Drawing;
using wedgescope::test::Ended;
using wedgescope::test::Folder;
using Strings = std::vector<std::string>;

namespace {

using wedgescope::test::content;
using wedgescope::test::json_in;
using wedgescope::test::with;

const std::string data = WEDGESCOPE_DATA;
const Strings scene = {"simulate",
                       "--dem",
                       data + "/inland_empire_dem.tif",
                       "--latlon",
                       "33.93,-117.33",
                       "--altitude-msl",
                       "7000ft",
                       "--range",
                       "5km",
                       "--size",
                       "64",
                       "-q"};

struct Program {
    Folder folder;
    Ended run(const Strings& arguments) const {
        return wedgescope::test::run_program(with({WEDGESCOPE_PROGRAM}, arguments), folder / "err");
    }
    void make(const Strings& arguments) const {
        const Ended ended = run(arguments);
        INFO(ended.err);
        REQUIRE(ended.code == 0);
    }
    void refuses(const Strings& arguments, int code, const Strings& words) const {
        const Ended ended = run(arguments);
        INFO(ended.err);
        CHECK(ended.code == code);
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
        for (const std::string& word : words) CHECK_THAT(ended.err, Contains(word));
    }
    std::string write(const std::string& name, const std::string& text) const {
        std::ofstream(folder / name, std::ios::binary) << text;
        return folder / name;
    }
    std::string operator/(const std::string& name) const { return folder / name; }
    double watts(const std::string& name) const {
        GDALAllRegister();
        GDALDataset* file = GDALDataset::FromHandle(GDALOpen((folder / name).c_str(), GA_ReadOnly));
        REQUIRE(file);
        const int n = file->GetRasterXSize(), m = file->GetRasterYSize();
        std::vector<double> cells(static_cast<std::size_t>(n) * static_cast<std::size_t>(m));
        REQUIRE(file->GetRasterBand(1)->RasterIO(GF_Read, 0, 0, n, m, cells.data(), n, m, GDT_Float64, 0, 0, nullptr) ==
                CE_None);
        GDALClose(file);
        double sum = 0;
        for (const double w : cells) sum += w;
        return sum;
    }
};

}  // namespace

TEST_CASE("the file in docs is the program's table", "[class-table]") {
    CHECK(Materials::from_csv("classes.csv", content(WEDGESCOPE_CLASSES)).own().empty());
}

TEST_CASE("a class of one's own returns what its row says", "[class-table]") {
    const Program program;
    const std::string table = program.write("fields.csv", "# mine\nname,gamma10_db\ncorn,-14\nsoil,-20\n");
    program.make(with(scene, {"--echo", program / "plain.tif"}));
    program.make(with(scene, {"--echo", program / "corn.tif", "--class-table", table, "--material", "corn"}));
    program.make(with(scene, {"--echo", program / "soil.tif", "--class-table", table}));
    const double plain_w = program.watts("plain.tif");
    CHECK_THAT(program.watts("corn.tif"), WithinRel(plain_w * std::pow(10, 0.3), 1e-5));
    CHECK_THAT(program.watts("soil.tif"), WithinRel(plain_w * std::pow(10, -0.3), 1e-5));
    // Whatever the order of the options, and in a scene file; a table like the shipped one changes no bit.
    program.make(with(scene, {"--echo", program / "again.tif", "--material", "corn", "--class-table", table}));
    const std::string ini = program.write("scene.ini", "material = corn\nclass-table = fields.csv\n");
    program.make(with(scene, {ini, "--echo", program / "ini.tif"}));
    CHECK(program.watts("again.tif") == program.watts("corn.tif"));
    CHECK(program.watts("ini.tif") == program.watts("corn.tif"));
    for (const char* name : {"a", "b"}) std::filesystem::create_directory(program / name);
    program.make(with(scene, {"--echo", program / "a/echo.tif", "--reproducible"}));
    program.make(
        with(scene, {"--echo", program / "b/echo.tif", "--class-table", WEDGESCOPE_CLASSES, "--reproducible"}));
    CHECK((content(program / "a/echo.tif") == content(program / "b/echo.tif")));
}

TEST_CASE("an echo image holds the table's values, and serves without the file", "[class-table]") {
    const Program program;
    const std::string table = program.write("fields.csv", "corn,-14\n");
    const std::string echo = program / "echo.tif", png = program / "new.png";
    program.make(with(scene, {"--echo", echo, "-o", program / "scope.png", "--class-table", table, "--material", "corn",
                              "--reproducible"}));
    std::filesystem::remove(table);
    program.make({"scope", echo, "-o", png, "--reproducible", "-q"});
    CHECK((content(png) == content(program / "scope.png")));
    {
        GDALAllRegister();
        GDALDataset* file = GDALDataset::FromHandle(GDALOpen(echo.c_str(), GA_ReadOnly));
        REQUIRE(file);
        const std::string json = file->GetMetadataItem("SCENE_JSON");
        GDALClose(file);
        CHECK_THAT(json, Contains("corn,-14") && !Contains("fields.csv"));
    }
    // The same values from anywhere do no harm; others need a sweep.
    program.write("other.csv", "name,gamma10_db\ncorn,-14.0\n");
    program.make({"scope", echo, "-o", png, "--overwrite", "-q", "--class-table", program / "other.csv"});
    program.write("other.csv", "corn,-13\n");
    program.refuses({"scope", echo, "-o", png, "--overwrite", "--class-table", program / "other.csv"}, 2,
                    {"--class-table is '", "corn,-13", "corn,-14", "new sweep"});
}

TEST_CASE("a work folder is for one table, wherever it lies", "[class-table]") {
    const Program program;
    const std::string table = program.write("fields.csv", "corn,-14\n");
    const Strings work = with(scene, {"--material", "corn", "--echo", program / "echo.tif", "--overwrite", "--work-dir",
                                      program / "work", "--resume"});
    program.make(with(work, {"--class-table", table}));
    program.make(with(work, {"--class-table", program.write("moved.csv", "corn,-14.000 # the same\n")}));
    program.write("fields.csv", "corn,-13\n");
    program.refuses(with(work, {"--class-table", table}), 2, {"class-table"});
}

TEST_CASE("a table that cannot be read, or holds what is no class, costs one line", "[class-table]") {
    const Program program;
    const auto tried = [&](const std::string& file, int code, const Strings& words) {
        program.refuses(with(scene, {"--echo", program / "echo.tif", "--class-table", file}), code, words);
    };
    tried(program / "none.csv", 1, {"--class-table", "none.csv", "cannot be opened"});
    tried(program.folder / "", 1, {"is a folder"});
    tried(program.write("bad.csv", "corn,-14\nrye,thick\n"), 2, {"bad.csv', line 2", "gamma10_db is 'thick'"});
    program.refuses(with(scene, {"--echo", program / "echo.tif", "--material", "corn"}), 2,
                    {"--material is 'corn'", "metal"});
    const std::string good = program.write("good.csv", "corn,-14\n");
    program.refuses(with(scene, {"--echo", good, "--overwrite", "--class-table", good}), 2, {"class-table", "input"});
}

TEST_CASE("a raster's own attribute table is a legend", "[class-table]") {
    const Program program;
    const auto raster = [&](const std::string& name, const auto& fill) {
        Drawing codes;
        codes.columns = codes.rows = 40;
        codes.type = GDT_Byte;
        codes.value = [](int c, int r) { return (c + r) % 4; };
        draw(program / name, codes);
        GDALDataset* file = GDALDataset::FromHandle(GDALOpen((program / name).c_str(), GA_Update));
        REQUIRE(file);
        GDALDefaultRasterAttributeTable table;
        fill(table);
        REQUIRE(file->GetRasterBand(1)->SetDefaultRAT(&table) == CE_None);
        GDALClose(file);
        return program / name;
    };
    const auto named = [](GDALRasterAttributeTable& table, const char* value, GDALRATFieldUsage value_use,
                          const char* name, GDALRATFieldUsage name_use, const Strings& names) {
        table.CreateColumn(value, GFT_Integer, value_use);
        table.CreateColumn("Count", GFT_Integer, GFU_PixelCount);
        table.CreateColumn(name, GFT_String, name_use);
        for (std::size_t i = 0; i < names.size(); ++i) {
            table.SetValue(static_cast<int>(i), 0, static_cast<int>(i));
            table.SetValue(static_cast<int>(i), 2, names[i].c_str());
        }
    };
    const auto codes_of = [&](const std::string& path, const Strings& more = {}) {
        const std::string out = program / "info.json";
        const pid_t child = wedgescope::test::start(
            with({WEDGESCOPE_PROGRAM, "info", "--json", "--culture-legend", "rat", path}, more), program / "err", out);
        const Ended ended = wedgescope::test::wait_for(child, program / "err");
        INFO(ended.err);
        REQUIRE(ended.code == 0);
        return json_in(out)["files"][0];
    };
    const std::string by_usage = raster("usage.tif", [&](auto& t) {
        named(t, "Code", GFU_MinMax, "Cover", GFU_Name, {"Water", "grass", "", "METAL"});
    });
    const auto facts = codes_of(by_usage);
    CHECK(facts["legend"] == "rat");
    REQUIRE(facts["codes"].size() == 4);
    CHECK(facts["codes"][0]["material"] == "water");
    CHECK(facts["codes"][1]["material"] == "grass");
    CHECK(facts["codes"][2]["material"].is_null());
    CHECK(facts["codes"][3]["material"] == "metal");
    CHECK(facts["unknown_codes"] == 1);
    const std::string by_name = raster("name.tif", [&](auto& t) {
        named(t, "VALUE", GFU_Generic, "Class_Name", GFU_Generic, {"corn", "corn", "soil", "soil"});
    });
    CHECK(codes_of(by_name, {"--class-table", program.write("mine.csv", "corn,-14\n")})["codes"][1]["material"] ==
          "corn");
    const std::string ranges = raster("ranges.tif", [&](auto& t) {
        t.CreateColumn("from", GFT_Integer, GFU_Min);
        t.CreateColumn("to", GFT_Integer, GFU_Max);
        t.CreateColumn("cover", GFT_String, GFU_Name);
        t.SetValue(0, 0, 0);
        t.SetValue(0, 1, 1);
        t.SetValue(0, 2, "trees");
        t.SetValue(1, 0, 2);
        t.SetValue(1, 1, 255);
        t.SetValue(1, 2, "marsh");
    });
    CHECK(codes_of(ranges)["codes"][1]["material"] == "trees");
    CHECK(codes_of(ranges)["codes"][3]["material"] == "marsh");

    // The same ground as by a CSV of the same codes; a store keeps it, raster or not.
    Drawing ground;
    ground.columns = ground.rows = 40;
    ground.value = [](int c, int r) { return 2.0 * ((c * 7 + r * 3) % 5); };
    draw(program / "dem.tif", ground);
    const Strings small = {"simulate", "--xy",           "1200,1800", "--altitude-agl", "100m", "--geometry",
                           "grid",     "--reproducible", "-q",        "--overwrite"};
    const std::string full = raster("full.tif", [&](auto& t) {
        named(t, "Code", GFU_MinMax, "Cover", GFU_Name, {"sand", "grass", "rock", "metal"});
    });
    const std::string csv = program.write("codes.csv", "0,sand\n1,grass\n2,rock\n3,metal\n");
    program.make(with(small, {"--dem", program / "dem.tif", "--culture", full, "--culture-legend", "rat", "--echo",
                              program / "rat.tif"}));
    program.make(with(small, {"--dem", program / "dem.tif", "--culture", full, "--culture-legend", csv, "--echo",
                              program / "csv.tif"}));
    CHECK(program.watts("rat.tif") == program.watts("csv.tif"));
    program.make({"tile", program / "dem.tif", program / "store", "--culture", full, "--culture-legend", "rat", "-q"});
    program.make(with(small, {"--dem", program / "store", "--echo", program / "stored.tif"}));
    CHECK(program.watts("stored.tif") == program.watts("csv.tif"));
    const Strings work = with(small, {"--dem", program / "dem.tif", "--culture", full, "--culture-legend", "rat",
                                      "--echo", program / "rat.tif", "--work-dir", program / "work", "--resume"});
    program.make(work);
    program.make(work);

    const auto tried = [&](const std::string& path, const Strings& words) {
        program.refuses({"info", "--culture-legend", "rat", path}, 2, words);
    };
    tried(program / "dem.tif", {"culture-legend is rat", "dem.tif", "no raster attribute table"});
    tried(by_name, {"row 0, Class_Name is 'corn'", "marsh", "class-table"});
    tried(raster("nameless.tif", [&](auto& t) { named(t, "VALUE", GFU_Generic, "Red", GFU_Red, {"1"}); }),
          {"without names", "VALUE, Count, Red"});
    tried(raster("codeless.tif", [&](auto& t) { named(t, "Number", GFU_Generic, "class", GFU_Generic, {"sand"}); }),
          {"without codes", "Number, Count, class"});
    tried(raster("vast.tif",
                 [&](auto& t) {
                     t.CreateColumn("from", GFT_Integer, GFU_Min);
                     t.CreateColumn("to", GFT_Integer, GFU_Max);
                     t.CreateColumn("cover", GFT_String, GFU_Name);
                     for (int row = 0; row < 5; ++row) {
                         t.SetValue(row, 0, 65536 * row);
                         t.SetValue(row, 1, 65536 * row + 65535);
                         t.SetValue(row, 2, "trees");
                     }
                 }),
          {"names 327680 codes up to row 4", "up to 262144 in all"});
    program.refuses(with(small, {"--dem", program / "store", "--culture-legend", "rat", "--echo", program / "x.tif"}),
                    2, {"culture-legend is rat", "no culture"});
}

TEST_CASE("tile names and counts every code that is not in the legend", "[class-table]") {
    const Program program;
    Drawing d;
    d.columns = 8;
    d.rows = 4;
    draw(program / "ground.tif", d);
    d.type = GDT_Int16;
    d.value = [](int column, int row) { return 500 + 8 * (row / 2) + column; };  // each of 16 codes twice
    draw(program / "cover.tif", d);
    const Ended ended = program.run({"tile", program / "ground.tif", program / "store", "--culture",
                                     program / "cover.tif", "--culture-legend", "fbfm40"});
    INFO(ended.err);
    CHECK(ended.code == 0);
    CHECK_THAT(ended.err, Contains("16 codes in 32 cells are not in the legend 'fbfm40'"));
    for (int code = 500; code < 516; ++code) CHECK_THAT(ended.err, Contains(std::to_string(code) + " (2 cells)"));
}

TEST_CASE("a store whose legend names a class of one's own needs its table again", "[class-table]") {
    const Program program;
    Drawing ground;
    ground.columns = ground.rows = 40;
    draw(program / "dem.tif", ground);
    Drawing codes = ground;
    codes.type = GDT_Byte;
    codes.value = [](int c, int) { return c / 20; };
    draw(program / "codes.tif", codes);
    const std::string table = program.write("mine.csv", "corn,-14\n"),
                      legend = program.write("legend.csv", "0,corn\n1,soil\n");
    const Strings tile = {
        "tile", program / "dem.tif", program / "store", "--culture", program / "codes.tif", "--culture-legend", legend,
        "-q"};
    program.refuses(tile, 2, {"legend.csv, line 1", "'corn'", "class-table"});
    program.make(with(tile, {"--class-table", table}));
    const Strings small = {
        "simulate", "--dem",  program / "store",   "--xy", "1200,1800", "--altitude-agl", "100m", "--geometry", "grid",
        "-q",       "--echo", program / "echo.tif"};
    program.refuses(small, 2, {"tile store '", "store': legend ", "'corn'", "class-table"});
    program.make(with(small, {"--class-table", table}));
    // Coverage where it asks for classes; what is seen hangs on none.
    const Strings seen = {"coverage",           "--xy",       "1200,1800", "--altitude-agl", "100m", program / "store",
                          program / "seen.tif", "--overwrite"};
    program.refuses(with(seen, {"--layer", "response"}), 2, {"'corn'", "class-table"});
    program.make(with(seen, {"--layer", "response", "--class-table", table}));
    program.make(seen);
}
