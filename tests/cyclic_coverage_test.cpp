// Coverage where longitude begins again: the antimeridian, and rasters round the whole earth with their seam. From files and
// from stores, against an exact walk of each ray, and against the same ground cut elsewhere.
#include <catch2/catch.hpp>

#include <GeographicLib/Geodesic.hpp>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <vector>

#include "lib/coverage.hpp"
#include "lib/material.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/reference/line_of_sight.hpp"
#include "tests/terrain.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/sources.hpp"
#include "tiles/tile_store.hpp"

using namespace wedgescope;
using test::Drawing;
using test::Folder;

namespace {

const GdalSession session(std::size_t{16} << 20, {});

/// The height of ground by place, posts east of the prime meridian (any turn) and south of the uppermost row. Steps are
/// binary fractions of a degree: cut at whichever post, its posts stand at the same longitudes to the bit.
struct Ground {
    double step_deg = 0, north = 0;  ///< of the uppermost row
    int rows = 0;
    std::function<double(double east, double south)> height_m;
    int circle() const { return static_cast<int>(360 / step_deg); }
};

/// Part of it as a raster: from post `first` on.
struct Cut {
    int first = 0, columns = 0;
};

void draw(const std::string& path, const Ground& g, const Cut& cut) {
    Drawing d;
    d.columns = cut.columns;
    d.rows = g.rows;
    d.crs = "EPSG:4326";
    d.geotransform = {{(cut.first - 0.5) * g.step_deg, g.step_deg, 0, g.north + 0.5 * g.step_deg, 0, -g.step_deg}};
    d.value = [&](int c, int r) { return g.height_m(cut.first + c, r); };
    test::draw(path, d);
}

std::unique_ptr<WedgeSource> open(const std::string& path) {
    DataBaseParams params;
    params.dem = path;
    params.cache_bytes = std::size_t{4} << 20;
    return open_direct_source(params);
}

void tile(const std::string& raster, const std::string& store) {
    TileStoreParams params;
    params.dems = {raster};
    params.output = store;
    params.tile_posts = 64;
    params.memory_bytes = std::size_t{256} << 20;
    params.cache_bytes = std::size_t{16} << 20;
    params.software = "test";
    write_tile_store(params);
}

struct Result {
    std::int64_t columns = 0;
    std::vector<float> values;  ///< of all layers
    std::uint64_t passed = 0;   ///< posts neither swept nor tested
    float at(std::int64_t c, std::int64_t r) const { return values[static_cast<std::size_t>(r * columns + c)]; }
    /// Column of post `east` of the ground, if the raster begins at `first`.
    float of(const Ground& g, const Cut& cut, int east, std::int64_t r) const {
        const int c = (east - cut.first) % g.circle();
        return at(c < 0 ? c + g.circle() : c, r);
    }
};

Result look(WedgeSource& source, const Scene& scene, const CoverageParams& params) {
    const DataBase& db = source.data_base();
    Result out;
    out.columns = db.columns;
    out.values.assign(static_cast<std::size_t>(db.columns * db.rows), -99);
    const CoverageReport report = cover(resolve_coverage(scene, source), source, params, [&](const CoverageTile& tile) {
        for (std::int64_t r = tile.window.rows.begin; r < tile.window.rows.end; ++r)
            for (std::int64_t c = tile.window.columns.begin; c < tile.window.columns.end; ++c) {
                const auto at = (r - tile.window.rows.begin) * tile.stride + c - tile.window.columns.begin;
                out.values[static_cast<std::size_t>(r * db.columns + c)] =
                    tile.bytes ? static_cast<float>(tile.bytes[at]) : tile.values[at];
            }
    });
    out.passed = report.total().posts_passed;
    return out;
}

bool same(const std::vector<float>& a, const std::vector<float>& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                      [](float x, float y) { return x == y || (std::isnan(x) && std::isnan(y)); });
}

