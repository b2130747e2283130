// What the built program reads, wherever it lies: scene files, radar sets, an antenna's points, kept ground maps, the
// folder of a store; and what info counts in a raster.
#include <catch2/catch.hpp>

#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "tests/cli.hpp"
#include "tests/json.hpp"

using namespace wedgescope::test;
using namespace wedgescope::test::cli;
using Catch::Matchers::Contains;

TEST_CASE("a scene file works from any folder", "[cli][long]") {
    const Folder folder;
    fs::create_directories(folder.work() / "scenes");
    fs::copy_file(data + "/lake_sunapee_dem.tif", folder.file("scenes/lake.tif"));
    folder.write("scenes/lake.ini",
                 "dem = lake.tif\nlatlon = 43.38,-72.05\naltitude-agl = 1000m\nsize = 200\noutput = lake.png\n");
    const Outcome outcome = folder.run({"simulate", "scenes/lake.ini"});
    INFO(outcome.err);
    CHECK(outcome.code == 0);
    CHECK(fs::exists(folder.file("scenes/lake.png")));
    const Outcome info = folder.run({"info", "scenes/lake.ini", "--json"});
    REQUIRE(info.code == 0);
    const auto json = json_of(info.out);
    CHECK(json["files"][0]["kind"] == "scene");
    CHECK(json["files"][0]["scene"]["resolved"]["nadir_on_data"] == true);
    CHECK_THAT(folder.run({"info", "scenes/lake.ini"}).out, Contains("1000.0 m above the terrain"));
}

TEST_CASE("a scene file in a folder that a link leads to finds what lies beside it", "[cli]") {
    const Folder folder;
    fs::create_directories(folder.file("far/scenes"));
    const std::string ground = grid(folder, "ground", "5");
    fs::rename(folder.file(ground), folder.file("far/ground.tif"));
    std::ofstream(folder.file("far/scenes/a.ini"))
        << "dem = ../ground.tif\nxy = 465100,3750100\naltitude-agl = 1km\nrange = 3km\n";
    fs::create_directory_symlink("far/scenes", folder.file("link"));
    for (const char* scene : {"far/scenes/a.ini", "link/a.ini"}) {
        const Outcome outcome = folder.run({"info", scene});
        INFO(scene << ": " << outcome.err);
        CHECK(outcome.code == 0);
    }
    // What is not there yet is where the link leads to, not where its name would.
    fs::create_directories(folder.file("new"));
    std::ofstream(folder.file("far/scenes/b.ini"))
        << "dem = ../ground.tif\nxy = 465100,3750100\naltitude-agl = 1km\nrange = 3km\noutput = ../new/o.png\n";
    refuses(folder, {"simulate", "link/b.ini"}, 1, {"link/../new"});
    CHECK(fs::is_empty(folder.file("new")));
}

