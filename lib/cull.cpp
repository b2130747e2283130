#include "lib/cull.hpp"

#include <cstdint>
#include <limits>

#include "lib/lanes.hpp"

namespace wedgescope {
namespace {

constexpr std::size_t most_cells = 2 * PassingLanes::most;

/// Of n cells in a row the highest of the four posts; +inf where one is void. Posts: n + 1 a line.
WEDGESCOPE_LANES_PART void highest_corners(std::size_t n, const float* __restrict behind, const float* __restrict ahead,
                                           float* __restrict highest) noexcept {
    WEDGESCOPE_INDEPENDENT
    for (std::size_t j = 0; j < n; ++j) {
        const float b0 = behind[j], b1 = behind[j + 1], a0 = ahead[j], a1 = ahead[j + 1];
        const float b = b0 > b1 ? b0 : b1, a = a0 > a1 ? a0 : a1, all = b0 + b1 + a0 + a1;
        const float highest_post = a > b ? a : b;
        highest[j] = all == all ? highest_post : std::numeric_limits<float>::infinity();
    }
}

/// How many of n spokes are neither hidden nor done.
WEDGESCOPE_LANES_PART int not_hidden(std::size_t n, const double* __restrict mode) noexcept {
    int count = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const double hidden = mode[i] == mode_hidden ? 1.0 : 0.0, done = mode[i] == mode_done ? 1.0 : 0.0;
        count += hidden + done > 0 ? 0 : 1;
    }
    return count;
}

/// The cells, counted from `first`, that spokes are in on either line; how many are in none of the `cells`, or may run
/// through a third one in between.
WEDGESCOPE_LANES_PART int find_cells(std::size_t n, double first, double cells, const double* __restrict minor0,
                                     const double* __restrict minor1, std::int32_t* __restrict cell0,
                                     std::int32_t* __restrict cell1) noexcept {
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double y0 = minor0[i] - first, y1 = minor1[i] - first;
        const double t0 = static_cast<double>(static_cast<int>(y0)), t1 = static_cast<double>(static_cast<int>(y1));
        cell0[i] = static_cast<std::int32_t>(t0 > y0 ? t0 - 1 : t0);
        cell1[i] = static_cast<std::int32_t>(t1 > y1 ? t1 - 1 : t1);
    }
    const auto end = static_cast<std::int32_t>(cells);
    int count = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const std::int32_t a = cell0[i], b = cell1[i], low = a < b ? a : b, high = a < b ? b : a;
        count += (low < 0) | (high >= end) | (high - low > 1) ? 1 : 0;
    }
    return count;
}

/// How many of n spokes may come to see ground of at most `top`.
WEDGESCOPE_LANES_PART int may_see(std::size_t n, double sensor_m, const float* __restrict top,
                                  const PassingLanes& lanes) noexcept {
    const double *__restrict arc0 = lanes.arc0_m, *__restrict arc1 = lanes.arc1_m, *__restrict mode = lanes.mode,
                 *__restrict horizon = lanes.horizon, *__restrict inverse_radius = lanes.inverse_radius;
    int count = 0;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        // As sight_line(): the earth sinks least at the near end, and up grows with the height; sinc lies between
        // 1 - theta^2 / 6 and 1, versine above 1 - theta^2 / 12. A bump counts in full where up grows by 1 - theta^2 / 2
        // of the height only: 2000 x is that of a bump of 4000 m, a cell between posts 16 km apart in height.
        const double h = static_cast<double>(top[i]), s = horizon[i], inverse = inverse_radius[i];
        const double theta = arc0[i] * inverse, x = theta * theta, growth = 1 + h * inverse;
        const double up = (h - sensor_m) - 0.5 * arc0[i] * theta * (1 - x * (1.0 / 12)) * growth + 2000 * x;
        // Below the horizon's ray: up / sqrt(up^2 + out^2) < s, by squares that keep their sign. Looking down the far end
        // counts, looking up the near one. Ground lower than `top` lies nearer, but sinks more below the ray than that;
        // 0.1 % are for rounding and bumps.
        const double farther = growth > 1 ? growth : 1.0, nearer = growth < 1 ? growth : 1.0, far = arc1[i] * farther,
                     near = arc0[i] * (1 - x * (1.0 / 6)) * 0.999 * nearer, out = s < 0 ? far : near;
        const double up_square = up * (up < 0 ? -up : up) * (1 - s * s), ray_square = s * (s < 0 ? -s : s) * out * out;
        const double size = (up_square < 0 ? -up_square : up_square) + (ray_square < 0 ? -ray_square : ray_square);
        const double above = up_square < ray_square - 1e-9 * size ? 0.0 : 1.0, live = mode[i] == mode_done ? 0.0 : 1.0;
        count += above * live > 0 ? 1 : 0;
    }
    return count;
}

WEDGESCOPE_LANES_PART bool pass(std::size_t n, double sensor_m, const LinePosts& behind, const LinePosts& ahead,
                                const PassingLanes& lanes) noexcept {
    // Neighbours stand in order, but for what a bend may do: each is looked at again.
    const double low = std::min({lanes.minor0[0], lanes.minor1[0], lanes.minor0[n - 1], lanes.minor1[n - 1]}),
                 high = std::max({lanes.minor0[0], lanes.minor1[0], lanes.minor0[n - 1], lanes.minor1[n - 1]});
    const double least = std::floor(low), cells = std::floor(high) - least + 1;
    if (!(cells <= static_cast<double>(most_cells))) return false;
    const auto first = static_cast<std::int64_t>(least), last = first + static_cast<std::int64_t>(cells) - 1;
    if (!behind.has(first) || !behind.has(last + 1) || !ahead.has(first) || !ahead.has(last + 1)) return false;
    std::int32_t cell0[PassingLanes::most], cell1[PassingLanes::most];
    if (find_cells(n, least, cells, lanes.minor0, lanes.minor1, cell0, cell1)) return false;
    float highest[most_cells], top[PassingLanes::most];
    highest_corners(static_cast<std::size_t>(last - first + 1), behind.posts + (first - behind.begin),
                    ahead.posts + (first - ahead.begin), highest);
    for (std::size_t i = 0; i < n; ++i) {
        const float a = highest[cell0[i]], b = highest[cell1[i]];
        top[i] = a > b ? a : b;
    }
    return may_see(n, sensor_m, top, lanes) == 0;
}

}  // namespace

bool none_sees(std::size_t n, const double* mode) noexcept { return on_target<not_hidden>(n, mode) == 0; }

bool pass_hidden(std::size_t n, double sensor_m, const LinePosts& behind, const LinePosts& ahead,
                 const PassingLanes& lanes) noexcept {
    return on_target<pass>(n, sensor_m, behind, ahead, lanes);
}

}  // namespace wedgescope
