// Rasters by GDAL's many drivers: what they declare by themselves, and what they refuse.
#include <catch2/catch.hpp>

#include <gdal_priv.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>

#include "tests/drawn_raster.hpp"
#include "tests/file_content.hpp"
#include "tests/json.hpp"
#include "tests/program.hpp"
#include "tests/words.hpp"

using namespace wedgescope::test;
using Catch::Matchers::Contains;

namespace {

const std::string program = WEDGESCOPE_PROGRAM;
using Words = std::vector<std::string>;

struct CloseIt {
    void operator()(GDALDataset* dataset) const { GDALClose(dataset); }
};

Ended run(const Folder& folder, const Words& words) {
    return run_program(with({program}, with(words, {"-q", "--overwrite"})), folder / "log");
}

void draw_ridge(const std::string& path) {
    Drawing d;
    d.columns = d.rows = 64;
    d.value = [](int column, int) { return column == 40 ? 50.0 : 0.0; };
    d.geotransform = {{465000, 30, 0, 3755000, 0, -30}};
    draw(path, d);
}

Words coverage_of(const Folder& folder, const std::string& output, const Words& more = {}) {
    return with({"coverage", folder / "dem.tif", folder / output, "--xy", "465960,3754040", "--altitude-agl", "20m"},
                more);
}
Words simulation_of(const Folder& folder, const Words& more) {
    return with({"simulate", "--dem", folder / "dem.tif", "--xy", "465960,3754040", "--altitude-agl", "20m", "--range",
                 "800m", "--size", "64"},
                more);
}

/// Values of the file that its own no-data value hides.
int hidden_values(const std::string& path) {
    GDALAllRegister();
    const std::unique_ptr<GDALDataset, CloseIt> in(GDALDataset::Open(path.c_str()));
    REQUIRE(in);
    GDALRasterBand& band = *in->GetRasterBand(1);
    const int columns = in->GetRasterXSize(), rows = in->GetRasterYSize();
    std::vector<double> cells(static_cast<std::size_t>(columns * rows));
    REQUIRE(band.RasterIO(GF_Read, 0, 0, columns, rows, cells.data(), columns, rows, GDT_Float64, 0, 0, nullptr) ==
            CE_None);
    int declared = 0;
    const double value = band.GetNoDataValue(&declared);
    return declared ? static_cast<int>(std::count(cells.begin(), cells.end(), value)) : 0;
}

}  // namespace

TEST_CASE("no driver's own no-data value hides what is seen, hidden or a state", "[output_formats]") {
    const Folder folder;
    draw_ridge(folder / "dem.tif");
    for (const auto& [driver, ending] : {std::pair{"SAGA", ".sdat"},
                                         {"RMF", ".rsw"},
                                         {"ISIS2", ".cub"},
                                         {"ISIS3", ".cub"},
                                         {"ENVI", ".dat"},
                                         {"HFA", ".img"},
                                         {"netCDF", ".nc"},  // writes no file in memory
                                         {"GSBG", ".grd"}})  // has a no-data value that no code can be
        for (const char* what : {"mask", "states", "polar", "counts"}) {
            const std::string path = std::string(what) + "_" + driver + ending;
            INFO(path);
            Words words = coverage_of(folder, path, {"--of", driver});
            if (what == std::string("states")) words = with(words, {"--layer", "states"});
            if (what == std::string("polar"))
                words = simulation_of(folder, {"--states", folder / path, "--of", driver});
            if (what == std::string("counts")) {
                std::ofstream(folder / "o.csv") << "x,y\n465960,3754040\n";
                words = {"coverage",
                         folder / "dem.tif",
                         folder / path,
                         "--observers",
                         folder / "o.csv",
                         "--altitude-agl",
                         "20m",
                         "--of",
                         driver};
            }
            const Ended ended = run(folder, words);
            INFO(ended.err);
            if (ended.code == 0) {
                CHECK(hidden_values(folder / path) == 0);
            } else {
                CHECK(ended.code == 2);
                CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
                CHECK_THAT(ended.err, Contains(std::string("driver ") + driver) && Contains("accepted: "));
                CHECK_FALSE(std::filesystem::exists(folder / path));
            }
            if (what != std::string("polar") && (driver == std::string("netCDF") || driver == std::string("GSBG")))
                CHECK(ended.code == 0);
            if (driver == std::string("SAGA") || driver == std::string("ENVI") || driver == std::string("HFA"))
                CHECK(ended.code == 0);
        }
}

