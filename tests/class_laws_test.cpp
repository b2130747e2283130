// Class laws in the sweep: what is tabled against the laws, and echoes of drawn ground against sums over small pieces of it.
#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>
#include <numeric>

#include "lib/class_laws.hpp"
#include "lib/engine.hpp"
#include "lib/shade.hpp"
#include "tests/bare_scene.hpp"
#include "tests/refusal.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using wedgescope::test::MemorySource;
using wedgescope::test::simulate;

namespace {

constexpr double degree = std::numbers::pi / 180;

ClassId id_of(const char* name) { return material_by_name("material", name); }

/// A bare set over a flat earth.
Scene bare_scene(double x, double y, double altitude_m, double range_m) {
    Scene s = test::bare_scene(x, y, altitude_m, range_m);
    s.azimuth_bins = 72;
    s.earth_k.reset();
    return s;
}

double echo_at(const RunResult& r, double azimuth_deg, double range_m) {
    const auto row = static_cast<std::size_t>(azimuth_deg / 360 * static_cast<double>(r.echo_w.grid.circle_bins));
    return static_cast<double>(r.echo_w.row(row)[static_cast<std::size_t>(range_m / r.echo_w.grid.range_bin_m)]);
}

/// The cell's echo from a plane z = rise_east (x - x0) + rise_north (y - y0) below a sensor at height h over (x0, y0), by
/// pieces of the plane: K sigma0(psi) a / (n_up r^4), sin psi = (distance of the sensor from the plane) / r.
double plane_echo(const Scene& s, const BackscatterLaw& law, double h, double rise_east, double rise_north,
                  double azimuth_deg, double range_m) {
    const double step_deg = 360.0 / static_cast<double>(*s.azimuth_bins), bin = *s.range_bin_m;
    const double azimuth0 = std::floor(azimuth_deg / step_deg) * step_deg, range0 = std::floor(range_m / bin) * bin;
    const double norm = std::sqrt(1 + rise_east * rise_east + rise_north * rise_north), away = h / norm;
    double sum = 0;
    constexpr int parts = 60;
    for (int i = 0; i < parts; ++i) {
        const double azimuth = (azimuth0 + (i + 0.5) / parts * step_deg) * degree;
        const double rise = rise_east * std::sin(azimuth) + rise_north * std::cos(azimuth);
        // Ground distance d with d^2 + (rise d - h)^2 = r^2.
        const auto ground = [&](double r) {
            const double a = 1 + rise * rise, b = rise * h;
            return (b + std::sqrt(b * b - a * (h * h - r * r))) / a;
        };
        const double d0 = ground(range0), d1 = ground(range0 + bin);
        for (int k = 0; k < parts; ++k) {
            const double d = d0 + (k + 0.5) / parts * (d1 - d0), r2 = d * d + (rise * d - h) * (rise * d - h);
            const double sine = away / std::sqrt(r2), area = d * (d1 - d0) / parts * step_deg / parts * degree;
            sum += law.factor(sine) * sine * area * norm / (r2 * r2);
        }
    }
    return radar_constant(s.radar) * sum;
}

}  // namespace

TEST_CASE("the default laws are the gammas of the class table, bit for bit", "[class-laws]") {
    for (const double frequency : {9.4e9, 16.5e9}) {
        const ClassLaws laws(ClassLawParams{.frequency_hz = frequency});
        const std::vector<ClassGamma> gamma = gamma_table(frequency, std::nullopt);
        REQUIRE(laws.constant());
        REQUIRE(laws.gamma().size() == gamma.size());
        double most = 0;
        for (std::size_t id = 0; id < gamma.size(); ++id) {
            CHECK(laws.gamma()[id].ground == gamma[id].ground);
            CHECK(laws.gamma()[id].wall == gamma[id].wall);
            CHECK(laws.ground(static_cast<ClassId>(id), 0.3) == gamma[id].ground);
            most = std::max({most, gamma[id].ground, gamma[id].wall});
        }
        CHECK(laws.most() == most);
    }
    const ClassLaws one(ClassLawParams{.land = LandModel::ulaby_dobson, .sea_state = 4, .gamma = Decibel(-15)});
    CHECK(one.constant());
    CHECK(one.gamma()[0].ground == Decibel(-15).ratio());
}

