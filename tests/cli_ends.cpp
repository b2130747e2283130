// What ends the built program too soon: a signal, a kill, a raster that changes under it. It says so in one line and
// leaves nothing, or what it can go on from.
#include <catch2/catch.hpp>

#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <sstream>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "tests/cli.hpp"

using namespace wedgescope::test;
using namespace wedgescope::test::cli;
using namespace std::chrono_literals;
using Catch::Matchers::Contains;

TEST_CASE("a signal ends the run with 128 + its number and leaves nothing", "[cli][long]") {
    const Folder folder;
    const Strings arguments = with(good, {"-o", "scope.png", "--echo", "echo.tif", "--range", "40km", "--quality",
                                          "exact", "--azimuth-bins", "8000", "--range-bin", "10m", "--threads", "1"});
    Strings once;  // `good` holds a range already
    for (std::size_t i = 0; i < arguments.size(); ++i) {
        if (arguments[i] == "--range" && arguments[i + 1] == "5km") {
            ++i;
            continue;
        }
        once.push_back(arguments[i]);
    }
    for (const auto& [signal, code] :
         {std::pair{SIGINT, 130}, {SIGTERM, 143}, {SIGHUP, 129}, {SIGUSR1, 138}, {SIGXCPU, 152}}) {
        const pid_t child = folder.start(once);
        // At work as soon as its outputs' temporary folders stand.
        wait_until(5ms, [&] { return folder.names().size() >= 2; });
        std::this_thread::sleep_for(50ms);
        REQUIRE(::kill(child, signal) == 0);
        const Outcome outcome = folder.finish(child);
        INFO(outcome.err);
        CHECK(outcome.code == code);
        CHECK(outcome.error_lines() == 1);
        CHECK(folder.names().empty());
    }
}

TEST_CASE("the first signal ends the wait for a table from a pipe that nobody writes to", "[cli]") {
    const Folder folder;
    REQUIRE(::mkfifo((folder.work() / "pipe").c_str(), 0600) == 0);
    for (const Strings& arguments :
         {Strings{"coverage", dem, "c.tif", "--observers", "pipe"},
          Strings{"simulate", "--dem", dem, "--range", "5km", "--track", "pipe", "-o", "s.png"}}) {
        const pid_t child = folder.start(arguments);
        std::this_thread::sleep_for(500ms);
        REQUIRE(::kill(child, SIGTERM) == 0);
        const Outcome outcome = folder.finish(child);
        CHECK(outcome.code == 143);
        CHECK_THAT(outcome.err, Contains("stopped by signal 15"));
        CHECK(folder.names() == std::set<std::string>{"pipe"});
    }
}

TEST_CASE("the first signal ends the wait for a text from a pipe that nobody writes to", "[cli]") {
    const Folder folder;
    REQUIRE(::mkfifo((folder.work() / "pipe").c_str(), 0600) == 0);
    for (const Strings& arguments :
         {Strings{"simulate", "pipe", "-o", "s.png"}, with(good, {"--antenna", "pipe", "-o", "s.png"}),
          with(good, {"--set", "pipe", "-o", "s.png"}), with(good, {"--class-table", "pipe", "-o", "s.png"}),
          Strings{"tile", dem, "store", "--culture", dem, "--culture-legend", "pipe"}}) {
        const pid_t child = folder.start(arguments);
        std::this_thread::sleep_for(500ms);
        REQUIRE(::kill(child, SIGTERM) == 0);
        const Outcome outcome = folder.finish(child);
        INFO(arguments[1] << ": " << outcome.err);
        CHECK(outcome.code == 143);
        CHECK_THAT(outcome.err, Contains("stopped by signal 15"));
        CHECK(folder.names() == std::set<std::string>{"pipe"});
    }
    refuses(folder, {"tile", dem, "store", "--features", "pipe"}, 1, {"features 'pipe' is a pipe; accepted: a file"});
    // One that is written to is read.
    const pid_t child = folder.start(with(good, {"--set", "pipe", "-o", "s.png", "-q"}));
    std::this_thread::sleep_for(200ms);
    folder.write("pipe", "beam = 2deg\n");
    const Outcome outcome = folder.finish(child);
    INFO(outcome.err);
    CHECK(outcome.code == 0);
}

