#include "lib/deposit.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "lib/lanes.hpp"

namespace wedgescope {

Quanta quanta(Interval range_bins, double range_bin_m, double radar_constant, double most_pattern2,
              double azimuth_step_rad, double most_gamma, const NearestGround& below) {
    Quanta q;
    q.range_bins = range_bins;
    q.watts.reserve(static_cast<std::size_t>(range_bins.size()));
    q.inverse.reserve(q.watts.capacity());
    const double beyond_m = std::clamp(below.reach_m, 1.0, below.range_m);
    for (std::int64_t j = range_bins.begin; j < range_bins.end; ++j) {
        const double edge_m = static_cast<double>(j) * range_bin_m,
                     near_m = std::max(edge_m, edge_m + range_bin_m <= below.reach_m ? below.range_m : beyond_m);
        const double most = radar_constant * most_pattern2 * 2 * azimuth_step_rad * most_gamma / (near_m * near_m);
        int exponent = 0;  // nothing returns anything
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

WedgeCells::WedgeCells(std::size_t rows, const Quanta& quanta, std::size_t channels, Halves halves)
    : quanta_(quanta), rows_(rows), columns_(static_cast<std::size_t>(quanta.range_bins.size())), channels_(channels),
      first_bin_(static_cast<std::size_t>(quanta.range_bins.begin)), halves_(halves),
      sums_(all_rows() * columns_ * channels + 2), bits_(rows * columns_), marked_(rows * bit_count) {}

void WedgeCells::put_quantities(const Target& target, std::size_t column, double whole, const double* quantities) {
    for (std::size_t c = 1; c < channels_; ++c) {
        std::int64_t* cell = sums_.data() + (c * all_rows() + static_cast<std::size_t>(target.row)) * columns_ + column;
        *cell += std::lrint(whole * target.share[0] * quantities[c - 1]);
        if (target.share[1] > 0) cell[columns_] += std::lrint(whole * target.share[1] * quantities[c - 1]);
    }
}

namespace {

/// Of the power up to part u of the way.
template <class Real>
WEDGESCOPE_LANES_PART Real share_upto(Real u, Real bow) {
    const Real s = u + bow * (u * (1 - u));
    return s < 1 ? s : Real(1);
}

template <class Real>
WEDGESCOPE_LANES_PART Real inverse_of(Real way) {
    constexpr auto least = static_cast<Real>(1e-9F);
    return 1 / (way > least ? way : least);
}

/// A portion as it is met from its near end: what comes back from up to part `u` of the way to the far one, over its power
/// with backscatter 1. In floats over a few bins; over many, what falls into one is too little beside what did before.
template <class Real>
struct FromNear {
    Real bow, near_gamma, middle_gamma, far_gamma;
    Real near_share, middle_share;  // of the power, up to the borders of the stretches

    WEDGESCOPE_LANES_PART Real share(Real u) const { return share_upto(u, bow); }
    /// Of the share of the power that lies that far. The stretches telescope: each has what lies between its borders.
    WEDGESCOPE_LANES_PART Real returned(Real s) const {
        const Real near = s < near_share ? s : near_share, upto = s < middle_share ? s : middle_share,
                   middle = upto > near_share ? upto : near_share, far = s > middle_share ? s : middle_share;
        return near_gamma * near + middle_gamma * (middle - near_share) + far_gamma * (far - middle_share);
    }
};

template <class Real>
WEDGESCOPE_LANES_PART FromNear<Real> from_near(bool outwards, Real bow, Real first, Real second, Real third,
                                               Real to_second, Real to_third) {
    const Real to_middle = outwards ? to_second : 1 - to_third, to_far = outwards ? to_third : 1 - to_second;
    FromNear<Real> p{outwards ? bow : -bow, outwards ? first : third, second, outwards ? third : first, 0, 0};
    p.near_share = p.share(to_middle);
    p.middle_share = p.share(to_far);
    return p;
}

/// The bin in which it lies; 0 if it lies before that.
WEDGESCOPE_LANES_PART std::int32_t bin_of(double x) {
    const double above = x > 0 ? x : 0.0;
    return static_cast<std::int32_t>(above < 1e9 ? above : 0.0);
}

/// How far behind its near edge; never in the next bin.
WEDGESCOPE_LANES_PART float begin_in(std::int32_t bin, double x) {
    const auto begin = static_cast<float>(x - static_cast<double>(bin));
    return begin < 1 ? begin : 0x1.fffffep-1F;
}

}  // namespace

/// Where a portion lies. From `bin` on floats do.
struct WedgeCells::Placing {
    std::int32_t bin;  // of its near end
    float begin, way;  // from the bin's near edge to the portion's near end; from x0 to x1
    float bow;         // as Portion
    Placing(std::int32_t bin_at, float begin_at, float way_to, float bow_of)
        : bin(bin_at), begin(begin_at), way(way_to), bow(bow_of) {}
    Placing(double x0, double x1, double bow_of)
        : bin(bin_of(x0 < x1 ? x0 : x1)), begin(begin_in(bin, x0 < x1 ? x0 : x1)),
          way(static_cast<float>(x1 - x0)), bow(static_cast<float>(bow_of)) {}
    float length() const { return way < 0 ? -way : way; }
    template <class Real>
    FromNear<Real> from_near(const Stretches& s) const {
        return wedgescope::from_near<Real>(way > 0, static_cast<Real>(bow), static_cast<Real>(s.gamma[0]),
                                           static_cast<Real>(s.gamma[1]), static_cast<Real>(s.gamma[2]),
                                           static_cast<Real>(s.second), static_cast<Real>(s.third));
    }
};

void WedgeCells::add(const Target& target, const Portion& p, const Stretches& stretches, const double* quantities) {
    add_placed(target, {p.x0, p.x1, p.bow}, p.power, stretches, quantities);
}

void WedgeCells::add_placed(const Target& target, const Placing& p, double power, const Stretches& stretches,
                            const double* quantities) {
    const float reach = p.begin + p.length();
    if (!(p.begin >= 0 && reach < 1e9F)) return add_cut(target, p, power, stretches, quantities);
    const auto bins = static_cast<std::int32_t>(reach);
    // As many as lanes take.
    bins < 3 ? spread<float>(target, p, bins, power, stretches, quantities)
             : spread<double>(target, p, bins, power, stretches, quantities);
}

template <class Real>
void WedgeCells::spread(const Target& target, const Placing& p, std::int32_t bins, double power,
                        const Stretches& stretches, const double* quantities) {
    // Of its bins, counted from that of its near end, those that there are. What one of them takes does not hang on the others.
    const std::int64_t begin_bin = quanta_.range_bins.begin - p.bin, end_bin = quanta_.range_bins.end - p.bin;
    if (begin_bin > bins || end_bin <= 0) return;
    const auto first = static_cast<std::int32_t>(std::max<std::int64_t>(begin_bin, 0)),
               last = static_cast<std::int32_t>(std::min<std::int64_t>(end_bin - 1, bins));
    const FromNear<Real> portion = p.from_near<Real>(stretches);
    const Real begin = p.begin, inverse = inverse_of(static_cast<Real>(p.length()));
    const auto upto = [&](std::int32_t k) {  // the far edge of bin k
        return portion.returned(k < bins ? portion.share((static_cast<Real>(k + 1) - begin) * inverse) : Real(1));
    };
    Real done = first > 0 ? upto(first - 1) : Real(0);
    for (std::int32_t k = first; k <= last; ++k) {
        const Real all = upto(k);
        put(target, p.bin + k, power, static_cast<double>(all - done), quantities);
        done = all;
    }
}

void WedgeCells::add_cut(const Target& target, const Placing& p, double power, const Stretches& stretches,
                         const double* quantities) {
    // It begins before range 0 or reaches where no bins are. In bins from that of its near end.
    const double first = p.begin, length = p.length(), far = first + length,
                 begin = static_cast<double>(quanta_.range_bins.begin - p.bin),
                 end = static_cast<double>(quanta_.range_bins.end - p.bin);
    if (!(far >= begin) || !(first < end)) return;  // also NaN
    const FromNear<double> portion = p.from_near<double>(stretches);
    const double inverse = inverse_of(length);
    const auto returned = [&](double x) {
        const double u = (x - first) * inverse;
        return portion.returned(x == far || u >= 1 ? 1.0 : u <= 0 ? 0.0 : portion.share(u));
    };
    double low = std::max(first, begin), done = first < begin ? returned(low) : 0;
    const double high = std::min(far, end);
    for (auto j = static_cast<std::int32_t>(low); low < high; ++j) {
        const double edge = std::min(high, static_cast<double>(j + 1)), upto = returned(edge);
        put(target, p.bin + j, power, upto - done, quantities);
        done = upto;
        if (edge == high) break;
        low = edge;
    }
}

namespace {

constexpr std::size_t block = whole_registers(WedgeCells::Portions::most);
static_assert(block == WedgeCells::Portions::most, "lanes are written whole");
/// Whole numbers by adding 1.5 2^52, as long as they are below 2^51: rounds to nearest even, as lrint does.
constexpr double rounding_bias = 0x1.8p52;
constexpr float most_rounded = 0x1p50F;

/// Portions that lie in at most three neighbouring bins, with what falls into each; the others are `slow`.
struct Placed {
    double scale[block];  // quanta of the power
    float begin[block], way[block];
    float rough_scale[block];  // the same as a float
    std::int32_t bin[block];
    float shares[3][block];         // of the power, with backscatter; 0 where there is nothing to add
    std::int64_t counts[3][block];  // quanta
    std::int32_t first[block];      // range bin, any inside [begin, end) where there is nothing to add
    std::int32_t slow[block];
};

/// Two neighbouring runs of range bins, [begin, border) and [border, end), that have the quanta 1 / near and 1 / far.
struct TwoRuns {
    std::int32_t begin = 0, border = 0, end = 0;
    double near = 0, far = 0;
    WEDGESCOPE_LANES_PART double inverse(std::int32_t bin) const { return bin < border ? near : far; }
};

/// Of portions that lie in the bins of one of the runs, what falls into each. `stretched`: there may be more than one backscatter.
template <bool stretched>
WEDGESCOPE_LANES_PART void place_portions(std::size_t n, const WedgeCells::Portions& p, const TwoRuns& runs,
                                          Placed& out) noexcept {
    const TwoRuns r = runs;
    double* __restrict scale = out.scale;
    float* __restrict begins = out.begin, * __restrict ways = out.way, * __restrict rough = out.rough_scale;
    std::int32_t* __restrict bin_of_near = out.bin;
    {
        const double* __restrict x0 = p.x0, * __restrict x1 = p.x1, * __restrict power = p.power, * __restrict share = p.share0;
        const double bins = p.bins;
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < n; ++i) {
            const double a = x0[i] * bins, b = x1[i] * bins, near = a < b ? a : b;
            const std::int32_t bin = bin_of(near);
            bin_of_near[i] = bin;
            begins[i] = begin_in(bin, near);
            ways[i] = static_cast<float>(b - a);
            const double whole = power[i] * r.inverse(bin) * share[i];
            scale[i] = whole;
            rough[i] = static_cast<float>(whole);
        }
    }
    {
        const float* __restrict bow = p.bow, * __restrict third_gamma = p.gamma[2];
        [[maybe_unused]] const float* __restrict first_gamma = p.gamma[0], * __restrict second_gamma = p.gamma[1], * __restrict to_second = p.second, * __restrict to_third = p.third;
        float* __restrict one = out.shares[0], * __restrict two = out.shares[1], * __restrict three = out.shares[2];
        std::int32_t* __restrict first = out.first, * __restrict slow = out.slow;
        // Truths as 0 and 1, so that every compiler makes lanes of them.
        const auto truth = [](bool b) { return b ? 1.0F : 0.0F; };
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < n; ++i) {
            const float way = ways[i], length = way < 0 ? -way : way, far = begins[i] + length;
            const bool outwards = way > 0;
            const float reach = far > 0 ? far : 0.0F;
            const auto bins = static_cast<std::int32_t>(reach < 3 ? reach : 3.0F);
            const std::int32_t bin = bin_of_near[i], last = bin + bins;
            const float wanted = truth(third_gamma[i] >= 0), in_one = truth(bin >= r.border) + truth(last < r.border),
                        fits = wanted * in_one * truth(begins[i] >= 0) * truth(bin >= r.begin) * truth(last < r.end);
            const float width = inverse_of(length), u = (1 - begins[i]) * width, v = (2 - begins[i]) * width;
            float upto_one, upto_two, whole;
            if constexpr (stretched) {
                const auto portion = from_near<float>(outwards, bow[i], first_gamma[i], second_gamma[i], third_gamma[i],
                                                      to_second[i], to_third[i]);
                upto_one = portion.returned(portion.share(u));
                upto_two = portion.returned(portion.share(v));
                whole = portion.returned(1);
            } else {
                const float bend = outwards ? bow[i] : -bow[i];
                upto_one = third_gamma[i] * share_upto(u, bend);
                upto_two = third_gamma[i] * share_upto(v, bend);
                whole = third_gamma[i];
            }
            const float a = bins > 0 ? upto_one : whole, b = bins > 1 ? upto_two : whole;
            const float good = fits * truth(bins < 3) * truth(whole * rough[i] < most_rounded);
            one[i] = good > 0 ? a : 0.0F;
            two[i] = good > 0 ? b - a : 0.0F;  // 0 where there is no such bin
            three[i] = good > 0 ? whole - b : 0.0F;
            first[i] = fits > 0 ? bin : r.begin;
            slow[i] = wanted > good ? 1 : 0;
        }
    }
    for (std::size_t k = 0; k < 3; ++k) {
        const float* __restrict shares = out.shares[k];
        std::int64_t* __restrict counts = out.counts[k];
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < n; ++i)
            counts[i] = std::bit_cast<std::int64_t>(static_cast<double>(shares[i]) * scale[i] + rounding_bias) -
                        std::bit_cast<std::int64_t>(rounding_bias);
    }
}

/// From that of the nearer of the outer two portions on, or of the first that has a bin; without bins if none does. Portions are
/// of neighbouring spokes and few lines: mostly no other run is met.
TwoRuns runs_of(const Quanta& quanta, std::size_t n, const WedgeCells::Portions& p) {
    const Interval all = quanta.range_bins;
    const auto has_bin = [&](double x) {
        return x >= static_cast<double>(all.begin) && x < static_cast<double>(all.end);
    };
    const auto near = [&](std::size_t i) { return std::min(p.x0[i], p.x1[i]); };
    double least = std::min(near(0), near(n - 1)) * p.bins;
    for (std::size_t i = 0; i < n && !has_bin(least); ++i) least = near(i) * p.bins;
    if (!has_bin(least)) {
        const auto none = static_cast<std::int32_t>(all.begin);
        return {none, none, none, 0, 0};
    }
    const auto run = std::upper_bound(quanta.runs.begin(), quanta.runs.end(), static_cast<std::int64_t>(least),
                                      [](std::int64_t b, const Interval& r) { return b < r.end; });
    const auto next = std::next(run) < quanta.runs.end() ? std::next(run) : run;
    const auto inverse = [&](const Interval& bins) {
        return quanta.inverse[static_cast<std::size_t>(bins.begin) - static_cast<std::size_t>(all.begin)];
    };
    return {static_cast<std::int32_t>(run->begin), static_cast<std::int32_t>(run->end),
            static_cast<std::int32_t>(next->end), inverse(*run), inverse(*next)};
}

}  // namespace

