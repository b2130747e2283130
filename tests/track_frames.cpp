// Frames: each picture of simulate --track is what its row gives alone, out of a data base that they share; what is said of
// them, and what is left of them when a run ends too soon.
#include <catch2/catch.hpp>

#include <signal.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "lib/engine.hpp"
#include "tests/json.hpp"
#include "tests/small_disk.hpp"
#include "tests/terrain.hpp"
#include "tests/tracks.hpp"
#include "tiles/shared_source.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

namespace {

std::vector<std::string> layers(const std::string& folder) {
    return {"-o",      folder + "/s.png", "--echo",   folder + "/e.tif",
            "--power", folder + "/p.tif", "--states", folder + "/t.tif"};
}

std::map<std::string, std::string> contents(const std::string& folder) {
    std::map<std::string, std::string> all;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
        all[entry.path().filename().string()] = content(entry.path());
    return all;
}

}  // namespace

TEST_CASE("a data base that stays in memory gives the bits of the source beneath", "[long][track]") {
    const auto hills = rolling(300, 40, 5);
    const auto make = [&] {
        auto source = std::make_unique<MemorySource>(150, 130, 50, [&](double c, double r) {
            return c > 100 && c < 110 && r > 60 ? static_cast<double>(void_post) : 200 + hills(c, r);
        });
        source->set_culture_height([](double c, double r) { return std::fmod(c, 17) < 4 && r > 40 ? 9.0 : 0.0; });
        source->set_classes([](double c, double r) { return static_cast<int>(c / 9 + r / 11) % 5 + 1; });
        return source;
    };
    Scene s = plane_scene(3600, -3100);
    s.azimuth_bins = 240;
    s.gamma.reset();
    const auto plain = make();
    const RunResult truth = run(resolve(s, *plain), *plain, EngineParams{});
    for (const std::size_t memory : {std::size_t{1} << 30, std::size_t{1} << 16}) {
        SharedSource shared(make(), memory);
        CHECK(shared.keeps() == (memory > std::size_t{1} << 20));
        shared.read(nullptr);
        const RunResult r = run(resolve(s, shared), shared, EngineParams{});
        CHECK(r.echo_w.cells == truth.echo_w.cells);
        CHECK(r.state.cells == truth.state.cells);
        CHECK(r.scope.grey == truth.scope.grey);
        CHECK(shared.held_bytes() <= shared.cache_bytes());
    }
}

TEST_CASE("each frame of a track is the picture that its row's numbers and a seed of its own give alone, byte for byte",
          "[track][long]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder);
    for (const char* name : {"alone", "track"}) std::filesystem::create_directory(folder / name);
    const std::vector<std::string> look = {"--sector", "-100deg,120deg", "--orientation",
                                           "heading",  "--quality",      "normal"};
    for (std::size_t i = 0; i < rows.size(); ++i) {
        std::vector<std::string> single =
            with(look, {"--xy", rows[i].x + "," + rows[i].y, "--altitude-msl", rows[i].altitude + "m", "--heading",
                        rows[i].heading + "deg", "--seed", std::to_string(i + 1)});
        for (std::string word : layers(folder / "alone")) {
            const auto dot = word.rfind('.');
            if (dot != std::string::npos && word.find('/') != std::string::npos)
                word.insert(dot, "_000" + std::to_string(i + 1));
            single.push_back(word);
        }
        const Ended ended = simulate(folder, single);
        INFO(ended.err);
        REQUIRE(ended.code == 0);
    }
    const auto truth = contents(folder / "alone");
    REQUIRE(truth.size() >= 4 * rows.size());
    // 2 MiB: one lane, and nothing of the data base stays in memory but GDAL's blocks.
    for (const auto& how : std::vector<std::vector<std::string>>{{"--threads", "1"},
                                                                 {"--threads", "2"},
                                                                 {"--threads", "3", "--wedges", "5"},
                                                                 {"--threads", "2", "--memory", "3MiB"},
                                                                 {"--threads", "2", "--no-cull"}}) {
        const Ended ended = simulate(folder, with(with(with(look, layers(folder / "track")), how),
                                                  {"--track", folder / "track.csv", "--overwrite"}));
        INFO(how.back() << " " << ended.err);
        REQUIRE(ended.code == 0);
        const auto made = contents(folder / "track");
        REQUIRE(made.size() == truth.size());
        for (const auto& [name, bytes] : truth) {
            INFO(name);
            REQUIRE(made.count(name) == 1);
            CHECK(made.at(name) == bytes);
        }
    }
}

