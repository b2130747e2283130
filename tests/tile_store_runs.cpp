// The run that makes a tile store: interrupted or killed it goes on to the same bytes; what it refuses and a full disk
// leave nothing behind; it stays within its memory.
#include <catch2/catch.hpp>

#include <fcntl.h>
#include <gdal_priv.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "lib/error.hpp"
#include "lib/stop.hpp"
#include "tests/process_bytes.hpp"
#include "tests/refusal.hpp"
#include "tests/tile_stores.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/raster_layer.hpp"
#include "tiles/unfinished_store.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

namespace {

namespace fs = std::filesystem;

struct Outcome {
    int code = 0;
    std::size_t peak_bytes = 0;
    std::string err;
};

/// Runs the program; `kill_after_us` > 0: kill -9 then.
/// `most_bytes` > 0: no file may grow beyond.
Outcome run_program(const std::vector<std::string>& arguments, const std::string& log, int kill_after_us = 0,
                    std::uint64_t most_bytes = 0) {
    std::string program = WEDGESCOPE_PROGRAM;
    std::vector<std::string> copy = arguments;
    std::vector<char*> list{program.data()};
    for (auto& a : copy) list.push_back(a.data());
    list.push_back(nullptr);
    const pid_t child = ::fork();
    if (child == 0) {
        const int e = ::open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
        if (e < 0 || ::dup2(e, 2) < 0 || ::dup2(e, 1) < 0) ::_exit(99);
        if (const rlimit limit{most_bytes, most_bytes}; most_bytes > 0) ::setrlimit(RLIMIT_FSIZE, &limit);
        ::execv(program.c_str(), list.data());
        ::_exit(98);
    }
    if (kill_after_us > 0) {
        std::this_thread::sleep_for(std::chrono::microseconds(kill_after_us));
        ::kill(child, SIGKILL);
    }
    int status = 0;
    rusage usage{};
    ::wait4(child, &status, 0, &usage);
    Outcome out;
    out.code = WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
    out.peak_bytes = static_cast<std::size_t>(usage.ru_maxrss) * 1024;
    std::ifstream in(log);
    std::ostringstream words;
    words << in.rdbuf();
    out.err = words.str();
    return out;
}

}  // namespace

TEST_CASE("an interrupted run goes on to the same bytes, and redoes no finished sheet", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(4096 * 3 + 10, 70));
    auto params = into(folder / "whole", {folder / "dem.tif"});
    params.threads = 1;
    write_tile_store(params);
    const auto whole = contents(folder / "whole");
    for (const double until : {0.2, 0.5, 0.9}) {
        const std::string output = folder / ("part" + std::to_string(until));
        params.output = output;
        params.resume = false;
        write_until(params, until);
        CHECK_FALSE(fs::exists(output));
        REQUIRE(fs::exists(output + ".part"));
        for (const auto& [name, bytes] : contents(output + ".part")) CHECK_FALSE(name.ends_with(".tmp"));
        CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("--resume"));
        params.resume = true;
        auto other = params;
        other.tile_posts = 128;
        CHECK_THAT(refusal([&] { write_tile_store(other); }), Contains("other rasters or options"));
        const TileStoreSummary summary = write_tile_store(params);
        CHECK(summary.layers[0].reused == (until < 0.5 ? 1 : until < 0.9 ? 2 : 3));
        CHECK(contents(output) == whole);
        CHECK_FALSE(fs::exists(output + ".part"));
    }
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("exists; add --overwrite"));
    params.overwrite = true;
    params.resume = false;
    CHECK_NOTHROW(write_tile_store(params));
    CHECK(contents(params.output) == whole);
    fs::create_directory(folder / "mine");
    std::ofstream(folder / "mine/letter.txt") << "dear";
    params.output = folder / "mine";
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("no tile store"));
    CHECK(fs::exists(folder / "mine/letter.txt"));
}

