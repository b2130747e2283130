// The work folder: killed, resumed, shared, edited and damaged runs end in the bytes of a straight one.
#include <catch2/catch.hpp>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <random>
#include <set>
#include <thread>

#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/file_content.hpp"
#include "tests/json.hpp"
#include "tests/small_disk.hpp"
#include "tests/terrain.hpp"
#include "tiles/checksum.hpp"
#include "tiles/work_dir.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;
using wedgescope::test::Folder;
using wedgescope::test::MemorySource;
using wedgescope::test::SmallDisk;
using Start = WorkDir::Start;
namespace fs = std::filesystem;

namespace {

using wedgescope::test::content;
using wedgescope::test::json_in;

void put(const std::string& path, const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; }

std::set<std::string> names(const std::string& folder) {
    std::set<std::string> all;
    for (const auto& entry : fs::directory_iterator(folder)) all.insert(entry.path().filename().string());
    return all;
}

bool any_temporary(const std::string& folder) {
    const auto all = names(folder);
    return std::any_of(all.begin(), all.end(), [](const std::string& name) { return name.starts_with("."); });
}

std::size_t wedge_files(const std::string& folder) {
    if (!fs::exists(folder)) return 0;
    const auto all = names(folder);
    return static_cast<std::size_t>(
        std::count_if(all.begin(), all.end(), [](const std::string& name) { return name.starts_with("wedge_"); }));
}

/// A store in miniature: it knows what any rectangle of posts holds.
class CheckedSource : public MemorySource {
public:
    using MemorySource::MemorySource;
    std::uint64_t fingerprint(const std::vector<Window>& posts) override {
        Checksum sum;
        for (const Window& window : posts) {
            const Chunk chunk = load(window, false);
            sum.add(chunk.surface_m.data(), chunk.surface_m.size() * sizeof(float));
        }
        return sum.value();
    }
};

Scene small_scene() {
    Scene s;
    s.platform.xy = PointXY{3000.3, -2900.7};
    s.platform.altitude_m = 900;
    s.range_m = 4000;
    s.azimuth_bins = 90;
    s.range_bin_m = 40;
    s.radar.antenna.beam = Angle::degrees(8);
    s.display.size = 64;
    return s;
}

double hills(double c, double r) {
    static const auto rolling = test::rolling(300, 90, 5);
    return 300 + rolling(c, r);
}

WorkDir::Run work_run(const ResolvedScene& scene, const WedgeSource& source) {
    return {"test", {{"range", text(*scene.scene.range_m)}}, echo_facts(scene, source.data_base())};
}

RunResult simulate(const Scene& scene, WedgeSource& source, WedgeArchive* archive, std::int64_t wedges = 9,
                   std::optional<Interval> only = {}, int threads = 2) {
    EngineParams params;
    params.threads = threads;
    params.wedges = wedges;
    params.archive = archive;
    params.only_wedges = only;
    return run(resolve(scene, source), source, params);
}

RunResult simulate_in(const std::string& folder, Start start, const Scene& scene, WedgeSource& source,
                      std::vector<std::string>* remarks = nullptr, std::optional<Interval> only = {}) {
    WorkDir work(folder, start);
    work.bind(work_run(resolve(scene, source), source));
    RunResult result = simulate(scene, source, &work, 9, only);
    if (remarks) *remarks = work.remarks();
    return result;
}

std::set<std::int64_t> reused(const RunResult& r) {
    std::set<std::int64_t> all;
    for (const WedgeReport& w : r.report.wedges)
        if (w.reused) all.insert(w.index);
    return all;
}

bool same(const RunResult& a, const RunResult& b) {
    return a.echo_w.cells == b.echo_w.cells && a.echo_state.cells == b.echo_state.cells &&
           a.power_w.cells == b.power_w.cells && a.state.cells == b.state.cells && a.scope.grey == b.scope.grey;
}

/// A drawn wedge of 3 x 5 cells.
struct Drawn {
    WedgeKey key{2, {6, 9}, {0, 5}, 77};
    WedgeOutcome outcome;
    std::vector<float> echo = std::vector<float>(15);
    std::vector<std::uint8_t> state = std::vector<std::uint8_t>(15);
    explicit Drawn(std::int64_t index = 2) {
        key.index = index;
        key.azimuth_bins = {3 * index, 3 * index + 3};
        for (std::size_t i = 0; i < echo.size(); ++i) {
            echo[i] = 1e-12F * static_cast<float>(index * 100) + static_cast<float>(i);
            state[i] = static_cast<std::uint8_t>(i % 5);
        }
        outcome.unknown_code = -7;
        outcome.report.sweep_s = 0.125;
        outcome.report.posts_read = 1234;
        outcome.report.posts_skipped[2] = 55;
    }
};
const std::vector<Interval> drawn_split = {{0, 3}, {3, 6}, {6, 9}, {9, 12}};
const WorkDir::Run drawn_run{"1", {{"range", "5km"}}, {{"range", "5000"}, {"beam", "1"}}};

// ---- the program ----

const std::string data = WEDGESCOPE_DATA;
using Strings = std::vector<std::string>;

struct Outcome {
    int code = 0;
    std::string err;
};

class Program {
public:
    explicit Program(const Folder& folder) : folder_(folder / "") {}
    pid_t start(const Strings& arguments, rlim_t most_file_bytes = 0) {
        const std::string err = talk_ / std::to_string(++count_);
        std::string program = WEDGESCOPE_PROGRAM;
        Strings copy = arguments;
        std::vector<char*> list{program.data()};
        for (auto& argument : copy) list.push_back(argument.data());
        list.push_back(nullptr);
        const pid_t child = ::fork();
        if (child == 0) {
            const int file = ::open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
            if (file < 0 || ::dup2(file, 1) < 0 || ::dup2(file, 2) < 0 || ::chdir(folder_.c_str()) != 0) ::_exit(99);
            if (most_file_bytes) {
                const rlimit small{most_file_bytes, most_file_bytes};
                ::setrlimit(RLIMIT_FSIZE, &small);
            }
            ::execv(program.c_str(), list.data());
            ::_exit(98);
        }
        errors_[child] = err;
        return child;
    }
    Outcome finish(pid_t child) {
        int status = 0;
        ::waitpid(child, &status, 0);
        Outcome outcome{WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status), content(errors_[child])};
        return outcome;
    }
    Outcome run(const Strings& arguments, rlim_t most_file_bytes = 0) {
        return finish(start(arguments, most_file_bytes));
    }

private:
    std::string folder_;
    Folder talk_;
    int count_ = 0;
    std::map<pid_t, std::string> errors_;
};

Strings operator+(Strings a, const Strings& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

/// 12 wedges of some 0.05 s each.
Strings scene_over(const std::string& dem) {
    return {"simulate",
            "--dem",
            dem,
            "--latlon",
            "33.93,-117.33",
            "--altitude-msl",
            "7000ft",
            "--range",
            "14km",
            "--size",
            "200",
            "--wedges",
            "12",
            "--quality",
            "exact",
            "--range-bin",
            "60m",
            "--azimuth-bins",
            "480",
            "--beam",
            "4deg",
            "--threads",
            "2",
            "--reproducible",
            "--overwrite"};
}
const Strings outputs = {"-o", "scope.png", "--echo", "echo.tif", "--states", "states.tif", "--report", "report.json"};
constexpr std::size_t wedges = 12;

struct Images {
    std::string scope, echo, states;
    explicit Images(const Folder& folder)
        : scope(content(folder / "scope.png")), echo(content(folder / "echo.tif")),
          states(content(folder / "states.tif")) {}
    friend bool operator==(const Images&, const Images&) = default;
};

nlohmann::json report(const Folder& folder) { return json_in(folder / "report.json"); }

}  // namespace

