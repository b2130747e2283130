#include "lib/plan.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "lib/cull.hpp"
#include "lib/error.hpp"
#include "lib/far_shore.hpp"
#include "lib/front.hpp"
#include "lib/refine.hpp"

namespace wedgescope {
namespace {

/// A few spokes of a run over coarse blocks of the terrain: how much of it can be seen at all.
class CoarseLook {
public:
    CoarseLook(const ResolvedScene& scene, const DataBase& db, const SpokeGrid& grid, BlockMap& map, Fan fan)
        : scene_(scene), db_(db), grid_(grid), map_(map), fan_(fan) {}

    /// Share of the window's posts (of the lines' level) that spokes lo..hi (slopes) may see on these lines; call strip
    /// after strip.
    double visible(const Window& level_posts, Interval lines, double lo, double hi) {
        const Window window = raster_posts(level_posts, grid_.level(fan_, lines.begin));
        if (window.columns.begin < 0 || window.columns.end > db_.columns) return 1;
        const int level = std::min(coarse_level, map_.levels() - 1);
        const BlockWindow bounds = map_.read(level, blocks_of(window, level));
        const std::int64_t edge = block_posts << level;
        int seen = 0, looks = 0;
        for (std::size_t i = 0; i < spokes; ++i) {
            const double slope = lo + (hi - lo) * (static_cast<double>(i) + 0.5) / spokes;
            const std::int64_t step = std::max<std::int64_t>(1, edge >> grid_.level(fan_, lines.begin));
            for (std::int64_t line = lines.begin; line < lines.end; line += step) {
                const std::int64_t last = std::min(line + step, lines.end) - 1;
                const SpokeMap::Place near = grid_.map().place(fan_.quadrant, slope, grid_.distance(fan_, line)),
                                      far = grid_.map().place(fan_.quadrant, slope, grid_.distance(fan_, last));
                const auto minor = static_cast<std::int64_t>(std::floor(0.5 * (near.minor + far.minor))),
                           major = grid_.line_index(fan_, (line + last) / 2) *
                                   (std::int64_t{1} << grid_.level(fan_, lines.begin));
                const bool columns = lines_are_columns(fan_.quadrant);
                const Window block = blocks_of({{columns ? major : minor, (columns ? major : minor) + 1},
                                                {columns ? minor : major, (columns ? minor : major) + 1}},
                                               level);
                if (!bounds.blocks.columns.contains(block.columns.begin) ||
                    !bounds.blocks.rows.contains(block.rows.begin))
                    continue;
                const BlockBounds& b = bounds.at(block.columns.begin, block.rows.begin);
                if (b.voids == Voids::all) continue;
                const double inverse = grid_.map().inverse_radius(fan_.quadrant, slope), sensor = scene_.sensor_m;
                ++looks;
                seen += highest_sine(sensor, static_cast<double>(b.highest_m + b.culture_m), near.arc_m, far.arc_m,
                                     inverse) >= horizon_[i];
                // Somewhere across a block of this size stands ground nearly as high as its highest.
                const double crest = 0.3 * static_cast<double>(b.lowest_m) + 0.7 * static_cast<double>(b.highest_m);
                horizon_[i] = std::max(horizon_[i], sight_line(sensor, far.arc_m, crest, inverse).sine);
            }
        }
        return looks ? static_cast<double>(seen) / looks : 0;
    }

private:
    static constexpr std::size_t spokes = 8;
    static constexpr int coarse_level = 1;
    const ResolvedScene& scene_;
    const DataBase& db_;
    const SpokeGrid& grid_;
    BlockMap& map_;
    Fan fan_;
    std::array<double, spokes> horizon_ = [] {
        std::array<double, spokes> none;
        none.fill(-2);
        return none;
    }();
};

/// Into how many parts a front cuts what a spoke sees from below the sensor to where a post is no longer than an eighth of the
/// range: by halves, so on average less than that.
double parts_below(const ResolvedScene& scene) {
    constexpr double far_posts = 1 / (most_range_ratio - 1), part = 0.7 * (most_range_ratio - 1), least_m = 1;
    if (!scene.nadir_on_data) return 0;
    const double far_m = std::min(far_posts * scene.longer_post_m, scene.scene.range_m.value_or(infinite)),
                 height_m = std::max(least_m, scene.sensor_m - scene.reference_m);
    return height_m < far_m ? std::log(far_m / height_m) / part : 0;
}

class Walk {
public:
    Walk(const ResolvedScene& scene, WedgeSource& source, const SpokeGrid& grid, std::int64_t strip, bool look)
        : scene_(scene), source_(source), db_(source.data_base()), grid_(grid), strip_(strip), look_(look),
          facets_(may_need_facets(laws_of(scene.scene))), directional_(may_be_directional(laws_of(scene.scene))),
          shore_(lights_far_shores(scene.scene, db_)), refines_(refines(scene.scene)),
          parts_below_(parts_below(scene)) {}