TEST_CASE("packed strips wider than a sheet are decoded once for a row of sheets, to the same bytes as tiles",
          "[store][long]") {
    const Folder folder;
    struct Made {
        std::map<std::string, std::string> contents;  ///< what of the store does not name its input
        double file_bytes, bytes_read;
    };
    const auto make = [&](const std::vector<std::string>& creation, std::size_t memory_mib, int threads) {
        Drawing d = hills(4096 * 3 + 100, 700);
        d.creation = creation;
        GdalSession::set_cache_bytes(std::size_t{64} << 20);  // tiles are drawn row by row
        draw(folder / "dem.tif", d);
        auto params = into(folder / "store", {folder / "dem.tif"});
        params.memory_bytes = memory_mib << 20;
        params.cache_bytes = params.memory_bytes / 8;
        params.threads = threads;
        params.overwrite = true;
        GdalSession::set_cache_bytes(params.cache_bytes);
        std::vector<double> steps;
        params.progress = [&](double done) { steps.push_back(done); };
        const std::uint64_t before = bytes_read();
        write_tile_store(params);
        Made made{contents(params.output), static_cast<double>(fs::file_size(folder / "dem.tif")),
                  static_cast<double>(bytes_read() - before)};
        CHECK(std::is_sorted(steps.begin(), steps.end()));
        REQUIRE_FALSE(steps.empty());
        CHECK(steps.back() == 1);
        std::erase_if(made.contents, [](const auto& file) { return file.first.ends_with(".json"); });
        return made;
    };
    const std::vector<std::string> strips{"COMPRESS=DEFLATE", "ZLEVEL=1", "BLOCKYSIZE=5"};
    const Made tiles = make({"TILED=YES", "COMPRESS=DEFLATE", "ZLEVEL=1"}, 512, 1);
    REQUIRE(tiles.contents.size() > 8);
    // Tiles are read once, and so is what was written, to compare it.
    const auto times = [&](const Made& made) {
        CHECK(made.contents == tiles.contents);
        return (made.bytes_read - tiles.bytes_read + tiles.file_bytes) / made.file_bytes;
    };
    CHECK(times(make(strips, 512, 1)) == Approx(1).margin(0.3));
    CHECK(times(make(strips, 512, 2)) < 2.3);  // a half of the row each
    CHECK(times(make(strips, 44, 1)) == Approx(1).margin(0.3));  // the cache grows until it holds a band
    const double least = times(make(strips, 20, 1));             // here for two sheets at a time
    CHECK(least > 1.5);
    CHECK(least < 2.3);
}

TEST_CASE("a run that stopped within a row of packed strips goes on to the same bytes", "[store][long]") {
    const Folder folder;
    Drawing d = hills(4096 + 60, 4096 + 200);
    d.creation = {"COMPRESS=DEFLATE", "ZLEVEL=1"};
    draw(folder / "dem.tif", d);
    auto params = into(folder / "whole", {folder / "dem.tif"});
    params.cache_bytes = std::size_t{32} << 20;
    GdalSession::set_cache_bytes(params.cache_bytes);
    params.threads = 1;
    write_tile_store(params);
    const auto whole = contents(folder / "whole");
    params.output = folder / "part";
    write_until(params, 0.97);
    for (const auto& [name, bytes] : contents(folder / "part.part")) CHECK_FALSE(name.ends_with(".tmp"));
    params.resume = true;
    CHECK(write_tile_store(params).layers[0].reused == 2);
    CHECK(contents(folder / "part") == whole);
}

