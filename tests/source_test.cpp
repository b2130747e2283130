// The direct source: chunks of terrain, culture height and classes, and where they lie on earth.
#include <catch2/catch.hpp>

#include <GeographicLib/TransverseMercator.hpp>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <limits>
#include <random>
#include <thread>

#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "lib/threads.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/refusal.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/source_choice.hpp"
#include "tiles/sources.hpp"
#include "tiles/tile_cache.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;
using wedgescope::test::draw;
using wedgescope::test::Drawing;
using wedgescope::test::Folder;

namespace {

const std::string data = WEDGESCOPE_TEST_DATA;
const GdalSession session(std::size_t{16} << 20, {});

DataBaseParams only(const std::string& dem) {
    DataBaseParams params;
    params.dem = dem;
    return params;
}

/// The whole first band, as GDAL alone reads it.
struct Plain {
    int columns, rows;
    std::vector<double> values;
    double g[6];
    explicit Plain(const std::string& path) {
        GDALDataset* in = GDALDataset::Open(path.c_str());
        columns = in->GetRasterXSize();
        rows = in->GetRasterYSize();
        in->GetGeoTransform(g);
        values.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
        if (in->GetRasterBand(1)->RasterIO(GF_Read, 0, 0, columns, rows, values.data(), columns, rows, GDT_Float64, 0,
                                           0, nullptr) != CE_None)
            throw std::runtime_error("cannot read " + path);
        GDALClose(in);
    }
    double at(std::int64_t c, std::int64_t r) const { return values[static_cast<std::size_t>(r * columns + c)]; }
};

/// Post of a chunk by column and row.
float surface(const Chunk& k, std::int64_t c, std::int64_t r) {
    const std::int64_t line = k.lines_are_columns ? c - k.window.columns.begin : r - k.window.rows.begin;
    const std::int64_t minor = k.lines_are_columns ? r - k.window.rows.begin : c - k.window.columns.begin;
    return k.surface_m[static_cast<std::size_t>(line * k.minor_count() + minor)];
}
ClassId class_at(const CultureCells& k, std::int64_t c, std::int64_t r) {
    return k.classes[static_cast<std::size_t>((r - k.window.rows.begin) * k.window.columns.size() + c -
                                              k.window.columns.begin)];
}

}  // namespace

TEST_CASE("posts stand at the centres of their cells and on whole degrees of an SRTM tile", "[source]") {
    const auto azores = open_direct_source(only(data + "/azores_dem.tif"));
    const DataBase& d = azores->data_base();
    CHECK(d.has_crs);
    CHECK_FALSE(d.crs_in_metres);
    CHECK_FALSE(d.cyclic);
    const IndexPosition middle = d.locate(39, -28);
    CHECK(middle.column == Approx(1200).margin(1e-6));  // posts; GDAL writes the step with 15 digits
    CHECK(middle.row == Approx(1200).margin(1e-6));
    CHECK(d.origin_x == Approx(-29).margin(1e-9));
    CHECK(d.origin_y == Approx(40).margin(1e-9));
    for (double turn : {-720.0, -360.0, 360.0}) CHECK(d.locate(39, -28 + turn).column == Approx(1200).margin(1e-6));
    const auto back = d.lat_lon(1200, 1200);
    REQUIRE(back);
    CHECK(back->first == Approx(39).margin(1e-9));
    CHECK(back->second == Approx(-28).margin(1e-9));
    CHECK_FALSE(d.lat_lon(0, -61000));  // north of the pole

    // The top of Pico, 38.4689 N 28.3992 W, 2351 m by survey; SRTM rounds it off.
    const IndexPosition pico = d.locate(38.4689, -28.3992);
    const float top = azores->bare_terrain_m(std::lround(pico.column), std::lround(pico.row));
    CHECK(top > 2200);
    CHECK(azores->extremes().highest_m == 2304);
    CHECK(azores->extremes().lowest_m == -8);
    CHECK(azores->extremes().void_posts == 0);
}

TEST_CASE("places on a projected raster agree with GeographicLib's transverse Mercator", "[source]") {
    const auto source = open_direct_source(only(data + "/inland_empire_dem.tif"));
    const DataBase& d = source->data_base();
    CHECK(d.crs_in_metres);
    CHECK(d.metres_per_unit == 1);
    for (const auto& [lat, lon] :
         {std::pair(33.8, -117.5), std::pair(33.6, -117.75), std::pair(34.0, -117.0), std::pair(30.0, -110.0)}) {
        double x = 0, y = 0;
        GeographicLib::TransverseMercator::UTM().Forward(-117, lat, lon, x, y);
        const IndexPosition at = d.locate(lat, lon);
        CHECK(d.origin_x + at.column * d.step_x == Approx(x + 500000).margin(1e-4));  // metres
        CHECK(d.origin_y + at.row * d.step_y == Approx(y).margin(1e-4));
        const auto back = d.lat_lon(at.column, at.row);
        REQUIRE(back);
        CHECK(back->first == Approx(lat).margin(1e-9));
        CHECK(back->second == Approx(lon).margin(1e-9));
    }
    CHECK_THROWS_AS(d.locate(0, -27), DataError);  // 90 degrees from the central meridian
}

TEST_CASE("a chunk holds the posts of its window, line by line, either way round", "[source]") {
    const std::string path = data + "/olympic_coast_dem.tif";
    const Plain plain(path);
    const auto source = open_direct_source(only(path));
    std::mt19937 random(5);
    for (int trial = 0; trial < 12; ++trial) {
        const auto pick = [&](std::int64_t n) {
            std::int64_t a = static_cast<std::int64_t>(random() % static_cast<unsigned>(n)),
                         b = static_cast<std::int64_t>(random() % static_cast<unsigned>(n));
            return Interval{std::min(a, b), std::max(a, b) + 1};
        };
        const Window window{pick(3601), pick(1801)};
        const bool by_columns = trial % 2 == 0;
        const Chunk chunk = source->load(window, by_columns);
        REQUIRE(chunk.surface_m.size() == static_cast<std::size_t>(window.posts()));
        CHECK(chunk.posts_read == static_cast<std::uint64_t>(window.posts()));
        CHECK(chunk.bytes_read == 2 * chunk.posts_read);
        CHECK(chunk.culture_height_m.empty());
        std::int64_t wrong = 0;
        for (std::int64_t r = window.rows.begin; r < window.rows.end; ++r)
            for (std::int64_t c = window.columns.begin; c < window.columns.end; ++c) {
                const float z = surface(chunk, c, r);
                const double want = plain.at(c, r);
                wrong += want == -32768 ? !std::isnan(z) : z != static_cast<float>(want);
            }
        CHECK(wrong == 0);
    }
    CHECK(source->extremes().void_posts ==
          static_cast<std::uint64_t>(std::count(plain.values.begin(), plain.values.end(), -32768.0)));
    CHECK(source->extremes().highest_m == 1095);
}

