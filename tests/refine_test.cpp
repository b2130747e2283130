// Bins in doubt: what is taken for one, that it is swept again, and that this hangs on nothing but the scene.
#include "lib/refine.hpp"

#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <random>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "lib/engine.hpp"
#include "lib/plan.hpp"
#include "lib/track.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/every_target.hpp"
#include "tests/terrain.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/shared_source.hpp"
#include "tiles/sources.hpp"
#include "tiles/work_dir.hpp"

using namespace wedgescope;
using test::Drawing;
using test::Folder;

namespace {

using Halves = WedgeCells::Halves;

/// Range bins of one quantum; backscatter 1 and a share of one radian: `power` is what a cell takes, in W.
const Quanta bins = quanta({1000, 1100}, 1, 1, 1, 1, 1);

void add(WedgeCells& cells, std::int64_t row, std::int64_t spoke, std::size_t column, double power_w) {
    const double at = 1000.5 + static_cast<double>(column);
    cells.add({cells.row_of(row, spoke), {1, 0}}, {at, at, power_w, 0}, WedgeCells::Stretches::one(1));
}

/// From 965 m over the Santa Ana Mountains: a few glimpses of crests that look out of shadows.
Scene mountains() {
    Scene s;
    s.platform.latlon = LatLon{33.8573, -117.38912};
    s.platform.altitude_above = AltitudeAbove::ground;
    s.platform.altitude_m = 965;
    s.range_m = 12300;
    s.radar.antenna.beam = Angle::degrees(3);
    s.radar.pulse_s = 2e-6;
    s.range_start_m = 60 / Angle::degrees(3).rad();
    s.sector = Sector{Angle::degrees(234), Angle::degrees(279)};
    s.display.size = 64;
    s.quality = Quality::normal;
    return s;
}

std::uint64_t refined(const RunResult& run) {
    std::uint64_t bins_refined = 0;
    for (const WedgeReport& wedge : run.report.wedges) bins_refined += wedge.refined_bins;
    return bins_refined;
}

/// The data base is a raster of that many posts: ridges, and thickets of single posts, up to so high, that stand out of them.
DataBaseParams draw_thickets(const std::string& path, Drawing d, double most_m) {
    const auto ridges = test::rolling(700, 70, 3);
    std::mt19937 random(4);
    std::vector<double> towers(static_cast<std::size_t>(d.columns * d.rows));
    for (double& z : towers) z = static_cast<double>(random() % 1024) / 1024;
    d.value = [&](int c, int r) {
        const auto tower = [&](int column, int row) {
            return towers[static_cast<std::size_t>(row * d.columns + column)];
        };
        return 600 + std::abs(ridges(c, r)) + (tower(c / 9, r / 9) > 0.6 ? most_m * tower(c, r) : 0);
    };
    draw(path, d);
    DataBaseParams params;
    params.dem = path;
    return params;
}

/// 420 x 420 posts, 30 m apart.
DataBaseParams draw_thickets(const Folder& folder) {
    Drawing d;
    d.columns = d.rows = 420;
    d.geotransform = {{465000, 30, 0, 3755000, 0, -30}};
    return draw_thickets(folder / "thickets.tif", d, 120);
}

/// Low over the middle of it, all round, no nearer than 2 km.
Scene thickets() {
    Scene s;
    s.platform.xy = PointXY{471300, 3748700};
    s.platform.altitude_above = AltitudeAbove::ground;
    s.platform.altitude_m = 200;
    s.range_m = 6000;
    s.range_start_m = 2000;
    s.radar.antenna.beam = Angle::degrees(3);
    s.radar.pulse_s = 1e-6;
    s.display.size = 64;
    s.quality = Quality::draft;
    return s;
}

struct Way {
    std::int64_t wedges = 1;
    int threads = 1;
    bool cull = true;
};

RunResult simulate(const Scene& scene, WedgeSource& source, const Way& way = {}, EngineParams params = {}) {
    params.wedges = way.wedges;
    params.threads = way.threads;
    params.cull = way.cull;
    return run(resolve(scene, source), source, params);
}

/// Cells are not shown when they differ.
void check_same(const RunResult& other, const RunResult& whole) {
    CHECK((other.echo_w.cells == whole.echo_w.cells));
    CHECK((other.echo_state.cells == whole.echo_state.cells));
    CHECK((other.power_w.cells == whole.power_w.cells));
    CHECK((other.state.cells == whole.state.cells));
    CHECK(refined(other) == refined(whole));
}

/// By the row of its bin: was it swept again?
std::vector<bool> refined_rows(const Scene& scene, WedgeSource& source) {
    const std::int64_t count = resolve(scene, source).swept.azimuth_bins.size();
    std::vector<bool> rows;
    for (const WedgeReport& wedge : simulate(scene, source, {count}).report.wedges) {
        REQUIRE(wedge.azimuth_bins.size() == 1);
        rows.push_back(wedge.refined_bins > 0);
    }
    return rows;
}

}  // namespace

