#include "tiles/into_raster.hpp"

#include <algorithm>
#include <limits>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

constexpr double without_end = std::numeric_limits<double>::infinity();

OGREnvelope grown(const OGREnvelope& box, double more_x, double more_y) {
    OGREnvelope out;
    out.MinX = box.MinX - more_x;
    out.MaxX = box.MaxX + more_x;
    out.MinY = box.MinY - more_y;
    out.MaxY = box.MaxY + more_y;
    return out;
}

}  // namespace

std::vector<Ask> asks(const OGREnvelope& part, const RasterFacts& grid, bool raster_geographic,
                      const OGRCoordinateTransformation* back, bool file_geographic) {
    std::vector<Ask> out;
    // A raster may reach beyond the antimeridian; vector files end there.
    for (const double shift : {0.0, 360.0, -360.0}) {
        if (shift != 0 && !raster_geographic) continue;
        if ((shift > 0 && grid.edge_x() <= 180) || (shift < 0 && grid.corner_x >= -180)) continue;
        OGREnvelope e = part;
        e.MinX -= shift;
        e.MaxX -= shift;
        if (back) {
            double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
            GdalErrors quiet;
            constexpr int between = 21;
            if (!const_cast<OGRCoordinateTransformation*>(back)->TransformBounds(e.MinX, e.MinY, e.MaxX, e.MaxY, &x0,
                                                                                 &y0, &x1, &y1, between) ||
                !std::isfinite(x0) || !std::isfinite(y0) || !std::isfinite(x1) || !std::isfinite(y1)) {
                out.push_back({std::nullopt, shift});
                continue;
            }
            // Bounds are found at points between; what is between these is less than a part in twenty of the window off.
            const bool across = file_geographic && x0 > x1;  // the antimeridian
            const double wide = across ? x1 + 360 - x0 : x1 - x0, high = y1 - y0;
            OGREnvelope bounds;
            bounds.MinX = x0;
            bounds.MaxX = x1;
            bounds.MinY = y0;
            bounds.MaxY = y1;
            e = grown(bounds, 0.05 * wide, 0.05 * high);
            const OGREnvelope near = grown(bounds, 0.3 * wide, 0.3 * high);
            if (!across) {
                out.push_back({e, shift, near});
                continue;
            }
            Ask west{e, shift, near}, east = west;
            west.in->MinX = -180;
            west.near.MinX = -without_end;
            east.in->MaxX = 180;
            east.near.MaxX = without_end;
            out.push_back(west);
            out.push_back(east);
            continue;
        }
        out.push_back({e, shift});
    }
    return out;
}

namespace {

/// What of a file lies near the raster, in all windows alike: what is farther may have no place in the raster's CRS.
OGREnvelope near_raster(const RasterFacts& grid, double shift, bool raster_geographic,
                        const OGRCoordinateTransformation* back, bool file_geographic) {
    OGREnvelope whole, out;
    whole.Merge(grid.corner_x, grid.corner_y);
    whole.Merge(grid.edge_x(), grid.edge_y());
    out.MinX = out.MinY = -without_end;
    out.MaxX = out.MaxY = without_end;
    for (const Ask& ask : asks(whole, grid, raster_geographic, back, file_geographic)) {
        if (ask.shift_x != shift || !ask.in) continue;
        out.MinY = ask.near.MinY;
        out.MaxY = ask.near.MaxY;
        // Across the antimeridian there are two, one to either side.
        if (std::isfinite(ask.near.MinX) && std::isfinite(ask.near.MaxX)) {
            out.MinX = ask.near.MinX;
            out.MaxX = ask.near.MaxX;
        }
    }
    return out;
}

/// Twenty degrees of longitude at the raster's middle, in a file's units: an edge no longer than that cannot be taken for one that
/// goes round the other side of the earth. Infinite where that has no place in the file's CRS.
double part_of_circle(const RasterFacts& grid, OGRCoordinateTransformation& back) {
    GdalErrors quiet;
    const double middle = (grid.corner_x + grid.edge_x()) / 2,
                 lat = grid.corner_y + static_cast<double>(grid.rows) / 2 * grid.step_y;
    double x[] = {middle - 10, middle + 10}, y[] = {lat, lat};
    int good[] = {0, 0};
    back.Transform(2, x, y, nullptr, good);
    const double apart = std::hypot(x[1] - x[0], y[1] - y[0]);
    return good[0] && good[1] && std::isfinite(apart) && apart > 0 ? apart : without_end;
}

void cut(std::unique_ptr<OGRGeometry>& geometry, const OGREnvelope& to, Cut how, double straight) {
    OGREnvelope own;
    geometry->getEnvelope(&own);
    if (!to.Contains(own)) geometry = clipped(*geometry, to, how);
    if (geometry && std::isfinite(straight)) geometry->segmentize(straight);
}

}  // namespace

