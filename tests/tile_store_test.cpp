// The tile store holds what its rasters hold: post for post, by overview and block map, in the engine and for GDAL.
// Leaves rasters side by side to tile_store_seams.cpp, what is read of a store to tile_store_reads.cpp, and runs that are
// cut short or refused to tile_store_runs.cpp.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "lib/engine.hpp"
#include "tests/tile_stores.hpp"
#include "tiles/checksum.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/store_check.hpp"
#include "tiles/store_manifest.hpp"
#include "tools/options.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

namespace {

namespace fs = std::filesystem;

const std::string data = WEDGESCOPE_TEST_DATA;
const GdalSession session(std::size_t{16} << 20, {});  // for all sources of this program

}  // namespace

TEST_CASE("a store holds its rasters post for post, for any GDAL program", "[store]") {
    const Folder folder;
    const std::string store = folder / "store";
    auto params = into(store, {data + "/olympic_coast_dem.tif"});
    params.culture = data + "/olympic_coast_dem.tif";
    params.culture_height = folder / "height.tif";
    Drawing height;
    height.columns = 30;
    height.rows = 20;
    height.crs = "EPSG:4326";
    const Plain dem(params.dems[0]);
    height.geotransform = {{dem.g[0], 0.07, 0, dem.g[3], 0, -0.05}};
    height.value = [](int c, int r) { return 0.25 * c + r; };
    draw(params.culture_height, height);
    const TileStoreSummary summary = write_tile_store(params);
    CHECK(summary.layers.size() == 3);
    CHECK(summary.disagreements == 0);
    CHECK(summary.note.empty());

    for (const auto& [file, vrt] : {std::pair(params.dems[0], "dem.vrt"), std::pair(params.culture, "culture.vrt"),
                                    std::pair(params.culture_height, "culture_height.vrt")}) {
        INFO(vrt);
        const Plain raw(file), stored(store + "/" + vrt);
        CHECK(raw.columns == stored.columns);
        CHECK(raw.rows == stored.rows);
        CHECK(raw.type == stored.type);
        CHECK(raw.g == stored.g);
        CHECK(raw.has_no_data == stored.has_no_data);
        if (raw.has_no_data) CHECK(same(raw.no_data, stored.no_data));
        CHECK(same(raw.values, stored.values));
    }
    // Overviews that programs use by themselves: half the size and less.
    GDALDataset* sheet = GDALDataset::Open((store + "/dem/c0_r0.tif").c_str());
    REQUIRE(sheet);
    CHECK(sheet->GetRasterBand(1)->GetOverviewCount() == 4);
    CHECK(sheet->GetRasterBand(1)->GetOverview(0)->GetXSize() == 1801);
    GDALClose(sheet);
    CHECK(fs::exists(store + ".part") == false);
    CHECK(verify_store(store, nullptr, {}).damage.empty());
}

