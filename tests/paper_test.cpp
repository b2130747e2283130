// What the 1979 paper (Faintich, Digital Sensor Simulation) says of its pictures, as numbers on a shipped scene; docs/paper.md
// quotes what this prints (paper_test -s shows it). Receiver formulas are written out here again, from physics 2.2 and 2.4.
#include <catch2/catch.hpp>

#include <gdal_priv.h>
#include <gdal_utils.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>

#include "tests/program.hpp"
#include "tests/words.hpp"

namespace {

using wedgescope::test::with;

namespace fs = std::filesystem;
using Strings = std::vector<std::string>;

const std::string data = WEDGESCOPE_DATA;

class Folder {
public:
    Folder() : path_(fs::temp_directory_path() / ("paper_test_" + std::to_string(::getpid()))) {
        fs::create_directories(path_);
    }
    ~Folder() { fs::remove_all(path_); }
    std::string operator/(const std::string& name) const { return (path_ / name).string(); }
    void make(const Strings& arguments) const {
        const auto ended = wedgescope::test::run_program(
            with({WEDGESCOPE_PROGRAM}, with(arguments, {"-q", "--overwrite"})), *this / "err");
        INFO(arguments.front() << ": " << ended.err);
        REQUIRE(ended.code == 0);
    }

private:
    fs::path path_;
};

struct Raster {
    int width = 0, height = 0;
    std::vector<float> value;  ///< height x width
    std::map<std::string, double> number;
    std::array<double, 6> to_xy{};

    float at(int column, int row) const { return value[static_cast<std::size_t>(row) * width + column]; }
};

Raster read(const std::string& path, int band = 1) {
    GDALAllRegister();
    const GDALDatasetUniquePtr file(GDALDataset::Open(path.c_str()));
    INFO(path);
    REQUIRE(file);
    Raster raster;
    raster.width = file->GetRasterXSize();
    raster.height = file->GetRasterYSize();
    raster.value.resize(static_cast<std::size_t>(raster.width) * static_cast<std::size_t>(raster.height));
    REQUIRE(file->GetRasterBand(band)->RasterIO(GF_Read, 0, 0, raster.width, raster.height, raster.value.data(),
                                                raster.width, raster.height, GDT_Float32, 0, 0) == CE_None);
    file->GetGeoTransform(raster.to_xy.data());
    for (const char* key : {"AZIMUTH_START_DEG", "AZIMUTH_STEP_DEG", "RANGE_START_M", "RANGE_STEP_M", "SENSOR_X",
                            "SENSOR_Y", "SENSOR_HEIGHT_M", "REFERENCE_HEIGHT_M"})
        if (const char* text = file->GetMetadataItem(key)) raster.number[key] = std::atof(text);
    return raster;
}

/// v_if of physics 2.4 for watts, with the scene's 1.2 us, 8 dB and auto bandwidth.
double if_level(double power_w, double if_gain_db) {
    const double mds_w = 1.380649e-23 * 290 * (1.2 / 1.2e-6) * std::pow(10, 0.8);
    return std::clamp((10 * std::log10(power_w / mds_w) + if_gain_db - 64) / 20, 0.0, 1.0);
}
double grey(double power_w, double if_gain_db) {
    return power_w > 0 ? std::floor(255 * if_level(power_w, if_gain_db) + 0.5) : 0;
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
    double n = static_cast<double>(a.size()), x = 0, y = 0, xx = 0, yy = 0, xy = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        x += a[i], y += b[i], xx += a[i] * a[i], yy += b[i] * b[i], xy += a[i] * b[i];
    }
    return (xy / n - x / n * y / n) / std::sqrt((xx / n - x / n * x / n) * (yy / n - y / n * y / n));
}

/// The set of docs/scenes/f111a_sector90.ini, over Riverside at 7000 ft.
const Strings radar = {"--frequency", "16.5GHz", "--transmit-power", "50kW", "--gain",         "34dB",
                       "--losses",    "6dB",     "--noise-figure",   "8dB",  "--pulse",        "1.2us",
                       "--beam",      "1.5deg",  "--antenna",        "csc2", "--antenna-knee", "3deg"};
const Strings place = {"--dem",          data + "/inland_empire_dem.tif",
                       "--geometry",     "grid",
                       "--latlon",       "33.93,-117.33",
                       "--altitude-msl", "7000ft",
                       "--heading",      "225deg"};
