// The profile: what a run says of its threads, waits and memory, against what a drawn source made it wait for.
#include <catch2/catch.hpp>

#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <thread>

#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "lib/plan.hpp"
#include "lib/stage_clock.hpp"
#include "lib/stopwatch.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/json.hpp"
#include "tests/refusal.hpp"
#include "tests/small_disk.hpp"
#include "tests/terrain.hpp"
#include "tools/timeline.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;
using nlohmann::json;
using wedgescope::test::Folder;
using wedgescope::test::json_in;
using wedgescope::test::SmallDisk;

namespace {

/// A disk that takes its time.
class SlowSource : public test::MemorySource {
public:
    using MemorySource::MemorySource;
    using WedgeSource::load;
    Chunk load(const ChunkRequest& request) override {
        std::this_thread::sleep_for(std::chrono::milliseconds(pause_ms));
        return MemorySource::load(request);
    }
    int pause_ms = 0;
};

SlowSource hills() {
    const auto rolling = test::rolling(300, 90, 5);
    return SlowSource(201, 201, 30, [rolling](double c, double r) { return 300 + rolling(c, r); });
}

Scene small_scene() {
    Scene s;
    s.platform.xy = PointXY{3000.3, -2900.7};
    s.platform.altitude_m = 900;
    s.range_m = 2700;
    s.azimuth_bins = 360;
    s.range_bin_m = 20;
    s.radar.antenna.beam = Angle::degrees(4);
    s.display.size = 64;
    return s;
}

struct Event {
    std::string name;
    double from_us, to_us;
    std::int64_t wedge;
};

struct Told {
    std::map<int, std::vector<Event>> spans;  ///< by thread
    std::set<int> named;
    std::vector<double> held, held_us, resident;
};

Told read(const std::string& path) {
    const json all = json_in(path);
    Told told;
    for (const json& e : all.at("traceEvents")) {
        CHECK(e.at("pid") == ::getpid());
        const std::string kind = e.at("ph");
        if (kind == "M") {
            if (e.at("name") == "thread_name") {
                CHECK(told.named.insert(e.at("tid").get<int>()).second);
                CHECK_FALSE(e.at("args").at("name").get<std::string>().empty());
            }
        } else if (kind == "C") {
            const auto& args = e.at("args");
            CHECK(e.at("ts").get<double>() >= 0);
            if (e.at("name") == "memory") {
                told.held.push_back(args.at("budget held"));
                told.held_us.push_back(e.at("ts"));
            }
            if (e.at("name") == "resident") told.resident.push_back(args.at("bytes"));
        } else {
            REQUIRE(kind == "X");
            CHECK(e.at("cat").is_string());
            const double ts = e.at("ts"), duration = e.at("dur");
            CHECK(ts >= 0);
            CHECK(duration >= 0);
            const auto& args = e.at("args");
            told.spans[e.at("tid").get<int>()].push_back(
                {e.at("name"), ts, ts + duration, args.contains("wedge") ? args["wedge"].get<std::int64_t>() : -1});
        }
    }
    return told;
}

RunResult simulate(WedgeSource& source, Timeline* timeline, std::size_t memory_bytes = std::size_t{1} << 30,
                   std::int64_t wedges = 6, bool noise = false) {
    Scene scene = small_scene();
    scene.receiver.noise = noise;
    EngineParams params;
    params.threads = 2;
    params.wedges = wedges;
    params.memory_bytes = memory_bytes;
    params.timeline = timeline;
    return run(resolve(scene, source), source, params);
}

}  // namespace

TEST_CASE("one turn in seven says how all of them share the time, though the first of each chunk is dear",
          "[profile]") {
    const auto spin = [](std::uint64_t count) {
        for (const std::uint64_t from = ticks(); ticks() - from < count;) {
        }
    };
    // Ten turns a chunk; the sweep takes 30 of the first and nothing of the others, deposits take 5 of each.
    const auto share_of_sweep = [&] {
        StageClock clock;
        for (int chunk = 0; chunk < 140; ++chunk)
            for (int turn = 0; turn < 10; ++turn) {
                clock.next_turn();
                clock.enter(StageClock::sweep);
                if (turn == 0) spin(30000);
                clock.enter(StageClock::deposit);
                spin(5000);
                clock.leave_out(0);
            }
        const auto sweep = static_cast<double>(clock.spent(StageClock::sweep)),
                   deposit = static_cast<double>(clock.spent(StageClock::deposit));
        return sweep / (sweep + deposit);
    };
    // Whoever else has the processor may take some of it now and then.
    double nearest = 2;
    for (int time = 0; time < 20 && std::abs(nearest - 0.375) > 0.06; ++time) {
        const double share = share_of_sweep();
        if (std::abs(share - 0.375) < std::abs(nearest - 0.375)) nearest = share;
    }
    CHECK(nearest == Approx(0.375).margin(0.06));
}

