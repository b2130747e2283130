// Cells that echoes are added to: sums that depend on no order, states, and the quanta that both are counted in.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "lib/deposit.hpp"
#include "lib/lanes.hpp"
#include "tests/every_target.hpp"

using namespace wedgescope;

TEST_CASE("deposits add up to what was put in, bin by bin, in any order and by lanes or one by one", "[deposit]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    constexpr std::size_t rows = 5, columns = 190;
    const Quanta q = quanta({10, 10 + columns}, 25, 1e3, 1, 0.01, 2);
    std::mt19937 random(23);
    std::uniform_real_distribution<double> any(0, 1);
    // Of one class all along, and of up to three.
    for (const bool stretched : {false, true}) {
        struct Put {
            WedgeCells::Target target;
            WedgeCells::Portion portion;
            WedgeCells::Stretches stretches;
        };
        std::vector<Put> puts;
        for (int i = 0; i < 5000; ++i) {
            Put p;
            p.target.row = static_cast<std::int32_t>(random() % rows);
            p.target.share[0] = 0.01 * any(random);
            p.target.share[1] = random() % 3 == 0 && p.target.row < 4 ? 0.01 * any(random) : 0;
            p.portion.x0 = 5 + 205 * any(random);
            p.portion.x1 = p.portion.x0 + 6 * (any(random) - 0.5);
            p.portion.power = 1e-6 * any(random);
            p.portion.bow = 2 * any(random) - 1;
            p.stretches = WedgeCells::Stretches::one(2 * any(random));
            if (stretched && random() % 4 > 0) {
                const auto number = [&] { return static_cast<float>(any(random)); };
                const float border = number();
                p.stretches = {
                    {2 * number(), 2 * number(), 2 * number()}, random() % 2 ? border : border * number(), border};
            }
            puts.push_back(p);
        }
        WedgeCells forward(rows, q), backward(rows, q), lanes(rows, q);
        std::vector<double> expected(rows * columns);
        for (const Put& p : puts) {
            forward.add(p.target, p.portion, p.stretches);
            const auto way_to = [&](double x) { return (x - p.portion.x0) / (p.portion.x1 - p.portion.x0); };
            const double borders[] = {0, static_cast<double>(p.stretches.second),
                                      static_cast<double>(p.stretches.third), 1};
            for (std::size_t j = 0; j < columns; ++j)
                for (std::size_t k = 0; k < 3; ++k) {
                    const double a = way_to(10 + static_cast<double>(j)), b = way_to(11 + static_cast<double>(j)),
                                 from = std::max(std::min(a, b), borders[k]),
                                 to = std::min(std::max(a, b), borders[k + 1]);
                    if (!(to > from)) continue;
                    // What lies between, by the mean of how dense it is at its ends, which is a straight line.
                    const double watts = static_cast<double>(p.stretches.gamma[k]) * p.portion.power * (to - from) *
                                         (1 + p.portion.bow * (1 - from - to));
                    for (std::size_t side = 0; side < 2; ++side)
                        if (p.target.share[side] > 0)
                            expected[(static_cast<std::size_t>(p.target.row) + side) * columns + j] +=
                                watts * p.target.share[side];
                }
        }
        for (auto p = puts.rbegin(); p != puts.rend(); ++p) backward.add(p->target, p->portion, p->stretches);
        // In metres, of which a power of two make a bin; behind the last lane stands anything.
        constexpr double bins = 1.0 / 32, wild[] = {NAN, 1e38, -1e38, INFINITY, -INFINITY, 1, -7};
        for (std::size_t at = 0; at < puts.size();) {
            const std::size_t n = std::min(1 + random() % WedgeCells::Portions::most, puts.size() - at),
                              whole = whole_registers(n);
            const auto column = [&](const auto& of) {
                std::vector<double> out;
                for (std::size_t i = 0; i < n; ++i) out.push_back(of(puts[at + i]));
                while (out.size() < whole) out.push_back(wild[random() % std::size(wild)]);
                return out;
            };
            const auto floats = [&](const auto& of) {
                const std::vector<double> numbers = column(of);
                return std::vector<float>(numbers.begin(), numbers.end());
            };
            const auto s0 = column([](const Put&p) { return p.target.share[0]; }),
                       s1 = column([](const Put&p) { return p.target.share[1]; }),
                       x0 = column([](const Put&p) { return p.portion.x0 / bins; }),
                       x1 = column([](const Put&p) { return p.portion.x1 / bins; }),
                       power = column([](const Put&p) { return p.portion.power; });
            const auto gamma = [&](std::size_t k) {
                return floats([k](const Put& p) { return static_cast<double>(p.stretches.gamma[k]); });
            };
            const auto bow = floats([](const Put&p) { return p.portion.bow; }), gamma0 = gamma(0), gamma1 = gamma(1),
                       gamma2 = gamma(2),
                       second = floats([](const Put&p) { return static_cast<double>(p.stretches.second); }),
                       third = floats([](const Put&p) { return static_cast<double>(p.stretches.third); });
            std::vector<std::int64_t> row;
            std::vector<std::int32_t> straddlers;
            for (std::size_t i = 0; i < n; ++i) {
                row.push_back(forward.origin_of(puts[at + i].target.row));
                if (s1[i] > 0) straddlers.push_back(static_cast<std::int32_t>(i));
            }
            lanes.add_lanes(n, {row.data(),
                                s0.data(),
                                s1.data(),
                                straddlers,
                                x0.data(),
                                x1.data(),
                                bins,
                                power.data(),
                                bow.data(),
                                {gamma0.data(), gamma1.data(), gamma2.data()},
                                stretched ? second.data() : nullptr,
                                third.data()});
            at += n;
        }
        double worst = 0;
        for (std::size_t r = 0; r < rows; ++r)
            for (std::size_t j = 0; j < columns; ++j) {
                REQUIRE(forward.watts(r, j) == backward.watts(r, j));
                REQUIRE(forward.watts(r, j) == lanes.watts(r, j));
                worst = std::max(worst, std::abs(forward.watts(r, j) / expected[r * columns + j] - 1));
            }
        CHECK(worst < 1e-5);  // pieces are floats
    }
}

