#include "tiles/kept_description.hpp"

#include <cmath>
#include <locale>
#include <sstream>

#include "lib/error.hpp"
#include "tiles/spill.hpp"

namespace wedgescope {
namespace {

std::istringstream classic(const std::string& words) {
    std::istringstream in(words);
    in.imbue(std::locale::classic());
    return in;
}

}  // namespace

std::string KeptDescription::lines() const {
    return text(latlon ? text("latlon ", latlon->lat_deg, ' ', latlon->lon_deg, '\n') : std::string(), "nadir ",
                nadir.column, ' ', nadir.row, '\n', "culture-height-scale ", culture_height_scale, '\n', "extremes ",
                extremes.lowest_m, ' ', extremes.highest_m, ' ', extremes.void_posts, ' ', extremes.any_valid ? 1 : 0,
                '\n', files);
}

std::string KeptDescription::files_of(const std::string& role) const {
    std::string found;
    std::istringstream all(files);
    for (std::string line; std::getline(all, line);)
        if (line.starts_with(text("file ", role, ' '))) found += line + '\n';
    return found;
}

KeptDescription KeptDescription::of(const Spill& kept) {
    KeptDescription d;
    std::istringstream all(kept.description());
    for (std::string line; std::getline(all, line);) {
        std::istringstream words = classic(line);
        std::string word;
        words >> word;
        LatLon at;
        if (word == "latlon" && words >> at.lat_deg >> at.lon_deg) d.latlon = at;
        if (word == "nadir") words >> d.nadir.column >> d.nadir.row;
        if (word == "culture-height-scale") words >> d.culture_height_scale;
        if (word == "extremes")
            words >> d.extremes.lowest_m >> d.extremes.highest_m >> d.extremes.void_posts >> d.extremes.any_valid;
        if (word == "file") d.files += line + '\n';
    }
    return d;
}

bool same_point(const IndexPosition& a, const IndexPosition& b) {
    return std::fabs(a.column - b.column) <= 1 && std::fabs(a.row - b.row) <= 1;
}

}  // namespace wedgescope
