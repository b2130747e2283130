#include "tests/reference/reference_engine.hpp"

#include <gdal_priv.h>
#include <ogr_spatialref.h>
#include <GeographicLib/Geodesic.hpp>
#include <GeographicLib/GeodesicLine.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <ctime>
#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <numbers>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace wedgescope::reference {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double deg = pi / 180;
constexpr double light_m_s = 299792458.0;
constexpr double wgs84_a = 6378137.0;
constexpr double wgs84_f = 1 / 298.257223563;
constexpr double mean_radius_m = wgs84_a * (1 - wgs84_f / 3);  // (2a + b) / 3
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

template <class... Parts>
[[noreturn]] void fail(const Parts&... parts) {
    std::ostringstream message;
    (message << ... << parts);
    throw std::runtime_error("reference engine: " + message.str());
}

double from_db(double db) { return std::pow(10.0, db / 10); }

// ---------------------------------------------------------------------------------------------------------
// Rasters

struct Raster {
    int columns = 0, rows = 0;
    std::array<double, 6> transform{};
    std::vector<double> value;  // NaN: void
    OGRSpatialReference crs;    // empty: none

    double at(int column, int row) const {
        return value[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                     static_cast<std::size_t>(column)];
    }
};

double metres_in_unit(const std::string& unit) {
    if (unit == "ft" || unit == "foot" || unit == "feet") return 0.3048;
    if (unit == "us-ft" || unit == "ftUS" || unit == "US survey foot") return 1200.0 / 3937.0;
    return 1;
}

/// Reads band 1 whole. Void: no-data value, mask, NaN, and anything below -1e38 (the usual float no-data,
/// written with more or fewer digits than its declaration).
Raster read_raster(const std::string& path) {
    GDALAllRegister();
    std::unique_ptr<GDALDataset> file(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_VERBOSE_ERROR));
    if (!file) fail("cannot open '", path, "'");
    Raster raster;
    raster.columns = file->GetRasterXSize();
    raster.rows = file->GetRasterYSize();
    if (file->GetGeoTransform(raster.transform.data()) != CE_None) fail("'", path, "' has no geotransform");
    if (raster.transform[2] != 0 || raster.transform[4] != 0) fail("'", path, "' is rotated");
    if (const OGRSpatialReference* crs = file->GetSpatialRef()) raster.crs = *crs;
    raster.crs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);

    const std::size_t count = static_cast<std::size_t>(raster.columns) * static_cast<std::size_t>(raster.rows);
    raster.value.resize(count);
    std::vector<std::uint8_t> mask(count, 255);
    GDALRasterBand* band = file->GetRasterBand(1);
    if (band->RasterIO(GF_Read, 0, 0, raster.columns, raster.rows, raster.value.data(), raster.columns, raster.rows,
                       GDT_Float64, 0, 0, nullptr) != CE_None)
        fail("cannot read '", path, "'");
    if ((band->GetMaskFlags() & GMF_ALL_VALID) == 0 &&
        band->GetMaskBand()->RasterIO(GF_Read, 0, 0, raster.columns, raster.rows, mask.data(), raster.columns,
                                      raster.rows, GDT_Byte, 0, 0, nullptr) != CE_None)
        fail("cannot read the mask of '", path, "'");

    int has_scale = 0, has_offset = 0, has_no_data = 0;
    const double scale = band->GetScale(&has_scale);
    const double offset = band->GetOffset(&has_offset);
    const double no_data_value = band->GetNoDataValue(&has_no_data);
    const double unit = metres_in_unit(band->GetUnitType());
    for (std::size_t i = 0; i < count; ++i) {
        double& v = raster.value[i];
        const bool is_void = mask[i] == 0 || std::isnan(v) || v < -1e38 || (has_no_data != 0 && v == no_data_value);
        if (is_void)
            v = nan;
        else
            v = unit * ((has_scale != 0 ? scale : 1) * v + (has_offset != 0 ? offset : 0));
    }
    return raster;
}

// ---------------------------------------------------------------------------------------------------------
// Ground: terrain with culture on it, in the terrain's column and row (posts at the integers)

/// Culture cell of a terrain position: cell = floor(shift + factor * post).
struct AxisMap {
    double shift = 0, factor = 1;
    double operator()(double post) const { return shift + factor * post; }
};

struct CultureGrid {
    int columns = 0, rows = 0;
    AxisMap column, row;

    CultureGrid() = default;
    CultureGrid(const Raster& culture, const Raster& dem) : columns(culture.columns), rows(culture.rows) {
        const auto& c = culture.transform;
        const auto& d = dem.transform;
        column = {(d[0] + 0.5 * d[1] - c[0]) / c[1], d[1] / c[1]};
        row = {(d[3] + 0.5 * d[5] - c[3]) / c[5], d[5] / c[5]};
    }
    /// Index of the cell that contains a terrain position; -1 outside.
    std::ptrdiff_t cell(double post_column, double post_row) const {
        const double c = std::floor(column(post_column));
        const double r = std::floor(row(post_row));
        if (!(c >= 0 && c < columns && r >= 0 && r < rows)) return -1;
        return static_cast<std::ptrdiff_t>(r) * columns + static_cast<std::ptrdiff_t>(c);
    }
};

/// A terrain cell: the square between four posts, named by the post of smallest column and row.
struct Cell {
    int column = 0, row = 0;
    bool inside = false;  // all four posts exist

    bool operator==(const Cell&) const = default;
};

class Ground {
public:
    explicit Ground(const Scene& scene) : dem_(read_raster(scene.dem)) {
        if (dem_.columns < 2 || dem_.rows < 2) fail("'", scene.dem, "' has fewer than 2 x 2 posts");
        for (std::size_t i = 0; i < dem_.value.size(); ++i)
            if (std::abs(dem_.value[i]) > 1e5)
                fail("height ", dem_.value[i], " m in '", scene.dem, "', column ",
                     i % static_cast<std::size_t>(dem_.columns), ", row ", i / static_cast<std::size_t>(dem_.columns));
        bare_ = dem_.value;
        find_period();
        load_gamma(scene);
        load_classes(scene);
        load_heights(scene);
    }

    const Raster& raster() const { return dem_; }
    bool round_the_earth() const { return period_ > 0; }

    /// The cell of a position. The last column and row of posts belong to the last cells.
    Cell cell(double column, double row) const {
        if (!(row >= 0 && row <= dem_.rows - 1)) return {};
        const int r = std::min(static_cast<int>(row), dem_.rows - 2);
        if (period_ > 0) return {static_cast<int>(std::floor(column)), r, true};
        if (!(column >= 0 && column <= dem_.columns - 1)) return {};
        return {std::min(static_cast<int>(column), dem_.columns - 2), r, true};
    }

