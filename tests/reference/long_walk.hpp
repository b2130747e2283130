// The reference in long double, on a plane of posts: how far a sight line passes over the ground, and what the ground along a
// ray returns into each range bin. For the numbers at which double precision itself is in question (tests/numerics_test).
// It shares no code with lib/, tiles/ or tools/, and leaves geodesics to line_of_sight.hpp and reference_engine.hpp.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

namespace wedgescope::reference {

/// Posts on a plane and a sensor over it.
struct LongPlane {
    std::int64_t columns = 0, rows = 0;
    std::function<double(std::int64_t column, std::int64_t row)> height_m;  ///< NaN: void
    long double column_m = 1, row_m = -1;  ///< metres east and north of the next column and row
    long double sensor_column = 0, sensor_row = 0, sensor_m = 0;
    long double radius_m = 0;  ///< effective; 0: flat earth
};

class LongWalk {
public:
    using Real = long double;
    explicit LongWalk(LongPlane plane) : p_(std::move(plane)) {}

    /// The least height of the sight line to a post (target_m over it) above the ground before it, metres; below 0: hidden.
    /// NaN: the post is void. A void hides nothing. The sensor's own place and the post itself do not count. A walk ends
    /// where it is hidden by more than `enough_m`.
    Real clearance_m(std::int64_t column, std::int64_t row, double target_m = 0,
                     Real enough_m = std::numeric_limits<Real>::infinity()) const {
        const Real own = post(column, row);
        if (std::isnan(own)) return own;
        const Real dc = static_cast<Real>(column) - p_.sensor_column, dr = static_cast<Real>(row) - p_.sensor_row,
                   length = std::hypot(dc * p_.column_m, dr * p_.row_m);
        Real least = std::numeric_limits<Real>::infinity();
        if (length == 0) return least;
        const Point there = seat(length, own + static_cast<Real>(target_m));
        const auto over = [&](Real t, Real ground) { return ray_m(t * length, there.up / there.out) - ground; };
        for_cells(dc, dr, [&](Real t0, Real t1, const auto& ground) {
            const Real middle = (t0 + t1) / 2, f0 = t0 > 0 ? over(t0, ground(t0)) : p_.sensor_m - ground(0),
                       fm = over(middle, ground(middle)),
                       f1 = t1 < 1 ? over(t1, ground(t1)) : static_cast<Real>(target_m);
            if (std::isnan(f0) || std::isnan(f1) || std::isnan(fm)) {
                if (f0 < least) least = f0;
                if (f1 < least && t1 < 1) least = f1;
                return least > -enough_m;
            }
            // f0 + b u + a u^2 through the three.
            const Real a = 2 * (f0 - 2 * fm + f1), b = f1 - f0 - a;
            if (t0 > 0) least = std::min(least, f0);
            if (t1 < 1) least = std::min(least, f1);
            if (a > 0 && b < 0 && b + 2 * a > 0) least = std::min(least, f0 - b * b / (4 * a));
            return least > -enough_m;
        });
        return least;
    }

    /// Along one azimuth (clockwise from north): sum of d(sin e) / r^2 of what is seen, by range bin, per m^2.
    std::vector<Real> returns(Real azimuth_rad, Real range_bin_m, std::size_t bins) const {
        const Real reach = range_bin_m * static_cast<Real>(bins) * 1.01L + 1;
        const Real dc = std::sin(azimuth_rad) / p_.column_m * reach, dr = std::cos(azimuth_rad) / p_.row_m * reach;
        std::vector<Real> sum(bins);
        Real horizon = -1;
        for_cells(dc, dr, [&](Real t0, Real t1, const auto& ground) {
            const Real middle_m = ground((t0 + t1) / 2);
            if (std::isnan(middle_m)) return true;  // beside the posts, or void
            // Steps short against the range and against the cell.
            const Real near = std::max<Real>(std::abs(p_.sensor_m - middle_m), 1e-3L);
            Real t = t0;
            const Real most = (t1 - t0) / 16;
            while (t < t1) {
                const Real s = t * reach, step = std::min({most, (s + near) / 200 / reach, t1 - t});
                Real next = t + step;
                if (t1 - next < step * 1e-6L) next = t1;
                // Up a cliff much is passed though the way hardly goes on.
                const Point here = seat(t * reach, ground(t));
                for (int i = 0; i < 40; ++i) {
                    const Point there = seat(next * reach, ground(next));
                    if (!(std::hypot(there.up - here.up, there.out - here.out) >
                          0.005L * std::max<Real>(std::hypot(here.up, here.out), 1)))
                        break;
                    next = (t + next) / 2;
                }
                rise(t * reach, ground(t), next * reach, ground(next), horizon, range_bin_m, sum);
                t = next;
            }
            return true;
        });
        return sum;
    }

