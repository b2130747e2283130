#include "tiles/raster_writer.hpp"

#include <cpl_string.h>
#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <numeric>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "lib/threads.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/png_file.hpp"
#include "tiles/side_file.hpp"

namespace wedgescope {
namespace {

constexpr double no_place = -1e30;  ///< no-data value of geolocation arrays

bool has(GDALDriver& driver, const char* capability) {
    const char* value = driver.GetMetadataItem(capability);
    return value && CPLTestBool(value);
}

bool writes_rasters(GDALDriver& driver) {
    const std::string name = driver.GetDescription();
    if (name == "MEM" || name == "VRT") return false;  // would refer to what is gone when we end
    return has(driver, GDAL_DCAP_RASTER) && (has(driver, GDAL_DCAP_CREATE) || has(driver, GDAL_DCAP_CREATECOPY));
}

std::string ending(const std::string& path) {
    std::string found = std::filesystem::path(path).extension().string();
    if (!found.empty()) found.erase(0, 1);
    return lower_case(std::move(found));
}

/// By the ending; null: one that is looked for among all drivers, or none.
const char* usual_driver(const std::string& path) {
    static const std::map<std::string, const char*> usual = {{"tif", "GTiff"}, {"tiff", "GTiff"}, {"png", "PNG"},
                                                             {"jpg", "JPEG"},  {"jpeg", "JPEG"},  {"img", "HFA"},
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

std::string listed(const CPLStringList& words) {
    std::string out;
    for (int i = 0; i < words.size(); ++i) out += text(i > 0 ? ", " : "", words[i]);
    return out;
}

/// find_driver, if it takes values of that type.
GDALDriver& driver_for(const std::string& path, GDALDataType type, const RasterFormat& format) {
    GDALDriver& driver = find_driver(path, format);
    if (const char* types = driver.GetMetadataItem(GDAL_DMD_CREATIONDATATYPES)) {
        const CPLStringList words(CSLTokenizeString(types));
        if (words.FindString(GDALGetDataTypeName(type)) < 0)
            throw InputError(text("output '", path, "' holds ", GDALGetDataTypeName(type), " values, driver ",
                                  driver.GetDescription(), " takes ", listed(words),
                                  "; accepted: another format, such as .tif"));
    }
    return driver;
}

struct Packing {
    bool patches = false, quick_to_read = false;  ///< as of a RasterContent
};

CPLStringList creation_options(GDALDriver& driver, GDALDataType type, Packing packing, const RasterFormat& format) {
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
        const std::size_t equals = option.find('=');
        if (equals == 0 || equals == std::string::npos)
            throw InputError(text("co '", option, "' is no creation option; accepted: NAME=VALUE"));
        const std::string key = option.substr(0, equals);
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

/// What a file may lack without being wrong: drivers that cannot hold it say so, nobody listens.
void describe(GDALDataset& dataset, const RasterContent& content, const CPLStringList& geolocation) {
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

/// A file of all the content's bands, described, without cells; null where the driver makes none. IoError where it makes fewer bands.
DatasetHandle created(GDALDriver& driver, const std::string& path, const std::string& final_path,
                      const RasterContent& content, const CPLStringList& options,
                      const CPLStringList& geolocation = {}) {
    const int bands = static_cast<int>(content.bands.size());
    DatasetHandle made(driver.Create(path.c_str(), static_cast<int>(content.columns), static_cast<int>(content.rows),
                                     bands, content.type, const_cast<char**>(options.List())));
    if (made && made->GetRasterCount() < bands)
        throw IoError(text("output '", final_path, "' cannot be written: of ", bands, " bands driver ",
                           driver.GetDescription(), " makes ", made->GetRasterCount()));
    if (made) describe(*made, content, geolocation);
    return made;
}

/// A dataset round arrays that are ours.
DatasetHandle in_memory(const RasterContent& content) {
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
bool declares_meaning_void(GDALDataset& dataset, const RasterContent& content) {
    for (int b = 1; b <= dataset.GetRasterCount(); ++b)
        if (declares_meaning_void(*dataset.GetRasterBand(b), content)) return true;
    return false;
}

/// Drivers with a no-data value of their own: where that is one of the values that mean something, the file is to declare none, or
/// one of no meaning. False: the driver keeps to its own.
bool set_no_data_apart(GDALDataset& dataset, const RasterContent& content) {
    GdalErrors quiet;
    for (int b = 1; b <= dataset.GetRasterCount(); ++b) {
        GDALRasterBand& band = *dataset.GetRasterBand(b);
        if (declares_meaning_void(band, content)) band.DeleteNoDataValue();
        if (declares_meaning_void(band, content)) band.SetNoDataValue(content.means_nothing);
    }
    return !declares_meaning_void(dataset, content);
}

[[noreturn]] void refuse_no_data(GDALDriver& driver, const std::string& final_path) {
    throw InputError(text("output '", final_path, "': driver ", driver.GetDescription(),
                          " declares one of the values in it as no data and cannot be told otherwise; accepted: "
                          ".tif, .img and others that declare none by themselves"));
}

/// While one stands no thread writes another thread's blocks: GDAL's cache is everybody's, and who needs room in it would
/// write what another one's file still lacks, while that one closes it.
class OwnBlocks {
public:
    OwnBlocks() { GDALRasterBlock::EnterDisableDirtyBlockFlush(); }
    ~OwnBlocks() { GDALRasterBlock::LeaveDisableDirtyBlockFlush(); }
    OwnBlocks(const OwnBlocks&) = delete;
    OwnBlocks& operator=(const OwnBlocks&) = delete;
};

/// Block after block, each of them in the file before the next: none waits in the cache.
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
                const auto* cells = static_cast<const std::byte*>(content.bands[b].cells) +
                                    (row * content.columns + column) * bytes;
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

void write_geolocation(const GeolocationGrid& grid, const std::string& path, const std::string& final_path) {
    // Round a full circle one row without places in front and behind: else GDAL goes on past the ends, over the rows
    // of the other end.
    const std::int64_t margin = grid.closed ? 1 : 0, rows = grid.rows + 2 * margin;
    std::vector<double> x(static_cast<std::size_t>(grid.columns * rows), no_place), y = x;
    const auto columns = static_cast<std::size_t>(grid.columns);
    Threads(at_hand(grid.threads), false).execute([&] {
        tbb::parallel_for(tbb::blocked_range<std::int64_t>(0, grid.rows, 16), [&](const auto& some) {
            std::vector<Place> places(columns);
            for (std::int64_t j = some.begin(); j < some.end(); ++j) {
                grid.find_row(static_cast<double>(j * grid.row_step), places.data());
                const std::size_t node = static_cast<std::size_t>(j + margin) * columns;
                for (std::size_t i = 0; i < columns; ++i) {
                    x[node + i] = places[i].x;
                    y[node + i] = places[i].y;
                }
            }
        });
    });
    RasterContent content;
    content.columns = grid.columns;
    content.rows = rows;
    content.type = GDT_Float64;
    content.crs = grid.crs;
    content.bands.resize(2);
    content.bands[0] = {x.data(), "x", "", no_place, {}};
    content.bands[1] = {y.data(), "y", "", no_place, {}};
    GDALDriver& driver = *GetGDALDriverManager()->GetDriverByName("GTiff");
    CPLStringList options = creation_options(driver, GDT_Float64, {}, {});
    if (!grid.packed) {
        options.Clear();
        options.SetNameValue("INTERLEAVE", "BAND");
    }
    GdalErrors errors;
    DatasetHandle dataset(driver.Create(path.c_str(), static_cast<int>(content.columns), static_cast<int>(content.rows),
                                        2, GDT_Float64, options.List()));
    if (!dataset) fail_to_write(final_path, path, errors);
    describe(*dataset, content, {});
    write_bands(*dataset, content, final_path, path, errors);
    dataset.reset();
    if (errors.failed()) fail_to_write(final_path, path, errors);
}

Metadata geolocation_metadata(const GeolocationGrid& grid, const std::string& final_path) {
    const std::string side = std::filesystem::path(final_path).filename().string() + ".geoloc.tif";
    // By name beside the raster, wherever the two are moved together.
    Metadata items{{"X_DATASET", side},
                   {"X_DATASET_RELATIVE_TO_SOURCE", "YES"},
                   {"X_BAND", "1"},
                   {"Y_DATASET", side},
                   {"Y_DATASET_RELATIVE_TO_SOURCE", "YES"},
                   {"Y_BAND", "2"},
                   {"PIXEL_OFFSET", "0"},
                   {"LINE_OFFSET", text(grid.closed ? -grid.row_step : 0)},
                   {"PIXEL_STEP", text(grid.column_step)},
                   {"LINE_STEP", text(grid.row_step)},
                   {"GEOREFERENCING_CONVENTION", "TOP_LEFT_CORNER"}};
    OGRSpatialReference crs;
    GdalErrors quiet;
    if (grid.crs.empty())
        crs.SetLocalCS("grid");
    else
        crs.SetFromUserInput(grid.crs.c_str());
    char* wkt = nullptr;
    if (crs.exportToWkt(&wkt) == OGRERR_NONE && wkt) items.emplace_back("SRS", wkt);
    CPLFree(wkt);
    return items;
}

}  // namespace

bool swaps_bytes(const std::string& endianness) {
    const bool big = std::endian::native == std::endian::big;
    return EQUAL(endianness.c_str(), "INVERTED") || EQUAL(endianness.c_str(), big ? "LITTLE" : "BIG");
}

void refuse_predictor(const std::string& endianness) {
    throw InputError(text("co PREDICTOR=3 with ENDIANNESS=", endianness,
                          " makes files that GDAL does not read back; accepted: PREDICTOR=1"));
}

GeolocationGrid geolocation_grid(std::int64_t columns, std::int64_t rows, std::int64_t column_step,
                                 std::int64_t row_step) {
    GeolocationGrid grid;
    grid.column_step = std::clamp<std::int64_t>(column_step, 1, columns);
    grid.row_step = std::clamp<std::int64_t>(row_step, 1, rows);
    grid.columns = (columns + grid.column_step - 1) / grid.column_step + 1;
    grid.rows = (rows + grid.row_step - 1) / grid.row_step + 1;
    return grid;
}

namespace {

/// What a driver did with a small raster.
struct Trial {
    bool kept = false;
    std::string refused;      ///< why it was not made, in GDAL's words; empty: it was
    bool read_back = false;   ///< it was made, and opened again
    bool meant_void = false;  ///< what means something is declared as no data
};

/// No driver says beforehand what it takes and keeps: a small raster tells, which it writes in memory. What comes back of
/// it goes to `good`; kept too where a driver cannot write there.
template <class Good>
Trial try_driver(GDALDriver& driver, const CPLStringList& options, const RasterContent& content,
                 const std::string& final_path, Good&& good) {
    Trial trial;
    trial.kept = !has(driver, GDAL_DCAP_VIRTUALIO);
    if (trial.kept) return trial;
    // Some drivers know their files by the ending.
    const std::string path = text("/vsimem/wedgescope_trial_", reinterpret_cast<std::uintptr_t>(&content),
                                  std::filesystem::path(final_path).extension().string());
    GdalErrors errors;
    const auto create = [&] {
        if (!has(driver, GDAL_DCAP_CREATE)) {
            const DatasetHandle memory = in_memory(content);
            describe(*memory, content, {});
            return DatasetHandle(driver.CreateCopy(path.c_str(), memory.get(), FALSE,
                                                   const_cast<char**>(options.List()), nullptr, nullptr));
        }
        DatasetHandle made = created(driver, path, final_path, content, options);
        if (!made) return made;
        trial.meant_void = !set_no_data_apart(*made, content);
        write_bands(*made, content, path, path, errors);
        return made;
    };
    try {
        DatasetHandle written = create();
        if (!written && errors.failed()) trial.refused = errors.reason_of_writing(path);
        trial.read_back = written != nullptr;
        trial.kept = written && good(*written);
        if (written) written->FlushCache(true);
    } catch (const IoError&) {  // nor can it be written
        trial.read_back = false;
        trial.refused = errors.failed() ? errors.reason_of_writing(path) : "it is not written";
    }
    if (trial.kept) {
        const DatasetHandle back(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER));
        trial.read_back = back != nullptr;
        trial.kept = back && good(*back);
        if (back && !trial.meant_void) trial.meant_void = declares_meaning_void(*back, content);
    }
    driver.QuietDelete(path.c_str());
    return trial;
}

/// Creation options may be at fault.
void check_made(const Trial& trial, GDALDriver& driver, const RasterFormat& format, const std::string& final_path) {
    if (trial.refused.empty() || format.creation.empty()) return;
    throw InputError(text("output '", final_path, "' cannot be made by driver ", driver.GetDescription(),
                          " with these creation options: ", trial.refused));
}

/// Does the first band, `side` x `side`, hold just these?
template <class Cell>
bool are_in_band(GDALDataset& dataset, const std::vector<Cell>& cells, GDALDataType type, int side) {
    std::vector<Cell> back(cells.size());
    return dataset.GetRasterXSize() == side && dataset.GetRasterYSize() == side &&
           dataset.GetRasterBand(1)->RasterIO(GF_Read, 0, 0, side, side, back.data(), side, side, type, 0, 0,
                                              nullptr) == CE_None &&
           back == cells;
}

/// A trial's bytes: these values by lot, neighbours as unlike as they may be.
struct TrialCells {
    static constexpr int side = 64;
    std::vector<std::uint8_t> cells;
    explicit TrialCells(const std::vector<std::uint8_t>& values) : cells(static_cast<std::size_t>(side * side)) {
        std::uint32_t random = 1;
        for (std::uint8_t& cell : cells)
            cell = values[((random = random * 1664525 + 1013904223) >> 16) % values.size()];
    }
    RasterContent content() const {
        RasterContent out;
        out.columns = out.rows = side;
        out.type = GDT_Byte;
        out.bands = {{cells.data(), "", "", {}, {}}};
        return out;
    }
    bool are_in(GDALDataset& dataset) const { return are_in_band(dataset, cells, GDT_Byte, side); }
};

void check_picture(GDALDriver& driver, const CPLStringList& options, const RasterFormat& format, bool alpha,
                   const std::string& final_path) {
    const TrialCells trial({0, 255});
    RasterContent content = trial.content();
    if (alpha) content.bands.push_back({trial.cells.data(), "", "", {}, {}, true});
    const Trial tried = try_driver(driver, options, content, final_path, [&](GDALDataset& written) {
        return written.GetRasterCount() == (alpha ? 2 : 1) &&
               (!alpha || written.GetRasterBand(2)->GetColorInterpretation() == GCI_AlphaBand);
    });
    if (tried.kept) return;
    check_made(tried, driver, format, final_path);
    if (!alpha)
        throw InputError(text("driver ", driver.GetDescription(), " of output '", final_path,
                              "' takes no grey picture; accepted: .png, .tif, .jpg, ..."));
    throw InputError(text("alpha is on, and driver ", driver.GetDescription(), " of output '", final_path,
                          "' takes no grey picture with an alpha channel; accepted: .png, .tif, ..., or alpha off"));
}

[[noreturn]] void refuse_codes(GDALDriver& driver, const std::string& final_path, const std::string& why) {
    throw InputError(text("output '", final_path, "' holds codes, and driver ", driver.GetDescription(), why,
                          "; accepted: .tif, .png and others without loss"));
}

/// Of codes one that is a little off is another. True if the driver has shown that it keeps them; some make no file in memory.
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
    refuse_codes(
        driver, final_path,
        text(format.creation.empty() ? "" : " with these creation options", " does not keep them as they are"));
}

/// Values that are no codes. Counts must come back as they are, and none be declared as no data; floats nearly, as options that
/// round them may ask for: metres up to 2000 km within a tenth, degrees and dBm within 0.1 of them.
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
    throw InputError(text("output '", final_path, "' holds ", counts ? "counts" : "numbers", ", and driver ",
                          driver.GetDescription(), format.creation.empty() ? "" : " with these creation options",
                          " does not keep them", counts ? " as they are" : "",
                          "; accepted: .tif, .img and others without loss"));
}

enum class PlaceBack { kept, lost, elsewhere };

/// Of the first cell and behind the last one.
using Corners = std::array<std::array<double, 2>, 2>;
Corners corners(const std::array<double, 6>& place, int side) {
    const auto at = [&](double n) {
        return std::array{place[0] + n * (place[1] + place[2]), place[3] + n * (place[4] + place[5])};
    };
    return {at(0), at(side)};
}

/// Within half a post: what digits of a text lose does not show.
bool lie_together(const Corners& own, const Corners& meant, int side) {
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const double half_post = 0.5 * std::abs(meant[1][axis] - meant[0][axis]) / side;
        for (std::size_t i = 0; i < 2; ++i)
            if (!(std::abs(own[i][axis] - meant[i][axis]) <= half_post)) return false;
    }
    return true;
}

/// Longitudes and latitudes of the CRS's own datum.
bool to_degrees(const OGRSpatialReference& crs, Corners& corners) {
    OGRSpatialReference from(crs);
    const std::unique_ptr<OGRSpatialReference> to(from.CloneGeogCS());
    if (!to) return false;
    for (OGRSpatialReference* one : {&from, to.get()}) one->SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    const std::unique_ptr<OGRCoordinateTransformation> way(OGRCreateCoordinateTransformation(&from, to.get()));
    return way && std::all_of(corners.begin(), corners.end(),
                              [&](auto& corner) { return way->Transform(1, &corner[0], &corner[1]) != 0; });
}

/// Of a raster of trial cells: do these lie where they should, rows turned with their place or not, in another CRS or not?
PlaceBack place_of(GDALDataset& dataset, const RasterContent& wanted, const std::vector<std::uint8_t>& cells) {
    constexpr int side = TrialCells::side;
    std::array<double, 6> found{};
    const std::array<double, 6> none{0, 1, 0, 0, 0, 1};
    if (dataset.GetGeoTransform(found.data()) != CE_None || found == none) return PlaceBack::lost;
    std::array<double, 6> place = *wanted.geotransform;
    std::vector<std::uint8_t> turned;
    for (int row = side; row-- > 0;)
        turned.insert(turned.end(), cells.begin() + row * side, cells.begin() + (row + 1) * side);
    if (!are_in_band(dataset, cells, GDT_Byte, side) && are_in_band(dataset, turned, GDT_Byte, side)) {
        place[3] += side * place[5];
        place[5] = -place[5];
    }
    Corners own = corners(found, side), meant = corners(place, side);
    if (lie_together(own, meant, side)) return PlaceBack::kept;
    // Some write in a CRS of their own.
    const OGRSpatialReference* const crs = dataset.GetSpatialRef();
    OGRSpatialReference wanted_crs;
    if (!crs || wanted.crs.empty() || wanted_crs.importFromWkt(wanted.crs.c_str()) != OGRERR_NONE ||
        !to_degrees(*crs, own) || !to_degrees(wanted_crs, meant))
        return PlaceBack::elsewhere;
    return lie_together(own, meant, side) ? PlaceBack::kept : PlaceBack::elsewhere;
}

}  // namespace

bool needs_no_driver(const char* driver, const std::string& final_path, const RasterFormat& format) {
    if (!format.creation.empty() || GdalSession::configured()) return false;
    return is_of(driver, final_path, format);
}

std::string place_losses(const RasterContent& wanted, const OutputFile& file, const RasterFormat& format) {
    const std::string& final_path = file.final_path();
    if (!wanted.geotransform || (is_geotiff(final_path, format) && format.creation.empty())) return {};
    GDALDriver& driver = driver_for(final_path, wanted.type, format);
    const TrialCells trial({3, 200});
    std::vector<std::uint64_t> cells(trial.cells.size());  // of the widest type
    GDALCopyWords64(trial.cells.data(), GDT_Byte, 1, cells.data(), wanted.type, GDALGetDataTypeSizeBytes(wanted.type),
                    static_cast<GPtrDiff_t>(trial.cells.size()));
    RasterContent content = trial.content();
    content.type = wanted.type;
    content.bands[0].cells = cells.data();
    content.crs = wanted.crs;
    content.geotransform = wanted.geotransform;
    PlaceBack place = PlaceBack::kept;
    bool crs = true;
    const Trial tried =
        try_driver(driver, creation_options(driver, wanted.type, {}, format), content, final_path, [&](GDALDataset& d) {
            place = place_of(d, wanted, trial.cells);
            crs = wanted.crs.empty() || d.GetSpatialRef();
            return true;
        });
    if (!tried.read_back) return {};  // makes no file in memory
    const std::string by =
        text("driver ", driver.GetDescription(), format.creation.empty() ? "" : " with these creation options");
    if (place == PlaceBack::elsewhere)
        throw InputError(text("output '", final_path, "' would lie elsewhere than the terrain",
                              (*wanted.geotransform)[5] > 0 ? ", whose rows run north" : "", ": ", by,
                              " does not keep its place; accepted: .tif, .img and others that do"));
    if (place == PlaceBack::kept && crs) return {};
    return text("is written by ", by, ", which does not keep ",
                crs                        ? "its place"
                : place == PlaceBack::kept ? "its CRS"
                                           : "its place, nor its CRS",
                "; .tif does");
}

bool is_geotiff(const std::string& path, const RasterFormat& format) { return is_of("GTiff", path, format); }

void check_output(const OutputFile& file, OutputLayer layer, const RasterFormat& format) {
    const bool bytes =
        layer == OutputLayer::scope || layer == OutputLayer::masked_scope || layer == OutputLayer::states;
    const GDALDataType type = bytes ? GDT_Byte : GDT_Float32;
    if (bytes && layer != OutputLayer::states && needs_no_driver("PNG", file.final_path(), format)) return;
    GDALDriver& driver = driver_for(file.final_path(), type, format);
    const CPLStringList options = creation_options(driver, type, {}, format);
    const bool known = is_geotiff(file.final_path(), format) && format.creation.empty();
    if (layer == OutputLayer::states) {
        RasterContent states;
        set_states(states);
        if (!known && !keeps_codes(driver, options, format, states, file.final_path()))
            refuse_codes(driver, file.final_path(), " does not say whether it keeps them as they are");
    } else if (bytes && (!known || layer == OutputLayer::masked_scope)) {
        check_picture(driver, options, format, layer == OutputLayer::masked_scope, file.final_path());
    }
}

std::string power_losses(const OutputFile& file, const RasterFormat& format) {
    const std::string& final_path = file.final_path();
    if (is_geotiff(final_path, format) && format.creation.empty()) return {};
    GDALDriver& driver = driver_for(final_path, GDT_Float32, format);
    // Watts, and dBm: each by itself, for what rounds the small ones away may see in both together that it must not. As unlike as
    // neighbours may be.
    constexpr int side = 64;
    bool values = true, words = true;  // are kept, by what was closed and opened again
    for (const float step : {1.1e-17F, -0.0301F}) {
        std::vector<float> cells(static_cast<std::size_t>(side * side));
        for (std::size_t i = 0; i < cells.size(); ++i) cells[i] = step * static_cast<float>(i * 1009 % cells.size());
        RasterContent content;
        content.columns = content.rows = side;
        content.bands = {{cells.data(), "power", "W", {}, {}}};
        content.metadata = {{"SCENE_JSON", R"({"trial": "with 'quotes' = and; others"})"}};
        bool same = true;
        const Trial tried = try_driver(driver, creation_options(driver, GDT_Float32, {}, format), content, final_path,
                                       [&](GDALDataset& d) {
                                           same = are_in_band(d, cells, GDT_Float32, side);
                                           const auto& [key, value] = content.metadata.front();
                                           const char* const said = d.GetMetadataItem(key.c_str());
                                           words = said && value == said;
                                           return true;
                                       });
        values &= same;
        check_made(tried, driver, format, final_path);
        if (!tried.kept || !has(driver, GDAL_DCAP_VIRTUALIO))  // makes no file in memory
            return text("is written by driver ", driver.GetDescription(),
                        ", which may not keep its values, its place and what the image tells of its scene; .tif does");
    }
    if (values && words) return {};
    return text("is written by driver ", driver.GetDescription(),
                format.creation.empty() ? "" : " with these creation options", ", which does not keep ",
                values  ? "what the image tells of its scene"
                : words ? "its values as they are"
                        : "its values as they are, nor what the image tells of its scene",
                "; .tif does");
}

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
    if (has(driver, GDAL_DCAP_CREATE)) {
        dataset = created(driver, path, final_path, content, options, geolocation);
        if (!dataset) fail_to_write(final_path, path, errors);
        if (!set_no_data_apart(*dataset, content)) refuse_no_data(driver, final_path);
        write_bands(*dataset, content, final_path, path, errors);
    } else {
        const DatasetHandle memory = in_memory(content);
        describe(*memory, content, {});
        const std::int64_t all_bytes = content.columns * content.rows * GDALGetDataTypeSizeBytes(content.type) *
                                       static_cast<std::int64_t>(content.bands.size());
        if (all_bytes <= GDALGetCacheMax64()) own.emplace();
        dataset.reset(
            driver.CreateCopy(path.c_str(), memory.get(), FALSE, const_cast<char**>(options.List()), nullptr, nullptr));
        if (!dataset) fail_to_write(final_path, path, errors);
        GdalErrors quiet;
        if (geolocation.Count() > 0) dataset->SetMetadata(const_cast<char**>(geolocation.List()), "GEOLOCATION");
    }
    dataset->FlushCache(true);
    dataset.reset();
    if (errors.failed()) fail_to_write(final_path, path, errors);
}

void fail_to_write(const std::string& final_path, const std::string& written_path, const GdalErrors& errors) {
    throw IoError(text("output '", final_path, "' cannot be written: ", errors.reason_of_writing(written_path)));
}

DatasetHandle create_raster(const RasterContent& content, const OutputFile& file, const RasterFormat& format) {
    const std::string& final_path = file.final_path();
    GDALDriver& driver = driver_for(final_path, content.type, format);
    const CPLStringList options =
        creation_options(driver, content.type, {content.patches, content.quick_to_read}, format);
    if (!has(driver, GDAL_DCAP_CREATE))
        throw InputError(
            text("output '", final_path, "': driver ", driver.GetDescription(),
                 " writes whole rasters only, and this one is written tile by tile; accepted: .tif, .img, or --of one "
                 "that does so too (GTiff, HFA, ENVI, netCDF)"));
    if (!content.codes.empty() && !(is_geotiff(final_path, format) && format.creation.empty()))
        keeps_codes(driver, options, format, content, final_path);
    if (content.codes.empty() && !(is_geotiff(final_path, format) && format.creation.empty()))
        check_values(driver, options, format, content, final_path);
    GdalErrors errors;
    DatasetHandle dataset = created(driver, file.temporary_path(), final_path, content, options);
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

void set_states(RasterContent& content) {
    content.codes.resize(state_count);
    std::iota(content.codes.begin(), content.codes.end(), std::uint8_t{0});
    content.means_something = [](double value) { return value >= 0 && value < state_count; };
    content.means_nothing = 255;
}

Metadata run_metadata(const RasterFormat& format) {
    Metadata items;
    items.emplace_back("SOFTWARE", format.version.empty() ? "wedgescope" : "wedgescope " + format.version);
    if (!format.scene_json.empty()) items.emplace_back("SCENE_JSON", format.scene_json);
    return items;
}

Metadata scene_metadata(const ResolvedScene& scene, const RasterFormat& format) {
    Metadata items = run_metadata(format);
    items.emplace_back("REFERENCE_HEIGHT_M", fifteen_digits(scene.reference_m));
    if (scene.has_lat_lon) {
        items.emplace_back("SENSOR_LAT", fifteen_digits(scene.lat_deg));
        items.emplace_back("SENSOR_LON", fifteen_digits(scene.lon_deg));
    }
    items.emplace_back("SENSOR_X", fifteen_digits(scene.x));
    items.emplace_back("SENSOR_Y", fifteen_digits(scene.y));
    items.emplace_back("SENSOR_HEIGHT_M", fifteen_digits(scene.sensor_m));
    return items;
}

std::string fifteen_digits(double value) { return fmt::format("{:.15g}", value + 0.0); }  // never -0

}  // namespace wedgescope