TEST_CASE("what the sweep looks up is the class' own law within a hundredth of a decibel", "[class-laws]") {
    for (const Polarisation polarisation : {Polarisation::hh, Polarisation::vv, Polarisation::circular})
        for (const LandModel land : {LandModel::ulaby_dobson, LandModel::oh}) {
            const ClassLawParams params{.frequency_hz = 9.4e9, .polarisation = polarisation, .land = land, .sea_state = 3};
            const ClassLaws laws(params);
            REQUIRE_FALSE(laws.constant());
            CHECK(laws.error_db() <= 0.01);
            for (std::size_t id = 0; id < material_table().size(); ++id) {
                const BackscatterLaw law = class_law(material_table()[id], params);
                double most = 0;
                for (double deg = 0.05; deg < 90; deg += 0.37) {
                    const double sine = std::sin(deg * degree), exact = law.factor(sine);
                    const double found = laws.ground(static_cast<ClassId>(id), law_variable(sine));
                    INFO(material_table()[id].name << " at " << deg << " deg");
                    if (exact > 1e-8) CHECK_THAT(10 * std::log10(found / exact), WithinAbs(0, 0.011));
                    most = std::max(most, found);
                }
                CHECK(most <= laws.gamma()[id].ground);
                CHECK(laws.gamma()[id].ground <= laws.most());
            }
        }
}

TEST_CASE("circular polarisation takes 3 dB of constant gamma and half a dB of walls", "[class-laws]") {
    const ClassLaws plain(ClassLawParams{}), circular(ClassLawParams{.polarisation = Polarisation::circular});
    const ClassId trees = id_of("trees");
    CHECK_THAT(10 * std::log10(plain.gamma()[trees].ground / circular.gamma()[trees].ground), WithinAbs(3, 1e-6));
    CHECK_THAT(10 * std::log10(plain.gamma()[trees].wall / circular.gamma()[trees].wall), WithinAbs(0.5, 1e-6));
    // Vertical and horizontal are alike to a constant gamma.
    CHECK(ClassLaws(ClassLawParams{.polarisation = Polarisation::vv}).gamma()[trees].ground == plain.gamma()[trees].ground);
}

TEST_CASE("a tilted plane returns its law at the angle between its normal and the sensor", "[class-laws]") {
    // Planes that fall away or rise towards the sensor, and across; posts in steps of float on purpose.
    struct Case {
        const char* material;
        LandModel land;
        double rise_east, rise_north;
    };
    for (const Case& c : {Case{"grass", LandModel::ulaby_dobson, 0, 0}, Case{"grass", LandModel::ulaby_dobson, 0.3, 0},
                          Case{"trees", LandModel::ulaby_dobson, 0.15, -0.2}, Case{"soil", LandModel::oh, -0.1, 0.25},
                          Case{"grass", LandModel::constant_gamma, 0.3, -0.1}}) {
        constexpr double x0 = 6007, y0 = -6011;
        MemorySource source(401, 401, 30, [&](double column, double row) {
            return c.rise_east * (30 * column - x0) + c.rise_north * (-30 * row - y0);
        });
        Scene s = bare_scene(x0, y0, 1500, 5000);
        s.radar.frequency_hz = 9.4e9;
        s.land = c.land;
        source.editable().default_class = id_of(c.material);
        const RunResult r = simulate(s, source);
        const BackscatterLaw law = class_law(material_table()[id_of(c.material)], laws_of(s));
        for (const double azimuth : {2.0, 47.0, 93.0, 141.0, 183.0, 271.0, 318.0})
            for (const double range : {1925.0, 2525.0, 4025.0}) {
                INFO(c.material << " rising " << c.rise_east << ", " << c.rise_north << " at " << azimuth << " deg, "
                                << range << " m");
                const double expected = plane_echo(s, law, 1500, c.rise_east, c.rise_north, azimuth, range);
                CHECK_THAT(10 * std::log10(echo_at(r, azimuth, range) / expected), WithinAbs(0, 0.03));
            }
    }
}

