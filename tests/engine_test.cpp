// The whole chain on drawn terrain, against closed forms.
#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>

#include "lib/engine.hpp"
#include "lib/front.hpp"
#include "lib/material.hpp"
#include "lib/radar_equation.hpp"
#include "lib/shade.hpp"
#include "tests/bare_scene.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;
using wedgescope::test::MemorySource;
using wedgescope::test::scene_of_one_gamma;
using wedgescope::test::simulate;
using wedgescope::test::void_post;

namespace {

double gamma_of(const Scene& s) {
    return std::pow(10.0, 0.1 * (s.gamma->db() + 5 * std::log10(s.radar.frequency_hz / 1e10)));
}

/// Sum of E r^2 / K over one azimuth bin, in units of gamma: solid angle of the ground seen there.
double solid_angle(const RunResult& r, std::size_t row) {
    const double k = radar_constant(r.scene.scene.radar) * gamma_of(r.scene.scene);
    double sum = 0;
    for (std::size_t j = 0; j < r.echo_w.grid.range_count(); ++j) {
        const double range = (static_cast<double>(r.echo_w.grid.range_bins.begin) + static_cast<double>(j) + 0.5) *
                             r.echo_w.grid.range_bin_m;
        sum += static_cast<double>(r.echo_w.row(row)[j]) * range * range / k;
    }
    return sum;
}

State state_at(const RunResult& r, std::size_t row, double range_m) {
    const auto j = static_cast<std::size_t>(range_m / r.state.grid.range_bin_m);
    return static_cast<State>(r.state.row(row)[j]);
}

}  // namespace

TEST_CASE("a flat plain returns the power of the closed radar equation", "[engine]") {
    MemorySource source(801, 801, 30, [](double, double) { return 100.0; });
    Scene s = scene_of_one_gamma(12000.3, -12000.7, 1600, 11500);
    s.earth_k.reset();
    s.radar.antenna = AntennaParams{};
    s.radar.beam_width_error = s.radar.pulse_length_error = true;
    s.azimuth_bins.reset();
    s.range_bin_m.reset();
    const RunResult r = simulate(s, source);
    // P = P_t G^2 g^2 lambda^2 sigma0 A / ((4 pi)^3 r^4 L), sigma0 = gamma sin(psi), A = r theta_2 (c tau / 2) sec(psi)
    const double height = 1500,
                 theta2 = s.radar.antenna.beam.rad() * std::sqrt(std::numbers::pi / (8 * std::numbers::ln2));
    const double extent = s.radar.pulse_extent_m(), dr = r.power_w.grid.range_bin_m;
    for (double want : {4000.0, 6000.0, 9000.0, 11000.0}) {
        const auto j = static_cast<std::size_t>(want / dr);
        // The pulse's middle: the cell holds the echoes from r - c tau/2 to r.
        const double range = (static_cast<double>(j) + 0.5) * dr - extent / 2;
        const double sine = height / range, cosine = std::sqrt(1 - sine * sine),
                     g = elevation_pattern(s.radar.antenna, std::asin(sine));
        const double power = radar_constant(s.radar) * g * g * gamma_of(s) * sine * range * theta2 * extent / cosine /
                             std::pow(range, 4);
        for (std::size_t row : {std::size_t{0}, std::size_t{123}, std::size_t{480}, std::size_t{900}}) {
            const double db = 10 * std::log10(static_cast<double>(r.power_w.row(row)[j]) / power);
            INFO("range " << range << " row " << row);
            CHECK(std::abs(db) < 0.05);  // dB; the spokes' linear pieces, and cos d at the bin's middle
        }
    }
}

