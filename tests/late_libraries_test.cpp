// The program loads GDAL and PROJ when it first needs them: which runs do without, and that what they write is what they write
// with them.
#include <catch2/catch.hpp>

#include <gdal_priv.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>

#include "tests/drawn_raster.hpp"
#include "tests/program.hpp"

using namespace wedgescope::test;

namespace {

const std::string program = WEDGESCOPE_PROGRAM, data = WEDGESCOPE_DATA;

struct Loaded {
    bool gdal, proj;
    std::string words;  ///< of the loader
};
/// By a run that must succeed, by what the system's loader says of it.
Loaded loaded_by(std::vector<std::string> arguments, const Folder& folder) {
    arguments.insert(arguments.begin(), program);
    ::setenv("LD_DEBUG", "files", 1);
    const Ended ended = run_program(arguments, folder / "err.txt");
    ::unsetenv("LD_DEBUG");
    INFO(arguments[1]);
    REQUIRE(ended.code == 0);
    const auto names = [&](const char* library) { return ended.err.find(library) != std::string::npos; };
    REQUIRE(names("libstdc++"));  // the loader speaks, and of libraries
    return {names("libgdal"), names("libproj"), ended.err};
}
bool loads_gdal(const std::vector<std::string>& arguments, const Folder& folder) {
    return loaded_by(arguments, folder).gdal;
}
bool loads_either(const std::vector<std::string>& arguments, const Folder& folder) {
    const Loaded loaded = loaded_by(arguments, folder);
    return loaded.gdal || loaded.proj;
}

std::string store(const Folder& folder) {
    const std::string path = folder / "ground.store";
    CHECK(loads_gdal({"tile", data + "/inland_empire_dem.tif", path, "--culture", data + "/inland_empire_culture.tif",
                      "--culture-legend", "fbfm40", "-q"},
                     folder));
    return path;
}

struct CloseIt {
    void operator()(GDALDataset* dataset) const { GDALClose(dataset); }
};
using Dataset = std::unique_ptr<GDALDataset, CloseIt>;

Dataset open(const std::string& path) {
    GDALAllRegister();
    Dataset dataset(GDALDataset::Open(path.c_str()));
    REQUIRE(dataset);
    return dataset;
}

/// Bands, place, CRS and all that is said of them.
void check_alike(const std::string& one, const std::string& other) {
    INFO(one << " and " << other);
    const Dataset a = open(one), b = open(other);
    REQUIRE(a->GetRasterXSize() == b->GetRasterXSize());
    REQUIRE(a->GetRasterYSize() == b->GetRasterYSize());
    REQUIRE(a->GetRasterCount() == b->GetRasterCount());
    double ga[6] = {}, gb[6] = {};
    CHECK(a->GetGeoTransform(ga) == b->GetGeoTransform(gb));
    for (int i = 0; i < 6; ++i) CHECK(ga[i] == gb[i]);
    REQUIRE((a->GetSpatialRef() == nullptr) == (b->GetSpatialRef() == nullptr));
    if (a->GetSpatialRef()) {
        CHECK(a->GetSpatialRef()->IsSame(b->GetSpatialRef()));
        CHECK(a->GetSpatialRef()->GetDataAxisToSRSAxisMapping() == b->GetSpatialRef()->GetDataAxisToSRSAxisMapping());
    }
    const auto items = [](GDALDataset& dataset, const char* domain) {
        std::map<std::string, std::string> out;
        const CPLStringList list(dataset.GetMetadata(domain), FALSE);
        for (int i = 0; i < list.Count(); ++i) {
            const std::string item = list[i];
            out[item.substr(0, item.find('='))] = item.substr(item.find('=') + 1);
        }
        for (const char* name : {"X_DATASET", "Y_DATASET", "SCENE_JSON"}) out.erase(name);  // hold names and options
        return out;
    };
    CHECK(items(*a, "") == items(*b, ""));
    CHECK(items(*a, "GEOLOCATION") == items(*b, "GEOLOCATION"));
    CHECK(std::string(a->GetMetadataItem("SCENE_JSON")).size() > 100);
    for (int band = 1; band <= a->GetRasterCount(); ++band) {
        GDALRasterBand &x = *a->GetRasterBand(band), &y = *b->GetRasterBand(band);
        CHECK(std::string(x.GetDescription()) == y.GetDescription());
        CHECK(x.GetColorInterpretation() == y.GetColorInterpretation());
        CHECK(x.GetRasterDataType() == y.GetRasterDataType());
        int has_x = 0, has_y = 0;
        CHECK(x.GetNoDataValue(&has_x) == y.GetNoDataValue(&has_y));
        CHECK(has_x == has_y);
        const auto n = static_cast<std::size_t>(a->GetRasterXSize()) * static_cast<std::size_t>(a->GetRasterYSize());
        std::vector<std::uint8_t> cells[2] = {std::vector<std::uint8_t>(n), std::vector<std::uint8_t>(n)};
        for (int k = 0; k < 2; ++k)
            REQUIRE((k ? y : x).RasterIO(GF_Read, 0, 0, a->GetRasterXSize(), a->GetRasterYSize(), cells[k].data(),
                                         a->GetRasterXSize(), a->GetRasterYSize(), GDT_Byte, 0, 0, nullptr) == CE_None);
        CHECK(cells[0] == cells[1]);
    }
}

}  // namespace

