#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <memory>

#include "lib/coverage.hpp"
#include "lib/plan.hpp"
#include "tiles/coverage_raster.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/output_file.hpp"
#include "tiles/work_dir.hpp"
#include "tools/budget.hpp"
#include "tools/commands.hpp"
#include "tools/coverage_report.hpp"
#include "tools/doubts.hpp"
#include "tools/ground.hpp"
#include "tools/help.hpp"
#include "tools/layers.hpp"
#include "tools/options.hpp"
#include "tools/report_json.hpp"
#include "tools/run_files.hpp"
#include "tools/run_records.hpp"
#include "tools/scene_json.hpp"
#include "tools/settings_check.hpp"
#include "tools/terminal.hpp"
#include "tools/track.hpp"

namespace wedgescope {
namespace {

/// Outputs under temporary names; they appear all together at the end. Everything that can go wrong with an output's name
/// is found when they are opened, before any work.
struct Outputs {
    explicit Outputs(const Settings& settings);
    std::vector<OutputFile*> files();

    std::optional<OutputFile> ground;
    std::optional<LayerFiles> layers;  ///< none with only-wedge, which fills the work folder; pictures are --resume's
};

Outputs::Outputs(const Settings& s) {
    check_run_names(s);
    if (!s.ground_file.empty()) ground.emplace(s.ground_file, s.overwrite);
    if (s.only_wedges) return;
    layers.emplace(s);
    layers->check(s);
}

std::vector<OutputFile*> Outputs::files() {
    std::vector<OutputFile*> all;
    if (layers) all = layers->files();
    if (ground) all.push_back(&*ground);
    return all;
}

std::string place(const ResolvedScene& r, const DataBase& data_base) {
    const std::string where = r.has_lat_lon ? fmt::format("latitude {:.5f}, longitude {:.5f}", r.lat_deg, r.lon_deg)
                                            : fmt::format("x {:.1f}, y {:.1f}", r.x, r.y);
    return text(where, fmt::format(", {:.1f} m above sea level", r.sensor_m), above_terrain(r, data_base));
}

/// The work folder, opened before any work.
std::unique_ptr<WorkDir> open_work_dir(const Settings& s) {
    if (s.work_dir.empty()) return nullptr;
    const auto start = s.resume || s.only_wedges ? WorkDir::Start::join
                       : s.overwrite             ? WorkDir::Start::over
                                                 : WorkDir::Start::fresh;
    return std::make_unique<WorkDir>(s.work_dir, start);
}

/// The azimuths of the wedges that are to be done alone, so that a pass keeps what these need; nothing where the range is to
/// follow from the terrain, which splits the wedges. Records the split of the whole scene: what a pass keeps may not change it.
std::optional<Arc> arc_alone(const Settings& settings, const DataBaseParams& layers, const SpillOptions& options,
                             WorkDir& work, const Stop& stop) {
    if (!settings.scene.range_m) return {};
    const ResolvedScene scene = resolve(settings.scene, *open_direct_source(layers));
    const auto forecast = forecast_spilled_source(layers, scene, true, options);
    work.bind(work_run(settings, scene, forecast->data_base()));
    EngineParams params = engine_params(settings);
    params.archive = &work;
    try {
        const std::vector<Interval> wedges = work.record_split(plan(scene, *forecast, params).wedges);
        const Interval only = *settings.only_wedges;
        if (only.end > static_cast<std::int64_t>(wedges.size()))
            return {};  // another process split them; run() refuses
        const std::int64_t first = wedges.at(static_cast<std::size_t>(only.begin)).begin,
                           end = wedges.at(static_cast<std::size_t>(only.end - 1)).end;
        const double step_rad = scene.swept.azimuth_step_rad();
        return Arc{static_cast<double>(first) * step_rad, static_cast<double>(end - first) * step_rad};
    } catch (const TooLittleMemory& e) {
        refuse(e, memory_bytes(settings), simulation(settings, scene, true, stop, &work));
    }
}

/// The file of the scene's response on the raster's own posts, and how it gets there. Made before the sweep: a name that no raster can
/// have is found before any work.
class Ground {
public:
    Ground(const Settings& settings, const ResolvedScene& scene, WedgeSource& source, const OutputFile& file)
        : work_(ground_work(settings, scene, source)), source_(source),
          raster_(work_.scene, source.data_base(), layer(), file, format(settings)) {}

