#include "lib/coverage_lanes.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lib/coverage_lanes.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "lib/highway_copies.hpp"

// Compiled once for every instruction set: all that is not a lane operation is + - * / and conversions, and nothing is
// fused, so each gives the same bits.
HWY_BEFORE_NAMESPACE();
namespace wedgescope::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using Floats = hn::CappedTag<float, knot_step>;
using Ints = hn::RebindToSigned<Floats>;
using Lane = hn::Vec<Floats>;
using Index = hn::Vec<Ints>;
using Holds = hn::Mask<Floats>;

HWY_INLINE Lane all(float x) { return hn::Set(Floats(), x); }
/// Where it holds a, else b.
HWY_INLINE Lane pick(Holds holds, Lane a, Lane b) { return hn::IfThenElse(holds, a, b); }
HWY_INLINE Lane greater(Lane a, Lane b) { return pick(a > b, a, b); }  // b where one is no number
HWY_INLINE Lane size_of(Lane x) { return hn::Abs(x); }
HWY_INLINE Lane whole(Index i) { return hn::ConvertTo(Floats(), i); }
HWY_INLINE Index down(Lane x) { return hn::ConvertTo(Ints(), x); }  // towards 0

/// table[at], one after the other.
HWY_INLINE Lane gather(const float* table, Index at) { return hn::GatherIndex(Floats(), table, at); }

/// Lanes that read a table of numbers within a stretch of it: whole loads and permutes, where no lane is farther than
/// `most` registers from the first.
template <int most>
class Stretch {
public:
    /// first..last: the least and the greatest of `at`. The table must be readable up to `most` registers from first.
    HWY_INLINE Stretch(Index at, int first, int last)
        : at_(at), first_(first), registers_((last - first) / static_cast<int>(hn::Lanes(Floats())) + 1) {
        near_ = last >= first && registers_ <= most;
        offset_ = near_ ? at - hn::Set(Ints(), first) : hn::Zero(Ints());
    }
    HWY_INLINE Lane read(const float* table) const {
        if (!near_) return gather(table, at_);
        const Floats d;
        const Ints di;
        const int n = static_cast<int>(hn::Lanes(d));
        const auto inside = hn::IndicesFromVec(d, hn::And(offset_, hn::Set(di, n - 1)));
        const float* from = table + first_;
        Lane found = hn::TableLookupLanes(hn::LoadU(d, from), inside);
        for (int r = 1; r < registers_; ++r) {
            const Holds farther = hn::RebindMask(d, offset_ > hn::Set(di, r * n - 1));
            found = pick(farther, hn::TableLookupLanes(hn::LoadU(d, from + r * n), inside), found);
        }
        return found;
    }

private:
    Index at_, offset_;
    int first_, registers_;
    bool near_;
};

HWY_INLINE Lane lifted(const Lift& lift, Lane up_m) {
    const Lane one = all(1);
    const Lane x = (up_m + all(lift.sensor_m)) * all(lift.inverse_radius);
    return up_m * ((one - x) * (one + x * x));
}

