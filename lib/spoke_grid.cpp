#include "lib/spoke_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "lib/error.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {

Sampling sampling(Quality quality, bool culture_height, double above_posts) {
    double more = 1;
    for (double above = above_posts; more < 16 && above < (culture_height ? 20 : 14); above *= 2) more *= 2;
    const auto dense = [&](double bare, double with_culture, double lead) {
        return Sampling{.spokes_per_post = std::min(16.0, more * (culture_height ? with_culture : bare)),
                        .lead = lead,
                        .cross_lines = true,
                        .exact_course = true};
    };
    switch (quality) {
        case Quality::draft:
            if (more > 1) return dense(0.5, 0.5, 1);
            return {.spokes_per_post = 1, .lead = 1, .cross_lines = false, .exact_course = false};
        case Quality::normal:
            return dense(0.5, 1, 4);
        case Quality::fine:
            return dense(1, 2, 4);
        case Quality::exact:
            return culture_height ? dense(4, 4, 4) : dense(1, 1, 8);
    }
    return {};
}

Sampling own_sampling(const Scene& scene, Sampling of_quality) {
    return {scene.spokes_per_post.value_or(of_quality.spokes_per_post), scene.spoke_lead.value_or(of_quality.lead),
            scene.crossings.value_or(of_quality.cross_lines), scene.curved_course.value_or(of_quality.exact_course)};
}

SpokeGrid::SpokeGrid(const DataBase& data_base, const SpokeMap& map, const Sampling& sampling, std::int64_t circle_bins)
    : data_base_(data_base), map_(map), circle_bins_(circle_bins),
      azimuth_step_(2 * std::numbers::pi / static_cast<double>(circle_bins)) {
    // The same least K in all quadrants: no spoke wider than half an azimuth bin.
    std::int64_t least = 64;
    for (Quadrant q : all_quadrants)
        while (map.azimuth_per_slope(q) / static_cast<double>(least) > azimuth_step_ / 2) least *= 2;
    for (Quadrant q : all_quadrants) {
        QuadrantLines& lines = quadrants_[static_cast<std::size_t>(q)];
        const double nadir = map.nadir_major(q);
        const std::int64_t count = lines_are_columns(q) ? data_base.columns : data_base.rows;
        const bool cyclic = data_base.cyclic && lines_are_columns(q);
        double least_f = map.metres_per_post(q, 0);
        for (int i = -64; i <= 64; ++i) least_f = std::min(least_f, map.metres_per_post(q, i / 64.0));
        const double farthest = map.params().max_arc_m / least_f * 1.1 + 2;  // posts; no spoke is followed beyond
        // The first line ahead of the nadir, inside the raster.
        if (outward(q) > 0) {
            lines.first_line = static_cast<std::int64_t>(std::floor(nadir)) + 1;
            if (!cyclic) lines.first_line = std::max<std::int64_t>(lines.first_line, 0);
            const std::int64_t end = cyclic ? lines.first_line + data_base.cycle_columns / 2 - 1 : count;
            lines.line_count = std::max<std::int64_t>(0, end - lines.first_line);
        } else {
            lines.first_line = static_cast<std::int64_t>(std::ceil(nadir)) - 1;
            if (!cyclic) lines.first_line = std::min(lines.first_line, count - 1);
            const std::int64_t end = cyclic ? lines.first_line - data_base.cycle_columns / 2 + 1 : -1;
            lines.line_count = std::max<std::int64_t>(0, lines.first_line - end);
        }
        const double first_distance = lines.line_count ? distance(q, 0) : 0;
        lines.line_count = std::clamp<std::int64_t>(static_cast<std::int64_t>(std::ceil(farthest - first_distance)) + 1,
                                                    0, lines.line_count);
        const double a = map.azimuth_rad(q, -1), b = map.azimuth_rad(q, 1);
        lines.clockwise = b > a;
        // Rings.
        const double spokes_a_post = sampling.spokes_per_post * map.spacing_slack(),
                     last_distance = lines.line_count ? distance(q, lines.line_count - 1) : 0;
        const auto needed = [&](double d, std::int64_t k) {
            const double dense_to = std::min(d * sampling.lead, std::max(d, last_distance));
            while (dense_to * spokes_a_post > static_cast<double>(k)) k *= 2;
            return k;
        };
        std::int64_t k = lines.line_count ? needed(first_distance, least) : least;
        lines.rings.push_back({k, {0, 0}});
        for (std::int64_t i = 0; i < lines.line_count;) {
            const std::int64_t here = needed(distance(q, i), k);
            if (here != k) {
                k = here;
                lines.rings.push_back({k, {i, i}});
            }
            // Straight to the ring's last line.
            const double most = static_cast<double>(k) / spokes_a_post,
                         reach = most < last_distance ? most / sampling.lead : last_distance;
            std::int64_t next = std::min(
                lines.line_count, i + std::max<std::int64_t>(1, static_cast<std::int64_t>(reach - distance(q, i))));
            while (next < lines.line_count && needed(distance(q, next), k) == k) ++next;
            lines.rings.back().lines.end = next;
            i = next;
        }
    }
}

