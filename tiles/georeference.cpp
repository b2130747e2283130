#include "tiles/georeference.hpp"

#include <cmath>
#include <map>
#include <mutex>
#include <string>

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

/// Both ways, used by one thread at a time.
struct Georeference::Ways {
    std::mutex mutex;
    std::unique_ptr<OGRCoordinateTransformation> to_raster, to_wgs84;
};

std::shared_ptr<Georeference::Ways> Georeference::ways_of(const RasterFacts& facts) {
    static std::mutex mutex;
    static std::map<std::string, std::weak_ptr<Ways>> known;  // by WKT
    const std::lock_guard lock(mutex);
    std::erase_if(known, [](const auto& entry) { return entry.second.expired(); });
    std::weak_ptr<Ways>& place = known[crs_wkt(*facts.crs)];
    if (auto ways = place.lock()) return ways;
    const auto ways = std::make_shared<Ways>();
    GdalErrors errors;
    const OGRSpatialReference wgs84 = wgs84_lon_lat();
    ways->to_raster.reset(OGRCreateCoordinateTransformation(&wgs84, facts.crs.get()));
    ways->to_wgs84.reset(OGRCreateCoordinateTransformation(facts.crs.get(), &wgs84));
    if (!ways->to_raster || !ways->to_wgs84)
        throw DataError(text(facts.named(), ": PROJ knows no way between WGS84 and its CRS '",
                             crs_definition(*facts.crs), "': ", errors.reason()));
    place = ways;
    return ways;
}

Georeference::Georeference(const RasterFacts& facts) : facts_(facts) {
    if (!facts_.wgs84_lat_lon) ways_ = ways_of(facts_);
}

IndexPosition Georeference::locate(double lat_deg, double lon_deg) {
    double x = lon_deg, y = lat_deg;
    if (ways_) {
        const std::lock_guard lock(ways_->mutex);
        GdalErrors errors;
        if (!transform(*ways_->to_raster, x, y))
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
    if (ways_) {
        const std::lock_guard lock(ways_->mutex);
        GdalErrors quiet;
        if (!transform(*ways_->to_wgs84, x, y)) return std::nullopt;
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
