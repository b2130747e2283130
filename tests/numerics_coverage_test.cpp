// Coverage at the ends of its numbers, against the reference in long double and closed forms: sensors from 1 m to 30 km up,
// 0.3-m to 1-km posts, 800 km, grazing to 1e-6 rad, places on posts, lines and corners, cliffs and ties; and rasters of more
// than 2^31 posts. What was found, with the bounds: docs/numerics.md.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "lib/coverage.hpp"
#include "lib/engine.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/reference/line_of_sight.hpp"
#include "tests/reference/long_walk.hpp"
#include "tests/terrain.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/sources.hpp"

using namespace wedgescope;
using test::Folder;
using test::MemorySource;

namespace {

const GdalSession session(std::size_t{32} << 20, {});

struct Place {
    double column, row, up_m;
};

Scene scene_at(const DataBase& db, const Place& place, std::optional<double> earth_k) {
    Scene s;
    s.platform.xy = PointXY{db.origin_x + place.column * db.step_x, db.origin_y + place.row * db.step_y};
    s.platform.altitude_above = AltitudeAbove::ground;
    s.platform.altitude_m = place.up_m;
    s.geometry = Geometry::grid;
    s.earth_k = earth_k;
    return s;
}

std::vector<std::uint8_t> mask_of(WedgeSource& source, const Scene& scene, const CoverageParams& params = {}) {
    const DataBase& db = source.data_base();
    std::vector<std::uint8_t> all(static_cast<std::size_t>(db.columns * db.rows), 77);
    cover(resolve_coverage(scene, source), source, params, [&](const CoverageTile& tile) {
        for (std::int64_t r = tile.window.rows.begin; r < tile.window.rows.end; ++r)
            std::copy_n(tile.bytes + (r - tile.window.rows.begin) * tile.stride, tile.window.columns.size(),
                        all.begin() + r * db.columns + tile.window.columns.begin);
    });
    return all;
}

/// What a mask says of some posts against the long walk.
struct Judged {
    int posts = 0, seen = 0, wrong = 0;
    double worst_rad = 0;  ///< by which a ray of a wrong post clears or is hidden, over the post's distance
    double wrong_percent() const { return 100.0 * wrong / posts; }
};

Judged judge(MemorySource& source, const std::function<double(double, double)>& height, const Place& place,
             Quality quality, std::optional<double> earth_k, int wanted, std::optional<bool> curved_course = {}) {
    const DataBase& db = source.data_base();
    Scene scene = scene_at(db, place, earth_k);
    scene.quality = quality;
    scene.curved_course = curved_course;
    const ResolvedScene resolved = resolve_coverage(scene, source);
    const std::vector<std::uint8_t> mask = mask_of(source, scene);
    reference::LongPlane plane;
    plane.columns = db.columns;
    plane.rows = db.rows;
    plane.height_m = [&](std::int64_t c, std::int64_t r) {
        return static_cast<double>(static_cast<float>(height(static_cast<double>(c), static_cast<double>(r))));
    };
    plane.column_m = db.step_x;
    plane.row_m = db.step_y;
    plane.sensor_column = resolved.nadir.column;
    plane.sensor_row = resolved.nadir.row;
    plane.sensor_m = resolved.sensor_m;
    plane.radius_m = earth_k ? static_cast<long double>(*earth_k) * 6371008.7714L : 0;
    const reference::LongWalk walk(plane);
    std::mt19937 random(99);
    Judged j;
    while (j.posts < wanted) {
        const auto c = static_cast<std::int64_t>(random() % static_cast<unsigned>(db.columns)),
                   r = static_cast<std::int64_t>(random() % static_cast<unsigned>(db.rows));
        const double reach = std::hypot((static_cast<double>(c) - place.column) * db.step_x,
                                        (static_cast<double>(r) - place.row) * db.step_y);
        // Hidden by more than a thousandth of the way: no doubt is left.
        const auto clearance = static_cast<double>(walk.clearance_m(c, r, 0, 1e-3L * reach));
        const bool sees = clearance >= -1e-12 * reach, told = mask[static_cast<std::size_t>(r * db.columns + c)] == 255;
        ++j.posts;
        j.seen += sees;
        j.wrong += sees != told;
        if (sees != told && reach > 0) j.worst_rad = std::max(j.worst_rad, std::abs(clearance) / reach);
    }
    return j;
}

}  // namespace

