#include "lib/visible_pieces.hpp"

#ifndef WEDGESCOPE_CLOSE_UP_ORDER
#define WEDGESCOPE_CLOSE_UP_ORDER
namespace wedgescope {
namespace {

/// For each choice of up to four lanes where those that are chosen lie, and then anything.
constexpr std::size_t lanes = 4;
constexpr auto order = [] {
    std::array<std::uint64_t, (std::size_t{1} << lanes) * lanes> table{};
    for (std::size_t chosen = 0; chosen < std::size_t{1} << lanes; ++chosen)
        for (std::size_t lane = 0, at = 0; lane < lanes; ++lane)
            if (chosen >> lane & 1) table[chosen * lanes + at++] = lane;
    return table;
}();

}  // namespace
}  // namespace wedgescope
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lib/visible_pieces.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "lib/highway_copies.hpp"

HWY_BEFORE_NAMESPACE();
namespace wedgescope::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Numbers = hn::CappedTag<double, 8>;
using Bits = hn::RebindToUnsigned<Numbers>;

/// What moves the lanes that a mask holds to the front, found once for all columns. Highway 1.0's own Compress copies a table
/// of 2 KB to the stack at every call, with AVX-512 too.
class CloseUp {
public:
    HWY_ATTR explicit CloseUp(hn::Mask<Numbers> wanted) : wanted_(hn::RebindMask(Bits(), wanted)) {
#if HWY_TARGET > HWY_AVX3
        static_assert(hn::MaxLanes(Numbers()) <= lanes);
        std::uint8_t bits[8] = {};
        hn::StoreMaskBits(Numbers(), wanted, bits);
        order_ = hn::IndicesFromVec(Bits(), hn::LoadU(Bits(), order.data() + lanes * bits[0]));
#endif
    }
    HWY_INLINE hn::Vec<Bits> of(hn::Vec<Bits> numbers) const {
#if HWY_TARGET > HWY_AVX3
        return hn::TableLookupLanes(numbers, order_);
#else
        return {_mm512_maskz_compress_epi64(wanted_.raw, numbers.raw)};
#endif
    }

private:
    hn::Mask<Bits> wanted_;
#if HWY_TARGET > HWY_AVX3
    decltype(hn::IndicesFromVec(Bits(), hn::Zero(Bits()))) order_;
#endif
};

/// To `to` + `at` and on what of the n numbers from `from` on has the code 1; returns where the last of them ends.
HWY_ATTR std::size_t close_up(std::size_t n, const double* code, const std::uint64_t* const* from,
                              std::uint64_t* const* to, std::size_t count, std::size_t at) {
    const Numbers d;
    const Bits bits;
    std::size_t i = 0;
    for (; i + hn::Lanes(d) <= n; i += hn::Lanes(d)) {
        const auto wanted = hn::LoadU(d, code + i) == hn::Set(d, 1);
        const std::size_t found = hn::CountTrue(d, wanted);
        if (found == 0) continue;
        if (found == hn::Lanes(d)) {
            for (std::size_t c = 0; c < count; ++c) hn::StoreU(hn::LoadU(bits, from[c] + i), bits, to[c] + at);
            at += found;
            continue;
        }
        const CloseUp close(wanted);
        for (std::size_t c = 0; c < count; ++c) hn::StoreU(close.of(hn::LoadU(bits, from[c] + i)), bits, to[c] + at);
        at += found;
    }
    for (; i < n; ++i) {
        if (code[i] != 1) continue;
        for (std::size_t c = 0; c < count; ++c) hwy::CopyBytes<sizeof(std::uint64_t)>(from[c] + i, to[c] + at);
        ++at;
    }
    return at;
}

HWY_ATTR std::uint64_t find_code(double wanted, std::size_t n, const double* code) {
    const Numbers d;
    std::uint64_t found = 0;
    for (std::size_t i = 0; i < n; i += hn::Lanes(d)) {
        std::uint8_t bits[8] = {};
        hn::StoreMaskBits(d, hn::LoadU(d, code + i) == hn::Set(d, wanted), bits);
        found |= static_cast<std::uint64_t>(bits[0]) << i;
    }
    return n < 64 ? found & ((std::uint64_t{1} << n) - 1) : found;
}

}  // namespace
}  // namespace wedgescope::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace wedgescope {

constexpr auto close_up_copies = WEDGESCOPE_HIGHWAY_COPIES(close_up);
constexpr auto find_code_copies = WEDGESCOPE_HIGHWAY_COPIES(find_code);

std::uint64_t lanes_of_code(double wanted, std::size_t n, const double* code) noexcept {
    return find_code_copies.in_use()(wanted, n, code);
}

VisiblePieces::VisiblePieces() {
    for (LaneArray& column : columns_) column.resize(length);
}

void VisiblePieces::add(std::size_t n, const double* code, const Tile& tile) noexcept {
    const std::uint64_t* from[columns];
    std::uint64_t* to[columns];
    std::size_t count = 0;
    for (std::size_t c = 0; c < columns; ++c) {
        if (!tile[c]) continue;
        from[count] = static_cast<const std::uint64_t*>(tile[c]);
        to[count++] = reinterpret_cast<std::uint64_t*>(columns_[c].data());
    }
    size_ = close_up_copies.in_use()(n, code, from, to, count, size_);
}

}  // namespace wedgescope
#endif
