// The program's files are the same bytes whatever instructions the C library may use and whatever the locale writes for a
// decimal point.
#include <catch2/catch.hpp>

#include <clocale>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "tests/drawn_raster.hpp"
#include "tests/program.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;
using test::Folder;

namespace {

/// A variable of the environment, for the time of a scope.
class Variable {
public:
    Variable(std::string name, const std::string& value) : name_(std::move(name)) {
        if (const char* before = std::getenv(name_.c_str())) before_ = before;
        setenv(name_.c_str(), value.c_str(), 1);
    }
    ~Variable() { before_ ? setenv(name_.c_str(), before_->c_str(), 1) : unsetenv(name_.c_str()); }
    Variable(const Variable&) = delete;
    Variable& operator=(const Variable&) = delete;

private:
    std::string name_;
    std::optional<std::string> before_;
};

std::string content(const std::string& path) {
    std::ostringstream all;
    all << std::ifstream(path, std::ios::binary).rdbuf();
    return all.str();
}

/// What a picture with all its layers and a mask of one scene are, byte for byte; under the same names each time, for rasters
/// name their own file where the positions of their cells stand.
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
    run({"simulate", "--dem", folder / "ground.tif", "-o", folder / "scene.png", "--echo", folder / "scene_echo.tif",
         "--power", folder / "scene_power.tif", "--states", folder / "scene_states.tif", "--speckle", "2", "--noise",
         "on"});
    run({"coverage", folder / "ground.tif", folder / "scene_mask.tif"});
    std::vector<std::string> all;
    for (const char* end : {".png", "_echo.tif", "_power.tif", "_states.tif", "_mask.tif"})
        all.push_back(content(folder / (std::string("scene") + end)));
    return all;
}

void check_same(const std::vector<std::string>& files, const std::vector<std::string>& plain) {
    const std::vector<std::string> names{"picture", "echo", "power", "states", "mask"};
    for (std::size_t i = 0; i < names.size(); ++i) {
        const bool same = files[i] == plain[i];  // not shown when they differ
        INFO(names[i]);
        CHECK(same);
    }
}

}  // namespace

TEST_CASE("the same bytes with every set of instructions that the C library may use, and with a decimal comma",
          "[same_bits]") {
    const Folder folder;
    const auto hills = test::rolling(600, 90, 8);
    test::Drawing d;
    d.columns = d.rows = 300;
    d.crs = "EPSG:4326";
    d.geotransform = {{11.3, 1 / 1800.0, 0, 47.35, 0, -1 / 1800.0}};
    d.value = [&](int c, int r) { return 900 + hills(c, r); };
    test::draw(folder / "ground.tif", d);
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