TEST_CASE("an overview keeps every second post of heights, and of 2 x 2 codes the most frequent", "[store]") {
    const Folder folder;
    const Drawing d = hills(300, 131);
    draw(folder / "dem.tif", d);
    Drawing codes = d;
    codes.value = [](int c, int r) { return (c / 3 + r / 2) % 5; };
    draw(folder / "codes.tif", codes);
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture = folder / "codes.tif";
    params.tile_posts = 64;
    write_tile_store(params);
    for (const char* layer : {"dem", "culture"}) {
        GDALDataset* sheet = GDALDataset::Open((folder / "store/" + layer + "/c0_r0.tif").c_str());
        REQUIRE(sheet);
        GDALRasterBand* band = sheet->GetRasterBand(1);
        REQUIRE(band->GetOverviewCount() == 3);
        int wide = 300, high = 131;
        std::vector<int> fine(300 * 131);
        REQUIRE(band->RasterIO(GF_Read, 0, 0, wide, high, fine.data(), wide, high, GDT_Int32, 0, 0, nullptr) ==
                CE_None);
        for (int k = 0; k < 3; ++k) {
            const int w = (wide + 1) / 2, h = (high + 1) / 2;
            std::vector<int> coarse(static_cast<std::size_t>(w * h));
            GDALRasterBand* overview = band->GetOverview(k);
            REQUIRE(overview->GetXSize() == w);
            REQUIRE(overview->GetYSize() == h);
            REQUIRE(overview->RasterIO(GF_Read, 0, 0, w, h, coarse.data(), w, h, GDT_Int32, 0, 0, nullptr) == CE_None);
            int wrong = 0;
            for (int r = 0; r < h; ++r)
                for (int c = 0; c < w; ++c) {
                    std::vector<int> valid;
                    for (int y = 2 * r; y < std::min(2 * r + 2, high); ++y)
                        for (int x = 2 * c; x < std::min(2 * c + 2, wide); ++x)
                            if (const int v = fine[static_cast<std::size_t>(y * wide + x)]; v != -32768)
                                valid.push_back(v);
                    int want = -32768;
                    if (!valid.empty() && std::string(layer) == "dem") {
                        want = fine[static_cast<std::size_t>(2 * r * wide + 2 * c)];
                    } else if (!valid.empty()) {
                        std::size_t votes = 0;
                        for (const int v : valid)
                            if (const auto n = static_cast<std::size_t>(std::count(valid.begin(), valid.end(), v));
                                n > votes) {
                                votes = n;
                                want = v;
                            }
                    }
                    wrong += coarse[static_cast<std::size_t>(r * w + c)] != want;
                }
            CHECK(wrong == 0);
            wide = w;
            high = h;
            fine = coarse;
        }
        GDALClose(sheet);
    }
}

TEST_CASE("heights read from a store are those of the raster, whatever type, scale, unit and mask it has", "[store]") {
    const Folder folder;
    std::vector<Drawing> drawings;
    Drawing d = hills(150, 90);
    drawings.push_back(d);
    d.geotransform = {{0, 5, 0, 100, 0, 5}};  // south-up
    drawings.push_back(d);
    d.geotransform.reset();
    d.crs.clear();
    drawings.push_back(d);
    d = hills(150, 90);
    d.scale = 0.1;
    d.offset = 7;
    d.unit = "ft";
    drawings.push_back(d);
    for (const GDALDataType type : {GDT_Byte, GDT_UInt16, GDT_Int32, GDT_UInt32, GDT_Float32, GDT_Float64}) {
        Drawing t;
        t.columns = 150;
        t.rows = 90;
        t.type = type;
        t.value = [](int c, int r) { return (c * 3 + r) % 200; };
        drawings.push_back(t);
        t.masked = [](int c, int r) { return (c + r) % 9 == 0; };
        if (type != GDT_UInt32) drawings.push_back(t);
        t.masked = {};
        t.no_data = type == GDT_Float64 ? -1.7976931348623157e308 : 17;
        drawings.push_back(t);
    }
    d.type = GDT_Float64;
    d.value = [](int c, int r) { return c == r ? std::nan("") : 0.1 * c - r / 3.0; };
    d.no_data.reset();
    drawings.push_back(d);
    d.type = GDT_Byte;
    d.creation = {"PIXELTYPE=SIGNEDBYTE"};
    d.value = [](int c, int) { return c - 75; };
    drawings.push_back(d);
    for (std::size_t i = 0; i < drawings.size(); ++i) {
        INFO("drawing " << i);
        const std::string file = folder / ("dem" + std::to_string(i) + ".tif"),
                          store = folder / ("store" + std::to_string(i));
        draw(file, drawings[i]);
        auto params = into(store, {file});
        params.tile_posts = 64;
        write_tile_store(params);
        const auto raw = open_direct_source(base(file)), stored = open_direct_source(base(store));
        CHECK(same(heights(*raw), heights(*stored)));
        const DataBase &a = raw->data_base(), &b = stored->data_base();
        CHECK(a.origin_x == b.origin_x);
        CHECK(a.origin_y == b.origin_y);
        CHECK(a.step_x == b.step_x);
        CHECK(a.step_y == b.step_y);
        CHECK(a.metres_per_unit == b.metres_per_unit);
        CHECK(a.has_crs == b.has_crs);
        const Extremes x = raw->extremes(), y = stored->extremes();
        CHECK(x.lowest_m == y.lowest_m);
        CHECK(x.highest_m == y.highest_m);
        CHECK(x.void_posts == y.void_posts);
    }
}

