// The built program with its raster sorted into wedges first: the same files, what a plan foretells of the pass, what
// report, timeline and profile tell of it, and a spill that is kept with a store.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/cli.hpp"
#include "tests/json.hpp"

using namespace wedgescope::test;
using namespace wedgescope::test::cli;
using Catch::Matchers::Contains;

TEST_CASE("the spilled source writes the same files as the direct one, and info says which is chosen",
          "[cli][threads]") {
    const Folder folder;
    fs::create_directory(folder.work() / "spill");
    const Strings outputs{"--echo", "echo.tif", "--states", "states.tif", "--reproducible", "--overwrite"};
    REQUIRE(folder.run(with(good, with(outputs, {"--source", "direct"}))).code == 0);
    const std::string echo = content(folder.work() / "echo.tif"), states = content(folder.work() / "states.tif");
    for (const char* memory : {"40MiB", "1GiB"}) {
        const Outcome outcome = folder.run(with(good, with(outputs, {"--source", "spilled", "--memory", memory,
                                                                     "--temp-dir", "spill", "--report", "run.json"})));
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        CHECK(content(folder.work() / "echo.tif") == echo);
        CHECK(content(folder.work() / "states.tif") == states);
        const auto report = json_in(folder.work() / "run.json");
        CHECK(report["source"]["kind"] == "spilled");
        CHECK(report["source"]["partition_bytes"] > 0);
        CHECK(fs::is_empty(folder.work() / "spill"));
    }
    // Coverage too, for which all of the raster is needed.
    const Strings cover{"coverage",       dem,    "seen.tif",       "--latlon",    "33.93,-117.33",
                        "--altitude-agl", "300m", "--reproducible", "--overwrite", "-q"};
    REQUIRE(folder.run(with(cover, {"--source", "direct"})).code == 0);
    const std::string seen = content(folder.work() / "seen.tif");
    REQUIRE(folder
                .run(with(cover,
                          {"--source", "spilled", "--memory", "64MiB", "--temp-dir", "spill", "--report", "run.json"}))
                .code == 0);
    CHECK((content(folder.work() / "seen.tif") == seen));
    const auto covered = json_in(folder.work() / "run.json");
    CHECK(covered["source"]["kind"] == "spilled");
    CHECK(covered["source"]["partition_bytes"] > 0);
    CHECK(fs::is_empty(folder.work() / "spill"));
    const std::string scene = "dem = " + dem + "\nlatlon = 33.9,-117.4\naltitude-msl = 3km\n";
    folder.write("a.ini", scene);
    folder.write("b.ini", scene + "source = spilled\n");
    CHECK_THAT(folder.run({"info", "a.ini"}).out, Contains("direct: ") && Contains("fit into the cache"));
    CHECK_THAT(folder.run({"info", "b.ini"}).out, Contains("spilled: as asked for"));
    CHECK(json_of(folder.run({"info", "--json", "b.ini"}).out)["files"][0]["source"]["kind"] == "spilled");
}

