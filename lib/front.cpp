#include "lib/front.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include "lib/lanes.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {

void Front::Samples::resize(std::size_t n) {
    for (auto array : arrays()) (this->*array).resize(n);
}

SampleLanes Front::Samples::lanes(std::size_t at) {
    return {part.data() + at, minor.data() + at, arc.data() + at,  height.data() + at, up.data() + at,
            out.data() + at,  range.data() + at, sine.data() + at, x.data() + at};
}

void Front::Lanes::resize(std::size_t n) {
    for (auto* v : {&slope, &metres_per_post, &mode, &horizon, &void_horizon, &mark_from, &gap_from, &gap_top,
                    &seen_least, &seen_most, &share0, &share1})
        v->resize(n);
    inverse_radius.resize(n);
    last.resize(n);
    row.resize(n);
    origin.resize(n);
    number.resize(n);
    std::iota(number.begin(), number.end(), 0);
}

Front::Front(const SweepScene& scene, const SpokeRun& run, WedgeCells& cells)
    : scene_(&scene), run_(&run), cells_(&cells), bins_per_metre_(1 / scene.range_bin_m),
      plain_ground_(!scene.data_base->has_culture && !scene.data_base->has_culture_height),
      needs_facets_(!scene.laws->constant()), directional_(scene.laws->directional()),
      shore_(scene.shore && scene.shore->on() ? scene.shore : nullptr),
      at_once_(shore_ || scene.with_depression || scene.data_base->has_culture_height),
      parts_wait_(!shore_ && !scene.with_depression), may_join_(plain_ground_ && parts_wait_ && !needs_facets_),
      quadrant_(run.quadrant), fan_(run.own_fan()), line_end_(scene.grid->line_count(fan_)),
      culture_(*scene.data_base, scene.source) {
    for (auto* samples : {&now_, &crossing_, &ahead_}) samples->resize(tile_lanes);
    for (auto* v : {&cell_, &bump_, &start_range_, &start_x_, &waiting_range_, &waiting_x_}) v->resize(tile_lanes);
    for (Plain* plain : {&plain_, &crossed_})
        for (auto* v : {&plain->rise, &plain->swing, &plain->sine0, &plain->code}) v->resize(tile_lanes);
    constexpr std::size_t most_pieces = whole_registers(VisiblePieces::most);
    for (auto* v : {&power_, &facet_, &inverse_radius_, &across_, &slant_}) v->resize(most_pieces);
    bow_.resize(most_pieces);
    gamma_[2].assign(most_pieces, static_cast<float>(scene.laws->gamma()[scene.data_base->default_class].ground));
    if (!plain_ground_) {
        for (auto* v : {&gamma_[0], &gamma_[1]}) v->resize(most_pieces);
        class_gammas_.assign(2 * (std::size_t{unknown_class} + 1), -1.0F);
        for (std::size_t id = 0; id < std::min<std::size_t>(unknown_class, scene.laws->gamma().size()); ++id) {
            class_gammas_[2 * id] = static_cast<float>(scene.laws->gamma()[id].ground);
            class_gammas_[2 * id + 1] = static_cast<float>(scene.laws->gamma()[id].wall);
        }
    }
    // On average of the two diagonals, that of the axes: f(+-1)^2 = major^2 + minor^2 -+ what they lean.
    const SpokeMap& map = scene.grid->map();
    const auto square = [&](double slope) { return std::pow(map.metres_per_post(quadrant_, slope), 2); };
    minor_post_m_ = std::sqrt(0.5 * (square(1) + square(-1)) - square(0));
    long_post_m_ = std::max(map.metres_per_post(quadrant_, 0), minor_post_m_);
    if (scene.laws->most_turn() < infinite) {
        const double below_m =
                         scene.nadir_surface_m == scene.nadir_surface_m ? scene.nadir_surface_m : scene.reference_m,
                     height_m = std::max(1.0, scene.sensor_m - below_m);
        // On level ground D away a post turns by post h^2 / (h^2 + D^2)^(3/2); where the ground rises by more, so up to twice that.
        // Half as far again where it falls away; no farther than upright_sine.
        const double slant_m = std::cbrt(2 * long_post_m_ * height_m * height_m / scene.laws->most_turn());
        if (slant_m > height_m)
            turning_posts_ = std::ceil(1.5 * std::min(height_m, std::sqrt(slant_m * slant_m - height_m * height_m)) /
                                       std::min(minor_post_m_, map.metres_per_post(quadrant_, 0))) +
                             1;
    }
    posts_.resize(4 * tile_lanes);
    culture_posts_.resize(4 * VisiblePieces::most);
    culture_cell_.resize(VisiblePieces::most);
    between_.behind = between_.ahead = between_.behind_culture = between_.ahead_culture = no_posts();
    start();
}