TEST_CASE("fractions that a VRT makes of whole numbers are in the store, and within its bounds", "[store]") {
    const Folder folder;
    Drawing d;
    d.columns = 300;
    d.rows = 200;
    d.type = GDT_Byte;
    d.value = [](int c, int r) { return (c * 7 + r * 3) % 200; };
    draw(folder / "whole.tif", d);
    const auto vrt = [&](const std::string& name, const std::string& source) {
        std::ofstream(folder / name) << "<VRTDataset rasterXSize='300' rasterYSize='200'><SRS>EPSG:32611</SRS>"
                                        "<GeoTransform>400000, 30, 0, 4500000, 0, -30</GeoTransform>"
                                        "<VRTRasterBand dataType='Byte' band='1'>"
                                     << source << "</VRTRasterBand></VRTDataset>";
    };
    const std::string file = "<SourceFilename relativeToVRT='1'>whole.tif</SourceFilename><SourceBand>1</SourceBand>";
    vrt("half.vrt",
        "<ComplexSource>" + file + "<ScaleOffset>0.25</ScaleOffset><ScaleRatio>0.1</ScaleRatio></ComplexSource>");
    vrt("plain.vrt", "<SimpleSource>" + file + "</SimpleSource>");
    for (const auto& [name, type] : {std::pair{"half.vrt", GDT_Float32}, {"plain.vrt", GDT_Byte}}) {
        INFO(name);
        const std::string store = folder / (std::string(name) + ".store");
        write_tile_store(into(store, {folder / name}));
        DataBaseParams raw, stored;
        raw.dem = folder / name;
        stored.dem = store;
        const auto a = open_direct_source(raw), b = open_direct_source(stored);
        const Window all{{0, 300}, {0, 200}};
        const Chunk x = a->load(all, false), y = b->load(all, false);
        CHECK(std::equal(x.surface_m.begin(), x.surface_m.end(), y.surface_m.begin(), y.surface_m.end()));
        CHECK(a->extremes().highest_m == b->extremes().highest_m);
        CHECK(a->extremes().lowest_m == b->extremes().lowest_m);
        const GDALDatasetUniquePtr file_of(GDALDataset::Open((store + "/dem.vrt").c_str()));
        REQUIRE(file_of);
        CHECK(file_of->GetRasterBand(1)->GetRasterDataType() == type);
    }
}

TEST_CASE("rasters of 64 bits with a no-data value are stored with their overviews", "[store]") {
    const Folder folder;
    for (const auto& [type, no_data] : {std::pair{GDT_Int64, -9999.0}, {GDT_UInt64, 0.0}}) {
        Drawing d;
        d.columns = 200;
        d.rows = 40;
        d.type = type;
        d.no_data = no_data;
        const double none = no_data;
        // A tile of the sea, all 0, and where that is no data one of data.
        d.value = [none](int c, int r) {
            return c == 7 && r == 5 ? none : c >= 64 && c < 128 ? 0.0 : 100.0 + c + 3 * r;
        };
        draw(folder / "dem.tif", d);
        auto params = into(folder / "store", {folder / "dem.tif"});
        params.tile_posts = 64;
        params.overwrite = true;
        write_tile_store(params);
        GDALDataset* sheet = GDALDataset::Open((folder / "store/dem/c0_r0.tif").c_str());
        REQUIRE(sheet);
        GDALRasterBand* band = sheet->GetRasterBand(1);
        CHECK(band->GetRasterDataType() == type);
        CHECK(band->GetOverviewCount() == 2);
        int has = 0;
        CHECK((type == GDT_Int64 ? static_cast<double>(band->GetNoDataValueAsInt64(&has))
                                 : static_cast<double>(band->GetNoDataValueAsUInt64(&has))) == no_data);
        CHECK(has);
        std::vector<double> posts(200 * 40);
        REQUIRE(band->RasterIO(GF_Read, 0, 0, 200, 40, posts.data(), 200, 40, GDT_Float64, 0, 0, nullptr) == CE_None);
        for (int r = 0; r < 40; ++r)
            for (int c = 0; c < 200; ++c) REQUIRE(posts[static_cast<std::size_t>(r * 200 + c)] == d.value(c, r));
        GDALClose(sheet);
        CHECK(verify_store(folder / "store", nullptr, {}).damage.empty());
    }
}

