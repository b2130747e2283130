// Cover: one coverage under way. What it is made of, for lib/coverage*.cpp alone: strips and whose posts they are
// (coverage_strips), one run (coverage_run), where its spokes and posts stand on a line, how posts are tested and go into tiles
// (coverage_sweep), what of it is hidden beforehand (coverage_hide), and what a layer says of a post (coverage_posts).
// Leaves what it is asked and answers to coverage.hpp, the hot loops to coverage_lanes.hpp.
#pragma once
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "lib/class_laws.hpp"
#include "lib/coverage.hpp"
#include "lib/coverage_lanes.hpp"
#include "lib/coverage_tiles.hpp"
#include "lib/culture.hpp"
#include "lib/handover.hpp"
#include "lib/rounding.hpp"
#include "lib/sweep.hpp"

namespace wedgescope::covering {

inline constexpr std::int64_t tile_edge = CoverageTile::edge;
inline constexpr std::int64_t knot = static_cast<std::int64_t>(knot_step);
inline constexpr std::int64_t run_posts = 2048, run_spokes = 4096;  ///< of a run at the end of its strip, at the most
inline constexpr std::size_t strips_ahead = 4;                      ///< at most that many on their way at a time
/// As far as so many posts spokes follow the surface through each cell, whatever the quality: what stands between two samples
/// hides the more of what is behind it the nearer it is, and few lines are so near.
inline constexpr double course_posts = 64;
/// Posts that a place between two knots may be off by where single posts are looked at.
inline constexpr double most_unevenness = 1.0 / 256;
inline constexpr float nan_f = std::numeric_limits<float>::quiet_NaN();

inline std::int64_t floor_to(std::int64_t v, std::int64_t step) {
    return (v >= 0 ? v / step : -((-v + step - 1) / step)) * step;
}
inline std::int64_t tile_of(std::int64_t post) { return floor_to(post, tile_edge) / tile_edge; }
inline std::int64_t floor_i(double v) { return static_cast<std::int64_t>(std::floor(v)); }
inline std::int64_t ceil_i(double v) { return static_cast<std::int64_t>(std::ceil(v)); }

/// What is behind the voids that a run of spokes has passed; only the states ask for it.
struct VoidLanes {
    std::vector<float> tangent;     ///< of the highest that may stand in the voids passed
    std::vector<float> top;         ///< highest valid post round the void being crossed; -inf: none is
    std::vector<float> lift, drop;  ///< where it began
    void resize(std::size_t n) {
        tangent.resize(n, no_horizon_f);
        top.resize(n, -std::numeric_limits<float>::infinity());
        lift.resize(n);
        drop.resize(n);
    }
    bool empty() const { return tangent.empty(); }
    /// Spoke `there` becomes what spoke `here` of `from` is.
    void copy(const VoidLanes& from, std::size_t here, std::size_t there) {
        tangent[there] = from.tangent[here];
        top[there] = from.top[here];
        lift[there] = from.lift[here];
        drop[there] = from.drop[here];
    }
};

/// State of the spokes first, first + 1, ... of K.
struct Spokes {
    std::int64_t of = 0;  ///< K
    Interval range;
    std::vector<float> horizon;  ///< [count() + horizon_margin]
    VoidLanes voids;