TEST_CASE("a run is not resumed over what has changed behind or beside its raster, nor without its plan", "[store]") {
    const Folder folder;
    Drawing d = hills(64, 4096 * 2 + 10);
    draw(folder / "part.tif", d);
    const auto raise_by = [&](int m, const std::string& more = {}) {
        std::ofstream(folder / "part.tif.aux.xml") << "<PAMDataset><PAMRasterBand band=\"1\"><Offset>" << m
                                                   << "</Offset>" << more << "</PAMRasterBand></PAMDataset>";
    };
    raise_by(5);
    const auto vrt = [&](const std::string& from, const std::string& to) {
        const GDALDatasetUniquePtr in(GDALDataset::Open((folder / from).c_str()));
        const GDALDatasetUniquePtr out(GetGDALDriverManager()->GetDriverByName("VRT")->CreateCopy(
            (folder / to).c_str(), in.get(), 0, nullptr, nullptr, nullptr));
        REQUIRE(out);
    };
    vrt("part.tif", "inner.vrt");
    vrt("inner.vrt", "outer.vrt");
    const std::string dem = GENERATE(as<std::string>(), "part.tif", "inner.vrt", "outer.vrt", "vrt://outer.vrt");
    CAPTURE(dem);
    const std::size_t name = dem.rfind('/') + 1;
    auto params = into(folder / "store", {dem.substr(0, name) + (folder / dem.substr(name))});
    params.threads = 1;
    write_until(params, 0.6);
    REQUIRE(fs::exists(folder / "store.part/dem/c0_r0.sum"));
    params.resume = true;
    SECTION("posts") {
        d.value = [](int c, int r) { return c + r; };
        const auto before = fs::last_write_time(folder / "part.tif");
        draw(folder / "part.tif", d);
        fs::last_write_time(folder / "part.tif", before + std::chrono::milliseconds(1));
        CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("a raster has changed since"));
    }
    SECTION("a side file") {
        raise_by(1000);
        // A VRT keeps an offset of its own.
        const std::string refused = refusal([&] { write_tile_store(params); });
        CHECK((refused.find("a raster has changed since") != std::string::npos) == (dem == "part.tif"));
    }
    SECTION("statistics beside it") {
        raise_by(5, "<Metadata><MDI key=\"STATISTICS_MAXIMUM\">500</MDI></Metadata>");
        CHECK(write_tile_store(params).layers[0].reused > 0);
    }
    SECTION("nothing") { CHECK(write_tile_store(params).layers[0].reused > 0); }
    SECTION("no plan: all is made again") {
        fs::resize_file(folder / "store.part/plan.json", GENERATE(0, 100));
        CHECK(write_tile_store(params).layers[0].reused == 0);
    }
}

TEST_CASE("through a link the store that it leads to is replaced, and no folder that stands is in the way", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(300, 200));
    auto params = into(folder / "real", {folder / "dem.tif"});
    write_tile_store(params);
    fs::create_symlink(folder / "real", folder / "link");
    fs::create_directory(folder / "real.old");
    params.output = folder / "link";
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("--overwrite"));
    params.overwrite = true;
    params.tile_posts = 128;
    write_tile_store(params);
    CHECK(fs::is_symlink(folder / "link"));
    CHECK(fs::exists(folder / "real.old"));
    CHECK(TileStore(folder / "real").layer(StoreLayerKind::dem)->facts().block_columns == 128);
    CHECK(folder.names() == std::vector<std::string>{"dem.tif", "link", "real", "real.old"});
}

TEST_CASE("what stands where a store is made and is no unfinished one stays", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(300, 200));
    write_tile_store(into(folder / "store.part", {folder / "dem.tif"}));
    const auto whole = contents(folder / "store.part");
    fs::create_directory(folder / "own.part");
    std::ofstream(folder / "own.part/letter") << "mine";
    std::ofstream(folder / "file.part") << "mine";
    for (const bool overwrite : {false, true}) {
        auto params = into(folder / "store", {folder / "dem.tif"});
        params.overwrite = overwrite;
        CHECK_THAT(refusal([&] { write_tile_store(params); }),
                   Contains("store.part") && Contains("finished tile store"));
        for (const char* name : {"own", "file"}) {
            params.output = folder / name;
            CHECK_THAT(refusal([&] { write_tile_store(params); }),
                       Contains(".part', where '") && Contains("move it away"));
        }
    }
    CHECK(contents(folder / "store.part") == whole);
    CHECK(folder.names() == std::vector<std::string>{"dem.tif", "file.part", "own.part", "store.part"});
}

TEST_CASE("killed at any moment, a run is resumed to the same bytes", "[store][long]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(4096 * 3 + 10, 100));
    const std::vector<std::string> tail = {"-q", "--threads", "1"};
    const auto tile = [&](const std::string& out, std::vector<std::string> more, int kill_us) {
        std::vector<std::string> arguments{"tile", folder / "dem.tif", out};
        arguments.insert(arguments.end(), tail.begin(), tail.end());
        arguments.insert(arguments.end(), more.begin(), more.end());
        return run_program(arguments, folder / "log", kill_us);
    };
    const auto start = std::chrono::steady_clock::now();
    REQUIRE(tile(folder / "whole", {}, 0).code == 0);
    const double took_us = std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count();
    const auto whole = contents(folder / "whole");
    const unsigned seed = std::random_device{}();
    INFO("seed " << seed);
    std::mt19937 random(seed);
    for (int trial = 0; trial < 6; ++trial) {
        const std::string out = folder / ("killed" + std::to_string(trial));
        tile(out, {}, static_cast<int>(took_us * (0.1 + 0.9 * static_cast<double>(random() % 1000) / 1000)) + 1);
        if (!fs::exists(out)) {
            const Outcome again = tile(out, {"--resume"}, 0);
            INFO(again.err);
            REQUIRE(again.code == 0);
        }
        CHECK(contents(out) == whole);
        CHECK_FALSE(fs::exists(out + ".part"));
    }
}

