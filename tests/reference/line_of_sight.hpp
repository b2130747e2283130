// The slow reference of coverage: one ray after another, walked cell by cell over the bilinear surface in double
// precision. It shares no code with lib/, tiles/ or tools/.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace wedgescope::reference {

/// Heights of a matrix of posts, metres, NaN = void; row after row.
struct Matrix {
    std::int64_t columns = 0, rows = 0;
    std::vector<double> height;
    double at(std::int64_t c, std::int64_t r) const {
        if (c < 0 || r < 0 || c >= columns || r >= rows) return std::numeric_limits<double>::quiet_NaN();
        return height[static_cast<std::size_t>(r * columns + c)];
    }
};

/// Where posts are: on a plane (metres east and north of post 0, 0 by column and row), or on WGS84.
struct Grid {
    double column_m = 1, row_m = -1;
    /// Place on the grid -> latitude, longitude (degrees), and back. With these sight lines stand over geodesics.
    std::function<std::optional<std::pair<double, double>>(double column, double row)> lat_lon;
    std::function<std::pair<double, double>(double lat, double lon)> column_row;
};

struct Sensor {
    double column = 0, row = 0;
    double height_m = 0;            ///< above sea level
    std::optional<double> earth_k;  ///< of the mean radius on a plane, of Euler's on WGS84; none: flat
    double target_m = 0;            ///< raises the post that is looked at
    bool whole_way = false;         ///< else a walk ends where its ray is hidden, and clearance says only that
};

struct Verdict {
    enum State { no_data, hidden, seen } state = no_data;
    /// Least height of the ray above the surface, metres; below 0: hidden by so much.
    double clearance_m = std::numeric_limits<double>::infinity();
    double slant_range_m = 0, depression_deg = 0;
};

/// A matrix of heights in metres (no-data and NaN void; scale and offset applied; no mask, no unit) and its grid.
struct Raster {
    Matrix matrix;
    Grid grid;
    double post_m = 0;
};
Raster read(const std::string& path, bool geodesic);

class LineOfSight {
public:
    LineOfSight(const Matrix& matrix, const Grid& grid, const Sensor& sensor);
    ~LineOfSight();
    /// From several threads at once only on a plane.
    Verdict look(std::int64_t column, std::int64_t row) const;
    /// Bilinear height; NaN over a void or outside.
    static double ground(const Matrix& matrix, double column, double row);

private:
    struct Walk;
    std::unique_ptr<Walk> walk_;
};

}  // namespace wedgescope::reference