TEST_CASE("keeping wedges changes no bit, and a second run uses all of them", "[resume][threads]") {
    const Folder folder;
    const std::string work = folder / "work";
    MemorySource source(201, 201, 30, hills);
    const RunResult straight = simulate(small_scene(), source, nullptr);
    const RunResult kept = simulate_in(work, Start::fresh, small_scene(), source);
    CHECK(same(straight, kept));
    CHECK(reused(kept).empty());
    CHECK(wedge_files(work) == 9);
    CHECK_FALSE(any_temporary(work));
    const RunResult again = simulate_in(work, Start::join, small_scene(), source);
    CHECK(same(straight, again));
    CHECK(reused(again).size() == 9);
    for (std::size_t i = 0; i < 9; ++i) {
        CHECK(again.report.wedges[i].posts_read == kept.report.wedges[i].posts_read);
        CHECK(again.report.wedges[i].sweep_s == kept.report.wedges[i].sweep_s);
        CHECK(again.report.wedges[i].wall_s == kept.report.wedges[i].wall_s);
    }
    // Other receivers and tubes go on with the same echo.
    Scene brighter = small_scene();
    brighter.receiver.if_gain = Decibel(60);
    brighter.display.size = 100;
    brighter.receiver.noise = true;
    const RunResult bright = simulate_in(work, Start::join, brighter, source);
    CHECK(reused(bright).size() == 9);
    CHECK(same(bright, simulate(brighter, source, nullptr)));
}

TEST_CASE("an edited post is swept again by the wedges that it may reach, and by no other", "[resume]") {
    const Folder folder;
    const std::string work = folder / "work";
    CheckedSource before(201, 201, 30, hills);
    simulate_in(work, Start::fresh, small_scene(), before);
    // A tower 1800 m due east of the sensor: azimuth 90 degrees is bin 22 of 90, in wedge 2 of 9.
    CheckedSource after(201, 201, 30, [](double c, double r) { return hills(c, r) + (c == 160 && r == 97 ? 400 : 0); });
    std::vector<std::string> remarks;
    const RunResult edited = simulate_in(work, Start::join, small_scene(), after, &remarks);
    CHECK(same(edited, simulate(small_scene(), after, nullptr)));
    const auto kept = reused(edited);
    CHECK_FALSE(kept.contains(2));
    CHECK(kept.size() >= 6);
    REQUIRE(remarks.size() == 1);
    CHECK_THAT(remarks[0], Contains("the data base changed") && Contains("2"));
    // And they are kept in turn.
    CHECK(reused(simulate_in(work, Start::join, small_scene(), after)).size() == 9);
}

TEST_CASE("where another height under the sensor changes the scene itself, all is swept again", "[resume]") {
    const Folder folder;
    CheckedSource before(201, 201, 30, hills);
    CheckedSource after(201, 201, 30, [](double c, double r) { return hills(c, r) + (c == 100 && r == 97 ? 5 : 0); });
    simulate_in(folder / "work", Start::fresh, small_scene(), before);
    std::vector<std::string> remarks;
    const RunResult edited = simulate_in(folder / "work", Start::join, small_scene(), after, &remarks);
    CHECK(reused(edited).empty());
    CHECK(same(edited, simulate(small_scene(), after, nullptr)));
    REQUIRE(remarks.size() == 1);
    CHECK_THAT(remarks[0], Contains("ground below") && Contains("all wedges"));
}

TEST_CASE("whatever changes an echo is among the facts that the folder compares", "[resume]") {
    MemorySource source(101, 101, 60, hills);
    Scene base = small_scene();
    base.sector = Sector{Angle::degrees(20), Angle::degrees(80)};
    base.radar.antenna.knee = Angle::degrees(20);  // ground on either side of it
    const RunResult first = simulate(base, source, nullptr, 3);
    const auto facts = [&](const Scene& s) { return echo_facts(resolve(s, source), source.data_base()); };
    using Change = std::function<void(Scene&)>;
    const std::vector<Change> before_echo = {
        [](Scene& s) { s.platform.xy->x += 1; },
        [](Scene& s) { s.platform.altitude_m += 1; },
        [](Scene& s) { s.earth_k.reset(); },
        [](Scene& s) { s.sector->from = Angle::degrees(10); },
        [](Scene& s) { s.platform.heading = Angle::degrees(10); },
        [](Scene& s) { s.range_m = 3900; },
        [](Scene& s) { s.azimuth_bins = 100; },
        [](Scene& s) { s.range_bin_m = 41; },
        [](Scene& s) { s.radar.frequency_hz = 1e10; },
        [](Scene& s) { s.radar.transmit_power_w *= 2; },
        [](Scene& s) { s.radar.gain = Decibel(35); },
        [](Scene& s) { s.radar.losses = Decibel(7); },
        [](Scene& s) { s.radar.antenna.elevation = ElevationPattern::gaussian; },
        [](Scene& s) { s.radar.antenna.elevation = ElevationPattern::cos_csc2; },
        [](Scene& s) {
            s.radar.antenna.elevation = ElevationPattern::points;
            s.radar.antenna.points = {{Angle::degrees(-20), Decibel(-9)}, {Angle::degrees(80), Decibel(-1)}};
        },
        [](Scene& s) {
            s.radar.antenna.elevation = ElevationPattern::points;
            s.radar.antenna.points = {{Angle::degrees(-20), Decibel(-9)}, {Angle::degrees(80), Decibel(-2)}};
        },
        [](Scene& s) { s.radar.antenna.knee = Angle::degrees(19); },
        [](Scene& s) { s.radar.antenna.width = Angle::degrees(10); },
        [](Scene& s) { s.radar.antenna.floor = Decibel(-3); },
        [](Scene& s) { s.radar.antenna.tilt = Angle::degrees(2); },
        [](Scene& s) { s.gamma = Decibel(-15); },
        [](Scene& s) { s.spokes_per_post = 16; },
        [](Scene& s) { s.spokes_per_bin = 128; },
        [](Scene& s) { s.crossings = false; },
        [](Scene& s) { s.curved_course = false; },
        [](Scene& s) { s.display.kind = DisplayKind::gpi_true; },
        [](Scene& s) { s.radar.antenna.beam = Angle::degrees(12); },  // a wider skirt
        [](Scene& s) { s.radar.beam_width_error = false; },           // none
    };
    for (std::size_t i = 0; i < before_echo.size(); ++i) {
        INFO("change " << i);
        Scene s = base;
        before_echo[i](s);
        const RunResult r = simulate(s, source, nullptr, 3);
        REQUIRE((r.echo_w.grid != first.echo_w.grid || r.echo_w.cells != first.echo_w.cells));
        CHECK(facts(s) != facts(base));
    }
    Scene draft = base, exact = base;  // from so high that the qualities sample differently
    draft.platform.altitude_m = exact.platform.altitude_m = 3000;
    draft.quality = Quality::draft;
    exact.quality = Quality::exact;
    REQUIRE(simulate(draft, source, nullptr, 3).echo_w.cells != simulate(exact, source, nullptr, 3).echo_w.cells);
    CHECK(facts(draft) != facts(exact));
    Scene dense = base, ahead = base;  // where spokes double within range at all
    dense.spokes_per_post = ahead.spokes_per_post = 16;
    dense.spoke_lead = 1;
    ahead.spoke_lead = 16;
    REQUIRE(simulate(dense, source, nullptr, 3).echo_w.cells != simulate(ahead, source, nullptr, 3).echo_w.cells);
    CHECK(facts(dense) != facts(ahead));
    const std::vector<Change> after_echo = {
        [](Scene& s) { s.receiver.if_gain = Decibel(60); },
        [](Scene& s) { s.receiver.noise = true; },
        [](Scene& s) { s.receiver.speckle_looks = 3; },
        [](Scene& s) { s.radar.noise_figure = Decibel(3); },
        [](Scene& s) { s.radar.antenna.azimuth = AzimuthPattern::gaussian; },
        [](Scene& s) { s.display.kind = DisplayKind::ppi; },
        [](Scene& s) { s.display.size = 80; },
        [](Scene& s) { s.display.orientation = Orientation::heading; },
        [](Scene& s) { s.radar.antenna.exponent = 0.7; },  // of cos-csc2 only
    };
    for (std::size_t i = 0; i < after_echo.size(); ++i) {
        INFO("change " << i);
        Scene s = base;
        after_echo[i](s);
        CHECK(simulate(s, source, nullptr, 3).echo_w.cells == first.echo_w.cells);
        CHECK(facts(s) == facts(base));
    }
    // The data base's own: a material, culture.
    MemorySource woods(101, 101, 60, hills);
    woods.editable().default_class = 8;
    CHECK(echo_facts(resolve(base, woods), woods.data_base()) != facts(base));
    CHECK(simulate(base, woods, nullptr, 3).echo_w.cells != first.echo_w.cells);
}

