// Crs: a coordinate reference system, as PROJ knows it. All that a run over a store needs of one is found when it is read and
// kept in the store's manifest, so that PROJ, its data base and the libraries that come with it are not even loaded then.
// For the .cpp files of this folder only. Leaves turning coordinates to georeference.hpp.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace wedgescope {

/// Transverse Mercator of WGS84, easting and northing in metres.
struct TransverseMercator {
    double latitude_deg = 0, longitude_deg = 0;  ///< of the origin
    double scale = 1;                            ///< on its meridian
    double easting_m = 0, northing_m = 0;        ///< of the origin
    bool operator==(const TransverseMercator&) const = default;
};

/// How a GeoTIFF names a CRS of the EPSG's in degrees.
struct GeoTiffCrs {
    int epsg = 0;
    bool geographic = false;      ///< else projected
    std::string name;             ///< of a projected one
    std::string geographic_name;  ///< of itself, or of what it projects
    int linear_unit = 0;          ///< of a projected one, EPSG's code: 9001 metre, ...; angles are degrees
    double semi_major_m = 0, inverse_flattening = 0;
    bool operator==(const GeoTiffCrs&) const = default;
};

enum class CrsKind { geographic, projected, geocentric, local };

/// What PROJ answered once.
struct CrsFacts {
    /// Of what is asked and how it is answered: whoever keeps facts asks again where it has changed.
    static constexpr int revision = 1;
    CrsKind kind = CrsKind::local;
    double unit = 1;           ///< degrees (geographic) or metres in one unit of the first axis
    bool bound = false;        ///< with a shift to WGS84 of its own
    bool north_first = false;  ///< latitude or northing is the first of its axes
    bool wgs84 = false;        ///< latitude and longitude, in either order, of WGS84 itself
    std::string name;
    std::string authority, code;  ///< "EPSG" and "32611"; empty: nobody's
    std::string proj_words;       ///< a PROJ string, of what is nobody's
    std::string wkt;              ///< WKT 2 of 2019, in one line
    std::string wkt_of_old;       ///< WKT 1 as GDAL writes it, for readers of old; WKT 2 where that cannot say it
    std::optional<TransverseMercator> mercator;  ///< if it is that
    /// Nothing where EPSG's code alone does not tell all: a CRS of one's own, one with a shift, a height or unusual units. The
    /// code is taken at its word, as GDAL takes it.
    std::optional<GeoTiffCrs> in_geotiff;
    bool operator==(const CrsFacts&) const = default;
};

/// Never changes, so that threads may share it.
class Crs {
public:
    using Kind = CrsKind;

    explicit Crs(CrsFacts facts) : facts_(std::move(facts)) {}
    /// Its horizontal part, from WKT, "EPSG:32611" or anything else that PROJ reads. Null if that is no CRS, with the reason.
    /// PROJ is asked once for each definition, and not for one whose facts were remembered.
    static std::shared_ptr<const Crs> read(const std::string& definition, std::string& reason);
    /// Whatever reads `facts.wkt` from here on finds these, or what was known of it already.
    static std::shared_ptr<const Crs> remember(CrsFacts facts);
    /// Of EPSG's code, where facts_by_rule() tells all without PROJ; else null.
    static std::shared_ptr<const Crs> by_rule(int epsg);
    /// The one by rule, where `crs` differs from it in no more than what its WKT says beside; else `crs`. So the same CRS has the
    /// same words, whoever read it.
    static std::shared_ptr<const Crs> in_usual_words(std::shared_ptr<const Crs> crs);
    /// WGS84 latitude and longitude.
    static const Crs& wgs84();

    const CrsFacts& facts() const { return facts_; }
    Kind kind() const { return facts_.kind; }
    double unit() const { return facts_.unit; }
    bool is_wgs84() const { return facts_.wgs84; }
    bool bound() const { return facts_.bound; }
    const std::string& name() const { return facts_.name; }
    const std::string& authority() const { return facts_.authority; }
    const std::string& code() const { return facts_.code; }
    const std::string& wkt() const { return facts_.wkt; }
    const std::string& wkt_of_old() const { return facts_.wkt_of_old; }
    const std::optional<TransverseMercator>& mercator() const { return facts_.mercator; }
    const std::optional<GeoTiffCrs>& in_geotiff() const { return facts_.in_geotiff; }
    /// The name with "(EPSG:32611)" behind it where it has a code.
    std::string titled() const;
    /// Best short definition: "EPSG:32611", else a PROJ string, else WKT.
    std::string definition() const;
    /// Which of its axes x and y are, as GDAL counts them: "1,2", or "2,1" where latitude or northing comes first.
    const char* axis_mapping() const { return facts_.north_first ? "2,1" : "1,2"; }
    /// But for names, for which of latitude and longitude comes first, and for a shift to WGS84 that one of them alone has.
    bool same_as(const Crs& other) const;

private:
    CrsFacts facts_;
};

}  // namespace wedgescope
