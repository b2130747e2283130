// Models of physics 6: the air, its gases, rain, cloud and fog, and what they take from a ray.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include "lib/atmosphere.hpp"
#include "lib/beam.hpp"
#include "lib/path_loss.hpp"
#include "lib/rain.hpp"
#include "lib/rain_echo.hpp"
#include "tools/model_inputs.hpp"
#include "tools/models.hpp"

namespace wedgescope {
namespace {

constexpr double default_frequency_hz = 16.5e9;

ModelInput frequency(double most_ghz) {
    return number("f", "GHz", "frequency", 1, most_ghz).by_default(default_frequency_hz);
}
ModelInput rate() {
    ModelInput input = number("R", "mm/h", "rain rate, or its word", 0, most_rain_mm_h);
    for (const RainCategory& category : rain_categories) input = std::move(input).or_word(category.name);
    return input;
}
double rate_of(const Arguments& a) {
    const auto word = a.word("R");
    return word ? rain_categories[static_cast<std::size_t>(*word)].rate_mm_h : a["R"];
}
ModelInput elevation() { return number("el", "deg", "elevation of the ray", -90, 90).by_default("0deg"); }
ModelInput tilt() {
    return number("t_pol", "deg", "tilt of the polarisation (0 H, 90 V, 45 circular)", 0, 90).by_default("0deg");
}
/// With `pol`, of which the first is linear.
ModelInput tilt_by_polarisation() {
    return number("t_pol", "deg", "tilt of the polarisation (0 H, 90 V; auto: 45 with circular, else 0)", 0, 90)
        .or_word("auto")
        .by_default("auto");
}

WeatherParams weather_params(const Arguments& a) {
    WeatherParams params;
    const auto vapour = a.word("rho0");
    if (!vapour)
        params.vapour_g_m3 = a["rho0"];
    else if (*vapour > 0)
        params.vapour_g_m3 = *vapour == 1 ? normal_vapour_g_m3 : high_vapour_g_m3;
    params.rain_mm_h = rate_of(a);
    params.rain_top_m = a["h_R"];
    params.liquid_water_g_m3 = a["M"];
    params.cloud_base_m = a["h_b"];
    params.cloud_top_m = a["h_c"];
    params.tilt = a.word("t_pol") ? Angle::degrees(*a.word("pol") == 1 ? 45 : 0) : a.angle("t_pol");
    return params;
}

/// Numbers that tell one weather at one frequency from another.
std::vector<double> weather_key(const WeatherParams& w, double frequency_hz) {
    return {w.vapour_g_m3.value_or(-1),
            w.rain_mm_h,
            w.rain_top_m,
            w.liquid_water_g_m3,
            w.cloud_base_m,
            w.cloud_top_m,
            w.tilt.rad(),
            frequency_hz};
}

/// Made line by line of the spectrum, which takes longer than a ray: the last one serves the rows of a table that have the same.
const Weather& weather_of(const WeatherParams& params, double frequency_hz) {
    static std::vector<double> key;
    static std::unique_ptr<const Weather> last;
    if (std::vector<double> now = weather_key(params, frequency_hz); now != key || !last) {
        last = std::make_unique<const Weather>(params, frequency_hz);
        key = std::move(now);
    }
    return *last;
}

/// R is the rain's rate here.
Earth mean_earth(const Arguments& a) { return a.word("k") ? Earth() : Earth(a["k"] * mean_radius_m); }

PathLoss loss_of(const Arguments& a) {
    return path_loss(weather_of(weather_params(a), a["f"]), mean_earth(a), a["hs"], a["r"], -std::sin(a["delta"]));
}

/// Of what is not rain's own: gases, and what rain and cloud take.
std::vector<ModelInput> weather_inputs(const ModelInput& tilt) {
    return {number("rho0", "g/m^3", "water vapour at sea level; none: no gases at all", 0, most_vapour_g_m3)
                .or_word("none")
                .or_word("normal")
                .or_word("high")
                .by_default(normal_vapour_g_m3),
            number("h_R", "m", "top of the rain", -1000, 20e3).by_default(WeatherParams{}.rain_top_m),
            number("M", "g/m^3", "liquid water of cloud or fog", 0, 10).by_default("0"),
            number("h_b", "m", "base of the cloud", -1000, 20e3).by_default("0m"),
            number("h_c", "m", "top of the cloud", -1000, 20e3).by_default("1000m"),
            tilt,
            number("k", "", "factor of the earth's mean radius", 0.1, 1e6).or_word("flat").by_default("4/3")};
}

/// The last one serves too. The largest range grows in octaves, so that a row's result does not hang on the rows before it.
const RainEcho& rain_echo_of(const Arguments& a, double far_m) {
    const WeatherParams params = weather_params(a);
    RainEchoParams echo;
    RadarParams& radar = echo.radar;
    radar.antenna = elevation_antenna(a);
    radar.antenna.azimuth = azimuth_antenna(a).azimuth;
    radar.antenna.beam = azimuth_antenna(a).beam;
    radar.frequency_hz = a["f"];
    radar.transmit_power_w = a["P_t"];
    radar.gain = a.decibel("G_0");
    radar.losses = a.decibel("L_s");
    radar.pulse_s = a["tau"];
    echo.earth = mean_earth(a);
    echo.sensor_m = a["hs"];
    echo.reference_m = a["h_0"];
    radar.polarisation = *a.word("pol") == 1 ? Polarisation::circular : Polarisation::hh;
    echo.most_range_m = 10e3;
    while (echo.most_range_m < far_m) echo.most_range_m *= 2;

    static std::vector<double> key;
    static std::unique_ptr<const RainEcho> last;
    std::vector<double> now = weather_key(params, radar.frequency_hz);
    for (const char* name : {"P_t", "G_0", "L_s", "tau", "theta_3", "beta_0", "theta_el", "p", "tilt", "g_floor"})
        now.push_back(a[name]);
    for (const char* name : {"pattern", "antenna", "pol"}) now.push_back(a.word(name).value_or(-1));
    if (const PatternFile* file = a.file("antenna"))
        for (const PatternPoint& point : file->points) now.insert(now.end(), {point.depression.rad(), point.gain.db()});
    for (const double value : {echo.earth.inverse_radius(), echo.sensor_m, echo.reference_m, echo.most_range_m})
        now.push_back(value);
    if (now != key || !last) {
        const Weather& weather = weather_of(params, radar.frequency_hz);
        const PathLossTable loss(weather,
                                 {echo.earth, echo.sensor_m, echo.most_range_m, std::min(-500.0, echo.reference_m - 1),
                                  std::max(9000.0, params.rain_top_m)});
        last = std::make_unique<const RainEcho>(weather, loss, PatternTable(radar.antenna), echo);
        key = std::move(now);
    }
    return *last;
}

std::vector<ModelInput> rain_volume_inputs() {
    const RadarParams set;
    std::vector<ModelInput> inputs = {
        above("r", "m", "slant range", 0, 1e6),
        number("hs", "m", "height of the antenna above sea level", -1000, 1e6),
        number("h_0", "m", "reference height: a level surface below the rain", -1000, 3000).by_default("0m"),
        rate(),
        frequency(200),
        one_of("pol", "polarisation", {"linear", "circular"}).by_default("linear"),
        number("P_t", "W", "transmitter's peak power", 1e-3, 1e9).by_default(set.transmit_power_w),
        number("G_0", "dB", "peak gain, one-way", -100, 100).by_default(set.gain),
        number("L_s", "dB", "system losses", 0, 100).by_default(set.losses),
        number("tau", "s", "(compressed) length of the pulse", 1e-10, 1e-3).by_default(set.pulse_s)};
    for (auto more : {azimuth_pattern_inputs(), elevation_pattern_inputs(), weather_inputs(tilt_by_polarisation())})
        inputs.insert(inputs.end(), more.begin(), more.end());
    return inputs;
}

/// Integral of the two-way azimuth pattern, radians.
double two_way_integral_rad(const AntennaParams& antenna) {
    constexpr int steps = 4000;
    const double step = std::min(8 * antenna.beam.rad(), Angle::degrees(180).rad()) / steps;
    double sum = 0.5 * two_way_azimuth_pattern(antenna, 0);
    for (int i = 1; i <= steps; ++i) sum += two_way_azimuth_pattern(antenna, i * step);
    return 2 * step * sum;
}

std::vector<double> rain_volume(const Arguments& a) {
    RadarParams radar;
    radar.pulse_s = a["tau"];
    const double range_m = a["r"], width_rad = two_way_integral_rad(azimuth_antenna(a));
    const RainEcho& echo = rain_echo_of(a, range_m);
    const std::array<double, 2> edges_m{std::max(0.0, range_m - radar.pulse_extent_m()), range_m};
    const auto power_w = static_cast<double>(echo.cells_w(edges_m, width_rad).front());
    return {echo.density_w_m_rad(range_m) * width_rad, power_w, dbm(power_w)};
}

std::vector<Model> air_models() {
    return {
        {"standard-air",
         "temperature, pressure and water vapour of the reference atmosphere at a height; above 51 km' the law of 47 "
         "km' goes on, below -1 km the air is that of -1 km",
         "physics 6.1 [V2: ITU-R P.835-6; above 51 km' and below -1 km P]",
         {number("h", "m", "height above sea level", -1000, 1e6),
          number("rho0", "g/m^3", "water vapour at sea level", 0, most_vapour_g_m3).by_default(normal_vapour_g_m3)},
         {{"T", "K", "temperature"},
          {"p", "hPa", "pressure, taken as that of the dry air"},
          {"rho", "g/m^3", "density of the water vapour"},
          {"e", "hPa", "its pressure"}},
         [](const Arguments& a) -> std::vector<double> {
             const Air air = standard_air(a["h"], a["rho0"]);
             return {air.temperature_k, air.dry_pressure_hpa, air.vapour_g_m3, air.vapour_pressure_hpa};
         },
         "h=4km"},
        {"gases",
         "attenuation by oxygen and water vapour, one way",
         "physics 6.2 [V2: ITU-R P.676-13 Annex 1]",
         {frequency(1000), number("p", "hPa", "pressure of the dry air", 0, 2000).by_default(1013.25),
          number("T", "K", "temperature", 150, 400).by_default(288.15),
          number("rho", "g/m^3", "density of the water vapour", 0, 500).by_default(normal_vapour_g_m3)},
         {{"gamma_o", "dB/km", "by oxygen and the dry continuum"},
          {"gamma_w", "dB/km", "by water vapour"},
          {"gamma", "dB/km", "by both"}},
         [](const Arguments& a) -> std::vector<double> {
             const GasAttenuation gases = gas_attenuation(a["f"], air_of(a["T"], a["p"], a["rho"]));
             return {gases.oxygen_db_km, gases.vapour_db_km, gases.db_km()};
         },
         "f=10GHz"},
        {"cloud",
         "attenuation by cloud or fog, one way, and the permittivity of its water",
         "physics 6.5 [V2: ITU-R P.840-8]",
         {frequency(200),
          number("T", "K", "temperature; below 244 K it falls, which real clouds' does not", 200, 350).by_default(280),
          number("M", "g/m^3", "liquid water (medium fog 0.05, thick fog 0.5)", 0, 10).by_default(medium_fog_g_m3)},
         {{"eps_re", "", "permittivity e'"},
          {"eps_im", "", "loss e''"},
          {"K_l", "(dB/km)/(g/m^3)", "attenuation for each gram"},
          {"gamma_c", "dB/km", "attenuation K_l M"}},
         [](const Arguments& a) -> std::vector<double> {
             const Permittivity eps = cloud_water_permittivity(a["f"], a["T"]);
             const double k = cloud_attenuation_db_km(a["f"], a["T"]);
             return {eps.real(), -eps.imag(), k, k * a["M"]};
         },
         "f=30GHz T=280K"},
    };
}

std::vector<Model> rain_models() {
    return {
        {"rain",
         "attenuation by rain, one way: k R^alpha",
         "physics 6.3 [V2: ITU-R P.838-3]",
         {rate(), frequency(1000), elevation(), tilt()},
         {{"k_R", "", "k, for R in mm/h and dB/km"}, {"alpha", "", "exponent"}, {"gamma_R", "dB/km", "attenuation"}},
         [](const Arguments& a) -> std::vector<double> {
             const RainLaw law = rain_law(a["f"], a.angle("el"), a.angle("t_pol"));
             return {law.k, law.alpha, rain_attenuation_db_km(a["f"], rate_of(a), a.angle("el"), a.angle("t_pol"))};
         },
         "R=heavy f=16GHz t_pol=45deg"},
        {"rain-echo",
         "radar reflectivity of rain by Rayleigh, too strong beyond some 35 GHz, and what circular polarisation "
         "takes of it",
         "physics 6.4 [V2; cancellation U, P]",
         {rate(), frequency(1000)},
         {{"Z", "mm^6/m^3", "reflectivity"},
          {"dBZ", "dB", "the same over 1 mm^6/m^3"},
          {"eta", "1/m", "radar cross-section per volume"},
          {"ICR", "dB", "integrated cancellation ratio"}},
         [](const Arguments& a) -> std::vector<double> {
             const double rate_mm_h = rate_of(a), z = rain_reflectivity_mm6_m3(rate_mm_h);
             return {z, db(z), rain_cross_section_per_m(a["f"], rate_mm_h), rain_cancellation(rate_mm_h).db()};
         },
         "R=2mm/h f=9GHz"},
        {"rain-volume",
         "what rain itself sends back, after beam and pulse, behind what the weather takes; by Rayleigh, too strong "
         "beyond some 35 GHz",
         "physics 6.4 [V2; layer, widening and near rain P; cancellation U, P]",
         rain_volume_inputs(),
         {{"p_r", "W/m", "echo of a metre of range"},
          {"P_r", "W", "power received at the range: of the pulse's length before it"},
          {"P_r_dBm", "dBm", "the same"}},
         rain_volume,
         "r=20km hs=7000ft R=heavy"},
        {"path-loss",
         "two-way loss of a ray through gases, rain and cloud",
         "physics 6.2 to 6.5 along the ray of 1.1 [V2: ITU-R P.676-13, P.838-3, P.840-8; layers P]",
         joined({number("hs", "m", "height of the antenna above sea level", -1000, 1e6),
                 number("delta", "deg", "depression at the antenna, positive down", -90, 90),
                 above("r", "m", "slant range", 0, 1e6), frequency(1000), rate().by_default("clear")},
                weather_inputs(tilt())),
         {{"A_g", "dB", "by gases"},
          {"A_R", "dB", "by rain"},
          {"A_c", "dB", "by cloud"},
          {"L_a", "dB", "all together"},
          {"tau", "Np", "optical depth of all together, one way"}},
         [](const Arguments& a) -> std::vector<double> {
             const PathLoss loss = loss_of(a);
             return {loss.gases_db, loss.rain_db, loss.cloud_db, loss.db(), loss.db() / 2 * (std::numbers::ln10 / 10)};
         },
         "hs=7000ft delta=2deg r=30nmi R=heavy"},
    };
}

}  // namespace

std::vector<Model> atmosphere_models() {
    std::vector<Model> models = air_models();
    for (Model& model : rain_models()) models.push_back(std::move(model));
    return models;
}

}  // namespace wedgescope