TEST_CASE("a file that keeps no tiles of 0 holds codes of 0 none the less", "[output_formats]") {
    const Folder folder;
    GDALAllRegister();
    REQUIRE(GetGDALDriverManager()->GetDriverByName("Zarr"));
    Drawing d;
    d.columns = d.rows = 700;
    d.no_data = -1;
    d.value = [](int column, int row) { return column == 400 ? 500.0 : column == 5 && row == 5 ? -1.0 : 0.0; };
    d.geotransform = {{465000, 30, 0, 3755000, 0, -30}};
    draw(folder / "dem.tif", d);
    const Words at{"--xy", "478960,3744040", "--altitude-agl", "20m"};
    const auto cells = [&](const std::string& path) {
        const std::unique_ptr<GDALDataset, CloseIt> in(GDALDataset::Open((folder / path).c_str()));
        REQUIRE(in);
        std::vector<std::uint8_t> all(700 * 700);
        REQUIRE(in->GetRasterBand(1)->RasterIO(GF_Read, 0, 0, 700, 700, all.data(), 700, 700, GDT_Byte, 0, 0,
                                               nullptr) == CE_None);
        return all;
    };
    REQUIRE(run(folder, with({"coverage", folder / "dem.tif", folder / "mask.tif"}, at)).code == 0);
    const Ended ended = run(folder, with({"coverage", folder / "dem.tif", folder / "mask.zarr", "--of", "Zarr"}, at));
    INFO(ended.err);
    REQUIRE(ended.code == 0);
    const std::vector<std::uint8_t> mask = cells("mask.tif");
    CHECK(cells("mask.zarr") == mask);
    CHECK(run(folder, with({"simulate", "--dem", folder / "dem.tif", "--range", "4km", "--power", folder / "p.zarr",
                            "--of", "Zarr"},
                           at))
              .code == 0);
    CHECK(std::count(mask.begin(), mask.end(), 1) > 0);
}

TEST_CASE("a format of fewer bands than an echo image has, or that mixes up their bytes, is refused",
          "[output_formats]") {
    const Folder folder;
    draw_ridge(folder / "dem.tif");
    for (const Words& how : {Words{"--echo", folder / "e.gtx"}, Words{"--echo", folder / "e.grd", "--of", "GSBG"},
                             Words{"--echo", folder / "e.fits", "--of", "FIT"},
                             Words{"--alpha", "on", "-o", folder / "e.grd", "--of", "GSBG"}}) {
        const Ended ended = run(folder, simulation_of(folder, how));
        INFO(how.back() << ": " << ended.err);
        CHECK(ended.code == 2);
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
        CHECK(std::distance(std::filesystem::directory_iterator(folder / ""), {}) == 2);  // terrain and log
    }
}

TEST_CASE("creation options that GDAL refuses are refused for GDAL's reason", "[output_formats]") {
    const Folder folder;
    draw_ridge(folder / "dem.tif");
    const Words options{"--co", "TILED=YES", "--co", "BLOCKXSIZE=17"};
    for (const Words& words :
         {simulation_of(folder, with({"-o", folder / "y.tif"}, options)),
          simulation_of(folder, with({"--power", folder / "y.tif"}, options)),
          simulation_of(folder, with({"--states", folder / "y.tif"}, options)), coverage_of(folder, "y.tif", options),
          coverage_of(folder, "y.tif", with(options, {"--layer", "height"}))}) {
        const Ended ended = run(folder, words);
        INFO(ended.err);
        CHECK(ended.code != 0);
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
        CHECK_THAT(ended.err, Contains("y.tif' cannot be ") && Contains("TileWidth") && !Contains("TIFFVSetField") &&
                                  !Contains(".tmp-") && !Contains("/vsimem") && !Contains("grey") &&
                                  !Contains("does not keep") && !Contains("MissingRequired"));
    }
    for (const auto& [option, why] : {std::pair{"BLOCKXSIZE=17", "TileWidth"}, {"NBITS=16", "are lost"}}) {
        const Ended ended =
            run(folder, simulation_of(folder, {"--echo", folder / "y.tif", "--co", "TILED=YES", "--co", option}));
        INFO(ended.err);
        CHECK(ended.code == 2);
        CHECK_THAT(ended.err, Contains("y.tif', and with co TILED=YES " + std::string(option)) &&
                                  Contains("does not give back") && Contains(why) && !Contains("trial_of") &&
                                  !Contains("accepted: .tif"));
    }
}

