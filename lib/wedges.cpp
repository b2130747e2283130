#include "lib/wedges.hpp"

#include <tbb/flow_graph.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <span>
#include <tuple>

#include "lib/culture.hpp"
#include "lib/memory_budget.hpp"
#include "lib/stage_clock.hpp"
#include "lib/stopwatch.hpp"

namespace wedgescope {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

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
    double swept_cpu_s = 0;                                 // which these share:
    std::array<std::uint64_t, StageClock::stages> ticks{};  // of its fronts, by stage
    WedgeKey key;                                           // in the archive, if there is one
    Clock::time_point entered;
};
using Task = std::shared_ptr<WedgeTask>;

/// Where a report tells of a front's stages.
struct Stage {
    StageClock::Stage stage;
    double WedgeReport::*seconds;
};
constexpr Stage timed_stages[] = {{StageClock::sample, &WedgeReport::sample_s},
                                  {StageClock::sweep, &WedgeReport::sweep_s},
                                  {StageClock::shade, &WedgeReport::shade_s},
                                  {StageClock::deposit, &WedgeReport::deposit_s}};

/// CPU seconds of sweeping, by the ticks of each stage.
void share_out(WedgeTask& task) {
    std::uint64_t all = 0;
    for (const Stage& one : timed_stages) all += task.ticks[one.stage];
    if (all == 0) return;
    for (const Stage& one : timed_stages)
        task.report.*one.seconds =
            task.swept_cpu_s * static_cast<double>(task.ticks[one.stage]) / static_cast<double>(all);
}

class Wedges {
public:
    Wedges(const RunSetting& setting, WedgeSource& source, std::uint64_t data, const Plan& plan,
           const EngineParams& params, int threads, RunResult& result)
        : setting_(setting), source_(source), data_(data), plan_(plan), params_(params),
          threads_(static_cast<std::size_t>(threads)), result_(result), budget_(params.memory_bytes),
          wanted_(params.only_wedges.value_or(Interval{0, static_cast<std::int64_t>(plan.wedges.size())})) {}

    void sweep_all(Threads& threads);

private:
    Task enter(std::size_t index);
    void load(WedgeTask& task);
    void load_chunk(WedgeTask& task, Span& span);
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
    template <class T>
    static std::span<T> rows_of(const WedgeTask& task, PolarImage<T>& image);
    std::span<float> echo_rows(const WedgeTask& task);
    std::span<std::uint8_t> state_rows(const WedgeTask& task);

    const RunSetting& setting_;
    WedgeSource& source_;
    const std::uint64_t data_;
    const Plan& plan_;
    const EngineParams& params_;
    std::size_t threads_;
    RunResult& result_;
    MemoryBudget budget_;
    Interval wanted_;  // wedges to do
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
    constexpr std::uint64_t fnv_prime = 1099511628211U;
    std::uint64_t sum = 0;
    for (const auto& fan : levels.steps) {
        sum = sum * fnv_prime + fan.size() + 1;
        for (const DetailLevels::Step& step : fan)
            sum = (sum ^ static_cast<std::uint64_t>(step.border * 8 + step.level)) * fnv_prime;
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

/// Of one of the result's images those of a wedge.
template <class T>
std::span<T> Wedges::rows_of(const WedgeTask& task, PolarImage<T>& image) {
    const Interval bins = task.report.azimuth_bins;
    return {image.row(static_cast<std::size_t>(bins.begin - image.grid.azimuth_bins.begin)),
            static_cast<std::size_t>(bins.size()) * image.grid.range_count()};
}
std::span<float> Wedges::echo_rows(const WedgeTask& task) { return rows_of(task, result_.echo_w); }
std::span<std::uint8_t> Wedges::state_rows(const WedgeTask& task) { return rows_of(task, result_.echo_state); }

/// True if the archive has the wedge; it is then through but for the merge.
bool Wedges::find(WedgeTask& task) {
    if (params_.stop) params_.stop->check();
    const ResolvedScene& scene = setting_.scene;
    const std::vector<Window> posts = posts_of(setting_.grid, task.wedge, scene.nadir_patch.window);
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
    // Of a data base that changed what was read may be older than its fingerprint: a file's reader goes on with the one that it
    // opened, caches with what they hold.
    check_unchanged(source_, data_);
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
    if (task.run < task.wedge.runs.size()) load_chunk(task, span);
    const Stopwatch::Took took = watch.took();
    task.report.load_s += took.cpu_s;
    task.report.disk_wait_s += took.wait_s;
    note_memory();
}

/// The next lines of the run; none is left where its front is finished, which sweep() closes.
void Wedges::load_chunk(WedgeTask& task, Span& span) {
    const SpokeRun& run = task.wedge.runs[task.run];
    if (!task.front) task.front = std::make_unique<Front>(setting_.sweep_of(task.round), run, *task.cells);
    if (task.front->finished()) return;
    task.lines = setting_.grid_of(task.round).strip_lines(run.own_fan(), task.front->next_line(), plan_.strip_lines);
    const ChunkRequest request = task.front->request(task.lines, params_.cull ? source_.block_map() : nullptr);
    if (request.window.empty()) return;
    task.chunk = source_.load(request);
    task.beside_bytes = source_.cost(request).beside_bytes;
    task.has_chunk = true;
    span.add_bytes(task.chunk.bytes_read);
    WedgeReport& report = task.report;
    report.bytes_spilled += task.chunk.bytes_spilled;
    if (task.round > 0) {
        report.bytes_again += task.chunk.bytes_read;
        return;
    }
    count_skipped(request, report);
    report.level_posts[static_cast<std::size_t>(request.level)] += task.chunk.posts_read;
    report.posts_skipped[static_cast<std::size_t>(Skip::detail)] +=
        (task.chunk.posts_read << (2 * request.level)) - task.chunk.posts_read;
    report.posts_read += task.chunk.posts_read;
    report.bytes_read += task.chunk.bytes_read;
    ++report.chunks;
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
        task.swept_cpu_s -= front.culture_cost().cpu_s;
        task.report.disk_wait_s += front.culture_cost().wait_s;
        if (front.unknown_code() && (!task.unknown_code || *front.unknown_code() < *task.unknown_code))
            task.unknown_code = front.unknown_code();
        for (const Stage& one : timed_stages) task.ticks[one.stage] += cost.clock.spent(one.stage);
        task.front.reset();
        ++task.run;
    }
    task.chunk = Chunk{};
    task.swept_cpu_s += watch.cpu_s();
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
    task.swept_cpu_s += watch.cpu_s();
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
    WedgeReport& r = task.report;
    if (!r.reused) {
        share_out(task);
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
            // At once: the others would only take time.
            if (task->unknown_code) throw unknown_class_error(setting_.data_base, *task->unknown_code);
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
    std::sort(result_.report.wedges.begin(), result_.report.wedges.end(),
              [](const auto& a, const auto& b) { return a.index < b.index; });
}

}  // namespace

void sweep_wedges(const RunSetting& setting, WedgeSource& source, std::uint64_t data, const Plan& plan,
                  const EngineParams& params, int threads, Threads& crew, RunResult& result) {
    Wedges(setting, source, data, plan, params, threads, result).sweep_all(crew);
}

}  // namespace wedgescope