    /// Bilinear height of the surface (culture included) at a position on a cell that is crossed in direction `step`
    /// (columns, rows). What counts is where the cell is entered and left: a crossing of an edge is void if one of the
    /// edge's two posts is. With one void corner the way between the two other edges runs over the plane of the three posts.
    /// NaN: void.
    double surface(const Cell& cell, double column, double row, const std::array<double, 2>& step) const {
        const double height = bilinear(dem_.value, cell, column, row);
        if (!cell.inside || !std::isnan(height)) return height;
        int missing = -1;
        std::array<double, 4> corner{};
        for (int i = 0; i < 4; ++i) {
            corner[static_cast<std::size_t>(i)] = dem_.value[post(cell, i)];
            if (std::isnan(corner[static_cast<std::size_t>(i)])) {
                if (missing >= 0) return nan;
                missing = i;
            }
        }
        if (missing < 0) return height;
        // Mirrored so that the void corner is the far one of both axes: its edges are u = 1 and v = 1.
        const bool flip_u = missing % 2 == 0, flip_v = missing / 2 == 0;
        const double u = flip_u ? 1 - (column - cell.column) : column - cell.column;
        const double v = flip_v ? 1 - (row - cell.row) : row - cell.row;
        const double du = flip_u ? -step[0] : step[0], dv = flip_v ? -step[1] : step[1];
        // Only a way that falls in one axis and climbs in the other runs from edge to edge without u = 1 or v = 1.
        if (!(du * dv < 0)) return nan;
        const double at_v0 = u - v * du / dv;  // where the line meets v = 0; it meets u = 0 at v - u dv / du
        const double at_u0 = v - u * dv / du;
        if (!(at_v0 >= 0 && at_v0 <= 1 && at_u0 >= 0 && at_u0 <= 1)) return nan;
        const double origin = corner[static_cast<std::size_t>(3 - missing)];
        const double along_u =
            corner[static_cast<std::size_t>((3 - missing) ^ 1)];  // the origin's neighbour in its row
        const double along_v = corner[static_cast<std::size_t>((3 - missing) ^ 2)];  // and in its column
        return origin + u * (along_u - origin) + v * (along_v - origin);
    }
    /// Bilinear height of the bare terrain. Posts of weight zero are not needed.
    double bare(double column, double row) const { return bilinear_of_needed(bare_, column, row); }

    /// Highest valid post (culture included) of a cell; -infinity: none.
    double highest_post(const Cell& cell) const {
        double top = -infinity;
        if (cell.inside)
            for (int corner = 0; corner < 4; ++corner)
                if (const double h = dem_.value[post(cell, corner)]; h > top) top = h;  // false for NaN
        return top;
    }

    /// Reflectivity (linear, at the radar's frequency) at a position on a cell.
    double gamma(const Cell& cell, double column, double row) const {
        if (!culture_height_.empty()) {
            // Wall: the class of the corner post with the greatest culture height; corners go row by row.
            std::size_t tallest = post(cell, 0);
            for (int corner = 1; corner < 4; ++corner)
                if (culture_height_[post(cell, corner)] > culture_height_[tallest]) tallest = post(cell, corner);
            if (culture_height_[tallest] > 0) return wall_gamma_[static_cast<std::size_t>(post_class_[tallest])];
        }
        return ground_gamma_[static_cast<std::size_t>(class_at(column, row))];
    }

    /// Adds to `t` where a straight step crosses edges of terrain cells or culture cells, 0 < t < 1.
    void crossings(const std::array<double, 2>& from, const std::array<double, 2>& to, std::vector<double>& t) const {
        line_crossings(from[0], to[0], t);
        line_crossings(from[1], to[1], t);
        if (!class_.empty()) {
            line_crossings(class_grid_.column(from[0]), class_grid_.column(to[0]), t);
            line_crossings(class_grid_.row(from[1]), class_grid_.row(to[1]), t);
        }
    }

private:
    Raster dem_;  // value: the surface, once culture is loaded
    std::vector<double> bare_;
    int period_ = 0;                      // columns in 360 degrees of a cyclic raster, else 0
    std::vector<double> culture_height_;  // per post, metres; empty: none
    std::vector<int> post_class_;         // per post; empty: no culture height
    CultureGrid class_grid_;
    std::vector<int> class_;  // per culture cell; empty: none
    int default_class_ = 0;
    std::vector<double> ground_gamma_, wall_gamma_;  // by class, linear; NaN: not in the table

    std::size_t post(const Cell& cell, int corner) const {
        int column = cell.column + corner % 2;
        if (period_ > 0) column = ((column % period_) + period_) % period_;
        return static_cast<std::size_t>(cell.row + corner / 2) * static_cast<std::size_t>(dem_.columns) +
               static_cast<std::size_t>(column);
    }

    double bilinear(const std::vector<double>& height, const Cell& cell, double column, double row) const {
        if (!cell.inside) return nan;
        const double u = column - cell.column, v = row - cell.row;
        return (1 - v) * ((1 - u) * height[post(cell, 0)] + u * height[post(cell, 1)]) +
               v * ((1 - u) * height[post(cell, 2)] + u * height[post(cell, 3)]);
    }

    double bilinear_of_needed(const std::vector<double>& height, double column, double row) const {
        const Cell in = cell(column, row);
        if (!in.inside) return nan;
        const double u = column - in.column, v = row - in.row;
        const std::array<double, 4> weight = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
        double sum = 0;
        for (int corner = 0; corner < 4; ++corner)
            if (const double w = weight[static_cast<std::size_t>(corner)]; w != 0) sum += w * height[post(in, corner)];
        return sum;
    }

    int class_at(double column, double row) const {
        if (class_.empty()) return default_class_;
        if (period_ > 0) column -= period_ * std::floor((column + 0.5) / period_);
        const std::ptrdiff_t cell = class_grid_.cell(column, row);
        return cell < 0 ? default_class_ : class_[static_cast<std::size_t>(cell)];
    }

    static void line_crossings(double from, double to, std::vector<double>& t) {
        const double low = std::min(from, to), high = std::max(from, to);
        if (!(high - low < 1e4)) return;  // off the map: NaN
        for (double line = std::floor(low) + 1; line < high; ++line) t.push_back((line - from) / (to - from));
    }

    void find_period() {
        if (!dem_.crs.IsGeographic()) return;
        const double columns = 360 / std::abs(dem_.transform[1]);
        if (std::abs(columns - dem_.columns) < 0.01) period_ = dem_.columns;
        if (std::abs(columns - (dem_.columns - 1)) < 0.01) period_ = dem_.columns - 1;
    }

    void check_same_crs(const Raster& raster, const std::string& path) const {
        if (raster.crs.IsEmpty() || dem_.crs.IsEmpty()) return;
        const char* const options[] = {"IGNORE_DATA_AXIS_TO_SRS_AXIS_MAPPING=YES", "CRITERION=EQUIVALENT", nullptr};
        if (!raster.crs.IsSame(&dem_.crs, options)) fail("'", path, "' is in another CRS than the terrain");
    }

    void load_gamma(const Scene& scene) {
        const double law_db = 5 * std::log10(scene.frequency_ghz / 10);
        for (const auto& [id, gamma] : scene.gamma) {
            if (id < 0 || id > 10000) fail("class ", id, " is not in 0 .. 10000");
            const auto i = static_cast<std::size_t>(id);
            if (i >= ground_gamma_.size()) {
                ground_gamma_.resize(i + 1, nan);
                wall_gamma_.resize(i + 1, nan);
            }
            ground_gamma_[i] = std::isnan(gamma.ground_db) ? 0 : from_db(gamma.ground_db + law_db);
            wall_gamma_[i] = std::isnan(gamma.wall_db) ? ground_gamma_[i] : from_db(gamma.wall_db + law_db);
        }
    }

