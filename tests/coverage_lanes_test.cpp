// Coverage's hot loops give the bits of their plain twin, on every instruction set that this machine has.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "lib/coverage_lanes.hpp"
#include "lib/post_extremes.hpp"
#include "tests/every_target.hpp"
#include "tests/reference/coverage_twin.hpp"

using namespace wedgescope;

namespace {

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0);
}

/// A line of posts with its margins: noise, plateaus, needles, voids.
std::vector<float> line_of_posts(std::mt19937& random, std::size_t posts) {
    const auto margin = static_cast<std::size_t>(line_margin);
    std::vector<float> line(posts + 2 * margin, std::numeric_limits<float>::quiet_NaN());
    std::uniform_real_distribution<float> part(0, 1);
    float height = 1000 * part(random);
    const float roughness = std::array{0.0F, 0.5F, 30.0F, 900.0F}[random() % 4];
    for (std::size_t j = 0; j < posts; ++j) {
        const float kind = part(random);
        if (kind < 0.6F) height = std::round(height + roughness * (part(random) - 0.5F));
        line[margin + j] = kind > 0.97F ? std::numeric_limits<float>::quiet_NaN() : kind > 0.95F ? 8000 : height;
    }
    return line;
}

}  // namespace

TEST_CASE("spokes that take a line have their plain twin's horizons, bit for bit", "[coverage][lanes]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(11);
    std::uniform_real_distribution<double> part(0, 1);
    int changed = 0;
    for (int turn = 0; turn < 400; ++turn) {
        // None, some, and more than are looked at in one go.
        const std::size_t groups = turn % 6 == 0 ? random() % 150 : 1 + random() % 9;
        const double step = turn % 7 == 0 ? 0.01 + 1.08 * part(random) : 0.1 + part(random) / 3;  // posts a spoke
        const double begin = static_cast<double>(random() % 20) + (turn % 3 ? part(random) : 0);
        const auto posts = static_cast<std::size_t>(begin + step * static_cast<double>(16 * groups)) + 22;
        const std::vector<float> line = line_of_posts(random, posts), behind = line_of_posts(random, posts);
        std::vector<double> at, at_behind;
        std::vector<float> lift, drop;
        const double lean = 2 * part(random) - 1;
        for (std::size_t g = 0; g <= groups; ++g) {
            at.push_back(begin + 16 * step * static_cast<double>(g) * (1 + 0.01 * part(random) / 9));
            at_behind.push_back(at.back() - lean * (1 + 0.01 * part(random)));
            lift.push_back(static_cast<float>(0.01 / (1 + 0.001 * part(random))));
            drop.push_back(static_cast<float>(0.02 * part(random)));
        }
        std::vector<float> horizon(16 * groups);
        for (float& h : horizon) h = random() % 5 == 0 ? no_horizon_f : static_cast<float>(20 * part(random) - 10);
        RaiseLanes lanes{};
        lanes.groups = groups;
        lanes.origin = -line_margin;
        lanes.at = at.data();
        lanes.at_behind = at_behind.data();
        lanes.lift = lift.data();
        lanes.drop = drop.data();
        lanes.posts = line.data();
        lanes.behind = behind.data();
        lanes.distance = static_cast<float>(turn % 11 == 0 ? part(random) : 1 + 500 * part(random));
        lanes.bow = static_cast<float>(1e-5 * part(random));
        const Lift how{static_cast<float>(3000 * part(random)), static_cast<float>(1 / 8.5e6)};
        for (const Between between : {Between::nothing, Between::crossings, Between::course}) {
            std::vector<float> ours = horizon, twins = horizon;
            lanes.horizon = ours.data();
            raise_lanes(lanes, how, between);
            lanes.horizon = twins.data();
            switch (between) {
                case Between::nothing:
                    twin::raise<Between::nothing>(lanes, how);
                    break;
                case Between::crossings:
                    twin::raise<Between::crossings>(lanes, how);
                    break;
                case Between::course:
                    twin::raise<Between::course>(lanes, how);
            }
            INFO("turn " << turn << ", between lines " << static_cast<int>(between));
            REQUIRE(same_bits(ours, twins));
            changed += !same_bits(ours, horizon);
        }
        std::vector<float> least(groups);
        least_of_groups(horizon.data(), groups, least.data());
        for (std::size_t g = 0; g < groups; ++g)
            REQUIRE(least[g] == *std::min_element(horizon.data() + 16 * g, horizon.data() + 16 * (g + 1)));
    }
    CHECK(changed > 600);
}

