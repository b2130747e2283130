// Models of physics 6: the air, its gases, rain, cloud and fog, and what they take from a ray.
#include <cmath>

#include "lib/atmosphere.hpp"
#include "lib/path_loss.hpp"
#include "lib/rain.hpp"
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

PathLoss loss_of(const Arguments& a) {
    WeatherParams params;
    if (!a.word("rho0")) params.vapour_g_m3 = a["rho0"];
    params.rain_mm_h = rate_of(a);
    params.rain_top_m = a["h_R"];
    params.liquid_water_g_m3 = a["M"];
    params.cloud_base_m = a["h_b"];
    params.cloud_top_m = a["h_c"];
    params.tilt = a.angle("t_pol");
    const Earth earth = a.word("k") ? Earth() : Earth(a["k"] * mean_radius_m);
    return path_loss(Weather(params, a["f"]), earth, a["hs"], a["r"], -std::sin(a["delta"]));
}

std::vector<Model> air_models() {
    return {
        {"standard-air",
         "temperature, pressure and water vapour of the reference atmosphere at a height",
         "physics 6.1 [V2: ITU-R P.835-6]",
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
         {frequency(200), number("T", "K", "temperature", 200, 350).by_default(280),
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
         "radar reflectivity of rain, and what circular polarisation takes of it",
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
        {"path-loss",
         "two-way loss of a ray through gases, rain and cloud",
         "physics 6.2 to 6.5 along the ray of 1.1 [V2: ITU-R P.676-13, P.838-3, P.840-8; layers P]",
         {number("hs", "m", "height of the antenna above sea level", -1000, 1e6),
          number("delta", "deg", "depression at the antenna, positive down", -90, 90),
          above("r", "m", "slant range", 0, 1e6), frequency(200),
          number("rho0", "g/m^3", "water vapour at sea level; none: no gases at all", 0, most_vapour_g_m3)
              .or_word("none")
              .by_default(normal_vapour_g_m3),
          rate().by_default("clear"), number("h_R", "m", "top of the rain", -1000, 20e3).by_default(3000),
          number("M", "g/m^3", "liquid water of cloud or fog", 0, 10).by_default("0"),
          number("h_b", "m", "base of the cloud", -1000, 19e3).by_default("0m"),
          number("h_c", "m", "top of the cloud", -1000, 20e3).by_default("1000m"), tilt(),
          number("k", "", "factor of the earth's mean radius", 0.1, 1e6).or_word("flat").by_default("4/3")},
         {{"A_g", "dB", "by gases"},
          {"A_R", "dB", "by rain"},
          {"A_c", "dB", "by cloud"},
          {"L_a", "dB", "all together"}},
         [](const Arguments& a) -> std::vector<double> {
             const PathLoss loss = loss_of(a);
             return {loss.gases_db, loss.rain_db, loss.cloud_db, loss.db()};
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
