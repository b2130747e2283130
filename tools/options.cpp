#include "tools/options.hpp"

#include <algorithm>
#include <boost/program_options.hpp>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>
#include <sstream>

#include "lib/receiver.hpp"
#include "tools/units.hpp"

namespace po = boost::program_options;

namespace wedgescope {
namespace {

// ------------------------------------------------------------------------------------------- what a value may be

/// Bounds of a value, written as users write them; empty: none.
struct Limits {
    std::string low;
    bool above = false;  ///< `low` itself is refused
    std::string high;
    bool below = false;  ///< `high` itself is refused
};
Limits above(std::string low) { return {std::move(low), true, "", false}; }
Limits at_least(std::string low) { return {std::move(low), false, "", false}; }
Limits between(std::string low, std::string high) { return {std::move(low), false, std::move(high), false}; }
Limits above_below(std::string low, std::string high) { return {std::move(low), true, std::move(high), true}; }
Limits any() { return {}; }

std::string words(const Limits& limits) {
    if (limits.low.empty()) return "";
    std::string out = (limits.above ? "above " : limits.high.empty() ? "at least " : "from ") + limits.low;
    if (!limits.high.empty()) out += (limits.below ? " and below " : limits.above ? " up to " : " to ") + limits.high;
    return out;
}

template <class Parse>
void check_limits(const Limits& limits, const Given& given, double value, Parse&& parse) {
    bool good = true;
    if (!limits.low.empty()) {
        const double low = parse(limits.low);
        good = limits.above ? value > low : value >= low;
    }
    if (!limits.high.empty()) {
        const double high = parse(limits.high);
        good = good && (limits.below ? value < high : value <= high);
    }
    if (!good) throw InputError(text(given.origin, " is ", in_quotes(given.value), "; it must be ", words(limits)));
}

/// How one kind of value is named, read and written.
struct Codec {
    std::string value;
    std::string accepted;
    std::function<void(Settings&, const Given&)> set;
    std::function<std::optional<std::string>(const Settings&)> get;
};

// What stands in Settings for a number in SI units.
void store(double& field, double v) { field = v; }
void store(std::optional<double>& field, double v) { field = v; }
void store(Angle& field, double v) { field = Angle::radians(v); }
void store(Decibel& field, double v) { field = Decibel(v); }
void store(std::optional<Decibel>& field, double v) { field = Decibel(v); }
void store(std::uint64_t& field, double v) { field = static_cast<std::uint64_t>(v); }
void store(std::int64_t& field, std::int64_t v) { field = v; }
void store(std::optional<std::int64_t>& field, std::int64_t v) { field = v; }
void store(int& field, std::int64_t v) { field = static_cast<int>(v); }
std::optional<double> load(double field) { return field; }
std::optional<double> load(const std::optional<double>& field) { return field; }
std::optional<double> load(Angle field) { return field.rad(); }
std::optional<double> load(Decibel field) { return field.db(); }
std::optional<double> load(const std::optional<Decibel>& field) { return field ? std::optional(field->db()) : std::nullopt; }
std::optional<double> load(std::uint64_t field) { return static_cast<double>(field); }

/// A dimensioned value; `absent` is the word for an empty optional (auto, off).
template <class Field>
Codec quantity(Dimension dimension, const Limits& limits, Field field, const std::string& absent = "") {
    Codec codec;
    codec.value = value_word(dimension) + (absent.empty() ? "" : "|" + absent);
    codec.accepted = words(limits);
    codec.set = [=](Settings& s, const Given& given) {
        auto& target = field(s);
        if constexpr (requires { target.reset(); }) {
            if (!absent.empty() && trimmed(given.value) == absent) return target.reset();
        }
        const double v = parse_quantity(dimension, given.origin, given.value);
        check_limits(limits, given, v, [&](const std::string& t) { return parse_quantity(dimension, given.origin, t); });
        if (dimension == Dimension::bytes && v >= 0x1p63) throw InputError(text(given.origin, " is ", in_quotes(given.value), "; that is more than any machine has"));
        store(target, v);
    };
    codec.get = [=](const Settings& s) -> std::optional<std::string> {
        const auto v = load(field(s));
        if (!v) return absent;
        return quantity_text(dimension, *v);
    };
    return codec;
}

template <class Field>
Codec number(const Limits& limits, Field field) {
    Codec codec{"NUMBER", words(limits), {}, {}};
    codec.set = [=](Settings& s, const Given& given) {
        const double v = parse_number(given.origin, given.value);
        check_limits(limits, given, v, [&](const std::string& t) { return parse_number(given.origin, t); });
        store(field(s), v);
    };
    codec.get = [=](const Settings& s) -> std::optional<std::string> { return text(field(s)); };
    return codec;
}

/// A whole number; `absent` is the word for an empty optional or for 0.
template <class Field>
Codec count(std::int64_t low, std::int64_t high, Field field, const std::string& absent = "") {
    Codec codec{absent.empty() ? "COUNT" : "COUNT|" + absent, text("from ", low, " to ", high), {}, {}};
    codec.set = [=](Settings& s, const Given& given) {
        auto& target = field(s);
        if (!absent.empty() && trimmed(given.value) == absent) {
            target = {};
            return;
        }
        store(target, parse_count(given.origin, given.value, low, high));
    };
    codec.get = [=](const Settings& s) -> std::optional<std::string> {
        const auto& target = field(s);
        if constexpr (requires { target.has_value(); }) {
            return target ? text(*target) : absent;
        } else {
            return target == 0 && !absent.empty() ? absent : text(target);
        }
    };
    return codec;
}

template <class Field>
Codec on_off(Field field) {
    Codec codec{"on|off", "", {}, {}};
    codec.set = [=](Settings& s, const Given& given) { field(s) = parse_switch(given.origin, given.value); };
    codec.get = [=](const Settings& s) -> std::optional<std::string> { return field(s) ? "on" : "off"; };
    return codec;
}

/// On when it stands alone.
template <class Field>
Codec flag(Field field) {
    Codec codec = on_off(field);
    codec.value.clear();
    return codec;
}

/// One of some words; `field` is the enum or an optional of it, for which `absent` is the word.
template <class Enum, class Field>
Codec choice(std::vector<std::pair<std::string, Enum>> list, Field field, const std::string& absent = "") {
    Codec codec;
    for (const auto& [name, value] : list) codec.value += (codec.value.empty() ? "" : "|") + name;
    if (!absent.empty()) codec.value += "|" + absent;
    codec.set = [=, all = codec.value](Settings& s, const Given& given) {
        auto& target = field(s);
        const std::string_view word = trimmed(given.value);
        if (!absent.empty() && word == absent) {
            target = {};
            return;
        }
        std::vector<std::string> names;
        for (const auto& [name, value] : list) {
            if (name == word) {
                target = value;
                return;
            }
            names.push_back(name);
        }
        if (!absent.empty()) names.push_back(absent);
        std::string accepted;
        for (const auto& name : names) accepted += (accepted.empty() ? "" : ", ") + name;
        throw InputError(text(given.origin, " is ", in_quotes(given.value), "; it must be one of ", accepted));
    };
    codec.get = [=](const Settings& s) -> std::optional<std::string> {
        const auto& target = field(s);
        for (const auto& [name, value] : list) {
            if (target == value) return name;
        }
        return absent;
    };
    return codec;
}

const char* const built_in_legends[] = {"fbfm40", "nlcd", "worldcover", "smc"};

/// A path in a scene file starts from the file's folder, unless it is absolute or names something that is no plain
/// file (an URL, a driver's connection string such as NETCDF:"x.nc":v).
std::string resolved_path(const Given& given) {
    const std::string path(trimmed(given.value));
    if (path.empty()) throw InputError(text(given.origin, " is empty; a path is needed"));
    if (path.find('\0') != std::string::npos) throw InputError(text(given.origin, " is ", in_quotes(path), "; a path holds no zero byte"));
    if (given.folder.empty() || path[0] == '/') return path;
    const auto colon = path.find(':');
    if (colon != std::string::npos && colon >= 2 && path.find('/') > colon) return path;
    return (std::filesystem::path(given.folder) / path).lexically_normal().string();
}

template <class Field>
Codec path(Field field) {
    Codec codec{"PATH", "", {}, {}};
    codec.set = [=](Settings& s, const Given& given) { field(s) = resolved_path(given); };
    codec.get = [=](const Settings& s) -> std::optional<std::string> {
        return field(s).empty() ? std::nullopt : std::optional<std::string>(field(s));
    };
    return codec;
}

Codec legend_choice() {
    Codec codec{"fbfm40|nlcd|worldcover|smc|PATH", "", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        const std::string word(trimmed(given.value));
        const bool built_in = std::find(std::begin(built_in_legends), std::end(built_in_legends), word) != std::end(built_in_legends);
        s.culture_legend = built_in ? word : resolved_path(given);
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        return s.culture_legend.empty() ? std::nullopt : std::optional(s.culture_legend);
    };
    return codec;
}

Codec material_choice() {
    Codec codec{"MATERIAL", "", {}, {}};
    for (const Material& material : material_table()) codec.accepted += (codec.accepted.empty() ? "one of " : ", ") + std::string(material.name);
    codec.set = [](Settings& s, const Given& given) {
        s.material = std::string(trimmed(given.value));
        material_by_name(given.origin, s.material);
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> { return s.material; };
    return codec;
}

/// Two values with one comma between them.
std::pair<std::string, std::string> two(const Given& given, const char* form) {
    const auto comma = given.value.find(',');
    if (comma == std::string::npos || given.value.find(',', comma + 1) != std::string::npos) {
        throw InputError(text(given.origin, " is ", in_quotes(given.value), "; it must be ", form));
    }
    return {given.value.substr(0, comma), given.value.substr(comma + 1)};
}

/// Degrees with or without the unit.
double degrees(const Given& given, std::string_view token, double most, const char* form) {
    token = trimmed(token);
    if (token.ends_with("deg")) token.remove_suffix(3);
    double value = 0;
    try {
        value = parse_number(given.origin, token);
    } catch (const InputError&) {
        throw InputError(text(given.origin, " is ", in_quotes(given.value), "; it must be ", form));
    }
    if (std::abs(value) > most) throw InputError(text(given.origin, " is ", in_quotes(given.value), "; it must be ", form));
    return value;
}

Codec latlon() {
    Codec codec{"LAT,LON", "latitude from -90 to 90, longitude from -360 to 360", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        constexpr const char* form = "LAT,LON in degrees, latitude from -90 to 90, longitude from -360 to 360";
        const auto [lat, lon] = two(given, form);
        s.scene.platform.latlon = LatLon{degrees(given, lat, 90, form), degrees(given, lon, 360, form)};
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        const auto& at = s.scene.platform.latlon;
        if (!at) return std::nullopt;
        return text(at->lat_deg, ",", at->lon_deg);
    };
    return codec;
}

Codec xy() {
    Codec codec{"X,Y", "", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        const auto [x, y] = two(given, "X,Y in the terrain raster's own coordinates");
        s.scene.platform.xy = PointXY{parse_number(given.origin, x), parse_number(given.origin, y)};
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        const auto& at = s.scene.platform.xy;
        if (!at) return std::nullopt;
        return text(at->x, ",", at->y);
    };
    return codec;
}

Codec altitude(AltitudeAbove above_what) {
    Codec codec{value_word(Dimension::length), "", {}, {}};
    codec.set = [=](Settings& s, const Given& given) {
        s.scene.platform.altitude_m = parse_quantity(Dimension::length, given.origin, given.value);
        s.scene.platform.altitude_above = above_what;
        s.altitude_given = true;
    };
    codec.get = [=](const Settings& s) -> std::optional<std::string> {
        if (!s.altitude_given || s.scene.platform.altitude_above != above_what) return std::nullopt;
        return quantity_text(Dimension::length, s.scene.platform.altitude_m);
    };
    return codec;
}

Codec sector() {
    Codec codec{"FROM,TO|full", "each from -360deg to 360deg, wider than 0deg", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        constexpr double circle = 2 * std::numbers::pi;
        if (trimmed(given.value) == "full") return s.scene.sector.reset();
        const auto [first, second] = two(given, "FROM,TO, two angles clockwise such as -45deg,45deg, or full");
        const double from = parse_quantity(Dimension::angle, given.origin, first);
        double to = parse_quantity(Dimension::angle, given.origin, second);
        if (std::abs(from) > circle * (1 + 1e-12) || std::abs(to) > circle * (1 + 1e-12)) {
            throw InputError(text(given.origin, " is ", in_quotes(given.value), "; each angle must be from -360deg to 360deg"));
        }
        if (to < from) to += circle;
        const double width = to - from;
        if (!(width > 0) || width > circle * (1 + 1e-9)) {
            throw InputError(text(given.origin, " is ", in_quotes(given.value), "; the sector must be wider than 0deg and at most 360deg"));
        }
        if (width > circle * (1 - 1e-9)) return s.scene.sector.reset();
        s.scene.sector = Sector{Angle::radians(from), Angle::radians(to)};
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        if (!s.scene.sector) return "full";
        return quantity_text(Dimension::angle, s.scene.sector->from.rad()) + "," + quantity_text(Dimension::angle, s.scene.sector->to.rad());
    };
    return codec;
}

Codec earth() {
    Codec codec{"K|flat", "above 0", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        const std::string_view word = trimmed(given.value);
        if (word == "flat") return s.scene.earth_k.reset();
        if (word == "4/3") {
            s.scene.earth_k = 4.0 / 3;
            return;
        }
        double k = 0;
        try {
            k = parse_number(given.origin, word);
        } catch (const InputError&) {
        }
        if (!(k > 0)) throw InputError(text(given.origin, " is ", in_quotes(given.value), "; it must be a factor above 0, 4/3 or flat"));
        s.scene.earth_k = k;
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        if (!s.scene.earth_k) return "flat";
        if (*s.scene.earth_k == 4.0 / 3) return "4/3";
        return text(*s.scene.earth_k);
    };
    return codec;
}

Codec seed() {
    Codec codec{"COUNT", "from 0 to 18446744073709551615", {}, {}};
    codec.set = [](Settings& s, const Given& given) { s.scene.receiver.seed = parse_unsigned(given.origin, given.value); };
    codec.get = [](const Settings& s) -> std::optional<std::string> { return text(s.scene.receiver.seed); };
    return codec;
}

std::pair<std::string, std::string> key_and_value(const Given& given) {
    const auto equals = given.value.find('=');
    if (equals == std::string::npos || equals == 0) {
        throw InputError(text(given.origin, " is ", in_quotes(given.value), "; it must be NAME=VALUE"));
    }
    return {given.value.substr(0, equals), given.value.substr(equals + 1)};
}

Codec config() {
    Codec codec{"NAME=VALUE", "", {}, {}};
    codec.set = [](Settings& s, const Given& given) { s.config.push_back(key_and_value(given)); };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        if (s.config.empty()) return std::nullopt;
        std::string all;
        for (const auto& [name, value] : s.config) all += (all.empty() ? "" : " ") + name + "=" + value;
        return all;
    };
    return codec;
}

Codec creation() {
    Codec codec{"NAME=VALUE", "", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        key_and_value(given);
        s.creation.push_back(given.value);
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        if (s.creation.empty()) return std::nullopt;
        std::string all;
        for (const auto& option : s.creation) all += (all.empty() ? "" : " ") + option;
        return all;
    };
    return codec;
}

Codec word_of(std::string value, std::string Settings::*field) {
    Codec codec{std::move(value), "", {}, {}};
    codec.set = [=](Settings& s, const Given& given) {
        s.*field = std::string(trimmed(given.value));
        if ((s.*field).empty()) throw InputError(text(given.origin, " is empty"));
    };
    codec.get = [=](const Settings& s) -> std::optional<std::string> {
        return (s.*field).empty() ? std::nullopt : std::optional(s.*field);
    };
    return codec;
}

// ------------------------------------------------------------------------------------------------------ the table

class Table {
public:
    Table& group(KeyGroup g, bool changes_result) {
        group_ = g;
        changes_result_ = changes_result;
        return *this;
    }
    Key& add(const std::string& name, Codec codec, const std::string& fallback, const std::string& help) {
        Key key;
        key.name = name;
        key.value = std::move(codec.value);
        key.accepted = std::move(codec.accepted);
        key.set = std::move(codec.set);
        key.get = std::move(codec.get);
        key.fallback = fallback;
        key.help = help;
        key.group = group_;
        key.changes_result = changes_result_;
        keys_.push_back(std::move(key));
        return keys_.back();
    }
    std::vector<Key> take() { return std::move(keys_); }

private:
    std::vector<Key> keys_;
    KeyGroup group_ = KeyGroup::data_base;
    bool changes_result_ = false;
};

std::vector<Key> make_keys() {
    using enum Dimension;
    constexpr std::int64_t many = std::int64_t{1} << 20;
    Table t;

    t.group(KeyGroup::data_base, false);
    t.add("dem", path([](auto& s) -> auto& { return s.dem; }), "", "terrain heights: any raster GDAL opens; needed");
    t.add("culture", path([](auto& s) -> auto& { return s.culture; }), "", "raster of culture codes; needs culture-legend");
    t.add("culture-height", path([](auto& s) -> auto& { return s.culture_height; }), "", "raster of the heights of what stands on the terrain");
    t.add("culture-height-scale", number(at_least("0"), [](auto& s) -> auto& { return s.culture_height_scale; }), "1",
          "metres in one unit of the culture-height raster (0.1 for tenths of a metre)");
    t.add("culture-legend", legend_choice(), "", "turns culture codes into materials: a built-in legend or a CSV file of lines code,material")
        .commands |= command_info;
    t.add("material", material_choice(), "soil", "the ground where there is no culture, or where it has no data");

    t.group(KeyGroup::position, true);
    t.add("latlon", latlon(), "", "sensor position, WGS84 degrees; exactly one of latlon and xy").exclusive = Exclusive::place;
    t.add("xy", xy(), "", "sensor position in the terrain raster's own coordinates").exclusive = Exclusive::place;
    t.add("altitude-msl", altitude(AltitudeAbove::sea_level), "", "sensor height above sea level; exactly one altitude is needed").exclusive =
        Exclusive::altitude;
    t.add("altitude-agl", altitude(AltitudeAbove::ground), "", "sensor height above the bare terrain under it").exclusive = Exclusive::altitude;
    t.add("altitude-hae", altitude(AltitudeAbove::ellipsoid), "", "sensor height above the WGS84 ellipsoid; needs geoid-offset").exclusive =
        Exclusive::altitude;
    t.add("geoid-offset", quantity(length, any(), [](auto& s) -> auto& { return s.scene.platform.geoid_offset_m; }, "none"), "none",
          "height of the geoid (sea level) above the ellipsoid at the sensor, for altitude-hae");
    t.add("heading", quantity(angle, between("-360deg", "360deg"), [](auto& s) -> auto& { return s.scene.platform.heading; }), "0deg",
          "clockwise from north");

    t.group(KeyGroup::look, true);
    t.add("sector", sector(), "full", "azimuths swept, relative to heading, clockwise");
    t.add("range", quantity(length, above("0m"), [](auto& s) -> auto& { return s.scene.range_m; }, "auto"), "auto",
          "largest slant range; auto: the nearer of the farthest edge of the terrain and the radar horizon");
    t.add("range-start", quantity(length, at_least("0m"), [](auto& s) -> auto& { return s.scene.range_start_m; }), "0m", "smallest slant range");
    t.add("geometry",
          choice<std::optional<Geometry>>({{"geodesic", Geometry::geodesic}, {"grid", Geometry::grid}},
                                          [](auto& s) -> auto& { return s.scene.geometry; }, "auto"),
          "auto", "geodesics on WGS84, or straight lines on the raster's own plane; auto: geodesic where the raster has a CRS");
    t.add("earth", earth(), "4/3", "factor of the earth's radius for straight rays, or a flat earth");
    t.add("azimuth-bins", count(4, many, [](auto& s) -> auto& { return s.scene.azimuth_bins; }, "auto"), "auto",
          "azimuth bins in the full circle; auto: four a beamwidth");
    t.add("range-bin", quantity(length, above("0m"), [](auto& s) -> auto& { return s.scene.range_bin_m; }, "auto"), "auto",
          "slant range in one bin; auto: c tau/8, a quarter of the pulse on the ground");
    t.add("quality",
          choice<Quality>({{"exact", Quality::exact}, {"fine", Quality::fine}, {"normal", Quality::normal}, {"draft", Quality::draft}},
                          [](auto& s) -> auto& { return s.scene.quality; }),
          "normal", "how finely the ground is sampled");

    t.group(KeyGroup::radar, true);
    t.add("frequency", quantity(frequency, above("0Hz"), [](auto& s) -> auto& { return s.scene.radar.frequency_hz; }), "16.5GHz", "carrier frequency");
    t.add("transmit-power", quantity(power, above("0W"), [](auto& s) -> auto& { return s.scene.radar.transmit_power_w; }), "50kW", "peak power");
    t.add("gain", quantity(decibel, any(), [](auto& s) -> auto& { return s.scene.radar.gain; }), "34dB", "peak antenna gain, one-way");
    t.add("losses", quantity(decibel, any(), [](auto& s) -> auto& { return s.scene.radar.losses; }), "6dB", "all system losses together");
    t.add("pulse", quantity(time, above("0s"), [](auto& s) -> auto& { return s.scene.radar.pulse_s; }), "0.5us", "(compressed) pulse length");
    t.add("noise-figure", quantity(decibel, at_least("0dB"), [](auto& s) -> auto& { return s.scene.radar.noise_figure; }), "8dB", "of the receiver");
    t.add("bandwidth", quantity(frequency, above("0Hz"), [](auto& s) -> auto& { return s.scene.radar.bandwidth_hz; }, "auto"), "auto",
          "noise bandwidth; auto: 1.2 / pulse");
    t.add("gamma", quantity(decibel, any(), [](auto& s) -> auto& { return s.scene.gamma; }, "off"), "off",
          "one constant gamma at 10 GHz for everything, walls and water included (studies); off: by material");

    t.group(KeyGroup::antenna, true);
    t.add("beam", quantity(angle, above_below("0deg", "180deg"), [](auto& s) -> auto& { return s.scene.radar.antenna.beam; }), "1.5deg",
          "azimuth beamwidth, one-way, between half-power points");
    t.add("azimuth-pattern",
          choice<AzimuthPattern>({{"gaussian", AzimuthPattern::gaussian}, {"uniform", AzimuthPattern::uniform}},
                                 [](auto& s) -> auto& { return s.scene.radar.antenna.azimuth; }),
          "gaussian", "shape of the beam in azimuth");
    t.add("antenna",
          choice<ElevationPattern>({{"gaussian", ElevationPattern::gaussian}, {"csc2", ElevationPattern::csc2}, {"cos-csc2", ElevationPattern::cos_csc2}},
                                   [](auto& s) -> auto& { return s.scene.radar.antenna.elevation; }),
          "csc2", "shape of the pattern in elevation");
    t.add("antenna-knee", quantity(angle, between("-90deg", "90deg"), [](auto& s) -> auto& { return s.scene.radar.antenna.knee; }), "5deg",
          "depression of the nose in the antenna's frame; above 0deg for the shaped patterns");
    t.add("antenna-width", quantity(angle, above_below("0deg", "180deg"), [](auto& s) -> auto& { return s.scene.radar.antenna.width; }), "12deg",
          "elevation beamwidth (above the knee for the shaped patterns)");
    t.add("antenna-exponent", number(between("0", "10"), [](auto& s) -> auto& { return s.scene.radar.antenna.exponent; }), "0.5",
          "power of the cosine, cos-csc2 only");
    t.add("antenna-floor", quantity(decibel, between("-200dB", "0dB"), [](auto& s) -> auto& { return s.scene.radar.antenna.floor; }), "-60dB",
          "least value of the elevation pattern");
    t.add("tilt", quantity(angle, between("-90deg", "90deg"), [](auto& s) -> auto& { return s.scene.radar.antenna.tilt; }), "0deg",
          "of the antenna, positive down; the nose is at knee + tilt");

    t.group(KeyGroup::receiver, true);
    t.add("if-gain", quantity(decibel, any(), [](auto& s) -> auto& { return s.scene.receiver.if_gain; }), "50dB",
          "a signal shows when it exceeds mds by 64 dB less this");
    t.add("video-gain", quantity(decibel, any(), [](auto& s) -> auto& { return s.scene.receiver.video_gain; }), "4dB", "stretches what shows; 4dB leaves it");
    t.add("stc-range", quantity(length, above("0m"), [](auto& s) -> auto& { return s.scene.receiver.stc_range_m; }, "off"), "off",
          "sensitivity time control: attenuates echoes nearer than this");
    t.add("stc-exponent", number(above("0"), [](auto& s) -> auto& { return s.scene.receiver.stc_exponent; }), "4", "power of range that STC evens out");
    t.add("stc-max", quantity(decibel, at_least("0dB"), [](auto& s) -> auto& { return s.scene.receiver.stc_max; }), "40dB", "most that STC attenuates");
    t.add("dynamic-range", quantity(decibel, above("0dB"), [](auto& s) -> auto& { return s.scene.receiver.dynamic_range; }), "20dB",
          "of the logarithmic amplifier, black to white");
    t.add("mds", quantity(level, any(), [](auto& s) -> auto& { return s.scene.receiver.mds_dbm; }, "auto"), "auto",
          "minimum discernible signal; auto: the thermal noise k T0 B F");
    t.add("display-gamma", number(above("0"), [](auto& s) -> auto& { return s.scene.receiver.display_gamma; }), "1", "exponent 1/gamma of the grey scale");

    t.group(KeyGroup::errors, true);
    t.add("bwe", on_off([](auto& s) -> auto& { return s.scene.radar.beam_width_error; }), "on", "beam-width error: echoes as wide as the beam");
    t.add("ple", on_off([](auto& s) -> auto& { return s.scene.radar.pulse_length_error; }), "on", "pulse-length error: echoes as long as the pulse");
    t.add("noise", on_off([](auto& s) -> auto& { return s.scene.receiver.noise; }), "off", "fluctuation of the thermal noise round its mean");
    t.add("speckle", count(0, 10000, [](auto& s) -> auto& { return s.scene.receiver.speckle_looks; }), "0",
          "fluctuation of the ground's echo, averaged over so many looks; 0: none");
    t.add("seed", seed(), "1", "of noise and speckle");

    t.group(KeyGroup::display, true);
    t.add("display",
          choice<DisplayKind>({{"gpi", DisplayKind::gpi}, {"gpi-true", DisplayKind::gpi_true}, {"ppi", DisplayKind::ppi}, {"tdppi", DisplayKind::tdppi}},
                              [](auto& s) -> auto& { return s.scene.display.kind; }),
          "gpi", "radius on the tube: ground range by the set's sweep, each echo's own ground range, slant range, slant range less a delay");
    t.add("sweep-delay", quantity(length, at_least("0m"), [](auto& s) -> auto& { return s.scene.display.sweep_delay_m; }, "auto"), "auto",
          "tdppi: slant range of the tube's centre; auto: height above the ground below");
    t.add("size", count(16, 32768, [](auto& s) -> auto& { return s.scene.display.size; }), "1024", "pixels of the picture's longer side");
    t.add("orientation",
          choice<Orientation>({{"north", Orientation::north}, {"heading", Orientation::heading}},
                              [](auto& s) -> auto& { return s.scene.display.orientation; }),
          "north", "what is up");
    t.add("rings", on_off([](auto& s) -> auto& { return s.scene.display.rings; }), "on", "range rings and azimuth marks");
    t.add("legend", on_off([](auto& s) -> auto& { return s.scene.display.legend; }), "off",
          "a panel with text beside the picture (needs the program wedgescope_picture)");

    t.group(KeyGroup::run, false);
    t.add("wedges", count(1, many, [](auto& s) -> auto& { return s.wedges; }, "auto"), "auto", "at least so many; changes no bit of the result");
    t.add("threads", count(1, 4096, [](auto& s) -> auto& { return s.threads; }, "all"), "all", "changes no bit of the result");
    t.add("memory", quantity(bytes, above("0B"), [](auto& s) -> auto& { return s.memory_bytes; }), "1GiB",
          "most to be held, beside 64 MiB for the program; changes no bit of the result");

    t.group(KeyGroup::output, false);
    t.add("output", path([](auto& s) -> auto& { return s.output; }), "", "the scope picture").letter = 'o';
    t.add("echo", path([](auto& s) -> auto& { return s.echo; }), "", "echo image, watts, and states, before beam and pulse");
    t.add("power", path([](auto& s) -> auto& { return s.power; }), "", "power image, after beam and pulse");
    t.add("states", path([](auto& s) -> auto& { return s.states; }), "", "0 no data, 1 shadow, 2 seen, 3 unknown, 4 outside");
    t.add("report", path([](auto& s) -> auto& { return s.report; }), "", "JSON: inputs, parameters, what each wedge did, times, memory");
    t.add("power-unit", choice<PowerUnit>({{"W", PowerUnit::watt}, {"dBm", PowerUnit::dbm}}, [](auto& s) -> auto& { return s.power_unit; }), "W",
          "unit of the power image");
    t.add("of", word_of("DRIVER", &Settings::driver), "", "GDAL driver of the picture, or of the other rasters where no picture is written; else by the file's extension");
    {
        Key& co = t.add("co", creation(), "", "creation option of that driver; may be repeated");
        co.repeatable = true;
    }
    t.add("overwrite", flag([](auto& s) -> auto& { return s.overwrite; }), "off", "replace outputs that exist");
    t.add("reproducible", flag([](auto& s) -> auto& { return s.reproducible; }), "off", "outputs are the same bytes every time");

    t.group(KeyGroup::talk, false);
    {
        Key& c = t.add("config", config(), "", "GDAL configuration option; may be repeated");
        c.repeatable = true;
        c.commands |= command_info;
    }
    t.add("verbose", flag([](auto& s) -> auto& { return s.verbose; }), "off", "a table of what was done, on stderr");
    {
        Key& q = t.add("quiet", flag([](auto& s) -> auto& { return s.quiet; }), "off", "no progress and no remarks");
        q.letter = 'q';
        q.commands |= command_info;
    }
    {
        Key& j = t.add("json", flag([](auto& s) -> auto& { return s.json; }), "off", "JSON on stdout");
        j.commands = command_info;
        j.in_scene_file = false;
    }
    {
        Key& h = t.add("help", flag([](auto& s) -> auto& { return s.help; }), "off", "this page");
        h.letter = 'h';
        h.commands = command_simulate | command_info | command_help;
        h.in_scene_file = false;
    }
    return t.take();
}

// -------------------------------------------------------------------------------------------------- near words

std::size_t edits(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t corner = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t replaced = corner + (a[i - 1] != b[j - 1]);
            corner = row[j];
            row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
        }
    }
    return row[b.size()];
}

