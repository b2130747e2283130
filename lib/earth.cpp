#include "lib/earth.hpp"

#include <cmath>
#include <limits>
#include <numbers>

namespace wedgescope {

EllipsoidRadii ellipsoid_radii(double lat_rad) {
    const double e2 = wgs84_f * (2 - wgs84_f);
    const double sin_lat = std::sin(lat_rad);
    const double w2 = 1 - e2 * sin_lat * sin_lat;
    const double w = std::sqrt(w2);
    return {wgs84_a_m * (1 - e2) / (w2 * w), wgs84_a_m / w};
}

double euler_radius_m(double lat_rad, double azimuth_rad) {
    const EllipsoidRadii radii = ellipsoid_radii(lat_rad);
    const double c = std::cos(azimuth_rad);
    const double s = std::sin(azimuth_rad);
    return 1 / (c * c / radii.meridian_m + s * s / radii.normal_m);
}

// The forms of physics 1.1, written with the curvature 1/Re and the chord of the sea-level arc,
//   chord = 2 Re sin(theta/2),   q (Re + h) = chord^2 / (2 Re) (1 + h/Re),
// so that nothing large is subtracted and the plane (curvature 0) is no special case but for the chord itself.
double Earth::chord_m(double arc_m) const {
    return inverse_radius_ == 0 ? arc_m : 2 * std::sin(0.5 * arc_m * inverse_radius_) / inverse_radius_;
}

double Earth::slant_range_m(double sensor_m, double point_m, double arc_m) const {
    const double chord = chord_m(arc_m);
    const double rise = sensor_m - point_m;
    return std::sqrt(rise * rise + chord * chord * (1 + sensor_m * inverse_radius_) * (1 + point_m * inverse_radius_));
}

Earth::Sight Earth::sight(double sensor_m, double point_m, double arc_m) const {
    const double chord = chord_m(arc_m);
    const double rise = sensor_m - point_m;
    const double drop = 0.5 * chord * chord * inverse_radius_;
    const double along = inverse_radius_ == 0 ? arc_m : std::sin(arc_m * inverse_radius_) / inverse_radius_;
    const double sensor_scale = 1 + sensor_m * inverse_radius_;
    const double point_scale = 1 + point_m * inverse_radius_;
    return {slant_range_m(sensor_m, point_m, arc_m), std::atan2(rise + drop * point_scale, along * point_scale),
            std::atan2(rise - drop * sensor_scale, along * sensor_scale)};
}

std::optional<double> Earth::arc_m(double sensor_m, double point_m, double slant_range_m) const {
    const double rise = sensor_m - point_m;
    const double square = (slant_range_m - rise) * (slant_range_m + rise);
    if (!(square >= 0)) return std::nullopt;
    const double chord = std::sqrt(square / ((1 + sensor_m * inverse_radius_) * (1 + point_m * inverse_radius_)));
    if (inverse_radius_ == 0) return chord;
    const double sine = 0.5 * chord * inverse_radius_;
    if (sine > 1) return std::nullopt;
    return 2 * std::asin(sine) / inverse_radius_;
}

double Earth::horizon_arc_m(double height_m) const {
    if (inverse_radius_ == 0) return std::numeric_limits<double>::infinity();
    const double height = height_m * inverse_radius_;
    return 2 * std::asin(std::sqrt(height / (2 * (1 + height)))) / inverse_radius_;
}

double Earth::horizon_distance_m(double height_m) const {
    if (inverse_radius_ == 0) return std::numeric_limits<double>::infinity();
    return std::sqrt(height_m * (2 + height_m * inverse_radius_) / inverse_radius_);
}

// In units of Re, seen from the earth's centre: the sensor stands at height 1 + hs/Re, the ray goes down by t sin(delta).
Earth::RayPoint Earth::ray_point(double sensor_m, double depression_rad, double distance_m) const {
    const double down_m = distance_m * std::sin(depression_rad), out_m = distance_m * std::cos(depression_rad);
    if (inverse_radius_ == 0) return {sensor_m - down_m, out_m};
    const double scale = 1 + sensor_m * inverse_radius_;
    const double length = distance_m * inverse_radius_;
    const double centre = std::sqrt(scale * scale + length * length - 2 * scale * down_m * inverse_radius_);
    return {sensor_m + (distance_m * length - 2 * scale * down_m) / (centre + scale),
            std::atan2(out_m * inverse_radius_, scale - down_m * inverse_radius_) / inverse_radius_};
}

double level_depression_rad(const Earth& earth, double sensor_m, double reference_m, double slant_range_m) {
    const std::optional<double> arc = earth.arc_m(sensor_m, reference_m, slant_range_m);
    if (!arc) return 0.5 * std::numbers::pi;
    return earth.sight(sensor_m, reference_m, *arc).depression_rad;
}

}  // namespace wedgescope
