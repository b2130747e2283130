// Path loss: along the ray, against closed forms, published opacities, and sums along the ray step by step in long double;
// the table against the exact form.
#include <catch2/catch.hpp>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "lib/atmosphere.hpp"
#include "lib/path_loss.hpp"
#include "tests/every_target.hpp"
#include "tests/refusal.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using test::refusal;

namespace {

const Earth plane;
const Earth four_thirds(4.0 / 3 * mean_radius_m);

WeatherParams gases(double vapour_g_m3) { return {.vapour_g_m3 = vapour_g_m3}; }
WeatherParams rain(double rate_mm_h, double top_m = 3000) { return {.rain_mm_h = rate_mm_h, .rain_top_m = top_m}; }
WeatherParams cloud(double water_g_m3, double base_m, double top_m) {
    return {.liquid_water_g_m3 = water_g_m3, .cloud_base_m = base_m, .cloud_top_m = top_m};
}
WeatherParams all_of_it() {
    return {.vapour_g_m3 = 7.5,
            .rain_mm_h = 4,
            .rain_top_m = 3000,
            .liquid_water_g_m3 = 0.3,
            .cloud_base_m = 1000,
            .cloud_top_m = 4000,
            .tilt = vertical_tilt};
}

/// Height of the ray by the law of cosines, in long double.
long double ray_height(const Earth& earth, double sensor_m, double sine, long double t) {
    const long double e = sine;
    if (earth.inverse_radius() == 0) return sensor_m + t * e;
    const long double re = 1.0L / earth.inverse_radius(), a = re + sensor_m;
    return std::sqrt(a * a + t * t + 2 * a * t * e) - re;
}

/// The trapezoid with so many steps: two-way dB of what `db_km` (of a height) says.
template <class F>
double walked_db(const Earth& earth, double sensor_m, double range_m, double sine, int steps, const F& db_km) {
    long double sum = 0;
    for (int i = 0; i <= steps; ++i)
        sum += (i == 0 || i == steps ? 0.5L : 1.0L) *
               db_km(static_cast<double>(
                   ray_height(earth, sensor_m, sine, static_cast<long double>(range_m) * i / steps)));
    return static_cast<double>(2e-3L * sum * range_m / steps);
}

struct Way {
    double sensor_m, range_m, sine;
};
/// A point between -500 and 9000 m that the sensor may see over an earth all of whose ground is above -500 m.
class Ways {
public:
    explicit Ways(unsigned seed) : random_(seed) {}
    Way to(double sensor_m, double most_range_m) {
        for (;;) {
            const double point = number(-500, 9000);
            // As many near ones as far ones.
            const double arc =
                number(0, 1) < 0.5 ? number(0, most_range_m) : std::exp(number(0, std::log(most_range_m)));
            const Earth::Sight sight = four_thirds.sight(sensor_m, point, arc);
            if (sight.slant_range_m > most_range_m || sight.slant_range_m < 1) continue;
            const double sine = -std::sin(sight.depression_rad);
            long double least = point;
            for (int i = 0; i <= 100; ++i)
                least = std::min(least, ray_height(four_thirds, sensor_m, sine, 0.01L * i * sight.slant_range_m));
            if (least >= -500.001L) return {sensor_m, sight.slant_range_m, sine};
        }
    }
    double number(double from, double to) { return std::uniform_real_distribution<>(from, to)(random_); }

private:
    std::mt19937 random_;
};

template <class Body>
void on_every_target(const Body& body) {
    for (const Target target : targets_here()) {
        const test::OnTarget on(target);
        INFO("instruction set " << name_of(target));
        body();
    }
}

PathLossRays rays_of(double sensor_m) { return {.earth = four_thirds, .sensor_m = sensor_m, .most_range_m = 400e3}; }

}  // namespace

TEST_CASE("the vertical way through all of the air has the published zenith opacity", "[path-loss]") {
    // Self-check value of the physics reference, section 11: 10.7 GHz, rho0 7.5: 0.012396 Np one way; to one of its last digit.
    const Weather weather(gases(7.5), 10.7e9);
    const double db_of_np = 10 / std::numbers::ln10;
    CHECK_THAT(path_loss(weather, plane, 0, 90e3, 1).db() / (2 * db_of_np), WithinAbs(0.012396, 1e-6));
    // From the top down it is the same, and on a plane a slant way is longer by the sine.
    const double zenith = path_loss(weather, plane, 0, 90e3, 1).db();
    CHECK_THAT(path_loss(weather, plane, 90e3, 90e3, -1).db(), WithinRel(zenith, 1e-9));
    for (const double sine : {0.02, 0.1, 0.5})
        CHECK_THAT(path_loss(weather, plane, 0, 90e3 / sine, sine).db(), WithinRel(zenith / sine, 1e-7));
}