TEST_CASE("a raster of more tiles than can be kept account of is refused by its size", "[source]") {
    const Folder folder;
    draw(folder / "dem.tif", Drawing{});
    const auto vrt = [&](const std::string& size) {
        std::ofstream(folder / "huge.vrt")
            << "<VRTDataset rasterXSize=\"" << size << "\" rasterYSize=\"" << size
            << "\"><SRS>EPSG:32611</SRS><GeoTransform>1000,10,0,2000,0,-10</GeoTransform><VRTRasterBand "
               "dataType=\"Float32\" band=\"1\"><SimpleSource><SourceFilename relativeToVRT=\"1\">dem.tif"
               "</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>";
        return open_direct_source(only(folder / "huge.vrt"));
    };
    CHECK(vrt("1000000")->data_base().columns == 1000000);  // in tiles of 128 x 128
    for (const char* size : {"4200000", "2000000000"})
        CHECK_THAT(test::refusal<DataError>([&] { vrt(size); }),
                   Contains("huge.vrt' has " + std::string(size) + " x ") && Contains("accepted: 1073741824 "));
}

TEST_CASE("a raster round the whole earth goes on across its seam", "[source]") {
    const Folder folder;
    for (int extra : {0, 1}) {
        Drawing d;
        d.columns = 36 + extra;
        d.rows = 9;
        d.crs = "EPSG:4326";
        d.geotransform = {{-185, 10, 0, 45, 0, -10}};
        d.value = [](int c, int r) { return c % 36 * 100 + r; };
        draw(folder / "world.tif", d);
        const auto source = open_direct_source(only(folder / "world.tif"));
        CHECK(source->data_base().cyclic);
        CHECK(source->data_base().cycle_columns == 36);
        for (bool by_columns : {false, true}) {
            const Chunk chunk = source->load({{-3, 40}, {2, 5}}, by_columns);
            std::int64_t wrong = 0;
            for (std::int64_t c = -3; c < 40; ++c)
                for (std::int64_t r = 2; r < 5; ++r)
                    wrong += surface(chunk, c, r) != static_cast<float>((c + 36) % 36 * 100 + r);
            CHECK(wrong == 0);
        }
        CHECK(source->bare_terrain_m(-1, 4) == 3504);
        // 175 W and 185 E are one place, half way from column 0 to 1.
        CHECK(source->data_base().locate(0, 185).column == Approx(0.5).margin(1e-9));
        CHECK(source->data_base().locate(0, -175).column == Approx(0.5).margin(1e-9));
    }
    Drawing d;
    d.columns = 35;
    d.crs = "EPSG:4326";
    d.geotransform = {{-180, 10, 0, 45, 0, -10}};
    draw(folder / "gap.tif", d);
    CHECK_FALSE(open_direct_source(only(folder / "gap.tif"))->data_base().cyclic);
}

TEST_CASE("south-up rasters and rasters without any georeference are honoured", "[source]") {
    const Folder folder;
    Drawing d;
    d.geotransform = {{1000, 10, 0, 2000, 0, 10}};
    d.value = [](int c, int r) { return 10 * r + c; };
    draw(folder / "south.tif", d);
    const auto south = open_direct_source(only(folder / "south.tif"));
    CHECK(south->data_base().step_y == 10);
    CHECK(south->data_base().origin_y == 2005);
    CHECK(south->bare_terrain_m(3, 2) == 23);

    d.geotransform.reset();
    d.crs.clear();
    draw(folder / "bare.tif", d);
    const auto bare = open_direct_source(only(folder / "bare.tif"));
    const DataBase& b = bare->data_base();
    CHECK_FALSE(b.has_crs);
    CHECK(b.crs_in_metres);
    CHECK(b.metres_per_unit == 1);
    // The last row is y = 0, rows go north at 1 m: a picture stands as it is drawn.
    CHECK(b.origin_x == 0);
    CHECK(b.origin_y == 2);
    CHECK(b.step_x == 1);
    CHECK(b.step_y == -1);
    CHECK_FALSE(static_cast<bool>(b.locate));

    d.geotransform = {{0, 5, 0, 0, 0, -5}};
    d.crs = "EPSG:2263";  // New York Long Island, US survey feet
    draw(folder / "feet.tif", d);
    CHECK(open_direct_source(only(folder / "feet.tif"))->data_base().metres_per_unit ==
          Approx(1200.0 / 3937).epsilon(1e-12));
}

TEST_CASE("a VRT's fractions of whole numbers are kept", "[source]") {
    const Folder folder;
    Drawing d;
    d.columns = d.rows = 8;
    d.type = GDT_Int16;
    d.value = [](int c, int r) { return 10 * c + 3 * r; };
    draw(folder / "whole.tif", d);
    const auto vrt = [&](const std::string& source, int size) {
        std::ofstream(folder / "part.vrt") << "<VRTDataset rasterXSize='" << size << "' rasterYSize='" << size
                                           << "'><SRS>EPSG:32611</SRS><GeoTransform>0, 10, 0, 0, 0, -10</GeoTransform>"
                                              "<VRTRasterBand dataType='Int16' band='1'>"
                                           << source << "</VRTRasterBand></VRTDataset>";
        const Plain plain(folder / "part.vrt");
        const auto opened = open_direct_source(only(folder / "part.vrt"));
        const Chunk chunk = opened->load({{0, size}, {0, size}}, false);
        int fractions = 0;
        for (int r = 0; r < size; ++r)
            for (int c = 0; c < size; ++c) {
                CHECK(surface(chunk, c, r) == static_cast<float>(plain.at(c, r)));
                fractions += plain.at(c, r) != std::trunc(plain.at(c, r));
            }
        return fractions;
    };
    const std::string file = "<SourceFilename relativeToVRT='1'>whole.tif</SourceFilename><SourceBand>1</SourceBand>";
    CHECK(vrt("<ComplexSource>" + file + "<ScaleOffset>0</ScaleOffset><ScaleRatio>0.1</ScaleRatio></ComplexSource>",
              8) > 0);
    vrt("<SimpleSource resampling='bilinear'>" + file +
            "<SrcRect xOff='0' yOff='0' xSize='8' ySize='8'/><DstRect xOff='0' yOff='0' xSize='16' ySize='16'/>"
            "</SimpleSource>",
        16);
}