std::vector<std::string> key_names(unsigned commands, bool scene_file) {
    std::vector<std::string> names;
    for (const Key& key : key_table()) {
        if ((key.commands & commands) && (!scene_file || key.in_scene_file)) names.push_back(key.name);
    }
    return names;
}

std::string suggestion(std::string_view word, const std::vector<std::string>& known, const char* prefix) {
    const auto near = nearest(word, known);
    return near ? text("; did you mean ", prefix, *near, "?") : std::string();
}

// ------------------------------------------------------------------------------------------------ command line

po::options_description descriptions(Command command) {
    po::options_description all;
    for (const Key& key : key_table()) {
        if (!(key.commands & command)) continue;
        const std::string name = key.letter ? key.name + "," + key.letter : key.name;
        auto* value = po::value<std::string>();
        if (key.value.empty()) value->implicit_value("on");
        all.add_options()(name.c_str(), value, key.help.c_str());
    }
    all.add_options()("argument", po::value<std::vector<std::string>>());
    return all;
}

const CommandInfo& info_of(Command command) {
    for (const CommandInfo& info : command_table()) {
        if (info.command == command) return info;
    }
    throw Error("no such command");
}

/// Options and positional arguments of a command line.
std::vector<Given> read_command_line(Command command, const std::vector<std::string>& arguments, std::vector<std::string>& files) {
    const CommandInfo& info = info_of(command);
    // An unknown option is refused here, in words of our own, so that a value that looks like one (-3dB) stays a value.
    const auto refuse_unknown = [&](std::string_view option) {
        std::string_view word = option;
        while (word.starts_with('-')) word.remove_prefix(1);
        word = word.substr(0, word.find('='));
        throw InputError(text("unknown option ", in_quotes(option.substr(0, option.find('='))),
                              suggestion(word, key_names(command, false), "--"), " (wedgescope help ", info.name, " lists them all)"));
    };
    using namespace po::command_line_style;
    po::positional_options_description positional;
    positional.add("argument", -1);
    const po::options_description known = descriptions(command);
    std::vector<Given> given;
    try {
        const auto parsed = po::command_line_parser(arguments)
                                .options(known)
                                .positional(positional)
                                .style(allow_long | long_allow_adjacent | long_allow_next | allow_short | short_allow_adjacent | short_allow_next |
                                       allow_dash_for_short)
                                .run();
        for (const auto& option : parsed.options) {
            if (option.string_key == "argument") {
                files.insert(files.end(), option.value.begin(), option.value.end());
                continue;
            }
            const std::string name = option.string_key;
            const Key* key = find_key(name);
            if (!key) refuse_unknown(name);
            for (const std::string& token : option.original_tokens) {
                // The parser takes `-overwrite` for `-o verwrite`; nobody means that.
                if (key->letter && token.size() > 2 && token[0] == '-' && token[1] == key->letter && find_key(token.substr(1))) {
                    throw InputError(text("option ", in_quotes(token), " has one dash; did you mean -", token, "?"));
                }
            }
            const std::string value = option.value.empty() ? "on" : option.value[0];
            if (value.starts_with("--") && find_key(value.substr(2))) throw InputError(text("option --", name, " needs a value"));
            given.push_back({name, value, "--" + name, ""});
        }
    } catch (const po::unknown_option& e) {
        refuse_unknown(e.get_option_name());
    } catch (const po::invalid_command_line_syntax& e) {
        const std::string name = e.get_option_name();
        if (e.kind() == po::invalid_syntax::missing_parameter) throw InputError(text("option ", name, " needs a value"));
        if (e.kind() == po::invalid_syntax::empty_adjacent_parameter) throw InputError(text("option ", name, " needs a value after '='"));
        throw InputError(text("option ", name, " cannot be understood"));
    } catch (const po::error& e) {
        throw InputError(e.what());
    }
    for (std::size_t i = 0; i < given.size(); ++i) {
        for (std::size_t j = i + 1; j < given.size(); ++j) {
            if (given[i].key == given[j].key && !find_key(given[i].key)->repeatable) {
                throw InputError(text("option --", given[i].key, " is given twice"));
            }
        }
    }
    return given;
}

