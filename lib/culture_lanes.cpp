#include "lib/culture_lanes.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lib/culture_lanes.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "lib/highway_copies.hpp"

HWY_BEFORE_NAMESPACE();
namespace wedgescope::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
// Places are doubles, half a register at a time; what follows from them are floats and whole numbers in whole ones.
using Doubles = hn::CappedTag<double, 8>;
using HalfFloats = hn::Rebind<float, Doubles>;
using HalfInts = hn::Rebind<std::int32_t, Doubles>;
#if HWY_TARGET == HWY_SCALAR  // one lane has no halves
using Floats = HalfFloats;
using Ints = HalfInts;
HWY_INLINE hn::Vec<Ints> join(hn::Vec<HalfInts> low, hn::Vec<HalfInts>) { return low; }
HWY_INLINE hn::Vec<Floats> join(hn::Vec<HalfFloats> low, hn::Vec<HalfFloats>) { return low; }
#else
using Floats = hn::Repartition<float, Doubles>;
using Ints = hn::Repartition<std::int32_t, Doubles>;
HWY_INLINE hn::Vec<Ints> join(hn::Vec<HalfInts> low, hn::Vec<HalfInts> high) { return hn::Combine(Ints(), high, low); }
HWY_INLINE hn::Vec<Floats> join(hn::Vec<HalfFloats> low, hn::Vec<HalfFloats> high) {
    return hn::Combine(Floats(), high, low);
}
#endif
using Lane = hn::Vec<Doubles>;
using Share = hn::Vec<Floats>;
using Whole = hn::Vec<Ints>;
using Holds = hn::Mask<Doubles>;

HWY_INLINE Lane all(double x) { return hn::Set(Doubles(), x); }
HWY_INLINE Whole all_of(std::int64_t x) { return hn::Set(Ints(), static_cast<std::int32_t>(x)); }
HWY_INLINE Lane pick(Holds holds, Lane a, Lane b) { return hn::IfThenElse(holds, a, b); }
HWY_INLINE Whole pick(hn::Mask<Floats> holds, Whole a, Whole b) {
    return hn::IfThenElse(hn::RebindMask(Ints(), holds), a, b);
}
HWY_INLINE Whole wholes(Lane low, Lane high) {
    return join(hn::DemoteTo(HalfInts(), low), hn::DemoteTo(HalfInts(), high));
}
HWY_INLINE Share shares(Lane low, Lane high) {
    return join(hn::DemoteTo(HalfFloats(), low), hn::DemoteTo(HalfFloats(), high));
}

/// Where a piece begins or ends: raster index across the lines and along them.
struct Place {
    Lane major, minor;
};

/// The corner with the highest culture, and where there is one.
HWY_INLINE Holds wall_corner(const CultureScene& scene, const CulturePieces& p, std::size_t i, Place& corner) {
    const Doubles d;
    const HalfFloats f;
    hn::Vec<HalfFloats> low[2], high[2];
    const bool in_order = scene.behind_major <= scene.ahead_major;
    hn::LoadInterleaved2(f, (in_order ? p.behind_m : p.ahead_m) + 2 * i, low[0], low[1]);
    hn::LoadInterleaved2(f, (in_order ? p.ahead_m : p.behind_m) + 2 * i, high[0], high[1]);
    const Lane low_major = all(in_order ? scene.behind_major : scene.ahead_major),
               high_major = all(in_order ? scene.ahead_major : scene.behind_major);
    const Lane cell = hn::LoadU(d, p.cell + i), after = cell + all(1);
    Lane most = hn::Zero(d);
    corner = {low_major, cell};
    const auto rival = [&](hn::Vec<HalfFloats> height, Lane major, Lane minor) HWY_ATTR {
        const Lane h = hn::PromoteTo(d, height);
        const Holds higher = h > most;
        most = pick(higher, h, most);
        corner.major = pick(higher, major, corner.major);
        corner.minor = pick(higher, minor, corner.minor);
    };
    // In raster order.
    rival(low[0], low_major, cell);
    if (scene.lines_are_columns) {
        rival(high[0], high_major, cell);
        rival(low[1], low_major, after);
    } else {
        rival(low[1], low_major, after);
        rival(high[0], high_major, cell);
    }
    rival(high[1], high_major, after);
    return most > hn::Zero(d);
}

/// Along one axis, of half a register's pieces: the cells of both ends, how far before the border between them a piece starts
/// and how far it runs.
struct Along {
    Lane first, last, before, way;
    HWY_INLINE Along(Lane from, Lane to) : first(hn::Floor(from)), last(hn::Floor(to)) {
        before = hn::Max(first, last) - from;
        way = to - from;
    }
};

