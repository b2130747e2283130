#include "tools/help.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "tools/commands.hpp"
#include "tools/models.hpp"
#include "tools/near_words.hpp"
#include "tools/options.hpp"
#include "tools/radar_set.hpp"
#include "tools/terminal.hpp"
#include "tools/units.hpp"

namespace wedgescope {
namespace {

std::string set_list() {
    std::string out = "Radar sets that are shipped, for --set NAME or a scene file's line 'set = NAME'\n\n";
    for (const RadarSet& set : shipped_sets()) out += fmt::format("  {:<14}{}\n", set.name, wrapped(set.summary(), 16));
    return out +
           "\n'wedgescope help sets NAME' prints one: its values, and where they are from. A file of such lines is a\n"
           "set of your own: --set FILE. The scene file wins over a set, and the command line over both.\n";
}

const std::string& set_content(const std::string& name) {
    if (const RadarSet* set = shipped_set(name)) return set->content;
    std::vector<std::string> names;
    for (const RadarSet& set : shipped_sets()) names.push_back(set.name);
    throw InputError(
        text("set is ", in_quotes(name), "; it must be one of ", shipped_set_names(), suggestion(name, names)));
}

/// A line of the units of each dimension that some option of a command has.
std::string units_of(const CommandInfo& command) {
    const std::vector<Key>& keys = key_table();
    std::string out;
    for (int i = 0; i <= static_cast<int>(last_dimension); ++i) {
        const auto d = static_cast<Dimension>(i);
        if (std::any_of(keys.begin(), keys.end(), [&](const Key& key) {
                return (key.commands & command.command) && key.value.find(value_word(d)) != std::string::npos;
            }))
            out += fmt::format("  {:<12}{}\n", value_word(d), unit_list(d));
    }
    return out;
}

}  // namespace

std::string wrapped(const std::string& words, std::size_t indent, std::size_t width) {
    std::istringstream in(words);
    std::string word, out;
    std::size_t column = indent;
    while (in >> word) {
        if (column > indent && column + 1 + word.size() > width) {
            out += '\n';
            out.append(indent, ' ');
            column = indent;
        } else if (column > indent) {
            out += ' ';
            ++column;
        }
        out += word;
        column += word.size();
    }
    return out;
}

std::string help_text() {
    std::string out = text("wedgescope ", version(),
                           ": what an airborne ground-mapping radar sees over terrain and culture rasters\n\n");
    out += "Usage: wedgescope COMMAND [options]\n\nCommands\n";
    for (const CommandInfo& info : command_table()) out += fmt::format("  {:<10} {}\n", info.name, info.summary);
    out +=
        "\n'wedgescope help COMMAND' lists a command's options, 'wedgescope help sets' the radar sets; 'wedgescope "
        "--version' names versions.\n\nExample\n  ";
    out += command_table()[0].example;
    const std::string targets =
        "instruction set of the hot loops: auto (the best of this machine), avx512, avx2, sse4, baseline; the same "
        "bits with each";
    const std::string libm =
        "as-is: the program does not begin anew with fused multiply-adds hidden from the C library (GLIBC_TUNABLES), "
        "by which last bits may differ from other processors'; for debuggers and the like";
    return out + "\n\nEnvironment\n  WEDGESCOPE_TARGET  " + wrapped(targets, 21) + "\n  WEDGESCOPE_LIBM    " +
           wrapped(libm, 21) + "\n";
}

std::string help_text(const CommandInfo& command) {
    std::string out = text("Usage: ", command.usage, "\n\n", command.summary, "\n");
    if (*command.details) out += text("\n", wrapped(command.details, 0), "\n");
    std::optional<KeyGroup> group;
    for (const Key& key : key_table()) {
        if (!(key.commands & command.command)) continue;
        if (group != key.group) out += text("\n", title(key.group), "\n");
        group = key.group;
        std::string head = key.letter ? fmt::format("  -{}, --{}", key.letter, key.name) : "  --" + key.name;
        if (!key.value.empty()) head += " " + key.value;
        constexpr std::size_t column = 36;
        const bool fits = head.size() + 2 <= column;
        out += head;
        if (!fits) out += '\n';
        out.append(fits ? column - head.size() : column, ' ');
        std::string help = key.help_of(command.command);
        if (!key.accepted.empty()) help += "; " + key.accepted;
        // What scope is not given is as it was.
        const bool as_in_echo = command.command == command_scope && key.changes_result;
        if (!key.fallback.empty() && !key.value.empty() && !as_in_echo) help += " [" + key.fallback + "]";
        out += wrapped(help, column) + "\n";
    }
    if (command.command == command_scope) {
        std::string refused;
        for (const Key& key : key_table())
            if (!(key.commands & command_scope) && key.changes_result && (key.commands & command_simulate))
                refused += (refused.empty() ? "" : ", ") + key.name;
        out += text("\nNeed a new sweep, so they must be as they were: the data base, display gpi-true, and\n  ",
                    wrapped(refused, 2), "\n");
    }
    if (const std::string units = units_of(command); !units.empty())
        out += "\nUnits: a number with a dimension needs its unit (0 does not)\n" + units;
    if (command.command == command_evaluate) out += "\n" + model_list();
    return out + "\nExample\n  " + command.example + "\n";
}

void help(const std::vector<std::string>& arguments) {
    const Settings settings = parse_arguments(command_help, arguments);
    if (settings.help || settings.files.empty()) return print(help_text());
    if (settings.files[0] == "sets") {
        if (settings.files.size() > 2)
            throw InputError(text("help sets takes one set at most; found ", settings.files.size() - 1));
        return print(settings.files.size() == 1 ? set_list() : set_content(settings.files[1]));
    }
    if (settings.files.size() > 1)
        throw InputError(text("help takes one command at most; found ", settings.files.size()));
    print(help_text(command_by_name(settings.files[0])));
}

}  // namespace wedgescope
