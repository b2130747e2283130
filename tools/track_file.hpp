// Track file: a CSV table of times, places, altitudes and headings -> Track. Its form: docs/formats.md.
// Leaves where a sensor is between the rows to lib/track.hpp.
#pragma once
#include <string>

#include "lib/stop.hpp"
#include "lib/track.hpp"

namespace wedgescope {

/// Rows of a track at the most: what is held a row is held for all of them.
inline constexpr std::size_t most_track_rows = 100000;

/// Of all rows of a file without a column of headings.
struct ScenesHeading {
    Angle angle;
    std::string
        beside{};  ///< where it was given as one that holds beside the file, whose column is refused then; empty: it was not
};

/// InputError naming file, line, column, what was found and what is accepted; IoError.
Track read_track(const std::string& path, const ScenesHeading& heading, const Stop& stop);
/// The same of its content.
Track track_from(const std::string& path, std::istream& content, const ScenesHeading& heading);

}  // namespace wedgescope
