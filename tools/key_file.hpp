// Key files: scene files and radar sets, lines `key = value`, # comments.
// Leaves what a value means to keys.hpp, and which of several sources wins to options.hpp.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "tools/keys.hpp"

namespace wedgescope {

/// The lines of a scene file. InputError naming `path` and the line.
std::vector<Given> read_scene(const std::string& path, std::string_view content);
/// The same, read from there. `hint`: what else than a scene file may have been meant. IoError too.
std::vector<Given> read_scene_file(const std::string& path, const char* hint = " (a raster is given with --dem)");

/// With the values of the radar set that is asked for, where a key is given nowhere else. InputError, IoError.
std::vector<Given> with_set(const std::vector<Given>& given);

}  // namespace wedgescope
