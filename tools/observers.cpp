#include "tools/observers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>
#include <vector>

#include "lib/coverage.hpp"
#include "lib/seen_counts.hpp"
#include "lib/stopwatch.hpp"
#include "lib/target.hpp"
#include "lib/threads.hpp"
#include "tiles/count_store.hpp"
#include "tiles/coverage_raster.hpp"
#include "tiles/gdal_session.hpp"
#include "tools/budget.hpp"
#include "tools/coverage_report.hpp"
#include "tools/doubts.hpp"
#include "tools/ground.hpp"
#include "tools/observer_file.hpp"
#include "tools/report_json.hpp"
#include "tools/run_files.hpp"
#include "tools/run_records.hpp"
#include "tools/side_by_side.hpp"
#include "tools/terminal.hpp"
#include "tools/viewshed_options.hpp"

namespace wedgescope {
namespace {

using json = nlohmann::ordered_json;

/// What an observer's coverage did; small, for all observers' are kept.
struct ObserverReport {
    double lat_deg = 0, lon_deg = 0, x = 0, y = 0, sensor_m = 0;
    bool has_lat_lon = false;
    float cpu_s = 0, wall_s = 0;
    std::uint64_t seen = 0, posts_read = 0, bytes_read = 0;
};

/// How memory and threads are shared out.
struct Shares : LaneCount {
    std::size_t count_bytes = 0;  ///< of tiles of counts
    std::size_t lane_bytes = 0;   ///< what one lane may hold, with the source's cache
};

/// TooLittleMemory where one lane and the least of counts do not fit. `largest`: what a coverage holds at the least.
Shares share_out(const Settings& settings, const Observers& observers, const WedgeSource& source, std::size_t largest) {
    const DataBase& db = source.data_base();
    const std::size_t memory = memory_bytes(settings), n = observers.size(), least = CountStore::least_bytes(n),
                      own = largest + source.reader_bytes(),
                      // Beside a tile of the counts while they are written.
        shared = source.cache_bytes() + observers.bytes() + n * (sizeof(ObserverReport) + sizeof(std::uint32_t)) +
                 CountStore::index_bytes(db.columns, db.rows) + (std::size_t{1} << 20);
    if (shared + own + least > memory) throw TooLittleMemory(memory, shared + own + least, "this coverage");
    Shares shares;
    shares.threads = thread_count(settings);
    const std::size_t all = CountStore::all_bytes(db.columns, db.rows, n), free = memory - shared - own;
    shares.count_bytes = all <= std::min(free, memory / 2) ? all : std::clamp(memory / 4, least, free);
    const std::size_t rest = memory - shared - shares.count_bytes;
    shares.lanes = static_cast<int>(std::min({rest / own, static_cast<std::size_t>(shares.threads), n}));
    shares.lane_bytes = rest / static_cast<std::size_t>(shares.lanes) + source.cache_bytes();
    return shares;
}

class ObserverSweep {
public:
    ObserverSweep(const Settings& settings, const Observers& observers, WedgeSource& source, Timeline* timeline,
                  Stop& stop)
        : settings_(settings), observers_(observers), source_(source), timeline_(timeline), stop_(stop),
          reports_(observers.size()) {}

    CoverageParams params() const {
        CoverageParams p = settings_.coverage;
        p.mask = observer_codes;
        p.cull = !settings_.no_cull;
        p.reached_only = p.beside_others = true;
        p.stop = &stop_;
        p.timeline = timeline_;
        return p;
    }

    ResolvedScene scene(std::size_t i) const {
        return with_context(observers_.words(i),
                            [&] { return resolve_coverage(observers_.scene(settings_.scene, i), source_); });
    }

