// Weather in a scene: what the ground's echo loses on the way, and the rain's own, against exact losses and closed forms.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "lib/atmosphere.hpp"
#include "lib/beam.hpp"
#include "lib/engine.hpp"
#include "lib/rain.hpp"
#include "lib/rain_echo.hpp"
#include "lib/shade.hpp"
#include "tests/bare_scene.hpp"
#include "tests/refusal.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using wedgescope::test::MemorySource;
using wedgescope::test::simulate;

namespace {

/// A default set over ground of one constant gamma.
Scene scene_at(double altitude_m, double range_m) {
    Scene s;
    s.platform.xy = PointXY{12007, -12011};
    s.platform.altitude_m = altitude_m;
    s.range_m = range_m;
    s.azimuth_bins = 360;
    s.radar.antenna.beam = Angle::degrees(4);
    s.display.size = 64;
    return s;
}

double at(const PolarImage<float>& image, std::size_t row, double range_m) {
    return static_cast<double>(image.row(row)[static_cast<std::size_t>(range_m / image.grid.range_bin_m)]);
}

const auto hills = test::rolling(900, 250, 3);

}  // namespace

TEST_CASE("every piece of ground is weaker by what gases, rain and cloud take on its way", "[weather]") {
    MemorySource source(801, 801, 30, [](double, double) { return 200.0; });
    struct Case {
        WeatherParams weather;
        double frequency_hz;
    };
    for (const Case& c : {Case{{.vapour_g_m3 = 7.5}, 35e9}, Case{{.rain_mm_h = 16}, 16.5e9},
                          Case{{.liquid_water_g_m3 = 0.5, .cloud_base_m = 500, .cloud_top_m = 1500}, 35e9},
                          Case{{.vapour_g_m3 = 20, .rain_mm_h = 4, .rain_top_m = 1200, .liquid_water_g_m3 = 0.05,
                                .cloud_base_m = 0, .cloud_top_m = 3000},
                               16.5e9}})
        for (const double altitude : {600.0, 2134.0, 9000.0}) {
            Scene s = scene_at(altitude, 11500);
            s.radar.frequency_hz = c.frequency_hz;
            const RunResult clear = simulate(s, source);
            s.weather = c.weather;
            const RunResult r = simulate(s, source);
            const Weather weather(weather_of(s), c.frequency_hz);
            for (const double range : {altitude + 100, 10000.0, 11000.0})
                for (const std::size_t row : {std::size_t{10}, std::size_t{137}, std::size_t{301}}) {
                    const double before = at(clear.echo_w, row, range), after = at(r.echo_w, row, range);
                    if (!(before > 0)) continue;
                    const double middle = (std::floor(range / r.echo_w.grid.range_bin_m) + 0.5) * r.echo_w.grid.range_bin_m;
                    const Earth& earth = r.scene.earth;
                    const double arc = earth.arc_m(altitude, 200, middle).value();
                    const double sine = -std::sin(earth.sight(altitude, 200, arc).depression_rad);
                    INFO(altitude << " m, " << range << " m");
                    CHECK_THAT(10 * std::log10(before / after),
                               WithinAbs(path_loss(weather, earth, altitude, middle, sine).db(), 0.02));
                }
        }
}

