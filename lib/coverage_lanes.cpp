#include "lib/coverage_lanes.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lib/coverage_lanes.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "lib/highway_copies.hpp"
#include "lib/polar.hpp"

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
HWY_INLINE Holds pick(Holds holds, Holds a, Holds b) { return hn::Or(hn::And(holds, a), hn::AndNot(holds, b)); }
/// b where one is no number: what x86's own instruction does (Highway's plain targets have their own Max).
HWY_INLINE Lane greater(Lane a, Lane b) {
#if HWY_TARGET <= HWY_SSE4 && HWY_ARCH_X86
    return hn::Max(a, b);
#else
    return pick(a > b, a, b);
#endif
}
HWY_INLINE Lane size_of(Lane x) { return hn::Abs(x); }
HWY_INLINE Lane whole(Index i) { return hn::ConvertTo(Floats(), i); }
/// Towards 0, of what an integer can hold: Highway mends what it cannot.
HWY_INLINE Index down(Lane x) {
#if HWY_TARGET <= HWY_AVX3
    // GCC 12 takes what the unmasked one leaves undefined for uninitialised.
    return Index{_mm512_maskz_cvttps_epi32(0xFFFF, x.raw)};
#elif HWY_TARGET == HWY_AVX2
    return Index{_mm256_cvttps_epi32(x.raw)};
#else
    return hn::ConvertTo(Ints(), x);
#endif
}

/// table[at], one after the other.
HWY_INLINE Lane gather(const float* table, Index at) { return hn::GatherIndex(Floats(), table, at); }

/// Lanes that read a table of numbers within a stretch of it: whole loads and permutes, where no lane is farther than
/// `most` registers from the first.
template <int most>
class Stretch {
public:
    /// Lane reads first + offset; `span`: the greatest offset. The table must be readable up to `most` registers from first.
    HWY_INLINE Stretch(Index offset, int first, int span)
        : offset_(offset), first_(first), registers_(span / static_cast<int>(hn::Lanes(Floats())) + 1) {
        near_ = span >= 0 && registers_ <= most;
    }
    HWY_INLINE Lane read(const float* table) const {
        const float* from = table + first_;
        if (!near_) return gather(from, offset_);
        const Floats d;
        const Ints di;
        const int n = static_cast<int>(hn::Lanes(d));
#if HWY_TARGET <= HWY_AVX3
        static_assert(most <= 4);
        if (registers_ > 1) {
            // Two registers are one table of 32.
            const Lane near = two_registers(hn::LoadU(d, from), hn::LoadU(d, from + n));
            if (registers_ == 2) return near;
            const Lane far =
                two_registers(hn::LoadU(d, from + 2 * n), registers_ == 4 ? hn::LoadU(d, from + 3 * n) : hn::Zero(d));
            return pick(hn::RebindMask(d, offset_ > hn::Set(di, 2 * n - 1)), far, near);
        }
#endif
        const auto inside = hn::IndicesFromVec(d, hn::And(offset_, hn::Set(di, n - 1)));
        Lane found = hn::TableLookupLanes(hn::LoadU(d, from), inside);
        for (int r = 1; r < registers_; ++r) {
            const Holds farther = hn::RebindMask(d, offset_ > hn::Set(di, r * n - 1));
            found = pick(farther, hn::TableLookupLanes(hn::LoadU(d, from + r * n), inside), found);
        }
        return found;
    }

private:
#if HWY_TARGET <= HWY_AVX3
    HWY_INLINE Lane two_registers(Lane low, Lane high) const {
        return Lane{_mm512_permutex2var_ps(low.raw, offset_.raw, high.raw)};
    }
#endif
    Index offset_;
    int first_, registers_;
    bool near_;
};

HWY_INLINE Lane lifted(const Lift& lift, Lane up_m) {
    const Lane one = all(1);
    const Lane x = (up_m + all(lift.sensor_m)) * all(lift.inverse_radius);
    return up_m * ((one - x) * (one + x * x));
}

