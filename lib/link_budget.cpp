#include "lib/link_budget.hpp"

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
        : scene_(scene), source_(source), params_(params) {
        const PolarGrid& shown = scene.shown;
        const std::int64_t circle = shown.circle_bins,
                           after = ((azimuth_bin - shown.azimuth_bins.begin) % circle + circle) % circle;
        if (after >= shown.azimuth_bins.size() || range_bin < shown.range_bins.begin ||
            range_bin >= shown.range_bins.end)
            throw Error(text("cell ", azimuth_bin, ",", range_bin, " is not in the image"));
        const std::int64_t bin = (azimuth_bin % circle + circle) % circle;
        look_at(scene_, {bin, bin + 1});
        // An image that goes round has all azimuths in it.
        row_ = static_cast<std::size_t>(bin - scene_.shown.azimuth_bins.begin);
        column_ = static_cast<std::size_t>(range_bin - shown.range_bins.begin);
        params_.archive = nullptr;
        params_.only_wedges.reset();
        params_.progress = {};
        params_.beside_others = true;
    }

    const ResolvedScene& scene() const { return scene_; }

    /// From now on means alone: what is drawn takes the longest.
    void draw_no_more() { scene_.scene.receiver.speckle_looks = 0, scene_.scene.receiver.noise = false; }
    /// With these tables in place of the scene's.
    void sweep(const SceneTables& tables) {
        params_.tables = std::make_shared<const SceneTables>(tables);
        swept_ = measure(scene_, source_, params_, std::move(swept_));
        // Without what the rain sends.
        echo_ = power_image(swept_.echo_w, scene_.shown, beam_setting(scene_), std::move(echo_));
    }
    double echo_w() const { return at(echo_); }
    double echo_w(const SceneTables& tables) {
        sweep(tables);
        return echo_w();
    }
    double power_w() const { return at(swept_.power_w); }
    double received_w() const { return at(swept_.received_w); }
    State state() const {
        const PolarGrid& swept = swept_.echo_state.grid;
        const std::int64_t circle = swept.circle_bins,
                           bin = scene_.shown.azimuth_bins.begin + static_cast<std::int64_t>(row_),
                           row = ((bin - swept.azimuth_bins.begin) % circle + circle) % circle,
                           column = scene_.shown.range_bins.begin + static_cast<std::int64_t>(column_) -
                                    swept.range_bins.begin;
        return static_cast<State>(swept_.echo_state.row(static_cast<std::size_t>(row))[column]);
    }

private:
    double at(const PolarImage<float>& image) const { return static_cast<double>(image.row(row_)[column_]); }

    ResolvedScene scene_;
    WedgeSource& source_;
    EngineParams params_;
    std::size_t row_ = 0, column_ = 0;
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

/// Classes whose ground (walls) returns something, with what it is. Asks for many at once, and then for halves of those.
class Parts {
public:
    Parts(Cell& cell, const SceneTables& bare, double watts_per_m2)
        : cell_(cell), bare_(bare), watts_per_m2_(watts_per_m2), classes_(bare.laws.gamma().size()) {}

    void find(std::size_t first, std::size_t end, bool wall, double all_m2 = -1) {
        if (first >= end) return;
        if (all_m2 < 0) all_m2 = cross_section_m2(first, end, wall);
        if (!(all_m2 > 0)) return;
        if (end - first == 1) {
            LinkPart part{static_cast<ClassId>(first), wall, all_m2, 0};
            SceneTables areas = bare_;
            areas.laws =
                wall ? ClassLaws::area_of_walls(classes_, part.id) : ClassLaws::area_of_ground(classes_, part.id);
            part.area_m2 = cell_.echo_w(areas) / watts_per_m2_;
            parts.push_back(part);
            return;
        }
        const std::size_t middle = first + (end - first) / 2;
        const double lower_m2 = cross_section_m2(first, middle, wall);
        find(first, middle, wall, lower_m2);
        // What one half returns alone the other does not.
        find(middle, end, wall, lower_m2 > 0 ? -1 : all_m2);
    }

