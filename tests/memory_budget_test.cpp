// Memory tokens shared by threads: who waits is woken.
#include <catch2/catch.hpp>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "lib/error.hpp"
#include "lib/memory_budget.hpp"

using namespace wedgescope;

namespace {
void a_moment() { std::this_thread::sleep_for(std::chrono::milliseconds(30)); }
}  // namespace

TEST_CASE("what is taken comes back when the token dies", "[memory]") {
    MemoryBudget budget(100);
    {
        const auto first = budget.take(60);
        CHECK(first.bytes() == 60);
        CHECK(budget.held() == 60);
        CHECK(budget.try_take(41).bytes() == 0);
        CHECK(budget.try_take(40).bytes() == 40);  // dies at once
    }
    CHECK(budget.held() == 0);
    CHECK(budget.peak() == 100);
    CHECK(budget.total() == 100);
}

TEST_CASE("a moved token gives back once", "[memory]") {
    MemoryBudget budget(100);
    auto first = budget.take(60);
    auto second = std::move(first);
    CHECK(second.bytes() == 60);
    CHECK(budget.held() == 60);
    second = budget.take(10);  // lets the 60 go
    CHECK(budget.held() == 10);
    second = MemoryBudget::Token();
    CHECK(budget.held() == 0);
}

TEST_CASE("more than the whole budget is refused at once", "[memory]") {
    MemoryBudget budget(100);
    CHECK_THROWS_AS(budget.take(101), IoError);
    CHECK_THROWS_WITH(budget.take(101), Catch::Contains("101") && Catch::Contains("100"));
    CHECK(budget.take(100).bytes() == 100);
    CHECK(budget.take(0).bytes() == 0);
}

TEST_CASE("a waiter sleeps until memory is given back", "[memory]") {
    MemoryBudget budget(100);
    auto held = budget.take(80);
    std::atomic<std::size_t> got{0};
    std::thread waiter([&] {
        const auto token = budget.take(50);
        got = token.bytes();
    });
    a_moment();
    CHECK(got == 0);
    held = MemoryBudget::Token();
    waiter.join();
    CHECK(got == 50);
    CHECK(budget.held() == 0);
}

TEST_CASE("stop wakes every waiter with empty hands", "[memory]") {
    MemoryBudget budget(100);
    const auto held = budget.take(100);
    std::atomic<int> empty{0};
    std::vector<std::thread> waiters;
    for (int i = 0; i < 4; ++i)
        waiters.emplace_back([&] {
            if (budget.take(10).bytes() == 0) ++empty;
        });
    a_moment();
    CHECK(empty == 0);
    budget.stop();
    for (std::thread& waiter : waiters) waiter.join();
    CHECK(empty == 4);
    CHECK(budget.take(10).bytes() == 0);
    CHECK(budget.held() == 100);
}

TEST_CASE("threads together never hold more than the budget", "[memory]") {
    MemoryBudget budget(1000);
    std::atomic<std::int64_t> held{0};
    std::atomic<bool> over{false};
    std::vector<std::thread> workers;
    for (unsigned w = 0; w < 4; ++w)
        workers.emplace_back([&, w] {
            for (unsigned i = 0; i < 2000; ++i) {
                const std::size_t bytes = 100 + (i * 7919 + w * 104729) % 800;
                const auto token = budget.take(bytes);
                const auto mine = static_cast<std::int64_t>(bytes);
                if (held.fetch_add(mine) + mine > 1000) over = true;
                held.fetch_sub(mine);
            }
        });
    for (std::thread& worker : workers) worker.join();
    CHECK_FALSE(over);
    CHECK(budget.held() == 0);
    CHECK(budget.peak() <= 1000);
}

TEST_CASE("too little memory stays that in any context, and so does its context", "[memory]") {
    constexpr std::size_t mebibyte = std::size_t{1} << 20;
    try {
        with_context("frame 2", [&] {
            with_context("line 3", [&] { throw TooLittleMemory(4 * mebibyte, 9 * mebibyte, "this scene", " (so)"); });
        });
        FAIL("nothing is thrown");
    } catch (const TooLittleMemory& e) {
        CHECK(std::string(e.what()) == "frame 2: line 3: memory is 4 MiB; this scene needs at least 9 MiB (so)");
        CHECK(std::string(e.with(5 * mebibyte, 7 * mebibyte).what()) ==
              "frame 2: line 3: memory is 5 MiB; this scene needs at least 7 MiB (so)");
    }
}