/// Lift::climb.
HWY_INLINE Lane climb(const Lift& lift, Lane height, Lane more) {
    const float from = 1 + lift.sensor_m * lift.inverse_radius;
    const Lane one = all(1), curve = all(lift.inverse_radius), square = all(lift.inverse_radius * lift.inverse_radius);
    const Lane steep = all(from) * (one - all(2) * height * curve),
               bend = all(from * lift.inverse_radius) * (one - all(3) * height * curve);
    const Lane first = more / steep, second = (more + first * first * (bend - square * first)) / steep;
    return (more + second * second * (bend - square * second)) / steep;
}

// What the lanes of a group have in common is found for some groups side by side, before the groups' turn comes.
constexpr std::size_t together = 64;
/// Vectors of floats in a group; and a value for each of them.
constexpr std::size_t vectors = knot_step / hn::MaxLanes(Floats());
template <class T>
using OfGroups = std::array<T, together>;

/// One value a group: doubles, and what is kept of them.
template <std::size_t most>
struct GroupLanes {
    using Doubles = hn::CappedTag<double, most>;
    using Narrow = hn::Rebind<float, Doubles>;
    using Wholes = hn::Rebind<std::int32_t, Doubles>;
    using Wide = hn::Vec<Doubles>;
    using Slim = hn::Vec<Narrow>;
    static HWY_INLINE Wide set(double x) { return hn::Set(Doubles(), x); }
    static HWY_INLINE Slim set_slim(float x) { return hn::Set(Narrow(), x); }
    static HWY_INLINE Wide read(const double* x) { return hn::LoadU(Doubles(), x); }
    static HWY_INLINE Slim read(const float* x) { return hn::LoadU(Narrow(), x); }
    static HWY_INLINE Wide wide(Slim x) { return hn::PromoteTo(Doubles(), x); }
    static HWY_INLINE Slim slim(Wide x) { return hn::DemoteTo(Narrow(), x); }
    static HWY_INLINE void put(Slim x, float* to) { hn::StoreU(x, Narrow(), to); }
    static HWY_INLINE void put(Wide x, float* to) { put(slim(x), to); }
    /// Without their fraction.
    static HWY_INLINE void put_whole(Wide x, std::int32_t* to) { hn::StoreU(hn::DemoteTo(Wholes(), x), Wholes(), to); }
    static HWY_INLINE void put_whole(Slim x, std::int32_t* to) { hn::StoreU(hn::ConvertTo(Wholes(), x), Wholes(), to); }
};
using ManyGroups = GroupLanes<8>;
using OneGroup = GroupLanes<1>;

/// Does `some`(lanes, i) for all of 0..n: many at a time, the last of them twice if need be, or one by one if they are few.
template <class Some>
HWY_INLINE HWY_ATTR void for_groups(std::size_t n, Some&& some) {
    constexpr std::size_t many = hn::MaxLanes(ManyGroups::Doubles());
    if (n < many) {
        for (std::size_t i = 0; i < n; ++i) some(OneGroup(), i);
        return;
    }
    for (std::size_t i = 0; i < n; i += many) some(ManyGroups(), std::min(i, n - many));
}

/// Is a vector one lane? Then what is first in it and last is not worth looking up.
constexpr bool alone = vectors == knot_step;
/// First and last lane of a group's vector.
HWY_INLINE float first_lane(std::size_t vector) { return static_cast<float>(vector * hn::MaxLanes(Floats())); }
HWY_INLINE float last_lane(std::size_t vector) { return static_cast<float>((vector + 1) * hn::MaxLanes(Floats()) - 1); }

/// Where the first lane and the last of each vector lie on a straight way.
template <class L, class Groups>
HWY_INLINE HWY_ATTR void put_ends(typename L::Slim start, typename L::Slim step, std::size_t i, Groups& out) {
    if constexpr (!alone)
        for (std::size_t v = 0; v < vectors; ++v) {
            L::put_whole(start + L::set_slim(first_lane(v)) * step, out.first[v].data() + i);
            L::put_whole(start + L::set_slim(last_lane(v)) * step, out.last[v].data() + i);
        }
}