std::size_t Front::bytes_of(std::size_t lanes, bool facets, bool directional, bool shore) {
    const std::size_t doubles = 22 + (facets ? 2 : 0) + (directional ? 2 : 0);
    constexpr std::size_t samples = 3 * 9, single = 6, plain = 2 * 4, posts = 4 * sizeof(float) / sizeof(double);
    return lanes * (doubles * sizeof(double) + (shore ? sizeof(ShoreWindow) : 0) + sizeof(std::int64_t) +
                    sizeof(std::int64_t) + sizeof(std::int32_t)) +
           tile_lanes * (samples + single + plain + posts) * sizeof(double) +
           VisiblePieces::most * 13 * sizeof(double) + VisiblePieces::bytes() + sizeof(Cuts) + sizeof(CultureParts) +
           2 * (std::size_t{unknown_class} + 1) * sizeof(float);
}

std::size_t Front::bytes() const {
    return bytes_of(lanes_.mode.capacity(), needs_facets_, directional_, shore_ != nullptr) +
           (chunk_bounds_[0].highest_m.capacity() + chunk_bounds_[1].highest_m.capacity()) * sizeof(float) +
           culture_.bytes();
}

void Front::set_up_ring(std::size_t ring, Lanes& lanes) const {
    const SpokeGrid& grid = *scene_->grid;
    const std::int64_t spokes = grid.rings(fan_)[ring].spokes;
    const Interval run = run_->spokes[ring];
    lanes.resize(static_cast<std::size_t>(run.size()));
    if (needs_facets_)
        for (LaneArray* v : {&lanes.across, &lanes.slant}) v->resize(lanes.row.size());
    if (directional_)
        for (LaneArray* v : {&lanes.east, &lanes.north}) v->resize(lanes.row.size());
    if (shore_) lanes.shore.assign(lanes.row.size(), {});
    for (std::int64_t k = run.begin; k < run.end; ++k) {
        const auto lane = static_cast<std::size_t>(k - run.begin);
        const double m = SpokeGrid::slope(spokes, k);
        lanes.slope[lane] = m;
        lanes.metres_per_post[lane] = grid.map().metres_per_post(quadrant_, m);
        lanes.inverse_radius[lane] = grid.map().inverse_radius(quadrant_, m);
        if (needs_facets_) {
            const double across = m * minor_post_m_ / grid.map().metres_per_post(quadrant_, 0);
            lanes.across[lane] = across;
            lanes.slant[lane] = std::sqrt(1 + across * across);
        }
        if (directional_) {
            const double azimuth = grid.map().azimuth_rad(quadrant_, m);
            lanes.east[lane] = rounded(std::sin(azimuth), angle_bits);
            lanes.north[lane] = rounded(std::cos(azimuth), angle_bits);
        }
        WedgeCells::Target target{-1, {0, 0}};
        if (run_->touching[ring].contains(k)) {
            const SpokeGrid::Share share = grid.share(fan_, spokes, k);
            for (int side = 1; side >= 0; --side) {
                const std::int64_t bin = share.bin + side;
                if (!run_->bins.contains(bin) || !(share.radians[side] > 0)) continue;
                target.share[1] = target.share[0];  // of the bin after this one
                target.share[0] = share.radians[side];
                target.row = cells_->row_of(bin - run_->bins.begin + run_->first_row, k);
            }
        }
        lanes.row[lane] = target.row;
        lanes.origin[lane] = cells_->origin_of(std::max(target.row, 0));
        lanes.share0[lane] = target.share[0];
        lanes.share1[lane] = target.share[1];
    }
}

