// Statistical walls: what structures finer than a post add to the ground's echo and raise it by, against closed forms; and the
// same bits whatever the way of the data.
#include <catch2/catch.hpp>

#include <cmath>
#include <cstring>
#include <numbers>

#include "lib/coverage.hpp"
#include "lib/detail.hpp"
#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "lib/plan.hpp"
#include "lib/raised_source.hpp"
#include "lib/shade.hpp"
#include "tests/bare_scene.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/terrain.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/sources.hpp"
#include "tiles/tile_store.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using wedgescope::test::draw;
using wedgescope::test::Drawing;
using wedgescope::test::Folder;
using wedgescope::test::MemorySource;
using wedgescope::test::simulate;

namespace {

constexpr double degree = std::numbers::pi / 180;

/// No pattern, no beam, no pulse, a flat earth: the echo is K sigma0(psi) A / r^4.
Scene bare_scene(double x, double y, double altitude_m, double range_m) {
    Scene s = wedgescope::test::bare_scene(x, y, altitude_m, range_m);
    s.azimuth_bins = 72;
    s.earth_k.reset();
    s.radar.frequency_hz = 10e9;  // gammas as the table has them
    s.walls = Walls::statistical;
    return s;
}

double echo_at(const RunResult& r, double azimuth_deg, double range_m) {
    const auto row = static_cast<std::size_t>(azimuth_deg / 360 * static_cast<double>(r.echo_w.grid.circle_bins));
    return static_cast<double>(r.echo_w.row(row)[static_cast<std::size_t>(range_m / r.echo_w.grid.range_bin_m)]);
}
State state_at(const RunResult& r, double azimuth_deg, double range_m) {
    const auto row = static_cast<std::size_t>(azimuth_deg / 360 * static_cast<double>(r.echo_w.grid.circle_bins));
    return static_cast<State>(r.echo_state.row(row)[static_cast<std::size_t>(range_m / r.echo_state.grid.range_bin_m)]);
}
bool same_bits(const RunResult& a, const RunResult& b) {
    return a.echo_w.cells.size() == b.echo_w.cells.size() &&
           std::memcmp(a.echo_w.cells.data(), b.echo_w.cells.data(), a.echo_w.cells.size() * sizeof(float)) == 0 &&
           a.echo_state.cells == b.echo_state.cells;
}

/// Town of the tests: 500 houses on a square kilometre, 20 m wide and 15 m high: 0.15 of walls on a unit of ground, a fifth of it
/// covered, so it stands 3 m above the terrain.
constexpr const char* town = "town,-10,3,,,,omni,0,500,20,15\n";
constexpr double town_walls = 500e-6 * 20 * 15, town_raise_m = 500e-6 * 20 * 20 * 15;
const double town_gamma = std::pow(10, -1.0), town_wall = std::pow(10, 0.3);

/// A cell of a plain seen from `h` above: K times the sum over small pieces of (gamma sin psi + wall cos psi) D a / r^4.
template <class Gain>
double plain_echo(const Scene& s, double h, double gamma, double wall, double azimuth_deg, double range_m,
                  const Gain& gain) {
    const double step_deg = 360.0 / static_cast<double>(*s.azimuth_bins), bin = *s.range_bin_m;
    const double azimuth0 = std::floor(azimuth_deg / step_deg) * step_deg, range0 = std::floor(range_m / bin) * bin;
    double sum = 0;
    constexpr int parts = 60;
    for (int i = 0; i < parts; ++i)
        for (int k = 0; k < parts; ++k) {
            const double range = range0 + (k + 0.5) / parts * bin, ground = std::sqrt(range * range - h * h),
                         azimuth = azimuth0 + (i + 0.5) / parts * step_deg;
            // A ring of slant ranges dr is r dr / d wide on the ground.
            const double area = range * bin / parts * step_deg / parts * degree;
            sum += (gamma * h / range + wall * ground / range) * gain(azimuth) * area / std::pow(range, 4);
        }
    return radar_constant(s.radar) * sum;
}
double omni(double) { return 1; }

}  // namespace

