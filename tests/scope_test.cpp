// `scope` from outside: its pictures are those of full runs with the same setting, file by file and byte by byte; what needs a
// new sweep, and what is no echo image, costs one line.
#include <catch2/catch.hpp>

#include <gdal_priv.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include "tests/file_content.hpp"
#include "tests/in_process.hpp"
#include "tests/json.hpp"
#include "tools/keys.hpp"
#include "tools/legend.hpp"

namespace {

namespace fs = std::filesystem;
using Catch::Matchers::Contains;
using wedgescope::test::content;
using wedgescope::test::json_in;
using Strings = std::vector<std::string>;
using wedgescope::test::Ended;

const std::string data = WEDGESCOPE_DATA;

Strings with(Strings base, const Strings& more) {
    base.insert(base.end(), more.begin(), more.end());
    return base;
}

std::string line_of(const Strings& words) {
    std::string line;
    for (const std::string& word : words) line += (line.empty() ? "" : " ") + word;
    return line;
}

class Folder {
public:
    Folder() {
        static int number = 0;
        path_ =
            fs::temp_directory_path() / ("scope_test_" + std::to_string(::getpid()) + "_" + std::to_string(++number));
        fs::create_directories(path_);
    }
    ~Folder() {
        fs::remove_all(path_);
        fs::remove(path_.string() + ".err");
    }
    std::string operator/(const std::string& name) const { return (path_ / name).string(); }
    std::string write(const std::string& name, const std::string& text) const {
        std::ofstream(*this / name, std::ios::binary) << text;
        return *this / name;
    }
    /// In the test's own process, but for legends, whose helper stands beside the program.
    Ended run(const Strings& arguments) const {
        const std::string err = path_.string() + ".err";
        if (std::find(arguments.begin(), arguments.end(), "--legend") == arguments.end())
            return wedgescope::test::run_here(arguments, err);
        return wedgescope::test::run_program(with({WEDGESCOPE_PROGRAM}, arguments), err);
    }
    /// A file of this folder, with its side files.
    void remove(const std::string& path) const {
        for (const char* side : {"", ".aux.xml", ".geoloc.tif"}) fs::remove(path + side);
    }
    /// Must do.
    void make(const Strings& arguments) const {
        const Ended ended = run(arguments);
        INFO("wedgescope " << line_of(arguments) << "\n" << ended.err);
        REQUIRE(ended.code == 0);
    }
    /// Every file by its name below the folder.
    std::map<std::string, std::string> files(const std::string& name = ".") const {
        std::map<std::string, std::string> all;
        for (const auto& entry : fs::recursive_directory_iterator(path_ / name))
            if (entry.is_regular_file()) all[fs::relative(entry.path(), path_ / name).string()] = content(entry.path());
        return all;
    }

private:
    fs::path path_;
};

/// Into a new folder of this name. Names count: side files are called by them.
Strings outputs(const Folder& folder, const std::string& name) {
    fs::create_directories(folder / name);
    const std::string at = folder / name;
    return {"-o",       at + "/scope.png",  "--power",        at + "/power.tif",
            "--states", at + "/states.tif", "--reproducible", "-q"};
}

struct Difference {
    Strings setting;
    bool changes_picture = true;
};

/// Each setting's files by scope from `echo` must be those of simulate.
void same_as_simulate(const Folder& folder, const Strings& scene, const std::vector<Difference>& settings) {
    folder.make(with(with({"simulate"}, scene), with(outputs(folder, "plain"), {"--echo", folder / "echo.tif"})));
    const auto plain = folder.files("plain");
    REQUIRE(plain.size() >= 5);
    for (const Difference& d : settings) {
        INFO(line_of(d.setting));
        fs::remove_all(folder / "full");
        fs::remove_all(folder / "again");
        // What is given twice counts once: the setting replaces the scene's.
        Strings replaced;
        for (std::size_t i = 0; i < scene.size(); i += 2)
            if (std::find(d.setting.begin(), d.setting.end(), scene[i]) == d.setting.end())
                replaced.insert(replaced.end(), {scene[i], scene[i + 1]});
        folder.make(with(with({"simulate"}, replaced), with(d.setting, outputs(folder, "full"))));
        folder.make(with(with({"scope", folder / "echo.tif"}, d.setting), outputs(folder, "again")));
        const auto full = folder.files("full"), again = folder.files("again");
        REQUIRE(full.size() == again.size());
        for (const auto& [name, bytes] : full) {
            INFO(name);
            REQUIRE(again.contains(name));
            CHECK((again.at(name) == bytes));
        }
        CHECK((full.at("scope.png") != plain.at("scope.png")) == d.changes_picture);
    }
}

/// In one line that holds `words`, and leaving the folder as it was.
void refuses(const Folder& folder, const Strings& arguments, int code, const Strings& words) {
    INFO("wedgescope " << line_of(arguments));
    const auto before = folder.files();
    const Ended ended = folder.run(arguments);
    INFO(ended.err);
    CHECK(ended.code == code);
    CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
    CHECK(ended.err.substr(0, 12) == "wedgescope: ");
    for (const std::string& word : words) CHECK_THAT(ended.err, Contains(word));
    CHECK((folder.files() == before));
}

const Strings riverside = {"--dem",
                           data + "/inland_empire_dem.tif",
                           "--culture",
                           data + "/inland_empire_culture.tif",
                           "--culture-legend",
                           "fbfm40",
                           "--culture-height",
                           data + "/inland_empire_canopy.tif",
                           "--culture-height-scale",
                           "0.1",
                           "--latlon",
                           "33.93,-117.33",
                           "--altitude-msl",
                           "5000ft",
                           "--range",
                           "5km",
                           "--size",
                           "160"};
/// As quick as there is: what a picture is made of is the same.
const Strings quick_riverside = with(riverside, {"--quality", "draft"});
/// 0.5 us and 1.5 degrees, so that a beam or pulse of another size keeps the bins.
const Strings bins = {"--azimuth-bins", "960", "--range-bin", "18.737028625m"};

}  // namespace

