// Models of physics 2.6 and 3: the antenna's patterns, and the weights that beam and pulse give to bins.
#include <fmt/format.h>

#include <cmath>

#include "lib/beam.hpp"
#include "lib/shade.hpp"
#include "tools/model_inputs.hpp"
#include "tools/models.hpp"

namespace wedgescope {

std::vector<ModelInput> elevation_pattern_inputs() {
    const AntennaParams set;
    return {
        one_of("antenna", "law of elevation, or antenna=FILE of lines depression_deg,gain_db",
               {"gaussian", "csc2", "cos-csc2"})
            .or_antenna_file()
            .by_default("csc2"),
        number("beta_0", "deg", "knee: depression of the nose in the antenna's frame; above 0 but for gaussian", -90,
               90)
            .by_default(set.knee),
        above("theta_el", "deg", "half-power beamwidth, of the shaped laws above the knee", 0, 180)
            .by_default(set.width),
        number("p", "", "exponent of cos-csc2 (1/2: constant return; 1: COS-CSC^2)", 0, 10).by_default(set.exponent),
        number("tilt", "deg", "tilt, positive down", -90, 90).by_default(set.tilt),
        number("g_floor", "dB", "least pattern", -200, 0).by_default(set.floor)};
}

AntennaParams elevation_antenna(const Arguments& a) {
    constexpr ElevationPattern laws[] = {ElevationPattern::gaussian, ElevationPattern::csc2,
                                         ElevationPattern::cos_csc2};
    AntennaParams antenna;
    if (const PatternFile* file = a.file("antenna")) {
        antenna.elevation = ElevationPattern::points;
        antenna.points = file->points;
    } else {
        antenna.elevation = laws[*a.word("antenna")];
    }
    antenna.knee = a.angle("beta_0");
    antenna.width = a.angle("theta_el");
    antenna.exponent = a["p"];
    antenna.tilt = a.angle("tilt");
    antenna.floor = a.decibel("g_floor");
    if (antenna.elevation != ElevationPattern::gaussian && antenna.elevation != ElevationPattern::points &&
        !(antenna.knee.rad() > 0))
        throw NoSolution(fmt::format("beta_0 is {:.6g} deg; csc2 and cos-csc2 need it above 0", antenna.knee.deg()));
    return antenna;
}

std::vector<ModelInput> azimuth_pattern_inputs() {
    return {one_of("pattern", "law of azimuth", {"gaussian", "uniform"}).by_default("gaussian"),
            number("theta_3", "deg", "half-power beamwidth, one-way", 0.002, 90).by_default(AntennaParams().beam)};
}

AntennaParams azimuth_antenna(const Arguments& a) {
    AntennaParams antenna;
    antenna.azimuth = *a.word("pattern") == 0 ? AzimuthPattern::gaussian : AzimuthPattern::uniform;
    antenna.beam = a.angle("theta_3");
    return antenna;
}

namespace {

double beam_cosine(const Arguments& a) {
    BeamSetting setting;
    setting.sensor_m = a["hs"];
    setting.reference_m = a["h_0"];
    setting.earth = earth_of(a);
    return level_cosine(setting, a["r"]);
}

}  // namespace

std::vector<Model> antenna_models() {
    return {
        {"antenna-elevation",
         "one-way elevation pattern",
         "physics 3 [shape derived there; knee and floor P]",
         joined({number("delta", "deg", "depression of the ray, positive down", -90, 90)}, elevation_pattern_inputs()),
         {{"beta", "deg", "depression in the antenna's frame"},
          {"g_el", "", "power pattern relative to the peak, one-way"},
          {"g_el_dB", "dB", "the same"}},
         [](const Arguments& a) -> std::vector<double> {
             const double g = elevation_pattern(elevation_antenna(a), a["delta"]);
             return {a["delta"] - a["tilt"], g, db(g)};
         },
         "delta=30deg antenna=cos-csc2 p=1/2"},
        {"antenna-azimuth",
         "one-way azimuth pattern; 0 beyond 2.24 beamwidths (gaussian) or the fifth null (uniform)",
         "physics 3 [V2]",
         joined({number("phi", "deg", "azimuth offset from the beam's middle", -180, 180)}, azimuth_pattern_inputs()),
         {{"g_az", "", "power pattern relative to the peak, one-way"}, {"g_az_dB", "dB", "the same"}},
         [](const Arguments& a) -> std::vector<double> {
             const double g = one_way_azimuth_pattern(azimuth_antenna(a), a["phi"]);
             return {g, db(g)};
         },
         "phi=1deg theta_3=1.5deg pattern=uniform"},
        {"beam-weight",
         "what an echo counts in an azimuth beside its own, two-way, as the fan beam widens towards the nadir",
         "physics 2.6 [P], 3 [V2]",
         joined({number("phi", "deg", "azimuth of the bin minus that of the echo", -180, 180),
                 number("s", "",
                        "bwe-scale; all weights of an exaggerated beam are divided by how much more they add up to",
                        0.1, 20)
                     .by_default("1"),
                 above("r", "m", "slant range", 0, 1e7), height_input("hs", "height of the antenna above sea level"),
                 height_input("h_0", "reference height").by_default("0m"), earth_factor_input(), earth_radius_input()},
                azimuth_pattern_inputs()),
         {{"cos_d", "", "cosine of the depression of a level surface at the reference height, at least 1/2"},
          {"w", "", "weight, 1 in the echo's own azimuth"},
          {"w_dB", "dB", "the same"}},
         [](const Arguments& a) -> std::vector<double> {
             const double cosine = beam_cosine(a),
                          w = two_way_azimuth_pattern(azimuth_antenna(a), a["phi"] * cosine / a["s"]);
             return {cosine, w, db(w)};
         },
         "phi=1deg r=5km hs=7000ft"},
        {"pulse-weight",
         "what an echo counts in the range bins behind it: H(m) - H(m - w)",
         "physics 2.6 [P]",
         {above("w", "", "range bins that the pulse is long, c tau / (2 dr)", 0, 1000),
          number("m", "", "range bins from the echo's own outwards, a whole number", 0, 1000),
          number("s", "", "ple-scale: the pulse is s w long, and its weights 1/s of that pulse's", 0.1, 20)
              .by_default("1")},
         {{"w_m", "", "weight; all together are w"}},
         [](const Arguments& a) -> std::vector<double> {
             const double m = a["m"];
             if (m != std::floor(m)) throw NoSolution(text("m is ", m, "; bins are counted in whole numbers"));
             const std::vector<double> weights = pulse_weights(a["w"] * a["s"]);
             const auto bin = static_cast<std::size_t>(m);
             return {bin < weights.size() ? weights[bin] / a["s"] : 0};
         },
         "w=4 m=1"},
    };
}

}  // namespace wedgescope
