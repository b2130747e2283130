// What is left out because nothing can see it: never a bit of the result, and enough to be worth it.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <random>

#include "lib/cull.hpp"
#include "lib/engine.hpp"
#include "tests/every_target.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;
using namespace wedgescope::test;

namespace {

RunResult run_with(WedgeSource& source, const Scene& scene, bool cull, std::int64_t wedges, int threads = 1) {
    EngineParams params;
    params.cull = cull;
    params.wedges = wedges;
    params.threads = threads;
    return run(resolve(scene, source), source, params);
}

bool same_bits(const RunResult& a, const RunResult& b) {
    return a.echo_w.cells.size() == b.echo_w.cells.size() &&
           std::memcmp(a.echo_w.cells.data(), b.echo_w.cells.data(), a.echo_w.cells.size() * sizeof(float)) == 0 &&
           a.echo_state.cells == b.echo_state.cells;
}

std::uint64_t posts_skipped(const RunResult& r, Skip reason) {
    std::uint64_t sum = 0;
    for (const WedgeReport& w : r.report.wedges) sum += w.posts_skipped[static_cast<std::size_t>(reason)];
    return sum;
}

std::uint64_t samples(const RunResult& r) {
    std::uint64_t sum = 0;
    for (const WedgeReport& w : r.report.wedges) sum += w.samples;
    return sum;
}

}  // namespace

TEST_CASE("no ground within a block stands higher than its bound", "[cull]") {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> any(0, 1);
    double closest = 1;
    for (int turn = 0; turn < 20000; ++turn) {
        const double sensor = 20 + 12000 * any(random) * any(random), height = 9000 * any(random) - 400,
                     inverse = any(random) < 0.1 ? 0 : 1 / (6.3e6 + 3e6 * any(random)),
                     near = 400e3 * any(random) * any(random), far = near + 3000 * any(random);
        const double bound = highest_sine(sensor, height, near, far, inverse);
        for (int i = 0; i <= 20; ++i) {
            const double arc = near + (far - near) * i / 20, h = height - 50 * any(random) * any(random);
            if (arc == 0) continue;
            const double sine = sight_line(sensor, arc, h, inverse).sine;
            INFO("sensor " << sensor << ", height " << height << ", arc " << arc);
            REQUIRE(sine < bound);
            if (near > 10000) closest = std::min(closest, bound - sine);
        }
    }
    CHECK(closest < 1e-6);  // and it is no wild guess
}

