// Geolocation array: where the cells of a raster lie that is no map, in `<file>.geoloc.tif` beside it. For the .cpp files of this
// folder only. Leaves the places themselves to ground_places.hpp.
#pragma once
#include <cstdint>
#include <functional>
#include <string>

#include "tiles/ground_places.hpp"
#include "tiles/raster_metadata.hpp"

namespace wedgescope {

/// Node (i, j) of the array stands at the corner of cells at column `i * column_step`, row `j * row_step` of the
/// raster: GDAL's default convention. Corners, not centres: so the array of a full circle closes.
struct GeolocationGrid {
    std::int64_t columns = 0, rows = 0;
    std::int64_t column_step = 1, row_step = 1;
    /// Writes the places of the `columns` nodes at a row of the raster; asked for several rows at once.
    std::function<void(double row, Place* places)> find_row;
    bool packed = true;   ///< else as it is: packing takes longer than finding the places
    bool closed = false;  ///< the last row of nodes stands where the first one does
    int threads = 1;      ///< that find the places, each on its own
    std::string crs;      ///< anything GDAL understands; empty: a plane that is nowhere on earth
};
/// The grid for a raster of so many cells, with steps of at most these.
GeolocationGrid geolocation_grid(std::int64_t columns, std::int64_t rows, std::int64_t column_step,
                                 std::int64_t row_step);

/// Finds the places and writes them to `path`. IoError, which names the output as `final_path`.
void write_geolocation(const GeolocationGrid& grid, const std::string& path, const std::string& final_path);
/// What the raster tells of its array: items of the domain GEOLOCATION.
Metadata geolocation_metadata(const GeolocationGrid& grid, const std::string& final_path);

}  // namespace wedgescope
