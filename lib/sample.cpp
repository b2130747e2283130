#include "lib/sample.hpp"

#include "lib/lanes.hpp"

namespace wedgescope {
namespace {

WEDGESCOPE_LANES_PART void place(const SpokeMap::LinePiece& piece, double nadir_minor, double distance,
                                 std::size_t n, const double* __restrict slopes,
                                 const double* __restrict metres_per_post, double* __restrict minor,
                                 double* __restrict arc_m) noexcept {
    const double b0 = piece.bend[0], b1 = piece.bend[1], b2 = piece.bend[2], b3 = piece.bend[3], b4 = piece.bend[4];
    const double s0 = piece.stretch[0], s1 = piece.stretch[1], s2 = piece.stretch[2], s3 = piece.stretch[3],
                 s4 = piece.stretch[4];
    const double middle = piece.middle, scale = piece.scale;
    if (piece.straight()) {  // the same numbers sooner
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < n; ++i) {
            minor[i] = nadir_minor + slopes[i] * distance;
            arc_m[i] = distance * metres_per_post[i];
        }
        return;
    }
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double slope = slopes[i];
        const double u = (slope - middle) * scale;
        const double bend = b0 + u * (b1 + u * (b2 + u * (b3 + u * b4)));
        const double stretch = s0 + u * (s1 + u * (s2 + u * (s3 + u * s4)));
        minor[i] = nadir_minor + slope * distance + bend;
        arc_m[i] = distance * metres_per_post[i] * (1 + stretch);
    }
}

WEDGESCOPE_LANES_PART void mix(std::size_t n, double from, double to, const double* __restrict part,
                               double* __restrict out) noexcept {
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) out[i] = from + part[i] * (to - from);
}

WEDGESCOPE_LANES_PART int beyond_or_in(std::size_t n, const double* arc_m, double most_m, const double* mode,
                                       double in) noexcept {
    int count = 0;
    for (std::size_t i = 0; i < n; ++i) count += (arc_m[i] > most_m) | (mode[i] == in) ? 1 : 0;
    return count;
}

WEDGESCOPE_LANES_PART int cross(std::size_t n, const Crossing& crossing) noexcept {
    const double *__restrict part = crossing.part, *__restrict minor = crossing.minor, *__restrict arc = crossing.arc_m,
                 *__restrict minor_to = crossing.minor_to, *__restrict arc_to = crossing.arc_to_m;
    double *__restrict part_out = crossing.part_out, *__restrict minor_out = crossing.minor_out,
           *__restrict arc_out = crossing.arc_out_m;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double y0 = minor[i], y1 = minor_to[i];
        // floor by truncation: positions are far below 2^31.
        const double t = static_cast<double>(static_cast<int>(y0));
        const double below = t > y0 ? t - 1 : t;  // floor(y0)
        const double above = t < y0 ? t + 1 : t;  // ceil(y0)
        const double c = y1 > y0 ? below + 1 : above - 1;
        const bool crosses = (y1 - c) * (y1 - y0) > 0;  // the same side: not yet passed
        const double share = crosses ? (c - y0) / (y1 - y0) : 0.0;
        // The last sample may itself lie between the lines.
        part_out[i] = part[i] + share * (1 - part[i]);
        minor_out[i] = crosses ? c : y0;
        arc_out[i] = arc[i] + share * (arc_to[i] - arc[i]);
    }
    int count = 0;
    for (std::size_t i = 0; i < n; ++i) count += minor_out[i] != minor[i] ? 1 : 0;
    return count;
}

}  // namespace

LinePosts no_posts() { return {&no_post, 0, 0}; }

void place_lanes(const SpokeMap::LinePiece& piece, double nadir_minor, double distance, std::size_t n,
                 const double* slope, const double* metres_per_post, double* minor, double* arc_m) noexcept {
    on_target<place>(piece, nadir_minor, distance, n, slope, metres_per_post, minor, arc_m);
}

void between_lanes(std::size_t n, double from, double to, const double* part, double* out) noexcept {
    on_target<mix>(n, from, to, part, out);
}

int count_beyond_or_in(std::size_t n, const double* arc_m, double most_m, const double* mode, double in) noexcept {
    return on_target<beyond_or_in>(n, arc_m, most_m, mode, in);
}

int cross_lanes(std::size_t n, const Crossing& crossing) noexcept { return on_target<cross>(n, crossing); }

}  // namespace wedgescope
