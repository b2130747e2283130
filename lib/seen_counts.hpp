// Seen counts: what a raster's observers say of a post, in one number, and adding what one more of them says.
// Leaves where the numbers of a raster lie to tiles/count_store.hpp.
//
// A number is 0 while no observer looks at the post (out of range, sector, pitch), 1 where those that do find no data, and
// 2 + n where n observers see it and no other does. Which of them comes first makes no difference.
#pragma once
#include <cstddef>
#include <cstdint>

#include "lib/coverage.hpp"

namespace wedgescope {

/// What a mask of one observer holds to be added.
inline constexpr MaskValues observer_codes{.seen = 3, .hidden = 2, .no_data = 1, .outside = 0};

/// Observers that 16 bits can count, and that 8 bits can.
inline constexpr std::size_t most_observers = 65533, most_observers_in_byte = 253;

/// A number, read.
struct SeenNumber {
    std::uint16_t number;
    bool outside() const { return number == 0; }
    bool no_data() const { return number == 1; }
    bool looked_at() const { return number >= 2; }
    std::uint16_t observers() const { return looked_at() ? static_cast<std::uint16_t>(number - 2) : std::uint16_t{0}; }
};

/// counts = max(counts, min(codes, 2)) + (codes is 3), for n posts.
void add_observer(const std::uint8_t* codes, std::size_t n, std::uint8_t* counts) noexcept;
void add_observer(const std::uint8_t* codes, std::size_t n, std::uint16_t* counts) noexcept;

}  // namespace wedgescope
