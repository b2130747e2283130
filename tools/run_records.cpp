#include "tools/run_records.hpp"

namespace wedgescope {

RunRecords::RunRecords(const Settings& settings) {
    if (!settings.report.empty()) report_.emplace(settings.report, settings.overwrite);
    if (settings.timeline.empty()) return;
    timeline_file_.emplace(settings.timeline, settings.overwrite);
    timeline_ = std::make_unique<TimelineFile>(*timeline_file_);
}

void RunRecords::end_timeline() {
    if (timeline_) timeline_->finish();
}

std::string RunRecords::commit(std::vector<OutputFile*> outputs, const NamedPaths& inputs) {
    for (std::optional<OutputFile>* file : {&report_, &timeline_file_})
        if (*file) outputs.push_back(&**file);
    std::string names;
    for (const OutputFile* file : outputs) names += (names.empty() ? "" : ", ") + file->final_path();
    OutputFile::commit(outputs, sparing(inputs));
    return names;
}

}  // namespace wedgescope
