// Features burnt into a tile store: the cells that they cover and no others, the same whatever the windows and the file's order,
// in any CRS; and what a radar sees of them.
#include <catch2/catch.hpp>

#include <gdal_alg.h>
#include <gdal_priv.h>
#include <ogrsf_frmts.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <random>
#include <set>

#include "lib/block_map.hpp"
#include "lib/error.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/json.hpp"
#include "tests/program.hpp"
#include "tests/refusal.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/store_check.hpp"
#include "tiles/tile_store.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using wedgescope::test::draw;
using wedgescope::test::Drawing;
using wedgescope::test::Ended;
using wedgescope::test::Folder;
using wedgescope::test::refusal;
using Strings = std::vector<std::string>;

namespace {

const std::string data = WEDGESCOPE_TEST_DATA;
const std::string dem = data + "/inland_empire_dem.tif";
const GdalSession session(std::size_t{16} << 20, {});

// The shipped ground: 1600 x 1600 cells of 30 m, UTM zone 11.
constexpr int side = 1600;
constexpr double west = 429717.925899235007819, north = 3764093.077020850032568, step = 30;
double x_at(double column) { return west + step * column; }
double y_at(double row) { return north - step * row; }

/// From easting and northing to longitude and latitude, WGS84.
std::unique_ptr<OGRCoordinateTransformation> to_degrees(const char* crs) {
    OGRSpatialReference own, wgs84;
    own.SetFromUserInput(crs);
    wgs84.importFromEPSG(4326);
    for (auto* each : {&own, &wgs84}) each->SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    return std::unique_ptr<OGRCoordinateTransformation>(OGRCreateCoordinateTransformation(&own, &wgs84));
}

/// A GeoJSON of features whose coordinates are columns and rows of the shipped ground, in its own CRS.
class GeoJson {
public:
    using Places = std::vector<std::pair<double, double>>;
    GeoJson& add(const char* type, const Places& places, const nlohmann::json& fields) {
        nlohmann::json coordinates = nlohmann::json::array();
        for (const auto& [c, r] : places) coordinates.push_back({x_at(c), y_at(r)});
        if (std::string(type) == "Point") coordinates = coordinates[0];
        if (std::string(type) == "Polygon") coordinates = nlohmann::json::array({coordinates});
        features_.push_back({{"type", "Feature"},
                             {"properties", fields},
                             {"geometry", {{"type", type}, {"coordinates", coordinates}}}});
        return *this;
    }
    /// From column and row on, up to the last ones.
    GeoJson& add_box(int c0, int r0, int c1, int r1, const nlohmann::json& fields) {
        return add("Polygon", {{c0, r0}, {c1, r0}, {c1, r1}, {c0, r1}, {c0, r0}}, fields);
    }
    std::string write(const std::string& path) const {
        const nlohmann::json all{{"type", "FeatureCollection"},
                                 {"crs", {{"type", "name"}, {"properties", {{"name", "urn:ogc:def:crs:EPSG::32611"}}}}},
                                 {"features", features_}};
        std::ofstream(path) << all.dump();
        return path;
    }

private:
    nlohmann::json features_ = nlohmann::json::array();
};

struct Cells {
    int columns = 0, rows = 0;
    std::vector<float> values;
    std::string type;
    double no_data = 0;
    float at(int c, int r) const {
        return values[static_cast<std::size_t>(r) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(c)];
    }
};
Cells cells_of(const std::string& path) {
    GDALDataset* file = GDALDataset::FromHandle(GDALOpen(path.c_str(), GA_ReadOnly));
    if (!file) throw std::runtime_error("cannot open " + path);
    Cells out{file->GetRasterXSize(), file->GetRasterYSize(), {}, "", 0};
    out.values.resize(static_cast<std::size_t>(out.columns) * static_cast<std::size_t>(out.rows));
    GDALRasterBand* band = file->GetRasterBand(1);
    out.type = GDALGetDataTypeName(band->GetRasterDataType());
    out.no_data = band->GetNoDataValue();
    const CPLErr read = band->RasterIO(GF_Read, 0, 0, out.columns, out.rows, out.values.data(), out.columns, out.rows,
                                       GDT_Float32, 0, 0, nullptr);
    GDALClose(file);
    if (read != CE_None) throw std::runtime_error("cannot read " + path);
    return out;
}

TileStoreParams into(const std::string& output, const std::string& features, const std::string& culture = "",
                     const std::string& height = "", double unit_m = 1, bool touch = false) {
    TileStoreParams params;
    params.dems = {dem};
    params.output = output;
    params.culture = culture;
    params.culture_height = height;
    params.memory_bytes = std::size_t{256} << 20;
    params.cache_bytes = std::size_t{16} << 20;
    params.threads = 2;
    params.software = "test";
    params.features = FeatureParams{features, "", touch, *Legend::built_in("smc"), {}};
    params.culture_height_scale = unit_m;
    if (!culture.empty()) params.legend = Legend::built_in("fbfm40");
    params.legend = with_features(params.legend, {});
    params.legend_name = params.legend->name();
    params.legend_csv = params.legend->csv({});
    return params;
}

constexpr int metal = 15, urban = 11, concrete = 12;

}  // namespace

TEST_CASE("features burn the cells that they cover over codes and heights, and no others", "[features]") {
    const Folder folder;
    const std::string culture = data + "/inland_empire_culture.tif", canopy = data + "/inland_empire_canopy.tif";
    GeoJson file;
    file.add_box(400, 500, 410, 520, {{"material", "metal"}, {"height", 20}});
    file.add("LineString", {{600.5, 600.5}, {640.5, 620.5}}, {{"SMC", 9}});
    file.add("Point", {{700.2, 701.7}}, {{"SMC", "1"}, {"height", 35.5}});
    file.add_box(405, 510, 415, 530, {{"material", "Urban"}, {"height", 0}});
    file.add_box(100, 100, 102, 102, {{"height", "7"}});
    file.add_box(-50, 1590, 3, 1700, {{"material", "metal"}});  // over the corner
    file.write(folder / "features.json");
    write_tile_store(into(folder / "store", folder / "features.json", culture, canopy, 0.1));

    const Cells before = cells_of(culture), after = cells_of(folder / "store/culture.vrt");
    CHECK(after.type == "Int32");
    std::set<std::pair<int, int>> line;
    int changed = 0, wrong = 0;
    for (int r = 0; r < side; ++r)
        for (int c = 0; c < side; ++c) {
            const auto code = static_cast<int>(after.at(c, r));
            int expected = static_cast<int>(before.at(c, r));
            if (expected == -9999) expected = INT32_MIN;
            if (c >= 400 && c < 410 && r >= 500 && r < 520) expected = 30000 + metal;
            if (c >= 405 && c < 415 && r >= 510 && r < 530) expected = 30000 + urban;
            if (c == 700 && r == 701) expected = 30000 + metal;
            if (c < 3 && r >= 1590) expected = 30000 + metal;
            if (code == 30000 + concrete) {
                line.emplace(c, r);
                continue;
            }
            changed += code >= 30000;
            wrong += code != expected;
        }
    CHECK(wrong == 0);
    CHECK(changed == 200 + 200 - 50 + 1 + 30);
    // One cell in each column of the line, half a cell off at the most.
    REQUIRE(line.size() == 41);
    for (int c = 600; c <= 640; ++c) {
        const auto at = std::find_if(line.begin(), line.end(), [&](const auto& cell) { return cell.first == c; });
        REQUIRE(at != line.end());
        CHECK(std::fabs(at->second - (600 + 0.5 * (c - 600))) <= 0.5);
    }

    const Cells low = cells_of(canopy), high = cells_of(folder / "store/culture_height.vrt");
    CHECK(high.type == "Float32");
    wrong = 0;
    for (int r = 0; r < side; ++r)
        for (int c = 0; c < side; ++c) {
            float expected = low.at(c, r);  // tenths of a metre
            if (expected == -9999) expected = NAN;
            if (c >= 400 && c < 410 && r >= 500 && r < 520) expected = 200;
            if (c == 700 && r == 701) expected = 355;
            if (c >= 100 && c < 102 && r >= 100 && r < 102) expected = 70;
            const float found = high.at(c, r);
            wrong += !(found == expected || (std::isnan(found) && std::isnan(expected)));
        }
    CHECK(wrong == 0);
    // The block map knows them: it decides what may stay unread.
    const auto map = TileStore(folder / "store").block_map(0.1);
    const BlockWindow blocks = map->read(0, blocks_of({{690, 710}, {695, 705}}));
    CHECK_THAT(static_cast<double>(blocks.at(700 / 32, 701 / 32).culture_m), WithinAbs(35.5, 1e-4));
    // The legend of the store names the codes of both.
    const Legend legend = TileStore(folder / "store").legend({}).value();
    CHECK(legend.find(98) == ClassId{0});
    CHECK(legend.find(30015) == ClassId{15});
}

