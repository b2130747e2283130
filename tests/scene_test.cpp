// What a scene may be: defaults of the radar, and refusals that name the key.
#include <catch2/catch.hpp>

#include <cmath>
#include <functional>
#include <limits>

#include "lib/error.hpp"
#include "lib/scene.hpp"
#include "tests/refusal.hpp"

using namespace wedgescope;
using Catch::Contains;
using Catch::Matchers::WithinRel;

namespace {

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

Scene good() {
    Scene scene;
    scene.platform.latlon = LatLon{34, -117};
    scene.platform.altitude_m = 2134;
    return scene;
}

/// The message that refuses the good scene after one change.
std::string refusal(const std::function<void(Scene&)>& change) {
    Scene scene = good();
    change(scene);
    return test::refusal<InputError>([&] { validate(scene); });
}

}  // namespace

TEST_CASE("the radar's derived numbers are those of the radar equation", "[sensor]") {
    RadarParams radar;
    radar.frequency_hz = 10e9;
    radar.pulse_s = 1e-6;
    radar.noise_figure = Decibel(0);
    radar.bandwidth_hz = 1;
    CHECK_THAT(radar.wavelength_m(), WithinRel(0.0299792458, 1e-15));
    CHECK_THAT(radar.pulse_extent_m(), WithinRel(149.896229, 1e-12));
    // kT0 = -173.975 dBm/Hz, three decimals.
    CHECK(10 * std::log10(radar.noise_power_w()) + 30 == Approx(-173.975).margin(5e-4));
    const RadarParams usual;
    CHECK_THAT(usual.noise_bandwidth_hz(), WithinRel(2.4e6, 1e-12));  // 1.2 / 0.5 us
    // -173.975 + 10 log10(2.4e6) + 8 dB.
    CHECK(10 * std::log10(usual.noise_power_w()) + 30 == Approx(-102.173).margin(1e-3));
}

TEST_CASE("a scene with defaults passes", "[scene]") {
    CHECK(refusal([](Scene&) {}) == test::nothing_refused);
    CHECK(refusal([](Scene& s) { s.earth_k.reset(); }) == test::nothing_refused);
    CHECK(refusal([](Scene& s) {
              s.sector = Sector{Angle::degrees(-60), Angle::degrees(60)};
          }) == test::nothing_refused);
    CHECK(refusal([](Scene& s) {
              s.sector = Sector{Angle::degrees(300), Angle::degrees(420)};
          }) == test::nothing_refused);
    CHECK(refusal([](Scene& s) {
              s.sector = Sector{Angle::degrees(0), Angle::degrees(360)};
          }) == test::nothing_refused);
    CHECK(refusal([](Scene& s) {
              s.sector = Sector{Angle::degrees(-180), Angle::degrees(180)};
          }) == test::nothing_refused);
}

TEST_CASE("a value out of range is refused with key, value and what is accepted", "[scene]") {
    CHECK(refusal([](Scene& s) { s.range_m = 0; }) == "range is 0 m; it must be above 0 and at most 10000000");
    CHECK(refusal([](Scene& s) { s.radar.antenna.beam = Angle::degrees(200); }) ==
          "beam is 200 deg; it must be at least 0.002 and at most 90");
    CHECK(refusal([](Scene& s) { s.radar.transmit_power_w = 0; }) ==
          "transmit-power is 0 W; it must be at least 0.001 and at most 1000000000");
    CHECK(refusal([](Scene& s) { s.radar.transmit_power_w = infinity; }) ==
          "transmit-power is inf W; it must be at least 0.001 and at most 1000000000");
    CHECK(refusal([](Scene& s) { s.radar.bandwidth_hz = infinity; }) ==
          "bandwidth is inf Hz; it must be above 0 and finite");
    CHECK(refusal([](Scene& s) {
              s.range_m = 500;
              s.range_start_m = 500;
          }) == "range is 500 m; it must be above range-start, 500 m");
    CHECK_THAT(refusal([](Scene& s) {
                   s.sector = Sector{Angle::degrees(10), Angle::degrees(10)};
               }),
               Contains("sector is 10,10 deg"));
    CHECK_THAT(refusal([](Scene& s) {
                   s.sector = Sector{Angle::degrees(-300), Angle::degrees(300)};
               }),
               Contains("sector is -300,300 deg"));
}

TEST_CASE("exactly one position is needed", "[scene]") {
    CHECK_THAT(refusal([](Scene& s) { s.platform.xy = PointXY{1, 2}; }), Contains("latlon") && Contains("xy"));
    CHECK_THAT(refusal([](Scene& s) { s.platform.latlon.reset(); }), Contains("latlon") && Contains("xy"));
    CHECK_THAT(refusal([](Scene& s) { s.platform.altitude_above = AltitudeAbove::ellipsoid; }),
               Contains("geoid-offset"));
}