TEST_CASE("the scope of a stored echo is that of a full run, whatever receiver, noise or tube", "[scope]") {
    const Folder folder;
    same_as_simulate(
        folder, quick_riverside,
        {{{"--if-gain", "38.7dB"}},
         {{"--video-gain", "9dB"}},
         {{"--stc-range", "5km", "--stc-exponent", "3", "--stc-max", "25dB"}},
         {{"--dynamic-range", "33dB"}},
         {{"--minimum-range", "4km"}},
         {{"--minimum-range", "auto"}, false},  // no ground is so near, and the mean noise is black
         {{"--minimum-range", "auto", "--noise", "on", "--if-gain", "75dB"}},
         {{"--mds", "-95.5dBm"}},
         {{"--display-gamma", "2.2"}},
         {{"--noise-figure", "14dB"}},
         {{"--bandwidth", "30MHz"}},
         {{"--bwe", "off"}},
         {{"--ple", "off"}},
         {{"--bwe", "off", "--ple", "off", "--speckle", "2"}},
         {{"--bwe-scale", "4"}},
         {{"--bwe-scale", "0.4", "--ple-scale", "0.3"}},
         {{"--ple-scale", "6", "--speckle", "1", "--noise", "on"}},
         {{"--bwe", "off", "--ple", "off", "--bwe-scale", "20", "--ple-scale", "20"}},
         {{"--noise", "on"}},
         {{"--noise", "on", "--seed", "18446744073709551615"}},
         {{"--speckle", "1"}},
         {{"--speckle", "3", "--noise", "on", "--seed", "77"}},
         {{"--seed", "5"}, false},
         {{"--display", "ppi"}},
         {{"--display", "tdppi"}},
         {{"--display", "tdppi", "--sweep-delay", "3km", "--if-gain", "45dB"}},
         {{"--display", "tdppi", "--sweep-delay", "15us"}},
         {{"--sweep-delay", "altitude"}, false},
         {{"--size", "217"}},
         {{"--centre", "0,-0.9"}},
         {{"--centre", "0.4,0.2", "--display", "ppi", "--rings", "off"}},
         {{"--centre", "0,0"}, false},
         {{"--ring-spacing", "800m"}},
         {{"--azimuth-marks", "30deg"}},
         {{"--azimuth-marks", "45deg", "--rings", "off", "--heading", "20deg"}},
         {{"--pixel-fill", "none"}},
         {{"--pixel-fill", "holes", "--stc-range", "5km"}},
         {{"--alpha", "on"}},
         {{"--rings", "off"}},
         {{"--rings", "off", "--heading", "33.3deg", "--orientation", "heading"}},
         {{"--heading", "33.3deg"}, false},
         {{"--sector", "-20deg,45deg"}},
         {{"--sector", "350deg,10deg", "--noise", "on", "--speckle", "1"}},
         {{"--sector", "-20deg,45deg", "--heading", "225deg", "--orientation", "heading", "--display", "ppi"}},
         {{"--range", "5km", "--geometry", "geodesic"}, false},
         {{"--power-unit", "dBm"}, false}});
}

TEST_CASE("a sector's echo serves narrower sectors, other noise, and beams and pulses that it holds", "[scope]") {
    const Folder folder;
    const Strings sector = with(with(quick_riverside, bins), {"--heading", "200deg", "--sector", "350deg,40deg"});
    SECTION("from 3 km on") {
        same_as_simulate(folder, with(sector, {"--range-start", "3km"}),
                         {{{"--if-gain", "40dB"}},
                          {{"--sector", "-10deg,20deg"}},
                          {{"--sector", "0deg,20deg", "--noise", "on", "--speckle", "1", "--seed", "3"}},
                          {{"--bwe", "off", "--display", "ppi"}},
                          {{"--bwe-scale", "0.6"}},
                          {{"--sector", "10deg,20deg", "--bwe-scale", "1.8"}},
                          {{"--beam", "1deg"}},
                          // A later lead-in lies inside.
                          {{"--pulse", "0.3us"}},
                          {{"--ple", "off"}},
                          {{"--ple-scale", "0.4", "--noise", "on", "--speckle", "1"}}});
    }
    SECTION("from the sensor on") {
        same_as_simulate(folder, sector,
                         {{{"--sector", "-5deg,5deg", "--heading", "205deg", "--orientation", "heading"}},
                          {{"--ple", "off"}},
                          {{"--noise", "on", "--speckle", "2"}},
                          {{"--beam", "1deg", "--bwe", "off"}},
                          {{"--pulse", "0.3us"}},
                          {{"--ple-scale", "3"}},
                          {{"--beam", "1deg", "--bwe-scale", "1.5"}},
                          {{"--pulse", "0.3us", "--noise", "on", "--speckle", "1"}},
                          // Inside, the skirt of a wider beam is there.
                          {{"--sector", "10deg,20deg", "--beam", "2.5deg"}}});
    }
}

TEST_CASE("a full circle holds any beam, and from 0 m any pulse, where no level of detail hangs on them", "[scope]") {
    const Folder folder;
    same_as_simulate(folder, with(with(quick_riverside, bins), {"--detail", "off"}),
                     {{{"--beam", "4deg"}},
                      {{"--beam", "0.7deg"}},
                      {{"--azimuth-pattern", "uniform"}},
                      {{"--pulse", "2us"}},
                      {{"--bwe-scale", "9", "--beam", "3deg"}},
                      {{"--ple-scale", "20"}},
                      {{"--pulse", "0.25us", "--beam", "2deg", "--noise", "on"}}});
}

TEST_CASE("an echo swept without the widths of beam and pulse serves with them where it holds what they gather",
          "[scope]") {
    const Folder folder;
    same_as_simulate(folder, with(riverside, {"--bwe", "off", "--ple", "off", "--quality", "fine"}),
                     {{{"--bwe", "on"}}, {{"--ple", "on"}}, {{"--bwe", "on", "--ple", "on", "--speckle", "1"}}});
}

TEST_CASE("rain, which is in no echo image, is the same again", "[scope]") {
    const Folder folder;
    same_as_simulate(folder,
                     with(quick_riverside, {"--rain", "moderate", "--gases", "normal", "--cloud", "fog",
                                            "--backscatter", "ulaby-dobson", "--polarisation", "vv"}),
                     {{{"--if-gain", "42dB"}},
                      {{"--display", "ppi", "--ple-scale", "3"}},
                      {{"--noise", "on", "--speckle", "1"}},
                      {{"--bwe", "off", "--sector", "30deg,70deg"}}});
}

TEST_CASE("over a void scope says what simulate has said", "[scope][quick]") {
    const Folder folder;
    const auto said = [](const Ended& ended) {
        INFO(ended.err);
        REQUIRE(ended.code == 0);
        return ended.err.find("no height is known below the sensor") != std::string::npos;
    };
    for (const int height_m : {1, 900}) {
        std::string grid = "ncols 60\nnrows 60\nxllcorner 0\nyllcorner 0\ncellsize 30\nnodata_value -9999\n";
        for (int row = 0; row < 60; ++row)
            for (int column = 0; column < 60; ++column)
                grid += std::abs(row - 30) < 5 && std::abs(column - 30) < 5
                            ? "-9999 "
                            : std::to_string(height_m + (row + column) % 3) + " ";
        const std::string dem = folder.write("dem.asc", grid), echo = folder / "echo.tif", scope = folder / "scope.png";
        CHECK(said(folder.run({"simulate", "--dem", dem, "--xy", "900,900", "--altitude-msl", "1500m", "--echo", echo,
                               "-o", scope, "--overwrite"})) == (height_m == 900));
        CHECK(said(folder.run({"scope", echo, "-o", scope, "--overwrite"})) == (height_m == 900));
    }
}