const Strings ahead =
    with({"simulate"},
         with(with(radar, place), {"--culture", data + "/inland_empire_culture.tif", "--culture-legend", "fbfm40",
                                   "--culture-height", data + "/inland_empire_canopy.tif", "--culture-height-scale",
                                   "0.1", "--sector", "-45deg,45deg", "--range", "22nmi"}));

constexpr float seen = 2;

/// Echo and what is seen of one sweep.
struct Swept {
    Raster echo, state, power;
    double range_m(int column) const {
        return power.number.at("RANGE_START_M") + (column + 0.5) * power.number.at("RANGE_STEP_M");
    }
};
Swept sweep(const Folder& folder, const std::string& name, const Strings& more) {
    const std::string echo = folder / (name + ".tif"), states = folder / "states.tif", power = folder / "power.tif";
    Strings all;  // an option of both is that of `more`
    for (std::size_t i = 0; i < ahead.size(); ++i) {
        if (ahead[i].starts_with("--") && std::find(more.begin(), more.end(), ahead[i]) != more.end())
            ++i;
        else
            all.push_back(ahead[i]);
    }
    folder.make(with(all, with(more, {"--echo", echo, "--power", power, "--states", states})));
    return {read(echo), read(states), read(power)};
}

/// Mean loss in dB of the echoes of one sweep against another's, over ranges from, to.
double loss_db(const Swept& clear, const Swept& wet, double from_m, double to_m) {
    double sum_clear = 0, sum_wet = 0;
    const double first = clear.echo.number.at("RANGE_START_M"), step = clear.echo.number.at("RANGE_STEP_M");
    for (int column = 0; column < clear.echo.width; ++column) {
        const double r = first + (column + 0.5) * step;
        if (r < from_m || r >= to_m) continue;
        for (int row = 0; row < clear.echo.height; ++row) {
            sum_clear += clear.echo.at(column, row);
            sum_wet += wet.echo.at(column, row);
        }
    }
    return 10 * std::log10(sum_clear / sum_wet);
}

/// Correlation of two grey scenes: with the same IF gain, and with the one that serves best.
struct Fit {
    double same_gain = 0, best = -1;
    int gain_db = 0;
};

double share_not_black(const Swept& scene, double if_gain_db) {
    double all = 0, lit = 0;
    for (std::size_t i = 0; i < scene.power.value.size(); ++i)
        if (scene.state.value[i] == seen) {
            ++all;
            if (grey(scene.power.value[i], if_gain_db) > 0) ++lit;
        }
    return lit / all;
}

}  // namespace

TEST_CASE("IF gain decides what shows, video gain how bright it is", "[paper]") {
    const Folder folder;
    const Swept scene = sweep(folder, "echo", {"--antenna-width", "6deg"});
    double before = 0;
    for (const auto& [gain, printed] : {std::pair{34, 6.5}, {36, 17.5}, {38, 41}, {40, 60}, {42, 76}, {44, 87}}) {
        const double share = share_not_black(scene, gain);
        std::printf("IF gain %d dB: %.1f %% of seen cells are not black\n", gain, 100 * share);
        CHECK(share > before);
        CHECK(100 * share == Approx(printed).margin(0.55));
        before = share;
    }
    CHECK(share_not_black(scene, 34) <= 0.10);
    CHECK(share_not_black(scene, 44) > 0.5);

    // Video gain on the pictures: x 10^(12/20) at the most, so what rounds to black at 4 dB is at most grey 2 at 16 dB.
    std::vector<float> dark;
    std::size_t saturated_before = 0;
    for (const auto& [gain, printed] : {std::pair{4, 0.0}, {7, 0}, {10, 0.65}, {13, 7.5}, {16, 22}}) {
        folder.make({"scope", folder / "echo.tif", "--if-gain", "40dB", "--video-gain", std::to_string(gain) + "dB",
                     "--rings", "off", "--size", "500", "-o", folder / "scope.png"});
        const Raster picture = read(folder / "scope.png");
        if (dark.empty()) dark = picture.value;
        std::size_t lit = 0, saturated = 0, shown = 0;
        float brightest_of_black = 0;
        for (std::size_t i = 0; i < dark.size(); ++i) {
            if (dark[i] == 0) brightest_of_black = std::max(brightest_of_black, picture.value[i]);
            if (dark[i] > 0) ++lit;
            if (picture.value[i] == 255) ++saturated;
            if (picture.value[i] > 2) ++shown;
        }
        std::printf(
            "IF gain 40 dB, video gain %2d dB: %.2f %% of the pixels lit at 4 dB are saturated; brightest of the "
            "others %g\n",
            gain, 100.0 * static_cast<double>(saturated) / static_cast<double>(lit),
            static_cast<double>(brightest_of_black));
        CHECK(brightest_of_black <= 2);
        CHECK(shown <= lit);
        CHECK(saturated >= saturated_before);
        CHECK(100.0 * static_cast<double>(saturated) / static_cast<double>(lit) ==
              Approx(printed).margin(std::max(0.005, 0.025 * printed)));
        saturated_before = saturated;
    }
    CHECK(saturated_before > dark.size() / 1000);
}

