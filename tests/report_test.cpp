// The run report: JSON by contract, and the table for the terminal.
#include <catch2/catch.hpp>

#include <fstream>
#include <map>
#include <sstream>

#include "lib/target.hpp"
#include "tools/coverage_report.hpp"
#include "tools/doubts.hpp"
#include "tools/options.hpp"
#include "tools/report_json.hpp"
#include "tools/terminal.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;

namespace {

RunResult drawn_run(std::size_t wedges) {
    RunResult run;
    run.scene.scene.range_m = 10000;
    run.scene.scene.range_bin_m = 20;
    run.scene.scene.azimuth_bins = 960;
    run.scene.shown = {960, 20, {0, 960}, {0, 500}};
    run.scene.swept = run.scene.shown;
    run.scene.sensor_m = 2000;
    run.scene.noise_power_w = 1e-13;
    for (std::size_t i = 0; i < wedges; ++i) {
        WedgeReport w;
        w.index = static_cast<std::int64_t>(i);
        w.azimuth_bins = {w.index * 10, w.index * 10 + 10};
        w.load_s = 0.5;
        w.sweep_s = 0.25;
        w.posts_read = 1000 * (i + 1);
        w.bytes_read = 2000;
        w.samples = 7;
        w.disk_wait_s = 0.125;
        w.bytes_skipped = 3;
        w.bytes_spilled = 4;
        w.peak_bytes = 100 * (i + 1);
        run.report.wedges.push_back(w);
    }
    run.report.states = {1, 2, 3, 4, 5};
    run.report.threads = 2;
    run.sampling = {.spokes_per_post = 1.25, .spokes_per_bin = 12, .lead = 4};
    run.promise = {{0.05, 0.2}, 3000, {}};
    return run;
}

}  // namespace

TEST_CASE("the report holds what the contract names", "[report]") {
    const RunResult run = drawn_run(3);
    Settings settings =
        parse_arguments(command_simulate, {"--dem", "a.tif", "--latlon", "1,2", "--altitude-msl", "2km"});
    const auto out =
        report_json(settings, run, {{"dem", "a.tif", 42, "WGS 84"}, {"culture", "/vsicurl/x", std::nullopt, ""}},
                    {0.75, 0.5}, {2, 1.5, 0.25, 1 << 20, 3, 1000, 2000, {}, {}});
    CHECK(out["format"] == "wedgescope-report-1");
    CHECK(out["version"] == version());
    REQUIRE(out["wedges"].is_array());
    REQUIRE(out["wedges"].size() == 3);
    CHECK(out["wedges"][1]["wedge"] == 1);
    CHECK(out["wedges"][1]["posts_read"] == 2000);
    CHECK(out["wedges"][1]["cpu_s"]["load"] == 0.5);
    CHECK(out["wedges"][1]["peak_bytes"] == 200);
    CHECK(out["total"]["posts_read"] == 6000);
    CHECK(out["total"]["peak_bytes"] == 300);
    for (const char* what : {"posts", "tiles", "bytes"}) CHECK(out["read"][what] == 0);
    for (const char* cause : {"range", "horizon", "hidden", "culture", "detail"}) {
        for (const char* what : {"posts", "tiles", "bytes"}) CHECK(out["skipped"][cause][what] == 0);
    }
    CHECK(out["states"] ==
          nlohmann::ordered_json::parse(R"({"no data":1,"shadow":2,"seen":3,"unknown":4,"outside":5})"));
    CHECK(out["reused"] == 0);
    CHECK(out["levels"].is_array());
    CHECK(out["sampling"] ==
          nlohmann::ordered_json::parse(R"({"spokes_per_post":1.25,"spokes_per_bin":12.0,"spoke_lead":4.0})"));
    CHECK(out["promise"] ==
          nlohmann::ordered_json::parse(R"({"rms_db":0.05,"p99_db":0.2,"from_range_m":3000.0,"lacks":[]})"));
    CHECK(out["inputs"][0]["bytes"] == 42);
    CHECK(out["inputs"][1]["bytes"].is_null());
    CHECK(out["wall_s"] == 2.0);
    CHECK(out["user_s"] == 1.5);
    CHECK(out["system_s"] == 0.25);
    CHECK(out["peak_rss_bytes"] == 1 << 20);
    CHECK(out["io"]["read_bytes"] == 1000);
    CHECK(out["io"]["written_bytes"] == 2000);
    CHECK(out["io"]["disk_read_bytes"].is_null());
    CHECK(out["io"]["major_faults"] == 3);
    CHECK(out["wedges"][1]["cpu_s"]["merge"] == 0.0);
    CHECK(out["wedges"][1]["disk_wait_s"] == 0.125);
    CHECK(out["wedges"][1]["memory_wait_s"] == 0.0);
    CHECK(out["wedges"][1]["bytes_skipped"] == 3);
    CHECK(out["wedges"][1]["bytes_spilled"] == 4);
    CHECK(out["total"]["disk_wait_s"] == 0.375);
    CHECK(out["total"]["bytes_spilled"] == 12);
    CHECK(out["wedges"][1]["reused"] == false);
    CHECK(out["stages_wall_s"]["open"] == 0.75);
    CHECK(out["stages_wall_s"]["write"] == 0.5);
    CHECK(out["threads"] == 2);
    CHECK(out["instruction_set"] == name_of(target_in_use()));
    // Defaults are numbers, with their units.
    CHECK(out["scene"]["frequency"] == "16.5GHz");
    CHECK(out["scene"]["range"] == "10km");
    CHECK(out["scene"]["azimuth-bins"] == "960");
    CHECK(out["scene"]["bandwidth"] == "2.4MHz");
    CHECK(out["scene"]["altitude-msl"] == "2km");
    CHECK(out["scene"]["resolved"]["sensor_height_m"] == 2000.0);
    for (const Key& key : key_table()) {
        if ((key.commands & command_simulate) && key.in_scene_file) CHECK(out["scene"].contains(key.name));
    }
}

