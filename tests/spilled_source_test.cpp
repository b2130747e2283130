// The spilled source: the same posts, culture and block map as from the rasters, in any memory; what its pass leaves out; and
// the same scenes.
#include <catch2/catch.hpp>

#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include "lib/coverage.hpp"
#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "tests/refusal.hpp"
#include "tests/spilled_ground.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/needed_posts.hpp"
#include "tiles/partition.hpp"
#include "tiles/spill.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

namespace {

const std::string data = WEDGESCOPE_TEST_DATA;
const GdalSession session(std::size_t{16} << 20, {});

Interval pick(std::mt19937& random, std::int64_t begin, std::int64_t end) {
    const auto one = [&] { return begin + static_cast<std::int64_t>(random() % static_cast<unsigned>(end - begin)); };
    const std::int64_t a = one(), b = one();
    return {std::min(a, b), std::max(a, b) + 1};
}

/// Every post and class of random windows, and what is asked of the whole.
void same_as_direct(const DataBaseParams& params, const Scene& scene, unsigned seed, std::size_t small = little) {
    CAPTURE(seed, params.dem);
    const auto direct = open_direct_source(params);
    const DataBase& d = direct->data_base();
    const Folder folder;
    for (const std::size_t memory : {small, plenty}) {
        CAPTURE(memory);
        const auto spilled = open_spilled_source(params, scene, in(folder, memory));
        const std::uint64_t bytes = spilled->report().spilled_bytes;
        CHECK((memory == small ? bytes > 0 : bytes == 0));
        std::mt19937 random(seed);
        const std::int64_t turn = d.cyclic ? d.cycle_columns : 0;
        for (int trial = 0; trial < 12; ++trial) {
            const Window w{pick(random, -turn / 2, d.columns + turn / 2), pick(random, 0, d.rows)};
            const Chunk a = direct->load(w, trial % 2 == 0), b = spilled->load(w, trial % 2 == 0);
            CHECK(differences(a.surface_m, b.surface_m) == 0);
            // No heights at all and heights of nothing are the same.
            const RawVector<float> none(a.surface_m.size(), 0.0F);
            CHECK(differences(a.culture_height_m.empty() ? none : a.culture_height_m,
                              b.culture_height_m.empty() ? none : b.culture_height_m) == 0);
            const std::int64_t c = w.columns.begin, r = w.rows.begin;
            CHECK(bits(direct->bare_terrain_m(c, r)) == bits(spilled->bare_terrain_m(c, r)));
            if (!d.has_culture) continue;
            const Window cells{pick(random, 0, d.culture_columns), pick(random, 0, d.culture_rows)};
            const CultureCells x = direct->load_classes(cells), y = spilled->load_classes(cells);
            CHECK(x.classes == y.classes);
            CHECK(x.codes == y.codes);
        }
        const Extremes a = direct->extremes(), b = spilled->extremes();
        CHECK(a.lowest_m == b.lowest_m);
        CHECK(a.highest_m == b.highest_m);
        CHECK(a.void_posts == b.void_posts);
        CHECK(a.any_valid == b.any_valid);
        CHECK(folder.names().empty());
    }
}
void same_as_direct(const DataBaseParams& params, unsigned seed, std::size_t small = little) {
    same_as_direct(params, above(params), seed, small);
}

/// The shipped ground with classes and canopy.
DataBaseParams inland_empire() {
    DataBaseParams params = only(data + "/inland_empire_dem.tif");
    params.culture = data + "/inland_empire_culture.tif";
    params.culture_height = data + "/inland_empire_canopy.tif";
    params.culture_height_scale = 0.1;
    params.legend = Legend::built_in("fbfm40");
    return params;
}
/// All of it, in bins enough to tell bits by.
Scene over_inland_empire() {
    Scene scene;
    scene.platform.latlon = LatLon{33.9, -117.4};
    scene.platform.altitude_above = AltitudeAbove::ground;
    scene.platform.altitude_m = 700;
    scene.azimuth_bins = 360;
    scene.range_bin_m = 60;
    scene.display.size = 64;
    return scene;
}

}  // namespace