std::string file_content(const std::string& path) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) throw IoError(text("scene file ", in_quotes(path), " is a folder"));
    errno = 0;
    std::ifstream file(path, std::ios::binary);
    if (!file) throw IoError(text("scene file ", in_quotes(path), " cannot be opened: ", std::strerror(errno)));
    constexpr std::size_t most = std::size_t{1} << 20;
    std::string content(most + 1, '\0');
    file.read(content.data(), static_cast<std::streamsize>(content.size()));
    if (file.bad()) throw IoError(text("scene file ", in_quotes(path), " cannot be read"));
    content.resize(static_cast<std::size_t>(file.gcount()));
    if (content.size() > most) throw InputError(text("scene file ", in_quotes(path), " is larger than 1 MiB; a scene file holds lines key = value"));
    return content;
}

std::string wrapped(const std::string& words, std::size_t indent, std::size_t width) {
    std::istringstream in(words);
    std::string word, out;
    std::size_t column = indent;
    while (in >> word) {
        if (column > indent && column + 1 + word.size() > width) {
            out += "\n" + std::string(indent, ' ');
            column = indent;
        } else if (column > indent) {
            out += ' ';
            ++column;
        }
        out += word;
        column += word.size();
    }
    return out;
}

constexpr std::size_t page_width = 100;

}  // namespace

