// Stopwatch: wall and CPU seconds of the calling thread since it was made.
// Leaves finer shares of a stage to ticks.hpp.
#pragma once
#include <time.h>

#include <algorithm>
#include <chrono>

namespace wedgescope {

class Stopwatch {
public:
    double wall_s() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - wall_).count(); }
    /// Only from the thread that made it.
    double cpu_s() const { return thread_cpu_s() - cpu_s_; }
    /// What the thread did not run.
    double wait_s() const { return std::max(0.0, wall_s() - cpu_s()); }

private:
    static double thread_cpu_s() {
        timespec t{};
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
        return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
    }
    std::chrono::steady_clock::time_point wall_ = std::chrono::steady_clock::now();
    double cpu_s_ = thread_cpu_s();
};

}  // namespace wedgescope
