// What the built program writes: files that appear whole or not at all, hold the same bytes however they were made, and
// fit their report.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/cli.hpp"
#include "tests/json.hpp"

using namespace wedgescope::test;
using namespace wedgescope::test::cli;
using Catch::Matchers::Contains;

TEST_CASE("coverage says how the sensor stands to the terrain, as simulate does", "[cli]") {
    const Folder folder;
    grid(folder, "flat", "100");  // 465000 to 465300, 3750000 to 3750240
    grid(folder, "void", "-9999");
    const auto line = [&](const std::string& terrain, const std::string& xy) {
        const Outcome outcome =
            folder.run({"coverage", terrain + ".asc", "seen.tif", "--xy", xy, "--altitude-msl", "150m", "--overwrite"});
        CHECK(outcome.code == 0);
        return outcome.err.substr(0, outcome.err.find(';'));
    };
    CHECK(line("flat", "465150,3750120") == "sensor: 150.0 m above sea level, 50.0 m above the terrain");
    CHECK(line("flat", "464000,3750120") == "sensor: 150.0 m above sea level, outside the terrain raster");
    CHECK(line("flat", "465005,3750120") == "sensor: 150.0 m above sea level, beyond the terrain's outermost posts");
    CHECK(line("void", "465150,3750120") == "sensor: 150.0 m above sea level, over a void of the terrain");
}

TEST_CASE("no stage of a wedge takes longer than the wedge, culled or not", "[cli]") {
    const Folder folder;
    for (const char* cull : {"--no-cull=on", "--no-cull=off"}) {
        const Outcome run = folder.run({"simulate",
                                        "--dem",
                                        dem,
                                        "--culture",
                                        data + "/inland_empire_culture.tif",
                                        "--culture-legend",
                                        "fbfm40",
                                        "--xy",
                                        "453717,3740093",
                                        "--altitude-msl",
                                        "3km",
                                        "--range",
                                        "6km",
                                        "--wedges",
                                        "40",
                                        "--threads",
                                        "1",
                                        cull,
                                        "--echo",
                                        "e.tif",
                                        "--report",
                                        "r.json",
                                        "--overwrite"});
        INFO(run.err);
        REQUIRE(run.code == 0);
        const auto report = json_in(folder.file("r.json"));
        REQUIRE(report["wedges"].size() == 40);
        for (const auto& wedge : report["wedges"])
            for (const auto& [stage, seconds] : wedge["cpu_s"].items()) {
                CAPTURE(cull, stage, wedge["wedge"].get<int>());
                CHECK(seconds.get<double>() >= 0);
                CHECK(seconds.get<double>() <= wedge["wall_s"].get<double>() + 0.02);
            }
    }
}

TEST_CASE("a sensor inside of what rises there is told how far", "[cli]") {
    const Folder folder;
    const std::string ground = grid(folder, "ground", "5"), culture = grid(folder, "culture", "1"),
                      tops = grid(folder, "tops", "12");
    folder.write("legend.csv", "code,material\n1,urban\n");
    for (const auto& [height, said] : {std::pair{"10m", true}, {"12m", false}}) {
        const Outcome run = folder.run({"simulate", "--dem", ground, "--culture", culture, "--culture-legend",
                                        "legend.csv", "--culture-height", tops, "--xy", "465120,3750120",
                                        "--altitude-agl", height, "--range", "1km", "-o", "scope.png", "--overwrite"});
        INFO(run.err);
        CHECK(run.code == 0);
        CHECK((run.err.find("inside of what rises there, 2.0 m below its top") != std::string::npos) == said);
    }
}

