// What is known of a CRS without GDAL, beside what GDAL says of it.
#include <catch2/catch.hpp>

#include <ogr_spatialref.h>
#include <proj.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "lib/error.hpp"
#include "tests/drawn_raster.hpp"
#include "tiles/checksum.hpp"
#include "tiles/crs.hpp"
#include "tiles/crs_by_rule.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/georeference.hpp"
#include "tiles/store_manifest.hpp"

using namespace wedgescope;
using wedgescope::test::Folder;

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

/// In transverse Mercator, but no zone of UTM.
const std::string off_the_equator =
    "+proj=tmerc +lat_0=31.25 +lon_0=10.5 +k=0.99995 +x_0=1234.5 +y_0=-2000 +datum=WGS84 +units=m +no_defs";

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
        const auto crs = Crs::read(definition, reason);
        CHECK(crs->same_as(Crs::wgs84()) == same);
        CHECK(crs->is_wgs84() == same);
        CHECK(same == (definition == "EPSG:4326" || definition == "OGC:CRS84"));
    }
}

TEST_CASE("WGS84 in transverse Mercator is known for that, and nothing else is", "[crs]") {
    const auto mercator = [](const std::string& definition) {
        std::string reason;
        const auto crs = Crs::read(definition, reason);
        REQUIRE(crs);
        return crs->mercator();
    };
    CHECK(mercator("EPSG:32611") == TransverseMercator{0, -117, 0.9996, 500000, 0});
    CHECK(mercator("EPSG:32733") == TransverseMercator{0, 15, 0.9996, 500000, 1e7});
    const auto tilted = mercator(off_the_equator);
    REQUIRE(tilted);
    CHECK(tilted->latitude_deg == Approx(31.25).epsilon(1e-15));
    CHECK(tilted->longitude_deg == 10.5);
    CHECK(tilted->scale == 0.99995);
    CHECK(tilted->easting_m == 1234.5);
    CHECK(tilted->northing_m == -2000);
    for (const std::string& definition : definitions)
        if (definition != "EPSG:32611" && definition != "EPSG:32733" && definition != "EPSG:32611+5703") {
            INFO(definition);
            CHECK_FALSE(mercator(definition));
        }
    // Of another ellipsoid, in feet, in feet by its false easting alone, from Paris, facing south.
    for (const char* other :
         {"+proj=tmerc +lon_0=9 +ellps=GRS80", "+proj=utm +zone=11 +datum=WGS84 +units=us-ft",
          "+proj=utm +zone=11 +datum=WGS84 +towgs84=1,2,3", "+proj=tmerc +lon_0=9 +datum=WGS84 +pm=paris",
          "+proj=tmerc +lon_0=9 +datum=WGS84 +axis=wsu", "EPSG:2053", "EPSG:9741"}) {
        INFO(other);
        CHECK_FALSE(mercator(other));
    }
}

TEST_CASE("places of transverse Mercator are PROJ's, near its meridian and far", "[crs]") {
    const std::string definition = GENERATE(values<std::string>({"EPSG:32611", "EPSG:32733", off_the_equator}));
    INFO(definition);
    std::string reason;
    RasterFacts facts;
    facts.has_geotransform = true;
    facts.columns = facts.rows = 2;
    set_crs(facts, Crs::read(definition, reason));
    REQUIRE(facts.crs->mercator());
    Georeference ours(facts);
    PJ_CONTEXT* const context = proj_context_create();
    PJ* const way = proj_create_crs_to_crs(context, "EPSG:4326", facts.crs->wkt().c_str(), nullptr);
    PJ* const proj = proj_normalize_for_visualization(context, way);
    REQUIRE(proj);
    const double meridian = facts.crs->mercator()->longitude_deg;
    double most_there = 0, most_back = 0;
    int far = 0;
    for (const double lat : {-90.0, -89.999, -80.0, -33.3, 0.0, 1e-9, 31.25, 45.0, 71.7, 84.0, 89.9, 90.0})
        for (const double aside : {-85.0, -60.0, -20.001, -19.999, -7.0, -3.0, 0.0, 1e-8, 0.5, 6.0, 19.9, 21.0, 75.0}) {
            CAPTURE(lat, aside);
            const double lon = std::remainder(meridian + aside, 360.0);
            const PJ_COORD there = proj_trans(proj, PJ_FWD, proj_coord(lon, lat, 0, HUGE_VAL));
            if (!std::isfinite(there.v[0])) {
                CHECK_THROWS_AS(ours.locate(lat, lon), DataError);
                ++far;
                continue;
            }
            // A circle more changes nothing.
            const IndexPosition at = ours.locate(lat, lon + 360);
            most_there = std::max({most_there, std::fabs(at.column + 0.5 - there.v[0]),
                                   std::fabs(-at.row - 0.5 - there.v[1])});
            const PJ_COORD back = proj_trans(proj, PJ_INV, there);
            const auto lat_lon = ours.lat_lon(there.v[0] - 0.5, -there.v[1] - 0.5);
            REQUIRE(lat_lon);
            most_back = std::max({most_back, std::fabs(lat_lon->first - back.v[1]),
                                  std::fabs(std::remainder(lat_lon->second - back.v[0], 360.0)) *
                                      std::cos(lat * M_PI / 180)});
        }
    CHECK(most_there < 1e-6);  // m
    CHECK(most_back < 1e-11);  // degrees
    CHECK(far < 12 * 13 / 2);
    proj_destroy(proj);
    proj_destroy(way);
    proj_context_destroy(context);
}