TEST_CASE("killed just before it is put in place, or just begun, a run goes on", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(900, 700));
    auto params = into(folder / "whole", {folder / "dem.tif"});
    write_tile_store(params);
    const auto whole = contents(folder / "whole");
    params.output = folder / "store";
    params.resume = true;
    SECTION("all but the name is there") {
        fs::copy(folder / "whole", folder / "store.part", fs::copy_options::recursive);
    }
    SECTION("no manifest yet") {
        fs::copy(folder / "whole", folder / "store.part", fs::copy_options::recursive);
        fs::remove(folder / "store.part/manifest.json");
    }
    SECTION("only the folder") { fs::create_directory(folder / "store.part"); }
    SECTION("the plan is empty") {
        fs::create_directory(folder / "store.part");
        std::ofstream(folder / "store.part/plan.json").flush();
    }
    SECTION("the plan is nothing but brackets") {
        fs::create_directory(folder / "store.part");
        std::ofstream(folder / "store.part/plan.json")
            << "{\n \"format\": \"wedgescope-store-plan-3\", \"layers\": " << std::string(1000000, '[')
            << std::string(1000000, ']') << "}";
    }
    SECTION("a sheet's posts never reached the disk") {
        fs::copy(folder / "whole", folder / "store.part", fs::copy_options::recursive);
        if (GENERATE(true, false)) fs::remove(folder / "store.part/manifest.json");
        std::fstream sheet(folder / "store.part/dem/c0_r0.tif", std::ios::in | std::ios::out | std::ios::binary);
        sheet.seekp(static_cast<std::streamoff>(fs::file_size(folder / "whole/dem/c0_r0.tif") / 2));
        sheet << std::string(4096, '\0');
    }
    write_tile_store(params);
    CHECK(contents(folder / "store") == whole);
    CHECK_FALSE(fs::exists(folder / "store.part"));
}

TEST_CASE("a folder where an unfinished store would lie stays if it is somebody else's", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(90, 70));
    auto params = into(folder / "store", {folder / "dem.tif"});
    const std::string part = folder / "store.part";
    fs::create_directories(part + "/data");
    std::ofstream(part + "/data/thesis.txt") << "years";
    const auto tried = [&](const char* plan, const std::string& why) {
        std::ofstream(part + "/plan.json") << plan;
        for (const bool resume : {true, false}) {
            params.resume = resume;
            params.overwrite = !resume;
            CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains(why) && Contains("move it away"));
            CHECK(fs::file_size(part + "/data/thesis.txt") == 5);
        }
    };
    tried("my plan", "is no unfinished tile store");
    tried(R"({"steps": 3})", "is no unfinished tile store");
    tried("", "thesis.txt', which is no part of a tile store");
    tried("{\n \"format\": \"wedgescope-store-plan-3\"", "thesis.txt', which is no part of a tile store");
}

TEST_CASE("bad posts and truncated rasters are named, and leave nothing behind", "[store]") {
    const Folder folder;
    Drawing d;
    d.columns = 300;
    d.rows = 200;
    d.value = [](int c, int r) { return c == 271 && r == 133 ? std::numeric_limits<double>::infinity() : 10; };
    draw(folder / "wild.tif", d);
    CHECK_THAT(refusal([&] { write_tile_store(into(folder / "store", {folder / "wild.tif"})); }),
               Contains("wild.tif") && Contains("column 271, row 133"));
    d.value = [](int, int) { return 10.0; };
    draw(folder / "short.tif", d);
    fs::resize_file(folder / "short.tif", fs::file_size(folder / "short.tif") / 2);
    CHECK_THAT(refusal([&] { write_tile_store(into(folder / "store", {folder / "short.tif"})); }),
               Contains("short.tif"));
    auto params = into(folder / "store", {folder / "wild.tif"});
    params.tile_posts = 100;
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("tile-size is 100"));
    params.tile_posts = 256;
    params.creation = {"COMPRESS=NONSENSE"};
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("NONSENSE"));
    params.creation = {"BLOCKXSIZE=128"};
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("tile-size is"));
    params.creation = {};
    params.memory_bytes = std::size_t{4} << 20;
    params.cache_bytes = std::size_t{1} << 19;
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("memory is 4 MiB; tiling dem"));
    CHECK(folder.names() == std::vector<std::string>{"short.tif", "wild.tif"});
}

