// Names of a run's outputs against all files that its inputs are made of.
#include <catch2/catch.hpp>

#include <cpl_vsi.h>
#include <ogrsf_frmts.h>

#include <filesystem>
#include <fstream>

#include "tests/drawn_raster.hpp"
#include "tests/file_content.hpp"
#include "tests/refusal.hpp"
#include "tests/small_disk.hpp"
#include "tiles/json_text.hpp"
#include "tools/run_files.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

namespace {

GDALDriver& driver_named(const char* name) {
    GDALAllRegister();
    GDALDriver* driver = GetGDALDriverManager()->GetDriverByName(name);
    REQUIRE(driver);
    return *driver;
}

/// A small raster of another driver's.
void draw_as(const char* driver, const std::string& path, const Folder& folder) {
    draw(folder / "drawn.tif", {});
    GDALDataset* from = GDALDataset::Open((folder / "drawn.tif").c_str());
    REQUIRE(from);
    GDALDataset* to = driver_named(driver).CreateCopy(path.c_str(), from, FALSE, nullptr, nullptr, nullptr);
    REQUIRE(to);
    GDALClose(to);
    GDALClose(from);
    std::filesystem::remove(folder / "drawn.tif");
}

void draw_points(const std::string& path) {
    GDALDataset* out = driver_named("ESRI Shapefile").Create(path.c_str(), 0, 0, 0, GDT_Unknown, nullptr);
    REQUIRE(out);
    OGRLayer& layer = *out->CreateLayer("pts", nullptr, wkbPoint);
    OGRFieldDefn height("height", OFTReal);
    layer.CreateField(&height);
    OGRFeature feature(layer.GetLayerDefn());
    OGRPoint at(1020, 1990);
    feature.SetGeometry(&at);
    REQUIRE(layer.CreateFeature(&feature) == OGRERR_NONE);
    GDALClose(out);
}

std::string refused(const char* output_key, const std::string& output, const char* input_key, const std::string& input,
                    const std::string& driver = {}) {
    return refusal<InputError>([&] { check_names({{output_key, output}}, {{input_key, input}}, driver); });
}

const auto replaces = Contains("an output may not replace an input");

}  // namespace

