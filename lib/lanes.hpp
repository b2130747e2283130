// Lanes: how plain loops over contiguous arrays are compiled for several instruction sets from one source.
// Leaves what the loops do to sample.cpp, sweep.cpp and shade.cpp.
//
// The loops hold only + - * / sqrt, selections and conversions, and the build never fuses a multiplication with an
// addition (-ffp-contract=off), so every instruction set gives the same bits. Sanitizers do not get on with the
// resolver functions that this needs: there the baseline is compiled alone.
#pragma once
#include <tbb/cache_aligned_allocator.h>

#include <vector>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__) && !defined(WEDGESCOPE_ONE_CLONE)
#define WEDGESCOPE_LANES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define WEDGESCOPE_LANES
#endif

/// A function that is only called by such ones, and becomes part of them.
#define WEDGESCOPE_LANES_PART __attribute__((always_inline)) inline

/// In front of a loop: no turn reads what another writes (the arrays are different ones).
#define WEDGESCOPE_INDEPENDENT _Pragma("GCC ivdep")

namespace wedgescope {

/// One number a lane, from a border of the cache's lines on: wide loads never cross one.
using LaneArray = std::vector<double, tbb::cache_aligned_allocator<double>>;
inline constexpr std::size_t lane_step = 8;  ///< lanes in the widest registers

}  // namespace wedgescope
