// Tracks for the sources of track_test: tables of rows, a scene and a data base to fly over, the program on its way along
// one, and the images that it leaves.
#pragma once
#include <signal.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "lib/track.hpp"
#include "tests/bare_scene.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/file_content.hpp"
#include "tests/program.hpp"
#include "tests/terrain.hpp"
#include "tests/words.hpp"
#include "tools/track_file.hpp"

namespace wedgescope::test {

inline const std::string program = WEDGESCOPE_PROGRAM;

/// A track from the text of its table.
inline Track read(const std::string& content) {
    std::istringstream in(content);
    return track_from("t.csv", in, {Angle::degrees(7)});
}

/// The bare set over a plane: what comes back from one place lands in one cell.
inline Scene plane_scene(double x, double y) {
    Scene s = bare_scene(x, y, 800, 9000);
    s.earth_k.reset();
    s.azimuth_bins = 720;
    s.range_bin_m = 25;
    s.gamma = Decibel(-15);
    s.refine = true;
    return s;
}

/// Hills with a wood and a few classes, in metres.
inline void draw_data(const Folder& folder, int posts = 160) {
    const auto hills = rolling(220, 60, 3);
    Drawing d;
    d.columns = d.rows = posts;
    d.geotransform = std::array<double, 6>{465000, 40, 0, 3755000, 0, -40};
    d.type = GDT_Int16;
    d.value = [&](int c, int r) { return std::round(300 + hills(c, r)); };
    draw(folder / "dem.tif", d);
    d.type = GDT_Byte;
    d.value = [](int c, int r) { return (c / 5 + r / 7) % 4 + 1; };
    draw(folder / "codes.tif", d);
    d.value = [](int c, int r) { return c % 23 < 6 && r % 19 < 9 ? 12 : 0; };
    draw(folder / "wood.tif", d);
    std::ofstream(folder / "legend.csv") << "1,soil\n2,trees\n3,urban\n4,grass\n";
    std::ofstream(folder / "scene.ini")
        << "dem = dem.tif\nculture = codes.tif\nculture-legend = legend.csv\nculture-height = wood.tif\n"
           "range = 4km\nrange-bin = 40m\nazimuth-bins = 480\nsize = 200\nnoise = on\nspeckle = 2\n"
           "reproducible = on\nquiet = on\nquality = draft\n";  // only bits are compared
}

struct Row {
    std::string time, x, y, altitude, heading;
};
inline const std::vector<Row> rows = {{"0", "468200", "3752000", "900", "0"},
                                      {"2.5", "468410.5", "3751950", "950", "77.5"},
                                      {"5", "467000", "3752900", "1000", "200"},
                                      {"6", "468200", "3751000", "1200", "-30"}};

/// The first of these rows so many times, a second apart.
inline std::vector<Row> standing(std::size_t count) {
    std::vector<Row> all(count, rows[0]);
    for (std::size_t i = 0; i < count; ++i) all[i].time = std::to_string(i);
    return all;
}

inline void write_track(const Folder& folder, const std::vector<Row>& all = rows) {
    std::ofstream out(folder / "track.csv");
    out << "time,x,y,altitude-msl,heading\n";
    for (const Row& r : all) out << r.time << ',' << r.x << ',' << r.y << ',' << r.altitude << ',' << r.heading << '\n';
}

inline Ended simulate(const Folder& folder, const std::vector<std::string>& arguments) {
    return run_program(with({program, "simulate", folder / "scene.ini"}, arguments), folder / "log");
}

/// What the program says of what it must refuse, in one line.
inline std::string refused_by_program(const Folder& folder, const std::vector<std::string>& arguments) {
    const Ended ended = simulate(folder, arguments);
    CHECK(ended.code == 2);
    CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
    return ended.err;
}

/// A track on two threads, and what is done to it when its fifth picture is there.
template <class Do>
Ended when_five_stand(const Folder& folder, Do&& act, const std::vector<std::string>& more = {}) {
    const pid_t child = start(with({program, "simulate", folder / "scene.ini", "--track", folder / "track.csv", "-o",
                                    folder / "s.png", "--threads", "2"},
                                   more),
                              folder / "log");
    const auto ended = [child] {
        siginfo_t state{};
        return ::waitid(P_PID, static_cast<id_t>(child), &state, WEXITED | WNOHANG | WNOWAIT) != 0 || state.si_pid != 0;
    };
    for (int i = 0; i < 12000 && !ended() && !std::filesystem::exists(folder / "s_0005.png"); ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    act(child);
    return wait_for(child, folder / "log");
}
inline Ended struck(const Folder& folder, int signal, const std::vector<std::string>& more = {}) {
    return when_five_stand(
        folder, [&](pid_t child) { ::kill(child, signal); }, more);
}

/// A raster's bands as GDAL reads them.
class Bands {
public:
    explicit Bands(const std::string& path) {
        GDALAllRegister();
        in_ = static_cast<GDALDataset*>(GDALOpen(path.c_str(), GA_ReadOnly));
        REQUIRE(in_);
    }
    ~Bands() { GDALClose(in_); }
    Bands(const Bands&) = delete;
    Bands& operator=(const Bands&) = delete;

    GDALDataset& raster() { return *in_; }
    GDALRasterBand& band(std::size_t number) { return *in_->GetRasterBand(static_cast<int>(number)); }
    std::size_t count() { return static_cast<std::size_t>(in_->GetRasterCount()); }
    std::vector<float> cells(std::size_t number) {
        const int columns = in_->GetRasterXSize(), lines = in_->GetRasterYSize();
        std::vector<float> values(static_cast<std::size_t>(columns) * static_cast<std::size_t>(lines));
        CHECK(band(number).RasterIO(GF_Read, 0, 0, columns, lines, values.data(), columns, lines, GDT_Float32, 0, 0,
                                    nullptr) == CE_None);
        return values;
    }
    /// Its cells as they are stored: NaN and -0 too.
    std::vector<std::uint32_t> bits(std::size_t number) {
        const std::vector<float> values = cells(number);
        std::vector<std::uint32_t> out(values.size());
        std::memcpy(out.data(), values.data(), 4 * values.size());
        return out;
    }
    static std::map<std::string, std::string> metadata(GDALMajorObject& object) {
        std::map<std::string, std::string> found;
        for (char** item = object.GetMetadata(); item && *item; ++item) {
            const std::string words = *item;
            found[words.substr(0, words.find('='))] = words.substr(words.find('=') + 1);
        }
        return found;
    }

private:
    GDALDataset* in_ = nullptr;
};

}  // namespace wedgescope::test
