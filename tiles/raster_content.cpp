#include "tiles/raster_content.hpp"

#include <numeric>

#include "lib/polar.hpp"

namespace wedgescope {

void set_states(RasterContent& content) {
    content.codes.resize(state_count);
    std::iota(content.codes.begin(), content.codes.end(), std::uint8_t{0});
    content.means_something = [](double value) { return value >= 0 && value < state_count; };
    content.means_nothing = 255;
}

}  // namespace wedgescope
