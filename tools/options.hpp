// Options: the one table of keys. The command line's options, the scene file's keys, `wedgescope help`, the messages
// and the JSON of all parameters are made from it, so none can say what another does not.
// Leaves units to units.hpp and what is done with the values to the commands.
#pragma once
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/settings.hpp"

namespace wedgescope {

enum Command : unsigned { command_simulate = 1, command_info = 2, command_help = 4 };

struct CommandInfo {
    Command command;
    const char* name;
    const char* usage;
    const char* summary;   ///< one line
    const char* details;   ///< some sentences
    const char* example;
};
const std::vector<CommandInfo>& command_table();
/// InputError with the nearest command.
const CommandInfo& command_by_name(std::string_view name);

enum class KeyGroup { data_base, position, look, radar, antenna, receiver, errors, display, run, output, talk };
const char* title(KeyGroup group);

/// Of the keys of one kind exactly one is needed; one on the command line replaces any of the scene file's.
enum class Exclusive { none, place, altitude };

/// One value as it was given.
struct Given {
    std::string key;
    std::string value;
    std::string origin;  ///< for messages: "--range", or "range (line 4 of 'x.ini')"
    std::string folder;  ///< that a relative path starts from; empty: the current one
};

struct Key {
    std::string name;
    char letter = 0;                    ///< -o; 0: none
    std::string value;                  ///< word in help; empty: a flag
    std::string fallback;               ///< default, as a user would write it; empty: none
    std::string accepted;               ///< range, for help
    std::string help;
    unsigned commands = command_simulate;
    KeyGroup group = KeyGroup::run;
    Exclusive exclusive = Exclusive::none;
    bool repeatable = false;
    bool in_scene_file = true;
    bool changes_result = false;        ///< part of SCENE_JSON: position, look, set, receiver, display
    std::function<void(Settings&, const Given&)> set;                 ///< InputError
    std::function<std::optional<std::string>(const Settings&)> get;   ///< the value as a user would write it; none: not given
};
const std::vector<Key>& key_table();
const Key* find_key(std::string_view name);

/// Command-line arguments behind the command's name -> settings, with the scene file for `simulate` read in.
/// InputError, IoError.
Settings parse_arguments(Command command, const std::vector<std::string>& arguments);
/// A scene file alone, as `info` reads it.
Settings parse_scene_file(const std::string& path);

/// `key = value` lines, # comments. InputError naming `path` and the line.
std::vector<Given> read_scene(const std::string& path, std::string_view content);
/// The values of both, the command line's winning; then every key's own check.
Settings settings_from(const std::vector<Given>& scene_file, const std::vector<Given>& command_line);

/// What a simulation needs beside what each key checks: a terrain, one place, one altitude, a legend for culture.
void check_complete(const Settings& settings);

/// One page of help.
std::string help_text();
std::string help_text(const CommandInfo& command);

/// The word of `words` nearest to `word` if it is near enough to be meant.
std::optional<std::string> nearest(std::string_view word, const std::vector<std::string>& words);

/// All parameters after defaults, key -> text as a scene file takes it; null where nothing was given.
/// `everything` off: only what changes the picture (SCENE_JSON), so that no split, path or budget shows in an output.
nlohmann::ordered_json parameters_json(const Settings& settings, bool everything);
/// And back.
Settings settings_from_json(const nlohmann::ordered_json& parameters);

/// `settings` with the numbers that the data base gave for what was left open.
Settings with_resolved(const Settings& settings, const ResolvedScene& resolved);
/// The numbers behind a resolved scene, in SI units with the unit in the name.
nlohmann::ordered_json resolved_json(const ResolvedScene& resolved);
/// SCENE_JSON of the output rasters: the parameters with every fixed default but `auto` left as it was (so that what
/// follows from another changes with it), and the numbers that `auto` became.
std::string scene_json(const Settings& settings, const ResolvedScene& resolved);

}  // namespace wedgescope