TEST_CASE("places are those that GDAL's own transformation finds, in any CRS", "[source]") {
    struct Place {
        const char* crs;
        double lat, lon;
    };
    const auto place = GENERATE(values<Place>({
        {"EPSG:32611", 34, -117},  // UTM, WGS84
        {"EPSG:26711", 34, -117},  // of another datum: NAD27
        {"EPSG:2263", 40.7, -74},  // US survey feet
        {"EPSG:27700", 52, -1.5},  // OSGB36
        {"EPSG:3035", 50, 10},     // northing before easting
        {"EPSG:31467", 49, 9},     // the same, shifted datum
        {"EPSG:3031", -80, 40},    // south pole
        {"EPSG:3413", 84, -170},   // north pole
        {"EPSG:2193", -41, 174},   // NZTM
        {"EPSG:4267", 40, -100},   // degrees, NAD27
        {"EPSG:4301", 36, 138},    // degrees, Tokyo
        {"+proj=tmerc +lon_0=9 +ellps=bessel +towgs84=598,73,418,0.2,0,-2.4,6.7", 50, 9.5},
        {"+proj=laea +lat_0=45 +lon_0=7 +R=6371000 +units=m", 45.2, 7.3},
    }));
    INFO(place.crs);
    OGRSpatialReference wgs84, crs;
    wgs84.SetWellKnownGeogCS("WGS84");
    wgs84.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    REQUIRE(crs.SetFromUserInput(place.crs) == OGRERR_NONE);
    crs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    // As a VRT may hold it: an older format has lost the area that the CRS is in use in, and may come with a shift of the datum.
    enum class Format { now, old, shifted };
    const auto format = GENERATE(Format::now, Format::old, Format::shifted);
    INFO("format " << static_cast<int>(format));
    const std::string words = [&] {
        OGRSpatialReference written(crs);
        if (format == Format::shifted && !written.GetAuthorityCode(nullptr)) return std::string();
        if (format == Format::shifted) written.SetTOWGS84(598, 73, 418, 0.2, 0, -2.4, 6.7);
        char* wkt = nullptr;
        const char* const options[] = {format == Format::now ? "FORMAT=WKT2_2019" : "FORMAT=WKT1_GDAL", nullptr};
        REQUIRE(written.exportToWkt(&wkt, options) == OGRERR_NONE);
        std::string text = wkt;
        CPLFree(wkt);
        return text;
    }();
    if (words.empty()) return;
    if (format == Format::shifted) REQUIRE_THAT(words, Contains("TOWGS84"));
    REQUIRE(crs.SetFromUserInput(words.c_str()) == OGRERR_NONE);
    crs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    const std::unique_ptr<OGRCoordinateTransformation> there(OGRCreateCoordinateTransformation(&wgs84, &crs)),
        back(OGRCreateCoordinateTransformation(&crs, &wgs84));
    REQUIRE((there && back));
    double x = place.lon, y = place.lat;
    REQUIRE(there->Transform(1, &x, &y));

    const Folder folder;
    Drawing d;
    const double step = crs.IsGeographic() ? 1e-3 : 100;
    d.columns = d.rows = 101;
    d.geotransform = {{x - 50 * step, step, 0, y + 50 * step, 0, -step}};
    d.crs.clear();
    draw(folder / "there.tif", d);
    char* escaped = CPLEscapeString(words.c_str(), -1, CPLES_XML);
    std::ofstream(folder / "there.vrt")
        << "<VRTDataset rasterXSize='101' rasterYSize='101'><SRS dataAxisToSRSAxisMapping='"
        << (crs.EPSGTreatsAsLatLong() || crs.EPSGTreatsAsNorthingEasting() ? "2,1" : "1,2") << "'>" << escaped
        << "</SRS><GeoTransform>" << text(x - 50 * step) << ", " << text(step) << ", 0, " << text(y + 50 * step)
        << ", 0, " << text(-step)
        << "</GeoTransform><VRTRasterBand dataType='Float32' band='1'><SimpleSource><SourceFilename relativeToVRT='1'>"
           "there.tif</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>";
    CPLFree(escaped);
    const auto source = open_direct_source(only(folder / "there.vrt"));
    const DataBase& db = source->data_base();
    std::mt19937 random(5);
    std::uniform_real_distribution<double> somewhere(0, 100);
    for (int i = 0; i < 20; ++i) {
        const double column = somewhere(random), row = somewhere(random);
        double lon = x + (column - 49.5) * step, lat = y - (row - 49.5) * step;
        REQUIRE(back->Transform(1, &lon, &lat));
        const auto found = db.lat_lon(column, row);
        REQUIRE(found);
        CHECK(found->first == Approx(lat).epsilon(0).margin(1e-10));
        CHECK(found->second == Approx(lon).epsilon(0).margin(1e-10));
        double easting = lon, northing = lat;
        REQUIRE(there->Transform(1, &easting, &northing));
        const IndexPosition at = db.locate(lat, lon);
        CHECK(at.column == Approx((easting - x) / step + 49.5).epsilon(0).margin(1e-6));
        CHECK(at.row == Approx((y - northing) / step + 49.5).epsilon(0).margin(1e-6));
    }
}

TEST_CASE("a stop is heard before posts are read", "[source]") {
    Stop stop;
    DataBaseParams params = only(data + "/azores_dem.tif");
    params.stop = &stop;
    const auto source = open_direct_source(params);
    CHECK_NOTHROW(source->bare_terrain_m(5, 5));
    stop.request(15);
    CHECK_THROWS_AS(source->bare_terrain_m(5, 5), Interrupted);
}

TEST_CASE("what stands round a sensor is found on both sides of a circle's seam", "[source]") {
    const Folder folder;
    // A degree a post; a plain within ten degrees of the antimeridian, mountains elsewhere.
    Drawing d;
    d.columns = 360;
    d.rows = 40;
    d.crs = "EPSG:4326";
    const auto ground = [&](const std::string& name, int west_deg) {
        d.geotransform = {static_cast<double>(west_deg), 1, 0, 20, 0, -1};
        d.value = [west_deg](int c, int) { return std::abs((c + west_deg + 360) % 360 - 180) < 10 ? 0 : 9000; };
        draw(folder / name, d);
        return open_direct_source(only(folder / name));
    };
    const auto at_seam = ground("seam.tif", -180), amid = ground("amid.tif", 0);
    REQUIRE((at_seam->data_base().cyclic && amid->data_base().cyclic));
    for (const double lon : {179.996, -179.996, 179.5}) {
        INFO(lon);
        Scene scene;
        scene.platform.latlon = LatLon{0.3, lon};
        scene.platform.altitude_m = 20000;
        scene.range_m = 300e3;
        const ResolvedScene a = resolve(scene, *at_seam), b = resolve(scene, *amid);
        CHECK(a.clearance_m == b.clearance_m);
        CHECK(a.clearance_m == Approx(20000));
        CHECK(a.roughness == b.roughness);
    }
}