TEST_CASE("a run whose reader goes away ends without a word and leaves nothing", "[cli]") {
    const Folder folder;
    const pid_t child = folder.start(with(good, {"-o", "scope.png", "--quality", "exact", "--azimuth-bins", "8000",
                                                 "--range-bin", "10m", "--threads", "1"}));
    wait_until(5ms, [&] { return !folder.names().empty(); });
    REQUIRE(::kill(child, SIGPIPE) == 0);
    const Outcome outcome = folder.finish(child);
    CHECK(outcome.code == 141);
    CHECK(outcome.err.empty());
    CHECK(folder.names().empty());
    const std::string line = "cd '" + folder.work().string() + "' && (sleep 0.3; '" + WEDGESCOPE_PROGRAM +
                             "' help simulate 2> err; echo $? > code) | true; sleep 1";
    REQUIRE(std::system(line.c_str()) == 0);
    CHECK(content(folder.file("err")).empty());
    CHECK(content(folder.file("code")) == "141\n");
    // Nor does it fall over what it has to say where it can say nothing.
    const std::string mute = "cd '" + folder.work().string() + "' && (sleep 0.3; '" + WEDGESCOPE_PROGRAM +
                             "' nonsense 2>&1 >/dev/null; echo $? > code) | true; sleep 1";
    REQUIRE(std::system(mute.c_str()) == 0);
    CHECK(content(folder.file("code")) == "2\n");
}

TEST_CASE("a signal that comes twice at once, as timeout sends it, is one", "[cli][long]") {
    const Folder folder;
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        const pid_t child =
            folder.start(with(good, {"-o", "scope.png", "--report", "run.json", "--quality", "exact", "--azimuth-bins",
                                     "8000", "--range-bin", "10m", "--threads", "1"}));
        wait_until(5ms, [&] { return folder.names().size() >= 2; });
        for (int i = 0; i < 20; ++i) {
            REQUIRE(::kill(child, signal) == 0);
            std::this_thread::sleep_for(100us);
        }
        const Outcome outcome = folder.finish(child);
        INFO(outcome.err);
        CHECK(outcome.code == 128 + signal);
        CHECK(outcome.error_lines() == 1);
        CHECK(folder.names().empty());
    }
}

TEST_CASE("a second signal, some time after the first, ends a program that hangs", "[cli]") {
    const Folder folder;
    const std::string pipe = folder.file("pipe");
    REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
    // GDAL waits for who writes it, whatever is asked of the program.
    const pid_t child = folder.start({"info", "/vsisubfile/0_100,pipe"});
    const auto catches = [&] {  // the program, no longer the fork of this test, which may catch it too
        const std::string process = "/proc/" + std::to_string(child);
        if (fs::read_symlink(process + "/exe") != fs::canonical(WEDGESCOPE_PROGRAM)) return false;
        std::istringstream status(content(process + "/status"));
        std::string word;
        while (status >> word && word != "SigCgt:") {
        }
        status >> word;
        return ((std::stoull(word, nullptr, 16) >> (SIGTERM - 1)) & 1) != 0;
    };
    wait_until(2ms, catches);
    std::this_thread::sleep_for(500ms);  // until it waits: what it does before that, a request ends
    for (int i = 0; i < 2; ++i) {
        REQUIRE(::kill(child, SIGTERM) == 0);
        std::this_thread::sleep_for(50ms);
    }
    std::this_thread::sleep_for(600ms);
    CHECK(::waitpid(child, nullptr, WNOHANG) == 0);
    REQUIRE(::kill(child, SIGTERM) == 0);
    CHECK(folder.finish(child).code == 1000 + SIGTERM);
}

