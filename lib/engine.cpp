#include "lib/engine.hpp"

#include <tbb/blocked_range.h>
#include <tbb/flow_graph.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <memory>
#include <mutex>
#include <span>

#include "lib/culture.hpp"
#include "lib/detail.hpp"
#include "lib/error.hpp"
#include "lib/fluctuation.hpp"
#include "lib/front.hpp"
#include "lib/large_blocks.hpp"
#include "lib/memory_budget.hpp"
#include "lib/plan.hpp"
#include "lib/rain_echo.hpp"
#include "lib/raised_source.hpp"
#include "lib/receiver.hpp"
#include "lib/refine.hpp"
#include "lib/rounding.hpp"
#include "lib/spoke_map.hpp"
#include "lib/stopwatch.hpp"
#include "lib/threads.hpp"

namespace wedgescope {

namespace {

/// No arc of this slant range is longer, down to 2 km below sea level.
double most_arc_m(const ResolvedScene& s, const DataBase& db, double range_m) {
    const double theta = range_m * s.earth.inverse_radius();
    return rounded(range_m * (1.0005 + theta * theta / 4) + arc_margin_m(db), 10);
}

}  // namespace

SpokeMapParams swept_map_params(const ResolvedScene& s, const DataBase& db) {
    return {.geometry = s.geometry,
            .nadir = s.nadir,
            .lat_deg = s.lat_deg,
            .lon_deg = s.lon_deg,
            .earth_k = s.scene.earth_k,
            .max_arc_m = most_arc_m(s, db, *s.scene.range_m),
            .margin_m = arc_margin_m(db),
            .range_m = s.scene.range_m};
}

double slant_range_m(const ResolvedScene& s, double range_m) {
    return s.scene.display.kind == DisplayKind::gpi_true ? s.earth.slant_range_m(s.sensor_m, s.reference_m, range_m)
                                                         : range_m;
}

double minimum_range_m(const ResolvedScene& s) {
    return s.scene.receiver.minimum_range_m.value_or(s.scene.radar.pulse_extent_m());
}

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// What libm had a hand in is rounded.
PathLossRays loss_rays(const ResolvedScene& s, double most_range_m) {
    PathLossRays rays;
    rays.earth = Earth::of_curvature(rounded_significand(s.earth.inverse_radius(), 24));
    rays.sensor_m = s.sensor_m;
    rays.most_range_m = rounded_significand(most_range_m, 24);
    if (s.scene.weather.rain_mm_h > 0) rays.highest_m = std::max(rays.highest_m, s.scene.weather.rain_top_m);
    return rays;
}

/// What weather does to one scene: the loss on the way, and the echo of the rain in each swept range bin.
struct WeatherHere {
    std::optional<PathLossTable> loss;  ///< none: clear
    std::vector<float> rain_w;          ///< none: no rain

    WeatherHere() = default;
    WeatherHere(const ResolvedScene& s, const Weather& weather, const PatternTable& pattern) {
        if (weather.clear()) return;
        // Bins of ground range begin at the slant range of the level surface.
        std::vector<double> edges_m;
        for (std::int64_t j = s.swept.range_bins.begin; j <= s.swept.range_bins.end; ++j) {
            const double edge = static_cast<double>(j) * s.swept.range_bin_m;
            edges_m.push_back(s.scene.display.kind == DisplayKind::gpi_true ? rounded(slant_range_m(s, edge), 10)
                                                                            : edge);
        }
        const PathLossRays rays = loss_rays(s, edges_m.back());
        loss.emplace(weather, rays);
        if (weather.params().rain_mm_h == 0) return;
        const RainEcho rain(weather, *loss, pattern,
                            {s.scene.radar, rays.earth, s.sensor_m, s.reference_m, rays.most_range_m});
        rain_w = rain.cells_w(edges_m, s.swept.azimuth_step_rad());
        // The beam will widen each bin as level ground at its range; rain is wider by its own elevation already.
        const BeamSetting beam = beam_setting(s);
        for (std::size_t j = 0; j < rain_w.size(); ++j) {
            const double middle_m =
                (static_cast<double>(s.swept.range_bins.begin) + static_cast<double>(j) + 0.5) * s.swept.range_bin_m;
            rain_w[j] *= static_cast<float>(level_cosine(beam, middle_m));
        }
    }
};

/// Where the spokes of a scene lie: all that a plan asks for. Nothing here grows with the number of range bins, so that a scene
/// with too many of them is refused at once.
struct SpokeSetting {
    SpokeMap map;
    DetailLevels levels;
    Sampling sampling;
    SpokeGrid grid;

    SpokeSetting(const ResolvedScene& s, WedgeSource& source)
        : map(source.data_base(), swept_map_params(s, source.data_base())), levels(choose_levels(s, source, map)),
          sampling(sampling_of(s, source.data_base())),
          grid(source.data_base(), map, sampling, s.swept.circle_bins, levels) {}
    SpokeSetting(const SpokeSetting&) = delete;  // the grid looks at the map
    SpokeSetting& operator=(const SpokeSetting&) = delete;
};

/// Everything the wedges of one run share, and never change.
struct Setting : SpokeSetting {
    const ResolvedScene& scene;
    const DataBase& data_base;
    std::shared_ptr<const SceneTables> tables;
    Quanta cells;
    Refinement refinement;
    SweepScene sweep;

    /// Sine of the elevation of the horizon of a smooth earth at the data base's lowest height.
    double smooth_horizon(BlockMap& bounds) const {
        const int level = bounds.levels() - 1;
        float lowest = std::numeric_limits<float>::infinity();
        for (const BlockBounds& b :
             bounds.read(level, blocks_of({{0, data_base.columns}, {0, data_base.rows}}, level)).bounds)
            lowest = std::min(lowest, b.lowest_m);
        const double inverse = scene.earth.inverse_radius(), height = static_cast<double>(lowest);
        if (!(height < scene.sensor_m)) return -1;
        const double cosine = (1 + height * inverse) / (1 + scene.sensor_m * inverse);
        return -std::sqrt(1 - cosine * cosine);
    }