/// Straight lines through the lanes of groups of spokes.
struct SpokeGroups {
    OfGroups<std::int32_t> base;  ///< post, from the line's origin, in which the first spoke lies
    OfGroups<float> part, step;   ///< from there, posts
    OfGroups<float> lift_step, drop_step, back, back_step;
    std::array<OfGroups<std::int32_t>, vectors> first, last;  ///< posts from `base`, of each vector
};

/// Of groups g on, as many as the lanes hold, to i on.
template <class L, bool cross>
HWY_INLINE HWY_ATTR void look_ahead(const RaiseLanes& lanes, std::size_t g, std::size_t i, SpokeGroups& out) {
    const auto each = L::set(1.0 / knot_step);
    const auto each_slim = L::set_slim(1.0F / knot_step);
    const auto at = L::read(lanes.at + g), base = hn::Floor(at);
    const auto part = L::slim(at - base), step = L::slim((L::read(lanes.at + g + 1) - at) * each);
    L::put_whole(base - L::set(static_cast<double>(lanes.origin)), out.base.data() + i);
    L::put(part, out.part.data() + i);
    L::put(step, out.step.data() + i);
    L::put((L::read(lanes.lift + g + 1) - L::read(lanes.lift + g)) * each_slim, out.lift_step.data() + i);
    L::put((L::read(lanes.drop + g + 1) - L::read(lanes.drop + g)) * each_slim, out.drop_step.data() + i);
    put_ends<L>(part, step, i, out);
    if (cross) {
        const auto back = L::read(lanes.at_behind + g);
        L::put(back - base, out.back.data() + i);
        L::put((L::read(lanes.at_behind + g + 1) - back) * each, out.back_step.data() + i);
    }
}

/// A spoke on its way through the cell between two neighbouring columns of posts, from the line behind to the line.
struct InsideCell {
    Lane a, b, a_behind, b_behind;  ///< posts of the line, left and right, and of the one behind
    Lane part;                      ///< posts from a to where the spoke crosses the line
    Lane across;                    ///< and to there from where it crossed the one behind

    /// The highest tangent between two places that many lines back, at a line `distance` posts off; no number where the
    /// surface's course is no hill.
    HWY_INLINE HWY_ATTR Lane highest(const Lift& lift, float distance, Lane lifts, Lane drops, Lane from,
                                     Lane to) const {
        constexpr float none = std::numeric_limits<float>::quiet_NaN(), out = 0x1p-10F;
        const Lane zero = all(0), way = all(distance);
        // Height over the sensor tau lines back: up + tau (step + tau bend).
        const Lane ahead = b - a, twist = ahead - (b_behind - a_behind);
        const Lane up = (a - all(lift.sensor_m)) + part * ahead, step = (a_behind - a) - part * twist - across * ahead,
                   bend = across * twist;
        // Over the distance it is most where that squared is d^2 + (d step + up) / bend.
        const Lane more = (way * step + up) / bend, square = greater(way * way + more, zero);
        const Lane top = zero - more / (way + hn::Sqrt(square)), tau = pick(top > from, pick(top < to, top, to), from);
        // Of a cell no part is higher than its posts: what rounding adds must not hide what is level with these.
        const Lane posts = greater(greater(a, b), greater(a_behind, b_behind)) - all(lift.sensor_m);
        const Lane found = up + tau * (step + tau * bend), there = pick(found < posts, found, posts),
                   nearer = all(1) - tau * all(1 / distance), place = part - tau * across;
        const Holds counts = hn::And(bend < zero, hn::And(place > all(-out), place < all(1 + out)));
        return lifted(lift, pick(counts, there, all(none))) * lifts / nearer - drops * nearer;
    }
};

