// The numbers of the sweep at the ends of their ranges, against closed forms and the reference in long double: sensors from
// 1 m to 30 km up, 0.3-m to 1-km posts, 800 km, grazing to 1e-6 rad, places far from the origin, sums of a thousand
// million echoes. What was found, with the bounds: docs/numerics.md.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "lib/backscatter.hpp"
#include "lib/deposit.hpp"
#include "lib/engine.hpp"
#include "lib/material.hpp"
#include "lib/sea.hpp"
#include "lib/shade.hpp"
#include "tests/bare_scene.hpp"
#include "tests/reference/long_walk.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;
using test::MemorySource;
using test::simulate;

namespace {

using Real = long double;
constexpr Real pi = std::numbers::pi_v<long double>;
constexpr Real round_m = 4.0L / 3 * 6371008.7714L;  // the effective earth of grid geometry

/// A bare set over one gamma: a cell holds K gamma sum of d(sin e) da / r^2.
Scene bare_scene(const MemorySource& source, double column, double row, double range_m, double range_bin_m) {
    const DataBase& db = const_cast<MemorySource&>(source).data_base();
    Scene s = test::bare_scene(db.origin_x + column * db.step_x, db.origin_y + row * db.step_y, 0, range_m);
    s.platform.altitude_above = AltitudeAbove::ground;
    s.geometry = Geometry::grid;
    s.range_bin_m = range_bin_m;
    s.gamma = Decibel(-15);
    return s;
}

/// Watts of a sum of d(sin e) / r^2 over an azimuth bin.
double unit_w(const Scene& s, std::int64_t azimuth_bins) {
    const double gamma = std::pow(10.0, 0.1 * (s.gamma->db() + 5 * std::log10(s.radar.frequency_hz / 1e10)));
    return radar_constant(s.radar) * gamma * 2 * std::numbers::pi / static_cast<double>(azimuth_bins);
}

double decibels(double power, Real truth) { return 10 * std::log10(power / static_cast<double>(truth)); }

/// Differences from the truth of the cells of some rows.
struct Errors {
    double total_db = 0, rms_db = 0, worst_db = 0;
    std::size_t cells = 0;
};
template <class Truth>
Errors errors(const RunResult& r, const std::vector<std::size_t>& rows, const Truth& truth) {
    Errors e;
    double ours = 0, squares = 0;
    Real theirs = 0;
    for (const std::size_t row : rows) {
        const std::vector<Real> wanted = truth(row);
        REQUIRE(wanted.size() == r.echo_w.grid.range_count());
        Real most = 0;
        for (const Real w : wanted) most = std::max(most, w);
        for (std::size_t j = 0; j < wanted.size(); ++j) {
            const double got = static_cast<double>(r.echo_w.row(row)[j]);
            REQUIRE(std::isfinite(got));
            if (wanted[j] < 0) continue;  // not asked
            ours += got;
            theirs += wanted[j];
            if (!(wanted[j] > most * 1e-18L)) continue;
            const double db = got > 0 ? decibels(got, wanted[j]) : 999;
            squares += db * db;
            e.worst_db = std::max(e.worst_db, std::abs(db));
            ++e.cells;
        }
    }
    e.total_db = decibels(ours, theirs);
    e.rms_db = std::sqrt(squares / static_cast<double>(e.cells));
    return e;
}

/// A level plain: d(sin e) / r^2 = h dr / r^4 from r = h on. Cells that the range ends in the middle of are left out.
std::vector<Real> plain_returns(Real height_m, Real bin_m, std::size_t bins, Real unit) {
    std::vector<Real> out;
    for (std::size_t j = 0; j < bins; ++j) {
        const Real from = std::max(static_cast<Real>(j) * bin_m, height_m), to = static_cast<Real>(j + 1) * bin_m;
        // h/3 (a^3 - b^3) with a = 1/from, b = 1/to, without cancellation.
        const Real a = 1 / from, b = 1 / to;
        out.push_back(to > from ? unit * height_m / 3 * ((to - from) * a * b) * (a * a + a * b + b * b) : 0);
    }
    return out;
}

}  // namespace