TEST_CASE("what touches no raster of GDAL's does not load it", "[gdal]") {
    const Folder folder;
    CHECK_FALSE(loads_either({"help"}, folder));
    CHECK_FALSE(loads_either({"help", "simulate"}, folder));
    CHECK(loads_gdal({"--version"}, folder));
}

#ifdef WEDGESCOPE_LINKED_WITH_ARCHIVES
TEST_CASE("what archives hold is not loaded", "[gdal]") {
    const Folder folder;
    for (const std::string& words :
         {loaded_by({"help"}, folder).words,
          loaded_by({"simulate", "--dem", store(folder), "--latlon", "33.93,-117.33", "--altitude-msl", "7000ft",
                     "--range", "5km", "--quality", "draft", "-q", "-o", folder / "scope.png"},
                    folder)
              .words})
        for (const char* name : {"libtiff", "libpng", "libwebp", "libjpeg", "libboost", "libGeographic", "libxxhash"}) {
            INFO(name);
            CHECK(words.find(name) == std::string::npos);
        }
}
#endif

TEST_CASE("a picture of a store is made without GDAL and is as with it", "[gdal]") {
    const Folder folder;
    const std::string ground = store(folder);
    const auto scene = [&](const std::string& name, std::vector<std::string> more) {
        std::vector<std::string> words{
            "simulate", "--dem",          ground, "--latlon", "33.93,-117.33", "--altitude-msl",
            "7000ft",   "--range",        "12km", "--size",   "300",           "--quality",
            "draft",    "--reproducible", "-q",   "-o",       folder / name};
        words.insert(words.end(), more.begin(), more.end());
        return words;
    };
    const auto more = GENERATE(values<std::vector<std::string>>(
        {{"--rings", "off"}, {"--rings", "off", "--geometry", "grid", "--alpha", "on"}, {"--heading", "30deg"}}));
    const Loaded loaded = loaded_by(scene("without.png", more), folder);
    CHECK_FALSE(loaded.gdal);
    // A map round the sensor is in a CRS of its own, which PROJ puts in words.
    CHECK(loaded.proj == (more == std::vector<std::string>{"--rings", "off"}));
    auto with = more;
    with.insert(with.end(), {"--config", "ANYTHING=ELSE"});  // is GDAL's to read
    CHECK(loads_gdal(scene("with.png", with), folder));
    check_alike(folder / "without.png", folder / "with.png");
}

TEST_CASE("plain GeoTIFFs need no GDAL and give what they give with it", "[gdal]") {
    const Folder folder;
    const auto run = [&](const std::string& command, const std::string& name, std::vector<std::string> more) {
        std::vector<std::string> words{command,          "--latlon",       "33.93,-117.33",
                                       "--altitude-msl", "7000ft",         "--range",
                                       "12km",           "--reproducible", "-q"};
        const std::string dem = data + "/inland_empire_dem.tif";
        if (command == "simulate")
            words.insert(words.end(), {"--dem", dem, "--culture", data + "/inland_empire_culture.tif",
                                       "--culture-legend", "fbfm40", "--size", "300", "--quality", "draft", "--rings",
                                       "off", "--geometry", "grid", "-o", folder / name});
        else
            words.insert(words.end(), {dem, folder / name});
        words.insert(words.end(), more.begin(), more.end());
        return words;
    };
    for (const std::string command : {"simulate", "coverage"}) {
        INFO(command);
        const std::string name = command == "simulate" ? "picture.png" : "mask.tif";
        CHECK_FALSE(loads_either(run(command, name, {}), folder));
        const std::vector<std::string> with{"--config", "ANYTHING=ELSE"};  // is GDAL's to read
        CHECK(loads_gdal(run(command, "gdal_" + name, with), folder));
        check_alike(folder / name, folder / ("gdal_" + name));
    }
}