TEST_CASE("a timeline's spans nest on each thread and last as long as the report says", "[timeline]") {
    const Folder folder;
    OutputFile file(folder / "run.json", false);
    SlowSource source = hills();
    source.pause_ms = 3;
    RunResult result;
    {
        TimelineFile timeline(file);
        {
            const Span whole(&timeline, "whole", "stage");
            result = simulate(source, &timeline, std::size_t{1} << 30, 6, true);  // noise is drawn by the receiver
        }
        timeline.finish();
        const Span late(&timeline, "late", "stage");  // left out
    }
    file.commit();
    const Told told = read(folder / "run.json");
    std::set<std::string> names;
    std::map<std::int64_t, double> load_us;
    std::map<std::int64_t, int> merges;
    for (const auto& [thread, spans] : told.spans) {
        INFO("thread " << thread);
        CHECK(told.named.contains(thread));
        std::vector<Event> sorted = spans;
        std::sort(sorted.begin(), sorted.end(), [](const Event& a, const Event& b) {
            return a.from_us != b.from_us ? a.from_us < b.from_us : a.to_us > b.to_us;
        });
        std::vector<Event> open;
        for (const Event& e : sorted) {
            names.insert(e.name);
            constexpr double digits_us = 1e-3;  // ends are sums of two numbers of three digits
            while (!open.empty() && open.back().to_us <= e.from_us + digits_us) open.pop_back();
            if (!open.empty()) CHECK(e.to_us <= open.back().to_us + digits_us);
            open.push_back(e);
            if (e.name == "load") load_us[e.wedge] += e.to_us - e.from_us;
            if (e.name == "merge") ++merges[e.wedge];
        }
    }
    for (const char* name :
         {"whole", "survey", "wedges", "enter", "load", "sweep", "merge", "beam", "receiver", "display"})
        CHECK(names.contains(name));
    CHECK_FALSE(names.contains("late"));
    REQUIRE(result.report.wedges.size() == 6);
    for (const WedgeReport& w : result.report.wedges) {
        CHECK(merges[w.index] == 1);
        // The span holds the two; what it is longer, a busy machine may have kept the thread waiting between two clocks.
        const double said_s = w.load_s + w.disk_wait_s;
        CHECK(load_us[w.index] * 1e-6 >= said_s - 1e-6);
        CHECK(load_us[w.index] * 1e-6 <= 1.05 * said_s + 0.02 * static_cast<double>(w.chunks));
    }
    REQUIRE_FALSE(told.held.empty());
    REQUIRE(told.resident.size() == told.held.size());
    const auto budget = static_cast<double>(std::size_t{1} << 30);
    CHECK(*std::max_element(told.held.begin(), told.held.end()) > 0);
    CHECK(*std::max_element(told.held.begin(), told.held.end()) <= budget);
    CHECK(*std::min_element(told.resident.begin(), told.resident.end()) > 1 << 20);
}

TEST_CASE("a stage that tells nothing has its counters, and what was told last holds", "[timeline]") {
    const Folder folder;
    OutputFile file(folder / "run.json", false);
    TimelineFile timeline(file);
    timeline.memory(5);
    timeline.memory(7 << 20);  // too soon for a counter of its own
    {
        const Span silent(&timeline, "silent", "stage");
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
    }
    timeline.finish();
    file.commit();
    const Told told = read(folder / "run.json");
    REQUIRE(told.spans.size() == 1);
    const Event silent = told.spans.begin()->second.at(0);
    std::size_t inside = 0;
    for (std::size_t i = 0; i < told.held.size(); ++i)
        inside += told.held_us[i] >= silent.from_us && told.held_us[i] <= silent.to_us && told.held[i] == 7 << 20;
    CHECK(inside >= 5);
    CHECK(inside <= 20);  // one each 25 ms
    CHECK(told.resident.size() == told.held.size());
    CHECK(told.held.back() == 7 << 20);
}

