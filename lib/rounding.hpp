// Numbers: rounding to whole ones, and of what libm, PROJ and GeographicLib return before it enters the sweep, so that a last bit that differs
// between two machines' libraries never reaches a result.
#pragma once
#include <cmath>
#include <cstdint>
#include <limits>

namespace wedgescope {

inline constexpr double infinite = std::numeric_limits<double>::infinity();

/// The greatest whole number that is not above it.
inline std::int64_t floor_of(double v) {
    const auto t = static_cast<std::int64_t>(v);
    return static_cast<double>(t) > v ? t - 1 : t;
}

/// The nearest multiple of 2^-bits.
inline double rounded(double value, int bits) { return std::ldexp(std::nearbyint(std::ldexp(value, bits)), -bits); }

/// The nearest number with `bits` significant bits.
inline double rounded_significand(double value, int bits) {
    if (value == 0 || !std::isfinite(value)) return value;
    int exponent = 0;
    const double fraction = std::frexp(value, &exponent);
    return std::ldexp(std::nearbyint(std::ldexp(fraction, bits)), exponent - bits);
}

inline constexpr int position_bits = 20;  ///< of a post
inline constexpr int angle_bits = 40;     ///< of a radian

}  // namespace wedgescope