TEST_CASE("a radar set comes with the program, wherever that lies, and makes what its values make", "[cli][long]") {
    const Folder folder;
    for (const char* page : {"simulate", "scope"})
        CHECK_THAT(folder.run({"help", page}).out,
                   Contains("--set NAME|PATH") && Contains("f111a, ku-mapping, x-navigation"));
    CHECK_THAT(folder.run({"help"}).out, Contains("help sets"));
    const Outcome list = folder.run({"help", "sets"}), one = folder.run({"help", "sets", "f111a"});
    CHECK(list.code == 0);
    CHECK_THAT(list.out, Contains("  f111a ") && Contains("  x-navigation ") && Contains("  ku-mapping "));
    CHECK(one.code == 0);
    CHECK_THAT(one.out, Contains("frequency = 16.5GHz") && Contains("[U/P]"));
    refuses(folder, {"help", "sets", "f111"}, 2,
            {"set is 'f111'", "f111a, ku-mapping, x-navigation", "did you mean f111a?"});
    refuses(folder, {"help", "sets", "f111a", "x"}, 2, {"one set at most"});
    refuses(folder, with(with(good, {"--set", "f11a"}), out), 2, {"--set is 'f11a'", "did you mean f111a?"});

    // What help prints is a set of one's own.
    folder.write("mine.ini", one.out);
    const auto scene = [&](const std::string& set, const std::string& name) {
        const Outcome outcome = folder.run(
            with(good, {"--set", set, "-o", name + ".png", "--report", name + ".json", "--reproducible", "-q"}));
        INFO(outcome.err);
        CHECK(outcome.code == 0);
        return content(folder.file(name + ".png"));
    };
    const std::string shipped = scene("f111a", "a");
    CHECK(shipped.size() > 1000);
    CHECK((scene("mine.ini", "a2") == shipped));
    CHECK((scene("x-navigation", "x") != shipped));
    CHECK((scene("ku-mapping", "k") != shipped));
    const auto report = [&](const char* name) { return json_in(folder.file(name)); };
    CHECK(report("a.json")["scene"]["set"] == "f111a");
    CHECK(report("a.json")["scene"]["antenna-knee"] == "3deg");
    CHECK(report("a.json")["scene"]["pulse"] == "1.2us");
    const nlohmann::json inputs = report("a2.json")["inputs"];
    CHECK(std::any_of(inputs.begin(), inputs.end(), [](const auto& input) { return input["key"] == "set"; }));
    folder.write("scene.ini", "set = x-navigation\ndem = " + dem + "\nlatlon = 33.93,-117.33\naltitude-msl = 7000ft\n");
    CHECK_THAT(folder.run({"info", "scene.ini"}).out, Contains("x-navigation"));
    // Two altitudes in one file: none of the commands takes either.
    folder.write("two.ini", "dem = " + dem + "\nlatlon = 33.93,-117.33\naltitude-agl = 1km\naltitude-msl = 5km\n");
    for (const Strings& command : {Strings{"info", "two.ini"}, Strings{"simulate", "two.ini", "-o", "two.png"}})
        refuses(folder, command, 2, {"line 4: altitude-msl is given beside altitude-agl", "exactly one of"});

    // Elsewhere, alone.
    fs::copy_file(WEDGESCOPE_PROGRAM, folder.file("moved"));
    CHECK(folder.finish(folder.start({"help", "sets", "f111a"}, folder.file("moved"))).out == one.out);
}

TEST_CASE("an antenna's file is an input as any other, and its points belong to kept wedges", "[cli][long]") {
    const Folder folder;
    folder.write("dish.csv", "-10,-40\n-3,-3\n3,0\n70,-32.5\n");
    const Strings scene = with(good, {"--antenna", "dish.csv", "-q"});
    refuses(folder, with(scene, {"-o", "dish.csv", "--overwrite"}), 2, {"output", "antenna", "may not replace"});
    const Strings written = {"--work-dir", "work", "--power", "a.tif", "--report", "a.json", "--reproducible"};
    const Outcome first = folder.run(with(scene, written));
    INFO(first.err);
    REQUIRE(first.code == 0);
    const std::string power = content(folder.file("a.tif"));
    const auto report = json_in(folder.file("a.json"));
    CHECK(report["scene"]["antenna"] == "points:-10,-40;-3,-3;3,0;70,-32.5");
    CHECK(std::any_of(report["inputs"].begin(), report["inputs"].end(),
                      [](const auto& input) { return input["key"] == "antenna"; }));
    // The same points elsewhere serve; others do not.
    folder.write("same.csv", "depression_deg,gain_db\n-10,-40\n-3,-3\n3,0\n70,-32.5\n");
    const Outcome again =
        folder.run(with(with(good, {"--antenna", "same.csv", "--resume", "--overwrite", "-q"}), written));
    INFO(again.err);
    CHECK(again.code == 0);
    CHECK((content(folder.file("a.tif")) == power));
    CHECK(json_in(folder.file("a.json"))["reused"] == report["wedges"].size());
    folder.write("dish.csv", "-10,-40\n-3,-3\n3,0\n70,-32.4\n");
    refuses(folder, with(scene, {"--work-dir", "work", "--resume", "--power", "c.tif"}), 2,
            {"work-dir 'work' holds another scene", "antenna", "points of checksum"});
}