TEST_CASE("over water that returns nothing the power is the rain's alone, as the closed form of a filled beam",
          "[weather]") {
    // Amid rain on a flat earth, a pencil beam that looks ahead.
    MemorySource source(801, 801, 30, [](double, double) { return 0.0; });
    source.editable().default_class = material_by_name("material", "water");
    Scene s = scene_at(4000, 11500);
    s.earth_k.reset();
    s.radar.frequency_hz = 9.4e9;
    s.radar.antenna.elevation = ElevationPattern::gaussian;
    s.radar.antenna.knee = Angle::degrees(0);
    s.radar.antenna.width = Angle::degrees(3);
    for (const double rate : {1.0, 16.0})
        for (const bool circular : {false, true}) {
            s.weather.rain_mm_h = rate;
            s.weather.rain_top_m = 20e3;
            s.radar.polarisation = circular ? Polarisation::circular : Polarisation::hh;
            const RunResult r = simulate(s, source);
            CHECK(*std::max_element(r.echo_w.cells.begin(), r.echo_w.cells.end()) == 0);
            const double extent = s.radar.pulse_extent_m(), dr = r.power_w.grid.range_bin_m;
            for (const double range : {4300.0, 7000.0, 11000.0}) {
                const auto j = static_cast<std::size_t>(range / dr);
                const double middle = (static_cast<double>(j) + 0.5) * dr - extent / 2;
                const double volume = std::numbers::pi * s.radar.antenna.beam.rad() * s.radar.antenna.width.rad() * middle *
                                      middle * 2 * extent / (16 * std::numbers::ln2);
                const double gamma = rain_attenuation_db_km(9.4e9, rate, Angle::degrees(0),
                                                            circular ? circular_tilt : horizontal_tilt);
                const double less = circular ? rain_cancellation(rate).ratio() : 1;
                const double expected = radar_constant(s.radar) * rain_cross_section_per_m(9.4e9, rate) * volume /
                                        std::pow(middle, 4) * std::pow(10, -0.2 * gamma * middle * 1e-3) / less;
                for (const std::size_t row : {std::size_t{0}, std::size_t{211}}) {
                    INFO(rate << " mm/h at " << range << " m, circular " << circular);
                    CHECK_THAT(10 * std::log10(at(r.power_w, row, range) / expected), WithinAbs(0, 0.03));
                }
            }
        }
}

TEST_CASE("the rain's echo is on top of the ground's, spread or not, in any slice of the circle", "[weather]") {
    MemorySource source(801, 801, 30, [](double c, double r) { return 300 + hills(c, r); });
    for (const bool spread : {true, false}) {
        Scene s = scene_at(2134, 11500);
        s.radar.beam_width_error = s.radar.pulse_length_error = spread;
        s.weather.rain_mm_h = 16;
        const RunResult both = simulate(s, source);
        source.editable().default_class = material_by_name("material", "water");
        const RunResult rain = simulate(s, source);
        source.editable().default_class = material_by_name("material", "soil");
        // What the ground's own echo makes through beam and pulse, and the rain's.
        const PolarImage<float> ground = power_image(both.echo_w, both.power_w.grid, beam_setting(both.scene));
        double most = 0;
        for (std::size_t i = 0; i < ground.cells.size(); i += 97) {
            const double alone = static_cast<double>(ground.cells[i]), wet = static_cast<double>(rain.power_w.cells[i]);
            CHECK_THAT(static_cast<double>(both.power_w.cells[i]), WithinRel(alone + wet, 3e-7));
            most = std::max(most, std::min(alone, wet) / std::max({alone, wet, 1e-300}));
        }
        CHECK(most > 0.1);  // both of them count somewhere
        s.sector = Sector{Angle::degrees(30), Angle::degrees(75)};
        s.range_start_m = 3000;
        const RunResult part = simulate(s, source);
        const PolarGrid& grid = part.power_w.grid;
        for (std::int64_t a = grid.azimuth_bins.begin; a < grid.azimuth_bins.end; a += 7)
            for (std::int64_t j = grid.range_bins.begin; j < grid.range_bins.end; j += 31) {
                const auto row = static_cast<std::size_t>(a), column = static_cast<std::size_t>(j);
                const double all = static_cast<double>(both.power_w.row(row)[column]);
                CHECK_THAT(static_cast<double>(part.power_w.row(static_cast<std::size_t>(a - grid.azimuth_bins.begin))
                                                   [static_cast<std::size_t>(j - grid.range_bins.begin)]),
                           WithinRel(all, 1e-6));
            }
    }
}

TEST_CASE("without spreading the rain's total is that of the spread picture", "[weather]") {
    MemorySource source(401, 401, 30, [](double, double) { return 0.0; });
    source.editable().default_class = material_by_name("material", "water");
    Scene s = scene_at(1500, 5500);
    s.platform.xy = PointXY{6007, -6011};
    s.weather.rain_mm_h = 4;
    const auto total = [&] {
        const RunResult r = simulate(s, source);
        double sum = 0;
        for (const float p : r.power_w.cells) sum += static_cast<double>(p);
        return sum;
    };
    const double with = total();
    s.radar.beam_width_error = s.radar.pulse_length_error = false;
    CHECK_THAT(total(), WithinRel(with, 3e-3));  // the pulse carries a little over the last bin
}

