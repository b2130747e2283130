// Options: commands, and what their arguments and the scene file say -> Settings.
// Leaves the keys themselves to keys.hpp and what is done with the values to the commands.
#pragma once
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/keys.hpp"

namespace wedgescope {

struct CommandInfo {
    Command command;
    const char* name;
    const char* usage;
    const char* summary;  ///< one line
    const char* details;  ///< some sentences
    const char* example;
};
const std::vector<CommandInfo>& command_table();
/// InputError with the nearest command.
const CommandInfo& command_by_name(std::string_view name);

/// Command-line arguments behind the command's name -> settings, with the scene file of those that take one (simulate, budget, info --plan) read in.
/// InputError, IoError. `more`: was on the command line too, in words of another program; `defaults`: hold where nothing that is
/// given says otherwise.
Settings parse_arguments(Command command, const std::vector<std::string>& arguments,
                         const std::vector<Given>& more = {}, const std::vector<Given>& defaults = {});
/// Has the path the ending of a scene file, .ini?
bool names_scene(std::string_view path);
/// A scene file alone, as `info` reads it.
Settings parse_scene_file(const std::string& path);

/// What is asked of `scope`: ECHO [setting.ini].
struct ScopeRequest {
    Settings settings;         ///< of what was given alone; files: the echo image, and the scene file if there is one
    std::vector<Given> given;  ///< the command line's, and the scene file's that it does not replace
};
/// InputError, IoError.
ScopeRequest parse_scope_arguments(const std::vector<std::string>& arguments);

/// `key = value` lines, # comments. InputError naming `path` and the line.
std::vector<Given> read_scene(const std::string& path, std::string_view content);
/// The values of both, the command line's winning, and below them those of the radar set that they ask for; then every key's own
/// check.
Settings settings_from(const std::vector<Given>& scene_file, const std::vector<Given>& command_line);

/// What a simulation needs beside what each key checks: a terrain, one place, one altitude, a legend for culture. InputError.
void check_complete(const Settings& settings);
/// Of a run, at once, not when it needs the disk. IoError.
void check_temp_dir(const Settings& settings);

/// The word of `words` nearest to `word` if it is near enough to be meant.
std::optional<std::string> nearest(std::string_view word, const std::vector<std::string>& words);

}  // namespace wedgescope
