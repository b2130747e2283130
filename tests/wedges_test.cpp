// How a run is divided, and what it then holds: wedges, threads, memory and the plan that foretells it.
#include <catch2/catch.hpp>

#include <cmath>
#include <random>

#include "lib/culture.hpp"
#include "lib/engine.hpp"
#include "lib/plan.hpp"
#include "tests/bare_scene.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;
using wedgescope::test::MemorySource;
using wedgescope::test::scene_of_one_gamma;
using wedgescope::test::simulate;
using wedgescope::test::void_post;

TEST_CASE("where echoes need not be kept their memory serves again, and no bit of the rest changes", "[wedges]") {
    const auto hills = test::rolling(300, 150, 3);
    MemorySource source(301, 301, 30, [&](double c, double r) { return 300 + hills(c, r); });
    Scene s = scene_of_one_gamma(4500, -4500, 900, 2800);
    s.quality = Quality::draft;  // only bits are compared
    s.azimuth_bins = 150;
    s.radar.beam_width_error = s.radar.pulse_length_error = true;
    s.display.size = GENERATE(600, 16);  // with an image of what is received, and without
    s.weather.rain_mm_h = GENERATE(0.0, 10.0);
    const int kind = GENERATE(0, 1, 2, 3);
    CAPTURE(s.display.size, s.weather.rain_mm_h, kind);
    if (kind == 1) s.sector = Sector{Angle::degrees(20), Angle::degrees(90)};  // swept is wider than shown
    if (kind == 2) s.receiver.speckle_looks = 1;
    if (kind == 3) s.receiver.noise = true;
    EngineParams params;
    params.threads = 2;
    params.beside_others = true;
    const RunResult kept = run(resolve(s, source), source, params);
    REQUIRE(kept.echo_w.cells.size() == kept.scene.swept.cells());
    params.keep_echo = false;
    RunResult again;
    for (int frame = 0; frame < 3; ++frame) {
        // Another place between two frames: nothing of it may stay in their memory.
        Scene other = s;
        if (frame == 1) other.platform.xy = PointXY{3000, -5500};
        again = run(resolve(other, source), source, params, std::move(again));
        if (frame == 1) continue;
        CHECK(again.power_w.cells == kept.power_w.cells);
        CHECK(again.received_w.cells == kept.received_w.cells);
        CHECK(again.state.cells == kept.state.cells);
        CHECK(again.scope.grey == kept.scope.grey);
        CHECK(again.report.states == kept.report.states);
    }
    CHECK(again.echo_w.cells.empty() == (kind == 0 || kind == 3 || (kind == 1 && s.display.size == 600)));
    CHECK(measure(resolve(s, source), source, params, {}).echo_w.cells == kept.echo_w.cells);
    // Nor where no picture is drawn, from what an earlier one left too.
    params.draw = false;
    for (int frame = 0; frame < 2; ++frame) {
        again = run(resolve(s, source), source, params, std::move(again));
        CHECK(again.power_w.cells == kept.power_w.cells);
        CHECK(again.state.cells == kept.state.cells);
        CHECK(again.report.states == kept.report.states);
        CHECK(again.received_w.cells.empty());
        CHECK(again.scope.grey.empty());
    }
}

TEST_CASE("without a picture no pixel counts in what a run holds", "[wedges][plan]") {
    MemorySource source(101, 101, 30, [](double, double) { return 100.0; });
    Scene s = scene_of_one_gamma(1500, -1500, 900, 1200);
    s.receiver.noise = true;
    s.display.size = 8192;
    const ResolvedScene scene = resolve(s, source);
    EngineParams params;
    params.memory_bytes = std::size_t{64} << 20;  // that many pixels alone
    CHECK_THROWS_AS(run(scene, source, params), TooLittleMemory);
    params.draw = false;
    CHECK(run(scene, source, params).power_w.grid == scene.shown);
}