    Setting(const ResolvedScene& s, WedgeSource& source, std::shared_ptr<const SceneTables> made,
            const PathLossTable* loss = nullptr)
        : SpokeSetting(s, source), scene(s), data_base(source.data_base()),
          tables(made ? std::move(made) : std::make_shared<const SceneTables>(s.scene)),
          cells(quanta(s.swept.range_bins, s.swept.range_bin_m, radar_constant(s.scene.radar), tables->pattern.most(),
                       grid.azimuth_step_rad(), tables->laws.most() * tables->shore.most())),
          refinement(refinement_of(s, sampling)) {
        sweep.data_base = &data_base;
        sweep.grid = &grid;
        sweep.sampling = sampling;
        sweep.sensor_m = s.sensor_m;
        sweep.reference_m = s.reference_m;
        sweep.nadir_surface_m = s.nadir_on_data ? s.nadir_surface_m : std::numeric_limits<double>::quiet_NaN();
        sweep.nadir_patch = &s.nadir_patch;
        // The bins may end before the scene's range, which decides where the spokes are.
        const double last_m = static_cast<double>(s.swept.range_bins.end) * s.swept.range_bin_m;
        sweep.max_arc_m = std::min(map.params().max_arc_m, most_arc_m(s, data_base, last_m));
        constexpr double least_radius_m = 6335439;  // of the WGS84 meridian, at the equator
        sweep.most_theta = s.scene.earth_k ? map.params().max_arc_m / (*s.scene.earth_k * least_radius_m) : 0;
        sweep.range_bin_m = s.swept.range_bin_m;
        sweep.range_is_ground = s.scene.display.kind == DisplayKind::gpi_true;
        sweep.pattern = &tables->pattern;
        sweep.constant = radar_constant(s.scene.radar);
        sweep.laws = &tables->laws;
        sweep.shore = &tables->shore;
        sweep.loss = loss;
        sweep.source = &source;
        if (BlockMap* bounds = source.block_map()) sweep.smooth_sine = smooth_horizon(*bounds);
    }
    /// Of the first sweep of a wedge, round 0, and of what is swept again: made when it is first asked for.
    const SweepScene& sweep_of(int round) const {
        if (round == 0) return sweep;
        Finer& finer = finer_[static_cast<std::size_t>(round - 1)];
        std::call_once(finer.made, [&] {
            finer.grid.emplace(grid.finer(1 << round));
            finer.sweep = sweep;
            finer.sweep.grid = &*finer.grid;
        });
        return finer.sweep;
    }
    const SpokeGrid& grid_of(int round) const { return *sweep_of(round).grid; }

private:
    struct Finer {
        std::once_flag made;
        std::optional<SpokeGrid> grid;
        SweepScene sweep;
    };
    mutable std::array<Finer, Refinement::most_rounds> finer_;
};

/// One wedge on its way through the graph: run after run, strip after strip.
struct WedgeTask {
    Wedge wedge;
    std::unique_ptr<WedgeCells> cells;
    std::unique_ptr<Front> front;
    std::size_t run = 0;
    int round = 0;                  // 0: the first sweep of all its bins; then of those in doubt
    std::vector<Interval> doubted;  // rows that this round sweeps
    std::size_t next_doubted = 0;   // of these the first that waits, from a row on
    std::int64_t next_row = 0;
    Interval lines;  // of the chunk that was loaded last
    Chunk chunk;
    bool has_chunk = false;
    std::size_t beside_bytes = 0;  // while it was read
    std::size_t held_bytes = 0;    // as last counted
    MemoryBudget::Token token;
    std::optional<std::int32_t> unknown_code;
    WedgeReport report;
    WedgeKey key;  // in the archive, if there is one
    Clock::time_point entered;
};
using Task = std::shared_ptr<WedgeTask>;

class Wedges {
public:
    Wedges(const Setting& setting, WedgeSource& source, const Plan& plan, const EngineParams& params, int threads,
           RunResult& result)
        : setting_(setting), source_(source), plan_(plan), params_(params), threads_(static_cast<std::size_t>(threads)),
          result_(result), budget_(params.memory_bytes),
          wanted_(params.only_wedges.value_or(Interval{0, static_cast<std::int64_t>(plan.wedges.size())})) {}

    void sweep_all(Threads& threads);

private:
    Task enter(std::size_t index);
    void load(WedgeTask& task);
    bool sweep(WedgeTask& task);  // true: another chunk is wanted
    /// Its runs are swept. True if there are others: of bins to be swept again.
    bool refine(WedgeTask& task);
    /// Runs of the first of the rows that wait, as many as the front has room for.
    void take_doubted(WedgeTask& task);
    void merge(WedgeTask& task);
    /// The wedge holds so much from now on.
    void hold(WedgeTask& task, std::size_t bytes);
    bool find(WedgeTask& task);
    void keep(WedgeTask& task);
    void leave(WedgeTask& task);
    double memory_wait_s(Clock::time_point entered);
    void note_memory() const {
        if (params_.timeline) params_.timeline->memory(plan_.fixed_bytes + budget_.held());
    }
    std::span<float> echo_rows(const WedgeTask& task);
    std::span<std::uint8_t> state_rows(const WedgeTask& task);

