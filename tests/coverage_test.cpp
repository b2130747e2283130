// Coverage on drawn terrain: answers known in closed form or from a walk along the ray; the same bits however it is run.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <random>
#include <tuple>

#include "lib/coverage.hpp"
#include "lib/error.hpp"
#include "tests/reference/line_of_sight.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;
using test::MemorySource;

namespace {

constexpr double post_m = 30;

Scene scene_at(double column, double row, double height_m, std::optional<double> earth_k = std::nullopt) {
    Scene scene;
    scene.platform.xy = PointXY{column * post_m, -row * post_m};
    scene.platform.altitude_above = AltitudeAbove::sea_level;
    scene.platform.altitude_m = height_m;
    scene.geometry = Geometry::grid;
    scene.earth_k = earth_k;
    return scene;
}

struct Result {
    std::int64_t columns = 0;
    std::vector<std::uint8_t> bytes;
    std::vector<float> values;
    std::vector<int> times;  ///< each post was handed out
    CoverageReport report;
    int at(std::int64_t c, std::int64_t r) const { return bytes[static_cast<std::size_t>(r * columns + c)]; }
    float value(std::int64_t c, std::int64_t r) const { return values[static_cast<std::size_t>(r * columns + c)]; }
};

Result look(MemorySource& source, const Scene& scene, CoverageParams params = {}) {
    const DataBase& db = source.data_base();
    Result out;
    out.columns = db.columns;
    const auto posts = static_cast<std::size_t>(db.columns * db.rows);
    out.bytes.resize(posts, 99);
    out.values.resize(posts, -99);
    out.times.resize(posts);
    out.report = cover(resolve_coverage(scene, source), source, params, [&](const CoverageTile& tile) {
        for (std::int64_t r = tile.window.rows.begin; r < tile.window.rows.end; ++r)
            for (std::int64_t c = tile.window.columns.begin; c < tile.window.columns.end; ++c) {
                const auto from = (r - tile.window.rows.begin) * tile.stride + c - tile.window.columns.begin;
                const auto to = static_cast<std::size_t>(r * db.columns + c);
                if (tile.bytes) out.bytes[to] = tile.bytes[from];
                if (tile.values) out.values[to] = tile.values[from];
                ++out.times[to];
            }
    });
    CHECK(std::all_of(out.times.begin(), out.times.end(), [](int n) { return n == 1; }));
    std::uint64_t all = 0;
    for (std::uint64_t n : out.report.states) all += n;
    CHECK(all == posts);
    return out;
}

CoverageParams layer(CoverageLayer kind) {
    CoverageParams params;
    params.layer = kind;
    return params;
}

/// What an exact walk of each ray says, of every `step`-th post.
class Walked {
public:
    Walked(MemorySource& source, const Scene& scene, double target_m = 0, std::size_t step = 1) : step_(step) {
        const DataBase& db = source.data_base();
        const Chunk all = source.load({{0, db.columns}, {0, db.rows}}, false);
        const reference::Matrix matrix{db.columns, db.rows, {all.surface_m.begin(), all.surface_m.end()}};
        const ResolvedScene resolved = resolve_coverage(scene, source);
        reference::Sensor sensor;
        sensor.column = resolved.nadir.column;
        sensor.row = resolved.nadir.row;
        sensor.height_m = resolved.sensor_m;
        sensor.earth_k = scene.earth_k;
        sensor.target_m = target_m;
        reference::Grid grid;
        grid.column_m = db.step_x;
        grid.row_m = db.step_y;
        const reference::LineOfSight sight(matrix, grid, sensor);
        for (std::size_t i = 0; i < matrix.height.size(); i += step)
            verdicts_.push_back(
                sight.look(static_cast<std::int64_t>(i) % db.columns, static_cast<std::int64_t>(i) / db.columns).state);
    }
    /// Share of the posts, in %, that a mask judges otherwise.
    double wrong(const Result& mask) const {
        std::size_t bad = 0, posts = 0;
        for (std::size_t i = 0; i < verdicts_.size(); ++i) {
            const int byte = mask.bytes[i * step_];
            if (verdicts_[i] == reference::Verdict::no_data) {
                bad += byte != 1;
                continue;
            }
            ++posts;
            bad += (byte == 255) != (verdicts_[i] == reference::Verdict::seen);
        }
        return 100.0 * static_cast<double>(bad) / static_cast<double>(std::max<std::size_t>(posts, 1));
    }

private:
    std::size_t step_;
    std::vector<reference::Verdict::State> verdicts_;
};

}  // namespace

TEST_CASE("every post of a plain is seen, wherever the sensor stands", "[coverage][quick]") {
    MemorySource source(300, 520, post_m, [](double, double) { return 100; });
    const double places[][2] = {{150, 260},   {150.5, 260.25}, {0, 0},     {299, 519},   {149.5, 0},
                                {-40.5, 100}, {700, 900},      {150, -30}, {255.5, 256}, {150.3, 519.9}};
    for (const auto& place : places)
        for (const double height : {100.0, 100.5, 30000.0}) {
            if (height == 100.0 && place[0] != std::floor(place[0])) continue;
            INFO("column " << place[0] << ", row " << place[1] << ", " << height << " m");
            const Result seen = look(source, scene_at(place[0], place[1], height));
            for (std::size_t i = 0; i < seen.bytes.size(); ++i)
                if (seen.bytes[i] != 255) {
                    FAIL_CHECK("column " << i % 300 << ", row " << i / 300 << " is " << int{seen.bytes[i]});
                    break;
                }
        }
}

TEST_CASE("a tilted plain through the sensor is level with its own horizon, and seen", "[coverage][quick]") {
    MemorySource source(200, 200, post_m, [](double c, double r) { return 500 + 2 * (c - 100) + 3 * (r - 100); });
    const Result seen = look(source, scene_at(100, 100, 500));
    for (std::size_t i = 0; i < seen.bytes.size(); ++i) {
        INFO("column " << i % 200 << ", row " << i / 200);
        REQUIRE(int{seen.bytes[i]} == 255);
    }
}

