// resolve(): asks the data base where the sensor stands and turns every default into a number.
#include <fmt/format.h>
#include <GeographicLib/Geodesic.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>

#include "lib/coverage.hpp"
#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "lib/raised_source.hpp"
#include "lib/rounding.hpp"
#include "lib/spoke_map.hpp"
#include "lib/surroundings.hpp"
#include "lib/swapped_place.hpp"

namespace wedgescope {
namespace {

constexpr double degree = std::numbers::pi / 180;

}  // namespace

GroundHeight ground_height(WedgeSource& source, IndexPosition p) {
    const DataBase& db = source.data_base();
    const bool inside = (db.cyclic || (p.column >= 0 && p.column <= static_cast<double>(db.columns - 1))) &&
                        p.row >= 0 && p.row <= static_cast<double>(db.rows - 1);
    constexpr double none = std::numeric_limits<double>::quiet_NaN();
    if (!inside) return {none, none};
    const auto c = static_cast<std::int64_t>(std::floor(p.column)), r = static_cast<std::int64_t>(std::floor(p.row));
    const double u = p.column - static_cast<double>(c), v = p.row - static_cast<double>(r);
    // Exactly on a line the posts beside it do not count, and may lie outside.
    const Window window{{c, c + (u > 0 ? 2 : 1)}, {r, r + (v > 0 ? 2 : 1)}};
    const Chunk chunk = source.load(window, false);
    GroundHeight ground{0, 0};
    for (std::int64_t j = window.rows.begin; j < window.rows.end; ++j)
        for (std::int64_t i = window.columns.begin; i < window.columns.end; ++i) {
            const double weight = (i == c ? 1 - u : u) * (j == r ? 1 - v : v);
            ground.bare_m += weight * static_cast<double>(source.bare_terrain_m(i, j));
            ground.surface_m += weight * static_cast<double>(chunk.surface_m[window.at(i, j)]);
        }
    return ground;
}

namespace {

void locate(ResolvedScene& s, const DataBase& db) {
    const PlatformParams& p = s.scene.platform;
    if (p.latlon) {
        if (!db.has_crs)
            throw InputError(text("latlon needs a raster with a CRS; '", db.name,
                                  "' has none (give xy in the raster's own coordinates)"));
        s.lat_deg = p.latlon->lat_deg;
        s.lon_deg = p.latlon->lon_deg;
        s.nadir = db.locate(s.lat_deg, s.lon_deg);
        s.has_lat_lon = true;
    } else if (p.xy) {
        s.nadir = {(p.xy->x - db.origin_x) / db.step_x, (p.xy->y - db.origin_y) / db.step_y};
        if (db.has_crs && !db.crs_in_metres &&
            !(s.nadir.column >= -0.5 && s.nadir.column <= static_cast<double>(db.columns) - 0.5)) {
            // Degrees come round: nearest to the raster's middle, as latitude and longitude are.
            const double circle = 360 / db.step_x, middle = 0.5 * static_cast<double>(db.columns - 1);
            s.nadir.column -= std::round((s.nadir.column - middle) / circle) * circle;
        }
        if (db.has_crs) {
            const auto ll = db.lat_lon(s.nadir.column, s.nadir.row);
            if (!ll)
                throw InputError(
                    text("xy ", p.xy->x, ",", p.xy->y, " is no place on earth in the CRS of '", db.name, "'"));
            std::tie(s.lat_deg, s.lon_deg) = *ll;
            s.has_lat_lon = true;
        }
    } else {
        throw InputError("the sensor has no position; give latlon or xy");
    }
    if (!(std::abs(s.nadir.column) < 1e8) || !(std::abs(s.nadir.row) < 1e8))
        throw InputError(text("the sensor's position, ", p.latlon ? "latitude, longitude " : "x, y ",
                              p.latlon ? p.latlon->lat_deg : p.xy->x, ",", p.latlon ? p.latlon->lon_deg : p.xy->y,
                              ", is column ", s.nadir.column, ", row ", s.nadir.row, " on the grid of '", db.name,
                              "'; accepted: within 1e8 posts of its first one", swapped_hint(p, db)));
    s.nadir = {rounded(s.nadir.column, position_bits), rounded(s.nadir.row, position_bits)};
    s.x = db.origin_x + s.nadir.column * db.step_x;
    s.y = db.origin_y + s.nadir.row * db.step_y;
}

/// In the outer half of an outermost cell, where no four posts stand round a place.
bool beyond_posts(const DataBase& db, IndexPosition p) {
    const auto within = [](double at, std::int64_t posts) { return at >= 0 && at <= static_cast<double>(posts - 1); };
    return !(within(p.row, db.rows) && (db.cyclic || within(p.column, db.columns)));
}

void stand(ResolvedScene& s, WedgeSource& source) {
    const DataBase& db = source.data_base();
    const PlatformParams& p = s.scene.platform;
    const GroundHeight place = ground_height(source, s.nadir);
    const double ground = place.bare_m;
    s.nadir_in_raster = db.holds(s.nadir);
    s.nadir_beyond_posts = beyond_posts(db, s.nadir);
    s.nadir_on_data = ground == ground;
    s.reference_m = s.nadir_on_data ? ground : 0;
    switch (p.altitude_above) {
        case AltitudeAbove::sea_level:
            s.sensor_m = p.altitude_m;
            break;
        case AltitudeAbove::ellipsoid:
            s.sensor_m = p.altitude_m - p.geoid_offset_m.value_or(0);
            break;
        case AltitudeAbove::ground:
            if (!s.nadir_on_data)
                throw InputError(fmt::format(
                    "altitude-agl needs terrain below the sensor; column {:.1f}, row {:.1f} of '{}' is {} (give "
                    "altitude-msl){}",
                    s.nadir.column, s.nadir.row, db.name,
                    !s.nadir_in_raster     ? "outside the raster"
                    : s.nadir_beyond_posts ? "beyond its outermost posts"
                                           : "void",
                    swapped_hint(p, db)));
            s.sensor_m = ground + p.altitude_m;
            break;
    }
    if (s.nadir_on_data && s.sensor_m < ground)
        throw InputError(
            fmt::format("the sensor is {:.1f} m below the terrain: it stands at {:.1f} m, the ground there at {:.1f} m "
                        "above sea level",
                        ground - s.sensor_m, s.sensor_m, ground));
    s.nadir_surface_m = place.surface_m <= s.sensor_m ? place.surface_m : ground;
    s.inside_m = s.nadir_on_data ? std::max(0.0, place.surface_m - s.sensor_m) : 0;
    if (s.nadir_in_raster) {
        constexpr std::int64_t arm = 4;
        const auto c = static_cast<std::int64_t>(std::floor(s.nadir.column)),
                   r = static_cast<std::int64_t>(std::floor(s.nadir.row));
        const Window all{db.cyclic ? Interval{c - arm, c + arm + 1} : Interval{0, db.columns}, {0, db.rows}};
        const Window window{intersection({c - arm, c + arm + 1}, all.columns),
                            intersection({r - arm, r + arm + 1}, all.rows)};
        if (!window.empty()) s.nadir_patch = source.load(window, false);
    }
    if (std::abs(s.sensor_m) > 1e6)
        throw InputError(
            text("the sensor's altitude is ", std::round(s.sensor_m), " m above the sea; it must be within 1000 km"));
}

void choose_earth(ResolvedScene& s) {
    if (!s.scene.earth_k) return;  // plane
    double radius = mean_radius_m;
    if (s.geometry == Geometry::geodesic) {
        const EllipsoidRadii r = ellipsoid_radii(s.lat_deg * degree);
        radius = std::sqrt(r.meridian_m * r.normal_m);
    }
    s.earth = Earth(*s.scene.earth_k * radius);
}

/// Arc to the farthest of some posts on the raster's edge, and as much more as a spoke's course may be off there; infinite where
/// one of them has no place on earth (a disc in its square).
double farthest_edge_m(const ResolvedScene& s, const DataBase& db) {
    double farthest = 0;
    bool whole = true;
    const auto& geod = GeographicLib::Geodesic::WGS84();
    const auto reach = [&](double column, double row) {
        double arc = 0;
        if (s.geometry == Geometry::geodesic) {
            const auto ll = db.lat_lon(column, row);
            if (!ll) {
                whole = false;
                return;
            }
            geod.Inverse(s.lat_deg, s.lon_deg, ll->first, ll->second, arc);
        } else {
            arc =
                std::hypot((column - s.nadir.column) * db.step_x, (row - s.nadir.row) * db.step_y) * db.metres_per_unit;
        }
        farthest = std::max(farthest, arc);
    };
    constexpr int parts = 16;
    for (int i = 0; i <= parts; ++i) {
        const double c = static_cast<double>(db.columns - 1) * i / parts,
                     r = static_cast<double>(db.rows - 1) * i / parts;
        reach(c, 0);
        reach(c, static_cast<double>(db.rows - 1));
        reach(0, r);
        reach(static_cast<double>(db.columns - 1), r);
    }
    if (!whole) return infinite;
    return s.geometry == Geometry::geodesic ? farthest + SpokeMap::tolerance_posts * db.longer_post_m() : farthest;
}

void check_range(const Scene& scene, const Earth& earth, double range_m) {
    if (range_m > earth.farthest_m())
        throw InputError(fmt::format("range is {:.0f} m; at most {:.0f} m on this earth", range_m, earth.farthest_m()));
    if (scene.range_start_m >= range_m)
        throw InputError(
            text("range-start is ", scene.range_start_m, " m; it must be below the range, ", range_m, " m"));
}

/// Of an open range in radii: it ends a little beyond the farthest post.
constexpr double farthest_post_radii = 0.29;

[[noreturn]] void refuse_without_range(const ResolvedScene& s) {
    throw InputError(text("the raster's edge has no place on earth that a range could follow from; give a range",
                          s.earth.inverse_radius() > 0 ? fmt::format(" of at most {:.0f} m on this earth",
                                                                     farthest_post_radii / s.earth.inverse_radius())
                                                       : ""));
}

/// The nearer of the farthest edge post and what the horizon allows: the slant range to the highest or the lowest terrain there,
/// whichever is farther away, or along the ground for a picture of ground ranges; and a hair more, for posts compare what they come by
/// in other ways.
double default_range(const ResolvedScene& s, WedgeSource& source) {
    const Extremes e = source.extremes();
    if (!e.any_valid)
        throw DataError(text("range is auto, and '", source.data_base().name, "' holds no valid post; give a range"));
    const double highest = static_cast<double>(e.highest_m);
    const double farthest = farthest_edge_m(s, source.data_base());
    // Horizons over the lowest ground, should it lie below sea level.
    const double low = std::min({0.0, static_cast<double>(e.lowest_m), s.sensor_m});
    const double horizon =
        s.earth.horizon_arc_m(s.sensor_m - low) + s.earth.horizon_arc_m(std::max(0.0, highest - low));
    const double arc =
        std::min({farthest, horizon, s.earth.inverse_radius() > 0 ? 2.5 / s.earth.inverse_radius() : farthest});
    if (arc == infinite) refuse_without_range(s);
    double range = arc;
    if (s.scene.display.kind != DisplayKind::gpi_true) {
        range = 0;
        for (const double height_m : {highest, static_cast<double>(e.lowest_m), s.reference_m})
            range = std::max(range, s.earth.sight(s.sensor_m, height_m, arc).slant_range_m);
    }
    return std::max(1.0, range) * (1 + 0x1p-32);
}

}  // namespace

BeamSetting beam_setting(const ResolvedScene& s) {
    BeamSetting b;
    b.antenna = s.scene.radar.antenna;
    b.beam_width_error = s.scene.radar.beam_width_error;
    b.pulse_length_error = s.scene.radar.pulse_length_error;
    b.beam_width_scale = s.scene.radar.beam_width_scale;
    b.pulse_length_scale = s.scene.radar.pulse_length_scale;
    b.pulse_extent_m = s.scene.radar.pulse_extent_m();
    b.sensor_m = s.sensor_m;
    b.reference_m = s.reference_m;
    b.earth = s.earth;
    b.range_is_ground = s.scene.display.kind == DisplayKind::gpi_true;
    return b;
}

DisplaySetting display_setting(const ResolvedScene& s) {
    DisplaySetting d;
    d.params = s.scene.display;
    d.shown = s.shown;
    d.heading = s.scene.platform.heading;
    d.sensor_m = s.sensor_m;
    d.reference_m = s.reference_m;
    d.sweep_delay_m = s.sweep_delay_m;
    d.range_start_m = s.scene.range_start_m;
    d.range_m = s.scene.range_m.value_or(0);
    d.earth = s.earth;
    return d;
}

namespace {

/// Metres from post to post below the sensor, along rows and along columns.
std::array<double, 2> post_sides_m(const ResolvedScene& s, const DataBase& db) {
    std::array<double, 2> sides_m = {std::abs(db.step_x) * db.metres_a_unit(),
                                     std::abs(db.step_y) * db.metres_a_unit()};
    const auto here =
        db.lat_lon && s.geometry == Geometry::geodesic ? db.lat_lon(s.nadir.column, s.nadir.row) : std::nullopt;
    if (!here) return sides_m;
    for (const std::size_t along : {0, 1}) {
        const auto there = db.lat_lon(s.nadir.column + (along == 0 ? 1 : 0), s.nadir.row + (along == 1 ? 1 : 0));
        if (!there) continue;
        double metres = 0;
        GeographicLib::Geodesic::WGS84().Inverse(here->first, here->second, there->first, there->second, metres);
        sides_m[along] = rounded_significand(metres, 30);
    }
    return sides_m;
}

/// Place, height and earth.
ResolvedScene resolve_place(const Scene& scene, WedgeSource& given) {
    validate(scene);
    SceneSource own(given, scene);
    WedgeSource& source = *own;
    const DataBase& db = source.data_base();
    ResolvedScene s;
    s.scene = scene;
    s.geometry = scene.geometry.value_or(db.has_crs ? Geometry::geodesic : Geometry::grid);
    if (s.geometry == Geometry::geodesic && !db.has_crs)
        throw InputError(text("geometry is geodesic; '", db.name,
                              "' has no CRS (give geometry grid, or assign a CRS with gdal_edit.py -a_srs)"));
    if (s.geometry == Geometry::grid && !db.crs_in_metres)
        throw InputError(text("geometry is grid; '", db.name,
                              "' is in degrees, and grid geometry needs metres (give geometry geodesic)"));
    locate(s, db);
    if (s.geometry == Geometry::geodesic && is_at_pole(s.lat_deg))
        throw InputError(text("the sensor is within 1 m of a pole; geodesic geometry has no azimuth there (",
                              db.crs_in_metres ? "give geometry grid, or " : "give ", "a place farther off)"));
    stand(s, source);
    choose_earth(s);
    const auto sides_m = post_sides_m(s, db);
    std::tie(s.shorter_post_m, s.longer_post_m) = std::minmax(sides_m[0], sides_m[1]);
    s.scene.geometry = s.geometry;
    return s;
}

}  // namespace

ResolvedScene resolve_coverage(const Scene& scene, WedgeSource& source) {
    ResolvedScene s = resolve_place(scene, source);
    const double limit_m = scene.ground_range_m.value_or(std::numeric_limits<double>::infinity());
    if (!scene.range_m) {
        // A slant range that holds every post: the chord of the farthest arc and all heights there may be.
        constexpr double highest_m = 1e5;
        const double farthest = std::min(farthest_edge_m(s, source.data_base()), limit_m);
        if (farthest == infinite) refuse_without_range(s);
        s.scene.range_m = 1.01 * farthest + std::abs(s.sensor_m) + highest_m;
        if (s.earth.inverse_radius() * farthest > farthest_post_radii)
            throw InputError(fmt::format(
                "the raster reaches {:.0f} m from the sensor{}; give a range of at most {:.0f} m on this earth{}",
                farthest, s.nadir_in_raster ? "" : ", which lies outside of it (is its position right?)",
                farthest_post_radii / s.earth.inverse_radius(), swapped_hint(scene.platform, source.data_base())));
        s.farthest_arc_m = 1.01 * farthest;
    } else {
        const double range = *scene.range_m;
        check_range(scene, s.earth, range);
        const double theta = range * s.earth.inverse_radius();
        s.range_limited = true;
        s.farthest_arc_m = std::min(range * (1.0005 + theta * theta / 4), 1.01 * limit_m);
    }
    return s;
}

void look_at(ResolvedScene& s, Interval azimuth_bins) {
    const std::int64_t circle = s.shown.circle_bins, skirt = skirt_bins(beam_setting(s), circle);
    s.shown.azimuth_bins = azimuth_bins.size() == circle ? Interval{0, circle} : azimuth_bins;
    s.swept.azimuth_bins = {s.shown.azimuth_bins.begin - skirt, s.shown.azimuth_bins.end + skirt};
    if (s.swept.azimuth_bins.size() >= circle) s.swept.azimuth_bins = {0, circle};
    if (s.swept.azimuth_bins.begin < 0)
        s.swept.azimuth_bins = {s.swept.azimuth_bins.begin + circle, s.swept.azimuth_bins.end + circle};
}

namespace {

/// Range bins from 0 m on, the last one being the one that the range ends in.
std::int64_t bins_up_to(double range_m, double bin_m) {
    return static_cast<std::int64_t>(std::ceil(range_m / bin_m - 1e-9));
}

/// Bins, noise and display of a scene whose place and range are known.
void resolve_view(ResolvedScene& s, const Scene& scene) {
    const double range = *s.scene.range_m;
    check_range(scene, s.earth, range);

    // Bins.
    if (!scene.azimuth_bins) s.scene.azimuth_bins = default_azimuth_bins(scene.radar);
    if (!scene.range_bin_m) s.scene.range_bin_m = default_range_bin_m(scene.radar);
    const std::int64_t circle = *s.scene.azimuth_bins;
    const double bin = *s.scene.range_bin_m;
    if (range / bin > 1e8)
        throw InputError(
            text("range-bin is ", bin, " m; with a range of ", range, " m it must be at least ", range / 1e8, " m"));
    s.shown.circle_bins = s.swept.circle_bins = circle;
    s.shown.range_bin_m = s.swept.range_bin_m = bin;
    s.shown.range_bins = {static_cast<std::int64_t>(std::floor(scene.range_start_m / bin + 1e-9)),
                          bins_up_to(range, bin)};
    if (scene.sector && scene.sector->to.deg() - scene.sector->from.deg() < 360 - 1e-9) {
        const double step = 360.0 / static_cast<double>(circle);
        const double from = scene.platform.heading.deg() + scene.sector->from.deg(),
                     to = scene.platform.heading.deg() + scene.sector->to.deg();
        Interval a{static_cast<std::int64_t>(std::floor(from / step + 1e-9)),
                   static_cast<std::int64_t>(std::ceil(to / step - 1e-9))};
        a.end = std::min(std::max(a.end, a.begin + 1), a.begin + circle);
        const std::int64_t turns =
            static_cast<std::int64_t>(std::floor(static_cast<double>(a.begin) / static_cast<double>(circle)));
        s.shown.azimuth_bins = {a.begin - turns * circle, a.end - turns * circle};
    } else {
        s.shown.azimuth_bins = {0, circle};
    }
    const std::int64_t lead = lead_in_bins(beam_setting(s), bin);
    s.swept.range_bins = {std::max<std::int64_t>(0, s.shown.range_bins.begin - lead), s.shown.range_bins.end};
    look_at(s, s.shown.azimuth_bins);

    s.noise_power_w = scene.radar.noise_power_w();
    s.sweep_delay_m = scene.display.sweep_delay_m.value_or(std::max(0.0, s.sensor_m - s.reference_m));
    s.scene.display.sweep_delay_m = s.sweep_delay_m;
    require_rings(display_setting(s));
}

}  // namespace

double outermost_m(const ResolvedScene& s) {
    const double range_m = *s.scene.range_m;
    if (!s.scene.range_bin_m) return range_m;
    return std::max(range_m, static_cast<double>(bins_up_to(range_m, *s.scene.range_bin_m)) * *s.scene.range_bin_m);
}

ResolvedScene resolve(const Scene& scene, WedgeSource& source) {
    ResolvedScene s = resolve_place(scene, source);
    if (!scene.range_m) s.scene.range_m = default_range(s, source);
    resolve_view(s, scene);
    look_around(s, source);
    if (scene.weather.rain_mm_h > 0) s.rain_floor = rain_floor(s, source);
    return s;
}

ResolvedScene resolve(const Scene& scene, const ResolvedScene& place) {
    validate(scene);
    ResolvedScene s = place;
    s.scene = scene;
    s.scene.geometry = place.geometry;
    if (!scene.range_m) s.scene.range_m = place.scene.range_m;
    resolve_view(s, scene);
    return s;
}

}  // namespace wedgescope
