// Threads: so many threads for a piece of work by oneTBB, also above the number of cores. Leaves the work to whoever gives it.
#pragma once
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <cstddef>
#include <utility>

namespace wedgescope {

class Threads {
public:
    explicit Threads(int count)
        : control_(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(count)), arena_(count) {}

    /// Runs `body` and all the tasks that it starts on them; returns when it does.
    template <class Body>
    void execute(Body&& body) {
        arena_.execute(std::forward<Body>(body));
    }

private:
    tbb::global_control control_;
    tbb::task_arena arena_;
};

}  // namespace wedgescope
