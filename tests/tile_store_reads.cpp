// What is read of a tile store: blocks and tiles that a request needs and no others, the spill kept with it, and damage,
// which is named whoever meets it.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "lib/detail.hpp"
#include "lib/engine.hpp"
#include "tests/refusal.hpp"
#include "tests/tile_stores.hpp"
#include "tiles/checksum.hpp"
#include "tiles/store_check.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

namespace {

namespace fs = std::filesystem;

}  // namespace

TEST_CASE("of a chunk what is not needed has its block's fill height, all else its own, rows as lines or columns",
          "[store]") {
    const Folder folder;
    Drawing d = hills(700, 500);
    draw(folder / "dem.tif", d);
    d.creation = {"TILED=YES", "BLOCKXSIZE=128", "BLOCKYSIZE=64", "COMPRESS=DEFLATE"};
    draw(folder / "packed.tif", d);
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.tile_posts = 128;
    params.creation = {"COMPRESS=NONE"};
    write_tile_store(params);
    // Tiles of the first two stay unpacked; of the file no more pieces are read than need be; with so little memory of none.
    auto from = base(folder / GENERATE(as<std::string>(), "store", "packed.tif", "dem.tif"));
    if (GENERATE(false, true)) from.cache_bytes = std::size_t{1} << 16;
    CAPTURE(from.dem, from.cache_bytes);
    const auto source = open_direct_source(from);
    std::mt19937 random(8);
    const auto upto = [&](std::int64_t most) {
        return static_cast<std::int64_t>(random() % static_cast<unsigned>(most));
    };
    constexpr std::int64_t margin = ChunkRequest::margin;
    std::int64_t wrong = 0, filled = 0, kept = 0;
    for (int trial = 0; trial < 40; ++trial) {
        ChunkRequest request;
        const std::int64_t c0 = upto(500), r0 = upto(400);
        request.window = {{c0, c0 + 1 + upto(700 - c0)}, {r0, r0 + 1 + upto(500 - r0)}};
        request.blocks = blocks_of(request.window);
        request.lines_are_columns = trial % 2 == 1;
        const std::uint64_t rare = 1 + random() % 9;
        for (std::int64_t i = 0; i < request.blocks.posts(); ++i) {
            request.skip.push_back(random() % rare == 0 ? Skip::none : Skip::hidden);
            request.fill_m.push_back(-1000.0F - static_cast<float>(i));
        }
        const Chunk all = source->load(request.window, request.lines_are_columns), some = source->load(request);
        if (some.flat) {  // nothing is needed
            CHECK(std::count(request.skip.begin(), request.skip.end(), Skip::none) == 0);
            continue;
        }
        const auto block = [&](std::int64_t c, std::int64_t r) -> std::optional<std::size_t> {
            const Window b = blocks_of({{c, c + 1}, {r, r + 1}});
            if (!request.blocks.columns.contains(b.columns.begin) || !request.blocks.rows.contains(b.rows.begin))
                return {};
            return static_cast<std::size_t>((b.rows.begin - request.blocks.rows.begin) * request.blocks.columns.size() +
                                            b.columns.begin - request.blocks.columns.begin);
        };
        const Window& w = request.window;
        for (std::int64_t r = w.rows.begin; r < w.rows.end; ++r)
            for (std::int64_t c = w.columns.begin; c < w.columns.end; ++c) {
                bool needed = false;
                for (const std::int64_t y : {r - margin, r, r + margin})
                    for (const std::int64_t x : {c - margin, c, c + margin})
                        if (const auto near = block(x, y)) needed = needed || request.skip[*near] == Skip::none;
                const std::int64_t down = r - w.rows.begin, across = c - w.columns.begin;
                const auto i = static_cast<std::size_t>(request.lines_are_columns ? across * w.rows.size() + down
                                                                                  : down * w.columns.size() + across);
                const float z = some.surface_m[i], want = needed ? all.surface_m[i] : request.fill_m[*block(c, r)];
                wrong += !same(z, want);
                ++(needed ? kept : filled);
            }
    }
    CHECK(wrong == 0);
    CHECK(filled > 500000);
    CHECK(kept > 500000);
}

