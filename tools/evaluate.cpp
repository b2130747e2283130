// evaluate: any model of the library over a CSV table, row by row, or for values on the command line.
#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <istream>
#include <memory>
#include <nlohmann/json.hpp>

#include "lib/error.hpp"
#include "tiles/output_file.hpp"
#include "tools/antenna_file.hpp"
#include "tools/commands.hpp"
#include "tools/help.hpp"
#include "tools/models.hpp"
#include "tools/near_words.hpp"
#include "tools/options.hpp"
#include "tools/run_files.hpp"
#include "tools/table_file.hpp"
#include "tools/table_stream.hpp"
#include "tools/terminal.hpp"

namespace wedgescope {
namespace {

/// A path as a cell of a table: in quotes where it holds what would end the cell.
std::string csv_cell(const std::string& path) {
    if (path.find_first_of(",\"#") == std::string::npos) return path;
    std::string cell = "\"";
    for (const char sign : path) cell.append(sign == '"' ? 2 : 1, sign);
    return cell + '"';
}

// ----------------------------------------------------------------------------------------------------- the list

std::string padded(std::string words, std::size_t width) {
    words.resize(std::max(words.size() + 2, width), ' ');
    return words;
}

/// A line of the description, or more of them where it is long.
std::string described(const std::string& name, const std::string& unit, const std::string& words) {
    const std::string head = "  " + padded(column_name(name, unit), 18);
    return text(head, wrapped(words, head.size()), "\n");
}

std::string description(const Model& model) {
    std::string out = text(model.name, ": ", model.summary, "\nsource: ", model.source, "\n\ninputs\n");
    for (const ModelInput& input : model.inputs)
        out += described(input.name, input.unit,
                         text(input.meaning, "; ", range_words(input),
                              input.fallback.empty() ? std::string() : text(" [", input.fallback, "]")));
    out += "\noutputs\n";
    for (const ModelOutput& output : model.outputs) out += described(output.name, output.unit, output.meaning);
    return out + text("\nexample\n  wedgescope evaluate ", model.name, " ", model.example, "\n");
}

nlohmann::ordered_json to_json(const Model& model, const char* family) {
    nlohmann::ordered_json entry = {{"name", model.name},       {"family", family},
                                    {"summary", model.summary}, {"source", model.source},
                                    {"example", model.example}, {"inputs", nlohmann::ordered_json::array()}};
    for (const ModelInput& input : model.inputs) {
        nlohmann::ordered_json item = {{"name", input.name}, {"unit", input.unit}, {"meaning", input.meaning}};
        if (input.numeric) {
            item[input.above_low ? "above" : "from"] = input.low;
            item["to"] = input.high;
        }
        if (!input.words.empty()) item["words"] = input.words;
        if (!input.fallback.empty()) item["default"] = input.fallback;
        entry["inputs"].push_back(std::move(item));
    }
    for (const ModelOutput& output : model.outputs)
        entry["outputs"].push_back({{"name", output.name}, {"unit", output.unit}, {"meaning", output.meaning}});
    return entry;
}

void list_models(const Settings& settings) {
    for (const auto& [key, given] : {std::pair("in", !settings.table.empty()),
                                     {"output (-o)", !settings.output.empty()},
                                     {"digits", settings.digits.has_value()}})
        if (given) throw InputError(text(key, " is given with list, which evaluates nothing and prints what there is"));
    if (settings.files.size() > 1)
        throw InputError(text("list takes one model at most; found ", settings.files.size()));
    const Model* only = settings.files.empty() ? nullptr : &model_by_name(settings.files[0]);
    if (settings.json) {
        nlohmann::ordered_json json = nlohmann::ordered_json::array();
        for (const ModelFamily& family : model_table())
            for (const Model& model : family.models)
                if (!only || &model == only) json.push_back(to_json(model, family.title));
        return print(json.dump(2) + "\n");
    }
    print(only ? description(*only)
               : model_list() + "\n'wedgescope evaluate --list MODEL' gives inputs, ranges, outputs and source.\n");
}

// ------------------------------------------------------------------------------------------------- one evaluation

/// Values of the inputs that stand behind the model's name; none where one is not given there.
using Fixed = std::vector<std::optional<ModelValue>>;

std::vector<std::string> names_of(const Model& model) {
    std::vector<std::string> names;
    for (const ModelInput& input : model.inputs) names.push_back(input.name);
    return names;
}

std::string listed(const std::vector<std::string>& words) {
    std::string out;
    for (const std::string& word : words) out += text(out.empty() ? "" : ", ", word);
    return out;
}

std::optional<std::size_t> input_named(const Model& model, std::string_view name) {
    for (std::size_t i = 0; i < model.inputs.size(); ++i)
        if (model.inputs[i].name == name) return i;
    return std::nullopt;
}

Fixed fixed_values(const Model& model, const std::vector<std::string>& words) {
    Fixed fixed(model.inputs.size());
    for (std::size_t w = 1; w < words.size(); ++w) {
        const std::string& word = words[w];
        const auto equals = word.find('=');
        if (equals == std::string::npos)
            throw InputError(text("found ", in_quotes(word), " behind the model ", model.name,
                                  "; accepted: NAME=VALUE (", listed(names_of(model)), "), and a table by --in"));
        const std::string name(trimmed(std::string_view(word).substr(0, equals)));
        const auto at = input_named(model, name);
        if (!at) {
            throw InputError(text(model.name, " has no input ", in_quotes(name), suggestion(name, names_of(model)),
                                  " (it has ", listed(names_of(model)), ")"));
        }
        if (fixed[*at]) throw InputError(text(name, " is given twice"));
        const std::string_view value = std::string_view(word).substr(equals + 1);
        fixed[*at] = read_value(model.inputs[*at], value);
        if (!fixed[*at] && model.inputs[*at].antenna_file && !trimmed(value).empty()) {
            const std::string path(trimmed(value));
            fixed[*at] = ModelValue{
                no_value, {}, std::make_shared<const PatternFile>(PatternFile{path, read_antenna_file(name, path)})};
        }
        if (!fixed[*at])
            throw InputError(text(name, " is ", in_quotes(value), "; it must be ", accepted(model.inputs[*at])));
    }
    return fixed;
}

/// Of an input that is given nowhere else.
std::optional<ModelValue> default_of(const ModelInput& input) {
    if (input.fallback.empty()) return std::nullopt;
    if (const auto value = read_value(input, input.fallback)) return value;
    throw Error(text("the default ", in_quotes(input.fallback), " of ", input.name, " is not accepted"));
}

/// Of inputs that are each in range. NoSolution where the library has none for them together, whatever its reason.
std::vector<double> outputs_of(const Model& model, std::span<const ModelValue> values) {
    std::vector<double> outputs;
    try {
        outputs = model.evaluate(Arguments(model.inputs, values));
    } catch (const NoSolution&) {
        throw;
    } catch (const InputError& e) {
        throw NoSolution(e.what());
    }
    if (outputs.size() != model.outputs.size())
        throw Error(text("model ", model.name, " makes ", outputs.size(), " values of ", model.outputs.size()));
    for (std::size_t i = 0; i < outputs.size(); ++i)
        if (std::isfinite(outputs[i])) outputs[i] = in_own_unit(model.outputs[i].unit, outputs[i]) + 0.0;  // never -0
    return outputs;
}

/// Round-trip digits, or so many.
std::string written(double value, const std::optional<std::int64_t>& digits) {
    return digits ? fmt::format("{:.{}g}", value, *digits) : text(value);
}

// ------------------------------------------------------------------------------------------------------- output

/// The results, to a file that appears when it is whole, or to standard output: without a path, or to -.
class Sink {
public:
    Sink(const std::string& path, bool overwrite) {
        if (path.empty() || path == "-") return;
        output_ = std::make_unique<OutputFile>(path, overwrite);
        errno = 0;
        file_.reset(std::fopen(output_->temporary_path().c_str(), "wb"));
        if (!file_) fail();
    }
    /// Rows before one that is refused go to standard output all the same; a file does not appear.
    ~Sink() {
        try {
            if (!output_) print(buffer_);
        } catch (const std::exception&) {  // who reads has gone away
        }
    }
    Sink(const Sink&) = delete;
    Sink& operator=(const Sink&) = delete;
    void add(std::string_view words) {
        buffer_ += words;
        if (buffer_.size() >= (std::size_t{1} << 16)) flush();
    }
    void finish() {
        flush();
        if (!file_) return;
        errno = 0;
        if (std::fclose(file_.release()) != 0) fail();
        output_->commit();
    }

private:
    void flush() {
        if (!output_) {
            print(buffer_);
        } else {
            errno = 0;
            if (std::fwrite(buffer_.data(), 1, buffer_.size(), file_.get()) != buffer_.size()) fail();
        }
        buffer_.clear();
    }
    [[noreturn]] void fail() const {
        throw IoError(text("output ", in_quotes(output_->final_path()), " cannot be written: ", stream_reason()));
    }
    struct Close {
        void operator()(std::FILE* file) const { std::fclose(file); }
    };
    std::unique_ptr<OutputFile> output_;  // removed after the file is closed
    std::unique_ptr<std::FILE, Close> file_;
    std::string buffer_;
};

// ------------------------------------------------------------------------------------------------- single values

/// InputError where the output would replace the table or a file of a pattern.
void check_output_name(const Fixed& fixed, const Settings& settings) {
    if (settings.output == "-") return;
    NamedPaths inputs{{"in", settings.table == "-" ? "" : settings.table}};
    for (const auto& value : fixed)
        if (value && value->file) inputs.emplace_back("antenna", value->file->path);
    check_names({{"output", settings.output}}, inputs);
}

void evaluate_once(const Model& model, const Fixed& fixed, const Settings& settings) {
    std::vector<ModelValue> values;
    std::vector<std::string> missing;
    for (std::size_t i = 0; i < model.inputs.size(); ++i) {
        const ModelInput& input = model.inputs[i];
        const auto value = fixed[i] ? fixed[i] : default_of(input);
        if (!value) missing.push_back(column_name(input.name, input.unit));
        values.push_back(value.value_or(ModelValue{}));
    }
    if (!missing.empty())
        throw InputError(
            text(model.name, " lacks ", listed(missing), "; give ", missing.size() > 1 ? "them" : "it",
                 " behind the model (NAME=VALUE, with a unit), or a table by --in (wedgescope evaluate --list ",
                 model.name, " describes its inputs)"));
    const std::vector<double> outputs = outputs_of(model, values);
    if (settings.output.empty()) {
        std::string out;
        for (std::size_t i = 0; i < outputs.size(); ++i) {
            const ModelOutput& output = model.outputs[i];
            out += text(output.name, " = ");
            if (std::isfinite(outputs[i]))
                out += text(written(outputs[i], settings.digits), output.unit.empty() ? "" : " ", output.unit, "\n");
            else
                out += "no value\n";
        }
        return print(out);
    }
    Sink sink(settings.output, settings.overwrite);
    std::string header, row;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const ModelInput& input = model.inputs[i];
        header += text(header.empty() ? "" : ",",
                       column_name(input.name, values[i].word || values[i].file ? "" : input.unit));
        row += text(row.empty() ? "" : ",", values[i].file   ? csv_cell(values[i].file->path)
                                            : values[i].word ? input.words[static_cast<std::size_t>(*values[i].word)]
                                                             : text(in_own_unit(input.unit, values[i].number)));
    }
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        header += text(",", column_name(model.outputs[i].name, model.outputs[i].unit));
        row += text(",", std::isfinite(outputs[i]) ? written(outputs[i], settings.digits) : std::string());
    }
    sink.add(header + "\n" + row + "\n");
    sink.finish();
}

