// Speckle and noise, against their distributions. Seeds are fixed, so nothing here is a matter of luck.
#include <oneapi/tbb/global_control.h>
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "lib/fluctuation.hpp"

using namespace wedgescope;

namespace {

// Beam 4 bins, pulse 4 bins.
BeamSetting setting_of_beam() {
    BeamSetting setting;
    setting.antenna.beam = Angle::degrees(3);
    setting.pulse_extent_m = 40;
    return setting;
}
PolarGrid plain_grid(std::int64_t ranges) { return {480, 10, {0, 480}, {0, ranges}}; }

PolarImage<float> uniform_echo(const PolarGrid& grid, float value) {
    PolarImage<float> echo(grid);
    std::fill(echo.cells.begin(), echo.cells.end(), value);
    return echo;
}

/// Values of every eighth azimuth and range bin: two beamwidths and two pulses apart, so nearly independent
/// (field correlation 2^-8 in azimuth, none in range).
std::vector<double> apart(const PolarImage<float>& image) {
    std::vector<double> values;
    for (std::size_t i = 0; i < image.grid.azimuth_count(); i += 8)
        for (std::size_t j = 8; j < image.grid.range_count(); j += 8)
            values.push_back(static_cast<double>(image.row(i)[j]));
    return values;
}

struct Moments {
    double mean = 0, variance = 0;
};
Moments moments(const std::vector<double>& values) {
    Moments m;
    const auto n = static_cast<double>(values.size());
    for (const double v : values) m.mean += v / n;
    for (const double v : values) m.variance += (v - m.mean) * (v - m.mean) / n;
    return m;
}

/// Kolmogorov and Smirnov's sqrt(n) D against the exponential distribution of this mean.
double exponential_misfit(std::vector<double> values, double mean) {
    std::sort(values.begin(), values.end());
    const auto n = static_cast<double>(values.size());
    double worst = 0;
    for (std::size_t k = 0; k < values.size(); ++k) {
        const double expected = 1 - std::exp(-values[k] / mean);
        worst = std::max({worst, std::abs(expected - static_cast<double>(k) / n),
                          std::abs(expected - static_cast<double>(k + 1) / n)});
    }
    return std::sqrt(n) * worst;
}
constexpr double one_in_a_thousand = 1.95;  // sqrt(n) D of a true sample exceeds this in one case of a thousand

/// Correlation of intensities `azimuths` and `ranges` bins apart, over the whole circle.
double correlation(const PolarImage<float>& image, std::size_t azimuths, std::size_t ranges) {
    std::vector<double> a, b;
    for (std::size_t i = 0; i < image.grid.azimuth_count(); ++i)
        for (std::size_t j = 8; j + ranges < image.grid.range_count(); ++j) {
            a.push_back(static_cast<double>(image.row(i)[j]));
            b.push_back(static_cast<double>(image.row((i + azimuths) % image.grid.azimuth_count())[j + ranges]));
        }
    const Moments ma = moments(a), mb = moments(b);
    double product = 0;
    for (std::size_t k = 0; k < a.size(); ++k) product += (a[k] - ma.mean) * (b[k] - mb.mean);
    return product / static_cast<double>(a.size()) / std::sqrt(ma.variance * mb.variance);
}

}  // namespace

TEST_CASE("without speckle and noise the power passes with the mean noise added", "[fluctuation]") {
    const PolarGrid grid = plain_grid(20);
    const PolarImage<float> power = uniform_echo(grid, 3.0f);
    const PolarImage<float> received = received_power(power, power, setting_of_beam(), {.noise_power_w = 0.5});
    CHECK(std::all_of(received.cells.begin(), received.cells.end(), [](float v) { return v == 3.5f; }));
}