TEST_CASE("a raster has one operation between datums all over, where PROJ has one for each part of it", "[crs]") {
    struct Ground {
        const char* crs;
        double x, y;  // easting and northing of its middle, where PROJ takes another operation some kilometres on
    };
    const Ground ground = GENERATE(Ground{"EPSG:23032", 500000, 6037000}, Ground{"EPSG:23030", 500000, 4837000},
                                   Ground{"EPSG:3003", 1500000, 4571000});
    INFO(ground.crs);
    std::string reason;
    RasterFacts facts;
    facts.has_geotransform = true;
    facts.columns = facts.rows = 1200;
    facts.step_x = 50, facts.step_y = -50;
    facts.corner_x = ground.x - 30000, facts.corner_y = ground.y + 30000;
    set_crs(facts, Crs::read(ground.crs, reason));
    Georeference ours(facts);
    PJ_CONTEXT* const context = proj_context_create();
    PJ* const way = proj_create_crs_to_crs(context, "EPSG:4326", ground.crs, nullptr);
    PJ* const proj = proj_normalize_for_visualization(context, way);
    REQUIRE(proj);
    const auto by_proj = [&](double row) {
        return proj_trans(proj, PJ_INV, proj_coord(ground.x, facts.corner_y - 50 * (row + 0.5), 0, HUGE_VAL)).v[1];
    };
    const auto by_us = [&](double row) { return ours.lat_lon(599.5, row)->first; };
    // From row to row latitude falls as evenly as a projection does, but for a step of metres.
    const auto step_m = [](const auto& latitude) {
        double most = 0;
        for (int row = 1; row < 1199; ++row)
            most = std::max(most, std::fabs(latitude(row - 1) - 2 * latitude(row) + latitude(row + 1)) * 111e3);
        return most;
    };
    CHECK(step_m(by_proj) > 0.3);
    CHECK(step_m(by_us) < 1e-3);
    // In the middle it is PROJ's own.
    CHECK(std::fabs(by_us(599.5) - by_proj(599.5)) < 1e-12);
    const IndexPosition at = ours.locate(by_us(3.25), ours.lat_lon(599.5, 3.25)->second);
    CHECK(std::fabs(at.row - 3.25) < 1e-4);  // 5 mm: a shift by seven terms is not undone to more
    CHECK(std::fabs(at.column - 599.5) < 1e-4);
    proj_destroy(proj);
    proj_destroy(way);
    proj_context_destroy(context);
}

TEST_CASE("what is known of a CRS hangs on its WKT alone, and not on how it was named", "[crs]") {
    for (const std::string& definition : definitions) {
        INFO(definition);
        std::string reason;
        const auto named = Crs::read(definition, reason);
        CHECK(named->facts() == Crs::read(named->wkt(), reason)->facts());
    }
}

TEST_CASE("what is told by rule is what PROJ finds", "[crs]") {
    std::vector<int> codes{4326};
    for (int zone = 1; zone <= 60; ++zone)
        for (const int base : {32600, 32700}) codes.push_back(base + zone);
    std::string reason;
    for (const int code : codes) {
        INFO(code);
        const auto told = facts_by_rule(code);
        REQUIRE(told);
        // Behind another word, so that PROJ is asked and not what was remembered.
        const auto asked = Crs::read(told->wkt + " ", reason);
        REQUIRE(asked);
        CrsFacts found = asked->facts();
        found.wkt.pop_back();
        CHECK(found == *told);
        const auto official = Crs::read("EPSG:" + std::to_string(code), reason);
        REQUIRE(official);
        CHECK(official->same_as(Crs(*told)));
        CrsFacts by_data_base = official->facts();
        by_data_base.wkt = told->wkt;  // which also says where it is in use
        CHECK(by_data_base == *told);
        CHECK(Crs::by_rule(code)->facts() == *told);
    }
    for (const int code : {0, 4269, 4979, 32600, 32661, 32700, 32761, 26911, 3857}) {
        INFO(code);
        CHECK_FALSE(facts_by_rule(code));
        CHECK_FALSE(Crs::by_rule(code));
    }
}