void Front::start() {
    set_up_ring(0, lanes_);
    const double z = scene_->nadir_surface_m;
    const bool valid = z == z;
    Samples& at = lanes_.last;
    for (std::size_t lane = 0; lane < lanes_.mode.size(); ++lane) {
        at.part[lane] = 0;
        at.minor[lane] = scene_->grid->map().nadir_minor(quadrant_);
        at.arc[lane] = at.out[lane] = 0;
        at.height[lane] = z;
        at.up[lane] = z - scene_->sensor_m;
        at.range[lane] = std::abs(z - scene_->sensor_m);
        at.sine[lane] = valid ? -1 : z;
        at.x[lane] = scene_->range_is_ground ? 0 : at.range[lane] * bins_per_metre_;
        lanes_.horizon[lane] = valid ? -1 : no_horizon;
        lanes_.void_horizon[lane] = no_horizon;
        lanes_.mark_from[lane] = lanes_.gap_from[lane] = 0;
        lanes_.gap_top[lane] = -infinite;
        lanes_.seen_least[lane] = infinite;
        lanes_.seen_most[lane] = -infinite;
        lanes_.mode[lane] = valid ? mode_visible : mode_gap;
    }
    live_begin_ = 0;
    live_end_ = lanes_.mode.size();
    between_.behind_major = scene_->grid->map().nadir_major(quadrant_);
    // The line behind the nadir, so that the first piece too runs through known cells.
    const Chunk& patch = *scene_->nadir_patch;
    if (line_end_ == 0 || patch.window.empty()) return;
    const bool columns = lines_are_columns(quadrant_);
    const std::int64_t index = scene_->grid->line_index(fan_, 0) - outward(quadrant_);
    const Interval across = columns ? patch.window.columns : patch.window.rows,
                   along = columns ? patch.window.rows : patch.window.columns;
    if (!across.contains(index)) return;
    const auto line = [&](const RawVector<float>& layer, std::vector<float>& store) -> LinePosts {
        if (layer.empty()) return no_posts();
        for (std::int64_t j = along.begin; j < along.end; ++j) {
            const std::int64_t row = (columns ? j : index) - patch.window.rows.begin,
                               column = (columns ? index : j) - patch.window.columns.begin;
            store.push_back(layer[static_cast<std::size_t>(row * patch.window.columns.size() + column)]);
        }
        return {store.data(), along.begin, along.end};
    };
    between_.behind = line(patch.surface_m, patch_posts_);
    between_.behind_culture = line(patch.culture_height_m, patch_culture_);
    std::fill(at.part.begin(), at.part.end(), std::abs(between_.behind_major - static_cast<double>(index)));
    between_.behind_major = static_cast<double>(index);
    between_.adjacent = true;
}

// ---- where spokes are on a line ----

