// Model: a formula of the library as the calculator `evaluate` has it: its inputs with units and ranges, its outputs, where
// it comes from, and the function. Columns, messages, checks and lists are all made from these entries.
// Leaves which models there are to models.hpp and tables of values to evaluate.cpp.
#pragma once
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "lib/angle.hpp"
#include "lib/decibel.hpp"
#include "lib/error.hpp"
#include "lib/sensor.hpp"
#include "tools/units.hpp"

namespace wedgescope {

/// What a model takes: a number in a range, some words, or either. Made by number(), above() and one_of().
struct ModelInput {
    std::string name;  ///< the symbol of docs/physics.md, in ASCII
    std::string unit;  ///< that the range is in; empty: a plain number
    std::string meaning;
    bool numeric = true;
    double low = 0, high = 0;  ///< of the range, in `unit`
    bool above_low = false;    ///< `low` itself is refused
    std::vector<std::string> words;
    bool antenna_file = false;  ///< beside words: NAME=FILE, which holds for all rows
    std::string fallback;       ///< what is taken where nothing is given, as a user would write it; empty: it is needed

    std::optional<Dimension> dimension;  ///< none: a plain number, or a unit that no other stands in for (hPa, degC)
    double low_si = 0, high_si = 0;

    ModelInput or_word(std::string word) &&;
    ModelInput or_antenna_file() &&;
    ModelInput by_default(std::string value) &&;
    ModelInput by_default(Angle value) &&;
    ModelInput by_default(Decibel value) &&;
    /// An SI value of the unit's dimension.
    ModelInput by_default(double value) &&;
};
/// From `low` to `high`, in `unit`.
ModelInput number(std::string name, std::string unit, std::string meaning, double low, double high);
/// The same without `low` itself.
ModelInput above(std::string name, std::string unit, std::string meaning, double low, double high);
ModelInput one_of(std::string name, std::string meaning, std::vector<std::string> words);

struct ModelOutput {
    std::string name;
    std::string unit;  ///< that it is written in; empty: a plain number
    std::string meaning;
};

/// A user's antenna file.
struct PatternFile {
    std::string path;
    std::vector<PatternPoint> points;
};

struct ModelValue {
    double number = 0;             ///< SI where the unit has a dimension, else in the unit
    std::optional<int> word = {};  ///< place among the input's words
    std::shared_ptr<const PatternFile> file = {};
};

/// The inputs of one evaluation, by name.
class Arguments {
public:
    Arguments(std::span<const ModelInput> inputs, std::span<const ModelValue> values)
        : inputs_(inputs), values_(values) {}
    /// SI where the unit has a dimension, else in the unit of the entry.
    double operator[](std::string_view name) const { return find(name).number; }
    Angle angle(std::string_view name) const { return Angle::radians(find(name).number); }
    Decibel decibel(std::string_view name) const { return Decibel(find(name).number); }
    /// The place of the word given among the input's words; none: it is a number.
    std::optional<int> word(std::string_view name) const { return find(name).word; }
    /// The antenna file given; none: it is a word.
    const PatternFile* file(std::string_view name) const { return find(name).file.get(); }

private:
    const ModelValue& find(std::string_view name) const;
    std::span<const ModelInput> inputs_;
    std::span<const ModelValue> values_;
};

/// Stands for a value that there is not (the decibels of nothing).
inline constexpr double no_value = std::numeric_limits<double>::quiet_NaN();
/// Of a power ratio, dB; no value for what is not above 0.
inline double db(double ratio) { return ratio > 0 ? Decibel::from_ratio(ratio).db() : no_value; }
/// dB over a milliwatt.
inline double dbm(double power_w) { return power_w > 0 ? db(power_w) + 30 : no_value; }
/// What a model throws where its inputs, all of them in range, have no solution; says why.
class NoSolution : public InputError {
public:
    using InputError::InputError;
};

struct Model {
    std::string name;
    std::string summary;  ///< one line
    std::string source;   ///< section of docs/physics.md, source and confidence tag
    std::vector<ModelInput> inputs;
    std::vector<ModelOutput> outputs;
    /// Outputs in their order, SI where the unit has a dimension. NoSolution; an InputError of the library counts as one.
    std::vector<double> (*evaluate)(const Arguments&);
    std::string example;  ///< values as on the command line: "h=3000m"
};

/// "hs [m]", "k".
std::string column_name(const std::string& name, const std::string& unit);
/// What a user may write for an input: "a number with its unit (m, km, ft, ...) from 0 m to 1000 m, or flat". `column_unit`: of bare
/// numbers.
std::string accepted(const ModelInput& input, std::string_view column_unit = "");
/// Its range and words: "from 0 m to 1000 m, or flat".
std::string range_words(const ModelInput& input);
/// May numbers of this input be in that unit?
bool has_unit(const ModelInput& input, std::string_view unit);
/// The value a user wrote; a bare number is one of `column_unit` (empty: refused unless it is 0, but for plain numbers).
/// None where it is not what is accepted.
std::optional<ModelValue> read_value(const ModelInput& input, std::string_view token,
                                     std::string_view column_unit = "");
/// An output as a number in its unit.
double in_own_unit(const std::string& unit, double value);

}  // namespace wedgescope
