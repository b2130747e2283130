// Levels of detail: which posts are kept, what is known of those left out, where levels are used, that they change no bit
// between one way of running a scene and another, and the error against the reference.
#include "lib/detail.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "lib/engine.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/process_bytes.hpp"
#include "tests/reference/reference_engine.hpp"
#include "tests/terrain.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/ground_map.hpp"
#include "tiles/shared_source.hpp"
#include "tiles/sources.hpp"
#include "tiles/tile_store.hpp"

using namespace wedgescope;
using test::draw;
using test::Drawing;
using test::Folder;

namespace {

const GdalSession session(std::size_t{64} << 20, {});

/// Residuals by their definition, cell by cell.
Residuals by_definition(const std::vector<float>& posts, std::int64_t stride, std::int64_t columns, std::int64_t rows) {
    Residuals out;
    for (int level = 1; level <= DetailLevels::most; ++level) {
        const std::int64_t edge = std::int64_t{1} << level;
        const auto at = [&](std::int64_t c, std::int64_t r) {
            return static_cast<double>(posts[static_cast<std::size_t>(r * stride + c)]);
        };
        double sum = 0, cubes = 0, count = 0, most = 0;
        for (std::int64_t r0 = 0; r0 + edge < rows && r0 < detail_posts; r0 += edge)
            for (std::int64_t c0 = 0; c0 + edge < columns && c0 < detail_posts; c0 += edge)
                for (std::int64_t r = 0; r < edge; ++r)
                    for (std::int64_t c = 0; c < edge; ++c) {
                        const double u = static_cast<double>(c) / static_cast<double>(edge),
                                     v = static_cast<double>(r) / static_cast<double>(edge);
                        const double top = at(c0, r0) * (1 - u) + at(c0 + edge, r0) * u,
                                     bottom = at(c0, r0 + edge) * (1 - u) + at(c0 + edge, r0 + edge) * u;
                        const double off = at(c0 + c, r0 + r) - (top * (1 - v) + bottom * v);
                        sum += off * off;
                        cubes += std::fabs(off * off * off);
                        count += 1;
                        most = std::max(most, std::fabs(off));
                    }
        out.rms_m[static_cast<std::size_t>(level - 1)] = static_cast<float>(count > 0 ? std::sqrt(sum / count) : 0);
        out.peak_m[static_cast<std::size_t>(level - 1)] = static_cast<float>(most);
        out.cube_m[static_cast<std::size_t>(level - 1)] = static_cast<float>(count > 0 ? std::cbrt(cubes / count) : 0);
    }
    return out;
}

constexpr int side = 1400;
constexpr double post_m = 5;

/// Rolling ground with fine detail.
double rolling_ground(int c, int r) {
    static const auto wide = test::rolling(30, 400, 5), narrow = test::rolling(1.5, 60, 7),
                      fine = test::rolling(0.1, 9, 9);
    return 200 + wide(c, r) + narrow(c, r) + fine(c, r);
}

Drawing ground(const std::function<double(int, int)>& height, int columns = side, int rows = side) {
    Drawing d;
    d.columns = columns;
    d.rows = rows;
    d.geotransform = {{500000, post_m, 0, 4100000, 0, -post_m}};
    d.value = height;
    d.creation = {"TILED=YES", "BLOCKXSIZE=256", "BLOCKYSIZE=256"};
    return d;
}

void tile(const std::string& raster, const std::string& store, std::int64_t tile_posts = 256) {
    TileStoreParams params;
    params.dems = {raster};
    params.output = store;
    params.tile_posts = tile_posts;
    params.memory_bytes = std::size_t{256} << 20;
    params.cache_bytes = std::size_t{16} << 20;
    params.software = "test";
    write_tile_store(params);
}

DataBaseParams base(const std::string& dem) {
    DataBaseParams params;
    params.dem = dem;
    params.cache_bytes = std::size_t{16} << 20;
    return params;
}

/// The ground map of the raster itself, of all of it or of the posts that levels of `scene` ask for.
DataBaseParams mapped(const std::string& dem, const Scene* scene = nullptr) {
    DataBaseParams params = base(dem);
    GroundMap::MakeParams make;
    make.threads = 3;
    if (scene) {
        const auto source = open_direct_source(params);
        make.posts = detail_window(resolve(*scene, *source), source->data_base());
    }
    params.ground = GroundMap::make(params, make);
    return params;
}

/// From over the raster's south-west, towards north-east.
Scene looking_north_east(double height_m) {
    Scene s;
    s.platform.xy = PointXY{500000 + 20.3 * post_m, 4100000 - (side - 30.7) * post_m};
    s.platform.altitude_m = height_m;
    s.azimuth_bins = 720;
    s.sector = Sector{Angle::degrees(20), Angle::degrees(70)};
    s.range_m = 6600;
    s.range_start_m = 1500;
    s.display.size = 64;
    return s;
}

bool same(const RunResult& a, const RunResult& b) {
    return a.echo_state.cells == b.echo_state.cells && a.echo_w.cells.size() == b.echo_w.cells.size() &&
           std::memcmp(a.echo_w.cells.data(), b.echo_w.cells.data(), a.echo_w.cells.size() * sizeof(float)) == 0;
}

std::uint64_t posts_of_level(const RunResult& r, bool coarse) {
    std::uint64_t sum = 0;
    for (const WedgeReport& w : r.report.wedges)
        for (std::size_t level = 0; level < w.level_posts.size(); ++level)
            if (coarse == (level > 0)) sum += w.level_posts[level];
    return sum;
}

RunResult simulated(const Scene& s, const DataBaseParams& rasters, const EngineParams& params = {}) {
    const auto source = open_direct_source(rasters);
    return run(resolve(s, *source), *source, params);
}
RunResult simulated(const Scene& s, const std::string& dem, const EngineParams& params = {}) {
    return simulated(s, base(dem), params);
}

reference::Comparison compared(const RunResult& on, const RunResult& off) {
    return reference::compare({on.power_w.cells.begin(), on.power_w.cells.end()},
                              {off.power_w.cells.begin(), off.power_w.cells.end()}, on.scene.noise_power_w);
}

reference::Comparison against(const RunResult& ours, const std::vector<double>& truth_w, double noise_w) {
    return reference::compare({ours.power_w.cells.begin(), ours.power_w.cells.end()}, truth_w, noise_w);
}

/// Power by the reference over the cells that `ours` shows.
std::vector<double> truth(const Scene& s, const std::string& dem, const RunResult& ours) {
    reference::Scene r;
    r.dem = dem;
    r.gamma = reference::project_gamma();
    r.by_xy = true;
    r.x = s.platform.xy->x;
    r.y = s.platform.xy->y;
    r.height_msl_m = ours.scene.sensor_m;
    const PolarGrid& grid = ours.power_w.grid;
    r.azimuth_bins = static_cast<int>(grid.circle_bins);
    r.first_azimuth_bin = static_cast<int>(grid.azimuth_bins.begin);
    r.azimuth_count = static_cast<int>(grid.azimuth_bins.size());
    r.range_bin_m = grid.range_bin_m;
    r.range_bins = static_cast<int>(grid.range_bins.end);
    r.pulse_s = s.radar.pulse_s;
    r.rays_per_bin = 24;  // converged to 0.03 dB: enough here
    r.step_posts = 0.25;
    const reference::Result found = reference::simulate(r);
    std::vector<double> power;
    for (std::size_t i = 0; i < found.power_w.size(); ++i)
        if (static_cast<std::int64_t>(i) % grid.range_bins.end >= grid.range_bins.begin)
            power.push_back(found.power_w[i]);
    return power;
}

/// Makes the map of a raster of so many rows from tiles, from strips with much and with little memory, and from strips as they are.
void check_maps(int rows) {
    // Round the earth, two pages and a bit across, voids.
    const Folder folder;
    Drawing d;
    d.columns = 9000;
    d.rows = rows;
    d.type = GDT_Int16;
    d.crs = "EPSG:4326";
    d.no_data = -7;
    d.geotransform = std::array<double, 6>{-180, 0.04, 0, 86, 0, -0.04};
    d.value = [](int c, int r) { return c % 700 < 3 && r % 90 == 0 ? -7 : (c * 7 + r * r) % 1900; };
    Drawing h = d;
    h.no_data = std::nullopt;
    h.value = [](int c, int r) { return (c / 3 + r) % 30; };
    const GroundMap::MakeParams none;
    std::vector<std::vector<BlockBounds>> bounds;
    std::vector<std::vector<Residuals>> residuals;
    std::vector<std::optional<Extremes>> extremes;
    struct Way {
        std::vector<std::string> creation;
        std::size_t memory_bytes;
    };
    for (const Way& way :
         {Way{{"TILED=YES"}, none.memory_bytes},
          Way{{"COMPRESS=DEFLATE", "ZLEVEL=1", "BLOCKYSIZE=7"}, none.memory_bytes},
          Way{{"COMPRESS=DEFLATE", "ZLEVEL=1", "BLOCKYSIZE=7"}, std::size_t{32} << 20}, Way{{}, none.memory_bytes}}) {
        d.creation = h.creation = way.creation;
        draw(folder / "dem.tif", d);
        draw(folder / "height.tif", h);
        DataBaseParams params = base(folder / "dem.tif");
        params.culture_height = folder / "height.tif";
        GroundMap::MakeParams make;
        make.threads = 3;
        make.memory_bytes = way.memory_bytes;
        double last = 0;
        make.progress = [&](double done) { last = done; };
        const std::uint64_t before = test::bytes_read();
        const auto map = GroundMap::make(params, make);
        CHECK(last == 1);
        if (rows > 4096 && !way.creation.empty() && way.creation[0] == "COMPRESS=DEFLATE") {
            const auto files = static_cast<double>(std::filesystem::file_size(folder / "dem.tif") +
                                                   std::filesystem::file_size(folder / "height.tif"));
            const double times = static_cast<double>(test::bytes_read() - before) / files;
            CAPTURE(times);
            CHECK((times < 2.5) == (way.memory_bytes == none.memory_bytes));
        }
        extremes.push_back(map->terrain_extremes());
        const auto blocks = map->block_map(1);
        const Window all = blocks_of({{0, d.columns}, {0, d.rows}});
        bounds.push_back(blocks->read(0, all).bounds);
        residuals.push_back(
            map->detail_map(1)->read({{0, (d.columns - 1) / detail_posts + 1}, {0, (d.rows - 1) / detail_posts + 1}}));
    }
    CHECK(std::any_of(bounds[0].begin(), bounds[0].end(), [](const BlockBounds& b) { return b.voids == Voids::some; }));
    for (std::size_t i = 1; i < bounds.size(); ++i) {
        CAPTURE(i);
        CHECK((bounds[i] == bounds[0]));
        CHECK((residuals[i] == residuals[0]));
        REQUIRE((extremes[i] && extremes[0]));
        CHECK(extremes[i]->lowest_m == extremes[0]->lowest_m);
        CHECK(extremes[i]->highest_m == extremes[0]->highest_m);
        CHECK(extremes[i]->void_posts == extremes[0]->void_posts);
    }
}

}  // namespace

