// Track: simulate, once for every row of a track: one process, one data base, frames side by side, numbered files.
// Leaves the file of rows to track_file.hpp, a row's scene and files to track_frames.hpp, what is told of the frames to
// track_report.hpp and a frame's layers to layers.hpp.
//
// Lanes: each takes the next row, makes its frame in the memory of its last one, and hands the files to the one thread that
// puts them in place, row after row. There are as many lanes as threads where the memory grants each its images and a
// wedge; of fewer lanes each has several threads. So one frame is received, drawn and written while others are swept.
#pragma once
#include "lib/stop.hpp"
#include "tools/settings.hpp"

namespace wedgescope {

/// `start_s`: when the program began. Finished frames stay, whatever ends the run. InputError, DataError, IoError, Interrupted.
void simulate_track(const Settings& settings, double start_s, Stop& stop);

}  // namespace wedgescope
