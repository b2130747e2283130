#include "tools/options.hpp"

#include <unistd.h>

#include <algorithm>
#include <boost/program_options.hpp>
#include <cerrno>
#include <filesystem>
#include <map>
#include <system_error>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "tiles/tile_store.hpp"
#include "tools/radar_set.hpp"
#include "tools/text_file.hpp"
#include "tools/units.hpp"

namespace po = boost::program_options;

namespace wedgescope {
namespace {

// -------------------------------------------------------------------------------------------------- near words

std::size_t edits(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t corner = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t replaced = corner + (a[i - 1] != b[j - 1]);
            corner = row[j];
            row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
        }
    }
    return row[b.size()];
}

std::vector<std::string> key_names(unsigned commands, bool scene_file) {
    std::vector<std::string> names;
    for (const Key& key : key_table()) {
        if ((key.commands & commands) && (!scene_file || key.in_scene_file)) names.push_back(key.name);
    }
    return names;
}

/// Of a key that only other commands have: whose it is.
std::string whose(std::string_view word) {
    const Key* key = find_key(word);
    if (!key) return "";
    std::string owners;
    for (const CommandInfo& info : command_table())
        if (key->commands & info.command) owners += text(owners.empty() ? "; it is " : " and ", info.name, "'s");
    return owners;
}

std::string suggestion(std::string_view word, const std::vector<std::string>& known, const char* prefix) {
    const auto near = nearest(word, known);
    return near ? text("; did you mean ", prefix, *near, "?") : std::string();
}

// ------------------------------------------------------------------------------------------------ command line

po::options_description descriptions(unsigned commands) {
    po::options_description all;
    for (const Key& key : key_table()) {
        if (!(key.commands & commands)) continue;
        const std::string name = key.letter ? key.name + "," + key.letter : key.name;
        auto* value = po::value<std::string>();
        if (key.value.empty()) value->zero_tokens();
        all.add_options()(name.c_str(), value, key.help.c_str());
    }
    return all;
}

constexpr const char* one_word = "two numbers are one word, as in --latlon 40.5,-117.8 or --sector -45deg,45deg";

const CommandInfo& info_of(Command command) {
    for (const CommandInfo& info : command_table()) {
        if (info.command == command) return info;
    }
    throw Error("no such command");
}

/// Does it look like a number, with a unit or without: what was to be a part of a value before it?
bool is_quantity(const std::string& word) {
    const std::size_t digits = word.find_first_not_of("+-.");
    if (digits > 2 || digits == std::string::npos || word[digits] < '0' || word[digits] > '9') return false;
    const std::size_t unit = std::min(word.find_first_not_of("0123456789.eE+-", digits), word.size());
    if (word[unit - 1] == '.') return false;  // an ending
    return std::all_of(word.begin() + static_cast<std::ptrdiff_t>(unit), word.end(),
                       [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); });
}

/// Is that flag there, and not off? What a command line takes may depend on it, so before it is read.
bool has_flag(const std::vector<std::string>& arguments, const std::string& flag) {
    bool on = false;
    for (const std::string& word : arguments) {
        if (word == "--") break;  // files from here on
        if (word == flag) on = true;
        if (word.starts_with(flag + "=")) on = !same_letters(word.substr(flag.size() + 1), "off");
    }
    return on;
}

/// Commands whose keys a command takes: `info --plan` takes simulate's too.
/// `scope` too, to say why it cannot do what they ask for.
unsigned keys_taken(Command command, const std::vector<std::string>& arguments) {
    if (command == command_scope) return command_scope | command_simulate;
    const bool plan = command == command_info && has_flag(arguments, "--plan");
    return plan ? command_info | command_simulate : static_cast<unsigned>(command);
}

/// What a message calls it beside another: its key, or what another program calls that.
std::string name_beside(const Given& given) {
    const bool foreign = given.origin.starts_with('-') && !given.origin.starts_with("--");
    return foreign ? given.origin : given.key;
}

/// The flag that is written so, --quiet or -q.
const Key* flag_named(std::string_view option, unsigned commands) {
    for (const Key& key : key_table()) {
        if (!key.value.empty() || !(key.commands & commands)) continue;
        if (option == "--" + key.name || (key.letter && option == std::string{'-', key.letter})) return &key;
    }
    return nullptr;
}

/// What Boost could not understand, as the user wrote it.
std::string original_word(po::error_with_option_name error) {
    error.m_error_template = "%original_token%";
    return error.what();
}

