#include "tools/layers.hpp"

#include "tiles/echo_file.hpp"
#include "tiles/output_check.hpp"
#include "tiles/picture.hpp"
#include "tools/legend.hpp"
#include "tools/scene_json.hpp"
#include "tools/terminal.hpp"

namespace wedgescope {
namespace {

/// As files are written that --of and --co do not speak of.
RasterFormat plain_format(const Settings& settings) {
    RasterFormat format;
    format.reproducible = settings.same_bytes();
    format.version = version();
    return format;
}

RasterFormat chosen_format(const Settings& settings) {
    RasterFormat format = plain_format(settings);
    format.driver = settings.driver;
    format.creation = settings.creation;
    return format;
}

}  // namespace

NamedPaths layer_paths(const Settings& s) {
    return {{"output", s.output}, {"echo", s.echo}, {"power", s.power}, {"states", s.states}};
}

LayerFiles::LayerFiles(const Settings& settings) {
    const auto open = [&](std::optional<OutputFile>& file, const std::string& path) {
        if (!path.empty()) file.emplace(path, settings.overwrite);
    };
    open(scope_, settings.output);
    open(echo_, settings.echo);
    open(power_, settings.power);
    open(states_, settings.states);
    if (settings.scene.display.legend && scope_) legend_helper_ = find_picture_helper();
}

void LayerFiles::check(const Settings& settings) const {
    const RasterFormat chosen = chosen_format(settings), polar = scope_ ? plain_format(settings) : chosen;
    if (scope_)
        check_output(*scope_, settings.scene.display.alpha ? OutputLayer::masked_scope : OutputLayer::scope, chosen);
    if (echo_) {
        check_output(*echo_, OutputLayer::echo, polar);
        check_echo_format(*echo_, polar);
    }
    if (power_) {
        check_output(*power_, OutputLayer::power, polar);
        if (const std::string losses = power_losses(*power_, polar); !losses.empty())
            remark(settings.quiet, text("power '", power_->final_path(), "' ", losses));
    }
    if (states_) check_output(*states_, OutputLayer::states, polar);
}

void LayerFiles::write(RunResult& result, const Settings& settings, const DataBase& data_base, const Stop& stop) {
    RasterFormat plain = plain_format(settings), chosen = chosen_format(settings);
    const std::string scene = scene_json(settings, result.scene);
    for (RasterFormat* format : {&plain, &chosen}) {
        format->scene_json = scene;
        format->crs_wkt = data_base.crs_wkt;
        format->metres_per_unit = data_base.metres_per_unit;
    }
    const RasterFormat& polar = scope_ ? plain : chosen;
    stop.check();
    if (!legend_helper_.empty()) add_legend(legend_helper_, settings, result.scene, result.scope);
    if (scope_) write_scope(result, *scope_, chosen);
    stop.check();
    if (echo_) {
        RasterFormat format = polar;
        format.scene_json = echo_scene_json(settings, result, data_base);
        write_echo(result, *echo_, format);
    }
    stop.check();
    if (power_) write_power(result, settings.power_unit, *power_, polar);
    if (states_) write_states(result, *states_, polar);
    stop.check();
}

std::vector<OutputFile*> LayerFiles::files() {
    std::vector<OutputFile*> all;
    for (auto* file : {&scope_, &echo_, &power_, &states_})
        if (*file) all.push_back(&**file);
    return all;
}

}  // namespace wedgescope
