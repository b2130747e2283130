#include "tiles/point_file.hpp"

#include <cpl_string.h>
#include <sys/stat.h>

#include <cerrno>
#include <cmath>

#include "lib/error.hpp"
#include "tiles/raster_layer.hpp"
#include "tiles/vector_file.hpp"

namespace wedgescope {
namespace {

std::optional<std::string> value_of(OGRFeature& feature, int field) {
    std::string words = field_text(feature, field);
    if (words.empty()) return std::nullopt;
    return words;
}

}  // namespace

struct PointFile::Open {
    std::string role, path;
    DatasetHandle dataset;
    OGRLayer* layer = nullptr;
    std::vector<int> fields;  ///< by their place in the layer
    bool lat_lon = false;
    std::unique_ptr<OGRCoordinateTransformation> to_wgs84;  ///< none: as they are
    std::string named() const { return text(role, " ", in_quotes(path)); }
};

PointFile::PointFile(const PointFileParams& params, const DataBase& data_base) : open_(new Open) {
    Open& o = *open_;
    o.role = params.role;
    o.path = params.path;
    GdalErrors errors;
    o.dataset = open_vector(o.path, false);
    if (!o.dataset) {
        struct stat facts {};
        // GDAL may say nothing at all of a path that is not there.
        if (!errors.failed() && !errors.warned() && ::stat(o.path.c_str(), &facts) != 0)
            throw IoError(text(o.named(), " cannot be opened: ", system_reason(errno)));
        throw IoError(text(o.named(), " cannot be opened as points: ", errors.reason(),
                           " (accepted: a vector file that GDAL reads, as GeoPackage, GeoJSON or a shapefile, or a "
                           "table of places whose name ends in .csv)"));
    }
    std::string names;
    for (int i = 0; i < o.dataset->GetLayerCount(); ++i)
        names += text(names.empty() ? "" : ", ", o.dataset->GetLayer(i)->GetName());
    if (params.layer.empty()) {
        if (o.dataset->GetLayerCount() == 0) throw InputError(text(o.named(), " holds no layer of points"));
        if (o.dataset->GetLayerCount() > 1)
            throw InputError(
                text(o.named(), " has ", o.dataset->GetLayerCount(), " layers (", names, "); give ", o.role, "-layer"));
        o.layer = o.dataset->GetLayer(0);
    } else {
        o.layer = o.dataset->GetLayerByName(params.layer.c_str());
        if (!o.layer)
            throw InputError(
                text(o.role, "-layer is ", in_quotes(params.layer), "; ", in_quotes(o.path), " has ", names));
    }
    OGRFeatureDefn& definition = *o.layer->GetLayerDefn();
    if (definition.GetGeomFieldCount() == 0)
        throw InputError(
            text(o.named(), " has no geometry; accepted: points (or a table of places: a file that ends in .csv)"));

    RasterFacts facts;
    facts.role = o.role;
    facts.path = o.path;
    facts.has_geotransform = true;
    set_crs(facts, crs_of(*o.layer));
    if (!facts.crs) return;
    if (!data_base.has_crs)
        throw DataError(text(o.named(), " is in CRS ", in_quotes(facts.crs->definition()), ", and '", data_base.name,
                             "' has none; accepted: points without a CRS, in the raster's own coordinates"));
    o.lat_lon = true;
    if (facts.wgs84_lat_lon) return;
    std::string reason;
    const auto terrain = Crs::read(data_base.crs_wkt, reason);
    if (terrain && facts.crs->same_as(*terrain)) {
        o.lat_lon = false;
        return;
    }
    const OGRSpatialReference own = in_gdal(*facts.crs), wgs84 = in_gdal(Crs::wgs84());
    o.to_wgs84.reset(OGRCreateCoordinateTransformation(&own, &wgs84));
    if (!o.to_wgs84)
        throw DataError(text(o.named(), ": PROJ knows no way from its CRS ", in_quotes(facts.crs->definition()),
                             " to WGS84: ", errors.reason()));
}

PointFile::~PointFile() = default;

bool PointFile::lat_lon() const { return open_->lat_lon; }

std::vector<std::string> PointFile::field_names() const {
    std::vector<std::string> names;
    const OGRFeatureDefn& fields = *open_->layer->GetLayerDefn();
    for (int i = 0; i < fields.GetFieldCount(); ++i) names.emplace_back(fields.GetFieldDefn(i)->GetNameRef());
    return names;
}

void PointFile::choose(std::vector<int> fields) { open_->fields = std::move(fields); }

void PointFile::read(const std::function<void(const PointRow&)>& body) {
    Open& o = *open_;
    GdalErrors errors;
    PointRow row;
    const auto refuse = [&](const std::string& what) {
        throw DataError(text(o.named(), ", feature ", row.feature, " ", what));
    };
    const auto point = [&](const OGRPoint& p) {
        double x = p.getX(), y = p.getY();
        if (!std::isfinite(x) || !std::isfinite(y)) refuse(text("is at ", x, ", ", y, "; accepted: finite places"));
        if (o.to_wgs84) {
            const double x0 = x, y0 = y;
            int good = 0;
            o.to_wgs84->Transform(1, &x, &y, nullptr, &good);
            if (!good || !std::isfinite(x) || !std::isfinite(y))
                refuse(text("is at ", x0, ", ", y0, ", which PROJ cannot turn into latitude and longitude"));
        }
        if (o.lat_lon && !(std::fabs(y) <= 90 && std::fabs(x) <= 360))
            refuse(text("is at longitude ", x, ", latitude ", y,
                        "; accepted: longitude from -360 to 360, latitude from -90 to 90"));
        row.first = o.lat_lon ? y : x;
        row.second = o.lat_lon ? x : y;
        body(row);
    };
    for_each_feature(*o.layer, [&](OGRFeature& feature) {
        row.feature = feature.GetFID();
        row.values.clear();
        for (const int field : o.fields) row.values.push_back(value_of(feature, field));
        const OGRGeometry* geometry = feature.GetGeometryRef();
        if (!geometry) refuse("has no geometry; accepted: a point");
        const OGRwkbGeometryType type = wkbFlatten(geometry->getGeometryType());
        if (type != wkbPoint && type != wkbMultiPoint)
            refuse(text("is a ", OGRGeometryTypeToName(type), "; accepted: a point"));
        if (geometry->IsEmpty()) refuse("is an empty point; accepted: one that has a place");
        if (type == wkbPoint) {
            point(*geometry->toPoint());
        } else {
            for (const OGRPoint* part : *geometry->toMultiPoint()) {
                if (part->IsEmpty()) refuse("has an empty point; accepted: points that have a place");
                point(*part);
            }
        }
    });
    if (errors.failed()) throw IoError(text(o.named(), " cannot be read: ", errors.reason()));
}

}  // namespace wedgescope