template <bool cross, bool course>
HWY_ATTR void raise(const RaiseLanes& lanes, const Lift& lift) {
    const Floats d;
    constexpr float none = std::numeric_limits<float>::quiet_NaN();
    const float inverse_distance = 1 / lanes.distance, bow = lanes.bow;
    // How far back it is looked at, lines: not as far as the sensor, where a tangent is as good as none.
    const float most_back = lanes.distance * (1 - 0x1p-8F);
    const Lane begins = all(most_back < 1 ? most_back : 1);
    SpokeGroups groups;
    for (std::size_t begin = 0; begin < lanes.groups; begin += together) {
        const std::size_t n = std::min(together, lanes.groups - begin);
        for_groups(n, [&]<class L>(L, std::size_t i) HWY_ATTR { look_ahead<L, cross>(lanes, begin + i, i, groups); });
        for (std::size_t i = 0; i < n; ++i) {
            const float* z = lanes.posts + groups.base[i];
            const float* zb = lanes.behind + groups.base[i];
            float* horizon = lanes.horizon + (begin + i) * knot_step;
            const float part = groups.part[i], step = groups.step[i];
            for (std::size_t v = 0; v < vectors; ++v) {
                const std::size_t l = v * hn::Lanes(d);
                const Lane lane = hn::Iota(d, first_lane(v));
                const Lane y = all(part) + lane * all(step);
                const Index at = down(y);
                const int y_first = alone ? hn::GetLane(at) : groups.first[v][i],
                          y_last = alone ? y_first : groups.last[v][i];
                const Lane f = y - whole(at);
                const Stretch<2> posts(at - hn::Set(Ints(), y_first), y_first, y_last - y_first);
                const Lane a = posts.read(z), b = posts.read(z + 1);
                const Lane up_a = a - all(lift.sensor_m), between = up_a + f * (b - a);
                const Lane above = pick(f == all(0), up_a, between);
                const Lane lifts = all(lanes.lift[begin + i]) + lane * all(groups.lift_step[i]),
                           drops = all(lanes.drop[begin + i]) +
                                   lane * (all(groups.drop_step[i]) +
                                           all(bow) * (lane - all(static_cast<float>(knot_step))));
                const Lane tangent = lifted(lift, above) * lifts - drops;
                Lane old = hn::LoadU(d, horizon + l);
                if (cross) {
                    const float back = groups.back[i], back_step = groups.back_step[i];
                    const Lane y0 = all(back) + lane * all(back_step), low = pick(y0 < y, y0, y),
                               high = pick(y0 < y, y, y0);
                    // Positions are above -17 here: rounded down by way of positive numbers.
                    const Index c = down(high + all(32)) - hn::Set(Ints(), 32);
                    const Lane column = whole(c);
                    const Holds met = hn::And(column > low, column < high);
                    if (course || !hn::AllFalse(d, met)) {
                        const auto highest = [&](float at_lane) HWY_ATTR {
                            const float here = part + at_lane * step, there = back + at_lane * back_step;
                            return static_cast<int>((there < here ? here : there) + 32) - 32;
                        };
                        const int c_first = highest(first_lane(v)), c_last = highest(last_lane(v));
                        const Lane tau = (y - column) / pick(met, y - y0, all(1));  // lines back
                        const Stretch<2> crossed(c - hn::Set(Ints(), c_first), c_first, c_last - c_first);
                        const Lane ahead = crossed.read(z), behind = crossed.read(zb),
                                   there = (ahead - all(lift.sensor_m)) + tau * (behind - ahead);
                        // lift and drop at a line tau nearer.
                        const Lane nearer = all(1) - tau * all(inverse_distance);
                        const Holds counts = course ? hn::And(met, tau < begins) : met;
                        const Lane crossing =
                            lifted(lift, pick(counts, there, all(none))) * lifts / nearer - drops * nearer;
                        old = greater(crossing, old);
                        if (course) {
                            // The cells on both sides of the column: from one the spoke comes to the line, through the
                            // other it came before.
                            const Lane left = crossed.read(z - 1), right = crossed.read(z + 1),
                                       left_behind = crossed.read(zb - 1), right_behind = crossed.read(zb + 1);
                            const Holds leftwards = pick(met, y < y0, high == column);
                            const Lane offset = y - column, across = y - y0, turn = pick(counts, tau, begins);
                            const auto inside = [&](Holds on_left, Lane from, Lane to) HWY_ATTR {
                                const InsideCell cell{pick(on_left, left, ahead),
                                                      pick(on_left, ahead, right),
                                                      pick(on_left, left_behind, behind),
                                                      pick(on_left, behind, right_behind),
                                                      pick(on_left, offset + all(1), offset),
                                                      across};
                                return cell.highest(lift, lanes.distance, lifts, drops, from, to);
                            };
                            old = greater(inside(leftwards, all(0), turn), old);
                            if (!hn::AllFalse(d, counts))
                                old = greater(pick(counts, inside(hn::Not(leftwards), turn, begins), all(none)), old);
                        }
                    }
                }
                hn::StoreU(greater(tangent, old), d, horizon + l);
            }
        }
    }
}