TEST_CASE("a ridge hides the ground behind it as far as its shadow reaches", "[coverage][quick]") {
    // 100 m over the plain, a ridge of 50 m at 60 posts: the shadow ends at 120 posts.
    MemorySource source(400, 41, post_m, [](double c, double) { return c == 70 ? 50 : 0; });
    const Result seen = look(source, scene_at(10, 20, 100));
    CHECK(seen.at(70, 20) == 255);
    for (std::int64_t c = 71; c < 130; ++c) CHECK(seen.at(c, 20) == 0);
    for (std::int64_t c = 130; c < 400; ++c) CHECK(seen.at(c, 20) == 255);
    // What it takes to be seen: the ray over the ridge.
    const Result height = look(source, scene_at(10, 20, 100), layer(CoverageLayer::height));
    CHECK(height.value(70, 20) == 0);
    for (std::int64_t c = 75; c < 128; ++c)
        CHECK(height.value(c, 20) == Approx(100 - 50.0 * static_cast<double>(c - 10) / 60).margin(0.01));
    CHECK(height.value(300, 20) == 0);
    // A target as high as that is seen, one a little lower is not; and it hides nobody else.
    CoverageParams params;
    params.target_m = 25.1;
    const Result raised = look(source, scene_at(10, 20, 100), params);
    CHECK(raised.at(100, 20) == 255);
    CHECK(raised.at(99, 20) == 0);
}

TEST_CASE("what a post has to rise over a round earth is what the ray over a wall says, however far",
          "[coverage][quick]") {
    // 300 m high, 2.5 km before the sensor: 120 km farther the ray is 12 km up, and a metre there lifts less than one at the ground.
    constexpr std::int64_t wall = 100;
    for (const double ground_m : {0.0, 2500.0}) {
        MemorySource source(4001, 9, 30,
                            [=](double c, double) { return ground_m + (c == wall || c == wall + 1 ? 300 : 0); });
        for (const double target_m : {0.0, 800.0}) {
            Scene scene = scene_at(0, 4, ground_m + 10, 4.0 / 3);
            scene.quality = Quality::exact;
            CoverageParams params = layer(CoverageLayer::height);
            params.target_m = target_m;
            const Result height = look(source, scene, params);
            const ResolvedScene resolved = resolve_coverage(scene, source);
            const double inverse = resolved.earth.inverse_radius(), radius = 1 / inverse,
                         sensor = radius + resolved.sensor_m;
            const auto at = [&](std::int64_t c) {
                return static_cast<double>(c) * 30 * inverse;
            };  // angle at the earth's centre
            const double top = radius + ground_m + 300,
                         tangent = (top * std::cos(at(wall)) - sensor) / (top * std::sin(at(wall)));
            for (const std::int64_t c : {120, 500, 1000, 2000, 3000, 4000}) {
                const double ray_m = sensor / (std::cos(at(c)) - tangent * std::sin(at(c))) - radius;
                INFO("column " << c << ", target of " << target_m << " m on ground of " << ground_m << " m");
                CHECK(height.value(c, 4) ==
                      Approx(std::max(0.0, ray_m - ground_m - target_m)).margin(0.02).epsilon(2e-6));
            }
        }
    }
}

TEST_CASE("what a post beside a low sensor has to rise is what the earth's bend hides of it", "[coverage][quick]") {
    for (const double step_m : {30.0, 1000.0, 10000.0})
        for (const double above_m : {0.0, 0.001, 0.1, 3.0})
            for (const double target_m : {0.0, 0.05}) {
                MemorySource source(7, 7, step_m, [](double, double) { return 0; });
                Scene scene = scene_at(0, 0, above_m, 4.0 / 3);
                scene.platform.xy = PointXY{3 * step_m, -3 * step_m};
                scene.quality = Quality::exact;
                CoverageParams params = layer(CoverageLayer::height);
                params.target_m = target_m;
                const Result height = look(source, scene, params);
                const double radius = 1 / resolve_coverage(scene, source).earth.inverse_radius();
                for (const auto& [column, row] : {std::pair(4, 3), std::pair(3, 2), std::pair(2, 2), std::pair(4, 4)}) {
                    // From the sensor to the horizon, and from there to the top of the target.
                    const double s = step_m * std::hypot(column - 3, row - 3),
                                 beyond = std::max(0.0, s - std::sqrt(2 * radius * above_m)),
                                 rise_m = std::max(0.0, beyond * beyond / (2 * radius) - target_m);
                    INFO("posts of " << step_m << " m, " << above_m << " m up, target of " << target_m << " m, column "
                                     << column << ", row " << row);
                    CHECK(height.value(column, row) == Approx(rise_m).margin(0.0011).epsilon(0.02));
                }
            }
}

TEST_CASE("the ground between two opposite posts of a cell hides what is behind it", "[coverage][quick]") {
    // Two posts of the sensor's cell stand 8 m high, so over the diagonal, from the corner, the ground is 16 t (1 - t) m
    // high: from h m above the corner the highest tangent is 16 - 8 sqrt(h) m a diagonal, where t = sqrt(h) / 4. Nothing of
    // it is on a line of posts. Behind the cell's far corner stands a post in a hollow.
    for (const bool mirrored : {false, true}) {
        const auto height = [&](double column, double row) {
            const double c = mirrored ? 40 - column : column, r = row;
            if ((c == 20 && r == 20) || (c == 21 && r == 21)) return 0.0;
            if ((c == 21 && r == 20) || (c == 20 && r == 21)) return 8.0;
            return c == 22 && r == 22 ? 3.0 : -300.0;
        };
        MemorySource source(41, 41, post_m, height);
        for (const double h : {0.0, 0.25, 1.0, 2.25}) {
            const double tangent = 16 - 8 * std::sqrt(h), level_m = h + 2 * tangent;
            for (const Quality quality : {Quality::draft, Quality::normal, Quality::exact}) {
                Scene scene = scene_at(20, 20, h);
                scene.quality = quality;
                INFO("from " << h << " m, " << word(quality) << (mirrored ? ", mirrored" : ""));
                const std::int64_t c = mirrored ? 18 : 22;
                CHECK(look(source, scene).at(c, 22) == 0);
                CoverageParams raised;
                raised.target_m = 0.99 * level_m - 3;
                CHECK(look(source, scene, raised).at(c, 22) == 0);
                raised.target_m = 1.01 * level_m - 3;
                CHECK(look(source, scene, raised).at(c, 22) == 255);
                CHECK(std::abs(look(source, scene, layer(CoverageLayer::height)).value(c, 22) - (level_m - 3)) <=
                      0.01 * level_m);
                // A thing that stands on the cell's far corner is behind the hump too: it shows from where 16 t (1 - t) is
                // nowhere above the line to it.
                const std::int64_t corner = mirrored ? 19 : 21;
                raised.target_m = 0.99 * (h + tangent);
                CHECK(look(source, scene, raised).at(corner, 21) == 0);
                raised.target_m = 1.01 * (h + tangent);
                CHECK(look(source, scene, raised).at(corner, 21) == 255);
                CHECK(std::abs(look(source, scene, layer(CoverageLayer::height)).value(corner, 21) - (h + tangent)) <=
                      0.01 * (h + tangent));
                scene.curved_course = false;
                CHECK(look(source, scene).at(c, 22) == 255);
            }
        }
    }
}

