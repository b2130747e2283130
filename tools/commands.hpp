// Commands: what the words behind `wedgescope` start. Each takes the arguments behind its name and returns when its
// results are out; errors are thrown. Leaves exit codes and signals to program.cpp.
#pragma once
#include <string>
#include <vector>

#include "lib/stop.hpp"

namespace wedgescope {

void simulate(const std::vector<std::string>& arguments, Stop& stop);
void scope(const std::vector<std::string>& arguments, Stop& stop);
void tile(const std::vector<std::string>& arguments, Stop& stop);
void coverage(const std::vector<std::string>& arguments, Stop& stop);
void evaluate(const std::vector<std::string>& arguments, Stop& stop);
void info(const std::vector<std::string>& arguments, Stop& stop);
void link_budget(const std::vector<std::string>& arguments, Stop& stop);
void help(const std::vector<std::string>& arguments);

}  // namespace wedgescope
