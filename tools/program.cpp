#include "tools/program.hpp"

#include <fmt/format.h>
#include <tbb/version.h>

#include <csignal>
#include <exception>
#include <new>

#include "lib/target.hpp"
#include "tiles/gdal_session.hpp"
#include "tools/command_table.hpp"
#include "tools/commands.hpp"
#include "tools/terminal.hpp"
#include "tools/text_file.hpp"

namespace wedgescope {
namespace {

std::string versions() {
    std::string names;
    for (const Target target : targets_here()) names += fmt::format("{}{}", names.empty() ? "" : ", ", name_of(target));
    return fmt::format("wedgescope {}\nGDAL {}\noneTBB {}\ninstruction set {} (this machine has {})\n", version(),
                       GdalSession::gdal_version(), TBB_runtime_version(), name_of(target_in_use()), names);
}

void run_command(const std::vector<std::string>& words, Stop& stop) {
    if (words.empty()) throw InputError("no command is given (wedgescope help lists them)");
    const std::string& name = words[0];
    const std::vector<std::string> rest(words.begin() + 1, words.end());
    if (name == "--version" || name == "-V") {
        if (!rest.empty()) throw InputError(text("found ", in_quotes(rest[0]), " after ", name, "; accepted: nothing"));
        return print(versions());
    }
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
        case command_budget:
            return link_budget(rest, stop);
        case command_evaluate:
            return evaluate(rest, stop);
        case command_info:
            return info(rest, stop);
        case command_help:
            return help(rest);
    }
}

int fail(const Stop& stop, int code, const char* message) {
    // Who reads what the program writes has gone away: an end as any other (wedgescope help | head), of which nobody is told.
    if (stop.signal() == SIGPIPE) return 128 + SIGPIPE;
    remark(false, text("wedgescope: ", message));
    return code;
}

}  // namespace

int run_words(const std::vector<std::string>& words, Stop& stop) {
    const StopsTextReads stops(stop);
    try {
        use_target_of_environment();
        run_command(words, stop);
        return 0;
    } catch (const InputError& e) {
        return fail(stop, 2, e.what());
    } catch (const Interrupted& e) {
        return fail(stop, 128 + e.signal(), e.what());
    } catch (const std::bad_alloc&) {
        return fail(stop, 1, "out of memory");
    } catch (const std::exception& e) {
        return fail(stop, 1, e.what());
    }
}

}  // namespace wedgescope