TEST_CASE("the same bits for any number of wedges and threads", "[wedges][threads]") {
    const auto hills = test::rolling(600, 150, 3);
    MemorySource source(301, 257, 30, [&](double c, double r) {
        return std::hypot(c - 80, r - 60) < 11 ? static_cast<double>(void_post) : 700 + hills(c, r);
    });
    source.set_classes([](double c, double r) { return (static_cast<int>(c / 7) + static_cast<int>(r / 5)) % 16; });
    source.set_culture_height([](double c, double r) { return std::fmod(c * 7 + r * 3, 31) < 3 ? 15.0 : 0.0; });
    Scene s = scene_of_one_gamma(4321.7, -3456.1, 1300, 8000);
    s.gamma.reset();
    s.azimuth_bins = 160;
    s.radar = RadarParams{};
    const RunResult one = simulate(s, source, 1, 1);
    CHECK(test::sum_of(one.echo_w) > 0);
    for (const auto& [wedges, threads] : {std::pair{1, 2}, {7, 1}, {7, 2}, {64, 2}}) {
        INFO(wedges << " wedges, " << threads << " threads");
        const RunResult other = simulate(s, source, wedges, threads);
        CHECK(other.echo_w.cells == one.echo_w.cells);
        CHECK(other.echo_state.cells == one.echo_state.cells);
        CHECK(other.scope.grey == one.scope.grey);
    }
}

TEST_CASE("the same bits for any number of wedges where spokes double often", "[wedges][threads][long]") {
    // Rough ground far out, few azimuth bins, the sensor on a corner of posts, every quality, and lines of one axis alone.
    std::mt19937 random(9);
    std::vector<float> noise(std::size_t{601} * 501);
    for (float& z : noise) z = static_cast<float>(random() % 300);
    MemorySource source(601, 501, 30, [&](double c, double r) {
        return static_cast<double>(noise[static_cast<std::size_t>(r * 601 + c)]) + 0.5 * c;
    });
    for (const auto& [quality, one_axis] : {std::pair{Quality::draft, true},
                                            {Quality::draft, false},
                                            {Quality::normal, false},
                                            {Quality::fine, false},
                                            {Quality::exact, false}})
        for (const std::int64_t bins : {5, 360}) {
            Scene s = scene_of_one_gamma(9000, -12000, 2500, 30000);
            s.azimuth_bins = bins;
            s.quality = quality;
            if (one_axis) s.crossings = s.curved_course = false;
            const RunResult one = simulate(s, source, 1, 1);
            for (const std::int64_t wedges : {7, 360}) {
                INFO(word(quality) << (one_axis ? ", one axis, " : ", ") << bins << " bins, " << wedges << " wedges");
                const RunResult other = simulate(s, source, wedges, 2);
                CHECK(other.echo_w.cells == one.echo_w.cells);
                CHECK(other.echo_state.cells == one.echo_state.cells);
            }
        }
}

TEST_CASE("no wedge holds more than the plan grants it", "[wedges][plan][long]") {
    std::mt19937 random(41);
    std::uniform_real_distribution<double> any(0, 1);
    double fullest = 0;
    for (int turn = 0; turn < 24; ++turn) {
        const bool polar = turn % 4 == 3;  // a degree of longitude is a tenth of one of latitude there
        const std::int64_t columns = 100 + static_cast<std::int64_t>(any(random) * (polar ? 1500 : 500)),
                           rows = 100 + static_cast<std::int64_t>(any(random) * 400);
        MemorySource source(columns, rows, 30, [](double c, double r) { return std::fmod(7 * c + 3 * r, 50.0); });
        if (turn % 2) source.set_culture_height([](double c, double) { return std::fmod(c, 9.0) < 2 ? 5.0 : 0.0; });
        if (turn % 3 == 0) source.set_classes([](double c, double) { return 1 + static_cast<int>(c) % 3; });
        Scene s;
        const double column = (1.4 * any(random) - 0.2) * static_cast<double>(columns),
                     row = (1.4 * any(random) - 0.2) * static_cast<double>(rows);
        if (polar) {
            source.set_degrees(20, 84, 1.0 / 1200, 1.0 / 1200);
            s.platform.latlon = LatLon{84 - row / 1200, 20 + column / 1200};
        } else {
            s.platform.xy = PointXY{30 * column, -30 * row};
        }
        s.platform.altitude_m = 300 + 3000 * any(random);
        s.range_m = 3000 + 12000 * any(random);
        s.display.size = 64;
        s.quality = turn % 4 == 1 ? Quality::exact : Quality::normal;
        const ResolvedScene resolved = resolve(s, source);
        const DataBase& db = source.data_base();
        EngineParams params;
        params.threads = 1;
        params.wedges = 1 + static_cast<std::int64_t>(30 * any(random) * any(random));
        const RunResult r = run(resolved, source, params);
        const SpokeMap map(
            db, {resolved.geometry, resolved.nadir, resolved.lat_deg, resolved.lon_deg, s.earth_k, *s.range_m * 1.001});
        const SpokeGrid grid(db, map, sampling_of(resolved, db), resolved.swept.circle_bins);
        const Plan granted = plan(resolved, source, grid, params, 1);
        for (const WedgeReport& wedge : r.report.wedges) {
            INFO("turn " << turn << ", " << columns << " x " << rows << ", " << r.report.wedges.size() << " wedges");
            CHECK(wedge.peak_bytes <= granted.wedge_bytes);
            if (granted.wedge_bytes > (std::size_t{4} << 20))
                fullest =
                    std::max(fullest, static_cast<double>(wedge.peak_bytes) / static_cast<double>(granted.wedge_bytes));
        }
    }
    CHECK(fullest > 0.8);  // and the grant is no wild guess
}