TEST_CASE("echoes binned by ground range, on a plane grid, and in latitude and longitude serve too", "[scope]") {
    const Folder folder;
    SECTION("gpi-true") {
        same_as_simulate(folder, with(quick_riverside, {"--display", "gpi-true"}),
                         {{{"--if-gain", "42dB", "--rings", "off"}},
                          {{"--ple", "off"}},
                          {{"--ple-scale", "4", "--bwe-scale", "3"}},
                          {{"--pixel-fill", "holes"}},
                          {{"--noise", "on", "--speckle", "1"}},
                          {{"--stc-range", "6km"}},
                          {{"--sector", "30deg,70deg"}}});
    }
    SECTION("a plane") {
        same_as_simulate(folder,
                         {"--dem", data + "/lake_sunapee_dem.tif", "--culture", data + "/lake_sunapee_culture.tif",
                          "--culture-legend", "nlcd", "--latlon", "43.38,-72.05", "--altitude-agl", "900m", "--range",
                          "5km", "--geometry", "grid", "--earth", "flat", "--size", "120"},
                         {{{"--rings", "off"}},
                          {{"--rings", "off", "--heading", "77deg", "--orientation", "heading"}},
                          {{"--display", "tdppi", "--if-gain", "45dB"}},
                          {{"--sector", "10deg,100deg", "--noise", "on"}}});
    }
    SECTION("latitude and longitude, the range left open, voids") {
        same_as_simulate(folder,
                         {"--dem", data + "/olympic_coast_dem.tif", "--latlon", "47.95,-124.5", "--altitude-msl", "2km",
                          "--quality", "draft", "--size", "100", "--pulse", "4us"},
                         {{{"--if-gain", "40dB"}}, {{"--display", "ppi", "--rings", "off"}}});
    }
}

TEST_CASE("nothing of the data base is read, and a scene file that made the echo serves", "[scope]") {
    const Folder folder;
    fs::copy_file(data + "/inland_empire_dem.tif", folder / "ground.tif");
    const std::string scene =
        "latlon = 33.93,-117.33\naltitude-msl = 5000ft\nrange = 4km\nsize = 100\nquality = draft\n";
    const std::string ini =
        folder.write("scene.ini", "dem = ground.tif\nthreads = 1\nwedges = 3\necho = echo.tif\n" + scene);
    folder.make(with({"simulate", ini}, {"-q"}));
    folder.make(with({"simulate", ini, "--if-gain", "41dB", "--echo", folder / "other.tif"}, outputs(folder, "full")));
    folder.make(
        with({"simulate", ini, "--legend", "on", "--echo", folder / "legend.tif"}, outputs(folder, "labelled")));
    // Nor is any of it replaced.
    refuses(folder, {"scope", folder / "echo.tif", ini, "-o", folder / "ground.tif", "--overwrite"}, 2, {"dem"});
    fs::remove(folder / "ground.tif");
    folder.make(with({"scope", folder / "echo.tif", ini, "--if-gain", "41dB"}, outputs(folder, "again")));
    CHECK((folder.files("full") == folder.files("again")));
    const std::string setting = folder.write("setting.ini", "if-gain = 41dB  # alone\n");
    fs::remove_all(folder / "again");
    folder.make(with({"scope", folder / "echo.tif", setting}, outputs(folder, "again")));
    CHECK((folder.files("full") == folder.files("again")));
    // The command line wins over the file.
    fs::remove_all(folder / "again");
    folder.write("setting.ini", "if-gain = 20dB\nvideo-gain = 4dB\n");
    folder.make(with({"scope", folder / "echo.tif", setting, "--if-gain", "41dB"}, outputs(folder, "again")));
    CHECK((folder.files("full") == folder.files("again")));

    const std::string echo = folder / "echo.tif", png = folder / "new.png";
    // The legend names the data base: its scene file knows it.
    fs::remove_all(folder / "again");
    folder.make(with({"scope", echo, ini, "--legend", "on"}, outputs(folder, "again")));
    CHECK((folder.files("labelled") == folder.files("again")));
    refuses(folder, {"scope", echo, "--legend", "on", "-o", png}, 2, {"legend is on", "dem = PATH"});
    // One that the echo image's scene had is left out, and said to be.
    const Ended without = folder.run({"scope", folder / "legend.tif", "-o", folder / "without.png"});
    CHECK(without.code == 0);
    CHECK_THAT(without.err, Contains("the legend is left out"));
    folder.make({"scope", echo, "-o", folder / "plain.png", "-q"});
    CHECK(content(folder / "without.png") == content(folder / "plain.png"));
    folder.write("other.ini", "dem = ground.tif\nmaterial = grass\n");
    refuses(folder, {"scope", echo, folder / "other.ini", "-o", png}, 2,
            {"other.ini', line 2: material is 'grass'", "'soil'", "new sweep"});
    refuses(folder, {"scope", echo, "--dem", "elsewhere.tif", "-o", png}, 2,
            {"--dem is 'elsewhere.tif'", "the echo image holds what was seen of its data base"});
    folder.write("track.ini", "track = track.csv\nscan-step = 4\nscan-period = 4s\npower-stack = p.tif\n");
    refuses(folder, {"scope", echo, "--track", folder / "track.csv", "-o", png}, 2, {"track", "simulate's alone"});
    folder.make({"scope", echo, folder / "track.ini", "-o", folder / "of_track.png", "-q"});  // its frame perhaps
    refuses(folder, {"scope", echo, "--culture", "x.tif", "--culture-legend", "nlcd", "-o", png}, 2,
            {"--culture is 'x.tif'", "new sweep"});
    refuses(folder, {"scope", echo, "--material", "water", "-o", png}, 2, {"--material is 'water'", "'soil'"});
    refuses(folder, {"scope", echo, "--echo", folder / "new.tif", "-o", png}, 2, {"--echo is simulate's alone"});
    refuses(folder, {"scope", echo, "--timeline", folder / "t.json", "-o", png}, 2, {"--timeline is not for scope"});
    refuses(folder, {"scope", echo, "--work-dir", folder / "work", "-o", png}, 2, {"--work-dir is simulate's alone"});

    folder.make({"scope", echo, "-o", png, "--report", folder / "run.json", "-q"});
    const auto report = json_in(folder / "run.json");
    CHECK(report["format"] == "wedgescope-scope-1");
    CHECK(report["scene"]["range"] == "4km");
    CHECK(report["data_base"]["material"] == "soil");
    CHECK(report["inputs"][0]["bytes"] == fs::file_size(echo));
    std::uint64_t cells = 0;
    for (const auto& [state, count] : report["states"].items()) cells += count.get<std::uint64_t>();
    CHECK(cells == 960 * report["scene"]["resolved"]["shown"]["range_bin_end"].get<std::uint64_t>());
}

