#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "lib/block_map.hpp"
#include "lib/length.hpp"
#include "lib/material.hpp"
#include "lib/plan.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/raster.hpp"
#include "tiles/store_check.hpp"
#include "tiles/tile_store.hpp"
#include "tools/budget.hpp"
#include "tools/commands.hpp"
#include "tools/doubts.hpp"
#include "tools/ground.hpp"
#include "tools/help.hpp"
#include "tools/options.hpp"
#include "tools/report_json.hpp"
#include "tools/scene_json.hpp"
#include "tools/settings_check.hpp"
#include "tools/terminal.hpp"

namespace wedgescope {
namespace {

using json = nlohmann::ordered_json;

// ------------------------------------------------------------------------------------------------------- rasters

struct CodeCount {
    int code;
    std::uint64_t count;
    std::string material;  ///< empty: unknown
};

struct RasterView {
    RasterSummary summary;
    std::string legend;  ///< empty: codes not asked for
    std::vector<CodeCount> codes;  ///< empty too where they are too many to be listed
};

RasterView raster_facts(const std::string& path, const std::optional<Legend>& legend, const Materials& materials,
                        const Stop& stop) {
    RasterView facts{summarise_raster(path, legend.has_value(), &stop), "", {}};
    if (!legend) return facts;
    facts.legend = legend->name();
    for (const auto& [code, count] : facts.summary.codes.counts()) {
        const std::optional<ClassId> id = legend->find(code);
        facts.codes.push_back({code, count, id ? materials[*id].name : ""});
    }
    return facts;
}

std::uint64_t unknown_cells(const RasterView& facts) {
    std::uint64_t cells = 0;
    for (const CodeCount& c : facts.codes) cells += c.material.empty() ? c.count : 0;
    return cells;
}

std::uint64_t posts_of(const RasterSummary& r) {
    return static_cast<std::uint64_t>(r.columns) * static_cast<std::uint64_t>(r.rows);
}

/// What JSON has no number for in gdalinfo's words.
json no_data_json(bool has_no_data, double value) {
    if (!has_no_data) return nullptr;
    if (std::isfinite(value)) return value;
    return std::isnan(value) ? "NaN" : value > 0 ? "Infinity" : "-Infinity";
}

json to_json(const RasterView& facts) {
    const RasterSummary& r = facts.summary;
    json out{{"path", r.path},
             {"kind", "raster"},
             {"driver", r.driver},
             {"data_type", r.data_type},
             {"bands", r.bands},
             {"columns", r.columns},
             {"rows", r.rows},
             {"block_columns", r.block_columns},
             {"block_rows", r.block_rows},
             {"compression", r.compression}};
    out["crs"] = r.has_crs ? json(r.crs_name) : json(nullptr);
    out["geographic"] = r.geographic;
    out["origin_x"] = r.origin_x;
    out["origin_y"] = r.origin_y;
    out["step_x"] = r.step_x;
    out["step_y"] = r.step_y;
    if (r.has_crs)
        out["wgs84"] = std::isnan(r.west)
                           ? json(nullptr)
                           : json{{"west", r.west}, {"east", r.east}, {"south", r.south}, {"north", r.north}};
    if (r.polar)
        out["polar"] = json{{"azimuth_start_deg", r.polar->azimuth_start_deg},
                            {"azimuth_step_deg", r.polar->azimuth_step_deg},
                            {"range_start_m", r.polar->range_start_m},
                            {"range_step_m", r.polar->range_step_m},
                            {"range_kind", r.polar->range_kind}};
    out["no_data"] = no_data_json(r.has_no_data, r.no_data);
    out["unit"] = r.unit;
    out["unit_m"] = r.unit_m ? json(*r.unit_m) : json(nullptr);
    out["void_posts"] = r.void_posts;
    const std::uint64_t posts = posts_of(r);
    if (r.void_posts < posts) {
        out["lowest"] = r.lowest;
        out["highest"] = r.highest;
        out["mean"] = r.mean;
    }
    if (facts.legend.empty()) return out;
    out["legend"] = facts.legend;
    if (r.codes.too_many()) {
        for (const char* unlisted : {"codes", "unknown_codes", "unknown_cells"}) out[unlisted] = nullptr;
        out["more_codes_than"] = CodeCounts::most_codes;
        return out;
    }
    out["codes"] = json::array();
    for (const CodeCount& c : facts.codes) {
        out["codes"].push_back(json{
            {"code", c.code}, {"count", c.count}, {"material", c.material.empty() ? json(nullptr) : json(c.material)}});
    }
    out["unknown_codes"] =
        std::count_if(facts.codes.begin(), facts.codes.end(), [](const CodeCount& c) { return c.material.empty(); });
    out["unknown_cells"] = unknown_cells(facts);
    return out;
}

std::string row(const char* label, const std::string& value) { return fmt::format("  {:<12}{}\n", label, value); }

/// What values count: metres, where the file says what its own are.
std::string words_of_unit(const RasterSummary& r) {
    if (r.unit.empty()) return "";
    if (r.polar) return ", unit " + r.unit;
    if (!r.unit_m) return text(", in the unit '", r.unit, "' (no length that is known, and so no terrain)");
    return *r.unit_m == 1 ? ", unit " + r.unit : text(", in m (the file has ", r.unit, ")");
}

std::string rows_of_posts(const RasterSummary& r) {
    std::string out = row("posts", text(grouped(static_cast<std::uint64_t>(r.columns)), " columns x ",
                                        grouped(static_cast<std::uint64_t>(r.rows)), " rows = ", grouped(posts_of(r))));
    out += row("CRS",
               r.has_crs ? r.crs_name + (r.geographic ? " (latitude, longitude)" : "") : "none (geometry grid only)");
    out += row("corner", fmt::format("{:.10g}, {:.10g}", r.origin_x, r.origin_y));
    out += row("step", fmt::format("{:.10g}, {:.10g}", r.step_x, r.step_y));
    if (r.has_crs)
        out += row("WGS84", std::isnan(r.west) ? "its edge has no place on earth"
                                               : fmt::format("latitude {:.5f} to {:.5f}, longitude {:.5f} to {:.5f}",
                                                             r.south, r.north, r.west, r.east));
    return out;
}

std::string rows_of_bins(const RasterSummary& r, const PolarAxes& polar) {
    const auto rows = static_cast<double>(r.rows), columns = static_cast<double>(r.columns);
    std::string out =
        row("bins", text(grouped(static_cast<std::uint64_t>(r.rows)), " in azimuth x ",
                         grouped(static_cast<std::uint64_t>(r.columns)), " in range = ", grouped(posts_of(r))));
    out += row("azimuth",
               fmt::format("{:.10g} to {:.10g} deg from north, clockwise, in steps of {:.10g}", polar.azimuth_start_deg,
                           polar.azimuth_start_deg + rows * polar.azimuth_step_deg, polar.azimuth_step_deg));
    out += row("range", fmt::format("{:.10g} to {:.10g} m{}, in steps of {:.10g}", polar.range_start_m,
                                    polar.range_start_m + columns * polar.range_step_m,
                                    polar.range_kind.empty() ? "" : " (" + polar.range_kind + ")", polar.range_step_m));
    return out;
}

std::string to_text(const RasterView& facts) {
    const RasterSummary& r = facts.summary;
    const std::uint64_t posts = posts_of(r);
    const double all = static_cast<double>(posts);
    std::string out = r.path + "\n";
    out += row("format", text(r.driver, ", ", r.data_type, r.compression.empty() ? "" : ", ", r.compression,
                              ", blocks of ", r.block_columns, " x ", r.block_rows));
    if (r.bands > 1)
        out += row("bands", text(r.bands, r.polar && r.polar->frames ? ", frames of a track" : "",
                                 ", the first of which is read"));
    out += r.polar ? rows_of_bins(r, *r.polar) : rows_of_posts(r);
    std::string voids = r.has_no_data ? fmt::format("no-data {:g}", r.no_data) : "no no-data value";
    out += row("voids", fmt::format("{} ({:.3g} %), {}", counted(r.void_posts, r.polar ? "cell" : "post"),
                                    all > 0 ? 100 * static_cast<double>(r.void_posts) / all : 0, voids));
    if (r.void_posts < posts) {
        out += row("values", fmt::format("{:.10g} to {:.10g}, mean {}{}", r.lowest, r.highest,
                                         std::abs(r.mean) < 0.1 && r.mean != 0 ? fmt::format("{:.4g}", r.mean)  // watts
                                                                               : fmt::format("{:.4f}", r.mean),
                                         words_of_unit(r)));
    } else {
        out += row("values", "none: every post is void");
    }
    if (!r.polar && (r.columns < 2 || r.rows < 2 || r.void_posts == posts))
        out += row("note", "no terrain for simulate, which needs 2 x 2 posts or more that are not all void");
    if (facts.legend.empty()) return out;
    if (r.codes.too_many())
        return out + row("codes", text("more than ", CodeCounts::most_codes, ", not listed by legend ", facts.legend));
    out += row("codes", text(facts.codes.size(), " by legend ", facts.legend));
    for (const CodeCount& c : facts.codes) {
        out += fmt::format("  {:>10}  {:>15} {:>8.3f} %  {}\n", c.code, grouped(c.count),
                           all > 0 ? 100 * static_cast<double>(c.count) / all : 0,
                           c.material.empty() ? "unknown" : c.material);
    }
    const auto unknown =
        std::count_if(facts.codes.begin(), facts.codes.end(), [](const CodeCount& c) { return c.material.empty(); });
    out += row("unknown",
               unknown == 0 ? "none" : text(counted(unknown, "code"), ", ", counted(unknown_cells(facts), "cell")));
    return out;
}

// ---------------------------------------------------------------------------------------------------- tile stores

struct StoreFacts {
    std::string path;
    std::optional<StoreDescription> store;  ///< none: its manifest is damaged, as the verdict says
    std::optional<StoreVerdict> verdict;
};

void add_description(json& out, const StoreDescription& s) {
    out["version"] = s.version;
    out["software"] = s.software;
    out["legend"] = s.legend.empty() ? json(nullptr) : json(s.legend);
    if (s.culture_height_scale) out["culture_height_scale"] = *s.culture_height_scale;
    out["layers"] = json::array();
    for (const auto& layer : s.layers) {
        json one{{"name", layer.name},     {"data_type", layer.type}, {"columns", layer.columns},
                 {"rows", layer.rows},     {"tile_size", layer.tile}, {"compression", layer.compression},
                 {"sheets", layer.sheets}, {"tiles", layer.tiles},    {"bytes", layer.bytes}};
        one["crs"] = layer.has_crs ? json(layer.crs_name) : json(nullptr);
        one["geographic"] = layer.geographic;
        one["origin_x"] = layer.origin_x;
        one["origin_y"] = layer.origin_y;
        one["step_x"] = layer.step_x;
        one["step_y"] = layer.step_y;
        one["no_data"] = no_data_json(layer.has_no_data, layer.no_data);
        one["unit"] = layer.unit;
        one["void_posts"] = layer.void_posts;
        if (layer.lowest <= layer.highest) {
            one["lowest"] = layer.lowest;
            one["highest"] = layer.highest;
        }
        one["sources"] = layer.sources;
        out["layers"].push_back(one);
    }
    out["block_map"] = json{{"levels", s.block_levels}, {"bytes", s.block_map_bytes}};
    out["kept_spill"] = nullptr;
    if (s.kept) {
        out["kept_spill"] =
            json{{"bytes", s.kept->bytes}, {"column", s.kept->nadir.column}, {"row", s.kept->nadir.row}};
        if (const auto& at = s.kept->latlon) out["kept_spill"].update({{"lat", at->lat_deg}, {"lon", at->lon_deg}});
        out["kept_spill"]["damage"] = s.kept->damage.empty() ? json(nullptr) : json(s.kept->damage);
    }
}

json to_json(const StoreFacts& facts) {
    json out{{"path", facts.path}, {"kind", "tile store"}};
    if (facts.store) add_description(out, *facts.store);
    if (facts.verdict)
        out["verify"] =
            json{{"files", facts.verdict->files}, {"bytes", facts.verdict->bytes}, {"damage", facts.verdict->damage}};
    return out;
}

std::string to_text(const StoreDescription& s) {
    std::string out = row(
        "tile store", text("version ", s.version, ", by ", s.software, s.legend.empty() ? "" : ", legend ", s.legend));
    out += row("block map", fmt::format("{} of blocks of {} x {} posts and more, {}",
                                        counted(static_cast<std::uint64_t>(s.block_levels), "level"), block_posts,
                                        block_posts, readable_bytes(static_cast<double>(s.block_map_bytes))));
    for (const auto& layer : s.layers) {
        const std::uint64_t posts = static_cast<std::uint64_t>(layer.columns) * static_cast<std::uint64_t>(layer.rows);
        out += fmt::format("  {}\n", layer.name);
        out += row("  posts", text(grouped(static_cast<std::uint64_t>(layer.columns)), " columns x ",
                                   grouped(static_cast<std::uint64_t>(layer.rows)), " rows = ", grouped(posts)));
        out += row("  format",
                   fmt::format("{}, {}, {} of {} x {} in {}, {}", layer.type, layer.compression,
                               counted(layer.tiles, "tile"), layer.tile, layer.tile, counted(layer.sheets, "sheet"),
                               readable_bytes(static_cast<double>(layer.bytes))));
        out += row("  CRS", layer.has_crs ? layer.crs_name + (layer.geographic ? " (latitude, longitude)" : "")
                                          : "none (geometry grid only)");
        out += row("  corner", fmt::format("{:.10g}, {:.10g}", layer.origin_x, layer.origin_y));
        out += row("  step", fmt::format("{:.10g}, {:.10g}", layer.step_x, layer.step_y));
        out += row("  voids", fmt::format("{} ({:.3g} %)", counted(layer.void_posts, "post"),
                                          100 * static_cast<double>(layer.void_posts) / static_cast<double>(posts)));
        if (layer.lowest <= layer.highest)
            out += row("  values", fmt::format("{:.10g} to {:.10g}", layer.lowest, layer.highest) +
                                       (s.culture_height_scale && layer.name == name(StoreLayerKind::culture_height)
                                            ? fmt::format(", times {:.10g} m", *s.culture_height_scale)
                                            : ""));
        out += row("  from", text(layer.sources.empty() ? "" : layer.sources[0],
                                  layer.sources.size() > 1 ? text(" and ", layer.sources.size() - 1, " more") : ""));
    }
    if (s.kept && s.kept->damage.empty())
        out += row(
            "kept spill",
            fmt::format("for scenes from {}column {:.2f}, row {:.2f}, {}",
                        s.kept->latlon ? fmt::format("latitude {:.6f}, longitude {:.6f}: ", s.kept->latlon->lat_deg,
                                                     s.kept->latlon->lon_deg)
                                       : std::string(),
                        s.kept->nadir.column, s.kept->nadir.row, readable_bytes(static_cast<double>(s.kept->bytes))));
    else if (s.kept)
        out += row("kept spill", s.kept->damage);
    return out;
}

std::string to_text(const StoreFacts& facts) {
    std::string out = facts.path + "\n";
    if (facts.store) out += to_text(*facts.store);
    if (facts.verdict && facts.verdict->damage.empty())
        out += row("verified", fmt::format("{} files, {}: all as they were written", grouped(facts.verdict->files),
                                           readable_bytes(static_cast<double>(facts.verdict->bytes))));
    if (facts.verdict)
        for (const std::string& line : facts.verdict->damage) out += row("damage", line);
    return out;
}

/// `damage`: lines found so far, which end in an error when all is printed.
StoreFacts store_facts(const Settings& settings, const std::string& path, const Stop& stop, std::size_t& damage) {
    StoreFacts facts;
    facts.path = path;
    if (!settings.verify) {
        facts.store = describe_store(path);
        return facts;
    }
    Progress progress(settings.quiet);
    facts.verdict = verify_store(path, &stop, [&](double fraction) { progress.report(fraction); });
    progress.done();
    damage += facts.verdict->damage.size();
    try {
        facts.store = describe_store(path);
    } catch (const Error&) {  // a damaged manifest is in the verdict
    }
    return facts;
}

// ---------------------------------------------------------------------------------------------------- scene files

struct SceneFacts {
    std::string path;
    Settings settings;
    ResolvedScene resolved;
    Frame frame;
    std::uint64_t image_bytes = 0;  ///< of all images that a run holds
    std::int64_t columns = 0, rows = 0;
    SourceChoice source;
};

json source_json(const SourceChoice& choice) {
    json out{{"kind", choice.spilled ? "spilled" : "direct"}, {"why", choice.why}, {"kept", choice.kept}};
    out["unfit"] = choice.unfit.empty() ? json(nullptr) : json(choice.unfit);
    return out;
}

std::string source_text(const SourceChoice& choice) {
    return row("source", text(choice.spilled ? "spilled: " : "direct: ", choice.why)) +
           (choice.unfit.empty() ? "" : row("", unused_line(choice.unfit)));
}

void check_one_place(const Settings& settings) {
    if (!settings.track.empty())
        throw InputError(
            "track is given; info looks at one place (give that of one of its rows: latlon or xy, and an altitude)");
}

/// What a command line of info says of the scenes among its files.
std::vector<Given> said_of_scenes(const Settings& settings) {
    std::vector<Given> said;
    for (const char* key : {"memory", "class-table"})
        if (settings.by_option(key))
            said.push_back({key, find_key(key)->get(settings).value_or(""), settings.spelled(key), ""});
    for (const auto& [name, value] : settings.config)
        said.push_back({"config", text(name, "=", value), settings.spelled("config"), ""});
    return said;
}

SceneFacts scene_facts(const Settings& settings, const std::string& path, const Stop& stop) {
    SceneFacts facts;
    facts.path = path;
    facts.settings = settings;
    check_one_place(facts.settings);
    check_complete(facts.settings);
    const DataBaseParams layers = data_base_params(facts.settings, cache_bytes(facts.settings), stop);
    facts.source = choose_source(layers, facts.settings.source, facts.settings.scene,
                                 static_cast<std::size_t>(facts.settings.memory_bytes));
    const auto source = open_direct_source(layers);
    check_budget(facts.settings, [&](std::size_t memory) {
        const Settings granted = with_memory(facts.settings, memory);
        check_reader(*open_direct_source(data_base_params(granted, cache_bytes(granted), stop)), memory);
    });
    facts.columns = source->data_base().columns;
    facts.rows = source->data_base().rows;
    facts.resolved = resolve(facts.settings.scene, *source);
    facts.frame = frame(display_setting(facts.resolved));
    facts.image_bytes = image_bytes(facts.resolved, draws(facts.settings));
    return facts;
}

double noise_dbm(const ResolvedScene& r) { return 10 * std::log10(r.noise_power_w * 1e3); }

json to_json(const SceneFacts& facts) {
    json out{{"path", facts.path}, {"kind", "scene"}};
    out["scene"] = parameters_json(with_resolved(facts.settings, facts.resolved), true);
    out["scene"]["resolved"] = resolved_json(facts.resolved);
    out["picture"] = json{{"width", facts.frame.width},
                          {"height", facts.frame.height},
                          {"metres_per_pixel", facts.frame.metres_per_pixel}};
    out["pulse_extent_m"] = facts.resolved.scene.radar.pulse_extent_m();
    out["noise_dbm"] = noise_dbm(facts.resolved);
    out["source"] = source_json(facts.source);
    out["image_bytes"] = facts.image_bytes;
    return out;
}

std::string to_text(const SceneFacts& facts) {
    const ResolvedScene& r = facts.resolved;
    const Scene& s = r.scene;
    std::string out = facts.path + "\n";
    out += row("terrain", text(facts.settings.dem, ", ", facts.columns, " x ", facts.rows, " posts"));
    out += source_text(facts.source);
    if (r.has_lat_lon) out += row("position", fmt::format("latitude {:.6f}, longitude {:.6f}", r.lat_deg, r.lon_deg));
    out += row(r.has_lat_lon ? "" : "position",
               fmt::format("x {:.3f}, y {:.3f}; column {:.3f}, row {:.3f}{}", r.x, r.y, r.nadir.column, r.nadir.row,
                           r.nadir_in_raster ? "" : " (outside the raster)"));
    out += row("height",
               fmt::format("{:.1f} m above sea level, {}", r.sensor_m,
                           r.nadir_on_data ? fmt::format("{:.1f} m above the terrain", r.sensor_m - r.reference_m)
                                           : std::string(!r.nadir_in_raster     ? "no terrain below"
                                                         : r.nadir_beyond_posts ? "beyond the outermost posts"
                                                                                : "over a void")));
    out += row("geometry", text(word(r.geometry), ", earth ",
                                r.earth.inverse_radius() > 0 ? fmt::format("{:.1f} km", 1e-3 / r.earth.inverse_radius())
                                                             : std::string("flat")));
    out += row("heading",
               fmt::format("{:.6g}deg, sector {}", s.platform.heading.deg(),
                           s.sector ? fmt::format("{:.6g}deg to {:.6g}deg", s.sector->from.deg(), s.sector->to.deg())
                                    : std::string("full circle")));
    out += row("range", fmt::format("{:.1f} to {:.1f} m ({:.2f} nmi) {}", s.range_start_m, s.range_m.value_or(0),
                                    s.range_m.value_or(0) / nautical_mile_m,
                                    s.display.kind == DisplayKind::gpi_true ? "along the ground" : "slant"));
    out += row("bins", fmt::format("{} azimuths of {} in the circle, {} ranges of {:.4f} m; swept {} x {} with the "
                                   "beam's skirt and the pulse's lead-in",
                                   r.shown.azimuth_count(), r.shown.circle_bins, r.shown.range_count(),
                                   r.shown.range_bin_m, r.swept.azimuth_count(), r.swept.range_count()));
    if (!facts.settings.radar_set.empty()) out += row("set", facts.settings.radar_set);
    out += row("beam", fmt::format("{:.6g}deg = {:.2f} bins; pulse {:.6g} us = {:.2f} m = {:.2f} bins",
                                   s.radar.antenna.beam.deg(), s.radar.antenna.beam.rad() / r.shown.azimuth_step_rad(),
                                   s.radar.pulse_s * 1e6, s.radar.pulse_extent_m(),
                                   s.radar.pulse_extent_m() / r.shown.range_bin_m));
    out += row("noise", fmt::format("{:.3f} dBm in {:.6g} MHz", noise_dbm(r), s.radar.noise_bandwidth_hz() * 1e-6));
    out += row("picture", fmt::format("{} x {} pixels of {:.2f} m, {}, {} up", facts.frame.width, facts.frame.height,
                                      facts.frame.metres_per_pixel, word(s.display.kind), word(s.display.orientation)));
    out += row("memory",
               fmt::format("{} for the images, budget {}", readable_bytes(static_cast<double>(facts.image_bytes)),
                           readable_bytes(static_cast<double>(facts.settings.memory_bytes))));
    return out;
}

// ---------------------------------------------------------------------------------------------------------- plans

/// What simulate would read from, and what that comes to.
struct PlannedSource {
    SourceChoice choice;
    std::unique_ptr<WedgeSource> source;  ///< a forecast, where a pass would be made
    ResolvedScene scene;
    SourceReport report;
};

PlannedSource planned_source(const Settings& settings, const Stop& stop) {
    const DataBaseParams layers = data_base_params(settings, cache_bytes(settings), stop);
    const SpillOptions options = spill_options(settings);
    PlannedSource planned;
    planned.choice = choose_source(layers, settings.source, settings.scene, options.memory_bytes);
    planned.scene = resolve(settings.scene, *open_direct_source(layers));
    planned.source = planned.choice.spilled && !planned.choice.kept
                         ? forecast_spilled_source(layers, planned.scene, settings.scene.range_m.has_value(), options)
                         : open_source(planned.choice, layers, settings.scene, options);
    planned.report = planned.source->report();
    return planned;
}

/// The pass is over before the wedges begin.
std::size_t peak_bytes(const PlannedSource& planned, const Plan& plan) {
    return std::max(planned.report.planned_pass_peak_bytes, plan.peak_bytes());
}

/// CPU seconds of pass and wedges.
double likely_seconds(const Settings& settings, const PlannedSource& planned, const Plan& plan) {
    constexpr double pass_byte_s = 8e-9;  // measured with int16 posts
    return plan.likely_seconds(settings.no_cull) +
           pass_byte_s * static_cast<double>(planned.report.planned_partition_bytes);
}

json plan_json(const Settings& settings, const ResolvedScene& scene, const PlannedSource& planned, const Plan& plan) {
    const WedgeForecast all = plan.total();
    json out{{"format", "wedgescope-plan-1"}, {"version", version()}};
    out["scene"] = parameters_json(with_resolved(settings, scene), true);
    out["scene"]["resolved"] = resolved_json(scene);
    out["wedges"] = plan.wedges.size();
    out["wedges_in_flight"] = plan.in_flight;
    out["chunks"] = all.chunks;
    out["posts"] = all.posts;
    out["bytes_read"] = all.bytes;
    out["likely_posts"] = std::llround(all.likely_posts);
    out["likely_bytes_read"] = std::llround(all.likely_bytes);
    out["source"] = source_json(planned.choice);
    out["partition_bytes"] = planned.report.planned_partition_bytes;
    out["bytes_spilled"] = planned.report.planned_spilled_bytes;
    out["temporary_disk_bytes"] = planned.report.planned_spilled_bytes;
    out["source_bytes"] = planned.source->cache_bytes();
    out["peak_bytes"] = peak_bytes(planned, plan);
    out["granted_bytes"] = plan.fixed_bytes + plan.wedge_bytes * static_cast<std::size_t>(plan.in_flight);
    out["likely_cpu_s"] = likely_seconds(settings, planned, plan);
    return out;
}

std::string plan_text(const Settings& settings, const PlannedSource& planned, const Plan& plan) {
    const WedgeForecast all = plan.total();
    const auto bytes = [](auto n) { return readable_bytes(static_cast<double>(n)); };
    const bool map = planned.source->block_map() != nullptr, pass = planned.choice.spilled && !planned.choice.kept;
    std::string out = source_text(planned.choice);
    out += row("wedges", fmt::format("{}, {} at a time", plan.wedges.size(), plan.in_flight));
    out += row("chunks", fmt::format("{}, of at most {} lines", grouped(all.chunks), plan.strip_lines));
    out += row("to read", fmt::format("{} posts, {}, if nothing is left out", grouped(all.posts), bytes(all.bytes)));
    if (settings.no_cull) {
        out += row("", "no-cull: nothing will be");
    } else {
        out += row("", map ? fmt::format("likely {} posts, {}: the rest lies hidden by the coarse block map",
                                         grouped(static_cast<std::uint64_t>(all.likely_posts)), bytes(all.likely_bytes))
                           : std::string(pass ? "what can be left out shows in the pass"
                                              : "of the terrain nothing can be left out: no block map is known"));
    }
    if (!pass) {
        out += row("spill", planned.choice.kept ? "none: a kept spill is read" : "none: windows are read directly");
    } else {
        const SourceReport& r = planned.report;
        out += row("pass", fmt::format("{} read once, in the order of the file", bytes(r.planned_partition_bytes)));
        out += row("spill", r.planned_spilled_bytes == 0
                                ? std::string("none: all blocks stay in memory")
                                : fmt::format("{} to a file in temp-dir at the most", bytes(r.planned_spilled_bytes)));
    }
    out += row("memory", fmt::format("{} at the peak of {} granted; caches of the source may take {} of it",
                                     bytes(peak_bytes(planned, plan)), bytes(settings.memory_bytes),
                                     bytes(planned.source->cache_bytes())));
    out += row("time", fmt::format("about {:.1f} s of CPU for {} (within a factor of three)",
                                   likely_seconds(settings, planned, plan), pass ? "pass and wedges" : "the wedges"));
    return out;
}

void print_plan(const Settings& given, const Stop& stop) {
    Settings settings = given;
    check_one_place(settings);
    check_complete(settings);
    settings.expects_ground = expects_ground(settings, {.levels = true}, stop);
    check_simulation(settings, stop);
    find_ground(settings, {.levels = true}, stop);  // levels of detail are part of what is foretold
    const PlannedSource planned = planned_source(settings, stop);
    const ResolvedScene& scene = planned.scene;
    const Plan found = [&] {
        try {
            return plan(scene, *planned.source, engine_params(settings));
        } catch (const TooLittleMemory& e) {
            refuse(e, memory_bytes(settings), simulation(settings, scene, settings.scene.range_m.has_value(), stop));
        }
    }();
    print(settings.json
              ? plan_json(settings, scene, planned, found).dump(2, ' ', false, json::error_handler_t::replace) + "\n"
              : plan_text(settings, planned, found));
}

/// One value more of a list of JSON one level deep: as text it takes a quarter of the room.
void add_to_list(std::string& list, const json& value) {
    list += list.empty() ? "\n    " : ",\n    ";
    for (const char c : value.dump(2, ' ', false, json::error_handler_t::replace)) {
        list += c;
        if (c == '\n') list += "    ";
    }
}

}  // namespace

void info(const std::vector<std::string>& arguments, Stop& stop) {
    const Settings settings = parse_arguments(command_info, arguments);
    if (settings.help) return print(help_text(command_by_name("info")));
    if (settings.files.empty() && !settings.plan)
        throw InputError("info needs the path of a raster or of a scene file (*.ini)");
    if (settings.plan && settings.verify) throw InputError("verify is given with plan; it is for tile stores");
    // Each scene has its own.
    std::optional<GdalSession> session(std::in_place, cache_bytes(settings), settings.config);
    if (settings.plan) return print_plan(settings, stop);
    const bool own = settings.culture_legend == own_legend;  // each raster has one
    const std::optional<Legend> codes = own ? std::nullopt : legend(settings);
    std::string page;
    std::size_t damage = 0;
    std::vector<std::string> remarks;
    const auto look_at = [&](const std::string& path, double lowest_m) {
        if (std::string line = undeclared_void(path, lowest_m); !line.empty()) remarks.push_back(std::move(line));
    };
    for (const std::string& path : settings.files) {
        stop.check();
        const auto add = [&](const auto& facts) {
            if (settings.json) {
                add_to_list(page, to_json(facts));
            } else {
                if (!page.empty()) page += "\n";
                page += to_text(facts);
            }
        };
        if (names_scene(path)) {
            if (!settings.culture_legend.empty())
                remarks.push_back(text("culture-legend is for rasters; the scene ", in_quotes(path),
                                       " goes by a key culture-legend of its own"));
            if (settings.verify) throw InputError(text("verify is for tile stores; ", in_quotes(path), " is a scene"));
            const Settings scene = parse_scene_file(path, said_of_scenes(settings));
            session.emplace(cache_bytes(scene), scene.config);
            add(scene_facts(scene, path, stop));
            session.emplace(cache_bytes(settings), settings.config);
        } else if (is_tile_store(path)) {
            const StoreFacts facts = store_facts(settings, path, stop, damage);
            add(facts);
            if (facts.store && !facts.store->layers.empty()) look_at(path, facts.store->layers[0].lowest);
        } else if (settings.verify) {
            throw InputError(text("verify is for tile stores; ", in_quotes(path), " is none"));
        } else {
            check_summary(settings, path);
            const RasterView facts =
                raster_facts(path, own ? legend(settings, path) : codes, settings.scene.materials, stop);
            add(facts);
            look_at(path, facts.summary.lowest);
        }
    }
    if (settings.json)
        print(text("{\n  \"format\": \"wedgescope-info-1\",\n  \"version\": ", json(version()).dump(),
                   ",\n  \"files\": ["));
    print(page);
    if (settings.json) print("\n  ]\n}\n");
    for (const std::string& line : remarks) remark(settings.quiet, line);
    if (damage > 0) throw DataError(text(damage, damage == 1 ? " damaged part was" : " damaged parts were", " found"));
}

}  // namespace wedgescope