TEST_CASE("an elevation pattern that bends within a post lights a plain as the radar equation has it", "[engine]") {
    AntennaParams narrow, skirts, measured;
    narrow.elevation = skirts.elevation = ElevationPattern::gaussian;
    narrow.knee = skirts.knee = {};
    narrow.width = Angle::degrees(1);
    narrow.tilt = Angle::degrees(30);
    skirts.width = Angle::degrees(5);
    measured.elevation = ElevationPattern::points;
    // A bent main lobe, a null, a side lobe 28 dB down.
    for (const auto& [depression_deg, gain_db] :
         {std::pair{-90, -30}, {0, 0}, {10, -45}, {12, -28}, {20, -35}, {90, -50}})
        measured.points.push_back({Angle::degrees(depression_deg), Decibel(gain_db)});
    struct Case {
        const char* name;
        const AntennaParams& antenna;
        double height_m, range_m, range_bin_m;
        std::size_t nearest;
    };
    // The narrow beam's middle meets the plain at 2 km, where 30 m are 0.43 degrees. On a mast it is the side lobes that posts
    // are long for: those of 150 m look 2 degrees deep.
    for (const Case& c : {Case{"narrow", narrow, 1000, 4000, 18.737, 60},
                          {"skirts", skirts, 30, 1000, 12, 3},
                          {"measured", measured, 30, 1000, 12, 3}}) {
        MemorySource source(301, 301, 30, [](double, double) { return 0.0; });
        Scene s = scene_of_one_gamma(4500.3, -4500.7, c.height_m, c.range_m);
        s.earth_k.reset();
        s.radar.antenna = c.antenna;
        s.range_bin_m = c.range_bin_m;
        for (const Quality quality : {Quality::draft, Quality::exact}) {
            s.quality = quality;
            const RunResult r = simulate(s, source);
            const PolarGrid& grid = r.echo_w.grid;
            // E = K gamma da (integral of g^2 / r^2 over the sine of elevation, h / r)
            std::size_t lit = 0;
            double most_off_db = 0;
            for (std::size_t j = c.nearest; j < grid.range_count(); ++j) {
                const double near = static_cast<double>(j) * grid.range_bin_m, step = grid.range_bin_m / 64;
                double sum = 0;
                for (int part = 0; part < 64; ++part) {
                    const double range = near + (part + 0.5) * step,
                                 g = elevation_pattern(s.radar.antenna, std::asin(c.height_m / range));
                    sum += g * g * c.height_m / std::pow(range, 4) * step;
                }
                // 30 dB below the beam's middle, 60 both ways.
                if (sum < 1e-6 * c.height_m / std::pow(near, 4) * grid.range_bin_m) continue;
                ++lit;
                const double echo = radar_constant(s.radar) * gamma_of(s) * grid.azimuth_step_rad() * sum;
                for (std::size_t row = 0; row < grid.azimuth_count(); row += 7)
                    most_off_db = std::max(most_off_db,
                                           std::abs(10 * std::log10(static_cast<double>(r.echo_w.row(row)[j]) / echo)));
            }
            INFO(c.name << ' ' << word(quality));
            CHECK(lit >= 10);
            CHECK(most_off_db < 0.05);
        }
    }
}

TEST_CASE("without a range all is in range that may be seen, of low ground and high", "[engine]") {
    // A plain below the sea, with the sensor 700 m above it: as far as its horizon, by a radius of the earth near the mean.
    MemorySource low(401, 401, 1000, [](double, double) { return -400.0; });
    Scene s = scene_of_one_gamma(200000.3, -200000.7, 300, 1000);
    s.range_m.reset();
    s.earth_k = 4.0 / 3;
    CHECK(*resolve(s, low).scene.range_m == Approx(std::sqrt(2 * 4.0 / 3 * 6371000 * 700)).epsilon(0.005));
    // On a plane all of the raster: its farthest corner, of which the ground is lower than below the sensor.
    MemorySource plateau(101, 101, 30,
                         [](double c, double r) { return std::hypot(c - 50, r - 50) < 40 ? 1000.0 : 0.0; });
    s = scene_of_one_gamma(1500.3, -1500.7, 12000, 1000);
    s.range_m.reset();
    s.earth_k.reset();
    CHECK(*resolve(s, plateau).scene.range_m == Approx(std::hypot(1500.3, 1500.7, 12000.0)).margin(1));
}

TEST_CASE("the last range bin holds all of its ground", "[engine]") {
    MemorySource source(801, 801, 2, [](double, double) { return 0.0; });
    Scene s = scene_of_one_gamma(800, -800, 60, 700);
    s.range_bin_m = 20;
    s.quality = GENERATE(Quality::normal, Quality::exact);
    const RunResult wide = simulate(s, source);
    for (const double range_m : {600.0, 601.0, 607.0, 619.9}) {
        s.range_m = range_m;
        const RunResult r = simulate(s, source);
        REQUIRE(r.echo_w.grid.range_count() == (range_m > 600 ? 31 : 30));
        for (std::size_t row = 0; row < r.echo_w.grid.azimuth_count(); ++row)
            for (std::size_t j = 27; j < r.echo_w.grid.range_count(); ++j) {
                INFO("range " << range_m << " row " << row << " column " << j);
                REQUIRE(r.echo_w.row(row)[j] == Approx(wide.echo_w.row(row)[j]).epsilon(1e-5));
                REQUIRE(r.state.row(row)[j] == wide.state.row(row)[j]);
            }
    }
}