// ------------------------------------------------------------------------------------------------------- a table

struct InputColumn {
    std::size_t input;
    std::size_t cell;
    std::string unit;  ///< of bare numbers; empty: plain numbers, or each cell has its own
};

class TableEvaluation {
public:
    TableEvaluation(const Model& model, Fixed fixed, std::string subject, std::istream& content)
        : model_(model), fixed_(std::move(fixed)), rows_(std::move(subject), content) {
        read_header();
    }

    /// Columns of the table that are neither inputs nor looked at.
    const std::vector<std::string>& passed_through() const { return passed_through_; }

    void run(Sink& sink, const std::optional<std::int64_t>& digits, const Stop& stop) {
        sink.add(header_);
        std::vector<ModelValue> values(model_.inputs.size());
        for (std::size_t i = 0; i < values.size(); ++i) values[i] = fixed_[i].value_or(ModelValue{});
        std::string line;
        while (rows_.next()) {
            stop.check();
            read_row(values);
            ++row_count_;
            line = rows_.row();
            for (const std::string& output : row_outputs(values, digits)) (line += ',') += output;
            line += '\n';
            sink.add(line);
        }
    }

    /// What lacks, for a remark; empty: nothing does.
    std::string lacking() const {
        if (lacking_rows_ == 0) return "";
        return text(rows_.subject(), ": ", lacking_rows_, lacking_rows_ == 1 ? " row of " : " rows of ", row_count_,
                    lacking_rows_ == 1 ? " lacks" : " lack", " values (empty cells), first line ", first_lacking_);
    }

private:
    [[noreturn]] void refuse_header(const std::string& what) const {
        throw InputError(text(rows_.subject(), ", line ", rows_.line(), ": ", what));
    }

