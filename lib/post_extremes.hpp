// PostExtremes: the lowest and the highest of a rectangle of posts. Leaves what follows from it to front.cpp and
// coverage_hide.cpp, and what is kept of it to block_map.hpp.
#pragma once
#include <cstddef>
#include <limits>

namespace wedgescope {

struct PostExtremes {
    float lowest_m = std::numeric_limits<float>::infinity();  ///< of the valid ones; a zero is +0
    float highest_m = -std::numeric_limits<float>::infinity();
    std::size_t voids = 0;  ///< how many posts
};

/// Of lines of `width` posts, metres, NaN = void, that begin `stride` apart; fewer than 2^32 together.
PostExtremes post_extremes(const float* posts, std::size_t stride, std::size_t lines, std::size_t width) noexcept;

}  // namespace wedgescope
