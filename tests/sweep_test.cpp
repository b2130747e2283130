// The pieces of the sweep: where spokes run, what they sample, what rises over a horizon, and how it is added up.
#include <catch2/catch.hpp>

#include <GeographicLib/Geodesic.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "lib/deposit.hpp"
#include "lib/earth.hpp"
#include "lib/lanes.hpp"
#include "lib/sample.hpp"
#include "lib/shade.hpp"
#include "lib/spoke_grid.hpp"
#include "lib/sweep.hpp"
#include "tests/every_target.hpp"

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

TEST_CASE("the posts round a piece are those of the cell that its middle lies in", "[sweep][sample]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(17);
    std::uniform_real_distribution<double> any(0, 1);
    int inside = 0, outside = 0;
    for (int turn = 0; turn < 4000; ++turn) {
        const std::size_t n = 1 + random() % 70;
        const auto line = [&](std::vector<float>& posts, std::int64_t begin) {
            posts.resize(random() % 5 == 0 ? 1 + random() % 40 : 40 + random() % 160);
            for (float& z : posts) z = random() % 50 ? static_cast<float>(900 * any(random)) : std::nanf("7");
            return LinePosts{posts.data(), begin, begin + static_cast<std::int64_t>(posts.size())};
        };
        const std::int64_t begin = static_cast<std::int64_t>(random() % 3000) - 1500;
        std::vector<float> behind_posts, ahead_posts;
        const LinePosts ahead = line(ahead_posts, begin + static_cast<std::int64_t>(random() % 5)),
                        behind = turn % 11 == 0 ? no_posts() : line(behind_posts, begin);
        // Side by side, either way round, up to several posts apart; now and then one that is out of order.
        const double from = static_cast<double>(begin) + 220 * any(random) - 20,
                     spacing = std::pow(10, 3 * any(random) - 2) * (turn % 2 ? 1 : -1), turned = 2 * any(random) - 1;
        std::vector<double> minor0(n), minor1(n), cell(n);
        for (std::size_t i = 0; i < n; ++i) {
            minor0[i] = from + spacing * static_cast<double>(i) + (turn % 7 == 0 && random() % 9 == 0 ? 40 : 0);
            if (random() % 6 == 0) minor0[i] = std::floor(minor0[i]);
            minor1[i] = random() % 6 ? minor0[i] + turned : minor0[i];
        }
        if (turn % 13 == 0) std::fill(minor0.begin(), minor0.end(), -0.0), minor1 = minor0;
        std::vector<float> b(2 * n), a(2 * n);
        cell_lanes(behind, ahead, n, minor0.data(), minor1.data(), {cell.data(), b.data(), a.data()});
        const auto same = [](float x, const LinePosts& posts, std::int64_t j) {
            return std::bit_cast<std::uint32_t>(x) ==
                   std::bit_cast<std::uint32_t>(posts.has(j) ? posts.at(j) : no_post);
        };
        bool right = true;
        for (std::size_t i = 0; i < n; ++i) {
            right = right && cell[i] == std::floor(0.5 * (minor0[i] + minor1[i])) &&
                    !(cell[i] == 0 && std::signbit(cell[i]));
            const auto j = static_cast<std::int64_t>(cell[i]);
            for (const std::int64_t side : {0, 1}) {
                const std::size_t at = 2 * i + static_cast<std::size_t>(side);
                right = right && same(b[at], behind, j + side) && same(a[at], ahead, j + side);
            }
            (behind.has(j) && ahead.has(j + 1) ? inside : outside) += 1;
        }
        INFO("turn " << turn << ", " << n << " spokes " << spacing << " posts apart");
        REQUIRE(right);
    }
    CHECK(inside > 20000);
    CHECK(outside > 20000);
}

