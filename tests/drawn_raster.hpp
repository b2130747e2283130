// Rasters drawn by a test: a folder that goes with the test, and a GeoTIFF with just the properties asked for.
#pragma once
#include <gdal_priv.h>
#include <ogr_spatialref.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace wedgescope::test {

class Folder {
public:
    Folder() {
        std::string name = (std::filesystem::temp_directory_path() / "wedgescope_test_XXXXXX").string();
        if (!mkdtemp(name.data())) throw std::runtime_error("no temporary folder");
        path_ = name;
    }
    ~Folder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;
    std::string operator/(const std::string& name) const { return (path_ / name).string(); }
    std::vector<std::string> names() const {
        std::vector<std::string> found;
        for (const auto& entry : std::filesystem::directory_iterator(path_))
            found.push_back(entry.path().filename().string());
        std::sort(found.begin(), found.end());
        return found;
    }

private:
    std::filesystem::path path_;
};

struct Drawing {
    int columns = 4, rows = 3;
    GDALDataType type = GDT_Float32;
    std::function<double(int column, int row)> value = [](int, int) { return 0.0; };
    std::optional<std::array<double, 6>> geotransform = std::array<double, 6>{1000, 10, 0, 2000, 0, -10};
    std::string crs = "EPSG:32611";
    std::optional<double> no_data;
    double scale = 1, offset = 0;
    std::string unit;
    std::function<bool(int column, int row)> masked;  ///< a mask band; true: void
    int bands = 1;
    std::vector<std::string> creation;
};

inline void draw(const std::string& path, const Drawing& d) {
    GDALAllRegister();
    CPLStringList options;
    for (const std::string& o : d.creation) options.AddString(o.c_str());
    GDALDataset* out = GetGDALDriverManager()->GetDriverByName("GTiff")->Create(path.c_str(), d.columns, d.rows,
                                                                                d.bands, d.type, options.List());
    if (!out) throw std::runtime_error("cannot draw " + path);
    if (d.geotransform) {
        auto terms = *d.geotransform;
        out->SetGeoTransform(terms.data());
    }
    if (!d.crs.empty()) {
        OGRSpatialReference crs;
        crs.SetFromUserInput(d.crs.c_str());
        crs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
        out->SetSpatialRef(&crs);
    }
    GDALRasterBand* band = out->GetRasterBand(1);
    if (d.no_data) band->SetNoDataValue(*d.no_data);
    if (d.scale != 1) band->SetScale(d.scale);
    if (d.offset != 0) band->SetOffset(d.offset);
    if (!d.unit.empty()) band->SetUnitType(d.unit.c_str());
    std::vector<double> line(static_cast<std::size_t>(d.columns));
    std::vector<std::uint8_t> mask(line.size());
    if (d.masked) {
        CPLSetThreadLocalConfigOption("GDAL_TIFF_INTERNAL_MASK", "YES");
        out->CreateMaskBand(GMF_PER_DATASET);
    }
    for (int r = 0; r < d.rows; ++r) {
        for (int c = 0; c < d.columns; ++c) line[static_cast<std::size_t>(c)] = d.value(c, r);
        CPLErr done =
            band->RasterIO(GF_Write, 0, r, d.columns, 1, line.data(), d.columns, 1, GDT_Float64, 0, 0, nullptr);
        if (done != CE_None) throw std::runtime_error("cannot draw " + path);
        if (!d.masked) continue;
        for (int c = 0; c < d.columns; ++c) mask[static_cast<std::size_t>(c)] = d.masked(c, r) ? 0 : 255;
        done = band->GetMaskBand()->RasterIO(GF_Write, 0, r, d.columns, 1, mask.data(), d.columns, 1, GDT_Byte, 0, 0,
                                             nullptr);
        if (done != CE_None) throw std::runtime_error("cannot draw the mask of " + path);
    }
    GDALClose(out);
}

}  // namespace wedgescope::test
