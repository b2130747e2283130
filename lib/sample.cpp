#include "lib/sample.hpp"

#include <algorithm>
#include <limits>

#include "lib/lanes.hpp"

namespace wedgescope {
namespace {

constexpr double no_height = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t block = 256;

}  // namespace

WEDGESCOPE_LANES
void place_lanes(const SpokeMap::LinePiece& piece, double nadir_minor, double distance, std::int64_t spokes,
                 std::int64_t first, std::size_t n, const double* __restrict metres_per_post, double* __restrict minor,
                 double* __restrict arc_m) noexcept {
    const double inverse = 1.0 / static_cast<double>(spokes);  // a power of two: exact
    const double k0 = static_cast<double>(first);
    const double b0 = piece.bend[0], b1 = piece.bend[1], b2 = piece.bend[2], b3 = piece.bend[3], b4 = piece.bend[4];
    const double s0 = piece.stretch[0], s1 = piece.stretch[1], s2 = piece.stretch[2], s3 = piece.stretch[3],
                 s4 = piece.stretch[4];
    const double middle = piece.middle, scale = piece.scale;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double slope = (k0 + static_cast<double>(static_cast<int>(i))) * inverse;
        const double u = (slope - middle) * scale;
        const double bend = b0 + u * (b1 + u * (b2 + u * (b3 + u * b4)));
        const double stretch = s0 + u * (s1 + u * (s2 + u * (s3 + u * s4)));
        minor[i] = nadir_minor + slope * distance + bend;
        arc_m[i] = distance * metres_per_post[i] * (1 + stretch);
    }
}

WEDGESCOPE_LANES
void height_lanes(const LinePosts& line, std::size_t n, const double* __restrict minor,
                  double* __restrict height_m) noexcept {
    const float* __restrict posts = line.posts;
    const double begin = static_cast<double>(line.begin);
    const int last = static_cast<int>(line.end - line.begin) - 1;
    const double limit = static_cast<double>(last);
    if (last < 1) {
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < n; ++i) {
            const double y = minor[i] - begin;
            height_m[i] = last == 0 && y == 0 ? static_cast<double>(posts[0]) : no_height;
        }
        return;
    }
    // Three short loops a block: where (lanes), fetch (one by one), interpolate (lanes).
    int index[block];
    float a[block], b[block];
    for (std::size_t at = 0; at < n; at += block) {
        const std::size_t m = std::min(block, n - at);
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            const double y = minor[at + i] - begin;
            const int j = static_cast<int>(y >= 0 && y <= limit ? y : 0.0);
            index[i] = j < last ? j : last - 1;
        }
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            a[i] = posts[index[i]];
            b[i] = posts[index[i] + 1];
        }
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            const double y = minor[at + i] - begin;
            const double part = y - static_cast<double>(index[i]);
            const double za = static_cast<double>(a[i]), zb = static_cast<double>(b[i]);
            double z = za + part * (zb - za);
            z = part == 0 ? za : z;
            z = part == 1 ? zb : z;
            height_m[at + i] = y >= 0 && y <= limit ? z : no_height;
        }
    }
}

