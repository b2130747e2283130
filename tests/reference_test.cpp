// The engine against the independent reference of tests/reference, on real scenes.
#include <catch2/catch.hpp>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "lib/engine.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/reference/reference_engine.hpp"
#include "tests/terrain.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/sources.hpp"

using namespace wedgescope;

namespace {

const std::string data = WEDGESCOPE_TEST_DATA;

struct Case {
    const char* name;
    std::string dem, culture, culture_height;
    double culture_height_scale = 1;
    double lat = 0, lon = 0, altitude_m = 0;
    int first_bin = 0, bins = 240;
    double range_m = 30000;
    bool above_ground = false;  ///< the altitude
    int azimuth_bins = 960;     ///< four a beam
    double power_w = 50e3;      ///< transmitted
    int rays_per_bin = 0;       ///< of the reference; 0: 48 to 3/8 of a degree
    double post_m = 30;
    double pulse_s = 0.5e-6;
    double bright = 1.0 / 8;  ///< share of the cells above the noise, at least
    double beam_deg() const { return 4 * 360.0 / azimuth_bins; }
};

struct Outcome {
    reference::Comparison power;
    double states = 0;
    std::size_t cells = 0;
};

/// Both programs on one scene: the same set, the same bins; the scene is said twice, once to each. An outcome a quality.
std::vector<Outcome> compare(const Case& c, const std::vector<Quality>& qualities) {
    static const GdalSession session(64 << 20, {});
    Scene s;
    s.platform.latlon = LatLon{c.lat, c.lon};
    s.platform.altitude_m = c.altitude_m;
    if (c.above_ground) s.platform.altitude_above = AltitudeAbove::ground;
    s.azimuth_bins = c.azimuth_bins;
    s.radar.antenna.beam = Angle::degrees(c.beam_deg());
    s.radar.transmit_power_w = c.power_w;
    s.radar.pulse_s = c.pulse_s;
    s.range_m = c.range_m;
    // From where the beam is two posts wide: what the promises are for.
    s.range_start_m = 2 * c.post_m / s.radar.antenna.beam.rad();
    s.sector = Sector{Angle::degrees(c.first_bin * 0.25 * c.beam_deg()),
                      Angle::degrees((c.first_bin + c.bins) * 0.25 * c.beam_deg())};
    s.display.size = 64;
    DataBaseParams db;
    db.dem = std::filesystem::path(data) / c.dem;  // or where that says itself
    if (!c.culture.empty()) {
        db.culture = data + "/" + c.culture;
        db.legend = Legend::built_in("fbfm40");
    }
    if (!c.culture_height.empty()) {
        db.culture_height = data + "/" + c.culture_height;
        db.culture_height_scale = c.culture_height_scale;
    }
    const auto source = open_direct_source(db);

    reference::Scene r;
    r.dem = db.dem;
    r.culture = db.culture;
    r.culture_height = db.culture_height;
    r.culture_height_scale = c.culture_height_scale;
    r.class_of_code = reference::fbfm40_classes();
    r.gamma = reference::project_gamma();
    r.lat_deg = c.lat;
    r.lon_deg = c.lon;
    r.azimuth_bins = c.azimuth_bins;
    r.beamwidth_deg = c.beam_deg();
    r.transmit_power_w = c.power_w;
    r.pulse_s = c.pulse_s;
    r.rays_per_bin = c.rays_per_bin > 0 ? c.rays_per_bin : 48 * 960 / c.azimuth_bins;
    r.first_azimuth_bin = c.first_bin;
    r.azimuth_count = c.bins;
    const ResolvedScene resolved = resolve(s, *source);
    r.height_msl_m = resolved.sensor_m;
    r.range_bin_m = resolved.shown.range_bin_m;
    r.range_bins = static_cast<int>(resolved.shown.range_bins.end);
    const reference::Result whole = reference::simulate(r);
    reference::Result truth;
    const auto skip = static_cast<std::size_t>(resolved.shown.range_bins.begin),
               all = static_cast<std::size_t>(r.range_bins);
    for (std::size_t i = 0; i < whole.power_w.size(); ++i) {
        if (i % all < skip) continue;
        truth.power_w.push_back(whole.power_w[i]);
        truth.state.push_back(whole.state[i]);
    }

    std::vector<Outcome> outcomes;
    for (const Quality quality : qualities) {
        s.quality = quality;
        EngineParams params;
        params.threads = 2;
        const RunResult ours = run(resolve(s, *source), *source, params);
        REQUIRE(ours.power_w.cells.size() == truth.power_w.size());
        const std::vector<double> power(ours.power_w.cells.begin(), ours.power_w.cells.end());
        Outcome o;
        o.power = reference::compare(power, truth.power_w, reference::noise_w(s.radar.noise_bandwidth_hz(), 8));
        o.states = reference::state_difference({ours.state.cells.begin(), ours.state.cells.end()}, truth.state);
        std::printf(
            "%-28s %-6s rms %.4f dB, p99 %.4f dB, median %+.5f dB, most %.2f dB over %zu cells; states %.3f %%\n",
            c.name, word(quality), o.power.rms_db, o.power.p99_db, o.power.median_db, o.power.max_db, o.power.count,
            100 * o.states);
        o.cells = truth.power_w.size();
        outcomes.push_back(o);
    }
    return outcomes;
}

struct Promise {
    Quality quality;
    double p99_db;
    double states;
};
void check(const Case& c, Quality finest = Quality::exact) {
    std::vector<Promise> promises = {{Quality::draft, 1.5, 0.03},
                                     {Quality::normal, 0.35, 0.01},
                                     {Quality::fine, 0.2, 0.01},
                                     {Quality::exact, 0.06, 0.01}};
    std::vector<Quality> qualities;
    std::erase_if(promises, [&](const Promise& p) { return p.quality < finest; });  // exact is the least
    for (const Promise& p : promises) qualities.push_back(p.quality);
    const std::vector<Outcome> outcomes = compare(c, qualities);
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
        const Promise& promise = promises[i];
        INFO(word(promise.quality));
        CHECK(static_cast<double>(outcomes[i].power.count) > c.bright * static_cast<double>(outcomes[i].cells));
        CHECK(outcomes[i].power.rms_db < promised_error(promise.quality).rms_db);
        CHECK(outcomes[i].power.p99_db < promise.p99_db);
        if (promise.quality != Quality::draft) CHECK(std::abs(outcomes[i].power.median_db) < 0.01);
        CHECK(outcomes[i].states < promise.states);
    }
}

}  // namespace

