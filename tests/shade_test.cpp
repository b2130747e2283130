// The antenna's pattern in elevation, and its table.
#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "lib/shade.hpp"

using namespace wedgescope;

TEST_CASE("the antenna table is the pattern within its stated error", "[shade]") {
    AntennaParams antenna;
    for (const auto& [kind, exponent] : {std::pair{ElevationPattern::csc2, 0.5},
                                         {ElevationPattern::cos_csc2, 0.5},
                                         {ElevationPattern::cos_csc2, 0.0},
                                         {ElevationPattern::gaussian, 0.5}})
        for (const double tilt : {-40.0, -4.0, 0.0, 10.0}) {
            antenna.elevation = kind;
            antenna.exponent = exponent;
            antenna.tilt = Angle::degrees(tilt);
            const PatternTable table(antenna);
            CHECK(table.error() < 0.002);  // 0.01 dB
            for (double depression = -5; depression < 80; depression += 0.0371) {
                if (std::abs(depression - 90 - tilt) < 0.05) continue;  // a shaped one drops to the floor there
                const double g = elevation_pattern(antenna, depression * std::numbers::pi / 180);
                if (g < 1e-5) continue;
                CHECK(table.at(-std::sin(depression * std::numbers::pi / 180)) ==
                      Approx(g * g).epsilon(1.01 * table.error() + 1e-6));
            }
        }
}

namespace {

AntennaParams antenna_of(const std::vector<std::pair<double, double>>& points) {
    AntennaParams antenna;
    antenna.elevation = ElevationPattern::points;
    for (const auto& [depression_deg, gain_db] : points)
        antenna.points.push_back({Angle::degrees(depression_deg), Decibel(gain_db)});
    return antenna;
}

}  // namespace

TEST_CASE("a pattern of points is a straight line in decibels between them, tilted as a whole, and the floor beyond",
          "[shade]") {
    AntennaParams antenna = antenna_of({{-20, -40}, {-2, -1}, {0, 0}, {30, -12}});
    antenna.tilt = Angle::degrees(4);
    antenna.floor = Decibel(-50);
    const auto db_at = [&](double depression_deg) {
        return 10 * std::log10(elevation_pattern(antenna, depression_deg * std::numbers::pi / 180));
    };
    CHECK(db_at(4) == Approx(0).margin(1e-9));
    CHECK(db_at(19) == Approx(-6));
    CHECK(db_at(3) == Approx(-0.5));
    CHECK(db_at(-7) == Approx(-1 - 39.0 / 2));  // half-way between -2 and -20 in the antenna's frame
    CHECK(db_at(33.9999) == Approx(-12).margin(1e-3));
    CHECK(db_at(34.0001) == Approx(-50));
    CHECK(db_at(-15.9999) == Approx(-40).margin(1e-3));
    CHECK(db_at(-16.0001) == Approx(-50));
    CHECK(db_at(90) == Approx(-50));
    antenna.points[0].gain = Decibel(-70);  // the floor cuts the points too
    CHECK(db_at(-15.9999) == Approx(-50));
}

TEST_CASE("the table of a pattern of points is right to its error where the pattern bends, and far from it",
          "[shade]") {
    // Bends between slopes of 6 dB a degree; a lobe with a sharp null; a drop at one end.
    std::vector<std::pair<double, double>> lobes;
    for (int i = 0; i <= 24; ++i) lobes.push_back({-12.37 + i, i % 2 ? -30.0 : -6.0 - 0.5 * i});
    const std::vector<std::vector<std::pair<double, double>>> patterns = {
        {{-15, -45}, {-7.77, -1.5}, {-6.123, 0}, {3.3, -9}, {3.9, -5.4}, {60, -30}},
        lobes,
        {{-90, -20}, {0, 0}, {90, -20}},
        {{4.9, -50}, {5.001, 0}, {5.1, -50}}};
    for (const auto& points : patterns)
        for (const double tilt : {0.0, 3.21}) {
            AntennaParams antenna = antenna_of(points);
            antenna.tilt = Angle::degrees(tilt);
            const PatternTable table(antenna);
            INFO(points.size() << " points, tilt " << tilt << ", " << table.intervals() << " intervals");
            // Bends of up to 50 dB a degree take 0.0005; a needle of 500 dB a degree is steeper than any table.
            CHECK(table.error() < (points.size() == 3 && tilt >= 0 && points[0].second < -45 ? 0.02 : 0.001));
            CHECK(table.most() <= 1);
            const double drop = 2.0 / table.intervals();
            const auto right_at = [&](double depression_deg) {
                if (std::abs(depression_deg) > 86.9) return;
                const double sine = -std::sin(depression_deg * std::numbers::pi / 180),
                             g = elevation_pattern(antenna, -std::asin(sine));
                for (const double end : {points.front().first, points.back().first})
                    if (std::abs(sine + std::sin((end + tilt) * std::numbers::pi / 180)) < drop) return;
                if (g < 1e-5) return;
                CHECK(table.at(sine) == Approx(g * g).epsilon(1.05 * table.error() + 1e-6));
            };
            for (const auto& [depression_deg, gain] : points) right_at(depression_deg + tilt);
            for (double depression = -86; depression < 86; depression += 0.0371) right_at(depression);
            for (double depression = -13; depression < 13; depression += 0.00137) right_at(depression);
        }
}

