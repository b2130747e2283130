// Report: what a run was asked, did and cost, as JSON (a file contract) and as a table for the terminal.
// Leaves the counting to the engine and the paths to simulate.cpp.
#pragma once
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/limits.hpp"
#include "tools/settings.hpp"

namespace wedgescope {

struct InputFile {
    std::string key, path;
    std::optional<std::uint64_t> bytes;  ///< none: no plain file (/vsicurl/ ...)
    std::string crs;
};

/// CPU seconds of a wedge by stage, as reports name them.
struct CpuStage {
    const char* name;
    double WedgeReport::*seconds;
};
inline constexpr CpuStage cpu_stages[] = {{"load", &WedgeReport::load_s},       {"sample", &WedgeReport::sample_s},
                                          {"sweep", &WedgeReport::sweep_s},     {"shade", &WedgeReport::shade_s},
                                          {"deposit", &WedgeReport::deposit_s}, {"merge", &WedgeReport::merge_s}};

/// What the process has used so far.
struct Usage {
    double wall_s = 0, user_s = 0, system_s = 0;
    std::uint64_t peak_rss_bytes = 0;
    std::uint64_t major_faults = 0;
    /// From /proc/self/io; none where that cannot be read. Through the system's calls, and what of it met the disk.
    std::optional<std::uint64_t> read_bytes, written_bytes, disk_read_bytes, disk_written_bytes;
};
/// `start_s` and the clock's now: seconds of one monotonic clock.
Usage usage_since(double start_s);
double now_s();

nlohmann::ordered_json inputs_json(const std::vector<InputFile>& inputs);
/// Tiles that were read, and those that nobody has read by cause: together all of the data base's.
void add_skipped(nlohmann::ordered_json& report, const Skipped& skipped);
nlohmann::ordered_json source_json(const SourceReport& source);
/// Cells or posts by the name of their state.
nlohmann::ordered_json states_json(const std::array<std::uint64_t, state_count>& counts);
nlohmann::ordered_json sampling_json(const Sampling& sampling);
/// Times, I/O and memory of the process, at the end of a report.
void add_usage(nlohmann::ordered_json& report, const Usage& usage);
/// The same as two lines, with what the memory budget holds and what came back from a spill.
std::string usage_lines(const Usage& usage, int threads, std::size_t budget_bytes, std::uint64_t bytes_spilled);
/// What a spilled source did, a line with a line break before it; empty for a direct one.
std::string source_line(const SourceReport& source);

/// Wedges that an earlier run had done.
std::size_t reused_count(const RunReport& report);

/// Wall seconds of a run before its survey and after its picture.
struct OuterStages {
    double open_s = 0;   ///< rasters, and the passes over them: for a ground map, into wedges
    double write_s = 0;  ///< all files but the report
};

nlohmann::ordered_json report_json(const Settings& settings, const RunResult& run, const std::vector<InputFile>& inputs,
                                   const OuterStages& outer, const Usage& usage);

/// A row for each wedge that was done, or for those that cost most CPU, at most `most_rows` with one for the rest; totals,
/// share of time by stage, from half a per cent on. Lines of at most 140 characters.
std::string report_table(const RunReport& report, const OuterStages& outer, const Usage& usage,
                         std::size_t most_rows = 24);

/// Posts read by level of detail, and how many of the raster's each level's stand for.
nlohmann::ordered_json levels_json(const LevelPosts& posts);

/// What a run wrote to its outputs: all but `scratch`, which it wrote for itself.
std::uint64_t bytes_of_outputs(const Usage& usage, std::uint64_t scratch);

/// What the stages of a run moved, for limits_table(): posts and decoded bytes that were read; a post for each one swept
/// (4 bytes), a cell (8 bytes, read and written) for each visible piece, cells of the image for what follows (the display reads
/// power and state of each).
std::vector<StageWork> stage_work(const RunReport& report, double write_s, const Usage& usage);
/// Reading is measured by decoding where the files hold less than came out of them.
StageWork load_work(double load_s, std::uint64_t decoded_bytes, const Usage& usage);

/// The name of the CRS that a WKT text begins with; empty without one.
std::string crs_name(const std::string& wkt);

}  // namespace wedgescope
