// Detail: which posts of a fine data base a scene needs: levels of detail by place, and the error they are allowed.
// Leaves bands and fans to spoke_grid.hpp, and reading posts of a level to the wedge source.
//
// Level L keeps every 2^L-th post, as it is: no mean, so ridges neither sink nor rise by more than the posts between them
// say. How far these lie off the bilinear surface of the kept ones, block by block, is what the data base knows beforehand
// (DetailMap), so the choice needs no post.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lib/engine.hpp"
#include "lib/interval.hpp"
#include "lib/spoke_grid.hpp"

namespace wedgescope {

/// Posts of a block of the detail map, a side; blocks are aligned to the raster.
inline constexpr std::int64_t detail_posts = 128;

/// How far the posts of a block lie off the bilinear surface of level L, L = 1 .. DetailLevels::most, metres of the bare
/// terrain: over whole cells of the level that begin in the block and have four posts. 0 where there is none, and where one
/// of the block's posts is void: there no level is used.
struct Residuals {
    std::array<float, DetailLevels::most> rms_m{};   ///< [L - 1]
    std::array<float, DetailLevels::most> peak_m{};  ///< [L - 1], either way
    /// [L - 1], cube root of the mean cube of their sizes: 1.17 times the RMS where they are as of chance, more where a
    /// few stand out of what is smooth (a dike, a wall, a needle).
    std::array<float, DetailLevels::most> cube_m{};
    friend bool operator==(const Residuals&, const Residuals&) = default;
};

/// Of one block: `posts` row after row (`stride` apart), `columns` x `rows` of them from the block's first post on, at the
/// most detail_posts + 1 a side; NaN: void.
Residuals residuals(const float* posts, std::int64_t stride, std::int64_t columns, std::int64_t rows);

class DetailMap {
public:
    virtual ~DetailMap() = default;
    /// Row after row; `blocks` inside the raster's. From several threads at once. IoError, DataError.
    virtual std::vector<Residuals> read(const Window& blocks) = 0;
    /// Bounds of the whole raster, whatever of it a source holds.
    virtual BlockMap& bounds() = 0;
};

/// RMS, in dB, that a quality leaves to levels of detail, of its whole promise; 0: none are used.
double detail_rms_db(Quality quality);

/// What the error of a level is made of (docs/engine.md, "Level of detail").
struct DetailPlace {
    double range_m = 0;      ///< to the middle of the place
    double grazing_rad = 0;  ///< of level ground there
    double pulse_m = 0;      ///< c tau / 2, or the range bin if the pulse is not spread
    double beam_m = 0;       ///< width of what is gathered in azimuth, there
    double along_m = 0;      ///< between posts of the raster, in range
    double across_m = 0;     ///< and across it
    double steepness = 0;    ///< RMS of blocks' relief over their width
    double over_noise = 0;   ///< power of what returns most there over the noise's
};
/// RMS error of the power image in dB, over cells above the noise and with it, that posts off by `rms_m` from the surface of level
/// L make, and of those that stand out the mean cube `excess_m3` of their sizes; infinite where the level is coarser than half the
/// pulse or half the beam.
double detail_error_db(const DetailPlace& place, int level, double rms_m, double excess_m3);

/// Of a block: the mean cube of what stands out of residuals as chance makes them, cubic metres.
double excess_m3(const Residuals& residuals, int level);

/// True if choose_levels() may find a level above 0 with some ground: the pulse and, at the end of the range, the beam
/// hold four posts or more, and quality and key `detail` allow levels.
bool detail_possible(const ResolvedScene& scene, const DataBase& data_base);

/// Least side of a post in range, metres, as detail_possible() takes it; infinite where there is no level whatever beam and
/// pulse are.
double detail_post_m(const ResolvedScene& scene, const DataBase& data_base);

/// Whether what was swept for `before` (at its levels of detail if `levels`, over posts of detail_post_m() `post_m`) is what
/// would be swept for `after`, a scene that differs in beam and pulse alone. Never true where it is not; where only a sweep
/// could tell, false.
bool same_levels(const ResolvedScene& before, bool levels, double post_m, const ResolvedScene& after);

/// Posts whose blocks choose_levels() may ask the maps for.
Window detail_window(const ResolvedScene& scene, const DataBase& data_base);

/// The levels of a scene: a function of its place, range, set and quality, of what block map and detail map hold of
/// the ground in range, and of BrightEcho; of no horizon, wedge, sector or budget. None where the source has no such maps,
/// the raster goes round the earth, or the scene's quality or key `detail` has none. IoError, DataError.
DetailLevels choose_levels(const ResolvedScene& scene, WedgeSource& source, const SpokeMap& map);

}  // namespace wedgescope