TEST_CASE("the sea is seen as far as its horizon", "[coverage][quick]") {
    constexpr double k = 4.0 / 3, sensor = 40, radius = k * 6371008.7714;
    MemorySource source(1400, 9, post_m, [](double, double) { return 0; });
    const Result seen = look(source, scene_at(0, 4, sensor, k));
    // cos(theta) = R / (R + h)
    const double horizon = radius * std::acos(radius / (radius + sensor)) / post_m;
    REQUIRE(horizon < 1300);
    for (std::int64_t c = 0; c < 1400; ++c) {
        if (std::abs(static_cast<double>(c) - horizon) < 1) continue;
        INFO(c);
        CHECK(seen.at(c, 4) == (static_cast<double>(c) < horizon ? 255 : 0));
    }
}

TEST_CASE("range, depression and grazing are those of the triangle", "[coverage][quick]") {
    MemorySource source(300, 300, post_m, [](double, double) { return 50; });
    const Scene scene = scene_at(100, 120, 2050);
    const Result range = look(source, scene, layer(CoverageLayer::range)),
                 depression = look(source, scene, layer(CoverageLayer::depression)),
                 grazing = look(source, scene, layer(CoverageLayer::grazing));
    for (std::int64_t r = 0; r < 300; r += 7)
        for (std::int64_t c = 0; c < 300; c += 11) {
            const double ground = std::hypot(static_cast<double>(c - 100), static_cast<double>(r - 120)) * post_m;
            CHECK(range.value(c, r) == Approx(std::hypot(ground, 2000)).epsilon(1e-6));
            const double angle = std::atan2(2000, ground) * 180 / std::numbers::pi;
            CHECK(depression.value(c, r) == Approx(angle).epsilon(1e-6));
            CHECK(grazing.value(c, r) == Approx(angle).epsilon(1e-5));
        }
    CHECK(range.value(100, 120) == 2000);
    CHECK(depression.value(100, 120) == 90);

    // Slopes towards and away from the sensor add to and take from it.
    MemorySource slope(300, 41, post_m, [](double c, double) { return 3 * std::abs(c - 150); });
    const Result steep = look(slope, scene_at(20, 20, 3000), layer(CoverageLayer::grazing));
    const double rise = std::atan(0.1) * 180 / std::numbers::pi;
    const auto depressed = [&](double c, double z) {
        return std::atan2(3000 - z, (c - 20) * post_m) * 180 / std::numbers::pi;
    };
    CHECK(steep.value(200, 20) == Approx(depressed(200, 150) + rise).margin(1e-3));
    CHECK(steep.value(100, 20) == Approx(depressed(100, 150) - rise).margin(1e-3));
}

TEST_CASE("range, sector and pitch limit what is in view", "[coverage][quick]") {
    MemorySource source(600, 600, post_m, [](double, double) { return 0; });
    Scene scene = scene_at(300, 300, 1000);
    scene.range_m = 5000;
    scene.range_start_m = 2000;
    scene.platform.heading = Angle::degrees(350);
    scene.sector = Sector{Angle::degrees(-20), Angle::degrees(100)};
    CoverageParams params;
    params.elevation.emplace(Angle::degrees(-25), Angle::degrees(-12));
    params.mask.outside = 7;
    const Result seen = look(source, scene, params);
    std::size_t inside = 0, wrong_posts = 0;
    for (std::int64_t r = 0; r < 600; ++r)
        for (std::int64_t c = 0; c < 600; ++c) {
            const double x = static_cast<double>(c - 300) * post_m, y = static_cast<double>(300 - r) * post_m,
                         ground = std::hypot(x, y), slant = std::hypot(ground, 1000),
                         pitch = -std::atan2(1000, ground) * 180 / std::numbers::pi,
                         azimuth = std::atan2(x, y) * 180 / std::numbers::pi;
            const double edge = std::min({std::abs(slant - 5000), std::abs(slant - 2000),
                                          ground * std::abs(azimuth + 30) / 57, ground * std::abs(azimuth - 90) / 57,
                                          ground * std::abs(pitch + 25) / 57, ground * std::abs(pitch + 12) / 57});
            if (edge < 1) continue;
            const bool in = slant < 5000 && slant > 2000 && azimuth > -30 && azimuth < 90 && pitch > -25 && pitch < -12;
            inside += in;
            wrong_posts += seen.at(c, r) != (in ? 255 : 7);
            if (seen.at(c, r) != (in ? 255 : 7) && wrong_posts < 3)
                FAIL_CHECK("column " << c << ", row " << r << ": " << seen.at(c, r) << ", slant " << slant
                                     << ", azimuth " << azimuth << ", pitch " << pitch);
        }
    CHECK(wrong_posts == 0);
    CHECK(inside > 1000);
    CHECK(seen.report.states[static_cast<std::size_t>(State::seen)] >= inside);
}

