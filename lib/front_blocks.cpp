// What a front leaves out by the block: not read, for no spoke comes by or none would see it, or passed over in one step.
#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "lib/front.hpp"
#include "lib/post_extremes.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {
namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
// Of bounds for several spokes: the least curvature shows the most ground; what it changes beside is below 4e-6.
constexpr double together_margin = 1e-5;
constexpr float void_post = std::numeric_limits<float>::quiet_NaN();

/// The block, `side` posts wide, that a post, or the cell that begins with it, lies in.
std::int64_t block_along(std::int64_t post, std::int64_t side = block_posts) {
    return (post >= 0 ? post : post - side + 1) / side;
}

/// The block, `side` posts wide, of the cells that begin at line `from`, outwards, and its far border, or line `last`
/// before that.
struct CellsAhead {
    std::int64_t block, to;
};
CellsAhead cells_ahead(std::int64_t from, std::int64_t last, std::int64_t out, std::int64_t side = block_posts) {
    const std::int64_t block = block_along(out > 0 ? from : from - 1, side);
    return {block, out > 0 ? std::min((block + 1) * side, last) : std::max(block * side, last)};
}

}  // namespace

// ---- not read ----

ChunkRequest Front::request(Interval lines, BlockMap* map) const {
    const DataBase& db = *scene_->data_base;
    const bool columns = lines_are_columns(quadrant_);
    ChunkRequest request;
    if (live_begin_ >= live_end_) return request;
    const int level = request.level = scene_->grid->level(fan_, lines.begin);
    const std::int64_t first_spoke = run_->spokes[ring_].begin;
    request.window = scene_->grid->window(
        fan_, scene_->grid->rings(fan_)[ring_].spokes,
        {first_spoke + static_cast<std::int64_t>(live_begin_), first_spoke + static_cast<std::int64_t>(live_end_)},
        lines);
    request.lines_are_columns = columns;
    const Window& window = request.window;
    // Across the seam of a cyclic raster the blocks do not meet.
    if (!map || window.empty() || window.columns.begin < 0 || window.columns.end > db.columns) return request;
    request.blocks = blocks_of(window);
    // Blocks of a level are as many of its posts wide: the map's own coarser ones.
    const BlockWindow bounds = read_bounds(*map, level, request.blocks, db.columns, db.rows);
    const std::int64_t count = posts_at(columns ? db.rows : db.columns, level);
    const Interval majors = columns ? request.blocks.columns : request.blocks.rows,
                   minors = columns ? request.blocks.rows : request.blocks.columns;
    const auto index = [&](std::int64_t major, std::int64_t minor) {
        const std::int64_t column = columns ? major : minor, row = columns ? minor : major;
        return static_cast<std::size_t>((row - request.blocks.rows.begin) * request.blocks.columns.size() + column -
                                        request.blocks.columns.begin);
    };
    request.skip.assign(bounds.bounds.size(), Skip::range);
    request.fill_m.resize(bounds.bounds.size());
    for (std::size_t i = 0; i < bounds.bounds.size(); ++i)
        request.fill_m[i] = bounds.bounds[i].voids == Voids::all ? void_post : bounds.bounds[i].lowest_m;

    // A spoke stands for those between it and its neighbours, which a doubling may bring.
    const SpokeGrid& grid = *scene_->grid;
    const std::size_t n = live_end_ - live_begin_;
    std::vector<double> near_minor(n), near_arc(n), far_minor(n), far_arc(n);
    std::vector<SpokeMap::LinePiece> pieces;
    std::vector<std::uint8_t> may_gap(n);  // it may have met a void in this chunk
    for (std::size_t i = 0; i < n; ++i) may_gap[i] = is(live_begin_ + i, mode_gap);
    const std::int64_t out = outward(quadrant_), last = grid.line_index(fan_, lines.end - 1);
    std::int64_t line = lines.begin;
    places(line > 0 ? grid.distance(fan_, line - 1) : 0, level, live_begin_, live_end_, near_minor.data(),
           near_arc.data(), pieces);
    while (line < lines.end) {
        // The cells between the line behind and the block's far edge.
        const std::int64_t from = grid.line_index(fan_, line) - out;
        auto [block, to] = cells_ahead(from, last, out);
        line += (to - from) * out;
        // Before the first line stands no block: what counts is that line.
        if (!majors.contains(block)) block = block_along(to);
        places(grid.distance(fan_, line - 1), level, live_begin_, live_end_, far_minor.data(), far_arc.data(), pieces);
        const auto blocks_between = [&](double lo, double hi) {
            return Interval{block_along(floor_of(lo) - ChunkRequest::margin),
                            block_along(floor_of(hi) + 1 + ChunkRequest::margin) + 1};
        };
        const auto hide = [&](Skip& skip, double highest) {
            if (skip != Skip::hidden) skip = highest < scene_->smooth_sine ? Skip::horizon : Skip::hidden;
        };
        // Neighbours together first: nothing there that any of them could see, and no void.
        const auto all_hidden = [&](std::size_t first, std::size_t end) {
            double lo = infinite, hi = -infinite, near = infinite, far = 0, inverse = infinite, horizon = infinite;
            for (std::size_t i = first; i < end; ++i) {
                const std::size_t lane = live_begin_ + i;
                if (is(lane, mode_done) || near_arc[i] > scene_->max_arc_m * 1.001) continue;
                if (may_gap[i]) return false;
                const std::size_t before = i > 0 ? i - 1 : 0, after = std::min(i + 1, n - 1);
                lo = std::min({lo, near_minor[before], far_minor[before]});
                hi = std::max({hi, near_minor[after], far_minor[after]});
                near = std::min(near, near_arc[i]);
                far = std::max(far, far_arc[i]);
                inverse = std::min(inverse, lanes_.inverse_radius[lane]);
                horizon = std::min(horizon, lanes_.horizon[lane]);
            }
            if (lo > hi) return true;
            const Interval all = blocks_between(lo, hi);
            if (intersection(all, minors) != all || lo < 0 || hi > static_cast<double>(count - 1)) return false;
            std::array<double, 8> highest{};
            if (all.size() > static_cast<std::int64_t>(highest.size())) return false;
            for (std::int64_t j = all.begin; j < all.end; ++j) {
                const std::size_t at = index(block, j);
                const BlockBounds& b = bounds.bounds[at];
                if (b.voids != Voids::none) return false;
                if (request.skip[at] == Skip::none) continue;
                double& sine = highest[static_cast<std::size_t>(j - all.begin)];
                sine =
                    highest_sine(scene_->sensor_m, static_cast<double>(b.highest_m + b.culture_m), near, far, inverse) +
                    together_margin;
                if (sine >= horizon) return false;
            }
            for (std::int64_t j = all.begin; j < all.end; ++j) {
                Skip& skip = request.skip[index(block, j)];
                if (skip != Skip::none) hide(skip, highest[static_cast<std::size_t>(j - all.begin)]);
            }
            return true;
        };
        constexpr std::size_t together = 16;
        for (std::size_t i = 0; i < n; ++i) {
            if (i % together == 0 && all_hidden(i, std::min(i + together, n))) {
                i += together - 1;
                continue;
            }
            const std::size_t lane = live_begin_ + i;
            if (is(lane, mode_done) || near_arc[i] > scene_->max_arc_m * 1.001) continue;
            const std::size_t before = i > 0 ? i - 1 : 0, after = std::min(i + 1, n - 1);
            const double lo = std::min(near_minor[before], far_minor[before]),
                         hi = std::max(near_minor[after], far_minor[after]);
            const Interval all = blocks_between(lo, hi);
            const Interval inside = intersection(all, minors);
            // The raster's edge is the edge of a void.
            bool voids = may_gap[i] != 0 || inside != all || lo < 0 || hi > static_cast<double>(count - 1);
            for (std::int64_t j = inside.begin; j < inside.end; ++j)
                voids = voids || bounds.bounds[index(block, j)].voids != Voids::none;
            may_gap[i] = voids;
            for (std::int64_t j = inside.begin; j < inside.end; ++j) {
                const std::size_t at = index(block, j);
                Skip& skip = request.skip[at];
                if (skip == Skip::none) continue;
                const BlockBounds& b = bounds.bounds[at];
                if (b.voids == Voids::all) {
                    skip = Skip::voids;
                    continue;
                }
                const double highest = highest_sine(scene_->sensor_m, static_cast<double>(b.highest_m + b.culture_m),
                                                    near_arc[i], far_arc[i], lanes_.inverse_radius[lane]);
                if (voids || highest >= lanes_.horizon[lane]) {
                    skip = Skip::none;
                } else {
                    hide(skip, highest);
                }
            }
        }
        std::swap(near_minor, far_minor);
        std::swap(near_arc, far_arc);
    }
    return request;
}