TEST_CASE("a mask beside a no-data value that no post can have hides in the store what it hides in the raster",
          "[store]") {
    const Folder folder;
    for (const auto& [type, no_data] : {std::pair{GDT_Byte, -9999.0}, {GDT_UInt16, -1.0}, {GDT_Int16, 40000.0}}) {
        INFO(GDALGetDataTypeName(type));
        Drawing d;
        d.columns = d.rows = 64;
        d.type = type;
        d.no_data = no_data;
        d.value = [](int c, int r) { return 100 + (c + r) % 40; };
        d.masked = [](int c, int r) { return c < 20 && r < 20; };
        draw(folder / "dem.tif", d);
        auto params = into(folder / "store", {folder / "dem.tif"});
        params.overwrite = true;
        write_tile_store(params);
        const TileStore store(folder / "store");
        std::vector<float> heights(64 * 64);
        store.layer(StoreLayerKind::dem)->read_heights({{0, 64}, {0, 64}}, heights.data(), 64);
        for (int r = 0; r < 64; ++r)
            for (int c = 0; c < 64; ++c) {
                const float height = heights[static_cast<std::size_t>(r * 64 + c)];
                if (d.masked(c, r))
                    REQUIRE(std::isnan(height));
                else
                    REQUIRE(static_cast<double>(height) == d.value(c, r));
            }
    }
}

TEST_CASE("the ends of 64-bit integers are told as they are", "[store]") {
    const Folder folder;
    RasterFacts facts;
    facts.has_no_data = true;
    facts.no_data = -0x1p63;
    CHECK(whole_no_data<std::int64_t>(facts) == INT64_MIN);
    facts.no_data = 0x1p63;
    CHECK(whole_no_data<std::int64_t>(facts) == INT64_MAX);
    facts.no_data = 0x1p64;
    CHECK(whole_no_data<std::uint64_t>(facts) == UINT64_MAX);
    Drawing d;
    d.type = GDT_Int64;
    d.columns = d.rows = 64;
    d.value = [](int c, int r) { return 100 + (c + r) % 40; };
    draw(folder / "dem.tif", d);
    GDALDataset* opened = GDALDataset::Open((folder / "dem.tif").c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE);
    REQUIRE(opened);
    opened->GetRasterBand(1)->SetNoDataValueAsInt64(INT64_MIN);
    GDALClose(opened);
    write_tile_store(into(folder / "store", {folder / "dem.tif"}));
    opened = GDALDataset::Open((folder / "store/dem.vrt").c_str());
    REQUIRE(opened);
    CHECK(opened->GetRasterBand(1)->GetNoDataValueAsInt64() == INT64_MIN);
    GDALClose(opened);
}

