// Where spokes run, how dense they are in rings and wedges, and what each quality samples.
#include <catch2/catch.hpp>

#include <GeographicLib/Geodesic.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "lib/earth.hpp"
#include "lib/spoke_grid.hpp"

using namespace wedgescope;

namespace {

/// A raster in plain latitude and longitude: positions need no projection library.
DataBase degrees(double west, double north, double step, std::int64_t columns, std::int64_t rows) {
    DataBase db;
    db.name = "degrees";
    db.columns = columns;
    db.rows = rows;
    db.has_crs = true;
    db.origin_x = west;
    db.origin_y = north;
    db.step_x = step;
    db.step_y = -step;
    db.locate = [=](double lat, double lon) {
        double d = std::remainder(lon - (west + static_cast<double>(columns) * step / 2), 360) +
                   static_cast<double>(columns) * step / 2;
        return IndexPosition{d / step, (north - lat) / step};
    };
    return db;
}

DataBase plane(std::int64_t columns, std::int64_t rows, double step) {
    DataBase db;
    db.name = "plane";
    db.columns = columns;
    db.rows = rows;
    db.crs_in_metres = true;
    db.step_x = step;
    db.step_y = -step;
    return db;
}

}  // namespace

TEST_CASE("geodesic spokes cross lines within 0.05 post of where GeographicLib puts them", "[spoke_map]") {
    for (const auto& [lat, reach_m] :
         {std::pair(0.5, 150000.0), std::pair(48.2, 150000.0), std::pair(-71.0, 100000.0), std::pair(80.0, 40000.0)}) {
        const double west = 178.9;  // across the antimeridian too
        const DataBase db = degrees(west, lat + 2, 1.0 / 1200, 4800, 4800);
        const IndexPosition nadir = db.locate(lat, west + 1.3);
        const SpokeMap map(db, {Geometry::geodesic, nadir, lat, west + 1.3, 4.0 / 3, reach_m});
        const auto& geod = GeographicLib::Geodesic::WGS84();
        std::mt19937 random(5);
        std::uniform_real_distribution<double> any(-1, 1), part(0.02, 1);
        double worst = 0;
        for (const Quadrant q : all_quadrants)
            for (int i = 0; i < 200; ++i) {
                const double m = any(random), arc = part(random) * reach_m / 1.5;
                double la = 0, lo = 0;
                geod.Direct(lat, west + 1.3, map.azimuth_rad(q, m) * 180 / std::numbers::pi, arc, la, lo);
                const IndexPosition p = db.locate(la, lo);
                const double major = (lines_are_columns(q) ? p.column - nadir.column : p.row - nadir.row) * outward(q);
                const double minor = lines_are_columns(q) ? p.row : p.column;
                if (p.column < 0 || p.row < 0 || p.column > 4799 || p.row > 4799) continue;
                const SpokeMap::Place place = map.place(q, m, major);
                worst = std::max(
                    {worst, std::abs(place.minor - minor), std::abs(place.arc_m - arc) / map.metres_per_post(q, m)});
            }
        INFO("latitude " << lat);
        CHECK(worst < 0.05);  // posts; the design's bound
        CHECK(worst > 0);
    }
}

TEST_CASE("the seam of a raster round the whole earth is no seam", "[spoke_map]") {
    DataBase db = degrees(-180, 90, 0.1, 3600, 1800);
    db.cyclic = true;
    db.cycle_columns = 3600;
    const auto spokes = [&](double lon) {
        return SpokeMap(db, {Geometry::geodesic, db.locate(10, lon), 10, lon, 4.0 / 3, 200000});
    };
    const SpokeMap seam = spokes(180), inland = spokes(20);
    for (const Quadrant q : all_quadrants)
        for (const double m : {-0.9, 0.0, 0.4}) {
            CHECK(seam.metres_per_post(q, m) == Approx(inland.metres_per_post(q, m)));
            CHECK(seam.place(q, m, 10).arc_m == Approx(inland.place(q, m, 10).arc_m));
        }
}