void Front::places(double distance, int level, std::size_t begin, std::size_t end, double* minor, double* arc_m,
                   std::vector<SpokeMap::LinePiece>& pieces) const {
    const SpokeGrid& grid = *scene_->grid;
    const std::int64_t spokes = grid.rings(fan_)[ring_].spokes, first = run_->spokes[ring_].begin;
    grid.map().line(quadrant_, distance, lanes_.slope[begin], lanes_.slope[end - 1], pieces);
    std::size_t at = begin;
    for (const SpokeMap::LinePiece& piece : pieces) {
        // Spokes with slopes in [slope_begin, slope_end).
        const auto stop = std::min<std::int64_t>(
            static_cast<std::int64_t>(end),
            static_cast<std::int64_t>(std::ceil(piece.slope_end * static_cast<double>(spokes))) - first);
        if (stop <= static_cast<std::int64_t>(at)) continue;
        const std::size_t count = static_cast<std::size_t>(stop) - at;
        place_lanes(piece, grid.map().nadir_minor(quadrant_), distance, count, lanes_.slope.data() + at,
                    lanes_.metres_per_post.data() + at, minor + (at - begin), arc_m + (at - begin));
        at += count;
    }
    if (level == 0) return;
    const double share = 1 / static_cast<double>(std::int64_t{1} << level);
    for (std::size_t i = 0; i < end - begin; ++i) minor[i] *= share;
}

void Front::enter_level(std::int64_t line) {
    const int level = scene_->grid->level(fan_, line);
    if (level == level_) return;
    assert(pieces_.size() == 0);
    const double before = post_;
    level_ = level;
    post_ = static_cast<double>(std::int64_t{1} << level);
    for (double& minor : lanes_.last.minor) minor *= before / post_;  // powers of two: exact
}

void Front::sample_line(const LinePosts& posts, std::size_t begin, std::size_t end, std::size_t at,
                        Samples& samples) const {
    constexpr std::size_t block = 64;
    double cell[block];
    float around[2 * block], same[2 * block];
    const StepScene sight = step_scene(false);
    for (std::size_t lane = begin; lane < end; lane += block, at += block) {
        const std::size_t n = std::min(block, end - lane);
        const SampleLanes line = samples.lanes(at);
        std::fill_n(line.part, n, 0.0);
        cell_lanes(posts, posts, n, line.minor, line.minor, {cell, around, same});
        sight_lanes(n, sight, cell, around, lanes_.inverse_radius.data() + lane, line);
    }
}

LinePosts Front::line_of(const Chunk& chunk, const RawVector<float>& layer, std::int64_t index) const {
    if (layer.empty()) return no_posts();
    const bool columns = lines_are_columns(quadrant_);
    const Interval minor = columns ? chunk.window.rows : chunk.window.columns;
    const std::int64_t first = columns ? chunk.window.columns.begin : chunk.window.rows.begin;
    const std::int64_t line = chunk.flat ? 0 : index - first;
    return {layer.data() + line * minor.size(), minor.begin, minor.end};
}

void Front::stand_on(std::int64_t index, const Chunk* chunk) {
    between_.behind = chunk ? line_of(*chunk, chunk->surface_m, index) : no_posts();
    between_.behind_culture = chunk ? line_of(*chunk, chunk->culture_height_m, index) : no_posts();
    between_.behind_major = static_cast<double>(index);
    between_.adjacent = true;
}

void Front::advance(Interval lines, const Chunk* chunk, bool leap) {
    assert(lines.begin == next_line_);
    leaps_ = leap;
    enter_level(lines.begin);
    between_.in_chunk = chunk != nullptr;
    if (chunk) {
        if (scene_->data_base->has_culture) culture_.open(raster_posts(chunk->window, level_), !leap);
        leave_out_culture();
        for (ChunkBounds& bounds : chunk_bounds_)
            if (bounds.highest_m.empty()) bounds.set_up(chunk->window, lines_are_columns(quadrant_));
    }
    if (next_line_ > 0) {
        // Its last line again: the chunk before may not have held all posts that matter now, or had another level.
        stand_on(scene_->grid->line_index(fan_, next_line_) - outward(quadrant_), chunk);
        sample_line(between_.behind, live_begin_, live_end_, live_begin_, lanes_.last);
    }
    while (!lines.empty() && !finished()) {
        const auto& rings = scene_->grid->rings(fan_);
        const Interval part = intersection({next_line_, lines.end}, rings[ring_].lines);
        const Between first = between_;
        for (std::size_t tile = live_begin_; tile < live_end_; tile += tile_lanes) {
            between_ = first;
            advance_tile(part, chunk, tile, std::min(live_end_, tile + tile_lanes));
        }
        cost_.clock.enter(StageClock::other);
        trim();
        next_line_ = part.end;
        lines.begin = part.end;
        // At once: the odd children's own samples need the classes of this line.
        while (next_line_ >= rings[ring_].lines.end && ring_ + 1 < rings.size() && !finished()) double_spokes();
    }
    next_line_ = std::max(next_line_, lines.end);
    between_.behind = between_.behind_culture = between_.ahead = between_.ahead_culture = no_posts();
    between_.in_chunk = false;
    for (ChunkBounds& bounds : chunk_bounds_) bounds.highest_m.clear();
}