/// Options and positional arguments of a command line. `given`: what else was on it.
std::vector<Given> read_command_line(Command command, const std::vector<std::string>& arguments,
                                     std::vector<std::string>& files, std::vector<Given> given = {}) {
    const unsigned taken = keys_taken(command, arguments);
    const CommandInfo& info = info_of(command);
    // An unknown option is refused here, in words of our own, so that a value that looks like one (-3dB) stays a value.
    const auto refuse_unknown = [&](std::string_view option) {
        std::string_view word = option;
        while (word.starts_with('-')) word.remove_prefix(1);
        word = word.substr(0, word.find('='));
        const std::string_view written = option.substr(0, option.find('='));
        if (const Key* key = find_key(word); key && (key->commands & taken) && !option.starts_with("--"))
            throw InputError(text("option ", in_quotes(written), " has one dash; did you mean --", word, "?"));
        const std::string_view digits = word.substr(word.starts_with('.') ? 1 : 0);
        if (!digits.empty() && digits.front() >= '0' && digits.front() <= '9')
            throw InputError(text(in_quotes(option), " is no option; ", one_word));
        const std::string owners = whose(word);
        const bool short_output = !option.starts_with("--") && word.starts_with('o') &&
                                  (word.size() == 1 || word.find('.') != std::string_view::npos),
                   a_file = (taken & (command_coverage | command_tile | command_info)) &&
                            (word == "dem" || word == "output" || short_output);
        throw InputError(text("unknown option ", in_quotes(written),
                              a_file           ? text("; files are named without an option: ", info.usage)
                              : owners.empty() ? suggestion(word, key_names(taken, false), "--")
                                               : owners,
                              " (wedgescope help ", info.name, " lists them all)"));
    };
    using namespace po::command_line_style;
    const po::options_description known = descriptions(taken);
    // A flag takes no value but behind '='; Boost knows flags only without, or with the next word too.
    std::vector<std::string> words;
    for (std::size_t i = 0; i < arguments.size(); ++i) {
        const std::string& word = arguments[i];
        if (word == "--") {
            words.insert(words.end(), arguments.begin() + static_cast<std::ptrdiff_t>(i), arguments.end());
            break;
        }
        if (word.starts_with("--=")) refuse_unknown(word);  // a file to Boost
        const auto equals = word.find('=');
        const Key* flag = equals == std::string::npos ? nullptr : flag_named(word.substr(0, equals), taken);
        if (flag) {
            given.push_back({flag->name, word.substr(equals + 1), "--" + flag->name, ""});
        } else {
            words.push_back(word);
        }
    }
    try {
        const auto parsed = po::command_line_parser(words)
                                .options(known)
                                .style(allow_long | long_allow_adjacent | long_allow_next | allow_short |
                                       short_allow_adjacent | short_allow_next | allow_dash_for_short)
                                .run();
        for (const auto& option : parsed.options) {
            if (option.string_key.empty()) {
                files.insert(files.end(), option.value.begin(), option.value.end());
                continue;
            }
            const std::string name = option.string_key;
            const Key* key = find_key(name);
            if (!key) refuse_unknown(name);
            for (const std::string& token : option.original_tokens) {
                // The parser takes `-overwrite` for `-o verwrite`; nobody means that.
                if (key->letter && token.size() > 2 && token[0] == '-' && token[1] == key->letter &&
                    find_key(token.substr(1))) {
                    throw InputError(text("option ", in_quotes(token), " has one dash; did you mean -", token, "?"));
                }
            }
            const std::string value = option.value.empty() ? "on" : option.value[0];
            if (value.starts_with("--") && find_key(value.substr(2)))
                throw InputError(text("option --", name, " needs a value"));
            given.push_back({name, value, "--" + name, ""});
        }
    } catch (const po::unknown_option& e) {
        refuse_unknown(e.get_option_name());
    } catch (const po::invalid_command_line_syntax& e) {
        const std::string name = e.get_option_name();
        if (e.kind() == po::invalid_syntax::missing_parameter)
            throw InputError(text("option ", name, " needs a value"));
        if (e.kind() == po::invalid_syntax::empty_adjacent_parameter)
            throw InputError(text("option ", name, " needs a value after '='"));
        // A flag's letter, and more behind it.
        const std::string written = original_word(e);
        if (find_key(written.substr(1))) refuse_unknown(written);
        const std::string letter = written.substr(0, 2);
        throw InputError(text("option ", in_quotes(written), " cannot be understood; accepted: ", letter, ", ", letter,
                              "=on or ", letter, "=off, and each option a word of its own"));
    } catch (const po::error& e) {
        throw InputError(e.what());
    }
    for (std::size_t i = 0; i < given.size(); ++i) {
        for (std::size_t j = i + 1; j < given.size(); ++j) {
            if (given[i].key != given[j].key || find_key(given[i].key)->repeatable) continue;
            if (given[i].origin == given[j].origin)
                throw InputError(text("option ", given[i].origin, " is given twice"));
            throw InputError(text(given[j].origin, " is given beside ", given[i].origin, "; both say ", given[i].key,
                                  ", and one of them alone may be given"));
        }
    }
    return given;
}