TEST_CASE("a limited view holds what the whole one holds there, and looks at little beside it", "[coverage]") {
    const auto ground = [](double c, double r) {
        const double pit = std::hypot(c - 500, r - 100);
        return pit < 9 ? std::numeric_limits<double>::quiet_NaN()
                       : 90 * std::sin(c / 17) * std::cos(r / 23) + 300 * std::exp(-std::pow((c - r) / 60, 2));
    };
    MemorySource bare(700, 640, post_m, ground), wooded(700, 640, post_m, ground);
    wooded.set_culture_height([](double c, double r) { return std::fmod(c + r, 40) < 20 ? 18 : 0; });
    std::mt19937 random(20261128);
    const auto drawn = [&](double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); };
    std::size_t in_view = 0, passed = 0;
    for (int i = 0; i < 40; ++i) {
        const double column = i % 4 == 0 ? 350 : drawn(-30, 720), row = i % 4 == 0 ? 320 : drawn(1, 638);
        Scene scene = scene_at(column, row, drawn(350, 2500), 4.0 / 3);
        MemorySource& source = i % 3 == 1 ? wooded : bare;
        const double target_m = i % 4 == 2 ? 25 : 0;
        const auto seen = [&](CoverageLayer kind) {
            CoverageParams params = layer(kind);
            params.target_m = target_m;
            params.mask.outside = 7;
            return look(source, scene, params);
        };
        const Result all = seen(CoverageLayer::states), range = seen(CoverageLayer::range),
                     raise = seen(CoverageLayer::height);
        constexpr std::array widths{0.002, 0.5, 4.0, 30.0, 90.0, 200.0, 345.0};
        const double width = widths[static_cast<std::size_t>(i) % widths.size()],
                     from = i % 5 == 0 ? 45 : drawn(-360, 0);
        scene.sector = Sector{Angle::degrees(from), Angle::degrees(from + width)};
        if (i % 2 == 0) scene.platform.heading = Angle::degrees(drawn(0, 360));
        if (i % 3 == 0) scene.range_m = drawn(1000, 15000);
        if (i % 6 == 0) scene.range_start_m = drawn(0, 900);
        const double begin = scene.platform.heading.rad() + scene.sector->from.rad();
        const Result part = seen(CoverageLayer::states), mask = seen(CoverageLayer::mask),
                     part_raise = seen(CoverageLayer::height);
        std::size_t wrong = 0, inside = 0;
        for (std::int64_t r = 0; r < 640; ++r)
            for (std::int64_t c = 0; c < 700; ++c) {
                const double x = static_cast<double>(c) - column, y = row - static_cast<double>(r),
                             m = static_cast<double>(range.value(c, r));
                if (std::hypot(x, y) < 1e-9) continue;  // in every sector
                constexpr double circle = 2 * std::numbers::pi, rounding = 1e-9;
                double beyond = std::fmod(std::atan2(x, y) - begin, circle);
                if (beyond < 0) beyond += circle;
                const double edge = width * std::numbers::pi / 180;
                if (std::min({beyond, std::abs(beyond - edge), circle - beyond}) < rounding) continue;
                bool in = beyond < edge;
                if (scene.range_m) {
                    if (in && std::isnan(m)) continue;  // a void's place is that of the level surface
                    if (std::abs(m - *scene.range_m) < 0.01 || std::abs(m - scene.range_start_m) < 0.01) continue;
                    in = in && m <= *scene.range_m && m >= scene.range_start_m;
                }
                inside += in;
                const int state = in ? all.at(c, r) : static_cast<int>(State::outside);
                wrong += part.at(c, r) != state;
                constexpr std::array in_mask{1, 0, 255, 255, 7};  // by state
                wrong += mask.at(c, r) != in_mask[static_cast<std::size_t>(state)];
                const float a = part_raise.value(c, r),
                            b = in ? raise.value(c, r) : std::numeric_limits<float>::quiet_NaN();
                wrong += !(a == b || (std::isnan(a) && std::isnan(b)));
            }
        INFO("sensor at " << column << ", " << row << ", sector of " << width << " degrees from " << from);
        CHECK(wrong == 0);
        in_view += inside;
        if (width < 5) passed += part.report.total().posts_read < all.report.total().posts_read * 3 / 5;
    }
    CHECK(in_view > 1000000);
    CHECK(passed > 12);
}

TEST_CASE("a distance along the ground limits the view whatever the heights", "[coverage][quick]") {
    // A disc of 150 posts, sensor and ground as high as they like; (90, 120) and its like stand on its very edge.
    MemorySource source(400, 420, post_m, [](double c, double) { return 3 * c; });
    for (const double sensor : {1300.0, 9000.0, 40000.0})
        for (const auto earth : {std::optional<double>(), std::optional(4.0 / 3)}) {
            Scene scene = scene_at(200, 200, sensor, earth);
            scene.ground_range_m = 150 * post_m;
            CoverageParams params;
            params.mask.outside = 7;
            const Result seen = look(source, scene, params);
            const Result range = look(source, scene, layer(CoverageLayer::range));
            std::size_t wrong = 0;
            for (std::int64_t r = 0; r < 420; ++r)
                for (std::int64_t c = 0; c < 400; ++c) {
                    const bool in = (c - 200) * (c - 200) + (r - 200) * (r - 200) <= 150 * 150;
                    wrong += seen.at(c, r) != (in ? 255 : 7) || std::isnan(range.value(c, r)) == in;
                }
            INFO("sensor at " << sensor << " m");
            CHECK(wrong == 0);
        }
    // With a slant range too both count.
    Scene scene = scene_at(200, 200, 9000);
    scene.ground_range_m = 150 * post_m;
    scene.range_m = 9000;
    const Result both = look(source, scene);
    CHECK(both.at(220, 200) == 255);
    CHECK(both.at(200, 290) == 255);  // 8.8 km
    CHECK(both.at(200, 320) == 1);    // 9.1 km with the ground at 0.6 km: 3.6 km off and 8.4 km below
}

TEST_CASE("rolling ground is judged as an exact walk of each ray judges it", "[coverage]") {
    const unsigned seed = 20260131;
    INFO("seed " << seed);
    MemorySource source(330, 290, post_m, test::rolling(300, 120, seed));
    struct Place {
        double column, row, height;
    };
    for (const Place& place : {Place{160, 140, 500},
                               {160.25, 140.75, 420},
                               {-30, 100, 900},
                               {200, 400, 1500},
                               {0, 289, 700},
                               {329.5, -0.5, 600},
                               {100, 50.5, 30000}}) {
        Scene scene = scene_at(place.column, place.row, place.height, 4.0 / 3);
        INFO("column " << place.column << ", row " << place.row << ", " << place.height << " m");
        scene.quality = Quality::normal;
        const Result normal = look(source, scene);
        const Walked truth(source, scene, 0, place.row == 140 ? 1 : 7);
        CHECK(truth.wrong(normal) < 0.2);
        scene.quality = Quality::exact;
        CHECK(truth.wrong(look(source, scene)) < 0.06);
        scene.quality = Quality::normal;
        CoverageParams params;
        params.target_m = 20;
        CHECK(Walked(source, scene, 20, 7).wrong(look(source, scene, params)) < 0.2);
        // height is 0 just where the mask is 255
        const Result height = look(source, scene, layer(CoverageLayer::height));
        std::size_t unlike = 0;
        for (std::size_t i = 0; i < height.values.size(); ++i)
            unlike += (height.values[i] == 0) != (normal.bytes[i] == 255);
        CHECK(unlike == 0);
    }
}