TEST_CASE("speckle keeps the power image as its mean, in every cell", "[fluctuation]") {
    BeamSetting beam = setting_of_beam();
    beam.sensor_m = 120;  // wide beam in near bins
    const PolarGrid whole = plain_grid(40);
    PolarImage<float> echo(whole);
    for (std::size_t i = 0; i < 480; ++i)
        for (std::size_t j = 0; j < 40; ++j)
            echo.row(i)[j] = 1e-12f * static_cast<float>((i * 7 + j * 13) % 11 * ((i / 16) % 3));
    const PolarGrid shown{480, 10, {0, 48}, {5, 40}};
    const PolarImage<float> power = power_image(echo, shown, beam);
    const int seeds = 1000;
    std::vector<double> mean(shown.cells(), 0.0);
    for (int seed = 0; seed < seeds; ++seed) {
        const PolarImage<float> one =
            received_power(echo, power, beam, {.speckle_looks = 1, .seed = static_cast<std::uint64_t>(seed) << 20});
        for (std::size_t k = 0; k < mean.size(); ++k) mean[k] += static_cast<double>(one.cells[k]) / seeds;
    }
    double worst = 0, total = 0, expected_total = 0;
    for (std::size_t k = 0; k < mean.size(); ++k) {
        const double expected = static_cast<double>(power.cells[k]);
        // Exponential: the standard deviation of one is its mean, of the mean of 1000 a 32nd of that.
        worst = std::max(worst, std::abs(mean[k] - expected) / (expected / std::sqrt(1.0 * seeds)));
        total += mean[k];
        expected_total += expected;
    }
    CHECK(worst < 4.5);                                        // of 1680 cells
    CHECK(total / expected_total == Approx(1).epsilon(0.01));  // some 100 resolution cells, each 3 %
}

TEST_CASE("one look has an exponential distribution and reads 2.5 dB low on a log amplifier", "[fluctuation]") {
    const PolarGrid grid = plain_grid(800);
    const PolarImage<float> echo = uniform_echo(grid, 1e-13f);
    const BeamSetting beam = setting_of_beam();
    const double mean_w = static_cast<double>(power_image(echo, grid, beam).row(0)[100]);
    const auto values = apart(received_power(echo, echo, beam, {.speckle_looks = 1, .seed = 7}));
    const auto n = static_cast<double>(values.size());
    REQUIRE(n > 5000);
    CHECK(exponential_misfit(values, mean_w) < one_in_a_thousand);

    std::vector<double> decibels;
    for (const double v : values) decibels.push_back(10 * std::log10(v / mean_w));
    const Moments m = moments(decibels);
    CHECK(m.mean == Approx(-2.507).margin(3 * 5.570 / std::sqrt(n)));
    CHECK(std::sqrt(m.variance) == Approx(5.570).epsilon(3 * 1.05 / std::sqrt(n)));  // kurtosis 5.4
}

TEST_CASE("the variance of N looks is an Nth of one look's", "[fluctuation]") {
    const PolarGrid grid = plain_grid(400);
    const PolarImage<float> echo = uniform_echo(grid, 1e-13f);
    const BeamSetting beam = setting_of_beam();
    const double mean_w = static_cast<double>(power_image(echo, grid, beam).row(0)[100]);
    for (const int looks : {1, 4, 10}) {
        const auto values = apart(received_power(echo, echo, beam, {.speckle_looks = looks, .seed = 3}));
        const Moments m = moments(values);
        const auto n = static_cast<double>(values.size());
        CHECK(m.mean / mean_w == Approx(1).margin(3 / std::sqrt(looks * n)));
        // Gamma of shape N: the estimate of its variance spreads by sqrt((2 + 6/N) / n).
        CHECK(m.variance * looks / (mean_w * mean_w) == Approx(1).margin(3 * std::sqrt((2 + 6.0 / looks) / n)));
    }
}

TEST_CASE("the mean of N looks has a gamma distribution", "[fluctuation]") {
    const PolarGrid grid = plain_grid(800);
    const PolarImage<float> echo = uniform_echo(grid, 1e-13f);
    const BeamSetting beam = setting_of_beam();
    const double mean_w = static_cast<double>(power_image(echo, grid, beam).row(0)[100]);
    for (const int looks : {2, 4}) {
        auto values = apart(received_power(echo, echo, beam, {.speckle_looks = looks, .seed = 21}));
        std::sort(values.begin(), values.end());
        const auto n = static_cast<double>(values.size());
        double worst = 0;
        for (std::size_t k = 0; k < values.size(); ++k) {
            // Erlang: 1 - exp(-x) (1 + x + ... + x^(N-1) / (N-1)!), x = N I / mean.
            const double x = looks * values[k] / mean_w;
            double term = 1, sum = 0;
            for (int i = 0; i < looks; ++i) {
                sum += term;
                term *= x / (i + 1);
            }
            const double expected = 1 - std::exp(-x) * sum;
            worst = std::max({worst, std::abs(expected - static_cast<double>(k) / n),
                              std::abs(expected - static_cast<double>(k + 1) / n)});
        }
        INFO(looks << " looks");
        CHECK(std::sqrt(n) * worst < one_in_a_thousand);
    }
}

