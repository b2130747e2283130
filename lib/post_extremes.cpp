#include "lib/post_extremes.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lib/post_extremes.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "lib/highway_copies.hpp"

HWY_BEFORE_NAMESPACE();
namespace wedgescope::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

template <class Floats>
HWY_ATTR PostExtremes extremes_by(Floats d, const float* posts, std::size_t stride, std::size_t lines,
                                  std::size_t width) {
    const hn::RebindToUnsigned<Floats> du;
    const std::size_t step = hn::Lanes(d);
    const auto infinite = hn::Set(d, std::numeric_limits<float>::infinity()), lower = hn::Neg(infinite);
    auto low = infinite, high = lower;
    auto voids = hn::Zero(du);
    const auto all = hn::Set(du, 1);
    const auto add = [&](auto z, auto counted) HWY_ATTR {
        const auto is_void = hn::IsNaN(z);
        low = hn::Min(low, hn::IfThenElse(is_void, infinite, z));
        high = hn::Max(high, hn::IfThenElse(is_void, lower, z));
        voids = hn::Add(voids, hn::IfThenElseZero(hn::RebindMask(du, is_void), counted));
    };
    // Of the last lanes of a line, those that no others had.
    const std::size_t rest = width % step;
    const auto new_ones = hn::IfThenZeroElse(hn::FirstN(du, step - rest), all),
               first = hn::IfThenElseZero(hn::FirstN(du, 1), all);
    PostExtremes found;
    for (std::size_t l = 0; l < lines; ++l, posts += stride) {
        if (width >= step) {
            for (std::size_t i = 0; i + step <= width; i += step) add(hn::LoadU(d, posts + i), all);
            if (rest != 0) add(hn::LoadU(d, posts + width - step), new_ones);
        } else {
            for (std::size_t i = 0; i < width; ++i) add(hn::Set(d, posts[i]), first);
        }
    }
    HWY_ALIGN std::uint32_t counts[HWY_MAX_BYTES / sizeof(std::uint32_t)];
    hn::Store(voids, du, counts);
    for (std::size_t i = 0; i < step; ++i) found.voids += counts[i];
    // Minus and plus zero are alike: which of them comes out is left to no order.
    found.lowest_m = hn::GetLane(hn::MinOfLanes(d, low)) + 0.0F;
    found.highest_m = hn::GetLane(hn::MaxOfLanes(d, high)) + 0.0F;
    return found;
}

HWY_ATTR PostExtremes extremes_any(const float* posts, std::size_t stride, std::size_t lines, std::size_t width) {
    const hn::ScalableTag<float> widest;
    // The 9 posts across a small block fill no wider register.
    if (width < hn::Lanes(widest)) return extremes_by(hn::CappedTag<float, 8>(), posts, stride, lines, width);
    return extremes_by(widest, posts, stride, lines, width);
}

}  // namespace
}  // namespace wedgescope::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace wedgescope {

constexpr auto extremes_any_copies = WEDGESCOPE_HIGHWAY_COPIES(extremes_any);

PostExtremes post_extremes(const float* posts, std::size_t stride, std::size_t lines, std::size_t width) noexcept {
    return extremes_any_copies.in_use()(posts, stride, lines, width);
}

}  // namespace wedgescope
#endif