const std::vector<CommandInfo>& command_table() {
    static const std::vector<CommandInfo> table = {
        {command_simulate, "simulate", "wedgescope simulate [options] [scene.ini]",
         "data base + scene -> scope picture, echo, power and state layers, report",
         "Every option below is also a key of the scene file (lines 'key = value', # begins a comment). The command line wins; relative "
         "paths in the file start from its folder. Outputs appear under their names only when they are whole.",
         "wedgescope simulate --dem terrain.tif --latlon 33.9,-117.3 --altitude-msl 7000ft --range 30nmi -o scope.png"},
        {command_info, "info", "wedgescope info [options] FILE...",
         "what rasters hold, or what a scene file (*.ini) resolves to",
         "For a raster: grid, CRS, heights, voids; with --culture-legend also its codes, how often each occurs, and their materials. For a scene "
         "file: where the sensor is, what is swept, sizes and memory.",
         "wedgescope info --culture-legend fbfm40 culture.tif"},
        {command_help, "help", "wedgescope help [COMMAND]", "this page, or a command's options", "", "wedgescope help simulate"},
    };
    return table;
}

const CommandInfo& command_by_name(std::string_view name) {
    std::vector<std::string> names;
    for (const CommandInfo& info : command_table()) {
        if (name == info.name) return info;
        names.emplace_back(info.name);
    }
    std::string all;
    for (const auto& n : names) all += (all.empty() ? "" : ", ") + n;
    throw InputError(text("unknown command ", in_quotes(name), suggestion(name, names, ""), " (there are ", all, ")"));
}