TEST_CASE("counts and layers in files that would not read back as they are", "[output_formats]") {
    const Folder folder;
    draw_ridge(folder / "dem.tif");
    std::ofstream(folder / "o.csv") << "x,y\n465960,3754040\n";
    const auto refused = [&](const Words& words) {
        const Ended ended = run(folder, words);
        INFO(ended.err);
        CHECK(ended.code == 2);
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
        CHECK_FALSE(std::filesystem::exists(folder / "x.tif"));
        return ended.err;
    };
    const Words counts{
        "coverage", folder / "dem.tif", folder / "x.tif", "--observers", folder / "o.csv", "--altitude-agl", "20m"};
    for (const Words& lossy : {Words{"--co", "NBITS=4"}, {"--co", "DISCARD_LSB=4"}})
        CHECK_THAT(refused(with(counts, lossy)), Contains("does not keep them as they are"));
    CHECK_THAT(refused(with(counts, {"--co", "COMPRESS=CCITTFAX4"})), Contains("these creation options"));
    CHECK_THAT(refused(coverage_of(folder, "x.tif", {"--co", "PIXELTYPE=SIGNEDBYTE"})),
               Contains("does not keep them as they are"));
    CHECK_THAT(refused(coverage_of(folder, "x.tif", {"--layer", "height", "--co", "COMPRESS=JPEG"})),
               Contains("these creation options"));
    // Ranges beyond what half a float holds, and angles off by degrees.
    for (const Words& lossy : {Words{"--layer", "range", "--co", "NBITS=16"},
                               {"--layer", "depression", "--co", "COMPRESS=LERC", "--co", "MAX_Z_ERROR=9"}})
        CHECK_THAT(refused(coverage_of(folder, "x.tif", lossy)), Contains("does not keep them"));
    CHECK(run(folder, coverage_of(folder, "y.tif",
                                  {"--layer", "depression", "--co", "COMPRESS=LERC", "--co", "MAX_Z_ERROR=0.01"}))
              .code == 0);
    // What makes no file in memory is written, with options too; what takes none without a place has one.
    for (const auto& [name, more] :
         {std::pair{"l.nc", Words{}}, {"l.nc", {"--co", "COMPRESS=DEFLATE"}}, {"l.gpkg", {}}}) {
        INFO(name);
        CHECK(run(folder, coverage_of(folder, name, with(more, {"--layer", "height"}))).code == 0);
    }
    const Words big{"--co", "ENDIANNESS=BIG"};
    CHECK_THAT(refused(coverage_of(folder, "x.tif", with(big, {"--layer", "height", "--co", "PREDICTOR=3"}))),
               Contains("GDAL does not read back"));
    const auto values = [&](const std::string& path) {
        GDALAllRegister();
        const std::unique_ptr<GDALDataset, CloseIt> in(GDALDataset::Open(path.c_str()));
        REQUIRE(in);
        const int columns = in->GetRasterXSize(), rows = in->GetRasterYSize();
        std::vector<double> cells(static_cast<std::size_t>(columns * rows));
        REQUIRE(in->GetRasterBand(1)->RasterIO(GF_Read, 0, 0, columns, rows, cells.data(), columns, rows, GDT_Float64,
                                               0, 0, nullptr) == CE_None);
        return cells;
    };
    for (const std::string layer : {"height", "grazing"}) {
        INFO(layer);
        REQUIRE(run(folder, coverage_of(folder, "n.tif", {"--layer", layer})).code == 0);
        for (const Words& more : {Words{}, {"--co", "COMPRESS=ZSTD"}, {"--co", "ENDIANNESS=INVERTED"}}) {
            REQUIRE(run(folder, coverage_of(folder, "b.tif", with(with(big, more), {"--layer", layer}))).code == 0);
            CHECK(values(folder / "b.tif") == values(folder / "n.tif"));
        }
    }
    REQUIRE(run(folder, simulation_of(folder, {"--power", folder / "n.tif"})).code == 0);
    REQUIRE(run(folder, simulation_of(folder, with(big, {"--power", folder / "b.tif"}))).code == 0);
    CHECK(values(folder / "b.tif") == values(folder / "n.tif"));
    REQUIRE(
        run(folder, {"tile", folder / "dem.tif", folder / "store", "--co", "COMPRESS=DEFLATE", "--co", big[1]}).code ==
        0);
}

