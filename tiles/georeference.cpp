#include "tiles/georeference.hpp"

#include <proj.h>

#include <cmath>
#include <map>
#include <mutex>
#include <string>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

constexpr const char* wgs84_in_proj = "EPSG:4326";

}  // namespace

/// The way from WGS84 to a CRS and back, used by one thread at a time. Asks PROJ itself: GDAL's transformation first writes
/// both CRS in a format of old, for which PROJ looks through the names of its data base: 10 to 15 ms of each process.
class Georeference::Way {
public:
    explicit Way(const Crs& crs) : context_(proj_context_create()) {
        reason_ = with_proj([&](PJ_CONTEXT* common) {
            const ProjObject wgs84(proj_create(common, wgs84_in_proj)), raster = create(common, crs);
            if (!wgs84 || !raster) return;
            const ProjObject way(proj_create_crs_to_crs_from_pj(common, wgs84.get(), raster.get(), nullptr, nullptr));
            // Longitude and easting first, as in rasters, whatever the order of the CRS's axes.
            if (way) way_.reset(proj_normalize_for_visualization(common, way.get()));
            // From here on it does not wait for others.
            if (way_) proj_assign_context(way_.get(), context_.get());
        });
        proj_log_func(context_.get(), this, [](void* self, int level, const char* message) {
            if (level > PJ_LOG_ERROR) return;
            std::string& reason = static_cast<Way*>(self)->reason_;
            if (reason.empty()) reason = message;
        });
        proj_context_set_enable_network(context_.get(), 0);
    }

    /// The raster's coordinates of a longitude and latitude in degrees, or (PJ_INV) the other way; false where there are
    /// none.
    bool transform(PJ_DIRECTION direction, double& x, double& y) {
        const std::lock_guard lock(mutex_);
        reason_.clear();
        if (!way_) return false;
        proj_errno_reset(way_.get());
        const PJ_COORD at = proj_trans(way_.get(), direction, proj_coord(x, y, 0, HUGE_VAL));
        x = at.v[0];
        y = at.v[1];
        return std::isfinite(x) && std::isfinite(y);
    }

    bool known() const { return way_ != nullptr; }
    std::string reason() {
        const std::lock_guard lock(mutex_);
        return reason_.empty() ? "PROJ gives no reason" : reason_;
    }

private:
    static ProjObject create(PJ_CONTEXT* context, const Crs& crs) {
        ProjObject own(proj_create(context, crs.wkt().c_str()));
        if (!own || crs.authority().empty() || crs.code().empty()) return own;
        // An older format has lost where the CRS is in use, which decides between shifts of its datum, or comes with a shift
        // of its own: then as its authority defines it, if that is the same but for the shift. So GDAL does.
        const ProjObject bare(crs.bound() ? proj_get_source_crs(context, own.get()) : nullptr);
        const PJ* const plain = bare ? bare.get() : own.get();
        double west, south, east, north;
        if (!crs.bound() && proj_get_area_of_use(context, plain, &west, &south, &east, &north, nullptr)) return own;
        ProjObject official(proj_create(context, text(crs.authority(), ":", crs.code()).c_str()));
        const bool same =
            official && proj_is_equivalent_to_with_ctx(context, official.get(), plain, PJ_COMP_EQUIVALENT) != 0;
        return same ? std::move(official) : std::move(own);
    }

    std::mutex mutex_;
    std::string reason_;  ///< what PROJ said first of the last that failed
    ProjContext context_;
    ProjObject way_;
};

std::shared_ptr<Georeference::Way> Georeference::way_of(const RasterFacts& facts) {
    static std::mutex mutex;
    static std::map<std::string, std::weak_ptr<Way>> known;  // by WKT
    const std::lock_guard lock(mutex);
    std::erase_if(known, [](const auto& entry) { return entry.second.expired(); });
    std::weak_ptr<Way>& place = known[facts.crs->wkt()];
    if (auto way = place.lock()) return way;
    const auto way = std::make_shared<Way>(*facts.crs);
    if (!way->known())
        throw DataError(text(facts.named(), ": PROJ knows no way between WGS84 and its CRS '", facts.crs->definition(),
                             "': ", way->reason()));
    place = way;
    return way;
}

Georeference::Georeference(const RasterFacts& facts) : facts_(facts) {
    if (!facts_.wgs84_lat_lon) way_ = way_of(facts_);
}

IndexPosition Georeference::locate(double lat_deg, double lon_deg) {
    double x = lon_deg, y = lat_deg;
    if (way_ && !way_->transform(PJ_FWD, x, y))
        throw DataError(text(facts_.named(), ": PROJ finds no place for latitude ", lat_deg, ", longitude ", lon_deg,
                             " in its CRS '", facts_.crs->definition(), "': ", way_->reason()));
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
    if (way_ && !way_->transform(PJ_INV, x, y)) return std::nullopt;
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
    d.crs_wkt = facts.crs->wkt();
    d.cycle_columns = facts.cycle_columns();
    d.cyclic = d.cycle_columns > 0;
    const auto where = std::make_shared<Georeference>(facts);
    d.locate = [where](double lat_deg, double lon_deg) { return where->locate(lat_deg, lon_deg); };
    d.lat_lon = [where](double column, double row) { return where->lat_lon(column, row); };
    return d;
}

}  // namespace wedgescope
