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
        if (watching_ && stage != stage_) look();
        stage_ = stage;
    }
    /// What comes is another turn. A look takes as long as a lane or two: one turn in so many says how the time of all is shared,
    /// whatever they do.
    void next_turn() {
        const bool watched = turn_ == 0;
        if (watched != watching_) look();
        watching_ = watched;
        turn_ = turn_ + 1 < turns_a_watch ? turn_ + 1 : 0;
    }
    static constexpr std::uint32_t turns_a_watch = 7;  ///< in step with no block
    /// So much of the time since the last look was something else.
    void leave_out(std::uint64_t ticks) { last_ += ticks; }
    /// Ticks, of what was watched.
    std::uint64_t spent(Stage stage) const { return spent_[stage]; }

private:
    void look() {
        const std::uint64_t now = ticks();
        if (watching_) spent_[stage_] += now - last_;
        last_ = now;
    }

    std::array<std::uint64_t, stages> spent_{};
    std::uint64_t last_ = ticks();
    Stage stage_ = other;
    bool watching_ = true;
    std::uint32_t turn_ = 0;
};

}  // namespace wedgescope