std::size_t Front::first_live(std::size_t begin, std::size_t end) const {
    // In whole steps, so that what is left begins where the cache's lines do.
    const auto first = lanes_.mode.begin();
    while (begin + lane_step <= end && std::all_of(first + static_cast<std::ptrdiff_t>(begin),
                                                   first + static_cast<std::ptrdiff_t>(begin + lane_step),
                                                   [](double mode) { return mode == mode_done; }))
        begin += lane_step;
    return begin;
}

void Front::trim() {
    live_begin_ = first_live(live_begin_, live_end_);
    while (live_end_ > live_begin_ && is(live_end_ - 1, mode_done)) --live_end_;
}

// ---- one tile: neighbouring spokes over the lines of a chunk ----

void Front::advance_tile(Interval lines, const Chunk* chunk, std::size_t begin, std::size_t end) {
    const SpokeGrid& grid = *scene_->grid;
    std::size_t from = begin, to = end;
    const auto copy = [](std::size_t n, const Samples& source, std::size_t at, Samples& target, std::size_t into) {
        for (auto array : Samples::arrays())
            std::copy_n((source.*array).begin() + static_cast<std::ptrdiff_t>(at), n,
                        (target.*array).begin() + static_cast<std::ptrdiff_t>(into));
    };
    copy(end - begin, lanes_.last, begin, now_, 0);
    for (std::int64_t line = lines.begin; line < lines.end; ++line) {
        cost_.clock.next_turn();
        // Spokes that are done at either end are left behind; what they were is not looked at again.
        const std::size_t skip = first_live(from, to) - from;
        from += skip;
        while (to > from && is(to - 1, mode_done)) --to;
        if (skip) copy(to - from, now_, skip, now_, 0);
        const bool unseeing =
            leaps_ && from < to && between_.adjacent && none_sees(to - from, lanes_.mode.data() + from);
        for (bool again = unseeing && chunk && line > 0; again && line < lines.end;) {
            const std::int64_t passed = leap(line, lines.end - 1, *chunk, from, to);
            again = passed >= line;
            line = passed + 1;
        }
        if (line >= lines.end) break;
        const std::int64_t index = grid.line_index(fan_, line);
        between_.ahead = chunk ? line_of(*chunk, chunk->surface_m, index) : no_posts();
        between_.ahead_culture = chunk ? line_of(*chunk, chunk->culture_height_m, index) : no_posts();
        between_.ahead_major = static_cast<double>(index);
        if (from < to) advance_line(grid.distance(fan_, line), from, to, unseeing);
        between_.behind = between_.ahead;
        between_.behind_culture = between_.ahead_culture;
        between_.behind_major = between_.ahead_major;
        between_.adjacent = true;
    }
    cost_.clock.next_turn();
    put_pieces();
    // The spokes' last line, whether they leapt there or not.
    stand_on(grid.line_index(fan_, lines.end - 1), chunk);
    refresh(from, to);
    copy(to - from, now_, 0, lanes_.last, from);
}