TEST_CASE("a lowest height that is a usual no-data value is remarked on", "[cli][long]") {
    const Folder folder;
    const auto terrain = [&](const std::string& name, const std::string& lowest, const std::string& no_data,
                             int voids = 5) {
        std::string text =
            "ncols 40\nnrows 40\nxllcorner 465000\nyllcorner 3750000\ncellsize 30\nNODATA_value " + no_data + "\n";
        for (int post = 0; post < 1600; ++post) text += (post < voids ? lowest : "100.5") + " ";
        return folder.write(name, text);
    };
    const auto said = [&](const Strings& words) {
        const Outcome outcome = folder.run(words);
        INFO(outcome.err);
        CHECK(outcome.code == 0);
        return outcome.err;
    };
    const auto coverage_of = [](const std::string& path) {
        return Strings{"coverage", path, "seen.tif", "--xy", "465600,3750600", "--altitude-agl", "30m", "--overwrite"};
    };
    for (const std::string lowest : {"-9999", "-32768", "-32767"}) {
        INFO(lowest);
        terrain("dem.asc", lowest, "-1");
        const auto remarked = [&](const Strings& words, const std::string& where) {
            CHECK_THAT(said(words), Contains(" is " + lowest + " m, a usual no-data value that it does not declare") &&
                                        Contains("gdal_translate -a_nodata " + lowest + " " + where));
        };
        remarked({"info", "dem.asc"}, "'dem.asc'");
        remarked({"tile", "dem.asc", "dem.store", "--overwrite"}, "'dem.asc'");
        remarked({"info", "dem.store"},
                 "RASTER COPY.tif for each raster that the store was made of, and tile the copies");
        remarked(coverage_of("dem.store"), "RASTER");
        remarked({"simulate", "--dem", "dem.store", "-o", "scope.png", "--geometry", "grid", "--xy", "465600,3750600",
                  "--altitude-agl", "30m", "--range", "300m", "--size", "64", "--overwrite"},
                 "RASTER");
        // Of a raster without a block map by some of what was loaded.
        terrain("pits.asc", lowest, "-1", 400);
        remarked(coverage_of("pits.asc"), "'pits.asc'");
        remarked({"simulate", "--dem", "pits.asc", "-o", "scope.png", "--geometry", "grid", "--xy", "465600,3750600",
                  "--altitude-agl", "30m", "--range", "900m", "--size", "64", "--overwrite"},
                 "'pits.asc'");
    }
    const auto silent = [&](const Strings& words) { CHECK_THAT(said(words), !Contains("a usual no-data value")); };
    terrain("dem.asc", "-9999", "-9999");
    terrain("deep.asc", "-9998", "-1");
    for (const std::string dem : {"dem.asc", "deep.asc"}) {
        silent({"info", dem});
        silent({"tile", dem, "dem.store", "--overwrite"});
        silent(coverage_of("dem.store"));
        silent(coverage_of(dem));
    }
}

TEST_CASE("culture heights that may be tenths of a metre are remarked on", "[cli][long]") {
    const Folder folder;
    const auto raster = [&](const std::string& name, const std::string& most, const std::string& third) {
        std::string text = "ncols 90\nnrows 90\nxllcorner 465000\nyllcorner 3750000\ncellsize 30\n";
        for (int post = 0; post < 8100; ++post) text += (post % 3 ? most : third) + " ";
        return folder.write(name, text);
    };
    raster("dem.asc", "100", "100");
    raster("wood.asc", "150", "0");
    folder.write("places.csv", "time,x,y,altitude-msl\n0,466300,3751300,400\n1,466500,3751300,400\n");
    const Strings place = {"--xy", "466300,3751300", "--altitude-msl", "400m", "--geometry", "grid", "--overwrite"},
                  scene = {"--dem", "dem.asc", "--range", "1km", "--size", "64", "-o", "scope.png"};
    const Strings simulate = with(with({"simulate"}, scene), place),
                  track = with({"simulate", "--track", "places.csv", "--geometry", "grid", "--overwrite"}, scene),
                  some = with(
                      {"simulate", "--dem", "dem.asc", "--range", "1km", "--work-dir", "work", "--only-wedge", "0"},
                      place),
                  coverage = with({"coverage", "dem.asc", "seen.tif"}, place),
                  observers = {"coverage", "dem.asc", "count.tif", "--observers", "places.csv", "--overwrite"};
    const auto said = [&](const Strings& command, const Strings& more) {
        const Outcome outcome = folder.run(with(command, more));
        INFO(outcome.err);
        CHECK(outcome.code == 0);
        return outcome.err;
    };
    const Strings wood = {"--culture-height", "wood.asc"}, tenths = with(wood, {"--culture-height-scale", "0.1"});
    const std::string high = "culture-height: what stands on the ground is 150 m high on average",
                      advice = "; if the raster counts tenths of a metre, culture-height-scale is 0.1";
    for (const Strings& command : {simulate, track, some, coverage, observers}) {
        INFO(command[1]);
        CHECK_THAT(said(command, wood), Contains(high + advice));
    }
    for (const Strings& command : {simulate, coverage})
        CHECK_THAT(said(command, with(wood, {"--source", "spilled"})), Contains(high + advice));
    for (const Strings& command : {simulate, track, coverage, observers}) {
        CHECK_THAT(said(command, tenths), !Contains("on average"));
        CHECK_THAT(said(command, {}), !Contains("on average"));
    }
    raster("wood.asc", "79", "0");
    CHECK_THAT(said(simulate, wood), !Contains("on average"));
    raster("wood.asc", "1500", "0");
    CHECK_THAT(said(simulate, tenths),
               Contains(high + " (culture-height-scale is 0.1; or is a no-data value not declared?)"));
    CHECK_THAT(said(coverage, wood), Contains("is 1500 m high on average (culture-height-scale is 1; or"));
    // Of a store, which keeps the scale.
    said({"tile", "dem.asc", "--culture-height", "wood.asc", "store", "--culture-height-scale", "0.1"}, {});
    Strings stored = simulate;
    std::replace(stored.begin(), stored.end(), std::string("dem.asc"), std::string("store"));
    CHECK_THAT(said(stored, {}), Contains(high));
}

