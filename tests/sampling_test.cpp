// How densely the ground is sampled, and how far: what goes by the ground, the sensor's height and the noise.
#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>
#include <tuple>

#include "lib/engine.hpp"
#include "lib/plan.hpp"
#include "lib/radar_equation.hpp"
#include "tests/bare_scene.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;
using wedgescope::test::MemorySource;
using wedgescope::test::scene_of_one_gamma;
using wedgescope::test::void_post;

TEST_CASE("spokes go by the height over what stands highest in the sector, but for a hundredth of it",
          "[sampling][spoke_grid]") {
    // A plain, mountains east of it, and one peak in the west.
    const auto height = [](double c, double r) { return c > 300 ? 2800.0 : c == 100 && r == 200 ? 2900.0 : 300.0; };
    MemorySource source(401, 401, 30, height);
    Scene s;
    s.platform.xy = PointXY{30 * 200, -30 * 200};
    s.platform.altitude_m = 3000;
    s.range_m = 12000;
    const auto resolved = [&](double from_deg, double to_deg) {
        s.sector = Sector{Angle::degrees(from_deg), Angle::degrees(to_deg)};
        return resolve(s, source);
    };
    const auto per_bin = [&](const ResolvedScene& scene) {
        return sampling_of(scene, source.data_base()).spokes_per_bin;
    };
    const auto rule = [](double posts) { return sampling(Scene{}.quality, GroundCover::bare, posts).spokes_per_bin; };
    const ResolvedScene east = resolved(45, 135), west = resolved(225, 315), all = resolved(0, 360);
    CHECK(east.clearance_m == 200);
    CHECK(west.clearance_m == 2700);
    CHECK(all.clearance_m == 200);
    CHECK(per_bin(east) == rule(1.1 * 200 / 30));
    CHECK(per_bin(west) == rule(2700.0 / 30));
    CHECK(per_bin(east) > per_bin(west));
    // Crests hide ground far off too: so many a post at least, but not where the scene says how many.
    const auto per_post = [&](const ResolvedScene& scene) {
        return sampling_of(scene, source.data_base()).spokes_per_post;
    };
    const std::pair<Quality, double> least[] = {
        {Quality::draft, 0.9}, {Quality::normal, 1.2}, {Quality::fine, 2}, {Quality::exact, 2.75}};
    for (const auto& [quality, posts] : least) {
        s.quality = quality;
        CHECK(per_post(resolved(45, 135)) == posts);
        CHECK(per_post(resolved(225, 315)) == sampling(quality, GroundCover::bare, 90).spokes_per_post);
    }
    s.quality = Scene{}.quality;
    s.spokes_per_post = 0.7;
    CHECK(per_post(resolved(45, 135)) == 0.7);
    s.spokes_per_post.reset();
    // Above the sensor: as from 2 posts up, no denser. Nearer the ground below: as that has it.
    s.platform.altitude_m = 1000;
    CHECK(resolved(45, 135).clearance_m == -1800);
    CHECK(per_bin(resolved(45, 135)) == rule(2));
    s.platform.altitude_m = 330;
    CHECK(per_bin(resolved(45, 135)) == rule(1));
    // Where no post is, nothing is known.
    s.platform.altitude_m = 3000;
    s.platform.xy = PointXY{-30 * 900, -30 * 200};
    CHECK(resolved(225, 315).clearance_m == infinite);
}

TEST_CASE("a sensor lower than a post takes no more spokes than one a post up, unless something stands there",
          "[sampling][spoke_grid]") {
    Scene s;
    s.platform.xy = PointXY{30 * 200, -30 * 200};
    s.range_m = 5000;
    const auto per_bin = [&](MemorySource& source, double height_m) {
        s.platform.altitude_m = 300 + height_m;
        return sampling_of(resolve(s, source), source.data_base()).spokes_per_bin;
    };
    const auto plain = [](double, double) { return 300.0; };
    MemorySource bare(401, 401, 30, plain), classes(401, 401, 30, plain), canopy(401, 401, 30, plain);
    for (MemorySource* source : {&classes, &canopy}) source->set_classes([](double, double) { return ClassId{0}; });
    canopy.set_culture_height([](double, double) { return 1.0; });
    for (const auto& [quality, lowest_m, spokes] : {std::tuple{Quality::draft, 15, 24},
                                                    {Quality::normal, 30, 24},
                                                    {Quality::fine, 30, 48},
                                                    {Quality::exact, 30, 96}}) {
        s.quality = quality;
        CHECK(per_bin(bare, lowest_m) == spokes);
        CHECK(per_bin(bare, 3) == spokes);
        CHECK(per_bin(bare, 2 * lowest_m + 1) < spokes);
    }
    s.quality = Quality::normal;
    CHECK(per_bin(classes, 3) == per_bin(classes, 15));
    CHECK(per_bin(classes, 16) == 2 * per_bin(classes, 30.5));
    CHECK(per_bin(canopy, 3) == 2 * per_bin(canopy, 61));
}

