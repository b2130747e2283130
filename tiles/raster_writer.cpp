#include "tiles/raster_writer.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "lib/error.hpp"
#include "lib/threads.hpp"
#include "tiles/geolocation_array.hpp"
#include "tiles/png_file.hpp"
#include "tiles/raster_dataset.hpp"
#include "tiles/raster_driver.hpp"
#include "tiles/side_file.hpp"
#include "tiles/value_trial.hpp"

namespace wedgescope {
namespace {

/// Of a grey picture, with or without alpha, those that are written without GDAL.
bool is_plain_png(const RasterContent& content, const OutputFile& file, const RasterFormat& format) {
    return needs_no_driver("PNG", file.final_path(), format) && content.type == GDT_Byte && !content.bands[0].no_data &&
           std::all_of(content.bands.begin(), content.bands.end(),
                       [](const BandContent& band) { return band.unit.empty() && band.categories.empty(); }) &&
           (content.bands.size() == 1 || (content.bands.size() == 2 && content.bands[1].alpha));
}

void write_plain_png(const RasterContent& content, const Metadata& geolocation, const OutputFile& file) {
    std::vector<const std::uint8_t*> bands;
    for (const BandContent& band : content.bands) bands.push_back(static_cast<const std::uint8_t*>(band.cells));
    write_png(file.temporary_path(), content.columns, content.rows, bands, at_hand(content.threads), file.final_path());
    write_side_file(content, geolocation, file.temporary_path(), file.final_path());
}

void check_size(const RasterContent& content, const std::string& final_path) {
    if (content.columns < 1 || content.rows < 1 || content.columns > std::numeric_limits<int>::max() ||
        content.rows > std::numeric_limits<int>::max())
        throw InputError(text("output '", final_path, "' would have ", content.columns, " x ", content.rows,
                              " cells; accepted: 1 to ", std::numeric_limits<int>::max(), " either way"));
}

}  // namespace

void write_raster(const RasterContent& content, const OutputFile& file, const RasterFormat& format) {
    const std::string& final_path = file.final_path();
    check_size(content, final_path);
    Metadata geolocation_items;
    if (content.geolocation) {
        geolocation_items = geolocation_metadata(*content.geolocation, final_path);
        write_geolocation(*content.geolocation, file.temporary_path() + ".geoloc.tif", final_path);
    }
    if (is_plain_png(content, file, format)) return write_plain_png(content, geolocation_items, file);
    GDALDriver& driver = driver_for(final_path, content.type, format);
    const CPLStringList options =
        creation_options(driver, content.type, {content.patches, content.quick_to_read}, format);
    CPLStringList geolocation;
    for (const auto& [key, value] : geolocation_items) geolocation.SetNameValue(key.c_str(), value.c_str());

    GdalErrors errors;
    const std::string& path = file.temporary_path();
    std::optional<OwnBlocks> own;
    DatasetHandle dataset;
    if (has_capability(driver, GDAL_DCAP_CREATE)) {
        dataset = created_dataset(driver, path, final_path, content, options, geolocation);
        if (!dataset) fail_to_write(final_path, path, errors);
        if (!set_no_data_apart(*dataset, content)) refuse_no_data(driver, final_path);
        write_bands(*dataset, content, final_path, path, errors);
    } else {
        const std::int64_t all_bytes = content.columns * content.rows * GDALGetDataTypeSizeBytes(content.type) *
                                       static_cast<std::int64_t>(content.bands.size());
        if (all_bytes <= GDALGetCacheMax64()) own.emplace();
        dataset = copied_dataset(driver, path, content, options);
        if (!dataset) fail_to_write(final_path, path, errors);
        GdalErrors quiet;
        if (geolocation.Count() > 0) dataset->SetMetadata(const_cast<char**>(geolocation.List()), "GEOLOCATION");
    }
    dataset->FlushCache(true);
    dataset.reset();
    if (errors.failed()) fail_to_write(final_path, path, errors);
}

DatasetHandle create_raster(const RasterContent& content, const OutputFile& file, const RasterFormat& format) {
    const std::string& final_path = file.final_path();
    GDALDriver& driver = driver_for(final_path, content.type, format);
    const CPLStringList options =
        creation_options(driver, content.type, {content.patches, content.quick_to_read}, format);
    if (!has_capability(driver, GDAL_DCAP_CREATE))
        throw InputError(
            text("output '", final_path, "': driver ", driver.GetDescription(),
                 " writes whole rasters only, and this one is written tile by tile; accepted: .tif, .img, or --of one "
                 "that does so too (GTiff, HFA, ENVI, netCDF)"));
    if (!is_usual_geotiff(final_path, format)) {
        if (content.codes.empty())
            check_values(driver, options, format, content, final_path);
        else
            keeps_codes(driver, options, format, content, final_path);
    }
    GdalErrors errors;
    DatasetHandle dataset = created_dataset(driver, file.temporary_path(), final_path, content, options);
    if (!dataset) fail_to_write(final_path, file.temporary_path(), errors);
    if (!set_no_data_apart(*dataset, content)) refuse_no_data(driver, final_path);
    return dataset;
}

void close_raster(DatasetHandle dataset, const std::string& final_path) {
    const std::string written_path = dataset->GetDescription();
    GdalErrors errors;
    // Of tiles that GDAL fills in it says only that it cannot.
    dataset->FlushCache(true);
    errors.note_disk();
    dataset.reset();
    errors.note_disk();
    if (errors.failed()) fail_to_write(final_path, written_path, errors);
}

}  // namespace wedgescope