TEST_CASE("listening changes no bit", "[timeline]") {
    const Folder folder;
    OutputFile file(folder / "run.json", false);
    SlowSource source = hills();
    TimelineFile timeline(file);
    const RunResult a = simulate(source, &timeline), b = simulate(source, nullptr);
    CHECK(a.echo_w.cells == b.echo_w.cells);
    CHECK(a.scope.grey == b.scope.grey);
}

TEST_CASE("a wedge waits for a slow disk as long as the disk is slow", "[timeline]") {
    SlowSource source = hills();
    double load_s = 0;  // CPU; under a sanitizer as long as the pauses below
    for (const WedgeReport& w : simulate(source, nullptr).report.wedges) {
        CHECK(w.memory_wait_s == 0);
        CHECK(w.merge_s > 0);
        CHECK(w.chunks > 0);
        load_s += w.load_s;
    }
    source.pause_ms = 40;
    double slow_load_s = 0, all_slept_s = 0;
    for (const WedgeReport& w : simulate(source, nullptr).report.wedges) {
        const double slept_s = 0.04 * static_cast<double>(w.chunks);
        CHECK(w.disk_wait_s >= slept_s);
        CHECK(w.wall_s >= slept_s);
        slow_load_s += w.load_s;
        all_slept_s += slept_s;
    }
    CHECK(slow_load_s - load_s < 0.5 * all_slept_s);
}

TEST_CASE("where memory lets in one wedge for two threads, the others wait for the one", "[timeline]") {
    SlowSource source = hills();
    source.pause_ms = 4;
    // The least budget that does, by halving (words round it up to MiB), lets in one wedge at a time.
    const ResolvedScene scene = resolve(small_scene(), source);
    std::size_t too_little = 1 << 10, enough = std::size_t{1} << 30;
    while (enough - too_little > 1 << 10) {
        EngineParams params;
        params.threads = 2;
        params.wedges = 180;
        params.memory_bytes = too_little + (enough - too_little) / 2;
        try {
            plan(scene, source, params);
            enough = params.memory_bytes;
        } catch (const InputError&) {
            too_little = params.memory_bytes;
        }
    }
    const Stopwatch watch;
    const RunResult tight = simulate(source, nullptr, enough, 180);
    const double elapsed_s = watch.wall_s();
    double waited_s = 0, walls_s = 0;
    for (const WedgeReport& w : tight.report.wedges) {
        waited_s += w.memory_wait_s;
        walls_s += w.wall_s;
    }
    // One after the other: each but the first waits at least while the one before is in, as a second thread stands idle.
    CHECK(waited_s >= walls_s - tight.report.wedges.back().wall_s);
    CHECK(waited_s > 0.5 * walls_s);
    CHECK(waited_s <= 2 * elapsed_s);
}

TEST_CASE("threads tell one timeline at once", "[timeline]") {
    const Folder folder;
    OutputFile file(folder / "run.json", false);
    TimelineFile timeline(file);
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
            for (int i = 0; i < 1000; ++i) {
                Span outer(&timeline, "outer", "test", t);
                outer.add_bytes(static_cast<std::uint64_t>(i));
                const Span inner(&timeline, "inner", "test");
                timeline.memory(static_cast<std::size_t>(i + 1));
            }
        });
    for (auto& thread : threads) thread.join();
    timeline.finish();
    file.commit();
    const Told told = read(folder / "run.json");
    CHECK(told.spans.size() == 4);
    CHECK(told.named.size() == 4);
    for (const auto& [thread, spans] : told.spans) CHECK(spans.size() == 2000);
    CHECK_FALSE(told.held.empty());
}

TEST_CASE("a timeline on a full disk is an error that names it", "[timeline]") {
    const Folder folder;
    {
        OutputFile file(folder / "run.json", false);
        TimelineFile timeline(file);
        const SmallDisk disk(1000);
        for (int i = 0; i < 3000; ++i) const Span span(&timeline, "work", "test", i);
        CHECK_THROWS_WITH(timeline.finish(), Contains("run.json") && Contains("File too large"));
    }
    CHECK(folder.names().empty());
}
