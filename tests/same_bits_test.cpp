// The program's files are the same bytes whatever instructions it and the C library may use and whatever the locale writes
// for a decimal point.
#include <catch2/catch.hpp>

#include <algorithm>
#include <clocale>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "lib/target.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/file_content.hpp"
#include "tests/json.hpp"
#include "tests/program.hpp"
#include "tests/terrain.hpp"
#include "tests/variable.hpp"

using namespace wedgescope;
using wedgescope::test::Folder;
using wedgescope::test::Variable;

namespace {

using wedgescope::test::content;
using wedgescope::test::json_in;

const std::vector<std::string> ends{"scene.png",        "scene_echo.tif",    "scene_power.tif",
                                    "scene_states.tif", "scene_mask.tif",    "scene_height.tif",
                                    "weather.png",      "weather_power.tif", "weather_ground.tif"};

/// What a picture with all its layers, a mask and a layer of floats of one scene are, byte for byte; under the same names each
/// time, for rasters name their own file where the positions of their cells stand.
std::vector<std::string> files_of(const Folder& folder) {
    const auto run = [&](std::vector<std::string> words) {
        words.insert(words.begin(), WEDGESCOPE_PROGRAM);
        for (const char* word : {"--latlon", "47.2625,11.385", "--altitude-agl", "412.5m", "--range", "5.25km",
                                 "--reproducible", "--overwrite", "-q"})
            words.emplace_back(word);
        const test::Ended ended = test::run_program(words, folder / "error");
        INFO(ended.err);
        REQUIRE(ended.code == 0);
    };
    run({"simulate",
         "--dem",
         folder / "ground.tif",
         "--culture",
         folder / "classes.tif",
         "--culture-legend",
         folder / "legend.csv",
         "--culture-height",
         folder / "canopy.tif",
         "--report",
         folder / "simulate.json",
         "-o",
         folder / "scene.png",
         "--echo",
         folder / "scene_echo.tif",
         "--power",
         folder / "scene_power.tif",
         "--states",
         folder / "scene_states.tif",
         "--speckle",
         "2",
         "--noise",
         "on"});
    run({"simulate",
         "--dem",
         folder / "ground.tif",
         "--culture",
         folder / "classes.tif",
         "--culture-legend",
         folder / "lakes.csv",
         "--culture-height",
         folder / "canopy.tif",
         "--report",
         folder / "weather.json",
         "-o",
         folder / "weather.png",
         "--power",
         folder / "weather_power.tif",
         "--ground",
         folder / "weather_ground.tif",
         "--backscatter",
         "ulaby-dobson",
         "--polarisation",
         "circular",
         "--gases",
         "normal",
         "--rain",
         "moderate",
         "--cloud",
         "fog",
         "--speckle",
         "1",
         "--far-shore",
         "on",
         "--sea-state",
         "0.05",
         "--wind-direction",
         "200deg"});
    run({"coverage", folder / "ground.tif", folder / "scene_mask.tif", "--culture-height", folder / "canopy.tif",
         "--target-height", "2.5m", "--report", folder / "coverage.json"});
    run({"coverage", folder / "ground.tif", folder / "scene_height.tif", "--layer", "height"});
    std::vector<std::string> all;
    for (const std::string& end : ends) all.push_back(content(folder / end));
    return all;
}

void check_same(const std::vector<std::string>& files, const std::vector<std::string>& plain) {
    REQUIRE(files.size() == plain.size());
    for (std::size_t i = 0; i < ends.size(); ++i) {
        const bool same = files[i] == plain[i];  // not shown when they differ
        INFO(ends[i]);
        CHECK(same);
    }
}

/// Hills with canopy on a third of their posts, in three materials and with a void.
void draw_scene(const Folder& folder) {
    const auto hills = test::rolling(600, 90, 8);
    test::Drawing d;
    d.columns = d.rows = 300;
    d.crs = "EPSG:4326";
    d.geotransform = {{11.3, 1 / 1800.0, 0, 47.35, 0, -1 / 1800.0}};
    d.no_data = -9999;
    d.value = [&](int c, int r) { return c > 170 && c < 180 && r > 90 && r < 120 ? -9999 : 900 + hills(c, r); };
    test::draw(folder / "ground.tif", d);
    d.value = [&](int c, int r) { return (7 * c + 3 * r) % 9 < 3 ? 2.5 + (c * r) % 17 : 0; };
    test::draw(folder / "canopy.tif", d);
    d.type = GDT_Byte;
    d.no_data.reset();
    d.value = [&](int c, int r) { return 1 + (c / 2 + r / 3) % 3; };
    test::draw(folder / "classes.tif", d);
    std::ofstream(folder / "legend.csv") << "1,grass\n2,urban\n3,trees\n";
    std::ofstream(folder / "lakes.csv") << "1,grass\n2,water\n3,trees\n";
}

}  // namespace

