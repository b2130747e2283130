#include "tools/track_file.hpp"

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>
#include <vector>

#include "lib/error.hpp"
#include "tools/units.hpp"

namespace wedgescope {
namespace {

enum class Field { time, lat, lon, x, y, altitude_msl, altitude_agl, altitude_hae, heading };
constexpr std::size_t field_count = 9;

struct Column {
    Field field;
    const char* name;
    const char* unit;  ///< of a bare number; empty: a plain number
};
constexpr std::array<Column, field_count> known = {{{Field::time, "time", "s"},
                                                    {Field::lat, "lat", ""},
                                                    {Field::lon, "lon", ""},
                                                    {Field::x, "x", ""},
                                                    {Field::y, "y", ""},
                                                    {Field::altitude_msl, "altitude-msl", "m"},
                                                    {Field::altitude_agl, "altitude-agl", "m"},
                                                    {Field::altitude_hae, "altitude-hae", "m"},
                                                    {Field::heading, "heading", "deg"}}};
constexpr const char* accepted_columns =
    "time, lat and lon or x and y, one of altitude-msl, altitude-agl and altitude-hae, and heading, with a unit in "
    "brackets "
    "where it is not s, m or deg";

Dimension dimension_of(Field field) {
    switch (field) {
        case Field::time:
            return Dimension::time;
        case Field::heading:
            return Dimension::angle;
        default:
            return Dimension::length;
    }
}

bool is_degrees(Field field) { return field == Field::lat || field == Field::lon; }

/// The cells of a line, trimmed; a cell may stand in double quotes.
std::vector<std::string_view> cells_of(std::string_view line) {
    std::vector<std::string_view> cells;
    for (;;) {
        const auto comma = line.find(',');
        std::string_view cell = trimmed(line.substr(0, comma));
        if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"')
            cell = trimmed(cell.substr(1, cell.size() - 2));
        cells.push_back(cell);
        if (comma == std::string_view::npos) return cells;
        line.remove_prefix(comma + 1);
    }
}

class Reader {
public:
    Reader(const std::string& path, std::istream& content) : path_(path), content_(content) {}

    Track read(Angle heading) {
        std::string line;
        if (!next(line))
            throw InputError(text("track ", in_quotes(path_), " is empty; accepted: a line that names the columns ",
                                  accepted_columns));
        read_header(line);
        std::vector<TrackPoint> points;
        while (next(line)) {
            if (points.size() == most_track_rows)
                throw InputError(text("track ", in_quotes(path_), ", line ", line_, ": there are more than ",
                                      most_track_rows, " rows; split the file"));
            points.push_back(point(line, heading));
            if (points.size() > 1 && !(points.back().time_s > points[points.size() - 2].time_s))
                refuse("time", fmt::format("{} s", points.back().time_s),
                       text("more than the ", points[points.size() - 2].time_s, " s of the row before"));
        }
        if (points.empty())
            throw InputError(text("track ", in_quotes(path_),
                                  " has no rows; at least one below the names of the columns is needed"));
        points.shrink_to_fit();
        const bool lat_lon = column_of(Field::lat).has_value();
        const AltitudeAbove altitude = column_of(Field::altitude_msl)   ? AltitudeAbove::sea_level
                                       : column_of(Field::altitude_agl) ? AltitudeAbove::ground
                                                                        : AltitudeAbove::ellipsoid;
        return Track(lat_lon, altitude, std::move(points));
    }

private:
    struct Given {
        Field field;
        std::string name, unit;
    };

    /// The next line that holds something; # begins a comment line.
    bool next(std::string& line) {
        while (std::getline(content_, line)) {
            ++line_;
            if (line_ == 1 && line.starts_with("\xef\xbb\xbf")) line.erase(0, 3);
            constexpr std::size_t longest = 4096;
            if (line.size() > longest)
                throw InputError(text("track ", in_quotes(path_), ", line ", line_, " has ", line.size(),
                                      " characters; accepted: at most ", longest));
            const std::string_view rest = trimmed(line);
            if (!rest.empty() && rest.front() != '#') return true;
        }
        if (content_.bad()) throw IoError(text("track ", in_quotes(path_), " cannot be read"));
        return false;
    }

    [[noreturn]] void refuse(const std::string& column, std::string_view found, const std::string& accepted) const {
        throw InputError(text("track ", in_quotes(path_), ", line ", line_, ", column ", column, " is ", found,
                              "; it must be ", accepted));
    }

    std::optional<std::size_t> column_of(Field field) const {
        for (std::size_t i = 0; i < columns_.size(); ++i)
            if (columns_[i].field == field) return i;
        return std::nullopt;
    }

