#include "lib/engine.hpp"

#include <tbb/flow_graph.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <memory>

#include "lib/error.hpp"
#include "lib/fluctuation.hpp"
#include "lib/front.hpp"
#include "lib/memory_budget.hpp"
#include "lib/plan.hpp"
#include "lib/receiver.hpp"
#include "lib/rounding.hpp"
#include "lib/spoke_map.hpp"

namespace wedgescope {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

double thread_cpu_s() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double most_gamma(const std::vector<ClassGamma>& gamma) {
    double most = 0;
    for (const ClassGamma& g : gamma) most = std::max({most, g.ground, g.wall});
    return most;
}

/// Everything the wedges of one run share, and never change.
struct Setting {
    const ResolvedScene& scene;
    const DataBase& data_base;
    SpokeMap map;
    SpokeGrid grid;
    std::vector<ClassGamma> gamma;
    PatternTable pattern;
    Quanta cells;
    SweepScene sweep;

    static SpokeMapParams map_params(const ResolvedScene& s, const DataBase& db) {
        const double range = *s.scene.range_m, theta = range * s.earth.inverse_radius();
        const double post = std::hypot(db.step_x, db.step_y) * db.metres_per_unit * (db.crs_in_metres ? 1 : 111320);
        return {s.geometry, s.nadir, s.lat_deg, s.lon_deg, s.scene.earth_k,
                // The arc of a slant range is at most this much longer, down to 2 km below sea level.
                rounded(range * (1.0005 + theta * theta / 4) + 2 * post, 10)};
    }

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

    Setting(const ResolvedScene& s, WedgeSource& source)
        : scene(s), data_base(source.data_base()), map(data_base, map_params(s, data_base)),
          grid(data_base, map, sampling(s.scene.quality), s.swept.circle_bins),
          gamma(gamma_table(s.scene.radar.frequency_hz, s.scene.gamma)), pattern(s.scene.radar.antenna),
          cells(quanta(s.swept.range_bins, s.swept.range_bin_m, radar_constant(s.scene.radar), pattern.most(),
                       grid.azimuth_step_rad(), most_gamma(gamma))) {
        sweep.data_base = &data_base;
        sweep.grid = &grid;
        sweep.sampling = sampling(s.scene.quality);
        sweep.sensor_m = s.sensor_m;
        sweep.reference_m = s.reference_m;
        sweep.nadir_surface_m = s.nadir_on_data ? s.nadir_surface_m : std::numeric_limits<double>::quiet_NaN();
        sweep.nadir_patch = &s.nadir_patch;
        sweep.max_arc_m = map.params().max_arc_m;
        constexpr double least_radius_m = 6335439;  // of the WGS84 meridian, at the equator
        sweep.most_theta = s.scene.earth_k ? sweep.max_arc_m / (*s.scene.earth_k * least_radius_m) : 0;
        sweep.range_bin_m = s.swept.range_bin_m;
        sweep.range_is_ground = s.scene.display.kind == DisplayKind::gpi_true;
        sweep.pattern = &pattern;
        sweep.constant = radar_constant(s.scene.radar);
        sweep.gamma = gamma;
        sweep.source = &source;
        if (BlockMap* bounds = source.block_map()) sweep.smooth_sine = smooth_horizon(*bounds);
    }
};

/// One wedge on its way through the graph: run after run, strip after strip.
struct WedgeTask {
    Wedge wedge;
    std::unique_ptr<WedgeCells> cells;
    std::unique_ptr<Front> front;
    std::size_t run = 0;
    Interval lines;  // of the chunk that was loaded last
    Chunk chunk;
    bool has_chunk = false;
    std::size_t beside_bytes = 0;  // while it was read
    std::size_t held_bytes = 0;    // as last counted
    MemoryBudget::Token token;
    std::optional<std::int32_t> unknown_code;
    WedgeReport report;
    Clock::time_point entered;
};
using Task = std::shared_ptr<WedgeTask>;

class Wedges {
public:
    Wedges(const Setting& setting, WedgeSource& source, const Plan& plan, const EngineParams& params, RunResult& result)
        : setting_(setting), source_(source), plan_(plan), params_(params), result_(result),
          budget_(params.memory_bytes) {}

    void sweep_all(int threads);

private:
    Task enter(std::size_t index);
    void load(WedgeTask& task);
    bool sweep(WedgeTask& task);  // true: another chunk is wanted
    void merge(WedgeTask& task);
    /// The wedge holds so much from now on.
    void hold(WedgeTask& task, std::size_t bytes);