    void check_class(int id) const {
        if (id < 0 || static_cast<std::size_t>(id) >= ground_gamma_.size() ||
            std::isnan(ground_gamma_[static_cast<std::size_t>(id)]))
            fail("class ", id, " has no gamma");
    }

    void load_classes(const Scene& scene) {
        default_class_ = scene.default_class;
        check_class(default_class_);
        if (scene.culture.empty()) return;
        const Raster culture = read_raster(scene.culture);
        check_same_crs(culture, scene.culture);
        class_grid_ = CultureGrid(culture, dem_);
        class_.reserve(culture.value.size());
        for (const double code : culture.value) {
            if (std::isnan(code)) {
                class_.push_back(default_class_);
                continue;
            }
            const auto found = scene.class_of_code.find(static_cast<int>(std::lround(code)));
            if (found == scene.class_of_code.end())
                fail("culture code ", code, " in '", scene.culture, "' has no class");
            check_class(found->second);
            class_.push_back(found->second);
        }
    }

    void load_heights(const Scene& scene) {
        if (scene.culture_height.empty()) return;
        const Raster height = read_raster(scene.culture_height);
        check_same_crs(height, scene.culture_height);
        const CultureGrid grid(height, dem_);
        for (int row = 0; row < dem_.rows; ++row) {
            for (int column = 0; column < dem_.columns; ++column) {
                const std::ptrdiff_t cell = grid.cell(column, row);
                double metres =
                    cell < 0 ? 0 : scene.culture_height_scale * height.value[static_cast<std::size_t>(cell)];
                if (!(metres > 0)) metres = 0;  // NaN too
                dem_.value[culture_height_.size()] += metres;
                culture_height_.push_back(metres);
                post_class_.push_back(class_at(column, row));
            }
        }
    }
};

// ---------------------------------------------------------------------------------------------------------
// Earth: straight rays over a sphere, physics.md 1.1, written with the chord below an arc,
// chord = 2 Re sin(s / 2 Re), so that one form serves the flat earth (curvature 0) too and nothing cancels:
//   q = chord^2 / (2 Re^2),  2 q (Re + hs) (Re + h) = chord^2 (1 + hs/Re) (1 + h/Re)

struct Earth {
    double curvature;  // 1 / Re
    double sensor_height;

    double chord(double s) const { return curvature > 0 ? 2 / curvature * sine(0.5 * curvature * s) : s; }
    /// Of the small angles at the earth's centre: Maclaurin's series, to the last digit below 0.1 rad (1700 km).
    static double sine(double x) {
        if (!(std::abs(x) < 0.1)) return std::sin(x);
        const double y = x * x;
        return x * (1 - y * (1.0 / 6) *
                            (1 - y * (1.0 / 20) * (1 - y * (1.0 / 42) * (1 - y * (1.0 / 72) * (1 - y * (1.0 / 110))))));
    }

    struct Direction {
        double range, sin_e;  // slant range, sine of the elevation angle
    };
    Direction to(double s, double h) const {
        const double rise = h - sensor_height;
        const double c = chord(s);
        const double c2 = c * c * (1 + h * curvature);
        const double range = std::sqrt(rise * rise + c2 * (1 + sensor_height * curvature));
        return {range, range > 0 ? (rise - 0.5 * curvature * c2) / range : 1};
    }
    /// Slant range of the point above arc s on the ray of a given elevation.
    double range_on_ray(double s, double sin_e) const {
        const double c = chord(s) * curvature;
        const double cos_theta = 1 - 0.5 * c * c;
        const double sin_theta_re = curvature > 0 ? sine(s * curvature) / curvature : s;
        const double cos_e = std::sqrt(std::max(0.0, (1 - sin_e) * (1 + sin_e)));
        return (1 + sensor_height * curvature) * sin_theta_re / (cos_e * cos_theta - sin_e * sin_theta_re * curvature);
    }
    /// Sine of the depression at which a slant range meets the level surface of height h; above 1: not reached.
    double sin_depression_of_level(double range, double h) const {
        const double drop = sensor_height - h;
        return (drop * (2 + (sensor_height + h) * curvature) + range * range * curvature) /
               (2 * range * (1 + sensor_height * curvature));
    }
};

/// Radii of curvature of the ellipsoid.
struct Radii {
    double meridian, normal;
};
Radii wgs84_radii(double lat_deg) {
    const double e2 = wgs84_f * (2 - wgs84_f);
    const double s = std::sin(lat_deg * deg);
    const double w = 1 - e2 * s * s;
    return {wgs84_a * (1 - e2) / (w * std::sqrt(w)), wgs84_a / std::sqrt(w)};
}

// ---------------------------------------------------------------------------------------------------------
// Positions: nadir and rays on the terrain raster

OGRSpatialReference wgs84() {
    OGRSpatialReference crs;
    crs.SetWellKnownGeogCS("WGS84");
    crs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    return crs;
}

using Transformation = std::unique_ptr<OGRCoordinateTransformation>;

/// Null where both are the same.
Transformation make_transformation(const OGRSpatialReference& from, const OGRSpatialReference& to) {
    const char* const options[] = {"IGNORE_DATA_AXIS_TO_SRS_AXIS_MAPPING=YES", "CRITERION=EQUIVALENT", nullptr};
    if (from.IsSame(&to, options)) return nullptr;
    Transformation made(OGRCreateCoordinateTransformation(&from, &to));
    if (!made) fail("no transformation between WGS84 and the terrain's CRS");
    return made;
}

struct Nadir {
    double lat = nan, lon = nan;  // degrees
    double x = 0, y = 0;          // terrain's CRS
    double column = 0, row = 0;   // terrain's posts
    double post_m = 0;            // the smaller posting
};

Nadir find_nadir(const Scene& scene, const Raster& dem) {
    Nadir nadir;
    const auto& g = dem.transform;
    const bool has_crs = !dem.crs.IsEmpty();
    if (!has_crs && (!scene.by_xy || scene.geometry == Geometry::geodesic))
        fail("'", scene.dem, "' has no CRS: give x, y and grid geometry");
    if (scene.by_xy) {
        nadir.x = nadir.lon = scene.x;
        nadir.y = nadir.lat = scene.y;
        if (!has_crs)
            nadir.lon = nadir.lat = nan;
        else if (Transformation to_wgs84 = make_transformation(dem.crs, wgs84()))
            if (!to_wgs84->Transform(1, &nadir.lon, &nadir.lat)) fail("x, y has no latitude and longitude");
    } else {
        nadir.x = nadir.lon = scene.lon_deg;
        nadir.y = nadir.lat = scene.lat_deg;
        if (Transformation to_dem = make_transformation(wgs84(), dem.crs))
            if (!to_dem->Transform(1, &nadir.x, &nadir.y)) fail("the nadir has no place in the terrain's CRS");
    }
    double dx_m = std::abs(g[1]), dy_m = std::abs(g[5]);
    if (has_crs && dem.crs.IsGeographic()) {
        if (scene.geometry == Geometry::grid) fail("grid geometry needs x, y in metres");
        const double middle = g[0] + 0.5 * g[1] * dem.columns;
        nadir.x += 360 * std::round((middle - nadir.x) / 360);
        const Radii radii = wgs84_radii(nadir.lat);
        dx_m *= deg * radii.normal * std::cos(nadir.lat * deg);
        dy_m *= deg * radii.meridian;
    } else if (has_crs) {
        dx_m *= dem.crs.GetLinearUnits();
        dy_m *= dem.crs.GetLinearUnits();
    }
    nadir.column = (nadir.x - g[0]) / g[1] - 0.5;
    nadir.row = (nadir.y - g[3]) / g[5] - 0.5;
    nadir.post_m = std::min(dx_m, dy_m);
    return nadir;
}

