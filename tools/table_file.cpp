#include "tools/table_file.hpp"

#include <algorithm>
#include <array>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "tools/terminal.hpp"

namespace wedgescope {
namespace {

/// The cells of a line, trimmed; a comma in double quotes is part of its cell. False at a cell, the last then, that begins with a
/// quote which nobody closes. Within a cell (12" dish) a quote is a character as any other.
bool split(std::string_view line, std::vector<std::string_view>& cells) {
    cells.clear();
    for (;;) {
        std::size_t close = 0;
        if (const std::string_view rest = trimmed(line); rest.starts_with('"')) {
            close = line.find('"', static_cast<std::size_t>(rest.data() - line.data()) + 1);
            while (close < line.size() && line.substr(close + 1).starts_with('"')) close = line.find('"', close + 2);
            if (close == std::string_view::npos) {
                cells.push_back(rest);
                return false;
            }
        }
        const std::size_t comma = line.find(',', close);
        std::string_view cell = trimmed(line.substr(0, comma));
        if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"')
            cell = trimmed(cell.substr(1, cell.size() - 2));
        cells.push_back(cell);
        if (comma == std::string_view::npos) return true;
        line.remove_prefix(comma + 1);
    }
}

}  // namespace

NamedColumn named_column(std::string_view header, std::span<const TableColumn> known) {
    NamedColumn column;
    column.name = header;
    const bool round = header.ends_with(')') && header.find('[') == std::string_view::npos;
    const auto open = round ? header.rfind('(') : header.find('[');
    const std::string_view name = trimmed(header.substr(0, open));
    for (const TableColumn& one : known)
        if (same_letters(name, one.name)) column.known = &one;
    if (!column.known) return column;
    column.unit = column.known->unit;
    if (open == std::string_view::npos) return column;
    const auto close = round ? header.size() - 1 : header.find(']', open);
    // A shapefile cuts names to ten letters, and with them what closes the brackets.
    const bool cut = !round && close == std::string_view::npos && header.size() == 10;
    column.whole = cut || close == header.size() - 1;
    column.unit =
        std::string(trimmed(header.substr(open + 1, column.whole && !cut ? close - open - 1 : std::string_view::npos)));
    if (*column.known->unit == 0) {
        column.whole &= column.unit == (column.known->degrees ? "deg" : "");
        column.unit.clear();
    } else {
        column.whole &= has_unit(column.known->dimension, column.unit);
    }
    if (round && !column.whole) column = {nullptr, column.name, "", true};
    return column;
}

void let_stand_back(std::vector<NamedColumn>& columns) {
    for (NamedColumn& column : columns) {
        if (!column.known || column.known->unless == 0) continue;
        for (const NamedColumn& other : columns) {
            const bool first = &other < &column;
            if (other.known && &other != &column && (other.known->unless == 0 || first) &&
                (column.known->unless >> other.known->field & 1U)) {
                column.known = nullptr;
                break;
            }
        }
    }
}

bool TableRows::next() {
    // No more of a line is read than may be, or a file without line ends would be held whole.
    constexpr std::size_t longest = 4096;
    std::array<char, longest + 2> buffer;
    while (content_.getline(buffer.data(), buffer.size()) || content_.gcount() > 0) {
        ++line_;
        const auto taken = static_cast<std::size_t>(content_.gcount());
        // A line end is taken too, and not kept.
        row_.assign(buffer.data(), content_.good() ? taken - 1 : taken);
        if (row_.find('\0') != std::string::npos)
            throw InputError(text(subject_, ", line ", line_,
                                  " is no text; accepted: a table of text (UTF-8), its cells "
                                  "separated by ','"));
        if (row_.size() > longest)
            throw InputError(
                text(subject_, ", line ", line_, " has more than ", longest, " characters; accepted: at most so many"));
        if (const std::size_t at = row_.find('\r'); at != std::string::npos && at + 1 < row_.size())
            throw InputError(
                text(subject_, ", line ", line_,
                     " has a carriage return before its end; accepted: lines that end in LF, or in CR LF"));
        if (line_ == 1 && row_.starts_with("\xef\xbb\xbf")) row_.erase(0, 3);
        const std::string_view rest = trimmed(row_);
        if (rest.empty() || rest.front() == '#') continue;
        if (!split(row_, cells_))
            throw InputError(
                text(subject_, ", line ", line_, ": cell ", cells_.size(),
                     " begins with a double quote that nothing closes; a quoted cell must end on its line"));
        return true;
    }
    if (content_.bad()) throw IoError(text(subject_, " cannot be read"));
    return false;
}

void TableReader::refuse(int field, std::string_view found, const std::string& accepted) const {
    const auto at = column_of(field);
    throw InputError(text(rows_.subject(), ", line ", rows_.line(), ", column ", at ? columns_[*at].known->name : "?",
                          " is ", found, "; it must be ", accepted));
}

void TableReader::refuse_header(const char* what) const {
    throw InputError(text(rows_.subject(), ", line ", header_line_, ": ", what, "; accepted: ", accepted_));
}

std::optional<std::size_t> TableReader::column_of(int field) const {
    for (std::size_t i = 0; i < columns_.size(); ++i)
        if (columns_[i].known && columns_[i].known->field == field) return i;
    return std::nullopt;
}

void refuse_other_separators(const TableRows& header) {
    if (header.cells().size() != 1) return;
    const std::string_view all = header.cells()[0];
    if (const auto at = all.find_first_of(";\t|"); at != std::string_view::npos)
        throw InputError(text(header.subject(), ", line ", header.line(), ": names of columns are separated by ",
                              all[at] == '\t' ? "a tab" : text("'", all[at], "'"), "; accepted: ','"));
}

void TableReader::read_header() {
    if (!rows_.next())
        throw InputError(text(rows_.subject(), " is empty; accepted: a line that names the columns ", accepted_));
    header_line_ = rows_.line();
    refuse_other_separators(rows_);
    for (const std::string_view cell : rows_.cells()) {
        NamedColumn column = named_column(cell, known_);
        const std::string at = text(rows_.subject(), ", line ", rows_.line(), ": column ", columns_.size() + 1);
        const TableColumn* const found = column.known;
        if (!found && !others_) throw InputError(text(at, " is ", in_quotes(cell), "; accepted: ", accepted_));
        if (!column.whole && *found->unit == 0)
            throw InputError(text(at, " is ", in_quotes(cell), "; accepted: ", found->name,
                                  found->degrees ? ", in degrees" : ", in the raster's own units"));
        if (!column.whole)
            throw InputError(text(at, " is ", in_quotes(cell), "; accepted units: ", unit_list(found->dimension),
                                  ", as in ", found->name, " [", found->unit, "]"));
        if (found && found->unless == 0)
            if (std::any_of(columns_.begin(), columns_.end(), [&](const NamedColumn& before) {
                    return before.known && before.known->field == found->field && before.known->unless == 0;
                }))
                throw InputError(text(at, " is ", in_quotes(cell), ", and so is one before"));
        columns_.push_back(std::move(column));
    }
    let_stand_back(columns_);
}

bool TableReader::next_row() {
    if (!rows_.next()) return false;
    if (rows_.cells().size() != columns_.size())
        throw InputError(text(rows_.subject(), ", line ", rows_.line(), " has ",
                              counted(rows_.cells().size(), "column"), "; accepted: ", columns_.size(),
                              ", as many as are named"));
    return true;
}

bool TableReader::given(int field) const {
    const auto at = column_of(field);
    return at && !rows_.cells()[*at].empty();
}

double TableReader::value(int field) const {
    const std::size_t at = *column_of(field);
    const NamedColumn& column = columns_[at];
    const std::string_view cell = rows_.cells()[at];
    const bool plain = column.unit.empty();
    try {
        if (plain) return parse_number(column.known->name, cell);
        return parse_quantity_or_number(column.known->dimension, column.known->name, cell, column.unit);
    } catch (const InputError&) {
        refuse(field, in_quotes(cell),
               plain ? std::string("a number")
                     : text("a number (", column.unit, "), or one with a unit: ", unit_list(column.known->dimension)));
    }
}

double TableReader::value_within(int field, double low, double high, const char* words) const {
    const double v = value(field);
    if (!(v >= low && v <= high)) refuse(field, in_quotes(rows_.cells()[*column_of(field)]), words);
    return v;
}

bool has_lat_lon(const TableReader& table, int lat, int lon, int x, int y) {
    const bool lat_lon = table.has(lat) || table.has(lon), x_y = table.has(x) || table.has(y);
    if (lat_lon == x_y)
        table.refuse_header(lat_lon ? "there are columns lat, lon and x, y" : "no columns are lat, lon or x, y");
    if (lat_lon && !(table.has(lat) && table.has(lon))) table.refuse_header("of lat and lon one is missing");
    if (x_y && !(table.has(x) && table.has(y))) table.refuse_header("of x and y one is missing");
    return lat_lon;
}

}  // namespace wedgescope
