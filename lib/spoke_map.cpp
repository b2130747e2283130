#include "lib/spoke_map.hpp"

#include <GeographicLib/Geodesic.hpp>
#include <GeographicLib/GeodesicLine.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "lib/earth.hpp"
#include "lib/error.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {
namespace {

constexpr Quartic nodes = {-1, -0.5, 0, 0.5, 1};

/// Coefficients of the quartic through values at the nodes (central differences: exact for quartics).
Quartic quartic(const Quartic& f) {
    return {f[2], (f[0] - 8 * f[1] + 8 * f[3] - f[4]) / 6, (-f[0] + 16 * f[1] - 30 * f[2] + 16 * f[3] - f[4]) / 6,
            (-f[0] + 2 * f[1] - 2 * f[3] + f[4]) * 2 / 3, (f[0] - 4 * f[1] + 6 * f[2] - 4 * f[3] + f[4]) * 2 / 3};
}

/// Index-space direction (column, row) of slope m.
std::pair<double, double> direction(Quadrant q, double slope) {
    const double major = outward(q);
    return lines_are_columns(q) ? std::pair(major, slope) : std::pair(slope, major);
}

/// The geodesic of one spoke, seen in index space.
class SpokeCourse {
public:
    SpokeCourse(const DataBase& data_base, const SpokeMapParams& params, Quadrant q, double azimuth_rad)
        : data_base_(data_base), params_(params), quadrant_(q),
          line_(GeographicLib::Geodesic::WGS84().Line(params.lat_deg, params.lon_deg,
                                                      azimuth_rad * (180 / std::numbers::pi))) {}

    /// Major (outward) and minor offsets from the nadir, posts, at arc s.
    std::pair<double, double> at(double arc_m) const {
        double lat = 0, lon = 0;
        line_.Position(arc_m, lat, lon);
        const IndexPosition p = data_base_.locate(lat, lon);
        const double columns = data_base_.columns_between(params_.nadir.column, p.column);
        const double rows = p.row - params_.nadir.row;
        return lines_are_columns(quadrant_) ? std::pair(columns * outward(quadrant_), rows)
                                            : std::pair(rows * outward(quadrant_), columns);
    }

    /// Arc at which the major offset is `distance`, from a first guess; nothing where there is none.
    std::optional<double> arc_to(double distance, double guess_m, double metres_per_post) const {
        double arc = guess_m, slope = 1 / metres_per_post;
        double miss = at(arc).first - distance;
        for (int i = 0; i < 40 && std::isfinite(miss); ++i) {
            if (std::abs(miss) < 1e-9) return arc;
            const double next = arc - miss / slope;
            const double next_miss = at(next).first - distance;
            const double secant = (next_miss - miss) / (next - arc);
            if (std::isfinite(secant) && secant > 0.05 / metres_per_post) slope = secant;
            arc = next, miss = next_miss;
        }
        if (std::abs(miss) < 1e-6) return arc;  // PROJ's own noise
        return std::nullopt;
    }

private:
    const DataBase& data_base_;
    const SpokeMapParams& params_;
    Quadrant quadrant_;
    GeographicLib::GeodesicLine line_;
};

}  // namespace

SpokeMap::SpokeMap(const DataBase& data_base, const SpokeMapParams& params) : params_(params) {
    try {
        lay_out(data_base);
    } catch (const TooBent&) {
        throw DataError(refusal(data_base, params));
    }
}

/// Says the largest range that does, or that none does.
std::string SpokeMap::refusal(const DataBase& data_base, const SpokeMapParams& params) {
    const auto does = [&](double range_m) {
        SpokeMapParams nearer = params;
        nearer.max_arc_m = 1.001 * range_m + params.margin_m;
        SpokeMap map(nearer);
        try {
            map.lay_out(data_base);
        } catch (const TooBent&) {
            return false;
        }
        return true;
    };
    const std::string place = text("latitude ", params.lat_deg, ", longitude ", params.lon_deg);
    const bool pole = !data_base.crs_in_metres && std::abs(params.lat_deg) > 45;
    const std::string warp =
        pole ? text("a raster in a projection such as UPS (gdalwarp -t_srs EPSG:", params.lat_deg > 0 ? 32661 : 32761,
                    ")")
             : "a raster in a projection made for the place";
    if (!does(0))
        return text("dem ", in_quotes(data_base.name), ": its grid bends too much near ", place,
                    " to follow geodesics from post to post, whatever the range",
                    pole ? ": the sensor is too near the pole for posts as far apart as these" : "",
                    "; accepted: ", warp);
    double yes = 0, no = params.max_arc_m - params.margin_m;
    for (double m = no / 2; yes == 0 && m > 1; m /= 2) (does(m) ? yes : no) = m;
    for (int i = 0; i < 3; ++i) {
        const double m = (yes + no) / 2;
        (does(m) ? yes : no) = m;
    }
    const double digit = std::pow(10, std::max(0.0, std::floor(std::log10(std::max(yes, 1.0))) - 1));
    const double most = std::floor(yes / digit) * digit;
    return text("dem ", in_quotes(data_base.name), ": within ",
                params.range_m ? text("a range of ", *params.range_m, " m") : "its reach", " of ", place,
                " its grid bends too much to follow geodesics line by line; accepted: a range up to ", most, " m, or ",
                warp);
}