TEST_CASE("lanes that lie on either side of a border between quanta, on it and over it deposit what they do one by one",
          "[deposit]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    constexpr std::size_t rows = 3, columns = 190;
    const Quanta q = quanta({10, 10 + columns}, 25, 1e3, 1, 0.01, 2);
    REQUIRE(q.runs.size() > 4);
    const auto border = [&](std::size_t run) { return static_cast<double>(q.runs[run].begin); };
    // Where portions of a block begin and end.
    const auto block = [](const std::vector<std::pair<double, double>>& ways) {
        std::vector<std::pair<double, double>> all;
        while (all.size() < 100) all.insert(all.end(), ways.begin(), ways.end());
        all.resize(100);
        return all;
    };
    const double b = border(2), c = border(3), last = border(q.runs.size() - 1);
    for (const auto& ways :
         {block({{b - 1.5, b - 0.2}}),                                                // before it
          block({{b + 0.5, b + 1.7}}),                                                // behind it
          block({{b - 0.5, b + 0.7}}),                                                // over it
          block({{b - 1, b}, {b, b + 1}, {b, b - 1}, {b, b}}),                        // on it
          block({{b - 2, b - 1.1}, {b + 1.2, b}, {b - 0.1, b + 2.2}}),                // all of these
          block({{c + 1, c + 2}, {b - 2, b - 1}, {b + 1, b + 2}}),                    // of three runs
          block({{b + 1, b + 2}, {c + 1, c + 2}, {b - 2, b - 1}}),                    // the nearest last
          block({{last + 1, last + 2.5}, {198.5, 199.7}, {199.5, 201}, {205, 206}}),  // of the last one
          block({{4, 6}, {9.5, 10.5}, {b - 0.5, b + 0.5}, {4, 5}}),                   // from before the first bin on
          block({{4, 6}, {300, 301}})}) {                                             // of none
        const std::size_t n = ways.size(), whole = whole_registers(n);
        std::mt19937 random(7);
        std::uniform_real_distribution<double> any(0, 1);
        std::vector<double> share0(whole), share1(whole), x0(whole), x1(whole), power(whole);
        std::vector<float> bow(whole), gamma(whole);
        std::vector<std::int64_t> origin(whole);
        std::vector<std::int32_t> straddlers;
        WedgeCells single(rows, q), lanes(rows, q);
        for (std::size_t i = 0; i < n; ++i) {
            const auto row = static_cast<std::int32_t>(random() % (rows - 1));
            origin[i] = single.origin_of(row);
            share0[i] = 0.01 * any(random);
            share1[i] = i % 3 == 0 ? 0.01 * any(random) : 0;
            if (share1[i] > 0) straddlers.push_back(static_cast<std::int32_t>(i));
            x0[i] = ways[i].first;
            x1[i] = ways[i].second;
            power[i] = 1e-6 * any(random);
            bow[i] = static_cast<float>(2 * any(random) - 1);
            gamma[i] = static_cast<float>(any(random));
            single.add({row, {share0[i], share1[i]}}, {x0[i], x1[i], power[i], static_cast<double>(bow[i])},
                       WedgeCells::Stretches::one(static_cast<double>(gamma[i])));
        }
        lanes.add_lanes(n, {origin.data(),
                            share0.data(),
                            share1.data(),
                            straddlers,
                            x0.data(),
                            x1.data(),
                            1,
                            power.data(),
                            bow.data(),
                            {nullptr, nullptr, gamma.data()}});
        double sum = 0;
        for (std::size_t row = 0; row < rows; ++row)
            for (std::size_t j = 0; j < columns; ++j) {
                REQUIRE(single.watts(row, j) == lanes.watts(row, j));
                sum += single.watts(row, j);
            }
        CHECK((sum > 0) == (ways[1].first < 200));
    }
}