constexpr auto in_shadow = static_cast<std::uint8_t>(State::shadow), is_seen = static_cast<std::uint8_t>(State::seen);
HWY_INLINE void put_shadow(std::uint8_t* to) {
    const hn::Rebind<std::uint8_t, Ints> bytes;
    hn::StoreU(hn::Set(bytes, in_shadow), bytes, to);
}

HWY_INLINE void put_states(Holds hidden, Holds is_void, std::uint8_t* to) {
    const Ints di;
    const auto shadow = hn::Set(di, in_shadow), seen = hn::Set(di, is_seen);
    const Index state =
        hn::IfThenZeroElse(hn::RebindMask(di, is_void), hn::IfThenElse(hn::RebindMask(di, hidden), shadow, seen));
    const hn::Rebind<std::uint8_t, Ints> bytes;
    hn::StoreU(hn::DemoteTo(bytes, state), bytes, to);
}

/// Straight lines through the lanes of groups of posts.
struct PostGroups {
    OfGroups<std::int32_t> base;         ///< spoke, from the first of the horizons, of the first post
    OfGroups<float> spoke, spokes_step;  ///< from there
    OfGroups<float> lift, lift_step, drop, drop_step, ray, ray_step, rise, rise_step;
    OfGroups<float> bow, begins, ends;  ///< of drop, and where the knots stand: posts from the first one
    OfGroups<float> slope;              ///< of the first post
    std::array<OfGroups<std::int32_t>, vectors> first, last;  ///< spokes from `base`, of each vector
};

template <class L>
HWY_INLINE HWY_ATTR void look_ahead(const TestLanes& lanes, std::size_t g, std::size_t i, PostGroups& out) {
    const auto zero = L::set(0);
    const auto first = L::set(static_cast<double>(lanes.first + static_cast<std::int64_t>(g * knot_step))) +
                       hn::Iota(typename L::Doubles(), 0) * L::set(static_cast<double>(knot_step));
    const auto from = L::read(lanes.from + g), width = L::read(lanes.from + g + 1) - from, lead = from - first,
               per_post = hn::IfThenElseZero(width > zero, L::set(1) / width);
    const auto line = [&](const float* at, float* start, float* step) HWY_ATTR {
        const auto a = L::wide(L::read(at + g)), each = (L::wide(L::read(at + g + 1)) - a) * per_post;
        L::put(a - lead * each, start + i);
        L::put(each, step + i);
    };
    const auto at = L::read(lanes.at + g), spokes_step = (L::read(lanes.at + g + 1) - at) * per_post,
               spoke0 = at - lead * spokes_step, base = hn::Floor(spoke0);
    const auto spoke = L::slim(spoke0 - base), step = L::slim(spokes_step);
    L::put_whole(base - L::set(static_cast<double>(lanes.first_spoke)), out.base.data() + i);
    L::put(spoke, out.spoke.data() + i);
    L::put(step, out.spokes_step.data() + i);
    line(lanes.lift, out.lift.data(), out.lift_step.data());
    line(lanes.drop, out.drop.data(), out.drop_step.data());
    line(lanes.ray, out.ray.data(), out.ray_step.data());
    line(lanes.rise, out.rise.data(), out.rise_step.data());
    L::put(L::set(lanes.bow) * spokes_step * spokes_step, out.bow.data() + i);
    L::put(lead, out.begins.data() + i);
    L::put(lead + width, out.ends.data() + i);
    L::put((first - L::set(lanes.nadir)) / L::set(lanes.distance), out.slope.data() + i);
    put_ends<L>(spoke, step, i, out);
}

