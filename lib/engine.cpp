#include "lib/engine.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "lib/error.hpp"
#include "lib/fluctuation.hpp"
#include "lib/large_blocks.hpp"
#include "lib/plan.hpp"
#include "lib/rain_echo.hpp"
#include "lib/raised_source.hpp"
#include "lib/receiver.hpp"
#include "lib/rounding.hpp"
#include "lib/run_setting.hpp"
#include "lib/stopwatch.hpp"
#include "lib/threads.hpp"
#include "lib/wedges.hpp"

namespace wedgescope {

double slant_range_m(const ResolvedScene& s, double range_m) {
    return s.scene.display.kind == DisplayKind::gpi_true ? s.earth.slant_range_m(s.sensor_m, s.reference_m, range_m)
                                                         : range_m;
}

double minimum_range_m(const ResolvedScene& s) {
    return s.scene.receiver.minimum_range_m.value_or(s.scene.radar.pulse_extent_m());
}

namespace {

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
    EchoAround rain;                    ///< as much as the swept azimuths meet

    WeatherHere() = default;
    WeatherHere(const ResolvedScene& s, const Weather& weather, const PatternTable& pattern, Threads& crew) {
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
        if (weather.params().rain_mm_h > 0) crew.execute([&] { find_rain(s, weather, pattern, rays, edges_m); });
    }

private:
    void find_rain(const ResolvedScene& s, const Weather& weather, const PatternTable& pattern,
                   const PathLossRays& loss_of, const std::vector<double>& edges_m) {
        rain.rays.resize(std::max<std::size_t>(1, s.rain_floor.size()));
        std::vector<bool> met(rain.rays.size(), false);
        for (std::int64_t bin = s.swept.azimuth_bins.begin; bin < s.swept.azimuth_bins.end; ++bin) {
            const EchoAround::Place at = rain.at(bin, s.swept.circle_bins);
            met[at.first] = met[at.second] = true;
        }
        // The beam will widen each bin as level ground at its range; rain is wider by its own elevation already.
        const BeamSetting beam = beam_setting(s);
        std::vector<float> level;
        for (std::size_t j = 0; j < s.swept.range_count(); ++j)
            level.push_back(static_cast<float>(level_cosine(beam, s.swept.range_of_column_m(j))));
        tbb::parallel_for(std::size_t{0}, rain.rays.size(), [&](std::size_t k) {
            if (!met[k]) return;
            std::vector<float>& ray = rain.rays[k];
            ray = RainEcho(weather, *loss, pattern,
                           {s.scene.radar, loss_of.earth, s.sensor_m, s.reference_m, loss_of.most_range_m,
                            s.rain_floor.empty() ? std::vector<RainFloor>() : s.rain_floor[k]})
                      .cells_w(edges_m, s.swept.azimuth_step_rad());
            for (std::size_t j = 0; j < ray.size(); ++j) ray[j] *= level[j];
        });
    }
};

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
    Plan planned = plan(scene, source, spokes.grid, params, threads_of(params), true);
    if (params.archive) check_only(params.only_wedges, planned.wedges.size());  // without one the split may be another
    return planned;
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
    const RunSetting setting(scene, source, params.tables, weather.loss ? &*weather.loss : nullptr);
    Plan planned = plan(scene, source, setting.grid, params, threads);
    check_only(params.only_wedges, planned.wedges.size());
    if (params.archive && params.archive->record_split(planned.wedges) != planned.wedges) {
        planned = plan(scene, source, setting.grid, params, threads);  // another process was first
        check_only(params.only_wedges, planned.wedges.size());
    }
    result.levels = setting.levels.any();
    result.sampling = setting.sampling;
    result.promise = promise_of(scene);
    result.report.survey_s = watch.wall_s();
    survey.end();