TEST_CASE("a layer that the whole way lies in takes its attenuation times the length", "[path-loss]") {
    const Weather wet(rain(16), 16.5e9), foggy(cloud(thick_fog_g_m3, -500, 3000), 16.5e9);
    const double gamma = rain_attenuation_db_km(16.5e9, 16, Angle::radians(std::asin(0.1)), horizontal_tilt);
    for (const Earth& earth : {plane, four_thirds}) {
        CHECK_THAT(path_loss(wet, earth, 2000, 12e3, -0.1).rain_db, WithinRel(2 * gamma * 12, 1e-12));
        // K_l of the temperature half-way up the layer, at 1250 m.
        const double kl = cloud_attenuation_db_km(16.5e9, standard_air(1250, 7.5).temperature_k);
        CHECK_THAT(path_loss(foggy, earth, 2000, 12e3, -0.1).cloud_db, WithinRel(2 * kl * 0.5 * 12, 1e-12));
    }
    // From above, on a plane: only the part below the top.
    CHECK_THAT(path_loss(wet, plane, 8000, 80e3, -0.1).rain_db, WithinRel(2 * gamma * 30, 1e-12));
    CHECK(path_loss(wet, plane, 8000, 49e3, -0.1).rain_db == 0);
    // Up out of it.
    CHECK_THAT(path_loss(wet, plane, 1000, 80e3, 0.1).rain_db, WithinRel(2 * gamma * 20, 1e-12));
}

TEST_CASE("lengths below a height are those of rays walked step by step", "[path-loss]") {
    Ways ways(1);
    const int steps = 20000;
    for (int k = 0; k < 300; ++k) {
        const double sensor = ways.number(0, 1) < 0.5 ? ways.number(0, 4000) : ways.number(0, 30000),
                     height = ways.number(-400, 12000), range = ways.number(10, 4e5), sine = ways.number(-0.2, 0.1);
        for (const Earth& earth : {plane, four_thirds}) {
            const double walked =
                500 * walked_db(earth, sensor, range, sine, steps, [&](double h) { return h < height ? 1 : 0; });
            // Each of two crossings is off by at most half a step, grazing ones by more only where nothing is between.
            CHECK_THAT(length_below_m(earth, sensor, range, sine, height), WithinAbs(walked, 1.01 * range / steps));
        }
    }
}

TEST_CASE("rays that graze a layer's top, run level or point straight down have the lengths of plane geometry",
          "[path-loss]") {
    CHECK(length_below_m(plane, 1000, 5000, 0, 1000.5) == 5000);
    CHECK(length_below_m(plane, 1000, 5000, 0, 999.5) == 0);
    CHECK(length_below_m(plane, 1000, 5000, 0, 1000) == 0);
    CHECK(length_below_m(plane, 1000, 5000, -0.5, 1000) == 5000);
    CHECK(length_below_m(plane, 1000, 900, -1, 400) == 300);
    CHECK(length_below_m(plane, 1000, 900, 1, 1400) == 400);
    // A chord of the sphere at the sensor's own height: 2 A |sin e| long.
    const double a = 4.0 / 3 * mean_radius_m + 1000;
    CHECK_THAT(length_below_m(four_thirds, 1000, 400e3, -0.01, 1000), WithinRel(2 * a * 0.01, 1e-12));
    CHECK_THAT(length_below_m(four_thirds, 1000, 50e3, -0.01, 1000), WithinRel(50e3, 1e-12));
}

TEST_CASE("the exact form converges, and what it takes by itself is converged to a millionth of a dB", "[path-loss]") {
    const Weather weather(gases(20), 22.235e9);
    for (const Way& way :
         {Way{1, 30e3, 0.001}, Way{2134, 100e3, -0.025}, Way{10000, 400e3, -0.04}, Way{30000, 30200, -0.98}}) {
        const double fine = path_loss(weather, four_thirds, way.sensor_m, way.range_m, way.sine, 64).db();
        const double one = path_loss(weather, four_thirds, way.sensor_m, way.range_m, way.sine, 1).db(),
                     four = path_loss(weather, four_thirds, way.sensor_m, way.range_m, way.sine, 4).db();
        CHECK(std::abs(four - fine) <= std::abs(one - fine) + 1e-10 * fine);
        CHECK_THAT(one, WithinRel(fine, 1e-4));
        CHECK_THAT(four, WithinRel(fine, 1e-7));
        CHECK_THAT(path_loss(weather, four_thirds, way.sensor_m, way.range_m, way.sine).db(), WithinRel(fine, 1e-7));
    }
}

