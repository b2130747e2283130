// Many observers: counts are the sum of single masks, from the tiles that a coverage hands out to coverage --observers seen
// from outside.
#include <ogrsf_frmts.h>
#include <signal.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <fstream>
#include <random>
#include <thread>

#include "lib/coverage.hpp"
#include "lib/seen_counts.hpp"
#include "tests/busy_worker.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/file_content.hpp"
#include "tests/json.hpp"
#include "tests/process_bytes.hpp"
#include "tests/program.hpp"
#include "tests/refusal.hpp"
#include "tests/small_disk.hpp"
#include "tests/terrain.hpp"
#include "tests/words.hpp"
#include "tiles/count_store.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

namespace {

using wedgescope::test::content;
using wedgescope::test::with;

const std::string program = WEDGESCOPE_PROGRAM;
using Words = std::vector<std::string>;

/// A band as whole numbers, and its no-data value.
struct RasterBand {
    int columns = 0, rows = 0;
    GDALDataType type = GDT_Unknown;
    std::optional<double> no_data;
    std::vector<int> posts;
    std::string observers;

    explicit RasterBand(const std::string& path) {
        GDALAllRegister();
        GDALDataset* in = GDALDataset::Open(path.c_str());
        if (!in) throw std::runtime_error("cannot open " + path);
        columns = in->GetRasterXSize();
        rows = in->GetRasterYSize();
        GDALRasterBand* band = in->GetRasterBand(1);
        type = band->GetRasterDataType();
        int declared = 0;
        const double value = band->GetNoDataValue(&declared);
        if (declared) no_data = value;
        if (const char* n = in->GetMetadataItem("OBSERVERS")) observers = n;
        posts.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
        const CPLErr read = band->RasterIO(GF_Read, 0, 0, columns, rows, posts.data(), columns, rows, GDT_Int32, 0, 0);
        GDALClose(in);
        if (read != CE_None) throw std::runtime_error("cannot read " + path);
    }
};

Ended coverage(const Folder& folder, const Words& words) {
    return run_program(with({program, "coverage", "-q", "--overwrite", "--reproducible"}, words), folder / "log");
}
void coverage_does(const Folder& folder, const Words& words) {
    const Ended ended = coverage(folder, words);
    std::string all;
    for (const std::string& word : words) all += word + " ";
    INFO(all << "\n" << ended.err);
    REQUIRE(ended.code == 0);
}
/// One line, and an exit code.
std::string refused(const Folder& folder, const Words& words, int code = 2) {
    const Ended ended = coverage(folder, words);
    INFO(ended.err);
    CHECK(ended.code == code);
    CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
    return ended.err;
}

/// Hills with two voids, of a size that is no whole number of tiles.
void draw_hills(const std::string& path, int columns = 700, int rows = 610, const Words& creation = {}) {
    const auto hills = rolling(220, 60, 3);
    Drawing d;
    d.columns = columns;
    d.rows = rows;
    d.geotransform = std::array<double, 6>{465000, 30, 0, 3755000, 0, -30};
    d.type = GDT_Int16;
    d.no_data = -9999;
    d.creation = creation;
    d.value = [&](int c, int r) {
        const bool none = (c > 90 && c < 180 && r > 350 && r < 420) || std::hypot(c - 520, r - 150) < 30;
        return none ? -9999 : std::round(500 + hills(c, r));
    };
    draw(path, d);
}

/// A point of a file: place, and its fields by name; empty text: null.
struct Point {
    std::string wkt;
    std::vector<std::pair<std::string, std::string>> fields;
};
void write_points(const std::string& path, const std::string& driver, const std::string& crs,
                  const std::vector<Point>& points, const std::vector<std::string>& layers = {"places"},
                  OGRwkbGeometryType type = wkbUnknown) {
    GDALAllRegister();
    GDALDataset* out =
        GetGDALDriverManager()->GetDriverByName(driver.c_str())->Create(path.c_str(), 0, 0, 0, GDT_Unknown, nullptr);
    if (!out) throw std::runtime_error("cannot write " + path);
    OGRSpatialReference srs;
    if (!crs.empty()) srs.SetFromUserInput(crs.c_str());
    srs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    for (const std::string& name : layers) {
        OGRLayer* layer = out->CreateLayer(name.c_str(), crs.empty() ? nullptr : &srs, type, nullptr);
        for (const Point& p : points)
            for (const auto& [field, value] : p.fields)
                if (layer->GetLayerDefn()->GetFieldIndex(field.c_str()) < 0) {
                    const bool number = value.find_first_not_of("0123456789.-") == std::string::npos;
                    OGRFieldDefn definition(field.c_str(), number ? OFTReal : OFTString);
                    layer->CreateField(&definition);
                }
        for (const Point& p : points) {
            OGRFeature* feature = OGRFeature::CreateFeature(layer->GetLayerDefn());
            if (!p.wkt.empty()) {
                OGRGeometry* geometry = nullptr;
                OGRGeometryFactory::createFromWkt(p.wkt.c_str(), nullptr, &geometry);
                feature->SetGeometryDirectly(geometry);
            }
            for (const auto& [field, value] : p.fields)
                if (!value.empty()) feature->SetField(field.c_str(), value.c_str());
            if (layer->CreateFeature(feature) != OGRERR_NONE) throw std::runtime_error("cannot write to " + path);
            OGRFeature::DestroyFeature(feature);
        }
    }
    GDALClose(out);
}

/// What single runs say of each post: seen by so many; void for any; looked at by any.
struct Sum {
    std::vector<int> seen, no_data, judged;
};
Sum sum_of(const Folder& folder, const std::string& dem, const std::vector<Words>& singles, const Words& all = {}) {
    Sum sum;
    for (const Words& single : singles) {
        coverage_does(
            folder, with(with({dem, folder / "one.tif", "--no-data-value", "1", "--outside-value", "2"}, all), single));
        const RasterBand one(folder / "one.tif");
        sum.seen.resize(one.posts.size());
        sum.no_data.resize(one.posts.size());
        sum.judged.resize(one.posts.size());
        for (std::size_t i = 0; i < one.posts.size(); ++i) {
            sum.seen[i] += one.posts[i] == 255;
            sum.no_data[i] |= one.posts[i] == 1;
            sum.judged[i] |= one.posts[i] == 255 || one.posts[i] == 0;
        }
    }
    return sum;
}
void check_counts(const Sum& sum, const RasterBand& counts) {
    CHECK(counts.type == GDT_UInt16);
    REQUIRE(counts.posts.size() == sum.seen.size());
    std::size_t wrong = 0, any = 0;
    for (std::size_t i = 0; i < sum.seen.size(); ++i) {
        wrong += counts.posts[i] != (sum.no_data[i] ? 65535 : sum.seen[i]);
        any += counts.posts[i] > 1 && counts.posts[i] < 65535;
    }
    CHECK(wrong == 0);
    CHECK(any > 20);  // seen by two: else the sum says little
    const bool void_posts = std::find(sum.no_data.begin(), sum.no_data.end(), 1) != sum.no_data.end();
    CHECK(counts.no_data == (void_posts ? std::optional<double>(65535) : std::nullopt));
}

/// Observers of unlike kinds over draw_hills(), as fields and as single runs say them.
const std::vector<Point> unlike = {
    {"POINT (470000 3750000)", {{"height", "30"}, {"altitude", ""}, {"range", ""}, {"heading", ""}}},
    {"POINT (478000.5 3745000.25)", {{"height", "400"}, {"altitude", ""}, {"range", "6000"}, {"heading", ""}}},
    {"POINT (467250 3740010)", {{"height", ""}, {"altitude", "1200"}, {"range", "2500"}, {"heading", "200"}}},
    {"POINT (480600 3750515)",
     {{"height", ""}, {"altitude", "900"}, {"range", ""}, {"heading", "-30"}}},  // over a void
    {"POINT (460000 3757000)", {{"height", ""}, {"altitude", "1500"}, {"range", ""}, {"heading", "135"}}},  // outside
    {"POINT (300000 3757000)",
     {{"height", ""}, {"altitude", "1500"}, {"range", "9000"}, {"heading", ""}}},                     // far outside
    {"POINT (472515 3746985)", {{"height", ""}, {"altitude", ""}, {"range", ""}, {"heading", ""}}}};  // on a post
const std::vector<Words> as_singles = {
    {"--xy", "470000,3750000", "--altitude-agl", "30m", "--range", "7km"},
    {"--xy", "478000.5,3745000.25", "--altitude-agl", "400m", "--range", "6000m"},
    {"--xy", "467250,3740010", "--altitude-msl", "1200m", "--range", "2500m", "--heading", "200deg"},
    {"--xy", "480600,3750515", "--altitude-msl", "900m", "--heading", "-30deg", "--range", "7km"},
    {"--xy", "460000,3757000", "--altitude-msl", "1500m", "--heading", "135deg", "--range", "7km"},
    {"--xy", "300000,3757000", "--altitude-msl", "1500m", "--range", "9000m"},
    {"--xy", "472515,3746985", "--altitude-agl", "75m", "--range", "7km"}};

}  // namespace