    const Setting& setting_;
    WedgeSource& source_;
    const Plan& plan_;
    const EngineParams& params_;
    std::size_t threads_;
    RunResult& result_;
    MemoryBudget budget_;
    Interval wanted_;  // wedges to do
    std::optional<std::int32_t> unknown_code_;
    std::size_t merged_ = 0;
    std::atomic<std::size_t> held_{0}, most_held_{0};
    std::mutex door_mutex_;
    Clock::time_point opened_;
    std::size_t entered_ = 0;
    std::vector<Clock::time_point> left_;
};

void Wedges::hold(WedgeTask& task, std::size_t bytes) {
    const std::size_t now = held_.fetch_add(bytes - task.held_bytes) + bytes - task.held_bytes;
    task.held_bytes = bytes;
    std::size_t most = most_held_.load();
    while (now > most && !most_held_.compare_exchange_weak(most, now)) {
    }
}

Task Wedges::enter(std::size_t index) {
    const Span span(params_.timeline, "enter", "wedge", static_cast<std::int64_t>(index));
    auto task = std::make_shared<WedgeTask>();
    task->entered = Clock::now();
    const double memory_wait = memory_wait_s(task->entered);
    // The limiter lets no more wedges in than the plan grants memory for: this never waits.
    task->token = budget_.take(plan_.wedge_bytes);
    task->wedge = setting_.grid.wedge(static_cast<std::int64_t>(index), plan_.wedges[index]);
    task->report.index = static_cast<std::int64_t>(index);
    task->report.azimuth_bins = plan_.wedges[index];
    note_memory();
    if (params_.archive && find(*task)) return task;
    task->report.memory_wait_s = memory_wait;
    task->cells = std::make_unique<WedgeCells>(static_cast<std::size_t>(plan_.wedges[index].size()), setting_.cells, 1,
                                               halves_of(setting_.scene.scene));
    task->doubted = {{0, plan_.wedges[index].size()}};
    return task;
}

/// Of levels of detail, which the ground far from a wedge may have a say in; 0: none.
std::uint64_t checksum(const DetailLevels& levels) {
    std::uint64_t sum = 0;
    for (const auto& fan : levels.steps) {
        sum = sum * 1099511628211U + fan.size() + 1;
        for (const DetailLevels::Step& step : fan)
            sum = (sum ^ static_cast<std::uint64_t>(step.border * 8 + step.level)) * 1099511628211U;
    }
    return sum;
}

/// Posts of the window that need not be read, by reason.
void count_skipped(const ChunkRequest& request, WedgeReport& report) {
    std::size_t at = 0;
    for (std::int64_t r = request.blocks.rows.begin; r < request.blocks.rows.end; ++r)
        for (std::int64_t c = request.blocks.columns.begin; c < request.blocks.columns.end; ++c, ++at) {
            if (request.skip.empty() || request.skip[at] == Skip::none) continue;
            const auto posts = [](std::int64_t i) { return Interval{i * block_posts, (i + 1) * block_posts}; };
            const Window skipped{intersection(posts(c), request.window.columns),
                                 intersection(posts(r), request.window.rows)};
            // A post of a level stands for those between.
            report.posts_skipped[static_cast<std::size_t>(request.skip[at])] +=
                static_cast<std::uint64_t>(skipped.posts()) << (2 * request.level);
        }
}

/// With more memory a wedge would enter as soon as fewer are in than there are threads.
double Wedges::memory_wait_s(Clock::time_point entered) {
    const std::lock_guard lock(door_mutex_);
    const std::size_t order = entered_++;
    if (static_cast<std::size_t>(plan_.in_flight) >= threads_) return 0;
    const Clock::time_point free = order < threads_ ? opened_ : left_.at(order - threads_);
    return std::max(0.0, std::chrono::duration<double>(entered - free).count());
}

void Wedges::leave(WedgeTask& task) {
    task.token = {};
    note_memory();
    const std::lock_guard lock(door_mutex_);
    left_.push_back(Clock::now());
}

std::span<float> Wedges::echo_rows(const WedgeTask& task) {
    PolarImage<float>& image = result_.echo_w;
    const Interval bins = task.report.azimuth_bins;
    return {image.row(static_cast<std::size_t>(bins.begin - image.grid.azimuth_bins.begin)),
            static_cast<std::size_t>(bins.size()) * image.grid.range_count()};
}

std::span<std::uint8_t> Wedges::state_rows(const WedgeTask& task) {
    PolarImage<std::uint8_t>& image = result_.echo_state;
    const Interval bins = task.report.azimuth_bins;
    return {image.row(static_cast<std::size_t>(bins.begin - image.grid.azimuth_bins.begin)),
            static_cast<std::size_t>(bins.size()) * image.grid.range_count()};
}

/// True if the archive has the wedge; it is then through but for the merge.
bool Wedges::find(WedgeTask& task) {
    if (params_.stop) params_.stop->check();
    const ResolvedScene& scene = setting_.scene;
    const std::vector<Window> posts = hull(setting_.grid, task.wedge, scene.nadir_patch.window);
    // Taken before anything is read: should the data change under the run, what is kept does not fit it any more.
    task.key = {task.report.index, task.report.azimuth_bins, scene.swept.range_bins,
                source_.fingerprint(posts) ^ checksum(setting_.levels)};
    const auto kept = params_.archive->find(task.key, echo_rows(task), state_rows(task));
    if (!kept) return false;
    task.unknown_code = kept->unknown_code;
    task.report = kept->report;
    task.report.index = task.key.index;
    task.report.azimuth_bins = task.key.azimuth_bins;
    task.report.reused = true;
    task.run = task.wedge.runs.size();
    return true;
}

/// Its rows of the images are final, so this may take its time while others are swept and merged.
void Wedges::keep(WedgeTask& task) {
    if (!params_.archive || task.report.reused) return;
    Span span(params_.timeline, "keep", "disk", task.key.index);
    const Stopwatch watch;
    span.add_bytes(echo_rows(task).size_bytes() + state_rows(task).size_bytes());
    params_.archive->keep(task.key, {task.unknown_code, task.report}, echo_rows(task), state_rows(task));
    const std::lock_guard lock(door_mutex_);
    result_.report.keep_s += watch.wall_s();
}

void Wedges::load(WedgeTask& task) {
    if (task.report.reused) return;
    if (params_.stop) params_.stop->check();
    Span span(params_.timeline, "load", "disk", task.report.index);
    const Stopwatch watch;
    task.has_chunk = false;
    while (task.run < task.wedge.runs.size()) {
        const SpokeRun& run = task.wedge.runs[task.run];
        if (!task.front) task.front = std::make_unique<Front>(setting_.sweep_of(task.round), run, *task.cells);
        if (task.front->finished()) break;  // sweep() closes it
        task.lines =
            setting_.grid_of(task.round).strip_lines(run.own_fan(), task.front->next_line(), plan_.strip_lines);
        const ChunkRequest request = task.front->request(task.lines, params_.cull ? source_.block_map() : nullptr);
        if (!request.window.empty()) {
            task.chunk = source_.load(request);
            task.beside_bytes = source_.cost(request).beside_bytes;
            task.has_chunk = true;
            span.add_bytes(task.chunk.bytes_read);
            if (task.round > 0) {
                task.report.bytes_again += task.chunk.bytes_read;
                task.report.bytes_spilled += task.chunk.bytes_spilled;
                break;
            }
            count_skipped(request, task.report);
            task.report.level_posts[static_cast<std::size_t>(request.level)] += task.chunk.posts_read;
            task.report.posts_skipped[static_cast<std::size_t>(Skip::detail)] +=
                (task.chunk.posts_read << (2 * request.level)) - task.chunk.posts_read;
            task.report.posts_read += task.chunk.posts_read;
            task.report.bytes_read += task.chunk.bytes_read;
            task.report.bytes_spilled += task.chunk.bytes_spilled;
            ++task.report.chunks;
        }
        break;
    }
    const Stopwatch::Took took = watch.took();
    task.report.load_s += took.cpu_s;
    task.report.disk_wait_s += took.wait_s;
    note_memory();
}

bool Wedges::sweep(WedgeTask& task) {
    if (task.run >= task.wedge.runs.size()) return refine(task);
    if (params_.stop) params_.stop->check();
    const Span span(params_.timeline, "sweep", "cpu", task.report.index);
    const Stopwatch watch;
    Front& front = *task.front;
    if (!front.finished()) front.advance(task.lines, task.has_chunk ? &task.chunk : nullptr, params_.cull);
    const std::size_t held = task.cells->bytes() + task.chunk.bytes() + task.beside_bytes + front.bytes();
    task.report.peak_bytes = std::max(task.report.peak_bytes, held);
    hold(task, held);
    if (front.finished()) {
        front.finish();
        const SweepCost& cost = front.cost();
        task.report.samples += cost.samples;
        task.report.visible_pieces += cost.pieces;
        (task.round > 0 ? task.report.bytes_again : task.report.bytes_read) += front.culture_bytes_read();
        task.report.bytes_spilled += front.culture_bytes_spilled();
        task.report.load_s += front.culture_cost().cpu_s;
        task.report.wall_s -= front.culture_cost().cpu_s;
        task.report.disk_wait_s += front.culture_cost().wait_s;
        if (front.unknown_code() && (!task.unknown_code || *front.unknown_code() < *task.unknown_code))
            task.unknown_code = front.unknown_code();
        // The front counts ticks; CPU seconds of the node are shared out by them below.
        task.report.sample_s += static_cast<double>(cost.clock.spent(StageClock::sample));
        task.report.sweep_s += static_cast<double>(cost.clock.spent(StageClock::sweep));
        task.report.shade_s += static_cast<double>(cost.clock.spent(StageClock::shade));
        task.report.deposit_s += static_cast<double>(cost.clock.spent(StageClock::deposit));
        task.front.reset();
        ++task.run;
    }
    task.chunk = Chunk{};
    task.report.wall_s += watch.cpu_s();  // CPU of this node, until merge() puts wall time here
    return task.run < task.wedge.runs.size() || refine(task);
}

bool Wedges::refine(WedgeTask& task) {
    if (task.report.reused || !setting_.refinement.on() || task.round > Refinement::most_rounds) return false;
    const Stopwatch watch;
    if (task.round == 0 || task.next_doubted == task.doubted.size()) {
        task.doubted = rows_in_doubt(*task.cells, task.doubted, setting_.refinement);
        std::uint64_t bins = 0;
        for (const Interval rows : task.doubted) bins += static_cast<std::uint64_t>(rows.size());
        if (++task.round == 1) task.report.refined_bins = bins;
        if (task.round > Refinement::most_rounds) {
            task.report.doubtful_bins = bins;
            task.doubted.clear();
        }
        for (const Interval rows : task.doubted) task.cells->clear(rows);
        task.next_doubted = 0;
        if (!task.doubted.empty()) task.next_row = task.doubted.front().begin;
    }
    const bool more = task.next_doubted < task.doubted.size();
    if (more) take_doubted(task);
    task.report.wall_s += watch.cpu_s();
    return more;
}

void Wedges::take_doubted(WedgeTask& task) {
    const SpokeGrid& grid = setting_.grid_of(task.round);
    const std::int64_t first = task.report.azimuth_bins.begin;
    const std::size_t room = plan_.forecast[static_cast<std::size_t>(task.report.index)].lanes;
    const std::int64_t end = task.doubted[task.next_doubted].end;
    Interval some{task.next_row, end};
    const auto lanes = [](const Wedge& part) {
        std::int64_t most = 0;
        for (const SpokeRun& run : part.runs)
            for (std::size_t ring = 0; ring < run.spokes.size(); ++ring)
                most = std::max(most, run.spokes[ring].size() + run.spokes[ring > 0 ? ring - 1 : 0].size());
        return static_cast<std::size_t>(most);
    };
    Wedge part = grid.wedge(task.wedge.index, {first + some.begin, first + some.end});
    while (some.size() > 1 && lanes(part) > room) {
        some.end = some.begin + some.size() / 2;
        part = grid.wedge(task.wedge.index, {first + some.begin, first + some.end});
    }
    for (SpokeRun& run : part.runs) run.first_row += some.begin;
    task.wedge.runs = std::move(part.runs);
    task.run = 0;
    task.next_row = some.end;
    if (some.end == end && ++task.next_doubted < task.doubted.size())
        task.next_row = task.doubted[task.next_doubted].begin;
}

void Wedges::merge(WedgeTask& task) {
    const Span span(params_.timeline, "merge", "cpu", task.report.index);
    const Stopwatch watch;
    const PolarGrid& swept = setting_.scene.swept;
    const auto first = static_cast<std::size_t>(task.report.azimuth_bins.begin - swept.azimuth_bins.begin);
    for (std::size_t row = 0; task.cells && row < task.cells->rows(); ++row)
        task.cells->finish(row, result_.echo_w.row(first + row), result_.echo_state.row(first + row));
    if (task.unknown_code && (!unknown_code_ || *task.unknown_code < *unknown_code_)) unknown_code_ = task.unknown_code;
    WedgeReport& r = task.report;
    const double ticks = r.sample_s + r.sweep_s + r.shade_s + r.deposit_s;
    if (ticks > 0 && !r.reused)
        for (double* part : {&r.sample_s, &r.sweep_s, &r.shade_s, &r.deposit_s}) *part *= r.wall_s / ticks;
    if (!r.reused) {
        std::uint64_t skipped = 0;
        for (const std::uint64_t posts : r.posts_skipped) skipped += posts;
        r.bytes_skipped = skipped * static_cast<std::uint64_t>(setting_.data_base.post_bytes);
        r.merge_s = watch.cpu_s();
        r.wall_s = seconds_since(task.entered);
    }
    result_.report.wedges.push_back(r);
    task.cells.reset();
    hold(task, 0);
    result_.report.peak_budget_bytes = std::max(result_.report.peak_budget_bytes, plan_.fixed_bytes + budget_.peak());
    result_.report.peak_held_bytes = plan_.fixed_bytes + most_held_.load();
    ++merged_;
    if (params_.progress) params_.progress(static_cast<double>(merged_) / static_cast<double>(wanted_.size()));
    result_.report.merge_s += watch.wall_s();
}

void Wedges::sweep_all(Threads& threads) {
    namespace flow = tbb::flow;
    const Span span(params_.timeline, "wedges", "stage");
    opened_ = Clock::now();
    threads.execute([&] {
        flow::graph graph;
        auto next = static_cast<std::size_t>(wanted_.begin);
        flow::input_node<std::size_t> wedges(graph, [&](tbb::flow_control& control) -> std::size_t {
            // The node may ask again after it was told to stop.
            if (next >= static_cast<std::size_t>(wanted_.end)) {
                control.stop();
                return 0;
            }
            return next++;
        });
        flow::limiter_node<std::size_t> limiter(graph, static_cast<std::size_t>(plan_.in_flight));
        flow::function_node<std::size_t, Task> entrance(graph, flow::unlimited,
                                                        [&](std::size_t index) { return enter(index); });
        flow::function_node<Task, Task> loader(graph, flow::unlimited, [&](const Task& task) {
            load(*task);
            return task;
        });
        using Sweeper = flow::multifunction_node<Task, std::tuple<Task, Task>>;
        Sweeper sweeper(graph, flow::unlimited, [&](const Task& task, Sweeper::output_ports_type& out) {
            if (sweep(*task))
                std::get<0>(out).try_put(task);
            else
                std::get<1>(out).try_put(task);
        });
        flow::function_node<Task, Task> merger(graph, flow::serial, [&](const Task& task) {
            merge(*task);
            return task;
        });
        flow::function_node<Task, flow::continue_msg> keeper(graph, flow::unlimited, [&](const Task& task) {
            keep(*task);
            leave(*task);
            return flow::continue_msg();
        });
        flow::make_edge(wedges, limiter);
        flow::make_edge(limiter, entrance);
        flow::make_edge(entrance, loader);
        flow::make_edge(loader, sweeper);
        flow::make_edge(flow::output_port<0>(sweeper), loader);
        flow::make_edge(flow::output_port<1>(sweeper), merger);
        flow::make_edge(merger, keeper);
        flow::make_edge(keeper, limiter.decrementer());
        wedges.activate();
        graph.wait_for_all();
    });
    if (unknown_code_) throw unknown_class_error(setting_.data_base, *unknown_code_);
    std::sort(result_.report.wedges.begin(), result_.report.wedges.end(),
              [](const auto& a, const auto& b) { return a.index < b.index; });
}

/// Part of an image that holds it.
template <class T>
PolarImage<T> part_of(const PolarImage<T>& image, const PolarGrid& part, PolarImage<T>&& used) {
    PolarImage<T> out(part, std::move(used));
    const auto skip = static_cast<std::size_t>(part.range_bins.begin - image.grid.range_bins.begin);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, part.azimuth_count(), 16), [&](const auto& rows) {
        for (std::size_t i = rows.begin(); i < rows.end(); ++i) {
            const std::int64_t azimuth = part.azimuth_bins.begin + static_cast<std::int64_t>(i);
            std::copy_n(image.row(image.grid.row_of(azimuth)) + skip, part.range_count(), out.row(i));
        }
    });
    return out;
}