TEST_CASE("the loss is that of rays walked step by step in long double", "[path-loss]") {
    const WeatherParams params = all_of_it();
    const double frequency = 16.5e9;
    const Weather weather(params, frequency);
    const double cloud_db_km =
        cloud_attenuation_db_km(frequency, standard_air(2500, 7.5).temperature_k) * params.liquid_water_g_m3;
    for (const Way& way : {Way{2134, 40e3, -0.06}, Way{2134, 150e3, -0.02}, Way{9000, 300e3, -0.035},
                           Way{30000, 31e3, -0.97}, Way{3, 60e3, 0.01}, Way{3500, 20e3, -0.1}}) {
        const double rain_db_km =
            rain_attenuation_db_km(frequency, 4, Angle::radians(std::asin(way.sine)), vertical_tilt);
        const PathLoss loss = path_loss(weather, four_thirds, way.sensor_m, way.range_m, way.sine);
        const int steps = 5000, layer_steps = 400000;
        const double gas = walked_db(four_thirds, way.sensor_m, way.range_m, way.sine, steps, [&](double h) {
            return gas_attenuation(frequency, standard_air(h, 7.5)).db_km();
        });
        CHECK_THAT(loss.gases_db, WithinRel(gas, 2e-6));  // the trapezoid's error
        const double step_db = 2e-3 * way.range_m / layer_steps;
        CHECK_THAT(loss.rain_db, WithinAbs(walked_db(four_thirds, way.sensor_m, way.range_m, way.sine, layer_steps,
                                                     [&](double h) { return h < 3000 ? rain_db_km : 0; }),
                                           2 * step_db * rain_db_km));
        CHECK_THAT(loss.cloud_db, WithinAbs(walked_db(four_thirds, way.sensor_m, way.range_m, way.sine, layer_steps,
                                                      [&](double h) { return h < 4000 && h > 1000 ? cloud_db_km : 0; }),
                                            2 * step_db * cloud_db_km));
    }
}

TEST_CASE("the profile of the gases is the line-by-line sum", "[path-loss]") {
    Ways ways(2);
    for (const double ghz : {9.4, 16.5, 22.235, 35.0, 60.0, 94.0}) {
        const GasProfile profile(ghz * 1e9, 7.5);
        INFO(ghz << " GHz, error " << profile.error());
        CHECK(profile.error() < 2e-5);
        const double least = 0.01 * profile.db_km(0);
        for (int k = 0; k < 200; ++k) {
            const double height = ways.number(-1000, 60000),
                         truth = gas_attenuation(ghz * 1e9, standard_air(height, 7.5)).db_km();
            CHECK_THAT(profile.db_km(height), WithinAbs(truth, 1.5 * profile.error() * std::max(truth, least)));
        }
        CHECK(profile.db_km(-5000) == profile.db_km(-1000));
        CHECK(profile.db_km(200e3) == 0);
    }
}

TEST_CASE("the table keeps its error, at most 0.005 dB in X to Ka band, up to 400 km from 1 m to 30 km",
          "[path-loss]") {
    Ways ways(3);
    for (const double ghz : {9.4, 16.5, 35.0})
        for (const double vapour : {7.5, 20.0}) {
            const Weather weather(gases(vapour), ghz * 1e9);
            for (const double sensor : {1.0, 100.0, 2134.0, 10000.0, 30000.0}) {
                const PathLossTable table(weather, rays_of(sensor));
                INFO(ghz << " GHz, " << vapour << " g/m^3, from " << sensor << " m: error " << table.error_db()
                         << " dB, " << table.bytes() << " bytes");
                CHECK(table.error_db() <= 0.005);
                CHECK(table.bytes() < (1u << 19));
                double most = 0;
                for (int k = 0; k < 25; ++k) {
                    const Way way = ways.to(sensor, 400e3);
                    const double exact = path_loss(weather, four_thirds, sensor, way.range_m, way.sine).db(),
                                 found = table.loss_db(way.range_m, way.sine, four_thirds.inverse_radius());
                    most = std::max(most, std::abs(found - exact) / std::max(1.0, exact / 100));
                }
                CHECK(most <= table.error_db());
            }
        }
}