    std::vector<LinkPart> parts;

private:
    double cross_section_m2(std::size_t first, std::size_t end, bool wall) {
        const std::vector<bool> none(classes_, false);
        std::vector<bool> some = none;
        std::fill(some.begin() + static_cast<std::ptrdiff_t>(first), some.begin() + static_cast<std::ptrdiff_t>(end),
                  true);
        SceneTables tables = bare_;
        tables.laws = wall ? bare_.laws.only(none, some) : bare_.laws.only(some, none);
        return cell_.echo_w(tables) / watts_per_m2_;
    }

    Cell& cell_;
    const SceneTables& bare_;
    double watts_per_m2_;
    std::size_t classes_;
};

double slant_of(const ResolvedScene& s, double range_m) {
    return s.scene.display.kind == DisplayKind::gpi_true ? s.earth.slant_range_m(s.sensor_m, s.reference_m, range_m)
                                                         : range_m;
}

double ratio(double to, double from) { return from > 0 ? to / from : 1; }

}  // namespace

double LinkBudget::product_w() const {
    return transmit_w * gain * wavelength_m2 * losses * spreading_m4 * cross_section_m2 * pattern * gases * rain *
           cloud;
}

LinkBudget link_budget(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params,
                       std::int64_t azimuth_bin, std::int64_t range_bin) {
    Cell cell(scene, source, params, azimuth_bin, range_bin);
    const ResolvedScene& s = cell.scene();
    const RadarParams& radar = s.scene.radar;
    const PolarGrid& grid = s.shown;

    LinkBudget b;
    b.azimuth_bin = azimuth_bin, b.range_bin = range_bin;
    b.azimuth_rad = (static_cast<double>(azimuth_bin) + 0.5) * grid.azimuth_step_rad();
    b.range_m = (static_cast<double>(range_bin) + 0.5) * grid.range_bin_m;
    b.slant_range_m = slant_of(s, b.range_m);
    // The pulse paints an echo from its range outwards.
    const double behind_m = radar.pulse_length_error ? 0.25 * 2 * radar.pulse_length_scale * radar.pulse_extent_m() : 0;
    b.echo_range_m = std::max(1.0, b.slant_range_m - behind_m);

    b.transmit_w = radar.transmit_power_w;
    b.gain = std::pow(radar.gain.ratio(), 2);
    b.wavelength_m2 = std::pow(radar.wavelength_m(), 2) / std::pow(4 * std::numbers::pi, 3);
    b.losses = 1 / radar.losses.ratio();
    b.spreading_m4 = std::pow(b.echo_range_m, -4);
    const double watts_per_m2 = b.transmit_w * b.gain * b.wavelength_m2 * b.losses * b.spreading_m4;

    SceneTables tables(s.scene);
    cell.sweep(tables);
    b.state = cell.state();
    b.echo_w = cell.echo_w();
    b.power_w = cell.power_w();
    b.received_w = cell.received_w();
    b.noise_w = s.noise_power_w;
    b.blanked = b.received_w == 0;
    cell.draw_no_more();
    const ReceiverParams& receiver = scene.scene.receiver;
    const bool drawn = receiver.noise || receiver.speckle_looks > 0;
    b.fluctuation = drawn && !b.blanked ? ratio(b.received_w, b.power_w + b.noise_w) : 1;
    if (s.scene.weather.rain_mm_h > 0) {
        const std::vector<bool> none(tables.laws.gamma().size(), false);
        SceneTables rain_alone = tables;
        rain_alone.laws = tables.laws.only(none, none);
        cell.sweep(rain_alone);
        b.rain_echo_w = cell.power_w();
    }

    // From the receiver back to the ground.
    double last_w = b.echo_w;
    WeatherParams weather = tables.weather.params();
    const auto without = [&](double& loss) {
        tables.weather = Weather(weather, radar.frequency_hz);
        const double clearer_w = cell.echo_w(tables);
        loss = ratio(last_w, clearer_w);
        last_w = clearer_w;
    };
    if (weather.liquid_water_g_m3 > 0) weather.liquid_water_g_m3 = 0, without(b.cloud);
    if (weather.rain_mm_h > 0) weather.rain_mm_h = 0, without(b.rain);
    if (weather.vapour_g_m3) weather.vapour_g_m3.reset(), without(b.gases);
    tables.pattern = even_pattern();
    const double even_w = cell.echo_w(tables);
    b.pattern = ratio(last_w, even_w);
    b.cross_section_m2 = even_w / watts_per_m2;

    const DataBase& db = source.data_base();
    Parts parts(cell, tables, watts_per_m2);
    const std::size_t classes = tables.laws.gamma().size();
    if (db.has_culture)
        parts.find(0, classes, false);
    else
        parts.find(db.default_class, db.default_class + std::size_t{1}, false);
    if (db.has_culture_height) parts.find(0, classes, true);
    b.parts = std::move(parts.parts);
    std::stable_sort(b.parts.begin(), b.parts.end(),
                     [](const LinkPart& x, const LinkPart& y) { return x.cross_section_m2 > y.cross_section_m2; });

    const double drop_rad = level_depression_rad(s.earth, s.sensor_m, s.reference_m, b.echo_range_m);
    if (const auto arc_m = s.earth.arc_m(s.sensor_m, s.reference_m, b.echo_range_m)) {
        const double grazing = s.earth.sight(s.sensor_m, s.reference_m, *arc_m).grazing_rad;
        // Round the vertical the beam has no elevation that would bound it; the cell is then no more than the pulse's ring.
        if (grazing > 0 && drop_rad < 89 * degree)
            b.level_area_m2 = cell_area(radar.antenna.beam, radar.antenna.width, radar.pulse_extent_m(), b.echo_range_m,
                                        Angle::radians(grazing))
                                  .pulse_m2;
    }

    const double dbm = rounded_dbm(b.received_w);
    const Receiver set(receiver, radar);
    b.received_dbm = dbm;
    b.mds_dbm = set.mds_dbm();
    b.stc_db = stc_db(receiver, b.slant_range_m);
    b.levels = receiver_levels(receiver, b.mds_dbm, dbm, b.stc_db);
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
    Earth earth = s.earth;
    if (s.geometry == Geometry::geodesic) {
        const auto there = db.lat_lon(at.column, at.row);
        if (!there)
            throw InputError(
                fmt::format("column {:.1f}, row {:.1f} of '{}' is no place on earth", at.column, at.row, db.name));
        double azimuth = 0, back = 0;
        GeographicLib::Geodesic::WGS84().Inverse(s.lat_deg, s.lon_deg, there->first, there->second, arc_m, azimuth,
                                                 back);
        azimuth_rad = azimuth * degree;
        if (s.scene.earth_k) earth = Earth(*s.scene.earth_k * euler_radius_m(s.lat_deg * degree, azimuth_rad));
    } else {
        const double east_m = (at.column - s.nadir.column) * db.step_x * db.metres_per_unit,
                     north_m = (at.row - s.nadir.row) * db.step_y * db.metres_per_unit;
        arc_m = std::hypot(east_m, north_m);
        azimuth_rad = std::atan2(east_m, north_m);
    }
    place.azimuth_rad = azimuth_rad < 0 ? azimuth_rad + 2 * std::numbers::pi : azimuth_rad;
    place.range_m =
        s.scene.display.kind == DisplayKind::gpi_true ? arc_m : earth.slant_range_m(s.sensor_m, surface_m, arc_m);
    return place;
}

std::optional<std::pair<double, double>> level_place(const ResolvedScene& s, const DataBase& db, double azimuth_rad,
                                                     double range_m) {
    const auto arc_m = s.scene.display.kind == DisplayKind::gpi_true
                           ? std::optional(range_m)
                           : s.earth.arc_m(s.sensor_m, s.reference_m, range_m);
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
