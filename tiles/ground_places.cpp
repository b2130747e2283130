#include "tiles/ground_places.hpp"

#include <fmt/format.h>
#include <ogr_srs_api.h>
#include <GeographicLib/Geodesic.hpp>

#include <algorithm>
#include <array>
#include <cmath>

#include "tiles/polar_raster.hpp"

namespace wedgescope {
namespace {

constexpr double half_way_round_m = 2e7;
constexpr double metres_per_degree = 111320;

/// Whether latitude and longitude do. GDAL turns an array round on a grid of square degrees, from -180 to 180: it finds nothing
/// beyond, and ever less the more a degree of latitude and one of longitude differ on the ground.
bool in_degrees(double lat_deg, double lon_deg, double reach_m) {
    constexpr double farthest_deg = 70;
    const double lat = std::abs(lat_deg) + reach_m / metres_per_degree;
    if (!(lat <= farthest_deg)) return false;
    return std::abs(lon_deg) + reach_m / (metres_per_degree * std::cos(Angle::degrees(lat).rad())) <= 180;
}

/// Of the nodes at -1, 0, 1 and 2 for a point between 0 and 1: Lagrange's cubic.
std::array<double, 4> cubic_weights(double t) {
    const double before = t + 1, after = t - 1, last = t - 2;
    return {t * after * last * (-1.0 / 6), before * after * last * 0.5, before * t * last * -0.5,
            before * t * after * (1.0 / 6)};
}

}  // namespace

PlaceTable::PlaceTable(const Exact& exact, double reach_m, int cells)
    : cells_(cells), side_(cells + 3), reach_m_(reach_m), per_m_(cells / (2 * reach_m)) {
    nodes_.reserve(static_cast<std::size_t>(side_ * side_));
    const auto metres = [&](int node) { return (node - 1 - cells / 2) / per_m_; };
    for (int row = 0; row < side_; ++row)
        for (int column = 0; column < side_; ++column) nodes_.push_back(exact(metres(column), metres(row)));
}

bool PlaceTable::holds(double east_m, double north_m) const {
    return std::abs(east_m) <= reach_m_ && std::abs(north_m) <= reach_m_;
}

Place PlaceTable::at(double east_m, double north_m) const {
    const double u = east_m * per_m_ + 0.5 * cells_, v = north_m * per_m_ + 0.5 * cells_;
    const int i = std::clamp(static_cast<int>(u), 0, cells_ - 1), j = std::clamp(static_cast<int>(v), 0, cells_ - 1);
    const std::array<double, 4> across = cubic_weights(u - i), up = cubic_weights(v - j);
    const Place* row = nodes_.data() + j * side_ + i;
    Place sum;
    for (std::size_t r = 0; r < 4; ++r, row += side_) {
        Place line;
        for (std::size_t c = 0; c < 4; ++c) {
            line.x += across[c] * row[c].x;
            line.y += across[c] * row[c].y;
        }
        sum.x += up[r] * line.x;
        sum.y += up[r] * line.y;
    }
    return sum;
}

double PlaceTable::error(const Exact& exact, double x_scale) const {
    double most = 0;
    for (int j = 0; j < cells_; ++j)
        for (int i = 0; i < cells_; ++i) {
            const double east = (i + 0.5 - cells_ / 2) / per_m_, north = (j + 0.5 - cells_ / 2) / per_m_;
            const Place near = at(east, north), truth = exact(east, north);
            most = std::max({most, std::abs(near.x - truth.x) * x_scale, std::abs(near.y - truth.y)});
        }
    return most;
}

Ground::Ground(const ResolvedScene& scene, const RasterFormat& format, double reach_m, double error_m)
    : geometry_(scene.geometry), lat_deg_(scene.lat_deg), lon_deg_(scene.lon_deg), x_(scene.x), y_(scene.y),
      metres_per_unit_(format.metres_per_unit) {
    if (geometry_ == Geometry::grid) {
        crs_ = format.crs_wkt;
        return;
    }
    round_sensor_ = !in_degrees(lat_deg_, lon_deg_, reach_m);
    crs_ = round_sensor_ ? crs_round_sensor(scene, "km") : SRS_WKT_WGS84_LAT_LONG;  // which asks PROJ for nothing
    if (round_sensor_ || !(reach_m > 0)) return;
    // A geodesic a node of the array would take longer than all else that a picture is made of.
    const auto truth = [this](double east_m, double north_m) { return exact(east_m, north_m); };
    const double x_scale = std::cos(Angle::degrees(lat_deg_).rad());
    for (const int cells : {16, 64}) {
        auto table = std::make_shared<const PlaceTable>(truth, reach_m, cells);
        if (table->error(truth, x_scale) * metres_per_degree > error_m) continue;
        table_ = std::move(table);
        return;
    }
}

std::string crs_round_sensor(const ResolvedScene& scene, const char* unit) {
    return fmt::format("+proj=aeqd +lat_0={:.15g} +lon_0={:.15g} +x_0=0 +y_0=0 +datum=WGS84 +units={} +no_defs",
                       scene.lat_deg, scene.lon_deg, unit);
}

Place Ground::exact(double east_m, double north_m) const {
    double lat = 0, lon = 0;
    GeographicLib::Geodesic::WGS84().Direct(lat_deg_, lon_deg_, Angle::radians(std::atan2(east_m, north_m)).deg(),
                                            std::hypot(east_m, north_m), lat, lon);
    return {lon_deg_ + std::remainder(lon - lon_deg_, 360.0), lat};
}

Place Ground::at(double east_m, double north_m) const {
    if (geometry_ == Geometry::grid) return {x_ + east_m / metres_per_unit_, y_ + north_m / metres_per_unit_};
    // In kilometres: GDAL 3.6 takes sides of a cell for parallel by an area of 1e-12 of the CRS's own units squared, and finds
    // pixels some cells away where rounding alone makes more.
    if (round_sensor_) return {east_m / 1000, north_m / 1000};
    return table_ && table_->holds(east_m, north_m) ? table_->at(east_m, north_m) : exact(east_m, north_m);
}

double ground_arc_m(const ResolvedScene& scene, double range_m) {
    if (scene.scene.display.kind == DisplayKind::gpi_true) return range_m;
    if (range_m <= std::fabs(scene.sensor_m - scene.reference_m)) return 0;
    return scene.earth.arc_m(scene.sensor_m, scene.reference_m, range_m).value_or(half_way_round_m);
}

}  // namespace wedgescope