TEST_CASE("beside a drop a pattern has the value and the slope of its own side", "[shade]") {
    // 0 dB at 10 degrees of depression, 6 dB less each 20 degrees, an end at 30: its sine is an entry of the table.
    const PatternTable table(antenna_of({{10, 0}, {30, -6}}));
    const auto exact = [](double sine) {
        const double depression = Angle::radians(-std::asin(sine)).deg();
        return std::pow(10, -0.06 * (depression - 10));
    };
    for (const auto& [drop, lit_below] : {std::pair{table.drops()[0], true}, {table.drops()[1], false}}) {
        CAPTURE(drop.sine, drop.low, drop.high);
        CHECK(drop.low < drop.sine);
        CHECK(drop.sine < drop.high);
        CHECK(drop.high - drop.low < 5.0 / table.intervals());
        for (const double part : {0.05, 0.5, 0.95}) {
            const double below = drop.low + part * (drop.sine - drop.low),
                         above = drop.sine + part * (drop.high - drop.sine), lit = lit_below ? below : above,
                         dark = lit_below ? above : below, hair = 1e-5;
            CHECK(table.at(lit) == Approx(exact(lit)).epsilon(0.005));
            CHECK(table.slope(lit) == Approx((exact(lit + hair) - exact(lit - hair)) / (2 * hair)).epsilon(0.02));
            CHECK(table.at(dark) < 1e-6);
            CHECK(std::abs(table.slope(dark)) < 1e-6);
        }
    }
}

TEST_CASE("where a pattern bends within a piece, pieces are so short that their mean is taken right", "[shade]") {
    const auto gaussian = [](double width_deg, double tilt_deg) {
        AntennaParams antenna;
        antenna.elevation = ElevationPattern::gaussian;
        antenna.knee = {};
        antenna.width = Angle::degrees(width_deg);
        antenna.tilt = Angle::degrees(tilt_deg);
        return antenna;
    };
    // A uniform aperture of ten wavelengths, every degree: side lobes 13 dB down and less, and nulls between.
    std::vector<std::pair<double, double>> aperture;
    for (int i = -90; i <= 90; ++i) {
        const double x = 10 * std::numbers::pi * std::sin(i * std::numbers::pi / 180);
        aperture.push_back({i, std::max(i == 0 ? 0.0 : 20 * std::log10(std::abs(std::sin(x) / x)), -40.0)});
    }
    const std::vector<std::pair<const char*, AntennaParams>> antennas = {
        {"1 deg at 30", gaussian(1, 30)},
        {"3 deg at 10", gaussian(3, 10)},
        {"0.3 deg at 50", gaussian(0.3, 50)},
        {"6 deg at 0", gaussian(6, 0)},
        {"side lobe", antenna_of({{-90, -30}, {0, 0}, {10, -45}, {12, -28}, {20, -35}, {90, -50}})},
        {"aperture", antenna_of(aperture)}};
    for (const auto& [name, antenna] : antennas) {
        INFO(name);
        const PatternTable table(antenna);
        const PatternLobe& lobe = table.lobe();
        CHECK(lobe.low < lobe.high);
        CHECK(lobe.part < most_sine_part);
        const auto law = [&](double sine) { return std::pow(elevation_pattern(antenna, -std::asin(sine)), 2); };
        // As the law has it, by a fine sum; what is 60 dB darker than the brightest both ways, 30 above the horizon, need not be so.
        const auto off = [&](double from, double to) {
            double sum = 0;
            for (int i = 0; i < 100; ++i) sum += law(from + (i + 0.5) * 0.01 * (to - from)) * 0.01;
            const double power = piece_power(from, to, 1000, 1000, table, 1e6) / (to - from);
            return std::abs(power - sum) / std::max(sum, (to > 0 ? 1e-3 : 1e-6) * table.most());
        };
        double most_off = 0, most_off_in_lobe = 0, most_off_of_shortest = 0;
        int cut = 0;
        for (double sine = -0.95; sine < 0.5; sine += 0.0007) {
            // As long as straight_over() lets it be.
            double part = most_sine_part;
            const auto from = [&] { return std::max(-1.0, sine - part * (std::abs(sine) + most_sine_offset)); };
            while (part > 1e-4 && !table.straight_over(from(), sine)) part *= 0.98;
            const bool shorter = part < most_sine_part;
            cut += shorter ? 1 : 0;
            if (part <= 1e-4 || table.meets_drop(from(), sine)) continue;
            double& most = shorter ? most_off_in_lobe : most_off;
            most = std::max(most, off(from(), sine));
            // And what lanes take whole, by the shortest of them.
            part = 0.999 * lobe.part;
            if (short_in_lobe(from(), sine, lobe.low, lobe.high, lobe.part)) CHECK(table.straight_over(from(), sine));
            if (sine > lobe.low && sine < lobe.high)
                most_off_of_shortest = std::max(most_off_of_shortest, off(from(), sine));
        }
        CAPTURE(most_off, most_off_in_lobe, most_off_of_shortest, cut, lobe.low, lobe.high, lobe.part);
        CHECK(cut > 50);
        CHECK(most_off < 0.035);
        CHECK(most_off_in_lobe < 0.015);
        CHECK(most_off_of_shortest < 0.008);
    }
}

