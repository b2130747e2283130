// Lanes: how plain loops over contiguous arrays are compiled for several instruction sets from one source.
// Leaves which of these is in use to target.hpp, and what the loops do to sample.cpp, sweep.cpp, shade.cpp and others.
//
// The loops hold only + - * / sqrt, selections and conversions, and the build never fuses a multiplication with an
// addition (-ffp-contract=off), so every instruction set gives the same bits.
#pragma once
#include <tbb/cache_aligned_allocator.h>

#include <vector>

#include "lib/target.hpp"

/// A function that on_target() calls, or that is only called by such ones: it becomes part of each copy.
#define WEDGESCOPE_LANES_PART __attribute__((always_inline)) inline

/// In front of a loop: no turn reads what another writes (the arrays are different ones).
#define WEDGESCOPE_INDEPENDENT _Pragma("GCC ivdep")

namespace wedgescope {

/// One number a lane, from a border of the cache's lines on: wide loads never cross one.
using LaneArray = std::vector<double, tbb::cache_aligned_allocator<double>>;
inline constexpr std::size_t lane_step = 8;  ///< lanes in the widest registers
/// n up to whole registers of floats: a loop over so many leaves no rest to go through one by one. The arrays must go on so
/// far; what they hold there is anything.
constexpr std::size_t whole_registers(std::size_t n) {
    return (n + 2 * lane_step - 1) / (2 * lane_step) * (2 * lane_step);
}

namespace detail {

/// `body`, a WEDGESCOPE_LANES_PART, compiled for each target.
template <auto body>
struct Copies;
template <class Result, class... Arguments, Result (*body)(Arguments...) noexcept>
struct Copies<body> {
    static Result baseline(Arguments... arguments) noexcept { return body(arguments...); }
#if defined(__x86_64__)
    __attribute__((target("sse4.2"))) static Result sse4(Arguments... arguments) noexcept { return body(arguments...); }
    __attribute__((target("avx2"))) static Result avx2(Arguments... arguments) noexcept { return body(arguments...); }
    __attribute__((target("avx2,avx512f,avx512bw,avx512dq,avx512vl"))) static Result avx512(
        Arguments... arguments) noexcept {
        return body(arguments...);
    }
#endif
};

}  // namespace detail

/// Calls the copy of `body` for the target in use.
template <auto body, class... Arguments>
inline auto on_target(Arguments&&... arguments) noexcept {
    using Copies = detail::Copies<body>;
#if defined(__x86_64__)
    switch (target_in_use()) {
        case Target::avx512:
            return Copies::avx512(arguments...);
        case Target::avx2:
            return Copies::avx2(arguments...);
        case Target::sse4:
            return Copies::sse4(arguments...);
        case Target::baseline:
            break;
    }
#endif
    return Copies::baseline(arguments...);
}

}  // namespace wedgescope
