// Where rasters that become one lie on its grid: along its columns and rows, round the earth, side by side.
// For the .cpp files of this folder only. Leaves what they hold to mosaic.hpp.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "lib/interval.hpp"

namespace wedgescope {

inline constexpr double on_a_post = 0.01;  ///< posts nearer than this are the same

inline bool near(double a, double b, double tolerance) { return std::fabs(a - b) <= tolerance; }

/// Posts of the grid up to `beyond` of a raster's own posts beyond its outermost; own post = own0 + own_step * grid post.
Interval grid_posts(double own0, double own_step, std::int64_t posts, double beyond = 0);

/// A raster's posts along one axis of the grid: own post = own + step * grid post.
struct AlongGrid {
    double own, step;
    bool on_posts;   ///< each stands on a post of the grid, and the other way round
    Interval posts;  ///< of the grid
};

/// `grid0`: of the grid's first post; `own_corner`: of the raster's first cell.
AlongGrid along_grid(double grid0, double grid_step, double own_corner, double own_step, std::int64_t posts);

/// First posts of cells that may reach round the earth: moved by whole circles so that they lie side by side.
std::vector<double> unrolled(const std::vector<double>& west, const std::vector<double>& width);

/// Of rasters that reach round a circle of `circle` degrees: the one at whose western edge it begins, one that goes round
/// alone or else that which lies furthest west. None: they do not.
std::optional<std::size_t> seam_of(const std::vector<double>& west, const std::vector<double>& width, double circle);

/// Which rasters lie side by side, and what gaps they leave.
class Neighbours {
public:
    /// Of a raster along columns or rows, in posts of the grid: outermost posts and its own posting.
    struct Side {
        double first, last, posting;
        double beyond = 0.5;  ///< of its own posts: none where it meets another's outermost posts
        double begin() const { return first - beyond * posting; }
        double end() const { return last + beyond * posting; }
    };
    using Place = std::array<Side, 2>;  ///< along columns, along rows
    static Side side(double own, double step, std::int64_t posts);

    explicit Neighbours(std::vector<Place> places);
    const Place& operator[](std::size_t raster) const { return places_[raster]; }
    double coarsest(std::size_t axis) const { return coarsest_[axis]; }  ///< posting

    struct Gaps {
        std::size_t count = 0, before = 0, behind = 0;  ///< `before` and behind the first: rasters
    };
    /// Those narrower than two posts of a grid of so many columns.
    Gaps gaps(std::int64_t columns) const;

private:
    /// Calls found(axis, a, b) for each raster with those that begin at most `apart` beyond its last post, side by side with it.
    template <class Found>
    void each_pair(const std::array<double, 2>& apart, const Found& found) const;

    std::vector<Place> places_;
    std::array<double, 2> coarsest_{};
};

}  // namespace wedgescope
