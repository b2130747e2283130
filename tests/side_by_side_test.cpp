// Lanes: pieces of work side by side that are put in place one behind the other, and what happens when one fails.
#include <catch2/catch.hpp>

#include <sys/resource.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <exception>
#include <fstream>
#include <numeric>
#include <string>
#include <thread>
#include <vector>

#include "lib/error.hpp"
#include "tests/refusal.hpp"
#include "tools/side_by_side.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

TEST_CASE("a piece that never comes keeps no lane waiting that is far ahead of it", "[side_by_side][threads]") {
    // The first of 99 is slow and then fails, when the other lane has made as many as may wait for it and one more.
    for (const std::size_t slow : {0, 5}) {
        std::vector<std::size_t> in_place;
        std::atomic<std::size_t> most{0};
        InOrder<std::size_t> order(
            99, [&](std::size_t& piece) { in_place.push_back(piece); }, [](std::size_t) {});
        const std::string said = refusal<IoError>([&] {
            side_by_side(
                2, 99,
                [&](int, std::size_t i) {
                    if (i == slow) {
                        while (most < slow + order.most_ahead) std::this_thread::yield();
                        std::this_thread::sleep_for(std::chrono::milliseconds(50));  // until it waits
                        throw IoError("the slow one");
                    }
                    if (i > slow) most = i;
                    order.take(i, std::size_t{i});
                },
                [&](std::size_t i) { order.leave_out(i); });
        });
        CHECK(said == "the slow one");
        CHECK(most == slow + order.most_ahead);
        CHECK(order.end() == slow);
        CHECK(order.error() == nullptr);
        std::vector<std::size_t> before(slow);
        std::iota(before.begin(), before.end(), std::size_t{0});
        CHECK(in_place == before);
    }
}

TEST_CASE("lanes for which there is no thread are an error, and none goes on", "[side_by_side]") {
    // Rooms for a few threads' stacks; instrumented programs need more of them than this lets them have.
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    if (pages * 4096 > std::size_t{1} << 40) return;
    rlimit before{};
    getrlimit(RLIMIT_AS, &before);
    const rlimit small{pages * 4096 + (std::size_t{100} << 20), before.rlim_max};
    std::atomic<int> made{0};
    std::string said;
    setrlimit(RLIMIT_AS, &small);
    try {
        side_by_side(400, 1000000000, [&](int, std::size_t) { ++made; });
    } catch (const IoError& e) {
        said = e.what();
    }
    setrlimit(RLIMIT_AS, &before);
    CHECK_THAT(said, Contains("a thread cannot be started: ") && Contains("(give fewer threads)"));
    CHECK(made < 1000000000);
}

TEST_CASE("pieces are put in place in the order of their numbers, and what cannot be is told",
          "[side_by_side][threads]") {
    std::vector<std::size_t> in_place;
    const auto make = [&](InOrder<std::size_t>& order) {
        side_by_side(3, 300, [&](int, std::size_t i) {
            if (const auto wrong = order.error()) std::rethrow_exception(wrong);
            if (i % 7 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
            order.take(i, std::size_t{i});
        });
    };
    std::vector<std::size_t> all(300);
    std::iota(all.begin(), all.end(), std::size_t{0});
    {
        InOrder<std::size_t> order(
            300, [&](std::size_t& piece) { in_place.push_back(piece); }, [](std::size_t) {});
        make(order);
        CHECK(order.end() == 300);
        CHECK(in_place == all);
    }
    InOrder<std::size_t> full(
        300,
        [&](std::size_t& piece) {
            if (piece == 20) throw IoError("no room");
        },
        [](std::size_t) {});
    CHECK(refusal<IoError>([&] { make(full); }) == "no room");
    CHECK(full.end() == 20);
}