TEST_CASE("spokes pass a line unsampled only where nothing before it comes over their horizons", "[cull]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(9);
    std::uniform_real_distribution<double> any(0, 1);
    int passed = 0, well_hidden = 0, well_hidden_passed = 0, voids = 0;
    for (int turn = 0; turn < 12000; ++turn) {
        // Few mostly, for all must be hidden.
        const std::size_t n = 1 + random() % (turn % 4 == 0 ? PassingLanes::most : 4);
        // Every seventh a plain far below the datum on a small earth, seen from below; every seventh far away.
        const bool deep = turn % 7 == 6, remote = turn % 7 == 5;
        const double level = deep ? -20000 * any(random) : 3000 * any(random) - 400,
                     rough = deep || turn % 3 == 0 ? 0.01 : 300 * any(random) * any(random),
                     sensor = deep ? level - 300 * any(random) : 10 + 12000 * any(random) * any(random),
                     near = remote ? 1e6 * any(random) : 30 + 300e3 * std::pow(any(random), 4),
                     post = 1 + 90 * any(random);
        const bool flat = any(random) < 0.1;
        const double radius = (deep ? 2e6 : remote ? 4e6 : 6.3e6) + 3e6 * any(random);
        const std::int64_t begin = static_cast<std::int64_t>(random() % 3000) - 1500;
        constexpr std::size_t posts = 130;
        const std::int64_t end = begin + static_cast<std::int64_t>(posts);
        std::vector<float> behind(posts), ahead(posts);
        for (auto* line : {&behind, &ahead})
            for (float& h : *line) h = static_cast<float>(level + rough * any(random));
        if (turn % 8 == 0) (turn % 16 ? ahead : behind)[random() % (n > 4 ? posts : 20)] = std::nanf("");
        std::vector<double> minor0(n), minor1(n), arc0(n), arc1(n), mode(n), horizon(n), inverse(n);
        // Some steeper than a post a line, so that they may meet three cells.
        const double start = static_cast<double>(begin) + 4 + 10 * any(random), steep = turn % 5 == 2 ? 2 : 1,
                     slope = steep * (2 * any(random) - 1), spacing = 0.4 + 0.8 * any(random),
                     gap = std::pow(10.0, -1 - 6 * any(random));
        bool all_hidden = true, clear = gap > 0.01;
        const auto height = [&](std::size_t i, double u) {
            const double y = minor0[i] + u * (minor1[i] - minor0[i]) - static_cast<double>(begin);
            const auto j = static_cast<std::size_t>(y);
            const double v = y - static_cast<double>(j), b0 = behind[j], b1 = behind[j + 1], a0 = ahead[j],
                         a1 = ahead[j + 1];
            return (1 - u) * (b0 + v * (b1 - b0)) + u * (a0 + v * (a1 - a0));
        };
        constexpr int looks = 33;
        for (std::size_t i = 0; i < n; ++i) {
            minor0[i] = start + static_cast<double>(i) * spacing;
            minor1[i] = minor0[i] + std::clamp(slope + 0.01 * static_cast<double>(i), -steep, steep);
            if (turn % 10 == 0) minor0[i] = std::floor(minor0[i]);
            // A bend so great that neighbours do not stand in order.
            if (turn % 9 == 1 && i == n / 2) {
                const double far = any(random) < 0.5 ? -3.5 : 12 + static_cast<double>(n) * spacing;
                minor0[i] = start + far;
                minor1[i] = minor0[i] + slope / 2;
            }
            inverse[i] = flat ? 0 : (1 + 0.003 * any(random)) / radius;
            arc0[i] = near;
            arc1[i] = near + post * (1 + 0.4 * any(random));
            mode[i] = any(random) < 0.1 ? mode_done : mode_hidden;
            if (turn % 20 == 3 && i == n / 2) mode[i] = any(random) < 0.5 ? mode_visible : mode_gap;
            all_hidden = all_hidden && (mode[i] == mode_hidden || mode[i] == mode_done);
            double most = -1;
            for (int k = 0; k <= looks; ++k) {
                const double u = static_cast<double>(k) / looks, arc = arc0[i] + u * (arc1[i] - arc0[i]);
                most = std::max(most, sight_line(sensor, arc, height(i, u), inverse[i]).sine);
            }
            const bool under = turn % 2 && any(random) < 0.5;
            horizon[i] = std::clamp(most + (under ? -gap : gap) * any(random), -1.0, 1.0);
            for (const double arc : {arc0[i], arc1[i]})
                clear = clear && horizon[i] > sight_line(sensor, arc, level + rough, inverse[i]).sine + 0.003;
        }
        const auto passes_in = [&](Interval b, Interval a) {
            return none_sees(n, mode.data()) &&
                   pass_hidden(n, sensor, {behind.data() + (b.begin - begin), b.begin, b.end},
                               {ahead.data() + (a.begin - begin), a.begin, a.end},
                               {minor0.data(), minor1.data(), arc0.data(), arc1.data(), mode.data(), horizon.data(),
                                inverse.data()});
        };
        const Interval whole{begin, end};
        const bool passes = passes_in(whole, whole);
        INFO("turn " << turn << ", " << n << " spokes, sensor " << sensor << ", arc " << near);
        if (passes) {
            ++passed;
            REQUIRE(all_hidden);
            for (std::size_t i = 0; i < n; ++i) {
                if (mode[i] == mode_done) continue;
                for (int k = 0; k <= looks; ++k) {
                    const double u = static_cast<double>(k) / looks, arc = arc0[i] + u * (arc1[i] - arc0[i]);
                    // Of a void it is none.
                    REQUIRE(sight_line(sensor, arc, height(i, u), inverse[i]).sine < horizon[i]);
                }
            }
            // Not where posts of either line are missing at either end.
            const auto cell = [](double minor) { return static_cast<std::int64_t>(std::floor(minor)); };
            const std::int64_t first = std::min(cell(minor0[0]), cell(minor1[0])),
                               last = std::max(cell(minor0[n - 1]), cell(minor1[n - 1])) + 1;
            for (const Interval cut : {Interval{begin, last}, Interval{first + 1, end}}) {
                CHECK_FALSE(passes_in(cut, whole));
                CHECK_FALSE(passes_in(whole, cut));
            }
        }
        if (turn % 8 == 0) voids += passes;
        if (clear && all_hidden && steep == 1 && turn % 8 != 0 && turn % 2 == 0 && turn % 9 != 1) {
            ++well_hidden;
            well_hidden_passed += passes;
        }
    }
    CHECK(passed > 2000);
    CHECK(voids > 50);  // voids that no spoke comes by
    CHECK(well_hidden > 100);
    CHECK(well_hidden_passed > 0.98 * well_hidden);
}