TEST_CASE("a map of the ground is the same from strips, read once for all pages side by side, as from tiles",
          "[detail]") {
    check_maps(4300);  // two pages down
}

TEST_CASE("pages of one band of strips are made side by side", "[detail]") { check_maps(150); }

TEST_CASE("residuals are those of the definition, at any size of a block", "[detail][quick]") {
    const auto shape = test::rolling(23, 12, 3);
    for (const auto& [columns, rows] :
         {std::pair<std::int64_t, std::int64_t>{129, 129}, {129, 40}, {77, 129}, {5, 6}, {1, 1}, {34, 128}}) {
        const std::int64_t stride = columns + 3;
        std::vector<float> posts(static_cast<std::size_t>(stride * rows), 1e9F);
        for (std::int64_t r = 0; r < rows; ++r)
            for (std::int64_t c = 0; c < columns; ++c)
                posts[static_cast<std::size_t>(r * stride + c)] =
                    static_cast<float>(shape(static_cast<double>(c), static_cast<double>(r)));
        const Residuals found = residuals(posts.data(), stride, columns, rows),
                        wanted = by_definition(posts, stride, columns, rows);
        for (std::size_t i = 0; i < DetailLevels::most; ++i) {
            INFO(columns << " x " << rows << ", level " << i + 1);
            CHECK(found.rms_m[i] == Approx(wanted.rms_m[i]).epsilon(1e-4).margin(1e-6));
            CHECK(found.peak_m[i] == Approx(wanted.peak_m[i]).epsilon(1e-4).margin(1e-5));
            CHECK(found.cube_m[i] == Approx(wanted.cube_m[i]).epsilon(1e-4).margin(1e-6));
        }
        posts[static_cast<std::size_t>(rows / 2 * stride + columns / 2)] = test::void_post;
        CHECK(residuals(posts.data(), stride, columns, rows) == Residuals{});
    }
}