TEST_CASE("coverage writes a mask on the raster's own grid, and every layer", "[cli][long]") {
    const Folder folder;
    const Strings start = {"coverage", dem, "seen.tif", "--latlon", "33.93,-117.33", "--altitude-agl", "300m"};
    const Outcome outcome =
        folder.run(with(start, {"--report", "seen.json", "--timeline", "time.json", "--profile", "--reproducible",
                                "--threads", "5"}));  // more than the machine may have
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    CHECK(outcome.out.empty());
    CHECK_THAT(outcome.err,
               Contains("Mposts/s") && Contains("% of those in range") && Contains("quadrant") && !Contains("TBB"));
    const auto report = json_in(folder.file("seen.json"));
    std::uint64_t posts = 0;
    for (const auto& [name, count] : report["states"].items()) posts += count.get<std::uint64_t>();
    CHECK(posts == 1600 * 1600);
    CHECK(report["scene"]["altitude-agl"] == "300m");
    CHECK(report["threads"] == 5);
    REQUIRE(report["wedges"].size() == 4);
    std::uint64_t read = 0, passed = 0;
    for (const auto& wedge : report["wedges"]) {
        read += wedge["posts_read"].get<std::uint64_t>();
        passed += wedge["posts_passed"].get<std::uint64_t>();
        CHECK(wedge["cpu_total_s"].get<double>() > 0);
    }
    CHECK(report["total"]["posts_read"] == read);
    CHECK(read + passed >= 1600 * 1600);
    std::map<std::string, std::uint64_t> spans;
    const auto timeline = json_in(folder.file("time.json"));
    for (const auto& event : timeline["traceEvents"])
        if (event["ph"] == "X") ++spans[event["name"]];
    CHECK(spans["run"] == report["total"]["runs"]);
    CHECK(spans["load"] <= spans["run"]);
    CHECK(spans["write"] > 0);
    // The same bytes by one thread and in little memory.
    REQUIRE(folder
                .run({"coverage", dem, "again.tif", "--latlon", "33.93,-117.33", "--altitude-agl", "300m",
                      "--reproducible", "--threads", "1", "--memory", "64MiB", "-q"})
                .code == 0);
    CHECK((content(folder.file("again.tif")) == content(folder.file("seen.tif"))));
    for (const char* layer : {"states", "height", "range", "grazing", "depression"}) {
        const Outcome one = folder.run({"coverage", dem, std::string(layer) + ".tif", "--layer", layer, "--xy",
                                        "453717,3740093", "--altitude-msl", "2km", "--range", "8km", "-q"});
        INFO(layer << ": " << one.err);
        CHECK(one.code == 0);
        CHECK(one.err.empty());
        CHECK(folder.names().contains(std::string(layer) + ".tif"));
    }
    refuses(folder, start, 2, {"seen.tif", "--overwrite"});
    refuses(folder, with(start, {"--overwrite", "--report", "seen.tif"}), 2, {"report", "output", "seen.tif"});
    refuses(folder, {"coverage", dem, "x.tif", "--latlon", "33.93,-117.33"}, 2, {"altitude"});
    refuses(folder, {"coverage", dem, "x.png", "--latlon", "33.93,-117.33", "--altitude-agl", "1km"}, 2,
            {"x.png", "whole rasters"});
    refuses(folder, {"coverage", dem, dem, "--latlon", "33.93,-117.33", "--altitude-agl", "1km", "--overwrite"}, 2,
            {"input"});
    refuses(folder,
            {"coverage", dem, "x.tif", "--latlon", "33.93,-117.33", "--altitude-agl", "1km", "--pitch", "5deg,1deg"}, 2,
            {"--pitch", "first one below"});
    refuses(folder,
            {"coverage", dem, "x.tif", "--latlon", "33.93,-117.33", "--altitude-agl", "1km", "--memory", "2MiB"}, 2,
            {"memory is 2 MiB", "at least"});
    const Strings response = {"coverage",       dem,   "x.tif",   "--latlon", "33.93,-117.33",
                              "--altitude-agl", "1km", "--layer", "response"};
    refuses(folder, with(response, {"--target-height", "10m"}), 2, {"--target-height is 10 m", "layer response"});
    refuses(folder, with(response, {"--far-shore", "on"}), 2, {"--far-shore", "simulate's"});
    refuses(folder, with(start, {"--overwrite", "--wind-direction", "10deg"}), 2,
            {"--wind-direction is '10deg'", "--layer response alone"});
    // A mask whose values cannot be told apart, and values of what is no mask.
    const Strings anew = with(start, {"--overwrite"});
    refuses(folder, with(anew, {"--no-data-value", "255"}), 2,
            {"--no-data-value is 255, and so is --seen-value by default; accepted: three values"});
    refuses(folder, with(anew, {"--seen-value", "0"}), 2, {"--seen-value is 0, and so is --hidden-value by default"});
    refuses(folder, with(anew, {"--seen-value", "1", "--no-data-value", "1"}), 2,
            {"--seen-value is 1, and so is --no-data-value;"});
    refuses(folder, with(anew, {"--no-data-value", "9", "--hidden-value", "9"}), 2,
            {"--hidden-value is 9, and so is --no-data-value;"});
    refuses(folder, with(anew, {"--outside-value", "255"}), 2, {"--outside-value is 255, and so is --seen-value"});
    refuses(folder, with(anew, {"--layer", "states", "--seen-value", "255"}), 2,
            {"--seen-value is given, and layer is states; of the layers the mask alone"});
    refuses(folder, with(anew, {"--layer", "height", "-a_nodata", "7"}), 2,
            {"-a_nodata is given, and layer is height"});
    refuses(folder, {"simulate", "--layer", "mask"}, 2, {"--layer"});
    refuses(folder, {"simulate", "--ground-range", "5km"}, 2, {"--ground-range", "coverage's"});
    const std::string scene = folder.write("scene.ini", "dem = x.tif\nground-range = 5km\n");
    refuses(folder, {"simulate", scene, "-o", "scope.png"}, 2, {"line 2", "ground-range", "coverage's"});
}

