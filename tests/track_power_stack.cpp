// A power stack: the power images of all frames of a track as bands of one file.
#include <catch2/catch.hpp>

#include <signal.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/json.hpp"
#include "tests/small_disk.hpp"
#include "tests/tracks.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

TEST_CASE("the bands of a power stack are the numbered files, every bit and every word", "[track][long]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder);
    for (const std::string unit : {"W", "dBm"}) {
        const std::vector<std::string> track = {"--track", folder / "track.csv", "--power-unit", unit, "--overwrite"};
        const Ended both = simulate(folder, with(track, {"--power", folder / "p.tif", "--power-stack",
                                                         folder / "stack.tif", "--report", folder / "r.json"}));
        INFO(unit << ' ' << both.err);
        REQUIRE(both.code == 0);
        CHECK(json_in(folder / "r.json")["power_stack"] == folder / "stack.tif");
        Bands stack(folder / "stack.tif");
        REQUIRE(stack.count() == rows.size());
        const auto common = Bands::metadata(stack.raster());
        for (std::size_t frame = 1; frame <= rows.size(); ++frame) {
            INFO("frame " << frame);
            Bands alone(folder / ("p_000" + std::to_string(frame) + ".tif"));
            GDALRasterBand &mine = stack.band(frame), &its = alone.band(1);
            CHECK(stack.bits(frame) == alone.bits(1));
            CHECK(mine.GetUnitType() == std::string(its.GetUnitType()));
            CHECK(mine.GetUnitType() == unit);
            int declared = 0, also = 0;
            CHECK(mine.GetNoDataValue(&declared) == its.GetNoDataValue(&also));
            CHECK(declared == also);
            auto own = Bands::metadata(mine);
            for (const auto& [name, value] : Bands::metadata(alone.raster())) {
                if (name == "SCENE_JSON" || name == "AREA_OR_POINT") continue;
                INFO(name);
                CHECK(common.count(name) + own.count(name) == 1);
                CHECK((common.count(name) ? common.at(name) : own[name]) == value);
            }
            auto scene = json_of(common.at("SCENE_JSON"));
            scene.merge_patch(json_of(own.at("SCENE_JSON")));
            CHECK(scene == json_of(alone.raster().GetMetadataItem("SCENE_JSON")));
            const Row& row = rows[frame - 1];
            CHECK(mine.GetDescription() == "frame " + std::to_string(frame) + ", " + row.time + " s");
            CHECK(own["FRAME"] == std::to_string(frame));
            CHECK(own["TRACK_LINE"] == std::to_string(frame + 1));
            CHECK(own["TIME_S"] == row.time);
            CHECK(own["ALTITUDE_MSL_M"] == row.altitude);
            CHECK(own["HEADING_DEG"] == row.heading);
        }
        const pid_t told = start({program, "info", "--json", folder / "stack.tif"}, folder / "log", folder / "info");
        REQUIRE(wait_for(told, folder / "log").code == 0);
        const auto facts = json_in(folder / "info")["files"][0];
        CHECK(facts["bands"] == rows.size());
        CHECK(facts["polar"]["range_kind"] == "slant");
        CHECK(facts["polar"]["azimuth_start_deg"] == 0);
        // By itself, from other threads and out of little memory the same file.
        const std::string truth = content(folder / "stack.tif");
        for (const auto& how : std::vector<std::vector<std::string>>{
                 {"--threads", "1"}, {"--threads", "2"}, {"--threads", "3"}, {"--threads", "2", "--memory", "4MiB"}}) {
            const Ended ended = simulate(folder, with(with(track, how), {"--power-stack", folder / "again.tif"}));
            INFO(how.back() << ' ' << ended.err);
            REQUIRE(ended.code == 0);
            CHECK(content(folder / "again.tif") == truth);
        }
        // What it holds is counted: numbered files alone come out of 3 MiB.
        const Ended less = simulate(folder, with(track, {"--threads", "2", "--memory", "3MiB", "-o",
                                                         folder / "again.png", "--power-stack", folder / "again.tif"}));
        CHECK(less.code == 2);
        CHECK_THAT(less.err, Contains("memory is 3 MiB; this scene needs at least 4 MiB"));
    }
    // A scan's too.
    const Ended scan = simulate(folder, {"--track", folder / "track.csv", "--scan-step", "40", "--scan-period", "4s",
                                         "--power", folder / "scan.tif", "--power-stack", folder / "scans.tif"});
    INFO(scan.err);
    REQUIRE(scan.code == 0);
    Bands stack(folder / "scans.tif");
    for (std::size_t frame = 1; frame <= rows.size(); ++frame)
        CHECK(stack.bits(frame) == Bands(folder / ("scan_000" + std::to_string(frame) + ".tif")).bits(1));
    CHECK(stack.bits(1) != Bands(folder / "p_0001.tif").bits(1));
}