/// `kind`: of file, for messages, and what else may have been meant.
std::string file_content(const std::string& path, const char* kind = "scene file", const char* hint = "") {
    return text_of_file(text(kind, " ", in_quotes(path)), path, text("a ", kind, " holds lines key = value", hint));
}
std::string scene_file_content(const std::string& path) {
    return file_content(path, "scene file", " (a raster is given with --dem)");
}

}  // namespace

const std::vector<CommandInfo>& command_table() {
    static const std::vector<CommandInfo> table = {
        {command_simulate, "simulate", "wedgescope simulate [options] [scene.ini]",
         "data base + scene -> scope picture, echo, power and state layers, response of the ground, report",
         "Every option below is also a key of the scene file (lines 'key = value'; # behind a blank begins a comment, "
         "but not within double quotes round the value). The command line wins; relative paths in the file start from "
         "its folder. Outputs appear under their names only when they are whole.",
         "wedgescope simulate --dem terrain.tif --latlon 33.9,-117.3 --altitude-msl 7000ft --range 30nmi -o scope.png"},
        {command_scope, "scope", "wedgescope scope [options] ECHO [setting.ini]",
         "stored echo image -> scope picture with another receiver, display, noise",
         "ECHO is what simulate --echo has written. Whatever is not given is as it was then; the picture is, byte for "
         "byte, the one that simulate makes with the same setting, and nothing of the data base is read. Settings that "
         "need a new sweep are refused with the reason, unless they are as they were. Beam, pulse, sector and heading "
         "may change as long as the echo image holds what they gather and its bins stay (azimuth-bins and range-bin, "
         "where they are auto, follow beam and pulse: give them).",
         "wedgescope scope --if-gain 40dB --display ppi echo.tif -o scope.png"},
        {command_coverage, "coverage", "wedgescope coverage [options] IN OUT",
         "terrain raster -> which of its posts are seen, how high, far and steep they lie, or what a radar gets of "
         "them",
         "OUT has IN's grid; the mask holds 255 where the ground is seen, 0 where it is not, 1 where there is no data "
         "or out of range. gdal_viewshed's options -ox -oy -oz -tz -md -cc -ov -vv -iv -a_nodata -b -f (or -of) -co "
         "-om -q are understood too, lengths in metres (-b 1 and -om NORMAL only: --layer height gives what -om GROUND "
         "does); with -ox and -oy the ground is a plane, the sensor stands over the nearest post, and defaults are "
         "gdal_viewshed's. With --observers many sensors are looked from in one run. Radar, antenna, ground and "
         "weather count for --layer response alone, as do culture, culture-legend, class-table and material.",
         "wedgescope coverage --latlon 33.9,-117.3 --altitude-agl 500m terrain.tif seen.tif"},
        {command_budget, "budget", "wedgescope budget [options] [scene.ini] --at AZIMUTH,RANGE | --at-latlon LAT,LON",
         "link budget of one cell, line by line from the transmitter to the grey level",
         "Takes every option of simulate that decides on the picture. Each line is a number with its unit; those from "
         "the transmitter to the clouds add up to the echo, which is the cell's in simulate's images. What depends on "
         "the ground (pattern, gases, rain, cloud) is the mean over all that the cell gathers through pulse and beam, "
         "weighted with what it returns. Where a scene file says where the sensor is, --latlon on the command line "
         "without --at names the place on the ground.",
         "wedgescope budget scene.ini --at 40deg,12nmi"},
        {command_evaluate, "evaluate", "wedgescope evaluate MODEL [NAME=VALUE...] [options] | evaluate --list [MODEL]",
         "any model of the library as a calculator, over a CSV table or for single values",
         "MODEL takes its inputs from the columns of the table (--in), named with their units in brackets, such as 'r "
         "[km]', and from NAME=VALUE, which hold for all rows; what has a default may be left out. Each row of the "
         "table is written as it stands, with the model's outputs behind it. Without a table the outputs are printed, "
         "one a line, or with -o as a table of one row. --list names the models; --list MODEL gives its inputs, "
         "ranges, outputs and source.",
         "wedgescope evaluate sight hs=3000m h=250m s=20km"},
        {command_info, "info", "wedgescope info [options] FILE... | info --plan [simulate's options] [scene.ini]",
         "what rasters and tile stores hold, or what a scene file (*.ini) resolves to",
         "For a raster: grid, CRS, heights, voids; with --culture-legend also its codes, how often each occurs, and "
         "their materials. For a tile store: its layers, and with --verify whether all of it is as it was written. For "
         "a scene file: where the sensor is, what is swept, sizes and memory. With --plan, which takes every option of "
         "simulate, but for a track: what a run would do at one place, without running.",
         "wedgescope info --culture-legend fbfm40 culture.tif"},
        {command_tile, "tile", "wedgescope tile [options] RASTER... FOLDER",
         "terrain rasters, culture -> a tile store that --dem takes",
         "One or many terrain rasters (cells of a mosaic may differ in posting) become one data base: tiled, with "
         "block map, overviews and checksums, which any GDAL program opens too (FOLDER/dem.vrt). Of a post that "
         "several rasters hold, the first in the order given that has a value there wins.",
         "wedgescope tile n33_w118.dt2 n33_w117.dt2 --culture fuel.tif --culture-legend fbfm40 inland"},
        {command_help, "help", "wedgescope help [COMMAND | sets [NAME]]",
         "this page, a command's options, or the shipped radar sets", "", "wedgescope help simulate"},
    };
    return table;
}

