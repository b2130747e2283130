// What a front does not ask for: blocks of a chunk that no spoke comes by, or in which none would see anything.
#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "lib/front.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {
namespace {

constexpr float void_post = std::numeric_limits<float>::quiet_NaN();
constexpr std::size_t together = 16;        // spokes that are looked at together
constexpr std::size_t groups_together = 8;  // and before them so many groups

/// Spokes between their neighbours: what bounds all that any of them can see.
struct Group {
    double horizon = infinite, inverse_radius = infinite;  // the least
    double least_post_m = infinite, most_post_m = 0;       // metres a post
    bool live = false, may_gap = false;

    void add(const Group& other) {
        horizon = std::min(horizon, other.horizon);
        inverse_radius = std::min(inverse_radius, other.inverse_radius);
        least_post_m = std::min(least_post_m, other.least_post_m);
        most_post_m = std::max(most_post_m, other.most_post_m);
        live = live || other.live;
        may_gap = may_gap || other.may_gap;
    }
};

/// Where spokes are on a line.
struct Places {
    double distance = 0;
    std::vector<double> minor, arc_m;
    explicit Places(std::size_t count) : minor(count), arc_m(count) {}
};

}  // namespace

/// Goes through a request's blocks, one row (column) of them after the other, outwards. A spoke stands for those between it
/// and its neighbours, which a doubling may bring.
class Front::BlockSurvey {
public:
    BlockSurvey(const Front& front, const BlockWindow& bounds, ChunkRequest& request)
        : front_(front), grid_(*front.scene_->grid), bounds_(bounds), request_(request),
          columns_(request.lines_are_columns), majors_(columns_ ? request.blocks.columns : request.blocks.rows),
          minors_(columns_ ? request.blocks.rows : request.blocks.columns),
          posts_(posts_at(columns_ ? front.scene_->data_base->rows : front.scene_->data_base->columns, request.level)),
          post_(static_cast<double>(std::int64_t{1} << request.level)),
          sag_(grid_.map().sag(front.quadrant_, block_posts, post_)), first_(front.live_begin_),
          n_(front.live_end_ - front.live_begin_), groups_((n_ + together - 1) / together), known_(groups_.size()),
          may_gap_(n_), near_(n_), far_(n_), near_edges_(2 * groups_.size()), far_edges_(2 * groups_.size()) {
        for (std::size_t i = 0; i < n_; ++i) {
            const std::size_t lane = first_ + i;
            may_gap_[i] = front_.is(lane, mode_gap);
            const double post_m = front_.lanes_.metres_per_post[lane];
            if (!front_.is(lane, mode_done))
                groups_[i / together].add({front_.lanes_.horizon[lane], front_.lanes_.inverse_radius[lane], post_m,
                                           post_m, true, may_gap_[i] != 0});
        }
        for (std::size_t g = 0; g < groups_.size(); ++g)
            for (const std::size_t i : {before(g * together), after(end_of(g) - 1)}) {
                const double post_m = front_.lanes_.metres_per_post[first_ + i];
                edge_slope_.push_back(front_.lanes_.slope[first_ + i]);
                edge_post_m_.push_back(post_m);
                // What a doubling brings between a group and its neighbours is as long as they are.
                groups_[g].least_post_m = std::min(groups_[g].least_post_m, post_m);
                groups_[g].most_post_m = std::max(groups_[g].most_post_m, post_m);
            }
    }

    void operator()(Interval lines) {
        const Fan fan = front_.fan_;
        const std::int64_t out = outward(fan.quadrant), behind = grid_.line_index(fan, lines.begin) - out,
                           last = grid_.line_index(fan, lines.end - 1);
        std::int64_t line = lines.begin;
        find_edges(line > 0 ? grid_.distance(fan, line - 1) : 0, near_edges_);
        while (line < lines.end) {
            // The cells between the line behind and the block's far edge.
            const std::int64_t from = grid_.line_index(fan, line) - out;
            const auto [block, to] = cells_ahead(from, last, out);
            line += (to - from) * out;
            // Before the first line stands no block: what counts is that line.
            row_ = majors_.contains(block) ? block : block_along(to);
            find_edges(grid_.distance(fan, line - 1), far_edges_);
            look();
            if (from == behind) share_voids(from);
            if (to == last) share_voids(to);
            std::swap(near_, far_);
            std::swap(near_edges_, far_edges_);
        }
    }

private:
    static std::size_t before(std::size_t i) { return i > 0 ? i - 1 : 0; }
    std::size_t after(std::size_t i) const { return std::min(i + 1, n_ - 1); }
    std::size_t end_of(std::size_t group) const { return std::min((group + 1) * together, n_); }

