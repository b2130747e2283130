// Codecs: how a kind of value is named in help, read as a user gives it, refused where it is out of bounds, and written
// again. Those of many keys: each works on the field of Settings that it is given.
// Leaves units to units.hpp, values of a single key to key_values.hpp and the keys to keys.hpp.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "lib/angle.hpp"
#include "lib/decibel.hpp"
#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "tools/keys.hpp"
#include "tools/units.hpp"

namespace wedgescope::codecs {

/// Bounds of a value, written as users write them; empty: none.
struct Limits {
    std::string low;
    bool above = false;  ///< `low` itself is refused
    std::string high;
    bool below = false;  ///< `high` itself is refused
};
inline Limits above(std::string low) { return {std::move(low), true, "", false}; }
inline Limits at_least(std::string low) { return {std::move(low), false, "", false}; }
inline Limits between(std::string low, std::string high) { return {std::move(low), false, std::move(high), false}; }
inline Limits above_to(std::string low, std::string high) { return {std::move(low), true, std::move(high), false}; }
/// As help and refusals have them.
std::string words(const Limits& limits);

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
inline void store(double& field, double v) { field = v; }
inline void store(std::optional<double>& field, double v) { field = v; }
inline void store(Angle& field, double v) { field = Angle::radians(v); }
inline void store(std::optional<Angle>& field, double v) { field = Angle::radians(v); }
inline void store(Decibel& field, double v) { field = Decibel(v); }
inline void store(std::optional<Decibel>& field, double v) { field = Decibel(v); }
inline void store(std::uint64_t& field, double v) { field = static_cast<std::uint64_t>(v); }
inline void store(std::int64_t& field, std::int64_t v) { field = v; }
inline void store(std::optional<std::int64_t>& field, std::int64_t v) { field = v; }
inline void store(int& field, std::int64_t v) { field = static_cast<int>(v); }
inline std::optional<double> load(double field) { return field; }
inline std::optional<double> load(const std::optional<double>& field) { return field; }
inline std::optional<double> load(Angle field) { return field.rad(); }
inline std::optional<double> load(const std::optional<Angle>& field) {
    return field ? std::optional(field->rad()) : std::nullopt;
}
inline std::optional<double> load(Decibel field) { return field.db(); }
inline std::optional<double> load(const std::optional<Decibel>& field) {
    return field ? std::optional(field->db()) : std::nullopt;
}
inline std::optional<double> load(std::uint64_t field) { return static_cast<double>(field); }

bool begins_with_letter(std::string_view text);

/// In SI units.
double parse_given(Dimension dimension, const Given& given);

/// What `parse` makes of the value. Where a word was given, the refusal ends with `others`, the words that would do.
template <class Parse>
auto parse_or_name(const Given& given, const std::string& others, Parse&& parse) {
    try {
        return parse();
    } catch (const InputError& e) {
        if (others.empty() || !begins_with_letter(trimmed(given.value))) throw;
        throw InputError(text(e.what(), ", or ", others));
    }
}

/// A dimensioned value; `absent` is the word for an empty optional (auto, off), `others` further words, for refusals.
template <class Field>
Codec quantity(Dimension dimension, const Limits& limits, Field field, const std::string& absent = "",
               std::string others = "") {
    others += (others.empty() || absent.empty() ? "" : ", ") + absent;
    Codec codec;
    codec.value = value_word(dimension) + (absent.empty() ? "" : "|" + absent);
    codec.accepted = words(limits);
    codec.set = [=](Settings& s, const Given& given) {
        auto& target = field(s);
        if constexpr (requires { target.reset(); }) {
            if (!absent.empty() && same_letters(trimmed(given.value), absent)) return target.reset();
        }
        const double v = parse_or_name(given, others, [&] { return parse_given(dimension, given); });
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
    std::string form, others;
    for (const auto& [word, value] : words_of) {
        form += word + "|";
        others += (others.empty() ? "" : ", ") + word;
    }
    Codec plain = quantity(dimension, limits, field, absent, others), codec = plain;
    codec.value = form + plain.value;
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
        const double v = parse_or_name(given, absent, [&] { return parse_number(given.origin, given.value); });
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
        store(target, parse_or_name(given, absent, [&] { return parse_count(given.origin, given.value, low, high); }));
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

/// A path in a scene file starts from the file's folder, unless it is absolute or an URL. So does the file in a driver's own
/// name for a part of it (NETCDF:"x.nc":v, /vsizip/x.zip/y.tif), if it lies there.
std::string resolved_path(const Given& given);

template <class Field>
Codec path(Field field) {
    Codec codec{"PATH", "", {}, {}};
    codec.set = [=](Settings& s, const Given& given) { field(s) = resolved_path(given); };
    codec.get = [=](const Settings& s) -> std::optional<std::string> {
        return field(s).empty() ? std::nullopt : std::optional<std::string>(field(s));
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

/// Any text but none; `value` is its word in help.
Codec word_of(std::string value, std::string Settings::*field);

}  // namespace wedgescope::codecs