template <bool raised, bool wanted>
HWY_INLINE HWY_ATTR void test_groups(const TestLanes& lanes, const Lift& lift, std::size_t begin, std::size_t n,
                                     const PostGroups& groups) {
    const Floats d;
    const Ints di;
    const Lane zero = all(0), one = all(1), two = all(2), four = all(4);
    const int last_spoke = lanes.spokes - 2;
    const Lane target = all(raised ? lanes.target_m : 0);
    const float slope_step = static_cast<float>(1 / lanes.distance);
    const float inverse_distance = slope_step;
    const float most_slack = lanes.most_relief_m * place_slack;  // a power of two: nothing is rounded
    const Holds nearest = hn::RebindMask(d, hn::Set(di, lanes.nearest ? 1 : 0) == hn::Set(di, 1));
    // Where the way through the own cell begins: at the line behind, or above the sensor; and where what would lift a post out
    // of it is asked, for where the sensor is no height does.
    const float way_to = static_cast<float>(lanes.distance), least_way = 1 - way_to * (1 - 0x1p-8F);
    const Lane begins = all(lanes.nearest ? 1 - way_to : 0), enters = all(least_way > 0 ? least_way : 0),
               before = all(way_to - 1);
    const std::int64_t begins_at =
        lanes.first - lanes.origin + static_cast<std::int64_t>(begin) * static_cast<std::int64_t>(knot_step);
    for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t v = 0; v < vectors; ++v) {
            const std::int64_t at = begins_at + static_cast<std::int64_t>(i * knot_step + v * hn::Lanes(d));
            const float* z = lanes.posts + at;
            const float* zb = lanes.behind + at;
            const Lane lane = hn::Iota(d, first_lane(v));
            const Lane k = all(groups.spoke[i]) + lane * all(groups.spokes_step[i]);
            const Index beneath = down(k);
            const int base = groups.base[i], first = (alone ? hn::GetLane(beneath) : groups.first[v][i]) + base,
                      last = alone ? first : groups.last[v][i] + base;
            // Posts beside all spokes are with the outermost.
            const auto kept_of = [&](int over) { return std::min(std::max(over, 0), last_spoke); };
            const int kept_first = kept_of(first), kept_last = kept_of(last);
            Index offset = beneath + hn::Set(di, base - kept_first);
            if (kept_first != first || kept_last != last)
                offset = hn::Min(hn::Max(offset, hn::Set(di, -kept_first)), hn::Set(di, last_spoke - kept_first));
            const Stretch<4> spokes(offset, kept_first, kept_last - kept_first);
            const Lane f = k - whole(beneath);
            const Lane left = spokes.read(lanes.horizon), right = spokes.read(lanes.horizon + 1);
            // A spoke that has met no ground runs outside the raster, and so does the post's ray.
            const Lane half = all(0.5F * no_horizon_f);
            const Holds free = hn::Or(left < half, right < half);
            const Lane level = pick(free, all(no_horizon_f), left + f * (right - left));

            const Lane height = hn::LoadU(d, z), up_m = height - all(lift.sensor_m),
                       w = lifted(lift, raised ? up_m + target : up_m);
            const Lane bends = all(groups.bow[i]) * ((lane - all(groups.begins[i])) * (lane - all(groups.ends[i])));
            const Lane lifts = all(groups.lift[i]) + lane * all(groups.lift_step[i]),
                       drops = all(groups.drop[i]) + lane * all(groups.drop_step[i]) + bends;
            const Lane high = w * lifts, tangent = high - drops;
            const Lane of_level = (size_of(high) + drops) * all(level_slack);
            const Holds is_void = hn::IsNaN(height);
            if (!wanted) {
                // Most posts stand far below.
                const Lane most = of_level + all(most_slack) * lifts;
                const Holds below = tangent + most - level < zero;
                if (hn::AllTrue(d, below)) {
                    put_shadow(lanes.state + at);
                    continue;
                }
                if (hn::AllTrue(d, hn::Or(below, is_void))) {
                    put_states(below, is_void, lanes.state + at);
                    continue;
                }
            }
            // The own cell, the one on the sensor's side, along the straight chord: its course u = 0..1 from the line
            // behind to the post is a parabola, and so is how high the ray runs above it.
            const Lane slope = all(groups.slope[i]) + lane * all(slope_step), across = size_of(slope);
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
            const Lane to_entry = pick(aslant, step - to_corner, step), climbs = pick(aslant, step + to_beside, step);
            const Lane growth =
                all(1 + lift.sensor_m * lift.inverse_radius) * (one - two * height * all(lift.inverse_radius));
            const Lane ray_w = w * (all(groups.ray[i]) + lane * all(groups.ray_step[i])),
                       ray_rise = all(groups.rise[i]) + lane * all(groups.rise_step[i]) + bends, ray = ray_w + ray_rise;
            const Lane stands = target * growth;
            const Lane cell_slack = (size_of(ray_w) + ray_rise + relief) * all(level_slack);
            const Lane steeper = climbs * growth - ray + cell_slack;  // at the post; below 0: a back slope
            // The earth falls away from the chord behind the post: by drop / distance a line, over a line.
            const Lane falls = ray_rise * all(inverse_distance);
            const Lane above0 = stands - ray + falls + to_entry * growth + cell_slack;
            const Holds enters_below = hn::AndNot(nearest, above0 < zero);
            const Lane b = stands - above0, bend = zero - steeper - b, tilt = b - bend;  // above0 + tilt u + bend u^2
            const Holds inside =
                hn::And(hn::And(bend > zero, tilt + two * bend * begins < zero), tilt + two * bend > zero);
            if (raised)
                hidden = hn::Or(hidden, hn::Or(enters_below, hn::And(inside, four * bend * above0 < tilt * tilt)));
            else  // a way that begins beside a void is one itself and hides nothing
                hidden = hn::Or(hidden, hn::Or(enters_below, hn::And(steeper < zero, above0 == above0)));
            put_states(hidden, is_void, lanes.state + at);
            if (wanted) {
                // What would lift the post to its horizon, and its ray out of its own cell.
                const Lane stands_at = raised ? height + target : height;
                const Lane to_horizon = hn::IfThenElseZero(over < zero, climb(lift, stands_at, (zero - over) / lifts));
                // That hidden by most, over how far it is: as in InsideCell.
                const Lane more = (above0 - tilt * before) / bend,
                           way = hn::Sqrt(greater(before * before + more, zero)),
                           top = lanes.nearest ? way - before : more / (way + before),
                           u = pick(hn::And(bend > zero, top > enters), pick(top < one, top, one), enters);
                const Lane least = above0 + u * (tilt + u * bend);
                const Lane moves = one - (one - u) * all(inverse_distance);  // of the ray there, when the post rises
                const Lane out_of_cell =
                    hn::IfThenElseZero(least < zero, climb(lift, stands_at, (zero - least) / moves));
                const Lane most = greater(to_horizon, out_of_cell), some = greater(most, all(0.001F));
                hn::StoreU(hn::IfThenElseZero(hidden, some), d, lanes.raise_m + at);
                if (lanes.tangent) hn::StoreU(tangent, d, lanes.tangent + at);
            }
        }
    }
}

