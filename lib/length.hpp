// Units of length that are no power of ten of the metre, exact by definition.
#pragma once

namespace wedgescope {

inline constexpr double foot_m = 0.3048;  ///< international
inline constexpr double nautical_mile_m = 1852;

}  // namespace wedgescope