    void write(bool quiet, Stop& stop, Timeline* timeline, std::uint64_t data) {
        remark(quiet || ::isatty(STDERR_FILENO) == 0, "the response of the ground's own posts");
        Progress progress(quiet);
        work_.params.progress = [&](double fraction) { progress.report(fraction); };
        work_.params.stop = &stop;
        work_.params.timeline = timeline;
        work_.params.data = data;
        cover(work_.scene, source_, work_.params, [&](const CoverageTile& tile) { raster_.write(tile); });
        raster_.close(0);
        progress.done();
    }
    const std::string& losses() const { return raster_.losses(); }

private:
    static CoverageFile::Layer layer() {
        CoverageFile::Layer response;
        response.kind = CoverageLayer::response;
        return response;
    }
    static RasterFormat format(const Settings& settings) {
        Settings covered = settings;
        covered.coverage.layer = CoverageLayer::response;
        RasterFormat format = coverage_format(covered);
        if (!settings.output.empty()) format.driver.clear(), format.creation.clear();  // the picture's
        return format;
    }

    GroundWork work_;
    WedgeSource& source_;
    CoverageFile raster_;
};

/// How to go on from what is kept, for the end of an error's line; empty if nothing is.
std::string kept_words(const WorkDir* work) {
    const std::size_t count = work ? work->kept() : 0;
    if (count == 0) return "";
    return text("; ", count, count == 1 ? " wedge is" : " wedges are", " kept in ", in_quotes(work->path()),
                " (--resume goes on)");
}

/// Of a run with only-wedge: the outputs that it was given and that are not its to write; empty if it was given none.
std::string left_words(const Settings& s) {
    std::vector<std::string> left;
    for (const std::string* path : {&s.output, &s.echo, &s.power, &s.states})
        if (!path->empty()) left.push_back(in_quotes(*path));
    if (left.empty()) return "";
    return fmt::format("; {} {} left to the run that merges all wedges (--resume)", fmt::join(left, ", "),
                       left.size() > 1 ? "are" : "is");
}

/// `ground`: null where that layer is not asked for.
void tell_doubts(const Settings& settings, const RunResult& result, const Ground* ground, WedgeSource& source,
                 const std::optional<Legend>& legend) {
    const auto say = [&](const std::string& line) { remark(settings.quiet, line); };
    if (ground && !ground->losses().empty()) say(ground->losses());
    if (ground && settings.scene.far_shore) say("far-shore is not in ground, which knows each post by itself");
    for (const std::string& line : doubts_of_heights(settings.dem, source, settings.culture_height_scale)) say(line);
    for (const std::string& line : idle_effects(settings.scene, source.data_base(), legend)) say(line);
    for (const std::string& line : idle_receiver(settings.scene.receiver, settings.scene.display)) say(line);
    if (settings.only_wedges) return;
    for (const std::string& line : doubts(result, !settings.output.empty()))
        if (!line.empty()) say(line);
}

/// One scene, from the files it is read from to those it is written to.
class Simulation {
public:
    /// `work`: null without a work folder.
    Simulation(const Settings& settings, WorkDir* work, double start_s, Stop& stop)
        : start_s_(start_s), stop_(stop), work_(work), settings_(settings),
          session_(cache_bytes(settings_), settings_.config), outputs_(settings_), records_(settings_) {}

    void run() {
        open();
        resolve_scene();
        sweep();
        write();
        tell();
    }

private:
    Timeline* timeline() { return records_.timeline(); }
    void say(const std::string& line) const { remark(settings_.quiet, line); }
    std::string sensor_line() const { return text("sensor: ", place(*scene_, source_->data_base())); }

    /// The terrain, sorted into wedges first where that is needed.
    void open() {
        const double start_s = now_s();
        const Span opening(timeline(), "open", "stage");
        const bool merges_only =
            work_ && work_->seems_done();  // a pass would be for nothing; what is amiss is read in windows
        settings_.expects_ground = expects_ground(settings_, {.levels = true}, stop_);
        as_read_ = settings_;
        if (merges_only) as_read_.source = SourceKind::direct;
        check_simulation(as_read_, stop_);
        unfit_map_ = find_ground(settings_, {.levels = true}, stop_);
        as_read_.ground = settings_.ground;
        const DataBaseParams layers = data_base_params(settings_, cache_bytes(settings_), stop_);
        legend_ = layers.legend;
        SpillOptions options = spill_options(settings_);
        options.timeline = timeline();
        if (!merges_only) choice_ = choose_source(layers, as_read_.source, settings_.scene, options.memory_bytes);
        if (choice_.spilled && !choice_.kept)
            sort_into_wedges(layers, options);
        else
            source_ = open_source(choice_, layers, settings_.scene, options);
        outer_.open_s = now_s() - start_s;
    }

    void sort_into_wedges(const DataBaseParams& layers, SpillOptions& options) {
        remark(settings_.quiet || !terminal_, text("sorting the terrain into wedges: ", choice_.why));
        if (settings_.only_wedges) options.only = arc_alone(settings_, layers, options, *work_, stop_);
        options.stop = &stop_;
        Progress sorting(settings_.quiet);
        options.progress = [&](double fraction) { sorting.report(fraction); };
        source_ = open_source(choice_, layers, settings_.scene, options);
        sorting.done();
    }

