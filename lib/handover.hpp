// Handover: an order between tasks of oneTBB and their caller that ThreadSanitizer sees.
// Debian's libtbb is not built for it: what a task hands to the next one, or to the caller who waited for it, looks like
// a race. Leaves waiting to oneTBB: this makes nobody wait.
#pragma once
#include <atomic>

namespace wedgescope {

class Handover {
public:
    /// At the beginning and the end of every task, and by the caller before and after all of them: what came before
    /// an earlier pass happens before what comes after a later one.
    void pass() { passed_.fetch_add(1, std::memory_order_acq_rel); }

    /// Passes when it is made and when it ends.
    class Task {
    public:
        explicit Task(Handover& handover) : handover_(handover) { handover_.pass(); }
        ~Task() { handover_.pass(); }
        Task(const Task&) = delete;
        Task& operator=(const Task&) = delete;

    private:
        Handover& handover_;
    };

private:
    std::atomic<unsigned> passed_{0};
};

}  // namespace wedgescope
