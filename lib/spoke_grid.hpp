// SpokeGrid: which spokes there are: quadrants, fans, lines, bands, rings, azimuths; and a wedge as runs of spokes.
// A property of the scene, never of the split into wedges. Leaves positions to spoke_map.hpp and state to front.hpp.
//
// Spoke k of a quadrant (-K <= k <= K) has slope k/K (rounded: slope()); K is at first enough for every azimuth bin, and
// doubles from one ring to the next where the spokes' spacing on a line `lead` times as far off (the last one at most)
// would exceed 1/o posts. It begins with a multiple of `spoke_step`: what the first line needs, or what in the end gives
// the last line no more than that needs. Its cell is the azimuths between slopes (k-1/2)/K and (k+1/2)/K, cut at +-1: a spoke on a common
// diagonal is swept by both quadrants and each deposits its own half.
//
// Where levels of detail are on, a quadrant's slopes are cut into fans of equal width. A fan has its own lines and rings:
// its lines come in bands, outwards, each with a level L: lines and posts along them stand 2^L posts apart, at whole
// multiples of 2^L. A spoke on the common border of two fans is swept by both, as on a diagonal. Without levels a
// quadrant is one fan of one band.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lib/interval.hpp"
#include "lib/polar.hpp"
#include "lib/rounding.hpp"
#include "lib/scene.hpp"
#include "lib/spoke_map.hpp"