TEST_CASE("inland_empire from 7000 ft: terrain, culture and canopy", "[reference]") {
    check({"inland_empire 2134 m", "inland_empire_dem.tif", "inland_empire_culture.tif", "inland_empire_canopy.tif",
           0.1, 33.93, -117.33, 2134, 480, 120});
}

TEST_CASE("inland_empire from 2750 ft: long shadows", "[reference]") {
    check({"inland_empire 838 m", "inland_empire_dem.tif", "inland_empire_culture.tif", "inland_empire_canopy.tif", 0.1,
           33.93, -117.33, 838, 480, 120});
}

TEST_CASE("inland_empire from 2134 m, classes that lie on bare ground", "[reference]") {
    check({"inland_empire 2134 m, classes", "inland_empire_dem.tif", "inland_empire_culture.tif", "", 1, 33.93, -117.33,
           2134, 480, 80});
}

TEST_CASE("inland_empire from 30 m above ground, beam of 6 degrees: tails of the pulse over shadows", "[reference]") {
    check({"inland_empire 30 m, 6 deg", "inland_empire_dem.tif", "", "", 1, 33.93, -117.33, 30, 120, 60, 20000, true,
           240});
}

TEST_CASE("inland_empire from 1300 m above ground, a weak radar: fewer spokes in wide bins", "[reference]") {
    check({"inland_empire 1300 m, 6 deg", "inland_empire_dem.tif", "", "", 1, 33.93, -117.33, 1300, 120, 30, 35000,
           true, 240, 1e3});
}

TEST_CASE("inland_empire from 1300 m above a valley, towards mountains as high as the sensor", "[reference]") {
    check({"inland_empire, mountains", "inland_empire_dem.tif", "", "", 1, 33.8, -117.5, 1300, 500, 170, 20000, true});
}

TEST_CASE("inland_empire from 8000 m above ground, beam of 12 degrees", "[reference]") {
    check({"inland_empire 8000 m, 12 deg", "inland_empire_dem.tif", "inland_empire_culture.tif",
           "inland_empire_canopy.tif", 0.1, 33.93, -117.33, 8000, 60, 15, 35000, true, 120, 50e3, 128});
}