TEST_CASE("a layer that its driver would put elsewhere is refused, one that it puts nowhere remarked on",
          "[output_formats]") {
    const Folder folder;
    const auto draw_terrain = [&](bool south_up) {
        Drawing d;
        d.columns = 64;
        d.rows = 48;
        d.value = [](int column, int row) { return column == 40 ? 50.0 : row; };
        const double north = 3755000, south = north - 48 * 30;
        d.geotransform = {{465000, 30, 0, south_up ? south : north, 0, south_up ? 30.0 : -30.0}};
        draw(folder / "dem.tif", d);
    };
    const auto says = [&](const std::string& name, const Words& more = {}) {
        return run_program(with({program}, coverage_of(folder, name, with(more, {"--overwrite"}))), folder / "log");
    };
    draw_terrain(true);
    for (const char* name : {"x.bil", "x.rst", "x.ers", "x.sdat"}) {
        const Ended ended = says(name);
        INFO(ended.err);
        CHECK(ended.code == 2);
        CHECK_THAT(ended.err, Contains(name) && Contains("would lie elsewhere than the terrain, whose rows run north"));
        CHECK_FALSE(std::filesystem::exists(folder / name));
    }
    const auto lies_right = [&](const std::string& name) {
        const Ended ended = says(name);
        INFO(ended.err);
        CHECK(ended.code == 0);
        CHECK_THAT(ended.err, !Contains("does not keep its place"));
        std::array<double, 6> own{}, terrain{};
        const std::unique_ptr<GDALDataset, CloseIt> made(GDALDataset::Open((folder / name).c_str())),
            dem(GDALDataset::Open((folder / "dem.tif").c_str()));
        REQUIRE((made && dem));
        REQUIRE(made->GetGeoTransform(own.data()) == CE_None);
        REQUIRE(dem->GetGeoTransform(terrain.data()) == CE_None);
        CHECK(own == terrain);
    };
    for (const char* name : {"a.tif", "a.img"}) lies_right(name);
    draw_terrain(false);
    for (const char* name : {"b.bil", "b.rst", "b.ers", "b.sdat", "b.img"}) lies_right(name);
    const Ended ended = says("b.vic", {"--of", "VICAR"});
    CHECK(ended.code == 0);
    CHECK_THAT(ended.err, Contains("b.vic' is written by driver VICAR, which does not keep its place"));
}

