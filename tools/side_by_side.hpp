// Lanes: numbered pieces of work side by side, each lane on a thread of its own (side_by_side), and what they made put in
// place in the order of the numbers (InOrder). Leaves what a piece is, and how many threads a lane has, to the commands.
#pragma once
#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <limits>
#include <map>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "lib/error.hpp"

namespace wedgescope {

/// How threads are shared out among lanes.
struct LaneCount {
    int threads = 1;  ///< of all lanes together
    int lanes = 1;
    int threads_of(int lane) const { return threads / lanes + (lane < threads % lanes ? 1 : 0); }
};

/// IoError where the system has no more threads.
template <class Body>
std::thread started(Body&& body) {
    try {
        return std::thread(std::forward<Body>(body));
    } catch (const std::system_error& e) {
        throw IoError(text("a thread cannot be started: ", e.code().message(), " (give fewer threads)"));
    }
}

/// Calls body(lane, i) for every i below `count`, in lanes that each take the next one. What goes wrong with the least i is
/// thrown, whichever lane was faster, when all lanes have ended; `gone_wrong` is told of it, from the lane, at once.
template <class Body>
void side_by_side(int lanes, std::size_t count, Body&& body, const std::function<void(std::size_t)>& gone_wrong = {}) {
    std::atomic<std::size_t> next{0}, first_bad{std::numeric_limits<std::size_t>::max()};
    std::mutex mutex;
    std::exception_ptr error;
    const auto work = [&](int lane) noexcept {
        for (;;) {
            const std::size_t i = next.fetch_add(1);
            if (i >= count || i >= first_bad.load()) return;
            try {
                body(lane, i);
            } catch (...) {
                {
                    const std::lock_guard lock(mutex);
                    if (i < first_bad.load()) {
                        first_bad = i;
                        error = std::current_exception();
                    }
                }
                if (gone_wrong) gone_wrong(i);
                return;
            }
        }
    };
    std::vector<std::thread> others;
    try {
        others.reserve(static_cast<std::size_t>(lanes));
        for (int lane = 1; lane < lanes; ++lane) others.push_back(started([&work, lane] { work(lane); }));
        work(0);
    } catch (...) {
        const std::lock_guard lock(mutex);
        first_bad = 0;  // no lane takes another
        error = std::current_exception();
        if (gone_wrong) gone_wrong(0);
    }
    for (std::thread& other : others) other.join();
    if (error) std::rethrow_exception(error);
}

/// Puts finished pieces in place in the order of their numbers, from a thread of its own: waiting for the disk keeps no lane
/// from its next piece. Holds at most `most_ahead` pieces.
template <class Piece>
class InOrder {
public:
    static constexpr std::size_t most_ahead = 64;

    /// `put`: one piece in its place; what it throws ends it all. `done`: told how many are. Both from the one thread.
    InOrder(std::size_t count, std::function<void(Piece&)> put, std::function<void(std::size_t)> done)
        : count_(count), put_(std::move(put)), done_(std::move(done)), thread_(started([this] { work(); })) {}
    ~InOrder() { end(); }
    InOrder(const InOrder&) = delete;
    InOrder& operator=(const InOrder&) = delete;

    /// Waits while too many wait for the one before, unless that one never comes. Of a piece whose turn never comes nothing
    /// stays.
    void take(std::size_t i, Piece&& piece) {
        std::unique_lock lock(mutex_);
        const auto in_vain = [&] { return error_ || i > gap_; };
        changed_.wait(lock, [&] { return in_vain() || i < in_place_ + most_ahead; });
        if (in_vain()) return;
        waiting_.emplace(i, std::move(piece));
        changed_.notify_all();
    }
    /// This one never comes, and so none behind it is put in place.
    void leave_out(std::size_t i) {
        const std::lock_guard lock(mutex_);
        gap_ = std::min(gap_, i);
        changed_.notify_all();
    }
    /// No more come: those without a gap before them are put in place still. Returns how many are.
    std::size_t end() {
        {
            const std::lock_guard lock(mutex_);
            ended_ = true;
            changed_.notify_all();
        }
        if (thread_.joinable()) thread_.join();
        return in_place_;
    }
    /// What a piece could not be put in place for, if one could not.
    std::exception_ptr error() {
        const std::lock_guard lock(mutex_);
        return error_;
    }

private:
    void work() {
        std::unique_lock lock(mutex_);
        while (in_place_ < count_ && !error_) {
            const auto next = waiting_.find(in_place_);
            if (next == waiting_.end()) {
                if (ended_) break;
                changed_.wait(lock);
                continue;
            }
            auto node = waiting_.extract(next);
            lock.unlock();
            std::exception_ptr error;
            try {
                put_(node.mapped());
            } catch (...) {
                error = std::current_exception();
            }
            lock.lock();
            if (error) {
                error_ = error;
            } else {
                done_(++in_place_);
            }
            changed_.notify_all();
        }
        waiting_.clear();
    }

    const std::size_t count_;
    std::function<void(Piece&)> put_;
    std::function<void(std::size_t)> done_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::map<std::size_t, Piece> waiting_;
    std::size_t in_place_ = 0, gap_ = std::numeric_limits<std::size_t>::max();
    bool ended_ = false;
    std::exception_ptr error_;
    std::thread thread_;
};

}  // namespace wedgescope
