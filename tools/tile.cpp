#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "tiles/gdal_session.hpp"
#include "tiles/tile_store.hpp"
#include "tools/commands.hpp"
#include "tools/doubts.hpp"
#include "tools/help.hpp"
#include "tools/options.hpp"
#include "tools/report_json.hpp"
#include "tools/run_files.hpp"
#include "tools/terminal.hpp"

namespace wedgescope {
namespace {

/// A store that stands, to which nothing but a kept spill is to be added.
bool adds_to_store(const Settings& settings) {
    return settings.around && settings.files.size() == 1 && is_tile_store(settings.files[0]);
}

std::string kept_file(const Settings& settings) {
    return (std::filesystem::path(settings.files.back()) / kept_spill_name).string();
}

/// Sorts the store's posts round the point; returns the time that took.
double keep_around(const Settings& settings, const Materials& materials, Stop& stop) {
    const double start_s = now_s();
    const std::string& store = settings.files.back();
    DataBaseParams params;
    params.dem = store;
    params.materials = materials;  // the store's legend may name some of its own
    params.culture_height_scale = settings.culture_height_scale;
    params.cache_bytes = cache_bytes(settings);
    params.stop = &stop;
    PlatformParams point;
    point.latlon = settings.around;
    if (!settings.overwrite) refuse_other_kept_spill(params, point, store);
    SpillOptions options = spill_options(settings);
    options.stop = &stop;
    Progress progress(settings.quiet);
    options.progress = [&](double fraction) { progress.report(fraction); };
    const std::string place = text("--around ", settings.around->lat_deg, ",", settings.around->lon_deg),
                      words = text("; the store ", in_quotes(store), " is whole, and tile ", place, " ", store,
                                   " keeps the spill");
    try {
        keep_spill(params, point, store, options);
    } catch (const Interrupted& e) {
        throw Interrupted(e.signal(), words);
    } catch (const IoError& e) {
        throw IoError(e.what() + words);
    } catch (const TooLittleMemory& e) {
        throw InputError(e.what() + words);
    } catch (const InputError& e) {
        throw InputError(text(place, ": ", e.what(), "; the store ", in_quotes(store), " is whole"));
    }
    progress.done();
    return now_s() - start_s;
}

/// What is known of the point before a store is made.
void check_around(const Settings& settings) {
    if (settings.around && is_at_pole(settings.around->lat_deg))
        throw InputError(text("--around is ", settings.around->lat_deg, ",", settings.around->lon_deg,
                              ", within 1 m of a pole, where there is no azimuth; accepted: a place farther off"));
}

/// The store is replaced with all that lies in it.
void check_store_name(const Settings& settings) {
    NamedPaths inputs;
    for (std::size_t i = 0; i + 1 < settings.files.size(); ++i) inputs.emplace_back("dem", settings.files[i]);
    const bool words = Legend::built_in(settings.features_legend).has_value();
    inputs.insert(inputs.end(), {{"culture", settings.culture},
                                 {"culture-height", settings.culture_height},
                                 {"culture-legend", legend_path(settings)},
                                 {"directivity", settings.directivity},
                                 {"features", settings.features},
                                 {"features-legend", words ? "" : settings.features_legend},
                                 {"class-table", settings.class_table}});
    const std::string& output = settings.files.back();
    check_folder("output", output, inputs);
    check_folder("what output leaves unfinished", unfinished_store(output), inputs);
}

void refuse_store(const std::string& path, const char* layer) {
    if (is_tile_store(path))
        throw InputError(text(in_quotes(path), " is a tile store; accepted: rasters, such as ",
                              in_quotes((std::filesystem::path(path) / layer).string() + ".vrt"),
                              " (no checksum of a tile is looked at then; info --verify ", path, " does)"));
}

/// Of what goes into the store, how many files there are and of which kind.
void check_inputs(const Settings& settings) {
    if (settings.around && settings.files.size() == 1)
        throw InputError(text(
            "tile --around: ", in_quotes(settings.files[0]),
            " is no tile store; accepted: a store that stands, or terrain rasters and, last, the folder to write"));
    if (settings.files.size() < 2)
        throw InputError(text("tile needs at least one terrain raster and, last, the folder to write; found ",
                              settings.files.size(), settings.files.size() == 1 ? " path" : " paths"));
    if (!settings.culture_legend.empty() && settings.culture.empty())
        refuse_legend_alone(in_quotes(settings.culture_legend));
    for (std::size_t i = 0; i + 1 < settings.files.size(); ++i) refuse_store(settings.files[i], "dem");
    refuse_store(settings.culture, "culture");
    refuse_store(settings.culture_height, "culture_height");
    refuse_store(settings.directivity, "culture");
}

void check_features(const Settings& settings) {
    if (!settings.features.empty()) {
        if (!settings.culture.empty() && settings.culture_legend.empty())
            refuse_missing_legend("culture and features are given");
        return;
    }
    const char* const alone = !settings.features_layer.empty()    ? "features-layer"
                              : settings.features_touch           ? "features-touch"
                              : settings.features_legend != "smc" ? "features-legend"
                                                                  : nullptr;
    if (alone) throw InputError(text(alone, " is given without features; the path of a vector file is needed"));
}

/// The legend, features and sides as they are given, each by itself.
void take_culture(const Settings& settings, const Stop& stop, TileStoreParams& params) {
    params.culture = settings.culture;
    params.culture_height = settings.culture_height;
    params.culture_height_scale = settings.culture_height_scale;
    params.legend = legend(settings);
    if (params.legend) {
        params.legend_name = settings.culture_legend;
        params.legend_csv = legend_csv(settings);
    }
    const Materials& materials = settings.scene.materials;
    if (!settings.features.empty()) {
        params.features = FeatureParams{settings.features, settings.features_layer, settings.features_touch,
                                        legend("features-legend", settings.features_legend, materials), materials};
        if (!(settings.culture_height_scale > 0))
            throw InputError("culture-height-scale is 0, and features is given; it must be above 0");
    }
    if (settings.directivity.empty()) return;
    if (!params.legend)
        throw InputError(
            "directivity is given without culture and culture-legend; it says which side of culture's cells "
            "reflects");
    params.sides = SideRasterParams{settings.directivity, settings.culture, *params.legend, materials, 0, &stop};
}

/// All classes that the store's layers need, those with a side of their own too; reads features and cells for them. Returns how many
/// have a side.
std::size_t share_classes(const Materials& materials, TileStoreParams& params) {
    const SidedClasses all = sided_classes(materials, params.features, params.sides);
    if (params.features) {
        params.features->materials = all.materials;
        params.features->axis_step_deg = all.axis_step_deg;
    }
    if (all.axis_step_deg == 0) params.sides.reset();
    if (params.sides) {
        params.sides->materials = all.materials;
        params.sides->axis_step_deg = all.axis_step_deg;
    }
    if (all.axis_step_deg > 0) {
        params.class_table = all.materials.own() + "\n";
        std::replace(params.class_table.begin(), params.class_table.end(), ';', '\n');
    }
    if (params.features || params.sides) {
        params.legend = with_features(params.legend, all.materials);
        params.legend_name = params.legend->name();
        params.legend_csv = params.legend->csv(all.materials);
    }
    return all.sides;
}

/// `sides`: out, classes with a side of their own.
TileStoreParams store_params(const Settings& settings, Stop& stop, std::size_t& sides) {
    check_inputs(settings);
    check_features(settings);
    TileStoreParams params;
    params.dems.assign(settings.files.begin(), settings.files.end() - 1);
    params.output = settings.files.back();
    take_culture(settings, stop, params);
    // Before features and cells are read, which may take long.
    check_store_name(settings);
    check_store_output(params.output, settings.overwrite, settings.resume);
    sides = share_classes(settings.scene.materials, params);
    params.tile_posts = settings.tile_posts;
    params.creation = settings.creation;
    params.memory_bytes = static_cast<std::size_t>(settings.memory_bytes);
    params.cache_bytes = cache_bytes(settings);
    params.threads = thread_count(settings);
    params.overwrite = settings.overwrite;
    params.resume = settings.resume;
    params.software = text("wedgescope ", version());
    return params;
}

/// Codes of cells that the legend does not have.
std::string unknown_codes_line(const Settings& settings, const CodeCounts& unknown) {
    if (unknown.too_many())
        return fmt::format(
            "culture: more than {} codes, from {} to {} in {}, are not in the legend {} (is this a culture raster?)",
            CodeCounts::most_codes, unknown.least(), unknown.greatest(), counted(unknown.cells(), "cell"),
            in_quotes(settings.culture_legend));
    // Thousands are no classes: heights, or a picture.
    constexpr std::size_t most = 1000;
    const std::size_t codes_found = unknown.counts().size();
    std::string codes;
    std::size_t told = 0;
    for (const auto& [code, count] : unknown.counts()) {
        if (told == most) break;
        codes += fmt::format("{}{} ({})", told++ ? ", " : "", code, counted(count, "cell"));
    }
    if (codes_found > most) codes += fmt::format(" and {} more", codes_found - most);
    return fmt::format("culture: {} in {} {} not in the legend {}: {}", counted(codes_found, "code"),
                       counted(unknown.cells(), "cell"), codes_found == 1 ? "is" : "are",
                       in_quotes(settings.culture_legend), codes);
}

void tell(const Settings& settings, const TileStoreSummary& summary, double seconds) {
    const auto say = [&](const std::string& line) { remark(settings.quiet, line); };
    if (!summary.note.empty()) say(summary.note);
    if (summary.disagreements > 0)
        say(fmt::format(
            "{} that rasters share disagree{}{}, by {:.6g} m at the most, {}", counted(summary.disagreements, "post"),
            summary.disagreements == 1 ? "s" : "",
            summary.interpolated > 0 ? text(", ", grouped(summary.interpolated), " of them interpolated") : "",
            summary.largest_m, summary.largest_where));
    if (!summary.unknown_codes.empty()) say(unknown_codes_line(settings, summary.unknown_codes));
    if (summary.features_lie_elsewhere)
        say(text("features ", in_quotes(settings.features),
                 ": none lies on a cell of the terrain (is their CRS what the file says, longitude before latitude?)"));
    if (!summary.feature_fields_left_out.empty())
        say(text("features ", in_quotes(settings.features),
                 ": fields that are left out: ", listed_names(summary.feature_fields_left_out)));
    std::uint64_t reused = 0;
    if (!summary.layers.empty()) {
        const std::string line = undeclared_void(settings.files.size() == 2 ? settings.files[0] : settings.files.back(),
                                                 static_cast<double>(summary.layers[0].lowest));
        if (!line.empty()) say(line);
    }
    for (const auto& layer : summary.layers) {
        say(fmt::format("{}: {} x {} {} in {}, {}", layer.name, layer.columns, layer.rows, layer.type,
                        counted(layer.sheets, "sheet"), readable_bytes(static_cast<double>(layer.bytes))));
        reused += layer.reused;
    }
    if (settings.resume) say(text("resumed: ", counted(reused, "sheet"), " stood already"));
    say(fmt::format("written: {}{} ({:.1f} s)", settings.files.back(),
                    settings.around ? ", " + kept_file(settings) : "", seconds));
}

}  // namespace

void tile(const std::vector<std::string>& arguments, Stop& stop) {
    const double start_s = now_s();
    const Settings settings = parse_arguments(command_tile, arguments);
    if (settings.help) return print(help_text(command_by_name("tile")));
    check_around(settings);
    if (adds_to_store(settings)) {
        // Those without "--" are the store's own.
        constexpr std::string_view of_a_spill[] = {"around", "memory", "threads",     "overwrite",
                                                   "config", "quiet",  "class-table", "culture-height-scale"};
        for (const auto& [key, word] : settings.given)
            if (settings.by_option(key) &&
                std::find(std::begin(of_a_spill), std::end(of_a_spill), key) == std::end(of_a_spill))
                throw InputError(text(word, " is given, and ", in_quotes(settings.files[0]),
                                      " is a store that stands; around adds a spill to it and nothing else"));
        const GdalSession session(cache_bytes(settings), settings.config);
        const double seconds = keep_around(settings, settings.scene.materials, stop);
        return remark(settings.quiet, fmt::format("written: {} ({:.1f} s)", kept_file(settings), seconds));
    }
    const GdalSession session(cache_bytes(settings), settings.config);
    std::size_t sides = 0;
    TileStoreParams params = store_params(settings, stop, sides);
    params.stop = &stop;
    Progress progress(settings.quiet);
    params.progress = [&](double fraction) { progress.report(fraction); };
    const TileStoreSummary summary = write_tile_store(params);
    progress.done();
    const Materials& all = params.sides      ? params.sides->materials
                           : params.features ? params.features->materials
                                             : settings.scene.materials;
    if (settings.around) keep_around(settings, all, stop);
    if (!params.class_table.empty())
        remark(settings.quiet,
               fmt::format(
                   "{} with a side of {} own, axes to {} deg: {}; scenes over the store take it as their class-table",
                   sides == 1 ? "1 class" : text(sides, " classes"), sides == 1 ? "its" : "their",
                   params.sides ? params.sides->axis_step_deg : params.features->axis_step_deg,
                   in_quotes(store_classes(params.output))));
    tell(settings, summary, now_s() - start_s);
}

}  // namespace wedgescope