TEST_CASE("the table keeps its error at the lines of vapour and oxygen too", "[path-loss]") {
    Ways ways(4);
    for (const double ghz : {22.235, 60.0}) {
        const Weather weather(gases(20), ghz * 1e9);
        for (const double sensor : {3.0, 3000.0, 20000.0}) {
            const PathLossTable table(weather, rays_of(sensor));
            INFO(ghz << " GHz from " << sensor << " m: error " << table.error_db() << " dB, " << table.bytes()
                     << " bytes");
            CHECK(table.error_db() <= 0.01);
            CHECK(table.bytes() < (1u << 22));
            for (int k = 0; k < 25; ++k) {
                const Way way = ways.to(sensor, 400e3);
                const double exact = path_loss(weather, four_thirds, sensor, way.range_m, way.sine).db(),
                             found = table.loss_db(way.range_m, way.sine, four_thirds.inverse_radius());
                if (exact < 2500)  // beyond, factors end at 2^-1000
                    CHECK(std::abs(found - exact) <= table.error_db() * std::max(1.0, exact / 100));
            }
        }
    }
}

TEST_CASE("from above all air the table keeps its error too", "[path-loss]") {
    Ways ways(9);
    const Weather weather(all_of_it(), 16.5e9);
    for (const double sensor : {60e3, 150e3, 700e3}) {
        const PathLossTable table(weather, {.earth = four_thirds, .sensor_m = sensor, .most_range_m = 2 * sensor});
        CHECK(table.error_db() <= 0.005);
        for (int k = 0; k < 25; ++k) {
            const Way way = ways.to(sensor, 2 * sensor);
            const double exact = path_loss(weather, four_thirds, sensor, way.range_m, way.sine).db();
            CHECK(std::abs(table.loss_db(way.range_m, way.sine, four_thirds.inverse_radius()) - exact) <=
                  table.error_db() * std::max(1.0, exact / 100));
        }
    }
}

TEST_CASE("edges of rain and cloud do not break the table's error", "[path-loss]") {
    Ways ways(5);
    const Weather weather(all_of_it(), 16.5e9);
    for (const double sensor : {1.0, 1000.0, 2134.0, 3000.0, 3000.5, 4000.0, 30000.0}) {
        const PathLossTable table(weather, rays_of(sensor));
        CHECK(table.error_db() <= 0.005);
        for (int k = 0; k < 25; ++k) {
            const Way way = ways.to(sensor, 400e3);
            const double exact = path_loss(weather, four_thirds, sensor, way.range_m, way.sine).db(),
                         found = table.loss_db(way.range_m, way.sine, four_thirds.inverse_radius());
            CHECK(std::abs(found - exact) <= table.error_db() * std::max(1.0, exact / 100));
        }
    }
}

TEST_CASE("on a plane the table keeps its error as well", "[path-loss]") {
    Ways ways(6);
    const Weather weather(all_of_it(), 16.5e9);
    for (const double sensor : {10.0, 2134.0, 30000.0}) {
        const PathLossTable table(weather, {.earth = plane, .sensor_m = sensor, .most_range_m = 400e3});
        CHECK(table.error_db() <= 0.005);
        for (int k = 0; k < 25; ++k) {
            const double rise = ways.number(-500, 9000) - sensor, range = std::hypot(rise, ways.number(0, 390e3));
            const double exact = path_loss(weather, plane, sensor, range, rise / range).db();
            CHECK(std::abs(table.loss_db(range, rise / range, 0) - exact) <=
                  table.error_db() * std::max(1.0, exact / 100));
        }
    }
}

TEST_CASE("one table serves the radii of every azimuth", "[path-loss]") {
    Ways ways(7);
    const Weather weather(gases(7.5), 16.5e9);
    for (const double sensor : {300.0, 9000.0}) {
        const PathLossTable table(weather, rays_of(sensor));
        for (const double by : {0.9944, 1.0034}) {  // M and N at the equator over their mean
            const Earth other(by * 4.0 / 3 * mean_radius_m);
            for (int k = 0; k < 25; ++k) {
                const Way way = ways.to(sensor, 390e3);
                const double exact = path_loss(weather, other, sensor, way.range_m, way.sine).db();
                CHECK_THAT(table.loss_db(way.range_m, way.sine, other.inverse_radius()),
                           WithinAbs(exact, table.error_db()));
            }
        }
    }
}