TEST_CASE("along straight ground a piece's echo is that of all its parts", "[shade]") {
    AntennaParams csc2;
    csc2.knee = Angle::degrees(1);
    double most_off = 0, most_off_at_middle = 0;
    for (const AntennaParams& antenna : {antenna_of({{-180, 0}, {180, 0}}), csc2}) {
        const PatternTable table(antenna);
        for (const double up : {-40.0, -400.0})
            for (const double slope : {0.0, 0.01, -0.01})
                for (double out = 6 * -up; out < 25 * -up; out *= 1.3) {
                    const double step = out / 8;  // as long as one_range() lets it be
                    const auto range_at = [&](double u) { return std::hypot(up + slope * u * step, out + u * step); };
                    const auto sine_at = [&](double u) { return (up + slope * u * step) / range_at(u); };
                    constexpr int parts = 1000;
                    double sum = 0, sine = sine_at(0);
                    for (int i = 1; i <= parts; ++i) {
                        const double next = sine_at(static_cast<double>(i) / parts),
                                     gain = elevation_pattern(antenna, -std::asin(0.5 * (sine + next)));
                        sum += gain * gain * (next - sine) / std::pow(range_at((i - 0.5) / parts), 2);
                        sine = next;
                    }
                    REQUIRE(one_range(range_at(0), range_at(1), sine_at(1) - sine_at(0), sine_at(1)));
                    const double power = piece_power(sine_at(0), sine_at(1), range_at(0), range_at(1), table, 1),
                                 range = 0.5 * (range_at(0) + range_at(1)),
                                 at_middle = piece_power(sine_at(0), sine_at(1), range, range, table, 1);
                    most_off = std::max(most_off, std::abs(power / sum - 1));
                    most_off_at_middle = std::max(most_off_at_middle, std::abs(at_middle / sum - 1));
                }
    }
    // Nearer than a metre is as a metre away, wherever it begins.
    const PatternTable table(csc2);
    CHECK(piece_power(-0.5, -0.4, 0.2, 0.9, table, 1) == piece_power(-0.5, -0.4, 1, 1, table, 1));
    CHECK(most_off < 6e-4);
    CHECK(most_off_at_middle > 7e-3);
}

TEST_CASE("points that follow a law give what the law gives", "[shade]") {
    AntennaParams law;
    law.knee = Angle::degrees(4);
    std::vector<std::pair<double, double>> points;
    for (double beta = -20; beta <= 80; beta += 0.05)
        points.push_back({beta, 10 * std::log10(elevation_pattern(law, beta * std::numbers::pi / 180))});
    const PatternTable exact(law), measured(antenna_of(points));
    for (double sine = -0.98; sine < 0.34; sine += 0.00071)
        CHECK(measured.at(sine) == Approx(exact.at(sine)).epsilon(0.002));  // 0.01 dB
}
