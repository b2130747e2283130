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

/// A coverage of observers from its files to its counts, step by step.
class ObserversRun {
public:
    ObserversRun(const Settings& given, double start_s, Stop& stop)
        : start_s_(start_s), stop_(stop), settings_(given), session_(cache_bytes(settings_), settings_.config) {
        check_coverage_names(settings_);
        file_.emplace(settings_.output, settings_.overwrite);
        records_.emplace(settings_);
    }

    void run() {
        open();
        sweep();
        write();
        tell();
    }

private:
    void say(const std::string& line) const {
        if (!line.empty()) remark(settings_.quiet, line);
    }

    void open() {
        const Span opening(records_->timeline(), "open", "stage");
        unfit_map_ = find_ground(settings_, {.many = true, .whole = true}, stop_);
        try {
            open_source();
        } catch (const TooLittleMemory& e) {
            sweep_.reset();
            source_.reset();
            refuse(e, memory_bytes(settings_), [&](std::size_t memory) { share_out_at(memory); });
        }
        say(hard_to_read(settings_, *source_, stop_));
        const DataBase& db = source_->data_base();
        CoverageFile::Layer layer;
        layer.counts = !settings_.at_least;
        layer.mask = settings_.coverage.mask;
        if (settings_.no_data_value) layer.no_data = layer.mask.no_data;
        raster_.emplace(observers_->size(), db, layer, *file_, coverage_format(settings_));
        counts_.emplace(db.columns, db.rows, observers_->size(), facts_.shares.count_bytes, settings_.temp_dir);
        if (Timeline* timeline = records_->timeline()) timeline->memory(memory_bytes(settings_));
        facts_.open_s = now_s() - start_s_;
    }

    void open_source() {
        source_ = open_shared_source(settings_, stop_);
        take_units_of(source_->data_base(), settings_);
        data_ = source_->fingerprint({});
        read_observers_of(source_->data_base());
        Threads(thread_count(settings_)).execute([&] { source_->read(&stop_); });
        sweep_.emplace(settings_, *observers_, *source_, records_->timeline(), stop_);
        largest_ = sweep_->largest();
        facts_.shares = share_out(settings_, *observers_, *source_, *largest_);
    }

    /// TooLittleMemory where this much does not do.
    void share_out_at(std::size_t memory) {
        const Settings granted = with_memory(settings_, memory);
        const auto source = open_shared_source(granted, stop_);
        if (!observers_) read_observers_of(source->data_base());
        if (!largest_) largest_ = ObserverSweep(granted, *observers_, *source, nullptr, stop_).largest();
        share_out(granted, *observers_, *source, *largest_);
    }

    void read_observers_of(const DataBase& data_base) {
        observers_ =
            read_observers(settings_.observers, settings_.observers_layer, settings_.altitude_given, data_base, stop_);
        if (settings_.at_least && *settings_.at_least > static_cast<std::int64_t>(observers_->size()))
            throw InputError(text("at-least is ", *settings_.at_least, ", and observers ",
                                  in_quotes(settings_.observers), " holds ", observers_->size(),
                                  "; accepted: at most so many"));
    }

    void sweep() {
        Progress progress(settings_.quiet);
        const Span sweeping(records_->timeline(), "observers", "stage");
        sweep_->sweep(facts_.shares, *counts_, [&](double fraction) { progress.report(fraction); });
        check_unchanged(*source_, data_);
        progress.done();
    }

    void write() {
        const DataBase& db = source_->data_base();
        {
            const Span writing(records_->timeline(), "write", "stage");
            const double write_start_s = now_s();
            facts_.posts = write_counts(settings_, db, *counts_, *raster_, stop_);
            raster_->close(facts_.posts.no_data + (settings_.at_least ? facts_.posts.outside : 0));
            facts_.write_s = now_s() - write_start_s;
        }
        stop_.check();
        records_->end_timeline();
        usage_ = usage_since(start_s_);
        facts_.in_memory = source_->keeps();
        facts_.bytes_read = sweep_->total().bytes_read;
        if (facts_.in_memory) facts_.bytes_read += static_cast<std::uint64_t>(db.columns * db.rows * db.post_bytes);
        facts_.scratch_written = counts_->written_bytes();
        facts_.scratch_read = counts_->read_bytes();
        if (OutputFile* to = records_->report())
            write_observers_report(*to, settings_, *observers_, *sweep_, *source_, facts_, usage_);
        records_->commit({&*file_}, data_paths(settings_));
    }

    void tell() const {
        const auto judged = static_cast<double>(facts_.posts.seen + facts_.posts.unseen),
                   enough = static_cast<double>(facts_.posts.enough);
        say(fmt::format("{}; seen by at least {}: {}, {:.2f} % of those in range with data; most: {}",
                        counted(observers_->size(), "observer"), settings_.at_least.value_or(1),
                        counted(facts_.posts.enough, "post"), judged > 0 ? 100 * enough / judged : 0.0,
                        facts_.posts.most));
        if (judged == 0) say(nothing_judged_line(settings_));
        say(raster_->losses());
        remark_unused(settings_.quiet, unfit_map_);
        for (const std::string& line : doubts_of_heights(settings_.dem, *source_, settings_.culture_height_scale))
            say(line);
        say(observers_->note());
        say(text("written: ", settings_.output,
                 fmt::format(" ({:.1f} s, {:.1f} observers/s)", now_s() - start_s_,
                             static_cast<double>(observers_->size()) / sweep_->sweep_s())));
        if (settings_.profile || settings_.verbose) say_as_it_is(observers_table(*observers_, *sweep_, facts_, usage_));
        if (!settings_.profile) return;
        say_as_it_is(
            limits_words(settings_, coverage_stages(sweep_->total(), source_->data_base(), facts_.write_s,
                                                    bytes_of_outputs(usage_, facts_.scratch_written), usage_)));
    }

    const double start_s_;
    Stop& stop_;
    Settings settings_;
    GdalSession session_;
    std::optional<OutputFile> file_;
    std::optional<RunRecords> records_;
    std::string unfit_map_;
    std::unique_ptr<SharedSource> source_;
    std::uint64_t data_ = 0;  ///< the fingerprint of the data base before any of it was read
    std::optional<Observers> observers_;
    std::optional<ObserverSweep> sweep_;
    std::optional<std::size_t> largest_;  ///< coverage, as ObserverSweep::largest()
    std::optional<CoverageFile> raster_;
    std::optional<CountStore> counts_;
    Facts facts_;
    Usage usage_;
};

}  // namespace

void coverage_of_observers(const Settings& given, double start_s, Stop& stop) {
    ObserversRun(given, start_s, stop).run();
}

}  // namespace wedgescope
