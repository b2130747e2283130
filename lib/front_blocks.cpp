// What a front passes over by the block, in one step.
#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "lib/front.hpp"
#include "lib/post_extremes.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {
namespace {

constexpr float not_looked_at = std::numeric_limits<float>::quiet_NaN();
constexpr float nothing_to_see = -std::numeric_limits<float>::infinity();

}  // namespace

void Front::ChunkBounds::set_up(const Window& window, bool columns) {
    major = blocks_along(columns ? window.columns : window.rows, side);
    minor = blocks_along(columns ? window.rows : window.columns, side);
    highest_m.assign(static_cast<std::size_t>(major.size() * minor.size()), not_looked_at);
}

float Front::highest_in_chunk(const Chunk& chunk, ChunkBounds& bounds, std::int64_t major_block,
                              std::int64_t minor_block) const {
    float& bound = bounds.at(major_block, minor_block);
    if (bound == bound) return bound;
    if (chunk.flat) return bound = chunk.surface_m[0];
    const bool columns = lines_are_columns(quadrant_);
    const auto posts = [&](std::int64_t block, Interval cut) {
        return intersection({block * bounds.side, (block + 1) * bounds.side + 1}, cut);
    };
    const Interval lines = posts(major_block, columns ? chunk.window.columns : chunk.window.rows),
                   along = posts(minor_block, columns ? chunk.window.rows : chunk.window.columns);
    if (lines.empty() || along.empty()) return bound = -static_cast<float>(infinite);
    // Lines lie in the raster's order.
    const LinePosts line = line_of(chunk, chunk.surface_m, lines.begin);
    const PostExtremes extremes =
        post_extremes(line.posts + (along.begin - line.begin), static_cast<std::size_t>(chunk.minor_count()),
                      static_cast<std::size_t>(lines.size()), static_cast<std::size_t>(along.size()));
    return bound = extremes.voids > 0 ? static_cast<float>(infinite) : extremes.highest_m;
}

double Front::sag_within(const ChunkBounds& bounds) const {
    return scene_->grid->map().sag(quadrant_, static_cast<double>(bounds.side), post_);
}

bool Front::passes_alone(const Chunk& chunk, ChunkBounds& bounds, std::int64_t block, std::size_t begin,
                         std::size_t end) {
    const double sag = sag_within(bounds);
    for (std::size_t lane = begin, i = 0; lane < end; ++lane, ++i) {
        if (is(lane, mode_done)) continue;
        const std::int64_t first = block_along(floor_of(std::min(now_.minor[i], ahead_.minor[i]) - sag), bounds.side),
                           last =
                               block_along(floor_of(std::max(now_.minor[i], ahead_.minor[i]) + sag) + 1, bounds.side);
        for (std::int64_t j = first; j <= last; ++j) {
            const auto highest = static_cast<double>(highest_in_chunk(chunk, bounds, block, j));
            if (highest == static_cast<double>(nothing_to_see)) continue;
            if (!(highest < infinite) || highest_sine(scene_->sensor_m, highest, now_.arc[i], ahead_.arc[i],
                                                      lanes_.inverse_radius[lane]) >= lanes_.horizon[lane])
                return false;
        }
    }
    return true;
}

std::int64_t Front::leap(std::int64_t line, std::int64_t last, const Chunk& chunk, std::size_t begin, std::size_t end) {
    cost_.clock.enter(StageClock::sweep);
    std::int64_t passed = leap_hidden(line, last, chunk, begin, end);
    for (ChunkBounds& bounds : chunk_bounds_)
        if (passed < line) passed = leap_block(line, last, chunk, bounds, begin, end);
    return passed;
}