TEST_CASE("what touches a cell burns it where that is asked for", "[features]") {
    const Folder folder;
    GeoJson file;
    file.add("LineString", {{600.5, 600.5}, {640.5, 620.5}}, {{"SMC", 9}});
    file.add("Polygon", {{300.2, 300.2}, {302.8, 300.2}, {302.8, 302.8}, {300.2, 302.8}, {300.2, 300.2}}, {{"SMC", 1}});
    file.write(folder / "features.json");
    const auto count = [&](const std::string& store, bool touch, int code) {
        write_tile_store(into(folder / store, folder / "features.json", "", "", 1, touch));
        const Cells found = cells_of(folder / (store + "/culture.vrt"));
        CHECK(found.type == "Byte");
        CHECK(found.no_data == 255);
        return std::count(found.values.begin(), found.values.end(), static_cast<float>(code));
    };
    // Centres in 300.2 .. 302.8: 300.5, 301.5, 302.5, both ways.
    CHECK(count("centres", false, metal) == 9);
    CHECK(count("centres2", false, concrete) == 41);
    CHECK(count("touched", true, metal) == 9);
    // A line of slope 1/2 enters two cells where it changes the row: 40 columns and 20 rows on.
    CHECK(count("touched2", true, concrete) == 61);
    CHECK_FALSE(std::filesystem::exists(folder / "touched/culture_height.vrt"));  // no field of a height
}

TEST_CASE("features in latitude and longitude come to lie where the terrain has them", "[features]") {
    const Folder folder;
    const auto to = to_degrees("EPSG:32611");
    nlohmann::json features = nlohmann::json::array();
    std::set<std::pair<int, int>> expected;
    std::mt19937 random(7);
    for (int i = 0; i < 60; ++i) {
        const int c = static_cast<int>(random() % side), r = static_cast<int>(random() % side);
        double x = x_at(c + 0.3), y = y_at(r + 0.6);
        REQUIRE(to->Transform(1, &x, &y));
        features.push_back({{"type", "Feature"},
                            {"properties", {{"smc", 1}, {"HGT", 10}}},
                            {"geometry", {{"type", "Point"}, {"coordinates", {x, y}}}}});
        expected.emplace(c, r);
    }
    std::ofstream(folder / "points.geojson")
        << nlohmann::json{{"type", "FeatureCollection"}, {"features", features}}.dump();
    write_tile_store(into(folder / "store", folder / "points.geojson"));
    const Cells codes = cells_of(folder / "store/culture.vrt"), heights = cells_of(folder / "store/culture_height.vrt");
    std::set<std::pair<int, int>> found;
    int wrong = 0;
    for (int r = 0; r < side; ++r)
        for (int c = 0; c < side; ++c) {
            const bool there = codes.at(c, r) == metal;
            if (there) found.emplace(c, r);
            wrong += heights.at(c, r) != (there ? 10.0F : 0.0F);
            wrong += !there && codes.at(c, r) != 255;
        }
    CHECK(found == expected);
    CHECK(wrong == 0);
}

namespace {

/// A terrain in latitude and longitude, and features drawn in its columns and rows (0: the western, northern edge) that a file holds
/// in another CRS.
class InDegrees {
public:
    InDegrees(const Folder& folder, double first_lon, double first_lat, double wide, double high, int columns, int rows)
        : folder_(folder), west_(first_lon), north_(first_lat), wide_(wide), high_(high), columns_(columns),
          rows_(rows) {
        GDALDataset* dataset = GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
            (folder / "degrees.tif").c_str(), columns, rows, 1, GDT_Int16, nullptr);
        double grid[] = {first_lon, wide, 0, first_lat, 0, -high};
        dataset->SetGeoTransform(grid);
        OGRSpatialReference wgs84;
        wgs84.importFromEPSG(4326);
        dataset->SetSpatialRef(&wgs84);
        dataset->GetRasterBand(1)->Fill(100);
        GDALClose(dataset);
    }
    using Places = std::vector<std::pair<double, double>>;
    /// Straight from place to place in columns and rows, in pieces of at most a quarter of one or so.
    static Places dense(const Places& corners) {
        Places all{corners[0]};
        for (std::size_t i = 1; i < corners.size(); ++i) {
            const auto [c0, r0] = corners[i - 1];
            const auto [c1, r1] = corners[i];
            const int pieces = static_cast<int>(4 * std::max(std::abs(c1 - c0), std::abs(r1 - r0))) + 1;
            for (int k = 1; k <= pieces; ++k)
                all.emplace_back(c0 + (c1 - c0) * k / pieces, r0 + (r1 - r0) * k / pieces);
        }
        return all;
    }
    static Places box(double c0, double r0, double c1, double r1) {
        return dense({{c0, r0}, {c1, r0}, {c1, r1}, {c0, r1}, {c0, r0}});
    }
    /// The cells that become metal, row after row. `rings`: one for a LineString.
    std::vector<bool> burnt(const char* type, const std::vector<Places>& rings, const char* crs) const {
        OGRSpatialReference own, wgs84;
        own.SetFromUserInput(crs);
        wgs84.importFromEPSG(4326);
        for (auto* each : {&own, &wgs84}) each->SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
        const std::unique_ptr<OGRCoordinateTransformation> to(OGRCreateCoordinateTransformation(&wgs84, &own));
        nlohmann::json coordinates = nlohmann::json::array();
        for (const Places& ring : rings) {
            nlohmann::json line = nlohmann::json::array();
            for (const auto& [c, r] : ring) {
                double x = west_ + c * wide_, y = north_ - r * high_;
                REQUIRE(to->Transform(1, &x, &y));
                line.push_back({x, y});
            }
            coordinates.push_back(line);
        }
        const nlohmann::json feature{
            {"type", "Feature"},
            {"properties", {{"smc", 1}}},
            {"geometry",
             {{"type", type},
              {"coordinates", rings.size() == 1 && std::string(type) == "LineString" ? coordinates[0] : coordinates}}}};
        const nlohmann::json all{{"type", "FeatureCollection"},
                                 {"crs", {{"type", "name"}, {"properties", {{"name", crs}}}}},
                                 {"features", nlohmann::json::array({feature})}};
        std::ofstream(folder_ / "f.geojson") << all.dump();
        std::filesystem::remove_all(folder_ / "store");
        TileStoreParams params = into(folder_ / "store", folder_ / "f.geojson");
        params.dems = {folder_ / "degrees.tif"};
        write_tile_store(params);
        const Cells codes = cells_of(folder_ / "store/culture.vrt");
        std::vector<bool> metal_there;
        for (const float code : codes.values) metal_there.push_back(code == static_cast<float>(metal));
        return metal_there;
    }
    /// As many cells as differ from what `inside` says.
    int wrong(const std::vector<bool>& burnt, const std::function<bool(int c, int r)>& inside) const {
        int differ = 0;
        for (int r = 0; r < rows_; ++r)
            for (int c = 0; c < columns_; ++c)
                differ += burnt[static_cast<std::size_t>(r * columns_ + c)] != inside(c, r);
        return differ;
    }

private:
    const Folder& folder_;
    double west_, north_, wide_, high_;
    int columns_, rows_;
};

}  // namespace