// ---- passed over ----

void Front::ChunkBounds::set_up(const Chunk& chunk, bool columns) {
    const auto blocks = [&](Interval posts) {
        return posts.empty() ? Interval{0, 0}
                             : Interval{block_along(posts.begin, side), block_along(posts.end - 1, side) + 1};
    };
    major = blocks(columns ? chunk.window.columns : chunk.window.rows);
    minor = blocks(columns ? chunk.window.rows : chunk.window.columns);
    highest_m.assign(static_cast<std::size_t>(major.size() * minor.size()), void_post);
}

float Front::highest_in_chunk(const Chunk& chunk, ChunkBounds& bounds, std::int64_t major_block,
                              std::int64_t minor_block) const {
    float& bound = bounds.highest_m[static_cast<std::size_t>((major_block - bounds.major.begin) * bounds.minor.size() +
                                                             minor_block - bounds.minor.begin)];
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

bool Front::passes_alone(const Chunk& chunk, ChunkBounds& bounds, std::int64_t block, std::size_t begin,
                         std::size_t end) {
    for (std::size_t lane = begin, i = 0; lane < end; ++lane, ++i) {
        if (is(lane, mode_done)) continue;
        const std::int64_t first = block_along(floor_of(std::min(now_.minor[i], ahead_.minor[i])), bounds.side),
                           last = block_along(floor_of(std::max(now_.minor[i], ahead_.minor[i])) + 1, bounds.side);
        for (std::int64_t j = first; j <= last; ++j) {
            const auto highest = static_cast<double>(highest_in_chunk(chunk, bounds, block, j));
            if (!(highest < infinite) || highest_sine(scene_->sensor_m, highest, now_.arc[i], ahead_.arc[i],
                                                      lanes_.inverse_radius[lane]) >= lanes_.horizon[lane])
                return false;
        }
    }
    return true;
}

std::int64_t Front::leap(std::int64_t line, std::int64_t last, const Chunk& chunk, std::size_t begin, std::size_t end,
                         Between& between) {
    cost_.clock.enter(StageClock::sweep);
    std::int64_t passed = line - 1;
    for (ChunkBounds& bounds : chunk_bounds_)
        if (passed < line) passed = leap_block(line, last, chunk, bounds, begin, end, between);
    return passed;
}

std::int64_t Front::leap_block(std::int64_t line, std::int64_t last, const Chunk& chunk, ChunkBounds& bounds,
                               std::size_t begin, std::size_t end, Between& between) {
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
    const Interval all{block_along(floor_of(lo), bounds.side), block_along(floor_of(hi) + 1, bounds.side) + 1};
    if (far > scene_->max_arc_m || intersection(all, bounds.minor) != all || !along.contains(floor_of(lo)) ||
        !along.contains(floor_of(hi) + 1))
        return line - 1;
    // All together first.
    float highest = -static_cast<float>(infinite);
    for (std::int64_t j = all.begin; j < all.end; ++j)
        highest = std::max(highest, highest_in_chunk(chunk, bounds, block, j));
    const auto most = static_cast<double>(highest);
    if (!(most < infinite) || !(highest_sine(scene_->sensor_m, most, near, far, inverse) + together_margin < horizon ||
                                passes_alone(chunk, bounds, block, begin, end)))
        return line - 1;
    sample_line(line_of(chunk, chunk.surface_m, to), begin, end, 0, ahead_);
    std::swap(now_, ahead_);
    stale_ = false;
    between.behind = line_of(chunk, chunk.surface_m, to);
    between.behind_culture = line_of(chunk, chunk.culture_height_m, to);
    between.behind_major = static_cast<double>(to);
    cost_.samples += n;
    return target;
}

}  // namespace wedgescope
