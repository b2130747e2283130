#include "lib/shade.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

#include "lib/lanes.hpp"

namespace wedgescope {
namespace {

/// Linear in dB between the points, 0 beyond them.
double pattern_of_points(const std::vector<PatternPoint>& points, double beta_rad) {
    const auto beyond = [](double beta, const PatternPoint& point) { return beta < point.depression.rad(); };
    const auto after = std::upper_bound(points.begin(), points.end(), beta_rad, beyond);
    if (after == points.begin()) return 0;
    const PatternPoint& before = after[-1];
    if (after == points.end()) return beta_rad > before.depression.rad() ? 0 : before.gain.ratio();
    const double part = (beta_rad - before.depression.rad()) / (after->depression.rad() - before.depression.rad());
    return Decibel(before.gain.db() + part * (after->gain.db() - before.gain.db())).ratio();
}

/// The mean of a pattern between two sines over its value in the middle, from how much of that it changes from there to
/// either end: that of sine^-4, which it is where it is shaped to give all ground the same echo. With as much as a half of
/// the sine between both ends, more than all but towers take up, it is off by 3 %.
template <class Real>
constexpr Real over_middle(Real swell) {
    constexpr auto bend = static_cast<Real>(5.0 / 24);  // k (k + 1) / 24 / (k / 2)^2 for sine^-k
    const Real square = swell * swell;
    return 1 + bend * (square < 1 ? square : Real{1});
}

/// The mean of a pattern times range^-2 between two sines over the product of both means' middles, beside over_middle(): what
/// range^-2 bends, and what it does together with the pattern. The inverse of the range goes with the sine, as along any straight
/// surface; `nearer` is how much of range^-2 changes from its middle to the end, `swell` of the pattern.
template <class Real>
constexpr Real over_middles(Real nearer, Real swell) {
    constexpr auto most = static_cast<Real>(0.25);
    const Real swells = swell < -1  ? Real{-1}
                        : swell > 1 ? Real{1}
                                    : swell,
               more = nearer * (nearer + 4 * swells) * static_cast<Real>(1.0 / 12);
    return 1 + (more < -most ? -most : more > most ? most : more);
}

/// A pattern in the middle of a piece, and how much of that it changes from there to either end.
struct MiddleGain {
    double gain, swell;
};
MiddleGain middle_gain(double sine0, double sine1, const PatternTable& pattern) {
    const double middle = 0.5 * (sine0 + sine1), gain = pattern.at(middle);
    return {gain, 0.5 * (sine1 - sine0) * pattern.slope(middle) / gain};
}
double mean_gain(double sine0, double sine1, const PatternTable& pattern) {
    const MiddleGain middle = middle_gain(sine0, sine1, pattern);
    return middle.gain * over_middle(middle.swell);
}

}  // namespace

double elevation_pattern(const AntennaParams& antenna, double depression_rad) {
    const double beta = depression_rad - antenna.tilt.rad(), knee = antenna.knee.rad(), floor = antenna.floor.ratio();
    double g = 0;
    if (antenna.elevation == ElevationPattern::points) {
        g = pattern_of_points(antenna.points, beta);
    } else if (antenna.elevation == ElevationPattern::gaussian || beta <= knee) {
        const double x = (beta - knee) / antenna.width.rad();
        g = std::exp(-4 * std::numbers::ln2 * x * x);
    } else {
        const double p = antenna.elevation == ElevationPattern::csc2 ? 0 : antenna.exponent;
        const double ratio = std::sin(knee) / std::sin(beta);
        if (std::sin(beta) > 0 && std::cos(beta) > 0)
            g = ratio * ratio * (p == 0 ? 1 : std::pow(std::cos(beta) / std::cos(knee), p));
    }
    return std::max(g, floor);
}

PatternTable::PatternTable(const AntennaParams& antenna) {
    const auto exact = [&](double sine) {
        const double g = elevation_pattern(antenna, -std::asin(sine));
        return g * g;
    };
    const double least = 100 * std::pow(antenna.floor.ratio(), 2);
    // Where a pattern of points bends, and where it drops to the floor.
    std::vector<double> bends;
    std::size_t drops = 0;
    const bool of_points = antenna.elevation == ElevationPattern::points;
    if (of_points)
        for (const PatternPoint& point : antenna.points) {
            const double depression = point.depression.rad() + antenna.tilt.rad();
            if (std::abs(depression) > std::numbers::pi / 2) continue;
            const bool end = &point == &antenna.points.front() || &point == &antenna.points.back();
            if (end && point.gain.db() > antenna.floor.db() && drops < drops_.size())
                drops_[drops++].sine = -std::sin(depression);
            else
                bends.push_back(-std::sin(depression));
        }
    // A shaped pattern of an antenna that looks up drops to the floor 90 degrees below its axis, or goes there all but upright.
    const bool shaped = antenna.elevation == ElevationPattern::csc2 || antenna.elevation == ElevationPattern::cos_csc2;
    if (shaped && antenna.tilt.rad() < 0) drops_[0].sine = -std::cos(antenna.tilt.rad());
    // A sharp bend between two steep slopes takes finer entries than the shaped patterns do.
    const int most_intervals = of_points ? 1 << 20 : 1 << 17;
    for (intervals_ = 4096;; intervals_ *= 2) {
        values_.resize(static_cast<std::size_t>(intervals_) + 2);
        most_ = 0;
        for (std::size_t i = 0; i < values_.size(); ++i) {
            // Never 0: power_lanes divides by it.
            values_[i] =
                std::max(static_cast<float>(exact(std::min(1.0, -1 + 2 * static_cast<double>(i) / intervals_))),
                         std::numeric_limits<float>::min());
            most_ = std::max(most_, static_cast<double>(values_[i]));
        }
        error_ = 0;
        const auto look_at = [&](double t) {
            for (const PatternDrop& drop : drops_)
                if (std::abs(t - drop.sine) < 2.0 / intervals_) return;
            const double truth = exact(t);
            if (truth > least && std::abs(t) < 0.9986) error_ = std::max(error_, std::abs(at(t) / truth - 1));
        };
        for (int i = 0; i < intervals_; ++i) look_at(-1 + (2 * i + 1.0) / intervals_);
        for (const double t : bends) look_at(t);
        if (error_ <= 0.0005 || intervals_ >= most_intervals) break;
    }
    for (PatternDrop& drop : drops_)
        if (drop.sine < 1) {
            // An entry as good as at the drop is on neither side of it.
            const double x = (drop.sine + 1) * (0.5 * intervals_), slack = 1e-6;
            drop.low = std::max(-1.0, -1 + 2 * std::floor(x - slack) / intervals_);
            drop.high = std::min(1.0, -1 + 2 * std::ceil(x + slack) / intervals_);
        }
    find_lobe();
}

void PatternTable::find_lobe() {
    constexpr double too_long = 0.03, short_enough = 0.005;  // of the mean, or of most() by these:
    constexpr double dark_below = 1e-6, dark_above = 1e-3;   // ground above the horizon is far
    constexpr double shrink = 0.75, least_part = 1e-4;
    constexpr std::size_t buckets = 4096, ends_of_bucket = 16;
    const double interval = 2.0 / intervals_;
    const auto sine_of = [&](std::size_t entry) { return -1 + static_cast<double>(entry) * interval; };
    std::vector<double> upto(values_.size(), 0);  // the table's integral, in intervals
    for (std::size_t i = 1; i < values_.size(); ++i)
        upto[i] = upto[i - 1] + 0.5 * (static_cast<double>(values_[i - 1]) + static_cast<double>(values_[i]));
    const auto begin_of = [&](std::size_t end, double part) {
        const double length = std::floor(part * (std::abs(sine_of(end)) + most_sine_offset) / interval);
        return end - std::min(end, static_cast<std::size_t>(length));
    };
    // How far off a piece of whole intervals is, as long as that part, whose mean is taken as power_lanes() does.
    const auto error = [&](std::size_t end, double part) {
        const double sine1 = sine_of(end);
        std::size_t begin = begin_of(end, part);
        for (const PatternDrop& drop : drops_)  // pieces are cut there
            if (sine1 > drop.low && sine_of(begin) < drop.high)
                begin = std::min(end, static_cast<std::size_t>(std::ceil((drop.high + 1) / interval)));
        if (end - begin < 2) return 0.0;
        const double sine0 = sine_of(begin);
        const double mean = (upto[end] - upto[begin]) / static_cast<double>(end - begin),
                     dark = sine1 > 0 ? dark_above : dark_below;
        return std::abs(mean_gain(sine0, sine1, *this) - mean) / std::max(mean, dark * most_);
    };
    const auto entries = static_cast<std::size_t>(intervals_);
    std::size_t first = entries, last = 0;  // all that pieces which are too long lie over
    for (std::size_t end = 0; end <= entries; ++end)
        if (error(end, most_sine_part) > too_long) {
            first = std::min(first, begin_of(end, most_sine_part));
            last = end;
        }
    if (last == 0) return;
    lobe_ = {sine_of(first), sine_of(last), most_sine_part};
    parts_.assign(buckets, static_cast<float>(most_sine_part));
    const std::size_t bucket = entries / buckets, stride = std::max<std::size_t>(1, bucket / ends_of_bucket);
    for (std::size_t k = first / bucket; k < buckets && k * bucket <= last; ++k) {
        double part = most_sine_part;
        // Its half too: a long one may be right by chance, but not where in it the power lies.
        const auto is_off = [&] {
            for (std::size_t end = k * bucket; end <= (k + 1) * bucket; end += stride)
                if (error(end, part) > short_enough || error(end, 0.5 * part) > short_enough) return true;
            return false;
        };
        while (part > least_part && is_off()) part *= shrink;
        parts_[k] = static_cast<float>(part);
        lobe_.part = std::min(lobe_.part, static_cast<double>(parts_[k]));
    }
}

bool PatternTable::straight_over(double sine0, double sine1) const {
    if (sine0 >= lobe_.high || sine1 <= lobe_.low) return true;
    const auto at = static_cast<std::size_t>((sine1 + 1) * 0.5 * static_cast<double>(parts_.size()));
    return short_rise(sine1 - sine0, sine1, static_cast<double>(parts_[std::min(at, parts_.size() - 1)]));
}

bool PatternTable::passes_drop(double sine0, double sine1) const {
    return std::any_of(drops_.begin(), drops_.end(),
                       [&](const PatternDrop& drop) { return sine0 < drop.sine && sine1 > drop.sine; });
}

bool PatternTable::meets_drop(double sine0, double sine1) const {
    return std::any_of(drops_.begin(), drops_.end(), [&](const PatternDrop& drop) {
        return wedgescope::meets_drop(sine0, sine1, drop.low, drop.high);
    });
}

PatternTable::Entries PatternTable::beside(double sine) const {
    // Between the entries on either side of a drop the pattern is that of the nearer one, with the slope beyond it.
    bool below = false;
    for (const PatternDrop& drop : drops_)
        if (sine > drop.low && sine < drop.high) {
            below = sine < drop.sine;
            sine = below ? drop.low : drop.high;
            break;
        }
    const double x = (sine + 1) * (0.5 * intervals_);
    const int i = std::clamp(static_cast<int>(x) - (below ? 1 : 0), 0, intervals_ - 1);
    return {static_cast<double>(values_[static_cast<std::size_t>(i)]),
            static_cast<double>(values_[static_cast<std::size_t>(i) + 1]), x - i};
}

double PatternTable::at(double sine) const {
    const Entries e = beside(sine);
    return e.first + e.part * (e.second - e.first);
}

double PatternTable::slope(double sine) const {
    const Entries e = beside(sine);
    return (e.second - e.first) * (0.5 * intervals_);
}

double radar_constant(const RadarParams& radar) {
    const double lambda = radar.wavelength_m(), gain = radar.gain.ratio(), four_pi = 4 * std::numbers::pi;
    return radar.transmit_power_w * gain * gain * lambda * lambda /
           (four_pi * four_pi * four_pi * radar.losses.ratio());
}

namespace {

/// cosine_growth(), also in lanes.
WEDGESCOPE_LANES_PART double growth_of_cosine(double sine0, double sine1) {
    const double square0 = 1 - sine0 * sine0, square1 = 1 - sine1 * sine1,
                 cosine0 = std::sqrt(square0 > 0 ? square0 : 0.0), cosine1 = std::sqrt(square1 > 0 ? square1 : 0.0),
                 both = cosine0 + cosine1;
    return (cosine1 - cosine0) / (both > 1e-30 ? both : 1e-30);
}

/// What is nearer than a metre counts as that.
template <class Real>
constexpr Real counted_range(Real range_m) {
    return range_m > 1 ? range_m : Real{1};
}

/// The inverse of the range in the middle of a piece, by sine of elevation.
template <class Real>
constexpr Real middle_inverse(Real range0_m, Real range1_m) {
    const Real range0 = counted_range(range0_m), range1 = counted_range(range1_m);
    return (range0 + range1) / (2 * (range0 * range1));
}

WEDGESCOPE_LANES_PART void powers(std::size_t n, const Shading& shading, const PatternTable& pattern,
                                  double constant) noexcept {
    const double *__restrict horizon = shading.horizon, *__restrict sine = shading.sine,
                 *__restrict range0 = shading.range0_m, *__restrict range1 = shading.range1_m,
                 *__restrict rise = shading.rise, *__restrict swing = shading.swing;
    double* __restrict power = shading.power;
    float* __restrict bow = shading.bow;
    const float* __restrict table = pattern.data();
    const double half = 0.5 * pattern.intervals();
    const auto entries = static_cast<float>(half);
    const int last = pattern.intervals() - 1;
    constexpr std::size_t block = 64;
    float part[block], lean[block] = {};
    int index[block];
    float pair[2 * block];
    for (std::size_t at = 0; at < n; at += block) {
        const std::size_t m = std::min(block, n - at);
        if (shading.range_is_ground) {
            WEDGESCOPE_INDEPENDENT
            for (std::size_t i = 0; i < m; ++i)
                lean[i] = static_cast<float>(growth_of_cosine(horizon[at + i], sine[at + i]));
        }
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            const double place = (0.5 * (horizon[at + i] + sine[at + i]) + 1) * half;
            const double inside = place > 0 ? place : 0.0;
            int j = static_cast<int>(inside < 1e9 ? inside : 0.0);
            j = j < last ? j : last;
            index[i] = j;
            part[i] = static_cast<float>(place - static_cast<double>(j));
        }
        for (std::size_t i = 0; i < m; ++i) std::memcpy(pair + 2 * i, table + index[i], 2 * sizeof(float));
        // What is left of two numbers beside each other is found in doubles; from there on floats do.
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            const double up = sine[at + i] - horizon[at + i];
            const auto begins = static_cast<float>(range0[at + i]), ends = static_cast<float>(range1[at + i]),
                       longer = static_cast<float>(range1[at + i] - range0[at + i]),
                       shorter = static_cast<float>(counted_range(range0[at + i]) - counted_range(range1[at + i])),
                       risen = static_cast<float>(up), over = static_cast<float>(rise[at + i]),
                       swung = static_cast<float>(swing[at + i]);
            const float ga = pair[2 * i], gb = pair[2 * i + 1], gain = ga + part[i] * (gb - ga),
                        inverse = middle_inverse(begins, ends), swell = 0.5F * risen * ((gb - ga) * entries) / gain,
                        mean = gain * over_middle(swell) * over_middles(shorter * inverse, swell);
            power[at + i] = constant * up * (static_cast<double>(mean) * static_cast<double>(inverse * inverse));
            // As echo_bow().
            const float fall = 2 * longer * inverse,
                        bent = swung / (over > 1e-30F ? over : 1e-30F) + fall - swell - lean[i];
            bow[at + i] = bent < -1 ? -1.0F : bent > 1 ? 1.0F : bent;
        }
    }
}

