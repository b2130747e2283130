// Front: the state (horizon, void horizon, gap) of a run of neighbouring spokes at a line, carried outwards chunk by
// chunk. Knows nothing of threads, files or wedges beyond its own run. Leaves reading to the wedge source and cells'
// meaning to deposit.hpp.
//
// Along a spoke, sample after sample:
//  * a sample above the horizon ends a visible piece: it is shaded and deposited, and the horizon rises to it;
//  * what stays below is shadow, marked when it ends, at the range at which the ray of the horizon passes over it;
//  * a piece with a void end is a gap: no data, marked at the range of level ground at the reference height. When it
//    ends the horizon is raised to the first valid sample without deposit, and the void horizon to where the highest
//    valid post of the cells that the gap runs through would stand over either of its ends; what is seen below the void
//    horizon is unknown.
// At a doubling even children copy their parent; odd ones take the mean of their two neighbours' horizons (the valid
// one if one is not) and the greater void horizon, and start from a sample of their own on that line.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "lib/block_map.hpp"
#include "lib/class_laws.hpp"
#include "lib/course.hpp"
#include "lib/cull.hpp"
#include "lib/culture.hpp"
#include "lib/culture_lanes.hpp"
#include "lib/deposit.hpp"
#include "lib/far_shore.hpp"
#include "lib/lanes.hpp"
#include "lib/sample.hpp"
#include "lib/shade.hpp"
#include "lib/spoke_grid.hpp"
#include "lib/stage_clock.hpp"
#include "lib/sweep.hpp"
#include "lib/visible_pieces.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

/// What every spoke of a scene shares.
struct SweepScene {
    const DataBase* data_base = nullptr;
    const SpokeGrid* grid = nullptr;
    Sampling sampling;
    double sensor_m = 0;
    double reference_m = 0;
    double nadir_surface_m = 0;          ///< at the nadir; NaN: void or outside
    const Chunk* nadir_patch = nullptr;  ///< posts round the nadir, rows as lines; may be empty
    double max_arc_m = 0;
    double most_theta = 0;    ///< of max_arc_m on the earth's most curved part
    double smooth_sine = -1;  ///< horizon of a smooth earth at the data base's lowest height; -1: not known
    double range_bin_m = 0;
    bool range_is_ground = false;  ///< gpi-true: bins count arc, not slant range
    bool with_depression = false;  ///< second channel: depression / (pi/2)
    const PatternTable* pattern = nullptr;
    double constant = 0;                  ///< K
    const ClassLaws* laws = nullptr;      ///< of the classes
    const FarShore* shore = nullptr;      ///< null or off: no bank is brightened (lights_far_shores)
    const PathLossTable* loss = nullptr;  ///< null: nothing is lost on the way
    WedgeSource* source = nullptr;        ///< of classes; only with culture
};

/// Clock ticks spent by stage, and counts.
struct SweepCost {
    StageClock clock;
    std::uint64_t samples = 0, pieces = 0;
};

/// Where a piece of surface between two samples begins or ends.
struct PieceEnd {
    double part;  ///< of the way from the one sample to the other
    double range_m, sine;
    double x;  ///< as SampleLanes
};

class Front {
public:
    Front(const SweepScene& scene, const SpokeRun& run, WedgeCells& cells);

    /// Lines of the quadrant, in the quadrant's count; the next ones to advance over begin at next_line().
    std::int64_t next_line() const { return next_line_; }
    bool finished() const { return next_line_ >= line_end_ || live_begin_ >= live_end_; }
    /// The posts that advancing over `lines` (of one level, which start at next_line()) needs, the line behind them too,
    /// in posts of their level; an empty window if none of the spokes meets the raster there. With a map: also which blocks can be left out, because no
    /// spoke comes there or because what they hold stays below the horizons that the spokes have now.
    ChunkRequest request(Interval lines, BlockMap* map);
    /// Carries the front over lines that `chunk`, of the last request, holds; null where the window was empty. With `leap`
    /// spokes pass over blocks that stay below their horizons in one step; no bit changes.
    void advance(Interval lines, const Chunk* chunk, bool leap = true);
    /// Marks what lies beyond the last line. Call once.
    void finish();

