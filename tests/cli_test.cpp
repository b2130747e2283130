// The built program from outside: exit codes, one line on stderr, files that appear whole or not at all.
#include <catch2/catch.hpp>

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

namespace {

namespace fs = std::filesystem;
using Catch::Matchers::Contains;
using Strings = std::vector<std::string>;

const std::string data = WEDGESCOPE_DATA;
const std::string dem = data + "/inland_empire_dem.tif";

struct Outcome {
    int code = 0;
    std::string out, err;
    std::size_t error_lines() const { return static_cast<std::size_t>(std::count(err.begin(), err.end(), '\n')); }
};

std::string content(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    std::ostringstream all;
    all << in.rdbuf();
    return all.str();
}

/// A folder of its own for each test, gone with it.
class Folder {
public:
    Folder() {
        static int number = 0;
        path_ = fs::temp_directory_path() / ("cli_test_" + std::to_string(::getpid()) + "_" + std::to_string(++number));
        fs::create_directories(path_ / "work");
    }
    ~Folder() { fs::remove_all(path_); }
    fs::path work() const { return path_ / "work"; }
    std::string file(const std::string& name) const { return (work() / name).string(); }
    std::string write(const std::string& name, const std::string& text) const {
        std::ofstream(file(name), std::ios::binary) << text;
        return file(name);
    }
    std::set<std::string> names() const {
        std::set<std::string> all;
        for (const auto& entry : fs::directory_iterator(work())) all.insert(entry.path().filename().string());
        return all;
    }

    /// Starts the program in the work folder; its output goes to files beside it.
    pid_t start(const Strings& arguments, std::string program = WEDGESCOPE_PROGRAM) const {
        std::vector<char*> list{program.data()};
        Strings copy = arguments;
        for (auto& argument : copy) list.push_back(argument.data());
        list.push_back(nullptr);
        const std::string out = (path_ / "out").string(), err = (path_ / "err").string();
        const std::string folder = work().string();
        const pid_t child = ::fork();
        if (child == 0) {
            const int o = ::open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600),
                      e = ::open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
            if (o < 0 || e < 0 || ::dup2(o, 1) < 0 || ::dup2(e, 2) < 0 || ::chdir(folder.c_str()) != 0) ::_exit(99);
            ::execv(program.c_str(), list.data());
            ::_exit(98);
        }
        return child;
    }
    Outcome finish(pid_t child) const {
        int status = 0;
        ::waitpid(child, &status, 0);
        Outcome outcome;
        outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
        outcome.out = content(path_ / "out");
        outcome.err = content(path_ / "err");
        return outcome;
    }
    Outcome run(const Strings& arguments) const { return finish(start(arguments)); }

private:
    fs::path path_;
};

/// An ESRI ASCII grid of 10 x 8 posts, 30 m apart, in UTM zone 11 unless `crs` is off.
std::string grid(const Folder& folder, const std::string& name, const std::string& value, bool crs = true,
                 int columns = 10, int rows = 8, double x = 465000) {
    std::string text = "ncols " + std::to_string(columns) + "\nnrows " + std::to_string(rows) + "\nxllcorner " +
                       std::to_string(x) + "\nyllcorner 3750000\ncellsize 30\nNODATA_value -9999\n";
    for (int r = 0; r < rows; ++r) {
        for (int c = 0; c < columns; ++c) text += value + " ";
        text += "\n";
    }
    if (crs) {
        folder.write(
            name + ".prj",
            R"(PROJCS["WGS_1984_UTM_Zone_11N",GEOGCS["GCS_WGS_1984",DATUM["D_WGS_1984",SPHEROID["WGS_1984",6378137.0,298.257223563]],)"
            R"(PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],)"
            R"(PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",-117.0],PARAMETER["Scale_Factor",0.9996],)"
            R"(PARAMETER["Latitude_Of_Origin",0.0],UNIT["Meter",1.0]])");
    }
    return folder.write(name + ".asc", text);
}

/// An ENVI raster of floats: the format in which any bit pattern can be drawn.
std::string float_raster(const Folder& folder, const std::string& name, int columns, int rows,
                         const std::vector<float>& values) {
    std::string bytes(values.size() * sizeof(float), '\0');
    std::memcpy(bytes.data(), values.data(), bytes.size());
    folder.write(name + ".hdr", "ENVI\nsamples = " + std::to_string(columns) + "\nlines = " + std::to_string(rows) +
                                    "\nbands = 1\ndata type = 4\ninterleave = bsq\nbyte order = 0\n"
                                    "map info = {UTM, 1, 1, 465000, 3750300, 30, 30, 11, North, WGS-84}\n");
    return folder.write(name + ".dat", bytes);
}

Strings with(Strings base, const Strings& more) {
    base.insert(base.end(), more.begin(), more.end());
    return base;
}

/// An ENVI raster of 16-bit heights in scanlines: hills of several hundred metres in every 128 x 128 posts.
std::string scanlines(const Folder& folder, const std::string& name, int edge) {
    std::string bytes;
    bytes.reserve(static_cast<std::size_t>(edge) * static_cast<std::size_t>(edge) * 2);
    for (int r = 0; r < edge; ++r)
        for (int c = 0; c < edge; ++c) {
            const int z = std::abs(c % 120 - 60) * 7 + std::abs(r % 100 - 50) * 5;
            bytes += static_cast<char>(z & 255);
            bytes += static_cast<char>(z >> 8);
        }
    const std::string size = std::to_string(edge);
    folder.write(name + ".hdr", "ENVI\nsamples = " + size + "\nlines = " + size +
                                    "\nbands = 1\ndata type = 2\ninterleave = bsq\nbyte order = 0\n"
                                    "map info = {UTM, 1, 1, 465000, 3750300, 30, 30, 11, North, WGS-84}\n");
    return folder.write(name + ".dat", bytes);
}

/// The program must refuse with `code`, in exactly one line that holds `words`, and leave the folder as it was.
void refuses(const Folder& folder, const Strings& arguments, int code, const Strings& words) {
    std::string line;
    for (const auto& argument : arguments) line += " " + argument;
    INFO("wedgescope" << line);
    const auto before = folder.names();
    const Outcome outcome = folder.run(arguments);
    INFO(outcome.err);
    CHECK(outcome.code == code);
    CHECK(outcome.error_lines() == 1);
    CHECK(outcome.err.substr(0, 12) == "wedgescope: ");
    CHECK(outcome.out.empty());
    for (const auto& word : words) CHECK_THAT(outcome.err, Contains(word));
    CHECK(folder.names() == before);
}

const Strings good = {"simulate", "--dem", dem,      "--latlon", "33.93,-117.33", "--altitude-msl", "7000ft",
                      "--range",  "5km",   "--size", "200"};
const Strings out = {"-o", "scope.png"};

}  // namespace

TEST_CASE("help and version go to stdout", "[cli]") {
    const Folder folder;
    CHECK_THAT(folder.run({"--version"}).out,
               Contains("wedgescope 0.") && Contains("GDAL 3") && Contains("TBB") && Contains("instruction set "));
    for (const Strings& arguments : {Strings{"help"}, {"--help"}, {"-h"}}) {
        const Outcome outcome = folder.run(arguments);
        CHECK(outcome.code == 0);
        CHECK_THAT(outcome.out, Contains("simulate") && Contains("info") && Contains("WEDGESCOPE_TARGET"));
        CHECK(outcome.err.empty());
    }
    for (const Strings& arguments : {Strings{"help", "simulate"}, {"simulate", "--help"}, {"simulate", "-h"}}) {
        const Outcome outcome = folder.run(arguments);
        CHECK(outcome.code == 0);
        CHECK_THAT(outcome.out, Contains("--transmit-power POWER") && Contains("[50kW]") && Contains("nmi"));
        CHECK(outcome.err.empty());
    }
    CHECK_THAT(folder.run({"help", "info"}).out, Contains("--json"));
}

TEST_CASE("a wrong command or option costs one line and exit code 2", "[cli][long]") {
    const Folder folder;
    refuses(folder, {}, 2, {"no command"});
    refuses(folder, {"coverage"}, 2, {"coverage takes two paths"});
    refuses(folder, {"simulat"}, 2, {"did you mean simulate?"});
    refuses(folder, {"--dem", dem}, 2, {"--dem"});
    refuses(folder, {"help", "view"}, 2, {"unknown command 'view'"});
    refuses(folder, with(with(good, out), {"--rang", "5km"}), 2, {"--rang", "did you mean --range?"});
    refuses(folder, with(with(good, out), {"--rain", "on"}), 2, {"--rain"});
    refuses(folder, with(with(good, out), {"--pulse", "2.4"}), 2, {"--pulse is '2.4'", "s, ms, us, ns"});
    refuses(folder, with(with(good, out), {"--pulse", "2.4m"}), 2, {"unknown unit 'm'", "s, ms, us, ns"});
    refuses(folder, with(with(good, out), {"--pulse", "2,4us"}), 2, {"--pulse is '2,4us'"});
    refuses(folder, with(with(good, out), {"--pulse"}), 2, {"--pulse needs a value"});
    refuses(folder, with(with(good, out), {"--gain", "nandB"}), 2, {"--gain"});
    refuses(folder, good, 2, {"no output"});
    refuses(folder, {"info"}, 2, {"path"});
}