TEST_CASE("NaN is refused wherever a number is asked for, and the key is named", "[scene]") {
    struct Case {
        const char* key;
        std::function<void(Scene&, double)> set;
    };
    const Case cases[] = {
        {"frequency", [](Scene& s, double v) { s.radar.frequency_hz = v; }},
        {"transmit-power", [](Scene& s, double v) { s.radar.transmit_power_w = v; }},
        {"gain", [](Scene& s, double v) { s.radar.gain = Decibel(v); }},
        {"losses", [](Scene& s, double v) { s.radar.losses = Decibel(v); }},
        {"pulse", [](Scene& s, double v) { s.radar.pulse_s = v; }},
        {"noise-figure", [](Scene& s, double v) { s.radar.noise_figure = Decibel(v); }},
        {"bandwidth", [](Scene& s, double v) { s.radar.bandwidth_hz = v; }},
        {"beam", [](Scene& s, double v) { s.radar.antenna.beam = Angle::degrees(v); }},
        {"antenna-knee", [](Scene& s, double v) { s.radar.antenna.knee = Angle::degrees(v); }},
        {"antenna-width", [](Scene& s, double v) { s.radar.antenna.width = Angle::degrees(v); }},
        {"antenna-exponent", [](Scene& s, double v) { s.radar.antenna.exponent = v; }},
        {"antenna-floor", [](Scene& s, double v) { s.radar.antenna.floor = Decibel(v); }},
        {"tilt", [](Scene& s, double v) { s.radar.antenna.tilt = Angle::degrees(v); }},
        {"if-gain", [](Scene& s, double v) { s.receiver.if_gain = Decibel(v); }},
        {"video-gain", [](Scene& s, double v) { s.receiver.video_gain = Decibel(v); }},
        {"stc-range", [](Scene& s, double v) { s.receiver.stc_range_m = v; }},
        {"stc-exponent", [](Scene& s, double v) { s.receiver.stc_exponent = v; }},
        {"stc-max", [](Scene& s, double v) { s.receiver.stc_max = Decibel(v); }},
        {"minimum-range", [](Scene& s, double v) { s.receiver.minimum_range_m = v; }},
        {"dynamic-range", [](Scene& s, double v) { s.receiver.dynamic_range = Decibel(v); }},
        {"mds", [](Scene& s, double v) { s.receiver.mds_dbm = v; }},
        {"display-gamma", [](Scene& s, double v) { s.receiver.display_gamma = v; }},
        {"range", [](Scene& s, double v) { s.range_m = v; }},
        {"range-start", [](Scene& s, double v) { s.range_start_m = v; }},
        {"range-bin", [](Scene& s, double v) { s.range_bin_m = v; }},
        {"sector",
         [](Scene& s, double v) {
             s.sector = Sector{Angle::degrees(v), Angle::degrees(9)};
         }},
        {"sector",
         [](Scene& s, double v) {
             s.sector = Sector{Angle::degrees(9), Angle::degrees(v)};
         }},
        {"earth", [](Scene& s, double v) { s.earth_k = v; }},
        {"gamma", [](Scene& s, double v) { s.gamma = Decibel(v); }},
        {"sweep-delay", [](Scene& s, double v) { s.display.sweep_delay_m = v; }},
        {"bwe-scale", [](Scene& s, double v) { s.radar.beam_width_scale = v; }},
        {"ple-scale", [](Scene& s, double v) { s.radar.pulse_length_scale = v; }},
        {"ring-spacing", [](Scene& s, double v) { s.display.ring_spacing_m = v; }},
        {"azimuth-marks", [](Scene& s, double v) { s.display.azimuth_marks_rad = v; }},
        {"centre",
         [](Scene& s, double v) {
             s.display.centre = TubePlace{v, 0};
         }},
        {"centre",
         [](Scene& s, double v) {
             s.display.centre = TubePlace{0, v};
         }},
        {"heading", [](Scene& s, double v) { s.platform.heading = Angle::degrees(v); }},
        {"latlon", [](Scene& s, double v) { s.platform.latlon = LatLon{v, 0}; }},
        {"latlon", [](Scene& s, double v) { s.platform.latlon = LatLon{0, v}; }},
        {"altitude-msl", [](Scene& s, double v) { s.platform.altitude_m = v; }},
        {"geoid-offset", [](Scene& s, double v) { s.platform.geoid_offset_m = v; }},
    };
    for (const Case& c : cases)
        for (const double value : {nan_value, infinity, -infinity}) {
            INFO(c.key << " = " << value);
            const std::string message = refusal([&](Scene& s) { c.set(s, value); });
            CHECK(message.rfind(c.key, 0) == 0);
            CHECK_THAT(message, Contains(" is ") && Contains("; it must be "));
        }
}