    WedgeForecast operator()(const Wedge& wedge) const {
        WedgeForecast f;
        const std::size_t cells =
            WedgeCells::bytes_of(static_cast<std::size_t>(wedge.bins.size()),
                                 static_cast<std::size_t>(scene_.swept.range_bins.size()), 1, halves_of(scene_.scene));
        std::size_t most = 0;
        for (const SpokeRun& run : wedge.runs) most = std::max(most, walk(run, f));
        f.peak_bytes = cells + most + allocations;
        return f;
    }

private:
    /// Returns the most that front and chunk hold at a time.
    std::size_t walk(const SpokeRun& run, WedgeForecast& f) const {
        const Quadrant q = run.quadrant;
        const Fan fan = run.own_fan();
        const auto& rings = grid_.rings(fan);
        const double most_arc = grid_.max_arc_m();
        std::optional<CoarseLook> coarse;
        if (BlockMap* map = look_ ? source_.block_map() : nullptr) coarse.emplace(scene_, db_, grid_, *map, fan);
        std::size_t most = 0, ring = 0;
        Interval live = run.spokes[0];
        f.parts += parts_below_ * static_cast<double>(live.size());
        Window culture_tiles;  // under the chunk before: those of them that lie under the next one stay (Culture::open)
        for (std::int64_t line = 0; line < grid_.line_count(fan) && !live.empty();) {
            const std::int64_t spokes = rings[ring].spokes;
            const auto beyond = [&](std::int64_t k) {
                return line > 0 &&
                       grid_.map().place(q, SpokeGrid::slope(spokes, k), grid_.distance(fan, line - 1)).arc_m >
                           most_arc;
            };
            while (!live.empty() && beyond(live.begin)) ++live.begin;
            while (!live.empty() && beyond(live.end - 1)) --live.end;
            if (live.empty()) break;
            const Interval lines = grid_.strip_lines(fan, line, strip_);
            // The ring that the strip ends in has the most spokes.
            std::size_t last_ring = ring;
            while (last_ring + 1 < rings.size() && rings[last_ring].lines.end <= lines.end) ++last_ring;
            const std::size_t lanes =
                std::max(static_cast<std::size_t>(run.spokes[last_ring].size() + run.spokes[ring].size()),
                         refines_ ? lanes_of_bin(run, last_ring) : 0);
            f.lanes = std::max(f.lanes, lanes);
            const ChunkRequest request{
                grid_.window(fan, spokes, live, lines), lines_are_columns(q), {}, {}, {}, grid_.level(fan, line), {}};
            const Window posts = raster_posts(request.window, request.level);
            std::size_t held = Front::bytes_of(lanes, facets_, directional_, shore_);
            f.steps += static_cast<std::uint64_t>(live.size() * lines.size()) << (last_ring - ring);
            if (!request.window.empty()) {
                const LoadCost cost = source_.cost(request);
                ++f.chunks;
                f.reach = hull(f.reach, posts);
                f.posts += cost.posts;
                f.bytes += cost.bytes;
                held += cost.chunk_bytes + cost.beside_bytes;
                std::uint64_t class_bytes = 0;
                if (db_.has_culture) {
                    const Window tiles = Culture::tiles_under(db_, posts);
                    for (std::int64_t r = tiles.rows.begin; r < tiles.rows.end; ++r)
                        for (std::int64_t c = tiles.columns.begin; c < tiles.columns.end; ++c)
                            if (!culture_tiles.contains(c, r))
                                class_bytes += source_.class_bytes(Culture::cells_of_tile(db_, c, r));
                    culture_tiles = tiles;
                    held += static_cast<std::size_t>(tiles.posts() * db_.culture_tile_columns * db_.culture_tile_rows) *
                            sizeof(ClassId);
                }
                f.bytes += class_bytes;
                double share = 1;
                if (coarse)
                    share = coarse->visible(request.window, lines, SpokeGrid::slope(spokes, live.begin),
                                            SpokeGrid::slope(spokes, live.end - 1));
                f.likely_posts += share * static_cast<double>(cost.posts);
                f.likely_bytes += share * static_cast<double>(cost.bytes + class_bytes);
            }
            most = std::max(most, held);
            line = lines.end;
            while (ring + 1 < rings.size() && rings[ring].lines.end <= line) {
                ++ring;
                // Children of those that are left.
                live = intersection({2 * live.begin - 1, 2 * live.end}, run.spokes[ring]);
            }
        }
        return most;
    }

