#include "lib/spoke_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "lib/error.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {

namespace {

/// What spokes_per_post is multiplied by on a line so many `posts` from the nadir, posts of a level of detail; bins hold
/// Sampling::thin_from_posts of them `to_thin` from there. Never falls with `posts`.
double counted_posts(const Sampling& sampling, double post, double posts, double to_thin) {
    if (sampling.above_posts / post < 40) return posts;
    double counted = std::min(posts, to_thin), share = 1, from = 0;
    const auto up_to = [&](double end) {
        if (posts > from) counted = std::max(counted, share * std::min(posts, end));
        from = end;
    };
    for (std::size_t i = 0; i < Sampling::quiet_shares.size(); ++i) {
        up_to(sampling.quiet_posts[i] / post);
        share = std::max(Sampling::quiet_shares[i], std::min(1.0, Sampling::least_per_post / sampling.spokes_per_post));
    }
    up_to(infinite);
    return counted;
}

}  // namespace

Sampling sampling(Quality quality, GroundCover cover, double above_posts) {
    const bool culture_height = cover == GroundCover::heights, classes = cover == GroundCover::classes;
    const double lowest_posts = culture_height ? 5 : 4;
    const bool low = above_posts < (culture_height ? 20 : 14), high = above_posts >= 40;
    double more = low ? 1 : !high ? 0.5 : cover == GroundCover::bare ? 0.375 : 0.25;
    for (double above = above_posts; more < 16 && above < lowest_posts; above *= 2) more *= 2;
    const auto dense = [&](double per_post, double per_bin, double low_lead, double lead = 4) {
        return Sampling{.spokes_per_post = per_post,
                        .spokes_per_bin = std::clamp(more * per_bin, 3.0, 192.0),
                        .above_posts = above_posts,
                        .lead = low ? low_lead : lead};
    };
    switch (quality) {
        case Quality::draft:
            return dense(0.6, culture_height ? 12 : 3, 1, 1);
        case Quality::normal:
            if (culture_height) return dense(1.25, 24, 2);
            if (classes) return low ? dense(1.25, 12, 2) : dense(1, 8, 2);
            return dense(high ? 0.6 : 1, above_posts < lowest_posts ? 6 : 8, 2);
        case Quality::fine:
            if (culture_height) return dense(2, 36, 2);
            return classes ? dense(1.6, 14, 4) : dense(1.25, 12, 4);
        case Quality::exact:
            if (culture_height) return dense(4, 72, 2);
            return classes ? dense(low ? 2.5 : 3.4, 32, 2) : dense(low ? 2 : 1.5, 24, 2);
    }
    return {};
}

Sampling own_sampling(const Scene& scene, const Sampling& of_quality) {
    return {.spokes_per_post = scene.spokes_per_post.value_or(of_quality.spokes_per_post),
            .spokes_per_bin = of_quality.spokes_per_bin,
            .above_posts = scene.spokes_per_post ? 0 : of_quality.above_posts,
            .lead = scene.spoke_lead.value_or(of_quality.lead),
            .cross_lines = scene.crossings.value_or(of_quality.cross_lines),
            .exact_course = scene.curved_course.value_or(of_quality.exact_course)};
}

Sampling sampling(const Scene& scene, GroundCover cover, double above_posts) {
    Sampling own = own_sampling(scene, sampling(scene.quality, cover, above_posts));
    own.spokes_per_bin = scene.spokes_per_bin.value_or(own.spokes_per_bin);
    return own;
}

int DetailLevels::coarsest() const {
    int level = 0;
    for (const std::vector<Step>& fan : steps)
        for (const Step& step : fan) level = std::max(level, step.level);
    return level;
}

namespace {

double farthest_arc_m(const SpokeMap& map, const DetailLevels& levels) {
    const SpokeMapParams& params = map.params();
    const double own = params.max_arc_m,
                 more = params.beyond_m +
                        params.margin_m * static_cast<double>((std::int64_t{1} << levels.coarsest()) - 1);
    return map.straight() ? own + more : std::min(own + more, SpokeMap::laid_out * own);
}

}  // namespace

