#include "tiles/straight_edges.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace wedgescope {
namespace {

using Points = std::vector<OGRRawPoint>;

std::optional<OGRRawPoint> brought(OGRCoordinateTransformation& way, OGRRawPoint at) {
    int good = 0;
    way.Transform(1, &at.x, &at.y, nullptr, &good);
    if (!good || !std::isfinite(at.x) || !std::isfinite(at.y)) return std::nullopt;
    return at;
}

/// What lies on one side of a line along an axis.
struct HalfPlane {
    double OGRRawPoint::*across;
    double OGRRawPoint::*along;
    double bound;
    double side;  ///< 1: above it, -1: below

    bool holds(const OGRRawPoint& p) const { return side * (p.*across - bound) >= 0; }
    OGRRawPoint crossing(const OGRRawPoint& a, const OGRRawPoint& b) const {
        OGRRawPoint p;
        p.*across = bound;
        p.*along = a.*along + (bound - a.*across) / (b.*across - a.*across) * (b.*along - a.*along);
        return p;
    }
};

std::array<HalfPlane, 4> sides_of(const OGREnvelope& box) {
    constexpr auto x = &OGRRawPoint::x, y = &OGRRawPoint::y;
    return {{{x, y, box.MinX, 1}, {x, y, box.MaxX, -1}, {y, x, box.MinY, 1}, {y, x, box.MaxY, -1}}};
}

Points points_of(const OGRSimpleCurve& curve) {
    Points points(static_cast<std::size_t>(curve.getNumPoints()));
    if (!points.empty()) curve.getPoints(points.data());
    return points;
}

/// `whole`: an edge that crosses a side goes on to its own end outside; from there the ring leads to where the next one comes in,
/// outside too. Without, it ends at the side.
Points cut_ring(Points ring, const OGREnvelope& box, Cut cut) {
    for (const HalfPlane& half : sides_of(box)) {
        Points kept;
        for (std::size_t i = 0; i < ring.size(); ++i) {
            const OGRRawPoint &from = ring[i > 0 ? i - 1 : ring.size() - 1], &to = ring[i];
            const bool out = !half.holds(from), in = half.holds(to);
            if (out == in) kept.push_back(cut == Cut::at_sides ? half.crossing(from, to) : out ? from : to);
            if (in) kept.push_back(to);
        }
        ring = std::move(kept);
    }
    return ring;
}

/// GDAL draws an edge from the cell of one end to that of the other: another end would be another line.
std::vector<Points> cut_line(const Points& line, const OGREnvelope& box, Cut cut) {
    std::vector<Points> pieces{line};
    for (const HalfPlane& half : sides_of(box)) {
        std::vector<Points> kept;
        for (const Points& piece : pieces) {
            bool open = false;
            for (std::size_t i = 1; i < piece.size(); ++i) {
                const OGRRawPoint &from = piece[i - 1], &to = piece[i];
                const bool first_in = half.holds(from), last_in = half.holds(to);
                const auto end = [&](const OGRRawPoint& p, bool in) {
                    return in || cut == Cut::whole_edges ? p : half.crossing(from, to);
                };
                if ((first_in || last_in) && !open) kept.push_back({end(from, first_in)});
                if (first_in || last_in) kept.back().push_back(end(to, last_in));
                open = last_in;
            }
        }
        pieces = std::move(kept);
    }
    return pieces;
}

void add_pieces(const OGRLineString& line, const OGREnvelope& box, Cut cut, OGRGeometryCollection& to) {
    for (const Points& piece : cut_line(points_of(line), box, cut)) {
        auto part = std::make_unique<OGRLineString>();
        part->setPoints(static_cast<int>(piece.size()), piece.data());
        to.addGeometryDirectly(part.release());
    }
}

std::unique_ptr<OGRPolygon> cut_polygon(const OGRPolygon& polygon, const OGREnvelope& box, Cut cut) {
    auto out = std::make_unique<OGRPolygon>();
    for (const OGRLinearRing* ring : polygon) {
        const Points points = cut_ring(points_of(*ring), box, cut);
        if (points.size() < 3) {
            if (out->IsEmpty()) return nullptr;  // nothing of the outer ring
            continue;
        }
        auto part = std::make_unique<OGRLinearRing>();
        part->setPoints(static_cast<int>(points.size()), points.data());
        part->closeRings();
        out->addRingDirectly(part.release());
    }
    return out->IsEmpty() ? nullptr : std::move(out);
}

/// The same longitude, at most half a circle from another.
double beside(double x, double other) { return x + 360 * std::round((other - x) / 360); }

enum class Ends { open, ring };
void follow_curve(OGRSimpleCurve& curve, const OGRSimpleCurve* before, double middle, Ends ends) {
    Points points = points_of(curve);
    const Points own = before ? points_of(*before) : Points();
    double sum_y = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        points[i].x = beside(points[i].x, i < own.size() ? own[i].x : points[i > 0 ? i - 1 : 0].x);
        sum_y += points[i].y;
    }
    if (!before && !points.empty()) {
        const auto [low, high] = std::minmax_element(
            points.begin(), points.end(), [](const OGRRawPoint& a, const OGRRawPoint& b) { return a.x < b.x; });
        const double own_middle = (low->x + high->x) / 2, turn = beside(own_middle, middle) - own_middle;
        for (OGRRawPoint& p : points) p.x += turn;
    }
    if (ends == Ends::ring && !points.empty() && std::abs(points.back().x - points.front().x) > 180) {
        const double pole = sum_y > 0 ? 90 : -90, first = points.front().x, last = points.back().x;
        points.insert(points.end(), {{last, pole}, {first, pole}, points.front()});
    }
    curve.setPoints(static_cast<int>(points.size()), points.data());
}

