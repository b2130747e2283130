// IntoRaster: where the features of a vector file lie on a raster, in its CRS and in its cells.
// For the .cpp files of this folder only. Leaves what features say to feature_file.hpp, and how edges bend to straight_edges.hpp.
#pragma once
#include <ogr_geometry.h>
#include <ogr_spatialref.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lib/interval.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/raster_layer.hpp"
#include "tiles/straight_edges.hpp"

namespace wedgescope {

/// Of a raster: x, y of its CRS to columns and rows of a window, as GDAL asks for it. Rounded to a 2^-20 of a cell before the
/// window is taken off, which is exact: a geometry lies alike in all windows.
struct ToCells {
    double corner_x, corner_y, step_x, step_y;
    double shift_x;
    std::int64_t column, row;

    double column_at(double x) const { return round((x + shift_x - corner_x) / step_x); }
    double row_at(double y) const { return round((y - corner_y) / step_y); }
    static double round(double cells) { return std::nearbyint(cells * 0x1p20) * 0x1p-20; }

    static int transform(void* argument, int, int n, double* x, double* y, double*, int* good) {
        const auto& self = *static_cast<const ToCells*>(argument);
        for (int i = 0; i < n; ++i) {
            x[i] = self.column_at(x[i]) - static_cast<double>(self.column);
            y[i] = self.row_at(y[i]) - static_cast<double>(self.row);
            good[i] = std::isfinite(x[i]) && std::isfinite(y[i]);
        }
        return TRUE;
    }
};

/// Features to be asked for, and how far east of the file's place they lie on the raster (whole circles).
struct Ask {
    std::optional<OGREnvelope> in;  ///< in the file's coordinates; none: all
    double shift_x = 0;
    /// With `in`, and so much more that polygons may be cut along its sides; endless over the antimeridian.
    OGREnvelope near{};
};

/// Where features lie that may fall into a part of the raster.
std::vector<Ask> asks(const OGREnvelope& part, const RasterFacts& grid, bool raster_geographic,
                      const OGRCoordinateTransformation* back, bool file_geographic);

/// The window and a cell more round it, in the raster's CRS: what touches counts.
OGREnvelope touched_by(const RasterFacts& grid, const Window& window);

/// Cells that a geometry within `box` may lie in, as far as two beyond a window, so that what GDAL clips at its edge shows in none.
Window cells_of(const OGREnvelope& box, const ToCells& to, const Window& window);

/// Brings geometries of a layer into the raster's CRS. What is far from the raster may have no place there and is cut off before.
class IntoRaster {
public:
    /// Transformations of the layer's CRS, null where it is the raster's.
    IntoRaster(const RasterFacts& grid, bool raster_geographic, OGRCoordinateTransformation* to_raster,
               OGRCoordinateTransformation* back, bool file_geographic)
        : grid_(grid), raster_geographic_(raster_geographic), to_raster_(to_raster), back_(back),
          file_geographic_(file_geographic) {}

    /// Null where nothing of it lies near what is asked for. `where` names it in a DataError: not all of it is finite, or PROJ
    /// has no place for it.
    std::unique_ptr<OGRGeometry> bring(std::unique_ptr<OGRGeometry> geometry, const Ask& ask, const std::string& where,
                                       const GdalErrors& errors);

private:
    struct Surroundings {
        double shift_x;
        OGREnvelope near;  ///< as near_raster()
        double straight;   ///< as straight_length(), and no more than a small part of the circle
    };
    const RasterFacts& grid_;
    bool raster_geographic_;
    OGRCoordinateTransformation *to_raster_, *back_;
    bool file_geographic_;
    std::optional<Surroundings> surroundings_;

    const Surroundings& surroundings(double shift_x);
};

}  // namespace wedgescope