TEST_CASE("bounds of blocks are those of their posts at every level", "[store][threads]") {
    const Folder folder;
    // Wide enough for two levels and pages; heights on a coarser grid; a block of nothing but voids.
    Drawing d = hills(2500, 150);
    const auto plain = d.value;
    d.value = [=](int c, int r) { return c >= 640 && c < 720 ? -32768 : plain(c, r); };
    draw(folder / "dem.tif", d);
    Drawing h;
    h.columns = 400;
    h.rows = 30;
    h.geotransform = {{1000, 63, 0, 1990, 0, -49}};
    h.value = [](int c, int r) { return (c * r) % 17; };
    draw(folder / "height.tif", h);
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture_height = folder / "height.tif";
    params.tile_posts = 128;
    write_tile_store(params);
    CHECK(wrong_blocks(folder / "store", 1, false) == 0);
    CHECK(wrong_blocks(folder / "store", 0.1F, false) == 0);
    auto read = base(folder / "store");
    for (const double scale : {0.0, 0.1, 1.0, 25.0}) {
        read.culture_height_scale = scale;
        auto raw = base(folder / "dem.tif");
        raw.culture_height = folder / "height.tif";
        raw.culture_height_scale = scale;
        const Extremes a = open_direct_source(raw)->extremes(), b = open_direct_source(read)->extremes();
        CHECK(a.lowest_m == b.lowest_m);
        CHECK(a.highest_m == b.highest_m);
        CHECK(a.void_posts == b.void_posts);
    }

    for (const int extra : {0, 1}) {
        Drawing world;
        world.columns = 360 + extra;
        world.rows = 100;
        world.crs = "EPSG:4326";
        world.geotransform = {{-180.5, 1, 0, 50, 0, -1}};
        world.value = [](int c, int r) { return c % 360 == 0 ? 5000 + r : c % 50; };
        draw(folder / "world.tif", world);
        const std::string store = folder / ("world" + std::to_string(extra));
        write_tile_store(into(store, {folder / "world.tif"}));
        CHECK(wrong_blocks(store, 1, extra == 0) == 0);
        CHECK(open_direct_source(base(store))->extremes().highest_m == 5099);
    }
}

TEST_CASE("a store keeps what one unit of its culture heights is; scenes over it take that unless they are told",
          "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(300, 200));
    Drawing h;
    h.columns = 300;
    h.rows = 200;
    h.value = [](int c, int r) { return (c * r) % 170; };
    draw(folder / "height.tif", h);
    auto params = into(folder / "metres", {folder / "dem.tif"});
    params.culture_height = folder / "height.tif";
    write_tile_store(params);
    CHECK_FALSE(store_height_scale(folder / "metres").has_value());
    CHECK_FALSE(store_height_scale(folder / "dem.tif").has_value());
    params.culture_height_scale = 0.1;
    params.output = folder / "tenths";
    write_tile_store(params);
    CHECK(store_height_scale(folder / "tenths") == 0.1);
    CHECK(describe_store(folder / "tenths").culture_height_scale == 0.1);
    CHECK(verify_store(folder / "tenths", nullptr, {}).damage.empty());
    // Values as they were, metres for others.
    const Plain metres((folder / "metres") + "/culture_height.vrt"),
        tenths((folder / "tenths") + "/culture_height.vrt");
    CHECK(same(metres.values, tenths.values));
    CHECK(metres.scale == 1);
    CHECK(tenths.scale == 0.1);
    // Over what the raster's own values count for already.
    h.scale = 0.5;
    h.offset = 10;
    draw(folder / "scaled.tif", h);
    params.culture_height = folder / "scaled.tif";
    params.output = folder / "scaled";
    write_tile_store(params);
    const Plain scaled((folder / "scaled") + "/culture_height.vrt");
    CHECK(scaled.scale == Approx(0.05));
    CHECK(scaled.offset == Approx(1));
    // Not to be gone on with as if nothing was.
    CHECK(contents(folder / "metres")["plan.json"] != contents(folder / "tenths")["plan.json"]);

    const auto scale = [&](const std::string& dem, const std::vector<std::string>& more) {
        std::vector<std::string> words{"--dem", dem, "--latlon", "1,2", "--altitude-msl", "2km"};
        words.insert(words.end(), more.begin(), more.end());
        return parse_arguments(command_simulate, words).culture_height_scale;
    };
    CHECK(scale(folder / "tenths", {}) == 0.1);
    CHECK(scale(folder / "tenths", {"--culture-height-scale", "1"}) == 1);
    CHECK(scale(folder / "tenths", {"--culture-height", folder / "height.tif"}) == 1);  // another's
    CHECK(scale(folder / "metres", {}) == 1);
    CHECK(parse_arguments(command_coverage, {folder / "tenths", folder / "mask.tif"}).culture_height_scale == 0.1);
    CHECK(parse_arguments(command_tile, {"--around", "1,2", folder / "tenths"}).culture_height_scale == 0.1);
}