    /// Of one bin that is swept with the most spokes, at least: those of a ring and the parents'. Near a diagonal a bin has pi / 2 times
    /// as many as the mean.
    static std::size_t lanes_of_bin(const SpokeRun& run, std::size_t ring) {
        constexpr std::size_t times = std::size_t{1} << Refinement::most_rounds, few = 16;
        return times * static_cast<std::size_t>(run.touching[ring].size()) * 5 / 2 /
                   static_cast<std::size_t>(std::max<std::int64_t>(1, run.bins.size())) +
               few;
    }

    static constexpr std::size_t allocations = 256 * 1024;  // what the heap takes for many small pieces
    const ResolvedScene& scene_;
    WedgeSource& source_;
    const DataBase& db_;
    const SpokeGrid& grid_;
    std::int64_t strip_;
    bool look_, facets_, directional_, shore_, refines_;
    double parts_below_;
};

/// Decoded bytes that go through the source's cache. Of a raster without a map, thus read by GDAL, whose blocks are wider
/// than windows (lines, whole strips), each thread's handle decodes, for its own share, all the blocks of the reach.
std::uint64_t cached_bytes(WedgeSource& source, const Plan& p) {
    const WedgeForecast sum = p.total();
    const DataBase& db = source.data_base();
    constexpr std::int64_t wide = 1024;
    if (source.block_map() || sum.posts == 0 || db.block_columns < std::min(wide, db.columns)) return sum.bytes;
    const auto blocks = [](Interval posts, std::int64_t all, std::int64_t block) {
        const Interval in = intersection(posts, {0, all});
        return in.empty() ? 0 : std::min(all, (in.end + block - 1) / block * block) - in.begin / block * block;
    };
    const double posts = static_cast<double>(blocks(sum.reach.columns, db.columns, db.block_columns)) *
                         static_cast<double>(blocks(sum.reach.rows, db.rows, db.block_rows));
    const double each = posts * static_cast<double>(sum.bytes) / static_cast<double>(sum.posts);
    return std::max(sum.bytes, static_cast<std::uint64_t>(each * p.in_flight));
}

/// Of the last `some` wedges halves those of more than one bin: when there is no more to begin, a thread has less to wait for the
/// others.
void halve_last(std::vector<Interval>& wedges, std::size_t some) {
    const std::size_t kept = wedges.size() - std::min(wedges.size(), some);
    const std::vector<Interval> last(wedges.begin() + static_cast<std::ptrdiff_t>(kept), wedges.end());
    wedges.resize(kept);
    for (const Interval& wedge : last) {
        const std::int64_t middle = wedge.begin + wedge.size() / 2;
        for (const Interval half : {Interval{wedge.begin, middle}, Interval{middle, wedge.end}})
            if (!half.empty()) wedges.push_back(half);
    }
}

/// Looks for a split whose wedges have room: more of them, then fewer at a time.
class Planner {
public:
    Planner(const ResolvedScene& scene, WedgeSource& source, const SpokeGrid& grid, const EngineParams& params,
            int threads)
        : scene_(scene), source_(source), grid_(grid), params_(params), threads_(threads),
          bins_(scene.swept.azimuth_bins.size()) {
        if (params.archive) recorded_ = params.archive->recorded_split();
        const std::int64_t block = std::min(source.data_base().block_columns, source.data_base().block_rows);
        plan_.strip_lines = block < 32 ? 64 : std::min<std::int64_t>(block, 256);
        plan_.fixed_bytes = image_bytes(scene, params.draw) + source.cache_bytes();
        plan_.in_flight = threads;
    }

