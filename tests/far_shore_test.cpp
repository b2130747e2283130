// Far shore in the sweep: banks behind water against the closed form of physics 5.3, and what must stay as it is.
#include <catch2/catch.hpp>

#include <cmath>
#include <cstring>
#include <numbers>
#include <tuple>

#include "lib/engine.hpp"
#include "lib/far_shore.hpp"
#include "lib/shade.hpp"
#include "tests/bare_scene.hpp"
#include "tests/every_target.hpp"
#include "tests/refusal.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using wedgescope::test::MemorySource;
using wedgescope::test::simulate;

namespace {

constexpr double degree = std::numbers::pi / 180, post_m = 10;

ClassId id_of(const char* name) { return material_by_name("material", name); }

/// No pattern, no beam, no pulse: the echo is K sigma0(psi) A / r^4.
Scene bare_scene(double x, double y, double altitude_m, double range_m) {
    Scene s = wedgescope::test::bare_scene(x, y, altitude_m, range_m);
    s.azimuth_bins = 720;
    s.range_bin_m = 4;
    s.earth_k.reset();
    return s;
}

/// A lake between two straight banks that run east and west, the sensor over the land south of it.
struct Lake {
    double near_y = 600;                       ///< from the sensor, north
    double shore_y = 2400;                     ///< of the far bank's foot, the last post of water
    double slope = 1;                          ///< of the far bank
    double bank_m = 40;                        ///< its height
    double near_slope = 0.1, near_bank_m = 6;  ///< of the near bank, which falls to the water
    double sensor_m = 400;

    static constexpr double x0 = 1500, y0 = -3203;  // of the sensor; posts stand at y = -10 row
    double height(double column, double row) const {
        (void)column;
        const double y = -row * post_m - y0;
        if (y > shore_y) return std::min(bank_m, slope * (y - shore_y));
        return y < near_y ? std::min(near_bank_m, near_slope * (near_y - y)) : 0;
    }
    bool water(double row) const {
        const double y = -row * post_m - y0;
        return y > near_y - 1 && y < shore_y + 1;
    }
    struct Source : MemorySource {
        explicit Source(const Lake& lake, double culture_m = 0)
            : MemorySource(301, 381, post_m, [&](double c, double r) { return lake.height(c, r); }) {
            set_classes([&](double, double r) { return id_of(lake.water(r) ? "water" : "soil"); });
            if (culture_m > 0)
                set_culture_height(
                    [&](double, double r) { return -r * post_m - y0 > lake.shore_y + 1 ? culture_m : 0; });
        }
    };
    Scene scene() const { return bare_scene(x0, y0, sensor_m, 4000); }
};
// Posts of the far bank's foot: -10 row - y0 = shore_y.
Lake lake_with(double shore_y) {
    Lake lake;
    lake.shore_y = shore_y + 3;  // 3203 - 10 row
    lake.near_y = 603;
    return lake;
}

double cell(const RunResult& r, std::size_t row, std::int64_t j) {
    return static_cast<double>(r.echo_w.row(row)[static_cast<std::size_t>(j - r.echo_w.grid.range_bins.begin)]);
}

/// Calls look(on / off, height of the bank there, tangent of the grazing angle of the ray by way of the water, share of the
/// cell that the bank fills) for the cells of the bank within 20 degrees of north, its first facet left out, whose lower half
/// is water without the class rule.
template <class Look>
int for_bank(const Lake& lake, const RunResult& on, const RunResult& off, const Look& look) {
    int cells = 0;
    const double bin = on.echo_w.grid.range_bin_m;
    for (const std::size_t row :
         {std::size_t{0}, std::size_t{13}, std::size_t{37}, std::size_t{685}, std::size_t{710}, std::size_t{719}}) {
        const double azimuth = (static_cast<double>(row) + 0.5) * 0.5 * degree;
        const auto at = [&](double rise_y, double az) {  // slant range of the bank at a distance behind its foot
            const double s = (lake.shore_y + rise_y) / std::cos(az);
            return std::hypot(s, lake.sensor_m - lake.slope * rise_y);
        };
        // Cells that hold nothing but bank at both edges of the azimuth bin.
        const double half = 0.25 * degree, brow = lake.bank_m / lake.slope;
        const double near = std::max(at(post_m, azimuth - half), at(post_m, azimuth + half)),
                     far = std::min(at(brow, azimuth - half), at(brow, azimuth + half));
        for (auto j = static_cast<std::int64_t>(near / bin) + 1; static_cast<double>(j + 1) * bin < far; ++j) {
            const double range = (static_cast<double>(j) + 0.5) * bin;
            double lo = 0, hi = lake.bank_m / lake.slope;
            for (int i = 0; i < 60; ++i) (at(0.5 * (lo + hi), azimuth) < range ? lo : hi) = 0.5 * (lo + hi);
            const double z = lake.slope * lo, s = (lake.shore_y + lo) / std::cos(azimuth);
            REQUIRE(cell(off, row, j) > 0);
            look(cell(on, row, j) / cell(off, row, j), z, (lake.sensor_m + z) / s, lo / std::cos(azimuth));
            ++cells;
        }
    }
    return cells;
}

double expected_gain(const Scene& s, double tangent) {
    return far_shore_gain(water_permittivity(s.radar.frequency_hz, fresh_water), s.radar.frequency_hz,
                          s.radar.polarisation, rms_wave_height_m(s.sea_state), Angle::radians(std::atan(tangent)));
}

}  // namespace