TEST_CASE("posts of every type come out of the spill as they come out of the raster", "[spill]") {
    const Folder folder;
    Drawing d = hills(700, 530, GDT_Int16);
    d.no_data = 3;
    draw(folder / "short.tif", d);
    same_as_direct(only(folder / "short.tif"), 1);

    d.creation = {"TILED=YES", "COMPRESS=DEFLATE", "BLOCKXSIZE=80", "BLOCKYSIZE=48"};
    draw(folder / "tiled.tif", d);
    same_as_direct(only(folder / "tiled.tif"), 2);

    d.creation = {"COMPRESS=DEFLATE", "BLOCKYSIZE=530"};  // one strip
    d.scale = 0.1;
    d.offset = 30;
    d.unit = "ft";
    draw(folder / "scaled.tif", d);
    same_as_direct(only(folder / "scaled.tif"), 3, std::size_t{11} << 18);  // GDAL takes the strip as a whole

    Drawing f = hills(300, 400, GDT_Float32);
    f.value = [](int c, int r) { return c % 97 == 0 ? std::nan("") : 1e-3 * c * r - 20 + (c == 5 ? -0.0 : 0.0); };
    f.masked = [](int c, int r) { return (c / 20 + r / 30) % 4 == 0; };
    draw(folder / "float.tif", f);
    same_as_direct(only(folder / "float.tif"), 4);

    Drawing b = hills(350, 260, GDT_Byte);
    b.value = [](int c, int r) { return (c * r) % 256; };
    b.geotransform = {{1000, 10, 0, 2000, 0, 10}};  // south up
    draw(folder / "byte.tif", b);
    same_as_direct(only(folder / "byte.tif"), 5);

    b.value = [](int c, int r) { return c < 200 ? 9 : 40 + c * r % 100; };
    b.no_data = 9;  // blocks of nothing but voids
    draw(folder / "half.tif", b);
    same_as_direct(only(folder / "half.tif"), 6, little / 2);
}

TEST_CASE("columns of a DTED-like file are read as columns", "[spill]") {
    same_as_direct(only(data + "/N44W072.hgt"), 7, std::size_t{4} << 20);
}

TEST_CASE("a raster round the whole earth comes out of the spill across its seam", "[spill]") {
    const Folder folder;
    for (const int extra : {0, 1}) {
        Drawing d = hills(720 + extra, 300, GDT_Int16);
        d.crs = "EPSG:4326";
        d.geotransform = {{-180.25, 0.5, 0, 75, 0, -0.5}};
        d.value = [](int c, int r) { return c % 720 + r; };
        draw(folder / "world.tif", d);
        const DataBaseParams params = only(folder / "world.tif");
        Scene scene = above(params);
        scene.platform.xy.reset();
        scene.platform.latlon = LatLon{10, 179.9};
        same_as_direct(params, scene, 8);
    }
}

TEST_CASE("culture and heights on grids of their own come out of the spill as they are", "[spill]") {
    DataBaseParams params = only(data + "/worcester_vermont_dem.tif");
    params.culture_height = data + "/worcester_vermont_canopy.tif";
    params.culture_height_scale = 0.1;
    params.culture = data + "/worcester_vermont_culture.tif";
    params.legend = Legend("partial", {{101, 4}, {102, 5}, {122, 6}});  // most codes are unknown
    same_as_direct(params, 9);

    const Folder folder;
    Drawing d = hills(400, 300, GDT_Int16);
    draw(folder / "dem.tif", d);
    Drawing h = d;
    h.type = GDT_Float32;
    h.columns = 700;
    h.rows = 450;
    h.value = [](int c, int r) { return (c / 3 + r / 5) % 4 == 0 ? 1.0 + c % 11 : 0.0; };
    h.geotransform = {{1500.5, 3.1, 0, 1900.5, 0, -4.7}};  // finer, over a part
    draw(folder / "height.tif", h);
    Drawing k = d;
    k.type = GDT_Int32;
    k.columns = 150;
    k.rows = 120;
    k.geotransform = {{900, 31, 0, -800, 0, 29}};  // coarser, south up
    k.value = [](int c, int r) { return (c + r) % 3 == 0 ? 1000000 : 7 + c % 2; };
    draw(folder / "codes.tif", k);
    params = only(folder / "dem.tif");
    params.culture_height = folder / "height.tif";
    params.culture_height_scale = 1.7;
    params.culture = folder / "codes.tif";
    params.legend = Legend("drawn", {{7, 1}, {8, 2}});
    same_as_direct(params, 10);
}

