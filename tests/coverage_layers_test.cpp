// The layers of coverage beside one another on real terrain with voids: what the program writes, and triangles drawn
// with GDAL's positions and GeographicLib's geodesics.
#include <GeographicLib/Geodesic.hpp>

#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <map>
#include <memory>
#include <numbers>

#include "tests/drawn_raster.hpp"
#include "tests/json.hpp"
#include "tests/program.hpp"

using namespace wedgescope::test;

namespace {

const std::string dem = WEDGESCOPE_DATA "/worcester_vermont_dem.tif";
constexpr double sensor_lat = 44.45, sensor_lon = -72.6, sensor_m = 1500, degree = std::numbers::pi / 180;

/// All of a raster.
struct Posts {
    int columns = 0, rows = 0;
    std::vector<double> values;
    std::optional<double> no_data;
    std::array<double, 6> terms{};
    std::unique_ptr<OGRCoordinateTransformation> to_lat_lon;

    explicit Posts(const std::string& path) {
        GDALAllRegister();
        GDALDataset* in = GDALDataset::Open(path.c_str());
        if (!in) throw std::runtime_error("cannot open " + path);
        columns = in->GetRasterXSize();
        rows = in->GetRasterYSize();
        values.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
        GDALRasterBand* band = in->GetRasterBand(1);
        int declared = 0;
        const double value = band->GetNoDataValue(&declared);
        if (declared) no_data = value;
        in->GetGeoTransform(terms.data());
        OGRSpatialReference earth;
        earth.importFromEPSG(4326);
        earth.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
        if (const OGRSpatialReference* own = in->GetSpatialRef())
            to_lat_lon.reset(OGRCreateCoordinateTransformation(own, &earth));
        const CPLErr read =
            band->RasterIO(GF_Read, 0, 0, columns, rows, values.data(), columns, rows, GDT_Float64, 0, 0);
        GDALClose(in);
        if (read != CE_None) throw std::runtime_error("cannot read " + path);
    }
    std::size_t index(int c, int r) const {
        return static_cast<std::size_t>(r) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(c);
    }
    double at(int c, int r) const { return values[index(c, r)]; }
    std::pair<double, double> lat_lon(int c, int r) const {
        double x = terms[0] + (c + 0.5) * terms[1], y = terms[3] + (r + 0.5) * terms[5];
        if (!to_lat_lon || !to_lat_lon->Transform(1, &x, &y)) throw std::runtime_error("no place on earth");
        return {y, x};
    }
};

struct Line {
    double arc_m, azimuth, back;  ///< rad, clockwise from north; `back`: at the far end, onward
};
Line line(double lat, double lon, std::pair<double, double> to) {
    Line l{};
    GeographicLib::Geodesic::WGS84().Inverse(lat, lon, to.first, to.second, l.arc_m, l.azimuth, l.back);
    l.azimuth *= degree;
    l.back *= degree;
    return l;
}

/// Radius of curvature of WGS84 along an azimuth (Euler), times 4/3.
double effective_radius(double azimuth, double lat = sensor_lat) {
    constexpr double a = 6378137, f = 1 / 298.257223563, e2 = f * (2 - f);
    const double s = std::sin(lat * degree), w = std::sqrt(1 - e2 * s * s);
    const double meridian = a * (1 - e2) / (w * w * w), normal = a / w;
    return 4.0 / 3 / (std::pow(std::cos(azimuth), 2) / meridian + std::pow(std::sin(azimuth), 2) / normal);
}

/// What simulate makes of flat.tif as --ground.
Posts ground_of(const Folder& folder, const std::vector<std::string>& scene) {
    std::vector<std::string> words = {WEDGESCOPE_PROGRAM,    "simulate",    "--dem", folder / "flat.tif", "--ground",
                                      folder / "ground.tif", "--overwrite", "-q"};
    words.insert(words.end(), scene.begin(), scene.end());
    REQUIRE(run_program(words, folder / "log").code == 0);
    return Posts(folder / "ground.tif");
}

/// What coverage makes of a raster in the folder.
Posts covered(const Folder& folder, const std::string& input, const std::vector<std::string>& scene,
              const std::vector<std::string>& more) {
    std::vector<std::string> words{WEDGESCOPE_PROGRAM, "coverage",    folder / input,
                                   folder / "out.tif", "--overwrite", "-q"};
    for (const auto* part : {&scene, &more}) words.insert(words.end(), part->begin(), part->end());
    const Ended ended = run_program(words, folder / "log");
    INFO(ended.err);
    REQUIRE(ended.code == 0);
    return Posts(folder / "out.tif");
}

}  // namespace