void Front::advance_line(double distance, std::size_t begin, std::size_t end, bool unseeing) {
    const SpokeGrid& grid = *scene_->grid;
    const std::size_t n = end - begin;

    cost_.clock.enter(StageClock::sample);
    places(distance, level_, begin, end, ahead_.minor.data(), ahead_.arc.data(), line_pieces_);
    // Beyond the range, or gone from the raster for good.
    if (count_beyond_or_in(n, ahead_.arc.data(), scene_->max_arc_m, lanes_.mode.data() + begin, mode_gap))
        for (std::size_t i = 0; i < n; ++i) {
            const std::size_t lane = begin + i;
            if (!(ahead_.arc[i] > scene_->max_arc_m) && !is(lane, mode_gap)) continue;
            if (is(lane, mode_done) || !beyond(lane, ahead_.minor[i], ahead_.arc[i], distance)) continue;
            mark_seen(lane);
            if (is(lane, mode_hidden)) mark_shadow(lane, ahead_.arc[i]);
            if (is(lane, mode_gap)) mark_rest(lane, lanes_.mark_from[lane]);
            lanes_.mode[lane] = mode_done;
        }

    if (unseeing && passes_line(begin, end)) return;
    refresh(begin, end);
    if (scene_->sampling.cross_lines && between_.adjacent) {
        // Where a bin has many posts, and four of range (a pulse) two.
        joins_ = may_join_ && grid.wide_bins(fan_, distance, level_) && 2 * scene_->range_bin_m >= long_post_m_ * post_;
        for (;;) {
            cost_.clock.enter(StageClock::sample);
            const int crossed = cross_lanes(
                n, {now_.part.data(), now_.minor.data(), now_.arc.data(), ahead_.minor.data(), ahead_.arc.data(),
                    crossing_.part.data(), crossing_.minor.data(), crossing_.arc.data()});
            if (crossed == 0) break;
            cost_.samples += static_cast<std::uint64_t>(crossed);
            if (waiting_ > 0) keep_crossing_again(n, begin);
            take(begin, end, true, crossing_);
            if (grid.map().straight()) break;  // |slope| <= 1: one at the most
        }
    }
    std::fill_n(ahead_.part.begin(), n, 1.0);
    cost_.samples += n;
    take(begin, end, false, ahead_);
    std::fill_n(now_.part.begin(), n, 0.0);  // of the way to the next line
}

bool Front::passes_line(std::size_t begin, std::size_t end) {
    cost_.clock.enter(StageClock::sweep);
    const bool passes =
        pass_hidden(end - begin, scene_->sensor_m, between_.behind, between_.ahead,
                    {now_.minor.data(), ahead_.minor.data(), now_.arc.data(), ahead_.arc.data(),
                     lanes_.mode.data() + begin, lanes_.horizon.data() + begin, lanes_.inverse_radius.data() + begin});
    if (passes) {
        std::swap(now_.minor, ahead_.minor);
        std::swap(now_.arc, ahead_.arc);
        stale_ = true;
    }
    return passes;
}

void Front::refresh(std::size_t begin, std::size_t end) {
    if (!stale_) return;
    cost_.clock.enter(StageClock::sweep);
    sample_line(between_.behind, begin, end, 0, now_);
    stale_ = false;
    cost_.samples += end - begin;
}

bool Front::beyond(std::size_t lane, double minor, double arc, double distance) const {
    if (arc > scene_->max_arc_m) return true;
    const DataBase& db = *scene_->data_base;
    if (db.cyclic && !lines_are_columns(quadrant_)) return false;
    // Outside along the lines, moving away, and farther out than the spoke's bend can bring back.
    const double last =
        static_cast<double>(posts_at(lines_are_columns(quadrant_) ? db.rows : db.columns, level_) - 1) * post_;
    minor *= post_;
    const SpokeMap& map = scene_->grid->map();
    const double m = lanes_.slope[lane], straight = map.nadir_minor(quadrant_) + m * distance;
    const double bend = map.straight() ? 0 : map.most_bend(quadrant_);
    return (minor < 0 && m <= 0 && straight + bend < 0) || (minor > last && m >= 0 && straight - bend > last);
}

