// Models of physics 10: fluctuation.
#include <cmath>

#include "lib/intensity_statistics.hpp"
#include "tools/models.hpp"

namespace wedgescope {

std::vector<Model> statistics_models() {
    return {
        {"speckle",
         "spread of the intensity of N independent looks, and bias and spread of its logarithm",
         "physics 10 [V2]",
         {above("N", "", "looks", 0, 1e6)},
         {{"std", "", "standard deviation over mean of the intensity"},
          {"mean_dB", "dB", "mean of the intensity in decibels, over the mean intensity"},
          {"std_dB", "dB", "standard deviation of the intensity in decibels"}},
         [](const Arguments& a) -> std::vector<double> {
             const SpeckleMoments moments = speckle_moments(a["N"]);
             return {1 / std::sqrt(a["N"]), moments.mean.db(), moments.deviation_db};
         },
         "N=1"},
        {"k-shape",
         "shape of the K distribution of sea clutter, X band",
         "physics 10 [V1: Ward, Tough & Watts]",
         {number("psi", "deg", "grazing angle", 0.1, 10), above("A_c", "m^2", "area of the resolution cell", 0, 1e6),
          one_of("pol", "polarisation", {"hh", "vv"}).by_default("hh"),
          number("th_sw", "deg", "look direction minus the swell's", -360, 360).or_word("none").by_default("none")},
         {{"nu", "", "shape"}},
         [](const Arguments& a) -> std::vector<double> {
             SeaClutterCell cell;
             cell.vertical = *a.word("pol") == 1;
             cell.area_m2 = a["A_c"];
             cell.grazing = a.angle("psi");
             cell.swell = !a.word("th_sw");
             if (cell.swell) cell.from_swell = a.angle("th_sw");
             return {sea_clutter_shape(cell)};
         },
         "psi=2deg A_c=1000m^2 pol=vv"},
        {"k-distribution",
         "how often sea clutter exceeds a multiple of its mean, and its second moment",
         "physics 10 [V2: K distribution]",
         {number("nu", "", "shape", 0.01, 1e4), number("x", "", "intensity over its mean", 0, 1000)},
         {{"P", "", "probability of more"}, {"M2", "", "mean square over squared mean"}},
         [](const Arguments& a) -> std::vector<double> {
             return {k_distribution_exceedance(a["nu"], a["x"]), k_distribution_second_moment(a["nu"])};
         },
         "nu=1.5 x=2"},
    };
}

}  // namespace wedgescope
