// TimelineFile: a run's timeline as Trace Event JSON, for Perfetto and chrome://tracing.
// Leaves what is a span to the engine and the commands.
//
// Memory: events go to the file in pieces of 64 KiB; nothing else is held but one entry a thread.
// Counters come when they are told, and from a thread of its own where nobody has told any for 25 ms.
#pragma once
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "lib/timeline.hpp"
#include "tiles/output_file.hpp"

namespace wedgescope {

class TimelineFile final : public Timeline {
public:
    /// Writes to the temporary name of `file`, which must outlive this. IoError.
    explicit TimelineFile(OutputFile& file);
    ~TimelineFile() override;
    TimelineFile(const TimelineFile&) = delete;
    TimelineFile& operator=(const TimelineFile&) = delete;

    void span(const char* name, const char* category, Clock::time_point from, Clock::time_point to, std::int64_t wedge,
              std::uint64_t bytes) noexcept override;
    /// With the resident size of the process beside it; not more often than each 2 ms. Holds until it is told anew.
    void memory(std::size_t held_bytes) noexcept override;
    /// The end of the file; what is told later is left out. IoError if anything could not be written.
    void finish();

private:
    int track();
    void sample();
    void add_counters(Clock::time_point now) noexcept;
    void end_sampling() noexcept;
    void add(const std::string& event);
    void flush() noexcept;
    std::string since_start_us(Clock::time_point at) const;

    OutputFile& file_;
    const Clock::time_point start_ = Clock::now();
    std::mutex mutex_;
    int out_ = -1, statm_ = -1;
    int error_ = 0;
    bool finished_ = false;
    std::string pending_;
    std::map<int, int> tracks_;  ///< of the system's thread numbers
    Clock::time_point last_counters_{};
    std::size_t held_ = 0;
    std::condition_variable ended_;
    std::thread sampler_;
};

}  // namespace wedgescope