SpokeGrid::SpokeGrid(const DataBase& data_base, const SpokeMap& map, const Sampling& sampling, std::int64_t circle_bins,
                     const DetailLevels& levels)
    : data_base_(data_base), map_(map), circle_bins_(circle_bins),
      azimuth_step_(2 * std::numbers::pi / static_cast<double>(circle_bins)), max_arc_m_(farthest_arc_m(map, levels)),
      fans_each_(levels.any() ? levels.fans : 1), lines_(all_quadrants.size() * static_cast<std::size_t>(fans_each_)) {
    // What the bins ask for, the same in all quadrants.
    const double widest = azimuth_step_ / std::max(2.0, sampling.spokes_per_bin);
    double least = 64;
    for (Quadrant q : all_quadrants) least = std::max(least, map.azimuth_per_slope(q) / widest);
    for (Quadrant q : all_quadrants) {
        const double nadir = map.nadir_major(q);
        const std::int64_t posts = lines_are_columns(q) ? data_base.columns : data_base.rows;
        const bool cyclic = data_base.cyclic && lines_are_columns(q);
        double least_f = map.metres_per_post(q, 0);
        for (int i = -64; i <= 64; ++i) least_f = std::min(least_f, map.metres_per_post(q, i / 64.0));
        // Posts; no spoke is followed beyond, though posts may grow narrower on the way.
        const double farthest = std::max(1.1 * map.params().max_arc_m, 1.03 * max_arc_m_) / least_f + 2;
        // The first line ahead of the nadir, inside the raster.
        std::int64_t first = 0, count = 0;
        if (outward(q) > 0) {
            first = static_cast<std::int64_t>(std::floor(nadir)) + 1;
            if (!cyclic) first = std::max<std::int64_t>(first, 0);
            const std::int64_t end = cyclic ? first + data_base.cycle_columns / 2 - 1 : posts;
            count = std::max<std::int64_t>(0, end - first);
        } else {
            first = static_cast<std::int64_t>(std::ceil(nadir)) - 1;
            if (!cyclic) first = std::min(first, posts - 1);
            const std::int64_t end = cyclic ? first - data_base.cycle_columns / 2 + 1 : -1;
            count = std::max<std::int64_t>(0, first - end);
        }
        const double first_distance = count ? std::abs(static_cast<double>(first) - nadir) : 0;
        count = std::clamp<std::int64_t>(static_cast<std::int64_t>(std::ceil(farthest - first_distance)) + 1, 0, count);
        for (int i = 0; i < fans_each_; ++i) {
            set_bands({q, i}, first, count, levels);
            set_rings({q, i}, sampling, least);
        }
    }
}

SpokeGrid SpokeGrid::finer(int times) const {
    SpokeGrid grid = *this;
    for (FanLines& lines : grid.lines_)
        for (Ring& ring : lines.rings) ring.spokes *= times;
    return grid;
}

void SpokeGrid::set_bands(Fan f, std::int64_t first_line, std::int64_t line_count, const DetailLevels& levels) {
    FanLines& lines = lines_[place_of(f)];
    lines.clockwise = map_.azimuth_rad(f.quadrant, 1) > map_.azimuth_rad(f.quadrant, -1);
    lines.to_bin_of_post = map_.azimuth_per_slope(f.quadrant) / azimuth_step_;
    const std::int64_t out = outward(f.quadrant), last = first_line + out * (line_count - 1);
    lines.bands.push_back({0, {0, line_count}, first_line});
    if (levels.any() && line_count > 0)
        for (const DetailLevels::Step& step : levels.steps[place_of(f)]) {
            Band& before = lines.bands.back();
            const std::int64_t post = std::int64_t{1} << before.level;
            if ((step.border - before.first * post) * out < 0 || (last - step.border) * out < 0) continue;
            const std::int64_t ahead = (step.border - before.first * post) * out / post + 1;
            before.lines.end = before.lines.begin + ahead;
            const std::int64_t level_post = std::int64_t{1} << step.level;
            lines.bands.push_back({step.level,
                                   {before.lines.end, before.lines.end + (last - step.border) * out / level_post},
                                   step.border / level_post + out});
        }
    while (lines.bands.size() > 1 && lines.bands.back().lines.empty()) lines.bands.pop_back();
    lines.line_count = lines.bands.back().lines.end;
}