const char* title(KeyGroup group) {
    switch (group) {
        case KeyGroup::data_base: return "Data base";
        case KeyGroup::position: return "Position";
        case KeyGroup::look: return "Look";
        case KeyGroup::radar: return "Radar";
        case KeyGroup::antenna: return "Antenna";
        case KeyGroup::receiver: return "Receiver";
        case KeyGroup::errors: return "The radar's own errors";
        case KeyGroup::display: return "Display";
        case KeyGroup::run: return "Run";
        case KeyGroup::output: return "Output";
        case KeyGroup::talk: return "General";
    }
    return "";
}

const std::vector<Key>& key_table() {
    static const std::vector<Key> table = make_keys();
    return table;
}

const Key* find_key(std::string_view name) {
    for (const Key& key : key_table()) {
        if (key.name == name) return &key;
    }
    return nullptr;
}

std::optional<std::string> nearest(std::string_view word, const std::vector<std::string>& words) {
    if (word.empty() || word.size() > 64) return std::nullopt;
    const std::string* best = nullptr;
    std::size_t best_cost = std::max<std::size_t>(1, word.size() / 3) + 1;
    for (const std::string& candidate : words) {
        const std::size_t cost = edits(word, candidate);
        if (cost < best_cost) {
            best = &candidate;
            best_cost = cost;
        }
    }
    // A beginning that only one word has counts as near too.
    if (!best && word.size() >= 3) {
        for (const std::string& candidate : words) {
            if (!candidate.starts_with(word)) continue;
            best = &candidate;
            break;
        }
    }
    return best ? std::optional(*best) : std::nullopt;
}

