// Command line: the options and files among a command's arguments, split by Boost and refused in words of our own.
// Leaves what a value means to keys.hpp, and scene files and what excludes what to options.hpp.
#pragma once
#include <string>
#include <vector>

#include "tools/keys.hpp"

namespace wedgescope {

/// Commands whose keys a command takes: `info --plan` takes simulate's too.
/// `scope` too, to say why it cannot do what they ask for.
unsigned keys_taken(Command command, const std::vector<std::string>& arguments);

struct CommandLine {
    std::vector<Given> given;
    std::vector<std::string> files;
};
/// `more`: was on it too, in words of another program. InputError.
CommandLine read_command_line(Command command, const std::vector<std::string>& arguments,
                              const std::vector<Given>& more = {});

/// InputError where a file is none, and looks like what was to be a part of a value before it.
void refuse_quantities(const std::vector<std::string>& files);

}  // namespace wedgescope