TEST_CASE("within a scene's reach and sector every post is stored, and far from both none is", "[spill]") {
    const Folder folder;
    const Drawing d = hills(1500, 1200, GDT_Int16);  // 10 m posts: 15 km x 12 km
    draw(folder / "dem.tif", d);
    const DataBaseParams params = only(folder / "dem.tif");
    const auto direct = open_direct_source(params);
    for (const bool outside : {false, true})
        for (const Geometry geometry : {Geometry::grid, Geometry::geodesic}) {
            Scene scene = above(params);
            if (outside) scene.platform.xy = PointXY{-2000, -2000};
            scene.geometry = geometry;
            scene.range_m = outside ? 9000 : 4000;
            scene.platform.altitude_m = 1500;
            scene.platform.heading = Angle::degrees(70);
            scene.sector = Sector{Angle::degrees(-30), Angle::degrees(20)};
            const auto spilled = open_spilled_source(params, scene, in(folder, plenty));
            const ResolvedScene r = resolve(scene, *spilled);
            const Chunk a = direct->load({{0, 1500}, {0, 1200}}, false),
                        b = spilled->load({{0, 1500}, {0, 1200}}, false);
            std::int64_t wrong = 0, stored = 0, far = 0, far_stored = 0;
            for (std::int64_t y = 0; y < 1200; ++y)
                for (std::int64_t x = 0; x < 1500; ++x) {
                    const auto i = static_cast<std::size_t>(y * 1500 + x);
                    const bool here = !std::isnan(b.surface_m[i]);
                    stored += here;
                    wrong += here && a.surface_m[i] != b.surface_m[i];
                    const double dx = 10 * (static_cast<double>(x) - r.nadir.column),
                                 dy = 10 * (r.nadir.row - static_cast<double>(y)), arc = std::hypot(dx, dy);
                    // The sector with some degrees of skirt; the grid's north is within 2 degrees of true north here.
                    const double off = std::fabs(std::remainder(std::atan2(dx, dy) * 180 / 3.14159265358979 - 65, 360));
                    wrong += !here && arc < *scene.range_m && off < 27;
                    const bool is_far = arc > *scene.range_m + 6000 || (off > 60 && arc * std::sin(off / 57.3) > 6000);
                    far += is_far;
                    far_stored += is_far && here;
                }
            CHECK(wrong == 0);
            CHECK(stored > 10000);
            CHECK(far > 10000);
            CHECK(far_stored == 0);
            CHECK(bits(spilled->bare_terrain_m(3, 4)) == bits(direct->bare_terrain_m(3, 4)));  // read after all
        }
}

TEST_CASE("of a raster far larger than the scope few places are asked for, and no block is missed", "[spill]") {
    // A degree in 1200 posts, 60 000 each way.
    DataBase db;
    db.columns = db.rows = 60000;
    db.has_crs = true;
    db.step_x = 1.0 / 1200;
    db.step_y = -1.0 / 1200;
    int asked = 0;
    db.lat_lon = [&](double c, double r) {
        ++asked;
        return std::pair(60 - r / 1200, 5 + c / 1200);
    };
    PartitionScope scope;
    scope.geodesic = true;
    scope.lat_deg = 60 - 30000.0 / 1200;
    scope.lon_deg = 5 + 41000.0 / 1200;
    scope.nadir = {41000, 30000};
    for (const bool sector : {false, true}) {
        scope.reach_m = sector ? 300e3 : 40e3;
        scope.from_rad = sector ? 1.0 : 0;
        scope.width_rad = sector ? 0.7 : 7.0;
        asked = 0;
        const BlockSet found = blocks_in_scope(db, scope, 128);
        CHECK(asked < (sector ? 60000 : 12000));  // of 220 000 corners
        const double km_a_row = 111.2 / 1200, km_a_column = km_a_row * std::cos(scope.lat_deg * 3.14159265 / 180);
        int missed = 0, in_scope = 0, far = 0, far_taken = 0;
        for (std::int64_t row = 60; row < db.rows; row += 128)
            for (std::int64_t column = 60; column < db.columns; column += 128) {
                const double east = static_cast<double>(column - 41000) * km_a_column,
                             north = static_cast<double>(30000 - row) * km_a_row, arc = std::hypot(east, north),
                             azimuth = std::atan2(east, north);
                const bool taken = found.contains(column / 128, row / 128);
                if (arc < 0.97 * *scope.reach_m / 1000 && (!sector || (azimuth > 1.05 && azimuth < 1.65))) {
                    ++in_scope;
                    missed += !taken;
                } else if (arc > 1.03 * *scope.reach_m / 1000 + 40) {
                    ++far;
                    far_taken += taken;
                }
            }
        CHECK(in_scope > 40);
        CHECK(missed == 0);
        CHECK(far > 100000);
        CHECK(far_taken == 0);
    }
}

