// Which commands take a key that simulate has: coverage, budget and scope, which is a matter of many keys at once, and why
// scope cannot change the others.
// Leaves what a key alone says of its commands to the table in keys.cpp.
#pragma once
#include <vector>

#include "tools/keys.hpp"

namespace wedgescope {

void add_commands(std::vector<Key>& keys);

}  // namespace wedgescope
