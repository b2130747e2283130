// Makes a terrain of any size for the benchmarks, one band of tiles after the other, so that memory is bounded:
//   make_terrain ridged|bowl|fractal POSTS OUT.tif [SEED [POST_M]]
// POSTS x POSTS heights, Int16 (fractal: Float32), POST_M (30) apart, UTM 11N, uncompressed tiles of 256 x 256.
//   ridged  hills and mountain chains: octaves of gradient noise, the coarse ones folded into ridges
//   bowl    rises outward from its middle, ever faster than the earth falls away: no post hides another from a
//           sensor that stands over the middle and higher than the rim
//   fractal rolling ground with detail down to 5 m, each half as long half as high; the same ground at any POST_M
#include <fmt/format.h>
#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace {

constexpr int tile = 256;

struct Gradient {
    double x, y;
};
/// A direction for a lattice point; SplitMix64's finaliser (Steele, Lea & Flood 2014) over a mix of the three.
Gradient lattice(std::int64_t x, std::int64_t y, std::uint64_t key) {
    std::uint64_t z =
        key + 0x9E3779B97F4A7C15U * static_cast<std::uint64_t>(x) + 0xD1B54A32D192ED03U * static_cast<std::uint64_t>(y);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    z ^= z >> 31;
    const double angle = static_cast<double>(z >> 11) * (0x1p-53 * 2 * std::numbers::pi);
    return {std::cos(angle), std::sin(angle)};
}

double fade(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }

/// Adds one octave of gradient noise to a row, about -amplitude..amplitude; `ridged` folds it: crests where it is 0.
void add_octave(std::vector<double>& row, std::int64_t y, double wavelength_posts, double amplitude_m, bool ridged,
                std::uint64_t key) {
    const double v = static_cast<double>(y) / wavelength_posts;
    const auto cell_y = static_cast<std::int64_t>(v);
    const double below = v - static_cast<double>(cell_y), across = fade(below);
    // Along a row the noise about one column of the lattice is linear in the distance from it.
    struct Line {
        double at, slope;
    };
    const auto line = [&](std::int64_t x) {
        const Gradient top = lattice(x, cell_y, key), bottom = lattice(x, cell_y + 1, key);
        return Line{std::lerp(top.y * below, bottom.y * (below - 1), across), std::lerp(top.x, bottom.x, across)};
    };
    std::int64_t cell = 0;
    Line left = line(0), right = line(1);
    for (std::size_t i = 0; i < row.size(); ++i) {
        const double u = static_cast<double>(i) / wavelength_posts;
        const auto cell_x = static_cast<std::int64_t>(u);
        if (cell_x != cell) {
            cell = cell_x;
            left = line(cell);
            right = line(cell + 1);
        }
        const double f = u - static_cast<double>(cell_x);
        const double noise = 1.5 * std::lerp(left.at + left.slope * f, right.at + right.slope * (f - 1), fade(f));
        row[i] += amplitude_m * (ridged ? 1 - 4 * std::abs(noise) : noise);
    }
}

/// From the longest waves down: half the length, half the height each time.
void ridged_row(std::vector<double>& row, std::int64_t y, std::uint64_t seed) {
    std::fill(row.begin(), row.end(), 1000.0);
    double wavelength_posts = 500, amplitude_m = 500;
    for (std::uint64_t octave = 0; wavelength_posts >= 3; ++octave) {
        add_octave(row, y, wavelength_posts, amplitude_m, octave < 5, seed * 1000003 + octave);
        wavelength_posts /= 2.03;
        amplitude_m *= 0.5;
    }
    for (double& z : row) z = std::max(z, 0.0);
}