TEST_CASE("seams at diagonals and axes do not show", "[coverage][seam][quick]") {
    // Diagonals through posts, from a post and from the middle of a cell; strips begin at 256.
    MemorySource source(401, 401, post_m, test::rolling(250, 90, 7));
    const Chunk all = source.load({{0, 401}, {0, 401}}, false);
    const reference::Matrix matrix{401, 401, {all.surface_m.begin(), all.surface_m.end()}};
    const reference::Grid grid{post_m, -post_m, {}, {}};
    int bad = 0, posts = 0;
    for (const double place : {200.0, 239.5, 252.0}) {
        const Scene scene = scene_at(place, place, 450);
        const Result seen = look(source, scene);
        CoverageParams swept;
        swept.cull = false;
        CHECK(seen.bytes == look(source, scene, swept).bytes);
        reference::Sensor sensor;
        sensor.column = sensor.row = place;
        sensor.height_m = 450;
        const reference::LineOfSight sight(matrix, grid, sensor);
        for (double i = 1; i < 200; ++i)
            for (const double beside : {0, 1, 2})
                for (const auto& [x, y] : {std::pair{i, i - beside}, {i - beside, i}, {i, 0.0}, {0.0, i}})
                    for (const auto& [c, r] : {std::pair{place + x, place + y},
                                               {place - x, place + y},
                                               {place + x, place - y},
                                               {place - x, place - y}}) {
                        const auto column = std::llround(std::floor(c)), row = std::llround(std::floor(r));
                        if (column < 0 || row < 0 || column > 400 || row > 400) continue;
                        ++posts;
                        bad += (seen.at(column, row) == 255) !=
                               (sight.look(column, row).state == reference::Verdict::seen);
                    }
    }
    CHECK(posts > 20000);
    CHECK(bad <= posts / 400);
}

TEST_CASE("a tower within a void may hide posts behind all four cells round it", "[coverage][quick]") {
    // A post of 400 m, all round it void; a ray from the south-west may leave a cell of it by a side, between two lines.
    MemorySource source(201, 201, post_m, [](double c, double r) {
        if (c == 75 && r == 125) return 400.0;
        return c > 70 && c < 80 && r > 120 && r < 130 ? std::numeric_limits<double>::quiet_NaN() : 0.0;
    });
    Scene scene = scene_at(60.3, 140.7, 300);
    const auto azimuth = [](double c, double r) { return std::atan2(c - 60.3, 140.7 - r); };
    const double first = azimuth(74, 124), last = azimuth(76, 126);
    for (const Quality quality : {Quality::draft, Quality::exact}) {
        scene.quality = quality;
        const Result states = look(source, scene, layer(CoverageLayer::states));
        int behind = 0, beside = 0, wrong = 0;
        for (std::int64_t r = 0; r < 120; ++r)
            for (std::int64_t c = 81; c < 201; ++c) {
                const double at = azimuth(static_cast<double>(c), static_cast<double>(r));
                const bool hidden = at > first && at < last;
                ++(hidden ? behind : beside);
                wrong += states.at(c, r) != (hidden ? 3 : 2);
            }
        INFO(word(quality) << ": " << wrong << " wrong of " << behind << " behind it and " << beside << " beside");
        CHECK(behind > 500);
        CHECK(beside > 5000);
        CHECK(wrong <= behind / 25);
    }
}

TEST_CASE("voids are no data, hide nothing, and what they may hide is unknown", "[coverage][quick]") {
    // A hill of 60 m stands round a void on the way east.
    const auto ground = [](double c, double r) -> double {
        if (c >= 100 && c <= 110 && std::abs(r - 50) <= 10) return std::numeric_limits<double>::quiet_NaN();
        if (c >= 98 && c <= 112 && std::abs(r - 50) <= 12) return 60;
        return 0;
    };
    MemorySource source(300, 101, post_m, ground);
    const Scene scene = scene_at(20, 50, 100);
    const Result mask = look(source, scene), states = look(source, scene, layer(CoverageLayer::states));
    CHECK(mask.at(105, 50) == 1);
    CHECK(states.at(105, 50) == 0);
    CHECK(states.report.states[0] == 11 * 21);
    for (std::int64_t c = 115; c < 200; ++c) CHECK(mask.at(c, 50) == 0);  // behind the hill's edge
    CHECK(states.at(50, 50) == 2);
    CHECK(Walked(source, scene).wrong(mask) < 0.2);

    // Without the edge: level ground behind a void is seen; unknown only if something near the void is higher.
    MemorySource flat(300, 101, post_m, [](double c, double) {
        return c >= 100 && c <= 110 ? std::numeric_limits<double>::quiet_NaN() : c == 111 ? 5.0 : 0.0;
    });
    const Result open = look(flat, scene_at(20, 50, 100), layer(CoverageLayer::states));
    CHECK(open.at(50, 50) == 2);
    CHECK(open.at(111, 50) == 2);
    CHECK(open.at(113, 50) == 1);  // behind the step
    CHECK(open.at(290, 50) == 2);
    MemorySource step(300, 101, post_m, [](double c, double) {
        return c >= 100 && c <= 110 ? std::numeric_limits<double>::quiet_NaN() : c == 99 ? 20.0 : c > 110 ? 19.0 : 0.0;
    });
    // Would-be ground of 20 m at column 110 hides what lies between it and its shadow's end.
    const Result hidden = look(step, scene_at(20, 50, 100), layer(CoverageLayer::states));
    CHECK(hidden.at(111, 50) == 3);
    CHECK(hidden.at(250, 50) == 2);
    CHECK(look(step, scene_at(20, 50, 100)).at(111, 50) == 255);
    // Only this layer's report tells unknown from seen; all others count both as seen, and all else alike.
    CHECK(hidden.report.states[3] > 100);
    for (const CoverageLayer kind : {CoverageLayer::mask, CoverageLayer::height, CoverageLayer::range,
                                     CoverageLayer::grazing, CoverageLayer::depression}) {
        const CoverageReport other = look(step, scene_at(20, 50, 100), layer(kind)).report;
        CHECK(other.states[3] == 0);
        CHECK(other.states[2] == hidden.report.states[2] + hidden.report.states[3]);
        for (const std::size_t same : {0, 1, 4}) CHECK(other.states[same] == hidden.report.states[same]);
        CHECK(other.seen() == hidden.report.seen());
    }
    MemorySource none(70, 60, post_m, [](double, double) { return std::numeric_limits<double>::quiet_NaN(); });
    CHECK(look(none, scene_at(20, 50, 100)).report.states[0] == 70 * 60);
}

TEST_CASE("threads and memory change no bit", "[coverage][threads]") {
    MemorySource source(700, 600, post_m, test::rolling(400, 200, 11));
    source.set_culture_height([](double c, double r) { return std::fmod(c * 7 + r * 3, 50) == 0 ? 15 : 0; });
    for (const auto kind : {CoverageLayer::mask, CoverageLayer::states, CoverageLayer::height}) {
        const Scene scene = scene_at(310.5, 222, 600, 4.0 / 3);
        CoverageParams params = layer(kind);
        params.threads = 1;
        const Result first = look(source, scene, params);
        for (const int threads : {1, 2})
            for (const std::size_t mebibytes : {64, 1024}) {
                params.threads = threads;
                params.memory_bytes = mebibytes << 20;
                const Result other = look(source, scene, params);
                CHECK(other.bytes == first.bytes);
                CHECK((is_bytes(kind) || other.values == first.values));
                CHECK(other.report.states == first.report.states);
            }
    }
    CoverageParams small;
    small.memory_bytes = 3 << 20;
    CHECK_THROWS_AS(look(source, scene_at(310, 222, 600), small), InputError);
}

