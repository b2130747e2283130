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
        if (q.runs.empty() || q.watts.back() != q.watts[q.watts.size() - 2]) q.runs.push_back({j, j});
        q.runs.back().end = j + 1;
    }
    return q;
}

WedgeCells::WedgeCells(std::size_t rows, const Quanta& quanta, std::size_t channels)
    : quanta_(quanta), rows_(rows), columns_(static_cast<std::size_t>(quanta.range_bins.size())), channels_(channels),
      first_bin_(static_cast<std::size_t>(quanta.range_bins.begin)),
      begin_(static_cast<double>(quanta.range_bins.begin)), end_(static_cast<double>(quanta.range_bins.end)),
      sums_(rows * columns_ * channels + 2), bits_(rows * columns_) {}

void WedgeCells::put_quantities(const Target& target, std::size_t column, double whole, const double* quantities) {
    for (std::size_t c = 1; c < channels_; ++c) {
        std::int64_t* cell = sums_.data() + (c * rows_ + static_cast<std::size_t>(target.row)) * columns_ + column;
        *cell += std::lrint(whole * target.share[0] * quantities[c - 1]);
        if (target.share[1] > 0) cell[columns_] += std::lrint(whole * target.share[1] * quantities[c - 1]);
    }
}

namespace {

/// Of the power up to part u of the way.
WEDGESCOPE_LANES_PART double share_upto(double u, double bow) {
    const double s = u + bow * (u * (1 - u));
    return s < 1 ? s : 1.0;
}

/// A portion as it is met from its near end: what comes back from up to part `u` of the way to the far one, over its power
/// with backscatter 1.
struct FromNear {
    double bow, near_gamma, middle_gamma, far_gamma;
    double near_share, middle_share;  // of the power, up to the borders of the stretches

    WEDGESCOPE_LANES_PART double share(double u) const { return share_upto(u, bow); }
    /// Of the share of the power that lies that far. The stretches telescope: each has what lies between its borders.
    WEDGESCOPE_LANES_PART double returned(double s) const {
        const double near = s < near_share ? s : near_share, upto = s < middle_share ? s : middle_share,
                     middle = upto > near_share ? upto : near_share, far = s > middle_share ? s : middle_share;
        return near_gamma * near + middle_gamma * (middle - near_share) + far_gamma * (far - middle_share);
    }
};

WEDGESCOPE_LANES_PART FromNear from_near(bool outwards, double bow, double first, double second, double third,
                                         double to_second, double to_third) {
    const double to_middle = outwards ? to_second : 1 - to_third, to_far = outwards ? to_third : 1 - to_second;
    FromNear p{outwards ? bow : -bow, outwards ? first : third, second, outwards ? third : first, 0, 0};
    p.near_share = p.share(to_middle);
    p.middle_share = p.share(to_far);
    return p;
}

FromNear from_near(const WedgeCells::Portion& p, const WedgeCells::Stretches& s) {
    return from_near(p.x0 < p.x1, p.bow, s.gamma[0], s.gamma[1], s.gamma[2], s.second, s.third);
}

}  // namespace

void WedgeCells::add(const Target& target, const Portion& p, const Stretches& stretches, const double* quantities) {
    const bool outwards = p.x0 < p.x1;
    const double near = outwards ? p.x0 : p.x1, far = outwards ? p.x1 : p.x0;
    if (!(far < end_) || !(near >= begin_)) return add_cut(target, p, stretches, quantities);
    const FromNear portion = from_near(p, stretches);
    const auto first = static_cast<std::int32_t>(near), last = static_cast<std::int32_t>(far);
    double done = 0;
    for (std::int32_t j = first; j < last; ++j) {
        const double u = (static_cast<double>(j + 1) - near) * p.inverse_width;
        const double upto = p.power * portion.returned(portion.share(u));
        put(target, j, upto - done, quantities);
        done = upto;
    }
    put(target, last, p.power * portion.returned(1) - done, quantities);
}

