// Coverage on real terrain against an exact walk of each ray over the bilinear surface.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "lib/coverage.hpp"
#include "tests/reference/line_of_sight.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/sources.hpp"

using namespace wedgescope;

namespace {

const std::string data = WEDGESCOPE_TEST_DATA;

std::vector<std::uint8_t> states_of(WedgeSource& source, const Scene& scene, Quality quality) {
    const DataBase& db = source.data_base();
    std::vector<std::uint8_t> all(static_cast<std::size_t>(db.columns * db.rows), 77);
    Scene asked = scene;
    asked.quality = quality;
    CoverageParams params;
    cover(resolve_coverage(asked, source), source, params, [&](const CoverageTile& tile) {
        for (std::int64_t r = tile.window.rows.begin; r < tile.window.rows.end; ++r)
            std::copy_n(tile.bytes + (r - tile.window.rows.begin) * tile.stride, tile.window.columns.size(),
                        all.begin() + r * db.columns + tile.window.columns.begin);
    });
    return all;
}

struct Place {
    const char* file;
    double column, row;  ///< of the sensor, parts of the raster
};

void compare(const Place& place, bool geodesic, const std::vector<double>& heights, std::size_t count = 100000) {
    const std::string path = data + "/" + place.file;
    DataBaseParams base;
    base.dem = path;
    base.cache_bytes = 64 << 20;
    const auto source = open_direct_source(base);
    const DataBase& db = source->data_base();
    const reference::Raster raster = reference::read(path, geodesic), second = reference::read(path, geodesic);
    const double column = std::floor(place.column * static_cast<double>(db.columns)) + 0.25,
                 row = std::floor(place.row * static_cast<double>(db.rows)) + 0.375;
    for (const double agl : heights) {
        Scene scene;
        scene.platform.xy = PointXY{db.origin_x + column * db.step_x, db.origin_y + row * db.step_y};
        scene.platform.altitude_above = AltitudeAbove::ground;
        scene.platform.altitude_m = agl;
        scene.geometry = geodesic ? Geometry::geodesic : Geometry::grid;
        const ResolvedScene resolved = resolve_coverage(scene, *source);
        reference::Sensor sensor;
        sensor.column = resolved.nadir.column;
        sensor.row = resolved.nadir.row;
        sensor.height_m = resolved.sensor_m;
        sensor.earth_k = 4.0 / 3;
        // Seeded posts, looked at by two threads, each with a reference of its own.
        std::mt19937 random(20240711);
        std::vector<std::size_t> posts;
        while (posts.size() < count) {
            const auto c = static_cast<std::int64_t>(random() % static_cast<unsigned>(db.columns)),
                       r = static_cast<std::int64_t>(random() % static_cast<unsigned>(db.rows));
            if (!std::isnan(raster.matrix.at(c, r))) posts.push_back(static_cast<std::size_t>(r * db.columns + c));
        }
        std::vector<char> truth(posts.size());
        const auto look = [&](const reference::Grid& grid, std::size_t begin, std::size_t end) {
            const reference::LineOfSight sight(raster.matrix, grid, sensor);
            for (std::size_t i = begin; i < end; ++i)
                truth[i] = sight
                               .look(static_cast<std::int64_t>(posts[i]) % db.columns,
                                     static_cast<std::int64_t>(posts[i]) / db.columns)
                               .state == reference::Verdict::seen;
        };
        std::thread other([&] { look(second.grid, posts.size() / 2, posts.size()); });
        look(raster.grid, 0, posts.size() / 2);
        other.join();
        for (const Quality quality : {Quality::normal, Quality::exact}) {
            const auto mask = states_of(*source, scene, quality);
            std::size_t wrong = 0, both = 0, either = 0, seen = 0, odd = 0;
            for (std::size_t i = 0; i < posts.size(); ++i) {
                const bool mine = mask[posts[i]] == 255, theirs = truth[i] != 0;
                odd += mask[posts[i]] != 255 && mask[posts[i]] != 0;
                wrong += mine != theirs;
                both += mine && theirs;
                either += mine || theirs;
                seen += theirs;
            }
            const double n = static_cast<double>(posts.size()), share = 100 * static_cast<double>(wrong) / n,
                         overlap = either ? static_cast<double>(both) / static_cast<double>(either) : 1,
                         visible = 100 * static_cast<double>(seen) / n;
            std::printf("%-28s %-8s %6.0f m  %-6s  visible %6.2f %%  wrong %7.4f %%  IoU %.4f\n", place.file,
                        geodesic ? "geodesic" : "grid", agl, word(quality), visible, share, overlap);
            std::fflush(stdout);
            CHECK(odd == 0);
            const bool fine = quality == Quality::exact;
            CHECK(share <= (fine ? 0.06 : 0.2));
            CHECK(overlap >= (fine ? (visible < 5 ? 0.99 : 0.997) : (visible < 5 ? 0.98 : 0.99)));
        }
    }
}

}  // namespace

const Place inland{"inland_empire_dem.tif", 0.45, 0.55}, lake{"lake_sunapee_dem.tif", 0.4, 0.6},
    vermont{"worcester_vermont_dem.tif", 0.5, 0.5}, olympic{"olympic_coast_dem.tif", 0.55, 0.45},
    azores{"azores_dem.tif", 0.36, 0.72}, degree{"N44W072.hgt", 0.5, 0.5};

TEST_CASE("posts of real terrain are judged as an exact walk of their rays judges them", "[coverage]") {
    const GdalSession session(64 << 20, {});
    compare(inland, true, {500});
    compare(lake, false, {30, 500, 3000});
    compare(vermont, true, {500});
    compare(olympic, true, {3000});
    compare(azores, true, {30});
    compare(degree, true, {30});
}

// The other heights, of fewer posts: a test of its own for ctest so that the two run side by side.
TEST_CASE("the same from every height", "[.][every-height]") {
    const GdalSession session(64 << 20, {});
    compare(inland, true, {30, 3000}, 40000);
    compare(vermont, true, {30, 3000}, 40000);
    compare(olympic, true, {30, 500}, 40000);
    compare(azores, true, {500, 3000}, 40000);
    compare(degree, true, {500, 3000}, 40000);
}
