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

/// Works in an arena that an earlier one has left, if one for so many threads is free. oneTBB frees an arena that has
/// called for a worker only when a worker has come and found it empty. Where workers come late, or not at all, arenas
/// made for one piece of work after the other would pile up, and each one more takes it longer the more there are.
class Threads {
public:
    /// `alone`: nothing else works for oneTBB; else a Crew lets so many work.
    explicit Threads(int count, bool alone = true) : arena_(take(count)) {
        if (alone) crew_.emplace(count);
    }
    ~Threads() { leave(arena_); }
    Threads(const Threads&) = delete;
    Threads& operator=(const Threads&) = delete;

    /// Runs `body` and all the tasks that it starts on them; returns when it does.
    template <class Body>
    void execute(Body&& body) {
        arena_.arena.execute(std::forward<Body>(body));
    }

private:
    struct Arena {
        explicit Arena(int threads) : count(threads), arena(threads) {}
        const int count;
        bool in_use = true;
        tbb::task_arena arena;
    };
    struct Arenas;
    static Arenas& arenas();
    static Arena& take(int count);
    static void leave(Arena& arena);

    Arena& arena_;
    std::optional<Crew> crew_;
};

}  // namespace wedgescope