TEST_CASE("what a quality promises holds from where the beam is two posts wide, of scenes it is made for", "[sampling]") {
    MemorySource source(101, 81, 30, [](double, double) { return 100.0; });
    Scene s;
    s.platform.xy = PointXY{30 * 50, -30 * 40};
    s.platform.altitude_m = 1000;
    s.range_m = 1500;
    const auto promised = [&] { return promise_of(resolve(s, source)); };
    const std::tuple<Quality, double, double> all[] = {{Quality::draft, 0.4, 1.5},
                                                       {Quality::normal, 0.1, 0.35},
                                                       {Quality::fine, 0.05, 0.2},
                                                       {Quality::exact, 0.02, 0.06}};
    for (const auto& [quality, rms, p99] : all) {
        s.quality = quality;
        CHECK(promised().error.rms_db == rms);
        CHECK(promised().error.p99_db == p99);
        CHECK(promised().from_m == Approx(2 * 30 / (1.5 * std::numbers::pi / 180)));
        CHECK(promised().lacks.empty());
    }
    const auto lacks = [&](const char* what) {
        const std::vector<std::string> found = promised().lacks;
        return found.size() == 1 && found[0].find(what) != std::string::npos;
    };
    const Scene good = s;
    // The circle holds 18.46 quarters of it: 18 bins.
    s.radar.antenna.beam = Angle::degrees(78);
    CHECK(promised().lacks.empty());
    s = good;
    s.radar.pulse_s = 0.39e-6;
    CHECK(lacks("58.46 m, 1.9 posts (2 or more)"));
    s = good;
    s.azimuth_bins = 951;
    CHECK(promised().lacks.empty());
    s.azimuth_bins = 950;
    CHECK(lacks("3.96 azimuth bins lie in the beam (4 or more)"));
    s = good;
    s.range_bin_m = 40;
    CHECK(lacks("1.87 range bins lie in c tau / 2"));
    s.radar.pulse_s = 1e-6;
    CHECK(lacks("3.75 range bins lie in c tau / 2"));
    s.range_bin_m = 37.5;
    CHECK(promised().lacks.empty());
    s = good;
    s.radar.beam_width_error = false;
    CHECK(lacks("bwe"));
    s = good;
    s.radar.pulse_length_error = false;
    CHECK(lacks("ple"));
    s = good;
    s.spokes_per_post = 4;
    CHECK(lacks("spokes-per-post"));
    s.crossings = true;
    CHECK(promised().lacks == std::vector<std::string>{"spokes-per-post is given", "crossings is given"});
    s = good;
    s.crossings = false;
    CHECK(lacks("crossings is given"));
    s = good;
    s.spokes_per_bin = 64;
    CHECK(lacks("spokes-per-bin is given"));
    s = good;
    s.spoke_lead = 8;
    CHECK(lacks("spoke-lead is given"));
    s = good;
    s.curved_course = true;
    CHECK(lacks("course is given"));
    s = good;
    s.refine = false;
    CHECK(lacks("refine is off"));
    s = good;
    s.detail = false;
    CHECK(promised().lacks.empty());
    // A run says the same.
    CHECK(run(resolve(s, source), source, {}).promise.error.rms_db == 0.02);
}