TEST_CASE("ground is the response of coverage, from any source, and refused by name", "[cli][long]") {
    const Folder folder;
    const Strings place = {"--latlon", "33.93,-117.33", "--altitude-msl", "7000ft", "--range", "5km"};
    const Strings radar = {"--rain", "light", "--backscatter", "ulaby-dobson", "--reproducible"};
    const Strings scene = with(with(good, radar), {"--report", "report.json", "--overwrite"});
    const auto same = [&](const char* a, const char* b) { return content(folder.file(a)) == content(folder.file(b)); };
    REQUIRE(folder.run(with(scene, {"-o", "direct.png", "--ground", "direct.tif"})).code == 0);
    const Outcome spilled =
        folder.run(with(scene, {"-o", "spilled.png", "--ground", "spilled.tif", "--source", "spilled"}));
    INFO(spilled.err);
    REQUIRE(spilled.code == 0);
    CHECK(json_in(folder.file("report.json"))["source"]["kind"] == "spilled");
    REQUIRE(
        folder.run(with(with(with({"coverage", dem, "alone.tif", "--layer", "response"}, place), radar), {})).code ==
        0);
    CHECK(same("direct.png", "spilled.png"));
    CHECK(same("direct.tif", "spilled.tif"));
    CHECK(same("direct.tif", "alone.tif"));
    // Without a range the pass finds it, and keeps what the posts need in all directions.
    const Strings wide = {"simulate", "--dem",         dem,           "--latlon", "33.93,-117.33", "--altitude-msl",
                          "7000ft",   "--sector",      "30deg,80deg", "--size",   "200",           "--quality",
                          "draft",    "--reproducible"};
    REQUIRE(folder.run(with(wide, {"--ground", "wide.tif"})).code == 0);
    REQUIRE(folder.run(with(wide, {"--ground", "wide_spilled.tif", "--source", "spilled"})).code == 0);
    CHECK(same("wide.tif", "wide_spilled.tif"));

    folder.write("own.tif", content(dem));
    folder.write("track.csv",
                 "time,lat,lon,altitude-msl [ft],heading\n0,33.93,-117.33,7000,0\n1,33.94,-117.33,7000,0\n");
    const Strings own = with({"simulate", "--dem", "own.tif"}, place);
    refuses(folder, with(own, {"--ground", "own.tif", "--overwrite"}), 2, {"ground", "own.tif", "dem"});
    refuses(folder, with(own, {"-o", "one.tif", "--ground", "./one.tif"}), 2, {"ground", "output", "one.tif"});
    refuses(folder, with(own, {"--ground", "direct.tif"}), 2, {"direct.tif", "--overwrite"});
    refuses(folder, with(own, {"--ground", "nowhere/ground.tif"}), 1, {"nowhere"});
    refuses(folder, with(own, {"--ground", ""}), 2, {"ground", "empty"});
    refuses(folder, with(own, {"--ground", "ground.xyzzy"}), 2, {"ground.xyzzy", "no raster format"});
    refuses(folder, with(own, {"--ground", "ground.png"}), 2, {"ground.png", "Float32"});
    refuses(folder, with(own, {"--ground", "ground.xyz"}), 2, {"ground.xyz", "tile by tile"});
    refuses(folder, with(own, {"--ground", "ground.tif", "--only-wedge", "0", "--work-dir", "work"}), 2,
            {"ground", "only-wedge", "whole scene"});
    const Strings flight = {"simulate",  "--dem", "own.tif",   "--range",  "5km",       "--track",
                            "track.csv", "-o",    "frame.png", "--ground", "ground.tif"};
    refuses(folder, flight, 2, {"ground", "track", "one place"});
    refuses(folder, with(flight, {"--scan-step", "10", "--scan-period", "5s"}), 2, {"ground", "track", "one place"});
    refuses(folder,
            {"coverage", dem, "seen.tif", "--latlon", "33.93,-117.33", "--altitude-msl", "7000ft", "--ground", "g.tif"},
            2, {"ground"});
    // In too little memory, naming what would do.
    refuses(folder, with(own, {"--ground", "ground.tif", "--memory", "2MiB"}), 2, {"memory", "needs at least"});
}

