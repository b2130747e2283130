#include "tools/settings_check.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <system_error>
#include <utility>

#include "lib/error.hpp"
#include "tiles/tile_store.hpp"
#include "tools/keys.hpp"

namespace wedgescope {
namespace {

void check_scan(const Settings& settings) {
    if (settings.scan_step && settings.track.empty())
        throw InputError("scan-step is given without track; the places that the sensor passes are needed");
    if (settings.scan_step && !settings.scan_period_s)
        throw InputError("scan-step is given without scan-period; the time of a full turn of the antenna is needed");
    if (settings.scan_period_s && !settings.scan_step)
        throw InputError(
            "scan-period is given without scan-step; the azimuth bins that are seen from one place are needed");
}

void check_observers(const Settings& settings) {
    if (settings.observers.empty()) {
        constexpr const char* alone = " is given without observers; a file of points is needed";
        if (settings.at_least) throw InputError(text("at-least", alone));
        if (!settings.observers_layer.empty()) throw InputError(text("observers-layer", alone));
        return;
    }
    if (settings.coverage.layer != CoverageLayer::mask)
        throw InputError(
            text("layer is ", *find_key("layer")->get(settings),
                 ", and observers is given; accepted: mask (how many see a post, or with at-least a mask)"));
    if (settings.source == SourceKind::spilled)
        throw InputError(
            "source is spilled, and observers is given; a spill is sorted round one place (accepted: auto, direct; "
            "tile turns rasters that windows read badly into a store)");
}

/// A mask is worth nothing where two of its values are one; what is no mask has none.
void check_mask(const Settings& settings) {
    const MaskValues& mask = settings.coverage.mask;
    struct Value {
        const char* key;
        std::int64_t value;
        bool given;
    };
    const auto of = [&](const char* key, std::int64_t value) {
        return Value{key, value, settings.given.contains(key)};
    };
    const Value seen = of("seen-value", mask.seen), hidden = of("hidden-value", mask.hidden),
                outside = of("outside-value", mask.outside),
                no_data = of("no-data-value", settings.no_data_value.value_or(mask.no_data));
    const bool counts = !settings.observers.empty() && !settings.at_least;
    for (const Value& one : {seen, hidden, outside, no_data}) {
        if (!one.given) continue;
        if (counts)
            throw InputError(text(settings.spelled(one.key),
                                  " is given, and observers without at-least; counts have no such value (0 is seen by "
                                  "none, 65535 no data)"));
        if (settings.coverage.layer != CoverageLayer::mask)
            throw InputError(text(settings.spelled(one.key), " is given, and layer is ",
                                  *find_key("layer")->get(settings),
                                  "; of the layers the mask alone has such a value"));
    }
    if (settings.snap_to_post) return;  // as gdal_viewshed, whose own defaults are alike
    const std::pair<Value, Value> apart[] = {{seen, hidden}, {seen, no_data}, {hidden, no_data}, {seen, outside}};
    for (const auto& [a, b] : apart) {
        if (a.value != b.value || !(a.given || b.given)) continue;
        const auto& [named, other] = a.given ? std::pair(a, b) : std::pair(b, a);
        throw InputError(text(settings.spelled(named.key), " is ", named.value, ", and so is ",
                              other.given ? settings.spelled(other.key) : text("--", other.key, " by default"),
                              "; accepted: three values for what is seen, hidden and no data, and another than seen "
                              "for what is outside"));
    }
}

}  // namespace

void check_temp_dir(const Settings& settings) {
    if (settings.temp_dir.empty()) return;
    std::error_code error;
    const bool folder = std::filesystem::is_directory(settings.temp_dir, error);
    if (folder && ::access(settings.temp_dir.c_str(), W_OK | X_OK) == 0) return;
    const std::string why = error ? error.message() : folder ? system_reason(errno) : "it is no folder";
    throw IoError(text("temp-dir ", in_quotes(settings.temp_dir), " cannot be used: ", why,
                       "; accepted: a folder that can be written to"));
}

void check_complete(const Settings& settings) {
    const PlatformParams& platform = settings.scene.platform;
    if (settings.dem.empty()) throw InputError("dem is missing; the path of a terrain raster is needed");
    const bool moves = !settings.track.empty(), many = !settings.observers.empty();
    check_scan(settings);
    if (!settings.power_stack.empty() && !moves)
        throw InputError(
            "power-stack is given without track; its bands are the frames of one (power is a single image's)");
    check_observers(settings);
    check_mask(settings);
    if (!moves && !many && !platform.latlon && !platform.xy)
        throw InputError("the sensor's position is missing; exactly one of latlon and xy is needed");
    if (platform.latlon && platform.xy) throw InputError("latlon and xy are both given; exactly one of them is needed");
    if (!moves && !many && !settings.altitude_given) {
        throw InputError(
            "the sensor's altitude is missing; exactly one of altitude-msl, altitude-agl and altitude-hae is needed");
    }
    if (platform.altitude_above == AltitudeAbove::ellipsoid && !platform.geoid_offset_m) {
        throw InputError(
            "altitude-hae is given without geoid-offset; the height of the geoid above the ellipsoid at the sensor is "
            "needed");
    }
    if (!settings.culture.empty() && settings.culture_legend.empty()) refuse_missing_legend("culture is given");
    // A tile store may bring a culture of its own.
    if (settings.culture.empty() && !settings.culture_legend.empty() && !is_tile_store(settings.dem))
        refuse_legend_alone(in_quotes(settings.culture_legend));
    if (!moves && settings.work_dir.empty()) {
        const char* const key = settings.resume ? "resume" : settings.only_wedges ? "only-wedge" : nullptr;
        if (key) throw InputError(text(key, " is given without work-dir; the folder that keeps the wedges is needed"));
    }
    if (moves) {
        const char* const of_one = !settings.work_dir.empty() ? "work-dir"
                                   : settings.resume          ? "resume"
                                   : settings.only_wedges     ? "only-wedge"
                                                              : nullptr;
        if (of_one)
            throw InputError(
                text(of_one,
                     " is given beside track; a work folder keeps the wedges of one picture, and finished pictures of "
                     "a track stay anyhow (to go on after a stop, give the rows that are left)"));
        if (settings.source == SourceKind::spilled)
            throw InputError(
                "source is spilled, and track is given; a spill is sorted round one place (accepted: auto, direct; "
                "tile turns rasters that windows read badly into a store)");
    } else if (!many) {
        validate(settings.scene);
    }
}

}  // namespace wedgescope