std::unique_ptr<OGRGeometry> IntoRaster::bring(std::unique_ptr<OGRGeometry> geometry, const Ask& ask,
                                               const std::string& where, const GdalErrors& errors) {
    if (geometry->hasCurveGeometry()) geometry.reset(geometry->getLinearGeometry());
    if (!all_finite(*geometry)) throw DataError(text(where, " it has places that are not finite"));
    if (to_raster_) {
        const Surroundings& ground = surroundings(ask.shift_x);
        // Twice: what a cut adds bends too, away from the window.
        cut(geometry, ground.near, Cut::at_sides, ground.straight);
        if (geometry && ask.in) cut(geometry, ask.near, Cut::whole_edges, ground.straight);
        if (!geometry) return nullptr;
        const std::unique_ptr<OGRGeometry> before(raster_geographic_ && file_geographic_ ? geometry->clone() : nullptr);
        if (geometry->transform(to_raster_) != OGRERR_NONE)
            throw DataError(text(where, " PROJ cannot bring its places into the terrain's CRS: ", errors.reason()));
        if (raster_geographic_)
            follow_longitudes(*geometry, before.get(), (grid_.corner_x + grid_.edge_x()) / 2 - ask.shift_x);
    }
    return geometry;
}

const IntoRaster::Surroundings& IntoRaster::surroundings(double shift_x) {
    if (!surroundings_ || surroundings_->shift_x != shift_x) {
        GdalErrors quiet;
        surroundings_ = {shift_x, near_raster(grid_, shift_x, raster_geographic_, back_, file_geographic_),
                         straight_length(grid_, *back_, *to_raster_, file_geographic_)};
        if (raster_geographic_ && !file_geographic_)
            surroundings_->straight = std::min(surroundings_->straight, part_of_circle(grid_, *back_));
    }
    return *surroundings_;
}

Window cells_of(const OGREnvelope& box, const ToCells& to, const Window& window) {
    constexpr std::int64_t margin = 2;
    const auto cells = [](double a, double b, Interval most) {
        const double low = std::floor(std::min(a, b)), high = std::floor(std::max(a, b));
        const auto clamped = [&](double v) {
            return static_cast<std::int64_t>(
                std::clamp(v, static_cast<double>(most.begin - margin), static_cast<double>(most.end + margin)));
        };
        return Interval{clamped(low - 1), clamped(high + 2)};
    };
    return {cells(to.column_at(box.MinX), to.column_at(box.MaxX), window.columns),
            cells(to.row_at(box.MinY), to.row_at(box.MaxY), window.rows)};
}

OGREnvelope touched_by(const RasterFacts& grid, const Window& window) {
    const auto x_at = [&](std::int64_t c) { return grid.corner_x + static_cast<double>(c) * grid.step_x; };
    const auto y_at = [&](std::int64_t r) { return grid.corner_y + static_cast<double>(r) * grid.step_y; };
    OGREnvelope part;
    part.Merge(x_at(window.columns.begin - 1), y_at(window.rows.begin - 1));
    part.Merge(x_at(window.columns.end + 1), y_at(window.rows.end + 1));
    return part;
}

}  // namespace wedgescope
