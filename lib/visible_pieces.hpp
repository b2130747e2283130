// Visible pieces: those of a tile's samples that are plain, closed up behind one another until there are enough to fill the
// lanes of what shades and deposits them: of neighbouring spokes some see and some do not, and only some cross a line of the
// other axis. Leaves which pieces these are to sweep.hpp and what becomes of them to front.hpp.
#pragma once
#include <array>
#include <bit>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "lib/culture_lanes.hpp"
#include "lib/deposit.hpp"
#include "lib/lanes.hpp"

namespace wedgescope {

class VisiblePieces {
public:
    static constexpr std::size_t most = WedgeCells::Portions::most;
    static_assert(most == CulturePieces::most, "all of them are deposited in one go");

    /// One number of each piece, of 64 bits; 0 at its start, 1 at its end.
    // clang-format off
    enum Column : std::size_t {
        lane,                                     ///< std::int64_t: its spoke
        origin, share0, share1,                   ///< of that, as WedgeCells::Portions
        horizon, sine, range0, range1,            ///< as Shading
        x0, x1,                                   ///< range coordinate, only where bins are of ground range
        rise, swing,                              ///< as StepLanes
        major0, minor0, major1, minor1,           ///< raster indices, across the lines and along them
        sine0, up0, up1, out0, out1,              ///< as SampleLanes
        height0, height1, arc0, arc1,
        part0, part1,
        behind, ahead,                            ///< as CellLanes: two floats
        columns
    };
    // clang-format on
    /// Where the columns of a tile begin; null: this one is not kept.
    using Tile = std::array<const void*, columns>;

    VisiblePieces();
    std::size_t size() const { return size_; }
    /// The pieces of the tile's n lanes whose code is 1, in order; with those there are, `most` at the most.
    void add(std::size_t n, const double* code, const Tile& tile) noexcept;
    /// Room for one more, behind the others; all its columns that are looked at must be set.
    std::size_t add_one() noexcept {
        assert(size_ < most);
        return size_++;
    }
    void set(Column column, std::size_t i, double number) { columns_[column][i] = number; }
    void set(Column column, std::size_t i, std::int64_t integer) {
        std::memcpy(columns_[column].data() + i, &integer, sizeof integer);
    }
    void set_pair(Column column, std::size_t i, const float* pair) {
        std::memcpy(columns_[column].data() + i, pair, 2 * sizeof *pair);
    }
    void clear() { size_ = 0; }

    double* numbers(Column column) { return columns_[column].data(); }
    /// Of bits that were moved here as they are, never as doubles.
    const std::int64_t* integers(Column column) const {
        return reinterpret_cast<const std::int64_t*>(columns_[column].data());
    }
    std::int64_t integer(Column column, std::size_t i) const {
        return std::bit_cast<std::int64_t>(columns_[column][i]);
    }
    const float* pairs(Column column) const { return reinterpret_cast<const float*>(columns_[column].data()); }

    static constexpr std::size_t bytes() { return columns * length * sizeof(double); }

private:
    static constexpr std::size_t length = whole_registers(most) + lane_step;  ///< lanes are written whole
    std::array<LaneArray, columns> columns_;
    std::size_t size_ = 0;
};

/// Which of n <= 64 lanes have that code, the first in the lowest bit. The codes must go on to whole registers.
std::uint64_t lanes_of_code(double wanted, std::size_t n, const double* code) noexcept;

}  // namespace wedgescope