TEST_CASE("a file's block that no window can hold is decoded once in the pass", "[spill]") {
    const Folder folder;
    /// Heights that tell their place; counts how often a block other than the last one is asked for.
    class Blocks : public RasterLayer {
    public:
        Blocks(std::int64_t columns, std::int64_t rows, std::int64_t wide, std::int64_t high) {
            facts_.role = facts_.path = "drawn";
            facts_.columns = columns;
            facts_.rows = rows;
            facts_.block_columns = wide;
            facts_.block_rows = high;
            facts_.type = GDT_Float32;
            facts_.type_bytes = 4;
            facts_.compression = "DEFLATE";
        }
        void read_heights(const Window& window, float* out, std::int64_t stride) override {
            for (std::int64_t r = window.rows.begin / facts_.block_rows; r * facts_.block_rows < window.rows.end; ++r)
                for (std::int64_t c = window.columns.begin / facts_.block_columns;
                     c * facts_.block_columns < window.columns.end; ++c) {
                    decoded += std::pair(c, r) != last_;
                    last_ = {c, r};
                }
            for (std::int64_t r = 0; r < window.rows.size(); ++r)
                for (std::int64_t c = 0; c < window.columns.size(); ++c)
                    out[r * stride + c] = post(window.columns.begin + c, window.rows.begin + r);
        }
        static float post(std::int64_t c, std::int64_t r) {
            return static_cast<float>(c % 977) + 0.25F * static_cast<float>(r % 631);
        }
        void read_values(const Window&, void*, GDALDataType, std::int64_t) override {}
        std::uint64_t fingerprint(const std::vector<Window>&) override { return 1; }
        int decoded = 0;

    private:
        std::pair<std::int64_t, std::int64_t> last_{-1, -1};
    };
    struct Shape {
        std::int64_t wide, high;
        int blocks;
    };
    for (const Shape& shape :
         {Shape{1024, 1024, 9}, Shape{3000, 640, 5}, Shape{896, 3000, 4}, Shape{2048, 2048, 4}, Shape{256, 256, 144}})
        for (const std::size_t memory : {std::size_t{1} << 20, std::size_t{3} << 20, std::size_t{20} << 20}) {
            INFO("blocks of " << shape.wide << " x " << shape.high << " in " << memory);
            Blocks in(3000, 2800, shape.wide, shape.high);
            SpillParams params;
            params.folder = folder / "";
            params.memory_bytes = std::size_t{64} << 20;
            Spill spill(params);
            SpillLayer layer;
            layer.name = "drawn";
            layer.posts_columns = 3000;
            layer.posts_rows = 2800;
            const BlockSet blocks = all_blocks(3000, 2800, spill_edge);
            layer.blocks = blocks.blocks;
            const LayerPass pass{in,
                                 false,
                                 blocks,
                                 false,
                                 spill,
                                 spill.add_layer(layer),
                                 [](const Window&) { return WedgeBuckets::Place{}; },
                                 nullptr,
                                 {}};
            PassParams how;
            how.memory_bytes = memory;
            how.threads = 1;
            run_pass(pass, how);
            spill.seal();
            // Of blocks of 256 posts several lie in a window.
            CHECK(in.decoded <= (shape.wide == 256 ? 2 : 1) * shape.blocks);
            std::vector<std::byte> buffer;
            int wrong = 0;
            for (std::int64_t r = 0; r < blocks.blocks.rows.end; ++r)
                for (std::int64_t c = 0; c < blocks.blocks.columns.end; ++c) {
                    const Window posts = spill.layer(0).posts(c, r);
                    std::vector<float> heights(static_cast<std::size_t>(posts.posts()));
                    const auto bytes = spill.get(0, c, r, buffer);
                    wrong += !unpack_heights(bytes, posts.columns.size(), posts.rows.size(), {1, 0, 1},
                                             {{0, posts.columns.size()}, {0, posts.rows.size()}}, heights.data(),
                                             posts.columns.size());
                    wrong += heights.back() != Blocks::post(posts.columns.end - 1, posts.rows.end - 1) ||
                             heights.front() != Blocks::post(posts.columns.begin, posts.rows.begin);
                }
            CHECK(wrong == 0);
        }
}