TEST_CASE("noise and speckle are another draw in each frame of a track, and without them nothing is", "[track][long]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder, standing(2));
    const auto alike = [&](const std::vector<std::string>& more) {
        const Ended ended = simulate(
            folder,
            with({"--track", folder / "track.csv", "-o", folder / "s.png", "--overwrite", "--if-gain", "64dB"}, more));
        INFO(ended.err);
        REQUIRE(ended.code == 0);
        return content(folder / "s_0001.png") == content(folder / "s_0002.png");
    };
    CHECK(!alike({"--speckle", "0"}));
    CHECK(!alike({"--noise", "off"}));
    CHECK(alike({"--noise", "off", "--speckle", "0"}));
}

TEST_CASE("a track comes through standard input too", "[track][long]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder);
    REQUIRE(simulate(folder, {"--track", folder / "track.csv", "-o", folder / "named.png"}).code == 0);
    const auto piped = [&](const std::string& table) {
        return wait_for(start({program, "simulate", folder / "scene.ini", "--track", "-", "-o", folder / "piped.png"},
                              folder / "log", "/dev/null", table),
                        folder / "log");
    };
    REQUIRE(piped(folder / "track.csv").code == 0);
    for (std::size_t i = 1; i <= rows.size(); ++i) {
        const std::string frame = "_000" + std::to_string(i) + ".png";
        CHECK(content(folder / ("piped" + frame)) == content(folder / ("named" + frame)));
    }
    std::ofstream(folder / "bad.csv") << "time,x,y\n";
    CHECK_THAT(piped(folder / "bad.csv").err, Contains("wedgescope: track on standard input"));
}

TEST_CASE("two frames far apart over fine ground have the levels of detail that each has alone", "[track][long]") {
    const Folder folder;
    Drawing d;
    d.columns = 6600;  // farther apart than a page of the ground map is wide
    d.rows = 600;
    d.geotransform = std::array<double, 6>{465000, 2.5, 0, 3755000, 0, -2.5};
    d.value = [hills = rolling(12, 500, 3)](int c, int r) { return 300 + hills(c, r); };
    draw(folder / "fine.tif", d);
    std::ofstream(folder / "two.csv")
        << "time,x,y,altitude-msl,heading\n0,466500,3754250,600,0\n1,480000,3754250,600,0\n";
    const std::vector<std::string> look = {program,   "simulate", "--dem",      folder / "fine.tif", "--geometry",
                                           "grid",    "--range",  "1200m",      "--range-bin",       "40m",
                                           "--pulse", "1us",      "--overwrite"};
    const Ended both =
        run_program(with(look, {"--track", folder / "two.csv", "-o", folder / "both.png"}), folder / "log");
    INFO(both.err);
    REQUIRE(both.code == 0);
    const Ended alone = run_program(with(look, {"--xy", "480000,3754250", "--altitude-msl", "600m", "-o",
                                                folder / "alone.png", "--report", folder / "alone.json"}),
                                    folder / "log");
    INFO(alone.err);
    REQUIRE(alone.code == 0);
    CHECK(content(folder / "both_0002.png") == content(folder / "alone.png"));
    // A level was used at all.
    const auto levels = json_in(folder / "alone.json").at("levels");
    CHECK(levels.back().at("level").get<int>() > 0);
    // A scan's echo says so too.
    const Ended scan = run_program(with(look, {"--track", folder / "two.csv", "--scan-step", "500", "--scan-period",
                                               "4s", "-o", folder / "scan.png", "--echo", folder / "scan.tif"}),
                                   folder / "log");
    INFO(scan.err);
    REQUIRE(scan.code == 0);
    CHECK(content(folder / "scan_0002.tif").find("levels&amp;quot;:true") != std::string::npos);
}

