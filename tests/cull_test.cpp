// What is left out because nothing can see it: never a bit of the result, and enough to be worth it.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <random>

#include "lib/cull.hpp"
#include "lib/engine.hpp"
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

TEST_CASE("leaving out what is hidden changes no bit", "[cull][engine]") {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> any(0, 1);
    std::uint64_t hidden = 0, range = 0, voids = 0, samples_on = 0, samples_off = 0;
    for (int turn = 0; turn < 30; ++turn) {
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
            DataBase& db = source.editable();
            db.crs_in_metres = false;
            db.has_crs = true;
            db.step_x = 1.0 / 1200;
            db.step_y = -1.0 / 1200;
            db.origin_x = 179.9;
            db.origin_y = 64;
            db.locate = [](double lat, double lon) {
                return IndexPosition{((lon < 0 ? lon + 360 : lon) - 179.9) * 1200, (64 - lat) * 1200};
            };
            db.lat_lon = [](double c, double r) {
                const double lon = 179.9 + c / 1200;
                return std::pair(64 - r / 1200, lon > 180 ? lon - 360 : lon);
            };
            const double lon = 179.9 + column / 1200;
            s.platform.latlon = LatLon{64 - row / 1200, lon > 180 ? lon - 360 : lon};
        } else {
            s.platform.xy = PointXY{30 * column, -30 * row};
        }
        if (turn % 7 == 3 && !antimeridian) s.sector = Sector{Angle::degrees(20), Angle::degrees(110)};
        s.platform.altitude_m = std::max(0.0, std::isnan(shape(column, row)) ? 0 : shape(column, row)) + 60 +
                                1500 * any(random) * any(random);
        s.range_m = 4000 + 14000 * any(random);
        s.display.size = 64;
        if (turn % 6 == 5) s.display.kind = DisplayKind::gpi_true;
        s.quality = std::array{Quality::exact, Quality::normal, Quality::draft, Quality::fine}[turn % 4U];
        s.spokes_per_bin = 2;  // a few: what is compared here are bits
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