TEST_CASE("the table of the far shore's gain keeps to the law, waves or none", "[far-shore]") {
    for (const double ghz : {1.0, 9.4, 16.5, 35.0})
        for (const Polarisation p : {Polarisation::hh, Polarisation::vv, Polarisation::circular})
            for (const double state : {0.0, 0.2, 1.0, 6.0}) {
                ClassLawParams params{.frequency_hz = ghz * 1e9, .polarisation = p, .sea_state = state};
                CHECK_FALSE(FarShore(params).on());
                params.far_shore = true;
                const FarShore shore(params);
                REQUIRE(shore.on());
                INFO(ghz << " GHz, sea state " << state);
                CHECK(shore.error() < 0.002);
                CHECK(shore.most() <= 6);
                CHECK(shore.is_water(id_of("water")));
                CHECK_FALSE(shore.is_water(id_of("marsh")));
                const Permittivity water = water_permittivity(ghz * 1e9, state == 0 ? fresh_water : Water{});
                for (const double deg : {0.3, 2.0, 6.9, 15.0, 40.0, 80.0})
                    CHECK_THAT(
                        shore.gain(std::sin(deg * degree)),
                        WithinRel(far_shore_gain(water, ghz * 1e9, p, rms_wave_height_m(state), Angle::degrees(deg)),
                                  0.002));
            }
}

TEST_CASE("a bank across calm water returns F4 times what it would, and nothing else changes", "[far-shore]") {
    for (const Polarisation p : {Polarisation::hh, Polarisation::vv, Polarisation::circular}) {
        const Lake lake = lake_with(2400);
        Lake::Source source(lake);
        Scene s = lake.scene();
        s.radar.polarisation = p;
        const RunResult off = simulate(s, source);
        s.far_shore = true;
        const RunResult on = simulate(s, source);
        double least = 10, most = 0;
        CHECK(for_bank(lake, on, off, [&](double ratio, double z, double tangent, double) {
                  INFO("height " << z << ", grazing " << std::atan(tangent) / degree);
                  CHECK_THAT(ratio, WithinRel(expected_gain(s, tangent), 0.01));
                  least = std::min(least, ratio);
                  most = std::max(most, ratio);
              }) > 20);
        if (p == Polarisation::hh) CHECK(least > 4.5);
        // At 16.5 GHz water has its Brewster angle at 7 degrees; here the ray comes down at 9.
        if (p == Polarisation::vv) CHECK(most < 1.3);
        if (p == Polarisation::circular) CHECK((least > 2 && most < 4));
        // All before the far bank's foot, the near bank as well, and all behind its brow.
        for (const std::size_t row :
             {std::size_t{0}, std::size_t{25}, std::size_t{180}, std::size_t{360}, std::size_t{700}}) {
            const double azimuth = (static_cast<double>(row) + 0.5) * 0.5 * degree;
            double before = 0, change = 0;
            for (std::int64_t j = on.echo_w.grid.range_bins.begin; j < on.echo_w.grid.range_bins.end; ++j) {
                const double range = static_cast<double>(j + 1) * *s.range_bin_m,
                             foot = std::hypot((lake.shore_y / std::cos(azimuth)), lake.sensor_m);
                const double brow = std::hypot((lake.shore_y + lake.bank_m) / std::cos(azimuth), lake.sensor_m);
                if (std::cos(azimuth) > 0.5 && range > foot / 1.02 && range < brow * 1.02) continue;
                before += cell(off, row, j);
                change += std::abs(cell(on, row, j) - cell(off, row, j));
            }
            CHECK(before > 0);
            CHECK(change <= 1e-6 * before);
        }
    }
}