TEST_CASE("a plain of structures returns its ground and gamma_w n H w cos psi of their walls", "[walls]") {
    struct Case {
        double altitude_m, range_m;
    };
    for (const bool culture : {false, true}) {
        MemorySource source(401, 401, 30, [](double, double) { return 0.0; });
        source.editable().default_class = 16;
        if (culture) {
            source.editable().default_class = 4;
            source.set_classes([](double, double) { return 16; });
        }
        // Grazing angles from 51 to 0.8 degrees.
        for (const Case& c : {Case{1500, 1925}, Case{1500, 4025}, Case{500, 3025}, Case{200, 4025}, Case{70, 4625}}) {
            Scene s = bare_scene(6007, -6011, c.altitude_m, 5000);
            s.materials = Materials::from_csv("table", town);
            const RunResult r = simulate(s, source);
            for (const double azimuth : {2.0, 47.0, 93.0, 141.0, 271.0}) {
                INFO(c.altitude_m << " m up, " << c.range_m << " m away, " << azimuth << " deg, culture " << culture);
                const double expected = plain_echo(s, c.altitude_m - town_raise_m, town_gamma, town_wall * town_walls,
                                                   azimuth, c.range_m, omni);
                CHECK_THAT(10 * std::log10(echo_at(r, azimuth, c.range_m) / expected), WithinAbs(0, 0.05));
            }
            // Walls are what most of it is at 3 degrees, and the smaller part at 51.
            const double ground = plain_echo(s, c.altitude_m, town_gamma, 0, 47, c.range_m, omni);
            if (c.altitude_m <= 200) CHECK(echo_at(r, 47, c.range_m) > 20 * ground);
            s.walls = Walls::resolved;
            CHECK_THAT(10 * std::log10(echo_at(simulate(s, source), 47, c.range_m) / ground), WithinAbs(0, 0.05));
        }
    }
}

TEST_CASE("the walls of a class with a side return as that side is turned to the sensor", "[walls]") {
    MemorySource source(301, 301, 30, [](double, double) { return 0.0; });
    source.editable().default_class = 16;
    for (const char* kind : {"uni", "bi"}) {
        Scene s = bare_scene(4507, -4511, 400, 4000);
        s.materials = Materials::from_csv("table", text("town,-10,3,,,,", kind, ",120,500,20,15\n"));
        const RunResult r = simulate(s, source);
        for (const double azimuth : {2.5, 47.5, 92.5, 122.5, 182.5, 227.5, 302.5}) {
            INFO(kind << " at " << azimuth);
            const double expected =
                plain_echo(s, 400 - town_raise_m, town_gamma, town_wall * town_walls, azimuth, 3025, [&](double a) {
                    return directivity_gain(kind[0] == 'u' ? Directivity::uni : Directivity::bi,
                                            Angle::degrees(a + 180), Angle::degrees(120));
                });
            CHECK_THAT(10 * std::log10(echo_at(r, azimuth, 3025) / expected), WithinAbs(0, 0.05));
        }
    }
}