    std::string columns_accepted() const {
        std::vector<std::string> names;
        for (std::size_t i = 0; i < model_.inputs.size(); ++i)
            if (!fixed_[i])
                names.push_back(text(column_name(model_.inputs[i].name, model_.inputs[i].unit),
                                     model_.inputs[i].fallback.empty() ? "" : " (may be left out)"));
        return names.empty() ? "none, all inputs are given behind the model" : listed(names);
    }

    void read_header() {
        if (!rows_.next())
            throw InputError(
                text(rows_.subject(), " is empty; accepted: a line that names the columns ", columns_accepted()));
        refuse_other_separators(rows_);
        const auto& cells = rows_.cells();
        cell_count_ = cells.size();
        header_ = rows_.row();
        std::vector<std::string> found;
        for (std::size_t cell = 0; cell < cells.size(); ++cell) {
            const auto open = unit_begins(cells[cell]);
            const std::string_view name = trimmed(cells[cell].substr(0, open));
            found.push_back(in_quotes(cells[cell]));
            for (const ModelOutput& output : model_.outputs)
                if (name == output.name)
                    refuse_header(text("column ", cell + 1, " is ", in_quotes(cells[cell]), ", which ", model_.name,
                                       " writes itself; accepted: another name for it"));
            const auto input = input_named(model_, name);
            if (!input) {
                passed_through_.emplace_back(in_quotes(cells[cell]));
                continue;
            }
            for (const InputColumn& column : columns_)
                if (column.input == *input)
                    refuse_header(text("column ", cell + 1, " is ", in_quotes(cells[cell]), ", and so is column ",
                                       column.cell + 1, "; accepted: one of them"));
            if (fixed_[*input])
                refuse_header(text("column ", cell + 1, " is ", in_quotes(cells[cell]), ", and ", name,
                                   " is given behind the model too; accepted: one of them"));
            columns_.push_back({*input, cell, unit_of(model_.inputs[*input], cells[cell], open)});
        }
        for (std::size_t i = 0; i < model_.inputs.size(); ++i) {
            const bool has = std::any_of(columns_.begin(), columns_.end(),
                                         [&](const InputColumn& column) { return column.input == i; });
            if (has || fixed_[i]) continue;
            fixed_[i] = default_of(model_.inputs[i]);
            const ModelInput& input = model_.inputs[i];
            if (!fixed_[i])
                refuse_header(text("no column is ", input.name, "; found ", listed(found), "; accepted: ",
                                   columns_accepted(), "; or ", input.name, "=VALUE behind the model for all rows"));
        }
        for (const ModelOutput& output : model_.outputs) header_ += text(",", column_name(output.name, output.unit));
        header_ += '\n';
    }