TEST_CASE("the facet that rises from the water is land, and the whole bank returns the closed form", "[far-shore]") {
    const Lake lake = lake_with(2400);
    Lake::Source source(lake);
    Scene s = lake.scene();
    s.range_bin_m = 400;
    s.azimuth_bins = 72;
    s.far_shore = true;
    const RunResult on = simulate(s, source);
    const double gamma = class_law(material_table()[id_of("soil")], laws_of(s)).gamma().value();
    // North: 2400 to 2800 m of slant range hold water and all of the bank, but for its plateau.
    double bank = 0;
    constexpr int parts = 200;
    for (int i = 0; i < parts; ++i) {
        const double azimuth = 5 * (i + 0.5) / parts * degree;
        for (int k = 0; k < parts; ++k) {
            const double d = lake.bank_m / lake.slope, y0 = d * k / parts, y1 = d * (k + 1) / parts,
                         s0 = (lake.shore_y + y0) / std::cos(azimuth), s1 = (lake.shore_y + y1) / std::cos(azimuth),
                         z0 = lake.slope * y0, z1 = lake.slope * y1,
                         range = std::hypot(0.5 * (s0 + s1), lake.sensor_m - 0.5 * (z0 + z1));
            // The solid angle that it shows, times gamma / r^2.
            const double shown = (z1 - lake.sensor_m) / std::hypot(s1, lake.sensor_m - z1) -
                                 (z0 - lake.sensor_m) / std::hypot(s0, lake.sensor_m - z0);
            bank += gamma * shown * (5 * degree / parts) / (range * range) *
                    expected_gain(s, (lake.sensor_m + 0.5 * (z0 + z1)) / (0.5 * (s0 + s1)));
        }
    }
    // The plateau behind it, as a sum of its own.
    double plateau = 0;
    for (int i = 0; i < parts; ++i) {
        const double azimuth = 5 * (i + 0.5) / parts * degree, above = lake.sensor_m - lake.bank_m,
                     s0 = (lake.shore_y + lake.bank_m / lake.slope) / std::cos(azimuth),
                     s1 = std::sqrt(2800.0 * 2800 - above * above);
        for (int k = 0; k < parts; ++k) {
            const double a = s0 + (s1 - s0) * k / parts, b = s0 + (s1 - s0) * (k + 1) / parts, m = 0.5 * (a + b);
            plateau += gamma * (above / std::hypot(a, above) - above / std::hypot(b, above)) * (5 * degree / parts) /
                       (m * m + above * above);
        }
    }
    const double expected = radar_constant(s.radar) * (bank + plateau);
    CHECK(bank > 5 * plateau);
    CHECK_THAT(10 * std::log10(cell(on, 0, 6) / expected), WithinAbs(0, 0.05));
}

TEST_CASE("a bank is brightened as high as the water before it serves, and waves take that away", "[far-shore]") {
    Lake lake = lake_with(2400);
    lake.near_y = lake.shore_y - 160;  // of water
    lake.bank_m = 80;
    lake.near_bank_m = 0;
    Lake::Source source(lake);
    Scene s = lake.scene();
    const RunResult off = simulate(s, source);
    s.far_shore = true;
    const RunResult on = simulate(s, source);
    int below = 0, above = 0;
    for_bank(lake, on, off, [&](double ratio, double z, double tangent, double behind) {
        // Where the ray by way of the water comes down, before the foot; north the water is 165 m long, aside a little more. A
        // facet of the bank takes 50 m of it and is brightened by the share that the water serves.
        const double before = z / tangent - behind;
        INFO("height " << z << ", " << before << " m before the foot");
        if (before < 110) {
            CHECK_THAT(ratio, WithinRel(expected_gain(s, tangent), 0.01));
            ++below;
        } else if (before > 230) {
            CHECK_THAT(ratio, WithinRel(1.0, 1e-5));
            ++above;
        }
    });
    CHECK(below > 3);
    CHECK(above > 10);

    lake = lake_with(2400);
    Lake::Source long_lake(lake);
    for (const double state : {0.1, 1.0, 3.0}) {
        Scene waves = lake.scene();
        waves.sea_state = state;
        const RunResult calm = simulate(waves, long_lake);
        waves.far_shore = true;
        const RunResult bright = simulate(waves, long_lake);
        for_bank(lake, bright, calm, [&](double ratio, double, double tangent, double) {
            CHECK_THAT(ratio, WithinRel(expected_gain(waves, tangent), 0.02));
            if (state >= 1) CHECK_THAT(ratio, WithinAbs(1, 1e-3));
        });
    }
}