TEST_CASE("the ground below a sensor returns its power however long the posts and however low the sensor",
          "[numerics]") {
    // A piece of surface that begins a metre away and ends a kilometre away is no piece at the mean of the two.
    for (const double post_m : {0.3, 30.0, 1000.0})
        for (const double up_m : {1.0, 30.0, 1000.0, 30000.0})
            for (const DisplayKind kind : {DisplayKind::gpi, DisplayKind::gpi_true}) {
                // Bins of ground range a quarter of a metre long, 30 km below: lost in their quanta (docs/numerics.md).
                if (kind == DisplayKind::gpi_true && up_m > 1e4 * post_m) continue;
                MemorySource source(161, 161, post_m, [](double, double) { return 100; });
                const bool by_ground = kind == DisplayKind::gpi_true;
                const double reach_ground_m = 75 * post_m, reach_m = std::hypot(reach_ground_m, up_m),
                             bin_m = (by_ground ? reach_ground_m : reach_m) / 100;
                Scene s = bare_scene(source, 80.3, 80.2, reach_m, bin_m);
                s.platform.altitude_m = up_m;
                s.earth_k.reset();
                s.display.kind = kind;
                const RunResult r = simulate(s, source);
                const Real unit = unit_w(s, 360);
                const Errors e = errors(r, {0, 44, 135, 200, 301}, [&](std::size_t) {
                    std::vector<Real> all = plain_returns(up_m, bin_m, r.echo_w.grid.range_count(), unit);
                    if (by_ground) {
                        // From one arc to the next instead.
                        const auto below = [&](Real arc) {
                            const Real slant = std::hypot(arc, static_cast<Real>(up_m));
                            return unit * up_m / 3 / (slant * slant * slant);
                        };
                        for (std::size_t j = 0; j < all.size(); ++j)
                            all[j] = below(static_cast<Real>(j) * bin_m) - below(static_cast<Real>(j + 1) * bin_m);
                    }
                    // Not what lies beside the raster.
                    for (std::size_t j = 0; j < all.size(); ++j)
                        if (by_ground && static_cast<double>(j + 1) * bin_m > reach_ground_m) all[j] = -1;
                    return all;
                });
                INFO(post_m << "-m posts, sensor " << up_m << " m up, " << word(kind) << ": total " << e.total_db
                            << " dB, RMS " << e.rms_db << " dB, worst " << e.worst_db << " dB");
                CHECK(std::abs(e.total_db) < 0.05);
                CHECK(e.rms_db < 0.02);
                CHECK(e.worst_db < (by_ground ? 0.15 : 0.1));
            }
}

TEST_CASE("the first bin of ground range holds what a far sensor gets of it, however many posts it is wide",
          "[numerics]") {
    // Its quantum was that of ground a metre away: from 10 km up nothing was left.
    struct Case {
        double post_m, bin_m, up_m;
    };
    for (const Case& c : {Case{5, 15, 3000}, Case{5, 15, 10000}, Case{30, 75, 10000}, Case{30, 19, 1000}}) {
        CAPTURE(c.post_m, c.bin_m, c.up_m);
        MemorySource source(161, 161, c.post_m, [](double, double) { return 100; });
        Scene s = bare_scene(source, 80.3, 80.2, 8 * c.bin_m, c.bin_m);
        s.platform.altitude_m = c.up_m;
        s.earth_k.reset();
        s.display.kind = DisplayKind::gpi_true;
        const RunResult r = simulate(s, source);
        for (std::size_t row = 0; row < r.echo_w.grid.azimuth_count(); row += 7) {
            const float* const echo = r.echo_w.row(row);
            // Rings of one width far below hold 1, 3, 5 parts.
            CHECK(std::abs(decibels(3 * static_cast<double>(echo[0]), static_cast<Real>(echo[1]))) < 0.1);
        }
    }
}

TEST_CASE("a law that hangs on the angle follows it from below a low sensor outwards", "[numerics]") {
    // Of the first post alone angles go from the vertical to 4 degrees of grazing.
    for (const double up_m : {2.0, 8.0, 30.0}) {
        MemorySource source(161, 161, 30, [](double, double) { return 100; });
        const double bin_m = 0.5 * up_m;
        Scene s = bare_scene(source, 80.3, 80.2, 60 * bin_m, bin_m);
        s.platform.altitude_m = up_m;
        s.earth_k.reset();
        s.gamma.reset();
        s.land = LandModel::ulaby_dobson;  // soil
        const RunResult r = simulate(s, source);
        const auto factor = [&](double sine) {
            const double held = std::max(sine, std::sin(ulaby_dobson_least.rad()));
            const Decibel sigma0 = ulaby_dobson_sigma0(UlabyDobsonClass::soil, s.radar.frequency_hz,
                                                       s.radar.polarisation, Angle::radians(std::asin(held)));
            return sigma0.ratio() / held;
        };
        const Real unit = radar_constant(s.radar) * 2 * pi / 360;
        const Errors e = errors(r, {0, 44, 135, 200, 301}, [&](std::size_t) {
            std::vector<Real> all = plain_returns(up_m, bin_m, r.echo_w.grid.range_count(), unit);
            for (std::size_t j = 0; j < all.size(); ++j) {
                if (!(all[j] > 0)) continue;
                // The law's mean over the cell, by what falls on its parts.
                constexpr std::size_t parts = 200;
                const std::vector<Real> lit = plain_returns(up_m, bin_m / parts, (j + 1) * parts, 1);
                Real sum = 0, weight = 0;
                for (std::size_t i = j * parts; i < lit.size(); ++i) {
                    const double middle = (static_cast<double>(i) + 0.5) * bin_m / parts;
                    sum += lit[i] * static_cast<Real>(factor(std::min(1.0, up_m / middle)));
                    weight += lit[i];
                }
                all[j] *= sum / weight;
            }
            return all;
        });
        INFO("sensor " << up_m << " m up: total " << e.total_db << " dB, RMS " << e.rms_db << " dB, worst "
                       << e.worst_db << " dB");
        CHECK(std::abs(e.total_db) < 0.2);
        CHECK(e.rms_db < 0.05);
        CHECK(e.worst_db < 0.4);
    }
}

