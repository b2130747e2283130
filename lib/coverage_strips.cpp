#include "lib/coverage_work.hpp"

#include <numbers>
#include <numeric>
#include <stdexcept>

#include "lib/stopwatch.hpp"

namespace wedgescope::covering {

void Cover::set_up(Quadrant q) {
    Side& side = sides_[static_cast<std::size_t>(q)];
    side.quadrant = q;
    side.lines = grid_.line_count(q);
    const bool columns = lines_are_columns(q);
    const double nadir = map_.nadir_minor(q);
    side.minor = {0, columns ? db_.rows : db_.columns};
    if (db_.cyclic && !columns)
        side.minor = {floor_i(nadir) - db_.cycle_columns / 2 + 1, floor_i(nadir) + db_.cycle_columns / 2};
    // The slopes of the spokes that meet the raster.
    side.slope_lo = 1, side.slope_hi = -1;
    for (std::int64_t line : {std::int64_t{0}, side.lines - 1}) {
        if (side.lines == 0) break;
        const double d = grid_.distance(q, line), bend = map_.straight() ? 0 : map_.most_bend(q);
        side.slope_lo = std::min(side.slope_lo, (static_cast<double>(side.minor.begin) - 2 - bend - nadir) / d);
        side.slope_hi = std::max(side.slope_hi, (static_cast<double>(side.minor.end) + 1 + bend - nadir) / d);
    }
    side.slope_lo = std::clamp(side.slope_lo, -1.0, 1.0);
    side.slope_hi = std::clamp(side.slope_hi, side.slope_lo, 1.0);
    // f^2 and f^2 / Re are quadratic in the slope.
    const auto quadratic = [](double below, double middle, double above) {
        return std::array<double, 3>{middle, 0.5 * (above - below), 0.5 * (above + below) - middle};
    };
    const auto square = [&](double m) { return map_.metres_per_post(q, m) * map_.metres_per_post(q, m); };
    const auto curvature = [&](double m) { return square(m) * map_.inverse_radius(q, m); };
    side.square = quadratic(square(-1), square(0), square(1));
    side.curvature = quadratic(curvature(-1), curvature(0), curvature(1));
    for (int i = -32; i <= 32; ++i)
        side.most_bent = std::max(side.most_bent, 1.25 * std::abs(map_.inverse_radius(q, i / 32.0)));
    if (scene_.scene.sector) {
        const double from = scene_.scene.platform.heading.rad() + scene_.scene.sector->from.rad();
        const double width = scene_.scene.sector->to.rad() - scene_.scene.sector->from.rad();
        const double a = map_.azimuth_rad(q, -1), b = map_.azimuth_rad(q, 1);
        const double sign = b > a ? 1 : -1;
        const auto slope_of = [&](double azimuth) {
            double lo = -1, hi = 1;
            for (int i = 0; i < 60; ++i) {
                const double middle = 0.5 * (lo + hi);
                ((map_.azimuth_rad(q, middle) - azimuth) * sign < 0 ? lo : hi) = middle;
            }
            return rounded(0.5 * (lo + hi), 36);
        };
        constexpr double circle = 2 * std::numbers::pi, rounding = 0x1p-32;
        for (int turn = -3; turn <= 3; ++turn) {
            const double begin = std::max(from + turn * circle, std::min(a, b)),
                         end = std::min(from + width + turn * circle, std::max(a, b));
            if (begin > end + rounding) continue;
            double lo = slope_of(begin), hi = slope_of(end);
            if (lo > hi) std::swap(lo, hi);
            // Posts on a border are in, whatever rounding says of their place.
            lo -= rounding;
            hi += rounding;
            // Far beyond the quadrant, so that no post on a diagonal falls between two.
            if (begin == std::min(a, b)) (sign > 0 ? lo : hi) += sign > 0 ? -1 : 1;
            if (end == std::max(a, b)) (sign > 0 ? hi : lo) += sign > 0 ? 1 : -1;
            side.sector.emplace_back(lo, hi);
        }
    }
    const std::int64_t k = grid_.rings(q).front().spokes;
    side.spokes.resize(k, fan(side, k), voids_);
    // Strips, in the order outward. The quadrants north and south have the rows without lines too: set_rows().
    if (!columns || side.lines == 0) return;
    side.tile = tile_of(grid_.line_index(q, 0));
    side.tile_end = tile_of(grid_.line_index(q, side.lines - 1)) + outward(q);
}

/// Strips of the quadrants north and south.
void Cover::set_rows(Quadrant q) {
    Side& side = sides_[static_cast<std::size_t>(q)];
    const std::int64_t border =
        std::clamp<std::int64_t>(ceil_i(map_.nadir_major(q)), 0, db_.rows);  // first row of the south
    const Interval rows =
        intersection(reached_.rows, q == Quadrant::south ? Interval{border, db_.rows} : Interval{0, border});
    if (rows.empty()) return;
    side.tile = tile_of(q == Quadrant::south ? rows.begin : rows.end - 1);
    side.tile_end = (q == Quadrant::south ? tile_of(rows.end - 1) : tile_of(rows.begin)) + outward(q);
}

/// Posts of a row that spokes of north and south may come by.
Interval Cover::widest_fan(const Side& side, std::int64_t line) const {
    const double d = grid_.distance(side.quadrant, line);
    return intersection(
        {floor_i(map_.place(side.quadrant, -1, d).minor) - 2, ceil_i(map_.place(side.quadrant, 1, d).minor) + 3},
        side.minor);
}

/// Of these, what does not belong to east and west.
Interval Cover::own_of_row(const Side& side, std::int64_t line) const {
    const std::int64_t row = grid_.line_index(side.quadrant, line);
    const auto theirs = [&](std::int64_t c) {
        return own_[static_cast<std::size_t>(db_.real_column(c))].contains(row);
    };
    Interval fan = widest_fan(side, line);
    while (!fan.empty() && theirs(fan.begin)) ++fan.begin;
    while (!fan.empty() && theirs(fan.end - 1)) --fan.end;
    return fan;
}

/// Is every post some quadrant's, or right below the sensor, and so known to be something else than outside?
bool Cover::all_owned() const {
    if (db_.cyclic) return false;
    std::vector<std::int64_t> more(static_cast<std::size_t>(db_.rows) + 1), owned(static_cast<std::size_t>(db_.rows));
    for (const Interval& rows : own_) {
        if (rows.empty()) continue;
        ++more[static_cast<std::size_t>(rows.begin)];
        --more[static_cast<std::size_t>(rows.end)];
    }
    std::partial_sum(more.begin(), more.end() - 1, owned.begin());
    for (Quadrant q : {Quadrant::south, Quadrant::north}) {
        const Side& side = sides_[static_cast<std::size_t>(q)];
        for (std::int64_t line = 0; line < side.lines; ++line)
            owned[static_cast<std::size_t>(grid_.line_index(q, line))] += own_of_row(side, line).size();
    }
    if (post_below()) ++owned[static_cast<std::size_t>(floor_i(scene_.nadir.row))];
    return std::all_of(owned.begin(), owned.end(), [&](std::int64_t posts) { return posts == db_.columns; });
}

/// The tiles that spokes come by lie in these columns and rows; of all others nothing need be known.
void Cover::leave_unreached() {
    Interval columns, rows;
    for (std::int64_t c = 0; c < db_.columns; ++c)
        if (const Interval own = own_[static_cast<std::size_t>(c)]; !own.empty()) {
            columns = hull(columns, {c, c + 1});
            rows = hull(rows, own);
        }
    for (Quadrant q : {Quadrant::south, Quadrant::north}) {
        const Side& side = sides_[static_cast<std::size_t>(q)];
        for (std::int64_t line = 0; line < side.lines; ++line) {
            const std::int64_t row = grid_.line_index(q, line);
            columns = hull(columns, widest_fan(side, line));
            rows = hull(rows, {row, row + 1});
        }
    }
    const std::int64_t c = floor_i(scene_.nadir.column), r = floor_i(scene_.nadir.row);
    if (r >= 0 && r < db_.rows && (db_.cyclic || (c >= 0 && c < db_.columns))) {
        columns = hull(columns, {c, c + 1});
        rows = hull(rows, {r, r + 1});
    }
    if (db_.cyclic) columns = {0, db_.columns};
    const auto whole_tiles = [](Interval posts, std::int64_t end) {
        return posts.empty() ? Interval{}
                             : Interval{floor_to(posts.begin, tile_edge),
                                        std::min(end, floor_to(posts.end - 1, tile_edge) + tile_edge)};
    };
    reached_ = {whole_tiles(columns, db_.columns), whole_tiles(rows, db_.rows)};
}

void Cover::own_east_west() {
    own_.assign(static_cast<std::size_t>(db_.columns), {});
    for (Quadrant q : {Quadrant::east, Quadrant::west}) {
        const Side& side = sides_[static_cast<std::size_t>(q)];
        if (side.lines == 0) continue;
        const auto rows = [&](std::int64_t line) {
            const double d = grid_.distance(q, line);
            const Interval fan{ceil_i(map_.place(q, -1, d).minor), floor_i(map_.place(q, 1, d).minor) + 1};
            return intersection(fan, {0, db_.rows});
        };
        Interval last;
        for (std::int64_t line = 0; line < side.lines; ++line) {
            last = rows(line);
            const std::int64_t column = db_.real_column(grid_.line_index(q, line));
            own_[static_cast<std::size_t>(column)] = last;
        }
    }
    // One column more than the circle: the last repeats the first.
    if (db_.cyclic && db_.columns > db_.cycle_columns) own_.back() = own_.front();
}

/// Lines of a strip that spokes cross; and the raster's columns (rows) that the strip stands for.
Interval Cover::tile_lines(const Side& side, std::int64_t step, Interval& indices) const {
    const Quadrant q = side.quadrant;
    indices = {step * tile_edge, (step + 1) * tile_edge};
    if (!lines_are_columns(q)) {
        const std::int64_t border = std::clamp<std::int64_t>(ceil_i(map_.nadir_major(q)), 0, db_.rows);
        indices = intersection(indices, q == Quadrant::south ? Interval{border, db_.rows} : Interval{0, border});
    }
    if (side.lines == 0) return {};
    const std::int64_t first = grid_.line_index(q, 0);
    const Interval lines = outward(q) > 0 ? Interval{indices.begin - first, indices.end - first}
                                          : Interval{first - indices.end + 1, first - indices.begin + 1};
    const Interval real = intersection(lines, {0, side.lines});
    if (lines_are_columns(q)) {
        const std::int64_t a = grid_.line_index(q, real.begin), b = grid_.line_index(q, real.end - 1);
        indices = {std::min(a, b), std::max(a, b) + 1};
    }
    return real;
}

/// The nearest first, so that what a diagonal cuts waits least.
void Cover::order_strips() {
    std::array<std::int64_t, 4> next{};
    for (std::size_t q = 0; q < 4; ++q) next[q] = sides_[q].tile;
    for (;;) {
        double least = std::numeric_limits<double>::infinity();
        std::size_t nearest = 4;
        for (std::size_t q = 0; q < 4; ++q) {
            const Side& side = sides_[q];
            if (next[q] == side.tile_end) continue;
            const double edge = static_cast<double>((next[q] + (outward(side.quadrant) > 0 ? 1 : 0)) * tile_edge),
                         reach = std::abs(edge - map_.nadir_major(side.quadrant));
            if (reach < least) least = reach, nearest = q;
        }
        if (nearest == 4) return;
        strips_.push_back(std::make_unique<Strip>(sides_[nearest], next[nearest]));
        next[nearest] += outward(sides_[nearest].quadrant);
    }
}

/// Begins what can be begun: strips whose quadrant has come so far, not too many ahead of the first that is not done,
/// and none while the writer is behind.
void Cover::go_on() {
    if (over_) return;  // something has gone wrong
    for (std::size_t i = counted_; i < std::min(strips_.size(), counted_ + strips_ahead_); ++i) {
        if (waiting_ + tiles_.done_count() > strips_ahead_ * tiles_across()) return;
        Strip& strip = *strips_[i];
        if (strip.begun || strip.side->busy) continue;
        strip.begun = strip.side->busy = true;
        queue({Job::Kind::begin, &strip});
    }
    if (counted_ == strips_.size() && !writing_) {
        over_ = true;
        changed_.notify_all();
    }
}

void Cover::queue(Job job, bool first) {
    first ? jobs_.push_front(job) : jobs_.push_back(job);
    changed_.notify_one();
}

/// What each thread does until all is done or something has gone wrong.
void Cover::work() {
    for (;;) {
        Job job;
        {
            std::unique_lock lock(mutex_);
            changed_.wait(lock, [&] { return over_ || !jobs_.empty(); });
            if (over_) return;
            job = jobs_.front();
            jobs_.pop_front();
        }
        try {
            switch (job.kind) {
                case Job::Kind::begin:
                    begin(*job.strip);
                    break;
                case Job::Kind::sweep:
                    sweep(*job.strip, job.run);
                    if (--job.strip->left == 0) end(*job.strip);
                    break;
                case Job::Kind::write:
                    write_done();
                    break;
            }
        } catch (...) {
            const std::lock_guard lock(mutex_);
            if (!error_) error_ = std::current_exception();
            over_ = true;
            changed_.notify_all();
        }
    }
}

void Cover::begin(Strip& strip) {
    prepare(strip);
    if (strip.runs.empty()) return end(strip);
    const std::lock_guard lock(mutex_);
    strip.left = strip.runs.size();
    for (std::size_t i = 0; i < strip.runs.size(); ++i) queue({Job::Kind::sweep, &strip, i});
}

/// Its lines, whose posts they are, and its runs.
void Cover::prepare(Strip& strip) {
    const Side& side = *strip.side;
    const Quadrant q = side.quadrant;
    Interval indices;
    strip.lines = tile_lines(side, strip.tile, indices);
    const Interval lines = strip.lines;
    strip.own.resize(static_cast<std::size_t>(lines.size()));
    std::vector<CoverageTiles::Key> crossed;  // by spokes
    if (lines_are_columns(q)) {
        // The strip's columns lie in one tile of the raster, or in two where it closes the circle.
        std::map<std::int64_t, std::vector<std::int64_t>> posts;  // by column of tiles: of each of its tiles
        for (std::int64_t line = lines.begin; line < lines.end; ++line) {
            const std::int64_t column = db_.real_column(grid_.line_index(q, line));
            const Interval rows = own_[static_cast<std::size_t>(column)];
            strip.own[static_cast<std::size_t>(line - lines.begin)] = rows;
            for (std::int64_t c : same_columns(column)) {
                std::vector<std::int64_t>& of = posts[c / tile_edge];
                of.resize(static_cast<std::size_t>(db_.rows / tile_edge + 1));
                for (std::int64_t r = rows.begin; r < rows.end;) {
                    const std::int64_t end = std::min(rows.end, floor_to(r, tile_edge) + tile_edge);
                    of[static_cast<std::size_t>(r / tile_edge)] += end - r;
                    r = end;
                }
            }
        }
        for (const auto& [column, of] : posts)
            for (std::size_t row = 0; row < of.size(); ++row)
                if (of[row] > 0) {
                    crossed.emplace_back(static_cast<std::int64_t>(row), column);
                    strip.posts[crossed.back()] = of[row];
                }
    } else {
        // The fan of each row, without what belongs to east and west; all else in the row is outside.
        std::vector<bool> by_column(static_cast<std::size_t>(tile_of(db_.columns - 1) + 1));
        const auto cross = [&](std::int64_t column) { by_column[static_cast<std::size_t>(column / tile_edge)] = true; };
        for (std::int64_t line = lines.begin; line < lines.end; ++line) {
            const Interval fan = own_of_row(side, line);
            strip.own[static_cast<std::size_t>(line - lines.begin)] = fan;
            for (std::int64_t c = fan.begin; c < fan.end; c += tile_edge - db_.real_column(c) % tile_edge)
                for (std::int64_t same : same_columns(db_.real_column(c))) cross(same);
            if (!fan.empty()) cross(db_.real_column(fan.end - 1));
        }
        for (std::size_t tc = 0; tc < by_column.size(); ++tc)
            if (by_column[tc]) crossed.emplace_back(strip.tile, static_cast<std::int64_t>(tc));
        for (std::int64_t tc = tile_of(reached_.columns.begin); tc * tile_edge < reached_.columns.end; ++tc) {
            std::int64_t posts = 0;
            for (std::int64_t c = tc * tile_edge; c < std::min(db_.columns, (tc + 1) * tile_edge); ++c)
                posts += indices.size() - intersection(own_[static_cast<std::size_t>(c)], indices).size();
            strip.posts[{strip.tile, tc}] = posts;
        }
    }
    const bool nadir = q == Quadrant::south && indices.contains(floor_i(scene_.nadir.row));
    if (nadir)
        for (std::int64_t c : same_columns(db_.real_column(floor_i(scene_.nadir.column))))
            if (c >= 0 && c < db_.columns) crossed.emplace_back(strip.tile, c / tile_edge);
    std::sort(crossed.begin(), crossed.end());
    crossed.erase(std::unique(crossed.begin(), crossed.end()), crossed.end());
    {
        const std::lock_guard lock(mutex_);
        for (const CoverageTiles::Key& key : crossed) strip.tiles[key] = &tiles_.at(key);
    }
    if (nadir) put_nadir(strip);
    if (lines.empty()) return;
    const auto& rings = grid_.rings(q);
    std::size_t ring = 0;
    while (ring + 1 < rings.size() && rings[ring + 1].lines.begin <= lines.end - 1) ++ring;
    const std::int64_t k = rings[ring].spokes, growth = k / side.spokes.of;
    strip.after.resize(k, fan(side, k), voids_);
    const auto most = std::min(run_spokes, floor_i(static_cast<double>(run_posts) * sampling_.spokes_per_post));
    const std::int64_t step = std::max(knot, floor_to(most / growth, knot));
    const Interval all = side.spokes.range;
    for (std::int64_t at = all.begin; at < all.end;) {
        const std::int64_t end = std::min(all.end, floor_to(at + knot, step) + step);  // none of one group
        strip.runs.push_back({at, end});
        at = end;
    }
}

/// Its posts are known when those of all strips before it are: so tiles go out in the same order every time.
void Cover::end(Strip& strip) {
    const std::lock_guard lock(mutex_);
    if (!strip.lines.empty()) strip.side->spokes = std::move(strip.after);
    strip.swept = true;
    strip.side->busy = false;
    for (; counted_ < strips_.size() && strips_[counted_]->swept; ++counted_) {
        for (const auto& [key, posts] : strips_[counted_]->posts) tiles_.known(key, posts);
        strips_[counted_].reset();
    }
    if (counted_ == strips_.size() && tiles_.unfinished() > 0)
        throw std::logic_error("coverage: a post belongs to no quadrant");
    if (params_.timeline && !params_.beside_others) params_.timeline->memory(held_bytes(threads_));
    if (params_.progress) params_.progress(static_cast<double>(counted_) / static_cast<double>(strips_.size()));
    if (tiles_.any_done() && !writing_) {
        writing_ = true;
        queue({Job::Kind::write}, true);
    }
    go_on();
}

void Cover::write_done() {
    const Span span(params_.timeline, "write", "stage");
    const Stopwatch watch;
    for (;;) {
        std::vector<CoverageTiles::Done> done;
        {
            const std::lock_guard lock(mutex_);
            done = tiles_.take_done();
            waiting_ = done.size();
            if (done.empty()) {
                writing_ = false;
                write_s_ += watch.wall_s();
                return go_on();
            }
        }
        tiles_.hand_out(std::move(done), [&](const CoverageTile& tile) {
            if (params_.stop) params_.stop->check();
            (*write_)(tile);
        });
        const std::lock_guard lock(mutex_);
        waiting_ = 0;
        go_on();
    }
}

}  // namespace wedgescope::covering
