#include "tools/keys.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <numbers>

#include "lib/atmosphere.hpp"
#include "lib/lower_case.hpp"
#include "lib/seen_counts.hpp"
#include "tools/antenna_file.hpp"
#include "tools/radar_set.hpp"
#include "tools/text_file.hpp"
#include "tools/units.hpp"

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
Limits above_to(std::string low, std::string high) { return {std::move(low), true, std::move(high), false}; }

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
void store(std::optional<Angle>& field, double v) { field = Angle::radians(v); }
void store(Decibel& field, double v) { field = Decibel(v); }
void store(std::optional<Decibel>& field, double v) { field = Decibel(v); }
void store(std::uint64_t& field, double v) { field = static_cast<std::uint64_t>(v); }
void store(std::int64_t& field, std::int64_t v) { field = v; }
void store(std::optional<std::int64_t>& field, std::int64_t v) { field = v; }
void store(int& field, std::int64_t v) { field = static_cast<int>(v); }
std::optional<double> load(double field) { return field; }
std::optional<double> load(const std::optional<double>& field) { return field; }
std::optional<double> load(Angle field) { return field.rad(); }
std::optional<double> load(const std::optional<Angle>& field) {
    return field ? std::optional(field->rad()) : std::nullopt;
}
std::optional<double> load(Decibel field) { return field.db(); }
std::optional<double> load(const std::optional<Decibel>& field) {
    return field ? std::optional(field->db()) : std::nullopt;
}
std::optional<double> load(std::uint64_t field) { return static_cast<double>(field); }

double parse_given(Dimension dimension, const Given& given) {
    if (given.unit.empty()) return parse_quantity(dimension, given.origin, given.value);
    return parse_quantity_or_number(dimension, given.origin, given.value, given.unit);
}

/// A dimensioned value; `absent` is the word for an empty optional (auto, off).
template <class Field>
Codec quantity(Dimension dimension, const Limits& limits, Field field, const std::string& absent = "") {
    Codec codec;
    codec.value = value_word(dimension) + (absent.empty() ? "" : "|" + absent);
    codec.accepted = words(limits);
    codec.set = [=](Settings& s, const Given& given) {
        auto& target = field(s);
        if constexpr (requires { target.reset(); }) {
            if (!absent.empty() && same_letters(trimmed(given.value), absent)) return target.reset();
        }
        const double v = parse_given(dimension, given);
        check_limits(limits, given, v,
                     [&](const std::string& t) { return parse_quantity(dimension, given.origin, t); });
        if (dimension == Dimension::bytes && v >= 0x1p63)
            throw InputError(text(given.origin, " is ", in_quotes(given.value), "; that is more than any machine has"));
        store(target, v);
    };
    codec.get = [=](const Settings& s) -> std::optional<std::string> {
        const auto v = load(field(s));
        if (!v) return absent;
        return quantity_text(dimension, *v);
    };
    return codec;
}

/// A quantity, some values of which have words; what of them is a word's value is written as one.
template <class Field>
Codec named(Dimension dimension, const Limits& limits, std::vector<std::pair<std::string, double>> words_of,
            Field field, const std::string& absent = "") {
    Codec plain = quantity(dimension, limits, field, absent), codec = plain;
    codec.value.clear();
    for (const auto& [word, value] : words_of) codec.value += word + "|";
    codec.value += plain.value;
    codec.set = [=](Settings& s, const Given& given) {
        for (const auto& [word, value] : words_of)
            if (same_letters(trimmed(given.value), word)) return store(field(s), value);
        plain.set(s, given);
    };
    codec.get = [=](const Settings& s) -> std::optional<std::string> {
        for (const auto& [word, value] : words_of)
            if (load(field(s)) == value) return word;
        return plain.get(s);
    };
    return codec;
}

/// `absent` is the word for an empty optional.
template <class Field>
Codec number(const Limits& limits, Field field, const std::string& absent = "") {
    Codec codec{absent.empty() ? "NUMBER" : "NUMBER|" + absent, words(limits), {}, {}};
    codec.set = [=](Settings& s, const Given& given) {
        if constexpr (requires { field(s).reset(); })
            if (!absent.empty() && same_letters(trimmed(given.value), absent)) return field(s).reset();
        const double v = parse_number(given.origin, given.value);
        check_limits(limits, given, v, [&](const std::string& t) { return parse_number(given.origin, t); });
        store(field(s), v);
    };
    codec.get = [=](const Settings& s) -> std::optional<std::string> {
        if constexpr (requires { field(s).has_value(); }) {
            return field(s) ? text(*field(s)) : absent;
        } else {
            return text(field(s));
        }
    };
    return codec;
}