TEST_CASE("info counts voids and codes", "[cli][long]") {
    const Folder folder;
    const Outcome terrain = folder.run({"info", "--json", data + "/worcester_vermont_dem.tif"});
    REQUIRE(terrain.code == 0);
    const auto facts = json_of(terrain.out)["files"][0];
    CHECK(facts["columns"] == 549);
    CHECK(facts["rows"] == 613);
    CHECK(facts["lowest"] == 201);
    CHECK(facts["highest"] == 1101);
    CHECK(facts["void_posts"].get<double>() / (549 * 613) == Approx(0.32).margin(0.005));
    const Outcome culture =
        folder.run({"info", "--json", "--culture-legend", "nlcd", data + "/lake_sunapee_culture.tif"});
    REQUIRE(culture.code == 0);
    CHECK(json_of(culture.out)["files"][0]["unknown_cells"] == 0);
    const Outcome wrong = folder.run({"info", "--culture-legend", "fbfm40", data + "/lake_sunapee_culture.tif"});
    CHECK(wrong.code == 0);
    CHECK_THAT(wrong.out, Contains("15 codes, 107 858 cells"));
    const Outcome single = folder.run({"info", grid(folder, "single.asc", "5", true, 1, 1)});
    CHECK(single.code == 0);
    CHECK_THAT(single.out, Contains("no terrain for simulate"));
}

TEST_CASE("info tells of a polar raster's bins", "[cli]") {
    const Folder folder;
    REQUIRE(folder
                .run(with(good, {"-o", "scope.png", "--power", "power.tif", "--sector", "-30deg,30deg", "--heading",
                                 "90deg", "--azimuth-bins", "720", "--range-bin", "50m"}))
                .code == 0);
    const Outcome page = folder.run({"info", "power.tif"});
    REQUIRE(page.code == 0);
    CHECK_THAT(page.out, Contains("120 in azimuth x 100 in range = 12 000"));
    CHECK_THAT(page.out, Contains("60 to 120 deg from north, clockwise, in steps of 0.5\n"));
    CHECK_THAT(page.out, Contains("0 to 5000 m (slant), in steps of 50\n"));
    CHECK_THAT(page.out, Contains("0 cells (0 %)"));
    CHECK_THAT(page.out, Contains(", unit W\n"));
    CHECK_THAT(page.out, !Contains("corner") && !Contains("CRS"));
    const auto polar = json_of(folder.run({"info", "--json", "power.tif"}).out)["files"][0]["polar"];
    CHECK(polar == nlohmann::json{{"azimuth_start_deg", 60.0},
                                  {"azimuth_step_deg", 0.5},
                                  {"range_start_m", 0.0},
                                  {"range_step_m", 50.0},
                                  {"range_kind", "slant"}});
    CHECK_FALSE(json_of(folder.run({"info", "--json", dem}).out)["files"][0].contains("polar"));
}

TEST_CASE("info lists the codes of each raster, and says of too many that there are", "[cli]") {
    const Folder folder;
    const auto cells = [&](const std::string& name, int edge, auto value) {
        std::string all = "ncols " + std::to_string(edge) + "\nnrows " + std::to_string(edge) +
                          "\nxllcorner 500000\nyllcorner 4000000\ncellsize 30\nnodata_value -9999\n";
        for (int i = 0; i < edge * edge; ++i) all += std::to_string(value(i)) + (i % edge == edge - 1 ? "\n" : " ");
        return folder.write(name, all);
    };
    const std::string few = cells("a \"codes\": [].asc", 10, [](int i) { return i < 30   ? 11
                                                                                : i < 90 ? 21
                                                                                         : 5; }),
                      none = cells("none.asc", 10, [](int) { return -9999; }),
                      full = cells("full.asc", 128, [](int i) { return 100 + i; }),
                      many = cells("many.asc", 129, [](int i) { return 100 + i; });
    const std::vector<std::string> info = {"info", "--culture-legend", "nlcd"};
    const Outcome lists = folder.run(with(info, {"--json", few, none, full, many, few}));
    INFO(lists.err);
    REQUIRE(lists.code == 0);
    const auto files = json_of(lists.out)["files"];
    REQUIRE(files.size() == 5);
    REQUIRE(files[0]["codes"].size() == 3);
    CHECK(files[0]["codes"][0] == nlohmann::json{{"code", 5}, {"count", 10}, {"material", nullptr}});
    CHECK(files[0]["codes"][1] == nlohmann::json{{"code", 11}, {"count", 30}, {"material", "water"}});
    CHECK(files[0]["codes"][2]["count"] == 60);
    CHECK(files[0]["unknown_codes"] == 1);
    CHECK(files[4] == files[0]);
    CHECK(files[1]["codes"] == nlohmann::json::array());
    CHECK(files[1]["unknown_codes"] == 0);
    CHECK(files[2]["codes"].size() == 16384);
    CHECK(files[2]["codes"].back() == nlohmann::json{{"code", 16483}, {"count", 1}, {"material", nullptr}});
    CHECK(files[2]["unknown_cells"] == 16384);
    CHECK_FALSE(files[2].contains("more_codes_than"));
    for (const char* unlisted : {"codes", "unknown_codes", "unknown_cells"}) CHECK(files[3].at(unlisted).is_null());
    CHECK(files[3]["more_codes_than"] == 16384);
    // As any program writes JSON.
    CHECK(nlohmann::ordered_json::parse(lists.out).dump(2) + "\n" == lists.out);
    CHECK_THAT(folder.run(with(info, {many})).out, Contains("more than 16384, not listed by legend nlcd\n"));
    CHECK_THAT(folder.run(with(info, {full})).out, Contains("16384 by legend nlcd\n"));
}