    Plan plan(bool look) {
        std::int64_t count = asked_for();
        split(count, false);
        // No number of wedges makes room for what stands beside them.
        const bool hopeless = recorded_.empty() && plan_.fixed_bytes >= params_.memory_bytes;
        if (hopeless) measure(bins_);
        while (recorded_.empty() && !hopeless && !fits(plan_.in_flight) && count < bins_) {
            count = std::min(bins_, count * 2);
            measure(count);
            if (plan_.wedges.empty() && fits(plan_.in_flight)) split(count, false);
        }
        fewer_at_a_time();
        if (fits(1) && plan_.wedges.empty()) {
            split(count, false);
            fewer_at_a_time();
        }
        if (!fits(1)) refuse(count);
        if (look) split(count, true);
        narrow_last(look);
        plan_.unfilled_bytes = source_.cache_bytes() - source_.filled_bytes(cached_bytes(source_, plan_));
        return std::move(plan_);
    }

private:
    /// Wedges to begin with. A split that stands is kept: its wedges may be done already.
    std::int64_t asked_for() const {
        if (!recorded_.empty()) return static_cast<std::int64_t>(recorded_.size());
        return std::min<std::int64_t>(bins_, params_.wedges > 0 ? params_.wedges : 8 * std::max(threads_, 2));
    }
    Interval even_share(std::int64_t i, std::int64_t n) const {
        const std::int64_t first = scene_.swept.azimuth_bins.begin;
        return {first + bins_ * i / n, first + bins_ * (i + 1) / n};
    }
    Walk walk(bool guess) const { return {scene_, source_, grid_, plan_.strip_lines, guess && params_.cull}; }
    void clear() {
        plan_.wedges.clear();
        plan_.forecast.clear();
        plan_.wedge_bytes = 0;
    }

    void split(std::int64_t n, bool guess) {
        clear();
        for (std::int64_t i = 0; i < n; ++i)
            plan_.wedges.push_back(recorded_.empty() ? even_share(i, n) : recorded_[static_cast<std::size_t>(i)]);
        forecast_rest(guess);
        for (const WedgeForecast& f : plan_.forecast) plan_.wedge_bytes = std::max(plan_.wedge_bytes, f.peak_bytes);
    }
    /// Of the wedges that have no forecast yet.
    void forecast_rest(bool guess) {
        const Walk forecast = walk(guess);
        for (std::size_t i = plan_.forecast.size(); i < plan_.wedges.size(); ++i)
            plan_.forecast.push_back(forecast(grid_.wedge(static_cast<std::int64_t>(i), plan_.wedges[i])));
    }
    /// What the wedges of such a split hold. Of more than `asked` some are asked how little they can take, and no split is made:
    /// if not even these fit, the others need not be.
    void measure(std::int64_t n) {
        constexpr std::int64_t asked = 256;
        if (n <= asked) return split(n, false);
        clear();
        const Walk forecast = walk(false);
        for (std::int64_t i = 0; i < n; i += (n + asked - 1) / asked)
            plan_.wedge_bytes = std::max(plan_.wedge_bytes, forecast(grid_.wedge(i, even_share(i, n))).peak_bytes);
    }
    void narrow_last(bool guess) {
        if (params_.wedges > 0 || !recorded_.empty() || plan_.in_flight == 1) return;
        const auto last = static_cast<std::size_t>(plan_.in_flight);
        plan_.forecast.resize(plan_.wedges.size() - std::min(plan_.wedges.size(), last));
        for (int round = 0; round < 2; ++round) halve_last(plan_.wedges, last);
        forecast_rest(guess);
    }