Scene scene_at(double lat, double lon, double height_m, double range_m) {
    Scene scene;
    scene.platform.latlon = LatLon{lat, lon};
    scene.platform.altitude_above = AltitudeAbove::sea_level;
    scene.platform.altitude_m = height_m;
    scene.range_m = range_m;
    return scene;
}

/// Posts of a cut, each `step`-th, by an exact walk of their rays over ground that goes on east and west of it.
struct Walked {
    std::size_t seen = 0, hidden = 0, wrong = 0;  ///< within range
    std::size_t others = 0, others_wrong = 0;     ///< voids and what is out of range: 1 in the mask

    Walked(const Ground& g, const Cut& cut, const Scene& scene, const Result& mask, int step) {
        const double lat = scene.platform.latlon->lat_deg, lon = scene.platform.latlon->lon_deg, range = *scene.range_m,
                     east = lon / g.step_deg;
        // As many posts either way as the range may hold.
        const int arm = static_cast<int>(1.3 * range / (80000 * g.step_deg)),
                  first = static_cast<int>(std::floor(east)) - arm;
        REQUIRE(2 * arm < g.circle());
        const bool all_round = cut.columns >= g.circle();
        const auto inside = [&](int e) {
            const int c = ((e - cut.first) % g.circle() + g.circle()) % g.circle();
            return all_round || c < cut.columns;
        };
        reference::Matrix matrix{2 * arm + 1, g.rows, {}};
        for (int r = 0; r < g.rows; ++r)
            for (int e = first; e <= first + 2 * arm; ++e)
                matrix.height.push_back(inside(e) ? static_cast<double>(static_cast<float>(g.height_m(e, r)))
                                                  : std::numeric_limits<double>::quiet_NaN());
        reference::Sensor sensor;
        sensor.column = east - first;
        sensor.row = (g.north - lat) / g.step_deg;
        sensor.height_m = scene.platform.altitude_m;
        sensor.earth_k = scene.earth_k;
        reference::Grid grid;
        grid.lat_lon = [&](double c, double r) {
            return std::optional(std::pair(g.north - r * g.step_deg, (first + c) * g.step_deg));
        };
        grid.column_row = [&](double la, double lo) {
            return std::pair(sensor.column + std::remainder(lo - lon, 360.0) / g.step_deg, (g.north - la) / g.step_deg);
        };
        const reference::LineOfSight sight(matrix, grid, sensor);
        const auto& geod = GeographicLib::Geodesic::WGS84();
        for (int r = 0; r < g.rows; r += step)
            for (int e = first; e <= first + 2 * arm; e += step) {
                if (!inside(e)) continue;
                const auto got = static_cast<int>(mask.of(g, cut, e, r));
                double arc_m = 0;
                geod.Inverse(lat, lon, g.north - r * g.step_deg, e * g.step_deg, arc_m);
                const bool near = arc_m < 1.05 * range;  // or else surely out of range
                const reference::Verdict v = near ? sight.look(e - first, r) : reference::Verdict{};
                if (v.state == reference::Verdict::no_data || v.slant_range_m > range) {
                    // Positions are good to a twentieth of a post.
                    if (v.state != reference::Verdict::no_data && v.slant_range_m < range + 5500 * g.step_deg) continue;
                    ++others;
                    others_wrong += got != 1;
                } else if (v.slant_range_m < range - 5500 * g.step_deg) {
                    ++(v.state == reference::Verdict::seen ? seen : hidden);
                    wrong += got != (v.state == reference::Verdict::seen ? 255 : 0);
                }
            }
    }
    double wrong_percent() const { return 100.0 * static_cast<double>(wrong) / static_cast<double>(seen + hidden); }
};

}  // namespace