TEST_CASE("on a true ground-range scope rain lies where level ground of its range does", "[weather]") {
    MemorySource source(801, 801, 30, [](double, double) { return 0.0; });
    source.editable().default_class = material_by_name("material", "water");
    Scene s = scene_at(3000, 11000);
    s.weather.rain_mm_h = 4;
    s.radar.pulse_length_error = false;  // else what the pulse adds up is of other ranges
    const RunResult slant = simulate(s, source);
    s.display.kind = DisplayKind::gpi_true;
    const RunResult ground = simulate(s, source);
    for (const double arc : {2000.0, 5000.0, 9000.0}) {
        // A bin of arc holds cos d of the slant range, and the pulse is sec d as long on it.
        const double range = ground.scene.earth.slant_range_m(3000, 0, arc);
        INFO("at " << arc << " m");
        CHECK_THAT(at(ground.power_w, 5, arc) / at(slant.power_w, 5, range), WithinRel(1.0, 0.02));
    }
}

TEST_CASE("rain falls to the ground where it is, not to the height of that below the sensor", "[weather]") {
    const auto power_over = [](const std::function<double(double, double)>& height_m) {
        MemorySource source(801, 801, 30, height_m);
        source.editable().default_class = material_by_name("material", "water");
        Scene s = scene_at(4000, 11000);
        s.weather.rain_mm_h = 1;  // which hardly weakens itself
        s.radar.antenna.elevation = ElevationPattern::gaussian;  // as good as even
        s.radar.antenna.width = Angle::degrees(170);
        s.weather.rain_top_m = 2000;
        return simulate(s, source);
    };
    const auto near = [](double column, double row) { return std::hypot(column - 400, row - 400) < 50; };
    const auto half = [](double column, double row) { return column - 400 + 0.3 * (row - 400) < 0 ? 0.0 : 1500.0; };
    const RunResult low = power_over([](double, double) { return 0.0; }),
                    high = power_over([](double, double) { return 1500.0; }),
                    mesa = power_over([&](double c, double r) { return near(c, r) ? 2100.0 : 0.0; }),
                    pit = power_over([&](double c, double r) { return near(c, r) ? 0.0 : 1500.0; }),
                    halves = power_over(half);
    for (const double range : {6500.0, 8000.0, 10500.0}) {
        INFO("at " << range << " m");
        const double of_low = at(low.power_w, 5, range), of_high = at(high.power_w, 5, range);
        CHECK(of_high < 0.8 * of_low);
        CHECK_THAT(at(mesa.power_w, 5, range),
                   WithinRel(of_low, 1e-3));  // whose edge hides the ground as far as 5.1 km
        CHECK_THAT(at(pit.power_w, 5, range), WithinRel(of_high, 1e-3));
        // 0 to the west, 1500 m to the east, each half the circle.
        CHECK_THAT(at(halves.power_w, 270, range), WithinRel(at(low.power_w, 270, range), 1e-3));
        CHECK_THAT(at(halves.power_w, 90, range), WithinRel(at(high.power_w, 90, range), 1e-3));
    }
    // The rim of a narrow pit comes before its ground.
    const auto over_pit = [](double depth_m) {
        MemorySource source(
            401, 401, 30, [=](double c, double r) { return std::hypot(c - 200, r - 200) < 4 ? 1500 - depth_m : 1500; });
        source.editable().default_class = material_by_name("material", "water");
        Scene s = scene_at(1700, 4000);
        s.platform.xy = PointXY{6007, -6011};
        s.weather.rain_mm_h = 1;
        return simulate(s, source);
    };
    const RunResult level_ground = over_pit(0), deep = over_pit(1500);
    for (const double range : {600.0, 1200.0, 1900.0, 3500.0})
        CHECK_THAT(at(deep.power_w, 5, range), WithinRel(at(level_ground.power_w, 5, range), 0.01));
    // All round the same whatever sector and range are asked for, and on a plain what a level surface gives.
    Scene s = scene_at(4000, 7000);
    s.weather.rain_mm_h = 16;
    s.weather.rain_top_m = 2000;
    s.sector = Sector{Angle::degrees(10), Angle::degrees(40)};
    MemorySource split(801, 801, 30, half);
    const ResolvedScene part = resolve(s, split);
    REQUIRE(part.rain_floor.size() == 32);
    for (std::size_t ray = 0; ray < 32; ++ray) {
        REQUIRE(part.rain_floor[ray].size() > 10);
        REQUIRE(halves.scene.rain_floor[ray].size() >= part.rain_floor[ray].size());
        for (std::size_t i = 0; i < part.rain_floor[ray].size(); ++i)
            CHECK(part.rain_floor[ray][i] == halves.scene.rain_floor[ray][i]);
    }
    REQUIRE(high.scene.rain_floor.size() == 1);
    for (const RainFloor& knot : high.scene.rain_floor[0]) CHECK(knot.height_m == 1500);
    s.weather.rain_mm_h = 0;
    CHECK(resolve(s, split).rain_floor.empty());
    // Beyond the horizon only what is above the ray that grazes the ground is seen, as over a level surface.
    const Earth earth(6371000.0 * 4 / 3);
    const Weather weather({.rain_mm_h = 4}, RadarParams{}.frequency_hz);
    MemorySource wide(901, 901, 400, [](double, double) { return 100.0; });
    Scene far = scene_at(600, 150e3);
    far.platform.xy = PointXY{180000, -180000};
    far.weather = weather.params();
    RainEchoParams params{
        .radar = far.radar, .earth = earth, .sensor_m = 600, .reference_m = 100, .most_range_m = 150e3};
    const PathLossTable loss(weather, {.earth = earth, .sensor_m = 600, .most_range_m = 150e3, .highest_m = 20e3});
    const PatternTable pattern(far.radar.antenna);
    const RainEcho level(weather, loss, pattern, params);
    params.floor = resolve(far, wide).rain_floor.at(0);
    const RainEcho floor(weather, loss, pattern, params);
    // Beyond the raster too.
    MemorySource narrow(61, 61, 400, [](double, double) { return 100.0; });
    far.platform.xy = PointXY{12000, -12000};
    params.floor = resolve(far, narrow).rain_floor.at(0);
    const RainEcho beyond(weather, loss, pattern, params);
    for (const double range : {5e3, 30e3, 80e3, 110e3, 140e3}) {
        CHECK_THAT(floor.density_w_m_rad(range), WithinRel(level.density_w_m_rad(range), 0.01));
        CHECK_THAT(beyond.density_w_m_rad(range), WithinRel(level.density_w_m_rad(range), 0.01));
    }
}