TEST_CASE("a lake below the sensor mirrors what its law has from angle to angle", "[numerics]") {
    // Calm water returns within 12 degrees of the vertical alone, most within 2: a post of 30 m covers up to 45 of them.
    for (const WaterModel water : {WaterModel::calm, WaterModel::nrl})
        for (const double up_m : {30.0, 100.0, 400.0, 1600.0}) {
            MemorySource source(161, 161, 30, [](double, double) { return 100; });
            source.editable().default_class = material_by_name("material", "water");
            const double bin_m = 0.5 * up_m;
            Scene s = bare_scene(source, 80.3, 80.2, std::min(60 * bin_m, std::hypot(2300.0, up_m)), bin_m);
            s.platform.altitude_m = up_m;
            s.earth_k.reset();
            s.gamma.reset();
            s.water = water;
            s.sea_state = water == WaterModel::calm ? 0 : 2;
            const RunResult r = simulate(s, source);
            const BackscatterLaw law = water == WaterModel::calm
                                           ? sea_calm_law(s.radar.frequency_hz, s.radar.polarisation)
                                           : sea_nrl_law(s.radar.frequency_hz, s.radar.polarisation, 2);
            const Real unit = radar_constant(s.radar) * 2 * pi / 360;
            const Errors e = errors(r, {0, 44, 135, 200, 301}, [&](std::size_t) {
                std::vector<Real> all(r.echo_w.grid.range_count());
                // In steps of range that are even in the sine of the incidence near the vertical.
                constexpr int parts = 20000;
                for (std::size_t j = 0; j < all.size(); ++j) {
                    const Real from = std::max(static_cast<Real>(j) * bin_m, static_cast<Real>(up_m)),
                               to = static_cast<Real>(j + 1) * bin_m;
                    if (!(to > from)) continue;
                    if (to > std::hypot(static_cast<Real>(2350), static_cast<Real>(up_m))) {  // beside the raster
                        all[j] = -1;
                        continue;
                    }
                    const Real first = std::sqrt(1 - up_m * up_m / (from * from)),
                               last = std::sqrt(1 - up_m * up_m / (to * to));
                    for (int i = 0; i < parts; ++i) {
                        const auto at = [&](Real part) { return first + (last - first) * part / parts; };
                        const Real a = at(i), b = at(i + 1), middle = at(i + 0.5L);
                        const Real sine = std::sqrt(1 - middle * middle), range = up_m / sine,
                                   rise = (b - a) * (b + a) / (std::sqrt(1 - a * a) + std::sqrt(1 - b * b));
                        all[j] += rise / (range * range) * static_cast<Real>(law.factor(static_cast<double>(sine)));
                    }
                    all[j] *= unit;
                }
                return all;
            });
            INFO((water == WaterModel::calm ? "calm, " : "nrl, ")
                 << "sensor " << up_m << " m up: total " << e.total_db << " dB, RMS " << e.rms_db << " dB, worst "
                 << e.worst_db << " dB");
            CHECK(std::abs(e.total_db) < 0.1);
            CHECK(e.rms_db < 0.1);
            CHECK(e.worst_db < 0.2);
        }
}