TEST_CASE("the block map made on the way bounds every block with the first posts beyond it", "[spill][threads]") {
    const Folder folder;
    Drawing d = hills(451, 330, GDT_Int16);
    d.no_data = -12345;
    d.value = [](int c, int r) {
        return (c - 200) * (c - 200) + (r - 50) * (r - 50) < 900 ? -12345 : c * 3 - r * 2 + c * r % 13;
    };
    draw(folder / "dem.tif", d);
    Drawing h = d;
    h.value = [](int c, int r) { return c % 50 == 32 && r % 40 == 32 ? c : 0; };
    draw(folder / "height.tif", h);
    DataBaseParams params = only(folder / "dem.tif");
    params.culture_height = folder / "height.tif";
    Drawing w = hills(720, 200, GDT_Int16);
    w.crs = "EPSG:4326";
    w.geotransform = {{-180.25, 0.5, 0, 50, 0, -0.5}};
    w.value = [](int c, int r) { return c == 0 ? 3000 + r : c; };
    draw(folder / "world.tif", w);
    Scene near = above(params);
    near.range_m = 1000;
    for (const auto& [what, scene] : {std::pair(params, above(params)), std::pair(params, near),
                                      std::pair(only(folder / "world.tif"), above(only(folder / "world.tif")))}) {
        const auto source = open_spilled_source(what, scene, in(folder, plenty));
        const DataBase& db = source->data_base();
        BlockMap* map = source->block_map();
        REQUIRE(map);
        const std::int64_t columns = db.columns + (db.cyclic ? 1 : 0);
        const Chunk all = source->load({{0, columns}, {0, db.rows}}, false);
        std::int64_t wrong = 0, blocks = 0;
        for (int level = 0; level < map->levels(); ++level) {
            const std::int64_t edge = block_posts << level, nc = (db.columns + edge - 1) / edge,
                               nr = (db.rows + edge - 1) / edge;
            const BlockWindow found = map->read(level, {{0, nc}, {0, nr}});
            for (std::int64_t br = 0; br < nr; ++br)
                for (std::int64_t bc = 0; bc < nc; ++bc) {
                    BlockBounds want;
                    std::int64_t voids = 0, posts = 0;
                    for (std::int64_t r = br * edge; r <= std::min(br * edge + edge, db.rows - 1); ++r)
                        for (std::int64_t c = bc * edge; c <= std::min(bc * edge + edge, columns - 1); ++c, ++posts) {
                            const auto i = static_cast<std::size_t>(r * columns + c);
                            const float culture = all.culture_height_m.empty() ? 0 : all.culture_height_m[i];
                            const float z = all.surface_m[i] - culture;  // whole numbers: exact
                            want.culture_m = std::max(want.culture_m, culture);
                            voids += std::isnan(z);
                            if (std::isnan(z)) continue;
                            want.lowest_m = std::min(want.lowest_m, z);
                            want.highest_m = std::max(want.highest_m, z);
                        }
                    want.voids = voids == 0 ? Voids::none : voids == posts ? Voids::all : Voids::some;
                    const BlockBounds& got = found.at(bc, br);
                    // Where all is void, culture heights do not matter.
                    wrong += want.voids == Voids::all ? got.voids != Voids::all : !(got == want);
                    ++blocks;
                }
            if (level + 1 == map->levels()) CHECK((nc <= 64 && nr <= 64));
        }
        CHECK(wrong == 0);
        CHECK(blocks > 20);
        if (db.cyclic)
            CHECK(map->read(0, {{22, 23}, {1, 2}}).at(22, 1).highest_m == 3064);  // column 0 is its neighbour
    }
}

TEST_CASE("blocks that a request does not need are not read, and are counted by reason", "[spill]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(640, 512, GDT_Int16));
    const DataBaseParams params = only(folder / "dem.tif");
    const auto direct = open_direct_source(params);
    const auto source = open_spilled_source(params, above(params), in(folder, little));
    const std::int64_t edge = source->data_base().block_columns;
    std::mt19937 random(30);
    for (const bool by_columns : {false, true}) {
        ChunkRequest request;
        request.window = {{70, 500}, {33, 300}};
        request.lines_are_columns = by_columns;
        request.blocks = blocks_of(request.window);
        const auto n = static_cast<std::size_t>(request.blocks.posts());
        for (std::size_t i = 0; i < n; ++i) {
            const bool far = static_cast<std::int64_t>(i) % request.blocks.columns.size() > 6;
            request.skip.push_back(far || random() % 3 == 0 ? Skip::hidden : Skip::none);
            request.fill_m.push_back(5000 + static_cast<float>(i));
        }
        const std::uint64_t before = source->report().spill_read_bytes;
        const Chunk got = source->load(request), want = direct->load(request.window, by_columns);
        std::int64_t wrong = 0, filled = 0;
        for (std::int64_t r = 33; r < 300; ++r)
            for (std::int64_t c = 70; c < 500; ++c) {
                const std::size_t i = static_cast<std::size_t>(by_columns ? (c - 70) * (300 - 33) + r - 33
                                                                          : (r - 33) * (500 - 70) + c - 70);
                bool needed = false;
                for (const std::int64_t y : {r - 2, r + 2})
                    for (const std::int64_t x : {c - 2, c + 2}) {
                        const Window b = blocks_of({{x, x + 1}, {y, y + 1}});
                        if (!request.blocks.columns.contains(b.columns.begin) ||
                            !request.blocks.rows.contains(b.rows.begin))
                            continue;
                        needed |= request.skip[static_cast<std::size_t>(
                                      (b.rows.begin - request.blocks.rows.begin) * request.blocks.columns.size() +
                                      b.columns.begin - request.blocks.columns.begin)] == Skip::none;
                    }
                const Window own = blocks_of({{c, c + 1}, {r, r + 1}});
                const float fill = 5000 + static_cast<float>((own.rows.begin - request.blocks.rows.begin) *
                                                                 request.blocks.columns.size() +
                                                             own.columns.begin - request.blocks.columns.begin);
                const bool is_fill = got.surface_m[i] == fill;
                filled += is_fill;
                wrong += !is_fill && got.surface_m[i] != want.surface_m[i];
                wrong += needed && is_fill;
            }
        CHECK(wrong == 0);
        CHECK(filled > 30000);
        CHECK(got.posts_read < static_cast<std::uint64_t>(request.window.posts()));
        CHECK(source->report().spill_read_bytes - before < 2 * got.posts_read + 2 * 4 * 512 * 640 / 4);
    }
    const Skipped skipped = source->skipped();
    const std::uint64_t hidden = skipped[static_cast<std::size_t>(Skip::hidden)].tiles,
                        never = skipped[static_cast<std::size_t>(Skip::range)].tiles;
    CHECK(hidden > 0);
    // Columns right of the window and rows below it were never asked for.
    CHECK(never >= static_cast<std::uint64_t>((512 - 300) / edge * (640 / edge)));
    CHECK(hidden + never < static_cast<std::uint64_t>(640 / edge * (512 / edge)));
}

