#include "tiles/raster_places.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

namespace wedgescope {

Interval grid_posts(double own0, double own_step, std::int64_t posts, double beyond) {
    const double a = (-beyond - own0) / own_step, b = (static_cast<double>(posts - 1) + beyond - own0) / own_step;
    return {static_cast<std::int64_t>(std::ceil(std::min(a, b) - on_a_post)),
            static_cast<std::int64_t>(std::floor(std::max(a, b) + on_a_post)) + 1};
}

AlongGrid along_grid(double grid0, double grid_step, double own_corner, double own_step, std::int64_t posts) {
    AlongGrid axis{(grid0 - own_corner) / own_step - 0.5, grid_step / own_step, false, {}};
    const double one = axis.step < 0 ? -1 : 1;  // from the other end, as of a raster that grows north among others
    if (near(axis.step, one, on_a_post / static_cast<double>(posts)) &&
        near(axis.own, std::round(axis.own), on_a_post)) {
        axis.step = one;
        axis.own = std::round(axis.own);
        axis.on_posts = true;
    }
    axis.posts = grid_posts(axis.own, axis.step, posts);
    return axis;
}

std::vector<double> unrolled(const std::vector<double>& west, const std::vector<double>& width) {
    std::vector<std::size_t> order(west.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    const auto on_circle = [](double x) { return x - 360 * std::floor(x / 360); };
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return on_circle(west[a]) < on_circle(west[b]); });
    // The widest gap on the circle is where the data base begins.
    double reach = on_circle(west[order[0]]), widest = -1;
    std::size_t begin = 0;
    for (std::size_t k = 0; k < order.size(); ++k) {
        reach = std::max(reach, on_circle(west[order[k]]) + width[order[k]]);
        const double next = k + 1 < order.size() ? on_circle(west[order[k + 1]]) : on_circle(west[order[0]]) + 360;
        if (next - reach > widest + 1e-9) {
            widest = next - reach;
            begin = (k + 1) % order.size();
        }
    }
    const double first = on_circle(west[order[begin]]);
    // Where the rasters lie anyhow, if that is possible.
    const double turn = 360 * std::round((west[order[begin]] - first) / 360);
    std::vector<double> out(west.size());
    for (std::size_t i = 0; i < west.size(); ++i) {
        const double x = on_circle(west[i]);
        out[i] = (x < first - 1e-9 ? x + 360 : x) + turn;
    }
    return out;
}

std::optional<std::size_t> seam_of(const std::vector<double>& west, const std::vector<double>& width, double circle) {
    for (std::size_t i = 0; i < west.size(); ++i)
        if (width[i] >= circle) return i;
    const auto first = static_cast<std::size_t>(std::min_element(west.begin(), west.end()) - west.begin());
    double east = west[first];
    for (std::size_t i = 0; i < west.size(); ++i) east = std::max(east, west[i] + width[i]);
    return east - west[first] >= circle ? std::optional(first) : std::nullopt;
}

Neighbours::Side Neighbours::side(double own, double step, std::int64_t posts) {
    const double a = -own / step, b = (static_cast<double>(posts - 1) - own) / step;
    return Side{std::min(a, b), std::max(a, b), 1 / std::fabs(step)};
}

template <class Found>
void Neighbours::each_pair(const std::array<double, 2>& apart, const Found& found) const {
    std::vector<std::size_t> order(places_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    for (std::size_t axis : {0U, 1U}) {
        const auto first = [&](std::size_t i) { return places_[i][axis].first; };
        std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return first(a) < first(b); });
        for (std::size_t a = 0; a < places_.size(); ++a) {
            const double last = places_[a][axis].last;
            for (auto b = std::lower_bound(order.begin(), order.end(), last - on_a_post * coarsest_[axis],
                                           [&](std::size_t i, double at) { return first(i) < at; });
                 b != order.end() && first(*b) <= last + apart[axis]; ++b) {
                const Side &u = places_[a][1 - axis], &v = places_[*b][1 - axis];
                const double tolerance = on_a_post * std::max(u.posting, v.posting);
                if (*b != a && std::max(u.first, v.first) <= std::min(u.last, v.last) + tolerance) found(axis, a, *b);
            }
        }
    }
}

Neighbours::Neighbours(std::vector<Place> places) : places_(std::move(places)) {
    for (const Place& place : places_)
        for (std::size_t axis : {0U, 1U}) coarsest_[axis] = std::max(coarsest_[axis], place[axis].posting);
    each_pair({on_a_post * coarsest_[0], on_a_post * coarsest_[1]},
              [&](std::size_t axis, std::size_t a, std::size_t b) {
                  const Side &u = places_[a][axis], &v = places_[b][axis];
                  if (near(u.last, v.first, on_a_post * std::max(u.posting, v.posting)))
                      for (std::size_t one : {a, b})
                          for (Side& side : places_[one]) side.beyond = 0;
              });
}

Neighbours::Gaps Neighbours::gaps(std::int64_t columns) const {
    Gaps gaps;
    each_pair({coarsest_[0] + 2, coarsest_[1] + 2}, [&](std::size_t axis, std::size_t a, std::size_t b) {
        const double begin = places_[a][axis].end(), end = places_[b][axis].begin();
        const double post = std::floor(begin + on_a_post) + 1;  // the first of the gap
        if (end - begin >= 2 || post >= end - on_a_post) return;
        if (axis == 0 && (post < 0 || post >= static_cast<double>(columns))) return;  // a circle apart
        const Side &u = places_[a][1 - axis], &v = places_[b][1 - axis];
        const double middle = (std::max(u.first, v.first) + std::min(u.last, v.last)) / 2;
        const auto holds = [&](const Place& c) {
            return c[axis].begin() <= post && post <= c[axis].end() && c[1 - axis].begin() <= middle &&
                   middle <= c[1 - axis].end();
        };
        if (std::any_of(places_.begin(), places_.end(), holds)) return;
        if (gaps.count++ > 0) return;
        gaps.before = a;
        gaps.behind = b;
    });
    return gaps;
}

}  // namespace wedgescope