TEST_CASE("needles of 40 m on posts of 4 m, from 100 m above them", "[reference]") {
    const test::Folder folder;
    test::Drawing needles;
    needles.columns = needles.rows = 1101;
    needles.geotransform = {{497800, 4, 0, 4102200, 0, -4}};
    std::vector<double> height_m;
    std::mt19937 random(4);
    const auto hills = test::rolling(20, 200, 5);
    for (int r = 0; r < needles.rows; ++r)
        for (int c = 0; c < needles.columns; ++c) height_m.push_back(hills(c, r) + (random() % 200 == 0 ? 40 : 0));
    needles.value = [&](int c, int r) {
        return height_m[static_cast<std::size_t>(r) * static_cast<std::size_t>(needles.columns) +
                        static_cast<std::size_t>(c)];
    };
    draw(folder / "needles.tif", needles);
    // 500 000 E, 4 100 000 N of zone 11, the raster's middle.
    Case c{"needles of 40 m", folder / "needles.tif", "", "", 1, 37.046026, -117, 100, 80, 24, 2098.5, true};
    c.rays_per_bin = 256;
    c.post_m = 4;
    check(c);
}

TEST_CASE("worcester_vermont: a third of it void, culture, canopy, Albers projection", "[reference]") {
    check({"worcester_vermont 1400 m", "worcester_vermont_dem.tif", "worcester_vermont_culture.tif",
           "worcester_vermont_canopy.tif", 0.1, 44.42, -72.56, 1400, 0, 160, 11000});
}

TEST_CASE("olympic_coast: latitude and longitude, geodesics, small voids", "[reference]") {
    check({"olympic_coast 1500 m", "olympic_coast_dem.tif", "", "", 1, 48.2, -124.6, 1500, 240, 120, 30000});
}

TEST_CASE("inland_empire from 965 m, glimpses of crests out of shadows: bins in doubt are swept again", "[reference]") {
    Case c{"inland_empire, glimpses",
           "inland_empire_dem.tif",
           "",
           "",
           1,
           33.8573,
           -117.38912,
           965,
           312,
           60,
           12300,
           true,
           480};
    c.pulse_s = 2e-6;
    c.rays_per_bin = 192;
    check(c);
}

TEST_CASE("inland_empire from 522 m, single cells of wood look out of shadows: more spokes a bin over heights",
          "[reference]") {
    Case c{"inland_empire 522 m, wood",
           "inland_empire_dem.tif",
           "inland_empire_culture.tif",
           "inland_empire_canopy.tif",
           0.1,
           33.613186,
           -117.669407,
           522,
           283,
           40,
           9000,
           true};
    c.rays_per_bin = 128;
    c.bright = 1.0 / 16;
    check(c, Quality::fine);  // for `exact` the reference would take longer than the rest
}

TEST_CASE("worcester_vermont from 530 m, steep slopes: lines of both axes, from `draft` on", "[reference]") {
    Case c{"worcester 530 m, steep",
           "worcester_vermont_dem.tif",
           "",
           "",
           1,
           44.42327,
           -72.59412,
           530,
           795,
           120,
           12600,
           true};
    c.pulse_s = 1e-6;
    c.rays_per_bin = 96;
    c.bright = 1.0 / 16;
    check(c);
}

TEST_CASE("every shipped terrain from 50 m to 12 km above ground, near and far", "[reference]") {
    struct Place {
        const char *name, *dem;
        double lat, lon, post_m, pulse_s, range_m;
        int first_bin;
    };
    const Place place =
        GENERATE(Place{"inland_empire", "inland_empire_dem.tif", 33.85, -117.45, 30, 0.5e-6, 15000, 240},
                 Place{"worcester_vermont", "worcester_vermont_dem.tif", 44.41, -72.58, 30, 0.5e-6, 13000, 20},
                 Place{"lake_sunapee", "lake_sunapee_dem.tif", 43.38, -72.05, 30, 0.5e-6, 13000, 150},
                 Place{"N44W072", "N44W072.hgt", 44.35, -71.45, 93, 1.5e-6, 40000, 200},
                 Place{"olympic_coast", "olympic_coast_dem.tif", 48.25, -124.4, 31, 0.5e-6, 16000, 230},
                 Place{"azores", "azores_dem.tif", 38.6, -28.45, 93, 1.5e-6, 45000, 220});
    const double height_m = GENERATE(50, 400, 3000, 12000);
    const std::string name = place.name + (" " + std::to_string(static_cast<int>(height_m))) + " m";
    Case c{name.c_str(), place.dem,     "",   "", 1, place.lat, place.lon, height_m, place.first_bin,
           24,           place.range_m, true, 480};
    c.post_m = place.post_m;
    c.pulse_s = place.pulse_s;
    c.rays_per_bin = height_m < 100 ? 192 : height_m < 1000 ? 96 : 48;  // the longer shadows are, the more
    c.bright = 1.0 / 32;  // from 12 km most of what the range holds is not ground
    check(c);
}
