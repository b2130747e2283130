// Doubts: what a user may take for an error of the program in a picture or layers that are right, for a remark.
// And what of a scene has no effect. Leaves saying it to the commands.
#pragma once
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "lib/engine.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

/// Kinds of doubt, as they stand in doubts().
enum Doubt : std::size_t {
    nothing_there,
    nothing_seen,
    nothing_lit,
    wide_bins,
    long_bins,
    strong_rain,
    error_unkept,
    no_level,
    low_rain,
    low_cloud,
    frozen_cloud,
    high_sensor,
    coarse_posts,
    inside_something,
    doubt_count
};

/// A line for each kind of doubt that there is about a run; empty: none. `pictured`: is there a picture of it to be seen?
std::array<std::string, doubt_count> doubts(const RunResult& result, bool pictured);
/// Those of them that coverage may have too: about the place, the earth's radius and coarse posts on it, and of a response about cloud.
std::vector<std::string> doubts_of_rays(const ResolvedScene& scene, bool response);
/// ", 1662.8 m above the terrain", or why that cannot be said; behind the sensor's height above the sea.
std::string above_terrain(const ResolvedScene& scene, const DataBase& data_base);

/// A line for each effect that a scene asks for and that changes nothing over a data base. `legend`: of its culture; none: not
/// known.
std::vector<std::string> idle_effects(const Scene& scene, const DataBase& data_base,
                                      const std::optional<Legend>& legend = {});
/// The same of receiver and display, which need no data base.
std::vector<std::string> idle_receiver(const ReceiverParams& receiver, const DisplayParams& display);

/// Why the lowest height of a terrain looks like the no-data value that it does not declare, and how to declare it; empty: it does
/// not. `terrain`: its path.
std::string undeclared_void(const std::string& terrain, double lowest_m);
/// A line for each doubt about the heights of a source after a run: undeclared_void, and what stands on the ground higher than
/// metres would have it, by what is known without reading posts and by some of those that were loaded. `culture_scale`: culture-height-scale.
std::vector<std::string> doubts_of_heights(const std::string& terrain, WedgeSource& source, double culture_scale);

}  // namespace wedgescope
