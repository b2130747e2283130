// Models of physics 1.4 and 2: radar equation, noise, receiver, display.
#include <algorithm>
#include <cmath>

#include "lib/display.hpp"
#include "lib/radar_equation.hpp"
#include "lib/receiver.hpp"
#include "tools/model_inputs.hpp"
#include "tools/models.hpp"

namespace wedgescope {
namespace {

const RadarParams set{};  // of defaults

ModelInput frequency() { return number("f", "Hz", "frequency", 1e6, 1e12).by_default(set.frequency_hz); }
ModelInput slant_range() { return above("r", "m", "slant range", 0, 1e7); }
ModelInput pulse() {
    return number("tau", "s", "(compressed) length of the pulse", 1e-10, 1e-3).by_default(set.pulse_s);
}
ModelInput azimuth_beam() {
    return number("theta_3", "deg", "half-power beamwidth in azimuth, one-way", 0.002, 90).by_default(set.antenna.beam);
}
ModelInput elevation_beam() {
    return above("theta_el", "deg", "half-power beamwidth in elevation, one-way", 0, 180).by_default(set.antenna.width);
}
ModelInput ground_grazing() { return above("psi", "deg", "grazing angle of the ground", 0, 90); }

/// P_t G_0 f L_s and what the ray makes of them.
std::vector<ModelInput> with_set(std::vector<ModelInput> own) {
    own.push_back(slant_range());
    own.push_back(frequency());
    own.push_back(number("P_t", "W", "transmitter's peak power", 1e-3, 1e9).by_default(set.transmit_power_w));
    own.push_back(number("G_0", "dB", "peak gain, one-way", -100, 100).by_default(set.gain));
    own.push_back(number("L_s", "dB", "system losses", 0, 100).by_default(set.losses));
    own.push_back(number("g_el_dB", "dB", "elevation pattern, one-way", -200, 0).by_default("0dB"));
    own.push_back(number("g_az_dB", "dB", "azimuth pattern, one-way", -200, 0).by_default("0dB"));
    own.push_back(number("L_a", "dB", "atmospheric loss, two-way", 0, 1000).by_default("0dB"));
    return own;
}

double received_w(const Arguments& a, double cross_section_m2) {
    RadarParams radar;
    radar.frequency_hz = a["f"];
    radar.transmit_power_w = a["P_t"];
    radar.gain = a.decibel("G_0");
    radar.losses = a.decibel("L_s");
    const double pattern = Decibel(a["g_el_dB"] + a["g_az_dB"]).ratio();
    return received_power_w(radar, pattern, cross_section_m2, a["r"], a.decibel("L_a"));
}

CellArea area(const Arguments& a) {
    RadarParams radar;
    radar.pulse_s = a["tau"];
    return cell_area(a.angle("theta_3"), a.angle("theta_el"), radar.pulse_extent_m(), a["r"], a.angle("psi"));
}

std::vector<Model> equation_models() {
    return {
        {"echo-point",
         "power received from a reflector of known radar cross-section",
         "physics 2.1 [V2: any text]",
         with_set({number("sigma", "m^2", "radar cross-section", 0, 1e12)}),
         {{"P_r", "W", "power received"}, {"P_r_dBm", "dBm", "the same"}},
         [](const Arguments& a) -> std::vector<double> {
             const double power_w = received_w(a, a["sigma"]);
             return {power_w, dbm(power_w)};
         },
         "sigma=10m^2 r=20nmi"},
        {"echo-area",
         "power received from the ground in a resolution cell",
         "physics 2.1 [V2: any text]",
         with_set({number("sigma0_dB", "dB", "radar cross-section per unit area", -300, 100), ground_grazing(), pulse(),
                   azimuth_beam(), elevation_beam()}),
         {{"A", "m^2", "area of the cell"},
          {"sigma", "m^2", "its radar cross-section"},
          {"P_r", "W", "power received"},
          {"P_r_dBm", "dBm", "the same"}},
         [](const Arguments& a) -> std::vector<double> {
             const double area_m2 = area(a).least_m2(), sigma = a.decibel("sigma0_dB").ratio() * area_m2,
                          power_w = received_w(a, sigma);
             return {area_m2, sigma, power_w, dbm(power_w)};
         },
         "sigma0_dB=-20dB r=20nmi psi=5deg"},
        {"cell-area",
         "ground in one resolution cell, bounded by the pulse or by the beam",
         "physics 2.1 [V2: any text; theta_2 the integral of the two-way Gaussian]",
         {slant_range(), ground_grazing(), pulse(), azimuth_beam(), elevation_beam()},
         {{"theta_2", "deg", "two-way beamwidth in azimuth"},
          {"A_pulse", "m^2", "bounded by the pulse"},
          {"A_beam", "m^2", "bounded by the beam"},
          {"A", "m^2", "the smaller one"}},
         [](const Arguments& a) -> std::vector<double> {
             const CellArea cell = area(a);
             return {two_way_width(a.angle("theta_3")).rad(), cell.pulse_m2, cell.beam_m2, cell.least_m2()};
         },
         "r=20nmi psi=5deg"},
        {"bins",
         "azimuth and range bins that a scene takes by default",
         "physics 2.6 [P]",
         {azimuth_beam(), pulse()},
         {{"N_az", "", "azimuth bins in the circle"},
          {"da", "deg", "size of one"},
          {"dr", "m", "size of a range bin"},
          {"w", "", "range bins that an echo is spread over, c tau / (2 dr)"}},
         [](const Arguments& a) -> std::vector<double> {
             RadarParams radar;
             radar.antenna.beam = a.angle("theta_3");
             radar.pulse_s = a["tau"];
             const auto count = static_cast<double>(default_azimuth_bins(radar));
             const double bin_m = default_range_bin_m(radar);
             return {count, Angle::degrees(360 / count).rad(), bin_m, radar.pulse_extent_m() / bin_m};
         },
         "theta_3=1.5deg tau=0.5us"},
    };
}

std::vector<Model> receiver_models() {
    const ReceiverParams receiver;
    return {
        {"noise",
         "thermal noise and minimum discernible signal",
         "physics 2.2 [V2; (S/N)_min P]",
         {number("F", "dB", "noise figure", 0, 100).by_default(set.noise_figure),
          above("B", "Hz", "bandwidth (default 1.2/tau)", 0, 1e12).or_word("auto").by_default("auto"), pulse(),
          number("SN_min", "dB", "least signal over noise that shows", -100, 100).by_default("0dB")},
         {{"B_n", "Hz", "bandwidth taken"},
          {"P_n", "W", "mean noise power"},
          {"P_n_dBm", "dBm", "the same"},
          {"MDS", "dBm", "minimum discernible signal"}},
         [](const Arguments& a) -> std::vector<double> {
             RadarParams radar;
             radar.noise_figure = a.decibel("F");
             radar.pulse_s = a["tau"];
             if (!a.word("B")) radar.bandwidth_hz = a["B"];
             const double noise_w = radar.noise_power_w();
             return {radar.noise_bandwidth_hz(), noise_w, dbm(noise_w), dbm(noise_w) + a["SN_min"]};
         },
         "F=8dB tau=0.5us"},
        {"stc",
         "sensitivity time control: what near echoes lose, to 0.001 dB as the receiver takes it",
         "physics 2.3 [P]",
         {slant_range(), above("r_stc", "m", "range where it ends", 0, 1e7),
          number("n", "", "exponent (4 point targets, 3 area clutter)", 0, 10).by_default(receiver.stc_exponent),
          number("A_max", "dB", "most that is taken", 0, 200).by_default(receiver.stc_max)},
         {{"A_stc", "dB", "attenuation"}},
         [](const Arguments& a) -> std::vector<double> {
             ReceiverParams params;
             params.stc_range_m = a["r_stc"];
             params.stc_exponent = a["n"];
             params.stc_max = a.decibel("A_max");
             return {stc_db(params, a["r"])};
         },
         "r=5nmi r_stc=20nmi"},
        {"receiver",
         "IF amplifier, video and display: what a received power looks like on the tube",
         "physics 2.4 [P]",
         {number("P", "W", "signal + mean noise", 0, 1e9),
          number("MDS", "dBm", "minimum discernible signal", -300, 200),
          number("A_stc", "dB", "STC", 0, 200).by_default("0dB"),
          number("G_if", "dB", "IF gain", -200, 300).by_default(receiver.if_gain),
          number("G_v", "dB", "video gain", -100, 100).by_default(receiver.video_gain),
          above("D_log", "dB", "dynamic range of the logarithmic amplifier", 0, 200).by_default(receiver.dynamic_range),
          number("gamma_d", "", "display gamma", 0.1, 10).by_default(receiver.display_gamma)},
         {{"v_if", "", "out of the IF amplifier, 0 to 1"},
          {"v_video", "", "out of the video amplifier, 0 to 1"},
          {"grey", "", "on the tube, 0 to 255"}},
         [](const Arguments& a) -> std::vector<double> {
             ReceiverParams params;
             params.if_gain = a.decibel("G_if");
             params.video_gain = a.decibel("G_v");
             params.dynamic_range = a.decibel("D_log");
             params.display_gamma = a["gamma_d"];
             const Levels levels = receiver_levels(params, a["MDS"], rounded_dbm(a["P"]), a["A_stc"]);
             return {levels.if_stage, levels.video, static_cast<double>(levels.grey)};
         },
         "P=-80dBm MDS=-102dBm G_if=50dB"},
        {"display",
         "where on the tube a slant range is painted",
         "physics 1.4 [V2; time-delayed sweep P]",
         {one_of("display", "kind of sweep", {"gpi", "ppi", "tdppi"}).by_default("gpi"), slant_range(),
          height_input("hs", "height of the antenna above sea level"),
          height_input("h_0", "reference height").by_default("0m"),
          number("r_d", "m", "slant range at the centre of tdppi (default: the height above the reference)", 0, 1e7)
              .or_word("auto")
              .by_default("auto"),
          earth_factor_input(), earth_radius_input()},
         {{"rho", "m", "radius on the tube, in metres of the display's own range"}},
         [](const Arguments& a) -> std::vector<double> {
             constexpr DisplayKind kinds[] = {DisplayKind::gpi, DisplayKind::ppi, DisplayKind::tdppi};
             DisplaySetting setting;
             setting.params.kind = kinds[*a.word("display")];
             setting.sensor_m = a["hs"];
             setting.reference_m = a["h_0"];
             setting.sweep_delay_m = a.word("r_d") ? std::max(0.0, a["hs"] - a["h_0"]) : a["r_d"];
             setting.earth = earth_of(a);
             if (const auto radius_m = display_radius_m(setting, a["r"])) return {*radius_m};
             throw NoSolution(
                 text("slant range ", a["r"], " m is not shown; the sweep begins at ",
                      setting.params.kind == DisplayKind::tdppi ? setting.sweep_delay_m : std::abs(a["hs"] - a["h_0"]),
                      " m"));
         },
         "display=gpi r=10km hs=7000ft"},
    };
}

}  // namespace

std::vector<Model> radar_models() {
    std::vector<Model> models = equation_models();
    for (Model& model : receiver_models()) models.push_back(std::move(model));
    return models;
}

}  // namespace wedgescope
