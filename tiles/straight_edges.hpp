// A feature's edges are straight in the CRS of its file; in another one they bend. How finely they are cut so that pieces of
// them that are straight there lie as they do, and what of a geometry lies in a box.
// For the .cpp files of this folder only.
#pragma once
#include <ogr_geometry.h>
#include <ogr_spatialref.h>

#include <memory>

#include "tiles/raster_layer.hpp"

namespace wedgescope {

/// Length, in a file's units, of an edge that bends by no more than a hundredth of a cell anywhere on the raster; the sagitta of
/// a curve grows as the square of its chord. Infinite where nothing bends. `back` and `there`: from the raster's CRS to the
/// file's and the other way.
double straight_length(const RasterFacts& grid, OGRCoordinateTransformation& back, OGRCoordinateTransformation& there,
                       bool file_geographic);

enum class Cut {
    at_sides,    ///< edges end at the sides of the box
    whole_edges  ///< edges that may come into the box keep their ends: in every box they are the same
};
/// What of points, lines and polygons lies in a box, of polygons with connections beside it (Sutherland and Hodgman 1974, Comm.
/// ACM 17:32: rings that cross themselves are cut as well as others); null: nothing. Other geometries as they are.
std::unique_ptr<OGRGeometry> clipped(const OGRGeometry& geometry, const OGREnvelope& box, Cut cut);

/// Of a geometry brought into degrees, whose longitudes come out from -180 to 180: moves them by whole circles, so that edges do not
/// leap from one side of the earth to the other. Each is as near as can be to that of `before`, the same geometry in degrees of
/// its file; without it to that of the point before it (no edge may be as long as half a circle), the middle of each line and ring
/// to `middle`, and holes' to that of their outer ring. A ring that ends a circle from its begin goes round a pole, and is led
/// over it.
void follow_longitudes(OGRGeometry& geometry, const OGRGeometry* before, double middle);

/// x and y of points, lines and polygons.
bool all_finite(const OGRGeometry& geometry);

}  // namespace wedgescope