TEST_CASE("posts of 0.3 m to 1 km are judged rightly from 1 m to 30 km up", "[numerics][coverage]") {
    const auto hills = test::rolling(1, 60, 5);
    for (const double post_m : {0.3, 30.0, 1000.0})
        for (const double up_m : {1.0, 1000.0, 30000.0}) {
            const auto height = [&](double c, double r) { return 500 + hills(c, r) * std::min(3 * post_m, 3000.0); };
            MemorySource source(301, 291, post_m, height);
            for (const Quality quality : {Quality::normal, Quality::exact}) {
                const Judged j = judge(source, height, {150.3, 149.6, up_m}, quality, 4.0 / 3, 1500);
                INFO(post_m << "-m posts, sensor " << up_m << " m up, " << word(quality) << ": " << j.wrong << " of "
                            << j.posts << " wrong, " << j.seen << " seen, by at most " << j.worst_rad << " rad");
                CHECK(j.wrong <= 3);
                // A metre up all but the ground beside the sensor is hidden, from high above the least is.
                CHECK(j.seen >= 5);
                if (up_m == 1) CHECK(j.posts - j.seen > 1000);
                CHECK(j.worst_rad < 1e-3);
            }
        }
}

TEST_CASE("a sensor on a post, a line, an edge, a corner or a diagonal sees what it sees", "[numerics][coverage]") {
    const auto hills = test::rolling(90, 50, 12);
    const auto height = [&](double c, double r) { return 500 + hills(c, r); };
    MemorySource source(257, 257, 30, height);
    for (const Place& place : {Place{128, 128, 60},
                               {128, 128.37, 60},
                               {64.5, 200, 60},
                               {0, 100.25, 200},
                               {256, 99, 200},
                               {0, 0, 300},
                               {256, 256, 300},
                               {0, 256, 300},
                               {128.5, 128.5, 60},
                               {31.999999, 32.000001, 60},
                               {128, 128, 0}}) {
        const Judged j = judge(source, height, place, Quality::exact, 4.0 / 3, 250);
        INFO("sensor at " << place.column << ", " << place.row << ", " << place.up_m << " m up: " << j.wrong
                          << " wrong of " << j.posts << ", " << j.seen << " seen, by " << j.worst_rad << " rad");
        CHECK(j.wrong <= 1);
        CHECK(j.worst_rad < 1e-4);
    }
}

TEST_CASE("a sensor on rough ground or close above it sees what the ground's course inside cells leaves",
          "[numerics][coverage]") {
    // Pieces of real terrain, and ground on which every cell is twisted.
    struct Ground {
        const char* name;
        std::function<double(double, double)> height;
    };
    constexpr int edge = 129;
    const auto piece_of = [](const char* file, std::int64_t column, std::int64_t row) {
        const reference::Raster raster = reference::read(std::string(WEDGESCOPE_TEST_DATA) + "/" + file, false);
        return [matrix = raster.matrix, column, row](double c, double r) {
            return matrix.at(column + static_cast<std::int64_t>(c), row + static_cast<std::int64_t>(r));
        };
    };
    const Ground grounds[] = {{"inland_empire", piece_of("inland_empire_dem.tif", 150, 150)},
                              {"lake_sunapee", piece_of("lake_sunapee_dem.tif", 60, 60)},
                              {"chequered",
                               [](double c, double r) {
                                   return 500 + (static_cast<int>(c + r) % 2 ? 10 : 0) + 0.01 * std::sin(c * 7 + r * r);
                               }},
                              {"rolling", test::rolling(300, 60, 5)}};
    double straight_rad = 0;
    for (const Ground& ground : grounds) {
        MemorySource source(edge, edge, 30, ground.height);
        std::mt19937 random(3);
        std::uniform_real_distribution<double> place(edge * 0.2, edge * 0.8);
        std::map<double, Judged> of_height;
        for (int sensor = 0; sensor < 8; ++sensor) {
            double column = place(random), row = place(random);
            if (sensor % 4 == 3) column = std::floor(column), row = std::floor(row);
            for (const double up_m : {0.0, 0.5, 2.0, 10.0, 50.0}) {
                const Judged j = judge(source, ground.height, {column, row, up_m}, Quality::normal, 4.0 / 3, 600);
                Judged& sum = of_height[up_m];
                sum.posts += j.posts;
                sum.seen += j.seen;
                sum.wrong += j.wrong;
                sum.worst_rad = std::max(sum.worst_rad, j.worst_rad);
                if (up_m == 0) {
                    const Judged other =
                        judge(source, ground.height, {column, row, 0}, Quality::normal, 4.0 / 3, 600, false);
                    straight_rad = std::max(straight_rad, other.worst_rad);
                }
                // No sample inside a cell stands higher than the block that it is in.
                Scene scene = scene_at(source.data_base(), {column, row, up_m}, 4.0 / 3);
                CoverageParams all;
                all.cull = false;
                CHECK((mask_of(source, scene) == mask_of(source, scene, all)));
            }
        }
        for (const auto& [up_m, sum] : of_height) {
            INFO(ground.name << ", sensors " << up_m << " m up: " << sum.wrong << " wrong of " << sum.posts << ", "
                             << sum.seen << " seen, by " << sum.worst_rad << " rad");
            CHECK(sum.seen > 100);
            CHECK(sum.posts - sum.seen > 500);
            // On the chequered ground posts stand level to a centimetre: many a ray all but touches those before.
            CHECK(sum.wrong_percent() <= (std::string(ground.name) == "chequered" ? 4 : 0.2));
            CHECK(sum.worst_rad < 1.5e-3);
        }
    }
    INFO("straight from sample to sample: wrong by up to " << straight_rad << " rad");
    CHECK(straight_rad > 4e-3);
}