TEST_CASE("posts that test themselves have their plain twin's states, bit for bit", "[coverage][lanes]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(12);
    std::uniform_real_distribution<double> part(0, 1);
    std::array<int, 3> states{};
    for (int turn = 0; turn < 400; ++turn) {
        const std::size_t groups = turn % 6 == 0 ? random() % 150 : 1 + random() % 6, posts = 16 * groups;
        const std::vector<float> line = line_of_posts(random, posts), behind = line_of_posts(random, posts);
        // Spokes a post: 1 to 8 as the qualities have it, and up to 64 near the sensor.
        const double each = turn % 5 == 0 ? 64 * part(random) : 1 + 7 * part(random);
        std::vector<double> from, at;
        std::vector<float> lift, drop, ray, rise;
        for (std::size_t g = 0; g <= groups; ++g) {
            const bool cut = g == groups && turn % 4 == 0;  // the last knot at the last post
            from.push_back(static_cast<double>(16 * g) - (cut ? 1 + static_cast<double>(random() % 14) : 0));
            at.push_back(7.3 + each * from.back());
            lift.push_back(static_cast<float>(0.01 / (1 + 0.001 * part(random))));
            drop.push_back(static_cast<float>(0.02 * part(random)));
            ray.push_back(lift.back() * 0.999F);
            rise.push_back(drop.back());
        }
        const auto spokes = static_cast<std::int32_t>(each * static_cast<double>(posts)) + 12;
        std::vector<float> horizon(static_cast<std::size_t>(spokes) + horizon_margin, no_horizon_f);
        const double around = 6 * part(random) - 10;
        for (std::int32_t k = 0; k < spokes; ++k)
            if (random() % 40 != 0)
                horizon[static_cast<std::size_t>(k)] = static_cast<float>(around + 6 * part(random));
        TestLanes lanes{};
        lanes.groups = groups;
        lanes.origin = -line_margin;
        lanes.from = from.data();
        lanes.at = at.data();
        lanes.lift = lift.data();
        lanes.drop = drop.data();
        lanes.ray = ray.data();
        lanes.rise = rise.data();
        lanes.nadir = static_cast<double>(posts) * (2 * part(random) - 0.5);
        lanes.distance = turn % 9 == 0 ? part(random) : 1 + 300 * part(random);
        lanes.bow = 1e-6 * part(random);
        lanes.posts = line.data();
        lanes.behind = behind.data();
        lanes.horizon = horizon.data();
        lanes.first_spoke = random() % 3 ? 0 : 4;  // some posts beside all spokes
        lanes.spokes = spokes - 4;
        lanes.nearest = turn % 9 == 0;
        lanes.target_m = turn % 2 ? 15 : 0;
        if (turn % 4 < 2) {
            float lowest = std::numeric_limits<float>::infinity(), highest = -lowest;
            for (const auto* heights : {&line, &behind})
                for (const float z : *heights)
                    if (z == z) lowest = std::min(lowest, z), highest = std::max(highest, z);
            const double aslant =
                std::max(std::abs(lanes.nadir), std::abs(static_cast<double>(posts) + 16 - lanes.nadir)) /
                lanes.distance;
            if (lowest <= highest)
                lanes.most_relief_m = static_cast<float>(1.01 * (1 + 2 * aslant)) * (highest - lowest) + 1;
        }
        const Lift how{static_cast<float>(1000 * part(random)), static_cast<float>(1 / 8.5e6)};
        const bool wanted = turn % 3 == 0;
        std::vector<std::uint8_t> ours(line.size(), 7), twins = ours;
        std::vector<float> our_raise(line.size(), -1), twin_raise = our_raise, our_tangent = our_raise,
                                                       twin_tangent = our_raise;
        const auto into = [&](std::vector<std::uint8_t>& state, std::vector<float>& raise,
                              std::vector<float>& tangent) {
            lanes.state = state.data();
            lanes.raise_m = wanted ? raise.data() : nullptr;
            lanes.tangent = wanted ? tangent.data() : nullptr;
        };
        into(ours, our_raise, our_tangent);
        test_lanes(lanes, how);
        into(twins, twin_raise, twin_tangent);
        const bool raised = lanes.target_m > 0;
        if (raised)
            wanted ? twin::test_line<true, true>(lanes, how) : twin::test_line<true, false>(lanes, how);
        else
            wanted ? twin::test_line<false, true>(lanes, how) : twin::test_line<false, false>(lanes, how);
        INFO("turn " << turn);
        REQUIRE(ours == twins);
        // How much a void would have to rise is nobody's question.
        for (std::size_t j = 0; j < line.size(); ++j)
            if (ours[j] == 0) our_raise[j] = twin_raise[j] = our_tangent[j] = twin_tangent[j] = 0;
        REQUIRE(same_bits(our_raise, twin_raise));
        REQUIRE(same_bits(our_tangent, twin_tangent));
        for (std::size_t j = 0; j < posts; ++j) ++states[ours[j + static_cast<std::size_t>(line_margin)]];
    }
    for (const int n : states) CHECK(n > 100);
}

