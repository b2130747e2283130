// Units: numbers, counts and dimensioned values (`30nmi`, `7000ft`, `-90dBm`) as users write them -> SI, and back.
// Leaves which key takes what to options.hpp.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "lib/error.hpp"

namespace wedgescope {

enum class Dimension {
    length,     ///< m
    time,       ///< s
    frequency,  ///< Hz
    power,      ///< W
    level,      ///< dBm
    angle,      ///< rad
    decibel,    ///< dB
    bytes,      ///< B
    rain_rate,  ///< mm/h
    density,    ///< g/m^3
};
inline constexpr auto last_dimension = Dimension::density;

/// The word for a value of this dimension in help: LENGTH, TIME, ...
const char* value_word(Dimension dimension);
/// With its article, for messages: "a length".
const char* noun(Dimension dimension);
/// "m, km, ft, kft, nmi, mi, yd".
std::string unit_list(Dimension dimension);

/// The SI value of `token`. A bare number is refused unless it is 0; so are nan, inf, anything behind the unit, and
/// what does not fit a double. InputError, one line: `key`, what was found, the units accepted.
/// Powers of ten move the decimal exponent, so "0.5us" is the double nearest to 0.5e-6. The locale plays no part.
double parse_quantity(Dimension dimension, std::string_view key, std::string_view token);

/// The same, a bare number being one of `unit`: of columns and fields that say their unit once.
double parse_quantity_or_number(Dimension dimension, std::string_view key, std::string_view token,
                                const std::string& unit);

/// The same without a message: nothing where that refuses. `unit` empty: a bare number is refused unless it is 0.
std::optional<double> read_quantity(Dimension dimension, std::string_view token, std::string_view unit);

/// The dimension that has a unit of this name; dBm and dBW are levels here.
std::optional<Dimension> dimension_of(std::string_view unit);
/// Does the dimension have a unit of this name?
bool has_unit(Dimension dimension, std::string_view unit);
/// How many of the dimension's unit an SI value is.
double in_unit(Dimension dimension, std::string_view unit, double value);

/// The shortest text from which parse_quantity makes exactly `value` again. `value` finite.
std::string quantity_text(Dimension dimension, double value);

/// A plain finite number, the whole token. InputError.
double parse_number(std::string_view key, std::string_view token);
/// The same without a message; a ratio of two such numbers (4/3) too.
std::optional<double> read_number(std::string_view token);
/// A whole number from `low` to `high`, the whole token. InputError.
std::int64_t parse_count(std::string_view key, std::string_view token, std::int64_t low, std::int64_t high);
std::uint64_t parse_unsigned(std::string_view key, std::string_view token);
/// on, off, true, false. InputError.
bool parse_switch(std::string_view key, std::string_view token);

/// The text without white space at its ends.
std::string_view trimmed(std::string_view token);

}  // namespace wedgescope