TEST_CASE("without a range every post is in it, the farthest corner too", "[coverage]") {
    const Folder folder;
    Drawing flat;
    flat.columns = 35;
    flat.rows = 80;
    flat.geotransform = {{500000, 30, 0, 4000000, 0, -30}};
    flat.value = [](int, int) { return 50.0; };
    // Geodesics, a plane in a CRS and one without.
    for (const auto& [crs, geometry] : {std::pair{"EPSG:32611", "geodesic"}, {"EPSG:32611", "grid"}, {"", "grid"}}) {
        flat.crs = crs;
        draw(folder / "flat.tif", flat);
        for (const char* xy : {"500700,3999500", "500400,3999000", "500611,3998333"}) {
            INFO(crs << " " << geometry << " " << xy);
            const Posts ground = ground_of(folder, {"--xy", xy, "--altitude-msl", "3000m", "--geometry", geometry});
            CHECK(std::none_of(ground.values.begin(), ground.values.end(), [](double dbm) { return std::isnan(dbm); }));
        }
    }
}

TEST_CASE("the ground of a picture whose range counts along the ground ends where its range does", "[coverage]") {
    const Folder folder;
    Drawing flat;
    flat.columns = flat.rows = 101;
    flat.crs = "EPSG:32611";
    flat.geotransform = {{500000, 30, 0, 4000000, 0, -30}};
    flat.value = [](int, int) { return 50.0; };
    draw(folder / "flat.tif", flat);
    for (const bool begins : {false, true}) {
        std::vector<std::string> scene = {"--xy", "501515,3998485", "--altitude-msl", "1000m",   "--geometry",
                                          "grid", "--display",      "gpi-true",       "--range", "1000m"};
        if (begins) scene.insert(scene.end(), {"--range-start", "400m"});
        const Posts ground = ground_of(folder, scene);
        for (int row = 0; row < 101; ++row)
            for (int column = 0; column < 101; ++column) {
                const double arc_m = 30 * std::hypot(column - 50, row - 50);
                INFO("column " << column << " row " << row);
                CHECK(std::isnan(ground.at(column, row)) == (arc_m > 1000 || (begins && arc_m < 400)));
            }
    }
}