TEST_CASE("the error of a level grows with the echo over the noise, never falls as the beam narrows, and is finite",
          "[detail][quick]") {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> unit(0, 1);
    const auto between = [&](double from, double to) { return from * std::pow(to / from, unit(random)); };
    for (int i = 0; i < 3000; ++i) {
        DetailPlace place;
        place.range_m = between(500, 1e5);
        place.grazing_rad = between(0.005, 0.7);
        place.pulse_m = between(30, 900);
        place.along_m = place.across_m = between(1, 10);
        place.steepness = i % 7 == 0 ? 0 : between(0.01, 1);
        place.over_noise = i % 11 == 0 ? std::numeric_limits<double>::infinity() : between(1e-2, 1e9);
        const double rms_m = between(0.01, 20);
        if (4 * place.along_m > place.pulse_m) continue;
        double last = 0;
        for (place.beam_m = 20 * place.pulse_m; place.beam_m >= 4 * place.across_m; place.beam_m *= 0.93) {
            const double error = detail_error_db(place, 1, rms_m, 0);
            INFO("beam " << place.beam_m << ", pulse " << place.pulse_m << ", rms " << rms_m << ", grazing "
                         << place.grazing_rad);
            REQUIRE(std::isfinite(error));
            REQUIRE(error >= last * (1 - 1e-9));
            // On gentle ground the rise alone counts: sqrt(2) 4.34 dB of sigma over what a cell rises by.
            const double seen = 4.342944819 * std::sqrt(2 * 1.44 * 2 * place.across_m / place.beam_m) * rms_m /
                                (place.grazing_rad * place.pulse_m);
            REQUIRE((place.steepness > 0 ? error >= seen * (1 - 1e-9) : error == Approx(seen).epsilon(1e-9)));
            DetailPlace louder = place;
            louder.over_noise *= 10;
            REQUIRE(detail_error_db(louder, 1, rms_m, 0) >= error * (1 - 1e-9));
            last = error;
        }
        CHECK(std::isinf(detail_error_db(place, 3, rms_m, 0)));
    }
}