TEST_CASE("the report says which quality max-error took", "[report]") {
    const std::vector<std::string> asked = {"--latlon", "1,2", "--altitude-msl", "2km", "--max-error", "0.05dB"};
    const auto with = [&](std::vector<std::string> words) {
        words.insert(words.end(), asked.begin(), asked.end());
        return words;
    };
    const Settings scene = parse_arguments(command_simulate, with({"--dem", "a.tif"})),
                   cover = parse_arguments(command_coverage, with({"a.tif", "b.tif"}));
    RunResult run = drawn_run(1);
    run.scene.scene.quality = scene.scene.quality;
    run.scene.scene.max_error_db = scene.scene.max_error_db;
    for (const nlohmann::ordered_json& said :
         {nlohmann::ordered_json(report_json(scene, run, {}, {}, {})["scene"]), coverage_scene(cover)}) {
        CHECK(said["resolved"]["quality"] == "fine");
        CHECK(said["max-error"] == "0.05dB");
    }
}

TEST_CASE("each stage's work counts its seconds once", "[report]") {
    RunReport report = drawn_run(2).report;
    for (WedgeReport& wedge : report.wedges) wedge.merge_s = 0.25;
    report.merge_s = 0.5;  // the same, seen from the run
    report.beam_s = 1;
    report.receiver_s = 2;
    report.display_s = 4;
    std::map<std::string, StageWork> stages;
    for (const StageWork& stage : stage_work(report, 8, {})) stages.emplace(stage.name, stage);
    const std::pair<const char*, double> seconds[] = {{"load", 1}, {"sweep", 0.5},  {"deposit", 0}, {"merge", 0.5},
                                                      {"beam", 1}, {"receiver", 2}, {"display", 4}, {"write", 8}};
    CHECK(stages.size() == std::size(seconds));
    for (const auto& [name, s] : seconds) {
        INFO(name);
        REQUIRE(stages.count(name) == 1);
        CHECK(stages.at(name).seconds == s);
    }
    CHECK(stages.at("display").bytes == 15 * 5);  // of 15 cells power and state
}

