#include "lib/deposit.hpp"

#include <algorithm>
#include <cmath>

namespace wedgescope {

State most_telling(std::uint8_t bits) {
    if (bits & bit_seen) return State::seen;
    if (bits & bit_unknown) return State::unknown;
    if (bits & bit_shadow) return State::shadow;
    if (bits & bit_no_data) return State::no_data;
    return State::outside;
}

Quanta quanta(Interval range_bins, double range_bin_m, double radar_constant, double most_pattern2, double azimuth_step_rad,
              double most_gamma) {
    Quanta q;
    q.range_bins = range_bins;
    for (std::int64_t j = range_bins.begin; j < range_bins.end; ++j) {
        const double near_m = std::max(1.0, static_cast<double>(j) * range_bin_m);
        const double most = radar_constant * most_pattern2 * 2 * azimuth_step_rad * most_gamma / (near_m * near_m);
        int exponent = -1000;  // nothing returns anything
        if (most > 0) {
            const double fraction = std::frexp(most, &exponent);  // most = fraction 2^exponent, fraction in [1/2, 1)
            if (fraction == 0.5) --exponent;
            exponent -= 61;
        }
        q.watts.push_back(std::ldexp(1.0, exponent));
        q.inverse.push_back(std::ldexp(1.0, -exponent));
    }
    return q;
}

WedgeCells::WedgeCells(std::size_t rows, const Quanta& quanta, std::size_t channels)
    : quanta_(quanta), rows_(rows), columns_(static_cast<std::size_t>(quanta.range_bins.size())), channels_(channels),
      first_bin_(static_cast<std::size_t>(quanta.range_bins.begin)),
      begin_(static_cast<double>(quanta.range_bins.begin)), end_(static_cast<double>(quanta.range_bins.end)), sums_(rows * columns_ * channels),
      bits_(rows * columns_) {}

void WedgeCells::put_quantities(const Target& target, std::size_t column, double whole, const double* quantities) {
    for (std::size_t c = 1; c < channels_; ++c) {
        std::int64_t* cell = sums_.data() + (c * rows_ + static_cast<std::size_t>(target.row)) * columns_ + column;
        *cell += std::lrint(whole * target.share[0] * quantities[c - 1]);
        if (target.share[1] > 0) cell[columns_] += std::lrint(whole * target.share[1] * quantities[c - 1]);
    }
}

void WedgeCells::add_cut(const Target& target, double near, double far, double power, double density, const double* quantities) {
    // Some of it lies in front of the first bin or behind the last one.
    if (!(far >= begin_) || !(near < end_)) return;  // also NaN
    const double a = std::max(near, begin_), b = std::min(far, end_);
    const auto first = static_cast<std::int32_t>(a);
    if (near >= begin_ && static_cast<double>(first + 1) > far) return put(target, first, power, quantities);
    for (std::int32_t j = first; static_cast<double>(j) < b; ++j)
        put(target, j, density * (std::min(b, static_cast<double>(j + 1)) - std::max(a, static_cast<double>(j))), quantities);
}

void WedgeCells::mark(const Target& target, double x0, double x1, std::uint8_t bit) {
    const double begin = static_cast<double>(quanta_.range_bins.begin), end = static_cast<double>(quanta_.range_bins.end);
    double near = std::min(x0, x1), far = std::max(x0, x1);
    if (!(far >= begin) || !(near < end)) return;
    near = std::max(near, begin);
    far = std::min(far, end - 0.5);
    const auto first = static_cast<std::size_t>(near - begin), last = static_cast<std::size_t>(far - begin);
    for (std::size_t side = 0; side < 2; ++side) {
        if (!(target.share[side] > 0)) continue;
        std::uint8_t* row = bits_.data() + (static_cast<std::size_t>(target.row) + side) * columns_;
        for (std::size_t j = first; j <= last; ++j) row[j] = static_cast<std::uint8_t>(row[j] | bit);
    }
}

}  // namespace wedgescope
