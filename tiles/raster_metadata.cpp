#include "tiles/raster_metadata.hpp"

#include <fmt/format.h>

#include "lib/engine.hpp"
#include "tiles/raster_format.hpp"

namespace wedgescope {

std::string fifteen_digits(double value) { return fmt::format("{:.15g}", value + 0.0); }  // never -0

Metadata run_metadata(const RasterFormat& format) {
    Metadata items;
    items.emplace_back("SOFTWARE", format.version.empty() ? "wedgescope" : "wedgescope " + format.version);
    if (!format.scene_json.empty()) items.emplace_back("SCENE_JSON", format.scene_json);
    return items;
}

Metadata scene_metadata(const ResolvedScene& scene, const RasterFormat& format) {
    Metadata items = run_metadata(format);
    items.emplace_back("REFERENCE_HEIGHT_M", fifteen_digits(scene.reference_m));
    if (scene.has_lat_lon) {
        items.emplace_back("SENSOR_LAT", fifteen_digits(scene.lat_deg));
        items.emplace_back("SENSOR_LON", fifteen_digits(scene.lon_deg));
    }
    items.emplace_back("SENSOR_X", fifteen_digits(scene.x));
    items.emplace_back("SENSOR_Y", fifteen_digits(scene.y));
    items.emplace_back("SENSOR_HEIGHT_M", fifteen_digits(scene.sensor_m));
    return items;
}

}  // namespace wedgescope
