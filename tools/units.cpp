#include "tools/units.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <system_error>

#include "lib/length.hpp"
#include "lib/lower_case.hpp"

namespace wedgescope {
namespace {

/// Value in SI = number x factor x 10^exponent (+ offset); decibels over a watt or a milliwatt are logarithmic.
struct Unit {
    const char* name;
    double factor = 1;
    int exponent = 0;
    double offset = 0;
    bool logarithmic = false;  ///< 10^(0.1 (number + offset))
};

constexpr double radians_per_degree = std::numbers::pi / 180;  // the expression of Angle::degrees: the same bits

constexpr Unit lengths[] = {
    {"m"}, {"km", 1, 3}, {"ft", foot_m}, {"kft", 304.8}, {"nmi", nautical_mile_m}, {"mi", 1609.344}, {"yd", 0.9144}};
constexpr Unit times[] = {{"s"}, {"ms", 1, -3}, {"us", 1, -6}, {"ns", 1, -9}};
constexpr Unit frequencies[] = {{"Hz"}, {"kHz", 1, 3}, {"MHz", 1, 6}, {"GHz", 1, 9}};
constexpr Unit powers[] = {
    {"W"}, {"kW", 1, 3}, {"MW", 1, 6}, {"mW", 1, -3}, {"dBm", 1, 0, -30, true}, {"dBW", 1, 0, 0, true}};
constexpr Unit levels[] = {{"dBm"}, {"dBW", 1, 0, 30}};
constexpr Unit angles[] = {{"rad"}, {"deg", radians_per_degree}, {"mrad", 1, -3}, {"arcmin", radians_per_degree / 60}};
constexpr Unit decibels[] = {{"dB"}};
constexpr Unit sizes[] = {
    {"B"},        {"KiB", 1024.0}, {"MiB", 1048576.0}, {"GiB", 1073741824.0}, {"TiB", 1099511627776.0},
    {"kB", 1, 3}, {"MB", 1, 6},    {"GB", 1, 9}};

constexpr Unit rain_rates[] = {{"mm/h"}, {"in/h", 25.4}};
constexpr Unit densities[] = {{"g/m3"}, {"g/m^3"}, {"kg/m3", 1, 3}};

/// In the order of Dimension.
struct DimensionWords {
    Dimension dimension;
    const char *value, *noun;
    std::span<const Unit> units;
};
constexpr DimensionWords dimensions[] = {{Dimension::length, "LENGTH", "a length", lengths},
                                         {Dimension::time, "TIME", "a time", times},
                                         {Dimension::frequency, "FREQUENCY", "a frequency", frequencies},
                                         {Dimension::power, "POWER", "a power", powers},
                                         {Dimension::level, "LEVEL", "a power level", levels},
                                         {Dimension::angle, "ANGLE", "an angle", angles},
                                         {Dimension::decibel, "DECIBELS", "a ratio", decibels},
                                         {Dimension::bytes, "BYTES", "a number of bytes", sizes},
                                         {Dimension::rain_rate, "RATE", "a rain rate", rain_rates},
                                         {Dimension::density, "DENSITY", "a density", densities}};
static_assert(std::size(dimensions) == static_cast<std::size_t>(last_dimension) + 1);
static_assert([] {
    for (std::size_t i = 0; i < std::size(dimensions); ++i)
        if (dimensions[i].dimension != static_cast<Dimension>(i)) return false;
    return true;
}());
constexpr const DimensionWords& words_of(Dimension dimension) {
    return dimensions[static_cast<std::size_t>(dimension)];
}

std::span<const Unit> units(Dimension dimension) { return words_of(dimension).units; }

/// What the user meets first in messages and help: degrees before radians.
std::string_view first_unit(Dimension dimension) {
    return dimension == Dimension::angle ? "deg" : units(dimension)[0].name;
}

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

/// The decimal number at the head of `token`: its text (without a leading +), its value, and what follows it.
struct Head {
    std::string_view digits;
    std::string_view rest;
    double value = 0;
    bool fits = true;  ///< false: too large or too small for a double
};

std::optional<Head> leading_number(std::string_view token) {
    if (token.starts_with('+')) {
        token.remove_prefix(1);
        if (token.starts_with('-')) return std::nullopt;
    }
    Head head;
    const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), head.value);
    if (error == std::errc::invalid_argument) return std::nullopt;
    head.digits = token.substr(0, static_cast<std::size_t>(end - token.data()));
    // from_chars also reads the words nan and inf; a number here begins with a digit or a point.
    const std::string_view unsigned_digits = head.digits.substr(head.digits.starts_with('-') ? 1 : 0);
    if (unsigned_digits.empty() ||
        !(unsigned_digits[0] == '.' || (unsigned_digits[0] >= '0' && unsigned_digits[0] <= '9')))
        return std::nullopt;
    head.fits = error == std::errc{};
    head.rest = token.substr(head.digits.size());
    return head;
}