TEST_CASE("what a killed run leaves is gone after the next one", "[cli]") {
    const Folder folder;
    Strings slow = with(good, {"-o", "scope.png", "--report", "run.json", "--quality", "exact", "--azimuth-bins",
                               "8000", "--range-bin", "10m", "--threads", "1"});
    const pid_t child = folder.start(slow);
    wait_until(5ms, [&] { return folder.names().size() >= 2; });
    REQUIRE(::kill(child, SIGKILL) == 0);
    CHECK(folder.finish(child).code == 1000 + SIGKILL);
    CHECK(folder.names().size() == 2);
    CHECK(folder.run(with(good, {"-o", "scope.png", "--report", "run.json"})).code == 0);
    CHECK(folder.names() == std::set<std::string>{"run.json", "scope.png", "scope.png.aux.xml"});
}

TEST_CASE("a signal while a raster is read from end to end ends the run at once", "[cli][long]") {
    const Folder folder;
    // 7.2 GB of zeros that the disk need not hold: many seconds to read.
    const std::string big = float_raster(folder, "big", 1, 1, {0});
    envi_header(folder, "big", 60000, 60000, 2);
    fs::resize_file(big, std::uintmax_t{2} * 60000 * 60000);
    folder.write("scene.ini", "dem = big.dat\nxy = 510000,3705300\naltitude-msl = 9km\nsource = direct\n");
    const auto before = folder.names();
    const auto reads = [&](pid_t child) {
        std::error_code gone;
        for (const auto& entry : fs::directory_iterator("/proc/" + std::to_string(child) + "/fd", gone))
            if (fs::read_symlink(entry.path(), gone).filename() == "big.dat") return true;
        return false;
    };
    const Strings codes{"info", "big.dat", "--culture-legend", "nlcd"};
    const std::vector<std::pair<Strings, int>> cases{{{"info", "big.dat"}, SIGINT},
                                                     {{"info", "big.dat"}, SIGTERM},
                                                     {{"info", "--json", "big.dat"}, SIGHUP},
                                                     {codes, SIGINT},
                                                     {codes, SIGTERM},
                                                     {{"info", "scene.ini"}, SIGINT},
                                                     {{"info", "--plan", "scene.ini"}, SIGTERM},
                                                     {{"simulate", "scene.ini", "--echo", "echo.tif"}, SIGINT}};
    for (const auto& [arguments, signal] : cases) {
        INFO(arguments[0] << " " << arguments[1] << " ended by " << signal);
        const pid_t child = folder.start(arguments);
        wait_until(2ms, [&] { return reads(child); });
        std::this_thread::sleep_for(100ms);
        const auto sent = std::chrono::steady_clock::now();
        REQUIRE(::kill(child, signal) == 0);
        const Outcome outcome = folder.finish(child);
        CHECK(std::chrono::steady_clock::now() - sent < 2s);
        CHECK(outcome.code == 128 + signal);
        CHECK(outcome.err == "wedgescope: stopped by signal " + std::to_string(signal) + "\n");
        CHECK(outcome.out.empty());
        CHECK(folder.names() == before);
    }
}