TEST_CASE("a flat plain of one gamma is evenly bright under cos-csc2, and goes with the cosine under other laws",
          "[engine]") {
    // Physics 3: relative to the knee P goes with cos(d)^(2p - 1); no pattern is asked here, only the echoes compared.
    const double height = 1500;
    MemorySource source(801, 1201, 30, [](double, double) { return 100.0; });
    for (const double p : {0.5, 0.0, 1.0}) {
        Scene s;
        s.platform.xy = PointXY{12000.3, -34800.7};
        s.platform.altitude_m = 100 + height;
        s.range_m = 17100;
        s.sector = Sector{Angle::degrees(-2), Angle::degrees(2)};
        s.earth_k.reset();
        s.gamma = Decibel(-15);
        s.quality = Quality::exact;
        s.radar.antenna.elevation = p == 0 ? ElevationPattern::csc2 : ElevationPattern::cos_csc2;
        s.radar.antenna.exponent = p;
        s.radar.pulse_s = 0.2e-6;  // short beside the range at 60 degrees, 1732 m
        s.display.size = 64;
        const RunResult r = simulate(s, source);
        const double extent = s.radar.pulse_extent_m(), dr = r.power_w.grid.range_bin_m;
        // Mean over the azimuths, dB, and its depression, that of the pulse's middle.
        const auto at = [&](double depression_deg) {
            const double range = height / std::sin(depression_deg * std::numbers::pi / 180);
            const auto j = static_cast<std::size_t>((range + extent / 2) / dr);
            double sum = 0;
            for (std::size_t i = 0; i < r.power_w.grid.azimuth_count(); ++i)
                sum += static_cast<double>(r.power_w.row(i)[j]);
            const double middle = (static_cast<double>(j) + 0.5) * dr - extent / 2;
            return std::pair{10 * std::log10(sum), std::asin(height / middle)};
        };
        const auto [knee_db, knee_rad] = at(6);
        for (const double depression : {8.0, 12.0, 20.0, 30.0, 40.0, 50.0, 58.0}) {
            const auto [db, rad] = at(depression);
            const double law = (2 * p - 1) * 10 * std::log10(std::cos(rad) / std::cos(knee_rad));
            INFO("p " << p << ", depression " << depression << " deg, " << db - knee_db << " dB against " << law);
            CHECK(std::abs(db - knee_db - law) < 0.1);
            if (p == 0.5) CHECK(std::abs(db - knee_db) < 0.1);
        }
        // As physics 3 says: near 60 degrees p = 1 darkens by 3 dB, and CSC^2 brightens as much.
        CHECK(at(58).first - knee_db == Approx((2 * p - 1) * -2.75).margin(0.15));
    }
}

TEST_CASE("a pattern of points lights the ground as the law that it was measured on", "[engine]") {
    const auto hills = test::rolling(400, 200, 7);
    MemorySource source(301, 301, 30, [&](double c, double r) { return 500 + hills(c, r); });
    Scene s = scene_of_one_gamma(4500.0, -4500.0, 1500, 4000);
    s.radar.antenna = AntennaParams{};
    s.radar.antenna.tilt = Angle::degrees(3);
    const RunResult law = simulate(s, source);
    AntennaParams& antenna = s.radar.antenna;
    AntennaParams level = antenna;
    level.tilt = {};
    for (double beta = -30; beta <= 87.01; beta += 0.05)
        antenna.points.push_back(
            {Angle::degrees(beta), Decibel::from_ratio(elevation_pattern(level, Angle::degrees(beta).rad()))});
    antenna.elevation = ElevationPattern::points;
    const RunResult points = simulate(s, source);
    std::size_t lit = 0;
    for (std::size_t k = 0; k < law.power_w.cells.size(); ++k) {
        const auto a = static_cast<double>(law.power_w.cells[k]), b = static_cast<double>(points.power_w.cells[k]);
        if (a <= 0) continue;
        ++lit;
        REQUIRE(std::abs(10 * std::log10(b / a)) < 0.02);
    }
    CHECK(lit > 5000);
}

TEST_CASE("nearer than the minimum range nothing is received, and nothing else changes", "[engine]") {
    MemorySource source(401, 401, 30, [](double, double) { return 0.0; });
    Scene s = scene_of_one_gamma(6000, -6000, 200, 5000);
    s.quality = Quality::draft;  // only bits are compared
    s.azimuth_bins = 240;
    s.radar.pulse_s = 2e-6;  // 300 m
    s.receiver.noise = true;
    s.receiver.if_gain = Decibel(80);  // noise is white on the tube
    s.display.kind = GENERATE(DisplayKind::ppi, DisplayKind::gpi_true);
    s.display.rings = false;
    const auto received = [&](std::optional<double> minimum_range_m) {
        s.receiver.minimum_range_m = minimum_range_m;
        EngineParams params;
        params.threads = 1;
        params.beside_others = true;  // keeps what the picture is made from
        return run(resolve(s, source), source, params);
    };
    const RunResult open = received(0.0);
    for (const std::optional<double> least : {std::optional(1234.0), std::optional<double>(), std::optional(1e6)}) {
        const RunResult blanked = received(least);
        const double least_m = least.value_or(0.5 * 299792458.0 * 2e-6);
        std::size_t black = 0;
        for (std::size_t i = 0; i < open.received_w.grid.azimuth_count(); ++i)
            for (std::size_t j = 0; j < open.received_w.grid.range_count(); ++j) {
                const double middle = (static_cast<double>(j) + 0.5) * 50;
                const bool near =
                    (s.display.kind == DisplayKind::gpi_true ? std::hypot(middle, 200) : middle) < least_m;
                black += near;
                REQUIRE(blanked.received_w.row(i)[j] == (near ? 0.0F : open.received_w.row(i)[j]));
            }
        CHECK(black > 0);
        CHECK(blanked.power_w.cells == open.power_w.cells);
        CHECK(blanked.state.cells == open.state.cells);
        CHECK(blanked.scope.state == open.scope.state);
        const auto dark = [](const RunResult& r) { return std::count(r.scope.grey.begin(), r.scope.grey.end(), 0); };
        if (least_m > 500) CHECK(dark(blanked) > dark(open));
        if (least_m > 5000) CHECK(blanked.scope.lit == 0);
    }
}

