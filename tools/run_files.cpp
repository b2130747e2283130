#include "tools/run_files.hpp"

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "tiles/companion_files.hpp"
#include "tiles/ground_map.hpp"
#include "tiles/tile_store.hpp"
#include "tiles/work_dir.hpp"
#include "tools/radar_set.hpp"
#include "tools/terminal.hpp"

namespace wedgescope {
namespace {

namespace fs = std::filesystem;

bool same_file(const std::string& a, const std::string& b) {
    std::error_code error;
    if (fs::equivalent(a, b, error) && !error) return true;
    const std::string canonical = canonical_path(a);
    return !canonical.empty() && canonical == canonical_path(b);
}

/// Of the files that a raster or vector file is made of, the one that a path is; empty: none.
std::string part_that_is(const std::string& path, const std::string& input, InputParts& parts) {
    std::error_code error;
    if (!fs::exists(path, error)) return {};
    for (const std::string& part : parts.of(input))
        if (same_file(path, part)) return part;
    return {};
}

/// All else is text, of which a file is the whole.
bool may_have_parts(std::string_view key, const std::string& path) {
    constexpr std::string_view keys[] = {"dem",       "culture",     "culture-height", "features",
                                         "observers", "directivity", "the echo image"};
    return std::find(std::begin(keys), std::end(keys), key) != std::end(keys) &&
           !(key == "observers" && lower_case(fs::path(path).extension().string()) == ".csv");
}

bool is_raster(std::string_view output) { return output != "report" && output != "timeline"; }

/// At any depth, itself or a link to it; what is no folder holds nothing.
bool lies_in(const std::string& path, const std::string& folder) {
    std::error_code error;
    if (!fs::is_directory(folder, error)) return false;
    const fs::path in = canonical_path(folder);
    const auto holds = [&](const fs::path& own) {
        return !in.empty() && std::mismatch(in.begin(), in.end(), own.begin(), own.end()).first == in.end();
    };
    const fs::path link = fs::absolute(path, error);
    return holds(canonical_path(path)) || (!error && holds(canonical_path(link.parent_path()) / link.filename()));
}

/// An output lies in the tile store whose VRT an input is.
void refuse_in_store(const NamedPath& output, const NamedPath& given) {
    const auto& [key, path] = output;
    const auto& [input_key, input] = given;
    if (lower_case(fs::path(input).extension().string()) != ".vrt") return;
    const std::string store = fs::path(canonical_path(input)).parent_path().string();
    if (is_tile_store(store) && lies_in(path, store))
        throw InputError(text(key, " is ", in_quotes(path), ", which lies in ", in_quotes(store),
                              ", the tile store of ", input_key, " ", in_quotes(input),
                              "; an output may not lie in an input"));
}

/// An output, or what its driver writes beside it, is an input or a part of one, or lies in it.
void refuse_over_input(const NamedPath& output, const NamedPath& given, const std::string& driver, InputParts& parts) {
    const auto& [key, path] = output;
    const auto& [input_key, input] = given;
    const auto refuse = [&, key = key, &path = path](const std::string& why, const char* rule) {
        throw InputError(text(key, " is ", in_quotes(path), ", ", why, "; an output may not ", rule));
    };
    const char* const replaced = "replace an input";
    const std::string made = text("of which ", input_key, " ", in_quotes(input), " is made");
    if (same_file(path, input)) refuse(text("which is ", input_key, " too"), replaced);
    if (std::error_code error; fs::exists(path, error)) {
        const std::vector<std::string>& of_vrt = parts.of_vrt(input);
        if (std::any_of(of_vrt.begin(), of_vrt.end(), [&](const std::string& part) { return same_file(path, part); }))
            refuse(made, replaced);
    }
    if (lies_in(path, input)) refuse(text("which lies in ", input_key, " ", in_quotes(input)), "lie in an input");
    refuse_in_store(output, given);
    if (!may_have_parts(input_key, input)) return;
    if (!part_that_is(path, input, parts).empty()) refuse(made, replaced);
    if (!is_raster(key)) return;
    for (const std::string& beside : names_beside_raster(path, driver))
        if (same_file(beside, input) || !part_that_is(beside, input, parts).empty())
            refuse(text("beside which ", in_quotes(beside), " is written, ", made), replaced);
}

/// A folder that is to be replaced holds an input, or a part of one.
void refuse_around_input(const NamedPath& folder, const NamedPath& given) {
    const auto& [key, path] = folder;
    const auto& [input_key, input] = given;
    if (lies_in(input, path))
        throw InputError(text(key, " is ", in_quotes(path), ", in which ", input_key, " ", in_quotes(input),
                              " lies; an output may not replace an input"));
    std::vector<std::string> parts = vrt_parts(input);
    // Of parts only what their names tell: there may be thousands, far away.
    std::error_code error;
    for (std::size_t i = 0, n = parts.size(); i < n; ++i)
        if (!fs::exists(parts[i], error))
            if (const std::string file = file_behind(parts[i]); !file.empty()) parts.push_back(file);
    if (may_have_parts(input_key, input)) {
        const std::vector<std::string> known = files_of_input(input);
        parts.insert(parts.end(), known.begin(), known.end());
    }
    for (const std::string& part : parts)
        if (lies_in(part, path))
            throw InputError(text(key, " is ", in_quotes(path), ", in which ", in_quotes(part), " lies, of which ",
                                  input_key, " ", in_quotes(input), " is made; an output may not replace an input"));
}

}  // namespace

std::string canonical_path(const std::string& path) {
    std::error_code error;
    // weakly_canonical alone leaves a name as it is whose first part does not exist.
    const fs::path canonical = fs::weakly_canonical(fs::absolute(path, error), error);
    return error ? std::string() : canonical.string();
}

const std::vector<std::string>& InputParts::of(const std::string& path) {
    const auto [found, fresh] = parts_.try_emplace(path);
    if (fresh) found->second = files_of_input(path);
    return found->second;
}

const std::vector<std::string>& InputParts::of_vrt(const std::string& path) {
    const auto [found, fresh] = vrt_parts_.try_emplace(path);
    if (fresh) found->second = vrt_parts(path);
    return found->second;
}

void check_names(const NamedPaths& outputs, const NamedPaths& inputs, const std::string& driver) {
    InputParts parts;
    check_names(outputs, inputs, driver, parts);
}

void check_names(const NamedPaths& outputs, const NamedPaths& inputs, const std::string& driver, InputParts& parts) {
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        const auto& [key, path] = outputs[i];
        if (path.empty()) continue;
        for (std::size_t j = 0; j < i; ++j)
            if (!outputs[j].second.empty() && same_file(path, outputs[j].second))
                throw InputError(text(key, " and ", outputs[j].first, " are both ", in_quotes(path),
                                      "; every output needs its own file"));
        for (const NamedPath& input : inputs)
            if (!input.second.empty()) refuse_over_input(outputs[i], input, driver, parts);
    }
}

