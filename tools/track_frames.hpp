// Track frames: the scenes of a track, one for each row, with the files of each.
// Leaves the file of rows to track_file.hpp, and what becomes of a frame to track.hpp.
#pragma once
#include <cstddef>
#include <functional>
#include <string>

#include "lib/engine.hpp"
#include "lib/track.hpp"
#include "tools/settings.hpp"

namespace wedgescope {

class TrackFrames {
public:
    /// Both must outlive it.
    TrackFrames(const Settings& settings, const Track& track);

    std::size_t size() const { return track_.size(); }
    const Track& track() const { return track_; }
    bool scans() const { return settings_.scan_step.has_value(); }

    /// As if the row's numbers and its files were given by their keys.
    Settings settings(std::size_t frame) const;

    // InputError, DataError and IoError as resolve() has them.

    ResolvedScene scene(std::size_t frame, WedgeSource& source) const { return resolve(scene(frame), source); }
    /// The groups of azimuths of a frame.
    Scan scan(std::size_t frame, const ResolvedScene& whole, WedgeSource& source) const;
    /// What the place of the last group would end the frame for.
    void check_scan(std::size_t frame, const ResolvedScene& whole, WedgeSource& source) const;
    /// What the engine sweeps at a time: the whole of it, or its first group.
    ResolvedScene first_part(const ResolvedScene& whole) const;
    /// All groups of a frame that scans.
    void for_each_part(std::size_t frame, const ResolvedScene& whole, WedgeSource& source,
                       const std::function<void(const ResolvedScene&)>& use) const;

    /// For messages: its line in the file, and its number.
    std::string words(std::size_t frame) const;

private:
    Scene scene(std::size_t frame) const;

    const Settings& settings_;
    const Track& track_;
    int digits_ = 4;  ///< of a frame's number in the names of files
};

}  // namespace wedgescope