TEST_CASE("a plan of a spilled run foretells what the run reads, spills and holds", "[cli][long]") {
    const Folder folder;
    fs::create_directory(folder.work() / "spill");
    // 18 MB, of which the range leaves about three quarters; a quarter of the memory may stay in blocks.
    const Strings scene{"--dem",
                        scanlines(folder, "hills", 3000),
                        "--xy",
                        "510000,3705300",
                        "--altitude-msl",
                        "9km",
                        "--range",
                        "42km",
                        "--no-cull",
                        "--azimuth-bins",
                        "720",
                        "--range-bin",
                        "200m",
                        "--memory",
                        "40MiB",
                        "--source",
                        "spilled",
                        "--temp-dir",
                        "spill",
                        "--threads",
                        "2"};
    const Outcome planned = folder.run(with({"info", "--plan", "--json"}, scene));
    INFO(planned.err);
    REQUIRE(planned.code == 0);
    const auto plan = json_of(planned.out);
    CHECK(plan["source"]["kind"] == "spilled");
    CHECK_FALSE(plan["likely_cpu_s"] < 0.01);
    CHECK(plan["temporary_disk_bytes"] == plan["bytes_spilled"]);
    CHECK(plan["peak_bytes"] <= 40 << 20);
    CHECK(plan["source_bytes"] < plan["peak_bytes"]);
    const Outcome page = folder.run(with({"info", "--plan"}, scene));
    CHECK(folder.run(with({"info", "--plan=on"}, scene)).out == page.out);
    CHECK_THAT(folder.run(with({"info", "--plan=off"}, scene)).err, Contains("unknown option '--dem'"));
    CHECK_THAT(page.out, Contains("spilled: as asked for; rows of 3000 x 1") && Contains("read once") &&
                             Contains("to a file in temp-dir at the most"));

    const Outcome outcome = folder.run(with({"simulate"}, with(scene, {"--echo", "echo.tif", "--report", "run.json"})));
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    const auto report = json_in(folder.work() / "run.json");
    const auto near = [](double value, double truth) { return std::abs(value - truth) <= 0.2 * truth; };
    for (const char* what : {"posts", "bytes_read", "peak_bytes", "partition_bytes", "bytes_spilled"}) {
        CAPTURE(what, report["plan"][what].dump());
        const double actual = report["plan"][what]["actual"];
        CHECK(actual > 0);
        CHECK(near(report["plan"][what]["planned"], actual));
    }
    CHECK(report["source"]["spilled_bytes"] > 1 << 20);
    CHECK(report["plan"]["bytes_spilled"]["actual"] == report["source"]["spilled_bytes"]);
    for (const char* what :
         {"wedges", "chunks", "posts", "bytes_read", "partition_bytes", "bytes_spilled", "peak_bytes"}) {
        CAPTURE(what);
        CHECK(plan[what] == report["plan"][what]["planned"]);
    }
    // A direct run spills nothing.
    Strings direct = scene;
    direct[16] = "direct";
    const auto none = json_of(folder.run(with({"info", "--plan", "--json"}, direct)).out);
    CHECK(none["source"]["kind"] == "direct");
    CHECK(none["bytes_spilled"] == 0);
    CHECK(none["partition_bytes"] == 0);
}

TEST_CASE("a plan over culture foretells what the run reads of its tiles, each once a chunk after another", "[cli]") {
    const Folder folder;
    for (const char* legend : {"fbfm40", ""}) {
        Strings scene = with(good, {"--no-cull", "--threads", "1", "--quality", "draft", "--detail", "off"});
        if (*legend)
            scene = with(scene, {"--culture", data + "/inland_empire_culture.tif", "--culture-legend", legend});
        const Outcome outcome = folder.run(with(scene, {"--overwrite", "--echo", "echo.tif", "--report", "run.json"}));
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        const auto read = json_in(folder.work() / "run.json")["plan"]["bytes_read"];
        CAPTURE(legend, read.dump());
        // Bins in doubt read again what they need of it.
        CHECK(read["planned"].get<double>() == Approx(read["actual"].get<double>()).epsilon(0.01));
    }
}

TEST_CASE("a run whose blocks pack smaller than foretold is split as it was foretold", "[cli][long]") {
    const Folder folder;
    fs::create_directory(folder.work() / "spill");
    // Flat ground takes a byte a block; foretold are two bytes a post, which do not stay in a quarter of the memory.
    const std::string flat = scanlines(folder, "flat", 2000);
    folder.write("flat.dat", std::string(std::size_t{2} * 2000 * 2000, '\1'));
    const auto scene = [&](const std::string& memory, const std::string& range_bin, const std::string& wedges) {
        return Strings{"--dem",          flat,      "--xy",        "495000,3720300",
                       "--altitude-msl", "9km",     "--range",     "28km",
                       "--azimuth-bins", "720",     "--range-bin", range_bin,
                       "--threads",      "1",       "--wedges",    wedges,
                       "--size",         "512",     "--memory",    memory,
                       "--source",       "spilled", "--temp-dir",  "spill",
                       "--no-cull"};
    };
    std::set<std::string> larger;
    for (const auto& [memory, range_bin, wedges] : {std::tuple{"20MiB", "20m", "1"}, {"24MiB", "100m", "64"}}) {
        CAPTURE(memory);
        const Outcome planned = folder.run(with({"info", "--plan", "--json"}, scene(memory, range_bin, wedges)));
        INFO(planned.err);
        REQUIRE(planned.code == 0);
        const auto plan = json_of(planned.out);
        CHECK(plan["bytes_spilled"] > 1 << 20);
        CHECK(plan["wedges"] > 1);
        const Outcome outcome = folder.run(
            with({"simulate", "--echo", "echo.tif", "-o", "scope.png", "--report", "run.json", "--overwrite"},
                 scene(memory, range_bin, wedges)));
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        const auto report = json_in(folder.work() / "run.json");
        for (const char* what :
             {"wedges", "chunks", "posts", "bytes_read", "partition_bytes", "bytes_spilled", "peak_bytes"}) {
            CAPTURE(what, report["plan"][what].dump());
            CHECK(plan[what] == report["plan"][what]["planned"]);
        }
        CHECK(report["plan"]["wedges"]["actual"] == plan["wedges"]);
        CHECK(report["plan"]["bytes_spilled"]["actual"] == 0);
        CHECK(report["plan"]["peak_bytes"]["actual"] <= plan["peak_bytes"]);
        CHECK(plan["peak_bytes"] > plan["source_bytes"]);
        larger.insert(plan["peak_bytes"] > plan["granted_bytes"] ? "pass" : "wedges");
    }
    CHECK(larger.size() == 2);
}