TEST_CASE("what a user may take for an error is said once a track, with how many frames it is about", "[track]") {
    const Folder folder;
    draw_data(folder);
    // Three rows in five stand 100 km away.
    std::vector<Row> all = standing(5);
    for (const std::size_t i : {1, 2, 4}) all[i].x = "368200";
    write_track(folder, all);
    const auto says = [&](const std::vector<std::string>& more) {
        std::vector<std::string> words = {
            program, "simulate",       "--dem",       folder / "dem.tif", "--range", "4km",     "--range-bin",
            "40m",   "--azimuth-bins", "360",         "--size",           "64",      "--track", folder / "track.csv",
            "-o",    folder / "s.png", "--overwrite", "--threads",        "2"};
        const Ended ended = run_program(with(words, more), folder / "log");
        CHECK(ended.code == 0);
        return ended.err;
    };
    const std::string said = says({});
    CHECK_THAT(said, Contains("3 of 5 frames (first 2): nothing of the terrain lies within the range of 4 km"));
    CHECK_THAT(said, Contains("5 of 5 frames (first 1): azimuth bins of 1 deg are wider than half the beam"));
    CHECK(std::count(said.begin(), said.end(), '\n') == 3);  // and what is written
    CHECK(says({"-q"}).empty());
}

TEST_CASE("the geoid of a track whose rows stand above the ellipsoid has its effect", "[track]") {
    const Folder folder;
    draw_data(folder);
    for (const std::string altitude : {"altitude-hae", "altitude-msl"}) {
        std::ofstream(folder / "t.csv") << "time,x,y," << altitude << ",heading\n0,468200,3752000,900,0\n";
        const Ended ended =
            run_program({program, "simulate", "--dem", folder / "dem.tif", "--range", "4km", "--size", "64", "--track",
                         folder / "t.csv", "--geoid-offset", "-30m", "--overwrite", "-o", folder / "s.png"},
                        folder / "log");
        INFO(ended.err);
        CHECK(ended.code == 0);
        CHECK((ended.err.find("geoid-offset has no effect") == std::string::npos) == (altitude == "altitude-hae"));
    }
}

TEST_CASE("the report of a track tells of every frame", "[track]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder);
    const Ended ended = simulate(folder, {"--track", folder / "track.csv", "--report", folder / "r.json", "-o",
                                          folder / "s.png", "--timeline", folder / "t.json"});
    INFO(ended.err);
    REQUIRE(ended.code == 0);
    const auto report = json_in(folder / "r.json");
    CHECK(report["format"] == "wedgescope-track-1");
    REQUIRE(report["frames"].size() == rows.size());
    CHECK(report["frame_count"] == rows.size());
    CHECK(report["frames_per_second"].get<double>() > 0);
    const auto& second = report["frames"][1];
    CHECK(second["frame"] == 2);
    CHECK(second["line"] == 3);
    CHECK(second["time_s"] == 2.5);
    CHECK(second["x"].get<double>() == Approx(468410.5).margin(1e-4));
    CHECK(second["sensor_height_m"] == 950);
    CHECK(second["heading_deg"].get<double>() == Approx(77.5));
    CHECK(second["files"] == nlohmann::json::array({folder / "s_0002.png"}));
    CHECK(second["wall_s"].get<double>() > 0);
    CHECK(second["stages_wall_s"]["display"].get<double>() > 0);
    std::uint64_t cells = 0;
    for (const auto& [name, count] : second["states"].items()) cells += count.get<std::uint64_t>();
    CHECK(cells == 480 * 100);
    const Ended alone = simulate(folder, {"--xy", rows[1].x + "," + rows[1].y, "--altitude-msl", rows[1].altitude + "m",
                                          "--report", folder / "alone.json", "--overwrite"});
    INFO(alone.err);
    REQUIRE(alone.code == 0);
    CHECK(second["sampling"] == json_in(folder / "alone.json")["sampling"]);
    CHECK(json_in(folder / "t.json")["traceEvents"].size() > 20);
}