TEST_CASE("a sensor a hair inside the outermost posts sees what one upon them sees", "[cli]") {
    const Folder folder;
    std::vector<std::string> seen;
    // Upon the outermost row; 7e-7 and 2e-4 of a post inside.
    for (const char* y : {"3764078.07702085", "3764078.0770", "3764078.071"}) {
        INFO(y);
        const Outcome done = folder.run({"coverage", "--xy", std::string("453732.926,") + y, "--altitude-agl", "30m",
                                         "--range", "5km", dem, std::string(y) + ".tif"});
        INFO(done.err);
        REQUIRE(done.code == 0);
        seen.push_back(done.err.substr(0, done.err.find('\n')));
        CHECK_THAT(seen.back(), Contains("seen: "));
    }
    CHECK(seen[1] == seen[0]);
    CHECK(seen[2] == seen[0]);
}

TEST_CASE("outputs are checked before any work, and nothing half-written stays", "[cli][long]") {
    const Folder folder;
    refuses(folder, with(good, {"-o", "nowhere/scope.png"}), 1, {"nowhere/scope.png"});
    refuses(folder, with(good, {"-o", "/proc/scope.png"}), 1, {"/proc/scope.png"});
    refuses(folder, with(good, {"-o", "scope.png", "--echo", "./scope.png"}), 2, {"output", "echo", "own file"});
    refuses(folder, with(good, {"-o", folder.work().string()}), 2, {"folder"});
    refuses(folder, with(good, {"-o", "scope.nonsense"}), 2, {"scope.nonsense"});
    refuses(folder, with(good, {"-o", dem, "--overwrite"}), 2, {"dem"});
    folder.write("scope.png", "mine");
    refuses(folder, with(good, out), 2, {"scope.png", "--overwrite"});
    refuses(folder, with(good, {"-o", "other.png", "--report", "scope.png"}), 2, {"scope.png", "--overwrite"});
    CHECK(content(folder.file("scope.png")) == "mine");
    CHECK(folder.run(with(with(good, out), {"--overwrite"})).code == 0);
    CHECK(content(folder.file("scope.png")).substr(1, 3) == "PNG");
    // Values that a format cannot hold: found before the terrain is even opened.
    refuses(folder, {"simulate", "--dem", "nowhere.tif", "--xy", "1,2", "--altitude-msl", "1km", "--echo", "e.png"}, 2,
            {"e.png", "Float32", "PNG"});
    // A folder's other files are nobody's to touch, whatever an output is called.
    folder.write("run", "mine");
    folder.write("run.notes", "mine");
    refuses(folder, with(good, {"-o", "run", "--overwrite"}), 2, {"run", "ending"});
    CHECK(folder.run(with(good, {"--report", "run", "--overwrite"})).code == 0);
    CHECK(content(folder.file("run")).front() == '{');
    CHECK(content(folder.file("run.notes")) == "mine");
    refuses(folder, with(good, {"--power", "p.img", "--states", "p.dat", "--of", "ENVI"}), 2,
            {"p.img", "p.dat", "p.hdr"});
    // Nor are the parts of a mosaic, of mosaics of mosaics neither.
    const std::string part = grid(folder, "part & more", "5");
    const std::string inner = folder.write(
        "inner.vrt",
        R"(<VRTDataset rasterXSize="10" rasterYSize="8"><GeoTransform>465000,30,0,3750240,0,-30</GeoTransform>)"
        R"(<VRTRasterBand dataType="Int16" band="1"><SimpleSource>)"
        R"(<SourceFilename relativeToVRT="1">part &amp; more.asc</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>)");
    const std::string outer = folder.write(
        "outer.vrt",
        R"(<VRTDataset rasterXSize="10" rasterYSize="8"><GeoTransform>465000,30,0,3750240,0,-30</GeoTransform>)"
        R"(<VRTRasterBand dataType="Int16" band="1"><SimpleSource><SourceFilename relativeToVRT="0">)" +
            inner + R"(</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>)");
    const std::string before = content(part);
    for (const std::string& mosaic : {inner, outer})
        refuses(folder,
                {"coverage", "--xy", "465100,3750100", "--altitude-msl", "500m", mosaic, "part & more.asc", "--of",
                 "GTiff", "--overwrite"},
                2, {"part & more.asc", "of which dem", "is made", "may not replace an input"});
    CHECK(content(part) == before);
    // A run that fails late leaves the old output alone.
    folder.write("scope.png", "mine");
    refuses(folder, with(with(good, out), {"--overwrite", "--memory", "64KiB"}), 2, {"memory"});
    // The least that is named does.
    const std::string refused = folder.run(with(with(good, out), {"--overwrite", "--memory", "1MiB"})).err;
    const auto least = refused.find("at least ") + 9;
    REQUIRE(least > 9);
    const std::string mebibytes = refused.substr(least, refused.find(' ', least) - least);
    refuses(folder,
            with(with(good, out), {"--overwrite", "--memory", std::to_string(std::stoi(mebibytes) - 1) + "MiB"}), 2,
            {"memory", mebibytes});
    CHECK(folder.run(with(with(good, {"-o", "least.png"}), {"--memory", mebibytes + "MiB"})).code == 0);
    CHECK(content(folder.file("scope.png")) == "mine");
}