using StateCounts = std::array<std::uint64_t, state_count>;

StateCounts count_states(const PolarImage<std::uint8_t>& image) {
    const auto add = [](StateCounts a, const StateCounts& b) {
        for (std::size_t code = 0; code < a.size(); ++code) a[code] += b[code];
        return a;
    };
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, image.cells.size(), 1 << 16), StateCounts{},
        [&](const auto& cells, StateCounts counts) {
            // In four tables: a single one waits for its own last sum.
            std::array<StateCounts, 4> parts{};
            std::size_t i = cells.begin();
            for (; i + 4 <= cells.end(); i += 4)
                for (std::size_t k = 0; k < 4; ++k) ++parts[k][image.cells[i + k]];
            for (; i < cells.end(); ++i) ++parts[0][image.cells[i]];
            for (const StateCounts& part : parts) counts = add(counts, part);
            return counts;
        },
        add);
}

void check_only(const std::optional<Interval>& only, std::size_t wedges) {
    if (!only || (!only->empty() && only->begin >= 0 && only->end <= static_cast<std::int64_t>(wedges))) return;
    throw InputError(text("only-wedge is ", only->begin, "-", only->end - 1, "; this run has ", wedges,
                          wedges == 1 ? " wedge, 0" : text(" wedges, 0 to ", wedges - 1)));
}

