// Bins in doubt: what is taken for one, that it is swept again, and that this hangs on nothing but the scene.
#include "lib/refine.hpp"

#include <catch2/catch.hpp>

#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <tuple>

#include "lib/engine.hpp"
#include "lib/plan.hpp"
#include "tests/every_target.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/sources.hpp"

using namespace wedgescope;

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

TEST_CASE("bins in doubt all round, over classes, canopy, water and voids, are the same in every split", "[refine]") {
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
