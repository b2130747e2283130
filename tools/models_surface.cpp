// Models of physics 4, 5 and 8: what land and water return, and how they reflect.
#include <fmt/format.h>

#include <cmath>

#include "lib/backscatter.hpp"
#include "lib/class_laws.hpp"
#include "lib/dielectric.hpp"
#include "lib/directivity.hpp"
#include "lib/material.hpp"
#include "lib/sea.hpp"
#include "lib/sensor.hpp"
#include "tools/models.hpp"

namespace wedgescope {
namespace {

ModelInput frequency(double low_ghz, double high_ghz) { return number("f", "GHz", "frequency", low_ghz, high_ghz); }
ModelInput grazing(double high_deg = 90) { return above("psi", "deg", "local grazing angle", 0, high_deg); }
/// Of the laws that end before the surface is edge-on.
ModelInput held_grazing(double high_deg = 90) {
    return above("psi", "deg", fmt::format("local grazing angle; below {0:.2g} deg as at {0:.2g}", least_grazing.deg()),
                 0, high_deg);
}
ModelInput polarisation() { return one_of("pol", "polarisation", {"hh", "vv", "circular"}).by_default("hh"); }
Polarisation polarisation_of(const Arguments& a) {
    constexpr Polarisation all[] = {Polarisation::hh, Polarisation::vv, Polarisation::circular};
    return all[*a.word("pol")];
}
ModelInput sea_state() { return number("SS", "", "sea state (Douglas)", 0, 6); }
ModelInput temperature() { return number("t", "degC", "temperature of the water", 0, 35); }
ModelInput salinity() { return number("S", "ppt", "salinity of the water", 0, 40); }
Water water_of(const Arguments& a) { return {a["t"], a["S"]}; }

std::vector<ModelOutput> sigma0_outputs() {
    return {{"sigma0", "", "radar cross-section per unit area"}, {"sigma0_dB", "dB", "the same"}};
}
std::vector<double> both(Decibel sigma0) { return {sigma0.ratio(), sigma0.db()}; }

template <class Enum>
Enum chosen(const Arguments& a, std::string_view name) {
    return static_cast<Enum>(*a.word(name));
}

ModelInput gamma_input() {
    ModelInput gamma = number("gamma10_dB", "dB", "gamma at 10 GHz, or the material whose gamma is taken", -200, 100);
    for (const Material& material : material_table()) gamma = std::move(gamma).or_word(material.name);
    return gamma;
}

ModelInput material_input() {
    std::vector<std::string> names;
    for (const Material& material : material_table()) names.emplace_back(material.name);
    return one_of("material", "class of the ground", std::move(names));
}

double gamma10_of(const Arguments& a) {
    const auto material = a.word("gamma10_dB");
    if (!material) return a["gamma10_dB"];
    if (const auto gamma = material_table()[static_cast<std::size_t>(*material)].gamma10_db) return *gamma;
    throw NoSolution("calm water returns nothing; the sea models give what waves do");
}

std::vector<Model> land_models() {
    return {
        {"constant-gamma",
         "sigma0 of ground with constant gamma",
         "physics 4.1 [form V2: Barton 1985, Long, Nathanson; frequency law U]",
         {gamma_input(), number("f", "Hz", "frequency", 1e6, 1e12).by_default(RadarParams{}.frequency_hz), grazing()},
         {{"gamma_dB", "dB", "gamma at the frequency"},
          {"sigma0", "", "radar cross-section per unit area"},
          {"sigma0_dB", "dB", "the same"}},
         [](const Arguments& a) -> std::vector<double> {
             const Decibel gamma10(gamma10_of(a)), sigma0 = constant_gamma_sigma0(gamma10, a["f"], a.angle("psi"));
             return {gamma_at(gamma10, a["f"]).db(), sigma0.ratio(), sigma0.db()};
         },
         "gamma10_dB=trees psi=5deg f=16.5GHz"},
        {"class",
         "gamma of a class' ground and of its walls, as scenes take them",
         "physics 4.1, 7.4 [anchors V2, the rest U/P; frequency law U]",
         {material_input(), number("f", "Hz", "frequency", 1e6, 1e12).by_default(RadarParams{}.frequency_hz),
          polarisation()},
         {{"gamma_dB", "dB", "gamma of the ground; calm water has none"},
          {"gamma_w_dB", "dB", "gamma of walls: as of the ground where the class has no own"}},
         [](const Arguments& a) -> std::vector<double> {
             const ClassGamma gamma = gamma_table(a["f"], std::nullopt)[static_cast<std::size_t>(*a.word("material"))];
             const bool circular = polarisation_of(a) == Polarisation::circular;
             return {db(circular ? gamma.ground / circular_loss.ratio() : gamma.ground),
                     db(circular ? gamma.wall / circular_wall_loss.ratio() : gamma.wall)};
         },
         "material=suburban f=16.5GHz"},
        {"directivity",
         "what a feature with reflecting sides returns of its most",
         "physics 7.2 [meaning V1; law P]",
         {one_of("side", "which of its sides reflect", {"omni", "uni", "bi"}),
          number("A", "deg", "azimuth from the feature to the radar", -360, 360),
          number("A_n", "deg", "azimuth of the reflecting side's outward normal", -360, 360).by_default("0deg")},
         {{"D", "", "factor on the radar cross-section"}, {"D_dB", "dB", "the same"}},
         [](const Arguments& a) -> std::vector<double> {
             const double factor = directivity_gain(chosen<Directivity>(a, "side"), a.angle("A"), a.angle("A_n"));
             return {factor, db(factor)};
         },
         "side=uni A=30deg"},
        {"structures",
         "what houses or crowns finer than a post add to their ground: walls statistical",
         "physics 7.3 [P]",
         {material_input(),
          number("n_km2", "", "structures on a square kilometre (default: of the class)", 0, 1e6)
              .or_word("auto")
              .by_default("auto"),
          number("w", "m", "how wide and deep one is (default: of the class)", 0, 1000)
              .or_word("auto")
              .by_default("auto"),
          number("H", "m", "how high one is (default: of the class)", 0, 1000).or_word("auto").by_default("auto"),
          number("f", "Hz", "frequency", 1e6, 1e12).by_default(RadarParams{}.frequency_hz), held_grazing(),
          polarisation()},
         {{"nHw", "", "area of the faces that one side shows, on a unit of ground"},
          {"share", "", "of the ground that they cover"},
          {"raised", "m", "how much higher the surface stands"},
          {"sigma0_w", "", "what they add to the radar cross-section per unit area"},
          {"sigma0_w_dB", "dB", "the same"},
          {"sigma0", "", "of the ground without them, by constant gamma"},
          {"ratio_dB", "dB", "what they add over what the ground returns"}},
         [](const Arguments& a) -> std::vector<double> {
             Material material = material_table()[static_cast<std::size_t>(*a.word("material"))];
             Structures structures = material.structures.value_or(Structures{});
             if (!a.word("n_km2")) structures.number_km2 = a["n_km2"];
             if (!a.word("w")) structures.width_m = a["w"];
             if (!a.word("H")) structures.height_m = a["H"];
             if (!(structures.walls() > 0))
                 throw NoSolution(material.name + " has no structures of its own: it needs n_km2, w and H above 0");
             if (!material.gamma10_db) throw NoSolution("water has no structures");
             ClassLawParams params;
             params.frequency_hz = a["f"];
             params.polarisation = polarisation_of(a);
             const Angle psi = std::max(a.angle("psi"), least_grazing);
             const double ground = class_law(material, params).factor(psi) * std::sin(psi.rad());
             material.structures = structures;
             params.walls = Walls::statistical;
             const double added = class_law(material, params).factor(psi) * std::sin(psi.rad()) - ground;
             return {structures.walls(), structures.share(), structures.raise_m(), added, db(added), ground,
                     db(added / ground)};
         },
         "material=urban f=10GHz psi=5deg"},
        {"ulaby-dobson",
         "sigma0 of land by the mean fits of Ulaby and Dobson; below 8 GHz by those for C band",
         "physics 4.2 [C rows V1, X and Ku rows U: Ulaby & Dobson 1989; below 10 degrees P]",
         {one_of("class", "class of the ground", {"soil", "grass", "shrubs", "short-vegetation"}), frequency(1, 18),
          held_grazing(), polarisation()},
         sigma0_outputs(),
         [](const Arguments& a) -> std::vector<double> {
             return both(
                 ulaby_dobson_sigma0(chosen<UlabyDobsonClass>(a, "class"), a["f"], polarisation_of(a), a.angle("psi")));
         },
         "class=soil f=10GHz pol=hh psi=55deg"},
        {"oh",
         "sigma0 of bare soil by Oh, Sarabandi and Ulaby; k s from 0.1 to 6",
         "physics 4.3 [V2: Oh, Sarabandi & Ulaby 1992; below 20 degrees P]",
         {number("eps_re", "", "permittivity e' of the soil", 1, 100),
          number("eps_im", "", "its loss e''", 0, 100).by_default("0"),
          above("s_rms", "m", "rms height of the surface", 0, 0.05), frequency(1, 18), held_grazing()},
         {{"vv_dB", "dB", "sigma0, VV"}, {"hh_dB", "dB", "sigma0, HH"}, {"hv_dB", "dB", "sigma0, HV"}},
         [](const Arguments& a) -> std::vector<double> {
             const BareSoil soil{{a["eps_re"], -a["eps_im"]}, a["s_rms"]};
             const OhSigma0 sigma0 = oh_sigma0(soil, a["f"], a.angle("psi"));
             return {sigma0.vv.db(), sigma0.hh.db(), sigma0.hv.db()};
         },
         "eps_re=10 eps_im=2 s_rms=0.004m f=9.54GHz psi=55deg"},
        {"git-land",
         "sigma0 of land by the Georgia Tech model, X band; made for 20 to 65 degrees of grazing",
         "physics 4.4 [form V1, coefficients U: Currie, Zehner]",
         {one_of("class", "class of the ground", {"soil", "grass", "crops", "trees", "urban", "wet-snow", "dry-snow"}),
          frequency(8, 12), number("sigma_h", "m", "rms height (of soil)", 0, 10).by_default("0m"), held_grazing()},
         sigma0_outputs(),
         [](const Arguments& a) -> std::vector<double> {
             return both(git_land_sigma0(chosen<GitLandClass>(a, "class"), a["f"], a["sigma_h"], a.angle("psi")));
         },
         "class=grass f=10GHz psi=10deg"},
        {"morchin",
         "sigma0 of land by Morchin's model; made for 70 degrees of grazing and more",
         "physics 4.5 [form and wooded hills V1, other rows U]",
         {one_of("class", "class of the ground", {"desert", "farmland", "wooded-hills", "mountains"}),
          frequency(0.3, 8), held_grazing()},
         sigma0_outputs(),
         [](const Arguments& a) -> std::vector<double> {
             return both(morchin_sigma0(chosen<MorchinClass>(a, "class"), a["f"], a.angle("psi")));
         },
         "class=wooded-hills f=3GHz psi=80deg"},
        {"billingsley",
         "mean strength and spread of clutter from rural low relief, by depression",
         "physics 4.6 [V1: Billingsley 2002]",
         {number("delta", "deg", "depression at the antenna", 0, 90)},
         {{"sigma0_dB", "dB", "mean strength"}, {"a_w", "", "Weibull spread"}},
         [](const Arguments& a) -> std::vector<double> {
             const Billingsley clutter = billingsley_low_relief(a.angle("delta"));
             return {clutter.mean_strength.db(), clutter.weibull_spread};
         },
         "delta=1deg"},
    };
}

std::vector<Model> sea_models() {
    return {
        {"nrl-sea",
         "sigma0 of the sea, mean over wind directions; grazing angles held within 0.1 to 60 degrees",
         "physics 5.1 [V2: Gregers-Hansen & Mital 2012]",
         {frequency(0.5, 35), polarisation(), sea_state(), grazing()},
         sigma0_outputs(),
         [](const Arguments& a) -> std::vector<double> {
             return both(nrl_sea_sigma0(a["f"], polarisation_of(a), a["SS"], a.angle("psi")));
         },
         "f=3.2GHz pol=hh SS=4 psi=2deg"},
        {"git-sea",
         "sigma0 of the sea by wind direction; made for 0.1 to 10 degrees of grazing; sea state 0 returns nothing",
         "physics 5.2 [V2: Horst, Dyer & Tuley 1978]",
         {frequency(1, 100), polarisation(), sea_state(), held_grazing(15),
          number("phi", "deg", "look direction minus upwind", -360, 360).by_default("90deg"),
          number("V", "m/s", "wind (default: of the sea state)", 0, 50).or_word("auto").by_default("auto"),
          number("h_av", "m", "mean wave height (default: of the sea state)", 0, 20).or_word("auto").by_default("auto"),
          number("f_b", "GHz", "where the upper band begins", 10, 12).by_default(10e9)},
         sigma0_outputs(),
         [](const Arguments& a) -> std::vector<double> {
             GitSea sea = GitSea::risen(a["SS"]);
             if (!a.word("V")) sea.wind_m_s = a["V"];
             if (!a.word("h_av")) sea.wave_height_m = a["h_av"];
             return both(git_sea_sigma0(a["f"], polarisation_of(a), sea, a.angle("psi"), a.angle("phi"), a["f_b"]));
         },
         "f=9GHz pol=vv SS=4 psi=2deg phi=90deg"},
        {"sea-wind",
         "how many times its mean over wind directions a sea returns, as wind-direction has it in scenes",
         "physics 5.2 [contrast V2: Horst, Dyer & Tuley 1978; normalised, and beyond 15 degrees P]",
         {frequency(0.5, 100), grazing(),
          number("phi", "deg", "look direction minus upwind", -360, 360).by_default("0deg")},
         {{"D", "", "factor"}, {"D_dB", "dB", "the same"}},
         [](const Arguments& a) -> std::vector<double> {
             const double factor = wind_factor(a["f"], a.angle("psi"), a.angle("phi"));
             return {factor, Decibel::from_ratio(factor).db()};
         },
         "f=16.5GHz psi=5deg phi=0deg"},
        {"quasi-specular",
         "sigma0 of a mirror with slopes, near the vertical",
         "physics 5.4 [V2: geometric optics; mss U]",
         {number("Gamma_0", "", "reflectivity at normal incidence, of power", 0, 1),
          above("mss", "", "mean square slope", 0, 1), held_grazing()},
         sigma0_outputs(),
         [](const Arguments& a) -> std::vector<double> {
             return both(quasi_specular_sigma0(a["Gamma_0"], a["mss"], a.angle("psi")));
         },
         "Gamma_0=0.6 mss=0.03 psi=80deg"},
        {"sea",
         "sigma0 of the sea as scenes take it: NRL from 0.1 to 60 degrees of grazing (below in proportion to the "
         "sine), quasi-specular above; sea state 0 returns nothing",
         "physics 5.1, 5.4 [V2; joint P]",
         {frequency(0.5, 35), polarisation(), sea_state(), grazing(), temperature().by_default(Water{}.temperature_c),
          salinity().by_default(Water{}.salinity_ppt)},
         sigma0_outputs(),
         [](const Arguments& a) -> std::vector<double> {
             const Angle psi = a.angle("psi");
             const double factor = sea_nrl_law(a["f"], polarisation_of(a), a["SS"], water_of(a)).factor(psi);
             return both(Decibel::from_ratio(factor * std::sin(psi.rad())));
         },
         "f=16.5GHz SS=3 psi=5deg"},
        {"sea-state",
         "wind, waves and slopes of a fully risen sea",
         "physics 5.2, 5.4 [V2; significant height V1; slopes U: Cox & Munk]",
         {sea_state()},
         {{"V", "m/s", "wind"},
          {"h_av", "m", "mean wave height"},
          {"h_13", "m", "significant wave height"},
          {"sigma_h", "m", "rms height of the surface"},
          {"mss", "", "mean square slope"}},
         [](const Arguments& a) -> std::vector<double> {
             const double state = a["SS"], wind = wind_speed_m_s(state);
             return {wind, mean_wave_height_m(wind), significant_wave_height_m(state), rms_wave_height_m(state),
                     mean_square_slope(wind)};
         },
         "SS=3"},
        {"far-shore",
         "how water in front of a bank brightens it, and how much water that takes",
         "physics 5.3 [derived there]",
         {frequency(0.5, 40), polarisation(), grazing(),
          number("sigma_h", "m", "rms height of the water's surface", 0, 10).by_default("0m"),
          number("h_b", "m", "height of the bank", 0, 1000).by_default("5m"),
          temperature().by_default(fresh_water.temperature_c), salinity().by_default(fresh_water.salinity_ppt)},
         {{"F4", "", "gain"}, {"F4_dB", "dB", "the same"}, {"d_w", "m", "ground distance of water that it needs"}},
         [](const Arguments& a) -> std::vector<double> {
             const double gain = far_shore_gain(water_permittivity(a["f"], water_of(a)), a["f"], polarisation_of(a),
                                                a["sigma_h"], a.angle("psi"));
             return {gain, Decibel::from_ratio(gain).db(), far_shore_reach_m(a["h_b"], a.angle("psi"))};
         },
         "f=16.5GHz psi=5deg"},
        {"water",
         "permittivity of water",
         "physics 8.3 [V2: Klein & Swift 1977]",
         {frequency(0.1, 40), temperature(), salinity()},
         {{"eps_re", "", "e'"}, {"eps_im", "", "loss e''"}},
         [](const Arguments& a) -> std::vector<double> {
             const Permittivity eps = water_permittivity(a["f"], water_of(a));
             return {eps.real(), -eps.imag()};
         },
         "f=10.7GHz t=15degC S=32ppt"},
        {"fresnel",
         "reflection and emission of a smooth half space",
         "physics 8.2 [V2]",
         {number("eps_re", "", "permittivity e'", 1, 1000), number("eps_im", "", "loss e''", 0, 1000).by_default("0"),
          number("inc", "deg", "incidence angle, from the normal", 0, 90)},
         {{"Gamma_H", "", "power reflectivity, H"},
          {"Gamma_V", "", "power reflectivity, V"},
          {"e_H", "", "emissivity, H"},
          {"e_V", "", "emissivity, V"}},
         [](const Arguments& a) -> std::vector<double> {
             const FresnelPowers power = fresnel_powers({a["eps_re"], -a["eps_im"]}, a.angle("inc"));
             return {power.h, power.v, 1 - power.h, 1 - power.v};
         },
         "eps_re=51.4263 eps_im=39.6006 inc=50deg"},
    };
}

}  // namespace

std::vector<Model> surface_models() {
    std::vector<Model> models = land_models();
    for (Model& model : sea_models()) models.push_back(std::move(model));
    return models;
}

}  // namespace wedgescope