TEST_CASE("a pattern that ends above its floor ends there, not with the post", "[numerics]") {
    // Lit from 10 degrees of depression at 0 dB to 30 or more at -6 dB, or down to where csc2 looking up stops; posts are two to
    // twelve bins long. The sine of 30 degrees is an entry of the pattern's table.
    for (const auto& [up_m, bin_m, lowest] :
         {std::tuple{1000.0, 2.5, 40.0}, {1000.0, 15.0, 30.0}, {300.0, 7.0, 30.0}, {4000.0, 10.0, 52.0}})
        for (const bool of_points : {true, false}) {
            MemorySource source(401, 401, 30, [](double, double) { return 100; });
            Scene s = bare_scene(source, 200.3, 200.2, std::min(6.5 * up_m, 5900.0), bin_m);
            s.platform.altitude_m = up_m;
            s.earth_k.reset();
            AntennaParams& antenna = s.radar.antenna;
            antenna.floor = Decibel(-30);
            double first = 10, last = lowest;  // of its depressions, degrees
            if (of_points) {
                antenna.elevation = ElevationPattern::points;
                antenna.points = {{Angle::degrees(first), Decibel(0)}, {Angle::degrees(last), Decibel(-6)}};
            } else {
                antenna.elevation = ElevationPattern::csc2;
                antenna.tilt = Angle::degrees(lowest - 90);
                first = -90;
            }
            const RunResult r = simulate(s, source);
            const auto edge = [&](double depression) {
                return depression > 0 ? up_m / std::sin(Angle::degrees(depression).rad()) : 1e9;
            };
            const double near_edge = edge(last), far_edge = edge(first);
            const Errors e = errors(r, {0, 44, 135, 200, 301}, [&](std::size_t) {
                std::vector<Real> all(r.echo_w.grid.range_count());
                for (std::size_t j = 0; j < all.size(); ++j) {
                    const Real from = std::max(static_cast<Real>(j) * bin_m, static_cast<Real>(up_m)),
                               to = static_cast<Real>(j + 1) * bin_m;
                    if (to <= up_m) continue;
                    if (to > 1.5 * near_edge && !(to > 0.9 * far_edge && to < 1.1 * far_edge)) {
                        all[j] = -1;
                        continue;
                    }
                    constexpr int parts = 2000;
                    for (int i = 0; i < parts; ++i) {
                        const Real range = from + (to - from) * (i + 0.5L) / parts, sine = up_m / range;
                        const double depression = Angle::radians(std::asin(static_cast<double>(sine))).deg();
                        Real gain = std::pow(10.0L, -0.6L * static_cast<Real>((depression - first) / (last - first)));
                        if (!of_points)
                            gain = static_cast<Real>(elevation_pattern(antenna, Angle::degrees(depression).rad()));
                        if (depression < first || depression > last) gain = 1e-3L;
                        all[j] += gain * gain * up_m / (range * range * range * range) * (to - from) / parts;
                    }
                    all[j] *= unit_w(s, 360);
                }
                return all;
            });
            INFO((of_points ? "points, " : "csc2, ")
                 << up_m << " m up, bins of " << bin_m << " m: total " << e.total_db << " dB, RMS " << e.rms_db
                 << " dB, worst " << e.worst_db << " dB, " << e.cells << " cells");
            CHECK(std::abs(e.total_db) < 0.02);
            CHECK(e.rms_db < 0.05);
            CHECK(e.worst_db < 0.3);
        }
}

TEST_CASE("a slope below the sensor begins to return where it is nearest, and as little as it does there",
          "[numerics]") {
    // It falls by 30 % in the direction looked in: range grows with the way at once, the sine with its square.
    constexpr double fall = 0.3, up_m = 899, bin_m = 20;
    MemorySource source(161, 161, 30, [](double c, double) { return 3000 - 30 * fall * c; });
    Scene s = bare_scene(source, 80.3, 80.2, 60 * bin_m, bin_m);
    s.platform.altitude_m = up_m;
    s.earth_k.reset();
    const RunResult r = simulate(s, source);
    constexpr std::size_t bins = 60, first = 44;  // [880 m, 900 m): the last metre of it holds ground
    std::vector<Real> wanted(bins);
    Real last_sine = -1, last_range = up_m;
    for (int i = 1; i <= 200000; ++i) {
        const Real way = i * 0.005L, up = up_m + fall * way, range = std::hypot(way, up), sine = -up / range,
                   middle = (range + last_range) / 2;
        const auto bin = static_cast<std::size_t>(middle / bin_m);
        if (bin < bins) wanted[bin] += (sine - last_sine) / (middle * middle);
        last_sine = sine, last_range = range;
    }
    for (Real& w : wanted) w *= unit_w(s, 360);
    REQUIRE(r.echo_w.grid.range_count() == bins);
    const float* const got = r.echo_w.row(90);
    for (std::size_t j = 0; j < first; ++j) CHECK(got[j] == 0);
    // As far as a parabola goes; laid out straight it was six times as much.
    CHECK(std::abs(decibels(static_cast<double>(got[first]), wanted[first])) < 2);
    for (std::size_t j = first + 1; j < bins; ++j) {
        CAPTURE(j);
        CHECK(std::abs(decibels(static_cast<double>(got[j]), wanted[j])) < (j < first + 3 ? 0.3 : 0.05));
    }
}

