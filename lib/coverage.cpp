#include "lib/coverage.hpp"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <numbers>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

#include "lib/class_laws.hpp"
#include "lib/coverage_lanes.hpp"
#include "lib/coverage_tiles.hpp"
#include "lib/culture.hpp"
#include "lib/error.hpp"
#include "lib/facet.hpp"
#include "lib/handover.hpp"
#include "lib/post_extremes.hpp"
#include "lib/raised_source.hpp"
#include "lib/rounding.hpp"
#include "lib/stopwatch.hpp"
#include "lib/sweep.hpp"
#include "lib/threads.hpp"
#include "lib/transpose.hpp"

namespace wedgescope {
namespace {

constexpr std::int64_t tile_edge = CoverageTile::edge;
constexpr std::int64_t knot = static_cast<std::int64_t>(knot_step);
constexpr std::int64_t run_spokes = 2048;  ///< of a run, at the end of its strip
constexpr std::size_t strips_ahead = 4;    ///< at most that many on their way at a time
constexpr float nan_f = std::numeric_limits<float>::quiet_NaN();

std::int64_t floor_to(std::int64_t v, std::int64_t step) {
    return (v >= 0 ? v / step : -((-v + step - 1) / step)) * step;
}
std::int64_t tile_of(std::int64_t post) { return floor_to(post, tile_edge) / tile_edge; }
std::int64_t floor_i(double v) { return static_cast<std::int64_t>(std::floor(v)); }
std::int64_t ceil_i(double v) { return static_cast<std::int64_t>(std::ceil(v)); }

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

bool has(float horizon) { return horizon > 0.5F * no_horizon_f; }

/// Twice as many: even spokes are their parents, odd ones stand between two; where one of these has met no ground, at
/// the raster's edge, the child has met none either.
void double_spokes(Spokes& s, Spokes& scratch) {
    const std::size_t n = s.count();
    scratch.resize(2 * s.of, {2 * s.range.begin, 2 * s.range.end}, !s.voids.empty());
    for (std::size_t i = 0; i < n; ++i) {
        const float a = s.horizon[i], b = i + 1 < n ? s.horizon[i + 1] : no_horizon_f;
        scratch.horizon[2 * i] = a;
        scratch.horizon[2 * i + 1] = has(a) && has(b) ? 0.5F * (a + b) : no_horizon_f;
    }
    if (!s.voids.empty())
        for (std::size_t i = 0; i < n; ++i) {
            const std::size_t next = std::min(i + 1, n - 1);
            for (std::size_t child : {2 * i, 2 * i + 1}) {
                scratch.voids.tangent[child] = s.voids.tangent[i];
                scratch.voids.top[child] = s.voids.top[i];
                scratch.voids.lift[child] = s.voids.lift[i];
                scratch.voids.drop[child] = s.voids.drop[i];
            }
            scratch.voids.tangent[2 * i + 1] = std::max(s.voids.tangent[i], s.voids.tangent[next]);
        }
    std::swap(s, scratch);
}

/// One quadrant: its lines, its fan of spokes, and how far it has come.
struct Side {
    Quadrant quadrant = Quadrant::east;
    std::int64_t lines = 0;
    Interval minor;                     ///< posts along a line
    double slope_lo = 0, slope_hi = 0;  ///< spokes that meet the raster at all
    std::array<double, 3> square{}, curvature{};
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

std::int64_t block_along(std::int64_t post) { return floor_to(post, block_posts) / block_posts; }

/// What is known of the posts of a run's window, by block: rows of blocks along the lines.
struct Blocks {
    Interval majors, minors;
    std::vector<BlockBounds> bounds;  ///< empty: nothing is known, all is swept
    std::vector<Skip> skip;           ///< none: something of it may be seen; range: no spoke comes by
    double relief_m = 0, most_m = 0;  ///< from the lowest to the highest surface; and farthest from sea level
    bool empty() const { return bounds.empty(); }
    /// What follows from the bounds alone.
    void measure() {
        skip.assign(bounds.size(), Skip::none);
        double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
        for (const BlockBounds& b : bounds)
            if (b.voids != Voids::all) {
                lowest = std::min(lowest, static_cast<double>(b.lowest_m));
                highest = std::max(highest, static_cast<double>(b.highest_m) + static_cast<double>(b.culture_m));
            }
        relief_m = lowest <= highest ? highest - lowest : 0;
        most_m = lowest <= highest ? std::max(std::abs(lowest), std::abs(highest)) : 0;
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

/// What a thread works in.
struct Desk {
    Blocks blocks;
    std::vector<float> least;           ///< of the horizons of each group of spokes
    std::vector<Interval> touched;      ///< blocks of a row, by each group
    std::vector<Interval> groups;       ///< runs of groups that something of the row of blocks may raise
    std::vector<Interval> every_group;  ///< all, as such a list
    Spokes spokes, scratch;
    std::vector<float> line, behind;
    std::vector<double> at, at_behind, from, post_at, post_slope, post_along;
    std::vector<double> far_at;
    std::vector<float> far_lift;
    std::vector<float> lift, drop, post_lift, post_drop, post_ray, post_rise;
    std::vector<std::uint8_t> state;
    std::vector<float> raise_m, tangent;
    std::vector<std::uint8_t> bytes;  ///< of a run's posts, line after line
    std::vector<float> values;
    std::vector<std::pair<Interval, Skip>> parts;  ///< of a line
    std::vector<Interval> own;                     ///< of each line
    std::vector<SpokeMap::LinePiece> pieces;
    std::array<std::uint64_t, state_count> states{};
    std::array<QuadrantReport, 4> did{};  ///< by Quadrant
    // Of the layer response.
    std::unique_ptr<Culture> culture;
    struct {
        Culture::Cost cost;
        std::uint64_t bytes_read = 0, bytes_spilled = 0;
    } counted;  ///< of what reading classes took
    std::span<const float> culture_m;  ///< culture heights of a line's posts from culture_begin on; empty: none
    std::int64_t culture_begin = 0;
    std::optional<std::int32_t> unknown_code;  ///< the least on seen ground
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
        lift_.inverse_radius = static_cast<float>(scene.earth.inverse_radius());
        with_range_ = scene.range_limited || scene.scene.range_start_m > 0 || scene.scene.ground_range_m;
        // A post that stands on the limit is in range, however its distance is rounded.
        if (scene.scene.ground_range_m) farthest_m_ = *scene.scene.ground_range_m * (1 + 0x1p-32);
        limited_ = with_range_ || scene.scene.sector || params.elevation;
        with_posts_ = limited_ || !bytes_;
        if (params.elevation) {
            least_tangent_ = rounded(std::tan(params.elevation->first.rad()), 40);
            most_tangent_ = rounded(std::tan(params.elevation->second.rad()), 40);
        }
        hides_ = params.cull && bytes_ && !params.elevation && !(scene.scene.range_start_m > 0);
        for (Quadrant q : all_quadrants) set_up(q);
        own_east_west();
        reached_ = {{0, db_.columns}, {0, db_.rows}};
        if (params.reached_only) leave_unreached();
        for (Quadrant q : {Quadrant::south, Quadrant::north}) set_rows(q);
    }

    /// With so many strips on their way at a time.
    std::size_t fixed_bytes(std::size_t strips) const {
        std::size_t bytes = own_.size() * sizeof(Interval);
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
        const std::int64_t width = run_spokes + tile_edge + 12 * knot + 2 * line_margin;
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
        const double post = std::hypot(db_.step_x, db_.step_y) * db_.metres_a_unit();
        return {scene_.geometry, scene_.nadir,         scene_.lat_deg,
                scene_.lon_deg,  scene_.scene.earth_k, rounded(scene_.farthest_arc_m + 2 * post, 10)};
    }

    void set_up(Quadrant q);
    void set_rows(Quadrant q);
    void own_east_west();
    void leave_unreached();
    Interval widest_fan(const Side& side, std::int64_t line) const;
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
    void sweep(Strip& strip, std::size_t run);
    void end(Strip& strip);
    void write_done();
    void place_knots(const Side& side, const LineForm& line, const Spokes& s, Interval groups, Desk& desk) const;
    void place_posts(const Side& side, const LineForm& line, std::int64_t k, Interval own, Interval posts, Desk& desk);
    double spoke_at(const Side& side, const LineForm& line, std::int64_t k, double minor) const;
    void ask_map(const Side& side, Interval major, Interval minor, Blocks& blocks);
    static void leave_out(bool columns, const Blocks& blocks, Interval majors, std::optional<std::int64_t> only,
                          ChunkRequest& request);
    void look_at(const Chunk& chunk, Interval major, Interval minor, Blocks& blocks) const;
    void hide(const Side& side, Interval lines, std::int64_t major, Interval core, bool all_posts, Desk& desk);
    void part_line(Interval posts, std::int64_t row, Desk& desk) const;
    void pass_voids(Desk& desk, Interval window, bool behind);
    void finish_line(const Side& side, const LineForm& line, std::int64_t index, Interval posts, Interval window,
                     Desk& desk, std::size_t out);
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
    std::int64_t real_column(std::int64_t c) const {
        if (!db_.cyclic) return c;
        const std::int64_t rest = c % db_.cycle_columns;
        return rest < 0 ? rest + db_.cycle_columns : rest;
    }
    /// A column, and the one that repeats it where the raster has one more than the circle.
    std::vector<std::int64_t> same_columns(std::int64_t real) const {
        if (db_.cyclic && real == 0 && db_.columns > db_.cycle_columns) return {real, db_.cycle_columns};
        return {real};
    }
    std::uint8_t byte_of(std::uint8_t state) const {
        if (params_.layer == CoverageLayer::states) return state;
        const MaskValues& mask = params_.mask;
        return state == 2 || state == 3 ? mask.seen
               : state == 1             ? mask.hidden
               : state == 0             ? mask.no_data
                                        : mask.outside;
    }
    std::uint8_t outside_byte() const { return byte_of(static_cast<std::uint8_t>(State::outside)); }
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
    bool with_range_ = false;  ///< a slant range or one along the ground is asked for
    bool limited_ = false;     ///< not all of the raster is in view
    bool with_posts_ = false;  ///< the single post must be looked at
    bool hides_ = false;       ///< a post below every horizon can be judged without its height
    double farthest_m_ = std::numeric_limits<double>::infinity();  ///< along the ground
    double least_tangent_ = 0, most_tangent_ = 0;
    Lift lift_;
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

void Cover::set_up(Quadrant q) {
    Side& side = sides_[static_cast<std::size_t>(q)];
    side.quadrant = q;
    side.lines = grid_.line_count(q);
    const bool columns = lines_are_columns(q);
    const double nadir = map_.nadir_minor(q);
    side.minor = {0, columns ? db_.rows : db_.columns};
    if (db_.cyclic && !columns)
        side.minor = {floor_i(nadir) - db_.cycle_columns / 2 + 1, floor_i(nadir) + db_.cycle_columns / 2};
    // The slopes of the spokes that meet the raster.
    side.slope_lo = 1, side.slope_hi = -1;
    for (std::int64_t line : {std::int64_t{0}, side.lines - 1}) {
        if (side.lines == 0) break;
        const double d = grid_.distance(q, line), bend = map_.straight() ? 0 : map_.most_bend(q);
        side.slope_lo = std::min(side.slope_lo, (static_cast<double>(side.minor.begin) - 2 - bend - nadir) / d);
        side.slope_hi = std::max(side.slope_hi, (static_cast<double>(side.minor.end) + 1 + bend - nadir) / d);
    }
    side.slope_lo = std::clamp(side.slope_lo, -1.0, 1.0);
    side.slope_hi = std::clamp(side.slope_hi, side.slope_lo, 1.0);
    // f^2 and f^2 / Re are quadratic in the slope.
    const auto quadratic = [](double below, double middle, double above) {
        return std::array<double, 3>{middle, 0.5 * (above - below), 0.5 * (above + below) - middle};
    };
    const auto square = [&](double m) { return map_.metres_per_post(q, m) * map_.metres_per_post(q, m); };
    const auto curvature = [&](double m) { return square(m) * map_.inverse_radius(q, m); };
    side.square = quadratic(square(-1), square(0), square(1));
    side.curvature = quadratic(curvature(-1), curvature(0), curvature(1));
    if (scene_.scene.sector) {
        const double from = scene_.scene.platform.heading.rad() + scene_.scene.sector->from.rad();
        const double width = scene_.scene.sector->to.rad() - scene_.scene.sector->from.rad();
        const double a = map_.azimuth_rad(q, -1), b = map_.azimuth_rad(q, 1);
        const double sign = b > a ? 1 : -1;
        const auto slope_of = [&](double azimuth) {
            double lo = -1, hi = 1;
            for (int i = 0; i < 60; ++i) {
                const double middle = 0.5 * (lo + hi);
                ((map_.azimuth_rad(q, middle) - azimuth) * sign < 0 ? lo : hi) = middle;
            }
            return rounded(0.5 * (lo + hi), 36);
        };
        constexpr double circle = 2 * std::numbers::pi;
        for (int turn = -3; turn <= 3; ++turn) {
            const double begin = std::max(from + turn * circle, std::min(a, b)),
                         end = std::min(from + width + turn * circle, std::max(a, b));
            if (begin > end) continue;
            // A hair beyond the quadrant, so that no post on a diagonal falls between two.
            double lo = slope_of(begin), hi = slope_of(end);
            if (lo > hi) std::swap(lo, hi);
            if (begin == std::min(a, b)) (sign > 0 ? lo : hi) += sign > 0 ? -1 : 1;
            if (end == std::max(a, b)) (sign > 0 ? hi : lo) += sign > 0 ? 1 : -1;
            side.sector.emplace_back(lo, hi);
        }
    }
    const std::int64_t k = grid_.rings(q).front().spokes;
    side.spokes.resize(k, fan(side, k), voids_);
    // Strips, in the order outward. The quadrants north and south have the rows without lines too: set_rows().
    if (!columns || side.lines == 0) return;
    side.tile = tile_of(grid_.line_index(q, 0));
    side.tile_end = tile_of(grid_.line_index(q, side.lines - 1)) + outward(q);
}

/// Strips of the quadrants north and south.
void Cover::set_rows(Quadrant q) {
    Side& side = sides_[static_cast<std::size_t>(q)];
    const std::int64_t border =
        std::clamp<std::int64_t>(ceil_i(map_.nadir_major(q)), 0, db_.rows);  // first row of the south
    const Interval rows =
        intersection(reached_.rows, q == Quadrant::south ? Interval{border, db_.rows} : Interval{0, border});
    if (rows.empty()) return;
    side.tile = tile_of(q == Quadrant::south ? rows.begin : rows.end - 1);
    side.tile_end = (q == Quadrant::south ? tile_of(rows.end - 1) : tile_of(rows.begin)) + outward(q);
}

/// Posts of a row that spokes of north and south may come by.
Interval Cover::widest_fan(const Side& side, std::int64_t line) const {
    const double d = grid_.distance(side.quadrant, line);
    return intersection(
        {floor_i(map_.place(side.quadrant, -1, d).minor) - 2, ceil_i(map_.place(side.quadrant, 1, d).minor) + 3},
        side.minor);
}

/// The tiles that spokes come by lie in these columns and rows; of all others nothing need be known.
void Cover::leave_unreached() {
    Interval columns, rows;
    for (std::int64_t c = 0; c < db_.columns; ++c)
        if (const Interval own = own_[static_cast<std::size_t>(c)]; !own.empty()) {
            columns = hull(columns, {c, c + 1});
            rows = hull(rows, own);
        }
    for (Quadrant q : {Quadrant::south, Quadrant::north}) {
        const Side& side = sides_[static_cast<std::size_t>(q)];
        for (std::int64_t line = 0; line < side.lines; ++line) {
            const std::int64_t row = grid_.line_index(q, line);
            columns = hull(columns, widest_fan(side, line));
            rows = hull(rows, {row, row + 1});
        }
    }
    const std::int64_t c = floor_i(scene_.nadir.column), r = floor_i(scene_.nadir.row);
    if (r >= 0 && r < db_.rows && (db_.cyclic || (c >= 0 && c < db_.columns))) {
        columns = hull(columns, {c, c + 1});
        rows = hull(rows, {r, r + 1});
    }
    if (db_.cyclic) columns = {0, db_.columns};
    const auto whole_tiles = [](Interval posts, std::int64_t end) {
        return posts.empty() ? Interval{}
                             : Interval{floor_to(posts.begin, tile_edge),
                                        std::min(end, floor_to(posts.end - 1, tile_edge) + tile_edge)};
    };
    reached_ = {whole_tiles(columns, db_.columns), whole_tiles(rows, db_.rows)};
}

void Cover::own_east_west() {
    own_.assign(static_cast<std::size_t>(db_.columns), {});
    for (Quadrant q : {Quadrant::east, Quadrant::west}) {
        const Side& side = sides_[static_cast<std::size_t>(q)];
        if (side.lines == 0) continue;
        const auto rows = [&](std::int64_t line) {
            const double d = grid_.distance(q, line);
            const Interval fan{ceil_i(map_.place(q, -1, d).minor), floor_i(map_.place(q, 1, d).minor) + 1};
            return intersection(fan, {0, db_.rows});
        };
        Interval last;
        for (std::int64_t line = 0; line < side.lines; ++line) {
            last = rows(line);
            const std::int64_t column = real_column(grid_.line_index(q, line));
            own_[static_cast<std::size_t>(column)] = last;
        }
    }
    // One column more than the circle: the last repeats the first.
    if (db_.cyclic && db_.columns > db_.cycle_columns) own_.back() = own_.front();
}

/// Lines of a strip that spokes cross; and the raster's columns (rows) that the strip stands for.
Interval Cover::tile_lines(const Side& side, std::int64_t step, Interval& indices) const {
    const Quadrant q = side.quadrant;
    indices = {step * tile_edge, (step + 1) * tile_edge};
    if (!lines_are_columns(q)) {
        const std::int64_t border = std::clamp<std::int64_t>(ceil_i(map_.nadir_major(q)), 0, db_.rows);
        indices = intersection(indices, q == Quadrant::south ? Interval{border, db_.rows} : Interval{0, border});
    }
    if (side.lines == 0) return {};
    const std::int64_t first = grid_.line_index(q, 0);
    const Interval lines = outward(q) > 0 ? Interval{indices.begin - first, indices.end - first}
                                          : Interval{first - indices.end + 1, first - indices.begin + 1};
    const Interval real = intersection(lines, {0, side.lines});
    if (lines_are_columns(q)) {
        const std::int64_t a = grid_.line_index(q, real.begin), b = grid_.line_index(q, real.end - 1);
        indices = {std::min(a, b), std::max(a, b) + 1};
    }
    return real;
}

LineForm Cover::form(const Side& side, double distance) const {
    return {distance, map_.nadir_minor(side.quadrant), side.square, side.curvature};
}

/// A post right below the sensor lies on no line.
void Cover::put_nadir(Strip& strip) {
    const std::int64_t c = floor_i(scene_.nadir.column), r = floor_i(scene_.nadir.row);
    const bool on_post = static_cast<double>(c) == scene_.nadir.column && static_cast<double>(r) == scene_.nadir.row;
    const Window& patch = scene_.nadir_patch.window;
    if (!on_post || r < 0 || r >= db_.rows || !patch.columns.contains(c) || !patch.rows.contains(r)) return;
    const float z = scene_.nadir_patch.surface_m[static_cast<std::size_t>(
        (r - patch.rows.begin) * patch.columns.size() + c - patch.columns.begin)];
    const double above_m = scene_.sensor_m - static_cast<double>(z) - params_.target_m;
    State state = z == z ? State::seen : State::no_data;
    if (with_range_ && !(std::abs(above_m) <= *scene_.scene.range_m && std::abs(above_m) >= scene_.scene.range_start_m))
        state = State::outside;
    if (params_.elevation && state == State::seen && params_.elevation->first.deg() > -90 + 1e-9)
        state = State::outside;
    float value = nan_f;
    if (state == State::seen) {
        value = params_.layer == CoverageLayer::height     ? 0.0F
                : params_.layer == CoverageLayer::range    ? static_cast<float>(std::abs(above_m))
                : params_.layer == CoverageLayer::response ? nadir_response(c, r, above_m)
                                                           : 90.0F;
    }
    for (std::int64_t column : same_columns(real_column(c))) {
        CoverageTiles::Tile& tile = *strip.tiles.at({r / tile_edge, column / tile_edge});
        const std::int64_t at = (r % tile_edge) * tile_edge + column % tile_edge;
        if (bytes_)
            tiles_.buffer<std::uint8_t>(tile)[at] = byte_of(static_cast<std::uint8_t>(state));
        else
            tiles_.buffer<float>(tile)[at] = value;
        ++desks_.local().states[static_cast<std::size_t>(state)];
    }
}

/// Knots of some groups of spokes, where they stand among all of them.
void Cover::place_knots(const Side& side, const LineForm& line, const Spokes& s, Interval groups, Desk& desk) const {
    const auto all = static_cast<std::size_t>(s.range.size() / knot + 1);
    desk.at.resize(all);
    desk.lift.resize(all);
    desk.drop.resize(all);
    const std::int64_t k = s.of, first = s.range.begin;
    const auto slope = [&](std::int64_t g) { return static_cast<double>(first + g * knot) / static_cast<double>(k); };
    map_.line(side.quadrant, line.distance, slope(groups.begin), slope(groups.end), desk.pieces);
    auto i = static_cast<std::size_t>(groups.begin);
    const auto n = static_cast<std::size_t>(groups.end) + 1;
    for (std::size_t p = 0; p < desk.pieces.size(); ++p) {
        const SpokeMap::LinePiece& piece = desk.pieces[p];
        std::size_t end = n;
        if (p + 1 < desk.pieces.size())
            for (end = i; end < n && static_cast<double>(first + static_cast<std::int64_t>(end) * knot) <
                                         piece.slope_end * static_cast<double>(k);)
                ++end;
        spoke_knots(
            line, {piece.middle, piece.scale, piece.bend, piece.stretch}, k,
            first + static_cast<std::int64_t>(i) * knot, end - i,
            {desk.at.data() + i, nullptr, nullptr, desk.lift.data() + i, desk.drop.data() + i, nullptr, nullptr});
        i = end;
    }
}

void Cover::place_posts(const Side& side, const LineForm& line, std::int64_t k, Interval own, Interval posts,
                        Desk& desk) {
    const std::int64_t first = floor_to(posts.begin, knot), groups = (floor_to(posts.end - 1, knot) - first) / knot + 1;
    const auto n = static_cast<std::size_t>(groups + 1);
    for (auto* v : {&desk.from, &desk.post_at, &desk.post_slope, &desk.post_along}) v->resize(n);
    for (auto* v : {&desk.post_lift, &desk.post_drop, &desk.post_ray, &desk.post_rise}) v->resize(n);
    for (std::size_t i = 0; i < n; ++i)
        desk.from[i] =
            static_cast<double>(std::clamp(first + static_cast<std::int64_t>(i) * knot, own.begin, own.end - 1));
    map_.line(side.quadrant, line.distance, -1, 1, desk.pieces);
    std::size_t i = 0;
    for (std::size_t p = 0; p < desk.pieces.size(); ++p) {
        const SpokeMap::LinePiece& piece = desk.pieces[p];
        std::size_t end = n;
        if (p + 1 < desk.pieces.size()) {
            const double u = (piece.slope_end - piece.middle) * piece.scale;
            const double border = line.nadir_minor + piece.slope_end * line.distance + piece.bend[0] +
                                  u * (piece.bend[1] + u * (piece.bend[2] + u * (piece.bend[3] + u * piece.bend[4])));
            for (end = i; end < n && desk.from[end] < border;) ++end;
        }
        post_knots(
            line, {piece.middle, piece.scale, piece.bend, piece.stretch}, k, desk.from.data() + i, end - i,
            {desk.post_at.data() + i, desk.post_slope.data() + i, desk.post_along.data() + i, desk.post_lift.data() + i,
             desk.post_drop.data() + i, desk.post_ray.data() + i, desk.post_rise.data() + i});
        i = end;
    }
}

double Cover::spoke_at(const Side& side, const LineForm& line, std::int64_t k, double minor) const {
    std::vector<SpokeMap::LinePiece> pieces;
    const double guess = (minor - line.nadir_minor) / line.distance;
    map_.line(side.quadrant, line.distance, std::clamp(guess, -1.0, 1.0), std::clamp(guess, -1.0, 1.0), pieces);
    double at = 0, slope = 0, along = 0;
    float lift = 0, drop = 0, ray = 0, rise = 0;
    const SpokeMap::LinePiece& p = pieces.front();
    post_knots(line, {p.middle, p.scale, p.bend, p.stretch}, k, &minor, 1,
               {&at, &slope, &along, &lift, &drop, &ray, &rise});
    return at;
}

/// Bounds of the blocks under a window, from the source's map; none across the seam of a cyclic raster, where blocks do
/// not meet.
void Cover::ask_map(const Side& side, Interval major, Interval minor, Blocks& blocks) {
    blocks.bounds.clear();
    BlockMap* map = params_.cull ? source_.block_map() : nullptr;
    const bool columns = lines_are_columns(side.quadrant);
    const Window window = columns ? Window{major, minor} : Window{minor, major};
    if (!map || window.columns.begin < 0 || window.columns.end > db_.columns) return;
    const BlockWindow known = map->read(0, blocks_of(window));
    blocks.majors = columns ? known.blocks.columns : known.blocks.rows;
    blocks.minors = columns ? known.blocks.rows : known.blocks.columns;
    for (std::int64_t i = blocks.majors.begin; i < blocks.majors.end; ++i)
        for (std::int64_t j = blocks.minors.begin; j < blocks.minors.end; ++j)
            blocks.bounds.push_back(columns ? known.at(i, j) : known.at(j, i));
}

/// What of some rows of blocks need not be read. `only`: the row that counts alone, of the others what its cells reach.
void Cover::leave_out(bool columns, const Blocks& blocks, Interval majors, std::optional<std::int64_t> only,
                      ChunkRequest& request) {
    request.blocks = columns ? Window{majors, blocks.minors} : Window{blocks.minors, majors};
    for (std::int64_t r = request.blocks.rows.begin; r < request.blocks.rows.end; ++r)
        for (std::int64_t c = request.blocks.columns.begin; c < request.blocks.columns.end; ++c) {
            const std::size_t at = columns ? blocks.at(c, r) : blocks.at(r, c);
            const bool counts = !only || *only == (columns ? c : r), all_void = blocks.bounds[at].voids == Voids::all;
            request.skip.push_back(counts ? blocks.skip[at] : all_void ? Skip::voids : Skip::range);
            request.fill_m.push_back(all_void ? nan_f : blocks.bounds[at].lowest_m);
        }
}

/// The same, of posts that were read.
void Cover::look_at(const Chunk& chunk, Interval major, Interval minor, Blocks& blocks) const {
    blocks.bounds.clear();
    if (!hides_ || chunk.flat) return;
    blocks.majors = {block_along(major.begin), block_along(major.end - 1) + 1};
    blocks.minors = {block_along(minor.begin), block_along(minor.end - 1) + 1};
    for (std::int64_t i = blocks.majors.begin; i < blocks.majors.end; ++i)
        for (std::int64_t j = blocks.minors.begin; j < blocks.minors.end; ++j) {
            const Interval lines = intersection(major, {i * block_posts, (i + 1) * block_posts + 1}),
                           posts = intersection(minor, {j * block_posts, (j + 1) * block_posts + 1});
            const PostExtremes extremes = post_extremes(
                chunk.surface_m.data() + (lines.begin - major.begin) * minor.size() + posts.begin - minor.begin,
                static_cast<std::size_t>(minor.size()), static_cast<std::size_t>(lines.size()),
                static_cast<std::size_t>(posts.size()));
            BlockBounds b;
            b.lowest_m = extremes.lowest_m;
            b.highest_m = extremes.highest_m;
            b.voids = b.lowest_m > b.highest_m ? Voids::all : extremes.any_void ? Voids::some : Voids::none;
            blocks.bounds.push_back(b);
        }
}

/// Judges the blocks of one row, of which `lines` are to come, by the horizons that the desk's spokes have now: these
/// only rise, and a spoke between two never gets less than the lower of them. A block is hidden if its highest ground,
/// with a target on it, stays below the spokes that come by, and those beside them: then no sample of it raises a
/// horizon, and no post of it is seen. Heights from the lowest to the highest give the same answers then, so what is
/// not read may have any of them. Leaves the groups of spokes that come by something else; `core`: the run's own spokes.
void Cover::hide(const Side& side, Interval lines, std::int64_t major, Interval core, bool all_posts, Desk& desk) {
    Blocks& blocks = desk.blocks;
    const Spokes& s = desk.spokes;
    const Quadrant q = side.quadrant;
    for (std::int64_t j = blocks.minors.begin; j < blocks.minors.end; ++j)
        blocks.skip[blocks.at(major, j)] = blocks.bounds[blocks.at(major, j)].voids == Voids::all ? Skip::voids
                                           : all_posts                                            ? Skip::none
                                                                                                  : Skip::range;
    const auto expose = [&](std::int64_t j) {
        Skip& skip = blocks.skip[blocks.at(major, j)];
        if (skip != Skip::voids) skip = Skip::none;
    };
    // A line more on either side, for the cells that reach into the row.
    if (lines.begin < 1 || grid_.distance(q, lines.begin) < 3) {
        for (std::int64_t j = blocks.minors.begin; j < blocks.minors.end; ++j) expose(j);
        desk.groups = {{0, s.range.size() / knot}};
        return;
    }
    const LineForm near = form(side, grid_.distance(q, lines.begin) - 1),
                   far = form(side, grid_.distance(q, lines.end - 1) + 1);
    const std::int64_t growth = s.of / side.spokes.of, groups = s.range.size() / knot;
    place_knots(side, far, s, {0, groups}, desk);
    std::swap(desk.at, desk.far_at);
    std::swap(desk.lift, desk.far_lift);
    place_knots(side, near, s, {0, groups}, desk);
    // Spokes beyond the fan are nobody's; nor are those that doublings brought beyond it, of which the last has one parent.
    const Interval carried =
        intersection({side.spokes.range.begin * growth, side.spokes.range.end * growth}, fan(side, s.of));
    // Of the run's neighbours one group on either side counts: at a doubling those outside have only one parent.
    const Interval counted =
        intersection({(core.begin - s.range.begin) / knot - 1, (core.end - s.range.begin) / knot + 1}, {0, groups});
    const auto in_fan = [&](std::int64_t g) {
        return counted.contains(g) && carried.contains(s.range.begin + g * knot);
    };
    desk.least.resize(static_cast<std::size_t>(groups));
    least_of_groups(s.horizon.data(), desk.least.size(), desk.least.data());
    // Far above what float's rounding, and straight lines between knots, make of a tangent.
    constexpr double slack = 0x1p-14;
    const double spokes = static_cast<double>(s.of),
                 bow = std::abs(bow_per_slope(near)) * (0.25 * knot * knot) / (spokes * spokes);
    const double raised_m = params_.target_m + blocks.relief_m * 8 * static_cast<double>(place_slack);
    desk.touched.assign(static_cast<std::size_t>(groups), {});
    for (std::int64_t g = 0; g < groups; ++g) {
        if (!in_fan(g)) continue;
        float least = desk.least[static_cast<std::size_t>(g)];
        for (const std::int64_t beside : {g - 1, g + 1})
            if (in_fan(beside)) least = std::min(least, desk.least[static_cast<std::size_t>(beside)]);
        const auto i = static_cast<std::size_t>(g);
        const Interval touched =
            intersection({block_along(floor_i(std::min(desk.at[i], desk.far_at[i])) - 3),
                          block_along(ceil_i(std::max(desk.at[i + 1], desk.far_at[i + 1])) + 3) + 1},
                         blocks.minors);
        desk.touched[i] = touched;
        const double steep = static_cast<double>(std::max(desk.lift[i], desk.lift[i + 1])),
                     gentle = static_cast<double>(std::min(desk.far_lift[i], desk.far_lift[i + 1])),
                     drop = static_cast<double>(std::min(desk.drop[i], desk.drop[i + 1])) - bow;
        bool judged = hides_ && has(least);
        if (judged && scene_.range_limited) {
            // All that a block holds must be in range, whatever its height.
            const auto metres = [&](std::int64_t k) {
                const double m = static_cast<double>(k) / spokes;
                return std::sqrt(side.square[0] + m * (side.square[1] + m * side.square[2]));
            };
            const std::int64_t k = s.range.begin + g * knot;
            const double arc = 1.03 * std::max(metres(k), metres(k + knot)) / gentle;
            judged = arc * (1 + arc * scene_.earth.inverse_radius()) + 2 * std::abs(scene_.sensor_m) +
                         2 * blocks.most_m + params_.target_m <
                     *scene_.scene.range_m;
        }
        for (std::int64_t j = touched.begin; j < touched.end; ++j) {
            Skip& skip = blocks.skip[blocks.at(major, j)];
            if (skip == Skip::none || skip == Skip::voids) continue;
            const BlockBounds& b = blocks.bounds[blocks.at(major, j)];
            const double top_m = static_cast<double>(b.highest_m) + static_cast<double>(b.culture_m) + raised_m,
                         w = (top_m - static_cast<double>(lift_.sensor_m)) /
                             (1 + top_m * static_cast<double>(lift_.inverse_radius)),
                         highest = w * (w > 0 ? steep : gentle) - drop + slack * (std::abs(w) * steep + drop);
            const bool below = judged && b.voids == Voids::none && highest < static_cast<double>(least);
            skip = below ? Skip::hidden : Skip::none;
        }
    }
    desk.groups.clear();
    for (std::int64_t g = counted.begin; g < counted.end; ++g) {
        bool rises = !in_fan(g);
        const Interval touched = desk.touched[static_cast<std::size_t>(g)];
        for (std::int64_t j = touched.begin; j < touched.end && !rises; ++j)
            rises = blocks.skip[blocks.at(major, j)] == Skip::none;
        if (!rises) continue;
        // Runs that all but meet are one.
        if (!desk.groups.empty() && g - desk.groups.back().end < 4)
            desk.groups.back().end = g + 1;
        else
            desk.groups.push_back({g, g + 1});
    }
}

/// Parts of a line's posts, whole groups but for the ends, with why they need no test.
void Cover::part_line(Interval posts, std::int64_t row, Desk& desk) const {
    const Blocks& blocks = desk.blocks;
    desk.parts.clear();
    if (blocks.empty()) return desk.parts.push_back({posts, Skip::none});
    for (std::int64_t j = posts.begin; j < posts.end;) {
        const std::int64_t block = block_along(j), end = std::min(posts.end, (block + 1) * block_posts);
        const Skip why = blocks.minors.contains(block) ? blocks.skip[blocks.at(row, block)] : Skip::none;
        if (!desk.parts.empty() && desk.parts.back().second == why)
            desk.parts.back().first.end = end;
        else
            desk.parts.push_back({{j, end}, why});
        j = end;
    }
}

/// Of the post right below: as of level ground.
float Cover::nadir_response(std::int64_t column, std::int64_t row, double above_m) {
    Desk& desk = desks_.local();
    desk.culture_m = {};
    const SightLine down{-above_m, 0, std::abs(above_m), above_m > 0 ? -1.0 : 1.0};
    return response(sides_[0], 0, column, row, {1, 1}, down, scene_.earth.inverse_radius(), desk);
}

/// Carries the void state of every spoke over a line, by the positions on it and on the line behind.
void Cover::pass_voids(Desk& desk, Interval window, bool behind) {
    Spokes& s = desk.spokes;
    const float* line = desk.line.data() + line_margin - window.begin;
    const float* before = desk.behind.data() + line_margin - window.begin;
    const auto inside = [&](std::int64_t j) { return j >= window.begin && j < window.end; };
    for (std::size_t i = 0; i < s.count(); ++i) {
        const std::size_t g = i / knot_step;
        const double part = static_cast<double>(i % knot_step) / knot_step;
        const double y = desk.at[g] + part * (desk.at[g + 1] - desk.at[g]);
        const std::int64_t c = floor_i(y), next = y > static_cast<double>(c) ? c + 1 : c;
        if (!inside(c) || !inside(next)) continue;  // ground outside the data base hides nothing
        const auto is_void = [](float z) { return z != z; };
        const bool now = is_void(line[c]) || is_void(line[next]);
        float& top = s.voids.top[i];
        const bool open = top == top && (top > -std::numeric_limits<float>::infinity() || s.voids.lift[i] > 0);
        if (!now && !open) continue;
        const float lift = desk.lift[g] + static_cast<float>(part) * (desk.lift[g + 1] - desk.lift[g]),
                    drop = desk.drop[g] + static_cast<float>(part) * (desk.drop[g + 1] - desk.drop[g]);
        if (!open) s.voids.lift[i] = lift, s.voids.drop[i] = drop;
        for (std::int64_t j : {c, next})
            if (!is_void(line[j])) top = std::max(top, line[j]);
        if (behind) {
            const double y0 = desk.at_behind[g] + part * (desk.at_behind[g + 1] - desk.at_behind[g]);
            const std::int64_t b = floor_i(y0);
            for (std::int64_t j : {b, y0 > static_cast<double>(b) ? b + 1 : b})
                if (inside(j) && !is_void(before[j])) top = std::max(top, before[j]);
        }
        if (top > -std::numeric_limits<float>::infinity()) {
            const float w = lift_.w(top - lift_.sensor_m);
            s.voids.tangent[i] = std::max({s.voids.tangent[i], w * lift - drop, w * s.voids.lift[i] - s.voids.drop[i]});
        }
        if (!now) {
            top = -std::numeric_limits<float>::infinity();
            s.voids.lift[i] = 0;
        }
    }
}

/// Posts of a line, whose knots stand on the desk, test themselves.
void Cover::test_part(const LineForm& line, const Spokes& s, Interval posts, Interval window, Desk& desk) const {
    TestLanes test{};
    test.groups = desk.from.size() - 1;
    test.origin = window.begin - line_margin;
    test.first = floor_to(posts.begin, knot);
    test.from = desk.from.data();
    test.at = desk.post_at.data();
    test.lift = desk.post_lift.data();
    test.drop = desk.post_drop.data();
    test.ray = desk.post_ray.data();
    test.rise = desk.post_rise.data();
    test.nadir = line.nadir_minor;
    test.distance = line.distance;
    test.bow = bow_per_slope(line) / (static_cast<double>(s.of) * static_cast<double>(s.of));
    test.posts = desk.line.data();
    test.behind = desk.behind.data();
    test.horizon = s.horizon.data();
    test.first_spoke = s.range.begin;
    test.spokes = static_cast<std::int32_t>(s.range.size());
    test.nearest = line.distance <= 1;
    test.target_m = static_cast<float>(params_.target_m);
    test.state = desk.state.data();
    test.raise_m = params_.layer == CoverageLayer::height || voids_ ? desk.raise_m.data() : nullptr;
    test.tangent = voids_ ? desk.tangent.data() : nullptr;
    test_lanes(test, lift_);
}

/// The run's posts of a line, from their state to what the layer holds.
Cover::Facet Cover::facet(const Side& side, const LineForm& line, double slope, double z, double behind, double beside,
                          double arc_m, double inverse_radius, const SightLine& sight) {
    // The gradient of the own cell at the post, by the metric at the sensor.
    const double along = z - behind, across = slope < 0 ? beside - z : z - beside;
    const double along_z = along == along ? along : 0, across_z = across == across ? across : 0;
    // Metric of index space: |(a, b)|^2 = g0 a^2 + g1 a b + g2 b^2; gradient squared is by its
    // inverse; the rise along the ray by the arc of one line.
    const double g0 = side.square[0], g1 = side.square[1], g2 = side.square[2];
    const double det = g0 * g2 - 0.25 * g1 * g1;
    const double steep = (g2 * along_z * along_z - g1 * along_z * across_z + g0 * across_z * across_z) / det;
    const double rise = (along_z + slope * across_z) * line.distance / arc_m;
    // The ray at the post: depression less the angle between the two verticals.
    const double angle = std::atan2(-sight.up_m, sight.out_m) - arc_m * inverse_radius;
    const double secant = std::sqrt(1 + steep);
    return {facet_sine(std::sin(angle), std::cos(angle), rise, secant), secant};
}

float Cover::response(const Side& side, double slope, std::int64_t index, std::int64_t post, const Facet& facet,
                      const SightLine& sight, double inverse_radius, Desk& desk) const {
    if (!(facet.sine > 0)) return nan_f;
    Culture& culture = culture_of(desk);
    const bool columns = lines_are_columns(side.quadrant);
    const double column = static_cast<double>(columns ? index : post), row = static_cast<double>(columns ? post : index);
    const std::int64_t cell_column = floor_i(culture.cell_column(column)), cell_row = floor_i(culture.cell_row(row));
    const ClassId id = culture.at(cell_column, cell_row);
    if (id == unknown_class) {
        const std::int32_t code = culture.code(cell_column, cell_row);
        if (!desk.unknown_code || code < *desk.unknown_code) desk.unknown_code = code;
        return nan_f;
    }
    const bool wall = !desk.culture_m.empty() && desk.culture_m[static_cast<std::size_t>(post - desk.culture_begin)] > 0;
    const ClassLaws& laws = tables_->laws;
    const double variable = law_variable(facet.sine);
    double factor;
    if (laws.directional()) {
        const double azimuth = map_.azimuth_rad(side.quadrant, slope), east = rounded(std::sin(azimuth), angle_bits),
                     north = rounded(std::cos(azimuth), angle_bits);
        factor = wall ? laws.wall(id, east, north) : laws.ground(id, variable, east, north);
    } else {
        factor = wall ? laws.wall(id) : laws.ground(id, variable);
    }
    const double g0 = side.square[0], g1 = side.square[1], g2 = side.square[2];
    const double sigma = factor * facet.sine * std::sqrt(g0 * g2 - 0.25 * g1 * g1) * facet.secant,
                 r2 = std::max(1.0, sight.range_m * sight.range_m);
    double power = radar_constant_ * tables_->pattern.at(sight.sine) * sigma / (r2 * r2);
    if (loss_) power *= loss_->factor(sight.range_m, sight.sine, inverse_radius);
    if (!(power > 0)) return nan_f;
    return static_cast<float>(rounded(10 * std::log10(power) + 30, 20));
}

void Cover::finish_line(const Side& side, const LineForm& line, std::int64_t index, Interval posts, Interval window,
                        Desk& desk, std::size_t out) {
    const std::int64_t first = floor_to(posts.begin, knot);
    std::uint8_t* state = desk.state.data() + line_margin - window.begin;
    const float* height = desk.line.data() + line_margin - window.begin;
    const float* back = desk.behind.data() + line_margin - window.begin;
    const float* raise = desk.raise_m.data() + line_margin - window.begin;
    const float* tangent = desk.tangent.data() + line_margin - window.begin;
    std::uint8_t* bytes = bytes_ ? desk.bytes.data() + out : nullptr;
    float* values = bytes_ ? nullptr : desk.values.data() + out;
    constexpr auto outside = static_cast<std::uint8_t>(State::outside), seen = static_cast<std::uint8_t>(State::seen),
                   no_data = static_cast<std::uint8_t>(State::no_data);
    if (values && !limited_ && params_.layer == CoverageLayer::height) {
        for (std::int64_t j = posts.begin; j < posts.end; ++j)
            values[j - posts.begin] = state[j] == no_data ? nan_f : raise[j];
    } else if (with_posts_ || voids_) {
        for (std::int64_t j = posts.begin; j < posts.end; ++j) {
            const auto g = static_cast<std::size_t>((j - first) / knot);
            const double width = desk.from[g + 1] - desk.from[g],
                         part = width > 0 ? (static_cast<double>(j) - desk.from[g]) / width : 0;
            const auto between = [&](const auto& v) {
                return static_cast<double>(v[g]) + part * (static_cast<double>(v[g + 1]) - static_cast<double>(v[g]));
            };
            std::uint8_t& s = state[j];
            if (voids_ && s == seen) {
                const double k = between(desk.post_at) - static_cast<double>(desk.spokes.range.begin);
                const auto at =
                    static_cast<std::size_t>(std::clamp<std::int64_t>(floor_i(k), 0, desk.spokes.range.size() - 2));
                const float f = static_cast<float>(k - static_cast<double>(at)), a = desk.spokes.voids.tangent[at],
                            b = desk.spokes.voids.tangent[at + 1];
                const float bar = has(a) && has(b) ? a + f * (b - a) : std::max(a, b);
                if (tangent[j] < bar) s = static_cast<std::uint8_t>(State::unknown);
            }
            if (!with_posts_) continue;
            const double m = between(desk.post_slope);
            if (scene_.scene.sector) {
                bool in = false;
                for (const auto& [lo, hi] : side.sector) in = in || (m >= lo && m <= hi);
                if (!in) s = outside;
            }
            const double z = static_cast<double>(height[j]);
            const double squared = side.square[0] + m * (side.square[1] + m * side.square[2]),
                         bent = side.curvature[0] + m * (side.curvature[1] + m * side.curvature[2]);
            const double inverse_radius = bent / squared, arc = between(desk.post_along) * std::sqrt(squared);
            // A void's place in range is that of the level surface at the reference height.
            const double top = s == no_data || z != z ? scene_.reference_m : z + params_.target_m;
            const SightLine sight = sight_line(scene_.sensor_m, arc, top, inverse_radius);
            if (with_range_ && !(sight.range_m <= *scene_.scene.range_m &&
                                 sight.range_m >= scene_.scene.range_start_m && arc <= farthest_m_))
                s = outside;
            if (params_.elevation && s != no_data &&
                !(sight.up_m >= least_tangent_ * sight.out_m && sight.up_m <= most_tangent_ * sight.out_m))
                s = outside;
            if (bytes_) continue;
            float value = nan_f;
            if (s != outside && s != no_data) switch (params_.layer) {
                    case CoverageLayer::height:
                        value = raise[j];
                        break;
                    case CoverageLayer::range:
                        value = static_cast<float>(sight.range_m);
                        break;
                    case CoverageLayer::depression:
                        value = static_cast<float>(
                            rounded(std::atan2(-sight.up_m, sight.out_m) * (180 / std::numbers::pi), 30));
                        break;
                    case CoverageLayer::response:
                        if (s == static_cast<std::uint8_t>(State::shadow)) break;
                        [[fallthrough]];
                    case CoverageLayer::grazing: {
                        const double slope = (static_cast<double>(j) - line.nadir_minor) / line.distance;
                        const double beside = static_cast<double>(slope < 0 ? height[j + 1] : height[j - 1]);
                        const Facet own = facet(side, line, slope, z, static_cast<double>(back[j]), beside, arc,
                                                inverse_radius, sight);
                        value = params_.layer == CoverageLayer::response
                                    ? response(side, m, index, j, own, sight, inverse_radius, desk)
                                    : static_cast<float>(rounded(
                                          std::asin(std::clamp(own.sine, -1.0, 1.0)) * (180 / std::numbers::pi), 30));
                        break;
                    }
                    default:
                        break;
                }
            values[j - posts.begin] = value;
        }
    }
    const std::uint8_t* from = state + posts.begin;
    const auto n = static_cast<std::size_t>(posts.size());
    count_states(from, n, desk.states);
    if (!bytes_) return;
    if (params_.layer == CoverageLayer::states)
        std::copy(from, from + n, bytes);
    else
        paint_mask(from, n, {byte_of(0), byte_of(1), byte_of(2), byte_of(3), byte_of(4)}, bytes);
}

/// From the desk into the tiles. Runs own different posts, so nobody waits.
void Cover::copy_out(const Strip& strip, Interval window, Desk& desk) {
    const Side& side = *strip.side;
    const Interval lines = strip.lines;
    const auto width = static_cast<std::size_t>(window.size());
    const auto copy = [&]<class T>(const T* from) {
        const auto tile = [&](std::int64_t row, std::int64_t column) {
            return tiles_.buffer<T>(*strip.tiles.find({row / tile_edge, column / tile_edge})->second);
        };
        if (lines_are_columns(side.quadrant))
            copy_columns(side, lines, from, width, tile, desk);
        else
            copy_rows(side, lines, from, width, tile, desk);
    };
    if (bytes_)
        copy(static_cast<const std::uint8_t*>(desk.bytes.data()));
    else
        copy(static_cast<const float*>(desk.values.data()));
}

/// Some rows of all lines, then the next ones: so a tile's rows stay in the cache.
template <class T, class TileOf>
void Cover::copy_columns(const Side& side, Interval lines, const T* from, std::size_t width, TileOf&& tile,
                         const Desk& desk) const {
    constexpr std::int64_t together = 64;
    const auto source = [&](std::int64_t line, std::int64_t row) {
        const auto l = static_cast<std::size_t>(line);
        return from + l * width + (row - desk.own[l].begin);
    };
    Interval rows;
    for (const Interval& own : desk.own)
        if (!own.empty()) rows = rows.empty() ? own : hull(rows, own);
    for (std::int64_t row = rows.begin; row < rows.end;) {
        const std::int64_t end = std::min(rows.end, floor_to(row, together) + together);
        for (std::int64_t l = 0; l < lines.size(); l += 16) {
            const std::int64_t l_end = std::min(lines.size(), l + 16);
            Interval all = {row, end};  // that each of the lines has
            for (std::int64_t i = l; i < l_end; ++i) all = intersection(all, desk.own[static_cast<std::size_t>(i)]);
            if (!std::is_same_v<T, std::uint8_t> || db_.cyclic || l_end - l < 16 || all.empty()) all = {row, row};
            if constexpr (std::is_same_v<T, std::uint8_t>)
                if (!all.empty()) {
                    std::array<const std::uint8_t*, 16> side_by_side;
                    const std::int64_t first = std::min(grid_.line_index(side.quadrant, lines.begin + l),
                                                        grid_.line_index(side.quadrant, lines.begin + l_end - 1));
                    for (std::int64_t i = l; i < l_end; ++i)
                        side_by_side[static_cast<std::size_t>(grid_.line_index(side.quadrant, lines.begin + i) -
                                                              first)] = source(i, all.begin);
                    transpose_bytes(side_by_side, static_cast<std::size_t>(all.size()),
                                    tile(row, first) + (all.begin % tile_edge) * tile_edge + first % tile_edge,
                                    static_cast<std::size_t>(tile_edge));
                }
            for (std::int64_t i = l; i < l_end; ++i) {
                const Interval own = intersection(desk.own[static_cast<std::size_t>(i)], {row, end});
                for (const Interval part : {Interval{own.begin, std::min(own.end, all.begin)},
                                            Interval{std::max(own.begin, all.end), own.end}}) {
                    if (part.empty()) continue;
                    const T* cells = source(i, part.begin);
                    for (std::int64_t column :
                         same_columns(real_column(grid_.line_index(side.quadrant, lines.begin + i)))) {
                        T* cell = tile(row, column) + (part.begin % tile_edge) * tile_edge + column % tile_edge;
                        for (std::int64_t j = 0; j < part.size(); ++j) cell[j * tile_edge] = cells[j];
                    }
                }
            }
        }
        row = end;
    }
}

template <class T, class TileOf>
void Cover::copy_rows(const Side& side, Interval lines, const T* from, std::size_t width, TileOf&& tile,
                      const Desk& desk) const {
    for (std::int64_t l = 0; l < lines.size(); ++l) {
        const Interval own = desk.own[static_cast<std::size_t>(l)];
        const T* source = from + static_cast<std::size_t>(l) * width;
        const std::int64_t index = grid_.line_index(side.quadrant, lines.begin + l),
                           row = (index % tile_edge) * tile_edge;
        for (std::int64_t j = own.begin; j < own.end;) {
            const std::int64_t real = real_column(j);
            std::int64_t end = std::min(own.end, j + tile_edge - real % tile_edge);
            if (db_.cyclic) end = std::min(end, j + db_.cycle_columns - real);
            std::copy(source + (j - own.begin), source + (end - own.begin), tile(index, real) + row + real % tile_edge);
            if (db_.cyclic && real == 0 && db_.columns > db_.cycle_columns)
                tile(index, db_.cycle_columns)[row + db_.cycle_columns % tile_edge] = source[j - own.begin];
            j = end;
        }
    }
}

void Cover::sweep(Strip& strip, std::size_t run) {
    if (params_.stop) params_.stop->check();
    const Side& side = *strip.side;
    const Interval lines = strip.lines, spokes = strip.runs[run];
    const std::vector<Interval>& own = strip.own;
    const bool first = run == 0, last = run + 1 == strip.runs.size();
    Spokes& after = strip.after;
    const Quadrant q = side.quadrant;
    const bool columns = lines_are_columns(q);
    Desk& desk = desks_.local();
    QuadrantReport& did = desk.did[static_cast<std::size_t>(q)];
    ++did.runs;
    const Span span(params_.timeline, "run", "wedge", static_cast<std::int64_t>(q));
    const Stopwatch all_of_it;
    double load_s = 0;
    // One group of neighbours on either side.
    Spokes& s = desk.spokes;
    s.resize(side.spokes.of, {spokes.begin - knot, spokes.end + knot}, voids_);
    {
        const Interval mine = intersection(s.range, side.spokes.range);
        const auto to = static_cast<std::ptrdiff_t>(mine.begin - s.range.begin),
                   from = static_cast<std::ptrdiff_t>(mine.begin - side.spokes.range.begin);
        const auto take = [&](const std::vector<float>& a, std::vector<float>& b) {
            std::copy(a.begin() + from, a.begin() + from + static_cast<std::ptrdiff_t>(mine.size()), b.begin() + to);
        };
        take(side.spokes.horizon, s.horizon);
        if (voids_) {
            take(side.spokes.voids.tangent, s.voids.tangent);
            take(side.spokes.voids.top, s.voids.top);
            take(side.spokes.voids.lift, s.voids.lift);
            take(side.spokes.voids.drop, s.voids.drop);
        }
    }
    // Posts that the spokes can touch.
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    for (std::int64_t line : {lines.begin, lines.end - 1}) {
        const double d = grid_.distance(q, line);
        const LineForm at = form(side, d);
        place_knots(side, at, s, {0, s.range.size() / knot}, desk);
        lo = std::min(lo, *std::min_element(desk.at.begin(), desk.at.end()));
        hi = std::max(hi, *std::max_element(desk.at.begin(), desk.at.end()));
    }
    Interval window = intersection({floor_i(lo) - 4, ceil_i(hi) + 5}, side.minor);
    for (std::size_t l = 0; l < static_cast<std::size_t>(lines.size()); ++l)
        if (first && last) window = hull(window, own[l]);
    desk.own.assign(static_cast<std::size_t>(lines.size()), {});
    // The line behind the strip too, if the raster has it.
    std::int64_t before = grid_.line_index(q, lines.begin) - outward(q);
    const bool has_before = (db_.cyclic && columns) || (before >= 0 && before < (columns ? db_.columns : db_.rows));
    const std::int64_t a = has_before ? before : before + outward(q), b = grid_.line_index(q, lines.end - 1);
    const Interval major{std::min(a, b), std::max(a, b) + 1};
    // Of a row of blocks the lines that are swept here; where it is only the line behind, that one.
    const auto row_lines = [&](std::int64_t row) {
        const Interval part = intersection({row * block_posts, (row + 1) * block_posts}, major);
        const std::int64_t zero = grid_.line_index(q, 0);
        return outward(q) > 0 ? Interval{part.begin - zero, part.end - zero}
                              : Interval{zero - part.end + 1, zero - part.begin + 1};
    };
    Blocks& blocks = desk.blocks;
    blocks.bounds.clear();
    Chunk chunk;
    Interval held;  // lines of the chunk, as the raster counts them
    const auto load = [&](Interval of_lines, ChunkRequest request) {
        request.window = columns ? Window{of_lines, window} : Window{window, of_lines};
        request.lines_are_columns = columns;
        Span reading(params_.timeline, "load", "wedge", static_cast<std::int64_t>(q));
        const Stopwatch watch;
        chunk = {};
        chunk = source_.load(request);
        reading.add_bytes(chunk.bytes_read);
        load_s += watch.cpu_s();
        did.disk_wait_s += watch.wait_s();
        did.posts_read += chunk.posts_read;
        did.bytes_read += chunk.bytes_read;
        did.bytes_spilled += chunk.bytes_spilled;
        held = of_lines;
        if (!tables_) return;
        if (db_.has_culture) culture_of(desk).open(request.window, false);
    };
    // With a map each row of blocks is read when its turn comes, and what is hidden by then is not.
    bool mapped = false;
    if (!window.empty()) {
        ask_map(side, major, window, blocks);
        mapped = !blocks.empty();
        if (!mapped) {
            load(major, {});
            look_at(chunk, major, window, blocks);
        }
        blocks.measure();
    }
    const auto width = static_cast<std::size_t>(window.size());
    for (auto* v : {&desk.line, &desk.behind, &desk.raise_m, &desk.tangent})
        v->assign(width + 2 * static_cast<std::size_t>(line_margin), nan_f);
    desk.state.assign(desk.line.size(), 0);
    if (bytes_)
        desk.bytes.resize(width * static_cast<std::size_t>(lines.size()));
    else
        desk.values.resize(width * static_cast<std::size_t>(lines.size()));
    const auto take_line = [&](std::int64_t index, std::vector<float>& to) {
        if (width == 0) return;
        const std::int64_t at = chunk.flat ? 0 : index - held.begin;
        const float* from = chunk.surface_m.data() + static_cast<std::size_t>(at) * width;
        std::copy(from, from + width, to.begin() + line_margin);
    };
    const auto take_culture = [&](std::int64_t index) {
        desk.culture_m = {};
        if (chunk.culture_height_m.empty() || width == 0) return;
        const std::int64_t at = chunk.flat ? 0 : index - held.begin;
        desk.culture_m = std::span(chunk.culture_height_m).subspan(static_cast<std::size_t>(at) * width, width);
        desk.culture_begin = window.begin;
    };
    // Which line of the raster each buffer holds, if any: lines that nothing comes of are not copied.
    constexpr std::int64_t no_line = std::numeric_limits<std::int64_t>::min();
    std::int64_t in_line = no_line, in_behind = no_line;
    const auto hold = [&](std::int64_t index, std::vector<float>& buffer, std::int64_t& of) {
        if (of != index && index != no_line) take_line(index, buffer);
        of = index;
    };

    Interval core = spokes;
    const auto& rings = grid_.rings(q);
    std::size_t ring = 0;
    while (ring + 1 < rings.size() && rings[ring + 1].lines.begin <= lines.begin) ++ring;
    const double nadir = map_.nadir_minor(q);
    std::int64_t row = block_along(grid_.line_index(q, lines.begin)) - outward(q);  // of blocks
    bool row_has_voids = true;
    for (std::int64_t line = lines.begin; line < lines.end; ++line) {
        const std::int64_t index = grid_.line_index(q, line), index_behind = line > lines.begin ? index - outward(q)
                                                                             : has_before       ? before
                                                                                                : no_line;
        while (ring + 1 < rings.size() && rings[ring + 1].lines.begin <= line) ++ring;
        const bool next_row = block_along(index) != row;
        if (next_row) {
            const std::int64_t row_behind = row;
            row = block_along(index);
            if (!blocks.empty()) {
                const bool behind_counts = sampling_.cross_lines && index_behind != no_line;
                if (mapped && line == lines.begin && behind_counts && row_behind == block_along(index_behind))
                    hide(side, row_lines(row_behind), row_behind, core, first && last, desk);
                hide(side, intersection(row_lines(row), lines), row, core, first && last, desk);
                const auto from =
                    blocks.bounds.begin() + static_cast<std::ptrdiff_t>(blocks.at(row, blocks.minors.begin));
                row_has_voids = std::any_of(from, from + static_cast<std::ptrdiff_t>(blocks.minors.size()),
                                            [](const BlockBounds& bounds) { return bounds.voids != Voids::none; });
                if (mapped) {
                    const Interval band = intersection(row_lines(row), lines);
                    const std::int64_t near = index_behind != no_line ? index_behind : index,
                                       far = grid_.line_index(q, band.end - 1);
                    const Interval of_lines{std::min(near, far), std::max(near, far) + 1};
                    ChunkRequest request;
                    leave_out(columns, blocks, {block_along(of_lines.begin), block_along(of_lines.end - 1) + 1},
                              behind_counts ? std::nullopt : std::optional(row), request);
                    load(of_lines, std::move(request));
                    // Of the last row's lines the buffers hold what was needed then.
                    in_line = in_behind = no_line;
                }
            }
        }
        bool doubled = line == lines.begin;
        while (s.of < rings[ring].spokes) {
            double_spokes(s, desk.scratch);
            core = {2 * core.begin, 2 * core.end};
            for (Interval& groups : desk.groups) groups = {2 * groups.begin, 2 * groups.end};
            doubled = true;
        }
        const double d = grid_.distance(q, line);
        const LineForm here = form(side, d);
        // On the first line of a row of blocks cells of the last one lie behind.
        const bool cross = sampling_.cross_lines && line > 0,
                   everywhere = blocks.empty() || voids_ || (cross && next_row);
        desk.every_group = {{0, s.range.size() / knot}};
        const std::vector<Interval>& groups = everywhere ? desk.every_group : desk.groups;
        if (cross || voids_) {
            if (line > 0 && (doubled || next_row))
                for (const Interval& part : groups) place_knots(side, form(side, d - 1), s, part, desk);
            std::swap(desk.at, desk.at_behind);
        }
        for (const Interval& part : groups) place_knots(side, here, s, part, desk);

        const auto l = static_cast<std::size_t>(line - lines.begin);
        const Interval all = own[l];
        const auto edge = [&](std::int64_t k) {
            const std::int64_t g = (k - s.range.begin) / knot;
            place_knots(side, here, s, {g, g}, desk);
            return ceil_i(desk.at[static_cast<std::size_t>(g)]);
        };
        const Interval posts{first ? all.begin : std::clamp(edge(core.begin), all.begin, all.end),
                             last ? all.end : std::clamp(edge(core.end), all.begin, all.end)};
        desk.parts.clear();
        if (!posts.empty()) {
            desk.own[l] = posts;
            part_line(posts, row, desk);
        }
        const bool looked_at = std::any_of(desk.parts.begin(), desk.parts.end(),
                                           [&](const auto& part) { return with_posts_ || part.second == Skip::none; });
        if (looked_at || !groups.empty()) {
            if (in_line == index_behind) {
                std::swap(desk.line, desk.behind);
                std::swap(in_line, in_behind);
            }
            hold(index_behind, desk.behind, in_behind);
            hold(index, desk.line, in_line);
        }
        if (tables_ && looked_at) take_culture(index);
        for (const auto& [part, why] : desk.parts) {
            const std::size_t out = l * width + static_cast<std::size_t>(part.begin - posts.begin);
            if (why != Skip::none) {
                did.posts_passed += static_cast<std::uint64_t>(part.size());
                const auto state = static_cast<std::uint8_t>(why == Skip::voids ? State::no_data : State::shadow);
                if (!with_posts_) {
                    desk.states[state] += static_cast<std::uint64_t>(part.size());
                    std::fill_n(desk.bytes.begin() + static_cast<std::ptrdiff_t>(out), part.size(), byte_of(state));
                    continue;
                }
                std::fill_n(desk.state.begin() + (part.begin - window.begin + line_margin), part.size(), state);
            }
            place_posts(side, here, s.of, all, part, desk);
            if (why == Skip::none) test_part(here, s, part, window, desk);
            finish_line(side, here, index, part, window, desk, out);
        }
        if (width > 0) {
            if (voids_ && (row_has_voids || next_row)) pass_voids(desk, window, line > 0);
            RaiseLanes raise{};
            raise.origin = window.begin - line_margin;
            raise.posts = desk.line.data();
            raise.behind = desk.behind.data();
            raise.distance = static_cast<float>(d);
            raise.bow =
                static_cast<float>(bow_per_slope(here) / (static_cast<double>(s.of) * static_cast<double>(s.of)));
            for (const Interval& part : groups) {
                // Groups that touch the window; the others meet no ground.
                auto g = static_cast<std::size_t>(part.begin), end = static_cast<std::size_t>(part.end);
                while (g < end && desk.at[g + 1] <= static_cast<double>(window.begin - 1)) ++g;
                while (end > g && desk.at[end - 1] >= static_cast<double>(window.end)) --end;
                raise.groups = end - g;
                raise.at = desk.at.data() + g;
                raise.at_behind = cross ? desk.at_behind.data() + g : raise.at;
                raise.lift = desk.lift.data() + g;
                raise.drop = desk.drop.data() + g;
                raise.horizon = s.horizon.data() + g * knot_step;
                raise_lanes(raise, lift_, cross);
            }
        }
        // Where spokes leave the raster, the first one outside is a neighbour of the last posts inside: it follows.
        const auto follow = [&](std::int64_t outside, std::int64_t inside) {
            if (s.range.contains(outside) && s.range.contains(inside))
                s.horizon[static_cast<std::size_t>(outside - s.range.begin)] =
                    s.horizon[static_cast<std::size_t>(inside - s.range.begin)];
        };
        if (!(db_.cyclic && !columns)) {
            if (window.begin == side.minor.begin && nadir >= 0 && nadir < d * 1.5) {
                const std::int64_t outside = ceil_i(spoke_at(side, here, s.of, 0)) - 1;
                follow(outside, outside + 1);
            }
            const auto top = static_cast<double>(side.minor.end - 1);
            if (window.end == side.minor.end && nadir <= top && top - nadir < d * 1.5) {
                const std::int64_t outside = floor_i(spoke_at(side, here, s.of, top)) + 1;
                follow(outside, outside - 1);
            }
        }
    }
    // The run's own spokes go on to the next strip.
    const Interval mine = intersection(core, after.range);
    const auto from = static_cast<std::ptrdiff_t>(mine.begin - s.range.begin),
               to = static_cast<std::ptrdiff_t>(mine.begin - after.range.begin);
    const auto give = [&](const std::vector<float>& x, std::vector<float>& y) {
        if (!mine.empty())
            std::copy(x.begin() + from, x.begin() + from + static_cast<std::ptrdiff_t>(mine.size()), y.begin() + to);
    };
    give(s.horizon, after.horizon);
    if (voids_) {
        give(s.voids.tangent, after.voids.tangent);
        give(s.voids.top, after.voids.top);
        give(s.voids.lift, after.voids.lift);
        give(s.voids.drop, after.voids.drop);
    }
    copy_out(strip, window, desk);
    if (desk.culture) {
        const Culture::Cost& cost = desk.culture->cost();
        load_s += cost.cpu_s - desk.counted.cost.cpu_s;
        did.disk_wait_s += cost.wait_s - desk.counted.cost.wait_s;
        did.bytes_read += desk.culture->bytes_read() - desk.counted.bytes_read;
        did.bytes_spilled += desk.culture->bytes_spilled() - desk.counted.bytes_spilled;
        desk.counted = {cost, desk.culture->bytes_read(), desk.culture->bytes_spilled()};
    }
    did.load_s += load_s;
    did.sweep_s += all_of_it.cpu_s() - load_s;
}

/// The nearest first, so that what a diagonal cuts waits least.
void Cover::order_strips() {
    std::array<std::int64_t, 4> next{};
    for (std::size_t q = 0; q < 4; ++q) next[q] = sides_[q].tile;
    for (;;) {
        double least = std::numeric_limits<double>::infinity();
        std::size_t nearest = 4;
        for (std::size_t q = 0; q < 4; ++q) {
            const Side& side = sides_[q];
            if (next[q] == side.tile_end) continue;
            const double edge = static_cast<double>((next[q] + (outward(side.quadrant) > 0 ? 1 : 0)) * tile_edge),
                         reach = std::abs(edge - map_.nadir_major(side.quadrant));
            if (reach < least) least = reach, nearest = q;
        }
        if (nearest == 4) return;
        strips_.push_back(std::make_unique<Strip>(sides_[nearest], next[nearest]));
        next[nearest] += outward(sides_[nearest].quadrant);
    }
}

/// Begins what can be begun: strips whose quadrant has come so far, not too many ahead of the first that is not done,
/// and none while the writer is behind.
void Cover::go_on() {
    if (over_) return;  // something has gone wrong
    for (std::size_t i = counted_; i < std::min(strips_.size(), counted_ + strips_ahead_); ++i) {
        if (waiting_ + tiles_.done_count() > strips_ahead_ * tiles_across()) return;
        Strip& strip = *strips_[i];
        if (strip.begun || strip.side->busy) continue;
        strip.begun = strip.side->busy = true;
        queue({Job::Kind::begin, &strip});
    }
    if (counted_ == strips_.size() && !writing_) {
        over_ = true;
        changed_.notify_all();
    }
}

void Cover::queue(Job job, bool first) {
    first ? jobs_.push_front(job) : jobs_.push_back(job);
    changed_.notify_one();
}

/// What each thread does until all is done or something has gone wrong.
void Cover::work() {
    for (;;) {
        Job job;
        {
            std::unique_lock lock(mutex_);
            changed_.wait(lock, [&] { return over_ || !jobs_.empty(); });
            if (over_) return;
            job = jobs_.front();
            jobs_.pop_front();
        }
        try {
            switch (job.kind) {
                case Job::Kind::begin:
                    begin(*job.strip);
                    break;
                case Job::Kind::sweep:
                    sweep(*job.strip, job.run);
                    if (--job.strip->left == 0) end(*job.strip);
                    break;
                case Job::Kind::write:
                    write_done();
                    break;
            }
        } catch (...) {
            const std::lock_guard lock(mutex_);
            if (!error_) error_ = std::current_exception();
            over_ = true;
            changed_.notify_all();
        }
    }
}

void Cover::begin(Strip& strip) {
    prepare(strip);
    if (strip.runs.empty()) return end(strip);
    const std::lock_guard lock(mutex_);
    strip.left = strip.runs.size();
    for (std::size_t i = 0; i < strip.runs.size(); ++i) queue({Job::Kind::sweep, &strip, i});
}

/// Its lines, whose posts they are, and its runs.
void Cover::prepare(Strip& strip) {
    const Side& side = *strip.side;
    const Quadrant q = side.quadrant;
    Interval indices;
    strip.lines = tile_lines(side, strip.tile, indices);
    const Interval lines = strip.lines;
    strip.own.resize(static_cast<std::size_t>(lines.size()));
    std::vector<CoverageTiles::Key> crossed;  // by spokes
    if (lines_are_columns(q)) {
        // The strip's columns lie in one tile of the raster, or in two where it closes the circle.
        std::map<std::int64_t, std::vector<std::int64_t>> posts;  // by column of tiles: of each of its tiles
        for (std::int64_t line = lines.begin; line < lines.end; ++line) {
            const std::int64_t column = real_column(grid_.line_index(q, line));
            const Interval rows = own_[static_cast<std::size_t>(column)];
            strip.own[static_cast<std::size_t>(line - lines.begin)] = rows;
            for (std::int64_t c : same_columns(column)) {
                std::vector<std::int64_t>& of = posts[c / tile_edge];
                of.resize(static_cast<std::size_t>(db_.rows / tile_edge + 1));
                for (std::int64_t r = rows.begin; r < rows.end;) {
                    const std::int64_t end = std::min(rows.end, floor_to(r, tile_edge) + tile_edge);
                    of[static_cast<std::size_t>(r / tile_edge)] += end - r;
                    r = end;
                }
            }
        }
        for (const auto& [column, of] : posts)
            for (std::size_t row = 0; row < of.size(); ++row)
                if (of[row] > 0) {
                    crossed.emplace_back(static_cast<std::int64_t>(row), column);
                    strip.posts[crossed.back()] = of[row];
                }
    } else {
        // The fan of each row, without what belongs to east and west; all else in the row is outside.
        for (std::int64_t line = lines.begin; line < lines.end; ++line) {
            const std::int64_t row = grid_.line_index(q, line);
            const auto theirs = [&](std::int64_t c) {
                return own_[static_cast<std::size_t>(real_column(c))].contains(row);
            };
            Interval fan = widest_fan(side, line);
            while (!fan.empty() && theirs(fan.begin)) ++fan.begin;
            while (!fan.empty() && theirs(fan.end - 1)) --fan.end;
            strip.own[static_cast<std::size_t>(line - lines.begin)] = fan;
            for (std::int64_t c = fan.begin; c < fan.end; c += tile_edge - real_column(c) % tile_edge)
                for (std::int64_t same : same_columns(real_column(c)))
                    crossed.emplace_back(strip.tile, same / tile_edge);
            if (!fan.empty()) crossed.emplace_back(strip.tile, real_column(fan.end - 1) / tile_edge);
        }
        for (std::int64_t tc = tile_of(reached_.columns.begin); tc * tile_edge < reached_.columns.end; ++tc) {
            std::int64_t posts = 0;
            for (std::int64_t c = tc * tile_edge; c < std::min(db_.columns, (tc + 1) * tile_edge); ++c)
                posts += indices.size() - intersection(own_[static_cast<std::size_t>(c)], indices).size();
            strip.posts[{strip.tile, tc}] = posts;
        }
    }
    const bool nadir = q == Quadrant::south && indices.contains(floor_i(scene_.nadir.row));
    if (nadir)
        for (std::int64_t c : same_columns(real_column(floor_i(scene_.nadir.column))))
            if (c >= 0 && c < db_.columns) crossed.emplace_back(strip.tile, c / tile_edge);
    std::sort(crossed.begin(), crossed.end());
    crossed.erase(std::unique(crossed.begin(), crossed.end()), crossed.end());
    {
        const std::lock_guard lock(mutex_);
        for (const CoverageTiles::Key& key : crossed) strip.tiles[key] = &tiles_.at(key);
    }
    if (nadir) put_nadir(strip);
    if (lines.empty()) return;
    const auto& rings = grid_.rings(q);
    std::size_t ring = 0;
    while (ring + 1 < rings.size() && rings[ring + 1].lines.begin <= lines.end - 1) ++ring;
    const std::int64_t k = rings[ring].spokes, growth = k / side.spokes.of;
    strip.after.resize(k, fan(side, k), voids_);
    const std::int64_t step = std::max(knot, run_spokes / growth);
    const Interval all = side.spokes.range;
    for (std::int64_t at = all.begin; at < all.end;) {
        const std::int64_t end = std::min(all.end, floor_to(at + knot, step) + step);  // none of one group
        strip.runs.push_back({at, end});
        at = end;
    }
}

/// Its posts are known when those of all strips before it are: so tiles go out in the same order every time.
void Cover::end(Strip& strip) {
    const std::lock_guard lock(mutex_);
    if (!strip.lines.empty()) strip.side->spokes = std::move(strip.after);
    strip.swept = true;
    strip.side->busy = false;
    for (; counted_ < strips_.size() && strips_[counted_]->swept; ++counted_) {
        for (const auto& [key, posts] : strips_[counted_]->posts) tiles_.known(key, posts);
        strips_[counted_].reset();
    }
    if (counted_ == strips_.size() && tiles_.unfinished() > 0)
        throw std::logic_error("coverage: a post belongs to no quadrant");
    if (params_.timeline && !params_.beside_others) params_.timeline->memory(held_bytes(threads_));
    if (params_.progress) params_.progress(static_cast<double>(counted_) / static_cast<double>(strips_.size()));
    if (tiles_.any_done() && !writing_) {
        writing_ = true;
        queue({Job::Kind::write}, true);
    }
    go_on();
}

void Cover::write_done() {
    const Span span(params_.timeline, "write", "stage");
    const Stopwatch watch;
    for (;;) {
        std::vector<CoverageTiles::Done> done;
        {
            const std::lock_guard lock(mutex_);
            done = tiles_.take_done();
            waiting_ = done.size();
            if (done.empty()) {
                writing_ = false;
                write_s_ += watch.wall_s();
                return go_on();
            }
        }
        tiles_.hand_out(std::move(done), [&](const CoverageTile& tile) {
            if (params_.stop) params_.stop->check();
            (*write_)(tile);
        });
        const std::lock_guard lock(mutex_);
        waiting_ = 0;
        go_on();
    }
}

CoverageReport Cover::run() {
    const auto start = std::chrono::steady_clock::now();
    CoverageReport report;
    report.threads = params_.threads > 0 ? params_.threads : tbb::this_task_arena::max_concurrency();
    const auto needed = [&] {
        return fixed_bytes(strips_ahead_) + source_.cache_bytes() +
               desk_bytes() * static_cast<std::size_t>(report.threads);
    };
    while (strips_ahead_ > 1 && needed() > params_.memory_bytes) --strips_ahead_;
    while (report.threads > 1 && needed() > params_.memory_bytes) --report.threads;
    report.peak_budget_bytes = needed();
    threads_ = report.threads;
    if (params_.timeline && !params_.beside_others) params_.timeline->memory(held_bytes(threads_));
    if (params_.layer == CoverageLayer::response) {
        tables_ = std::make_unique<SceneTables>(scene_.scene);
        loss_ = loss_table(scene_, tables_->weather, *scene_.scene.range_m);
        radar_constant_ = radar_constant(scene_.scene.radar);
    }
    order_strips();
    Threads threads(threads_, !params_.beside_others);
    threads.execute([&] {
        handover_.pass();
        {
            const std::lock_guard lock(mutex_);
            go_on();
        }
        tbb::parallel_for(
            0, threads_,
            [this](int) {
                const Handover::Task task(handover_);
                work();
            },
            tbb::simple_partitioner());
        handover_.pass();
    });
    if (error_) std::rethrow_exception(error_);
    std::optional<std::int32_t> unknown_code;
    for (const Desk& d : desks_) {
        if (d.unknown_code && (!unknown_code || *d.unknown_code < *unknown_code)) unknown_code = d.unknown_code;
        for (std::size_t i = 0; i < d.states.size(); ++i) report.states[i] += d.states[i];
        for (std::size_t i = 0; i < d.did.size(); ++i) report.quadrants[i].add(d.did[i]);
    }
    if (unknown_code) throw unknown_class_error(db_, *unknown_code);
    report.skipped = source_.skipped();
    report.source = source_.report();
    report.write_s = write_s_;
    std::uint64_t inside = 0;
    for (std::uint64_t n : report.states) inside += n;
    report.states[static_cast<std::size_t>(State::outside)] +=
        static_cast<std::uint64_t>(db_.columns * db_.rows) - inside;
    report.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return report;
}

}  // namespace

Sampling coverage_sampling(Quality quality) {
    switch (quality) {
        case Quality::draft:
            return {.spokes_per_post = 1, .lead = 1, .cross_lines = false, .exact_course = false};
        case Quality::normal:
            return {.spokes_per_post = 2, .lead = 1, .cross_lines = false, .exact_course = false};
        case Quality::fine:
            return {.spokes_per_post = 2, .lead = 1, .cross_lines = true, .exact_course = false};
        case Quality::exact:
            return {.spokes_per_post = 4, .lead = 1, .cross_lines = true, .exact_course = false};
    }
    return {};
}

namespace {

void check(const Cover& work, const WedgeSource& source, const CoverageParams& params) {
    const std::size_t cache = source.cache_bytes(), own = work.fixed_bytes(1) + work.desk_bytes();
    if (own + cache <= params.memory_bytes) return;
    // A guess: the source's cache grows with the budget.
    const double share = std::min(0.9, static_cast<double>(cache) / static_cast<double>(params.memory_bytes));
    throw TooLittleMemory(params.memory_bytes, static_cast<std::size_t>(static_cast<double>(own) / (1 - share)),
                          "this coverage");
}

}  // namespace

std::size_t coverage_bytes(const ResolvedScene& scene, WedgeSource& source, const CoverageParams& params) {
    SceneSource own(source, scene.scene);
    const Cover work(scene, *own, params, nullptr);
    return work.fixed_bytes(1) + work.own_desk_bytes();
}

void check_coverage(const ResolvedScene& scene, WedgeSource& source, const CoverageParams& params) {
    SceneSource own(source, scene.scene);
    check(Cover(scene, *own, params, nullptr), *own, params);
}

CoverageReport cover(const ResolvedScene& scene, WedgeSource& given, const CoverageParams& params,
                     const std::function<void(const CoverageTile&)>& write) {
    SceneSource own(given, scene.scene);
    WedgeSource& source = *own;
    Cover work(scene, source, params, &write);
    check(work, source, params);
    if (params.beside_others) return work.run();
    const std::uint64_t data = params.data ? *params.data : source.fingerprint({});
    CoverageReport report = work.run();
    check_unchanged(source, data);
    return report;
}

}  // namespace wedgescope
