// Receiver: received watts -> grey level: STC, IF log amplifier, video amplifier, display gamma.
// Leaves where a cell lies on the tube to display.hpp.
//
// Source: physics 2.2 to 2.4 (project definitions).
#pragma once
#include <array>
#include <cstdint>

#include "lib/sensor.hpp"

namespace wedgescope {

/// Stands for no power at all; below what the least float in watts amounts to (-418.5 dBm).
inline constexpr double least_dbm = -500;

/// dBm of a power in watts, rounded to 0.001 dB, so that libm's last bit never shows; `least_dbm` for 0 W.
double rounded_dbm(double power_w);

/// A_stc = min(A_max, max(0, 10 n log10(r_stc / r))), dB; 0 without STC.
double stc_db(const ReceiverParams& receiver, double slant_range_m);

class Receiver {
public:
    Receiver(const ReceiverParams& receiver, const RadarParams& radar);

    double mds_dbm() const { return mds_dbm_; }
    /// 0..255 for received power (signal + noise), watts, at a slant range.
    /// v_if = clip((P - A_stc - MDS + G_if - 64 dB) / D_log, 0, 1); v_video = min(1, v_if 10^((G_v - 4 dB)/20)),
    /// to the power 1/gamma; grey = floor(255 v + 0.5).
    std::uint8_t grey(double power_w, double slant_range_m) const;

private:
    ReceiverParams receiver_;
    double mds_dbm_ = 0;
    double black_dbm_ = 0;  ///< the level at which grey leaves 0, without STC
    double video_factor_ = 1;
    std::array<double, 256> least_video_{};  ///< [g]: the video level from which the grey is g or more
};

}  // namespace wedgescope