TEST_CASE("a plain is right to the last kilometre at grazing angles down to a millionth", "[numerics]") {
    // Flat earth, 1-km posts: the sensor's height over the range is the grazing angle.
    constexpr double post_m = 1000, reach_m = 800e3, bin_m = 4000;
    MemorySource source(820, 21, post_m, [](double, double) { return -37.5; });
    for (const double up_m : {0.8, 80.0, 8000.0}) {
        Scene s = bare_scene(source, 5, 10, reach_m, bin_m);
        s.platform.altitude_m = up_m;
        s.earth_k.reset();
        s.sector = Sector{Angle::degrees(89.75), Angle::degrees(90.25)};
        s.azimuth_bins = 1440;
        s.range_start_m = 20 * post_m;
        const RunResult r = simulate(s, source);
        const std::size_t first = static_cast<std::size_t>(r.echo_w.grid.range_bins.begin);
        const Errors e = errors(r, {0, 1}, [&](std::size_t) {
            std::vector<Real> all = plain_returns(up_m, bin_m, first + r.echo_w.grid.range_count(), unit_w(s, 1440));
            all.erase(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(first));
            return all;
        });
        INFO("sensor " << up_m << " m up, grazing " << up_m / reach_m << " rad: total " << e.total_db << " dB, RMS "
                       << e.rms_db << " dB, worst " << e.worst_db << " dB over " << e.cells << " cells");
        CHECK(std::abs(e.total_db) < 0.01);
        CHECK(e.worst_db < 0.05);
    }
}

TEST_CASE("the round earth is right from 30 km up to 700 km", "[numerics]") {
    constexpr double post_m = 1000, reach_m = 800e3, bin_m = 5000;
    MemorySource source(830, 21, post_m, [](double, double) { return 0; });
    Scene s = bare_scene(source, 5, 10, reach_m, bin_m);
    s.platform.altitude_m = 30000;
    s.sector = Sector{Angle::degrees(89.75), Angle::degrees(90.25)};
    s.azimuth_bins = 1440;
    const RunResult r = simulate(s, source);
    // On the sphere sin e = -(h (2 R + h) + r^2) / (2 r (R + h)) for h above sea level; d(sin e) / r^2 by its integral
    //   -1/(2 (R + h)) [ -h (2 R + h) / (-3 r^3) ... ]: the derivative is (h (2 R + h) / r^2 - 1) / (2 (R + h)).
    const Real h = 30000, c = h * (2 * round_m + h), horizon = std::sqrt(c), scale = 1 / (2 * (round_m + h));
    const auto integral = [&](Real range) { return scale * (1 / range - c / (3 * range * range * range)); };
    const Errors e = errors(r, {0, 1}, [&](std::size_t) {
        std::vector<Real> all;
        for (std::size_t j = 0; j < r.echo_w.grid.range_count(); ++j) {
            const Real from = std::clamp(static_cast<Real>(j) * bin_m, h, horizon),
                       to = std::clamp(static_cast<Real>(j + 1) * bin_m, h, horizon);
            // The last 20 km before the horizon are level with it to a hundred-thousandth: by their sum below.
            all.push_back(to < horizon - 20000 ? unit_w(s, 1440) * (integral(to) - integral(from)) : 0);
        }
        return all;
    });
    INFO("total " << e.total_db << " dB, RMS " << e.rms_db << " dB, worst " << e.worst_db << " dB over " << e.cells);
    CHECK(e.cells > 250);
    CHECK(e.worst_db < 0.05);
    // All of it: the solid angle below the horizon; nothing behind.
    for (const std::size_t row : {std::size_t{0}, std::size_t{1}}) {
        Real sum = 0, behind = 0;
        for (std::size_t j = 0; j < r.echo_w.grid.range_count(); ++j) {
            const Real middle = (static_cast<Real>(j) + 0.5L) * bin_m;
            (middle > horizon + bin_m ? behind : sum) += static_cast<Real>(r.echo_w.row(row)[j]);
        }
        CHECK(decibels(static_cast<double>(sum), unit_w(s, 1440) * (integral(horizon) - integral(h))) ==
              Approx(0).margin(0.005));
        CHECK(behind == 0);
    }
}