void Front::take(std::size_t begin, std::size_t end, bool crossings, Samples& next) {
    const std::size_t n = end - begin;
    assert(pieces_.size() + tile_lanes <= VisiblePieces::most);
    const SampleLanes from = now_.lanes(0), to = next.lanes(0);
    cost_.clock.enter(StageClock::sample);
    // The cell that the piece runs through; without the other axis' lines it may run through two: that of its end.
    const bool one_cell = crossings || (scene_->sampling.cross_lines && between_.adjacent);
    const CellLanes posts{cell_.data(), posts_.data(), posts_.data() + 2 * tile_lanes};
    cell_lanes(between_.adjacent ? between_.behind : between_.ahead, between_.ahead, n,
               one_cell ? from.minor : to.minor, to.minor, posts);
    cost_.clock.enter(StageClock::sweep);
    StepScene step = step_scene(scene_->sampling.exact_course && one_cell);
    if (may_turn(between_.ahead_major)) step.most_rise = 0;
    const Rises found = step_lanes(crossings ? StepTo::crossing : StepTo::line, n, step,
                                   {from, to, posts, lanes_.mode.data() + begin, lanes_.inverse_radius.data() + begin,
                                    lanes_.void_horizon.data() + begin, lanes_.horizon.data() + begin,
                                    lanes_.seen_least.data() + begin, lanes_.seen_most.data() + begin, bump_.data(),
                                    plain_.rise.data(), plain_.swing.data(), plain_.sine0.data(), plain_.code.data()});
    cost_.pieces += static_cast<std::uint64_t>(found.plain);
    if (found.plain + found.changes > 0) cost_.clock.enter(StageClock::deposit);
    const bool wait = crossings && joins_;
    if (!crossings && waiting_ > 0)
        keep_joined(n, begin, from, to);
    else if (found.plain && !wait)
        keep_pieces(n, begin, from, to, plain_);
    if (at_once_ && !parts_wait_) put_pieces();
    if (found.changes > 0) change(n, begin, step, next);
    leave_out_culture();
    if (at_once_ && parts_wait_) put_pieces();
    make_room();
    if (wait) wait_for_line(n, found.plain, next);
    swap(now_, next);
}

bool Front::may_turn(double major) const {
    if (turning_posts_ == 0) return false;
    return std::abs(major * post_ - scene_->grid->map().nadir_major(quadrant_)) < turning_posts_;
}

// ---- rings ----

void Front::double_spokes() {
    assert(pieces_.size() == 0);  // they know their spokes by number
    for (std::size_t lane = 0; lane < lanes_.mode.size(); ++lane) {
        mark_seen(lane);
        if (is(lane, mode_hidden)) mark_shadow(lane, lanes_.last.arc[lane]);
        if (is(lane, mode_gap)) mark_gap(lane, lanes_.last.arc[lane]);
    }
    const Lanes parents = std::move(lanes_);
    const Interval parent_run = run_->spokes[ring_];
    ++ring_;
    assert(scene_->grid->rings(fan_)[ring_].spokes == 2 * scene_->grid->rings(fan_)[ring_ - 1].spokes);
    const Interval run = run_->spokes[ring_];
    lanes_ = Lanes{};
    set_up_ring(ring_, lanes_);
    between_.ahead = between_.ahead_culture = no_posts();
    for (std::int64_t k = run.begin; k < run.end; ++k) {
        const auto lane = static_cast<std::size_t>(k - run.begin);
        const auto a = static_cast<std::size_t>(floor_of(static_cast<double>(k) / 2) - parent_run.begin);
        lanes_.seen_least[lane] = infinite;
        lanes_.seen_most[lane] = -infinite;
        if (k & 1)
            begin_between(parents, a, a + 1, lane);
        else
            go_on_from(parents, a, lane);
    }
    live_begin_ = 0;
    live_end_ = lanes_.mode.size();
    trim();
}