TEST_CASE("a raster round the earth is covered across its seam as if it had none", "[cyclic]") {
    // Near the equator, where even posts of 28 km lie on a grid that is all but straight; an earth of 30 radii, so that
    // hills stand out on it.
    const auto hills = test::rolling(10000, 70, 3);
    const auto ground = [&](double east, double south) -> double {
        const double hole = std::remainder(east - 5 - 720, 1440);
        if (std::abs(hole) < 9 && std::abs(south - 20) < 4) return std::numeric_limits<double>::quiet_NaN();
        const double turn = 2 * std::numbers::pi * east / 1440, radius = 1440 / (2 * std::numbers::pi);
        return hills(radius * std::cos(turn) + 0.3 * south, radius * std::sin(turn) + 0.95 * south);
    };
    const Ground g{0.25, 15, 90, ground};
    const Folder folder;
    // Whole groups of 16 posts apart, which share what is linear within a group: then all bits are the same.
    const std::vector<Cut> cuts{{-720, 1440}, {-720, 1441}, {-736, 1440}, {-704, 1441}};
    const Cut elsewhere{0, 1440};
    const auto path = [&](std::size_t i, bool store) {
        return folder / ((store ? "store" : "world") + std::to_string(i) + (store ? "" : ".tif"));
    };
    for (std::size_t i = 0; i < cuts.size(); ++i) {
        draw(path(i, false), g, cuts[i]);
        tile(path(i, false), path(i, true));
    }
    draw(folder / "elsewhere.tif", g, elsewhere);
    const auto whole = open(folder / "elsewhere.tif");
    // Before, on and behind the seam, and so far from it that only rays cross it.
    for (const double lon : {180.0, -180.0, 179.875, 179.8, -179.97, -177.1, 173.3, 175.05}) {
        Scene scene = scene_at(4.03, lon, 7000, 1e6);
        scene.earth_k = 30;
        // From here as far as the next column of tiles behind the seam.
        const bool far = lon == 175.05;
        if (far) {
            scene.platform.altitude_m = 20000;
            scene.range_m = 4e6;
            scene.earth_k.reset();
        }
        for (const CoverageLayer layer : {CoverageLayer::mask, CoverageLayer::height}) {
            CoverageParams params;
            params.layer = layer;
            params.target_m = lon == 173.3 ? 300 : 0;
            const Result uncut = look(*whole, scene, params);
            if (layer == CoverageLayer::mask && params.target_m == 0 && !far) {
                const Walked truth(g, elsewhere, scene, uncut, 1);
                INFO("longitude " << lon << ": " << truth.seen << " seen, " << truth.hidden << " hidden, "
                                  << truth.wrong << " wrong; of " << truth.others << " others " << truth.others_wrong);
                CHECK(truth.seen > 800);
                CHECK(truth.hidden > 800);
                CHECK(truth.others > 1000);
                CHECK(truth.wrong_percent() < 0.7);
                CHECK(truth.others_wrong == 0);
            }
            for (std::size_t i = 0; i < cuts.size(); ++i)
                for (const bool store : {false, true})
                    for (const bool cull : {false, true}) {
                        INFO("longitude " << lon << ", cut " << i << (store ? ", store" : "")
                                          << (cull ? ", culled" : "") << ", layer " << static_cast<int>(layer));
                        const auto source = open(path(i, store));
                        CHECK(source->data_base().cycle_columns == 1440);
                        params.cull = cull;
                        const Result cut = look(*source, scene, params);
                        std::size_t unlike = 0;
                        for (int r = 0; r < g.rows; ++r)
                            for (int c = 0; c < cut.columns; ++c) {
                                const float a = cut.at(c, r), b = uncut.of(g, elsewhere, cuts[i].first + c, r);
                                unlike += !(a == b || (std::isnan(a) && std::isnan(b)));
                            }
                        CHECK(unlike == 0);
                    }
        }
    }
}