TEST_CASE("hills are right wherever the sensor stands: on a post, a line, an edge, a corner, a diagonal",
          "[numerics]") {
    const auto hills = test::rolling(1, 40, 11);
    struct Place {
        const char* name;
        double column, row;
    };
    int turn = 0;
    for (const Place& place : {Place{"post", 30, 30}, Place{"line", 30, 30.37}, Place{"edge", 0, 25.25},
                               Place{"corner", 0, 0}, Place{"far corner", 60, 60}, Place{"diagonal", 30.25, 30.25}}) {
        const double post_m = std::array{0.3, 30.0, 1000.0}[static_cast<std::size_t>(turn++ % 3)];
        const auto height = [&](double c, double r) { return 200 + 0.8 * post_m * hills(c, r); };
        MemorySource source(61, 61, post_m, height);
        const double reach_m = 28 * post_m;
        Scene s = bare_scene(source, place.column, place.row, reach_m, reach_m / 14);
        s.platform.altitude_m = 4 * post_m;
        s.azimuth_bins = 24;
        const RunResult r = simulate(s, source);
        reference::LongPlane plane;
        plane.columns = plane.rows = 61;
        plane.height_m = [&](std::int64_t c, std::int64_t q) {
            return static_cast<double>(static_cast<float>(height(static_cast<double>(c), static_cast<double>(q))));
        };
        plane.column_m = post_m;
        plane.row_m = -post_m;
        plane.sensor_column = r.scene.nadir.column;
        plane.sensor_row = r.scene.nadir.row;
        plane.sensor_m = r.scene.sensor_m;
        plane.radius_m = round_m;
        const reference::LongWalk walk(plane);
        Real theirs = 0;
        double ours = 0;
        for (std::size_t row = 0; row < 24; ++row) {
            constexpr int rays = 5;
            for (int i = 0; i < rays; ++i)
                for (const Real v : walk.returns((static_cast<Real>(row) + (i + 0.5L) / rays) * 2 * pi / 24,
                                                 reach_m / 14, r.echo_w.grid.range_count()))
                    theirs += v / rays * unit_w(s, 24);
            for (std::size_t j = 0; j < r.echo_w.grid.range_count(); ++j)
                ours += static_cast<double>(r.echo_w.row(row)[j]);
        }
        INFO(post_m << "-m posts, sensor on a " << place.name << ": " << decibels(ours, theirs) << " dB");
        CHECK(decibels(ours, theirs) == Approx(0).margin(0.05));
    }
}

TEST_CASE("a cliff of 8000 m is right from its foot, from afar and from above", "[numerics]") {
    for (const double post_m : {0.3, 30.0})
        for (const double away : {2.0, 5.5, 100.0})
            for (const double up_m : {1.0, 2500.0, 9000.0}) {
                if (away * post_m < 2) continue;  // echoes from within a metre count as from a metre
                // Looking east at a wall between two columns of posts, from a plain.
                const auto brink = static_cast<std::int64_t>(10 + std::ceil(away));
                MemorySource source(140, 41, post_m,
                                    [&](double c, double) { return c < static_cast<double>(brink) ? -100 : 7900; });
                Scene s = bare_scene(source, static_cast<double>(brink) - away, 20, 2e4, 100);
                s.platform.altitude_m = up_m;
                s.azimuth_bins = 3600;
                s.sector = Sector{Angle::degrees(89.9), Angle::degrees(90.1)};
                const RunResult r = simulate(s, source);
                reference::LongPlane plane;
                plane.columns = 140;
                plane.rows = 41;
                plane.height_m = [&](std::int64_t c, std::int64_t) { return c < brink ? -100.0 : 7900.0; };
                plane.column_m = post_m;
                plane.row_m = -post_m;
                plane.sensor_column = r.scene.nadir.column;
                plane.sensor_row = r.scene.nadir.row;
                plane.sensor_m = r.scene.sensor_m;
                plane.radius_m = round_m;
                const reference::LongWalk walk(plane);
                const Errors e = errors(r, {0}, [&](std::size_t) {
                    std::vector<Real> all = walk.returns((89.95L) * pi / 180, 100, r.echo_w.grid.range_count());
                    for (Real& v : all) v *= unit_w(s, 3600);
                    return all;
                });
                INFO(post_m << "-m posts, " << away << " posts before the wall, " << up_m << " m up: total "
                            << e.total_db << " dB, RMS " << e.rms_db << " dB over " << e.cells << " cells");
                CHECK(std::abs(e.total_db) < 0.05);
                CHECK(e.rms_db < 0.5);
            }
}

TEST_CASE("a tower's flanks seen from above lie in range where they stand", "[numerics]") {
    // A ray past the tip climbs a flank and comes down again within a cell, towards the sensor and away from it.
    for (const double up_m : {160.0, 300.0}) {
        const auto height = [](double c, double r) { return c == 24 && r == 20 ? 200.0 : 100.0; };
        MemorySource source(41, 41, 30, height);
        constexpr double bin_m = 5, step = 2 * std::numbers::pi / 3600;
        Scene s = bare_scene(source, 20, 20, 480, bin_m);
        s.platform.altitude_m = up_m;
        s.azimuth_bins = 3600;
        s.sector = Sector{Angle::degrees(92), Angle::degrees(100)};
        const RunResult r = simulate(s, source);
        reference::LongPlane plane;
        plane.columns = plane.rows = 41;
        plane.height_m = [&](std::int64_t c, std::int64_t q) {
            return height(static_cast<double>(c), static_cast<double>(q));
        };
        plane.column_m = 30;
        plane.row_m = -30;
        plane.sensor_column = r.scene.nadir.column;
        plane.sensor_row = r.scene.nadir.row;
        plane.sensor_m = r.scene.sensor_m;
        plane.radius_m = round_m;
        const reference::LongWalk walk(plane);
        double astray = 0, all = 0;
        for (std::size_t row = 2; row < 80; row += 5) {
            const std::vector<Real> truth =
                walk.returns((920.5L + static_cast<Real>(row)) * step, bin_m, r.echo_w.grid.range_count());
            for (std::size_t j = 0; j < truth.size(); ++j) {
                const double wanted = static_cast<double>(truth[j]) * unit_w(s, 3600);
                astray += 0.5 * std::abs(static_cast<double>(r.echo_w.row(row)[j]) - wanted);
                all += wanted;
            }
        }
        INFO("sensor " << up_m << " m up: " << 100 * astray / all << " % in another bin");
        CHECK(astray < 0.01 * all);
    }
}

