// StageClock: how the time of a piece of work is shared out among the stages of a sweep, by a look at the clock where one ends
// and the next begins. Leaves seconds to Stopwatch (stopwatch.hpp).
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "lib/ticks.hpp"

namespace wedgescope {

class StageClock {
public:
    enum Stage : std::size_t { other, sample, sweep, shade, deposit, stages };

    /// What comes belongs to `stage`, what was since the last call to that one's.
    void enter(Stage stage) {
        if (stage == stage_) return;  // a look takes as long as a lane or two
        const std::uint64_t now = ticks();
        spent_[stage_] += now - last_;
        last_ = now;
        stage_ = stage;
    }
    /// So much of the time since the last look was something else.
    void leave_out(std::uint64_t ticks) { last_ += ticks; }
    /// Ticks.
    std::uint64_t spent(Stage stage) const { return spent_[stage]; }

private:
    std::array<std::uint64_t, stages> spent_{};
    std::uint64_t last_ = ticks();
    Stage stage_ = other;
};

}  // namespace wedgescope