TEST_CASE("JSON is taken as deep as any here is, and no deeper", "[run_files]") {
    const auto nested = [](std::size_t depth, const std::string& inside) {
        return std::string(depth, '[') + inside + std::string(depth, ']');
    };
    CHECK(is_shallow_json(""));
    CHECK(is_shallow_json(nested(64, "")));
    CHECK_FALSE(is_shallow_json(nested(65, "")));
    CHECK_FALSE(is_shallow_json(nested(40, R"({"a":)" + nested(30, "") + "}")));
    // Brackets in texts are none, however the texts are quoted.
    CHECK(is_shallow_json(nested(60, R"("[[[[[[\"{{{{{{{")")));
    CHECK_FALSE(is_shallow_json(nested(60, R"("\\",)" + nested(5, ""))));
}

TEST_CASE("no output replaces the file behind a subdataset or the archive of an input", "[run_files]") {
    const Folder folder;
    draw_as("netCDF", folder / "ll.nc", folder);
    CHECK_THAT(refused("output", folder / "ll.nc", "dem", "NETCDF:" + (folder / "ll.nc") + ":Band1"), replaces);
    CHECK_THAT(refused("output", folder / "ll.nc", "dem", "NETCDF:\"" + (folder / "ll.nc") + "\":Band1"), replaces);
    CHECK(refused("output", folder / "other.nc", "dem", "NETCDF:" + (folder / "ll.nc") + ":Band1") == nothing_refused);

    draw(folder / "in.tif", {});
    REQUIRE(VSISync((folder / "in.tif").c_str(), ("/vsizip/" + (folder / "in.zip") + "/n/in.tif").c_str(), nullptr,
                    nullptr, nullptr, nullptr));
    for (const std::string& path :
         {"/vsizip/" + (folder / "in.zip") + "/n/in.tif", "/vsizip/{" + (folder / "in.zip") + "}/n/in.tif"}) {
        INFO(path);
        CHECK_THAT(refused("output", folder / "in.zip", "dem", path, "GTiff"), replaces && Contains(path));
        CHECK(refused("output", folder / "in.tif", "dem", path) == nothing_refused);
    }
    CHECK_THAT(refused("output", folder / "in.tif", "dem", "/vsisubfile/0_400," + (folder / "in.tif")), replaces);
    CHECK_THAT(refused("output", folder / "in.tif", "dem", "GTIFF_DIR:1:" + (folder / "in.tif")), replaces);
}

TEST_CASE("no output replaces a file that an input's driver keeps beside it", "[run_files]") {
    const Folder folder;
    draw_as("SAGA", folder / "in.sdat", folder);
    CHECK_THAT(refused("power", folder / "in.sgrd", "dem", folder / "in.sdat", "EHdr"), replaces);
    draw_as("EHdr", folder / "in.bil", folder);
    CHECK_THAT(refused("report", folder / "in.hdr", "culture", folder / "in.bil"), replaces);
    draw_points(folder / "pts.shp");
    CHECK_THAT(refused("report", folder / "pts.dbf", "observers", folder / "pts.shp"), replaces);
    draw(folder / "a.tif", {});
    for (const char* more : {".ovr", ".msk", ".aux.xml", ".geoloc.tif"}) {
        INFO(more);
        CHECK(refused("output", folder / "a.tif" + more, "dem", folder / "a.tif", "GTiff") == nothing_refused);
        std::ofstream(folder / "a.tif" + more) << "<PAMDataset/>";
        CHECK_THAT(refused("output", folder / "a.tif" + more, "dem", folder / "a.tif", "GTiff"), replaces);
    }
}

TEST_CASE("what a driver writes beside an output replaces no part of an input", "[run_files]") {
    const Folder folder;
    draw_as("EHdr", folder / "in.bil", folder);
    CHECK_THAT(refused("output", folder / "in.dat", "dem", folder / "in.bil", "ENVI"),
               replaces && Contains("in.dat', beside which") && Contains("in.hdr"));
    CHECK_THAT(refused("output", folder / "in.bip", "dem", folder / "in.bil", "EHdr"), replaces);
    CHECK(refused("output", folder / "seen.bip", "dem", folder / "in.bil", "EHdr") == nothing_refused);
    for (const char* name : {"in.tif", "in.png", "in.img"}) {
        INFO(name);
        CHECK(refused("output", folder / name, "dem", folder / "in.bil") == nothing_refused);
    }
    // A text has nothing beside it.
    CHECK(refused("report", folder / "in.json", "dem", folder / "in.bil", "EHdr") == nothing_refused);
    // What an earlier run left beside its output is none of a GeoTIFF's.
    draw(folder / "seen.tif", {});
    draw_as("EHdr", folder / "seen.bil", folder);
    CHECK(refused("output", folder / "seen.bil", "dem", folder / "seen.tif", "EHdr") == nothing_refused);
}

TEST_CASE("no output replaces the ground map that the run keeps, nor a file of its work folder", "[run_files]") {
    const Folder folder;
    draw(folder / "g.tif", {});
    Settings s;
    s.dem = folder / "g.tif";
    s.output = folder / "o.tif";
    s.report = folder / "g.tif.ground";
    const auto refused_names = [&](auto&& check) { return refusal<InputError>([&] { check(s); }); };
    const auto coverage = [&] { return refused_names([](const Settings& all) { check_coverage_names(all); }); };
    const auto simulate = [&] { return refused_names([](const Settings& all) { check_run_names(all); }); };
    CHECK(coverage() == nothing_refused);
    s.keep_map = true;
    const auto names_map = [](const std::string& words) {
        CHECK_THAT(words, Contains("report is") && Contains("where the ground map of dem") && Contains("its own file"));
    };
    names_map(coverage());
    names_map(simulate());
    // One that stands is read.
    s.keep_map = false;
    std::ofstream(folder / "g.tif.ground") << "map";
    names_map(coverage());

    s.work_dir = folder / "work";
    for (const char* name : {"run.json", "wedge_000007.bin"}) {
        s.report = folder / "work/" + name;
        CHECK_THAT(simulate(), Contains("report is") && Contains("which work-dir") && Contains("keeps for itself"));
        std::filesystem::create_directory(folder / "work");
        s.report = folder / "work/../work/" + name;
        CHECK_THAT(simulate(), Contains("which work-dir"));
    }
    s.report = folder / "work/report.json";
    CHECK(simulate() == nothing_refused);
}

TEST_CASE("a full disk is an error that names the report, and the earlier one stays", "[run_files]") {
    const Folder folder;
    const std::string path = folder / "report.json";
    const auto write = [&](const std::string& words) {
        OutputFile file(path, true);
        write_report(file, {{"words", words}});
        file.commit();
    };
    write("few");
    const std::string few = content(path);
    const SmallDisk disk(4096);
    const std::string said = refusal([&] { write(std::string(100000, 'x')); });
    CHECK_THAT(said, Contains("report '" + path + "' cannot be written: File too large"));
    CHECK(content(path) == few);
    CHECK(folder.names() == std::vector<std::string>{"report.json"});
}
