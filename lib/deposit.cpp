#include "lib/deposit.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "lib/lanes.hpp"

namespace wedgescope {

State most_telling(std::uint8_t bits) {
    if (bits & bit_seen) return State::seen;
    if (bits & bit_unknown) return State::unknown;
    if (bits & bit_shadow) return State::shadow;
    if (bits & bit_no_data) return State::no_data;
    return State::outside;
}

Quanta quanta(Interval range_bins, double range_bin_m, double radar_constant, double most_pattern2,
              double azimuth_step_rad, double most_gamma) {
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
      begin_(static_cast<double>(quanta.range_bins.begin)), end_(static_cast<double>(quanta.range_bins.end)),
      sums_(rows * columns_ * channels + 1), bits_(rows * columns_) {}

void WedgeCells::put_quantities(const Target& target, std::size_t column, double whole, const double* quantities) {
    for (std::size_t c = 1; c < channels_; ++c) {
        std::int64_t* cell = sums_.data() + (c * rows_ + static_cast<std::size_t>(target.row)) * columns_ + column;
        *cell += std::lrint(whole * target.share[0] * quantities[c - 1]);
        if (target.share[1] > 0) cell[columns_] += std::lrint(whole * target.share[1] * quantities[c - 1]);
    }
}

void WedgeCells::add_cut(const Target& target, const Portion& p, const double* quantities) {
    // Some of it lies in front of the first bin or behind the last one.
    const bool outwards = p.x0 < p.x1;
    const double near = outwards ? p.x0 : p.x1, far = outwards ? p.x1 : p.x0, bow = outwards ? p.bow : -p.bow;
    if (!(far >= begin_) || !(near < end_)) return;  // also NaN
    const auto share = [&](double x) {
        const double u = (x - near) * p.inverse_width;
        return u <= 0 ? 0.0 : u >= 1 ? 1.0 : u + bow * (u * (1 - u));
    };
    double low = std::max(near, begin_), done = near < begin_ ? share(low) : 0;
    const double high = std::min(far, end_);
    for (auto j = static_cast<std::int32_t>(low); low < high || (low == high && done == 0 && low < end_); ++j) {
        const double edge = std::min(high, static_cast<double>(j + 1));
        const double upto = edge == far ? 1.0 : share(edge);
        put(target, j, p.power * (upto - done), quantities);
        done = upto;
        if (edge == high) break;
        low = edge;
    }
}

namespace {

constexpr std::size_t block = 64;
/// Whole numbers by adding 1.5 2^52, as long as they are below 2^51: rounds to nearest even, as lrint does.
constexpr double magic = 6755399441055744.0;
constexpr double most_magic = 0x1p50;

struct Placed {
    double first_power[block], middle_power[block], last_power[block];
    std::int32_t first[block];  // range bin; -1: not this way
    std::int32_t last[block];
    double first_inverse[block], middle_inverse[block], last_inverse[block];
    std::int64_t first_count[block], middle_count[block], last_count[block];
};

/// Where each portion falls, if it is one that lies in at most three bins.
WEDGESCOPE_LANES
void place_portions(std::size_t n, const WedgeCells::Portions& p, double begin, double end, Placed& out) {
    const double* __restrict code = p.code, * __restrict x0 = p.x0, * __restrict x1 = p.x1, * __restrict inverse_width = p.inverse_width, * __restrict power = p.power, * __restrict bow = p.bow;
    const double gamma = p.gamma;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const bool outwards = x0[i] < x1[i];
        const double near = outwards ? x0[i] : x1[i], far = outwards ? x1[i] : x0[i];
        const bool simple = (code[i] == 1) & (far < end) & (near >= begin);
        const auto first = static_cast<std::int32_t>(simple ? near : -1.0),
                   last = static_cast<std::int32_t>(simple ? far : -1.0);
        const double whole = power[i] * gamma, bend = outwards ? bow[i] : -bow[i];
        const double u = (static_cast<double>(first + 1) - near) * inverse_width[i],
                     v = (static_cast<double>(last) - near) * inverse_width[i];
        const double one = whole * (u + bend * (u * (1 - u))), two = whole * (v + bend * (v * (1 - v)));
        const bool alone = first == last;
        out.first_power[i] = alone ? whole : one;
        out.middle_power[i] = alone ? 0.0 : two - one;
        out.last_power[i] = alone ? 0.0 : whole - two;
        out.first[i] = last - first <= 2 ? first : -1;
        out.last[i] = last;
    }
}

WEDGESCOPE_LANES
void count_portions(std::size_t n, const double* __restrict share0, Placed& out) {
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double a = out.first_power[i] * out.first_inverse[i] * share0[i],
                     b = out.middle_power[i] * out.middle_inverse[i] * share0[i],
                     c = out.last_power[i] * out.last_inverse[i] * share0[i];
        const bool small = (a < most_magic) & (b < most_magic) & (c < most_magic);
        out.first_count[i] = std::bit_cast<std::int64_t>(a + magic) - std::bit_cast<std::int64_t>(magic);
        out.middle_count[i] = std::bit_cast<std::int64_t>(b + magic) - std::bit_cast<std::int64_t>(magic);
        out.last_count[i] = std::bit_cast<std::int64_t>(c + magic) - std::bit_cast<std::int64_t>(magic);
        out.first[i] = small ? out.first[i] : -1;
    }
}

}  // namespace