const CommandInfo& command_by_name(std::string_view name) {
    std::vector<std::string> names;
    for (const CommandInfo& info : command_table()) {
        if (name == info.name) return info;
        names.emplace_back(info.name);
    }
    std::string all;
    for (const auto& n : names) all += (all.empty() ? "" : ", ") + n;
    throw InputError(text("unknown command ", in_quotes(name), suggestion(name, names, ""), " (there are ", all, ")"));
}

std::optional<std::string> nearest(std::string_view word, const std::vector<std::string>& words) {
    if (word.empty() || word.size() > 64) return std::nullopt;
    const std::string* best = nullptr;
    std::size_t best_cost = std::max<std::size_t>(1, word.size() / 3) + 1;
    for (const std::string& candidate : words) {
        const std::size_t cost = edits(word, candidate);
        if (cost < best_cost) {
            best = &candidate;
            best_cost = cost;
        }
    }
    // A beginning that only one word has counts as near too.
    if (!best && word.size() >= 3) {
        for (const std::string& candidate : words) {
            if (!candidate.starts_with(word)) continue;
            best = &candidate;
            break;
        }
    }
    return best ? std::optional(*best) : std::nullopt;
}

namespace {

/// A comment begins at the start or behind a blank: a path may hold a #. Trimmed.
std::string_view without_comment(std::string_view line) {
    for (std::size_t i = 0; i < line.size(); ++i)
        if (line[i] == '#' && (i == 0 || line[i - 1] == ' ' || line[i - 1] == '\t')) return trimmed(line.substr(0, i));
    return trimmed(line);
}

/// `key = value` lines. `subject`: for messages; `folder`: that relative paths start from; `refuse` throws for the name of a key
/// that does not belong there, beginning with the place it is handed.
template <class Refuse>
std::vector<Given> read_keys(const std::string& subject, const std::string& folder, std::string_view content,
                             Refuse&& refuse) {
    if (content.starts_with("\xef\xbb\xbf")) content.remove_prefix(3);
    std::vector<Given> given;
    std::map<std::string, int> first_line;
    for (int line = 1; !content.empty(); ++line) {
        const auto end = content.find('\n');
        std::string_view rest = content.substr(0, end);
        content.remove_prefix(end == std::string_view::npos ? content.size() : end + 1);
        const std::string_view whole = trimmed(rest);
        rest = without_comment(whole);
        if (rest.empty()) continue;
        const auto equals = rest.find('=');
        const std::string place = text(subject, ", line ", line, ": ");
        if (equals == std::string_view::npos)
            throw InputError(text(place, in_quotes(whole.substr(0, 60)), " is not 'key = value'"));
        const std::string name(trimmed(rest.substr(0, equals)));
        std::string value(trimmed(rest.substr(equals + 1)));
        refuse(place, name);
        if (value.empty()) throw InputError(text(place, name, " has no value"));
        if (const std::string_view all = trimmed(whole.substr(equals + 1)); all.front() == '"') {
            const auto close = all.find('"', 1);
            if (close == std::string_view::npos)
                throw InputError(text(place, name, " begins with a double quote that nothing closes"));
            if (!without_comment(all.substr(close + 1)).empty())
                throw InputError(
                    text(place, name, " goes on behind the double quote that closes it; accepted there: a comment"));
            value = all.substr(1, close - 1);
            if (value.empty()) throw InputError(text(place, name, " has no value"));
        }
        if (const auto [at, fresh] = first_line.try_emplace(name, line); !fresh && !find_key(name)->repeatable)
            throw InputError(text(place, name, " stands in line ", at->second, " already"));
        given.push_back({name, value, place + name, folder.empty() ? "." : folder});
    }
    return given;
}

std::string folder_of(const std::string& path) { return std::filesystem::path(path).parent_path().string(); }

void refuse_but_scene_keys(const std::string& place, const std::string& name) {
    const Key* key = find_key(name);
    if (key && key->in_scene_file && (key->commands & command_simulate)) return;
    const std::string owners = key && !(key->commands & command_simulate) ? whose(name) : "";
    throw InputError(text(place, "unknown key ", in_quotes(name.substr(0, 60)),
                          owners.empty() ? suggestion(name, key_names(command_simulate, true), "") : owners));
}

bool belongs_to_set(const Key& key) {
    const bool grouped = key.group == KeyGroup::radar || key.group == KeyGroup::antenna ||
                         key.group == KeyGroup::receiver || key.group == KeyGroup::errors;
    return grouped && key.changes_result;
}

void refuse_but_set_keys(const std::string& place, const std::string& name) {
    const Key* key = find_key(name);
    if (key && belongs_to_set(*key)) return;
    std::vector<std::string> names;
    for (const Key& known : key_table())
        if (belongs_to_set(known)) names.push_back(known.name);
    constexpr const char* accepted =
        "accepted: the keys of the groups Radar, Antenna, Receiver and The radar's own errors";
    if (key) throw InputError(text(place, name, " is no key of a radar set; ", accepted));
    throw InputError(
        text(place, "unknown key ", in_quotes(name.substr(0, 60)), suggestion(name, names, ""), "; ", accepted));
}

/// The lines of the set that is asked for.
std::vector<Given> read_set(const Given& asked) {
    Settings named;
    find_key("set")->set(named, asked);
    const std::string& path = named.radar_set;
    if (const RadarSet* shipped = shipped_set(path))
        return read_keys(text("set ", path), "", shipped->content, refuse_but_set_keys);
    std::error_code ignored;
    if (!std::filesystem::exists(path, ignored)) {
        std::vector<std::string> names;
        for (const RadarSet& set : shipped_sets()) names.push_back(set.name);
        throw InputError(text(asked.origin, " is ", in_quotes(path), ", and there is no such file; it must be one of ",
                              shipped_set_names(), " or a file of lines key = value",
                              suggestion(trimmed(asked.value), names, "")));
    }
    const std::string subject = text("set ", in_quotes(path));
    std::vector<Given> keys = read_keys(subject, folder_of(path), file_content(path, "set"), refuse_but_set_keys);
    if (keys.empty()) throw InputError(text(subject, " holds no key; accepted: at least one line key = value"));
    return keys;
}

/// With the values of the set that is asked for, where a key is given nowhere else.
std::vector<Given> with_set(const std::vector<Given>& given) {
    const auto asked = std::find_if(given.begin(), given.end(), [](const Given& g) { return g.key == "set"; });
    if (asked == given.end()) return given;
    std::vector<Given> all;
    for (const Given& from_set : read_set(*asked))
        if (std::none_of(given.begin(), given.end(), [&](const Given& g) { return g.key == from_set.key; }))
            all.push_back(from_set);
    all.insert(all.end(), given.begin(), given.end());
    return all;
}

}  // namespace

