// Culture cells under pieces, by lanes, against walking along each piece in small steps.
#include <catch2/catch.hpp>

#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "lib/culture_lanes.hpp"
#include "lib/material.hpp"
#include "tests/bare_scene.hpp"
#include "tests/every_target.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;

namespace {

struct Pieces {
    std::vector<double> major0, minor0, major1, minor1, cell;
    std::vector<float> behind, ahead;
    CulturePieces view(bool walls) const {
        CulturePieces p{major0.data(), minor0.data(), major1.data(), minor1.data()};
        if (walls) {
            p.cell = cell.data();
            p.behind_m = behind.data();
            p.ahead_m = ahead.data();
        }
        return p;
    }
};

/// Pieces of up to one cell, as they lie between two lines, some of them exactly along a line or ending on a post.
Pieces pieces(std::mt19937& random, double reach, double behind, double ahead) {
    constexpr std::size_t n = CulturePieces::most;
    const auto number = [&](double from, double to) { return std::uniform_real_distribution<>(from, to)(random); };
    Pieces p;
    for (std::size_t i = 0; i < n; ++i) {
        const double start = number(-2, 70), way = number(-reach, reach);
        const double part0 = random() % 4 == 0 ? 0 : number(0, 0.7), part1 = random() % 4 == 0 ? 1 : number(part0, 1);
        p.major0.push_back(behind + part0 * (ahead - behind));
        p.major1.push_back(behind + part1 * (ahead - behind));
        p.minor0.push_back(random() % 4 == 0 ? std::floor(start) : start);
        p.minor1.push_back(random() % 5 == 0 ? p.minor0.back() : p.minor0.back() + way);
        p.cell.push_back(std::floor(0.5 * (p.minor0.back() + p.minor1.back())));
    }
    const float heights[] = {0, 0, 0, 0, 0, 3, 7.5F, 7.5F, NAN, -1};
    for (auto* posts : {&p.behind, &p.ahead})
        for (std::size_t i = 0; i < 2 * n; ++i) posts->push_back(heights[random() % std::size(heights)]);
    return p;
}

}  // namespace

TEST_CASE("the culture cells along a piece are those that one meets walking along it", "[culture]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(5);
    for (int turn = 0; turn < 90; ++turn) {
        const double coarse = turn % 3 == 0 ? 1.0 : turn % 3 == 1 ? 0.61 : 2.3;  // culture cells in a post
        CultureScene scene{.lines_are_columns = turn % 2 == 0,
                           .behind_major = turn % 4 < 2 ? 20.0 : 21.0,
                           .ahead_major = turn % 4 < 2 ? 21.0 : 20.0,
                           .column_offset = turn % 5 == 0 ? 0 : -0.5,  // borders through posts
                           .column_scale = coarse,
                           .row_offset = turn % 5 == 0 ? 0 : 0.25,
                           .row_scale = coarse,
                           .tile = {{0, 64}, {0, 48}}};
        const Pieces p = pieces(random, 1, scene.behind_major, scene.ahead_major);
        CultureParts found;
        const std::size_t n = 1 + random() % CulturePieces::most;
        culture_lanes(n, scene, p.view(false), found);
        for (std::size_t i = 0; i < n; ++i) {
            CAPTURE(turn, i);
            const auto at = [&](double u) {
                const double major = p.major0[i] + u * (p.major1[i] - p.major0[i]),
                             minor = p.minor0[i] + u * (p.minor1[i] - p.minor0[i]);
                const double column = scene.lines_are_columns ? major : minor,
                             row = scene.lines_are_columns ? minor : major;
                return std::pair(std::floor(scene.column_offset + scene.column_scale * column),
                                 std::floor(scene.row_offset + scene.row_scale * row));
            };
            const auto inside = [&](std::pair<double, double> cell) {
                return cell.first >= 0 && cell.first < 64 && cell.second >= 0 && cell.second < 48;
            };
            const auto from = at(0), to = at(1);
            if (!inside(from) || !inside(to)) {
                REQUIRE(found.kind[i] == CultureParts::elsewhere);
                continue;
            }
            if (std::abs(from.first - to.first) > 1 || std::abs(from.second - to.second) > 1) {
                REQUIRE(found.kind[i] == CultureParts::many);
                continue;
            }
            REQUIRE(found.kind[i] == CultureParts::parts);
            REQUIRE(0 <= found.to_second[i]);
            REQUIRE(found.to_second[i] <= found.to_third[i]);
            REQUIRE(found.to_third[i] <= 1);
            // Each cell is one that the piece runs through, not one that it only touches.
            const double to_second = static_cast<double>(found.to_second[i]),
                         to_third = static_cast<double>(found.to_third[i]);
            const double borders[] = {0, to_second, to_third, 1};
            const std::int32_t named[] = {found.first[i], found.second[i], found.third[i]};
            for (const std::int32_t cell : named) {
                bool met = p.major0[i] == p.major1[i] && p.minor0[i] == p.minor1[i];
                for (int k = 0; k < 3; ++k) met = met || (borders[k] < borders[k + 1] && named[k] == cell);
                REQUIRE(met);
            }
            for (int k = 0; k < 200; ++k) {
                const double u = (k + 0.5) / 200;
                if (std::abs(u - to_second) < 1e-6 || std::abs(u - to_third) < 1e-6) continue;  // they are floats
                const std::int32_t cell = u < to_second  ? found.first[i]
                                          : u < to_third ? found.second[i]
                                                         : found.third[i];
                const auto met = at(u);
                REQUIRE(cell == static_cast<std::int32_t>(met.second * 64 + met.first));
            }
        }
    }
}