    void read_header(const std::string& line) {
        for (const std::string_view cell : cells_of(line)) {
            const auto open = cell.find('[');
            const std::string_view name = trimmed(cell.substr(0, open));
            const Column* found = nullptr;
            for (const Column& column : known)
                if (name == column.name) found = &column;
            const std::string at = text("track ", in_quotes(path_), ", line ", line_, ": column ", columns_.size() + 1);
            if (!found) throw InputError(text(at, " is ", in_quotes(cell), "; accepted: ", accepted_columns));
            if (column_of(found->field)) throw InputError(text(at, " is ", in_quotes(cell), ", and so is one before"));
            std::string unit = found->unit;
            if (open != std::string_view::npos) {
                const auto close = cell.find(']', open);
                const bool whole = close == cell.size() - 1;
                unit = std::string(trimmed(cell.substr(open + 1, whole ? close - open - 1 : std::string_view::npos)));
                if (*found->unit == 0) {
                    if (!whole || unit != (is_degrees(found->field) ? "deg" : ""))
                        throw InputError(
                            text(at, " is ", in_quotes(cell), "; accepted: ", found->name,
                                 is_degrees(found->field) ? ", in degrees" : ", in the raster's own units"));
                    unit.clear();
                } else {
                    try {
                        if (!whole) throw InputError("");
                        parse_quantity(dimension_of(found->field), "", "1" + unit);
                    } catch (const InputError&) {
                        throw InputError(text(at, " is ", in_quotes(cell),
                                              "; accepted units: ", unit_list(dimension_of(found->field)), ", as in ",
                                              found->name, " [", found->unit, "]"));
                    }
                }
            }
            columns_.push_back({found->field, std::string(name), unit});
        }
        const auto refuse_all = [&](const char* what) {
            throw InputError(
                text("track ", in_quotes(path_), ", line ", line_, ": ", what, "; accepted: ", accepted_columns));
        };
        const auto has = [&](Field field) { return column_of(field).has_value(); };
        if (!has(Field::time)) refuse_all("no column is time");
        const bool lat_lon = has(Field::lat) || has(Field::lon), x_y = has(Field::x) || has(Field::y);
        if (lat_lon == x_y)
            refuse_all(lat_lon ? "there are columns lat, lon and x, y" : "no columns are lat, lon or x, y");
        if (lat_lon && !(has(Field::lat) && has(Field::lon))) refuse_all("of lat and lon one is missing");
        if (x_y && !(has(Field::x) && has(Field::y))) refuse_all("of x and y one is missing");
        const int altitudes = has(Field::altitude_msl) + has(Field::altitude_agl) + has(Field::altitude_hae);
        if (altitudes != 1) refuse_all(altitudes ? "there are two columns of altitude" : "no column is an altitude");
    }

    /// A number in the column's unit or in the one that the cell gives.
    double value(const Given& column, std::string_view cell) const {
        const bool plain = column.unit.empty();
        try {
            if (plain) return parse_number(column.name, cell);
            bool bare = true;
            try {
                parse_number(column.name, cell);
            } catch (const InputError&) {
                bare = false;
            }
            return parse_quantity(dimension_of(column.field), column.name,
                                  bare ? std::string(cell) + column.unit : std::string(cell));
        } catch (const InputError&) {
            refuse(column.name, in_quotes(cell),
                   plain ? std::string("a number")
                         : text("a number (", column.unit,
                                "), or one with a unit: ", unit_list(dimension_of(column.field))));
        }
    }

    TrackPoint point(const std::string& line, Angle heading) const {
        const std::vector<std::string_view> cells = cells_of(line);
        if (cells.size() != columns_.size())
            throw InputError(text("track ", in_quotes(path_), ", line ", line_, " has ", cells.size(),
                                  " columns; accepted: ", columns_.size(), ", as many as are named"));
        TrackPoint p;
        p.heading = heading;
        p.line = line_;
        const auto within = [&](const Given& column, std::string_view cell, double v, double low, double high,
                                const char* words) {
            if (!(v >= low && v <= high)) refuse(column.name, in_quotes(cell), words);
            return v;
        };
        for (std::size_t i = 0; i < cells.size(); ++i) {
            const Given& column = columns_[i];
            const double v = value(column, cells[i]);
            switch (column.field) {
                case Field::time:
                    p.time_s = v;
                    break;
                case Field::lat:
                    p.first = within(column, cells[i], v, -90, 90, "from -90 to 90 degrees");
                    break;
                case Field::lon:
                    p.second = within(column, cells[i], v, -360, 360, "from -360 to 360 degrees");
                    break;
                case Field::x:
                    p.first = v;
                    break;
                case Field::y:
                    p.second = v;
                    break;
                case Field::altitude_msl:
                case Field::altitude_hae:
                    p.altitude_m = within(column, cells[i], v, -10000, 1e6, "from -10km to 1000km");
                    break;
                case Field::altitude_agl:
                    p.altitude_m = within(column, cells[i], v, 0, 1e6, "from 0m to 1000km");
                    break;
                case Field::heading: {
                    const Angle angle = Angle::radians(v);
                    within(column, cells[i], angle.deg(), -360, 360, "from -360deg to 360deg");
                    p.heading = angle;
                    break;
                }
            }
        }
        return p;
    }

    const std::string& path_;
    std::istream& content_;
    std::int64_t line_ = 0;
    std::vector<Given> columns_;
};

}  // namespace

Track track_from(const std::string& path, std::istream& content, Angle heading) {
    return Reader(path, content).read(heading);
}

Track read_track(const std::string& path, Angle heading) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) throw IoError(text("track ", in_quotes(path), " is a folder"));
    errno = 0;
    std::ifstream file(path, std::ios::binary);
    if (!file) throw IoError(text("track ", in_quotes(path), " cannot be opened: ", std::strerror(errno)));
    return track_from(path, file, heading);
}

}  // namespace wedgescope
