// Stopwatch: wall and CPU seconds of the calling thread since it was made.
// Leaves finer shares of a stage to stage_clock.hpp.
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
    /// That, and what the thread did not run. CPU time is asked of the kernel, so once for both.
    struct Took {
        double cpu_s, wait_s;
    };
    Took took() const {
        const double cpu = cpu_s();
        return {cpu, std::max(0.0, wall_s() - cpu)};
    }

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