int threads_of(const EngineParams& params) {
    return params.threads > 0 ? params.threads : tbb::this_task_arena::max_concurrency();
}
}  // namespace

SceneTables::SceneTables(const Scene& scene)
    : laws(laws_of(scene)), shore(laws_of(scene)), weather(weather_of(scene), scene.radar.frequency_hz),
      pattern(scene.radar.antenna), receiver(scene.receiver, scene.radar) {}

std::optional<PathLossTable> loss_table(const ResolvedScene& scene, const Weather& weather, double most_range_m) {
    if (weather.clear()) return std::nullopt;
    return PathLossTable(weather, loss_rays(scene, most_range_m));
}

Plan plan(const ResolvedScene& scene, WedgeSource& given, const EngineParams& params) {
    SceneSource own(given, scene.scene);
    WedgeSource& source = *own;
    const SpokeSetting spokes(scene, source);
    Plan wedges = plan(scene, source, spokes.grid, params, threads_of(params), true);
    if (params.archive) check_only(params.only_wedges, wedges.wedges.size());  // without one the split may be another
    return wedges;
}

namespace {

/// TooLittleMemory, in the words of plan(), where the images alone leave no room. Asked before anything is made for each range bin:
/// of a scene that is refused there may be any number.
void require_room(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params) {
    if (image_bytes(scene, params.draw) + source.cache_bytes() < params.memory_bytes) return;
    const SpokeSetting spokes(scene, source);
    plan(scene, source, spokes.grid, params, threads_of(params));
}

/// Where the last echoes were not kept, another image has their memory.
template <class T>
void take_back(PolarImage<T>& image, PolarImage<T>& other) {
    if (image.cells.empty()) std::swap(image, other);
}

/// Echo and states of what is swept, and what the wedges did; the images' memory is used again.
void sweep(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params, const WeatherHere& weather,
           Threads& crew, RunResult& result) {
    const int threads = threads_of(params);
    result.scene = scene;
    result.report = RunReport{};
    result.report.threads = threads;

    const std::uint64_t data = params.data ? *params.data : source.fingerprint({});
    Span survey(params.timeline, "survey", "stage");
    const Stopwatch watch;
    const Setting setting(scene, source, params.tables, weather.loss ? &*weather.loss : nullptr);
    Plan wedges = plan(scene, source, setting.grid, params, threads);
    check_only(params.only_wedges, wedges.wedges.size());
    if (params.archive && params.archive->record_split(wedges.wedges) != wedges.wedges) {
        wedges = plan(scene, source, setting.grid, params, threads);  // another process was first
        check_only(params.only_wedges, wedges.wedges.size());
    }
    result.levels = setting.levels.any();
    result.sampling = setting.sampling;
    result.promise = promise_of(scene, source.data_base());
    result.report.survey_s = watch.wall_s();
    survey.end();

    take_back(result.echo_w, result.received_w.cells.empty() ? result.power_w : result.received_w);
    take_back(result.echo_state, result.state);
    result.echo_w = PolarImage<float>(scene.swept, std::move(result.echo_w));
    result.echo_state = PolarImage<std::uint8_t>(scene.swept, std::move(result.echo_state));
    Wedges(setting, source, wedges, params, threads, result).sweep_all(crew);
    if (!params.beside_others) trim_freed_memory();  // what the wedges held is the images' now
    result.report.peak_held_bytes += source.held_bytes() - source.cache_bytes();
    {
        // Of the wedges that were left to do.
        std::vector<bool> done(wedges.wedges.size(), false);
        std::size_t count = 0;
        for (const WedgeReport& w : result.report.wedges)
            if (!w.reused) done[static_cast<std::size_t>(w.index)] = true, ++count;
        const WedgeForecast planned = wedges.total(done);
        result.report.planned = {count, planned.chunks, planned.posts, planned.bytes, planned.peak_bytes};
    }
    result.report.skipped = source.skipped();
    result.report.source = source.report();
    if (params.timeline) params.timeline->memory(wedges.fixed_bytes);
    check_unchanged(source, data);
}

/// Range bins of an image in which nothing is received, not even noise, for their middle is nearer than the minimum range: the receiver
/// is not open yet.
std::size_t blanked_bins(const ResolvedScene& scene, const PolarGrid& grid) {
    const double least_m = minimum_range_m(scene);
    const auto slant_m = [&](std::size_t j) {
        return slant_range_m(
            scene, (static_cast<double>(grid.range_bins.begin) + static_cast<double>(j) + 0.5) * grid.range_bin_m);
    };
    std::size_t blanked = 0;
    while (blanked < grid.range_count() && slant_m(blanked) < least_m) ++blanked;
    return blanked;
}

/// Fewer cells than the picture looks at, four a pixel: an image of received power is then made sooner than that is found for each
/// look. The same bits either way.
bool fewer_cells_than_looks(const ResolvedScene& scene) {
    const auto size = static_cast<std::size_t>(scene.scene.display.size);
    return scene.shown.cells() <= 4 * size * size;
}

/// What reaches the receiver from the echoes, and what it makes of that: as an image where something is drawn or that is quicker, or
/// with `keep_received`.
void receive(const EngineParams& params, const WeatherHere& weather, bool keep_received, RunResult& result) {
    const ResolvedScene& scene = result.scene;
    const BeamSetting beam = beam_setting(scene);
    const ReceiverParams& receiver = scene.scene.receiver;
    const bool as_image = keep_received || (params.draw && (receiver.fluctuates() || fewer_cells_than_looks(scene)));
    const bool echo_done =
        !params.keep_echo && (!as_image || receiver.speckle_looks == 0);  // speckle asks for it again
    {
        const Span stage(params.timeline, "beam", "stage");
        const Stopwatch watch;
        if (echo_done && !as_image && scene.shown == scene.swept)
            result.power_w = power_in_place(std::exchange(result.echo_w, {}), beam, weather.rain_w);
        else
            result.power_w = power_image(result.echo_w, scene.shown, beam, std::move(result.power_w), weather.rain_w);
        result.report.beam_s = watch.wall_s();
    }
    if (!as_image) {
        result.received_w = {};
        return;
    }
    const Span stage(params.timeline, "receiver", "stage");
    const Stopwatch watch;
    if (echo_done) result.received_w = std::exchange(result.echo_w, {});
    const FluctuationSetting fluctuation{receiver.speckle_looks, receiver.noise, scene.noise_power_w, receiver.seed};
    result.received_w =
        received_power(result.echo_w, result.power_w, beam, fluctuation, std::move(result.received_w), weather.rain_w);
    const std::size_t blanked = blanked_bins(scene, scene.shown);
    for (std::size_t i = 0; i < scene.shown.azimuth_count(); ++i) std::fill_n(result.received_w.row(i), blanked, 0.0F);
    result.report.receiver_s = watch.wall_s();
}

/// What the tube shows of it.
void draw(const EngineParams& params, const Receiver& receiver, RunResult& result) {
    const ResolvedScene& scene = result.scene;
    const Span stage(params.timeline, "display", "stage");
    const Stopwatch watch;
    if (!params.keep_echo && scene.shown == scene.swept)
        result.state = std::exchange(result.echo_state, {});
    else
        result.state = part_of(result.echo_state, scene.shown, std::move(result.state));
    result.report.states = count_states(result.state);
    if (params.draw) {
        const ReceivedPower received =
            result.received_w.cells.empty()
                ? ReceivedPower(result.power_w, scene.noise_power_w, blanked_bins(scene, scene.shown))
                : ReceivedPower(result.received_w);
        result.scope = picture(received, result.state, display_setting(scene), receiver, std::move(result.scope));
    } else {
        result.scope = {};
    }
    result.report.display_s = watch.wall_s();
}

EngineParams with_tables(const EngineParams& params, const ResolvedScene& scene) {
    EngineParams own = params;
    if (!own.tables) own.tables = std::make_shared<const SceneTables>(scene.scene);
    return own;
}

/// What a group of azimuths did, into the report of the whole.
void add(const RunReport& part, RunReport& whole) {
    for (WedgeReport wedge : part.wedges) {
        wedge.index = static_cast<std::int64_t>(whole.wedges.size());
        whole.wedges.push_back(wedge);
    }
    whole.survey_s += part.survey_s;
    whole.merge_s += part.merge_s;
    whole.beam_s += part.beam_s;
    whole.receiver_s += part.receiver_s;
    whole.peak_budget_bytes = std::max(whole.peak_budget_bytes, part.peak_budget_bytes);
    whole.peak_held_bytes = std::max(whole.peak_held_bytes, part.peak_held_bytes);
    whole.planned.wedges += part.planned.wedges;
    whole.planned.chunks += part.planned.chunks;
    whole.planned.posts += part.planned.posts;
    whole.planned.bytes += part.planned.bytes;
    whole.planned.peak_bytes = std::max(whole.planned.peak_bytes, part.planned.peak_bytes);
    whole.threads = part.threads;
    whole.source = part.source;
    whole.skipped = part.skipped;
}

/// Rows of a group that are the whole's: its own azimuths and, of the first and the last group, those of the skirt outside.
void take_rows(const RunResult& group, bool keep_echo, RunResult& whole) {
    const PolarGrid &shown = whole.scene.shown, &part = group.scene.shown;
    const std::int64_t circle = shown.circle_bins, skirt = skirt_bins(beam_setting(whole.scene), circle);
    const std::int64_t begin = bins_after(part.azimuth_bins.begin, shown.azimuth_bins.begin, circle),
                       end = begin + part.azimuth_bins.size(), all = shown.azimuth_bins.size();
    const PolarGrid& swept = group.echo_w.grid;
    for (std::int64_t bin = swept.azimuth_bins.begin; bin < swept.azimuth_bins.end; ++bin) {
        const std::int64_t at = bins_after(bin, shown.azimuth_bins.begin, circle);
        const bool own = at < all ? at >= begin && at < end : circle - at <= skirt ? begin == 0 : end == all;
        if (!own) continue;
        const std::size_t from = static_cast<std::size_t>(bin - swept.azimuth_bins.begin),
                          to = whole.echo_state.grid.row_of(bin);
        if (to >= whole.echo_state.grid.azimuth_count()) continue;
        if (keep_echo) std::copy_n(group.echo_w.row(from), swept.range_count(), whole.echo_w.row(to));
        std::copy_n(group.echo_state.row(from), swept.range_count(), whole.echo_state.row(to));
    }
    for (std::int64_t i = begin; i < end; ++i) {
        const auto from = static_cast<std::size_t>(i - begin), to = static_cast<std::size_t>(i);
        std::copy_n(group.power_w.row(from), shown.range_count(), whole.power_w.row(to));
        if (!group.received_w.cells.empty())
            std::copy_n(group.received_w.row(from), shown.range_count(), whole.received_w.row(to));
    }
}

}  // namespace

