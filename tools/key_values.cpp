#include "tools/key_values.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "tools/antenna_file.hpp"
#include "tools/radar_set.hpp"
#include "tools/text_file.hpp"

namespace wedgescope::codecs {
namespace {

const char* const built_in_legends[] = {"fbfm40", "nlcd", "worldcover", "smc", own_legend};

/// Two values with one comma between them.
std::pair<std::string, std::string> two(const Given& given, const char* form) {
    const auto comma = given.value.find(',');
    if (comma != std::string::npos && given.value.find(',', comma + 1) == std::string::npos) {
        const std::string first = given.value.substr(0, comma), second = given.value.substr(comma + 1);
        if (!trimmed(first).empty() && !trimmed(second).empty()) return {first, second};
    }
    throw InputError(text(given.origin, " is ", in_quotes(given.value), "; it must be ", form));
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

std::pair<std::string, std::string> key_and_value(const Given& given) {
    const auto equals = given.value.find('=');
    if (equals == std::string::npos || equals == 0) {
        throw InputError(text(given.origin, " is ", in_quotes(given.value), "; it must be NAME=VALUE"));
    }
    return {given.value.substr(0, equals), given.value.substr(equals + 1)};
}

}  // namespace

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
        s.legend_text = std::make_shared<TextOfFile>();
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
    Codec codec{"FROM,TO|full", "each from -360deg to 360deg, wider than 1e-9deg", {}, {}};
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
        while (to < from) to += circle;
        const double width = to - from;
        if (!(width > circle * (Sector::least_width_deg / 360)) || width > circle * (1 + 1e-9)) {
            throw InputError(text(given.origin, " is ", in_quotes(given.value),
                                  "; the sector must be wider than 1e-9deg and at most 360deg"));
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

}  // namespace wedgescope::codecs