void SpokeMap::lay_out(const DataBase& data_base) {
    if (straight()) {
        east_per_column_ = data_base.step_x * data_base.metres_per_unit;
        north_per_row_ = data_base.step_y * data_base.metres_per_unit;
    } else {
        // Posts per metre by central differences over 200 m, then inverted: metres per post.
        constexpr double arm_m = 100;
        const auto& geod = GeographicLib::Geodesic::WGS84();
        const auto offset = [&](double azimuth_deg) {
            double lat = 0, lon = 0;
            geod.Direct(params_.lat_deg, params_.lon_deg, azimuth_deg, arm_m, lat, lon);
            return data_base.locate(lat, lon);
        };
        const IndexPosition n = offset(0), s = offset(180), e = offset(90), w = offset(-90);
        const double column_per_east = data_base.columns_between(w.column, e.column) / (2 * arm_m);
        const double column_per_north = data_base.columns_between(s.column, n.column) / (2 * arm_m);
        const double row_per_east = (e.row - w.row) / (2 * arm_m);
        const double row_per_north = (n.row - s.row) / (2 * arm_m);
        const double det = column_per_east * row_per_north - column_per_north * row_per_east;
        if (!(std::abs(det) > 0))
            throw DataError(
                text("dem ", in_quotes(data_base.name), ": its CRS has no unique position near the sensor"));
        constexpr int bits = 30;
        east_per_column_ = rounded_significand(row_per_north / det, bits);
        east_per_row_ = rounded_significand(-column_per_north / det, bits);
        north_per_column_ = rounded_significand(-row_per_east / det, bits);
        north_per_row_ = rounded_significand(column_per_east / det, bits);
        // What is left of a right angle by the differences' noise is none.
        const double noise = 1e-9 * (std::abs(east_per_column_) + std::abs(north_per_row_));
        if (std::abs(east_per_row_) < noise) east_per_row_ = 0;
        if (std::abs(north_per_column_) < noise) north_per_column_ = 0;
    }
    for (Quadrant q : all_quadrants) {
        Fit& f = fits_[static_cast<std::size_t>(q)];
        const std::int64_t count = lines_are_columns(q) ? data_base.columns : data_base.rows;
        const double edge = outward(q) > 0 ? static_cast<double>(count - 1) - nadir_major(q) : nadir_major(q);
        double least_f = metres_per_post(q, 0);
        for (int i = -8; i <= 8; ++i) least_f = std::min(least_f, metres_per_post(q, i / 8.0));
        f.reach =
            std::min(data_base.cyclic && lines_are_columns(q) ? static_cast<double>(data_base.cycle_columns / 2) : edge,
                     params_.max_arc_m / least_f * laid_out + 2);
        // A sensor a hair inside the outermost line: the rounding of places is nothing beside a post, but all of such a way.
        if (f.reach > 0) f.reach = std::max(f.reach, 1.0);
        if (!straight() && f.reach > 0) fit(data_base, q);
    }
}

double SpokeMap::metres_per_post(Quadrant q, double slope) const {
    const auto [c, r] = direction(q, slope);
    const double east = c * east_per_column_ + r * east_per_row_;
    const double north = c * north_per_column_ + r * north_per_row_;
    return std::sqrt(east * east + north * north);
}

double SpokeMap::azimuth_rad(Quadrant q, double slope) const {
    const auto bearing = [&](double m) {
        const auto [c, r] = direction(q, m);
        return std::atan2(c * east_per_column_ + r * east_per_row_, c * north_per_column_ + r * north_per_row_);
    };
    const double middle = bearing(0);
    return rounded(middle + std::remainder(bearing(slope) - middle, 2 * std::numbers::pi), angle_bits);
}

double SpokeMap::inverse_radius(Quadrant q, double slope) const {
    if (!params_.earth_k) return 0;
    const double radius =
        straight() ? mean_radius_m : euler_radius_m(params_.lat_deg * (std::numbers::pi / 180), azimuth_rad(q, slope));
    return rounded_significand(1 / (*params_.earth_k * radius), 32);
}