/// digits x 10^exponent, rounded once. The digits fit a double and are not 0, which bounds their own exponent.
std::optional<double> shifted(std::string_view digits, int exponent) {
    std::string number(digits);
    long own = 0;
    if (const auto e = number.find_first_of("eE"); e != std::string::npos) {
        std::string_view tail = std::string_view(number).substr(e + 1);
        if (tail.starts_with('+')) tail.remove_prefix(1);
        if (std::from_chars(tail.data(), tail.data() + tail.size(), own).ec != std::errc{}) return std::nullopt;
        number.resize(e);
    }
    number += text("e", own + exponent);
    double value = 0;
    if (std::from_chars(number.data(), number.data() + number.size(), value).ec != std::errc{}) return std::nullopt;
    return value;
}

std::optional<double> in_si(const Unit& unit, const Head& head) {
    if (!head.fits) return std::nullopt;
    std::optional<double> value = head.value;
    if (unit.exponent != 0 && head.value != 0) value = shifted(head.digits, unit.exponent);
    if (!value) return std::nullopt;
    *value = unit.logarithmic ? std::pow(10.0, 0.1 * (*value + unit.offset)) : *value * unit.factor + unit.offset;
    if (!std::isfinite(*value)) return std::nullopt;
    return value;
}

[[noreturn]] void refuse(std::string_view key, std::string_view token, const std::string& accepted) {
    throw InputError(text(key, " is ", in_quotes(token), "; ", accepted));
}

std::string too_large() { return "that is too large or too small a number"; }

}  // namespace

std::string_view trimmed(std::string_view token) {
    while (!token.empty() && is_blank(token.front())) token.remove_prefix(1);
    while (!token.empty() && is_blank(token.back())) token.remove_suffix(1);
    return token;
}

const char* value_word(Dimension dimension) { return words_of(dimension).value; }

const char* noun(Dimension dimension) { return words_of(dimension).noun; }

std::string unit_list(Dimension dimension) {
    std::string list(first_unit(dimension));
    for (const Unit& unit : units(dimension)) {
        if (unit.name != first_unit(dimension)) list += text(", ", unit.name);
    }
    return list;
}

std::optional<double> read_quantity(Dimension dimension, std::string_view token, std::string_view unit_of_bare) {
    const auto head = leading_number(trimmed(token));
    if (!head) return std::nullopt;
    std::string_view name = trimmed(head->rest);
    if (name.empty()) name = unit_of_bare;
    if (name.empty()) return head->fits && head->value == 0 ? std::optional(0.0) : std::nullopt;
    for (const Unit& unit : units(dimension))
        if (name == unit.name) return in_si(unit, *head);
    return std::nullopt;
}

std::optional<Dimension> dimension_of(std::string_view unit) {
    for (const Dimension dimension :
         {Dimension::length, Dimension::time, Dimension::frequency, Dimension::level, Dimension::power,
          Dimension::angle, Dimension::decibel, Dimension::bytes, Dimension::rain_rate, Dimension::density})
        if (has_unit(dimension, unit)) return dimension;
    return std::nullopt;
}

bool has_unit(Dimension dimension, std::string_view name) {
    for (const Unit& unit : units(dimension))
        if (name == unit.name) return true;
    return false;
}

double in_unit(Dimension dimension, std::string_view name, double value) {
    for (const Unit& unit : units(dimension)) {
        if (name != unit.name) continue;
        if (unit.logarithmic) return 10 * std::log10(value) - unit.offset;
        // Divided by the factor as a whole: 16.5e9 Hz are exactly 16.5 GHz.
        const double scale = std::pow(10.0, std::abs(unit.exponent));
        const double number = (value - unit.offset) / unit.factor;
        return unit.exponent < 0 ? number * scale : number / scale;
    }
    throw InputError(text("unit is ", in_quotes(name), "; it must be one of ", unit_list(dimension)));
}

double parse_quantity(Dimension dimension, std::string_view key, std::string_view token) {
    if (const auto value = read_quantity(dimension, token, "")) return *value;
    const std::string accepted = text(noun(dimension), " with its unit is needed (", unit_list(dimension), ")");
    const auto head = leading_number(trimmed(token));
    if (!head) refuse(key, token, accepted);
    const std::string_view name = trimmed(head->rest);
    if (name.empty()) refuse(key, token, text("a bare number is not accepted: ", accepted));
    if (has_unit(dimension, name)) refuse(key, token, too_large());
    refuse(key, token, text("unknown unit ", in_quotes(name), ": ", accepted));
}

