// Source choice: which source serves a data base best, by how its rasters are stored and what memory there is.
// Leaves opening and reading to sources.hpp.
#pragma once
#include <cstddef>
#include <memory>
#include <string>

#include "tiles/sources.hpp"

namespace wedgescope {

/// direct_for_memory: chosen where what automatic takes would not fit.
enum class SourceKind { automatic, direct, spilled, direct_for_memory };
struct SourceChoice {
    bool spilled = false;
    bool kept = false;  ///< spilled, by a kept spill in the tile store
    std::string why;    ///< "tiles of 256 x 256", ...
    std::string
        unfit;  ///< why a kept spill that stands in the tile store does not serve the scene; empty: there is none
    bool only_faster = false;  ///< spilled, but windows would do
};
/// A kept spill that fits; else direct for what fits into the cache and for what windows read well, spilled for the rest;
/// unless `asked`. DataError, IoError for a kept spill that is damaged.
SourceChoice choose_source(const DataBaseParams& params, SourceKind asked, const Scene& scene,
                           std::size_t memory_bytes);
/// Opens what was chosen.
std::unique_ptr<WedgeSource> open_source(const SourceChoice& choice, const DataBaseParams& params, const Scene& scene,
                                         const SpillOptions& options);

}  // namespace wedgescope