TEST_CASE("halves of cells add up to the whole, and a cleared row is as new", "[refine]") {
    std::mt19937 random(7);
    WedgeCells apart(4, bins, 1, Halves::apart), together(4, bins), even(4, bins), odd(4, bins);
    CHECK(apart.bytes() > together.bytes());
    const auto fill = [&](std::int64_t row, int count) {
        for (int i = 0; i < count; ++i) {
            const auto spoke = static_cast<std::int64_t>(random() % 9) - 4;
            const auto column = static_cast<std::size_t>(random() % 100);
            const double power_w = 1e-9 * static_cast<double>(1 + random() % 1000);
            add(apart, row, spoke, column, power_w);
            add(together, row, spoke, column, power_w);
            add(spoke % 2 == 0 ? even : odd, row, spoke, column, power_w);
            apart.mark({apart.row_of(row, spoke), {1, 0}}, 1000.5, 1010.5, bit_seen);
            together.mark({together.row_of(row, spoke), {1, 0}}, 1000.5, 1010.5, bit_seen);
        }
    };
    const auto check = [&] {
        for (std::size_t row = 0; row < 4; ++row) {
            std::array<float, 100> whole{}, sum{}, first{}, second{};
            std::array<std::uint8_t, 100> state{}, of_halves{};
            together.finish(row, whole.data(), state.data());
            apart.finish(row, sum.data(), of_halves.data());
            apart.halves(row, first.data(), second.data());
            CHECK(whole == sum);
            CHECK(state == of_halves);
            for (std::size_t j = 0; j < 100; ++j) {
                CHECK(apart.watts(row, j) == together.watts(row, j));
                CHECK(first[j] == static_cast<float>(even.watts(row, j)));
                CHECK(second[j] == static_cast<float>(odd.watts(row, j)));
            }
        }
    };
    for (std::int64_t row = 0; row < 4; ++row) fill(row, 500);
    check();
    for (WedgeCells* cells : {&apart, &together, &even, &odd}) cells->clear({1, 3});
    CHECK(apart.watts(0, 50) + apart.watts(3, 50) > 0);
    for (std::size_t j = 0; j < 100; ++j) CHECK(apart.watts(1, j) + apart.watts(2, j) == 0);
    check();
    fill(2, 200);
    check();
}