TEST_CASE("a grid that bends too much within range is refused, not swept wrongly", "[spoke_map]") {
    const DataBase db = degrees(0, 90, 1.0 / 120, 7200, 240);
    const auto refusal = [&](double lat, double range_m, double margin_m) -> std::string {
        try {
            const SpokeMap map(db, {.geometry = Geometry::geodesic,
                                    .nadir = db.locate(lat, 30),
                                    .lat_deg = lat,
                                    .lon_deg = 30,
                                    .earth_k = 4.0 / 3,
                                    .max_arc_m = range_m + margin_m,
                                    .margin_m = margin_m,
                                    .range_m = range_m});
        } catch (const DataError& e) {
            return e.what();
        }
        return "";
    };
    const std::string far = refusal(89.5, 100000, 100);
    INFO(far);
    REQUIRE_THAT(far, Catch::StartsWith("dem 'degrees': within a range of 100000 m of latitude 89.5, longitude 30 its "
                                        "grid bends too much") &&
                          Catch::EndsWith("m, or a raster in a projection such as UPS (gdalwarp -t_srs EPSG:32661)"));
    // What it accepts is accepted, and much more is not.
    const double most = std::stod(far.substr(far.find("up to ") + 6));
    CHECK(most >= 100);  // posts are 8 m wide and 930 m high
    CHECK(refusal(89.5, most, 100).empty());
    CHECK_FALSE(refusal(89.5, 1.5 * most, 100).empty());
    // Where what is added to any range is too much already, no smaller one is asked for.
    CHECK_THAT(refusal(89.95, 100, 7400), Catch::Contains("bends too much near latitude 89.95, longitude 30") &&
                                              Catch::Contains("whatever the range: the sensor is too near the pole") &&
                                              !Catch::Contains("up to"));
}

TEST_CASE("the spokes' cells share out the circle without gap or overlap, whatever the wedges", "[spoke_grid]") {
    const DataBase db = plane(501, 401, 30);
    const SpokeMap map(db, {Geometry::grid, {123.25, 222.75}, 0, 0, 4.0 / 3, 12000});
    for (const std::int64_t circle : {7, 360, 961}) {
        const SpokeGrid grid(db, map, {}, circle);
        for (const std::int64_t wedges : {1, 3, 7}) {
            std::vector<double> total(static_cast<std::size_t>(circle));
            for (std::int64_t w = 0; w < wedges; ++w) {
                const Interval bins{circle * w / wedges, circle * (w + 1) / wedges};
                const Wedge wedge = grid.wedge(w, bins);
                for (const SpokeRun& run : wedge.runs) {
                    const std::size_t last = run.touching.size() - 1;  // the outermost ring
                    const std::int64_t spokes = grid.rings(run.quadrant)[last].spokes;
                    for (std::int64_t k = run.touching[last].begin; k < run.touching[last].end; ++k) {
                        const SpokeGrid::Share share = grid.share(run.quadrant, spokes, k);
                        for (int side = 0; side < 2; ++side)
                            if (run.bins.contains(share.bin + side))
                                total[static_cast<std::size_t>(((share.bin + side) % circle + circle) % circle)] +=
                                    share.radians[side];
                    }
                }
            }
            INFO(circle << " bins, " << wedges << " wedges");
            for (const double t : total)
                CHECK(t == Approx(2 * std::numbers::pi / static_cast<double>(circle)).margin(1e-9));
        }
    }
}

TEST_CASE("neighbouring spokes are as dense as a line so many times as far off needs", "[spoke_grid]") {
    const DataBase db = plane(3001, 2001, 30);
    const SpokeMap map(db, {Geometry::grid, {1500.5, 1000.5}, 0, 0, 4.0 / 3, 100000});
    struct High {
        double above_posts;
        std::array<double, 4> quiet_posts;
        std::vector<std::pair<double, double>> shares;  // from so many posts on
    };
    const std::array<double, 4> never = Sampling{}.quiet_posts;
    for (const High& high :
         {High{0, never, {}}, High{39, {0, 0, 0, 0}, {}}, High{40, never, {}},
          High{300, {700, 2000, 2000, 2000}, {{700, 0.5}}}, High{40, {0, 0, 2000, 2000}, {{0, 1.0 / 3}}},
          High{90, {0, 0, 0, 2000}, {{0, 0.25}}}, High{90, {0, 0, 0, 0}, {{0, 1.0 / 6}}},
          High{90, {300, 500, 700, 1000}, {{300, 0.5}, {500, 1.0 / 3}, {700, 0.25}, {1000, 1.0 / 6}}}})
        for (const double spokes_per_post : {0.5, 1.0, 4.0})
            for (const double lead : {1.0, 3.0, 64.0}) {
                INFO(spokes_per_post << " spokes a post, lead " << lead << ", " << high.above_posts
                                     << " posts above, quiet from " << high.quiet_posts[0] << " on");
                const SpokeGrid grid(db, map,
                                     {.spokes_per_post = spokes_per_post,
                                      .above_posts = high.above_posts,
                                      .quiet_posts = high.quiet_posts,
                                      .lead = lead},
                                     180);
                // Where bins of two degrees are 8 posts wide.
                const double wide = 8 / (std::numbers::pi / 90);
                const auto share = [&](double posts) {
                    double found = 1;
                    for (const auto& [from, of] : high.shares)
                        if (posts > from) found = std::max(of, std::min(1.0, 0.3 / spokes_per_post));
                    return found;
                };
                // What a line needs, and those before it, whose share is greater: most where it is about to fall.
                const auto spokes_for = [&](double posts) {
                    double most = std::max(std::min(posts, wide), share(posts) * posts);
                    for (const auto& [from, of] : high.shares)
                        if (from < posts) most = std::max(most, share(from) * from);
                    return spokes_per_post * most;
                };
                for (const Quadrant q : all_quadrants) {
                    std::int64_t next = 0, before = 0;
                    const double last = grid.distance(q, grid.line_count(q) - 1);
                    for (const Ring& ring : grid.rings(q)) {
                        const auto spokes = static_cast<double>(ring.spokes);
                        const auto needed = [&](std::int64_t line) {
                            return spokes_for(std::min(lead * grid.distance(q, line), last));
                        };
                        CHECK(ring.lines.begin == next);
                        next = ring.lines.end;
                        // One without lines: the number of spokes doubles at once again.
                        CHECK(ring.lines.begin <= ring.lines.end);
                        if (before > 0) CHECK(ring.spokes == 2 * before);
                        CHECK(spokes >= needed(ring.lines.end - 1));
                        // No more than that: half of them would not do for the ring's first line.
                        if (before > 0) CHECK(spokes / 2 < needed(ring.lines.begin) * 1.001);
                        CHECK(ring.spokes > before);
                        CHECK(ring.spokes % SpokeGrid::spoke_step == 0);
                        before = ring.spokes;
                    }
                    CHECK(next == grid.line_count(q));
                    // The first ring has as many as its first line needs, or the last as many as its last line does.
                    const std::vector<Ring>& rings = grid.rings(q);
                    const double least = std::max(64.0, spokes_for(std::min(lead * grid.distance(q, 0), last))),
                                 step = SpokeGrid::spoke_step *
                                        static_cast<double>(rings.back().spokes / rings.front().spokes);
                    CHECK((static_cast<double>(rings.front().spokes) < least * 1.001 + SpokeGrid::spoke_step ||
                           static_cast<double>(rings.back().spokes) < spokes_for(last) * 1.001 + step));
                }
            }
}

