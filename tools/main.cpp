// main: signals and memory; the rest is program.cpp's.
#include <malloc.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <cstddef>
#include <cstdint>

#include "tools/libm_variant.hpp"
#include "tools/program.hpp"

namespace {

wedgescope::Stop stop;

constexpr std::int64_t one_wish_ns = 500'000'000;
std::array<std::atomic<std::int64_t>, NSIG> first_ns{};  // when one of this number came first; 0: none has
static_assert(std::atomic<std::int64_t>::is_always_lock_free);

extern "C" void request_stop(int signal) {
    timespec now{};
    ::clock_gettime(CLOCK_MONOTONIC, &now);
    const std::int64_t now_ns = std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
    std::int64_t first = 0;
    if (!first_ns[static_cast<std::size_t>(signal)].compare_exchange_strong(first, now_ns) &&
        now_ns - first > one_wish_ns) {
        ::signal(signal, SIG_DFL);
        ::raise(signal);  // once this handler is left
    }
    stop.request(signal);
}

/// A reader that has gone away may be met by every write from then on, and a limit of CPU time is told of every second: that
/// ends the program no sooner.
extern "C" void note_again_and_again(int signal) { stop.request(signal); }

/// The first signal asks every stage to stop and clean up; a second one of its kind ends the program at once, unless it comes
/// with the first: timeout sends one to the program and one to its group, a terminal and a batch system may both.
void catch_signals() {
    ::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is then an error of its write, with a name
    // Also those that others send or that a limit of time brings: nothing is left behind by them either.
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGXCPU, SIGALRM, SIGUSR1, SIGUSR2}) {
        struct sigaction before {};
        ::sigaction(signal, nullptr, &before);
        if (before.sa_handler == SIG_IGN) continue;  // started with nohup or in the background
        struct sigaction action {};
        action.sa_handler = signal == SIGPIPE || signal == SIGXCPU ? note_again_and_again : request_stop;
        action.sa_flags = SA_RESTART;
        ::sigaction(signal, &action, nullptr);
    }
}

}  // namespace

int main(int count, char** arguments) {
    wedgescope::hide_fma_from_libm(arguments);
    // Each further malloc arena keeps freed memory of its own; two keep the resident size near what is held.
    mallopt(M_ARENA_MAX, 2);
    catch_signals();
    return wedgescope::run_words({arguments + std::min(count, 1), arguments + count}, stop);
}
