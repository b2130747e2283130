// Rain echo: against the closed form of a filled beam, and sums over the wet beam ray by ray.
#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>
#include <numeric>

#include "lib/rain_echo.hpp"
#include "lib/shade.hpp"
#include "tests/refusal.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

const Earth plane;
const Earth four_thirds(4.0 / 3 * mean_radius_m);

WeatherParams rain(double rate_mm_h, double top_m = 3000) { return {.rain_mm_h = rate_mm_h, .rain_top_m = top_m}; }

RadarParams pencil() {
    RadarParams radar;
    radar.antenna.elevation = ElevationPattern::gaussian;
    radar.antenna.knee = Angle::degrees(0);
    radar.antenna.width = Angle::degrees(2);
    return radar;
}

/// The radar amid rain far above it and far below it, over a plane.
RainEchoParams amid(const RadarParams& radar, double most_range_m = 20e3) {
    return {.radar = radar, .earth = plane, .sensor_m = 8000, .reference_m = 0, .most_range_m = most_range_m};
}

PathLossTable table_of(const Weather& weather, const RainEchoParams& p) {
    return {weather, {.earth = p.earth, .sensor_m = p.sensor_m, .most_range_m = p.most_range_m, .highest_m = 20e3}};
}

RainEcho echo_of(const Weather& weather, const RainEchoParams& p) {
    return {weather, table_of(weather, p), PatternTable(p.radar.antenna), p};
}

/// Integral of the two-way Gaussian beam in azimuth.
double width_rad(const RadarParams& radar) {
    return radar.antenna.beam.rad() * std::sqrt(std::numbers::pi / (8 * std::numbers::ln2));
}
/// p(r) of the whole beam.
double density(const RainEcho& echo, const RadarParams& radar, double range_m) {
    return echo.density_w_m_rad(range_m) * width_rad(radar);
}
/// What reaches the receiver at a range: the echoes from there to c tau/2 nearer.
double power(const RainEcho& echo, const RadarParams& radar, double range_m) {
    const double edges[] = {range_m - radar.pulse_extent_m(), range_m};
    return static_cast<double>(echo.cells_w(edges, width_rad(radar))[0]);
}

/// P of a filled Gaussian beam: the radar equation with eta V, V = pi theta_az theta_el r^2 c tau / (16 ln 2).
double filled_beam_w(const RadarParams& radar, double rate_mm_h, double range_m) {
    const double volume = std::numbers::pi * radar.antenna.beam.rad() * radar.antenna.width.rad() * range_m * range_m *
                          speed_of_light_m_s * radar.pulse_s / (16 * std::numbers::ln2);
    return radar_constant(radar) * rain_cross_section_per_m(radar.frequency_hz, rate_mm_h) * volume /
           std::pow(range_m, 4);
}

/// p(r) by a slow sum over rays, with the exact pattern and loss: what the docstring of RainEcho says.
double walked_density(const Weather& weather, const RainEchoParams& p, double range_m) {
    // Far away the wet rays are a few degrees: finer steps over these.
    const double low = range_m < 20e3 ? -std::numbers::pi / 2
                                      : -1.2 * (p.sensor_m / range_m + 0.5 * range_m * p.earth.inverse_radius()),
                 high = range_m < 20e3 ? std::numbers::pi / 2 : 0.1;
    const int steps = range_m < 20e3 ? 200000 : 400000;
    const double step = (high - low) / steps;
    double sum = 0;
    for (int i = 0; i < steps; ++i) {
        const double e = low + (i + 0.5) * step, y = std::sin(e);
        double height = p.sensor_m + range_m * y;
        if (const double c = p.earth.inverse_radius(); c > 0) {
            const double a = 1 / c + p.sensor_m;
            height = std::sqrt(a * a + range_m * range_m + 2 * a * range_m * y) - 1 / c;
            // Below the ray that grazes the level surface, and beyond where it does: hidden.
            const double re = 1 / c + p.reference_m, tangent = std::sqrt(a * a - re * re);
            if (range_m > tangent && y < -tangent / a) continue;
        }
        if (height < p.reference_m || height > weather.params().rain_top_m) continue;
        const double g = elevation_pattern(p.radar.antenna, -e);
        if (g < 1e-5) continue;  // the exact loss is slow; what is 100 dB down in both ways adds nothing
        sum += g * g * std::pow(10, -0.1 * path_loss(weather, p.earth, p.sensor_m, range_m, y).db()) * std::cos(e) /
               std::max(std::cos(e), 0.5) * step;
    }
    return radar_constant(p.radar) * rain_cross_section_per_m(p.radar.frequency_hz, weather.params().rain_mm_h) *
           width_rad(p.radar) * sum / (range_m * range_m);
}

}  // namespace

