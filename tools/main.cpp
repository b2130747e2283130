// main: finds the command, and alone turns errors and signals into exit codes: 2 for options and scene keys, 1 for
// data and the machine, 128 + signal after SIGINT, SIGTERM or SIGHUP. Leaves the work to the commands.
#include <fmt/format.h>
#include <malloc.h>
#include <tbb/version.h>

#include <csignal>
#include <cstdio>
#include <exception>
#include <new>

#include "lib/stop.hpp"
#include "lib/target.hpp"
#include "tiles/gdal_session.hpp"
#include "tools/commands.hpp"
#include "tools/options.hpp"
#include "tools/terminal.hpp"
#include "tools/units.hpp"

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

std::string versions() {
    std::string names;
    for (const wedgescope::Target target : wedgescope::targets_here())
        names += fmt::format("{}{}", names.empty() ? "" : ", ", wedgescope::name_of(target));
    return fmt::format("wedgescope {}\nGDAL {}\noneTBB {}\ninstruction set {} (this machine has {})\n",
                       wedgescope::version(), wedgescope::GdalSession::gdal_version(), TBB_runtime_version(),
                       wedgescope::name_of(wedgescope::target_in_use()), names);
}

void run_command(const std::vector<std::string>& words) {
    using namespace wedgescope;
    if (words.empty()) throw InputError("no command is given (wedgescope help lists them)");
    const std::string& name = words[0];
    const std::vector<std::string> rest(words.begin() + 1, words.end());
    if (name == "--version" || name == "-V") return print(versions());
    if (name == "--help" || name == "-h") return help(rest);
    if (name.starts_with('-'))
        throw InputError(
            text("found option ", in_quotes(name), " where a command is needed (wedgescope help lists them)"));
    switch (command_by_name(name).command) {
        case command_simulate:
            return simulate(rest, stop);
        case command_scope:
            return scope(rest, stop);
        case command_tile:
            return tile(rest, stop);
        case command_coverage:
            return coverage(rest, stop);
        case command_evaluate:
            return evaluate(rest, stop);
        case command_info:
            return info(rest, stop);
        case command_help:
            return help(rest);
    }
}

int fail(int code, const char* message) {
    fmt::print(stderr, "wedgescope: {}\n", wedgescope::one_line(message));
    return code;
}

}  // namespace

int main(int count, char** arguments) {
    // Each further malloc arena keeps freed memory of its own; two keep the resident size near what is held.
    mallopt(M_ARENA_MAX, 2);
    catch_signals();
    try {
        wedgescope::use_target_of_environment();
        run_command(std::vector<std::string>(arguments + std::min(count, 1), arguments + count));
        return 0;
    } catch (const wedgescope::InputError& e) {
        return fail(2, e.what());
    } catch (const wedgescope::Interrupted& e) {
        return fail(128 + e.signal(), e.what());
    } catch (const std::bad_alloc&) {
        return fail(1, "out of memory");
    } catch (const std::exception& e) {
        return fail(1, e.what());
    }
}
