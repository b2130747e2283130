// Beam and pulse, against closed forms of the patterns and of the pulse's overlap with range bins.
#include <oneapi/tbb/global_control.h>
#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>

#include "lib/beam.hpp"
#include "lib/error.hpp"
#include "tests/every_target.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr double float_error = 1.5e-7;  // one rounding of the weight, one of the result

PolarGrid grid(std::int64_t circle, double range_bin_m, Interval azimuths, Interval ranges) {
    return {circle, range_bin_m, azimuths, ranges};
}

/// No height, so that the ground lies at the antenna's level and cos d is 1 everywhere.
BeamSetting level(double beam_deg, double pulse_extent_m) {
    BeamSetting setting;
    setting.antenna.beam = Angle::degrees(beam_deg);
    setting.pulse_extent_m = pulse_extent_m;
    return setting;
}

float at(const PolarImage<float>& image, std::int64_t azimuth, std::int64_t range) {
    return image.row(static_cast<std::size_t>(azimuth))[range];
}
float& at(PolarImage<float>& image, std::int64_t azimuth, std::int64_t range) {
    return image.row(static_cast<std::size_t>(azimuth))[range];
}

double sum(const PolarImage<float>& image) {
    double total = 0;
    for (const float cell : image.cells) total += static_cast<double>(cell);
    return total;
}

}  // namespace

TEST_CASE("at its half-power points the two-way beam is a quarter, of either pattern", "[beam]") {
    AntennaParams antenna;
    antenna.beam = Angle::degrees(3);
    const double half = Angle::degrees(1.5).rad();
    for (const AzimuthPattern pattern : {AzimuthPattern::gaussian, AzimuthPattern::uniform}) {
        antenna.azimuth = pattern;
        CHECK(two_way_azimuth_pattern(antenna, 0) == 1);
        CHECK_THAT(two_way_azimuth_pattern(antenna, half), WithinRel(0.25, 1e-12));
        CHECK_THAT(two_way_azimuth_pattern(antenna, -half), WithinRel(0.25, 1e-12));
    }
}

TEST_CASE("a uniform aperture has its first sidelobe 13.26 dB down, twice, and is cut at its fifth null", "[beam]") {
    AntennaParams antenna;
    antenna.azimuth = AzimuthPattern::uniform;
    antenna.beam = Angle::degrees(1);
    const double per_u = Angle::degrees(1).rad() / (2 * 1.39155737825151);
    CHECK_THAT(10 * std::log10(two_way_azimuth_pattern(antenna, 4.493409457909 * per_u)), WithinAbs(-2 * 13.26, 0.01));
    CHECK_THAT(two_way_azimuth_pattern(antenna, std::numbers::pi * per_u), WithinAbs(0, 1e-30));
    CHECK(two_way_azimuth_pattern(antenna, 4.5 * std::numbers::pi * per_u) > 0);
    CHECK(two_way_azimuth_pattern(antenna, 5.01 * std::numbers::pi * per_u) == 0);
    antenna.azimuth = AzimuthPattern::gaussian;
    CHECK(two_way_azimuth_pattern(antenna, Angle::degrees(2.23).rad()) > 0);
    CHECK(two_way_azimuth_pattern(antenna, Angle::degrees(2.25).rad()) == 0);
}

TEST_CASE("a pulse of whole bins weighs a half, ones, and a half", "[beam]") {
    CHECK(pulse_weights(1) == std::vector<double>{0.5, 0.5});
    CHECK(pulse_weights(4) == std::vector<double>{0.5, 1, 1, 1, 0.5});
    // Half a bin: the mean overlap of (x - 1/2, x] with the own bin is 3/8, with the nearer 1/8.
    CHECK(pulse_weights(0.5) == std::vector<double>{0.375, 0.125});
}

TEST_CASE("a pulse weighs each nearer bin by its mean overlap, and in all by its length", "[beam]") {
    for (const double width : {0.01, 0.3, 1.0, 1.7, 2.5, 7.25}) {
        const std::vector<double> weights = pulse_weights(width);
        double total = 0;
        for (std::size_t m = 0; m < weights.size(); ++m) {
            // The mean over x in (0, 1) of the overlap of (x - width, x] with (-m, 1 - m], by the midpoint rule:
            // its error is at most a kink or two, 1e-8 of a bin.
            double mean = 0;
            const int steps = 10000;
            for (int k = 0; k < steps; ++k) {
                const double x = (k + 0.5) / steps;
                const double near_edge = -static_cast<double>(m);
                mean += std::max(0.0, std::min(x, near_edge + 1) - std::max(x - width, near_edge)) / steps;
            }
            CHECK_THAT(weights[m], WithinAbs(mean, 2e-8));
            total += weights[m];
        }
        CHECK_THAT(total, WithinRel(width, 1e-12));
        CHECK(weights.back() > 0);
    }
}

