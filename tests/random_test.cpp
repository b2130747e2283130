// The counter-based generator, against its authors' known answers.
#include <catch2/catch.hpp>

#include "lib/random.hpp"

using namespace wedgescope;

TEST_CASE("Philox4x32-10 gives the published known-answer vectors", "[random]") {
    // Random123's kat_vectors, philox 4x32 10.
    CHECK(philox({0, 0}, {0, 0, 0, 0}) == PhiloxBlock{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8});
    CHECK(philox({0xffffffff, 0xffffffff}, {0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff}) ==
          PhiloxBlock{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd});
    CHECK(philox({0xa4093822, 0x299f31d0}, {0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}) ==
          PhiloxBlock{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1});
}

TEST_CASE("a uniform number is never 0 nor 1", "[random]") {
    CHECK(uniform(0) == 0x1p-33);
    CHECK(uniform(0xffffffff) == 1 - 0x1p-33);
    CHECK(uniform(0x7fffffff) + uniform(0x80000000) == 1);
}

TEST_CASE("neighbouring counters give uncorrelated uniform numbers", "[random]") {
    const std::uint32_t n = 20000;
    double sum = 0, square = 0, product = 0, before = 0.5;
    for (std::uint32_t i = 0; i < n; ++i) {
        const double u = uniform(philox({1, 0}, {i, 0, 0, 1})[0]);
        sum += u;
        square += (u - 0.5) * (u - 0.5);
        product += (u - 0.5) * (before - 0.5);
        before = u;
    }
    // Four standard deviations of each estimate: of the mean sqrt(1/12n), of the variance sqrt(1/180n), of the product
    // 1/12 sqrt(1/n).
    CHECK(sum / n == Approx(0.5).margin(4 * 0.2887 / 141.4));
    CHECK(square / n == Approx(1.0 / 12).margin(4 * 0.0745 / 141.4));
    CHECK(product / n == Approx(0).margin(4 * 0.0833 / 141.4));
}