TEST_CASE("of a rectangle the parts are read that hold posts that are needed", "[spill]") {
    // Along its longer side, or in runs of blocks.
    const bool runs = GENERATE(false, true);
    std::mt19937 random(31);
    const auto upto = [&](std::int64_t most) {
        return static_cast<std::int64_t>(random() % static_cast<unsigned>(most));
    };
    constexpr std::int64_t margin = ChunkRequest::margin;
    std::int64_t uncovered = 0, outside = 0, twice = 0, idle = 0, parts_of_some = 0, left_out = 0, beside = 0;
    for (int trial = 0; trial < 400; ++trial) {
        ChunkRequest request;
        const std::int64_t c0 = upto(100) - 50, r0 = upto(100);
        request.window = {{c0, c0 + 40 + upto(trial % 2 ? 900 : 60)}, {r0, r0 + 40 + upto(trial % 2 ? 60 : 900)}};
        request.blocks = blocks_of(request.window);
        const std::uint64_t rare = 1 + random() % 12;
        for (std::int64_t i = 0; i < request.blocks.posts(); ++i) {
            request.skip.push_back(random() % rare == 0 ? Skip::none : Skip::hidden);
            request.fill_m.push_back(0);
        }
        const auto counts = [&](std::int64_t c, std::int64_t r) {  // the block of a post
            const Window b = blocks_of({{c, c + 1}, {r, r + 1}});
            const Interval columns = request.blocks.columns, rows = request.blocks.rows;
            return columns.contains(b.columns.begin) && rows.contains(b.rows.begin) &&
                   request.skip[static_cast<std::size_t>((b.rows.begin - rows.begin) * columns.size() +
                                                         b.columns.begin - columns.begin)] == Skip::none;
        };
        const Interval all_columns = request.window.columns, all_rows = request.window.rows;
        const std::int64_t c1 = all_columns.begin + upto(all_columns.size()),
                           r1 = all_rows.begin + upto(all_rows.size());
        const Window some{{c1, c1 + 1 + upto(all_columns.end - c1)}, {r1, r1 + 1 + upto(all_rows.end - r1)}};
        std::vector<int> read(static_cast<std::size_t>(some.posts()));
        int parts = 0;
        const auto take = [&](const Window& part) {
            ++parts;
            const Window inside{intersection(part.columns, some.columns), intersection(part.rows, some.rows)};
            outside += part.posts() - inside.posts();
            bool any = false;  // within the margin of it
            for (std::int64_t r = inside.rows.begin; r < inside.rows.end; ++r)
                for (std::int64_t c = inside.columns.begin; c < inside.columns.end; ++c) {
                    ++read[static_cast<std::size_t>((r - some.rows.begin) * some.columns.size() + c -
                                                    some.columns.begin)];
                    for (const std::int64_t y : {r - margin, r, r + margin})
                        for (const std::int64_t x : {c - margin, c, c + margin}) any = any || counts(x, y);
                }
            idle += !any;
        };
        if (runs)
            NeededPosts(request).each_run(some, take);
        else
            NeededPosts(request).each_part(some, take);
        parts_of_some += parts > 1;
        for (std::int64_t r = some.rows.begin; r < some.rows.end; ++r)
            for (std::int64_t c = some.columns.begin; c < some.columns.end; ++c) {
                bool needed = false;
                for (const std::int64_t y : {r - margin, r, r + margin})
                    for (const std::int64_t x : {c - margin, c, c + margin}) needed = needed || counts(x, y);
                const int n = read[static_cast<std::size_t>((r - some.rows.begin) * some.columns.size() + c -
                                                            some.columns.begin)];
                uncovered += needed && n == 0;
                twice += n > (runs ? 4 : 1);  // within the margin of four runs
                beside += !needed && n > 0;
                left_out += n == 0;
            }
    }
    CHECK(uncovered == 0);
    CHECK(outside == 0);
    CHECK(twice == 0);
    if (runs) CHECK(beside == 0);
    CHECK(idle == 0);
    CHECK(parts_of_some > 60);
    CHECK(left_out > 100000);
}