TEST_CASE("areas and lines go on across the antimeridian and round a pole", "[features]") {
    const Folder folder;
    const auto within = [](int v, int from, int to) { return v >= from && v < to; };
    // The middle column of the first and the second lies at 180 degrees, the third is far from it.
    for (const double first_lon : {-180.03, 179.97, 12.0}) {
        const InDegrees ground(folder, first_lon, 50, 0.0005, 0.0003, 120, 120);
        for (const char* crs : {"EPSG:32601", "EPSG:32660", "EPSG:3832"}) {
            if (first_lon == 12 && std::string(crs) != "EPSG:3832") continue;
            INFO("from " << first_lon << " in " << crs);
            const auto area = ground.burnt("Polygon", {ground.box(20, 30, 100, 90)}, crs);
            CHECK(ground.wrong(area, [&](int c, int r) { return within(c, 20, 100) && within(r, 30, 90); }) == 0);
            const auto holed = ground.burnt("Polygon", {ground.box(20, 30, 100, 90), ground.box(50, 40, 70, 80)}, crs);
            CHECK(ground.wrong(holed, [&](int c, int r) {
                return within(c, 20, 100) && within(r, 30, 90) && !(within(c, 50, 70) && within(r, 40, 80));
            }) == 0);
            const auto line = ground.burnt("LineString", {ground.dense({{10.5, 50.5}, {110.5, 50.5}})}, crs);
            CHECK(ground.wrong(line, [&](int c, int r) { return r == 50 && within(c, 10, 111); }) == 0);
        }
        // In degrees of another datum, half a second away: in two parts that meet at 180 degrees, as files have them.
        for (const char* crs : {"EPSG:4322"}) {
            INFO("from " << first_lon << " in " << crs);
            const auto parts = ground.burnt(
                "MultiLineString",
                {ground.dense({{20.1, 40.3}, {59.4, 40.3}}), ground.dense({{60.6, 40.3}, {99.6, 40.3}})}, crs);
            CHECK(ground.wrong(parts, [&](int c, int r) { return r == 40 && within(c, 20, 100); }) <= 1);
        }
    }
    const InDegrees circle(folder, -180, 85, 1, 0.05, 360, 40);
    // Over the seam of a raster that goes round the earth.
    const auto across = circle.burnt("Polygon", {circle.box(350, 10, 370, 30)}, "EPSG:3413");
    CHECK(circle.wrong(across, [&](int c, int r) { return (c < 10 || c >= 350) && within(r, 10, 30); }) == 0);
    // What goes round the pole covers all that is nearer to it.
    const auto cap = circle.burnt("Polygon", {circle.dense({{0, 20}, {360, 20}})}, "EPSG:3413");
    CHECK(circle.wrong(cap, [](int, int r) { return r < 20; }) == 0);
    const auto ring =
        circle.burnt("Polygon", {circle.dense({{0, 20}, {360, 20}}), circle.dense({{0, 5}, {360, 5}})}, "EPSG:3413");
    CHECK(circle.wrong(ring, [&](int, int r) { return within(r, 5, 20); }) == 0);
    // Where nothing bends, edges are as long as the file has them; wider than half the earth, too.
    const InDegrees earth(folder, -180, 60, 1, 1, 360, 120);
    for (const auto& [from, to] : {std::pair(10, 350), std::pair(79, 281), std::pair(100, 260)}) {
        const auto wide =
            earth.burnt("Polygon", {{{from, 20}, {to, 20}, {to, 90}, {from, 90}, {from, 20}}}, "EPSG:4087");
        CHECK(earth.wrong(wide, [&](int c, int r) { return within(c, from, to) && within(r, 20, 90); }) == 0);
        const auto line = earth.burnt("LineString", {{{from + 0.5, 50.5}, {to - 0.5, 50.5}}}, "EPSG:4087");
        CHECK(earth.wrong(line, [&](int c, int r) { return r == 50 && within(c, from, to); }) == 0);
    }
}

TEST_CASE("edges of degrees lie where they do on the earth, however long, whatever the tiles", "[features][long]") {
    const Folder folder;
    const auto to = to_degrees("EPSG:32611");
    constexpr double parallel = 33.85, from = -117.7, until = -117.3;
    using Ring = std::vector<std::vector<double>>;
    const auto box = [](double west_deg, double east_deg, double south_deg) {
        return Ring{{west_deg, south_deg},
                    {east_deg, south_deg},
                    {east_deg, parallel},
                    {west_deg, parallel},
                    {west_deg, south_deg}};
    };
    const auto burnt = [&](const char* type, const nlohmann::json& coordinates, std::int64_t tile_posts) {
        const nlohmann::json one = {{"type", "Feature"},
                                    {"properties", {{"smc", 1}}},
                                    {"geometry", {{"type", type}, {"coordinates", coordinates}}}};
        std::ofstream(folder / "one.geojson")
            << nlohmann::json{{"type", "FeatureCollection"}, {"features", {one}}}.dump();
        auto params = into(folder / "store", folder / "one.geojson");
        params.tile_posts = tile_posts;
        params.overwrite = true;
        write_tile_store(params);
        return cells_of(folder / "store/culture.vrt");
    };
    // Of the middles of cells.
    std::vector<double> x, y;
    for (int r = 0; r < side; ++r)
        for (int c = 0; c < side; ++c) x.push_back(x_at(c + 0.5)), y.push_back(y_at(r + 0.5));
    REQUIRE(to->Transform(static_cast<int>(x.size()), x.data(), y.data()));
    constexpr double doubt_deg = 0.02 * step / 111e3;
    struct Case {
        double west_deg, east_deg, south_deg;
        bool hole;
    };
    for (const Case& one : {Case{-123, -112, 33, false}, Case{from, until, 33, false}, Case{-180, 180, -90, false},
                            Case{-123, -112, 33, true}}) {
        CAPTURE(one.west_deg, one.hole);
        nlohmann::json rings = nlohmann::json::array({box(one.west_deg, one.east_deg, one.south_deg)});
        if (one.hole) rings.push_back(box(from, until, 33.7));
        const Cells codes = burnt("Polygon", rings, 64);
        CHECK(burnt("Polygon", rings, 512).values == codes.values);
        int wrong = 0, in = 0;
        for (std::size_t i = 0; i < x.size(); ++i) {
            const auto beside = [&](double deg, double edge) { return std::fabs(deg - edge) < doubt_deg; };
            if (beside(y[i], parallel) || beside(x[i], from) || beside(x[i], until) || beside(y[i], 33.7)) continue;
            const bool hole = one.hole && x[i] > from && x[i] < until && y[i] > 33.7;
            const bool inside = y[i] < parallel && x[i] > one.west_deg && x[i] < one.east_deg && !hole;
            wrong += inside != (codes.values[i] == metal);
            in += inside;
        }
        CHECK(wrong == 0);
        CHECK(in > 100000);
    }
    // A line has one cell in each column, the one that the parallel passes through, or, as GDAL rounds, the next one.
    for (const double half_deg : {0.2, 3.0}) {
        CAPTURE(half_deg);
        const Ring line{{-117.5 - half_deg, parallel}, {-117.5 + half_deg, parallel}};
        const Cells codes = burnt("LineString", line, 64);
        CHECK(burnt("LineString", line, 512).values == codes.values);
        int columns = 0, far = 0;
        for (int c = 0; c < side; ++c)
            for (int r = 0; r < side; ++r) {
                if (codes.at(c, r) != metal) continue;
                ++columns;
                const double lat = y[static_cast<std::size_t>(r) * side + static_cast<std::size_t>(c)];
                far += std::fabs(lat - parallel) > 1.02 * step / 110.9e3;
            }
        CHECK(columns == (half_deg > 1 ? side : 1234));
        CHECK(far == 0);
    }
}