TEST_CASE("some wedges alone fill the folder, and resume makes the picture", "[resume]") {
    const Folder folder;
    const std::string work = folder / "work";
    MemorySource source(201, 201, 30, hills);
    const RunResult part = simulate_in(work, Start::join, small_scene(), source, nullptr, Interval{2, 5});
    CHECK(part.report.wedges.size() == 3);
    CHECK(part.power_w.cells.empty());
    CHECK(names(work) == std::set<std::string>{"run.json", "wedge_000002.bin", "wedge_000003.bin", "wedge_000004.bin"});
    // What is there is not done twice, and the split stands whatever is asked now.
    CHECK(reused(simulate_in(work, Start::join, small_scene(), source, nullptr, Interval{4, 6})) ==
          std::set<std::int64_t>{4});
    WorkDir other(work, Start::join);
    other.bind(work_run(resolve(small_scene(), source), source));
    const RunResult whole = simulate(small_scene(), source, &other, 30);
    CHECK(whole.report.wedges.size() == 9);
    CHECK(reused(whole) == std::set<std::int64_t>{2, 3, 4, 5});
    CHECK(same(whole, simulate(small_scene(), source, nullptr)));
    CHECK_THROWS_WITH(simulate(small_scene(), source, &other, 0, Interval{7, 10}),
                      Contains("only-wedge is 7-9") && Contains("0 to 8"));
}

TEST_CASE("a data base that changes under the run is no picture", "[resume]") {
    class Shifting : public MemorySource {
    public:
        using MemorySource::MemorySource;
        std::uint64_t fingerprint(const std::vector<Window>&) override { return loads_ > 6 ? 2 : 1; }
        using WedgeSource::load;
        Chunk load(const ChunkRequest& request) override {
            ++loads_;
            return MemorySource::load(request);
        }
        std::atomic<int> loads_{0};
    };
    Shifting source(201, 201, 30, hills);
    CHECK_THROWS_WITH(simulate(small_scene(), source, nullptr), Contains("drawn") && Contains("changed while"));
}

TEST_CASE("no wedge is kept of a data base that changes under the run, though its reader goes on with the old one",
          "[resume]") {
    // As where a file is put in another one's place: who opened it goes on reading what it was, its name leads to what it is.
    class Replaced : public MemorySource {
    public:
        explicit Replaced(int loads) : MemorySource(201, 201, 30, hills), loads_(loads) {}
        std::uint64_t fingerprint(const std::vector<Window>&) override { return loads_ > 0 ? 1 : 2; }
        using WedgeSource::load;
        Chunk load(const ChunkRequest& request) override {
            --loads_;
            return MemorySource::load(request);
        }
        int loads_left() const { return loads_; }

    private:
        std::atomic<int> loads_;
    };
    class Now : public MemorySource {
    public:
        using MemorySource::MemorySource;
        std::uint64_t fingerprint(const std::vector<Window>&) override { return 2; }
    };
    Now now(201, 201, 30, [](double c, double r) { return 0.5 * hills(c, r); });
    Scene scene = small_scene();
    scene.platform.altitude_m = 1200;
    const RunResult truth = simulate(scene, now, nullptr);
    std::size_t kept = 0;
    Replaced unchanged(1 << 20);
    resolve(scene, unchanged);
    const int to_resolve = (1 << 20) - unchanged.loads_left();
    simulate(scene, unchanged, nullptr);
    const int in_all = (1 << 20) - unchanged.loads_left();
    for (int loads = 2 * to_resolve + 1; loads <= in_all; ++loads) {
        const Folder folder;
        const std::string work = folder / "work";
        Replaced source(loads);
        CHECK_THROWS_WITH(simulate_in(work, Start::join, scene, source), Contains("changed while"));
        kept += wedge_files(work);
        WorkDir other(work, Start::join);
        other.bind(work_run(resolve(scene, now), now));
        const RunResult whole = simulate(scene, now, &other);
        CHECK(reused(whole).empty());
        CHECK(same(whole, truth));
    }
    CHECK(kept > 0);  // those that were through before
}

TEST_CASE("a wedge comes back as it was kept, from its own scene and data only", "[resume]") {
    const Folder folder;
    const std::string path = folder / "work";
    const Drawn wedge;
    Drawn other;
    {
        WorkDir work(path, Start::fresh);
        work.bind(drawn_run);
        CHECK(work.recorded_split().empty());
        CHECK(work.record_split(drawn_split) == drawn_split);
        CHECK_FALSE(work.find(wedge.key, other.echo, other.state));
        work.keep(wedge.key, wedge.outcome, wedge.echo, wedge.state);
        CHECK(work.kept() == 1);
        CHECK(work.remarks().empty());
    }
    WorkDir work(path, Start::join);
    work.bind(drawn_run);
    CHECK(work.recorded_split() == drawn_split);
    CHECK(work.record_split({{0, 12}}) == drawn_split);
    std::fill(other.echo.begin(), other.echo.end(), 0.0F);
    std::fill(other.state.begin(), other.state.end(), std::uint8_t{9});
    const auto found = work.find(wedge.key, other.echo, other.state);
    REQUIRE(found);
    CHECK(found->unknown_code == -7);
    CHECK(found->report.sweep_s == 0.125);
    CHECK(found->report.posts_read == 1234);
    CHECK(found->report.posts_skipped[2] == 55);
    CHECK(other.echo == wedge.echo);
    CHECK(other.state == wedge.state);
    WedgeKey key = wedge.key;
    key.data = 78;
    CHECK_FALSE(work.find(key, other.echo, other.state));
    REQUIRE(work.remarks().size() == 1);
    CHECK_THAT(work.remarks()[0], Contains("data base changed"));
    key = wedge.key;
    key.azimuth_bins = {6, 8};
    CHECK_FALSE(work.find(key, std::span(other.echo).first(10), std::span(other.state).first(10)));
    REQUIRE(work.remarks().size() == 2);
    CHECK_THAT(work.remarks()[1], Contains(path) && Contains("hold other wedges") && Contains("done again: wedge 2"));
}