TEST_CASE("what ends a track leaves the frames before it whole and nothing else", "[track]") {
    const Folder folder;
    draw_data(folder);
    const auto frames_of = [&] {
        std::vector<std::string> names = folder.names(), found;
        for (const std::string& name : names) {
            CHECK(name.find(".tmp-") == std::string::npos);
            if (name.starts_with("s_") && name.ends_with(".png")) found.push_back(name);
        }
        return found;
    };
    SECTION("a row that cannot be") {
        std::vector<Row> all = standing(6);
        all[4].altitude = "-5";
        write_track(folder, all);
        const Ended ended = simulate(folder, {"--track", folder / "track.csv", "-o", folder / "s.png"});
        CHECK(ended.code == 2);
        CHECK_THAT(ended.err, Contains("line 6 (frame 5): the sensor is ") && Contains("below the terrain"));
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
        CHECK(frames_of().empty());  // found before any work
    }
    SECTION("a signal") {
        std::vector<Row> all = standing(400);
        for (std::size_t i = 0; i < all.size(); ++i) all[i].x = std::to_string(468200 + i);
        write_track(folder, all);
        const Ended ended = struck(folder, SIGINT);
        CHECK(ended.code == 130);
        const auto found = frames_of();
        REQUIRE(found.size() >= 5);
        REQUIRE(found.size() < all.size());
        CHECK_THAT(ended.err, Contains("frames 1 to " + std::to_string(found.size()) + " of 400 are written"));
        // Without a gap, and each as it is alone.
        std::filesystem::create_directory(folder / "alone");
        for (const std::size_t frame : {std::size_t{1}, found.size()}) {
            char name[32];
            std::snprintf(name, sizeof name, "s_%04zu.png", frame);
            const Ended alone =
                simulate(folder, {"--xy", all[frame - 1].x + "," + all[0].y, "--altitude-msl", "900m", "--seed",
                                  std::to_string(frame), "-o", folder / "alone" + ("/" + std::string(name))});
            INFO(alone.err);
            CHECK(alone.code == 0);
            CHECK(content(folder / name) == content(folder / "alone" + ("/" + std::string(name))));
        }
    }
    SECTION("terrain that changes") {
        write_track(folder, standing(400));
        const std::filesystem::path dem = folder / "dem.tif";
        const Ended ended = when_five_stand(folder, [&](pid_t) {
            std::filesystem::last_write_time(dem, std::filesystem::last_write_time(dem) + std::chrono::seconds(7));
        });
        CHECK(ended.code == 1);
        CHECK_THAT(ended.err, Contains("dem.tif' changed while it was read"));
        CHECK(frames_of().size() >= 5);
        CHECK(frames_of().size() < 400);
    }
    SECTION("a full disk") {
        write_track(folder);
        const SmallDisk disk(40000);  // an echo is 400 kB
        const Ended ended = simulate(folder, {"--track", folder / "track.csv", "-o", folder / "s.png", "--echo",
                                              folder / "e.tif", "--threads", "2"});
        CHECK(ended.code == 1);
        CHECK_THAT(ended.err, Contains("e_0001.tif' cannot be written") && Contains("none of 4 frames is written"));
        CHECK(frames_of().empty());
    }
}

