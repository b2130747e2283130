// Claim: a lock (flock) on a temporary file or folder for as long as its owner lives, so that what a killed process left
// behind is told from what a living one writes, whatever process numbers come round again.
// Leaves names to whoever makes them. On file systems without locks nothing is ever taken for left behind.
#pragma once
#include <functional>
#include <string>

#include "tiles/descriptor.hpp"

namespace wedgescope {

/// Claims an open file or folder until it is closed. Waits for one who looks whether its owner is dead; where that one may
/// have taken it for left behind, see that it still stands and else make another.
void claim(int file);
bool stands_at(int file, const std::string& path);

/// Removes a file or a folder that nobody claims. What cannot be removed stays, without an error.
void remove_unclaimed(const std::string& path);
/// Removes what nobody claims of the files and folders in `folder` whose names `temporary` accepts.
void remove_left_behind(const std::string& folder, const std::function<bool(const std::string& name)>& temporary);

/// True if `name` is `stem` followed by groups of digits with a hyphen between two: `.scope.png.tmp-` and `4711-1`.
bool is_numbered(const std::string& name, const std::string& stem);

}  // namespace wedgescope
