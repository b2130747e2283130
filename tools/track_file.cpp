#include "tools/track_file.hpp"

#include <fmt/format.h>

#include <numbers>
#include <vector>

#include "lib/error.hpp"
#include "tools/table_file.hpp"
#include "tools/table_stream.hpp"

namespace wedgescope {
namespace {

enum Field { time_field, lat, lon, x, y, altitude_msl, altitude_agl, altitude_hae, heading_field };

constexpr TableColumn columns[] = {{time_field, "time", "s", Dimension::time},
                                   {lat, "lat", "", Dimension::angle, true},
                                   {lat, "latitude", "", Dimension::angle, true},
                                   {lon, "lon", "", Dimension::angle, true},
                                   {lon, "longitude", "", Dimension::angle, true},
                                   {x, "x"},
                                   {y, "y"},
                                   {altitude_msl, "altitude-msl", "m"},
                                   {altitude_msl, "altitude_msl", "m"},
                                   {altitude_msl, "altitude", "m"},
                                   {altitude_agl, "altitude-agl", "m"},
                                   {altitude_agl, "altitude_agl", "m"},
                                   {altitude_agl, "height", "m"},
                                   {altitude_hae, "altitude-hae", "m"},
                                   {altitude_hae, "altitude_hae", "m"},
                                   {heading_field, "heading", "deg", Dimension::angle}};
constexpr const char* accepted_columns =
    "time, lat and lon or x and y, one of altitude-msl (or altitude), altitude-agl (or height) and altitude-hae, and "
    "heading, with a unit in brackets where it is not s, m or deg";

void check_columns(const TableReader& table) {
    if (!table.has(time_field)) table.refuse_header("no column is time");
    has_lat_lon(table, lat, lon, x, y);
    const int altitudes = table.has(altitude_msl) + table.has(altitude_agl) + table.has(altitude_hae);
    if (altitudes != 1)
        table.refuse_header(altitudes ? "there are two columns of altitude" : "no column is an altitude");
}

TrackPoint point(const TableReader& table, Angle heading) {
    TrackPoint p;
    p.line = table.line();
    p.time_s = table.value_within(time_field, -1e15, 1e15, "from -1e15 to 1e15 seconds");
    if (table.has(lat)) {
        p.first = table.value_within(lat, -90, 90, "from -90 to 90 degrees");
        p.second = table.value_within(lon, -360, 360, "from -360 to 360 degrees");
    } else {
        p.first = table.value(x);
        p.second = table.value(y);
    }
    if (table.has(altitude_agl))
        p.altitude_m = table.value_within(altitude_agl, 0, 1e6, "from 0m to 1000km");
    else
        p.altitude_m = table.value_within(table.has(altitude_msl) ? altitude_msl : altitude_hae, -10000, 1e6,
                                          "from -10km to 1000km");
    p.heading = heading;
    if (table.has(heading_field)) {
        constexpr double circle = 2 * std::numbers::pi * (1 + 1e-12);
        p.heading = Angle::radians(table.value_within(heading_field, -circle, circle, "from -360deg to 360deg"));
    }
    return p;
}

std::string subject_of(const std::string& path) {
    return path == "-" ? "track on standard input" : text("track ", in_quotes(path));
}

}  // namespace

Track track_from(const std::string& path, std::istream& content, const ScenesHeading& heading) {
    const std::string subject = subject_of(path);
    TableReader table(subject, content, columns, accepted_columns, false);
    table.read_header();
    check_columns(table);
    if (!heading.beside.empty() && table.has(heading_field))
        throw InputError(text(heading.beside, " is given beside ", subject,
                              ", whose column heading says it row by row; one of the two is accepted"));
    std::vector<TrackPoint> points;
    while (table.next_row()) {
        if (points.size() == most_track_rows)
            throw InputError(text(subject, ", line ", table.line(), ": there are more than ", most_track_rows,
                                  " rows; split the file"));
        points.push_back(point(table, heading.angle));
        if (points.size() > 1 && !(points.back().time_s > points[points.size() - 2].time_s))
            table.refuse(time_field, fmt::format("{} s", points.back().time_s),
                         text("more than the ", points[points.size() - 2].time_s, " s of the row before"));
    }
    if (points.empty())
        throw InputError(text(subject, " has no rows; at least one below the names of the columns is needed"));
    points.shrink_to_fit();
    const AltitudeAbove altitude = table.has(altitude_msl)   ? AltitudeAbove::sea_level
                                   : table.has(altitude_agl) ? AltitudeAbove::ground
                                                             : AltitudeAbove::ellipsoid;
    return Track(table.has(lat), altitude, std::move(points));
}

Track read_track(const std::string& path, const ScenesHeading& heading, const Stop& stop) {
    TableStream file(path, subject_of(path), stop);
    return track_from(path, file, heading);
}

}  // namespace wedgescope
