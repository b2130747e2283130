// Models of physics 3: the antenna's patterns.
#include "lib/beam.hpp"
#include "lib/shade.hpp"
#include "tools/models.hpp"

namespace wedgescope {
std::vector<Model> antenna_models() {
    const AntennaParams set;
    return {
        {"antenna-elevation",
         "one-way elevation pattern",
         "physics 3 [shape derived there; knee and floor P]",
         {number("delta", "deg", "depression of the ray, positive down", -90, 90),
          one_of("antenna", "law, or antenna=FILE of lines depression_deg,gain_db", {"gaussian", "csc2", "cos-csc2"})
              .or_antenna_file()
              .by_default("csc2"),
          above("beta_0", "deg", "knee: depression of the nose in the antenna's frame", 0, 89.999).by_default(set.knee),
          above("theta_el", "deg", "half-power beamwidth, of the shaped laws above the knee", 0, 180)
              .by_default(set.width),
          number("p", "", "exponent of cos-csc2 (1/2: constant return; 1: COS-CSC^2)", 0, 10).by_default(set.exponent),
          number("tilt", "deg", "tilt, positive down", -90, 90).by_default(set.tilt),
          number("g_floor", "dB", "least pattern", -200, 0).by_default(set.floor)},
         {{"beta", "deg", "depression in the antenna's frame"},
          {"g_el", "", "power pattern relative to the peak, one-way"},
          {"g_el_dB", "dB", "the same"}},
         [](const Arguments& a) -> std::vector<double> {
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
             const double g = elevation_pattern(antenna, a["delta"]);
             return {a["delta"] - a["tilt"], g, db(g)};
         },
         "delta=30deg antenna=cos-csc2 p=1/2"},
        {"antenna-azimuth",
         "one-way azimuth pattern; 0 beyond 2.24 beamwidths (gaussian) or the fifth null (uniform)",
         "physics 3 [V2]",
         {number("phi", "deg", "azimuth offset from the beam's middle", -180, 180),
          one_of("pattern", "law", {"gaussian", "uniform"}).by_default("gaussian"),
          number("theta_3", "deg", "half-power beamwidth, one-way", 0.002, 90).by_default(set.beam)},
         {{"g_az", "", "power pattern relative to the peak, one-way"}, {"g_az_dB", "dB", "the same"}},
         [](const Arguments& a) -> std::vector<double> {
             AntennaParams antenna;
             antenna.azimuth = *a.word("pattern") == 0 ? AzimuthPattern::gaussian : AzimuthPattern::uniform;
             antenna.beam = a.angle("theta_3");
             const double g = one_way_azimuth_pattern(antenna, a["phi"]);
             return {g, db(g)};
         },
         "phi=1deg theta_3=1.5deg pattern=uniform"},
    };
}

}  // namespace wedgescope