namespace wedgescope {

/// What may change from post to post: the ground alone, classes of culture that lie on it, or culture that stands up from it
/// (trees, buildings).
enum class GroundCover { bare, classes, heights };

/// What a quality means for the sweep.
struct Sampling {
    double spokes_per_post = 1;  ///< o: at least so many spokes a post on every line, but for above_posts
    double spokes_per_bin = 2;   ///< and so many an azimuth bin; 2 or more
    double above_posts = 0;      ///< the sensor's height over the ground, in posts, as sampling_of() has it
    /// What single spokes miss averages out where bins are wide, and counts little beside noise: from 40 posts of height on
    /// spokes grow with the lines up to where a bin holds 8 posts, and from there on only to these shares of
    /// spokes_per_post, where even what shines stays below 50, 15, 5 and half of the noise that a usual receiver has; but to three spokes in ten
    /// posts, for what is in shadow is told apart below the noise too.
    static constexpr std::array<double, 4> quiet_above{50, 15, 5, 0.5},
        quiet_shares{1.0 / 2, 1.0 / 3, 1.0 / 4, 1.0 / 6};
    static constexpr double thin_from_posts = 8, least_per_post = 0.3;
    std::array<double, 4> quiet_posts{infinite, infinite, infinite, infinite};  ///< beyond these distances, in posts
    /// How many times a line's distance spokes are dense enough for. A spoke that a doubling puts between two starts from
    /// the mean of their horizons, which is wrong until ground of its own hides more.
    double lead = 1;
    bool cross_lines = true;  ///< sampled where spokes cross the other axis' lines too
    bool exact_course =
        true;  ///< the bilinear surface's course between two samples, not a straight line, decides what is seen
};
/// Of culture heights single cells stand up, and one that looks out of a shadow may be all that is seen there: a bin
/// takes two to four times the spokes. Between classes the echo leaps.
/// `above_posts`: the sensor's height over the ground, in posts. The lower it is, the longer are the shadows
/// of single posts, and their edges must be met: from 14 posts on (20 with culture heights) half as many spokes a bin do,
/// from 40 on a quarter, over bare ground three eighths, but never fewer than 3; and below 4 posts (5 with culture heights) they double with each
/// halving of the height, to 16 times or 192 at most. Source: docs/accuracy.md.
Sampling sampling(Quality quality, GroundCover cover, double above_posts);
/// `of_quality` with what the scene itself says, but of its bins, which are an image's.
Sampling own_sampling(const Scene& scene, const Sampling& of_quality);
/// Of an image.
Sampling sampling(const Scene& scene, GroundCover cover, double above_posts);

/// The spokes of a quadrant between two slopes: the whole quadrant where there are no levels of detail.
struct Fan {
    Quadrant quadrant = Quadrant::east;
    int index = 0;  ///< from slope -1 on
    // NOLINTNEXTLINE(google-explicit-constructor): a quadrant without levels of detail is its one fan
    constexpr Fan(Quadrant q, int i = 0) : quadrant(q), index(i) {}
};

/// Levels of detail of a scene; none: every post.
struct DetailLevels {
    static constexpr int most = 5;  ///< no level is coarser: 2^5 posts
    /// From the line at raster column or row `border` (a multiple of 2^most) outwards, up to the next step.
    struct Step {
        std::int64_t border = 0;
        int level = 0;
        friend bool operator==(const Step&, const Step&) = default;
    };
    int fans = 1;                          ///< of each quadrant; a power of two up to 16
    std::vector<std::vector<Step>> steps;  ///< [quadrant * fans + fan], outwards; up to the first one: level 0
    bool any() const { return !steps.empty(); }
    int coarsest() const;
};

/// Posts of a side of `posts` that level L keeps: every 2^L-th from the first one on.
constexpr std::int64_t posts_at(std::int64_t posts, int level) {
    return (posts + (std::int64_t{1} << level) - 1) >> level;
}
/// From level posts to those of the raster, and what lies between.
constexpr Window raster_posts(const Window& window, int level) {
    const auto side = [&](Interval i) {
        return i.empty() ? Interval{} : Interval{i.begin * (1 << level), (i.end - 1) * (1 << level) + 1};
    };
    return {side(window.columns), side(window.rows)};
}

/// Lines of a fan that have one level.
struct Band {
    int level = 0;
    Interval lines;
    std::int64_t first = 0;  ///< column or row of lines.begin, in level posts
};

/// Lines of a quadrant between two doublings of the number of spokes.
struct Ring {
    std::int64_t spokes = 0;  ///< K, of an octant
    Interval lines;           ///< line numbers, 0 = nearest
};

/// A run of spokes of one fan with the azimuth bins it deposits into.
struct SpokeRun {
    Quadrant quadrant = Quadrant::east;
    int fan = 0;
    Interval bins;               ///< counted in the quadrant's own unwrapped azimuth; bin b starts at b times the step
    std::int64_t first_row = 0;  ///< row of the wedge's cells for bins.begin
    std::vector<Interval> spokes;    ///< for each ring of the quadrant: all that must be swept
    std::vector<Interval> touching;  ///< for each ring: those whose cell overlaps the bins
    Fan own_fan() const { return {quadrant, fan}; }
};

/// A run of neighbouring azimuth bins: the unit of work.
struct Wedge {
    std::int64_t index = 0;
    Interval bins;  ///< of the circle, unwrapped as in PolarGrid
    std::vector<SpokeRun> runs;
};

class SpokeGrid {
public:
    /// The least number of spokes of an octant is a multiple of it: fans, and groups of lanes, divide it.
    static constexpr std::int64_t spoke_step = 16;
    static constexpr int slope_bits = 32;
    static constexpr std::int64_t most_rounded = std::int64_t{1} << 20;
    /// In bins of so many posts, pieces on both sides of a line may be put down as one.
    static constexpr double wide_posts = 10;

    SpokeGrid(const DataBase& data_base, const SpokeMap& map, const Sampling& sampling, std::int64_t circle_bins,
              const DetailLevels& levels = {});

    /// The same lines and rings with so many times the spokes (a power of two).
    SpokeGrid finer(int times) const;

    /// Of spoke k of K: k / K, rounded where K is at most 2^20, so that a place that has few binary digits, as on a
    /// post, crosses lines at places with few digits too: the same bits wherever in a raster that is.
    static double slope(std::int64_t spokes, std::int64_t k) {
        const double m = static_cast<double>(k) / static_cast<double>(spokes);
        return spokes <= most_rounded ? rounded(m, slope_bits) : m;
    }

    const SpokeMap& map() const { return map_; }
    double azimuth_step_rad() const { return azimuth_step_; }
    /// No spoke is followed farther: the map's arc and what is beyond, its margin being one of posts of the coarsest level.
    double max_arc_m() const { return max_arc_m_; }
    int fans() const { return fans_each_; }  ///< of each quadrant

