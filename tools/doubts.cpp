#include "tools/doubts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "lib/block_map.hpp"
#include "lib/error.hpp"
#include "lib/far_shore.hpp"
#include "lib/rain_echo.hpp"
#include "lib/raised_source.hpp"
#include "lib/swapped_place.hpp"
#include "tiles/tile_store.hpp"

namespace wedgescope {
namespace {

/// Of culture whose legend is not known it may.
bool may_hold_water(const Scene& scene, const DataBase& db, const std::optional<Legend>& legend) {
    const std::vector<Material>& classes = scene.materials.rows();
    if (is_of_water(classes[db.default_class])) return true;
    if (!db.has_culture) return false;
    return !legend || std::any_of(legend->classes().begin(), legend->classes().end(),
                                  [&](const auto& code) { return is_of_water(classes[code.second]); });
}

bool echoes(const RunResult& r) {
    return std::any_of(r.power_w.cells.begin(), r.power_w.cells.end(), [](float power_w) { return power_w > 0; });
}

/// Without reading posts; +infinity: not known so.
double lowest_known_m(WedgeSource& source) {
    double lowest_m = std::numeric_limits<double>::infinity();
    BlockMap* const map = source.block_map();
    if (!map) return lowest_m;
    const DataBase& db = source.data_base();
    const int level = map->levels() - 1;
    try {
        for (const BlockBounds& b : map->read(level, blocks_of({{0, db.columns}, {0, db.rows}}, level)).bounds)
            lowest_m = std::min(lowest_m, static_cast<double>(b.lowest_m));
    } catch (const IoError&) {  // a remark is not worth a run
    } catch (const DataError&) {
    }
    return lowest_m;
}

/// What stands on the ground is higher than metres would have it; empty: it is not, or nothing was loaded.
std::string culture_too_tall(const SourceReport& source, double scale) {
    // No woods and no towns stand so high on average.
    constexpr double most_m = 80;
    constexpr std::uint64_t enough = 30;
    const double mean_m = source.mean_culture_m;
    if (source.raised_posts < enough || mean_m <= most_m) return {};
    const std::string high =
        fmt::format("culture-height: what stands on the ground is {:.0f} m high on average", mean_m);
    if (scale == 1 && mean_m < 10 * most_m)
        return high + "; if the raster counts tenths of a metre, culture-height-scale is 0.1";
    return high + fmt::format(" (culture-height-scale is {:.6g}; or is a no-data value not declared?)", scale);
}

/// A line of those keys that are set and have no effect, if there are any; `why` goes on from "no effect".
void add_idle(std::initializer_list<std::pair<const char*, bool>> keys, const char* why,
              std::vector<std::string>& lines) {
    std::vector<const char*> idle;
    for (const auto& [key, set] : keys)
        if (set) idle.push_back(key);
    if (!idle.empty())
        lines.push_back(
            fmt::format("{} {} no effect{}", fmt::join(idle, " and "), idle.size() > 1 ? "have" : "has", why));
}

using Doubts = std::array<std::string, doubt_count>;

void doubt_rain(const ResolvedScene& scene, Doubts& lines) {
    const WeatherParams& weather = scene.scene.weather;
    double lowest_m = scene.rain_floor.empty() ? scene.reference_m : infinite;
    for (const std::vector<RainFloor>& ray : scene.rain_floor)
        lowest_m = std::min(lowest_m, lowest_rain_m(ray, scene.reference_m));
    if (weather.rain_mm_h > 0 && weather.rain_top_m <= lowest_m)
        lines[low_rain] = fmt::format(
            "rain-top is {:.6g} m, and the ground around lies at {:.0f} m or higher: rain has no echo of its own",
            weather.rain_top_m, lowest_m);
}

void doubt_cloud(const ResolvedScene& scene, Doubts& lines) {
    const WeatherParams& weather = scene.scene.weather;
    if (!(weather.liquid_water_g_m3 > 0)) return;
    if (scene.nadir_on_data && weather.cloud_top_m <= scene.reference_m)
        lines[low_cloud] = fmt::format(
            "cloud-top is {:.6g} m, and the ground below the sensor lies at {:.0f} m: it weakens only what lies lower",
            weather.cloud_top_m, scene.reference_m);
    constexpr double frozen_m = 8500;  // -40 C in the standard atmosphere: no water stays liquid
    if (weather.cloud_top_m > frozen_m)
        lines[frozen_cloud] = fmt::format(
            "cloud-top is {:.6g} m: above {:.0f} m, at -40 C, a cloud is ice, which weakens far less than liquid water "
            "does",
            weather.cloud_top_m, frozen_m);
}

void doubt_place(const ResolvedScene& scene, Doubts& lines) {
    constexpr double air_m = 30000;  // from here on rays are nearer to straight lines than to those of the lower air
    if (scene.sensor_m > air_m && scene.scene.earth_k && *scene.scene.earth_k > 1.01)
        lines[high_sensor] = fmt::format(
            "the sensor is {:.4g} km up: earth {:.4g} bends rays as the lower air does; --earth 1 is nearer to the "
            "truth there",
            scene.sensor_m * 1e-3, *scene.scene.earth_k);
    if (scene.inside_m > 0)
        lines[inside_something] = fmt::format(
            "the sensor stands inside of what rises there, {:.1f} m below its top: it sees what stands as high close "
            "around it, and little else",
            scene.inside_m);
    // Of the chord between two posts; the sweep knows the earth's curve at samples alone.
    constexpr double most_bulge_m = 20;
    const double bulge_m = scene.longer_post_m * scene.longer_post_m * scene.earth.inverse_radius() / 8;
    if (bulge_m > most_bulge_m)
        lines[coarse_posts] = fmt::format(
            "posts are {:.0f} km apart, and between two of them the earth bulges by {:.0f} m, which no sample counts: "
            "what is hidden is off by some such heights",
            scene.longer_post_m * 1e-3, bulge_m);
}

}  // namespace

std::vector<std::string> doubts_of_rays(const ResolvedScene& scene, bool response) {
    Doubts lines;
    doubt_place(scene, lines);
    if (response) doubt_cloud(scene, lines);
    std::vector<std::string> found;
    for (std::string& line : lines)
        if (!line.empty()) found.push_back(std::move(line));
    return found;
}

std::array<std::string, doubt_count> doubts(const RunResult& r, bool pictured) {
    std::array<std::string, doubt_count> lines;
    const auto count = [&](State s) { return r.report.states[static_cast<std::size_t>(s)]; };
    const double range_km = r.scene.scene.range_m.value_or(0) * 1e-3;
    if (count(State::seen) + count(State::unknown) == 0 && count(State::shadow) == 0)
        lines[nothing_there] = fmt::format(
            "nothing of the terrain lies within the range of {:.4g} km and the sector, or all of it is void", range_km);
    else if (count(State::seen) + count(State::unknown) == 0)
        lines[nothing_seen] = "no ground is seen: all within range and sector is hidden or void";
    else if (pictured && r.scope.lit == 0)
        lines[nothing_lit] = r.scene.scene.receiver.minimum_range_m.value_or(0) * 1e-3 >= range_km
                                 ? "minimum-range is beyond the range: nothing is received"
                             : echoes(r) ? "every echo stays below the tube's black level (a higher if-gain shows more)"
                                         : "nothing that is seen returns an echo (as water at sea-state 0)";
    const double step_deg = Angle::radians(r.scene.swept.azimuth_step_rad()).deg(),
                 beam_deg = r.scene.scene.radar.antenna.beam.deg();
    if (r.scene.scene.radar.beam_width_error && step_deg > 0.5001 * beam_deg)
        lines[wide_bins] = fmt::format(
            "azimuth bins of {:.4g} deg are wider than half the beam of {:.4g} deg: powers come out too "
            "high (azimuth-bins {:.0f} or more)",
            step_deg, beam_deg, std::ceil(720 / beam_deg));
    const double bin_m = r.scene.swept.range_bin_m, pulse_m = r.scene.scene.radar.pulse_extent_m();
    if (bin_m > 1.001 * pulse_m)
        lines[long_bins] = fmt::format(
            "range bins of {:.4g} m are longer than the pulse of {:.4g} m (c tau/2): a cell is the mean over its bin, "
            "so what stands alone comes out up to {:.1f} dB too weak",
            bin_m, pulse_m, 10 * std::log10(bin_m / pulse_m));
    // Physics 6.4; large drops leave Rayleigh's law first.
    constexpr double strong_mm_h = 20;
    const double rain_mm_h = r.scene.scene.weather.rain_mm_h, hz = r.scene.scene.radar.frequency_hz;
    const bool strong = rain_mm_h > strong_mm_h;
    if (rain_mm_h > 0 && hz >= (strong ? 30e9 : 40e9))
        lines[strong_rain] = fmt::format(
            "rain: its own echo is Rayleigh's, good to Ku band{}; at {:.3g} GHz{} it is too strong",
            strong ? "" : " and fair to 35 GHz", hz * 1e-9, strong ? fmt::format(" in {:.3g} mm/h", rain_mm_h) : "");
    if (r.scene.scene.max_error_db && !r.promise.lacks.empty())
        lines[error_unkept] = fmt::format("max-error is not promised here: {}", fmt::join(r.promise.lacks, "; "));
    else if (r.scene.scene.max_error_db && r.promise.from_m > r.scene.scene.range_start_m)
        lines[error_unkept] = fmt::format("max-error is promised from {:.3g} km on, where the beam is two posts wide",
                                          r.promise.from_m * 1e-3);
    // The sweep and the beam's depression go by a level, and over a void or outside nobody knows which. Ground about as low does no harm.
    const double high_m = r.scene.sensor_m - r.scene.clearance_m;
    if (lines[nothing_there].empty() && !r.scene.nadir_on_data && !(std::abs(high_m) <= 0.05 * r.scene.sensor_m))
        lines[no_level] =
            "no height is known below the sensor: the reference height is 0 m, by which the beam widens and ground "
            "range is told, however high the ground stands";
    doubt_rain(r.scene, lines);
    doubt_cloud(r.scene, lines);
    doubt_place(r.scene, lines);
    return lines;
}

std::string above_terrain(const ResolvedScene& scene, const DataBase& db) {
    if (scene.nadir_on_data) return fmt::format(", {:.1f} m above the terrain", scene.sensor_m - scene.reference_m);
    if (scene.nadir_in_raster)
        return scene.nadir_beyond_posts ? ", beyond the terrain's outermost posts" : ", over a void of the terrain";
    return text(", outside the terrain raster", swapped_hint(scene.scene.platform, db));
}

std::vector<std::string> idle_effects(const Scene& scene, const DataBase& db, const std::optional<Legend>& legend) {
    std::vector<std::string> lines;
    if (scene.platform.geoid_offset_m && scene.platform.altitude_above != AltitudeAbove::ellipsoid)
        lines.push_back("geoid-offset has no effect: it brings altitude-hae to sea level");
    const WeatherParams weather = scene.weather, usual;
    if (!(weather.rain_mm_h > 0))
        add_idle({{"rain-top", weather.rain_top_m != usual.rain_top_m}}, " without rain", lines);
    if (!(weather.liquid_water_g_m3 > 0))
        add_idle({{"cloud-base", weather.cloud_base_m != usual.cloud_base_m},
                  {"cloud-top", weather.cloud_top_m != usual.cloud_top_m}},
                 " without cloud", lines);
    const AntennaParams& antenna = scene.radar.antenna;
    if (antenna.elevation != ElevationPattern::cos_csc2)
        add_idle({{"antenna-exponent", antenna.exponent != AntennaParams().exponent}},
                 ": it is that of antenna cos-csc2", lines);
    if (scene.gamma)
        add_idle({{"backscatter", scene.land != LandModel::constant_gamma},
                  {"water", scene.water != WaterModel::nrl},
                  {"sea-state", scene.sea_state > 0}},
                 ": gamma is one for everything", lines);
    if (scene.wind_from && !may_be_windy(laws_of(scene)))
        lines.push_back("wind-direction has no effect: it is that of waves, and there are none");
    if (!scene.gamma && !may_hold_water(scene, db, legend))
        add_idle({{"water", scene.water != WaterModel::nrl},
                  {"sea-state", scene.sea_state > 0},
                  {"wind-direction", scene.wind_from && may_be_windy(laws_of(scene))}},
                 ": no ground is of a class of water, by culture or material", lines);
    if (scene.far_shore && !lights_far_shores(scene, db))
        lines.push_back("far-shore has no effect: water is told from land by culture, and there is none");
    if (scene.walls == Walls::statistical && raises_m(scene, db).empty())
        lines.push_back("walls statistical has no effect: no class of the ground has structures");
    // A class that a table adds, or a name it misspells.
    const std::vector<Material>& classes = scene.materials.rows();
    std::string unnamed;
    for (std::size_t id = material_table().size(); id < classes.size(); ++id) {
        const auto stands_for = [id](const auto& code) { return code.second == id; };
        const bool named = id == db.default_class ||
                           (db.has_culture &&
                            (!legend || std::any_of(legend->classes().begin(), legend->classes().end(), stands_for)));
        if (!named) unnamed += (unnamed.empty() ? "" : ", ") + classes[id].name;
    }
    if (!unnamed.empty())
        lines.push_back(
            fmt::format("class-table adds {}, which neither material nor a code of the culture names", unnamed));
    return lines;
}

std::vector<std::string> idle_receiver(const ReceiverParams& receiver, const DisplayParams& display) {
    std::vector<std::string> lines;
    const ReceiverParams usual;
    if (!receiver.stc_range_m)
        add_idle({{"stc-exponent", receiver.stc_exponent != usual.stc_exponent},
                  {"stc-max", receiver.stc_max.db() != usual.stc_max.db()}},
                 " without stc-range", lines);
    if (!receiver.fluctuates()) add_idle({{"seed", receiver.seed != usual.seed}}, " without noise or speckle", lines);
    if (display.kind != DisplayKind::tdppi)
        add_idle({{"sweep-delay", display.sweep_delay_m.has_value()}}, ": it is that of display tdppi", lines);
    if (!display.rings) add_idle({{"ring-spacing", display.ring_spacing_m.has_value()}}, " without rings", lines);
    return lines;
}

std::string undeclared_void(const std::string& terrain, double lowest_m) {
    constexpr double usual[] = {-9999, -32767, -32768};
    if (std::find(std::begin(usual), std::end(usual), lowest_m) == std::end(usual)) return {};
    const bool store = is_tile_store(terrain);
    return fmt::format(
        "the lowest height of {} is {:g} m, a usual no-data value that it does not declare; if it is one: "
        "gdal_translate -a_nodata {:g} {} COPY.tif{}",
        in_quotes(terrain), lowest_m, lowest_m, store ? "RASTER" : in_quotes(terrain),
        store ? " for each raster that the store was made of, and tile the copies" : "");
}

std::vector<std::string> doubts_of_heights(const std::string& terrain, WedgeSource& source, double culture_scale) {
    const SourceReport seen = source.report();
    std::vector<std::string> lines;
    if (culture_scale != 1 && !source.data_base().has_culture_height)
        lines.emplace_back("culture-height-scale has no effect: there are no culture heights");
    for (std::string line : {undeclared_void(terrain, std::min(lowest_known_m(source), seen.lowest_m)),
                             culture_too_tall(seen, culture_scale)})
        if (!line.empty()) lines.push_back(std::move(line));
    return lines;
}

}  // namespace wedgescope
