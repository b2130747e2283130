// Threads: so many threads for a piece of work by oneTBB, also above the number of cores. Crew: so many for all the work
// that goes on side by side. Leaves the work to whoever gives it.
#pragma once
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>

namespace wedgescope {

/// While it lives no more threads than these work for oneTBB, of all arenas.
class Crew {
public:
    explicit Crew(int count)
        : control_(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(count)) {}

private:
    tbb::global_control control_;
};

/// As many of these threads as oneTBB has at hand, where no Crew lets more of them work.
inline int at_hand(int threads) { return std::clamp(tbb::this_task_arena::max_concurrency(), 1, std::max(1, threads)); }

class Threads {
public:
    /// `alone`: nothing else works for oneTBB; else a Crew lets so many work.
    explicit Threads(int count, bool alone = true) : arena_(count) {
        if (alone) crew_.emplace(count);
    }

    /// Runs `body` and all the tasks that it starts on them; returns when it does.
    template <class Body>
    void execute(Body&& body) {
        arena_.execute(std::forward<Body>(body));
    }

private:
    std::optional<Crew> crew_;
    tbb::task_arena arena_;
};

}  // namespace wedgescope