double SpokeMap::azimuth_per_slope(Quadrant q) const {
    const double det = std::abs(east_per_column_ * north_per_row_ - east_per_row_ * north_per_column_);
    double most = 0;
    for (int i = -64; i <= 64; ++i) {
        const double f = metres_per_post(q, i / 64.0);
        most = std::max(most, det / (f * f));
    }
    return most;
}

void SpokeMap::fit(const DataBase& data_base, Quadrant q) {
    Fit& f = fits_[static_cast<std::size_t>(q)];
    // bend and stretch at one slope and distance.
    const auto at = [&](const SpokeCourse& course, double slope, double distance) -> std::pair<double, double> {
        if (distance == 0) return {0.0, 0.0};
        const double per_post = metres_per_post(q, slope);
        const auto arc = course.arc_to(distance, distance * per_post, per_post);
        if (!arc) throw TooBent();
        const double minor = course.at(*arc).second;
        return {rounded(minor - slope * distance, position_bits), rounded(*arc / (distance * per_post) - 1, 44)};
    };
    for (int pieces = 1;; pieces *= 2) {
        if (pieces > 32) throw TooBent();
        f.slope_pieces = f.distance_pieces = pieces;
        const auto n = static_cast<std::size_t>(pieces);
        f.bend.assign(n * n, Patch{});
        f.stretch.assign(n * n, Patch{});
        const double slope_half = 1.0 / pieces, distance_half = f.reach / (2 * pieces);
        f.most_bend = f.most_curve = 0;
        double worst = 0, slack = 1;
        for (std::size_t i = 0; i < n; ++i) {
            const double slope_middle = -1 + (2 * static_cast<double>(i) + 1) * slope_half;
            std::vector<std::array<Quartic, 5>> bend(n),
                stretch(n);  // [piece of d][slope node][distance node]
            for (std::size_t a = 0; a < 5; ++a) {
                const double slope = slope_middle + nodes[a] * slope_half;
                const SpokeCourse course(data_base, params_, q, azimuth_rad(q, slope));
                for (std::size_t j = 0; j < n; ++j)
                    for (std::size_t b = 0; b < 5; ++b) {
                        const double distance = (2 * static_cast<double>(j) + 1 + nodes[b]) * distance_half;
                        std::tie(bend[j][a][b], stretch[j][a][b]) = at(course, slope, distance);
                        f.most_bend = std::max(f.most_bend, std::abs(bend[j][a][b]));
                    }
            }
            for (std::size_t j = 0; j < n; ++j) {
                const auto tensor = [](const std::array<Quartic, 5>& values) {
                    std::array<Quartic, 5> rows{};  // [slope node] -> powers of d
                    for (std::size_t a = 0; a < 5; ++a) rows[a] = quartic(values[a]);
                    Patch patch{};
                    for (std::size_t power = 0; power < 5; ++power) {
                        const auto column =
                            quartic({rows[0][power], rows[1][power], rows[2][power], rows[3][power], rows[4][power]});
                        for (std::size_t m = 0; m < 5; ++m) patch[m][power] = column[m];
                    }
                    return patch;
                };
                const Patch& own = f.bend[i * n + j] = tensor(bend[j]);
                double curve = 0;  // at the most, for |u|, |v| <= 1
                for (const auto& of_slope : own)
                    for (std::size_t power = 2; power < 5; ++power)
                        curve += std::abs(of_slope[power]) * static_cast<double>(power * (power - 1));
                f.most_curve = std::max(f.most_curve, curve / (distance_half * distance_half));
                f.stretch[i * n + j] = tensor(stretch[j]);
            }
        }
        // Between the nodes: how far off, how much slopes and spacing change.
        const int checks = 4 * pieces;
        for (int i = 0; i < checks; ++i) {
            const double slope = -1 + (2.0 * i + 0.75) / checks;
            const SpokeCourse course(data_base, params_, q, azimuth_rad(q, slope));
            const double per_post = metres_per_post(q, slope);
            for (int j = 0; j < checks; ++j) {
                const double distance = f.reach * (j + 0.375) / checks;
                const auto [true_bend, true_stretch] = at(course, slope, distance);
                const Place p = place(q, slope, distance);
                const double minor_error = std::abs(p.minor - nadir_minor(q) - slope * distance - true_bend);
                const double arc_error = std::abs(p.arc_m / per_post - distance * (1 + true_stretch));
                worst = std::max({worst, minor_error, arc_error});
                const double step = f.reach / 1024;
                const double ahead = place(q, slope, distance + step).minor;
                if (distance * per_post <= params_.max_arc_m && std::abs((ahead - p.minor) / step) > 2) throw TooBent();
                const double aside = place(q, slope + 1.0 / 1024, distance).minor;
                slack = std::max(slack, (aside - p.minor) * 1024 / distance);
            }
        }
        if (worst <= tolerance_posts / 2) {
            spacing_slack_ = std::max({spacing_slack_, 1.1, slack * 1.02});
            f.most_bend += 1;
            return;
        }
    }
}

