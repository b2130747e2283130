// Ticks: a clock cheap enough to read several times a line. Only ratios of its counts mean anything.
#pragma once
#include <chrono>
#include <cstdint>

namespace wedgescope {

inline std::uint64_t ticks() {
#if defined(__x86_64__)
    return __builtin_ia32_rdtsc();
#else
    return static_cast<std::uint64_t>(std::chrono::steady_clock::now().time_since_epoch().count());
#endif
}

}  // namespace wedgescope