TEST_CASE("a level of a store is every 2^level-th post of the raster, across sheets of any size", "[detail][quick]") {
    const Folder folder;
    Drawing d;
    d.columns = 4096 + 77;
    d.rows = 333;
    d.value = [](int c, int r) { return (c * 37 + r * 101) % 9973 * 0.25; };
    draw(folder / "dem.tif", d);
    const std::int64_t tile_posts = GENERATE(64, 256, 1024);
    tile(folder / "dem.tif", folder / "store", tile_posts);
    const auto source = open_direct_source(base(folder / "store"));
    REQUIRE(source->detail_map());
    for (int level = 1; level <= DetailLevels::most; ++level)
        for (const bool lines_are_columns : {false, true}) {
            const Window all{{0, posts_at(d.columns, level)}, {0, posts_at(d.rows, level)}};
            const Chunk chunk = source->load({all, lines_are_columns, {}, {}, {}, level, {}});
            std::int64_t wrong = 0;
            for (std::int64_t r = 0; r < all.rows.end; ++r)
                for (std::int64_t c = 0; c < all.columns.end; ++c) {
                    const std::int64_t at = lines_are_columns ? c * all.rows.end + r : r * all.columns.end + c;
                    wrong += chunk.surface_m[static_cast<std::size_t>(at)] !=
                             static_cast<float>(d.value(static_cast<int>(c << level), static_cast<int>(r << level)));
                }
            INFO("level " << level);
            CHECK(wrong == 0);
        }
}

TEST_CASE("levels save most of the posts of fine ground and keep the promise", "[.][every-ground]") {
    const Folder folder;
    draw(folder / "dem.tif", ground(rolling_ground));
    tile(folder / "dem.tif", folder / "store");
    Scene s = looking_north_east(2600);
    const RunResult with = simulated(s, folder / "store");
    s.detail = false;
    const RunResult without = simulated(s, folder / "store");
    CHECK(posts_of_level(without, true) == 0);
    REQUIRE(posts_of_level(with, true) > 0);
    CHECK(with.report.skipped[static_cast<std::size_t>(Skip::detail)].bytes > 0);
    const auto read = posts_of_level(with, true) + posts_of_level(with, false);
    CHECK(2 * read < posts_of_level(without, false));
    // Normal promises 0.1 and 0.35 dB.
    const std::vector<double> wanted = truth(s, folder / "dem.tif", with);
    const auto error = against(with, wanted, with.scene.noise_power_w),
               bare = against(without, wanted, with.scene.noise_power_w);
    WARN("levels on: RMS " << error.rms_db << ", p99 " << error.p99_db << " dB; off: " << bare.rms_db << ", "
                           << bare.p99_db << "; posts " << read << " of " << posts_of_level(without, false));
    CHECK(error.rms_db < 0.1);
    CHECK(error.p99_db < 0.35);
    // The store without levels is the raster.
    CHECK(same(without, simulated(s, folder / "dem.tif")));
}

TEST_CASE("levels are the same for wedges, threads, memory, culling, tiles and source", "[detail]") {
    const Folder folder;
    // A rough corner, so that levels differ from fan to fan, up and down.
    draw(folder / "dem.tif", ground([](int c, int r) {
             return rolling_ground(c, r) + (c > 700 && c < 1000 && r < 900 ? (c * 7 + r * 13) % 17 : 0);
         }));
    tile(folder / "dem.tif", folder / "store");
    tile(folder / "dem.tif", folder / "small", 64);
    const Scene s = looking_north_east(2600);
    const RunResult one = simulated(s, folder / "store");
    REQUIRE(posts_of_level(one, true) > 0);
    REQUIRE(posts_of_level(one, false) > 0);
    for (const int wedges : {1, 7})
        for (const int threads : {1, 3})
            for (const bool cull : {true, false}) {
                EngineParams params;
                params.wedges = wedges;
                params.threads = threads;
                params.cull = cull;
                INFO(wedges << " wedges, " << threads << " threads, cull " << cull);
                CHECK(same(one, simulated(s, folder / "store", params)));
                CHECK(same(one, simulated(s, folder / "small", params)));
            }
    // A plain raster, whose maps were made for all of it or for this scene.
    CHECK(same(one, simulated(s, mapped(folder / "dem.tif"))));
    const DataBaseParams in_range = mapped(folder / "dem.tif", &s);
    CHECK(same(one, simulated(s, in_range)));
    SpillOptions on_disk;
    on_disk.temp_folder = folder / "";
    const auto sorted = open_spilled_source(in_range, s, on_disk);
    CHECK(same(one, run(resolve(s, *sorted), *sorted, {})));
    EngineParams little;
    little.memory_bytes = std::size_t{40} << 20;
    CHECK(same(one, simulated(s, folder / "store", little)));
    SpillOptions options;
    options.temp_folder = folder / "";
    const auto spilled = open_spilled_source(base(folder / "store"), s, options);
    REQUIRE(spilled->detail_map());
    CHECK(same(one, run(resolve(s, *spilled), *spilled, {})));
    SharedSource shared(open_direct_source(base(folder / "store")), std::size_t{1} << 30);
    shared.read(nullptr);
    REQUIRE(shared.keeps());
    CHECK(same(one, run(resolve(s, shared), shared, {})));
    // A sensor that stands still while its antenna turns.
    const auto source = open_direct_source(base(folder / "store"));
    const ResolvedScene whole = resolve(s, *source);
    const Scan scan{37, [&](Interval bins) {
                        ResolvedScene part = whole;
                        look_at(part, bins);
                        return part;
                    }};
    const RunResult turned = run(whole, scan, *source, {}, {});
    CHECK(turned.power_w.cells == one.power_w.cells);
}