TEST_CASE("a driver that writes files of other names than the one given is refused", "[output_formats]") {
    const Folder folder, logs;
    Drawing d;
    d.columns = d.rows = 48;
    for (const char* crs : {"EPSG:32611", ""}) {  // with a place and without
        d.crs = crs;
        if (d.crs.empty()) d.geotransform.reset();
        draw(folder / "dem.tif", d);
        const std::vector<std::string> before = folder.names();
        const char* const xy = d.crs.empty() ? "20,20" : "1200,1800";
        for (const auto& [driver, ending] :
             {std::pair{"ERS", ".ers"}, {"MFF", ".hdr"}, {"SAGA", ".sdat"}, {"RST", ".rst"}})
            for (const char* layer : {"mask", "height"}) {
                const Ended lost = run_program({program, "coverage", folder / "dem.tif", folder / "c.ct", "--xy", xy,
                                                "--altitude-agl", "20m", "--of", driver, "--layer", layer},
                                               logs / "log");
                INFO(crs << " " << driver << " " << layer << ": " << lost.err);
                CHECK(lost.code == 2);
                CHECK_THAT(lost.err, Contains("c.ct'") &&
                                         Contains("no raster that is found under this name; accepted: ") &&
                                         Contains(ending) && Contains("or another driver, such as GTiff"));
                CHECK(folder.names() == before);
            }
    }
}

TEST_CASE("what a driver writes beside an output replaces no input, and no file that an option names",
          "[output_formats]") {
    const Folder folder;
    draw_ridge(folder / "dem.tif");
    draw_ridge(folder / "other.tif");
    const auto untouched = [&](const std::string& file, const std::string& before) {
        INFO(file);
        CHECK(content(folder / file) == before);
    };
    const std::string dem = content(folder / "dem.tif"), other = content(folder / "other.tif");
    struct Case {
        const char *output, *driver, *option;
    };
    for (const Case& c : {Case{"p.xml", "PDS4", "IMAGE_FILENAME"},
                          {"c.lbl", "ISIS3", "EXTERNAL_FILENAME"},
                          {"c.mrf", "MRF", "DATANAME"},
                          {"c.mrf", "MRF", "indexname"}})
        for (const char* file : {"dem.tif", "other.tif"}) {
            INFO(c.driver << " " << file);
            const Ended ended = run(folder, coverage_of(folder, c.output,
                                                        {"--of", c.driver, "--layer", "height", "--co",
                                                         std::string(c.option) + "=" + folder / file}));
            CHECK(ended.code == 2);
            CHECK_THAT(ended.err,
                       Contains(std::string("co '") + c.option + "=") && Contains("names a file of its own"));
            untouched("dem.tif", dem);
            untouched("other.tif", other);
            CHECK_FALSE(std::filesystem::exists(folder / c.output));
        }
    // GDAL splits at a colon too.
    std::filesystem::create_directory(folder / "run=7");
    std::filesystem::copy(folder / "dem.tif", folder / "run=7/dem.tif");
    const Ended colon =
        run(folder, coverage_of(folder, "c.mrf",
                                {"--of", "MRF", "--layer", "height", "--co", "DATANAME:" + folder / "run=7/dem.tif"}));
    CHECK(colon.code == 2);
    CHECK_THAT(colon.err, Contains("is no creation option; accepted: NAME=VALUE"));
    untouched("run=7/dem.tif", dem);
    // A world file is found only as it is about to be put in place; an image's data file before any work.
    Drawing d;
    d.columns = d.rows = 64;
    d.value = [](int column, int) { return column == 40 ? 50.0 : 0.0; };
    d.geotransform.reset();
    d.crs.clear();
    draw(folder / "bare.tif", d);
    const std::string place = "30\n0\n0\n-30\n465015\n3754985\n";
    std::ofstream(folder / "bare.wld") << place;
    const Words words{"simulate", "--dem", folder / "bare.tif", "--xy", "465960,3754040", "--altitude-agl", "20m",
                      "--range",  "500m",  "--rings",           "off"};
    Ended ended = run(folder, with(words, {"-o", folder / "bare.png", "--co", "WORLDFILE=YES"}));
    CHECK(ended.code == 2);
    CHECK_THAT(ended.err,
               Contains("bare.png") && Contains("bare.wld', of which dem ") && Contains("may not replace an input"));
    untouched("bare.wld", place);
    CHECK_FALSE(std::filesystem::exists(folder / "bare.png"));
    ended = run(folder, with(words, {"-o", folder / "free.png", "--co", "WORLDFILE=YES"}));
    INFO(ended.err);
    CHECK(ended.code == 0);
    CHECK(std::filesystem::exists(folder / "free.wld"));
    std::filesystem::copy(folder / "dem.tif", folder / "dem.img");
    Words over = coverage_of(folder, "dem.xml", {"--of", "PDS4", "--layer", "height"});
    over[1] = folder / "dem.img";
    ended = run(folder, over);
    CHECK(ended.code == 2);
    CHECK_THAT(ended.err, Contains("dem.img") && Contains("may not replace an input"));
    untouched("dem.img", dem);
}

