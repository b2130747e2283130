// budget: the link budget of one cell, a line for each number from the transmitter to the grey level.
// Leaves how the numbers are found to lib/link_budget.hpp.
#include "lib/link_budget.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tiles/gdal_session.hpp"
#include "tools/budget.hpp"
#include "tools/commands.hpp"
#include "tools/ground.hpp"
#include "tools/help.hpp"
#include "tools/options.hpp"
#include "tools/scene_json.hpp"
#include "tools/settings_check.hpp"
#include "tools/terminal.hpp"

namespace wedgescope {
namespace {

using json = nlohmann::ordered_json;

struct Line {
    std::string name;
    std::optional<double> value;  ///< none: there is nothing to tell, as dBm of no power
    const char* unit;
    std::string note;
    bool part = false;  ///< of the line above
    int decimals = 3;
};

constexpr const char *decibel = "dB", *dbm_unit = "dBm", *dbsm = "dBsm";

std::optional<double> in_db(double ratio) {
    if (!(ratio > 0)) return std::nullopt;
    const double db = 10 * std::log10(ratio);
    return db == 0 ? 0 : db;  // no -0
}
std::optional<double> in_dbm(double watts) { return in_db(watts * 1e3); }

std::string watts(double w) { return w >= 1e3 ? fmt::format("{:.6g} kW", w / 1e3) : fmt::format("{:.4g} W", w); }

/// Why a cell has no cross section.
std::string emptiness(const LinkBudget& b) {
    if (!b.parts.empty()) return "what lies in pulse and beam returns nothing";
    switch (b.state) {
        case State::shadow:
            return "nothing in pulse and beam is seen: shadow";
        case State::no_data:
            return "nothing in pulse and beam is seen: no data";
        default:
            return b.grazing ? "nothing in pulse and beam is seen" : "nearer than the ground below: the altitude hole";
    }
}

std::vector<Line> lines(const LinkBudget& b, const ResolvedScene& s, const Materials& materials) {
    const RadarParams& radar = s.scene.radar;
    const ReceiverParams& receiver = s.scene.receiver;
    const WeatherParams& weather = s.scene.weather;
    const bool echo = b.cross_section_m2 > 0;
    std::vector<Line> out;
    const auto add = [&](std::string name, std::optional<double> value, const char* unit, std::string note = {}) {
        out.push_back({std::move(name), value, unit, std::move(note), false, *unit ? 3 : 4});
    };
    /// Of the ground in the cell: without any there is no mean of it.
    const auto factor = [&](std::string name, double ratio, bool on, std::string note) {
        add(std::move(name),
            !on    ? std::optional(0.0)
            : echo ? in_db(ratio)
                   : std::nullopt,
            decibel, on ? std::move(note) : "none");
    };
    add("transmitter", in_dbm(b.transmit_w), dbm_unit, watts(b.transmit_w));
    add("antenna gain", in_db(b.gain), decibel, fmt::format("both ways, {:.6g} dB each", radar.gain.db()));
    add("wavelength", in_db(b.wavelength_m2), dbsm,
        fmt::format("lambda^2 / (4 pi)^3, lambda {:.4f} m", radar.wavelength_m()));
    add("losses", in_db(b.losses), decibel, "of the system");
    add("spreading", in_db(b.spreading_m4), "dB/m4",
        fmt::format("1 / r^4, r {:.1f} m{}", b.echo_range_m, echo ? ": its mean over the ground" : ""));
    add("cross section", in_db(b.cross_section_m2), dbsm,
        !echo ? emptiness(b)
              : fmt::format("{:.6g} m2{}", b.cross_section_m2,
                            b.level_area_m2 > 0
                                ? fmt::format("; level ground would have {:.6g} m2 of surface", b.level_area_m2)
                                : std::string()));
    for (const LinkPart& part : b.parts) {
        const std::string& name = materials[part.id].name;
        const auto sigma0 = in_db(part.sigma0());
        add(part.wall ? "walls of " + name : name, in_db(part.cross_section_m2), dbsm,
            fmt::format("{} {} {:.6g} m2 {}", part.wall ? "gamma" : "sigma0",
                        sigma0 ? fmt::format("{:.2f} dB of", *sigma0) : std::string("0:"), part.area_m2,
                        part.wall ? "shown" : "of surface"));
        out.back().part = true;
    }
    factor("far shore", b.far_shore, s.scene.far_shore, "by way of the water in front");
    factor("elevation pattern", b.pattern, true,
           fmt::format("both ways, {}, tilt {:.6g} deg{}", word(radar.antenna.elevation), radar.antenna.tilt.deg(),
                       b.depression ? fmt::format("; level ground is {:.2f} deg below the axis",
                                                  b.depression->deg() - radar.antenna.tilt.deg())
                                    : std::string()));
    auto weakens = [&, left = 1.0](const std::string& name, double ratio, bool on, std::string of) mutable {
        // Of pieces that are less than a quantum of the sweep nothing is left, of some more less than there was.
        constexpr Decibel faint{-85};
        const bool was_faint = !(left > faint.ratio());
        left *= ratio;
        if (on && echo && !was_faint && !(left > faint.ratio())) of += "; fainter than the sweep is exact";
        factor(name, ratio, on, "both ways, " + of);
    };
    weakens("gases", b.gases, weather.vapour_g_m3.has_value(),
            fmt::format("vapour {:.6g} g/m3 at sea level", weather.vapour_g_m3.value_or(0)));
    weakens("rain", b.rain, weather.rain_mm_h > 0, fmt::format("{:.6g} mm/h", weather.rain_mm_h));
    weakens("cloud", b.cloud, weather.liquid_water_g_m3 > 0, fmt::format("{:.6g} g/m3", weather.liquid_water_g_m3));
    add("echo", in_dbm(b.echo_w), dbm_unit, "of the ground: transmitter to cloud, added");
    add("rain echo", in_dbm(b.rain_echo_w), dbm_unit, b.rain_echo_w > 0 ? "of the rain itself; adds in watts" : "none");
    add("power", in_dbm(b.power_w), dbm_unit, fmt::format("{:.6g} W, as in simulate --power", b.power_w));
    add("noise", in_dbm(b.noise_w), dbm_unit,
        fmt::format("k T0 B F, {:.6g} MHz, {:.6g} dB; adds in watts", radar.noise_bandwidth_hz() * 1e-6,
                    radar.noise_figure.db()));
    add("fluctuation", in_db(b.fluctuation), decibel,
        receiver.noise || receiver.speckle_looks > 0
            ? fmt::format(
                  "speckle {}, noise {}, seed {}",
                  receiver.speckle_looks > 0 ? fmt::format("of {} looks", receiver.speckle_looks) : std::string("off"),
                  receiver.noise ? "on" : "off", receiver.seed)
            : std::string("none"));
    add("received", b.blanked ? std::nullopt : std::optional(b.received_dbm), dbm_unit,
        b.blanked ? fmt::format("the receiver opens at {:.1f} m", minimum_range_m(s)) : std::string());
    add("STC", b.stc_db > 0 ? -b.stc_db : 0, decibel,
        receiver.stc_range_m ? fmt::format("at {:.1f} m", b.slant_range_m) : std::string("none"));
    add("MDS", b.mds_dbm, dbm_unit, receiver.mds_dbm ? "as given" : "the noise");
    add("above MDS", b.blanked ? std::nullopt : std::optional(b.received_dbm - b.stc_db - b.mds_dbm), decibel,
        "received and STC, less MDS");
    add("IF gain", receiver.if_gain.db() - if_gain_reference.db(), decibel,
        fmt::format("{:.6g} dB, less the {:.6g} dB that show the MDS", receiver.if_gain.db(), if_gain_reference.db()));
    add("IF stage", b.levels.if_stage, "",
        fmt::format("(above MDS + IF gain) / {:.6g} dB, 0 to 1", receiver.dynamic_range.db()));
    add("video gain", receiver.video_gain.db() - video_gain_reference.db(), decibel,
        fmt::format("{:.6g} dB, less the {:.6g} dB that leave the IF stage as it is; of amplitudes",
                    receiver.video_gain.db(), video_gain_reference.db()));
    add("video", b.levels.video, "", "IF stage with video gain, 0 to 1");
    add("grey level", b.levels.grey, "",
        receiver.display_gamma == 1 ? std::string("255 video")
                                    : fmt::format("255 video^(1/{:.6g})", receiver.display_gamma));
    out.back().decimals = 0;
    return out;
}

/// The key of a line in JSON.
std::string json_name(const std::string& name) {
    std::string out;
    for (const char c : name) out += c == ' ' ? '_' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return out;
}

std::string place_words(const std::pair<double, double>& at, bool lat_lon) {
    return lat_lon ? fmt::format("latitude {:.6f}, longitude {:.6f}", at.first, at.second)
                   : fmt::format("x {:.3f}, y {:.3f}", at.first, at.second);
}

struct Page {
    const Settings& settings;
    const ResolvedScene& scene;
    const DataBase& data_base;
    const LinkBudget& budget;