RunResult run(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params) {
    RunResult used;
    return run(scene, source, params, std::move(used));
}

namespace {

/// The scene's own tables are in `params`. With only_wedges nothing is received; `keep_received`: as receive().
RunResult sweep_and_receive(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params,
                            bool keep_received, Threads& crew, RunResult&& used) {
    SceneSource own(source, scene.scene);
    require_room(scene, *own, params);
    RunResult result = std::move(used);
    const WeatherHere weather(scene, params.tables->weather, params.tables->pattern);
    sweep(scene, *own, params, weather, crew, result);
    if (!params.only_wedges) crew.execute([&] { receive(params, weather, keep_received, result); });
    return result;
}

}  // namespace

RunResult run(const ResolvedScene& scene, WedgeSource& source, const EngineParams& given, RunResult&& used) {
    const EngineParams params = with_tables(given, scene);
    Threads crew(threads_of(params), !params.beside_others);
    RunResult result = sweep_and_receive(scene, source, params, false, crew, std::move(used));
    if (params.only_wedges) return result;
    crew.execute([&] { draw(params, params.tables->receiver, result); });
    if (!params.beside_others) result.received_w = {};
    if (params.stop) params.stop->check();
    return result;
}

RunResult measure(const ResolvedScene& scene, WedgeSource& source, const EngineParams& given, RunResult&& used) {
    EngineParams params = with_tables(given, scene);
    params.keep_echo = params.draw = true;
    Threads crew(threads_of(params), !params.beside_others);
    RunResult result = sweep_and_receive(scene, source, params, true, crew, std::move(used));
    if (params.stop) params.stop->check();
    return result;
}