TEST_CASE("a raster whose edge has no place on earth needs a range for coverage, and the horizon is one",
          "[coverage]") {
    const Folder folder;
    Drawing world;  // a disc in its square
    world.columns = world.rows = 130;
    world.crs = "+proj=ortho +lat_0=36 +lon_0=-117 +datum=WGS84";
    world.geotransform = {{-6500000, 100000, 0, 6500000, 0, -100000}};
    world.value = [](int, int) { return 0.0; };
    draw(folder / "world.tif", world);
    const auto run = [&](std::vector<std::string> words, const std::vector<std::string>& more) {
        words.insert(words.begin(), WEDGESCOPE_PROGRAM);
        words.insert(words.end(), {"--latlon", "36,-117", "--altitude-msl", "20km", "--overwrite", "-q"});
        words.insert(words.end(), more.begin(), more.end());
        return run_program(words, folder / "log");
    };
    const std::vector<std::string> coverage = {"coverage", folder / "world.tif", folder / "seen.tif"};
    for (const char* earth : {"4/3", "flat"}) {
        INFO(earth);
        const auto refused = run(coverage, {"--earth", earth});
        CHECK(refused.code == 2);
        CHECK(refused.err.find("edge has no place on earth that a range could follow from; give a range") !=
              std::string::npos);
        CHECK(run(coverage, {"--earth", earth, "--range", "2000km"}).code == 0);
    }
    const std::vector<std::string> simulate = {
        "simulate",    "--dem", folder / "world.tif", "--report", folder / "report", "-o", folder / "x.png",
        "--range-bin", "1km",   "--quality",          "draft"};
    CHECK(run(simulate, {"--earth", "flat"}).code == 2);
    REQUIRE(run(simulate, {}).code == 0);
    const double range_m = json_in(folder / "report")["scene"]["resolved"]["range_m"];
    CHECK(range_m > 550e3);  // 4/3 earth: sqrt(2 * 8495 km * 20 km) = 583 km
    CHECK(range_m < 600e3);
    // What cannot be said of it ends no look at it.
    const pid_t child =
        start({WEDGESCOPE_PROGRAM, "info", "--json", folder / "world.tif"}, folder / "log", folder / "told");
    CHECK(wait_for(child, folder / "log").code == 0);
    CHECK(json_in(folder / "told")["files"][0]["wgs84"].is_null());
}

TEST_CASE("coarse posts lie where geodesics lead, or are refused", "[coverage]") {
    const Folder folder;
    struct Case {
        double lat, step_deg, range_m;
        int columns, rows;
        double column, row;  // of the sensor
        bool refused;
        double most = 0;  // posts off
    };
    for (const Case& k : {Case{45, 0.25, 700e3, 80, 60, 40.3, 30.2, false, 0.01},
                          Case{-72.5, 0.05, 380e3, 480, 150, 240.3, 75.2, false, 0.01},
                          Case{80, 0.02, 90e3, 500, 90, 250.3, 45.2, false, 0.01},
                          Case{72, 0.005, 300e3, 2000, 1100, 1000.3, 550.2, false, 0.01},
                          // Rays bend so that posts of its far corner lie on the first lines.
                          Case{-63.124493472005184, 0.1083, 775e3, 374, 506, 234.3155, 315.4775, false, 0.01},
                          Case{66.5, 0.35, 700e3, 120, 50, 60.3, 25.2, true},
                          Case{-74, 0.16, 260e3, 280, 60, 140.3, 30.2, false, 0.01}}) {
        Drawing d;
        d.columns = k.columns;
        d.rows = k.rows;
        d.type = GDT_Int16;
        d.crs = "EPSG:4326";
        d.geotransform = {-k.step_deg * (k.column + 0.5),     k.step_deg, 0,
                          k.lat + k.step_deg * (k.row + 0.5), 0,          -k.step_deg};
        draw(folder / "coarse.tif", d);
        constexpr double up_m = 10000;
        const auto lat = std::to_string(k.lat), range = std::to_string(k.range_m) + "m";
        const Ended ended =
            run_program({WEDGESCOPE_PROGRAM, "coverage", "--latlon", lat + ",0", "--altitude-msl", "10000m", "--range",
                         range, "--layer", "range", "-q", "--overwrite", folder / "coarse.tif", folder / "range.tif"},
                        folder / "log");
        INFO("latitude " << lat << ", posts of " << k.step_deg << " degrees: " << ended.err);
        if (k.refused) {
            CHECK(ended.code == 1);
            CHECK_THAT(ended.err, Catch::Contains("coarse.tif") && Catch::Contains("too coarse"));
            CHECK_FALSE(std::filesystem::exists(folder / "range.tif"));
            continue;
        }
        REQUIRE(ended.code == 0);
        const Posts ranges(folder / "range.tif");
        std::filesystem::remove(folder / "range.tif");
        const double post_m = k.step_deg * 111.7e3;  // the longer way
        double worst = 0;
        int in_range = 0, missed = 0;
        for (int r = 0; r < k.rows; ++r)
            for (int c = 0; c < k.columns; ++c) {
                const Line to = line(k.lat, 0, ranges.lat_lon(c, r));
                const double radius = effective_radius(to.azimuth, k.lat), sine = std::sin(0.5 * to.arc_m / radius),
                             truth = std::sqrt(up_m * up_m + 4 * radius * (radius + up_m) * sine * sine),
                             found = ranges.at(c, r);
                if (found == found) {
                    ++in_range;
                    worst = std::max(worst, std::abs(found - truth));
                } else {
                    missed += truth < k.range_m - post_m;
                }
            }
        CHECK(in_range > 300);
        CHECK(missed == 0);
        CHECK(worst < k.most * post_m);
    }
}

