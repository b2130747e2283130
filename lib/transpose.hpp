// Transposition of small pieces of arrays by registers. Leaves it to the caller to cut arrays into pieces that stay in
// the cache.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

namespace wedgescope {

/// to[c * stride + r] = from[r][c] for 16 rows of `columns` bytes.
void transpose_bytes(const std::array<const std::uint8_t*, 16>& from, std::size_t columns, std::uint8_t* to,
                     std::size_t stride) noexcept;

/// to[c * to_stride + r] = from[r * from_stride + c] for rows x columns floats.
void transpose_floats(const float* from, std::size_t from_stride, std::size_t rows, std::size_t columns, float* to,
                      std::size_t to_stride) noexcept;

}  // namespace wedgescope
