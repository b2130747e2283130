#include "lib/coverage_lanes.hpp"

#include <cmath>

#include "lib/lanes.hpp"

namespace wedgescope {
namespace {

struct Polynomials {
    double lift, drop, ray, rise, along;
};

/// Slope m on a line -> the factors of the tangent.
WEDGESCOPE_LANES_PART Polynomials factors(const LineForm& line, double m, double stretch) noexcept {
    const double square = line.square[0] + m * (line.square[1] + m * line.square[2]);
    const double curvature = line.curvature[0] + m * (line.curvature[1] + m * line.curvature[2]);
    const double along = line.distance * (1 + stretch);
    // theta^2 = s^2 / Re^2, with s^2 = along^2 f^2 and 1 / Re = curvature / f^2
    const double x = along * along * curvature * curvature / square;
    const double sinc = 1 - x * (1.0 / 6) * (1 - x * (1.0 / 20) * (1 - x * (1.0 / 42)));
    const double half_tangent = 1 + x * (1.0 / 12) * (1 + x * (1.0 / 10) * (1 + x * (17.0 / 168)));
    const double cosine = 1 - x * (1.0 / 2) * (1 - x * (1.0 / 12) * (1 - x * (1.0 / 30)));
    Polynomials p;
    p.lift = 1 / (along * sinc);
    p.drop = 0.5 * along * curvature * half_tangent;
    p.ray = p.lift * (1 + stretch) * cosine;
    p.rise = p.drop * (1 + stretch);
    p.along = along;
    return p;
}

WEDGESCOPE_LANES_PART double horner(const std::array<double, 5>& c, double u) noexcept {
    return c[0] + u * (c[1] + u * (c[2] + u * (c[3] + u * c[4])));
}

WEDGESCOPE_LANES_PART double place(const LineForm& line, const PieceForm& piece, double m, double u) noexcept {
    return line.nadir_minor + m * line.distance + horner(piece.bend, u);
}

WEDGESCOPE_LANES_PART void place_spokes(const LineForm& line, const PieceForm& piece, std::int64_t spokes,
                                        std::int64_t first, std::size_t n, const KnotLanes& out) noexcept {
    double* __restrict at = out.at;
    float* __restrict lift = out.lift, * __restrict drop = out.drop;
    const double of = static_cast<double>(spokes), start = static_cast<double>(first);
    WEDGESCOPE_INDEPENDENT
    for (int i = 0; i < static_cast<int>(n); ++i) {  // which AVX2 can turn into doubles
        const double m = (start + static_cast<double>(i * static_cast<int>(knot_step))) / of,
                     u = (m - piece.middle) * piece.scale;
        const Polynomials p = factors(line, m, horner(piece.stretch, u));
        at[i] = place(line, piece, m, u);
        lift[i] = static_cast<float>(p.lift);
        drop[i] = static_cast<float>(p.drop);
    }
}

/// `straight`: neither bend nor stretch.
template <bool straight>
WEDGESCOPE_LANES_PART void place_posts(const LineForm& line, const PieceForm& piece, std::int64_t spokes,
                                       const double* minor, std::size_t n, const KnotLanes& out) noexcept {
    double* __restrict at = out.at, * __restrict slope = out.slope, * __restrict along = out.along;
    float* __restrict lift = out.lift, * __restrict drop = out.drop, * __restrict ray = out.ray, * __restrict rise = out.rise;
    const double* __restrict place = minor;
    const std::array<double, 5> derivative = {piece.bend[1] * piece.scale, 2 * piece.bend[2] * piece.scale,
                                              3 * piece.bend[3] * piece.scale, 4 * piece.bend[4] * piece.scale, 0};
    const double middle = piece.middle, scale = piece.scale, distance = line.distance;
    const std::array<double, 5> bend = piece.bend, stretch = piece.stretch;
    const LineForm form = line;
    const auto better = [=](double m, double t) __attribute__((always_inline)) {
        const double u = (m - middle) * scale;
        return m - (m * distance + horner(bend, u) - t) / (distance + horner(derivative, u));
    };
    const double inverse = 1 / distance;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double t = place[i] - form.nadir_minor;
        double m = t * inverse;
        // Newton's, by hand so that the loop stays one; bend is small beside the way, so three rounds would do.
        if (!straight) m = better(better(better(better(m, t), t), t), t);
        const Polynomials p = factors(form, m, straight ? 0 : horner(stretch, (m - middle) * scale));
        at[i] = m * static_cast<double>(spokes);
        slope[i] = m;
        along[i] = p.along;
        lift[i] = static_cast<float>(p.lift);
        drop[i] = static_cast<float>(p.drop);
        ray[i] = static_cast<float>(p.ray);
        rise[i] = static_cast<float>(p.rise);
    }
}

WEDGESCOPE_LANES_PART void place_any_posts(const LineForm& line, const PieceForm& piece, std::int64_t spokes,
                                           const double* minor, std::size_t n, const KnotLanes& out) noexcept {
    const std::array<double, 5> none{};
    if (piece.bend == none && piece.stretch == none)
        place_posts<true>(line, piece, spokes, minor, n, out);
    else
        place_posts<false>(line, piece, spokes, minor, n, out);
}

WEDGESCOPE_LANES_PART void count(const std::uint8_t* states, std::size_t n,
                                 std::array<std::uint64_t, coverage_states>& counts) noexcept {
    std::uint32_t ones = 0, twos = 0, threes = 0, fours = 0;  // n is of a line
    for (std::size_t i = 0; i < n; ++i) {
        ones += states[i] == 1;
        twos += states[i] == 2;
        threes += states[i] == 3;
        fours += states[i] == 4;
    }
    counts[0] += n - ones - twos - threes - fours;
    counts[1] += ones;
    counts[2] += twos;
    counts[3] += threes;
    counts[4] += fours;
}

WEDGESCOPE_LANES_PART void paint(const std::uint8_t* states, std::size_t n,
                                 const std::array<std::uint8_t, coverage_states>& value, std::uint8_t* bytes) noexcept {
    const std::uint8_t* __restrict from = states;
    std::uint8_t* __restrict to = bytes;
    const std::uint8_t v4 = value[4], d0 = value[0] ^ v4, d1 = value[1] ^ v4, d2 = value[2] ^ v4, d3 = value[3] ^ v4;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const std::uint8_t s = from[i];
        // What each state adds to the last one's value, by masks: of one selection in another the compiler makes branches.
        const auto add = [s](std::uint8_t state, std::uint8_t difference) __attribute__((always_inline)) {
            return static_cast<std::uint8_t>(-(s == state) & difference);
        };
        std::uint8_t byte = v4;
        byte = static_cast<std::uint8_t>(byte ^ add(0, d0));
        byte = static_cast<std::uint8_t>(byte ^ add(1, d1));
        byte = static_cast<std::uint8_t>(byte ^ add(2, d2));
        to[i] = static_cast<std::uint8_t>(byte ^ add(3, d3));
    }
}

}  // namespace

void spoke_knots(const LineForm& line, const PieceForm& piece, std::int64_t spokes, std::int64_t first, std::size_t n,
                 const KnotLanes& out) noexcept {
    on_target<place_spokes>(line, piece, spokes, first, n, out);
}

double spoke_place(const LineForm& line, const PieceForm& piece, double slope) noexcept {
    return place(line, piece, slope, (slope - piece.middle) * piece.scale);
}

void post_knots(const LineForm& line, const PieceForm& piece, std::int64_t spokes, const double* minor, std::size_t n,
                const KnotLanes& out) noexcept {
    on_target<place_any_posts>(line, piece, spokes, minor, n, out);
}

void count_states(const std::uint8_t* states, std::size_t n,
                  std::array<std::uint64_t, coverage_states>& counts) noexcept {
    on_target<count>(states, n, counts);
}

void paint_mask(const std::uint8_t* states, std::size_t n, const std::array<std::uint8_t, coverage_states>& value,
                std::uint8_t* bytes) noexcept {
    on_target<paint>(states, n, value, bytes);
}

}  // namespace wedgescope
