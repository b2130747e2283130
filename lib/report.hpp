// RunReport: what was done, how long it took and what it held, wedge by wedge.
// Leaves the JSON and the terminal table to tools/report_json.hpp.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lib/polar.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

/// Posts by level of detail.
using LevelPosts = std::array<std::uint64_t, 6>;
inline void add_levels(LevelPosts& posts, const LevelPosts& more) {
    for (std::size_t level = 0; level < posts.size(); ++level) posts[level] += more[level];
}

struct WedgeReport {
    std::int64_t index = 0;
    Interval azimuth_bins;
    double load_s = 0, sample_s = 0, sweep_s = 0, shade_s = 0, deposit_s = 0, merge_s = 0;  ///< CPU seconds
    double wall_s = 0;                                                                      ///< from entering to merged
    /// Before it entered: from when fewer wedges were in than there are threads until memory let it in. 0 where memory
    /// grants a wedge to every thread.
    double memory_wait_s = 0;
    /// Wall less CPU seconds of its reads: disk, decompression by others, and whatever else kept the thread from running.
    double disk_wait_s = 0;
    std::uint64_t posts_read = 0, bytes_read = 0;
    std::uint64_t bytes_spilled = 0;  ///< read from a spill's file, as stored there: whole packed blocks
    std::uint64_t bytes_skipped = 0;  ///< decoded, of posts_skipped
    std::uint64_t chunks = 0;
    LevelPosts level_posts{};                               ///< of posts_read, by level of detail; not of reused wedges
    std::array<std::uint64_t, skip_count> posts_skipped{};  ///< of its chunks, by Skip; not read for this wedge
    std::uint64_t samples = 0;                              ///< samples of spokes taken
    std::uint64_t visible_pieces = 0;
    std::uint64_t refined_bins = 0;   ///< azimuth bins that were swept again, more densely
    std::uint64_t doubtful_bins = 0;  ///< of these, those still in doubt with the most spokes
    std::uint64_t bytes_again = 0;    ///< read for these, decoded; not in bytes_read
    std::size_t peak_bytes = 0;  ///< held by this wedge
    bool reused = false;         ///< found in the archive; all else is from the run that made it
};

/// A number of a wedge's report by its name in the JSON.
template <class Number>
struct WedgeFigure {
    const char* name;
    Number WedgeReport::*member;
};
/// What a kept wedge's report is made of, in the order of the work file.
inline constexpr WedgeFigure<double> wedge_seconds[] = {
    {"load", &WedgeReport::load_s},          {"sample", &WedgeReport::sample_s},
    {"sweep", &WedgeReport::sweep_s},        {"shade", &WedgeReport::shade_s},
    {"deposit", &WedgeReport::deposit_s},    {"merge", &WedgeReport::merge_s},
    {"wall", &WedgeReport::wall_s},          {"memory wait", &WedgeReport::memory_wait_s},
    {"disk wait", &WedgeReport::disk_wait_s}};
inline constexpr WedgeFigure<std::uint64_t> wedge_counts[] = {{"posts_read", &WedgeReport::posts_read},
                                                              {"bytes_read", &WedgeReport::bytes_read},
                                                              {"bytes_spilled", &WedgeReport::bytes_spilled},
                                                              {"bytes_skipped", &WedgeReport::bytes_skipped},
                                                              {"chunks", &WedgeReport::chunks},
                                                              {"samples", &WedgeReport::samples},
                                                              {"visible_pieces", &WedgeReport::visible_pieces},
                                                              {"refined_bins", &WedgeReport::refined_bins},
                                                              {"doubtful_bins", &WedgeReport::doubtful_bins},
                                                              {"bytes_again", &WedgeReport::bytes_again},
                                                              {"peak_bytes", &WedgeReport::peak_bytes}};

struct RunReport {
    std::vector<WedgeReport> wedges;
    std::array<std::uint64_t, state_count> states{};                              ///< cells of the states image by code
    double survey_s = 0, merge_s = 0, beam_s = 0, receiver_s = 0, display_s = 0;  ///< wall seconds
    double keep_s = 0;                  ///< wall seconds of all wedges' way into the archive, side by side
    std::size_t peak_budget_bytes = 0;  ///< granted at a time
    std::size_t peak_held_bytes = 0;    ///< counted at a time
    /// What the plan said, if nothing is left out.
    struct Planned {
        std::uint64_t wedges = 0, chunks = 0, posts = 0, bytes = 0;
        std::size_t peak_bytes = 0;
    } planned;
    int threads = 0;
    SourceReport source;
    Skipped skipped{};  ///< tiles that no wedge has read, by Skip
};

}  // namespace wedgescope