TEST_CASE("what a scene is told by is read block after block of the file", "[sampling]") {
    // Of a file in large packed blocks none may stay decoded: each change of block is one decoded.
    struct InBlocks : MemorySource {
        using MemorySource::MemorySource;
        void read_bare_terrain(const Window& posts, float* heights_m) override {
            const std::pair block{posts.columns.begin / data_base().block_columns,
                                  posts.rows.begin / data_base().block_rows};
            changes += block != last;
            last = block;
            ++reads;
            MemorySource::read_bare_terrain(posts, heights_m);
        }
        std::pair<std::int64_t, std::int64_t> last{-1, -1};
        int changes = 0, reads = 0;
    };
    InBlocks source(801, 801, 4, [](double c, double r) { return 50 * std::sin(c / 30) * std::cos(r / 50); });
    source.editable().block_columns = source.editable().block_rows = 401;
    Scene s;
    s.platform.xy = PointXY{4 * 400, -4 * 400};
    s.platform.altitude_m = 400;
    s.range_m = 1500;
    s.weather.rain_mm_h = 4;
    REQUIRE(resolve(s, source).rain_floor.size() == 32);
    CHECK(source.reads > 500);
    CHECK(source.changes < 20);
}

TEST_CASE("single posts that stand out count as if the sensor were lower", "[sampling][spoke_grid]") {
    Scene s;
    s.platform.xy = PointXY{4 * 400, -4 * 400};
    s.platform.altitude_m = 400;
    s.range_m = 1500;
    const auto seen = [&](const std::function<double(double, double)>& height) {
        MemorySource source(801, 801, 4, height);
        const ResolvedScene resolved = resolve(s, source);
        return std::pair(resolved.roughness, sampling_of(resolved, source.data_base()).above_posts);
    };
    // Planes and ridges along a line are no posts that stand out, however steep.
    const auto plane = seen([](double c, double r) { return 0.0625 * c - 0.03125 * r; });
    CHECK(plane.first == 0);
    CHECK(plane.second == (400 - 12.5) / 4);  // over the ground right below
    CHECK(seen([](double c, double) { return std::fmod(c, 8) < 4 ? 20.0 : 0.0; }).first == 0);
    // On a checkerboard of h metres each cell has a saddle of 2 h.
    const auto board = [](double m) {
        return [=](double c, double r) { return std::fmod(c + r, 2) < 1 ? m : 0.0; };
    };
    const auto low = seen(board(1.5)), high = seen(board(6));
    CHECK(low.first == 0.5 * 1.5 / 4);
    CHECK(low.second < 0.2 * 400 / 4);
    CHECK(high.first == 0.5 * 6 / 4);
    CHECK(high.second < 0.3 * low.second);
    CHECK(seen(board(0.75)).second == (400 - 0.75) / 4);
    // Needles on one post of a thousand: four cells of each.
    const auto needles = seen([](double c, double r) { return std::fmod(c * 7919 + r * 104729, 1009) < 1 ? 40.0 : 0.0; });
    CHECK(needles.first == Approx(std::sqrt(4.0 / 1009) * 40 / 4 / 4).epsilon(0.3));
    CHECK(needles.second < 0.2 * 400 / 4);
    // Cells of a void do not count.
    CHECK(seen([](double c, double) { return std::fmod(c, 5) < 1 ? static_cast<double>(void_post) : 0.0; }).first == 0);
}

