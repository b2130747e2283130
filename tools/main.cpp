// main: signals and memory; the rest is program.cpp's.
#include <malloc.h>

#include <algorithm>
#include <csignal>

#include "tools/program.hpp"

namespace {

wedgescope::Stop stop;

extern "C" void request_stop(int signal) { stop.request(signal); }

/// The first signal asks every stage to stop and clean up; a second one of its kind ends the program at once.
void catch_signals() {
    ::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is then an error of its write, with a name
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        struct sigaction before {};
        ::sigaction(signal, nullptr, &before);
        if (before.sa_handler == SIG_IGN) continue;  // started with nohup or in the background
        struct sigaction action {};
        action.sa_handler = request_stop;
        action.sa_flags = SA_RESTART | static_cast<int>(SA_RESETHAND);
        ::sigaction(signal, &action, nullptr);
    }
}

}  // namespace

int main(int count, char** arguments) {
    // Each further malloc arena keeps freed memory of its own; two keep the resident size near what is held.
    mallopt(M_ARENA_MAX, 2);
    catch_signals();
    return wedgescope::run_words({arguments + std::min(count, 1), arguments + count}, stop);
}