template <bool raised, bool wanted>
HWY_ATTR void test(const TestLanes& lanes, const Lift& lift) {
    PostGroups groups;
    for (std::size_t begin = 0; begin < lanes.groups; begin += together) {
        const std::size_t n = std::min(together, lanes.groups - begin);
        for_groups(n, [&]<class L>(L, std::size_t i) HWY_ATTR { look_ahead<L>(lanes, begin + i, i, groups); });
        test_groups<raised, wanted>(lanes, lift, begin, n, groups);
    }
}

HWY_ATTR void raise_any(const RaiseLanes& lanes, const Lift& lift, Between between) {
    switch (between) {
        case Between::nothing:
            return raise<false, false>(lanes, lift);
        case Between::crossings:
            return raise<true, false>(lanes, lift);
        case Between::course:
            return raise<true, true>(lanes, lift);
    }
}

HWY_ATTR void test_any(const TestLanes& lanes, const Lift& lift) {
    const bool wanted = lanes.raise_m != nullptr;
    if (lanes.target_m > 0)
        wanted ? test<true, true>(lanes, lift) : test<true, false>(lanes, lift);
    else
        wanted ? test<false, true>(lanes, lift) : test<false, false>(lanes, lift);
}

/// Adds what whole vectors of bytes hold of each state but the first to `found`; returns where the rest begins.
template <class Bytes>
HWY_INLINE HWY_ATTR std::size_t count_whole(Bytes d, const std::uint8_t* states, std::size_t begin, std::size_t n,
                                            std::array<std::size_t, coverage_states>& found) {
    const std::size_t step = hn::Lanes(d);
    for (; begin + step <= n; begin += step) {
        const auto here = hn::LoadU(d, states + begin);
        for (std::uint8_t state = 1; state < coverage_states; ++state)
            found[state] += hn::CountTrue(d, here == hn::Set(d, state));
    }
    return begin;
}