TEST_CASE(
    "an echo image holds its antenna's points and its set's values: no file of them is needed, and none may differ",
    "[scope]") {
    const Folder folder;
    // Names count: side files are called by them.
    const std::string echo = folder / "set_echo/echo.tif", png = folder / "new.png";
    for (const char* own : {"set_echo", "single_echo"}) fs::create_directories(folder / own);
    const std::string dish = folder.write("dish.csv", "-10,-40\n-3,-3\n3,0\n70,-32.5\n"),
                      other = folder.write("other.csv", "-10,-40\n-3,-3\n3,0\n70,-32.4\n"),
                      mine = folder.write("mine.ini", "frequency = 9.4GHz\nantenna = dish.csv\nif-gain = 47dB\n");
    folder.make(with(with({"simulate", "--set", mine}, riverside), with(outputs(folder, "full"), {"--echo", echo})));
    // As with the same values, given one by one: nothing that is written tells of a set.
    folder.make(with(with({"simulate", "--frequency", "9.4GHz", "--antenna", dish, "--if-gain", "47dB"}, riverside),
                     with(outputs(folder, "single"), {"--echo", folder / "single_echo/echo.tif"})));
    CHECK((folder.files("full") == folder.files("single")));
    CHECK((content(echo) == content(folder / "single_echo/echo.tif")));
    refuses(folder, {"scope", echo, "-o", png, "--antenna", other}, 2,
            {"--antenna is points:", "the echo image was swept with points:", "new sweep"});
    refuses(folder, {"scope", echo, "-o", png, "--antenna", "csc2"}, 2, {"--antenna is csc2", "needs a new sweep"});
    refuses(folder, {"scope", echo, "-o", png, "--set", "f111a"}, 2,
            {"set f111a, line ", ": frequency is 16.5GHz", "new sweep"});
    refuses(folder, {"scope", echo, "-o", dish, "--antenna", dish, "--overwrite"}, 2,
            {"output", "antenna", "may not replace"});
    // What agrees does no harm, and what is the receiver's is the set's again.
    folder.make(with({"scope", echo, "--antenna", dish}, outputs(folder, "again")));
    CHECK((folder.files("full") == folder.files("again")));
    fs::remove_all(folder / "again");
    folder.write("mine.ini", "frequency = 9.4GHz\nantenna = dish.csv\nif-gain = 40dB\n");
    folder.make(with({"scope", echo, "--set", mine}, outputs(folder, "again")));
    folder.make(with({"scope", echo, "--if-gain", "40dB"}, outputs(folder, "lower")));
    CHECK((folder.files("lower") == folder.files("again")));
    CHECK((folder.files("lower") != folder.files("full")));
    fs::remove_all(folder / "again");
    fs::remove(dish);
    fs::remove(mine);
    folder.make(with({"scope", echo}, outputs(folder, "again")));
    CHECK((folder.files("full") == folder.files("again")));
}

TEST_CASE("every setting that needs a new sweep is refused, by name and with the reason", "[scope][quick]") {
    const Folder folder;
    const std::string echo = folder / "echo.tif", png = folder / "new.png";
    folder.make(with(with({"simulate"}, quick_riverside), {"--echo", echo, "-q"}));
    const std::string table = "name,gamma10_db;soil,-10";
    // Another value for each; the table says which there are.
    const std::map<std::string, std::string> others = {{"latlon", "33.94,-117.33"}, {"xy", "465000,3755000"},
                                                       {"altitude-msl", "7001ft"},  {"altitude-agl", "2km"},
                                                       {"altitude-hae", "2km"},     {"geoid-offset", "-30m"},
                                                       {"scan-step", "4"},          {"scan-period", "3s"},
                                                       {"range", "4.9km"},          {"range-start", "1km"},
                                                       {"geometry", "grid"},        {"earth", "1.3"},
                                                       {"quality", "fine"},         {"max-error", "0.1dB"},
                                                       {"spokes-per-post", "2"},    {"spoke-lead", "3"},
                                                       {"spokes-per-bin", "7"},     {"refine", "off"},
                                                       {"crossings", "off"},        {"course", "straight"},
                                                       {"detail", "off"},           {"frequency", "16.6GHz"},
                                                       {"transmit-power", "100kW"}, {"gain", "35dB"},
                                                       {"losses", "5dB"},           {"gamma", "-15dB"},
                                                       {"antenna", "cos-csc2"},     {"antenna-knee", "6deg"},
                                                       {"antenna-width", "13deg"},  {"antenna-exponent", "0.6"},
                                                       {"antenna-floor", "-50dB"},  {"tilt", "5deg"},
                                                       {"polarisation", "vv"},      {"backscatter", "oh"},
                                                       {"water", "calm"},           {"sea-state", "2"},
                                                       {"gases", "normal"},         {"rain", "light"},
                                                       {"rain-top", "2km"},         {"cloud", "fog"},
                                                       {"cloud-base", "100m"},      {"cloud-top", "500m"},
                                                       {"class-table", table},      {"wind-direction", "30deg"},
                                                       {"far-shore", "on"},         {"walls", "statistical"}};
    std::set<std::string> tried;
    for (const wedgescope::Key& key : wedgescope::key_table()) {
        if (!(key.commands & wedgescope::command_simulate) || !key.changes_result ||
            (key.commands & wedgescope::command_scope))
            continue;
        INFO(key.name
             << ": of a key that changes the echo this test needs another value, and the table why it needs a sweep");
        REQUIRE(others.contains(key.name));
        CHECK_FALSE(key.needs_sweep.empty());
        refuses(folder, {"scope", echo, "-o", png, "--" + key.name, others.at(key.name)}, 2,
                {"--" + key.name + " is ", key.needs_sweep, "needs a new sweep"});
        tried.insert(key.name);
    }
    CHECK(tried.size() == others.size());
    // What it is already does no harm.
    folder.make(
        {"scope", echo, "-o", png, "--tilt", "0deg", "--range", "5km", "--gain", "34dB", "--quality", "draft", "-q"});
    folder.remove(png);

    const Strings start = {"scope", echo, "-o", png};
    refuses(folder, with(start, {"--display", "gpi-true"}), 2, {"--display is gpi-true", "swept for gpi", "new sweep"});
    refuses(folder, with(start, {"--azimuth-bins", "720"}), 2, {"--azimuth-bins is 720", "has 960", "new sweep"});
    refuses(folder, with(start, {"--range-bin", "20m"}), 2, {"--range-bin is 20m", "18.737", "new sweep"});
    refuses(folder, with(start, {"--beam", "1deg"}), 2,
            {"--beam is 1deg", "1440 azimuth bins", "azimuth-bins 960 keeps them"});
    refuses(folder, with(start, {"--pulse", "0.4us"}), 2, {"--pulse is 0.4us", "range-bin 18.737028625m keeps them"});
    // Wrong values and words are refused as simulate refuses them.
    refuses(folder, with(start, {"--if-gain", "40"}), 2, {"--if-gain is '40'", "dB"});
    refuses(folder, with(start, {"--tilt", "100deg"}), 2, {"--tilt is '100deg'", "from -90deg to 90deg"});
    refuses(folder, with(start, {"--ring-spacing", "20m"}), 2, {"ring-spacing is 20 m", "200 rings"});
    refuses(folder, {"scope", echo, "-o", folder / "new.jpg", "--alpha", "on"}, 2, {"alpha is on", "JPEG", ".png"});
    refuses(folder, with(start, {"--if-gian", "40dB"}), 2, {"did you mean --if-gain?", "wedgescope help scope"});
    refuses(folder, with(start, {"--display", "tdppi", "--sweep-delay", "8km"}), 2,
            {"range is 5000.0 m", "sweep delay"});
    refuses(folder, {"scope", "-o", png}, 2, {"echo image", "none is given"});
    refuses(folder, {"scope", echo}, 2, {"no output"});
    refuses(folder, {"scope", echo, "a.ini", "b.ini", "-o", png}, 2, {"found 3 paths"});
    refuses(folder, with(start, {"--memory", "1MiB"}), 2, {"memory is 1 MiB", "this picture needs at least"});
}

