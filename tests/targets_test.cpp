// Every hot loop gives the baseline's bits on each instruction set of the machine, whatever it is fed: voids, ties, infinite
// heights, numbers of lanes that fill no register.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <type_traits>
#include <vector>

#include "lib/beam.hpp"
#include "lib/coverage_lanes.hpp"
#include "lib/culture_lanes.hpp"
#include "lib/deposit.hpp"
#include "lib/detail.hpp"
#include "lib/display_lanes.hpp"
#include "lib/lanes.hpp"
#include "lib/path_loss.hpp"
#include "lib/post_extremes.hpp"
#include "lib/sample.hpp"
#include "lib/seen_counts.hpp"
#include "lib/shade.hpp"
#include "lib/sweep.hpp"
#include "tests/every_target.hpp"
#include "tests/variable.hpp"

using namespace wedgescope;

namespace {

using Bytes = std::vector<std::uint8_t>;

/// What a loop wrote. All that are no numbers count as one: which of two is passed on is no result.
class Record {
public:
    template <class T>
    void put(const T* values, std::size_t n) {
        for (std::size_t i = 0; i < n; ++i) {
            T value = values[i];
            if constexpr (std::is_floating_point_v<T>)
                if (std::isnan(value)) value = std::numeric_limits<T>::quiet_NaN();
            const auto* raw = reinterpret_cast<const std::uint8_t*>(&value);
            bytes_.insert(bytes_.end(), raw, raw + sizeof value);
        }
    }
    template <class Container>
    void put(const Container& values) {
        put(std::data(values), std::size(values));
    }
    Bytes bytes() && { return std::move(bytes_); }

private:
    Bytes bytes_;
};

class Draw {
public:
    explicit Draw(unsigned seed) : random_(seed) {}
    std::size_t below(std::size_t n) { return random_() % n; }
    double number(double from, double to) { return std::uniform_real_distribution<>(from, to)(random_); }
    std::vector<double> lanes(std::size_t n, double from, double to) {
        std::vector<double> all(n);
        for (double& x : all) x = number(from, to);
        return all;
    }
    /// Some of them voids, a level, needles.
    std::vector<float> heights(std::size_t n) {
        std::vector<float> all(n);
        for (float& z : all) {
            const std::size_t kind = below(12);
            z = kind == 0   ? std::numeric_limits<float>::quiet_NaN()
                : kind == 1 ? 8000
                : kind < 5  ? 100
                : kind == 5 ? -0.0F
                            : static_cast<float>(number(-400, 3000));
        }
        return all;
    }

private:
    std::mt19937 random_;
};

struct Samples {
    std::vector<double> part, minor, arc, height, up, out, range, sine, x;
    SampleLanes lanes() {
        return {part.data(), minor.data(), arc.data(),  height.data(), up.data(),
                out.data(),  range.data(), sine.data(), x.data()};
    }
};

/// From a spoke's place to the power of what it sees.
Bytes sweep_of(unsigned seed) {
    Draw draw(seed);
    Record record;
    const std::size_t n = 1 + draw.below(128);
    SpokeMap::LinePiece piece{-1, 1, 0.1, 1.7, {}, {}};
    if (draw.below(2))
        for (std::size_t i = 0; i < 5; ++i) {
            piece.bend[i] = draw.number(-0.01, 0.01);
            piece.stretch[i] = draw.number(-1e-4, 1e-4);
        }
    const auto zeros = [&] { return std::vector<double>(n); };
    const auto samples = [&] {
        return Samples{zeros(), zeros(), zeros(), zeros(), zeros(), zeros(), zeros(), zeros(), zeros()};
    };
    Samples now = samples(), crossing = samples(), line = samples();
    const std::vector<double> metres = draw.lanes(n, 25, 42);
    const double distance = 1 + static_cast<double>(draw.below(300)), nadir = draw.number(300, 301);
    const double first = draw.number(-0.5, 0.5), spacing = draw.number(0, 0.01);
    std::vector<double> slope(n);
    for (std::size_t i = 0; i < n; ++i) slope[i] = first + spacing * static_cast<double>(i);
    place_lanes(piece, nadir, distance, n, slope.data(), metres.data(), now.minor.data(), now.arc.data());
    place_lanes(piece, nadir, distance + 1, n, slope.data(), metres.data(), line.minor.data(), line.arc.data());
    std::fill(line.part.begin(), line.part.end(), 1);
    record.put(now.minor);
    record.put(now.arc);
    for (std::size_t i = 0; i < n; ++i)
        if (draw.below(4) == 0) now.minor[i] = std::floor(now.minor[i]);  // exactly on a post
    const int crossed =
        cross_lanes(n, {now.part.data(), now.minor.data(), now.arc.data(), line.minor.data(), line.arc.data(),
                        crossing.part.data(), crossing.minor.data(), crossing.arc.data()});
    record.put(&crossed, 1);
    std::vector<double> modes(n);
    for (double& m : modes) m = static_cast<double>(draw.below(4));
    const double most_m = line.arc[n / 2];
    const int odd = count_beyond_or_in(n, line.arc.data(), most_m, modes.data(), mode_gap);
    int wanted = 0;
    for (std::size_t i = 0; i < n; ++i) wanted += line.arc[i] > most_m || modes[i] == mode_gap;
    CHECK(odd == wanted);
    record.put(&odd, 1);
    const std::vector<float> behind = draw.heights(700), ahead = draw.heights(700);
    const std::int64_t begin = draw.below(3) ? -50 : 200, cut = draw.below(2) ? 1 : 0;
    const LinePosts back{behind.data(), begin, begin + 700}, front{ahead.data() + cut, begin + cut, begin + 690};
    auto cell = zeros(), mode = zeros(), radius = zeros(), void_horizon = draw.lanes(n, -1, 0),
         horizon = draw.lanes(n, -0.5, 0.2), least = zeros(), most = zeros(), bump = zeros(), sine0 = zeros(),
         code = zeros(), power = zeros(), rise = zeros(), swing = zeros();
    std::vector<float> bow(n);
    for (std::size_t i = 0; i < n; ++i) {
        mode[i] = static_cast<double>(draw.below(4));
        radius[i] = draw.below(5) ? 1 / 8.5e6 : 0;
        if (draw.below(6) == 0) horizon[i] = -1;
    }
    now.height = draw.lanes(n, 0, 900);
    now.sine = draw.lanes(n, -0.9, 0.1);
    now.up = draw.lanes(n, -900, 200);
    now.out = now.arc;
    now.range = now.arc;
    std::vector<float> behind_posts(2 * n), ahead_posts(2 * n);
    const PatternTable pattern{AntennaParams{}};
    const auto step = [&](StepTo to_line, Samples& from, Samples& to) {
        const CellLanes posts{cell.data(), behind_posts.data(), ahead_posts.data()};
        cell_lanes(back, front, n, from.minor.data(), to.minor.data(), posts);
        const Rises rises = step_lanes(
            to_line, n, {draw.number(1, 9000), 0.1, draw.below(2) == 0, draw.below(2) == 0, draw.number(0, 0.06)},
            {from.lanes(), to.lanes(), posts, mode.data(), radius.data(), void_horizon.data(), horizon.data(),
             least.data(), most.data(), bump.data(), rise.data(), swing.data(), sine0.data(), code.data()});
        const int both[] = {rises.plain, rises.changes};
        record.put(both);
        record.put(behind_posts);
        record.put(ahead_posts);
        power_lanes(n,
                    {sine0.data(), to.sine.data(), from.range.data(), to.range.data(), rise.data(), swing.data(),
                     n % 2 == 0, power.data(), bow.data()},
                    pattern, 1e-3);
        for (const auto* out : {&cell, &to.part, &to.minor, &to.arc, &to.height, &to.up, &to.out, &to.range, &to.sine,
                                &to.x, &horizon, &least, &most, &bump, &rise, &swing, &sine0, &code, &power})
            record.put(*out);
        record.put(bow);
    };
    step(StepTo::crossing, now, crossing);
    step(StepTo::line, crossing, line);

    // What pieces seen in part or not at all leave in their lanes goes in too.
    const std::vector<double> across = draw.lanes(n, -1, 1);
    std::vector<double> slant(n), variable(n);
    for (std::size_t i = 0; i < n; ++i) slant[i] = std::sqrt(1 + across[i] * across[i]);
    facet_lanes(n, {crossing.lanes(), line.lanes(), behind_posts.data(), ahead_posts.data(), across.data(),
                    slant.data(), draw.number(3, 900), variable.data()});
    record.put(variable);
    return std::move(record).bytes();
}

/// What weather takes.
Bytes losses_of(unsigned seed) {
    static const Weather all({.vapour_g_m3 = 7.5, .rain_mm_h = 16, .liquid_water_g_m3 = 0.3}, 16.5e9),
        gases({.vapour_g_m3 = 13}, 9.4e9);
    static const PathLossTable tables[] = {{all, {.earth = Earth(8.5e6), .sensor_m = 4100, .most_range_m = 120e3}},
                                           {all, {.earth = Earth(), .sensor_m = 900, .most_range_m = 20e3}},
                                           {gases, {.earth = Earth(8.5e6), .sensor_m = 12000, .most_range_m = 300e3}}};
    Draw draw(seed);
    const std::size_t n = 1 + draw.below(200);
    std::vector<double> range = draw.lanes(n, 1, 150e3), sine = draw.lanes(n, -1, 0.2), inverse(n), factor(n);
    for (std::size_t i = 0; i < n; ++i) {
        inverse[i] = draw.below(4) ? 1 / draw.number(8.4e6, 8.6e6) : 0;
        if (draw.below(9) == 0) range[i] = 0;
        if (draw.below(9) == 0) sine[i] = -1;
    }
    Record record;
    for (const PathLossTable& table : tables) {
        factor_lanes(n, range.data(), sine.data(), inverse.data(), table, factor.data());
        record.put(factor);
    }
    return std::move(record).bytes();
}

/// Into which cells power goes.
Bytes deposits_of(unsigned seed) {
    Draw draw(seed);
    Record record;
    const std::int64_t begin = draw.below(2) ? 0 : 37, columns = 40 + static_cast<std::int64_t>(draw.below(200));
    constexpr std::size_t rows = 6;
    const Quanta q = quanta({begin, begin + columns}, draw.number(5, 90), 1e-3, 1, 0.01, 1);
    WedgeCells cells(rows, q);
    for (int block = 0; block < 6; ++block) {
        constexpr std::size_t most = WedgeCells::Portions::most;
        const std::size_t n = 1 + draw.below(most);
        const std::size_t whole = whole_registers(n);
        std::vector<double> share0(whole), share1(whole), x0(whole), x1(whole), power(whole);
        std::vector<float> bow(whole), gammas[3], second(whole), third(whole);
        for (auto& gamma : gammas) gamma.resize(whole);
        const auto number = [&](double from, double to) { return static_cast<float>(draw.number(from, to)); };
        std::vector<std::int64_t> origin(n);
        std::vector<std::int32_t> straddlers;
        // Most blocks lie in a few bins, as neighbouring spokes do; pieces of one bin and of many, either way round.
        const double place = draw.number(static_cast<double>(begin) - 3, static_cast<double>(begin + columns) + 3),
                     longest = draw.below(3) ? 2.5 : 30;
        for (std::size_t i = 0; i < n; ++i) {
            origin[i] = cells.origin_of(static_cast<std::int32_t>(draw.below(rows - 1)));
            share0[i] = draw.below(8) ? draw.number(0, 0.005) : 0;
            if (draw.below(4) == 0 && share0[i] > 0) {
                share1[i] = draw.number(0, 0.005);
                straddlers.push_back(static_cast<std::int32_t>(i));
            }
            x0[i] = place + draw.number(-1, 1);
            x1[i] = x0[i] + draw.number(-longest, longest);
            if (draw.below(10) == 0) x0[i] = std::floor(x0[i]);  // exactly on an edge
            // Within what the quantum of the farthest bin allows, for all pieces that a cell may get.
            const double bin_m = std::max(1.0, 90 * std::max(x0[i], x1[i]));
            power[i] = draw.below(9) ? 1e-5 * std::exp(draw.number(-25, 0)) / (bin_m * bin_m) : 0;
            bow[i] = number(-1, 1);
            for (auto& gamma : gammas) gamma[i] = number(0, 1);
            if (draw.below(9) == 0) gammas[2][i] = -1;
            third[i] = draw.below(3) ? number(0, 1) : 0;
            second[i] = draw.below(3) ? third[i] * number(0, 1) : third[i];
        }
        // Behind the last lane stands anything.
        constexpr double wild[] = {NAN, 1e38, -1e38, INFINITY, -INFINITY, 1, -7};
        for (auto* of : {&share0, &share1, &x0, &x1, &power})
            for (std::size_t i = n; i < whole; ++i) (*of)[i] = wild[draw.below(std::size(wild))];
        for (auto* of : {&bow, &gammas[0], &gammas[1], &gammas[2], &second, &third})
            for (std::size_t i = n; i < whole; ++i) (*of)[i] = static_cast<float>(wild[draw.below(std::size(wild))]);
        const double bins = draw.below(2) ? 1 : draw.number(0.01, 0.1);
        for (auto* of : {&x0, &x1})
            for (std::size_t i = 0; i < n; ++i) (*of)[i] /= bins;
        const bool stretched = draw.below(3) > 0;
        cells.add_lanes(n, {origin.data(),
                            share0.data(),
                            share1.data(),
                            straddlers,
                            x0.data(),
                            x1.data(),
                            bins,
                            power.data(),
                            bow.data(),
                            {gammas[0].data(), gammas[1].data(), gammas[2].data()},
                            stretched ? second.data() : nullptr,
                            third.data()});
    }
    for (int i = 0; i < 20; ++i) {
        const double x0 = draw.number(static_cast<double>(begin), static_cast<double>(begin + columns));
        cells.mark({static_cast<std::int32_t>(draw.below(rows - 1)), {0.01, draw.below(2) ? 0.01 : 0}}, x0,
                   x0 + draw.number(0, 60), static_cast<std::uint8_t>(1U << draw.below(4)));
    }
    std::vector<float> finished(cells.columns());
    Bytes states(cells.columns());
    for (std::size_t row = 0; row < rows; ++row) {
        for (std::size_t column = 0; column < cells.columns(); ++column) {
            const double watts = cells.watts(row, column);
            record.put(&watts, 1);
        }
        cells.finish(row, finished.data(), states.data());
        record.put(finished);
        record.put(states);
    }
    return std::move(record).bytes();
}

/// Beam and pulse, powers and fields, drawn as they are, wider, longer or not at all.
Bytes beams_of(unsigned seed) {
    Draw draw(seed);
    BeamSetting setting;
    setting.antenna.beam = Angle::degrees(draw.number(0.5, 9));
    setting.antenna.azimuth = draw.below(2) ? AzimuthPattern::gaussian : AzimuthPattern::uniform;
    setting.beam_width_error = draw.below(4) > 0;
    setting.pulse_length_error = draw.below(4) > 0;
    if (draw.below(3) == 0) setting.beam_width_scale = draw.number(0.2, 3);
    if (draw.below(3) == 0) setting.pulse_length_scale = draw.number(0.2, 3);
    const double bin_m = draw.number(10, 80);
    setting.pulse_extent_m = bin_m * (draw.below(2) ? static_cast<double>(1 + draw.below(6)) : draw.number(0.3, 6));
    setting.sensor_m = draw.number(100, 4000);
    setting.range_is_ground = draw.below(3) == 0;
    if (draw.below(2)) setting.earth = Earth(8.5e6);
    const std::int64_t circle = 90, first = draw.below(2) ? 0 : 20,
                       columns = 1 + static_cast<std::int64_t>(draw.below(150));
    Record record;
    for (const auto of : {Resolution::Of::power, Resolution::Of::amplitude}) {
        const Resolution resolution(setting, circle, bin_m, {first, first + columns}, of);
        const auto n = static_cast<std::size_t>(resolution.sources().size());
        std::vector<float> echo(n * static_cast<std::size_t>(circle));
        for (float& cell : echo)
            cell =
                draw.below(5) ? static_cast<float>(std::exp(draw.number(-30, 0))) : 0.0F;  // many orders, and shadows
        std::vector<double> scratch, out(static_cast<std::size_t>(columns));
        for (const std::int64_t azimuth : {0, 7, 89}) {
            resolution.row(
                azimuth,
                [&](std::int64_t bin) { return echo.data() + n * static_cast<std::size_t>((bin + circle) % circle); },
                scratch, out);
            record.put(out);
        }
    }
    return std::move(record).bytes();
}

/// How far posts lie off coarser levels.
Bytes residuals_of(unsigned seed) {
    Draw draw(seed);
    const std::int64_t columns = 2 + static_cast<std::int64_t>(draw.below(140)),
                       rows = 2 + static_cast<std::int64_t>(draw.below(140)),
                       stride = columns + static_cast<std::int64_t>(draw.below(3));
    std::vector<float> posts = draw.heights(static_cast<std::size_t>(stride * rows));
    if (draw.below(4))
        for (float& z : posts) z = std::isnan(z) ? 1 : z;
    const Residuals found = residuals(posts.data(), stride, columns, rows);
    Record record;
    for (const auto* each : {&found.rms_m, &found.peak_m, &found.cube_m}) record.put(*each);
    return std::move(record).bytes();
}

/// Coverage's knots, masks and counts, and culture under pieces.
Bytes coverage_of(unsigned seed) {
    Draw draw(seed);
    Record record;
    const std::size_t n = 1 + draw.below(90);
    const LineForm line{
        1 + draw.number(0, 900), draw.number(-9, 9), {900, draw.number(-9, 9), 900}, {1e-4, 1e-8, 1e-4}};
    PieceForm piece{0.2, 1.3, {}, {}};
    if (draw.below(2))
        for (std::size_t i = 0; i < 5; ++i) {
            piece.bend[i] = draw.number(-0.1, 0.1);
            piece.stretch[i] = draw.number(-1e-4, 1e-4);
        }
    std::vector<double> at(n), slope(n), along(n);
    std::vector<float> lift(n), drop(n), ray(n), rise(n);
    const KnotLanes knots{at.data(), slope.data(), along.data(), lift.data(), drop.data(), ray.data(), rise.data()};
    std::vector<double> turn(n), curvature(n);
    const FanLanes fan{slope.data(), turn.data(), curvature.data()};
    spoke_fan(line, 1024, -1024, n, fan);
    for (const auto* out : {&slope, &turn, &curvature}) record.put(*out);
    spoke_knots(line, piece, fan, n, knots);
    record.put(at);
    record.put(lift);
    record.put(drop);
    const std::vector<double> places =
        draw.lanes(n, line.nadir_minor - line.distance, line.nadir_minor + line.distance);
    post_knots(line, piece, 1024, places.data(), n, knots);
    for (const auto* out : {&at, &slope, &along}) record.put(*out);
    for (const auto* out : {&lift, &drop, &ray, &rise}) record.put(*out);

    const std::size_t posts = 1 + draw.below(400);
    Bytes states(posts), painted(posts), codes(posts), few(posts);
    std::vector<std::uint16_t> many(posts);
    for (std::size_t i = 0; i < posts; ++i) {
        states[i] = static_cast<std::uint8_t>(draw.below(5));
        codes[i] = static_cast<std::uint8_t>(draw.below(4));
        few[i] = static_cast<std::uint8_t>(draw.below(250));
        many[i] = static_cast<std::uint16_t>(draw.below(65000));
    }
    std::array<std::uint64_t, coverage_states> count{};
    count_states(states.data(), posts, count);
    record.put(count);
    paint_mask(states.data(), posts, {0, 255, 1, 77, 200}, painted.data());
    record.put(painted);
    add_observer(codes.data(), posts, few.data());
    add_observer(codes.data(), posts, many.data());
    record.put(few);
    record.put(many);

    const std::size_t width = 1 + draw.below(40);
    std::vector<float> block = draw.heights(40 * 8);
    if (draw.below(2))
        for (float& z : block) z = std::isnan(z) ? 1 : z;
    const PostExtremes found = post_extremes(block.data(), 40, 8, width);
    const float bounds[] = {found.lowest_m, found.highest_m};
    record.put(bounds);
    record.put(&found.voids, 1);

    constexpr std::size_t most = CulturePieces::most;
    const auto major0 = draw.lanes(most, 20, 20.7), major1 = draw.lanes(most, 20.7, 21),
               minor0 = draw.lanes(most, -2, 66);
    auto minor1 = minor0, cells = minor0;
    for (std::size_t i = 0; i < most; ++i) {
        minor1[i] += draw.number(-1, 1);
        cells[i] = std::floor(0.5 * (minor0[i] + minor1[i]));
    }
    const std::vector<float> behind = draw.heights(2 * most), ahead = draw.heights(2 * most);
    const CultureScene scene{draw.below(2) == 0, 20, 21, 0.5, draw.number(0.4, 2.3), -0.25, draw.number(0.4, 2.3),
                             {{0, 64}, {0, 64}}};
    CultureParts parts{};
    culture_lanes(most, scene,
                  {major0.data(), minor0.data(), major1.data(), minor1.data(), draw.below(2) ? cells.data() : nullptr,
                   behind.data(), ahead.data()},
                  parts);
    for (const auto* out : {&parts.kind, &parts.first, &parts.second, &parts.third}) record.put(*out);
    record.put(parts.to_second);
    record.put(parts.to_third);
    return std::move(record).bytes();
}

Bytes pixels_of(unsigned seed) {
    Draw draw(seed);
    PixelScene scene;
    scene.centre_column = draw.number(0, 300);
    scene.metres_per_pixel = draw.number(1, 400);
    scene.up_azimuth_rad = draw.number(0, 6);
    scene.chord = draw.below(2) == 0;
    scene.rise_m = draw.number(0, 9000);
    scene.growth = 1.0001;
    scene.inverse_radius = 1 / 8.5e6;
    scene.delay_m = draw.number(0, 900);
    scene.most_range_m = scene.most_radius_m = 40000;
    scene.bins_per_metre = 0.02;
    scene.bins_per_radian = 100;
    scene.circle_bins = scene.azimuth_bins = 628;
    scene.range_bins = 800;
    scene.wraps = true;
    scene.light = draw.below(2) == 0;
    scene.ring_step_m = 5000;
    scene.mark_radius_m = 39000;
    PixelRow row{};
    const std::size_t n = 1 + draw.below(pixel_lanes);
    place_pixels(n, static_cast<std::int64_t>(draw.below(200)), draw.below(5) ? draw.number(-3e4, 3e4) : 0, scene, row);
    Record record;
    for (const auto* out :
         {&row.radius_m, &row.range_m, &row.azimuth_rad, &row.azimuth_position, &row.azimuth.share, &row.range.share})
        record.put(out->data(), n);
    for (const auto* out : {&row.azimuth.first, &row.azimuth.second, &row.azimuth.nearest, &row.range.first,
                            &row.range.second, &row.range.nearest, &row.shown, &row.light})
        record.put(out->data(), n);
    return std::move(record).bytes();
}

/// `bytes_of(seed)` on every target against the baseline's.
template <class BytesOf>
void check_every_target(BytesOf&& bytes_of, unsigned seeds) {
    for (unsigned seed = 1; seed <= seeds; ++seed) {
        Bytes plain;
        {
            const test::OnTarget on(Target::baseline);
            plain = bytes_of(seed);
        }
        REQUIRE(!plain.empty());
        for (const Target target : targets_here()) {
            const test::OnTarget on(target);
            INFO("instruction set " << name_of(target) << ", seed " << seed);
            const bool same = bytes_of(seed) == plain;
            REQUIRE(same);
        }
    }
}

}  // namespace