TEST_CASE("a feature that goes far beyond windows and poles is whole, and no tile shows", "[features]") {
    const Folder folder;
    using Ring = std::vector<std::vector<double>>;
    struct Ground {
        const char* crs;
        int columns, rows;
        double step_m, x, y;
    };
    const Ground ground = GENERATE(
        Ground{"EPSG:32633", 4096, 320, 90, 315000, 6100000}, Ground{"EPSG:3413", 400, 400, 40, -8000, 8000},
        Ground{"EPSG:3995", 512, 512, 4000, -1024000, 1024000}, Ground{"EPSG:32601", 700, 400, 500, 150000, 7000000});
    INFO(ground.crs);
    Drawing d;
    d.columns = ground.columns;
    d.rows = ground.rows;
    d.type = GDT_Int16;
    d.crs = ground.crs;
    d.geotransform = {ground.x, ground.step_m, 0, ground.y, 0, -ground.step_m};
    draw(folder / "dem.tif", d);
    const auto burnt = [&](const std::vector<nlohmann::json>& polygons, std::int64_t tile_posts) {
        nlohmann::json features = nlohmann::json::array();
        for (const nlohmann::json& rings : polygons)
            features.push_back({{"type", "Feature"},
                                {"properties", {{"smc", 1}}},
                                {"geometry", {{"type", "Polygon"}, {"coordinates", rings}}}});
        std::ofstream(folder / "far.geojson")
            << nlohmann::json{{"type", "FeatureCollection"}, {"features", features}}.dump();
        auto params = into(folder / "store", folder / "far.geojson");
        params.dems = {folder / "dem.tif"};
        params.tile_posts = tile_posts;
        params.overwrite = true;
        write_tile_store(params);
        return cells_of(folder / "store/culture.vrt");
    };
    // Middles of cells in degrees, and what one step of the raster is there at most.
    const auto to = to_degrees(ground.crs);
    std::vector<double> x, y;
    for (int r = 0; r < d.rows; ++r)
        for (int c = 0; c < d.columns; ++c)
            x.push_back(ground.x + (c + 0.5) * ground.step_m), y.push_back(ground.y - (r + 0.5) * ground.step_m);
    REQUIRE(to->Transform(static_cast<int>(x.size()), x.data(), y.data()));
    const double doubt_deg = 0.02 * ground.step_m / 111e3;
    const double lowest = *std::min_element(y.begin(), y.end()), highest = *std::max_element(y.begin(), y.end());
    // All that lies north of a parallel in the middle, and the world without that.
    const double parallel = 0.5 * (lowest + highest);
    const auto band = [](double south, double north) {
        return Ring{{-180, south}, {180, south}, {180, north}, {-180, north}, {-180, south}};
    };
    for (const bool hole : {false, true}) {
        CAPTURE(hole);
        nlohmann::json rings = nlohmann::json::array({hole ? band(-85, 90) : band(parallel, 90)});
        if (hole) rings.push_back(band(parallel, 90));
        const Cells codes = burnt({rings}, 64);
        CHECK(burnt({rings}, 512).values == codes.values);
        int wrong = 0, in = 0;
        for (std::size_t i = 0; i < x.size(); ++i) {
            if (std::fabs(y[i] - parallel) < doubt_deg) continue;
            const bool inside = (y[i] > parallel) != hole;
            wrong += inside != (codes.values[i] == metal);
            in += inside;
        }
        CHECK(wrong == 0);
        CHECK(in > d.columns * d.rows / 10);
    }
    // Edges at a slant through many windows.
    std::mt19937 random(5);
    const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
    std::vector<nlohmann::json> slanted;
    const double spread_deg = 2 * (highest - lowest);
    for (int i = 0; i < 12; ++i) {
        const std::size_t at = random() % x.size();
        Ring ring;
        for (int k = 0; k < 4; ++k)
            ring.push_back({std::clamp(x[at] + 3 * spread_deg * (unit() - 0.5), -180.0, 180.0),
                            std::clamp(y[at] + spread_deg * (unit() - 0.5), -90.0, 90.0)});
        ring.push_back(ring.front());
        slanted.push_back(nlohmann::json::array({ring}));
    }
    const Cells codes = burnt(slanted, 64);
    CHECK(std::count(codes.values.begin(), codes.values.end(), static_cast<float>(metal)) > 100);
    CHECK(burnt(slanted, 512).values == codes.values);
}

TEST_CASE("neither tiles nor the file's order or format show, and GDAL burns the whole raster alike",
          "[features][long]") {
    const Folder folder;
    // Triangles at random, over one another and over the edges; the last in the file is the topmost.
    std::mt19937 random(20);
    const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
    struct Triangle {
        GeoJson::Places places;
        int smc;
        double height;
    };
    std::vector<Triangle> triangles;
    for (int i = 0; i < 150; ++i) {
        const double c = 1700 * unit() - 50, r = 1700 * unit() - 50, size = i % 10 == 0 ? 900 : 60;
        Triangle t;
        for (int k = 0; k < 3; ++k) t.places.emplace_back(c + size * (unit() - 0.5), r + size * (unit() - 0.5));
        t.places.push_back(t.places[0]);
        t.smc = 1 + i % 4;
        t.height = i % 3 == 0 ? 0 : 1 + i;
        triangles.push_back(t);
    }
    GeoJson file;
    for (const Triangle& t : triangles) file.add("Polygon", t.places, {{"SMC", t.smc}, {"height", t.height}});
    file.write(folder / "features.json");
    write_tile_store(into(folder / "store", folder / "features.json"));
    const Cells codes = cells_of(folder / "store/culture.vrt"), heights = cells_of(folder / "store/culture_height.vrt");

    // The same in a GeoPackage, whose index gives them in an order of its own, in other tiles.
    {
        GDALAllRegister();
        GDALDataset* out = GetGDALDriverManager()->GetDriverByName("GPKG")->Create((folder / "features.gpkg").c_str(),
                                                                                   0, 0, 0, GDT_Unknown, nullptr);
        REQUIRE(out);
        OGRSpatialReference utm;
        utm.importFromEPSG(32611);
        OGRLayer* layer = out->CreateLayer("features", &utm, wkbPolygon);
        OGRFieldDefn smc("SMC", OFTInteger), height("height", OFTReal);
        REQUIRE(layer->CreateField(&smc) == OGRERR_NONE);
        REQUIRE(layer->CreateField(&height) == OGRERR_NONE);
        for (const Triangle& t : triangles) {
            OGRFeature feature(layer->GetLayerDefn());
            feature.SetField("SMC", t.smc);
            feature.SetField("height", t.height);
            OGRLinearRing ring;
            for (const auto& [c, r] : t.places) ring.addPoint(x_at(c), y_at(r));
            OGRPolygon polygon;
            polygon.addRing(&ring);
            feature.SetGeometry(&polygon);
            REQUIRE(layer->CreateFeature(&feature) == OGRERR_NONE);
        }
        GDALClose(out);
    }
    TileStoreParams other = into(folder / "other", folder / "features.gpkg");
    other.tile_posts = 64;
    other.threads = 1;
    write_tile_store(other);
    CHECK(cells_of(folder / "other/culture.vrt").values == codes.values);
    CHECK(cells_of(folder / "other/culture_height.vrt").values == heights.values);

    // GDAL over the whole raster at once, in the file's order.
    const auto whole = [&](const auto& value, float nothing) {
        GDALDataset* raster =
            GetGDALDriverManager()->GetDriverByName("MEM")->Create("", side, side, 1, GDT_Float32, nullptr);
        double terms[] = {west, step, 0, north, 0, -step};
        raster->SetGeoTransform(terms);
        raster->GetRasterBand(1)->Fill(static_cast<double>(nothing));
        for (const Triangle& t : triangles) {
            const double burnt = value(t);
            if (burnt <= 0) continue;
            OGRLinearRing ring;
            for (const auto& [c, r] : t.places) ring.addPoint(x_at(c), y_at(r));
            OGRPolygon polygon;
            polygon.addRing(&ring);
            OGRGeometryH shape = OGRGeometry::ToHandle(&polygon);
            int band = 1;
            REQUIRE(GDALRasterizeGeometries(GDALDataset::ToHandle(raster), 1, &band, 1, &shape, nullptr, nullptr,
                                            &burnt, nullptr, nullptr, nullptr) == CE_None);
        }
        std::vector<float> values(static_cast<std::size_t>(side) * side);
        REQUIRE(raster->GetRasterBand(1)->RasterIO(GF_Read, 0, 0, side, side, values.data(), side, side, GDT_Float32, 0,
                                                   0, nullptr) == CE_None);
        GDALClose(raster);
        return values;
    };
    const int class_of_smc[] = {-1, 15, 14, 11, 10};
    CHECK(whole([&](const Triangle& t) { return static_cast<double>(class_of_smc[t.smc]); }, 255) == codes.values);
    CHECK(whole([](const Triangle& t) { return t.height; }, 0) == heights.values);
    CHECK(std::count(codes.values.begin(), codes.values.end(), 15.0F) > 10000);
}