TEST_CASE("a scene over a store is the scene over the rasters, bit for bit", "[store][threads][long]") {
    const Folder folder;
    auto params = into(folder / "store", {data + "/worcester_vermont_dem.tif"});
    params.culture = data + "/worcester_vermont_culture.tif";
    params.culture_height = data + "/worcester_vermont_canopy.tif";
    params.legend_name = "fbfm40";
    params.tile_posts = 64;
    write_tile_store(params);
    auto raw_params = base(params.dems[0]);
    raw_params.culture = params.culture;
    raw_params.culture_height = params.culture_height;
    raw_params.legend = Legend::built_in("fbfm40");
    auto store_params = base(folder / "store");
    raw_params.culture_height_scale = store_params.culture_height_scale = 0.1;
    const auto raw = open_direct_source(raw_params), store = open_direct_source(store_params);
    CHECK(store->data_base().has_culture);
    CHECK(store->data_base().has_culture_height);
    Scene scene;
    const DataBase& d = raw->data_base();
    scene.platform.xy = PointXY{d.origin_x + 0.4 * static_cast<double>(d.columns) * d.step_x,
                                d.origin_y + 0.5 * static_cast<double>(d.rows) * d.step_y};
    scene.platform.altitude_above = AltitudeAbove::sea_level;
    scene.platform.altitude_m = 1400;
    EngineParams engine;
    engine.threads = 2;
    const RunResult a = run(resolve(scene, *raw), *raw, engine), b = run(resolve(scene, *store), *store, engine);
    REQUIRE(a.scene.swept.cells() == b.scene.swept.cells());
    const std::size_t cells = a.scene.swept.cells();
    CHECK(std::memcmp(a.echo_w.row(0), b.echo_w.row(0), cells * sizeof(float)) == 0);
    CHECK(std::memcmp(a.echo_state.row(0), b.echo_state.row(0), cells) == 0);
    std::size_t lit = 0;
    for (std::size_t i = 0; i < cells; ++i) lit += a.echo_w.row(0)[i] > 0;
    CHECK(lit > cells / 10);
}

TEST_CASE("layers are kept as they are up to a size, and packed beyond it or where that is asked for", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(600, 400));
    auto params = into(folder / "store", {folder / "dem.tif"});
    CHECK(TileStoreParams{}.most_as_it_is == std::int64_t{1} << 31);
    struct Case {
        std::int64_t most;
        std::vector<std::string> creation;
        std::string compression, predictor;
    };
    const std::int64_t bytes = 600 * 400 * 2;
    for (const Case& c : {Case{bytes, {}, "", ""}, Case{bytes - 1, {}, "ZSTD", "2"},
                          Case{bytes, {"COMPRESS=ZSTD"}, "ZSTD", "2"}, Case{bytes, {"PREDICTOR=1"}, "ZSTD", ""},
                          Case{bytes, {"ZSTD_LEVEL=3"}, "ZSTD", "2"}, Case{bytes - 1, {"COMPRESS=NONE"}, "", ""},
                          Case{bytes, {"COMPRESS=DEFLATE", "PREDICTOR=1"}, "DEFLATE", ""}}) {
        CAPTURE(c.most, c.creation);
        params.most_as_it_is = c.most;
        params.creation = c.creation;
        params.overwrite = true;
        write_tile_store(params);
        GDALDataset* sheet = GDALDataset::Open((folder / "store/dem/c0_r0.tif").c_str());
        REQUIRE(sheet);
        const auto item = [&](const char* name) {
            const char* words = sheet->GetMetadataItem(name, "IMAGE_STRUCTURE");
            return std::string(words ? words : "");
        };
        CHECK(item("COMPRESSION") == c.compression);
        CHECK(item("PREDICTOR") == c.predictor);
        GDALClose(sheet);
    }
}

