#include "tools/settings.hpp"

#include <algorithm>
#include <thread>

#include "tiles/attribute_table.hpp"
#include "tools/text_file.hpp"

namespace wedgescope {

const char* version() { return WEDGESCOPE_VERSION; }

namespace {

constexpr const char* built_in_legends = "fbfm40, nlcd, worldcover, smc";

std::string csv_of(const char* key, const std::string& path) {
    const std::string subject = text(key, " ", in_quotes(path), " is none of ", built_in_legends,
                                     key == std::string("culture-legend") ? ", rat" : "", " and, as a CSV file,");
    constexpr std::size_t most_mib = 16;  // many codes
    return text_of_file(subject, path, "it holds a line for each code", most_mib);
}

std::string culture_csv(const Settings& settings) {
    const auto read = [&] { return csv_of("culture-legend", settings.culture_legend); };
    if (!settings.legend_text) return read();
    const std::lock_guard lock(settings.legend_text->mutex);
    auto& known = settings.legend_text->text;
    if (!known) known = read();
    return *known;
}

}  // namespace

std::optional<Legend> legend(const Settings& settings) { return legend(settings, settings.culture); }

std::optional<Legend> legend(const Settings& settings, const std::string& culture) {
    const std::string& name = settings.culture_legend;
    const Materials& materials = settings.scene.materials;
    if (name.empty()) return std::nullopt;
    if (auto built_in = Legend::built_in(name)) return built_in;
    if (name != own_legend) return Legend::from_csv(name, culture_csv(settings), materials);
    if (culture.empty()) refuse_legend_alone(name);
    return attribute_table_legend(culture, materials);
}

Legend legend(const char* key, const std::string& name, const Materials& materials) {
    if (auto built_in = Legend::built_in(name)) return *built_in;
    return Legend::from_csv(name, csv_of(key, name), materials);
}

void refuse_legend_alone(const std::string& shown) {
    throw InputError(
        text("culture-legend is ", shown, " but there is no culture; the path of a culture raster is needed"));
}

void refuse_missing_legend(const char* given) {
    throw InputError(
        text(given, " without culture-legend; one of ", built_in_legends, ", rat or a CSV file is needed"));
}

std::string legend_path(const Settings& settings) {
    const std::string& name = settings.culture_legend;
    return name == own_legend || Legend::built_in(name) ? "" : name;
}

std::string legend_csv(const Settings& settings) {
    const std::string& name = settings.culture_legend;
    if (name.empty() || Legend::built_in(name)) return "";
    return name == own_legend ? legend(settings)->csv(settings.scene.materials) : culture_csv(settings);
}

int thread_count(const Settings& settings) {
    const int processors = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    // What waits for a processor takes memory and turns from those that have one.
    return settings.threads > 0 ? std::min(settings.threads, std::max(32, 4 * processors)) : processors;
}

DataBaseParams data_base_params(const Settings& settings, std::size_t cache, const Stop& stop) {
    DataBaseParams params;
    params.dem = settings.dem;
    params.culture = settings.culture;
    params.culture_height = settings.culture_height;
    params.culture_height_scale = settings.culture_height_scale;
    params.legend = legend(settings);
    params.classes = settings.needs_classes;
    params.materials = settings.scene.materials;
    params.default_class = params.materials.by_name("material", settings.material);
    params.cache_bytes = cache;
    params.more_cache_bytes = static_cast<std::size_t>(settings.memory_bytes / 8);
    params.threads = thread_count(settings);
    params.ground = settings.ground;
    params.by_strips = settings.track.empty() && settings.observers.empty();
    params.expects_ground = settings.expects_ground;
    params.stop = &stop;
    return params;
}

std::size_t cache_bytes(const Settings& settings) {
    constexpr std::uint64_t most = std::uint64_t{256} << 20;
    return static_cast<std::size_t>(std::min(settings.memory_bytes / 8, most));
}

SpillOptions spill_options(const Settings& settings) {
    SpillOptions options;
    options.temp_folder = settings.temp_dir;
    options.memory_bytes = static_cast<std::size_t>(settings.memory_bytes);
    options.threads = thread_count(settings);
    options.all_round = !settings.ground_file.empty();
    return options;
}

bool draws(const Settings& s) {
    return !s.output.empty() ||
           (s.echo.empty() && s.power.empty() && s.states.empty() && s.power_stack.empty() && s.ground_file.empty());
}

EngineParams engine_params(const Settings& settings) {
    EngineParams params;
    params.threads = thread_count(settings);
    params.wedges = settings.wedges;
    params.memory_bytes = static_cast<std::size_t>(settings.memory_bytes);
    params.cull = !settings.no_cull;
    params.only_wedges = settings.only_wedges;
    params.keep_echo = !settings.echo.empty();
    params.draw = draws(settings);
    return params;
}

}  // namespace wedgescope