    void resize(std::int64_t k, Interval spokes, bool with_voids) {
        of = k;
        range = spokes;
        horizon.assign(count() + horizon_margin, no_horizon_f);
        voids = {};
        if (with_voids) voids.resize(count());
    }
    std::size_t count() const { return static_cast<std::size_t>(range.size()); }
    std::size_t bytes_each() const { return voids.empty() ? sizeof(float) : 5 * sizeof(float); }
};

inline bool has(float horizon) { return horizon > 0.5F * no_horizon_f; }

inline PieceForm piece_form(const SpokeMap::LinePiece& piece) {
    return {piece.middle, piece.scale, piece.bend, piece.stretch};
}

/// One quadrant: its lines, its fan of spokes, and how far it has come.
struct Side {
    Quadrant quadrant = Quadrant::east;
    std::int64_t lines = 0;
    Interval minor;                     ///< posts along a line
    double slope_lo = 0, slope_hi = 0;  ///< spokes that meet the raster at all
    std::array<double, 3> square{}, curvature{};
    double most_bent = 0;  ///< greatest curvature of the earth along its rays, and a quarter more
    std::vector<std::pair<double, double>> sector;  ///< slopes in the sector; only where there is one
    Spokes spokes;                                  ///< before the next strip
    std::int64_t tile = 0, tile_end = 0;            ///< first strip, and the one past the last; in steps outward
    bool busy = false;                              ///< a strip of it is being swept
};

/// A strip of a quadrant; what is below `side` and `tile` stands from when it is begun until it is counted.
struct Strip {
    Side* side = nullptr;
    std::int64_t tile = 0;  ///< column (row) of tiles
    bool begun = false, swept = false;
    Interval lines;
    std::vector<Interval> own;                                 ///< posts of each line
    std::vector<Interval> runs;                                ///< of spokes
    std::map<CoverageTiles::Key, std::int64_t> posts;          ///< that are known when it is swept
    std::map<CoverageTiles::Key, CoverageTiles::Tile*> tiles;  ///< that its spokes cross
    Spokes after;
    std::atomic<std::size_t> left{0};  ///< runs
    Strip(Side& of, std::int64_t at) : side(&of), tile(at) {}
};

/// What is known of the posts of a run's window, by block: rows of blocks along the lines.
struct Blocks {
    Interval majors, minors;
    std::vector<BlockBounds> bounds;  ///< empty: nothing is known, all is swept
    std::vector<Skip> skip;           ///< none: something of it may be seen; range: no spoke comes by
    double lowest_m = 0, highest_m = -1;  ///< surface of all; highest below lowest: nothing but voids
    double relief_m = 0, most_m = 0;      ///< from the lowest to the highest surface; and farthest from sea level
    bool empty() const { return bounds.empty(); }
    /// More than the relief that a post counts in its cell: a step along the ray and two across, times its slope, which is
    /// below 2 (SpokeMap refuses rays that bend farther).
    double cell_relief_m() const { return 8 * relief_m; }
    /// What follows from the bounds alone.
    void measure() {
        skip.assign(bounds.size(), Skip::none);
        lowest_m = std::numeric_limits<double>::infinity(), highest_m = -lowest_m;
        for (const BlockBounds& b : bounds)
            if (b.voids != Voids::all) {
                lowest_m = std::min(lowest_m, static_cast<double>(b.lowest_m));
                highest_m = std::max(highest_m, static_cast<double>(b.highest_m) + static_cast<double>(b.culture_m));
            }
        relief_m = lowest_m <= highest_m ? highest_m - lowest_m : 0;
        most_m = lowest_m <= highest_m ? std::max(std::abs(lowest_m), std::abs(highest_m)) : 0;
    }
    std::size_t at(std::int64_t major, std::int64_t minor) const {
        return static_cast<std::size_t>((major - majors.begin) * minors.size() + minor - minors.begin);
    }
};

/// A thing that a thread does.
struct Job {
    enum class Kind { begin, sweep, write } kind = Kind::begin;
    Strip* strip = nullptr;
    std::size_t run = 0;
};

/// Which groups of spokes something of a row of blocks may raise.
struct RowOfBlocks {
    std::vector<float> least;     ///< of the horizons of each group
    std::vector<double> block_w;  ///< how high the blocks' tops stand as a tangent counts it; inf: unknown
    std::vector<double> far_at;   ///< FanKnots on its far border
    std::vector<float> far_lift;
    std::vector<Interval> touched;      ///< blocks, by each group
    std::vector<std::uint8_t> quiet;    ///< groups that nothing of it raises
    std::vector<Interval> groups;       ///< runs of the others
    std::vector<Interval> every_group;  ///< all, as such a list
};

/// Of every knot-th spoke, one more than there are groups: what it has on every line, and what on one (lanes of spoke_fan() and
/// spoke_knots()).
struct FanKnots {
    std::vector<double> slope, turn, curvature;
    std::vector<double> at, at_behind;  ///< posts along a line, and along the one before
    std::vector<float> lift, drop;
};

/// Of every knot-th post of a part of a line (lanes of post_knots()).
struct PostKnots {
    std::size_t groups = 0;     ///< knots less one; the vectors may be longer
    std::vector<double> minor;  ///< the posts
    std::vector<double> at, slope, along;
    std::vector<double> arc;  ///< along the ground, where range limits the view
    std::vector<float> lift, drop, ray, rise;
};

/// The same of single posts, where between knots a line is not straight enough.
struct EachPost {
    std::vector<double> minor, at, slope, along;
};

/// What a thread works in.
struct Desk {
    Blocks blocks;
    RowOfBlocks row;
    Spokes spokes, scratch;
    FanKnots fan;  ///< of `spokes`
    PostKnots posts;
    EachPost each;
    std::vector<float> line, behind;  ///< heights of a window's posts, on a line and on the one before
    std::vector<std::uint8_t> state;
    std::vector<float> raise_m, tangent;
    std::vector<std::uint8_t> bytes;  ///< of a run's posts, line after line
    std::vector<float> values;
    std::vector<std::pair<Interval, Skip>> row_parts, parts;  ///< of a row of blocks; of a line
    std::vector<Interval> own;                                ///< of each line
    std::vector<std::uint8_t> blank;  ///< by line: its posts are all as tiles are before anything is known
    std::vector<SpokeMap::LinePiece> pieces;
    std::array<std::uint64_t, state_count> states{};
    std::array<QuadrantReport, 4> did{};  ///< by Quadrant
    // Of the layer response.
    std::unique_ptr<Culture> culture;
    struct {
        Culture::Cost cost;
        std::uint64_t bytes_read = 0, bytes_spilled = 0;
    } counted;                         ///< of what reading classes took
    std::span<const float> culture_m;  ///< culture heights of a line's posts from culture_begin on; empty: none
    std::int64_t culture_begin = 0;
};

class Cover {
public:
    Cover(const ResolvedScene& scene, WedgeSource& source, const CoverageParams& params,
          const std::function<void(const CoverageTile&)>* write)
        : scene_(scene), source_(source), db_(source.data_base()), params_(params), write_(write),
          sampling_(own_sampling(scene.scene, coverage_sampling(scene.scene.quality))), map_(db_, map_params()),
          grid_(db_, map_, sampling_, 4), bytes_(is_bytes(params.layer)), voids_(params.layer == CoverageLayer::states),
          tiles_(db_.columns, db_.rows, bytes_, outside_byte(), params.reached_only) {
        lift_.sensor_m = static_cast<float>(scene.sensor_m);
        // Upwards: the ground that a sensor stands on hides nothing by the sensor's being rounded into it.
        if (static_cast<double>(lift_.sensor_m) < scene.sensor_m)
            lift_.sensor_m = std::nextafter(lift_.sensor_m, std::numeric_limits<float>::infinity());
        lift_.inverse_radius = static_cast<float>(scene.earth.inverse_radius());
        // Without crossings nobody asks for what is between them.
        if (scene.scene.crossings.value_or(true) && scene.scene.curved_course.value_or(true))
            course_within_ = scene.scene.curved_course ? std::numeric_limits<double>::infinity() : course_posts;
        with_range_ = scene.range_limited || begins_off() || scene.scene.ground_range_m;
        // A post that stands on the limit is in range, however its distance is rounded.
        if (scene.scene.ground_range_m) farthest_m_ = *scene.scene.ground_range_m * (1 + 0x1p-32);
        limited_ = with_range_ || scene.scene.sector || params.elevation;
        with_posts_ = limited_ || !bytes_;
        uneven_ = (with_posts_ || voids_) && map_.unevenness(knot) > most_unevenness;
        if (params.elevation) {
            least_tangent_ = rounded(std::tan(params.elevation->first.rad()), 40);
            most_tangent_ = rounded(std::tan(params.elevation->second.rad()), 40);
        }
        hides_ = params.cull && bytes_ && !params.elevation && !begins_off();
        narrows_ = hides_ && !with_posts_ && !voids_ && !sampling_.cross_lines;
        for (Quadrant q : all_quadrants) set_up(q);
        reached_ = {{0, db_.columns}, {0, db_.rows}};
        if (!write && !params.reached_only) return;  // what it would hold is known without a word for each column
        own_east_west();
        if (params.reached_only) leave_unreached();
        for (Quadrant q : {Quadrant::south, Quadrant::north}) set_rows(q);
        // Most ground is hidden mostly, and what tiles begin as need not be painted.
        if (bytes_ && !with_posts_ && !params.reached_only) {
            blank_ = all_owned() ? byte_of(State::shadow) : outside_byte();
            tiles_.begin_as(*blank_);
        }
    }