TEST_CASE("a beam filled with rain returns the cell volume's cross-section, attenuated on both ways", "[rain-echo]") {
    for (const double rate : {0.25, 4.0, 40.0}) {
        const Weather weather(rain(rate, 20e3), 9.4e9);
        RadarParams radar = pencil();
        radar.frequency_hz = 9.4e9;
        const RainEcho echo = echo_of(weather, amid(radar));
        const double gamma = rain_attenuation_db_km(9.4e9, rate, Angle::degrees(0), horizontal_tilt);
        for (const double range : {1000.0, 3000.0, 10e3, 19e3}) {
            // The middle of the pulse; over its length of 75 m the fall with r^2 and the attenuation bend by 1e-3 at 1 km.
            const double middle = range - 0.5 * radar.pulse_extent_m();
            const double expected = filled_beam_w(radar, rate, middle) * std::pow(10, -0.2 * gamma * middle * 1e-3);
            CHECK_THAT(power(echo, radar, range), WithinRel(expected, range < 2000 ? 3e-3 : 2e-3));
            CHECK_THAT(density(echo, radar, middle) * radar.pulse_extent_m(), WithinRel(expected, 1.5e-3));
        }
    }
}

TEST_CASE("without its own attenuation the rain's echo falls with the square of the range", "[rain-echo]") {
    const Weather weather(rain(4, 20e3), 9.4e9), none(WeatherParams{}, 9.4e9);
    const RainEchoParams params = amid(pencil());
    const RainEcho echo(weather, table_of(none, params), PatternTable(params.radar.antenna), params);
    const double first = density(echo, params.radar, 500) * 500 * 500;
    for (const double range : {75.5, 200.0, 1234.5, 10e3, 20e3})
        CHECK_THAT(density(echo, params.radar, range) * range * range, WithinRel(first, 1e-4));
    // The pulse's sum in closed form: (1 / (r - l) - 1 / r).
    const double length = params.radar.pulse_extent_m();
    for (const double range : {150.0, 151.0, 1000.0, 20e3})
        CHECK_THAT(power(echo, params.radar, range), WithinRel(first * length / (range * (range - length)), 1e-4));
}

TEST_CASE("the shaped beam's echo is the sum over its wet rays, near, far, and beyond the horizon", "[rain-echo]") {
    RadarParams radar;  // csc^2
    for (const double sensor : {800.0, 2134.0, 9000.0})
        for (const double rate : {1.0, 16.0}) {
            const Weather weather(rain(rate), radar.frequency_hz);
            const RainEchoParams params{
                .radar = radar, .earth = four_thirds, .sensor_m = sensor, .reference_m = 300, .most_range_m = 300e3};
            const RainEcho echo = echo_of(weather, params);
            for (const double range : {100.0, 600.0, 1700.0, 7000.0, 9100.0, 30e3, 100e3, 200e3}) {
                const double expected = walked_density(weather, params, range);
                INFO("from " << sensor << " m, " << rate << " mm/h, at " << range << " m");
                if (expected > 0)
                    CHECK_THAT(density(echo, radar, range), WithinRel(expected, 2e-3));
                else
                    CHECK(echo.density_w_m_rad(range) == 0);
            }
        }
}