    double azimuth_deg() const { return budget.azimuth_rad * 180 / std::numbers::pi; }
    double relative_deg() const { return std::remainder(azimuth_deg() - scene.scene.platform.heading.deg(), 360); }
    std::optional<std::pair<double, double>> middle() const {
        return level_place(scene, data_base, budget.azimuth_rad, budget.range_m);
    }
};

std::string page_text(const Page& page) {
    const LinkBudget& b = page.budget;
    const PolarGrid& grid = page.scene.shown;
    const double step_deg = 360.0 / static_cast<double>(grid.circle_bins),
                 heading = page.scene.scene.platform.heading.deg();
    std::string out = fmt::format(
        "cell         azimuth {:.4f} to {:.4f} deg{}, {} {:.1f} to {:.1f} m: {}\n", page.azimuth_deg() - step_deg / 2,
        page.azimuth_deg() + step_deg / 2,
        heading == 0 ? std::string() : fmt::format(" ({:.4f} deg from the heading)", page.relative_deg()),
        page.scene.scene.display.kind == DisplayKind::gpi_true ? "ground range" : "slant range",
        b.range_m - grid.range_bin_m / 2, b.range_m + grid.range_bin_m / 2, state_names[static_cast<int>(b.state)]);
    out += fmt::format("bins         azimuth {}, range {}\n", b.azimuth_bin, b.range_bin);
    if (const auto at = page.middle())
        out += fmt::format("level place  {} (its middle on a level surface {:.1f} m above the sea)\n",
                           place_words(*at, page.data_base.has_crs), page.scene.reference_m);
    if (b.grazing)
        out += fmt::format("level ground depression {:.3f} deg at the sensor, grazing {:.3f} deg, at {:.1f} m\n",
                           b.depression->deg(), b.grazing->deg(), b.echo_range_m);
    out += "\n";
    // Parts that change nothing are named together.
    constexpr double faint_db = 40;
    std::size_t faint = 0;
    for (const Line& line : lines(b, page.scene, page.settings.scene.materials)) {
        if (line.part && line.value && *line.value < *in_db(b.cross_section_m2) - faint_db) {
            ++faint;
            continue;
        }
        if (!line.part && faint > 0) {
            out += fmt::format("  {} more, each {:.0f} dB and more below\n", faint, faint_db);
            faint = 0;
        }
        const std::string value = line.value ? fmt::format("{:.{}f}", *line.value, line.decimals) : "-";
        std::string text =
            fmt::format("{:<28}{:>10} {:<6}{}", (line.part ? "  " : "") + line.name, value, line.unit, line.note);
        text.erase(text.find_last_not_of(' ') + 1);
        out += text + "\n";
    }
    return out;
}

json page_json(const Page& page) {
    const LinkBudget& b = page.budget;
    json out{{"format", "wedgescope-budget-1"}, {"version", version()}};
    out["scene"] = parameters_json(with_resolved(page.settings, page.scene), true);
    out["scene"]["resolved"] = resolved_json(page.scene);
    json& cell = out["cell"];
    cell["azimuth_bin"] = b.azimuth_bin;
    cell["range_bin"] = b.range_bin;
    cell["azimuth_deg"] = page.azimuth_deg();
    cell["azimuth_from_heading_deg"] = page.relative_deg();
    cell["range_m"] = b.range_m;
    cell["slant_range_m"] = b.slant_range_m;
    cell["echo_range_m"] = b.echo_range_m;
    cell["level_depression_deg"] = b.depression ? json(b.depression->deg()) : json(nullptr);
    cell["level_grazing_deg"] = b.grazing ? json(b.grazing->deg()) : json(nullptr);
    cell["level_area_m2"] = b.level_area_m2 > 0 ? json(b.level_area_m2) : json(nullptr);
    cell["blanked"] = b.blanked;
    cell["state"] = state_names[static_cast<int>(b.state)];
    if (const auto at = page.middle())
        cell[page.data_base.has_crs ? "level_lat_lon" : "level_xy"] = {at->first, at->second};
    json& all = out["lines"];
    all = json::array();
    for (const Line& line : lines(b, page.scene, page.settings.scene.materials)) {
        json entry{{"name", line.part ? line.name : json_name(line.name)},
                   {"value", line.value ? json(*line.value) : json(nullptr)},
                   {"unit", line.unit}};
        if (line.part) entry["part_of"] = "cross_section";
        all.push_back(entry);
    }
    json& parts = out["parts"];
    parts = json::array();
    for (const LinkPart& part : b.parts)
        parts.push_back({{"class", page.settings.scene.materials[part.id].name},
                         {"wall", part.wall},
                         {"cross_section_m2", part.cross_section_m2},
                         {"area_m2", part.area_m2},
                         {"sigma0", part.sigma0()}});
    out["watts"] = {{"echo", b.echo_w},   {"product", b.product_w()}, {"rain_echo", b.rain_echo_w},
                    {"power", b.power_w}, {"noise", b.noise_w},       {"received", b.received_w}};
    return out;
}

struct Bins {
    std::int64_t azimuth, range;
};

/// The bins that hold the place asked for. The far edges of sector and range belong to the last bins.
Bins wanted_bins(const Settings& settings, const ResolvedScene& s, WedgeSource& source) {
    const double heading_rad = s.scene.platform.heading.rad();
    double azimuth_rad = 0, range_m = 0;
    std::string asked = "at";
    if (settings.cell) {
        azimuth_rad = heading_rad + settings.cell->azimuth.rad();
        range_m = settings.cell->range_m;
    } else {
        const LatLon& at = *settings.cell_place;
        const DataBase& db = source.data_base();
        asked = settings.cell_place_key;
        if (!db.has_crs)
            throw InputError(
                text(asked, " needs a raster with a CRS; ", in_quotes(db.name), " has none (give at AZIMUTH,RANGE)"));
        const CellPlace place = cell_place(s, source, db.locate(at.lat_deg, at.lon_deg));
        azimuth_rad = place.azimuth_rad;
        range_m = place.range_m;
    }
    constexpr double whole = 1e-9;  // of a bin
    const PolarGrid& grid = s.shown;
    const double range_bins = range_m / grid.range_bin_m;
    auto range = static_cast<std::int64_t>(std::floor(range_bins + whole));
    if (range == grid.range_bins.end && range_bins <= static_cast<double>(range) + whole) --range;
    if (!grid.range_bins.contains(range))
        throw InputError(fmt::format("{} asks for a range of {:.1f} m; the scene's is {:.1f} to {:.1f} m", asked,
                                     range_m, static_cast<double>(grid.range_bins.begin) * grid.range_bin_m,
                                     static_cast<double>(grid.range_bins.end) * grid.range_bin_m));
    const double azimuth_bins = azimuth_rad / grid.azimuth_step_rad();
    const auto bin = static_cast<std::int64_t>(std::floor(azimuth_bins + whole));
    const bool on_edge = azimuth_bins <= static_cast<double>(bin) + whole;
    for (const std::int64_t i : {bin, on_edge ? bin - 1 : bin})
        if (grid.row_of(i) < grid.azimuth_count()) return {bins_after(i, 0, grid.circle_bins), range};
    throw InputError(
        fmt::format("{} asks for azimuth {:.4f} deg from the heading; the scene's sector is {:.4f} to {:.4f} deg",
                    asked, std::remainder((azimuth_rad - heading_rad) * 180 / std::numbers::pi, 360),
                    s.scene.sector->from.deg(), s.scene.sector->to.deg()));
}

}  // namespace

void link_budget(const std::vector<std::string>& arguments, Stop& stop) {
    Settings settings = parse_arguments(command_budget, arguments);
    if (settings.help) return print(help_text(command_by_name("budget")));
    if (!settings.cell && !settings.cell_place)
        throw InputError("which cell is not said; at AZIMUTH,RANGE or at-latlon LAT,LON is needed");
    if (settings.cell && settings.cell_place)
        throw InputError(text("at and ", settings.cell_place_key, " are both given; exactly one of them is needed"));
    if (!settings.track.empty())
        throw InputError("track is given; budget looks from one place (give latlon or xy, and an altitude)");
    // Of a scene file that simulate takes.
    for (auto file : {&Settings::echo, &Settings::power, &Settings::states, &Settings::ground_file})
        (settings.*file).clear();
    settings.work_dir.clear();
    settings.resume = false;
    settings.only_wedges.reset();
    check_complete(settings);
    check_temp_dir(settings);
    const GdalSession session(cache_bytes(settings), settings.config);
    settings.expects_ground = expects_ground(settings, {.levels = true}, stop);
    // Where the scene's range is given the cell is known before anything but the ground below the sensor is read, and its azimuth
    // alone is looked at.
    std::optional<Bins> known;
    std::optional<Arc> arc;
    if (settings.scene.range_m) {
        const auto direct = open_direct_source(data_base_params(settings, cache_bytes(settings), stop));
        check_reader(*direct, memory_bytes(settings));
        ResolvedScene scene = resolve(settings.scene, *direct);
        known = wanted_bins(settings, scene, *direct);
        look_at(scene, {known->azimuth, known->azimuth + 1});
        const double step_rad = scene.swept.azimuth_step_rad();
        arc = Arc{static_cast<double>(scene.swept.azimuth_bins.begin) * step_rad,
                  static_cast<double>(scene.swept.azimuth_bins.size()) * step_rad};
        check_scene(settings, scene, stop);
    } else {
        check_simulation(settings, stop);
    }
    const std::string unfit_map = find_ground(settings, {.levels = true}, stop);
    const DataBaseParams layers = data_base_params(settings, cache_bytes(settings), stop);
    SpillOptions options = spill_options(settings);
    options.stop = &stop;
    options.only = arc;
    Progress sorting(settings.quiet);
    const SourceChoice choice = choose_source(layers, settings.source, settings.scene, options.memory_bytes);
    const bool pass = choice.spilled && !choice.kept;
    if (pass) options.progress = [&](double fraction) { sorting.report(fraction); };
    const std::unique_ptr<WedgeSource> source = open_source(choice, layers, settings.scene, options);
    if (pass) sorting.done();
    const ResolvedScene scene = resolve(settings.scene, *source);
    EngineParams params = engine_params(settings);
    params.stop = &stop;
    params.data = source->fingerprint({});
    const Bins bins = known ? *known : wanted_bins(settings, scene, *source);
    const LinkBudget budget = link_budget(scene, *source, params, bins.azimuth, bins.range);
    const Page page{settings, scene, source->data_base(), budget};
    print(settings.json ? page_json(page).dump(2, ' ', false, json::error_handler_t::replace) + "\n" : page_text(page));
    for (const std::string& unfit : {choice.unfit, unfit_map}) remark_unused(settings.quiet, unfit);
}

}  // namespace wedgescope