    /// The most that any coverage holds at the least, without the source. All observers can be resolved then, and their
    /// order is known.
    std::size_t largest() {
        const std::size_t memory = memory_bytes(settings_), cache = source_.cache_bytes();
        const std::size_t readers = memory > cache ? (memory - cache) / (source_.reader_bytes() + (1 << 20)) : 1;
        const auto threads = static_cast<std::size_t>(thread_count(settings_));
        const int lanes = static_cast<int>(std::clamp<std::size_t>(std::min(readers, observers_.size()), 1, threads));
        std::mutex mutex;
        std::size_t most = 0;
        std::vector<std::pair<std::int64_t, std::int64_t>> places(observers_.size());
        side_by_side(lanes, observers_.size(), [&](int, std::size_t i) {
            stop_.check();
            const ResolvedScene s = scene(i);
            places[i] = place(s.nadir);
            const std::size_t bytes =
                with_context(observers_.words(i), [&] { return coverage_bytes(s, source_, params()); });
            const std::lock_guard lock(mutex);
            most = std::max(most, bytes);
        });
        order_.resize(places.size());
        std::iota(order_.begin(), order_.end(), std::uint32_t{0});
        std::stable_sort(order_.begin(), order_.end(),
                         [&](std::uint32_t a, std::uint32_t b) { return places[a] < places[b]; });
        return most;
    }

    void sweep(const Shares& shares, CountStore& counts, const std::function<void(double)>& progress) {
        const double start_s = now_s();
        const Crew crew(shares.threads - shares.lanes + 1);
        std::mutex mutex;
        std::size_t done = 0;
        side_by_side(shares.lanes, observers_.size(), [&](int lane, std::size_t next) {
            stop_.check();
            const std::size_t i = order_[next];
            const Span span(timeline_, "observer", "stage", static_cast<std::int64_t>(i));
            CoverageParams p = params();
            p.threads = shares.threads_of(lane);
            p.memory_bytes = shares.lane_bytes;
            const ResolvedScene s = scene(i);
            const CoverageReport report = cover(s, source_, p, [&](const CoverageTile& tile) { counts.add(tile); });
            note(s, report, reports_[i]);
            const std::lock_guard lock(mutex);
            total_.add(report.total());
            progress(static_cast<double>(++done) / static_cast<double>(observers_.size()));
        });
        sweep_s_ = now_s() - start_s;
    }

    const std::vector<ObserverReport>& reports() const { return reports_; }
    const QuadrantReport& total() const { return total_; }
    double sweep_s() const { return sweep_s_; }

private:
    /// Rows of 1024 posts, every other one backwards: the next observer sees ground that the last one has fetched.
    static std::pair<std::int64_t, std::int64_t> place(IndexPosition nadir) {
        const auto row = static_cast<std::int64_t>(std::floor(nadir.row / 1024)),
                   column = static_cast<std::int64_t>(std::floor(nadir.column / 64));
        return {row, row % 2 ? -column : column};
    }
    static void note(const ResolvedScene& s, const CoverageReport& report, ObserverReport& own) {
        own.has_lat_lon = s.has_lat_lon;
        own.lat_deg = s.lat_deg;
        own.lon_deg = s.lon_deg;
        own.x = s.x;
        own.y = s.y;
        own.sensor_m = s.sensor_m;
        const QuadrantReport total = report.total();
        own.cpu_s = static_cast<float>(total.load_s + total.sweep_s);
        own.wall_s = static_cast<float>(report.wall_s);
        own.seen = report.seen();
        own.posts_read = total.posts_read;
        own.bytes_read = total.bytes_read;
    }

    const Settings& settings_;
    const Observers& observers_;
    WedgeSource& source_;
    Timeline* timeline_;
    Stop& stop_;
    std::vector<ObserverReport> reports_;
    std::vector<std::uint32_t> order_;  ///< in which they are swept
    QuadrantReport total_;
    double sweep_s_ = 0;
};

/// Posts of the raster by what is known of them.
struct Posts {
    std::uint64_t outside = 0, no_data = 0, unseen = 0, seen = 0, enough = 0;
    std::uint16_t most = 0;  ///< observers that see one post
};

/// Numbers of a tile -> counts, in place; or a mask.
class Painter {
public:
    Painter(const Settings& settings, Posts& posts)
        : mask_(settings.coverage.mask), posts_(posts), enough_(settings.at_least.value_or(1)) {}