double SpokeGrid::needed_spokes(Fan f, const Sampling& sampling, double least, std::int64_t line) const {
    const FanLines& lines = of(f);
    // Dense enough, on every line up to `lead` times as far, for the posts of its level.
    const double d = distance(f, line), last = distance(f, lines.line_count - 1),
                 dense_to = std::min(d * sampling.lead, std::max(d, last)),
                 spokes_a_post = sampling.spokes_per_post * map_.spacing_slack(),
                 to_thin = Sampling::thin_from_posts * lines.to_bin_of_post;
    double most = least;
    for (const Band& band : lines.bands) {
        if (&band != &lines.bands.front() && distance(f, band.lines.begin) > dense_to) break;
        const double end = &band == &lines.bands.back() ? dense_to : distance(f, band.lines.end - 1),
                     post = static_cast<double>(std::int64_t{1} << band.level);
        most = std::max(most, spokes_a_post * counted_posts(sampling, post, std::min(dense_to, end) / post, to_thin));
    }
    return most;
}

std::vector<Ring> SpokeGrid::rings_from(Fan f, const Sampling& sampling, double least, std::int64_t spokes) const {
    const FanLines& lines = of(f);
    const auto enough = [&](std::int64_t line, std::int64_t k) {
        return static_cast<double>(k) >= needed_spokes(f, sampling, least, line);
    };
    std::vector<Ring> rings{{spokes, {0, 0}}};
    for (std::int64_t i = 0; i < lines.line_count;) {
        for (; !enough(i, spokes); rings.push_back({spokes, {i, i}})) spokes *= 2;
        // The ring's last line: what is needed never falls.
        std::int64_t next = i + 1, end = lines.line_count;
        while (next < end) {
            const std::int64_t middle = next + (end - next) / 2;
            if (enough(middle, spokes))
                next = middle + 1;
            else
                end = middle;
        }
        rings.back().lines.end = next;
        i = next;
    }
    return rings;
}

void SpokeGrid::set_rings(Fan f, const Sampling& sampling, double least) {
    FanLines& lines = lines_[place_of(f)];
    const auto whole_steps = [](double spokes) {
        return static_cast<std::int64_t>(std::ceil(spokes / static_cast<double>(spoke_step))) * spoke_step;
    };
    const std::int64_t first = whole_steps(lines.line_count ? needed_spokes(f, sampling, least, 0) : least);
    lines.rings = rings_from(f, sampling, least, first);
    if (!lines.line_count) return;
    // Or so many that the farthest lines, which have most of the samples, get no more than they need. The farther a line the
    // less of it is seen: samples count less with the root of the distance.
    const auto cost = [&](const std::vector<Ring>& rings) {
        double sum = 0;
        for (const Ring& ring : rings)
            if (!ring.lines.empty())
                sum += static_cast<double>(ring.spokes) *
                       (std::sqrt(distance(f, ring.lines.end - 1)) -
                        (ring.lines.begin > 0 ? std::sqrt(distance(f, ring.lines.begin - 1)) : 0));
        return sum;
    };
    double least_for_last = needed_spokes(f, sampling, least, lines.line_count - 1);
    while (least_for_last / 2 > static_cast<double>(first)) least_for_last /= 2;
    std::vector<Ring> other = rings_from(f, sampling, least, whole_steps(least_for_last));
    if (cost(other) < cost(lines.rings)) lines.rings = std::move(other);
}

