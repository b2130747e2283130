#include "lib/coverage_lanes.hpp"

#include <cmath>

#include "lib/lanes.hpp"

namespace wedgescope {
namespace {

struct Polynomials {
    double lift, drop, ray, rise;
};

/// The factors of the tangent at d (1 + stretch) = `along`, with 1 + stretch = `wide`. `turn`, `curvature`: f^2 / Re^2 and
/// f^2 / Re.
WEDGESCOPE_LANES_PART Polynomials factors(double along, double inverse_along, double wide, double turn,
                                          double curvature) noexcept {
    const double x = along * along * turn;  // theta^2, 0.016 at 800 km
    const double inverse_sinc =
        1 + x * (1.0 / 6 + x * (7.0 / 360 + x * (31.0 / 15120 + x * (127.0 / 604800 + x * (73.0 / 3421440)))));
    const double half_tangent = 1 + x * (1.0 / 12) * (1 + x * (1.0 / 10) * (1 + x * (17.0 / 168)));
    const double cosine = 1 - x * (1.0 / 2) * (1 - x * (1.0 / 12) * (1 - x * (1.0 / 30)));
    Polynomials p;
    p.lift = inverse_along * inverse_sinc;
    p.drop = 0.5 * along * curvature * half_tangent;
    p.ray = p.lift * wide * cosine;
    p.rise = p.drop * wide;
    return p;
}

WEDGESCOPE_LANES_PART double place(const LineForm& line, const PieceForm& piece, double m, double u) noexcept {
    return line.nadir_minor + m * line.distance + quartic_at(piece.bend, u);
}

/// n, spokes and first as spoke_fan() has them.
WEDGESCOPE_LANES_PART void make_fan(const LineForm& line, std::int64_t spokes, std::int64_t first, std::size_t n,
                                    const FanLanes& out) noexcept {
    double* __restrict slope = out.slope, * __restrict turn = out.turn, * __restrict curvature = out.curvature;
    const double of = static_cast<double>(spokes), start = static_cast<double>(first);
    const LineForm form = line;
    WEDGESCOPE_INDEPENDENT
    for (int i = 0; i < static_cast<int>(n); ++i) {  // which AVX2 can turn into doubles
        const double m = (start + static_cast<double>(i * static_cast<int>(knot_step))) / of,
                     bent = quadratic(form.curvature, m);
        slope[i] = m;
        turn[i] = bent * bent / quadratic(form.square, m);
        curvature[i] = bent;
    }
}

/// `straight`: neither bend nor stretch.
template <bool straight>
WEDGESCOPE_LANES_PART void place_spokes(const LineForm& line, const PieceForm& piece, const FanLanes& fan,
                                        std::size_t n, const KnotLanes& out) noexcept {
    const double* __restrict slope = fan.slope, * __restrict turn = fan.turn, * __restrict curvature = fan.curvature;
    double* __restrict at = out.at;
    float* __restrict lift = out.lift, * __restrict drop = out.drop;
    const LineForm form = line;
    const PieceForm curve = piece;
    const double inverse = 1 / form.distance;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double m = slope[i], u = (m - curve.middle) * curve.scale;
        const double wide = straight ? 1 : 1 + quartic_at(curve.stretch, u);
        const Polynomials p =
            factors(form.distance * wide, straight ? inverse : inverse / wide, wide, turn[i], curvature[i]);
        at[i] = straight ? form.nadir_minor + m * form.distance : place(form, curve, m, u);
        lift[i] = static_cast<float>(p.lift);
        drop[i] = static_cast<float>(p.drop);
    }
}

WEDGESCOPE_LANES_PART bool is_straight(const PieceForm& piece) noexcept {
    const Quartic none{};
    return piece.bend == none && piece.stretch == none;
}

WEDGESCOPE_LANES_PART void place_any_spokes(const LineForm& line, const PieceForm& piece, const FanLanes& fan,
                                            std::size_t n, const KnotLanes& out) noexcept {
    if (is_straight(piece))
        place_spokes<true>(line, piece, fan, n, out);
    else
        place_spokes<false>(line, piece, fan, n, out);
}

/// `all`: else slope and way alone.
template <bool straight, bool all>
WEDGESCOPE_LANES_PART void place_posts(const LineForm& line, const PieceForm& piece, std::int64_t spokes,
                                       const double* minor, std::size_t n, const KnotLanes& out) noexcept {
    double* __restrict at = out.at, * __restrict slope = out.slope, * __restrict along = out.along;
    float* __restrict lift = out.lift, * __restrict drop = out.drop, * __restrict ray = out.ray, * __restrict rise = out.rise;
    const double* __restrict place = minor;
    const Quartic derivative = {piece.bend[1] * piece.scale, 2 * piece.bend[2] * piece.scale,
                                3 * piece.bend[3] * piece.scale, 4 * piece.bend[4] * piece.scale, 0};
    const double middle = piece.middle, scale = piece.scale, distance = line.distance;
    const Quartic bend = piece.bend, stretch = piece.stretch;
    const LineForm form = line;
    // Not far from the piece, beyond which its polynomials lead anywhere.
    const double least = middle - 1.25 / scale, most = middle + 1.25 / scale;
    const auto inside = [=](double m) __attribute__((always_inline)) { return m < least ? least : m > most ? most : m; };
    const auto better = [=](double m, double t) __attribute__((always_inline)) {
        const double u = (m - middle) * scale;
        return inside(m - (m * distance + quartic_at(bend, u) - t) / (distance + quartic_at(derivative, u)));
    };
    const double inverse = 1 / distance;
    WEDGESCOPE_INDEPENDENT
    for (std::size_t i = 0; i < n; ++i) {
        const double t = place[i] - form.nadir_minor;
        double m = t * inverse;
        // Newton's, by hand so that the loop stays one; bend is small beside the way, so three rounds would do.
        if (!straight) m = better(better(better(better(inside(m), t), t), t), t);
        const double wide = straight ? 1 : 1 + quartic_at(stretch, (m - middle) * scale);
        at[i] = m * static_cast<double>(spokes);
        slope[i] = m;
        along[i] = distance * wide;
        if constexpr (all) {
            const double square = quadratic(form.square, m), bent = quadratic(form.curvature, m);
            const double both = 1 / (square * wide);  // of two inverses
            const Polynomials p = factors(distance * wide, straight ? inverse : inverse * (both * square), wide,
                                          bent * bent * (both * wide), bent);
            lift[i] = static_cast<float>(p.lift);
            drop[i] = static_cast<float>(p.drop);
            ray[i] = static_cast<float>(p.ray);
            rise[i] = static_cast<float>(p.rise);
        }
    }
}

WEDGESCOPE_LANES_PART void place_any_posts(const LineForm& line, const PieceForm& piece, std::int64_t spokes,
                                           const double* minor, std::size_t n, const KnotLanes& out) noexcept {
    const bool straight = is_straight(piece), all = out.lift != nullptr;
    if (straight && all)
        place_posts<true, true>(line, piece, spokes, minor, n, out);
    else if (straight)
        place_posts<true, false>(line, piece, spokes, minor, n, out);
    else if (all)
        place_posts<false, true>(line, piece, spokes, minor, n, out);
    else
        place_posts<false, false>(line, piece, spokes, minor, n, out);
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

void spoke_fan(const LineForm& line, std::int64_t spokes, std::int64_t first, std::size_t n,
               const FanLanes& out) noexcept {
    on_target<make_fan>(line, spokes, first, n, out);
}

void spoke_knots(const LineForm& line, const PieceForm& piece, const FanLanes& fan, std::size_t n,
                 const KnotLanes& out) noexcept {
    on_target<place_any_spokes>(line, piece, fan, n, out);
}

double spoke_place(const LineForm& line, const PieceForm& piece, double slope) noexcept {
    return place(line, piece, slope, (slope - piece.middle) * piece.scale);
}

void post_knots(const LineForm& line, const PieceForm& piece, std::int64_t spokes, const double* minor, std::size_t n,
                const KnotLanes& out) noexcept {
    on_target<place_any_posts>(line, piece, spokes, minor, n, out);
}

void paint_mask(const std::uint8_t* states, std::size_t n, const std::array<std::uint8_t, coverage_states>& value,
                std::uint8_t* bytes) noexcept {
    on_target<paint>(states, n, value, bytes);
}

}  // namespace wedgescope