OutputFile::MayReplace sparing(NamedPaths inputs) {
    return [inputs = std::move(inputs), parts = std::make_shared<InputParts>()](const OutputFile& output,
                                                                                const std::string& file) {
        for (const auto& [key, path] : inputs) {
            if (path.empty()) continue;
            const bool whole = same_file(file, path);
            if (whole || (may_have_parts(key, path) && !part_that_is(file, path, *parts).empty()))
                throw InputError(text("output ", in_quotes(output.final_path()), ": its driver writes ",
                                      in_quotes(file), whole ? ", which is " : ", of which ", key, " ", in_quotes(path),
                                      whole ? "" : " is made", "; an output may not replace an input"));
        }
    };
}

void check_side_files(const NamedPaths& outputs, const Settings& s) {
    DataBaseParams rasters;
    rasters.dem = s.dem;
    const std::string map = s.dem.empty() ? "" : GroundMap::kept_path(rasters);
    std::error_code error;
    const bool has_map = !map.empty() && (s.keep_map || fs::exists(map, error));
    for (const auto& [key, path] : outputs) {
        if (path.empty()) continue;
        if (has_map && same_file(path, map))
            throw InputError(text(key, " is ", in_quotes(path), ", where the ground map of dem ", in_quotes(s.dem),
                                  " is kept; every output needs its own file"));
        const fs::path whole = fs::absolute(path, error);
        if (!s.work_dir.empty() && WorkDir::keeps(whole.filename().string()) &&
            canonical_path(whole.parent_path().string()) == canonical_path(s.work_dir))
            throw InputError(text(key, " is ", in_quotes(path), ", which work-dir ", in_quotes(s.work_dir),
                                  " keeps for itself; every output needs its own file"));
    }
}

void check_folder(const char* key, const std::string& folder, const NamedPaths& inputs) {
    if (std::error_code error; fs::is_directory(folder, error))
        for (const NamedPath& input : inputs)
            if (!input.second.empty()) refuse_around_input({key, folder}, input);
    for (const NamedPath& input : inputs) refuse_in_store({key, folder}, input);
}

std::string set_file(const Settings& s) { return shipped_set(s.radar_set) ? "" : s.radar_set; }

