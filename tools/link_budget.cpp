// budget: the link budget of one cell, a line for each number from the transmitter to the grey level.
// Leaves how the numbers are found to lib/link_budget.hpp.
#include "lib/link_budget.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tiles/gdal_session.hpp"
#include "tools/budget.hpp"
#include "tools/commands.hpp"
#include "tools/ground.hpp"
#include "tools/help.hpp"
#include "tools/options.hpp"
#include "tools/report_json.hpp"
#include "tools/scene_json.hpp"
#include "tools/terminal.hpp"
#include "tools/units.hpp"

namespace wedgescope {
namespace {

using json = nlohmann::ordered_json;

struct Line {
    std::string name;
    std::optional<double> value;  ///< none: there is nothing to tell, as dBm of no power
    const char* unit;
    std::string note;
    bool part = false;  ///< of the line above
};

constexpr const char *decibel = "dB", *dbm = "dBm", *dbsm = "dBm2";

std::optional<double> in_db(double ratio) {
    if (!(ratio > 0)) return std::nullopt;
    const double db = 10 * std::log10(ratio);
    return db == 0 ? 0 : db;  // no -0
}
std::optional<double> in_dbm(double watts) { return in_db(watts * 1e3); }

std::string watts(double w) {
    return w >= 1e3 ? fmt::format("{:.6g} kW", w / 1e3)
           : w >= 1 ? fmt::format("{:.6g} W", w)
                    : fmt::format("{:.4g} W", w);
}

std::vector<Line> lines(const LinkBudget& b, const ResolvedScene& s, const Materials& materials) {
    const RadarParams& radar = s.scene.radar;
    const ReceiverParams& receiver = s.scene.receiver;
    const WeatherParams& weather = s.scene.weather;
    const bool echo = b.echo_w > 0;
    std::vector<Line> out;
    const auto add = [&](std::string name, std::optional<double> value, const char* unit, std::string note = {}) {
        out.push_back({std::move(name), value, unit, std::move(note)});
    };
    /// Of the ground in the cell: without any there is no mean of it.
    const auto factor = [&](std::string name, double ratio, bool on, std::string note) {
        add(std::move(name),
            !on    ? std::optional(0.0)
            : echo ? in_db(ratio)
                   : std::nullopt,
            decibel, on ? std::move(note) : "none");
    };
    add("transmitter", in_dbm(b.transmit_w), dbm, watts(b.transmit_w));
    add("antenna gain", in_db(b.gain), decibel, fmt::format("both ways, {:.6g} dB each", radar.gain.db()));
    add("wavelength", in_db(b.wavelength_m2), dbsm,
        fmt::format("lambda^2 / (4 pi)^3, lambda {:.4f} m", radar.wavelength_m()));
    add("losses", in_db(b.losses), decibel, "of the system");
    add("spreading", in_db(b.spreading_m4), "dB/m4", fmt::format("1 / r^4, r {:.1f} m", b.echo_range_m));
    add("cross section", in_db(b.cross_section_m2), dbsm,
        !echo ? std::string("nothing is seen in the pulse and the beam")
              : fmt::format("{:.6g} m2{}", b.cross_section_m2,
                            b.level_area_m2 > 0
                                ? fmt::format("; level ground has {:.6g} m2 in pulse and beam", b.level_area_m2)
                                : std::string()));
    for (const LinkPart& part : b.parts) {
        const std::string& name = materials[part.id].name;
        add(part.wall ? "walls of " + name : name, in_db(part.cross_section_m2), dbsm,
            fmt::format("{} {:.2f} dB of {:.6g} m2 {}", part.wall ? "gamma" : "sigma0",
                        in_db(part.sigma0()).value_or(-999), part.area_m2, part.wall ? "shown" : "surface"));
        out.back().part = true;
    }
    factor("elevation pattern", b.pattern, true,
           fmt::format("both ways, {}, tilt {:.6g} deg", word(radar.antenna.elevation), radar.antenna.tilt.deg()));
    factor("gases", b.gases, weather.vapour_g_m3.has_value(),
           fmt::format("both ways, vapour {:.6g} g/m3 at sea level", weather.vapour_g_m3.value_or(0)));
    factor("rain", b.rain, weather.rain_mm_h > 0, fmt::format("both ways, {:.6g} mm/h", weather.rain_mm_h));
    factor("cloud", b.cloud, weather.liquid_water_g_m3 > 0,
           fmt::format("both ways, {:.6g} g/m3", weather.liquid_water_g_m3));
    add("echo", in_dbm(b.echo_w), dbm, "of the ground: the sum of the lines above");
    add("rain echo", in_dbm(b.rain_echo_w), dbm, b.rain_echo_w > 0 ? "of the rain itself; adds in watts" : "none");
    add("power", in_dbm(b.power_w), dbm, fmt::format("{:.6g} W, as in simulate --power", b.power_w));
    add("noise", in_dbm(b.noise_w), dbm,
        fmt::format("k T0 B F, {:.6g} MHz, {:.6g} dB; adds in watts", radar.noise_bandwidth_hz() * 1e-6,
                    radar.noise_figure.db()));
    add("fluctuation", in_db(b.fluctuation), decibel,
        receiver.noise || receiver.speckle_looks > 0
            ? fmt::format(
                  "speckle {}, noise {}, seed {}",
                  receiver.speckle_looks > 0 ? fmt::format("of {} looks", receiver.speckle_looks) : std::string("off"),
                  receiver.noise ? "on" : "off", receiver.seed)
            : std::string("none"));
    add("received", b.blanked ? std::nullopt : std::optional(b.received_dbm), dbm,
        b.blanked ? "nearer than minimum-range: the receiver is blanked" : "");
    add("STC", b.stc_db > 0 ? -b.stc_db : 0, decibel,
        receiver.stc_range_m ? fmt::format("at {:.1f} m", b.slant_range_m) : std::string("none"));
    add("MDS", b.mds_dbm, dbm, receiver.mds_dbm ? "as given" : "the noise");
    add("above MDS", b.blanked ? std::nullopt : std::optional(b.received_dbm - b.stc_db - b.mds_dbm), decibel,
        "received and STC, less MDS");
    add("IF gain", receiver.if_gain.db(), decibel, "64 dB show the MDS");
    add("IF stage", b.levels.if_stage, "",
        fmt::format("(above MDS + IF gain - 64 dB) / {:.6g} dB, 0 to 1", receiver.dynamic_range.db()));
    add("video gain", receiver.video_gain.db(), decibel, "4 dB leave the IF stage as it is");
    add("video", b.levels.video, "", "0 to 1");
    add("grey level", b.levels.grey, "",
        receiver.display_gamma == 1 ? std::string("255 video")
                                    : fmt::format("255 video^(1/{:.6g})", receiver.display_gamma));
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
    double relative_deg() const {
        const double turn = azimuth_deg() - scene.scene.platform.heading.deg();
        return turn - 360 * std::floor(turn / 360);
    }
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
    out += "\n";
    for (const Line& line : lines(b, page.scene, page.settings.scene.materials)) {
        const int digits = *line.unit ? 3 : line.name == "grey level" ? 0 : 4;
        const std::string value = line.value ? fmt::format("{:.{}f}", *line.value, digits) : "-";
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

/// The bins that hold the place asked for.
std::pair<std::int64_t, std::int64_t> wanted_bins(const Settings& settings, const ResolvedScene& s,
                                                  WedgeSource& source) {
    double azimuth_rad = 0, range_m = 0;
    std::string asked;
    if (settings.cell) {
        azimuth_rad = s.scene.platform.heading.rad() + settings.cell->azimuth.rad();
        range_m = settings.cell->range_m;
        asked = "at";
    } else {
        const LatLon& at = *settings.cell_place;
        const DataBase& db = source.data_base();
        if (!db.has_crs)
            throw InputError(text(settings.cell_place_key, " needs a raster with a CRS; ", in_quotes(db.name),
                                  " has none (give at AZIMUTH,RANGE)"));
        const CellPlace place = cell_place(s, source, db.locate(at.lat_deg, at.lon_deg));
        azimuth_rad = place.azimuth_rad, range_m = place.range_m;
        asked = settings.cell_place_key;
    }
    const PolarGrid& grid = s.shown;
    const double turns = azimuth_rad / (2 * std::numbers::pi), circle = static_cast<double>(grid.circle_bins);
    const auto azimuth_bin = std::min(static_cast<std::int64_t>((turns - std::floor(turns)) * circle + 1e-9),
                                      grid.circle_bins - 1),
               range_bin = static_cast<std::int64_t>(std::floor(range_m / grid.range_bin_m + 1e-9));
    const std::int64_t after =
        ((azimuth_bin - grid.azimuth_bins.begin) % grid.circle_bins + grid.circle_bins) % grid.circle_bins;
    if (after >= grid.azimuth_bins.size())
        throw InputError(
            fmt::format("{} is in azimuth {:.4f} deg from the heading; the scene's sector is {:.4f} to {:.4f} deg",
                        asked, 360 * (turns - std::floor(turns)) - s.scene.platform.heading.deg(),
                        s.scene.sector->from.deg(), s.scene.sector->to.deg()));
    if (range_bin < grid.range_bins.begin || range_bin >= grid.range_bins.end)
        throw InputError(fmt::format("{} is at a range of {:.1f} m; the scene's is {:.1f} to {:.1f} m", asked, range_m,
                                     static_cast<double>(grid.range_bins.begin) * grid.range_bin_m,
                                     static_cast<double>(grid.range_bins.end) * grid.range_bin_m));
    return {azimuth_bin, range_bin};
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
    settings.work_dir.clear(), settings.resume = false,
                               settings.only_wedges.reset();  // of a scene file that simulate takes
    check_complete(settings);
    const GdalSession session(cache_bytes(settings), settings.config);
    settings.expects_ground = expects_ground(settings, {.levels = true}, stop);
    check_simulation(settings, stop);
    find_ground(settings, {.levels = true}, stop);
    const DataBaseParams layers = data_base_params(settings, cache_bytes(settings), stop);
    SpillOptions options = spill_options(settings);
    options.stop = &stop;
    const SourceChoice choice = choose_source(layers, settings.source, settings.scene, options.memory_bytes);
    const std::unique_ptr<WedgeSource> source = open_source(choice, layers, settings.scene, options);
    const ResolvedScene scene = resolve(settings.scene, *source);
    EngineParams params = engine_params(settings);
    params.stop = &stop;
    params.data = source->fingerprint({});
    const auto [azimuth_bin, range_bin] = wanted_bins(settings, scene, *source);
    const LinkBudget budget = link_budget(scene, *source, params, azimuth_bin, range_bin);
    const Page page{settings, scene, source->data_base(), budget};
    print(settings.json ? page_json(page).dump(2, ' ', false, json::error_handler_t::replace) + "\n" : page_text(page));
}

}  // namespace wedgescope
