// Crs: a coordinate reference system as PROJ knows it, and the one PROJ context that whatever reads or compares them
// uses in turn: each of its own would open PROJ's data base again, 8 ms.
// For the .cpp files of this folder only. Leaves turning coordinates to georeference.hpp.
#pragma once
#include <proj.h>

#include <functional>
#include <memory>
#include <string>

namespace wedgescope {

struct DestroyProj {
    void operator()(PJ* object) const noexcept { proj_destroy(object); }
    void operator()(PJ_CONTEXT* context) const noexcept { proj_context_destroy(context); }
};
using ProjObject = std::unique_ptr<PJ, DestroyProj>;
using ProjContext = std::unique_ptr<PJ_CONTEXT, DestroyProj>;

/// Calls `body` with the common context, the network off, while no other thread has it; returns what PROJ complained of
/// first, empty if of nothing. Not to be called from within `body`.
std::string with_proj(const std::function<void(PJ_CONTEXT*)>& body);

/// Never changes, so that threads may share it.
class Crs {
public:
    enum class Kind { geographic, projected, geocentric, local };

    /// Its horizontal part, from WKT, "EPSG:32611" or anything else that PROJ reads. Null if that is no CRS, with the reason.
    static std::shared_ptr<const Crs> read(const std::string& definition, std::string& reason);
    /// WGS84 latitude and longitude.
    static const Crs& wgs84();

    Kind kind() const { return kind_; }
    /// Degrees (geographic) or metres in one unit of the first axis.
    double unit() const { return unit_; }
    const std::string& name() const { return name_; }
    /// "EPSG" and "32611"; empty: nobody's.
    const std::string& authority() const { return authority_; }
    const std::string& code() const { return code_; }
    /// The name with "(EPSG:32611)" behind it where it has a code.
    std::string titled() const;
    /// Best short definition: "EPSG:32611", else a PROJ string, else WKT.
    std::string definition() const;
    /// WKT 2 of 2019, in one line.
    const std::string& wkt() const { return wkt_; }
    /// WKT 1 as GDAL writes it, for readers of old; WKT 2 where that cannot say it.
    std::string wkt_of_old() const;
    /// Which of its axes x and y are, as GDAL counts them: "1,2", or "2,1" where latitude or northing comes first.
    const char* axis_mapping() const { return north_first_ ? "2,1" : "1,2"; }
    /// With a shift to WGS84 of its own.
    bool bound() const { return bound_; }
    /// But for names, for which of latitude and longitude comes first, and for a shift to WGS84 that one of them alone has.
    bool same_as(const Crs& other) const;

private:
    Kind kind_ = Kind::local;
    double unit_ = 1;
    bool bound_ = false, north_first_ = false;
    std::string name_, authority_, code_, proj_words_, wkt_;
};

}  // namespace wedgescope