// No pairs of cells in one register: the next spoke's cells overlap them, and a load across two stores waits for both.
__attribute__((optimize("no-tree-slp-vectorize"))) void WedgeCells::add_lanes(std::size_t n, const Portions& p) {
    Placed placed;
    const TwoRuns runs = runs_of(quanta_, n, p);
    if (p.second)
        on_target<place_portions<true>>(whole_registers(n), p, runs, placed);
    else
        on_target<place_portions<false>>(whole_registers(n), p, runs, placed);
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
        const double scale = p.power[i] * runs.inverse(placed.bin[i]) * p.share1[i];
        std::int64_t* cell = sums + (p.origin[i] + placed.first[i]) + static_cast<std::ptrdiff_t>(columns_);
        for (std::size_t k = 0; k < 3; ++k) cell[k] += std::lrint(static_cast<double>(placed.shares[k][i]) * scale);
    }
    int slow = 0;
    for (i = 0; i < n; ++i) slow += placed.slow[i];
    for (i = 0; slow && i < n; ++i)
        if (placed.slow[i] && p.share0[i] > 0)
            add_placed({row_of_origin(p.origin[i]), {p.share0[i], p.share1[i]}},
                       {placed.bin[i], placed.begin[i], placed.way[i], p.bow[i]}, p.power[i],
                       p.second ? Stretches{{p.gamma[0][i], p.gamma[1][i], p.gamma[2][i]}, p.second[i], p.third[i]}
                                : Stretches::one(static_cast<double>(p.gamma[2][i])),
                       nullptr);
}