TEST_CASE("a spoke for every four posts is carried the same way every time, over the raster's edges too",
          "[coverage][quick]") {
    const auto hills = test::rolling(400, 50, 23);
    MemorySource source(640, 560, post_m, [&](double c, double r) { return 300 + hills(c, r); });
    for (const Quality quality : {Quality::normal, Quality::exact})
        for (const auto& [column, row] : {std::pair(110.4, 290.7), std::pair(-40.3, 95.0), std::pair(960.2, -180.6)}) {
            Scene scene = scene_at(column, row, 3000);
            scene.quality = quality;
            scene.spokes_per_post = 0.25;
            scene.range_m = 60000;
            const Result first = look(source, scene);
            CHECK(std::count(first.bytes.begin(), first.bytes.end(), 255) > 1000);
            for (int again = 0; again < 3; ++again) {
                CoverageParams params;
                params.cull = again != 1;
                params.threads = 1 + again;
                CHECK((look(source, scene, params).bytes == first.bytes));
            }
        }
}

TEST_CASE("what the writer throws ends the work and arrives", "[coverage][threads][quick]") {
    MemorySource source(300, 300, post_m, [](double, double) { return 0; });
    CHECK_THROWS_AS(cover(resolve_coverage(scene_at(100, 100, 50), source), source, {},
                          [](const CoverageTile&) { throw IoError("disk full"); }),
                    IoError);
}

TEST_CASE("ground that changes while it is read, or since it was opened, is an error", "[coverage][quick]") {
    class Edited : public MemorySource {
    public:
        using MemorySource::MemorySource;
        using WedgeSource::load;
        Chunk load(const ChunkRequest& request) override {
            if (edit_at_a_load) number = 2;
            return MemorySource::load(request);
        }
        std::uint64_t fingerprint(const std::vector<Window>&) override { return number; }
        std::uint64_t number = 1;
        bool edit_at_a_load = false;
    };
    Edited source(300, 300, post_m, [](double, double) { return 0; });
    const ResolvedScene scene = resolve_coverage(scene_at(100, 100, 50), source);
    CoverageParams params;
    params.threads = 1;
    params.data = 1;
    const auto work = [&] { cover(scene, source, params, [](const CoverageTile&) {}); };
    work();
    source.edit_at_a_load = true;
    CHECK_THROWS_WITH(work(), Catch::Matchers::Contains("'drawn' changed while it was read"));
    source.edit_at_a_load = false;
    CHECK_THROWS_WITH(work(), Catch::Matchers::Contains("changed"));  // since it was opened
    params.data.reset();
    work();
    source.edit_at_a_load = true;
    source.number = 1;
    CHECK_THROWS_AS(work(), DataError);
}

TEST_CASE("what stays below every horizon is left out, and no bit changes", "[coverage][cull]") {
    const unsigned seed = 20261121;
    INFO("seed " << seed);
    std::mt19937 random(seed);
    const auto part = [&](double lo, double hi) { return std::uniform_real_distribution(lo, hi)(random); };
    std::uint64_t passed_read = 0, passed_map = 0, posts_all = 0;
    for (int turn = 0; turn < 14; ++turn) {
        const auto columns = static_cast<std::int64_t>(part(200, 900)),
                   rows = static_cast<std::int64_t>(part(200, 700));
        const auto hills = test::rolling(part(50, 400), part(60, 300), static_cast<unsigned>(random()));
        const double hole_c = part(0, 900), hole_r = part(0, 700), hole = turn % 3 == 0 ? part(5, 150) : 0;
        const auto ground = [&](double c, double r) -> double {
            if (std::max(std::abs(c - hole_c), std::abs(r - hole_r)) < hole)
                return std::numeric_limits<double>::quiet_NaN();
            return hills(c, r);
        };
        MemorySource plain(columns, rows, post_m, ground), mapped(columns, rows, post_m, ground);
        if (turn % 4 == 1)
            for (MemorySource* source : {&plain, &mapped})
                source->set_culture_height(
                    [](double c, double r) { return std::fmod(c * 5 + r * 11, 97) < 1 ? 40 : 0; });
        mapped.set_block_map();
        const bool outside = turn % 5 == 4;
        Scene scene = scene_at(outside ? -part(0, 400) : part(0, 1) * static_cast<double>(columns - 1),
                               part(-0.2, 1.2) * static_cast<double>(rows - 1), part(150, 500), 4.0 / 3);
        if (turn % 6 == 5) scene.sector = Sector{Angle::degrees(part(-170, 0)), Angle::degrees(part(10, 170))};
        if (turn % 7 == 6) scene.range_m = part(3000, 20000);
        if (turn % 7 == 4)
            scene.ground_range_m = 3000 + 500 * turn;  // draws no number, so that the places stay above ground
        scene.quality = std::array{Quality::draft, Quality::normal, Quality::fine, Quality::exact}[random() % 4];
        for (const auto kind : {CoverageLayer::mask, CoverageLayer::states, CoverageLayer::height}) {
            CoverageParams params = layer(kind);
            params.target_m = turn % 2 ? 15 : 0;
            params.cull = false;
            const Result whole = look(plain, scene, params);
            CHECK(whole.report.total().posts_passed == 0);
            params.cull = true;
            const Result swept = look(plain, scene, params), read = look(mapped, scene, params);
            INFO("turn " << turn << ", layer " << static_cast<int>(kind));
            for (const Result* other : {&swept, &read}) {
                CHECK(other->bytes == whole.bytes);
                CHECK(std::equal(other->values.begin(), other->values.end(), whole.values.begin(),
                                 [](float a, float b) { return a == b || (a != a && b != b); }));
                CHECK(other->report.states == whole.report.states);
            }
            passed_read += swept.report.total().posts_passed;
            passed_map += read.report.total().posts_passed;
        }
        posts_all += static_cast<std::uint64_t>(columns * rows);
    }
    CHECK(passed_read > posts_all / 10);
    CHECK(passed_map > posts_all / 10);
}