TEST_CASE("leaving out what is hidden changes no bit", "[cull][engine]") {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> any(0, 1);
    std::uint64_t hidden = 0, range = 0, voids = 0, samples_on = 0, samples_off = 0;
    for (int turn = 0; turn < 24; ++turn) {
        const auto columns = 150 + static_cast<std::int64_t>(any(random) * 400),
                   rows = 150 + static_cast<std::int64_t>(any(random) * 400);
        const auto shape = rolling(200 + 600 * any(random), 40 + 200 * any(random), static_cast<unsigned>(turn));
        const bool with_voids = turn % 3 == 1, antimeridian = turn % 5 == 4;
        const double void_column = any(random) * static_cast<double>(columns), void_row = any(random) * 300;
        MemorySource source(columns, rows, 30, [&](double c, double r) {
            if (with_voids && std::abs(c - void_column) < 60 && std::abs(r - void_row) < 45) return std::nan("");
            if (with_voids && std::fmod(c * 13 + r * 7, 977) < 1) return std::nan("");
            return std::round(shape(c, r) * 2) / 2;
        });
        if (turn % 2)
            source.set_culture_height([](double c, double r) { return std::fmod(c + r, 31) < 3 ? 15.0 : 0.0; });
        if (turn % 4 == 0) source.set_classes([](double c, double r) { return static_cast<int>(c / 9 + r / 11) % 16; });
        source.editable().block_columns = source.editable().block_rows = std::array{32, 64, 256}[turn % 3U];
        Scene s;
        const double column = (1.3 * any(random) - 0.15) * static_cast<double>(columns),
                     row = (1.3 * any(random) - 0.15) * static_cast<double>(rows);
        if (antimeridian) {
            source.set_degrees(179.9, 64, 1.0 / 1200, 1.0 / 1200);
            const double lon = 179.9 + column / 1200;
            s.platform.latlon = LatLon{64 - row / 1200, lon > 180 ? lon - 360 : lon};
        } else {
            s.platform.xy = PointXY{30 * column, -30 * row};
        }
        if (turn % 7 == 3 && !antimeridian) s.sector = Sector{Angle::degrees(20), Angle::degrees(110)};
        s.platform.altitude_m = std::max(0.0, std::isnan(shape(column, row)) ? 0 : shape(column, row)) + 60 +
                                1500 * any(random) * any(random);
        s.range_m = 4000 + 14000 * any(random);
        s.azimuth_bins = 360;
        s.display.size = 64;
        if (turn % 6 == 5) s.display.kind = DisplayKind::gpi_true;
        s.quality = std::array{Quality::exact, Quality::normal, Quality::draft, Quality::fine}[turn % 4U];
        if (turn % 4 == 2) s.crossings = s.curved_course = false;
        if (turn % 6 != 0) s.spokes_per_bin = 2;  // mostly a few: what is compared here are bits
        const RunResult all = run_with(source, s, false, 1);
        const RunResult leapt = run_with(source, s, true, 3);
        source.set_block_map();
        const RunResult one = run_with(source, s, true, 1), seven = run_with(source, s, true, 7, 2),
                        mapped = run_with(source, s, false, 4);
        INFO("turn " << turn << ", " << columns << " x " << rows);
        CHECK(same_bits(all, leapt));
        CHECK(same_bits(all, one));
        CHECK(same_bits(all, seven));
        CHECK(same_bits(all, mapped));
        hidden += posts_skipped(one, Skip::hidden);
        range += posts_skipped(one, Skip::range);
        voids += posts_skipped(one, Skip::voids);
        samples_on += samples(leapt);
        samples_off += samples(all);
        CHECK(posts_skipped(mapped, Skip::hidden) == 0);
    }
    CHECK(hidden > 50000);
    CHECK(range > 10000);
    CHECK(voids > 1000);
    CHECK(samples_on < samples_off);
}