TEST_CASE("near the seam of a raster that hardly or never closes spokes go on as elsewhere", "[source]") {
    const Folder folder;
    Drawing d;
    d.value = [](int, int) { return 50; };
    Scene scene;
    scene.platform.altitude_m = 3000;
    scene.range_m = 150e3;
    // 359 of 360 degrees, and all of the earth in Web Mercator, whose columns go round though nothing says so.
    d.columns = 3590;
    d.rows = 100;
    d.crs = "EPSG:4326";
    d.geotransform = {-180, 0.1, 0, 5, 0, -0.1};
    draw(folder / "dem.tif", d);
    const auto gap = open_direct_source(only(folder / "dem.tif"));
    CHECK_FALSE(gap->data_base().cyclic);
    for (const double lon : {-179.95, -179.5, 0.0, 178.8}) {
        scene.platform.latlon = LatLon{0.3, lon};
        CHECK(run(resolve(scene, *gap), *gap, {}).report.states[static_cast<std::size_t>(State::seen)] > 1000);
    }
    constexpr double half = 20037508.342789244;
    d.columns = 4000;
    d.crs = "EPSG:3857";
    d.geotransform = {-half, half / 2000, 0, 500000, 0, -10000};
    draw(folder / "dem.tif", d);
    const auto world = open_direct_source(only(folder / "dem.tif"));
    for (const double lon : {-179.97, 179.97, 179.0, 10.0}) {
        scene.platform.latlon = LatLon{0.3, lon};
        CHECK(run(resolve(scene, *world), *world, {}).report.states[static_cast<std::size_t>(State::seen)] > 1000);
    }
}

TEST_CASE("columns of a cylindrical projection go on across the antimeridian", "[source]") {
    const Folder folder;
    Drawing d;
    d.columns = d.rows = 200;
    d.value = [](int, int) { return 50; };
    constexpr double half = 20037508.342789244;  // of the circle in Web Mercator
    struct Raster {
        const char* crs;
        double corner_x, lat, first_lon, metres_a_degree;
    };
    // Ending there, going on beyond it, beginning there; by its own seam, 150 degrees west of its middle.
    for (const Raster& raster : {Raster{"EPSG:3857", half - 6000, -17.7, 180 - 6000 / half * 180, half / 180},
                                 Raster{"EPSG:3857", half - 3000, -17.7, 180 - 3000 / half * 180, half / 180},
                                 Raster{"EPSG:3857", -half, -17.7, -180, half / 180},
                                 Raster{"EPSG:3395", half - 3000, 52, 180 - 3000 / half * 180, half / 180},
                                 Raster{"EPSG:4087", half - 3000, 52, 180 - 3000 / half * 180, half / 180},
                                 Raster{"EPSG:3832", -3000, 10, 150 - 3000 / half * 180, half / 180}}) {
        INFO(raster.crs << " from " << raster.corner_x);
        d.crs = raster.crs;
        OGRSpatialReference own, wgs84;
        own.SetFromUserInput(raster.crs);
        wgs84.importFromEPSG(4326);
        for (auto* each : {&own, &wgs84}) each->SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
        std::unique_ptr<OGRCoordinateTransformation> to(OGRCreateCoordinateTransformation(&wgs84, &own));
        double x = raster.first_lon, y = raster.lat;
        REQUIRE(to->Transform(1, &x, &y));
        d.geotransform = {raster.corner_x, 30, 0, y + 3000, 0, -30};
        draw(folder / "dem.tif", d);
        const auto source = open_direct_source(only(folder / "dem.tif"));
        for (int column = -300; column < 500; column += 50) {
            const double lon = raster.first_lon + 30 * (column + 0.5) / raster.metres_a_degree;
            const IndexPosition at = source->data_base().locate(raster.lat, std::remainder(lon, 360.0));
            CHECK(at.column == Approx(column).margin(1e-4));
            CHECK(at.row == Approx(99.5).margin(1e-4));
        }
        Scene scene;
        scene.platform.latlon = LatLon{raster.lat, raster.first_lon + 30 * 196 / raster.metres_a_degree};
        scene.platform.altitude_m = 1000;
        scene.range_m = 3000;
        CHECK(resolve(scene, *source).nadir.column == Approx(195.5).margin(1e-4));
        CHECK(run(resolve(scene, *source), *source, {}).report.states[static_cast<std::size_t>(State::seen)] > 1000);
    }
    // Others go on as their own formulas say.
    d.crs = "EPSG:32660";
    d.geotransform = {600000, 30, 0, 8000000, 0, -30};
    draw(folder / "dem.tif", d);
    CHECK(open_direct_source(only(folder / "dem.tif"))->data_base().locate(-18, -179).column > 5000);
}

TEST_CASE("culture heights are added at the posts in single precision", "[source]") {
    const Plain dem(data + "/worcester_vermont_dem.tif"), canopy(data + "/worcester_vermont_canopy.tif");
    DataBaseParams params = only(data + "/worcester_vermont_dem.tif");
    params.culture_height = data + "/worcester_vermont_canopy.tif";
    params.culture_height_scale = 0.1;
    const auto source = open_direct_source(params);
    CHECK(source->data_base().has_culture_height);
    for (bool by_columns : {false, true}) {
        const Window window{{100, 500}, {50, 600}};
        const Chunk chunk = source->load(window, by_columns);
        REQUIRE(chunk.culture_height_m.size() == chunk.surface_m.size());
        std::int64_t wrong = 0, trees = 0;
        for (std::int64_t r = window.rows.begin; r < window.rows.end; ++r)
            for (std::int64_t c = window.columns.begin; c < window.columns.end; ++c) {
                const float h = canopy.at(c, r) == 32767 ? 0.0F : static_cast<float>(0.1 * canopy.at(c, r));
                const float z = surface(chunk, c, r);
                trees += h > 0;
                wrong += dem.at(c, r) == 32767 ? !std::isnan(z) : z != static_cast<float>(dem.at(c, r)) + h;
            }
        CHECK(wrong == 0);
        CHECK(trees > 10000);
    }
    CHECK(source->bare_terrain_m(300, 300) == static_cast<float>(dem.at(300, 300)));
    CHECK(source->extremes().highest_m >= 1101);
    CHECK(source->extremes().lowest_m == 201);
    // Nothing stands outside the tilted box: no heights are kept.
    CHECK(source->load({{0, 20}, {0, 20}}, false).culture_height_m.empty());
}