TEST_CASE("a mountain hides rain behind it, and nowhere else", "[weather]") {
    // A plain, and the same with what stands on it beyond 3 km: mountains all over the east, a wall all round.
    const auto power_over = [](const std::function<double(double, double)>& height_m) {
        MemorySource source(801, 801, 30, height_m);
        source.editable().default_class = material_by_name("material", "water");
        Scene s = scene_at(500, 11000);
        s.weather.rain_mm_h = 4;
        s.weather.rain_top_m = 2000;
        return simulate(s, source);
    };
    const RunResult plain = power_over([](double, double) { return 0.0; }),
                    east = power_over(
                        [](double c, double r) { return c > 500 && std::abs(r - 400) < c - 400 ? 1600.0 : 0.0; }),
                    wall = power_over([](double c, double r) {
                        return std::abs(std::hypot(c - 400, r - 400) - 200) < 12 ? 2500.0 : 0.0;
                    });
    for (const double range : {3500.0, 6000.0, 8500.0, 10500.0}) {
        INFO("at " << range << " m");
        CHECK(at(plain.power_w, 5, range) == at(plain.power_w, 200, range));
        for (const std::size_t azimuth : {200, 250, 270, 300})
            CHECK(at(east.power_w, azimuth, range) == at(plain.power_w, azimuth, range));
        // Over the edge, 1100 m above the sensor 3 km off, no ray is wet beyond 4.2 km.
        if (range > 4300) CHECK(at(east.power_w, 90, range) < 1e-3f * at(plain.power_w, 90, range));
        if (range > 7000)
            for (const std::size_t azimuth : {5, 90, 222})
                CHECK(at(wall.power_w, azimuth, range) < 1e-3f * at(plain.power_w, azimuth, range));
    }
}