std::vector<Given> read_scene(const std::string& path, std::string_view content) {
    return read_keys(text("scene file ", in_quotes(path)), folder_of(path), content, refuse_but_scene_keys);
}

namespace {

bool excludes(const Key& a, const Key& b) {
    if (a.exclusive == Exclusive::none || b.exclusive == Exclusive::none) return false;
    if (a.exclusive == b.exclusive) return true;
    const bool accuracy = a.exclusive == Exclusive::accuracy || b.exclusive == Exclusive::accuracy;
    return !accuracy && (a.exclusive == Exclusive::track || b.exclusive == Exclusive::track);
}

/// Those of the scene file that the command line does not replace, and then its own.
std::vector<Given> merged(const std::vector<Given>& scene_file, const std::vector<Given>& command_line) {
    const auto refuse_two = [](const std::vector<Given>& from) {
        for (std::size_t i = 0; i < from.size(); ++i) {
            for (std::size_t j = i + 1; j < from.size(); ++j) {
                const Key *a = find_key(from[i].key), *b = find_key(from[j].key);
                if (a == b || !excludes(*a, *b)) continue;
                const std::string both = text(from[j].origin, " is given beside ", name_beside(from[i]));
                if (a->exclusive == Exclusive::track || b->exclusive == Exclusive::track)
                    throw InputError(text(both, "; a track alone says where the sensor is"));
                if (a->exclusive == Exclusive::accuracy)
                    throw InputError(text(both, "; at most one of quality and max-error may be given"));
                if (a->name == "observers" || b->name == "observers")
                    throw InputError(text(both, "; the file of observers alone says where they stand"));
                throw InputError(text(
                    both, "; exactly one of ",
                    a->exclusive == Exclusive::place ? "latlon and xy" : "altitude-msl, altitude-agl and altitude-hae",
                    " is needed"));
            }
        }
    };
    refuse_two(scene_file);
    refuse_two(command_line);
    std::vector<Given> all;
    for (const Given& from_file : scene_file) {
        const Key* key = find_key(from_file.key);
        const bool replaced = std::any_of(command_line.begin(), command_line.end(), [&](const Given& given) {
            const Key* other = find_key(given.key);
            return other == key || excludes(*key, *other);
        });
        if (!replaced) all.push_back(from_file);
    }
    all.insert(all.end(), command_line.begin(), command_line.end());
    return all;
}

bool asks_for_help(const std::vector<Given>& command_line) {
    return std::any_of(command_line.begin(), command_line.end(),
                       [](const Given& given) { return given.key == "help" && !same_letters(given.value, "off"); });
}

/// What a tile store brings unless it is given: the class table of its features' classes, and how many metres one unit of
/// its culture heights is, unless these are given.
void add_store_defaults(std::vector<Given>& given, std::vector<std::string> stores) {
    bool wants_table = true, wants_scale = true;
    for (const Given& one : given) {
        if (one.key == "class-table") wants_table = false;
        if (one.key == "culture-height-scale" || one.key == "culture-height") wants_scale = false;
        if (one.key != "dem") continue;
        Settings where;
        find_key("dem")->set(where, one);
        stores.push_back(where.dem);
    }
    const auto of_store = [](const char* key, const std::string& store) {
        return text(key, " of tile store ", in_quotes(store));
    };
    for (const std::string& store : stores) {
        if (const std::string table = store_classes(store); wants_table && !table.empty()) {
            given.push_back({"class-table", table, of_store("class-table", store), ""});
            wants_table = false;
        }
        if (const auto scale = wants_scale ? store_height_scale(store) : std::nullopt) {
            given.push_back({"culture-height-scale", text(*scale), of_store("culture-height-scale", store), ""});
            wants_scale = false;
        }
    }
}

Settings settings_of(const std::vector<Given>& merged_keys) {
    Settings settings;
    std::vector<Given> all = with_set(merged_keys);
    // It says which words others may be.
    std::stable_partition(all.begin(), all.end(), [](const Given& given) { return given.key == "class-table"; });
    for (const Given& given : all) {
        find_key(given.key)->set(settings, given);
        if (!given.origin.empty()) settings.given.emplace(given.key, given.origin);
    }
    return settings;
}

}  // namespace