TEST_CASE("a sector that all but closes the circle has the power of the full circle, whatever its skirt goes round",
          "[engine]") {
    const auto hills = test::rolling(300, 150, 9);
    MemorySource source(301, 301, 30, [&](double c, double r) { return 300 + hills(c, r); });
    Scene s = scene_of_one_gamma(4500, -4500, 700, 4000);
    s.quality = Quality::draft;  // only bits are compared
    s.radar.antenna.beam = Angle::degrees(4);
    s.azimuth_bins = 360;
    const RunResult whole = run(resolve(s, source), source, {});
    for (const auto& [from, to] : {std::pair(-0.9, 358.9), {-3.0, 351.0}, {359.0, 717.0}, {2.0, 358.0}}) {
        s.sector = Sector{Angle::degrees(from), Angle::degrees(to)};
        const RunResult part = run(resolve(s, source), source, {});
        const PolarGrid& shown = part.power_w.grid;
        REQUIRE(shown.azimuth_count() > 300);
        for (std::size_t i = 0; i < shown.azimuth_count(); ++i) {
            const auto row = static_cast<std::size_t>((shown.azimuth_bins.begin + static_cast<std::int64_t>(i)) % 360);
            CAPTURE(from, i, row);
            REQUIRE(std::equal(part.power_w.row(i), part.power_w.row(i) + shown.range_count(), whole.power_w.row(row)));
        }
    }
}

TEST_CASE("without noise and speckle the picture is that of the received power, which need not be made", "[engine]") {
    const auto hills = test::rolling(300, 150, 3);
    MemorySource source(301, 301, 30, [&](double c, double r) { return 300 + hills(c, r); });
    Scene s = scene_of_one_gamma(4500, -4500, 900, 2400);
    s.quality = Quality::draft;  // only bits are compared
    s.azimuth_bins = 400;
    s.receiver.if_gain = Decibel(70);
    s.receiver.minimum_range_m = 1000.0;
    s.display.kind = GENERATE(DisplayKind::ppi, DisplayKind::gpi);
    s.display.pixel_fill = GENERATE(PixelFill::interpolate, PixelFill::holes);
    s.display.size = GENERATE(600, 40);  // more pixels than cells, and fewer
    const ResolvedScene scene = resolve(s, source);
    EngineParams params;
    params.threads = 2;
    params.beside_others = true;  // keeps what the picture was made from
    const RunResult r = run(scene, source, params);
    // Four looks at a cell for each pixel: more than there are cells, or fewer.
    CHECK(r.received_w.cells.empty() == (s.display.size == 40));
    const RunResult measured = measure(scene, source, {}, {});
    REQUIRE(measured.received_w.grid == r.power_w.grid);
    const Picture drawn = picture(measured.received_w, r.state, display_setting(scene), Receiver(s.receiver, s.radar));
    CHECK(std::count(drawn.grey.begin(), drawn.grey.end(), 0) < static_cast<std::ptrdiff_t>(drawn.grey.size()));
    CHECK(r.scope.grey == drawn.grey);
    CHECK(r.scope.lit == drawn.lit);
}

TEST_CASE("the sum of E r^2 is gamma times the solid angle of the ground, whatever its slopes", "[engine][long]") {
    const auto hills = test::rolling(400, 200, 7);
    MemorySource source(601, 601, 30, [&](double c, double r) { return 500 + hills(c, r); });
    Scene s = scene_of_one_gamma(9000.0, -9000.0, 1500, 12500);
    s.earth_k.reset();
    s.range_bin_m = 10;
    const RunResult r = simulate(s, source);
    // The silhouette of each azimuth bin from the posts themselves: highest elevation on fine rays, bilinear.
    for (std::size_t row = 0; row < 360; row += 17) {
        double sum = 0;
        constexpr int rays = 24;
        for (int i = 0; i < rays; ++i) {
            const double azimuth = (static_cast<double>(row) + (i + 0.5) / rays) * std::numbers::pi / 180;
            double most = -1;
            for (double t = 30; t < 12200; t += 3) {
                const double c = 300 + t * std::sin(azimuth) / 30, q = 300 - t * std::cos(azimuth) / 30;
                if (c < 0 || q < 0 || c > 600 || q > 600) break;
                const double c0 = std::min(std::floor(c), 599.0), q0 = std::min(std::floor(q), 599.0), u = c - c0,
                             v = q - q0;
                const auto z = [&](double cc, double rr) {
                    return static_cast<double>(static_cast<float>(500 + hills(cc, rr)));
                };
                const double height = (1 - u) * (1 - v) * z(c0, q0) + u * (1 - v) * z(c0 + 1, q0) +
                                      (1 - u) * v * z(c0, q0 + 1) + u * v * z(c0 + 1, q0 + 1);
                most = std::max(most, (height - 1500) / std::hypot(height - 1500, t));
            }
            sum += (most + 1) / rays;
        }
        INFO("azimuth bin " << row);
        CHECK(solid_angle(r, row) / (sum * std::numbers::pi / 180) == Approx(1).epsilon(0.003));
    }
}