TEST_CASE("who wants the same bytes every time gets no driver that writes the time", "[output_formats]") {
    const Folder folder;
    draw_ridge(folder / "dem.tif");
    const Ended ended = run(folder, coverage_of(folder, "c.nc", {"--layer", "height", "--reproducible"}));
    CHECK(ended.code == 2);
    CHECK_THAT(ended.err,
               Contains("c.nc' is to be the same bytes every time") && Contains("driver netCDF writes the time"));
    CHECK(run(folder, coverage_of(folder, "c.nc", {"--layer", "height"})).code == 0);
    REQUIRE(::setenv("SOURCE_DATE_EPOCH", "1", 1) == 0);
    const int by_environment = run(folder, coverage_of(folder, "d.nc", {"--layer", "height"})).code,
              without_time = run(folder, coverage_of(folder, "d.tif", {"--layer", "height"})).code;
    ::unsetenv("SOURCE_DATE_EPOCH");
    CHECK(by_environment == 2);
    CHECK(without_time == 0);
}

TEST_CASE("info tells a no-data value that is no number from none", "[output_formats]") {
    const Folder folder;
    Drawing d;
    const auto told = [&](std::optional<double> no_data) {
        d.no_data = no_data;
        draw(folder / "dem.tif", d);
        const pid_t info = start({program, "info", "--json", folder / "dem.tif"}, folder / "log", folder / "out");
        REQUIRE(wait_for(info, folder / "log").code == 0);
        return json_in(folder / "out")["files"][0]["no_data"].dump();
    };
    CHECK(told(std::nullopt) == "null");
    CHECK(told(-1) == "-1.0");
    CHECK(told(std::numeric_limits<double>::quiet_NaN()) == "\"NaN\"");
    CHECK(told(-std::numeric_limits<double>::infinity()) == "\"-Infinity\"");
}

TEST_CASE("a power image in a file that changes it or forgets its scene is remarked on", "[output_formats]") {
    const Folder folder;
    draw_ridge(folder / "dem.tif");
    const auto says = [&](const std::string& name, const Words& options) {
        const Ended ended = run_program(
            with({program}, simulation_of(folder, with({"--power", folder / name, "--overwrite"}, options))),
            folder / "log");
        INFO(ended.err);
        REQUIRE(ended.code == 0);
        REQUIRE(std::filesystem::exists(folder / name));
        const std::size_t at = ended.err.find("does not keep ");
        return at == std::string::npos ? std::string() : ended.err.substr(at, ended.err.find('\n', at) - at);
    };
    CHECK(says("a.tif", {}).empty());
    CHECK(says("a.tif", {"--co", "COMPRESS=DEFLATE", "--co", "TILED=YES", "--power-unit", "dBm"}).empty());
    CHECK(says("a.img", {}).empty());
    CHECK_THAT(says("a.tif", {"--co", "COMPRESS=LERC", "--co", "MAX_Z_ERROR=0.1"}),
               Contains("its values as they are; .tif does"));
    // So little that watts alone are lost.
    CHECK_THAT(says("a.tif", {"--co", "COMPRESS=LERC", "--co", "MAX_Z_ERROR=1e-12"}),
               Contains("its values as they are"));
    CHECK_THAT(says("a.xyz", {}), Contains("what the image tells of its scene; .tif does"));
    const Ended ended = run_program(with({program}, simulation_of(folder, {"--power", folder / "a.nc", "--overwrite"})),
                                    folder / "log");
    CHECK(ended.code == 0);
    CHECK_THAT(ended.err, Contains("driver netCDF, which may not keep its values, its place"));
}