TEST_CASE("what towers on single posts near the sensor hide and show is told, from draft on", "[numerics][coverage]") {
    constexpr int edge = 129;
    struct Bound {
        Quality quality;
        double wrong_percent;
    };
    // With 64 spokes a unit of slope, as it was, some 3, 1.6, 1.6 and 0.5 % were wrong.
    for (const Bound& bound : {Bound{Quality::draft, 1.6}, Bound{Quality::normal, 0.6}, Bound{Quality::fine, 0.2},
                               Bound{Quality::exact, 0.04}}) {
        Judged all;
        for (const double tower_m : {15, 30, 60}) {
            std::mt19937 random(7);
            std::vector<double> posts;
            for (int i = 0; i < edge * edge; ++i)
                posts.push_back((random() % 20 == 0 ? tower_m : 0) + static_cast<double>(random() % 1000) * 1e-3);
            const auto height = [&](double c, double r) {
                return posts[static_cast<std::size_t>(r) * edge + static_cast<std::size_t>(c)];
            };
            MemorySource source(edge, edge, 30, height);
            for (const double up_m : {5, 40, 100}) {
                const Judged j = judge(source, height, {64.6, 64.2, up_m}, bound.quality, 4.0 / 3, 2500);
                all.posts += j.posts;
                all.seen += j.seen;
                all.wrong += j.wrong;
            }
        }
        INFO(word(bound.quality) << ": " << all.wrong << " of " << all.posts << " wrong, " << all.seen << " seen");
        CHECK(all.seen > all.posts / 10);
        CHECK(all.posts - all.seen > all.posts / 10);
        CHECK(all.wrong_percent() <= bound.wrong_percent);
    }
}

TEST_CASE("ground 800 km away is judged rightly", "[numerics][coverage]") {
    const auto hills = test::rolling(800, 50, 5);
    const auto height = [&](double c, double r) { return 1500 + 1000 * std::sin(c * 0.06) + hills(c, r); };
    MemorySource source(810, 17, 1000, height);
    for (const double up_m : {1.0, 30000.0})
        for (const auto earth_k : {std::optional<double>(), std::optional(4.0 / 3)}) {
            const Judged j = judge(source, height, {3.3, 8.2, up_m}, Quality::exact, earth_k, 800);
            INFO("sensor " << up_m << " m up, " << (earth_k ? "round" : "flat") << ": " << j.wrong << " wrong of "
                           << j.posts << ", " << j.seen << " seen, by " << j.worst_rad << " rad");
            CHECK(j.seen > (up_m > 1 ? 130 : 1));
            CHECK(j.posts - j.seen > (up_m > 1 ? 130 : 700));
            CHECK(j.wrong <= 1);
            CHECK(j.worst_rad < 2e-5);
        }
}

