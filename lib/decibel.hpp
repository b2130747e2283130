// Decibel: ten times the decimal logarithm of a power ratio, made only by name.
// Leaves absolute levels (dBm) to receiver.hpp.
#pragma once
#include <cmath>

namespace wedgescope {

class Decibel {
public:
    constexpr Decibel() = default;
    explicit constexpr Decibel(double db) : db_(db) {}
    static Decibel from_ratio(double ratio) { return Decibel(10 * std::log10(ratio)); }
    constexpr double db() const { return db_; }
    double ratio() const { return std::pow(10.0, 0.1 * db_); }
    friend constexpr auto operator<=>(const Decibel&, const Decibel&) = default;

private:
    double db_ = 0;
};

}  // namespace wedgescope
