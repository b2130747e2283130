#include "tiles/pack_bits.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace wedgescope {
namespace {

constexpr std::size_t longest = 128, word_bytes = sizeof(std::uint64_t);

static_assert(std::endian::native == std::endian::little, "the first byte of eight is the lowest");

/// How many of the n bytes from `at` on are the same, at least one.
std::size_t run_of(const std::uint8_t* at, std::size_t n) noexcept {
    const std::uint64_t same = 0x0101010101010101U * *at;
    std::size_t i = 0;
    for (; i + word_bytes <= n; i += word_bytes) {
        std::uint64_t eight;
        std::memcpy(&eight, at + i, word_bytes);
        if (eight != same) return i + static_cast<std::size_t>(std::countr_zero(eight ^ same)) / 8;
    }
    while (i < n && at[i] == *at) ++i;
    return i;
}

std::uint8_t* put_run(std::uint8_t byte, std::size_t n, std::uint8_t* to) noexcept {
    for (; n > 0; n -= std::min(n, longest)) {
        *to++ = static_cast<std::uint8_t>(257 - std::min(n, longest));  // -(n - 1); of one byte 0, as it is
        *to++ = byte;
    }
    return to;
}

std::uint8_t* put_bytes(const std::uint8_t* from, std::size_t n, std::uint8_t* to) noexcept {
    for (std::size_t part = 0; n > 0; n -= part, from += part, to += part) {
        part = std::min(n, longest);
        *to++ = static_cast<std::uint8_t>(part - 1);
        std::memcpy(to, from, part);
    }
    return to;
}

}  // namespace

std::uint8_t* pack_bits(const std::uint8_t* row, std::size_t n, std::uint8_t* to) noexcept {
    // Most rows are all alike.
    if (n > 1 && row[0] == row[n - 1] && std::memcmp(row, row + 1, n - 1) == 0) return put_run(row[0], n, to);
    std::size_t begin = 0;  // of the bytes that wait to be put as they are
    for (std::size_t i = 0; i < n;) {
        const std::size_t run = run_of(row + i, n - i);
        // One that ends bytes as they are must save the count of those behind it.
        if (run >= (i == begin ? 2 : 3)) {
            to = put_bytes(row + begin, i - begin, to);
            to = put_run(row[i], run, to);
            begin = i + run;
        }
        i += run;
    }
    return put_bytes(row + begin, n - begin, to);
}

}  // namespace wedgescope