TEST_CASE("a scene keeps the decoded tiles of a few strips, of tiles that are not packed sixteen or 4 MiB", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(3000, 2000));
    auto params = into(folder / "store", {folder / "dem.tif"});
    constexpr std::size_t mebibyte = std::size_t{1} << 20;
    DataBaseParams scene;
    scene.dem = folder / "store";
    scene.cache_bytes = 64 * mebibyte;
    const auto held = [&](bool by_strips) {
        scene.by_strips = by_strips;
        return open_direct_source(scene)->cache_bytes();
    };
    // Three quarters of the cache are for decoded tiles.
    params.creation = {"COMPRESS=NONE"};
    write_tile_store(params);
    CHECK(held(false) - held(true) == 44 * mebibyte);
    params.tile_posts = 512;
    params.overwrite = true;
    write_tile_store(params);
    CHECK(held(false) - held(true) == 48 * mebibyte - 16 * (512 * 512 * 2 + 256));
    params.creation = {"COMPRESS=ZSTD"};
    write_tile_store(params);
    const double strips = 2 * 1.25 * 2 * 512 * (3000 + 2000);  // posts of two bytes, strips as high as a tile
    CHECK(static_cast<double>(48 * mebibyte - (held(false) - held(true))) == Approx(strips).epsilon(0.01));
}

TEST_CASE("codes that the legend does not know are counted", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(100, 80));
    Drawing codes = hills(100, 80);
    codes.value = [](int c, int r) { return c == 4 ? 7777 : r == 2 ? 31 : 11; };
    draw(folder / "codes.tif", codes);
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture = folder / "codes.tif";
    params.legend_name = "drawn.csv";
    params.legend_csv = "code,material\n11,water\n";
    params.legend = Legend::from_csv(params.legend_name, params.legend_csv);
    const TileStoreSummary summary = write_tile_store(params);
    CHECK(summary.unknown_codes.counts() == std::map<std::int32_t, std::uint64_t>{{31, 99}, {7777, 80}});
    const auto source = open_direct_source(base(folder / "store"));
    CHECK(source->data_base().legend_name == "drawn.csv");
    CHECK(source->load_classes({{10, 11}, {10, 11}}).classes[0] == material_by_name("material", "water"));
}