TEST_CASE("info says that a legend is not for a scene", "[cli]") {
    const Folder folder;
    folder.write("a.ini", "dem = " + dem + "\nxy = 510000,3705300\naltitude-msl = 3km\nrange = 5km\n");
    const Outcome page = folder.run({"info", "--culture-legend", "nlcd", "a.ini"});
    CHECK(page.code == 0);
    CHECK_THAT(page.err, Contains("culture-legend is for rasters; the scene 'a.ini' goes by a key"));
    CHECK(folder.run({"info", "a.ini"}).err.empty());
    refuses(folder, {"info", "--verify", "a.ini"}, 2, {"verify is for tile stores", "'a.ini' is a scene"});
}

TEST_CASE("info resolves a scene by its own config and the command line's memory", "[cli]") {
    const Folder folder;
    // GTRasterTypeGeoKey: 1 area, 2 point.
    std::string tiff = content(dem);
    const std::string area("\x01\x04\0\0\x01\0\x01\0", 8);
    const auto at = tiff.find(area);
    REQUIRE(at != std::string::npos);
    tiff[at + 6] = 2;
    folder.write("point.tif", tiff);
    folder.write("a.ini", "dem = point.tif\nxy = 453717,3740093\naltitude-msl = 3km\nrange = 5km\n");
    const auto scene_of = [&](const Strings& more) {
        const Outcome page = folder.run(with({"info", "--json"}, more));
        INFO(page.err);
        REQUIRE(page.code == 0);
        return nlohmann::json::parse(page.out)["files"].back()["scene"];
    };
    CHECK(scene_of({"a.ini", "--memory", "48MiB"})["memory"] == "48MiB");
    // A post's height may be read as that of the pixel's corner: what stands below the sensor is another then.
    folder.write("p.ini", content(folder.file("a.ini")) + "config = GTIFF_POINT_GEO_IGNORE=YES\n");
    const auto plain = scene_of({"a.ini"})["resolved"], pixel = scene_of({"p.ini"})["resolved"];
    CHECK(pixel != plain);
    const Outcome plan = folder.run({"info", "--plan", "--json", "p.ini"});
    REQUIRE(plan.code == 0);
    CHECK(pixel == nlohmann::json::parse(plan.out)["scene"]["resolved"]);
    // And only by its own.
    CHECK(scene_of({"p.ini", "a.ini"})["resolved"] == plain);
}

TEST_CASE("a code that the legend does not name ends the run with the wedge that sees it", "[cli]") {
    const Folder folder;
    const Outcome run = folder.run({"simulate",
                                    "--dem",
                                    data + "/lake_sunapee_dem.tif",
                                    "--culture",
                                    data + "/lake_sunapee_culture.tif",
                                    "--culture-legend",
                                    "fbfm40",
                                    "--latlon",
                                    "43.38,-72.05",
                                    "--altitude-agl",
                                    "300m",
                                    "--range",
                                    "5km",
                                    "--threads",
                                    "1",
                                    "--wedges",
                                    "16",
                                    "--work-dir",
                                    "kept",
                                    "-o",
                                    "scope.png"});
    CHECK(run.code == 1);
    CHECK_THAT(run.err, Contains("code 11 on seen ground is not in the legend 'fbfm40'"));
    CHECK(folder.names() == std::set<std::string>{"kept"});
    const fs::directory_iterator kept(folder.work() / "kept");
    CHECK(std::distance(begin(kept), end(kept)) == 2);  // run.json and one wedge
}