TEST_CASE("damage of any byte of a wedge file is named, and the wedge not used", "[resume]") {
    const Folder folder;
    const std::string path = folder / "work", file = path + "/wedge_000002.bin";
    const Drawn wedge;
    Drawn out;
    {
        WorkDir work(path, Start::fresh);
        work.bind(drawn_run);
        work.record_split(drawn_split);
        work.keep(wedge.key, wedge.outcome, wedge.echo, wedge.state);
    }
    const std::string whole = content(file);
    const auto refused = [&](const std::string& bytes) {
        put(file, bytes);
        WorkDir work(path, Start::join);
        work.bind(drawn_run);
        if (work.find(wedge.key, out.echo, out.state) || work.remarks().size() != 1) return false;
        const std::string line = work.remarks()[0];
        return line.find(file) != std::string::npos && line.find("damaged") != std::string::npos &&
               line.find("wedge 2 is done again") != std::string::npos;
    };
    for (std::size_t i = 0; i < whole.size(); ++i) {
        std::string bytes = whole;
        bytes[i] = static_cast<char>(bytes[i] ^ (1 << (i % 8)));
        INFO("byte " << i << " of " << whole.size());
        REQUIRE(refused(bytes));
    }
    for (std::size_t size : {std::size_t{0}, std::size_t{7}, whole.size() / 2, whole.size() - 1}) {
        INFO("cut to " << size);
        CHECK(refused(whole.substr(0, size)));
    }
    CHECK(refused(whole + "x"));
    CHECK_FALSE(refused(whole));
    fs::remove(file);
    fs::create_directory(file);
    WorkDir work(path, Start::join);
    work.bind(drawn_run);
    CHECK_FALSE(work.find(wedge.key, out.echo, out.state));
    CHECK_THAT(work.remarks().at(0), Contains(file));
}

namespace {

/// A work folder of the drawn run, split and with no wedge yet.
void begin_work(const std::string& path) {
    WorkDir work(path, Start::fresh);
    work.bind(drawn_run);
    work.record_split(drawn_split);
}

}  // namespace

TEST_CASE("damage of any byte of the run's file is named, and the folder not used", "[resume]") {
    const Folder folder;
    const std::string path = folder / "work", file = path + "/run.json";
    begin_work(path);
    const std::string whole = content(file);
    for (std::size_t i = 0; i < whole.size(); ++i) {
        std::string bytes = whole;
        bytes[i] = static_cast<char>(bytes[i] ^ 1);
        if (std::isspace(static_cast<unsigned char>(bytes[i]))) continue;  // a blank for a blank
        put(file, bytes);
        WorkDir work(path, Start::join);
        INFO("byte " << i << ": " << bytes.substr(i > 10 ? i - 10 : 0, 20));
        REQUIRE_THROWS_WITH(work.bind(drawn_run), Contains(file) && Contains("damaged"));
    }
    const std::string deep = std::string(200000, '[') + std::string(200000, ']');
    for (const std::string& bytes : {whole.substr(0, whole.size() / 2), R"({"checksum":"x","wedges":)" + deep + "}"}) {
        put(file, bytes);
        WorkDir work(path, Start::join);
        CHECK_THROWS_AS(work.bind(drawn_run), DataError);
        CHECK_FALSE(work.seems_done());
    }
}

TEST_CASE("a run's file of other kinds of values is refused as a damaged one, whatever its checksum", "[resume]") {
    const Folder folder;
    const std::string path = folder / "work", file = path + "/run.json";
    begin_work(path);
    const auto whole = nlohmann::ordered_json::parse(content(file));
    const auto bind = [&](const char* key, const nlohmann::ordered_json& value) {
        auto changed = whole;
        changed[key] = value;
        changed.erase("checksum");
        changed["checksum"] = hex(checksum(changed.dump()));
        put(file, changed.dump(1) + "\n");
        WorkDir work(path, Start::join);
        work.bind(drawn_run);
    };
    CHECK_NOTHROW(bind("wedges", whole["wedges"]));
    {
        WorkDir work(path, Start::join);
        WorkDir::Run other = drawn_run;
        other.azimuth_bins = {-500, 12};
        CHECK_THROWS_WITH(work.bind(other), Contains(file) && Contains("is damaged"));
        other.azimuth_bins = {0, 12};
        CHECK_NOTHROW(work.bind(other));
    }
    for (const auto& [key, value] :
         std::vector<std::pair<const char*, nlohmann::ordered_json>>{{"wedges", {0, nullptr}},
                                                                     {"wedges", {0, "90"}},
                                                                     {"wedges", {0, 1.5}},
                                                                     {"wedges", {0, 90, 90}},
                                                                     {"wedges", {0, ~std::uint64_t{0}}},
                                                                     {"wedges", {0}},
                                                                     {"wedges", 7},
                                                                     {"wedges", nullptr},
                                                                     {"format", 1},
                                                                     {"version", nullptr},
                                                                     {"asked", "range"},
                                                                     {"asked", {{"range", 5}}},
                                                                     {"facts", {1, 2}}}) {
        INFO(key << " " << value);
        CHECK_THROWS_WITH(bind(key, value), Contains(file) && Contains("is damaged"));
    }
}

TEST_CASE("what others wrote into a work folder's names stays", "[resume]") {
    const Folder folder;
    const std::string path = folder / "work";
    fs::create_directory(path);
    put(path + "/run.json", R"({"lr": 0.1})");
    put(path + "/wedge_notes.bin", "mine");
    CHECK_THROWS_WITH(WorkDir(path, Start::over), Contains("is no work folder: its 'run.json' is no run's"));
    CHECK(content(path + "/run.json") == R"({"lr": 0.1})");
    const std::string like_one = R"({"format": "mine", "x": 1})";
    put(path + "/run.json", like_one);
    CHECK_THROWS_WITH(WorkDir(path, Start::over), Contains("is no work folder: its 'run.json' is no run's"));
    CHECK(content(path + "/run.json") == like_one);
    // A run's own that lost a byte, or never reached the disk, is started over; what is no wedge's stays beside it.
    fs::remove(path + "/wedge_notes.bin");
    fs::remove(path + "/run.json");
    begin_work(path);
    put(path + "/wedge_notes.bin", "mine");
    const std::string whole = content(path + "/run.json");
    for (const std::string& bytes : {std::string(), std::string(500, '\0'), whole.substr(0, whole.size() / 2),
                                     "x" + whole.substr(1), whole.substr(0, 20) + "x" + whole.substr(21)}) {
        put(path + "/run.json", bytes);
        WorkDir work(path, Start::over);
        work.bind(drawn_run);
        work.record_split(drawn_split);
        CHECK(content(path + "/run.json") == whole);
        CHECK(content(path + "/wedge_notes.bin") == "mine");
    }
}