// No pairs of cells in one register: the next spoke's cells overlap them, and a load across two stores waits for both.
__attribute__((optimize("no-tree-slp-vectorize"))) void WedgeCells::add_lanes(std::size_t n, const Portions& p) {
    Placed placed;
    const double* inverse = quanta_.inverse.data();
    const auto base = static_cast<std::int32_t>(first_bin_);
    for (std::size_t at = 0; at < n; at += block) {
        const std::size_t m = std::min(block, n - at);
        const Portions part{p.code + at, p.row + at,           p.share0 + at, p.share1 + at, p.x0 + at,
                            p.x1 + at,   p.inverse_width + at, p.power + at,  p.bow + at,    p.gamma};
        place_portions(m, part, begin_, end_, placed);
        for (std::size_t i = 0; i < m; ++i) {
            const std::int32_t first = placed.first[i] < 0 ? 0 : placed.first[i] - base,
                               last = placed.first[i] < 0 ? 0 : placed.last[i] - base;
            placed.first_inverse[i] = inverse[first];
            placed.middle_inverse[i] = inverse[last > first ? first + 1 : first];
            placed.last_inverse[i] = inverse[last];
        }
        count_portions(m, part.share0, placed);
        // Neighbouring spokes mostly fall into the same cells: one addition for a run of them.
        std::int64_t* cell = sums_.data();
        std::int32_t far = 0;
        std::int64_t first_sum = 0, middle_sum = 0, last_sum = 0;
        for (std::size_t i = 0; i < m; ++i) {
            if (part.code[i] != 1 || part.row[i] < 0) continue;
            const std::int32_t first = placed.first[i], last = placed.last[i];
            if (first < 0) {
                add({part.row[i], {part.share0[i], part.share1[i]}},
                    {part.x0[i], part.x1[i], part.inverse_width[i], part.power[i] * part.gamma, part.bow[i]});
                continue;
            }
            std::int64_t* here = sums_.data() + static_cast<std::size_t>(part.row[i]) * columns_ +
                                 static_cast<std::size_t>(first - base);
            if (here != cell || last - first != far) {
                cell[0] += first_sum;
                cell[1] += middle_sum;  // 0 where it is the last one too
                cell[far] += last_sum;
                first_sum = middle_sum = last_sum = 0;
                cell = here;
                far = last - first;
            }
            first_sum += placed.first_count[i];
            middle_sum += placed.middle_count[i];
            last_sum += placed.last_count[i];
            if (part.share1[i] > 0) {
                here[columns_] += std::lrint(placed.first_power[i] * placed.first_inverse[i] * part.share1[i]);
                if (far > 1)
                    here[columns_ + 1] +=
                        std::lrint(placed.middle_power[i] * placed.middle_inverse[i] * part.share1[i]);
                if (far > 0)
                    here[columns_ + static_cast<std::size_t>(far)] +=
                        std::lrint(placed.last_power[i] * placed.last_inverse[i] * part.share1[i]);
            }
        }
        cell[0] += first_sum;
        cell[1] += middle_sum;
        cell[far] += last_sum;
    }
}

void WedgeCells::mark(const Target& target, double x0, double x1, std::uint8_t bit) {
    const double begin = static_cast<double>(quanta_.range_bins.begin),
                 end = static_cast<double>(quanta_.range_bins.end);
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
