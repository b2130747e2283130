// KeptDescription: what a kept spill was made for and of, the lines that stand in its index. For the .cpp files of this
// folder only. Leaves the blocks to spill.hpp and which scenes and rasters it fits to spilled_source.cpp.
#pragma once
#include <optional>
#include <string>

#include "lib/scene.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

class Spill;

struct KeptDescription {
    std::optional<LatLon> latlon;  ///< of the point; none: the terrain has no latitudes
    IndexPosition nadir;           ///< the point on the terrain's posts
    double culture_height_scale = 1;
    Extremes extremes;
    std::string files;  ///< lines "file ROLE ..." for each layer: what it is made of

    std::string lines() const;
    /// Of the files those of a layer.
    std::string files_of(const std::string& role) const;

    static KeptDescription of(const Spill& kept);
};

/// Less than a post apart in column and row.
bool same_point(const IndexPosition& a, const IndexPosition& b);

}  // namespace wedgescope