TEST_CASE("the echo of a point is painted away from the radar over the pulse's length", "[beam]") {
    BeamSetting setting = level(1.5, 45);  // three bins
    setting.beam_width_error = true;
    const PolarGrid g = grid(960, 15, {0, 960}, {0, 40});
    PolarImage<float> echo(g);
    at(echo, 100, 10) = 1;
    const PolarImage<float> power = power_image(echo, g, setting);
    const double expected[] = {0, 0, 0.5, 1, 1, 0.5, 0, 0};
    for (int k = 0; k < 8; ++k) CHECK_THAT(at(power, 100, 8 + k), WithinAbs(expected[k], float_error));
}

TEST_CASE("the echo of a point is painted over the beam, symmetrically, through north", "[beam]") {
    // Beam of 1.5 degrees, bins of 3/8 degree: g^2 = 2^(-8 (k/4)^2).
    const BeamSetting setting = level(1.5, 15);
    const PolarGrid g = grid(960, 15, {0, 960}, {0, 8});
    PolarImage<float> echo(g);
    at(echo, 2, 3) = 1;
    const PolarImage<float> power = power_image(echo, g, setting);
    for (std::int64_t k = -8; k <= 8; ++k) {
        const double expected = 0.5 * std::exp2(-0.5 * static_cast<double>(k * k));  // half: the pulse's first bin
        CHECK_THAT(at(power, (2 + k + 960) % 960, 3), WithinRel(expected, 2 * float_error));
    }
    CHECK(at(power, 11 + 2, 3) == 0);
    CHECK(at(power, 480, 3) == 0);
    CHECK(skirt_bins(setting, 960) == 17);  // 2.24 beamwidths at cos d = 1/2: 2.24 * 4 / 0.5
}

TEST_CASE("a Gaussian beam takes in 0.7527 of its width, more under the sensor", "[beam]") {
    // Plane, 1000 m up: at slant range r the level ground lies at sin d = 1000 / r.
    BeamSetting setting = level(1.5, 10);
    setting.sensor_m = 1500;
    setting.reference_m = 500;
    const PolarGrid g = grid(1440, 10, {0, 1440}, {0, 300});
    PolarImage<float> echo(g);
    std::fill(echo.cells.begin(), echo.cells.end(), 1.0f);
    const PolarImage<float> power = power_image(echo, g, setting);
    const double bins_per_beam = 6;
    for (const std::int64_t j : {150, 200, 299}) {
        // Mean of this bin and the nearer one, as the pulse of one bin does.
        const auto taken = [&](std::int64_t bin) {
            const double sine = 1000 / ((static_cast<double>(bin) + 0.5) * 10);
            return std::sqrt(std::numbers::pi / (8 * std::numbers::ln2)) * bins_per_beam / std::sqrt(1 - sine * sine);
        };
        // The sum over bins is the integral to 1e-12; the cut leaves 1e-7 out.
        CHECK_THAT(at(power, 77, j), WithinRel(0.5 * (taken(j) + taken(j - 1)), 3e-7));
    }
    // Where cos d would be below a half, or there is no level ground at all, it counts as a half.
    CHECK_THAT(at(power, 77, 110), WithinRel(0.75269 * bins_per_beam / 0.5, 1e-5));
    CHECK_THAT(at(power, 77, 20), WithinRel(0.75269 * bins_per_beam / 0.5, 1e-5));
    CHECK_THAT(level_cosine(setting, 2000), WithinRel(std::sqrt(0.75), 1e-12));
    CHECK(level_cosine(setting, 500) == 0.5);
}

TEST_CASE("switched off, beam and pulse leave the same total in the own bin", "[beam]") {
    BeamSetting on = level(2, 37);
    BeamSetting off = on;
    off.beam_width_error = off.pulse_length_error = false;
    const PolarGrid g = grid(720, 10, {0, 720}, {0, 60});
    PolarImage<float> echo(g);
    at(echo, 300, 20) = 2;
    at(echo, 719, 31) = 5;
    const PolarImage<float> spread = power_image(echo, g, on);
    const PolarImage<float> sharp = power_image(echo, g, off);
    CHECK_THAT(sum(sharp), WithinRel(sum(spread), 1e-6));  // some hundred roundings to float
    // 3.7 bins of pulse, 0.75269 of four bins of beam.
    CHECK_THAT(at(sharp, 300, 20), WithinRel(2 * 3.7 * 0.75269 * 4, 1e-5));
    CHECK(at(sharp, 300, 21) == 0);
    CHECK(at(sharp, 301, 20) == 0);
    CHECK(skirt_bins(off, 720) == 0);
    CHECK(lead_in_bins(off, 10) == 0);
    CHECK(lead_in_bins(on, 10) == 4);
}

