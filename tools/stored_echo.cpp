#include "tools/stored_echo.hpp"

#include <charconv>
#include <cmath>
#include <limits>

#include "lib/detail.hpp"
#include "lib/wedge_archive.hpp"
#include "tiles/json_text.hpp"
#include "tools/options.hpp"
#include "tools/scene_json.hpp"
#include "tools/units.hpp"

namespace wedgescope {
namespace {

using json = nlohmann::ordered_json;

/// A JSON object whose members must be there.
class Member {
public:
    Member(const std::string& path, const json& object, std::string name)
        : path_(path), object_(object), name_(std::move(name)) {
        if (!object.is_object()) refuse("", "an object");
    }
    Member object(const char* key) const { return {path_, at(key), name_ + key + "."}; }
    const json& at(const char* key) const {
        const auto found = object_.find(key);
        if (found == object_.end()) refuse(key, "there");
        return *found;
    }
    double number(const char* key) const {
        const json& value = at(key);
        if (!value.is_number() || !std::isfinite(value.get<double>())) refuse(key, "a number");
        return value.get<double>();
    }
    double within(const char* key, double low, double high) const {
        const double value = number(key);
        if (!(value >= low && value <= high)) refuse(key, text("from ", low, " to ", high).c_str());
        return value;
    }
    std::int64_t whole(const char* key) const {
        const json& value = at(key);
        if (!value.is_number_integer()) refuse(key, "a whole number");
        return value.get<std::int64_t>();
    }
    bool flag(const char* key) const {
        const json& value = at(key);
        if (!value.is_boolean()) refuse(key, "true or false");
        return value.get<bool>();
    }
    std::string words(const char* key) const {
        const json& value = at(key);
        if (!value.is_string()) refuse(key, "a text");
        return value.get<std::string>();
    }
    bool has(const char* key) const { return object_.contains(key); }
    const json& all() const { return object_; }
    [[noreturn]] void refuse(const char* key, const char* what) const {
        std::string name = name_ + key;
        if (name.ends_with('.')) name.pop_back();  // itself
        throw DataError(text("echo image ", in_quotes(path_), " is damaged, or was changed: ", name,
                             " of its SCENE_JSON is not ", what));
    }

private:
    const std::string& path_;
    const json& object_;
    std::string name_;
};

/// None in an image without rain.
std::vector<std::vector<RainFloor>> rain_floor_in(const Member& resolved) {
    constexpr const char* name = "rain_floor_m";
    std::vector<std::vector<RainFloor>> floors;
    if (!resolved.has(name)) return floors;
    const json& rays = resolved.at(name);
    if (!rays.is_array()) resolved.refuse(name, "a list");
    for (const json& knots : rays) {
        if (!knots.is_array()) resolved.refuse(name, "a list of lists");
        std::vector<RainFloor>& floor = floors.emplace_back();
        for (const json& knot : knots) {
            const bool good = knot.is_array() && knot.size() == 2 && knot[0].is_number() && knot[1].is_number() &&
                              (floor.empty() || knot[0].get<double>() > floor.back().range_m);
            if (!good) resolved.refuse(name, "a list of lists of ascending ranges with heights");
            floor.push_back({knot[0].get<double>(), knot[1].get<double>()});
        }
    }
    return floors;
}

PolarGrid grid_in(const Member& resolved, const char* name) {
    const Member grid = resolved.object(name);
    PolarGrid out;
    out.circle_bins = resolved.whole("circle_bins");
    out.range_bin_m = resolved.number("range_bin_m");
    out.azimuth_bins = {grid.whole("azimuth_bin_begin"), grid.whole("azimuth_bin_end")};
    out.range_bins = {grid.whole("range_bin_begin"), grid.whole("range_bin_end")};
    return out;
}

double number_or_infinite(const Member& from, const char* key) {
    return from.at(key).is_null() ? std::numeric_limits<double>::infinity() : from.number(key);
}

std::uint64_t hex_number(const Member& from, const char* key) {
    const std::string digits = from.words(key);
    std::uint64_t sum = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), sum, 16);
    if (error != std::errc{} || end != digits.data() + digits.size()) from.refuse(key, "a checksum");
    return sum;
}

/// `named`: what its errors begin with.
void check_maker(const std::string& named, const Member& top) {
    const std::string found = top.has("format") && top.at("format").is_string() ? top.words("format") : "";
    if (found != "wedgescope-scene-1")
        throw DataError(
            text(named, ": the format of its SCENE_JSON is ", in_quotes(found), "; wedgescope-scene-1 is needed"));
    const std::string made_by = top.words("version");
    if (made_by != version() || !top.has("echo") || top.object("echo").whole("revision") != echo_revision)
        throw DataError(text(named, " was written by ",
                             made_by == version() ? "another build of wedgescope " : "wedgescope ", in_quotes(made_by),
                             ", and this is ", version(), ", whose echo may differ; simulate again"));
}