TEST_CASE("a legend may come through a pipe, which gives it once", "[cli]") {
    const Folder folder;
    const std::string legend = folder.write("legend.csv", "code,material\n1,urban\n"), pipe = folder.file("pipe");
    const std::string ground = grid(folder, "ground", "5"), culture = grid(folder, "culture", "1");
    REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
    std::thread writer([&] {
        // Nobody waits for ever where the program does not open it, or opens it again.
        int to = -1;
        wait_until(std::chrono::milliseconds(5),
                   [&] { return (to = ::open(pipe.c_str(), O_WRONLY | O_NONBLOCK)) >= 0; });
        if (to < 0) return;
        const std::string text = content(legend);
        CHECK(::write(to, text.data(), text.size()) == static_cast<ssize_t>(text.size()));
        ::close(to);
    });
    const Outcome run = folder.finish(
        folder.start({"20", WEDGESCOPE_PROGRAM, "simulate", "--dem", ground, "--culture", culture, "--culture-legend",
                      pipe, "--xy", "465100,3750100", "--altitude-msl", "500m", "--range", "1km", "-o", "scope.png"},
                     "/usr/bin/timeout"));
    writer.join();
    INFO(run.err);
    CHECK(run.code == 0);
}

TEST_CASE("tile works from inside a store", "[cli]") {
    const Folder folder;
    const std::string ground = grid(folder, "ground", "5");
    REQUIRE(folder.run({"tile", ground, "st", "-q"}).code == 0);
    for (const auto& entry : fs::directory_iterator(folder.work() / "st"))
        fs::rename(entry, folder.work() / entry.path().filename());
    REQUIRE(folder.names().contains("manifest.json"));
    const Outcome outcome = folder.run({"tile", ground, "new"});
    INFO(outcome.err);
    CHECK(outcome.code == 0);
    CHECK_THAT(outcome.err, Contains(" in 1 sheet, "));
    CHECK_THAT(folder.run({"info", "new"}).out, Contains(" 1 tile of ") && Contains(" in 1 sheet, "));
    CHECK(folder.names().contains("new"));
    // The store that the current folder is has a name, too.
    refuses(folder, {"tile", ".", "other"}, 2, {"'.' is a tile store"});
}

TEST_CASE("no store is replaced in whose folder an input lies, or a file that is none of a store's", "[cli][long]") {
    const Folder folder;
    grid(folder, "a", "5");
    grid(folder, "codes", "3");
    REQUIRE(folder.run({"tile", "a.asc", "store", "--culture", "codes.asc", "-q"}).code == 0);
    const auto stands = [&] {
        std::map<std::string, std::string> all;
        for (const auto& entry : fs::recursive_directory_iterator(folder.work() / "store"))
            if (entry.is_regular_file()) all[entry.path()] = content(entry.path());
        return all;
    };
    const auto refused = [&](Strings inputs, const Strings& words) {
        const auto before = stands();
        inputs.insert(inputs.begin(), {"tile", "-q", "--overwrite"});
        inputs.emplace_back("store");
        refuses(folder, inputs, 2, words);
        CHECK(stands() == before);
    };
    const std::string end = "; an output may not replace an input";
    refused({"store/dem.vrt"}, {"output is 'store', in which dem 'store/dem.vrt' lies" + end});
    refused({"a.asc", "--culture", "store/culture.vrt"}, {"in which culture 'store/culture.vrt' lies" + end});
    refused({"a.asc", "--culture-height", "store/culture.vrt"}, {"culture-height", end});
    fs::create_symlink(folder.work() / "store" / "dem" / "c0_r0.tif", folder.work() / "link.tif");
    refused({"a.asc", "link.tif"}, {"dem 'link.tif' lies" + end});
    // A VRT of a VRT.
    const std::string raster =
                          "<VRTDataset rasterXSize=\"10\" rasterYSize=\"8\"><VRTRasterBand dataType=\"Float32\" "
                          "band=\"1\"><SimpleSource><SourceFilename relativeToVRT=\"1\">",
                      last = "</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>";
    folder.write("inner.vrt", raster + "store/dem/c0_r0.tif" + last);
    folder.write("outer.vrt", raster + "inner.vrt" + last);
    refused({"outer.vrt"}, {"c0_r0.tif' lies, of which dem 'outer.vrt' is made" + end});
    for (const char* file : {"mine.csv", "dem/mine.csv"}) {
        const std::string path = folder.write("store/" + std::string(file), "code,material\n3,water\n");
        refused({"a.asc", "--culture", "codes.asc", "--culture-legend", "store/" + std::string(file)},
                {"culture-legend", file, end});
        refused({"a.asc"},
                {"output 'store' holds 'store/" + std::string(file) + "', which is no part of a tile store"});
        fs::remove(path);
    }
    // Statistics of a layer, and what a newer build might not read.
    folder.write("store/dem.vrt.aux.xml", "<PAMDataset/>");
    folder.write("store/manifest.json", "{}");
    CHECK(folder.run({"tile", "-q", "--overwrite", "a.asc", "store"}).code == 0);
}