TEST_CASE("a last column that repeats the first is counted with it, wherever the sensor stands", "[coverage]") {
    const Folder folder;
    Drawing d;
    d.columns = 361;
    d.rows = 101;
    d.type = GDT_Int16;
    d.crs = "EPSG:4326";
    d.geotransform = {-180.5, 1, 0, 50.5, 0, -1};
    d.value = [](int c, int r) { return static_cast<double>((37 * (c % 360) + 11 * r) % 200); };
    draw(folder / "round.tif", d);
    for (const char* place : {"0,-179", "0,-180", "3,-175.5", "0,0"})
        for (const bool cull : {true, false}) {
            std::vector<std::string> words{WEDGESCOPE_PROGRAM,
                                           "coverage",
                                           "--latlon",
                                           place,
                                           "--altitude-msl",
                                           "300km",
                                           "--range",
                                           "1500km",
                                           "--layer",
                                           "states",
                                           "--report",
                                           folder / "r.json",
                                           "--overwrite",
                                           "-q",
                                           folder / "round.tif",
                                           folder / "s.tif"};
            if (!cull) words.push_back("--no-cull");
            const Ended ended = run_program(words, folder / "log");
            INFO(place << ended.err);
            REQUIRE(ended.code == 0);
            const Posts states(folder / "s.tif");
            std::map<int, std::uint64_t> counts;
            for (int r = 0; r < 101; ++r)
                for (int c = 0; c < 361; ++c) ++counts[static_cast<int>(states.at(c, r))];
            const auto told = json_in(folder / "r.json")["states"];
            const char* const names[] = {"no data", "shadow", "seen", "unknown", "outside"};
            for (int state = 0; state < 5; ++state) CHECK(told[names[state]] == counts[state]);
            CHECK(counts[2] > 300);
        }
}

TEST_CASE("a sensor just inside the last posts of a raster is not taken for one over coarse posts", "[coverage]") {
    const Folder folder;
    constexpr double step = 0.05;
    constexpr int posts = 60;
    Drawing d;
    d.columns = d.rows = posts;
    d.type = GDT_Int16;
    d.crs = "EPSG:4326";
    d.geotransform = {0, step, 0, 61, 0, -step};
    draw(folder / "edge.tif", d);
    for (const double inside : {0.3, 0.1, 0.01, 1e-5})
        for (const bool last : {false, true})
            for (const bool column : {false, true}) {
                const double at = last ? posts - 1 - inside : inside, middle = posts / 2;
                std::ostringstream place;
                place.precision(12);
                place << step * ((column ? at : middle) + 0.5) << ',' << 61 - step * ((column ? middle : at) + 0.5);
                const Ended ended =
                    run_program({WEDGESCOPE_PROGRAM, "coverage", "--xy", place.str(), "--altitude-agl", "500m",
                                 "--range", "100km", "-q", "--overwrite", folder / "edge.tif", folder / "mask.tif"},
                                folder / "log");
                INFO(place.str() << ": " << ended.err);
                CHECK(ended.code == 0);
            }
}