/// Column and row of the terrain along one ray, as cubics in the ground arc.
class Path {
public:
    std::array<double, 2> at(double s) const {
        const double u = s / piece_m_;
        const double index = std::clamp(std::floor(u), 0.0, static_cast<double>(pieces_.size() - 1));
        const Piece& p = pieces_[static_cast<std::size_t>(index)];
        const double t = u - index;
        return {p.column[0] + t * (p.column[1] + t * (p.column[2] + t * p.column[3])),
                p.row[0] + t * (p.row[1] + t * (p.row[2] + t * p.row[3]))};
    }

    /// Straight line in the raster's x, y.
    static Path grid(const Nadir& nadir, const Raster& dem, double azimuth, double length_m) {
        Path path;
        path.piece_m_ = length_m;
        path.pieces_.push_back({{nadir.column, length_m * std::sin(azimuth) / dem.transform[1], 0, 0},
                                {nadir.row, length_m * std::cos(azimuth) / dem.transform[5], 0, 0}});
        return path;
    }

    /// WGS84 geodesic. Exact positions stand every `piece_m`; cubics through four of them are checked at the
    /// middle of each piece and the pieces halved until all are within `tolerance` (posts).
    static Path geodesic(const Nadir& nadir, const Raster& dem, OGRCoordinateTransformation* to_dem, double azimuth,
                         double length_m, double tolerance, double& largest_error) {
        for (double piece_m = 64 * nadir.post_m;; piece_m /= 2) {
            Path path;
            path.piece_m_ = piece_m;
            const int count = static_cast<int>(length_m / piece_m) + 1;
            // Nodes at -1, 0, 1, ... count + 1 pieces, and middles at 1/2, 3/2, ...: every half piece from -1.
            const std::vector<std::array<double, 2>> exact =
                exact_positions(nadir, dem, to_dem, azimuth, -piece_m, piece_m / 2, 2 * count + 5);
            double error = 0;
            for (int i = 0; i < count; ++i) {
                const auto node = [&](int k) { return exact[static_cast<std::size_t>(2 * (i + 1 + k))]; };
                Piece piece;
                for (std::size_t axis = 0; axis < 2; ++axis) {
                    const double a = node(-1)[axis], b = node(0)[axis], c = node(1)[axis], d = node(2)[axis];
                    (axis == 0 ? piece.column : piece.row) = {b, c - a / 3 - b / 2 - d / 6, (a + c) / 2 - b,
                                                              (d - a) / 6 + (b - c) / 2};
                }
                path.pieces_.push_back(piece);
            }
            for (int i = 0; i < count; ++i) {
                const auto middle = exact[static_cast<std::size_t>(2 * i + 3)];
                const auto found = path.at((i + 0.5) * piece_m);
                const double here = std::hypot(found[0] - middle[0], found[1] - middle[1]);
                if (here > error) error = here;  // NaN: off the CRS, void anyway
            }
            if (error <= tolerance || piece_m < 0.5 * nadir.post_m) {
                largest_error = std::max(largest_error, error);
                return path;
            }
        }
    }

private:
    struct Piece {
        std::array<double, 4> column{}, row{};
    };
    double piece_m_ = 1;
    std::vector<Piece> pieces_;

    static std::vector<std::array<double, 2>> exact_positions(const Nadir& nadir, const Raster& dem,
                                                              OGRCoordinateTransformation* to_dem, double azimuth,
                                                              double first_m, double step_m, int count) {
        using GeographicLib::Geodesic;
        const unsigned wanted = Geodesic::LATITUDE | Geodesic::LONGITUDE | Geodesic::LONG_UNROLL;
        const auto line = Geodesic::WGS84().Line(nadir.lat, nadir.lon, azimuth / deg,
                                                 Geodesic::LATITUDE | Geodesic::LONGITUDE | Geodesic::DISTANCE_IN);
        std::vector<double> x(static_cast<std::size_t>(count)), y(x.size());
        for (std::size_t i = 0; i < x.size(); ++i) {
            double unused = 0;
            line.GenPosition(false, first_m + static_cast<double>(i) * step_m, wanted, y[i], x[i], unused, unused,
                             unused, unused, unused, unused);
        }
        if (to_dem != nullptr) to_dem->Transform(count, x.data(), y.data());
        const bool degrees = dem.crs.IsGeographic();
        double near_x = nadir.x;
        std::vector<std::array<double, 2>> position(x.size());
        for (std::size_t i = 0; i < x.size(); ++i) {
            if (!std::isfinite(x[i]) || !std::isfinite(y[i])) {
                position[i] = {nan, nan};
                continue;
            }
            if (degrees) near_x = x[i] += 360 * std::round((near_x - x[i]) / 360);
            position[i] = {(x[i] - dem.transform[0]) / dem.transform[1] - 0.5,
                           (y[i] - dem.transform[3]) / dem.transform[5] - 0.5};
        }
        return position;
    }
};

// ---------------------------------------------------------------------------------------------------------
// One ray

enum Bit : std::uint8_t { bit_no_data = 1, bit_shadow = 2, bit_unknown = 4, bit_seen = 8 };

/// Calls f(bin, share) for the range bins that a stretch of slant range touches.
template <class F>
void for_bins(double from, double to, double bin_m, int bins, F&& f) {
    if (from > to) std::swap(from, to);
    if (!(from < bin_m * bins)) return;  // beyond the range, or no number
    const int first = std::max(0, static_cast<int>(from / bin_m));
    const int last = static_cast<int>(std::min(to / bin_m, static_cast<double>(bins)));
    for (int bin = first; bin <= last && bin < bins; ++bin) {
        const double low = std::max(from, bin * bin_m), high = std::min(to, (bin + 1) * bin_m);
        f(static_cast<std::size_t>(bin), to > from ? (high - low) / (to - from) : 1.0);
    }
}