Settings settings_from(const std::vector<Given>& scene_file, const std::vector<Given>& command_line) {
    return settings_of(merged(scene_file, command_line));
}

ScopeRequest parse_scope_arguments(const std::vector<std::string>& arguments) {
    std::vector<std::string> files;
    const std::vector<Given> command_line = read_command_line(command_scope, arguments, files);
    ScopeRequest request;
    request.settings.help = asks_for_help(command_line);
    if (request.settings.help) return request;
    if (files.empty())
        throw InputError("scope takes the path of an echo image (what simulate --echo has written); none is given");
    if (files.size() > 2)
        throw InputError(text("scope takes an echo image and at most one scene file; found ", files.size(), " paths"));
    std::vector<Given> scene_file;
    if (files.size() == 2) scene_file = read_scene(files[1], file_content(files[1]));
    request.given = with_set(merged(scene_file, command_line));
    request.settings = settings_from({}, request.given);
    request.settings.files = files;
    // What it says is given now, and stands over what is stored; nobody needs to read it again.
    std::erase_if(request.given, [](const Given& given) { return given.key == "set"; });
    return request;
}

namespace {

/// Of budget, whose scene file says where the sensor is: `latlon` names the cell's place if nothing else does.
void name_place(const std::vector<Given>& scene_file, std::vector<Given>& command_line) {
    const auto has = [](const std::vector<Given>& all, std::initializer_list<const char*> names) {
        return std::any_of(all.begin(), all.end(), [&](const Given& given) {
            return std::any_of(names.begin(), names.end(), [&](const char* name) { return given.key == name; });
        });
    };
    if (!has(scene_file, {"latlon", "xy"}) || has(command_line, {"at", "at-latlon", "xy"})) return;
    for (Given& given : command_line)
        if (given.key == "latlon") given.key = "at-latlon";
}

}  // namespace