/// What `ask` makes of what the image says; where that is `Wrong`, so is the image.
template <class Wrong, class Ask>
auto of_image(const std::string& named, const Ask& ask) {
    try {
        return ask();
    } catch (const Wrong& e) {
        throw DataError(text(named, " is damaged, or was changed: ", e.what()));
    }
}

bool shapes_echo(const Key& key) {
    return (key.commands & command_simulate) && key.in_scene_file && key.changes_result;
}

/// What the image was made with: every parameter of an echo, and nothing that says what to write or how to run.
std::vector<Given> parameters_in(const std::string& named, const Member& parameters) {
    for (const Key& key : key_table())
        if (shapes_echo(key) && !parameters.has(key.name.c_str())) parameters.refuse(key.name.c_str(), "there");
    std::vector<Given> all = of_image<DataError>(named, [&] { return given_in_json(parameters.all()); });
    for (const Given& given : all)
        if (!shapes_echo(*find_key(given.key))) parameters.refuse(given.key.c_str(), "a parameter of an echo image");
    return all;
}

Settings settings_in(const std::vector<Given>& given, const Member& data_base) {
    Settings settings = settings_from({}, given);
    for (const auto& [name, value] : data_base.all().items()) {
        const Key* key = find_key(name);
        if (key && key->group == KeyGroup::data_base && !takes_path(*key))
            key->set(settings, {name, data_base.words(name.c_str()), name, ""});
    }
    return settings;
}

/// Where the sensor was, and what the terrain had to say.
ResolvedScene place_in(const Member& resolved, const Member& echo) {
    ResolvedScene place;
    place.geometry = resolved.words("geometry") == "grid" ? Geometry::grid : Geometry::geodesic;
    place.has_lat_lon = resolved.has("lat_deg");
    if (place.has_lat_lon) {
        place.lat_deg = resolved.within("lat_deg", -90, 90);
        place.lon_deg = resolved.within("lon_deg", -720, 720);
    }
    place.x = resolved.number("x");
    place.y = resolved.number("y");
    constexpr double most_posts = 1e9, deepest_m = -1e5, most_ground_m = 1e5, most_m = 1e8;
    place.nadir = {resolved.within("column", -most_posts, most_posts), resolved.within("row", -most_posts, most_posts)};
    place.nadir_in_raster = resolved.flag("nadir_in_raster");
    place.nadir_on_data = resolved.flag("nadir_on_data");
    place.sensor_m = resolved.within("sensor_height_m", deepest_m, most_m);
    place.reference_m = resolved.within("reference_height_m", deepest_m, most_ground_m);
    place.longer_post_m = echo.number("longer_post_m");
    place.clearance_m = number_or_infinite(echo, "clearance_m");
    place.rain_floor = rain_floor_in(resolved);
    place.earth = Earth::of_curvature(resolved.number("earth_inverse_radius_per_m"));
    place.scene.range_m = resolved.within("range_m", 0, most_m);
    return place;
}

}  // namespace

StoredEcho stored_echo(const std::string& path, const std::string& scene_json, std::int64_t columns,
                       std::int64_t rows) {
    const std::string named = text("echo image ", in_quotes(path));
    const json all = parsed_json<json>(scene_json);
    if (all.is_discarded() || !all.is_object())
        throw DataError(text(named, " is damaged, or was changed: its SCENE_JSON is no JSON object"));
    const Member top(path, all, "");
    check_maker(named, top);

    StoredEcho out;
    out.path = path;
    const Member resolved = top.object("resolved"), echo = top.object("echo");
    const Member data_base = echo.object("data_base");
    out.data_base = data_base.all();
    out.given = parameters_in(named, top.object("parameters"));
    out.settings = of_image<InputError>(named, [&] { return settings_in(out.given, data_base); });
    out.checksum = hex_number(echo, "checksum");
    out.said = without_checksum(all);
    out.levels = echo.flag("levels");
    out.post_m = number_or_infinite(echo, "detail_post_m");
    out.crs_wkt = echo.words("crs_wkt");
    out.metres_per_unit = echo.number("metres_per_unit");

    const ResolvedScene place = place_in(resolved, echo);
    const PolarGrid swept = grid_in(resolved, "swept");
    if (swept.range_bins.size() != columns || swept.azimuth_bins.size() != rows)
        throw DataError(text(named, " has ", columns, " x ", rows, " cells; its SCENE_JSON says ",
                             swept.range_bins.size(), " x ", swept.azimuth_bins.size(),
                             " (simulate --echo writes whole images; a part of one will not do)"));
    out.scene = of_image<InputError>(named, [&] { return resolve(out.settings.scene, place); });
    if (!holds(swept, out.scene.swept) || out.scene.shown != grid_in(resolved, "shown"))
        throw DataError(
            text(named, " is damaged, or was changed: the bins of its SCENE_JSON are not those of its parameters"));
    out.scene.swept = swept;  // it may hold more
    return out;
}