Interval SpokeGrid::strip_lines(Fan f, std::int64_t line, std::int64_t strip) const {
    const Quadrant q = f.quadrant;
    const std::int64_t at = line_index(f, line), cell = outward(q) > 0 ? at - 1 : at,
                       in_strip = ((cell % strip) + strip) % strip;
    const std::int64_t count = outward(q) > 0 ? strip - in_strip : in_strip + 1;
    return {line, std::min(band_of(f, line).lines.end, line + count)};
}

Window SpokeGrid::window(Fan f, std::int64_t spokes, Interval run, Interval lines) const {
    if (lines.empty() || run.empty()) return {};
    const Quadrant q = f.quadrant;
    const Band& band = band_of(f, lines.begin);
    const double post = static_cast<double>(std::int64_t{1} << band.level);
    const double lo = slope(spokes, std::max(least_spoke(f, spokes), run.begin - 1)),
                 hi = slope(spokes, std::min(most_spoke(f, spokes), run.end));
    double least = std::numeric_limits<double>::infinity(), most = -least;
    const auto look = [&](std::int64_t line) {
        const double d = distance(f, line);
        least = std::min(least, map_.place(q, lo, d).minor / post);
        most = std::max(most, map_.place(q, hi, d).minor / post);
    };
    // Between two of these a spoke leaves the straight way by less than the margin.
    std::int64_t step = 16;
    while (step > 1 && map_.sag(q, static_cast<double>(step), post) > 1) step /= 2;
    const Interval all_lines{std::max<std::int64_t>(lines.begin - 1, 0), lines.end};
    for (std::int64_t i = all_lines.begin; i < lines.end; i += map_.straight() ? all_lines.size() : step) look(i);
    look(lines.end - 1);
    const DataBase& db = data_base_;
    const std::int64_t nadir = floor_of(map_.nadir_minor(q));
    const Interval all = db.cyclic && !lines_are_columns(q)
                             ? Interval{nadir - db.cycle_columns / 2, nadir + db.cycle_columns / 2}
                             : Interval{0, posts_at(lines_are_columns(q) ? db.rows : db.columns, band.level)};
    const Interval minor = intersection({floor_of(least) - 2, floor_of(most) + 4}, all);
    if (minor.empty()) return {};
    // The line behind the first one, in posts of this level.
    const std::int64_t a = line_index(f, lines.begin) - (lines.begin > 0 ? outward(q) : 0),
                       b = line_index(f, lines.end - 1);
    const Interval major{std::min(a, b), std::max(a, b) + 1};
    return lines_are_columns(q) ? Window{major, minor} : Window{minor, major};
}

double SpokeGrid::distance(Fan f, std::int64_t line) const {
    const Band& band = band_of(f, line);
    const std::int64_t index = band.first + outward(f.quadrant) * (line - band.lines.begin);
    return std::abs(static_cast<double>(index * (std::int64_t{1} << band.level)) - map_.nadir_major(f.quadrant));
}

double SpokeGrid::edge_azimuth(Quadrant q, std::int64_t spokes, std::int64_t half_index) const {
    return map_.azimuth_rad(q, static_cast<double>(half_index) / static_cast<double>(2 * spokes));
}

SpokeGrid::Share SpokeGrid::share(Fan f, std::int64_t spokes, std::int64_t k) const {
    double lo = edge_azimuth(f.quadrant, spokes, std::max(2 * k - 1, 2 * least_spoke(f, spokes)));
    double hi = edge_azimuth(f.quadrant, spokes, std::min(2 * k + 1, 2 * most_spoke(f, spokes)));
    if (lo > hi) std::swap(lo, hi);
    Share s;
    s.bin = static_cast<std::int64_t>(std::floor(lo / azimuth_step_));
    const double border = rounded(static_cast<double>(s.bin + 1) * azimuth_step_, angle_bits);
    if (hi <= border) {
        s.radians[0] = hi - lo;
    } else {
        s.radians[0] = std::max(0.0, border - lo);
        s.radians[1] = hi - border;
    }
    return s;
}