double parse_quantity_or_number(Dimension dimension, std::string_view key, std::string_view token,
                                const std::string& unit) {
    const auto head = leading_number(trimmed(token));
    const bool bare = head && trimmed(head->rest).empty();
    if (!head)
        refuse(key, token,
               text(noun(dimension), " is needed, in ", unit, " or with its unit (", unit_list(dimension), ")"));
    return parse_quantity(dimension, key, bare ? std::string(trimmed(token)) + unit : std::string(token));
}

std::string quantity_text(Dimension dimension, double value) {
    if (value == 0) return text(0, first_unit(dimension));
    const auto is_first = [&](const Unit& unit) { return unit.name == first_unit(dimension); };
    // The base unit always reads back exactly; another one is taken where it does too and is shorter to read.
    // Angles are in degrees wherever possible.
    std::string best = text(value, units(dimension)[0].name);
    bool best_is_first = dimension != Dimension::angle;
    const auto consider = [&](const Unit& unit, const std::string& candidate) {
        // 30nmi and 7000ft read well, odd multiples of them do not.
        const bool si = dimension != Dimension::length || unit.factor == 1;
        const bool better = dimension == Dimension::angle && is_first(unit) != best_is_first
                                ? is_first(unit)
                                : candidate.size() < best.size() && (si || candidate.size() <= 8);
        if (!better) return;
        const auto head = leading_number(candidate);
        if (!head || head->rest != unit.name || in_si(unit, *head) != value) return;
        best = candidate;
        best_is_first = is_first(unit);
    };
    for (const Unit& unit : units(dimension)) {
        // 7000ft is how people say it, and nobody measures ranges in yards.
        const std::string_view name = unit.name;
        if (unit.logarithmic || name == "kft" || name == "yd" || name == "mi") continue;
        const double number = unit.exponent < 0 ? value * std::pow(10.0, -unit.exponent)
                                                : (value - unit.offset) / (unit.factor * std::pow(10.0, unit.exponent));
        consider(unit, fmt::format("{:.15g}{}", number, unit.name));
        consider(unit, fmt::format("{}{}", number, unit.name));
        // A product with the factor may skip the value itself: look at the neighbours.
        constexpr double infinity = std::numeric_limits<double>::infinity();
        consider(unit, fmt::format("{}{}", std::nextafter(number, infinity), unit.name));
        consider(unit, fmt::format("{}{}", std::nextafter(number, -infinity), unit.name));
    }
    return best;
}

double parse_number(std::string_view key, std::string_view token) {
    const auto head = leading_number(trimmed(token));
    if (!head || !head->rest.empty()) refuse(key, token, "a plain number is needed");
    if (!head->fits) refuse(key, token, too_large());
    return head->value;
}

std::optional<double> read_number(std::string_view token) {
    token = trimmed(token);
    const auto head = leading_number(token);
    if (!head || !head->fits) return std::nullopt;
    if (head->rest.empty()) return head->value;
    if (head->rest.front() != '/') return std::nullopt;
    const auto below = leading_number(head->rest.substr(1));
    if (!below || !below->fits || !below->rest.empty()) return std::nullopt;
    const double ratio = head->value / below->value;
    return std::isfinite(ratio) ? std::optional(ratio) : std::nullopt;
}

std::int64_t parse_count(std::string_view key, std::string_view token, std::int64_t low, std::int64_t high) {
    const std::string_view digits = trimmed(token);
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc{} || end != digits.data() + digits.size() || value < low || value > high) {
        refuse(key, token, text("a whole number from ", low, " to ", high, " is needed"));
    }
    return value;
}

std::uint64_t parse_unsigned(std::string_view key, std::string_view token) {
    const std::string_view digits = trimmed(token);
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc{} || end != digits.data() + digits.size()) {
        refuse(key, token, text("a whole number from 0 to ", std::numeric_limits<std::uint64_t>::max(), " is needed"));
    }
    return value;
}

bool parse_switch(std::string_view key, std::string_view token) {
    const std::string_view word = trimmed(token);
    if (same_letters(word, "on") || same_letters(word, "true")) return true;
    if (same_letters(word, "off") || same_letters(word, "false")) return false;
    refuse(key, token, "it must be on or off");
}

}  // namespace wedgescope
