// SpokeGrid: which spokes there are: quadrants, lines, rings, azimuths; and a wedge as runs of spokes.
// A property of the scene, never of the split into wedges. Leaves positions to spoke_map.hpp and state to front.hpp.
//
// Spoke k of a quadrant (-K <= k <= K) has slope k/K; K is a power of two that doubles from one ring to the next, where
// the spokes' spacing on a line `lead` times as far off (the last one at most) would exceed 1/o posts. Its cell is the azimuths between slopes (k-1/2)/K and
// (k+1/2)/K, cut at +-1: a spoke on a common diagonal is swept by both quadrants and each deposits its own half.
#pragma once
#include <cstdint>
#include <vector>

#include "lib/interval.hpp"
#include "lib/polar.hpp"
#include "lib/scene.hpp"
#include "lib/spoke_map.hpp"

namespace wedgescope {

/// What a quality means for the sweep.
struct Sampling {
    double spokes_per_post = 1;  ///< o: at least so many spokes a post on every line
    /// How many times a line's distance spokes are dense enough for. A spoke that a doubling puts between two starts from
    /// the mean of their horizons, which is wrong until ground of its own hides more: so the sooner the better.
    double lead = 1;
    bool cross_lines = true;  ///< sampled where spokes cross the other axis' lines too
    bool exact_course =
        false;  ///< the bilinear surface's course between two samples, not a straight line, decides what is seen
};
/// `culture_height`: single posts may stand up from the ground (trees, buildings), and spokes must meet each of them.
/// `above_posts`: the sensor's height over the ground below it, in posts. The lower it is, the longer are the shadows that
/// a post beside the spokes throws: below 14 posts (20 with culture heights) spokes double with each halving of the
/// height, to 16 times at most. Source: docs/accuracy.md.
Sampling sampling(Quality quality, bool culture_height, double above_posts);
/// `of_quality` with what the scene itself says.
Sampling own_sampling(const Scene& scene, Sampling of_quality);
inline Sampling sampling(const Scene& scene, bool culture_height, double above_posts) {
    return own_sampling(scene, sampling(scene.quality, culture_height, above_posts));
}

/// Lines of a quadrant between two doublings of the number of spokes.
struct Ring {
    std::int64_t spokes = 0;  ///< K, of an octant
    Interval lines;           ///< line numbers, 0 = nearest
};

/// A run of spokes of one quadrant with the azimuth bins it deposits into.
struct SpokeRun {
    Quadrant quadrant = Quadrant::east;
    Interval bins;               ///< counted in the quadrant's own unwrapped azimuth; bin b starts at b times the step
    std::int64_t first_row = 0;  ///< row of the wedge's cells for bins.begin
    std::vector<Interval> spokes;    ///< for each ring of the quadrant: all that must be swept
    std::vector<Interval> touching;  ///< for each ring: those whose cell overlaps the bins
};

/// A run of neighbouring azimuth bins: the unit of work.
struct Wedge {
    std::int64_t index = 0;
    Interval bins;  ///< of the circle, unwrapped as in PolarGrid
    std::vector<SpokeRun> runs;
};

class SpokeGrid {
public:
    SpokeGrid(const DataBase& data_base, const SpokeMap& map, const Sampling& sampling, std::int64_t circle_bins);

    const SpokeMap& map() const { return map_; }
    double azimuth_step_rad() const { return azimuth_step_; }

    std::int64_t line_count(Quadrant q) const { return of(q).line_count; }
    /// Raster column or row of a line.
    std::int64_t line_index(Quadrant q, std::int64_t line) const { return of(q).first_line + outward(q) * line; }
    /// From the nadir to a line, posts; above 0.
    double distance(Quadrant q, std::int64_t line) const;
    /// At least one ring, also where a quadrant has no line.
    const std::vector<Ring>& rings(Quadrant q) const { return of(q).rings; }

    /// Part of the azimuth bins that a spoke's cell covers.
    struct Share {
        std::int64_t bin = 0;        ///< the first one, in the quadrant's unwrapped count
        double radians[2] = {0, 0};  ///< of this bin and the next; rounded, independent of any split
    };
    Share share(Quadrant q, std::int64_t spokes, std::int64_t k) const;

    Wedge wedge(std::int64_t index, Interval bins) const;

    /// Lines from `line` on up to the far border of its strip of cells: borders stand at multiples of `strip` posts.
    Interval strip_lines(Quadrant q, std::int64_t line, std::int64_t strip) const;
    /// The posts that spokes first_k..last_k of K need from the line behind lines.begin (if there is one) to the last of
    /// `lines`, with those that a doubling brings between them; empty if none meets the raster there.
    Window window(Quadrant q, std::int64_t spokes, Interval run, Interval lines) const;

private:
    struct QuadrantLines {
        std::int64_t first_line = 0, line_count = 0;
        std::vector<Ring> rings;
        bool clockwise = true;  // azimuth grows with slope
    };
    const QuadrantLines& of(Quadrant q) const { return quadrants_[static_cast<std::size_t>(q)]; }
    /// Azimuth of slope half_index / (2 K).
    double edge_azimuth(Quadrant q, std::int64_t spokes, std::int64_t half_index) const;
    Interval touching_spokes(Quadrant q, std::int64_t spokes, double azimuth_lo, double azimuth_hi) const;

    const DataBase& data_base_;
    const SpokeMap& map_;
    std::int64_t circle_bins_;
    double azimuth_step_;
    std::array<QuadrantLines, 4> quadrants_;
};

}  // namespace wedgescope
