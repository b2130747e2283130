#include "tests/reference/line_of_sight.hpp"

#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <GeographicLib/Geodesic.hpp>
#include <GeographicLib/GeodesicLine.hpp>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace wedgescope::reference {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double equator_m = 6378137.0, flattening = 1 / 298.257223563;
constexpr double mean_m = equator_m * (1 - flattening / 3);

double euler_m(double lat_deg, double azimuth_deg) {
    const double degree = std::numbers::pi / 180, e2 = flattening * (2 - flattening);
    const double s = std::sin(lat_deg * degree), w = std::sqrt(1 - e2 * s * s);
    const double meridian = equator_m * (1 - e2) / (w * w * w), normal = equator_m / w;
    const double c = std::cos(azimuth_deg * degree), d = std::sin(azimuth_deg * degree);
    return 1 / (c * c / meridian + d * d / normal);
}

}  // namespace

struct LineOfSight::Walk {
    const Matrix& matrix;
    Grid grid;
    Sensor sensor;
    double lat = 0, lon = 0;

    /// A ray's ground track: places at arcs, straight between them or by Newton's polynomial through them.
    struct Track {
        double length_m = 0, inverse_radius = 0;
        std::vector<double> column, row;  // divided differences at Chebyshev's arcs, part of the way
        std::vector<double> node;
        std::pair<double, double> at(double part) const {
            double c = column.back(), r = row.back();
            for (std::size_t i = column.size() - 1; i-- > 0;) {
                c = column[i] + (part - node[i]) * c;
                r = row[i] + (part - node[i]) * r;
            }
            return {c, r};
        }
    };

    Track track(double column, double row) const {
        Track t;
        if (!grid.lat_lon) {
            t.length_m = std::hypot((column - sensor.column) * grid.column_m, (row - sensor.row) * grid.row_m);
            t.inverse_radius = sensor.earth_k ? 1 / (*sensor.earth_k * mean_m) : 0;
            t.node = {0, 1};
            t.column = {sensor.column, column - sensor.column};
            t.row = {sensor.row, row - sensor.row};
            return t;
        }
        const auto& geodesic = GeographicLib::Geodesic::WGS84();
        const auto there = grid.lat_lon(column, row);
        double azimuth = 0, ahead = 0;
        geodesic.Inverse(lat, lon, there->first, there->second, t.length_m, azimuth, ahead);
        t.inverse_radius = sensor.earth_k ? 1 / (*sensor.earth_k * euler_m(lat, azimuth)) : 0;
        const GeographicLib::GeodesicLine line = geodesic.Line(lat, lon, azimuth);
        constexpr int nodes = 5;
        for (int i = 0; i < nodes; ++i) {
            const double part = 0.5 - 0.5 * std::cos(std::numbers::pi * i / (nodes - 1));
            double a = 0, b = 0;
            line.Position(part * t.length_m, a, b);
            const auto [c, r] = i == 0           ? std::pair(sensor.column, sensor.row)
                                : i == nodes - 1 ? std::pair(column, row)
                                                 : grid.column_row(a, b);
            t.node.push_back(part);
            t.column.push_back(c);
            t.row.push_back(r);
        }
        for (std::size_t level = 1; level < t.node.size(); ++level)
            for (std::size_t i = t.node.size(); i-- > level;) {
                t.column[i] = (t.column[i] - t.column[i - 1]) / (t.node[i] - t.node[i - level]);
                t.row[i] = (t.row[i] - t.row[i - 1]) / (t.node[i] - t.node[i - level]);
            }
        return t;
    }

    /// up and out of a point in the sensor's vertical plane (exact, cancellation-free).
    std::pair<double, double> seat(double arc, double height, double k) const {
        if (k == 0) return {height - sensor.height_m, arc};
        const double theta = arc * k, half = std::sin(0.5 * theta);
        return {height - sensor.height_m - 2 * half * half * (1 / k + height), (1 / k + height) * std::sin(theta)};
    }

    /// Height of the ray of tangent `t` over arc s.
    double ray(double arc, double t, double k) const {
        if (k == 0) return sensor.height_m + t * arc;
        // up = t out:  (h - hs) - q (R + h) = t (R + h) sin(theta), q = 2 sin^2(theta / 2)
        const double theta = arc * k, half = std::sin(0.5 * theta), q = 2 * half * half, s = std::sin(theta);
        return (sensor.height_m + (q + t * s) / k) / (1 - q - t * s);
    }
};

LineOfSight::LineOfSight(const Matrix& matrix, const Grid& grid, const Sensor& sensor)
    : walk_(new Walk{matrix, grid, sensor}) {
    if (grid.lat_lon) std::tie(walk_->lat, walk_->lon) = *grid.lat_lon(sensor.column, sensor.row);
}
LineOfSight::~LineOfSight() = default;