    /// Slant range of the ground at an arc.
    Real slant_m(Real arc_m, Real height_m) const {
        const Point at = seat(arc_m, height_m);
        return std::hypot(at.up, at.out);
    }

private:
    struct Point {
        Real up, out;
    };

    Real post(std::int64_t c, std::int64_t r) const {
        if (c < 0 || r < 0 || c >= p_.columns || r >= p_.rows) return std::numeric_limits<Real>::quiet_NaN();
        return static_cast<Real>(p_.height_m(c, r));
    }

    /// In the sensor's vertical plane.
    Point seat(Real arc, Real height) const {
        if (p_.radius_m == 0) return {height - p_.sensor_m, arc};
        const Real theta = arc / p_.radius_m, half = std::sin(theta / 2), q = 2 * half * half;
        return {(height - p_.sensor_m) - q * (p_.radius_m + height), (p_.radius_m + height) * std::sin(theta)};
    }
    /// Height above sea level of the ray of a tangent over an arc.
    Real ray_m(Real arc, Real tangent) const {
        if (p_.radius_m == 0) return p_.sensor_m + tangent * arc;
        const Real theta = arc / p_.radius_m, half = std::sin(theta / 2), q = 2 * half * half, s = std::sin(theta);
        return (p_.sensor_m + (q + tangent * s) * p_.radius_m) / (1 - q - tangent * s);
    }

    /// Calls body(t0, t1, ground(t)) for each cell that the way from the sensor by (dc, dr) crosses.
    template <class Body>
    void for_cells(Real dc, Real dr, Body&& body) const {
        const auto next = [](Real from, Real step, Real part) {
            // The next whole number beyond `from + part step`, as a part of the way.
            if (step == 0) return std::numeric_limits<Real>::infinity();
            const Real at = from + part * step, slip = 1e-12L;
            const Real line = step > 0 ? std::floor(at + slip) + 1 : std::ceil(at - slip) - 1;
            return (line - from) / step;
        };
        for (Real t = 0; t < 1;) {
            const Real t1 = std::min({next(p_.sensor_column, dc, t), next(p_.sensor_row, dr, t), Real{1}});
            const Real middle = (t + t1) / 2;
            const auto c = static_cast<std::int64_t>(std::floor(p_.sensor_column + middle * dc)),
                       r = static_cast<std::int64_t>(std::floor(p_.sensor_row + middle * dr));
            const auto ground = [&](Real part) {
                const Real u = std::clamp(p_.sensor_column + part * dc - static_cast<Real>(c), Real(0), Real(1)),
                           v = std::clamp(p_.sensor_row + part * dr - static_cast<Real>(r), Real(0), Real(1));
                Real sum = 0;
                for (int j = 0; j < 2; ++j)
                    for (int i = 0; i < 2; ++i) {
                        const Real weight = (i ? u : 1 - u) * (j ? v : 1 - v);
                        if (weight > 1e-12L) sum += weight * post(c + i, r + j);
                    }
                return sum;
            };
            if (!body(t, t1, ground)) return;
            t = t1;
        }
    }

    void rise(Real s0, Real h0, Real s1, Real h1, Real& horizon, Real bin_m, std::vector<Real>& sum) const {
        if (std::isnan(h0) || std::isnan(h1)) return;
        const Point a = seat(s0, h0), b = seat(s1, h1);
        const Real ra = std::hypot(a.up, a.out), rb = std::hypot(b.up, b.out), ea = ra > 0 ? a.up / ra : -1,
                   eb = rb > 0 ? b.up / rb : -1;
        if (eb <= horizon) return;
        const Real begin = ea >= horizon ? 0 : (horizon - ea) / (eb - ea), from = ra + begin * (rb - ra);
        const Real each = (eb - horizon), near = std::min(from, rb), far = std::max(from, rb);
        horizon = eb;
        for (auto j = static_cast<std::size_t>(near / bin_m); j < sum.size() && static_cast<Real>(j) * bin_m <= far;
             ++j) {
            const Real low = std::max(near, static_cast<Real>(j) * bin_m),
                       high = std::min(far, static_cast<Real>(j + 1) * bin_m);
            const Real share = far > near ? (high - low) / (far - near) : 1, r = far > near ? (low + high) / 2 : near;
            if (r > 0) sum[j] += each * share / (r * r);
            if (far == near) break;
        }
    }

    LongPlane p_;
};

}  // namespace wedgescope::reference