Settings parse_arguments(Command command, const std::vector<std::string>& arguments, const std::vector<Given>& more,
                         const std::vector<Given>& defaults) {
    std::vector<std::string> files;
    std::vector<Given> command_line = read_command_line(command, arguments, files, more);
    if (asks_for_help(command_line)) {
        Settings settings;
        settings.help = true;
        return settings;
    }
    std::vector<Given> scene_file;
    if ((keys_taken(command, arguments) & (command_simulate | command_budget)) && !files.empty()) {
        std::error_code error;
        for (const std::string& file : files)
            if (is_quantity(file) && !std::filesystem::exists(file, error))
                throw InputError(text(in_quotes(file), " is no file; ", one_word));
        if (files.size() > 1) {
            throw InputError(text("there are two scene files, ", in_quotes(files[0]), " and ", in_quotes(files[1]),
                                  "; one at most is taken"));
        }
        scene_file = read_scene(files[0], scene_file_content(files[0]));
    }
    if (command == command_budget) name_place(scene_file, command_line);
    const auto says = [](const Given& given, const Given& otherwise) {
        return given.key == otherwise.key || excludes(*find_key(given.key), *find_key(otherwise.key));
    };
    for (const Given& one : defaults)
        if (std::none_of(command_line.begin(), command_line.end(),
                         [&](const Given& given) { return says(given, one); }))
            command_line.push_back(one);
    std::vector<Given> given = merged(scene_file, command_line);
    // Of tile's and coverage's paths the last is an output.
    const bool writes = command == command_coverage || (command == command_tile && files.size() > 1);
    std::vector<std::string> stores = files;
    if (writes && stores.size() > 1) stores.pop_back();  // tile --around may be given a store alone
    // A store that info is only to tell of may be damaged.
    const bool only_told_of = command == command_info && !has_flag(arguments, "--plan");
    if (!only_told_of) add_store_defaults(given, stores);
    Settings settings = settings_of(given);
    settings.files = files;
    return settings;
}

bool names_scene(std::string_view path) {
    return path.size() >= 4 && same_letters(path.substr(path.size() - 4), ".ini");
}

Settings parse_scene_file(const std::string& path) {
    std::vector<Given> given = read_scene(path, scene_file_content(path));
    add_store_defaults(given, {});
    return settings_of(given);
}

namespace {

void check_scan(const Settings& settings) {
    if (settings.scan_step && settings.track.empty())
        throw InputError("scan-step is given without track; the places that the sensor passes are needed");
    if (settings.scan_step && !settings.scan_period_s)
        throw InputError("scan-step is given without scan-period; the time of a full turn of the antenna is needed");
    if (settings.scan_period_s && !settings.scan_step)
        throw InputError(
            "scan-period is given without scan-step; the azimuth bins that are seen from one place are needed");
}

void check_observers(const Settings& settings) {
    if (settings.observers.empty()) {
        constexpr const char* alone = " is given without observers; a file of points is needed";
        if (settings.at_least) throw InputError(text("at-least", alone));
        if (!settings.observers_layer.empty()) throw InputError(text("observers-layer", alone));
        return;
    }
    if (settings.coverage.layer != CoverageLayer::mask)
        throw InputError(
            text("layer is ", *find_key("layer")->get(settings),
                 ", and observers is given; accepted: mask (how many see a post, or with at-least a mask)"));
    if (settings.source == SourceKind::spilled)
        throw InputError(
            "source is spilled, and observers is given; a spill is sorted round one place (accepted: auto, direct; "
            "tile turns rasters that windows read badly into a store)");
}

/// A mask is worth nothing where two of its values are one; what is no mask has none.
void check_mask(const Settings& settings) {
    const MaskValues& mask = settings.coverage.mask;
    struct Value {
        const char* key;
        std::int64_t value;
        bool given;
    };
    const auto of = [&](const char* key, std::int64_t value) {
        return Value{key, value, settings.given.contains(key)};
    };
    const Value seen = of("seen-value", mask.seen), hidden = of("hidden-value", mask.hidden),
                outside = of("outside-value", mask.outside),
                no_data = of("no-data-value", settings.no_data_value.value_or(mask.no_data));
    const bool counts = !settings.observers.empty() && !settings.at_least;
    for (const Value& one : {seen, hidden, outside, no_data}) {
        if (!one.given) continue;
        if (counts)
            throw InputError(text(settings.spelled(one.key),
                                  " is given, and observers without at-least; counts have no such value (0 is seen by "
                                  "none, 65535 no data)"));
        if (settings.coverage.layer != CoverageLayer::mask)
            throw InputError(text(settings.spelled(one.key), " is given, and layer is ",
                                  *find_key("layer")->get(settings),
                                  "; of the layers the mask alone has such a value"));
    }
    if (settings.snap_to_post) return;  // as gdal_viewshed, whose own defaults are alike
    const std::pair<Value, Value> apart[] = {{seen, hidden}, {seen, no_data}, {hidden, no_data}, {seen, outside}};
    for (const auto& [a, b] : apart) {
        if (a.value != b.value || !(a.given || b.given)) continue;
        const auto& [named, other] = a.given ? std::pair(a, b) : std::pair(b, a);
        throw InputError(text(settings.spelled(named.key), " is ", named.value, ", and so is ",
                              other.given ? settings.spelled(other.key) : text("--", other.key, " by default"),
                              "; accepted: three values for what is seen, hidden and no data, and another than seen "
                              "for what is outside"));
    }
}

}  // namespace