TEST_CASE("a row is in doubt by what its halves differ in, over a floor and among its bright cells", "[refine]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    constexpr double floor_w = 1e-9;
    const Refinement rule{0.08, 0.3, floor_w};
    constexpr std::size_t together = Refinement::pulse_bins;
    // Of cells with bins in front of them and none in doubt behind: the first one, which no other counts with.
    constexpr std::size_t others_from = 10;
    const auto mean = [](double w) { return 2 * w / static_cast<double>(together); };
    const auto doubted = [&](double even_w, double odd_w, std::size_t others, const Refinement& by) {
        WedgeCells cells(3, bins, 1, Halves::apart);
        add(cells, 1, 0, 0, even_w);
        add(cells, 1, 1, 0, odd_w);
        for (std::size_t j = 0; j < others; ++j)
            for (const std::int64_t spoke : {2, 3}) add(cells, 1, spoke, others_from + j, 100 * floor_w);
        return !rows_in_doubt(cells, {{0, 3}}, by).empty();
    };
    for (const double even_w : {8e-9, 4e-8, 4e-7})
        for (const double odd_w : {5.6e-9, 3.6e-8, 3.2e-7})
            for (const std::size_t others : {std::size_t{0}, std::size_t{40}, std::size_t{80}}) {
                const double a = mean(even_w) + floor_w, b = mean(odd_w) + floor_w,
                             db = 5 * std::abs(std::log10(a / b));
                const std::size_t bright = (others ? others + together - 1 : 0) + (a + b > 4 * floor_w ? 1 : 0);
                const double rms_db = db / std::sqrt(std::max(16.0, static_cast<double>(bright)));
                CAPTURE(even_w, odd_w, others, db, rms_db);
                if (std::abs(db / 0.3 - 1) < 0.03 || std::abs(rms_db / 0.08 - 1) < 0.03) continue;
                if (db > 5) continue;  // counts as less
                CHECK(doubted(even_w, odd_w, others, rule) == (db > 0.3 && rms_db > 0.08));
            }
    // A single spoke is what all of it is about; below the floor it does not matter, nor with a rule that is off.
    CHECK(doubted(4e-8, 0, 80, rule));
    CHECK_FALSE(doubted(4e-11, 0, 80, rule));
    CHECK_FALSE(doubted(4e-8, 0, 80, Refinement{}));
    // Echoes that arrive together count together: here as much from both halves, in bins that take turns.
    const auto in_turns_of = [&](std::size_t turn) {
        WedgeCells cells(1, bins, 1, Halves::apart);
        for (std::size_t j = 0; j < 100; ++j) add(cells, 0, static_cast<std::int64_t>(j / turn % 2), j, 1e-8);
        return !rows_in_doubt(cells, {{0, 1}}, {2, 0.3, floor_w}).empty();
    };
    CHECK_FALSE(in_turns_of(1));
    CHECK(in_turns_of(together));
}

TEST_CASE("rows in doubt come in order, neighbours together, of those asked for", "[refine]") {
    WedgeCells cells(9, bins, 1, Halves::apart);
    for (const std::int64_t row : {0, 1, 4, 5, 6, 8}) add(cells, row, 0, 50, 1e-6);
    const Refinement rule{0.08, 0.3, 1e-9};
    CHECK(rows_in_doubt(cells, {{0, 9}}, rule) == std::vector<Interval>{{0, 2}, {4, 7}, {8, 9}});
    CHECK(rows_in_doubt(cells, {{1, 5}, {5, 6}}, rule) == std::vector<Interval>{{1, 2}, {4, 6}});
}

TEST_CASE("bins in doubt are swept again, the same in every split", "[refine]") {
    const GdalSession session(32 << 20, {});
    DataBaseParams db;
    db.dem = WEDGESCOPE_TEST_DATA + std::string("/inland_empire_dem.tif");
    const auto source = open_direct_source(db);
    const auto simulate = [&](const Scene& scene, std::int64_t wedges, int threads, bool cull) {
        EngineParams params;
        params.wedges = wedges;
        params.threads = threads;
        params.cull = cull;
        return run(resolve(scene, *source), *source, params);
    };
    Scene scene = mountains();
    const RunResult whole = simulate(scene, 1, 1, true);
    const auto swept = static_cast<std::uint64_t>(whole.scene.swept.azimuth_bins.size());
    CHECK(refined(whole) > 0);
    CHECK(refined(whole) < swept);
    for (const auto& [wedges, threads, cull] :
         {std::tuple{5, 2, true}, std::tuple{1, 1, false}, std::tuple{static_cast<int>(swept), 1, true}}) {
        const RunResult other = simulate(scene, wedges, threads, cull);
        CAPTURE(wedges, threads, cull);
        CHECK(other.echo_w.cells == whole.echo_w.cells);
        CHECK(other.echo_state.cells == whole.echo_state.cells);
        CHECK(refined(other) == refined(whole));
    }
    // A part of the sector shows the same.
    scene.sector = Sector{Angle::degrees(246), Angle::degrees(258)};
    const RunResult part = simulate(scene, 1, 1, true);
    std::size_t same = 0;
    for (std::int64_t bin = part.scene.swept.azimuth_bins.begin; bin < part.scene.swept.azimuth_bins.end; ++bin) {
        const float* mine = part.echo_w.row(part.scene.swept.row_of(bin));
        const float* theirs = whole.echo_w.row(whole.scene.swept.row_of(bin));
        same += std::equal(mine, mine + part.scene.swept.range_count(), theirs) ? 1U : 0U;
    }
    CHECK(same == part.scene.swept.azimuth_count());
    // Who says how many spokes there are gets them.
    scene.spokes_per_bin = 8;
    CHECK(refined(simulate(scene, 1, 1, true)) == 0);
}

