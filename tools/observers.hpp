// Observers: coverage of many sensors at once: how many of them see each post, or what at least so many see.
// Leaves the file of observers to observer_file.hpp, a mask to lib/coverage.hpp and the counts to tiles/count_store.hpp.
//
// Lanes: each takes the next observer, makes its mask tile by tile and adds them to the counts of all; there are as many as
// threads where the memory grants each what the largest of the coverages takes, fewer with more threads each otherwise.
// Memory: what the lanes hold, the source's cache (a data base that takes at most a quarter of the memory stays in it), 200
// bytes an observer, and counts: all of them where that takes at most half of the memory, else a quarter, and the rest in a
// scratch file.
#pragma once
#include "lib/stop.hpp"
#include "tools/settings.hpp"

namespace wedgescope {

/// `start_s`: when the program began. InputError, DataError, IoError, Interrupted.
void coverage_of_observers(const Settings& settings, double start_s, Stop& stop);

}  // namespace wedgescope
