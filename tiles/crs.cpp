#include "tiles/crs.hpp"

#include <cmath>
#include <mutex>
#include <numbers>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

struct Common {
    std::mutex mutex;
    ProjContext context;
    std::string reason;
};

Common& common() {
    static Common one;
    return one;
}

constexpr const char* one_line[] = {"MULTILINE=NO", nullptr};

bool is_wkt2(const std::string& definition) {
    const std::size_t bracket = definition.find('[');
    return bracket != std::string::npos && definition.substr(0, bracket).ends_with("CRS") &&
           definition.find('\n') == std::string::npos;
}

std::string words(const char* given) { return given ? given : ""; }

}  // namespace

std::string with_proj(const std::function<void(PJ_CONTEXT*)>& body) {
    Common& one = common();
    const std::lock_guard lock(one.mutex);
    if (!one.context) {
        one.context.reset(proj_context_create());
        proj_context_set_enable_network(one.context.get(), 0);
        proj_log_func(one.context.get(), &one, [](void* self, int level, const char* message) {
            if (level > PJ_LOG_ERROR) return;
            std::string& reason = static_cast<Common*>(self)->reason;
            if (reason.empty()) reason = message;
        });
    }
    one.reason.clear();
    body(one.context.get());
    return one.reason;
}

std::shared_ptr<const Crs> Crs::read(const std::string& definition, std::string& reason) {
    auto crs = std::make_shared<Crs>();
    bool good = false;
    reason = with_proj([&](PJ_CONTEXT* context) {
        // What PROJ would otherwise take for a step of computing.
        const bool step = definition.starts_with("+") && definition.find("type=crs") == std::string::npos;
        ProjObject object(proj_create(context, (step ? definition + " +type=crs" : definition).c_str()));
        const bool whole = object && proj_get_type(object.get()) != PJ_TYPE_COMPOUND_CRS;
        if (object && !whole) object.reset(proj_crs_get_sub_crs(context, object.get(), 0));
        if (!object || !proj_is_crs(object.get())) return;
        crs->bound_ = proj_get_type(object.get()) == PJ_TYPE_BOUND_CRS;
        const ProjObject source(crs->bound_ ? proj_get_source_crs(context, object.get()) : nullptr);
        const PJ* const plain = source ? source.get() : object.get();
        switch (proj_get_type(plain)) {
            case PJ_TYPE_GEOGRAPHIC_2D_CRS:
            case PJ_TYPE_GEOGRAPHIC_3D_CRS:
                crs->kind_ = Kind::geographic;
                break;
            case PJ_TYPE_PROJECTED_CRS:
                crs->kind_ = Kind::projected;
                break;
            case PJ_TYPE_GEOCENTRIC_CRS:
                crs->kind_ = Kind::geocentric;
                break;
            default:
                break;
        }
        const ProjObject axes(proj_crs_get_coordinate_system(context, plain));
        double unit = 1;
        struct Axis {
            std::string name, direction;
        };
        const auto axis = [&](int number) -> Axis {
            const char *name = nullptr, *direction = nullptr;
            if (!axes || !proj_cs_get_axis_info(context, axes.get(), number, &name, nullptr, &direction, &unit, nullptr,
                                                nullptr, nullptr))
                return {};
            return {words(name), words(direction)};
        };
        // Near a pole both point the same way, and names tell.
        const Axis second = axis(1), first = axis(0);
        crs->north_first_ = (first.direction == "north" && second.direction == "east") ||
                            (first.direction == second.direction && first.name == "Northing");
        crs->unit_ = crs->kind_ == Kind::geographic ? unit * 180 / std::numbers::pi : unit;
        crs->name_ = words(proj_get_name(plain));
        crs->authority_ = words(proj_get_id_auth_name(plain, 0));
        crs->code_ = words(proj_get_id_code(plain, 0));
        if (crs->authority_.empty() || crs->code_.empty())
            crs->proj_words_ = words(proj_as_proj_string(context, object.get(), PJ_PROJ_4, nullptr));
        // What is WKT 2 already stays as it is: writing it anew may lose a name.
        crs->wkt_ = whole && is_wkt2(definition) ? definition
                                                 : words(proj_as_wkt(context, object.get(), PJ_WKT2_2019, one_line));
        good = !crs->wkt_.empty();
    });
    if (good) return crs;
    if (reason.empty()) reason = "PROJ gives no reason";
    return nullptr;
}

const Crs& Crs::wgs84() {
    // In words: a raster of it needs no data base of PROJ's, which may be missing.
    static const std::shared_ptr<const Crs> one = [] {
        std::string reason;
        auto crs = read(
            "GEOGCRS[\"WGS 84\",DATUM[\"World Geodetic System 1984\",ELLIPSOID[\"WGS 84\",6378137,298.257223563,"
            "LENGTHUNIT[\"metre\",1]]],PRIMEM[\"Greenwich\",0,ANGLEUNIT[\"degree\",0.0174532925199433]],"
            "CS[ellipsoidal,2],AXIS[\"geodetic latitude "
            "(Lat)\",north,ORDER[1],ANGLEUNIT[\"degree\",0.0174532925199433]],"
            "AXIS[\"geodetic longitude (Lon)\",east,ORDER[2],ANGLEUNIT[\"degree\",0.0174532925199433]],"
            "ID[\"EPSG\",4326]]",
            reason);
        if (!crs) throw DataError(text("PROJ cannot read WGS84: ", reason));
        return crs;
    }();
    return *one;
}

std::string Crs::titled() const {
    if (authority_.empty() || code_.empty()) return name_;
    return text(name_, " (", authority_, ":", code_, ")");
}

std::string Crs::definition() const {
    if (!authority_.empty() && !code_.empty()) return text(authority_, ":", code_);
    if (proj_words_.empty()) return wkt_;
    std::string short_words = proj_words_;
    if (const auto at = short_words.find(" +type=crs"); at != std::string::npos) short_words.erase(at, 10);
    return short_words;
}

std::string Crs::wkt_of_old() const {
    const char* const with_axes[] = {"MULTILINE=NO", "OUTPUT_AXIS=YES", nullptr};
    std::string out;
    with_proj([&](PJ_CONTEXT* context) {
        const ProjObject own(proj_create(context, wkt_.c_str()));
        if (own) out = words(proj_as_wkt(context, own.get(), PJ_WKT1_GDAL, with_axes));
    });
    return out.empty() ? wkt_ : out;
}

bool Crs::same_as(const Crs& other) const {
    if (wkt_ == other.wkt_) return true;
    bool same = false;
    with_proj([&](PJ_CONTEXT* context) {
        const auto object = [context](const Crs& crs, bool bare) {
            ProjObject own(proj_create(context, crs.wkt_.c_str()));
            return own && bare ? ProjObject(proj_get_source_crs(context, own.get())) : std::move(own);
        };
        const bool unlike = bound_ != other.bound_;
        const ProjObject a = object(*this, unlike && bound_), b = object(other, unlike && other.bound_);
        same = a && b &&
               proj_is_equivalent_to_with_ctx(context, a.get(), b.get(),
                                              PJ_COMP_EQUIVALENT_EXCEPT_AXIS_ORDER_GEOGCRS) != 0;
    });
    return same;
}

}  // namespace wedgescope