    std::size_t index(std::int64_t minor) const { return index(row_, minor); }
    std::size_t index(std::int64_t major, std::int64_t minor) const {
        const std::int64_t column = columns_ ? major : minor, row = columns_ ? minor : major;
        return request_.blocks.at(column, row);
    }
    static Interval blocks_between(double lo, double hi) {
        return {block_along(floor_of(lo) - ChunkRequest::margin),
                block_along(floor_of(hi) + 1 + ChunkRequest::margin) + 1};
    }
    bool inside(double lo, double hi, Interval blocks) const {
        return intersection(blocks, minors_) == blocks && lo >= 0 && hi <= static_cast<double>(posts_ - 1);
    }
    double highest(const BlockBounds& b, double near_m, double far_m, double inverse_radius) const {
        return highest_sine(front_.scene_->sensor_m, static_cast<double>(b.highest_m + b.culture_m), near_m, far_m,
                            inverse_radius);
    }
    void hide(Skip& skip, double sine) const {
        if (skip != Skip::hidden) skip = sine < front_.scene_->smooth_sine ? Skip::horizon : Skip::hidden;
    }

    /// The chunk's first or last line may be the first one of blocks at which no spoke is looked at here: beside a block of
    /// nothing but voids, to whose bounds it belongs, it is one too, and a gap goes on there.
    void share_voids(std::int64_t line) {
        const std::int64_t beyond = block_along(line);
        if (beyond == row_ || !majors_.contains(beyond)) return;
        for (std::int64_t j = minors_.begin; j < minors_.end; ++j)
            if (bounds_.bounds[index(j)].voids == Voids::all) request_.fill_m[index(beyond, j)] = void_post;
    }

    /// Of the spokes beside each group on a line.
    void find_edges(double distance, Places& edges) {
        edges.distance = distance;
        grid_.map().line(front_.quadrant_, distance, edge_slope_.front(), edge_slope_.back(), pieces_);
        std::size_t at = 0;
        for (const SpokeMap::LinePiece& piece : pieces_) {
            std::size_t stop = at;
            while (stop < edge_slope_.size() && (&piece == &pieces_.back() || edge_slope_[stop] < piece.slope_end))
                ++stop;
            place_lanes(piece, grid_.map().nadir_minor(front_.quadrant_), distance, stop - at, edge_slope_.data() + at,
                        edge_post_m_.data() + at, edges.minor.data() + at, edges.arc_m.data() + at);
            at = stop;
        }
        for (double& minor : edges.minor) minor /= post_;
    }

    void look() {
        // Where spokes are is found one by one only if neighbours together say nothing.
        for (std::size_t begin = 0; begin < groups_.size(); begin += groups_together) {
            const std::size_t end = std::min(begin + groups_together, groups_.size());
            const bool hidden = none_sees_any(begin, end);
            for (std::size_t g = begin; g < end; ++g)
                if (hidden || none_sees_any(g, g + 1))
                    known_[g] = false;
                else
                    look_at_each(g);
        }
    }

    /// Is nothing there that any spoke of these groups could see, and no void? Then their blocks are hidden.
    bool none_sees_any(std::size_t begin, std::size_t end) {
        Group group;
        for (std::size_t g = begin; g < end; ++g) group.add(groups_[g]);
        if (!group.live) return true;
        if (group.may_gap) return false;
        // Between the outermost lie the others, to far less than the margin, and a group's stretch is like its neighbours'.
        double lo = infinite, hi = -infinite, least_stretch = infinite, most_stretch = -infinite;
        for (const Places* edges : {&near_edges_, &far_edges_})
            for (std::size_t i = 2 * begin; i < 2 * end; ++i) {
                lo = std::min(lo, edges->minor[i]);
                hi = std::max(hi, edges->minor[i]);
                if (edges->distance == 0) continue;
                const double stretch = edges->arc_m[i] / (edges->distance * edge_post_m_[i]);
                least_stretch = std::min(least_stretch, stretch);
                most_stretch = std::max(most_stretch, stretch);
            }
        const double spare = grid_.map().straight() ? 0 : most_stretch - least_stretch + 1e-4,
                     near_m = near_edges_.distance * group.least_post_m * (least_stretch - spare),
                     far_m = far_edges_.distance * group.most_post_m * (most_stretch + spare);
        if (far_m > front_.scene_->max_arc_m) return false;
        lo -= sag_;
        hi += sag_;
        const Interval all = blocks_between(lo, hi);
        std::array<double, 8> sine{};
        if (!inside(lo, hi, all) || all.size() > static_cast<std::int64_t>(sine.size())) return false;
        for (std::int64_t j = all.begin; j < all.end; ++j) {
            const std::size_t at = index(j);
            const BlockBounds& b = bounds_.bounds[at];
            if (b.voids != Voids::none) return false;
            if (request_.skip[at] == Skip::none) continue;
            double& most = sine[static_cast<std::size_t>(j - all.begin)];
            most = highest(b, near_m, far_m, group.inverse_radius) + together_margin;
            if (most >= group.horizon) return false;
        }
        for (std::int64_t j = all.begin; j < all.end; ++j) {
            Skip& skip = request_.skip[index(j)];
            if (skip != Skip::none) hide(skip, sine[static_cast<std::size_t>(j - all.begin)]);
        }
        return true;
    }