    const SweepCost& cost() const { return cost_; }
    std::uint64_t culture_bytes_read() const { return culture_.bytes_read(); }
    std::uint64_t culture_bytes_spilled() const { return culture_.bytes_spilled(); }
    /// Of reading culture, on the way from shade to deposit; no part of cost().
    const Culture::Cost& culture_cost() const { return culture_.cost(); }
    std::size_t bytes() const;
    /// Without culture; of a scene some law of which may depend on the angle or on the azimuth, or with far shores.
    static std::size_t bytes_of(std::size_t lanes, bool facets, bool directional, bool shore);
    /// Least culture code that no legend entry names, on seen ground.
    std::optional<std::int32_t> unknown_code() const { return unknown_code_; }

private:
    static constexpr double no_horizon = -2;
    static constexpr std::int64_t small_block_posts = 8;
    /// Spokes taken over a chunk's lines together: their state stays in cache.
    static constexpr std::size_t tile_lanes = 64;
    static_assert(tile_lanes <= VisiblePieces::most && tile_lanes <= PassingLanes::most && tile_lanes <= 64,
                  "a tile is taken in one go");

    /// Nine arrays of doubles, one sample a spoke.
    struct Samples {
        LaneArray part, minor, arc, height, up, out, range, sine, x;
        static constexpr std::array<LaneArray Samples::*, 9> arrays() {
            return {&Samples::part, &Samples::minor, &Samples::arc,  &Samples::height, &Samples::up,
                    &Samples::out,  &Samples::range, &Samples::sine, &Samples::x};
        }
        void resize(std::size_t n);
        SampleLanes lanes(std::size_t at);
        friend void swap(Samples& a, Samples& b) noexcept {
            for (auto array : arrays()) (a.*array).swap(b.*array);
        }
    };
    struct Lanes {
        LaneArray slope, metres_per_post, inverse_radius;
        LaneArray across, slant;  // as FacetLanes; only where laws need facets
        LaneArray east, north;    // sine and cosine of the azimuth; only where some class is directional
        Samples last;
        LaneArray mode;  // SpokeMode
        LaneArray horizon, void_horizon, mark_from, gap_from, gap_top, seen_least, seen_most;
        std::vector<std::int32_t> row;  // of the cells; below 0: not this run's to deposit
        LaneArray share0, share1;
        std::vector<std::int64_t> origin;  // WedgeCells::origin_of the row
        std::vector<std::int64_t> number;  // 0, 1, ...
        std::vector<ShoreWindow> shore;    // only with far shores
        WedgeCells::Target target(std::size_t lane) const { return {row[lane], {share0[lane], share1[lane]}}; }
        void resize(std::size_t n);
    };
    /// Posts and culture heights of the two lines that the tile is between.
    struct Between {
        bool in_chunk = false;
        LinePosts behind, ahead, behind_culture, ahead_culture;
        double behind_major = 0, ahead_major = 0;
        bool adjacent = false;  // there is a line behind, next to the one ahead
        double major(double part) const { return behind_major + part * (ahead_major - behind_major); }
    };
    /// Classes under a piece, along its way: id[0] up to share `to_second`, id[1] up to share `to_third`, then id[2].
    struct Classes {
        std::array<ClassId, 3> id;
        float to_second, to_third;

        bool same() const { return (id[0] == id[1]) & (id[1] == id[2]); }
        bool known() const { return (id[0] != unknown_class) & (id[1] != unknown_class) & (id[2] != unknown_class); }
        /// With gamma_of(from, to, class), asked once for each run of one class, in order.
        template <class GammaOf>
        WedgeCells::Stretches stretches(const GammaOf& gamma_of) const {
            const std::array<double, 4> borders{0, static_cast<double>(to_second), static_cast<double>(to_third), 1};
            WedgeCells::Stretches all{{}, to_second, to_third};
            for (std::size_t begin = 0, end = 0; begin < id.size(); begin = end) {
                while (end < id.size() && id[end] == id[begin]) ++end;
                std::fill(all.gamma + begin, all.gamma + end,
                          static_cast<float>(gamma_of(borders[begin], borders[end], id[begin])));
            }
            return all;
        }
    };
    /// Where a piece runs, in raster indices.
    struct Track {
        double major0, minor0, major1, minor1;
    };
    /// One visible piece.
    struct Piece {
        WedgeCells::Portion portion;
        Track track;
        double sine0, sine1;
        double variable;  // law_variable() of its facet
        // The samples that it lies between, from `begin` to `end` of the way; null: it is a point.
        const SampleLanes *from, *to;
        double begin, end;
    };