TEST_CASE("culture heights are those of the cell that contains the post, on the layer's own grid", "[source]") {
    const Folder folder;
    Drawing d;  // posts at x = 1005 + 10 c, y = 1995 - 10 r
    d.columns = 40;
    d.rows = 30;
    d.value = [](int, int) { return 100; };
    draw(folder / "dem.tif", d);
    Drawing h = d;
    DataBaseParams params = only(folder / "dem.tif");
    params.culture_height = folder / "height.tif";
    params.culture_height_scale = 2;
    // Coarser, finer, and turned over; each over part of the terrain only; no post on an edge between two cells.
    for (const auto& g :
         {std::array<double, 6>{1100.5, 35, 0, 1950.5, 0, -35}, std::array<double, 6>{1100.5, 3, 0, 1950.5, 0, -3},
          std::array<double, 6>{1100.5, 7, 0, 1800.5, 0, 7}}) {
        h.columns = 20;
        h.rows = 25;
        h.geotransform = g;
        h.value = [](int c, int r) { return c == 3 && r == 3 ? 0 : 1 + c + 20 * r; };
        draw(folder / "height.tif", h);
        const auto source = open_direct_source(params);
        const Chunk chunk = source->load({{2, 39}, {1, 30}}, true);
        std::int64_t wrong = 0, standing = 0;
        for (std::int64_t c = 2; c < 39; ++c)
            for (std::int64_t r = 1; r < 30; ++r) {
                const double x = 1005 + 10 * static_cast<double>(c), y = 1995 - 10 * static_cast<double>(r);
                const double i = std::floor((x - g[0]) / g[1]), j = std::floor((y - g[3]) / g[5]);
                const bool inside = i >= 0 && j >= 0 && i < 20 && j < 25;
                const double want = !inside || (i == 3 && j == 3) ? 0 : 2 * (1 + i + 20 * j);
                standing += want > 0;
                wrong += surface(chunk, c, r) != static_cast<float>(100 + want);
            }
        CHECK(wrong == 0);
        CHECK(standing > 10);
    }
    // Posts on edges between cells, as a DTED's lie over cells of a twelve-thousandth of a degree: each takes the cell that begins there.
    const double post = 1.0 / 3600, cell = 1.0 / 12000;
    Drawing degrees = d, finer = d;
    degrees.crs = finer.crs = "EPSG:4326";
    degrees.geotransform = {10 - post / 2, post, 0, 46 + post / 2, 0, -post};
    finer.geotransform = {10 - 30 * cell, cell, 0, 46 + 30 * cell, 0, -cell};
    finer.columns = finer.rows = 200;
    draw(folder / "dem.tif", degrees);
    for (const bool along_rows : {false, true}) {
        finer.value = [&](int c, int r) { return along_rows ? r : c; };
        draw(folder / "height.tif", finer);
        const Chunk chunk = open_direct_source(params)->load({{0, 40}, {0, 30}}, true);
        std::int64_t wrong = 0;
        for (std::int64_t c = 0; c < 40; ++c)
            for (std::int64_t r = 0; r < 30; ++r)
                wrong += surface(chunk, c, r) != static_cast<float>(100 + 2 * (30 + 10 * (along_rows ? r : c) / 3));
        CHECK(wrong == 0);
    }
    draw(folder / "dem.tif", d);
    // As high as heights may be, with the scale.
    h.value = [](int c, int r) { return c == 4 && r == 5 ? 300 : 1; };
    draw(folder / "height.tif", h);
    params.culture_height_scale = 400;
    CHECK_THROWS_WITH(
        open_direct_source(params)->load({{0, 40}, {0, 30}}, false),
        Contains("height.tif") &&
            Contains(
                "column 4, row 5 is 300, and times 400 (culture-height-scale) 120000 m; accepted: at most 100000 m"));
    params.culture_height_scale = 2;
    h.value = [](int c, int r) { return c == 4 && r == 5 ? -3 : 1; };
    draw(folder / "height.tif", h);
    CHECK_THROWS_WITH(open_direct_source(params)->load({{0, 40}, {0, 30}}, false),
                      Contains("height.tif") && Contains("column 4") && Contains("row 5") && Contains("-3"));
}

TEST_CASE("a point has the class of the culture cell that contains it, on the culture's own grid", "[source]") {
    const Plain dem(data + "/lake_sunapee_dem.tif"), culture(data + "/lake_sunapee_culture.tif");
    const Legend nlcd = Legend::built_in("nlcd").value();
    DataBaseParams params = only(data + "/lake_sunapee_dem.tif");
    params.culture = data + "/lake_sunapee_culture.tif";
    CHECK_THROWS_AS(open_direct_source(params), InputError);  // no legend
    params.legend = nlcd;
    params.default_class = 17;
    const auto source = open_direct_source(params);
    const DataBase& d = source->data_base();
    // README: the first culture cell begins 9.308 cells west and 6.033 cells north of the first elevation cell.
    CHECK(d.culture_column_scale == 1);
    CHECK(d.culture_row_scale == 1);
    CHECK(d.culture_column_offset == Approx(9.308 + 0.5).margin(1e-3));
    CHECK(d.culture_row_offset == Approx(6.033 + 0.5).margin(1e-3));

    const Window window{{30, 90}, {200, 330}};
    const CultureCells chunk = source->load_classes({{29 + 9, 90 + 9 + 1}, {199 + 6, 330 + 6 + 1}});
    CHECK(chunk.codes.empty());
    std::int64_t wrong = 0;
    for (std::int64_t r = window.rows.begin - 1; r <= window.rows.end; ++r)
        for (std::int64_t c = window.columns.begin - 1; c <= window.columns.end; ++c) {
            const double x = dem.g[0] + (static_cast<double>(c) + 0.5) * dem.g[1],
                         y = dem.g[3] + (static_cast<double>(r) + 0.5) * dem.g[5];
            const auto i = static_cast<std::int64_t>(std::floor((x - culture.g[0]) / culture.g[1]));
            const auto j = static_cast<std::int64_t>(std::floor((y - culture.g[3]) / culture.g[5]));
            const int code = static_cast<int>(culture.at(i, j));
            wrong += class_at(chunk, i, j) != (code == 0 ? ClassId{17} : nlcd.find(code).value());
        }
    CHECK(wrong == 0);
    // The middle of Lake Sunapee (43.38 N, 72.05 W) is water, 11.
    const IndexPosition lake = d.locate(43.38, -72.055);
    const auto i = static_cast<std::int64_t>(std::floor(d.culture_column_offset + lake.column));
    const auto j = static_cast<std::int64_t>(std::floor(d.culture_row_offset + lake.row));
    CHECK(class_at(source->load_classes({{i - 2, i + 3}, {j - 2, j + 3}}), i, j) == nlcd.find(11).value());
}

TEST_CASE("outside the culture raster stands the default class, and unknown codes are kept", "[source]") {
    const Folder folder;
    Drawing d;
    d.columns = 20;
    d.rows = 20;
    draw(folder / "dem.tif", d);
    Drawing k = d;
    k.type = GDT_Int16;
    k.columns = k.rows = 6;
    k.geotransform = {{1050, 10, 0, 1950, 0, -10}};  // terrain cells 5..10 either way
    k.no_data = -1;
    k.value = [](int c, int r) { return c == 2 && r == 3 ? 777 : c == 4 && r == 4 ? -1 : 40 + c; };
    draw(folder / "codes.tif", k);
    DataBaseParams params = only(folder / "dem.tif");
    params.culture = folder / "codes.tif";
    params.default_class = 9;
    params.legend = Legend("drawn", {{40, 0}, {41, 1}, {42, 2}, {43, 3}, {44, 5}, {45, 6}});
    const auto source = open_direct_source(params);
    const CultureCells chunk = source->load_classes({{-6, 16}, {-6, 16}});
    CHECK(class_at(chunk, -6, -6) == 9);
    CHECK(class_at(chunk, 6, 0) == 9);
    CHECK(class_at(chunk, 4, 4) == 9);  // no-data
    CHECK(class_at(chunk, 5, 2) == 6);
    CHECK(class_at(chunk, 2, 3) == unknown_class);
    REQUIRE(chunk.codes.size() == chunk.classes.size());
    CHECK(chunk.codes[static_cast<std::size_t>((3 + 6) * 22 + 2 + 6)] == 777);
    CHECK(source->load_classes({{9, 15}, {-6, 15}}).codes.empty());
}