namespace {

/// Every band of every raster of a folder.
std::map<std::string, std::vector<float>> cells(const Folder& folder, const std::string& name) {
    GDALAllRegister();
    std::map<std::string, std::vector<float>> all;
    for (const char* const file : {"scope.png", "power.tif", "states.tif"}) {
        const GDALDatasetUniquePtr raster(GDALDataset::Open((folder / name + "/" + file).c_str()));
        REQUIRE(raster);
        const int width = raster->GetRasterXSize(), height = raster->GetRasterYSize(), bands = raster->GetRasterCount();
        std::vector<float>& values = all[file];
        values.resize(static_cast<std::size_t>(width) * height * bands);
        REQUIRE(raster->RasterIO(GF_Read, 0, 0, width, height, values.data(), width, height, GDT_Float32, bands,
                                 nullptr, 0, 0, 0) == CE_None);
    }
    return all;
}

}  // namespace

TEST_CASE("what is switched off changes no bit, whatever its other keys say", "[scope]") {
    const Folder folder;
    Strings by_the_lake = quick_riverside;
    *(std::find(by_the_lake.begin(), by_the_lake.end(), "--latlon") + 1) = "33.83,-117.42";
    *(std::find(by_the_lake.begin(), by_the_lake.end(), "--altitude-msl") + 1) = "2500ft";
    const std::string points = folder.write("beam.csv", "-30,-40\n0,-3\n5,0\n40,-10\n");
    std::map<std::string, std::map<std::string, std::vector<float>>> made;
    const auto cells_of = [&](const Strings& settings) -> const std::map<std::string, std::vector<float>>& {
        const auto [at, is_new] = made.try_emplace(line_of(settings));
        if (is_new) {
            folder.make(with(with({"simulate", "--overwrite"}, by_the_lake), with(settings, outputs(folder, "off"))));
            at->second = cells(folder, "off");
        }
        return at->second;
    };
    // A value of a key that plays no part with `off`, and does with `on`.
    struct Idle {
        std::string value;
        Strings off, on;
    };
    const Strings file = {"--antenna", points}, one_gamma = {"--gamma", "-15dB"}, by_class = {"--gamma", "off"};
    const std::map<std::string, Idle> idle = {
        {"antenna-knee", {"9deg", file, {"--antenna", "csc2"}}},
        {"antenna-width", {"20deg", file, {"--antenna", "gaussian"}}},
        {"antenna-exponent", {"2", {"--antenna", "csc2"}, {"--antenna", "cos-csc2"}}},
        {"backscatter", {"ulaby-dobson", one_gamma, by_class}},
        {"sea-state", {"5", one_gamma, by_class}},
        {"wind-direction", {"30deg", {"--sea-state", "0"}, {"--sea-state", "4"}}},
        {"rain-top", {"1200m", {"--rain", "clear"}, {"--rain", "heavy"}}},
        {"cloud-base", {"500m", {"--cloud", "none"}, {"--cloud", "2g/m3"}}},
        {"cloud-top", {"1800m", {"--cloud", "none"}, {"--cloud", "2g/m3"}}},
        {"stc-exponent", {"2", {"--stc-range", "off"}, {"--stc-range", "4km"}}},
        {"stc-max", {"6dB", {"--stc-range", "off"}, {"--stc-range", "4km"}}},
        {"bwe-scale", {"3", {"--bwe", "off"}, {"--bwe", "on"}}},
        {"ple-scale", {"3", {"--ple", "off"}, {"--ple", "on"}}},
        {"seed", {"7", {"--noise", "off", "--speckle", "0"}, {"--noise", "off", "--speckle", "1"}}},
        {"sweep-delay", {"2200m", {"--display", "ppi"}, {"--display", "tdppi"}}},
        {"ring-spacing", {"700m", {"--rings", "off"}, {"--rings", "on"}}},
    };
    // What always counts, and what switches.
    const std::set<std::string> always = {"noise-figure",  "bandwidth",     "azimuth-pattern",
                                          "walls",         "frequency",     "transmit-power",
                                          "gain",          "losses",        "pulse",
                                          "polarisation",  "beam",          "antenna",
                                          "antenna-floor", "tilt",          "water",
                                          "gamma",         "gases",         "rain",
                                          "cloud",         "if-gain",       "video-gain",
                                          "stc-range",     "dynamic-range", "mds",
                                          "minimum-range", "display-gamma", "bwe",
                                          "ple",           "noise",         "speckle",
                                          "display",       "size",          "orientation",
                                          "centre",        "rings",         "azimuth-marks",
                                          "pixel-fill",    "far-shore",     "alpha",
                                          "legend"};
    using wedgescope::KeyGroup;
    const std::set walked = {KeyGroup::radar,    KeyGroup::antenna, KeyGroup::ground, KeyGroup::weather,
                             KeyGroup::receiver, KeyGroup::errors,  KeyGroup::display};
    std::size_t tried = 0;
    Strings defaults;
    for (const wedgescope::Key& key : wedgescope::key_table()) {
        if (!(key.commands & wedgescope::command_simulate) || !key.changes_result || key.name == "set") continue;
        if (!walked.contains(key.group)) continue;
        if (!key.fallback.empty() &&
            std::find(quick_riverside.begin(), quick_riverside.end(), "--" + key.name) == quick_riverside.end() &&
            key.name != "size")
            defaults = with(defaults, {"--" + key.name, key.fallback});
        INFO(key.name << ": this test needs to know what switches it off, or that nothing does");
        REQUIRE((idle.contains(key.name) != always.contains(key.name)));
        if (always.contains(key.name)) continue;
        const auto& [value, off, on] = idle.at(key.name);
        const Strings given = {"--" + key.name, value};
        CHECK((cells_of(with(off, given)) == cells_of(off)));
        CHECK_FALSE((cells_of(with(on, given)) == cells_of(on)));
        ++tried;
    }
    CHECK(tried == idle.size());
    // And what is off by default is off: all defaults given, one by one.
    CHECK(defaults.size() > 60);
    CHECK((cells_of(defaults) == cells_of({})));
}

