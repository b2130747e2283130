// Track report: what the frames of a track did: the report's JSON, the table of --profile.
// Leaves single scenes to report_json.hpp.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "lib/engine.hpp"
#include "tools/limits.hpp"
#include "tools/report_json.hpp"
#include "tools/side_by_side.hpp"
#include "tools/track_frames.hpp"

namespace wedgescope {

/// What a frame goes through, one after the other.
enum class FrameStage : std::size_t { resolving, surveying, sweeping, beaming, receiving, displaying, writing };
inline constexpr std::size_t frame_stages = static_cast<std::size_t>(FrameStage::writing) + 1;

/// What a frame did; small, for all frames' are kept.
struct FrameReport {
    double lat_deg = 0, lon_deg = 0, x = 0, y = 0, sensor_m = 0, range_m = 0;
    bool has_lat_lon = false;
    double start_s = 0, end_s = 0;             ///< of the clock now_s()
    std::array<float, frame_stages> wall_s{};  ///< by FrameStage
    std::array<float, std::size(cpu_stages)> cpu_s{};
    std::array<std::uint64_t, state_count> states{};
    std::uint64_t samples = 0, pieces = 0, refined_bins = 0, posts = 0, bytes = 0;
    LevelPosts level_posts{};
    Sampling sampling;

    float& of(FrameStage stage) { return wall_s[static_cast<std::size_t>(stage)]; }
    double of(FrameStage stage) const { return static_cast<double>(wall_s[static_cast<std::size_t>(stage)]); }
    /// What the engine says of it. Its own stages are taken from those of `sweeping`, in which they fell.
    void take(const RunResult& result);
};

/// How all frames of a track were made.
struct TrackReport {
    std::vector<FrameReport> frames;
    LaneCount lanes;
    double start_s = 0, end_s = 0;  ///< of the clock now_s()
    double wall_s() const { return end_s - start_s; }
    double frames_per_second() const { return static_cast<double>(frames.size()) / wall_s(); }
};

/// Frame after frame, so that a long track's report is never held as a whole.
///   open_s   from the program's start to the data base's being open
void write_track_report(OutputFile& file, const Settings& settings, const TrackFrames& frames,
                        const TrackReport& report, WedgeSource& source, double open_s, const Usage& usage);
/// Milliseconds a frame, for --profile.
std::string track_table(const TrackReport& report, const Usage& usage);
/// What the stages of all frames moved, as if it were one run.
std::vector<StageWork> track_work(const TrackReport& report, const Usage& usage);

}  // namespace wedgescope
