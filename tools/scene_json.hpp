// Scene JSON: all parameters of a run as JSON, for the report and for SCENE_JSON in the output rasters, and back.
// Leaves what a key takes to keys.hpp.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "tiles/work_dir.hpp"
#include "tools/keys.hpp"

namespace wedgescope {

/// All parameters after defaults, key -> text as a scene file takes it; null where nothing was given.
/// `everything` off: only what changes the picture (SCENE_JSON), so that no split, path or budget shows in an output.
nlohmann::ordered_json parameters_json(const Settings& settings, bool everything);
/// And back, for settings_from(); null ones left out. DataError.
std::vector<Given> given_in_json(const nlohmann::ordered_json& parameters);

/// `settings` with the numbers that the data base gave for what was left open.
Settings with_resolved(const Settings& settings, const ResolvedScene& resolved);
/// The numbers behind a resolved scene, in SI units with the unit in the name.
nlohmann::ordered_json resolved_json(const ResolvedScene& resolved);
/// SCENE_JSON of the output rasters: the parameters with every fixed default but `auto` left as it was (so that what
/// follows from another changes with it), and the numbers that `auto` became.
std::string scene_json(const Settings& settings, const ResolvedScene& resolved);
/// The same, not yet a text.
nlohmann::ordered_json scene_object(const Settings& settings, const ResolvedScene& resolved);
std::string json_line(const nlohmann::ordered_json& object);
/// What turns `from` into `to` (objects) as a JSON merge patch (RFC 7396): of members that differ those of `to`, null for
/// those that it lacks. So none of `to` may be null that is something else in `from`.
nlohmann::ordered_json scene_difference(const nlohmann::ordered_json& from, const nlohmann::ordered_json& to);
/// SCENE_JSON of an echo image: also what a picture of it takes from the data base, and what tells whether another scene would
/// have the same echo (docs/formats.md).
std::string echo_scene_json(const Settings& settings, const RunResult& run, const DataBase& data_base);
/// What the checksum of an echo image's SCENE_JSON `scene` is taken of, beside the cells: all the rest of it, as it is written.
std::string without_checksum(nlohmann::ordered_json scene);
/// Does it name a file or a folder?
bool takes_path(const Key& key);

/// What the work folder compares: the keys that may change the echo, and what the echo depends on. IoError.
WorkDir::Run work_run(const Settings& settings, const ResolvedScene& resolved, const DataBase& data_base);

}  // namespace wedgescope
