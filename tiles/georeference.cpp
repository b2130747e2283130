#include "tiles/georeference.hpp"

#include <fmt/format.h>

#include <GeographicLib/Constants.hpp>
#include <GeographicLib/TransverseMercator.hpp>
#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <string>

#include "lib/error.hpp"
#include "tiles/proj_handle.hpp"

namespace wedgescope {

/// The way from WGS84 to a CRS and back.
class Georeference::Way {
public:
    Way() = default;
    virtual ~Way() = default;
    Way(const Way&) = delete;
    Way& operator=(const Way&) = delete;

    enum Direction { forward, inverse };
    /// The raster's coordinates of a longitude and latitude in degrees, or (inverse) the other way; false where there are none.
    virtual bool transform(Direction direction, double& x, double& y) = 0;
    /// What was said first of the last that failed.
    virtual std::string reason() = 0;
};

namespace {

constexpr const char* wgs84_in_proj = "EPSG:4326";

}  // namespace

/// Any CRS; used by one thread at a time. Asks PROJ itself: GDAL's transformation first writes both CRS in a format of old, for
/// which PROJ looks through the names of its data base: 10 to 15 ms of each process.
class Georeference::ByProj : public Georeference::Way {
public:
    explicit ByProj(const RasterFacts& facts) : context_(quiet_context(reason_)) {
        reason_ = with_proj([&](PJ_CONTEXT* common) {
            const ProjObject wgs84(proj_create(common, wgs84_in_proj)), raster = create(common, *facts.crs);
            if (!wgs84 || !raster) return;
            const ProjObject way(proj_create_crs_to_crs_from_pj(common, wgs84.get(), raster.get(), nullptr, nullptr));
            // Longitude and easting first, as in rasters, whatever the order of the CRS's axes.
            if (way) way_.reset(proj_normalize_for_visualization(common, way.get()));
            if (way_)
                if (ProjObject one = one_operation(common, way_.get(), facts)) way_ = std::move(one);
            // From here on it does not wait for others.
            if (way_) proj_assign_context(way_.get(), context_.get());
        });
    }

    bool transform(Direction direction, double& x, double& y) override {
        const std::lock_guard lock(mutex_);
        reason_.clear();
        if (!way_) return false;
        proj_errno_reset(way_.get());
        const PJ_COORD at =
            proj_trans(way_.get(), direction == forward ? PJ_FWD : PJ_INV, proj_coord(x, y, 0, HUGE_VAL));
        x = at.v[0];
        y = at.v[1];
        return std::isfinite(x) && std::isfinite(y);
    }

    bool known() const { return way_ != nullptr; }
    std::string reason() override {
        const std::lock_guard lock(mutex_);
        return reason_.empty() ? "PROJ gives no reason" : reason_;
    }

private:
    /// Between some datums PROJ has several operations, each for an area of its own, and takes another one point by point: a step
    /// of metres, in the middle of a raster, in ground that has none. For the whole raster then: that of its middle, or another
    /// that is in use at its edge, the first that works all over it and leaves no datum out; none where none does.
    static ProjObject one_operation(PJ_CONTEXT* context, PJ* all, const RasterFacts& facts) {
        const auto at = [&](int i, int j) {
            return proj_coord(facts.corner_x + 0.5 * i * (facts.edge_x() - facts.corner_x),
                              facts.corner_y + 0.5 * j * (facts.edge_y() - facts.corner_y), 0, HUGE_VAL);
        };
        constexpr int places[][2] = {{1, 1}, {0, 0}, {2, 0}, {0, 2}, {2, 2}, {1, 0}, {0, 1}, {2, 1}, {1, 2}};
        const auto works = [&](PJ* one) {
            return std::ranges::all_of(places, [&](const auto& place) {
                const PJ_COORD there = proj_trans(one, PJ_INV, at(place[0], place[1])),
                               back = proj_trans(one, PJ_FWD, there);
                return std::isfinite(there.v[0]) && std::isfinite(there.v[1]) && std::isfinite(back.v[0]) &&
                       std::isfinite(back.v[1]);
            });
        };
        for (const auto& place : places) {
            proj_trans(all, PJ_INV, at(place[0], place[1]));
            ProjObject one(proj_trans_get_last_used_operation(all));
            if (one && works(one.get()) && proj_coordoperation_has_ballpark_transformation(context, one.get()) == 0)
                return one;
        }
        return nullptr;
    }

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

/// Transverse Mercator of WGS84, for any number of threads at once: GeographicLib's series differs from PROJ's by some
/// nanometres and needs no data base, nor PROJ. Far from the meridian PROJ is asked.
class Georeference::ByMercator : public Georeference::Way {
public:
    explicit ByMercator(const RasterFacts& facts)
        : facts_(facts), of_(*facts.crs->mercator()),
          projection_(GeographicLib::Constants::WGS84_a(), GeographicLib::Constants::WGS84_f(), of_.scale) {
        double x = 0;
        projection_.Forward(0, of_.latitude_deg, 0, x, origin_y_);
    }

