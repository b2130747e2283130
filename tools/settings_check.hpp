// Settings check: what a run needs of its settings together.
// Leaves what a key checks by itself to keys.hpp, and what a file or the memory does not allow to the commands.
#pragma once
#include "tools/settings.hpp"

namespace wedgescope {

/// A terrain, one place, one altitude, a legend for culture, and no key without the one that it belongs to. InputError.
void check_complete(const Settings& settings);
/// Of a run, at once, not when it needs the disk. IoError.
void check_temp_dir(const Settings& settings);

}  // namespace wedgescope