TEST_CASE("a dim stretch behind a bright one, and one of many bins, have what is theirs in every bin", "[deposit]") {
    struct Row {
        std::int64_t bins;
        double dim;
    };
    const auto row = GENERATE(values<Row>({{200, 1e-6}, {30, 1e-4}, {30000, 1}}));
    const double bow = GENERATE(0.0, 1.0, -0.6);
    const auto n = static_cast<double>(row.bins);
    const Quanta q = quanta({0, row.bins + 20}, 25, 1e3, 1, 0.01, 2);
    WedgeCells cells(1, q);
    const double x0 = 10.25, x1 = x0 + n, power = 1e-6, border = 0.25;
    const auto dim = static_cast<float>(row.dim);
    WedgeCells::Target target{};
    target.share[0] = 0.01;
    cells.add(target, {x0, x1, power, bow}, {{1, dim, dim}, static_cast<float>(border), 1});
    for (std::int64_t j = 0; j < row.bins + 20; ++j) {
        const auto upto = [&](double x) {
            const double u = std::clamp((x - x0) / n, 0.0, 1.0), s = u + bow * u * (1 - u),
                         b = border + bow * border * (1 - border);
            return std::min(s, b) + static_cast<double>(dim) * std::max(0.0, s - b);
        };
        const auto x = static_cast<double>(j);
        const double expected = 0.01 * power * (upto(x + 1) - upto(x)),
                     got = cells.watts(0, static_cast<std::size_t>(j));
        const double quantum = q.watts[static_cast<std::size_t>(j)];
        INFO("bin " << j << " of " << row.bins << ", bow " << bow << ": " << got << ", " << expected);
        REQUIRE(got >= 0);
        REQUIRE(std::fabs(got - expected) <= 1e-6 * expected + quantum);
    }
}

TEST_CASE("a piece that ends an instant before a bin's edge stays in its bin", "[deposit]") {
    const Quanta q = quanta({0, 20}, 25, 1e3, 1, 0.01, 2);
    WedgeCells cells(1, q);
    WedgeCells::Target target{};
    target.share[0] = 0.01;
    for (const double k : {8.0, 20.0}) cells.add(target, {k - 1e-9, k - 1e-9, 1e-6, 0}, WedgeCells::Stretches::one(1));
    for (std::size_t j = 0; j < 20; ++j) CHECK((cells.watts(0, j) > 0) == (j == 7 || j == 19));
}

TEST_CASE("a row's states are the most telling of all that was marked, in whatever stretches", "[deposit]") {
    constexpr std::int64_t first = 7, columns = 150;
    constexpr std::size_t rows = 3;
    const Quanta q = quanta({first, first + columns}, 25, 1e3, 1, 0.01, 2);
    std::mt19937 random(3);
    for (int round = 0; round < 200; ++round) {
        WedgeCells cells(rows, q);
        std::array<std::array<int, columns>, rows> met{};
        const int marks = 1 + static_cast<int>(random() % 12);
        for (int i = 0; i < marks; ++i) {
            const auto place = [&] {
                return static_cast<double>(first) - 20 + 0.25 * static_cast<double>(random() % 800);
            };
            const double x0 = place(), x1 = random() % 4 ? x0 + 0.25 * static_cast<double>(random() % 80) : place();
            const auto bit = static_cast<std::uint8_t>(1U << random() % 4);
            WedgeCells::Target target{static_cast<std::int32_t>(random() % (rows - 1)),
                                      {0.01, random() % 3 ? 0 : 0.02}};
            cells.mark(target, x0, x1, bit);
            for (std::size_t side = 0; side < (target.share[1] > 0 ? 2U : 1U); ++side)
                for (std::int64_t j = 0; j < columns; ++j)
                    if (std::max(x0, x1) >= static_cast<double>(first + j) &&
                        std::min(x0, x1) < static_cast<double>(first + j + 1))
                        met[static_cast<std::size_t>(target.row) + side][static_cast<std::size_t>(j)] |= bit;
        }
        std::array<float, columns> watts;
        std::array<std::uint8_t, columns> states;
        for (std::size_t row = 0; row < rows; ++row) {
            cells.finish(row, watts.data(), states.data());
            for (std::size_t j = 0; j < columns; ++j) {
                const int bits = met[row][j];
                const State expected = bits & bit_seen      ? State::seen
                                       : bits & bit_unknown ? State::unknown
                                       : bits & bit_shadow  ? State::shadow
                                       : bits & bit_no_data ? State::no_data
                                                            : State::outside;
                INFO("round " << round << ", row " << row << ", column " << j);
                REQUIRE(states[j] == static_cast<std::uint8_t>(expected));
                REQUIRE(watts[j] == 0);
            }
        }
    }
}