    bool transform(Direction direction, double& x, double& y) override {
        if (direction == forward) {
            const double aside = std::remainder(x - of_.longitude_deg, 360.0);
            if (!(std::fabs(aside) <= most_aside_deg && std::fabs(y) <= 90)) return by_proj().transform(direction, x, y);
            double easting = 0, northing = 0;
            projection_.Forward(0, y, aside, easting, northing);
            x = easting + of_.easting_m;
            y = northing - origin_y_ + of_.northing_m;
            return true;
        }
        const double easting = x - of_.easting_m, northing = y - of_.northing_m + origin_y_;
        if (!(std::fabs(easting) <= most_easting_m * of_.scale && std::fabs(northing) <= most_northing_m * of_.scale))
            return by_proj().transform(direction, x, y);
        projection_.Reverse(of_.longitude_deg, easting, northing, y, x);
        return true;
    }

    std::string reason() override { return by_proj().reason(); }

private:
    static constexpr double most_aside_deg = 20, most_easting_m = 1.5e6, most_northing_m = 9.9e6;

    ByProj& by_proj() {
        const std::lock_guard lock(mutex_);
        if (!by_proj_) by_proj_ = std::make_unique<ByProj>(facts_);
        return *by_proj_;
    }

    RasterFacts facts_;
    TransverseMercator of_;
    GeographicLib::TransverseMercator projection_;
    double origin_y_ = 0;
    std::mutex mutex_;
    std::unique_ptr<ByProj> by_proj_;
};

std::shared_ptr<Georeference::Way> Georeference::way_of(const RasterFacts& facts) {
    static std::mutex mutex;
    static std::map<std::string, std::weak_ptr<Way>> known;  // by WKT and bounds
    const std::lock_guard lock(mutex);
    std::erase_if(known, [](const auto& entry) { return entry.second.expired(); });
    const std::string bounds =
        fmt::format("{} {} {} {} ", facts.corner_x, facts.corner_y, facts.edge_x(), facts.edge_y());
    std::weak_ptr<Way>& place = known[bounds + facts.crs->wkt()];
    if (auto way = place.lock()) return way;
    if (facts.crs->mercator()) {
        const auto way = std::make_shared<ByMercator>(facts);
        place = way;
        return way;
    }
    const auto way = std::make_shared<ByProj>(facts);
    if (!way->known())
        throw DataError(text(facts.named(), ": PROJ knows no way between WGS84 and its CRS '", facts.crs->definition(),
                             "': ", way->reason()));
    place = way;
    return way;
}

Georeference::Georeference(const RasterFacts& facts) : facts_(facts) {
    if (!facts_.wgs84_lat_lon) way_ = way_of(facts_);
}

/// Of a cylindrical projection x is a straight function of longitude alone: it goes on where longitudes begin anew.
double Georeference::find_circle_x() const {
    if (facts_.geographic) return 360;
    if (!way_ || facts_.crs->mercator()) return 0;  // a transverse one, which need not wait for PROJ
    const auto x_of = [&](double lat_deg, double lon_deg) {
        double x = lon_deg, y = lat_deg;
        return way_->transform(Way::forward, x, y) ? x : std::numeric_limits<double>::quiet_NaN();
    };
    // Its own seam may lie in the first three.
    for (const double lon_deg : {20.0, 80.0}) {
        const double west = x_of(0, lon_deg), middle = x_of(0, lon_deg + 10), east = x_of(0, lon_deg + 20),
                     circle = 36 * (middle - west), tolerance = 1e-9 * std::abs(circle);
        const bool straight = std::abs(36 * (east - middle) - circle) <= 36 * tolerance;
        if (straight && circle != 0 && std::abs(x_of(50, lon_deg) - west) <= tolerance &&
            std::abs(x_of(50, lon_deg + 20) - east) <= tolerance)
            return std::abs(circle);
    }
    return 0;
}

double Georeference::circle_columns() {
    std::call_once(seen_round_, [this] { circle_x_ = find_circle_x(); });
    return circle_x_ / facts_.step_x;
}

IndexPosition Georeference::locate(double lat_deg, double lon_deg) {
    double x = lon_deg, y = lat_deg;
    if (way_ && !way_->transform(Way::forward, x, y))
        throw DataError(text(facts_.named(), ": PROJ finds no place for latitude ", lat_deg, ", longitude ", lon_deg,
                             " in its CRS '", facts_.crs->definition(), "': ", way_->reason()));
    IndexPosition at{(x - facts_.corner_x) / facts_.step_x - 0.5, (y - facts_.corner_y) / facts_.step_y - 0.5};
    if (const double circle = circle_columns(); circle > 0) {
        const double middle = 0.5 * static_cast<double>(facts_.columns - 1);
        at.column -= circle * std::round((at.column - middle) / circle);
    }
    return at;
}

std::optional<std::pair<double, double>> Georeference::lat_lon(double column, double row) {
    double x = facts_.corner_x + (column + 0.5) * facts_.step_x;
    double y = facts_.corner_y + (row + 0.5) * facts_.step_y;
    if (way_ && !way_->transform(Way::inverse, x, y)) return std::nullopt;
    if (!(std::fabs(y) <= 90) || !std::isfinite(x)) return std::nullopt;
    return std::pair(y, std::fabs(x) <= 180 ? x : std::remainder(x, 360.0));
}

DataBase describe(const RasterFacts& facts) {
    DataBase d;
    d.name = facts.path;
    d.columns = facts.columns;
    d.rows = facts.rows;
    d.block_columns = facts.unit_columns();
    d.block_rows = facts.unit_rows();
    d.post_bytes = facts.type_bytes;
    d.origin_x = facts.corner_x + 0.5 * facts.step_x;
    d.origin_y = facts.corner_y + 0.5 * facts.step_y;
    d.step_x = facts.step_x;
    d.step_y = facts.step_y;
    d.has_crs = facts.crs != nullptr;
    d.has_geotransform = facts.has_geotransform;
    d.crs_in_metres = !facts.geographic;
    d.metres_per_unit = facts.metres_per_unit;
    d.metres_per_height = facts.unit_m;
    if (!facts.crs) return d;
    d.crs_wkt = facts.crs->wkt();
    d.cycle_columns = facts.cycle_columns();
    d.cyclic = d.cycle_columns > 0;
    const auto where = std::make_shared<Georeference>(facts);
    d.locate = [where](double lat_deg, double lon_deg) { return where->locate(lat_deg, lon_deg); };
    d.circle_columns = [where] { return where->circle_columns(); };
    d.lat_lon = [where](double column, double row) { return where->lat_lon(column, row); };
    return d;
}

}  // namespace wedgescope