template <bool cross>
HWY_ATTR void raise(const RaiseLanes& lanes, const Lift& lift) {
    const Floats d;
    constexpr float none = std::numeric_limits<float>::quiet_NaN();
    const float inverse_distance = 1 / lanes.distance, bow = lanes.bow;
    for (std::size_t g = 0; g < lanes.groups; ++g) {
        const double at = lanes.at[g];
        const auto base = static_cast<std::int64_t>(std::floor(at));
        const float part = static_cast<float>(at - static_cast<double>(base)),
                    step = static_cast<float>((lanes.at[g + 1] - at) * (1.0 / knot_step));
        const float first_lift = lanes.lift[g], lift_step = (lanes.lift[g + 1] - first_lift) * (1.0F / knot_step),
                    drop = lanes.drop[g], drop_step = (lanes.drop[g + 1] - drop) * (1.0F / knot_step);
        const float* z = lanes.posts + (base - lanes.origin);
        const float* zb = lanes.behind + (base - lanes.origin);
        float* horizon = lanes.horizon + g * knot_step;
        const float back = cross ? static_cast<float>(lanes.at_behind[g] - static_cast<double>(base)) : 0,
                    back_step =
                        cross ? static_cast<float>((lanes.at_behind[g + 1] - lanes.at_behind[g]) * (1.0 / knot_step))
                              : 0;
        for (std::size_t l = 0; l < knot_step; l += hn::Lanes(d)) {
            const float lane0 = static_cast<float>(l), lane1 = static_cast<float>(l + hn::Lanes(d) - 1);
            const Lane lane = hn::Iota(d, lane0);
            const Lane y = all(part) + lane * all(step);
            const float y_first = part + lane0 * step, y_last = part + lane1 * step;
            const Index i = down(y);
            const Lane f = y - whole(i);
            const Stretch<2> posts(i, static_cast<int>(y_first), static_cast<int>(y_last));
            const Lane a = posts.read(z), b = posts.read(z + 1);
            const Lane up_a = a - all(lift.sensor_m), between = up_a + f * (b - a);
            const Lane above = pick(f == all(0), up_a, between);
            const Lane lifts = all(first_lift) + lane * all(lift_step),
                       drops =
                           all(drop) + lane * (all(drop_step) + all(bow) * (lane - all(static_cast<float>(knot_step))));
            const Lane tangent = lifted(lift, above) * lifts - drops;
            Lane old = hn::LoadU(d, horizon + l);
            if (cross) {
                const Lane y0 = all(back) + lane * all(back_step), low = pick(y0 < y, y0, y),
                           high = pick(y0 < y, y, y0);
                const float y0_first = back + lane0 * back_step, y0_last = back + lane1 * back_step;
                // Positions are above -17 here: rounded down by way of positive numbers.
                const Index c = down(high + all(32)) - hn::Set(Ints(), 32);
                const int c_first = static_cast<int>((y0_first < y_first ? y_first : y0_first) + 32) - 32,
                          c_last = static_cast<int>((y0_last < y_last ? y_last : y0_last) + 32) - 32;
                const Lane column = whole(c);
                const Holds met = hn::And(column > low, column < high);
                if (!hn::AllFalse(d, met)) {
                    const Lane tau = (y - column) / pick(met, y - y0, all(1));  // lines back
                    const Stretch<2> crossed(c, c_first, c_last);
                    const Lane ahead = crossed.read(z),
                               there = (ahead - all(lift.sensor_m)) + tau * (crossed.read(zb) - ahead);
                    // lift and drop at a line tau nearer.
                    const Lane nearer = all(1) - tau * all(inverse_distance);
                    const Lane crossing = lifted(lift, pick(met, there, all(none))) * lifts / nearer - drops * nearer;
                    old = greater(crossing, old);
                }
            }
            hn::StoreU(greater(tangent, old), d, horizon + l);
        }
    }
}

HWY_INLINE void put_states(Holds hidden, Holds is_void, std::uint8_t* to) {
    const Ints di;
    const auto shadow = hn::Set(di, 1), seen = hn::Set(di, 2);
    const Index state =
        hn::IfThenZeroElse(hn::RebindMask(di, is_void), hn::IfThenElse(hn::RebindMask(di, hidden), shadow, seen));
    const hn::Rebind<std::uint8_t, Ints> bytes;
    hn::StoreU(hn::DemoteTo(bytes, state), bytes, to);
}