TEST_CASE("no law with walls passes its largest factor, which is that at 0.05 degrees", "[walls]") {
    const Materials materials =
        Materials::from_csv("table", text(town, "ships,,12,,,,,,10,20,15\nsea,,,,,,,,10,20,15\n"));
    for (const Polarisation polarisation : {Polarisation::hh, Polarisation::circular})
        for (const LandModel land : {LandModel::constant_gamma, LandModel::ulaby_dobson}) {
            ClassLawParams params{.materials = materials,
                                  .frequency_hz = 10e9,
                                  .polarisation = polarisation,
                                  .land = land,
                                  .walls = Walls::statistical};
            CHECK(may_need_facets(params));
            const ClassLaws laws(params);
            CHECK(laws.error_db() <= 0.01);
            for (std::size_t id = 0; id < materials.size(); ++id) {
                double most = 0;
                for (double sine = 0; sine <= 1; sine += sine < 0.01 ? 1e-6 : 1e-3)
                    most = std::max(most, laws.ground(static_cast<ClassId>(id), law_variable(sine)));
                INFO(materials[id].name);
                CHECK(most <= laws.gamma()[id].ground);
                CHECK(laws.gamma()[id].ground <= laws.most());
            }
            // Circular: half a decibel of walls, three of ground.
            const double part = polarisation == Polarisation::circular ? std::pow(10, -0.05) : 1,
                         ground = polarisation == Polarisation::circular ? town_gamma / std::pow(10, 0.3) : town_gamma;
            CHECK(laws.gamma()[16].ground ==
                  Approx(ground + part * town_wall * town_walls / std::tan(0.05 * degree)).epsilon(1e-4));
            // Water's structures have the gamma of walls alone; without one they return nothing.
            CHECK(laws.ground(17, law_variable(std::sin(5 * degree))) ==
                  Approx(part * std::pow(10, 1.2) * 10e-6 * 300 / std::tan(5 * degree)).epsilon(3e-3));
            CHECK(laws.gamma()[18].ground == 0);
        }
    // One gamma for everything has no walls of its own; and nothing is added to what is resolved.
    CHECK(ClassLaws(ClassLawParams{.materials = materials, .gamma = Decibel(-15), .walls = Walls::statistical})
              .constant());
    CHECK(ClassLaws(ClassLawParams{.materials = materials}).constant());
    CHECK_FALSE(may_need_facets({.materials = materials}));
}

TEST_CASE("structures hide what is behind them by their mean height", "[walls]") {
    // A belt of them, 20 m high on half of the ground: from 100 m up its far edge, 3300 m away, throws a shadow to 3667 m.
    MemorySource source(301, 301, 30, [](double, double) { return 0.0; });
    source.set_classes([](double c, double) { return c >= 200 && c <= 210 ? 16 : 5; });
    Scene s = bare_scene(100 * 30, -150 * 30, 100, 5500);
    s.materials = Materials::from_csv("table", "belt,-10,3,,,,omni,0,200,50,20\n");  // 200e-6 * 50^2 = 0.5
    s.azimuth_bins = 360;
    s.range_bin_m = 20;
    const RunResult r = simulate(s, source);
    s.walls = Walls::resolved;
    const RunResult flat = simulate(s, source);
    const double end = 3300 * 100 / 90.0;
    for (const double range : {3400.0, 3500.0, 3600.0, end - 40}) {
        INFO(range);
        CHECK(state_at(r, 90.5, range) == State::shadow);
        CHECK(state_at(flat, 90.5, range) == State::seen);
        CHECK(echo_at(r, 90.5, range) == 0);
    }
    CHECK(state_at(r, 90.5, end + 40) == State::seen);
    CHECK(state_at(r, 90.5, 2950) == State::seen);
    CHECK(echo_at(r, 90.5, 3010) > 10 * echo_at(flat, 90.5, 3010));  // its near face, and the walls on it
    // From its middle the sensor is inside it, and stands on the terrain.
    Scene inside = bare_scene(205 * 30, -150 * 30, 5, 2000);
    inside.materials = s.materials;
    CHECK(resolve(inside, source).nadir_surface_m == 0);
    inside.platform.altitude_m = 15;
    CHECK(resolve(inside, source).nadir_surface_m == 10);
}

TEST_CASE("where culture heights stand on structures neither height nor walls count twice", "[walls]") {
    MemorySource source(401, 401, 30, [](double, double) { return 0.0; });
    // A town whose heights are known, 8 m, and metal towers of 8 m on another side, which stay walls.
    source.set_classes([](double c, double) { return c < 200 ? 16 : 15; });
    source.set_culture_height([](double, double) { return 8.0; });
    Scene s = bare_scene(200 * 30 + 7, -6011, 800, 5000);
    s.materials = Materials::from_csv("table", town);
    const RunResult r = simulate(s, source);
    for (const double range : {1525.0, 3025.0, 4525.0}) {
        INFO(range);
        CHECK_THAT(10 * std::log10(echo_at(r, 272, range) /
                                   plain_echo(s, 800 - 8, town_gamma, town_wall * town_walls, 272, range, omni)),
                   WithinAbs(0, 0.05));
        CHECK_THAT(
            10 * std::log10(echo_at(r, 92, range) / plain_echo(s, 800 - 8, std::pow(10, 1.5), 0, 92, range, omni)),
            WithinAbs(0, 0.05));
    }
}