void follow_polygon(OGRPolygon& polygon, const OGRPolygon* before, double middle) {
    int number = 0;
    for (OGRLinearRing* ring : polygon) {
        const bool shell = number == 0;
        const OGRLinearRing* const own = !before ? nullptr
                                         : shell ? before->getExteriorRing()
                                                 : before->getInteriorRing(number - 1);
        follow_curve(*ring, own, middle, Ends::ring);
        if (shell) {
            OGREnvelope box;
            ring->getEnvelope(&box);
            middle = (box.MinX + box.MaxX) / 2;
        }
        ++number;
    }
}

}  // namespace

void follow_longitudes(OGRGeometry& geometry, const OGRGeometry* before, double middle) {
    switch (wkbFlatten(geometry.getGeometryType())) {
        case wkbPoint: {
            OGRPoint& point = *geometry.toPoint();
            if (!point.IsEmpty()) point.setX(beside(point.getX(), before ? before->toPoint()->getX() : middle));
            break;
        }
        case wkbLineString:
            follow_curve(*geometry.toLineString(), before ? before->toLineString() : nullptr, middle, Ends::open);
            break;
        case wkbPolygon:
            follow_polygon(*geometry.toPolygon(), before ? before->toPolygon() : nullptr, middle);
            break;
        case wkbMultiPoint:
        case wkbMultiLineString:
        case wkbMultiPolygon:
        case wkbGeometryCollection: {
            OGRGeometryCollection& parts = *geometry.toGeometryCollection();
            for (int i = 0; i < parts.getNumGeometries(); ++i)
                follow_longitudes(*parts.getGeometryRef(i),
                                  before ? before->toGeometryCollection()->getGeometryRef(i) : nullptr, middle);
            break;
        }
        default:
            break;
    }
}

bool all_finite(const OGRGeometry& geometry) {
    const auto finite = [](const OGRSimpleCurve& curve) {
        return std::ranges::all_of(points_of(curve),
                                   [](const OGRRawPoint& p) { return std::isfinite(p.x) && std::isfinite(p.y); });
    };
    switch (wkbFlatten(geometry.getGeometryType())) {
        case wkbPoint:
            return std::isfinite(geometry.toPoint()->getX()) && std::isfinite(geometry.toPoint()->getY());
        case wkbLineString:
            return finite(*geometry.toLineString());
        case wkbPolygon:
            return std::ranges::all_of(*geometry.toPolygon(), [&](const OGRLinearRing* ring) { return finite(*ring); });
        case wkbMultiPoint:
        case wkbMultiLineString:
        case wkbMultiPolygon:
        case wkbGeometryCollection:
            return std::ranges::all_of(*geometry.toGeometryCollection(),
                                       [](const OGRGeometry* part) { return all_finite(*part); });
        default:
            return true;
    }
}