TEST_CASE("wedges change no bit where spokes bend and some cross two columns between two rows", "[wedges][long]") {
    // Flat, with single bumps: of a tile all but a few spokes are plainly visible, and some of those wait that are not.
    MemorySource source(1200, 1200, 30, [](double c, double r) {
        const double x = std::fmod(c, 37.0) - 18, y = std::fmod(r, 41.0) - 20;
        return 25 * std::max(0.0, 1 - 0.2 * (x * x + y * y));
    });
    source.set_degrees(20, 78.85, 1.0 / 720, 1.0 / 3600);
    Scene s;
    s.platform.latlon = LatLon{78.69, 20.8};
    s.platform.altitude_m = 4000;
    s.range_m = 16000;
    s.azimuth_bins = 160;
    s.range_bin_m = 150;
    s.display.size = 64;
    s.detail = false;
    for (const Quality quality : {Quality::normal, Quality::exact}) {
        s.quality = quality;
        const ResolvedScene resolved = resolve(s, source);
        EngineParams params;
        params.threads = 1;
        params.wedges = 1;
        const RunResult whole = run(resolved, source, params);
        params.wedges = 7;
        const RunResult parts = run(resolved, source, params);
        CHECK((whole.echo_w.cells == parts.echo_w.cells));
        CHECK((whole.echo_state.cells == parts.echo_state.cells));
        CHECK(whole.report.wedges.front().visible_pieces > 1000000);
    }
}

TEST_CASE("with several threads the last wedges are narrower, and all together are the swept bins", "[wedges][long]") {
    MemorySource source(200, 200, 30, test::rolling(300, 90, 5));
    Scene s;
    s.platform.xy = PointXY{30 * 100, -30 * 100};
    s.platform.altitude_m = 1500;
    s.range_m = 5000;
    s.display.size = 64;
    const ResolvedScene resolved = resolve(s, source);
    const Interval all = resolved.swept.azimuth_bins;
    const auto sizes = [&](int threads, std::int64_t wedges) {
        EngineParams params;
        params.threads = threads;
        params.wedges = wedges;
        const RunResult r = run(resolved, source, params);
        std::vector<std::int64_t> bins;
        std::int64_t end = all.begin;
        for (const WedgeReport& wedge : r.report.wedges) {
            REQUIRE(wedge.azimuth_bins.begin == end);
            end = wedge.azimuth_bins.end;
            bins.push_back(wedge.azimuth_bins.size());
        }
        REQUIRE(end == all.end);
        return bins;
    };
    REQUIRE(all.size() == 960);
    using Sizes = std::vector<std::int64_t>;
    CHECK(sizes(1, 0) == Sizes(16, 60));
    Sizes two(14, 60);
    for (const std::int64_t more : {30, 30, 15, 15, 15, 15}) two.push_back(more);
    CHECK(sizes(2, 0) == two);
    CHECK(sizes(2, 3) == Sizes{320, 320, 320});  // as asked for
    // As narrow as there are bins.
    const Sizes many = sizes(100, 0);
    CHECK(std::count(many.begin(), many.end(), 0) == 0);
    CHECK(many.back() == 1);
}