void Front::go_on_from(const Lanes& parents, std::size_t parent, std::size_t lane) {
    for (auto array : Samples::arrays()) (lanes_.last.*array)[lane] = (parents.last.*array)[parent];
    for (auto array : {&Lanes::mode, &Lanes::horizon, &Lanes::void_horizon, &Lanes::gap_from, &Lanes::gap_top})
        (lanes_.*array)[lane] = (parents.*array)[parent];
    lanes_.mark_from[lane] = parents.last.arc[parent];
    if (shore_) lanes_.shore[lane] = parents.shore[parent];
}

void Front::begin_between(const Lanes& parents, std::size_t a, std::size_t b, std::size_t lane) {
    Samples& last = lanes_.last;
    const SpokeGrid& grid = *scene_->grid;
    const SpokeMap::Place place = grid.map().place(quadrant_, lanes_.slope[lane], grid.distance(fan_, next_line_ - 1));
    last.minor[lane] = place.minor / post_;
    last.arc[lane] = place.arc_m;
    sample_line(between_.behind, lane, lane + 1, lane, last);
    lanes_.void_horizon[lane] = std::max(parents.void_horizon[a], parents.void_horizon[b]);
    lanes_.mark_from[lane] = lanes_.gap_from[lane] = place.arc_m;
    lanes_.gap_top[lane] = -infinite;
    if (shore_) lanes_.shore[lane] = ShoreWindow::between(parents.shore[a], parents.shore[b]);
    const double sine = last.sine[lane], ha = parents.horizon[a], hb = parents.horizon[b];
    double horizon = ha >= -1 && hb >= -1 ? 0.5 * (ha + hb) : std::max(ha, hb);
    if (parents.mode[a] == mode_done && parents.mode[b] == mode_done) {
        lanes_.mode[lane] = mode_done;
    } else if (sine != sine) {
        lanes_.mode[lane] = mode_gap;
        for (const std::size_t p : {a, b})
            if (parents.mode[p] == mode_gap) {
                lanes_.gap_from[lane] = std::min(lanes_.gap_from[lane], parents.gap_from[p]);
                lanes_.gap_top[lane] = std::max(lanes_.gap_top[lane], parents.gap_top[p]);
            }
        if (shore_) lanes_.shore[lane] = {};
    } else {
        if (horizon < -1) horizon = sine;  // neither neighbour has met ground
        lanes_.mode[lane] = sine >= horizon ? mode_visible : mode_hidden;
        if (sine > horizon) {
            show_begin(lane, horizon);
            horizon = sine;
        }
    }
    lanes_.horizon[lane] = horizon;
}

void Front::show_begin(std::size_t lane, double horizon) {
    // What its parents have not deposited is deposited here.
    ++cost_.pieces;
    if (lanes_.row[lane] < 0) return;
    const Samples& last = lanes_.last;
    const double sine = last.sine[lane], range = last.range[lane], x = last.x[lane], minor = last.minor[lane];
    put(lane, {{x, x, power_of(lane, horizon, sine, range, range), 0},
               {between_.behind_major, minor, between_.behind_major, minor},
               horizon,
               sine,
               needs_facets_ ? law_variable(-sine) : 0,  // a point has no facet: as level ground
               nullptr,
               nullptr,
               0,
               0});
    leave_out_culture();
    cells_->mark(lanes_.target(lane), x, x, sine > lanes_.void_horizon[lane] ? bit_seen : bit_unknown);
}

void Front::finish() {
    assert(pieces_.size() == 0);
    for (std::size_t lane = 0; lane < lanes_.mode.size(); ++lane) {
        if (is(lane, mode_done)) continue;
        mark_seen(lane);
        if (is(lane, mode_hidden)) mark_shadow(lane, lanes_.last.arc[lane]);
        // After the raster's last line there is no data up to the range.
        const double from = is(lane, mode_gap) ? lanes_.mark_from[lane] : lanes_.last.arc[lane];
        if (from < scene_->max_arc_m) mark_rest(lane, from);
        lanes_.mode[lane] = mode_done;
    }
}

}  // namespace wedgescope
