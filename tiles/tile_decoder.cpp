#include "tiles/tile_decoder.hpp"

#include <tiff.h>
#include <zstd.h>

#include <cstring>
#include <memory>
#include <type_traits>

#include "lib/error.hpp"
#include "lib/lanes.hpp"

namespace wedgescope {
namespace {

/// What a thread unpacks with.
struct Scratch {
    std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context{ZSTD_createDCtx(), ZSTD_freeDCtx};
    std::vector<char> packed;
};

/// Sums of the first 1, 2, ... of eight, by the compiler's vectors of 16 bytes, which every x86-64 has.
using Eight [[gnu::vector_size(16)]] = std::uint16_t;
Eight running_sums(Eight v) {
    const Eight none{};
    v += __builtin_shufflevector(v, none, 8, 0, 1, 2, 3, 4, 5, 6);
    v += __builtin_shufflevector(v, none, 8, 9, 0, 1, 2, 3, 4, 5);
    return v + __builtin_shufflevector(v, none, 8, 9, 10, 11, 0, 1, 2, 3);
}

/// The same of sixteen bytes.
using Sixteen [[gnu::vector_size(16)]] = std::uint8_t;
WEDGESCOPE_LANES_PART Sixteen running_sums(Sixteen v) noexcept {
    const Sixteen none{};
    v += __builtin_shufflevector(v, none, 16, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14);
    v += __builtin_shufflevector(v, none, 16, 17, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13);
    v += __builtin_shufflevector(v, none, 16, 17, 18, 19, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11);
    return v + __builtin_shufflevector(v, none, 16, 17, 18, 19, 20, 21, 22, 23, 0, 1, 2, 3, 4, 5, 6, 7);
}

WEDGESCOPE_LANES_PART Sixteen load(const std::uint8_t* bytes) noexcept {
    Sixteen v;
    std::memcpy(&v, bytes, sizeof v);
    return v;
}

/// x[i] += x[i - 1], row by row.
template <class T>
void add_up(std::byte* values, std::int64_t edge) {
    for (std::int64_t r = 0; r < edge; ++r) {
        std::byte* line = values + static_cast<std::size_t>(r * edge) * sizeof(T);
        T sum = 0;
        std::int64_t c = 0;
        if constexpr (std::is_same_v<T, std::uint16_t>)
            for (; c + 8 <= edge; c += 8, line += sizeof(Eight)) {
                Eight v;
                std::memcpy(&v, line, sizeof v);
                const Eight own = running_sums(v), all = own + sum;
                std::memcpy(line, &all, sizeof all);
                sum = static_cast<T>(sum + own[7]);  // not all[7]: so no step waits for the one before
            }
        for (; c < edge; ++c, line += sizeof(T)) {
            T step;
            std::memcpy(&step, line, sizeof step);
            sum = static_cast<T>(sum + step);
            std::memcpy(line, &sum, sizeof sum);
        }
    }
}

/// Sums of the first 1, 2, ... of `n` bytes, in place.
WEDGESCOPE_LANES_PART void add_up_bytes(std::uint8_t* bytes, std::size_t n) noexcept {
    std::uint8_t sum = 0;
    std::size_t i = 0;
    for (; i + sizeof(Sixteen) <= n; i += sizeof(Sixteen)) {
        const Sixteen own = running_sums(load(bytes + i)), all = own + sum;
        std::memcpy(bytes + i, &all, sizeof all);
        sum = static_cast<std::uint8_t>(sum + own[15]);  // as above
    }
    for (; i < n; ++i) bytes[i] = sum = static_cast<std::uint8_t>(sum + bytes[i]);
}

/// Each of a's followed by that of b: the first half and the second.
template <int half>
WEDGESCOPE_LANES_PART Sixteen in_turns(Sixteen a, Sixteen b) noexcept {
    constexpr int h = 8 * half;
    return __builtin_shufflevector(a, b, h, h + 16, h + 1, h + 17, h + 2, h + 18, h + 3, h + 19, h + 4, h + 20, h + 5,
                                   h + 21, h + 6, h + 22, h + 7, h + 23);
}

/// Four planes of n bytes, the highest first, into values of four bytes; returns how many of each were taken.
WEDGESCOPE_LANES_PART std::size_t join_fours(const std::uint8_t* planes, std::size_t n, std::byte* values) noexcept {
    std::size_t i = 0;
    for (; i + sizeof(Sixteen) <= n; i += sizeof(Sixteen)) {
        const Sixteen b3 = load(planes + i), b2 = load(planes + n + i), b1 = load(planes + 2 * n + i),
                      b0 = load(planes + 3 * n + i);
        // Pairs of pairs: 0 2 0 2 ... with 1 3 1 3 ... gives 0 1 2 3.
        const Sixteen even[2] = {in_turns<0>(b0, b2), in_turns<1>(b0, b2)},
                      odd[2] = {in_turns<0>(b1, b3), in_turns<1>(b1, b3)};
        const Sixteen joined[4] = {in_turns<0>(even[0], odd[0]), in_turns<1>(even[0], odd[0]),
                                   in_turns<0>(even[1], odd[1]), in_turns<1>(even[1], odd[1])};
        std::memcpy(values + 4 * i, joined, sizeof joined);
    }
    return i;
}

/// Rows of `n` values as differences of bytes, the values' highest bytes first (TIFF technical note 3). `planes`: room for
/// a row.
WEDGESCOPE_LANES_PART void join_bytes(std::byte* line, std::size_t rows, std::size_t n, std::size_t type_bytes,
                                      std::uint8_t* planes) noexcept {
    const std::size_t row_bytes = n * type_bytes;
    for (std::size_t r = 0; r < rows; ++r, line += row_bytes) {
        std::memcpy(planes, line, row_bytes);
        add_up_bytes(planes, row_bytes);
        for (std::size_t i = type_bytes == 4 ? join_fours(planes, n, line) : 0; i < n; ++i)
            for (std::size_t b = 0; b < type_bytes; ++b)
                line[i * type_bytes + b] = static_cast<std::byte>(planes[(type_bytes - 1 - b) * n + i]);
    }
}

}  // namespace

std::optional<TileDecoder> TileDecoder::of(const std::string& path, TiffIndex sheet, std::size_t type_bytes) {
    if (sheet.levels.empty()) return std::nullopt;
    const std::uint32_t edge = sheet.levels[0].tile_columns;
    for (const TiffIndex::Level& level : sheet.levels) {
        const bool packed = level.compression == COMPRESSION_ZSTD;
        if (level.bands != 1 || level.bits != 8 * type_bytes || level.tile_columns != edge || level.tile_rows != edge ||
            (!packed && level.compression != COMPRESSION_NONE))
            return std::nullopt;
    }
    return TileDecoder(path, std::move(sheet), type_bytes);
}

bool TileDecoder::unpack(bool zstd, std::uint64_t at, std::size_t count, RawVector<std::byte>& values) const {
    if (!zstd) {
        if (count != values.size()) return false;
        file_->read(at, values.data(), count);
        return true;
    }
    thread_local Scratch scratch;
    scratch.packed.resize(count);
    file_->read(at, scratch.packed.data(), count);
    return ZSTD_decompressDCtx(scratch.context.get(), values.data(), values.size(), scratch.packed.data(), count) ==
           values.size();
}

void TileDecoder::undo(std::uint16_t predictor, RawVector<std::byte>& values) const {
    if (predictor == PREDICTOR_FLOATINGPOINT) {
        const auto edge = static_cast<std::size_t>(edge_);
        std::vector<std::uint8_t> planes(edge * type_bytes_);
        on_target<join_bytes>(values.data(), edge, edge, type_bytes_, planes.data());
    }
    if (predictor != PREDICTOR_HORIZONTAL) return;
    switch (type_bytes_) {
        case 1:
            return add_up<std::uint8_t>(values.data(), edge_);
        case 2:
            return add_up<std::uint16_t>(values.data(), edge_);
        case 4:
            return add_up<std::uint32_t>(values.data(), edge_);
        default:
            return add_up<std::uint64_t>(values.data(), edge_);
    }
}

bool TileDecoder::decode(int level, std::int64_t column, std::int64_t row, RawVector<std::byte>& values,
                         const std::function<bool()>& right) const {
    if (level >= static_cast<int>(sheet_.levels.size())) return false;
    const TiffIndex::Level& own = sheet_.levels[static_cast<std::size_t>(level)];
    const std::int64_t across = (own.columns + edge_ - 1) / edge_;
    const auto tile = static_cast<std::size_t>(row * across + column);
    if (tile >= own.offsets.size()) return false;
    // What packing makes of noise is a little larger than it.
    const std::uint64_t at = own.offsets[tile], count = own.byte_counts[tile];
    if (at == 0 || count == 0 || count > ZSTD_compressBound(values.size())) return false;
    if (!unpack(own.compression == COMPRESSION_ZSTD, at, static_cast<std::size_t>(count), values)) return false;
    undo(own.predictor, values);
    return right();
}

}  // namespace wedgescope
