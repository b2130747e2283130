// Sample: posts -> heights along spokes: where the spokes of one tile cross a line, and the other axis' lines before
// it. Leaves what is seen to sweep.hpp. Plain loops over contiguous arrays, compiled for several instruction sets.
#pragma once
#include <cstddef>
#include <cstdint>

#include "lib/spoke_map.hpp"

namespace wedgescope {

/// Posts of one line: post j of the raster is posts[j - begin]; NaN is void, what lies outside [begin, end) too.
struct LinePosts {
    const float* posts = nullptr;
    std::int64_t begin = 0, end = 0;

    bool has(std::int64_t j) const { return j >= begin && j < end; }
    float at(std::int64_t j) const { return posts[j - begin]; }
};

/// minor and arc of spokes first, first + 1, ... of K on a line: exactly SpokeMap::place.
///   metres_per_post[n]  in: f(m) of each spoke
///   minor[n], arc_m[n]  out: raster index along the line; metres
void place_lanes(const SpokeMap::LinePiece& piece, double nadir_minor, double distance, std::int64_t spokes,
                 std::int64_t first, std::size_t n, const double* metres_per_post, double* minor,
                 double* arc_m) noexcept;

/// Height of the bilinear surface where spokes cross a line: linear between two posts; NaN if one of the two is void
/// (only the post itself where the spoke hits it exactly).
void height_lanes(const LinePosts& line, std::size_t n, const double* minor, double* height_m) noexcept;

/// State of the spokes on the way from one line to the next, and where it comes out.
struct Crossing {
    const double *minor, *arc_m, *height_m, *major;            ///< in, [n]: the last sample
    const double *minor_to, *arc_to_m;                         ///< in, [n]: on the line ahead
    double major_from, major_to;                               ///< raster indices of the line behind and the line ahead
    double *minor_out, *arc_out_m, *height_out_m, *major_out;  ///< out, [n]
};
/// The next crossing of a line of the other axis strictly between the last sample and the line ahead; the last sample
/// itself where there is none. `behind` and `ahead`: posts of the two lines. Returns how many spokes had one.
std::size_t cross_lanes(const LinePosts& behind, const LinePosts& ahead, std::size_t n,
                        const Crossing& crossing) noexcept;

/// How far the bilinear surface stands above the straight line between two samples of one cell, half-way, metres: along
/// a straight way through a cell it is a parabola, lin(u) + bump 4 u (1 - u). 0 where a corner of the cell is missing
/// or there is no way between the samples.
void bump_lanes(const LinePosts& behind, const LinePosts& ahead, std::size_t n, double major_from, double major_to,
                const double* major0, const double* minor0, const double* major1, const double* minor1,
                double* bump_m) noexcept;

}  // namespace wedgescope
