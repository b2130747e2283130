#include "tools/antenna_file.hpp"

#include <filesystem>
#include <sstream>

#include "lib/lower_case.hpp"
#include "tools/near_words.hpp"
#include "tools/table_file.hpp"
#include "tools/text_file.hpp"
#include "tools/units.hpp"

namespace wedgescope {
namespace {

constexpr std::string_view points_prefix = "points:";
constexpr const char* columns = "depression_deg,gain_db";

PatternPoint point(const std::string& place, std::string_view depression, std::string_view gain) {
    return {Angle::radians(parse_quantity_or_number(Dimension::angle, place + "depression_deg", depression, "deg")),
            Decibel(parse_quantity_or_number(Dimension::decibel, place + "gain_db", gain, "dB"))};
}

/// The number without its unit, where it is in the unit that the file has.
std::string bare(Dimension dimension, double value, std::string_view unit) {
    std::string out = quantity_text(dimension, value);
    if (out.ends_with(unit)) out.resize(out.size() - unit.size());
    return out;
}

}  // namespace

std::vector<PatternPoint> read_antenna_file(const std::string& origin, const std::string& path) {
    const std::string subject = text("antenna file ", in_quotes(path));
    std::error_code none;
    if (!std::filesystem::exists(path, none) && (!none || none == std::errc::no_such_file_or_directory)) {
        throw InputError(text(origin, " is ", in_quotes(path), ", and there is no such file; it must be ",
                              antenna_accepted, suggestion(path, {"gaussian", "csc2", "cos-csc2"})));
    }
    std::istringstream file(text_of_file(subject, path, "it holds a line for each point"));
    TableRows rows(subject, file);
    std::vector<PatternPoint> points;
    std::vector<std::int64_t> lines;
    for (bool first = true; rows.next(); first = false) {
        const auto& cells = rows.cells();
        const std::string place = text(subject, ", line ", rows.line(), ": ");
        if (cells.size() != 2)
            throw InputError(text(place, "found ", cells.size(), cells.size() == 1 ? " cell" : " cells",
                                  "; accepted: two, ", columns));
        if (first && same_letters(cells[0], "depression_deg") && same_letters(cells[1], "gain_db")) continue;
        // Any other header may mean another angle, or the other sign.
        if (first && !cells[0].empty() && std::isalpha(static_cast<unsigned char>(cells[0][0])))
            throw InputError(text(place, "the columns are ", in_quotes(rows.row()), "; accepted: ", columns));
        if (points.size() == most_pattern_points)
            throw InputError(text(place, "there are more than ", most_pattern_points, " points; accepted: from 2 to ",
                                  most_pattern_points));
        points.push_back(point(place, cells[0], cells[1]));
        lines.push_back(rows.line());
    }
    if (const auto fault = pattern_fault(points)) {
        if (points.size() < 2) throw InputError(text(subject, ": ", fault->what));
        throw InputError(text(subject, ", line ", lines[fault->point], ": ", fault->what));
    }
    return points;
}

std::string points_word(const std::vector<PatternPoint>& points) {
    std::string out(points_prefix);
    for (const PatternPoint& p : points) {
        if (&p != &points.front()) out += ';';
        out += bare(Dimension::angle, p.depression.rad(), "deg") + "," + bare(Dimension::decibel, p.gain.db(), "dB");
    }
    return out;
}

bool is_points_word(std::string_view word) { return word.starts_with(points_prefix); }

std::vector<PatternPoint> points_of_word(const std::string& origin, std::string_view word) {
    word.remove_prefix(points_prefix.size());
    std::vector<PatternPoint> points;
    while (!word.empty()) {
        const auto end = word.find(';');
        const std::string_view pair = word.substr(0, end);
        word.remove_prefix(end == std::string_view::npos ? word.size() : end + 1);
        const std::string place = text(origin, ", point ", points.size() + 1, ": ");
        const auto comma = pair.find(',');
        if (comma == std::string_view::npos)
            throw InputError(text(place, "found ", in_quotes(pair), "; accepted: two numbers, ", columns));
        points.push_back(point(place, pair.substr(0, comma), pair.substr(comma + 1)));
    }
    if (const auto fault = pattern_fault(points))
        throw InputError(text(origin, ", point ", fault->point + 1, ": ", fault->what));
    return points;
}

}  // namespace wedgescope
