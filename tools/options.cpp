#include "tools/options.hpp"

#include <algorithm>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "tiles/tile_store.hpp"
#include "tools/command_line.hpp"
#include "tools/key_file.hpp"

namespace wedgescope {
namespace {

bool excludes(const Key& a, const Key& b) {
    if (a.exclusive == Exclusive::none || b.exclusive == Exclusive::none) return false;
    if (a.exclusive == b.exclusive) return true;
    const bool accuracy = a.exclusive == Exclusive::accuracy || b.exclusive == Exclusive::accuracy;
    return !accuracy && (a.exclusive == Exclusive::track || b.exclusive == Exclusive::track);
}

/// What a message calls it beside another: its key, or what another program calls that.
std::string name_beside(const Given& given) {
    const bool foreign = given.origin.starts_with('-') && !given.origin.starts_with("--");
    return foreign ? given.origin : given.key;
}

bool has_track(const std::vector<Given>& all) {
    return std::any_of(all.begin(), all.end(), [](const Given& given) { return given.key == "track"; });
}

/// What a scene file says of its track alone, where another place stands instead or none is taken.
void leave_out_track_keys(std::vector<Given>& all) {
    std::erase_if(all, [](const Given& given) { return !given.folder.empty() && find_key(given.key)->of_track; });
}

/// Those of the scene file that the command line does not replace, and then its own; without
/// what is said of its track alone where a place of the command line stands instead.
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
    if (has_track(scene_file) && !has_track(all) && !has_track(command_line)) leave_out_track_keys(all);
    all.insert(all.end(), command_line.begin(), command_line.end());
    return all;
}

bool asks_for_help(const std::vector<Given>& command_line) {
    return std::any_of(command_line.begin(), command_line.end(), [](const Given& given) {
        return given.key == "help" && parse_switch(given.origin, given.value);
    });
}

/// What a tile store brings unless it is given: the class table of its features' classes, and how many metres one unit
/// of its culture heights is.
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

Settings settings_from(const std::vector<Given>& scene_file, const std::vector<Given>& command_line) {
    return settings_of(merged(scene_file, command_line));
}

Settings parse_arguments(Command command, const std::vector<std::string>& arguments, const std::vector<Given>& more,
                         const std::vector<Given>& defaults) {
    auto [command_line, files] = read_command_line(command, arguments, more);
    if (asks_for_help(command_line)) {
        Settings settings;
        settings.help = true;
        return settings;
    }
    std::vector<Given> scene_file;
    const unsigned taken = keys_taken(command, arguments);
    if ((taken & (command_simulate | command_budget)) && !files.empty()) {
        refuse_quantities(files);
        if (files.size() > 1) {
            throw InputError(text("there are two scene files, ", in_quotes(files[0]), " and ", in_quotes(files[1]),
                                  "; one at most is taken"));
        }
        scene_file = read_scene_file(files[0]);
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
    if (command != command_simulate && !has_track(given)) leave_out_track_keys(given);
    // Of tile's and coverage's paths the last is an output; help and evaluate take words that are no paths.
    const bool writes = command == command_coverage || (command == command_tile && files.size() > 1);
    std::vector<std::string> stores;
    if (writes || command == command_tile || command == command_info) stores = files;
    if (writes && stores.size() > 1) stores.pop_back();  // tile --around may be given a store alone
    // A store that info is only to tell of may be damaged; a legend may name the classes of its table.
    const bool only_told_of = taken == command_info && std::none_of(given.begin(), given.end(), [](const Given& one) {
                                  return one.key == "culture-legend";
                              });
    if (!only_told_of) add_store_defaults(given, stores);
    Settings settings = settings_of(given);
    settings.files = files;
    return settings;
}

bool names_scene(std::string_view path) {
    return path.size() >= 4 && same_letters(path.substr(path.size() - 4), ".ini");
}

Settings parse_scene_file(const std::string& path, const std::vector<Given>& command_line) {
    std::vector<Given> given = merged(read_scene_file(path), command_line);
    if (!has_track(given)) leave_out_track_keys(given);
    add_store_defaults(given, {});
    return settings_of(given);
}

ScopeRequest parse_scope_arguments(const std::vector<std::string>& arguments) {
    const auto [command_line, files] = read_command_line(command_scope, arguments);
    ScopeRequest request;
    request.settings.help = asks_for_help(command_line);
    if (request.settings.help) return request;
    if (files.empty())
        throw InputError("scope takes the path of an echo image (what simulate --echo has written); none is given");
    if (files.size() > 2)
        throw InputError(text("scope takes an echo image and at most one scene file; found ", files.size(), " paths"));
    std::vector<Given> scene_file;
    if (files.size() == 2) scene_file = read_scene_file(files[1], "");
    // The echo image knows where its sensor was, be it a frame of that track.
    std::erase_if(scene_file, [](const Given& given) { return given.key == "track"; });
    leave_out_track_keys(scene_file);
    request.given = with_set(merged(scene_file, command_line));
    request.settings = settings_from({}, request.given);
    request.settings.files = files;
    // What it says is given now, and stands over what is stored; nobody needs to read it again.
    std::erase_if(request.given, [](const Given& given) { return given.key == "set"; });
    return request;
}

}  // namespace wedgescope
