// Scans: pictures whose azimuths are seen from wherever the sensor is when the antenna comes round to them.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "lib/engine.hpp"
#include "lib/track.hpp"
#include "tests/terrain.hpp"
#include "tests/tracks.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

TEST_CASE("a scan by a sensor that stands is the plain picture, bit for bit", "[track][long]") {
    const auto hills = rolling(300, 40, 11);
    // Behind the sector across north mountains as high as the sensor, which ask for more spokes.
    MemorySource source(201, 201, 60, [&](double c, double r) { return 200 + hills(c, r) + (r > 110 ? 500 : 0); });
    Scene s = plane_scene(6010, -5980);
    s.radar.beam_width_error = s.radar.pulse_length_error = true;
    s.azimuth_bins.reset();
    s.receiver.noise = true;
    s.receiver.speckle_looks = 2;
    const Track track = read("time,x,y,altitude-msl\n0,6010,-5980,800\n1,6010,-5980,800\n");
    // All round; a sector across north; one so wide that the beam's skirts meet behind it.
    for (const auto& [from, to] : {std::pair(0.0, 360.0), {-40.0, 35.0}, {-170.0, 175.0}}) {
        s.sector = Sector{Angle::degrees(from), Angle::degrees(to)};
        if (from == -170.0) s.spokes_per_bin = 2;  // a few: what is compared are bits
        const ResolvedScene whole = resolve(s, source);
        const RunResult plain = run(whole, source, EngineParams{});
        for (const std::int64_t step : {7, 100, 5000}) {
            EngineParams params;
            params.threads = 2;
            params.wedges = 3;
            const RunResult scanned = run(whole, scan_along(track, 0, step, 4, whole, source), source, params, {});
            INFO(from << " to " << to << ", " << step << " bins at a time");
            CHECK(scanned.echo_w.grid == plain.echo_w.grid);
            CHECK(scanned.echo_w.cells == plain.echo_w.cells);
            CHECK(scanned.echo_state.cells == plain.echo_state.cells);
            CHECK(scanned.power_w.cells == plain.power_w.cells);
            CHECK(scanned.state.cells == plain.state.cells);
            CHECK(scanned.scope.grey == plain.scope.grey);
            CHECK(scanned.sampling.spokes_per_bin == plain.sampling.spokes_per_bin);
        }
    }
}

TEST_CASE("a scan by a sensor that climbs, in bins of ground range, is its groups side by side", "[track][long]") {
    const auto hills = rolling(300, 40, 11);
    MemorySource source(201, 201, 60, [&](double c, double r) { return 200 + hills(c, r); });
    Scene s = plane_scene(6010, -5980);
    s.radar.beam_width_error = s.radar.pulse_length_error = true;
    s.display.kind = DisplayKind::gpi_true;
    s.range_start_m = 1500;
    s.azimuth_bins = 240;
    const Track track = read("time,x,y,altitude-msl\n0,6010,-5980,800\n4,6010,-5980,2800\n");
    const ResolvedScene whole = resolve(s, source);
    const Scan scan = scan_along(track, 0, 50, 4, whole, source);
    const RunResult scanned = run(whole, scan, source, EngineParams{}, {});
    std::vector<std::int64_t> begins;
    for (std::int64_t bin = 0; bin < 240; bin += 50) {
        const ResolvedScene place = scan.at({bin, std::min<std::int64_t>(bin + 50, 240)});
        begins.push_back(place.swept.range_bins.begin);
        const RunResult alone = run(place, source, EngineParams{});
        for (std::size_t i = 0; i < place.shown.azimuth_count(); ++i) {
            const std::size_t row = static_cast<std::size_t>(bin) + i;
            REQUIRE(std::equal(alone.power_w.row(i), alone.power_w.row(i) + place.shown.range_count(),
                               scanned.power_w.row(row)));
            const std::int64_t from = std::max(begins.back(), whole.swept.range_bins.begin);
            const std::size_t own = alone.echo_w.grid.row_of(bin + static_cast<std::int64_t>(i));
            REQUIRE(std::equal(alone.echo_w.row(own) + (from - begins.back()),
                               alone.echo_w.row(own) + alone.echo_w.grid.range_count(),
                               scanned.echo_w.row(row) + (from - whole.swept.range_bins.begin)));
        }
    }
    CHECK(begins.back() < begins.front());  // the pulse is longer on the ground from aloft
}

