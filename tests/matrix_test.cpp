// The same bits, whatever the split, the threads, the memory, the source, the tiles and the way they were come by.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>

#include "lib/coverage.hpp"
#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/terrain.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/sources.hpp"
#include "tiles/tile_store.hpp"

using namespace wedgescope;
using wedgescope::test::draw;
using wedgescope::test::Drawing;
using wedgescope::test::Folder;

namespace {

constexpr std::size_t mebibyte = std::size_t{1} << 20;

/// Keeps wedges in memory, as a work folder does on disk.
class HeldWedges final : public WedgeArchive {
public:
    std::vector<Interval> recorded_split() override { return split_; }
    std::vector<Interval> record_split(const std::vector<Interval>& wedges) override {
        if (split_.empty()) split_ = wedges;
        return split_;
    }
    std::optional<WedgeOutcome> find(const WedgeKey& key, std::span<float> echo_w,
                                     std::span<std::uint8_t> state) override {
        const std::lock_guard lock(mutex_);
        const auto held = held_.find(key.index);
        if (held == held_.end()) return std::nullopt;
        std::copy(held->second.echo_w.begin(), held->second.echo_w.end(), echo_w.begin());
        std::copy(held->second.state.begin(), held->second.state.end(), state.begin());
        return held->second.outcome;
    }
    void keep(const WedgeKey& key, const WedgeOutcome& outcome, std::span<const float> echo_w,
              std::span<const std::uint8_t> state) override {
        const std::lock_guard lock(mutex_);
        held_[key.index] = {outcome, {echo_w.begin(), echo_w.end()}, {state.begin(), state.end()}};
    }

private:
    struct Held {
        WedgeOutcome outcome;
        std::vector<float> echo_w;
        std::vector<std::uint8_t> state;
    };
    std::mutex mutex_;
    std::vector<Interval> split_;
    std::map<std::int64_t, Held> held_;
};

struct Bits {
    RawVector<float> echo_w;
    RawVector<std::uint8_t> state;
    bool operator==(const Bits& other) const {
        return state == other.state && echo_w.size() == other.echo_w.size() &&
               std::memcmp(echo_w.data(), other.echo_w.data(), echo_w.size() * sizeof(float)) == 0;
    }
};

Bits bits(const RunResult& r) { return {r.echo_w.cells, r.echo_state.cells}; }

/// The states of all posts.
std::vector<std::uint8_t> covered(const Scene& scene, WedgeSource& source, int threads, std::size_t memory, bool cull) {
    const DataBase& db = source.data_base();
    std::vector<std::uint8_t> posts(static_cast<std::size_t>(db.columns * db.rows));
    CoverageParams params;
    params.layer = CoverageLayer::states;
    params.threads = threads;
    params.memory_bytes = memory;
    params.cull = cull;
    cover(resolve_coverage(scene, source), source, params, [&](const CoverageTile& tile) {
        for (std::int64_t r = tile.window.rows.begin; r < tile.window.rows.end; ++r)
            std::copy_n(tile.bytes + (r - tile.window.rows.begin) * tile.stride, tile.window.columns.size(),
                        posts.begin() + r * db.columns + tile.window.columns.begin);
    });
    return posts;
}

}  // namespace

