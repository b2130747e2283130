// Receiver: received watts -> grey level: STC, IF log amplifier, video amplifier, display gamma.
// Leaves where a cell lies on the tube to display.hpp.
//
// Source: physics 2.2 to 2.4 (project definitions).
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "lib/sensor.hpp"

namespace wedgescope {

/// The gains at which the IF amplifier shows the MDS and the video amplifier leaves it as it is.
inline constexpr Decibel if_gain_reference{64}, video_gain_reference{4};

/// Stands for no power at all; below what the least float in watts amounts to (-418.5 dBm).
inline constexpr double least_dbm = -500;

/// dBm of a power in watts, rounded to 0.001 dB, so that libm's last bit never shows; `least_dbm` for 0 W.
double rounded_dbm(double power_w);

/// What is received of a power in watts without fluctuation: with the noise's mean on it.
inline float with_mean_noise(float power_w, double noise_power_w) {
    return static_cast<float>(static_cast<double>(power_w) + noise_power_w);
}

/// A_stc = min(A_max, max(0, 10 n log10(r_stc / r))), dB; 0 without STC.
double stc_db(const ReceiverParams& receiver, double slant_range_m);

/// What a power becomes on its way to the tube.
struct Levels {
    double if_stage;  ///< v_if, 0..1
    double video;     ///< v_video, 0..1, before the display gamma
    std::uint8_t grey;
};
/// By the formulas of `Receiver::grey`, whose grey it gives, for a single power, in dBm.
Levels receiver_levels(const ReceiverParams& receiver, double mds_dbm, double power_dbm, double stc_db);

class Receiver {
public:
    Receiver(const ReceiverParams& receiver, const RadarParams& radar);

    double mds_dbm() const { return mds_dbm_; }
    /// 0..255 for received power (signal + noise), watts, at a slant range.
    /// v_if = clip((P - A_stc - MDS + G_if - 64 dB) / D_log, 0, 1); v_video = min(1, v_if 10^((G_v - 4 dB)/20)),
    /// to the power 1/gamma; grey = floor(255 v + 0.5).
    std::uint8_t grey(double power_w, double slant_range_m) const {
        if (receiver_.stc_range_m) return grey_of(power_w, stc_db(receiver_, slant_range_m));
        if (!(power_w >= least_power_w_[1])) return 0;
        const std::uint64_t key = key_of(power_w) - first_key_;
        std::size_t grey = key < start_grey_.size() ? start_grey_[key] : start_grey_.back();
        // Without a branch: hardly a key holds two steps, but of those that hold one neighbours fall on either side.
        grey += power_w >= least_power_w_[grey + 1] ? 1 : 0;
        while (grey < 255 && power_w >= least_power_w_[grey + 1]) ++grey;
        return static_cast<std::uint8_t>(std::min<std::size_t>(grey, 255));
    }

private:
    /// By the formula.
    std::uint8_t grey_of(double power_w, double stc_db) const;
    void find_steps();
    /// Exponent and first 7 bits of a positive number: grows with it.
    static std::uint64_t key_of(double power_w) { return std::bit_cast<std::uint64_t>(power_w) >> 45; }

    ReceiverParams receiver_;
    double mds_dbm_ = 0;
    double black_dbm_ = 0;  ///< the level at which grey leaves 0, without STC
    double video_factor_ = 1;
    std::array<double, 256> least_video_{};  ///< [g]: the video level from which the grey is g or more
    // Without STC: [g]: the least power from which the grey is g or more; infinite where there is none, as at 256.
    std::array<double, 257> least_power_w_{};
    std::uint64_t first_key_ = 0;           ///< of the power from which the grey is 1
    std::vector<std::uint8_t> start_grey_;  ///< by key, less the first: the grey of the least power with that key
};

}  // namespace wedgescope