TEST_CASE("bins in doubt all round, over classes, canopy, water and voids, are the same in every split",
          "[long][refine]") {
    const GdalSession session(32 << 20, {});
    DataBaseParams db;
    const std::string data = WEDGESCOPE_TEST_DATA;
    db.dem = data + "/worcester_vermont_dem.tif";
    db.culture = data + "/worcester_vermont_culture.tif";
    db.legend = Legend::built_in("fbfm40");
    db.culture_height = data + "/worcester_vermont_canopy.tif";
    db.culture_height_scale = 0.1;
    const auto source = open_direct_source(db);
    Scene s;
    s.platform.latlon = LatLon{44.42, -72.56};
    s.platform.altitude_above = AltitudeAbove::ground;
    s.platform.altitude_m = 150;
    s.range_m = 4000;
    s.radar.antenna.beam = Angle::degrees(6);
    s.display.size = 64;
    s.quality = Quality::draft;
    s.far_shore = true;
    const ResolvedScene scene = resolve(s, *source);
    std::optional<RunResult> first;
    for (const auto& [wedges, threads, cull] :
         {std::tuple{1, 1, true}, std::tuple{7, 2, true}, std::tuple{240, 1, false}}) {
        EngineParams params;
        params.wedges = wedges;
        params.threads = threads;
        params.cull = cull;
        const std::size_t granted = plan(scene, *source, params).wedge_bytes;
        RunResult other = run(scene, *source, params);
        CAPTURE(wedges, threads, cull);
        for (const WedgeReport& wedge : other.report.wedges) CHECK(wedge.peak_bytes <= granted);
        CHECK(refined(other) > 0);
        if (first) {
            CHECK(other.echo_w.cells == first->echo_w.cells);
            CHECK(other.echo_state.cells == first->echo_state.cells);
            CHECK(refined(other) == refined(*first));
        } else {
            first.emplace(std::move(other));
        }
    }
}

TEST_CASE("bins in doubt are the same after a stop, in parts, and of wedges that were kept", "[refine]") {
    const GdalSession session(32 << 20, {});
    const Folder folder;
    const auto source = open_direct_source(draw_thickets(folder));
    const Scene scene = thickets();
    const RunResult whole = simulate(scene, *source);
    REQUIRE(refined(whole) > 4);
    const auto in = [&](const std::string& name, std::optional<Interval> only, Stop* stop) {
        WorkDir work(folder / name, WorkDir::Start::join);
        const ResolvedScene resolved = resolve(scene, *source);
        work.bind({"test", {}, echo_facts(resolved, source->data_base())});
        EngineParams params;
        params.archive = &work;
        params.only_wedges = only;
        params.stop = stop;
        if (stop)
            params.progress = [stop](double done) {
                if (done > 0.5) stop->request(15);
            };
        return simulate(scene, *source, {24, 2}, params);
    };
    const auto taken_up = [](const RunResult& run) {
        std::uint64_t bins = 0;
        for (const WedgeReport& wedge : run.report.wedges) bins += wedge.reused ? wedge.refined_bins : 0;
        return bins;
    };
    Stop stop;
    CHECK_THROWS_AS(in("stopped", {}, &stop), Interrupted);
    const RunResult resumed = in("stopped", {}, nullptr);
    check_same(resumed, whole);
    CHECK(taken_up(resumed) > 0);
    CHECK(taken_up(resumed) < refined(whole));

    for (const Interval only : {Interval{11, 17}, Interval{2, 7}}) CHECK(refined(in("parts", only, nullptr)) > 0);
    const RunResult merged = in("parts", {}, nullptr);
    check_same(merged, whole);
    CHECK(taken_up(merged) > 0);
    CHECK(taken_up(merged) < refined(whole));
    const RunResult again = in("parts", {}, nullptr);
    check_same(again, whole);
    CHECK(taken_up(again) == refined(whole));
}

