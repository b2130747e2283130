#include "tiles/crs.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <map>
#include <mutex>
#include <numbers>
#include <string_view>
#include <system_error>

#include "lib/error.hpp"
#include "lib/length.hpp"
#include "tiles/crs_by_rule.hpp"
#include "tiles/proj_handle.hpp"

namespace wedgescope {
namespace {

constexpr const char* on_one_line[] = {"MULTILINE=NO", nullptr};
constexpr const char* with_axes[] = {"MULTILINE=NO", "OUTPUT_AXIS=YES", nullptr};
constexpr int degree_code = 9102;

bool is_wkt2(const std::string& definition) {
    const std::size_t bracket = definition.find('[');
    return bracket != std::string::npos && definition.substr(0, bracket).ends_with("CRS") &&
           definition.find('\n') == std::string::npos;
}

std::string words(const char* given) { return given ? given : ""; }

int number(const char* code) {
    int value = 0;
    if (!code) return 0;
    const std::string_view digits(code);
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    return error == std::errc() && end == digits.data() + digits.size() ? value : 0;
}

bool is_epsg(const char* authority) {
    return authority && (std::string_view(authority) == "EPSG" || std::string_view(authority) == "epsg");
}

struct Axis {
    std::string name, direction, unit;
    double unit_size = 1;  ///< in radians or metres
};
/// None where there is no such axis.
Axis axis_of(PJ_CONTEXT* context, const PJ* crs, int axis) {
    const ProjObject axes(proj_crs_get_coordinate_system(context, crs));
    const char *name = nullptr, *direction = nullptr, *unit = nullptr;
    double size = 1;
    if (!axes || !proj_cs_get_axis_info(context, axes.get(), axis, &name, nullptr, &direction, &size, &unit, nullptr,
                                        nullptr))
        return {};
    return {words(name), words(direction), words(unit), size};
}
int axis_count(PJ_CONTEXT* context, const PJ* crs) {
    const ProjObject axes(proj_crs_get_coordinate_system(context, crs));
    return axes ? proj_cs_get_axis_count(context, axes.get()) : 0;
}

bool same(PJ_CONTEXT* context, const PJ* a, const PJ* b) {
    return a && b && proj_is_equivalent_to_with_ctx(context, a, b, PJ_COMP_EQUIVALENT_EXCEPT_AXIS_ORDER_GEOGCRS) != 0;
}

/// EPSG's code of a projected CRS's method; 0: it has none.
int method_of(PJ_CONTEXT* context, const PJ* operation) {
    const char *authority = nullptr, *code = nullptr;
    const bool found = operation && proj_coordoperation_get_method_info(context, operation, nullptr, &authority, &code);
    return found && is_epsg(authority) ? number(code) : 0;
}

// ---- as a GeoTIFF names it ----

/// EPSG's code of the unit of a CRS's first axis, if it is a usual one; 0 if not, or if the CRS has not two axes. A unit in a
/// WKT seldom comes with its code.
int unit_code_of(PJ_CONTEXT* context, const PJ* crs) {
    struct Unit {
        std::string_view name;
        double size;
        int code;
    };
    static constexpr Unit usual[] = {{"degree", std::numbers::pi / 180, degree_code},
                                     {"metre", 1, 9001},
                                     {"foot", foot_m, 9002},
                                     {"US survey foot", 1200.0 / 3937, 9003}};
    if (axis_count(context, crs) != 2) return 0;
    const Axis first = axis_of(context, crs, 0);
    for (const Unit& unit : usual)
        if (first.unit == unit.name && std::fabs(first.unit_size - unit.size) < 1e-10) return unit.code;
    return 0;
}

/// Is a projected CRS's method one that GDAL too names by the CRS's code alone? Others it keeps in a file beside.
bool is_usual_method(int method) {
    // Transverse Mercator and facing south; Lambert conformal conic with one parallel, two, Belgium's, and facing west;
    // Albers; Cassini-Soldner; polar stereographic A and B; oblique stereographic; oblique Mercator A and B; Lambert
    // azimuthal; Mercator A, B and the web's; polyconic; Krovak and facing north; New Zealand's grid.
    static constexpr int usual[] = {9807, 9808, 9801, 9802, 9803, 9826, 9822, 9806, 9810, 9829, 9809,
                                    9812, 9815, 9820, 9804, 9805, 1024, 9818, 9819, 1041, 9811};
    return std::find(std::begin(usual), std::end(usual), method) != std::end(usual);
}

std::optional<GeoTiffCrs> in_geotiff(PJ_CONTEXT* context, const PJ* crs) {
    if (!is_epsg(proj_get_id_auth_name(crs, 0))) return std::nullopt;
    GeoTiffCrs found;
    found.epsg = number(proj_get_id_code(crs, 0));
    // Above stands what GeoTIFF leaves to users.
    if (found.epsg < 1024 || found.epsg > 32766) return std::nullopt;
    const PJ_TYPE type = proj_get_type(crs);
    const ProjObject way(type == PJ_TYPE_GEOGRAPHIC_2D_CRS || type == PJ_TYPE_PROJECTED_CRS
                             ? proj_crs_get_coordoperation(context, crs)
                             : nullptr);
    // One derived from another comes with the way from there.
    found.geographic = type == PJ_TYPE_GEOGRAPHIC_2D_CRS && !way;
    if (!found.geographic && type != PJ_TYPE_PROJECTED_CRS) return std::nullopt;
    const ProjObject geodetic(proj_crs_get_geodetic_crs(context, crs));
    if (!geodetic || proj_get_type(geodetic.get()) != PJ_TYPE_GEOGRAPHIC_2D_CRS) return std::nullopt;
    const ProjObject ellipsoid(proj_get_ellipsoid(context, geodetic.get()));
    if (!ellipsoid || !proj_ellipsoid_get_parameters(context, ellipsoid.get(), &found.semi_major_m, nullptr, nullptr,
                                                     &found.inverse_flattening))
        return std::nullopt;
    found.geographic_name = words(proj_get_name(geodetic.get()));
    if (unit_code_of(context, geodetic.get()) != degree_code) return std::nullopt;
    if (found.geographic) return found;
    found.name = words(proj_get_name(crs));
    found.linear_unit = unit_code_of(context, crs);
    if (found.linear_unit == 0 || found.linear_unit == degree_code || !is_usual_method(method_of(context, way.get())))
        return std::nullopt;
    return found;
}

// ---- as a projection that GeographicLib computes ----

std::optional<TransverseMercator> mercator_of(PJ_CONTEXT* context, const PJ* crs, const PJ* wgs84) {
    constexpr int transverse_mercator = 9807;
    if (proj_get_type(crs) != PJ_TYPE_PROJECTED_CRS || axis_count(context, crs) != 2) return std::nullopt;
    const ProjObject way(proj_crs_get_coordoperation(context, crs));
    if (method_of(context, way.get()) != transverse_mercator) return std::nullopt;
    const Axis first = axis_of(context, crs, 0), second = axis_of(context, crs, 1);
    const auto faces = [&](const char* x, const char* y) { return first.direction == x && second.direction == y; };
    if (first.unit_size != 1 || second.unit_size != 1 || !(faces("east", "north") || faces("north", "east")))
        return std::nullopt;
    if (!same(context, ProjObject(proj_crs_get_geodetic_crs(context, crs)).get(), wgs84)) return std::nullopt;
    TransverseMercator found;
    struct Parameter {
        int code;
        double* value;
        std::string_view unit;
    };
    const Parameter wanted[] = {{8801, &found.latitude_deg, "degree"},
                                {8802, &found.longitude_deg, "degree"},
                                {8805, &found.scale, "unity"},
                                {8806, &found.easting_m, "metre"},
                                {8807, &found.northing_m, "metre"}};
    std::size_t count = 0;
    for (int i = 0; i < proj_coordoperation_get_param_count(context, way.get()); ++i) {
        const char *authority = nullptr, *code = nullptr, *unit = nullptr;
        double value = 0;
        if (!proj_coordoperation_get_param(context, way.get(), i, nullptr, &authority, &code, &value, nullptr, nullptr,
                                           &unit, nullptr, nullptr, nullptr))
            return std::nullopt;
        for (const Parameter& one : wanted)
            if (is_epsg(authority) && number(code) == one.code && words(unit) == one.unit) {
                *one.value = value;
                ++count;
            }
    }
    // What makes no projection PROJ says better.
    const bool usable = count == std::size(wanted) && found.scale > 0 && std::isfinite(found.scale) &&
                        std::fabs(found.latitude_deg) <= 90 && std::isfinite(found.longitude_deg) &&
                        std::isfinite(found.easting_m) && std::isfinite(found.northing_m);
    return usable ? std::optional(found) : std::nullopt;
}

// ---- what was read ----

struct Known {
    std::mutex mutex;
    std::map<std::string, std::shared_ptr<const Crs>> by_definition;
};
Known& known() {
    static Known& one = *new Known;  // as the common context of PROJ's, for whoever reads at the end
    return one;
}

CrsKind kind_of(const PJ* crs) {
    switch (proj_get_type(crs)) {
        case PJ_TYPE_GEOGRAPHIC_2D_CRS:
        case PJ_TYPE_GEOGRAPHIC_3D_CRS:
            return CrsKind::geographic;
        case PJ_TYPE_PROJECTED_CRS:
            return CrsKind::projected;
        case PJ_TYPE_GEOCENTRIC_CRS:
            return CrsKind::geocentric;
        default:
            return CrsKind::local;
    }
}

/// Nothing if it is no CRS that PROJ can write.
std::optional<CrsFacts> facts_of(PJ_CONTEXT* context, const std::string& definition) {
    // What PROJ would otherwise take for a step of computing.
    const bool step = definition.starts_with("+") && definition.find("type=crs") == std::string::npos;
    ProjObject object(proj_create(context, (step ? definition + " +type=crs" : definition).c_str()));
    const bool whole = object && proj_get_type(object.get()) != PJ_TYPE_COMPOUND_CRS;
    if (object && !whole) object.reset(proj_crs_get_sub_crs(context, object.get(), 0));
    if (!object || !proj_is_crs(object.get())) return std::nullopt;
    // What is WKT 2 already stays as it is: writing it anew may lose a name. All else is what the WKT says, which is all that
    // goes on from here: of an authority's code PROJ's data base knows more.
    if (!whole || !is_wkt2(definition)) {
        const std::string wkt = words(proj_as_wkt(context, object.get(), PJ_WKT2_2019, on_one_line));
        return is_wkt2(wkt) ? facts_of(context, wkt) : std::nullopt;
    }
    CrsFacts facts;
    facts.wkt = definition;
    facts.bound = proj_get_type(object.get()) == PJ_TYPE_BOUND_CRS;
    const ProjObject source(facts.bound ? proj_get_source_crs(context, object.get()) : nullptr);
    const PJ* const plain = source ? source.get() : object.get();
    facts.kind = kind_of(plain);
    // Near a pole both point the same way, and names tell.
    const Axis first = axis_of(context, plain, 0), second = axis_of(context, plain, 1);
    facts.north_first = (first.direction == "north" && second.direction == "east") ||
                        (first.direction == second.direction && first.name == "Northing");
    facts.unit = facts.kind == CrsKind::geographic ? first.unit_size * 180 / std::numbers::pi : first.unit_size;
    facts.name = words(proj_get_name(plain));
    facts.authority = words(proj_get_id_auth_name(plain, 0));
    facts.code = words(proj_get_id_code(plain, 0));
    if (facts.authority.empty() || facts.code.empty())
        facts.proj_words = words(proj_as_proj_string(context, object.get(), PJ_PROJ_4, nullptr));
    facts.wkt_of_old = words(proj_as_wkt(context, object.get(), PJ_WKT1_GDAL, with_axes));
    if (facts.wkt_of_old.empty()) facts.wkt_of_old = facts.wkt;
    facts.in_geotiff = in_geotiff(context, object.get());
    const ProjObject wgs84(proj_create(context, facts_by_rule(wgs84_code)->wkt.c_str()));
    facts.wgs84 = facts.kind == CrsKind::geographic && same(context, plain, wgs84.get());
    if (!facts.bound) facts.mercator = mercator_of(context, plain, wgs84.get());
    return facts;
}

}  // namespace

std::shared_ptr<const Crs> Crs::remember(CrsFacts facts) {
    const auto crs = std::make_shared<const Crs>(std::move(facts));
    const std::lock_guard lock(known().mutex);
    return known().by_definition.try_emplace(crs->wkt(), crs).first->second;
}

std::shared_ptr<const Crs> Crs::by_rule(int epsg) {
    auto facts = facts_by_rule(epsg);
    return facts ? remember(std::move(*facts)) : nullptr;
}

std::shared_ptr<const Crs> Crs::in_usual_words(std::shared_ptr<const Crs> crs) {
    if (!crs || !is_epsg(crs->authority().c_str())) return crs;
    auto facts = facts_by_rule(number(crs->code().c_str()));
    if (!facts) return crs;
    CrsFacts other = crs->facts();
    other.wkt = facts->wkt;
    return other == *facts ? remember(std::move(*facts)) : crs;
}

std::shared_ptr<const Crs> Crs::read(const std::string& definition, std::string& reason) {
    {
        const std::lock_guard lock(known().mutex);
        if (const auto found = known().by_definition.find(definition); found != known().by_definition.end()) {
            reason.clear();
            return found->second;
        }
    }
    std::optional<CrsFacts> facts;
    reason = with_proj([&](PJ_CONTEXT* context) { facts = facts_of(context, definition); });
    if (!facts) {
        if (reason.empty()) reason = "PROJ gives no reason";
        return nullptr;
    }
    reason.clear();
    const auto crs = std::make_shared<const Crs>(std::move(*facts));
    const std::lock_guard lock(known().mutex);
    return known().by_definition.try_emplace(definition, crs).first->second;
}

const Crs& Crs::wgs84() {
    static const std::shared_ptr<const Crs> one = by_rule(wgs84_code);
    return *one;
}

std::string Crs::titled() const {
    if (authority().empty() || code().empty()) return name();
    return text(name(), " (", authority(), ":", code(), ")");
}

std::string Crs::definition() const {
    if (!authority().empty() && !code().empty()) return text(authority(), ":", code());
    if (facts_.proj_words.empty()) return wkt();
    std::string short_words = facts_.proj_words;
    if (const auto at = short_words.find(" +type=crs"); at != std::string::npos) short_words.erase(at, 10);
    return short_words;
}

bool Crs::same_as(const Crs& other) const {
    if (wkt() == other.wkt()) return true;
    bool alike = false;
    with_proj([&](PJ_CONTEXT* context) {
        const auto object = [context](const Crs& crs, bool bare) {
            ProjObject own(proj_create(context, crs.wkt().c_str()));
            return own && bare ? ProjObject(proj_get_source_crs(context, own.get())) : std::move(own);
        };
        const bool unlike = bound() != other.bound();
        const ProjObject a = object(*this, unlike && bound()), b = object(other, unlike && other.bound());
        alike = same(context, a.get(), b.get());
    });
    return alike;
}

}  // namespace wedgescope