static NamedPaths raster_paths(const Settings& s) {
    return {{"dem", s.dem}, {"culture", s.culture}, {"culture-height", s.culture_height}};
}

static NamedPaths table_paths(const Settings& s) {
    return {
        {"culture-legend", legend_path(s)}, {"class-table", s.class_table}, {"track", s.track}, {"set", set_file(s)},
        {"antenna", s.antenna_file},        {"observers", s.observers}};
}

NamedPaths data_paths(const Settings& s) {
    NamedPaths paths = raster_paths(s);
    for (NamedPath& table : table_paths(s)) paths.push_back(std::move(table));
    return paths;
}

NamedPaths input_paths(const Settings& s) {
    NamedPaths paths = data_paths(s);
    paths.emplace_back("the scene file", s.files.empty() ? "" : s.files[0]);
    return paths;
}

void check_coverage_names(const Settings& s) {
    const NamedPaths outputs{{"output", s.output}, {"report", s.report}, {"timeline", s.timeline}};
    check_names(outputs, data_paths(s), s.driver);
    check_side_files(outputs, s);
}

void check_run_names(const NamedPaths& outputs, const NamedPaths& inputs, const std::string& driver) {
    check_names(outputs, inputs, driver);
    if (std::any_of(outputs.begin(), outputs.end(), [](const auto& out) { return !out.second.empty(); })) return;
    std::string keys;
    for (const auto& [key, path] : outputs)
        keys += text(keys.empty() ? "" : ", ", key, std::string_view(key) == "output" ? " (-o)" : "");
    throw InputError(text("no output is given; at least one of ", keys, " is needed"));
}

void check_run_names(const Settings& s) {
    const NamedPaths outputs{{"output", s.output},           {"echo", s.echo},        {"power", s.power},
                             {"power-stack", s.power_stack}, {"states", s.states},    {"ground", s.ground_file},
                             {"report", s.report},           {"timeline", s.timeline}};
    check_side_files(outputs, s);
    s.only_wedges ? check_names(outputs, input_paths(s), s.driver) : check_run_names(outputs, input_paths(s), s.driver);
}

InputFile input_file(const std::string& key, const std::string& path, const std::string& crs) {
    InputFile input{key, path, std::nullopt, crs};
    std::error_code error;
    if (const auto bytes = fs::file_size(path, error); !error) input.bytes = bytes;
    return input;
}

std::vector<InputFile> input_files(const Settings& s, const DataBase& data_base, const std::string& scene_file) {
    std::vector<InputFile> inputs;
    const auto add = [&inputs](const NamedPaths& paths, const std::string& crs) {
        for (const auto& [key, path] : paths)
            if (!path.empty()) inputs.push_back(input_file(key, path, crs));
    };
    add(raster_paths(s), crs_name(data_base.crs_wkt));
    add(table_paths(s), "");
    if (!scene_file.empty()) inputs.push_back(input_file("scene", scene_file));
    return inputs;
}

namespace {

using json = nlohmann::ordered_json;

std::string dumped(const json& value, int indent) {
    return value.dump(indent, ' ', false, json::error_handler_t::replace);
}

/// `fill` writes what is in it.
template <class Fill>
void write_report_file(OutputFile& file, Fill&& fill) {
    errno = 0;
    std::ofstream out(file.temporary_path(), std::ios::binary);
    fill(out);
    out.close();
    if (!out) throw IoError(text("report ", in_quotes(file.final_path()), " cannot be written: ", stream_reason()));
}

}  // namespace

void write_report(OutputFile& file, const json& report) {
    write_report_file(file, [&](std::ostream& out) { out << dumped(report, 2) << '\n'; });
}

void write_report(OutputFile& file, const json& head, const char* name, std::size_t count,
                  const std::function<json(std::size_t)>& entry, const json& tail) {
    write_report_file(file, [&](std::ostream& out) {
        std::string begin = dumped(head, 2);
        begin.erase(begin.rfind("\n}"));
        out << begin << ",\n  \"" << name << "\": [";
        for (std::size_t i = 0; i < count; ++i) out << (i ? ",\n    " : "\n    ") << dumped(entry(i), -1);
        out << "\n  ]," << dumped(tail, 2).substr(1) << '\n';
    });
}

std::string limits_words(const Settings& settings, const std::vector<StageWork>& stages) {
    constexpr std::size_t buffer_bytes = std::size_t{32} << 20;
    try {
        return limits_table(stages, measure_limits(settings.temp_dir, buffer_bytes));
    } catch (const IoError& e) {
        return text("limits of this machine are not known: ", one_line(e.what()), "\n");
    }
}

}  // namespace wedgescope