TEST_CASE("a disk that is full is an error with the sheet's name, and what was written goes", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(600, 400));
    const Outcome outcome = run_program({"tile", folder / "dem.tif", folder / "store", "-q", "--co", "COMPRESS=NONE"},
                                        folder / "log", 0, 200000);
    CHECK(outcome.code == 1);
    CHECK_THAT(outcome.err, Contains("c0_r0.tif") && Contains("cannot be written") && Contains("large"));
    CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
    CHECK(folder.names() == std::vector<std::string>{"dem.tif", "log"});
    REQUIRE(run_program({"tile", folder / "dem.tif", folder / "store", "-q"}, folder / "log").code == 0);
    CHECK(run_program({"tile", folder / "dem.tif", folder / "store", "-q"}, folder / "log").code == 2);
    std::fstream file(folder / "store/dem/c0_r0.sum", std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(50);
    file.put('\0');
    file.close();
    const Outcome damaged = run_program({"info", "--verify", folder / "store"}, folder / "log");
    CHECK(damaged.code == 1);
    CHECK_THAT(damaged.err, Contains("c0_r0.sum") && Contains("1 damaged part was found"));
}

TEST_CASE("statistics that a GDAL program keeps in a store's VRT are no damage, other words of it are", "[store]") {
    const Folder folder;
    for (const char* crs : {"EPSG:32611", "EPSG:4326", "EPSG:5070", "EPSG:2154", ""}) {
        INFO(crs);
        Drawing dem = hills(4200, 150);
        dem.crs = crs;
        dem.no_data = -9999;
        dem.geotransform = {{-100.5, 0.001, 0, 40.25, 0, -0.001}};
        draw(folder / "dem.tif", dem);
        auto params = into(folder / "store", {folder / "dem.tif"});
        params.overwrite = true;
        write_tile_store(params);
        const std::string vrt = folder / "store/dem.vrt", before = content(vrt);
        const auto damage = [&] { return verify_store(folder / "store", nullptr, {}).damage; };
        GDALDataset* opened = GDALDataset::Open(vrt.c_str());
        REQUIRE(opened);
        GDALRasterBand* band = opened->GetRasterBand(1);
        double least = 0, most = 0, mean = 0, deviation = 0;
        REQUIRE(band->ComputeStatistics(false, &least, &most, &mean, &deviation, nullptr, nullptr) == CE_None);
        int buckets = 0;
        GUIntBig* counts = nullptr;
        REQUIRE(band->GetDefaultHistogram(&least, &most, &buckets, &counts, true, nullptr, nullptr) == CE_None);
        CPLFree(counts);
        GDALClose(opened);
        const std::string after = content(vrt);
        REQUIRE(after != before);
        REQUIRE(after.find("STATISTICS_MEAN") != std::string::npos);
        CHECK(damage() == std::vector<std::string>{});
        for (const auto& [from, to] :
             {std::pair<std::string, std::string>{"DstRect xOff=\"4096\"", "DstRect xOff=\"4095\""},
              {"-9999", "-9998"},
              {"dem/c0_r0.tif", "dem/c1_r0.tif"},
              {"</VRTDataset>", ""},
              {"</VRTRasterBand>", "<Scale>2</Scale></VRTRasterBand>"}}) {
            INFO(from);
            std::string wrong = after;
            REQUIRE(wrong.find(from) != std::string::npos);
            wrong.replace(wrong.find(from), from.size(), to);
            std::ofstream(vrt, std::ios::binary) << wrong;
            REQUIRE(damage().size() == 1);
            CHECK_THAT(damage()[0], Contains("dem.vrt' is damaged"));
        }
    }
}