TEST_CASE("a folder that does not fit is refused by name", "[resume]") {
    const Folder folder;
    const std::string path = folder / "work";
    {
        WorkDir unused(path, Start::join);
        CHECK(fs::is_directory(path));
    }
    CHECK_FALSE(fs::exists(path));  // made, and nothing came into it
    {
        WorkDir work(path + "/", Start::join);
        work.bind(drawn_run);
        work.record_split(drawn_split);
        const Drawn wedge;
        work.keep(wedge.key, wedge.outcome, wedge.echo, wedge.state);
    }
    CHECK_THROWS_WITH(WorkDir(path, Start::fresh), Contains(path) && Contains("--resume") && Contains("--overwrite"));
    {
        WorkDir work(path, Start::join);
        CHECK_THROWS_WITH(work.bind({"1", {{"range", "6km"}}, {{"range", "6000"}, {"beam", "1"}}}),
                          Contains(path) && Contains("range is '5km' there and '6km' here"));
        CHECK_THROWS_WITH(work.bind({"2", drawn_run.asked, drawn_run.facts}),
                          Contains("version is '1' there and '2' here"));
        CHECK_THROWS_WITH(work.bind({"1", {{"range", "5km"}, {"beam", "1deg"}}, {{"range", "5000"}, {"beam", "2"}}}),
                          Contains("beam is not given there and '1deg' here"));
        work.bind({"1", {{"range", "6km"}}, drawn_run.facts});  // said otherwise, the same scene
        CHECK(work.kept() == 1);
    }
    {
        WorkDir work(path, Start::over);
        work.bind({"1", {{"range", "6km"}}, {{"range", "6000"}, {"beam", "1"}}});
        CHECK(work.recorded_split().empty());
        CHECK(wedge_files(path) == 1);  // until a new run is sure to begin
        CHECK(work.record_split({{0, 12}}) == std::vector<Interval>{{0, 12}});
        CHECK(wedge_files(path) == 0);
    }
    fs::create_directory(folder / "foreign");
    put(folder / "foreign/diary.txt", "dear diary");
    for (Start start : {Start::fresh, Start::over, Start::join})
        CHECK_THROWS_WITH(WorkDir(folder / "foreign", start), Contains("foreign") && Contains("diary.txt"));
    CHECK(content(folder / "foreign/diary.txt") == "dear diary");
    put(folder / "file", "x");
    CHECK_THROWS_AS(WorkDir(folder / "file", Start::join), InputError);
    CHECK_THROWS_AS(WorkDir(folder / "nowhere/work", Start::join), IoError);
}

TEST_CASE("a run that two processes start over at once is begun once, and no wedge of it is lost", "[resume]") {
    const Folder folder;
    const std::string path = folder / "work";
    begin_work(path);
    // The data base changed: both find facts of another scene before either begins.
    WorkDir::Run changed = drawn_run;
    changed.facts[0].value = "5001";
    WorkDir first(path, Start::join), second(path, Start::join);
    first.bind(changed);
    second.bind(changed);
    CHECK(first.record_split(drawn_split) == drawn_split);
    const Drawn wedge;
    first.keep(wedge.key, wedge.outcome, wedge.echo, wedge.state);
    CHECK(second.record_split({{0, 6}, {6, 12}}) == drawn_split);
    Drawn out(0);
    CHECK(second.find(wedge.key, out.echo, out.state));
    CHECK(out.echo == wedge.echo);
    CHECK(wedge_files(path) == 1);
}

TEST_CASE("a pipe in a work folder is refused, or a damaged wedge, and nobody waits for its writer", "[resume]") {
    const Folder folder;
    const std::string path = folder / "work";
    begin_work(path);
    WorkDir work(path, Start::join);
    work.bind(drawn_run);
    Drawn wedge;
    REQUIRE(::mkfifo((path + "/wedge_000002.bin").c_str(), 0600) == 0);
    CHECK_FALSE(work.find(wedge.key, wedge.echo, wedge.state));
    REQUIRE(work.remarks().size() == 1);
    CHECK_THAT(work.remarks()[0], Contains("wedge_000002.bin") && Contains("it is no file"));
    fs::remove(path + "/run.json");
    REQUIRE(::mkfifo((path + "/run.json").c_str(), 0600) == 0);
    CHECK_THROWS_WITH(WorkDir(path, Start::join).bind(drawn_run), Contains("run.json") && Contains("is no file"));
}

TEST_CASE("what dead processes left half-written goes, what living ones write stays", "[resume]") {
    const Folder folder;
    const std::string path = folder / "work";
    begin_work(path);
    put(path + "/.wedge_000001.bin.tmp-99-1", "half");
    put(path + "/.run.json.tmp-99-2", "half");
    put(path + "/.wedge_000003.bin.tmp-99-3", "half");
    const int writing = ::open((path + "/.wedge_000003.bin.tmp-99-3").c_str(), O_WRONLY);
    REQUIRE(::flock(writing, LOCK_EX) == 0);
    WorkDir work(path, Start::join);
    CHECK(names(path) == std::set<std::string>{"run.json", ".wedge_000003.bin.tmp-99-3"});
    ::close(writing);
}

TEST_CASE("a full disk costs a wedge, never one that was kept", "[resume][threads]") {
    const Folder folder;
    const std::string path = folder / "work";
    const Drawn first(1), second(2);
    WorkDir work(path, Start::fresh);
    work.bind(drawn_run);
    work.record_split(drawn_split);
    work.keep(first.key, first.outcome, first.echo, first.state);
    {
        const SmallDisk full(100);
        CHECK_THROWS_WITH(work.keep(second.key, second.outcome, second.echo, second.state),
                          Contains("wedge_000002.bin") && Contains("File too large") && Contains("100 bytes"));
    }
    CHECK(names(path) == std::set<std::string>{"run.json", "wedge_000001.bin"});
    // The folder is gone under the run.
    fs::remove_all(path);
    CHECK_THROWS_WITH(work.keep(second.key, second.outcome, second.echo, second.state),
                      Contains("wedge_000002.bin") && Contains("No such file"));
}

TEST_CASE("threads and processes keep and find side by side", "[resume][threads]") {
    const Folder folder;
    const std::string path = folder / "work";
    // As several processes would: folders of their own over one path, all at once from nothing.
    std::vector<std::thread> threads;
    std::atomic<int> wrong{0}, found{0};
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
            WorkDir work(path, Start::join);
            work.bind(drawn_run);
            const std::vector<Interval> mine = {{0, 3 + t}, {3 + t, 12}};
            const auto split = work.record_split(mine);
            WorkDir again(path, Start::join);  // looks for what dead processes left, while others write
            again.bind(drawn_run);
            if (split.size() != 2 || again.recorded_split() != split) ++wrong;
            for (int round = 0; round < 25; ++round) {
                const Drawn wedge(round % 3);
                Drawn out(0);
                const WorkDir look(path, Start::join);
                work.keep(wedge.key, wedge.outcome, wedge.echo, wedge.state);
                if (!work.find(wedge.key, out.echo, out.state) || out.echo != wedge.echo) ++wrong;
                ++found;
            }
            if (!work.remarks().empty()) ++wrong;
        });
    for (auto& thread : threads) thread.join();
    CHECK(wrong == 0);
    CHECK(found == 100);
    CHECK_FALSE(any_temporary(path));
    // One folder, many threads: as the engine does.
    WorkDir work(path, Start::join);
    work.bind(drawn_run);
    threads.clear();
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
            const Drawn wedge(t);
            Drawn out(0);
            work.keep(wedge.key, wedge.outcome, wedge.echo, wedge.state);
            WedgeKey changed = wedge.key;
            changed.data = 0;
            if (work.find(changed, out.echo, out.state)) ++wrong;
            if (!work.find(wedge.key, out.echo, out.state) || out.echo != wedge.echo) ++wrong;
        });
    for (auto& thread : threads) thread.join();
    CHECK(wrong == 0);
    CHECK(work.remarks().size() == 1);
}

