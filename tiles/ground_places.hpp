// Ground places: where points round the sensor lie, in the CRS that a geolocation array has.
// For the .cpp files of this folder only. Leaves arrays and files to geolocation_array.hpp.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "lib/engine.hpp"

namespace wedgescope {

struct RasterFormat;

/// In the CRS; longitude first.
struct Place {
    double x = 0, y = 0;
};

/// Places of a square round the sensor, which stands in its middle: exact ones at the nodes of a grid and a cubic through
/// four of them each way between. Points are given as the ends of arcs that leave the sensor: so places are smooth, whatever the
/// display, and a picture's altitude hole is no edge.
class PlaceTable {
public:
    using Exact = std::function<Place(double east_m, double north_m)>;
    /// From -reach_m to reach_m both ways, in `cells` x `cells` cells, an even number.
    PlaceTable(const Exact& exact, double reach_m, int cells);

    bool holds(double east_m, double north_m) const;
    /// Of a point that it holds; the sensor's own exactly. + - * only.
    Place at(double east_m, double north_m) const;
    /// Largest difference from the exact places, in units of the CRS, x (times `x_scale`) or y, at the middles of the cells,
    /// where cubics are farthest off.
    double error(const Exact& exact, double x_scale) const;

private:
    int cells_, side_;
    double reach_m_, per_m_;
    std::vector<Place> nodes_;  ///< side x side, one more than the cells have on every side
};

/// WGS84 azimuthal equidistant, in a unit of length as PROJ calls it, with the sensor in its middle.
std::string crs_round_sensor(const ResolvedScene& scene, const char* unit);

/// Geodesics in geodesic geometry, straight lines in the raster's x, y otherwise.
class Ground {
public:
    /// `reach_m`: the longest arc for which places are asked often; `error_m`: how far off they may be there. By a table
    /// where that does, else exact.
    Ground(const ResolvedScene& scene, const RasterFormat& format, double reach_m, double error_m);

    /// The raster's own in grid geometry; else WGS84 latitude and longitude, or crs_round_sensor() where these reach beyond 180
    /// degrees or beyond 70 north or south.
    const std::string& crs() const { return crs_; }
    /// Of the end of an arc of length hypot(east, north) that leaves the sensor in that direction.
    Place at(double east_m, double north_m) const;
    bool has_table() const { return table_ != nullptr; }

private:
    Place exact(double east_m, double north_m) const;

    Geometry geometry_;
    double lat_deg_, lon_deg_, x_, y_, metres_per_unit_;
    std::string crs_;
    bool round_sensor_ = false;  ///< places are ends of arcs, as they are given
    std::shared_ptr<const PlaceTable> table_;
};

/// Arc at the reference height of a range of the scene's range bins; 0 inside the altitude hole, half-way round the earth beyond
/// what a ray reaches.
double ground_arc_m(const ResolvedScene& scene, double range_m);

}  // namespace wedgescope