template <bool raised, bool wanted>
HWY_ATTR void test(const TestLanes& lanes, const Lift& lift) {
    const Floats d;
    const Ints di;
    const Lane zero = all(0), one = all(1), two = all(2), four = all(4);
    const int last_spoke = lanes.spokes - 2;
    const Lane target = all(raised ? lanes.target_m : 0);
    const float slope_step = static_cast<float>(1 / lanes.distance);
    const float inverse_distance = slope_step;
    const Holds nearest = hn::RebindMask(d, hn::Set(di, lanes.nearest ? 1 : 0) == hn::Set(di, 1));
    for (std::size_t g = 0; g < lanes.groups; ++g) {
        const std::int64_t first = lanes.first + static_cast<std::int64_t>(g * knot_step);
        const double from = lanes.from[g], width = lanes.from[g + 1] - from;
        const double per_post = width > 0 ? 1 / width : 0;
        const double lead = from - static_cast<double>(first);
        const auto line = [&](double a, double b) HWY_ATTR {
            const double step = (b - a) * per_post;
            return std::pair(static_cast<float>(a - lead * step), static_cast<float>(step));
        };
        const double spoke_step = (lanes.at[g + 1] - lanes.at[g]) * per_post, spoke0 = lanes.at[g] - lead * spoke_step;
        const double whole_spoke = std::floor(spoke0);
        const float spoke = static_cast<float>(spoke0 - whole_spoke), spokes_step = static_cast<float>(spoke_step);
        const int spoke_base = static_cast<int>(static_cast<std::int64_t>(whole_spoke) - lanes.first_spoke);
        const auto [lift0, lift1] = line(static_cast<double>(lanes.lift[g]), static_cast<double>(lanes.lift[g + 1]));
        const auto [drop0, drop1] = line(static_cast<double>(lanes.drop[g]), static_cast<double>(lanes.drop[g + 1]));
        const float bow = static_cast<float>(lanes.bow * spoke_step * spoke_step), begins = static_cast<float>(lead),
                    ends = static_cast<float>(lead + width);
        for (std::size_t l = 0; l < knot_step; l += hn::Lanes(d)) {
            const std::int64_t at = first - lanes.origin + static_cast<std::int64_t>(l);
            const float* z = lanes.posts + at;
            const float* zb = lanes.behind + at;
            const float lane0 = static_cast<float>(l), lane1 = static_cast<float>(l + hn::Lanes(d) - 1);
            const Lane lane = hn::Iota(d, lane0);
            const Lane k = all(spoke) + lane * all(spokes_step);
            const Index beneath = down(k);
            const auto kept_of = [&](int over) { return std::min(std::max(over, 0), last_spoke); };
            const Index kept =
                hn::Min(hn::Max(beneath + hn::Set(di, spoke_base), hn::Zero(di)), hn::Set(di, last_spoke));
            const int kept_first = kept_of(static_cast<int>(spoke + lane0 * spokes_step) + spoke_base),
                      kept_last = kept_of(static_cast<int>(spoke + lane1 * spokes_step) + spoke_base);
            const Stretch<4> spokes(kept, kept_first, kept_last);
            const Lane f = k - whole(beneath);
            const Lane left = spokes.read(lanes.horizon), right = spokes.read(lanes.horizon + 1);
            // A spoke that has met no ground runs outside the raster, and so does the post's ray.
            const Lane half = all(0.5F * no_horizon_f);
            const Holds free = hn::Or(left < half, right < half);
            const Lane level = pick(free, all(no_horizon_f), left + f * (right - left));

            const Lane height = hn::LoadU(d, z), w = lifted(lift, (height - all(lift.sensor_m)) + target);
            const Lane bends = all(bow) * ((lane - all(begins)) * (lane - all(ends)));
            const Lane lifts = all(lift0) + lane * all(lift1), drops = all(drop0) + lane * all(drop1) + bends;
            const Lane high = w * lifts, tangent = high - drops;
            const Lane of_level = (size_of(high) + drops) * all(level_slack);
            const Holds is_void = hn::IsNaN(height);
            if (!wanted) {
                // Most posts stand far below.
                const Lane most = of_level + all(lanes.most_relief_m) * lifts * all(place_slack);
                const Holds below = tangent + most - level < zero;
                if (hn::AllTrue(d, hn::Or(below, is_void))) {
                    put_states(below, is_void, lanes.state + at);
                    continue;
                }
            }
            // The own cell, the one on the sensor's side, along the straight chord: its course u = 0..1 from the line
            // behind to the post is a parabola, and so is how high the ray runs above it.
            const float slope0 = static_cast<float>((static_cast<double>(first) - lanes.nadir) / lanes.distance);
            const Lane slope = all(slope0) + lane * all(slope_step), across = size_of(slope);
            const Holds leftwards = slope<zero, aslant = across> zero;
            const Lane beside = pick(leftwards, hn::LoadU(d, z + 1), hn::LoadU(d, z - 1)),
                       corner = pick(leftwards, hn::LoadU(d, zb + 1), hn::LoadU(d, zb - 1)), back = hn::LoadU(d, zb);
            const Lane to_corner = across * (corner - back), to_beside = across * (height - beside);
            const Lane step = height - back;
            const Lane side = hn::IfThenElseZero(aslant, size_of(to_beside) + size_of(to_corner));
            const Lane relief =
                hn::IfThenElseZero(step == step, size_of(step)) + hn::IfThenElseZero(side == side, side);
            // Spokes' positions are good to place_slack of a post.
            const Lane slack = of_level + relief * lifts * all(place_slack);
            const Lane over = tangent + slack - level;  // below 0: hidden
            Holds hidden = over < zero;
            if (!wanted && hn::AllTrue(d, hn::Or(hidden, is_void))) {
                put_states(hidden, is_void, lanes.state + at);
                continue;
            }
            const auto [ray0, ray1] = line(static_cast<double>(lanes.ray[g]), static_cast<double>(lanes.ray[g + 1]));
            const auto [rise0, rise1] =
                line(static_cast<double>(lanes.rise[g]), static_cast<double>(lanes.rise[g + 1]));
            const Lane to_entry = pick(aslant, step - to_corner, step), climbs = pick(aslant, step + to_beside, step);
            const Lane growth =
                all(1 + lift.sensor_m * lift.inverse_radius) * (one - two * height * all(lift.inverse_radius));
            const Lane ray_w = w * (all(ray0) + lane * all(ray1)), ray_rise = all(rise0) + lane * all(rise1) + bends,
                       ray = ray_w + ray_rise;
            const Lane stands = target * growth;
            const Lane cell_slack = (size_of(ray_w) + ray_rise + relief) * all(level_slack);
            const Lane steeper = climbs * growth - ray + cell_slack;  // at the post; below 0: a back slope
            const Lane above0 = pick(nearest, one, stands - ray + to_entry * growth + cell_slack);
            const Lane b = stands - above0, bend = zero - steeper - b, tilt = b - bend;  // above0 + tilt u + bend u^2
            const Holds inside =
                hn::AndNot(nearest, hn::And(hn::And(bend > zero, tilt < zero), tilt + two * bend > zero));
            if (raised)
                hidden = hn::Or(hidden, hn::Or(above0 < zero, hn::And(inside, four * bend * above0 < tilt * tilt)));
            else
                hidden = hn::Or(hidden, hn::Or(above0 < zero, steeper < zero));
            put_states(hidden, is_void, lanes.state + at);
            if (wanted) {
                // What would lift the post to its horizon, and its ray out of its own cell.
                const Lane to_horizon = hn::IfThenElseZero(over < zero, (zero - over) / (lifts * growth));
                const Lane u = hn::IfThenElseZero(inside, (zero - tilt) / (two * bend));
                const Lane least = above0 + u * (tilt + u * bend);
                const Lane moves = one - (one - u) * all(inverse_distance);  // of the ray there, when the post rises
                const Lane out_of_cell = hn::IfThenElseZero(hn::AndNot(nearest, least < zero),
                                                            (zero - least) / (greater(moves, all(0.125F)) * growth));
                const Lane most = greater(to_horizon, out_of_cell), some = greater(most, all(0.001F));
                hn::StoreU(hn::IfThenElseZero(hidden, some), d, lanes.raise_m + at);
                if (lanes.tangent) hn::StoreU(tangent, d, lanes.tangent + at);
            }
        }
    }
}