TEST_CASE("tiles that nothing of is seen hold the value of hidden ground, whatever no data is", "[coverage]") {
    const Folder folder;
    // A wall east of the sensor hides the tiles behind it; voids stand in one tile of the far corner, or nowhere.
    constexpr int columns = 900, rows = 700, edge = 256;
    const auto coverage = [&](const char* name, std::vector<std::string> words, const std::string& out) {
        words.insert(words.begin(), {WEDGESCOPE_PROGRAM, "coverage", folder / name, folder / out, "-q", "--overwrite"});
        const Ended ended = run_program(words, folder / "log");
        INFO(ended.err);
        REQUIRE(ended.code == 0);
        return Posts(folder / out);
    };
    for (const bool voids : {false, true}) {
        Drawing d;
        d.columns = columns;
        d.rows = rows;
        d.type = GDT_Int16;
        d.no_data = -9999;
        d.value = [&](int c, int r) {
            return voids && c > 800 && r > 600 ? -9999 : c == 60 || r == 100 || r == 500 ? 900 : (c + r) % 5;
        };
        const char* dem_name = voids ? "voids.tif" : "full.tif";
        draw(folder / dem_name, d);
        const std::vector<std::string> here = {"--xy", "1305,-1500", "--altitude-agl", "20m"};
        const auto from_here = [&](std::vector<std::string> words) {
            words.insert(words.end(), here.begin(), here.end());
            return words;
        };
        const Posts states = coverage(dem_name, from_here({"--layer", "states"}), "states.tif");
        std::size_t hidden_tiles = 0;
        for (int r = 0; r < rows; r += edge)
            for (int c = 0; c < columns; c += edge) {
                bool hidden = true;
                for (int y = r; y < std::min(r + edge, rows); ++y)
                    for (int x = c; x < std::min(c + edge, columns); ++x) hidden = hidden && states.at(x, y) == 1;
                hidden_tiles += hidden;
            }
        REQUIRE(hidden_tiles >= 4);
        std::ofstream(folder / "one.csv") << "x,y,altitude-agl\n1305,-1500,20\n";
        struct Case {
            std::vector<std::string> words;
            std::string out;
            std::optional<double> no_data;
            int seen = 255, hidden = 0, none = 1;
        };
        const std::optional<double> if_any = voids ? std::optional<double>(1) : std::nullopt,
                                    no_count = voids ? std::optional<double>(65535) : std::nullopt;
        const std::vector<Case> cases = {
            {here, "mask.tif", if_any},
            {from_here({"--co", "COMPRESS=NONE"}), "none.tif", if_any},
            {from_here({"--co", "SPARSE_OK=TRUE"}), "sparse.tif", if_any},
            {here, "mask.img", if_any},
            {from_here({"--no-data-value", "0", "--hidden-value", "7"}), "seven.tif", 0.0, 255, 7, 0},
            {from_here({"--no-data-value", "9"}), "nine.tif", 9.0, 255, 0, 9},
            {from_here({"--seen-value", "1"}), "ones.tif", voids ? std::optional<double>(2) : std::nullopt, 1, 0, 2},
            {{"--observers", folder / "one.csv"}, "count.tif", no_count, 1, 0, 65535},
        };
        for (const Case& c : cases) {
            INFO(c.out << (voids ? ", voids" : ""));
            const Posts mask = coverage(dem_name, c.words, c.out);
            CHECK(mask.no_data == c.no_data);
            std::size_t wrong = 0;
            for (std::size_t i = 0; i < mask.values.size(); ++i) {
                const int s = static_cast<int>(states.values[i]);
                wrong += mask.values[i] != (s == 0 ? c.none : s == 1 ? c.hidden : c.seen);
            }
            CHECK(wrong == 0);
        }
    }
}