TEST_CASE("a beam wider than the circle sees each bin once", "[beam]") {
    for (const std::int64_t circle : {15, 16}) {
        const BeamSetting setting = level(90, 10);
        CHECK(skirt_bins(setting, circle) == circle / 2);
        const PolarGrid g = grid(circle, 10, {0, circle}, {0, 4});
        PolarImage<float> echo(g);
        std::fill(echo.cells.begin(), echo.cells.end(), 1.0f);
        double expected = 0;
        for (std::int64_t k = 0; k < circle; ++k) {
            const double turn = static_cast<double>(std::min(k, circle - k)) / static_cast<double>(circle);
            const double beamwidths = 4 * turn;  // at most 2: within the cut
            expected += std::exp2(-8 * beamwidths * beamwidths);
        }
        const PolarImage<float> power = power_image(echo, g, setting);
        for (std::int64_t i = 0; i < circle; ++i) CHECK_THAT(at(power, i, 2), WithinRel(expected, float_error));
    }
}

TEST_CASE("a slice with its skirt and lead-in gives the bits of the whole circle", "[beam]") {
    BeamSetting setting = level(3, 47);
    setting.sensor_m = 400;
    const PolarGrid whole = grid(480, 10, {0, 480}, {0, 200});
    PolarImage<float> echo(whole);
    for (std::size_t k = 0; k < echo.cells.size(); ++k)
        echo.cells[k] = static_cast<float>((k * 2654435761u) % 1000) * 1e-15f;
    const PolarImage<float> all = power_image(echo, whole, setting);

    const std::int64_t skirt = skirt_bins(setting, 480), lead = lead_in_bins(setting, 10);
    const PolarGrid shown = grid(480, 10, {470, 490}, {50, 150});  // across north
    const PolarGrid swept = grid(480, 10, {470 - skirt, 490 + skirt}, {50 - lead, 150});
    PolarImage<float> slice(swept);
    for (std::size_t i = 0; i < swept.azimuth_count(); ++i)
        for (std::size_t j = 0; j < swept.range_count(); ++j)
            slice.row(i)[j] =
                echo.row((static_cast<std::size_t>(470 - skirt) + i) % 480)[static_cast<std::size_t>(50 - lead) + j];
    const PolarImage<float> part = power_image(slice, shown, setting);
    bool same = true;
    for (std::size_t i = 0; i < 20; ++i)
        for (std::size_t j = 0; j < 100; ++j) same = same && part.row(i)[j] == all.row((470 + i) % 480)[50 + j];
    CHECK(same);

    const PolarGrid tight = grid(480, 10, {471 - skirt, 490 + skirt}, {50 - lead, 150});
    CHECK_THROWS_AS(power_image(PolarImage<float>(tight), shown, setting), InputError);
    const PolarGrid late = grid(480, 10, {470 - skirt, 490 + skirt}, {51 - lead, 150});
    CHECK_THROWS_AS(power_image(PolarImage<float>(late), shown, setting), InputError);
}

TEST_CASE("long rows come out as short ones do, with any number of threads", "[beam][threads]") {
    // More bins than one strip: what lies behind 4096 must not show.
    BeamSetting setting = level(4, 200);
    setting.sensor_m = 3000;
    const PolarGrid g = grid(360, 10, {0, 360}, {0, 4400});
    PolarImage<float> echo(g);
    for (std::size_t k = 0; k < echo.cells.size(); ++k)
        echo.cells[k] = static_cast<float>((k * 2654435761u) % 1000) * 1e-15f;
    const PolarImage<float> parallel = power_image(echo, g, setting);
    {
        const oneapi::tbb::global_control one(oneapi::tbb::global_control::max_allowed_parallelism, 1);
        CHECK(power_image(echo, g, setting).cells == parallel.cells);
    }
    const PolarGrid across = grid(360, 10, {10, 12}, {4000, 4200});
    const PolarImage<float> part = power_image(echo, across, setting);
    bool same = true;
    for (std::size_t j = 0; j < 200; ++j) same = same && part.row(1)[j] == parallel.row(11)[4000 + j];
    CHECK(same);
}