TEST_CASE("a post's own piece that begins beside a void hides nothing", "[coverage][quick]") {
    // The way to post (108, 104) enters its cell between (107, 103), a void, and (107, 104), a wall that it would come down from.
    // A spoke runs to the post itself, and meets the void as well.
    for (const bool with_void : {true, false}) {
        MemorySource source(201, 201, post_m, [&](double c, double r) {
            if (c == 107 && r == 103) return with_void ? std::numeric_limits<double>::quiet_NaN() : 0.0;
            return c == 107 && r == 104 ? 60.0 : 0.0;
        });
        for (const Quality quality : {Quality::draft, Quality::normal, Quality::fine, Quality::exact}) {
            INFO((with_void ? "a void, " : "no void, ") << word(quality));
            Scene scene = scene_at(100, 100, 100);
            scene.quality = quality;
            const Result mask = look(source, scene), heights = look(source, scene, layer(CoverageLayer::height));
            CHECK(mask.at(108, 104) == (with_void ? 255 : 0));
            CHECK((heights.value(108, 104) == 0) == with_void);
        }
    }
}

TEST_CASE("what may stand in voids comes from the posts round them, hidden or not", "[coverage][cull]") {
    // From the sensor, 100 m up, onwards: a wall that hides the plain; voids up to a block's border, and behind it a dam, hidden
    // as well, but so high that in the voids it may reach over the wall's ray; a slope that rises into view.
    const auto along = [](double t) -> double {
        if (t >= 164 && t < 192) return std::numeric_limits<double>::quiet_NaN();
        if (t >= 39 && t < 42) return 200;
        if (t >= 192 && t < 194) return 650;
        return t < 250 ? 0 : std::min(1200.0, 60 * (t - 250));
    };
    constexpr std::int64_t length = 320, width = 224;
    for (const int way : {0, 1, 2, 3})
        for (const Quality quality : {Quality::normal, Quality::exact}) {
            const bool columns = way < 2, backwards = way % 2 == 1;
            const auto place = [&](double t) { return backwards ? static_cast<double>(length - 1) - t : t; };
            const auto ground = [&](double c, double r) { return along(place(columns ? c : r)); };
            MemorySource source(columns ? length : width, columns ? width : length, post_m, ground);
            source.set_block_map();
            const double t = place(10.25), across = 0.5 * width + 0.25;
            Scene scene = scene_at(columns ? t : across, columns ? across : t, 100, 4.0 / 3);
            scene.quality = quality;
            CoverageParams params = layer(CoverageLayer::states);
            params.cull = false;
            const Result whole = look(source, scene, params);
            params.cull = true;
            const Result read = look(source, scene, params);
            INFO("way " << way << ", quality " << static_cast<int>(quality));
            CHECK(read.bytes == whole.bytes);
            CHECK(whole.report.states[static_cast<std::size_t>(State::unknown)] > 50);
            CHECK(read.report.total().posts_passed > 10000);
        }
}

TEST_CASE("ground behind a wall is never read, and nothing but voids neither", "[coverage][cull][quick]") {
    // A wall of 400 m from north to south, 4.5 km east of the sensor; far behind it void.
    const auto ground = [](double c, double) -> double {
        if (c >= 1000) return std::numeric_limits<double>::quiet_NaN();
        return c >= 250 && c < 254 ? 400 : 0;
    };
    MemorySource source(1300, 300, post_m, ground);
    source.set_block_map();
    const Scene scene = scene_at(100, 150, 100);
    const Result mask = look(source, scene);
    CHECK(mask.at(240, 150) == 255);
    CHECK(mask.at(600, 150) == 0);
    CHECK(mask.at(1100, 150) == 1);
    std::size_t behind = 0;
    for (std::int64_t r = 0; r < 300; ++r)
        for (std::int64_t c = 530; c < 990; ++c) behind += source.was_read(c, r);
    CHECK(behind == 0);
    CHECK(source.was_read(200, 150));
    // Who asks for heights behind the wall gets them; voids are not read for that.
    look(source, scene, layer(CoverageLayer::height));
    CHECK(source.was_read(600, 150));
    CHECK_FALSE(source.was_read(1200, 150));
}

TEST_CASE("no post behind a wall all round is seen, on the diagonals neither", "[coverage][cull]") {
    // Lines of tiles begin at 256, 512, 768; on them the spokes beyond the diagonal are as good as the others.
    for (const auto& [column, row, earth_k] : {std::tuple{449.5, 449.5, 1.0},
                                               {433.25, 470.25, 4.0 / 3},
                                               {490.5, 500.5, 2},
                                               {437.5, 417.5, 2},
                                               {533.5, 537.5, 2}}) {
        MemorySource source(1000, 1000, post_m, [c0 = column, r0 = row](double c, double r) {
            const double d = std::hypot(c - c0, r - r0);
            return d > 40 && d < 44 ? 400 : 3 * std::sin(c) * std::sin(1.7 * r);
        });
        for (const bool cull : {false, true}) {
            CoverageParams params;
            params.cull = cull;
            const Result seen = look(source, scene_at(column, row, 100, earth_k), params);
            std::size_t wrong = 0;
            for (std::int64_t r = 0; r < 1000; ++r)
                for (std::int64_t c = 0; c < 1000; ++c)
                    wrong += std::hypot(static_cast<double>(c) - column, static_cast<double>(r) - row) > 46 &&
                             seen.at(c, r) != 0;
            INFO("sensor at column " << column << ", row " << row << (cull ? ", culled" : ""));
            CHECK(wrong == 0);
        }
    }
}