TEST_CASE("what a tower that stands beside the sensor returns lies in cells that are seen", "[numerics]") {
    // Its front is nearest half-way up: nearer than where it begins and where it ends.
    MemorySource source(41, 41, 4, [](double c, double r) { return c == 35 && r == 20 ? 200.0 : 100.0; });
    Scene s = bare_scene(source, 20, 20, 120, 1);
    s.platform.altitude_m = 50;
    s.azimuth_bins = 720;
    s.sector = Sector{Angle::degrees(80), Angle::degrees(100)};
    s.quality = Quality::exact;
    const RunResult r = simulate(s, source);
    double astray = 0, all = 0;
    for (std::size_t row = 0; row < r.echo_w.grid.azimuth_count(); ++row)
        for (std::size_t j = 0; j < r.echo_w.grid.range_count(); ++j) {
            const auto got = static_cast<double>(r.echo_w.row(row)[j]);
            all += got;
            if (r.echo_state.row(row)[j] != static_cast<std::uint8_t>(State::seen)) astray += got;
        }
    INFO(100 * astray / all << " % in cells that are not seen");
    CHECK(all > 0);
    CHECK(astray < 1e-6 * all);
}

TEST_CASE("a thousand million echoes add up to within half a quantum each", "[numerics]") {
    constexpr std::size_t lanes = WedgeCells::Portions::most;
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    constexpr std::size_t calls = (std::size_t{1} << 20) / lanes;
#else
    constexpr std::size_t calls = (std::size_t{1} << 30) / lanes;
#endif
    constexpr double all_echoes = static_cast<double>(calls * lanes);
    // Bin 7 at 70 m; each echo is a thousand millionth of what the bin can hold at most, and no whole number of quanta.
    const Quanta q = quanta({0, 16}, 10, 1e-3, 1, 1e-3, 10);
    const double most = 1e-3 * 2 * 1e-3 * 10 / (70.0 * 70.0), quantum = q.watts[7];
    for (const double power : {most / all_echoes, 2.25 * quantum}) {
        const std::size_t count = power > 1000 * quantum ? calls : calls / 64;
        const double echoes = static_cast<double>(count * lanes);
        WedgeCells cells(1, q);
        std::vector<double> one(lanes, 1.0), zero(lanes, 0.0), near(lanes, 7.25), far(lanes, 7.5), powers(lanes, power);
        const std::vector<float> straight(lanes, 0.0F), gamma(lanes, 1.0F);
        const std::vector<std::int64_t> origin(lanes, cells.origin_of(0));
        const WedgeCells::Portions p{origin.data(),
                                     one.data(),
                                     zero.data(),
                                     {},
                                     near.data(),
                                     far.data(),
                                     1,
                                     powers.data(),
                                     straight.data(),
                                     {nullptr, nullptr, gamma.data()}};
        for (std::size_t i = 0; i < count; ++i) cells.add_lanes(lanes, p);
        const Real truth = static_cast<Real>(power) * static_cast<Real>(echoes);
        INFO("echoes of " << power / quantum << " quanta");
        CHECK(std::abs(static_cast<Real>(cells.watts(0, 7)) - truth) <= 0.5L * quantum * echoes);
        CHECK(cells.watts(0, 7) > 0);
        // Nothing beside it.
        CHECK(cells.watts(0, 6) == 0);
        CHECK(cells.watts(0, 8) == 0);
    }
    // The loss that half a quantum an echo can be at most, beside the thermal noise of the default set: from 100 m to 800 km.
    const RadarParams radar;
    const double step = 2 * std::numbers::pi / 960, bin = radar.pulse_extent_m() / 4;
    for (const double range : {100.0, 1e4, 1e5, 8e5}) {
        const auto j = static_cast<std::int64_t>(range / bin);
        // A radiance of 15 dB (metal walls) and the pattern's peak: the most that physics.md's classes return.
        const Quanta of = quanta({j, j + 1}, bin, radar_constant(radar), 1, step, std::pow(10.0, 1.5));
        const double noise = radar.noise_power_w();
        INFO("range " << range << " m: noise is " << noise / of.watts[0] << " quanta");
        CHECK(noise / of.watts[0] > 1000);
        // Pieces that 0.3-m posts can put into the cell, 10 a post.
        const double pieces = 10 * (bin / 0.3) * (range * step / 0.3 + 1);
        CHECK(0.5 * pieces * of.watts[0] < 0.01 * noise);
    }
}

