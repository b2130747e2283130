// PostExtremes: the lowest and the highest of a rectangle of posts. Leaves what is kept of them to block_map.hpp.
#pragma once
#include <algorithm>
#include <cstddef>
#include <limits>

#include "lib/interval.hpp"

namespace wedgescope {

struct PostExtremes {
    float lowest_m = std::numeric_limits<float>::infinity();  ///< of the valid ones; a zero is +0
    float highest_m = -std::numeric_limits<float>::infinity();
    std::size_t voids = 0;  ///< how many posts

    void add(const PostExtremes& other) {
        lowest_m = std::min(lowest_m, other.lowest_m);
        highest_m = std::max(highest_m, other.highest_m);
        voids += other.voids;
    }
};

/// Of lines of `width` posts, metres, NaN = void, that begin `stride` apart; fewer than 2^32 together.
PostExtremes post_extremes(const float* posts, std::size_t stride, std::size_t lines, std::size_t width) noexcept;

/// Of a part of a window's posts, which lie row after row; nothing of an empty one.
inline PostExtremes post_extremes(const float* posts, const Window& given, const Window& part) noexcept {
    if (part.empty()) return {};
    return post_extremes(posts + given.at(part.columns.begin, part.rows.begin),
                         static_cast<std::size_t>(given.columns.size()), static_cast<std::size_t>(part.rows.size()),
                         static_cast<std::size_t>(part.columns.size()));
}

}  // namespace wedgescope
