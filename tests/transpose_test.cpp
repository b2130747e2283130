// Transposing by registers, against the definition, at sizes that do not fill them.
#include <catch2/catch.hpp>

#include <random>
#include <vector>

#include "lib/transpose.hpp"

using namespace wedgescope;

TEST_CASE("sixteen rows of bytes become columns, and nothing beside them is touched", "[transpose]") {
    std::mt19937 random(7);
    for (const std::size_t columns : {1, 15, 16, 17, 32, 61, 64}) {
        CAPTURE(columns);
        std::vector<std::vector<std::uint8_t>> rows(16, std::vector<std::uint8_t>(columns));
        std::array<const std::uint8_t*, 16> from{};
        for (std::size_t r = 0; r < 16; ++r) {
            for (auto& b : rows[r]) b = static_cast<std::uint8_t>(random() % 200);
            from[r] = rows[r].data();
        }
        const std::size_t stride = 19;
        std::vector<std::uint8_t> to(columns * stride, 255);
        transpose_bytes(from, columns, to.data(), stride);
        int wrong = 0;
        for (std::size_t c = 0; c < columns; ++c)
            for (std::size_t r = 0; r < stride; ++r) wrong += to[c * stride + r] != (r < 16 ? rows[r][c] : 255);
        CHECK(wrong == 0);
    }
}

TEST_CASE("floats of any rectangle become columns, and nothing beside them is touched", "[transpose]") {
    for (const std::size_t rows : {1, 3, 4, 16, 21})
        for (const std::size_t columns : {1, 4, 7, 16, 33}) {
            CAPTURE(rows, columns);
            const std::size_t from_stride = columns + 2, to_stride = rows + 3;
            std::vector<float> from(rows * from_stride), to(columns * to_stride, -1);
            for (std::size_t i = 0; i < from.size(); ++i) from[i] = static_cast<float>(i);
            transpose_floats(from.data(), from_stride, rows, columns, to.data(), to_stride);
            int wrong = 0;
            for (std::size_t c = 0; c < columns; ++c)
                for (std::size_t r = 0; r < to_stride; ++r)
                    wrong += to[c * to_stride + r] != (r < rows ? static_cast<float>(r * from_stride + c) : -1.0F);
            CHECK(wrong == 0);
        }
}