TEST_CASE("the response of posts has the walls, and adds up to the echo image", "[walls]") {
    const auto hills = test::rolling(250, 120, 11);
    for (const bool hilly : {false, true}) {
        MemorySource source(401, 401, 30, [&](double c, double r) { return hilly ? 500 + hills(c, r) : 500; });
        source.set_classes([](double c, double r) {
            return static_cast<int>(c) / 40 % 2 ? 8 : static_cast<int>(r) / 60 % 2 ? 16 : 11;  // trees, town, urban
        });
        Scene s = bare_scene(200.2 * 30, -199.7 * 30, 2500, 5800);
        s.materials = Materials::from_csv("table", town);
        std::vector<double> watts(401 * 401);
        CoverageParams params;
        params.layer = CoverageLayer::response;
        params.threads = 1;
        cover(resolve_coverage(s, source), source, params, [&](const CoverageTile& tile) {
            for (std::int64_t y = tile.window.rows.begin; y < tile.window.rows.end; ++y)
                for (std::int64_t x = tile.window.columns.begin; x < tile.window.columns.end; ++x) {
                    const float dbm =
                        tile.values[(y - tile.window.rows.begin) * tile.stride + x - tile.window.columns.begin];
                    watts[static_cast<std::size_t>(y * 401 + x)] =
                        dbm == dbm ? std::pow(10, 0.1 * (static_cast<double>(dbm) - 30)) : 0;
                }
        });
        double sum = 0, echo = 0;
        for (const double w : watts) sum += w;
        for (const float e : simulate(s, source).echo_w.cells) echo += static_cast<double>(e);
        // A step at the edge of a town lifts a post whole in the one, and slopes to it in the other.
        CHECK_THAT(10 * std::log10(sum / echo), WithinAbs(0, hilly ? 0.15 : 0.1));
        if (hilly) continue;
        // One post of the town by itself.
        const double x = (170 - 200.2) * 30, y = (199.7 - 90) * 30, h = 2000 - town_raise_m,
                     range = std::hypot(x, y, h);
        const double expected = radar_constant(s.radar) *
                                (town_gamma * h / range + town_wall * town_walls * std::hypot(x, y) / range) * 900 /
                                std::pow(range, 4);
        CHECK_THAT(10 * std::log10(watts[90 * 401 + 170] / expected), WithinAbs(0, 0.015));
    }
}

TEST_CASE("structures of a table change no bit of a scene with resolved walls", "[walls]") {
    const auto hills = test::rolling(300, 120, 5);
    MemorySource source(301, 301, 30, [&](double c, double r) { return 300 + hills(c, r); });
    source.set_classes([](double c, double r) { return (static_cast<int>(c) / 7 + static_cast<int>(r) / 5) % 16; });
    source.set_culture_height([](double c, double r) { return std::fmod(c + r, 13) < 3 ? 9.0 : 0.0; });
    Scene s = bare_scene(4507, -4511, 900, 4000);
    s.walls = Walls::resolved;
    const RunResult shipped = simulate(s, source);
    s.materials = Materials::from_csv("table",
                                      "name,structures_km2,structure_width_m,structure_height_m\n"
                                      "urban,,,\nsuburban,,,\ntrees,,,\ngrass,1000,10,5\n");
    CHECK(same_bits(simulate(s, source), shipped));
    // Nor do statistical walls where no class has any; where some have, heights and echoes are others.
    s.materials = Materials::from_csv("table",
                                      "name,structures_km2,structure_width_m,structure_height_m\n"
                                      "urban,,,\nsuburban,,,\ntrees,,,\n");
    s.walls = Walls::statistical;
    CHECK(same_bits(simulate(s, source), shipped));
    s.materials = {};
    CHECK_FALSE(same_bits(simulate(s, source), shipped));
}