    const Setting& setting_;
    WedgeSource& source_;
    const Plan& plan_;
    const EngineParams& params_;
    RunResult& result_;
    MemoryBudget budget_;
    std::optional<std::int32_t> unknown_code_;
    std::size_t merged_ = 0;
    std::atomic<std::size_t> held_{0}, most_held_{0};
};

void Wedges::hold(WedgeTask& task, std::size_t bytes) {
    const std::size_t now = held_.fetch_add(bytes - task.held_bytes) + bytes - task.held_bytes;
    task.held_bytes = bytes;
    std::size_t most = most_held_.load();
    while (now > most && !most_held_.compare_exchange_weak(most, now)) {
    }
}

Task Wedges::enter(std::size_t index) {
    auto task = std::make_shared<WedgeTask>();
    task->entered = Clock::now();
    // The limiter lets no more wedges in than the plan grants memory for: this never waits.
    task->token = budget_.take(plan_.wedge_bytes);
    task->wedge = setting_.grid.wedge(static_cast<std::int64_t>(index), plan_.wedges[index]);
    task->cells = std::make_unique<WedgeCells>(static_cast<std::size_t>(plan_.wedges[index].size()), setting_.cells);
    task->report.index = static_cast<std::int64_t>(index);
    task->report.azimuth_bins = plan_.wedges[index];
    return task;
}

/// Posts of the window that need not be read, by reason.
void count_skipped(const ChunkRequest& request, WedgeReport& report) {
    std::size_t at = 0;
    for (std::int64_t r = request.blocks.rows.begin; r < request.blocks.rows.end; ++r)
        for (std::int64_t c = request.blocks.columns.begin; c < request.blocks.columns.end; ++c, ++at) {
            if (request.skip.empty() || request.skip[at] == Skip::none) continue;
            const auto posts = [](std::int64_t i) { return Interval{i * block_posts, (i + 1) * block_posts}; };
            report.posts_skipped[static_cast<std::size_t>(request.skip[at])] += static_cast<std::uint64_t>(
                Window{intersection(posts(c), request.window.columns), intersection(posts(r), request.window.rows)}
                    .posts());
        }
}

void Wedges::load(WedgeTask& task) {
    if (params_.stop) params_.stop->check();
    const double start = thread_cpu_s();
    task.has_chunk = false;
    while (task.run < task.wedge.runs.size()) {
        const SpokeRun& run = task.wedge.runs[task.run];
        if (!task.front) task.front = std::make_unique<Front>(setting_.sweep, run, *task.cells);
        if (task.front->finished()) break;  // sweep() closes it
        task.lines = setting_.grid.strip_lines(run.quadrant, task.front->next_line(), plan_.strip_lines);
        const ChunkRequest request = task.front->request(task.lines, params_.cull ? source_.block_map() : nullptr);
        if (!request.window.empty()) {
            count_skipped(request, task.report);
            task.chunk = source_.load(request);
            task.beside_bytes = source_.cost(request).beside_bytes;
            task.has_chunk = true;
            task.report.posts_read += task.chunk.posts_read;
            task.report.bytes_read += task.chunk.bytes_read;
            ++task.report.chunks;
        }
        break;
    }
    task.report.load_s += thread_cpu_s() - start;
}

bool Wedges::sweep(WedgeTask& task) {
    if (task.run >= task.wedge.runs.size()) return false;
    if (params_.stop) params_.stop->check();
    const double start = thread_cpu_s();
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
        task.report.bytes_read += front.culture_bytes_read();
        if (front.unknown_code() && (!task.unknown_code || *front.unknown_code() < *task.unknown_code))
            task.unknown_code = front.unknown_code();
        // The front counts ticks; CPU seconds of the node are shared out by them below.
        task.report.sample_s += static_cast<double>(cost.sample);
        task.report.sweep_s += static_cast<double>(cost.sweep);
        task.report.shade_s += static_cast<double>(cost.shade);
        task.report.deposit_s += static_cast<double>(cost.deposit);
        task.front.reset();
        ++task.run;
    }
    task.chunk = Chunk{};
    task.report.wall_s += thread_cpu_s() - start;  // CPU of this node, until merge() puts wall time here
    return task.run < task.wedge.runs.size();
}

void Wedges::merge(WedgeTask& task) {
    const auto start = Clock::now();
    const PolarGrid& swept = setting_.scene.swept;
    const auto first = static_cast<std::size_t>(task.report.azimuth_bins.begin - swept.azimuth_bins.begin);
    for (std::size_t row = 0; row < task.cells->rows(); ++row) {
        float* echo = result_.echo_w.row(first + row);
        std::uint8_t* state = result_.echo_state.row(first + row);
        for (std::size_t j = 0; j < task.cells->columns(); ++j) {
            echo[j] = static_cast<float>(task.cells->watts(row, j));
            state[j] = static_cast<std::uint8_t>(most_telling(task.cells->bits(row, j)));
        }
    }
    if (task.unknown_code && (!unknown_code_ || *task.unknown_code < *unknown_code_)) unknown_code_ = task.unknown_code;
    WedgeReport& r = task.report;
    const double ticks = r.sample_s + r.sweep_s + r.shade_s + r.deposit_s;
    if (ticks > 0)
        for (double* part : {&r.sample_s, &r.sweep_s, &r.shade_s, &r.deposit_s}) *part *= r.wall_s / ticks;
    r.wall_s = seconds_since(task.entered);
    result_.report.wedges.push_back(r);
    task.cells.reset();
    hold(task, 0);
    task.token = {};
    result_.report.peak_budget_bytes = std::max(result_.report.peak_budget_bytes, plan_.fixed_bytes + budget_.peak());
    result_.report.peak_held_bytes = plan_.fixed_bytes + most_held_.load();
    ++merged_;
    if (params_.progress) params_.progress(static_cast<double>(merged_) / static_cast<double>(plan_.wedges.size()));
    result_.report.merge_s += seconds_since(start);
}