TEST_CASE("on a raster of degrees far north a slope across is as steep as it is", "[class-laws]") {
    // 60 degrees north, posts of 1/1800 degree: 62 m to the north, 31 m to the east; ground that rises 0.25 to the north, seen
    // from the east and the west, and to the east, seen from the north and the south.
    constexpr double lat0 = 60, lon0 = 10, step = 1.0 / 1800;
    for (const bool to_north : {true, false}) {
        const EllipsoidRadii radii = ellipsoid_radii(lat0 * degree);
        const double north_m = radii.meridian_m * step * degree,
                     east_m = radii.normal_m * std::cos(lat0 * degree) * step * degree;
        MemorySource source(321, 321, 30, [&](double column, double row) {
            return 0.25 * (to_north ? (160 - row) * north_m : (column - 160) * east_m);
        });
        source.set_degrees(lon0 - 160 * step, lat0 + 160 * step, step, step);
        source.editable().default_class = id_of("grass");
        Scene s = bare_scene(0, 0, 1500, 4000);
        s.platform.xy.reset();
        s.platform.latlon = LatLon{lat0, lon0};
        s.radar.frequency_hz = 9.4e9;
        s.land = LandModel::ulaby_dobson;
        const RunResult r = simulate(s, source);
        const BackscatterLaw law = class_law(material_table()[id_of("grass")], laws_of(s));
        for (const double azimuth : {2.0, 47.0, 92.0, 182.0, 272.0}) {
            INFO((to_north ? "north" : "east") << " at " << azimuth);
            const double expected =
                plane_echo(s, law, 1500, to_north ? 0 : 0.25, to_north ? 0.25 : 0, azimuth, 2525);
            CHECK_THAT(10 * std::log10(echo_at(r, azimuth, 2525) / expected), WithinAbs(0, 0.05));
        }
    }
}

TEST_CASE("each class of a mixed ground follows its own law, and walls keep their gamma", "[class-laws]") {
    // Stripes of four posts along north; classes change between posts, so pieces run through two.
    MemorySource source(401, 401, 30, [](double, double) { return 0.0; });
    const ClassId grass = id_of("grass"), sea = id_of("water"), town = id_of("urban");
    const auto stripe = [&](double column) {
        const int k = static_cast<int>(column) / 4 % 3;
        return k == 0 ? grass : k == 1 ? sea : town;
    };
    source.set_classes([&](double column, double) { return stripe(column); });
    Scene s = bare_scene(6007, -6011, 1500, 5000);
    s.radar.frequency_hz = 9.4e9;
    s.land = LandModel::ulaby_dobson;
    s.sea_state = 3;
    s.range_bin_m = 600;  // of several stripes' width
    s.azimuth_bins = 12;
    const RunResult r = simulate(s, source);
    const ClassLawParams params = laws_of(s);
    const BackscatterLaw of_grass = class_law(material_table()[grass], params),
                         of_sea = class_law(material_table()[sea], params),
                         of_town = class_law(material_table()[town], params);
    double expected = 0;
    // 60 to 90 degrees, 3000 to 3600 m of slant range: pieces of 2 m.
    for (double x = 2200; x < 3300; x += 2)
        for (double y = -2; y < 1650; y += 2) {
            const double range = std::sqrt(x * x + y * y + 1500.0 * 1500), azimuth = std::atan2(x, y) / degree;
            if (range < 3000 || range >= 3600 || azimuth < 60 || azimuth >= 90) continue;
            const ClassId id = stripe(std::floor((6007 + x) / 30 + 0.5));
            const BackscatterLaw& law = id == grass ? of_grass : id == sea ? of_sea : of_town;
            expected += law.factor(1500 / range) * 1500 / range * 4 / std::pow(range, 4);
        }
    expected *= radar_constant(s.radar);
    CHECK_THAT(10 * std::log10(echo_at(r, 75, 3300) / expected), WithinAbs(0, 0.05));
}

TEST_CASE("a model that does not reach the frequency is refused by name, before any sweep", "[class-laws]") {
    MemorySource source(101, 101, 30, [](double, double) { return 0.0; });
    Scene s = bare_scene(1500, -1500, 800, 1200);
    s.radar.frequency_hz = 30e9;
    s.land = LandModel::ulaby_dobson;
    CHECK(test::refusal<InputError>([&] { resolve(s, source); }).find("Ulaby-Dobson") != std::string::npos);
    s.land = LandModel::constant_gamma;
    s.radar.frequency_hz = 40e9;
    s.sea_state = 2;
    CHECK(test::refusal<InputError>([&] { resolve(s, source); }).find("NRL sea") != std::string::npos);
    s.sea_state = 7;
    CHECK(test::refusal<InputError>([&] { resolve(s, source); }) == "sea-state is 7; it must be at least 0 and at most 6");
}