TEST_CASE("no way of running a scene changes a bit of it", "[matrix]") {
    // On a plane, on the ellipsoid, and on a plane with lakes whose far shores are bright.
    const auto [lat_lon, lakes] = GENERATE(std::pair{false, false}, std::pair{true, false}, std::pair{false, true});
    const Folder folder;
    const int columns = 380, rows = 330;
    const auto shape = test::rolling(500, 110, 23);
    Drawing terrain;
    terrain.columns = columns;
    terrain.rows = rows;
    terrain.type = GDT_Int16;
    terrain.no_data = -32768;
    const double floor_m = lakes ? 560 : 0;
    const auto height_m = [&shape, floor_m](int c, int r) { return std::max(floor_m, std::round(600 + shape(c, r))); };
    terrain.value = [&](int c, int r) {
        const bool lake = c > 40 && c < 90 && r > 200 && r < 290;  // no data
        return lake || (c * 31 + r * 17) % 1409 == 0 ? -32768 : height_m(c, r);
    };
    if (lat_lon) {
        terrain.crs = "EPSG:4326";
        terrain.geotransform = {{10.3, 1.0 / 3600, 0, 61.2, 0, -1.0 / 3600}};
    } else {
        terrain.geotransform = {{500000, 30, 0, 4100000, 0, -30}};
    }
    Drawing culture = terrain;
    culture.type = GDT_Byte;
    culture.no_data = 0;
    culture.value = [&](int c, int r) {
        if (lakes && height_m(c, r) == floor_m) return 11;
        return 11 + (c / 9 + r / 13) % 3;
    };
    Drawing height = culture;
    height.no_data.reset();
    height.value = [](int c, int r) { return (c / 5 + r / 6) % 7 == 0 ? 12.0 : 0.0; };
    const Legend legend("drawn", {{11, 0}, {12, 5}, {13, 15}});

    Scene scene;
    if (lat_lon)
        scene.platform.latlon = LatLon{61.2 - 150.3 / 3600, 10.3 + 201.7 / 3600};
    else
        scene.platform.xy = PointXY{500000 + 30 * 201.7, 4100000 - 30 * 150.3};
    scene.platform.altitude_m = 1400;
    scene.range_m = lat_lon ? 4000 : 7000;
    scene.far_shore = lakes;
    scene.spokes_per_post = 1.25;  // a few: what is compared here are bits
    scene.spokes_per_bin = 2;
    scene.spoke_lead = 2;
    scene.azimuth_bins = 180;
    scene.range_bin_m = 60;
    scene.radar.antenna.beam = Angle::degrees(6);
    scene.display.size = 64;

    std::optional<Bits> straight;
    std::optional<std::vector<std::uint8_t>> seen;
    int runs = 0, ways = 0;
    // Of the lakes the ends will do.
    const std::vector<int> tiles = lakes ? std::vector{64, 512} : std::vector{64, 256, 512};
    const std::vector<std::size_t> memories =
        lakes ? std::vector{64 * mebibyte} : std::vector{64 * mebibyte, 1024 * mebibyte};
    for (const int tile : tiles)
        for (const bool store : {false, true}) {
            const std::string name = std::to_string(tile) + (store ? "store" : "raw");
            const std::string edge = std::to_string(tile);
            const std::string packing = tile == 64 ? "DEFLATE" : tile == 256 ? "NONE" : "ZSTD";
            for (Drawing* d : {&terrain, &culture, &height})
                d->creation = {"TILED=YES", "BLOCKXSIZE=" + edge, "BLOCKYSIZE=" + edge, "COMPRESS=" + packing};
            draw(folder / (name + "dem.tif"), terrain);
            draw(folder / (name + "culture.tif"), culture);
            draw(folder / (name + "height.tif"), height);
            DataBaseParams params;
            params.dem = folder / (name + "dem.tif");
            params.culture = folder / (name + "culture.tif");
            params.culture_height = folder / (name + "height.tif");
            params.culture_height_scale = 0.5;
            params.legend = legend;
            if (store) {
                TileStoreParams into;
                into.dems = {params.dem};
                into.culture = params.culture;
                into.culture_height = params.culture_height;
                into.output = folder / name;
                into.tile_posts = tile;
                into.cache_bytes = 8 * mebibyte;
                write_tile_store(into);
                params.dem = into.output;
                params.culture.clear();
                params.culture_height.clear();
            }
            for (const std::size_t memory : memories)
                for (const char* way : {"direct", "spilled, held", "spilled to disk"}) {
                    const bool spilled = way[0] == 's', to_disk = std::strstr(way, "disk") != nullptr;
                    params.cache_bytes = memory / 8;
                    GdalSession::set_cache_bytes(params.cache_bytes);
                    SpillOptions options;
                    options.temp_folder = folder / "";
                    options.memory_bytes = memory;
                    const auto open = [&]() -> std::unique_ptr<WedgeSource> {
                        if (!spilled) return open_direct_source(params);
                        if (!to_disk) return open_spilled_source(params, scene, options);
                        // The least memory that the pass makes do with. A quarter of it is too little for all blocks,
                        // unless the raster is one tile.
                        params.cache_bytes = 0;
                        for (options.memory_bytes = mebibyte;; options.memory_bytes += mebibyte / 2) {
                            REQUIRE(options.memory_bytes < memory);
                            try {
                                auto source = open_spilled_source(params, scene, options);
                                CHECK((source->report().spilled_bytes > 0) == (tile < 512));
                                return source;
                            } catch (const TooLittleMemory&) {
                            }
                        }
                    };
                    const std::unique_ptr<WedgeSource> source = open();
                    const ResolvedScene resolved = resolve(scene, *source);
                    const auto run_with = [&](std::int64_t wedges, int threads, bool cull, bool resumed) {
                        EngineParams how;
                        how.wedges = wedges;
                        how.threads = threads;
                        how.memory_bytes = memory;
                        how.cull = cull;
                        HeldWedges archive;
                        if (resumed) {
                            // Half of them by a run that then ends.
                            how.archive = &archive;
                            how.only_wedges = Interval{0, (wedges + 1) / 2};
                            run(resolved, *source, how);
                            how.only_wedges.reset();
                        }
                        return bits(run(resolved, *source, how));
                    };
                    for (const std::int64_t wedges : {1, 7, 64})
                        for (const int threads : {1, 2})
                            for (const bool cull : {true, false})
                                for (const bool resumed : {false, true}) {
                                    // Every second one, the others with the next way: any two of these meet, and
                                    // all four in half of the ways.
                                    if ((threads + cull + resumed + ways) % 2) continue;
                                    const Bits got = run_with(wedges, threads, cull, resumed);
                                    ++runs;
                                    if (!straight) straight = got;
                                    INFO(name << ", memory " << memory / mebibyte << " MiB, " << way << ", " << wedges
                                              << " wedges, " << threads << " threads, cull " << cull << ", resumed "
                                              << resumed);
                                    CHECK(got == *straight);
                                }
                    ++ways;
                    options.all_round = options.all_of_it = true;
                    const std::unique_ptr<WedgeSource> round = open();
                    for (const int threads : {1, 2})
                        for (const bool cull : {true, false}) {
                            const auto got = covered(scene, *round, threads, memory, cull);
                            if (!seen) seen = got;
                            INFO(name << ", memory " << memory / mebibyte << " MiB, " << way << ", " << threads
                                      << " threads, cull " << cull);
                            CHECK(got == *seen);
                        }
                }
        }
    CHECK(runs == static_cast<int>(tiles.size() * 2 * memories.size() * 3 * 12));
    std::size_t lit = 0;
    for (const float w : straight->echo_w) lit += w > 0;
    CHECK(lit > straight->echo_w.size() / 10);
    for (const int state : {0, 1, 2, 3, 4}) CHECK(std::count(seen->begin(), seen->end(), state) > 0);
}