double LineOfSight::ground(const Matrix& m, double column, double row) {
    const auto c = static_cast<std::int64_t>(std::floor(column)), r = static_cast<std::int64_t>(std::floor(row));
    const double u = column - static_cast<double>(c), v = row - static_cast<double>(r);
    double sum = 0;
    for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 2; ++i) {
            const double weight = (i ? u : 1 - u) * (j ? v : 1 - v);
            if (weight > 0) sum += weight * m.at(c + i, r + j);
        }
    return sum;
}

Verdict LineOfSight::look(std::int64_t column, std::int64_t row) const {
    const Walk& w = *walk_;
    Verdict verdict;
    const double own = w.matrix.at(column, row);
    if (std::isnan(own)) return verdict;
    const double top = own + w.sensor.target_m;
    const auto x = static_cast<double>(column), y = static_cast<double>(row);
    verdict.state = Verdict::seen;
    if (x == w.sensor.column && y == w.sensor.row) {
        verdict.slant_range_m = w.sensor.height_m - top;
        verdict.depression_deg = 90;
        return verdict;
    }
    const Walk::Track track = w.track(x, y);
    const auto [up, out] = w.seat(track.length_m, top, track.inverse_radius);
    const double tangent = up / out;
    verdict.slant_range_m = std::hypot(up, out);
    verdict.depression_deg = -std::atan2(up, out) * 180 / std::numbers::pi;

    // Parts of the way at which the track crosses lines of posts.
    std::vector<double> parts{0};
    const auto crossings = [&](bool columns) {
        const double from = columns ? w.sensor.column : w.sensor.row, to = columns ? x : y;
        const auto value = [&](double part) {
            const auto at = track.at(part);
            return columns ? at.first : at.second;
        };
        // Monotone pieces, found on a coarse ladder. In each the next crossing is guessed from the last two and
        // corrected; where that fails it is found by halves.
        constexpr int ladder = 64;
        double a = 0, fa = from;
        for (int i = 1; i <= ladder; ++i) {
            const double b = static_cast<double>(i) / ladder, fb = i == ladder ? to : value(b);
            const double lo = std::min(fa, fb), hi = std::max(fa, fb), sign = fb > fa ? 1 : -1;
            double guess = nan, rate = (b - a) / (fb - fa);
            for (double line = fb > fa ? std::floor(lo) + 1 : std::ceil(hi) - 1; line > lo && line < hi; line += sign) {
                double root = std::isnan(guess) ? a + (line - fa) * rate : guess, miss = value(root) - line;
                for (int turn = 0; turn < 8 && std::abs(miss) >= 1e-9; ++turn) {
                    const double next = root - miss * rate, next_miss = value(next) - line;
                    if (next_miss != miss) rate = (next - root) / (next_miss - miss);
                    root = next;
                    miss = next_miss;
                }
                if (!(std::abs(miss) < 1e-9 && root >= a && root <= b)) {
                    double p = a, q = b;
                    for (int turn = 0; turn < 60; ++turn) {
                        root = 0.5 * (p + q);
                        ((value(root) < line) == (fa < line) ? p : q) = root;
                    }
                    rate = (b - a) / (fb - fa);
                }
                parts.push_back(root);
                guess = root + rate * sign;
            }
            if (fb == std::floor(fb) && i < ladder) parts.push_back(b);
            a = b;
            fa = fb;
        }
    };
    crossings(true);
    const auto middle = static_cast<std::ptrdiff_t>(parts.size());
    crossings(false);
    std::inplace_merge(parts.begin(), parts.begin() + middle, parts.end());
    parts.push_back(1);

    // In each cell: the surface along the straight chord is a parabola, the ray all but straight.
    // Level with its horizon a post is seen.
    const double slack = 1e-7 + 1e-12 * std::abs(w.sensor.height_m);
    auto before = track.at(0);
    for (std::size_t i = 1; i < parts.size(); ++i) {
        const double p0 = parts[i - 1], p1 = parts[i];
        const auto here = i + 1 == parts.size() ? std::pair(x, y) : track.at(p1);
        if (p1 - p0 < 1e-12) {
            before = here;
            continue;
        }
        const double mc = 0.5 * (before.first + here.first), mr = 0.5 * (before.second + here.second);
        const auto c = static_cast<std::int64_t>(std::floor(mc)), r = static_cast<std::int64_t>(std::floor(mr));
        // On a line of posts to rounding: the cell does not matter then, the line's posts do.
        const auto height = [&](double column_at, double row_at) {
            double u = std::clamp(column_at - static_cast<double>(c), 0.0, 1.0),
                   v = std::clamp(row_at - static_cast<double>(r), 0.0, 1.0);
            if (u < 1e-9) u = 0;
            if (u > 1 - 1e-9) u = 1;
            if (v < 1e-9) v = 0;
            if (v > 1 - 1e-9) v = 1;
            double sum = 0;
            for (int b = 0; b < 2; ++b)
                for (int a = 0; a < 2; ++a) {
                    const double weight = (a ? u : 1 - u) * (b ? v : 1 - v);
                    if (weight > 0) sum += weight * w.matrix.at(c + a, r + b);
                }
            return sum;
        };
        const double h0 = height(before.first, before.second),
                     h1 = i + 1 == parts.size() ? own : height(here.first, here.second), hm = height(mc, mr);
        const double s0 = p0 * track.length_m, s1 = p1 * track.length_m;
        const double f0 = i == 1 ? w.sensor.height_m - h0 : w.ray(s0, tangent, track.inverse_radius) - h0;
        const double f1 = i + 1 == parts.size() ? w.sensor.target_m : w.ray(s1, tangent, track.inverse_radius) - h1;
        double least = nan;
        if (!std::isnan(f0)) least = f0;
        if (!std::isnan(f1)) least = std::isnan(least) ? f1 : std::min(least, f1);
        const double bump = hm - 0.5 * (h0 + h1);
        if (!std::isnan(f0) && !std::isnan(f1) && !std::isnan(bump)) {
            // f(u) = f0 + b u + a u^2
            const double a = 4 * bump, b = f1 - f0 - a;
            if (a > 0 && b < 0 && b + 2 * a > 0) least = std::min(least, f0 - b * b / (4 * a));
        }
        if (least < verdict.clearance_m) verdict.clearance_m = least;
        before = here;
        if (verdict.clearance_m < -slack && !w.sensor.whole_way) break;
    }
    if (verdict.clearance_m < -slack) verdict.state = Verdict::hidden;
    return verdict;
}