TEST_CASE("tiles that a request does not need are never read, and are counted", "[store]") {
    const Folder folder;
    const Drawing d = hills(640, 512);
    draw(folder / "dem.tif", d);
    Drawing h = d;
    h.no_data.reset();
    h.value = [](int c, int r) { return (c + r) % 5; };
    draw(folder / "height.tif", h);
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture_height = folder / "height.tif";
    params.tile_posts = 128;
    params.creation = {"COMPRESS=NONE"};
    write_tile_store(params);
    auto raw_params = base(folder / "dem.tif");
    raw_params.culture_height = folder / "height.tif";

    // Blocks west of post 352 are not needed: the tiles of posts 0 to 255 hold nothing that is, the next some.
    ChunkRequest request;
    request.window = {{10, 600}, {20, 500}};
    request.blocks = blocks_of(request.window);
    for (std::int64_t r = request.blocks.rows.begin; r < request.blocks.rows.end; ++r)
        for (std::int64_t c = request.blocks.columns.begin; c < request.blocks.columns.end; ++c) {
            request.skip.push_back(c < 11 ? (r < 8 ? Skip::horizon : Skip::hidden) : Skip::none);
            request.fill_m.push_back(c < 11 ? -77.0F : 0.0F);
        }
    for (const bool by_columns : {false, true}) {
        request.lines_are_columns = by_columns;
        const auto source = open_direct_source(base(folder / "store")), raw = open_direct_source(raw_params);
        const Chunk some = source->load(request), of_raw = raw->load(request),
                    all = raw->load(request.window, by_columns);
        CHECK(same(some.surface_m, of_raw.surface_m));
        CHECK(same(some.culture_height_m, of_raw.culture_height_m));
        std::int64_t wrong = 0;
        for (std::int64_t r = 20; r < 500; ++r)
            for (std::int64_t c = 10; c < 600; ++c) {
                const std::int64_t line = by_columns ? c - 10 : r - 20, at = by_columns ? r - 20 : c - 10;
                const auto i = static_cast<std::size_t>(line * all.minor_count() + at);
                const bool needed = c >= 350;  // with the margin of two
                const float z = some.surface_m[i], want = needed ? all.surface_m[i] : -77.0F;
                wrong += !same(z, want);
                wrong += some.culture_height_m[i] != (needed ? all.culture_height_m[i] : 0.0F);
            }
        CHECK(wrong == 0);
        CHECK(some.posts_read == (600 - 256) * 480);
        const Skipped skipped = source->skipped();
        const auto of = [&](Skip s) { return skipped[static_cast<std::size_t>(s)]; };
        CHECK(of(Skip::horizon).tiles == 2 * 2 * 2);  // two layers; columns of tiles 0 and 1, rows 0 and 1
        CHECK(of(Skip::hidden).tiles == 2 * 2 * 2);
        CHECK(of(Skip::range).tiles == 0);
        CHECK(of(Skip::hidden).posts == 8 * 128 * 128);
        CHECK(of(Skip::hidden).bytes == 8 * 128 * 128 * 2);
        CHECK(of(Skip::none).tiles == 2 * 5 * 4 - 16);  // all others
        CHECK(of(Skip::none).posts == 2 * 640 * 512 - 16 * 128 * 128);

        // Of what nobody looks at only the reason is noted; the rest is the same.
        for (const Window& looked_at : {Window{{340, 580}, {20, 500}}, Window{{10, 600}, {47, 303}},
                                        Window{{300, 900}, {100, 101}}, Window{{10, 140}, {20, 500}}, Window{}}) {
            const auto other = open_direct_source(base(folder / "store"));
            ChunkRequest narrow = request;
            narrow.looked_at = looked_at;
            const Chunk part = other->load(narrow);
            const Window& w = part.window;
            std::int64_t unlike = 0;
            for (std::int64_t r = w.rows.begin; r < w.rows.end; ++r)
                for (std::int64_t c = w.columns.begin; c < w.columns.end; ++c) {
                    const std::int64_t l = by_columns ? c : r, k = by_columns ? r : c;
                    const auto place = [&](const Chunk& chunk) {
                        const Interval lines = by_columns ? chunk.window.columns : chunk.window.rows,
                                       minors = by_columns ? chunk.window.rows : chunk.window.columns;
                        return static_cast<std::size_t>((chunk.flat ? 0 : l - lines.begin) * minors.size() + k -
                                                        minors.begin);
                    };
                    const float z = part.surface_m[place(part)], want = some.surface_m[place(some)];
                    unlike += !same(z, want);
                }
            INFO(w.columns.begin << " to " << w.columns.end << ", " << w.rows.begin << " to " << w.rows.end);
            CHECK(unlike == 0);
            const Interval columns = intersection(looked_at.columns, request.window.columns),
                           rows = intersection(looked_at.rows, request.window.rows);
            CHECK((w.empty() ? columns.empty() || rows.empty() : w == Window{columns, rows}));
            const Skipped passed = other->skipped();
            const bool all_that_counts = columns.contains(340) && columns.contains(579) && rows == request.window.rows;
            if (all_that_counts)
                for (const Skip why : {Skip::horizon, Skip::hidden, Skip::range, Skip::none})
                    CHECK(passed[static_cast<std::size_t>(why)].tiles == of(why).tiles);
            else
                CHECK(passed[static_cast<std::size_t>(Skip::hidden)].tiles == of(Skip::hidden).tiles);
        }
    }

    // A tile that is not needed may be damaged without anybody noticing; one that is may not.
    const std::string sheet = folder / "store/dem/c0_r0.tif";
    int found = 0;
    {
        GDALDataset* in = GDALDataset::Open(sheet.c_str());
        const char* at = in->GetRasterBand(1)->GetMetadataItem("BLOCK_OFFSET_1_2", "TIFF");
        REQUIRE(at);
        const long offset = std::atol(at);
        GDALClose(in);
        std::fstream file(sheet, std::ios::in | std::ios::out | std::ios::binary);
        file.seekg(offset + 99);
        const char byte = static_cast<char>(file.get());
        file.seekp(offset + 99);
        file.put(static_cast<char>(byte ^ 4));
        ++found;
    }
    REQUIRE(found == 1);
    const auto source = open_direct_source(base(folder / "store"));
    CHECK_NOTHROW(source->load(request));
    CHECK_THAT(refusal([&] { source->load(request.window, false); }),
               Contains("c0_r0.tif") && Contains("tile 1, 2") && Contains("columns 128 to 255, rows 256 to 383") &&
                   Contains("damaged"));
}