TEST_CASE("behind a wall all round nothing is seen wherever strips and runs begin, and little is read",
          "[coverage][cull][seam]") {
    const unsigned seed = 20261122;
    INFO("seed " << seed);
    std::mt19937 random(seed);
    const auto part = [&](double lo, double hi) { return std::uniform_real_distribution(lo, hi)(random); };
    for (int turn = 0; turn < 24; ++turn) {
        // A strip begins at 256, another at 512; exact cuts them into runs.
        const std::int64_t edge = turn % 12 == 0 ? 560 : 300;
        const double column = turn % 4 == 0   ? std::floor(part(180, 250))
                              : turn % 4 == 1 ? std::floor(part(180, 250)) + 0.5
                                              : part(180, 250),
                     row = turn % 3 == 0 ? column + std::floor(part(-9, 9)) : part(180, 250);
        const bool pits = turn % 5 == 2, voids = turn % 7 == 3;
        const auto away = [=](double c, double r) { return std::hypot(c - column, r - row); };
        const auto ground = [&](double c, double r) -> double {
            const double d = away(c, r);
            if (d > 8 && d < 11) return 400;
            if (voids && d > 20 && std::fmod(7 * c + 13 * r, 301) < 1) return std::numeric_limits<double>::quiet_NaN();
            const double pit = pits && d > 60 && std::fmod(c, 64) < 20 ? 2500 : 0;
            return 3 * std::sin(c) * std::sin(1.7 * r) - pit;
        };
        MemorySource plain(edge, edge, post_m, ground), mapped(edge, edge, post_m, ground);
        mapped.set_block_map();
        Scene scene = scene_at(column, row, 100, turn % 2 ? std::optional(part(1, 3)) : std::nullopt);
        scene.quality = turn % 12 == 0
                            ? Quality::exact
                            : std::array{Quality::draft, Quality::normal, Quality::fine, Quality::exact}[random() % 4];
        CoverageParams params;
        if (turn % 6 == 2) scene.range_m = part(1500, 4000);
        if (turn % 6 == 3) scene.range_m = 9000, scene.range_start_m = part(1500, 3000);
        if (turn % 6 == 4) params.elevation.emplace(Angle::degrees(-part(2, 6)), Angle::degrees(20));
        if (turn % 6 == 5) scene.sector = Sector{Angle::degrees(-45), Angle::degrees(part(30, 100))};
        INFO("turn " << turn << ": sensor at column " << column << ", row " << row << ", " << word(scene.quality));
        params.cull = false;
        const Result swept = look(plain, scene, params);
        std::size_t wrong = 0, behind = 0;
        for (std::int64_t r = 0; r < edge; ++r)
            for (std::int64_t c = 0; c < edge; ++c) {
                const double d = away(static_cast<double>(c), static_cast<double>(r));
                if (d < 13) continue;
                ++behind;
                wrong += swept.at(c, r) != 0 && swept.at(c, r) != 1;
            }
        CHECK(wrong == 0);
        CHECK(behind > 80000);
        params.cull = true;
        CHECK(look(plain, scene, params).bytes == swept.bytes);
        CHECK(look(mapped, scene, params).bytes == swept.bytes);
        if (turn % 6 > 1 || voids || std::max(column, row) > 240) continue;
        // Not a post is read that far behind a wall that ends before the strips, on the diagonals neither.
        std::size_t read = 0;
        for (std::int64_t r = 256 + 40; r < edge; ++r)
            for (std::int64_t c = 256 + 40; c < edge; ++c) read += mapped.was_read(c, r);
        CHECK(read == 0);
    }
}

TEST_CASE("peaks a hair over and under the ray of what hides them are judged alike, culled or not",
          "[coverage][cull][seam]") {
    const unsigned seed = 20261123;
    INFO("seed " << seed);
    std::mt19937 random(seed);
    const auto part = [&](double lo, double hi) { return std::uniform_real_distribution(lo, hi)(random); };
    constexpr std::int64_t length = 24000, width = 32;
    struct Course {
        double climbs_m;  ///< of the ray over the wall, a post
        double below;     ///< of the ground, parts of what the ray climbs; or, with a level ray, metres
        std::optional<double> earth_k;
        double target_m;
    };
    int turn = 0;
    for (const Course& course : {Course{-0.01, 0.02, {}, 0},
                                 {0.01, 0.02, {}, 0},
                                 {0, 1500, {}, 0},
                                 {-0.02, 0.02, 60, 0},
                                 {0.02, 0.02, 60, 3},
                                 {-0.01, 0.02, {}, 3}}) {
        const bool rows = turn % 2 == 1, back = turn % 4 > 1;
        ++turn;
        const double major = -1000.25, minor = 16.5, wall = 40 - major,
                     k = course.earth_k ? 1 / (*course.earth_k * 6371008.7714) : 0;
        // Height of the ray over the wall, `d` lines and `side` posts from the sensor at height 0.
        const auto ray = [&](double d, double side) {
            const double f = post_m * std::hypot(1, side / d), top = course.climbs_m * wall;
            if (k == 0) return top / wall * d;
            const double theta = wall * f * k, turned = 2 * std::pow(std::sin(theta / 2), 2),
                         tangent = (top - turned * (1 / k + top)) / ((1 / k + top) * std::sin(theta)),
                         ahead = d * f * k, sunk = 2 * std::pow(std::sin(ahead / 2), 2) + tangent * std::sin(ahead);
            return sunk / k / (1 - sunk);
        };
        std::vector<double> heights(length * width, -3000);
        const auto height = [&](std::int64_t line, std::int64_t side) -> double& {
            return heights[static_cast<std::size_t>(line * width + side)];
        };
        for (std::int64_t line = 40; line < length; ++line)
            for (std::int64_t side = 0; side < width; ++side) {
                const double d = static_cast<double>(line) - major;
                height(line, side) =
                    line == 40 ? course.climbs_m * wall
                               : ray(d, static_cast<double>(side) - minor) - course.target_m -
                                     course.below * (course.climbs_m == 0 ? 1 : std::abs(course.climbs_m) * d);
            }
        for (int i = 0; i < 800; ++i) {
            auto line = static_cast<std::int64_t>(part(100, length - 10));
            if (i % 2) line = line / 32 * 32 + i / 2 % 3 - 1;  // where blocks begin and end
            const auto side = static_cast<std::int64_t>(part(2, width - 2));
            const double d = static_cast<double>(line) - major, hair = std::pow(10, -part(3, 7)) * (i % 3 ? -1 : 1);
            height(line, side) = ray(d, static_cast<double>(side) - minor) - course.target_m +
                                 hair * (course.climbs_m == 0 ? 1 : std::abs(course.climbs_m) * d);
        }
        const std::int64_t columns = rows ? width : length, lines = rows ? length : width;
        MemorySource source(columns, lines, post_m, [&](double c, double r) {
            const std::int64_t line = std::llround(rows ? r : c);
            return height(back ? length - 1 - line : line, std::llround(rows ? c : r));
        });
        const double from = back ? static_cast<double>(length - 1) - major : major;
        const Scene scene = scene_at(rows ? minor : from, rows ? from : minor, 0, course.earth_k);
        CoverageParams params;
        params.target_m = course.target_m;
        params.cull = false;
        const Result swept = look(source, scene, params);
        params.cull = true;
        INFO("course " << turn);
        const Result culled = look(source, scene, params);
        CHECK(culled.bytes == swept.bytes);
        source.set_block_map();
        const Result unread = look(source, scene, params);
        CHECK(unread.bytes == swept.bytes);
        CHECK(swept.report.seen() > 200);
        CHECK(std::min(culled.report.total().posts_passed, unread.report.total().posts_passed) > length * width / 20);
    }
}
