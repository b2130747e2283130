// What goes spoke by spoke: pieces where one emerges, hides or meets a void, those that are cut in halves, and the marks of
// what is seen, hidden or void.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

#include "lib/front.hpp"
#include "lib/lanes.hpp"

namespace wedgescope {
namespace {

/// Calls deposit(a, b) for the parts of a rising piece, halved until each is all but in one place: under a low sensor
/// a piece may be many times as long as its beginning is far, and its echo falls with the fourth power of the range.
template <class Together, class Point, class Deposit>
void halve(PieceEnd a, const PieceEnd& b, const Together& together, const Point& point, const Deposit& deposit) {
    std::array<PieceEnd, 40> ends;  // still to come, the nearest last
    std::size_t n = 0;
    ends[n++] = b;
    while (n > 0) {
        const PieceEnd next = ends[n - 1];
        const bool known = next.sine == next.sine;  // else halves are no better
        if (!known || together(a, next) || n == ends.size()) {
            if (next.sine > a.sine) deposit(a, next);
            a = {next.part, next.range_m, std::max(a.sine, next.sine), next.x};
            --n;
        } else {
            ends[n++] = point(0.5 * (a.part + next.part));
        }
    }
}

}  // namespace

void Front::find_facet(std::size_t i, std::size_t lane, const Way& way, double begin, double end) {
    if (!needs_facets_) return;
    struct End {
        double part, minor, arc, height, up, out;
        SampleLanes lanes() { return {&part, &minor, &arc, &height, &up, &out, nullptr, nullptr, nullptr}; }
    };
    const auto end_at = [&](double u) {
        return End{way.part(u), way.minor(u), way.arc_m(u), way.height_m(u), way.up_m(u), way.out_m(u)};
    };
    End first = end_at(begin), last = end_at(end);
    facet_lanes(1, {first.lanes(), last.lanes(), posts_.data() + 2 * i, posts_.data() + 2 * tile_lanes + 2 * i,
                    lanes_.across.data() + lane, lanes_.slant.data() + lane, minor_post_m_ * post_, facet_.data()});
}

double Front::power_of(std::size_t lane, double sine0, double sine1, double range0_m, double range1_m) const {
    const double power = piece_power(sine0, sine1, range0_m, range1_m, *scene_->pattern, scene_->constant);
    if (!scene_->loss) return power;
    return power *
           scene_->loss->factor(0.5 * (range0_m + range1_m), 0.5 * (sine0 + sine1), lanes_.inverse_radius[lane]);
}

Front::Track Front::track(const Way& way, const PieceEnd& a, const PieceEnd& b) const {
    return {between_.major(way.part(a.part)), way.minor(a.part), between_.major(way.part(b.part)), way.minor(b.part)};
}

void Front::rise(std::size_t lane, std::size_t i, Samples& next, double begin, const PieceEnd& last, double bow) {
    const Way way = this->way(i, next);
    const SampleLanes &from = way.from, &to = way.to;
    const double range_bins = way.range_bins;
    double& horizon = lanes_.horizon[lane];
    PieceEnd first = begin > 0 ? way.at(begin) : PieceEnd{0, *from.range_m, horizon, *from.x};
    first.sine = horizon;
    ++cost_.pieces;
    const bool own = lanes_.row[lane] >= 0;
    // Where it lies: what is cut in halves may be nearer than both its ends.
    double near = std::min(first.x, last.x), far = std::max(first.x, last.x);
    if (own || shore_) {
        const auto deposit = [&](const PieceEnd& a, const PieceEnd& b, double bent) {
            find_facet(i, lane, way, a.part, b.part);
            const double power = power_of(lane, a.sine, b.sine, a.range_m, b.range_m),
                         fall =
                             echo_bow(a.sine, b.sine, a.range_m, b.range_m, *scene_->pattern, scene_->range_is_ground);
            put(lane, {{a.x, b.x, power, std::clamp(bent + fall, -1.0, 1.0)},
                       track(way, a, b),
                       a.sine,
                       b.sine,
                       facet_[0],
                       &way.from,
                       &way.to,
                       a.part,
                       b.part});
        };
        // By what lies before the middle, with it the fall by range that echo_bow() expects of a sine that goes with the height
        // over the ray.
        const auto bend = [&](const PieceEnd& a, const PieceEnd& b, double otherwise) {
            const PieceEnd middle = way.at(0.5 * (a.part + b.part));
            const double power = (middle.sine - a.sine) / (b.sine - a.sine), gone = (middle.x - a.x) / (b.x - a.x);
            if (!(gone > 0.1 && gone < 0.9 && power > 0 && power < 1)) return otherwise;
            return (power - gone) / (gone * (1 - gone)) - 2 * (b.range_m - a.range_m) / (a.range_m + b.range_m) +
                   (scene_->range_is_ground ? cosine_growth(a.sine, b.sine) : 0);
        };
        const PatternTable& pattern = *scene_->pattern;
        const bool drops = pattern.meets_drop(first.sine, last.sine);
        constexpr double least_cut = 0x1p-16;  // of a piece: what a drop of the pattern is smeared over
        // Lanes interpolate between the entries on either side of a drop.
        const auto leave = [&](const PieceEnd& a, const PieceEnd& b, double bent) {
            if (parts_wait_ && !drops)
                keep_piece(lane, i, way, a, b, bent);
            else
                deposit(a, b, bent);
        };
        const double across = *to.up_m * *from.out_m - *from.up_m * *to.out_m;
        const auto together = [&](const PieceEnd& a, const PieceEnd& b) {
            const double part = b.part - a.part, bent = way.bump_m * part * part;
            return one_range(a.range_m, b.range_m, b.sine - a.sine, b.sine) &&
                   straight_range(bent, b.sine, range_bins) &&
                   !turns_in_range(across * part, b.range_m, bent, b.sine, (b.range_m - a.range_m) * range_bins,
                                   range_bins) &&
                   (turning_posts_ == 0 || short_turn(a.sine, b.sine, scene_->laws->most_turn())) &&
                   (!drops || part <= least_cut || !pattern.passes_drop(a.sine, b.sine)) &&
                   pattern.straight_over(a.sine, b.sine);
        };
        if (!together(first, last))
            halve(
                first, last, together, [&](double u) { return way.at(u); },
                [&](const PieceEnd& a, const PieceEnd& b) {
                    leave(a, b, bend(a, b, 0.0));
                    near = std::min({near, a.x, b.x});
                    far = std::max({far, a.x, b.x});
                });
        else  // near the vertical the sine grows as the square of the way, and range so on a plain alone
            leave(first, last, *from.arc_m == 0 ? bend(first, last, bow) : bow);
    }
    if (own) show(lane, near, far, last.sine);
    horizon = last.sine;
}

void Front::show(std::size_t lane, double near, double far, double sine) {
    if (sine > lanes_.void_horizon[lane]) {
        lanes_.seen_least[lane] = std::min(lanes_.seen_least[lane], near);
        lanes_.seen_most[lane] = std::max(lanes_.seen_most[lane], far);
    } else {
        cells_->mark(lanes_.target(lane), near, far, bit_unknown);
    }
}

void Front::change(std::size_t n, std::size_t begin, const StepScene& step, Samples& next) {
    using Lane = std::uint8_t;
    std::array<Lane, tile_lanes> cut;
    std::size_t count = 0;
    for (std::uint64_t left = lanes_of_code(2, n, plain_.code.data()); left != 0; left &= left - 1) {
        const auto i = static_cast<std::size_t>(std::countr_zero(left));
        const std::size_t lane = begin + i;
        if (next.sine[i] != next.sine[i] || is(lane, mode_gap)) {
            change_by_void(lane, i, next);
            continue;
        }
        const bool visible = is(lane, mode_visible);
        const std::size_t k = count++;
        cut[k] = static_cast<Lane>(i);
        cuts_.horizon[k] = lanes_.horizon[lane];
        cuts_.on_horizon[k] = visible ? 1 : 0;
        cuts_.arc0[k] = now_.arc[i], cuts_.arc1[k] = next.arc[i];
        cuts_.up0[k] = now_.up[i], cuts_.up1[k] = next.up[i];
        cuts_.out0[k] = now_.out[i], cuts_.out1[k] = next.out[i];
        cuts_.range0[k] = now_.range[i], cuts_.range1[k] = next.range[i];
        cuts_.x0[k] = now_.x[i], cuts_.x1[k] = next.x[i];
        cuts_.sine1[k] = next.sine[i];
        cuts_.bump_m[k] = bump_[i];
        cuts_.inverse_radius[k] = lanes_.inverse_radius[lane];
        cuts_.hidden_from[k] = visible ? now_.arc[i] : lanes_.mark_from[lane];
    }
    if (count == 0) return;
    cut_pieces(count, step, cuts_);
    for (std::size_t k = 0; k < count; ++k) change_by_horizon(begin + cut[k], cut[k], k, next);
}

void Front::change_by_horizon(std::size_t lane, std::size_t i, std::size_t k, Samples& next) {
    const bool seen = cuts_.seen[k] == 1, hides = cuts_.hides[k] == 1, own = lanes_.row[lane] >= 0;
    if (!seen || cuts_.begin[k] > 0) {
        // Behind the horizon from the start, or soon.
        if (is(lane, mode_visible)) {
            mark_seen(lane);
            lanes_.mark_from[lane] = now_.arc[i];
            lanes_.mode[lane] = mode_hidden;
        }
        if (!seen) return;
        if (own) cells_->mark(lanes_.target(lane), cuts_.shadow0[k], cuts_.shadow1[k], bit_shadow);
    }
    double& horizon = lanes_.horizon[lane];
    const PieceEnd top{cuts_.end[k], cuts_.range_top[k], cuts_.sine_top[k], cuts_.x_top[k]};
    if (top.sine > horizon) {
        if (cuts_.plain[k] == 1 && parts_wait_ && turning_posts_ == 0) {
            const PieceEnd out{cuts_.begin[k], cuts_.range_out[k], horizon, cuts_.x_out[k]};
            ++cost_.pieces;
            if (own) {
                keep_piece(lane, i, way(i, next), out, top, cuts_.bow[k]);
                show(lane, std::min(out.x, top.x), std::max(out.x, top.x), top.sine);
            }
            horizon = top.sine;
        } else {
            rise(lane, i, next, cuts_.begin[k], top, cuts_.bow[k]);
        }
    }
    lanes_.mode[lane] = hides ? mode_hidden : mode_visible;
    if (!hides) return;
    // Its highest point in view lies inside the piece.
    mark_seen(lane);
    lanes_.mark_from[lane] = now_.arc[i] + top.part * (next.arc[i] - now_.arc[i]);
}

void Front::change_by_void(std::size_t lane, std::size_t i, const Samples& next) {
    const double sine = next.sine[i], arc = next.arc[i];
    const bool valid = sine == sine;
    if (!valid && !is(lane, mode_gap)) {
        mark_seen(lane);
        if (is(lane, mode_hidden)) mark_shadow(lane, now_.arc[i]);
        lanes_.mode[lane] = mode_gap;
        lanes_.gap_from[lane] = lanes_.mark_from[lane] = now_.arc[i];
        lanes_.gap_top[lane] = -infinite;
    }
    grow_gap(lane, i);
    if (!valid) {
        if (shore_) lanes_.shore[lane] = {};  // what is there, nobody knows
        return;
    }
    end_gap(lane, arc);
    double& horizon = lanes_.horizon[lane];
    horizon = std::max(horizon, sine);
    lanes_.mode[lane] = sine >= horizon ? mode_visible : mode_hidden;
    lanes_.mark_from[lane] = arc;
}

// ---- marks ----

double Front::level_coordinate(std::size_t lane, double arc_m) const {
    if (scene_->range_is_ground) return arc_m * bins_per_metre_;
    return sight_line(scene_->sensor_m, arc_m, scene_->reference_m, lanes_.inverse_radius[lane]).range_m *
           bins_per_metre_;
}

double Front::ray_coordinate(std::size_t lane, double arc_m) const {
    if (scene_->range_is_ground) return arc_m * bins_per_metre_;
    return ray_range_m(scene_->sensor_m, arc_m, lanes_.horizon[lane], lanes_.inverse_radius[lane]) * bins_per_metre_;
}

void Front::mark_seen(std::size_t lane) {
    if (lanes_.row[lane] >= 0 && lanes_.seen_most[lane] >= lanes_.seen_least[lane])
        cells_->mark(lanes_.target(lane), lanes_.seen_least[lane], lanes_.seen_most[lane], bit_seen);
    lanes_.seen_least[lane] = infinite;
    lanes_.seen_most[lane] = -infinite;
}

void Front::mark_shadow(std::size_t lane, double to_arc_m) {
    if (lanes_.row[lane] < 0) return;
    cells_->mark(lanes_.target(lane), ray_coordinate(lane, lanes_.mark_from[lane]), ray_coordinate(lane, to_arc_m),
                 bit_shadow);
}

void Front::mark_gap(std::size_t lane, double to_arc_m) {
    if (lanes_.row[lane] < 0) return;
    cells_->mark(lanes_.target(lane), level_coordinate(lane, lanes_.mark_from[lane]), level_coordinate(lane, to_arc_m),
                 bit_no_data);
}

void Front::mark_rest(std::size_t lane, double from_arc_m) {
    if (lanes_.row[lane] < 0) return;
    cells_->mark(lanes_.target(lane), level_coordinate(lane, from_arc_m), infinite, bit_no_data);
}

void Front::grow_gap(std::size_t lane, std::size_t i) {
    const auto raise = [&](const LinePosts& line, double minor) {
        for (std::int64_t j = floor_of(minor); j <= floor_of(minor) + 1; ++j)
            if (line.has(j) && line.at(j) == line.at(j))
                lanes_.gap_top[lane] = std::max(lanes_.gap_top[lane], static_cast<double>(line.at(j)));
    };
    if (between_.adjacent) raise(between_.behind, now_.minor[i]);
    raise(between_.ahead, ahead_.minor[i]);
    // And what stands on corners of the piece's own cell, which the spoke may leave by a side before the line ahead.
    for (const std::size_t line : {std::size_t{0}, 2 * tile_lanes})
        for (std::size_t k = line + 2 * i; k < line + 2 * i + 2; ++k)
            if (posts_[k] == posts_[k])
                lanes_.gap_top[lane] = std::max(lanes_.gap_top[lane], static_cast<double>(posts_[k]));
}

void Front::end_gap(std::size_t lane, double arc_m) {
    mark_gap(lane, arc_m);
    const double top = lanes_.gap_top[lane];
    if (!(top > -infinite)) return;
    for (const double arc : {std::max(lanes_.gap_from[lane], 1e-3), arc_m})
        lanes_.void_horizon[lane] = std::max(lanes_.void_horizon[lane],
                                             sight_line(scene_->sensor_m, arc, top, lanes_.inverse_radius[lane]).sine);
}

}  // namespace wedgescope
