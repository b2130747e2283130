#include "lib/radar_equation.hpp"

#include <cmath>
#include <numbers>

#include "lib/shade.hpp"

namespace wedgescope {

double received_power_w(const RadarParams& radar, double pattern, double cross_section_m2, double slant_range_m,
                        Decibel atmosphere) {
    const double square = slant_range_m * slant_range_m;
    return radar_constant(radar) * pattern * pattern * cross_section_m2 / (square * square * atmosphere.ratio());
}

Angle two_way_width(Angle half_power_width) {
    return Angle::radians(half_power_width.rad() * std::sqrt(std::numbers::pi / (8 * std::numbers::ln2)));
}

CellArea cell_area(Angle azimuth, Angle elevation, double pulse_extent_m, double slant_range_m, Angle grazing) {
    const double across_m = slant_range_m * two_way_width(azimuth).rad();
    return {across_m * pulse_extent_m / std::cos(grazing.rad()),
            across_m * slant_range_m * two_way_width(elevation).rad() / std::sin(grazing.rad())};
}

}  // namespace wedgescope
