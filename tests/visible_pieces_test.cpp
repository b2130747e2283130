// Visible pieces, closed up by lanes, against picking them one by one.
#include <catch2/catch.hpp>

#include <iterator>
#include <limits>
#include <random>
#include <vector>

#include "lib/visible_pieces.hpp"
#include "tests/every_target.hpp"

using namespace wedgescope;

TEST_CASE("of tile after tile the visible pieces stand behind one another, in order, all that is kept of them",
          "[sweep]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(11);
    VisiblePieces pieces;
    std::vector<std::int64_t> lanes;
    std::vector<double> ranges;
    std::vector<float> pairs;
    for (int turn = 0; turn < 3000; ++turn) {
        const std::size_t n = 1 + random() % 32, visible = random() % 9;
        if (pieces.size() + n > VisiblePieces::most) {
            REQUIRE(pieces.size() == lanes.size());
            for (std::size_t i = 0; i < lanes.size(); ++i) {
                REQUIRE(pieces.integer(VisiblePieces::lane, i) == lanes[i]);
                REQUIRE(pieces.numbers(VisiblePieces::range1)[i] == ranges[i]);
                REQUIRE(pieces.pairs(VisiblePieces::ahead)[2 * i] == pairs[2 * i]);
                REQUIRE(pieces.pairs(VisiblePieces::ahead)[2 * i + 1] == pairs[2 * i + 1]);
            }
            pieces.clear();
            lanes.clear(), ranges.clear(), pairs.clear();
        }
        // As long as they are: nothing behind their ends is read.
        std::vector<double> code(n), range(n);
        std::vector<std::int64_t> lane(n);
        std::vector<float> posts(2 * n);
        for (std::size_t i = 0; i < n; ++i) {
            code[i] = random() % 8 < visible ? 1 : random() % 2 ? 0 : 2;
            lane[i] = static_cast<std::int64_t>(random()) - (std::int64_t{1} << 31);
            range[i] = static_cast<double>(random()) / 7;
            posts[2 * i] = static_cast<float>(random());
            posts[2 * i + 1] = static_cast<float>(random());
            if (code[i] != 1) continue;
            lanes.push_back(lane[i]);
            ranges.push_back(range[i]);
            pairs.insert(pairs.end(), {posts[2 * i], posts[2 * i + 1]});
        }
        VisiblePieces::Tile tile{};
        tile[VisiblePieces::lane] = lane.data();
        tile[VisiblePieces::range1] = range.data();
        tile[VisiblePieces::ahead] = posts.data();
        pieces.add(n, code.data(), tile);
        REQUIRE(pieces.size() == lanes.size());
    }
}

TEST_CASE("lanes of a code are found among any number of lanes, whatever stands behind them", "[sweep]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    std::mt19937 random(12);
    const double codes[] = {0, 1, 2, std::numeric_limits<double>::quiet_NaN(), -2};
    for (int turn = 0; turn < 2000; ++turn) {
        LaneArray code(64);
        for (double& c : code) c = codes[random() % std::size(codes)];
        const std::size_t n = 1 + random() % 64;
        std::uint64_t expected = 0;
        for (std::size_t i = 0; i < n; ++i)
            if (code[i] == 2) expected |= std::uint64_t{1} << i;
        REQUIRE(lanes_of_code(2, n, code.data()) == expected);
    }
}