TEST_CASE("finer bins leave the grain of speckle as wide as it is, beam and pulse", "[fluctuation]") {
    // The same beam of 3 degrees and pulse of 40 m on bins of 0.75 degrees and 10 m, and of a third of that.
    const PolarGrid fine{1440, 10.0 / 3, {0, 1440}, {0, 900}};
    const PolarImage<float> coarse = received_power(uniform_echo(plain_grid(600), 1), uniform_echo(plain_grid(600), 1),
                                                    setting_of_beam(), {.speckle_looks = 1, .seed = 31});
    const PolarImage<float> finer = received_power(uniform_echo(fine, 1), uniform_echo(fine, 1), setting_of_beam(),
                                                   {.speckle_looks = 1, .seed = 32});
    // A Gaussian beam's field is its own shape: 2^-(4 (x / beam)^2) of angles; half-way at half a beam.
    for (const std::size_t bins : {1u, 2u, 4u}) {
        const double beams = static_cast<double>(bins) * 0.75 / 3;
        INFO(beams << " beams");
        CHECK(correlation(finer, 3 * bins, 0) == Approx(std::exp2(-4 * beams * beams)).margin(0.03));
        CHECK(correlation(coarse, bins, 0) == Approx(std::exp2(-4 * beams * beams)).margin(0.03));
    }
    // A pulse of length L: the square of its autocorrelation, (1 - x / L)^2, but for what a bin's width adds.
    for (const std::size_t bins : {1u, 2u, 3u}) {
        const double lengths = static_cast<double>(bins) * 10 / 40;
        INFO(lengths << " pulses");
        CHECK(correlation(finer, 0, 3 * bins) == Approx(std::pow(1 - lengths, 2)).margin(0.06));
        CHECK(correlation(coarse, 0, bins) == Approx(correlation(finer, 0, 3 * bins)).margin(0.12));
    }
    CHECK(correlation(finer, 0, 15) == Approx(0).margin(0.03));
    CHECK(correlation(finer, 24, 0) == Approx(0).margin(0.03));
}

TEST_CASE("the grain of speckle is a resolution cell, not a bin", "[fluctuation]") {
    const PolarGrid grid = plain_grid(600);
    const PolarImage<float> received = received_power(uniform_echo(grid, 1), uniform_echo(grid, 1), setting_of_beam(),
                                                      {.speckle_looks = 1, .seed = 5});
    // Field filtered by a Gaussian amplitude 2^(-4 (x/b)^2): intensities correlate by 2^(-4 (x/b)^2).
    // Filtered by a pulse of amplitudes sqrt(1/2), 1, 1, 1, sqrt(1/2): by the square of its autocorrelation / 4.
    const double s = std::sqrt(0.5);
    const double margin = 0.02;  // some 7000 resolution cells, of which neighbours are nearly copies
    CHECK(correlation(received, 1, 0) == Approx(std::exp2(-0.25)).margin(margin));
    CHECK(correlation(received, 2, 0) == Approx(0.5).margin(margin));
    CHECK(correlation(received, 4, 0) == Approx(1.0 / 16).margin(margin));
    CHECK(correlation(received, 8, 0) == Approx(0).margin(margin));
    CHECK(correlation(received, 0, 1) == Approx(std::pow((2 * s + 2) / 4, 2)).margin(margin));
    CHECK(correlation(received, 0, 2) == Approx(std::pow((2 * s + 1) / 4, 2)).margin(margin));
    CHECK(correlation(received, 0, 4) == Approx(1.0 / 64).margin(margin));
    CHECK(correlation(received, 0, 5) == Approx(0).margin(margin));
}

TEST_CASE("thermal noise is exponential, one draw a dwell and a pulse", "[fluctuation]") {
    const PolarGrid grid = plain_grid(2000);
    const PolarImage<float> nothing(grid);
    const PolarImage<float> received =
        received_power(nothing, nothing, setting_of_beam(), {.noise = true, .noise_power_w = 2e-14, .seed = 11});
    bool held = true;
    for (std::size_t i = 0; i < 480; i += 4)
        for (std::size_t j = 0; j < 2000; ++j)
            held = held && received.row(i)[j] == received.row(i + 1)[j] && received.row(i)[j] == received.row(i + 3)[j];
    CHECK(held);
    CHECK(received.row(3)[9] != received.row(4)[9]);

    const auto values = apart(received);
    CHECK(exponential_misfit(values, 2e-14) < one_in_a_thousand);
    CHECK(correlation(received, 4, 0) == Approx(0).margin(0.03));
    CHECK(correlation(received, 0, 1) == Approx(std::pow((2 * std::sqrt(0.5) + 2) / 4, 2)).margin(0.03));
    CHECK(correlation(received, 0, 5) == Approx(0).margin(0.03));
    // Noise has no beginning: the first bins are as noisy as the others (120 dwells, five standard deviations).
    double first = 0;
    for (std::size_t i = 0; i < 480; i += 4) first += static_cast<double>(received.row(i)[0]) / 120;
    CHECK(first / 2e-14 == Approx(1).margin(5 / std::sqrt(120.0)));
}