TEST_CASE("a scan shows a peak where it stands from the place at which its azimuth is looked at", "[track][long]") {
    // Peaks 120 m high, one post wide, on a plane; the sensor flies north-east at 300 m/s through a turn of 8 s.
    constexpr double post = 25, period = 8, east = 240, north = 180, height = 800;
    const std::vector<std::pair<int, int>> peaks = {{230, 60},  {330, 140}, {345, 262},
                                                    {250, 360}, {90, 340},  {60, 150}};
    MemorySource source(401, 401, post, [&](double c, double r) {
        for (const auto& [pc, pr] : peaks)
            if (c == pc && r == pr) return 120.0;
        return 0.0;
    });
    const double x0 = 4800, y0 = -5200;
    const Scene s = plane_scene(x0, y0);
    std::ostringstream table;
    table << "time,x,y,altitude-msl\n0," << x0 << ',' << y0 << ',' << height << "\n100," << x0 + 100 * east << ','
          << y0 + 100 * north << ',' << height << '\n';
    const Track track = read(table.str());
    const ResolvedScene whole = resolve(s, source);
    EngineParams params;
    params.threads = 2;
    constexpr std::int64_t step = 4;
    const RunResult scanned = run(whole, scan_along(track, 0, step, period, whole, source), source, params, {});
    const RunResult plain = run(whole, source, params);
    const double bin_rad = whole.shown.azimuth_step_rad();
    for (const auto& [pc, pr] : peaks) {
        const double px = pc * post, py = -pr * post;
        // The group of azimuths in which its place lies, seen from where the sensor is then.
        std::int64_t found = -1;
        double azimuth = 0, range = 0;
        for (std::int64_t group = 0; group < 720; group += step) {
            const double t = static_cast<double>(group) / 720 * period;
            const double dx = px - (x0 + east * t), dy = py - (y0 + north * t);
            const double a = std::fmod(std::atan2(dx, dy) + 2 * std::numbers::pi, 2 * std::numbers::pi);
            if (a < static_cast<double>(group) * bin_rad || a >= static_cast<double>(group + step) * bin_rad) continue;
            CHECK(found < 0);
            found = group;
            azimuth = a;
            range = std::sqrt(dx * dx + dy * dy + (height - 60) * (height - 60));
        }
        REQUIRE(found >= 0);
        // The brightest cell near there stands out of the plain: within a bin of the azimuth, a post and a bin in range.
        const auto row = static_cast<std::int64_t>(azimuth / bin_rad), column = static_cast<std::int64_t>(range / 25);
        const auto brightest = [&](const RunResult& r) {
            double best = 0;
            std::pair<std::int64_t, std::int64_t> at;
            for (std::int64_t i = -6; i <= 6; ++i)
                for (std::int64_t j = -12; j <= 12; ++j) {
                    const auto a = static_cast<std::size_t>((row + i + 720) % 720),
                               c = static_cast<std::size_t>(column + j);
                    const double value = static_cast<double>(r.echo_w.row(a)[c]);
                    if (value > best) best = value, at = {i, j};
                }
            return std::pair(at, best);
        };
        INFO("peak " << pc << ", " << pr << ": azimuth " << azimuth * 180 / std::numbers::pi << " deg, range " << range
                     << " m");
        const auto [at, power] = brightest(scanned);
        CHECK(std::abs(at.first) <= 1);
        CHECK(std::abs(at.second) <= 2);
        const auto background = static_cast<std::size_t>(column - 12);
        CHECK(power > 2 * static_cast<double>(scanned.echo_w.row(static_cast<std::size_t>(row))[background]));
        // From where the sensor was at first it stands elsewhere, once the sensor has moved.
        const double dx = px - x0, dy = py - y0;
        const double moved_m = std::abs(std::sqrt(dx * dx + dy * dy + (height - 60) * (height - 60)) - range),
                     turned = std::abs(std::remainder(std::atan2(dx, dy) - azimuth, 2 * std::numbers::pi));
        if (found > 60) CHECK((moved_m > 100 || turned > 4 * bin_rad));
        const double there =
            static_cast<double>(plain.echo_w.row(static_cast<std::size_t>(row))[static_cast<std::size_t>(column)]);
        CHECK(there < power / 2);
    }
}