namespace {

/// Adds a bit to each of n bytes; to some of them twice, so that no rest is left to go through one by one.
void add_bit(std::uint8_t* bytes, std::size_t n, std::uint8_t bit) {
    const auto to = [&]<class Some>(std::size_t at, Some) {
        Some some;
        std::memcpy(&some, bytes + at, sizeof some);
        some |= static_cast<Some>(static_cast<Some>(~Some{0}) / 255 * bit);
        std::memcpy(bytes + at, &some, sizeof some);
    };
    const auto all = [&](auto some) {
        const std::size_t last = n - sizeof some;
        for (std::size_t at = 0; at < last; at += sizeof some) to(at, some);
        to(last, some);
    };
    if (n >= sizeof(std::uint64_t)) return all(std::uint64_t{});
    if (n >= sizeof(std::uint32_t)) return all(std::uint32_t{});
    for (std::size_t at = 0; at < n; ++at) bytes[at] = static_cast<std::uint8_t>(bytes[at] | bit);
}

}  // namespace

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
        const std::size_t row = static_cast<std::size_t>(target.row) % rows_ + side;
        std::uint8_t* const bits = bits_.data() + row * columns_;
        const auto add = [bits, bit](std::size_t from, std::size_t to) {
            if (from < to) add_bit(bits + from, to - from, bit);
        };
        Marked& marked = marked_[row * bit_count + static_cast<std::size_t>(std::countr_zero(bit))];
        if (first > marked.end || last + 1 < marked.begin) {
            add(first, last + 1);
            if (last + 1 - first > marked.end - marked.begin) marked = {first, last + 1};
            continue;
        }
        add(first, marked.begin);
        add(marked.end, last + 1);
        marked = {std::min(first, marked.begin), std::max(last + 1, marked.end)};
    }
}