TEST_CASE("timeline and profile of a spilled run show its pass, its spill and its memory from end to end",
          "[cli][long]") {
    const Folder folder;
    fs::create_directory(folder.work() / "spill");
    const std::string hills = scanlines(folder, "hills", 3000);
    const Strings common{"--xy",       "510000,3705300", "--altitude-agl", "5km",        "--no-cull",  "--threads",
                         "2",          "--memory",       "64MiB",          "--source",   "spilled",    "--temp-dir",
                         "spill",      "--report",       "report.json",    "--timeline", "trace.json", "--profile",
                         "--overwrite"};
    const std::vector<Strings> runs{with({"simulate", "--dem", hills, "--echo", "echo.tif", "--range", "42km",
                                          "--azimuth-bins", "1440", "--range-bin", "100m"},
                                         common),
                                    with({"coverage", hills, "seen.tif"}, common)};
    for (const Strings& arguments : runs) {
        INFO(arguments[0]);
        const Outcome outcome = folder.run(arguments);
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        const auto report = json_in(folder.work() / "report.json");
        const auto trace = json_in(folder.work() / "trace.json");

        // All that came back came back for a wedge or quadrant, but for the few blocks that place the sensor, and those within 640
        // posts that say what stands highest around it.
        const std::uint64_t other_blocks = arguments[0] == "simulate" ? 16 + 11 * 11 : 16;
        std::uint64_t spilled = 0;
        for (const auto& wedge : report["wedges"]) spilled += wedge["bytes_spilled"].get<std::uint64_t>();
        const auto read_back = report["source"]["spill_read_bytes"].get<std::uint64_t>();
        CHECK(report["total"]["bytes_spilled"] == spilled);
        CHECK(spilled > std::uint64_t{1} << 20);
        CHECK(spilled <= read_back);
        CHECK(read_back - spilled <= other_blocks * (std::uint64_t{2} * 128 * 128 + 25));
        CHECK_THAT(outcome.err, Contains("spilled"));
        CHECK_THAT(outcome.err, !Contains("spilled and read again 0"));

        struct Stretch {
            double from, to;
        };
        std::map<std::string, std::uint64_t> bytes;
        std::map<std::string, std::vector<Stretch>> stages;
        std::map<int, std::vector<Stretch>> threads;
        std::vector<std::pair<double, double>> held;  // when, how much
        double end = 0;
        for (const auto& e : trace["traceEvents"]) {
            if (e["ph"] == "C" && e["name"] == "memory") held.emplace_back(e["ts"], e["args"]["budget held"]);
            if (e["ph"] != "X") continue;
            const Stretch s{e["ts"], e["ts"].get<double>() + e["dur"].get<double>()};
            end = std::max(end, s.to);
            threads[e["tid"].get<int>()].push_back(s);
            bytes[e["name"]] += e["args"].value("bytes", std::uint64_t{0});
            stages[e["name"]].push_back(s);
        }
        CHECK(bytes["pass"] == report["source"]["partition_bytes"]);
        CHECK(bytes["pass read"] == bytes["pass"]);
        CHECK(stages["pass pack"].size() == stages["pass read"].size());
        CHECK(bytes["spill write"] + 64 == report["source"]["spilled_bytes"]);  // the header is the file's own
        CHECK(bytes["spill read"] == read_back);
        for (auto& [thread, spans] : threads) {
            std::sort(spans.begin(), spans.end(), [](const Stretch& a, const Stretch& b) {
                return a.from != b.from ? a.from < b.from : a.to > b.to;
            });
            std::vector<Stretch> open;
            bool nests = true;
            constexpr double digits_us = 2e-3;
            for (const Stretch& s : spans) {
                while (!open.empty() && open.back().to <= s.from + digits_us) open.pop_back();
                nests = nests && (open.empty() || s.to <= open.back().to + digits_us);
                open.push_back(s);
            }
            INFO("thread " << thread);
            CHECK(nests);
        }
        const auto most_held = [&](const Stretch& s) {
            double most = -1;
            for (const auto& [at, bytes_held] : held)
                if (at >= s.from && at <= s.to) most = std::max(most, bytes_held);
            return most;
        };
        REQUIRE(stages["pass"].size() == 1);
        CHECK(most_held(stages["pass"][0]) > 1 << 20);
        CHECK(most_held({0, end}) <= 64 << 20);
        CHECK(held.front().first < stages["pass"][0].from);
        CHECK(held.back().first >= end);
        // Wherever a stage is longer than any sampling's silence on a busy machine, memory is known in it.
        for (const auto& [name, spans] : stages)
            for (const Stretch& s : spans) {
                INFO(name);
                if (s.to - s.from > 300e3) CHECK(most_held(s) >= 0);
            }
    }
}

