// RunReport: what was done, how long it took and what it held, wedge by wedge.
// Leaves the JSON and the terminal table to tools/report_json.hpp.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "lib/polar.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

struct WedgeReport {
    std::int64_t index = 0;
    Interval azimuth_bins;
    double load_s = 0, sample_s = 0, sweep_s = 0, shade_s = 0, deposit_s = 0;  ///< CPU seconds
    double wall_s = 0;                                                         ///< from entering to merged
    std::uint64_t posts_read = 0, bytes_read = 0;
    std::uint64_t chunks = 0;
    std::array<std::uint64_t, skip_count> posts_skipped{};  ///< of its chunks, by Skip; not read for this wedge
    std::uint64_t samples = 0;  ///< samples of spokes taken
    std::uint64_t visible_pieces = 0;
    std::size_t peak_bytes = 0;  ///< held by this wedge
};

struct RunReport {
    std::vector<WedgeReport> wedges;
    std::array<std::uint64_t, state_count> states{};                              ///< cells of the states image by code
    double survey_s = 0, merge_s = 0, beam_s = 0, receiver_s = 0, display_s = 0;  ///< wall seconds
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