TEST_CASE("of open ground every tile within range is read and every other one is out of range", "[store]") {
    const Folder folder;
    Drawing d;
    d.columns = 640;
    d.rows = 500;
    d.type = GDT_Int16;
    d.value = [](int, int) { return 100; };
    draw(folder / "dem.tif", d);
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.tile_posts = 64;
    write_tile_store(params);
    Scene scene;
    scene.geometry = Geometry::grid;
    scene.earth_k.reset();
    scene.platform.xy = PointXY{1005 + 10 * 300.0, 1995 - 10 * 240.0};
    scene.platform.altitude_m = 300;
    scene.range_m = 1500;
    scene.detail = false;
    scene.display.size = 64;
    const double reach = std::sqrt(1500.0 * 1500.0 - 200.0 * 200.0) / 10;  // posts
    std::uint64_t far = 0, out = 0, tiles = 0;
    for (int r = 0; r < 500; r += 64)
        for (int c = 0; c < 640; c += 64) {
            const double x = std::clamp(300, c, c + 63) - 300, y = std::clamp(240, r, r + 63) - 240;
            ++tiles;
            out += std::hypot(x, y) > reach;
            far += std::hypot(x, y) > reach + 50;  // what a block's depth may add where spokes cross it aslant
        }
    REQUIRE(far > 20);
    for (const char* dem : {"store", "dem.tif"})
        for (const bool spilled : {false, true}) {
            CAPTURE(dem, spilled);
            SpillOptions options;
            options.temp_folder = folder / ".";
            const auto source = spilled ? open_spilled_source(base(folder / dem), scene, options)
                                        : open_direct_source(base(folder / dem));
            EngineParams engine;
            engine.wedges = 5;
            const Skipped found = run(resolve(scene, *source), *source, engine).report.skipped;
            const auto of = [&](Skip s) { return found[static_cast<std::size_t>(s)]; };
            SkipCount all;
            for (const SkipCount& s : found) {
                all.posts += s.posts;
                all.bytes += s.bytes;
                all.tiles += s.tiles;
            }
            CHECK(all.posts == 640 * 500);
            CHECK(all.bytes == 640 * 500 * 2);
            CHECK(of(Skip::none).posts + of(Skip::range).posts == all.posts);
            if (spilled || dem != std::string("store")) continue;
            CHECK(all.tiles == tiles);
            CHECK(of(Skip::range).tiles >= far);
            CHECK(of(Skip::range).tiles <= out);
        }
}