TEST_CASE("a void is no data in every layer, and what is seen needs no height", "[coverage]") {
    const Folder folder;
    const Posts ground(dem);
    REQUIRE(ground.no_data);
    std::map<std::string, std::unique_ptr<Posts>> layers;
    for (const char* layer : {"mask", "states", "height", "range", "grazing", "depression"}) {
        const std::string out = folder / (std::string(layer) + ".tif");
        const Ended ended = run_program({WEDGESCOPE_PROGRAM, "coverage", dem, out, "--layer", layer, "--latlon",
                                         "44.45,-72.6", "--altitude-msl", "1500m", "-q"},
                                        folder / "log");
        INFO(ended.err);
        REQUIRE(ended.code == 0);
        layers[layer] = std::make_unique<Posts>(out);
        CHECK(layers[layer]->columns == ground.columns);
        CHECK(layers[layer]->rows == ground.rows);
        CHECK(layers[layer]->terms == ground.terms);
    }
    const Posts &mask = *layers["mask"], &states = *layers["states"], &height = *layers["height"];
    REQUIRE(mask.no_data);
    CHECK(*mask.no_data == 1);
    for (const char* layer : {"height", "range", "grazing", "depression"}) {
        REQUIRE(layers[layer]->no_data);
        CHECK(std::isnan(*layers[layer]->no_data));
    }
    std::map<int, std::size_t> count;
    std::size_t wrong_void = 0, wrong_seen = 0, wrong_height = 0;
    for (std::size_t i = 0; i < ground.values.size(); ++i) {
        const bool is_void = ground.values[i] == *ground.no_data;
        const int m = static_cast<int>(mask.values[i]), s = static_cast<int>(states.values[i]);
        ++count[s];
        wrong_void += (m == 1) != is_void || (s == 0) != is_void;
        for (const char* layer : {"height", "range", "grazing", "depression"})
            wrong_void += std::isnan(layers[layer]->values[i]) != is_void;
        wrong_seen += (m == 255) != (s == 2 || s == 3) || (m == 0) != (s == 1);
        if (!is_void) wrong_height += (height.values[i] == 0) != (m == 255) || height.values[i] < 0;
    }
    CHECK(wrong_void == 0);
    CHECK(wrong_seen == 0);
    CHECK(wrong_height == 0);
    CHECK(count[0] > 100000);  // a third of the raster
    CHECK(count[1] > 1000);
    CHECK(count[2] > 1000);
    CHECK(count.size() == 4);  // unknown too, behind the voids

    // Range, depression and grazing of some posts: the triangle of sensor, post and the effective earth's centre.
    std::size_t looked_at = 0, wrong_range = 0, wrong_depression = 0, wrong_grazing = 0;
    // Posts whose line from the sensor is known; the sensor's own column and row by the nearest post.
    double nearest = 1e9;
    int sensor_c = 0, sensor_r = 0;
    for (int r = 0; r < ground.rows; r += 5)
        for (int c = 0; c < ground.columns; c += 5)
            if (const double d = line(sensor_lat, sensor_lon, ground.lat_lon(c, r)).arc_m; d < nearest)
                nearest = d, sensor_c = c, sensor_r = r;
    for (int r = 3; r + 3 < ground.rows; r += 17)
        for (int c = 3; c + 3 < ground.columns; c += 13) {
            const double z = ground.at(c, r);
            if (z == *ground.no_data || std::abs(c - sensor_c) < 12 || std::abs(r - sensor_r) < 12) continue;
            const auto place = ground.lat_lon(c, r);
            const Line to = line(sensor_lat, sensor_lon, place);
            const double radius = effective_radius(to.azimuth), theta = to.arc_m / radius, a = radius + sensor_m,
                         b = radius + z;
            const double half = std::sin(theta / 2), slant = std::sqrt((a - b) * (a - b) + 4 * a * b * half * half);
            const double depression = std::atan2(a - b * std::cos(theta), b * std::sin(theta));
            const std::size_t i = ground.index(c, r);
            ++looked_at;
            wrong_range += !(std::abs(layers["range"]->values[i] - slant) < 0.5);
            wrong_depression += !(std::abs(layers["depression"]->values[i] * degree - depression) < 0.5 / slant);
            // The plane through the post and the neighbours on the sensor's side, east and north of the post.
            const int beside_c = c < sensor_c ? c + 1 : c - 1, beside_r = r < sensor_r ? r + 1 : r - 1;
            const double zc = ground.at(beside_c, r), zr = ground.at(c, beside_r);
            if (zc == *ground.no_data || zr == *ground.no_data) continue;
            const auto offset = [&](int column, int row) {
                const Line l = line(place.first, place.second, ground.lat_lon(column, row));
                return std::pair(l.arc_m * std::sin(l.azimuth), l.arc_m * std::cos(l.azimuth));
            };
            const auto [cx, cy] = offset(beside_c, r);
            const auto [rx, ry] = offset(c, beside_r);
            const double det = cx * ry - cy * rx, gx = ((zc - z) * ry - (zr - z) * cy) / det,
                         gy = (cx * (zr - z) - rx * (zc - z)) / det;
            // Towards the sensor: back along the line, up by the depression less the angle of the verticals.
            const double up = depression - theta, x = -std::sin(to.back) * std::cos(up),
                         y = -std::cos(to.back) * std::cos(up);
            const double grazing =
                std::asin((std::sin(up) - gx * x - gy * y) / std::sqrt(1 + gx * gx + gy * gy)) / degree;
            if (!(std::abs(layers["grazing"]->values[i] - grazing) < 0.05 + 60 / slant)) ++wrong_grazing;
        }
    CHECK(looked_at > 500);
    CHECK(wrong_range == 0);
    CHECK(wrong_depression == 0);
    CHECK(wrong_grazing == 0);
}

