// What is known of a CRS without GDAL, beside what GDAL says of it.
#include <catch2/catch.hpp>

#include <ogr_spatialref.h>

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "tiles/crs.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/gdal_session.hpp"

using namespace wedgescope;

namespace {

const GdalSession session(std::size_t{16} << 20, {});

const std::vector<std::string> definitions = {
    "EPSG:4326",
    "EPSG:4269",
    "EPSG:4258",
    "OGC:CRS84",
    "EPSG:4979",
    "EPSG:32611",
    "EPSG:32733",
    "EPSG:26911",
    "EPSG:27700",
    "EPSG:31467",
    "EPSG:2154",
    "EPSG:3031",
    "EPSG:3413",
    "EPSG:2193",
    "EPSG:2231",
    "EPSG:3857",
    "EPSG:21781",
    "EPSG:32761",
    "EPSG:4807",
    "EPSG:4978",
    "EPSG:32611+5703",
    "ESRI:102008",
    "+proj=aeqd +lat_0=33.9 +lon_0=-117 +datum=WGS84 +units=m +no_defs",
    "+proj=utm +zone=11 +ellps=clrk66 +towgs84=-8,160,176 +units=us-ft +no_defs",
    "+proj=longlat +ellps=bessel +towgs84=598.1,73.7,418.2,0.202,0.045,-2.455,6.7 +no_defs"};

const char* const either_order[] = {"IGNORE_DATA_AXIS_TO_SRS_AXIS_MAPPING=YES", nullptr};

OGRSpatialReference gdals(const std::string& definition) {
    OGRSpatialReference crs;
    REQUIRE(crs.SetFromUserInput(definition.c_str()) == OGRERR_NONE);
    if (crs.IsCompound()) crs.StripVertical();
    crs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    return crs;
}

std::string words(const char* given) { return given ? given : ""; }

std::string wkt(const OGRSpatialReference& crs, const char* format) {
    char* out = nullptr;
    const std::string option = std::string("FORMAT=") + format;
    const char* const options[] = {option.c_str(), nullptr};
    CHECK(crs.exportToWkt(&out, options) == OGRERR_NONE);
    const std::string all = words(out);
    CPLFree(out);
    return all;
}

}  // namespace

TEST_CASE("a CRS has the kind, unit, names and words that GDAL gives it", "[crs]") {
    for (const std::string& definition : definitions) {
        INFO(definition);
        const OGRSpatialReference gdal = gdals(definition);
        std::string reason;
        const auto own = Crs::read(definition, reason), through = from_gdal(gdal);
        REQUIRE(own);
        REQUIRE(through);
        for (const Crs* crs : {own.get(), through.get()}) {
            CHECK((crs->kind() == Crs::Kind::geographic) == (gdal.IsGeographic() != 0));
            CHECK((crs->kind() == Crs::Kind::projected) == (gdal.IsProjected() != 0));
            CHECK((crs->kind() == Crs::Kind::geocentric) == (gdal.IsGeocentric() != 0));
            // GDAL has words of its own for CRS84, and for PROJ's.
            const bool other_words = crs == own.get() && !definition.starts_with("EPSG");
            if (!other_words) CHECK(crs->wkt() == wkt(gdal, "WKT2_2019"));
            if (crs == own.get() && definition == "OGC:CRS84") continue;
            CHECK(crs->name() == words(gdal.GetName()));
            CHECK(crs->authority() == words(gdal.GetAuthorityName(nullptr)));
            CHECK(crs->code() == words(gdal.GetAuthorityCode(nullptr)));
            const char* none = nullptr;
            const double unit =
                gdal.IsGeographic() ? gdal.GetAngularUnits(&none) * 180 / M_PI : gdal.GetLinearUnits(&none);
            CHECK(crs->unit() == Approx(unit).epsilon(1e-12));
            const std::vector<int> mapping = gdal.GetDataAxisToSRSAxisMapping();
            if (!gdal.IsGeocentric())
                CHECK(crs->axis_mapping() == std::to_string(mapping.at(0)) + "," + std::to_string(mapping.at(1)));
            CHECK(in_gdal(*crs).IsSame(&gdal));
        }
    }
}

TEST_CASE("definitions are the shortest that GDAL reads back as the same CRS", "[crs]") {
    for (const std::string& definition : definitions) {
        INFO(definition);
        std::string reason;
        const auto own = Crs::read(definition, reason);
        REQUIRE(own);
        const OGRSpatialReference gdal = gdals(definition), again = gdals(own->definition());
        if (own->authority().empty()) {
            char* proj = nullptr;
            REQUIRE(gdal.exportToProj4(&proj) == OGRERR_NONE);
            CHECK(own->definition() == words(proj));
            CPLFree(proj);
        }
        if (!own->authority().empty()) CHECK(again.IsSame(&gdal));
        OGRSpatialReference of_old;
        REQUIRE(of_old.importFromWkt(own->wkt_of_old().c_str()) == OGRERR_NONE);
        of_old.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
        CHECK(of_old.IsSame(&gdal, either_order));
    }
}

TEST_CASE("the same CRS are those that GDAL takes for the same", "[crs]") {
    for (const std::string& a : definitions)
        for (const std::string& b : definitions) {
            INFO(a << " and " << b);
            std::string reason;
            const auto one = Crs::read(a, reason), other = Crs::read(b, reason);
            const OGRSpatialReference gdal_a = gdals(a), gdal_b = gdals(b);
            CHECK(one->same_as(*other) == (gdal_a.IsSame(&gdal_b, either_order) != 0));
        }
}

TEST_CASE("WGS84 is what GDAL takes for WGS84", "[crs]") {
    OGRSpatialReference wgs84;
    wgs84.SetWellKnownGeogCS("WGS84");
    for (const std::string& definition : definitions) {
        INFO(definition);
        std::string reason;
        const bool same = gdals(definition).IsSame(&wgs84, either_order) != 0;
        CHECK(Crs::read(definition, reason)->same_as(Crs::wgs84()) == same);
        CHECK(same == (definition == "EPSG:4326" || definition == "OGC:CRS84"));
    }
}

TEST_CASE("what is no CRS is refused with PROJ's reason", "[crs]") {
    for (const char* none : {"EPSG:1", "nonsense", "PROJCRS[\"cut", "+proj=nowhere"}) {
        INFO(none);
        std::string reason;
        CHECK_FALSE(Crs::read(none, reason));
        CHECK_FALSE(reason.empty());
    }
}

TEST_CASE("threads read and compare CRS side by side", "[crs]") {
    std::vector<std::thread> threads;
    std::atomic<int> unlike = 0;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&] {
            for (const std::string& definition : definitions) {
                std::string reason;
                const auto crs = Crs::read(definition, reason);
                if (!crs || !crs->same_as(*crs) || crs->same_as(Crs::wgs84()) != Crs::wgs84().same_as(*crs)) ++unlike;
            }
        });
    for (std::thread& thread : threads) thread.join();
    CHECK(unlike == 0);
}