TEST_CASE("the profile of a track tells how far its stages stay behind the machine's limits", "[track]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder);
    const Ended ended =
        simulate(folder, {"--track", folder / "track.csv", "-o", folder / "s.png", "--profile", "--threads", "2"});
    INFO(ended.err);
    REQUIRE(ended.code == 0);
    CHECK_THAT(ended.err, Contains("frames/s") && Contains("\nlimits of this machine, one thread: memory "));
    // Seconds and MiB of all frames.
    for (const char* name : {"sweep", "deposit", "merge", "beam", "write"}) {
        std::istringstream lines(ended.err);
        std::string stage;
        double seconds = 0, mebibytes = 0;
        for (std::string line; std::getline(lines, line);) {
            std::istringstream words(line);
            if (words >> stage && stage == name && words >> seconds >> mebibytes) break;
        }
        INFO(name);
        CHECK(mebibytes > 0);
        // Two images of 480 x 100 cells in 4 bytes, a frame.
        if (stage == "beam") CHECK(mebibytes == Approx(4 * 480 * 100 * 8 / 1048576.0).margin(0.006));
    }
}

TEST_CASE("a run that is done stays done where the machine's limits cannot be measured", "[track]") {
    const Folder folder;
    draw_data(folder);
    const SmallDisk disk(1 << 20);  // measuring writes 32 MiB
    const Ended ended =
        simulate(folder, {"--xy", "468200,3752000", "--altitude-msl", "900m", "-o", folder / "s.png", "--profile"});
    INFO(ended.err);
    CHECK(ended.code == 0);
    CHECK_THAT(ended.err, Contains("\nlimits of this machine are not known: ") && Contains("cannot be written"));
    CHECK(std::filesystem::exists(folder / "s.png"));
}

TEST_CASE("a scene file of a track serves one place too, without what it says of the track alone", "[track]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder);
    const std::string of_track = "dem = dem.tif\nrange = 3km\nscan-step = 4\nscan-period = 4s\npower-stack = s.tif\n";
    std::ofstream(folder / "track.ini") << of_track << "track = track.csv\n";
    std::ofstream(folder / "place.ini") << of_track << "xy = 468200,3752000\naltitude-msl = 900m\n";
    const std::vector<std::string> place = {"--xy", "468200,3752000", "--altitude-msl", "900m"};
    const auto code = [&](const std::vector<std::string>& words) {
        const Ended ended = run_program(with({program}, words), folder / "log");
        UNSCOPED_INFO(ended.err);
        return ended.code;
    };
    // The command line's place stands instead of the track.
    CHECK(code(with({"simulate", folder / "track.ini", "-o", folder / "one.png", "-q"}, place)) == 0);
    CHECK(std::filesystem::exists(folder / "one.png"));
    CHECK_FALSE(std::filesystem::exists(folder / "s.tif"));
    CHECK(code({"info", folder / "place.ini"}) == 0);
    CHECK(code({"budget", folder / "place.ini", "--at", "0deg,2km"}) == 0);
    CHECK(code({"budget", folder / "track.ini", "--latlon", "33.9,-117.344", "--altitude-msl", "900m", "--at",
                "0deg,2km"}) == 0);
    // Of simulate's own it is asked where the track is.
    CHECK(code({"simulate", folder / "place.ini", "-o", folder / "two.png"}) == 2);
}

