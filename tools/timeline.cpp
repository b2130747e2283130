#include "tools/timeline.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <system_error>

#include "lib/error.hpp"
#include "tools/settings.hpp"

namespace wedgescope {
namespace {

constexpr std::size_t piece_bytes = 64 << 10;

/// Of this process, from an open /proc/self/statm; 0 where there is none.
std::size_t resident_bytes(int statm) {
    char text[128];
    const ssize_t n = statm < 0 ? -1 : ::pread(statm, text, sizeof text, 0);
    if (n <= 0) return 0;
    const char* at = static_cast<const char*>(std::memchr(text, ' ', static_cast<std::size_t>(n)));
    std::size_t pages = 0;
    if (at) std::from_chars(at + 1, text + n, pages);
    return pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

}  // namespace

TimelineFile::TimelineFile(OutputFile& file) : file_(file) {
    out_ = ::open(file_.temporary_path().c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (out_ < 0)
        throw IoError(text("timeline ", in_quotes(file_.final_path()), " cannot be written: ", system_reason(errno)));
    statm_ = ::open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    pending_ = fmt::format(
        "{{\"displayTimeUnit\":\"ms\",\"otherData\":{{\"program\":\"wedgescope {}\"}},\"traceEvents\":[\n"
        "{{\"name\":\"process_name\",\"ph\":\"M\",\"pid\":{},\"tid\":0,\"args\":{{\"name\":\"wedgescope\"}}}}",
        version(), ::getpid());
    add_counters(Clock::now());
    try {
        sampler_ = std::thread([this] { sample(); });
    } catch (const std::system_error&) {
        // Without a thread to spare the counters are those that are told.
    }
}

/// So that a stage that tells nothing has its counters too.
void TimelineFile::sample() {
    constexpr std::chrono::milliseconds silence(25);
    std::unique_lock lock(mutex_);
    while (!finished_) {
        const auto now = Clock::now();
        if (now - last_counters_ >= silence) add_counters(now);
        ended_.wait_for(lock, silence);
    }
}

void TimelineFile::end_sampling() noexcept {
    {
        const std::lock_guard lock(mutex_);
        finished_ = true;
    }
    ended_.notify_all();
    if (sampler_.joinable()) sampler_.join();
}

TimelineFile::~TimelineFile() {
    end_sampling();
    if (out_ >= 0) ::close(out_);
    if (statm_ >= 0) ::close(statm_);
}

std::string TimelineFile::since_start_us(Clock::time_point at) const {
    const auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(at - start_).count();
    return fmt::format("{}.{:03}", ns / 1000, ns % 1000);
}

/// Number of the calling thread's track; names it the first time.
int TimelineFile::track() {
    const auto thread = static_cast<int>(::gettid());
    const auto [at, fresh] = tracks_.emplace(thread, static_cast<int>(tracks_.size()));
    if (fresh) {
        const std::string name = thread == ::getpid() ? "main" : fmt::format("worker {}", at->second);
        add(fmt::format("{{\"name\":\"thread_name\",\"ph\":\"M\",\"pid\":{},\"tid\":{},\"args\":{{\"name\":\"{}\"}}}}",
                        ::getpid(), thread, name));
    }
    return thread;
}

void TimelineFile::add(const std::string& event) {
    pending_ += ",\n";
    pending_ += event;
    if (pending_.size() >= piece_bytes) flush();
}

void TimelineFile::flush() noexcept {
    if (error_ == 0) error_ = write_all(out_, pending_.data(), pending_.size()).error;
    pending_.clear();
}

void TimelineFile::span(const char* name, const char* category, Clock::time_point from, Clock::time_point to,
                        std::int64_t wedge, std::uint64_t bytes) noexcept {
    const std::lock_guard lock(mutex_);
    if (finished_) return;
    try {
        std::string args;
        if (wedge >= 0) args = fmt::format("\"wedge\":{}", wedge);
        if (bytes > 0) args += fmt::format("{}\"bytes\":{}", args.empty() ? "" : ",", bytes);
        const int thread = track();
        add(fmt::format(
            "{{\"name\":\"{}\",\"cat\":\"{}\",\"ph\":\"X\",\"ts\":{},\"dur\":{},\"pid\":{},\"tid\":{},"
            "\"args\":{{{}}}}}",
            name, category, since_start_us(from), since_start_us(start_ + (to - from)), ::getpid(), thread, args));
    } catch (const std::bad_alloc&) {
        error_ = ENOMEM;
    }
}

void TimelineFile::memory(std::size_t held_bytes) noexcept {
    const std::lock_guard lock(mutex_);
    held_ = held_bytes;
    const auto now = Clock::now();
    if (!finished_ && now - last_counters_ >= std::chrono::milliseconds(2)) add_counters(now);
}

void TimelineFile::add_counters(Clock::time_point now) noexcept {
    last_counters_ = now;
    try {
        add(
            fmt::format("{{\"name\":\"memory\",\"ph\":\"C\",\"ts\":{},\"pid\":{},\"tid\":0,"
                        "\"args\":{{\"budget held\":{}}}}}",
                        since_start_us(now), ::getpid(), held_));
        add(
            fmt::format("{{\"name\":\"resident\",\"ph\":\"C\",\"ts\":{},\"pid\":{},\"tid\":0,"
                        "\"args\":{{\"bytes\":{}}}}}",
                        since_start_us(now), ::getpid(), resident_bytes(statm_)));
    } catch (const std::bad_alloc&) {
        error_ = ENOMEM;
    }
}

void TimelineFile::finish() {
    end_sampling();
    const std::lock_guard lock(mutex_);
    add_counters(Clock::now());
    pending_ += "\n]}\n";
    flush();
    if (::close(std::exchange(out_, -1)) != 0 && error_ == 0) error_ = errno;
    if (error_)
        throw IoError(text("timeline ", in_quotes(file_.final_path()), " cannot be written: ", system_reason(error_)));
}

}  // namespace wedgescope
