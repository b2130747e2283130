// Plan: how many wedges, how many in flight, and what they may hold, from the memory granted. Never changes a bit of
// the result. Leaves the work to engine.hpp.
#pragma once
#include <cstddef>
#include <vector>

#include "lib/engine.hpp"
#include "lib/spoke_grid.hpp"

namespace wedgescope {

struct Plan {
    std::vector<Interval> wedges;   ///< azimuth bins of each, in order; together the swept ones
    std::int64_t strip_lines = 64;  ///< lines of a chunk at the most; strips are aligned to raster indices
    int in_flight = 1;              ///< wedges at a time
    std::size_t fixed_bytes = 0;    ///< images and the source's cache
    std::size_t wedge_bytes = 0;    ///< the most one wedge in flight holds
};

/// InputError if not even one narrow wedge at a time fits, with the smallest budget that would do.
Plan plan(const ResolvedScene& scene, const WedgeSource& source, const SpokeGrid& grid, const EngineParams& params,
          int threads);

}  // namespace wedgescope