    void counts(std::span<std::uint16_t> numbers) {
        for (std::uint16_t& n : numbers) {
            const SeenNumber of_post{n};
            note(of_post);
            n = of_post.no_data() ? CoverageFile::no_count : of_post.observers();
        }
    }
    void mask(std::span<const std::uint16_t> numbers, std::uint8_t* out) {
        for (const std::uint16_t n : numbers) {
            const SeenNumber of_post{n};
            note(of_post);
            *out++ = of_post.outside()                ? mask_.outside
                     : of_post.no_data()              ? mask_.no_data
                     : of_post.observers() >= enough_ ? mask_.seen
                                                      : mask_.hidden;
        }
    }

private:
    void note(SeenNumber n) {
        if (!n.looked_at()) {
            ++(n.outside() ? posts_.outside : posts_.no_data);
            return;
        }
        const std::uint16_t seen = n.observers();
        ++(seen == 0 ? posts_.unseen : posts_.seen);
        posts_.enough += seen >= enough_;
        posts_.most = std::max(posts_.most, seen);
    }
    const MaskValues mask_;
    Posts& posts_;
    const std::int64_t enough_;
};

Posts write_counts(const Settings& settings, const DataBase& db, CountStore& counts, CoverageFile& file,
                   const Stop& stop) {
    constexpr std::int64_t edge = CountStore::edge;
    Posts posts;
    Painter painter(settings, posts);
    std::vector<std::uint16_t> numbers(static_cast<std::size_t>(edge * edge));
    std::vector<std::uint8_t> mask(settings.at_least ? numbers.size() : 0);
    for (std::int64_t row = 0; row * edge < db.rows; ++row)
        for (std::int64_t column = 0; column * edge < db.columns; ++column) {
            stop.check();
            const Window window{{column * edge, std::min(db.columns, (column + 1) * edge)},
                                {row * edge, std::min(db.rows, (row + 1) * edge)}};
            if (!counts.take(column, row, numbers)) std::fill(numbers.begin(), numbers.end(), std::uint16_t{0});
            const auto width = static_cast<std::size_t>(window.columns.size());
            for (std::int64_t r = 0; r < window.rows.size(); ++r) {
                const auto at = static_cast<std::size_t>(r * edge);
                const std::span<std::uint16_t> line(numbers.data() + at, width);
                if (settings.at_least)
                    painter.mask(line, mask.data() + at);
                else
                    painter.counts(line);
            }
            if (settings.at_least)
                file.write(CoverageTile{.window = window, .bytes = mask.data(), .stride = edge});
            else
                file.write(window, numbers.data());
        }
    return posts;
}

/// All that the report tells but the observers one by one.
struct Facts {
    Shares shares;
    Posts posts;
    std::uint64_t bytes_read = 0, scratch_written = 0, scratch_read = 0;
    bool in_memory = false;
    double open_s = 0, write_s = 0;
};

/// Observer after observer, so that a long file's report is never held as a whole.
void write_observers_report(OutputFile& file, const Settings& settings, const Observers& observers,
                            const ObserverSweep& run, WedgeSource& source, const Facts& facts, const Usage& usage) {
    const DataBase& db = source.data_base();
    const auto n = static_cast<double>(observers.size());
    const json head{{"format", "wedgescope-observers-1"},
                    {"version", version()},
                    {"scene", coverage_scene(settings)},
                    {"inputs", inputs_json(input_files(settings, db))},
                    {"output", settings.output},
                    {"columns", db.columns},
                    {"rows", db.rows}};
    json tail{{"observer_count", observers.size()},
              {"observers_s", run.sweep_s()},
              {"observers_per_second", n / run.sweep_s()},
              {"bytes_read", facts.bytes_read},
              {"data_base_in_memory", facts.in_memory},
              {"open_s", facts.open_s},
              {"write_s", facts.write_s},
              {"lanes", facts.shares.lanes},
              {"total", quadrant_json(run.total())},
              {"posts",
               {{"no_data", facts.posts.no_data},
                {"outside", facts.posts.outside},
                {"seen_by_none", facts.posts.unseen},
                {"seen", facts.posts.seen}}},
              {"most_observers", facts.posts.most},
              {"counts",
               {{"memory_bytes", facts.shares.count_bytes},
                {"scratch_written_bytes", facts.scratch_written},
                {"scratch_read_bytes", facts.scratch_read}}}};
    if (settings.at_least) tail["posts"]["seen_by_enough"] = facts.posts.enough;
    add_skipped(tail, source.skipped());
    tail["source"] = source_json(source.report());
    add_usage(tail, usage);
    tail["threads"] = facts.shares.threads;
    tail["instruction_set"] = name_of(target_in_use());

    write_report(
        file, head, "observers", observers.size(),
        [&](std::size_t i) {
            const ObserverReport& r = run.reports()[i];
            json one{{observers.number_name(), observers[i].number}};
            if (r.has_lat_lon) {
                one["lat_deg"] = r.lat_deg;
                one["lon_deg"] = r.lon_deg;
            }
            one.update(json{{"x", r.x},
                            {"y", r.y},
                            {"sensor_height_m", r.sensor_m},
                            {"seen", r.seen},
                            {"posts_read", r.posts_read},
                            {"bytes_read", r.bytes_read},
                            {"cpu_s", r.cpu_s},
                            {"wall_s", r.wall_s}});
            return one;
        },
        tail);
}

std::string observers_table(const Observers& observers, const ObserverSweep& run, const Facts& facts,
                            const Usage& usage) {
    const auto n = static_cast<double>(observers.size());
    const QuadrantReport& total = run.total();
    std::string out =
        fmt::format("{} observers in {:.2f} s, {:.1f} observers/s, {} at a time on {} threads\n", observers.size(),
                    run.sweep_s(), n / run.sweep_s(), facts.shares.lanes, facts.shares.threads);
    out += fmt::format(
        "CPU ms an observer: load {:.2f} sweep {:.2f}; million posts an observer: {:.3f} of which passed {:.3f}\n",
        1e3 * total.load_s / n, 1e3 * total.sweep_s / n, static_cast<double>(total.posts_read) * 1e-6 / n,
        static_cast<double>(total.posts_passed) * 1e-6 / n);
    out += fmt::format(
        "read {}{}; counts: {} in memory, {} to the scratch file, {} from it; open {:.2f} s, write {:.2f} s\n",
        readable_bytes(static_cast<double>(facts.bytes_read)), facts.in_memory ? ", the data base once" : "",
        readable_bytes(static_cast<double>(facts.shares.count_bytes)),
        readable_bytes(static_cast<double>(facts.scratch_written)),
        readable_bytes(static_cast<double>(facts.scratch_read)), facts.open_s, facts.write_s);
    return out + fmt::format("wall {:.2f} s, user {:.2f} s, system {:.2f} s; peak {} resident\n", usage.wall_s,
                             usage.user_s, usage.system_s, readable_bytes(static_cast<double>(usage.peak_rss_bytes)));
}

/// Counts that are written.
struct Counted {
    const Observers& observers;
    const ObserverSweep& run;
    WedgeSource& source;
    const Facts& facts;
    const std::string &unfit_map, &losses;
};

void tell(const Settings& settings, const Counted& what, const Usage& usage, double wall_s) {
    const auto& [observers, run, source, facts, unfit_map, losses] = what;
    const auto say = [&](const std::string& line) { remark(settings.quiet, line); };
    const double judged = static_cast<double>(facts.posts.seen + facts.posts.unseen);
    say(fmt::format("{}; seen by at least {}: {}, {:.2f} % of those in range with data; most: {}",
                    counted(observers.size(), "observer"), settings.at_least.value_or(1),
                    counted(facts.posts.enough, "post"),
                    judged > 0 ? 100 * static_cast<double>(facts.posts.enough) / judged : 0.0, facts.posts.most));
    if (judged == 0) say(nothing_judged_line(settings));
    if (!losses.empty()) say(losses);
    remark_unused(settings.quiet, unfit_map);
    for (const std::string& line : doubts_of_heights(settings.dem, source, settings.culture_height_scale)) say(line);
    if (!observers.note().empty()) say(observers.note());
    say(text(
        "written: ", settings.output,
        fmt::format(" ({:.1f} s, {:.1f} observers/s)", wall_s, static_cast<double>(observers.size()) / run.sweep_s())));
    if (settings.profile || settings.verbose) fmt::print(stderr, "{}", observers_table(observers, run, facts, usage));
    if (!settings.profile) return;
    // What else the run wrote went to the scratch file.
    const std::uint64_t written = usage.written_bytes.value_or(0), scratch = facts.scratch_written;
    fmt::print(stderr, "{}",
               limits_words(settings, coverage_stages(run.total(), source.data_base(), facts.write_s,
                                                      written - std::min(written, scratch), usage)));
}

}  // namespace

void coverage_of_observers(const Settings& given, double start_s, Stop& stop) {
    Settings settings = given;
    const GdalSession session(cache_bytes(settings), settings.config);
    check_coverage_names(settings);
    OutputFile file(settings.output, settings.overwrite);
    RunRecords records(settings);
    Timeline* const timeline = records.timeline();

    Span opening(timeline, "open", "stage");
    const std::string unfit_map = find_ground(settings, {.many = true, .whole = true}, stop);
    std::optional<Observers> observers;
    std::optional<std::size_t> largest;
    const auto read = [&](const DataBase& data_base) {
        observers =
            read_observers(settings.observers, settings.observers_layer, settings.altitude_given, data_base, stop);
        if (settings.at_least && *settings.at_least > static_cast<std::int64_t>(observers->size()))
            throw InputError(text("at-least is ", *settings.at_least, ", and observers ", in_quotes(settings.observers),
                                  " holds ", observers->size(), "; accepted: at most so many"));
    };
    const auto fits = [&](std::size_t memory) {
        const Settings granted = with_memory(settings, memory);
        const auto source = open_shared_source(granted, stop);
        if (!observers) read(source->data_base());
        if (!largest) largest = ObserverSweep(granted, *observers, *source, nullptr, stop).largest();
        share_out(granted, *observers, *source, *largest);
    };
    std::unique_ptr<SharedSource> source;
    std::optional<ObserverSweep> run;
    Facts facts;
    std::uint64_t data = 0;
    try {
        source = open_shared_source(settings, stop);
        take_units_of(source->data_base(), settings);
        data = source->fingerprint({});
        read(source->data_base());
        Threads(thread_count(settings)).execute([&] { source->read(&stop); });
        run.emplace(settings, *observers, *source, timeline, stop);
        largest = run->largest();
        facts.shares = share_out(settings, *observers, *source, *largest);
    } catch (const TooLittleMemory& e) {
        run.reset();
        source.reset();
        refuse(e, memory_bytes(settings), fits);
    }
    if (const std::string line = hard_to_read(settings, *source, stop); !line.empty()) remark(settings.quiet, line);
    const DataBase& db = source->data_base();
    CoverageFile::Layer layer;
    layer.counts = !settings.at_least;
    layer.mask = settings.coverage.mask;
    if (settings.no_data_value) layer.no_data = layer.mask.no_data;
    CoverageFile raster(observers->size(), db, layer, file, coverage_format(settings));
    CountStore counts(db.columns, db.rows, observers->size(), facts.shares.count_bytes, settings.temp_dir);
    if (timeline) timeline->memory(memory_bytes(settings));
    opening.end();
    facts.open_s = now_s() - start_s;

    Progress progress(settings.quiet);
    Span sweeping(timeline, "observers", "stage");
    run->sweep(facts.shares, counts, [&](double fraction) { progress.report(fraction); });
    check_unchanged(*source, data);
    sweeping.end();
    progress.done();
    Span writing(timeline, "write", "stage");
    const double write_start_s = now_s();
    facts.posts = write_counts(settings, db, counts, raster, stop);
    raster.close(facts.posts.no_data + (settings.at_least ? facts.posts.outside : 0));
    facts.write_s = now_s() - write_start_s;
    writing.end();

    stop.check();
    records.end_timeline();
    const Usage usage = usage_since(start_s);
    facts.in_memory = source->keeps();
    facts.bytes_read = run->total().bytes_read;
    if (facts.in_memory) facts.bytes_read += static_cast<std::uint64_t>(db.columns * db.rows * db.post_bytes);
    facts.scratch_written = counts.written_bytes();
    facts.scratch_read = counts.read_bytes();
    if (OutputFile* to = records.report())
        write_observers_report(*to, settings, *observers, *run, *source, facts, usage);
    records.commit({&file}, data_paths(settings));
    tell(settings, {*observers, *run, *source, facts, unfit_map, raster.losses()}, usage, now_s() - start_s);
}

}  // namespace wedgescope