TEST_CASE("a raster that changes under the pass is an error that names it", "[spill]") {
    const Folder folder;
    const Folder temporary;
    draw(folder / "dem.tif", hills(600, 400, GDT_Int16));
    const DataBaseParams params = only(folder / "dem.tif");
    SpillOptions options = in(temporary, little);
    options.progress = [&](double) { std::ofstream(folder / "dem.tif", std::ios::app | std::ios::binary) << "x"; };
    CHECK_THAT(refusal([&] { open_spilled_source(params, above(params), options); }),
               Contains("dem.tif") && Contains("changed while it was read"));
    CHECK(temporary.names().empty());
}

TEST_CASE("what the spill does not hold is not taken from a raster that changed after the pass", "[spill]") {
    const Folder folder;
    const Folder temporary;
    draw(folder / "dem.tif", hills(1200, 800, GDT_Int16));
    const DataBaseParams params = only(folder / "dem.tif");
    Scene near = above(params);
    near.range_m = 500;
    const auto source = open_spilled_source(params, near, in(temporary, little));
    const Extremes before = source->extremes();
    CHECK(before.highest_m > before.lowest_m);
    const float inside = source->bare_terrain_m(600, 400);
    using std::filesystem::last_write_time;
    last_write_time(folder / "dem.tif", last_write_time(folder / "dem.tif") + std::chrono::milliseconds(1));
    CHECK_THROWS_WITH(source->extremes(), Contains("dem.tif") && Contains("changed while it was read"));
    CHECK_THROWS_AS(source->bare_terrain_m(0, 0), DataError);
    CHECK(source->bare_terrain_m(600, 400) == inside);
}

TEST_CASE("a stop is heard during the pass", "[spill][threads]") {
    const Folder folder;
    const Folder temporary;
    draw(folder / "dem.tif", hills(600, 400, GDT_Int16));
    const DataBaseParams params = only(folder / "dem.tif");
    Stop stop;
    SpillOptions options = in(temporary, little);
    options.stop = &stop;
    double reached = 0;
    options.progress = [&](double part) {
        CHECK(part >= reached);
        CHECK(part <= 1);
        reached = part;
        stop.request(SIGTERM);
    };
    CHECK_THROWS_AS(open_spilled_source(params, above(params), options), Interrupted);
    CHECK(reached < 1);
    CHECK(temporary.names().empty());
}

TEST_CASE("many threads read the same posts through one spill", "[spill][threads]") {
    const Folder folder;
    const DataBaseParams params = only(data + "/olympic_coast_dem.tif");
    const auto direct = open_direct_source(params);
    const auto source = open_spilled_source(params, above(params), in(folder, std::size_t{4} << 20));
    CHECK(source->report().spilled_bytes > 0);
    std::vector<std::thread> threads;
    std::atomic<std::int64_t> wrong = 0;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
            std::mt19937 random(static_cast<unsigned>(t));
            for (int k = 0; k < 6; ++k) {
                const Window w{pick(random, 0, 1200), pick(random, 0, 900)};
                wrong += differences(direct->load(w, k % 2 == 0).surface_m, source->load(w, k % 2 == 0).surface_m) != 0;
            }
        });
    for (std::thread& thread : threads) thread.join();
    CHECK(wrong == 0);
}