TEST_CASE("coverage writes a mask on the raster's own grid, and every layer", "[cli]") {
    const Folder folder;
    const Strings start = {"coverage", dem, "seen.tif", "--latlon", "33.93,-117.33", "--altitude-agl", "300m"};
    const Outcome outcome =
        folder.run(with(start, {"--report", "seen.json", "--timeline", "time.json", "--profile", "--reproducible",
                                "--threads", "5"}));  // more than the machine may have
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    CHECK(outcome.out.empty());
    CHECK_THAT(outcome.err,
               Contains("Mposts/s") && Contains("% of those in range") && Contains("quadrant") && !Contains("TBB"));
    const auto report = nlohmann::json::parse(content(folder.file("seen.json")));
    std::uint64_t posts = 0;
    for (const auto& [name, count] : report["states"].items()) posts += count.get<std::uint64_t>();
    CHECK(posts == 1600 * 1600);
    CHECK(report["scene"]["altitude-agl"] == "300m");
    CHECK(report["threads"] == 5);
    REQUIRE(report["wedges"].size() == 4);
    std::uint64_t read = 0, passed = 0;
    for (const auto& wedge : report["wedges"]) {
        read += wedge["posts_read"].get<std::uint64_t>();
        passed += wedge["posts_passed"].get<std::uint64_t>();
        CHECK(wedge["cpu_total_s"].get<double>() > 0);
    }
    CHECK(report["total"]["posts_read"] == read);
    CHECK(read + passed >= 1600 * 1600);
    std::map<std::string, std::uint64_t> spans;
    const auto timeline = nlohmann::json::parse(content(folder.file("time.json")));
    for (const auto& event : timeline["traceEvents"])
        if (event["ph"] == "X") ++spans[event["name"]];
    CHECK(spans["run"] == report["total"]["runs"]);
    CHECK(spans["load"] <= spans["run"]);
    CHECK(spans["write"] > 0);
    // The same bytes by one thread and in little memory.
    REQUIRE(folder
                .run({"coverage", dem, "again.tif", "--latlon", "33.93,-117.33", "--altitude-agl", "300m",
                      "--reproducible", "--threads", "1", "--memory", "64MiB", "-q"})
                .code == 0);
    CHECK((content(folder.file("again.tif")) == content(folder.file("seen.tif"))));
    for (const char* layer : {"states", "height", "range", "grazing", "depression"}) {
        const Outcome one = folder.run({"coverage", dem, std::string(layer) + ".tif", "--layer", layer, "--xy",
                                        "453717,3740093", "--altitude-msl", "2km", "--range", "8km", "-q"});
        INFO(layer << ": " << one.err);
        CHECK(one.code == 0);
        CHECK(one.err.empty());
        CHECK(folder.names().contains(std::string(layer) + ".tif"));
    }
    refuses(folder, start, 2, {"seen.tif", "--overwrite"});
    refuses(folder, with(start, {"--overwrite", "--report", "seen.tif"}), 2, {"report", "output", "seen.tif"});
    refuses(folder, {"coverage", dem, "x.tif", "--latlon", "33.93,-117.33"}, 2, {"altitude"});
    refuses(folder, {"coverage", dem, "x.png", "--latlon", "33.93,-117.33", "--altitude-agl", "1km"}, 2,
            {"x.png", "whole rasters"});
    refuses(folder, {"coverage", dem, dem, "--latlon", "33.93,-117.33", "--altitude-agl", "1km", "--overwrite"}, 2,
            {"input"});
    refuses(folder,
            {"coverage", dem, "x.tif", "--latlon", "33.93,-117.33", "--altitude-agl", "1km", "--pitch", "5deg,1deg"}, 2,
            {"--pitch", "first one below"});
    refuses(folder,
            {"coverage", dem, "x.tif", "--latlon", "33.93,-117.33", "--altitude-agl", "1km", "--memory", "2MiB"}, 2,
            {"memory is 2 MiB", "at least"});
    const Strings response = {"coverage",       dem,   "x.tif",   "--latlon", "33.93,-117.33",
                              "--altitude-agl", "1km", "--layer", "response"};
    refuses(folder, with(response, {"--target-height", "10m"}), 2, {"--target-height is 10 m", "layer response"});
    refuses(folder, with(response, {"--far-shore", "on"}), 2, {"--far-shore", "simulate's"});
    refuses(folder, with(start, {"--overwrite", "--wind-direction", "10deg"}), 2,
            {"--wind-direction is '10deg'", "--layer response alone"});
    // A mask whose values cannot be told apart, and values of what is no mask.
    const Strings anew = with(start, {"--overwrite"});
    refuses(folder, with(anew, {"--no-data-value", "255"}), 2,
            {"--no-data-value is 255, and so is --seen-value by default; accepted: three values"});
    refuses(folder, with(anew, {"--seen-value", "0"}), 2, {"--seen-value is 0, and so is --hidden-value by default"});
    refuses(folder, with(anew, {"--seen-value", "1", "--no-data-value", "1"}), 2,
            {"--seen-value is 1, and so is --no-data-value;"});
    refuses(folder, with(anew, {"--no-data-value", "9", "--hidden-value", "9"}), 2,
            {"--hidden-value is 9, and so is --no-data-value;"});
    refuses(folder, with(anew, {"--outside-value", "255"}), 2, {"--outside-value is 255, and so is --seen-value"});
    refuses(folder, with(anew, {"--layer", "states", "--seen-value", "255"}), 2,
            {"--seen-value is given, and layer is states; of the layers the mask alone"});
    refuses(folder, with(anew, {"--layer", "height", "-a_nodata", "7"}), 2,
            {"-a_nodata is given, and layer is height"});
    refuses(folder, {"simulate", "--layer", "mask"}, 2, {"--layer"});
    refuses(folder, {"simulate", "--ground-range", "5km"}, 2, {"--ground-range", "coverage's"});
    const std::string scene = folder.write("scene.ini", "dem = x.tif\nground-range = 5km\n");
    refuses(folder, {"simulate", scene, "-o", "scope.png"}, 2, {"line 2", "ground-range", "coverage's"});
}

TEST_CASE("coverage understands gdal_viewshed's options", "[cli][long]") {
    const Folder folder;
    const Strings place = {"-ox", "453717", "-oy", "3740093", "-oz", "100"};
    const auto report_of = [&](const Strings& options) {
        const Outcome outcome = folder.run(
            with({"coverage", dem, "seen.tif", "--overwrite", "--report", "seen.json"}, with(place, options)));
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        return nlohmann::json::parse(content(folder.file("seen.json")));
    };
    const auto plain = report_of({});
    CHECK(plain["scene"]["geometry"] == "grid");
    CHECK(plain["scene"]["altitude-agl"] == "100m");
    CHECK(plain["scene"]["outside-value"] == "0");
    // K R1 = a / cc
    CHECK(std::stod(plain["scene"]["earth"].get<std::string>()) * 0.85714 * 6371008.7714 ==
          Approx(6378137).epsilon(1e-9));
    const auto all =
        report_of({"-tz", "3.5",       "-md", "9000", "-cc", "0",  "-ov",   "9",   "-vv",          "200", "-iv",
                   "100", "-a_nodata", "17",  "-b",   "1",   "-f", "GTiff", "-co", "COMPRESS=LZW", "-om", "NORMAL"});
    CHECK(all["scene"]["target-height"] == "3.5m");
    CHECK(all["scene"]["ground-range"] == "9km");
    CHECK(all["scene"]["range"] == "auto");
    CHECK(all["scene"]["earth"] == "flat");
    CHECK(all["scene"]["outside-value"] == "9");
    CHECK(all["scene"]["seen-value"] == "200");
    CHECK(all["scene"]["hidden-value"] == "100");
    CHECK(all["scene"]["no-data-value"] == "17");
    fs::remove(folder.file("seen.tif"));
    fs::remove(folder.file("seen.json"));
    const Strings run = {"coverage", dem, "x.tif"};
    refuses(folder, with(run, {"-ox", "453717"}), 2, {"-oy is missing"});
    refuses(folder, with(run, {"-ox", "east", "-oy", "3740093"}), 2, {"-ox is 'east'"});
    refuses(folder, with(run, with(place, {"-b", "2"})), 2, {"-b is '2'"});
    refuses(folder, with(run, with(place, {"-om", "DEM"})), 2, {"-om is 'DEM'", "--layer height"});
    refuses(folder, with(run, with(place, {"-vv", "300"})), 2, {"-vv is '300'", "255"});
    refuses(folder, with(run, with(place, {"-oz"})), 2, {"-oz"});
    refuses(folder, {"coverage", data + "/N44W072.hgt", "x.tif", "-ox", "-71.5", "-oy", "44.5"}, 2, {"geodesic"});
}

TEST_CASE("a scene that contradicts itself or says too little is refused", "[cli][long]") {
    const Folder folder;
    const Strings start = {"simulate", "-o", "scope.png", "--dem", dem};
    const Strings place = {"--latlon", "33.93,-117.33"}, height = {"--altitude-msl", "7000ft"};
    refuses(folder, with(with(start, place), with(height, {"--range", "0"})), 2, {"--range", "above 0m"});
    refuses(folder, with(with(start, place), with(height, {"--range", "5km", "--range-start", "6km"})), 2,
            {"range-start"});
    refuses(folder, with(start, height), 2, {"latlon", "xy"});
    refuses(folder, with(with(start, place), with(height, {"--xy", "465000,3750000"})), 2, {"latlon", "xy"});
    refuses(folder, with(start, place), 2, {"altitude-msl"});
    refuses(folder, with(with(start, place), with(height, {"--altitude-agl", "1km"})), 2, {"altitude-agl"});
    refuses(folder, with(with(start, place), {"--altitude-hae", "1km"}), 2, {"geoid-offset"});
    refuses(folder, {"simulate", "-o", "scope.png", "--latlon", "33.93,-117.33", "--altitude-msl", "7000ft"}, 2,
            {"dem"});
    refuses(folder, with(with(start, place), with(height, {"--culture", data + "/inland_empire_culture.tif"})), 2,
            {"culture-legend"});
    const Strings whole = with(with(start, place), height);
    refuses(folder, with(whole, {"--water", "calm", "--sea-state", "3"}), 2,
            {"sea-state is 3", "water calm", "water nrl"});
    refuses(folder, with(whole, {"--water", "calm", "--wind-direction", "10deg"}), 2,
            {"wind-direction is 10 deg", "water calm"});
    refuses(folder, with(whole, {"--gamma", "-15dB", "--far-shore", "on"}), 2, {"far-shore is given with gamma"});
    refuses(folder, with(whole, {"--far-shore", "on", "--frequency", "94GHz"}), 2,
            {"frequency with far-shore is 94 GHz", "at most 40"});
    refuses(folder, with(whole, {"--backscatter", "oh", "--frequency", "35GHz"}), 2, {"backscatter oh: ", "35 GHz"});
    refuses(folder, with(whole, {"--sea-state", "3", "--frequency", "94GHz"}), 2, {"sea-state: ", "94 GHz"});
    refuses(folder, with(whole, {"--water", "calm", "--frequency", "94GHz"}), 2, {"water calm: ", "94 GHz"});
    refuses(folder, with(whole, {"--wind-direction", "361deg"}), 2,
            {"--wind-direction is '361deg'", "from -360deg to 360deg"});
    const std::string twice = folder.write("twice.ini", "range = 5km\nlatlon = 1,2\nxy = 1,2\n");
    refuses(folder, {"simulate", twice, "-o", "scope.png"}, 2, {"line 3", "latlon"});
    const std::string unknown = folder.write("unknown.ini", "dem = x.tif\nfrequenzy = 5GHz\n");
    refuses(folder, {"simulate", unknown, "-o", "scope.png"}, 2, {"line 2", "'frequenzy'", "did you mean frequency?"});
    refuses(folder, {"simulate", "nowhere.ini", "-o", "scope.png"}, 1, {"nowhere.ini"});
    refuses(folder, {"simulate", data + "/inland_empire_culture.tif", "-o", "scope.png"}, 2,
            {"inland_empire_culture.tif' is no text", "key = value"});
}

TEST_CASE("a raster that cannot be used is named", "[cli]") {
    const Folder folder;
    const Strings rest = {"--latlon", "33.93,-117.33", "--altitude-msl", "7000ft", "-o", "scope.png"};
    const auto use = [&](const std::string& path) { return with({"simulate", "--dem", path}, rest); };
    refuses(folder, use("nowhere.tif"), 1, {"nowhere.tif"});
    refuses(folder, use(folder.write("words.tif", "these are words\n")), 1, {"words.tif"});
    refuses(folder, use(folder.write("empty.tif", "")), 1, {"empty.tif"});
    refuses(folder, use(folder.write("cut.tif", content(dem).substr(0, 800000))), 1, {"cut.tif"});
    refuses(folder, {"info", "nowhere.tif"}, 1, {"nowhere.tif"});
    refuses(folder, {"info", folder.file("cut.tif")}, 1, {"cut.tif"});
    refuses(folder, {"info", folder.file("words.tif")}, 1, {"words.tif"});

    const Strings at = {"--xy", "465100,3750100", "--altitude-msl", "500m", "-o", "scope.png"};
    refuses(folder, with({"simulate", "--dem", grid(folder, "one", "5", true, 1, 1)}, at), 1, {"one.asc"});
    const std::string bare = grid(folder, "bare", "5", false);
    refuses(folder, with({"simulate", "--geometry", "geodesic", "--dem", bare}, at), 2,
            {"geometry", "bare.asc", "CRS"});
    refuses(folder,
            with({"simulate", "--dem", bare}, {"--latlon", "33.9,-117.4", "--altitude-msl", "1km", "-o", "scope.png"}),
            2, {"latlon", "bare.asc"});

    std::vector<float> posts(100, 5.0f);
    posts[37] = std::numeric_limits<float>::infinity();
    refuses(folder, with({"simulate", "--dem", float_raster(folder, "infinite", 10, 10, posts)}, at), 1,
            {"infinite.dat", "7", "3"});
    posts[37] = 2e5f;
    refuses(folder, with({"simulate", "--dem", float_raster(folder, "high", 10, 10, posts)}, at), 1,
            {"high.dat", "7", "3"});
    posts.assign(100, std::numeric_limits<float>::quiet_NaN());
    refuses(folder,
            with({"simulate", "--altitude-agl", "1km", "--dem", float_raster(folder, "void", 10, 10, posts)},
                 {"--xy", "465100,3750100", "-o", "scope.png"}),
            2, {"altitude-agl", "void"});
}

