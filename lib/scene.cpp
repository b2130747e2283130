#include "lib/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

void validate(const PlatformParams& platform) {
    if (platform.latlon && platform.xy) throw InputError("latlon and xy are both given; exactly one of them is needed");
    if (!platform.latlon && !platform.xy)
        throw InputError("neither latlon nor xy is given; exactly one of them is needed");
    if (platform.latlon) {
        require_within("latlon: latitude", platform.latlon->lat_deg, -90, 90, "deg");
        require_within("latlon: longitude", platform.latlon->lon_deg, -360, 360, "deg");
    }
    if (platform.xy) {
        if (!std::isfinite(platform.xy->x) || !std::isfinite(platform.xy->y))
            throw InputError(text("xy is ", platform.xy->x, ",", platform.xy->y, "; both must be finite"));
    }
    switch (platform.altitude_above) {
        case AltitudeAbove::sea_level:
            require_within("altitude-msl", platform.altitude_m, -10000, 1e6, "m");
            break;
        case AltitudeAbove::ground:
            require_within("altitude-agl", platform.altitude_m, 0, 1e6, "m");
            break;
        case AltitudeAbove::ellipsoid:
            require_within("altitude-hae", platform.altitude_m, -10000, 1e6, "m");
            if (!platform.geoid_offset_m)
                throw InputError(
                    "altitude-hae needs geoid-offset, the height of the geoid (sea level) above the ellipsoid at the "
                    "sensor");
            break;
    }
    if (platform.geoid_offset_m) require_within("geoid-offset", *platform.geoid_offset_m, -200, 200, "m");
    require_within("heading", platform.heading.deg(), -360, 360, "deg");
}

void validate(const Sector& sector) {
    require_within("sector: from", sector.from.deg(), -720, 720, "deg");
    const double width_deg = sector.to.deg() - sector.from.deg();
    // A hair more than 360 so that a full turn given in degrees passes after its way through radians.
    if (!(width_deg > Sector::least_width_deg && width_deg <= 360 + 1e-9))
        throw InputError(
            fmt::format("sector is {:.12g},{:.12g} deg; it must be wider than 1e-9 and at most 360, clockwise",
                        sector.from.deg(), sector.to.deg()));
}

}  // namespace

void validate(const Scene& scene) {
    validate(scene.platform);
    if (scene.earth_k) require_within("earth", *scene.earth_k, 0.1, 1e6, "");
    if (scene.sector) validate(*scene.sector);
    if (scene.range_m) require_above_to("range", *scene.range_m, 0, Scene::most_range_m, "m");
    require_within("range-start", scene.range_start_m, 0, Scene::most_range_m - 1000, "m");
    if (scene.range_m && !(*scene.range_m > scene.range_start_m))
        throw InputError(
            text("range is ", *scene.range_m, " m; it must be above range-start, ", scene.range_start_m, " m"));
    if (scene.ground_range_m) require_above_to("ground-range", *scene.ground_range_m, 0, 1e7, "m");
    if (scene.azimuth_bins) require_within("azimuth-bins", static_cast<double>(*scene.azimuth_bins), 1, 1e6, "");
    if (scene.range_bin_m) require_within("range-bin", *scene.range_bin_m, 0.001, 1e6, "m");
    validate(scene.radar);
    validate(scene.receiver);
    if (scene.display.sweep_delay_m) require_within("sweep-delay", *scene.display.sweep_delay_m, 0, 1e7, "m");
    require_within("size", static_cast<double>(scene.display.size), 16, 32768, "pixels");
    if (scene.display.centre) {
        require_within("centre: x", scene.display.centre->x, -1, 1, "");
        require_within("centre: y", scene.display.centre->y, -1, 1, "");
    }
    if (scene.display.ring_spacing_m) require_above_to("ring-spacing", *scene.display.ring_spacing_m, 0, 1e7, "m");
    if (scene.display.azimuth_marks_rad) {
        constexpr double nano = 1e9;  // its last digits are those of the way through radians
        const double deg = Angle::radians(*scene.display.azimuth_marks_rad).deg();
        require_within("azimuth-marks", std::round(deg * nano) / nano, 1, 180, "deg");
    }
    if (scene.spokes_per_post) require_within("spokes-per-post", *scene.spokes_per_post, 0.25, 16, "");
    if (scene.spokes_per_bin) require_within("spokes-per-bin", *scene.spokes_per_bin, 2, 256, "");
    if (scene.spoke_lead) require_within("spoke-lead", *scene.spoke_lead, 1, 64, "");
    if (scene.gamma) require_within("gamma", scene.gamma->db(), -100, 100, "dB");
    require_within("sea-state", scene.sea_state, 0, 6, "");
    if (scene.water == WaterModel::calm && scene.sea_state > 0)
        throw InputError(text("sea-state is ", scene.sea_state,
                              "; with water calm it must be 0 (the waves are those of water nrl)"));
    if (scene.wind_from) {
        constexpr double nano = 1e9;  // its last digits are those of the way through radians
        const double deg = std::round(scene.wind_from->deg() * nano) / nano;
        require_within("wind-direction", deg, -360, 360, "deg");
        if (scene.water == WaterModel::calm)
            throw InputError(text("wind-direction is ", deg,
                                  " deg; with water calm it must be none (the waves are those of water nrl)"));
    }
    if (scene.gamma)
        for (const auto& [name, given] :
             {std::pair("wind-direction", scene.wind_from.has_value()), {"far-shore", scene.far_shore}})
            if (given)
                throw InputError(text(name,
                                      " is given with gamma, which is one for everything, water too; accepted: one of "
                                      "them"));
    if (scene.far_shore) require_within("frequency with far-shore", scene.radar.frequency_hz / 1e9, 0.5, 40, "GHz");
    const ClassLawParams laws = laws_of(scene);
    for (const Material& material : scene.materials.rows()) class_law(material, laws);
    validate(weather_of(scene), scene.radar.frequency_hz);
}