TEST_CASE("stores of usual types need no GDAL", "[gdal]") {
    const Folder folder;
    GDALAllRegister();
    const auto type = GENERATE(GDT_Byte, GDT_UInt16, GDT_Int16, GDT_UInt32, GDT_Int32, GDT_Float32);
    INFO(GDALGetDataTypeName(type));
    {
        const Dataset all = open(data + "/inland_empire_dem.tif");
        GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("GTiff");
        char lzma[] = "COMPRESS=LZMA";  // GDAL's to unpack
        char* options[] = {lzma, nullptr};
        const Dataset part(driver->Create((folder / "dem.tif").c_str(), 300, 300, 1, type, options));
        REQUIRE(part);
        std::vector<float> posts(300 * 300);
        REQUIRE(all->GetRasterBand(1)->RasterIO(GF_Read, 0, 0, 300, 300, posts.data(), 300, 300, GDT_Float32, 0, 0,
                                                nullptr) == CE_None);
        if (type == GDT_Byte)
            for (float& z : posts) z = std::fmod(z, 200.0F);
        REQUIRE(part->GetRasterBand(1)->RasterIO(GF_Write, 0, 0, 300, 300, posts.data(), 300, 300, GDT_Float32, 0, 0,
                                                 nullptr) == CE_None);
        double transform[6];
        all->GetGeoTransform(transform);
        part->SetGeoTransform(transform);
        part->SetSpatialRef(all->GetSpatialRef());
    }
    CHECK(loads_gdal({"tile", folder / "dem.tif", folder / "part.store", "-q"}, folder));
    const Dataset dem = open(folder / "dem.tif");
    double transform[6];
    dem->GetGeoTransform(transform);
    const std::string xy =
        std::to_string(transform[0] + 150.5 * transform[1]) + "," + std::to_string(transform[3] + 150.5 * transform[5]);
    const auto mask = [&](const std::string& from, const std::string& to) {
        return std::vector<std::string>{"coverage",       folder / from, folder / to,      "--xy", xy,
                                        "--altitude-agl", "100m",        "--reproducible", "-q"};
    };
    CHECK_FALSE(loads_either(mask("part.store", "store.tif"), folder));
    CHECK(loads_gdal(mask("dem.tif", "plain.tif"), folder));
    check_alike(folder / "store.tif", folder / "plain.tif");
}

TEST_CASE("a raster of WGS84 needs no data base of PROJ's", "[gdal]") {
    const Folder folder;
    ::setenv("PROJ_DATA", (folder / "nothing").c_str(), 1);
    ::setenv("PROJ_LIB", (folder / "nothing").c_str(), 1);
    const Ended ended = run_program({program, "coverage", data + "/azores_dem.tif", folder / "mask.tif", "--latlon",
                                     "38.47,-28.4", "--altitude-msl", "3000m", "--range", "5km", "-q"},
                                    folder / "err.txt");
    ::unsetenv("PROJ_DATA");
    ::unsetenv("PROJ_LIB");
    INFO(ended.err);
    CHECK(ended.code == 0);
}

TEST_CASE("a mask over a store is made without GDAL and is as with it", "[gdal]") {
    const Folder folder;
    const std::string ground = store(folder);
    const auto more = GENERATE(values<std::vector<std::string>>({{}, {"--geometry", "grid", "--range", "5km"}}));
    const auto mask = [&](const std::string& name) {
        std::vector<std::string> words{"coverage",       ground, folder / name,    "--latlon", "33.93,-117.33",
                                       "--altitude-agl", "100m", "--reproducible", "-q"};
        words.insert(words.end(), more.begin(), more.end());
        return words;
    };
    CHECK_FALSE(loads_either(mask("without.tif"), folder));
    auto with = mask("with.tif");
    with.insert(with.end(), {"--co", "COMPRESS=PACKBITS"});
    CHECK(loads_gdal(with, folder));
    check_alike(folder / "without.tif", folder / "with.tif");
}

