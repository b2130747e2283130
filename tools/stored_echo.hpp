// Stored echo: what the SCENE_JSON of an echo image says, and whether another setting's picture can be made from its cells.
// Leaves the cells to tiles/echo_file.hpp.
#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/keys.hpp"

namespace wedgescope {

struct StoredEcho {
    std::string path;
    std::vector<Given> given;  ///< the parameters, as given then
    Settings settings;         ///< of these, and the data base's words and numbers
    ResolvedScene scene;       ///< as swept; without what only a sweep needs
    std::uint64_t checksum = 0;
    std::string said;                  ///< what the checksum is of, beside the cells
    bool levels = false;               ///< levels of detail were used
    double post_m = 0;                 ///< detail_post_m(); infinite: no level, whatever beam and pulse are
    nlohmann::ordered_json data_base;  ///< key -> word or number
    std::string crs_wkt;
    double metres_per_unit = 1;
};

/// DataError where it is no SCENE_JSON of an echo image of this version, or not that of so many columns and rows.
StoredEcho stored_echo(const std::string& path, const std::string& scene_json, std::int64_t columns, std::int64_t rows);

/// The scene that the request asks for, at the echo's place. InputError naming the first setting that needs a new sweep, and why.
/// `settings`: of the stored parameters and what is given.
ResolvedScene scene_from_echo(const StoredEcho& echo, const std::vector<Given>& given, const Settings& settings);

}  // namespace wedgescope