TEST_CASE("a power image in the echoes' own memory has the bits of one beside them", "[beam]") {
    // Strips from one to many, some by the pulse's length; few and many azimuths; parts without any echo.
    struct Case {
        std::int64_t azimuths, ranges;
        double beam_deg, pulse_m;
        bool range_is_ground;
    };
    const Case c =
        GENERATE(Case{1, 300, 4, 75, false}, Case{360, 3100, 4, 200, false}, Case{960, 1100, 1.5, 75, true},
                 Case{2000, 700, 0.5, 1500, false}, Case{2000, 300, 0.5, 75, false}, Case{8, 40, 4, 1e4, false});
    CAPTURE(c.azimuths, c.ranges, c.pulse_m);
    BeamSetting setting = level(c.beam_deg, c.pulse_m);
    setting.sensor_m = 3000;
    setting.range_is_ground = c.range_is_ground;
    const PolarGrid g = grid(c.azimuths, 10, {0, c.azimuths}, {0, c.ranges});
    PolarImage<float> echo(g);
    for (std::size_t k = 0; k < echo.cells.size(); ++k)
        echo.cells[k] = k / 700 % 3 == 1 ? 0 : static_cast<float>((k * 2654435761u) % 1000) * 1e-15f;
    std::vector<float> rain(g.range_count());
    for (std::size_t j = 0; j < rain.size(); ++j) rain[j] = static_cast<float>(j % 7) * 1e-15f;
    const std::vector<float> none(g.range_count());
    for (const EchoAround& around : {EchoAround{}, EchoAround{{rain}}, EchoAround{{rain, none, none}}}) {
        const PolarImage<float> beside = power_image(echo, g, setting, {}, around);
        PolarImage<float> own = echo;
        const float* const memory = own.cells.data();
        const bool wide = c.ranges >= 4 * std::max<std::int64_t>({64, 262144 / c.azimuths, lead_in_bins(setting, 10)});
        const PolarImage<float> in_place = power_in_place(std::move(own), setting, around);
        CHECK(in_place.grid == g);
        CHECK((in_place.cells.data() == memory) == wide);
        CHECK(in_place.cells == beside.cells);
    }
    PolarImage<float> part(grid(c.azimuths, 10, {0, c.azimuths}, {100, 300}));
    CHECK_THROWS_AS(power_in_place(std::move(part), setting), InputError);
}

TEST_CASE("what is around an echo image goes straight from one azimuth to the next", "[beam]") {
    const BeamSetting setting = level(3, 75);
    const PolarGrid g = grid(360, 20, {350, 400}, {0, 200}), wider = grid(360, 20, {330, 420}, {0, 200});
    const PolarImage<float> none(wider);
    const std::vector<float> here(g.range_count(), 1e-12f), there(g.range_count(), 3e-12f);
    const auto power = [&](const EchoAround& around) { return power_image(none, g, setting, {}, around); };
    // Three times as much to the east and to the west as to the north.
    const PolarImage<float> everywhere = power({{here}}), four = power({{here, there, {}, there}});
    for (const std::int64_t azimuth : {350, 359, 360, 361, 389, 399}) {
        const std::size_t row = g.row_of(azimuth);
        const double off_deg = std::abs(static_cast<double>(azimuth) + 0.5 - 360);
        CHECK(four.row(row)[150] ==
              Approx(static_cast<double>(everywhere.row(row)[150]) * (1 + 2 * off_deg / 90)).epsilon(1e-5));
    }
    const EchoAround place{{here, there, here, there}};
    const EchoAround::Place last = place.at(359, 360), behind = place.at(-1, 360);
    CHECK(last.first == 3);
    CHECK(last.second == 0);
    CHECK(last.part == Approx(89.5 / 90));
    CHECK(behind.first == last.first);
    CHECK_THROWS_AS(power({{std::vector<float>(7)}}), Error);
}