void WedgeCells::add_cut(const Target& target, const Portion& p, const Stretches& stretches, const double* quantities) {
    // Some of it lies in front of the first bin or behind the last one.
    const bool outwards = p.x0 < p.x1;
    const double near = outwards ? p.x0 : p.x1, far = outwards ? p.x1 : p.x0;
    if (!(far >= begin_) || !(near < end_)) return;  // also NaN
    const FromNear portion = from_near(p, stretches);
    const auto returned = [&](double x) {
        const double u = (x - near) * p.inverse_width;
        return portion.returned(x == far || u >= 1 ? 1.0 : u <= 0 ? 0.0 : portion.share(u));
    };
    double low = std::max(near, begin_), done = near < begin_ ? returned(low) : 0;
    const double high = std::min(far, end_);
    for (auto j = static_cast<std::int32_t>(low); low < high; ++j) {
        const double edge = std::min(high, static_cast<double>(j + 1)), upto = returned(edge);
        put(target, j, p.power * (upto - done), quantities);
        done = upto;
        if (edge == high) break;
        low = edge;
    }
}

namespace {

constexpr std::size_t block = WedgeCells::Portions::most;
/// Whole numbers by adding 1.5 2^52, as long as they are below 2^51: rounds to nearest even, as lrint does.
constexpr double magic = 6755399441055744.0;
constexpr double most_magic = 0x1p50;

/// Portions that lie in at most three neighbouring bins, with the power in each; the others are `slow`.
struct Placed {
    double one[block], two[block], three[block];  // W per radian
    std::int64_t counts[3][block];                // quanta; 0 where there is nothing to add
    std::int32_t first[block];                    // range bin, any inside [begin, end) where there is nothing to add
    std::int32_t slow[block];
};

/// [begin, end): the range bins that all have the quantum 1 / inverse. `stretched`: there may be more than one backscatter.
template <bool stretched>
WEDGESCOPE_LANES_PART void place_portions(std::size_t n, const WedgeCells::Portions& p, double begin, double end,
                                          double inverse, Placed& out) noexcept {
    const double* __restrict x0 = p.x0, * __restrict x1 = p.x1, * __restrict inverse_width = p.inverse_width, * __restrict power = p.power, * __restrict bow = p.bow, * __restrict share = p.share0;
    [[maybe_unused]] const double* __restrict first_gamma = p.gamma[0], * __restrict second_gamma = p.gamma[1], * __restrict to_second = p.second, * __restrict to_third = p.third;
    const double* __restrict third_gamma = p.gamma[2];
    double* __restrict one = out.one, * __restrict two = out.two, * __restrict three = out.three;
    std::int64_t* __restrict count0 = out.counts[0], * __restrict count1 = out.counts[1], * __restrict count2 = out.counts[2];
    std::int32_t* __restrict first_bin = out.first, * __restrict slow = out.slow;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const bool outwards = x0[i] < x1[i];
        const double near = outwards ? x0[i] : x1[i], far = outwards ? x1[i] : x0[i];
        const double wanted = third_gamma[i] >= 0 ? 1.0 : 0.0,
                     fits = far < end ? near >= begin ? wanted : 0.0 : 0.0;
        const auto first = static_cast<std::int32_t>(fits > 0 ? near : begin),
                   last = static_cast<std::int32_t>(fits > 0 ? far : begin);
        const double from = static_cast<double>(first), bins = static_cast<double>(last) - from;
        const double u = (from + 1 - near) * inverse_width[i], v = (from + 2 - near) * inverse_width[i];
        double upto_one, upto_two, whole;
        if constexpr (stretched) {
            const FromNear portion =
                from_near(outwards, bow[i], first_gamma[i], second_gamma[i], third_gamma[i], to_second[i], to_third[i]);
            upto_one = power[i] * portion.returned(portion.share(u));
            upto_two = power[i] * portion.returned(portion.share(v));
            whole = power[i] * portion.returned(1);
        } else {
            const double bend = outwards ? bow[i] : -bow[i];
            upto_one = power[i] * (third_gamma[i] * share_upto(u, bend));
            upto_two = power[i] * (third_gamma[i] * share_upto(v, bend));
            whole = power[i] * third_gamma[i];
        }
        const double a = bins > 0 ? upto_one : whole, b = bins > 1 ? upto_two : whole;
        const double second = b - a, third = whole - b;  // 0 where there is no such bin
        const double k0 = a * inverse * share[i], k1 = second * inverse * share[i], k2 = third * inverse * share[i];
        const double small = whole * inverse * share[i] < most_magic ? 1.0 : 0.0;
        const double good = bins < 3 ? fits * small : 0.0;
        one[i] = a;
        two[i] = second;
        three[i] = third;
        count0[i] = std::bit_cast<std::int64_t>((good > 0 ? k0 : 0.0) + magic) - std::bit_cast<std::int64_t>(magic);
        count1[i] = std::bit_cast<std::int64_t>((good > 0 ? k1 : 0.0) + magic) - std::bit_cast<std::int64_t>(magic);
        count2[i] = std::bit_cast<std::int64_t>((good > 0 ? k2 : 0.0) + magic) - std::bit_cast<std::int64_t>(magic);
        first_bin[i] = first;
        slow[i] = wanted > good ? 1 : 0;
    }
}

}  // namespace