/// Walks one ray outwards; adds its echoes (times `weight_w`, watts m^2 per unit of sine and gamma) and states.
void march(const Scene& scene, const Ground& ground, const Earth& earth, const Path& path, double length_m,
           double step_m, double reference_height, double weight_w, double* echo, std::uint8_t* bits) {
    struct Sample {
        double s = 0, column = 0, row = 0;
        Cell cell;
        double range = nan, sin_e = nan;  // NaN: void
        bool valid() const { return !std::isnan(sin_e); }
    };
    const auto sample = [&](double s, double column, double row, const Cell& cell, const std::array<double, 2>& step) {
        Sample made{s, column, row, cell, nan, nan};
        const double h = ground.surface(cell, column, row, step);
        if (std::isnan(h)) return made;
        const Earth::Direction direction = earth.to(s, h);
        made.range = direction.range;
        made.sin_e = s > 0 ? direction.sin_e : -1;  // the nadir
        return made;
    };
    const auto mark = [&](Bit bit, double from, double to) {
        for_bins(from, to, scene.range_bin_m, scene.range_bins, [&](std::size_t bin, double) { bits[bin] |= bit; });
    };

    double horizon = -1;       // sine of the elevation: the running maximum
    double void_horizon = -1;  // the same, of what the voids passed may hide
    bool in_gap = false;
    double gap_start = 0, gap_top = 0;
    double last_top = -infinity;  // highest post of the last valid step
    double shadow_from = nan, shadow_to = nan;  // the arcs of steps in the horizon's shadow, not marked yet
    const auto end_shadow = [&] {
        if (!std::isnan(shadow_from))
            mark(bit_shadow, earth.range_on_ray(shadow_from, horizon), earth.range_on_ray(shadow_to, horizon));
        shadow_from = nan;
    };

    const auto walk = [&](const Sample& a, const Sample& b) {
        if (!a.valid() || !b.valid()) {
            end_shadow();
            if (!in_gap) {
                in_gap = true;
                gap_start = a.s;
                gap_top = last_top;
            }
            gap_top = std::max({gap_top, ground.highest_post(a.cell), ground.highest_post(b.cell)});
            mark(bit_no_data, earth.to(a.s, reference_height).range, earth.to(b.s, reference_height).range);
            return;
        }
        if (in_gap) {
            in_gap = false;
            gap_top = std::max(gap_top, ground.highest_post(a.cell));
            void_horizon = std::max({void_horizon, earth.to(gap_start, gap_top).sin_e, earth.to(a.s, gap_top).sin_e});
            horizon = std::max(horizon, a.sin_e);
        }
        last_top = ground.highest_post(b.cell);

        if (b.sin_e <= horizon) {
            if (std::isnan(shadow_from)) shadow_from = a.s;
            shadow_to = b.s;
            return;
        }
        end_shadow();
        // The surface emerges above the old horizon the share `t` of the step on.
        const double t = std::clamp((horizon - a.sin_e) / (b.sin_e - a.sin_e), 0.0, 1.0);
        const double emerges = a.range + t * (b.range - a.range);
        if (t > 0) mark(bit_shadow, earth.range_on_ray(a.s, horizon), emerges);
        mark(b.sin_e > void_horizon ? bit_seen : bit_unknown, emerges, b.range);

        const double gamma = ground.gamma(b.cell, 0.5 * (a.column + b.column), 0.5 * (a.row + b.row));
        const double middle = 0.5 * (emerges + b.range);
        const double g = elevation_gain(scene, -std::asin(0.5 * (horizon + b.sin_e)));
        const double power = weight_w * g * g * gamma * (b.sin_e - horizon) / (middle * middle);
        for_bins(emerges, b.range, scene.range_bin_m, scene.range_bins,
                 [&](std::size_t bin, double share) { echo[bin] += share * power; });
        horizon = b.sin_e;
    };

    std::array<double, 2> from = path.at(0);
    const std::array<double, 2> ahead = path.at(step_m);
    Sample last = sample(0, from[0], from[1], ground.cell(from[0], from[1]), {ahead[0] - from[0], ahead[1] - from[1]});
    std::vector<double> ends;
    for (int i = 0; i * step_m < length_m; ++i) {
        const double s0 = i * step_m, s1 = (i + 1) * step_m;
        const std::array<double, 2> to = path.at(s1), step = {to[0] - from[0], to[1] - from[1]};
        if (!scene.split_steps) {
            const Sample next = sample(s1, to[0], to[1], ground.cell(to[0], to[1]), step);
            walk(last, next);
            last = next;
        } else {
            // Pieces between the edges: each lies in one terrain cell and one culture cell.
            ends.clear();
            ground.crossings(from, to, ends);
            ends.push_back(1);
            std::sort(ends.begin(), ends.end());
            double t0 = 0;
            for (const double t1 : ends) {
                const auto between = [t1, t0, &from, &to](double f, std::size_t axis) {
                    const double t = t0 + f * (t1 - t0);
                    return (1 - t) * from[axis] + t * to[axis];
                };
                const Cell cell = ground.cell(between(0.5, 0), between(0.5, 1));
                Sample first = last;  // the same height, seen from this cell
                if (!(cell == last.cell)) {
                    first = sample(s0 + t0 * (s1 - s0), between(0, 0), between(0, 1), cell, step);
                    if (first.valid() && last.valid()) first.range = last.range, first.sin_e = last.sin_e;
                }
                const Sample next = sample(s0 + t1 * (s1 - s0), between(1, 0), between(1, 1), cell, step);
                walk(first, next);
                last = next;
                t0 = t1;
            }
        }
        from = to;
    }
    end_shadow();
}

// ---------------------------------------------------------------------------------------------------------
// Uniform sampling

/// Metres east and north of the nadir, by ground arc and azimuth (the azimuthal equidistant map), of terrain positions:
/// exact at every 32nd post, bilinear between them (off by a centimetre at most).
class Chart {
public:
    Chart(const Scene& scene, const Nadir& nadir, const Raster& dem)
        : columns_(dem.columns / spacing + 2), rows_(dem.rows / spacing + 2) {
        const auto& g = dem.transform;
        const bool geodesic = scene.geometry == Geometry::geodesic;
        const Transformation to_wgs84 = geodesic ? make_transformation(dem.crs, wgs84()) : nullptr;
        for (int row = 0; row < rows_ * spacing; row += spacing) {
            for (int column = 0; column < columns_ * spacing; column += spacing) {
                double x = g[0] + (column + 0.5) * g[1], y = g[3] + (row + 0.5) * g[5];
                if (!geodesic) {
                    node_.push_back({x - nadir.x, y - nadir.y});
                } else if (to_wgs84 && !to_wgs84->Transform(1, &x, &y)) {
                    node_.push_back({nan, nan});
                } else {
                    double arc = 0, azimuth = 0, unused = 0;
                    GeographicLib::Geodesic::WGS84().Inverse(nadir.lat, nadir.lon, y, x, arc, azimuth, unused);
                    node_.push_back({arc * std::sin(azimuth * deg), arc * std::cos(azimuth * deg)});
                }
            }
        }
    }

    struct Place {
        double arc, azimuth;  // azimuth: 0 .. 2 pi
        double post_m2;       // of a square post there, on the chart
    };
    Place at(double column, double row) const {
        const int c = static_cast<int>(column / spacing), r = static_cast<int>(row / spacing);
        const double u = column / spacing - c, v = row / spacing - r;
        std::array<double, 2> place{}, along_u{}, along_v{};  // east, north
        for (std::size_t i = 0; i < 2; ++i) {
            const double a = node(c, r)[i], b = node(c + 1, r)[i];
            const double d = node(c, r + 1)[i], e = node(c + 1, r + 1)[i];
            place[i] = (1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * d + u * e);
            along_u[i] = (1 - v) * (b - a) + v * (e - d);
            along_v[i] = (1 - u) * (d - a) + u * (e - b);
        }
        const double azimuth = std::atan2(place[0], place[1]);
        return {std::hypot(place[0], place[1]), azimuth < 0 ? azimuth + 2 * pi : azimuth,
                std::abs(along_u[0] * along_v[1] - along_u[1] * along_v[0]) / (spacing * spacing)};
    }

private:
    static constexpr int spacing = 32;
    int columns_, rows_;  // of nodes
    std::vector<std::array<double, 2>> node_;