    const SpokeMap& map() const { return map_; }
    /// With so many strips on their way at a time.
    std::size_t fixed_bytes(std::size_t strips) const {
        std::size_t bytes = static_cast<std::size_t>(db_.columns + db_.rows) * sizeof(Interval);
        for (const Side& side : sides_) {
            const double k = static_cast<double>(grid_.rings(side.quadrant).back().spokes);
            const double spokes = (side.slope_hi - side.slope_lo) * k + 64;
            bytes += static_cast<std::size_t>(2 * spokes * static_cast<double>((voids_ ? 5 : 1) * sizeof(float)));
        }
        // Tiles: those of the strips, those on their way out, those that wait on the diagonals.
        bytes += (2 * strips * tiles_across() + tiles_across() / 4 + 64) * tiles_.tile_bytes();
        return bytes + (std::size_t{6} << 20);
    }
    /// Without what the source's reader holds.
    std::size_t own_desk_bytes() const {
        // A run's window is as wide as its spokes and as they drift over the strip; it stands there as read and turned.
        const std::int64_t width = run_posts + tile_edge + 12 * knot + 2 * line_margin;
        const auto posts = static_cast<std::size_t>(width * (tile_edge + 1));
        std::size_t classes = 0;
        if (params_.layer == CoverageLayer::response && db_.has_culture)
            classes = static_cast<std::size_t>(Culture::tiles_under(db_, {{0, width}, {0, width}}).columns.size() *
                                               Culture::tiles_under(db_, {{0, tile_edge}, {0, tile_edge}}).rows.size() *
                                               db_.culture_tile_columns * db_.culture_tile_rows) *
                      sizeof(ClassId);
        return posts * (3 * sizeof(float) + (bytes_ ? 1 : sizeof(float))) + classes + (std::size_t{1} << 20);
    }
    std::size_t desk_bytes() const { return own_desk_bytes() + source_.reader_bytes(); }

