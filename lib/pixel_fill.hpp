// Pixel fill: cells painted on the pixels that their centres fall on, as a film recorder did, and the holes between them.
// Leaves interpolation, which has no holes, and grey levels to display.hpp.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "lib/display.hpp"
#include "lib/stop.hpp"

namespace wedgescope {

/// Received watts of each pixel of the frame, row after row: the mean over the cells whose centres fall on it, so that even
/// ground keeps its level where many share a pixel; below 0 where there is none: a hole. All cells of `received` count whose
/// middle lies in the display's range, those without an echo too (they hold noise): a shadow is painted black, not left
/// open. Sums in a fixed order; positions rounded to 2^-20 pixel.
std::vector<double> paint_cells(const ReceivedPower& received, const DisplaySetting& setting, const Frame& frame);

/// Gives each of these holes (places in `power_w`, row after row) the mean, in watts, of those of the eight pixels round it that
/// are no holes; then again, until none of them is left or none has such a neighbour. What is filled in one pass counts from
/// the next one on, so no order shows. Pixels that are no holes stay as they are. Interrupted, where `stop` says so.
void fill_holes(std::vector<double>& power_w, const Frame& frame, std::vector<std::uint32_t> holes,
                const Stop* stop = nullptr);

/// What they hold at the most.
inline constexpr std::size_t paint_bytes_a_pixel = sizeof(double) + sizeof(std::uint32_t);
inline constexpr std::size_t fill_bytes_a_pixel = 2 * sizeof(double) + 2 * sizeof(std::uint32_t) + sizeof(std::uint8_t);

}  // namespace wedgescope
