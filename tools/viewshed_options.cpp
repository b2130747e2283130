#include "tools/viewshed_options.hpp"

#include <algorithm>
#include <iterator>
#include <map>

#include "lib/earth.hpp"
#include "lib/error.hpp"
#include "tools/units.hpp"

namespace wedgescope {
namespace {

/// Of gdal_viewshed's options, those that are a key of coverage under another name.
struct Renamed {
    const char* option;
    const char* key;
    const char* unit = "";  ///< of its bare number
    bool number = true;
};
constexpr Renamed renamed[] = {{"-oz", "altitude-agl", "m"}, {"-tz", "target-height", "m"},
                               {"-md", "ground-range", "m"}, {"-cc", "earth"},
                               {"-ov", "outside-value"},     {"-vv", "seen-value"},
                               {"-iv", "hidden-value"},      {"-a_nodata", "no-data-value"},
                               {"-f", "of", "", false},      {"-of", "of", "", false},
                               {"-co", "co", "", false}};
constexpr const char* others[] = {"-ox", "-oy", "-b", "-om"};
constexpr const char* place_options = "-ox and -oy";

/// gdal_viewshed divides the square of the distance by the diameter of the CRS' ellipsoid: K R1 = a / cc.
std::string earth_of(const std::string& option, const std::string& value) {
    const double curvature = parse_number(option, value);
    if (curvature == 0) return "flat";
    if (!(curvature >= 0.00001 && curvature <= 10))
        throw InputError(text(option, " is ", in_quotes(value), "; it must be 0 (flat) or from 0.00001 to 10"));
    return text(wgs84_a_m / mean_radius_m / curvature);
}

/// What gives the heights of an output mode.
const char* instead_of(const std::string& mode) {
    if (mode == "GROUND") return " (--layer height gives what GROUND does)";
    if (mode == "DEM")
        return " (DEM's heights are absolute; --layer height gives those above the ground, as GROUND does)";
    return "";
}

}  // namespace

ViewshedArguments translate_viewshed(const std::vector<std::string>& arguments) {
    ViewshedArguments out;
    std::map<std::string, std::string> place;
    for (std::size_t i = 0; i < arguments.size(); ++i) {
        const std::string& word = arguments[i];
        if (word == "--") {  // data behind it
            out.words.insert(out.words.end(), arguments.begin() + static_cast<std::ptrdiff_t>(i), arguments.end());
            break;
        }
        const auto* const known = std::find_if(std::begin(renamed), std::end(renamed),
                                               [&](const Renamed& one) { return word == one.option; });
        const bool ours = known != std::end(renamed);
        if (!ours && std::find(std::begin(others), std::end(others), word) == std::end(others)) {
            out.words.push_back(word);
            continue;
        }
        if (i + 1 == arguments.size()) throw InputError(text("option ", word, " needs a value"));
        const std::string& value = arguments[++i];
        if (ours) {
            const double number = known->number ? parse_number(word, value) : 0;
            if (word == "-md" && number == 0) continue;  // no limit
            out.given.push_back({known->key, word == "-cc" ? earth_of(word, value) : value, word, "", known->unit});
        } else if (word == "-b") {
            if (parse_number(word, value) != 1) throw InputError(text("-b is ", in_quotes(value), "; it must be 1"));
        } else if (word == "-om") {
            if (value != "NORMAL")
                throw InputError(text("-om is ", in_quotes(value), "; it must be NORMAL", instead_of(value)));
        } else {
            parse_number(word, value);
            if (!place.emplace(word, value).second) throw InputError(text("option ", word, " is given twice"));
        }
    }
    if (place.size() == 1)
        throw InputError(
            text("option ", place.contains("-ox") ? "-oy" : "-ox", " is missing; -ox and -oy go together"));
    out.gdal_style = !place.empty();
    if (!out.gdal_style) return out;
    out.given.insert(out.given.begin(), {"xy", place["-ox"] + "," + place["-oy"], place_options, ""});
    out.defaults = {{"geometry", "grid", "", ""},
                    {"altitude-agl", "2m", "", ""},
                    {"earth", earth_of("-cc", "0.85714"), "", ""},
                    {"outside-value", "0", "", ""}};
    return out;
}

void take_units_of(const DataBase& terrain, Settings& settings) {
    const auto said = [&](const char* key) {
        const auto at = settings.given.find(key);
        return at != settings.given.end() && std::any_of(std::begin(renamed), std::end(renamed),
                                                         [&](const Renamed& one) { return at->second == one.option; });
    };
    const bool own_altitude = settings.given.contains("altitude-msl") || settings.given.contains("altitude-agl") ||
                              settings.given.contains("altitude-hae");
    if (said("altitude-agl") || (settings.snap_to_post && !own_altitude))
        settings.scene.platform.altitude_m *= terrain.metres_per_height;
    if (said("target-height")) settings.coverage.target_m *= terrain.metres_per_height;
    if (said("ground-range")) *settings.scene.ground_range_m *= terrain.metres_per_unit;
}

}  // namespace wedgescope
