// SpokeMap: where a spoke crosses a line, in posts, and how far along it that is, in metres.
// Leaves which spokes there are to spoke_grid.hpp.
//
// A spoke leaves the nadir with slope m in index space (minor over major axis, |m| <= 1, in one of four quadrants).
// On the plane of grid geometry it stays straight:
//     minor = nadir + m d        arc = d f(m)        f(m) = |metres per post of (1, m)|
// In geodesic geometry it is the WGS84 geodesic whose initial direction has that slope, and
//     minor = nadir + m d + bend(m, d)        arc = d f(m) (1 + stretch(m, d))
// with bend and stretch small and smooth: tensor polynomials of degree 4 on pieces of (m, d) that are cut by the scene
// alone. Nodes come from GeographicLib and the raster's CRS; pieces are halved until points between the nodes agree
// within `tolerance_posts`.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lib/quartic.hpp"
#include "lib/scene.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

/// The index-space quarters round the sensor, by their major axis: column up, column down, row up, row down.
enum class Quadrant : int { east = 0, west = 1, south = 2, north = 3 };
inline constexpr std::array<Quadrant, 4> all_quadrants = {Quadrant::east, Quadrant::west, Quadrant::south,
                                                          Quadrant::north};
/// East and west: the spokes cross columns of posts.
constexpr bool lines_are_columns(Quadrant q) { return q == Quadrant::east || q == Quadrant::west; }
/// +1 where raster indices of the lines grow outwards.
constexpr int outward(Quadrant q) { return q == Quadrant::east || q == Quadrant::south ? 1 : -1; }

/// What a range is to be longer by for rounding and the last posts: two of their diagonals.
inline double arc_margin_m(const DataBase& db) { return 2 * (std::hypot(db.step_x, db.step_y) * db.metres_a_unit()); }

struct SpokeMapParams {
    Geometry geometry = Geometry::grid;
    IndexPosition nadir;
    double lat_deg = 0, lon_deg = 0;  ///< geodesic only
    std::optional<double> earth_k;    ///< none: flat
    double max_arc_m = 0;             ///< no spoke is followed farther
    double margin_m = 0;              ///< of that, what was added to the range
    double beyond_m = 0;              ///< but for so much, up to the end of the last range bin: SpokeGrid::max_arc_m()
    std::optional<double> range_m{};  ///< for messages; none: all of the raster
};

class SpokeMap {
public:
    static constexpr double tolerance_posts = 0.02;
    static constexpr double laid_out = 1.1;  ///< of max_arc_m: so far it is known where rays go, if not that they can

    /// DataError where the grid bends too much within range for spokes that cross line after line.
    SpokeMap(const DataBase& data_base, const SpokeMapParams& params);

    const SpokeMapParams& params() const { return params_; }
    bool straight() const { return params_.geometry == Geometry::grid; }
    double nadir_major(Quadrant q) const { return lines_are_columns(q) ? params_.nadir.column : params_.nadir.row; }
    double nadir_minor(Quadrant q) const { return lines_are_columns(q) ? params_.nadir.row : params_.nadir.column; }

    /// f(m), metres; the root of a quadratic, so the same bits everywhere.
    double metres_per_post(Quadrant q, double slope) const;
    /// Azimuth of the spoke at the sensor, clockwise from north of the geometry; continuous over the quadrant (it may
    /// leave -pi..pi), rounded.
    double azimuth_rad(Quadrant q, double slope) const;
    /// Of the effective earth in the spoke's direction; 0 where flat. Rounded.
    double inverse_radius(Quadrant q, double slope) const;
    /// Most azimuth, radians, that one unit of slope spans anywhere in the quadrant.
    double azimuth_per_slope(Quadrant q) const;

    /// bend and stretch on one line for slopes from `slope_begin` to `slope_end` = begin + width:
    /// sum c[n] u^n, u = (m - middle) scale.
    struct LinePiece {
        double slope_begin, slope_end;
        double middle, scale;
        Quartic bend, stretch;
        bool straight() const { return bend == Quartic{} && stretch == Quartic{}; }
    };
    /// Pieces, in order of slope, that together hold [slope_lo, slope_hi]. Straight: one piece of zeros.
    void line(Quadrant q, double distance, double slope_lo, double slope_hi, std::vector<LinePiece>& pieces) const;
    /// The one that a slope lies on.
    LinePiece line_piece(Quadrant q, double distance, double slope) const {
        return straight() ? whole_line : piece(q, piece_of(q, slope), distance);
    }

    /// |bend| is at most this within the quadrant.
    double most_bend(Quadrant q) const { return fits_[static_cast<std::size_t>(q)].most_bend; }
    /// Between two places `length` posts of major axis apart a spoke leaves the straight way by at most so many posts; all of
    /// them `post` posts of the raster wide.
    double sag(Quadrant q, double length, double post = 1) const {
        const double all = length * post;
        return straight() ? 0
                          : (fits_[static_cast<std::size_t>(q)].most_curve * all * all / 8 + tolerance_posts) / post;
    }
    /// By how many posts, the longer way, a place in range is off that is found between two on its line, `length` posts apart,
    /// as if spokes stood evenly between them: the most of samples, from a post on. 0 where spokes are straight.
    double unevenness(double length) const;
    /// Spokes stand at most this times d / K apart on a line.
    double spacing_slack() const { return spacing_slack_; }

    struct Place {
        double minor, arc_m;
    };
    /// One spoke on one line: the kernels' formula, for plans and doublings.
    Place place(Quadrant q, double slope, double distance) const;

private:
    int piece_of(Quadrant q, double slope) const;
    static constexpr LinePiece whole_line{-2, 2, 0, 1, {}, {}};
    LinePiece piece(Quadrant q, int i, double distance) const;

    using Patch = std::array<std::array<double, 5>, 5>;  // [power of m][power of d]
    struct Fit {
        double reach = 0;  // posts: pieces hold 0..reach
        int slope_pieces = 1, distance_pieces = 1;
        std::vector<Patch> bend, stretch;      // [slope piece * distance_pieces + distance piece]
        double most_bend = 0, most_curve = 0;  // posts; posts a post squared
    };

    struct TooBent {};
    explicit SpokeMap(const SpokeMapParams& params) : params_(params) {}  // empty
    /// TooBent; DataError where places are none.
    void lay_out(const DataBase& data_base);
    static std::string refusal(const DataBase& data_base, const SpokeMapParams& params);
    /// TooBent.
    void fit(const DataBase& data_base, Quadrant q);
    /// Second derivative, by the place on a line, of where spokes of evenly spaced slopes cross it and of how far off that is: posts
    /// (the longer way) a post squared; +inf where spokes turn round.
    double warp(Quadrant q, double slope, double distance) const;

    SpokeMapParams params_;
    // Metres east and north of one post along a column and along a row, at the sensor.
    double east_per_column_ = 0, north_per_column_ = 0, east_per_row_ = 0, north_per_row_ = 0;
    std::array<Fit, 4> fits_;
    double spacing_slack_ = 1;
};

}  // namespace wedgescope
