#include "tools/run_files.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>

#include "lib/error.hpp"
#include "tools/radar_set.hpp"
#include "tools/terminal.hpp"
#include "tools/units.hpp"

namespace wedgescope {
namespace {

namespace fs = std::filesystem;

bool same_file(const std::string& a, const std::string& b) {
    std::error_code error;
    if (fs::equivalent(a, b, error) && !error) return true;
    const std::string canonical = canonical_path(a);
    return !canonical.empty() && canonical == canonical_path(b);
}

/// At any depth; what is no folder holds nothing.
bool lies_in(const std::string& path, const std::string& folder) {
    std::error_code error;
    if (!fs::is_directory(folder, error)) return false;
    const fs::path in = canonical_path(folder), own = canonical_path(path);
    return !in.empty() && std::mismatch(in.begin(), in.end(), own.begin(), own.end()).first == in.end();
}

}  // namespace

std::string canonical_path(const std::string& path) {
    std::error_code error;
    // weakly_canonical alone leaves a name as it is whose first part does not exist.
    const fs::path canonical = fs::weakly_canonical(fs::absolute(path), error);
    return error ? std::string() : canonical.string();
}

void check_names(const NamedPaths& outputs, const NamedPaths& inputs) {
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        const auto& [key, path] = outputs[i];
        if (path.empty()) continue;
        for (std::size_t j = 0; j < i; ++j)
            if (!outputs[j].second.empty() && same_file(path, outputs[j].second))
                throw InputError(text(key, " and ", outputs[j].first, " are both ", in_quotes(path),
                                      "; every output needs its own file"));
        for (const auto& [input_key, input] : inputs) {
            if (input.empty()) continue;
            if (same_file(path, input))
                throw InputError(text(key, " is ", in_quotes(path), ", which is ", input_key,
                                      " too; an output may not replace an input"));
            if (lies_in(path, input))
                throw InputError(text(key, " is ", in_quotes(path), ", which lies in ", input_key, " ",
                                      in_quotes(input), "; an output may not lie in an input"));
        }
    }
}

std::string set_file(const Settings& s) { return shipped_set(s.radar_set) ? "" : s.radar_set; }

NamedPaths input_paths(const Settings& s) {
    return {{"dem", s.dem},
            {"culture", s.culture},
            {"culture-height", s.culture_height},
            {"culture-legend", legend_path(s)},
            {"class-table", s.class_table},
            {"track", s.track},
            {"set", set_file(s)},
            {"antenna", s.antenna_file},
            {"the scene file", s.files.empty() ? "" : s.files[0]}};
}

void check_run_names(const Settings& s) {
    const NamedPaths outputs{{"output", s.output}, {"echo", s.echo},     {"power", s.power},
                             {"states", s.states}, {"ground", s.ground_file}, {"report", s.report},
                             {"timeline", s.timeline}};
    check_names(outputs, input_paths(s));
    const bool any = std::any_of(outputs.begin(), outputs.end(), [](const auto& out) { return !out.second.empty(); });
    if (!any && !s.only_wedges)
        throw InputError(
            "no output is given; at least one of output (-o), echo, power, states, ground, report, timeline is needed");
}

std::vector<InputFile> input_files(const Settings& s, const DataBase& data_base, const std::string& scene_file) {
    std::vector<InputFile> inputs;
    const auto add = [&](const char* key, const std::string& path, bool raster) {
        if (path.empty()) return;
        std::error_code error;
        InputFile input{key, path, std::nullopt, raster ? crs_name(data_base.crs_wkt) : ""};
        if (const auto bytes = fs::file_size(path, error); !error) input.bytes = bytes;
        inputs.push_back(input);
    };
    add("dem", s.dem, true);
    add("culture", s.culture, true);
    add("culture-height", s.culture_height, true);
    add("culture-legend", legend_path(s), false);
    add("class-table", s.class_table, false);
    add("set", set_file(s), false);
    add("antenna", s.antenna_file, false);
    add("track", s.track, false);
    add("observers", s.observers, false);
    add("scene", scene_file, false);
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
    if (!out)
        throw IoError(text("report ", in_quotes(file.final_path()),
                           " cannot be written: ", errno ? std::strerror(errno) : "disk full?"));
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