TEST_CASE("ground is the response of coverage, from any source, and refused by name", "[cli]") {
    const Folder folder;
    const Strings place = {"--latlon", "33.93,-117.33", "--altitude-msl", "7000ft", "--range", "5km"};
    const Strings radar = {"--rain", "light", "--backscatter", "ulaby-dobson", "--reproducible"};
    const Strings scene = with(with(good, radar), {"--report", "report.json", "--overwrite"});
    const auto same = [&](const char* a, const char* b) { return content(folder.file(a)) == content(folder.file(b)); };
    REQUIRE(folder.run(with(scene, {"-o", "direct.png", "--ground", "direct.tif"})).code == 0);
    const Outcome spilled =
        folder.run(with(scene, {"-o", "spilled.png", "--ground", "spilled.tif", "--source", "spilled"}));
    INFO(spilled.err);
    REQUIRE(spilled.code == 0);
    CHECK(nlohmann::json::parse(content(folder.file("report.json")))["source"]["kind"] == "spilled");
    REQUIRE(
        folder.run(with(with(with({"coverage", dem, "alone.tif", "--layer", "response"}, place), radar), {})).code ==
        0);
    CHECK(same("direct.png", "spilled.png"));
    CHECK(same("direct.tif", "spilled.tif"));
    CHECK(same("direct.tif", "alone.tif"));
    // Without a range the pass finds it, and keeps what the posts need in all directions.
    const Strings wide = {"simulate", "--dem",         dem,           "--latlon", "33.93,-117.33", "--altitude-msl",
                          "7000ft",   "--sector",      "30deg,80deg", "--size",   "200",           "--quality",
                          "draft",    "--reproducible"};
    REQUIRE(folder.run(with(wide, {"--ground", "wide.tif"})).code == 0);
    REQUIRE(folder.run(with(wide, {"--ground", "wide_spilled.tif", "--source", "spilled"})).code == 0);
    CHECK(same("wide.tif", "wide_spilled.tif"));

    folder.write("own.tif", content(dem));
    folder.write("track.csv",
                 "time,lat,lon,altitude-msl [ft],heading\n0,33.93,-117.33,7000,0\n1,33.94,-117.33,7000,0\n");
    const Strings own = with({"simulate", "--dem", "own.tif"}, place);
    refuses(folder, with(own, {"--ground", "own.tif", "--overwrite"}), 2, {"ground", "own.tif", "dem"});
    refuses(folder, with(own, {"-o", "one.tif", "--ground", "./one.tif"}), 2, {"ground", "output", "one.tif"});
    refuses(folder, with(own, {"--ground", "direct.tif"}), 2, {"direct.tif", "--overwrite"});
    refuses(folder, with(own, {"--ground", "nowhere/ground.tif"}), 1, {"nowhere"});
    refuses(folder, with(own, {"--ground", ""}), 2, {"ground", "empty"});
    refuses(folder, with(own, {"--ground", "ground.xyzzy"}), 2, {"ground.xyzzy", "no raster format"});
    refuses(folder, with(own, {"--ground", "ground.png"}), 2, {"ground.png", "Float32"});
    refuses(folder, with(own, {"--ground", "ground.xyz"}), 2, {"ground.xyz", "tile by tile"});
    refuses(folder, with(own, {"--ground", "ground.tif", "--only-wedge", "0", "--work-dir", "work"}), 2,
            {"ground", "only-wedge", "whole scene"});
    const Strings flight = {"simulate",  "--dem", "own.tif",   "--range",  "5km",       "--track",
                            "track.csv", "-o",    "frame.png", "--ground", "ground.tif"};
    refuses(folder, flight, 2, {"ground", "track", "one place"});
    refuses(folder, with(flight, {"--scan-step", "10", "--scan-period", "5s"}), 2, {"ground", "track", "one place"});
    refuses(folder,
            {"coverage", dem, "seen.tif", "--latlon", "33.93,-117.33", "--altitude-msl", "7000ft", "--ground", "g.tif"},
            2, {"ground"});
    // In too little memory, naming what would do.
    refuses(folder, with(own, {"--ground", "ground.tif", "--memory", "2MiB"}), 2, {"memory", "needs at least"});
}

TEST_CASE("culture must lie on the terrain and be known by its legend", "[cli]") {
    const Folder folder;
    const std::string ground = grid(folder, "ground", "5");
    const Strings start = {"simulate", "--dem",   ground, "--xy", "465150,3750120", "--altitude-msl",
                           "500m",     "--range", "1km",  "-o",   "scope.png"};
    const std::string far = grid(folder, "far", "91", true, 10, 8, 600000);
    refuses(folder, with(start, {"--culture", far, "--culture-legend", "fbfm40"}), 1, {"far.asc"});
    const std::string odd = grid(folder, "odd", "77");
    refuses(folder, with(start, {"--culture", odd, "--culture-legend", "fbfm40"}), 1, {"77", "legend"});
    refuses(folder, with(start, {"--culture", odd, "--culture-legend", "nowhere.csv"}), 1, {"nowhere.csv"});
    const std::string legend = folder.write("legend.csv", "code,material\n77,cheese\n");
    refuses(folder, with(start, {"--culture", odd, "--culture-legend", legend}), 2, {"legend.csv", "cheese"});
    folder.write("legend.csv", "code,material\n77,suburban\n");
    CHECK(folder.run(with(start, {"--culture", odd, "--culture-legend", legend})).code == 0);
}

TEST_CASE("the sensor stands above ground, wherever it is", "[cli]") {
    const Folder folder;
    const Strings start = {"simulate", "--dem", dem, "-o", "scope.png", "--size", "200", "--range", "10km"};
    refuses(folder, with(start, {"--latlon", "33.93,-117.33", "--altitude-msl", "100m"}), 2, {"below", "m"});
    refuses(folder, with(start, {"--latlon", "35,-117.33", "--altitude-agl", "100m"}), 2, {"altitude-agl", "outside"});
    const Outcome outside = folder.run(with(start, {"--latlon", "34.04,-117.33", "--altitude-msl", "3km"}));
    CHECK(outside.code == 0);
    CHECK_THAT(outside.err, Contains("outside the terrain raster"));
    CHECK(folder.names().contains("scope.png"));
    // The raster's edge lies half a cell beyond the outermost posts, where there is no terrain: not a void.
    refuses(folder, {"coverage", "--xy", "453732.926,3764090", "--altitude-agl", "30m", dem, "seen.tif"}, 2,
            {"altitude-agl", "row -0.4", "beyond its outermost posts"});
}

TEST_CASE("a sensor a hair inside the outermost posts sees what one upon them sees", "[cli]") {
    const Folder folder;
    std::vector<std::string> seen;
    // Upon the outermost row; 7e-7 and 2e-4 of a post inside.
    for (const char* y : {"3764078.07702085", "3764078.0770", "3764078.071"}) {
        INFO(y);
        const Outcome done = folder.run({"coverage", "--xy", std::string("453732.926,") + y, "--altitude-agl", "30m",
                                         "--range", "5km", dem, std::string(y) + ".tif"});
        INFO(done.err);
        REQUIRE(done.code == 0);
        seen.push_back(done.err.substr(0, done.err.find('\n')));
        CHECK_THAT(seen.back(), Contains("seen: "));
    }
    CHECK(seen[1] == seen[0]);
    CHECK(seen[2] == seen[0]);
}

TEST_CASE("outputs are checked before any work, and nothing half-written stays", "[cli]") {
    const Folder folder;
    refuses(folder, with(good, {"-o", "nowhere/scope.png"}), 1, {"nowhere/scope.png"});
    refuses(folder, with(good, {"-o", "/proc/scope.png"}), 1, {"/proc/scope.png"});
    refuses(folder, with(good, {"-o", "scope.png", "--echo", "./scope.png"}), 2, {"output", "echo", "own file"});
    refuses(folder, with(good, {"-o", folder.work().string()}), 2, {"folder"});
    refuses(folder, with(good, {"-o", "scope.nonsense"}), 2, {"scope.nonsense"});
    refuses(folder, with(good, {"-o", dem, "--overwrite"}), 2, {"dem"});
    folder.write("scope.png", "mine");
    refuses(folder, with(good, out), 2, {"scope.png", "--overwrite"});
    refuses(folder, with(good, {"-o", "other.png", "--report", "scope.png"}), 2, {"scope.png", "--overwrite"});
    CHECK(content(folder.file("scope.png")) == "mine");
    CHECK(folder.run(with(with(good, out), {"--overwrite"})).code == 0);
    CHECK(content(folder.file("scope.png")).substr(1, 3) == "PNG");
    // Values that a format cannot hold: found before the terrain is even opened.
    refuses(folder, {"simulate", "--dem", "nowhere.tif", "--xy", "1,2", "--altitude-msl", "1km", "--echo", "e.png"}, 2,
            {"e.png", "Float32", "PNG"});
    // A folder's other files are nobody's to touch, whatever an output is called.
    folder.write("run", "mine");
    folder.write("run.notes", "mine");
    refuses(folder, with(good, {"-o", "run", "--overwrite"}), 2, {"run", "ending"});
    CHECK(folder.run(with(good, {"--report", "run", "--overwrite"})).code == 0);
    CHECK(content(folder.file("run")).front() == '{');
    CHECK(content(folder.file("run.notes")) == "mine");
    refuses(folder, with(good, {"--power", "p.img", "--states", "p.dat", "--of", "ENVI"}), 2,
            {"p.img", "p.dat", "p.hdr"});
    // Nor are the parts of a mosaic, of mosaics of mosaics neither.
    const std::string part = grid(folder, "part & more", "5");
    const std::string inner = folder.write(
        "inner.vrt",
        R"(<VRTDataset rasterXSize="10" rasterYSize="8"><GeoTransform>465000,30,0,3750240,0,-30</GeoTransform>)"
        R"(<VRTRasterBand dataType="Int16" band="1"><SimpleSource>)"
        R"(<SourceFilename relativeToVRT="1">part &amp; more.asc</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>)");
    const std::string outer = folder.write(
        "outer.vrt",
        R"(<VRTDataset rasterXSize="10" rasterYSize="8"><GeoTransform>465000,30,0,3750240,0,-30</GeoTransform>)"
        R"(<VRTRasterBand dataType="Int16" band="1"><SimpleSource><SourceFilename relativeToVRT="0">)" +
            inner + R"(</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>)");
    const std::string before = content(part);
    for (const std::string& mosaic : {inner, outer})
        refuses(folder,
                {"coverage", "--xy", "465100,3750100", "--altitude-msl", "500m", mosaic, "part & more.asc", "--of",
                 "GTiff", "--overwrite"},
                2, {"part & more.asc", "of which dem", "is made", "may not replace an input"});
    CHECK(content(part) == before);
    // A run that fails late leaves the old output alone.
    folder.write("scope.png", "mine");
    refuses(folder, with(with(good, out), {"--overwrite", "--memory", "64KiB"}), 2, {"memory"});
    // The least that is named does.
    const std::string refused = folder.run(with(with(good, out), {"--overwrite", "--memory", "1MiB"})).err;
    const auto least = refused.find("at least ") + 9;
    REQUIRE(least > 9);
    const std::string mebibytes = refused.substr(least, refused.find(' ', least) - least);
    refuses(folder,
            with(with(good, out), {"--overwrite", "--memory", std::to_string(std::stoi(mebibytes) - 1) + "MiB"}), 2,
            {"memory", mebibytes});
    CHECK(folder.run(with(with(good, {"-o", "least.png"}), {"--memory", mebibytes + "MiB"})).code == 0);
    CHECK(content(folder.file("scope.png")) == "mine");
}

