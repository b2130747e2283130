#include "tools/scene_json.hpp"

#include <cmath>
#include <filesystem>

#include "lib/detail.hpp"
#include "lib/lower_case.hpp"
#include "lib/receiver.hpp"
#include "tiles/checksum.hpp"
#include "tiles/echo_file.hpp"
#include "tools/antenna_file.hpp"
#include "tools/options.hpp"

namespace wedgescope {

namespace {

/// As files may hold it that are handed on: options of GDAL's bear passwords and keys of web servers too.
std::string without_secret(const std::string& name, const std::string& value) {
    const std::string word = lower_case(name);
    for (const char* secret : {"secret", "passw", "pwd", "token", "key", "bearer", "auth", "credential", "header",
                               "cookie", "signature", "sas", "connection_string", "proxy", "user"})
        if (word.find(secret) != std::string::npos) return "(not shown)";
    const auto scheme = value.find("://");
    return scheme != std::string::npos && value.find('@', scheme) != std::string::npos ? "(not shown)" : value;
}

}  // namespace

nlohmann::ordered_json parameters_json(const Settings& settings, bool everything) {
    nlohmann::ordered_json out = nlohmann::ordered_json::object();
    for (const Key& key : key_table()) {
        if (!(key.commands & command_simulate) || !key.in_scene_file) continue;
        if (!everything && !key.changes_result) continue;
        if (key.repeatable) {
            nlohmann::ordered_json list = nlohmann::ordered_json::array();
            if (key.name == "co") {
                for (const auto& option : settings.creation) list.push_back(option);
            } else {
                for (const auto& [name, value] : settings.config)
                    list.push_back(text(name, "=", without_secret(name, value)));
            }
            out[key.name] = list;
            continue;
        }
        const auto value = key.get(settings);
        out[key.name] = value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
    }
    return out;
}

std::vector<Given> given_in_json(const nlohmann::ordered_json& parameters) {
    std::vector<Given> given;
    for (const auto& [name, value] : parameters.items()) {
        const Key* key = find_key(name);
        if (!key || value.is_null()) continue;
        const auto add = [&](const nlohmann::ordered_json& v) {
            if (!v.is_string()) throw DataError(text("scene JSON: ", name, " is not a text"));
            given.push_back({name, v.get<std::string>(), text("scene JSON: ", name), ""});
        };
        if (value.is_array()) {
            for (const auto& v : value) add(v);
        } else {
            add(value);
        }
    }
    return given;
}

Settings with_resolved(const Settings& settings, const ResolvedScene& resolved) {
    Settings out = settings;
    const PlatformParams platform = settings.scene.platform;
    out.scene = resolved.scene;
    out.scene.platform = platform;
    out.scene.geometry = resolved.geometry;
    if (!out.scene.radar.bandwidth_hz) out.scene.radar.bandwidth_hz = resolved.scene.radar.noise_bandwidth_hz();
    if (!out.scene.receiver.mds_dbm)
        out.scene.receiver.mds_dbm = Receiver(resolved.scene.receiver, resolved.scene.radar).mds_dbm();
    if (!out.scene.receiver.minimum_range_m) out.scene.receiver.minimum_range_m = resolved.scene.radar.pulse_extent_m();
    return out;
}

nlohmann::ordered_json resolved_json(const ResolvedScene& r) {
    const auto grid = [](const PolarGrid& g) {
        return nlohmann::ordered_json{{"azimuth_bin_begin", g.azimuth_bins.begin},
                                      {"azimuth_bin_end", g.azimuth_bins.end},
                                      {"range_bin_begin", g.range_bins.begin},
                                      {"range_bin_end", g.range_bins.end}};
    };
    nlohmann::ordered_json out;
    out["geometry"] = word(r.geometry);
    if (r.has_lat_lon) {
        out["lat_deg"] = r.lat_deg;
        out["lon_deg"] = r.lon_deg;
    }
    out["x"] = r.x;
    out["y"] = r.y;
    out["column"] = r.nadir.column;
    out["row"] = r.nadir.row;
    out["nadir_in_raster"] = r.nadir_in_raster;
    out["nadir_on_data"] = r.nadir_on_data;
    out["sensor_height_m"] = r.sensor_m;
    out["reference_height_m"] = r.reference_m;
    out["earth_inverse_radius_per_m"] = r.earth.inverse_radius();
    out["quality"] = word(r.scene.quality);
    out["range_m"] = r.scene.range_m.value_or(0);
    out["range_start_m"] = r.scene.range_start_m;
    out["sweep_delay_m"] = r.sweep_delay_m;
    out["pulse_extent_m"] = r.scene.radar.pulse_extent_m();
    out["bandwidth_hz"] = r.scene.radar.noise_bandwidth_hz();
    out["noise_power_w"] = r.noise_power_w;
    out["circle_bins"] = r.shown.circle_bins;
    out["range_bin_m"] = r.shown.range_bin_m;
    out["shown"] = grid(r.shown);
    out["swept"] = grid(r.swept);
    if (!r.rain_floor.empty()) {
        nlohmann::ordered_json& floor = out["rain_floor_m"] = nlohmann::ordered_json::array();
        for (const std::vector<RainFloor>& ray : r.rain_floor) {
            floor.push_back(nlohmann::ordered_json::array());
            for (const RainFloor& knot : ray) floor.back().push_back({knot.range_m, knot.height_m});
        }
    }
    return out;
}

nlohmann::ordered_json scene_object(const Settings& settings, const ResolvedScene& resolved) {
    nlohmann::ordered_json out;
    out["format"] = "wedgescope-scene-1";
    out["version"] = version();
    out["parameters"] = parameters_json(settings, false);
    out["resolved"] = resolved_json(resolved);
    return out;
}

std::string json_line(const nlohmann::ordered_json& object) {
    return object.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

nlohmann::ordered_json scene_difference(const nlohmann::ordered_json& from, const nlohmann::ordered_json& to) {
    nlohmann::ordered_json out = nlohmann::ordered_json::object();
    for (const auto& [key, value] : to.items()) {
        const auto before = from.find(key);
        if (before == from.end()) {
            out[key] = value;
        } else if (*before != value) {
            out[key] = before->is_object() && value.is_object() ? scene_difference(*before, value) : value;
        }
    }
    for (const auto& [key, value] : from.items())
        if (!to.contains(key)) out[key] = nullptr;
    return out;
}

std::string scene_json(const Settings& settings, const ResolvedScene& resolved) {
    return json_line(scene_object(settings, resolved));
}

bool takes_path(const Key& key) { return key.value.find("PATH") != std::string::npos; }

std::string echo_scene_json(const Settings& settings, const RunResult& run, const DataBase& data_base) {
    // No paths: a store and the rasters it was made from give the same file.
    nlohmann::ordered_json words;
    for (const Key& key : key_table())
        if (const auto value = key.get(settings);
            value && key.group == KeyGroup::data_base && !takes_path(key) && !key.changes_result)
            words[key.name] = *value;
    const auto finite = [](double number) {
        return std::isfinite(number) ? nlohmann::ordered_json(number) : nlohmann::ordered_json(nullptr);
    };
    nlohmann::ordered_json echo;
    echo["revision"] = echo_revision;
    echo["levels"] = run.levels;
    echo["detail_post_m"] = finite(detail_post_m(run.scene, data_base));
    echo["longer_post_m"] = run.scene.longer_post_m;
    echo["clearance_m"] = finite(run.scene.clearance_m);
    echo["data_base"] = words;
    echo["crs_wkt"] = data_base.crs_wkt;
    echo["metres_per_unit"] = data_base.metres_per_unit;
    nlohmann::ordered_json out = scene_object(settings, run.scene);
    out["echo"] = echo;
    out["echo"]["checksum"] = hex(echo_checksum(run.echo_w, run.echo_state, without_checksum(out)));
    return json_line(out);
}

std::string without_checksum(nlohmann::ordered_json scene) {
    scene["echo"].erase("checksum");
    return json_line(scene);
}

WorkDir::Run work_run(const Settings& settings, const ResolvedScene& resolved, const DataBase& data_base) {
    WorkDir::Run run;
    run.azimuth_bins = resolved.swept.azimuth_bins;
    run.version = text(version(), ", echo revision ", echo_revision);
    run.facts = echo_facts(resolved, data_base);
    for (const Key& key : key_table()) {
        const bool data = key.group == KeyGroup::data_base;
        if (!(key.commands & command_simulate) || key.after_echo || !(key.changes_result || data)) continue;
        std::string value = key.get(settings).value_or("");
        if (value.empty()) continue;
        if (key.name == "culture-legend") {
            // By what it says, wherever it lies.
            if (!Legend::built_in(value))
                value = text(value == own_legend ? "rat" : "a CSV file", " of checksum ",
                             hex(checksum(legend_csv(settings))));
        } else if (is_points_word(value)) {
            value = text("points of checksum ", hex(checksum(value)));
        } else if (key.value == "PATH") {
            std::error_code error;
            if (std::filesystem::exists(value, error)) value = std::filesystem::canonical(value, error).string();
        }
        run.asked.push_back({key.name, value});
        if (data) run.facts.push_back({"--" + key.name, value});
    }
    return run;
}

}  // namespace wedgescope