TEST_CASE("a run reads and holds what its plan says, if nothing is left out", "[wedges][plan][long]") {
    MemorySource source(500, 420, 30, test::rolling(300, 90, 5));
    source.set_culture_height([](double c, double) { return std::fmod(c, 9.0) < 2 ? 5.0 : 0.0; });
    source.set_classes([](double c, double) { return 1 + static_cast<int>(c) % 3; });
    Scene s;
    s.platform.xy = PointXY{30 * 210.2, -30 * 199.7};
    s.platform.altitude_m = 900;
    s.display.size = 64;
    s.spokes_per_bin = 2;  // so few that they double within range, which the plan makes room for
    for (const double range : {2500.0, 5000.0, 12000.0}) {
        s.range_m = range;
        for (const std::int64_t wedges : {1, 9}) {
            EngineParams params;
            params.threads = 1;
            params.wedges = wedges;
            params.cull = false;
            const ResolvedScene resolved = resolve(s, source);
            const WedgeForecast planned = plan(resolved, source, params).total();
            const RunResult r = run(resolved, source, params);
            std::uint64_t chunks = 0, posts = 0, bytes = 0;
            for (const WedgeReport& w : r.report.wedges) {
                chunks += w.chunks;
                posts += w.posts_read;
                bytes += w.bytes_read;
            }
            INFO("range " << range << ", wedges " << wedges);
            CHECK(static_cast<double>(chunks) == Approx(static_cast<double>(planned.chunks)).epsilon(0.05));
            CHECK(static_cast<double>(posts) == Approx(static_cast<double>(planned.posts)).epsilon(0.05));
            CHECK(static_cast<double>(bytes) == Approx(static_cast<double>(planned.bytes)).epsilon(0.2));
            CHECK(static_cast<double>(r.report.peak_held_bytes) ==
                  Approx(static_cast<double>(planned.peak_bytes)).epsilon(0.2));
        }
    }
}

TEST_CASE("class tiles stay while chunks lie over them, and no longer", "[wedges]") {
    MemorySource source(1000, 700, 30, [](double, double) { return 0; });
    source.set_classes([](double c, double r) { return (static_cast<int>(c) / 3 + static_cast<int>(r) / 5) % 16; });
    const DataBase& db = source.data_base();
    Culture culture(db, &source);
    const auto right = [&](const Window& posts) {
        for (std::int64_t r = posts.rows.begin; r < posts.rows.end; r += 7)
            for (std::int64_t c = posts.columns.begin; c < posts.columns.end; c += 5)
                if (culture.at(c, r) != static_cast<ClassId>((c / 3 + r / 5) % 16)) return false;
        return true;
    };
    const auto read_for = [&](const Window& posts) {
        const std::uint64_t before = culture.bytes_read();
        culture.open(posts, true);
        CHECK(right(posts));
        const Window tiles = Culture::tiles_under(db, posts);
        CHECK(culture.bytes() ==
              static_cast<std::size_t>(tiles.posts() * db.culture_tile_columns * db.culture_tile_rows));
        return culture.bytes_read() - before;
    };
    const Window west{{10, 500}, {10, 240}}, east{{300, 760}, {10, 240}}, south{{300, 760}, {300, 500}};
    const auto bytes_beside = [&](const Window& posts, const Window& at_hand) {
        const Window tiles = Culture::tiles_under(db, posts), held = Culture::tiles_under(db, at_hand);
        const Window both{intersection(tiles.columns, held.columns), intersection(tiles.rows, held.rows)};
        return static_cast<std::uint64_t>((tiles.posts() - (both.empty() ? 0 : both.posts())) *
                                          db.culture_tile_columns * db.culture_tile_rows);
    };
    const Window none{{900, 901}, {600, 601}};
    CHECK(read_for(west) == bytes_beside(west, none));
    CHECK(read_for(west) == 0);
    CHECK(bytes_beside(east, west) < bytes_beside(east, none));
    CHECK(read_for(east) == bytes_beside(east, west));
    CHECK(read_for(south) == bytes_beside(south, east));
    CHECK(read_for(east) == bytes_beside(east, south));
    culture.forget();
    CHECK(culture.bytes() == 0);
    CHECK(read_for(east) == bytes_beside(east, none));
}