TEST_CASE("right below the sensor a target may stand above it, and a void is no data whatever the range",
          "[coverage][quick]") {
    const Folder folder;
    Drawing d;
    d.columns = d.rows = 41;
    d.no_data = -99;
    d.value = [](int c, int r) { return c == 20 && r == 20 ? -99.0 : 50.0; };
    draw(folder / "void.tif", d);
    d.value = [](int, int) { return 50.0; };
    draw(folder / "flat.tif", d);
    // On post (20, 20): 10 m over the ground.
    const auto run = [&](const char* input, const std::string& altitude, const std::vector<std::string>& more) {
        return covered(folder, input, {"-ox", "1205", "-oy", "1795", "--altitude-msl", altitude}, more);
    };
    const Posts above = run("flat.tif", "60m", {"--layer", "depression", "--target-height", "100m"});
    CHECK(above.at(20, 20) == -90);
    CHECK(above.at(21, 20) == Approx(-std::atan(90 / 10.0) / degree).margin(0.01));
    CHECK(run("flat.tif", "60m", {"--layer", "depression"}).at(20, 20) == 90);
    for (const bool up : {false, true}) {
        const std::string pitch = up ? "--pitch=0deg,90deg" : "--pitch=-90deg,0deg";
        const Posts high = run("flat.tif", "60m", {"--layer", "states", "--target-height", "100m", pitch}),
                    low = run("flat.tif", "60m", {"--layer", "states", pitch});
        for (const int c : {20, 21}) {
            CHECK(high.at(c, 20) == (up ? 2 : 4));
            CHECK(low.at(c, 20) == (up ? 4 : 2));
        }
    }
    for (const std::vector<std::string>& more : {std::vector<std::string>{}, {"--range", "150m"}}) {
        auto words = more;
        words.insert(words.end(), {"--layer", "states"});
        CHECK(run("void.tif", "60m", words).at(20, 20) == 0);
    }
}