TEST_CASE("a power stack longer than the memory stays out of it", "[track][long]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder, standing(44));
    const Ended ended = simulate(folder, {"--track",        folder / "track.csv",
                                          "--noise",        "off",
                                          "--speckle",      "0",
                                          "--bwe",          "off",
                                          "--range",        "40km",
                                          "--range-bin",    "50m",
                                          "--azimuth-bins", "1440",
                                          "--quality",      "draft",
                                          "--memory",       "64MiB",
                                          "--threads",      "2",
                                          "--power-stack",  folder / "stack.tif"});
    INFO(ended.err);
    REQUIRE(ended.code == 0);
    constexpr std::uint64_t promised = std::uint64_t{128} << 20;
    CHECK(std::filesystem::file_size(folder / "stack.tif") > promised * 3 / 2);
    CHECK(ended.peak_rss_bytes <= promised);
}

TEST_CASE("a power stack that cannot be is refused in one line before work begins", "[track][long]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder);
    const auto before = folder.names();
    const auto says = [&](const std::vector<std::string>& more) { return refused_by_program(folder, more); };
    const std::vector<std::string> track = {"--track", folder / "track.csv", "-o", folder / "s.png", "--power-stack"};
    CHECK_THAT(says({"--xy", "468200,3752000", "--altitude-msl", "900m", "--power-stack", folder / "st.tif"}),
               Contains("power-stack is given without track"));
    CHECK_THAT(says(with(track, {folder / "st.png"})),
               Contains("st.png'; it is a GeoTIFF: accepted is a name that ends in .tif or .tiff"));
    CHECK_THAT(says({"--track", folder / "track.csv", "--power-stack", folder / "st.tif", "--co", "COMPRESS=LZW"}),
               Contains("co is given, and power-stack is the only raster"));
    CHECK_THAT(says({"--track", folder / "track.csv", "--power-stack", folder / "st.tif", "--of", "HFA"}),
               Contains("of is given, and power-stack is the only raster"));
    // Half a bin of heading more, and the sector touches one bin more.
    CHECK_THAT(says(with(track, {folder / "st.tif", "--sector", "-60deg,60deg"})),
               Contains("track.csv', line 3 (frame 2): power-stack: the power image has 161 x 100 bins (azimuth, "
                        "range), that of frame 1 160 x 100; all must have as many (leave sector out, or let headings "
                        "lie whole azimuth bins apart)"));
    CHECK_THAT(says(with(track, {folder / "st.tif", "--range", "auto"})),
               Contains("line 3 (frame 2): power-stack: the power image has 480 x ") && Contains("(give range)"));
    CHECK_THAT(says(with(track, {folder / "dem.tif", "--overwrite"})),
               Contains("power-stack is") && Contains("which is dem too"));
    CHECK_THAT(says({"--track", folder / "track.csv", "--power", folder / "p.tif", "--power-stack",
                     folder / "p_0003.tif", "--overwrite"}),
               Contains("power and power-stack are both ") && Contains("every output needs its own file"));
    {
        std::ofstream out(folder / "many.csv");
        out << "time,x,y,altitude-msl\n";
        for (int i = 0; i < 65536; ++i) out << i << ",468200,3752000,900\n";
    }
    CHECK_THAT(says({"--track", folder / "many.csv", "--power-stack", folder / "st.tif"}),
               Contains("many.csv' has 65536 rows; a GeoTIFF has at most 65535 bands"));
    std::filesystem::remove(folder / "many.csv");
    std::filesystem::remove(folder / "log");
    CHECK(folder.names() == before);

    std::ofstream(folder / "st.tif") << "mine";
    CHECK_THAT(says(with(track, {folder / "st.tif"})), Contains("st.tif' exists; add --overwrite"));
    CHECK(content(folder / "st.tif") == "mine");
    const Ended over = simulate(folder, with(track, {folder / "st.tif", "--overwrite"}));
    INFO(over.err);
    CHECK(over.code == 0);
    CHECK(Bands(folder / "st.tif").count() == rows.size());
}

