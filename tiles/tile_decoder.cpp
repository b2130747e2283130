#include "tiles/tile_decoder.hpp"

#include <zstd.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <memory>
#include <string_view>
#include <type_traits>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

/// What a thread unpacks with.
struct Scratch {
    std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context{ZSTD_createDCtx(), ZSTD_freeDCtx};
    std::vector<char> packed;
};

std::optional<std::uint64_t> number(const char* word) {
    if (!word) return std::nullopt;
    const std::string_view digits(word);
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
    return value;
}

/// Sums of the first 1, 2, ... of eight, by the compiler's vectors of 16 bytes, which every x86-64 has.
using Eight [[gnu::vector_size(16)]] = std::uint16_t;
Eight running_sums(Eight v) {
    const Eight none{};
    v += __builtin_shufflevector(v, none, 8, 0, 1, 2, 3, 4, 5, 6);
    v += __builtin_shufflevector(v, none, 8, 9, 0, 1, 2, 3, 4, 5);
    return v + __builtin_shufflevector(v, none, 8, 9, 10, 11, 0, 1, 2, 3);
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
                v = running_sums(v) + sum;
                std::memcpy(line, &v, sizeof v);
                sum = v[7];
            }
        for (; c < edge; ++c, line += sizeof(T)) {
            T step;
            std::memcpy(&step, line, sizeof step);
            sum = static_cast<T>(sum + step);
            std::memcpy(line, &sum, sizeof sum);
        }
    }
}

/// Rows of differences of bytes, the values' highest bytes first (TIFF technical note 3).
void join_bytes(std::byte* values, std::int64_t edge, std::size_t type_bytes) {
    const auto n = static_cast<std::size_t>(edge);
    std::vector<std::uint8_t> planes(n * type_bytes);
    for (std::int64_t r = 0; r < edge; ++r) {
        std::byte* line = values + static_cast<std::size_t>(r) * planes.size();
        unsigned sum = 0;
        for (std::size_t i = 0; i < planes.size(); ++i) {
            sum += static_cast<unsigned>(line[i]);
            planes[i] = static_cast<std::uint8_t>(sum);
        }
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t b = 0; b < type_bytes; ++b)
                line[i * type_bytes + b] = static_cast<std::byte>(planes[(type_bytes - 1 - b) * n + i]);
    }
}

}  // namespace

std::optional<TileDecoder> TileDecoder::of(const std::string& path, GDALDataset& sheet, std::int64_t edge,
                                           std::size_t type_bytes, bool floating) {
    const char* packing = sheet.GetMetadataItem("COMPRESSION", "IMAGE_STRUCTURE");
    const bool zstd = packing && EQUAL(packing, "ZSTD");
    if (packing && !zstd) return std::nullopt;
    TileDecoder decoder(path, edge, type_bytes);
    decoder.zstd_ = zstd;
    decoder.likely_ = {Predictor::horizontal, Predictor::none};
    if (floating) decoder.likely_.insert(decoder.likely_.begin(), Predictor::floating);
    if (!zstd) decoder.likely_ = {Predictor::none};
    return decoder;
}

bool TileDecoder::unpack(std::uint64_t at, std::size_t count, RawVector<std::byte>& values) const {
    if (!zstd_) {
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

void TileDecoder::undo(Predictor predictor, RawVector<std::byte>& values) const {
    if (predictor == Predictor::floating) join_bytes(values.data(), edge_, type_bytes_);
    if (predictor != Predictor::horizontal) return;
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

bool TileDecoder::decode(GDALRasterBand& band, std::int64_t column, std::int64_t row, RawVector<std::byte>& values,
                         const std::function<bool()>& right) {
    const std::string place = text(column, "_", row);
    const auto at = number(band.GetMetadataItem(("BLOCK_OFFSET_" + place).c_str(), "TIFF")),
               count = number(band.GetMetadataItem(("BLOCK_SIZE_" + place).c_str(), "TIFF"));
    // What packing makes of noise is a little larger than it.
    if (!at || !count || *count == 0 || *count > ZSTD_compressBound(values.size())) return false;
    for (std::size_t i = 0; i < likely_.size(); ++i) {
        if (!unpack(*at, static_cast<std::size_t>(*count), values)) return false;
        undo(likely_[i], values);
        if (!right()) continue;
        std::rotate(likely_.begin(), likely_.begin() + static_cast<std::ptrdiff_t>(i),
                    likely_.begin() + static_cast<std::ptrdiff_t>(i) + 1);
        return true;
    }
    return false;
}

}  // namespace wedgescope