TEST_CASE("the echo through a pattern of points is the sum over its wet rays", "[rain-echo]") {
    RadarParams radar;
    radar.antenna.elevation = ElevationPattern::points;
    radar.antenna.tilt = Angle::degrees(1.5);
    for (const auto& [depression_deg, gain_db] :
         {std::pair{-9.0, -24.0}, {-3.0, -2.0}, {0.0, 0.0}, {1.0, -0.5}, {8.0, -9.0}, {12.0, -8.0}, {70.0, -30.0}})
        radar.antenna.points.push_back({Angle::degrees(depression_deg), Decibel(gain_db)});
    const Weather weather(rain(4), radar.frequency_hz);
    const RainEchoParams params{
        .radar = radar, .earth = four_thirds, .sensor_m = 2134, .reference_m = 300, .most_range_m = 120e3};
    const RainEcho echo = echo_of(weather, params);
    for (const double range : {600.0, 1700.0, 7000.0, 30e3, 100e3}) {
        INFO("at " << range << " m");
        CHECK_THAT(density(echo, radar, range), WithinRel(walked_density(weather, params, range), 2e-3));
    }
}

TEST_CASE("the echo through a pattern of more points than panels is the sum over its wet rays", "[rain-echo]") {
    // Measured every 0.05 degrees: the main lobe and side lobes down to sharp nulls, with the ripple of a measurement.
    RadarParams radar;
    radar.antenna.elevation = ElevationPattern::points;
    radar.antenna.tilt = Angle::degrees(2.2);
    for (int i = -600; i <= 600; ++i) {
        const double x = 0.9 * std::numbers::pi * 0.05 * i, lobe = x == 0 ? 1 : std::sin(x) / x;
        const double gain_db = std::max(20 * std::log10(std::abs(lobe)), -45.0) + 0.4 * std::sin(2.7 * i);
        radar.antenna.points.push_back({Angle::degrees(0.05 * i), Decibel(std::min(0.0, gain_db))});
    }
    REQUIRE(radar.antenna.points.size() > 4 * 256);
    const Weather weather(rain(4), radar.frequency_hz);
    const RainEchoParams params{
        .radar = radar, .earth = four_thirds, .sensor_m = 2134, .reference_m = 300, .most_range_m = 120e3};
    const RainEcho echo = echo_of(weather, params);
    for (const double range : {600.0, 1700.0, 7000.0, 30e3, 100e3}) {
        INFO("at " << range << " m");
        CHECK_THAT(density(echo, radar, range), WithinRel(walked_density(weather, params, range), 2e-3));
    }
}

TEST_CASE("rain is heard as far as its top is above the horizon, and no farther", "[rain-echo]") {
    const RadarParams radar = pencil();
    const Weather weather(rain(0.25), radar.frequency_hz);
    // Tangents of 100 m and of 3000 m over the level surface at sea level: 41.2 and 225.8 km.
    const RainEcho echo = echo_of(
        weather, {.radar = radar, .earth = four_thirds, .sensor_m = 100, .reference_m = 0, .most_range_m = 300e3});
    CHECK(power(echo, radar, 260e3) > 0);
    CHECK(power(echo, radar, 268e3) == 0);
    CHECK(power(echo, radar, 301e3) == 0);
    // High above the rain nothing comes back before its top is reached.
    const RainEcho above = echo_of(
        weather,
        {.radar = RadarParams{}, .earth = four_thirds, .sensor_m = 9000, .reference_m = 0, .most_range_m = 50e3});
    CHECK(power(above, radar, 5900) == 0);
    CHECK(power(above, radar, 6200) > 0);
}

TEST_CASE("circular polarisation takes away what it cancels", "[rain-echo]") {
    const RadarParams radar = pencil();
    for (const auto& [rate, less_db] : {std::pair{4.0, 18.0}, std::pair{16.0, 15.0}}) {
        const Weather weather(rain(rate), radar.frequency_hz);
        RainEchoParams params = amid(radar);
        params.sensor_m = 1500;
        const double plain = power(echo_of(weather, params), radar, 5000);
        params.radar.polarisation = Polarisation::circular;
        CHECK_THAT(10 * std::log10(plain / power(echo_of(weather, params), radar, 5000)), WithinAbs(less_db, 1e-5));
    }
}