TEST_CASE("a class with a side returns as that side is turned to the sensor, ground and walls alike", "[class-laws]") {
    // A town round the sensor whose houses look east, or east and west; a tower on one post of each side.
    for (const char* kind : {"uni", "bi"}) {
        MemorySource source(301, 301, 30, [](double, double) { return 0.0; });
        source.editable().default_class = id_of("urban");
        Scene s = bare_scene(4507, -4511, 1500, 4000);
        const RunResult alike = simulate(s, source);
        s.materials = Materials::from_csv("table", text("name,directivity,axis_deg\nurban,", kind, ",90\n"));
        const RunResult sided = simulate(s, source);
        for (const double azimuth : {2.5, 47.5, 92.5, 182.5, 227.5, 272.5, 317.5}) {
            // From the feature back to the radar, averaged over the bin of five degrees.
            double gain = 0;
            constexpr int parts = 50;
            for (int i = 0; i < parts; ++i)
                gain += directivity_gain(kind[0] == 'u' ? Directivity::uni : Directivity::bi,
                                         Angle::degrees(azimuth - 2.5 + 5 * (i + 0.5) / parts + 180), Angle::degrees(90)) /
                        parts;
            INFO(kind << " at " << azimuth);
            CHECK_THAT(echo_at(sided, azimuth, 3025) / echo_at(alike, azimuth, 3025), WithinRel(gain, 0.01));
        }
        // The same for walls: with a low culture all over, all of it is wall.
        source.set_culture_height([](double, double) { return 0.01; });
        const RunResult sided_walls = simulate(s, source);
        s.materials = {};
        const RunResult walls = simulate(s, source);
        const std::vector<ClassGamma> gamma = gamma_table(s.radar.frequency_hz, std::nullopt);
        const ClassGamma& town = gamma[id_of("urban")];
        CHECK_THAT(echo_at(walls, 272.5, 3025) / echo_at(alike, 272.5, 3025), WithinRel(town.wall / town.ground, 0.01));
        for (const double azimuth : {92.5, 272.5})
            CHECK_THAT(echo_at(sided_walls, azimuth, 3025) / echo_at(walls, azimuth, 3025),
                       WithinRel(echo_at(sided, azimuth, 3025) / echo_at(alike, azimuth, 3025), 1e-3));
    }
}

TEST_CASE("an open sea returns its law times the wind's factor, all round, and the law itself in the mean",
          "[class-laws]") {
    MemorySource source(401, 401, 30, [](double, double) { return 0.0; });
    source.editable().default_class = id_of("water");
    Scene s = bare_scene(6007, -6011, 700, 5500);
    s.sea_state = 4;
    const RunResult mean = simulate(s, source);
    for (const double from_deg : {0.0, 205.0}) {
        s.wind_from = Angle::degrees(from_deg);
        const RunResult windy = simulate(s, source);
        for (const double range : {2025.0, 3025.0, 5025.0}) {
            const double psi = std::asin(700 / range) / degree;
            double sum = 0, all = 0;
            for (int row = 0; row < 72; ++row) {
                const double azimuth = 5 * row + 2.5;
                double factor = 0;
                constexpr int parts = 20;
                for (int i = 0; i < parts; ++i)
                    factor += wind_factor(s.radar.frequency_hz, Angle::degrees(psi),
                                          Angle::degrees(azimuth - 2.5 + 5 * (i + 0.5) / parts - from_deg)) /
                              parts;
                INFO("wind from " << from_deg << ", looking to " << azimuth << " at " << range << " m");
                CHECK_THAT(echo_at(windy, azimuth, range) / echo_at(mean, azimuth, range), WithinRel(factor, 0.004));
                sum += echo_at(windy, azimuth, range);
                all += echo_at(mean, azimuth, range);
            }
            CHECK_THAT(sum / all, WithinRel(1.0, 0.001));
        }
    }
    // The bound that the quantum takes holds the brightest sea.
    ClassLawParams ripples{.frequency_hz = 16.5e9, .sea_state = 0.2};  // whose mirror is brighter than metal
    const double mirror = ClassLaws(ripples).most();
    ripples.wind_from = Angle::degrees(205);
    CHECK(ClassLaws(ripples).most() > 1.5 * mirror);
    // Without waves the wind changes nothing, not a bit.
    s.sea_state = 0;
    source.set_classes([](double c, double) { return id_of(c < 180 ? "water" : "grass"); });
    const RunResult still = simulate(s, source);
    s.wind_from.reset();
    const RunResult calm = simulate(s, source);
    CHECK(still.echo_w.cells == calm.echo_w.cells);
}
