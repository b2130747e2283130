// Limits: what this machine does at the most, measured, and how far the stages of a run stay behind it.
// Leaves counting what a run did to its report.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace wedgescope {

/// Bytes a second. Memory, decoding: of one thread. Each is the best of several tries.
struct Limits {
    double memory = 0;  ///< reading along a buffer of `buffer_bytes` and adding it up
    double file = 0;    ///< reading a file that the system holds in memory
    double decode = 0;  ///< ZSTD tiles of 256 x 256 whole numbers of 16 bits, differences and all, as they come out
    double write = 0;   ///< writing a new file, not waited for
};
/// About a tenth of a second for 32 MiB. A file of that size stands in `folder` (empty: temporary_folder()) for as long
/// as it takes; IoError, which names the folder as what it was given as.
Limits measure_limits(const std::string& folder, std::size_t buffer_bytes, const char* given_as = "temp-dir");

/// What a stage did, and the least that it moves: its limit is the time that this takes at the machine's best.
struct StageWork {
    enum Bound { memory, file, decode, write };
    std::string name;
    double seconds = 0;
    double bytes = 0;
    Bound bound = memory;
};
/// A line for each stage that took time: seconds, bytes, bytes a second, the limit and what share of the time it would
/// take there; and a line of the limits themselves. Lines of at most 140 characters.
std::string limits_table(const std::vector<StageWork>& stages, const Limits& limits);
/// Alone the line of limits.
std::string limits_line(const Limits& limits);

}  // namespace wedgescope