TEST_CASE("bins in doubt are the same from blocks on disk, and of a part of the wedges alone", "[refine][long]") {
    const GdalSession session(4 << 20, {});
    const Folder folder;
    const DataBaseParams db = draw_thickets(folder);
    const auto direct = open_direct_source(db);
    const Scene scene = thickets();
    const RunResult whole = simulate(scene, *direct);
    REQUIRE(refined(whole) > 4);
    const std::string temporary = folder / "temporary";
    std::filesystem::create_directory(temporary);
    SpillOptions options;
    options.temp_folder = temporary;
    options.memory_bytes = std::size_t{1} << 20;
    const auto spilled = open_spilled_source(db, scene, options);
    CHECK(spilled->report().spilled_bytes > 0);
    for (const Way& way : {Way{}, Way{7, 2}, Way{60, 1, false}}) {
        CAPTURE(way.wedges, way.threads, way.cull);
        const RunResult other = simulate(scene, *spilled, way);
        check_same(other, whole);
        std::uint64_t again = 0;
        for (const WedgeReport& wedge : other.report.wedges) again += wedge.bytes_again;
        CHECK(again > 0);
    }
    // Sorted for a few bins alone, a spill holds what these and their finer spokes ask for.
    const std::vector<bool> rows = refined_rows(scene, *direct);
    const PolarGrid& swept = whole.scene.swept;
    std::size_t checked = 0;
    for (std::size_t row = 1; row + 1 < rows.size() && checked < 4; ++row) {
        if (!rows[row]) continue;
        ++checked;
        options.only = Arc{static_cast<double>(row) * swept.azimuth_step_rad(), swept.azimuth_step_rad()};
        const auto alone = open_spilled_source(db, scene, options);
        const ResolvedScene resolved = resolve(scene, *alone);
        WorkDir work(folder / "one", WorkDir::Start::over);
        work.bind({"test", {}, {}});
        EngineParams params;
        params.archive = &work;
        params.wedges = static_cast<std::int64_t>(rows.size());
        params.only_wedges = Interval{static_cast<std::int64_t>(row), static_cast<std::int64_t>(row) + 1};
        const RunResult one = run(resolved, *alone, params);
        CHECK(refined(one) == 1);
        const std::size_t n = swept.range_count();
        CHECK(std::equal(one.echo_w.row(row), one.echo_w.row(row) + n, whole.echo_w.row(row)));
        CHECK(std::equal(one.echo_state.row(row), one.echo_state.row(row) + n, whole.echo_state.row(row)));
    }
    CHECK(checked == 4);
}

TEST_CASE("bins in doubt of ground range are the same in every split", "[refine][long]") {
    const GdalSession session(32 << 20, {});
    const Folder folder;
    const auto source = open_direct_source(draw_thickets(folder));
    Scene scene = thickets();
    scene.display.kind = DisplayKind::gpi_true;
    const RunResult whole = simulate(scene, *source);
    CHECK(refined(whole) > 4);
    for (const Way& way : {Way{7, 2}, Way{1, 1, false}, Way{480, 2}}) {
        CAPTURE(way.wedges, way.threads, way.cull);
        check_same(simulate(scene, *source, way), whole);
    }
}