    bool fits(int in_flight) const {
        return plan_.fixed_bytes + plan_.wedge_bytes * static_cast<std::size_t>(in_flight) <= params_.memory_bytes;
    }
    void fewer_at_a_time() {
        while (plan_.in_flight > 1 && !fits(plan_.in_flight)) --plan_.in_flight;
    }
    [[noreturn]] void refuse(std::int64_t count) const {
        // A guess: the source's cache grows with the budget.
        const double cache = static_cast<double>(source_.cache_bytes()),
                     share = cache / static_cast<double>(params_.memory_bytes),
                     rest = static_cast<double>(plan_.fixed_bytes + plan_.wedge_bytes) - cache;
        const auto least = static_cast<std::size_t>(std::max(rest / (1 - std::min(share, 0.9)), rest + cache));
        throw TooLittleMemory(
            params_.memory_bytes, least, "this scene",
            text(" (", bins_, " x ", scene_.swept.range_bins.size(), " cells",
                 params_.draw ? text(", a picture of ", scene_.scene.display.size, " pixels a side") : "",
                 !recorded_.empty() ? text(", in the ", count, " wedges of the work folder") : "", ")"));
    }

    const ResolvedScene& scene_;
    WedgeSource& source_;
    const SpokeGrid& grid_;
    const EngineParams& params_;
    int threads_;
    std::int64_t bins_;
    std::vector<Interval> recorded_;  ///< the split of the work folder; empty: none
    Plan plan_;
};

}  // namespace

std::size_t image_bytes(const ResolvedScene& scene, bool draw) {
    // Power, received power and states: a run that makes no image of received power turns echo states and dBm into floats in that
    // room when they are written.
    const std::size_t usual = std::size_t{16} << 20, weights = weight_bytes(beam_setting(scene), scene.shown);
    // Of each range bin its quantum and the inverse of that, where it ends, and the rain in it.
    const std::size_t bins = scene.swept.range_count() * (8 + 8 + 8 + 4);
    const std::size_t bytes =
        scene.swept.cells() * 5 + scene.shown.cells() * (4 + 4 + 1) + std::max(weights, usual) - usual + bins;
    if (!draw) return bytes;
    const auto size = static_cast<std::size_t>(scene.scene.display.size);
    return bytes + bytes_a_pixel(scene.scene.display) * size * size +
           (scene.scene.receiver.fluctuates() ? scene.swept.cells() * 24 : 0);
}

std::size_t Plan::peak_bytes(const std::vector<bool>& done) const {
    std::vector<std::size_t> bytes;
    for (std::size_t i = 0; i < forecast.size(); ++i)
        if (done.empty() || done[i]) bytes.push_back(forecast[i].peak_bytes);
    const auto largest = std::min(bytes.size(), static_cast<std::size_t>(in_flight));
    std::partial_sort(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(largest), bytes.end(),
                      std::greater<>());
    return std::accumulate(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(largest),
                           fixed_bytes - unfilled_bytes);
}

WedgeForecast Plan::total(const std::vector<bool>& done) const {
    WedgeForecast sum;
    for (std::size_t i = 0; i < forecast.size(); ++i) {
        if (!done.empty() && !done[i]) continue;
        const WedgeForecast& f = forecast[i];
        sum.chunks += f.chunks;
        sum.posts += f.posts;
        sum.bytes += f.bytes;
        sum.steps += f.steps;
        sum.parts += f.parts;
        sum.likely_posts += f.likely_posts;
        sum.likely_bytes += f.likely_bytes;
        sum.reach = hull(sum.reach, f.reach);
    }
    sum.peak_bytes = peak_bytes(done);
    return sum;
}

double Plan::likely_seconds(bool all) const {
    constexpr double step_s = 45e-9, part_s = 50e-9, post_s = 6e-9, chunk_s = 60e-6;
    const WedgeForecast sum = total();
    const double share = all || sum.posts == 0 ? 1 : sum.likely_posts / static_cast<double>(sum.posts);
    return share * (step_s * static_cast<double>(sum.steps) + post_s * static_cast<double>(sum.posts)) +
           part_s * sum.parts + chunk_s * static_cast<double>(sum.chunks);
}

Plan plan(const ResolvedScene& scene, WedgeSource& source, const SpokeGrid& grid, const EngineParams& params,
          int threads, bool look) {
    return Planner(scene, source, grid, params, threads).plan(look);
}

}  // namespace wedgescope