TEST_CASE("what comes back first, from ground across the line of sight, lies in the bins where it does", "[engine]") {
    // A slope below the sensor: the nearest ground lies uphill, and about it ranges hardly change over several posts.
    constexpr double slope = 0.35, height = 445, post_m = 20, bin_m = 9, x0 = 2007.3, y0 = -2004.1;
    const auto ground_m = [](double east_m) { return 300 + slope * (east_m - 2000); };
    MemorySource source(201, 201, post_m, [&](double column, double) { return ground_m(column * post_m); });
    Scene s = scene_of_one_gamma(x0, y0, ground_m(x0) + height, 1400);
    s.earth_k.reset();
    s.azimuth_bins = 240;
    s.range_bin_m = bin_m;
    s.quality = Quality::exact;
    const RunResult r = simulate(s, source);
    const double k = radar_constant(s.radar) * gamma_of(s), step_rad = 2 * std::numbers::pi / 240;
    double worst_db = 0, sum = 0;
    std::size_t cells = 0;
    for (std::size_t row = 0; row < 240; ++row) {
        // Five rays in the bin, in steps of 2 cm as far as ground is nearer than right below.
        std::vector<double> watts(r.echo_w.grid.range_count(), 0);
        for (int ray = 0; ray < 5; ++ray) {
            const double rise = slope * std::sin((static_cast<double>(row) + (ray + 0.5) / 5) * step_rad);
            double last_sine = -1;
            for (double arc = 0.01; arc < 2 * height * rise; arc += 0.02) {
                const double down = height - rise * arc, range = std::hypot(arc, down), sine = -down / range;
                watts[static_cast<std::size_t>(range / bin_m)] +=
                    k / (range * range) * (sine - last_sine) * step_rad / 5;
                last_sine = sine;
            }
        }
        // The bins nearer than what lies right below, to which nothing else returns.
        for (std::size_t j = 0; static_cast<double>(j + 1) * bin_m < height; ++j) {
            const double found = static_cast<double>(r.echo_w.row(row)[j]);
            if (!(watts[j] > 1e-3 * k * step_rad / (height * height))) continue;
            const double db = std::abs(10 * std::log10(found / watts[j]));
            worst_db = std::max(worst_db, db);
            sum += db * db;
            ++cells;
        }
    }
    INFO("worst " << worst_db << " dB, RMS " << std::sqrt(sum / static_cast<double>(cells)) << " dB");
    CHECK(cells > 100);
    CHECK(worst_db < 0.3);
    CHECK(std::sqrt(sum / static_cast<double>(cells)) < 0.09);  // 0.23, and 1.6 at worst, if laid out by their ends
}

TEST_CASE("a ridge casts a shadow as long as the ray over its crest says", "[engine]") {
    // North of the sensor a wall of 200 m at 3 km, one post thick, across all columns; sensor 500 m up.
    MemorySource source(401, 401, 30, [](double, double r) { return r == 300 ? 200.0 : 0.0; });
    Scene s = scene_of_one_gamma(6000, -12000, 500, 11000);
    s.earth_k.reset();
    s.azimuth_bins = 720;
    const RunResult r = simulate(s, source);
    // North: post row 400 is the sensor, row 300 is 3000 m away. The ray over 200 m at 3000 m meets the ground at 5000
    // m.
    const double crest = std::hypot(3000, 300), end = std::hypot(5000, 500);
    CHECK(state_at(r, 0, 2500) == State::seen);
    CHECK(state_at(r, 0, crest + 60) == State::shadow);
    CHECK(state_at(r, 0, end - 60) == State::shadow);
    CHECK(state_at(r, 0, end + 60) == State::seen);
    for (double range = crest + 110; range < end - 50; range += 50)
        CHECK(r.power_w.row(0)[static_cast<std::size_t>(range / 50)] == 0);
    // At azimuth 45 degrees the wall stands sqrt(2) farther: shadow from 4243 m to 7071 m of ground.
    const std::size_t diagonal = 90;
    CHECK(state_at(r, diagonal, std::hypot(7071, 500) - 90) == State::shadow);
    CHECK(state_at(r, diagonal, std::hypot(7071, 500) + 90) == State::seen);
}