TEST_CASE("rain fluctuates as the ground does: its mean stays, one look is exponential", "[weather]") {
    MemorySource source(401, 401, 30, [](double, double) { return 0.0; });
    source.editable().default_class = material_by_name("material", "water");
    Scene s = scene_at(1500, 5500);
    s.platform.xy = PointXY{6007, -6011};
    s.weather.rain_mm_h = 16;
    s.receiver.speckle_looks = 1;
    EngineParams params;
    params.threads = 1;
    params.beside_others = true;  // keeps what is received
    const RunResult r = run(resolve(s, source), source, params);
    double sum = 0, square = 0;
    std::size_t n = 0;
    // Each look of a resolution cell: a beamwidth (4 bins) and a pulse (4 bins) apart.
    for (std::size_t row = 0; row < 360; row += 8)
        for (std::size_t j = 100; j < r.power_w.grid.range_count(); j += 8) {
            const double ratio = static_cast<double>(r.received_w.row(row)[j]) /
                                 (static_cast<double>(r.power_w.row(row)[j]) + r.scene.noise_power_w);
            sum += ratio;
            square += ratio * ratio;
            ++n;
        }
    REQUIRE(n > 1000);
    const double mean = sum / static_cast<double>(n);
    CHECK_THAT(mean, WithinAbs(1, 0.1));
    CHECK_THAT(square / static_cast<double>(n) / (mean * mean), WithinAbs(2, 0.35));
}

TEST_CASE("weather that takes nothing changes no bit", "[weather]") {
    MemorySource source(301, 301, 30, [](double c, double r) { return 300 + hills(c, r); });
    Scene s = scene_at(1800, 4000);
    s.platform.xy = PointXY{4507, -4511};
    const RunResult before = simulate(s, source);
    s.weather.rain_top_m = 8000;
    s.weather.cloud_base_m = 500;
    s.weather.cloud_top_m = 900;
    s.weather.rain_mm_h = 0;
    const RunResult after = simulate(s, source);
    CHECK(before.echo_w.cells == after.echo_w.cells);
    CHECK(before.power_w.cells == after.power_w.cells);
}

TEST_CASE("any number of wedges and threads weaken alike", "[weather]") {
    MemorySource source(401, 401, 30, [](double c, double r) { return 300 + hills(c, r); });
    Scene s = scene_at(1800, 5000);
    s.platform.xy = PointXY{6007, -6011};
    s.weather.vapour_g_m3 = 7.5;
    s.weather.rain_mm_h = 4;
    s.land = LandModel::ulaby_dobson;
    const RunResult one = simulate(s, source);
    EngineParams params;
    params.threads = 2;
    params.wedges = 7;
    params.cull = false;
    const RunResult seven = run(resolve(s, source), source, params);
    CHECK(one.echo_w.cells == seven.echo_w.cells);
    CHECK(one.power_w.cells == seven.power_w.cells);
}

TEST_CASE("weather outside what its formulas take is refused by key", "[weather]") {
    MemorySource source(101, 101, 30, [](double, double) { return 0.0; });
    Scene s = scene_at(800, 1200);
    s.platform.xy = PointXY{1500, -1500};
    const auto refused = [&] { return test::refusal<InputError>([&] { resolve(s, source); }); };
    s.weather.rain_mm_h = 501;
    CHECK(refused().starts_with("rain is 501 mm/h"));
    s.weather = {};
    s.weather.liquid_water_g_m3 = 0.1;
    s.weather.cloud_base_m = 900;
    s.weather.cloud_top_m = 800;
    CHECK(refused() == "cloud-top is 800 m; it must be above cloud-base, which is 900 m, and at most 20000 m");
    s.weather = {};
    s.weather.vapour_g_m3 = 7.5;
    s.radar.frequency_hz = 0.5e9;
    CHECK(refused().starts_with("frequency with gases is 0.5 GHz"));
}
