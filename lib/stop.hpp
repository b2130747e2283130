// Stop: one flag that a signal handler sets and every stage looks at between two chunks of work.
#pragma once
#include <atomic>

#include "lib/error.hpp"

namespace wedgescope {

class Stop {
public:
    /// Async-signal-safe. The first request wins.
    void request(int signal) noexcept {
        int none = 0;
        signal_.compare_exchange_strong(none, signal);
    }
    int signal() const noexcept { return signal_.load(std::memory_order_relaxed); }  ///< 0: none was requested
    void check() const {
        if (int s = signal_.load()) throw Interrupted(s);
    }

private:
    std::atomic<int> signal_{0};
    static_assert(std::atomic<int>::is_always_lock_free);
};

}  // namespace wedgescope