namespace {

/// gdalwarp.
void warp(const std::string& from, const std::string& to, Strings words) {
    GDALAllRegister();
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    pointers.push_back(nullptr);
    GDALWarpAppOptions* const options = GDALWarpAppOptionsNew(pointers.data(), nullptr);
    REQUIRE(options);
    GDALDatasetH source = GDALOpen(from.c_str(), GA_ReadOnly);
    REQUIRE(source);
    GDALDatasetH made = GDALWarp(to.c_str(), nullptr, 1, &source, options, nullptr);
    CHECK(made);
    GDALClose(made);
    GDALClose(source);
    GDALWarpAppOptionsFree(options);
}

}  // namespace

TEST_CASE("a thinner data base shows as much at a low gain, if heights and classes stay together", "[paper]") {
    // Posts 400 ft apart in height steps of 25 ft, as the gallery's.
    const Folder folder;
    const Strings to_400_ft = {"-tr", "121.92", "121.92", "-overwrite", "-q"};
    const std::string dem = folder / "thin_dem.tif", culture = folder / "thin_culture.tif",
                      canopy = folder / "thin_canopy.tif";
    warp(data + "/inland_empire_dem.tif", dem, with(to_400_ft, {"-r", "average", "-ot", "Float32"}));
    {
        const GDALDatasetUniquePtr file(GDALDataset::Open(dem.c_str(), GDAL_OF_UPDATE | GDAL_OF_RASTER));
        REQUIRE(file);
        GDALRasterBand* const band = file->GetRasterBand(1);
        std::vector<float> line(static_cast<std::size_t>(band->GetXSize()));
        for (int row = 0; row < band->GetYSize(); ++row) {
            REQUIRE(band->RasterIO(GF_Read, 0, row, band->GetXSize(), 1, line.data(), band->GetXSize(), 1, GDT_Float32,
                                   0, 0) == CE_None);
            for (float& height : line) height = 7.62F * std::round(height / 7.62F);
            REQUIRE(band->RasterIO(GF_Write, 0, row, band->GetXSize(), 1, line.data(), band->GetXSize(), 1, GDT_Float32,
                                   0, 0) == CE_None);
        }
    }
    warp(data + "/inland_empire_culture.tif", culture, with(to_400_ft, {"-r", "near"}));
    for (const auto& [way, printed] : {std::pair{"near", 7.0}, {"average", 17}}) {
        warp(data + "/inland_empire_canopy.tif", canopy, with(to_400_ft, {"-r", way}));
        const double share = share_not_black(
            sweep(folder, "thin",
                  {"--antenna-width", "6deg", "--dem", dem, "--culture", culture, "--culture-height", canopy}),
            34);
        std::printf("400 ft posts, canopy by %s: %.1f %% of seen cells are not black at 34 dB\n", way, 100 * share);
        CHECK(100 * share == Approx(printed).margin(printed < 10 ? 0.055 : 0.55));
    }
}