TEST_CASE("the same bytes on every instruction set that the machine has", "[same_bits]") {
    const Folder folder;
    draw_scene(folder);
    const std::vector<std::string> plain = files_of(folder);
    for (const Target target : targets_here()) {
        const Variable forced("WEDGESCOPE_TARGET", name_of(target));
        INFO("WEDGESCOPE_TARGET=" << name_of(target));
        check_same(files_of(folder), plain);
        for (const char* report : {"simulate.json", "coverage.json"})
            CHECK(json_in(folder / report).at("instruction_set") == name_of(target));
    }
}

TEST_CASE("an instruction set that is unknown or not on the machine is refused in one line", "[same_bits]") {
    const Folder folder;
    std::vector<std::string> refused{"avx1024"};
    const std::vector<Target> here = targets_here();
    for (std::size_t i = 0; i < target_names.size(); ++i)
        if (std::find(here.begin(), here.end(), static_cast<Target>(i)) == here.end())
            refused.emplace_back(target_names[i]);
    for (const std::string& word : refused) {
        const Variable forced("WEDGESCOPE_TARGET", word);
        const test::Ended ended = test::run_program({WEDGESCOPE_PROGRAM, "--version"}, folder / "error");
        CHECK(ended.code == 2);
        std::string accepted = "this machine accepts auto";
        for (const Target target : here) accepted += std::string(", ") + name_of(target);
        INFO(ended.err);
        CHECK(ended.err.find("WEDGESCOPE_TARGET is '" + word + "'") != std::string::npos);
        CHECK(ended.err.ends_with(accepted + "\n"));
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
    }
}

TEST_CASE("the same bytes with every set of instructions that the C library may use, and with a decimal comma",
          "[same_bits]") {
    const Folder folder;
    draw_scene(folder);
    const std::vector<std::string> plain = files_of(folder);
    for (const std::string& file : plain) REQUIRE(file.size() > 1000);

    // glibc chooses its sine, exponential and logarithm by these.
    for (const char* masked : {"-FMA,-FMA4", "-AVX2,-FMA,-FMA4", "-AVX,-AVX2,-FMA,-FMA4,-AVX512F"}) {
        const Variable tunables("GLIBC_TUNABLES", std::string("glibc.cpu.hwcaps=") + masked);
        INFO(masked);
        check_same(files_of(folder), plain);
    }

    // A German locale made on the spot, where its sources are installed.
    const bool made =
        std::system(("localedef -i de_DE -f UTF-8 '" + folder / "de_DE.UTF-8" + "' >/dev/null 2>&1").c_str()) == 0;
    std::optional<Variable> path, leaks;
    if (made) {
        path.emplace("LOCPATH", folder / "");
        // The C library of Debian 12 itself never frees the list that it makes of this path.
        const char* options = std::getenv("ASAN_OPTIONS");
        leaks.emplace("ASAN_OPTIONS", (options ? std::string(options) + ":" : std::string()) + "detect_leaks=0");
    }
    const Variable locale("LC_ALL", "de_DE.UTF-8");
    const std::string before = std::setlocale(LC_ALL, nullptr);
    if (std::setlocale(LC_ALL, ""))
        CHECK(std::string(std::localeconv()->decimal_point) == ",");
    else
        WARN("no locale with a decimal comma can be had; only its name was tried");
    std::setlocale(LC_ALL, before.c_str());
    check_same(files_of(folder), plain);
}

TEST_CASE("variants of the C library show in no scene, where positions come from PROJ and GeographicLib",
          "[same_bits]") {
    // What is rounded before it enters a scene still differs in one of thousands of values: over these places it did.
    const std::string albers = WEDGESCOPE_TEST_DATA "/lake_sunapee_dem.tif";
    const Folder folder;
    const std::vector<std::string> layers{"echo.tif", "power.tif", "power.tif.geoloc.tif"};
    const auto files = [&](const char* place, const char* height) {
        const test::Ended ended = test::run_program(
            {WEDGESCOPE_PROGRAM, "simulate", "--dem", albers, "--latlon", place, "--altitude-msl", height, "--range",
             "12km", "--overwrite", "-q", "--echo", folder / "echo.tif", "--power", folder / "power.tif"},
            folder / "error");
        INFO(ended.err);
        REQUIRE(ended.code == 0);
        std::vector<std::string> bytes;
        for (const std::string& name : layers) bytes.push_back(content(folder / name));
        return bytes;
    };
    for (const auto& [place, height] :
         {std::pair("43.37038,-72.04719", "2249.7m"), std::pair("43.36369,-72.04976", "2444.8m"),
          std::pair("43.36181,-72.04381", "2540.2m"), std::pair("43.36380,-72.05516", "1545.1m")}) {
        INFO(place << ", " << height);
        const auto plain = files(place, height);
        const Variable tunables("GLIBC_TUNABLES", "glibc.malloc.arena_max=2:glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4");
        const auto masked = files(place, height);
        for (std::size_t i = 0; i < layers.size(); ++i) CHECK((plain[i] == masked[i] && plain[i].size() > 1000));
    }
}