WEDGESCOPE_LANES
std::size_t cross_lanes(const LinePosts& behind, const LinePosts& ahead, std::size_t n,
                        const Crossing& crossing) noexcept {
    const double *__restrict minor = crossing.minor, *__restrict arc = crossing.arc_m, *__restrict height = crossing.height_m,
                 *__restrict major = crossing.major, *__restrict minor_to = crossing.minor_to,
                 *__restrict arc_to = crossing.arc_to_m;
    double *__restrict minor_out = crossing.minor_out, *__restrict arc_out = crossing.arc_out_m,
           *__restrict height_out = crossing.height_out_m, *__restrict major_out = crossing.major_out;
    const float* __restrict back = behind.posts, * __restrict front = ahead.posts;
    // Both windows are cut from one raster: a post missing from one lies outside it.
    const double back_begin = static_cast<double>(behind.begin), front_begin = static_cast<double>(ahead.begin);
    const double back_last = static_cast<double>(behind.end - 1 - behind.begin),
                 front_last = static_cast<double>(ahead.end - 1 - ahead.begin);
    const double from = crossing.major_from, way = crossing.major_to - crossing.major_from;
    int count = 0;
    int behind_index[block], ahead_index[block];
    float a[block], b[block];
    double parts[block], flags[block];
    for (std::size_t at = 0; at < n; at += block) {
        const std::size_t m = std::min(block, n - at);
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            const double y0 = minor[at + i], y1 = minor_to[at + i];
            // floor by truncation: positions are far below 2^31.
            const double t = static_cast<double>(static_cast<int>(y0));
            const double below = t > y0 ? t - 1 : t;  // floor(y0)
            const double above = t < y0 ? t + 1 : t;  // ceil(y0)
            const double c = y1 > y0 ? below + 1 : above - 1;
            const bool crosses = (y1 - c) * (y1 - y0) > 0;  // the same side: not yet passed
            // Part of the way from the line behind: the last sample may itself lie between the lines.
            const double step = crosses ? y1 - y0 : 1.0, ahead_m = crosses ? c - y0 : 0.0;
            const double share = ahead_m / step;
            const double done = (major[at + i] - from) / way;
            const double part = done + share * (1 - done);
            const double jb = c - back_begin, jf = c - front_begin;
            const bool inside = crosses & (jb >= 0) & (jb <= back_last) & (jf >= 0) & (jf <= front_last);
            behind_index[i] = static_cast<int>(inside ? jb : -1.0);
            ahead_index[i] = static_cast<int>(inside ? jf : 0.0);
            parts[i] = part;
            minor_out[at + i] = crosses ? c : y0;
            arc_out[at + i] = arc[at + i] + share * (arc_to[at + i] - arc[at + i]);
            major_out[at + i] = crosses ? from + part * way : major[at + i];
            flags[i] = crosses ? 1.0 : 0.0;
        }
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            const bool inside = behind_index[i] >= 0;
            a[i] = inside ? back[behind_index[i]] : std::numeric_limits<float>::quiet_NaN();
            count += flags[i] > 0;
            b[i] = front[ahead_index[i]];
        }
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            const double za = static_cast<double>(a[i]), zb = static_cast<double>(b[i]);
            const double z = za + parts[i] * (zb - za);
            height_out[at + i] = flags[i] > 0 ? z : height[at + i];
        }
    }
    return static_cast<std::size_t>(count);
}

WEDGESCOPE_LANES
void bump_lanes(const LinePosts& behind, const LinePosts& ahead, std::size_t n, double major_from, double major_to,
                const double* __restrict major0, const double* __restrict minor0, const double* __restrict major1,
                const double* __restrict minor1, double* __restrict bump_m) noexcept {
    // Both windows are cut from one raster, but not to the same posts.
    const std::int64_t begin = std::max(behind.begin, ahead.begin), end = std::min(behind.end, ahead.end);
    const double inverse = 1 / (major_to - major_from), first = static_cast<double>(begin),
                 last = static_cast<double>(end - begin - 2);
    if (last < 0) {
        for (std::size_t i = 0; i < n; ++i) bump_m[i] = 0;
        return;
    }
    const float* __restrict back = behind.posts + (begin - behind.begin);
    const float* __restrict front = ahead.posts + (begin - ahead.begin);
    int index[block];
    float twist[block];
    for (std::size_t at = 0; at < n; at += block) {
        const std::size_t m = std::min(block, n - at);
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            const double y = 0.5 * (minor0[at + i] + minor1[at + i]) - first;
            index[i] = static_cast<int>(y >= 0 && y < last + 1 ? y : 0.0);
        }
        for (std::size_t i = 0; i < m; ++i) {
            const float *a = back + index[i], *b = front + index[i];
            twist[i] = (b[1] - b[0]) - (a[1] - a[0]);
        }
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            const double y = 0.5 * (minor0[at + i] + minor1[at + i]) - first;
            const double way = (major1[at + i] - major0[at + i]) * inverse * (minor1[at + i] - minor0[at + i]);
            const double bump = -0.25 * static_cast<double>(twist[i]) * way;
            const bool known = (y >= 0) & (y < last + 1) & (bump == bump);
            bump_m[at + i] = known ? bump : 0.0;
        }
    }
}

}  // namespace wedgescope
