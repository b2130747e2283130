// Help: pages generated from the tables of commands and keys.
#pragma once
#include <string>

#include "tools/options.hpp"

namespace wedgescope {

/// The commands.
std::string help_text();
/// A command's options by group, with values, ranges and defaults, units and an example.
std::string help_text(const CommandInfo& command);

}  // namespace wedgescope