TEST_CASE("states are counted as one by one", "[coverage][lanes]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(13);
    for (std::size_t n = 0; n < 300; ++n) {
        std::vector<std::uint8_t> states(n);
        std::array<std::uint64_t, coverage_states> wanted{5, 4, 3, 2, 1}, found = wanted;
        for (std::uint8_t& state : states) {
            state = static_cast<std::uint8_t>(random() % coverage_states);
            ++wanted[state];
        }
        count_states(states.data(), n, found);
        INFO(n << " states");
        REQUIRE(found == wanted);
    }
}

TEST_CASE("extremes and voids of a rectangle are what a plain loop finds", "[coverage][lanes]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(17);
    for (int turn = 0; turn < 600; ++turn) {
        const std::size_t width = 1 + random() % 70, lines = random() % 40, stride = width + random() % 5;
        std::vector<float> posts(stride * (lines + 1));
        for (std::size_t l = 0; l <= lines; ++l) {
            const std::vector<float> line = line_of_posts(random, stride);
            std::copy_n(line.begin() + line_margin, stride, posts.begin() + static_cast<std::ptrdiff_t>(l * stride));
        }
        if (turn % 5 == 0) posts.assign(posts.size(), turn % 2 ? -0.0F : std::numeric_limits<float>::quiet_NaN());
        PostExtremes wanted;
        for (std::size_t l = 0; l < lines; ++l)
            for (std::size_t c = 0; c < width; ++c) {
                const float z = posts[l * stride + c];
                wanted.voids += std::isnan(z);
                if (z < wanted.lowest_m) wanted.lowest_m = z;
                if (z > wanted.highest_m) wanted.highest_m = z;
            }
        const PostExtremes found = post_extremes(posts.data(), stride, lines, width);
        INFO(lines << " lines of " << width << ", " << stride << " apart");
        CHECK(found.voids == wanted.voids);
        CHECK(found.lowest_m == wanted.lowest_m);
        CHECK(found.highest_m == wanted.highest_m);
        CHECK_FALSE((found.lowest_m == 0 && std::signbit(found.lowest_m)));
    }
}