TEST_CASE("steps go from crossing to crossing of the bilinear surface", "[sample][sweep]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(11);
    std::uniform_real_distribution<double> any(0, 1);
    constexpr double sensor_m = 1500, none = std::numeric_limits<double>::quiet_NaN();
    int crossings = 0, bumps = 0, voids = 0;
    for (int turn = 0; turn < 300; ++turn) {
        const std::int64_t begin = static_cast<std::int64_t>(random() % 50),
                           count = 2 + static_cast<std::int64_t>(random() % 40),
                           missing = static_cast<std::int64_t>(random() % 2);  // at the start of the line ahead
        std::vector<float> behind, ahead;
        for (std::int64_t j = 0; j < count; ++j)
            for (auto* line : {&behind, &ahead})
                line->push_back(any(random) < 0.1 ? std::numeric_limits<float>::quiet_NaN()
                                                  : static_cast<float>(1000 * any(random)));
        const LinePosts back{behind.data(), begin, begin + count},
            front{ahead.data() + missing, begin + missing, begin + count};
        const auto post = [&](const LinePosts& line, double j) {
            const auto at = static_cast<std::int64_t>(j);
            return line.has(at) ? static_cast<double>(line.at(at)) : none;
        };
        const auto n = 1 + static_cast<std::size_t>(random() % 64);
        const auto lanes = [&](double value) { return std::vector<double>(n, value); };
        struct Samples {
            std::vector<double> part, minor, arc, height, up, out, range, sine, x;
            SampleLanes lanes() {
                return {part.data(), minor.data(), arc.data(),  height.data(), up.data(),
                        out.data(),  range.data(), sine.data(), x.data()};
            }
        };
        const auto samples = [&] {
            return Samples{lanes(0), lanes(0), lanes(0), lanes(0), lanes(0), lanes(0), lanes(0), lanes(0), lanes(0)};
        };
        Samples now = samples(), crossing = samples(), line = samples();
        for (std::size_t i = 0; i < n; ++i) {
            now.minor[i] = static_cast<double>(begin) - 2 + any(random) * static_cast<double>(count + 4);
            if (random() % 4 == 0) now.minor[i] = std::floor(now.minor[i]);  // exactly on a post
            line.minor[i] = now.minor[i] + 2 * any(random) - 1;
            if (random() % 8 == 0) line.minor[i] = now.minor[i];
            if (random() % 8 == 0) line.minor[i] = std::floor(line.minor[i]);
            now.arc[i] = 2000;
            line.arc[i] = 2030;
            now.height[i] = 5;
            line.part[i] = 1;
        }
        const int crossed =
            cross_lanes(n, {now.part.data(), now.minor.data(), now.arc.data(), line.minor.data(), line.arc.data(),
                            crossing.part.data(), crossing.minor.data(), crossing.arc.data()});
        auto cell = lanes(0), mode = lanes(mode_visible), flat = lanes(0), void_horizon = lanes(-2), least = lanes(0),
             most = lanes(0), bump = lanes(0), rise = lanes(0), swing = lanes(0), sine0 = lanes(0), code = lanes(0),
             horizon = lanes(-1);
        std::vector<float> behind_posts(2 * n), ahead_posts(2 * n);
        const auto step = [&](StepTo target, Samples& from, Samples& to) {
            const CellLanes posts{cell.data(), behind_posts.data(), ahead_posts.data()};
            cell_lanes(back, front, n, from.minor.data(), to.minor.data(), posts);
            step_lanes(target, n, {sensor_m, 0.1, false, true, 0},
                       {from.lanes(), to.lanes(), posts, mode.data(), flat.data(), void_horizon.data(), horizon.data(),
                        least.data(), most.data(), bump.data(), rise.data(), swing.data(), sine0.data(), code.data()});
        };
        const auto same = [](double a, double b) {
            return std::isnan(b) ? std::isnan(a) : a == Approx(b).margin(1e-9);
        };
        step(StepTo::crossing, now, crossing);
        int counted = 0;
        for (std::size_t i = 0; i < n; ++i) {
            const double y = now.minor[i], to = line.minor[i];
            // The first whole number strictly between.
            const double c = to > y ? std::floor(y) + 1 : std::ceil(y) - 1;
            if (!(to > y ? c < to : c > to)) {
                CHECK(crossing.minor[i] == y);
                CHECK(crossing.arc[i] == 2000);
                CHECK(crossing.height[i] == 5);
                CHECK(code[i] == 0);
                continue;
            }
            ++counted;
            const double u = (c - y) / (to - y);
            CHECK(crossing.minor[i] == c);
            CHECK(crossing.arc[i] == Approx(2000 + 30 * u));
            CHECK(crossing.part[i] == Approx(u));
            const double z = (1 - u) * post(back, c) + u * post(front, c);
            CHECK(same(crossing.height[i], z));
            CHECK(same(crossing.range[i], std::hypot(z - sensor_m, crossing.arc[i])));
            CHECK(same(crossing.x[i], 0.1 * std::hypot(z - sensor_m, crossing.arc[i])));
        }
        CHECK(counted == crossed);
        crossings += counted;
        step(StepTo::line, crossing, line);
        for (std::size_t i = 0; i < n; ++i) {
            const double y = line.minor[i], j = std::floor(y), f = y - j;
            const double z = f == 0 ? post(front, j) : (1 - f) * post(front, j) + f * post(front, j + 1);
            CHECK(same(line.height[i], z));
            voids += std::isnan(z);
            // Half-way between the two, the surface against the mean of its ends.
            const double y0 = crossing.minor[i], cell0 = std::floor(0.5 * (y0 + y)), p = 0.5 * (1 + crossing.part[i]),
                         g = 0.5 * (y0 + y) - cell0;
            const auto surface = [&](double part, double along) {
                return (1 - part) * ((1 - along) * post(back, cell0) + along * post(back, cell0 + 1)) +
                       part * ((1 - along) * post(front, cell0) + along * post(front, cell0 + 1));
            };
            const double truth = surface(p, g) - 0.5 * (surface(crossing.part[i], y0 - cell0) + surface(1, y - cell0));
            CHECK(bump[i] == Approx(std::isnan(truth) ? 0 : truth).margin(1e-9));
            bumps += std::abs(truth) > 1;
        }
    }
    CHECK(crossings > 1000);
    CHECK(bumps > 1000);
    CHECK(voids > 100);
}

TEST_CASE("the series of the sight line is the exact form of the round earth", "[sweep]") {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> any(0, 1);
    const double radius = 4.0 / 3 * mean_radius_m;
    const Earth earth(radius);
    for (int i = 0; i < 3000; ++i) {
        const double sensor = 20000 * any(random), height = -400 + 9000 * any(random),
                     arc = std::pow(10.0, 1 + 4.9 * any(random));
        const SightLine p = sight_line(sensor, arc, height, 1 / radius);
        const Earth::Sight truth = earth.sight(sensor, height, arc);
        CHECK(p.range_m == Approx(truth.slant_range_m).epsilon(1e-13));
        CHECK(std::atan2(p.up_m, p.out_m) == Approx(-truth.depression_rad).margin(1e-12));
        // A ray of the point's own elevation passes over it at its own range.
        CHECK(ray_range_m(sensor, arc, p.sine, 1 / radius) == Approx(p.range_m).epsilon(1e-9));
    }
}