TEST_CASE("a sector that begins or ends between two bins in doubt sweeps the same", "[refine]") {
    const GdalSession session(32 << 20, {});
    DataBaseParams db;
    db.dem = WEDGESCOPE_TEST_DATA + std::string("/inland_empire_dem.tif");
    const auto source = open_direct_source(db);
    Scene scene = mountains();
    scene.radar.beam_width_error = false;  // no skirt: what is swept is what is shown
    const RunResult whole = simulate(scene, *source);
    const Interval all = whole.scene.swept.azimuth_bins;
    REQUIRE(whole.scene.shown.azimuth_bins == all);
    const std::vector<bool> rows = refined_rows(scene, *source);
    const auto azimuth = [&](std::size_t row) {
        return Angle::radians((static_cast<double>(all.begin) + static_cast<double>(row)) *
                              whole.scene.swept.azimuth_step_rad());
    };
    constexpr std::size_t wide = 8;
    std::size_t parts = 0;
    for (std::size_t row = wide; row + wide < rows.size(); ++row) {
        if (!rows[row] || !rows[row - 1] || rows[row - 2]) continue;
        ++parts;
        for (const std::size_t from : {row, row - wide}) {
            scene.sector = Sector{azimuth(from), azimuth(from + wide)};
            const RunResult part = simulate(scene, *source, {3});
            const PolarGrid& swept = part.scene.swept;
            CAPTURE(row, from);
            REQUIRE(swept.row_of(all.begin + static_cast<std::int64_t>(from)) == 0);
            REQUIRE(swept.azimuth_count() == wide);
            std::uint64_t in_doubt = 0;
            for (std::size_t i = 0; i < wide; ++i) {
                in_doubt += rows[from + i] ? 1U : 0U;
                const auto same = [&](const auto& mine, const auto& theirs) {
                    return std::equal(mine.row(i), mine.row(i) + swept.range_count(), theirs.row(from + i));
                };
                CHECK(same(part.echo_w, whole.echo_w));
                CHECK(same(part.echo_state, whole.echo_state));
            }
            CHECK(refined(part) == in_doubt);
        }
    }
    CHECK(parts > 1);
}

TEST_CASE("bins in doubt look past the seam of a raster round the whole earth", "[refine][long]") {
    const GdalSession session(32 << 20, {});
    const Folder folder;
    Drawing d;
    d.columns = 1440;
    d.rows = 160;
    d.crs = "EPSG:4326";
    d.geotransform = {{-180, 0.25, 0, 20, 0, -0.25}};
    const auto source = open_direct_source(draw_thickets(folder / "earth.tif", d, 9000));
    REQUIRE(source->data_base().cyclic);
    Scene scene = thickets();
    scene.platform.xy.reset();
    scene.platform.latlon = LatLon{1, 179.7};
    scene.platform.altitude_m = 100;
    scene.range_m = 1200e3;
    scene.range_start_m = 100e3;
    scene.range_bin_m = 2000;
    scene.radar.transmit_power_w = 1e9;
    const RunResult whole = simulate(scene, *source);
    CHECK(refined(whole) > 0);
    for (const Way& way : {Way{7, 2}, Way{1, 1, false}, Way{480, 2}}) {
        CAPTURE(way.wedges, way.threads, way.cull);
        check_same(simulate(scene, *source, way), whole);
    }
}

TEST_CASE("bins in doubt of a scan, and of a frame beside others, are those of the plain picture", "[refine][long]") {
    const GdalSession session(32 << 20, {});
    const Folder folder;
    SharedSource source(open_direct_source(draw_thickets(folder)), std::size_t{1} << 30);
    source.read(nullptr);
    const Scene scene = thickets();
    const ResolvedScene resolved = resolve(scene, source);
    const RunResult whole = simulate(scene, *open_direct_source(draw_thickets(folder)));
    REQUIRE(refined(whole) > 4);
    EngineParams params;
    params.beside_others = true;
    params.threads = 2;
    check_same(run(resolved, source, params), whole);
    const TrackPoint here{0, scene.platform.xy->x, scene.platform.xy->y, scene.platform.altitude_m, {}, 1};
    TrackPoint later = here;
    later.time_s = 1;
    const Track track(false, AltitudeAbove::ground, {here, later});
    for (const std::int64_t step : {60, 1000}) {
        CAPTURE(step);
        params.wedges = step == 60 ? 5 : 1;
        const RunResult scanned = run(resolved, scan_along(track, 0, step, 4, resolved, source), source, params, {});
        CHECK((scanned.echo_w.cells == whole.echo_w.cells));
        CHECK((scanned.echo_state.cells == whole.echo_state.cells));
        CHECK((scanned.power_w.cells == whole.power_w.cells));
        CHECK(refined(scanned) >= refined(whole));  // bins of a skirt belong to two groups
    }
}
