#include "tiles/crs_by_rule.hpp"

#include <string>
#include <utility>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

constexpr const char *degree = R"(ANGLEUNIT["degree",0.0174532925199433])", *metre = R"(LENGTHUNIT["metre",1])";

std::string axis(const char* name, const char* direction, int order, const char* unit) {
    return text("AXIS[\"", name, "\",", direction, ",ORDER[", order, "],", unit, "],");
}

/// The datum and what its angles are counted from.
std::string wgs84_datum() {
    return text(R"("WGS 84",DATUM["World Geodetic System 1984",ELLIPSOID["WGS 84",6378137,298.257223563,)", metre,
                R"(]],PRIMEM["Greenwich",0,)", degree, ']');
}
/// The same in WKT 1.
constexpr const char* wgs84_of_old =
    R"(GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],)"
    R"(UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]])";

CrsFacts wgs84() {
    CrsFacts facts;
    facts.kind = CrsKind::geographic;
    facts.north_first = facts.wgs84 = true;
    facts.name = "WGS 84";
    facts.wkt = "GEOGCRS[" + wgs84_datum() + ",CS[ellipsoidal,2]," + axis("geodetic latitude (Lat)", "north", 1, degree) +
                axis("geodetic longitude (Lon)", "east", 2, degree) + text("ID[\"EPSG\",", wgs84_code, "]]");
    facts.wkt_of_old = text(wgs84_of_old, R"(,AXIS["Latitude",NORTH],AXIS["Longitude",EAST],AUTHORITY["EPSG",")",
                            wgs84_code, "\"]]");
    return facts;
}

CrsFacts utm(int epsg, int zone, bool south) {
    TransverseMercator mercator;
    mercator.longitude_deg = 6 * zone - 183;
    mercator.scale = 0.9996;
    mercator.easting_m = 500000;
    mercator.northing_m = south ? 10000000 : 0;
    const std::string meridian = text(6 * zone - 183), northing = south ? "10000000" : "0",
                      named = text("UTM zone ", zone, south ? 'S' : 'N');
    const auto parameter = [](const char* name, const std::string& value, const std::string& unit, int code) {
        return text(",PARAMETER[\"", name, "\",", value, ',', unit, ",ID[\"EPSG\",", code, "]]");
    };
    CrsFacts facts;
    facts.kind = CrsKind::projected;
    facts.name = "WGS 84 / " + named;
    facts.wkt = text("PROJCRS[\"", facts.name, "\",BASEGEOGCRS[", wgs84_datum(), ",ID[\"EPSG\",", wgs84_code,
                     "]],CONVERSION[\"", named, R"(",METHOD["Transverse Mercator",ID["EPSG",9807]])") +
                parameter("Latitude of natural origin", "0", degree, 8801) +
                parameter("Longitude of natural origin", meridian, degree, 8802) +
                parameter("Scale factor at natural origin", "0.9996", R"(SCALEUNIT["unity",1])", 8805) +
                parameter("False easting", "500000", metre, 8806) + parameter("False northing", northing, metre, 8807) +
                "],CS[Cartesian,2]," + axis("(E)", "east", 1, metre) + axis("(N)", "north", 2, metre) +
                text("ID[\"EPSG\",", epsg, "]]");
    facts.wkt_of_old = text(
        "PROJCS[\"", facts.name, "\",", wgs84_of_old, R"(,AUTHORITY["EPSG",")", wgs84_code,
        R"("]],PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",)",
        meridian,
        R"(],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",)", northing,
        R"(],UNIT["metre",1],AXIS["Easting",EAST],AXIS["Northing",NORTH],AUTHORITY["EPSG",")", epsg, "\"]]");
    facts.mercator = mercator;
    return facts;
}

}  // namespace

std::optional<CrsFacts> facts_by_rule(int epsg) {
    constexpr int north = 32600, south = 32700, zones = 60, metres = 9001;
    const auto is_zone = [&](int base) { return epsg > base && epsg <= base + zones; };
    if (epsg != wgs84_code && !is_zone(north) && !is_zone(south)) return std::nullopt;
    CrsFacts facts = epsg == wgs84_code ? wgs84()
                     : is_zone(north)   ? utm(epsg, epsg - north, false)
                                        : utm(epsg, epsg - south, true);
    const bool geographic = epsg == wgs84_code;
    facts.authority = "EPSG";
    facts.code = text(epsg);
    facts.in_geotiff = GeoTiffCrs{
        epsg, geographic, geographic ? "" : facts.name, "WGS 84", geographic ? 0 : metres, 6378137, 298.257223563};
    return facts;
}

}  // namespace wedgescope