Interval SpokeGrid::strip_lines(Quadrant q, std::int64_t line, std::int64_t strip) const {
    const std::int64_t at = line_index(q, line), cell = outward(q) > 0 ? at - 1 : at,
                       in_strip = ((cell % strip) + strip) % strip;
    const std::int64_t count = outward(q) > 0 ? strip - in_strip : in_strip + 1;
    return {line, std::min(line_count(q), line + count)};
}

Window SpokeGrid::window(Quadrant q, std::int64_t spokes, Interval run, Interval lines) const {
    if (lines.empty() || run.empty()) return {};
    if (lines.begin > 0) --lines.begin;
    const double k = static_cast<double>(spokes);
    const double lo = std::max(-1.0, static_cast<double>(run.begin - 1) / k),
                 hi = std::min(1.0, static_cast<double>(run.end) / k);
    double least = std::numeric_limits<double>::infinity(), most = -least;
    const auto look = [&](std::int64_t line) {
        const double d = distance(q, line);
        least = std::min(least, map_.place(q, lo, d).minor);
        most = std::max(most, map_.place(q, hi, d).minor);
    };
    // Between two of these a spoke leaves the straight way by far less than the margin.
    constexpr std::int64_t step = 16;
    for (std::int64_t i = lines.begin; i < lines.end; i += map_.straight() ? lines.size() : step) look(i);
    look(lines.end - 1);
    const DataBase& db = data_base_;
    const auto floor_of = [](double v) { return static_cast<std::int64_t>(std::floor(v)); };
    const std::int64_t nadir = floor_of(map_.nadir_minor(q));
    const Interval all = db.cyclic && !lines_are_columns(q)
                             ? Interval{nadir - db.cycle_columns / 2, nadir + db.cycle_columns / 2}
                             : Interval{0, lines_are_columns(q) ? db.rows : db.columns};
    const Interval minor = intersection({floor_of(least) - 2, floor_of(most) + 4}, all);
    if (minor.empty()) return {};
    const std::int64_t a = line_index(q, lines.begin), b = line_index(q, lines.end - 1);
    const Interval major{std::min(a, b), std::max(a, b) + 1};
    return lines_are_columns(q) ? Window{major, minor} : Window{minor, major};
}

double SpokeGrid::distance(Quadrant q, std::int64_t line) const {
    return std::abs(static_cast<double>(line_index(q, line)) - map_.nadir_major(q));
}

double SpokeGrid::edge_azimuth(Quadrant q, std::int64_t spokes, std::int64_t half_index) const {
    return map_.azimuth_rad(q, static_cast<double>(half_index) / static_cast<double>(2 * spokes));
}

SpokeGrid::Share SpokeGrid::share(Quadrant q, std::int64_t spokes, std::int64_t k) const {
    double lo = edge_azimuth(q, spokes, std::max(2 * k - 1, -2 * spokes));
    double hi = edge_azimuth(q, spokes, std::min(2 * k + 1, 2 * spokes));
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

Interval SpokeGrid::touching_spokes(Quadrant q, std::int64_t spokes, double azimuth_lo, double azimuth_hi) const {
    // Cells are in order of azimuth (backwards in k if the quadrant is not clockwise): two binary searches.
    const bool clockwise = of(q).clockwise;
    const auto low_edge = [&](std::int64_t i) {  // i counts cells in order of azimuth, 0..2K
        const std::int64_t k = clockwise ? i - spokes : spokes - i;
        return edge_azimuth(q, spokes, clockwise ? std::max(2 * k - 1, -2 * spokes) : std::min(2 * k + 1, 2 * spokes));
    };
    const auto first_not_below = [&](double azimuth) {  // least i in 0..2K+1 with low_edge(i) >= azimuth
        std::int64_t a = 0, b = 2 * spokes + 1;
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
    return clockwise ? Interval{begin - spokes, end - spokes} : Interval{spokes - end + 1, spokes - begin + 1};
}

Wedge SpokeGrid::wedge(std::int64_t index, Interval bins) const {
    Wedge wedge{index, bins, {}};
    for (Quadrant q : all_quadrants) {
        double lo = map_.azimuth_rad(q, -1), hi = map_.azimuth_rad(q, 1);
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
            run.bins = mine;
            run.first_row = mine.begin - shift - bins.begin;
            const double from = rounded(static_cast<double>(mine.begin) * azimuth_step_, angle_bits);
            const double to = rounded(static_cast<double>(mine.end) * azimuth_step_, angle_bits);
            const auto& all = rings(q);
            bool any = false;
            for (const Ring& ring : all) {
                run.touching.push_back(touching_spokes(q, ring.spokes, from, to));
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