TEST_CASE("the factor is ten to the minus tenth of the loss, down to nothing", "[path-loss]") {
    for (const double rate : {0.25, 4.0, 40.0, 500.0}) {
        const Weather weather(rain(rate), 35e9);
        const PathLossTable table(weather, rays_of(100));
        for (const double range : {1.0, 500.0, 3e3, 2e4, 1e5}) {
            const double loss = path_loss(weather, four_thirds, 100, range, -0.001).db();
            if (loss < 3000)
                CHECK_THAT(table.factor(range, -0.001, four_thirds.inverse_radius()),
                           WithinRel(std::pow(10, -0.1 * loss), 1e-5 * std::max(1.0, loss / 10)));
            else
                CHECK(table.factor(range, -0.001, four_thirds.inverse_radius()) == std::ldexp(1.0, -1000));
        }
    }
}

TEST_CASE("the losses that docs/physics.md gives come out", "[path-loss]") {
    const double rows[][3] = {{40e3, 1.9, 4.3}, {100e3, 4.9, 11.2}, {200e3, 11.1, 26.2}};
    for (const auto& [range, normal, high] : rows) {
        const double arc = four_thirds.arc_m(2134, 300, range).value();
        const double sine = -std::sin(four_thirds.sight(2134, 300, arc).depression_rad);
        const auto loss = [&](double vapour) {
            return path_loss(Weather(gases(vapour), 16.5e9), four_thirds, 2134, range, sine).db();
        };
        CHECK_THAT(loss(normal_vapour_g_m3), WithinAbs(normal, 0.05));
        CHECK_THAT(loss(high_vapour_g_m3), WithinAbs(high, 0.05));
    }
}

TEST_CASE("without weather nothing is lost: the factor is exactly 1", "[path-loss]") {
    const Weather none(WeatherParams{}, 16.5e9);
    CHECK(none.clear());
    const PathLossTable table(none, rays_of(2134));
    CHECK(table.clear());
    CHECK(table.error_db() == 0);
    CHECK(table.factor(50e3, -0.04, four_thirds.inverse_radius()) == 1);
    CHECK(path_loss(none, four_thirds, 2134, 50e3, -0.04).db() == 0);
    // Rain far above which the whole way runs, too.
    const PathLossTable dry_way(Weather(rain(40, 500), 16.5e9), rays_of(8000));
    CHECK(dry_way.factor(50e3, -0.04, four_thirds.inverse_radius()) == 1);
}

TEST_CASE("more rain, more vapour, more cloud and a longer way lose more", "[path-loss]") {
    const auto loss = [](const WeatherParams& params, double range_m = 60e3) {
        const PathLossTable table(Weather(params, 16.5e9), rays_of(2134));
        const double factor = table.factor(range_m, -0.03, four_thirds.inverse_radius());
        CHECK(factor > 0);
        CHECK(factor <= 1);
        return table.loss_db(range_m, -0.03, four_thirds.inverse_radius());
    };
    double before = 0;
    for (const double rate : {0.25, 1.0, 4.0, 16.0, 40.0}) {
        const double now = loss(rain(rate));
        CHECK(now > before);
        before = now;
    }
    CHECK(loss(gases(0)) > 0);
    CHECK(loss(gases(7.5)) > loss(gases(0)));
    CHECK(loss(gases(20)) > loss(gases(7.5)));
    CHECK(loss(cloud(0.5, 0, 1500)) > loss(cloud(0.05, 0, 1500)));
    CHECK(loss(all_of_it(), 70e3) > loss(all_of_it(), 60e3));
}