TEST_CASE("who asks for max-error is told where it does not hold", "[report]") {
    RunResult run = drawn_run(1);
    const auto remark = [&] { return doubts(run, true)[error_unkept]; };
    CHECK(remark().empty());  // a quality was asked for
    run.scene.scene.max_error_db = 0.05;
    CHECK(remark() == "max-error is promised from 3 km on, where the beam is two posts wide");
    run.scene.scene.range_start_m = 3000;
    CHECK(remark().empty());
    run.promise.lacks = {"bwe is off", "course is given"};
    CHECK(remark() == "max-error is not promised here: bwe is off; course is given");
}

TEST_CASE("the table has a row for each wedge, and for many one for the rest", "[report]") {
    const auto lines = [](const std::string& page) {
        std::vector<std::string> all;
        std::istringstream in(page);
        for (std::string line; std::getline(in, line);) all.push_back(line);
        return all;
    };
    const auto few = lines(report_table(drawn_run(3).report, {0.9, 0.1}, {}));
    CHECK(few.size() == 2 + 3 + 1 + 4);
    RunReport report = drawn_run(1000).report;
    report.wedges[500].sweep_s = 9999;
    report.wedges[400].sweep_s = 99;
    report.wedges[7].reused = true;
    const auto many = lines(report_table(report, {0, 0.1}, {}, 40));
    CHECK(many.size() == 2 + 40 + 1 + 1 + 4);
    // Columns stand under one another, and the dearest wedges come first.
    for (const auto& page : {few, many})
        for (std::size_t i = 0; i + 5 < page.size(); ++i) {
            if (page[i].starts_with("reused")) continue;
            INFO(page[i]);
            CHECK(page[i].size() == page[0].size());
            CHECK(page[i].size() <= 140);
        }
    CHECK_THAT(many[2], Contains("500") && Contains("5000..5009") && Contains(" 9999 "));
    CHECK_THAT(many[3], Contains("400"));
    CHECK_THAT(many[41], Contains("960 wedges"));
    CHECK_THAT(many[43], Contains("reused 1 of 1000 wedges"));
    CHECK_THAT(few[6], Contains("share ") && Contains(" open "));
    CHECK_THAT(few[7], Contains("seen 20.0 %"));
    CHECK(lines(report_table(RunReport{}, {}, {})).size() == 2 + 1 + 4);
}

TEST_CASE("what the process used is counted", "[report]") {
    const Usage before = usage_since(now_s());
    REQUIRE(before.written_bytes);
    std::ofstream("/dev/null") << std::string(1 << 20, 'x');
    const Usage after = usage_since(now_s());
    CHECK(*after.written_bytes >= *before.written_bytes + (1 << 20));
    CHECK(after.read_bytes);
    CHECK(after.disk_read_bytes);
}

TEST_CASE("what the process used is positive and a kibibyte multiple", "[report]") {
    const Usage usage = usage_since(now_s());
    CHECK(usage.wall_s >= 0);
    CHECK(usage.user_s + usage.system_s > 0);
    CHECK(usage.peak_rss_bytes > 1 << 20);
    CHECK(usage.peak_rss_bytes % 1024 == 0);
}

TEST_CASE("a CRS is named by its WKT", "[report]") {
    CHECK(crs_name(R"(PROJCRS["WGS 84 / UTM zone 11N",BASEGEOGCRS["WGS 84"]])") == "WGS 84 / UTM zone 11N");
    CHECK(crs_name("").empty());
    CHECK(crs_name("LOCAL_CS[\"x").empty());
}

TEST_CASE("a message is one line whatever a path holds", "[report]") {
    CHECK(one_line("a\nb\tc\x1b[31m\n") == "a b c [31m");
    CHECK(grouped(1234567) == "1 234 567");
    CHECK(grouped(12) == "12");
    CHECK(readable_bytes(1536) == "1.5 KiB");
}