TEST_CASE("a store made without a legend leaves it to its scenes, as help says", "[cli]") {
    const Folder folder;
    CHECK_THAT(folder.run({"help", "tile"}).out, Contains("culture-legend may be left to the"));
    const std::string lake = data + "/lake_sunapee_";
    REQUIRE(folder.run({"tile", lake + "dem.tif", "--culture", lake + "culture.tif", "lake"}).code == 0);
    const Strings scene{"simulate",       "--dem", "lake", "--latlon", "43.38,-72.05",
                        "--altitude-agl", "900m",  "-o",   "scope.png"};
    refuses(folder, scene, 2, {"culture needs culture-legend", "nlcd"});
    CHECK(folder.run(with(scene, {"--culture-legend", "nlcd"})).code == 0);
    // What needs no class needs no legend.
    const Strings seen{"coverage",     "lake",           "m.tif", "--latlon",
                       "43.38,-72.05", "--altitude-agl", "900m",  "--overwrite"};
    CHECK(folder.run(seen).code == 0);
    CHECK(folder.run(with(seen, {"--source", "spilled"})).code == 0);
    folder.write("o.csv", "lat,lon\n43.38,-72.05\n");
    CHECK(folder.run({"coverage", "lake", "n.tif", "--observers", "o.csv", "--altitude-agl", "900m"}).code == 0);
    refuses(folder, with(seen, {"--layer", "response"}), 2, {"culture needs culture-legend"});
    refuses(folder,
            {"coverage", lake + "dem.tif", "x.tif", "--culture", lake + "culture.tif", "--latlon", "43.38,-72.05",
             "--altitude-agl", "900m"},
            2, {"--culture is ", "for --layer response alone"});
}

TEST_CASE("a folder that is no store is refused as one", "[cli]") {
    const Folder folder;
    fs::create_directory(folder.work() / "lost");
    const Strings words{"'lost' is a folder without manifest.json", "no tile store", "a folder that tile made"};
    refuses(folder, {"info", "lost"}, 1, words);
    refuses(folder, {"coverage", "lost", "seen.tif", "--xy", "1,1", "--altitude-agl", "9m"}, 1, words);
}

TEST_CASE("an empty set, and a table that is no text, are refused as what they are", "[cli]") {
    const Folder folder;
    folder.write("empty.ini", "# nothing\n");
    for (const char* set : {"/dev/null", "empty.ini"})
        refuses(folder, with(good, {"--set", set, "-o", "s.png"}), 2,
                {"set '" + std::string(set) + "' holds no key; accepted: at least one line key = value"});
    folder.write("utf16.csv", std::string("\xff\xfet\0i\0m\0e\0,\0", 12));
    for (const std::string& path : {dem, std::string("utf16.csv")}) {
        refuses(folder, {"simulate", "--dem", dem, "--range", "5km", "--track", path, "-o", "s.png"}, 2,
                {"track '" + path + "', line 1 is no text; accepted: a table of text"});
        refuses(folder, {"evaluate", "sight", "--in", path}, 2, {"table '" + path + "', line 1 is no text"});
    }
}

