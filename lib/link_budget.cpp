#include "lib/link_budget.hpp"

#include <fmt/format.h>
#include <GeographicLib/Geodesic.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "lib/error.hpp"
#include "lib/radar_equation.hpp"
#include "lib/raised_source.hpp"

namespace wedgescope {
namespace {

constexpr double degree = std::numbers::pi / 180;

/// Sweeps of the azimuths that one cell gathers, of one scene.
class Cell {
public:
    Cell(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params, std::int64_t azimuth_bin,
         std::int64_t range_bin)
        : scene_(scene), source_(source), params_(params), range_bin_(range_bin) {
        const PolarGrid& shown = scene.shown;
        if (shown.row_of(azimuth_bin) >= shown.azimuth_count() || !shown.range_bins.contains(range_bin))
            throw Error(text("cell ", azimuth_bin, ",", range_bin, " is not in the image"));
        azimuth_bin_ = bins_after(azimuth_bin, 0, shown.circle_bins);
        look_at(scene_, {azimuth_bin_, azimuth_bin_ + 1});
        params_.archive = nullptr;
        params_.only_wedges.reset();
        params_.progress = {};
        params_.beside_others = true;
    }

    const ResolvedScene& scene() const { return scene_; }

    /// From now on means alone: what is drawn takes the longest.
    void draw_no_more() { scene_.scene.receiver.speckle_looks = 0, scene_.scene.receiver.noise = false; }
    /// From now on what lies beyond the cell is not swept; tables of what is lost on the way are other ones then, with the same bound.
    void narrow() {
        PolarGrid &shown = scene_.shown, &swept = scene_.swept;
        const std::int64_t lead = lead_in_bins(beam_setting(scene_), shown.range_bin_m);
        shown.range_bins = {range_bin_, range_bin_ + 1};
        swept.range_bins = {std::max(swept.range_bins.begin, range_bin_ - lead), range_bin_ + 1};
    }
    /// With these tables in place of the scene's.
    void sweep(const SceneTables& tables) {
        params_.tables = std::make_shared<const SceneTables>(tables);
        swept_ = measure(scene_, source_, params_, std::move(swept_));
    }
    /// Of the ground: without what the rain sends.
    double echo_w() { return gathered(swept_.echo_w); }
    double echo_w(const SceneTables& tables) {
        sweep(tables);
        return echo_w();
    }
    /// Echoes times r^4 of the range bin that they came from, W m^4.
    double unspread() {
        PolarImage<float> echo = swept_.echo_w;
        const PolarGrid& grid = echo.grid;
        for (std::size_t j = 0; j < grid.range_count(); ++j) {
            const double r = std::max(1.0, slant_range_m(scene_, grid.range_of_column_m(j)));
            for (std::size_t i = 0; i < grid.azimuth_count(); ++i)
                echo.row(i)[j] = static_cast<float>(static_cast<double>(echo.row(i)[j]) * (r * r * r * r));
        }
        return gathered(echo);
    }
    double unspread(const SceneTables& tables) {
        sweep(tables);
        return unspread();
    }
    double power_w() const { return at(swept_.power_w); }
    double received_w() const { return at(swept_.received_w); }
    State state() const {
        const PolarGrid& swept = swept_.echo_state.grid;
        return static_cast<State>(
            swept_.echo_state.row(swept.row_of(azimuth_bin_))[range_bin_ - swept.range_bins.begin]);
    }

private:
    double at(const PolarImage<float>& image) const {
        const auto row = static_cast<std::size_t>(azimuth_bin_ - image.grid.azimuth_bins.begin);
        return static_cast<double>(image.row(row)[range_bin_ - image.grid.range_bins.begin]);
    }
    double gathered(const PolarImage<float>& echo) {
        echo_ = power_image(echo, scene_.shown, beam_setting(scene_), std::move(echo_));
        return at(echo_);
    }