std::vector<Given> read_scene(const std::string& path, std::string_view content) {
    if (content.starts_with("\xef\xbb\xbf")) content.remove_prefix(3);
    const std::string folder = std::filesystem::path(path).parent_path().string();
    std::vector<Given> given;
    std::map<std::string, int> first_line;
    for (int line = 1; !content.empty(); ++line) {
        const auto end = content.find('\n');
        std::string_view rest = content.substr(0, end);
        content.remove_prefix(end == std::string_view::npos ? content.size() : end + 1);
        const std::string_view whole = trimmed(rest);
        // A comment begins at the line's start or behind a blank: a path may hold a #.
        for (std::size_t i = 0; i < rest.size(); ++i) {
            if (rest[i] == '#' && (i == 0 || rest[i - 1] == ' ' || rest[i - 1] == '\t')) {
                rest = rest.substr(0, i);
                break;
            }
        }
        rest = trimmed(rest);
        if (rest.empty()) continue;
        const auto equals = rest.find('=');
        if (equals == std::string_view::npos) {
            throw InputError(text("scene file ", in_quotes(path), ", line ", line, ": ", in_quotes(whole.substr(0, 60)), " is not 'key = value'"));
        }
        const std::string name(trimmed(rest.substr(0, equals)));
        const std::string value(trimmed(rest.substr(equals + 1)));
        const Key* key = find_key(name);
        if (!key || !key->in_scene_file || !(key->commands & command_simulate)) {
            throw InputError(text("scene file ", in_quotes(path), ", line ", line, ": unknown key ", in_quotes(name.substr(0, 60)),
                                  suggestion(name, key_names(command_simulate, true), "")));
        }
        if (value.empty()) throw InputError(text("scene file ", in_quotes(path), ", line ", line, ": ", name, " has no value"));
        if (const auto [at, fresh] = first_line.try_emplace(name, line); !fresh && !key->repeatable) {
            throw InputError(text("scene file ", in_quotes(path), ", line ", line, ": ", name, " stands in line ", at->second, " already"));
        }
        given.push_back({name, value, text("scene file ", in_quotes(path), ", line ", line, ": ", name), folder.empty() ? "." : folder});
    }
    return given;
}