bool holds(const PolarGrid& stored, const PolarGrid& wanted) {
    return stored.circle_bins == wanted.circle_bins && stored.range_bin_m == wanted.range_bin_m &&
           intersection(stored.range_bins, wanted.range_bins) == wanted.range_bins &&
           stored.holds_azimuths(wanted.azimuth_bins);
}

RunResult show(const ResolvedScene& scene, PolarImage<float> echo_w, PolarImage<std::uint8_t> echo_state,
               const EngineParams& params) {
    if (!holds(echo_w.grid, scene.swept) || echo_state.grid != echo_w.grid)
        throw Error("the echo image does not hold what the scene sweeps");
    RunResult result;
    result.scene = scene;
    result.report.threads = threads_of(params);
    const bool rain = scene.scene.weather.rain_mm_h > 0;
    const WeatherHere weather =
        rain ? WeatherHere(scene, Weather(weather_of(scene.scene), scene.scene.radar.frequency_hz),
                           PatternTable(scene.scene.radar.antenna))
             : WeatherHere();
    Threads crew(result.report.threads, !params.beside_others);
    crew.execute([&] {
        const bool whole = echo_w.grid == scene.swept;
        result.echo_w = whole ? std::move(echo_w) : part_of(echo_w, scene.swept, {});
        result.echo_state = whole ? std::move(echo_state) : part_of(echo_state, scene.swept, {});
        echo_w = {}, echo_state = {};  // the power image is made in the room of what is left over
        receive(params, weather, false, result);
        draw(params, Receiver(scene.scene.receiver, scene.scene.radar), result);
    });
    result.received_w = {};
    if (params.stop) params.stop->check();
    return result;
}