TEST_CASE("a power stack whose track does not end well leaves nothing", "[track]") {
    const Folder folder;
    draw_data(folder);
    const auto left = [&] {
        std::size_t pictures = 0;
        for (const std::string& name : folder.names()) {
            INFO(name);
            CHECK(name.find("stack") == std::string::npos);
            CHECK(name.find(".tmp-") == std::string::npos);
            pictures += name.starts_with("s_") && name.ends_with(".png");
        }
        return pictures;
    };
    SECTION("a signal") {
        const std::vector<Row> all = standing(400);
        write_track(folder, all);
        const Ended ended = struck(folder, SIGTERM, {"--power-stack", folder / "stack.tif"});
        CHECK(ended.code == 143);
        const std::size_t pictures = left();
        REQUIRE(pictures >= 5);
        REQUIRE(pictures < all.size());
        CHECK_THAT(ended.err,
                   Contains("frames 1 to " + std::to_string(pictures) + " of 400 are written and no power-stack"));
    }
    SECTION("a disk too small for all frames") {
        write_track(folder);
        const SmallDisk disk(700000);  // a frame takes 192 kB
        const Ended ended = simulate(
            folder, {"--track", folder / "track.csv", "-o", folder / "s.png", "--power-stack", folder / "stack.tif"});
        CHECK(ended.code == 1);
        CHECK_THAT(ended.err, Contains("stack.tif' cannot be written: File too large (4 frames take 1 MiB)"));
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
        CHECK(left() == 0);
    }
    SECTION("a disk that is full at the last word") {
        write_track(folder);
        const SmallDisk disk(4096 + 4 * 192000 + 3000);
        const Ended ended = simulate(
            folder, {"--track", folder / "track.csv", "-o", folder / "s.png", "--power-stack", folder / "stack.tif"});
        CHECK(ended.code == 1);
        CHECK_THAT(ended.err, Contains("stack.tif' cannot be written: File too large"));
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
        CHECK(left() == rows.size());
    }
    SECTION("a frame that cannot be written") {
        write_track(folder);
        const SmallDisk disk(800000);  // a picture is longer
        const Ended ended = simulate(folder, {"--track", folder / "track.csv", "-o", folder / "s.png", "--size", "4000",
                                              "--power-stack", folder / "stack.tif"});
        CHECK(ended.code == 1);
        CHECK_THAT(ended.err, Contains("s_0001.png' cannot be written") &&
                                  Contains("none of 4 frames is written and no power-stack"));
        CHECK(left() == 0);
    }
    SECTION("a row that cannot be") {
        std::vector<Row> all = rows;
        all[2].altitude = "-5";
        write_track(folder, all);
        const Ended ended = simulate(folder, {"--track", folder / "track.csv", "--power-stack", folder / "stack.tif"});
        CHECK(ended.code == 2);
        CHECK_THAT(ended.err, Contains("line 4 (frame 3): the sensor is "));
        CHECK(left() == 0);
    }
}
