// Cells under many spokes at once: the posts round a piece lie anywhere on their lines, but those of neighbours side by side.
#include <algorithm>
#include <cmath>

#include "lib/sample.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lib/cells.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "lib/highway_copies.hpp"

HWY_BEFORE_NAMESPACE();
namespace wedgescope::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Numbers = hn::CappedTag<double, 8>;

/// Posts that both lines hold, and where.
struct Posts {
    const LinePosts &behind, &ahead;
    std::int64_t begin, end;
    const float *back, *front;  ///< post `begin`

    Posts(const LinePosts& b, const LinePosts& a)
        : behind(b), ahead(a), begin(std::max(b.begin, a.begin)), end(std::min(b.end, a.end)),
          back(begin < end ? b.posts + (begin - b.begin) : b.posts),
          front(begin < end ? a.posts + (begin - a.begin) : a.posts) {}
};

HWY_INLINE HWY_ATTR void take_one(const Posts& posts, std::size_t i, const CellLanes& out) {
    const auto cell = static_cast<std::int64_t>(out.cell[i]);
    float *const b = out.behind + 2 * i, *const a = out.ahead + 2 * i;
    if (cell >= posts.begin && cell + 1 < posts.end) {
        hwy::CopyBytes<2 * sizeof(float)>(posts.back + (cell - posts.begin), b);
        hwy::CopyBytes<2 * sizeof(float)>(posts.front + (cell - posts.begin), a);
        return;
    }
    for (const int side : {0, 1}) {
        b[side] = posts.behind.has(cell + side) ? posts.behind.at(cell + side) : no_post;
        a[side] = posts.ahead.has(cell + side) ? posts.ahead.at(cell + side) : no_post;
    }
}

#if HWY_TARGET <= HWY_AVX3
/// Eight lanes at once, from `at` on, if all their cells lie in a run of 32 posts that both lines hold; else false, and nothing is
/// written. Spokes stand in order, so the run begins where one of the outer two does.
HWY_INLINE HWY_ATTR bool take_all(const Posts& posts, hn::Vec<Numbers> cells, std::size_t at, const CellLanes& out) {
    const Numbers d;
    constexpr std::int64_t run = 32;
    if (posts.end - posts.begin < run) return false;
    const __m128d last_two = _mm512_extractf64x2_pd(cells.raw, 3);
    const double last = _mm_cvtsd_f64(_mm_unpackhi_pd(last_two, last_two)), zeroth = _mm512_cvtsd_f64(cells.raw);
    const auto either_end = static_cast<std::int64_t>(std::min(zeroth, last));
    const std::int64_t first = std::clamp(either_end, posts.begin, posts.end - run);
    const auto place = hn::Sub(cells, hn::Set(d, static_cast<double>(first)));
    if (!hn::AllTrue(d, hn::And(hn::Ge(place, hn::Zero(d)), hn::Le(place, hn::Set(d, run - 2.0))))) return false;
    // Two floats a lane: post `place` of the run and the next one.
    const hn::RebindToSigned<Numbers> whole;
    const auto index = hn::ConvertTo(whole, place),
               pair = hn::Or(index, hn::ShiftLeft<32>(hn::Add(index, hn::Set(whole, 1))));
    const auto pick = [&](const float* from, float* to) HWY_ATTR {
        _mm512_storeu_ps(to, _mm512_permutex2var_ps(_mm512_loadu_ps(from), pair.raw, _mm512_loadu_ps(from + run / 2)));
    };
    pick(posts.back + (first - posts.begin), out.behind + 2 * at);
    pick(posts.front + (first - posts.begin), out.ahead + 2 * at);
    return true;
}
#else
/// The lanes from `at` on, if both lines hold the posts of all of them; else false, and nothing is written.
HWY_INLINE HWY_ATTR bool take_all(const Posts& posts, hn::Vec<Numbers> cells, std::size_t at, const CellLanes& out) {
    const Numbers d;
    const auto first = hn::Set(d, static_cast<double>(posts.begin)),
               last = hn::Set(d, static_cast<double>(posts.end) - 2);
    if (!hn::AllTrue(d, hn::And(hn::Ge(cells, first), hn::Le(cells, last)))) return false;
    for (std::size_t i = at; i < at + hn::Lanes(d); ++i) {
        const std::int64_t place = static_cast<std::int64_t>(out.cell[i]) - posts.begin;
        hwy::CopyBytes<2 * sizeof(float)>(posts.back + place, out.behind + 2 * i);
        hwy::CopyBytes<2 * sizeof(float)>(posts.front + place, out.ahead + 2 * i);
    }
    return true;
}
#endif

HWY_ATTR void cells(const LinePosts& behind, const LinePosts& ahead, std::size_t n, const double* minor0,
                    const double* minor1, const CellLanes& out) {
    const Numbers d;
    const Posts posts(behind, ahead);
    std::size_t i = 0;
    for (; i + hn::Lanes(d) <= n; i += hn::Lanes(d)) {
        const auto middle = hn::Mul(hn::Set(d, 0.5), hn::Add(hn::LoadU(d, minor0 + i), hn::LoadU(d, minor1 + i))),
                   cell = hn::Add(hn::Floor(middle), hn::Zero(d));  // no minus zero, on any target
        hn::StoreU(cell, d, out.cell + i);
        if (take_all(posts, cell, i, out)) continue;
        for (std::size_t k = 0; k < hn::Lanes(d); ++k) take_one(posts, i + k, out);
    }
    for (; i < n; ++i) {
        out.cell[i] = std::floor(0.5 * (minor0[i] + minor1[i])) + 0.0;
        take_one(posts, i, out);
    }
}

}  // namespace
}  // namespace wedgescope::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace wedgescope {

constexpr auto cells_copies = WEDGESCOPE_HIGHWAY_COPIES(cells);

void cell_lanes(const LinePosts& behind, const LinePosts& ahead, std::size_t n, const double* minor0,
                const double* minor1, const CellLanes& out) noexcept {
    cells_copies.in_use()(behind, ahead, n, minor0, minor1, out);
}

}  // namespace wedgescope
#endif
