// Radar equation: what one reflector or one resolution cell returns, in closed form.
// Leaves the sum over the ground to shade.hpp and deposit.hpp, which add up pieces instead of cells.
//
// Source: physics 2.1.
#pragma once
#include "lib/sensor.hpp"

namespace wedgescope {

/// P_t G_0^2 g^2 lambda^2 sigma / ((4 pi)^3 r^4 L_s L_a), watts. `pattern`: g, one-way, relative to the peak; `cross_section_m2`:
/// sigma; `slant_range_m` above 0; `atmosphere`: L_a, two-way.
double received_power_w(const RadarParams& radar, double pattern, double cross_section_m2, double slant_range_m,
                        Decibel atmosphere);

/// theta_2 = theta_3dB sqrt(pi / (8 ln 2)): the integral of the two-way Gaussian pattern.
Angle two_way_width(Angle half_power_width);

/// Ground in one resolution cell, square metres; what the radar returns of it is sigma0 times the smaller of the two.
struct CellArea {
    double pulse_m2;  ///< r theta_2 (c tau/2) / cos(psi): what the pulse and the beam's azimuth bound
    double beam_m2;   ///< theta_2az theta_2el r^2 / sin(psi): what the beam alone bounds
    double least_m2() const { return pulse_m2 < beam_m2 ? pulse_m2 : beam_m2; }
};
/// `azimuth`, `elevation`: half-power beamwidths, one-way; `grazing` above 0 and at most a right angle, where the beam bounds.
CellArea cell_area(Angle azimuth, Angle elevation, double pulse_extent_m, double slant_range_m, Angle grazing);

}  // namespace wedgescope