TEST_CASE("features of a wrong field, class, height or layer are named", "[features]") {
    const Folder folder;
    const auto says = [&](const nlohmann::json& fields, const Strings& words) {
        GeoJson file;
        file.add("Point", {{5.5, 5.5}}, {{"SMC", 1}, {"height", 3}});
        file.add("Point", {{6.5, 6.5}}, fields).write(folder / "f.json");
        const std::string found = refusal([&] { write_tile_store(into(folder / "store", folder / "f.json")); });
        for (const std::string& word : words) CHECK_THAT(found, Contains(word));
        CHECK_FALSE(std::filesystem::exists(folder / "store"));
        CHECK_FALSE(std::filesystem::exists(folder / "store.part"));
    };
    says({{"SMC", 15}}, {"features '", "f.json', layer 'f', feature 1: SMC is '15'", "legend smc", "metal"});
    says({{"material", "mud"}}, {"material is 'mud'", "marsh"});
    says({{"height", -1}}, {"height is '-1'", "metres from 0"});
    says({{"height", 1e6}}, {"height is '1000000"});
    says({{"HGT", "tall"}, {"height", nullptr}}, {"HGT is 'tall'"});

    GeoJson().add("Point", {{5.5, 5.5}}, {{"colour", 1}}).write(folder / "plain.json");
    CHECK_THAT(refusal([&] { write_tile_store(into(folder / "store", folder / "plain.json")); }),
               Contains("no field for a material or a height") && Contains("colour"));
    CHECK_THAT(refusal([&] { write_tile_store(into(folder / "store", folder / "none.json")); }),
               Contains("none.json' cannot be opened"));
    GeoJson().add("Point", {{5.5, 5.5}}, {{"SMC", 1}}).write(folder / "good.json");
    TileStoreParams named = into(folder / "store", folder / "good.json");
    named.features->layer = "roads";
    CHECK_THAT(refusal([&] { write_tile_store(named); }), Contains("features-layer is 'roads'") && Contains("good"));
    // A raster whose own codes are those of features.
    Drawing codes;
    codes.columns = codes.rows = 40;
    codes.type = GDT_UInt16;
    codes.geotransform = {west, step, 0, north, 0, -step};
    codes.value = [](int c, int r) { return c == 7 && r == 9 ? 30014 : 98; };
    draw(folder / "codes.tif", codes);
    CHECK_THAT(refusal([&] { write_tile_store(into(folder / "store", folder / "good.json", folder / "codes.tif")); }),
               Contains("codes.tif': code at column 7, row 9 is 30014") && Contains("good.json"));
    CHECK_THAT(refusal([&] { with_features(Legend("x", {{30254, 1}, {30003, 2}}), {}); }), Contains("code 30003"));
}

TEST_CASE("features that all lie off the terrain are remarked on", "[features]") {
    const Folder folder;
    GeoJson far, near;
    far.add_box(90000, 5, 90010, 9, {{"SMC", 1}}).write(folder / "far.json");
    near.add_box(90000, 5, 90010, 9, {{"SMC", 1}}).add("Point", {{5.5, 5.5}}, {{"SMC", 1}}).write(folder / "near.json");
    CHECK(write_tile_store(into(folder / "far", folder / "far.json")).features_lie_elsewhere);
    CHECK_FALSE(write_tile_store(into(folder / "near", folder / "near.json")).features_lie_elsewhere);
    const Ended ended = wedgescope::test::run_program(
        {WEDGESCOPE_PROGRAM, "tile", dem, folder / "again", "--features", folder / "far.json"}, folder / "err");
    CHECK(ended.code == 0);
    CHECK_THAT(ended.err, Contains("none lies on a cell of the terrain"));
}

TEST_CASE("names that a shapefile has cut are those fields too, and fields that are left out are named", "[features]") {
    const Folder folder;
    GeoJson file;
    file.add_box(100, 100, 110, 110,
                 {{"surface_material_category", 1},
                  {"predominant_height", 12},
                  {"directivity", "uni"},
                  {"axis", 90},
                  {"owner", "x"},
                  {"height_ft", 40}});
    file.write(folder / "f.geojson");
    GDALAllRegister();
    GDALDataset* const in =
        GDALDataset::FromHandle(GDALOpenEx((folder / "f.geojson").c_str(), GDAL_OF_VECTOR, nullptr, nullptr, nullptr));
    REQUIRE(in);
    GDALDataset* const out = GetGDALDriverManager()
                                 ->GetDriverByName("ESRI Shapefile")
                                 ->CreateCopy((folder / "f.shp").c_str(), in, FALSE, nullptr, nullptr, nullptr);
    REQUIRE(out);
    GDALClose(out);
    GDALClose(in);
    for (const std::string name : {"geojson", "shp"}) {
        const Ended ended = wedgescope::test::run_program(
            {WEDGESCOPE_PROGRAM, "tile", dem, folder / ("of_" + name), "--features", folder / ("f." + name)},
            folder / "err");
        INFO(ended.err);
        REQUIRE(ended.code == 0);
        CHECK_THAT(ended.err, Contains("fields that are left out: 'height_ft', 'owner'\n"));
    }
    for (const char* layer : {"/culture.vrt", "/culture_height.vrt"})
        CHECK(cells_of(folder / "of_shp" + layer).values == cells_of(folder / "of_geojson" + layer).values);
    CHECK(cells_of(folder / "of_shp/culture_height.vrt").at(105, 105) == 12);
    CHECK(std::filesystem::exists(folder / "of_shp/classes.csv"));
}

TEST_CASE("options of features are checked", "[features]") {
    const Folder folder;
    const std::string file = GeoJson().add("Point", {{5.5, 5.5}}, {{"SMC", 1}}).write(folder / "f.json");
    const auto refuses = [&](const Strings& more, int code, const Strings& words) {
        Strings all{WEDGESCOPE_PROGRAM, "tile", dem, folder / "store"};
        all.insert(all.end(), more.begin(), more.end());
        const Ended ended = wedgescope::test::run_program(all, folder / "err");
        INFO(ended.err);
        CHECK(ended.code == code);
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
        for (const std::string& word : words) CHECK_THAT(ended.err, Contains(word));
        CHECK_FALSE(std::filesystem::exists(folder / "store"));
    };
    refuses({"--features-touch", "on"}, 2, {"features-touch is given without features"});
    refuses({"--features-layer", "x"}, 2, {"features-layer is given without features"});
    refuses({"--features", dem}, 1, {"features '", "inland_empire_dem.tif' cannot be opened"});
    refuses({"--features", file, "--features-legend", "none"}, 1, {"features-legend 'none' is none of"});
    refuses({"--features", file, "--features-layer", "roads"}, 2, {"features-layer is 'roads'"});
    refuses({"--features", file, "--culture-height-scale", "0"}, 2, {"culture-height-scale is 0"});
    refuses({"--features", file, "--culture", data + "/inland_empire_culture.tif"}, 2, {"without culture-legend"});
}

