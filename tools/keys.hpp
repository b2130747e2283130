// Keys: the one table of them. The command line's options, the scene file's keys, `wedgescope help`, the messages and
// the JSON of all parameters are made from it, so none can say what another does not.
// Leaves units to units.hpp, how a value is read and written to codec.hpp and key_values.hpp, which other commands take a key
// to key_commands.hpp, and reading a command line or a file to command_line.hpp and key_file.hpp.
#pragma once
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tools/settings.hpp"

namespace wedgescope {

enum Command : unsigned {
    command_simulate = 1,
    command_info = 2,
    command_help = 4,
    command_tile = 8,
    command_coverage = 16,
    command_scope = 32,
    command_evaluate = 64,
    command_budget = 128
};

enum class KeyGroup {
    data_base,
    position,
    look,
    coverage,
    radar,
    antenna,
    ground,
    weather,
    receiver,
    errors,
    display,
    run,
    output,
    talk
};
const char* title(KeyGroup group);

/// Of the keys of one kind exactly one is needed; one on the command line replaces any of the scene file's. A track stands in
/// the place of both a place and an altitude; of the accuracy at most one.
enum class Exclusive { none, place, altitude, track, accuracy };

/// One value as it was given.
struct Given {
    std::string key;
    std::string value;
    std::string origin;  ///< for messages: "--range", or "range (line 4 of 'x.ini')"
    std::string folder;  ///< that a relative path starts from; empty: the current one
    std::string unit{};  ///< that a bare number has; empty: it needs its own
};

struct Key {
    std::string name;
    char letter = 0;       ///< -o; 0: none
    std::string value;     ///< word in help; empty: a flag
    std::string fallback;  ///< default, as a user would write it; empty: none
    std::string accepted;  ///< range, for help
    std::string help;
    std::vector<std::pair<unsigned, std::string>> help_elsewhere;  ///< commands, and what theirs say instead
    unsigned commands = command_simulate;
    KeyGroup group = KeyGroup::run;
    Exclusive exclusive = Exclusive::none;
    bool repeatable = false;
    bool in_scene_file = true;
    bool changes_result = false;                       ///< part of SCENE_JSON: position, look, set, receiver, display
    bool after_echo = false;                           ///< changes_result, but never the echo: receiver, tube, noise
    bool of_track = false;                             ///< means nothing without a track
    bool of_response = false;                          ///< of coverage only the layer response takes it
    std::string needs_sweep;                           ///< of what changes the echo: why scope cannot change it
    std::function<void(Settings&, const Given&)> set;  ///< InputError
    std::function<std::optional<std::string>(const Settings&)>
        get;  ///< the value as a user would write it; none: not given

    const std::string& help_of(Command command) const {
        for (const auto& [others, words] : help_elsewhere)
            if (others & command) return words;
        return help;
    }
};
const std::vector<Key>& key_table();
const Key* find_key(std::string_view name);

}  // namespace wedgescope