    CoverageReport run();

private:
    /// Is what lies near the sensor out of view?
    bool begins_off() const { return scene_.scene.range_start_m > 0 || scene_.scene.ground_start_m > 0; }
    /// Tiles of the longest strip.
    std::size_t tiles_across() const {
        return static_cast<std::size_t>(std::max(reached_.columns.size(), reached_.rows.size()) / tile_edge + 2);
    }
    /// While nobody else begins or ends a strip.
    std::size_t held_bytes(int threads) const {
        std::size_t bytes = source_.cache_bytes() + desk_bytes() * static_cast<std::size_t>(threads) +
                            (tiles_.unfinished() + waiting_) * tiles_.tile_bytes();
        for (const Side& side : sides_) bytes += side.spokes.count() * side.spokes.bytes_each();
        return bytes;
    }
    SpokeMapParams map_params() const {
        return {.geometry = scene_.geometry,
                .nadir = scene_.nadir,
                .lat_deg = scene_.lat_deg,
                .lon_deg = scene_.lon_deg,
                .earth_k = scene_.scene.earth_k,
                .max_arc_m = rounded(scene_.farthest_arc_m + arc_margin_m(db_), 10),
                .margin_m = arc_margin_m(db_),
                .range_m = scene_.range_limited ? scene_.scene.range_m : scene_.scene.ground_range_m};
    }