    const std::array<double, 2>& node(int column, int row) const {
        return node_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                     static_cast<std::size_t>(column)];
    }
};

/// A square of the even grid, by its middle: the sample.
struct Square {
    float column, row;
};
/// Those of each swept azimuth bin, within a ground arc.
std::vector<std::vector<Square>> squares_of_bins(const Scene& scene, const Chart& chart, const Raster& dem,
                                                 double length_m, const std::vector<int>& row_of_bin, int swept) {
    const double d = *scene.uniform_posts;
    std::vector<std::vector<Square>> squares(static_cast<std::size_t>(swept));
    for (double row = d / 2; row < dem.rows - 1; row += d) {
        for (double column = d / 2; column < dem.columns - 1; column += d) {
            const Chart::Place place = chart.at(column, row);
            if (!(place.arc > 0 && place.arc < length_m)) continue;
            const int bin = static_cast<int>(place.azimuth / (2 * pi) * scene.azimuth_bins) % scene.azimuth_bins;
            if (const int swept_row = row_of_bin[static_cast<std::size_t>(bin)]; swept_row >= 0)
                squares[static_cast<std::size_t>(swept_row)].push_back(
                    {static_cast<float>(column), static_cast<float>(row)});
        }
    }
    return squares;
}

/// Adds echo (times `weight_w`, as of `march`) and state of one sample. Its sight line runs as `path` does, the ray
/// through the middle of the azimuth bin, turned to end at the sample.
void look(const Scene& scene, const Ground& ground, const Earth& earth, const Path& path, const Chart::Place& place,
          const Square& square, double post_m, double reference_height, double weight_w, double* echo,
          std::uint8_t* bits) {
    const std::array<double, 2> end = path.at(place.arc);
    const std::array<double, 2> turn = {(square.column - end[0]) / place.arc, (square.row - end[1]) / place.arc};
    const auto at = [&](double s) {
        const std::array<double, 2> on_path = path.at(s);
        return std::array<double, 2>{on_path[0] + s * turn[0], on_path[1] + s * turn[1]};
    };
    const auto mark = [&](Bit bit, double range) {
        if (range < scene.range_bin_m * scene.range_bins) bits[static_cast<int>(range / scene.range_bin_m)] |= bit;
    };

    // The ground of the sample's cell, half a sample before it and behind it.
    const double half_m = 0.5 * *scene.uniform_posts * post_m;
    const std::array<double, 2> before = at(place.arc - half_m), behind = at(place.arc + half_m);
    const std::array<double, 2> across = {behind[0] - before[0], behind[1] - before[1]};
    const Cell cell = ground.cell(square.column, square.row);
    const double height = ground.surface(cell, square.column, square.row, across);
    const double height_before = ground.surface(cell, before[0], before[1], across);
    const double height_behind = ground.surface(cell, behind[0], behind[1], across);
    if (std::isnan(height) || std::isnan(height_before) || std::isnan(height_behind)) {
        mark(bit_no_data, earth.to(place.arc, reference_height).range);
        return;
    }
    const Earth::Direction middle = earth.to(place.arc, height);
    const double sin_before = earth.to(place.arc - half_m, height_before).sin_e;
    const double sin_behind = earth.to(place.arc + half_m, height_behind).sin_e;

    // The horizon: the edges of all cells on the way and the middles between them, on legs so short that they are straight.
    double horizon = sin_before;
    const double leg_m = 32 * post_m;
    std::vector<double> shares;
    for (double s = 0; s < place.arc; s += leg_m) {
        const double length = std::min(leg_m, place.arc - s);
        const std::array<double, 2> from = at(s), to = at(s + length), leg = {to[0] - from[0], to[1] - from[1]};
        shares.clear();
        ground.crossings(from, to, shares);
        std::sort(shares.begin(), shares.end());
        for (std::size_t i = shares.size(); i-- > 1;) shares.push_back(0.5 * (shares[i - 1] + shares[i]));
        for (const double t : shares) {
            const double column = from[0] + t * leg[0], row = from[1] + t * leg[1];
            const double on_way = ground.surface(ground.cell(column, row), column, row, leg);
            if (!std::isnan(on_way)) horizon = std::max(horizon, earth.to(s + t * length, on_way).sin_e);
        }
    }
    if (middle.sin_e <= horizon) {
        mark(bit_shadow, earth.range_on_ray(place.arc, horizon));
        return;
    }
    mark(bit_seen, middle.range);
    if (!(sin_behind > sin_before && middle.range < scene.range_bin_m * scene.range_bins)) return;

    // The square's share of the circle times what it rises: the solid angle.
    const double square_m2 = *scene.uniform_posts * *scene.uniform_posts * place.post_m2;
    const double solid_angle = square_m2 / place.arc * (sin_behind - sin_before) / (2 * half_m);
    const double g = elevation_gain(scene, -std::asin(middle.sin_e));
    echo[static_cast<int>(middle.range / scene.range_bin_m)] +=
        weight_w * g * g * ground.gamma(cell, square.column, square.row) * solid_angle / (middle.range * middle.range);
}

// ---------------------------------------------------------------------------------------------------------
// Beam and pulse

/// Integral of the unit hat.
double hat_integral(double x) {
    if (x <= -1) return 0;
    if (x <= 0) return (x + 1) * (x + 1) / 2;
    if (x <= 1) return 1 - (1 - x) * (1 - x) / 2;
    return 1;
}

/// Beyond this offset from the beam's axis there is no gain.
double beam_cut_rad(const Scene& scene) {
    if (scene.azimuth_pattern == AzimuthPattern::gaussian) return 2.24 * scene.beamwidth_deg * deg;
    return 5 * pi / (2 * 1.39155737825151) * scene.beamwidth_deg * deg;
}

int modulo(int a, int n) { return ((a % n) + n) % n; }

/// Echoes of azimuth bins (global number modulo the circle -> row of `echo`) to power of the requested ones.
std::vector<double> beam_and_pulse(const Scene& scene, const Earth& earth, double reference_height,
                                   const std::vector<double>& echo, const std::vector<int>& row_of_bin) {
    const auto n = static_cast<std::size_t>(scene.range_bins);
    const double bin_rad = 2 * pi / scene.azimuth_bins;
    const int half = scene.azimuth_bins / 2;

    std::vector<double> cos_d(n);
    for (std::size_t j = 0; j < n; ++j) {
        const double r = (static_cast<double>(j) + 0.5) * scene.range_bin_m;
        const double sine = std::abs(earth.sin_depression_of_level(r, reference_height));
        cos_d[j] = sine < 1 ? std::max(0.5, std::sqrt(1 - sine * sine)) : 0.5;
    }
    // Two-way gain by distance in azimuth bins: gain[m][j].
    std::vector<std::vector<double>> gain;
    for (int m = 0; m <= half; ++m) {
        std::vector<double> row(n);
        bool any = false;
        for (std::size_t j = 0; j < n; ++j) {
            row[j] = azimuth_gain_two_way(scene, m * bin_rad * cos_d[j]);
            any = any || row[j] != 0;
        }
        if (!any && m * bin_rad > 2 * beam_cut_rad(scene)) break;
        gain.push_back(std::move(row));
    }

    const double w = light_m_s * scene.pulse_s / (2 * scene.range_bin_m);
    std::vector<double> pulse;
    for (int m = 0; m - w < 1; ++m) pulse.push_back(hat_integral(m) - hat_integral(m - w));

    std::vector<double> power(static_cast<std::size_t>(scene.azimuth_count) * n);
    std::vector<double> beamed(n);
    for (int i = 0; i < scene.azimuth_count; ++i) {
        std::fill(beamed.begin(), beamed.end(), 0.0);
        // Offsets -m and +m; the opposite bin of an even circle once.
        for (int offset = -(scene.azimuth_bins - 1) / 2; offset <= half; ++offset) {
            const auto m = static_cast<std::size_t>(std::abs(offset));
            if (m >= gain.size()) continue;
            const int from = scene.beam ? offset : 0;
            const int row =
                row_of_bin[static_cast<std::size_t>(modulo(scene.first_azimuth_bin + i + from, scene.azimuth_bins))];
            for (std::size_t j = 0; j < n; ++j)
                if (gain[m][j] != 0) beamed[j] += gain[m][j] * echo[static_cast<std::size_t>(row) * n + j];
        }
        double* out = power.data() + static_cast<std::size_t>(i) * n;
        for (std::size_t j = 0; j < n; ++j) {
            if (!scene.pulse)
                out[j] = w * beamed[j];
            else
                for (std::size_t m = 0; m < pulse.size() && m <= j; ++m) out[j] += pulse[m] * beamed[j - m];
        }
    }
    return power;
}