/// Waves of 16 km and 320 m, and so on down to 5 m.
void fractal_row(std::vector<double>& row, std::int64_t y, std::uint64_t seed, double post_m) {
    std::fill(row.begin(), row.end(), 500.0);
    double wavelength_m = 16000, amplitude_m = 320;
    for (std::uint64_t octave = 0; wavelength_m >= 5; ++octave) {
        add_octave(row, y, wavelength_m / post_m, amplitude_m, false, seed * 1000003 + octave);
        wavelength_m /= 2.03;
        amplitude_m /= 2.03;
    }
}

/// 100 m in the middle, 1600 m in the corners.
void bowl_row(std::vector<double>& row, std::int64_t y) {
    const double middle = static_cast<double>(row.size() - 1) / 2;
    const double dy = static_cast<double>(y) - middle;
    for (std::size_t i = 0; i < row.size(); ++i) {
        const double dx = static_cast<double>(i) - middle;
        row[i] = 100 + 1500 * (dx * dx + dy * dy) / (2 * middle * middle);
    }
}

void make(std::string_view kind, int posts, const char* path, std::uint64_t seed, double post_m) {
    GDALAllRegister();
    const std::array<const char*, 5> options{"TILED=YES", "BLOCKXSIZE=256", "BLOCKYSIZE=256", "BIGTIFF=IF_SAFER",
                                             nullptr};
    GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("GTiff");
    const std::unique_ptr<GDALDataset> file(driver->Create(
        path, posts, posts, 1, kind == "fractal" ? GDT_Float32 : GDT_Int16, const_cast<char**>(options.data())));
    if (!file) throw std::runtime_error("it cannot be made");
    OGRSpatialReference crs;
    crs.importFromEPSG(32611);
    std::array<double, 6> transform{400000, post_m, 0, 4500000, 0, -post_m};
    if (file->SetSpatialRef(&crs) != CE_None || file->SetGeoTransform(transform.data()) != CE_None)
        throw std::runtime_error("its position cannot be written");

    std::vector<double> row(static_cast<std::size_t>(posts));
    std::vector<float> band(row.size() * tile);
    for (int y0 = 0; y0 < posts; y0 += tile) {
        const int rows = std::min(tile, posts - y0);
        for (int y = 0; y < rows; ++y) {
            if (kind == "ridged") {
                ridged_row(row, y0 + y, seed);
            } else if (kind == "fractal") {
                fractal_row(row, y0 + y, seed, post_m);
            } else {
                bowl_row(row, y0 + y);
            }
            std::transform(row.begin(), row.end(), band.begin() + static_cast<std::ptrdiff_t>(row.size()) * y,
                           [&](double z) { return static_cast<float>(kind == "fractal" ? z : std::round(z)); });
        }
        if (file->GetRasterBand(1)->RasterIO(GF_Write, 0, y0, posts, rows, band.data(), posts, rows, GDT_Float32, 0, 0,
                                             nullptr) != CE_None)
            throw std::runtime_error(fmt::format("rows from {} on cannot be written", y0));
    }
    CPLErrorReset();
    file->FlushCache(true);
    if (CPLGetLastErrorType() >= CE_Failure) throw std::runtime_error(CPLGetLastErrorMsg());
}

}  // namespace

int main(int argc, char** argv) {
    const std::string_view kind = argc > 1 ? argv[1] : "";
    const int posts = argc > 2 ? std::atoi(argv[2]) : 0;
    const double post_m = argc > 5 ? std::atof(argv[5]) : 30;
    if (argc < 4 || argc > 6 || (kind != "ridged" && kind != "bowl" && kind != "fractal") || posts < 2 ||
        posts > 200000 || !(post_m > 0)) {
        fmt::print(stderr, "usage: make_terrain ridged|bowl|fractal POSTS(2..200000) OUT.tif [SEED [POST_M]]\n");
        return 2;
    }
    try {
        make(kind, posts, argv[3], argc > 4 ? std::strtoull(argv[4], nullptr, 10) : 1, post_m);
    } catch (const std::exception& error) {
        fmt::print(stderr, "make_terrain: {}: {}\n", argv[3], error.what());
        return 1;
    }
}
