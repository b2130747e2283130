#include "tools/model.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lib/lower_case.hpp"

namespace wedgescope {
namespace {

/// A bound of the range as a user's value of the same digits becomes: the two compare equal.
double bound(const ModelInput& input, double value) {
    return input.dimension ? read_quantity(*input.dimension, text(value), input.unit).value() : value;
}

/// A bound for reading: 1000 GHz, not 1000000000000 Hz; 1e12 m^2.
std::string with_unit(const ModelInput& input, double value) {
    constexpr double many = 1e6, very_many = 1e9;
    const bool prefixed = input.dimension == Dimension::frequency || input.dimension == Dimension::power;
    if (prefixed && value >= many) {
        std::string words = quantity_text(*input.dimension, bound(input, value));
        words.insert(words.find_first_not_of(".0123456789"), " ");
        return words;
    }
    std::string number = text(value);
    if (const double power = std::round(std::log10(value)); value >= very_many && value == std::pow(10.0, power))
        number = text("1e", power);
    return input.unit.empty() ? number : text(number, " ", input.unit);
}

std::optional<double> number_of(const ModelInput& input, std::string_view token, std::string_view column_unit) {
    if (input.dimension) return read_quantity(*input.dimension, token, column_unit);
    if (input.unit.empty()) return read_number(token);
    token = trimmed(token);
    const bool own = token.ends_with(input.unit);
    if (own) token.remove_suffix(input.unit.size());
    const auto value = read_number(token);
    return value && (own || !column_unit.empty() || *value == 0) ? value : std::nullopt;
}

}  // namespace

ModelInput number(std::string name, std::string unit, std::string meaning, double low, double high) {
    ModelInput input;
    input.name = std::move(name);
    input.unit = std::move(unit);
    input.meaning = std::move(meaning);
    if (!input.unit.empty()) input.dimension = dimension_of(input.unit);
    input.low = low;
    input.high = high;
    input.low_si = bound(input, low);
    input.high_si = bound(input, high);
    return input;
}

ModelInput above(std::string name, std::string unit, std::string meaning, double low, double high) {
    ModelInput input = number(std::move(name), std::move(unit), std::move(meaning), low, high);
    input.above_low = true;
    return input;
}

ModelInput one_of(std::string name, std::string meaning, std::vector<std::string> words) {
    ModelInput input;
    input.name = std::move(name);
    input.meaning = std::move(meaning);
    input.numeric = false;
    input.words = std::move(words);
    return input;
}

ModelInput ModelInput::or_word(std::string word) && {
    words.push_back(std::move(word));
    return std::move(*this);
}

ModelInput ModelInput::or_antenna_file() && {
    antenna_file = true;
    return std::move(*this);
}

ModelInput ModelInput::by_default(std::string value) && {
    fallback = std::move(value);
    return std::move(*this);
}

ModelInput ModelInput::by_default(double value) && {
    fallback = dimension ? quantity_text(*dimension, value) : text(value, unit);
    return std::move(*this);
}

ModelInput ModelInput::by_default(Angle value) && { return std::move(*this).by_default(value.rad()); }

ModelInput ModelInput::by_default(Decibel value) && { return std::move(*this).by_default(value.db()); }

const ModelValue& Arguments::find(std::string_view name) const {
    for (std::size_t i = 0; i < inputs_.size(); ++i)
        if (inputs_[i].name == name) return values_[i];
    throw Error(text("a model asks for ", in_quotes(name), ", which is none of its inputs"));
}

std::string column_name(const std::string& name, const std::string& unit) {
    return unit.empty() ? name : text(name, " [", unit, "]");
}

std::string range_words(const ModelInput& input) {
    std::string out;
    if (input.numeric)
        out = text(input.above_low ? "above " : "from ", with_unit(input, input.low),
                   input.above_low ? " and at most " : " to ", with_unit(input, input.high));
    for (std::size_t i = 0; i < input.words.size(); ++i)
        out += text(out.empty() ? "" : i + 1 == input.words.size() ? " or " : ", ", input.words[i]);
    return out;
}

std::string accepted(const ModelInput& input, std::string_view column_unit) {
    if (!input.numeric) return text(input.words.size() > 1 ? "one of " : "", range_words(input));
    std::string out = "a number";
    if (!input.unit.empty())
        out += text(column_unit.empty() ? " with its unit (" : text(" (", column_unit, "), or one with a unit ("),
                    input.dimension ? unit_list(*input.dimension) : input.unit, ")");
    return text(out, " ", range_words(input));
}

bool has_unit(const ModelInput& input, std::string_view unit) {
    return input.dimension ? has_unit(*input.dimension, unit) : !unit.empty() && unit == input.unit;
}

std::optional<ModelValue> read_value(const ModelInput& input, std::string_view token, std::string_view column_unit) {
    const auto word = std::find_if(input.words.begin(), input.words.end(),
                                   [&](const std::string& known) { return same_letters(trimmed(token), known); });
    if (word != input.words.end()) return ModelValue{no_value, static_cast<int>(word - input.words.begin())};
    if (!input.numeric) return std::nullopt;
    const auto value = number_of(input, token, column_unit);
    if (!value || !(input.above_low ? *value > input.low_si : *value >= input.low_si) || !(*value <= input.high_si))
        return std::nullopt;
    return ModelValue{*value, {}};
}

double in_own_unit(const std::string& unit, double value) {
    const auto dimension = unit.empty() ? std::nullopt : dimension_of(unit);
    return dimension ? in_unit(*dimension, unit, value) : value;
}

}  // namespace wedgescope
