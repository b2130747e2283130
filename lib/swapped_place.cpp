#include "lib/swapped_place.hpp"

#include <cmath>

#include "lib/error.hpp"

namespace wedgescope {

const char* swapped_hint(const PlatformParams& platform, const DataBase& data_base) {
    if (platform.xy) {
        const auto holds = [&](double x, double y) {
            return data_base.holds(
                {(x - data_base.origin_x) / data_base.step_x, (y - data_base.origin_y) / data_base.step_y});
        };
        const PointXY& at = *platform.xy;
        return !holds(at.x, at.y) && holds(at.y, at.x) ? " (X,Y swapped?)" : "";
    }
    if (!platform.latlon || !data_base.has_crs || std::abs(platform.latlon->lon_deg) > 90) return "";
    const auto holds = [&](double lat_deg, double lon_deg) {
        try {
            return data_base.holds(data_base.locate(lat_deg, lon_deg));
        } catch (const DataError&) {
            return false;  // no place of the CRS
        }
    };
    const LatLon& at = *platform.latlon;
    return !holds(at.lat_deg, at.lon_deg) && holds(at.lon_deg, at.lat_deg) ? " (LAT,LON swapped?)" : "";
}

}  // namespace wedgescope
