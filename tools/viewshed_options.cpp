#include "tools/viewshed_options.hpp"

#include <map>
#include <optional>

#include "lib/earth.hpp"
#include "lib/error.hpp"
#include "tools/units.hpp"

namespace wedgescope {
namespace {

/// gdal_viewshed divides the square of the distance by the diameter of the CRS' ellipsoid: K R1 = a / cc.
std::string earth_of(double curvature) {
    if (curvature == 0) return "flat";
    return text(wgs84_a_m / mean_radius_m / curvature);
}

}  // namespace

ViewshedArguments translate_viewshed(const std::vector<std::string>& arguments) {
    ViewshedArguments out;
    std::optional<double> x, y;
    std::map<std::string, std::string> given;  // of those with a default
    const auto is_number = [&](const std::string& option, const std::string& value) {
        return parse_number(option, value);
    };
    bool data = false;  // behind --
    for (std::size_t i = 0; i < arguments.size(); ++i) {
        const std::string& word = arguments[i];
        data = data || word == "--";
        static const char* const known[] = {"-ox", "-oy", "-oz", "-tz", "-md", "-cc", "-ov",
                                            "-vv", "-iv", "-b",  "-f",  "-co", "-om", "-a_nodata"};
        bool ours = false;
        for (const char* option : known) ours = ours || word == option;
        if (!ours || data) {
            out.words.push_back(word);
            continue;
        }
        if (i + 1 == arguments.size()) throw InputError(text("option ", word, " needs a value"));
        const std::string& value = arguments[++i];
        if (word != "-f" && word != "-co" && word != "-om") is_number(word, value);
        if (word == "-f" || word == "-co") {
            out.words.insert(out.words.end(), {word == "-f" ? "--of" : "--co", value});
        } else if (word == "-b") {
            if (is_number(word, value) != 1) throw InputError(text("-b is ", in_quotes(value), "; it must be 1"));
        } else if (word == "-om") {
            if (value != "NORMAL")
                throw InputError(text("-om is ", in_quotes(value),
                                      "; it must be NORMAL (--layer height gives the heights that are needed)"));
        } else if (!given.emplace(word, value).second) {
            throw InputError(text("option ", word, " is given twice"));
        }
    }
    if (given.contains("-ox") != given.contains("-oy"))
        throw InputError(
            text("option ", given.contains("-ox") ? "-oy" : "-ox", " is missing; -ox and -oy go together"));
    out.gdal_style = given.contains("-ox");
    const auto add = [&](const char* key, const std::string& value) {
        out.words.insert(out.words.begin(), {key, value});
    };
    const auto names = [&](const char* key) {
        for (const std::string& word : arguments)
            if (word == key || word.starts_with(std::string(key) + "=")) return true;
        return false;
    };
    const auto value_or = [&](const char* option, const std::string& fallback) -> std::optional<std::string> {
        if (const auto at = given.find(option); at != given.end()) return at->second;
        if (!out.gdal_style || fallback.empty()) return std::nullopt;
        return fallback;
    };
    if (out.gdal_style) {
        add("--xy", given["-ox"] + "," + given["-oy"]);
        if (!names("--geometry")) add("--geometry", "grid");
    }
    const bool altitude = names("--altitude-msl") || names("--altitude-agl") || names("--altitude-hae");
    if (const auto h = value_or("-oz", altitude ? "" : "2")) add("--altitude-agl", *h + "m");
    if (const auto h = value_or("-tz", "")) add("--target-height", *h + "m");
    if (const auto d = value_or("-md", ""); d && is_number("-md", *d) != 0) add("--ground-range", *d + "m");
    if (const auto c = value_or("-cc", names("--earth") ? "" : "0.85714"))
        add("--earth", earth_of(is_number("-cc", *c)));
    const auto outside = value_or("-ov", names("--outside-value") ? "" : "0");
    if (outside) add("--outside-value", *outside);
    if (const auto v = value_or("-vv", "")) add("--seen-value", *v);
    if (const auto v = value_or("-iv", "")) add("--hidden-value", *v);
    if (const auto v = value_or("-a_nodata", "")) add("--no-data-value", *v);
    return out;
}

}  // namespace wedgescope
