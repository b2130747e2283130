#include "tiles/georeference.hpp"

#include <cmath>

#include "lib/error.hpp"
#include "tiles/gdal_handle.hpp"

namespace wedgescope {
namespace {

bool transform(OGRCoordinateTransformation& way, double& x, double& y) {
    int good = 0;
    way.Transform(1, &x, &y, nullptr, &good);
    return good && std::isfinite(x) && std::isfinite(y);
}

}  // namespace

Georeference::Georeference(const RasterFacts& facts) : facts_(facts) {
    if (facts_.wgs84_lat_lon) return;
    GdalErrors errors;
    const OGRSpatialReference wgs84 = wgs84_lon_lat();
    to_raster_.reset(OGRCreateCoordinateTransformation(&wgs84, facts_.crs.get()));
    to_wgs84_.reset(OGRCreateCoordinateTransformation(facts_.crs.get(), &wgs84));
    if (!to_raster_ || !to_wgs84_)
        throw DataError(text(facts_.named(), ": PROJ knows no way between WGS84 and its CRS '",
                             crs_definition(*facts_.crs), "': ", errors.reason()));
}

IndexPosition Georeference::locate(double lat_deg, double lon_deg) {
    double x = lon_deg, y = lat_deg;
    if (to_raster_) {
        const std::lock_guard lock(mutex_);
        GdalErrors errors;
        if (!transform(*to_raster_, x, y))
            throw DataError(text(facts_.named(), ": PROJ finds no place for latitude ", lat_deg, ", longitude ",
                                 lon_deg, " in its CRS '", crs_definition(*facts_.crs), "': ", errors.reason()));
    }
    IndexPosition at{(x - facts_.corner_x) / facts_.step_x - 0.5, (y - facts_.corner_y) / facts_.step_y - 0.5};
    if (facts_.geographic) {
        const double circle = 360 / facts_.step_x;
        const double middle = 0.5 * static_cast<double>(facts_.columns - 1);
        at.column -= circle * std::round((at.column - middle) / circle);
    }
    return at;
}

std::optional<std::pair<double, double>> Georeference::lat_lon(double column, double row) {
    double x = facts_.corner_x + (column + 0.5) * facts_.step_x;
    double y = facts_.corner_y + (row + 0.5) * facts_.step_y;
    if (to_wgs84_) {
        const std::lock_guard lock(mutex_);
        GdalErrors quiet;
        if (!transform(*to_wgs84_, x, y)) return std::nullopt;
    }
    if (!(std::fabs(y) <= 90) || !std::isfinite(x)) return std::nullopt;
    return std::pair(y, std::fabs(x) <= 180 ? x : std::remainder(x, 360.0));
}

DataBase describe(const RasterFacts& facts) {
    DataBase d;
    d.name = facts.path;
    d.columns = facts.columns;
    d.rows = facts.rows;
    d.block_columns = facts.block_columns;
    d.block_rows = facts.block_rows;
    d.post_bytes = facts.type_bytes;
    d.origin_x = facts.corner_x + 0.5 * facts.step_x;
    d.origin_y = facts.corner_y + 0.5 * facts.step_y;
    d.step_x = facts.step_x;
    d.step_y = facts.step_y;
    d.has_crs = facts.crs != nullptr;
    d.has_geotransform = facts.has_geotransform;
    d.crs_in_metres = !facts.geographic;
    d.metres_per_unit = facts.metres_per_unit;
    if (!facts.crs) return d;
    d.crs_wkt = crs_wkt(*facts.crs);
    d.cycle_columns = facts.cycle_columns();
    d.cyclic = d.cycle_columns > 0;
    const auto where = std::make_shared<Georeference>(facts);
    d.locate = [where](double lat_deg, double lon_deg) { return where->locate(lat_deg, lon_deg); };
    d.lat_lon = [where](double column, double row) { return where->lat_lon(column, row); };
    return d;
}

}  // namespace wedgescope
