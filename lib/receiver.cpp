#include "lib/receiver.hpp"

#include <algorithm>
#include <cmath>

namespace wedgescope {
namespace {

constexpr double if_gain_reference_db = 64;
constexpr double video_gain_reference_db = 4;

double rounded_db(double db) { return std::round(db * 1000) / 1000; }

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

Receiver::Receiver(const ReceiverParams& receiver, const RadarParams& radar)
    : receiver_(receiver), mds_dbm_(receiver.mds_dbm ? *receiver.mds_dbm : rounded_dbm(radar.noise_power_w())) {
    black_dbm_ = mds_dbm_ - receiver.if_gain.db() + if_gain_reference_db;
    // libm feeds tables only, rounded: the bits of a picture do not hang on its last digit.
    video_factor_ = static_cast<float>(std::pow(10.0, (receiver.video_gain.db() - video_gain_reference_db) / 20));
    // Grey g or more where floor(255 v^(1/gamma) + 0.5) >= g, so where v >= ((g - 0.5) / 255)^gamma.
    for (std::size_t g = 1; g < least_video_.size(); ++g) {
        const double shown = (static_cast<double>(g) - 0.5) / 255;
        least_video_[g] =
            receiver.display_gamma == 1 ? shown : static_cast<float>(std::pow(shown, receiver.display_gamma));
    }
}

std::uint8_t Receiver::grey(double power_w, double slant_range_m) const {
    const double above_black_db = rounded_dbm(power_w) - stc_db(receiver_, slant_range_m) - black_dbm_;
    const double v_if = std::clamp(above_black_db / receiver_.dynamic_range.db(), 0.0, 1.0);
    const double v_video = std::min(1.0, v_if * video_factor_);
    const auto above = std::upper_bound(least_video_.begin() + 1, least_video_.end(), v_video);
    return static_cast<std::uint8_t>(above - least_video_.begin() - 1);
}

}  // namespace wedgescope