TEST_CASE("lanes give the bits of single points, on every instruction set, for any number of them", "[path-loss]") {
    Ways ways(8);
    for (const WeatherParams& params : {all_of_it(), gases(20), rain(16), cloud(0.5, 2500, 4000), WeatherParams{}})
        for (const double sensor : {50.0, 3500.0, 12000.0}) {
            const PathLossTable table(Weather(params, 16.5e9), rays_of(sensor));
            for (const std::size_t n : {0u, 1u, 3u, 63u, 64u, 65u, 200u}) {
                std::vector<double> range(n), sine(n), inverse(n), expected(n);
                for (std::size_t i = 0; i < n; ++i) {
                    range[i] = std::exp(ways.number(0, 14));
                    sine[i] = ways.number(-1, 1) * (i % 2 ? 1 : 0.01);
                    inverse[i] = i % 5 == 4 ? 0 : four_thirds.inverse_radius() * ways.number(0.99, 1.01);
                    expected[i] = table.factor(range[i], sine[i], inverse[i]);
                    CHECK(expected[i] >= 0);
                    CHECK(expected[i] <= 1);
                }
                on_every_target([&] {
                    std::vector<double> factor(n, -1);
                    factor_lanes(n, range.data(), sine.data(), inverse.data(), table, factor.data());
                    CHECK(factor == expected);
                });
            }
        }
}

TEST_CASE("lanes that hold no numbers do no harm", "[path-loss]") {
    const PathLossTable table(Weather(all_of_it(), 16.5e9), rays_of(2134));
    const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
    const std::vector<double> odd{nan, infinity, -infinity, 0, -1, 1e300, 1e-300, -1e300, 5e4};
    for (const double range : odd)
        for (const double sine : odd)
            on_every_target([&] {
                const std::vector<double> ranges{range, 5e4}, sines{sine, -0.04},
                    inverse(2, four_thirds.inverse_radius());
                std::vector<double> factor(2);
                factor_lanes(2, ranges.data(), sines.data(), inverse.data(), table, factor.data());
                CHECK(factor[1] == table.factor(5e4, -0.04, four_thirds.inverse_radius()));
            });
}

TEST_CASE("weather and ways that make no sense are refused by name", "[path-loss]") {
    const auto refused = [](const WeatherParams& params, double frequency = 16.5e9) {
        return refusal<InputError>([&] { Weather(params, frequency); });
    };
    CHECK(refused(gases(101)) == "humidity is 101 g/m^3; it must be at least 0 and at most 100");
    CHECK(refused(gases(-1)) == "humidity is -1 g/m^3; it must be at least 0 and at most 100");
    CHECK(refused(rain(-0.5)) == "rain is -0.5 mm/h; it must be at least 0 and at most 500");
    CHECK(refused(rain(4, 30e3)) == "rain-top is 30000 m; it must be at least -1000 and at most 20000");
    CHECK(refused(cloud(11, 0, 100)) == "liquid-water is 11 g/m^3; it must be at least 0 and at most 10");
    CHECK(refused(cloud(0.1, 200, 200)) ==
          "cloud-top is 200 m; it must be above cloud-base, which is 200 m, and at most 20000 m");
    CHECK(refused(gases(7.5), 0.5e9) == "frequency with gases is 0.5 GHz; it must be at least 1 and at most 1000");
    CHECK(refused(rain(4), 0.5e9) == "frequency with rain is 0.5 GHz; it must be at least 1 and at most 1000");
    CHECK(refused(cloud(0.1, 0, 100), 300e9) ==
          "frequency with cloud is 300 GHz; it must be at least 1 and at most 200");
    CHECK(refused({.tilt = Angle::degrees(100)}) ==
          "polarisation tilt is 100 deg; it must be at least -90 and at most 90");
    // What is off is not checked against a frequency it has no part in.
    CHECK(refused(WeatherParams{}, 0.1e9) == test::nothing_refused);
    CHECK(refused(rain(NAN)) != test::nothing_refused);

    const Weather weather(gases(7.5), 16.5e9);
    CHECK(refusal<InputError>([&] { path_loss(weather, plane, 100, 0, 0); }) == "range is 0 m; it must be above 0");
    CHECK(refusal<InputError>([&] { path_loss(weather, plane, 100, 10, 1.5); }) ==
          "sine of the elevation is 1.5; it must be at least -1 and at most 1");
    CHECK(refusal<InputError>([&] { path_loss(weather, plane, -2000, 10, 0); }) ==
          "sensor height is -2000 m; it must be at least -1000 and at most 1000000");
    CHECK(refusal<InputError>([&] { PathLossTable(weather, {.sensor_m = 10, .most_range_m = 0}); }) ==
          "range is 0 m; it must be above 0");
    CHECK(refusal<InputError>([&] {
              PathLossTable(weather, {.sensor_m = 10, .most_range_m = 10, .lowest_m = 100, .highest_m = 100});
          }) == "lowest point is 100 m; it must be below the highest, 100 m");
}