namespace {

/// How alike the scenes of two tilts are, at the gain that makes them most so.
Fit best_gain(const Swept& level, const Swept& tilted, int tilt, double from_m, double to_m) {
    Fit fit;
    for (int gain = 30; gain <= 70; ++gain) {
        std::vector<double> a, b;
        for (int column = 0; column < level.power.width; ++column) {
            if (level.range_m(column) < from_m || level.range_m(column) >= to_m) continue;
            for (int row = 0; row < level.power.height; row += 3)
                if (level.state.at(column, row) == seen) {
                    a.push_back(grey(level.power.at(column, row), 42));
                    b.push_back(grey(tilted.power.at(column, row), gain));
                }
        }
        const double c = correlation(a, b);
        if (gain == 42) fit.same_gain = c;
        if (c > fit.best) fit.best = c, fit.gain_db = gain;
    }
    std::printf("tilt %d deg, %g to %g km: correlation with tilt 0 at 42 dB: %.3f at 42 dB, best %.3f at %d dB\n", tilt,
                from_m / 1000, to_m / 1000, fit.same_gain, fit.best, fit.gain_db);
    return fit;
}

}  // namespace

TEST_CASE("gain makes up for the tilt of a wide beam", "[paper]") {
    const Folder folder;
    const Strings fan = {"--antenna", "gaussian", "--antenna-knee", "10deg", "--antenna-width", "40deg"};
    const Swept level = sweep(folder, "tilt", with(fan, {"--tilt", "0deg"}));
    for (const int tilt : {5, 10}) {
        const Fit whole =
            best_gain(level, sweep(folder, "tilt", with(fan, {"--tilt", std::to_string(tilt) + "deg"})), tilt, 0, 41e3);
        CHECK(whole.gain_db == (tilt == 5 ? 43 : 45));
        CHECK(whole.best > whole.same_gain);
        CHECK(whole.best == Approx(tilt == 5 ? 0.995 : 0.984).margin(0.0006));
        if (tilt == 10) CHECK(whole.same_gain == Approx(0.971).margin(0.0006));
    }
}

TEST_CASE("of a shaped beam gain makes up for a degree of tilt, and for some of five or ten", "[paper]") {
    const Folder folder;
    std::map<int, Swept> by_tilt;
    for (const int tilt : {0, 1, 2, 5, 10})
        by_tilt[tilt] = sweep(folder, "tilt", {"--antenna-width", "12deg", "--tilt", std::to_string(tilt) + "deg"});
    const Swept& level = by_tilt[0];
    double before = 1;
    for (const int tilt : {1, 2, 5, 10}) {
        const Fit far = best_gain(level, by_tilt[tilt], tilt, 24e3, 28e3),
                  whole = best_gain(level, by_tilt[tilt], tilt, 0, 41e3);
        CHECK(whole.best < before);
        before = whole.best;
        CHECK(whole.best == Approx(tilt == 1 ? 0.89 : tilt == 2 ? 0.69 : tilt == 5 ? 0.31 : 0.23).margin(0.006));
        if (tilt == 1) CHECK(whole.gain_db == 41);
        if (tilt == 5) CHECK(whole.same_gain == Approx(0.22).margin(0.006));
        if (tilt >= 5) CHECK(whole.gain_db == (tilt == 5 ? 55 : 70));
        if (tilt >= 5)
            for (const auto& band : {far, whole}) {
                CHECK(band.gain_db > 42);  // the beam has left the far ground
                CHECK(band.best > band.same_gain);
            }
    }
}

