#include "lib/transpose.hpp"

#include <algorithm>
#include <cstring>

// The compiler's vectors of 16 bytes, which every x86-64 has, serve as well as wider ones here.
namespace wedgescope {
namespace {

using Bytes [[gnu::vector_size(16)]] = std::uint8_t;
using Floats [[gnu::vector_size(16)]] = float;

template <class V, class T>
V load(const T* from) {
    V v;
    std::memcpy(&v, from, sizeof v);
    return v;
}
template <class V, class T>
void store(const V& v, T* to) {
    std::memcpy(to, &v, sizeof v);
}

Bytes lower(Bytes a, Bytes b) {
    return __builtin_shufflevector(a, b, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
}
Bytes upper(Bytes a, Bytes b) {
    return __builtin_shufflevector(a, b, 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
}
Floats lower(Floats a, Floats b) { return __builtin_shufflevector(a, b, 0, 4, 1, 5); }
Floats upper(Floats a, Floats b) { return __builtin_shufflevector(a, b, 2, 6, 3, 7); }

/// Interleaves register i with i + n / 2: after log2 n rounds register c holds column c.
template <class V, std::size_t n>
void interleave(V (&v)[n]) {
    V next[n];
    for (std::size_t i = 0; i < n / 2; ++i) {
        next[2 * i] = lower(v[i], v[i + n / 2]);
        next[2 * i + 1] = upper(v[i], v[i + n / 2]);
    }
    std::copy(next, next + n, v);
}

}  // namespace

void transpose_bytes(const std::array<const std::uint8_t*, 16>& from, std::size_t columns, std::uint8_t* to,
                     std::size_t stride) noexcept {
    std::size_t c = 0;
    for (; c + 16 <= columns; c += 16) {
        Bytes v[16];
        for (std::size_t r = 0; r < 16; ++r) v[r] = load<Bytes>(from[r] + c);
        for (int round = 0; round < 4; ++round) interleave(v);
        for (std::size_t r = 0; r < 16; ++r) store(v[r], to + (c + r) * stride);
    }
    for (; c < columns; ++c)
        for (std::size_t r = 0; r < 16; ++r) to[c * stride + r] = from[r][c];
}

void transpose_floats(const float* from, std::size_t from_stride, std::size_t rows, std::size_t columns, float* to,
                      std::size_t to_stride) noexcept {
    constexpr std::size_t edge = 16;  // floats that fill a line of the cache
    // Each line of `to` is written from end to end: `from` lies in a near cache, `to` mostly does not.
    for (std::size_t c0 = 0; c0 < columns; c0 += edge)
        for (std::size_t r0 = 0; r0 < rows; r0 += edge) {
            const std::size_t r1 = std::min(r0 + edge, rows), c1 = std::min(c0 + edge, columns);
            std::size_t r = r0;
            for (; r + 4 <= r1; r += 4) {
                std::size_t c = c0;
                for (; c + 4 <= c1; c += 4) {
                    Floats v[4];
                    for (std::size_t i = 0; i < 4; ++i) v[i] = load<Floats>(from + (r + i) * from_stride + c);
                    for (int round = 0; round < 2; ++round) interleave(v);
                    for (std::size_t i = 0; i < 4; ++i) store(v[i], to + (c + i) * to_stride + r);
                }
                for (; c < c1; ++c)
                    for (std::size_t i = 0; i < 4; ++i) to[c * to_stride + r + i] = from[(r + i) * from_stride + c];
            }
            for (; r < r1; ++r)
                for (std::size_t c = c0; c < c1; ++c) to[c * to_stride + r] = from[r * from_stride + c];
        }
}

}  // namespace wedgescope