TEST_CASE("what may look like an error of the program is explained", "[cli][long]") {
    const Folder folder;
    const Strings scene{"simulate", "--dem", dem, "--size", "64", "-o", "s.png", "--overwrite"};
    const auto says = [&](const Strings& more, const std::string& what) {
        const Outcome outcome = folder.run(with(scene, more));
        CHECK(outcome.code == 0);
        CHECK_THAT(outcome.err, Contains(what));
    };
    says({"--latlon", "33.8,60", "--altitude-msl", "9km", "--range", "40km"}, "nothing of the terrain lies within");
    says({"--latlon", "33.8,-117.4", "--altitude-msl", "30km", "--range", "60km"}, "if-gain");
    says({"--latlon", "33.8,-117.4", "--altitude-msl", "3km", "--range", "20km", "--azimuth-bins", "60"},
         "wider than half the beam");
    const Strings place{"--latlon", "33.8,-117.4", "--altitude-msl", "3km", "--range", "6km"};
    says(with(place, {"--wind-direction", "30deg"}), "wind-direction has no effect: it is that of waves");
    says(with(place, {"--far-shore", "on"}), "far-shore has no effect: water is told from land by culture");
    says(with(place, {"--sea-state", "3", "--wind-direction", "30deg"}),
         "sea-state and wind-direction have no effect: no ground is of a class of water, by culture or material");
    says(with(place, {"--water", "calm"}), "water has no effect: no ground is of a class of water");
    says(with(place, {"--walls", "statistical"}), "walls statistical has no effect: no class of the ground");
    says(with(place, {"--sea-state", "4", "--backscatter", "oh", "--gamma", "-15dB"}),
         "backscatter and sea-state have no effect: gamma is one for everything");
    says(with(place, {"--class-table", "name,gamma10_db;tress,-14"}), "class-table adds tress, which neither");
    for (const Strings& more : {Strings{"--wind-direction", "30deg", "--sea-state", "2", "--material", "water"},
                                Strings{"--walls", "statistical", "--material", "suburban"},
                                Strings{"--class-table", "name,gamma10_db;Soil,-14"},
                                Strings{"--class-table", "name,gamma10_db;corn,-14", "--material", "corn"}})
        CHECK(folder.run(with(scene, with(place, more))).error_lines() == 2);
    const Outcome usual =
        folder.run(with(scene, {"--latlon", "33.8,-117.4", "--altitude-msl", "3km", "--range", "20km"}));
    CHECK(usual.error_lines() == 2);  // the sensor's place, and what was written
    // The tube is no matter of a run that draws none.
    const Strings layer{"simulate", "--dem", dem, "--power", "p.tif", "--overwrite", "--if-gain", "-100dB"};
    CHECK(folder.run(with(layer, place)).error_lines() == 2);
}

TEST_CASE("a legend is as wide as its text, however small the picture", "[cli]") {
    const Folder folder;
    const Strings scene{
        "simulate", "--dem",  dem,  "--latlon", "33.93,-117.33", "--altitude-msl", "7000ft", "--range",
        "5km",      "--size", "64", "-o",       "s.pgm",         "--of",           "PNM",    "--overwrite",
        "-q"};
    const auto drawn = [&](const Strings& more) {
        const Outcome outcome = folder.run(with(scene, more));
        REQUIRE(outcome.code == 0);
        std::istringstream in(content(folder.file("s.pgm")));
        std::string magic;
        std::size_t width = 0, height = 0, most = 0;
        in >> magic >> width >> height >> most;
        in.get();
        std::string pixels(width * height, '\0');
        in.read(pixels.data(), static_cast<std::streamsize>(pixels.size()));
        REQUIRE(in.gcount() == static_cast<std::streamsize>(pixels.size()));
        return std::tuple(width, height, pixels);
    };
    const auto [width, height, picture] = drawn({});
    const auto [legend_width, legend_height, both] = drawn({"--legend", "on"});
    REQUIRE(legend_width > 150);
    REQUIRE(legend_height > height);
    for (std::size_t row = 0; row < height; ++row) {
        CHECK(both.substr(row * legend_width, width) == picture.substr(row * width, width));
        CHECK(both.substr(row * legend_width + width, legend_width - width) == std::string(legend_width - width, '\0'));
    }
    // It tells of the weather, where there is any.
    const auto height_with = [&](const Strings& weather) {
        return std::get<1>(drawn(with({"--legend", "on"}, weather)));
    };
    CHECK(height_with({"--rain", "clear"}) == legend_height);
    const std::size_t rain = height_with({"--rain", "heavy"});
    CHECK(rain > legend_height);
    CHECK(height_with({"--rain", "heavy", "--gases", "normal", "--cloud", "fog"}) > rain);
}

TEST_CASE("all outputs of one run appear, and the report describes them", "[cli]") {
    const Folder folder;
    const Outcome outcome = folder.run(
        with(good, {"-o", "scope.png", "--echo", "echo.tif", "--power", "power.tif", "--states", "states.tif",
                    "--report", "report.json", "--threads", "2", "--wedges", "3", "--legend", "on", "-q"}));
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    CHECK(outcome.err.empty());
    CHECK(outcome.out.empty());
    for (const char* name : {"scope.png", "echo.tif", "power.tif", "states.tif", "report.json"})
        CHECK(folder.names().contains(name));
    for (const auto& name : folder.names()) CHECK_THAT(name, !Contains("tmp"));
    const auto report = nlohmann::json::parse(content(folder.file("report.json")));
    CHECK(report["format"] == "wedgescope-report-1");
    CHECK(report["wedges"].size() >= 3);
    CHECK(report["threads"] == 2);
    CHECK(report["inputs"][0]["path"] == dem);
    CHECK(report["scene"]["range"] == "5km");
    CHECK(report["peak_rss_bytes"] > 1000000);
    // The states add up to the cells shown.
    std::uint64_t cells = 0;
    for (const auto& [name, count] : report["states"].items()) cells += count.get<std::uint64_t>();
    const auto& shown = report["scene"]["resolved"]["shown"];
    CHECK(cells == (shown["azimuth_bin_end"].get<std::uint64_t>() - shown["azimuth_bin_begin"].get<std::uint64_t>()) *
                       (shown["range_bin_end"].get<std::uint64_t>() - shown["range_bin_begin"].get<std::uint64_t>()));
    // Azimuth bins are covered once each.
    std::int64_t bins = 0;
    for (const auto& wedge : report["wedges"])
        bins += wedge["azimuth_bin_end"].get<std::int64_t>() - wedge["azimuth_bin_begin"].get<std::int64_t>();
    const auto& swept = report["scene"]["resolved"]["swept"];
    CHECK(bins == swept["azimuth_bin_end"].get<std::int64_t>() - swept["azimuth_bin_begin"].get<std::int64_t>());
}

TEST_CASE("reproducible outputs do not depend on wedges and threads", "[cli][threads][long]") {
    const Folder folder;
    std::string first[3];
    for (const auto& [wedges, threads] : {std::pair{"1", "1"}, {"1", "2"}, {"7", "2"}, {"64", "1"}}) {
        const Outcome outcome =
            folder.run(with(good, {"-o", "scope.png", "--echo", "echo.tif", "--states", "states.tif", "--reproducible",
                                   "--overwrite", "--wedges", wedges, "--threads", threads}));
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        const std::string files[3] = {content(folder.file("scope.png")), content(folder.file("echo.tif")),
                                      content(folder.file("states.tif"))};
        for (int i = 0; i < 3; ++i) {
            if (first[i].empty()) first[i] = files[i];
            INFO("file " << i << ", wedges " << wedges << ", threads " << threads);
            CHECK((files[i] == first[i]));
        }
    }
}

TEST_CASE("a scene file works from any folder", "[cli]") {
    const Folder folder;
    fs::create_directories(folder.work() / "scenes");
    fs::copy_file(data + "/lake_sunapee_dem.tif", folder.file("scenes/lake.tif"));
    folder.write("scenes/lake.ini",
                 "dem = lake.tif\nlatlon = 43.38,-72.05\naltitude-agl = 1000m\nsize = 200\noutput = lake.png\n");
    const Outcome outcome = folder.run({"simulate", "scenes/lake.ini"});
    INFO(outcome.err);
    CHECK(outcome.code == 0);
    CHECK(fs::exists(folder.file("scenes/lake.png")));
    const Outcome info = folder.run({"info", "scenes/lake.ini", "--json"});
    REQUIRE(info.code == 0);
    const auto json = nlohmann::json::parse(info.out);
    CHECK(json["files"][0]["kind"] == "scene");
    CHECK(json["files"][0]["scene"]["resolved"]["nadir_on_data"] == true);
    CHECK_THAT(folder.run({"info", "scenes/lake.ini"}).out, Contains("1000.0 m above the terrain"));
}

TEST_CASE("a radar set comes with the program, wherever that lies, and makes what its values make", "[cli][long]") {
    const Folder folder;
    for (const char* page : {"simulate", "scope"})
        CHECK_THAT(folder.run({"help", page}).out,
                   Contains("--set NAME|PATH") && Contains("f111a, ku-mapping, x-navigation"));
    CHECK_THAT(folder.run({"help"}).out, Contains("help sets"));
    const Outcome list = folder.run({"help", "sets"}), one = folder.run({"help", "sets", "f111a"});
    CHECK(list.code == 0);
    CHECK_THAT(list.out, Contains("  f111a ") && Contains("  x-navigation ") && Contains("  ku-mapping "));
    CHECK(one.code == 0);
    CHECK_THAT(one.out, Contains("frequency = 16.5GHz") && Contains("[U/P]"));
    refuses(folder, {"help", "sets", "f111"}, 2,
            {"set is 'f111'", "f111a, ku-mapping, x-navigation", "did you mean f111a?"});
    refuses(folder, {"help", "sets", "f111a", "x"}, 2, {"one set at most"});
    refuses(folder, with(with(good, {"--set", "f11a"}), out), 2, {"--set is 'f11a'", "did you mean f111a?"});

    // What help prints is a set of one's own.
    folder.write("mine.ini", one.out);
    const auto scene = [&](const std::string& set, const std::string& name) {
        const Outcome outcome = folder.run(
            with(good, {"--set", set, "-o", name + ".png", "--report", name + ".json", "--reproducible", "-q"}));
        INFO(outcome.err);
        CHECK(outcome.code == 0);
        return content(folder.file(name + ".png"));
    };
    const std::string shipped = scene("f111a", "a");
    CHECK(shipped.size() > 1000);
    CHECK((scene("mine.ini", "a2") == shipped));
    CHECK((scene("x-navigation", "x") != shipped));
    CHECK((scene("ku-mapping", "k") != shipped));
    const auto report = [&](const char* name) { return nlohmann::json::parse(content(folder.file(name))); };
    CHECK(report("a.json")["scene"]["set"] == "f111a");
    CHECK(report("a.json")["scene"]["antenna-knee"] == "3deg");
    CHECK(report("a.json")["scene"]["pulse"] == "1.2us");
    const nlohmann::json inputs = report("a2.json")["inputs"];
    CHECK(std::any_of(inputs.begin(), inputs.end(), [](const auto& input) { return input["key"] == "set"; }));
    folder.write("scene.ini", "set = x-navigation\ndem = " + dem + "\nlatlon = 33.93,-117.33\naltitude-msl = 7000ft\n");
    CHECK_THAT(folder.run({"info", "scene.ini"}).out, Contains("x-navigation"));

    // Elsewhere, alone.
    fs::copy_file(WEDGESCOPE_PROGRAM, folder.file("moved"));
    CHECK(folder.finish(folder.start({"help", "sets", "f111a"}, folder.file("moved"))).out == one.out);
}

