// Earth: straight rays over a sphere of effective radius Re = K R, or over a plane.
// Leaves positions on rasters to spoke_map.hpp; these are the exact closed forms (libm), for set-up,
// display and beam; the sweep has its own series of the same forms.
//
// Source: physics "Effective earth" (Skolnik; Long). Heights are above the sea-level surface, s is arc
// length along it.
#pragma once
#include <cmath>
#include <limits>
#include <optional>

namespace wedgescope {

inline constexpr double wgs84_a_m = 6378137.0;
inline constexpr double wgs84_f = 1 / 298.257223563;
inline constexpr double mean_radius_m = 6371008.7714;  ///< (2a + b) / 3

/// Within a metre of a pole, where azimuths from north are none.
inline bool is_at_pole(double lat_deg) { return 90 - std::abs(lat_deg) < 1.0 / 111000; }

struct EllipsoidRadii {
    double meridian_m;  ///< M
    double normal_m;    ///< N
};
EllipsoidRadii ellipsoid_radii(double lat_rad);
/// 1/R(alpha) = cos^2(alpha)/M + sin^2(alpha)/N.
double euler_radius_m(double lat_rad, double azimuth_rad);

/// One radius for one direction; inverse_radius 0 is the plane.
class Earth {
public:
    Earth() = default;  ///< plane
    explicit Earth(double effective_radius_m) : inverse_radius_(1 / effective_radius_m) {}
    /// From inverse_radius(), exactly.
    static Earth of_curvature(double inverse_radius_per_m) {
        Earth earth;
        earth.inverse_radius_ = inverse_radius_per_m;
        return earth;
    }

    double inverse_radius() const { return inverse_radius_; }
    /// How far a run may look, of slant range or arc: the sweep's series hold to there. Infinite on the plane.
    double farthest_m() const {
        return inverse_radius_ == 0 ? std::numeric_limits<double>::infinity() : farthest_radii / inverse_radius_;
    }
    static constexpr double farthest_radii = 0.3;

    struct Sight {
        double slant_range_m;
        double depression_rad;  ///< at the antenna, positive down
        double grazing_rad;     ///< at the point, of the horizontal plane
    };
    /// From a sensor at height `sensor_m` to a point of height `point_m` at arc `arc_m` >= 0.
    Sight sight(double sensor_m, double point_m, double arc_m) const;

    /// The slant range of `sight` alone (display asks it for every pixel).
    double slant_range_m(double sensor_m, double point_m, double arc_m) const;

    /// Arc of the point of height `point_m` at slant range `slant_range_m`; nothing where slant range is
    /// less than the height difference (the altitude hole), or reaches past the antipode.
    std::optional<double> arc_m(double sensor_m, double point_m, double slant_range_m) const;

    /// Arc to the tangent point of a sensor `height_m` (>= 0) above the surface; infinite on the plane.
    double horizon_arc_m(double height_m) const;
    /// Length of that line of sight, sqrt(h (2 Re + h)); infinite on the plane.
    double horizon_distance_m(double height_m) const;

    struct RayPoint {
        double height_m;
        double arc_m;  ///< of the point below it, from the sensor's
    };
    /// The point of a straight ray at distance `distance_m` >= 0 from a sensor at height `sensor_m`.
    RayPoint ray_point(double sensor_m, double depression_rad, double distance_m) const;

private:
    double chord_m(double arc_m) const;

    double inverse_radius_ = 0;
};

/// Arc and depression at slant range for level ground, as beam and display use them: where the level
/// surface is not reached (altitude hole) the depression is that of the nadir.
double level_depression_rad(const Earth& earth, double sensor_m, double reference_m, double slant_range_m);

}  // namespace wedgescope