WEDGESCOPE_LANES_PART void facets(std::size_t n, const FacetLanes& lanes) noexcept {
    const double *__restrict up0 = lanes.from.up_m, *__restrict up1 = lanes.to.up_m, *__restrict out0 = lanes.from.out_m,
                 *__restrict out1 = lanes.to.out_m, *__restrict height0 = lanes.from.height_m,
                 *__restrict height1 = lanes.to.height_m, *__restrict arc0 = lanes.from.arc_m,
                 *__restrict arc1 = lanes.to.arc_m, *__restrict part0 = lanes.from.part,
                 *__restrict part1 = lanes.to.part, *__restrict across = lanes.across, *__restrict slant = lanes.slant;
    const float* __restrict behind = lanes.behind, * __restrict ahead = lanes.ahead;
    double* __restrict variable = lanes.variable;
    const auto minor_posts_a_metre = static_cast<float>(1 / lanes.minor_post_m);
    constexpr auto bend = static_cast<float>(law_bend);
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double up = up1[i] - up0[i], out = out1[i] - out0[i], up_middle = 0.5 * (up1[i] + up0[i]),
                     out_middle = 0.5 * (out1[i] + out0[i]);
        // Piece, ray and the sine of the angle between: what is left of two long products. From there on floats do.
        const auto turned = static_cast<float>(up * out_middle - out * up_middle);
        const float b0 = behind[2 * i], b1 = behind[2 * i + 1], a0 = ahead[2 * i], a1 = ahead[2 * i + 1];
        const auto way = static_cast<float>(arc1[i] - arc0[i]), risen = static_cast<float>(height1[i] - height0[i]),
                   middle = static_cast<float>(0.5 * (part0[i] + part1[i]));
        const float step = way > 1e-9F ? way : 1e-9F,
                    minor = ((b1 - b0) + middle * ((a1 - a0) - (b1 - b0))) * minor_posts_a_metre,
                    tilt = static_cast<float>(slant[i]) * minor * step - static_cast<float>(across[i]) * risen,
                    aside = tilt == tilt ? tilt : 0.0F;
        const auto u = static_cast<float>(up), o = static_cast<float>(out), u_m = static_cast<float>(up_middle),
                   o_m = static_cast<float>(out_middle);
        // The sine's square is a fraction, so its tangent's is too, and law_variable() is sqrt(tan / (tan + law_bend)).
        const float own = step * step + risen * risen, ahead_of = turned > 0 ? turned : 0.0F,
                    some = ahead_of * ahead_of * own,
                    all = (u * u + o * o) * (u_m * u_m + o_m * o_m) * (own + aside * aside), rest = all - some,
                    least = 1e-10F * all + 1e-30F, tangent = std::sqrt(some / (rest > least ? rest : least)),
                    bent = tangent / (tangent + bend);
        variable[i] = static_cast<double>(std::sqrt(bent));
    }
}

}  // namespace

