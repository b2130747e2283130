// The built program as a user meets it, for the sources of cli_test: a folder in which it runs, what came of it, small
// rasters to give it, and the shape of every refusal.
#pragma once
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "tests/file_content.hpp"
#include "tests/words.hpp"

namespace wedgescope::test::cli {

namespace fs = std::filesystem;
using Strings = std::vector<std::string>;

inline const std::string data = WEDGESCOPE_DATA;
inline const std::string dem = data + "/inland_empire_dem.tif";

struct Outcome {
    int code = 0;
    std::string out, err;
    std::size_t error_lines() const { return static_cast<std::size_t>(std::count(err.begin(), err.end(), '\n')); }
};

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
inline std::string grid(const Folder& folder, const std::string& name, const std::string& value, bool crs = true,
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

/// The header of an ENVI raster of 30 m in UTM zone 11; `type` is ENVI's number of what a post is.
inline void envi_header(const Folder& folder, const std::string& name, int columns, int rows, int type) {
    folder.write(name + ".hdr", "ENVI\nsamples = " + std::to_string(columns) + "\nlines = " + std::to_string(rows) +
                                    "\nbands = 1\ndata type = " + std::to_string(type) +
                                    "\ninterleave = bsq\nbyte order = 0\n"
                                    "map info = {UTM, 1, 1, 465000, 3750300, 30, 30, 11, North, WGS-84}\n");
}

/// An ENVI raster of floats: the format in which any bit pattern can be drawn.
inline std::string float_raster(const Folder& folder, const std::string& name, int columns, int rows,
                                const std::vector<float>& values) {
    std::string bytes(values.size() * sizeof(float), '\0');
    std::memcpy(bytes.data(), values.data(), bytes.size());
    envi_header(folder, name, columns, rows, 4);
    return folder.write(name + ".dat", bytes);
}

/// An ENVI raster of 16-bit heights in scanlines: hills of several hundred metres in every 128 x 128 posts.
inline std::string scanlines(const Folder& folder, const std::string& name, int edge) {
    std::string bytes;
    bytes.reserve(static_cast<std::size_t>(edge) * static_cast<std::size_t>(edge) * 2);
    for (int r = 0; r < edge; ++r)
        for (int c = 0; c < edge; ++c) {
            const int z = std::abs(c % 120 - 60) * 7 + std::abs(r % 100 - 50) * 5;
            bytes += static_cast<char>(z & 255);
            bytes += static_cast<char>(z >> 8);
        }
    envi_header(folder, name, edge, edge, 2);
    return folder.write(name + ".dat", bytes);
}

/// The program must refuse with `code`, in exactly one line that holds `words`, and leave the folder as it was.
inline void refuses(const Folder& folder, const Strings& arguments, int code, const Strings& words) {
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
    for (const auto& word : words) CHECK_THAT(outcome.err, Catch::Contains(word));
    CHECK(folder.names() == before);
}

/// Until `done`, looking again after each `pause`; no longer than `most`.
template <class Done>
void wait_until(std::chrono::microseconds pause, Done&& done, std::chrono::seconds most = std::chrono::seconds(10)) {
    for (auto looks = most / pause; looks > 0 && !done(); --looks) std::this_thread::sleep_for(pause);
}

inline const Strings good = {"simulate", "--dem", dem,      "--latlon", "33.93,-117.33", "--altitude-msl", "7000ft",
                             "--range",  "5km",   "--size", "200"};
inline const Strings out = {"-o", "scope.png"};

}  // namespace wedgescope::test::cli
