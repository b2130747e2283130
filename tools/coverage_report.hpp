// Coverage report: what the reports of one sensor's coverage and of many observers' have in common.
// Leaves the rest to coverage.cpp and observers.cpp.
#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "lib/coverage.hpp"
#include "tools/limits.hpp"
#include "tools/report_json.hpp"
#include "tools/settings.hpp"

namespace wedgescope {

/// What changes the values, as a user would write it.
nlohmann::ordered_json coverage_parameters(const Settings& settings);
/// What a quadrant, or all of them, did and cost.
nlohmann::ordered_json quadrant_json(const QuadrantReport& report);
/// For a report: also, as `resolved`, the quality that max-error took.
nlohmann::ordered_json coverage_scene(const Settings& settings);
/// Stages of a coverage for limits_words().
std::vector<StageWork> coverage_stages(const QuadrantReport& total, const DataBase& data_base, double write_s,
                                       std::uint64_t written_bytes, const Usage& usage);
/// What a user may take for an error of the program: a line for an output that holds no judged post.
std::string nothing_judged_line(const Settings& settings);
/// The file's format, as --of, --co and --reproducible say; with `coverage_parameters` in it.
RasterFormat coverage_format(const Settings& settings);

}  // namespace wedgescope