TEST_CASE("on ground range the pulse lights what lies within its length in slant range", "[beam]") {
    // Plane, 1000 m up. Each output is the mean over its bin of what lies from sqrt(s^2 + h^2) - c tau/2 on, walked in small steps.
    const double h = 1000, bin_m = 10;
    for (const double extent_m : {60.0, 7.0, 400.0}) {
        BeamSetting setting = level(1.5, extent_m);
        setting.sensor_m = h;
        setting.range_is_ground = true;
        setting.beam_width_error = false;
        constexpr std::int64_t bins = 400;
        const PolarGrid g = grid(960, bin_m, {0, 960}, {0, bins});
        // Rings of level ground, brighter farther out.
        const auto integral = [](double s) { return s * s * (0.5 + s / 2100); };
        PolarImage<float> echo(g);
        for (std::int64_t j = 0; j < bins; ++j) {
            const double s = (static_cast<double>(j) + 0.5) * bin_m;
            // What the beam will take in of it, to 1e-7 (the test above).
            const double taken = std::sqrt(std::numbers::pi / (8 * std::numbers::ln2)) * 1.5 / 0.375 /
                                 std::max(0.5, s / std::hypot(s, h));
            at(echo, 5, j) = static_cast<float>((integral(s + 0.5 * bin_m) - integral(s - 0.5 * bin_m)) / taken);
        }
        const PolarImage<float> power = power_image(echo, g, setting);
        const auto nearest = [&](double s) {
            const double r = std::hypot(s, h) - extent_m;
            return r > h ? std::sqrt(r * r - h * h) : 0.0;
        };
        for (std::int64_t j = 0; j < bins; ++j) {
            constexpr int steps = 200;
            double sum = 0;
            for (int k = 0; k < steps; ++k) {
                const double s = (static_cast<double>(j) + (k + 0.5) / steps) * bin_m;
                sum += integral(s) - integral(nearest(s));
            }
            INFO("pulse of " << extent_m << " m, bin " << j);
            CHECK_THAT(static_cast<double>(at(power, 5, j)), WithinRel(sum / steps, 0.004));
        }
        CHECK(static_cast<double>(lead_in_bins(setting, bin_m)) ==
              std::ceil(std::sqrt((h + extent_m) * (h + extent_m) - h * h) / bin_m));
        CHECK(pulse_on_ground_m(setting, 1, 5000) == Approx(5000 - nearest(5000)).epsilon(1e-9));
        CHECK(pulse_on_ground_m(setting, 1, 1) == 1);
    }
}

TEST_CASE("on ground range far out, from low down and in parts the pulse loses nothing", "[beam]") {
    // On a curved earth it is longest where it touches the nadir or at the far end: a part of the image has the bits of the whole.
    for (const double height_m : {0.0, 20.0, 3000.0}) {
        BeamSetting setting = level(6, 1500);
        setting.earth = Earth(6371000.0);
        setting.sensor_m = height_m;
        setting.range_is_ground = true;
        const PolarGrid whole = grid(30, 150, {0, 30}, {0, 12000});
        PolarImage<float> echo(whole);
        for (std::size_t k = 0; k < echo.cells.size(); ++k)
            echo.cells[k] = static_cast<float>((k * 2654435761u) % 1000) * 1e-15f;
        const PolarImage<float> all = power_image(echo, whole, setting);
        CHECK(power_in_place(PolarImage<float>(echo), setting).cells == all.cells);
        const std::int64_t lead = lead_in_bins(setting, 150);
        PolarGrid far = grid(30, 150, {0, 30}, {11800, 12000}), swept = far;
        swept.range_bins.begin -= lead;
        PolarImage<float> part(swept);
        for (std::size_t i = 0; i < 30; ++i)
            std::copy_n(echo.row(i) + swept.range_bins.begin, swept.range_count(), part.row(i));
        const PolarImage<float> shown = power_image(part, far, setting);
        for (std::size_t i = 0; i < 30; ++i)
            CHECK(std::equal(shown.row(i), shown.row(i) + far.range_count(), all.row(i) + far.range_bins.begin));
    }
    // The bin in which the near end leaves the nadir, as long at both its edges: the mean of its length walked in small steps.
    BeamSetting setting = level(1.5, 150);
    setting.sensor_m = 20;
    setting.range_is_ground = true;
    setting.beam_width_error = false;
    const PolarGrid g = grid(960, 75, {0, 960}, {0, 8});
    PolarImage<float> echo(g);
    const auto cosine = [](std::int64_t bin) {
        const double s = (static_cast<double>(bin) + 0.5) * 75;
        return std::max(0.5, s / std::hypot(s, 20));
    };
    for (std::int64_t bin = 0; bin < 8; ++bin)
        at(echo, 5, bin) =
            static_cast<float>(cosine(bin) * (static_cast<double>(bin) + 0.5));  // as the beam takes a ring
    const PolarImage<float> power = power_image(echo, g, setting);
    const auto mean = [](int bin) {
        double sum = 0;
        for (int k = 0; k < 1000; ++k) {
            const double s = (bin + (k + 0.5) / 1000) * 75, r = std::hypot(s, 20) - 150;
            sum += s * s - (r > 20 ? r * r - 400 : 0);
        }
        return sum / 1000;
    };
    CHECK_THAT(static_cast<double>(at(power, 5, 2)) / static_cast<double>(at(power, 5, 3)),
               WithinRel(mean(2) / mean(3), 0.005));
}