TEST_CASE("a legend is as wide as its text, however small the picture", "[cli][long]") {
    const Folder folder;
    const Strings scene{
        "simulate", "--dem",  dem,  "--latlon", "33.93,-117.33", "--altitude-msl", "7000ft", "--range",
        "5km",      "--size", "64", "-o",       "s.pgm",         "--of",           "PNM",    "--overwrite",
        "-q"};
    const auto drawn = [&](const Strings& more) {
        const Outcome outcome = folder.run(with(scene, more));
        REQUIRE(outcome.code == 0);
        std::istringstream in(content(folder.file("s.pgm")));
        std::string magic;
        std::size_t width = 0, height = 0, most = 0;
        in >> magic >> width >> height >> most;
        in.get();
        std::string pixels(width * height, '\0');
        in.read(pixels.data(), static_cast<std::streamsize>(pixels.size()));
        REQUIRE(in.gcount() == static_cast<std::streamsize>(pixels.size()));
        return std::tuple(width, height, pixels);
    };
    const auto [width, height, picture] = drawn({});
    const auto [legend_width, legend_height, both] = drawn({"--legend", "on"});
    REQUIRE(legend_width > 150);
    REQUIRE(legend_height > height);
    for (std::size_t row = 0; row < height; ++row) {
        CHECK(both.substr(row * legend_width, width) == picture.substr(row * width, width));
        CHECK(both.substr(row * legend_width + width, legend_width - width) == std::string(legend_width - width, '\0'));
    }
    // The bar of received power ends at the brightest grey there is: with less than 4 dB of video gain not at white.
    const auto brightest_in_row = [&](const Strings& gain) {
        const auto [wide, high, all] = drawn(with({"--legend", "on"}, gain));
        std::size_t at = 0, longest = 0;
        // The bar: the row in which most greys follow upon each other, each a little brighter than the one before.
        for (std::size_t row = height; row < high; ++row) {
            std::size_t run = 0;
            for (std::size_t i = row * wide + 1; i < (row + 1) * wide; ++i) {
                const auto now = static_cast<unsigned char>(all[i]), before = static_cast<unsigned char>(all[i - 1]);
                if (now == before) continue;
                run = now > before && now <= before + 3 ? run + 1 : 0;
                if (run > longest) longest = run, at = i;
            }
        }
        return static_cast<int>(static_cast<unsigned char>(all[at]));
    };
    CHECK(brightest_in_row({"--video-gain", "10dB"}) == 255);
    CHECK(brightest_in_row({"--video-gain", "0dB"}) == 161);
    // It tells of the weather, where there is any.
    const auto height_with = [&](const Strings& weather) {
        return std::get<1>(drawn(with({"--legend", "on"}, weather)));
    };
    CHECK(height_with({"--rain", "clear"}) == legend_height);
    const std::size_t rain = height_with({"--rain", "heavy"});
    CHECK(rain > legend_height);
    CHECK(height_with({"--rain", "heavy", "--gases", "normal", "--cloud", "fog"}) > rain);
}

