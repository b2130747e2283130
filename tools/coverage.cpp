#include "lib/coverage.hpp"

#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "tiles/coverage_raster.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/output_file.hpp"
#include "tools/commands.hpp"
#include "tools/help.hpp"
#include "tools/options.hpp"
#include "tools/report_json.hpp"
#include "tools/terminal.hpp"
#include "tools/units.hpp"
#include "tools/viewshed_options.hpp"

namespace wedgescope {
namespace {

using json = nlohmann::ordered_json;

/// What changes the values, as a user would write it.
json parameters(const Settings& settings) {
    json out = json::object();
    for (const Key& key : key_table()) {
        if (!(key.commands & command_coverage) || !key.changes_result) continue;
        const auto value = key.get(settings);
        out[key.name] = value ? json(*value) : json(nullptr);
    }
    return out;
}

bool same_file(const std::string& a, const std::string& b) {
    std::error_code error;
    return std::filesystem::equivalent(a, b, error) && !error;
}

std::string report_text(const Settings& settings, const CoverageReport& report, const DataBase& db,
                        const Usage& usage) {
    json out;
    out["format"] = "wedgescope coverage report 1";
    out["program"] = text("wedgescope ", version());
    out["scene"] = parameters(settings);
    out["dem"] = settings.dem;
    out["output"] = settings.output;
    out["columns"] = db.columns;
    out["rows"] = db.rows;
    out["states"] = json::object();
    for (std::size_t i = 0; i < report.states.size(); ++i) out["states"][state_names[i]] = report.states[i];
    out["posts_read"] = report.posts_read;
    out["bytes_read"] = report.bytes_read;
    out["posts_passed"] = report.posts_passed;
    out["skipped"] = json::object();
    for (std::size_t cause = 1; cause < skip_count; ++cause) {
        const SkipCount& count = report.skipped[cause];
        out["skipped"][skip_names[cause]] = {{"posts", count.posts}, {"tiles", count.tiles}, {"bytes", count.bytes}};
    }
    out["runs"] = report.runs;
    out["threads"] = report.threads;
    out["peak_budget_bytes"] = report.peak_budget_bytes;
    out["sweep_s"] = report.wall_s;
    out["wall_s"] = usage.wall_s;
    out["user_s"] = usage.user_s;
    out["system_s"] = usage.system_s;
    out["peak_rss_bytes"] = usage.peak_rss_bytes;
    return out.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

}  // namespace

void coverage(const std::vector<std::string>& arguments, Stop& stop) {
    const double start_s = now_s();
    const ViewshedArguments translated = translate_viewshed(arguments);
    Settings settings = parse_arguments(command_coverage, translated.words);
    if (settings.help) return print(help_text(command_by_name("coverage")));
    if (settings.files.size() != 2)
        throw InputError(
            text("coverage takes two paths, the terrain raster and the output; found ", settings.files.size()));
    settings.dem = settings.files[0];
    settings.output = settings.files[1];
    settings.snap_to_post = translated.gdal_style;
    check_complete(settings);
    for (const auto* output : {&settings.output, &settings.report})
        for (const auto* input : {&settings.dem, &settings.culture_height})
            if (!output->empty() && !input->empty() && same_file(*output, *input))
                throw InputError(
                    text("output ", in_quotes(*output), " is an input too; an output may not replace one"));
    if (settings.no_data_value)
        settings.coverage.mask.no_data = static_cast<std::uint8_t>(*settings.no_data_value);
    else if (translated.gdal_style)
        settings.coverage.mask.no_data = settings.coverage.mask.outside;
    OutputFile file(settings.output, settings.overwrite);
    std::optional<OutputFile> report_file;
    if (!settings.report.empty()) report_file.emplace(settings.report, settings.overwrite);

    const GdalSession session(cache_bytes(settings), settings.config);
    const auto source = open_direct_source(data_base_params(settings, cache_bytes(settings)));
    const DataBase& db = source->data_base();
    if (settings.snap_to_post && settings.scene.platform.xy) {
        // gdal_viewshed's observer stands in the middle of the cell that the place lies in.
        PointXY& at = *settings.scene.platform.xy;
        at.x = db.origin_x + std::floor((at.x - db.origin_x) / db.step_x + 0.5) * db.step_x;
        at.y = db.origin_y + std::floor((at.y - db.origin_y) / db.step_y + 0.5) * db.step_y;
    }
    const ResolvedScene scene = resolve_coverage(settings.scene, *source);

    CoverageParams params = settings.coverage;
    params.cull = !settings.no_cull;
    params.threads = settings.threads;
    params.memory_bytes = static_cast<std::size_t>(settings.memory_bytes);
    params.stop = &stop;
    Progress progress(settings.quiet);
    params.progress = [&](double fraction) { progress.report(fraction); };

    RasterFormat format;
    format.driver = settings.driver;
    format.creation = settings.creation;
    format.reproducible = settings.reproducible;
    format.version = version();
    format.scene_json = parameters(settings).dump();
    CoverageFile::Layer layer;
    layer.kind = params.layer;
    layer.mask = params.mask;
    if (settings.no_data_value) layer.no_data = params.mask.no_data;
    check_coverage(scene, *source, params);
    CoverageFile raster(scene, db, layer, file, format);
    const CoverageReport report = cover(scene, *source, params, [&](const CoverageTile& tile) { raster.write(tile); });
    progress.done();
    const auto posts_in = [&](State s) { return report.states[static_cast<std::size_t>(s)]; };
    raster.close(posts_in(State::no_data) + posts_in(State::outside));
    stop.check();
    const Usage usage = usage_since(start_s);
    std::vector<OutputFile*> files{&file};
    if (report_file) {
        errno = 0;
        std::ofstream out(report_file->temporary_path(), std::ios::binary);
        out << report_text(settings, report, db, usage);
        out.close();
        if (!out)
            throw IoError(text("report ", in_quotes(settings.report),
                               " cannot be written: ", errno ? std::strerror(errno) : "disk full?"));
        files.push_back(&*report_file);
    }
    OutputFile::commit(files);
    const double all = static_cast<double>(db.columns) * static_cast<double>(db.rows), wall = now_s() - start_s,
                 judged = static_cast<double>(report.seen() + posts_in(State::shadow));
    remark(settings.quiet,
           fmt::format("sensor: {:.1f} m above sea level; seen: {} posts, {:.2f} % of those in range with data",
                       scene.sensor_m, grouped(report.seen()),
                       judged > 0 ? 100 * static_cast<double>(report.seen()) / judged : 0.0));
    remark(settings.quiet,
           text("written: ", settings.output, fmt::format(" ({:.1f} s, {:.0f} Mposts/s)", wall, all / wall * 1e-6)));
}

}  // namespace wedgescope