TEST_CASE("noise is added to fields: it beats with the signal", "[fluctuation]") {
    const PolarGrid grid = plain_grid(2000);
    const BeamSetting beam = setting_of_beam();
    const PolarImage<float> power = uniform_echo(grid, 6e-14f);
    const double p = 6e-14, noise = 2e-14;
    // A steady signal: Rice, with mean P + N and variance N^2 + 2 P N.
    const auto steady =
        moments(apart(received_power(power, power, beam, {.noise = true, .noise_power_w = noise, .seed = 1})));
    CHECK(steady.mean / (p + noise) == Approx(1).margin(0.02));
    CHECK(steady.variance / (noise * noise + 2 * p * noise) == Approx(1).margin(0.05));
    // A speckled signal: the sum is one complex normal more, so exponential with the sum of the means.
    const PolarImage<float> echo = uniform_echo(grid, 1e-15f);
    const PolarImage<float> mean = power_image(echo, grid, beam);
    const auto both =
        apart(received_power(echo, mean, beam, {.speckle_looks = 1, .noise = true, .noise_power_w = noise, .seed = 2}));
    CHECK(exponential_misfit(both, static_cast<double>(mean.row(0)[500]) + noise) < one_in_a_thousand);
    // With speckle alone the mean noise is still received.
    const auto quiet =
        moments(apart(received_power(echo, mean, beam, {.speckle_looks = 50, .noise_power_w = noise, .seed = 2})));
    CHECK(quiet.mean / (static_cast<double>(mean.row(0)[500]) + noise) == Approx(1).margin(0.01));
}

TEST_CASE("fluctuation is keyed by place: slices, seeds and threads", "[fluctuation]") {
    BeamSetting beam = setting_of_beam();
    beam.sensor_m = 700;
    const PolarGrid grid = plain_grid(900);
    PolarImage<float> echo(grid);
    for (std::size_t k = 0; k < echo.cells.size(); ++k)
        echo.cells[k] = static_cast<float>((k * 2654435761u) % 1000) * 1e-15f;
    const PolarImage<float> power = power_image(echo, grid, beam);
    const FluctuationSetting setting{.speckle_looks = 2, .noise = true, .noise_power_w = 1e-13, .seed = 99};
    const PolarImage<float> all = received_power(echo, power, beam, setting);
    {
        const oneapi::tbb::global_control one(oneapi::tbb::global_control::max_allowed_parallelism, 1);
        CHECK(received_power(echo, power, beam, setting).cells == all.cells);
    }
    FluctuationSetting other = setting;
    other.seed = 99 + (std::uint64_t{1} << 32);
    CHECK(received_power(echo, power, beam, other).cells != all.cells);

    const PolarGrid shown{480, 10, {470, 490}, {333, 777}};
    const std::int64_t skirt = skirt_bins(beam, 480), lead = lead_in_bins(beam, 10);
    const PolarGrid swept{480, 10, {470 - skirt, 490 + skirt}, {333 - lead, 777}};
    PolarImage<float> slice(swept);
    for (std::size_t i = 0; i < swept.azimuth_count(); ++i)
        for (std::size_t j = 0; j < swept.range_count(); ++j)
            slice.row(i)[j] =
                echo.row((static_cast<std::size_t>(470 - skirt) + i) % 480)[static_cast<std::size_t>(333 - lead) + j];
    const PolarImage<float> part = received_power(slice, power_image(slice, shown, beam), beam, setting);
    bool same = true;
    for (std::size_t i = 0; i < 20; ++i)
        for (std::size_t j = 0; j < 444; ++j) same = same && part.row(i)[j] == all.row((470 + i) % 480)[333 + j];
    CHECK(same);
}
