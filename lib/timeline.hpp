// Timeline: who is told when each thread did what. Costs a test of a pointer where nobody listens.
// Leaves files and their format to tools/timeline.hpp.
#pragma once
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace wedgescope {

class Timeline {
public:
    using Clock = std::chrono::steady_clock;
    virtual ~Timeline() = default;
    /// A piece of work of the calling thread. Pieces of one thread lie beside or inside one another.
    ///   name, category   string literals without quotes or backslashes
    ///   wedge            -1: of none
    ///   bytes            read or written; 0: none
    virtual void span(const char* name, const char* category, Clock::time_point from, Clock::time_point to,
                      std::int64_t wedge, std::uint64_t bytes) noexcept = 0;
    /// Bytes of the memory budget that are held now.
    virtual void memory(std::size_t held_bytes) noexcept = 0;
};

/// The work from here to the end of the block.
class Span {
public:
    Span(Timeline* timeline, const char* name, const char* category, std::int64_t wedge = -1)
        : timeline_(timeline), name_(name), category_(category), wedge_(wedge) {
        if (timeline_) from_ = Timeline::Clock::now();
    }
    ~Span() { end(); }
    Span(const Span&) = delete;
    Span& operator=(const Span&) = delete;
    void add_bytes(std::uint64_t bytes) { bytes_ += bytes; }
    /// Before the block's end.
    void end() noexcept {
        if (Timeline* to = std::exchange(timeline_, nullptr))
            to->span(name_, category_, from_, Timeline::Clock::now(), wedge_, bytes_);
    }

private:
    Timeline* timeline_;
    const char *name_, *category_;
    std::int64_t wedge_;
    std::uint64_t bytes_ = 0;
    Timeline::Clock::time_point from_{};
};

}  // namespace wedgescope