TEST_CASE("inside a piece the echo lies in range as rise and range say", "[sweep]") {
    std::mt19937 random(23);
    std::uniform_real_distribution<double> any(0, 1);
    constexpr std::size_t n = 64;
    AntennaParams antenna;  // a slope of its own above the knee, csc^2 below
    const PatternTable pattern(antenna);
    double worst = 0, worst_power = 0, without_fall = 0;
    for (int turn = 0; turn < 40; ++turn) {
        const auto lanes = [&] { return std::vector<double>(n); };
        auto up0 = lanes(), up1 = lanes(), out0 = lanes(), out1 = lanes(), range0 = lanes(), range1 = lanes(),
             sine0 = lanes(), sine1 = lanes(), bump = lanes(), rise = lanes(), swing = lanes(), power = lanes();
        std::vector<float> bow(n);
        for (std::size_t i = 0; i < n; ++i) {
            out0[i] = 100 + 900 * any(random);
            out1[i] = out0[i] * (1 + 0.11 * any(random));
            const double step = out1[i] - out0[i];
            // All of it above the knee of 5 degrees, or all below.
            up0[i] = -(i % 2 ? 0.02 + 0.05 * any(random) : 0.12 + 0.2 * any(random)) * out0[i];
            // Level ground or a slope up, and a bump that hides nothing of it.
            up1[i] = up0[i] + 0.05 * any(random) * step;
            rise[i] = up1[i] * out0[i] - up0[i] * out1[i];
            bump[i] = 0.25 * 0.4 * rise[i] / out0[i] * (2 * any(random) - 1);
            swing[i] = 4 * bump[i] * out0[i];
            range0[i] = std::hypot(up0[i], out0[i]);
            range1[i] = std::hypot(up1[i], out1[i]);
            sine0[i] = up0[i] / range0[i];
            sine1[i] = up1[i] / range1[i];
        }
        power_lanes(n,
                    {sine0.data(), sine1.data(), range0.data(), range1.data(), rise.data(), swing.data(), false,
                     power.data(), bow.data()},
                    pattern, 1);
        for (std::size_t i = 0; i < n; ++i) {
            // In small steps, what each adds, and where its middle lies.
            constexpr int steps = 4000;
            double sum = 0, moment = 0, sine = sine0[i], plain = 0, plain_moment = 0;
            for (int k = 1; k <= steps; ++k) {
                const double u = static_cast<double>(k) / steps, middle = u - 0.5 / steps,
                             up = up0[i] + u * (up1[i] - up0[i]) + 4 * bump[i] * u * (1 - u),
                             out = out0[i] + u * (out1[i] - out0[i]), range = std::hypot(up, out), next = up / range,
                             gain = elevation_pattern(antenna, -std::asin(next)), lit = (next - sine) * range * range,
                             added = lit * gain * gain / std::pow(range, 4);
                sum += added;
                moment += added * middle;
                plain += lit;
                plain_moment += lit * middle;
                sine = next;
            }
            // Up to u lies the share u + bow u (1 - u): its mean is 1/2 - bow / 6.
            worst = std::max(worst, std::abs(moment / sum - (0.5 - static_cast<double>(bow[i]) / 6)));
            without_fall = std::max(without_fall, std::abs(moment / sum - plain_moment / plain));
            worst_power = std::max(worst_power, std::abs(power[i] / sum - 1));
            const double fall = echo_bow(sine0[i], sine1[i], range0[i], range1[i], pattern, false);
            CHECK(std::abs(plain_moment / plain - fall / 6 - moment / sum) < 0.006);
        }
    }
    CHECK(worst < 0.005);
    CHECK(worst_power < 0.03);
    CHECK(without_fall > 0.03);
}

TEST_CASE("on ground range a piece below the sensor returns the more the farther it is from the nadir", "[sweep]") {
    AntennaParams antenna;
    antenna.elevation = ElevationPattern::points;  // the same gain everywhere
    antenna.points = {{Angle::degrees(-180), Decibel(0)}, {Angle::degrees(180), Decibel(0)}};
    const PatternTable pattern(antenna);
    for (const double out0 : {0.0, 1.0, 30.0, 60.0, 300.0, 3000.0})
        for (const double up : {-1000.0, -5000.0}) {
            CAPTURE(out0, up);
            const double out1 = out0 + 30, range0 = std::hypot(up, out0), range1 = std::hypot(up, out1),
                         sine0 = up / range0, sine1 = up / range1, rise = up * (out0 - out1), swing = 0;
            // A level plain: K d(sin e) / r^2 upto a part u of the way is -K up / 3 (r0^-3 - r(u)^-3).
            const auto upto = [&](double u) {
                const double out = out0 + 30 * u, more = 30 * u * (out0 + out);  // of the square of range
                return -std::expm1(-1.5 * std::log1p(more / (range0 * range0)));
            };
            double power = 0;
            float bow = 0;
            power_lanes(1, {&sine0, &sine1, &range0, &range1, &rise, &swing, true, &power, &bow}, pattern, 1);
            const double alone = echo_bow(sine0, sine1, range0, range1, pattern, true);
            CHECK(std::abs(alone - static_cast<double>(bow)) < 1e-5);
            for (const double u : {0.1, 0.25, 0.5, 0.75, 0.9})
                CHECK(std::abs(u + alone * u * (1 - u) - upto(u) / upto(1)) < 2e-4);
        }
}

TEST_CASE("what a parabola shows over a horizon is what walking along it shows", "[sweep]") {
    std::mt19937 random(17);
    std::uniform_real_distribution<double> any(-1, 1);
    int shown = 0, hides = 0;
    for (int turn = 0; turn < 4000; ++turn) {
        const double out0 = 5000, out1 = 5030, up0 = -1000 + 10 * any(random), up1 = -1000 + 10 * any(random),
                     bump = 4 * any(random);
        const bool from_ray = turn % 3 == 0;
        const double start = up0 / std::hypot(up0, out0);
        const double sine = from_ray ? start : start + 0.001 * std::abs(any(random));
        const Course c = course(sine, up0, out0, up1, out1, bump, from_ray);
        // Walk it in small steps; keep what rises above all before.
        constexpr int steps = 20000;
        double most = sine, first = -1, last = -1;
        for (int i = 0; i <= steps; ++i) {
            const double u = static_cast<double>(i) / steps, up = up0 + u * (up1 - up0) + 4 * bump * u * (1 - u),
                         out = out0 + u * (out1 - out0);
            const double s = up / std::hypot(up, out);
            if (s > most + 1e-12) {
                if (first < 0) first = u;
                last = u;
                most = s;
            }
        }
        INFO("turn " << turn);
        if (most - sine < 1e-7) continue;  // a touch: either answer will do
        REQUIRE(c.seen);
        ++shown;
        hides += c.hides;
        CHECK(c.begin == Approx(first).margin(0.01));
        CHECK(c.end ==
              Approx(last).margin(0.03));  // where exactly the highest elevation lies on a flat top moves little power
        const double up = up0 + c.end * (up1 - up0) + 4 * bump * c.end * (1 - c.end),
                     out = out0 + c.end * (out1 - out0);
        CHECK(up / std::hypot(up, out) == Approx(most).margin(2e-7));
        CHECK(c.hides == (last < 0.97 || (c.hides && last < 1)));
    }
    CHECK(shown > 1000);
    CHECK(hides > 100);
}

