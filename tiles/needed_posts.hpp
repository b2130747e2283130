// NeededPosts: what a chunk request needs, post by post and rectangle by rectangle; and the chunk that is begun for it.
// For the .cpp files of this folder only. Leaves reading to raster_source.cpp and registered_layer.hpp.
#pragma once
#include <algorithm>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "lib/spoke_grid.hpp"
#include "lib/wedge_source.hpp"
#include "tiles/raster_layer.hpp"

namespace wedgescope {

/// What load() fills, still empty. std::out_of_range if the window is not inside the raster.
inline Chunk begun_chunk(const DataBase& data_base, const ChunkRequest& request) {
    const Window& window = request.window;
    if (window.empty() || window.rows.begin < 0 || window.rows.end > posts_at(data_base.rows, request.level) ||
        (!data_base.cyclic &&
         (window.columns.begin < 0 || window.columns.end > posts_at(data_base.columns, request.level))))
        throw std::out_of_range("load: window outside the raster");
    Chunk chunk;
    chunk.window = window;
    chunk.lines_are_columns = request.lines_are_columns;
    return chunk;
}

class NeededPosts {
public:
    explicit NeededPosts(const ChunkRequest& request) : request_(request) {}

    bool all() const { return request_.skip.empty(); }

    /// Skip::none if a post of the rectangle must be read; else the last of its blocks' reasons in the enumeration.
    Skip reason(const Window& posts) const {
        if (all()) return Skip::none;
        const Window near = blocks_near(posts), own = blocks_of(posts);
        Skip last = Skip::range;
        for (std::int64_t r = near.rows.begin; r < near.rows.end; ++r)
            for (std::int64_t c = near.columns.begin; c < near.columns.end; ++c) {
                const Skip why = at(c, r);
                if (why == Skip::none) return Skip::none;
                if (own.contains(c, r)) last = std::max(last, why);
            }
        return last;
    }

    /// Calls read(part) for parts of a rectangle, along its longer side, that hold all of its posts that must be read.
    template <class Read>
    void each_part(const Window& posts, Read&& read) const {
        if (all()) return read(posts);
        constexpr std::int64_t margin = ChunkRequest::margin;
        const bool along_rows = posts.rows.size() > posts.columns.size();
        const Interval along = along_rows ? posts.rows : posts.columns;
        const Window near = blocks_near(posts);
        const Interval blocks = along_rows ? near.rows : near.columns, beside = along_rows ? near.columns : near.rows;
        const auto counts = [&](std::int64_t b) {
            for (std::int64_t k = beside.begin; k < beside.end; ++k)
                if ((along_rows ? at(k, b) : at(b, k)) == Skip::none) return true;
            return false;
        };
        Interval part{};
        const auto take = [&] {
            if (!part.empty()) read(along_rows ? Window{posts.columns, part} : Window{part, posts.rows});
        };
        for (std::int64_t b = blocks.begin; b < blocks.end; ++b) {
            if (!counts(b)) continue;
            const Interval own = intersection({b * block_posts - margin, (b + 1) * block_posts + margin}, along);
            if (part.empty() || own.begin > part.end) {
                take();
                part = own;
            } else {
                part.end = own.end;
            }
        }
        take();
    }

    /// The same in rectangles that hold little else: of needed blocks side by side, and of rows of these that are alike. Two of them
    /// may share posts within the margin.
    template <class Read>
    void each_run(const Window& posts, Read&& read) const {
        if (all()) return read(posts);
        const Window near = blocks_near(posts);
        std::vector<Interval> runs, own;
        Interval rows{};
        const auto take = [&] {
            for (const Interval& run : runs) read(Window{grown(run, posts.columns), grown(rows, posts.rows)});
        };
        for (std::int64_t r = near.rows.begin; r < near.rows.end; ++r) {
            own.clear();
            for (std::int64_t c = near.columns.begin; c < near.columns.end; ++c) {
                if (at(c, r) != Skip::none) continue;
                if (own.empty() || own.back().end < c) own.push_back({c, c});
                own.back().end = c + 1;
            }
            if (own == runs && rows.end == r) {
                rows.end = r + 1;
                continue;
            }
            take();
            runs.swap(own);
            rows = {r, r + 1};
        }
        take();
    }

    /// Where posts lie in memory: that of a window's first column and row, and how far apart its lines are, which are rows or
    /// columns.
    struct Posts {
        float* first;
        std::int64_t stride;
        bool lines_are_columns;
    };