TEST_CASE("a coverage that hands out the tiles that spokes come by leaves out none that holds anything",
          "[observers]") {
    const auto hills = rolling(300, 40, 11);
    std::mt19937 random(5);
    for (const double high : {30.0, 75.0}) {
        MemorySource source(1100, 900, 30, [&](double c, double r) {
            return std::hypot(c - 300, r - 500) < 40 ? static_cast<double>(void_post) : 200 + hills(c, r);
        });
        source.editable().step_y = -high;
        std::size_t handed_out = 0, whole = 0;
        for (int run = 0; run < 24; ++run) {
            std::uniform_real_distribution<double> c(-300, 1400), r(-250, 1150), range(50, 30000);
            Scene scene;
            scene.platform.xy = PointXY{std::round(c(random)) * 30 + (run % 3 ? 0 : 11), -r(random) * high};
            if (run % 4 == 0) scene.platform.xy->y = std::round(scene.platform.xy->y / high) * high;
            scene.platform.altitude_m = 900;
            if (run > 1) scene.range_m = range(random);
            if (run % 5 == 2) scene.sector = Sector{Angle::degrees(20.0 * run), Angle::degrees(20.0 * run + 70)};
            const ResolvedScene resolved = resolve_coverage(scene, source);
            CoverageParams params;
            params.mask = observer_codes;
            params.threads = 1 + run % 2;
            const auto posts = [&](bool reached_only) {
                std::vector<std::uint8_t> all(1100 * 900, observer_codes.outside);
                params.reached_only = params.beside_others = reached_only;
                cover(resolved, source, params, [&](const CoverageTile& tile) {
                    ++(reached_only ? handed_out : whole);
                    for (std::int64_t y = 0; y < tile.window.rows.size(); ++y)
                        std::copy_n(tile.bytes + y * tile.stride, tile.window.columns.size(),
                                    all.begin() + (tile.window.rows.begin + y) * 1100 + tile.window.columns.begin);
                });
                return all;
            };
            INFO("run " << run << ", post " << high << " m high, sensor at " << resolved.nadir.column << ", "
                        << resolved.nadir.row << ", range " << scene.range_m.value_or(0));
            CHECK(posts(false) == posts(true));
        }
        CHECK(handed_out < whole * 3 / 4);
    }
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // which hold memory of their own
TEST_CASE("coverages on two threads, one after the other, leave nothing while the other thread is kept elsewhere",
          "[observers]") {
    const auto hills = rolling(300, 40, 11);
    MemorySource source(24, 20, 30, [&](double c, double r) { return 200 + hills(c, r); });
    Scene scene;
    scene.platform.xy = PointXY{300, -270};
    scene.platform.altitude_m = 900;
    const ResolvedScene resolved = resolve_coverage(scene, source);
    CoverageParams params;
    params.mask = observer_codes;
    params.reached_only = params.beside_others = true;
    params.threads = 2;
    const BusyWorker worker;
    const auto cover_often = [&](int times) {
        for (int i = 0; i < times; ++i) CHECK(cover(resolved, source, params, [](const CoverageTile&) {}).threads == 2);
    };
    cover_often(50);
    const std::size_t before = resident_bytes();
    cover_often(1000);
    CHECK(resident_bytes() < before + (std::size_t{1} << 20));  // an arena left behind is 7 KB
}
#endif

TEST_CASE("counts of tiles that go to a file and back are those of tiles that stay", "[observers][threads]") {
    const Folder folder;
    constexpr std::int64_t columns = 1000, rows = 700, edge = CountStore::edge;
    for (const std::size_t observers : {std::size_t{40}, most_observers_in_byte + 1}) {
        // Observer k sees, does not see, has no data at, or does not look at a post by what these numbers leave over.
        const auto code = [](std::size_t k, std::int64_t c, std::int64_t r) {
            if ((c * 7 + r * 3) % 11 == 0) return static_cast<std::uint8_t>(k % 3 ? 1 : 0);
            return static_cast<std::uint8_t>((c / 5 + r / 3 + static_cast<std::int64_t>(k) * 5) % 3 + 1 == 1
                                                 ? 0
                                                 : (c / 5 + r / 3 + static_cast<std::int64_t>(k) * 5) % 3 + 1);
        };
        for (const std::size_t tiles : {std::size_t{0}, std::size_t{5}, std::size_t{100}}) {
            CountStore store(columns, rows, observers, tiles * CountStore::tile_bytes(observers), folder / ".");
            std::vector<std::thread> threads;
            for (std::size_t t = 0; t < 3; ++t)
                threads.emplace_back([&, t] {
                    std::vector<std::uint8_t> bytes(edge * edge);
                    for (std::size_t k = t; k < 40; k += 3)
                        for (std::int64_t at = 0; at < 12; ++at) {
                            const std::int64_t column = (at + static_cast<std::int64_t>(k)) % 4, row = at / 4;
                            if (column == 3 && row == 2) continue;  // nobody comes there
                            CoverageTile tile;
                            tile.window = {{column * edge, std::min((column + 1) * edge, columns)},
                                           {row * edge, std::min((row + 1) * edge, rows)}};
                            tile.stride = edge;
                            tile.bytes = bytes.data();
                            for (std::int64_t r = 0; r < edge; ++r)
                                for (std::int64_t c = 0; c < edge; ++c)
                                    bytes[static_cast<std::size_t>(r * edge + c)] =
                                        code(k, column * edge + c, row * edge + r);
                            store.add(tile);
                        }
                });
            for (std::thread& thread : threads) thread.join();
            CHECK((store.written_bytes() > 0) == (tiles < 11));
            std::vector<std::uint16_t> numbers(edge * edge);
            std::size_t wrong = 0;
            for (std::int64_t row = 0; row < 3; ++row)
                for (std::int64_t column = 0; column < 4; ++column) {
                    const bool there = store.take(column, row, numbers);
                    CHECK(there == !(column == 3 && row == 2));
                    if (!there) continue;
                    for (std::int64_t r = row * edge; r < std::min(rows, (row + 1) * edge); ++r)
                        for (std::int64_t c = column * edge; c < std::min(columns, (column + 1) * edge); ++c) {
                            int seen = 0, highest = 0;
                            for (std::size_t k = 0; k < 40; ++k) {
                                seen += code(k, c, r) == 3;
                                highest = std::max<int>(highest, code(k, c, r));
                            }
                            wrong += numbers[static_cast<std::size_t>(r % edge * edge + c % edge)] !=
                                     std::min(highest, 2) + seen;
                        }
                }
            INFO(observers << " observers, " << tiles << " tiles in memory");
            CHECK(wrong == 0);
        }
    }
    CHECK(folder.names().empty());
    CHECK_THAT(refusal<IoError>([&] { CountStore(columns, rows, 3, 0, folder / "none"); }),
               Contains("the file for counts of observers in temp-dir") && Contains("cannot be made"));
    const SmallDisk disk(100000);
    CHECK_THAT(refusal<IoError>([&] {
                   CountStore store(columns, rows, 3, 0, folder / ".");
                   std::vector<std::uint8_t> bytes(edge * edge, observer_codes.seen);
                   for (std::int64_t column = 0; column < 4; ++column)
                       store.add({.window = {{column * edge, std::min((column + 1) * edge, columns)}, {0, edge}},
                                  .bytes = bytes.data(),
                                  .stride = edge});
               }),
               Contains("cannot be written: File too large"));
}

TEST_CASE("the counts of many observers are the sum of their single masks, post for post", "[observers]") {
    const Folder folder;
    const std::string dem = folder / "dem.tif", points = folder / "points.gpkg", out = folder / "counts.tif";
    draw_hills(dem);
    write_points(points, "GPKG", "EPSG:32611", unlike);
    const Words all = {"--sector", "-100deg,95deg", "--target-height", "3m"};
    const Sum sum = sum_of(folder, dem, as_singles, all);
    const Words common = with(all, {"--altitude-agl", "75m", "--range", "7km"});
    const Words many = with({dem, out, "--observers", points}, common);
    coverage_does(folder, with(many, {"--report", folder / "r.json"}));
    const RasterBand counts(out);
    check_counts(sum, counts);
    CHECK(counts.observers == "7");
    CHECK(*std::max_element(sum.seen.begin(), sum.seen.end()) >= 3);
    // Some posts nobody looks at.
    CHECK(std::count(sum.judged.begin(), sum.judged.end(), 0) > std::count(sum.no_data.begin(), sum.no_data.end(), 1));

    const nlohmann::json report = json_in(folder / "r.json");
    CHECK(report["format"] == "wedgescope-observers-1");
    CHECK(report["observer_count"] == 7);
    CHECK(report["observers"].size() == 7);
    CHECK(report["observers_per_second"] > 0);
    CHECK(report["bytes_read"] == 700 * 610 * 2);
    CHECK(report["posts"]["no_data"] == std::count(sum.no_data.begin(), sum.no_data.end(), 1));
    CHECK(report["posts"]["seen"] == std::count_if(sum.seen.begin(), sum.seen.end(), [](int n) { return n > 0; }));
    CHECK(report["most_observers"] == *std::max_element(sum.seen.begin(), sum.seen.end()));
    std::uint64_t seen = 0, sums = 0;
    for (const auto& observer : report["observers"]) seen += observer["seen"].get<std::uint64_t>();
    for (const int n : sum.seen) sums += static_cast<std::uint64_t>(n);
    CHECK(seen == sums);
    CHECK(report["observers"][5]["posts_read"] == 0);  // far outside

    // The mask of what at least so many see has the codes of a plain mask.
    for (const int enough : {1, 3}) {
        coverage_does(
            folder, with(many, {"--at-least", std::to_string(enough), "--no-data-value", "1", "--outside-value", "2"}));
        const RasterBand mask(out);
        CHECK(mask.type == GDT_Byte);
        std::size_t wrong = 0;
        for (std::size_t i = 0; i < sum.seen.size(); ++i)
            wrong += mask.posts[i] != (sum.no_data[i] ? 1 : !sum.judged[i] ? 2 : sum.seen[i] >= enough ? 255 : 0);
        CHECK(wrong == 0);
    }

    // No bit depends on threads, memory, culling, the order of observers, or how the terrain is stored.
    const std::string plain = [&] {
        coverage_does(folder, many);
        return content(out);
    }();
    for (const Words& more : {Words{"--threads", "1"}, Words{"--threads", "5"}, Words{"--memory", "34MiB"},
                              Words{"--no-cull", "--source", "direct"}, Words{"--timeline", folder / "t.json"}}) {
        coverage_does(folder, with(many, more));
        INFO(more[0]);
        CHECK(content(out) == plain);
    }
    std::vector<Point> backwards(unlike.rbegin(), unlike.rend());
    write_points(folder / "backwards.gpkg", "GPKG", "EPSG:32611", backwards);
    const std::string other = folder / "backwards.gpkg";
    coverage_does(folder, with({dem, out, "--observers", other}, common));
    CHECK(content(out) == plain);
    draw_hills(folder / "strips.tif", 700, 610, {"COMPRESS=DEFLATE"});
    REQUIRE(run_program({program, "tile", "-q", dem, folder / "store"}, folder / "log").code == 0);
    for (const char* name : {"strips.tif", "store"}) {
        coverage_does(folder, with({folder / name, out, "--observers", points}, common));
        CHECK(RasterBand(out).posts == counts.posts);
    }
}

TEST_CASE("observers come in any vector file, in any CRS, or in a table", "[observers]") {
    const Folder folder;
    const std::string dem = folder / "dem.tif", out = folder / "counts.tif";
    draw_hills(dem, 300, 280);
    // Latitude and longitude, as GeoJSON has them.
    std::ofstream(folder / "p.geojson")
        << R"({"type":"FeatureCollection","features":[)"
           R"({"type":"Feature","properties":{"name":"a","height":"100ft"},)"
           R"("geometry":{"type":"Point","coordinates":[-117.352,33.905]}},)"
           R"({"type":"Feature","properties":{"height":60},)"
           R"("geometry":{"type":"MultiPoint","coordinates":[[-117.33,33.88],[-117.31,33.9,700]]}}]})";
    const std::vector<Words> singles = {{"--latlon", "33.905,-117.352", "--altitude-agl", "100ft"},
                                        {"--latlon", "33.88,-117.33", "--altitude-agl", "60m"},
                                        {"--latlon", "33.9,-117.31", "--altitude-agl", "60m"}};
    const Sum sum = sum_of(folder, dem, singles);
    const auto check = [&](const std::string& file, const Words& more = {}) {
        INFO(file);
        coverage_does(folder, with({dem, out, "--observers", file}, more));
        check_counts(sum, RasterBand(out));
    };
    check(folder / "p.geojson");
    // Tables: a track, and one with other columns and a quoted name.
    std::ofstream(folder / "track.csv") << "time,lat,lon,altitude-agl [ft],heading\n0,33.905,-117.352,100,0\n"
                                           "1,33.88,-117.33,60m,10\n2,33.9,-117.31,60m,20\n";
    check(folder / "track.csv");
    std::ofstream(folder / "table.CSV")
        << "name,Longitude,LATITUDE,height,altitude\n\"Peak, the\",-117.352,33.905,100ft,\n"
           "12\" mast,-117.33,33.88,,\n# none\n\"the \"\"C\"\", high\",-117.31,33.9,60,\n";
    check(folder / "table.CSV", {"--altitude-agl", "60m"});
    // A quote counts only where a cell begins.
    std::ofstream(folder / "inches.csv") << "lon,lat,name,note,height\n-117.352,33.905,12\" mast,5\" dish,100ft\n"
                                            "-117.33,33.88, \"b, c\" ,,60\n-117.31,33.9,\" \",5\",60\n";
    check(folder / "inches.csv");
    // A pipe is a table whatever its name: it can be read but once.
    for (const char* const name : {"/dev/stdin", "-"}) {
        const Ended piped =
            run_program({"/bin/sh", "-c",
                         "cat '" + (folder / "track.csv") + "' | '" + program + "' coverage -q --overwrite '" + dem +
                             "' '" + out + "' --observers " + name},
                        folder / "log");
        INFO(piped.err);
        CHECK(piped.code == 0);
        check_counts(sum, RasterBand(out));
    }
    // Another CRS, turned into latitude and longitude by PROJ; a layer of several.
    write_points(folder / "two.gpkg", "GPKG", "EPSG:4269",
                 {{"POINT (-117.352 33.905)", {{"height", "30.48"}}},
                  {"POINT (-117.33 33.88)", {{"height", "60"}}},
                  {"POINT (-117.31 33.9)", {{"height", "60"}}}},
                 {"other", "places"});
    check(folder / "two.gpkg", {"--observers-layer", "places"});
    CHECK_THAT(refused(folder, {dem, out, "--observers", folder / "two.gpkg"}),
               Contains("has 2 layers (other, places); give observers-layer"));
    CHECK_THAT(refused(folder, {dem, out, "--observers", folder / "two.gpkg", "--observers-layer", "x"}),
               Contains("observers-layer is 'x'; '") && Contains("has other, places"));
    // Without a CRS (a GeoPackage then says that it is undefined): the raster's own coordinates.
    const Sum two = sum_of(
        folder, dem,
        {{"--xy", "467000,3752000", "--altitude-agl", "40m"}, {"--xy", "470500,3751000", "--altitude-agl", "80m"}});
    for (const auto& [file, driver] : {std::pair{"plain.shp", "ESRI Shapefile"}, {"plain.gpkg", "GPKG"}}) {
        INFO(file);
        write_points(folder / file, driver, "",
                     {{"POINT (467000 3752000)", {{"height", "40"}}}, {"POINT (470500 3751000)", {{"height", "80"}}}},
                     {"plain"}, wkbPoint);
        coverage_does(folder, {dem, out, "--observers", folder / file});
        check_counts(two, RasterBand(out));
    }
}

TEST_CASE("heights under other usual names are taken, and what a file of observers holds besides is named once",
          "[observers]") {
    const Folder folder;
    const std::string dem = folder / "dem.tif", out = folder / "counts.tif";
    draw_hills(dem, 120, 100);
    const auto words_on = [&](const std::string& file, const Words& more = {}) {
        const Ended ended = run_program(
            with({program, "coverage", "--overwrite", dem, out, "--observers", folder / file}, more), folder / "log");
        INFO(file << "\n" << ended.err);
        CHECK(ended.code == 0);
        const auto at = ended.err.find("observers '");
        return at == std::string::npos ? "" : ended.err.substr(at, ended.err.find('\n', at) - at);
    };
    const auto table = [&](const std::string& header, const std::string& row, const Words& more = {}) {
        std::ofstream(folder / "t.csv") << header << "\n" << row << "\n";
        return words_on("t.csv", more);
    };
    CHECK(table("x,y,height", "466000,3754000,90").empty());
    const std::vector<int> high = RasterBand(out).posts;
    CHECK(table("x,y", "466000,3754000", {"--altitude-agl", "10m"}).empty());
    const std::vector<int> low = RasterBand(out).posts;
    REQUIRE(high != low);
    // As shapefiles cut them too.
    for (const char* name : {"height (m)", "height_m", "HGT", "hgt [m]", "height_m (m)", "Predominant_Height",
                             "predominan", "altitude-a", "altitude_A"}) {
        INFO(name);
        // With a name that may be of something else it says so.
        const bool sure = name == std::string("height (m)");
        const std::string said = table(std::string("x,y,") + name, "466000,3754000,90", {"--altitude-agl", "10m"});
        if (sure)
            CHECK(said.empty());
        else
            CHECK_THAT(said, Contains(std::string("t.csv': column '") + name + "' gives each its height"));
        CHECK(RasterBand(out).posts == high);
        if (!sure) CHECK(table(std::string("x,y,") + name, "466000,3754000,90").empty());
    }
    for (const char* name : {"height (ft)", "height [ft"}) {
        CHECK(table(text("x,y,", name), "466000,3754000,295.27559", {"--altitude-agl", "10m"}).empty());
        CHECK(RasterBand(out).posts == high);
    }
    // What is no name of ours, or has no unit in its brackets.
    CHECK_THAT(table("x,y,OBS_HGT,height (old)", "466000,3754000,90,90", {"--altitude-agl", "10m"}),
               Contains("t.csv': columns that are left out: 'OBS_HGT', 'height (old)'"));
    CHECK(RasterBand(out).posts == low);
    // A number is no unit, or each cell would be read as longer by its digits.
    CHECK_THAT(table("x,y,OBS_HGT,height (2m)", "466000,3754000,90,90", {"--altitude-agl", "10m"}),
               Contains("t.csv': columns that are left out: 'OBS_HGT', 'height (2m)'"));
    CHECK(RasterBand(out).posts == low);
    // Next to a sure name the others may be of anything.
    CHECK_THAT(table("x,y,hgt,height,height_m", "466000,3754000,90,10,90"), Contains("left out: 'hgt', 'height_m'"));
    CHECK(RasterBand(out).posts == low);
    // Two sure names are one too many, whatever stands before them.
    for (const char* header : {"x,y,height,altitude-agl", "x,y,hgt,height,altitude-agl"}) {
        std::ofstream(folder / "t.csv") << header << "\n466000,3754000,90,10"
                                        << "\n";
        const Ended ended = run_program({program, "coverage", "--overwrite", dem, out, "--observers", folder / "t.csv"},
                                        folder / "log");
        CHECK(ended.code == 2);
        CHECK_THAT(ended.err, Contains("is 'altitude-agl', and so is one before"));
    }
    // A comma at the end of each line is no column to speak of, and of many columns the first are named.
    CHECK(table("x,y,height,", "466000,3754000,90,").empty());
    std::string header = "x,y,height", row = "466000,3754000,90";
    for (int i = 0; i < 12; ++i) header += ",c" + std::to_string(i), row += ",1";
    CHECK_THAT(table(header, row), Contains("left out: 'c0', ") && Contains("'c7' and 4 more") && !Contains("c8"));

    for (const char* name : {"height_m", "hgt", "height (m)"}) {
        INFO(name);
        std::filesystem::remove(folder / "p.gpkg");
        write_points(folder / "p.gpkg", "GPKG", "EPSG:32611", {{"POINT (466000 3754000)", {{name, "90"}}}});
        CHECK(words_on("p.gpkg").empty());
        CHECK(RasterBand(out).posts == high);
        const std::string said = words_on("p.gpkg", {"--altitude-agl", "10m"});
        if (name == std::string("height (m)"))
            CHECK(said.empty());
        else
            CHECK_THAT(said, Contains(std::string("p.gpkg': field '") + name + "' gives each its height"));
        CHECK(RasterBand(out).posts == high);
    }
    std::filesystem::remove(folder / "p.gpkg");
    write_points(folder / "p.gpkg", "GPKG", "EPSG:32611",
                 {{"POINT (466000 3754000)", {{"name", "a"}, {"OBS_HGT", "90"}, {"hgt", "90"}, {"height", "10"}}}});
    CHECK_THAT(words_on("p.gpkg"), Contains("p.gpkg': fields that are left out: 'name', 'OBS_HGT', 'hgt'"));
    CHECK(RasterBand(out).posts == low);
}

TEST_CASE("observers round the antimeridian are counted on both of its sides", "[observers]") {
    const Folder folder;
    const std::string dem = folder / "earth.tif", out = folder / "counts.tif";
    // All round the earth, with and without a last column that repeats the first.
    for (const int columns : {1440, 1441}) {
        Drawing d;
        d.columns = columns;
        d.rows = 400;
        d.geotransform = std::array<double, 6>{-180.125, 0.25, 0, 50, 0, -0.25};
        d.crs = "EPSG:4326";
        d.value = [](int c, int r) { return 900 * std::sin(c % 1440 * 0.9) * std::cos(r * 0.7) + 900; };
        draw(dem, d);
        std::ofstream(folder / "t.csv") << "lat,lon,altitude,range\n10.1,179.9,20000,600km\n9.5,-179.3,20000,500km\n"
                                           "10,20,15000,400km\n";
        const Sum sum = sum_of(folder, dem,
                               {{"--latlon", "10.1,179.9", "--altitude-msl", "20km", "--range", "600km"},
                                {"--latlon", "9.5,-179.3", "--altitude-msl", "20km", "--range", "500km"},
                                {"--latlon", "10,20", "--altitude-msl", "15km", "--range", "400km"}});
        coverage_does(folder, {dem, out, "--observers", folder / "t.csv"});
        const RasterBand counts(out);
        check_counts(sum, counts);
        std::size_t west = 0, east = 0;
        for (int r = 0; r < counts.rows; ++r) {
            west += counts.posts[static_cast<std::size_t>(r * columns)] > 0;
            east += counts.posts[static_cast<std::size_t>(r * columns + 1439)] > 0;
        }
        CHECK(west > 10);
        CHECK(east > 10);
    }
}

TEST_CASE("more than 253 observers are counted in 16 bits", "[observers]") {
    const Folder folder;
    const std::string dem = folder / "dem.tif", out = folder / "counts.tif";
    draw_hills(dem, 300, 280);
    std::ofstream table(folder / "many.csv");
    table << "x,y,height\n";
    for (int i = 0; i < 200; ++i) table << "467000,3752000,40\n470500,3751000,80\n";
    table.close();
    const Sum sum = sum_of(
        folder, dem,
        {{"--xy", "467000,3752000", "--altitude-agl", "40m"}, {"--xy", "470500,3751000", "--altitude-agl", "80m"}});
    coverage_does(folder, {dem, out, "--observers", folder / "many.csv"});
    const RasterBand counts(out);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < sum.seen.size(); ++i)
        wrong += counts.posts[i] != (sum.no_data[i] ? 65535 : 200 * sum.seen[i]);
    CHECK(wrong == 0);
    CHECK(std::count(counts.posts.begin(), counts.posts.end(), 400) > 20);
}

