#include "lib/material.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <functional>
#include <set>
#include <utility>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"

namespace wedgescope {

extern const char* const shipped_classes;  // CMake makes it

namespace {

std::string_view without_blanks(std::string_view s) {
    constexpr std::string_view space = " \t\r\n";
    const std::size_t first = s.find_first_not_of(space);
    if (first == std::string_view::npos) return {};
    return s.substr(first, s.find_last_not_of(space) - first + 1);
}

/// Of a cell: without quotes too.
std::string_view trimmed(std::string_view s) {
    s = without_blanks(s);
    if (s.size() >= 2 && s.front() == '"' && s.back() == '"') return trimmed(s.substr(1, s.size() - 2));
    return s;
}

std::optional<int> integer(std::string_view s) {
    int value = 0;
    const auto [end, error] = std::from_chars(s.data(), s.data() + s.size(), value);
    if (error != std::errc() || end != s.data() + s.size() || s.empty()) return std::nullopt;
    return value;
}

struct CodeRange {
    int first, last;
    ClassId id;
};

template <std::size_t n>
Legend legend(const char* name, const CodeRange (&ranges)[n]) {
    std::map<int, ClassId> classes;
    for (const CodeRange& range : ranges)
        for (int code = range.first; code <= range.last; ++code) classes[code] = range.id;
    return Legend(name, std::move(classes));
}

// Physics 7.4: LANDFIRE's 40 fuel models of Scott & Burgan.
constexpr CodeRange fbfm40[] = {{91, 91, 10},  {92, 92, 1},   {93, 93, 6},   {98, 98, 0},  {99, 99, 4},
                                {101, 109, 5}, {121, 149, 7}, {161, 189, 8}, {201, 204, 8}};
// USGS NLCD 2016 / 2021.
constexpr CodeRange nlcd[] = {{11, 11, 0}, {12, 12, 1}, {21, 22, 10}, {23, 24, 11}, {31, 31, 2}, {41, 43, 8},
                              {51, 52, 7}, {71, 74, 5}, {81, 81, 5},  {82, 82, 6},  {90, 90, 8}, {95, 95, 9}};
// ESA WorldCover v100 / v200.
constexpr CodeRange worldcover[] = {{10, 10, 8}, {20, 20, 7}, {30, 30, 5}, {40, 40, 6}, {50, 50, 11}, {60, 60, 2},
                                    {70, 70, 1}, {80, 80, 0}, {90, 90, 9}, {95, 95, 8}, {100, 100, 5}};
// DFAD surface material category.
constexpr CodeRange smc[] = {{1, 1, 15}, {2, 2, 14}, {3, 3, 11},  {4, 4, 10},  {5, 5, 4},   {6, 6, 0},   {7, 7, 2},
                             {8, 8, 3},  {9, 9, 12}, {10, 10, 4}, {11, 11, 9}, {12, 12, 8}, {13, 13, 1}, {14, 14, 13}};

// ------------------------------------------------------------------------------------------------- the class table

enum Column : std::size_t {
    name,
    gamma10,
    gamma_wall10,
    ulaby_dobson,
    permittivity,
    rms_height,
    directivity,
    axis,
    structures,
    structure_width,
    structure_height
};
constexpr std::array<const char*, 11> columns = {
    "name",        "gamma10_db", "gamma_wall10_db", "ulaby_dobson",      "soil_permittivity", "soil_rms_m",
    "directivity", "axis_deg",   "structures_km2",  "structure_width_m", "structure_height_m"};

constexpr std::pair<const char*, UlabyDobsonClass> ulaby_dobson_words[] = {
    {"soil", UlabyDobsonClass::soil},
    {"grass", UlabyDobsonClass::grass},
    {"shrubs", UlabyDobsonClass::shrubs},
    {"short", UlabyDobsonClass::short_vegetation}};

std::string column_names() {
    std::string names;
    for (const char* column : columns) {
        if (!names.empty()) names += ',';
        names += column;
    }
    return names;
}

/// In any case, as value attribute tables have them.
std::optional<ClassId> row_named(const std::vector<Material>& rows, std::string_view name) {
    for (std::size_t id = 0; id < rows.size(); ++id)
        if (same_letters(name, rows[id].name)) return static_cast<ClassId>(id);
    return std::nullopt;
}

std::optional<double> real(std::string_view s) {
    double value = 0;
    if (s.starts_with('+')) s.remove_prefix(1);
    const auto [end, error] = std::from_chars(s.data(), s.data() + s.size(), value);
    if (error != std::errc() || end != s.data() + s.size() || s.empty() || !std::isfinite(value)) return std::nullopt;
    return value;
}

std::vector<std::string_view> cells_of(std::string_view line) {
    std::vector<std::string_view> cells;
    for (;;) {
        const std::size_t comma = line.find(',');
        cells.push_back(trimmed(line.substr(0, comma)));
        if (comma == std::string_view::npos) return cells;
        line.remove_prefix(comma + 1);
    }
}

bool is_word(std::string_view s) {
    if (s.empty() || s.size() > Materials::longest_name || !std::isalpha(static_cast<unsigned char>(s.front())))
        return false;
    return std::all_of(s.begin(), s.end(),
                       [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_'; });
}

/// A row as add_rows() reads it.
std::string row_text(const Material& m) {
    std::string out = m.name;
    const auto cell = [&](const auto&... parts) {
        out += ',';
        out += text(parts...);
    };
    const auto number = [&](const std::optional<double>& value) { value ? cell(*value) : cell(""); };
    number(m.gamma10_db);
    number(m.gamma_wall10_db);
    const char* vegetation = "";
    for (const auto& [word, id] : ulaby_dobson_words)
        if (m.ulaby_dobson == id) vegetation = word;
    cell(vegetation);
    if (m.bare_soil) {
        cell(m.bare_soil->permittivity.real(), " ", std::fabs(m.bare_soil->permittivity.imag()));
        cell(m.bare_soil->rms_height_m);
    } else {
        out += ",,";
    }
    cell(word(m.directivity));
    cell(m.axis_deg);
    if (m.structures)
        cell(m.structures->number_km2, ",", m.structures->width_m, ",", m.structures->height_m);
    else
        out += ",,,";
    return out;
}

/// One row of a table being read.
class RowReader {
public:
    RowReader(const std::string& where, Material& row) : where_(where), row_(row) {}

    void set(Column column, std::string_view cell) {
        switch (column) {
            case name:
                return;
            case gamma10:
                row_.gamma10_db = number(column, cell, -100, 100, "dB, or nothing");
                return;
            case gamma_wall10:
                row_.gamma_wall10_db = number(column, cell, -100, 100, "dB, or nothing");
                return;
            case ulaby_dobson:
                row_.ulaby_dobson.reset();
                for (const auto& [word, id] : ulaby_dobson_words)
                    if (cell == word) row_.ulaby_dobson = id;
                if (!row_.ulaby_dobson && !cell.empty()) refuse(column, cell, "soil, grass, shrubs, short or nothing");
                return;
            case permittivity:
                permittivity_ = cell;
                return;
            case rms_height:
                rms_ = cell;
                return;
            case directivity:
                sided_ = !cell.empty();
                row_.directivity = Directivity::omni;
                for (const Directivity one : {Directivity::omni, Directivity::uni, Directivity::bi})
                    if (cell == word(one)) row_.directivity = one;
                if (cell != word(row_.directivity) && !cell.empty()) refuse(column, cell, "omni, uni, bi or nothing");
                return;
            case axis:
                axis_ = !cell.empty();
                row_.axis_deg = number(column, cell, -360, 360, "degrees, or nothing").value_or(0);
                return;
            case structures:
                structures_[0] = Given{cell, number(column, cell, 1e-3, 1e6, "a square kilometre, or nothing")};
                return;
            case structure_width:
                structures_[1] = Given{cell, number(column, cell, 1e-3, 1e3, "metres, or nothing")};
                return;
            case structure_height:
                structures_[2] = Given{cell, number(column, cell, 1e-3, 1e3, "metres, or nothing")};
                return;
        }
    }

    void finish() {
        finish_soil();
        finish_structures();
        if (row_.directivity != Directivity::omni && sided_ && !axis_)
            throw InputError(text(where_, ": ", in_quotes(row_.name), " is ", word(row_.directivity),
                                  " without an axis_deg; it needs the azimuth of its reflecting side"));
        // Without gamma it is water to every model, whatever stands on it.
        if (row_.gamma10_db || !(row_.ulaby_dobson || row_.bare_soil)) return;
        throw InputError(text(where_, ": ", in_quotes(row_.name), " has ",
                              row_.ulaby_dobson ? "an ulaby_dobson" : "a soil_permittivity",
                              " and no gamma10_db; a class without gamma10_db is water"));
    }

private:
    /// Permittivity and height of bare soil count together.
    void finish_soil() {
        if (!permittivity_ && !rms_) return;
        BareSoil soil = row_.bare_soil.value_or(BareSoil{});
        const bool had = row_.bare_soil.has_value();
        const bool no_permittivity = permittivity_ ? permittivity_->empty() : !had;
        const bool no_rms = rms_ ? rms_->empty() : !had;
        if (no_permittivity != no_rms)
            throw InputError(
                text(where_, ": of soil_permittivity and soil_rms_m one is given; accepted: both, or neither"));
        row_.bare_soil.reset();
        if (no_permittivity) return;
        if (permittivity_) soil.permittivity = permittivity_of(*permittivity_);
        if (rms_) {
            soil.rms_height_m = *number(rms_height, *rms_, 0, 1, "metres");
            if (soil.rms_height_m == 0) refuse(rms_height, *rms_, "above 0 metres");
        }
        row_.bare_soil = soil;
    }
    /// And so do number, width and height of structures.
    void finish_structures() {
        if (!structures_[0] && !structures_[1] && !structures_[2]) return;
        std::array<std::optional<double>, 3> whole;
        if (row_.structures) whole = {row_.structures->number_km2, row_.structures->width_m, row_.structures->height_m};
        for (std::size_t i = 0; i < whole.size(); ++i)
            if (structures_[i]) whole[i] = structures_[i]->value;
        const auto given = std::count_if(whole.begin(), whole.end(), [](const auto& one) { return one.has_value(); });
        if (given != 0 && given != 3)
            throw InputError(text(where_, ": of structures_km2, structure_width_m and structure_height_m ", given,
                                  given == 1 ? " is" : " are", " given; accepted: all three, or none"));
        row_.structures.reset();
        if (given != 3) return;
        constexpr double most_shown = 10;  // square metres of wall over one of ground
        const double shown = *whole[0] * 1e-6 * *whole[1] * *whole[2];
        if (shown > most_shown)
            throw InputError(text(where_, ": structures show ", shown,
                                  " square metres of wall for each of ground; at most ", most_shown, " are accepted"));
        row_.structures = Structures{*whole[0], *whole[1], *whole[2]};
    }

    [[noreturn]] void refuse(Column column, std::string_view cell, const std::string& accepted) const {
        throw InputError(text(where_, ": ", columns[column], " is ", in_quotes(cell), "; it must be ", accepted));
    }
    std::optional<double> number(Column column, std::string_view cell, double low, double high,
                                 const char* unit) const {
        if (cell.empty()) return std::nullopt;
        const std::optional<double> value = real(cell);
        if (!value || !(*value >= low && *value <= high))
            refuse(column, cell, text("a number from ", low, " to ", high, ", ", unit));
        return value;
    }
    Permittivity permittivity_of(std::string_view cell) const {
        const std::size_t blank = cell.find(' ');
        const std::optional<double> e1 = real(cell.substr(0, blank));
        if (!e1) return permittivity_by_name(text(where_, ": soil_permittivity"), std::string(cell));
        const std::optional<double> e2 =
            blank == std::string_view::npos ? std::optional(0.0) : real(trimmed(cell.substr(blank)));
        if (!(*e1 >= 1 && *e1 <= 1000) || !e2 || !(*e2 >= 0 && *e2 <= 1000))
            refuse(permittivity, cell, "a word, or e' (1 to 1000) and e'' (0 to 1000) with a blank between");
        return {*e1, -*e2};
    }

    const std::string& where_;
    Material& row_;
    bool sided_ = false, axis_ = false;  // a directivity and an axis are given
    std::optional<std::string_view> permittivity_, rms_;
    struct Given {
        std::string_view cell;
        std::optional<double> value;
    };
    std::array<std::optional<Given>, 3> structures_;  // number, width, height
};

/// Replaces rows or adds them; how many it found.
std::size_t add_rows(std::vector<Material>& rows, const std::string& source, std::string_view content) {
    if (content.starts_with("\xEF\xBB\xBF")) content.remove_prefix(3);
    const bool one_line = is_inline_table(content);
    const char end_of_row = one_line ? ';' : '\n';
    std::vector<Column> order;
    for (std::size_t i = 0; i < columns.size(); ++i) order.push_back(static_cast<Column>(i));
    std::set<std::string, std::less<>> named;
    bool first_line = true;
    for (int line_number = 1; !content.empty(); ++line_number) {
        const std::size_t end = content.find(end_of_row);
        std::string_view line = content.substr(0, end);
        content = end == std::string_view::npos ? std::string_view{} : content.substr(end + 1);
        line = without_blanks(line.substr(0, line.find('#')));
        if (line.empty()) continue;
        const std::string where = text(source, one_line ? ", row " : ", line ", line_number);
        const auto fail = [&](const auto&... what) { throw InputError(text(where, ": ", what...)); };
        const std::vector<std::string_view> cells = cells_of(line);
        const bool is_first = std::exchange(first_line, false);
        if (is_first)
            for (std::size_t i = 1; i < cells.size(); ++i)
                if (same_letters(cells[i], columns[name]))
                    fail("column ", i + 1, " is ", in_quotes(cells[i]),
                         ", which must be the first; accepted: ", column_names());
        if (is_first && same_letters(cells.front(), columns[name])) {
            order.clear();
            for (const std::string_view cell : cells) {
                const auto at = std::find_if(columns.begin(), columns.end(),
                                             [&](const char* column) { return same_letters(cell, column); });
                if (at == columns.end())
                    fail("column ", order.size() + 1, " is ", in_quotes(cell), "; accepted: ", column_names());
                const auto column = static_cast<Column>(at - columns.begin());
                if (std::find(order.begin(), order.end(), column) != order.end())
                    fail("column ", order.size() + 1, " is ", in_quotes(cell), ", and so is one before");
                order.push_back(column);
            }
            continue;
        }
        if (cells.size() > order.size()) fail("there are ", cells.size(), " columns; accepted: at most ", order.size());
        const std::string_view word = cells.front();
        if (!is_word(word))
            fail("name is ", in_quotes(word), "; it must be a word of at most ", Materials::longest_name,
                 " letters, digits, - and _ that begins with a letter");
        std::optional<ClassId> id = row_named(rows, word);
        if (!named.emplace(id ? rows[*id].name : std::string(word)).second)
            fail(in_quotes(word), " has a row already; each class may have one");
        if (!id) {
            if (rows.size() == Materials::most)
                fail(in_quotes(word), " is one class too many; accepted: ", Materials::most, " with the shipped ones");
            rows.push_back({std::string(word), {}, {}});
            id = static_cast<ClassId>(rows.size() - 1);
        }
        RowReader reader(where, rows[*id]);
        for (std::size_t i = 0; i < cells.size(); ++i) reader.set(order[i], cells[i]);
        reader.finish();
    }
    return named.size();
}

}  // namespace

bool is_inline_table(std::string_view value) {
    return value.starts_with("name,") && value.find(';') != std::string_view::npos &&
           value.find('\n') == std::string_view::npos;
}

const std::vector<Material>& material_table() {
    static const Materials shipped;
    return shipped.rows();
}

ClassId material_by_name(const std::string& key, const std::string& name) { return Materials().by_name(key, name); }

Materials::Materials() {
    static const auto shipped = [] {
        std::vector<Material> rows;
        add_rows(rows, "docs/classes.csv", shipped_classes);
        return std::make_shared<const std::vector<Material>>(std::move(rows));
    }();
    rows_ = shipped;
}

Materials Materials::from_csv(const std::string& source, std::string_view content) {
    Materials out;
    std::vector<Material> rows = out.rows();
    if (add_rows(rows, source, content) == 0)
        throw InputError(text(source, " names no class; accepted: lines such as corn,-14, with the columns ",
                              column_names(), " or a line that names them"));
    out.take(std::move(rows));
    return out;
}

Materials Materials::with(const Material& row) const {
    std::vector<Material> rows = *rows_;
    if (const std::optional<ClassId> id = find(row.name)) {
        rows[*id] = row;
    } else {
        if (rows.size() == most)
            throw InputError(
                text(in_quotes(row.name), " is one class too many; accepted: ", most, " with the shipped ones"));
        rows.push_back(row);
    }
    Materials out;
    out.take(std::move(rows));
    return out;
}

void Materials::take(std::vector<Material> rows) {
    const Materials shipped;
    std::string own;
    for (std::size_t id = 0; id < rows.size(); ++id) {
        const std::string row = row_text(rows[id]);
        if (id >= shipped.size() || row != row_text(shipped[id])) own += ";" + row;
    }
    own_ = own.empty() ? "" : column_names() + own;
    rows_ = std::make_shared<const std::vector<Material>>(std::move(rows));
}

std::optional<ClassId> Materials::find(std::string_view name) const { return row_named(*rows_, name); }

ClassId Materials::by_name(const std::string& key, std::string_view name) const {
    if (const std::optional<ClassId> id = find(name)) return *id;
    throw InputError(text(key, " is ", in_quotes(name), "; it must be one of ", words()));
}

std::string Materials::words() const {
    std::string words;
    for (const Material& material : *rows_) words += (words.empty() ? "" : ", ") + material.name;
    return words;
}

std::vector<ClassGamma> gamma_table(const Materials& materials, double frequency_hz, std::optional<Decibel> constant) {
    const auto linear = [&](std::optional<double> gamma10_db) {
        return gamma10_db ? gamma_at(Decibel(*gamma10_db), frequency_hz).ratio() : 0;
    };
    std::vector<ClassGamma> gammas;
    for (const Material& material : materials.rows()) {
        if (constant)
            gammas.push_back({linear(constant->db()), linear(constant->db())});
        else
            gammas.push_back({linear(material.gamma10_db),
                              linear(material.gamma_wall10_db ? material.gamma_wall10_db : material.gamma10_db)});
    }
    return gammas;
}

std::vector<ClassGamma> gamma_table(double frequency_hz, std::optional<Decibel> constant) {
    return gamma_table(Materials(), frequency_hz, constant);
}

BackscatterLaw ground_law(const Material& material, LandModel model, double frequency_hz, Polarisation polarisation) {
    if (model == LandModel::ulaby_dobson && material.ulaby_dobson)
        return ulaby_dobson_law(*material.ulaby_dobson, frequency_hz, polarisation);
    if (model == LandModel::oh && material.bare_soil) return oh_law(*material.bare_soil, frequency_hz, polarisation);
    if (!material.gamma10_db) return BackscatterLaw::constant_gamma(0);
    return BackscatterLaw::constant_gamma(gamma_at(Decibel(*material.gamma10_db), frequency_hz).ratio());
}

Legend::Legend(std::string name, std::map<int, ClassId> classes)
    : name_(std::move(name)), classes_(std::move(classes)) {}

std::optional<Legend> Legend::built_in(const std::string& name) {
    if (name == "fbfm40") return legend("fbfm40", fbfm40);
    if (name == "nlcd") return legend("nlcd", nlcd);
    if (name == "worldcover") return legend("worldcover", worldcover);
    if (name == "smc") return legend("smc", smc);
    return std::nullopt;
}

Legend Legend::from_csv(const std::string& source, const std::string& content, const Materials& materials) {
    std::string_view rest = content;
    if (rest.starts_with("\xEF\xBB\xBF")) rest.remove_prefix(3);
    std::map<int, ClassId> classes;
    bool first_line = true;
    for (int number = 1; !rest.empty(); ++number) {
        const std::size_t end = rest.find('\n');
        const std::string_view line = without_blanks(rest.substr(0, rest.find_first_of("#\n")));
        rest = end == std::string_view::npos ? std::string_view{} : rest.substr(end + 1);
        if (line.empty()) continue;
        const bool header_allowed = std::exchange(first_line, false);

        const auto fail = [&](const std::string& what) {
            throw InputError(text(source, ", line ", number, ": ", what));
        };
        const std::size_t comma = line.find(',');
        if (comma == std::string_view::npos) fail(text(in_quotes(line), " has no comma; a line is code,material"));
        const std::string_view code_text = trimmed(line.substr(0, comma));
        const std::string_view name = trimmed(line.substr(comma + 1));
        const std::optional<int> code = integer(code_text);
        if (!code) {
            // A header has words on both sides; a mistyped code stands beside a material.
            if (header_allowed && !materials.find(name) && !integer(name)) continue;
            fail(text("code is ", in_quotes(code_text), "; it must be a whole number of 32 bits"));
        }
        std::optional<ClassId> id = materials.find(name);
        const std::optional<int> number_of_class = integer(name);
        if (!id && number_of_class && *number_of_class >= 0 && std::cmp_less(*number_of_class, materials.size()))
            id = static_cast<ClassId>(*number_of_class);
        if (!id)
            fail(text("material is ", in_quotes(name), "; it must be one of ", materials.words(),
                      ", or a class number from 0 to ", materials.size() - 1, " (class-table adds others)"));
        if (!classes.emplace(*code, *id).second)
            fail(text("code ", *code, " has a line already; each code may have one"));
    }
    if (classes.empty()) throw InputError(text(source, " names no code; it must hold lines code,material"));
    return Legend(source, std::move(classes));
}

std::string Legend::csv(const Materials& materials) const {
    std::string lines;
    for (const auto& [code, id] : classes_) lines += text(code, ",", materials[id].name, "\n");
    return lines;
}

std::optional<ClassId> Legend::find(int code) const {
    const auto found = classes_.find(code);
    if (found == classes_.end()) return std::nullopt;
    return found->second;
}

}  // namespace wedgescope