TEST_CASE("elevations a millionth of a radian apart are told apart", "[numerics][coverage]") {
    // Looking east along a row, every post at a tangent drawn by lot in steps of 1e-6 round a gentle fall; as far as
    // 120 km heights in single precision hold them to 1e-8.
    constexpr double post_m = 30, sensor_m = 900;
    std::mt19937 random(5);
    std::vector<int> step(4001);
    int climb = 0;
    for (int& s : step) {
        // A staircase that rises now and then by a step and mostly hides a step or two below.
        if (random() % 40 == 0) ++climb;
        s = climb - static_cast<int>(random() % 3);
    }
    const auto tangent = [&](std::int64_t c) { return -0.0075 + 1e-6 * step[static_cast<std::size_t>(c)]; };
    MemorySource source(4001, 5, post_m, [&](double c, double) {
        return c < 1 ? 0.0 : sensor_m + tangent(static_cast<std::int64_t>(c)) * c * post_m;
    });
    Scene s = scene_at(source.data_base(), {0, 2, sensor_m}, std::nullopt);
    const std::vector<std::uint8_t> mask = mask_of(source, s);
    int before = step[1], wrong = 0, seen = 0, hidden = 0;
    for (std::int64_t c = 2; c <= 4000; ++c) {
        const int here = step[static_cast<std::size_t>(c)];
        // Steps apart only: a tie is decided by the heights' own rounding.
        if (here != before) {
            const bool sees = here > before;
            (sees ? seen : hidden) += 1;
            wrong += (mask[static_cast<std::size_t>(2 * 4001 + c)] == 255) != sees;
        }
        before = std::max(before, here);
    }
    INFO(seen << " seen, " << hidden << " hidden");
    CHECK(wrong == 0);
    CHECK(seen > 40);
    CHECK(hidden > 1000);
}

TEST_CASE("what is exactly level with its horizon is seen, on plateaus and on tilted steps", "[numerics][coverage]") {
    // Whole metres: every tangent on these rays is exact, and every post level with the brink before it.
    MemorySource plateau(300, 200, 8, [](double c, double r) { return c > 40 && r > 20 ? 512 : 128; });
    const std::vector<std::uint8_t> level =
        mask_of(plateau, scene_at(plateau.data_base(), {20, 100, 384}, std::nullopt));
    for (std::int64_t r = 25; r < 175; ++r)
        for (std::int64_t c = 41; c < 300; ++c) {
            INFO("column " << c << ", row " << r);
            REQUIRE(level[static_cast<std::size_t>(r * 300 + c)] == 255);
        }
    // A hair lower and all but the brink are hidden: a metre at 2 km against 192 m.
    const std::vector<std::uint8_t> below =
        mask_of(plateau, scene_at(plateau.data_base(), {20, 100, 383}, std::nullopt));
    CHECK(below[100 * 300 + 41] == 255);
    for (std::int64_t c = 42; c < 300; ++c) CHECK(below[static_cast<std::size_t>(100 * 300 + c)] == 0);
}

TEST_CASE("no pit hides what is level with the sensor, the highest there is", "[numerics][coverage]") {
    // Pits of whole metres in two of three posts. No ray to a post at the top comes below anything, whatever lies between.
    const auto height = [](double c, double r) {
        const auto drawn = static_cast<std::uint32_t>(c * 7919 + r * 104729 + 17) * 2654435761U >> 16;
        return drawn % 3 == 0 ? 100.0 : 100.0 - static_cast<double>(1 + drawn % 39);
    };
    MemorySource source(180, 170, 30, height);
    for (const Place& place : {Place{90, 80, 0}, {89.5, 79.5, 0}, {46.123, 13.77, 0}, {-20.3, 40.9, 0}})
        for (const std::optional<bool> curved : {std::optional<bool>(), std::optional(true), std::optional(false)}) {
            Scene scene = scene_at(source.data_base(), place, std::nullopt);
            scene.platform.altitude_above = AltitudeAbove::sea_level;
            scene.platform.altitude_m = 100;
            scene.curved_course = curved;
            const std::vector<std::uint8_t> mask = mask_of(source, scene);
            int top = 0, hidden = 0;
            for (int r = 0; r < 170; ++r)
                for (int c = 0; c < 180; ++c) {
                    if (height(c, r) < 100) continue;
                    ++top;
                    hidden += mask[static_cast<std::size_t>(r * 180 + c)] != 255;
                }
            INFO("from " << place.column << ", " << place.row << ", course "
                         << (!curved   ? "auto"
                             : *curved ? "curved"
                                       : "straight"));
            CHECK(top > 9000);
            CHECK(hidden == 0);
        }
}

