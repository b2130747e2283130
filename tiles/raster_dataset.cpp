#include "tiles/raster_dataset.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

/// A dataset round arrays that are ours.
DatasetHandle dataset_in_memory(const RasterContent& content) {
    GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("MEM");
    DatasetHandle dataset(driver->Create("", static_cast<int>(content.columns), static_cast<int>(content.rows), 0,
                                         content.type, nullptr));
    for (const BandContent& band : content.bands) {
        char address[64] = {};
        CPLPrintPointer(address, const_cast<void*>(band.cells), sizeof address - 1);
        CPLStringList options;
        options.SetNameValue("DATAPOINTER", address);
        dataset->AddBand(content.type, options.List());
    }
    return dataset;
}

bool declares_meaning_void(GDALRasterBand& band, const RasterContent& content) {
    int declared = 0;
    const double value = band.GetNoDataValue(&declared);
    return declared && content.means_something && content.means_something(value);
}

}  // namespace

DatasetHandle copied_dataset(GDALDriver& driver, const std::string& path, const RasterContent& content,
                             const CPLStringList& options) {
    const DatasetHandle memory = dataset_in_memory(content);
    describe_dataset(*memory, content, {});
    return DatasetHandle(
        driver.CreateCopy(path.c_str(), memory.get(), FALSE, const_cast<char**>(options.List()), nullptr, nullptr));
}

void describe_dataset(GDALDataset& dataset, const RasterContent& content, const CPLStringList& geolocation) {
    GdalErrors quiet;
    for (const auto& [key, value] : content.metadata) dataset.SetMetadataItem(key.c_str(), value.c_str());
    if (!content.crs.empty()) {
        OGRSpatialReference crs;
        if (crs.SetFromUserInput(content.crs.c_str()) == OGRERR_NONE) {
            crs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
            dataset.SetSpatialRef(&crs);
        }
    }
    if (content.geotransform) {
        std::array<double, 6> terms = *content.geotransform;
        dataset.SetGeoTransform(terms.data());
    }
    if (geolocation.Count() > 0) dataset.SetMetadata(const_cast<char**>(geolocation.List()), "GEOLOCATION");
    for (std::size_t b = 0; b < content.bands.size(); ++b) {
        GDALRasterBand& band = *dataset.GetRasterBand(static_cast<int>(b) + 1);
        const BandContent& from = content.bands[b];
        if (!from.description.empty()) band.SetDescription(from.description.c_str());
        if (!from.unit.empty()) band.SetUnitType(from.unit.c_str());
        if (from.no_data) band.SetNoDataValue(*from.no_data);
        if (!from.categories.empty()) {
            CPLStringList names;
            for (const std::string& category : from.categories) names.AddString(category.c_str());
            band.SetCategoryNames(names.List());
        }
        if (from.alpha) band.SetColorInterpretation(GCI_AlphaBand);
    }
}

DatasetHandle created_dataset(GDALDriver& driver, const std::string& path, const std::string& final_path,
                              const RasterContent& content, const CPLStringList& options,
                              const CPLStringList& geolocation) {
    const int bands = static_cast<int>(content.bands.size());
    DatasetHandle made(driver.Create(path.c_str(), static_cast<int>(content.columns), static_cast<int>(content.rows),
                                     bands, content.type, const_cast<char**>(options.List())));
    if (made && made->GetRasterCount() < bands)
        throw IoError(text("output '", final_path, "' cannot be written: of ", bands, " bands driver ",
                           driver.GetDescription(), " makes ", made->GetRasterCount()));
    if (made) describe_dataset(*made, content, geolocation);
    return made;
}

bool declares_meaning_void(GDALDataset& dataset, const RasterContent& content) {
    for (int b = 1; b <= dataset.GetRasterCount(); ++b)
        if (declares_meaning_void(*dataset.GetRasterBand(b), content)) return true;
    return false;
}

bool set_no_data_apart(GDALDataset& dataset, const RasterContent& content) {
    GdalErrors quiet;
    for (int b = 1; b <= dataset.GetRasterCount(); ++b) {
        GDALRasterBand& band = *dataset.GetRasterBand(b);
        if (declares_meaning_void(band, content)) band.DeleteNoDataValue();
        if (declares_meaning_void(band, content)) band.SetNoDataValue(content.means_nothing);
    }
    return !declares_meaning_void(dataset, content);
}

void refuse_no_data(GDALDriver& driver, const std::string& final_path) {
    throw InputError(text("output '", final_path, "': driver ", driver.GetDescription(),
                          " declares one of the values in it as no data and cannot be told otherwise; accepted: "
                          ".tif, .img and others that declare none by themselves"));
}

void write_bands(GDALDataset& dataset, const RasterContent& content, const std::string& final_path,
                 const std::string& written_path, const GdalErrors& errors) {
    int wide = 0, high = 0;
    dataset.GetRasterBand(1)->GetBlockSize(&wide, &high);
    const auto bytes = static_cast<std::int64_t>(GDALGetDataTypeSizeBytes(content.type));
    const auto of_band = [&](std::size_t b) { return dataset.GetRasterBand(static_cast<int>(b) + 1); };
    for (std::int64_t row = 0; row < content.rows; row += high)
        for (std::int64_t column = 0; column < content.columns; column += wide) {
            const int columns = static_cast<int>(std::min<std::int64_t>(wide, content.columns - column)),
                      rows = static_cast<int>(std::min<std::int64_t>(high, content.rows - row));
            const OwnBlocks own;
            // All bands first: where a block of the file holds those of all.
            for (std::size_t b = 0; b < content.bands.size(); ++b) {
                const auto* cells =
                    static_cast<const std::byte*>(content.bands[b].cells) + (row * content.columns + column) * bytes;
                if (of_band(b)->RasterIO(GF_Write, static_cast<int>(column), static_cast<int>(row), columns, rows,
                                         const_cast<std::byte*>(cells), columns, rows, content.type, bytes,
                                         content.columns * bytes, nullptr) != CE_None)
                    fail_to_write(final_path, written_path, errors);
            }
            for (std::size_t b = 0; b < content.bands.size(); ++b)
                // A band that keeps no blocks (Zarr's) says that it cannot, and no error.
                if (of_band(b)->FlushBlock(static_cast<int>(column / wide), static_cast<int>(row / high)) != CE_None &&
                    errors.failed())
                    fail_to_write(final_path, written_path, errors);
        }
}

void fail_to_write(const std::string& final_path, const std::string& written_path, const GdalErrors& errors) {
    throw IoError(text("output '", final_path, "' cannot be written: ", errors.reason_of_writing(written_path)));
}

}  // namespace wedgescope
