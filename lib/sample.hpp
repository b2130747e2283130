// Sample: where the spokes of one tile cross a line, and the other axis' lines before it, and the posts round these
// places. Leaves what is seen to sweep.hpp. Plain loops over contiguous arrays, compiled for several instruction sets;
// the posts (cells.cpp) in Highway's operations.
#pragma once
#include <cstddef>
#include <cstdint>
#include <limits>

#include "lib/spoke_map.hpp"

namespace wedgescope {

/// Posts of one line: post j of the raster is posts[j - begin]; NaN is void, what lies outside [begin, end) too.
struct LinePosts {
    const float* posts = nullptr;
    std::int64_t begin = 0, end = 0;

    bool empty() const { return begin == end; }
    bool has(std::int64_t j) const { return j >= begin && j < end; }
    float at(std::int64_t j) const { return posts[j - begin]; }
};

/// The height of what lies outside.
inline constexpr float no_post = std::numeric_limits<float>::quiet_NaN();
/// A line that holds none.
LinePosts no_posts();

/// minor and arc of some spokes on a line: exactly SpokeMap::place.
///   slope[n], metres_per_post[n]  in: m and f(m) of each spoke
///   minor[n], arc_m[n]            out: raster index along the line; metres
void place_lanes(const SpokeMap::LinePiece& piece, double nadir_minor, double distance, std::size_t n,
                 const double* slope, const double* metres_per_post, double* minor, double* arc_m) noexcept;

/// out[n] = from + part[n] (to - from).
void between_lanes(std::size_t n, double from, double to, const double* part, double* out) noexcept;

/// How many of n spokes stand at arcs beyond `most_m` or are in the mode `in`.
int count_beyond_or_in(std::size_t n, const double* arc_m, double most_m, const double* mode, double in) noexcept;

/// Places of the spokes' last samples, of where they cross the line ahead, and what comes out. `part`: of the way from
/// the line behind (0) to the line ahead (1).
struct Crossing {
    const double *part, *minor, *arc_m;        ///< in, [n]: the last sample
    const double *minor_to, *arc_to_m;         ///< in, [n]: on the line ahead
    double *part_out, *minor_out, *arc_out_m;  ///< out, [n]
};
/// The next crossing of a line of the other axis strictly between the last sample and the line ahead; the last sample
/// itself where there is none. Returns how many spokes had one.
int cross_lanes(std::size_t n, const Crossing& crossing) noexcept;

/// The four posts round each piece: `cell` and the post after it, on the line behind and on the line ahead. What lies
/// outside a line's window is NaN.
struct CellLanes {
    double* cell;           ///< raster index along the lines
    float *behind, *ahead;  ///< heights, metres: [2 n], of `cell` and `cell` + 1
};
/// Of pieces from minor0 to minor1: of the cell that half-way lies in.
void cell_lanes(const LinePosts& behind, const LinePosts& ahead, std::size_t n, const double* minor0,
                const double* minor1, const CellLanes& out) noexcept;

/// From a to b, exactly these at 0 and 1, also where the other one is missing.
inline double linear(double a, double b, double part) {
    const double inside = a + part * (b - a), low = part == 0 ? a : inside;
    return part == 1 ? b : low;
}

}  // namespace wedgescope