TEST_CASE("what a bin takes does not hang on which other bins there are", "[deposit]") {
    // Pieces of one bin to dozens, either way round, in lanes and alone; the first and last bins cut many of them.
    const Quanta all = quanta({0, 400}, 25, 1e3, 1, 0.01, 2), some = quanta({100, 200}, 25, 1e3, 1, 0.01, 2);
    WedgeCells alone(1, all), part(1, some), lanes(1, all), part_lanes(1, some);
    std::mt19937 random(11);
    const auto any = [&](double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); };
    int cut = 0;
    for (int round = 0; round < 200; ++round) {
        std::array<double, WedgeCells::Portions::most> share0, share1{}, x0, x1, power;
        std::array<float, WedgeCells::Portions::most> bow, second, third;
        std::array<std::array<float, WedgeCells::Portions::most>, 3> gamma;
        std::array<std::int64_t, WedgeCells::Portions::most> origin, part_origin;
        for (std::size_t i = 0; i < share0.size(); ++i) {
            share0[i] = any(0.001, 0.01);
            x0[i] = any(90, 210);
            x1[i] = x0[i] + any(-1, 1) * (random() % 4 ? 4 : 60);
            power[i] = any(0, 1e-7);
            bow[i] = static_cast<float>(any(-1, 1));
            second[i] = static_cast<float>(any(0, 0.5));
            third[i] = static_cast<float>(any(0.5, 1));
            for (auto& g : gamma) g[i] = static_cast<float>(any(0, 2));
            const double near = std::min(x0[i], x1[i]), far = std::max(x0[i], x1[i]);
            cut += (near < 100 && far > 100) || (near < 200 && far > 200);
            const WedgeCells::Target target{0, {share0[i], 0}};
            const WedgeCells::Portion portion{x0[i], x1[i], power[i], static_cast<double>(bow[i])};
            const WedgeCells::Stretches stretches{{gamma[0][i], gamma[1][i], gamma[2][i]}, second[i], third[i]};
            alone.add(target, portion, stretches);
            part.add(target, portion, stretches);
            origin[i] = lanes.origin_of(0);
            part_origin[i] = part_lanes.origin_of(0);
        }
        WedgeCells::Portions p{origin.data(),
                               share0.data(),
                               share1.data(),
                               {},
                               x0.data(),
                               x1.data(),
                               1,
                               power.data(),
                               bow.data(),
                               {gamma[0].data(), gamma[1].data(), gamma[2].data()},
                               second.data(),
                               third.data()};
        lanes.add_lanes(share0.size(), p);
        p.origin = part_origin.data();
        part_lanes.add_lanes(share0.size(), p);
    }
    CHECK(cut > 300);
    for (std::size_t j = 0; j < 100; ++j) {
        INFO("bin " << 100 + j);
        REQUIRE(alone.watts(0, 100 + j) > 0);
        CHECK(part.watts(0, j) == alone.watts(0, 100 + j));
        CHECK(lanes.watts(0, 100 + j) == alone.watts(0, 100 + j));
        CHECK(part_lanes.watts(0, j) == alone.watts(0, 100 + j));
    }
}

TEST_CASE("the quantum of a bin leaves room for all that a cell can hold, and no more than a bit", "[deposit]") {
    const double constant = 1234.5, pattern = 0.8, step = 0.0065, gamma = 3.2;
    const Quanta q = quanta({0, 40}, 100, constant, pattern, step, gamma);
    for (std::size_t j = 0; j < 40; ++j) {
        const double near = std::max(1.0, static_cast<double>(j) * 100),
                     most = constant * pattern * 2 * step * gamma / (near * near);
        CHECK(q.watts[j] >= most * 0x1p-61);
        CHECK(q.watts[j] < most * 0x1p-60);
        int exponent = 0;
        CHECK(std::frexp(q.watts[j], &exponent) == 0.5);  // a power of two
    }
}