Settings settings_from(const std::vector<Given>& scene_file, const std::vector<Given>& command_line) {
    const auto refuse_two = [](const std::vector<Given>& from) {
        for (std::size_t i = 0; i < from.size(); ++i) {
            for (std::size_t j = i + 1; j < from.size(); ++j) {
                const Key *a = find_key(from[i].key), *b = find_key(from[j].key);
                if (a == b || a->exclusive == Exclusive::none || a->exclusive != b->exclusive) continue;
                throw InputError(text(from[j].origin, " is given beside ", a->name, "; exactly one of ",
                                      a->exclusive == Exclusive::place ? "latlon and xy" : "altitude-msl, altitude-agl and altitude-hae", " is needed"));
            }
        }
    };
    refuse_two(scene_file);
    refuse_two(command_line);
    std::vector<Given> all;
    for (const Given& from_file : scene_file) {
        const Key* key = find_key(from_file.key);
        const bool replaced = std::any_of(command_line.begin(), command_line.end(), [&](const Given& given) {
            const Key* other = find_key(given.key);
            return other == key || (key->exclusive != Exclusive::none && other->exclusive == key->exclusive);
        });
        if (!replaced) all.push_back(from_file);
    }
    all.insert(all.end(), command_line.begin(), command_line.end());
    Settings settings;
    for (const Given& given : all) find_key(given.key)->set(settings, given);
    return settings;
}

Settings parse_arguments(Command command, const std::vector<std::string>& arguments) {
    std::vector<std::string> files;
    const std::vector<Given> command_line = read_command_line(command, arguments, files);
    const bool help = std::any_of(command_line.begin(), command_line.end(), [](const Given& given) { return given.key == "help"; });
    if (help) {
        Settings settings;
        settings.help = true;
        return settings;
    }
    std::vector<Given> scene_file;
    if (command == command_simulate && !files.empty()) {
        if (files.size() > 1) {
            throw InputError(text("there are two scene files, ", in_quotes(files[0]), " and ", in_quotes(files[1]), "; one at most is taken"));
        }
        scene_file = read_scene(files[0], file_content(files[0]));
    }
    Settings settings = settings_from(scene_file, command_line);
    settings.files = files;
    return settings;
}

Settings parse_scene_file(const std::string& path) { return settings_from(read_scene(path, file_content(path)), {}); }

void check_complete(const Settings& settings) {
    const PlatformParams& platform = settings.scene.platform;
    if (settings.dem.empty()) throw InputError("dem is missing; the path of a terrain raster is needed");
    if (!platform.latlon && !platform.xy) throw InputError("the sensor's position is missing; exactly one of latlon and xy is needed");
    if (platform.latlon && platform.xy) throw InputError("latlon and xy are both given; exactly one of them is needed");
    if (!settings.altitude_given) {
        throw InputError("the sensor's altitude is missing; exactly one of altitude-msl, altitude-agl and altitude-hae is needed");
    }
    if (platform.altitude_above == AltitudeAbove::ellipsoid && !platform.geoid_offset_m) {
        throw InputError("altitude-hae is given without geoid-offset; the height of the geoid above the ellipsoid at the sensor is needed");
    }
    if (!settings.culture.empty() && settings.culture_legend.empty()) {
        throw InputError("culture is given without culture-legend; one of fbfm40, nlcd, worldcover, smc or a CSV file is needed");
    }
    if (settings.culture.empty() && !settings.culture_legend.empty()) {
        throw InputError(text("culture-legend is ", in_quotes(settings.culture_legend), " but there is no culture; the path of a culture raster is needed"));
    }
    validate(settings.scene);
}

