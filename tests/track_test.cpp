// Tracks: places between the rows of a table, scans by a sensor that moves, and simulate --track from outside.
#include <signal.h>
#include <sys/resource.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <numeric>
#include <sstream>
#include <thread>

#include "lib/engine.hpp"
#include "lib/track.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/program.hpp"
#include "tests/refusal.hpp"
#include "tests/small_disk.hpp"
#include "tests/terrain.hpp"
#include "tiles/shared_source.hpp"
#include "tools/lanes.hpp"
#include "tools/track_file.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;

namespace {

const std::string program = WEDGESCOPE_PROGRAM;

Track read(const std::string& content) {
    std::istringstream in(content);
    return track_from("t.csv", in, {Angle::degrees(7)});
}

std::string refused(const std::string& content) {
    return refusal<InputError>([&] { read(content); });
}

// ---- scans

/// Plane ground, no patterns or spreading: what comes back from one place lands in one cell.
Scene bare_scene(double x, double y) {
    Scene s;
    s.platform.xy = PointXY{x, y};
    s.platform.altitude_m = 800;
    s.range_m = 9000;
    s.earth_k.reset();
    s.azimuth_bins = 720;
    s.range_bin_m = 25;
    s.gamma = Decibel(-15);
    s.quality = Quality::exact;
    s.radar.antenna.elevation = ElevationPattern::gaussian;
    s.radar.antenna.floor = Decibel(0);
    s.radar.beam_width_error = s.radar.pulse_length_error = false;
    s.display.size = 64;
    return s;
}

// ---- the program

/// Hills with a wood and a few classes, in metres.
void draw_data(const Folder& folder, int posts = 160) {
    const auto hills = rolling(220, 60, 3);
    Drawing d;
    d.columns = d.rows = posts;
    d.geotransform = std::array<double, 6>{465000, 40, 0, 3755000, 0, -40};
    d.type = GDT_Int16;
    d.value = [&](int c, int r) { return std::round(300 + hills(c, r)); };
    draw(folder / "dem.tif", d);
    d.type = GDT_Byte;
    d.value = [](int c, int r) { return (c / 5 + r / 7) % 4 + 1; };
    draw(folder / "codes.tif", d);
    d.value = [](int c, int r) { return c % 23 < 6 && r % 19 < 9 ? 12 : 0; };
    draw(folder / "wood.tif", d);
    std::ofstream(folder / "legend.csv") << "1,soil\n2,trees\n3,urban\n4,grass\n";
    std::ofstream(folder / "scene.ini")
        << "dem = dem.tif\nculture = codes.tif\nculture-legend = legend.csv\nculture-height = wood.tif\n"
           "range = 4km\nrange-bin = 40m\nazimuth-bins = 480\nsize = 200\nnoise = on\nspeckle = 2\n"
           "reproducible = on\nquiet = on\n";
}

struct Row {
    std::string time, x, y, altitude, heading;
};
const std::vector<Row> rows = {{"0", "468200", "3752000", "900", "0"},
                               {"2.5", "468410.5", "3751950", "950", "77.5"},
                               {"5", "467000", "3752900", "1000", "200"},
                               {"6", "468200", "3751000", "1200", "-30"}};
void write_track(const Folder& folder, const std::vector<Row>& all = rows) {
    std::ofstream out(folder / "track.csv");
    out << "time,x,y,altitude-msl,heading\n";
    for (const Row& r : all) out << r.time << ',' << r.x << ',' << r.y << ',' << r.altitude << ',' << r.heading << '\n';
}

std::vector<std::string> layers(const std::string& folder) {
    return {"-o",      folder + "/s.png", "--echo",   folder + "/e.tif",
            "--power", folder + "/p.tif", "--states", folder + "/t.tif"};
}

std::vector<std::string> joined(std::vector<std::string> a, const std::vector<std::string>& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

std::string content(const std::filesystem::path& path) {
    std::ostringstream all;
    all << std::ifstream(path, std::ios::binary).rdbuf();
    return all.str();
}

std::map<std::string, std::string> contents(const std::string& folder) {
    std::map<std::string, std::string> all;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
        all[entry.path().filename().string()] = content(entry.path());
    return all;
}

Ended simulate(const Folder& folder, const std::vector<std::string>& arguments) {
    return run_program(joined({program, "simulate", folder / "scene.ini"}, arguments), folder / "log");
}

/// A track on two threads that is struck by a signal when its fifth picture is there.
Ended struck(const Folder& folder, int signal, const std::vector<std::string>& more = {}) {
    const pid_t child = start(joined({program, "simulate", folder / "scene.ini", "--track", folder / "track.csv", "-o",
                                      folder / "s.png", "--threads", "2"},
                                     more),
                              folder / "log");
    for (int i = 0; i < 3000 && !std::filesystem::exists(folder / "s_0005.png"); ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    ::kill(child, signal);
    return wait_for(child, folder / "log");
}

}  // namespace

TEST_CASE("between two rows a sensor moves evenly along the geodesic, and past the last one the last leg goes on",
          "[track]") {
    // Along the equator, and due east 60 s of 0.01 degrees.
    const Track track = read("time,lat,lon,altitude-msl\n10,0,20,1000\n70,0,20.01,1600\n130,0,20.01,1600\n");
    const PlatformParams base;
    const auto place = [&](std::size_t row, double s) { return *track.after(base, row, s).latlon; };
    CHECK(place(0, 0).lon_deg == 20);
    CHECK_THAT(place(0, 15).lon_deg, WithinAbs(20.0025, 1e-12));
    CHECK_THAT(place(0, 15).lat_deg, WithinAbs(0, 1e-12));
    CHECK_THAT(track.after(base, 0, 15).altitude_m, WithinAbs(1150, 1e-9));
    CHECK(track.after(base, 0, 15).heading.deg() == Angle::degrees(7).deg());
    CHECK(place(0, 90).lon_deg == 20.01);  // stands, to the last bit
    CHECK(place(2, 30).lon_deg == 20.01);

    // 60 degrees north the great circle between two points of one latitude bends to the pole: half-way between 0 and 40
    // degrees of longitude atan(tan 60 / cos 20) on a sphere; the ellipsoid's is within a tenth of a degree of it.
    const Track far = read("time,lat,lon,altitude-msl\n0,60,0,1000\n10,60,40,1000\n");
    const LatLon middle = *far.after(base, 0, 5).latlon;
    CHECK_THAT(middle.lon_deg, WithinAbs(20, 1e-9));
    CHECK_THAT(middle.lat_deg, WithinAbs(std::atan(std::tan(std::numbers::pi / 3) / std::cos(std::numbers::pi / 9)) *
                                             180 / std::numbers::pi,
                                         0.1));

    const Track plane = read("time,x,y,altitude-agl\n0,100,200,10\n4,140,160,30\n");
    CHECK(plane.after(base, 0, 1).xy->x == 110);
    CHECK(plane.after(base, 0, 1).xy->y == 190);
    CHECK(plane.after(base, 1, 2).xy->x == 160);
    CHECK(plane.after(base, 1, 2).altitude_m == 40);
    CHECK(plane.after(base, 1, 2).altitude_above == AltitudeAbove::ground);
}

TEST_CASE("on a raster in degrees a sensor flies the shorter way round, in x and y too", "[track]") {
    const PlatformParams base;
    constexpr double circle = 360;
    for (const double far : {-179.75, 180.25, 540.25}) {
        const Track track = read(text("time,x,y,altitude-msl\n0,179.75,10,1000\n10,", far, ",10,1000\n"));
        INFO("to " << far);
        CHECK(track.after(base, 0, 5, circle).xy->x == 180);
        CHECK(track.after(base, 0, 7.5, circle).xy->x == 180.125);
        CHECK(track.after(base, 1, 0, circle).xy->x == far);
        CHECK(track.after(base, 1, 5, circle).xy->x == far + 0.25);
    }
    const Track back = read("time,x,y,altitude-msl\n0,-179.5,10,1000\n10,179.5,12,1000\n20,-180.5,12,1000\n");
    CHECK(back.after(base, 0, 2.5, circle).xy->x == -179.75);
    CHECK(back.after(base, 0, 2.5, circle).xy->y == 10.5);
    CHECK(back.after(base, 1, 5, circle).xy->x == 179.5);  // stands: it is the same place
    // Metres do not come round.
    const Track plane = read("time,x,y,altitude-msl\n0,0,0,1000\n10,400,0,1000\n");
    CHECK(plane.after(base, 0, 5).xy->x == 200);
}

TEST_CASE("a table of a track names its columns and units in its first line", "[track]") {
    const Track track = read(
        "# recorded\nheading, altitude-msl [ft] ,time,lat [deg],lon\n"
        "\n 90,1000, 5 ,33.5,-117\n1rad,500m,5.5,33.5,-117.25\n");
    REQUIRE(track.size() == 2);
    CHECK_THAT(track[0].altitude_m, WithinAbs(304.8, 1e-9));
    CHECK(track[0].heading.deg() == 90);
    CHECK(track[0].line == 4);
    CHECK(track[1].altitude_m == 500);
    CHECK(track[1].heading.rad() == 1);
    CHECK(track[1].second == -117.25);
    CHECK(track.at({}, 1).altitude_above == AltitudeAbove::sea_level);
    CHECK(read("time,x,y,altitude-agl\n0,1,2,3\n")[0].heading.deg() == Angle::degrees(7).deg());
    CHECK(read("\xef\xbb\xbftime,x,y,altitude-agl\r\n0,1,2,3\r\n").size() == 1);
    // Names in any case of letters, and those of a table of observers.
    const Track other = read("Time,Latitude,LONGITUDE,Altitude_MSL [ft],Heading\n0,33.5,-117,1000,90\n");
    CHECK(other[0].first == 33.5);
    CHECK(other[0].second == -117);
    CHECK_THAT(other[0].altitude_m, WithinAbs(304.8, 1e-9));
    CHECK(other[0].heading.deg() == 90);
}

TEST_CASE("a bad line of a track is named with what was found and what is accepted", "[track]") {
    const std::string head = "time,lat,lon,altitude-msl,heading\n";
    CHECK(refused("") ==
          "track 't.csv' is empty; accepted: a line that names the columns time, lat and lon or x and y, one of "
          "altitude-msl, altitude-agl and altitude-hae, and heading, with a unit in brackets where it is not s, "
          "m or deg");
    CHECK_THAT(refused(head), Contains("has no rows"));
    CHECK_THAT(refused("time,lat,lon,alt\n"), Contains("line 1: column 4 is 'alt'; accepted: time, lat and lon"));
    CHECK_THAT(refused("time,lat,lon\n"), Contains("line 1: no column is an altitude"));
    CHECK_THAT(refused("lat,lon,altitude-msl\n"), Contains("no column is time"));
    CHECK_THAT(refused("time,lat,altitude-msl\n"), Contains("of lat and lon one is missing"));
    CHECK_THAT(refused("time,lat,lon,x,y,altitude-msl\n"), Contains("there are columns lat, lon and x, y"));
    CHECK_THAT(refused("time,lat,lon,altitude-msl,altitude-agl\n"), Contains("two columns of altitude"));
    CHECK_THAT(refused("time,lat,lat,lon,altitude-msl\n"), Contains("column 3 is 'lat', and so is one before"));
    CHECK_THAT(refused("time,lat,lon,altitude-msl [parsec]\n"), Contains("accepted units: "));
    CHECK_THAT(refused("time,lat,lon,altitude-msl [ft\n"), Contains("accepted units: "));
    CHECK(refused(head + "0,33,-117,abc,0\n") ==
          "track 't.csv', line 2, column altitude-msl is 'abc'; it must be a number (m), "
          "or one with a unit: m, km, ft, kft, nmi, mi, yd");
    CHECK(refused(head + "0,33,-117,1000,0\n1,93,-117,1000,0\n") ==
          "track 't.csv', line 3, column lat is '93'; it must be from -90 to 90 degrees");
    CHECK_THAT(refused(head + "0,33,-117,1000,400\n"),
               Contains("column heading is '400'; it must be from -360deg to 360deg"));
    CHECK_THAT(refused(head + "0,33,-117,1000,nan\n"), Contains("column heading is 'nan'"));
    CHECK_THAT(refused(head + "0,33,-117,2000km,0\n"), Contains("from -10km to 1000km"));
    CHECK(refused(head + "0,33,-117,1000,0\n1,33,-117,1000,\"0\n\"\n") ==
          "track 't.csv', line 3: cell 5 begins with a double quote that nothing closes; a quoted cell must end on its "
          "line");
    CHECK_THAT(refused(head + "0,33,-117,1000\n"), Contains("line 2 has 4 columns; accepted: 5"));
    CHECK_THAT(refused(head + "0,33,-117,1000,0\n\n# x\n0,33,-117,1000,0\n"),
               Contains("line 5, column time is 0 s; it must be more than the 0 s of the row before"));
    CHECK_THAT(refused(head + std::string(5000, '1')),
               Contains("line 2 has more than 4096 characters; accepted: at most so many"));
    CHECK(read(head + std::string(4075, ' ') + "0,33,-117,1000,0 \n").size() == 1);  // 4092 characters
    CHECK(read(head + "0,33,-117,1000,0").size() == 1);
    CHECK(read(head + std::string(4080, ' ') + "0,33,-117,1000,0").size() == 1);  // 4096
    CHECK_THAT(refused(head + std::string(4081, ' ') + "0,33,-117,1000,0"), Contains("line 2 has more than 4096"));
    CHECK_THAT(refused(head + std::string(4081, ' ') + "0,33,-117,1000,0\n"), Contains("line 2 has more than 4096"));
}

TEST_CASE("of a file without line ends no more is read than a line may have", "[track]") {
    struct Endless : std::streambuf {
        char part[512];
        std::size_t given = 0;
        int_type underflow() override {
            std::fill(std::begin(part), std::end(part), '1');
            if (given >= std::size_t{64} << 20) return traits_type::eof();
            given += sizeof part;
            setg(part, part, part + sizeof part);
            return traits_type::to_int_type(*part);
        }
    } endless;
    std::istream in(&endless);
    CHECK_THAT(refusal<InputError>([&] { track_from("t.csv", in, {}); }), Contains("line 1 has more than 4096"));
    CHECK(endless.given < 6000);
}

TEST_CASE("a scan by a sensor that stands is the plain picture, bit for bit", "[track][long]") {
    const auto hills = rolling(300, 40, 11);
    MemorySource source(201, 201, 60, [&](double c, double r) { return 200 + hills(c, r); });
    Scene s = bare_scene(6010, -5980);
    s.radar.beam_width_error = s.radar.pulse_length_error = true;
    s.azimuth_bins.reset();
    s.receiver.noise = true;
    s.receiver.speckle_looks = 2;
    const Track track = read("time,x,y,altitude-msl\n0,6010,-5980,800\n1,6010,-5980,800\n");
    // All round; a sector across north; one so wide that the beam's skirts meet behind it.
    for (const auto& [from, to] : {std::pair(0.0, 360.0), {-40.0, 35.0}, {-170.0, 175.0}}) {
        s.sector = Sector{Angle::degrees(from), Angle::degrees(to)};
        const ResolvedScene whole = resolve(s, source);
        const RunResult plain = run(whole, source, EngineParams{});
        for (const std::int64_t step : {7, 100, 5000}) {
            EngineParams params;
            params.threads = 2;
            params.wedges = 3;
            const RunResult scanned = run(whole, scan_along(track, 0, step, 4, whole, source), source, params, {});
            INFO(from << " to " << to << ", " << step << " bins at a time");
            CHECK(scanned.echo_w.grid == plain.echo_w.grid);
            CHECK(scanned.echo_w.cells == plain.echo_w.cells);
            CHECK(scanned.echo_state.cells == plain.echo_state.cells);
            CHECK(scanned.power_w.cells == plain.power_w.cells);
            CHECK(scanned.state.cells == plain.state.cells);
            CHECK(scanned.scope.grey == plain.scope.grey);
            CHECK(scanned.sampling.spokes_per_bin == plain.sampling.spokes_per_bin);
        }
    }
}

TEST_CASE("a scan shows a peak where it stands from the place at which its azimuth is looked at", "[track][long]") {
    // Peaks 120 m high, one post wide, on a plane; the sensor flies north-east at 300 m/s through a turn of 8 s.
    constexpr double post = 25, period = 8, east = 240, north = 180, height = 800;
    const std::vector<std::pair<int, int>> peaks = {{230, 60},  {330, 140}, {345, 262},
                                                    {250, 360}, {90, 340},  {60, 150}};
    MemorySource source(401, 401, post, [&](double c, double r) {
        for (const auto& [pc, pr] : peaks)
            if (c == pc && r == pr) return 120.0;
        return 0.0;
    });
    const double x0 = 4800, y0 = -5200;
    const Scene s = bare_scene(x0, y0);
    std::ostringstream table;
    table << "time,x,y,altitude-msl\n0," << x0 << ',' << y0 << ',' << height << "\n100," << x0 + 100 * east << ','
          << y0 + 100 * north << ',' << height << '\n';
    const Track track = read(table.str());
    const ResolvedScene whole = resolve(s, source);
    EngineParams params;
    params.threads = 2;
    constexpr std::int64_t step = 4;
    const RunResult scanned = run(whole, scan_along(track, 0, step, period, whole, source), source, params, {});
    const RunResult plain = run(whole, source, params);
    const double bin_rad = whole.shown.azimuth_step_rad();
    for (const auto& [pc, pr] : peaks) {
        const double px = pc * post, py = -pr * post;
        // The group of azimuths in which its place lies, seen from where the sensor is then.
        std::int64_t found = -1;
        double azimuth = 0, range = 0;
        for (std::int64_t group = 0; group < 720; group += step) {
            const double t = static_cast<double>(group) / 720 * period;
            const double dx = px - (x0 + east * t), dy = py - (y0 + north * t);
            const double a = std::fmod(std::atan2(dx, dy) + 2 * std::numbers::pi, 2 * std::numbers::pi);
            if (a < static_cast<double>(group) * bin_rad || a >= static_cast<double>(group + step) * bin_rad) continue;
            CHECK(found < 0);
            found = group;
            azimuth = a;
            range = std::sqrt(dx * dx + dy * dy + (height - 60) * (height - 60));
        }
        REQUIRE(found >= 0);
        // The brightest cell near there stands out of the plain: within a bin of the azimuth, a post and a bin in range.
        const auto row = static_cast<std::int64_t>(azimuth / bin_rad), column = static_cast<std::int64_t>(range / 25);
        const auto brightest = [&](const RunResult& r) {
            double best = 0;
            std::pair<std::int64_t, std::int64_t> at;
            for (std::int64_t i = -6; i <= 6; ++i)
                for (std::int64_t j = -12; j <= 12; ++j) {
                    const auto a = static_cast<std::size_t>((row + i + 720) % 720),
                               c = static_cast<std::size_t>(column + j);
                    const double value = static_cast<double>(r.echo_w.row(a)[c]);
                    if (value > best) best = value, at = {i, j};
                }
            return std::pair(at, best);
        };
        INFO("peak " << pc << ", " << pr << ": azimuth " << azimuth * 180 / std::numbers::pi << " deg, range " << range
                     << " m");
        const auto [at, power] = brightest(scanned);
        CHECK(std::abs(at.first) <= 1);
        CHECK(std::abs(at.second) <= 2);
        const auto background = static_cast<std::size_t>(column - 12);
        CHECK(power > 2 * static_cast<double>(scanned.echo_w.row(static_cast<std::size_t>(row))[background]));
        // From where the sensor was at first it stands elsewhere, once the sensor has moved.
        const double dx = px - x0, dy = py - y0;
        const double moved_m = std::abs(std::sqrt(dx * dx + dy * dy + (height - 60) * (height - 60)) - range),
                     turned = std::abs(std::remainder(std::atan2(dx, dy) - azimuth, 2 * std::numbers::pi));
        if (found > 60) CHECK((moved_m > 100 || turned > 4 * bin_rad));
        const double there =
            static_cast<double>(plain.echo_w.row(static_cast<std::size_t>(row))[static_cast<std::size_t>(column)]);
        CHECK(there < power / 2);
    }
}

TEST_CASE("a data base that stays in memory gives the bits of the source beneath", "[track]") {
    const auto hills = rolling(300, 40, 5);
    const auto make = [&] {
        auto source = std::make_unique<MemorySource>(150, 130, 50, [&](double c, double r) {
            return c > 100 && c < 110 && r > 60 ? static_cast<double>(void_post) : 200 + hills(c, r);
        });
        source->set_culture_height([](double c, double r) { return std::fmod(c, 17) < 4 && r > 40 ? 9.0 : 0.0; });
        source->set_classes([](double c, double r) { return static_cast<int>(c / 9 + r / 11) % 5 + 1; });
        return source;
    };
    Scene s = bare_scene(3600, -3100);
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
    const std::vector<std::string> look = {"--sector", "-100deg,120deg", "--orientation", "heading"};
    for (std::size_t i = 0; i < rows.size(); ++i) {
        std::vector<std::string> single =
            joined(look, {"--xy", rows[i].x + "," + rows[i].y, "--altitude-msl", rows[i].altitude + "m", "--heading",
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
        const Ended ended = simulate(folder, joined(joined(joined(look, layers(folder / "track")), how),
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

TEST_CASE("noise and speckle are another draw in each frame of a track, and without them nothing is", "[track]") {
    const Folder folder;
    draw_data(folder);
    std::vector<Row> stands(2, rows[0]);
    stands[1].time = "1";
    write_track(folder, stands);
    const auto alike = [&](const std::vector<std::string>& more) {
        const Ended ended = simulate(folder, joined({"--track", folder / "track.csv", "-o", folder / "s.png",
                                                     "--overwrite", "--if-gain", "64dB"},
                                                    more));
        INFO(ended.err);
        REQUIRE(ended.code == 0);
        return content(folder / "s_0001.png") == content(folder / "s_0002.png");
    };
    CHECK(!alike({"--speckle", "0"}));
    CHECK(!alike({"--noise", "off"}));
    CHECK(alike({"--noise", "off", "--speckle", "0"}));
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
        run_program(joined(look, {"--track", folder / "two.csv", "-o", folder / "both.png"}), folder / "log");
    INFO(both.err);
    REQUIRE(both.code == 0);
    const Ended alone = run_program(joined(look, {"--xy", "480000,3754250", "--altitude-msl", "600m", "-o",
                                                  folder / "alone.png", "--report", folder / "alone.json"}),
                                    folder / "log");
    INFO(alone.err);
    REQUIRE(alone.code == 0);
    CHECK(content(folder / "both_0002.png") == content(folder / "alone.png"));
    // A level was used at all.
    const auto levels = nlohmann::json::parse(content(folder / "alone.json")).at("levels");
    CHECK(levels.back().at("level").get<int>() > 0);
    // A scan's echo says so too.
    const Ended scan = run_program(joined(look, {"--track", folder / "two.csv", "--scan-step", "500", "--scan-period",
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
    std::vector<Row> all(5, rows[0]);
    for (std::size_t i = 0; i < all.size(); ++i) all[i].time = std::to_string(i);
    for (const std::size_t i : {1, 2, 4}) all[i].x = "368200";
    write_track(folder, all);
    const auto says = [&](const std::vector<std::string>& more) {
        std::vector<std::string> words = {
            program, "simulate",       "--dem",       folder / "dem.tif", "--range", "4km",     "--range-bin",
            "40m",   "--azimuth-bins", "360",         "--size",           "64",      "--track", folder / "track.csv",
            "-o",    folder / "s.png", "--overwrite", "--threads",        "2"};
        const Ended ended = run_program(joined(words, more), folder / "log");
        CHECK(ended.code == 0);
        return ended.err;
    };
    const std::string said = says({});
    CHECK_THAT(said, Contains("3 of 5 frames (first 2): nothing of the terrain lies within the range of 4 km"));
    CHECK_THAT(said, Contains("5 of 5 frames (first 1): azimuth bins of 1 deg are wider than half the beam"));
    CHECK(std::count(said.begin(), said.end(), '\n') == 3);  // and what is written
    CHECK(says({"-q"}).empty());
}

TEST_CASE("the report of a track tells of every frame", "[track]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder);
    const Ended ended = simulate(folder, {"--track", folder / "track.csv", "--report", folder / "r.json", "-o",
                                          folder / "s.png", "--timeline", folder / "t.json"});
    INFO(ended.err);
    REQUIRE(ended.code == 0);
    const auto report = nlohmann::json::parse(content(folder / "r.json"));
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
    CHECK(second["sampling"] == nlohmann::json::parse(content(folder / "alone.json"))["sampling"]);
    CHECK(nlohmann::json::parse(content(folder / "t.json"))["traceEvents"].size() > 20);
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
        std::vector<Row> all(6, rows[0]);
        for (std::size_t i = 0; i < all.size(); ++i) all[i].time = std::to_string(i);
        all[4].altitude = "-5";
        write_track(folder, all);
        const Ended ended = simulate(folder, {"--track", folder / "track.csv", "-o", folder / "s.png"});
        CHECK(ended.code == 2);
        CHECK_THAT(ended.err, Contains("line 6 (frame 5): the sensor is ") && Contains("below the terrain"));
        CHECK(std::count(ended.err.begin(), ended.err.end(), '\n') == 1);
        CHECK(frames_of().empty());  // found before any work
    }
    SECTION("a signal") {
        std::vector<Row> all(400, rows[0]);
        for (std::size_t i = 0; i < all.size(); ++i) {
            all[i].time = std::to_string(i);
            all[i].x = std::to_string(468200 + i);
        }
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

TEST_CASE("a piece that never comes keeps no lane waiting that is far ahead of it", "[track][threads]") {
    // The first of 99 is slow and then fails, when the other lane has made as many as may wait for it and one more.
    for (const std::size_t slow : {0, 5}) {
        std::vector<std::size_t> in_place;
        std::atomic<std::size_t> most{0};
        InOrder<std::size_t> order(
            99, [&](std::size_t& piece) { in_place.push_back(piece); }, [](std::size_t) {});
        const std::string said = refusal<IoError>([&] {
            side_by_side(
                2, 99,
                [&](int, std::size_t i) {
                    if (i == slow) {
                        while (most < slow + order.most_ahead) std::this_thread::yield();
                        std::this_thread::sleep_for(std::chrono::milliseconds(50));  // until it waits
                        throw IoError("the slow one");
                    }
                    if (i > slow) most = i;
                    order.take(i, std::size_t{i});
                },
                [&](std::size_t i) { order.leave_out(i); });
        });
        CHECK(said == "the slow one");
        CHECK(most == slow + order.most_ahead);
        CHECK(order.end() == slow);
        CHECK(order.error() == nullptr);
        std::vector<std::size_t> before(slow);
        std::iota(before.begin(), before.end(), std::size_t{0});
        CHECK(in_place == before);
    }
}

TEST_CASE("lanes for which there is no thread are an error, and none goes on", "[track]") {
    // Rooms for a few threads' stacks; instrumented programs need more of them than this lets them have.
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    if (pages * 4096 > std::size_t{1} << 40) return;
    rlimit before{};
    getrlimit(RLIMIT_AS, &before);
    const rlimit small{pages * 4096 + (std::size_t{100} << 20), before.rlim_max};
    std::atomic<int> made{0};
    std::string said;
    setrlimit(RLIMIT_AS, &small);
    try {
        side_by_side(400, 1000000000, [&](int, std::size_t) { ++made; });
    } catch (const IoError& e) {
        said = e.what();
    }
    setrlimit(RLIMIT_AS, &before);
    CHECK_THAT(said, Contains("a thread cannot be started: ") && Contains("(give fewer threads)"));
    CHECK(made < 1000000000);
}

TEST_CASE("pieces are put in place in the order of their numbers, and what cannot be is told", "[track][threads]") {
    std::vector<std::size_t> in_place;
    const auto make = [&](InOrder<std::size_t>& order) {
        side_by_side(3, 300, [&](int, std::size_t i) {
            if (const auto wrong = order.error()) std::rethrow_exception(wrong);
            if (i % 7 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
            order.take(i, std::size_t{i});
        });
    };
    std::vector<std::size_t> all(300);
    std::iota(all.begin(), all.end(), std::size_t{0});
    {
        InOrder<std::size_t> order(
            300, [&](std::size_t& piece) { in_place.push_back(piece); }, [](std::size_t) {});
        make(order);
        CHECK(order.end() == 300);
        CHECK(in_place == all);
    }
    InOrder<std::size_t> full(
        300,
        [&](std::size_t& piece) {
            if (piece == 20) throw IoError("no room");
        },
        [](std::size_t) {});
    CHECK(refusal<IoError>([&] { make(full); }) == "no room");
    CHECK(full.end() == 20);
}

namespace {

/// A raster's bands as GDAL reads them.
class Bands {
public:
    explicit Bands(const std::string& path) {
        GDALAllRegister();
        in_ = static_cast<GDALDataset*>(GDALOpen(path.c_str(), GA_ReadOnly));
        REQUIRE(in_);
    }
    ~Bands() { GDALClose(in_); }
    Bands(const Bands&) = delete;
    Bands& operator=(const Bands&) = delete;

    GDALDataset& raster() { return *in_; }
    GDALRasterBand& band(std::size_t number) { return *in_->GetRasterBand(static_cast<int>(number)); }
    std::size_t count() { return static_cast<std::size_t>(in_->GetRasterCount()); }
    /// Its cells as they are stored: NaN and -0 too.
    std::vector<std::uint32_t> bits(std::size_t number) {
        const int columns = in_->GetRasterXSize(), lines = in_->GetRasterYSize();
        std::vector<float> cells(static_cast<std::size_t>(columns) * static_cast<std::size_t>(lines));
        CHECK(band(number).RasterIO(GF_Read, 0, 0, columns, lines, cells.data(), columns, lines, GDT_Float32, 0, 0,
                                    nullptr) == CE_None);
        std::vector<std::uint32_t> out(cells.size());
        std::memcpy(out.data(), cells.data(), 4 * cells.size());
        return out;
    }
    static std::map<std::string, std::string> metadata(GDALMajorObject& object) {
        std::map<std::string, std::string> found;
        for (char** item = object.GetMetadata(); item && *item; ++item) {
            const std::string words = *item;
            found[words.substr(0, words.find('='))] = words.substr(words.find('=') + 1);
        }
        return found;
    }

private:
    GDALDataset* in_ = nullptr;
};

}  // namespace

TEST_CASE("the bands of a power stack are the numbered files, every bit and every word", "[track][long]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder);
    for (const std::string unit : {"W", "dBm"}) {
        const std::vector<std::string> track = {"--track", folder / "track.csv", "--power-unit", unit, "--overwrite"};
        const Ended both = simulate(folder, joined(track, {"--power", folder / "p.tif", "--power-stack",
                                                           folder / "stack.tif", "--report", folder / "r.json"}));
        INFO(unit << ' ' << both.err);
        REQUIRE(both.code == 0);
        CHECK(nlohmann::json::parse(content(folder / "r.json"))["power_stack"] == folder / "stack.tif");
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
            auto scene = nlohmann::json::parse(common.at("SCENE_JSON"));
            scene.merge_patch(nlohmann::json::parse(own.at("SCENE_JSON")));
            CHECK(scene == nlohmann::json::parse(alone.raster().GetMetadataItem("SCENE_JSON")));
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
        CHECK(nlohmann::json::parse(content(folder / "info"))["files"][0]["bands"] == rows.size());
        // By itself, from other threads and out of little memory the same file.
        const std::string truth = content(folder / "stack.tif");
        for (const auto& how : std::vector<std::vector<std::string>>{
                 {"--threads", "1"}, {"--threads", "2"}, {"--threads", "3"}, {"--threads", "2", "--memory", "4MiB"}}) {
            const Ended ended = simulate(folder, joined(joined(track, how), {"--power-stack", folder / "again.tif"}));
            INFO(how.back() << ' ' << ended.err);
            REQUIRE(ended.code == 0);
            CHECK(content(folder / "again.tif") == truth);
        }
        // What it holds is counted: numbered files alone come out of 3 MiB.
        const Ended less = simulate(
            folder, joined(track, {"--threads", "2", "--memory", "3MiB", "--power-stack", folder / "again.tif"}));
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
    std::vector<Row> all(44, rows[0]);
    for (std::size_t i = 0; i < all.size(); ++i) all[i].time = std::to_string(i);
    write_track(folder, all);
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

TEST_CASE("a power stack that cannot be is refused in one line before work begins", "[track]") {
    const Folder folder;
    draw_data(folder);
    write_track(folder);
    const auto before = folder.names();
    const auto says = [&](const std::vector<std::string>& more) {
        const Ended e = simulate(folder, more);
        CHECK(e.code == 2);
        CHECK(std::count(e.err.begin(), e.err.end(), '\n') == 1);
        return e.err;
    };
    const std::vector<std::string> track = {"--track", folder / "track.csv", "-o", folder / "s.png", "--power-stack"};
    CHECK_THAT(says({"--xy", "468200,3752000", "--altitude-msl", "900m", "--power-stack", folder / "st.tif"}),
               Contains("power-stack is given without track"));
    CHECK_THAT(says(joined(track, {folder / "st.png"})),
               Contains("st.png'; it is a GeoTIFF: accepted is a name that ends in .tif or .tiff"));
    CHECK_THAT(says({"--track", folder / "track.csv", "--power-stack", folder / "st.tif", "--co", "COMPRESS=LZW"}),
               Contains("co is given, and power-stack is the only raster"));
    CHECK_THAT(says({"--track", folder / "track.csv", "--power-stack", folder / "st.tif", "--of", "HFA"}),
               Contains("of is given, and power-stack is the only raster"));
    // Half a bin of heading more, and the sector touches one bin more.
    CHECK_THAT(says(joined(track, {folder / "st.tif", "--sector", "-60deg,60deg"})),
               Contains("track.csv', line 3 (frame 2): power-stack: the power image has 161 x 100 bins (azimuth, "
                        "range), that of frame 1 160 x 100; all must have as many (leave sector out, or let headings "
                        "lie whole azimuth bins apart)"));
    CHECK_THAT(says(joined(track, {folder / "st.tif", "--range", "auto"})),
               Contains("line 3 (frame 2): power-stack: the power image has 480 x ") && Contains("(give range)"));
    CHECK_THAT(says(joined(track, {folder / "dem.tif", "--overwrite"})),
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
    CHECK_THAT(says(joined(track, {folder / "st.tif"})), Contains("st.tif' exists; add --overwrite"));
    CHECK(content(folder / "st.tif") == "mine");
    const Ended over = simulate(folder, joined(track, {folder / "st.tif", "--overwrite"}));
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
        std::vector<Row> all(400, rows[0]);
        for (std::size_t i = 0; i < all.size(); ++i) all[i].time = std::to_string(i);
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

TEST_CASE("names of all frames are looked at before work begins", "[track]") {
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
    ended = simulate(folder, joined(track, {"--overwrite"}));
    INFO(ended.err);
    CHECK(ended.code == 0);
    CHECK(content(folder / "s_0003.png") != "mine");

    const auto says = [&](const std::vector<std::string>& more) {
        const Ended e = simulate(folder, more);
        CHECK(e.code == 2);
        CHECK(std::count(e.err.begin(), e.err.end(), '\n') == 1);
        return e.err;
    };
    const std::vector<std::string> again = joined(track, {"--overwrite"});
    CHECK_THAT(says(joined(again, {"--work-dir", folder / "w"})), Contains("work-dir is given beside track"));
    CHECK_THAT(says(joined(again, {"--work-dir", folder / "w", "--resume"})),
               Contains("work-dir is given beside track"));
    CHECK_THAT(says(joined(again, {"--only-wedge", "0"})), Contains("only-wedge is given without work-dir"));
    CHECK_THAT(says(joined(again, {"--source", "spilled"})), Contains("source is spilled, and track is given"));
    CHECK_THAT(says(joined(again, {"--xy", "1,2"})), Contains("--track") || Contains("track alone says"));
    CHECK_THAT(says(joined(again, {"--heading", "7deg"})),
               Contains("--heading is given beside track '") && Contains("whose column heading says it row by row"));
    CHECK_THAT(says(joined(again, {"--scan-step", "4"})), Contains("scan-step is given without scan-period"));
    CHECK_THAT(says(joined(again, {"--scan-period", "4s"})), Contains("scan-period is given without scan-step"));
    CHECK_THAT(says(joined(again, {"--report", folder / "track.csv"})),
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

TEST_CASE("the program scans along a track", "[track]") {
    const Folder folder;
    draw_data(folder);
    // The same place all the time, then 250 m/s.
    write_track(folder, {{"0", "468200", "3752000", "900", "30"},
                         {"4", "468200", "3752000", "900", "30"},
                         {"8", "469200", "3752000", "900", "30"}});
    const std::vector<std::string> track = {"--track", folder / "track.csv", "--sector", "-60deg,60deg"};
    for (const char* name : {"plain", "scan"}) std::filesystem::create_directory(folder / name);
    const Ended plain = simulate(folder, joined(track, {"--power", folder / "plain/p.tif"}));
    INFO(plain.err);
    REQUIRE(plain.code == 0);
    const Ended scan = simulate(folder, joined(track, {"--power", folder / "scan/p.tif", "--scan-step", "16",
                                                       "--scan-period", "4s", "--threads", "2"}));
    INFO(scan.err);
    REQUIRE(scan.code == 0);
    const auto cells = [&](const std::string& path) {
        GDALAllRegister();
        GDALDataset* in = static_cast<GDALDataset*>(GDALOpen(path.c_str(), GA_ReadOnly));
        REQUIRE(in);
        const int columns = in->GetRasterXSize(), lines = in->GetRasterYSize();
        std::vector<float> values(static_cast<std::size_t>(columns) * static_cast<std::size_t>(lines));
        CHECK(in->GetRasterBand(1)->RasterIO(GF_Read, 0, 0, columns, lines, values.data(), columns, lines, GDT_Float32,
                                             0, 0, nullptr) == CE_None);
        GDALClose(in);
        return values;
    };
    CHECK(cells(folder / "plain/p_0001.tif") == cells(folder / "scan/p_0001.tif"));
    write_track(folder, {rows[0]});
    const Ended stands = simulate(folder, joined(track, {"--power", folder / "scan/q.tif", "--scan-step", "16",
                                                         "--scan-period", "4s", "--quiet=off"}));
    CHECK(stands.code == 0);
    CHECK_THAT(stands.err, Contains("scan-step has no effect: a track of one row"));
    const auto still = cells(folder / "plain/p_0002.tif"), moved = cells(folder / "scan/p_0002.tif");
    REQUIRE(still.size() == moved.size());
    CHECK(std::equal(still.begin(), still.begin() + 100, moved.begin()));  // the first azimuth, before it has moved
    CHECK(still != moved);
}

TEST_CASE("a place of a scan that cannot be is found before work begins", "[track]") {
    const Folder folder;
    draw_data(folder);
    // It dives while the antenna turns: 900 m, and 40 m above the sea 4 s later, under hills of 300 m and more.
    write_track(folder, {{"0", "468200", "3752000", "900", "30"},
                         {"4", "468200", "3752000", "900", "30"},
                         {"8", "468300", "3752000", "40", "30"}});
    const Ended ended = simulate(
        folder, {"--track", folder / "track.csv", "-o", folder / "s.png", "--scan-step", "16", "--scan-period", "4s"});
    CHECK(ended.code == 2);
    CHECK_THAT(ended.err, Contains("line 3 (frame 2): 3.86667 s after the row's time: the sensor is ") &&
                              Contains("below the terrain"));
    CHECK(!std::filesystem::exists(folder / "s_0001.png"));
}

TEST_CASE("a scan over the antimeridian is that of a raster whose longitudes go on", "[track][long]") {
    const Folder folder;
    // Posts of a quarter of a degree all round the earth, or of the 20 degrees on both sides of 180.
    const auto draw_earth = [&](const std::string& name, double west, int columns) {
        Drawing d;
        d.columns = columns;
        d.rows = 120;
        d.geotransform = std::array<double, 6>{west - 0.125, 0.25, 0, 25, 0, -0.25};
        d.crs = "EPSG:4326";
        d.type = GDT_Int16;
        d.value = [&](int c, int r) {
            const int post = (c + static_cast<int>(std::lround(west * 4)) + 1440 * 2) % 1440;
            return std::round(900 * std::sin(post * 0.9) * std::cos(r * 0.7) + 900);
        };
        draw(folder / name, d);
    };
    draw_earth("round.tif", 160, 161);
    draw_earth("earth.tif", -180, 1440);
    const auto echo = [&](const std::string& dem, const std::string& x) {
        std::ofstream(folder / "t.csv") << "time,x,y,altitude-msl\n0,179.75,10,20000\n8," << x << ",10,20000\n";
        const Ended ended =
            run_program({program,   "simulate",       "--dem",         folder / dem, "--track",        folder / "t.csv",
                         "--power", folder / "p.tif", "--scan-step",   "30",         "--scan-period",  "8s",
                         "--range", "400km",          "--range-bin",   "2km",        "--azimuth-bins", "360",
                         "-q",      "--overwrite",    "--reproducible"},
                        folder / "log");
        INFO(dem << " " << x << ": " << ended.err);
        REQUIRE(ended.code == 0);
        GDALAllRegister();
        GDALDataset* in = static_cast<GDALDataset*>(GDALOpen((folder / "p_0001.tif").c_str(), GA_ReadOnly));
        REQUIRE(in);
        const int columns = in->GetRasterXSize(), lines = in->GetRasterYSize();
        std::vector<float> values(static_cast<std::size_t>(columns) * static_cast<std::size_t>(lines));
        CHECK(in->GetRasterBand(1)->RasterIO(GF_Read, 0, 0, columns, lines, values.data(), columns, lines, GDT_Float32,
                                             0, 0, nullptr) == CE_None);
        GDALClose(in);
        CHECK(std::count_if(values.begin(), values.end(), [](float v) { return v > 0; }) > 1000);
        return values;
    };
    const std::vector<float> truth = echo("round.tif", "180.25");
    CHECK(echo("round.tif", "-179.75") == truth);
    CHECK(echo("earth.tif", "-179.75") == echo("earth.tif", "180.25"));
}