/// The same of a register's.
struct Cells {
    Whole first, last, least, most;
    Share cut;  ///< how far along the way it passes from one to the other; 0 where there is but one
    HWY_INLINE Cells(const Along& low, const Along& high)
        : first(wholes(low.first, high.first)), last(wholes(low.last, high.last)), least(hn::Min(first, last)),
          most(hn::Max(first, last)),
          cut(hn::IfThenElseZero(hn::RebindMask(Floats(), most > least),
                                 shares(low.before, high.before) / shares(low.way, high.way))) {}
};

HWY_ATTR bool culture_any(std::size_t n, const CultureScene& scene, const CulturePieces& p, CultureParts& out) {
    const Doubles d;
    const Floats f;
    const Ints w;
    const Window& tile = scene.tile;
    const Whole column_begin = all_of(tile.columns.begin), column_last = all_of(tile.columns.end - 1),
                row_begin = all_of(tile.rows.begin), row_last = all_of(tile.rows.end - 1),
                columns = all_of(tile.columns.size()), one = all_of(1);
    const Lane column_offset = all(scene.column_offset), column_scale = all(scene.column_scale),
               row_offset = all(scene.row_offset), row_scale = all(scene.row_scale);
    hn::Mask<Ints> odd = hn::Zero(w) > one;
    struct Half {
        Along column, row;
        Lane wall;
    };
    const auto half = [&](std::size_t i) HWY_ATTR {
        Place from{hn::LoadU(d, p.major0 + i), hn::LoadU(d, p.minor0 + i)},
            to{hn::LoadU(d, p.major1 + i), hn::LoadU(d, p.minor1 + i)};
        Lane wall = hn::Zero(d);
        if (p.cell) {
            Place corner;
            const Holds stands = wall_corner(scene, p, i, corner);
            from = {pick(stands, corner.major, from.major), pick(stands, corner.minor, from.minor)};
            to = {pick(stands, corner.major, to.major), pick(stands, corner.minor, to.minor)};
            wall = hn::IfThenElseZero(stands, all(1));
        }
        const bool by_columns = scene.lines_are_columns;
        return Half{{column_offset + column_scale * (by_columns ? from.major : from.minor),
                     column_offset + column_scale * (by_columns ? to.major : to.minor)},
                    {row_offset + row_scale * (by_columns ? from.minor : from.major),
                     row_offset + row_scale * (by_columns ? to.minor : to.major)},
                    wall};
    };
    for (std::size_t i = 0; i < n; i += hn::Lanes(f)) {
        const Half low = half(i), high = half(i + hn::Lanes(f) - hn::Lanes(d));
        const Cells column(low.column, high.column), row(low.row, high.row);
        const auto outside = hn::Or(hn::Or(column.least<column_begin, column.most> column_last),
                                    hn::Or(row.least<row_begin, row.most> row_last)),
                   many = hn::Or(column.most - column.least > one, row.most - row.least > one);
        const Share to_second = hn::Min(column.cut, row.cut), to_third = hn::Max(column.cut, row.cut);
        // A cell that is only touched is none of the piece's: its neighbour stands for it.
        const Whole across = column.last - column.first, along = (row.last - row.first) * columns;
        const Whole start = (row.first - row_begin) * columns + (column.first - column_begin);
        Whole cell0 = start, cell2 = start + (across + along),
              cell1 = start + pick(column.cut <= row.cut, across, along);
        cell1 = pick(to_second == to_third, pick(to_second <= hn::Zero(f), cell2, cell0), cell1);
        cell2 = pick(to_third >= hn::Set(f, 1), cell1, cell2);
        cell0 = pick(to_second <= hn::Zero(f), cell1, cell0);
        const auto bad = hn::Or(outside, many);
        hn::StoreU(hn::IfThenZeroElse(bad, cell0), w, out.first + i);
        hn::StoreU(hn::IfThenZeroElse(bad, cell1), w, out.second + i);
        hn::StoreU(hn::IfThenZeroElse(bad, cell2), w, out.third + i);
        hn::StoreU(to_second, f, out.to_second + i);
        hn::StoreU(to_third, f, out.to_third + i);
        const Whole wall = p.cell ? wholes(low.wall, high.wall) : hn::Zero(w);
        static_assert(CultureParts::parts == 0 && CultureParts::wall == 1);
        const Whole few = hn::IfThenElse(many, all_of(CultureParts::many), wall);
        hn::StoreU(hn::IfThenElse(outside, all_of(CultureParts::elsewhere), few), w, out.kind + i);
        odd = hn::Or(odd, hn::And(bad, hn::FirstN(w, n - i)));
    }
    return !hn::AllFalse(w, odd);
}

}  // namespace
}  // namespace wedgescope::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace wedgescope {

constexpr auto culture_any_copies = WEDGESCOPE_HIGHWAY_COPIES(culture_any);

bool culture_lanes(std::size_t n, const CultureScene& scene, const CulturePieces& pieces, CultureParts& out) noexcept {
    return culture_any_copies.in_use()(n, scene, pieces, out);
}

}  // namespace wedgescope
#endif