TEST_CASE("all outputs of one run appear, and the report describes them", "[cli]") {
    const Folder folder;
    const Outcome outcome = folder.run(
        with(good, {"-o", "scope.png", "--echo", "echo.tif", "--power", "power.tif", "--states", "states.tif",
                    "--report", "report.json", "--threads", "2", "--wedges", "3", "--legend", "on", "-q"}));
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    CHECK(outcome.err.empty());
    CHECK(outcome.out.empty());
    for (const char* name : {"scope.png", "echo.tif", "power.tif", "states.tif", "report.json"})
        CHECK(folder.names().contains(name));
    for (const auto& name : folder.names()) CHECK_THAT(name, !Contains("tmp"));
    const auto report = json_in(folder.file("report.json"));
    CHECK(report["format"] == "wedgescope-report-1");
    CHECK(report["wedges"].size() >= 3);
    CHECK(report["threads"] == 2);
    CHECK(report["inputs"][0]["path"] == dem);
    CHECK(report["scene"]["range"] == "5km");
    CHECK(report["peak_rss_bytes"] > 1000000);
    // The states add up to the cells shown.
    std::uint64_t cells = 0;
    for (const auto& [name, count] : report["states"].items()) cells += count.get<std::uint64_t>();
    const auto& shown = report["scene"]["resolved"]["shown"];
    CHECK(cells == (shown["azimuth_bin_end"].get<std::uint64_t>() - shown["azimuth_bin_begin"].get<std::uint64_t>()) *
                       (shown["range_bin_end"].get<std::uint64_t>() - shown["range_bin_begin"].get<std::uint64_t>()));
    // Azimuth bins are covered once each.
    std::int64_t bins = 0;
    for (const auto& wedge : report["wedges"])
        bins += wedge["azimuth_bin_end"].get<std::int64_t>() - wedge["azimuth_bin_begin"].get<std::int64_t>();
    const auto& swept = report["scene"]["resolved"]["swept"];
    CHECK(bins == swept["azimuth_bin_end"].get<std::int64_t>() - swept["azimuth_bin_begin"].get<std::int64_t>());
}

