#include "tiles/value_trial.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "lib/error.hpp"
#include "tiles/driver_trial.hpp"
#include "tiles/raster_dataset.hpp"
#include "tiles/raster_driver.hpp"

namespace wedgescope {

void refuse_codes(GDALDriver& driver, const RasterFormat& format, const std::string& final_path, const char* why) {
    throw InputError(text("output '", final_path, "' holds codes, and ", driver_words(driver, format), " ", why,
                          "; accepted: .tif, .img and others without loss"));
}

bool keeps_codes(GDALDriver& driver, const CPLStringList& options, const RasterFormat& format,
                 const RasterContent& wanted, const std::string& final_path) {
    const TrialCells trial(wanted.codes);
    RasterContent content = trial.content();
    content.means_something = wanted.means_something;
    content.means_nothing = wanted.means_nothing;
    const Trial tried = try_driver(driver, options, content, final_path, [&](GDALDataset& written) {
        const char* const sign = written.GetRasterBand(1)->GetMetadataItem("PIXELTYPE", "IMAGE_STRUCTURE");
        return trial.are_in(written) && !(sign && EQUAL(sign, "SIGNEDBYTE"));  // of 255 that makes -1
    });
    if (tried.meant_void) refuse_no_data(driver, final_path);
    if (tried.kept) return true;
    check_made(tried, driver, format, final_path);
    if (!tried.refused.empty()) return false;
    refuse_codes(driver, format, final_path, "does not keep them as they are");
}

void check_values(GDALDriver& driver, const CPLStringList& options, const RasterFormat& format,
                  const RasterContent& wanted, const std::string& final_path) {
    constexpr int side = 64;
    const bool counts = !GDALDataTypeIsFloating(wanted.type);
    const bool metres = !counts && wanted.bands[0].unit == "m";
    const double most = wanted.type == GDT_Byte ? 255 : 65535;
    std::vector<double> values(std::size_t{side} * side);
    std::uint32_t random = 1;
    for (double& value : values) {
        const double part = static_cast<double>((random = random * 1664525 + 1013904223) >> 8) * 0x1p-24;
        value = counts ? std::floor(part * (most + 1)) : metres ? 100 + 2e6 * part * part * part : 270 * part - 180;
    }
    values[0] = 0;
    const int bytes = GDALGetDataTypeSizeBytes(wanted.type);
    std::vector<std::uint64_t> cells(values.size());  // of the widest type
    GDALCopyWords64(values.data(), GDT_Float64, sizeof(double), cells.data(), wanted.type, bytes,
                    static_cast<GPtrDiff_t>(values.size()));
    RasterContent content;
    content.columns = content.rows = side;
    content.type = wanted.type;
    content.bands = {{cells.data(), "", "", {}, {}}};
    content.means_something = wanted.means_something;
    content.means_nothing = wanted.means_nothing;
    content.crs = wanted.crs;
    content.geotransform = wanted.geotransform;  // without their place some take nothing
    const auto good = [&](GDALDataset& written) {
        std::vector<double> back(values.size());
        if (written.GetRasterXSize() != side || written.GetRasterYSize() != side ||
            written.GetRasterBand(1)->RasterIO(GF_Read, 0, 0, side, side, back.data(), side, side, GDT_Float64, 0, 0,
                                               nullptr) != CE_None)
            return false;
        return std::equal(values.begin(), values.end(), back.begin(), [&](double value, double read) {
            return counts ? value == read : std::abs(value - read) <= (metres ? 0.1 * value : 0.1);
        });
    };
    const Trial tried = try_driver(driver, options, content, final_path, good);
    if (tried.meant_void) refuse_no_data(driver, final_path);
    if (tried.kept) return;
    if (!tried.read_back) {
        // Some make no file in memory, whatever the options.
        RasterFormat plain = format;
        plain.creation.clear();
        if (format.creation.empty() ||
            !try_driver(driver, creation_options(driver, wanted.type, {}, plain), content, final_path, good).read_back)
            return;
        return check_made(tried, driver, format, final_path);
    }
    throw InputError(text("output '", final_path, "' holds ", counts ? "counts" : "numbers", ", and ",
                          driver_words(driver, format), " does not keep them", counts ? " as they are" : "",
                          "; accepted: .tif, .img and others without loss"));
}

}  // namespace wedgescope
