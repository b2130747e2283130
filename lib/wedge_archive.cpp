#include "lib/wedge_archive.hpp"

#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "lib/refine.hpp"

namespace wedgescope {

std::vector<Fact> echo_facts(const ResolvedScene& s, const DataBase& db) {
    std::vector<Fact> facts;
    const auto add = [&](const char* name, const auto&... values) { facts.push_back({name, text(values...)}); };
    add("dem columns and rows", db.columns, " x ", db.rows);
    add("dem origin", db.origin_x, ",", db.origin_y);
    add("dem posting", db.step_x, ",", db.step_y, " units of ", db.metres_per_unit, " m");
    add("dem CRS", db.crs_wkt);
    add("dem circle", db.cyclic ? db.cycle_columns : 0);
    add("culture", db.has_culture, " ", db.culture_columns, " x ", db.culture_rows, " from ", db.culture_column_offset,
        ",", db.culture_row_offset, " by ", db.culture_column_scale, ",", db.culture_row_scale);
    add("codes", db.legend_sum);
    add("culture-height", db.has_culture_height);
    add("material", static_cast<int>(db.default_class));

    const Scene& scene = s.scene;
    add("geometry", word(s.geometry));
    add("latlon", s.lat_deg, ",", s.lon_deg);
    add("xy", s.nadir.column, ",", s.nadir.row);
    add("altitude", s.sensor_m);
    add("ground below", s.reference_m, " ", s.nadir_on_data, " ", s.nadir_in_raster, " ",
        s.nadir_on_data ? s.nadir_surface_m : 0.0);
    add("earth", scene.earth_k ? text(*scene.earth_k) : std::string("flat"));
    add("range", scene.range_m.value_or(0));
    add("quality", word(scene.quality));
    const Sampling sampled = sampling_of(s, db);
    add("spokes-per-post", sampled.spokes_per_post);
    add("spokes-per-bin", sampled.spokes_per_bin);
    add("posts above", sampled.above_posts);
    const Refinement refinement = refinement_of(s, sampled);
    add("refined from", refinement.least_db, " ", refinement.cell_db, " ", refinement.floor_w);
    add("spoke-lead", sampled.lead);
    add("crossings", sampled.cross_lines);
    add("course", sampled.exact_course ? "curved" : "straight");
    add("detail", scene.detail);
    add("azimuth-bins", s.swept.circle_bins);
    add("range-bin", s.swept.range_bin_m);
    add("sector", s.swept.azimuth_bins.begin, "..", s.swept.azimuth_bins.end);
    add("range-start", s.swept.range_bins.begin, "..", s.swept.range_bins.end);
    add("display", scene.display.kind == DisplayKind::gpi_true ? "ground" : "slant", " range");

    const RadarParams& radar = scene.radar;
    add("frequency", radar.frequency_hz);
    add("transmit-power", radar.transmit_power_w);
    add("gain", radar.gain.db());
    add("losses", radar.losses.db());
    add("class-table", scene.materials.own().empty() ? "as shipped" : scene.materials.own());
    add("gamma", scene.gamma ? text(scene.gamma->db()) : std::string("off"));
    add("backscatter", word(scene.land));
    add("water", word(scene.water), " ", scene.water == WaterModel::nrl ? scene.sea_state : 0.0);
    add("wind-direction", may_be_windy(laws_of(scene)) ? text(scene.wind_from->rad()) : std::string("none"));
    add("far-shore", scene.far_shore ? "on" : "off");
    add("walls", word(scene.walls));
    add("polarisation", word(radar.polarisation));
    const WeatherParams& air = scene.weather;
    add("gases", air.vapour_g_m3 ? text(*air.vapour_g_m3) : std::string("none"));
    add("rain", air.rain_mm_h > 0 ? text(air.rain_mm_h, " to ", air.rain_top_m) : std::string("clear"));
    add("cloud", air.liquid_water_g_m3 > 0
                     ? text(air.liquid_water_g_m3, " from ", air.cloud_base_m, " to ", air.cloud_top_m)
                     : std::string("none"));
    const AntennaParams& antenna = radar.antenna;
    add("antenna", word(antenna.elevation));
    add("antenna-knee", antenna.knee.rad());
    add("antenna-width", antenna.width.rad());
    add("antenna-exponent", antenna.elevation == ElevationPattern::cos_csc2 ? antenna.exponent : 0.0);
    if (antenna.elevation == ElevationPattern::points) {
        std::string all;
        for (const PatternPoint& point : antenna.points)
            all += text(all.empty() ? "" : ";", point.depression.rad(), ",", point.gain.db());
        add("antenna points", all);
    }
    add("antenna-floor", antenna.floor.db());
    add("tilt", antenna.tilt.rad());
    return facts;
}

std::vector<Window> posts_of(const SpokeGrid& grid, const Wedge& wedge, const Window& nadir_patch) {
    constexpr std::int64_t strip = 64;
    std::vector<Window> windows;
    if (!nadir_patch.empty()) windows.push_back(nadir_patch);
    for (const SpokeRun& run : wedge.runs) {
        const std::vector<Ring>& rings = grid.rings(run.own_fan());
        for (std::size_t ring = 0; ring < rings.size(); ++ring)
            for (Interval lines = rings[ring].lines; !lines.empty();) {
                const Fan fan = run.own_fan();
                const Interval part = intersection(grid.strip_lines(fan, lines.begin, strip), lines);
                const Window window = grid.window(fan, rings[ring].spokes, run.spokes[ring], part);
                if (!window.empty()) windows.push_back(raster_posts(window, grid.level(fan, part.begin)));
                lines.begin = part.end;
            }
    }
    return windows;
}

}  // namespace wedgescope