TEST_CASE("voids and qualities that leave levels nothing are sampled post by post", "[detail]") {
    const Folder folder;
    Scene s = looking_north_east(2600);
    SECTION("a void here and there") {
        Drawing d = ground([](int c, int r) { return c % 100 == 50 && r % 100 == 50 ? -9999 : 200; });
        d.no_data = -9999;
        draw(folder / "dem.tif", d);
    }
    SECTION("exact") {
        draw(folder / "dem.tif", ground(rolling_ground));
        s.quality = Quality::exact;
    }
    tile(folder / "dem.tif", folder / "store");
    const RunResult on = simulated(s, folder / "store");
    CHECK(posts_of_level(on, true) == 0);
    s.detail = false;
    CHECK(same(on, simulated(s, folder / "store")));
}

TEST_CASE("a wall one post wide keeps its shadow", "[detail]") {
    const Folder folder;
    draw(folder / "dem.tif",
         ground([](int c, int r) { return rolling_ground(c, r) + (c == 803 && r > 500 && r < 900 ? 60 : 0); }));
    tile(folder / "dem.tif", folder / "store");
    Scene s = looking_north_east(1500);
    const RunResult on = simulated(s, folder / "store");
    s.detail = false;
    const RunResult off = simulated(s, folder / "store");
    CHECK(posts_of_level(on, true) > 0);
    // Hidden cells are those that every post shows hidden, but for its edges.
    std::size_t differ = 0, hidden = 0;
    for (std::size_t i = 0; i < on.state.cells.size(); ++i) {
        hidden += off.state.cells[i] == static_cast<std::uint8_t>(State::shadow);
        differ += off.state.cells[i] != on.state.cells[i];
    }
    CHECK(hidden > 300);
    CHECK(differ < on.state.cells.size() / 100);
    const auto both = compared(on, off);
    INFO("on against off: RMS " << both.rms_db << ", p99 " << both.p99_db << " dB, " << differ << " states");
    CHECK(both.rms_db < 0.1);
}

TEST_CASE("ground at all edges of a raster is there, whatever its size", "[detail]") {
    const Folder folder;
    const auto [columns, rows] = GENERATE(std::pair{1400, 1391}, std::pair{1401, 33}, std::pair{3, 1400});
    draw(folder / "dem.tif", ground(rolling_ground, columns, rows));
    const DataBaseParams rasters = mapped(folder / "dem.tif");
    Scene s = looking_north_east(1500);
    s.platform.xy = PointXY{500000 + (0.5 * columns + 0.2) * post_m, 4100000 - (0.5 * rows + 0.3) * post_m};
    s.sector.reset();
    s.range_start_m = 0;
    s.range_m = 9000;
    const RunResult on = simulated(s, rasters);
    s.detail = false;
    const RunResult off = simulated(s, rasters);
    INFO(columns << " x " << rows << ": " << posts_of_level(on, true) << " posts of levels");
    CHECK((posts_of_level(on, true) > 0) == (columns > 1000 && rows > 1000));
    CHECK(posts_of_level(on, true) + posts_of_level(on, false) <= posts_of_level(off, false));
    std::size_t seen = 0, lost = 0;
    for (std::size_t i = 0; i < on.echo_state.cells.size(); ++i) {
        const auto is = [&](const RunResult& r, State state) {
            return r.echo_state.cells[i] == static_cast<std::uint8_t>(state);
        };
        seen += is(off, State::seen);
        lost += is(off, State::seen) && !is(on, State::seen) && !is(on, State::shadow);
    }
    CHECK(seen > 100);
    CHECK(lost <= seen / 1000);
    CHECK(compared(on, off).rms_db < 0.06);
}

