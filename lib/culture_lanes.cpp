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
using Doubles = hn::CappedTag<double, 8>;
using Floats = hn::Rebind<float, Doubles>;
using Ints = hn::Rebind<std::int32_t, Doubles>;
using Lane = hn::Vec<Doubles>;
using Holds = hn::Mask<Doubles>;

HWY_INLINE Lane all(double x) { return hn::Set(Doubles(), x); }
HWY_INLINE Lane pick(Holds holds, Lane a, Lane b) { return hn::IfThenElse(holds, a, b); }
HWY_INLINE void store(Lane x, std::int32_t* to) { hn::StoreU(hn::DemoteTo(Ints(), x), Ints(), to); }

/// Where a piece begins or ends: raster index across the lines and along them.
struct Place {
    Lane major, minor;
};

/// The corner with the highest culture, and where there is one.
HWY_INLINE Holds wall_corner(const CultureScene& scene, const CulturePieces& p, std::size_t i, Place& corner) {
    const Doubles d;
    const Floats f;
    hn::Vec<Floats> low[2], high[2];
    const bool in_order = scene.behind_major <= scene.ahead_major;
    hn::LoadInterleaved2(f, (in_order ? p.behind_m : p.ahead_m) + 2 * i, low[0], low[1]);
    hn::LoadInterleaved2(f, (in_order ? p.ahead_m : p.behind_m) + 2 * i, high[0], high[1]);
    const Lane low_major = all(in_order ? scene.behind_major : scene.ahead_major),
               high_major = all(in_order ? scene.ahead_major : scene.behind_major);
    const Lane cell = hn::LoadU(d, p.cell + i), after = cell + all(1);
    Lane most = hn::Zero(d);
    corner = {low_major, cell};
    const auto rival = [&](hn::Vec<Floats> height, Lane major, Lane minor) HWY_ATTR {
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

HWY_ATTR void culture_any(std::size_t n, const CultureScene& scene, const CulturePieces& p, CultureParts& out) {
    const Doubles d;
    const Lane zero = hn::Zero(d), one = all(1);
    const Lane column_begin = all(static_cast<double>(scene.tile.columns.begin)),
               row_begin = all(static_cast<double>(scene.tile.rows.begin)),
               columns = all(static_cast<double>(scene.tile.columns.size())),
               rows = all(static_cast<double>(scene.tile.rows.size()));
    for (std::size_t i = 0; i < n; i += hn::Lanes(d)) {
        Place from{hn::LoadU(d, p.major0 + i), hn::LoadU(d, p.minor0 + i)},
            to{hn::LoadU(d, p.major1 + i), hn::LoadU(d, p.minor1 + i)};
        Holds wall = one < zero;
        if (p.cell) {
            Place corner;
            wall = wall_corner(scene, p, i, corner);
            from = {pick(wall, corner.major, from.major), pick(wall, corner.minor, from.minor)};
            to = {pick(wall, corner.major, to.major), pick(wall, corner.minor, to.minor)};
        }
        const auto column = [&](const Place& at) HWY_ATTR {
            return all(scene.column_offset) + all(scene.column_scale) * (scene.lines_are_columns ? at.major : at.minor);
        };
        const auto row = [&](const Place& at) HWY_ATTR {
            return all(scene.row_offset) + all(scene.row_scale) * (scene.lines_are_columns ? at.minor : at.major);
        };
        const Lane column0 = column(from), column1 = column(to), row0 = row(from), row1 = row(to);
        const Lane first_column = hn::Floor(column0) - column_begin, last_column = hn::Floor(column1) - column_begin,
                   first_row = hn::Floor(row0) - row_begin, last_row = hn::Floor(row1) - row_begin;
        const Lane left = hn::Min(first_column, last_column), right = hn::Max(first_column, last_column),
                   top = hn::Min(first_row, last_row), bottom = hn::Max(first_row, last_row);
        const Holds inside = hn::And(hn::And(left >= zero, right < columns), hn::And(top >= zero, bottom < rows)),
                    few = hn::And(right - left <= one, bottom - top <= one), good = hn::And(inside, few);
        // The border between two cells begins the second one.
        const auto cut = [&](Holds crosses, Lane border, Lane from_at, Lane to_at) HWY_ATTR {
            return hn::IfThenElseZero(crosses, (border - from_at) / pick(crosses, to_at - from_at, one));
        };
        const Lane at_column = cut(right > left, right + column_begin, column0, column1),
                   at_row = cut(bottom > top, bottom + row_begin, row0, row1);
        const Holds column_first = at_column <= at_row;
        const auto index = [&](Lane cell_column, Lane cell_row)
                               HWY_ATTR { return hn::IfThenElseZero(good, cell_row * columns + cell_column); };
        const Lane to_second = hn::Min(at_column, at_row), to_third = hn::Max(at_column, at_row);
        // A cell that is only touched is none of the piece's: its neighbour stands for it.
        Lane cell0 = index(first_column, first_row), cell2 = index(last_column, last_row),
             cell1 = index(pick(column_first, last_column, first_column), pick(column_first, first_row, last_row));
        cell1 = pick(to_second == to_third, pick(to_second <= zero, cell2, cell0), cell1);
        cell2 = pick(to_third >= one, cell1, cell2);
        cell0 = pick(to_second <= zero, cell1, cell0);
        store(cell0, out.first + i);
        store(cell1, out.second + i);
        store(cell2, out.third + i);
        hn::StoreU(to_second, d, out.to_second + i);
        hn::StoreU(to_third, d, out.to_third + i);
        const Lane kind =
            pick(wall, all(CultureParts::wall), pick(few, all(CultureParts::parts), all(CultureParts::many)));
        store(pick(inside, kind, all(CultureParts::elsewhere)), out.kind + i);
    }
}

}  // namespace
}  // namespace wedgescope::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace wedgescope {

constexpr auto culture_any_copies = WEDGESCOPE_HIGHWAY_COPIES(culture_any);

void culture_lanes(std::size_t n, const CultureScene& scene, const CulturePieces& pieces, CultureParts& out) noexcept {
    culture_any_copies.in_use()(n, scene, pieces, out);
}

}  // namespace wedgescope
#endif