double thread_cpu_s() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

void validate(const Scene& s) {
    const auto positive = [](double v, const char* name) {
        if (!(v > 0) || std::isinf(v)) fail(name, " is ", v, "; it must be above 0");
    };
    positive(s.frequency_ghz, "frequency_ghz");
    positive(s.transmit_power_w, "transmit_power_w");
    positive(s.pulse_s, "pulse_s");
    positive(s.beamwidth_deg, "beamwidth_deg");
    positive(s.width_deg, "width_deg");
    positive(s.range_bin_m, "range_bin_m");
    positive(s.step_posts, "step_posts");
    positive(s.position_tolerance, "position_tolerance");
    positive(s.uniform_posts.value_or(1), "uniform_posts");
    positive(s.azimuth_bins, "azimuth_bins");
    positive(s.azimuth_count, "azimuth_count");
    positive(s.range_bins, "range_bins");
    positive(s.rays_per_bin, "rays_per_bin");
    positive(s.threads, "threads");
    if (!s.flat_earth) positive(s.earth_k, "earth_k");
    if (s.elevation_pattern != ElevationPattern::gaussian) positive(s.knee_deg, "knee_deg");
    if (s.azimuth_count > s.azimuth_bins) fail("azimuth_count is ", s.azimuth_count, " of ", s.azimuth_bins);
}

}  // namespace

// ---------------------------------------------------------------------------------------------------------
// Patterns

double elevation_gain(const Scene& scene, double depression_rad) {
    const double beta = depression_rad - scene.tilt_deg * deg;
    const double knee = scene.knee_deg * deg;
    const double x = (beta - knee) / (scene.width_deg * deg);
    double g = 0;  // cos beta <= 0: the floor
    if (scene.elevation_pattern == ElevationPattern::gaussian || beta <= knee) {
        g = std::exp(-4 * std::numbers::ln2 * x * x);
    } else if (std::cos(beta) > 0) {
        const double ratio = std::sin(knee) / std::sin(beta);
        g = ratio * ratio;
        if (scene.elevation_pattern == ElevationPattern::cos_csc2)
            g *= std::pow(std::cos(beta) / std::cos(knee), scene.exponent);
    }
    return std::max(g, from_db(scene.floor_db));
}

double azimuth_gain_two_way(const Scene& scene, double offset_rad) {
    if (std::abs(offset_rad) > beam_cut_rad(scene)) return 0;
    const double x = offset_rad / (scene.beamwidth_deg * deg);
    double g = 0;
    if (scene.azimuth_pattern == AzimuthPattern::gaussian) {
        g = std::exp(-4 * std::numbers::ln2 * x * x);
    } else {
        const double u = 2 * 1.39155737825151 * x;
        g = u == 0 ? 1 : std::sin(u) / u * std::sin(u) / u;
    }
    return g * g;
}

double noise_w(double bandwidth_hz, double noise_figure_db) {
    return 1.380649e-23 * 290 * bandwidth_hz * from_db(noise_figure_db);
}

// ---------------------------------------------------------------------------------------------------------
// The scene