TEST_CASE("on a round earth the sea is seen to the horizon and no farther", "[engine]") {
    MemorySource source(1201, 31, 100, [](double, double) { return 0.0; });
    Scene s = scene_of_one_gamma(500, -1500, 300, 115000);
    s.sector = Sector{Angle::degrees(89.5), Angle::degrees(90.5)};
    s.range_bin_m = 200;
    const RunResult r = simulate(s, source);
    // 4/3 earth: the tangent length is sqrt(h (2 Re + h)).
    const double re = 4.0 / 3 * 6371008.7714, horizon = std::sqrt(300 * (2 * re + 300));
    const auto last = [&] {
        double far = 0;
        for (std::size_t j = 0; j < r.state.grid.range_count(); ++j)
            if (r.state.row(0)[j] == static_cast<std::uint8_t>(State::seen)) far = static_cast<double>(j + 1) * 200;
        return far;
    }();
    CHECK(last ==
          Approx(horizon).margin(400));  // two bins: the last metres before the tangent rise by less than a rounding
    CHECK(state_at(r, 0, horizon + 2000) == State::shadow);
}

TEST_CASE("all five states stand where the drawn terrain puts them", "[engine]") {
    // Looking east: plain, a void from 3 to 4 km, low ground behind it, a wall of 300 m at 6 km, its shadow, the
    // raster's edge at 9 km.
    MemorySource source(401, 101, 30, [](double c, double) {
        const double x = (c - 100) * 30;
        if (x > 3000 && x < 4000) return static_cast<double>(void_post);
        if (x == 6000) return 300.0;
        return 0.0;
    });
    Scene s = scene_of_one_gamma(3000, -1500, 1000, 12000);
    s.earth_k.reset();
    s.sector = Sector{Angle::degrees(89), Angle::degrees(91)};
    s.range_start_m = 500;
    const RunResult r = simulate(s, source);
    const auto slant = [](double x) { return std::hypot(x, 1000); };
    CHECK(state_at({r}, 0, 0) == static_cast<State>(r.state.row(0)[0]));
    const auto at = [&](double x) {
        return static_cast<State>(r.state.row(0)[static_cast<std::size_t>(slant(x) / 50) - 10]);
    };
    CHECK(static_cast<State>(r.state.row(0)[0]) == State::outside);  // 500 m: nearer than the ground
    CHECK(at(1500) == State::seen);
    CHECK(at(3500) == State::no_data);
    // The void's posts may be as high as its rim, 0 m: seen beyond it is level with that, hence unknown until it rises
    // above.
    CHECK(at(5000) == State::seen);
    CHECK(at(7000) == State::shadow);
    CHECK(at(8500) == State::shadow);  // ray over 300 m at 6000 m meets the ground at 8571 m
    CHECK(at(8800) == State::seen);
    CHECK(at(9500) == State::no_data);
    std::uint64_t cells = 0;
    for (auto n : r.report.states) cells += n;
    CHECK(cells == r.state.grid.cells());
}

TEST_CASE("ground that a void may hide is unknown and keeps its echo", "[engine]") {
    // A rim of 200 m before the void; behind it the plain could be hidden by ground of 200 m anywhere in the void.
    MemorySource source(401, 101, 30, [](double c, double) {
        const double x = (c - 100) * 30;
        if (x > 3000 && x < 4000) return static_cast<double>(void_post);
        return x == 3000 ? 200.0 : 0.0;
    });
    Scene s = scene_of_one_gamma(3000, -1500, 1000, 8500);
    s.earth_k.reset();
    s.sector = Sector{Angle::degrees(89), Angle::degrees(91)};
    const RunResult r = simulate(s, source);
    const auto cell = [](double x) { return static_cast<std::size_t>(std::hypot(x, 1000) / 50); };
    // 200 m at the void's far end (post at 4020 m) hides the plain up to 4020 / 0.8 = 5025 m.
    CHECK(static_cast<State>(r.state.row(0)[cell(4500)]) == State::unknown);
    CHECK(r.power_w.row(0)[cell(4500)] > 0);
    CHECK(static_cast<State>(r.state.row(0)[cell(4900)]) == State::unknown);
    CHECK(static_cast<State>(r.state.row(0)[cell(5200)]) == State::seen);
}

TEST_CASE("a tower within a void may hide what lies behind all four cells round it", "[engine]") {
    // A post of 400 m, all round it void; a spoke from the south-west may leave a cell of it by a side, before the line ahead.
    MemorySource source(201, 201, 30, [](double c, double r) {
        if (c == 75 && r == 125) return 400.0;
        return c > 70 && c < 80 && r > 120 && r < 130 ? static_cast<double>(void_post) : 0.0;
    });
    Scene s = scene_of_one_gamma(30 * 60.3, -30 * 140.7, 300, 2500);
    s.earth_k.reset();
    const RunResult r = simulate(s, source);
    // Bins that cross one of the four cells round the tower from side to side.
    const double east = 75 - 60.3, north = 140.7 - 125;
    const auto azimuth = [](double x, double y) { return std::atan2(x, y) * 180 / std::numbers::pi; };
    const double first = azimuth(east - 1, north + 1), last = azimuth(east + 1, north - 1);
    std::size_t rows = 0;
    for (std::size_t row = 0; row < 90; ++row) {
        if (static_cast<double>(row) < first || static_cast<double>(row) + 1 > last) continue;
        ++rows;
        INFO("row " << row);
        CHECK(static_cast<State>(r.state.row(row)[static_cast<std::size_t>(std::hypot(1500, 300) / 50)]) ==
              State::unknown);
    }
    CHECK(rows >= 4);
}