TEST_CASE("a sector's echo is refused for what lies outside, and levels of detail hold beam and pulse", "[scope]") {
    const Folder folder;
    const std::string echo = folder / "echo.tif", png = folder / "new.png";
    const Strings start = {"scope", echo, "-o", png};
    const auto swept = [&](const Strings& more) {
        folder.make(
            with(with({"simulate", "--overwrite"}, with(quick_riverside, bins)), with(more, {"--echo", echo, "-q"})));
    };
    swept({"--heading", "90deg", "--sector", "-30deg,30deg", "--range-start", "2km"});
    refuses(folder, with(start, {"--sector", "-31deg,30deg"}), 2, {"--sector", "makes the beam gather azimuth bins"});
    refuses(folder, with(start, {"--sector", "-60deg,30deg"}), 2,
            {"--sector asks for azimuth bins 80 to 319", "of 960"});
    refuses(folder, with(start, {"--sector", "full"}), 2, {"--sector asks for azimuth bins 0 to 959"});
    refuses(folder, with(start, {"--heading", "140deg"}), 2, {"--heading asks for azimuth bins"});
    refuses(folder, with(start, {"--beam", "1.6deg"}), 2, {"--beam makes the beam gather", "new sweep"});
    refuses(folder, with(start, {"--azimuth-pattern", "uniform"}), 2, {"--azimuth-pattern makes the beam gather"});
    refuses(folder, with(start, {"--bwe-scale", "1.1"}), 2, {"--bwe-scale makes the beam gather", "new sweep"});
    refuses(folder, with(start, {"--ple-scale", "1.5"}), 2,
            {"--ple-scale makes the sweep begin at range bin", "the echo image begins"});
    refuses(folder, with(start, {"--pulse", "0.7us"}), 2, {"--pulse makes the sweep begin at range bin", "new sweep"});
    swept({"--sector", "-30deg,30deg", "--bwe", "off", "--ple", "off", "--range-start", "2km"});
    refuses(folder, with(start, {"--bwe", "on"}), 2, {"--bwe makes the beam gather"});
    refuses(folder, with(start, {"--ple", "on"}), 2, {"--ple makes the sweep begin at range bin"});

    // A pulse of 2 us holds four posts: levels of detail are possible then, and only a sweep can tell.
    folder.make(with({"simulate", "--overwrite", "--dem", data + "/inland_empire_dem.tif", "--latlon", "33.93,-117.33",
                      "--altitude-msl", "7000ft", "--range", "7km", "--echo", echo, "-q"},
                     bins));
    refuses(folder, with(start, {"--pulse", "2us"}), 2,
            {"--pulse is 2us", "finer than beam and pulse", "--detail off"});
    // Where the pulse held them and no level was used, another pulse may use one, a narrower beam none.
    folder.make(with({"simulate", "--overwrite", "--dem", data + "/inland_empire_dem.tif", "--latlon", "33.93,-117.33",
                      "--altitude-msl", "7000ft", "--range", "7km", "--pulse", "1us", "--echo", echo, "--report",
                      folder / "report.json", "-q"},
                     bins));
    const auto report = wedgescope::test::json_in(folder / "report.json");
    for (const auto& level : report["levels"]) CHECK((level["level"] == 0 || level["posts_read"] == 0));
    const Strings one = with(start, {"--pulse", "1us"});
    refuses(folder, with(start, {"--pulse", "0.9us"}), 2, {"--pulse is 0.9us", "finer than beam and pulse"});
    refuses(folder, with(start, {"--pulse", "0.9us", "--beam", "1.4deg"}), 2, {"--pulse is 0.9us"});
    folder.make(with(one, {"--beam", "1.4deg", "--overwrite", "-q"}));
}

TEST_CASE("where levels of detail were swept, beam and pulse are bound to them", "[scope]") {
    const Folder folder;
    // Smooth ground, a post each 2 m: a pulse of 1 us holds 75 of them.
    constexpr int side = 1200;
    std::string heights;
    for (int r = 0; r < side; ++r)
        for (int c = 0; c < side; ++c) {
            const int z = 100 + std::abs(c % 600 - 300) / 4 + std::abs(r % 800 - 400) / 5;
            heights += static_cast<char>(z & 255);
            heights += static_cast<char>(z >> 8);
        }
    folder.write("fine.dat", heights);
    folder.write("fine.hdr",
                 "ENVI\nsamples = 1200\nlines = 1200\nbands = 1\ndata type = 2\ninterleave = bsq\nbyte order = 0\n"
                 "map info = {UTM, 1, 1, 465000, 3750300, 2, 2, 11, North, WGS-84}\n");
    const std::string echo = folder / "echo.tif", png = folder / "new.png";
    const Strings scene = {"--dem",          folder / "fine.dat",
                           "--xy",           "466200,3749100",
                           "--altitude-agl", "500m",
                           "--range",        "1.5km",
                           "--pulse",        "1us",
                           "--beam",         "6deg",
                           "--size",         "100",
                           "--quality",      "draft"};
    folder.make(with(with({"simulate"}, scene), {"--echo", echo, "--report", folder / "run.json", "-q"}));
    REQUIRE(json_in(folder / "run.json")["levels"].size() > 1);
    for (const Strings& setting : {Strings{"--bwe", "off"}, {"--ple", "off"}})
        refuses(folder, with({"scope", echo, "-o", png}, setting), 2,
                {setting[0] + " is off", "--detail off", "new sweep"});
    refuses(folder, {"scope", echo, "-o", png, "--beam", "5deg", "--azimuth-bins", "240"}, 2,
            {"--beam is 5deg", "--detail off"});
    // Drawn smaller than it is, a cell shows ground that a level would leave out; drawn larger no level is coarser.
    for (const Strings& setting : {Strings{"--bwe-scale", "0.5"}, {"--ple-scale", "0.5"}})
        refuses(folder, with({"scope", echo, "-o", png}, setting), 2,
                {setting[0] + " is 0.5", "--detail off", "new sweep"});
    folder.remove(echo);
    same_as_simulate(folder, scene,
                     {{{"--if-gain", "30dB"}},
                      {{"--speckle", "1", "--display", "ppi"}},
                      {{"--bwe-scale", "3", "--ple-scale", "2"}}});
}