TEST_CASE("low dikes across the view keep their shadows", "[detail][quick]") {
    const Folder folder;
    struct Dikes {
        int every, width, shear;
        double high_m, sensor_m;
    };
    // One post wide and two, across the view and aslant, as high as the rule for peaks lets pass.
    const Dikes d = GENERATE(Dikes{150, 1, 0, 3, 200}, Dikes{100, 2, 0, 2, 150}, Dikes{100, 1, 0, 1.4, 120},
                             Dikes{64, 1, 0, 2, 200}, Dikes{65, 1, 0, 0.8, 70}, Dikes{150, 1, 3, 3, 200});
    draw(folder / "dem.tif", ground([&](int c, int r) {
             const int along = c + (d.shear ? r / d.shear : 0);
             return 200 + (along % d.every < d.width ? d.high_m : 0);
         }));
    const DataBaseParams rasters = mapped(folder / "dem.tif");
    Scene s = looking_north_east(200 + d.sensor_m);
    s.sector = Sector{Angle::degrees(60), Angle::degrees(100)};
    s.platform.xy->y += 500 * post_m;
    s.radar.pulse_s = 1e-6;
    s.range_start_m = 800;
    s.range_m = 5000;
    const RunResult on = simulated(s, rasters);
    s.detail = false;
    const RunResult off = simulated(s, rasters);
    const auto error = compared(on, off);
    INFO("dikes of " << d.high_m << " m every " << d.every << " posts from " << d.sensor_m << " m: RMS " << error.rms_db
                     << ", p99 " << error.p99_db << " dB; posts "
                     << posts_of_level(on, true) + posts_of_level(on, false) << " of " << posts_of_level(off, false));
    CHECK(error.rms_db < 0.08);
    CHECK(error.p99_db < 0.35);
}

TEST_CASE("levels keep the ground up to the end of the last range bin", "[detail]") {
    const Folder folder;
    draw(folder / "dem.tif", ground([](int, int) { return 200.0; }));
    const DataBaseParams rasters = mapped(folder / "dem.tif");
    Scene s = looking_north_east(300);
    s.sector.reset();
    s.range_start_m = 0;
    s.platform.xy = PointXY{500000 + 700.2 * post_m, 4100000 - 700.3 * post_m};
    s.range_m = 3200;
    const RunResult wide = simulated(s, rasters);
    CHECK(posts_of_level(wide, true) > 0);
    for (const double bins : {150.02, 150.5, 151.0}) {
        s.range_m = bins * wide.echo_w.grid.range_bin_m;
        const RunResult r = simulated(s, rasters);
        CHECK(posts_of_level(r, true) > 0);
        for (std::size_t row = 0; row < r.echo_w.grid.azimuth_count(); ++row)
            for (const std::size_t j : {149, 150}) {
                INFO(bins << " bins, row " << row << " column " << j);
                REQUIRE(r.echo_w.row(row)[j] == Approx(wide.echo_w.row(row)[j]).epsilon(0.05));
                REQUIRE(r.state.row(row)[j] == static_cast<std::uint8_t>(State::seen));
            }
    }
}

TEST_CASE("levels do not depend on ground beyond the range", "[detail][threads]") {
    const Folder folder;
    draw(folder / "long.tif", ground(rolling_ground, 3001, 801));
    draw(folder / "short.tif", ground(rolling_ground, 1601, 801));
    Scene s = looking_north_east(900);
    s.platform.xy = PointXY{500000 + 300.3 * post_m, 4100000 - 400.7 * post_m};
    s.sector = Sector{Angle::degrees(84), Angle::degrees(91)};
    s.range_m = 5000;
    const RunResult all = simulated(s, mapped(folder / "long.tif"));
    CHECK(posts_of_level(all, true) > 0);
    CHECK(same(all, simulated(s, mapped(folder / "short.tif"))));
}

TEST_CASE("on hard ground levels add no more error than they are allowed", "[.][every-ground]") {
    const Folder folder;
    std::function<double(int, int)> height;
    std::string name;
    SECTION("terraces of 35 ft") {
        name = "terraces";
        height = [](int c, int r) { return 10.668 * std::round(rolling_ground(c, r) / 10.668); };
    }
    SECTION("a checkerboard") {
        name = "checkerboard";
        height = [](int c, int r) { return rolling_ground(c, r) + ((c + r) & 1); };
    }
    SECTION("needles") {
        name = "needles";
        height = [](int c, int r) { return rolling_ground(c, r) + ((c * 7919 + r * 104729) % 5003 == 0 ? 20 : 0); };
    }
    SECTION("a cliff") {
        name = "cliff";
        height = [](int c, int r) { return rolling_ground(c, r) + (c - r / 3 > 500 ? 120 : 0); };
    }
    SECTION("fractal detail") {
        name = "fractal";
        height = [more = test::rolling(4, 200, 12)](int c, int r) { return rolling_ground(c, r) + more(c, r); };
    }
    draw(folder / "dem.tif", ground(height));
    tile(folder / "dem.tif", folder / "store");
    for (const double height_m : {50.0, 300.0, 2600.0}) {
        Scene s = looking_north_east(height_m);
        s.platform.altitude_above = AltitudeAbove::ground;
        const RunResult on = simulated(s, folder / "store");
        s.detail = false;
        const RunResult off = simulated(s, folder / "store");
        // What sampling alone makes of such ground is no matter of levels.
        const auto error = compared(on, off);
        std::string line = fmt::format(
            "{} from {} m: levels against none {:.4f} / {:.4f} dB, posts {} of {}", name, height_m, error.rms_db,
            error.p99_db, posts_of_level(on, true) + posts_of_level(on, false), posts_of_level(off, false));
        CHECK(error.rms_db < 0.08);
        CHECK(error.p99_db < 0.35);
        if (height_m > 1000) {
            const auto truly = against(on, truth(s, folder / "dem.tif", on), on.scene.noise_power_w);
            line += fmt::format("; against the reference {:.4f} / {:.4f} dB", truly.rms_db, truly.p99_db);
            INFO(line);
            CHECK(truly.rms_db < 0.1);
            CHECK(truly.p99_db < 0.35);
        }
    }
}