TEST_CASE("an antenna's file is an input as any other, and its points belong to kept wedges", "[cli]") {
    const Folder folder;
    folder.write("dish.csv", "-10,-40\n-3,-3\n3,0\n70,-32.5\n");
    const Strings scene = with(good, {"--antenna", "dish.csv", "-q"});
    refuses(folder, with(scene, {"-o", "dish.csv", "--overwrite"}), 2, {"output", "antenna", "may not replace"});
    const Strings written = {"--work-dir", "work", "--power", "a.tif", "--report", "a.json", "--reproducible"};
    const Outcome first = folder.run(with(scene, written));
    INFO(first.err);
    REQUIRE(first.code == 0);
    const std::string power = content(folder.file("a.tif"));
    const auto report = nlohmann::json::parse(content(folder.file("a.json")));
    CHECK(report["scene"]["antenna"] == "points:-10,-40;-3,-3;3,0;70,-32.5");
    CHECK(std::any_of(report["inputs"].begin(), report["inputs"].end(),
                      [](const auto& input) { return input["key"] == "antenna"; }));
    // The same points elsewhere serve; others do not.
    folder.write("same.csv", "depression_deg,gain_db\n-10,-40\n-3,-3\n3,0\n70,-32.5\n");
    const Outcome again =
        folder.run(with(with(good, {"--antenna", "same.csv", "--resume", "--overwrite", "-q"}), written));
    INFO(again.err);
    CHECK(again.code == 0);
    CHECK((content(folder.file("a.tif")) == power));
    CHECK(nlohmann::json::parse(content(folder.file("a.json")))["reused"] == report["wedges"].size());
    folder.write("dish.csv", "-10,-40\n-3,-3\n3,0\n70,-32.4\n");
    refuses(folder, with(scene, {"--work-dir", "work", "--resume", "--power", "c.tif"}), 2,
            {"work-dir 'work' holds another scene", "antenna", "points of checksum"});
}

TEST_CASE("info counts voids and codes", "[cli]") {
    const Folder folder;
    const Outcome terrain = folder.run({"info", "--json", data + "/worcester_vermont_dem.tif"});
    REQUIRE(terrain.code == 0);
    const auto facts = nlohmann::json::parse(terrain.out)["files"][0];
    CHECK(facts["columns"] == 549);
    CHECK(facts["rows"] == 613);
    CHECK(facts["lowest"] == 201);
    CHECK(facts["highest"] == 1101);
    CHECK(facts["void_posts"].get<double>() / (549 * 613) == Approx(0.32).margin(0.005));
    const Outcome culture =
        folder.run({"info", "--json", "--culture-legend", "nlcd", data + "/lake_sunapee_culture.tif"});
    REQUIRE(culture.code == 0);
    CHECK(nlohmann::json::parse(culture.out)["files"][0]["unknown_cells"] == 0);
    const Outcome wrong = folder.run({"info", "--culture-legend", "fbfm40", data + "/lake_sunapee_culture.tif"});
    CHECK(wrong.code == 0);
    CHECK_THAT(wrong.out, Contains("15 codes, 107 858 cells"));
    const Outcome single = folder.run({"info", grid(folder, "single.asc", "5", true, 1, 1)});
    CHECK(single.code == 0);
    CHECK_THAT(single.out, Contains("no terrain for simulate"));
}

TEST_CASE("the spilled source writes the same files as the direct one, and info says which is chosen",
          "[cli][threads]") {
    const Folder folder;
    fs::create_directory(folder.work() / "spill");
    const Strings outputs{"--echo", "echo.tif", "--states", "states.tif", "--reproducible", "--overwrite"};
    REQUIRE(folder.run(with(good, with(outputs, {"--source", "direct"}))).code == 0);
    const std::string echo = content(folder.work() / "echo.tif"), states = content(folder.work() / "states.tif");
    for (const char* memory : {"40MiB", "1GiB"}) {
        const Outcome outcome = folder.run(with(good, with(outputs, {"--source", "spilled", "--memory", memory,
                                                                     "--temp-dir", "spill", "--report", "run.json"})));
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        CHECK(content(folder.work() / "echo.tif") == echo);
        CHECK(content(folder.work() / "states.tif") == states);
        const auto report = nlohmann::json::parse(content(folder.work() / "run.json"));
        CHECK(report["source"]["kind"] == "spilled");
        CHECK(report["source"]["partition_bytes"] > 0);
        CHECK(fs::is_empty(folder.work() / "spill"));
    }
    // Coverage too, for which all of the raster is needed.
    const Strings cover{"coverage",       dem,    "seen.tif",       "--latlon",    "33.93,-117.33",
                        "--altitude-agl", "300m", "--reproducible", "--overwrite", "-q"};
    REQUIRE(folder.run(with(cover, {"--source", "direct"})).code == 0);
    const std::string seen = content(folder.work() / "seen.tif");
    REQUIRE(folder
                .run(with(cover,
                          {"--source", "spilled", "--memory", "64MiB", "--temp-dir", "spill", "--report", "run.json"}))
                .code == 0);
    CHECK((content(folder.work() / "seen.tif") == seen));
    const auto covered = nlohmann::json::parse(content(folder.work() / "run.json"));
    CHECK(covered["source"]["kind"] == "spilled");
    CHECK(covered["source"]["partition_bytes"] > 0);
    CHECK(fs::is_empty(folder.work() / "spill"));
    const std::string scene = "dem = " + dem + "\nlatlon = 33.9,-117.4\naltitude-msl = 3km\n";
    folder.write("a.ini", scene);
    folder.write("b.ini", scene + "source = spilled\n");
    CHECK_THAT(folder.run({"info", "a.ini"}).out, Contains("direct: ") && Contains("fit into the cache"));
    CHECK_THAT(folder.run({"info", "b.ini"}).out, Contains("spilled: as asked for"));
    CHECK(nlohmann::json::parse(folder.run({"info", "--json", "b.ini"}).out)["files"][0]["source"]["kind"] ==
          "spilled");
}

TEST_CASE("a signal ends the run with 128 + its number and leaves nothing", "[cli]") {
    const Folder folder;
    const Strings arguments = with(good, {"-o", "scope.png", "--echo", "echo.tif", "--range", "40km", "--quality",
                                          "exact", "--azimuth-bins", "8000", "--range-bin", "10m", "--threads", "1"});
    Strings once;  // `good` holds a range already
    for (std::size_t i = 0; i < arguments.size(); ++i) {
        if (arguments[i] == "--range" && arguments[i + 1] == "5km") {
            ++i;
            continue;
        }
        once.push_back(arguments[i]);
    }
    for (const auto& [signal, code] : {std::pair{SIGINT, 130}, {SIGTERM, 143}, {SIGHUP, 129}}) {
        const pid_t child = folder.start(once);
        // At work as soon as its outputs' temporary folders stand.
        for (int i = 0; i < 2000 && folder.names().size() < 2; ++i)
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        REQUIRE(::kill(child, signal) == 0);
        const Outcome outcome = folder.finish(child);
        INFO(outcome.err);
        CHECK(outcome.code == code);
        CHECK(outcome.error_lines() == 1);
        CHECK(folder.names().empty());
    }
}