TEST_CASE("counts out of range are refused", "[scene]") {
    CHECK_THAT(refusal([](Scene& s) { s.azimuth_bins = 0; }), Contains("azimuth-bins is 0;"));
    CHECK_THAT(refusal([](Scene& s) { s.display.size = 0; }), Contains("size is 0 pixels"));
    CHECK_THAT(refusal([](Scene& s) { s.radar.beam_width_scale = 0.09; }), Contains("bwe-scale is 0.09; it must be"));
    CHECK_THAT(refusal([](Scene& s) { s.radar.pulse_length_scale = 20.1; }), Contains("ple-scale is 20.1; it must be"));
    CHECK_THAT(refusal([](Scene& s) { s.display.centre = TubePlace{0, -1.1}; }), Contains("centre: y is -1.1"));
    CHECK_THAT(refusal([](Scene& s) { s.display.ring_spacing_m = 0; }), Contains("ring-spacing is 0 m"));
    CHECK_THAT(refusal([](Scene& s) { s.display.azimuth_marks_rad = Angle::degrees(0.5).rad(); }),
               Contains("azimuth-marks is 0.5 deg"));
    CHECK_THAT(refusal([](Scene& s) { s.receiver.speckle_looks = -1; }), Contains("speckle is -1;"));
}

TEST_CASE("a shaped antenna needs its knee below the horizontal, a Gaussian one does not", "[sensor]") {
    CHECK_THAT(refusal([](Scene& s) { s.radar.antenna.knee = Angle::degrees(0); }), Contains("antenna-knee is 0 deg"));
    CHECK(refusal([](Scene& s) {
              s.radar.antenna.knee = Angle::degrees(0);
              s.radar.antenna.elevation = ElevationPattern::gaussian;
          }) == test::nothing_refused);
}

TEST_CASE("points of a pattern are refused by number, with what is accepted", "[sensor]") {
    const auto refused = [](std::vector<PatternPoint> points) {
        return refusal([&](Scene& s) {
            s.radar.antenna.elevation = ElevationPattern::points;
            s.radar.antenna.knee = Angle::degrees(0);  // plays no part
            s.radar.antenna.points = std::move(points);
        });
    };
    const auto at = [](double depression_deg, double gain_db) {
        return PatternPoint{Angle::degrees(depression_deg), Decibel(gain_db)};
    };
    CHECK(refused({at(-90, -30), at(0, 0), at(90, -30)}) == test::nothing_refused);
    CHECK(refused({at(1, -0.5), at(1.001, 0)}) == test::nothing_refused);
    CHECK_THAT(refused({}), Contains("antenna, point 1: there are 0 points; accepted: from 2 to 4096"));
    CHECK_THAT(refused({at(0, 0)}), Contains("there is 1 point"));
    CHECK_THAT(refused({at(0, 0), at(0, -1)}),
               Contains("antenna, point 2: the depression is 0 deg after 0 deg; accepted: ascending"));
    CHECK_THAT(refused({at(0, 0), at(0.0005, -1)}), Contains("0.001 deg or more apart"));
    CHECK_THAT(refused({at(1, -0.6), at(1.001, 0)}),
               Contains("point 2: the gain changes by 0.6 dB in 0.001 deg; accepted: at most 500 dB a degree"));
    CHECK_THAT(refused({at(0, 0), at(5, 0.1)}), Contains("point 2: the gain is 0.1 dB; accepted: from -200 to 0 dB"));
    CHECK_THAT(refused({at(-91, 0), at(5, 0)}), Contains("point 1: the depression is -91 deg"));
    CHECK_THAT(refused({at(nan_value, 0), at(5, 0)}), Contains("point 1: the depression is nan"));
    CHECK_THAT(refused({at(0, nan_value), at(5, 0)}), Contains("point 1: the gain is nan"));
    std::vector<PatternPoint> many;
    for (int i = 0; i < 4097; ++i) many.push_back(at(0.01 * i, -1));
    CHECK_THAT(refused(many), Contains("4097 points"));
}

TEST_CASE("the words are those of the command line", "[scene]") {
    CHECK(std::string(word(Geometry::grid)) == "grid");
    CHECK(std::string(word(DisplayKind::gpi_true)) == "gpi-true");
    CHECK(std::string(word(DisplayKind::tdppi)) == "tdppi");
    CHECK(std::string(word(Orientation::heading)) == "heading");
    CHECK(std::string(word(Quality::draft)) == "draft");
    CHECK(std::string(word(ElevationPattern::cos_csc2)) == "cos-csc2");
    CHECK(std::string(word(AzimuthPattern::uniform)) == "uniform");
}