TEST_CASE("classes of whole culture tiles are the same when they are asked for again", "[source]") {
    const Folder folder;
    // In strips that are not packed, and packed as GDAL alone unpacks them.
    const bool by_gdal = GENERATE(false, true);
    Drawing d;
    d.columns = 600;
    d.rows = 300;
    if (by_gdal) d.creation = {"COMPRESS=LZMA", "LZMA_PRESET=0"};
    draw(folder / "dem.tif", d);
    Drawing k = d;
    k.type = GDT_Int16;
    k.no_data = -1;
    const auto code_of = [](std::int64_t c, std::int64_t r) {
        return c == 100 && r == 70 ? 777 : c % 31 == 5 ? -1 : static_cast<int>(40 + (c / 3 + 2 * r) % 4);
    };
    k.value = [&](int c, int r) { return code_of(c, r); };
    draw(folder / "codes.tif", k);
    DataBaseParams params = only(folder / "dem.tif");
    params.culture = folder / "codes.tif";
    params.default_class = 9;
    params.legend = Legend("drawn", {{40, 0}, {41, 1}, {42, 2}, {43, 3}});
    params.cache_bytes = GENERATE(std::size_t{0}, std::size_t{20000}, std::size_t{1240000}, std::size_t{1} << 22);
    CAPTURE(params.cache_bytes, by_gdal);
    const auto source = open_direct_source(params);
    const DataBase& db = source->data_base();
    const std::int64_t wide = db.culture_tile_columns, high = db.culture_tile_rows;
    REQUIRE((wide < k.columns && high < k.rows));
    // Layers that GDAL reads stay in its cache where they fit, whatever is kept of classes.
    const auto layers = static_cast<GIntBig>(2 * k.columns * k.rows) + static_cast<GIntBig>(4 * d.columns * d.rows);
    if (by_gdal && static_cast<GIntBig>(params.cache_bytes) >= layers) CHECK(GDALGetCacheMax64() >= layers);
    std::vector<CultureCells> first;
    for (int time = 0; time < 3; ++time) {
        std::size_t at = 0;
        std::int64_t wrong = 0;
        // Beyond the raster's edges too; and between two tiles.
        for (std::int64_t row = -1; row <= k.rows / high + 1; ++row)
            for (std::int64_t column = -1; column <= k.columns / wide + 1; ++column, ++at) {
                const Window tile{{column * wide, (column + 1) * wide}, {row * high, (row + 1) * high}};
                const CultureCells cells = source->load_classes(tile);
                REQUIRE(cells.window == tile);
                for (std::int64_t r = tile.rows.begin; r < tile.rows.end; ++r)
                    for (std::int64_t c = tile.columns.begin; c < tile.columns.end; ++c) {
                        const bool in = c >= 0 && r >= 0 && c < k.columns && r < k.rows;
                        const int code = in ? code_of(c, r) : -1;
                        wrong += class_at(cells, c, r) != (code == -1    ? ClassId{9}
                                                           : code == 777 ? unknown_class
                                                                         : static_cast<ClassId>(code - 40));
                    }
                CHECK(cells.codes.empty() == !(tile.columns.contains(100) && tile.rows.contains(70)));
                if (time == 0) first.push_back(cells);
                CHECK(cells.bytes_read == first[at].bytes_read);
            }
        CHECK(wrong == 0);
        CHECK(class_at(source->load_classes({{wide - 3, wide + 3}, {4, 8}}), wide, 5) == (wide / 3 + 10) % 4);
        const std::uint64_t touched = source->skipped()[static_cast<std::size_t>(Skip::none)].posts;
        CHECK(touched == static_cast<std::uint64_t>(k.columns * k.rows));
    }
}

TEST_CASE("extremes are those of all posts, however many threads look for them", "[source][threads]") {
    const Folder folder;
    Drawing d;
    d.columns = 1500;
    d.rows = 1100;
    d.type = GDT_Int16;
    d.no_data = -7;
    d.creation = GENERATE(
        values<std::vector<std::string>>({{}, {"COMPRESS=DEFLATE"}, {"TILED=YES", "COMPRESS=LZMA", "LZMA_PRESET=0"}}));
    d.value = [](int c, int r) {
        return c == 1499 && r == 1099 ? -300
               : c == 700 && r == 3   ? 4000
               : (c + r) % 50 == 0    ? -7
                                      : (c * 31 + r * 17) % 900;
    };
    draw(folder / "dem.tif", d);
    Drawing h = d;
    h.no_data = std::nullopt;
    h.value = [](int c, int r) { return c == 12 && r == 900 ? 5000 : (c + r) % 3; };
    draw(folder / "height.tif", h);
    std::uint64_t voids = 0;
    float highest = 0;
    for (int r = 0; r < d.rows; ++r)
        for (int c = 0; c < d.columns; ++c) {
            if (d.value(c, r) == -7)
                ++voids;
            else
                highest = std::max(highest, static_cast<float>(d.value(c, r) + h.value(c, r)));
        }
    for (const int threads : {1, 2, 7}) {
        CAPTURE(threads);
        DataBaseParams params = only(folder / "dem.tif");
        params.threads = threads;
        params.cache_bytes = std::size_t{64} << 20;
        const auto found = [&] {
            Extremes e;
            Threads(threads).execute([&] { e = open_direct_source(params)->extremes(); });
            return e;
        };
        const Extremes bare = found();
        CHECK(bare.any_valid);
        CHECK(bare.lowest_m == -300);
        CHECK(bare.highest_m == 4000);
        CHECK(bare.void_posts == voids);
        params.culture_height = folder / "height.tif";
        const Extremes high = found();
        CHECK(high.lowest_m == -300);
        CHECK(high.highest_m == highest);
        CHECK(high.void_posts == voids);
    }
    // Of several posts that are no heights the first in the file's order is named.
    d.type = GDT_Float32;
    d.value = [](int c, int r) {
        return (c == 1400 && r == 300) || (c == 3 && r == 1000) ? std::numeric_limits<double>::infinity() : 1;
    };
    draw(folder / "dem.tif", d);
    DataBaseParams params = only(folder / "dem.tif");
    params.threads = 4;
    params.cache_bytes = std::size_t{64} << 20;
    Threads(params.threads).execute([&] {
        CHECK_THAT(test::refusal<DataError>([&] { open_direct_source(params)->extremes(); }),
                   Contains("column 1400, row 300"));
    });
}