TEST_CASE("of a slope nothing is hidden from above it, to the raster's last posts", "[numerics][coverage]") {
    struct Slope {
        double x, y;
    };
    // It rises towards an edge, falls or runs aslant; a ray to a post of a plane below the sensor meets nothing.
    for (const Slope& rise : {Slope{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {0.5, -0.3}})
        for (const Place& place : {Place{76.6, 33.2, 0}, {3.3, 140.7, 0}, {150.2, 296.4, 0}})
            for (const Quality quality : {Quality::draft, Quality::normal, Quality::exact}) {
                const auto height = [&](double c, double r) {
                    return 10000 + 30 * (rise.x * (c - place.column) + rise.y * (r - place.row));
                };
                MemorySource source(300, 300, 30, height);
                Scene scene = scene_at(source.data_base(), {place.column, place.row, 30}, std::nullopt);
                scene.quality = quality;
                const std::vector<std::uint8_t> mask = mask_of(source, scene);
                INFO("slope " << rise.x << ", " << rise.y << ", from " << place.column << ", " << place.row
                              << ", quality " << static_cast<int>(quality));
                CHECK(std::count(mask.begin(), mask.end(), 255) == 300 * 300);
            }
}

TEST_CASE("a cliff of 8000 m hides and shows what it must", "[numerics][coverage]") {
    for (const double post_m : {0.3, 1000.0}) {
        const auto height = [](double c, double r) { return (c < 100 ? -50 : 7950) + 0.25 * std::sin(c + 2 * r); };
        MemorySource source(260, 161, post_m, height);
        for (const Place& place :
             {Place{60.3, 80.2, 1.0}, {98.9, 80, 5000}, {60.3, 80.2, 9000}, {101, 80.5, 2.0}, {200.25, 80, 0.5}}) {
            const Judged j = judge(source, height, place, Quality::exact, 4.0 / 3, 1000);
            INFO(post_m << "-m posts, sensor at " << place.column << ", " << place.up_m << " m up: " << j.wrong
                        << " wrong of " << j.posts << ", " << j.seen << " seen, by " << j.worst_rad << " rad");
            // Rays that run along the face, 8000 m higher a post to the side, lie between spokes that tell little of them.
            CHECK(j.wrong_percent() <= (place.column == 98.9 ? 0.8 : 0.2));
        }
    }
}

TEST_CASE("posts far from the origin and posts of extreme aspect are judged as an exact walk judges them",
          "[numerics][coverage]") {
    const Folder folder;
    struct Case {
        const char *name, *crs;
        std::array<double, 6> transform;
        double relief_m, up_m;
    };
    for (const Case& k :
         {Case{"northing 9e6, 0.3-m posts", "EPSG:32633", {500123.4, 0.3, 0, 9000321.1, 0, -0.3}, 2, 5},
          Case{"85 degrees north, 2.7 x 31 m", "EPSG:4326", {20, 1 / 3600.0, 0, 85.02, 0, -1 / 3600.0}, 120, 150},
          Case{"85 degrees south", "EPSG:4326", {-60, 1 / 3600.0, 0, -84.98, 0, -1 / 3600.0}, 120, 150},
          Case{"columns of 0.4 m, rows of 30 m", "EPSG:32633", {4e5, 0.4, 0, 5e6, 0, -30}, 60, 60}}) {
        const auto hills = test::rolling(k.relief_m, 60, 31);
        test::Drawing d;
        d.columns = 220;
        d.rows = 180;
        d.crs = k.crs;
        d.geotransform = k.transform;
        d.value = [&](int c, int r) { return 200 + hills(c, r); };
        test::draw(folder / "far.tif", d);
        DataBaseParams params;
        params.dem = folder / "far.tif";
        params.cache_bytes = 4 << 20;
        const auto source = open_direct_source(params);
        for (const bool geodesic : {true, false}) {
            if (!geodesic && std::string(k.crs) == "EPSG:4326") continue;
            Scene s = scene_at(source->data_base(), {110.25, 90.5, k.up_m}, 4.0 / 3);
            s.geometry = geodesic ? Geometry::geodesic : Geometry::grid;
            s.quality = Quality::exact;
            const ResolvedScene resolved = resolve_coverage(s, *source);
            const std::vector<std::uint8_t> mask = mask_of(*source, s);
            const reference::Raster raster = reference::read(params.dem, geodesic);
            reference::Sensor sensor;
            sensor.column = resolved.nadir.column;
            sensor.row = resolved.nadir.row;
            sensor.height_m = resolved.sensor_m;
            sensor.earth_k = 4.0 / 3;
            const reference::LineOfSight sight(raster.matrix, raster.grid, sensor);
            int wrong = 0, seen = 0, posts = 0;
            for (std::int64_t r = 0; r < d.rows; r += 4)
                for (std::int64_t c = 0; c < d.columns; c += 5) {
                    const bool sees = sight.look(c, r).state == reference::Verdict::seen;
                    ++posts;
                    seen += sees;
                    wrong += sees != (mask[static_cast<std::size_t>(r * d.columns + c)] == 255);
                }
            INFO(k.name << (geodesic ? ", geodesic: " : ", grid: ") << wrong << " wrong, " << seen << " seen of "
                        << posts);
            CHECK(seen > posts / 50);
            CHECK(seen < posts);
            CHECK(100.0 * wrong / posts <= 0.3);
        }
    }
}

TEST_CASE("where rays bend near a pole, posts among spikes are judged alike, culled or not", "[numerics][coverage]") {
    const Folder folder;
    constexpr double lat_deg = 89.5, step_deg = 0.215 / 40, spike_m = 3000;
    constexpr int far_column = 39, far_row = 64;
    const double sensor_m = 1000 + spike_m - 0.7 * spike_m / 40000 * 3000 - 1;
    test::Drawing d;
    d.columns = 40;
    d.rows = 78;
    d.crs = "EPSG:4326";
    d.geotransform = {-step_deg / 2, step_deg, 0, lat_deg + 2.5 * step_deg, 0, -step_deg};
    d.value = [&](int c, int r) {
        const double lambda = c * step_deg * (std::numbers::pi / 180),
                     colatitude = (90 - lat_deg) * (std::numbers::pi / 180),
                     away = (r - 2) * step_deg * (std::numbers::pi / 180);
        const double metres =
            6390000 * 2 *
            std::asin(std::hypot(std::sin(away / 2),
                                 std::sqrt(std::sin(colatitude) * std::sin(colatitude + away)) * std::sin(lambda / 2)));
        if (c < 2) return 1000.0;
        if (c <= 3) return std::min(1000 + spike_m, sensor_m + 0.7 * spike_m / 40000 * metres);  // the ridge that hides
        const bool spike = c == far_column ? r == far_row : (c + r) % 2 != 0;
        return spike ? 1000 + spike_m : 1000.0;
    };
    test::draw(folder / "pole.tif", d);
    DataBaseParams params;
    params.dem = folder / "pole.tif";
    params.cache_bytes = 4 << 20;
    const auto source = open_direct_source(params);
    Scene s = scene_at(source->data_base(), {0, 2, 0}, 4.0 / 3);
    s.platform.altitude_above = AltitudeAbove::sea_level;
    s.platform.altitude_m = sensor_m;
    s.geometry = Geometry::geodesic;
    CoverageParams culled;
    const auto sees = [&](double target_m, bool cull) {
        culled.target_m = target_m;
        culled.cull = cull;
        return mask_of(*source, s, culled)[far_row * 40 + far_column] == 255;
    };
    // The least height that is seen, to what a float tells apart; then heights a hair above it.
    double hidden_m = 0, seen_m = 9000;
    REQUIRE(sees(seen_m, false));
    while (seen_m - hidden_m > 1e-5) {
        const double middle_m = 0.5 * (hidden_m + seen_m);
        (sees(middle_m, false) ? seen_m : hidden_m) = middle_m;
    }
    CHECK(seen_m > 100);
    for (int k = -20; k < 60; ++k) {
        culled.target_m = seen_m + k * 2e-4;
        culled.cull = true;
        const auto one = mask_of(*source, s, culled);
        culled.cull = false;
        INFO("target of " << culled.target_m << " m");
        CHECK((one == mask_of(*source, s, culled)));
    }
}

TEST_CASE("rasters of more than 2^31 posts and 65536 columns and rows are swept where they are asked",
          "[numerics][coverage]") {
    // Hills in the far corner of a sea of voids, beside the same hills alone. Posts of 32 m at whole numbers: places are
    // the same to the bit.
    const Folder folder;
    const auto hills = test::rolling(200, 60, 77);
    test::Drawing d;
    d.columns = d.rows = 400;
    d.type = GDT_Int16;
    d.no_data = -32768;
    d.value = [&](int c, int r) { return std::round(300 + hills(c, r)); };
    d.geotransform = {{4e5 + 32.0 * 69120, 32, 0, 5e6 - 32.0 * 66560, 0, -32}};
    test::draw(folder / "hills.tif", d);
    std::ofstream(folder / "sea.vrt")
        << "<VRTDataset rasterXSize=\"70000\" rasterYSize=\"67000\"><SRS>EPSG:32611</SRS>"
        << "<GeoTransform>400000, 32, 0, 5000000, 0, -32</GeoTransform>"
        << "<VRTRasterBand dataType=\"Int16\" band=\"1\"><NoDataValue>-32768</NoDataValue><SimpleSource>"
        << "<SourceFilename relativeToVRT=\"1\">hills.tif</SourceFilename><SourceBand>1</SourceBand>"
        << "<SrcRect xOff=\"0\" yOff=\"0\" xSize=\"400\" ySize=\"400\"/>"
        << "<DstRect xOff=\"69120\" yOff=\"66560\" xSize=\"400\" ySize=\"400\"/>"
        << "</SimpleSource></VRTRasterBand></VRTDataset>";
    const auto open = [&](const std::string& name) {
        DataBaseParams params;
        params.dem = folder / name;
        params.cache_bytes = 16 << 20;
        return open_direct_source(params);
    };
    const auto alone = open("hills.tif"), sea = open("sea.vrt");
    REQUIRE(sea->data_base().columns * sea->data_base().rows > (std::int64_t{1} << 31));
    Scene s = scene_at(alone->data_base(), {200.25, 190.5, 120}, 4.0 / 3);
    s.range_m = 5000;
    const std::vector<std::uint8_t> mask = mask_of(*alone, s);
    std::size_t posts = 0, wrong = 0, seen = 0;
    cover(resolve_coverage(s, *sea), *sea, {}, [&](const CoverageTile& tile) {
        posts += static_cast<std::size_t>(tile.window.columns.size() * tile.window.rows.size());
        if (tile.window.columns.end <= 69120 || tile.window.rows.end <= 66560) return;
        for (std::int64_t r = tile.window.rows.begin; r < tile.window.rows.end; ++r)
            for (std::int64_t c = tile.window.columns.begin; c < tile.window.columns.end; ++c) {
                if (c < 69120 || r < 66560 || c >= 69520 || r >= 66960) continue;
                const int got = tile.bytes[(r - tile.window.rows.begin) * tile.stride + c - tile.window.columns.begin];
                wrong += got != mask[static_cast<std::size_t>((r - 66560) * 400 + c - 69120)];
                seen += got == 255;
            }
    });
    CHECK(posts == std::size_t{70000} * 67000);
    CHECK(seen > 1000);
    CHECK(wrong == 0);
    // The picture too.
    s.azimuth_bins = 360;
    s.range_bin_m = 40;
    s.display.size = 64;
    EngineParams params;
    params.threads = 1;
    const RunResult here = run(resolve(s, *alone), *alone, params), there = run(resolve(s, *sea), *sea, params);
    CHECK(there.echo_w.cells == here.echo_w.cells);
    CHECK(there.scope.grey == here.scope.grey);
}