std::string help_text() {
    std::string out = text("wedgescope ", version(), ": what an airborne ground-mapping radar sees over terrain and culture rasters\n\n");
    out += "Usage: wedgescope COMMAND [options]\n\nCommands\n";
    for (const CommandInfo& info : command_table()) out += fmt::format("  {:<10} {}\n", info.name, info.summary);
    out += "\n'wedgescope help COMMAND' lists a command's options; 'wedgescope --version' names versions.\n\nExample\n  ";
    out += command_table()[0].example;
    return out + "\n";
}

std::string help_text(const CommandInfo& command) {
    std::string out = text("Usage: ", command.usage, "\n\n", command.summary, "\n");
    if (*command.details) out += "\n" + wrapped(command.details, 0, page_width) + "\n";
    std::optional<KeyGroup> group;
    for (const Key& key : key_table()) {
        if (!(key.commands & command.command)) continue;
        if (group != key.group) out += text("\n", title(key.group), "\n");
        group = key.group;
        std::string head = key.letter ? fmt::format("  -{}, --{}", key.letter, key.name) : "  --" + key.name;
        if (!key.value.empty()) head += " " + key.value;
        constexpr std::size_t column = 36;
        out += head.size() + 2 > column ? head + "\n" + std::string(column, ' ') : head + std::string(column - head.size(), ' ');
        std::string help = key.help;
        if (!key.accepted.empty()) help += "; " + key.accepted;
        if (!key.fallback.empty() && !key.value.empty()) help += " [" + key.fallback + "]";
        out += wrapped(help, column, page_width) + "\n";
    }
    if (command.command == command_simulate) {
        out += "\nUnits: a number with a dimension needs its unit (0 does not)\n";
        for (const Dimension d : {Dimension::length, Dimension::time, Dimension::frequency, Dimension::power, Dimension::level, Dimension::angle,
                                  Dimension::decibel, Dimension::bytes}) {
            out += fmt::format("  {:<12}{}\n", value_word(d), unit_list(d));
        }
    }
    return out + "\nExample\n  " + command.example + "\n";
}

// ---------------------------------------------------------------------------------------------------------- JSON

nlohmann::ordered_json parameters_json(const Settings& settings, bool everything) {
    nlohmann::ordered_json out = nlohmann::ordered_json::object();
    for (const Key& key : key_table()) {
        if (!(key.commands & command_simulate) || !key.in_scene_file) continue;
        if (!everything && !key.changes_result) continue;
        if (key.repeatable) {
            nlohmann::ordered_json list = nlohmann::ordered_json::array();
            if (key.name == "co") {
                for (const auto& option : settings.creation) list.push_back(option);
            } else {
                for (const auto& [name, value] : settings.config) list.push_back(name + "=" + value);
            }
            out[key.name] = list;
            continue;
        }
        const auto value = key.get(settings);
        out[key.name] = value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
    }
    return out;
}

Settings settings_from_json(const nlohmann::ordered_json& parameters) {
    std::vector<Given> given;
    for (const auto& [name, value] : parameters.items()) {
        const Key* key = find_key(name);
        if (!key || value.is_null()) continue;
        const auto add = [&](const nlohmann::ordered_json& v) {
            if (!v.is_string()) throw DataError(text("scene JSON: ", name, " is not a text"));
            given.push_back({name, v.get<std::string>(), text("scene JSON: ", name), ""});
        };
        if (value.is_array()) {
            for (const auto& v : value) add(v);
        } else {
            add(value);
        }
    }
    return settings_from({}, given);
}

Settings with_resolved(const Settings& settings, const ResolvedScene& resolved) {
    Settings out = settings;
    const PlatformParams platform = settings.scene.platform;
    out.scene = resolved.scene;
    out.scene.platform = platform;
    out.scene.geometry = resolved.geometry;
    if (!out.scene.radar.bandwidth_hz) out.scene.radar.bandwidth_hz = resolved.scene.radar.noise_bandwidth_hz();
    if (!out.scene.receiver.mds_dbm) out.scene.receiver.mds_dbm = Receiver(resolved.scene.receiver, resolved.scene.radar).mds_dbm();
    return out;
}

nlohmann::ordered_json resolved_json(const ResolvedScene& r) {
    const auto grid = [](const PolarGrid& g) {
        return nlohmann::ordered_json{{"azimuth_bin_begin", g.azimuth_bins.begin}, {"azimuth_bin_end", g.azimuth_bins.end},
                                      {"range_bin_begin", g.range_bins.begin},     {"range_bin_end", g.range_bins.end}};
    };
    nlohmann::ordered_json out;
    out["geometry"] = word(r.geometry);
    if (r.has_lat_lon) {
        out["lat_deg"] = r.lat_deg;
        out["lon_deg"] = r.lon_deg;
    }
    out["x"] = r.x;
    out["y"] = r.y;
    out["column"] = r.nadir.column;
    out["row"] = r.nadir.row;
    out["nadir_in_raster"] = r.nadir_in_raster;
    out["nadir_on_data"] = r.nadir_on_data;
    out["sensor_height_m"] = r.sensor_m;
    out["reference_height_m"] = r.reference_m;
    out["earth_inverse_radius_per_m"] = r.earth.inverse_radius();
    out["range_m"] = r.scene.range_m.value_or(0);
    out["range_start_m"] = r.scene.range_start_m;
    out["sweep_delay_m"] = r.sweep_delay_m;
    out["pulse_extent_m"] = r.scene.radar.pulse_extent_m();
    out["bandwidth_hz"] = r.scene.radar.noise_bandwidth_hz();
    out["noise_power_w"] = r.noise_power_w;
    out["circle_bins"] = r.shown.circle_bins;
    out["range_bin_m"] = r.shown.range_bin_m;
    out["shown"] = grid(r.shown);
    out["swept"] = grid(r.swept);
    return out;
}

std::string scene_json(const Settings& settings, const ResolvedScene& resolved) {
    nlohmann::ordered_json out;
    out["format"] = "wedgescope-scene-1";
    out["version"] = version();
    out["parameters"] = parameters_json(settings, false);
    out["resolved"] = resolved_json(resolved);
    return out.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace wedgescope
