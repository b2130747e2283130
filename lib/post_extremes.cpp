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

HWY_ATTR PostExtremes extremes_any(const float* posts, std::size_t stride, std::size_t lines, std::size_t width) {
    const hn::ScalableTag<float> d;
    const std::size_t step = hn::Lanes(d);
    const auto infinite = hn::Set(d, std::numeric_limits<float>::infinity()), lower = hn::Neg(infinite);
    auto low = infinite, high = lower, voids = hn::Zero(d);
    const auto one = hn::Set(d, 1);
    const auto add = [&](auto z) HWY_ATTR {
        const auto is_void = hn::IsNaN(z);
        low = hn::Min(low, hn::IfThenElse(is_void, infinite, z));
        high = hn::Max(high, hn::IfThenElse(is_void, lower, z));
        voids = hn::Or(voids, hn::IfThenElseZero(is_void, one));
    };
    PostExtremes found;
    for (std::size_t l = 0; l < lines; ++l, posts += stride) {
        if (width >= step) {
            for (std::size_t i = 0; i + step <= width; i += step) add(hn::LoadU(d, posts + i));
            if (width % step != 0) add(hn::LoadU(d, posts + width - step));  // some of them once more
        } else {
            for (std::size_t i = 0; i < width; ++i) add(hn::Set(d, posts[i]));
        }
    }
    found.lowest_m = hn::GetLane(hn::MinOfLanes(d, low));
    found.highest_m = hn::GetLane(hn::MaxOfLanes(d, high));
    found.any_void = hn::GetLane(hn::MaxOfLanes(d, voids)) > 0;
    return found;
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
