// PackBits (TIFF 6.0, section 9): runs of one byte and bytes as they are, a row at a time.
// For the .cpp files of this folder only. Leaves unpacking to libtiff, which packs byte by byte: in twice the time.
#pragma once
#include <cstddef>
#include <cstdint>

namespace wedgescope {

/// Bytes that a row of n may take at the most.
constexpr std::size_t most_packed(std::size_t n) { return n + (n + 127) / 128; }

/// Packs n bytes; returns the end of what was written from `to` on, which has room for most_packed(n).
std::uint8_t* pack_bits(const std::uint8_t* row, std::size_t n, std::uint8_t* to) noexcept;

}  // namespace wedgescope