TEST_CASE("a damaged manifest is damage that verify finds, beside stores that are sound", "[store]") {
    const Folder folder;
    Drawing woods = hills(300, 200);
    draw(folder / "dem.tif", woods);
    woods.value = [](int c, int r) { return (c * 7 + r * 13) % 200; };
    draw(folder / "woods.tif", woods);
    const auto tile = [&](const std::string& store, const std::vector<std::string>& more) {
        std::vector<std::string> words{"tile", folder / "dem.tif", folder / store, "-q"};
        words.insert(words.end(), more.begin(), more.end());
        const Outcome tiled = run_program(words, folder / "log");
        INFO(tiled.err);
        REQUIRE(tiled.code == 0);
    };
    tile("bad", {});
    tile("good", {"--culture-height", folder / "woods.tif", "--culture-height-scale", "0.1"});
    std::ofstream(folder / "bad/manifest.json") << "{}";
    for (const std::vector<std::string>& stores : {std::vector<std::string>{folder / "bad"},
                                                   {folder / "good", folder / "bad"},
                                                   {folder / "bad", folder / "good"}}) {
        std::vector<std::string> words{"info", "--verify", "-q"};
        words.insert(words.end(), stores.begin(), stores.end());
        const Outcome found = run_program(words, folder / "log");
        INFO(found.err);
        CHECK(found.code == 1);
        CHECK_THAT(found.err,
                   Contains("damage      ") && Contains("bad/manifest.json") && Contains("1 damaged part was found"));
        CHECK_THAT(found.err, !Contains("version 0"));  // nothing is told of what is not known
        CHECK((found.err.find("all as they were written") != std::string::npos) == (stores.size() == 2));
    }
}

TEST_CASE("a damaged class table is damage that verify finds, and a store is told of without it", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(300, 200));
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture = folder / "dem.tif";
    params.class_table = "name,gamma10_db\ncorn,-14\n";
    params.legend_name = "drawn";
    params.legend_csv = "1,corn\n";
    write_tile_store(params);
    const auto info = [&](const std::vector<std::string>& more) {
        std::vector<std::string> words{"info", folder / "store"};
        words.insert(words.end(), more.begin(), more.end());
        return run_program(words, folder / "log");
    };
    CHECK(info({"--verify", "-q"}).code == 0);
    const auto finds = [&](const std::string& table, const std::string& words) {
        std::ofstream(folder / "store/classes.csv") << table;
        CHECK(info({}).code == 0);
        const Outcome found = info({"--verify", "-q"});
        INFO(found.err);
        CHECK(found.code == 1);
        CHECK_THAT(found.err, Contains("damage      ") && Contains(words) && Contains("1 damaged part was found"));
    };
    finds(params.class_table + "junk,,,oops\n", "store/classes.csv', line 3");
    finds("name,gamma10_db\nmaize,-14\n", "material is 'corn'");
    fs::remove(folder / "store/dem.vrt");
    CHECK_THAT(info({"--verify", "-q"}).err,
               Contains("dem.vrt") && Contains("material is 'corn'") && Contains("2 damaged parts were found"));
    std::ofstream(folder / "store/classes.csv") << params.class_table << "# edited\nwheat,-13\n";
    CHECK_THAT(info({"--verify", "-q"}).err, Contains("1 damaged part was found"));
}

TEST_CASE("tiling stays within its memory", "[store][long]") {
    const Folder folder;
    // 144 MB of floats in lines, as plain files have them.
    Drawing d;
    d.columns = d.rows = 6000;
    d.value = [](int c, int r) { return (c ^ r) & 255; };
    draw(folder / "dem.tif", d);
    const Outcome outcome =
        run_program({"tile", folder / "dem.tif", folder / "store", "--memory", "64MiB", "-q"}, folder / "log");
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    CHECK(outcome.peak_bytes <= std::size_t{128} << 20);
#endif
    INFO("peak " << outcome.peak_bytes / 1048576 << " MiB");
    CHECK(run_program({"info", "--verify", folder / "store", "-q"}, folder / "log").code == 0);
}