    void set_up(Quadrant q);
    void set_rows(Quadrant q);
    void own_east_west();
    void leave_unreached();
    Interval widest_fan(const Side& side, std::int64_t line) const;
    Interval own_of_row(const Side& side, std::int64_t line) const;
    bool all_owned() const;
    bool post_below() const;
    Interval tile_lines(const Side& side, std::int64_t step, Interval& indices) const;
    LineForm form(const Side& side, double distance) const;
    /// Spokes that are carried: one beyond the outermost at least, for what rounding puts outside of it.
    static Interval fan(const Side& side, std::int64_t k) {
        return {floor_to(floor_i(side.slope_lo * static_cast<double>(k)) - 1, knot),
                floor_to(floor_i(side.slope_hi * static_cast<double>(k)) + 1, knot) + knot};
    }
    void order_strips();
    void work();
    void go_on();
    void queue(Job job, bool first = false);
    void begin(Strip& strip);
    void prepare(Strip& strip);
    class Run;
    void sweep(Strip& strip, std::size_t run);
    void end(Strip& strip);
    void write_done();
    static void place_fan(const Side& side, Desk& desk);
    void place_knots(const Side& side, const LineForm& line, Interval groups, Desk& desk) const;
    /// What spokes look at on the way to a line so many posts off.
    Between looked_at_between(double distance) const {
        if (distance <= course_within_) return Between::course;
        return sampling_.cross_lines ? Between::crossings : Between::nothing;
    }
    bool crosses(double distance) const { return looked_at_between(distance) != Between::nothing; }
    void place_posts(const Side& side, const LineForm& line, std::int64_t k, Interval own, Interval posts, Desk& desk);
    void solve_posts(const Side& side, const LineForm& line, std::int64_t k, std::span<const double> minor, Desk& desk,
                     const KnotLanes& out) const;
    void place_each(const Side& side, const LineForm& line, Interval posts, Desk& desk) const;
    double spoke_at(const Side& side, const LineForm& line, std::int64_t k, double minor) const;
    void ask_map(const Side& side, Interval major, Interval minor, Blocks& blocks);
    static void leave_out(bool columns, const Blocks& blocks, Interval majors, std::optional<std::int64_t> only,
                          ChunkRequest& request);
    void look_at(const Chunk& chunk, Interval major, Interval minor, Blocks& blocks) const;
    void hide(const Side& side, Interval lines, std::int64_t major, Interval core, bool all_posts, Desk& desk);
    void begin_row(std::int64_t major, bool all_posts, Blocks& blocks) const;
    void judge(const Side& side, const LineForm& near, Interval lines, std::int64_t major, Interval in_fan,
               Desk& desk) const;
    static void gather_groups(std::int64_t major, Interval counted, Interval in_fan, Desk& desk);
    static Interval looked_at_part(std::int64_t row, const Desk& desk);
    static void part_row(std::int64_t row, Desk& desk);
    static void part_line(Interval posts, Desk& desk);
    void pass_voids(Desk& desk, Interval window, bool behind);
    class View;
    class LinePosts;
    void finish_line(const Side& side, const LineForm& line, std::int64_t index, Interval posts, Interval window,
                     Desk& desk, std::size_t out) const;
    /// Facet of a post's own cell: the sine of the local grazing angle, and how much larger than its plan it is.
    struct Facet {
        double sine, secant;
    };
    static Facet facet(const Side& side, const LineForm& line, double slope, double z, double behind, double beside,
                       double arc_m, double inverse_radius, const SightLine& sight);
    Culture& culture_of(Desk& desk) const {
        if (!desk.culture) desk.culture = std::make_unique<Culture>(db_, &source_);
        return *desk.culture;
    }
    Facet nadir_facet(std::int64_t column, std::int64_t row, double above_m) const;
    float nadir_response(std::int64_t column, std::int64_t row, double above_m);
    float response(const Side& side, double slope, std::int64_t index, std::int64_t post, const Facet& facet,
                   const SightLine& sight, double inverse_radius, Desk& desk) const;
    void test_part(const LineForm& line, const Spokes& s, Interval posts, Interval window, Desk& desk) const;
    void copy_out(const Strip& strip, Interval window, Desk& desk);
    template <class T, class TileOf>
    void copy_columns(const Side& side, Interval lines, const T* from, std::size_t width, TileOf&& tile,
                      const Desk& desk) const;
    template <class T, class TileOf>
    void copy_rows(const Side& side, Interval lines, const T* from, std::size_t width, TileOf&& tile,
                   const Desk& desk) const;
    /// A column, and the one that repeats it where the raster has one more than the circle.
    std::vector<std::int64_t> same_columns(std::int64_t real) const {
        if (db_.cyclic && real == 0 && db_.columns > db_.cycle_columns) return {real, db_.cycle_columns};
        return {real};
    }
    /// Of a line's posts those that the raster's last column, which repeats the first, has once more.
    Interval repeated(Quadrant q, std::int64_t index, Interval posts) const {
        if (!db_.cyclic || db_.columns == db_.cycle_columns) return {};
        if (lines_are_columns(q)) return db_.real_column(index) == 0 ? posts : Interval{};
        const std::int64_t first = posts.end - 1 - db_.real_column(posts.end - 1);  // the last one of the first column
        return intersection({first, first + 1}, posts);
    }
    std::uint8_t byte_of(State state) const {
        if (params_.layer == CoverageLayer::states) return static_cast<std::uint8_t>(state);
        switch (state) {
            case State::seen:
            case State::unknown:
                return params_.mask.seen;
            case State::shadow:
                return params_.mask.hidden;
            case State::no_data:
                return params_.mask.no_data;
            default:
                return params_.mask.outside;
        }
    }
    std::uint8_t outside_byte() const { return byte_of(State::outside); }
    void put_nadir(Strip& strip);