TEST_CASE("rasters whose windows decode many posts are read directly where all of them stay decoded", "[source]") {
    GDALSetCacheMax64(GIntBig{64} << 20);  // sources leave less; a tile drawn row by row would be packed for each
    const Folder folder;
    Drawing d;
    d.columns = 6000;
    d.rows = 500;
    d.creation = {"COMPRESS=DEFLATE"};
    Scene scene;
    scene.platform.xy = PointXY{1000, 1000};
    const auto chosen = [&](const DataBaseParams& params) {
        return choose_source(params, SourceKind::automatic, scene, std::size_t{1} << 30);
    };
    const std::size_t all = std::size_t{6000} * 500 * 4 + 500 * TileCache::entry_bytes;
    SECTION("strips that are unpacked here, each once for all threads") {
        draw(folder / "dem.tif", d);
        DataBaseParams params = only(folder / "dem.tif");
        params.threads = 8;
        params.cache_bytes = all / 3 * 4 - 100;
        CHECK(chosen(params).spilled);
        CHECK_THAT(chosen(params).why, Contains("a window would decode 6 times the posts"));
        params.cache_bytes = all / 3 * 4 + 100;
        CHECK_FALSE(chosen(params).spilled);
        params.cache_bytes = all / 2;
        CHECK(chosen(params).spilled);
        params.more_cache_bytes = all;
        CHECK_FALSE(chosen(params).spilled);
        CHECK_THAT(chosen(params).why, Contains("rows of 6000 x ") && Contains("all 12 MiB fit into the cache"));
        const auto source = open_direct_source(params);
        CHECK(source->cache_bytes() >= all);
        CHECK(source->cache_bytes() <= all + all / 6);
        // All posts in windows that cut every strip: what is held are all strips, once.
        Chunk chunk;
        for (std::int64_t c = 0; c < 6000; c += 500) chunk = source->load({{c, c + 500}, {0, 500}}, false);
        CHECK(source->held_bytes() >= all);
        params.by_strips = true;
        CHECK(open_direct_source(params)->cache_bytes() >= all);
        // Those that are turned are unpacked too.
        d.creation = {"ENDIANNESS=BIG"};
        draw(folder / "dem.tif", d);
        CHECK_FALSE(chosen(params).spilled);
        CHECK(open_direct_source(params)->cache_bytes() >= all);
    }
    SECTION("what is read as it is takes no room, but for wide tiles") {
        DataBaseParams params = only(folder / "dem.tif");
        params.cache_bytes = all / 2;
        d.creation = {};
        draw(folder / "dem.tif", d);
        CHECK_FALSE(chosen(params).spilled);
        CHECK_THAT(chosen(params).why, Contains("rows of 6000 x 1") && !Contains("fit into"));
        d.creation = {"TILED=YES", "BLOCKXSIZE=8192", "BLOCKYSIZE=16"};
        draw(folder / "dem.tif", d);
        CHECK(chosen(params).spilled);
        params.cache_bytes = 2 * all;
        CHECK_FALSE(chosen(params).spilled);
        CHECK_THAT(chosen(params).why, !Contains("fit into"));
    }
    SECTION("what GDAL decodes, for each thread") {
        d.creation = {"COMPRESS=LZMA", "LZMA_PRESET=0", "BLOCKYSIZE=50"};
        draw(folder / "dem.tif", d);
        DataBaseParams params = only(folder / "dem.tif");
        params.cache_bytes = 3 * all;
        params.more_cache_bytes = 8 * all;
        for (const int threads : {1, 2, 3, 4, 8}) {
            params.threads = threads;
            CHECK(chosen(params).spilled == (threads > 3));
        }
    }
    SECTION("large tiles count whole") {
        d.columns = 1100;
        d.rows = 1100;
        d.creation = {"TILED=YES", "BLOCKXSIZE=1024", "BLOCKYSIZE=1024", "COMPRESS=LZMA", "LZMA_PRESET=0"};
        draw(folder / "dem.tif", d);
        DataBaseParams params = only(folder / "dem.tif");
        params.cache_bytes = std::size_t{2048} * 2048 * 4;
        CHECK_THAT(chosen(params).why, Contains("all 16 MiB fit"));
        params.cache_bytes -= 1;
        CHECK_THAT(chosen(params).why, !Contains("fit"));
        // They would be unpacked for strip after strip.
        CHECK(chosen(params).spilled);
        CHECK(chosen(params).only_faster);
        const SourceChoice rather = choose_source(params, SourceKind::direct_for_memory, scene, std::size_t{1} << 30);
        CHECK_FALSE(rather.spilled);
        CHECK_THAT(rather.why, Contains("sorted it would take more memory"));
        // What is not packed is read again as easily.
        d.creation = {"TILED=YES", "BLOCKXSIZE=1024", "BLOCKYSIZE=1024"};
        draw(folder / "plain.tif", d);
        std::ofstream(folder / "dem.vrt")
            << "<VRTDataset rasterXSize='1100' "
               "rasterYSize='1100'><SRS>EPSG:32611</SRS><GeoTransform>1000,10,0,2000,0,-10</GeoTransform>"
               "<VRTRasterBand dataType='Float32' band='1'><SimpleSource><SourceFilename relativeToVRT='1'>plain.tif"
               "</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>";
        params = only(folder / "dem.vrt");
        params.cache_bytes = std::size_t{1} << 20;
        CHECK_FALSE(chosen(params).spilled);
    }
}

TEST_CASE("an image packed as a whole is decoded once, in whatever order its rows are asked for", "[source]") {
    GDALSetCacheMax64(GIntBig{64} << 20);
    const Folder folder;
    Drawing d;
    d.columns = d.rows = 1200;
    d.type = GDT_UInt16;
    d.value = [](int c, int r) { return (c * 31 + r * 17) % 5000; };
    draw(folder / "dem.tif", d);
    {
        const std::unique_ptr<GDALDataset> plain(GDALDataset::Open((folder / "dem.tif").c_str()));
        GDALDriver* const png = GetGDALDriverManager()->GetDriverByName("PNG");
        REQUIRE((plain && png));
        const std::unique_ptr<GDALDataset> made(
            png->CreateCopy((folder / "dem.png").c_str(), plain.get(), FALSE, nullptr, nullptr, nullptr));
        REQUIRE(made);
    }
    const auto seconds = [&](bool from_below) {
        const auto source = open_direct_source(only(folder / "dem.png"));
        std::vector<float> row(1200);
        const std::clock_t start = std::clock();
        bool right = true;
        for (std::int64_t i = 0; i < 1200; ++i) {
            const std::int64_t r = from_below ? 1199 - i : i;
            source->read_bare_terrain({{0, 1200}, {r, r + 1}}, row.data());
            right = right && row[7] == static_cast<float>((7 * 31 + r * 17) % 5000);
        }
        CHECK(right);
        return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    };
    const double down = seconds(false), up = seconds(true);
    INFO("downwards " << down << " s, upwards " << up
                      << " s");  // hundreds of times as long, were each row decoded anew
    CHECK(up < 20 * down + 0.05);
    DataBaseParams small = only(folder / "dem.png");
    small.cache_bytes = 1 << 20;
    CHECK(choose_source(small, SourceKind::automatic, {}, std::size_t{1} << 30).spilled);
}