    ResolvedScene scene_;
    WedgeSource& source_;
    EngineParams params_;
    std::int64_t azimuth_bin_ = 0, range_bin_ = 0;
    RunResult swept_;
    PolarImage<float> echo_;
};

/// The same lit from all elevations alike.
PatternTable even_pattern() {
    AntennaParams even;
    even.elevation = ElevationPattern::points;
    even.points = {{Angle::degrees(-90), Decibel(0)}, {Angle::degrees(90), Decibel(0)}};
    return PatternTable(even);
}

/// Classes whose ground or walls lie in the cell, with what they return. Asks for the area of many at once, and then for halves
/// of those.
class Parts {
public:
    /// `constant`: what a square metre that returns 1 comes to, W m^4.
    Parts(Cell& cell, const SceneTables& bare, double constant)
        : cell_(cell), bare_(bare), constant_(constant), classes_(bare.laws.gamma().size()) {}

    /// Among classes first.. end - 1, which have `all_m2` together.
    void find(std::size_t first, std::size_t end, bool wall, double all_m2) {
        if (!(all_m2 > 0) || first >= end) return;
        if (end - first == 1) {
            const auto [ground, walls] = masks(first, end, wall);
            SceneTables one = bare_;
            one.laws = bare_.laws.only(ground, walls);
            parts.push_back({static_cast<ClassId>(first), wall, cell_.unspread(one) / constant_, all_m2});
            return;
        }
        const std::size_t middle = first + (end - first) / 2;
        const double lower_m2 = area_m2(first, middle, wall);
        find(first, middle, wall, lower_m2);
        // What one half has alone the other has not.
        find(middle, end, wall, lower_m2 > 0 ? area_m2(middle, end, wall) : all_m2);
    }
    void find(std::size_t first, std::size_t end, bool wall) { find(first, end, wall, area_m2(first, end, wall)); }

    std::vector<LinkPart> parts;

private:
    std::pair<std::vector<bool>, std::vector<bool>> masks(std::size_t first, std::size_t end, bool wall) const {
        std::vector<bool> none(classes_, false), some = none;
        std::fill(some.begin() + static_cast<std::ptrdiff_t>(first), some.begin() + static_cast<std::ptrdiff_t>(end),
                  true);
        return wall ? std::pair(none, some) : std::pair(some, none);
    }
    double area_m2(std::size_t first, std::size_t end, bool wall) {
        const auto [ground, walls] = masks(first, end, wall);
        SceneTables areas = bare_;
        areas.laws = ClassLaws::areas(ground, walls);
        return cell_.unspread(areas) / constant_;
    }