// No pairs of cells in one register: the next spoke's cells overlap them, and a load across two stores waits for both.
__attribute__((optimize("no-tree-slp-vectorize"))) void WedgeCells::add_lanes(std::size_t n, const Portions& p) {
    // Bins with the quantum of the first portion: most blocks of lanes lie in them.
    Placed placed;
    std::size_t some = 0;
    while (some < n && !(p.x0[some] >= begin_ && p.x0[some] < end_)) ++some;
    Interval same{quanta_.range_bins.begin, quanta_.range_bins.begin};
    double inverse = 0;
    if (some < n) {
        const auto bin = static_cast<std::int64_t>(p.x0[some]);
        same = *std::upper_bound(quanta_.runs.begin(), quanta_.runs.end(), bin,
                                 [](std::int64_t b, const Interval& run) { return b < run.end; });
        inverse = quanta_.inverse[static_cast<std::size_t>(bin) - first_bin_];
    }
    const auto begin = static_cast<double>(same.begin), end = static_cast<double>(same.end);
    if (p.second)
        on_target<place_portions<true>>(n, p, begin, end, inverse, placed);
    else
        on_target<place_portions<false>>(n, p, begin, end, inverse, placed);
    std::int64_t* const sums = sums_.data();
    const auto put_one = [&](std::size_t i) {
        std::int64_t* cell = sums + (p.origin[i] + placed.first[i]);
        cell[0] += placed.counts[0][i];
        cell[1] += placed.counts[1][i];
        cell[2] += placed.counts[2][i];
    };
    // Neighbours mostly fall into the same cells and would wait for one another: four runs side by side.
    std::size_t i = 0;
    const std::size_t quarter = n / 4;
    for (; i < quarter; ++i) {
        put_one(i);
        put_one(i + quarter);
        put_one(i + 2 * quarter);
        put_one(i + 3 * quarter);
    }
    for (i = 4 * quarter; i < n; ++i) put_one(i);
    for (const std::int32_t lane : p.straddlers) {
        i = static_cast<std::size_t>(lane);
        if (placed.slow[i] || p.gamma[2][i] < 0) continue;
        std::int64_t* cell = sums + (p.origin[i] + placed.first[i]) + static_cast<std::ptrdiff_t>(columns_);
        cell[0] += std::lrint(placed.one[i] * inverse * p.share1[i]);
        cell[1] += std::lrint(placed.two[i] * inverse * p.share1[i]);
        cell[2] += std::lrint(placed.three[i] * inverse * p.share1[i]);
    }
    int slow = 0;
    for (i = 0; i < n; ++i) slow += placed.slow[i];
    for (i = 0; slow && i < n; ++i)
        if (placed.slow[i] && p.share0[i] > 0)
            add({row_of(p.origin[i]), {p.share0[i], p.share1[i]}},
                {p.x0[i], p.x1[i], p.inverse_width[i], p.power[i], p.bow[i]},
                p.second ? Stretches{{p.gamma[0][i], p.gamma[1][i], p.gamma[2][i]}, p.second[i], p.third[i]}
                         : Stretches::one(p.gamma[2][i]));
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