TEST_CASE("culture in another CRS is refused with the gdalwarp line that mends it", "[source]") {
    const Folder folder;
    Drawing d;  // near 33.8 N, 117.5 W
    d.columns = d.rows = 60;
    d.geotransform = {{453000, 30, 0, 3741000, 0, -30}};
    draw(folder / "dem.tif", d);
    Drawing k = d;
    k.type = GDT_Byte;
    k.crs = "EPSG:4326";
    k.geotransform = {{-117.52, 0.0005, 0, 33.82, 0, -0.0005}};
    k.columns = 48;  // not all of the terrain
    k.rows = 100;
    k.value = [](int c, int r) { return 1 + (c / 25 + r / 25) % 3; };
    draw(folder / "codes.tif", k);
    DataBaseParams params = only(folder / "dem.tif");
    params.culture = folder / "codes.tif";
    params.legend = Legend("drawn", {{1, 1}, {2, 2}, {3, 3}});
    const std::string message = test::refusal<DataError>([&] { open_direct_source(params); });
    INFO(message);
    CHECK_THAT(message,
               Contains("EPSG:4326") && Contains("-r near -dstnodata 255 -tr 30 30 -te 453000 3739200 454800 3741000"));
    const std::size_t line = message.find("gdalwarp ");
    REQUIRE(line != std::string::npos);
    if (std::system("command -v gdalwarp > /dev/null") == 0) {
        REQUIRE(std::system((message.substr(line) + " > /dev/null").c_str()) == 0);
        params.culture = folder / "codes_warped.tif";
        const CultureCells chunk = open_direct_source(params)->load_classes({{0, 60}, {0, 60}});
        CHECK(chunk.codes.empty());
        CHECK(std::count(chunk.classes.begin(), chunk.classes.end(), ClassId{2}) > 100);
        // Where there is no culture, and nothing of class 0 either.
        CHECK(std::count(chunk.classes.begin(), chunk.classes.end(), params.default_class) > 1000);
    }
}

TEST_CASE("culture that does not touch the terrain is refused with both extents", "[source]") {
    const Folder folder;
    Drawing d;
    draw(folder / "dem.tif", d);
    d.geotransform = {{5000, 10, 0, 2000, 0, -10}};
    draw(folder / "far.tif", d);
    DataBaseParams params = only(folder / "dem.tif");
    params.culture = folder / "far.tif";
    params.legend = Legend::built_in("nlcd");
    CHECK_THROWS_WITH(open_direct_source(params), Contains("x 5000 to 5040") && Contains("x 1000 to 1040"));
}

TEST_CASE("culture given from 0 to 360 degrees lies under terrain given from -180 to 180", "[source]") {
    const Folder folder;
    Drawing d;
    d.columns = d.rows = 10;
    d.crs = "EPSG:4326";
    d.geotransform = {{-20.5, 1, 0, 5, 0, -1}};
    draw(folder / "dem.tif", d);
    Drawing k = d;
    k.columns = 360;
    k.type = GDT_Int16;
    k.geotransform = {{-0.5, 1, 0, 5, 0, -1}};
    k.value = [](int c, int) { return c; };
    draw(folder / "codes.tif", k);
    std::map<int, ClassId> classes;
    for (int c = 0; c < 360; ++c) classes[c] = static_cast<ClassId>(c % 200);
    DataBaseParams params = only(folder / "dem.tif");
    params.culture = folder / "codes.tif";
    params.legend = Legend("drawn", classes);
    const auto source = open_direct_source(params);
    const DataBase& b = source->data_base();
    const auto first = static_cast<std::int64_t>(std::floor(b.culture_column_offset));
    const CultureCells chunk = source->load_classes({{first, first + 10}, {0, 10}});
    for (int c = 0; c < 10; ++c) {
        const auto cell = static_cast<std::int64_t>(std::floor(b.culture_column_offset + c * b.culture_column_scale));
        CHECK(class_at(chunk, cell, 5) == (360 - 20 + c) % 200);
    }
}

TEST_CASE("many threads read the same posts through one source", "[source][threads]") {
    const Folder folder;
    // A VRT: its sources must not be shared between handles.
    const std::string vrt = folder / "coast.vrt";
    {
        GDALDataset* in = GDALDataset::Open((data + "/olympic_coast_dem.tif").c_str());
        GDALDataset* out =
            GetGDALDriverManager()->GetDriverByName("VRT")->CreateCopy(vrt.c_str(), in, 0, nullptr, nullptr, nullptr);
        GDALClose(out);
        GDALClose(in);
    }
    const auto source = open_direct_source(only(vrt));
    const auto sum = [&](int part) {
        const Chunk chunk =
            source->load({{part * 200, part * 200 + 600}, {100 * part, 100 * part + 700}}, part % 2 == 1);
        double total = 0;
        for (float z : chunk.surface_m) total += std::isnan(z) ? 1e6 : static_cast<double>(z);
        return total;
    };
    std::vector<double> alone(8);
    for (int part = 0; part < 8; ++part) alone[static_cast<std::size_t>(part)] = sum(part);
    std::vector<std::vector<double>> together(4, std::vector<double>(8));
    std::vector<std::thread> threads;
    for (std::size_t t = 0; t < together.size(); ++t)
        threads.emplace_back([&, t] {
            for (int k = 0; k < 8; ++k) {
                const int part = (k + static_cast<int>(t) * 3) % 8;
                together[t][static_cast<std::size_t>(part)] = sum(part);
            }
        });
    for (std::thread& thread : threads) thread.join();
    for (const auto& sums : together) CHECK(sums == alone);
}

TEST_CASE("a post is as long as it is on the ground, in degrees and in a projection that stretches", "[source]") {
    const Folder folder;
    const auto longest_m = [&](const char* crs, const std::array<double, 6>& place, LatLon at) {
        Drawing flat;
        flat.columns = flat.rows = 64;
        flat.crs = crs;
        flat.geotransform = place;
        flat.value = [](int, int) { return 100.0; };
        draw(folder / "flat.tif", flat);
        DataBaseParams params;
        params.dem = folder / "flat.tif";
        const auto source = open_direct_source(params);
        Scene s;
        s.platform.latlon = at;
        s.platform.altitude_m = 1000;
        s.range_m = 500;
        return promise_of(resolve(s, *source)).from_m * s.radar.antenna.beam.rad() / 2;
    };
    // WGS84: a degree of longitude at 70 N is 38188 m, one of latitude 111562 m; a unit of Web Mercator at 60 N about half a metre.
    const double across = 38188 * 6e-4, along = 111562 * 2.5e-4;
    CHECK(longest_m("EPSG:4326", {{20, 6e-4, 0, 70.008, 0, -2e-4}}, {70, 20.019}) == Approx(across).epsilon(1e-3));
    CHECK(longest_m("EPSG:4326", {{20, 6e-4, 0, 70.008, 0, -2.5e-4}}, {70, 20.019}) == Approx(along).epsilon(1e-3));
    CHECK(longest_m("EPSG:3857", {{2226000, 60, 0, 8401700, 0, -60}}, {60, 20.013}) == Approx(30).epsilon(0.005));
}