TEST_CASE("a wall returns gamma_w of its class over its own solid angle, the ground its own", "[engine]") {
    // A wall of metal, 40 m high, two posts thick, 3 km north on a plain of soil.
    MemorySource source(201, 201, 30, [](double, double) { return 0.0; });
    source.set_culture_height([](double, double r) { return r == 100 || r == 99 ? 40.0 : 0.0; });
    source.set_classes([](double, double r) { return r == 100 || r == 99 ? 15 : 4; });
    Scene s = scene_of_one_gamma(3000, -6000, 1000, 5500);
    s.earth_k.reset();
    s.gamma.reset();
    s.sector = Sector{Angle::degrees(-1), Angle::degrees(1)};
    s.range_bin_m = 400;
    const RunResult r = simulate(s, source);
    const double law = std::pow(10.0, 0.1 * 5 * std::log10(1.65)), metal = std::pow(10.0, 1.5) * law,
                 soil = std::pow(10.0, -1.7) * law;
    // From the ground post before the wall (2970 m) to its top edges: surface 40 m at 3000 m and 3030 m.
    const auto sine = [](double x, double z) { return (z - 1000) / std::hypot(x, z - 1000); };
    const double wall = metal * (std::max(sine(3000, 40), sine(3030, 40)) - sine(2970, 0));
    const double range = std::hypot(3000, 960);
    double sum = 0;
    for (std::size_t j = 0; j < r.echo_w.grid.range_count(); ++j) {
        const double from = static_cast<double>(j) * 400;
        if (from <= 3200 && from + 400 > 3100) sum += static_cast<double>(r.echo_w.row(0)[j]);
    }
    const double k = radar_constant(s.radar) * std::numbers::pi / 180;
    // The ground in the same 400-m bin adds soil * d(sin e).
    const double ground = soil * (sine(2970, 0) - (-1000 / 2800.0)) * std::pow(range / 3000, 2);
    CHECK(sum * range * range / k == Approx(wall + ground).epsilon(0.03));
}

TEST_CASE("a sector returns what the full circle returns there", "[engine]") {
    const auto hills = test::rolling(600, 150, 5);
    MemorySource source(301, 301, 30, [&](double c, double r) { return 700 + hills(c, r); });
    Scene s = scene_of_one_gamma(4500, -4400, 1500, 5000);
    s.radar.beam_width_error = s.radar.pulse_length_error = true;
    const RunResult full = simulate(s, source);
    // Once round, over north and over the turn at 180 degrees.
    double sum = 0, whole = 0;
    for (const float power : full.power_w.cells) whole += static_cast<double>(power);
    std::vector<int> seen(360, 0);
    for (const auto& [from, to] :
         {std::pair(-20.0, 33.0), {33.0, 170.0}, {170.0, 200.0}, {-160.0, -95.0}, {-95.0, -20.0}}) {
        s.sector = Sector{Angle::degrees(from), Angle::degrees(to)};
        const RunResult part = simulate(s, source);
        REQUIRE(part.power_w.grid.azimuth_bins.size() == std::llround(to - from));
        for (std::size_t i = 0; i < part.power_w.grid.azimuth_count(); ++i) {
            const auto row =
                static_cast<std::size_t>((part.power_w.grid.azimuth_bins.begin + static_cast<std::int64_t>(i)) % 360);
            const std::vector<float> a(part.power_w.row(i), part.power_w.row(i) + part.power_w.grid.range_count());
            const std::vector<float> b(full.power_w.row(row), full.power_w.row(row) + full.power_w.grid.range_count());
            CHECK(a == b);
            ++seen[row];
            for (const float power : a) sum += static_cast<double>(power);
        }
    }
    CHECK(seen == std::vector<int>(360, 1));
    CHECK(whole > 0);
    CHECK(sum == Approx(whole).epsilon(1e-12));
}

