// Where features are burnt into a tile store: the cells that they cover and no others, the same whatever the windows and the
// file's order, in any CRS.
#include <catch2/catch.hpp>

#include <gdal_alg.h>
#include <gdal_priv.h>
#include <ogrsf_frmts.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <set>

#include "lib/error.hpp"
#include "tests/burnt_features.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/json.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/tile_store.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::WithinAbs;

namespace {

const GdalSession session(std::size_t{16} << 20, {});

/// From easting and northing to longitude and latitude, WGS84.
std::unique_ptr<OGRCoordinateTransformation> to_degrees(const char* crs) {
    OGRSpatialReference own, wgs84;
    own.SetFromUserInput(crs);
    wgs84.importFromEPSG(4326);
    for (auto* each : {&own, &wgs84}) each->SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    return std::unique_ptr<OGRCoordinateTransformation>(OGRCreateCoordinateTransformation(&own, &wgs84));
}

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
