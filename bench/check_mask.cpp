// How many posts of masks of visibility are wrong, by an exact walk of each ray over the bilinear surface:
//   check_mask DEM.tif X Y HEIGHT POSTS MASK.tif...
// Plane geometry over the 4/3 earth (--geometry grid; gdal_viewshed -cc 0.75), a sensor HEIGHT m above the ground at
// X, Y, POSTS posts drawn at random, the same every time. A mask holds 255 where a post is seen, or, as of r.viewshed,
// an angle there and no data elsewhere. Prints for each mask
//   visible %  wrong %  of which seen too much %  IoU of the visible  FILE
#include <fmt/format.h>
#include <gdal_priv.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/reference/line_of_sight.hpp"

namespace {

using namespace wedgescope::reference;

double number(const char* word) {
    double value = 0;
    const auto [end, error] = std::from_chars(word, word + std::strlen(word), value);
    if (error != std::errc() || *end != '\0') throw std::runtime_error(fmt::format("'{}' is no number", word));
    return value;
}

using Dataset = std::unique_ptr<GDALDataset>;

Dataset open(const char* path) {
    Dataset file(GDALDataset::Open(path, GDAL_OF_RASTER | GDAL_OF_READONLY));
    if (!file) throw std::runtime_error(fmt::format("{}: cannot be opened", path));
    return file;
}

struct Post {
    std::int64_t column, row;
};

/// Row by row, so that a mask of any size is read once.
std::vector<char> seen_in(const char* path, const Matrix& matrix, const std::vector<Post>& posts) {
    const Dataset file = open(path);
    const int columns = file->GetRasterXSize();
    if (columns != matrix.columns || file->GetRasterYSize() != matrix.rows)
        throw std::runtime_error(fmt::format("{}: its size is not the terrain's", path));
    GDALRasterBand* band = file->GetRasterBand(1);
    const bool angles = band->GetRasterDataType() != GDT_Byte;
    int has_none = 0;
    const double none = band->GetNoDataValue(&has_none);
    std::vector<char> seen(posts.size());
    std::vector<double> line(static_cast<std::size_t>(columns));
    std::int64_t held = -1;
    for (std::size_t i = 0; i < posts.size(); ++i) {
        if (held != posts[i].row) {
            held = posts[i].row;
            if (band->RasterIO(GF_Read, 0, static_cast<int>(held), columns, 1, line.data(), columns, 1, GDT_Float64, 0,
                               0, nullptr) != CE_None)
                throw std::runtime_error(fmt::format("{}: row {} cannot be read", path, held));
        }
        const double value = line[static_cast<std::size_t>(posts[i].column)];
        seen[i] = angles ? !std::isnan(value) && !(has_none && value == none) : value == 255;
    }
    return seen;
}

void check(int argc, char** argv) {
    GDALAllRegister();
    const Raster raster = read(argv[1], false);
    const Matrix& matrix = raster.matrix;
    double at[6];
    if (open(argv[1])->GetGeoTransform(at) != CE_None)
        throw std::runtime_error(fmt::format("{}: has no geotransform", argv[1]));
    Sensor sensor;
    sensor.column = (number(argv[2]) - at[0]) / at[1] - 0.5;
    sensor.row = (number(argv[3]) - at[3]) / at[5] - 0.5;
    sensor.height_m = LineOfSight::ground(matrix, sensor.column, sensor.row) + number(argv[4]);
    sensor.earth_k = 4.0 / 3;

    std::mt19937_64 random(20240711);
    std::vector<Post> posts(static_cast<std::size_t>(number(argv[5])));
    for (Post& post : posts) do {
            post.column = static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(matrix.columns));
            post.row = static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(matrix.rows));
        } while (std::isnan(matrix.at(post.column, post.row)));
    std::sort(posts.begin(), posts.end(),
              [](const Post& a, const Post& b) { return std::pair(a.row, a.column) < std::pair(b.row, b.column); });
    std::vector<char> truth(posts.size());
    const auto look = [&](std::size_t first, std::size_t step) {
        const LineOfSight sight(matrix, raster.grid, sensor);
        for (std::size_t i = first; i < posts.size(); i += step)
            truth[i] = sight.look(posts[i].column, posts[i].row).state == Verdict::seen;
    };
    std::vector<std::thread> threads;
    const std::size_t count = std::max(1U, std::thread::hardware_concurrency());
    for (std::size_t t = 0; t < count; ++t) threads.emplace_back(look, t, count);
    for (std::thread& t : threads) t.join();

    for (int m = 6; m < argc; ++m) {
        const std::vector<char> mask = seen_in(argv[m], matrix, posts);
        double visible = 0, wrong = 0, too_much = 0, both = 0, either = 0;
        for (std::size_t i = 0; i < posts.size(); ++i) {
            const bool mine = mask[i] != 0, theirs = truth[i] != 0;
            visible += theirs;
            wrong += mine != theirs;
            too_much += mine && !theirs;
            both += mine && theirs;
            either += mine || theirs;
        }
        const double percent = 100 / static_cast<double>(posts.size());
        fmt::print("{:.3f} {:.4f} {:.4f} {:.4f} {}\n", visible * percent, wrong * percent, too_much * percent,
                   either > 0 ? both / either : 1.0, argv[m]);
    }
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 7) {
        fmt::print(stderr, "usage: check_mask DEM.tif X Y HEIGHT POSTS MASK.tif...\n");
        return 2;
    }
    try {
        check(argc, argv);
        return 0;
    } catch (const std::exception& e) {
        fmt::print(stderr, "check_mask: {}\n", e.what());
        return 1;
    }
}