TEST_CASE("a raster that changes in any way while it is read ends the run, and no output appears", "[cli][long]") {
    const Folder folder;
    const std::string hills = scanlines(folder, "hills", 4000), raster = content(hills);
    fs::create_directory(folder.work() / "spill");
    const Strings place{"--xy", "510000,3705300", "--altitude-agl", "900m", "--no-cull", "--threads", "1"};
    const Strings spilled{"--source", "spilled", "--temp-dir", "spill", "--memory", "64MiB"};
    const Strings cover = with({"coverage", hills, "seen.tif"}, place);
    const std::vector<Strings> runs{with(cover, {"--source", "direct"}),
                                    with(cover, spilled),
                                    with({"simulate", "--dem", hills, "--echo", "echo.tif", "--range", "60km"},
                                         with(place, {"--source", "direct"})),
                                    {"tile", hills, "store", "--threads", "1", "-q"}};
    struct Change {
        const char* name;
        std::function<void()> make;
    };
    const std::vector<Change> changes{
        {"touched", [&] { fs::last_write_time(hills, fs::file_time_type::clock::now()); }},
        {"written to",
         [&] { std::fstream(hills, std::ios::in | std::ios::out | std::ios::binary).seekp(9000000) << "not this"; }},
        {"replaced", [&] { fs::rename(folder.write("other.dat", raster), hills); }},
        {"removed", [&] { fs::remove(hills); }}};
    // Bytes that the child has read: 16 of the raster's 32 million are more than its libraries and headers make, and what says
    // where the sensor stands.
    const auto has_read = [](pid_t child) {
        std::istringstream io(content("/proc/" + std::to_string(child) + "/io"));
        std::string word;
        std::uint64_t bytes = 0;
        while (io >> word)
            if (word == "rchar:") io >> bytes;
        return bytes;
    };
    for (const Strings& arguments : runs)
        for (const Change& change : changes) {
            INFO(arguments[0] << ", " << change.name);
            folder.write("hills.dat", raster);
            std::this_thread::sleep_for(std::chrono::milliseconds(20));  // a tick of the file system's clock
            const auto before = folder.names();
            const pid_t child = folder.start(arguments);
            wait_until(500us, [&] { return has_read(child) >= 16'000'000; });
            REQUIRE(::kill(child, SIGSTOP) == 0);
            change.make();
            REQUIRE(::kill(child, SIGCONT) == 0);
            const Outcome outcome = folder.finish(child);
            INFO(outcome.err);
            CHECK(outcome.code == 1);
            CHECK(outcome.error_lines() == 1);
            CHECK_THAT(outcome.err, Contains("hills.dat"));
            auto after = folder.names();
            after.insert("hills.dat");
            CHECK(after == before);
            CHECK(fs::is_empty(folder.work() / "spill"));
        }
}

TEST_CASE("a signal during the pass or the wedges of a spilled run leaves nothing in temp-dir", "[cli][threads]") {
    const Folder folder;
    fs::create_directory(folder.work() / "spill");
    const std::string hills = scanlines(folder, "hills", 3000);
    const auto before = folder.names();
    for (const int wait_ms : {0, 20, 60, 120, 250}) {
        const pid_t child =
            folder.start({"simulate",       "--dem",      hills,      "--xy",           "510000,3705300",
                          "--altitude-msl", "9km",        "--range",  "60km",           "--quality",
                          "exact",          "--threads",  "1",        "--azimuth-bins", "720",
                          "--range-bin",    "50m",        "--memory", "40MiB",          "--source",
                          "spilled",        "--temp-dir", "spill",    "--echo",         "echo.tif",
                          "--no-cull"});
        wait_until(5ms, [&] { return folder.names() != before; });
        std::this_thread::sleep_for(std::chrono::milliseconds(wait_ms));
        REQUIRE(::kill(child, SIGTERM) == 0);
        const Outcome outcome = folder.finish(child);
        INFO(wait_ms << " ms: " << outcome.err);
        CHECK(outcome.code == 143);
        CHECK_THAT(outcome.err, Contains("stopped by signal 15"));
        CHECK(fs::is_empty(folder.work() / "spill"));
        CHECK(folder.names() == before);
    }
}

TEST_CASE("a stopped tile keeps its finished sheets and says how to go on", "[cli][long]") {
    const Folder folder;
    const std::string hills = scanlines(folder, "hills", 5000);  // four sheets
    const pid_t child = folder.start({"tile", hills, "store", "--threads", "1"});
    wait_until(
        2ms, [&] { return fs::exists(folder.work() / "store.part/dem/c0_r0.sum"); }, 40s);
    REQUIRE(::kill(child, SIGINT) == 0);
    const Outcome stopped = folder.finish(child);
    INFO(stopped.err);
    REQUIRE(stopped.code == 130);
    CHECK_THAT(stopped.err,
               Contains("stopped by signal 2; finished sheets are kept in 'store.part' (--resume goes on)"));
    const Outcome resumed = folder.run({"tile", hills, "store", "--threads", "1", "--resume"});
    INFO(resumed.err);
    CHECK(resumed.code == 0);
    CHECK_THAT(resumed.err, Contains(" stood already") && !Contains("resumed: 0 sheets"));
    CHECK(folder.names().count("store") == 1);
    CHECK(folder.names().count("store.part") == 0);
}