RunResult run(const ResolvedScene& scene, const Scan& scan, WedgeSource& source, const EngineParams& given,
              RunResult&& used) {
    const EngineParams params = with_tables(given, scene);
    if (params.archive || params.only_wedges || scan.step < 1)
        throw Error("a scan's groups are steps of at least one bin, and no archive keeps them");
    RunResult result = std::move(used);
    result.scene = scene;
    result.report = RunReport{};
    result.levels = false;
    take_back(result.echo_state, result.state);
    if (params.keep_echo) result.echo_w = PolarImage<float>(scene.swept, std::move(result.echo_w));
    result.echo_state = PolarImage<std::uint8_t>(scene.swept, std::move(result.echo_state));
    result.power_w = PolarImage<float>(scene.shown, std::move(result.power_w));
    result.received_w =
        params.draw ? PolarImage<float>(scene.shown, std::move(result.received_w)) : PolarImage<float>();

    Threads crew(threads_of(params), !params.beside_others);
    SceneSource ground(source, scene.scene);
    EngineParams own = params;
    own.keep_echo = true;
    const std::size_t images = image_bytes(scene, params.draw);
    own.memory_bytes -= std::min(own.memory_bytes, images);
    own.progress = {};
    auto held = std::make_unique<RunResult>();
    RunResult& group = *held;
    for (Interval bins{scene.shown.azimuth_bins.begin, 0}; bins.begin < scene.shown.azimuth_bins.end;
         bins.begin = bins.end) {
        bins.end = std::min(bins.begin + scan.step, scene.shown.azimuth_bins.end);
        ResolvedScene place = scan.at(bins);
        if (place.shown.range_bins != scene.shown.range_bins || place.swept.range_bins != scene.swept.range_bins)
            throw Error("a scan's groups have other range bins than the whole");
        const WeatherHere weather(place, params.tables->weather, params.tables->pattern);
        sweep(place, *ground, own, weather, crew, group);
        crew.execute([&] { receive(own, weather, params.draw, group); });
        take_rows(group, params.keep_echo, result);
        add(group.report, result.report);
        result.levels = result.levels || group.levels;
        if (bins.begin == scene.shown.azimuth_bins.begin) {
            result.sampling = group.sampling;
            result.promise = group.promise;
        }
        if (params.stop) params.stop->check();
    }
    result.report.peak_budget_bytes += images;
    result.report.peak_held_bytes += images;
    result.report.planned.peak_bytes += images;
    held.reset();
    crew.execute([&] { draw(params, params.tables->receiver, result); });
    if (!params.beside_others) result.received_w = {};
    if (params.stop) params.stop->check();
    return result;
}

RunResult::RunResult() = default;
RunResult::RunResult(const RunResult&) = default;
RunResult::RunResult(RunResult&&) noexcept = default;
RunResult& RunResult::operator=(const RunResult&) = default;
RunResult& RunResult::operator=(RunResult&&) noexcept = default;
RunResult::~RunResult() = default;

}  // namespace wedgescope