    Cell& cell_;
    const SceneTables& bare_;
    double constant_;
    std::size_t classes_;
};

/// The earth along an azimuth.
Earth earth_towards(const ResolvedScene& s, double azimuth_rad) {
    if (s.geometry != Geometry::geodesic || !s.scene.earth_k) return s.earth;
    return Earth(*s.scene.earth_k * euler_radius_m(s.lat_deg * degree, azimuth_rad));
}

double ratio(double to, double from) { return from > 0 ? to / from : 1; }

/// The angles and the area of the radar equation's cell where the ground is level.
void look_at_level(const ResolvedScene& s, LinkBudget& b) {
    const Earth earth = earth_towards(s, b.azimuth_rad);
    const auto arc_m = earth.arc_m(s.sensor_m, s.reference_m, b.echo_range_m);
    if (!arc_m) return;
    const Earth::Sight sight = earth.sight(s.sensor_m, s.reference_m, *arc_m);
    b.depression = Angle::radians(sight.depression_rad);
    b.grazing = Angle::radians(sight.grazing_rad);
    const RadarParams& radar = s.scene.radar;
    const double scale = radar.pulse_length_error ? radar.pulse_length_scale : 0;
    const double nearest_m = slant_range_m(s, b.range_m - s.shown.range_bin_m / 2) - scale * radar.pulse_extent_m();
    if (!(nearest_m > std::abs(s.sensor_m - s.reference_m)) || !(sight.grazing_rad > 0)) return;
    // At the middle of the pulse; the beam is at most twice as wide in azimuth as it would be on the horizon.
    const double middle_m = b.slant_range_m - scale * radar.pulse_extent_m() / 2;
    const auto middle_arc_m = earth.arc_m(s.sensor_m, s.reference_m, middle_m);
    const double grazing_rad = earth.sight(s.sensor_m, s.reference_m, middle_arc_m.value_or(*arc_m)).grazing_rad;
    b.level_area_m2 = middle_m * two_way_width(radar.antenna.beam).rad() * radar.pulse_extent_m() *
                      std::min(1 / std::cos(grazing_rad), 2.0);
}

}  // namespace

double LinkBudget::product_w() const {
    return transmit_w * gain * wavelength_m2 * losses * spreading_m4 * cross_section_m2 * far_shore * pattern * gases *
           rain * cloud;
}

LinkBudget link_budget(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params,
                       std::int64_t azimuth_bin, std::int64_t range_bin) {
    Cell cell(scene, source, params, azimuth_bin, range_bin);
    const RadarParams& radar = scene.scene.radar;
    const ReceiverParams& receiver = scene.scene.receiver;

    LinkBudget b;
    b.azimuth_bin = azimuth_bin, b.range_bin = range_bin;
    b.azimuth_rad = scene.shown.azimuth_rad(azimuth_bin);
    b.range_m = scene.shown.range_m(range_bin);
    b.slant_range_m = slant_range_m(scene, b.range_m);
    b.transmit_w = radar.transmit_power_w;
    b.gain = std::pow(radar.gain.ratio(), 2);
    b.wavelength_m2 = std::pow(radar.wavelength_m(), 2) / std::pow(4 * std::numbers::pi, 3);
    b.losses = 1 / radar.losses.ratio();
    const double constant = b.transmit_w * b.gain * b.wavelength_m2 * b.losses;

    SceneTables tables(scene.scene);
    cell.sweep(tables);
    b.state = cell.state();
    b.echo_w = cell.echo_w();
    b.power_w = cell.power_w();
    b.received_w = cell.received_w();
    b.noise_w = scene.noise_power_w;
    b.blanked = b.slant_range_m < minimum_range_m(scene);
    const bool drawn = receiver.fluctuates();
    b.fluctuation = drawn && !b.blanked ? ratio(b.received_w, b.power_w + b.noise_w) : 1;
    cell.draw_no_more();
    const std::size_t classes = tables.laws.gamma().size();
    const std::vector<bool> no_class(classes, false);
    if (scene.scene.weather.rain_mm_h > 0) {
        SceneTables rain_alone = tables;
        rain_alone.laws = tables.laws.only(no_class, no_class);
        cell.sweep(rain_alone);
        b.rain_echo_w = cell.power_w();
    }

    // From the receiver back to the ground.
    cell.narrow();
    double last_w = b.echo_w;
    WeatherParams weather = tables.weather.params();
    const auto without = [&](double& effect) {
        const double bare_w = cell.echo_w(tables);
        effect = ratio(last_w, bare_w);
        last_w = bare_w;
    };
    const auto clear = [&](double& loss) {
        tables.weather = Weather(weather, radar.frequency_hz);
        without(loss);
    };
    if (weather.liquid_water_g_m3 > 0) weather.liquid_water_g_m3 = 0, clear(b.cloud);
    if (weather.rain_mm_h > 0) weather.rain_mm_h = 0, clear(b.rain);
    if (weather.vapour_g_m3) weather.vapour_g_m3.reset(), clear(b.gases);
    tables.pattern = even_pattern();
    without(b.pattern);
    if (tables.shore.on()) tables.shore = tables.shore.without_gain(), without(b.far_shore);
    b.cross_section_m2 = cell.unspread() / constant;
    b.echo_range_m = b.slant_range_m;
    if (b.cross_section_m2 > 0) b.echo_range_m = std::pow(constant * b.cross_section_m2 / last_w, 0.25);
    b.spreading_m4 = std::pow(b.echo_range_m, -4);

    const DataBase& db = source.data_base();
    Parts parts(cell, tables, constant);
    if (db.has_culture)
        parts.find(0, classes, false);
    else
        parts.find(db.default_class, db.default_class + std::size_t{1}, false);
    if (db.has_culture_height) parts.find(0, classes, true);
    b.parts = std::move(parts.parts);
    std::stable_sort(b.parts.begin(), b.parts.end(),
                     [](const LinkPart& x, const LinkPart& y) { return x.cross_section_m2 > y.cross_section_m2; });
    look_at_level(scene, b);

    b.received_dbm = rounded_dbm(b.received_w);
    b.mds_dbm = Receiver(receiver, radar).mds_dbm();
    b.stc_db = stc_db(receiver, b.slant_range_m);
    b.levels = receiver_levels(receiver, b.mds_dbm, b.received_dbm, b.stc_db);
    return b;
}

CellPlace cell_place(const ResolvedScene& s, WedgeSource& source, IndexPosition at) {
    const DataBase& db = source.data_base();
    SceneSource ground(source, s.scene);
    const double surface_m = ground_height(*ground, at).surface_m;
    if (!(surface_m == surface_m))
        throw InputError(fmt::format("the place is column {:.1f}, row {:.1f} of '{}'; no height is known there",
                                     at.column, at.row, db.name));
    CellPlace place;
    place.surface_m = surface_m;
    double arc_m = 0, azimuth_rad = 0;
    if (s.geometry == Geometry::geodesic) {
        const auto there = db.lat_lon(at.column, at.row);
        if (!there)
            throw InputError(
                fmt::format("column {:.1f}, row {:.1f} of '{}' is no place on earth", at.column, at.row, db.name));
        double azimuth = 0, back = 0;
        GeographicLib::Geodesic::WGS84().Inverse(s.lat_deg, s.lon_deg, there->first, there->second, arc_m, azimuth,
                                                 back);
        azimuth_rad = azimuth * degree;
    } else {
        const double east_m = (at.column - s.nadir.column) * db.step_x * db.metres_per_unit,
                     north_m = (at.row - s.nadir.row) * db.step_y * db.metres_per_unit;
        arc_m = std::hypot(east_m, north_m);
        azimuth_rad = std::atan2(east_m, north_m);
    }
    place.azimuth_rad = azimuth_rad < 0 ? azimuth_rad + 2 * std::numbers::pi : azimuth_rad;
    place.range_m = s.scene.display.kind == DisplayKind::gpi_true
                        ? arc_m
                        : earth_towards(s, azimuth_rad).slant_range_m(s.sensor_m, surface_m, arc_m);
    return place;
}

std::optional<std::pair<double, double>> level_place(const ResolvedScene& s, const DataBase& db, double azimuth_rad,
                                                     double range_m) {
    const auto arc_m = s.scene.display.kind == DisplayKind::gpi_true
                           ? std::optional(range_m)
                           : earth_towards(s, azimuth_rad).arc_m(s.sensor_m, s.reference_m, range_m);
    if (!arc_m) return std::nullopt;
    if (s.geometry == Geometry::geodesic) {
        double lat = 0, lon = 0;
        GeographicLib::Geodesic::WGS84().Direct(s.lat_deg, s.lon_deg, azimuth_rad / degree, *arc_m, lat, lon);
        return std::pair(lat, lon);
    }
    const double column = s.nadir.column + *arc_m * std::sin(azimuth_rad) / (db.step_x * db.metres_per_unit),
                 row = s.nadir.row + *arc_m * std::cos(azimuth_rad) / (db.step_y * db.metres_per_unit);
    if (db.has_crs) return db.lat_lon(column, row);
    return std::pair(db.origin_x + column * db.step_x, db.origin_y + row * db.step_y);
}

}  // namespace wedgescope