Interval SpokeGrid::touching_spokes(Fan f, std::int64_t spokes, double azimuth_lo, double azimuth_hi) const {
    // Cells are in order of azimuth (backwards in k if the quadrant is not clockwise): two binary searches.
    const bool clockwise = of(f).clockwise;
    const std::int64_t least = least_spoke(f, spokes), most = most_spoke(f, spokes);
    const auto low_edge = [&](std::int64_t i) {  // i counts cells in order of azimuth, from 0
        const std::int64_t k = clockwise ? least + i : most - i;
        return edge_azimuth(f.quadrant, spokes,
                            clockwise ? std::max(2 * k - 1, 2 * least) : std::min(2 * k + 1, 2 * most));
    };
    const auto first_not_below = [&](double azimuth) {  // least i with low_edge(i) >= azimuth, or one after the last
        std::int64_t a = 0, b = most - least + 1;
        while (a < b) {
            const std::int64_t middle = (a + b) / 2;
            if (low_edge(middle) >= azimuth)
                b = middle;
            else
                a = middle + 1;
        }
        return a;
    };
    const std::int64_t begin = std::max<std::int64_t>(0, first_not_below(azimuth_lo) - 1);
    const std::int64_t end = first_not_below(azimuth_hi);  // exclusive
    if (end <= begin) return {};
    return clockwise ? Interval{least + begin, least + end} : Interval{most - end + 1, most - begin + 1};
}

Wedge SpokeGrid::wedge(std::int64_t index, Interval bins) const {
    Wedge wedge{index, bins, {}};
    for (Quadrant q : all_quadrants)
        for (int fan = 0; fan < fans_each_; ++fan) {
            double lo = map_.azimuth_rad(q, 2.0 * fan / fans_each_ - 1),
                   hi = map_.azimuth_rad(q, 2.0 * (fan + 1) / fans_each_ - 1);
            if (lo > hi) std::swap(lo, hi);
            for (std::int64_t turn = -2; turn <= 2; ++turn) {
                // The wedge's bins in the quadrant's count, cut to those the quadrant touches.
                const std::int64_t shift = turn * circle_bins_;
                const Interval touched{static_cast<std::int64_t>(std::floor(lo / azimuth_step_)),
                                       static_cast<std::int64_t>(std::floor(hi / azimuth_step_)) + 1};
                const Interval mine = intersection({bins.begin + shift, bins.end + shift}, touched);
                if (mine.empty()) continue;
                SpokeRun run;
                run.quadrant = q;
                run.fan = fan;
                run.bins = mine;
                run.first_row = mine.begin - shift - bins.begin;
                const double from = rounded(static_cast<double>(mine.begin) * azimuth_step_, angle_bits);
                const double to = rounded(static_cast<double>(mine.end) * azimuth_step_, angle_bits);
                const auto& all = rings({q, fan});
                bool any = false;
                for (const Ring& ring : all) {
                    run.touching.push_back(touching_spokes({q, fan}, ring.spokes, from, to));
                    any = any || !run.touching.back().empty();
                }
                if (!any) continue;
                // From the outermost ring inwards: a spoke needs its parents.
                run.spokes = run.touching;
                for (std::size_t i = all.size(); i-- > 1;) {
                    const Interval children = run.spokes[i];
                    if (children.empty()) continue;
                    Interval parents = children;
                    for (std::int64_t k = all[i].spokes; k > all[i - 1].spokes; k /= 2)
                        parents = {static_cast<std::int64_t>(std::floor(static_cast<double>(parents.begin) / 2)),
                                   static_cast<std::int64_t>(std::ceil(static_cast<double>(parents.end - 1) / 2)) + 1};
                    run.spokes[i - 1] = hull(run.spokes[i - 1], parents);
                }
                wedge.runs.push_back(std::move(run));
            }
        }
    return wedge;
}

}  // namespace wedgescope