    const ResolvedScene& scene_;
    WedgeSource& source_;
    const DataBase& db_;
    const CoverageParams& params_;
    const std::function<void(const CoverageTile&)>* write_;
    Sampling sampling_;
    SpokeMap map_;
    SpokeGrid grid_;
    std::unique_ptr<const SceneTables> tables_;  ///< of the layer response; null: another one
    std::optional<PathLossTable> loss_;
    double radar_constant_ = 0;
    bool bytes_, voids_;
    bool with_range_ = false;            ///< a slant range or one along the ground is asked for
    bool limited_ = false;               ///< not all of the raster is in view
    bool with_posts_ = false;            ///< the single post must be looked at
    std::optional<std::uint8_t> blank_;  ///< as tiles begin, where that need not be painted
    bool uneven_ = false;  ///< single posts stand by themselves: between knots a line is not straight enough
    bool narrows_ = false;               ///< of a row of blocks only what may be seen or raise a horizon is looked at
    bool hides_ = false;                 ///< a post below every horizon can be judged without its height
    double farthest_m_ = std::numeric_limits<double>::infinity();  ///< along the ground
    double least_tangent_ = 0, most_tangent_ = 0;
    Lift lift_;
    double course_within_ = 0;  ///< posts
    std::array<Side, 4> sides_;
    std::vector<Interval> own_;  ///< by column of the raster: rows that belong to the quadrants east and west
    Window reached_;             ///< posts of the tiles that strips account for, in whole tiles
    tbb::enumerable_thread_specific<Desk> desks_;

    // The order of work.
    Handover handover_;
    int threads_ = 1;
    std::size_t strips_ahead_ = strips_ahead;
    std::mutex mutex_;  ///< of what follows, and of a strip's and a side's flags
    std::condition_variable changed_;
    std::deque<Job> jobs_;
    bool over_ = false;
    std::exception_ptr error_;
    std::vector<std::unique_ptr<Strip>> strips_;
    std::size_t counted_ = 0;  ///< of strips_: swept, as all before them, and gone
    CoverageTiles tiles_;
    std::size_t waiting_ = 0;  ///< tiles on their way out
    bool writing_ = false;
    double write_s_ = 0;  ///< of the one task at a time that hands out
};

}  // namespace wedgescope::covering