TEST_CASE("more unknown codes than are counted are told as such, of one sheet, of several and resumed", "[store]") {
    const Folder folder;
    Drawing d = hills(4100, 5);
    draw(folder / "dem.tif", d);
    d.type = GDT_Int32;
    d.no_data.reset();
    int rows = 0;
    d.value = [&](int c, int r) { return c < 4096 ? 1000 + std::min(r, rows - 1) * 4096 + c : 11; };
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture = folder / "codes.tif";
    params.legend_name = "drawn.csv";
    params.legend_csv = "code,material\n11,water\n";
    params.legend = Legend::from_csv(params.legend_name, params.legend_csv);
    params.overwrite = true;
    const auto stored = [&](const char* sums) { return read_sums(folder / sums, std::nullopt).codes; };
    const char *const first = "store/culture/c0_r0.sum", *const second = "store/culture/c1_r0.sum";

    rows = 4;  // 16384 codes in the first sheet
    draw(folder / "codes.tif", d);
    TileStoreSummary summary = write_tile_store(params);
    CHECK_FALSE(summary.unknown_codes.too_many());
    CHECK(summary.unknown_codes.counts().size() == 16384);
    CHECK(summary.unknown_codes.counts().at(1000) == 1);
    CHECK(summary.unknown_codes.counts().at(1000 + 3 * 4096) == 2);
    CHECK(stored(first) == summary.unknown_codes);
    CHECK(stored(second).empty());

    // One code more in the other sheet.
    const auto value = d.value;
    d.value = [&](int c, int r) { return c == 4099 && r == 3 ? 12 : value(c, r); };
    draw(folder / "codes.tif", d);
    for (const int threads : {1, 2}) {
        params.threads = threads;
        summary = write_tile_store(params);
        CHECK(summary.unknown_codes == CodeCounts::of_too_many(4096 * 5 + 1, 12, 1000 + 16383));
        CHECK(stored(first).counts().size() == 16384);
        CHECK(stored(second).counts() == std::map<std::int32_t, std::uint64_t>{{12, 1}});
    }

    rows = 5;
    draw(folder / "codes.tif", d);
    summary = write_tile_store(params);
    CHECK(summary.unknown_codes == CodeCounts::of_too_many(4096 * 5 + 1, 12, 1000 + 4096 * 5 - 1));
    CHECK(stored(first) == CodeCounts::of_too_many(4096 * 5, 1000, 1000 + 4096 * 5 - 1));
    CHECK(fs::file_size(folder / first) < 4096);
    CHECK(open_direct_source(base(folder / "store"))->load_classes({{4096, 4097}, {0, 1}}).classes[0] ==
          material_by_name("material", "water"));

    // A resumed run has them from the sums of the sheet that stands.
    params.output = folder / "again";
    params.threads = 1;
    write_until(params, 0.99);
    params.resume = true;
    const TileStoreSummary resumed = write_tile_store(params);
    CHECK(resumed.layers[1].reused == 1);
    CHECK(resumed.unknown_codes == summary.unknown_codes);
}

TEST_CASE("sums that list more unknown codes than are counted, as those of older programs, are read", "[store]") {
    const Folder folder;
    SheetSums sums;
    sums.columns = sums.rows = 300;
    sums.tile = 512;
    sums.tiles.resize(sums.tile_count(), 4711);
    sums.codes.add(-3, 1);
    const auto read_with = [&](const std::string& codes) {
        const std::string now = sums_text(sums), list = R"("unknown_codes":[[-3,1]]})";
        const std::size_t list_at = now.find(list), head_at = now.find('\n') + 1 + sizeof(std::uint64_t);
        REQUIRE(list_at != std::string::npos);
        const std::string head =
            now.substr(head_at, list_at - head_at) + R"("unknown_codes":[)" + codes + R"(],"of_later":[[8,9]]})";
        const std::uint64_t length = head.size();
        std::string then = now.substr(0, head_at - sizeof(length));
        then.append(reinterpret_cast<const char*>(&length), sizeof(length));
        then += head + now.substr(list_at + list.size(), now.size() - list_at - list.size() - sizeof(std::uint64_t));
        const std::uint64_t sum = checksum(then);
        then.append(reinterpret_cast<const char*>(&sum), sizeof(sum));
        std::ofstream(folder / "old.sum", std::ios::binary) << then;
        return read_sums(folder / "old.sum", std::nullopt);
    };
    const SheetSums few = read_with("[-3,1],[5,17]");
    CHECK(few.codes.counts() == std::map<std::int32_t, std::uint64_t>{{-3, 1}, {5, 17}});
    CHECK(few.tiles == sums.tiles);
    std::string many = "[-3,1]";
    for (int code = 0; code < 16384; ++code) many += ",[" + std::to_string(code) + ",2]";
    CHECK(read_with(many).codes == CodeCounts::of_too_many(2 * 16384 + 1, -3, 16383));
    CHECK_THROWS_WITH(read_with("[-3]"), Contains("is damaged"));
    CHECK_THROWS_WITH(read_with(R"([-3,"1"])"), Contains("is damaged"));
}