TEST_CASE("cells of any edges add up, and nothing is heard while the pulse is being sent", "[rain-echo]") {
    const RadarParams radar;
    const Weather weather(rain(4), radar.frequency_hz);
    const RainEcho echo = echo_of(
        weather, {.radar = radar, .earth = four_thirds, .sensor_m = 2134, .reference_m = 0, .most_range_m = 40e3});
    std::vector<double> fine, coarse{50, 1000, 1003.7, 20e3, 41e3};
    for (double edge = 50; edge < 41e3; edge += 18.75) fine.push_back(edge);
    fine.push_back(41e3);
    const auto total = [&](const std::vector<double>& edges) {
        const std::vector<float> cells = echo.cells_w(edges, 0.01);
        return std::accumulate(cells.begin(), cells.end(), 0.0);
    };
    CHECK_THAT(total(fine), WithinRel(total(coarse), 1e-6));
    // Against the density, by the trapezoid.
    double sum = 0;
    for (int k = 0; k < 4000; ++k) sum += echo.density_w_m_rad(2000 + (k + 0.5) * 0.25) * 0.25 * 0.01;
    CHECK_THAT(static_cast<double>(echo.cells_w(std::vector<double>{2000, 3000}, 0.01)[0]), WithinRel(sum, 1e-6));
    CHECK(echo.cells_w(std::vector<double>{0, 37, 74}, 0.01) == std::vector<float>(2, 0.0F));
    CHECK(echo.cells_w(std::vector<double>{}, 0.01).empty());
}

TEST_CASE("clear air and rain below the ground return nothing", "[rain-echo]") {
    const RadarParams radar;
    RainEchoParams params{
        .radar = radar, .earth = four_thirds, .sensor_m = 2134, .reference_m = 0, .most_range_m = 20e3};
    const RainEcho clear = echo_of(Weather(WeatherParams{}, radar.frequency_hz), params);
    CHECK(power(clear, radar, 5000) == 0);
    CHECK(clear.density_w_m_rad(5000) == 0);
    params.reference_m = 1000;
    CHECK(power(echo_of(Weather(rain(4, 900), radar.frequency_hz), params), radar, 5000) == 0);
}

TEST_CASE("ranges and heights that make no sense are refused by name", "[rain-echo]") {
    const Weather weather(rain(4), 16.5e9);
    const PathLossTable table(weather, {.earth = four_thirds, .sensor_m = 2134, .most_range_m = 1e4});
    const PatternTable pattern{AntennaParams{}};
    const auto refused = [&](const RainEchoParams& params) {
        return test::refusal<InputError>([&] { RainEcho(weather, table, pattern, params); });
    };
    CHECK(refused({.sensor_m = 2134, .most_range_m = 0}) == "range is 0 m; it must be above 0");
    CHECK(refused({.sensor_m = 2e6, .most_range_m = 1e4}) ==
          "sensor height is 2000000 m; it must be at least -1000 and at most 1000000");
}

TEST_CASE("between its knots the echo is the sum over its wet rays too, also where these first meet ground or top",
          "[rain-echo]") {
    // A beam that looks straight down as well as ahead, so that bends at the nadir count in full.
    RadarParams radar = pencil();
    radar.antenna.width = Angle::degrees(120);
    radar.antenna.knee = Angle::degrees(90);  // the table is for angles off the nadir, but where the beam is even there
    const Weather weather(rain(4), radar.frequency_hz);
    for (const double sensor : {420.0, 2134.0, 4500.0}) {
        const RainEchoParams params{
            .radar = radar, .earth = four_thirds, .sensor_m = sensor, .reference_m = 300, .most_range_m = 40e3};
        const RainEcho echo = echo_of(weather, params);
        const double ground = sensor - 300, top = std::abs(sensor - 3000);
        for (const double bend : {ground, top})
            for (const double part : {0.9951, 0.9988, 1.0, 1.0013, 1.0037, 1.0061, 1.0201, 1.333})
                if (const double range = part * bend; range > radar.pulse_extent_m()) {
                    const double expected = walked_density(weather, params, range);
                    INFO("from " << sensor << " m at " << range
                                 << " m: " << density(echo, radar, range) / expected - 1);
                    if (expected > 0)
                        CHECK_THAT(density(echo, radar, range),
                                   WithinRel(expected, part > 1 && part < 1.01 ? 5e-3 : 2.5e-3));
                }
    }
}
