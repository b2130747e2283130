// RunRecords: a run's report and timeline, under temporary names until they appear together with its outputs.
// Leaves what is in them to the commands.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tiles/output_file.hpp"
#include "tools/run_files.hpp"
#include "tools/settings.hpp"
#include "tools/timeline.hpp"

namespace wedgescope {

class RunRecords {
public:
    /// Those that are asked for. InputError, IoError as OutputFile.
    explicit RunRecords(const Settings& settings);

    /// Null where none is asked for, as the next.
    Timeline* timeline() { return timeline_.get(); }
    /// What the report is written to.
    OutputFile* report() { return report_ ? &*report_ : nullptr; }
    /// What is told to the timeline later is left out. IoError if anything could not be written.
    void end_timeline();
    /// All of them in place, behind `outputs`, by OutputFile::commit(); the names of all, as the user is told them.
    /// `inputs`: of the run.
    std::string commit(std::vector<OutputFile*> outputs, const NamedPaths& inputs);

private:
    std::optional<OutputFile> report_, timeline_file_;
    std::unique_ptr<TimelineFile> timeline_;
};

}  // namespace wedgescope