TEST_CASE("gases matter at long range only, rain anywhere", "[paper]") {
    const Folder folder;
    const Strings set = {"--antenna-width", "6deg", "--polarisation", "circular"};
    const Swept clear = sweep(folder, "clear", set);
    for (const std::string gases : {"normal", "high"}) {
        const Swept air = sweep(folder, "air", with(set, {"--gases", gases}));
        const double near = loss_db(clear, air, 2e3, 8e3), far = loss_db(clear, air, 28e3, 40e3);
        std::printf("gases %s: %.2f dB at 2 to 8 km, %.2f dB at 28 to 40 km\n", gases.c_str(), near, far);
        CHECK(near == Approx(gases == "normal" ? 0.2 : 0.5).margin(0.055));
        CHECK(far == Approx(gases == "normal" ? 1.3 : 2.8).margin(0.055));
    }
    double before = share_not_black(clear, 44);
    std::printf("rain clear: %.1f %% of seen cells not black at 44 dB\n", 100 * before);
    CHECK(100 * before == Approx(71).margin(0.55));
    struct Printed {
        std::string rain;
        double loss_db, margin_db, share;  ///< at 20 km (excessive: 10); per cent
    };
    for (const auto& [rain, printed_db, margin_db, printed_share] : {Printed{"drizzle", 0.6, 0.055, 69},
                                                                     {"light", 2.4, 0.055, 60},
                                                                     {"moderate", 10, 0.55, 26},
                                                                     {"heavy", 45, 0.55, 20},
                                                                     {"excessive", 60, 0.55, 11}}) {
        const Swept wet = sweep(folder, "wet", with(set, {"--rain", rain}));
        // The whole path lies below the rain's top, so decibels grow as range does.
        const double near = loss_db(clear, wet, 9.9e3, 10.1e3), far = loss_db(clear, wet, 19.8e3, 20.2e3);
        const double share = share_not_black(wet, 44);
        std::printf("rain %s: %.2f dB at 10 km, %.2f dB at 20 km; %.1f %% of seen cells not black at 44 dB\n",
                    rain.c_str(), near, far, 100 * share);
        CHECK(near == Approx(2 * loss_db(clear, wet, 4.95e3, 5.05e3)).epsilon(0.02));
        if (rain != "drizzle") CHECK(share < before);
        before = share;
        CHECK((rain == "excessive" ? near : far) == Approx(printed_db).margin(margin_db));
        CHECK(100 * share == Approx(printed_share).margin(0.55));
    }
}

