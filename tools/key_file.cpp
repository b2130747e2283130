#include "tools/key_file.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <system_error>

#include "lib/error.hpp"
#include "tools/command_table.hpp"
#include "tools/near_words.hpp"
#include "tools/radar_set.hpp"
#include "tools/text_file.hpp"
#include "tools/units.hpp"

namespace wedgescope {
namespace {

/// `kind`: of file, for messages; `hint`: what else may have been meant.
std::string file_content(const std::string& path, const char* kind, const char* hint = "") {
    return text_of_file(text(kind, " ", in_quotes(path)), path, text("a ", kind, " holds lines key = value", hint));
}

/// A comment begins at the start or behind a blank: a path may hold a #. Trimmed.
std::string_view without_comment(std::string_view line) {
    for (std::size_t i = 0; i < line.size(); ++i)
        if (line[i] == '#' && (i == 0 || line[i - 1] == ' ' || line[i - 1] == '\t')) return trimmed(line.substr(0, i));
    return trimmed(line);
}

/// `key = value` lines. `subject`: for messages; `folder`: that relative paths start from; `refuse` throws for the name of
/// a key that does not belong there, beginning with the place it is handed.
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
    std::vector<std::string> names;
    for (const Key& known : key_table())
        if ((known.commands & command_simulate) && known.in_scene_file) names.push_back(known.name);
    throw InputError(
        text(place, "unknown key ", in_quotes(name.substr(0, 60)), owners.empty() ? suggestion(name, names) : owners));
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
        text(place, "unknown key ", in_quotes(name.substr(0, 60)), suggestion(name, names), "; ", accepted));
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
                              suggestion(trimmed(asked.value), names)));
    }
    const std::string subject = text("set ", in_quotes(path));
    std::vector<Given> keys = read_keys(subject, folder_of(path), file_content(path, "set"), refuse_but_set_keys);
    if (keys.empty()) throw InputError(text(subject, " holds no key; accepted: at least one line key = value"));
    return keys;
}

}  // namespace

std::vector<Given> read_scene(const std::string& path, std::string_view content) {
    return read_keys(text("scene file ", in_quotes(path)), folder_of(path), content, refuse_but_scene_keys);
}

std::vector<Given> read_scene_file(const std::string& path, const char* hint) {
    return read_scene(path, file_content(path, "scene file", hint));
}

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

}  // namespace wedgescope
