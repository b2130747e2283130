// Point file: points of any vector file that GDAL opens (GeoPackage, GeoJSON, shapefile, ...), one after the other, in
// latitude and longitude or in the terrain raster's own coordinates. Leaves what their fields mean to tools/observer_file.hpp.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lib/wedge_source.hpp"

namespace wedgescope {

struct PointRow {
    std::int64_t feature = 0;                        ///< number in the file
    double first = 0, second = 0;                    ///< latitude and longitude, degrees, or x and y
    std::vector<std::optional<std::string>> values;  ///< of the fields chosen; none: nothing in it
};

struct PointFileParams {
    std::string role, path;  ///< role: for messages ("observers")
    std::string layer;       ///< empty: the only one
};

class PointFile {
public:
    /// Opens it. IoError if it cannot be opened; InputError for a layer that is not there or not the only one, or without
    /// geometry; DataError for a CRS that PROJ cannot turn into WGS84's or that the terrain has no way to.
    PointFile(const PointFileParams& params, const DataBase& data_base);
    ~PointFile();
    PointFile(const PointFile&) = delete;
    PointFile& operator=(const PointFile&) = delete;

    /// WGS84 latitude and longitude; else the raster's x and y: points in its CRS, or without one.
    bool lat_lon() const;
    std::vector<std::string> field_names() const;
    /// The fields whose values are wanted, by their places among the names; before read().
    void choose(std::vector<int> fields);
    /// Calls `body` for each point in the file's order; each part of a multipoint is one. DataError naming the feature for
    /// any other geometry or none, and for a place that PROJ cannot transform.
    void read(const std::function<void(const PointRow&)>& body);

private:
    struct Open;
    std::unique_ptr<Open> open_;
};

}  // namespace wedgescope
