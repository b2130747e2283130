// Georeference: between WGS84 latitude and longitude and a raster's columns and rows, exact (PROJ;
// GeographicLib where it knows the projection).
// Rasters of one CRS share what PROJ needs for it while one of them is open.
// For the .cpp files of this folder only. Leaves fitted, quick ways to lib/spoke_map.hpp.
#pragma once
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "lib/wedge_source.hpp"
#include "tiles/raster_layer.hpp"

namespace wedgescope {

class Georeference {
public:
    /// DataError if PROJ knows no way between WGS84 and the raster's CRS.
    explicit Georeference(const RasterFacts& facts);

    IndexPosition locate(double lat_deg, double lon_deg);
    /// As DataBase has it.
    double circle_columns();
    std::optional<std::pair<double, double>> lat_lon(double column, double row);

private:
    class Way;
    class ByProj;
    class ByMercator;
    static std::shared_ptr<Way> way_of(const RasterFacts& facts);
    double find_circle_x() const;
    RasterFacts facts_;
    std::shared_ptr<Way> way_;  ///< null: WGS84 itself
    std::once_flag seen_round_;
    double circle_x_ = 0;  ///< units of x round the earth, the same at every latitude; 0: not so
};

/// The grid of the terrain's posts and where it lies on earth; nothing about culture.
DataBase describe(const RasterFacts& facts);

}  // namespace wedgescope
