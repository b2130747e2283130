#include "lib/directivity.hpp"

#include <algorithm>
#include <cmath>

namespace wedgescope {

double directivity_gain(Directivity directivity, Angle to_radar, Angle normal) {
    if (directivity == Directivity::omni) return 1;
    const double facing = std::cos(to_radar.rad() - normal.rad());
    const double shown = directivity == Directivity::uni ? std::max(0.0, facing) : std::fabs(facing);
    // m = 4 as two squares: no library function's rounding.
    static_assert(directivity_exponent == 4);
    const double square = shown * shown;
    return std::max(least_directivity, square * square);
}

const char* word(Directivity directivity) {
    return directivity == Directivity::omni ? "omni" : directivity == Directivity::uni ? "uni" : "bi";
}

}  // namespace wedgescope