TEST_CASE("a radar sees burnt metal by its gamma, and nothing else changes", "[features][long]") {
    const Folder folder;
    const auto run = [&](const Strings& arguments) {
        Strings all{WEDGESCOPE_PROGRAM};
        all.insert(all.end(), arguments.begin(), arguments.end());
        const Ended ended = wedgescope::test::run_program(all, folder / "err");
        INFO(ended.err);
        REQUIRE(ended.code == 0);
    };
    // North of the sensor at post (800, 800): 100 to 150 posts off, ten to either side.
    GeoJson().add_box(790, 650, 811, 700, {{"SMC", 1}}).write(folder / "metal.json");
    GeoJson().add("Point", {{5.5, 5.5}}, {{"SMC", 1}}).write(folder / "away.json");  // classes take spokes of their own
    GeoJson().add("Point", {{800.5, 650.5}}, {{"SMC", 1}, {"HGT", 300}}).write(folder / "tower.json");
    GeoJson().add("Point", {{5.5, 5.5}}, {{"SMC", 1}, {"HGT", 300}}).write(folder / "far.json");
    run({"tile", dem, folder / "plain", "--features", folder / "away.json", "-q"});
    run({"tile", dem, folder / "far", "--features", folder / "far.json", "-q"});
    run({"tile", dem, folder / "metal", "--features", folder / "metal.json", "-q"});
    run({"tile", dem, folder / "tower", "--features", folder / "tower.json", "-q"});
    const auto echo = [&](const std::string& store, const Strings& more = {}) {
        Strings arguments{"simulate",
                          "--dem",
                          folder / store,
                          "--xy",
                          "453732.925899,3740078.07702",
                          "--altitude-agl",
                          "1500m",
                          "--refine",
                          "off",
                          "--geometry",
                          "grid",
                          "--range",
                          "7km",
                          "--azimuth-bins",
                          "360",
                          "--range-bin",
                          "60m",
                          "--echo",
                          folder / (store + ".tif"),
                          "--overwrite",
                          "-q"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        run(arguments);
        return cells_of(folder / (store + ".tif"));
    };
    const Cells plain = echo("plain"), bright = echo("metal");
    REQUIRE(plain.values.size() == bright.values.size());
    const float most = *std::max_element(plain.values.begin(), plain.values.end());
    // Metal 6 dB, soil -17 dB.
    const double step_up = std::pow(10.0, 2.3);
    int full = 0, same = 0, outside = 0, beyond = 0;
    for (int a = 0; a < plain.rows; ++a)
        for (int j = 0; j < plain.columns; ++j) {
            if (plain.at(j, a) < 1e-4F * most) continue;
            const double ratio = static_cast<double>(bright.at(j, a)) / static_cast<double>(plain.at(j, a));
            full += std::fabs(ratio / step_up - 1) < 1e-3;
            same += std::fabs(ratio - 1) < 1e-4;
            beyond += ratio < 1 - 1e-3 || ratio > step_up * (1 + 1e-3);
            // 3000 to 4500 m along the ground, from 2985 by half a post more; 315 m to either side: 6.1 degrees.
            const bool there = (a <= 7 || a >= 352) && j * 60 > 2900 && j * 60 < 5500;
            outside += !there && std::fabs(ratio - 1) > 1e-3;
        }
    CHECK(beyond == 0);
    CHECK(outside == 0);
    CHECK(full > 50);
    CHECK(same > 10000);

    // A tower of one cell hides what is behind it and shows its wall; culled or not it does the same.
    const Cells far = echo("far"), tower = echo("tower"), uncut = echo("tower", {"--no-cull"});
    CHECK(tower.values == uncut.values);
    CHECK(tower.values != far.values);
    outside = 0;
    for (int a = 5; a < 355; ++a)
        for (int j = 0; j < plain.columns; ++j) outside += tower.at(j, a) != far.at(j, a);
    CHECK(outside == 0);
}

TEST_CASE("a feature with a side of its own becomes a class of its own", "[features]") {
    const Folder folder;
    GeoJson file;
    file.add_box(100, 100, 110, 110, {{"material", "metal"}, {"directivity", "uni"}, {"axis", 90.4}});
    file.add_box(120, 100, 130, 110, {{"SMC", 1}, {"directivity", "2"}, {"axis_deg", "-100"}});
    file.add_box(140, 100, 150, 110, {{"SMC", 1}, {"directivity", "Omni-directional"}});
    file.add_box(160, 100, 170, 110, {{"SMC", 1}});
    file.add_box(180, 100, 190, 110, {{"height", 5}, {"directivity", "uni"}, {"axis", 10}});  // no material
    file.add_box(200, 100, 210, 110, {{"SMC", 3}, {"directivity", "1"}, {"axis", 359.7}});
    file.write(folder / "f.json");
    const FeatureParams plain{folder / "f.json", "", false, *Legend::built_in("smc"), {}};
    const SidedClasses classes = sided_classes({}, plain, std::nullopt);
    FeatureParams params = plain;
    params.materials = classes.materials;
    params.axis_step_deg = classes.axis_step_deg;
    CHECK(params.axis_step_deg == 1);
    REQUIRE(params.materials.size() == 19);
    const auto row = [&](const char* name) { return params.materials[params.materials.by_name("material", name)]; };
    CHECK(row("metal-uni-090").directivity == Directivity::uni);
    CHECK(row("metal-uni-090").axis_deg == 90);
    CHECK(row("metal-uni-090").gamma10_db == 6.0);
    CHECK(row("metal-uni-090").gamma_wall10_db == 15.0);
    CHECK(row("metal-bi-080").axis_deg == 80);
    CHECK(row("urban-uni-000").directivity == Directivity::uni);
    CHECK(row("urban-uni-000").structures == material_table()[urban].structures);

    TileStoreParams store = into(folder / "store", folder / "f.json");
    store.features = params;
    store.legend = with_features(std::nullopt, params.materials);
    write_tile_store(store);
    const Cells codes = cells_of(folder / "store/culture.vrt");
    const auto id = [&](const char* name) { return static_cast<float>(params.materials.by_name("material", name)); };
    CHECK(codes.at(105, 105) == id("metal-uni-090"));
    CHECK(codes.at(125, 105) == id("metal-bi-080"));
    CHECK(codes.at(145, 105) == metal);
    CHECK(codes.at(165, 105) == metal);
    CHECK(codes.at(185, 105) == 255);
    CHECK(codes.at(205, 105) == id("urban-uni-000"));
    // Where the class itself has a side, that is the feature's too unless it says otherwise.
    FeatureParams sided = plain;
    sided.materials = Materials::from_csv("table", "name,directivity,axis_deg\nmetal,uni,90\n");
    const SidedClasses same = sided_classes(sided.materials, sided, std::nullopt);
    CHECK(same.materials.size() == 19);
    CHECK_FALSE(same.materials.find("metal-uni-090"));
    CHECK(same.materials.find("metal-omni"));
    // What the table of an earlier store says of such a class stays, unless it looks another way; water has no side.
    FeatureParams again = plain;
    again.materials = Materials::from_csv(
        "table", "name,gamma10_db,directivity,axis_deg\nmetal-uni-090,-40,uni,90\nmetal-omni,-30,omni,\n");
    const SidedClasses kept = sided_classes(again.materials, again, std::nullopt);
    CHECK(kept.sides == 3);
    CHECK(kept.materials.size() == 20);
    CHECK(kept.materials[kept.materials.by_name("material", "metal-uni-090")].gamma10_db == -40.0);
    again.materials = Materials::from_csv("table", "name,gamma10_db,directivity,axis_deg\nmetal-uni-090,-40,uni,80\n");
    CHECK_THROWS_WITH(sided_classes(again.materials, again, std::nullopt),
                      Contains("'metal-uni-090' with another side"));
    GeoJson()
        .add("Point", {{5.5, 5.5}}, {{"material", "water"}, {"directivity", "uni"}, {"axis", 3}})
        .write(folder / "w.json");
    CHECK(sided_classes({}, FeatureParams{folder / "w.json", "", false, *Legend::built_in("smc"), {}}, std::nullopt)
              .sides == 0);
    // A name that grows too long is refused before anything is written.
    FeatureParams wordy = plain;
    wordy.path = folder / "l.json";
    wordy.materials = Materials::from_csv("table", "name,gamma10_db\na-name-of-one-and-forty-letters-and-no-more,-4\n");
    GeoJson()
        .add("Point", {{5.5, 5.5}},
             {{"material", "a-name-of-one-and-forty-letters-and-no-more"}, {"directivity", "uni"}, {"axis", 3}})
        .write(folder / "l.json");
    CHECK_THROWS_WITH(sided_classes(wordy.materials, wordy, std::nullopt), Contains("at most 48 characters"));
    // Without any directivity there is nothing to add.
    GeoJson().add("Point", {{5.5, 5.5}}, {{"SMC", 1}, {"axis", 3}}).write(folder / "plain.json");
    CHECK(sided_classes({}, FeatureParams{folder / "plain.json", "", false, *Legend::built_in("smc"), {}}, std::nullopt)
              .axis_step_deg == 0);
}

TEST_CASE("axes of more classes than there is room for are rounded", "[features]") {
    const Folder folder;
    GeoJson file;
    for (int i = 0; i < 360; ++i)
        file.add("Point", {{i + 0.5, 5.5}}, {{"SMC", 1 + i % 2}, {"directivity", i % 3 ? "uni" : "bi"}, {"axis", i}});
    file.write(folder / "f.json");
    FeatureParams params{folder / "f.json", "", false, *Legend::built_in("smc"), {}};
    const SidedClasses classes = sided_classes({}, params, std::nullopt);
    params.materials = classes.materials;
    params.axis_step_deg = classes.axis_step_deg;
    // In steps of one degree and of two 240 axes of uni and 60 of bi; in steps of three 120 and 60.
    CHECK(params.axis_step_deg == 3);
    CHECK(params.materials.size() <= 255);
    for (std::size_t id = 16; id < params.materials.size(); ++id)
        CHECK(std::fmod(params.materials[id].axis_deg, 3) == 0);
    TileStoreParams store = into(folder / "store", folder / "f.json");
    store.features = params;
    store.legend = with_features(std::nullopt, params.materials);
    write_tile_store(store);
    const Cells codes = cells_of(folder / "store/culture.vrt");
    int wrong = 0;
    for (int i = 0; i < 360; ++i) {
        const Material& m = params.materials[static_cast<std::size_t>(codes.at(i, 5))];
        const bool bi = i % 3 == 0;
        const double off = std::remainder(m.axis_deg - i, bi ? 180 : 360);
        wrong += m.directivity != (bi ? Directivity::bi : Directivity::uni) || std::fabs(off) > 1.5 ||
                 m.gamma10_db != material_table()[static_cast<std::size_t>(15 - i % 2)].gamma10_db;
    }
    CHECK(wrong == 0);
}

TEST_CASE("a feature's wrong side is named", "[features]") {
    const Folder folder;
    const auto says = [&](const nlohmann::json& fields, const Strings& words) {
        GeoJson file;
        file.add("Point", {{5.5, 5.5}}, {{"SMC", 1}});
        file.add("Point", {{6.5, 6.5}}, fields).write(folder / "f.json");
        const Ended ended = wedgescope::test::run_program(
            {WEDGESCOPE_PROGRAM, "tile", dem, folder / "store", "--features", folder / "f.json"}, folder / "err");
        INFO(ended.err);
        CHECK(ended.code == 1);
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
        for (const std::string& word : words) CHECK_THAT(ended.err, Contains(word));
        CHECK_FALSE(std::filesystem::exists(folder / "store"));
    };
    says({{"SMC", 1}, {"directivity", "left"}, {"axis", 3}},
         {"feature 1: directivity is 'left'", "omni, uni or bi, or 1 (uni), 2 (bi), 3 (omni)"});
    says({{"SMC", 1}, {"directivity", "uni"}},
         {"feature 1: directivity is 'uni'", "axis, degrees clockwise from north"});
    says({{"SMC", 1}, {"directivity", "bi"}, {"axis", 361}}, {"axis is '361'", "degrees from -360 to 360"});
    says({{"SMC", 1}, {"directivity", 3}, {"axis", "x"}, {"material", "mud"}}, {"material is 'mud'"});
}

TEST_CASE("a radar sees a burnt feature by its side, and a scene over the store needs no table", "[features][long]") {
    const Folder folder;
    const auto run = [&](const Strings& arguments, int code = 0) {
        Strings all{WEDGESCOPE_PROGRAM};
        all.insert(all.end(), arguments.begin(), arguments.end());
        const Ended ended = wedgescope::test::run_program(all, folder / "err");
        INFO(ended.err);
        REQUIRE(ended.code == code);
        return ended.err;
    };
    // Metal north of the sensor at post (800, 800), alike; looking to the south, north and west; and beside these what is not.
    const auto box = [&](const char* name, const nlohmann::json& more) {
        nlohmann::json fields{{"SMC", 1}};
        fields.update(more);
        GeoJson().add_box(790, 650, 811, 700, fields).write(folder / (std::string(name) + ".json"));
        run({"tile", dem, folder / name, "--features", folder / (std::string(name) + ".json"), "-q"});
    };
    box("omni", nlohmann::json::object());
    box("south", {{"directivity", "uni"}, {"axis", 180}});
    box("north", {{"directivity", "uni"}, {"axis", 0}});
    box("both", {{"directivity", "bi"}, {"axis", 0}});
    box("aside", {{"directivity", "bi"}, {"axis", -45}});
    CHECK_FALSE(std::filesystem::exists(folder / "omni/classes.csv"));
    CHECK(std::filesystem::exists(folder / "south/classes.csv"));
    CHECK(verify_store(folder / "south", nullptr, {}).damage.empty());
    std::filesystem::rename(folder / "south/classes.csv", folder / "classes.csv");
    CHECK_THAT(verify_store(folder / "south", nullptr, {}).damage.at(0), Contains("south/classes.csv' is missing"));
    std::filesystem::rename(folder / "classes.csv", folder / "south/classes.csv");
    const Strings place{"--xy",
                        "453732.925899,3740078.07702",
                        "--altitude-agl",
                        "1500m",
                        "--geometry",
                        "grid",
                        "--range",
                        "7km",
                        "--azimuth-bins",
                        "360",
                        "--range-bin",
                        "60m",
                        "-q"};
    const auto echo = [&](const std::string& store, const Strings& more = {}, const std::string& name = "") {
        const std::string out = folder / ((name.empty() ? store : name) + ".tif");
        Strings arguments{"simulate", "--dem", folder / store, "--echo", out};
        arguments.insert(arguments.end(), place.begin(), place.end());
        arguments.insert(arguments.end(), more.begin(), more.end());
        run(arguments);
        return cells_of(out);
    };
    const Cells alike = echo("omni"), south = echo("south"), north = echo("north"), both = echo("both"),
                aside = echo("aside");
    // A cell full of metal, 3300 to 4300 m along the ground, at half a degree: the gain of its side there.
    const auto ratio = [&](const Cells& a, int row, int j) {
        return static_cast<double>(a.at(j, row)) / static_cast<double>(alike.at(j, row));
    };
    for (const int row : {0, 1, 2, 358, 359}) {
        const double azimuth = (row + 0.5) * std::acos(-1.0) / 180;
        for (const int j : {62, 66, 70}) {
            INFO(row << ", " << j);
            CHECK_THAT(ratio(south, row, j), WithinRel(std::pow(std::cos(azimuth), 4), 2e-3));
            CHECK_THAT(ratio(north, row, j), WithinRel(0.01, 2e-3));
            CHECK_THAT(ratio(both, row, j), WithinRel(std::pow(std::cos(azimuth), 4), 2e-3));
            CHECK_THAT(ratio(aside, row, j), WithinRel(std::pow(std::cos(azimuth + std::acos(-1.0) / 4), 4), 5e-3));
        }
    }
    // Elsewhere it is the same to the bit; and so is the picture however it is come by.
    for (int row = 20; row < 340; ++row)
        for (int j = 0; j < alike.columns; ++j)
            if (south.at(j, row) != alike.at(j, row)) FAIL(row << ", " << j);
    CHECK(echo("south", {"--source", "spilled", "--wedges", "7"}, "spilled").values == south.values);
    CHECK(echo("south", {"--class-table", folder / "south/classes.csv", "--no-cull"}, "given").values == south.values);
    // The layer response has it, post by post.
    const auto response = [&](const std::string& store) {
        Strings arguments{"coverage", "--layer", "response"};
        for (std::size_t i = 0; i < 8; ++i) arguments.push_back(place[i]);
        arguments.insert(arguments.end(), {"-q", folder / store, folder / (store + "_dbm.tif")});
        run(arguments);
        return cells_of(folder / (store + "_dbm.tif"));
    };
    const Cells dbm = response("omni"), dbm_north = response("north");
    CHECK_THAT(static_cast<double>(dbm.at(800, 675) - dbm_north.at(800, 675)), WithinAbs(20, 1e-3));
    CHECK(dbm.at(800, 720) == dbm_north.at(800, 720));
    // A table of one's own without these classes is refused, and says where they are.
    std::ofstream(folder / "mine.csv") << "corn,-14\n";
    Strings own{"simulate",         "--dem",         folder / "south",   "--echo",
                folder / "own.tif", "--class-table", folder / "mine.csv"};
    own.insert(own.end(), place.begin(), place.end());
    const std::string refused = run(own, 2);
    CHECK_THAT(refused, Contains("'metal-uni-180'") && Contains("south/classes.csv"));
    // A scope needs neither, and a spill can be kept round a point.
    run({"scope", folder / "south.tif", "-o", folder / "scope.png", "-q"});
    run({"tile", "--around", "33.8,-117.5", folder / "south", "-q"});
}

TEST_CASE("a raster says which side of culture's cells reflects, and features lie over it", "[features][long]") {
    const Folder folder;
    const auto run = [&](const Strings& arguments, int code = 0) {
        Strings all{WEDGESCOPE_PROGRAM};
        all.insert(all.end(), arguments.begin(), arguments.end());
        const Ended ended = wedgescope::test::run_program(all, folder / "err");
        INFO(ended.err);
        REQUIRE(ended.code == code);
        return ended.err;
    };
    // Codes of smc: metal, brick and no data in stripes of rows; sides in blocks of columns.
    Drawing culture;
    culture.columns = culture.rows = 200;
    culture.type = GDT_Byte;
    culture.no_data = 0;
    culture.geotransform = {x_at(700), step, 0, y_at(600), 0, -step};
    culture.value = [](int, int r) { return r < 80 ? 1 : r < 160 ? 3 : 0; };
    draw(folder / "culture.tif", culture);
    Drawing side = culture;
    side.type = GDT_Int16;
    side.no_data = -1;
    side.value = [](int c, int) { return c < 40 ? 180 : c < 80 ? 360 + 45 : c < 120 ? 540 : c < 160 ? 359 : -1; };
    draw(folder / "side.tif", side);
    GeoJson().add_box(710, 610, 720, 620, {{"SMC", 1}, {"directivity", "uni"}, {"axis", 90}}).write(folder / "f.json");
    const Strings tile{"tile",
                       dem,
                       folder / "store",
                       "--culture",
                       folder / "culture.tif",
                       "--culture-legend",
                       "smc",
                       "--directivity",
                       folder / "side.tif",
                       "-q"};
    Strings both = tile;
    both.insert(both.end(), {"--features", folder / "f.json", "--around", "33.8,-117.5"});
    run(both);
    const Cells codes = cells_of(folder / "store/culture.vrt");
    CHECK(codes.type == "Int16");
    std::ifstream file(folder / "store/classes.csv");
    const Materials table = Materials::from_csv("classes.csv", std::string(std::istreambuf_iterator<char>(file), {}));
    CHECK(table.size() == 16 + 3 + 3 + 1);
    const auto code = [&](const char* name) { return 30000 + static_cast<int>(table.by_name("material", name)); };
    int wrong = 0;
    for (int r = 0; r < 200; ++r)
        for (int c = 0; c < 200; ++c) {
            int expected = r < 80 ? 1 : r < 160 ? 3 : INT16_MIN;
            const bool bricks = r >= 80;
            if (r < 160) {
                if (c < 40)
                    expected = code(bricks ? "urban-uni-180" : "metal-uni-180");
                else if (c < 80)
                    expected = code(bricks ? "urban-bi-045" : "metal-bi-045");
                else if (c >= 120 && c < 160)
                    expected = code(bricks ? "urban-uni-359" : "metal-uni-359");
            }
            if (c >= 10 && c < 20 && r >= 10 && r < 20) expected = code("metal-uni-090");
            wrong += static_cast<int>(codes.at(c, r)) != expected;
        }
    CHECK(wrong == 0);
    // The sensor south of it: what looks south returns as if it looked everywhere, what looks north a hundredth.
    Strings plain = tile;
    plain[2] = folder / "plain";
    plain.erase(plain.begin() + 7, plain.begin() + 9);
    run(plain);
    run({tile[0], tile[1], folder / "sided", tile[3], tile[4], tile[5], tile[6], tile[7], tile[8], "-q"});
    const auto echo = [&](const std::string& store) {
        run({"simulate", "--dem", folder / store, "--xy", text(x_at(720.5), ",", y_at(720.5)), "--altitude-agl",
             "1500m", "--geometry", "grid", "--range", "4km", "--azimuth-bins", "720", "--range-bin", "60m", "--echo",
             folder / (store + ".tif"), "--overwrite", "-q"});
        return cells_of(folder / (store + ".tif"));
    };
    // Due north metal 40 to 120 posts away, brick nearer; the column of the sensor is one that looks south.
    const Cells alike = echo("plain"), sided = echo("sided");
    for (const int j : {32, 45, 55}) {
        INFO(j);
        CHECK_THAT(static_cast<double>(sided.at(j, 0)) / static_cast<double>(alike.at(j, 0)), WithinRel(1.0, 1e-3));
    }
    // Due south too, bricks turned away from it.
    CHECK_THAT(static_cast<double>(sided.at(30, 360)) / static_cast<double>(alike.at(30, 360)), WithinRel(0.01, 1e-3));

    // What is wrong is named.
    const auto refused = [&](const Drawing& raster, int exit_code) {
        draw(folder / "side.tif", raster);
        Strings again = tile;
        again[2] = folder / "none";
        const std::string said = run(again, exit_code);
        CHECK_FALSE(std::filesystem::exists(folder / "none"));
        CHECK(std::count(said.begin(), said.end(), '\n') == 1);
        return said;
    };
    side.value = [](int c, int r) { return c == 7 && r == 9 ? 541 : -1; };
    CHECK_THAT(refused(side, 1), Contains("side.tif': value at column 7, row 9 is 541") && Contains("0 to 359 (uni"));
    side.value = [](int, int) { return 10; };
    side.geotransform = {x_at(701), step, 0, y_at(600), 0, -step};
    CHECK_THAT(refused(side, 1), Contains("side.tif' has another grid than culture '"));
    CHECK_THAT(run({"tile", dem, folder / "none", "--directivity", folder / "side.tif"}, 2),
               Contains("directivity is given without culture"));
    // None of its own: the raster as it is.
    side.geotransform = culture.geotransform;
    side.value = [](int, int) { return 540; };
    draw(folder / "side.tif", side);
    Strings omni = tile;
    omni[2] = folder / "omni";
    run(omni);
    CHECK(cells_of(folder / "omni/culture.vrt").type == "Byte");
}