TEST_CASE("a pipe is refused where a raster is needed, and not waited for", "[cli]") {
    const Folder folder;
    const auto piped = [&](const std::string& words) {
        const std::string line = "cat '" + dem + "' | '" WEDGESCOPE_PROGRAM "' " + words;
        const Outcome outcome = folder.finish(folder.start({"-c", line}, "/bin/sh"));
        CHECK(outcome.code == 1);
        CHECK(outcome.error_lines() == 1);
        CHECK(folder.names().empty());
        return outcome.err;
    };
    CHECK_THAT(piped("simulate --dem /dev/stdin --xy 1,1 --altitude-msl 9km -o s.png"),
               Contains("dem '/dev/stdin' is a pipe; accepted: a file"));
    CHECK_THAT(piped("coverage /dev/stdin c.tif --xy 1,1 --altitude-msl 9km"), Contains("is a pipe; accepted: a file"));
    CHECK_THAT(piped("info /dev/stdin"), Contains("is a pipe; accepted: a file"));
    CHECK_THAT(piped("scope /dev/stdin -o s.png"), Contains("echo image '/dev/stdin' is a pipe; a file that"));
}

TEST_CASE("over nothing but voids no range follows from the terrain, and one that is given does", "[cli]") {
    const Folder folder;
    const Strings scene{"simulate",       "--dem", grid(folder, "void", "-9999"), "--xy", "465150,3750120",
                        "--altitude-msl", "150m"};
    refuses(folder, with(scene, out), 1, {"range is auto, and '", "void.asc' holds no valid post; give a range"});
    const Outcome given = folder.run(with(with(scene, out), {"--range", "2km"}));
    CHECK(given.code == 0);
    CHECK_THAT(given.err, Contains("or all of it is void"));
}

TEST_CASE("a sensor at a pole is told what would do", "[cli]") {
    const Folder folder;
    const auto raster = [&](const std::string& name, const std::string& crs, const std::string& grid) {
        return folder.write(name, R"(<VRTDataset rasterXSize="20" rasterYSize="20"><SRS>)" + crs +
                                      "</SRS><GeoTransform>" + grid +
                                      R"(</GeoTransform><VRTRasterBand dataType="Byte" band="1"/></VRTDataset>)");
    };
    raster("plane.vrt", "EPSG:3413", "-300,30,0,300,0,-30");
    raster("degrees.vrt", "EPSG:4326", "0,0.1,0,90,0,-0.1");
    const auto seen_over = [](const char* terrain) {
        return Strings{"coverage", terrain, "seen.tif", "--latlon", "90,0", "--altitude-msl", "100m"};
    };
    refuses(folder, seen_over("plane.vrt"), 2, {"within 1 m of a pole", "give geometry grid, or a place farther off"});
    refuses(folder, seen_over("degrees.vrt"), 2, {"within 1 m of a pole", "(give a place farther off)"});
    CHECK(folder.run(with(seen_over("plane.vrt"), {"--geometry", "grid"})).code == 0);
}

TEST_CASE("a kept ground map is used as long as it fits, and changes no byte", "[cli][long]") {
    const Folder folder;
    fs::copy_file(dem, folder.file("dem.tif"));
    const Strings seen{"coverage", "dem.tif", "--altitude-agl", "300m", "--latlon", "33.95,-117.35", "--reproducible"};
    const Strings scene{"simulate",      "--dem",   "dem.tif", "--altitude-agl", "300m", "--latlon",
                        "33.95,-117.35", "--range", "9km",     "--material",     "soil", "--reproducible"};
    REQUIRE(folder.run(with(seen, {"plain.tif"})).code == 0);
    REQUIRE(folder.run(with(scene, {"-o", "p_plain.png"})).code == 0);
    CHECK(folder.names().count("dem.tif.ground") == 0);
    const Outcome kept = folder.run(with(seen, {"kept.tif", "--keep-map"}));
    INFO(kept.err);
    REQUIRE(kept.code == 0);
    CHECK(folder.names() == std::set<std::string>{"dem.tif", "dem.tif.ground", "plain.tif", "kept.tif", "p_plain.png",
                                                  "p_plain.png.aux.xml"});
    REQUIRE(folder.run(with(seen, {"again.tif", "--report", "again.json"})).code == 0);
    CHECK(content(folder.file("plain.tif")) == content(folder.file("kept.tif")));
    CHECK(content(folder.file("plain.tif")) == content(folder.file("again.tif")));
    // What stays hidden is known without reading it.
    const auto report = json_in(folder.file("again.json"));
    CHECK(report.at("skipped").at("hidden").at("tiles").get<int>() > 0);
    REQUIRE(folder.run(with(scene, {"-o", "p_kept.png"})).code == 0);
    CHECK(content(folder.file("p_plain.png")) == content(folder.file("p_kept.png")));

    SECTION("of a raster that has changed") {
        fs::last_write_time(folder.file("dem.tif"), fs::file_time_type::clock::now() + std::chrono::hours(1));
    }
    SECTION("damaged") {
        std::fstream file(folder.file("dem.tif.ground"), std::ios::binary | std::ios::in | std::ios::out);
        file.seekp(40);
        file.put('x');
    }
    SECTION("cut") { fs::resize_file(folder.file("dem.tif.ground"), 5000); }
    const Outcome other = folder.run(with(seen, {"other.tif"}));
    INFO(other.err);
    CHECK(other.code == 0);
    CHECK(content(folder.file("plain.tif")) == content(folder.file("other.tif")));
    CHECK_THAT(other.err, Contains("not used: the ground map 'dem.tif.ground'"));
    const Outcome anew = folder.run(with(seen, {"anew.tif", "--keep-map"}));
    CHECK(anew.code == 0);
    CHECK_THAT(anew.err, !Contains("not used"));
    CHECK_THAT(folder.run(with(seen, {"last.tif"})).err, !Contains("not used"));
}

