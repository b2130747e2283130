// PackedBlock: a rectangle of posts or codes as few bytes that unpack to the same bits.
// Leaves where the bytes are kept, and their checksums, to spill.hpp.
//
// The first byte says how: all posts alike, 8 or 16 bits a post, or as they are. Narrow heights go through the layer's own
// scale, offset and unit, and are kept only where that gives every post back bit for bit; the highest (8 bits) or the
// lowest (16 bits) number stands for a void.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "lib/interval.hpp"

namespace wedgescope {

/// value = (stored * scale + offset) * unit_m, as in RasterFacts.
struct PackScale {
    double scale = 1, offset = 0, unit_m = 1;
    bool plain() const { return scale == 1 && offset == 0 && unit_m == 1; }
};

/// Row after row of `columns` posts, rows `stride` posts apart; NaN = void. Replaces what `out` held.
void pack_heights(const float* posts, std::int64_t stride, std::int64_t columns, std::int64_t rows,
                  const PackScale& scale, std::vector<std::byte>& out);
void pack_codes(const std::int32_t* codes, std::int64_t stride, std::int64_t columns, std::int64_t rows,
                std::vector<std::byte>& out);

/// The part `part` (counted from the block's first post) of a block of columns x rows; rows of `out` lie `stride` apart.
/// False if the bytes are not such a block.
bool unpack_heights(std::span<const std::byte> bytes, std::int64_t columns, std::int64_t rows, const PackScale& scale,
                    const Window& part, float* out, std::int64_t stride);
bool unpack_codes(std::span<const std::byte> bytes, std::int64_t columns, std::int64_t rows, const Window& part,
                  std::int32_t* out, std::int64_t stride);

}  // namespace wedgescope