    /// Places of lanes begin.. on a line: minor[i] in posts of a level, arc_m[i] of lane begin + i.
    void places(double distance, int level, std::size_t begin, std::size_t end, double* minor, double* arc_m,
                std::vector<SpokeMap::LinePiece>& pieces) const;
    /// Goes on in posts of the level that `line` has.
    void enter_level(std::int64_t line);
    /// Culture cell of a place in posts of this level.
    double cell_column(double column) const { return culture_.cell_column(column * post_); }
    double cell_row(double row) const { return culture_.cell_row(row * post_); }
    /// Samples of lanes begin.. on one line, from where they stand on it (minor, arc): exactly those that stepping there
    /// would take.
    void sample_line(const LinePosts& posts, std::size_t begin, std::size_t end, std::size_t at,
                     Samples& samples) const;
    LinePosts line_of(const Chunk& chunk, const RawVector<float>& layer, std::int64_t index) const;
    /// Line `index`, of the chunk if there is one, is where the spokes are now.
    void stand_on(std::int64_t index, const Chunk* chunk);

    StepScene step_scene(bool exact_course) const {
        return {.sensor_m = scene_->sensor_m,
                .bins_per_metre = bins_per_metre_,
                .range_is_ground = scene_->range_is_ground,
                .exact_course = exact_course,
                .most_theta = scene_->most_theta,
                .drops = scene_->pattern->drops(),
                .lobe = scene_->pattern->lobe()};
    }
    /// Whether pieces up to a line, index of this level, may lie below the sensor and be so long that laws turn over them: short_turn().
    bool may_turn(double major) const;
    bool is(std::size_t lane, SpokeMode mode) const { return lanes_.mode[lane] == mode; }
    void set_up_ring(std::size_t ring, Lanes& lanes) const;
    void start();
    void double_spokes();
    /// Of a doubling: what a spoke takes from the one it goes on from, or begins with between two.
    void go_on_from(const Lanes& parents, std::size_t parent, std::size_t lane);
    void begin_between(const Lanes& parents, std::size_t a, std::size_t b, std::size_t lane);
    /// What a spoke that begins on a line above the horizon given to it sees there, a point.
    void show_begin(std::size_t lane, double horizon);
    void trim();
    std::size_t first_live(std::size_t begin, std::size_t end) const;