TEST_CASE("a lake is black until its waves are high", "[paper]") {
    const Folder folder;
    const Raster culture = read(data + "/inland_empire_culture.tif"), ground = read(data + "/inland_empire_dem.tif");
    const auto all_water = [&](int column, int row, int margin) {
        for (int y = row - margin; y <= row + margin; ++y)
            for (int x = column - margin; x <= column + margin; ++x)
                if (x < 0 || y < 0 || x >= culture.width || y >= culture.height || culture.at(x, y) != 98) return false;
        return true;
    };
    double before_db = -300, plain_shore_db = 0;
    std::vector<double> plain_behind_w;  // cells of the far shore as they are by themselves
    for (const auto& [state, far_shore] : {std::pair{0, "off"}, {0, "on"}, {1, "off"}, {3, "off"}, {6, "off"}}) {
        const Swept scene = sweep(
            folder, "sea", {"--antenna-width", "6deg", "--sea-state", std::to_string(state), "--far-shore", far_shore});
        const bool bright = std::string(far_shore) == "on";
        const auto& n = scene.power.number;
        double water = 0, water_w = 0, black = 0, black_at_52 = 0, land = 0, land_w = 0;
        // Land within 600 m before and behind the lake, along the ray.
        double near_shore_w = 0, near_shore = 0, far_shore_w = 0, behind_cells = 0;
        std::vector<double> behind_w;
        for (int row = 0; row < scene.power.height; ++row) {
            int first_water = -1, last_water = -1;
            for (int column = 0; column < scene.power.width; ++column) {
                if (scene.state.at(column, row) != seen) continue;
                const double azimuth =
                    (n.at("AZIMUTH_START_DEG") + (row + 0.5) * n.at("AZIMUTH_STEP_DEG")) * std::numbers::pi / 180;
                const double r = scene.range_m(column);
                if (r < 8e3 || r > 20e3) continue;
                // Ground position, at the height found there; the second step is exact to metres on gentle ground.
                double height_m = n.at("REFERENCE_HEIGHT_M");
                int x = 0, y = 0;
                for (int step = 0; step < 2; ++step) {
                    const double above = n.at("SENSOR_HEIGHT_M") - height_m, s = std::sqrt(r * r - above * above);
                    x = static_cast<int>((n.at("SENSOR_X") + s * std::sin(azimuth) - ground.to_xy[0]) / 30);
                    y = static_cast<int>((ground.to_xy[3] - n.at("SENSOR_Y") - s * std::cos(azimuth)) / 30);
                    if (x < 0 || y < 0 || x >= ground.width || y >= ground.height) break;
                    height_m = ground.at(x, y);
                }
                if (x < 0 || y < 0 || x >= ground.width || y >= ground.height) continue;
                const double power_w = scene.power.at(column, row);
                // 450 m from the shore the beam's skirt has left it.
                if (all_water(x, y, 15)) {
                    if (first_water < 0) first_water = column;
                    last_water = column;
                    ++water, water_w += power_w, black += grey(power_w, 44) == 0, black_at_52 += grey(power_w, 52) == 0;
                } else if (culture.at(x, y) != 98) {
                    ++land, land_w += power_w;
                }
            }
            if (first_water < 0) continue;
            // The inner lake ends 450 m, ten bins, before each shore.
            const int shore = static_cast<int>(450 / n.at("RANGE_STEP_M")),
                      width = static_cast<int>(600 / n.at("RANGE_STEP_M"));
            for (int i = shore; i < shore + width; ++i) {
                if (const int before = first_water - i; before >= 0 && scene.state.at(before, row) == seen)
                    ++near_shore, near_shore_w += scene.power.at(before, row);
                if (const int behind = last_water + i;
                    behind < scene.power.width && scene.state.at(behind, row) == seen)
                    ++behind_cells, far_shore_w += scene.power.at(behind, row),
                        behind_w.push_back(scene.power.at(behind, row));
            }
        }
        if (state == 0) {
            const double shore_db = 10 * std::log10(far_shore_w / behind_cells / (near_shore_w / near_shore));
            std::printf("far-shore %s: the 600 m behind the lake return %.2f dB more than the 600 m before it\n",
                        far_shore, shore_db);
            if (!bright) {
                plain_shore_db = shore_db;
                plain_behind_w = behind_w;
            } else {
                double lit = 0, lit_w = 0, lit_plain_w = 0;
                REQUIRE(behind_w.size() == plain_behind_w.size());
                for (std::size_t i = 0; i < behind_w.size(); ++i) {
                    if (behind_w[i] > 1.26 * plain_behind_w[i])
                        ++lit, lit_w += behind_w[i], lit_plain_w += plain_behind_w[i];
                }
                std::printf("%.0f %% of these cells are more than 1 dB brighter than without it, %.1f dB together\n",
                            100 * lit / behind_cells, 10 * std::log10(lit_w / lit_plain_w));
                // The far shore outshines the near one, where by itself it does not.
                CHECK(plain_shore_db == Approx(-0.8).margin(0.055));
                CHECK(shore_db == Approx(0.8).margin(0.055));
                CHECK(100 * lit / behind_cells == Approx(42).margin(0.55));
                CHECK(10 * std::log10(lit_w / lit_plain_w) == Approx(3.0).margin(0.055));
            }
        }
        if (bright) {  // the water itself stays as it is
            CHECK(black == water);
            continue;
        }
        CHECK(water == 445);
        const double water_db = 10 * std::log10(std::max(water_w / water, 1e-30)) + 30;
        std::printf(
            "sea state %d: Lake Mathews %.1f dBm, land at its ranges %.1f dBm; %.1f %% of the lake's %g cells black at "
            "44 dB, %.1f %% at 52 dB\n",
            state, water_db, 10 * std::log10(land_w / land) + 30, 100 * black / water, water,
            100 * black_at_52 / water);
        CHECK(water_db > before_db);
        if (state > 0) CHECK(water_db == Approx(state == 1 ? -108 : state == 3 ? -99 : -90).margin(0.55));
        if (state == 6) CHECK(10 * std::log10(land_w / land) + 30 == Approx(-81).margin(0.55));
        CHECK(black == water);  // at the gain that shows land, whatever the state
        if (state == 6) CHECK(black_at_52 < 0.05 * water);
        if (state == 0) CHECK(black_at_52 > 0.95 * water);
        before_db = water_db;
    }
}

