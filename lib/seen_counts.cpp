#include "lib/seen_counts.hpp"

#include "lib/lanes.hpp"

namespace wedgescope {
namespace {

template <class Count>
WEDGESCOPE_LANES_PART void add(const std::uint8_t* codes, std::size_t n, Count* counts) noexcept {
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const Count code = codes[i], kind = code < 2 ? code : Count{2}, was = counts[i];
        const Count one = code == 3 ? Count{1} : Count{0};
        counts[i] = static_cast<Count>((was < kind ? kind : was) + one);
    }
}

}  // namespace

void add_observer(const std::uint8_t* codes, std::size_t n, std::uint8_t* counts) noexcept {
    on_target<add<std::uint8_t>>(codes, n, counts);
}

void add_observer(const std::uint8_t* codes, std::size_t n, std::uint16_t* counts) noexcept {
    on_target<add<std::uint16_t>>(codes, n, counts);
}

}  // namespace wedgescope