TEST_CASE("what bounds leave out changes no bit where structures raise the ground", "[walls]") {
    // Ridges, and beyond them low ground that only what stands on it lifts into view.
    MemorySource source(520, 410, 30, [](double c, double r) {
        return (170 + 50 * std::sin(0.05 * r)) * std::exp(-std::pow((c - 150) / 12, 2)) +
               10 * std::sin(0.05 * c) * std::cos(0.07 * r);
    });
    source.set_classes(
        [](double c, double r) { return (static_cast<int>(c) / 33 + static_cast<int>(r) / 21) % 3 ? 5 : 16; });
    source.set_culture_height([](double c, double r) { return std::fmod(c * 7 + r * 3, 41) < 2 ? 6.0 : 0.0; });
    source.set_block_map();
    Scene s = bare_scene(60 * 30 + 7, -200 * 30 - 11, 230, 13000);
    s.quality = Quality::normal;
    s.materials = Materials::from_csv("table", "belt,-10,3,,,,omni,0,400,50,60\n");  // all covered, 60 m high
    const RunResult whole = simulate(s, source, 1, 1, false);
    std::uint64_t skipped = 0;
    for (const std::int64_t wedges : {1, 5, 24})
        for (const int threads : {1, 2})
            for (const bool cull : {true, false}) {
                const RunResult r = simulate(s, source, wedges, threads, cull);
                INFO(wedges << " wedges, " << threads << " threads, cull " << cull);
                CHECK(same_bits(r, whole));
                for (const WedgeReport& w : r.report.wedges)
                    for (const Skip why : {Skip::hidden, Skip::horizon})
                        skipped += w.posts_skipped[static_cast<std::size_t>(why)];
            }
    CHECK(skipped > 10000);
    // And no wedge holds more than it was granted: the classes under its posts count.
    for (const std::int64_t wedges : {1, 9}) {
        EngineParams params;
        params.threads = 1;
        params.wedges = wedges;
        params.cull = false;
        const ResolvedScene resolved = resolve(s, source);
        const Plan granted = plan(resolved, source, params);
        std::uint64_t bytes = 0, resolved_bytes = 0;
        for (const WedgeReport& w : run(resolved, source, params).report.wedges) {
            CHECK(w.peak_bytes <= granted.wedge_bytes);
            bytes += w.bytes_read;
        }
        CHECK(static_cast<double>(bytes) == Approx(static_cast<double>(granted.total().bytes)).epsilon(0.2));
        ResolvedScene plain = resolved;
        plain.scene.walls = Walls::resolved;
        for (const WedgeReport& w : run(plain, source, params).report.wedges) resolved_bytes += w.bytes_read;
        CHECK(bytes > resolved_bytes);
    }
    // The bounds stand above every post.
    SceneSource raised(source, s);
    const Window posts{{0, 520}, {0, 410}};
    const Chunk all = (*raised).load(posts, false);
    const BlockWindow bounds = (*raised).block_map()->read(0, blocks_of(posts));
    for (std::int64_t r = 0; r < 410; ++r)
        for (std::int64_t c = 0; c < 520; ++c) {
            const BlockBounds& b = bounds.at(c / 32, r / 32);
            if (!(all.surface_m[static_cast<std::size_t>(r * 520 + c)] <= b.highest_m + b.culture_m))
                FAIL(c << ", " << r);
        }
}