    void advance_tile(Interval lines, const Chunk* chunk, std::size_t begin, std::size_t end);
    /// Blocks of a chunk, `side` posts wide, aligned to the raster, as far as spokes have come by.
    struct ChunkBounds {
        std::int64_t side;
        Interval major{}, minor{};
        std::vector<float> highest_m{};  ///< NaN: not looked at yet; +inf: may hold a void; -inf: nothing to see there
        void set_up(const Window& window, bool lines_are_columns);
        float& at(std::int64_t major_block, std::int64_t minor_block) {
            return highest_m[static_cast<std::size_t>((major_block - major.begin) * minor.size() + minor_block -
                                                      minor.begin)];
        }
    };
    /// Of a tile that sees nothing. Passes over lines up to the end of as many blocks as the last request found nothing to see
    /// in, else of the block that the next one lies in, a large one or a small one, if nothing there can come over the
    /// horizon of any spoke; returns the last line passed, or one before `line` if there is none.
    std::int64_t leap(std::int64_t line, std::int64_t last, const Chunk& chunk, std::size_t begin, std::size_t end);
    class BlockSurvey;  // of request()
    /// Over as many whole blocks as hold nothing to see for the tile's spokes.
    std::int64_t leap_hidden(std::int64_t line, std::int64_t last, const Chunk& chunk, std::size_t begin,
                             std::size_t end);
    std::int64_t leap_block(std::int64_t line, std::int64_t last, const Chunk& chunk, ChunkBounds& bounds,
                            std::size_t begin, std::size_t end);
    /// Does every spoke on its own stay above what it comes by, from where it is now to where it is ahead?
    bool passes_alone(const Chunk& chunk, ChunkBounds& bounds, std::int64_t block, std::size_t begin, std::size_t end);
    /// By how many posts of the level a spoke leaves the straight way within a block.
    double sag_within(const ChunkBounds& bounds) const;
    /// Highest surface of the chunk's posts on the lines of one block and `side` + 1 posts along them; +inf if one is
    /// void.
    float highest_in_chunk(const Chunk& chunk, ChunkBounds& bounds, std::int64_t major_block,
                           std::int64_t minor_block) const;
    /// To the line `distance` posts of the raster from the nadir, the one that lies ahead. `unseeing`: none_sees() of its spokes.
    void advance_line(double distance, std::size_t begin, std::size_t end, bool unseeing);
    /// Of a tile that sees nothing. To the line ahead in one step, if nothing before it can come over the horizon of any
    /// spoke.
    bool passes_line(std::size_t begin, std::size_t end);
    /// The tile's last samples, where lines were passed without them.
    void refresh(std::size_t begin, std::size_t end);
    void take(std::size_t begin, std::size_t end, bool crossings, Samples& next);
    /// What the samples of a tile do to their spokes where plain_.code is 2.
    void change(std::size_t n, std::size_t begin, const StepScene& step, Samples& next);
    /// Sample i of a lane, whose piece is number k of cuts_.
    void change_by_horizon(std::size_t lane, std::size_t i, std::size_t k, Samples& next);
    /// A sample that is void, or follows a gap.
    void change_by_void(std::size_t lane, std::size_t i, const Samples& next);
    /// Of one spoke, from where it is to where it is next.
    struct Way {
        SampleLanes from, to;
        double bump_m;      ///< of its middle over the straight way
        double range_bins;  ///< a metre; 0: bins count ground range
        double part(double u) const { return linear(*from.part, *to.part, u); }
        double minor(double u) const { return linear(*from.minor, *to.minor, u); }
        double arc_m(double u) const { return linear(*from.arc_m, *to.arc_m, u); }
        double up_m(double u) const { return linear(*from.up_m, *to.up_m, u) + raised_m(u); }
        double raised_m(double u) const { return bump_m * 4 * u * (1 - u); }
        double height_m(double u) const { return linear(*from.height_m, *to.height_m, u) + raised_m(u); }
        double out_m(double u) const { return linear(*from.out_m, *to.out_m, u); }
        /// Part u of it.
        PieceEnd at(double u) const {
            const double up = up_m(u), out = out_m(u), range = std::sqrt(up * up + out * out);
            return {u, range, up / range, range_bins > 0 ? range * range_bins : linear(*from.x, *to.x, u)};
        }
    };
    /// What becomes of the visible part of that way, from `begin` of it up to `last`, which is the horizon then.
    void rise(std::size_t lane, std::size_t i, Samples& next, double begin, const PieceEnd& last, double bow);
    /// Remembers that a lane shows what lies from `near` to `far` in range, of elevation `sine` at the most.
    void show(std::size_t lane, double near, double far, double sine);
    /// Of sample i, from now to next.
    Way way(std::size_t i, Samples& next) {
        return {now_.lanes(i), next.lanes(i), bump_[i], scene_->range_is_ground ? 0 : bins_per_metre_};
    }
    /// Where it runs between two of its points.
    Track track(const Way& way, const PieceEnd& a, const PieceEnd& b) const;
    bool beyond(std::size_t lane, double minor, double arc, double distance) const;

