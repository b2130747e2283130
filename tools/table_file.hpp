// Table file: the CSV tables that the program takes: a line that names the columns, then a row a line, cell by cell.
// Leaves which columns there are, and what a row means, to track_file.hpp and observer_file.hpp.
#pragma once
#include <cstdint>
#include <istream>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tools/units.hpp"

namespace wedgescope {

struct TableColumn {
    int field;  ///< columns of one field are other names of it
    const char* name;
    const char* unit = "";  ///< of a bare number; empty: a plain number
    Dimension dimension = Dimension::length;
    bool degrees = false;  ///< a plain number that is one of degrees
    /// Fields, as bits: a name that may mean something else and stands back where one of them is named.
    unsigned unless = 0;
};

/// A column as its header names it, the unit in brackets behind, square ones or round.
struct NamedColumn {
    const TableColumn* known = nullptr;  ///< none: of another name, or with round brackets that hold no unit
    std::string name, unit;              ///< the name as it stands there
    bool whole = true;                   ///< false: what is in the square brackets is no unit of that column's
};
NamedColumn named_column(std::string_view header, std::span<const TableColumn> known);
/// Makes columns of no known name of those that stand back for others, and of all but the first of one such field.
void let_stand_back(std::vector<NamedColumn>& columns);

/// The lines of a table that hold something, and their cells. Blank lines and those that begin with # are left out; a cell may
/// stand in double quotes, and then hold commas, but no line break.
class TableRows {
public:
    /// `subject`: for messages ("track 'x.csv'"). `content` must outlive it.
    TableRows(std::string subject, std::istream& content) : subject_(std::move(subject)), content_(content) {}
    TableRows(const TableRows&) = delete;  // its cells are views into its row
    TableRows& operator=(const TableRows&) = delete;

    /// The next line; false at the end. InputError for a line that is too long or ends within quotes; IoError.
    bool next();
    std::int64_t line() const { return line_; }
    const std::string& subject() const { return subject_; }
    /// As it stands in the file, without white space at its ends.
    std::string_view row() const { return trimmed(row_); }
    /// Trimmed, without quotes; until the next line.
    const std::vector<std::string_view>& cells() const { return cells_; }

private:
    std::string subject_;
    std::istream& content_;
    std::int64_t line_ = 0;
    std::string row_;
    std::vector<std::string_view> cells_;
};

/// InputError where the line that names the columns is one cell by commas and more by other signs.
void refuse_other_separators(const TableRows& header);

class TableReader {
public:
    /// `subject`: for messages ("track 'x.csv'"); `accepted`: all columns in words; `others`: columns of other names are left
    /// out; else refused. Names are taken in any case of letters. All must outlive it.
    TableReader(std::string subject, std::istream& content, std::span<const TableColumn> known, std::string accepted,
                bool others)
        : rows_(std::move(subject), content), known_(known), accepted_(std::move(accepted)), others_(others) {}

    // All throw InputError naming subject, line, column, what was found and what is accepted; IoError.

    /// The line that names the columns; before the first row.
    void read_header();
    bool has(int field) const { return column_of(field).has_value(); }
    const std::vector<NamedColumn>& columns() const { return columns_; }
    /// The next row; false at the end.
    bool next_row();
    std::int64_t line() const { return rows_.line(); }

    /// Is there a cell of that column with something in it?
    bool given(int field) const;
    /// A number in the column's unit or in the one that the cell gives, in SI units.
    double value(int field) const;
    double value_within(int field, double low, double high, const char* words) const;

    [[noreturn]] void refuse(int field, std::string_view found, const std::string& accepted) const;
    [[noreturn]] void refuse_header(const char* what) const;

private:
    std::optional<std::size_t> column_of(int field) const;

    TableRows rows_;
    std::span<const TableColumn> known_;
    std::string accepted_;
    bool others_;
    std::int64_t header_line_ = 0;
    std::vector<NamedColumn> columns_;
};

/// How a table gives places, by the fields of the columns for it: true: lat and lon; false: x and y. InputError where it gives
/// both, none or half of one.
bool has_lat_lon(const TableReader& table, int lat, int lon, int x, int y);

}  // namespace wedgescope