TEST_CASE("what is wrong with observers is said in one line, and nothing is left behind", "[observers]") {
    const Folder folder;
    const std::string dem = folder / "dem.tif", out = folder / "out.tif", good = folder / "good.csv";
    draw_hills(dem, 120, 100);
    std::ofstream(good) << "x,y,height\n466000,3754000,30\n";
    const auto table = [&](const std::string& rows, const Words& more = {}, int code = 2) {
        std::ofstream(folder / "t.csv") << rows;
        return refused(folder, with({dem, out, "--observers", folder / "t.csv"}, more), code);
    };
    CHECK_THAT(table(""), Contains("t.csv' is empty; accepted: a line that names the columns lat and lon or x and y"));
    CHECK_THAT(table("x,y,height\n"), Contains("t.csv' holds no observer; at least one is needed"));
    CHECK_THAT(table("x;y;height\n466000;3754000;5\n"),
               Contains("line 1: names of columns are separated by ';'; accepted: ','"));
    CHECK_THAT(table("x\ty\n"), Contains("separated by a tab; accepted: ','"));
    CHECK_THAT(table("name,height\n"), Contains("line 1: no columns are lat, lon or x, y"));
    CHECK_THAT(table("x,y,heigth\n466000,3754000,30\n"), Contains("line 2 has no altitude; accepted: a field height"));
    CHECK_THAT(table("x,y,height,altitude\n466000,3754000,30,900\n"), Contains("line 2 has two of height, altitude"));
    CHECK_THAT(
        table("x,y,height,name\n466000,3754000,30,a\n466000,3754000,30,\"b\n"),
        Contains("line 3: cell 4 begins with a double quote that nothing closes; a quoted cell must end on its"));
    CHECK_THAT(table("x,y,height\n466000,3754000,30\n466000,,30\n"), Contains("line 3, column y is ''"));
    CHECK_THAT(table("x,y,height\n466000,3754000,-3\n"),
               Contains("column height is '-3'; it must be from 0m to 1000km"));
    CHECK_THAT(table("x,y,height,range\n466000,3754000,3,0\n"), Contains("column range is '0'; it must be above 0m"));
    // As a single run says it, with the line in front.
    CHECK_THAT(table("x,y,height\n466000,3754000,30\n400000,3754000,30\n"),
               Contains("line 3: altitude-agl needs terrain below the sensor") && Contains("outside the raster"));
    CHECK_THAT(table("x,y,altitude\n466000,3754000,30\n"),
               Contains("line 2: the sensor is") && Contains("below the terrain"));
    std::string many = "x,y\n";
    for (int i = 0; i < 65534; ++i) many += "466000,3754000\n";
    CHECK_THAT(table(many, {"--altitude-agl", "10m"}), Contains("t.csv' has more than 65533 observers"));

    const auto points = [&](const std::string& wkt, int code) {
        std::filesystem::remove(folder / "p.gpkg");
        write_points(folder / "p.gpkg", "GPKG", "EPSG:32611",
                     {{"POINT (466000 3754000)", {{"height", "30"}}}, {wkt, {{"height", "30"}}}});
        return refused(folder, {dem, out, "--observers", folder / "p.gpkg"}, code);
    };
    CHECK_THAT(points("", 1), Contains("p.gpkg', feature 2 has no geometry; accepted: a point"));
    CHECK_THAT(points("POINT EMPTY", 1), Contains("feature 2 ") && Contains("accepted: "));
    CHECK_THAT(points("LINESTRING (466000 3754000,466100 3754000)", 1),
               Contains("feature 2 is a Line String; accepted: a point"));
    write_points(folder / "text.gpkg", "GPKG", "EPSG:32611", {{"POINT (466000 3754000)", {{"height", "high"}}}});
    CHECK_THAT(refused(folder, {dem, out, "--observers", folder / "text.gpkg"}),
               Contains("feature 1, field height is 'high'; it must be a number (m) or one with a unit, from 0m"));
    write_points(folder / "none.gpkg", "GPKG", "EPSG:32611", {});
    CHECK_THAT(refused(folder, {dem, out, "--observers", folder / "none.gpkg"}), Contains("holds no observer"));
    CHECK_THAT(refused(folder, {dem, out, "--observers", folder / "nowhere.gpkg"}, 1),
               Contains("observers '") && Contains("nowhere.gpkg' cannot be opened: No such file or directory"));
    CHECK_THAT(refused(folder, {dem, out, "--observers", folder / "nowhere.csv"}, 1), Contains("cannot be opened"));
    CHECK_THAT(refused(folder, {dem, out, "--observers", dem}, 1),
               Contains("cannot be opened as points") && Contains("(accepted: a vector file that GDAL reads"));

    const Words counted = {dem, out, "--observers", good};
    const auto says = [&](const Words& more) { return refused(folder, with(counted, more)); };
    CHECK_THAT(says({"--xy", "1,2"}), Contains("the file of observers alone says where they stand"));
    CHECK_THAT(says({"--layer", "height"}), Contains("layer is height, and observers is given; accepted: mask"));
    CHECK_THAT(says({"--source", "spilled"}), Contains("source is spilled, and observers is given"));
    CHECK_THAT(says({"--seen-value", "7"}), Contains("seen-value is given, and observers without at-least"));
    CHECK_THAT(says({"--no-data-value", "7"}), Contains("no-data-value is given, and observers without at-least"));
    CHECK_THAT(says({"--at-least", "0"}), Contains("at-least"));
    CHECK_THAT(says({"--at-least", "2"}),
               Contains("at-least is 2, and observers '") && Contains("good.csv' holds 1; accepted: at most so many"));
    Drawing plain;
    plain.crs = "";
    draw(folder / "plain.tif", plain);
    std::ofstream(folder / "far.csv") << "x,y,altitude\n1e30,3754000,900\n";
    CHECK_THAT(refused(folder, {folder / "plain.tif", out, "--observers", folder / "far.csv"}),
               Contains("line 2: the sensor's position, x, y 1e+30,3754000, is column ") &&
                   Contains("accepted: within 1e8 posts of its first one"));
    CHECK_THAT(says({"--report", good}), Contains("report is") && Contains("which is observers too"));
    REQUIRE(run_program({program, "tile", "-q", dem, folder / "store"}, folder / "log").code == 0);
    for (const char* name : {"store/out.tif", "./store/out.tif"})
        CHECK_THAT(refused(folder, {folder / "store", folder / name, "--observers", good}),
                   Contains("output is '") && Contains("which lies in dem '"));
    CHECK_THAT(refused(folder, {folder / "store/dem.vrt", folder / "store/manifest.json", "--of", "GTiff",
                                "--observers", good}),
               Contains("store/manifest.json', which lies in '") && Contains("store', the tile store of dem '"));
    const Ended inside = run_program({program, "tile", folder / "store/dem.vrt", folder / "store/sub"}, folder / "log");
    CHECK(inside.code == 2);
    CHECK_THAT(inside.err, Contains("store/sub', which lies in '") && Contains("store', the tile store of dem '"));
    CHECK_THAT(says({"--memory", "3MiB"}), Contains("memory is 3 MiB; ") && Contains("needs at least"));
    CHECK_THAT(says({"--of", "PNG", "--co", "ZLEVEL=1"}), Contains("writes whole rasters only"));
    CHECK_THAT(refused(folder, {dem, out, "--xy", "466000,3754000", "--altitude-agl", "9m", "--at-least", "2"}),
               Contains("at-least is given without observers"));
    CHECK_THAT(refused(folder, {dem, out, "--xy", "466000,3754000", "--altitude-agl", "9m", "--observers-layer", "a"}),
               Contains("observers-layer is given without observers"));
    CHECK(!std::filesystem::exists(out));
    for (const std::string& name : folder.names()) CHECK(name.find(".tmp-") == std::string::npos);
}