Result simulate(const Scene& scene) {
    validate(scene);
    double cpu_s = -thread_cpu_s();
    const Ground ground(scene);
    const Nadir nadir = find_nadir(scene, ground.raster());

    Result result;
    result.azimuth_count = scene.azimuth_count;
    result.range_bins = scene.range_bins;
    result.lat_deg = nadir.lat;
    result.lon_deg = nadir.lon;
    result.x = nadir.x;
    result.y = nadir.y;
    result.post_m = nadir.post_m;
    const double bare = ground.bare(nadir.column, nadir.row);
    result.reference_height_m = std::isnan(bare) ? 0 : bare;
    if (scene.height_msl_m < bare) fail("the sensor is ", bare - scene.height_msl_m, " m below the terrain");

    const bool geodesic = scene.geometry == Geometry::geodesic;
    const Radii radii = wgs84_radii(geodesic ? nadir.lat : 0);
    const auto earth_of = [&](double radius_m) {
        return Earth{scene.flat_earth ? 0 : 1 / (scene.earth_k * radius_m), scene.height_msl_m};
    };
    const Earth common = earth_of(geodesic ? std::sqrt(radii.meridian * radii.normal) : mean_radius_m);
    const auto earth_along = [&](double azimuth) {
        const double c = std::cos(azimuth), s = std::sin(azimuth);
        return geodesic ? earth_of(1 / (c * c / radii.meridian + s * s / radii.normal)) : common;
    };

    // A point, or a level surface, or a ray at its horizon is never nearer in slant range than about its arc.
    const double length_m = 1.002 * scene.range_bins * scene.range_bin_m + 10 * nadir.post_m;
    const double step_m = scene.step_posts * nadir.post_m;
    const double lambda_m = light_m_s / (scene.frequency_ghz * 1e9);
    const double radar_w = scene.transmit_power_w * std::pow(from_db(scene.gain_db), 2) * lambda_m * lambda_m /
                           (std::pow(4 * pi, 3) * from_db(scene.losses_db));
    const double bin_rad = 2 * pi / scene.azimuth_bins;

    // Azimuth bins to sweep: those asked, and the beam's skirt on both sides (cos d is at least 1/2).
    const int skirt = scene.beam ? static_cast<int>(2 * beam_cut_rad(scene) / bin_rad) + 1 : 0;
    const int swept = std::min(scene.azimuth_bins, scene.azimuth_count + 2 * skirt);
    std::vector<int> row_of_bin(static_cast<std::size_t>(scene.azimuth_bins), -1);
    for (int row = 0; row < swept; ++row)
        row_of_bin[static_cast<std::size_t>(modulo(scene.first_azimuth_bin - skirt + row, scene.azimuth_bins))] = row;
    const auto n = static_cast<std::size_t>(scene.range_bins);
    std::vector<double> echo(static_cast<std::size_t>(swept) * n);
    std::vector<std::uint8_t> bits(echo.size());

    if (scene.uniform_posts && ground.round_the_earth())
        fail("uniform sampling of '", scene.dem, "', all round the earth");
    std::optional<Chart> chart;
    std::vector<std::vector<Square>> squares;
    if (scene.uniform_posts) {
        chart.emplace(scene, nadir, ground.raster());
        squares = squares_of_bins(scene, *chart, ground.raster(), length_m, row_of_bin, swept);
    }

    std::atomic<int> next_bin{0};
    std::mutex mutex;
    std::exception_ptr failure;
    const auto work = [&] {
        const double start_s = thread_cpu_s();
        double position_error = 0;
        try {
            const Transformation to_dem = geodesic ? make_transformation(wgs84(), ground.raster().crs) : nullptr;
            const auto path_along = [&](double azimuth) {
                return geodesic ? Path::geodesic(nadir, ground.raster(), to_dem.get(), azimuth, length_m + step_m,
                                                 scene.position_tolerance, position_error)
                                : Path::grid(nadir, ground.raster(), azimuth, length_m + step_m);
            };
            for (int bin = next_bin++; bin < scene.azimuth_bins; bin = next_bin++) {
                const int row = row_of_bin[static_cast<std::size_t>(bin)];
                if (row < 0) continue;
                double* const echo_row = echo.data() + static_cast<std::size_t>(row) * n;
                std::uint8_t* const bits_row = bits.data() + static_cast<std::size_t>(row) * n;
                if (chart) {
                    const Path path = path_along((bin + 0.5) * bin_rad);
                    for (const Square& square : squares[static_cast<std::size_t>(row)]) {
                        const Chart::Place place = chart->at(square.column, square.row);
                        look(scene, ground, earth_along(place.azimuth), path, place, square, nadir.post_m,
                             result.reference_height_m, radar_w, echo_row, bits_row);
                    }
                    continue;
                }
                for (int ray = 0; ray < scene.rays_per_bin; ++ray) {
                    const double azimuth = (bin + (ray + 0.5) / scene.rays_per_bin) * bin_rad;
                    march(scene, ground, earth_along(azimuth), path_along(azimuth), length_m, step_m,
                          result.reference_height_m, radar_w * bin_rad / scene.rays_per_bin, echo_row, bits_row);
                }
            }
        } catch (...) {
            const std::lock_guard lock(mutex);
            failure = std::current_exception();
        }
        const std::lock_guard lock(mutex);
        result.position_error_posts = std::max(result.position_error_posts, position_error);
        cpu_s += thread_cpu_s() - start_s;
    };
    {
        std::vector<std::jthread> threads;
        for (int i = 0; i < scene.threads; ++i) threads.emplace_back(work);
    }
    if (failure) std::rethrow_exception(failure);

    result.power_w = beam_and_pulse(scene, common, result.reference_height_m, echo, row_of_bin);
    for (int i = 0; i < scene.azimuth_count; ++i) {
        const int bin = modulo(scene.first_azimuth_bin + i, scene.azimuth_bins);
        const std::size_t start = static_cast<std::size_t>(row_of_bin[static_cast<std::size_t>(bin)]) * n;
        for (std::size_t j = start; j < start + n; ++j) {
            result.echo_w.push_back(echo[j]);
            const std::uint8_t b = bits[j];
            result.state.push_back((b & bit_seen) != 0      ? State::seen
                                   : (b & bit_unknown) != 0 ? State::unknown
                                   : (b & bit_shadow) != 0  ? State::shadow
                                   : (b & bit_no_data) != 0 ? State::no_data
                                                            : State::outside);
        }
    }
    result.cpu_s = cpu_s + thread_cpu_s();
    return result;
}

// ---------------------------------------------------------------------------------------------------------
// Tables and comparison

std::map<int, Gamma> project_gamma() {
    return {{0, {none, none}}, {1, {-15, none}},  {2, {-20, none}}, {3, {-12, none}}, {4, {-17, -8}}, {5, {-16, none}},
            {6, {-15, none}},  {7, {-15, none}},  {8, {-12, -10}},  {9, {-18, none}}, {10, {-7, 0}},  {11, {-2, 5}},
            {12, {-20, 5}},    {13, {-22, none}}, {14, {3, 10}},    {15, {6, 15}}};
}

std::map<int, Gamma> constant_gamma(double db, int default_class) {
    std::map<int, Gamma> table;
    for (int id = 0; id < 16; ++id) table[id] = {db, db};
    table[default_class] = {db, db};
    return table;
}

std::map<int, int> fbfm40_classes() {
    std::map<int, int> classes = {{91, 10}, {92, 1}, {93, 6}, {98, 0}, {99, 4}};
    for (int code = 101; code <= 109; ++code) classes[code] = 5;
    for (int code = 121; code <= 149; ++code) classes[code] = 7;
    for (int code = 161; code <= 189; ++code) classes[code] = 8;
    for (int code = 201; code <= 204; ++code) classes[code] = 8;
    return classes;
}

std::map<int, int> nlcd_classes() {
    return {{11, 0}, {12, 1}, {21, 10}, {22, 10}, {23, 11}, {24, 11}, {31, 2}, {41, 8}, {42, 8}, {43, 8},
            {51, 7}, {52, 7}, {71, 5},  {72, 5},  {73, 5},  {74, 5},  {81, 5}, {82, 6}, {90, 8}, {95, 9}};
}

Comparison compare(const std::vector<double>& test_w, const std::vector<double>& reference_w, double noise_w) {
    if (test_w.size() != reference_w.size()) fail("images of ", test_w.size(), " and ", reference_w.size(), " cells");
    if (!(noise_w > 0)) fail("noise_w is ", noise_w, "; it must be above 0");
    std::vector<double> signed_db, absolute_db;
    double sum = 0;
    for (std::size_t i = 0; i < test_w.size(); ++i) {
        if (std::isnan(test_w[i]) || std::isnan(reference_w[i])) fail("NaN in cell ", i);
        if (test_w[i] <= noise_w && reference_w[i] <= noise_w) continue;
        const double db = 10 * std::log10((test_w[i] + noise_w) / (reference_w[i] + noise_w));
        signed_db.push_back(db);
        absolute_db.push_back(std::abs(db));
        sum += db * db;
    }
    Comparison result;
    result.count = signed_db.size();
    if (result.count == 0) return result;
    std::sort(signed_db.begin(), signed_db.end());
    std::sort(absolute_db.begin(), absolute_db.end());
    const std::size_t last = result.count - 1;
    result.rms_db = std::sqrt(sum / static_cast<double>(result.count));
    result.p99_db = absolute_db[static_cast<std::size_t>(std::ceil(0.99 * static_cast<double>(last)))];
    result.max_db = absolute_db[last];
    result.median_db = 0.5 * (signed_db[last / 2] + signed_db[(last + 1) / 2]);
    return result;
}

double state_difference(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b) {
    if (a.size() != b.size() || a.empty()) fail("state images of ", a.size(), " and ", b.size(), " cells");
    std::size_t different = 0;
    for (std::size_t i = 0; i < a.size(); ++i) different += a[i] != b[i];
    return static_cast<double>(different) / static_cast<double>(a.size());
}

}  // namespace wedgescope::reference
