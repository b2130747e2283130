// Threads: one piece of work after the other, where oneTBB's workers come and where they do not.
#include "lib/threads.hpp"

#include <tbb/parallel_for.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cstddef>
#include <thread>
#include <vector>

#include "lib/handover.hpp"
#include "tests/busy_worker.hpp"
#include "tests/process_bytes.hpp"

using namespace wedgescope;
using namespace wedgescope::test;

namespace {

/// How many of two tasks were done, by two threads if there are as many.
int pair_of_tasks() {
    std::atomic<int> done{0};
    Handover handover;
    Threads(2, false).execute([&] {
        handover.pass();
        tbb::parallel_for(
            0, 2,
            [&](int) {
                const Handover::Task task(handover);
                ++done;
            },
            tbb::simple_partitioner());
        handover.pass();
    });
    return done;
}

}  // namespace

TEST_CASE("pieces of work that call for a worker in vain leave nothing behind", "[threads]") {
    const BusyWorker worker;
    int done = 0;
    for (int i = 0; i < 50; ++i) done += pair_of_tasks();
    const std::size_t before = resident_bytes();
    for (int i = 50; i < 3000; ++i) done += pair_of_tasks();
    CHECK(done == 6000);
    CHECK(resident_bytes() < before + (std::size_t{4} << 20));  // 21 MB of arenas, were each left behind
}

TEST_CASE("each piece of work has the threads that it asks for, side by side and one within the other", "[threads]") {
    const Crew crew(4);
    const auto concurrency = [](int count) {
        int found = 0;
        Threads(count, false).execute([&] { found = tbb::this_task_arena::max_concurrency(); });
        return found;
    };
    std::atomic<int> wrong{0};
    std::vector<std::thread> callers;
    for (int caller = 0; caller < 3; ++caller)
        callers.emplace_back([&, caller] {
            for (int i = 0; i < 200; ++i) {
                const int count = 1 + (caller + i) % 4;
                if (concurrency(count) != count || pair_of_tasks() != 2) ++wrong;
                Threads(count, false).execute([&] {
                    if (concurrency(3) != 3 || concurrency(count) != count || pair_of_tasks() != 2) ++wrong;
                });
            }
        });
    for (std::thread& caller : callers) caller.join();
    CHECK(wrong == 0);
}

TEST_CASE("work alone has its threads, however many others had before", "[threads]") {
    for (const int count : {3, 1, 8, 3, 2}) {
        Threads threads(count);
        threads.execute([&] { CHECK(tbb::this_task_arena::max_concurrency() == count); });
        CHECK(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism) ==
              static_cast<std::size_t>(count));
    }
}