TEST_CASE("ground is quiet from where the radar equation has it below the noise", "[sampling][spoke_grid]") {
    MemorySource source(400, 400, 30, test::rolling(300, 90, 5));
    Scene s;
    s.platform.xy = PointXY{30 * 200, -30 * 200};
    s.platform.altitude_m = 3000;
    s.range_m = 400000;
    const auto quiet = [&] { return sampling_of(resolve(s, source), source.data_base()).quiet_posts; };
    for (const double width_deg : {1.5, 6.0}) {
        s.radar.antenna.beam = Angle::degrees(width_deg);
        s.radar.transmit_power_w = 50e3;
        const std::array<double, 4> posts = quiet();
        for (std::size_t i = 0; i < posts.size(); ++i) {
            REQUIRE(posts[i] < 400000 / 30.0);
            // A slope of a half that faces a sensor almost on the horizon of it: its grazing angle and what the beam and pulse
            // cut out of it.
            const double range = 30 * posts[i];
            const Angle grazing = Angle::radians(std::atan(0.5) + 3000 / range);
            const double gamma = gamma_table(s.radar.frequency_hz, {})[source.data_base().default_class].ground,
                         area = cell_area(s.radar.antenna.beam, Angle::degrees(90), s.radar.pulse_extent_m(), range,
                                          grazing)
                                    .pulse_m2,
                         gain = elevation_pattern(s.radar.antenna, 3000 / range + range / (2 * 4.0 / 3 * 6371000)),
                         power =
                             received_power_w(s.radar, gain, gamma * std::sin(grazing.rad()) * area, range, Decibel(0));
            INFO(width_deg << " degrees, " << posts[i] << " posts");
            CHECK(power / s.radar.noise_power_w() < Sampling::quiet_above[i]);
            CHECK(power / s.radar.noise_power_w() > 0.2 * Sampling::quiet_above[i]);
        }
        // A tenth more reaches 3 % farther.
        s.radar.transmit_power_w *= 1.1;
        const std::array<double, 4> farther = quiet();
        for (std::size_t i = 0; i < posts.size(); ++i) {
            CHECK(farther[i] > posts[i]);
            CHECK(farther[i] < 1.08 * posts[i]);
        }
        // Ten times the power: ten times the echo. What may be set again over a stored echo makes no difference.
        s.radar.transmit_power_w = 500e3;
        CHECK(quiet()[0] == posts[2]);
        CHECK(quiet()[1] > posts[1]);
        const std::array<double, 4> stronger = quiet();
        const RadarParams before = s.radar;
        s.azimuth_bins = default_azimuth_bins(before);
        s.range_bin_m = default_range_bin_m(before);
        s.radar.noise_figure = Decibel(1);
        s.radar.bandwidth_hz = 1e5;
        s.radar.antenna.beam = Angle::degrees(1);
        s.radar.pulse_s = 0.2e-6;
        CHECK(quiet() == stronger);
        s.radar = before;
        s.azimuth_bins.reset();
        s.range_bin_m.reset();
    }
    s.radar.transmit_power_w = 50e3;
    // Nobody knows, of laws that hang on the angle; and classes may shine.
    const std::array<double, 4> bare = quiet();
    s.land = LandModel::ulaby_dobson;
    CHECK(quiet() == Sampling{}.quiet_posts);
    s.land = LandModel::constant_gamma;
    source.set_classes([](double, double) { return 1; });
    for (std::size_t i = 0; i < bare.size(); ++i) CHECK(quiet()[i] > bare[i]);
    s.far_shore = true;
    CHECK(quiet() == Sampling{}.quiet_posts);
    // From the ground up, and where a number of spokes is asked for, none of it counts.
    s.spokes_per_post = 1;
    CHECK(sampling_of(resolve(s, source), source.data_base()).above_posts == 0);
}

TEST_CASE("the default range reaches all ground of the raster up to the horizon, low or high, above or below",
          "[sampling]") {
    constexpr int posts = 101;
    constexpr double step = 30, middle = 50 * step;
    const auto peak = [](double x, double y) { return std::max(0.0, 1500 - std::hypot(x - middle, y + middle)); };
    const auto crater = [](double x, double y) { return std::min(1500.0, std::hypot(x - middle, y + middle)); };
    for (const bool high : {true, false})
        for (const double altitude_m : {1600.0, 3000.0, 20000.0}) {
            const auto height = [&](double x, double y) { return high ? peak(x, y) : crater(x, y); };
            MemorySource source(posts, posts, step, [&](double c, double r) { return height(c * step, -r * step); });
            Scene s = scene_of_one_gamma(middle, -middle, altitude_m, 1);
            s.range_m.reset();
            s.earth_k.reset();
            const double wide = std::hypot(middle, middle);
            double farthest = 0;
            for (int r = 0; r < posts; ++r)
                for (int c = 0; c < posts; ++c) {
                    const double x = c * step, y = -r * step, z = height(x, y);
                    farthest = std::max(farthest, std::hypot(x - middle, y + middle, altitude_m - z));
                }
            CAPTURE(high, altitude_m);
            const double range = *resolve(s, source).scene.range_m;
            CHECK(range >= farthest * (1 - 1e-9));
            CHECK(range <= std::hypot(wide, altitude_m) * (1 + 1e-9));
            s.display.kind = DisplayKind::gpi_true;  // whose ranges lie on the ground
            CHECK(*resolve(s, source).scene.range_m == Approx(wide));
        }
    // Level ground far beyond the horizon: the tangent's length, of the circle of 4/3 earth radii.
    MemorySource plain(201, 201, 10000, [](double, double) { return 0.0; });
    Scene s = scene_of_one_gamma(1000000, -1000000, 30000, 1);
    s.range_m.reset();
    const ResolvedScene found = resolve(s, plain);
    const double radius = 1 / found.earth.inverse_radius();
    CHECK(*found.scene.range_m == Approx(std::sqrt(30000 * (2 * radius + 30000))).epsilon(1e-6));
}
