// Plan: how many wedges, how many in flight, what they will read and may hold, from the memory granted; found by walking
// all chunks without reading any. Never changes a bit of the result. Leaves the work to engine.hpp.
#pragma once
#include <cstddef>
#include <vector>

#include "lib/engine.hpp"
#include "lib/spoke_grid.hpp"

namespace wedgescope {

/// What a wedge comes to.
struct WedgeForecast {
    std::uint64_t chunks = 0, posts = 0, bytes = 0;  ///< if nothing is left out; bytes as decoded
    std::uint64_t steps = 0;                         ///< of spokes from line to line
    double parts = 0;                                ///< of pieces below a low sensor, which the front cuts
    double likely_posts = 0, likely_bytes = 0;       ///< without what coarse bounds of the terrain hide
    std::size_t peak_bytes = 0;                      ///< cells, front, chunk and what reading it takes
    std::size_t lanes = 0;                           ///< spokes of two rings that the front has room for
    Window reach;                                    ///< that holds all that is read
};

/// What a run holds in images, from the echo to the power, and to the picture where one is drawn; and in the beam's weights where
/// these are more than the usual few MiB.
std::size_t image_bytes(const ResolvedScene& scene, bool draw = true);

struct Plan {
    std::vector<Interval> wedges;         ///< azimuth bins of each, in order; together the swept ones
    std::vector<WedgeForecast> forecast;  ///< of each
    std::int64_t strip_lines = 64;        ///< lines of a chunk at the most; strips are aligned to raster indices
    int in_flight = 1;                    ///< wedges at a time
    std::size_t fixed_bytes = 0;          ///< images and the source's cache
    std::size_t unfilled_bytes = 0;       ///< of these, what the cache will not fill
    std::size_t wedge_bytes = 0;          ///< the most one wedge in flight holds
    /// The most held at a time: the images and the largest wedges, of those that `done` says; empty: all.
    std::size_t peak_bytes(const std::vector<bool>& done = {}) const;
    WedgeForecast total(const std::vector<bool>& done = {}) const;  ///< of the same; peak_bytes as above
    /// CPU seconds of all threads together, from rates measured on one machine: a guess within a factor of two or three.
    double likely_seconds(bool all) const;
};

/// `look`: guess from coarse bounds of the terrain what is hidden, too.
/// InputError if not even one narrow wedge at a time fits, with the smallest budget that would do.
Plan plan(const ResolvedScene& scene, WedgeSource& source, const SpokeGrid& grid, const EngineParams& params,
          int threads, bool look = false);

}  // namespace wedgescope