TEST_CASE("levels keep the promise over a steep coast, whose blocks hold sea and several crests", "[detail]") {
    // Long pulses over posts of 30 m: no level is fine enough where shadows end (docs/accuracy.md, "Where shadows end").
    struct Place {
        double lat, lon, height_m, range_m, beam_deg, from_deg, pulse_s;
    };
    const DataBaseParams rasters = mapped(WEDGESCOPE_TEST_DATA + std::string("/olympic_coast_dem.tif"));
    for (const Place& place :
         {Place{48.1772, -124.4626, 1500, 21550, 3, 276, 4e-6}, Place{48.3177, -124.5039, 1753, 11571, 6, 191, 4e-6},
          Place{48.1671, -124.5358, 861, 8441, 6, 73, 2e-6}}) {
        Scene s;
        s.platform.latlon = LatLon{place.lat, place.lon};
        s.platform.altitude_above = AltitudeAbove::ground;
        s.platform.altitude_m = place.height_m;
        s.range_m = place.range_m;
        s.range_start_m = 60 / Angle::degrees(place.beam_deg).rad();
        s.radar.pulse_s = place.pulse_s;
        s.radar.antenna.beam = Angle::degrees(place.beam_deg);
        s.sector = Sector{Angle::degrees(place.from_deg), Angle::degrees(place.from_deg + 45)};
        s.display.size = 64;
        s.quality = Quality::normal;
        const RunResult on = simulated(s, rasters);
        s.detail = false;
        s.quality = Quality::exact;
        s.spokes_per_bin = 64;
        s.spokes_per_post = 4;
        const auto error = compared(on, simulated(s, rasters));
        INFO(place.lat << ": " << error.rms_db << ", " << error.p99_db << " dB");
        CHECK(posts_of_level(on, true) == 0);
        CHECK(error.rms_db < 0.1);
        CHECK(error.p99_db < 0.35);
    }
}

TEST_CASE("levels keep the promise where sharp shadows fall near a low sensor", "[detail]") {
    // Shipped hills of 30-m posts in posts of 5 m, smooth between (Catmull and Rom): near by one shadow's edge crosses all of the
    // beam, and 40 dB and more over the noise every sliver counts.
    struct Place {
        const char* dem;
        std::int64_t column, row;
        double height_m, range_m, pulse_s;
        bool coarser;
    };
    for (const Place& place : {Place{"/inland_empire_dem.tif", 70, 70, 100, 3000, 1e-6, false},
                               Place{"/inland_empire_dem.tif", 70, 70, 300, 3000, 1e-6, false},
                               Place{"/lake_sunapee_dem.tif", 4, 110, 300, 3400, 2e-6, false},
                               Place{"/lake_sunapee_dem.tif", 4, 110, 2500, 3400, 2e-6, true}}) {
        constexpr std::int64_t finer = 6, posts = side / finer + 4;
        const auto shipped = open_direct_source(base(WEDGESCOPE_TEST_DATA + std::string(place.dem)));
        const Window window{{place.column, place.column + posts}, {place.row, place.row + posts}};
        const Chunk chunk = shipped->load(window, false);
        const auto bent = [](double a, double b, double c, double d, double t) {
            return b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)));
        };
        const Folder folder;
        draw(
            folder / "dem.tif", ground([&](int column, int row) {
                const std::int64_t c = column / finer, r = row / finer;
                const double u = static_cast<double>(column % finer) / finer,
                             v = static_cast<double>(row % finer) / finer;
                std::array<double, 4> along{};
                for (std::int64_t k = 0; k < 4; ++k) {
                    const auto z = [&](std::int64_t i) {
                        return static_cast<double>(chunk.surface_m[window.at(place.column + c + i, place.row + r + k)]);
                    };
                    along[static_cast<std::size_t>(k)] = bent(z(0), z(1), z(2), z(3), u);
                }
                return bent(along[0], along[1], along[2], along[3], v);
            }));
        Scene s;
        s.platform.xy = PointXY{500000 + 0.513 * side * post_m, 4100000 - 0.487 * side * post_m};
        s.platform.altitude_above = AltitudeAbove::ground;
        s.platform.altitude_m = place.height_m;
        s.range_m = place.range_m;
        s.range_start_m = 2 * post_m / s.radar.antenna.beam.rad();
        s.radar.pulse_s = place.pulse_s;
        s.display.size = 64;
        const DataBaseParams rasters = mapped(folder / "dem.tif");
        const RunResult on = simulated(s, rasters);
        s.detail = false;
        s.quality = Quality::exact;
        const auto error = compared(on, simulated(s, rasters));
        INFO(place.dem << " from " << place.height_m << " m: " << error.rms_db << ", " << error.p99_db << " dB");
        CHECK(error.rms_db < 0.1);
        CHECK(error.p99_db < 0.35);
        CHECK((!place.coarser || posts_of_level(on, true) > 0));
    }
}