TEST_CASE("spokes begin with what the first line needs, or with a share of what the last one does", "[spoke_grid]") {
    const DataBase db = plane(3001, 2001, 30);
    const SpokeMap map(db, {Geometry::grid, {1500.5, 1000.5}, 0, 0, 4.0 / 3, 100000});
    const auto spokes = [&](double per_post, double per_bin, double lead) {
        const SpokeGrid grid(db, map, {.spokes_per_post = per_post, .spokes_per_bin = per_bin, .lead = lead}, 360);
        std::vector<std::int64_t> all;
        for (const Ring& ring : grid.rings(Quadrant::east)) all.push_back(ring.spokes);
        return all;
    };
    // 115 for the bins, 1500 for the last line: an eighth of it to begin with.
    CHECK(spokes(1, 2, 4) == std::vector<std::int64_t>{192, 384, 768, 1536});
    // 1198 for the bins, 1500 for the last fifth of the lines: no more than the bins need, up to there.
    CHECK(spokes(1, 20.9, 1) == std::vector<std::int64_t>{1200, 2400});
    // Bins alone.
    CHECK(spokes(0.5, 20.9, 1) == std::vector<std::int64_t>{1200});
}

TEST_CASE("slopes are the same for parents and children, and whole numbers of 2^-32", "[spoke_grid]") {
    for (const std::int64_t spokes : {16, 48, 4912, 1 << 20, (1 << 20) + 16, 100000000})
        for (const std::int64_t k : {-spokes, -spokes / 3, std::int64_t{0}, std::int64_t{7}, spokes / 4, spokes}) {
            const double m = SpokeGrid::slope(spokes, k);
            INFO(k << " of " << spokes);
            CHECK(m == Approx(static_cast<double>(k) / static_cast<double>(spokes)).margin(0x1p-33).epsilon(0));
            if (spokes <= 1 << 20) CHECK(m * 0x1p32 == std::nearbyint(m * 0x1p32));
            if (spokes <= 1 << 19) CHECK(SpokeGrid::slope(2 * spokes, 2 * k) == m);
            CHECK(SpokeGrid::slope(spokes, -k) == -m);
        }
    CHECK(SpokeGrid::slope(48, 48) == 1);
    CHECK(SpokeGrid::slope(100000016, 100000016) == 1);
}

