// Watts to grey levels: the project's definition worked by hand.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "lib/receiver.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;

namespace {

double watts(double dbm) { return std::pow(10.0, (dbm - 30) / 10); }

ReceiverParams plain() {
    ReceiverParams receiver;
    receiver.mds_dbm = -100;
    receiver.if_gain = Decibel(44);  // a signal shows from 20 dB over the MDS, saturates 20 dB above that
    return receiver;
}

}  // namespace

TEST_CASE("a milliwatt is 0 dBm, and levels are rounded to a thousandth", "[receiver]") {
    CHECK(rounded_dbm(1e-3) == 0);
    CHECK(rounded_dbm(1) == 30);
    CHECK(rounded_dbm(2e-3) == 3.010);  // 3.0103
    CHECK(rounded_dbm(1e-13) == -100);
    CHECK(rounded_dbm(0) == least_dbm);
    CHECK(rounded_dbm(0) < rounded_dbm(1e-45));
}

TEST_CASE("grey runs from the threshold through the logarithm's range", "[receiver]") {
    const Receiver receiver(plain(), RadarParams{});
    CHECK(receiver.mds_dbm() == -100);
    CHECK(receiver.grey(0, 1000) == 0);
    CHECK(receiver.grey(watts(-90), 1000) == 0);
    CHECK(receiver.grey(watts(-80), 1000) == 0);
    CHECK(receiver.grey(watts(-75), 1000) == 64);   // 255 / 4 = 63.75
    CHECK(receiver.grey(watts(-70), 1000) == 128);  // 127.5, rounded up
    CHECK(receiver.grey(watts(-60), 1000) == 255);
    CHECK(receiver.grey(watts(20), 1000) == 255);
}

TEST_CASE("each decibel of IF gain uncovers a signal one decibel weaker", "[receiver]") {
    for (const double gain : {34.0, 40.0, 50.0, 64.0}) {
        ReceiverParams params = plain();
        params.if_gain = Decibel(gain);
        const Receiver receiver(params, RadarParams{});
        const double threshold_dbm = -100 + 64 - gain;
        CHECK(receiver.grey(watts(threshold_dbm), 1000) == 0);
        CHECK(receiver.grey(watts(threshold_dbm + 10), 1000) == 128);
    }
}

TEST_CASE("six decibels more of video gain double the grey level until it saturates", "[receiver]") {
    ReceiverParams params = plain();
    params.video_gain = Decibel(4 + 20 * std::log10(2.0));
    const Receiver receiver(params, RadarParams{});
    CHECK(receiver.grey(watts(-80), 1000) == 0);
    CHECK(receiver.grey(watts(-76), 1000) == 102);  // 255 * 0.2 * 2
    CHECK(receiver.grey(watts(-70), 1000) == 255);
    CHECK(receiver.grey(watts(-65), 1000) == 255);
}

TEST_CASE("display gamma 2 shows the square root of the video", "[receiver]") {
    ReceiverParams params = plain();
    params.display_gamma = 2;
    const Receiver receiver(params, RadarParams{});
    CHECK(receiver.grey(watts(-75), 1000) == 128);   // sqrt(1/4)
    CHECK(receiver.grey(watts(-79.8), 1000) == 26);  // sqrt(0.01): 25.5, rounded up
    CHECK(receiver.grey(watts(-60), 1000) == 255);
    CHECK(receiver.grey(0, 1000) == 0);
}

TEST_CASE("STC takes 12 dB for each halving of the range, up to its limit", "[receiver]") {
    ReceiverParams params = plain();
    CHECK(stc_db(params, 10) == 0);
    params.stc_range_m = 8000;
    CHECK(stc_db(params, 9000) == 0);
    CHECK(stc_db(params, 8000) == 0);
    CHECK_THAT(stc_db(params, 4000), WithinAbs(12.041, 1e-9));  // 40 log10 2, rounded
    CHECK_THAT(stc_db(params, 2000), WithinAbs(24.082, 1e-9));
    CHECK(stc_db(params, 80) == 40);
    CHECK(stc_db(params, 0) == 40);
    params.stc_exponent = 3;
    CHECK_THAT(stc_db(params, 800), WithinAbs(30, 1e-9));
    const Receiver receiver(params, RadarParams{});
    CHECK(receiver.grey(watts(-70), 8000) == 128);
    CHECK(receiver.grey(watts(-70 + 30), 800) == 128);
}

TEST_CASE("without a given level the MDS is the thermal noise", "[receiver]") {
    // kT0 = -173.975 dBm/Hz in 2.4 MHz (63.802 dB) with a noise figure of 8 dB.
    CHECK_THAT(Receiver(ReceiverParams{}, RadarParams{}).mds_dbm(), WithinAbs(-102.173, 1.5e-3));
}

TEST_CASE("the levels of a single power end at the grey that the receiver paints", "[receiver]") {
    for (const double gamma : {1.0, 0.45, 2.2})
        for (const double video_db : {-2.0, 4.0, 9.3}) {
            ReceiverParams params = plain();
            params.display_gamma = gamma;
            params.video_gain = Decibel(video_db);
            params.stc_range_m = 2000;
            const Receiver receiver(params, RadarParams{});
            for (double dbm = -101; dbm < -50; dbm += 0.0371)
                for (const double range_m : {500.0, 1700.0, 5000.0}) {
                    const double stc = stc_db(params, range_m), power = watts(dbm);
                    const Levels levels = receiver_levels(params, -100, rounded_dbm(power), stc);
                    REQUIRE(levels.grey == receiver.grey(power, range_m));
                    const double v_if = std::clamp((dbm - stc + 100 + 44 - 64) / 20, 0.0, 1.0);
                    CHECK_THAT(levels.if_stage, WithinAbs(v_if, 0.001 / 20));  // rounded to 0.001 dB
                    const double v = std::min(1.0, v_if * std::pow(10.0, (video_db - 4) / 20));
                    CHECK_THAT(levels.video, WithinAbs(v, 2 * 0.001 / 20));
                }
        }
    CHECK(receiver_levels(plain(), -100, rounded_dbm(0), 0).grey == 0);
}