TEST_CASE("levels leave rough ground its slopes where a law bends with the angle", "[detail]") {
    // Noise from post to post, as laser scans have it, whose slopes make more of the echo than their mean does.
    const Folder folder;
    std::mt19937 generator(11);
    std::normal_distribution<double> noise(0, 0.4);
    draw(folder / "dem.tif", ground([&](int, int) { return 100 + noise(generator); }));
    const DataBaseParams soil = mapped(folder / "dem.tif");
    Scene s = looking_north_east(1500);
    const auto check = [&](const char* name, bool bent, const DataBaseParams& rasters) {
        INFO(name);
        s.detail = true;
        const RunResult on = simulated(s, rasters);
        s.detail = false;
        const RunResult off = simulated(s, rasters);
        const auto error = compared(on, off);
        CAPTURE(error.rms_db, error.p99_db, posts_of_level(on, true));
        CHECK(error.rms_db < 0.06);
        CHECK((bent || posts_of_level(on, true) > 0));
    };
    check("constant gamma", false, soil);
    s.land = LandModel::ulaby_dobson;
    check("ulaby-dobson", true, soil);
    s.land = LandModel::oh;
    check("oh", true, soil);
    DataBaseParams water = soil;
    s.land = LandModel::constant_gamma;
    s.sea_state = 3;
    water.default_class = material_by_name("material", "water");
    check("sea", true, water);
}

TEST_CASE("on shipped ground levels keep the promise under laws that bend with the angle", "[.][every-ground]") {
    // A pulse of 300 m and a beam of 3 degrees over posts of 30 m and 90 m, so that levels have something to leave out; down to the
    // nadir, where the laws are steepest.
    struct Place {
        const char *name, *dem;
        double lat, lon;
    };
    std::string table;
    bool some_levels = false;
    for (const Place& place : {Place{"White Mountains", "/N44W072.hgt", 44.47, -71.52},
                               Place{"Santa Ana Mountains", "/inland_empire_dem.tif", 33.8, -117.5}}) {
        const DataBaseParams rasters = mapped(WEDGESCOPE_TEST_DATA + std::string(place.dem));
        for (const double height_m : {5000.0, 9000.0, 13000.0}) {
            Scene s;
            s.platform.latlon = LatLon{place.lat, place.lon};
            s.platform.altitude_m = height_m;
            s.range_m = 22000;
            s.radar.pulse_s = 2e-6;
            s.radar.antenna.beam = Angle::degrees(3);
            s.azimuth_bins = 480;
            s.sector = Sector{Angle::degrees(20), Angle::degrees(110)};
            s.display.size = 64;
            for (const LandModel land : {LandModel::constant_gamma, LandModel::ulaby_dobson, LandModel::oh}) {
                s.land = land;
                s.quality = Quality::exact;
                const RunResult exact = simulated(s, rasters);
                CHECK(posts_of_level(exact, true) == 0);
                s.quality = Quality::normal;
                const RunResult on = simulated(s, rasters);
                s.detail = false;
                const RunResult off = simulated(s, rasters);
                s.detail = true;
                const auto error = compared(on, exact), bare = compared(off, exact), levels = compared(on, off);
                table += fmt::format(
                    "{} from {} m, {}: normal {:.4f} / {:.4f} dB, without levels {:.4f} / {:.4f}, levels alone {:.4f} "
                    "/ "
                    "{:.4f}; posts {} of {} ({} of levels)\n",
                    place.name, height_m, word(land), error.rms_db, error.p99_db, bare.rms_db, bare.p99_db,
                    levels.rms_db, levels.p99_db, posts_of_level(on, true) + posts_of_level(on, false),
                    posts_of_level(off, false), posts_of_level(on, true));
                INFO(place.name << " from " << height_m << " m, " << word(land));
                some_levels |= posts_of_level(on, true) > 0 && land != LandModel::constant_gamma;
                CHECK(error.rms_db < 0.1);
                CHECK(error.p99_db < 0.35);
            }
        }
    }
    WARN(table);
    CHECK(some_levels);
}