std::int64_t Front::leap_hidden(std::int64_t line, std::int64_t last, const Chunk& chunk, std::size_t begin,
                                std::size_t end) {
    std::int64_t passed = line - 1;
    ChunkBounds& bounds = chunk_bounds_[0];
    const SpokeGrid& grid = *scene_->grid;
    const std::int64_t out = outward(quadrant_), last_index = grid.line_index(fan_, last);
    const Interval along = lines_are_columns(quadrant_) ? chunk.window.rows : chunk.window.columns;
    // Between the first spoke and the last lie the others, to far less than a post.
    const std::size_t n = end - begin;
    const double sag = sag_within(bounds);
    std::array<double, 2> near{now_.minor[0], now_.minor[n - 1]};
    for (std::int64_t next = line; next <= last;) {
        const std::int64_t from = grid.line_index(fan_, next) - out;
        const auto [block, to] = cells_ahead(from, last_index, out);
        const std::int64_t target = next + (to - from) * out - 1;
        const double distance = grid.distance(fan_, target);
        std::array<double, 2> far{};
        double arc = 0;
        for (std::size_t side = 0; side < 2; ++side) {
            const SpokeMap::Place place = grid.map().place(quadrant_, lanes_.slope[side ? end - 1 : begin], distance);
            far[side] = place.minor / post_;
            arc = std::max(arc, place.arc_m);
        }
        const std::int64_t lo = floor_of(std::min({near[0], near[1], far[0], far[1]}) - sag) - 1,
                           hi = floor_of(std::max({near[0], near[1], far[0], far[1]}) + sag) + 2;
        const Interval all{block_along(lo), block_along(hi) + 1};
        // Between these two spokes arcs are no longer by more.
        if (arc * 1.001 > scene_->max_arc_m || !bounds.major.contains(block) ||
            intersection(all, bounds.minor) != all || !along.contains(lo) || !along.contains(hi))
            break;
        bool hidden = true;  // one that nobody looked at is not
        for (std::int64_t j = all.begin; j < all.end; ++j) hidden = hidden && bounds.at(block, j) == nothing_to_see;
        if (!hidden) break;
        passed = target;
        next = target + 1;
        near = far;
    }
    if (passed < line) return passed;
    places(grid.distance(fan_, passed), level_, begin, end, now_.minor.data(), now_.arc.data(), line_pieces_);
    std::fill_n(now_.part.begin(), n, 0.0);
    stale_ = true;
    stand_on(grid.line_index(fan_, passed), &chunk);
    return passed;
}

std::int64_t Front::leap_block(std::int64_t line, std::int64_t last, const Chunk& chunk, ChunkBounds& bounds,
                               std::size_t begin, std::size_t end) {
    const SpokeGrid& grid = *scene_->grid;
    const std::int64_t out = outward(quadrant_), from = grid.line_index(fan_, line) - out;
    const auto [block, to] = cells_ahead(from, grid.line_index(fan_, last), out, bounds.side);
    // Tried where a block begins, and not for a few lines.
    constexpr std::int64_t least = 4;
    const std::int64_t away = out > 0 ? from - block * bounds.side : (block + 1) * bounds.side - from;
    if ((to - from) * out < least || (away != 0 && line != next_line_)) return line - 1;
    const std::size_t n = end - begin;
    const std::int64_t target = line + (to - from) * out - 1;
    places(grid.distance(fan_, target), level_, begin, end, ahead_.minor.data(), ahead_.arc.data(), line_pieces_);
    const Interval along = lines_are_columns(quadrant_) ? chunk.window.rows : chunk.window.columns;
    double lo = infinite, hi = -infinite, near = infinite, far = 0, inverse = infinite, horizon = infinite;
    for (std::size_t i = 0; i < n; ++i) {
        lo = std::min({lo, now_.minor[i], ahead_.minor[i]});
        hi = std::max({hi, now_.minor[i], ahead_.minor[i]});
        near = std::min(near, now_.arc[i]);
        far = std::max(far, ahead_.arc[i]);
        inverse = std::min(inverse, lanes_.inverse_radius[begin + i]);
        if (is(begin + i, mode_hidden)) horizon = std::min(horizon, lanes_.horizon[begin + i]);
    }
    const double sag = sag_within(bounds);
    lo -= sag;
    hi += sag;
    const Interval all{block_along(floor_of(lo), bounds.side), block_along(floor_of(hi) + 1, bounds.side) + 1};
    if (far > scene_->max_arc_m || intersection(all, bounds.minor) != all || !along.contains(floor_of(lo)) ||
        !along.contains(floor_of(hi) + 1))
        return line - 1;
    // All together first.
    float highest = -static_cast<float>(infinite);
    for (std::int64_t j = all.begin; j < all.end; ++j)
        highest = std::max(highest, highest_in_chunk(chunk, bounds, block, j));
    const auto most = static_cast<double>(highest);
    const bool hidden = highest == nothing_to_see;
    if (!(most < infinite) ||
        !(hidden || highest_sine(scene_->sensor_m, most, near, far, inverse) + together_margin < horizon ||
          passes_alone(chunk, bounds, block, begin, end)))
        return line - 1;
    stand_on(to, &chunk);
    sample_line(between_.behind, begin, end, 0, ahead_);
    swap(now_, ahead_);
    stale_ = false;
    cost_.samples += n;
    return target;
}

}  // namespace wedgescope