TEST_CASE("a kept spill serves a store that was moved, and lends its block map where memory is little", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(300, 260));
    write_tile_store(into(folder / "made", {folder / "dem.tif"}));
    Scene scene;
    scene.platform.xy = PointXY{2500, 700};
    scene.platform.altitude_m = 3000;
    scene.range_m = 1000;
    SpillOptions options;
    keep_spill(base(folder / "made"), scene.platform, folder / "made", options);
    fs::rename(folder / "made", folder / "moved");
    const auto params = base(folder / "moved");
    const SourceChoice choice = choose_source(params, SourceKind::automatic, scene, options.memory_bytes);
    CHECK(choice.kept);
    CHECK(choice.unfit.empty());
    const auto direct = open_direct_source(params);
    for (const std::size_t memory : {std::size_t{32} << 10, std::size_t{1} << 30}) {
        options.memory_bytes = memory;
        const auto kept = open_source(choice, params, scene, options);
        CHECK(same(heights(*kept), heights(*direct)));
        REQUIRE(kept->block_map());
        const Window all{{0, 10}, {0, 9}};
        CHECK(kept->block_map()->read(0, all).bounds == direct->block_map()->read(0, all).bounds);
    }
    // Made anew from another raster under the same name, the store is another one.
    Drawing other = hills(300, 260);
    other.value = [](int c, int r) { return c + r; };
    draw(folder / "dem.tif", other);
    write_tile_store(into(folder / "again", {folder / "dem.tif"}));
    fs::copy(folder / "moved/wedges.spill", folder / "again/wedges.spill");
    const SourceChoice refused =
        choose_source(base(folder / "again"), SourceKind::automatic, scene, options.memory_bytes);
    CHECK_FALSE(refused.kept);
    CHECK_THAT(refused.unfit, Contains("again/wedges.spill") && Contains("another raster than dem"));
}

TEST_CASE("any byte flipped anywhere in a store is found and its file is named", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(200, 150));
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture = folder / "dem.tif";
    params.tile_posts = 64;
    write_tile_store(params);
    PlatformParams point;
    point.xy = PointXY{1500, 1500};
    DataBaseParams layers = base(folder / "store");
    layers.legend = Legend("drawn", {{0, 1}});
    keep_spill(layers, point, folder / "store", {});
    CHECK(describe_store(folder / "store").kept->nadir.column == 49.5);
    REQUIRE(verify_store(folder / "store", nullptr, {}).damage.empty());
    const unsigned seed = std::random_device{}();
    INFO("seed " << seed);
    std::mt19937 random(seed);
    for (const auto& [name, bytes] : contents(folder / "store")) {
        const std::string path = folder / ("store/" + name);
        for (int trial = 0; trial < 25; ++trial) {
            std::string changed = bytes;
            const std::size_t at = random() % bytes.size();
            changed[at] = static_cast<char>(changed[at] ^ (1 << random() % 8));
            std::ofstream(path, std::ios::binary) << changed;
            const StoreVerdict verdict = verify_store(folder / "store", nullptr, {});
            INFO(name << " byte " << at);
            REQUIRE_FALSE(verdict.damage.empty());
            CHECK_THAT(verdict.damage[0], Contains(name));
        }
        std::ofstream(path, std::ios::binary) << bytes.substr(0, bytes.size() - 1);
        const StoreVerdict cut = verify_store(folder / "store", nullptr, {});
        REQUIRE_FALSE(cut.damage.empty());
        CHECK_THAT(cut.damage[0], Contains(name));
        fs::remove(path);
        if (name != kept_spill_name)
            CHECK_THAT(verify_store(folder / "store", nullptr, {}).damage.at(0), Contains(name));
        std::ofstream(path, std::ios::binary) << bytes;
    }
    CHECK(verify_store(folder / "store", nullptr, {}).damage.empty());
}

