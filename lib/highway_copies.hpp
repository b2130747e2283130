// What Highway compiles of a loop for each target, and which of it runs: the one that target.hpp names. In place of Highway's
// own dispatch, whose library takes 3 ms of every process to measure a timer before main.
// For the .cpp files that are compiled once a target, after <hwy/highway.h>.
#pragma once
#include <hwy/highway.h>

#include <array>
#include <cstddef>

#include "lib/target.hpp"

namespace wedgescope {

template <class Function>
class HighwayCopies {
public:
    /// By Target; null: the compiler has none, so the next plainer one runs.
    explicit constexpr HighwayCopies(std::array<Function*, target_names.size()> copies) : copies_(copies) {
        for (std::size_t i = 1; i < copies_.size(); ++i)
            if (!copies_[i]) copies_[i] = copies_[i - 1];
    }
    Function* in_use() const noexcept { return copies_[static_cast<std::size_t>(target_in_use())]; }

private:
    std::array<Function*, target_names.size()> copies_;
};

}  // namespace wedgescope

/// The copies of HWY_NAMESPACE::function, in whose outer namespace this stands.
#if HWY_ARCH_X86
#define WEDGESCOPE_HIGHWAY_COPIES(function)                                                   \
    wedgescope::HighwayCopies<decltype(HWY_STATIC_DISPATCH(function))>(                       \
        {HWY_CHOOSE_FALLBACK(function), HWY_CHOOSE_SSE4(function), HWY_CHOOSE_AVX2(function), \
         HWY_CHOOSE_AVX3(function)})
#else
#define WEDGESCOPE_HIGHWAY_COPIES(function) \
    wedgescope::HighwayCopies<decltype(HWY_STATIC_DISPATCH(function))>({&HWY_STATIC_DISPATCH(function)})
#endif
