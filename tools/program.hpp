// Program: finds the command and turns errors into exit codes and one line on stderr. Leaves signals to main.cpp and the work to
// the commands.
#pragma once
#include <string>
#include <vector>

#include "lib/stop.hpp"

namespace wedgescope {

/// What the words behind the program's name ask for. Returns 0, 2 for options and scene keys, 1 for data and the machine,
/// 128 + signal where `stop` was asked for; never throws.
int run_words(const std::vector<std::string>& words, Stop& stop);

}  // namespace wedgescope