TEST_CASE("a scene gives the same bits from the spill as from the raster", "[spill][long]") {
    const Folder folder;
    const DataBaseParams params = inland_empire();
    const auto direct = open_direct_source(params);
    Scene scene = over_inland_empire();
    for (const bool narrow : {false, true}) {
        if (narrow) {
            scene.range_m = 15000;
            scene.sector = Sector{Angle::degrees(100), Angle::degrees(230)};
        }
        EngineParams engine;
        engine.threads = 2;
        const RunResult want = run(resolve(scene, *direct), *direct, engine);
        for (const std::size_t memory : {std::size_t{2} << 20, plenty}) {
            const auto spilled = open_spilled_source(params, scene, in(folder, memory));
            for (const std::int64_t wedges : {1, 7}) {
                engine.wedges = wedges;
                const RunResult got = run(resolve(scene, *spilled), *spilled, engine);
                CHECK(*got.scene.scene.range_m == *want.scene.scene.range_m);
                CHECK(got.echo_w.cells == want.echo_w.cells);
                CHECK(got.echo_state.cells == want.echo_state.cells);
            }
        }
    }
}

TEST_CASE("posts return the same from the spill as from the raster, beside a scene or alone", "[spill][long]") {
    const Folder folder;
    const DataBaseParams params = inland_empire();
    const auto direct = open_direct_source(params);
    Scene scene = over_inland_empire();
    scene.land = LandModel::ulaby_dobson;
    scene.weather.rain_mm_h = 4;
    const auto response = [](const Scene& of, WedgeSource& source) {
        CoverageParams coverage;
        coverage.layer = CoverageLayer::response;
        coverage.threads = 2;
        std::map<std::pair<std::int64_t, std::int64_t>, std::vector<std::uint32_t>> tiles;
        cover(resolve_coverage(of, source), source, coverage, [&](const CoverageTile& tile) {
            auto& into = tiles[{tile.window.columns.begin, tile.window.rows.begin}];
            for (std::int64_t r = 0; r < tile.window.rows.size(); ++r)
                for (std::int64_t c = 0; c < tile.window.columns.size(); ++c)
                    into.push_back(bits(tile.values[r * tile.stride + c]));
        });
        return tiles;
    };
    for (const bool narrow : {false, true}) {
        if (narrow) {
            scene.range_m = 15000;
            scene.sector = Sector{Angle::degrees(100), Angle::degrees(230)};
        }
        for (const bool alone : {false, true}) {
            Scene covered = scene;
            if (!alone) covered.range_m = *resolve(scene, *direct).scene.range_m;
            const auto want = response(covered, *direct);
            for (const std::size_t memory : {std::size_t{2} << 20, plenty}) {
                INFO((narrow ? "narrow, " : "") << (alone ? "alone, " : "beside a scene, ") << memory << " bytes");
                SpillOptions options = in(folder, memory);
                options.all_round = true;
                options.all_of_it = alone;
                const auto spilled = open_spilled_source(params, scene, options);
                CHECK((spilled->report().spilled_bytes > 0) == (memory != plenty));
                if (!alone) CHECK(*resolve(scene, *spilled).scene.range_m == *covered.range_m);
                CHECK(response(covered, *spilled) == want);
            }
        }
    }
}

TEST_CASE("what comes back from the spill's file is counted with the wedge or quadrant that it came back for",
          "[spill][long]") {
    const Folder folder;
    const DataBaseParams params = inland_empire();
    Scene scene = over_inland_empire();
    scene.range_m = 15000;
    SpillOptions options = in(folder, std::size_t{2} << 20);
    options.all_round = options.all_of_it = true;
    for (const std::size_t memory : {std::size_t{2} << 20, plenty}) {
        options.memory_bytes = memory;
        const auto source = open_spilled_source(params, scene, options);
        CHECK((source->report().spilled_bytes > 0) == (memory != plenty));
        const ResolvedScene resolved = resolve(scene, *source);
        const std::uint64_t before = source->report().spill_read_bytes;
        EngineParams engine;
        engine.threads = 2;
        engine.wedges = 7;
        const RunReport report = run(resolved, *source, engine).report;
        std::uint64_t wedges = 0, touched = 0;
        for (const WedgeReport& w : report.wedges) wedges += w.bytes_spilled, touched += w.bytes_spilled > 0;
        CHECK(wedges == report.source.spill_read_bytes - before);
        // No bucket is held that is larger than one on disk, so that most wedges meet the file.
        CHECK(touched == (memory == plenty ? 0 : report.wedges.size()));

        const ResolvedScene all = resolve_coverage(scene, *source);
        const std::uint64_t start = source->report().spill_read_bytes;
        CoverageParams coverage;
        coverage.threads = 2;
        const CoverageReport seen = cover(all, *source, coverage, [](const CoverageTile&) {});
        CHECK(seen.total().bytes_spilled == seen.source.spill_read_bytes - start);
        for (const QuadrantReport& q : seen.quadrants) CHECK((q.bytes_spilled > 0) == (memory != plenty));
    }
}
