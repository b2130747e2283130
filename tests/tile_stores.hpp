// Tile stores made by a test, for the sources of tile_store_test: what is tiled and how, the rasters it is drawn of, its posts
// as GDAL and as the engine read them, and its block map against its definition.
#pragma once
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "lib/stop.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/file_content.hpp"
#include "tiles/source_choice.hpp"
#include "tiles/tile_store.hpp"

namespace wedgescope::test {

inline TileStoreParams into(const std::string& output, const std::vector<std::string>& dems) {
    TileStoreParams params;
    params.dems = dems;
    params.output = output;
    params.memory_bytes = std::size_t{256} << 20;
    params.cache_bytes = std::size_t{16} << 20;
    params.threads = 2;
    params.most_as_it_is = 0;  // packed, as large ones are
    params.software = "test";
    return params;
}

/// A run that is interrupted when more than so much of it is done.
inline void write_until(TileStoreParams params, double fraction) {
    Stop stop;
    params.stop = &stop;
    params.progress = [&](double done) {
        if (done > fraction) stop.request(SIGTERM);
    };
    CHECK_THROWS_AS(write_tile_store(params), Interrupted);
}

inline DataBaseParams base(const std::string& dem) {
    DataBaseParams params;
    params.dem = dem;
    params.cache_bytes = std::size_t{4} << 20;
    return params;
}

/// The first band as GDAL gives it, in doubles.
struct Plain {
    int columns = 0, rows = 0;
    std::vector<double> values;
    std::string type;
    double no_data = 0, scale = 1, offset = 0;
    bool has_no_data = false;
    std::string unit;
    std::vector<double> g = std::vector<double>(6);
    explicit Plain(const std::string& path) {
        GDALAllRegister();
        GDALDataset* in = GDALDataset::Open(path.c_str());
        if (!in) throw std::runtime_error("cannot open " + path);
        GDALRasterBand* band = in->GetRasterBand(1);
        columns = in->GetRasterXSize();
        rows = in->GetRasterYSize();
        in->GetGeoTransform(g.data());
        int has = 0;
        no_data = band->GetNoDataValue(&has);
        has_no_data = has != 0;
        scale = band->GetScale();
        offset = band->GetOffset();
        unit = band->GetUnitType();
        type = GDALGetDataTypeName(band->GetRasterDataType());
        values.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
        if (band->RasterIO(GF_Read, 0, 0, columns, rows, values.data(), columns, rows, GDT_Float64, 0, 0, nullptr) !=
            CE_None)
            throw std::runtime_error("cannot read " + path);
        GDALClose(in);
    }
    double at(std::int64_t c, std::int64_t r) const { return values[static_cast<std::size_t>(r * columns + c)]; }
};

inline bool same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }
inline bool same(const std::vector<double>& a, const std::vector<double>& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](double x, double y) { return same(x, y); });
}
inline bool same(std::span<const float> a, std::span<const float> b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](float x, float y) { return same(x, y); });
}

/// Heights of the whole data base through the engine's interface.
inline RawVector<float> heights(WedgeSource& source) {
    const DataBase& d = source.data_base();
    return source.load({{0, d.columns}, {0, d.rows}}, false).surface_m;
}

/// Of all files of a folder and of those in it, by their names from it on.
inline std::map<std::string, std::string> contents(const std::string& folder) {
    std::map<std::string, std::string> all;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
        if (entry.is_regular_file()) all[std::filesystem::relative(entry.path(), folder).string()] = content(entry);
    return all;
}

/// Hills, with a void hole and a stripe of voids.
inline Drawing hills(int columns, int rows, unsigned seed = 1) {
    Drawing d;
    d.columns = columns;
    d.rows = rows;
    d.type = GDT_Int16;
    d.no_data = -32768;
    d.value = [=](int c, int r) {
        if ((c > columns / 2 && c < columns / 2 + 80 && r > rows / 3) || r == rows / 5) return -32768.0;
        return std::floor(300 * std::sin(0.02 * c + seed) + 200 * std::cos(0.05 * r) + (c * 7 + r * 13) % 11);
    };
    return d;
}

/// Bounds of a block straight from its definition.
inline BlockBounds brute(std::span<const float> z, std::span<const float> h, std::int64_t columns, std::int64_t rows,
                         bool cyclic, int level, std::int64_t c, std::int64_t r) {
    const std::int64_t edge = block_posts << level;
    BlockBounds b;
    std::int64_t voids = 0, posts = 0;
    for (std::int64_t y = r * edge; y <= (r + 1) * edge && y < rows; ++y)
        for (std::int64_t x = c * edge; x <= (c + 1) * edge && x < columns + cyclic; ++x) {
            const auto at = static_cast<std::size_t>(y * columns + x % columns);
            ++posts;
            if (!h.empty()) b.culture_m = std::max(b.culture_m, h[at]);
            if (std::isnan(z[at])) {
                ++voids;
                continue;
            }
            b.lowest_m = std::min(b.lowest_m, z[at]);
            b.highest_m = std::max(b.highest_m, z[at]);
        }
    b.voids = voids == 0 ? Voids::none : voids == posts ? Voids::all : Voids::some;
    return b;
}

/// Blocks whose bounds in the store's map are not those, at all levels.
inline std::int64_t wrong_blocks(const std::string& store, float scale, bool cyclic) {
    auto params = base(store);
    params.culture_height_scale = static_cast<double>(scale);
    const auto source = open_direct_source(params);
    const DataBase& d = source->data_base();
    const Chunk chunk = source->load({{0, d.columns}, {0, d.rows}}, false);
    std::vector<float> bare(chunk.surface_m.size());
    for (std::int64_t r = 0; r < d.rows; ++r)
        for (std::int64_t c = 0; c < d.columns; ++c)
            bare[static_cast<std::size_t>(r * d.columns + c)] = source->bare_terrain_m(c, r);
    BlockMap* map = source->block_map();
    REQUIRE(map);
    std::int64_t wrong = 0;
    for (int level = 0; level < map->levels(); ++level) {
        const Window all = blocks_of({{0, d.columns}, {0, d.rows}}, level);
        const BlockWindow found = map->read(level, all);
        for (std::int64_t r = 0; r < all.rows.end; ++r)
            for (std::int64_t c = 0; c < all.columns.end; ++c)
                wrong +=
                    !(found.at(c, r) == brute(bare, chunk.culture_height_m, d.columns, d.rows, cyclic, level, c, r));
    }
    const Window last = blocks_of({{0, d.columns}, {0, d.rows}}, map->levels() - 1);
    CHECK((last.columns.size() <= 64 && last.rows.size() <= 64));
    return wrong;
}

}  // namespace wedgescope::test
