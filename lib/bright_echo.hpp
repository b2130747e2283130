// BrightEcho: how far what returns most of the ground may stand above the noise, whatever receiver listens.
// Leaves what follows for spokes to resolve.cpp and for levels of detail to detail.cpp.
#pragma once
#include "lib/engine.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

/// A radar with the power and the gain of a scene, for which its bins would be chosen, but with at least the beam and the pulse of
/// RadarParams, and with their receiver: nothing that may be set again over a stored echo.
RadarParams like_bins_of(const ResolvedScene& scene);

class BrightEcho {
public:
    BrightEcho(const ResolvedScene& scene, const DataBase& data_base);

    /// False where a class law hangs on the angle, or water shines by way of it.
    bool known() const { return gamma_ < infinite; }
    /// Power of a cell `range_m` off over that of the noise, of like_bins_of(): its ground has the largest gamma and rises towards the
    /// sensor by half; the antenna's most towards anything from 1500 m below the ground under the sensor to 1500 m above.
    /// Infinite where it is not known(). Source: physics "Radar equation", d(sin e) telescoped over the pulse: (h / r + slope) / r
    /// of its length.
    double over_noise(double range_m) const;

private:
    RadarParams radar_;
    Earth earth_;
    double height_m_;  ///< over the ground below
    double gamma_;     ///< linear
};

}  // namespace wedgescope