TEST_CASE("each quality samples as the table in docs/accuracy.md says", "[grid]") {
    // Posts above the ground below: lowest, low, mid, high; with culture heights the first two reach higher.
    const std::vector<double> ground[] = {{1}, {4, 13.9}, {14, 39.9}, {40, 400}},
                              raised[] = {{2.5}, {10, 19.9}, {20, 39.9}, {40, 400}};
    constexpr GroundCover bare = GroundCover::bare, classes = GroundCover::classes, heights = GroundCover::heights;
    struct Row {
        Quality quality;
        GroundCover cover;
        std::array<double, 4> per_bin, per_post, lead;
    };
    const Row rows[] = {
        {Quality::draft, bare, {12, 3, 3, 3}, {0.6, 0.6, 0.6, 0.6}, {1, 1, 1, 1}},
        {Quality::draft, classes, {12, 3, 3, 3}, {0.6, 0.6, 0.6, 0.6}, {1, 1, 1, 1}},
        {Quality::draft, heights, {24, 6, 3, 3}, {0.6, 0.6, 0.6, 0.6}, {1, 1, 1, 1}},
        {Quality::normal, bare, {24, 8, 4, 3}, {1, 1, 1, 0.6}, {2, 2, 4, 4}},
        {Quality::normal, classes, {48, 12, 4, 3}, {1.25, 1.25, 1, 1}, {2, 2, 4, 4}},
        {Quality::normal, heights, {48, 12, 6, 3}, {1.25, 1.25, 1.25, 1.25}, {2, 2, 4, 4}},
        {Quality::fine, bare, {48, 12, 6, 4.5}, {1.25, 1.25, 1.25, 1.25}, {4, 4, 4, 4}},
        {Quality::fine, classes, {56, 14, 7, 3.5}, {1.6, 1.6, 1.6, 1.6}, {4, 4, 4, 4}},
        {Quality::fine, heights, {96, 24, 12, 6}, {2, 2, 2, 2}, {2, 2, 4, 4}},
        {Quality::exact, bare, {96, 24, 12, 9}, {2, 2, 1.5, 1.5}, {2, 2, 4, 4}},
        {Quality::exact, classes, {128, 32, 16, 8}, {2.5, 2.5, 3.4, 3.4}, {2, 2, 4, 4}},
        {Quality::exact, heights, {192, 48, 24, 12}, {4, 4, 4, 4}, {2, 2, 4, 4}},
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

TEST_CASE("two pieces that become one keep their power and its middle", "[sweep]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(29);
    std::uniform_real_distribution<double> any(0, 1);
    int joined = 0, apart = 0;
    for (int turn = 0; turn < 300; ++turn) {
        const auto n = 1 + static_cast<std::size_t>(random() % 64);
        const auto lanes = [&] { return std::vector<double>(n, 0); };
        auto horizon = lanes(), rise0 = lanes(), swing0 = lanes(), code0 = lanes(), sine0 = lanes(), rise = lanes(),
             swing = lanes(), code = lanes(), range0 = lanes(), x0 = lanes(), range = lanes(), x = lanes(),
             range1 = lanes(), sine1 = lanes(), x1 = lanes(), start_range = lanes(), start_x = lanes();
        for (std::size_t i = 0; i < n; ++i) {
            horizon[i] = -0.3 * any(random);
            sine0[i] = horizon[i] + 0.01 * any(random);
            sine1[i] = sine0[i] + (random() % 8 == 0 ? 0.3 : 0.01) * any(random);
            rise0[i] = 1 + any(random), rise[i] = 1 + any(random);
            swing0[i] = rise0[i] * (2 * any(random) - 1), swing[i] = rise[i] * (2 * any(random) - 1);
            // Some lie back over themselves; some are too long for one range.
            range0[i] = 100 + 20000 * any(random) * any(random);
            const double way = random() % 3 == 0 ? -30 : 30;
            range[i] = range0[i] + way * any(random);
            range1[i] = (random() % 8 == 0 ? range0[i] : range[i]) + way * any(random);
            x0[i] = range0[i] / 20, x[i] = range[i] / 20, x1[i] = range1[i] / 20;
            code0[i] = static_cast<double>(random() % 3), code[i] = static_cast<double>(random() % 3);
            if (random() % 2 == 0) code0[i] = code[i] = 1;
        }
        const auto before = std::tuple(sine0, rise, swing, code0);
        const auto& [old_sine0, old_rise, old_swing, old_code0] = before;
        const int alone = join_lanes(n, {{horizon.data(), rise0.data(), swing0.data(), code0.data()},
                                         {sine0.data(), rise.data(), swing.data(), code.data()},
                                         range0.data(),
                                         x0.data(),
                                         range.data(),
                                         x.data(),
                                         range1.data(),
                                         sine1.data(),
                                         x1.data(),
                                         start_range.data(),
                                         start_x.data()});
        int left = 0;
        for (std::size_t i = 0; i < n; ++i) {
            left += code0[i] == 1 ? 1 : 0;
            const bool both = old_code0[i] == 1 && code[i] == 1;
            // Where the middle of the power lies: of a piece of bow b, 1 + b (1 - 2 u) of its power lies round part u of the way.
            const auto middle = [](double from, double to, double bow) {
                double sum = 0;
                constexpr int steps = 2000;
                for (int k = 0; k < steps; ++k) {
                    const double u = (k + 0.5) / steps;
                    sum += (1 + bow * (1 - 2 * u)) * (from + u * (to - from)) / steps;
                }
                return sum;
            };
            const double a = old_sine0[i] - horizon[i], b = sine1[i] - old_sine0[i],
                         wanted = (a * middle(x0[i], x[i], swing0[i] / rise0[i]) +
                                   b * middle(x[i], x1[i], old_swing[i] / old_rise[i])) /
                                  (a + b);
            const double most = middle(x0[i], x1[i], -1), least = middle(x0[i], x1[i], 1);
            const bool within = std::min(least, most) <= wanted && wanted <= std::max(least, most);
            const bool onwards = (x[i] - x0[i]) * (x1[i] - x[i]) >= 0;
            const bool one = one_range(range0[i], range1[i], sine1[i] - horizon[i], sine1[i]);
            const double edge = std::min(std::abs(wanted - most), std::abs(wanted - least));
            if (old_code0[i] == 1 && code0[i] == 0) {
                ++joined;
                CHECK((both && onwards && one));
                CHECK((within || edge < 1e-6 * std::abs(x1[i] - x0[i])));
                CHECK(sine0[i] == horizon[i]);
                CHECK(start_range[i] == range0[i]);
                CHECK(start_x[i] == x0[i]);
                const double bow = swing[i] / rise[i];
                CHECK(std::abs(bow) <= 1);
                CHECK(middle(x0[i], x1[i], bow) == Approx(wanted).margin(1e-6 * std::abs(x1[i] - x0[i])));
                continue;
            }
            ++apart;
            if (both && edge > 1e-6 * std::abs(x1[i] - x0[i])) CHECK_FALSE((onwards && one && within));
            CHECK(code0[i] == old_code0[i]);
            CHECK(sine0[i] == old_sine0[i]);
            CHECK(rise[i] == old_rise[i]);
            CHECK(swing[i] == old_swing[i]);
            CHECK(start_range[i] == range[i]);
            CHECK(start_x[i] == x[i]);
        }
        CHECK(left == alone);
    }
    CHECK(joined > 1000);
    CHECK(apart > 1000);
}

TEST_CASE("deposits add up to what was put in, bin by bin, in any order and by lanes or one by one", "[deposit]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    constexpr std::size_t rows = 5, columns = 190;
    const Quanta q = quanta({10, 10 + columns}, 25, 1e3, 1, 0.01, 2);
    std::mt19937 random(23);
    std::uniform_real_distribution<double> any(0, 1);
    // Of one class all along, and of up to three.
    for (const bool stretched : {false, true}) {
        struct Put {
            WedgeCells::Target target;
            WedgeCells::Portion portion;
            WedgeCells::Stretches stretches;
        };
        std::vector<Put> puts;
        for (int i = 0; i < 5000; ++i) {
            Put p;
            p.target.row = static_cast<std::int32_t>(random() % rows);
            p.target.share[0] = 0.01 * any(random);
            p.target.share[1] = random() % 3 == 0 && p.target.row < 4 ? 0.01 * any(random) : 0;
            p.portion.x0 = 5 + 205 * any(random);
            p.portion.x1 = p.portion.x0 + 6 * (any(random) - 0.5);
            p.portion.power = 1e-6 * any(random);
            p.portion.bow = 2 * any(random) - 1;
            p.stretches = WedgeCells::Stretches::one(2 * any(random));
            if (stretched && random() % 4 > 0) {
                const auto number = [&] { return static_cast<float>(any(random)); };
                const float border = number();
                p.stretches = {
                    {2 * number(), 2 * number(), 2 * number()}, random() % 2 ? border : border * number(), border};
            }
            puts.push_back(p);
        }
        WedgeCells forward(rows, q), backward(rows, q), lanes(rows, q);
        std::vector<double> expected(rows * columns);
        for (const Put& p : puts) {
            forward.add(p.target, p.portion, p.stretches);
            const auto way_to = [&](double x) { return (x - p.portion.x0) / (p.portion.x1 - p.portion.x0); };
            const double borders[] = {0, static_cast<double>(p.stretches.second),
                                      static_cast<double>(p.stretches.third), 1};
            for (std::size_t j = 0; j < columns; ++j)
                for (std::size_t k = 0; k < 3; ++k) {
                    const double a = way_to(10 + static_cast<double>(j)), b = way_to(11 + static_cast<double>(j)),
                                 from = std::max(std::min(a, b), borders[k]),
                                 to = std::min(std::max(a, b), borders[k + 1]);
                    if (!(to > from)) continue;
                    // What lies between, by the mean of how dense it is at its ends, which is a straight line.
                    const double watts = static_cast<double>(p.stretches.gamma[k]) * p.portion.power * (to - from) *
                                         (1 + p.portion.bow * (1 - from - to));
                    for (std::size_t side = 0; side < 2; ++side)
                        if (p.target.share[side] > 0)
                            expected[(static_cast<std::size_t>(p.target.row) + side) * columns + j] +=
                                watts * p.target.share[side];
                }
        }
        for (auto p = puts.rbegin(); p != puts.rend(); ++p) backward.add(p->target, p->portion, p->stretches);
        // In metres, of which a power of two make a bin; behind the last lane stands anything.
        constexpr double bins = 1.0 / 32, wild[] = {NAN, 1e38, -1e38, INFINITY, -INFINITY, 1, -7};
        for (std::size_t at = 0; at < puts.size();) {
            const std::size_t n = std::min(1 + random() % WedgeCells::Portions::most, puts.size() - at),
                              whole = whole_registers(n);
            const auto column = [&](const auto& of) {
                std::vector<double> out;
                for (std::size_t i = 0; i < n; ++i) out.push_back(of(puts[at + i]));
                while (out.size() < whole) out.push_back(wild[random() % std::size(wild)]);
                return out;
            };
            const auto floats = [&](const auto& of) {
                const std::vector<double> numbers = column(of);
                return std::vector<float>(numbers.begin(), numbers.end());
            };
            const auto s0 = column([](const Put&p) { return p.target.share[0]; }),
                       s1 = column([](const Put&p) { return p.target.share[1]; }),
                       x0 = column([](const Put&p) { return p.portion.x0 / bins; }),
                       x1 = column([](const Put&p) { return p.portion.x1 / bins; }),
                       power = column([](const Put&p) { return p.portion.power; });
            const auto gamma = [&](std::size_t k) {
                return floats([k](const Put& p) { return static_cast<double>(p.stretches.gamma[k]); });
            };
            const auto bow = floats([](const Put&p) { return p.portion.bow; }), gamma0 = gamma(0), gamma1 = gamma(1),
                       gamma2 = gamma(2),
                       second = floats([](const Put&p) { return static_cast<double>(p.stretches.second); }),
                       third = floats([](const Put&p) { return static_cast<double>(p.stretches.third); });
            std::vector<std::int64_t> row;
            std::vector<std::int32_t> straddlers;
            for (std::size_t i = 0; i < n; ++i) {
                row.push_back(forward.origin_of(puts[at + i].target.row));
                if (s1[i] > 0) straddlers.push_back(static_cast<std::int32_t>(i));
            }
            lanes.add_lanes(n, {row.data(),
                                s0.data(),
                                s1.data(),
                                straddlers,
                                x0.data(),
                                x1.data(),
                                bins,
                                power.data(),
                                bow.data(),
                                {gamma0.data(), gamma1.data(), gamma2.data()},
                                stretched ? second.data() : nullptr,
                                third.data()});
            at += n;
        }
        double worst = 0;
        for (std::size_t r = 0; r < rows; ++r)
            for (std::size_t j = 0; j < columns; ++j) {
                REQUIRE(forward.watts(r, j) == backward.watts(r, j));
                REQUIRE(forward.watts(r, j) == lanes.watts(r, j));
                worst = std::max(worst, std::abs(forward.watts(r, j) / expected[r * columns + j] - 1));
            }
        CHECK(worst < 1e-5);  // pieces are floats
    }
}

TEST_CASE("lanes that lie on either side of a border between quanta, on it and over it deposit what they do one by one",
          "[deposit]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    constexpr std::size_t rows = 3, columns = 190;
    const Quanta q = quanta({10, 10 + columns}, 25, 1e3, 1, 0.01, 2);
    REQUIRE(q.runs.size() > 4);
    const auto border = [&](std::size_t run) { return static_cast<double>(q.runs[run].begin); };
    // Where portions of a block begin and end.
    const auto block = [](const std::vector<std::pair<double, double>>& ways) {
        std::vector<std::pair<double, double>> all;
        while (all.size() < 100) all.insert(all.end(), ways.begin(), ways.end());
        all.resize(100);
        return all;
    };
    const double b = border(2), c = border(3), last = border(q.runs.size() - 1);
    for (const auto& ways :
         {block({{b - 1.5, b - 0.2}}),                                                // before it
          block({{b + 0.5, b + 1.7}}),                                                // behind it
          block({{b - 0.5, b + 0.7}}),                                                // over it
          block({{b - 1, b}, {b, b + 1}, {b, b - 1}, {b, b}}),                        // on it
          block({{b - 2, b - 1.1}, {b + 1.2, b}, {b - 0.1, b + 2.2}}),                // all of these
          block({{c + 1, c + 2}, {b - 2, b - 1}, {b + 1, b + 2}}),                    // of three runs
          block({{b + 1, b + 2}, {c + 1, c + 2}, {b - 2, b - 1}}),                    // the nearest last
          block({{last + 1, last + 2.5}, {198.5, 199.7}, {199.5, 201}, {205, 206}}),  // of the last one
          block({{4, 6}, {9.5, 10.5}, {b - 0.5, b + 0.5}, {4, 5}}),                   // from before the first bin on
          block({{4, 6}, {300, 301}})}) {                                             // of none
        const std::size_t n = ways.size(), whole = whole_registers(n);
        std::mt19937 random(7);
        std::uniform_real_distribution<double> any(0, 1);
        std::vector<double> share0(whole), share1(whole), x0(whole), x1(whole), power(whole);
        std::vector<float> bow(whole), gamma(whole);
        std::vector<std::int64_t> origin(whole);
        std::vector<std::int32_t> straddlers;
        WedgeCells single(rows, q), lanes(rows, q);
        for (std::size_t i = 0; i < n; ++i) {
            const auto row = static_cast<std::int32_t>(random() % (rows - 1));
            origin[i] = single.origin_of(row);
            share0[i] = 0.01 * any(random);
            share1[i] = i % 3 == 0 ? 0.01 * any(random) : 0;
            if (share1[i] > 0) straddlers.push_back(static_cast<std::int32_t>(i));
            x0[i] = ways[i].first;
            x1[i] = ways[i].second;
            power[i] = 1e-6 * any(random);
            bow[i] = static_cast<float>(2 * any(random) - 1);
            gamma[i] = static_cast<float>(any(random));
            single.add({row, {share0[i], share1[i]}}, {x0[i], x1[i], power[i], static_cast<double>(bow[i])},
                       WedgeCells::Stretches::one(static_cast<double>(gamma[i])));
        }
        lanes.add_lanes(n, {origin.data(),
                            share0.data(),
                            share1.data(),
                            straddlers,
                            x0.data(),
                            x1.data(),
                            1,
                            power.data(),
                            bow.data(),
                            {nullptr, nullptr, gamma.data()}});
        double sum = 0;
        for (std::size_t row = 0; row < rows; ++row)
            for (std::size_t j = 0; j < columns; ++j) {
                REQUIRE(single.watts(row, j) == lanes.watts(row, j));
                sum += single.watts(row, j);
            }
        CHECK((sum > 0) == (ways[1].first < 200));
    }
}

TEST_CASE("a dim stretch behind a bright one, and one of many bins, have what is theirs in every bin", "[deposit]") {
    struct Row {
        std::int64_t bins;
        double dim;
    };
    const auto row = GENERATE(values<Row>({{200, 1e-6}, {30, 1e-4}, {30000, 1}}));
    const double bow = GENERATE(0.0, 1.0, -0.6);
    const auto n = static_cast<double>(row.bins);
    const Quanta q = quanta({0, row.bins + 20}, 25, 1e3, 1, 0.01, 2);
    WedgeCells cells(1, q);
    const double x0 = 10.25, x1 = x0 + n, power = 1e-6, border = 0.25;
    const auto dim = static_cast<float>(row.dim);
    WedgeCells::Target target{};
    target.share[0] = 0.01;
    cells.add(target, {x0, x1, power, bow}, {{1, dim, dim}, static_cast<float>(border), 1});
    for (std::int64_t j = 0; j < row.bins + 20; ++j) {
        const auto upto = [&](double x) {
            const double u = std::clamp((x - x0) / n, 0.0, 1.0), s = u + bow * u * (1 - u),
                         b = border + bow * border * (1 - border);
            return std::min(s, b) + static_cast<double>(dim) * std::max(0.0, s - b);
        };
        const auto x = static_cast<double>(j);
        const double expected = 0.01 * power * (upto(x + 1) - upto(x)),
                     got = cells.watts(0, static_cast<std::size_t>(j));
        const double quantum = q.watts[static_cast<std::size_t>(j)];
        INFO("bin " << j << " of " << row.bins << ", bow " << bow << ": " << got << ", " << expected);
        REQUIRE(got >= 0);
        REQUIRE(std::fabs(got - expected) <= 1e-6 * expected + quantum);
    }
}

TEST_CASE("a piece that ends an instant before a bin's edge stays in its bin", "[deposit]") {
    const Quanta q = quanta({0, 20}, 25, 1e3, 1, 0.01, 2);
    WedgeCells cells(1, q);
    WedgeCells::Target target{};
    target.share[0] = 0.01;
    for (const double k : {8.0, 20.0}) cells.add(target, {k - 1e-9, k - 1e-9, 1e-6, 0}, WedgeCells::Stretches::one(1));
    for (std::size_t j = 0; j < 20; ++j) CHECK((cells.watts(0, j) > 0) == (j == 7 || j == 19));
}

TEST_CASE("a row's states are the most telling of all that was marked, in whatever stretches", "[deposit]") {
    constexpr std::int64_t first = 7, columns = 150;
    constexpr std::size_t rows = 3;
    const Quanta q = quanta({first, first + columns}, 25, 1e3, 1, 0.01, 2);
    std::mt19937 random(3);
    for (int round = 0; round < 200; ++round) {
        WedgeCells cells(rows, q);
        std::array<std::array<int, columns>, rows> met{};
        const int marks = 1 + static_cast<int>(random() % 12);
        for (int i = 0; i < marks; ++i) {
            const auto place = [&] {
                return static_cast<double>(first) - 20 + 0.25 * static_cast<double>(random() % 800);
            };
            const double x0 = place(), x1 = random() % 4 ? x0 + 0.25 * static_cast<double>(random() % 80) : place();
            const auto bit = static_cast<std::uint8_t>(1U << random() % 4);
            WedgeCells::Target target{static_cast<std::int32_t>(random() % (rows - 1)),
                                      {0.01, random() % 3 ? 0 : 0.02}};
            cells.mark(target, x0, x1, bit);
            for (std::size_t side = 0; side < (target.share[1] > 0 ? 2U : 1U); ++side)
                for (std::int64_t j = 0; j < columns; ++j)
                    if (std::max(x0, x1) >= static_cast<double>(first + j) &&
                        std::min(x0, x1) < static_cast<double>(first + j + 1))
                        met[static_cast<std::size_t>(target.row) + side][static_cast<std::size_t>(j)] |= bit;
        }
        std::array<float, columns> watts;
        std::array<std::uint8_t, columns> states;
        for (std::size_t row = 0; row < rows; ++row) {
            cells.finish(row, watts.data(), states.data());
            for (std::size_t j = 0; j < columns; ++j) {
                const int bits = met[row][j];
                const State expected = bits & bit_seen      ? State::seen
                                       : bits & bit_unknown ? State::unknown
                                       : bits & bit_shadow  ? State::shadow
                                       : bits & bit_no_data ? State::no_data
                                                            : State::outside;
                INFO("round " << round << ", row " << row << ", column " << j);
                REQUIRE(states[j] == static_cast<std::uint8_t>(expected));
                REQUIRE(watts[j] == 0);
            }
        }
    }
}

TEST_CASE("the quantum of a bin leaves room for all that a cell can hold, and no more than a bit", "[deposit]") {
    const double constant = 1234.5, pattern = 0.8, step = 0.0065, gamma = 3.2;
    const Quanta q = quanta({0, 40}, 100, constant, pattern, step, gamma);
    for (std::size_t j = 0; j < 40; ++j) {
        const double near = std::max(1.0, static_cast<double>(j) * 100),
                     most = constant * pattern * 2 * step * gamma / (near * near);
        CHECK(q.watts[j] >= most * 0x1p-61);
        CHECK(q.watts[j] < most * 0x1p-60);
        int exponent = 0;
        CHECK(std::frexp(q.watts[j], &exponent) == 0.5);  // a power of two
    }
}

TEST_CASE("the antenna table is the pattern within its stated error", "[shade]") {
    AntennaParams antenna;
    for (const auto& [kind, exponent] : {std::pair{ElevationPattern::csc2, 0.5},
                                         {ElevationPattern::cos_csc2, 0.5},
                                         {ElevationPattern::cos_csc2, 0.0},
                                         {ElevationPattern::gaussian, 0.5}})
        for (const double tilt : {-40.0, -4.0, 0.0, 10.0}) {
            antenna.elevation = kind;
            antenna.exponent = exponent;
            antenna.tilt = Angle::degrees(tilt);
            const PatternTable table(antenna);
            CHECK(table.error() < 0.002);  // 0.01 dB
            for (double depression = -5; depression < 80; depression += 0.0371) {
                if (std::abs(depression - 90 - tilt) < 0.05) continue;  // a shaped one drops to the floor there
                const double g = elevation_pattern(antenna, depression * std::numbers::pi / 180);
                if (g < 1e-5) continue;
                CHECK(table.at(-std::sin(depression * std::numbers::pi / 180)) ==
                      Approx(g * g).epsilon(1.01 * table.error() + 1e-6));
            }
        }
}

namespace {

AntennaParams antenna_of(const std::vector<std::pair<double, double>>& points) {
    AntennaParams antenna;
    antenna.elevation = ElevationPattern::points;
    for (const auto& [depression_deg, gain_db] : points)
        antenna.points.push_back({Angle::degrees(depression_deg), Decibel(gain_db)});
    return antenna;
}

}  // namespace

TEST_CASE("a pattern of points is a straight line in decibels between them, tilted as a whole, and the floor beyond",
          "[shade]") {
    AntennaParams antenna = antenna_of({{-20, -40}, {-2, -1}, {0, 0}, {30, -12}});
    antenna.tilt = Angle::degrees(4);
    antenna.floor = Decibel(-50);
    const auto db_at = [&](double depression_deg) {
        return 10 * std::log10(elevation_pattern(antenna, depression_deg * std::numbers::pi / 180));
    };
    CHECK(db_at(4) == Approx(0).margin(1e-9));
    CHECK(db_at(19) == Approx(-6));
    CHECK(db_at(3) == Approx(-0.5));
    CHECK(db_at(-7) == Approx(-1 - 39.0 / 2));  // half-way between -2 and -20 in the antenna's frame
    CHECK(db_at(33.9999) == Approx(-12).margin(1e-3));
    CHECK(db_at(34.0001) == Approx(-50));
    CHECK(db_at(-15.9999) == Approx(-40).margin(1e-3));
    CHECK(db_at(-16.0001) == Approx(-50));
    CHECK(db_at(90) == Approx(-50));
    antenna.points[0].gain = Decibel(-70);  // the floor cuts the points too
    CHECK(db_at(-15.9999) == Approx(-50));
}

TEST_CASE("the table of a pattern of points is right to its error where the pattern bends, and far from it",
          "[shade]") {
    // Bends between slopes of 6 dB a degree; a lobe with a sharp null; a drop at one end.
    std::vector<std::pair<double, double>> lobes;
    for (int i = 0; i <= 24; ++i) lobes.push_back({-12.37 + i, i % 2 ? -30.0 : -6.0 - 0.5 * i});
    const std::vector<std::vector<std::pair<double, double>>> patterns = {
        {{-15, -45}, {-7.77, -1.5}, {-6.123, 0}, {3.3, -9}, {3.9, -5.4}, {60, -30}},
        lobes,
        {{-90, -20}, {0, 0}, {90, -20}},
        {{4.9, -50}, {5.001, 0}, {5.1, -50}}};
    for (const auto& points : patterns)
        for (const double tilt : {0.0, 3.21}) {
            AntennaParams antenna = antenna_of(points);
            antenna.tilt = Angle::degrees(tilt);
            const PatternTable table(antenna);
            INFO(points.size() << " points, tilt " << tilt << ", " << table.intervals() << " intervals");
            // Bends of up to 50 dB a degree take 0.0005; a needle of 500 dB a degree is steeper than any table.
            CHECK(table.error() < (points.size() == 3 && tilt >= 0 && points[0].second < -45 ? 0.02 : 0.001));
            CHECK(table.most() <= 1);
            const double drop = 2.0 / table.intervals();
            const auto right_at = [&](double depression_deg) {
                if (std::abs(depression_deg) > 86.9) return;
                const double sine = -std::sin(depression_deg * std::numbers::pi / 180),
                             g = elevation_pattern(antenna, -std::asin(sine));
                for (const double end : {points.front().first, points.back().first})
                    if (std::abs(sine + std::sin((end + tilt) * std::numbers::pi / 180)) < drop) return;
                if (g < 1e-5) return;
                CHECK(table.at(sine) == Approx(g * g).epsilon(1.05 * table.error() + 1e-6));
            };
            for (const auto& [depression_deg, gain] : points) right_at(depression_deg + tilt);
            for (double depression = -86; depression < 86; depression += 0.0371) right_at(depression);
            for (double depression = -13; depression < 13; depression += 0.00137) right_at(depression);
        }
}

TEST_CASE("points that follow a law give what the law gives", "[shade]") {
    AntennaParams law;
    law.knee = Angle::degrees(4);
    std::vector<std::pair<double, double>> points;
    for (double beta = -20; beta <= 80; beta += 0.05)
        points.push_back({beta, 10 * std::log10(elevation_pattern(law, beta * std::numbers::pi / 180))});
    const PatternTable exact(law), measured(antenna_of(points));
    for (double sine = -0.98; sine < 0.34; sine += 0.00071)
        CHECK(measured.at(sine) == Approx(exact.at(sine)).epsilon(0.002));  // 0.01 dB
}