namespace {

WEDGESCOPE_LANES_PART void whole_watts(std::size_t n, const std::int64_t* __restrict sums,
                                       const double* __restrict quantum, float* __restrict watts) noexcept {
    for (std::size_t j = 0; j < n; ++j) watts[j] = static_cast<float>(static_cast<double>(sums[j]) * quantum[j]);
}

WEDGESCOPE_LANES_PART void whole_watts_of_halves(std::size_t n, const std::int64_t* __restrict even,
                                                 const std::int64_t* __restrict odd, const double* __restrict quantum,
                                                 float* __restrict watts) noexcept {
    for (std::size_t j = 0; j < n; ++j)
        watts[j] = static_cast<float>(static_cast<double>(even[j] + odd[j]) * quantum[j]);
}

WEDGESCOPE_LANES_PART void most_telling_states(std::size_t n, const std::uint8_t* __restrict bits,
                                               std::uint8_t* __restrict states) noexcept {
    for (std::size_t j = 0; j < n; ++j) {
        const std::uint8_t b = bits[j];
        const State hidden = b & bit_no_data ? State::no_data : State::outside,
                    dark = b & bit_shadow ? State::shadow : hidden, doubtful = b & bit_unknown ? State::unknown : dark;
        states[j] = static_cast<std::uint8_t>(b & bit_seen ? State::seen : doubtful);
    }
}

}  // namespace

