// Options: what a command's arguments, the scene file, the radar set and the tile store say -> Settings.
// Leaves reading each to command_line.hpp and key_file.hpp, and what settings need together to settings_check.hpp.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "tools/keys.hpp"

namespace wedgescope {

/// Command-line arguments behind the command's name -> settings, with the scene file of those that take one (simulate,
/// budget, info --plan) read in. InputError, IoError. `more`: was on the command line too, in words of another program;
/// `defaults`: hold where nothing that is given says otherwise.
Settings parse_arguments(Command command, const std::vector<std::string>& arguments,
                         const std::vector<Given>& more = {}, const std::vector<Given>& defaults = {});
/// Has the path the ending of a scene file, .ini?
bool names_scene(std::string_view path);
/// A scene file as `info` reads it, under what the command line says of it.
Settings parse_scene_file(const std::string& path, const std::vector<Given>& command_line = {});

/// What is asked of `scope`: ECHO [setting.ini].
struct ScopeRequest {
    Settings settings;         ///< of what was given alone; files: the echo image, and the scene file if there is one
    std::vector<Given> given;  ///< the command line's, and the scene file's that it does not replace
};
/// InputError, IoError.
ScopeRequest parse_scope_arguments(const std::vector<std::string>& arguments);

/// The values of both, the command line's winning, and below them those of the radar set that they ask for; then every
/// key's own check.
Settings settings_from(const std::vector<Given>& scene_file, const std::vector<Given>& command_line);

}  // namespace wedgescope