/// A whole number; `absent` is the word for an empty optional or for 0.
template <class Field>
Codec count(std::int64_t low, std::int64_t high, Field field, const std::string& absent = "") {
    Codec codec{absent.empty() ? "COUNT" : "COUNT|" + absent, text("from ", low, " to ", high), {}, {}};
    codec.set = [=](Settings& s, const Given& given) {
        auto& target = field(s);
        if (!absent.empty() && same_letters(trimmed(given.value), absent)) {
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
        if (!absent.empty() && same_letters(word, absent)) {
            target = {};
            return;
        }
        std::vector<std::string> names;
        for (const auto& [name, value] : list) {
            if (same_letters(word, name)) {
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

const char* const built_in_legends[] = {"fbfm40", "nlcd", "worldcover", "smc", own_legend};

/// A path in a scene file starts from the file's folder, unless it is absolute or names something that is no plain
/// file (an URL, a driver's connection string such as NETCDF:"x.nc":v).
std::string resolved_path(const Given& given) {
    const std::string path(trimmed(given.value));
    if (path.empty()) throw InputError(text(given.origin, " is empty; a path is needed"));
    if (path.find('\0') != std::string::npos)
        throw InputError(text(given.origin, " is ", in_quotes(path), "; a path holds no zero byte"));
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

/// Chooses the quality too.
Codec max_error() {
    Codec codec = quantity(
        Dimension::decibel, at_least("0.02dB"), [](auto& s) -> auto& { return s.scene.max_error_db; }, "none");
    codec.get = [get = codec.get](const Settings& s) { return s.scene.max_error_db ? get(s) : std::nullopt; };
    codec.set = [set = codec.set](Settings& s, const Given& given) {
        set(s, given);
        if (s.scene.max_error_db) s.scene.quality = quality_within(*s.scene.max_error_db).value_or(Quality::exact);
    };
    return codec;
}

Codec legend_choice() {
    Codec codec{"fbfm40|nlcd|worldcover|smc|rat|PATH", "", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        const std::string word(trimmed(given.value));
        const bool built_in =
            std::find(std::begin(built_in_legends), std::end(built_in_legends), word) != std::end(built_in_legends);
        s.culture_legend = built_in ? word : resolved_path(given);
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        return s.culture_legend.empty() ? std::nullopt : std::optional(s.culture_legend);
    };
    return codec;
}

Codec features_legend() {
    Codec codec{"fbfm40|nlcd|worldcover|smc|PATH", "", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        const std::string word(trimmed(given.value));
        s.features_legend = Legend::built_in(word) ? word : resolved_path(given);
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> { return s.features_legend; };
    return codec;
}

/// By what it says, not by where it lies: an echo image and a work folder know the values.
Codec class_table() {
    Codec codec{"FILE", "", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        const std::string_view value = trimmed(given.value);
        if (is_inline_table(value)) {
            s.class_table.clear();
            s.scene.materials = Materials::from_csv(given.origin, value);
            return;
        }
        s.class_table = resolved_path(given);
        const std::string subject = text(given.origin, " ", in_quotes(s.class_table));
        s.scene.materials =
            Materials::from_csv(subject, text_of_file(subject, s.class_table, "it holds a line for each class"));
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        const std::string& own = s.scene.materials.own();
        return own.empty() ? std::nullopt : std::optional(own);
    };
    return codec;
}

/// Its values are no part of this: options.cpp gives each key that no one else gives.
Codec set_choice() {
    Codec codec{"NAME|PATH", "one of " + shipped_set_names() + ", or a file of keys", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        const std::string word(trimmed(given.value));
        s.radar_set = shipped_set(word) ? word : resolved_path(given);
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        return s.radar_set.empty() ? std::nullopt : std::optional(s.radar_set);
    };
    return codec;
}

/// A law, or a file whose points are taken in at once: what is written of a run holds them, and no path.
Codec antenna_choice() {
    constexpr std::pair<const char*, ElevationPattern> laws[] = {{"gaussian", ElevationPattern::gaussian},
                                                                 {"csc2", ElevationPattern::csc2},
                                                                 {"cos-csc2", ElevationPattern::cos_csc2}};
    Codec codec{"gaussian|csc2|cos-csc2|PATH", "", {}, {}};
    codec.set = [=](Settings& s, const Given& given) {
        AntennaParams& antenna = s.scene.radar.antenna;
        const std::string word(trimmed(given.value));
        antenna.points.clear();
        s.antenna_file.clear();
        for (const auto& [name, law] : laws)
            if (name == word) {
                antenna.elevation = law;
                return;
            }
        antenna.elevation = ElevationPattern::points;
        if (is_points_word(word)) {
            antenna.points = points_of_word(given.origin, word);
            return;
        }
        s.antenna_file = resolved_path(given);
        antenna.points = read_antenna_file(given.origin, s.antenna_file);
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        const AntennaParams& antenna = s.scene.radar.antenna;
        return antenna.elevation == ElevationPattern::points ? points_word(antenna.points) : word(antenna.elevation);
    };
    return codec;
}

Codec material_choice() {
    Codec codec{"MATERIAL", "", {}, {}};
    for (const Material& material : material_table())
        codec.accepted += (codec.accepted.empty() ? "one of " : ", ") + std::string(material.name);
    codec.set = [](Settings& s, const Given& given) {
        s.material = std::string(trimmed(given.value));
        s.scene.materials.by_name(given.origin, s.material);
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
    if (std::abs(value) > most)
        throw InputError(text(given.origin, " is ", in_quotes(given.value), "; it must be ", form));
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

/// Another place than the sensor's.
Codec other_place(std::optional<LatLon> Settings::*field) {
    Codec codec = latlon();
    codec.set = [set = codec.set, field](Settings& s, const Given& given) {
        Settings point;
        set(point, given);
        s.*field = point.scene.platform.latlon;
    };
    codec.get = [field](const Settings& s) -> std::optional<std::string> {
        if (!(s.*field)) return std::nullopt;
        return text((s.*field)->lat_deg, ",", (s.*field)->lon_deg);
    };
    return codec;
}

Codec cell() {
    Codec codec{"AZIMUTH,RANGE", "azimuth from -360deg to 360deg, range from 0m to 10000km", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        const auto [azimuth, range] = two(given, "AZIMUTH,RANGE, an angle and a length such as 40deg,12nmi");
        const double angle = parse_quantity(Dimension::angle, given.origin, azimuth),
                     metres = parse_quantity(Dimension::length, given.origin, range);
        if (!(std::abs(angle) <= 2 * std::numbers::pi * (1 + 1e-12)) || !(metres >= 0 && metres <= 1e7))
            throw InputError(text(given.origin, " is ", in_quotes(given.value),
                                  "; the azimuth must be from -360deg to 360deg and the range from 0m to 10000km"));
        s.cell = Settings::Cell{Angle::radians(angle), metres};
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        if (!s.cell) return std::nullopt;
        return quantity_text(Dimension::angle, s.cell->azimuth.rad()) + "," +
               quantity_text(Dimension::length, s.cell->range_m);
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
    const Limits limits = between(above_what == AltitudeAbove::ground ? "0m" : "-10km", "1000km");
    Codec codec{value_word(Dimension::length), words(limits), {}, {}};
    codec.set = [=](Settings& s, const Given& given) {
        const double v = parse_given(Dimension::length, given);
        check_limits(limits, given, v,
                     [&](const std::string& t) { return parse_quantity(Dimension::length, given.origin, t); });
        s.scene.platform.altitude_m = v;
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
        if (same_letters(trimmed(given.value), "full")) return s.scene.sector.reset();
        const auto [first, second] = two(given, "FROM,TO, two angles clockwise such as -45deg,45deg, or full");
        const double from = parse_quantity(Dimension::angle, given.origin, first);
        double to = parse_quantity(Dimension::angle, given.origin, second);
        if (std::abs(from) > circle * (1 + 1e-12) || std::abs(to) > circle * (1 + 1e-12)) {
            throw InputError(
                text(given.origin, " is ", in_quotes(given.value), "; each angle must be from -360deg to 360deg"));
        }
        if (to < from) to += circle;
        const double width = to - from;
        if (!(width > 0) || width > circle * (1 + 1e-9)) {
            throw InputError(text(given.origin, " is ", in_quotes(given.value),
                                  "; the sector must be wider than 0deg and at most 360deg"));
        }
        if (width > circle * (1 - 1e-9)) return s.scene.sector.reset();
        s.scene.sector = Sector{Angle::radians(from), Angle::radians(to)};
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        if (!s.scene.sector) return "full";
        constexpr double circle = 2 * std::numbers::pi;
        const double from = s.scene.sector->from.rad(), to = s.scene.sector->to.rad();
        std::string end = quantity_text(Dimension::angle, to);
        if (to > circle * (1 + 1e-12)) {
            // Past north: written as it may be given, so that reading it back makes exactly this again.
            const double turned = to - circle;
            end = fmt::format("{:.12g}deg", Angle::radians(turned).deg());
            if (parse_quantity(Dimension::angle, "", end) + circle != to) end = quantity_text(Dimension::angle, turned);
        }
        return quantity_text(Dimension::angle, from) + "," + end;
    };
    return codec;
}

Codec earth() {
    Codec codec{"K|flat", "from 0.1 to 1000000", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        const std::string_view word = trimmed(given.value);
        if (same_letters(word, "flat")) return s.scene.earth_k.reset();
        if (word == "4/3") {
            s.scene.earth_k = 4.0 / 3;
            return;
        }
        double k = 0;
        try {
            k = parse_number(given.origin, word);
        } catch (const InputError&) {
        }
        if (!(k >= 0.1 && k <= 1e6))
            throw InputError(text(given.origin, " is ", in_quotes(given.value),
                                  "; it must be a factor from 0.1 to 1000000, 4/3 or flat"));
        s.scene.earth_k = k;
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        if (!s.scene.earth_k) return "flat";
        if (*s.scene.earth_k == 4.0 / 3) return "4/3";
        return text(*s.scene.earth_k);
    };
    return codec;
}

Codec pitch() {
    Codec codec{"FROM,TO|full", "each from -90deg to 90deg, positive up", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        constexpr double right = std::numbers::pi / 2;
        if (same_letters(trimmed(given.value), "full")) return s.coverage.elevation.reset();
        const auto [first, second] = two(given, "FROM,TO, two angles such as -30deg,5deg, or full");
        const double from = parse_quantity(Dimension::angle, given.origin, first);
        const double to = parse_quantity(Dimension::angle, given.origin, second);
        if (std::abs(from) > right * (1 + 1e-12) || std::abs(to) > right * (1 + 1e-12) || !(to > from))
            throw InputError(text(given.origin, " is ", in_quotes(given.value),
                                  "; the angles must be from -90deg to 90deg, the first one below the second"));
        s.coverage.elevation.emplace(Angle::radians(from), Angle::radians(to));
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        if (!s.coverage.elevation) return "full";
        return quantity_text(Dimension::angle, s.coverage.elevation->first.rad()) + "," +
               quantity_text(Dimension::angle, s.coverage.elevation->second.rad());
    };
    return codec;
}

/// A value of the mask.
template <class Field>
Codec mask_value(Field field) {
    Codec codec{"0..255", "a whole number from 0 to 255", {}, {}};
    codec.set = [=](Settings& s, const Given& given) {
        field(s) = static_cast<std::uint8_t>(parse_count(given.origin, given.value, 0, 255));
    };
    codec.get = [=](const Settings& s) -> std::optional<std::string> { return text(static_cast<int>(field(s))); };
    return codec;
}

Codec seed() {
    Codec codec{"COUNT", "from 0 to 18446744073709551615", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        s.scene.receiver.seed = parse_unsigned(given.origin, given.value);
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> { return text(s.scene.receiver.seed); };
    return codec;
}

Codec only_wedge() {
    Codec codec{"A-B", "", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        constexpr std::int64_t most = std::int64_t{1} << 20;
        const std::string_view value = trimmed(given.value);
        const auto dash = value.find('-', 1);
        try {
            const std::int64_t first = parse_count(given.origin, value.substr(0, dash), 0, most);
            const std::int64_t last =
                dash == std::string_view::npos ? first : parse_count(given.origin, value.substr(dash + 1), 0, most);
            if (last >= first) {
                s.only_wedges = Interval{first, last + 1};
                return;
            }
        } catch (const InputError&) {
        }
        throw InputError(text(given.origin, " is ", in_quotes(given.value),
                              "; it must be the numbers of the first and the last wedge, such as 0-3, or of one"));
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        if (!s.only_wedges) return std::nullopt;
        return text(s.only_wedges->begin, "-", s.only_wedges->end - 1);
    };
    return codec;
}

/// A length, the time of a pulse's way there and back, or the sensor's height.
Codec sweep_delay() {
    const Limits limits = between("0m", "10000km");
    Codec codec = quantity(
        Dimension::length, limits, [](auto& s) -> auto& { return s.scene.display.sweep_delay_m; }, "altitude");
    codec.value = "altitude|LENGTH|TIME";
    codec.set = [=](Settings& s, const Given& given) {
        std::optional<double>& delay_m = s.scene.display.sweep_delay_m;
        const std::string_view word = trimmed(given.value);
        if (same_letters(word, "altitude") || same_letters(word, "auto")) return delay_m.reset();
        std::optional<double> metres = read_quantity(Dimension::length, word, "");
        if (!metres)
            if (const auto delay_s = read_quantity(Dimension::time, word, ""))
                metres = 0.5 * speed_of_light_m_s * *delay_s;
        if (!metres)
            throw InputError(text(given.origin, " is ", in_quotes(given.value), "; it must be altitude, a length (",
                                  unit_list(Dimension::length), ") or a time (", unit_list(Dimension::time), ")"));
        check_limits(limits, given, *metres,
                     [&](const std::string& t) { return parse_quantity(Dimension::length, given.origin, t); });
        delay_m = *metres;
    };
    return codec;
}

Codec tube_centre() {
    Codec codec{"X,Y|auto", "each from -1 to 1", {}, {}};
    codec.set = [](Settings& s, const Given& given) {
        if (same_letters(trimmed(given.value), "auto")) return s.scene.display.centre.reset();
        const auto [x, y] = two(given, "X,Y, each from -1 to 1 (to the right, up), or auto");
        const TubePlace place{parse_number(given.origin, x), parse_number(given.origin, y)};
        if (!(std::abs(place.x) <= 1 && std::abs(place.y) <= 1))
            throw InputError(text(given.origin, " is ", in_quotes(given.value), "; X and Y must each be from -1 to 1"));
        s.scene.display.centre = place;
    };
    codec.get = [](const Settings& s) -> std::optional<std::string> {
        const auto& at = s.scene.display.centre;
        return at ? text(at->x, ",", at->y) : "auto";
    };
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
    Table& group(KeyGroup g, bool changes_result, bool after_echo = false) {
        group_ = g;
        changes_result_ = changes_result;
        after_echo_ = after_echo;
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
        key.after_echo = after_echo_;
        keys_.push_back(std::move(key));
        return keys_.back();
    }
    std::vector<Key> take() { return std::move(keys_); }

private:
    std::vector<Key> keys_;
    KeyGroup group_ = KeyGroup::data_base;
    bool changes_result_ = false, after_echo_ = false;
};

std::vector<Key> make_keys() {
    using enum Dimension;
    constexpr std::int64_t many = std::int64_t{1} << 20;
    Table t;

    t.group(KeyGroup::data_base, false);
    t.add("dem", path([](auto& s) -> auto& { return s.dem; }), "",
          "terrain heights: any raster GDAL opens, or a tile store; needed");
    t.add("culture", path([](auto& s) -> auto& { return s.culture; }), "",
          "raster of culture codes; needs culture-legend")
        .commands |= command_tile;
    t.add("culture-height", path([](auto& s) -> auto& { return s.culture_height; }), "",
          "raster of the heights of what stands on the terrain")
        .commands |= command_tile;
    t.add("culture-height-scale",
          number(
              at_least("0"), [](auto& s) -> auto& { return s.culture_height_scale; }),
          "1",
          "metres in one unit of the culture-height raster (0.1 for tenths of a metre); tile keeps it in the store, "
          "whose scenes take it unless they are given another")
        .commands |= command_tile;
    t.add("culture-legend", legend_choice(), "",
          "turns culture codes into materials: a built-in legend, rat for the raster's own attribute table, or a CSV "
          "file of lines code,material")
        .commands |= command_info | command_tile;
    {
        Key& table = t.add("class-table", class_table(), "",
                           "CSV file of what materials return (as docs/classes.csv): its rows replace those of the "
                           "program's table or add classes");
        table.commands |= command_info | command_tile | command_coverage;
        table.changes_result = true;
    }
    t.add("material", material_choice(), "soil", "the ground where there is no culture, or where it has no data");

    t.group(KeyGroup::position, true);
    t.add("latlon", latlon(), "", "sensor position, WGS84 degrees; exactly one of latlon and xy").exclusive =
        Exclusive::place;
    t.add("xy", xy(), "", "sensor position in the terrain raster's own coordinates").exclusive = Exclusive::place;
    t.add("altitude-msl", altitude(AltitudeAbove::sea_level), "",
          "sensor height above sea level; exactly one altitude is needed")
        .exclusive = Exclusive::altitude;
    t.add("altitude-agl", altitude(AltitudeAbove::ground), "", "sensor height above the bare terrain under it")
        .exclusive = Exclusive::altitude;
    t.add("altitude-hae", altitude(AltitudeAbove::ellipsoid), "",
          "sensor height above the WGS84 ellipsoid; needs geoid-offset")
        .exclusive = Exclusive::altitude;
    t.add(
        "geoid-offset",
        quantity(
            length, between("-200m", "200m"), [](auto& s) -> auto& { return s.scene.platform.geoid_offset_m; }, "none"),
        "none", "height of the geoid (sea level) above the ellipsoid at the sensor, for altitude-hae");
    t.add("heading",
          quantity(
              angle, between("-360deg", "360deg"), [](auto& s) -> auto& { return s.scene.platform.heading; }),
          "0deg", "clockwise from north");

    {
        Key& track =
            t.add("track", path([](auto& s) -> auto& { return s.track; }), "",
                  "CSV table of times, positions, altitudes and headings, instead of one of each: a picture a row, "
                  "numbered scope_0001.png and so on");
        track.exclusive = Exclusive::track;
        track.changes_result = false;
    }
    t.add("scan-step",
          count(
              1, 1000000, [](auto& s) -> auto& { return s.scan_step; }, "off"),
          "off",
          "of a track: so many azimuth bins at a time are seen from where the sensor is then; off: all of them from "
          "the row's place");
    t.add("scan-period",
          quantity(
              time, above_to("0s", "100000s"), [](auto& s) -> auto& { return s.scan_period_s; }, "none"),
          "none", "time of a full turn of the antenna, for scan-step; a row's time is that of the first azimuth");

    t.group(KeyGroup::look, true);
    t.add("sector", sector(), "full", "azimuths swept, relative to heading, clockwise");
    t.add(
        "range",
        quantity(
            length, above_to("0m", "10000km"), [](auto& s) -> auto& { return s.scene.range_m; }, "auto"),
        "auto",
        "largest slant range; auto: the nearer of the farthest edge of the terrain and the radar horizon (coverage: no "
        "limit)");
    t.add("range-start",
          quantity(
              length, between("0m", "10000km"), [](auto& s) -> auto& { return s.scene.range_start_m; }),
          "0m", "smallest slant range");
    t.add("geometry",
          choice<std::optional<Geometry>>(
              {{"geodesic", Geometry::geodesic}, {"grid", Geometry::grid}},
              [](auto& s) -> auto& { return s.scene.geometry; }, "auto"),
          "auto",
          "geodesics on WGS84, or straight lines on the raster's own plane; auto: geodesic where the raster has a CRS");
    t.add("earth", earth(), "4/3", "factor of the earth's radius for straight rays, or a flat earth");
    t.add("azimuth-bins",
          count(
              1, 1000000, [](auto& s) -> auto& { return s.scene.azimuth_bins; }, "auto"),
          "auto", "azimuth bins in the full circle; auto: four a beamwidth");
    t.add("range-bin",
          quantity(
              length, between("0.001m", "1000km"), [](auto& s) -> auto& { return s.scene.range_bin_m; }, "auto"),
          "auto", "slant range in one bin; auto: c tau/8, a quarter of the pulse on the ground");
    Key& quality = t.add("quality",
                         choice<Quality>(
                             {{"exact", Quality::exact},
                              {"fine", Quality::fine},
                              {"normal", Quality::normal},
                              {"draft", Quality::draft}},
                             [](auto& s) -> auto& { return s.scene.quality; }),
                         "normal", "how finely the ground is sampled");
    quality.exclusive = Exclusive::accuracy;
    quality.get = [own = quality.get](const Settings& s) -> std::optional<std::string> {
        return s.scene.max_error_db ? std::nullopt : own(s);
    };
    t.add(
         "max-error", max_error(), "",
         "the quickest quality whose power image keeps to this RMS, where a beam has four azimuth bins or more: draft "
         "from 0.4dB, normal from 0.1dB, fine from 0.05dB, exact from 0.02dB; coverage, which has no such image, takes "
         "the same quality")
        .exclusive = Exclusive::accuracy;
    t.add(
        "spokes-per-post",
        number(
            between("0.25", "16"), [](auto& s) -> auto& { return s.scene.spokes_per_post; }, "auto"),
        "auto",
        "least spokes for each post of a line; auto: as the quality says, and from high up fewer where bins are wide");
    t.add("spokes-per-bin",
          number(
              between("2", "256"), [](auto& s) -> auto& { return s.scene.spokes_per_bin; }, "auto"),
          "auto",
          "least spokes for each azimuth bin, near and far; auto: as the quality says, and more where refine finds "
          "that it takes them");
    t.add("spoke-lead",
          number(
              between("1", "64"), [](auto& s) -> auto& { return s.scene.spoke_lead; }, "auto"),
          "auto",
          "spokes double where a line this many times as far off needs it: few then share a parent's horizon; auto: "
          "as the quality says");
    t.add("crossings",
          choice<std::optional<bool>>(
              {{"on", true}, {"off", false}}, [](auto& s) -> auto& { return s.scene.crossings; }, "auto"),
          "auto",
          "spokes are sampled where they cross the lines of the other axis too; auto: as the quality says, in "
          "coverage as far as 64 posts whatever the quality");
    t.add("course",
          choice<std::optional<bool>>(
              {{"curved", true}, {"straight", false}}, [](auto& s) -> auto& { return s.scene.curved_course; }, "auto"),
          "auto",
          "how the surface runs between two samples in a cell; auto: as the quality says (coverage: curved as far as "
          "64 posts)");
    t.add(
        "refine",
        choice<bool>(
            {{"on", true}, {"off", false}}, [](auto& s) -> auto& { return s.scene.refine; }),
        "on",
        "azimuth bins that every other spoke alone would draw differently are swept again with twice the spokes, up to "
        "three times: glimpses of crests out of shadows; not with spokes-per-bin or spokes-per-post");
    t.add("detail",
          choice<bool>(
              {{"auto", true}, {"off", false}}, [](auto& s) -> auto& { return s.scene.detail; }),
          "auto",
          "levels of detail: auto: of fine ground every 2nd to 32nd post where normal and draft keep what they "
          "promise; off: every post");

    {
        const auto budget_only = [](Key& key) {
            key.commands = command_budget;
            key.in_scene_file = false;
            key.changes_result = false;
        };
        budget_only(t.add("at", cell(), "",
                          "the cell: azimuth clockwise from the heading, as sector's, and slant range (ground range "
                          "with display gpi-true)"));
        Key& place = t.add("at-latlon", other_place(&Settings::cell_place), "",
                           "or the place on the ground that the cell is to show, WGS84 degrees");
        place.set = [set = place.set](Settings& s, const Given& given) {
            set(s, given);
            s.cell_place_key = given.origin.starts_with("--") ? given.origin.substr(2) : given.origin;
        };
        budget_only(place);
    }

    t.group(KeyGroup::coverage, true);
    {
        const auto coverage_only = [&](Key& key) {
            key.commands = command_coverage;
            key.in_scene_file = false;
        };
        coverage_only(t.add("layer",
                            choice<CoverageLayer>(
                                {{"mask", CoverageLayer::mask},
                                 {"states", CoverageLayer::states},
                                 {"height", CoverageLayer::height},
                                 {"range", CoverageLayer::range},
                                 {"grazing", CoverageLayer::grazing},
                                 {"depression", CoverageLayer::depression},
                                 {"response", CoverageLayer::response}},
                                [](auto& s) -> auto& { return s.coverage.layer; }),
                            "mask",
                            "seen or not; 0 no data, 1 shadow, 2 seen, 3 unknown, 4 outside; metres to be raised to be "
                            "seen; slant range, m; ray to ground, deg; below the horizontal, deg; what a radar gets of "
                            "each post, dBm"));
        {
            Key& observers = t.add(
                "observers", path([](auto& s) -> auto& { return s.observers; }), "",
                "many sensors instead of one: the points of a vector file, or of a CSV table (a track is one), with "
                "fields height (above ground) or altitude (above the sea), range, heading where the options do not say "
                "it for all; OUT holds how many of them see each post, 65535 where there is no data");
            coverage_only(observers);
            observers.exclusive = Exclusive::place;
            observers.changes_result = false;
            Key& layer = t.add("observers-layer", word_of("NAME", &Settings::observers_layer), "",
                               "of a vector file that has several");
            coverage_only(layer);
            layer.changes_result = false;
        }
        coverage_only(
            t.add("at-least",
                  count(
                      1, static_cast<std::int64_t>(most_observers), [](auto& s) -> auto& { return s.at_least; }, "off"),
                  "off", "with observers: a mask of what at least so many of them see, instead of counts"));
        coverage_only(t.add("target-height",
                            quantity(
                                length, between("0m", "100km"), [](auto& s) -> auto& { return s.coverage.target_m; }),
                            "0m", "of what stands on the post that is looked at"));
        coverage_only(t.add(
            "ground-range",
            quantity(
                length, above_to("0m", "10000km"), [](auto& s) -> auto& { return s.scene.ground_range_m; }, "none"),
            "none", "largest distance along the ground, however high sensor and post stand"));
        coverage_only(t.add("pitch", pitch(), "full", "elevation angles at the sensor that count"));
        coverage_only(t.add("seen-value", mask_value([](auto& s) -> auto& { return s.coverage.mask.seen; }), "255",
                            "of the mask where the ground is seen"));
        coverage_only(t.add("hidden-value", mask_value([](auto& s) -> auto& { return s.coverage.mask.hidden; }), "0",
                            "of the mask where it is not"));
        coverage_only(t.add("outside-value", mask_value([](auto& s) -> auto& { return s.coverage.mask.outside; }), "1",
                            "of the mask out of range, sector or pitch"));
        coverage_only(t.add("no-data-value",
                            count(
                                0, 255, [](auto& s) -> auto& { return s.no_data_value; }, "auto"),
                            "auto",
                            "of the mask where the terrain is void, declared; auto: 1 (2 where seen or hidden is "
                            "1), declared if any is"));
    }

    t.group(KeyGroup::radar, false);
    t.add("set", set_choice(), "",
          "a radar set: values for the keys of radar, antenna, receiver and errors that are given nowhere else (help "
          "sets shows the shipped ones)")
        .commands |= command_scope;
    t.group(KeyGroup::radar, true);
    t.add("frequency",
          quantity(
              frequency, between("1MHz", "1000GHz"), [](auto& s) -> auto& { return s.scene.radar.frequency_hz; }),
          "16.5GHz", "carrier frequency");
    t.add("transmit-power",
          quantity(
              power, between("0.001W", "1000MW"), [](auto& s) -> auto& { return s.scene.radar.transmit_power_w; }),
          "50kW", "peak power");
    t.add("gain",
          quantity(
              decibel, between("-100dB", "100dB"), [](auto& s) -> auto& { return s.scene.radar.gain; }),
          "34dB", "peak antenna gain, one-way");
    t.add("losses",
          quantity(
              decibel, between("0dB", "100dB"), [](auto& s) -> auto& { return s.scene.radar.losses; }),
          "6dB", "all system losses together");
    t.add("pulse",
          quantity(
              time, between("0.0001us", "1000us"), [](auto& s) -> auto& { return s.scene.radar.pulse_s; }),
          "0.5us", "(compressed) pulse length");
    t.add("noise-figure",
          quantity(
              decibel, between("0dB", "100dB"), [](auto& s) -> auto& { return s.scene.radar.noise_figure; }),
          "8dB", "of the receiver");
    t.add("bandwidth",
          quantity(
              frequency, above("0Hz"), [](auto& s) -> auto& { return s.scene.radar.bandwidth_hz; }, "auto"),
          "auto", "noise bandwidth; auto: 1.2 / pulse");
    t.add("polarisation",
          choice<Polarisation>(
              {{"hh", Polarisation::hh}, {"vv", Polarisation::vv}, {"circular", Polarisation::circular}},
              [](auto& s) -> auto& { return s.scene.radar.polarisation; }),
          "hh", "sent and received; circular: of one sense both ways, which rain hardly answers to");

    t.group(KeyGroup::antenna, true);
    t.add("beam",
          quantity(
              angle, between("0.002deg", "90deg"), [](auto& s) -> auto& { return s.scene.radar.antenna.beam; }),
          "1.5deg", "azimuth beamwidth, one-way, between half-power points");
    t.add("azimuth-pattern",
          choice<AzimuthPattern>(
              {{"gaussian", AzimuthPattern::gaussian}, {"uniform", AzimuthPattern::uniform}},
              [](auto& s) -> auto& { return s.scene.radar.antenna.azimuth; }),
          "gaussian", "shape of the beam in azimuth");
    t.add(
        "antenna", antenna_choice(), "csc2",
        "shape of the pattern in elevation: a law, or a CSV file of lines depression_deg,gain_db (then knee, width and "
        "exponent play no part)");
    t.add("antenna-knee",
          quantity(
              angle, between("-90deg", "90deg"), [](auto& s) -> auto& { return s.scene.radar.antenna.knee; }),
          "5deg", "depression of the nose in the antenna's frame; above 0deg for the shaped patterns");
    t.add("antenna-width",
          quantity(
              angle, above_to("0deg", "180deg"), [](auto& s) -> auto& { return s.scene.radar.antenna.width; }),
          "12deg", "elevation beamwidth (above the knee for the shaped patterns)");
    t.add("antenna-exponent",
          number(
              between("0", "10"), [](auto& s) -> auto& { return s.scene.radar.antenna.exponent; }),
          "0.5", "power of the cosine, cos-csc2 only");
    t.add("antenna-floor",
          quantity(
              decibel, between("-200dB", "0dB"), [](auto& s) -> auto& { return s.scene.radar.antenna.floor; }),
          "-60dB", "least value of the elevation pattern");
    t.add("tilt",
          quantity(
              angle, between("-90deg", "90deg"), [](auto& s) -> auto& { return s.scene.radar.antenna.tilt; }),
          "0deg", "of the antenna, positive down; the nose is at knee + tilt");

    t.group(KeyGroup::ground, true);
    t.add("backscatter",
          choice<LandModel>(
              {{"constant-gamma", LandModel::constant_gamma},
               {"ulaby-dobson", LandModel::ulaby_dobson},
               {"oh", LandModel::oh}},
              [](auto& s) -> auto& { return s.scene.land; }),
          "constant-gamma",
          "model of land; a class that it does not know keeps its constant gamma (oh: all but sand and soil)");
    t.add("water",
          choice<WaterModel>(
              {{"nrl", WaterModel::nrl}, {"calm", WaterModel::calm}}, [](auto& s) -> auto& { return s.scene.water; }),
          "nrl", "model of water: waves of sea-state, or the mirror of calm inland water round the vertical");
    t.add("sea-state",
          number(
              between("0", "6"), [](auto& s) -> auto& { return s.scene.sea_state; }),
          "0", "Douglas, for nrl; 0: water returns nothing");
    t.add("wind-direction",
          quantity(
              angle, between("-360deg", "360deg"), [](auto& s) -> auto& { return s.scene.wind_from; }, "none"),
          "none",
          "azimuth that the wind blows from, clockwise from north, for nrl: the sea returns most upwind; none: the "
          "mean over "
          "all directions");
    t.add("far-shore", on_off([](auto& s) -> auto& { return s.scene.far_shore; }), "off",
          "banks and walls that rise behind water are lit by way of its mirror too, as far as sea-state leaves one");
    t.add("walls",
          choice<Walls>(
              {{"resolved", Walls::resolved}, {"statistical", Walls::statistical}},
              [](auto& s) -> auto& { return s.scene.walls; }),
          "resolved",
          "those that culture heights make; or, of classes whose table gives structures finer than a post, their mean, "
          "which also "
          "raises the ground by the share that they cover");
    t.add("gamma",
          quantity(
              decibel, between("-100dB", "100dB"), [](auto& s) -> auto& { return s.scene.gamma; }, "off"),
          "off", "one constant gamma at 10 GHz for everything, walls and water included (studies); off: by material");

    t.group(KeyGroup::weather, true);
    t.add("gases",
          named(
              density, between("0g/m3", "100g/m3"), {{"normal", normal_vapour_g_m3}, {"high", high_vapour_g_m3}},
              [](auto& s) -> auto& { return s.scene.weather.vapour_g_m3; }, "none"),
          "none", "attenuation by oxygen and by so much water vapour at sea level (normal 7.5g/m3, high 20g/m3)");
    {
        std::vector<std::pair<std::string, double>> rates;
        for (const RainCategory& category : rain_categories) rates.emplace_back(category.name, category.rate_mm_h);
        t.add("rain",
              named(
                  rain_rate, between("0mm/h", "500mm/h"), rates,
                  [](auto& s) -> auto& { return s.scene.weather.rain_mm_h; }),
              "clear",
              "attenuates and returns an echo below rain-top (drizzle 0.25mm/h, light 1, moderate 4, heavy 16, "
              "excessive 40)");
    }
    t.add("rain-top",
          quantity(
              length, between("-1km", "20km"), [](auto& s) -> auto& { return s.scene.weather.rain_top_m; }),
          "3km", "above sea level");
    t.add("cloud",
          named(
              density, between("0g/m3", "10g/m3"), {{"none", 0.0}, {"fog", 0.05}, {"thick-fog", 0.5}},
              [](auto& s) -> auto& { return s.scene.weather.liquid_water_g_m3; }),
          "none",
          "liquid water from cloud-base to cloud-top; it attenuates (fog 0.05g/m3: visibility 300 m; thick-fog "
          "0.5g/m3: 50 m)");
    t.add("cloud-base",
          quantity(
              length, between("-1km", "20km"), [](auto& s) -> auto& { return s.scene.weather.cloud_base_m; }),
          "0m", "above sea level");
    t.add("cloud-top",
          quantity(
              length, between("-1km", "20km"), [](auto& s) -> auto& { return s.scene.weather.cloud_top_m; }),
          "1km", "above sea level; above cloud-base");

    t.group(KeyGroup::receiver, true, true);
    t.add("if-gain",
          quantity(
              decibel, between("-200dB", "300dB"), [](auto& s) -> auto& { return s.scene.receiver.if_gain; }),
          "50dB", "a signal shows when it exceeds mds by 64 dB less this");
    t.add("video-gain",
          quantity(
              decibel, between("-100dB", "100dB"), [](auto& s) -> auto& { return s.scene.receiver.video_gain; }),
          "4dB", "stretches what shows; 4dB leaves it");
    t.add("stc-range",
          quantity(
              length, above("0m"), [](auto& s) -> auto& { return s.scene.receiver.stc_range_m; }, "off"),
          "off", "sensitivity time control: attenuates echoes nearer than this");
    t.add("stc-exponent",
          number(
              between("0", "10"), [](auto& s) -> auto& { return s.scene.receiver.stc_exponent; }),
          "4", "power of range that STC evens out");
    t.add("stc-max",
          quantity(
              decibel, between("0dB", "200dB"), [](auto& s) -> auto& { return s.scene.receiver.stc_max; }),
          "40dB", "most that STC attenuates");
    t.add("dynamic-range",
          quantity(
              decibel, above_to("0dB", "200dB"), [](auto& s) -> auto& { return s.scene.receiver.dynamic_range; }),
          "20dB", "of the logarithmic amplifier, black to white, where the limiter clips");
    t.add("mds",
          quantity(
              level, between("-300dBm", "200dBm"), [](auto& s) -> auto& { return s.scene.receiver.mds_dbm; }, "auto"),
          "auto", "minimum discernible signal; auto: the thermal noise k T0 B F");
    t.add("minimum-range",
          quantity(
              length, between("0m", "10000km"), [](auto& s) -> auto& { return s.scene.receiver.minimum_range_m; },
              "auto"),
          "0m", "nothing is received from nearer, slant range; auto: c tau/2, until the pulse has left");
    t.add("display-gamma",
          number(
              between("0.1", "10"), [](auto& s) -> auto& { return s.scene.receiver.display_gamma; }),
          "1", "exponent 1/gamma of the grey scale");

    t.group(KeyGroup::errors, true);
    t.add("bwe", on_off([](auto& s) -> auto& { return s.scene.radar.beam_width_error; }), "on",
          "beam-width error: echoes as wide as the beam");
    t.add("ple", on_off([](auto& s) -> auto& { return s.scene.radar.pulse_length_error; }), "on",
          "pulse-length error: echoes as long as the pulse");
    t.add("bwe-scale",
          number(
              between("0.1", "20"), [](auto& s) -> auto& { return s.scene.radar.beam_width_scale; }),
          "1", "bwe: echoes this many times as wide, with the same total power");
    t.add("ple-scale",
          number(
              between("0.1", "20"), [](auto& s) -> auto& { return s.scene.radar.pulse_length_scale; }),
          "1", "ple: echoes this many times as long, with the same total power");
    t.group(KeyGroup::errors, true, true);
    t.add("noise", on_off([](auto& s) -> auto& { return s.scene.receiver.noise; }), "off",
          "fluctuation of the thermal noise round its mean");
    t.add("speckle",
          count(
              0, 10000, [](auto& s) -> auto& { return s.scene.receiver.speckle_looks; }),
          "0",
          "fluctuation of the ground's echo, averaged over so many looks, of which each costs a pass "
          "over the picture's cells; 0: none");
    t.add("seed", seed(), "1", "of noise and speckle; each frame of a track takes one more than the one before");

    t.group(KeyGroup::display, true);
    t.add("display",
          choice<DisplayKind>(
              {{"gpi", DisplayKind::gpi},
               {"gpi-true", DisplayKind::gpi_true},
               {"ppi", DisplayKind::ppi},
               {"tdppi", DisplayKind::tdppi}},
              [](auto& s) -> auto& { return s.scene.display.kind; }),
          "gpi",
          "radius on the tube: ground range by the set's sweep, each echo's own ground range, slant range, slant range "
          "less a delay");
    t.group(KeyGroup::display, true, true);
    t.add("sweep-delay", sweep_delay(), "altitude",
          "tdppi: slant range of the tube's centre, or the time of the way there and back; altitude: height above the "
          "ground below");
    t.add("size",
          count(
              16, 32768, [](auto& s) -> auto& { return s.scene.display.size; }),
          "1024", "pixels of the picture's longer side");
    t.add("orientation",
          choice<Orientation>(
              {{"north", Orientation::north}, {"heading", Orientation::heading}},
              [](auto& s) -> auto& { return s.scene.display.orientation; }),
          "north", "what is up");
    t.add(
        "centre", tube_centre(), "auto",
        "where the sensor stands on a square tube, in halves of its side from the middle to the right and up (0,-0.9: "
        "near the bottom); auto: the frame fits the sector");
    t.add("rings", on_off([](auto& s) -> auto& { return s.scene.display.rings; }), "on",
          "range rings, and ticks each 10 degrees at the rim");
    t.add(
        "ring-spacing",
        quantity(
            length, above_to("0m", "10000km"), [](auto& s) -> auto& { return s.scene.display.ring_spacing_m; }, "auto"),
        "auto", "from ring to ring, on the display's own radius; auto: a round number of nautical miles");
    t.add("azimuth-marks",
          quantity(
              angle, between("1deg", "180deg"), [](auto& s) -> auto& { return s.scene.display.azimuth_marks_rad; },
              "off"),
          "off", "radial lines, from the heading on to either side every so many degrees");
    t.add("pixel-fill",
          choice<PixelFill>(
              {{"interpolate", PixelFill::interpolate}, {"holes", PixelFill::holes}, {"none", PixelFill::none}},
              [](auto& s) -> auto& { return s.scene.display.pixel_fill; }),
          "interpolate",
          "pixels between cells: interpolated; each cell on one pixel, and holes filled from the pixels round them; "
          "holes "
          "left black");
    t.add("alpha", on_off([](auto& s) -> auto& { return s.scene.display.alpha; }), "off",
          "an alpha channel, transparent where the data base has no data");
    t.add("legend", on_off([](auto& s) -> auto& { return s.scene.display.legend; }), "off",
          "a panel with text beside the picture (needs the program wedgescope_picture)");

    t.group(KeyGroup::run, false);
    t.add("wedges",
          count(
              1, many, [](auto& s) -> auto& { return s.wedges; }, "auto"),
          "auto", "at least so many; changes no bit of the result");
    t.add("threads",
          count(
              1, 4096, [](auto& s) -> auto& { return s.threads; }, "all"),
          "all", "changes no bit of the result")
        .commands |= command_tile;
    t.add("memory",
          quantity(
              bytes, above("0B"), [](auto& s) -> auto& { return s.memory_bytes; }),
          "1GiB", "most to be held, beside 64 MiB for the program; changes no bit of the result")
        .commands |= command_info | command_tile;
    {
        Key& size = t.add("tile-size",
                          count(
                              64, 2048, [](auto& s) -> auto& { return s.tile_posts; }),
                          "256", "posts of a tile's side: 64, 128, 256, 512, 1024 or 2048");
        size.commands = command_tile;
        size.in_scene_file = false;
    }
    {
        Key& k =
            t.add("around", other_place(&Settings::around), "",
                  "also keep the terrain sorted into wedges round this point, for scenes from there; FOLDER alone: of "
                  "a store that stands");
        k.commands = command_tile;
        k.in_scene_file = false;
    }
    {
        const auto tile_only = [](Key& key) {
            key.commands = command_tile;
            key.in_scene_file = false;
        };
        tile_only(
            t.add("features", path([](auto& s) -> auto& { return s.features; }), "",
                  "vector file of points, lines and areas that are burnt over culture and culture-height, or make "
                  "them: fields material (a word, or a code of features-legend) or SMC, height or HGT, metres, and "
                  "directivity (omni, uni, bi) with axis, degrees from north"));
        tile_only(t.add(
            "directivity", path([](auto& s) -> auto& { return s.directivity; }), "",
            "raster on culture's grid of the side that reflects, in place of the class' own: 0 to 359 the azimuth of "
            "one (uni), 360 to 539 that of two and 360 more (bi), 540 none (omni), degrees from north"));
        tile_only(t.add("features-layer", word_of("NAME", &Settings::features_layer), "",
                        "this layer of the vector file alone; without it all, later ones over those before"));
        tile_only(t.add("features-legend", features_legend(), "smc",
                        "turns numbers in the features' field of material into materials"));
        tile_only(t.add("features-touch", on_off([](auto& s) -> auto& { return s.features_touch; }), "off",
                        "burn every cell that a line or an area touches; off: lines one cell wide, and cells whose "
                        "centre lies in an area"));
    }
    t.add("work-dir", path([](auto& s) -> auto& { return s.work_dir; }), "",
          "folder where finished wedges are kept, for resume; made if it is missing");
    t.add("resume", flag([](auto& s) -> auto& { return s.resume; }), "off",
          "go on with the run in work-dir, or begin it; wedges that are done are used again. tile: go on with "
          "FOLDER.part, what a run that was stopped has left")
        .commands |= command_tile;
    t.add("only-wedge", only_wedge(), "",
          "these wedges alone, counted from 0, into work-dir; several processes may fill one folder, and resume then "
          "makes the picture");

    t.add("source",
          choice<SourceKind>(
              {{"auto", SourceKind::automatic}, {"direct", SourceKind::direct}, {"spilled", SourceKind::spilled}},
              [](auto& s) -> auto& { return s.source; }),
          "auto",
          "rasters by windows, or sorted into wedges in one pass; auto: direct unless windows read them badly; changes "
          "no bit of the result");
    t.add("temp-dir", path([](auto& s) -> auto& { return s.temp_dir; }), "",
          "folder for what does not fit into memory; without it CPL_TMPDIR, TMPDIR or /tmp");
    t.add(
        "keep-map", flag([](auto& s) -> auto& { return s.keep_map; }), "off",
        "keep what is found of a plain raster's ground (bounds and detail by block) beside it, as RASTER.ground: later "
        "runs read less; changes no bit of the result");
    t.add("no-cull", flag([](auto& s) -> auto& { return s.no_cull; }), "off",
          "read and sweep also what is known to stay hidden; changes no bit of the result");

    t.group(KeyGroup::output, false);
    {
        Key& o = t.add("output", path([](auto& s) -> auto& { return s.output; }), "",
                       "the scope picture; evaluate: the table, without this on standard output");
        o.letter = 'o';
        o.commands |= command_evaluate;
    }
    {
        Key& in = t.add("in", path([](auto& s) -> auto& { return s.table; }), "",
                        "CSV table of inputs, a line of column names and a row a line; - is standard input");
        in.commands = command_evaluate;
        in.in_scene_file = false;
    }
    {
        Key& d = t.add("digits",
                       count(
                           1, 17, [](auto& s) -> auto& { return s.digits; }, "all"),
                       "all", "significant digits of the results; all: as many as read back the same number");
        d.commands = command_evaluate;
        d.in_scene_file = false;
    }
    t.add("echo", path([](auto& s) -> auto& { return s.echo; }), "",
          "echo image, watts, and states, before beam and pulse");
    t.add("power", path([](auto& s) -> auto& { return s.power; }), "", "power image, after beam and pulse");
    t.add(
        "power-stack", path([](auto& s) -> auto& { return s.power_stack; }), "",
        "of a track: the power images of all frames in one GeoTIFF, a band each, beside or instead of numbered files; "
        "all must have as many bins");
    t.add("states", path([](auto& s) -> auto& { return s.states; }), "",
          "0 no data, 1 shadow, 2 seen, 3 unknown, 4 outside");
    t.add(
        "ground", path([](auto& s) -> auto& { return s.ground_file; }), "",
        "what the set gets of each post, dBm, on the raster's own posts: coverage's layer response of the same scene");
    t.add("report", path([](auto& s) -> auto& { return s.report; }), "",
          "JSON: inputs, parameters, what each wedge did, times, memory");
    t.add("timeline", path([](auto& s) -> auto& { return s.timeline; }), "",
          "Trace Event JSON: what each thread did when, and the memory in use; opens in Perfetto");
    t.add("power-unit",
          choice<PowerUnit>(
              {{"W", PowerUnit::watt}, {"dBm", PowerUnit::dbm}}, [](auto& s) -> auto& { return s.power_unit; }),
          "W", "unit of the power image");
    t.add("of", word_of("DRIVER", &Settings::driver), "",
          "GDAL driver of the picture, or of the other rasters where no picture is written; else by the file's "
          "extension");
    {
        Key& co = t.add("co", creation(), "", "creation option of that driver; may be repeated");
        co.repeatable = true;
        co.commands |= command_tile;
    }
    t.add("overwrite", flag([](auto& s) -> auto& { return s.overwrite; }), "off", "replace outputs that exist")
        .commands |= command_tile | command_evaluate;
    t.add("reproducible", flag([](auto& s) -> auto& { return s.reproducible; }), "off",
          "rasters and pictures are the same bytes every time (a report holds times)");

    t.group(KeyGroup::talk, false);
    {
        Key& c = t.add("config", config(), "", "GDAL configuration option; may be repeated");
        c.repeatable = true;
        c.commands |= command_info | command_tile;
    }
    t.add("profile", flag([](auto& s) -> auto& { return s.profile; }), "off",
          "tables on stderr: CPU by stage, waits, posts, bytes and memory of each wedge; and how far each stage is "
          "from what this machine can do");
    t.add("verbose", flag([](auto& s) -> auto& { return s.verbose; }), "off", "the first of these tables");
    {
        Key& q = t.add("quiet", flag([](auto& s) -> auto& { return s.quiet; }), "off", "no progress and no remarks");
        q.letter = 'q';
        q.commands |= command_info | command_tile | command_evaluate;
    }
    {
        Key& v = t.add("verify", flag([](auto& s) -> auto& { return s.verify; }), "off",
                       "read all of a tile store and name what is damaged");
        v.commands = command_info;
        v.in_scene_file = false;
    }
    {
        Key& l = t.add("list", flag([](auto& s) -> auto& { return s.list; }), "off",
                       "the models, or one model's inputs, ranges, outputs and source");
        l.commands = command_evaluate;
        l.in_scene_file = false;
    }
    {
        Key& j = t.add("json", flag([](auto& s) -> auto& { return s.json; }), "off",
                       "JSON on stdout (evaluate: of the list)");
        j.commands = command_info | command_evaluate | command_budget;
        j.in_scene_file = false;
    }
    {
        Key& p = t.add("plan", flag([](auto& s) -> auto& { return s.plan; }), "off",
                       "wedges, chunks, bytes, memory and time of a simulation, without running it");
        p.commands = command_info;
        p.in_scene_file = false;
    }
    {
        Key& h = t.add("help", flag([](auto& s) -> auto& { return s.help; }), "off", "this page");
        h.letter = 'h';
        h.commands = command_simulate | command_info | command_help | command_tile | command_evaluate;
        h.in_scene_file = false;
    }
    std::vector<Key> keys = t.take();
    for (const char* name : {"culture-height",
                             "culture-height-scale",
                             "latlon",
                             "xy",
                             "altitude-msl",
                             "altitude-agl",
                             "altitude-hae",
                             "geoid-offset",
                             "heading",
                             "sector",
                             "range",
                             "range-start",
                             "geometry",
                             "earth",
                             "quality",
                             "max-error",
                             "spokes-per-post",
                             "spoke-lead",
                             "crossings",
                             "course",
                             "threads",
                             "memory",
                             "source",
                             "temp-dir",
                             "keep-map",
                             "no-cull",
                             "report",
                             "timeline",
                             "profile",
                             "verbose",
                             "of",
                             "co",
                             "overwrite",
                             "reproducible",
                             "config",
                             "quiet",
                             "help"})
        for (Key& key : keys)
            if (key.name == name) key.commands |= command_coverage;
    // Of the layer response.
    for (Key& key : keys)
        if (key.group == KeyGroup::antenna || key.group == KeyGroup::ground || key.group == KeyGroup::weather ||
            key.name == "set" || key.name == "frequency" || key.name == "transmit-power" || key.name == "gain" ||
            key.name == "losses" || key.name == "polarisation" || key.name == "culture" ||
            key.name == "culture-legend" || key.name == "material") {
            if (key.name == "far-shore") continue;  // of what a ray meets on its way, not of a post by itself
            key.commands |= command_coverage;
            key.of_response = true;
        }
    // The link budget of a cell of what simulate makes: all that decides on it, and how it is found.
    for (Key& key : keys) {
        const bool of_many = key.name == "track" || key.name == "scan-step" || key.name == "scan-period",
                   talks = key.name == "config" || key.name == "quiet" || key.name == "help",
                   decides =
                       key.group == KeyGroup::display ? key.name == "display" : key.changes_result || key.name == "set",
                   runs = key.name == "threads" || key.name == "memory" || key.name == "source" ||
                          key.name == "temp-dir" || key.name == "keep-map" || key.name == "no-cull" ||
                          key.name == "wedges";
        if ((key.commands & command_simulate) && !of_many &&
            (talks || runs || decides || key.group == KeyGroup::data_base))
            key.commands |= command_budget;
    }
    // What follows the echo image, and what the picture takes from the scene beside: the rest needs a new sweep.
    for (Key& key : keys) {
        if (key.after_echo || key.group == KeyGroup::errors) key.commands |= command_scope;
        if (key.group == KeyGroup::data_base) key.needs_sweep = "the echo image holds what was seen of its data base";
        if (key.group == KeyGroup::weather) key.needs_sweep = "what is lost on the way is in every piece of the echo";
        if (key.group == KeyGroup::antenna) key.needs_sweep = "the pattern in elevation weighs every piece of ground";
    }
    const auto keys_of = [&](std::initializer_list<const char*> names, const auto& change) {
        for (const char* name : names)
            for (Key& key : keys)
                if (key.name == name) change(key);
    };
    keys_of({"heading",   "sector",    "azimuth-bins",    "range-bin", "pulse",      "noise-figure",
             "bandwidth", "beam",      "azimuth-pattern", "display",   "threads",    "memory",
             "output",    "power",     "states",          "report",    "power-unit", "of",
             "co",        "overwrite", "reproducible",    "config",    "quiet",      "help"},
            [](Key& key) {
                key.commands |= command_scope;
                key.needs_sweep.clear();
            });
    const auto because = [&](std::initializer_list<const char*> names, const char* reason) {
        keys_of(names, [&](Key& key) { key.needs_sweep = reason; });
    };
    because({"latlon", "xy", "altitude-msl", "altitude-agl", "altitude-hae", "geoid-offset"},
            "what is seen depends on where the sensor stands");
    because({"scan-step", "scan-period"}, "an echo image is seen from one place");
    because({"geometry", "earth"}, "it decides what the spokes meet and what hides it");
    because({"range"}, "how densely the ground is sampled follows from it");
    because({"range-start"}, "ground that its near edge cuts is added up in other pieces");
    because({"quality", "max-error", "spokes-per-post", "spokes-per-bin", "spoke-lead", "crossings", "course", "refine",
             "detail"},
            "it decides how the ground is sampled");
    because({"frequency", "transmit-power", "gain", "losses"},
            "the echo's watts hold it, and would be rounded otherwise (if-gain brightens the picture as well)");
    because({"gamma"}, "it is what every piece of ground returns");
    because({"polarisation", "backscatter", "water", "sea-state", "wind-direction", "far-shore", "walls"},
            "it decides what every piece of ground returns");
    return keys;
}

}  // namespace

const char* title(KeyGroup group) {
    switch (group) {
        case KeyGroup::data_base:
            return "Data base";
        case KeyGroup::position:
            return "Position";
        case KeyGroup::look:
            return "Look";
        case KeyGroup::coverage:
            return "Coverage";
        case KeyGroup::radar:
            return "Radar";
        case KeyGroup::antenna:
            return "Antenna";
        case KeyGroup::ground:
            return "Backscatter";
        case KeyGroup::weather:
            return "Weather";
        case KeyGroup::receiver:
            return "Receiver";
        case KeyGroup::errors:
            return "The radar's own errors";
        case KeyGroup::display:
            return "Display";
        case KeyGroup::run:
            return "Run";
        case KeyGroup::output:
            return "Output";
        case KeyGroup::talk:
            return "General";
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

}  // namespace wedgescope
