#include "tools/observer_file.hpp"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <numbers>
#include <span>
#include <system_error>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "lib/seen_counts.hpp"
#include "tiles/point_file.hpp"
#include "tools/table_file.hpp"
#include "tools/table_stream.hpp"

namespace wedgescope {
namespace {

enum Field { agl, msl, hae, range, heading, lat, lon, x, y };

constexpr unsigned altitudes = 1U << agl | 1U << msl | 1U << hae;

/// Names of fields and of columns; the first one of each field is the one that documents and messages use.
constexpr TableColumn names[] = {{agl, "height", "m"},
                                 {agl, "altitude-agl", "m"},
                                 {agl, "altitude_agl", "m"},
                                 {agl, "height_m", "m", Dimension::length, false, altitudes},
                                 {agl, "hgt", "m", Dimension::length, false, altitudes},
                                 {agl, "predominant_height", "m", Dimension::length, false, altitudes},
                                 // As shapefiles cut them, to ten letters.
                                 {agl, "predominan", "m", Dimension::length, false, altitudes},
                                 {agl, "altitude-a", "m", Dimension::length, false, altitudes},
                                 {agl, "altitude_a", "m", Dimension::length, false, altitudes},
                                 {msl, "altitude-m", "m", Dimension::length, false, altitudes},
                                 {msl, "altitude_m", "m", Dimension::length, false, altitudes},
                                 {hae, "altitude-h", "m", Dimension::length, false, altitudes},
                                 {hae, "altitude_h", "m", Dimension::length, false, altitudes},
                                 {msl, "altitude", "m"},
                                 {msl, "altitude-msl", "m"},
                                 {msl, "altitude_msl", "m"},
                                 {hae, "altitude-hae", "m"},
                                 {hae, "altitude_hae", "m"},
                                 {range, "range", "m"},
                                 {heading, "heading", "deg", Dimension::angle},
                                 {lat, "lat", "", Dimension::angle, true},
                                 {lat, "latitude", "", Dimension::angle, true},
                                 {lon, "lon", "", Dimension::angle, true},
                                 {lon, "longitude", "", Dimension::angle, true},
                                 {x, "x"},
                                 {y, "y"}};
constexpr const char* accepted_columns =
    "lat and lon or x and y, and, where the options do not say it for all, height (above ground) or altitude "
    "(above the sea), range and heading, with a unit in brackets where it is not m or deg; others are left out";
constexpr double circle = 2 * std::numbers::pi * (1 + 1e-12);

struct Bounds {
    double low, high;
    const char* words;
};
Bounds bounds(int field) {
    switch (field) {
        case agl:
            return {0, 1e6, "from 0m to 1000km"};
        case range:
            return {1e-9, 1e7, "above 0m and up to 10000km"};
        case heading:
            return {-circle, circle, "from -360deg to 360deg"};
        case lat:
            return {-90, 90, "from -90 to 90 degrees"};
        case lon:
            return {-360, 360, "from -360 to 360 degrees"};
        default:
            return {-10000, 1e6, "from -10km to 1000km"};
    }
}

AltitudeAbove above_what(int field) {
    return field == agl ? AltitudeAbove::ground : field == msl ? AltitudeAbove::sea_level : AltitudeAbove::ellipsoid;
}

/// Puts what is given of these fields into an observer; `value` reads one and sees to its bounds. `where`: of the observer.
template <class Given, class Value>
void take(Observer& observer, const std::string& where, bool altitude_given, Given&& given, Value&& value) {
    for (const int field : {agl, msl, hae}) {
        if (!given(field)) continue;
        if (observer.altitude_m)
            throw InputError(text(where, " has two of height, altitude and altitude-hae; accepted: one"));
        observer.altitude_above = above_what(field);
        observer.altitude_m = value(field);
    }
    if (!observer.altitude_m && !altitude_given)
        throw InputError(text(where,
                              " has no altitude; accepted: a field height (above ground) or altitude (above the "
                              "sea), or altitude-agl or altitude-msl for all"));
    if (given(range)) observer.range_m = value(range);
    if (given(heading)) observer.heading = Angle::radians(value(heading));
}

void check_count(const std::string& subject, std::size_t count) {
    if (count == most_observers)
        throw InputError(text(subject, " has more than ", most_observers, " observers; accepted: at most so many"));
}

/// `columns`: all that the file names.
Observers finish(const std::string& path, const std::string& subject, bool is_table, bool lat_lon, bool altitude_given,
                 std::vector<Observer> all, const std::vector<NamedColumn>& columns) {
    if (all.empty()) throw InputError(text(subject, " holds no observer; at least one is needed"));
    all.shrink_to_fit();
    std::string taken;
    std::vector<std::string> left_out;
    for (const NamedColumn& column : columns) {
        // A name that may be something else's (a building's height), beside the option for all.
        if (column.known && column.known->unless != 0 && altitude_given) taken = in_quotes(column.name);
        if (column.known || column.name.empty()) continue;
        left_out.emplace_back(column.name);
    }
    const char* const kind = is_table ? "column" : "field";
    std::string note;
    if (!taken.empty()) note += text(kind, " ", taken, " gives each its height, where it is not empty");
    if (!left_out.empty())
        note += text(note.empty() ? "" : "; ", kind, "s that are left out: ", listed_names(left_out));
    if (!note.empty()) note = text(subject, ": ", note);
    return Observers(path, is_table, lat_lon, std::move(all), std::move(note));
}

Observers read_table(const std::string& path, bool altitude_given, const Stop& stop) {
    const std::string subject = path == "-" ? "observers on standard input" : text("observers ", in_quotes(path));
    TableStream file(path, subject, stop);
    TableReader table(subject, file, names, accepted_columns, true);
    table.read_header();
    const bool lat_lon = has_lat_lon(table, lat, lon, x, y);
    std::vector<Observer> all;
    while (table.next_row()) {
        check_count(subject, all.size());
        const auto value = [&](int field) {
            const Bounds b = bounds(field);
            return table.value_within(field, b.low, b.high, b.words);
        };
        Observer o;
        o.number = table.line();
        o.first = lat_lon ? value(lat) : table.value(x);
        o.second = lat_lon ? value(lon) : table.value(y);
        take(
            o, text(subject, ", line ", table.line()), altitude_given, [&](int field) { return table.given(field); },
            value);
        all.push_back(o);
    }
    return finish(path, subject, true, lat_lon, altitude_given, std::move(all), table.columns());
}

Observers read_points(const std::string& path, const std::string& layer, bool altitude_given,
                      const DataBase& data_base) {
    const std::string subject = text("observers ", in_quotes(path));
    PointFile file({"observers", path, layer}, data_base);
    // Places are the points' own.
    const auto of_points = std::span(names).first(static_cast<std::size_t>(std::count_if(
        std::begin(names), std::end(names), [](const TableColumn& column) { return column.field <= heading; })));
    std::vector<NamedColumn> fields;
    for (const std::string& name : file.field_names()) fields.push_back(named_column(name, of_points));
    for (NamedColumn& field : fields)
        if (!field.whole) field.known = nullptr;
    let_stand_back(fields);
    std::vector<NamedColumn> columns;
    std::vector<int> places;
    for (std::size_t i = 0; i < fields.size(); ++i) {
        if (!fields[i].known) continue;
        columns.push_back(fields[i]);
        places.push_back(static_cast<int>(i));
    }
    file.choose(places);
    std::vector<Observer> all;
    file.read([&](const PointRow& row) {
        check_count(subject, all.size());
        const std::string where = text(subject, ", feature ", row.feature);
        const auto place = [&](int field) {
            std::size_t found = columns.size();
            for (std::size_t i = columns.size(); i-- > 0;)
                if (columns[i].known->field == field && row.values[i] &&
                    (found == columns.size() || columns[i].known <= columns[found].known))
                    found = i;
            return found;
        };
        const auto value = [&](int field) {
            const std::size_t i = place(field);
            const Bounds b = bounds(field);
            const TableColumn& column = *columns[i].known;
            double v = b.low - 1;
            try {
                v = parse_quantity_or_number(column.dimension, column.name, *row.values[i], columns[i].unit);
            } catch (const InputError&) {
            }
            if (!(v >= b.low && v <= b.high))
                throw InputError(text(where, ", field ", column.name, " is ", in_quotes(*row.values[i]),
                                      "; it must be a number (", columns[i].unit, ") or one with a unit, ", b.words));
            return v;
        };
        Observer o;
        o.number = row.feature;
        o.first = row.first;
        o.second = row.second;
        take(
            o, where, altitude_given, [&](int field) { return place(field) < columns.size(); }, value);
        all.push_back(o);
    });
    return finish(path, subject, false, file.lat_lon(), altitude_given, std::move(all), fields);
}

/// Can be read once, from front to end; a terminal too.
bool is_pipe(const std::filesystem::file_status& file) {
    return std::filesystem::is_fifo(file) || std::filesystem::is_character_file(file);
}

}  // namespace

std::string Observers::words(std::size_t i) const {
    return text("observers ", in_quotes(path_), ", ", number_name(), " ", all_[i].number);
}

Scene Observers::scene(const Scene& base, std::size_t i) const {
    const Observer& o = all_[i];
    Scene scene = base;
    PlatformParams& at = scene.platform;
    at.latlon.reset();
    at.xy.reset();
    if (lat_lon_)
        at.latlon = LatLon{o.first, o.second};
    else
        at.xy = PointXY{o.first, o.second};
    if (o.altitude_m) {
        at.altitude_above = o.altitude_above;
        at.altitude_m = *o.altitude_m;
    }
    if (o.range_m) scene.range_m = o.range_m;
    if (o.heading) at.heading = *o.heading;
    return scene;
}

Observers read_observers(const std::string& path, const std::string& layer, bool altitude_given,
                         const DataBase& data_base, const Stop& stop) {
    const std::string ending = lower_case(std::filesystem::path(path).extension().string());
    std::error_code ignored;
    const std::filesystem::file_status file = std::filesystem::status(path, ignored);
    // A pipe has no name that says what it holds, and GDAL, which opens files more than once, would wait for it for ever.
    const bool is_table = path == "-" || is_pipe(file) || (ending == ".csv" && std::filesystem::is_regular_file(file));
    if (!is_table) return read_points(path, layer, altitude_given, data_base);
    if (!layer.empty())
        throw InputError(text("observers-layer is ", in_quotes(layer), ", and observers ", in_quotes(path),
                              " is a table, which has none"));
    return read_table(path, altitude_given, stop);
}

}  // namespace wedgescope