namespace {

constexpr const char* sweep_needed = ": that needs a new sweep (simulate)";

/// What the user calls a key, if it was given.
std::string origin_of(const std::vector<Given>& given, const char* key) {
    for (const Given& g : given)
        if (g.key == key) return g.origin;
    return key;
}

/// Cut where it is long: an antenna's points may be thousands.
/// `other`: the value that it is told apart from; of a long one what differs shows.
std::string value_words(const std::optional<std::string>& value, const std::optional<std::string>& other = {}) {
    constexpr std::size_t most = 60, before = 20;
    if (!value) return "not given";
    if (value->size() <= most) return *value;
    std::size_t from = 0;
    if (other)
        while (from < std::min(value->size(), other->size()) && (*value)[from] == (*other)[from]) ++from;
    from = from > most - before ? from - before : 0;
    const bool all = from + most >= value->size();
    return text(from > 0 ? "..." : "", value->substr(from, most), all ? "" : "...");
}

/// Keys that were given but are none of scope's: as they were, or harmless in a scene file, or refused.
void check_given(const StoredEcho& echo, const std::vector<Given>& given, const Settings& settings) {
    for (const Given& g : given) {
        const Key& key = *find_key(g.key);
        if (key.commands & command_scope) continue;
        const bool in_file = !g.folder.empty();
        const std::optional<std::string> now = key.get(settings);
        if (key.group == KeyGroup::data_base) {
            if (takes_path(key)) {
                if (in_file) continue;  // of a scene file that simulate takes
                throw InputError(
                    text(g.origin, " is ", in_quotes(value_words(now)), "; ", key.needs_sweep, sweep_needed));
            }
            const std::optional<std::string> before = key.get(echo.settings);
            if (now == before) continue;
            throw InputError(text(g.origin, " is ", in_quotes(value_words(now, before)), "; the echo image was made with ",
                                  in_quotes(value_words(before, now)), ", and ", key.needs_sweep, sweep_needed));
        }
        if (!key.changes_result) {
            // Of a scene file that simulate takes: how it sweeps, and what else it writes.
            if (in_file) continue;
            throw InputError(text(g.origin,
                                  key.commands == command_simulate ? " is simulate's alone" : " is not for scope",
                                  "; scope sweeps nothing, and makes one picture of ", in_quotes(echo.path)));
        }
        const std::optional<std::string> before = key.get(echo.settings);
        if (now == before) continue;
        // What was left open then, given as it came out.
        if (key.name == "range" && settings.scene.range_m && *settings.scene.range_m == *echo.scene.scene.range_m)
            continue;
        if (key.name == "geometry" && settings.scene.geometry && *settings.scene.geometry == echo.scene.geometry)
            continue;
        throw InputError(text(g.origin, " is ", value_words(now, before), "; the echo image was swept with ",
                              before ? value_words(before, now) : "no " + key.name, ", and ",
                              key.needs_sweep.empty() ? "it changes what the ground returns" : key.needs_sweep,
                              sweep_needed));
    }
}

std::string bins_words(Interval bins) { return text(bins.begin, " to ", bins.end - 1); }

/// The cells that a scene asks for against those that an echo image holds: a line for the first key that they differ by.
class CellsCheck {
public:
    CellsCheck(const StoredEcho& echo, const std::vector<Given>& given, const Settings& settings,
               const ResolvedScene& scene)
        : echo_(echo), given_(given), settings_(settings), scene_(scene), radar_(scene.scene.radar),
          before_(echo.scene.scene.radar) {}

    /// InputError.
    void run() const {
        check_display();
        check_sizes();
        check_extent();
        check_levels();
    }

private:
    std::string name(const char* key) const { return origin_of(given_, key); }
    std::string value(const char* key) const { return value_words(find_key(key)->get(settings_)); }

    void check_display() const {
        const DisplayKind kind = scene_.scene.display.kind, old_kind = echo_.scene.scene.display.kind;
        if ((kind == DisplayKind::gpi_true) != (old_kind == DisplayKind::gpi_true))
            throw InputError(
                text(name("display"), " is ", word(kind), "; the echo image was swept for ", word(old_kind),
                     ", and gpi-true bins echoes by ground range, the others by slant range", sweep_needed));
    }