TEST_CASE("what a killed run leaves is gone after the next one", "[cli]") {
    const Folder folder;
    Strings slow = with(good, {"-o", "scope.png", "--report", "run.json", "--quality", "exact", "--azimuth-bins",
                               "8000", "--range-bin", "10m", "--threads", "1"});
    const pid_t child = folder.start(slow);
    for (int i = 0; i < 2000 && folder.names().size() < 2; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    REQUIRE(::kill(child, SIGKILL) == 0);
    CHECK(folder.finish(child).code == 1000 + SIGKILL);
    CHECK(folder.names().size() == 2);
    CHECK(folder.run(with(good, {"-o", "scope.png", "--report", "run.json"})).code == 0);
    CHECK(folder.names() == std::set<std::string>{"run.json", "scope.png", "scope.png.aux.xml"});
}

TEST_CASE("a signal while a raster is read from end to end ends the run at once", "[cli]") {
    const Folder folder;
    // 7.2 GB of zeros that the disk need not hold: many seconds to read.
    const std::string big = float_raster(folder, "big", 1, 1, {0});
    folder.write("big.hdr",
                 "ENVI\nsamples = 60000\nlines = 60000\nbands = 1\ndata type = 2\ninterleave = bsq\n"
                 "byte order = 0\nmap info = {UTM, 1, 1, 465000, 3750300, 30, 30, 11, North, WGS-84}\n");
    fs::resize_file(big, std::uintmax_t{2} * 60000 * 60000);
    folder.write("scene.ini", "dem = big.dat\nxy = 510000,3705300\naltitude-msl = 9km\nsource = direct\n");
    const auto before = folder.names();
    const auto reads = [&](pid_t child) {
        std::error_code gone;
        for (const auto& entry : fs::directory_iterator("/proc/" + std::to_string(child) + "/fd", gone))
            if (fs::read_symlink(entry.path(), gone).filename() == "big.dat") return true;
        return false;
    };
    const Strings codes{"info", "big.dat", "--culture-legend", "nlcd"};
    const std::vector<std::pair<Strings, int>> cases{{{"info", "big.dat"}, SIGINT},
                                                     {{"info", "big.dat"}, SIGTERM},
                                                     {{"info", "--json", "big.dat"}, SIGHUP},
                                                     {codes, SIGINT},
                                                     {codes, SIGTERM},
                                                     {{"info", "scene.ini"}, SIGINT},
                                                     {{"info", "--plan", "scene.ini"}, SIGTERM},
                                                     {{"simulate", "scene.ini", "--echo", "echo.tif"}, SIGINT}};
    for (const auto& [arguments, signal] : cases) {
        INFO(arguments[0] << " " << arguments[1] << " ended by " << signal);
        const pid_t child = folder.start(arguments);
        for (int i = 0; i < 5000 && !reads(child); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(2));
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        const auto sent = std::chrono::steady_clock::now();
        REQUIRE(::kill(child, signal) == 0);
        const Outcome outcome = folder.finish(child);
        CHECK(std::chrono::steady_clock::now() - sent < std::chrono::seconds(2));
        CHECK(outcome.code == 128 + signal);
        CHECK(outcome.err == "wedgescope: stopped by signal " + std::to_string(signal) + "\n");
        CHECK(outcome.out.empty());
        CHECK(folder.names() == before);
    }
}

TEST_CASE("a raster that changes in any way while it is read ends the run, and no output appears", "[cli][long]") {
    const Folder folder;
    const std::string hills = scanlines(folder, "hills", 4000), raster = content(hills);
    fs::create_directory(folder.work() / "spill");
    const Strings place{"--xy", "510000,3705300", "--altitude-agl", "900m", "--no-cull", "--threads", "1"};
    const Strings spilled{"--source", "spilled", "--temp-dir", "spill", "--memory", "64MiB"};
    const Strings cover = with({"coverage", hills, "seen.tif"}, place);
    const std::vector<Strings> runs{with(cover, {"--source", "direct"}),
                                    with(cover, spilled),
                                    with({"simulate", "--dem", hills, "--echo", "echo.tif", "--range", "60km"},
                                         with(place, {"--source", "direct"})),
                                    {"tile", hills, "store", "--threads", "1", "-q"}};
    struct Change {
        const char* name;
        std::function<void()> make;
    };
    const std::vector<Change> changes{
        {"touched", [&] { fs::last_write_time(hills, fs::file_time_type::clock::now()); }},
        {"written to",
         [&] { std::fstream(hills, std::ios::in | std::ios::out | std::ios::binary).seekp(9000000) << "not this"; }},
        {"replaced", [&] { fs::rename(folder.write("other.dat", raster), hills); }},
        {"removed", [&] { fs::remove(hills); }}};
    // Bytes that the child has read: 16 of the raster's 32 million are more than its libraries and headers make, and what says
    // where the sensor stands.
    const auto has_read = [](pid_t child) {
        std::istringstream io(content("/proc/" + std::to_string(child) + "/io"));
        std::string word;
        std::uint64_t bytes = 0;
        while (io >> word)
            if (word == "rchar:") io >> bytes;
        return bytes;
    };
    for (const Strings& arguments : runs)
        for (const Change& change : changes) {
            INFO(arguments[0] << ", " << change.name);
            folder.write("hills.dat", raster);
            std::this_thread::sleep_for(std::chrono::milliseconds(20));  // a tick of the file system's clock
            const auto before = folder.names();
            const pid_t child = folder.start(arguments);
            for (int i = 0; i < 20000 && has_read(child) < 16'000'000; ++i)
                std::this_thread::sleep_for(std::chrono::microseconds(500));
            REQUIRE(::kill(child, SIGSTOP) == 0);
            change.make();
            REQUIRE(::kill(child, SIGCONT) == 0);
            const Outcome outcome = folder.finish(child);
            INFO(outcome.err);
            CHECK(outcome.code == 1);
            CHECK(outcome.error_lines() == 1);
            CHECK_THAT(outcome.err, Contains("hills.dat"));
            auto after = folder.names();
            after.insert("hills.dat");
            CHECK(after == before);
            CHECK(fs::is_empty(folder.work() / "spill"));
        }
}

TEST_CASE("a plan of a spilled run foretells what the run reads, spills and holds", "[cli][long]") {
    const Folder folder;
    fs::create_directory(folder.work() / "spill");
    // 18 MB, of which the range leaves about three quarters; a quarter of the memory may stay in blocks.
    const Strings scene{"--dem",
                        scanlines(folder, "hills", 3000),
                        "--xy",
                        "510000,3705300",
                        "--altitude-msl",
                        "9km",
                        "--range",
                        "42km",
                        "--no-cull",
                        "--azimuth-bins",
                        "720",
                        "--range-bin",
                        "200m",
                        "--memory",
                        "40MiB",
                        "--source",
                        "spilled",
                        "--temp-dir",
                        "spill",
                        "--threads",
                        "2"};
    const Outcome planned = folder.run(with({"info", "--plan", "--json"}, scene));
    INFO(planned.err);
    REQUIRE(planned.code == 0);
    const auto plan = nlohmann::json::parse(planned.out);
    CHECK(plan["source"]["kind"] == "spilled");
    CHECK_FALSE(plan["likely_cpu_s"] < 0.01);
    CHECK(plan["temporary_disk_bytes"] == plan["bytes_spilled"]);
    CHECK(plan["peak_bytes"] <= 40 << 20);
    CHECK(plan["source_bytes"] < plan["peak_bytes"]);
    const Outcome page = folder.run(with({"info", "--plan"}, scene));
    CHECK_THAT(page.out, Contains("spilled: as asked for; rows of 3000 x 1") && Contains("read once") &&
                             Contains("to a file in temp-dir at the most"));

    const Outcome outcome = folder.run(with({"simulate"}, with(scene, {"--echo", "echo.tif", "--report", "run.json"})));
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    const auto report = nlohmann::json::parse(content(folder.work() / "run.json"));
    const auto near = [](double value, double truth) { return std::abs(value - truth) <= 0.2 * truth; };
    for (const char* what : {"posts", "bytes_read", "peak_bytes", "partition_bytes", "bytes_spilled"}) {
        CAPTURE(what, report["plan"][what].dump());
        const double actual = report["plan"][what]["actual"];
        CHECK(actual > 0);
        CHECK(near(report["plan"][what]["planned"], actual));
    }
    CHECK(report["source"]["spilled_bytes"] > 1 << 20);
    CHECK(report["plan"]["bytes_spilled"]["actual"] == report["source"]["spilled_bytes"]);
    for (const char* what :
         {"wedges", "chunks", "posts", "bytes_read", "partition_bytes", "bytes_spilled", "peak_bytes"}) {
        CAPTURE(what);
        CHECK(plan[what] == report["plan"][what]["planned"]);
    }
    // A direct run spills nothing.
    Strings direct = scene;
    direct[16] = "direct";
    const auto none = nlohmann::json::parse(folder.run(with({"info", "--plan", "--json"}, direct)).out);
    CHECK(none["source"]["kind"] == "direct");
    CHECK(none["bytes_spilled"] == 0);
    CHECK(none["partition_bytes"] == 0);
}

TEST_CASE("a run whose blocks pack smaller than foretold is split as it was foretold", "[cli][long]") {
    const Folder folder;
    fs::create_directory(folder.work() / "spill");
    // Flat ground takes a byte a block; foretold are two bytes a post, which do not stay in a quarter of the memory.
    const std::string flat = scanlines(folder, "flat", 2000);
    folder.write("flat.dat", std::string(std::size_t{2} * 2000 * 2000, '\1'));
    const auto scene = [&](const std::string& memory, const std::string& range_bin, const std::string& wedges) {
        return Strings{"--dem",          flat,      "--xy",        "495000,3720300",
                       "--altitude-msl", "9km",     "--range",     "28km",
                       "--azimuth-bins", "720",     "--range-bin", range_bin,
                       "--threads",      "1",       "--wedges",    wedges,
                       "--size",         "512",     "--memory",    memory,
                       "--source",       "spilled", "--temp-dir",  "spill",
                       "--no-cull"};
    };
    std::set<std::string> larger;
    for (const auto& [memory, range_bin, wedges] : {std::tuple{"20MiB", "20m", "1"}, {"24MiB", "100m", "64"}}) {
        CAPTURE(memory);
        const Outcome planned = folder.run(with({"info", "--plan", "--json"}, scene(memory, range_bin, wedges)));
        INFO(planned.err);
        REQUIRE(planned.code == 0);
        const auto plan = nlohmann::json::parse(planned.out);
        CHECK(plan["bytes_spilled"] > 1 << 20);
        CHECK(plan["wedges"] > 1);
        const Outcome outcome =
            folder.run(with({"simulate", "--echo", "echo.tif", "--report", "run.json", "--overwrite"},
                            scene(memory, range_bin, wedges)));
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        const auto report = nlohmann::json::parse(content(folder.work() / "run.json"));
        for (const char* what :
             {"wedges", "chunks", "posts", "bytes_read", "partition_bytes", "bytes_spilled", "peak_bytes"}) {
            CAPTURE(what, report["plan"][what].dump());
            CHECK(plan[what] == report["plan"][what]["planned"]);
        }
        CHECK(report["plan"]["wedges"]["actual"] == plan["wedges"]);
        CHECK(report["plan"]["bytes_spilled"]["actual"] == 0);
        CHECK(report["plan"]["peak_bytes"]["actual"] <= plan["peak_bytes"]);
        CHECK(plan["peak_bytes"] > plan["source_bytes"]);
        larger.insert(plan["peak_bytes"] > plan["granted_bytes"] ? "pass" : "wedges");
    }
    CHECK(larger.size() == 2);
}

TEST_CASE("timeline and profile of a spilled run show its pass, its spill and its memory from end to end", "[cli]") {
    const Folder folder;
    fs::create_directory(folder.work() / "spill");
    const std::string hills = scanlines(folder, "hills", 3000);
    const Strings common{"--xy",       "510000,3705300", "--altitude-agl", "5km",        "--no-cull",  "--threads",
                         "2",          "--memory",       "64MiB",          "--source",   "spilled",    "--temp-dir",
                         "spill",      "--report",       "report.json",    "--timeline", "trace.json", "--profile",
                         "--overwrite"};
    const std::vector<Strings> runs{with({"simulate", "--dem", hills, "--echo", "echo.tif", "--range", "42km",
                                          "--azimuth-bins", "1440", "--range-bin", "100m"},
                                         common),
                                    with({"coverage", hills, "seen.tif"}, common)};
    for (const Strings& arguments : runs) {
        INFO(arguments[0]);
        const Outcome outcome = folder.run(arguments);
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        const auto report = nlohmann::json::parse(content(folder.work() / "report.json"));
        const auto trace = nlohmann::json::parse(content(folder.work() / "trace.json"));

        // All that came back came back for a wedge or quadrant, but for the few blocks that place the sensor, and those within 640
        // posts that say what stands highest around it.
        const std::uint64_t other_blocks = arguments[0] == "simulate" ? 16 + 11 * 11 : 16;
        std::uint64_t spilled = 0;
        for (const auto& wedge : report["wedges"]) spilled += wedge["bytes_spilled"].get<std::uint64_t>();
        const auto read_back = report["source"]["spill_read_bytes"].get<std::uint64_t>();
        CHECK(report["total"]["bytes_spilled"] == spilled);
        CHECK(spilled > std::uint64_t{1} << 20);
        CHECK(spilled <= read_back);
        CHECK(read_back - spilled <= other_blocks * (std::uint64_t{2} * 128 * 128 + 25));
        CHECK_THAT(outcome.err, Contains("spilled"));
        CHECK_THAT(outcome.err, !Contains("spilled and read again 0"));

        struct Stretch {
            double from, to;
        };
        std::map<std::string, std::uint64_t> bytes;
        std::map<std::string, std::vector<Stretch>> stages;
        std::map<int, std::vector<Stretch>> threads;
        std::vector<std::pair<double, double>> held;  // when, how much
        double end = 0;
        for (const auto& e : trace["traceEvents"]) {
            if (e["ph"] == "C" && e["name"] == "memory") held.emplace_back(e["ts"], e["args"]["budget held"]);
            if (e["ph"] != "X") continue;
            const Stretch s{e["ts"], e["ts"].get<double>() + e["dur"].get<double>()};
            end = std::max(end, s.to);
            threads[e["tid"].get<int>()].push_back(s);
            bytes[e["name"]] += e["args"].value("bytes", std::uint64_t{0});
            stages[e["name"]].push_back(s);
        }
        CHECK(bytes["pass"] == report["source"]["partition_bytes"]);
        CHECK(bytes["pass read"] == bytes["pass"]);
        CHECK(stages["pass pack"].size() == stages["pass read"].size());
        CHECK(bytes["spill write"] + 64 == report["source"]["spilled_bytes"]);  // the header is the file's own
        CHECK(bytes["spill read"] == read_back);
        for (auto& [thread, spans] : threads) {
            std::sort(spans.begin(), spans.end(), [](const Stretch& a, const Stretch& b) {
                return a.from != b.from ? a.from < b.from : a.to > b.to;
            });
            std::vector<Stretch> open;
            bool nests = true;
            constexpr double digits_us = 2e-3;
            for (const Stretch& s : spans) {
                while (!open.empty() && open.back().to <= s.from + digits_us) open.pop_back();
                nests = nests && (open.empty() || s.to <= open.back().to + digits_us);
                open.push_back(s);
            }
            INFO("thread " << thread);
            CHECK(nests);
        }
        const auto most_held = [&](const Stretch& s) {
            double most = -1;
            for (const auto& [at, bytes_held] : held)
                if (at >= s.from && at <= s.to) most = std::max(most, bytes_held);
            return most;
        };
        REQUIRE(stages["pass"].size() == 1);
        CHECK(most_held(stages["pass"][0]) > 1 << 20);
        CHECK(most_held({0, end}) <= 64 << 20);
        CHECK(held.front().first < stages["pass"][0].from);
        CHECK(held.back().first >= end);
        // Wherever a stage is longer than any sampling's silence on a busy machine, memory is known in it.
        for (const auto& [name, spans] : stages)
            for (const Stretch& s : spans) {
                INFO(name);
                if (s.to - s.from > 300e3) CHECK(most_held(s) >= 0);
            }
    }
}

TEST_CASE("a signal during the pass or the wedges of a spilled run leaves nothing in temp-dir", "[cli][threads]") {
    const Folder folder;
    fs::create_directory(folder.work() / "spill");
    const std::string hills = scanlines(folder, "hills", 3000);
    const auto before = folder.names();
    for (const int wait_ms : {0, 20, 60, 120, 250}) {
        const pid_t child =
            folder.start({"simulate",       "--dem",      hills,      "--xy",           "510000,3705300",
                          "--altitude-msl", "9km",        "--range",  "60km",           "--quality",
                          "exact",          "--threads",  "1",        "--azimuth-bins", "720",
                          "--range-bin",    "50m",        "--memory", "40MiB",          "--source",
                          "spilled",        "--temp-dir", "spill",    "--echo",         "echo.tif",
                          "--no-cull"});
        for (int i = 0; i < 2000 && folder.names() == before; ++i)
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        std::this_thread::sleep_for(std::chrono::milliseconds(wait_ms));
        REQUIRE(::kill(child, SIGTERM) == 0);
        const Outcome outcome = folder.finish(child);
        INFO(wait_ms << " ms: " << outcome.err);
        CHECK(outcome.code == 143);
        CHECK_THAT(outcome.err, Contains("stopped by signal 15"));
        CHECK(fs::is_empty(folder.work() / "spill"));
        CHECK(folder.names() == before);
    }
}

TEST_CASE("tile refuses wrong options and rasters in one line, and leaves nothing", "[cli][long]") {
    const Folder folder;
    const std::string a = grid(folder, "a", "5");
    refuses(folder, {"tile"}, 2, {"at least one terrain raster", "0 paths"});
    refuses(folder, {"tile", a}, 2, {"at least one terrain raster", "1 path"});
    refuses(folder, {"tile", a, "store", "--tile-size", "100"}, 2, {"tile-size", "100", "64, 128, 256"});
    refuses(folder, {"tile", a, "store", "--memory", "1MiB"}, 2, {"memory", "1"});
    refuses(folder, {"tile", a, "store", "--co", "TILED=NO"}, 2, {"TILED=NO", "tile-size"});
    refuses(folder, {"tile", a, "store", "--around", "91,0"}, 2, {"around", "LAT,LON", "-90 to 90"});
    refuses(folder, {"tile", a, "store", "--around", "here"}, 2, {"around", "here"});
    refuses(folder, {"tile", a, "store", "--culture-legend", "nlcd"}, 2, {"culture-legend", "no culture"});
    refuses(folder, {"tile", a, "store", "--range", "3km"}, 2, {"range"});
    refuses(folder, {"tile", "none.tif", "store"}, 1, {"none.tif"});
    const std::string row = grid(folder, "row", "5", true, 10, 1);
    refuses(folder, {"tile", row, "store"}, 1, {"dem '" + row + "' has 10 x 1 posts; accepted: at least 2 x 2"});
    fs::create_directory(folder.work() / "mine");
    folder.write("mine/letter.txt", "dear");
    refuses(folder, {"tile", a, "mine"}, 2, {"'mine'", "exists", "--overwrite"});
    refuses(folder, {"tile", a, "mine", "--overwrite"}, 2, {"'mine'", "no tile store"});
    CHECK(content(folder.work() / "mine/letter.txt") == "dear");
    const std::string other = data + "/worcester_vermont_dem.tif";
    refuses(folder, {"tile", dem, other, "store"}, 1, {"worcester_vermont_dem.tif", "gdalwarp -t_srs EPSG:32611"});
}

TEST_CASE("a stopped tile keeps its finished sheets and says how to go on", "[cli]") {
    const Folder folder;
    const std::string hills = scanlines(folder, "hills", 5000);  // four sheets
    const pid_t child = folder.start({"tile", hills, "store", "--threads", "1"});
    for (int i = 0; i < 20000 && !fs::exists(folder.work() / "store.part/dem/c0_r0.sum"); ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    REQUIRE(::kill(child, SIGINT) == 0);
    const Outcome stopped = folder.finish(child);
    INFO(stopped.err);
    REQUIRE(stopped.code == 130);
    CHECK_THAT(stopped.err,
               Contains("stopped by signal 2; finished sheets are kept in 'store.part' (--resume goes on)"));
    const Outcome resumed = folder.run({"tile", hills, "store", "--threads", "1", "--resume"});
    INFO(resumed.err);
    CHECK(resumed.code == 0);
    CHECK_THAT(resumed.err, Contains(" stood already") && !Contains("resumed: 0 sheets"));
    CHECK(folder.names().count("store") == 1);
    CHECK(folder.names().count("store.part") == 0);
}

TEST_CASE("a store tiled around a point serves scenes from there by its kept spill, bit for bit", "[cli][long]") {
    const Folder folder;
    const Outcome tiled = folder.run({"tile", dem, "store", "--culture", data + "/inland_empire_culture.tif",
                                      "--culture-legend", "fbfm40", "--around", "33.93,-117.33"});
    INFO(tiled.err);
    REQUIRE(tiled.code == 0);
    CHECK_THAT(tiled.err, Contains("wedges.spill"));
    CHECK(fs::exists(folder.work() / "store/wedges.spill"));
    const auto simulate = [&](const std::string& place, const Strings& more) {
        return folder.run(with(
            {"simulate", "--dem", "store", "--latlon", place, "--altitude-msl", "7000ft", "--range", "5km", "--echo",
             "echo.tif", "--states", "states.tif", "--report", "run.json", "--reproducible", "--overwrite"},
            more));
    };
    const auto report = [&] { return nlohmann::json::parse(content(folder.work() / "run.json")); };
    const auto pictures = [&] {
        return std::pair(content(folder.work() / "echo.tif"), content(folder.work() / "states.tif"));
    };
    REQUIRE(simulate("33.93,-117.33", {"--source", "direct"}).code == 0);
    CHECK(report()["source"]["kind"] == "direct");
    CHECK(report()["source"]["kept"].is_null());
    const auto direct = pictures();
    const auto layers = nlohmann::json::parse(folder.run({"info", "--json", "store"}).out)["files"][0]["layers"];
    std::uint64_t posts = 0;
    for (const auto& layer : layers)
        posts += layer["columns"].get<std::uint64_t>() * layer["rows"].get<std::uint64_t>();
    // What is read and what is skipped is the data base.
    const auto counted = [&] {
        const auto run = report();
        std::uint64_t sum = run["read"]["posts"];
        for (const auto& cause : run["skipped"]) sum += cause["posts"].get<std::uint64_t>();
        return sum;
    };
    CHECK(layers.size() == 2);
    CHECK(report()["read"]["posts"] > 0);
    CHECK(counted() == posts);
    for (const Strings& source : {Strings{"--source", "spilled"}, Strings{}}) {
        const Outcome outcome = simulate("33.93,-117.33", source);
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        CHECK(report()["source"]["kind"] == "spilled");
        CHECK(report()["source"]["kept"] == "store/wedges.spill");
        CHECK(report()["source"]["partition_bytes"] == 0);
        CHECK(report()["source"]["spilled_bytes"] == 0);
        CHECK(report()["source"]["spill_read_bytes"] > 0);
        CHECK(counted() == posts);
        CHECK(pictures() == direct);
    }
    const Outcome seen = folder.run(
        {"coverage", "store", "seen.tif", "--latlon", "33.93,-117.33", "--altitude-msl", "7000ft", "--range", "5km"});
    INFO(seen.err);
    CHECK(seen.code == 0);
    CHECK_THAT(seen.err, Contains("terrain read from a tile store; sorted for this point in 'store/wedges.spill'\n"));
    CHECK_THAT(seen.err, !Contains("sorted into wedges first"));
    // From elsewhere it is not used, and that is said.
    REQUIRE(simulate("33.95,-117.33", {"--source", "direct"}).code == 0);
    const auto elsewhere = pictures();
    for (const char* source : {"auto", "spilled"}) {
        const Outcome outcome = simulate("33.95,-117.33", {"--source", source});
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        CHECK_THAT(outcome.err, Contains("not used: the kept spill 'store/wedges.spill' was made for column"));
        CHECK(report()["source"]["kept"].is_null());
        CHECK(report()["source"]["kind"] == (source == std::string("auto") ? "direct" : "spilled"));
        CHECK(pictures() == elsewhere);
    }
    const std::string scene = "dem = store\naltitude-msl = 3km\nlatlon = ";
    folder.write("here.ini", scene + "33.93,-117.33\n");
    folder.write("there.ini", scene + "33.95,-117.33\n");
    CHECK_THAT(folder.run({"info", "here.ini"}).out,
               Contains("spilled: a tile store; sorted for this point in 'store/"));
    CHECK_THAT(folder.run({"info", "--plan", "here.ini"}).out, Contains("none: a kept spill is read"));
    CHECK_THAT(folder.run({"info", "there.ini"}).out,
               Contains("direct: a tile store") && Contains("not used: the kept"));
    CHECK_THAT(folder.run({"info", "store"}).out, Contains("kept spill") && Contains("latitude 33.930000"));
    const Outcome whole = folder.run({"info", "--verify", "store"});
    CHECK(whole.code == 0);
    // Damage is named wherever it is.
    const std::string bytes = content(folder.work() / "store/wedges.spill");
    for (const std::size_t at : {std::size_t{70}, bytes.size() / 3, bytes.size() - 5}) {
        std::string changed = bytes;
        changed[at] = static_cast<char>(changed[at] ^ 16);
        folder.write("store/wedges.spill", changed);
        const Outcome found = folder.run({"info", "--verify", "store"});
        INFO(found.err << found.out);
        CHECK(found.code == 1);
        CHECK_THAT(found.out, Contains("the kept spill 'store/wedges.spill' is damaged"));
    }
    const Outcome damaged = simulate("33.93,-117.33", {});
    CHECK(damaged.code == 1);
    CHECK(damaged.error_lines() == 1);
    CHECK_THAT(damaged.err, Contains("'store/wedges.spill' is damaged: its index"));
    // Made anew, for another point: nothing is lost that was damaged.
    const Outcome again = folder.run({"tile", "store", "--around", "33.95,-117.33"});
    INFO(again.err);
    REQUIRE(again.code == 0);
    REQUIRE(simulate("33.95,-117.33", {}).code == 0);
    CHECK(report()["source"]["kept"] == "store/wedges.spill");
    CHECK(pictures() == elsewhere);
    // A whole one for another point is replaced only when that is asked for; one for the same point is made again.
    const std::string whole_one = content(folder.work() / "store/wedges.spill");
    refuses(folder, {"tile", "store", "--around", "33.93,-117.33"}, 2,
            {"'store/wedges.spill'", "latitude 33.950000, longitude -117.330000", "--overwrite"});
    CHECK(content(folder.work() / "store/wedges.spill") == whole_one);
    CHECK(folder.run({"tile", "store", "--around", "33.950001,-117.33"}).code == 0);
    CHECK(folder.run({"tile", "store", "--around", "33.93,-117.33", "--overwrite"}).code == 0);
    REQUIRE(simulate("33.93,-117.33", {}).code == 0);
    CHECK(report()["source"]["kept"] == "store/wedges.spill");
    CHECK(pictures() == direct);
    // A store is no raster to make another of.
    refuses(folder, {"tile", "store", "other"}, 2, {"'store' is a tile store", "'store/dem.vrt'"});
    refuses(folder, {"tile", dem, "other", "--culture", "store", "--culture-legend", "fbfm40"}, 2,
            {"'store' is a tile store", "'store/culture.vrt'"});
}

TEST_CASE("an output without a name is refused before any work", "[cli][long]") {
    const Folder folder;
    const std::string ground = grid(folder, "ground", "5");
    refuses(folder, {"tile", ground, ""}, 2, {"output has an empty name", "folder"});
    refuses(folder, {"tile", ground, "", "--overwrite"}, 2, {"output has an empty name"});
    refuses(folder, {"tile", ground, "", "--resume"}, 2, {"output has an empty name"});
    refuses(folder, {"coverage", ground, "", "--xy", "465100,3750100", "--altitude-agl", "1km"}, 2,
            {"output has an empty name"});
    for (const char* key : {"--output", "--echo", "--power", "--states", "--report", "--timeline", "--work-dir"}) {
        refuses(folder, with(good, {key, ""}), 2, {key, "is empty"});
        refuses(folder, with(good, {std::string(key) + "= "}), 2, {key, "is empty"});
    }
}

TEST_CASE("tile works from inside a store", "[cli]") {
    const Folder folder;
    const std::string ground = grid(folder, "ground", "5");
    REQUIRE(folder.run({"tile", ground, "st", "-q"}).code == 0);
    for (const auto& entry : fs::directory_iterator(folder.work() / "st"))
        fs::rename(entry, folder.work() / entry.path().filename());
    REQUIRE(folder.names().contains("manifest.json"));
    const Outcome outcome = folder.run({"tile", ground, "new"});
    INFO(outcome.err);
    CHECK(outcome.code == 0);
    CHECK_THAT(outcome.err, Contains(" in 1 sheet, "));
    CHECK_THAT(folder.run({"info", "new"}).out, Contains(" 1 tile of ") && Contains(" in 1 sheet, "));
    CHECK(folder.names().contains("new"));
    // The store that the current folder is has a name, too.
    refuses(folder, {"tile", ".", "other"}, 2, {"'.' is a tile store"});
}

TEST_CASE("a mask is packed without loss, or not at all", "[cli]") {
    const Folder folder;
    const Strings mask{"coverage", "--latlon", "33.8,-117.4", "--altitude-msl", "1km", dem, "m.tif", "--overwrite"};
    refuses(folder, with(mask, {"--co", "COMPRESS=JPEG"}), 2,
            {"m.tif' holds codes", "GTiff with these creation options"});
    refuses(folder, with(mask, {"--co", "NBITS=1"}), 2, {"m.tif' holds codes"});
    CHECK(folder.run(with(mask, {"--co", "COMPRESS=DEFLATE"})).code == 0);
    CHECK(folder.run(with(mask, {"--co", "NBITS=2", "--seen-value", "3"})).code == 0);
}

TEST_CASE("coverage of nothing but voids says so, and so does a picture", "[cli]") {
    const Folder folder;
    const std::string hole =
        float_raster(folder, "hole", 40, 40, std::vector<float>(1600, std::numeric_limits<float>::quiet_NaN()));
    CHECK_THAT(folder
                   .run({"simulate", "--dem", hole, "--xy", "465500,3750000", "--altitude-msl", "1km", "--range", "2km",
                         "--size", "64", "-o", "s.png"})
                   .err,
               Contains("nothing of the terrain lies within the range of 2 km and the sector, or all of it is void"));
    std::ofstream(folder.file("places.csv")) << "x,y,altitude\n465500,3750000,1000\n";
    for (const Strings& place :
         {Strings{"--xy", "465500,3750000", "--altitude-msl", "1km"}, {"--observers", "places.csv"}}) {
        const Strings words = with({"coverage", hole, "seen.tif", "--overwrite"}, place);
        const Outcome said = folder.run(words), quiet = folder.run(with(words, {"-q"}));
        INFO(said.err << quiet.err);
        CHECK(said.code == 0);
        CHECK_THAT(said.err, Contains("hole.dat': no post in view holds a height"));
        CHECK(quiet.code == 0);
        CHECK(quiet.err.empty());
    }
    // A place in the sea beside the data, and one of its posts.
    std::vector<float> posts(1600, std::numeric_limits<float>::quiet_NaN());
    posts[820] = 7;
    const std::string rock = float_raster(folder, "rock", 40, 40, posts);
    const Outcome outcome =
        folder.run({"coverage", rock, "rock.tif", "--xy", "465500,3750000", "--altitude-msl", "1km", "-q"});
    CHECK(outcome.code == 0);
    CHECK(outcome.err.empty());
}

TEST_CASE("a kept ground map is used as long as it fits, and changes no byte", "[cli][long]") {
    const Folder folder;
    fs::copy_file(dem, folder.file("dem.tif"));
    const Strings seen{"coverage", "dem.tif", "--altitude-agl", "300m", "--latlon", "33.95,-117.35", "--reproducible"};
    const auto with = [](Strings words, const Strings& more) {
        words.insert(words.end(), more.begin(), more.end());
        return words;
    };
    const Strings scene{"simulate",      "--dem",   "dem.tif", "--altitude-agl", "300m", "--latlon",
                        "33.95,-117.35", "--range", "9km",     "--material",     "soil", "--reproducible"};
    REQUIRE(folder.run(with(seen, {"plain.tif"})).code == 0);
    REQUIRE(folder.run(with(scene, {"-o", "p_plain.png"})).code == 0);
    CHECK(folder.names().count("dem.tif.ground") == 0);
    const Outcome kept = folder.run(with(seen, {"kept.tif", "--keep-map"}));
    INFO(kept.err);
    REQUIRE(kept.code == 0);
    CHECK(folder.names() == std::set<std::string>{"dem.tif", "dem.tif.ground", "plain.tif", "kept.tif", "p_plain.png",
                                                  "p_plain.png.aux.xml"});
    REQUIRE(folder.run(with(seen, {"again.tif", "--report", "again.json"})).code == 0);
    CHECK(content(folder.file("plain.tif")) == content(folder.file("kept.tif")));
    CHECK(content(folder.file("plain.tif")) == content(folder.file("again.tif")));
    // What stays hidden is known without reading it.
    const auto report = nlohmann::json::parse(content(folder.file("again.json")));
    CHECK(report.at("skipped").at("hidden").at("tiles").get<int>() > 0);
    REQUIRE(folder.run(with(scene, {"-o", "p_kept.png"})).code == 0);
    CHECK(content(folder.file("p_plain.png")) == content(folder.file("p_kept.png")));

    SECTION("of a raster that has changed") {
        fs::last_write_time(folder.file("dem.tif"), fs::file_time_type::clock::now() + std::chrono::hours(1));
    }
    SECTION("damaged") {
        std::fstream file(folder.file("dem.tif.ground"), std::ios::binary | std::ios::in | std::ios::out);
        file.seekp(40);
        file.put('x');
    }
    SECTION("cut") { fs::resize_file(folder.file("dem.tif.ground"), 5000); }
    const Outcome other = folder.run(with(seen, {"other.tif"}));
    INFO(other.err);
    CHECK(other.code == 0);
    CHECK(content(folder.file("plain.tif")) == content(folder.file("other.tif")));
    CHECK_THAT(other.err, Contains("not used: the ground map 'dem.tif.ground'"));
    const Outcome anew = folder.run(with(seen, {"anew.tif", "--keep-map"}));
    CHECK(anew.code == 0);
    CHECK_THAT(anew.err, !Contains("not used"));
    CHECK_THAT(folder.run(with(seen, {"last.tif"})).err, !Contains("not used"));
}

TEST_CASE("a ground map to be kept replaces one that is no good, but no other file", "[cli]") {
    const Folder folder;
    const std::string plain = float_raster(folder, "plain", 40, 40, std::vector<float>(1600, 7.0F)),
                      map = folder.file(plain + ".ground");
    const auto see = [&](const std::string& output, const Strings& more) {
        Strings words{"coverage", plain, output, "--xy", "465500,3750000", "--altitude-msl", "1km", "-q"};
        words.insert(words.end(), more.begin(), more.end());
        return folder.run(words);
    };
    const auto write = [&](const std::string& bytes) { std::ofstream(map, std::ios::binary) << bytes; };
    write("my notes\n");
    const Outcome refused = see("a.tif", {"--keep-map"});
    INFO(refused.err);
    CHECK(refused.code == 2);
    CHECK(refused.error_lines() == 1);
    CHECK_THAT(refused.err,
               Contains(plain + ".ground' is a file of 9 bytes that is no ground map; move it away, or add"));
    CHECK(content(map) == "my notes\n");
    CHECK(folder.names().count("a.tif") == 0);
    // Nor is it read.
    const Outcome unread = see("b.tif", {});
    CHECK(unread.code == 0);
    CHECK(see("a.tif", {"--keep-map", "--overwrite"}).code == 0);
    const std::string good = content(map);
    REQUIRE(good.size() > 1000);
    for (const std::string& bytes : {std::string(), good.substr(0, 9), good.substr(0, 900)}) {
        write(bytes);
        CHECK(see("cut" + std::to_string(bytes.size()) + ".tif", {"--keep-map"}).code == 0);
        CHECK((content(map) == good));
    }
    // A page of the map, behind both headers.
    std::string damaged = good;
    damaged[128 + 64 + 5] ^= 1;
    write(damaged);
    const Strings scene{"simulate",       "--dem", plain,     "--xy", "465500,3750000",
                        "--altitude-msl", "1km",   "--range", "1km",  "-q"};
    const Outcome met = folder.run(with(scene, {"-o", "c.png"}));
    INFO(met.err);
    CHECK(met.code == 1);
    CHECK_THAT(met.err, Contains(".ground'") && Contains("is damaged; remove that file, or let keep-map make it anew"));
    CHECK(folder.run(with(scene, {"-o", "c.png", "--keep-map"})).code == 0);
    CHECK((content(map) == good));
}

TEST_CASE("a ground map that cannot be kept is an error in one line", "[cli]") {
    const Folder folder;
    fs::copy_file(dem, folder.file("dem.tif"));
    fs::create_directory(folder.file("dem.tif.ground"));
    const Outcome o = folder.run(
        {"coverage", "dem.tif", "out.tif", "--altitude-agl", "300m", "--latlon", "33.95,-117.35", "--keep-map"});
    INFO(o.err);
    CHECK(o.code != 0);
    CHECK(o.error_lines() == 1);
    CHECK_THAT(o.err, Contains("dem.tif.ground"));
    CHECK(folder.names() == std::set<std::string>{"dem.tif", "dem.tif.ground"});
}