TEST_CASE("what a wall hides round a seam stays hidden, and is left out where blocks meet", "[cyclic][cull]") {
    const Folder folder;
    std::uint64_t passed = 0;
    for (const int extra : {0, 1}) {
        // A ring of 20 km, 10 posts round the sensor, on all but level ground.
        for (const int away : {-40, 0, 3, 40}) {
            const double at = 720 + away + 0.3;
            Ground g{0.25, 15, 90, [&](double east, double south) {
                         const double d = std::hypot(std::remainder(east - at, 1440), south - 44.6);
                         return d > 9 && d < 11 ? 20000.0 : 3 * std::sin(2 * east) * std::sin(south);
                     }};
            const Cut cut{-720, 1440 + extra};
            const std::string name = std::to_string(extra) + "_" + std::to_string(away),
                              raster = folder / (name + ".tif"), store = folder / name;
            draw(raster, g, cut);
            tile(raster, store);
            Scene scene = scene_at(15 - 44.6 * 0.25, std::remainder(at * 0.25, 360.0), 2000, 9e6);
            scene.earth_k = std::nullopt;
            for (const bool from_store : {false, true}) {
                const auto source = open(from_store ? store : raster);
                CoverageParams params;
                params.cull = false;
                const Result swept = look(*source, scene, params);
                params.cull = true;
                const Result culled = look(*source, scene, params);
                INFO("sensor " << away << " posts from the seam, " << cut.columns << " columns"
                               << (from_store ? ", store" : ""));
                CHECK(swept.passed == 0);
                CHECK(culled.passed > 0);
                CHECK(same(swept.values, culled.values));
                std::size_t wrong = 0, behind = 0;
                for (int r = 0; r < g.rows; ++r)
                    for (int c = 0; c < swept.columns; ++c) {
                        const double d = std::hypot(std::remainder(cut.first + c - at, 1440), r - 44.6);
                        if (d < 8) wrong += swept.at(c, r) != 255;
                        if (d < 12 || d > 300) continue;
                        ++behind;
                        wrong += swept.at(c, r) != 0;
                    }
                CHECK(wrong == 0);
                CHECK(behind > 40000);
                passed += culled.passed;
            }
        }
    }
    CHECK(passed > 100000);
}

TEST_CASE("round the earth each post returns as the class of culture on a grid of its own", "[cyclic]") {
    const auto hills = test::rolling(9000, 300, 29);
    const Ground g{0.25, 15, 90, [&](double east, double south) {
                       const double turn = 2 * std::numbers::pi * east / 1440, radius = 1440 / (2 * std::numbers::pi);
                       return hills(radius * std::cos(turn) + 0.3 * south, radius * std::sin(turn) + 0.95 * south);
                   }};
    // Cells of 0.4 degrees whose edges no post lies on, begun elsewhere than the terrain.
    constexpr double cell_deg = 0.4, cells_west = -143.27, cells_north = 15.37;
    const auto code = [](double column, double row) {
        const auto c = static_cast<int>(std::fmod(std::floor(column) + 900, 900)),
                   r = static_cast<int>(std::floor(row));
        return 1 + (7 * c + 3 * r + c / 5) % 3;
    };
    const Folder folder;
    Drawing d;
    d.columns = 900;
    d.rows = 60;
    d.type = GDT_Byte;
    d.crs = "EPSG:4326";
    d.geotransform = {{cells_west, cell_deg, 0, cells_north, 0, -cell_deg}};
    d.value = [&](int c, int r) { return code(c, r); };
    test::draw(folder / "classes.tif", d);
    const std::vector<Cut> cuts{{-720, 1440}, {-736, 1441}, {0, 1440}};
    const std::map<int, ClassId> legend{{1, 5}, {2, 8}, {3, 11}};
    CoverageParams params;
    params.layer = CoverageLayer::response;
    for (const double lon : {180.0, -179.97, 175.05, -143.2}) {
        Scene scene = scene_at(4.03, lon, 7000, 1e6);
        scene.earth_k = 30;
        const std::vector<ClassGamma> gamma = gamma_table(scene.radar.frequency_hz, std::nullopt);
        std::vector<Result> of_cut;
        for (const Cut& cut : cuts) {
            draw(folder / "world.tif", g, cut);
            DataBaseParams layers;
            layers.dem = folder / "world.tif";
            layers.cache_bytes = std::size_t{4} << 20;
            const Result bare = look(*open_direct_source(layers), scene, params);
            layers.culture = folder / "classes.tif";
            layers.legend = Legend("drawn", legend);
            of_cut.push_back(look(*open_direct_source(layers), scene, params));
            const Result& classes = of_cut.back();
            std::size_t seen = 0, over_seam = 0;
            double worst = 0;
            for (int r = 0; r < g.rows; ++r)
                for (int c = 0; c < cut.columns; ++c) {
                    const float value = classes.at(c, r);
                    CHECK(std::isnan(value) == std::isnan(bare.at(c, r)));
                    if (std::isnan(value)) continue;
                    const double east = (cut.first + c) * g.step_deg, north = g.north - r * g.step_deg;
                    const int here = code((east - cells_west) / cell_deg, (cells_north - north) / cell_deg);
                    const double ratio = gamma[legend.at(here)].ground / gamma[layers.default_class].ground;
                    worst = std::max(worst, std::abs(static_cast<double>(value) - static_cast<double>(bare.at(c, r)) -
                                                     10 * std::log10(ratio)));
                    ++seen;
                    over_seam += std::abs(east - lon) > 180;
                }
            INFO("longitude " << lon << ", raster from post " << cut.first << ": " << seen << " seen, " << over_seam
                              << " over the seam");
            CHECK(seen > 800);
            if (cut.first != 0 && std::abs(lon) > 170) CHECK(over_seam > 200);
            CHECK(worst < 1e-4);
        }
        std::size_t unlike = 0;
        for (std::size_t i = 0; i + 1 < cuts.size(); ++i)
            for (int r = 0; r < g.rows; ++r)
                for (int c = 0; c < cuts[i].columns; ++c) {
                    const float a = of_cut[i].at(c, r), b = of_cut.back().of(g, cuts.back(), cuts[i].first + c, r);
                    unlike += !(a == b || (std::isnan(a) && std::isnan(b)));
                }
        CHECK(unlike == 0);
    }
}