TEST_CASE("another store's maps are no maps of this one", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(700, 600));
    Drawing flat = hills(700, 600);
    flat.value = [](int, int) { return 60.0; };
    draw(folder / "flat.tif", flat);
    write_tile_store(into(folder / "store", {folder / "dem.tif"}));
    write_tile_store(into(folder / "other", {folder / "flat.tif"}));
    const auto open = [&] {
        const TileStore store(folder / "store");
        store.block_map(1);
        store.detail_map(1);
    };
    REQUIRE_NOTHROW(open());
    for (const char* map : {"blocks.map", "detail.map"}) {
        const std::string path = folder / ("store/" + std::string(map)), own = contents(folder / "store").at(map);
        fs::copy_file(folder / ("other/" + std::string(map)), path, fs::copy_options::overwrite_existing);
        CHECK_THROWS_WITH(open(),
                          Contains(std::string("store/") + map + "' is damaged, or not the one that the store's"));
        std::ofstream(path, std::ios::binary) << own;
        CHECK_NOTHROW(open());
    }
}

TEST_CASE("damage that a run meets is named with its file and block", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(200, 150));
    write_tile_store(into(folder / "store", {folder / "dem.tif"}));
    const auto sound = contents(folder / "store");
    const auto flip = [&](const std::string& name, std::size_t at) {
        std::string bytes = sound.at(name);
        bytes[at] = static_cast<char>(bytes[at] ^ 1);
        std::ofstream(folder / ("store/" + name), std::ios::binary) << bytes;
    };
    const auto restore = [&](const std::string& name) {
        std::ofstream(folder / ("store/" + name), std::ios::binary) << sound.at(name);
    };
    const auto read_all = [&] {
        const auto source = open_direct_source(base(folder / "store"));
        heights(*source);
        source->block_map()->read(0, {{0, 7}, {0, 5}});
    };
    CHECK_NOTHROW(read_all());
    flip("manifest.json", 200);
    CHECK_THAT(refusal(read_all), Contains("manifest.json") && Contains("damaged"));
    restore("manifest.json");
    flip("dem/c0_r0.sum", 60);
    CHECK_THAT(refusal(read_all), Contains("c0_r0.sum") && Contains("damaged"));
    restore("dem/c0_r0.sum");
    flip("blocks.map", 1000);
    CHECK_THAT(refusal(read_all), Contains("blocks.map") && Contains("level 0, block columns 0 to 63"));
    restore("blocks.map");
    std::ofstream(folder / "store/dem/c0_r0.tif", std::ios::binary) << sound.at("dem/c0_r0.tif").substr(0, 500);
    CHECK_THAT(refusal(read_all), Contains("c0_r0.tif") && Contains("500 bytes"));
    restore("dem/c0_r0.tif");
    CHECK_NOTHROW(read_all());
}

