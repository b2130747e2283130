// Antenna file: elevation patterns from CSV files (docs/formats.md), and the same points as one word, so that what holds the
// parameters of a run needs no file beside it. Leaves what points may be to lib/sensor.hpp.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "lib/sensor.hpp"

namespace wedgescope {

/// Lines `depression_deg,gain_db`. `origin`: of messages, such as "--antenna". InputError naming file and line, what was found and
/// what is accepted; also where there is no such file (nothing but a word may have been meant). IoError.
std::vector<PatternPoint> read_antenna_file(const std::string& origin, const std::string& path);

/// "points:-10,-30;0,0;12.5,-3": reads back as the same points, to the bit.
std::string points_word(const std::vector<PatternPoint>& points);
bool is_points_word(std::string_view word);
/// InputError.
std::vector<PatternPoint> points_of_word(const std::string& origin, std::string_view word);

/// What `antenna` takes, for messages and help.
inline constexpr const char* antenna_accepted = "gaussian, csc2, cos-csc2 or a file of lines depression_deg,gain_db";

}  // namespace wedgescope