    void resolve_scene() {
        data_ = source_->fingerprint({});
        const Span resolving(timeline(), "resolve", "stage");
        scene_ = resolve(settings_.scene, *source_);
    }

    void sweep() {
        // On a terminal at once; in a log behind all that can fail, so that an error stays a single line.
        remark(settings_.quiet || !terminal_, sensor_line());
        EngineParams params = engine_params(settings_);
        params.stop = &stop_;
        params.data = data_;
        if (work_) work_->bind(work_run(settings_, *scene_, source_->data_base()));
        params.archive = work_;
        params.timeline = timeline();
        Progress progress(settings_.quiet);
        params.progress = [&](double fraction) { progress.report(fraction); };
        try {
            if (outputs_.ground) ground_.emplace(settings_, *scene_, *source_, *outputs_.ground);
            result_ = wedgescope::run(*scene_, *source_, params);
        } catch (const TooLittleMemory& e) {
            source_.reset();
            refuse(e, params.memory_bytes,
                   simulation(as_read_, *scene_, settings_.scene.range_m.has_value(), stop_, work_));
        }
        progress.done();
        if (!work_) return;
        for (const std::string& line : work_->remarks()) say(line);
        if (const std::size_t reused = reused_count(result_->report))
            say(text("reused ", reused, " of ", result_->report.wedges.size(), " wedges"));
    }

    void write() {
        const double start_s = now_s();
        Span writing(timeline(), "write", "stage");
        if (outputs_.layers) outputs_.layers->write(*result_, settings_, source_->data_base(), stop_);
        if (ground_) ground_->write(settings_.quiet, stop_, timeline(), data_);
        outer_.write_s = now_s() - start_s;
        writing.end();
        records_.end_timeline();
        usage_ = usage_since(start_s_);
        if (OutputFile* to = records_.report()) {
            const std::string scene_file = settings_.files.empty() ? "" : settings_.files[0];
            write_report(*to, report_json(settings_, *result_, input_files(settings_, source_->data_base(), scene_file),
                                          outer_, usage_));
        }
        stop_.check();
        written_ = records_.commit(outputs_.files(), input_paths(settings_));
    }

    void tell() const {
        remark(settings_.quiet || terminal_, sensor_line());
        for (const std::string& unfit : {choice_.unfit, unfit_map_}) remark_unused(settings_.quiet, unfit);
        tell_doubts(settings_, *result_, ground_ ? &*ground_ : nullptr, *source_, legend_);
        if (settings_.verbose || settings_.profile) say_as_it_is(report_table(result_->report, outer_, usage_));
        if (settings_.profile)
            say_as_it_is(limits_words(settings_, stage_work(result_->report, outer_.write_s, usage_)));
        std::string written = written_;
        if (settings_.only_wedges) {
            written += text(written.empty() ? "" : ", ", work_->kept(), " of ", work_->recorded_split().size(),
                            " wedges in ", in_quotes(work_->path()), left_words(settings_));
        }
        say(text("written: ", written, fmt::format(" ({:.1f} s)", now_s() - start_s_)));
    }

    const double start_s_;
    Stop& stop_;
    WorkDir* const work_;
    const bool terminal_ = ::isatty(STDERR_FILENO) == 1;
    Settings settings_;
    const GdalSession session_;
    Outputs outputs_;
    RunRecords records_;

    Settings as_read_;  ///< as the source is read in the end, for what a refusal says
    std::string unfit_map_;
    std::optional<Legend> legend_;
    SourceChoice choice_;
    std::unique_ptr<WedgeSource> source_;
    std::uint64_t data_ = 0;  ///< the source's fingerprint
    std::optional<ResolvedScene> scene_;
    std::optional<Ground> ground_;
    std::optional<RunResult> result_;
    OuterStages outer_;
    Usage usage_;
    std::string written_;
};

}  // namespace

void simulate(const std::vector<std::string>& arguments, Stop& stop) {
    const double start_s = now_s();
    const Settings settings = parse_arguments(command_simulate, arguments);
    if (settings.help) return print(help_text(command_by_name("simulate")));
    check_complete(settings);
    check_temp_dir(settings);
    if (!settings.ground_file.empty() && (!settings.track.empty() || settings.only_wedges))
        throw InputError(text("ground is ", in_quotes(settings.ground_file), " and ",
                              settings.track.empty() ? "only-wedge" : "track",
                              " is given too; ground is of a whole scene from one place"));
    if (!settings.track.empty()) return simulate_track(settings, start_s, stop);
    const std::unique_ptr<WorkDir> work = open_work_dir(settings);
    try {
        Simulation(settings, work.get(), start_s, stop).run();
    } catch (const Interrupted& e) {
        throw Interrupted(e.signal(), kept_words(work.get()));
    } catch (const IoError& e) {
        throw IoError(e.what() + kept_words(work.get()));
    }
}

}  // namespace wedgescope