TEST_CASE("a gap goes on past the border of a chunk whose blocks are nothing but voids", "[cull][engine]") {
    // Bands of voids that end a few posts behind a border: the block behind it is void only as far, and nobody asks for it with
    // the chunk before.
    const auto in_band = [](double at) { return (at >= 330 && at <= 388) || (at >= 93 && at <= 135); };
    const auto shape = rolling(300, 60, 3);
    const auto with_bands = [&](double c, double r) {
        return in_band(c) || in_band(r) ? std::nan("") : std::round(shape(c, r));
    };
    MemorySource open(480, 480, 30, with_bands), mapped(480, 480, 30, with_bands);
    mapped.set_block_map();
    for (MemorySource* source : {&open, &mapped}) source->editable().block_columns = source->editable().block_rows = 64;
    for (const double above : {20.0, 150.0, 800.0}) {
        Scene s;
        s.platform.xy = PointXY{30 * 232.0, -30 * 231.5};
        s.platform.altitude_m = shape(232, 231.5) + above;
        s.display.size = 64;
        s.spokes_per_bin = 2;
        INFO(above << " m above the ground");
        CHECK(same_bits(run_with(open, s, false, 1), run_with(mapped, s, true, 4)));
    }
}

TEST_CASE("spokes that bend out of the raster between two blocks' borders are not passed", "[cull][engine]") {
    // Posts of 5 km far north: a geodesic to the east leaves the parallel by a fifth of a post and more within a block, and with
    // it the raster.
    const auto shape = rolling(30, 20, 4);
    const auto ground = [&](double c, double r) { return std::round(shape(c, r)) + (c > 70 && c < 73 ? 2500 : 0); };
    MemorySource open(300, 74, 30, ground), mapped(300, 74, 30, ground);
    mapped.set_block_map();
    for (MemorySource* source : {&open, &mapped}) source->set_degrees(10, 72, 0.15, 0.05);
    std::uint64_t samples_on = 0, samples_off = 0;
    for (const int row : {2, 4, 6, 8, 65, 68, 71}) {
        Scene s;
        s.platform.latlon = LatLon{72 - 0.05 * row, 10 + 0.15 * 65};
        s.platform.altitude_m = shape(65, row) + 120;
        s.range_m = 700e3;
        s.range_bin_m = 5550;
        s.display.size = 64;
        s.spoke_lead = 1;
        s.spokes_per_bin = 24;
        INFO("row " << row);
        const RunResult all = run_with(open, s, false, 1), some = run_with(mapped, s, true, 4);
        CHECK(same_bits(all, run_with(open, s, true, 3)));
        CHECK(same_bits(all, some));
        samples_on += samples(some);
        samples_off += samples(all);
    }
    CHECK(samples_on < samples_off);
}

TEST_CASE("what lies more than a chunk behind a wall is never read", "[cull][engine]") {
    // A wall in the east, south and west of the sensor, 600 m high; open ground in the north.
    const auto walled = [](double c, double r) {
        const bool wall = (std::abs(c - 600) >= 150 && std::abs(c - 600) < 160 && r >= 440) ||
                          (r - 600 >= 150 && r - 600 < 160 && std::abs(c - 600) < 160);
        return wall ? 600.0 : 10.0 + std::fmod(c * 7 + r * 3, 5.0);
    };
    MemorySource source(1200, 1200, 30, walled), again(1200, 1200, 30, walled);
    again.set_block_map();
    Scene s;
    s.platform.xy = PointXY{30 * 600.5, -30 * 600.5};
    s.platform.altitude_m = 200;
    s.display.size = 64;
    const RunResult open = run_with(source, s, false, 4);
    const RunResult culled = run_with(again, s, true, 4);
    CHECK(same_bits(open, culled));
    constexpr std::int64_t chunk = 256;
    std::int64_t behind = 0, read = 0;
    for (std::int64_t far = 600 + 160 + chunk; far < 1200; ++far)
        for (std::int64_t across = 520; across < 680; ++across)
            for (const auto& [c, r] : {std::pair(far, across), std::pair(1200 - far, across), std::pair(across, far)}) {
                ++behind;
                read += again.was_read(c, r);
            }
    CHECK(behind > 50000);
    CHECK(read == 0);
    CHECK(again.was_read(600, 100));
    CHECK(4 * again.posts_read() < 3 * source.posts_read());
}