TEST_CASE("a manifest with a value that no store has is refused by the value's key, whatever its checksum", "[store]") {
    using json = nlohmann::ordered_json;
    const Folder folder;
    draw(folder / "dem.tif", hills(200, 150));
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture = folder / "dem.tif";
    write_tile_store(params);
    const std::string path = folder / "store/manifest.json", whole = content(path);
    const auto refused = [&](const auto& change) {
        json all = json::parse(whole);
        change(all);
        const std::string key = "\"checksum\": \"";
        all["checksum"] = std::string(16, '0');
        std::string words = all.dump(1) + "\n";
        words.replace(words.rfind(key) + key.size(), 16, hex(checksum(words)));
        std::ofstream(path, std::ios::binary) << words;
        return refusal<DataError>([&] { describe_store(folder / "store"); });
    };
    REQUIRE(refused([](json&) {}) == nothing_refused);
    const auto set = [&](const char* where, const json& value) {
        return refused([&](json& all) { all[json::json_pointer(where)] = value; });
    };
    const std::string damaged = "tile store manifest '" + path + "' is damaged: ";
    const std::string tiles = "; accepted: 64, 128, 256, 512, 1024 or 2048";
    CHECK(set("/layers/0/tile", 0) == damaged + "layers[0].tile is 0" + tiles);
    for (const json& tile : {json(-1), json(3), json(96), json(8192), json(std::int64_t{1} << 31), json(256.5)})
        CHECK_THAT(set("/layers/1/tile", tile), Contains("layers[1].tile is " + tile.dump() + tiles));
    for (const char* side : {"columns", "rows"})
        for (const json& posts : {json(0), json(-200), json(std::int64_t{1} << 53), json(~std::uint64_t{0})})
            CHECK_THAT(set((std::string("/layers/0/") + side).c_str(), posts),
                       Contains(std::string("layers[0].") + side + " is " + posts.dump() +
                                "; accepted: a whole number from 1 to 2147483647"));
    for (const char* place : {"column", "row"})
        for (const json& sheet : {json(-1), json(1), json(65), json(1000000000), json(std::int64_t{1} << 53)})
            CHECK_THAT(set((std::string("/layers/0/sheets/0/") + place).c_str(), sheet),
                       Contains(std::string("layers[0].sheets[0].") + place + " is " + sheet.dump() +
                                "; accepted: a whole number from 0 to 0"));
    CHECK_THAT(refused([](json& all) { all["layers"][0]["sheets"].push_back(all["layers"][0]["sheets"][0]); }),
               Contains("layers[0].sheets[1].column is 0; accepted: sheets row after row, each once"));
    for (const json& metres : {json(0), json(-1), json("1"), json(nullptr)})
        CHECK_THAT(set("/layers/0/metres_per_unit", metres), Contains("layers[0].metres_per_unit is " + metres.dump()));
    for (const json& grid : {json{1000, 10, 1, 2000, 0, -10}, json{1000, 0, 0, 2000, 0, -10}, json{1000, 10}, json(1),
                             json{1000, 10, 0, 2000, 0, "south"}})
        CHECK_THAT(set("/layers/0/geotransform", grid), Contains("layers[0].geotransform is " + grid.dump()));
    CHECK_THAT(set("/layers/1/name", "dem"), Contains("layers[1].name is \"dem\"; accepted: each layer once"));
    CHECK_THAT(set("/layers/1/name", "sea"), Contains("layers[1].name is \"sea\"; accepted: dem, culture"));
    CHECK_THAT(set("/layers/0/type", "CFloat32"), Contains("layers[0].type is \"CFloat32\""));
    CHECK_THAT(set("/layers/0/scale", "2"), Contains("layers[0].scale is \"2\"; accepted: a number"));
    CHECK_THAT(set("/layers/0/no_data", "none"), Contains("layers[0].no_data is \"none\""));
    CHECK_THAT(set("/layers/0/values/lowest", 1e300), Contains("layers[0].values.lowest is 1e+300"));
    CHECK_THAT(set("/layers/0/values/void_posts", -1), Contains("layers[0].values.void_posts is -1"));
    CHECK_THAT(set("/layers/0/crs_facts/unit", "m"), Contains("layers[0].crs_facts is {"));
    CHECK_THAT(set("/culture_height_scale", -1), Contains("culture_height_scale is -1"));
    CHECK_THAT(set("/layers/0/sheets/0/sums_checksum", "what"),
               Contains("layers[0].sheets[0].sums_checksum is \"what\""));
    // Members of another kind, or none.
    CHECK(set("/layers/0/sheets", 5) == damaged + "layers[0].sheets is 5; accepted: an array");
    CHECK(set("/layers/0", 5) == damaged + "layers[0] is no JSON object");
    CHECK(set("/block_map", "blocks.map") == damaged + "block_map is no JSON object");
    CHECK(set("/software", 5) == damaged + "software is 5; accepted: a text");
    CHECK(refused([](json& all) { all["plan"].erase("file"); }) == damaged + "plan.file is missing");
    CHECK(refused([](json& all) { all.erase("layers"); }) == damaged + "layers is missing");
}