TEST_CASE("observers in whose view no post holds a height are told of", "[observers]") {
    const Folder folder;
    draw_hills(folder / "dem.tif", 120, 100);
    std::ofstream(folder / "t.csv") << "x,y,altitude\n300000,3752000,900\n";
    const Words words = {folder / "dem.tif", folder / "out.tif", "--observers", folder / "t.csv", "--range", "5km"};
    const Ended ended = run_program(with({program, "coverage"}, words), folder / "log");
    CHECK(ended.code == 0);
    CHECK_THAT(ended.err, Contains("dem.tif' lies within range, sector and pitch, or all of it is void; all of '"));
}

TEST_CASE("the profile of many observers tells how far their stages stay behind the machine's limits", "[observers]") {
    const Folder folder;
    draw_hills(folder / "dem.tif", 300, 280);
    std::ofstream(folder / "t.csv") << "x,y,height\n467000,3752000,40\n470500,3751000,80\n";
    const Ended ended = coverage(folder, {folder / "dem.tif", folder / "out.tif", "--observers", folder / "t.csv",
                                          "--profile", "--range", "5km"});
    INFO(ended.err);
    REQUIRE(ended.code == 0);
    CHECK_THAT(ended.err, Contains("observers/s") && Contains("\n     sweep ") && Contains("\n     write ") &&
                              Contains("\nlimits of this machine, one thread: memory "));
}