void Wedges::sweep_all(int threads) {
    namespace flow = tbb::flow;
    tbb::task_arena arena(threads);
    arena.execute([&] {
        flow::graph graph;
        std::size_t next = 0;
        flow::input_node<std::size_t> wedges(graph, [&](tbb::flow_control& control) -> std::size_t {
            // The node may ask again after it was told to stop.
            if (next >= plan_.wedges.size()) {
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
        flow::function_node<Task, flow::continue_msg> merger(graph, flow::serial, [&](const Task& task) {
            merge(*task);
            return flow::continue_msg();
        });
        flow::make_edge(wedges, limiter);
        flow::make_edge(limiter, entrance);
        flow::make_edge(entrance, loader);
        flow::make_edge(loader, sweeper);
        flow::make_edge(flow::output_port<0>(sweeper), loader);
        flow::make_edge(flow::output_port<1>(sweeper), merger);
        flow::make_edge(merger, limiter.decrementer());
        wedges.activate();
        graph.wait_for_all();
    });
    if (unknown_code_)
        throw DataError(text("'", setting_.data_base.culture_name, "': code ", *unknown_code_,
                             " on seen ground is not in the legend '", setting_.data_base.legend_name,
                             "'; give a culture-legend that names it (info lists all codes of a culture raster)"));
    std::sort(result_.report.wedges.begin(), result_.report.wedges.end(),
              [](const auto& a, const auto& b) { return a.index < b.index; });
}

/// The shown part of the swept states.
PolarImage<std::uint8_t> shown_states(const ResolvedScene& s, const PolarImage<std::uint8_t>& swept) {
    PolarImage<std::uint8_t> out(s.shown);
    const std::int64_t circle = s.shown.circle_bins;
    const auto skip = static_cast<std::size_t>(s.shown.range_bins.begin - s.swept.range_bins.begin);
    for (std::int64_t a = s.shown.azimuth_bins.begin; a < s.shown.azimuth_bins.end; ++a) {
        const std::int64_t row = ((a - s.swept.azimuth_bins.begin) % circle + circle) % circle;
        std::copy_n(swept.row(static_cast<std::size_t>(row)) + skip, s.shown.range_count(),
                    out.row(static_cast<std::size_t>(a - s.shown.azimuth_bins.begin)));
    }
    return out;
}

}  // namespace

namespace {
int threads_of(const EngineParams& params) {
    return params.threads > 0 ? params.threads : tbb::this_task_arena::max_concurrency();
}
}  // namespace

Plan plan(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params) {
    const Setting setting(scene, source);
    return plan(scene, source, setting.grid, params, threads_of(params), true);
}

RunResult run(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params) {
    const int threads = threads_of(params);
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));

    RunResult result;
    result.scene = scene;
    result.report.threads = threads;

    auto start = Clock::now();
    const Setting setting(scene, source);
    const Plan wedges = plan(scene, source, setting.grid, params, threads);
    result.report.survey_s = seconds_since(start);
    const WedgeForecast planned = wedges.total();
    result.report.planned = {wedges.wedges.size(), planned.chunks, planned.posts, planned.bytes, planned.peak_bytes};

    result.echo_w = PolarImage<float>(scene.swept);
    result.echo_state = PolarImage<std::uint8_t>(scene.swept);
    Wedges(setting, source, wedges, params, result).sweep_all(threads);
    result.report.skipped = source.skipped();
    result.report.source = source.report();

    tbb::task_arena arena(threads);
    arena.execute([&] {
        result.state = shown_states(scene, result.echo_state);
        for (const std::uint8_t s : result.state.cells) ++result.report.states[s];

        start = Clock::now();
        const BeamSetting beam = beam_setting(scene);
        result.power_w = power_image(result.echo_w, scene.shown, beam);
        result.report.beam_s = seconds_since(start);

        start = Clock::now();
        const ReceiverParams& receiver = scene.scene.receiver;
        const FluctuationSetting fluctuation{receiver.speckle_looks, receiver.noise, scene.noise_power_w,
                                             receiver.seed};
        const PolarImage<float> received = received_power(result.echo_w, result.power_w, beam, fluctuation);
        result.report.receiver_s = seconds_since(start);

        start = Clock::now();
        result.scope = picture(received, result.state, display_setting(scene), Receiver(receiver, scene.scene.radar));
        result.report.display_s = seconds_since(start);
    });
    if (params.stop) params.stop->check();
    return result;
}

}  // namespace wedgescope