TEST_CASE("killed at random, a run goes on where it stood and ends in the same bytes", "[resume][program]") {
    const Folder folder;
    Program program(folder);
    const Strings scene = scene_over(data + "/inland_empire_dem.tif");
    const auto began = std::chrono::steady_clock::now();
    REQUIRE(program.run(scene + outputs).code == 0);
    const double straight_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    const Images straight(folder);

    const unsigned seed = std::random_device{}();
    CAPTURE(seed);
    std::mt19937 random(seed);
    const Strings resumed = scene + outputs + Strings{"--work-dir", "work", "--resume"};
    std::size_t most = 0;
    for (int kill = 0; kill < 5; ++kill) {
        const double after_s = std::uniform_real_distribution<double>(0, 0.5 * straight_s)(random);
        const pid_t child = program.start(resumed);
        std::this_thread::sleep_for(std::chrono::duration<double>(after_s));
        ::kill(child, SIGKILL);
        program.finish(child);
        const std::size_t kept = wedge_files(folder / "work");
        CHECK(kept >= most);
        most = kept;
    }
    const Outcome last = program.run(resumed);
    INFO(last.err);
    REQUIRE(last.code == 0);
    CHECK(Images(folder) == straight);
    const nlohmann::json said = report(folder);
    CHECK(said["reused"] == most);
    std::size_t marked = 0;
    for (const auto& wedge : said["wedges"]) marked += wedge["reused"].get<bool>();
    CHECK(marked == most);
    CHECK(said["wedges"].size() == wedges);
    if (most > 0) CHECK_THAT(last.err, Contains("reused " + std::to_string(most) + " of 12 wedges"));
    CHECK(wedge_files(folder / "work") == wedges);
    CHECK_FALSE(any_temporary(folder / "work"));
}

TEST_CASE("through rain over ground of any law a run goes on to the same bytes", "[resume][program]") {
    const Folder folder;
    Program program(folder);
    const Strings weather = {"--rain", "moderate",      "--gases",      "normal",    "--cloud",
                             "fog",    "--backscatter", "ulaby-dobson", "--speckle", "2"};
    const Strings scene = scene_over(data + "/inland_empire_dem.tif") + weather, kept = {"--work-dir", "work"};
    const Strings all = outputs + Strings{"--power", "power.tif"};
    REQUIRE(program.run(scene + all).code == 0);
    const Images straight(folder);
    const std::string power = content(folder / "power.tif");
    REQUIRE(program.run(scene + kept + Strings{"--only-wedge", "0-4"}).code == 0);
    CHECK(wedge_files(folder / "work") == 5);
    // Killed while it does the rest.
    const pid_t child = program.start(scene + all + kept + Strings{"--resume"});
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    ::kill(child, SIGKILL);
    program.finish(child);
    const std::size_t before = wedge_files(folder / "work");
    CHECK(before >= 5);
    const Outcome last = program.run(scene + all + kept + Strings{"--resume"});
    INFO(last.err);
    REQUIRE(last.code == 0);
    CHECK(report(folder)["reused"] == before);
    CHECK(Images(folder) == straight);
    CHECK(content(folder / "power.tif") == power);
    // The weather and the law are the wedges' own: neither may be taken for another.
    for (const Strings& other : {Strings{"--rain", "heavy"}, Strings{"--backscatter", "oh"}}) {
        Strings words = scene;
        for (std::size_t i = 0; i + 1 < words.size(); ++i)
            if (words[i] == other[0]) words[i + 1] = other[1];
        const Outcome refused = program.run(words + all + kept + Strings{"--resume"});
        INFO(refused.err);
        CHECK(refused.code != 0);
        CHECK_THAT(refused.err, Contains(other[0].substr(2)));
    }
}

TEST_CASE("another scene is refused, an edited data base and a damaged wedge are swept again", "[resume][program]") {
    const Folder folder;
    Program program(folder);
    fs::copy_file(data + "/inland_empire_dem.tif", folder / "dem.tif");
    fs::copy_file(data + "/inland_empire_dem.tif", folder / "other.tif");
    const Strings scene = scene_over("dem.tif"), work = {"--work-dir", "work"}, resume = work + Strings{"--resume"};
    REQUIRE(program.run(scene + outputs + work).code == 0);
    const Images straight(folder);
    const auto refuses = [&](const Strings& more, const std::string& what, bool going_on = true, int code = 2) {
        const auto before = names(folder / "");
        Strings changed = scene;
        for (std::size_t i = 0; i + 1 < more.size(); i += 2) {
            const auto at = std::find(changed.begin(), changed.end(), more[i]);
            if (at != changed.end()) *(at + 1) = more[i + 1];
            if (at == changed.end()) changed = changed + Strings{more[i], more[i + 1]};
        }
        if (!going_on) std::erase(changed, "--overwrite");
        const Outcome outcome = program.run(changed + Strings{"-o", "new.png"} + (going_on ? resume : work));
        INFO(outcome.err);
        CHECK(outcome.code == code);
        CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
        CHECK_THAT(outcome.err, Contains("work") && Contains(what));
        CHECK(names(folder / "") == before);
        CHECK(wedge_files(folder / "work") == wedges);
    };
    refuses({"--range", "13km"}, "range is '14km' there and '13km' here");
    refuses({"--altitude-msl", "7001ft"}, "altitude-msl");
    refuses({"--dem", "other.tif"}, "dem is");
    refuses({"--quality", "fine"}, "quality");
    refuses({"--material", "water"}, "material");
    refuses({"--memory", "16MiB", "--size", "6000"}, "memory");
    refuses({}, "--resume", false);
    // Display is not the echo's; nor are threads, wedges and memory.
    CHECK(program
              .run(scene +
                   Strings{"-o", "grey.png", "--if-gain", "45dB", "--memory", "300MiB", "--report", "report.json"} +
                   resume)
              .code == 0);
    CHECK(report(folder)["reused"] == wedges);
    // Touched: the same bytes come out, done again.
    fs::last_write_time(folder / "dem.tif", fs::file_time_type::clock::now() + std::chrono::hours(1));
    Outcome outcome = program.run(scene + outputs + resume);
    REQUIRE(outcome.code == 0);
    CHECK_THAT(outcome.err, Contains("the data base changed since"));
    CHECK(report(folder)["reused"] == 0);
    CHECK(Images(folder) == straight);
    // Damaged.
    std::string bytes = content(folder / "work/wedge_000007.bin");
    bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 16);
    put(folder / "work/wedge_000007.bin", bytes);
    outcome = program.run(scene + outputs + resume);
    REQUIRE(outcome.code == 0);
    CHECK_THAT(outcome.err, Contains("work/wedge_000007.bin' is damaged") && Contains("reused 11 of 12"));
    CHECK_FALSE(report(folder)["wedges"][7]["reused"].get<bool>());
    CHECK(Images(folder) == straight);
    // Of a run whose split is lost the files are not damaged, whatever they hold.
    fs::remove(folder / "work/run.json");
    Strings fewer = scene;
    *std::next(std::find(fewer.begin(), fewer.end(), "--wedges")) = "9";
    outcome = program.run(fewer + outputs + resume);
    REQUIRE(outcome.code == 0);
    CHECK_THAT(outcome.err,
               Contains("work' hold other wedges than 'run.json' says; done again: wedges 0, 1, 2, 3, 4, 5, 6, 7, 8") &&
                   !Contains("damaged"));
    CHECK(Images(folder) == straight);
    // --overwrite without --resume starts over.
    CHECK(program.run(scene + outputs + work).code == 0);
    CHECK(report(folder)["reused"] == 0);
    CHECK(Images(folder) == straight);
}