TEST_CASE("an exaggerated beam is so many times as wide and so many times as faint", "[beam]") {
    // Beam of 1.5 degrees drawn three times as wide, bins of 3/8 degree: g^2 = 2^(-8 (k/12)^2), a third of it, since the
    // integral of the Gaussian grows as its width.
    BeamSetting setting = level(1.5, 15);
    setting.beam_width_scale = 3;
    const PolarGrid g = grid(960, 15, {0, 960}, {0, 8});
    PolarImage<float> echo(g);
    at(echo, 2, 3) = 1;
    const PolarImage<float> power = power_image(echo, g, setting);
    for (std::int64_t k = -26; k <= 26; ++k) {
        const double expected = 0.5 / 3 * std::exp2(-8 * static_cast<double>(k * k) / 144);
        CHECK_THAT(at(power, (2 + k + 960) % 960, 3), WithinRel(expected, 5e-7));  // the cut leaves out 1e-7 of the sum
    }
    CHECK(at(power, 2 + 27, 3) == 0);       // 2.24 beamwidths of 12 bins
    CHECK(skirt_bins(setting, 960) == 53);  // 2.24 * 4 * 3 / 0.5
    CHECK(lead_in_bins(setting, 15) == 1);
}

TEST_CASE("an exaggerated pulse is so many times as long and so many times as faint", "[beam]") {
    BeamSetting setting = level(1.5, 30);  // two bins, drawn as five
    setting.pulse_length_scale = 2.5;
    setting.beam_width_error = false;
    const PolarGrid g = grid(960, 15, {0, 960}, {0, 40});
    PolarImage<float> echo(g);
    at(echo, 100, 10) = 1;
    const PolarImage<float> power = power_image(echo, g, setting);
    const double beam = std::sqrt(std::numbers::pi / (8 * std::numbers::ln2)) * 4;
    const double expected[] = {0, 0, 0.5, 1, 1, 1, 1, 0.5, 0, 0};
    for (int k = 0; k < 10; ++k) CHECK_THAT(at(power, 100, 8 + k), WithinRel(0.4 * beam * expected[k], 5e-7));
    CHECK(lead_in_bins(setting, 15) == 5);
    setting.range_is_ground = true;  // from no height at all it is as long there
    CHECK(lead_in_bins(setting, 15) == 5);
}

TEST_CASE("an even plain keeps its level however beam and pulse are drawn", "[beam]") {
    for (const AzimuthPattern pattern : {AzimuthPattern::gaussian, AzimuthPattern::uniform})
        for (const bool ground : {false, true})
            for (const std::int64_t circle : {15, 16, 720}) {
                BeamSetting setting = level(2, 37);
                setting.antenna.azimuth = pattern;
                setting.range_is_ground = ground;
                setting.sensor_m = 1000;
                const PolarGrid g = grid(circle, 10, {0, circle}, {0, 400});
                PolarImage<float> echo(g);
                std::fill(echo.cells.begin(), echo.cells.end(), 1.0f);
                const PolarImage<float> plain = power_image(echo, g, setting);
                // 20 makes the beam wider than a circle of 15 bins has room for, and reaches back 74 bins.
                for (const double scale : {0.1, 0.7, 6.0, 20.0}) {
                    INFO(scale << " " << circle << " " << ground);
                    // The beam's own total hangs on range below the sensor: a long pulse takes the mean over its length.
                    setting.beam_width_scale = scale;
                    setting.pulse_length_scale = 1;
                    const PolarImage<float> wide = power_image(echo, g, setting);
                    double worst = 0;
                    for (std::size_t k = 0; k < plain.cells.size(); ++k)
                        worst = std::max(
                            worst,
                            std::abs(static_cast<double>(wide.cells[k]) / static_cast<double>(plain.cells[k]) - 1));
                    CHECK(worst < 4 * float_error);
                    setting.sensor_m = 0;  // level: one total everywhere
                    setting.pulse_length_scale = scale;
                    const double far = static_cast<double>(at(power_image(echo, g, setting), 3, 399));
                    setting.beam_width_scale = setting.pulse_length_scale = 1;
                    CHECK_THAT(far, WithinRel(static_cast<double>(at(power_image(echo, g, setting), 3, 399)),
                                              4 * float_error));
                    setting.sensor_m = 1000;
                }
            }
}