TEST_CASE("a ground map to be kept replaces one that is no good, but no other file", "[cli][long]") {
    const Folder folder;
    const std::string plain = float_raster(folder, "plain", 40, 40, std::vector<float>(1600, 7.0F)),
                      map = folder.file(plain + ".ground");
    const auto see = [&](const std::string& output, const Strings& more) {
        return folder.run(
            with({"coverage", plain, output, "--xy", "465500,3750000", "--altitude-msl", "1km", "-q"}, more));
    };
    const auto write = [&](const std::string& bytes) { std::ofstream(map, std::ios::binary) << bytes; };
    write("my notes\n");
    const Outcome refused = see("a.tif", {"--keep-map"});
    INFO(refused.err);
    CHECK(refused.code == 2);
    CHECK(refused.error_lines() == 1);
    CHECK_THAT(refused.err,
               Contains(plain + ".ground' is a file of 9 bytes that is no ground map; move it away, or add"));
    CHECK(content(map) == "my notes\n");
    CHECK(folder.names().count("a.tif") == 0);
    // Nor is it read.
    const Outcome unread = see("b.tif", {});
    CHECK(unread.code == 0);
    CHECK(see("a.tif", {"--keep-map", "--overwrite"}).code == 0);
    const std::string good = content(map);
    REQUIRE(good.size() > 1000);
    for (const std::string& bytes : {std::string(), good.substr(0, 9), good.substr(0, 900)}) {
        write(bytes);
        CHECK(see("cut" + std::to_string(bytes.size()) + ".tif", {"--keep-map"}).code == 0);
        CHECK((content(map) == good));
    }
    // A page of the map, behind both headers.
    std::string damaged = good;
    damaged[128 + 64 + 5] ^= 1;
    write(damaged);
    const Strings scene{"simulate",       "--dem", plain,     "--xy", "465500,3750000",
                        "--altitude-msl", "1km",   "--range", "1km",  "-q"};
    const Outcome met = folder.run(with(scene, {"-o", "c.png"}));
    INFO(met.err);
    CHECK(met.code == 1);
    CHECK_THAT(met.err, Contains(".ground'") && Contains("is damaged; remove that file, or let keep-map make it anew"));
    CHECK(folder.run(with(scene, {"-o", "c.png", "--keep-map"})).code == 0);
    CHECK((content(map) == good));
}

TEST_CASE("a ground map that cannot be kept is an error in one line", "[cli]") {
    const Folder folder;
    fs::copy_file(dem, folder.file("dem.tif"));
    fs::create_directory(folder.file("dem.tif.ground"));
    const Outcome o = folder.run(
        {"coverage", "dem.tif", "out.tif", "--altitude-agl", "300m", "--latlon", "33.95,-117.35", "--keep-map"});
    INFO(o.err);
    CHECK(o.code != 0);
    CHECK(o.error_lines() == 1);
    CHECK_THAT(o.err, Contains("dem.tif.ground"));
    CHECK(folder.names() == std::set<std::string>{"dem.tif", "dem.tif.ground"});
}