    void look_at_each(std::size_t g) {
        const std::size_t first = g * together, end = end_of(g);
        const auto find = [&](const Places& edges, Places& found) {
            const std::size_t begin = before(first);
            front_.places(edges.distance, request_.level, first_ + begin, first_ + after(end - 1) + 1,
                          found.minor.data() + begin, found.arc_m.data() + begin, pieces_);
        };
        if (!known_[g]) find(near_edges_, near_);
        find(far_edges_, far_);
        known_[g] = true;
        for (std::size_t i = first; i < end; ++i) {
            const std::size_t lane = first_ + i;
            if (front_.is(lane, mode_done) || near_.arc_m[i] > front_.scene_->max_arc_m * 1.001) continue;
            const double lo = std::min(near_.minor[before(i)], far_.minor[before(i)]) - sag_,
                         hi = std::max(near_.minor[after(i)], far_.minor[after(i)]) + sag_;
            const Interval all = blocks_between(lo, hi), some = intersection(all, minors_);
            // The raster's edge is the edge of a void.
            bool voids = may_gap_[i] != 0 || !inside(lo, hi, all);
            for (std::int64_t j = some.begin; j < some.end; ++j)
                voids = voids || bounds_.bounds[index(j)].voids != Voids::none;
            may_gap_[i] = voids;
            groups_[g].may_gap = groups_[g].may_gap || voids;
            for (std::int64_t j = some.begin; j < some.end; ++j) {
                const std::size_t at = index(j);
                Skip& skip = request_.skip[at];
                if (skip == Skip::none) continue;
                const BlockBounds& b = bounds_.bounds[at];
                if (b.voids == Voids::all) {
                    skip = Skip::voids;
                    continue;
                }
                const double sine = highest(b, near_.arc_m[i], far_.arc_m[i], front_.lanes_.inverse_radius[lane]);
                if (voids || sine >= front_.lanes_.horizon[lane])
                    skip = Skip::none;
                else
                    hide(skip, sine);
            }
        }
    }

    const Front& front_;
    const SpokeGrid& grid_;
    const BlockWindow& bounds_;
    ChunkRequest& request_;
    bool columns_;
    Interval majors_, minors_;  // blocks
    std::int64_t posts_;        // along the lines
    double post_;               // posts of the raster in one of the level
    double sag_;                // by how many posts a spoke leaves the straight way within a block
    std::int64_t row_ = 0;      // block of the cells that are looked at
    std::size_t first_, n_;     // lanes
    std::vector<Group> groups_;
    std::vector<std::uint8_t> known_;    // groups of which near_ holds where each spoke is
    std::vector<std::uint8_t> may_gap_;  // spokes that may have met a void in this chunk
    Places near_, far_;
    std::vector<double> edge_slope_, edge_post_m_;  // of the spokes before and behind each group: not quite in order
    Places near_edges_, far_edges_;
    std::vector<SpokeMap::LinePiece> pieces_;
};

ChunkRequest Front::request(Interval lines, BlockMap* map) {
    for (ChunkBounds& bounds : chunk_bounds_) bounds.highest_m.clear();
    const DataBase& db = *scene_->data_base;
    ChunkRequest request;
    if (live_begin_ >= live_end_) return request;
    request.level = scene_->grid->level(fan_, lines.begin);
    const std::int64_t first_spoke = run_->spokes[ring_].begin;
    request.window = scene_->grid->window(
        fan_, scene_->grid->rings(fan_)[ring_].spokes,
        {first_spoke + static_cast<std::int64_t>(live_begin_), first_spoke + static_cast<std::int64_t>(live_end_)},
        lines);
    request.lines_are_columns = lines_are_columns(quadrant_);
    const Window& window = request.window;
    // Across the seam of a cyclic raster the blocks do not meet.
    if (!map || window.empty() || window.columns.begin < 0 || window.columns.end > db.columns) return request;
    request.blocks = blocks_of(window);
    // Blocks of a level are as many of its posts wide: the map's own coarser ones.
    const BlockWindow bounds = read_bounds(*map, request.level, request.blocks, db.columns, db.rows);
    const std::size_t blocks = bounds.bounds.size();
    request.skip.assign(blocks, Skip::range);
    request.fill_m.resize(blocks);
    for (std::size_t at = 0; at < blocks; ++at)
        request.fill_m[at] = bounds.bounds[at].voids == Voids::all ? void_post : bounds.bounds[at].lowest_m;
    BlockSurvey(*this, bounds, request)(lines);
    ChunkBounds& found = chunk_bounds_[0];
    found.set_up(window, request.lines_are_columns);
    std::size_t i = 0;
    for (std::int64_t row = request.blocks.rows.begin; row < request.blocks.rows.end; ++row)
        for (std::int64_t column = request.blocks.columns.begin; column < request.blocks.columns.end; ++column, ++i) {
            const BlockBounds& b = bounds.bounds[i];
            float& highest = request.lines_are_columns ? found.at(column, row) : found.at(row, column);
            highest = static_cast<float>(b.voids != Voids::none          ? infinite
                                         : request.skip[i] != Skip::none ? -infinite
                                                                         : b.highest_m + b.culture_m);
        }
    return request;
}

}  // namespace wedgescope
