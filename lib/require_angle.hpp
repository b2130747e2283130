// The check of an angle that a law takes, beside those of numbers in sensor.hpp.
#pragma once

#include "lib/angle.hpp"
#include "lib/sensor.hpp"

namespace wedgescope {

/// InputError such as "incidence is 91 deg; it must be at least 0 and at most 90". The last digits that an angle loses
/// on its way from degrees to radians do not matter; NaN never passes.
inline void require_angle(const char* key, Angle angle, double low_deg, double high_deg) {
    constexpr double lost_deg = 1e-9;
    if (!(angle.deg() >= low_deg - lost_deg && angle.deg() <= high_deg + lost_deg))
        require_within(key, angle.deg(), low_deg, high_deg, "deg");
}

}  // namespace wedgescope