ClassLawParams laws_of(const Scene& scene) {
    return {
        scene.materials, scene.radar.frequency_hz, scene.radar.polarisation, scene.land, scene.water, scene.sea_state,
        scene.gamma,     scene.wind_from,          scene.far_shore,          scene.walls};
}

std::vector<float> raises_m(const Scene& scene) {
    std::vector<float> raises;
    const std::vector<Material>& rows = scene.materials.rows();
    if (scene.walls != Walls::statistical ||
        std::none_of(rows.begin(), rows.end(), [](const Material& m) { return m.structures.has_value(); }))
        return raises;
    for (const Material& m : rows) raises.push_back(m.structures ? static_cast<float>(m.structures->raise_m()) : 0.0F);
    return raises;
}

WeatherParams weather_of(const Scene& scene) {
    WeatherParams weather = scene.weather;
    switch (scene.radar.polarisation) {
        case Polarisation::hh:
            weather.tilt = horizontal_tilt;
            break;
        case Polarisation::vv:
            weather.tilt = vertical_tilt;
            break;
        case Polarisation::circular:
            weather.tilt = circular_tilt;
            break;
    }
    return weather;
}

PowerError promised_error(Quality quality) {
    switch (quality) {
        case Quality::exact:
            return {0.02, 0.06};
        case Quality::fine:
            return {0.05, 0.2};
        case Quality::normal:
            return {0.1, 0.35};
        case Quality::draft:
            return {0.4, 1.5};
    }
    return {};
}

std::optional<Quality> quality_within(double rms_db) {
    for (const Quality quality : {Quality::draft, Quality::normal, Quality::fine, Quality::exact})
        if (promised_error(quality).rms_db <= rms_db) return quality;
    return std::nullopt;
}

const char* word(Geometry geometry) { return geometry == Geometry::geodesic ? "geodesic" : "grid"; }

const char* word(DisplayKind kind) {
    switch (kind) {
        case DisplayKind::gpi:
            return "gpi";
        case DisplayKind::gpi_true:
            return "gpi-true";
        case DisplayKind::ppi:
            return "ppi";
        case DisplayKind::tdppi:
            return "tdppi";
    }
    return "";
}

const char* word(Orientation orientation) { return orientation == Orientation::north ? "north" : "heading"; }

const char* word(Quality quality) {
    switch (quality) {
        case Quality::exact:
            return "exact";
        case Quality::fine:
            return "fine";
        case Quality::normal:
            return "normal";
        case Quality::draft:
            return "draft";
    }
    return "";
}

const char* word(ElevationPattern pattern) {
    switch (pattern) {
        case ElevationPattern::gaussian:
            return "gaussian";
        case ElevationPattern::csc2:
            return "csc2";
        case ElevationPattern::cos_csc2:
            return "cos-csc2";
        case ElevationPattern::points:
            return "points";
    }
    return "";
}

const char* word(AzimuthPattern pattern) { return pattern == AzimuthPattern::gaussian ? "gaussian" : "uniform"; }

const char* word(LandModel model) {
    switch (model) {
        case LandModel::constant_gamma:
            return "constant-gamma";
        case LandModel::ulaby_dobson:
            return "ulaby-dobson";
        case LandModel::oh:
            return "oh";
    }
    return "";
}

const char* word(Walls walls) { return walls == Walls::resolved ? "resolved" : "statistical"; }

const char* word(WaterModel model) { return model == WaterModel::nrl ? "nrl" : "calm"; }

}  // namespace wedgescope