void check_temp_dir(const Settings& settings) {
    if (settings.temp_dir.empty()) return;
    std::error_code error;
    const bool folder = std::filesystem::is_directory(settings.temp_dir, error);
    if (folder && ::access(settings.temp_dir.c_str(), W_OK | X_OK) == 0) return;
    const std::string why = error ? error.message() : folder ? system_reason(errno) : "it is no folder";
    throw IoError(text("temp-dir ", in_quotes(settings.temp_dir), " cannot be used: ", why,
                       "; accepted: a folder that can be written to"));
}

void check_complete(const Settings& settings) {
    const PlatformParams& platform = settings.scene.platform;
    if (settings.dem.empty()) throw InputError("dem is missing; the path of a terrain raster is needed");
    const bool moves = !settings.track.empty(), many = !settings.observers.empty();
    check_scan(settings);
    if (!settings.power_stack.empty() && !moves)
        throw InputError(
            "power-stack is given without track; its bands are the frames of one (power is a single image's)");
    check_observers(settings);
    check_mask(settings);
    if (!moves && !many && !platform.latlon && !platform.xy)
        throw InputError("the sensor's position is missing; exactly one of latlon and xy is needed");
    if (platform.latlon && platform.xy) throw InputError("latlon and xy are both given; exactly one of them is needed");
    if (!moves && !many && !settings.altitude_given) {
        throw InputError(
            "the sensor's altitude is missing; exactly one of altitude-msl, altitude-agl and altitude-hae is needed");
    }
    if (platform.altitude_above == AltitudeAbove::ellipsoid && !platform.geoid_offset_m) {
        throw InputError(
            "altitude-hae is given without geoid-offset; the height of the geoid above the ellipsoid at the sensor is "
            "needed");
    }
    if (!settings.culture.empty() && settings.culture_legend.empty()) {
        throw InputError(
            "culture is given without culture-legend; one of fbfm40, nlcd, worldcover, smc, rat or a CSV file is "
            "needed");
    }
    // A tile store may bring a culture of its own.
    if (settings.culture.empty() && !settings.culture_legend.empty() && !is_tile_store(settings.dem)) {
        throw InputError(text("culture-legend is ", in_quotes(settings.culture_legend),
                              " but there is no culture; the path of a culture raster is needed"));
    }
    if (!moves && settings.work_dir.empty()) {
        const char* const key = settings.resume ? "resume" : settings.only_wedges ? "only-wedge" : nullptr;
        if (key) throw InputError(text(key, " is given without work-dir; the folder that keeps the wedges is needed"));
    }
    if (moves) {
        const char* const of_one = !settings.work_dir.empty() ? "work-dir"
                                   : settings.resume          ? "resume"
                                   : settings.only_wedges     ? "only-wedge"
                                                              : nullptr;
        if (of_one)
            throw InputError(
                text(of_one,
                     " is given beside track; a work folder keeps the wedges of one picture, and finished pictures of "
                     "a track stay anyhow (to go on after a stop, give the rows that are left)"));
        if (settings.source == SourceKind::spilled)
            throw InputError(
                "source is spilled, and track is given; a spill is sorted round one place (accepted: auto, direct; "
                "tile turns rasters that windows read badly into a store)");
    } else if (!many) {
        validate(settings.scene);
    }
}

}  // namespace wedgescope