    void check_sizes() const {
        const PolarGrid &stored = echo_.scene.swept, &wanted = scene_.swept;
        if (wanted.circle_bins != stored.circle_bins) {
            const bool open = !settings_.scene.azimuth_bins;
            throw InputError(
                text(open ? text(name("beam"), " is ", value("beam"), " and azimuth-bins auto, which makes ")
                          : text(name("azimuth-bins"), " is "),
                     wanted.circle_bins, open ? " azimuth bins" : "", "; the echo image has ", stored.circle_bins,
                     open ? text(" (azimuth-bins ", stored.circle_bins, " keeps them)") : "", sweep_needed));
        }
        if (wanted.range_bin_m != stored.range_bin_m) {
            const bool open = !settings_.scene.range_bin_m;
            const auto length = [](double m) { return quantity_text(Dimension::length, m); };
            throw InputError(text(
                open ? text(name("pulse"), " is ", value("pulse"), " and range-bin auto, which makes range bins of ")
                     : text(name("range-bin"), " is "),
                length(wanted.range_bin_m), "; the echo image has ", open ? "" : "bins of ", length(stored.range_bin_m),
                open ? text(" (range-bin ", length(stored.range_bin_m), " keeps them)") : "", sweep_needed));
        }
    }

    void check_extent() const {
        const PolarGrid &stored = echo_.scene.swept, &wanted = scene_.swept;
        const bool turned = settings_.scene.platform.heading != echo_.settings.scene.platform.heading;
        const std::string azimuths = name("sector") == "sector" && turned ? name("heading") : name("sector");
        if (!holds(stored, scene_.shown))
            throw InputError(text(azimuths, " asks for azimuth bins ", bins_words(scene_.shown.azimuth_bins),
                                  "; the echo image holds ", bins_words(stored.azimuth_bins), " of ",
                                  stored.circle_bins, sweep_needed));
        if (wanted.range_bins.begin < stored.range_bins.begin)
            throw InputError(text(name(key_of_pulse("ple-scale")), " makes the sweep begin at range bin ",
                                  wanted.range_bins.begin, " before range-start; the echo image begins at ",
                                  stored.range_bins.begin, sweep_needed));
        if (!holds(stored, wanted)) {
            const char* key = radar_.antenna.azimuth != before_.antenna.azimuth &&
                                      radar_.antenna.beam.rad() == before_.antenna.beam.rad()
                                  ? "azimuth-pattern"
                                  : key_of_beam("");
            throw InputError(text(*key ? name(key) : azimuths, " makes the beam gather azimuth bins ",
                                  bins_words(wanted.azimuth_bins), "; the echo image holds ",
                                  bins_words(stored.azimuth_bins), " of ", stored.circle_bins, sweep_needed));
        }
    }

    void check_levels() const {
        if (same_levels(echo_.scene, echo_.levels, echo_.post_m, scene_)) return;
        const char* const of_pulse = key_of_pulse(nullptr);
        const char* const key = of_pulse ? of_pulse : key_of_beam("bwe-scale");  // a narrower beam alone may be taken
        throw InputError(text(
            name(key), " is ", value(key),
            "; the ground of this echo image is finer than beam and pulse, whose size decides which posts are swept"
            " (simulate --detail off makes an echo image that takes it)",
            sweep_needed));
    }

    /// Which of the keys that make the pulse longer is another; `none`: none is.
    const char* key_of_pulse(const char* none) const {
        return radar_.pulse_s != before_.pulse_s                         ? "pulse"
               : radar_.pulse_length_error != before_.pulse_length_error ? "ple"
               : radar_.pulse_length_scale != before_.pulse_length_scale ? "ple-scale"
                                                                         : none;
    }
    /// Of those that make the beam wider.
    const char* key_of_beam(const char* none) const {
        return radar_.antenna.beam.rad() != before_.antenna.beam.rad() ? "beam"
               : radar_.beam_width_error != before_.beam_width_error   ? "bwe"
               : radar_.beam_width_scale != before_.beam_width_scale   ? "bwe-scale"
                                                                       : none;
    }

    const StoredEcho& echo_;
    const std::vector<Given>& given_;
    const Settings& settings_;
    const ResolvedScene& scene_;
    const RadarParams &radar_, &before_;
};

}  // namespace

ResolvedScene scene_from_echo(const StoredEcho& echo, const std::vector<Given>& given, const Settings& asked) {
    Settings settings = asked;
    // As its metadata have it, in fifteen digits.
    constexpr double rounding = 1e-12;
    if (std::optional<double>& bin_m = settings.scene.range_bin_m;
        bin_m && std::abs(*bin_m - echo.scene.swept.range_bin_m) <= rounding * echo.scene.swept.range_bin_m)
        bin_m = echo.scene.swept.range_bin_m;
    if (echo.settings.scan_step)
        throw InputError(text("echo image ", in_quotes(echo.path),
                              " is a scan's (scan-step), whose azimuths were seen from several places", sweep_needed));
    check_given(echo, given, settings);
    const ResolvedScene scene = resolve(settings.scene, echo.scene);
    CellsCheck(echo, given, settings, scene).run();
    return scene;
}

}  // namespace wedgescope