TEST_CASE("names of all frames are looked at before work begins", "[track][long]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder);
    std::ofstream(folder / "s_0003.png") << "mine";
    const std::vector<std::string> track = {"--track", folder / "track.csv", "-o", folder / "s.png"};
    Ended ended = simulate(folder, track);
    CHECK(ended.code == 2);
    CHECK_THAT(ended.err, Contains("s_0003.png' exists; add --overwrite"));
    CHECK(content(folder / "s_0003.png") == "mine");
    CHECK(!std::filesystem::exists(folder / "s_0001.png"));
    ended = simulate(folder, with(track, {"--overwrite"}));
    INFO(ended.err);
    CHECK(ended.code == 0);
    CHECK(content(folder / "s_0003.png") != "mine");

    const auto says = [&](const std::vector<std::string>& more) { return refused_by_program(folder, more); };
    const std::vector<std::string> again = with(track, {"--overwrite"});
    CHECK_THAT(says(with(again, {"--work-dir", folder / "w"})), Contains("work-dir is given beside track"));
    CHECK_THAT(says(with(again, {"--work-dir", folder / "w", "--resume"})), Contains("work-dir is given beside track"));
    CHECK_THAT(says(with(again, {"--only-wedge", "0-1"})), Contains("only-wedge is given beside track"));
    CHECK_THAT(says(with(again, {"--source", "spilled"})), Contains("source is spilled, and track is given"));
    CHECK_THAT(says(with(again, {"--xy", "1,2"})), Contains("--track") || Contains("track alone says"));
    CHECK_THAT(says(with(again, {"--heading", "7deg"})),
               Contains("--heading is given beside track '") && Contains("whose column heading says it row by row"));
    CHECK_THAT(says(with(again, {"--scan-step", "4"})), Contains("scan-step is given without scan-period"));
    CHECK_THAT(says(with(again, {"--scan-period", "4s"})), Contains("scan-period is given without scan-step"));
    CHECK_THAT(says(with(again, {"--report", folder / "track.csv"})),
               Contains("report is") && Contains("which is track too"));
    // A file beside the frames must not be one of them, whether it stands already or not, however its name is written.
    std::filesystem::create_directory(folder / "d");
    std::filesystem::create_directory_symlink(folder / "d", folder / "link");
    for (const bool stands : {false, true}) {
        if (stands) std::ofstream(folder / "d/s_0003.png") << "mine";
        for (const char* key : {"--report", "--timeline"})
            for (const char* name : {"d/s_0003.png", "link/s_0003.png", "d/../link/./s_0003.png"}) {
                INFO(key << " " << name << (stands ? " stands" : ""));
                CHECK_THAT(says({"--track", folder / "track.csv", "-o", folder / "d/s.png", "--overwrite", key,
                                 folder / name}),
                           Contains("output and " + std::string(key + 2) + " are both ") &&
                               Contains("s_0003.png'; every output needs its own file"));
            }
    }
    CHECK(content(folder / "d/s_0003.png") == "mine");
    // Nor a part of one.
    for (const char* key : {"--report", "--timeline", "--power-stack"}) {
        const std::string side = folder / "d/p_0002.tif.geoloc.tif";
        CHECK_THAT(
            says({"--track", folder / "track.csv", "--power", folder / "link/p.tif", "--overwrite", key, side}),
            Contains(std::string(key + 2) + " is ") && Contains("(frame 2) may lie; every output needs its own file"));
        CHECK(!std::filesystem::exists(folder / "d/p_0001.tif"));
    }
    // Nor may any of them go into a tile store that is read.
    REQUIRE(run_program({program, "tile", "-q", folder / "dem.tif", folder / "store"}, folder / "log").code == 0);
    const Ended inside = run_program({program, "simulate", "--dem", folder / "store", "--track", folder / "track.csv",
                                      "-o", folder / "link/../store/s.png", "-q"},
                                     folder / "log");
    CHECK(inside.code == 2);
    CHECK_THAT(inside.err, Contains("output is '") && Contains("which lies in dem '") &&
                               Contains("/store'; an output may not lie in an input"));
    CHECK_THAT(says({"--scan-step", "4", "--scan-period", "4s", "--xy", "468200,3752000", "--altitude-msl", "900m",
                     "-o", folder / "x.png"}),
               Contains("scan-step is given without track"));
    CHECK_THAT(says({"--track", folder / "track.csv"}), Contains("no output is given"));
}
