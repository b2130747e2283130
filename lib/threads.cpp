#include "lib/threads.hpp"

#include <list>
#include <mutex>

namespace wedgescope {

/// As many for each number of threads as were once in use at a time.
struct Threads::Arenas {
    std::mutex mutex;
    std::list<Arena> all;
};

/// Never destroyed: oneTBB may have ended before.
Threads::Arenas& Threads::arenas() {
    static Arenas& arenas = *new Arenas;
    return arenas;
}

Threads::Arena& Threads::take(int count) {
    Arenas& kept = arenas();
    const std::lock_guard lock(kept.mutex);
    for (Arena& arena : kept.all)
        if (!arena.in_use && arena.count == count) {
            arena.in_use = true;
            return arena;
        }
    return kept.all.emplace_back(count);
}

void Threads::leave(Arena& arena) {
    const std::lock_guard lock(arenas().mutex);
    arena.in_use = false;
}

}  // namespace wedgescope