TEST_CASE("neither raw rasters, stores nor spills change a bit where structures raise the ground", "[walls]") {
    constexpr std::size_t mebibyte = std::size_t{1} << 20;
    const Folder folder;
    const auto shape = test::rolling(500, 110, 23);
    Drawing terrain;
    terrain.columns = 380;
    terrain.rows = 330;
    terrain.type = GDT_Int16;
    terrain.no_data = -32768;
    terrain.creation = {"TILED=YES", "BLOCKXSIZE=64", "BLOCKYSIZE=64", "COMPRESS=DEFLATE"};
    terrain.value = [&](int c, int r) {
        return c > 40 && c < 90 && r > 200 && r < 290 ? -32768 : std::round(600 + shape(c, r));
    };
    terrain.geotransform = {{500000, 30, 0, 4100000, 0, -30}};
    // Cells of 20 m, which begin off the terrain's; a code that is in no legend's classes of structures.
    Drawing culture = terrain;
    culture.type = GDT_Byte;
    culture.no_data = 0;
    culture.columns = 560;
    culture.rows = 500;
    culture.geotransform = {{500010, 20, 0, 4099990, 0, -20}};
    culture.value = [](int c, int r) { return 11 + (c / 9 + r / 13) % 3; };
    Drawing height = terrain;
    height.type = GDT_Byte;
    height.no_data.reset();
    height.value = [](int c, int r) { return (c / 5 + r / 6) % 7 == 0 ? 12.0 : 0.0; };
    draw(folder / "dem.tif", terrain);
    draw(folder / "culture.tif", culture);
    draw(folder / "height.tif", height);

    Scene scene;
    scene.walls = Walls::statistical;
    scene.platform.xy = PointXY{500000 + 30 * 201.7, 4100000 - 30 * 150.3};
    scene.platform.altitude_m = 1100;
    scene.range_m = 7000;
    scene.spokes_per_post = 1.25;
    scene.azimuth_bins = 180;
    scene.range_bin_m = 60;
    scene.display.size = 64;
    DataBaseParams params;
    params.dem = folder / "dem.tif";
    params.culture = folder / "culture.tif";
    params.culture_height = folder / "height.tif";
    params.legend = Legend("drawn", {{11, 8}, {12, 5}, {13, 11}});  // trees, grass, urban
    params.default_class = 10;                                      // suburban, beyond the culture
    params.cache_bytes = 8 * mebibyte;
    TileStoreParams into;
    into.dems = {params.dem};
    into.culture = params.culture;
    into.culture_height = params.culture_height;
    into.output = folder / "store";
    into.tile_posts = 128;
    into.cache_bytes = 8 * mebibyte;
    write_tile_store(into);

    std::optional<RunResult> straight;
    for (const bool store : {false, true}) {
        DataBaseParams own = params;
        if (store) {
            own.dem = into.output;
            own.culture.clear();
            own.culture_height.clear();
        }
        for (const char* way : {"direct", "spilled, held", "spilled to disk"}) {
            SpillOptions options;
            options.temp_folder = folder / "";
            options.memory_bytes = 64 * mebibyte;
            const auto open = [&]() -> std::unique_ptr<WedgeSource> {
                if (way[0] == 'd') return open_direct_source(own);
                if (!std::strstr(way, "disk")) return open_spilled_source(own, scene, options);
                // The least memory that the pass makes do with: a quarter of it is too little for all blocks.
                own.cache_bytes = 0;
                for (options.memory_bytes = mebibyte;; options.memory_bytes += mebibyte / 2) {
                    REQUIRE(options.memory_bytes < 64 * mebibyte);
                    try {
                        return open_spilled_source(own, scene, options);
                    } catch (const TooLittleMemory&) {
                    }
                }
            };
            const std::unique_ptr<WedgeSource> source = open();
            CHECK((source->report().spilled_bytes > 0) == (std::strstr(way, "disk") != nullptr));
            for (const std::int64_t wedges : {1, 9})
                for (const bool cull : {true, false}) {
                    const RunResult r = simulate(scene, *source, wedges, wedges > 1 ? 2 : 1, cull);
                    if (!straight) straight = r;
                    INFO((store ? "store, " : "raw, ") << way << ", " << wedges << " wedges, cull " << cull);
                    CHECK(same_bits(r, *straight));
                }
        }
    }
    scene.walls = Walls::resolved;
    CHECK_FALSE(same_bits(simulate(scene, *open_direct_source(params)), *straight));
}

TEST_CASE("no level of detail is used where structures raise the ground", "[walls]") {
    MemorySource source(2048, 2048, 2, [](double, double) { return 0.0; });
    Scene s = bare_scene(2048, -2048, 900, 1500);
    s.quality = Quality::normal;
    s.radar.pulse_length_error = s.radar.beam_width_error = true;
    const auto possible = [&](const char* material) {
        source.editable().default_class = material_by_name("material", material);
        return detail_possible(resolve(s, source), source.data_base());
    };
    CHECK_FALSE(possible("trees"));
    CHECK(possible("soil"));  // has none, and there is no culture
    s.walls = Walls::resolved;
    CHECK(possible("trees"));
}
