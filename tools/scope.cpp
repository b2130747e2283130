#include <fmt/format.h>

#include <algorithm>

#include "lib/plan.hpp"
#include "lib/target.hpp"
#include "tiles/echo_file.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/output_file.hpp"
#include "tools/budget.hpp"
#include "tools/commands.hpp"
#include "tools/doubts.hpp"
#include "tools/help.hpp"
#include "tools/layers.hpp"
#include "tools/options.hpp"
#include "tools/report_json.hpp"
#include "tools/run_files.hpp"
#include "tools/run_records.hpp"
#include "tools/scene_json.hpp"
#include "tools/stored_echo.hpp"
#include "tools/terminal.hpp"

namespace wedgescope {
namespace {

/// With those of the data base that its scene file names, though nothing of them is read again.
NamedPaths scope_inputs(const Settings& s) {
    NamedPaths inputs{{"the echo image", s.files[0]}, {"the scene file", s.files.size() > 1 ? s.files[1] : ""}};
    for (NamedPath& of_scene : data_paths(s)) inputs.push_back(std::move(of_scene));
    return inputs;
}

void check_scope_names(const Settings& s) {
    const NamedPaths outputs{{"output", s.output}, {"power", s.power}, {"states", s.states}, {"report", s.report}};
    check_run_names(outputs, scope_inputs(s), s.driver);
}

nlohmann::ordered_json report_of(const StoredEcho& echo, const Settings& settings, const RunResult& result,
                                 double read_s, double write_s, const Usage& usage) {
    using json = nlohmann::ordered_json;
    const RunReport& report = result.report;
    json out;
    out["format"] = "wedgescope-scope-1";
    out["version"] = version();
    out["scene"] = parameters_json(with_resolved(settings, result.scene), false);
    out["scene"]["resolved"] = resolved_json(result.scene);
    out["data_base"] = echo.data_base;
    std::vector<InputFile> inputs;
    for (std::size_t i = 0; i < settings.files.size(); ++i)
        inputs.push_back(
            input_file(i == 0 ? "echo" : "scene", settings.files[i], i == 0 ? crs_name(echo.crs_wkt) : ""));
    out["inputs"] = inputs_json(inputs);
    out["states"] = states_json(report.states);
    out["stages_wall_s"] = json{{"read", read_s},
                                {"beam", report.beam_s},
                                {"receiver", report.receiver_s},
                                {"display", report.display_s},
                                {"write", write_s}};
    add_usage(out, usage);
    out["threads"] = report.threads;
    out["instruction_set"] = name_of(target_in_use());
    return out;
}

}  // namespace

void scope(const std::vector<std::string>& arguments, Stop& stop) {
    const double start_s = now_s();
    const ScopeRequest request = parse_scope_arguments(arguments);
    if (request.settings.help) return print(help_text(command_by_name("scope")));
    const std::string& path = request.settings.files[0];
    const GdalSession session(cache_bytes(request.settings), request.settings.config);
    check_scope_names(request.settings);
    const EchoFile file(path, thread_count(request.settings));
    const StoredEcho echo = stored_echo(path, file.scene_json(), file.columns(), file.rows());

    Settings settings = settings_from(echo.given, request.given);
    settings.files = request.settings.files;
    settings.echo.clear();  // of a scene file that simulate takes
    // A legend names the data base, which an echo image does not.
    bool left_out = false;
    if (settings.scene.display.legend && settings.dem.empty()) {
        const auto asks = [](const Given& one) { return one.key == "legend"; };
        if (std::any_of(request.given.begin(), request.given.end(), asks))
            throw InputError(
                "legend is on, and it names the data base, which an echo image does not; give the scene file that says "
                "what dem is (dem = PATH), or legend off");
        settings.scene.display.legend = false;
        left_out = !settings.output.empty();
    }
    const ResolvedScene scene = scene_from_echo(echo, request.given, settings);
    // What is read whole becomes the scene's own image, or a part of it does and the whole is gone before more is made.
    const std::size_t cells = scene.swept == echo.scene.swept ? 0 : echo.scene.swept.cells() + scene.swept.cells(),
                      images = std::max(image_bytes(scene, draws(settings)), cells * 5);
    check_budget(settings, [&](std::size_t memory) {
        const std::size_t needed = images + cache_bytes(with_memory(settings, memory));
        if (needed > memory) throw TooLittleMemory(memory, needed, "this picture");
    });

    RunRecords records(settings);
    LayerFiles layers(settings);
    layers.check(settings);

    const double read_start_s = now_s();
    PolarImage<float> echo_w(echo.scene.swept, {});
    PolarImage<std::uint8_t> state(echo.scene.swept, {});
    file.read(echo_w, state, echo.checksum, echo.said);
    const double read_s = now_s() - read_start_s;
    stop.check();

    EngineParams params = engine_params(settings);
    params.stop = &stop;
    RunResult result = show(scene, std::move(echo_w), std::move(state), params);
    const double write_start_s = now_s();
    DataBase data_base;
    data_base.crs_wkt = echo.crs_wkt;
    data_base.metres_per_unit = echo.metres_per_unit;
    layers.write(result, settings, data_base, stop);
    const double write_s = now_s() - write_start_s;
    if (OutputFile* to = records.report())
        write_report(*to, report_of(echo, settings, result, read_s, write_s, usage_since(start_s)));
    stop.check();
    const std::string written = records.commit(layers.files(), scope_inputs(settings));
    for (const std::string& line : doubts(result, !settings.output.empty()))
        if (!line.empty()) remark(settings.quiet, line);
    for (const std::string& line : idle_receiver(settings.scene.receiver, settings.scene.display))
        remark(settings.quiet, line);
    if (left_out)
        remark(settings.quiet,
               "the legend is left out: it names the data base, which an echo image does not (the scene file that says "
               "what dem is, with --legend on, brings it)");
    remark(settings.quiet, text("written: ", written, fmt::format(" ({:.2f} s)", now_s() - start_s)));
}

}  // namespace wedgescope