TEST_CASE("a store tiled around a point serves scenes from there by its kept spill, bit for bit", "[cli][long]") {
    const Folder folder;
    const Outcome tiled = folder.run({"tile", dem, "store", "--culture", data + "/inland_empire_culture.tif",
                                      "--culture-legend", "fbfm40", "--around", "33.93,-117.33"});
    INFO(tiled.err);
    REQUIRE(tiled.code == 0);
    CHECK_THAT(tiled.err, Contains("wedges.spill"));
    CHECK(fs::exists(folder.work() / "store/wedges.spill"));
    const auto simulate = [&](const std::string& place, const Strings& more) {
        return folder.run(with(
            {"simulate", "--dem", "store", "--latlon", place, "--altitude-msl", "7000ft", "--range", "5km", "--echo",
             "echo.tif", "--states", "states.tif", "--report", "run.json", "--reproducible", "--overwrite"},
            more));
    };
    const auto report = [&] { return json_in(folder.work() / "run.json"); };
    const auto pictures = [&] {
        return std::pair(content(folder.work() / "echo.tif"), content(folder.work() / "states.tif"));
    };
    REQUIRE(simulate("33.93,-117.33", {"--source", "direct"}).code == 0);
    CHECK(report()["source"]["kind"] == "direct");
    CHECK(report()["source"]["kept"].is_null());
    const auto direct = pictures();
    const auto layers = json_of(folder.run({"info", "--json", "store"}).out)["files"][0]["layers"];
    std::uint64_t posts = 0;
    for (const auto& layer : layers)
        posts += layer["columns"].get<std::uint64_t>() * layer["rows"].get<std::uint64_t>();
    // What is read and what is skipped is the data base.
    const auto counted = [&] {
        const auto run = report();
        std::uint64_t sum = run["read"]["posts"];
        for (const auto& cause : run["skipped"]) sum += cause["posts"].get<std::uint64_t>();
        return sum;
    };
    CHECK(layers.size() == 2);
    CHECK(report()["read"]["posts"] > 0);
    CHECK(counted() == posts);
    for (const Strings& source : {Strings{"--source", "spilled"}, Strings{}}) {
        const Outcome outcome = simulate("33.93,-117.33", source);
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        CHECK(report()["source"]["kind"] == "spilled");
        CHECK(report()["source"]["kept"] == "store/wedges.spill");
        CHECK(report()["source"]["partition_bytes"] == 0);
        CHECK(report()["source"]["spilled_bytes"] == 0);
        CHECK(report()["source"]["spill_read_bytes"] > 0);
        CHECK(counted() == posts);
        CHECK(pictures() == direct);
    }
    const Outcome seen = folder.run(
        {"coverage", "store", "seen.tif", "--latlon", "33.93,-117.33", "--altitude-msl", "7000ft", "--range", "5km"});
    INFO(seen.err);
    CHECK(seen.code == 0);
    CHECK_THAT(seen.err, Contains("terrain read from a tile store; sorted for this point in 'store/wedges.spill'\n"));
    CHECK_THAT(seen.err, !Contains("sorted into wedges first"));
    // From elsewhere it is not used, and that is said.
    REQUIRE(simulate("33.95,-117.33", {"--source", "direct"}).code == 0);
    const auto elsewhere = pictures();
    for (const char* source : {"auto", "spilled"}) {
        const Outcome outcome = simulate("33.95,-117.33", {"--source", source});
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        CHECK_THAT(outcome.err, Contains("not used: the kept spill 'store/wedges.spill' was made for column"));
        CHECK(report()["source"]["kept"].is_null());
        CHECK(report()["source"]["kind"] == (source == std::string("auto") ? "direct" : "spilled"));
        CHECK(pictures() == elsewhere);
    }
    const std::string scene = "dem = store\naltitude-msl = 3km\nlatlon = ";
    folder.write("here.ini", scene + "33.93,-117.33\n");
    folder.write("there.ini", scene + "33.95,-117.33\n");
    CHECK_THAT(folder.run({"info", "here.ini"}).out,
               Contains("spilled: a tile store; sorted for this point in 'store/"));
    CHECK_THAT(folder.run({"info", "--plan", "here.ini"}).out, Contains("none: a kept spill is read"));
    CHECK_THAT(folder.run({"info", "there.ini"}).out,
               Contains("direct: a tile store") && Contains("not used: the kept"));
    CHECK_THAT(folder.run({"info", "store"}).out, Contains("kept spill") && Contains("latitude 33.930000"));
    const Outcome whole = folder.run({"info", "--verify", "store"});
    CHECK(whole.code == 0);
    // Damage is named wherever it is.
    const std::string bytes = content(folder.work() / "store/wedges.spill");
    for (const std::size_t at : {std::size_t{70}, bytes.size() / 3, bytes.size() - 5}) {
        std::string changed = bytes;
        changed[at] = static_cast<char>(changed[at] ^ 16);
        folder.write("store/wedges.spill", changed);
        const Outcome found = folder.run({"info", "--verify", "store"});
        INFO(found.err << found.out);
        CHECK(found.code == 1);
        CHECK_THAT(found.out, Contains("the kept spill 'store/wedges.spill' is damaged"));
    }
    const Outcome damaged = simulate("33.93,-117.33", {});
    CHECK(damaged.code == 1);
    CHECK(damaged.error_lines() == 1);
    CHECK_THAT(damaged.err, Contains("'store/wedges.spill' is damaged: its index"));
    // Made anew, for another point: nothing is lost that was damaged.
    const Outcome again = folder.run({"tile", "store", "--around", "33.95,-117.33"});
    INFO(again.err);
    REQUIRE(again.code == 0);
    REQUIRE(simulate("33.95,-117.33", {}).code == 0);
    CHECK(report()["source"]["kept"] == "store/wedges.spill");
    CHECK(pictures() == elsewhere);
    // A whole one for another point is replaced only when that is asked for; one for the same point is made again.
    const std::string whole_one = content(folder.work() / "store/wedges.spill");
    refuses(folder, {"tile", "store", "--around", "33.93,-117.33"}, 2,
            {"'store/wedges.spill'", "latitude 33.950000, longitude -117.330000", "--overwrite"});
    CHECK(content(folder.work() / "store/wedges.spill") == whole_one);
    CHECK(folder.run({"tile", "store", "--around", "33.950001,-117.33"}).code == 0);
    for (const char* pole : {"90,180", "-89.9999999,0"})
        refuses(folder, {"tile", "store/dem.vrt", "other", "--around", pole}, 2,
                {"--around is ", "within 1 m of a pole", "accepted: a place farther off"});
    CHECK(folder.run({"tile", "store", "--around", "33.93,-117.33", "--overwrite"}).code == 0);
    REQUIRE(simulate("33.93,-117.33", {}).code == 0);
    CHECK(report()["source"]["kept"] == "store/wedges.spill");
    CHECK(pictures() == direct);
    // A store is no raster to make another of.
    refuses(folder, {"tile", "store", "other"}, 2, {"'store' is a tile store", "'store/dem.vrt'"});
    refuses(folder, {"tile", dem, "other", "--culture", "store", "--culture-legend", "fbfm40"}, 2,
            {"'store' is a tile store", "'store/culture.vrt'"});
}