TEST_CASE("a run of some wedges says which outputs it leaves", "[resume][program]") {
    const Folder folder;
    Program program(folder);
    const Strings part =
        scene_over(data + "/inland_empire_dem.tif") + Strings{"--work-dir", "work", "--only-wedge", "0"};
    const Outcome two = program.run(part + Strings{"-o", "ow.png", "--echo", "ow.tif"});
    CHECK(two.code == 0);
    CHECK_THAT(two.err,
               Contains("written: 1 of 12 wedges in 'work'; 'ow.png', 'ow.tif' are left to the run that merges "
                        "all wedges (--resume) ("));
    CHECK_FALSE(fs::exists(folder / "ow.png"));
    CHECK_THAT(program.run(part + Strings{"--states", "ow.tif"}).err, Contains("; 'ow.tif' is left to the run"));
    CHECK_THAT(program.run(part).err, Contains("wedges in 'work' ("));
}

TEST_CASE("two processes fill one folder, and resume merges", "[resume][program]") {
    const Folder folder;
    Program program(folder);
    const Strings scene = scene_over(data + "/inland_empire_dem.tif");
    REQUIRE(program.run(scene + outputs).code == 0);
    const Images straight(folder);
    const auto part = [&](const char* range) {
        return program.start(scene + Strings{"--work-dir", "work", "--only-wedge", range});
    };
    const pid_t a = part("0-3"), b = part("4-7");
    for (pid_t child : {a, b}) {
        const Outcome outcome = program.finish(child);
        INFO(outcome.err);
        CHECK(outcome.code == 0);
        CHECK_THAT(outcome.err, Contains("of 12 wedges in 'work'"));
    }
    CHECK(wedge_files(folder / "work") == 8);
    CHECK_FALSE(any_temporary(folder / "work"));
    const Outcome merged = program.run(scene + outputs + Strings{"--work-dir", "work", "--resume"});
    CHECK(merged.code == 0);
    CHECK_THAT(merged.err, Contains("reused 8 of 12 wedges"));
    // The plan is of what was left to do.
    const auto plan = report(folder)["plan"];
    CHECK(plan["wedges"]["planned"] == 4);
    CHECK(plan["wedges"]["actual"] == 4);
    CHECK(plan["bytes_read"]["planned"] >= plan["bytes_read"]["actual"]);
    CHECK(plan["bytes_read"]["planned"].get<double>() < 1.5 * plan["bytes_read"]["actual"].get<double>());
    CHECK(Images(folder) == straight);
    // No pass where nothing is left to do, but one where something is.
    const Strings sorted = scene + outputs + Strings{"--work-dir", "work", "--resume", "--source", "spilled"};
    REQUIRE(program.run(sorted).code == 0);
    CHECK(report(folder)["reused"] == 12);
    CHECK(report(folder)["source"]["partition_bytes"] == 0);
    CHECK(Images(folder) == straight);
    fs::remove(folder / "work/wedge_000005.bin");
    REQUIRE(program.run(sorted).code == 0);
    CHECK(report(folder)["reused"] == 11);
    CHECK(report(folder)["source"]["partition_bytes"] > 0);
    CHECK(Images(folder) == straight);
    const Outcome beyond = program.run(scene + Strings{"--work-dir", "work", "--only-wedge", "9-12"});
    CHECK(beyond.code == 2);
    CHECK_THAT(beyond.err, Contains("only-wedge is 9-12") && Contains("0 to 11"));
    CHECK(program.run(scene + Strings{"--work-dir", "none", "--only-wedge", "99"}).code == 2);
    CHECK_FALSE(fs::exists(folder / "none"));
    for (const char* wrong : {"3-1", "x", "-1", "1-", "1-2-3"}) {
        const Outcome outcome = program.run(scene + Strings{"--work-dir", "work", "--only-wedge", wrong});
        CHECK(outcome.code == 2);
        CHECK_THAT(outcome.err, Contains("--only-wedge is"));
    }
    CHECK_THAT(program.run(scene + outputs + Strings{"--resume"}).err, Contains("resume is given without work-dir"));
    CHECK_THAT(program.run(scene + Strings{"--only-wedge", "1"}).err, Contains("only-wedge is given without"));
}

TEST_CASE("the pass of some wedges alone sorts what these may need, and no bit changes", "[resume][program]") {
    const Folder folder;
    Program program(folder);
    const Strings scene = scene_over(data + "/inland_empire_dem.tif") +
                          Strings{"--culture", data + "/inland_empire_culture.tif", "--culture-legend", "fbfm40"};
    const Strings spilled{"--source", "spilled"}, merge{"--work-dir", "work", "--resume"};
    REQUIRE(program.run(scene + outputs + spilled).code == 0);
    const auto whole = report(folder)["source"];
    const Images straight(folder);
    const std::uint64_t all = whole["partition_bytes"], held = whole["held_bytes"];
    std::uint64_t kept = 0;
    // Wedges, and the share of the blocks that is enough: these are wide here, and one more is kept all round.
    for (const auto& [range, count, share] :
         {std::tuple{"0-2", 3U, 0.75}, {"3", 1U, 0.75}, {"8-11", 4U, 0.95}, {"4-7", 4U, 0.95}}) {
        CAPTURE(range);
        const Outcome part = program.run(
            scene + spilled + Strings{"--work-dir", "work", "--only-wedge", range, "--report", "report.json"});
        INFO(part.err);
        REQUIRE(part.code == 0);
        const auto run = report(folder);
        CHECK(run["wedges"].size() == count);
        CHECK(run["source"]["kind"] == "spilled");
        CHECK(run["source"]["partition_bytes"].get<double>() < share * static_cast<double>(all));
        CHECK(run["source"]["held_bytes"].get<double>() < share * static_cast<double>(held));
        CHECK(run["plan"]["partition_bytes"]["planned"] == run["plan"]["partition_bytes"]["actual"]);
        kept += run["source"]["held_bytes"].get<std::uint64_t>();
    }
    CHECK(kept >= held);  // together all of it, some twice
    const Outcome merged = program.run(scene + outputs + merge);
    CHECK_THAT(merged.err, Contains("reused 12 of 12 wedges"));
    CHECK(Images(folder) == straight);
    const Outcome beyond = program.run(scene + spilled + Strings{"--work-dir", "work", "--only-wedge", "9-12"});
    CHECK(beyond.code == 2);
    CHECK_THAT(beyond.err, Contains("only-wedge is 9-12") && Contains("0 to 11"));
    CHECK(program.run(scene + spilled + Strings{"--work-dir", "none", "--only-wedge", "99"}).code == 2);
    CHECK_FALSE(fs::exists(folder / "none"));
}