    /// law_variable() of the facet of sample i's piece from `begin` to `end` of the way, of a lane, into facet_[0]; only where
    /// laws need it.
    void find_facet(std::size_t i, std::size_t lane, const Way& way, double begin, double end);
    /// W per radian of azimuth of a piece with backscatter 1, as it arrives.
    double power_of(std::size_t lane, double sine0, double sine1, double range0_m, double range1_m) const;
    /// Plain pieces of a tile's samples, where `code` is 1.
    struct Plain {
        LaneArray rise, swing, sine0, code;
    };
    /// Puts them, of lanes lane.., to the others that wait.
    void keep_pieces(std::size_t n, std::size_t lane, const SampleLanes& from, const SampleLanes& to,
                     const Plain& plain);
    /// Puts a single one to the others that wait, which are put first where there is no room: of sample i of a lane, from `first` to
    /// `last` of its way.
    void keep_piece(std::size_t lane, std::size_t i, const Way& way, const PieceEnd& first, const PieceEnd& last,
                    double bow);
    /// Keeps those of plain_, from `from` to `to`, and those up to the other axis' lines, each two that can be as one.
    void keep_joined(std::size_t n, std::size_t lane, SampleLanes from, const SampleLanes& to);
    /// The pieces of a step up to the other axis' lines, which ends at `next`, wait for the way on to the line ahead.
    void wait_for_line(std::size_t n, int pieces, const Samples& next);
    /// Keeps those that wait as they are.
    void keep_crossed(std::size_t n, std::size_t lane);
    /// Of those that wait the ones whose spokes come to one more line of the other axis, where crossing_ is: what becomes of a
    /// piece must hang on its own spoke alone.
    void keep_crossing_again(std::size_t n, std::size_t lane);
    void make_room() {
        if (pieces_.size() + tile_lanes > VisiblePieces::most) put_pieces();
    }
    /// What reading culture took since the last call, all of it in the stage that is on, is no part of cost().
    void leave_out_culture() {
        cost_.clock.leave_out(culture_.cost().ticks - culture_ticks_);
        culture_ticks_ = culture_.cost().ticks;
    }
    /// Shades and deposits all that wait. With `at_once_` they are of one line, which between_ tells.
    void put_pieces();
    SampleLanes starts_of_pieces(std::size_t i);
    SampleLanes ends_of_pieces(std::size_t i);
    std::size_t lane_of_piece(std::size_t i) const {
        return static_cast<std::size_t>(pieces_.integer(VisiblePieces::lane, i));
    }
    /// Where they lie in range, as WedgeCells::Portions.
    struct RangeOfPieces {
        const double *x0, *x1;
        double bins;
    };
    RangeOfPieces range_of_pieces();
    /// Deposits them but for those that are left for put(): true if there are any (gamma_ says which).
    bool put_plain();
    /// Their backscatter over culture, into gamma_ and its borders; true if some are left for put().
    bool find_gammas();
    CulturePieces culture_pieces();
    CultureScene culture_scene() const;
    /// Of what was found under piece i in a tile.
    Classes classes_under(std::size_t i, const ClassId* classes) const;
    /// As if no law hung on the angle: by class, those of walls where there are any. True if some have no class.
    bool find_class_gammas(const ClassId* classes, bool walls);
    /// Of one piece, by its facet and azimuth.
    void find_angular_gamma(std::size_t i, const Classes& under);
    /// Culture under them, into found_, in the tile that piece i starts from, whose classes it returns.
    struct Found {
        const ClassId* classes;
        bool odd;  ///< some are more than parts and walls
    };
    Found find_cells(std::size_t i, const CulturePieces& pieces, CultureScene& scene);
    void put(std::size_t lane, const Piece& piece);
    /// Classes under a piece that runs through two columns and two rows of culture cells at most; nothing if there are more.
    template <class ClassOf>
    std::optional<Classes> few_classes(const Track& track, const ClassOf& class_of) const;
    /// Calls run(from, to, class) for the parts of a piece, 0..1, in order, neighbouring ones of one class together;
    /// class_of(cell column, cell row) says which.
    template <class ClassOf, class Run>
    void class_runs(const Track& track, const ClassOf& class_of, const Run& run);
    /// As put(), with what lies across water from the sensor lit by way of the water; also of lanes that are not this run's
    /// to deposit, for what they keep of the water.
    void put_by_shore(std::size_t lane, const Piece& piece, double depression);
    /// Pieces that are of one class each, as classes[found_.first] says; true if put() must do some.
    bool pass_shores(const ClassId* classes);
    /// Must put() do piece i, for water under it or in front of it? If not, the window has gone by it.
    bool needs_shore(std::size_t i, const std::array<ClassId, 3>& classes);
    ShorePoint shore_point(std::size_t lane, const SampleLanes& from, const SampleLanes& to, double u) const;
    /// Corner of the cell under a piece that stands highest on `behind` and `ahead`, of those that accept(height, post) takes, of
    /// equal ones the first in raster order.
    template <class Accept>
    std::optional<IndexPosition> highest_corner(const Track& track, const LinePosts& behind, const LinePosts& ahead,
                                                const Accept& accept) const;
    /// Post whose culture height makes the cell under a piece a wall; nothing where there is none.
    std::optional<IndexPosition> wall_of(const Track& track) const;
    /// Class of the land that a cell under a piece rises to: of its highest corner that is no water; unknown: it has none.
    ClassId land_of_cell(const Track& track);
    /// A class on seen ground; if it is unknown its code is remembered.
    ClassId class_at(std::int64_t cell_column, std::int64_t cell_row);
    /// Of a class in a spoke's direction.
    double ground_gamma(ClassId id, double variable, std::size_t lane) const {
        if (id == unknown_class) return 0;
        return directional_ ? scene_->laws->ground(id, variable, lanes_.east[lane], lanes_.north[lane])
                            : scene_->laws->ground(id, variable);
    }
    double wall_gamma(ClassId id, std::size_t lane) const {
        if (id == unknown_class) return 0;
        return directional_ ? scene_->laws->wall(id, lanes_.east[lane], lanes_.north[lane]) : scene_->laws->wall(id);
    }

