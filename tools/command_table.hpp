// Command table: the commands in words, for help and messages.
// Leaves their options to keys.hpp and what they do to commands.hpp.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "tools/keys.hpp"

namespace wedgescope {

struct CommandInfo {
    Command command;
    const char* name;
    const char* usage;
    const char* summary;  ///< one line
    const char* details;  ///< some sentences
    const char* example;
};
const std::vector<CommandInfo>& command_table();
const CommandInfo& info_of(Command command);
/// InputError with the nearest command.
const CommandInfo& command_by_name(std::string_view name);

/// "; it is tile's and info's" of a key that other commands have; nothing of another word.
std::string whose(std::string_view word);

}  // namespace wedgescope