    take_back(result.echo_w, result.received_w.cells.empty() ? result.power_w : result.received_w);
    take_back(result.echo_state, result.state);
    result.echo_w = PolarImage<float>(scene.swept, std::move(result.echo_w));
    result.echo_state = PolarImage<std::uint8_t>(scene.swept, std::move(result.echo_state));
    sweep_wedges(setting, source, data, planned, params, threads, crew, result);
    if (!params.beside_others) trim_freed_memory();  // what the wedges held is the images' now
    result.report.peak_held_bytes += source.held_bytes() - source.cache_bytes();
    {
        // Of the wedges that were left to do.
        std::vector<bool> done(planned.wedges.size(), false);
        std::size_t count = 0;
        for (const WedgeReport& w : result.report.wedges)
            if (!w.reused) {
                done[static_cast<std::size_t>(w.index)] = true;
                ++count;
            }
        const WedgeForecast left = planned.total(done);
        result.report.planned = {count, left.chunks, left.posts, left.bytes, left.peak_bytes};
    }
    result.report.skipped = source.skipped();
    result.report.source = source.report();
    if (params.timeline) params.timeline->memory(planned.fixed_bytes);
    check_unchanged(source, data);
}

/// Range bins of an image in which nothing is received, not even noise, for their middle is nearer than the minimum range: the receiver
/// is not open yet.
std::size_t blanked_bins(const ResolvedScene& scene, const PolarGrid& grid) {
    const double least_m = minimum_range_m(scene);
    const auto slant_m = [&](std::size_t j) { return slant_range_m(scene, grid.range_of_column_m(j)); };
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
            result.power_w = power_in_place(std::exchange(result.echo_w, {}), beam, weather.rain, params.stop);
        else
            result.power_w =
                power_image(result.echo_w, scene.shown, beam, std::move(result.power_w), weather.rain, params.stop);
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
    result.received_w = received_power(result.echo_w, result.power_w, beam, fluctuation, std::move(result.received_w),
                                       weather.rain, params.stop);
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
        result.scope =
            picture(received, result.state, display_setting(scene), receiver, std::move(result.scope), params.stop);
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
    // On bins of ground range the pulse's lead-in hangs on the height of the place.
    const Interval bins = whole.echo_state.grid.range_bins, common = intersection(bins, swept.range_bins);
    const auto copy = [&](const auto* from, auto* to, auto none) {
        std::fill_n(to, common.begin - bins.begin, none);
        std::copy_n(from + (common.begin - swept.range_bins.begin), common.size(), to + (common.begin - bins.begin));
    };
    for (std::int64_t bin = swept.azimuth_bins.begin; bin < swept.azimuth_bins.end; ++bin) {
        const std::int64_t at = bins_after(bin, shown.azimuth_bins.begin, circle);
        const bool own = at < all ? at >= begin && at < end : circle - at <= skirt ? begin == 0 : end == all;
        if (!own) continue;
        const std::size_t from = static_cast<std::size_t>(bin - swept.azimuth_bins.begin),
                          to = whole.echo_state.grid.row_of(bin);
        if (to >= whole.echo_state.grid.azimuth_count()) continue;
        if (keep_echo) copy(group.echo_w.row(from), whole.echo_w.row(to), 0.0F);
        copy(group.echo_state.row(from), whole.echo_state.row(to), static_cast<std::uint8_t>(State::outside));
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
    const WeatherHere weather(scene, params.tables->weather, params.tables->pattern, crew);
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
    Threads crew(result.report.threads, !params.beside_others);
    const bool rain = scene.scene.weather.rain_mm_h > 0;
    const WeatherHere weather =
        rain ? WeatherHere(scene, Weather(weather_of(scene.scene), scene.scene.radar.frequency_hz),
                           PatternTable(scene.scene.radar.antenna), crew)
             : WeatherHere();
    crew.execute([&] {
        const bool whole = echo_w.grid == scene.swept;
        result.echo_w = whole ? std::move(echo_w) : part_of(echo_w, scene.swept, {});
        result.echo_state = whole ? std::move(echo_state) : part_of(echo_state, scene.swept, {});
        // The power image is made in the room of what is left over.
        echo_w = {};
        echo_state = {};
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
        if (place.shown.range_bins != scene.shown.range_bins)
            throw Error("a scan's groups have other range bins than the whole");
        const WeatherHere weather(place, params.tables->weather, params.tables->pattern, crew);
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
