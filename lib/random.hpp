// Counter-based random numbers: the same draw for the same key and counter, in any order, on any thread.
// Leaves what is drawn to fluctuation.hpp.
//
// Source: Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC11; known-answer vector in the test.
#pragma once
#include <array>
#include <cstdint>

namespace wedgescope {

using PhiloxBlock = std::array<std::uint32_t, 4>;

/// Philox4x32-10.
PhiloxBlock philox(std::array<std::uint32_t, 2> key, PhiloxBlock counter);

/// Uniform in (0, 1): (x + 0.5) 2^-32.
constexpr double uniform(std::uint32_t x) { return (x + 0.5) * 0x1p-32; }

}  // namespace wedgescope
