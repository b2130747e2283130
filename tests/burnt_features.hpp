// What tests of features share: the shipped ground's grid, features drawn on it, and cells as they were burnt.
#pragma once
#include <gdal_priv.h>

#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/json.hpp"
#include "tiles/tile_store.hpp"

namespace wedgescope::test {

inline const std::string data = WEDGESCOPE_TEST_DATA;
inline const std::string dem = data + "/inland_empire_dem.tif";

// The shipped ground: 1600 x 1600 cells of 30 m, UTM zone 11.
constexpr int side = 1600;
constexpr double west = 429717.925899235007819, north = 3764093.077020850032568, step = 30;
inline double x_at(double column) { return west + step * column; }
inline double y_at(double row) { return north - step * row; }

/// A GeoJSON of features whose coordinates are columns and rows of the shipped ground, in its own CRS.
class GeoJson {
public:
    using Places = std::vector<std::pair<double, double>>;
    GeoJson& add(const char* type, const Places& places, const nlohmann::json& fields) {
        nlohmann::json coordinates = nlohmann::json::array();
        for (const auto& [c, r] : places) coordinates.push_back({x_at(c), y_at(r)});
        if (std::string(type) == "Point") coordinates = coordinates[0];
        if (std::string(type) == "Polygon") coordinates = nlohmann::json::array({coordinates});
        features_.push_back({{"type", "Feature"},
                             {"properties", fields},
                             {"geometry", {{"type", type}, {"coordinates", coordinates}}}});
        return *this;
    }
    /// From column and row on, up to the last ones.
    GeoJson& add_box(int c0, int r0, int c1, int r1, const nlohmann::json& fields) {
        return add("Polygon", {{c0, r0}, {c1, r0}, {c1, r1}, {c0, r1}, {c0, r0}}, fields);
    }
    std::string write(const std::string& path) const {
        const nlohmann::json all{{"type", "FeatureCollection"},
                                 {"crs", {{"type", "name"}, {"properties", {{"name", "urn:ogc:def:crs:EPSG::32611"}}}}},
                                 {"features", features_}};
        std::ofstream(path) << all.dump();
        return path;
    }

private:
    nlohmann::json features_ = nlohmann::json::array();
};

struct Cells {
    int columns = 0, rows = 0;
    std::vector<float> values;
    std::string type;
    double no_data = 0;
    float at(int c, int r) const {
        return values[static_cast<std::size_t>(r) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(c)];
    }
};
inline Cells cells_of(const std::string& path) {
    GDALDataset* file = GDALDataset::FromHandle(GDALOpen(path.c_str(), GA_ReadOnly));
    if (!file) throw std::runtime_error("cannot open " + path);
    Cells out{file->GetRasterXSize(), file->GetRasterYSize(), {}, "", 0};
    out.values.resize(static_cast<std::size_t>(out.columns) * static_cast<std::size_t>(out.rows));
    GDALRasterBand* band = file->GetRasterBand(1);
    out.type = GDALGetDataTypeName(band->GetRasterDataType());
    out.no_data = band->GetNoDataValue();
    const CPLErr read = band->RasterIO(GF_Read, 0, 0, out.columns, out.rows, out.values.data(), out.columns, out.rows,
                                       GDT_Float32, 0, 0, nullptr);
    GDALClose(file);
    if (read != CE_None) throw std::runtime_error("cannot read " + path);
    return out;
}

inline TileStoreParams into(const std::string& output, const std::string& features, const std::string& culture = "",
                            const std::string& height = "", double unit_m = 1, bool touch = false) {
    TileStoreParams params;
    params.dems = {dem};
    params.output = output;
    params.culture = culture;
    params.culture_height = height;
    params.memory_bytes = std::size_t{256} << 20;
    params.cache_bytes = std::size_t{16} << 20;
    params.threads = 2;
    params.software = "test";
    params.features = FeatureParams{features, "", touch, *Legend::built_in("smc"), {}};
    params.culture_height_scale = unit_m;
    if (!culture.empty()) params.legend = Legend::built_in("fbfm40");
    params.legend = with_features(params.legend, {});
    params.legend_name = params.legend->name();
    params.legend_csv = params.legend->csv({});
    return params;
}

constexpr int metal = 15, urban = 11, concrete = 12;

}  // namespace wedgescope::test