TEST_CASE("heights and powers below the least normal number are no trouble", "[numerics]") {
    MemorySource zero(81, 81, 30, [](double, double) { return 0; }),
        tiny(81, 81, 30, [](double c, double r) { return std::fmod(c + r, 2) == 0 ? 1e-40 : -1e-44; });
    Scene s = bare_scene(zero, 40.3, 40.6, 1100, 20);
    s.platform.altitude_m = 200;
    const RunResult a = simulate(s, zero), b = simulate(s, tiny);
    CHECK(a.echo_w.cells == b.echo_w.cells);
    CHECK(a.state.cells == b.state.cells);
    // A set whose echoes lie below what a float can hold: nothing comes back but noise, and no NaN.
    s.radar.transmit_power_w = 1e-3;
    s.radar.gain = Decibel(-100);
    s.radar.losses = Decibel(100);
    s.radar.frequency_hz = 1e12;
    s.gamma = Decibel(-100);
    const RunResult faint = simulate(s, zero);
    double most = 0;
    for (const float w : faint.echo_w.cells) {
        CHECK(w >= 0);
        most = std::max(most, static_cast<double>(w));
    }
    CHECK(most < 1e-36);
    CHECK(faint.state.cells == a.state.cells);
    for (const float w : faint.power_w.cells) CHECK((w >= 0 && w < 1e-6F));
}

TEST_CASE("the number of azimuth bins shares the same power out, from 1 to 100000", "[numerics]") {
    const auto hills = test::rolling(60, 50, 21);
    MemorySource source(21, 21, 30, [&](double c, double r) { return 100 + hills(c, r); });
    double whole = 0;
    for (const std::int64_t bins : {1, 2, 3, 4, 7, 360, 100000}) {
        Scene s = bare_scene(source, 10.3, 10.6, 300, 50);
        s.platform.altitude_m = 150;
        s.azimuth_bins = bins;
        const RunResult r = simulate(s, source);
        REQUIRE(r.echo_w.grid.azimuth_count() == static_cast<std::size_t>(bins));
        const double sum = test::sum_of(r.echo_w);
        INFO(bins << " bins: " << sum << " W of " << whole << " W");
        if (bins == 1) whole = sum;
        CHECK(sum == Approx(whole).epsilon(2e-3));
        if (bins > 1000) continue;
        // With the beam on each bin is looked at once round the circle, and the picture is whole.
        s.radar.beam_width_error = s.radar.pulse_length_error = true;
        const RunResult beamed = simulate(s, source);
        double most = 0;
        for (const float w : beamed.power_w.cells) {
            REQUIRE(std::isfinite(w));
            most = std::max(most, static_cast<double>(w));
        }
        CHECK(most > 0);
    }
}

TEST_CASE("far from the origin the same ground gives the same power", "[numerics]") {
    const auto hills = test::rolling(4, 40, 5);
    const auto height = [&](double c, double r) { return 100 + hills(c, r); };
    const auto power_at = [&](double origin_x, double origin_y, double step_m) {
        MemorySource source(121, 121, step_m, height);
        source.editable().origin_x = origin_x;
        source.editable().origin_y = origin_y;
        Scene s = bare_scene(source, 60.25, 60.5, 50 * step_m, 2 * step_m);
        s.platform.altitude_m = 20 * step_m;
        return simulate(s, source);
    };
    // Posts of a quarter of a metre stand at the very same places: the same bits.
    const RunResult here = power_at(0, 0, 0.25);
    CHECK(power_at(1e8, 9e6, 0.25).echo_w.cells == here.echo_w.cells);
    CHECK(power_at(-1e8, -2e7, 0.25).echo_w.cells == here.echo_w.cells);
    // Posts of 0.3 m do to 1e-8 of them: the place is rounded to a millionth of a post, 1e-6 of the nearest range.
    const RunResult near = power_at(0, 0, 0.3), far = power_at(1e8, 9e6, 0.3);
    double worst = 0;
    for (std::size_t i = 0; i < near.echo_w.cells.size(); ++i) {
        const double a = static_cast<double>(near.echo_w.cells[i]), b = static_cast<double>(far.echo_w.cells[i]);
        if (a > 0) worst = std::max(worst, std::abs(b / a - 1));
    }
    INFO("worst relative difference " << worst);
    CHECK(worst < 1e-3);
}