TEST_CASE("a target stands where the sweep of the tube says: GPI a map, PPI and TDPPI off it", "[paper]") {
    const Folder folder;
    const Raster ground = read(data + "/inland_empire_dem.tif");
    // A culture of one's own on the same grid: soil, and two reflectors of 5 x 5 posts, north-west and south-west of the sensor.
    const int sensor_column = 800, sensor_row = 500;
    const std::array<std::array<int, 2>, 2> target{
        {{sensor_column - 40, sensor_row - 60}, {sensor_column - 200, sensor_row + 150}}};
    {
        const GDALDatasetUniquePtr model(GDALDataset::Open((data + "/inland_empire_culture.tif").c_str()));
        const GDALDatasetUniquePtr made(GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
            (folder / "targets.tif").c_str(), ground.width, ground.height, 1, GDT_Byte, nullptr));
        auto to_xy = ground.to_xy;
        made->SetGeoTransform(to_xy.data());
        made->SetSpatialRef(model->GetSpatialRef());
        std::vector<std::uint8_t> code(ground.value.size(), 1);
        for (const auto& [column, row] : target)
            for (int y = row - 2; y <= row + 2; ++y)
                for (int x = column - 2; x <= column + 2; ++x) code[static_cast<std::size_t>(y * ground.width + x)] = 2;
        REQUIRE(made->GetRasterBand(1)->RasterIO(GF_Write, 0, 0, ground.width, ground.height, code.data(), ground.width,
                                                 ground.height, GDT_Byte, 0, 0) == CE_None);
        std::ofstream(folder / "targets.csv") << "1,soil\n2,metal\n";
    }
    const double x = ground.to_xy[0] + 30 * (sensor_column + 0.5), y = ground.to_xy[3] - 30 * (sensor_row + 0.5);
    const double sensor_m = 4000, range_m = 12000,
                 above_m = sensor_m - static_cast<double>(ground.at(sensor_column, sensor_row));
    folder.make(with(with({"simulate"}, radar), {"--antenna-width",
                                                 "6deg",
                                                 "--dem",
                                                 data + "/inland_empire_dem.tif",
                                                 "--culture",
                                                 folder / "targets.tif",
                                                 "--culture-legend",
                                                 folder / "targets.csv",
                                                 "--geometry",
                                                 "grid",
                                                 "--earth",
                                                 "flat",
                                                 "--xy",
                                                 std::to_string(x) + "," + std::to_string(y),
                                                 "--altitude-msl",
                                                 "4000m",
                                                 "--range",
                                                 "12km",
                                                 "--range-bin",
                                                 "30m",
                                                 "--bwe",
                                                 "off",
                                                 "--ple",
                                                 "off",
                                                 "--echo",
                                                 folder / "targets_echo.tif"}));
    constexpr int size = 800;
    for (const std::string display : {"gpi", "ppi", "tdppi"}) {
        folder.make({"scope", folder / "targets_echo.tif", "--display", display, "--if-gain", "46dB", "--rings", "off",
                     "--size", std::to_string(size), "-o", folder / "scope.png"});
        const Raster picture = read(folder / "scope.png");
        const auto radius_m = [&](double r) {
            if (display == "gpi") return std::sqrt(r * r - above_m * above_m);
            return display == "ppi" ? r : r - above_m;
        };
        for (const auto& [column, row] : target) {
            // The brightest pixels of the target's quadrant.
            const bool north = row < sensor_row;
            float most = 0;
            double sum = 0, radius = 0;
            for (const bool measure : {false, true})
                for (int v = north ? 0 : size / 2; v < (north ? size / 2 : size); ++v)
                    for (int u = 0; u < size / 2; ++u) {
                        const float g = picture.at(u, v);
                        if (!measure) most = std::max(most, g);
                        if (measure && g == most) {
                            ++sum;
                            radius += std::hypot(u + 0.5 - size / 2, v + 0.5 - size / 2);
                        }
                    }
            const double s = 30 * std::hypot(column - sensor_column, row - sensor_row);
            const double height_m = ground.at(column, row);
            const double expected_px = radius_m(std::hypot(s, sensor_m - height_m)) / radius_m(range_m) * size / 2;
            std::printf(
                "%s: a target %.0f m away shows at %.1f pixels, formula %.1f, on a map %.1f (brightest %g, %g "
                "pixels)\n",
                display.c_str(), s, radius / sum, expected_px, s / radius_m(range_m) * size / 2,
                static_cast<double>(most), sum);
            // Half its size, 75 m, and a pixel.
            CHECK(radius / sum == Approx(expected_px).margin(75 / radius_m(range_m) * size / 2 + 1));
            // A map puts it elsewhere, but for the GPI.
            const double map_px = s / radius_m(range_m) * size / 2;
            if (display == "gpi") CHECK(radius / sum == Approx(map_px).margin(3));
            if (display == "ppi") CHECK(radius / sum > map_px * (s < 3000 ? 1.9 : 1.1));
            if (display == "tdppi") CHECK(radius / sum < map_px * (s < 3000 ? 0.3 : 0.65));
        }
    }
}