TEST_CASE("a raster over the antimeridian is covered as one anywhere", "[cyclic]") {
    // 400 x 300 posts of 1.7 km; the same ground lies round 180 degrees and round the prime meridian.
    const auto hills = test::rolling(2500, 120, 17);
    const Ground g{1.0 / 64, 6, 300,
                   [&](double east, double south) { return hills(std::remainder(east, 11520), south); }};
    const Folder folder;
    draw(folder / "prime.tif", g, {-200, 400});
    draw(folder / "east.tif", g, {11320, 400});   // columns run on beyond 180 degrees
    draw(folder / "west.tif", g, {-11720, 400});  // columns begin before -180 degrees
    for (const char* name : {"east", "west"}) tile(folder / (std::string(name) + ".tif"), folder / name);
    for (const auto& [east, row] :
         {std::pair{0.0, 150.0}, {0.4, 100.3}, {-31.5, 160.25}, {77.0, 20.0}, {260.0, 150.0}}) {
        const double lat = g.north - row * g.step_deg;
        const double here = std::remainder(180 + east * g.step_deg, 360.0);
        Scene scene = scene_at(lat, east * g.step_deg, 3300, 350e3);
        const Cut cut{-200, 400};
        const Result prime = look(*open(folder / "prime.tif"), scene, {});
        const Walked truth(g, cut, scene, prime, 3);
        INFO("sensor " << east << " posts east, row " << row << ": " << truth.seen << " seen, " << truth.hidden
                       << " hidden, " << truth.wrong << " wrong; of " << truth.others << " others "
                       << truth.others_wrong);
        CHECK(truth.seen > 300);
        CHECK(truth.hidden > 300);
        CHECK(truth.wrong_percent() < 0.2);
        CHECK(truth.others_wrong == 0);
        scene.platform.latlon->lon_deg = here;
        for (const char* name : {"east.tif", "west.tif", "east", "west"})
            for (const bool cull : {false, true}) {
                CoverageParams params;
                params.cull = cull;
                INFO(name << (cull ? ", culled" : ""));
                CHECK(same(look(*open(folder / name), scene, params).values, prime.values));
            }
    }
}