TEST_CASE("a wall of culture at the water's edge is brightened as a bank", "[far-shore]") {
    Lake lake = lake_with(2400);
    lake.bank_m = 30;
    lake.slope = 1e-9;  // no bank but what stands there
    Lake::Source source(lake, 30);
    Scene s = lake.scene();
    s.azimuth_bins = 3600;
    s.range_bin_m = 1;
    const RunResult off = simulate(s, source);
    s.far_shore = true;
    const RunResult on = simulate(s, source);
    // The wall rises from the last post of water to the next one; all of that cell is wall, with the rule and without it.
    const double foot_m = std::hypot(lake.shore_y, lake.sensor_m),
                 brow_m = std::hypot(lake.shore_y + post_m, lake.sensor_m - 30);
    double sum_on = 0, sum_off = 0;
    for (std::int64_t j = static_cast<std::int64_t>(foot_m); j < static_cast<std::int64_t>(brow_m); ++j) {
        sum_on += cell(on, 0, j) + cell(on, 3599, j);
        sum_off += cell(off, 0, j) + cell(off, 3599, j);
    }
    CHECK(sum_off > 0);
    CHECK_THAT(sum_on / sum_off, WithinRel(expected_gain(s, (lake.sensor_m + 15) / (lake.shore_y + 5)), 0.02));
}

TEST_CASE("rotating the aircraft round a lake rotates the bright far shore", "[far-shore]") {
    // A round lake of 400 m with a bank all round, in the middle of a plain 20 m above it.
    const auto height = [](double c, double r) {
        const double d = std::hypot(c - 200, r - 200) * post_m - 400;
        return d < 0 ? 0 : std::min(20.0, 0.8 * d);
    };
    MemorySource source(401, 401, post_m, height);
    source.set_classes([&](double c, double r) { return id_of(height(c, r) > 0 ? "grass" : "water"); });
    for (int turn = 0; turn < 8; ++turn) {
        const double from = turn * 45 * degree;  // of the lake, towards the aircraft
        const double x = 2000 + 1500 * std::sin(from), y = -2000 + 1500 * std::cos(from);
        Scene s = bare_scene(x + 0.7, y - 0.4, 320, 2600);
        s.azimuth_bins = 720;
        s.refine = false;  // cell by cell, by the same spokes
        const RunResult off = simulate(s, source);
        s.far_shore = true;
        const RunResult on = simulate(s, source);
        double more = 0, east = 0, north = 0, all = 0;
        for (std::size_t row = 0; row < on.echo_w.grid.azimuth_count(); ++row)
            for (std::int64_t j = on.echo_w.grid.range_bins.begin; j < on.echo_w.grid.range_bins.end; ++j) {
                const double change = cell(on, row, j) - cell(off, row, j), range = (static_cast<double>(j) + 0.5) * 4,
                             azimuth = (static_cast<double>(row) + 0.5) * 0.5 * degree;
                all += cell(off, row, j);
                if (change == 0) continue;
                // Parts of a piece are rounded on their own; of a sliver that reaches into a bin the ends are.
                const double before = j > on.echo_w.grid.range_bins.begin ? cell(off, row, j - 1) : 0;
                CHECK(change >= -1e-5 * cell(off, row, j) - 1e-9 * before);
                const double ground = std::sqrt(std::max(0.0, range * range - 310.0 * 310));
                more += change;
                east += change * (x + ground * std::sin(azimuth) - 2000);
                north += change * (y + ground * std::cos(azimuth) + 2000);
            }
        INFO("aircraft " << turn * 45 << " degrees from the lake");
        CHECK(more > 0);
        CHECK(all > 0);
        // The brightness added lies across the lake: of half a circle of shore that faces parallel rays the middle, weighed by what
        // it shows, is pi / 4 of the radius behind the lake's (324 m); these rays spread.
        const double across = -(east * std::sin(from) + north * std::cos(from)) / more,
                     aside = (east * std::cos(from) - north * std::sin(from)) / more;
        CHECK(across > 280);
        CHECK(across < 325);
        CHECK_THAT(aside, WithinAbs(0, 15));
    }
}