TEST_CASE("a point reflector is painted from its range to c tau/2 behind, and 0.4075 B sqrt(M) wide at M dB down",
          "[engine][long]") {
    // One post of metal, 60 m high, 6 km north on calm water, seen by a 2-degree beam in fine bins.
    MemorySource source(301, 301, 30, [](double, double) { return 0.0; });
    const auto mast = [](double c, double r) { return c == 150 && r == 80; };
    source.set_culture_height([&](double c, double r) { return mast(c, r) ? 60.0 : 0.0; });
    source.set_classes([&](double c, double r) { return mast(c, r) ? 15 : 0; });
    Scene s = scene_of_one_gamma(4500, -8400, 400, 8000);
    s.earth_k.reset();
    s.gamma.reset();
    s.radar.beam_width_error = s.radar.pulse_length_error = true;
    s.radar.antenna.beam = Angle::degrees(2);
    s.azimuth_bins = 7200;
    s.radar.pulse_s = 1e-6;
    s.range_bin_m = 10;
    s.sector = Sector{Angle::degrees(-5), Angle::degrees(5)};
    const RunResult r = simulate(s, source);
    const auto middle = r.power_w.grid.azimuth_count() / 2;
    // Range: the near face stands between 5970 and 6000 m; what comes back goes on for c tau/2.
    const double extent = s.radar.pulse_extent_m();
    // (The feet of the post's back, 20 dB weaker, are left out.)
    const auto row = [&](std::size_t j) { return static_cast<double>(r.power_w.row(middle)[j]); };
    double first = 0, last = 0, most = 0;
    for (std::size_t j = 0; j < r.power_w.grid.range_count(); ++j) most = std::max(most, row(j));
    for (std::size_t j = 0; j < r.power_w.grid.range_count(); ++j)
        if (row(j) > 1e-2 * most) {
            if (first == 0) first = static_cast<double>(j) * 10;
            last = static_cast<double>(j + 1) * 10;
        }
    CHECK(first == Approx(std::hypot(5970, 400)).margin(20));               // two bins
    CHECK(last == Approx(std::hypot(6000, 340) + extent).margin(20 + 10));  // and the post's own depth
    // Azimuth: how far to either side the power is within M dB of its peak.
    const auto j = static_cast<std::size_t>((std::hypot(6000, 340) + extent / 2) / 10);
    double peak = 0;
    for (std::size_t i = 0; i < r.power_w.grid.azimuth_count(); ++i)
        peak = std::max(peak, static_cast<double>(r.power_w.row(i)[j]));
    for (const double m_db : {3.0, 6.0, 12.0, 20.0}) {
        std::size_t wide = 0;
        for (std::size_t i = 0; i < r.power_w.grid.azimuth_count(); ++i)
            wide += static_cast<double>(r.power_w.row(i)[j]) >= peak * std::pow(10.0, -0.1 * m_db);
        // The post itself, as the surface ramps up to it from both sides, is up to 60 m wide: 0.57 degrees; its middle
        // half counts most.
        const double width = static_cast<double>(wide) * 0.05, beam = 2 * std::cos(std::asin(400 / 6010.0));
        const double expected = 0.4075 * (2 / std::cos(std::asin(400 / 6010.0))) * std::sqrt(m_db);
        INFO(m_db << " dB down, beam " << beam);
        CHECK(width == Approx(expected).margin(0.12));
    }
}

TEST_CASE("on a flat plain the mean depression of a cell is that of its range", "[engine]") {
    // The further channel of the cells, straight from the front.
    MemorySource source(401, 401, 30, [](double, double) { return 0.0; });
    Scene s = scene_of_one_gamma(6000, -6000, 1500, 5500);
    s.earth_k.reset();
    const ResolvedScene resolved = resolve(s, source);
    const DataBase& db = source.data_base();
    const SpokeMap map(db, {Geometry::grid, resolved.nadir, 0, 0, std::nullopt, 6000});
    const SpokeGrid grid(db, map, sampling(Quality::exact, GroundCover::bare, 50), 360);
    const PatternTable pattern(s.radar.antenna);
    const ClassLaws laws(std::vector<ClassGamma>(16, ClassGamma{1, 1}));
    const Quanta cells = quanta({0, 110}, 50, 1, 1, grid.azimuth_step_rad(), 1);
    SweepScene sweep;
    sweep.data_base = &db;
    sweep.grid = &grid;
    sweep.sampling = sampling(Quality::exact, GroundCover::bare, 50);
    sweep.sensor_m = 1500;
    sweep.nadir_patch = &resolved.nadir_patch;
    sweep.max_arc_m = 6000;
    sweep.range_bin_m = 50;
    sweep.with_depression = true;
    sweep.pattern = &pattern;
    sweep.constant = 1;
    sweep.laws = &laws;
    sweep.source = &source;
    const Wedge wedge = grid.wedge(0, {0, 360});
    WedgeCells sums(360, cells, 2);
    for (const SpokeRun& run : wedge.runs) {
        Front front(sweep, run, sums);
        const Interval lines{0, grid.line_count(run.quadrant)};
        const Chunk chunk = source.load(front.request(lines, nullptr));
        front.advance(lines, &chunk);
        front.finish();
    }
    for (std::size_t j = 40; j < 105; ++j) {
        const double range = (static_cast<double>(j) + 0.5) * 50;
        CHECK(sums.watts(77, j, 1) / sums.watts(77, j) * 90 ==
              Approx(std::asin(1500 / range) * 180 / std::numbers::pi).margin(0.6));  // degrees; half a bin
    }
}