    std::int64_t line_count(Fan f) const { return of(f).line_count; }
    /// Raster column or row of a line, in posts of its level.
    std::int64_t line_index(Fan f, std::int64_t line) const {
        const Band& band = band_of(f, line);
        return band.first + outward(f.quadrant) * (line - band.lines.begin);
    }
    /// Level of detail of a line.
    int level(Fan f, std::int64_t line) const { return band_of(f, line).level; }
    /// From the nadir to a line, posts of the raster; above 0.
    double distance(Fan f, std::int64_t line) const;
    /// Does an azimuth bin hold wide_posts or more of a level `distance` posts of the raster from the nadir?
    bool wide_bins(Fan f, double distance, int level) const {
        return distance >= wide_posts * of(f).to_bin_of_post * static_cast<double>(std::int64_t{1} << level);
    }
    /// At least one ring, also where a fan has no line. One may have no lines: the number of spokes doubles at once again.
    const std::vector<Ring>& rings(Fan f) const { return of(f).rings; }
    const std::vector<Band>& bands(Fan f) const { return of(f).bands; }

    /// Part of the azimuth bins that a spoke's cell covers.
    struct Share {
        std::int64_t bin = 0;        ///< the first one, in the quadrant's unwrapped count
        double radians[2] = {0, 0};  ///< of this bin and the next; rounded, independent of any split
    };
    Share share(Fan f, std::int64_t spokes, std::int64_t k) const;

    Wedge wedge(std::int64_t index, Interval bins) const;

    /// Lines from `line` on up to the far border of its strip of cells: borders stand at multiples of `strip` posts of
    /// its level, and where the level changes.
    Interval strip_lines(Fan f, std::int64_t line, std::int64_t strip) const;
    /// The posts that the spokes `run` of `spokes` need from the line behind lines.begin (if there is one) to the last of
    /// `lines`, of one level and in its posts, with those that a doubling brings between them; empty if none meets the
    /// raster there.
    Window window(Fan f, std::int64_t spokes, Interval run, Interval lines) const;

private:
    struct FanLines {
        std::int64_t line_count = 0;
        std::vector<Band> bands;
        std::vector<Ring> rings;
        bool clockwise = true;      // azimuth grows with slope
        double to_bin_of_post = 0;  // posts from the nadir to where a bin is as wide as one of them
    };
    std::size_t place_of(Fan f) const {
        return static_cast<std::size_t>(static_cast<int>(f.quadrant) * fans_each_ + f.index);
    }
    const FanLines& of(Fan f) const { return lines_[place_of(f)]; }
    const Band& band_of(Fan f, std::int64_t line) const {
        const std::vector<Band>& bands = of(f).bands;
        std::size_t i = bands.size() - 1;
        while (i > 0 && bands[i].lines.begin > line) --i;
        return bands[i];
    }
    /// The outermost spokes of a fan, of K.
    std::int64_t least_spoke(Fan f, std::int64_t spokes) const { return 2 * spokes * f.index / fans_each_ - spokes; }
    std::int64_t most_spoke(Fan f, std::int64_t spokes) const { return least_spoke({f.quadrant, f.index + 1}, spokes); }
    void set_bands(Fan f, std::int64_t first_line, std::int64_t line_count, const DetailLevels& levels);
    /// `least`: spokes that every ring has at least.
    void set_rings(Fan f, const Sampling& sampling, double least);
    /// Spokes that a line needs, and those that lie ahead of it for some way; `least` or more.
    double needed_spokes(Fan f, const Sampling& sampling, double least, std::int64_t line) const;
    /// Rings that begin with `spokes`, doubled where that is too few.
    std::vector<Ring> rings_from(Fan f, const Sampling& sampling, double least, std::int64_t spokes) const;
    /// Azimuth of slope half_index / (2 K).
    double edge_azimuth(Quadrant q, std::int64_t spokes, std::int64_t half_index) const;
    Interval touching_spokes(Fan f, std::int64_t spokes, double azimuth_lo, double azimuth_hi) const;

    const DataBase& data_base_;
    const SpokeMap& map_;
    std::int64_t circle_bins_;
    double azimuth_step_, max_arc_m_;
    int fans_each_;
    std::vector<FanLines> lines_;  ///< [quadrant * fans_each_ + fan]
};

}  // namespace wedgescope