TEST_CASE("without culture, which tells water, far-shore changes no bit", "[far-shore]") {
    const auto hills = test::rolling(120, 90, 5);
    MemorySource source(201, 201, 30, [&](double c, double r) { return 60 + hills(c, r); });
    Scene s = bare_scene(3011, -2987, 200, 2500);
    s.quality = Quality::draft;
    const RunResult off = simulate(s, source);
    s.far_shore = true;
    const RunResult on = simulate(s, source);
    CHECK(std::memcmp(on.echo_w.cells.data(), off.echo_w.cells.data(), off.echo_w.cells.size() * sizeof(float)) == 0);
}

TEST_CASE("far shores are the same bits for any wedges, threads, instructions, culled or not", "[far-shore]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    const auto hills = test::rolling(120, 90, 5);
    const auto height = [&](double c, double r) { return std::max(40.0, std::round(60 + hills(c, r))); };
    MemorySource source(401, 401, 30, height);
    source.set_classes([&](double c, double r) {
        return id_of(height(c, r) > 40 ? (static_cast<int>(c) % 7 ? "grass" : "trees") : "water");
    });
    source.set_culture_height(
        [&](double c, double r) { return static_cast<int>(c * r) % 11 == 0 && height(c, r) > 40 ? 12.0 : 0.0; });
    Scene s = bare_scene(6011, -5987, 700, 5500);
    s.earth_k = 4.0 / 3;
    s.range_bin_m = 25;
    s.quality = Quality::normal;
    s.refine = false;  // bright banks would have others in doubt
    const RunResult off = simulate(s, source);
    s.far_shore = true;
    const RunResult plain = simulate(s, source, 1, 1, false);
    const auto same = [](const RunResult& a, const RunResult& b) {
        return a.echo_w.cells.size() == b.echo_w.cells.size() &&
               std::memcmp(a.echo_w.cells.data(), b.echo_w.cells.data(), a.echo_w.cells.size() * sizeof(float)) == 0 &&
               a.state.cells == b.state.cells;
    };
    CHECK_FALSE(same(plain, off));
    CHECK(plain.state.cells == off.state.cells);
    source.set_block_map();
    for (const auto& [wedges, threads, cull] : {std::tuple{1, 1, true}, {5, 2, true}, {23, 2, true}, {72, 1, false}}) {
        INFO(wedges << " wedges, " << threads << " threads, cull " << cull);
        const bool equal = same(plain, simulate(s, source, wedges, threads, cull));
        CHECK(equal);
    }
}

TEST_CASE("the far shore and the wind have no place beside one gamma, nor waves beside calm water", "[far-shore]") {
    const MemorySource source(11, 11, 30, [](double, double) { return 0.0; });
    Scene s = bare_scene(150, -150, 800, 1200);
    s.gamma = Decibel(-15);
    s.far_shore = true;
    CHECK(test::refusal<InputError>([&] { validate(s); }) ==
          "far-shore is given with gamma, which is one for everything, water too; accepted: one of them");
    s.far_shore = false;
    s.wind_from = Angle::degrees(10);
    CHECK(test::refusal<InputError>([&] { validate(s); }).find("wind-direction is given with gamma") == 0);
    s.gamma.reset();
    s.water = WaterModel::calm;
    CHECK(test::refusal<InputError>([&] { validate(s); }).find("wind-direction is 10 deg; with water calm") == 0);
    s.wind_from.reset();
    s.sea_state = 3;
    CHECK(test::refusal<InputError>([&] { validate(s); }) ==
          "sea-state is 3; with water calm it must be 0 (the waves are those of water nrl)");
}
