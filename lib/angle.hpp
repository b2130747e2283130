// Angle: a plane angle made only by name, so that degrees where radians are meant cannot compile.
// Leaves azimuth arcs that wrap through north to arc.hpp.
#pragma once
#include <numbers>

namespace wedgescope {

class Angle {
public:
    constexpr Angle() = default;
    static constexpr Angle degrees(double d) { return Angle(d * (std::numbers::pi / 180)); }
    static constexpr Angle radians(double r) { return Angle(r); }
    constexpr double rad() const { return rad_; }
    constexpr double deg() const { return rad_ * (180 / std::numbers::pi); }
    friend constexpr auto operator<=>(const Angle&, const Angle&) = default;

private:
    explicit constexpr Angle(double r) : rad_(r) {}
    double rad_ = 0;
};

}  // namespace wedgescope
