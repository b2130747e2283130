// Coverage: what the sensor sees on the raster's own posts: states, and how high, far and steep they lie.
// Leaves which posts there are and how they are read to wedge_source.hpp, and files to tiles.
//
// The four quadrants advance together, strip by strip: a strip is the lines of one column (row) of output tiles. Its
// spokes are cut into runs that share nothing, so runs are the unit of reading and of threads. A tile is
// handed out when all its posts are known; only those that a diagonal cuts wait for another quadrant's strip.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>

#include "lib/engine.hpp"
#include "lib/spoke_grid.hpp"
#include "lib/timeline.hpp"

namespace wedgescope {

/// What a raster of coverage holds. mask: Byte; states: Byte, codes of State; the others Float32, NaN where there is no
/// data or where the post is outside the limits.
///   height      metres that a post (with its target height) would have to be raised to be seen; 0 where it is seen
///   range       slant range, m
///   grazing     deg, of the ray on the post's own cell, the one on the sensor's side; below 0 on a back slope
///   depression  deg, at the sensor, positive down
///   response    dBm at the receiver from the post's own patch of ground, one post by one, at the azimuth peak of the beam,
///               before beam and pulse: K g_el^2 sigma / (r^4 L_a), sigma = sigma0(psi_l) times the patch's true area. The facet
///               is that of `grazing`; where culture stands on the post it is a wall. NaN also where the post is not seen or shows
///               its back. Posts near the sensor and without culture heights sum to the echo image's total: a patch's area is that of posts
///               at the sensor, and the sweep takes each cell with culture on a corner for a wall.
enum class CoverageLayer { mask, states, height, range, grazing, depression, response };
constexpr bool is_bytes(CoverageLayer layer) { return layer == CoverageLayer::mask || layer == CoverageLayer::states; }

/// Values of the mask.
struct MaskValues {
    std::uint8_t seen = 255, hidden = 0, no_data = 1, outside = 1;
};

struct CoverageParams {
    CoverageLayer layer = CoverageLayer::mask;
    MaskValues mask;
    double target_m = 0;  ///< raises the post tested, and no other
    /// Elevation angles at the sensor, positive up, that count; outside of them nothing is in view.
    std::optional<std::pair<Angle, Angle>> elevation;
    bool cull = true;  ///< neither read nor sweep what is known to stay hidden; changes no bit
    /// Hands out only the tiles that a spoke comes by: all others are outside.
    bool reached_only = false;
    int threads = 0;  ///< 0: all the machine has
    std::size_t memory_bytes = std::size_t{1} << 30;
    /// One of several side by side: it takes `threads` threads of those that the caller lets all of them have together, and
    /// leaves it to the caller to see whether the data base changed.
    bool beside_others = false;
    Stop* stop = nullptr;
    Timeline* timeline = nullptr;  ///< told of runs and of what is written
    /// Fingerprint of the data base before anything of it was read; none: as it is when the work begins.
    std::optional<std::uint64_t> data;
    std::function<void(double)> progress;  ///< called with 0..1 from one thread at a time
};

/// A tile of the output: `bytes` of mask and states, `values` of the others; rows lie `stride` posts apart, and there
/// are `edge` of them, also where the raster ends before.
struct CoverageTile {
    static constexpr std::int64_t edge = 256;  ///< posts a side; aligned to the raster, cut at its edges
    Window window;
    const std::uint8_t* bytes = nullptr;
    const float* values = nullptr;
    std::int64_t stride = 0;
    bool even = false;  ///< all posts hold the first one's byte or value
};

/// What the runs of a quadrant, the wedges of coverage, did and cost.
struct QuadrantReport {
    double load_s = 0, sweep_s = 0;                ///< CPU seconds
    double disk_wait_s = 0;                        ///< wall less CPU seconds of the reads
    std::uint64_t posts_read = 0, bytes_read = 0;  ///< with what neighbouring runs read twice
    std::uint64_t bytes_spilled = 0;               ///< read from a spill's file, as stored there: whole packed blocks
    std::uint64_t posts_passed = 0;                ///< neither swept nor tested: in blocks below every horizon
    std::uint64_t runs = 0;
    void add(const QuadrantReport& other) {
        load_s += other.load_s;
        sweep_s += other.sweep_s;
        disk_wait_s += other.disk_wait_s;
        posts_read += other.posts_read;
        bytes_read += other.bytes_read;
        bytes_spilled += other.bytes_spilled;
        posts_passed += other.posts_passed;
        runs += other.runs;
    }
};

struct CoverageReport {
    /// Posts of the raster by state. Unknown is told from seen only for the layer `states`; for all others, which do not
    /// carry the horizons of voids, what is unknown counts as seen.
    std::array<std::uint64_t, state_count> states{};
    std::array<QuadrantReport, 4> quadrants{};  ///< by Quadrant
    Skipped skipped{};                          ///< tiles that no run has read, by Skip
    SourceReport source;
    std::size_t peak_budget_bytes = 0;
    double write_s = 0;  ///< wall seconds of handing out tiles, beside the sweep
    double wall_s = 0;
    int threads = 0;
    QuadrantReport total() const {
        QuadrantReport sum;
        for (const QuadrantReport& q : quadrants) sum.add(q);
        return sum;
    }
    std::uint64_t seen() const {
        return states[static_cast<std::size_t>(State::seen)] + states[static_cast<std::size_t>(State::unknown)];
    }
};

/// Spokes a post and crossings of the other axis for a quality.
Sampling coverage_sampling(Quality quality);

/// As resolve(), but without a range all of the raster is in range. InputError, DataError.
ResolvedScene resolve_coverage(const Scene& scene, WedgeSource& source);

/// What cover() holds at the least, beside what the source does (its cache and a reader). DataError where posts are so coarse
/// that places would be off by more than one of them.
std::size_t coverage_bytes(const ResolvedScene& scene, WedgeSource& source, const CoverageParams& params);

/// InputError, saying the smallest that would do, if the budget is too small for cover(); DataError as coverage_bytes().
void check_coverage(const ResolvedScene& scene, WedgeSource& source, const CoverageParams& params);

/// Hands out each tile of the raster once (or those reached alone), in the order of the strips, from one thread at a time
/// (not the caller's).
/// The same bits for any number of threads, any budget. InputError if the budget is too small, before
/// any work; IoError, DataError (also where the data base changed while it was read: what was handed out is then worth
/// nothing); what `write` throws.
CoverageReport cover(const ResolvedScene& scene, WedgeSource& source, const CoverageParams& params,
                     const std::function<void(const CoverageTile&)>& write);

}  // namespace wedgescope