TEST_CASE("a projection that is none is PROJ's to refuse", "[crs]") {
    std::string reason;
    const std::string zone = Crs::read("EPSG:32611", reason)->wkt();
    const auto changed = [&](const std::string& what, const std::string& by) {
        std::string wkt = zone;
        const std::size_t at = wkt.find(what);
        REQUIRE(at != std::string::npos);
        wkt.replace(at, what.size(), by);
        return Crs::read(wkt, reason);
    };
    const std::string scale = "\"Scale factor at natural origin\",0.9996", latitude = "\"Latitude of natural origin\",0";
    REQUIRE(changed(scale, "\"Scale factor at natural origin\",0.9")->mercator());
    for (const auto& crs : {changed(scale, "\"Scale factor at natural origin\",0"),
                            changed(scale, "\"Scale factor at natural origin\",-1"),
                            changed(latitude, "\"Latitude of natural origin\",100")}) {
        REQUIRE(crs);
        CHECK_FALSE(crs->mercator());
        RasterFacts facts;
        facts.role = "dem";
        facts.path = "ground.tif";
        facts.has_geotransform = true;
        set_crs(facts, crs);
        CHECK_THROWS_WITH(Georeference(facts).locate(34, -117), Catch::Contains("dem 'ground.tif': PROJ "));
    }
}

TEST_CASE("a store's manifest tells all that PROJ knows of its CRS", "[crs]") {
    const Folder folder;
    int number = 0;
    for (const std::string& definition : definitions) {
        INFO(definition);
        std::string reason;
        // In words that nobody has read yet, of which PROJ knows as much.
        CrsFacts facts = Crs::read(Crs::read(definition, reason)->wkt(), reason)->facts();
        if (facts.kind == CrsKind::geocentric || definition == "EPSG:4807") continue;  // no raster's; grads
        StoreManifest manifest;
        manifest.layers.resize(1);
        RasterFacts& layer = manifest.layers[0].facts;
        layer.has_geotransform = true;
        layer.type = GDT_Int16;
        layer.columns = layer.rows = layer.block_columns = 256;
        const auto made = [&] {
            const bool in_old_words = facts.wkt_of_old != facts.wkt;
            facts.wkt.insert(facts.wkt.find('[') + 1, std::string(static_cast<std::size_t>(++number), ' '));
            if (!in_old_words) facts.wkt_of_old = facts.wkt;
            layer.crs = std::make_shared<const Crs>(facts);
            return manifest_text(manifest);
        };
        const auto read = [&](std::string text, const std::string& what, const std::string& by) {
            const std::size_t at = text.find(what);
            REQUIRE(at != std::string::npos);
            text.replace(at, what.size(), by);
            const std::string key = "\"checksum\": \"";
            const std::size_t sum = text.rfind(key) + key.size();
            text.replace(sum, 16, 16, '0');
            text.replace(sum, 16, hex(checksum(text)));
            std::ofstream(folder / "manifest.json") << text;
            const auto found = read_manifest(folder / "").layers[0].facts.crs;
            REQUIRE(found);
            CHECK(found->wkt() == facts.wkt);
            return found->facts();
        };
        CHECK(read(made(), "checksum", "checksum") == facts);
        // What is told is taken, ...
        const std::string name = "\"name\": \"" + facts.name + "\"", renamed = "\"name\": \"renamed\"";
        CHECK(read(made(), name, renamed).name == "renamed");
        CHECK(read(manifest_text(manifest), "checksum", "checksum").name == "renamed");  // and remembered
        // ... but not as another program tells it, or of another WKT, or none of it.
        const auto asked = [&](const std::string& what, const std::string& by) {
            std::string text = made();
            const std::size_t at = text.find(name);
            REQUIRE(at != std::string::npos);
            text.replace(at, name.size(), renamed);
            CHECK(read(text, what, by) == facts);
        };
        asked("\"crs_facts\"", "\"other_facts\"");
        asked("\"revision\": 1,", "\"revision\": 999,");
        asked("\"revision\": 1,", "\"revision\": \"1\",");
        asked("\"of\": \"", "\"of\": \"0");
        asked("\"kind\": \"", "\"kind\": \"un");
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