    /// Where the brackets of a column's unit open; round ones too, behind the name of an input and round a unit that it may have.
    std::size_t unit_begins(std::string_view cell) const {
        const auto open = cell.find('['), round = cell.rfind('(');
        if (open != std::string_view::npos || round == std::string_view::npos || !cell.ends_with(')')) return open;
        const auto input = input_named(model_, trimmed(cell.substr(0, round)));
        const std::string_view unit = trimmed(cell.substr(round + 1, cell.size() - round - 2));
        return input && has_unit(model_.inputs[*input], unit) ? round : open;
    }

    std::string unit_of(const ModelInput& input, std::string_view cell, std::size_t open) const {
        if (open == std::string_view::npos) return "";
        std::string_view unit = cell.substr(open + 1);
        const bool whole = unit.ends_with(cell[open] == '(' ? ')' : ']');
        if (whole) unit = trimmed(unit.substr(0, unit.size() - 1));
        if (whole && (has_unit(input, unit) || (unit.empty() && input.unit.empty()))) return std::string(unit);
        const std::string units = input.unit.empty() ? "no unit"
                                  : input.dimension  ? text("units ", unit_list(*input.dimension))
                                                     : text("unit ", input.unit);
        refuse_header(
            text("column ", in_quotes(cell), "; accepted: ", units, ", as in ", column_name(input.name, input.unit)));
    }