TEST_CASE("a mask that is written stays where the machine's limits cannot be measured", "[observers]") {
    const Folder folder;
    draw_hills(folder / "dem.tif", 120, 100);
    const SmallDisk disk(1 << 20);  // measuring writes 32 MiB
    const Ended ended = coverage(folder, {folder / "dem.tif", folder / "out.tif", "--xy", "466000,3754000",
                                          "--altitude-agl", "30m", "--profile"});
    INFO(ended.err);
    CHECK(ended.code == 0);
    CHECK_THAT(ended.err, Contains("\nlimits of this machine are not known: ") && Contains("cannot be written"));
    CHECK(std::filesystem::exists(folder / "out.tif"));
}

TEST_CASE("a signal ends many observers at once and leaves nothing", "[observers]") {
    const Folder folder;
    draw_hills(folder / "dem.tif");
    std::ofstream table(folder / "many.csv");
    table << "x,y,height\n";
    for (int i = 0; i < 3000; ++i) table << 466000 + i << ",3750000,30\n";
    table.close();
    std::filesystem::create_directory(folder / "out");
    const pid_t child = start({program, "coverage", folder / "dem.tif", folder / "out/c.tif", "--observers",
                               folder / "many.csv", "--range", "5km", "-q"},
                              folder / "log");
    for (int i = 0; i < 3000 && std::filesystem::is_empty(folder / "out"); ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    ::kill(child, SIGTERM);
    const Ended ended = wait_for(child, folder / "log");
    INFO(ended.err);
    CHECK(ended.code == 143);
    CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
    CHECK(std::filesystem::is_empty(folder / "out"));
}
