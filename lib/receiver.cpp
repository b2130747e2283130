#include "lib/receiver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace wedgescope {
namespace {

constexpr double if_gain_reference_db = if_gain_reference.db();
constexpr double video_gain_reference_db = video_gain_reference.db();

double rounded_db(double db) { return std::round(db * 1000) / 1000; }

// libm feeds tables only, rounded: the bits of a picture do not hang on its last digit.
double video_factor(const ReceiverParams& receiver) {
    return static_cast<float>(std::pow(10.0, (receiver.video_gain.db() - video_gain_reference_db) / 20));
}

/// Grey g or more where floor(255 v^(1/gamma) + 0.5) >= g, so where v >= ((g - 0.5) / 255)^gamma.
double least_video(std::size_t grey, double display_gamma) {
    const double shown = (static_cast<double>(grey) - 0.5) / 255;
    return display_gamma == 1 ? shown : static_cast<float>(std::pow(shown, display_gamma));
}

}  // namespace

double rounded_dbm(double power_w) {
    if (!(power_w > 0)) return least_dbm;
    return std::max(least_dbm, rounded_db(10 * std::log10(power_w) + 30));
}

double stc_db(const ReceiverParams& receiver, double slant_range_m) {
    if (!receiver.stc_range_m) return 0;
    const double most = receiver.stc_max.db();
    if (!(slant_range_m > 0)) return most;
    const double db = 10 * receiver.stc_exponent * std::log10(*receiver.stc_range_m / slant_range_m);
    return std::clamp(rounded_db(db), 0.0, most);
}

Levels receiver_levels(const ReceiverParams& receiver, double mds_dbm, double power_dbm, double stc_db) {
    const double black_dbm = mds_dbm - receiver.if_gain.db() + if_gain_reference_db;
    const double above_black_db = std::max(least_dbm, rounded_db(power_dbm)) - stc_db - black_dbm;
    Levels levels{};
    levels.if_stage = std::clamp(above_black_db / receiver.dynamic_range.db(), 0.0, 1.0);
    levels.video = std::min(1.0, levels.if_stage * video_factor(receiver));
    // Halving the greys asks for 8 of the 255 steps.
    std::size_t grey = 0, above = 256;
    while (above - grey > 1) {
        const std::size_t middle = (grey + above) / 2;
        (levels.video >= least_video(middle, receiver.display_gamma) ? grey : above) = middle;
    }
    levels.grey = static_cast<std::uint8_t>(grey);
    return levels;
}

Receiver::Receiver(const ReceiverParams& receiver, const RadarParams& radar)
    : receiver_(receiver), mds_dbm_(receiver.mds_dbm ? *receiver.mds_dbm : rounded_dbm(radar.noise_power_w())) {
    black_dbm_ = mds_dbm_ - receiver.if_gain.db() + if_gain_reference_db;
    video_factor_ = video_factor(receiver);
    for (std::size_t g = 1; g < least_video_.size(); ++g) least_video_[g] = least_video(g, receiver.display_gamma);
    find_steps();
}

void Receiver::find_steps() {
    // The grey never falls with the power: halving finds where it steps, first from where the formula puts it but for
    // the rounding to 0.001 dB.
    constexpr double most = std::numeric_limits<double>::max();
    least_power_w_.fill(std::numeric_limits<double>::infinity());
    least_power_w_[0] = 0;
    for (std::size_t g = 1; g < least_video_.size() && grey_of(most, 0) >= g; ++g) {
        const double dbm = black_dbm_ + receiver_.dynamic_range.db() * least_video_[g] / video_factor_,
                     about_w = std::pow(10.0, (dbm - 30) / 10);
        double low = about_w * (1 - 5e-4), high = about_w * (1 + 5e-4);
        if (!(low > 0) || grey_of(low, 0) >= g) low = 0;
        if (!(high <= most) || grey_of(high, 0) < g) high = most;
        auto below = std::bit_cast<std::uint64_t>(low), from = std::bit_cast<std::uint64_t>(high);
        while (from - below > 1) {
            const std::uint64_t middle = below + (from - below) / 2;
            (grey_of(std::bit_cast<double>(middle), 0) >= g ? from : below) = middle;
        }
        least_power_w_[g] = std::bit_cast<double>(from);
    }
    start_grey_.assign(1, 0);
    if (!(least_power_w_[1] <= most)) return;  // black, whatever comes
    first_key_ = key_of(least_power_w_[1]);
    const auto top = static_cast<std::size_t>(
        std::find_if(least_power_w_.begin(), least_power_w_.end(), [&](double w) { return !(w <= most); }) -
        least_power_w_.begin() - 1);
    const std::uint64_t last = key_of(least_power_w_[top]);
    start_grey_.resize(last - first_key_ + 2);
    std::size_t grey = 1;
    for (std::uint64_t key = first_key_; key <= last + 1; ++key) {
        const double least = std::bit_cast<double>(key << 45);
        while (grey < top && least_power_w_[grey + 1] <= least) ++grey;
        start_grey_[key - first_key_] = static_cast<std::uint8_t>(grey);
    }
}

std::uint8_t Receiver::grey_of(double power_w, double stc_db) const {
    const double above_black_db = rounded_dbm(power_w) - stc_db - black_dbm_;
    const double v_if = std::clamp(above_black_db / receiver_.dynamic_range.db(), 0.0, 1.0);
    const double v_video = std::min(1.0, v_if * video_factor_);
    const auto above = std::upper_bound(least_video_.begin() + 1, least_video_.end(), v_video);
    return static_cast<std::uint8_t>(above - least_video_.begin() - 1);
}

}  // namespace wedgescope