    double level_coordinate(std::size_t lane, double arc_m) const;
    double ray_coordinate(std::size_t lane, double arc_m) const;
    void mark_seen(std::size_t lane);
    void mark_shadow(std::size_t lane, double to_arc_m);
    void mark_gap(std::size_t lane, double to_arc_m);
    void mark_rest(std::size_t lane, double from_arc_m);
    void grow_gap(std::size_t lane, std::size_t i);
    void end_gap(std::size_t lane, double arc_m);

    const SweepScene* scene_;
    const SpokeRun* run_;
    WedgeCells* cells_;
    double bins_per_metre_;
    bool plain_ground_;      // one class, no culture height
    bool needs_facets_;      // some law depends on the angle
    bool directional_;       // some class on the azimuth
    const FarShore* shore_;  // null: no bank is brightened
    bool at_once_;  // pieces wait for no other step's: they hang on their line, or on their order along a spoke
    double turning_posts_ = 0;  // lines no farther from the nadir may_turn()
    bool parts_wait_;           // those that begin or end between samples too: nothing needs the samples themselves
    bool may_join_;    // pieces on both sides of the other axis' lines: nothing tells them apart but their way
    bool joins_ = false;       // and what becomes of their shapes averages out, up to the line ahead
    double minor_post_m_ = 1;  // metres of a post along the lines, at the sensor
    double long_post_m_ = 1;   // and of one the way that it is longer
    Quadrant quadrant_;
    Fan fan_;
    int level_ = 0;    // of detail; all indices along and across lines are in posts of this level
    double post_ = 1;  // 2^level: posts of the raster
    std::size_t ring_ = 0;
    std::int64_t next_line_ = 0, line_end_ = 0;
    std::size_t live_begin_ = 0, live_end_ = 0;  // lanes not all done
    Lanes lanes_;
    bool stale_ = false;  // of the last samples only minor, arc and part hold
    // Workspace of one tile: the last samples, those on the other axis' lines and those on the line ahead.
    Samples now_, crossing_, ahead_;
    LaneArray cell_, bump_, start_range_, start_x_;
    Cuts cuts_{};            // those of the step that go one by one
    Plain plain_, crossed_;  // of the step, and of the one to the other axis' lines while they wait for it
    int waiting_ = 0;        // of crossed_
    LaneArray waiting_range_, waiting_x_;  // where these start
    VisiblePieces pieces_;                 // over lines of one tile, that wait to be shaded and deposited
    LaneArray power_, facet_;              // of these
    std::vector<float> bow_;
    LaneArray inverse_radius_, across_, slant_;                 // of their spokes
    std::array<std::int32_t, VisiblePieces::most> straddlers_;  // of these, those with a second row
    std::size_t straddling_ = 0;
    // Backscatter, as WedgeCells::Portions. Only over culture: the first two of it, and where its stretches end.
    std::array<std::vector<float>, 3> gamma_;
    CultureParts found_{};
    std::vector<float> class_gammas_;  // of every ClassId, ground and wall; of those that are no class below 0
    std::vector<float> posts_;         // of the cells, four a lane
    LaneArray culture_cell_;
    std::vector<float> culture_posts_;  // culture heights, four a lane
    std::vector<SpokeMap::LinePiece> line_pieces_;
    std::vector<double> breaks_;
    std::vector<float> patch_posts_, patch_culture_;  // of the line behind the nadir
    bool leaps_ = true;
    // The first are what the map told request(), where there is one: -inf where no spoke that comes by can see anything.
    std::array<ChunkBounds, 2> chunk_bounds_{{{block_posts}, {small_block_posts}}};
    Between between_;
    Culture culture_;
    SweepCost cost_;
    std::uint64_t culture_ticks_ = 0;  // of culture_.cost(), left out
    std::optional<std::int32_t> unknown_code_;
};

}  // namespace wedgescope