TEST_CASE("one run at a time has an unfinished store, until it stands in its place", "[store]") {
    const Folder folder;
    const std::string output = folder / "s", sheet = output + ".part/dem/c0_r0.sum";
    const auto write = [](const std::string& path, const std::string& words) { std::ofstream(path) << words; };
    UnfinishedStore one(output), other(output);
    one.check(false, false);
    one.open("{}", false);
    one.make_folder("dem");
    write(sheet, "sums");
    write(output + ".part/dem/c0_r0.tif.tmp", "half");
    CHECK_THROWS_WITH(other.open("{}", true), Contains("is in use by another run"));
    CHECK_THROWS_WITH(other.check(false, false), Contains("holds an unfinished run"));
    CHECK_FALSE(other.close(false));  // it has nothing to remove
    CHECK(one.close(true));
    CHECK(fs::exists(sheet));
    CHECK_FALSE(fs::exists(output + ".part/dem/c0_r0.tif.tmp"));

    CHECK_THROWS_WITH(one.open(R"({"other":1})", true),
                      Contains("was begun with other rasters or options, or a raster has changed since (other is "
                               "missing there, 1 now); "));
    other.open("{}", true);
    CHECK(fs::exists(sheet));
    CHECK(other.close(true));
    one.open(R"({"layers":[{"files":["a"],"tile_size":256}]})", false);
    CHECK_FALSE(fs::exists(sheet));
    one.make_folder("dem");
    write(sheet, "sums");
    CHECK(one.close(true));
    CHECK_THROWS_WITH(one.open(R"({"layers":[{"files":["b"],"tile_size":512}]})", true),
                      Contains(" (layers/0/tile_size is 256 there, 512 now); "));
    CHECK_THROWS_WITH(one.open(R"({"layers":[{"files":["b"],"tile_size":256}]})", true),
                      Contains(R"( (layers/0/files/0 is "a" there, "b" now); )"));
    CHECK_THROWS_WITH(
        one.open(R"({"layers":[{"files":["a"],"tile_size":256},{"name":"culture","files":["c"]}]})", true),
        Contains(R"( (layers/- is missing there, "culture" now); )"));
    CHECK_THROWS_WITH(one.open(R"({"layers":[]})", true), Contains(" (layers/0 is {"));
    one.open(R"({"other":1})", false);
    CHECK_FALSE(fs::exists(sheet));
    // Who opened the plan before it moved has no folder.
    PlainFile early(one.inside("plan.json"), PlainFile::Use::write);
    CHECK(early.stands());
    one.move_into_place(false);
    CHECK_FALSE(early.stands());
    CHECK(content(output + "/plan.json") == R"({"other":1})");
    CHECK_FALSE(fs::exists(output + ".part"));

    // In place of the first, all of which goes.
    write(output + "/manifest.json", "");
    CHECK_THROWS_WITH(other.check(false, false), Contains("exists; add --overwrite"));
    other.check(true, false);
    other.open("{}", false);
    other.move_into_place(true);
    CHECK(content(output + "/plan.json") == "{}");
    CHECK_FALSE(fs::exists(output + "/manifest.json"));
    CHECK_FALSE(fs::exists(output + ".part"));

    // What came to stand there while the run went on stays where it would have stayed before.
    fs::rename(output, output + ".away");
    one.check(false, false);
    one.open("{}", false);
    fs::create_directory(output);
    write(output + "/thesis.txt", "precious");
    for (const bool overwrite : {false, true}) {
        CHECK_THROWS_AS(one.move_into_place(overwrite), InputError);
        CHECK(content(output + "/thesis.txt") == "precious");
    }
    fs::remove_all(output);
    fs::rename(output + ".away", output);
    CHECK_THROWS_WITH(one.move_into_place(false), Contains("exists and is no tile store"));
    CHECK(one.close(false) == false);

    // Without a finished sheet nothing stays, nor where the plan cannot be written.
    one.open("{}", false);
    CHECK_FALSE(one.close(true));
    CHECK_FALSE(fs::exists(output + ".part"));
    rlimit before{};
    ::getrlimit(RLIMIT_FSIZE, &before);
    const auto signal_before = ::signal(SIGXFSZ, SIG_IGN);
    const rlimit none{0, before.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &none);
    std::string said;
    try {
        one.open("{}", false);
    } catch (const IoError& e) {
        said = e.what();
    }
    ::setrlimit(RLIMIT_FSIZE, &before);
    ::signal(SIGXFSZ, signal_before);
    CHECK_THAT(said, Contains("plan.json' cannot be written: File too large"));
    CHECK_FALSE(one.close(true));
    CHECK_FALSE(fs::exists(output + ".part"));
}
