#include "lib/run_setting.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "lib/detail.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {
namespace {

/// No arc of this slant range is longer, down to 2 km below sea level.
double most_arc_m(const ResolvedScene& s, const DataBase& db, double range_m) {
    const double theta = range_m * s.earth.inverse_radius();
    return rounded(range_m * (1.0005 + theta * theta / 4) + arc_margin_m(db), 10);
}

/// Sine of the elevation of the horizon of a smooth earth at the data base's lowest height.
double smooth_horizon(const ResolvedScene& scene, const DataBase& data_base, BlockMap& bounds) {
    const int level = bounds.levels() - 1;
    float lowest = std::numeric_limits<float>::infinity();
    for (const BlockBounds& b :
         bounds.read(level, blocks_of({{0, data_base.columns}, {0, data_base.rows}}, level)).bounds)
        lowest = std::min(lowest, b.lowest_m);
    const double inverse = scene.earth.inverse_radius(), height = static_cast<double>(lowest);
    if (!(height < scene.sensor_m)) return -1;
    const double cosine = (1 + height * inverse) / (1 + scene.sensor_m * inverse);
    return -std::sqrt(1 - cosine * cosine);
}

/// For bins of ground range: those over the posts round the nadir hold nothing nearer than the highest of these. Half of that, for
/// what stands on them is as sure as a shape of metres is.
NearestGround nearest_ground(const ResolvedScene& s, const SpokeMap& map) {
    const Chunk& patch = s.nadir_patch;
    if (s.scene.display.kind != DisplayKind::gpi_true || patch.window.empty()) return {};
    double highest_m = -infinite;
    for (const float z : patch.surface_m)
        if (z == z) highest_m = std::max(highest_m, static_cast<double>(z));
    const Window& w = patch.window;
    const double posts = std::min({s.nadir.column - static_cast<double>(w.columns.begin),
                                   static_cast<double>(w.columns.end - 1) - s.nadir.column,
                                   s.nadir.row - static_cast<double>(w.rows.begin),
                                   static_cast<double>(w.rows.end - 1) - s.nadir.row}),
                 post_m = std::min(map.metres_per_post(Quadrant::south, 0), map.metres_per_post(Quadrant::east, 0));
    if (highest_m == -infinite || !(posts > 0)) return {};
    return {0.9 * posts * post_m, std::max(1.0, 0.5 * (s.sensor_m - highest_m))};
}

}  // namespace

SpokeMapParams swept_map_params(const ResolvedScene& s, const DataBase& db) {
    // How densely spokes lie goes by the range, not by where bins end, unless these are long.
    constexpr double most_beyond = 1.05;
    const double to_range = most_arc_m(s, db, *s.scene.range_m), to_bin = most_arc_m(s, db, outermost_m(s)),
                 max_arc_m = to_bin > most_beyond * to_range ? to_bin : to_range;
    return {.geometry = s.geometry,
            .nadir = s.nadir,
            .lat_deg = s.lat_deg,
            .lon_deg = s.lon_deg,
            .earth_k = s.scene.earth_k,
            .max_arc_m = max_arc_m,
            .margin_m = arc_margin_m(db),
            .beyond_m = to_bin - max_arc_m,
            .range_m = s.scene.range_m};
}

SpokeSetting::SpokeSetting(const ResolvedScene& s, WedgeSource& source)
    : map(source.data_base(), swept_map_params(s, source.data_base())), levels(choose_levels(s, source, map)),
      sampling(sampling_of(s, source.data_base())),
      grid(source.data_base(), map, sampling, s.swept.circle_bins, levels) {}

RunSetting::RunSetting(const ResolvedScene& s, WedgeSource& source, std::shared_ptr<const SceneTables> made,
                       const PathLossTable* loss)
    : SpokeSetting(s, source), scene(s), data_base(source.data_base()),
      tables(made ? std::move(made) : std::make_shared<const SceneTables>(s.scene)),
      cells(quanta(s.swept.range_bins, s.swept.range_bin_m, radar_constant(s.scene.radar), tables->pattern.most(),
                   grid.azimuth_step_rad(),
                   tables->laws.most() * (lights_far_shores(s.scene, data_base) ? tables->shore.most() : 1),
                   nearest_ground(s, map))),
      refinement(refinement_of(s, sampling)) {
    sweep.data_base = &data_base;
    sweep.grid = &grid;
    sweep.sampling = sampling;
    sweep.sensor_m = s.sensor_m;
    sweep.reference_m = s.reference_m;
    sweep.nadir_surface_m = s.nadir_on_data ? s.nadir_surface_m : std::numeric_limits<double>::quiet_NaN();
    sweep.nadir_patch = &s.nadir_patch;
    // The bins may end before the scene's range, which decides where the spokes are.
    const double last_m = static_cast<double>(s.swept.range_bins.end) * s.swept.range_bin_m,
                 of_level_m = grid.max_arc_m() - map.params().max_arc_m - map.params().beyond_m;
    sweep.max_arc_m = std::min(grid.max_arc_m(), most_arc_m(s, data_base, last_m) + of_level_m);
    constexpr double least_radius_m = 6335439;  // of the WGS84 meridian, at the equator
    sweep.most_theta = s.scene.earth_k ? grid.max_arc_m() / (*s.scene.earth_k * least_radius_m) : 0;
    sweep.range_bin_m = s.swept.range_bin_m;
    sweep.range_is_ground = s.scene.display.kind == DisplayKind::gpi_true;
    sweep.pattern = &tables->pattern;
    sweep.constant = radar_constant(s.scene.radar);
    sweep.laws = &tables->laws;
    if (lights_far_shores(s.scene, data_base)) sweep.shore = &tables->shore;
    sweep.loss = loss;
    sweep.source = &source;
    if (BlockMap* bounds = source.block_map()) sweep.smooth_sine = smooth_horizon(s, data_base, *bounds);
}

const SweepScene& RunSetting::sweep_of(int round) const {
    if (round == 0) return sweep;
    Finer& finer = finer_[static_cast<std::size_t>(round - 1)];
    std::call_once(finer.made, [&] {
        finer.grid.emplace(grid.finer(1 << round));
        finer.sweep = sweep;
        finer.sweep.grid = &*finer.grid;
    });
    return finer.sweep;
}

}  // namespace wedgescope