TEST_CASE("a tile store is known by its content, not by when it was written", "[resume][program]") {
    const Folder folder;
    Program program(folder);
    const std::string dem = data + "/inland_empire_dem.tif";
    REQUIRE(program.run({"tile", dem, "store", "-q"}).code == 0);
    const Strings kept = scene_over("store") + outputs + Strings{"--work-dir", "work", "--resume"};
    REQUIRE(program.run(kept).code == 0);
    CHECK(report(folder)["reused"] == 0);
    const Images first(folder);
    for (const auto& entry : fs::recursive_directory_iterator(folder / "store"))
        if (entry.is_regular_file())
            fs::last_write_time(entry.path(), fs::file_time_type::clock::now() + std::chrono::hours(1));
    REQUIRE(program.run(kept).code == 0);
    CHECK(report(folder)["reused"] == wedges);
    CHECK(Images(folder) == first);
    // Tiled again from the same raster: the same content. From another one: all is swept again.
    REQUIRE(program.run({"tile", dem, "store", "-q", "--overwrite"}).code == 0);
    REQUIRE(program.run(kept).code == 0);
    CHECK(report(folder)["reused"] == wedges);
    fs::copy_file(dem, folder / "edited.tif");
    {
        GDALAllRegister();
        auto* raster = GDALDataset::Open((folder / "edited.tif").c_str(), GDAL_OF_UPDATE);
        REQUIRE(raster);
        float tower = 1500;
        REQUIRE(raster->GetRasterBand(1)->RasterIO(GF_Write, 1400, 300, 1, 1, &tower, 1, 1, GDT_Float32, 0, 0,
                                                   nullptr) == CE_None);
        GDALClose(raster);
    }
    REQUIRE(program.run({"tile", "edited.tif", "store", "-q", "--overwrite"}).code == 0);
    const Outcome edited = program.run(kept);
    REQUIRE(edited.code == 0);
    CHECK_THAT(edited.err, Contains("the data base changed since"));
    CHECK(report(folder)["reused"] == 0);
    CHECK(!(Images(folder) == first));
}

TEST_CASE("wedges swept from a kept spill serve runs that read the store itself, and the other way",
          "[resume][program]") {
    const Folder folder;
    Program program(folder);
    // Two sheets beside each other: some wedges read one of them, some both.
    test::Drawing drawing;
    drawing.columns = 4300;
    drawing.rows = 300;
    drawing.geotransform = std::array<double, 6>{10, 3e-4, 0, 45, 0, -3e-4};
    drawing.crs = "EPSG:4326";
    drawing.value = [](int column, int row) { return 200 + 40 * std::sin(column * 0.3) + 30 * std::cos(row * 0.2); };
    test::draw(folder / "dem.tif", drawing);
    const std::string point = "44.955,11.2275";
    REQUIRE(program.run({"tile", "dem.tif", "store", "--around", point, "-q"}).code == 0);
    const auto reused = [&](const std::string& source, const Strings& more) {
        Strings run = {"simulate",       "--dem",   "store",       "--latlon", point,
                       "--altitude-msl", "2000m",   "--range",     "4km",      "-o",
                       "a.png",          "--power", "power.tif",   "--report", "report.json",
                       "--wedges",       "6",       "--overwrite", "--source", source};
        const Outcome outcome = program.run(run + more);
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        CHECK_THAT(outcome.err, !Contains("changed"));
        return report(folder)["reused"].get<int>();
    };
    for (const char* work : {"of_the_spill", "of_the_store"}) {
        const Strings kept = {"--work-dir", work, "--resume"};
        const bool spilled = work == std::string("of_the_spill");
        CHECK(reused(spilled ? "spilled" : "direct", kept) == 0);
        CHECK(reused("direct", kept) == 6);
        CHECK(reused("spilled", kept) == 6);
        fs::remove(folder / (std::string(work) + "/wedge_000000.bin"));
        CHECK(reused(spilled ? "direct" : "spilled", kept) == 5);
    }
    CHECK(report(folder)["source"]["kept"].is_string());
}

TEST_CASE("a store whose codes mean other materials is another data base", "[resume][program]") {
    const Folder folder;
    Program program(folder);
    const auto tile = [&](const char* material) {
        std::ofstream legend(folder / "legend.csv");
        for (int code = -9999; code < 300; ++code) legend << code << ',' << (code % 2 == 0 ? material : "soil") << '\n';
        legend.close();
        REQUIRE(program
                    .run({"tile", data + "/inland_empire_dem.tif", "--culture", data + "/inland_empire_culture.tif",
                          "--culture-legend", "legend.csv", "store", "-q", "--overwrite"})
                    .code == 0);
    };
    const Strings kept = scene_over("store") + outputs + Strings{"--work-dir", "work", "--resume"};
    tile("urban");
    REQUIRE(program.run(kept).code == 0);
    const Images first(folder);
    REQUIRE(program.run(kept).code == 0);
    CHECK(report(folder)["reused"] == wedges);
    tile("water");
    const Outcome other = program.run(kept);
    CAPTURE(other.err);
    CHECK((other.code != 0 || report(folder)["reused"] == 0));
}

TEST_CASE("a full disk and a signal leave what is done, and say how to go on", "[resume][program]") {
    const Folder folder;
    Program program(folder);
    const Strings scene = scene_over(data + "/inland_empire_dem.tif");
    REQUIRE(program.run(scene + outputs).code == 0);
    const Images straight(folder);
    const Strings resumed = scene + outputs + Strings{"--work-dir", "work", "--resume"};
    // Room for the run's own file and no wedge.
    Outcome outcome = program.run(resumed, 16384);
    INFO(outcome.err);
    CHECK(outcome.code == 1);
    CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
    CHECK_THAT(outcome.err, Contains("work/wedge_") && Contains("File too large"));
    CHECK(names(folder / "work") == std::set<std::string>{"run.json"});
    // Stopped as soon as some wedges are done.
    for (int signal : {SIGTERM, SIGINT}) {
        const std::size_t before = wedge_files(folder / "work");
        const pid_t child = program.start(resumed);
        for (int i = 0; i < 4000 && wedge_files(folder / "work") < before + 2; ++i)
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        ::kill(child, signal);
        outcome = program.finish(child);
        INFO(outcome.err);
        if (outcome.code == 0) continue;  // it was through already
        CHECK(outcome.code == 128 + signal);
        const std::size_t kept = wedge_files(folder / "work");
        CHECK(kept >= before + 2);
        CHECK_THAT(outcome.err, Contains("signal") && Contains(std::to_string(kept) + " wedges are kept in 'work'") &&
                                    Contains("--resume"));
        CHECK_FALSE(any_temporary(folder / "work"));
        CHECK(Images(folder) == straight);  // of the run before
    }
    CHECK(program.run(resumed).code == 0);
    CHECK(report(folder)["reused"] >= 2);
    CHECK(Images(folder) == straight);
}
