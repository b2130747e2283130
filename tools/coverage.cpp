#include "lib/coverage.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "lib/target.hpp"
#include "tiles/coverage_raster.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/output_file.hpp"
#include "tools/budget.hpp"
#include "tools/commands.hpp"
#include "tools/coverage_report.hpp"
#include "tools/doubts.hpp"
#include "tools/ground.hpp"
#include "tools/help.hpp"
#include "tools/keys.hpp"
#include "tools/observers.hpp"
#include "tools/options.hpp"
#include "tools/report_json.hpp"
#include "tools/run_files.hpp"
#include "tools/run_records.hpp"
#include "tools/settings_check.hpp"
#include "tools/terminal.hpp"
#include "tools/viewshed_options.hpp"

namespace wedgescope {
namespace {

using json = nlohmann::ordered_json;

constexpr std::array<const char*, 4> quadrant_names{"east", "west", "south", "north"};

json report_json(const Settings& settings, const CoverageReport& report, const DataBase& db, const Usage& usage) {
    json out;
    out["format"] = "wedgescope-coverage-report-1";
    out["version"] = version();
    out["scene"] = coverage_scene(settings);
    out["inputs"] = inputs_json(input_files(settings, db));
    out["output"] = settings.output;
    out["columns"] = db.columns;
    out["rows"] = db.rows;
    out["wedges"] = json::array();  // the quadrants
    for (std::size_t q = 0; q < report.quadrants.size(); ++q) {
        json entry{{"wedge", q}, {"quadrant", quadrant_names[q]}, {"reused", false}};
        entry.update(quadrant_json(report.quadrants[q]));
        out["wedges"].push_back(entry);
    }
    out["total"] = quadrant_json(report.total());
    add_skipped(out, report.skipped);
    out["source"] = source_json(report.source);
    out["states"] = states_json(report.states);
    out["reused"] = 0;
    out["levels"] = json::array();
    out["stages_wall_s"] = json{{"sweep", report.wall_s}, {"write", report.write_s}};
    add_usage(out, usage);
    out["peak_budget_bytes"] = report.peak_budget_bytes;
    out["threads"] = report.threads;
    out["instruction_set"] = name_of(target_in_use());
    return out;
}

std::string report_table(const CoverageReport& report, const Usage& usage) {
    constexpr double mebibyte = 1048576;
    std::string out = fmt::format("{:>8} {:>8} {:>8} {:>8} {:>7} {:>10} {:>10} {:>8} {:>8}\n", "", "load", "sweep",
                                  "disk", "", "million", "million", "MiB", "MiB");
    out += fmt::format("{:>8} {:>8} {:>8} {:>8} {:>7} {:>10} {:>10} {:>8} {:>8}\n", "quadrant", "s", "s", "wait s",
                       "runs", "posts", "passed", "read", "spilled");
    const auto row = [&](const char* name, const QuadrantReport& q) {
        out += fmt::format("{:>8} {:>8.3f} {:>8.3f} {:>8.3f} {:>7} {:>10.3f} {:>10.3f} {:>8.1f} {:>8.1f}\n", name,
                           q.load_s, q.sweep_s, q.disk_wait_s, q.runs, static_cast<double>(q.posts_read) * 1e-6,
                           static_cast<double>(q.posts_passed) * 1e-6, static_cast<double>(q.bytes_read) / mebibyte,
                           static_cast<double>(q.bytes_spilled) / mebibyte);
    };
    for (std::size_t q = 0; q < report.quadrants.size(); ++q) row(quadrant_names[q], report.quadrants[q]);
    const QuadrantReport total = report.total();
    row("all", total);
    out += fmt::format("sweep {:.2f} s of wall, write {:.2f} s beside it", report.wall_s, report.write_s);
    out += source_line(report.source) + "\n";
    return out + usage_lines(usage, report.threads, report.peak_budget_bytes, total.bytes_spilled);
}

/// What a radar has and ground returns counts in one layer only.
void check_response(const Settings& settings) {
    const Settings defaults;
    if (settings.coverage.layer == CoverageLayer::response) {
        if (settings.coverage.target_m > 0)
            throw InputError(text(settings.spelled("target-height"), " is ", settings.coverage.target_m,
                                  " m; the layer response is of the ground itself and takes 0 alone"));
        return;
    }
    // A store's own stands by its response.
    if (settings.by_option("class-table"))
        throw InputError("--class-table is given; of coverage it is for --layer response alone");
    for (const Key& key : key_table())
        if (key.of_response && key.get(settings) != key.get(defaults))
            throw InputError(text("--", key.name, " is ", in_quotes(key.get(settings).value_or("")),
                                  "; of coverage it is for --layer response alone"));
}

/// No data and outside are 1 where nobody says otherwise, or what is left where seen or hidden is that: a mask of 1 and 0, say.
void keep_apart(MaskValues& mask, const Settings& settings) {
    std::uint8_t left = 1;
    while (left == mask.seen || left == mask.hidden) ++left;
    if (!settings.no_data_value) mask.no_data = left;
    if (!settings.given.contains("outside-value")) mask.outside = left;
}

/// Settings of a command line, complete and checked as far as the line goes.
Settings settings_of(const ViewshedArguments& translated) {
    Settings settings = parse_arguments(command_coverage, translated.words, translated.given, translated.defaults);
    if (settings.help) return settings;
    if (settings.files.size() != 2 || names_scene(settings.files[0]))
        throw InputError(text("coverage takes two paths, the terrain raster and the output; found ",
                              settings.files.size() == 2 ? in_quotes(settings.files[0]) : text(settings.files.size()),
                              " (of a scene file simulate --ground writes the layer response)"));
    settings.dem = settings.files[0];
    settings.output = settings.files[1];
    settings.snap_to_post = translated.gdal_style;
    settings.needs_classes = settings.coverage.layer == CoverageLayer::response;
    if (!settings.snap_to_post) keep_apart(settings.coverage.mask, settings);
    check_response(settings);
    check_complete(settings);
    check_temp_dir(settings);
    if (settings.no_data_value)
        settings.coverage.mask.no_data = static_cast<std::uint8_t>(*settings.no_data_value);
    else if (translated.gdal_style)
        settings.coverage.mask.no_data = settings.coverage.mask.outside;
    return settings;
}

/// gdal_viewshed's observer stands in the middle of the cell that the place lies in.
void stand_on_post(Settings& settings, const DataBase& db) {
    if (settings.scene.geometry == Geometry::grid && !db.crs_in_metres)
        throw InputError(text("-ox and -oy make the ground a plane in metres, and ", in_quotes(settings.dem),
                              " is in degrees; add --geometry geodesic"));
    if (!settings.scene.platform.xy) return;
    PointXY& at = *settings.scene.platform.xy;
    at.x = db.origin_x + std::floor((at.x - db.origin_x) / db.step_x + 0.5) * db.step_x;
    at.y = db.origin_y + std::floor((at.y - db.origin_y) / db.step_y + 0.5) * db.step_y;
}

/// A coverage that is written.
struct Covered {
    const ResolvedScene& scene;
    WedgeSource& source;
    const CoverageReport& report;
    const SourceChoice& choice;
    const std::string& unfit_map;
    bool by_tiles;
    const std::string& losses;
};

void tell(const Settings& settings, const Covered& covered, const Usage& usage, double wall_s) {
    const CoverageReport& report = covered.report;
    const DataBase& db = covered.source.data_base();
    const auto say = [&](const std::string& line) { remark(settings.quiet, line); };
    const double judged = static_cast<double>(report.seen() + report.states[static_cast<std::size_t>(State::shadow)]);
    say(fmt::format("sensor: {:.1f} m above sea level{}; seen: {}, {:.2f} % of those in range with data",
                    covered.scene.sensor_m, above_terrain(covered.scene, db), counted(report.seen(), "post"),
                    judged > 0 ? 100 * static_cast<double>(report.seen()) / judged : 0.0));
    if (judged == 0) say(nothing_judged_line(settings));
    if (!covered.by_tiles)
        say(text(settings.output, " is not cut into tiles of ", CoverageTile::edge, " x ", CoverageTile::edge,
                 " posts, which takes longer to write"));
    if (!covered.losses.empty()) say(covered.losses);
    const SourceChoice& choice = covered.choice;
    if (choice.spilled)
        say(text(choice.kept ? "terrain read from " : "terrain sorted into wedges first: ", choice.why));
    for (const std::string& unfit : {choice.unfit, covered.unfit_map}) remark_unused(settings.quiet, unfit);
    for (const std::string& line : doubts_of_heights(settings.dem, covered.source, settings.culture_height_scale))
        say(line);
    for (const std::string& line : doubts_of_rays(covered.scene, settings.coverage.layer == CoverageLayer::response))
        say(line);
    if (settings.coverage.layer == CoverageLayer::response)
        for (const std::string& line : idle_effects(settings.scene, db, legend(settings))) say(line);
    const double rate = static_cast<double>(db.columns) * static_cast<double>(db.rows) / wall_s * 1e-6;
    say(text("written: ", settings.output,
             fmt::format(" ({:.1f} s, {:.{}f} Mposts/s)", wall_s, rate, rate < 10 ? 2 : 0)));
    if (settings.profile || settings.verbose) say_as_it_is(report_table(report, usage));
    if (settings.profile)
        say_as_it_is(
            limits_words(settings, coverage_stages(report.total(), db, report.write_s,
                                                   bytes_of_outputs(usage, report.source.spilled_bytes), usage)));
}

}  // namespace

void coverage(const std::vector<std::string>& arguments, Stop& stop) {
    const double start_s = now_s();
    const ViewshedArguments translated = translate_viewshed(arguments);
    Settings settings = settings_of(translated);
    if (settings.help) return print(help_text(command_by_name("coverage")));
    if (!settings.observers.empty()) return coverage_of_observers(settings, start_s, stop);
    const GdalSession session(cache_bytes(settings), settings.config);
    check_coverage_names(settings);
    OutputFile file(settings.output, settings.overwrite);
    RunRecords records(settings);
    Timeline* const timeline = records.timeline();

    Span opening(timeline, "open", "stage");
    const std::string unfit_map = find_ground(settings, {}, stop);
    const DataBaseParams layers = data_base_params(settings, cache_bytes(settings), stop);
    std::unique_ptr<WedgeSource> source = open_direct_source(layers);
    take_units_of(source->data_base(), settings);
    if (settings.snap_to_post) stand_on_post(settings, source->data_base());
    CoverageParams params = settings.coverage;
    params.timeline = timeline;
    params.cull = !settings.no_cull;
    params.threads = thread_count(settings);
    params.memory_bytes = static_cast<std::size_t>(settings.memory_bytes);
    params.stop = &stop;
    check_coverage_budget(settings, params, *source, stop);
    SpillOptions spill = spill_options(settings);
    spill.all_round = spill.all_of_it = true;
    spill.stop = &stop;
    spill.timeline = timeline;
    const SourceChoice choice = choose_source(layers, settings.source, settings.scene, spill.memory_bytes);
    if (choice.spilled) {
        source.reset();
        Progress sorting(settings.quiet || choice.kept);
        spill.progress = [&](double fraction) { sorting.report(fraction); };
        source = open_source(choice, layers, settings.scene, spill);
        sorting.done();
    }
    params.data = source->fingerprint({});
    opening.end();
    const DataBase& db = source->data_base();
    Span resolving(timeline, "resolve", "stage");
    const ResolvedScene scene = resolve_coverage(settings.scene, *source);
    resolving.end();

    Progress progress(settings.quiet);
    params.progress = [&](double fraction) { progress.report(fraction); };

    CoverageFile::Layer layer;
    layer.kind = params.layer;
    layer.mask = params.mask;
    if (settings.no_data_value) layer.no_data = params.mask.no_data;
    layer.undeclared = translated.gdal_style;  // and -ov may be what hidden ground is too
    CoverageFile raster(scene, db, layer, file, coverage_format(settings));
    Span sweeping(timeline, "strips", "stage");
    const CoverageReport report = cover(scene, *source, params, [&](const CoverageTile& tile) { raster.write(tile); });
    progress.done();
    sweeping.end();
    Span closing(timeline, "close", "stage");
    const bool by_tiles = raster.by_tiles();
    const auto posts_in = [&](State s) { return report.states[static_cast<std::size_t>(s)]; };
    raster.close(posts_in(State::no_data) + posts_in(State::outside));
    closing.end();
    stop.check();
    records.end_timeline();
    const Usage usage = usage_since(start_s);
    if (OutputFile* to = records.report()) write_report(*to, report_json(settings, report, db, usage));
    records.commit({&file}, data_paths(settings));
    tell(settings, {scene, *source, report, choice, unfit_map, by_tiles, raster.losses()}, usage, now_s() - start_s);
}

}  // namespace wedgescope