TEST_CASE("the program scans along a track", "[track]") {
    const Folder folder;
    draw_data(folder);
    // The same place all the time, then 250 m/s.
    write_track(folder, {{"0", "468200", "3752000", "900", "30"},
                         {"4", "468200", "3752000", "900", "30"},
                         {"8", "469200", "3752000", "900", "30"}});
    const std::vector<std::string> track = {"--track", folder / "track.csv", "--sector", "-60deg,60deg"};
    for (const char* name : {"plain", "scan"}) std::filesystem::create_directory(folder / name);
    const Ended plain = simulate(folder, with(track, {"--power", folder / "plain/p.tif"}));
    INFO(plain.err);
    REQUIRE(plain.code == 0);
    const Ended scan = simulate(folder, with(track, {"--power", folder / "scan/p.tif", "--scan-step", "16",
                                                     "--scan-period", "4s", "--threads", "2"}));
    INFO(scan.err);
    REQUIRE(scan.code == 0);
    const auto cells = [&](const std::string& path) { return Bands(path).cells(1); };
    CHECK(cells(folder / "plain/p_0001.tif") == cells(folder / "scan/p_0001.tif"));
    write_track(folder, {rows[0]});
    const Ended stands = simulate(folder, with(track, {"--power", folder / "scan/q.tif", "--scan-step", "16",
                                                       "--scan-period", "4s", "--quiet=off"}));
    CHECK(stands.code == 0);
    CHECK_THAT(stands.err, Contains("scan-step has no effect: a track of one row"));
    const auto still = cells(folder / "plain/p_0002.tif"), moved = cells(folder / "scan/p_0002.tif");
    REQUIRE(still.size() == moved.size());
    CHECK(std::equal(still.begin(), still.begin() + 100, moved.begin()));  // the first azimuth, before it has moved
    CHECK(still != moved);
}

TEST_CASE("a place of a scan that cannot be is found before work begins", "[track]") {
    const Folder folder;
    draw_data(folder);
    // It dives while the antenna turns: 900 m, and 40 m above the sea 4 s later, under hills of 300 m and more.
    write_track(folder, {{"0", "468200", "3752000", "900", "30"},
                         {"4", "468200", "3752000", "900", "30"},
                         {"8", "468300", "3752000", "40", "30"}});
    const Ended ended = simulate(
        folder, {"--track", folder / "track.csv", "-o", folder / "s.png", "--scan-step", "16", "--scan-period", "4s"});
    CHECK(ended.code == 2);
    CHECK_THAT(ended.err, Contains("line 3 (frame 2): 3.86667 s after the row's time: the sensor is ") &&
                              Contains("below the terrain"));
    CHECK(!std::filesystem::exists(folder / "s_0001.png"));
}

TEST_CASE("a scan over the antimeridian is that of a raster whose longitudes go on", "[track][long]") {
    const Folder folder;
    // Posts of a quarter of a degree all round the earth, or of the 20 degrees on both sides of 180.
    const auto draw_earth = [&](const std::string& name, double west, int columns) {
        Drawing d;
        d.columns = columns;
        d.rows = 120;
        d.geotransform = std::array<double, 6>{west - 0.125, 0.25, 0, 25, 0, -0.25};
        d.crs = "EPSG:4326";
        d.type = GDT_Int16;
        d.value = [&](int c, int r) {
            const int post = (c + static_cast<int>(std::lround(west * 4)) + 1440 * 2) % 1440;
            return std::round(900 * std::sin(post * 0.9) * std::cos(r * 0.7) + 900);
        };
        draw(folder / name, d);
    };
    draw_earth("round.tif", 160, 161);
    draw_earth("earth.tif", -180, 1440);
    const auto echo = [&](const std::string& dem, const std::string& x) {
        std::ofstream(folder / "t.csv") << "time,x,y,altitude-msl\n0,179.75,10,20000\n8," << x << ",10,20000\n";
        const Ended ended =
            run_program({program,   "simulate",       "--dem",         folder / dem, "--track",        folder / "t.csv",
                         "--power", folder / "p.tif", "--scan-step",   "30",         "--scan-period",  "8s",
                         "--range", "400km",          "--range-bin",   "2km",        "--azimuth-bins", "360",
                         "-q",      "--overwrite",    "--reproducible"},
                        folder / "log");
        INFO(dem << " " << x << ": " << ended.err);
        REQUIRE(ended.code == 0);
        const std::vector<float> values = Bands(folder / "p_0001.tif").cells(1);
        CHECK(std::count_if(values.begin(), values.end(), [](float v) { return v > 0; }) > 1000);
        return values;
    };
    const std::vector<float> truth = echo("round.tif", "180.25");
    CHECK(echo("round.tif", "-179.75") == truth);
    CHECK(echo("earth.tif", "-179.75") == echo("earth.tif", "180.25"));
}
