// Facet: a sloping piece of ground and a ray: the angle between them, and areas.
// Leaves what a facet returns to backscatter.hpp; the sweep has the same from differences of its horizon.
//
// Source: physics "Slopes".
#pragma once
#include <algorithm>
#include <cmath>

#include "lib/angle.hpp"

namespace wedgescope {

struct Facet {
    Angle local_grazing;   ///< -90 to 90 degrees; not above 0: the facet shadows itself
    double true_area = 1;  ///< of a cell of plan area 1
    /// On the plane normal to the ray, of a cell of plan area 1.
    double projected_area() const { return std::max(0.0, std::sin(local_grazing.rad())) * true_area; }
};

/// Sine of the local grazing angle (n . u, both of length 1; u points back to the antenna), of the sine and cosine of the grazing angle
/// of the horizontal plane, the rise of the surface along the outgoing ray and the secant of its steepest slope.
inline double facet_sine(double sine, double cosine, double rise, double secant) {
    return (sine + rise * cosine) / secant;
}

/// `grazing`: of the horizontal plane at the point; `azimuth`: of the outgoing ray there, from north, clockwise; slopes dz/dx towards
/// east and dz/dy towards north, finite.
inline Facet facet_of(Angle grazing, Angle azimuth, double dz_dx, double dz_dy) {
    const double norm = std::sqrt(1 + dz_dx * dz_dx + dz_dy * dz_dy);
    const double rise = dz_dx * std::sin(azimuth.rad()) + dz_dy * std::cos(azimuth.rad());
    const double sine = facet_sine(std::sin(grazing.rad()), std::cos(grazing.rad()), rise, norm);
    return {Angle::radians(std::asin(std::clamp(sine, -1.0, 1.0))), norm};
}

}  // namespace wedgescope