double straight_length(const RasterFacts& grid, OGRCoordinateTransformation& back, OGRCoordinateTransformation& there,
                       bool file_geographic) {
    constexpr double most_bend = 0.01, trial = 32;  // cells
    constexpr double most_pieces = 65536;           // across the raster; near a pole edges bend without end
    double least = std::numeric_limits<double>::infinity(), across = 0;
    const auto between = [](const OGRRawPoint& a, const OGRRawPoint& b, bool geographic) {
        return OGRRawPoint{geographic ? std::remainder(b.x - a.x, 360.0) : b.x - a.x, b.y - a.y};
    };
    const auto place = [&](double column, double row) {
        return brought(back, {grid.corner_x + column * grid.step_x, grid.corner_y + row * grid.step_y});
    };
    const auto columns = static_cast<double>(grid.columns), rows = static_cast<double>(grid.rows);
    const auto middle = place(0.5 * columns, 0.5 * rows);
    for (const double v : {0.0, 0.5, 1.0})
        for (const double u : {0.0, 0.5, 1.0}) {
            const auto at = place(u * columns, v * rows), right = place(u * columns + trial, v * rows),
                       down = place(u * columns, v * rows + trial);
            if (!at || !right || !down) continue;
            if (middle) {
                const OGRRawPoint half = between(*middle, *at, file_geographic);
                across = std::max(across, 2 * std::hypot(half.x, half.y));
            }
            const OGRRawPoint a = between(*at, *right, file_geographic), b = between(*at, *down, file_geographic);
            for (const OGRRawPoint& half :
                 {a, b, OGRRawPoint{a.x + b.x, a.y + b.y}, OGRRawPoint{a.x - b.x, a.y - b.y}}) {
                const auto from = brought(there, {at->x - half.x, at->y - half.y}), own = brought(there, *at),
                           to = brought(there, {at->x + half.x, at->y + half.y});
                if (!from || !own || !to) continue;
                const OGRRawPoint before = between(*own, *from, grid.geographic),
                                  behind = between(*own, *to, grid.geographic);
                const double bend =
                    0.5 * std::hypot((before.x + behind.x) / grid.step_x, (before.y + behind.y) / grid.step_y);
                constexpr double nothing = 1e-7;  // what rounding makes
                if (bend > nothing)
                    least = std::min(least, 2 * std::hypot(half.x, half.y) * std::sqrt(most_bend / bend));
            }
        }
    return std::max(least, across / most_pieces);
}

std::unique_ptr<OGRGeometry> clipped(const OGRGeometry& geometry, const OGREnvelope& box, Cut cut) {
    OGREnvelope own;
    geometry.getEnvelope(&own);
    if (box.Contains(own)) return std::unique_ptr<OGRGeometry>(geometry.clone());
    if (!box.Intersects(own)) return nullptr;
    switch (wkbFlatten(geometry.getGeometryType())) {
        case wkbLineString: {
            auto lines = std::make_unique<OGRMultiLineString>();
            add_pieces(*geometry.toLineString(), box, cut, *lines);
            if (lines->IsEmpty()) return nullptr;
            return lines;
        }
        case wkbPolygon:
            return cut_polygon(*geometry.toPolygon(), box, cut);
        case wkbMultiPoint:
        case wkbMultiLineString:
        case wkbMultiPolygon:
        case wkbGeometryCollection: {
            // Of the same kind: what of it overlaps is GDAL's to say.
            std::unique_ptr<OGRGeometry> kind(
                OGRGeometryFactory::createGeometry(wkbFlatten(geometry.getGeometryType())));
            OGRGeometryCollection& out = *kind->toGeometryCollection();
            for (const OGRGeometry* part : *geometry.toGeometryCollection()) {
                if (wkbFlatten(part->getGeometryType()) == wkbLineString)
                    add_pieces(*part->toLineString(), box, cut, out);
                else if (auto kept = clipped(*part, box, cut))
                    out.addGeometryDirectly(kept.release());
            }
            if (out.IsEmpty()) return nullptr;
            return kind;
        }
        default:
            return std::unique_ptr<OGRGeometry>(geometry.clone());
    }
}

}  // namespace wedgescope