double SpokeMap::warp(Quadrant q, double slope, double distance) const {
    // Of minor t(m) and way w(m) at one distance the derivatives, and with them d2m/dt2 = -t'' / t'^3 and d2w/dt2.
    constexpr double h = 1.0 / 32;
    const double middle = std::clamp(slope, -1 + h, 1 - h);
    const auto at = [&](double m) {
        const Place p = place(q, m, distance);
        return std::pair(p.minor, p.arc_m / metres_per_post(q, m));
    };
    const auto [t0, w0] = at(middle - h);
    const auto [t1, w1] = at(middle);
    const auto [t2, w2] = at(middle + h);
    const double dt = (t2 - t0) / (2 * h), dw = (w2 - w0) / (2 * h), ddt = (t2 - 2 * t1 + t0) / (h * h),
                 ddw = (w2 - 2 * w1 + w0) / (h * h);
    if (!(dt > 0)) return std::numeric_limits<double>::infinity();
    const double major = metres_per_post(q, 0),
                 minor = metres_per_post(lines_are_columns(q) ? Quadrant::south : Quadrant::east, 0);
    return std::max(std::abs(ddt) * minor, std::abs(ddw - dw * ddt / dt) * metres_per_post(q, middle)) /
           (dt * dt * std::max(major, minor));
}

double SpokeMap::unevenness(double length) const {
    if (straight()) return 0;
    double most = 0;
    for (Quadrant q : all_quadrants) {
        const Fit& f = fits_[static_cast<std::size_t>(q)];
        const int samples = 4 * f.slope_pieces;
        for (int i = 0; i < samples; ++i) {
            const double slope = -1 + (2.0 * i + 0.75) / samples, per_post = metres_per_post(q, slope);
            for (int j = 0; j < samples; ++j) {
                const double distance = f.reach * (j + 0.375) / samples;
                if (distance >= 1 && distance * per_post <= params_.max_arc_m)
                    most = std::max(most, warp(q, slope, distance));
            }
        }
    }
    return most * length * length / 8;
}

void SpokeMap::line(Quadrant q, double distance, double slope_lo, double slope_hi,
                    std::vector<LinePiece>& pieces) const {
    pieces.clear();
    if (straight()) {
        pieces.push_back(whole_line);
        return;
    }
    const int last = piece_of(q, slope_hi);
    for (int i = piece_of(q, slope_lo); i <= last; ++i) pieces.push_back(piece(q, i, distance));
}

int SpokeMap::piece_of(Quadrant q, double slope) const {
    const int n = fits_[static_cast<std::size_t>(q)].slope_pieces;
    const double slope_half = 1.0 / n;
    return std::clamp(static_cast<int>(std::floor((slope + 1) / (2 * slope_half))), 0, n - 1);
}

SpokeMap::LinePiece SpokeMap::piece(Quadrant q, int i, double distance) const {
    const Fit& f = fits_[static_cast<std::size_t>(q)];
    const int n = f.slope_pieces;
    const double distance_half = f.reach / (2 * f.distance_pieces), slope_half = 1.0 / n;
    const int j = std::clamp(static_cast<int>(distance / (2 * distance_half)), 0, f.distance_pieces - 1);
    const double v = distance / distance_half - (2 * j + 1);
    LinePiece p;
    p.middle = -1 + (2 * i + 1) * slope_half;
    p.scale = n;
    p.slope_begin = i == 0 ? -2 : p.middle - slope_half;
    p.slope_end = i == n - 1 ? 2 : p.middle + slope_half;
    const auto at = static_cast<std::size_t>(i * f.distance_pieces + j);
    for (std::size_t m = 0; m < 5; ++m) {
        p.bend[m] = quartic_at(f.bend[at][m], v);
        p.stretch[m] = quartic_at(f.stretch[at][m], v);
    }
    return p;
}

SpokeMap::Place SpokeMap::place(Quadrant q, double slope, double distance) const {
    const double straight_minor = nadir_minor(q) + slope * distance, plain_arc = distance * metres_per_post(q, slope);
    if (straight()) return {straight_minor, plain_arc};
    const LinePiece p = piece(q, piece_of(q, slope), distance);
    const double u = (slope - p.middle) * p.scale;
    return {straight_minor + quartic_at(p.bend, u), plain_arc * (1 + quartic_at(p.stretch, u))};
}

}  // namespace wedgescope