TEST_CASE("reproducible outputs do not depend on wedges and threads", "[cli][threads][long]") {
    const Folder folder;
    std::string first[3];
    for (const auto& [wedges, threads] : {std::pair{"1", "1"}, {"1", "2"}, {"7", "2"}, {"64", "1"}}) {
        const Outcome outcome =
            folder.run(with(good, {"-o", "scope.png", "--echo", "echo.tif", "--states", "states.tif", "--reproducible",
                                   "--overwrite", "--wedges", wedges, "--threads", threads}));
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        const std::string files[3] = {content(folder.file("scope.png")), content(folder.file("echo.tif")),
                                      content(folder.file("states.tif"))};
        for (int i = 0; i < 3; ++i) {
            if (first[i].empty()) first[i] = files[i];
            INFO("file " << i << ", wedges " << wedges << ", threads " << threads);
            CHECK((files[i] == first[i]));
        }
    }
}

TEST_CASE("a mask is packed without loss, or not at all", "[cli]") {
    const Folder folder;
    const Strings mask{"coverage", "--latlon", "33.8,-117.4", "--altitude-msl", "1km", dem, "m.tif", "--overwrite"};
    refuses(folder, with(mask, {"--co", "COMPRESS=JPEG"}), 2,
            {"m.tif' holds codes", "GTiff with these creation options"});
    refuses(folder, with(mask, {"--co", "NBITS=1"}), 2, {"m.tif' holds codes"});
    CHECK(folder.run(with(mask, {"--co", "COMPRESS=DEFLATE"})).code == 0);
    CHECK(folder.run(with(mask, {"--co", "NBITS=2", "--seen-value", "3"})).code == 0);
}

TEST_CASE("coverage of nothing but voids says so, and so does a picture", "[cli]") {
    const Folder folder;
    const std::string hole =
        float_raster(folder, "hole", 40, 40, std::vector<float>(1600, std::numeric_limits<float>::quiet_NaN()));
    CHECK_THAT(folder
                   .run({"simulate", "--dem", hole, "--xy", "465500,3750000", "--altitude-msl", "1km", "--range", "2km",
                         "--size", "64", "-o", "s.png"})
                   .err,
               Contains("nothing of the terrain lies within the range of 2 km and the sector, or all of it is void"));
    std::ofstream(folder.file("places.csv")) << "x,y,altitude\n465500,3750000,1000\n";
    for (const Strings& place :
         {Strings{"--xy", "465500,3750000", "--altitude-msl", "1km"}, {"--observers", "places.csv"}}) {
        const Strings words = with({"coverage", hole, "seen.tif", "--overwrite"}, place);
        const Outcome said = folder.run(words), quiet = folder.run(with(words, {"-q"}));
        INFO(said.err << quiet.err);
        CHECK(said.code == 0);
        CHECK_THAT(said.err, Contains("hole.dat' lies within range, sector and pitch, or all of it is void; all of '"));
        CHECK(quiet.code == 0);
        CHECK(quiet.err.empty());
    }
    // A place in the sea beside the data, and one of its posts.
    std::vector<float> posts(1600, std::numeric_limits<float>::quiet_NaN());
    posts[820] = 7;
    const std::string rock = float_raster(folder, "rock", 40, 40, posts);
    const Outcome outcome =
        folder.run({"coverage", rock, "rock.tif", "--xy", "465500,3750000", "--altitude-msl", "1km", "-q"});
    CHECK(outcome.code == 0);
    CHECK(outcome.err.empty());
}

TEST_CASE("no picture, layer or report goes to standard output, nor to a file that is called -", "[cli]") {
    const Folder folder;
    for (const char* key : {"-o", "--echo", "--report", "--timeline"})
        refuses(folder, with(good, {key, "-"}), 2, {"output '-' is no file", "./- if that is its name"});
    refuses(folder, with({"coverage", dem, "-"}, {"--latlon", "33.93,-117.33", "--altitude-msl", "7000ft"}), 2,
            {"output '-' is no file"});
    CHECK(folder.run(with(good, {"--states", "./-", "--of", "GTiff"})).code == 0);
    CHECK(fs::exists(folder.work() / "-"));
}

TEST_CASE("a black picture says whether a higher gain would show more", "[cli]") {
    const Folder folder;
    const Strings dark = with(good, with(out, {"--overwrite"}));
    CHECK_THAT(folder.run(with(dark, {"--if-gain", "0dB"})).err, Contains("a higher if-gain shows more"));
    const Outcome water = folder.run(with(dark, {"--material", "water"}));
    CHECK_THAT(water.err, Contains("nothing that is seen returns an echo (as water at sea-state 0)"));
    CHECK_THAT(water.err, !Contains("if-gain"));
}