TEST_CASE("a point's echo adds up to the same however it is drawn, and hardly drawn falls into its own bin", "[beam]") {
    BeamSetting setting = level(1.5, 37);
    const PolarGrid g = grid(960, 10, {0, 960}, {0, 200});
    PolarImage<float> echo(g);
    at(echo, 300, 20) = 2;
    at(echo, 959, 31) = 5;
    const double total = sum(power_image(echo, g, setting));
    for (const double beam : {0.1, 0.5, 4.0})
        for (const double pulse : {0.1, 0.5, 4.0}) {
            setting.beam_width_scale = beam;
            setting.pulse_length_scale = pulse;
            CHECK_THAT(sum(power_image(echo, g, setting)), WithinRel(total, 1e-6));  // thousands of roundings to float
        }
    // A tenth of four bins: no neighbour is within the cut, and all is what BWE off leaves there.
    setting.pulse_length_scale = 1;
    setting.beam_width_scale = 0.1;
    const PolarImage<float> narrow = power_image(echo, g, setting);
    setting.beam_width_error = false;
    CHECK(narrow.cells == power_image(echo, g, setting).cells);
}

TEST_CASE("what is switched off has no scale", "[beam]") {
    BeamSetting setting = level(2, 37);
    setting.sensor_m = 700;
    const PolarGrid g = grid(720, 10, {0, 720}, {0, 150});
    PolarImage<float> echo(g);
    for (std::size_t k = 0; k < echo.cells.size(); ++k)
        echo.cells[k] = static_cast<float>((k * 2654435761u) % 1000) * 1e-15f;
    for (const bool pulse : {false, true})
        for (const bool ground : {false, true}) {
            setting.range_is_ground = ground;
            setting.beam_width_error = !pulse;
            setting.pulse_length_error = pulse;
            setting.beam_width_scale = setting.pulse_length_scale = 1;
            const PolarImage<float> plain = power_image(echo, g, setting);
            const std::int64_t skirt = skirt_bins(setting, 720), lead = lead_in_bins(setting, 10);
            (pulse ? setting.beam_width_scale : setting.pulse_length_scale) = 7;
            CHECK(power_image(echo, g, setting).cells == plain.cells);
            CHECK(skirt_bins(setting, 720) == skirt);
            CHECK(lead_in_bins(setting, 10) == lead);
        }
}

TEST_CASE("exaggerated too a slice with its skirt and lead-in gives the bits of the whole circle", "[beam]") {
    BeamSetting setting = level(3, 47);
    setting.sensor_m = 400;
    for (const double scale : {0.3, 1.7, 4.0}) {
        setting.beam_width_scale = scale;
        setting.pulse_length_scale = 2 * scale;
        const PolarGrid whole = grid(480, 10, {0, 480}, {0, 200});
        PolarImage<float> echo(whole);
        for (std::size_t k = 0; k < echo.cells.size(); ++k)
            echo.cells[k] = static_cast<float>((k * 2654435761u) % 1000) * 1e-15f;
        const PolarImage<float> all = power_image(echo, whole, setting);
        const std::int64_t skirt = skirt_bins(setting, 480), lead = lead_in_bins(setting, 10);
        const PolarGrid shown = grid(480, 10, {470, 490}, {50, 150});
        const PolarGrid swept = grid(480, 10, {470 - skirt, 490 + skirt}, {50 - lead, 150});
        PolarImage<float> slice(swept);
        for (std::size_t i = 0; i < swept.azimuth_count(); ++i)
            for (std::size_t j = 0; j < swept.range_count(); ++j)
                slice.row(i)[j] = echo.row((static_cast<std::size_t>(470 - skirt) + i) %
                                           480)[static_cast<std::size_t>(50 - lead) + j];
        const PolarImage<float> part = power_image(slice, shown, setting);
        bool same = true;
        for (std::size_t i = 0; i < 20; ++i)
            for (std::size_t j = 0; j < 100; ++j) same = same && part.row(i)[j] == all.row((470 + i) % 480)[50 + j];
        CHECK(same);
        const PolarGrid tight = grid(480, 10, {471 - skirt, 490 + skirt}, {50 - lead, 150});
        CHECK_THROWS_AS(power_image(PolarImage<float>(tight), shown, setting), InputError);
    }
}