TEST_CASE("what is no echo image, or is no longer the one that was written, costs one line", "[scope][quick]") {
    const Folder folder;
    const std::string echo = folder / "echo.tif", png = folder / "new.png", bad = folder / "bad.tif";
    folder.make(with(with({"simulate"}, quick_riverside), with(outputs(folder, "plain"), {"--echo", echo})));
    const auto tried = [&](const std::string& path, const Strings& words) {
        refuses(folder, {"scope", path, "-o", png}, 1, words);
    };
    tried(folder / "nowhere.tif", {"nowhere.tif", "cannot be opened: No such file"});
    tried(folder / "plain", {"plain", "cannot be opened"});
    tried(data + "/inland_empire_dem.tif", {"inland_empire_dem.tif", "holds no SCENE_JSON", "simulate --echo"});
    tried(folder / "plain/power.tif", {"power.tif", "'power'", "simulate --echo"});
    tried(folder / "plain/scope.png", {"scope.png", "'scope'"});
    folder.write("bad.tif", "not a raster");
    tried(bad, {"bad.tif", "cannot be opened"});
    folder.write("bad.tif", content(echo).substr(0, content(echo).size() / 2));
    tried(bad, {"bad.tif", "cannot be read", "Read error", "cut short: simulate again"});
    // Of a format that loses some of it nothing is made.
    for (const char* lossy : {"echo.nc", "echo.xyz", "echo.asc"})
        refuses(folder, with(with({"simulate"}, quick_riverside), {"--echo", folder / lossy}), 2,
                {"echo is '", lossy, "does not give back", "accepted: .tif, .img"});
    // Nor a GeoTIFF packed with loss.
    refuses(folder,
            with(with({"simulate"}, quick_riverside),
                 {"--echo", folder / "lossy.tif", "--co", "COMPRESS=LERC", "--co", "MAX_Z_ERROR=1"}),
            2, {"echo is '", "lossy.tif", "does not give back"});
    {
        std::string bytes = content(echo);
        bytes[bytes.size() / 3] = static_cast<char>(bytes[bytes.size() / 3] ^ 16);
        folder.write("bad.tif", bytes);
    }
    tried(bad, {"bad.tif"});

    GDALAllRegister();
    const auto changed = [&](const auto& change) {
        fs::copy_file(echo, bad, fs::copy_options::overwrite_existing);
        GDALDataset* file = GDALDataset::FromHandle(GDALOpen(bad.c_str(), GA_Update));
        REQUIRE(file);
        change(*file);
        GDALClose(file);
    };
    const auto scene_json = [&](const auto& edit) {
        changed([&](GDALDataset& file) {
            auto json = nlohmann::ordered_json::parse(file.GetMetadataItem("SCENE_JSON"));
            edit(json);
            file.SetMetadataItem("SCENE_JSON", json.dump().c_str());
        });
    };
    scene_json([](auto&) {});
    folder.make({"scope", bad, "-o", png, "-q"});  // the same again does
    CHECK(content(png) == content(folder / "plain/scope.png"));
    folder.remove(png);
    for (const int band : {1, 2}) {
        changed([&](GDALDataset& file) {
            float cell = 0;
            REQUIRE(file.GetRasterBand(band)->RasterIO(GF_Read, 100, 50, 1, 1, &cell, 1, 1, GDT_Float32, 0, 0) ==
                    CE_None);
            cell = cell == 2 ? 1 : 2;
            REQUIRE(file.GetRasterBand(band)->RasterIO(GF_Write, 100, 50, 1, 1, &cell, 1, 1, GDT_Float32, 0, 0) ==
                    CE_None);
        });
        tried(bad, {"bad.tif", "damaged, or was changed", "cells"});
    }
    const std::string deep = "{\"format\": " + std::string(200000, '[') + std::string(200000, ']') + "}";
    for (const std::string& words : {std::string("{\"format\": "), deep}) {
        changed([&](GDALDataset& file) { file.SetMetadataItem("SCENE_JSON", words.c_str()); });
        tried(bad, {"bad.tif", "no JSON object"});
    }
    scene_json([](auto& json) { json["format"] = "wedgescope-scene-2"; });
    tried(bad, {"wedgescope-scene-2", "wedgescope-scene-1"});
    scene_json([](auto& json) { json.erase("format"); });
    tried(bad, {"bad.tif", "format"});
    scene_json([](auto& json) { json["version"] = "0.0.1"; });
    tried(bad, {"wedgescope '0.0.1'", "simulate again"});
    scene_json([](auto& json) { json.erase("echo"); });
    tried(bad, {"another build", "simulate again"});
    scene_json([](auto& json) { json["echo"]["revision"] = 1; });
    tried(bad, {"another build", "simulate again"});
    // The checksum is of the numbers too, also where they go together.
    for (const char* key : {"sensor_height_m", "lat_deg", "x"}) {
        scene_json([&](auto& json) { json["resolved"][key] = json["resolved"][key].template get<double>() + 1e-9; });
        tried(bad, {"damaged, or was changed", "the values of its SCENE_JSON"});
    }
    scene_json([](auto& json) { json["parameters"]["if-gain"] = "49dB"; });
    tried(bad, {"damaged, or was changed", "the values of its SCENE_JSON"});
    scene_json([](auto& json) { json["resolved"].erase("sensor_height_m"); });
    tried(bad, {"resolved.sensor_height_m of its SCENE_JSON is not there"});
    scene_json([](auto& json) { json["resolved"]["x"] = "here"; });
    tried(bad, {"resolved.x of its SCENE_JSON is not a number"});
    scene_json([](auto& json) { json["parameters"]["beam"] = "wide"; });
    tried(bad, {"damaged, or was changed", "beam is 'wide'"});
    // Nor does a file choose what is written.
    scene_json([&](auto& json) { json["parameters"]["power"] = folder / "chosen.tif"; });
    tried(bad, {"parameters.power of its SCENE_JSON is not a parameter of an echo image"});
    CHECK_FALSE(fs::exists(folder / "chosen.tif"));
    scene_json([](auto& json) { json["parameters"]["beam"] = 3; });
    tried(bad, {"bad.tif", "damaged, or was changed", "beam is not a text"});
    scene_json([](auto& json) { json["parameters"].erase("beam"); });
    tried(bad, {"parameters.beam"});
    scene_json([](auto& json) { json["parameters"]["sector"] = "0deg,90deg"; });
    tried(bad, {"damaged, or was changed", "bins"});
    scene_json([](auto& json) {
        for (const char* part : {"shown", "swept"}) json["resolved"][part]["range_bin_end"] = 300;
    });
    tried(bad, {"cells; its SCENE_JSON says 300 x 960"});
    scene_json([](auto& json) { json = nlohmann::ordered_json::array(); });
    tried(bad, {"no JSON object"});
}