HWY_ATTR void count_any(const std::uint8_t* states, std::size_t n, std::array<std::uint64_t, coverage_states>& counts) {
    std::array<std::size_t, coverage_states> found{};
    std::size_t begin = count_whole(hn::ScalableTag<std::uint8_t>(), states, 0, n, found);
    begin = count_whole(hn::CappedTag<std::uint8_t, 8>(), states, begin, n, found);
    for (; begin < n; ++begin)
        for (std::uint8_t state = 1; state < coverage_states; ++state) found[state] += states[begin] == state;
    found[0] = n;
    for (std::size_t state = 1; state < coverage_states; ++state) found[0] -= found[state];
    for (std::size_t state = 0; state < coverage_states; ++state) counts[state] += found[state];
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
constexpr auto count_any_copies = WEDGESCOPE_HIGHWAY_COPIES(count_any);
constexpr auto least_any_copies = WEDGESCOPE_HIGHWAY_COPIES(least_any);

void raise_lanes(const RaiseLanes& lanes, const Lift& lift, Between between) noexcept {
    raise_any_copies.in_use()(lanes, lift, between);
}
void test_lanes(const TestLanes& lanes, const Lift& lift) noexcept { test_any_copies.in_use()(lanes, lift); }

void count_states(const std::uint8_t* states, std::size_t n,
                  std::array<std::uint64_t, coverage_states>& counts) noexcept {
    count_any_copies.in_use()(states, n, counts);
}

void least_of_groups(const float* horizon, std::size_t groups, float* least) noexcept {
    least_any_copies.in_use()(horizon, groups, least);
}

}  // namespace wedgescope
#endif