TEST_CASE("a piece in a cell with culture on a corner is a wall of the corner with the highest one", "[culture]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(6);
    for (int turn = 0; turn < 90; ++turn) {
        const bool columns = turn % 2 == 0;
        const double behind = turn % 4 < 2 ? 20 : 21, ahead = turn % 4 < 2 ? 21 : 20;
        const CultureScene scene{columns, behind, ahead, 0.5, 1, 0.5, 1, {{0, 64}, {0, 64}}};
        const Pieces p = pieces(random, 0.2, behind, ahead);
        CultureParts found;
        culture_lanes(CulturePieces::most, scene, p.view(true), found);
        for (std::size_t i = 0; i < CulturePieces::most; ++i) {
            CAPTURE(turn, i);
            // Of all corners in raster order the first one that no other stands over.
            float most = 0;
            int row = 0, column = 0;
            for (int r = 0; r < 70; ++r)
                for (int c = 0; c < 70; ++c) {
                    const double major = columns ? c : r, minor = columns ? r : c;
                    if (major != behind && major != ahead) continue;
                    if (minor != p.cell[i] && minor != p.cell[i] + 1) continue;
                    const float h = (major == behind ? p.behind : p.ahead)[2 * i + (minor == p.cell[i] ? 0 : 1)];
                    if (!(h > most)) continue;
                    most = h;
                    row = r;
                    column = c;
                }
            const bool far = p.cell[i] < 0 || p.cell[i] > 62;
            if (far) continue;
            REQUIRE((found.kind[i] == CultureParts::wall) == (most > 0));
            if (most > 0) REQUIRE(found.first[i] == row * 64 + column);
        }
    }
}

TEST_CASE("how culture is tiled changes no bit, whatever its cells' borders run through", "[culture][long]") {
    constexpr int columns = 121, rows = 111;
    std::mt19937 random(31);
    std::vector<int> drawn(columns * rows);
    for (int& id : drawn) id = static_cast<int>(random() % 4);  // the first of the table, and water
    const auto classes = [&](double c, double r) {
        const int id = drawn[static_cast<std::size_t>(r) * columns + static_cast<std::size_t>(c)];
        return id == 3 ? static_cast<int>(*Materials().find("water")) : id + 1;
    };
    const auto hills = test::rolling(20, 12, 3);
    // Cells centred on posts, with borders through posts, and of another size.
    for (const auto& [offset, scale] : {std::pair(0.5, 1.0), {0.0, 1.0}, {0.31, 0.61}, {0.0, 2.0}})
        for (const bool on_post : {false, true})
            for (const bool far_shore : {false, true})
                for (const bool heights : {false, true}) {
                    INFO(offset << " " << scale << " " << on_post << far_shore << heights);
                    std::optional<RunResult> whole;
                    for (const std::int64_t tile : {256, 16, 5}) {
                        test::MemorySource source(columns, rows, 30, [&](double c, double r) { return hills(c, r); });
                        source.set_classes(classes);
                        if (heights)
                            source.set_culture_height(
                                [](double c, double r) { return std::fmod(c + 3 * r, 11) < 1 ? 8 : 0; });
                        DataBase& db = source.editable();
                        db.culture_column_offset = db.culture_row_offset = offset;
                        db.culture_column_scale = db.culture_row_scale = scale;
                        db.culture_tile_columns = db.culture_tile_rows = tile;
                        Scene s =
                            test::bare_scene(30 * (on_post ? 60 : 60.37), -30 * (on_post ? 55 : 54.81), 150, 1500);
                        s.far_shore = far_shore;
                        s.azimuth_bins = 240;
                        s.quality = Quality::normal;
                        RunResult here = test::simulate(s, source);
                        if (!whole) {
                            whole = std::move(here);
                            CHECK(test::sum_of(whole->echo_w) > 0);
                            continue;
                        }
                        CHECK(here.echo_w.cells == whole->echo_w.cells);
                        CHECK(here.echo_state.cells == whole->echo_state.cells);
                    }
                }
}

TEST_CASE("a culture cell that seen ground only touches is not asked for its class", "[culture][long]") {
    // A plateau that ends at line `edge` from the sensor, all else hidden under it, either way along either axis; borders
    // of culture cells run through posts, and those from the edge on, or from a line before it, are of no class.
    for (const bool by_columns : {false, true})
        for (const bool forward : {false, true})
            for (const bool far_shore : {false, true})
                for (const bool seen : {false, true}) {
                    INFO(by_columns << forward << far_shore << seen);
                    const auto beyond = [&](double c, double r) {  // posts past the edge
                        const double at = by_columns ? c : r;
                        return forward ? at - 20 : 20 - at;
                    };
                    test::MemorySource source(
                        41, 41, 30, [&](double c, double r) { return beyond(c, r) > 0 ? 0 : 120 + beyond(c, r); });
                    source.set_classes([&](double c, double r) {
                        const double cell = beyond(c, r) + (forward ? 0 : -1);  // its near border, from the edge
                        return cell >= (seen ? -1 : 0) ? static_cast<int>(unknown_class) : 1;
                    });
                    DataBase& db = source.editable();
                    db.culture_column_offset = db.culture_row_offset = 0;
                    const double near = forward ? 6 : 34;
                    Scene s =
                        test::bare_scene(30 * (by_columns ? near : 20.0), -30 * (by_columns ? 20.0 : near), 126, 700);
                    s.earth_k.reset();
                    s.far_shore = far_shore;
                    s.azimuth_bins = 120;
                    if (seen)
                        CHECK_THROWS_WITH(test::simulate(s, source), Catch::Contains("is not in the legend"));
                    else
                        CHECK_NOTHROW(test::simulate(s, source));
                }
}