void WedgeCells::finish(std::size_t row, float* watts, std::uint8_t* states) const {
    const std::int64_t* const sums = sums_.data() + row * columns_;
    if (apart())
        on_target<whole_watts_of_halves>(columns_, sums, sums + rows_ * columns_, quanta_.watts.data(), watts);
    else
        on_target<whole_watts>(columns_, sums, quanta_.watts.data(), watts);
    on_target<most_telling_states>(columns_, bits_.data() + row * columns_, states);
}

void WedgeCells::halves(std::size_t row, float* even, float* odd) const {
    const std::int64_t* const sums = sums_.data() + row * columns_;
    on_target<whole_watts>(columns_, sums, quanta_.watts.data(), even);
    on_target<whole_watts>(columns_, sums + (all_rows() - rows_) * columns_, quanta_.watts.data(), odd);
}

void WedgeCells::clear(Interval rows) {
    const auto first = static_cast<std::size_t>(rows.begin), count = static_cast<std::size_t>(rows.size());
    for (std::size_t half = 0; half < all_rows() * channels_; half += rows_)
        std::fill_n(sums_.begin() + static_cast<std::ptrdiff_t>((half + first) * columns_), count * columns_, 0);
    std::fill_n(bits_.begin() + static_cast<std::ptrdiff_t>(first * columns_), count * columns_, std::uint8_t{0});
    std::fill_n(marked_.begin() + static_cast<std::ptrdiff_t>(first * bit_count), count * bit_count, Marked{});
}

}  // namespace wedgescope