    /// Fills what need not be read of `posts`, a part of the request's window: with its block's fill height, or with `height_m`.
    void fill(const Window& posts, const Posts& to, std::optional<float> height_m = {}) const {
        if (all()) return;
        const Window blocks = intersection(blocks_of(posts), request_.blocks);
        for (std::int64_t r = blocks.rows.begin; r < blocks.rows.end; ++r)
            for (std::int64_t c = blocks.columns.begin; c < blocks.columns.end; ++c) {
                if (at(c, r) == Skip::none) continue;
                const auto put = [&](std::int64_t from, std::int64_t line, std::int64_t n) {
                    std::fill_n(to.first + line * to.stride + from, n, height_m.value_or(request_.fill_m[index(c, r)]));
                };
                if (to.lines_are_columns)
                    idle_posts(
                        posts.rows, posts.columns, r, c, [&](auto a, auto b) { return needed(b, a); }, put);
                else
                    idle_posts(
                        posts.columns, posts.rows, c, r, [&](auto a, auto b) { return needed(a, b); }, put);
            }
    }

private:
    /// Of the request, those that posts are in or within the margin of.
    Window blocks_near(const Window& posts) const {
        constexpr std::int64_t margin = ChunkRequest::margin;
        return intersection(blocks_of({{posts.columns.begin - margin, posts.columns.end + margin},
                                       {posts.rows.begin - margin, posts.rows.end + margin}}),
                            request_.blocks);
    }
    std::size_t index(std::int64_t c, std::int64_t r) const { return request_.blocks.at(c, r); }
    Skip at(std::int64_t c, std::int64_t r) const { return request_.skip[index(c, r)]; }
    bool needed(std::int64_t c, std::int64_t r) const {
        return request_.blocks.contains(c, r) && at(c, r) == Skip::none;
    }

    /// The posts in or within the margin of blocks.
    static Interval grown(Interval blocks, Interval within) {
        constexpr std::int64_t margin = ChunkRequest::margin;
        return intersection({blocks.begin * block_posts - margin, blocks.end * block_posts + margin}, within);
    }

    /// Calls put(from, line, n) for what need not be read of the block at `a` along the lines of posts and `b` across; needed(a, b) tells
    /// of its neighbours.
    template <class Needed, class Put>
    static void idle_posts(Interval along, Interval across, std::int64_t a, std::int64_t b, Needed&& needed,
                           Put&& put) {
        constexpr std::int64_t margin = ChunkRequest::margin;
        const Interval own_a = {a * block_posts, (a + 1) * block_posts},
                       own_b = {b * block_posts, (b + 1) * block_posts};
        // The lines that are in or near to the same blocks: of these, posts before and behind.
        for (const auto& [lines, near] : {std::pair{Interval{own_b.begin, own_b.begin + margin}, b - 1},
                                          std::pair{Interval{own_b.begin + margin, own_b.end - margin}, b},
                                          std::pair{Interval{own_b.end - margin, own_b.end}, b + 1}}) {
            const Interval own = intersection(lines, across);
            if (own.empty() || (near != b && needed(a, near))) continue;
            const bool before = needed(a - 1, b) || (near != b && needed(a - 1, near)),
                       behind = needed(a + 1, b) || (near != b && needed(a + 1, near));
            const std::int64_t from = std::max(own_a.begin + (before ? margin : 0), along.begin),
                               to = std::min(own_a.end - (behind ? margin : 0), along.end);
            if (from >= to) continue;
            for (std::int64_t line = own.begin; line < own.end; ++line)
                put(from - along.begin, line - across.begin, to - from);
        }
    }

    const ChunkRequest& request_;
};

/// Calls read(cells, needed) for the rectangles of a window's file tiles (at least as wide as a block each way):
/// those that are needed in runs side by side, or one by one, the others one by one. `reason(cells)`: Skip::none for what is needed.
template <class Reason, class Read, class Pass>
void for_each_tile_run(const RasterFacts& facts, const Window& window, Reason&& reason, Read&& read, Pass&& pass,
                       bool one_by_one = false) {
    const auto unit = [](std::int64_t tile) { return tile * ((block_posts + tile - 1) / tile); };
    const std::int64_t wide = unit(facts.unit_columns()), high = unit(facts.unit_rows());
    for (std::int64_t r = window.rows.begin; r < window.rows.end;) {
        const std::int64_t r_end = std::min(window.rows.end, (r / high + 1) * high);
        Interval run{0, 0};
        for (std::int64_t c = window.columns.begin; c < window.columns.end;) {
            const std::int64_t c_end = std::min(window.columns.end, (c / wide + 1) * wide);
            const Window tile{{c, c_end}, {r, r_end}};
            const Skip why = reason(tile);
            if (why == Skip::none) {
                run = run.empty() ? tile.columns : Interval{run.begin, c_end};
            } else {
                pass(tile, why);
            }
            c = c_end;
            if (!run.empty() && (why != Skip::none || c == window.columns.end || one_by_one)) {
                read(Window{run, {r, r_end}});
                run = {};
            }
        }
        r = r_end;
    }
}

}  // namespace wedgescope