TEST_CASE("every azimuth bin has the spokes that it asks for, near the sensor too", "[spoke_grid]") {
    const DataBase db = plane(301, 201, 30);
    const SpokeMap map(db, {Geometry::grid, {150.5, 100.5}, 0, 0, 4.0 / 3, 4000});
    for (const std::int64_t circle : {8, 360, 961})
        for (const double per_bin : {2.0, 5.0, 32.0}) {
            INFO(circle << " bins, " << per_bin << " spokes each");
            const SpokeGrid grid(db, map, {.spokes_per_post = 0.25, .spokes_per_bin = per_bin}, circle);
            const double most = 2 * std::numbers::pi / static_cast<double>(circle) / per_bin;
            bool needed = false;
            for (const Quadrant q : all_quadrants) {
                const auto spokes = static_cast<double>(grid.rings(q).front().spokes);
                double widest = 0;
                for (double m = -1; m < 1; m += 1 / spokes)
                    widest = std::max(widest, std::abs(map.azimuth_rad(q, m + 1 / spokes) - map.azimuth_rad(q, m)));
                CHECK(widest <= most * (1 + 1e-9));
                // Fewer would not do, by a step.
                needed = needed || widest > most * (1 - SpokeGrid::spoke_step / spokes) * (1 - 1e-9) || spokes == 64;
            }
            CHECK(needed);
        }
}

TEST_CASE("each quality samples as the table in docs/accuracy.md says", "[grid]") {
    // Posts above the ground below: lowest, low, mid, high; with culture heights the first two reach higher.
    const std::vector<double> ground[] = {{1}, {4, 13.9}, {14, 39.9}, {40, 400}},
                              raised[] = {{1.25}, {5, 19.9}, {20, 39.9}, {40, 400}};
    constexpr GroundCover bare = GroundCover::bare, classes = GroundCover::classes, heights = GroundCover::heights;
    struct Row {
        Quality quality;
        GroundCover cover;
        std::array<double, 4> per_bin, per_post, lead;
    };
    const Row rows[] = {
        {Quality::draft, bare, {12, 3, 3, 3}, {0.6, 0.6, 0.6, 0.6}, {1, 1, 1, 1}},
        {Quality::draft, classes, {12, 3, 3, 3}, {0.6, 0.6, 0.6, 0.6}, {1, 1, 1, 1}},
        {Quality::draft, heights, {48, 12, 6, 3}, {0.6, 0.6, 0.6, 0.6}, {1, 1, 1, 1}},
        {Quality::normal, bare, {24, 8, 4, 3}, {1, 1, 1, 0.6}, {2, 2, 4, 4}},
        {Quality::normal, classes, {48, 12, 4, 3}, {1.25, 1.25, 1, 1}, {2, 2, 4, 4}},
        {Quality::normal, heights, {96, 24, 12, 6}, {1.25, 1.25, 1.25, 1.25}, {2, 2, 4, 4}},
        {Quality::fine, bare, {48, 12, 6, 4.5}, {1.25, 1.25, 1.25, 1.25}, {4, 4, 4, 4}},
        {Quality::fine, classes, {56, 14, 7, 3.5}, {1.6, 1.6, 1.6, 1.6}, {4, 4, 4, 4}},
        {Quality::fine, heights, {144, 36, 18, 9}, {2, 2, 2, 2}, {2, 2, 4, 4}},
        {Quality::exact, bare, {96, 24, 12, 9}, {2, 2, 1.5, 1.5}, {2, 2, 4, 4}},
        {Quality::exact, classes, {128, 32, 16, 8}, {2.5, 2.5, 3.4, 3.4}, {2, 2, 4, 4}},
        {Quality::exact, heights, {192, 72, 36, 18}, {4, 4, 4, 4}, {2, 2, 4, 4}},
    };
    for (const Row& row : rows)
        for (std::size_t i = 0; i < 4; ++i)
            for (const double above : row.cover == heights ? raised[i] : ground[i]) {
                const Sampling s = sampling(row.quality, row.cover, above);
                INFO(word(row.quality) << " over cover " << static_cast<int>(row.cover) << ", " << above
                                       << " posts above");
                CHECK(s.spokes_per_bin == row.per_bin[i]);
                CHECK(s.spokes_per_post == row.per_post[i]);
                CHECK(s.lead == row.lead[i]);
                CHECK(s.above_posts == above);
                CHECK(s.cross_lines);
                CHECK(s.exact_course);
            }
    // Nearer the ground never fewer a bin; a better quality never fewer of either; within what the key takes.
    for (const GroundCover cover : {bare, classes, heights})
        for (double above = 0.01; above < 400; above *= 1.1) {
            Sampling before{.spokes_per_post = 0, .spokes_per_bin = 0};
            for (const Quality q : {Quality::draft, Quality::normal, Quality::fine, Quality::exact}) {
                const Sampling s = sampling(q, cover, above), higher = sampling(q, cover, above * 1.1);
                INFO(word(q) << ", " << above << " posts above");
                CHECK(s.spokes_per_bin >= higher.spokes_per_bin);
                CHECK(s.spokes_per_bin >= before.spokes_per_bin);
                CHECK(s.spokes_per_post >= before.spokes_per_post);
                CHECK(s.spokes_per_bin >= 3);
                CHECK(s.spokes_per_bin <= 192);
                before = s;
            }
        }
}
