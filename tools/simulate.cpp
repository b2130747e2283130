#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
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

namespace fs = std::filesystem;

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
    if (!s.only_wedges) layers.emplace(s);
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
    if (settings.only_wedges) return;
    for (const std::string& line : doubts(result, !settings.output.empty()))
        if (!line.empty()) say(line);
}

void simulate(const Settings& given, WorkDir* work, double start_s, Stop& stop) {
    Settings settings = given;
    const GdalSession session(cache_bytes(settings), settings.config);
    Outputs outputs(settings);
    if (outputs.layers) outputs.layers->check(settings);
    RunRecords records(settings);
    Timeline* const timeline = records.timeline();

    OuterStages outer;
    const double open_start_s = now_s();
    Span opening(timeline, "open", "stage");
    settings.expects_ground = expects_ground(settings, {.levels = true}, stop);
    Settings as_read = settings;
    if (work && work->seems_done()) as_read.source = SourceKind::direct;
    check_simulation(as_read, stop);
    const std::string unfit_map = find_ground(settings, {.levels = true}, stop);
    as_read.ground = settings.ground;
    const DataBaseParams layers = data_base_params(settings, cache_bytes(settings), stop);
    std::unique_ptr<WedgeSource> source;
    const bool terminal = ::isatty(STDERR_FILENO) == 1;
    SpillOptions options = spill_options(settings);
    options.timeline = timeline;
    SourceChoice choice = choose_source(layers, settings.source, settings.scene, options.memory_bytes);
    if (work && work->seems_done()) choice = {};  // a pass would be for nothing; what is amiss is read in windows
    if (choice.spilled && !choice.kept) {
        remark(settings.quiet || !terminal, text("sorting the terrain into wedges: ", choice.why));
        if (settings.only_wedges) options.only = arc_alone(settings, layers, options, *work, stop);
        options.stop = &stop;
        Progress sorting(settings.quiet);
        options.progress = [&](double fraction) { sorting.report(fraction); };
        source = open_source(choice, layers, settings.scene, options);
        sorting.done();
    } else {
        source = open_source(choice, layers, settings.scene, options);
    }
    opening.end();
    outer.open_s = now_s() - open_start_s;
    const std::uint64_t data = source->fingerprint({});
    Span resolving(timeline, "resolve", "stage");
    const ResolvedScene scene = resolve(settings.scene, *source);
    resolving.end();
    // On a terminal at once; in a log behind all that can fail, so that an error stays a single line.
    remark(settings.quiet || !terminal, text("sensor: ", place(scene, source->data_base())));

    EngineParams params = engine_params(settings);
    params.stop = &stop;
    params.data = data;
    if (work) work->bind(work_run(settings, scene, source->data_base()));
    params.archive = work;
    params.timeline = timeline;
    std::optional<Ground> ground;
    Progress progress(settings.quiet);
    params.progress = [&](double fraction) { progress.report(fraction); };
    RunResult result = [&] {
        try {
            if (outputs.ground) ground.emplace(settings, scene, *source, *outputs.ground);
            return run(scene, *source, params);
        } catch (const TooLittleMemory& e) {
            source.reset();
            refuse(e, params.memory_bytes, simulation(as_read, scene, settings.scene.range_m.has_value(), stop, work));
        }
    }();
    progress.done();
    if (work) {
        for (const std::string& line : work->remarks()) remark(settings.quiet, line);
        if (const std::size_t reused = reused_count(result.report))
            remark(settings.quiet, text("reused ", reused, " of ", result.report.wedges.size(), " wedges"));
    }

    const double write_start_s = now_s();
    Span writing(timeline, "write", "stage");
    if (outputs.layers) outputs.layers->write(result, settings, source->data_base(), stop);
    if (ground) ground->write(settings.quiet, stop, timeline, data);
    outer.write_s = now_s() - write_start_s;
    writing.end();
    records.end_timeline();
    const Usage usage = usage_since(start_s);
    if (OutputFile* to = records.report()) {
        write_report(*to, report_json(settings, result,
                                      input_files(settings, source->data_base(),
                                                  settings.files.empty() ? "" : settings.files[0]),
                                      outer, usage));
    }
    stop.check();
    std::string written = records.commit(outputs.files());
    remark(settings.quiet || terminal, text("sensor: ", place(scene, source->data_base())));
    for (const std::string& unfit : {choice.unfit, unfit_map}) remark_unused(settings.quiet, unfit);
    tell_doubts(settings, result, ground ? &*ground : nullptr, *source, layers.legend);
    if (settings.verbose || settings.profile) fmt::print(stderr, "{}", report_table(result.report, outer, usage));
    if (settings.profile)
        fmt::print(stderr, "{}", limits_words(settings, stage_work(result.report, outer.write_s, usage)));
    if (settings.only_wedges) {
        written += text(written.empty() ? "" : ", ", work->kept(), " of ", work->recorded_split().size(), " wedges in ",
                        in_quotes(work->path()), left_words(settings));
    }
    remark(settings.quiet, text("written: ", written, fmt::format(" ({:.1f} s)", now_s() - start_s)));
}

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
        simulate(settings, work.get(), start_s, stop);
    } catch (const Interrupted& e) {
        throw Interrupted(e.signal(), kept_words(work.get()));
    } catch (const IoError& e) {
        throw IoError(e.what() + kept_words(work.get()));
    }
}

}  // namespace wedgescope