    void read_row(std::vector<ModelValue>& values) const {
        const auto& cells = rows_.cells();
        if (cells.size() != cell_count_)
            throw InputError(text(rows_.subject(), ", line ", rows_.line(), " has ", cells.size(),
                                  cells.size() == 1 ? " column" : " columns", "; accepted: ", cell_count_,
                                  ", as many as are named"));
        for (const InputColumn& column : columns_) {
            const ModelInput& input = model_.inputs[column.input];
            const std::string_view cell = cells[column.cell];
            const auto value = cell.empty() ? default_of(input) : read_value(input, cell, column.unit);
            if (!value)
                throw InputError(text(rows_.subject(), ", line ", rows_.line(), ", column ", input.name, " is ",
                                      cell.empty() ? "empty" : in_quotes(cell), "; it must be ",
                                      accepted(input, column.unit)));
            values[column.input] = *value;
        }
    }

    std::vector<std::string> row_outputs(const std::vector<ModelValue>& values,
                                         const std::optional<std::int64_t>& digits) {
        std::vector<std::string> out(model_.outputs.size());
        std::string why;
        try {
            const std::vector<double> outputs = outputs_of(model_, values);
            for (std::size_t i = 0; i < out.size(); ++i) {
                if (std::isfinite(outputs[i]))
                    out[i] = written(outputs[i], digits);
                else if (why.empty())
                    why = text(model_.outputs[i].name, " has no value there");
            }
        } catch (const NoSolution& e) {
            why = e.what();
        }
        if (!why.empty() && ++lacking_rows_ == 1) first_lacking_ = text(rows_.line(), ": ", why);
        return out;
    }

    const Model& model_;
    Fixed fixed_;
    TableRows rows_;
    std::vector<InputColumn> columns_;
    std::vector<std::string> passed_through_;
    std::size_t cell_count_ = 0;
    std::string header_;
    std::int64_t row_count_ = 0, lacking_rows_ = 0;
    std::string first_lacking_;
};

void evaluate_table(const Model& model, const Fixed& fixed, const Settings& settings, const Stop& stop) {
    const std::string& path = settings.table;
    const std::string subject = path == "-" ? "table on standard input" : text("table ", in_quotes(path));
    TableStream table(path, subject, stop);
    TableEvaluation evaluation(model, fixed, subject, table);
    Sink sink(settings.output, settings.overwrite);
    evaluation.run(sink, settings.digits, stop);
    sink.finish();
    // After the rows: what goes wrong with them is one line, alone.
    if (!evaluation.passed_through().empty())
        remark(settings.quiet, text(subject, ": columns that are no input of ", model.name,
                                    " stay as they are: ", listed(evaluation.passed_through())));
    if (const std::string lacking = evaluation.lacking(); !lacking.empty()) remark(settings.quiet, lacking);
}

}  // namespace

void evaluate(const std::vector<std::string>& arguments, Stop& stop) {
    const Settings settings = parse_arguments(command_evaluate, arguments);
    if (settings.help) return print(help_text(command_by_name("evaluate")));
    if (settings.json && !settings.list) throw InputError("json is given without list; results are a CSV table");
    if (settings.list) return list_models(settings);
    if (settings.files.empty()) throw InputError("no model is given; wedgescope evaluate --list names them all");
    const Model& model = model_by_name(settings.files[0]);
    const Fixed fixed = fixed_values(model, settings.files);
    check_output_name(fixed, settings);
    if (settings.table.empty()) return evaluate_once(model, fixed, settings);
    evaluate_table(model, fixed, settings, stop);
}

}  // namespace wedgescope
