// Busy worker: oneTBB has one thread beside its callers, and while this lives it is kept elsewhere.
#pragma once
#include <tbb/parallel_for.h>

#include <atomic>
#include <thread>

#include "lib/handover.hpp"
#include "lib/threads.hpp"

namespace wedgescope::test {

class BusyWorker {
public:
    /// Returns when the worker is kept.
    BusyWorker() {
        for (int n = inside_; n < 2; n = inside_) inside_.wait(n);
    }
    ~BusyWorker() {
        over_ = true;
        over_.notify_all();
        caller_.join();
    }
    BusyWorker(const BusyWorker&) = delete;
    BusyWorker& operator=(const BusyWorker&) = delete;

private:
    void keep() {
        Threads(2, false).execute([&] {
            tbb::parallel_for(
                0, 2,
                [&](int) {
                    const Handover::Task task(handover_);
                    ++inside_;
                    inside_.notify_all();
                    over_.wait(false);
                },
                tbb::simple_partitioner());
        });
        handover_.pass();
    }

    const Crew crew_{2};
    Handover handover_;
    std::atomic<int> inside_{0};
    std::atomic<bool> over_{false};
    std::thread caller_{[this] { keep(); }};
};

}  // namespace wedgescope::test
