// Refine: which azimuth bins of a wedge were sampled too coarsely, by what each half of their spokes alone makes of them.
// Leaves how densely a sweep begins to spoke_grid.hpp (sampling), and sweeping to the engine.
//
// A bin whose only echo at some range is a glimpse of a crest, narrower than a few spokes are apart, may be off by many dB,
// and a picture of few bright cells by more than its quality promises; how many spokes the worst of them need nobody knows
// beforehand. But halves that disagree tell it. Bins in doubt are swept again with twice the spokes, up to three times.
// What a bin shows so hangs on its own echoes alone, never on a wedge, a budget or a thread.
#pragma once
#include <cstddef>
#include <limits>
#include <vector>

#include "lib/deposit.hpp"
#include "lib/interval.hpp"

namespace wedgescope {

struct ResolvedScene;
struct Scene;
struct Sampling;

struct Refinement {
    static constexpr int most_rounds = 3;
    static constexpr std::size_t pulse_bins = 4;  ///< range bins whose echoes arrive together
    /// A bin is in doubt where the RMS, over its bright cells (16 at least), of half the difference in dB of its halves is above
    /// this; cells where it is not above cell_db count 0. Infinite: no bin ever is.
    double least_db = std::numeric_limits<double>::infinity();
    double cell_db = 0;
    double floor_w = 0;  ///< added to both halves; bright is what stands above it
    /// Range bins at the begin that are not shown, and not looked at: a wider pulse asks for more of them.
    std::size_t lead_in = 0;
    bool on() const { return least_db < std::numeric_limits<double>::infinity(); }
};

/// False where the scene says so, or how many spokes there are.
bool refines(const Scene& scene);
/// How its cells take what falls into them.
inline WedgeCells::Halves halves_of(const Scene& scene) {
    return refines(scene) ? WedgeCells::Halves::apart : WedgeCells::Halves::together;
}
/// Off unless it refines. `sampling`: its own.
Refinement refinement_of(const ResolvedScene& scene, const Sampling& sampling);

/// Of these rows of cells whose halves are apart those in doubt, in order, neighbouring ones together.
std::vector<Interval> rows_in_doubt(const WedgeCells& cells, const std::vector<Interval>& among,
                                    const Refinement& refinement);

}  // namespace wedgescope