Raster read(const std::string& path, bool geodesic) {
    GDALAllRegister();
    std::unique_ptr<GDALDataset> data(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER));
    if (!data) throw std::runtime_error("cannot open " + path);
    GDALRasterBand* band = data->GetRasterBand(1);
    Raster out;
    out.matrix.columns = data->GetRasterXSize();
    out.matrix.rows = data->GetRasterYSize();
    out.matrix.height.resize(static_cast<std::size_t>(out.matrix.columns * out.matrix.rows));
    const int n = data->GetRasterXSize(), m = data->GetRasterYSize();
    if (band->RasterIO(GF_Read, 0, 0, n, m, out.matrix.height.data(), n, m, GDT_Float64, 0, 0) != CE_None)
        throw std::runtime_error("cannot read " + path);
    int any = 0;
    const double none = band->GetNoDataValue(&any);
    const double scale = band->GetScale(), offset = band->GetOffset();
    for (double& z : out.matrix.height) z = (any && z == none) || z < -1e30 ? nan : scale * z + offset;
    double t[6];
    data->GetGeoTransform(t);
    out.grid.column_m = t[1];
    out.grid.row_m = t[5];
    out.post_m = std::abs(t[1]);
    if (!geodesic) return out;
    const auto crs = std::make_shared<OGRSpatialReference>(*data->GetSpatialRef());
    crs->SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    const double corner_x = t[0], corner_y = t[3], step_x = t[1], step_y = t[5];
    if (crs->IsGeographic()) {
        out.grid.lat_lon = [=](double c, double r) {
            return std::optional(std::pair(corner_y + (r + 0.5) * step_y, corner_x + (c + 0.5) * step_x));
        };
        out.grid.column_row = [=](double lat, double lon) {
            return std::pair((lon - corner_x) / step_x - 0.5, (lat - corner_y) / step_y - 0.5);
        };
        return out;
    }
    OGRSpatialReference wgs84;
    wgs84.importFromEPSG(4326);
    wgs84.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    const std::shared_ptr<OGRCoordinateTransformation> to(OGRCreateCoordinateTransformation(crs.get(), &wgs84)),
        from(OGRCreateCoordinateTransformation(&wgs84, crs.get()));
    out.grid.lat_lon = [=](double c, double r) -> std::optional<std::pair<double, double>> {
        double px = corner_x + (c + 0.5) * step_x, py = corner_y + (r + 0.5) * step_y;
        if (!to->Transform(1, &px, &py)) return std::nullopt;
        return std::pair(py, px);
    };
    out.grid.column_row = [=](double lat, double lon) {
        double px = lon, py = lat;
        from->Transform(1, &px, &py);
        return std::pair((px - corner_x) / step_x - 0.5, (py - corner_y) / step_y - 0.5);
    };
    return out;
}

}  // namespace wedgescope::reference
