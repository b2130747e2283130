// Run files: names of a run's inputs and outputs, checked before any work, and its report.
// Leaves what is written to the commands.
#pragma once
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "lib/wedge_source.hpp"
#include "tiles/output_file.hpp"
#include "tools/limits.hpp"
#include "tools/report_json.hpp"
#include "tools/settings.hpp"

namespace wedgescope {

/// Keys and the paths that they name; empty paths name nothing.
using NamedPath = std::pair<const char*, std::string>;
using NamedPaths = std::vector<NamedPath>;

/// Files that inputs are made of, each looked up when it is first asked for.
class InputParts {
public:
    const std::vector<std::string>& of(const std::string& path);
    /// By its own words: vrt_parts().
    const std::vector<std::string>& of_vrt(const std::string& path);

private:
    std::map<std::string, std::vector<std::string>> parts_, vrt_parts_;
};

/// InputError where two outputs are one file, or where an output, or a file that its driver writes beside it, is an input or a
/// part of one, or lies in an input that is a folder. `driver`: of rasters, where it is not told by their endings.
void check_names(const NamedPaths& outputs, const NamedPaths& inputs, const std::string& driver, InputParts& parts);
void check_names(const NamedPaths& outputs, const NamedPaths& inputs, const std::string& driver = {});

/// Refuses side files of outputs that would replace one of `inputs`, or a part of one: InputError.
OutputFile::MayReplace sparing(NamedPaths inputs);

/// InputError where an output is a file that the run itself keeps: the ground map beside its terrain, what is in its work folder.
void check_side_files(const NamedPaths& outputs, const Settings& settings);

/// InputError where an input, or a part of one, lies in a folder that an output replaces as a whole.
void check_folder(const char* key, const std::string& folder, const NamedPaths& inputs);

/// The one name of a path, however it is written, also where nothing stands there yet; empty if the system does not tell.
std::string canonical_path(const std::string& path);

/// Path of the user's own radar set; empty for none and for a shipped one.
std::string set_file(const Settings& settings);

/// Files of the data base, of places and of the set; the rasters first.
NamedPaths data_paths(const Settings& settings);
/// All that a simulation may read.
NamedPaths input_paths(const Settings& settings);

/// check_names() of coverage. Within a GdalSession, as all of these: GDAL may be asked what files an input has.
void check_coverage_names(const Settings& settings);
/// check_names() of a run; InputError too where no output is asked for, naming all of them.
void check_run_names(const NamedPaths& outputs, const NamedPaths& inputs, const std::string& driver);
/// The same of all of a simulation's outputs and inputs; with only-wedge it needs none.
void check_run_names(const Settings& settings);

/// An input for a report, with its size where it is a file.
InputFile input_file(const std::string& key, const std::string& path, const std::string& crs = {});

/// Inputs of a run for its report: those of the settings that are named, and the scene file where there is one.
std::vector<InputFile> input_files(const Settings& settings, const DataBase& data_base,
                                   const std::string& scene_file = {});

/// Under the file's temporary name. IoError.
void write_report(OutputFile& file, const nlohmann::ordered_json& report);
/// The same in pieces: what `head` holds, an array `name` of so many entries, each on a line of its own, and what `tail` holds,
/// so that a long report is never held as a whole. Neither is empty.
void write_report(OutputFile& file, const nlohmann::ordered_json& head, const char* name, std::size_t count,
                  const std::function<nlohmann::ordered_json(std::size_t)>& entry, const nlohmann::ordered_json& tail);

/// limits_table() of a run that is over, with what the machine does at the most, measured in the folder for temporary files;
/// a line of why not where that cannot be measured.
std::string limits_words(const Settings& settings, const std::vector<StageWork>& stages);

}  // namespace wedgescope