HWY_ATTR void raise_any(const RaiseLanes& lanes, const Lift& lift, bool cross) {
    cross ? raise<true>(lanes, lift) : raise<false>(lanes, lift);
}

HWY_ATTR void test_any(const TestLanes& lanes, const Lift& lift) {
    const bool wanted = lanes.raise_m != nullptr;
    if (lanes.target_m > 0)
        wanted ? test<true, true>(lanes, lift) : test<true, false>(lanes, lift);
    else
        wanted ? test<false, true>(lanes, lift) : test<false, false>(lanes, lift);
}

HWY_ATTR void least_any(const float* horizon, std::size_t groups, float* least) {
    const Floats d;
    for (std::size_t g = 0; g < groups; ++g, horizon += knot_step) {
        Lane lowest = hn::LoadU(d, horizon);
        for (std::size_t l = hn::Lanes(d); l < knot_step; l += hn::Lanes(d))
            lowest = hn::Min(lowest, hn::LoadU(d, horizon + l));
        least[g] = hn::GetLane(hn::MinOfLanes(d, lowest));
    }
}

}  // namespace
}  // namespace wedgescope::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace wedgescope {

constexpr auto raise_any_copies = WEDGESCOPE_HIGHWAY_COPIES(raise_any);
constexpr auto test_any_copies = WEDGESCOPE_HIGHWAY_COPIES(test_any);
constexpr auto least_any_copies = WEDGESCOPE_HIGHWAY_COPIES(least_any);

void raise_lanes(const RaiseLanes& lanes, const Lift& lift, bool cross) noexcept {
    raise_any_copies.in_use()(lanes, lift, cross);
}
void test_lanes(const TestLanes& lanes, const Lift& lift) noexcept { test_any_copies.in_use()(lanes, lift); }

void least_of_groups(const float* horizon, std::size_t groups, float* least) noexcept {
    least_any_copies.in_use()(horizon, groups, least);
}

}  // namespace wedgescope
#endif
