// Quartic: a polynomial of degree 4, of one number or in lanes.
#pragma once
#include <array>

#include "lib/lanes.hpp"

namespace wedgescope {

/// Coefficients, from that of u^0 on.
using Quartic = std::array<double, 5>;

WEDGESCOPE_LANES_PART double quartic_at(const Quartic& c, double u) noexcept {
    return c[0] + u * (c[1] + u * (c[2] + u * (c[3] + u * c[4])));
}

}  // namespace wedgescope
