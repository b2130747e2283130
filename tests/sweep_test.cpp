// The lanes of the sweep: what spokes sample, what rises over a horizon, and how its echo lies in range.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "lib/course.hpp"
#include "lib/lanes.hpp"
#include "lib/sample.hpp"
#include "lib/shade.hpp"
#include "lib/sweep.hpp"
#include "tests/every_target.hpp"

using namespace wedgescope;

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
    CHECK(worst_power < 0.018);
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

TEST_CASE("pieces that a horizon cuts come out in lanes as one by one", "[sweep]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(31);
    std::uniform_real_distribution<double> any(-1, 1);
    const auto cuts = std::make_unique<Cuts>();
    StepScene scene;
    scene.sensor_m = 1000;
    scene.bins_per_metre = 0.1;
    int seen = 0, hides = 0, plain = 0, apart = 0, turned = 0, too_long_for_lobe = 0;
    for (int turn = 0; turn < 400; ++turn) {
        const auto n = 1 + static_cast<std::size_t>(random() % Cuts::most);
        scene.range_is_ground = turn % 3 == 0;
        scene.drops[0] = turn % 5 == 0 ? PatternDrop{-0.19, -0.1902, -0.1898} : PatternDrop{};
        scene.lobe = turn % 4 == 0 ? PatternLobe{-0.2, -0.19, 0.004} : PatternLobe{};
        Cuts& c = *cuts;
        for (std::size_t i = 0; i < n; ++i) {
            const bool steep = turn % 11 == 1;
            const double out = steep           ? 100 + 100 * any(random)
                               : turn % 7 == 0 ? 1 + std::abs(any(random))
                                               : 5000,
                         up = steep ? -900 : -0.2 * out;
            c.out0[i] = out;
            c.out1[i] = out + 30;
            c.up0[i] = up + 10 * any(random);
            c.up1[i] = random() % 9 == 0 ? c.up0[i] : up + 10 * any(random);
            c.bump_m[i] = random() % 4 == 0 ? 0 : 4 * any(random);
            c.range0[i] = std::hypot(c.up0[i], c.out0[i]);
            c.range1[i] = std::hypot(c.up1[i], c.out1[i]);
            c.sine1[i] = c.up1[i] / c.range1[i];
            c.arc0[i] = random() % 50 == 0 ? 0 : out;
            c.arc1[i] = out + 30;
            const bool ground = scene.range_is_ground;
            c.x0[i] = scene.bins_per_metre * (ground ? c.arc0[i] : c.range0[i]);
            c.x1[i] = scene.bins_per_metre * (ground ? c.arc1[i] : c.range1[i]);
            c.on_horizon[i] = random() % 3 == 0 ? 1 : 0;
            const double start = c.up0[i] / c.range0[i];
            // In view, just hidden, far below; and level with the end or without a horizon at all.
            c.horizon[i] = c.on_horizon[i] == 1 ? start : start + 0.001 * std::abs(any(random));
            if (random() % 31 == 0) c.horizon[i] = c.sine1[i];
            if (random() % 63 == 0) c.horizon[i] = -2;
            c.inverse_radius[i] = random() % 2 ? 0 : 1 / (4.0 / 3 * mean_radius_m);
            c.hidden_from[i] = c.arc0[i] * std::abs(any(random));
        }
        cut_pieces(n, scene, c);
        for (std::size_t i = 0; i < n; ++i) {
            INFO("turn " << turn << ", piece " << i << " of " << n);
            const double h = c.horizon[i];
            const Course one = course(h, c.up0[i], c.out0[i], c.up1[i], c.out1[i], c.bump_m[i], c.on_horizon[i] == 1);
            REQUIRE((c.seen[i] == 1) == one.seen);
            if (!one.seen) continue;
            ++seen;
            hides += one.hides;
            REQUIRE((c.hides[i] == 1) == one.hides);
            REQUIRE(c.begin[i] == one.begin);
            REQUIRE(c.end[i] == one.end);
            REQUIRE(c.bow[i] == one.bow);
            const auto point = [&](double u) {
                const double up = c.up0[i] + u * (c.up1[i] - c.up0[i]) + c.bump_m[i] * 4 * u * (1 - u),
                             out = c.out0[i] + u * (c.out1[i] - c.out0[i]), range = std::hypot(up, out);
                const double x =
                    scene.range_is_ground ? c.x0[i] + u * (c.x1[i] - c.x0[i]) : range * scene.bins_per_metre;
                return std::array{range, up / range, x};
            };
            const auto out = point(one.begin), top = point(one.end);
            CHECK(c.range_out[i] == Approx(out[0]).epsilon(1e-12));
            CHECK(c.x_out[i] == Approx(out[2]).epsilon(1e-12));
            CHECK(c.range_top[i] == Approx(top[0]).epsilon(1e-12));
            CHECK(c.sine_top[i] == Approx(top[1]).epsilon(1e-12).margin(1e-15));
            CHECK(c.x_top[i] == Approx(top[2]).epsilon(1e-12));
            const auto shadow = [&](double arc) {
                return scene.bins_per_metre *
                       (scene.range_is_ground ? arc : ray_range_m(scene.sensor_m, arc, h, c.inverse_radius[i]));
            };
            CHECK(c.shadow0[i] == shadow(c.hidden_from[i]));
            CHECK(c.shadow1[i] == shadow(c.arc0[i] + one.begin * (c.arc1[i] - c.arc0[i])));
            const double part = one.end - one.begin, range_bins = scene.range_is_ground ? 0 : scene.bins_per_metre,
                         across = out[0] * top[0] *
                                  (top[1] * std::sqrt(1 - out[1] * out[1]) - out[1] * std::sqrt(1 - top[1] * top[1]));
            const bool turns = turns_in_range(across, c.range_top[i], c.bump_m[i] * part * part, c.sine_top[i],
                                              (c.range_top[i] - c.range_out[i]) * range_bins, range_bins);
            turned += turns ? 1 : 0;
            const bool together = c.arc0[i] > 0 && !turns &&
                                  one_range(c.range_out[i], c.range_top[i], c.sine_top[i] - h, c.sine_top[i]) &&
                                  straight_range(c.bump_m[i] * part * part, c.sine_top[i], range_bins) &&
                                  !meets_drop(h, c.sine_top[i], scene.drops[0].low, scene.drops[0].high);
            const bool in_lobe = h < scene.lobe.high && c.sine_top[i] > scene.lobe.low,
                       too_long = in_lobe &&
                                  c.sine_top[i] - h > scene.lobe.part * (std::abs(c.sine_top[i]) + most_sine_offset);
            too_long_for_lobe += together && too_long ? 1 : 0;
            CHECK((c.plain[i] == 1) == (together && !too_long));
            ++(together ? plain : apart);
        }
    }
    CHECK(too_long_for_lobe > 100);
    CHECK(seen > 2000);
    CHECK(hides > 500);
    CHECK(plain > 1000);
    CHECK(apart > 100);
    CHECK(turned > 50);
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
