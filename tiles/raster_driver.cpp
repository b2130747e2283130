#include "tiles/raster_driver.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <map>
#include <utility>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "tiles/gdal_session.hpp"

namespace wedgescope {
namespace {

bool writes_rasters(GDALDriver& driver) {
    const std::string name = driver.GetDescription();
    if (name == "MEM" || name == "VRT") return false;  // would refer to what is gone when we end
    return has_capability(driver, GDAL_DCAP_RASTER) &&
           (has_capability(driver, GDAL_DCAP_CREATE) || has_capability(driver, GDAL_DCAP_CREATECOPY));
}

std::string ending(const std::string& path) {
    std::string found = std::filesystem::path(path).extension().string();
    if (!found.empty()) found.erase(0, 1);
    return lower_case(std::move(found));
}

/// By the ending; null: one that is looked for among all drivers, or none.
const char* usual_driver(const std::string& path) {
    static const std::map<std::string, const char*> usual = {{"tif", "GTiff"},  {"tiff", "GTiff"}, {"png", "PNG"},
                                                             {"jpg", "JPEG"},   {"jpeg", "JPEG"},  {"img", "HFA"},
                                                             {"asc", "AAIGrid"}};
    const auto found = usual.find(ending(path));
    return found == usual.end() ? nullptr : found->second;
}

/// Is it that driver's, by what is said or by the ending?
bool is_of(const char* driver, const std::string& path, const RasterFormat& format) {
    const char* const wanted = format.driver.empty() ? usual_driver(path) : format.driver.c_str();
    return wanted && EQUAL(wanted, driver);
}

GDALDriver& find_driver(const std::string& path, const RasterFormat& format) {
    GDALDriverManager& drivers = *GetGDALDriverManager();
    if (!format.driver.empty()) {
        GDALDriver* driver = drivers.GetDriverByName(format.driver.c_str());
        if (!driver) {
            register_all_drivers();
            driver = drivers.GetDriverByName(format.driver.c_str());
        }
        if (!driver || !writes_rasters(*driver))
            throw InputError(text("of '", format.driver,
                                  "' is no GDAL driver that writes raster files; accepted: GTiff, PNG, JPEG, HFA, ",
                                  "ENVI, ... (gdalinfo --formats lists them)"));
        return *driver;
    }
    const std::string extension = ending(path);
    const char* const usual = usual_driver(path);
    for (const bool all : {false, true}) {
        if (all) register_all_drivers();
        if (!usual) continue;
        if (GDALDriver* driver = drivers.GetDriverByName(usual)) return *driver;
    }
    if (!extension.empty())
        for (int i = 0; i < drivers.GetDriverCount(); ++i) {
            GDALDriver& driver = *drivers.GetDriver(i);
            const char* list = driver.GetMetadataItem(GDAL_DMD_EXTENSIONS);
            if (!list || !writes_rasters(driver)) continue;
            const CPLStringList words(CSLTokenizeString(list));
            if (words.FindString(extension.c_str()) >= 0) return driver;
        }
    throw InputError(text(
        "output '", path,
        "' has an ending that names no raster format; accepted: .tif, .img, for pictures and for codes "
        "by range and azimuth also .png, for pictures .jpg, and those of GDAL's other raster drivers, or --of DRIVER"));
}

/// Drivers that write the time into their files, or the temporary name that these are written under.
bool differs_each_time(const std::string& driver) {
    constexpr const char* all[] = {"netCDF", "PCIDSK", "ISIS3", "GPKG", "BAG", "HDF4Image", "Rasterlite", "ENVI"};
    return std::find(std::begin(all), std::end(all), driver) != std::end(all);
}

std::string listed(const CPLStringList& words) {
    std::string out;
    for (int i = 0; i < words.size(); ++i) out += text(i > 0 ? ", " : "", words[i]);
    return out;
}

}  // namespace

bool has_capability(GDALDriver& driver, const char* capability) {
    const char* value = driver.GetMetadataItem(capability);
    return value && CPLTestBool(value);
}

bool needs_no_driver(const char* driver, const std::string& final_path, const RasterFormat& format) {
    if (!format.creation.empty() || GdalSession::configured()) return false;
    return is_of(driver, final_path, format);
}

bool is_usual_geotiff(const std::string& path, const RasterFormat& format) {
    return is_of("GTiff", path, format) && format.creation.empty();
}

GDALDriver& driver_for(const std::string& path, GDALDataType type, const RasterFormat& format) {
    GDALDriver& driver = find_driver(path, format);
    if (format.reproducible && differs_each_time(driver.GetDescription()))
        throw InputError(text(
            "output '", path, "' is to be the same bytes every time (--reproducible or SOURCE_DATE_EPOCH), and driver ",
            driver.GetDescription(),
            " writes the time or a temporary name into its files; accepted: another format, such as .tif"));
    if (const char* types = driver.GetMetadataItem(GDAL_DMD_CREATIONDATATYPES)) {
        const CPLStringList words(CSLTokenizeString(types));
        if (words.FindString(GDALGetDataTypeName(type)) < 0)
            throw InputError(text("output '", path, "' holds ", GDALGetDataTypeName(type), " values, driver ",
                                  driver.GetDescription(), " takes ", listed(words),
                                  "; accepted: another format, such as .tif"));
    }
    return driver;
}

bool swaps_bytes(const std::string& endianness) {
    const bool big = std::endian::native == std::endian::big;
    return EQUAL(endianness.c_str(), "INVERTED") || EQUAL(endianness.c_str(), big ? "LITTLE" : "BIG");
}

void refuse_predictor(const std::string& endianness) {
    throw InputError(text("co PREDICTOR=3 with ENDIANNESS=", endianness,
                          " makes files that GDAL does not read back; accepted: PREDICTOR=1"));
}

/// Creation options by which a driver (ISIS3, PDS4, MRF) writes its posts wherever they say, over whatever stands there.
bool names_file(const std::string& option) {
    constexpr const char* all[] = {"EXTERNAL_FILENAME", "IMAGE_FILENAME", "DATANAME", "INDEXNAME"};
    return std::any_of(std::begin(all), std::end(all), [&](const char* one) { return EQUAL(one, option.c_str()); });
}

CPLStringList creation_options(GDALDriver& driver, GDALDataType type, RasterPacking packing,
                               const RasterFormat& format) {
    const bool patches = packing.patches;
    CPLStringList options;
    const std::string name = driver.GetDescription();
    if (name == "GTiff") {
        options.SetNameValue("TILED", "YES");
        options.SetNameValue("COMPRESS", patches && type == GDT_Byte ? "PACKBITS" : "DEFLATE");
        // Bytes are codes: differences of neighbours take longer to make and to pack, and more room.
        if (type != GDT_Byte && !patches && !packing.quick_to_read)
            options.SetNameValue("PREDICTOR", GDALDataTypeIsFloating(type) ? "3" : "2");
        // Floats and counts: higher levels take twice as long for little less.
        if (GDALDataTypeIsFloating(type) || (patches && type != GDT_Byte)) options.SetNameValue("ZLEVEL", "1");
        options.SetNameValue("INTERLEAVE", "BAND");
        options.SetNameValue("BIGTIFF", "IF_SAFER");
    } else if (name == "PNG") {
        // Higher levels take up to twice as long for a tenth less.
        options.SetNameValue("ZLEVEL", "1");
    } else if (name == "COG") {
        options.SetNameValue("COMPRESS", "DEFLATE");
        options.SetNameValue("PREDICTOR", "YES");
    }
    CPLStringList given;
    for (const std::string& option : format.creation) {
        const std::size_t equals = option.find_first_of("=:");  // GDAL takes both
        if (equals == 0 || equals == std::string::npos || option[equals] != '=')
            throw InputError(text("co '", option, "' is no creation option; accepted: NAME=VALUE"));
        const std::string key = option.substr(0, equals);
        if (names_file(key))
            throw InputError(text("co '", option,
                                  "' names a file of its own, which could be any; accepted: options that "
                                  "leave it to the driver what stands beside the output"));
        given.SetNameValue(key.c_str(), option.c_str() + equals + 1);
        options.SetNameValue(key.c_str(), option.c_str() + equals + 1);
    }
    const std::string compression = options.FetchNameValueDef("COMPRESS", "");
    if (!EQUAL(compression.c_str(), "DEFLATE") && !EQUAL(compression.c_str(), "LZW") &&
        !EQUAL(compression.c_str(), "ZSTD") && !given.FetchNameValue("PREDICTOR"))
        options.SetNameValue("PREDICTOR", nullptr);
    if (name == "GTiff" && swaps_bytes(given.FetchNameValueDef("ENDIANNESS", "NATIVE")) &&
        EQUAL(options.FetchNameValueDef("PREDICTOR", ""), "3")) {
        if (given.FetchNameValue("PREDICTOR")) refuse_predictor(given.FetchNameValue("ENDIANNESS"));
        options.SetNameValue("PREDICTOR", nullptr);
    }
    GdalErrors errors;
    if (!GDALValidateCreationOptions(&driver, given.List()))
        throw InputError(text("co is not accepted by driver ", name, ": ", errors.reason()));
    return options;
}

}  // namespace wedgescope
