// Help: pages generated from the tables of commands and keys.
#pragma once
#include <cstddef>
#include <string>

#include "tools/command_table.hpp"

namespace wedgescope {

/// The commands.
std::string help_text();
/// A command's options by group, with values, ranges and defaults, units and an example.
std::string help_text(const CommandInfo& command);

/// How wide pages are, in characters.
inline constexpr std::size_t page_width = 100;
/// Words that begin in column `indent` of a line, broken where they would exceed `width`; further lines begin there too.
std::string wrapped(const std::string& words, std::size_t indent, std::size_t width = page_width);

}  // namespace wedgescope