TEST_CASE("the post right below the sensor has the slope of its ground, and its wall", "[coverage]") {
    const Folder folder;
    Drawing d;
    d.columns = d.rows = 41;
    const auto run = [&](const std::string& place, const std::vector<std::string>& more) {
        const std::vector<std::string> scene{"--xy",       place,  "--altitude-msl", "3km",
                                             "--geometry", "grid", "--earth",        "flat"};
        return static_cast<double>(covered(folder, "dem.tif", scene, more).at(20, 20));
    };
    // Planes that fall to the east and to the south; on post (20, 20), and a hand's breadth beside it.
    for (const auto& [east, south] : {std::pair{1.0, 0.0}, {0.3, -0.7}, {0.0, 0.0}}) {
        d.value = [&, e = east, s = south](int c, int r) { return 500 - 10 * (e * (c - 20) + s * (r - 20)); };
        draw(folder / "dem.tif", d);
        const double grazing = std::asin(1 / std::sqrt(1 + east * east + south * south)) / degree;
        CHECK(run("1205,1795", {"--layer", "grazing"}) == Approx(grazing).margin(1e-4));
        CHECK(run("1205.1,1795.1", {"--layer", "grazing"}) == Approx(grazing).margin(0.01));
        CHECK(run("1205,1795", {"--layer", "depression"}) == 90);
        const std::vector<std::string> law{"--layer",  "response",       "--backscatter", "oh",     "--antenna",
                                           "gaussian", "--antenna-knee", "0deg",          "--tilt", "90deg"};
        CHECK(run("1205,1795", law) == Approx(run("1205.1,1795.1", law)).margin(0.01));
    }
    // What stands there is a wall to it.
    d.value = [](int, int) { return 0.0; };
    draw(folder / "dem.tif", d);
    d.value = [](int c, int r) { return std::abs(c - 20) <= 2 && std::abs(r - 20) <= 2 ? 30.0 : 0.0; };
    draw(folder / "height.tif", d);
    const std::vector<std::string> town{"--layer",        "response", "--culture-height", folder / "height.tif",
                                        "--material",     "urban",    "--antenna",        "gaussian",
                                        "--antenna-knee", "0deg",     "--tilt",           "90deg"};
    CHECK(run("1205,1795", town) == Approx(run("1205.1,1795.1", town)).margin(0.01));
}

TEST_CASE("posts on a sector's border are in it", "[coverage]") {
    const Folder folder;
    Drawing d;
    d.columns = d.rows = 61;
    d.value = [](int, int) { return 50.0; };
    draw(folder / "flat.tif", d);
    // On post (30, 30), north up; borders of 45 degrees run through posts.
    for (int from = 0; from < 360; from += 45)
        for (const int width : {45, 90, 135, 180}) {
            const int turn = from + width > 360 ? 360 : 0, to = from + width;
            const Ended ended = run_program(
                {WEDGESCOPE_PROGRAM, "coverage", folder / "flat.tif", folder / "out.tif", "-ox", "1305", "-oy", "1695",
                 "--altitude-agl", "100m", "--geometry", "grid", "--layer", "states", "--sector",
                 std::to_string(from - turn) + "deg," + std::to_string(to - turn) + "deg", "--overwrite", "-q"},
                folder / "log");
            INFO(from << " to " << to << "\n" << ended.err);
            REQUIRE(ended.code == 0);
            const Posts posts(folder / "out.tif");
            for (int azimuth = 0; azimuth < 360; azimuth += 45) {
                const bool in = (azimuth - from + 360) % 360 <= width;
                const int east = (azimuth > 0 && azimuth < 180) - (azimuth > 180),
                          south = (azimuth > 90 && azimuth < 270) - (azimuth < 90 || azimuth > 270);
                int inside = 0;
                for (int k = 1; k <= 30; ++k) inside += posts.at(30 + k * east, 30 + k * south) == 2 ? 1 : 0;
                INFO("azimuth " << azimuth);
                CHECK(inside == (in ? 30 : 0));
            }
        }
}