TEST_CASE("scope overwrites nothing unasked and leaves nothing half-written", "[scope][quick]") {
    const Folder folder;
    const std::string echo = folder / "echo.tif", png = folder / "scope.png";
    folder.make(with(with({"simulate"}, quick_riverside), {"--echo", echo, "-o", png, "-q"}));
    refuses(folder, {"scope", echo, "-o", png}, 2, {"scope.png", "--overwrite"});
    refuses(folder, {"scope", echo, "-o", echo, "--overwrite"}, 2, {"output", "the echo image", "may not replace"});
    refuses(folder, {"scope", echo, "-o", folder / "a.png", "--power", folder / "a.png"}, 2, {"own file"});
    refuses(folder, {"scope", echo, "-o", folder / "none/a.png"}, 1, {"none"});
    refuses(folder, {"scope", echo, "-o", folder / "a.png", "--power", folder / "b.png"}, 2, {"b.png", "Float32"});
    const std::string before = content(png);
    folder.make({"scope", echo, "-o", png, "--overwrite", "--if-gain", "30dB", "-q"});
    CHECK(content(png) != before);
    folder.make({"scope", echo, "-o", folder / "scope.tif", "--of", "GTiff", "--co", "COMPRESS=LZW", "--config",
                 "GDAL_CACHEMAX=16", "-q"});
    CHECK(fs::file_size(folder / "scope.tif") > 1000);
}

TEST_CASE("a track's frame serves as the echo of its row, a scan's does not", "[scope]") {
    const Folder folder;
    const std::string track = folder.write(
        "track.csv", "time,lat,lon,altitude-msl,heading\n0,33.93,-117.33,2100,30\n1,33.931,-117.331,2101,31\n");
    const Strings moving = {"simulate",
                            "--dem",
                            data + "/inland_empire_dem.tif",
                            "--track",
                            track,
                            "--range",
                            "5km",
                            "--size",
                            "90",
                            "-q",
                            "--orientation",
                            "heading",
                            "--echo",
                            folder / "echo.tif",
                            "--reproducible"};
    folder.make(with(moving, {"-o", folder / "scope.png"}));
    folder.make({"scope", folder / "echo_0002.tif", "-o", folder / "again.png", "--reproducible", "-q"});
    CHECK((content(folder / "again.png") == content(folder / "scope_0002.png")));
    folder.make(with(moving, {"--overwrite", "--scan-step", "60", "--scan-period", "2s"}));
    refuses(folder, {"scope", folder / "echo_0001.tif", "-o", folder / "new.png"}, 2,
            {"scan", "several places", "new sweep"});
}

TEST_CASE("the range bin of an echo image's metadata is its own", "[scope]") {
    const Folder folder;
    const std::string echo = folder / "echo.tif", png = folder / "scope.png";
    folder.make(with(with({"simulate"}, quick_riverside), {"--pulse", "1.2us", "--echo", echo, "-q"}));
    REQUIRE(content(echo).find("<Item name=\"RANGE_STEP_M\">44.9688687</Item>") !=
            std::string::npos);  // of 44.968868699999994
    const Strings start = {"scope", echo, "-q", "-o", png};
    folder.make(with(start, {"--range-bin", "44.9688687m"}));
    refuses(folder, with(start, {"--overwrite", "--range-bin", "44.968868m"}), 2, {"44.968868m", "new sweep"});
}

TEST_CASE("the legend says where the sensor is, and what is black and white", "[scope]") {
    using namespace wedgescope;
    const Folder folder;
    // A helper that keeps what it is told, and draws six pixels.
    const std::string helper = folder / "helper", told = folder / "told.json";
    std::ofstream(helper) << "#!/bin/sh\ncat > '" << told << "'\nprintf 'P5\\n3 2\\n255\\nabcdef'\n";
    fs::permissions(helper, fs::perms::owner_all);
    Settings settings;
    settings.dem = "somewhere/hills.tif";
    ResolvedScene r;
    r.has_lat_lon = r.nadir_on_data = true;
    r.lat_deg = 33.93;
    r.lon_deg = -117.33;
    r.sensor_m = 2133.6;
    r.reference_m = 471;
    r.scene.platform.heading = Angle::degrees(30);
    r.scene.range_m = 18520;
    r.scene.weather.rain_mm_h = 4;
    r.scene.receiver.mds_dbm = -100;
    r.scene.receiver.if_gain = Decibel(84);
    const auto lines = [&](double lat_deg, double lon_deg) {
        r.lat_deg = lat_deg;
        r.lon_deg = lon_deg;
        Picture picture;
        picture.frame.width = 4;
        picture.frame.height = 2;
        picture.grey.assign(8, 7);
        picture.state.assign(8, 2);
        picture.ring_range_m = {3704, 7408};
        add_legend(helper, settings, r, picture);
        CHECK(picture.frame.width == 7);
        CHECK(std::string(picture.grey.begin(), picture.grey.end()) == "\7\7\7\7abc\7\7\7\7def");
        const auto text = json_in(told);
        // Black where the receiver's first grey is: MDS - (IF gain - 64 dB), white 20 dB above.
        CHECK(text["scale"]["black"] == "-120 dBm");
        CHECK(text["scale"]["white"] == "-100 dBm");
        std::map<std::string, std::string> found;
        for (const auto& section : text["sections"])
            for (const auto& line : section["lines"]) found[line[0]] = line[1];
        return found;
    };
    auto found = lines(33.93, -117.33);
    CHECK(found["Latitude"] == "33.9300 N");
    CHECK(found["Longitude"] == "117.3300 W");
    CHECK(found["Altitude MSL"] == "2134 m  7000 ft");
    CHECK(found["Above ground"] == "1663 m  5455 ft");
    CHECK(found["Heading"] == "30 deg");
    CHECK(found["Slant range"] == "10 nmi");
    CHECK(found["Range rings"] == "every 2 nmi");
    CHECK(found["Rain"] == "4 mm/h  to 3000 m");
    CHECK(found["MDS"] == "-100 dBm");
    CHECK(found["Terrain"] == "hills.tif");
    found = lines(-45.5, 170.25);
    CHECK(found["Latitude"] == "45.5000 S");
    CHECK(found["Longitude"] == "170.2500 E");
}