TEST_CASE("a field's exaggerated weights are the square roots of the powers'", "[beam]") {
    BeamSetting setting = level(2, 37);
    setting.beam_width_scale = 2.5;
    setting.pulse_length_scale = 3;
    const Interval outputs{0, 60};
    const Resolution power(setting, 720, 10, outputs, Resolution::Of::power),
        field(setting, 720, 10, outputs, Resolution::Of::amplitude);
    REQUIRE(power.skirt() == field.skirt());
    std::vector<float> point(60, 0.0f), none(60, 0.0f);
    point[20] = 1;
    std::vector<double> scratch, watts(60), volts(60);
    for (const std::int64_t off : {0, 3, 9}) {
        const auto source = [&](std::int64_t bin) { return bin == off ? point.data() : none.data(); };
        power.row(0, source, scratch, watts);
        field.row(0, source, scratch, volts);
        for (std::size_t j = 0; j < 60; ++j) CHECK_THAT(volts[j] * volts[j], WithinAbs(watts[j], 3e-7));
    }
}

TEST_CASE("a row passes over what is empty without changing a bit, and finds every lone echo", "[beam]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    // Parts of a row and of an image are 512 and 256 bins: echoes at their borders, alone or together.
    const std::int64_t bins = 1400;
    const BeamSetting setting = level(3, 74);
    const PolarGrid whole = grid(240, 10, {0, 240}, {0, bins});
    const std::int64_t skirt = skirt_bins(setting, 240);
    REQUIRE(skirt > 3);
    for (const std::vector<std::int64_t>& ranges : std::vector<std::vector<std::int64_t>>{
             {0}, {255, 256}, {504}, {511}, {512}, {1023, 1030}, {bins - 1}, {3, 511, 700, 1399}, {}}) {
        PolarImage<float> echo(whole);
        for (const std::int64_t j : ranges) at(echo, 100 + j % 7, j) = 1 + 0.125F * static_cast<float>(j);
        const PolarImage<float> power = power_image(echo, whole, setting);
        // By definition, without parts: the pulse's weights over the beam's.
        const std::vector<double> pulse = pulse_weights(7.4);
        for (std::int64_t i = 90; i < 118; ++i)
            for (std::int64_t j = 0; j < bins; ++j) {
                double all = 0;
                for (std::size_t m = 0; m < pulse.size(); ++m) {
                    const std::int64_t from = j - static_cast<std::int64_t>(m);
                    if (from < 0) break;
                    for (std::int64_t k = -skirt; k <= skirt; ++k)
                        if (const float cell = at(echo, i + k, from); cell > 0)
                            all += pulse[m] * static_cast<double>(cell) *
                                   two_way_azimuth_pattern(setting.antenna,
                                                           static_cast<double>(k) * 2 * std::numbers::pi / 240);
                }
                if (all == 0)
                    REQUIRE(at(power, i, j) == 0);
                else
                    REQUIRE_THAT(static_cast<double>(at(power, i, j)), WithinRel(all, 2 * float_error));
            }
        // And bit by bit as a row that looks at everything.
        const Resolution resolution(setting, 240, 10, {0, bins}, Resolution::Of::power);
        std::vector<double> scratch, sums(static_cast<std::size_t>(bins));
        for (std::int64_t i = 85; i < 123; ++i) {
            resolution.row(
                i, [&](std::int64_t bin) { return echo.row(static_cast<std::size_t>(bin)); }, scratch, sums);
            bool same = true;
            for (std::int64_t j = 0; j < bins; ++j)
                same = same && at(power, i, j) == static_cast<float>(sums[static_cast<std::size_t>(j)]);
            CHECK(same);
        }
    }
}

TEST_CASE("azimuths that go round through north beyond the circle find the rows of an image of the whole circle",
          "[beam]") {
    const BeamSetting setting = level(6, 30);
    const PolarGrid whole = grid(240, 10, {0, 240}, {0, 300});
    PolarImage<float> echo(whole);
    for (std::int64_t row = 0; row < 240; row += row < 20 ? 1 : 37)
        at(echo, row, 20 + row) = 1 + static_cast<float>(row);
    at(echo, 239, 290) = 5;
    const PolarImage<float> all = power_image(echo, whole, setting);
    for (const Interval azimuths : {Interval{239, 478}, {236, 470}, {120, 359}}) {
        const PolarImage<float> part = power_image(echo, grid(240, 10, azimuths, {0, 300}), setting);
        for (std::int64_t i = 0; i < azimuths.size(); ++i)
            for (std::int64_t j = 0; j < 300; ++j) REQUIRE(at(part, i, j) == at(all, (azimuths.begin + i) % 240, j));
    }
}
