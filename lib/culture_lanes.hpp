// Culture under the pieces of neighbouring spokes: which cells of a culture tile each piece runs through, and where it
// passes from one to the next. Leaves reading to culture.hpp and what a class returns to front.hpp.
#pragma once
#include <cstddef>
#include <cstdint>

#include "lib/interval.hpp"

namespace wedgescope {

/// What the pieces between two lines share.
struct CultureScene {
    bool lines_are_columns = false;
    double behind_major = 0, ahead_major = 0;  ///< raster index of the two lines; only where there are culture heights
    double column_offset = 0, column_scale = 1;  ///< culture column = offset + scale * column of the raster
    double row_offset = 0, row_scale = 1;
    Window tile;  ///< of culture cells
};

/// Pieces as Front has them, and the culture cells found. Of up to `most` lanes; read in whole registers.
struct CulturePieces {
    static constexpr std::size_t most = 128;
    const double *major0, *minor0, *major1, *minor1;  ///< in: raster indices, across the lines and along them
    /// In, or null where there are no culture heights: the raster index along the lines of each piece's cell, and the
    /// heights on its corners [2 n] as CellLanes has them.
    const double* cell = nullptr;
    const float *behind_m = nullptr, *ahead_m = nullptr;
};
struct CultureParts {
    static constexpr std::size_t most = CulturePieces::most;
    /// What a piece is.
    enum Kind : std::int32_t {
        parts,      ///< `first` up to share `to_second`, `second` up to share `to_third`, then `third`
        wall,       ///< culture stands on a corner of its cell: all of the culture cell `first`
        many,       ///< more than two culture cells along one axis
        elsewhere,  ///< not all of it in the tile
    };
    std::int32_t kind[most];
    std::int32_t first[most], second[most], third[most];  ///< culture cells, counted from the tile's first one
    float to_second[most], to_third[most];                ///< 0..1, ascending
};

/// The culture cells of n pieces, n <= CulturePieces::most. The wall's cell is that of the corner with the highest
/// culture, of equal ones the first in raster order. False: there are but parts and walls.
bool culture_lanes(std::size_t n, const CultureScene& scene, const CulturePieces& pieces, CultureParts& out) noexcept;

}  // namespace wedgescope