TEST_CASE(
    "stores in WGS84 as degrees or UTM need neither PROJ nor its data base, those of other datums and projections do",
    "[gdal]") {
    const Folder folder;
    struct Case {
        std::string crs;
        double x, y, step;
        bool without;
    };
    const auto c = GENERATE(values<Case>({{"EPSG:4326", -28, 38, 1e-3, true},
                                          {"EPSG:32733", 5e5, 7e6, 30, true},
                                          {"EPSG:26911", 5e5, 4e6, 30, false},
                                          {"EPSG:3031", 1e5, 2e5, 30, false}}));
    INFO(c.crs);
    Drawing d;
    d.columns = d.rows = 64;
    d.geotransform = {{c.x, c.step, 0, c.y, 0, -c.step}};
    d.crs = c.crs;
    d.creation = {"COMPRESS=LZMA"};  // GDAL's to unpack
    draw(folder / "dem.tif", d);
    CHECK(loads_gdal({"tile", folder / "dem.tif", folder / "a.store", "-q"}, folder));
    const auto mask = [&](const std::string& from, const std::string& to) {
        return std::vector<std::string>{"coverage",
                                        folder / from,
                                        folder / to,
                                        "--xy",
                                        std::to_string(c.x + 30 * c.step) + "," + std::to_string(c.y - 30 * c.step),
                                        "--altitude-agl",
                                        "100m",
                                        "--reproducible",
                                        "-q"};
    };
    const Loaded loaded = loaded_by(mask("a.store", "store.tif"), folder);
    CHECK_FALSE(loaded.gdal);
    CHECK(loaded.proj != c.without);
    CHECK(loaded_by(mask("dem.tif", "plain.tif"), folder).proj);
    check_alike(folder / "store.tif", folder / "plain.tif");
    if (!c.without) return;
    for (const char* variable : {"PROJ_DATA", "PROJ_LIB"}) ::setenv(variable, (folder / "nothing").c_str(), 1);
    CHECK_FALSE(loads_either(mask("a.store", "again.tif"), folder));
    for (const char* variable : {"PROJ_DATA", "PROJ_LIB"}) ::unsetenv(variable);
    check_alike(folder / "again.tif", folder / "plain.tif");
}

TEST_CASE("a library that is not there is named, by the run that calls it alone", "[gdal]") {
    const Folder folder;
    // The program as it would be if libraries had other names.
    std::ifstream in(program, std::ios::binary);
    std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    const auto rename = [&](const std::string& name, const std::string& other) {
        const std::string begin = '\0' + name;  // a whole word, or the beginning of one
        const std::size_t at = bytes.find(begin);
        REQUIRE(at != std::string::npos);
        bytes.replace(at + 1, name.size(), other);
    };
    const std::string utm = folder / "utm.store", nad83 = folder / "nad83.store";
    for (const auto& [crs, path] : {std::pair("EPSG:32611", utm), std::pair("EPSG:26911", nad83)}) {
        Drawing d;
        d.columns = d.rows = 64;
        d.geotransform = {{5e5, 30, 0, 4e6, 0, -30}};
        d.crs = crs;
        draw(folder / "dem.tif", d);
        CHECK(loads_gdal({"tile", folder / "dem.tif", path, "-q"}, folder));
    }
    rename("libgdal.so.", "libgdax.so.");
    rename("libproj.so.", "libprox.so.");
    const std::string without = folder / "without";
    std::ofstream(without, std::ios::binary) << bytes;
    std::filesystem::permissions(without, std::filesystem::perms::owner_all);
    const auto mask = [&](const std::string& dem) {
        return run_program({without, "coverage", dem, folder / "mask.tif", "--xy", "501000,3999000", "--altitude-agl",
                            "100m", "--overwrite", "-q"},
                           folder / "err.txt");
    };
    CHECK(mask(utm).code == 0);
    const Ended of_proj = mask(nad83), of_gdal = mask(folder / "dem.tif");
    CHECK(of_proj.code == 1);
    CHECK_THAT(of_proj.err, Catch::StartsWith("wedgescope: PROJ cannot be loaded: libprox.so."));
    CHECK(of_gdal.code == 1);
    CHECK_THAT(of_gdal.err, Catch::StartsWith("wedgescope: GDAL cannot be loaded: libgdax.so."));
}