void facet_lanes(std::size_t n, const FacetLanes& facets_of) noexcept { on_target<facets>(n, facets_of); }

void weaken_lanes(std::size_t n, const Shading& shading, const double* inverse_radius,
                  const PathLossTable& loss) noexcept {
    constexpr std::size_t block = 64;
    double range[block], sine[block], factor[block];
    for (std::size_t at = 0; at < n; at += block) {
        const std::size_t m = std::min(block, n - at);
        for (std::size_t i = 0; i < m; ++i) {
            range[i] = 0.5 * (shading.range0_m[at + i] + shading.range1_m[at + i]);
            sine[i] = 0.5 * (shading.horizon[at + i] + shading.sine[at + i]);
        }
        factor_lanes(m, range, sine, inverse_radius + at, loss, factor);
        for (std::size_t i = 0; i < m; ++i) shading.power[at + i] *= factor[i];
    }
}

void power_lanes(std::size_t n, const Shading& shading, const PatternTable& pattern, double constant) noexcept {
    on_target<powers>(n, shading, pattern, constant);
}

double cosine_growth(double sine0, double sine1) noexcept { return growth_of_cosine(sine0, sine1); }

double echo_bow(double sine0, double sine1, double range0_m, double range1_m, const PatternTable& pattern,
                bool range_is_ground) noexcept {
    return 2 * (range1_m - range0_m) * middle_inverse(range0_m, range1_m) - middle_gain(sine0, sine1, pattern).swell -
           (range_is_ground ? cosine_growth(sine0, sine1) : 0);
}

double piece_power(double sine0, double sine1, double range0_m, double range1_m, const PatternTable& pattern,
                   double constant) noexcept {
    const double inverse = middle_inverse(range0_m, range1_m),
                 nearer = (counted_range(range0_m) - counted_range(range1_m)) * inverse;
    const MiddleGain middle = middle_gain(sine0, sine1, pattern);
    return constant * (sine1 - sine0) * (inverse * inverse) *
           (middle.gain * over_middle(middle.swell) * over_middles(nearer, middle.swell));
}

}  // namespace wedgescope