TEST_CASE("sweep and shade have the same bits on every instruction set", "[targets]") {
    check_every_target(sweep_of, 300);
}

TEST_CASE("cells, beam, losses and levels have the same bits on every instruction set", "[targets]") {
    check_every_target(deposits_of, 300);
    check_every_target(beams_of, 100);
    check_every_target(losses_of, 200);
    check_every_target(residuals_of, 200);
}

TEST_CASE("coverage's knots and masks, culture and extremes have the same bits on every instruction set", "[targets]") {
    check_every_target(coverage_of, 300);
}

TEST_CASE("pixels come from the same places on every instruction set", "[targets]") {
    check_every_target(pixels_of, 300);
}

TEST_CASE("the environment chooses the instruction set, and no word but the machine's is taken", "[targets]") {
    const test::OnTarget restored(target_in_use());
    const test::Variable variable("WEDGESCOPE_TARGET", "");
    const std::vector<Target> here = targets_here();
    REQUIRE(here.front() == Target::baseline);
    for (const Target target : here) {
        setenv("WEDGESCOPE_TARGET", name_of(target), 1);
        use_target_of_environment();
        CHECK(target_in_use() == target);
    }
    for (const char* word : {"auto", ""}) {
        use_target(Target::baseline);
        setenv("WEDGESCOPE_TARGET", word, 1);
        use_target_of_environment();
        CHECK(target_in_use() == here.back());
    }
    use_target(Target::baseline);
    unsetenv("WEDGESCOPE_TARGET");
    use_target_of_environment();
    CHECK(target_in_use() == here.back());
    std::vector<std::string> refused{"AVX2", "avx", "avx2 ", "neon", "0"};
    for (const char* name : target_names)
        if (std::none_of(here.begin(), here.end(), [&](Target t) { return std::strcmp(name_of(t), name) == 0; }))
            refused.emplace_back(name);
    for (const std::string& word : refused) {
        setenv("WEDGESCOPE_TARGET", word.c_str(), 1);
        CHECK_THROWS_WITH(use_target_of_environment(), Catch::Contains("WEDGESCOPE_TARGET") &&
                                                           Catch::Contains("'" + word + "'") &&
                                                           Catch::Contains("auto, baseline"));
        CHECK(target_in_use() == here.back());
    }
}
