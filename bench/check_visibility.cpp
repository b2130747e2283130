// Compares the states of a simulation with the posts that gdal_viewshed marks as visible:
//   check_visibility DEM.tif VIEWSHED.tif STATES.tif
// Both in plane geometry over the 4/3 earth (--geometry grid; gdal_viewshed -cc 0.75), with range and azimuth bins of
// more than a post beyond NEAR_M. Prints two shares, of the cells beyond NEAR_M
//   that hold a visible post: how many are seen (a seen post must be in the picture);
//   that are seen: how many have a visible post in them or beside them (nothing else may be).
// Leaves with 1 where one is below its limit: gdal_viewshed itself is wrong at some posts (it interpolates horizons
// between posts), and cells at the edge of a shadow depend on where they are sampled.
#include <fmt/format.h>
#include <gdal_priv.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

constexpr double earth_m = 6371008.7714 * 4 / 3;
constexpr double near_m = 10000;
constexpr double limit_percent = 98;
constexpr std::uint8_t state_seen = 2, state_unknown = 3;

using Dataset = std::unique_ptr<GDALDataset>;

Dataset open(const char* path) {
    Dataset file(GDALDataset::Open(path, GDAL_OF_RASTER | GDAL_OF_READONLY));
    if (!file) throw std::runtime_error(fmt::format("{}: cannot be opened", path));
    return file;
}

template <class T>
void read(GDALDataset& file, int y, int rows, GDALDataType type, std::vector<T>& values) {
    values.resize(static_cast<std::size_t>(file.GetRasterXSize()) * static_cast<std::size_t>(rows));
    const int columns = file.GetRasterXSize();
    if (file.GetRasterBand(1)->RasterIO(GF_Read, 0, y, columns, rows, values.data(), columns, rows, type, 0, 0,
                                        nullptr) != CE_None)
        throw std::runtime_error(fmt::format("{}: rows from {} on cannot be read", file.GetDescription(), y));
}

double metadata(GDALDataset& file, const char* name) {
    const char* value = file.GetMetadataItem(name);
    if (!value) throw std::runtime_error(fmt::format("{}: has no {}", file.GetDescription(), name));
    return std::strtod(value, nullptr);
}

/// Slant range over the effective earth, physics "Effective earth".
double slant_range_m(double sensor_m, double height_m, double arc_m) {
    const double s = std::sin(arc_m / (2 * earth_m));
    return std::sqrt((sensor_m - height_m) * (sensor_m - height_m) +
                     4 * s * s * (earth_m + sensor_m) * (earth_m + height_m));
}

int check(const char* dem_path, const char* viewshed_path, const char* states_path) {
    GDALAllRegister();
    const Dataset dem = open(dem_path), viewshed = open(viewshed_path), states = open(states_path);
    double transform[6];
    dem->GetGeoTransform(transform);
    const int columns = dem->GetRasterXSize(), rows = dem->GetRasterYSize();
    // gdal_viewshed may cut its output to what lies in range.
    double cut[6];
    viewshed->GetGeoTransform(cut);
    const int column0 = static_cast<int>(std::lround((cut[0] - transform[0]) / transform[1]));
    const int row0 = static_cast<int>(std::lround((cut[3] - transform[3]) / transform[5]));

    const double sensor_x = metadata(*states, "SENSOR_X"), sensor_y = metadata(*states, "SENSOR_Y");
    const double sensor_m = metadata(*states, "SENSOR_HEIGHT_M");
    const double range_start_m = metadata(*states, "RANGE_START_M"), range_step_m = metadata(*states, "RANGE_STEP_M");
    const double azimuth_start_deg = metadata(*states, "AZIMUTH_START_DEG"),
                 azimuth_step_deg = metadata(*states, "AZIMUTH_STEP_DEG");
    const int range_bins = states->GetRasterXSize(), azimuth_bins = states->GetRasterYSize();
    std::vector<std::uint8_t> state;
    read(*states, 0, azimuth_bins, GDT_Byte, state);

    std::vector<std::uint8_t> holds_visible(state.size());
    std::vector<float> height;
    std::vector<std::uint8_t> visible;
    for (int y = 0; y < viewshed->GetRasterYSize(); ++y) {
        if (y + row0 < 0 || y + row0 >= rows) continue;
        read(*dem, y + row0, 1, GDT_Float32, height);
        read(*viewshed, y, 1, GDT_Byte, visible);
        const double north = transform[3] + (y + row0 + 0.5) * transform[5] - sensor_y;
        for (int x = 0; x < viewshed->GetRasterXSize(); ++x) {
            if (visible[static_cast<std::size_t>(x)] != 255 || x + column0 < 0 || x + column0 >= columns) continue;
            const double east = transform[0] + (x + column0 + 0.5) * transform[1] - sensor_x;
            const double range_m = slant_range_m(
                sensor_m, static_cast<double>(height[static_cast<std::size_t>(x + column0)]), std::hypot(east, north));
            double azimuth_deg = std::atan2(east, north) * (180 / std::numbers::pi) - azimuth_start_deg;
            azimuth_deg -= 360 * std::floor(azimuth_deg / 360);
            const auto i = static_cast<std::int64_t>(azimuth_deg / azimuth_step_deg);
            const auto j = static_cast<std::int64_t>(std::floor((range_m - range_start_m) / range_step_m));
            if (i >= azimuth_bins || j < 0 || j >= range_bins) continue;
            holds_visible[static_cast<std::size_t>(i * range_bins + j)] = 1;
        }
    }

    const auto is_seen = [&](std::size_t cell) { return state[cell] == state_seen || state[cell] == state_unknown; };
    std::uint64_t held = 0, held_seen = 0, seen = 0, seen_held = 0;
    const auto first = static_cast<int>(std::ceil((near_m - range_start_m) / range_step_m));
    for (int i = 0; i < azimuth_bins; ++i) {
        for (int j = std::max(first, 1); j + 1 < range_bins; ++j) {
            const auto cell =
                static_cast<std::size_t>(i) * static_cast<std::size_t>(range_bins) + static_cast<std::size_t>(j);
            if (holds_visible[cell]) {
                ++held;
                held_seen += is_seen(cell);
            }
            if (!is_seen(cell)) continue;
            ++seen;
            bool found = false;
            for (int di = -1; di <= 1; ++di) {
                for (int dj = -1; dj <= 1; ++dj) {
                    const int row = (i + di + azimuth_bins) % azimuth_bins;
                    found =
                        found || holds_visible[static_cast<std::size_t>(row) * static_cast<std::size_t>(range_bins) +
                                               static_cast<std::size_t>(j + dj)];
                }
            }
            seen_held += found;
        }
    }
    const auto percent = [](std::uint64_t part, std::uint64_t whole) {
        return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
    };
    fmt::print(
        "{:.2f} % of {} cells with a visible post are seen; {:.2f} % of {} seen cells have one in or beside them\n",
        percent(held_seen, held), held, percent(seen_held, seen), seen);
    return percent(held_seen, held) >= limit_percent && percent(seen_held, seen) >= limit_percent ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) {
        fmt::print(stderr, "usage: check_visibility DEM.tif VIEWSHED.tif STATES.tif\n");
        return 2;
    }
    try {
        return check(argv[1], argv[2], argv[3]);
    } catch (const std::exception& error) {
        fmt::print(stderr, "check_visibility: {}\n", error.what());
        return 2;
    }
}
