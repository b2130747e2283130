#include "tiles/raster_file.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

/// Metres of a band's height unit; 1 for what is not known.
double unit_in_metres(std::string unit) {
    std::erase_if(unit, [](unsigned char c) { return !std::isalnum(c); });
    std::transform(unit.begin(), unit.end(), unit.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    for (const char* word : {"ft", "foot", "feet", "internationalfoot", "internationalfeet", "footinternational"})
        if (unit == word) return 0.3048;
    for (const char* word : {"usft", "ftus", "sft", "ussurveyfoot", "ussurveyfeet", "footus", "surveyfoot",
                             "surveyfeet", "footussurvey", "usfoot", "usfeet"})
        if (unit == word) return 1200.0 / 3937;
    return 1;
}

DatasetHandle open(const RasterFacts& facts) {
    constexpr unsigned how = GDAL_OF_RASTER | GDAL_OF_READONLY;
    register_usual_drivers();
    DatasetHandle dataset;
    {
        GdalErrors quiet;
        dataset.reset(GDALDataset::Open(facts.path.c_str(), how));
    }
    // A VRT may be made of anything.
    if (!dataset || (dataset->GetDriver() && EQUAL(dataset->GetDriver()->GetDescription(), "VRT")))
        register_all_drivers();
    GdalErrors errors;
    if (!dataset) dataset.reset(GDALDataset::Open(facts.path.c_str(), how | GDAL_OF_VERBOSE_ERROR));
    if (!dataset) {
        std::string reason = errors.reason();
        if (reason.starts_with(facts.path + ": ")) reason = reason.substr(facts.path.size() + 2);
        throw IoError(text(facts.named(), " cannot be opened: ", reason));
    }
    return dataset;
}

void inspect_grid(GDALDataset& dataset, RasterFacts& facts) {
    double g[6];
    facts.has_geotransform = dataset.GetGeoTransform(g) == CE_None;
    if (!facts.has_geotransform) {
        if (dataset.GetGCPCount() > 0)
            throw DataError(text(facts.named(), " has ", dataset.GetGCPCount(),
                                 " ground control points and no geotransform; accepted: what gdalwarp makes of it"));
        facts.corner_x = -0.5;
        facts.corner_y = static_cast<double>(facts.rows) - 0.5;
        return;
    }
    for (double term : g)
        if (!std::isfinite(term))
            throw DataError(text(facts.named(), " has a geotransform that is not finite: ", term));
    // A shear of less than a thousandth of a cell over the whole raster is rounding.
    if (std::fabs(g[2]) * static_cast<double>(facts.rows) > 1e-3 * std::fabs(g[1]) ||
        std::fabs(g[4]) * static_cast<double>(facts.columns) > 1e-3 * std::fabs(g[5]))
        throw DataError(text(facts.named(), " is rotated (geotransform ", g[1], " ", g[2], " ", g[4], " ", g[5],
                             "); accepted: rows that run east; gdalwarp makes such a raster of it"));
    if (!(g[1] > 0) || g[5] == 0)
        throw DataError(text(facts.named(), " has cells of ", g[1], " x ", g[5],
                             "; accepted: a width above 0 and a height that is not 0"));
    facts.corner_x = g[0];
    facts.step_x = g[1];
    facts.corner_y = g[3];
    facts.step_y = g[5];
}

void inspect_crs(GDALDataset& dataset, RasterFacts& facts) {
    const OGRSpatialReference* given = dataset.GetSpatialRef();
    if (!given || given->IsEmpty() || !facts.has_geotransform) return;
    auto crs = std::make_shared<OGRSpatialReference>(*given);
    if (crs->IsCompound()) crs->StripVertical();
    crs->SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    if (crs->IsGeocentric())
        throw DataError(
            text(facts.named(), " has a geocentric CRS; accepted: latitude and longitude, or a projection"));
    if (crs->IsGeographic()) {
        const double degree = crs->GetAngularUnits(static_cast<const char**>(nullptr)) * 180 / M_PI;
        if (std::fabs(degree - 1) > 1e-9)
            throw DataError(text(facts.named(), " has angles in units of ", degree, " degrees; accepted: degrees"));
        facts.geographic = true;
        const OGRSpatialReference wgs84 = wgs84_lon_lat();
        const char* const options[] = {"IGNORE_DATA_AXIS_TO_SRS_AXIS_MAPPING=YES",
                                       "CRITERION=EQUIVALENT_EXCEPT_AXIS_ORDER_GEOGCRS", nullptr};
        facts.wgs84_lat_lon = crs->IsSame(&wgs84, options) != 0;
    } else {
        facts.metres_per_unit = crs->GetLinearUnits(static_cast<const char**>(nullptr));
        if (!(facts.metres_per_unit > 0)) facts.metres_per_unit = 1;
        if (!crs->IsProjected()) return;  // a local grid: a plane with a unit, nowhere on earth
    }
    facts.crs = std::move(crs);
}

void inspect_band(GDALDataset& dataset, RasterFacts& facts) {
    GDALRasterBand& band = *dataset.GetRasterBand(1);
    facts.type = band.GetRasterDataType();
    facts.type_bytes = GDALGetDataTypeSizeBytes(facts.type);
    if (facts.type == GDT_Unknown || GDALDataTypeIsComplex(facts.type))
        throw DataError(text(facts.named(), " holds ", GDALGetDataTypeName(facts.type),
                             " values; accepted: integers and floating point numbers"));
    int block_columns = 0, block_rows = 0;
    band.GetBlockSize(&block_columns, &block_rows);
    facts.block_columns = std::max(1, block_columns);
    facts.block_rows = std::max(1, block_rows);
    if (const char* kind = band.GetMetadataItem("PIXELTYPE", "IMAGE_STRUCTURE"))
        facts.signed_byte = facts.type == GDT_Byte && EQUAL(kind, "SIGNEDBYTE");
    facts.scale = band.GetScale();
    facts.offset = band.GetOffset();
    if (!std::isfinite(facts.scale) || facts.scale == 0 || !std::isfinite(facts.offset))
        throw DataError(text(facts.named(), " has band scale ", facts.scale, " and offset ", facts.offset,
                             "; accepted: finite numbers, a scale that is not 0"));
    if (const char* unit = band.GetUnitType()) facts.unit = unit;
    facts.unit_m = unit_in_metres(facts.unit);

    int has = 0;
    if (facts.type == GDT_Int64) {
        facts.no_data = static_cast<double>(band.GetNoDataValueAsInt64(&has));
    } else if (facts.type == GDT_UInt64) {
        facts.no_data = static_cast<double>(band.GetNoDataValueAsUInt64(&has));
    } else {
        facts.no_data = band.GetNoDataValue(&has);
    }
    facts.has_no_data = has != 0;
    const int flags = band.GetMaskFlags();
    // A mask made of the no-data value alone is the comparison that is made anyway.
    facts.has_mask = (flags & GMF_ALL_VALID) == 0 && (flags & (GMF_PER_DATASET | GMF_ALPHA)) != 0;
    if ((flags & (GMF_ALL_VALID | GMF_NODATA)) == 0) facts.has_mask = true;
    if (const char* compression = dataset.GetMetadataItem("COMPRESSION", "IMAGE_STRUCTURE"))
        facts.compression = compression;
}

RasterFacts inspect(GDALDataset& dataset, RasterFacts facts) {
    GdalErrors quiet;
    facts.driver = dataset.GetDriver() ? dataset.GetDriver()->GetDescription() : "";
    facts.columns = dataset.GetRasterXSize();
    facts.rows = dataset.GetRasterYSize();
    if (dataset.GetRasterCount() < 1) {
        const char* first = dataset.GetMetadataItem("SUBDATASET_1_NAME", "SUBDATASETS");
        throw DataError(
            text(facts.named(), " holds no band",
                 first ? text("; accepted: one of its subdatasets, such as '", first, "'") : std::string()));
    }
    inspect_grid(dataset, facts);
    inspect_crs(dataset, facts);
    inspect_band(dataset, facts);
    return facts;
}

std::string place(const Window& window) {
    return text("columns ", window.columns.begin, " to ", window.columns.end - 1, ", rows ", window.rows.begin, " to ",
                window.rows.end - 1);
}

}  // namespace

OGRSpatialReference wgs84_lon_lat() {
    OGRSpatialReference wgs84;
    wgs84.SetWellKnownGeogCS("WGS84");
    wgs84.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    return wgs84;
}

std::string crs_definition(const OGRSpatialReference& crs) {
    const char* authority = crs.GetAuthorityName(nullptr);
    const char* code = crs.GetAuthorityCode(nullptr);
    if (authority && code) return text(authority, ":", code);
    GdalErrors quiet;
    char* words = nullptr;
    std::string definition;
    if (crs.exportToProj4(&words) == OGRERR_NONE && words) definition = words;
    CPLFree(words);
    if (!definition.empty()) return definition;
    words = nullptr;
    const char* const options[] = {"FORMAT=WKT2_2019", nullptr};
    if (crs.exportToWkt(&words, options) == OGRERR_NONE && words) definition = words;
    CPLFree(words);
    return definition;
}

/// A reader for as long as it is needed.
class RasterFile::Lease {
public:
    explicit Lease(RasterFile& file) : file_(file) {
        {
            const std::lock_guard lock(file_.mutex_);
            if (!file_.free_.empty()) {
                reader_ = std::move(file_.free_.back());
                file_.free_.pop_back();
                return;
            }
        }
        reader_ = std::make_unique<Reader>();
        reader_->dataset = open(file_.facts_);
        if (reader_->dataset->GetRasterXSize() != file_.facts_.columns ||
            reader_->dataset->GetRasterYSize() != file_.facts_.rows || reader_->dataset->GetRasterCount() < 1)
            throw IoError(text(file_.facts_.named(), " changed while it was read"));
        reader_->band = reader_->dataset->GetRasterBand(1);
    }
    ~Lease() {
        const std::lock_guard lock(file_.mutex_);
        file_.free_.push_back(std::move(reader_));
    }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    Reader& operator*() const { return *reader_; }

private:
    RasterFile& file_;
    std::unique_ptr<Reader> reader_;
};

RasterFile::RasterFile(std::string role, std::string path) {
    facts_.role = std::move(role);
    facts_.path = std::move(path);
    DatasetHandle dataset = open(facts_);
    facts_ = inspect(*dataset, std::move(facts_));

    const bool floating = facts_.type == GDT_Float32 || facts_.type == GDT_Float64;
    // The same conversion that the values go through.
    GDALCopyWords(&facts_.no_data, GDT_Float64, 0, &no_data_, GDT_Float32, 0, 1);
    no_data_is_huge_ = facts_.has_no_data && floating && std::fabs(facts_.no_data) > 1e30;
    may_be_void_ = facts_.has_no_data || facts_.has_mask;
    const double largest = facts_.type == GDT_Byte     ? 255
                           : facts_.type == GDT_Int16  ? 32768
                           : facts_.type == GDT_UInt16 ? 65535
                                                       : 1e300;
    may_be_wild_ = (largest * std::fabs(facts_.scale) + std::fabs(facts_.offset)) * facts_.unit_m >
                   static_cast<double>(highest_height_m);

    auto reader = std::make_unique<Reader>();
    reader->dataset = std::move(dataset);
    reader->band = reader->dataset->GetRasterBand(1);
    free_.push_back(std::move(reader));
}

void RasterFile::read(Reader& reader, const Window& window, void* out, GDALDataType type,
                      std::int64_t line_bytes) const {
    GdalErrors errors;
    const int columns = static_cast<int>(window.columns.size()), rows = static_cast<int>(window.rows.size());
    if (reader.band->RasterIO(GF_Read, static_cast<int>(window.columns.begin), static_cast<int>(window.rows.begin),
                              columns, rows, out, columns, rows, type, 0, line_bytes, nullptr) != CE_None)
        throw IoError(text(facts_.named(), ": ", place(window), " cannot be read: ", errors.reason()));
}

bool RasterFile::read_mask(Reader& reader, const Window& window) const {
    if (!facts_.has_mask) return false;
    reader.mask.resize(static_cast<std::size_t>(window.posts()));
    GdalErrors errors;
    const int columns = static_cast<int>(window.columns.size()), rows = static_cast<int>(window.rows.size());
    GDALRasterBand* mask = reader.band->GetMaskBand();
    if (!mask || mask->RasterIO(GF_Read, static_cast<int>(window.columns.begin), static_cast<int>(window.rows.begin),
                                columns, rows, reader.mask.data(), columns, rows, GDT_Byte, 0, 0, nullptr) != CE_None)
        throw IoError(text(facts_.named(), ": the mask of ", place(window), " cannot be read: ", errors.reason()));
    return std::any_of(reader.mask.begin(), reader.mask.end(), [](std::uint8_t m) { return m == 0; });
}

void RasterFile::read_heights(const Window& window, float* out, std::int64_t stride) {
    if (window.empty()) return;
    const Lease lease(*this);
    Reader& reader = *lease;
    read(reader, window, out, GDT_Float32, stride * static_cast<std::int64_t>(sizeof(float)));
    const bool masked = read_mask(reader, window);
    const bool scaled = facts_.scale != 1 || facts_.offset != 0 || facts_.unit_m != 1;
    if (!may_be_void_ && !may_be_wild_ && !scaled && !facts_.signed_byte) return;

    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    const std::int64_t n = window.columns.size();
    for (std::int64_t r = 0; r < window.rows.size(); ++r) {
        float* line = out + r * stride;
        if (facts_.signed_byte)
            for (std::int64_t c = 0; c < n; ++c) line[c] = line[c] > 127 ? line[c] - 256 : line[c];
        if (no_data_is_huge_) {
            const float sign = facts_.no_data < 0 ? -1.0F : 1.0F;
            for (std::int64_t c = 0; c < n; ++c) line[c] = line[c] * sign > 1e30F ? nan : line[c];
        } else if (facts_.has_no_data) {
            const float none = no_data_;
            for (std::int64_t c = 0; c < n; ++c) line[c] = line[c] == none ? nan : line[c];
        }
        if (masked) {
            const std::uint8_t* mask = reader.mask.data() + r * n;
            for (std::int64_t c = 0; c < n; ++c) line[c] = mask[c] == 0 ? nan : line[c];
        }
        if (scaled) {
            const double scale = facts_.scale, offset = facts_.offset, unit = facts_.unit_m;
            for (std::int64_t c = 0; c < n; ++c)
                line[c] = static_cast<float>((static_cast<double>(line[c]) * scale + offset) * unit);
        }
        if (!may_be_wild_) continue;
        int wild = 0;
        for (std::int64_t c = 0; c < n; ++c) wild |= std::fabs(line[c]) > highest_height_m;
        if (!wild) continue;
        for (std::int64_t c = 0; c < n; ++c)
            if (std::fabs(line[c]) > highest_height_m)
                throw DataError(text(facts_.named(), ": height at column ", window.columns.begin + c, ", row ",
                                     window.rows.begin + r, " is ", line[c], " m; accepted: at most ", highest_height_m,
                                     " m either way, NaN or the declared no-data value"));
    }
}

void RasterFile::read_codes(const Window& window, std::int32_t* out) {
    if (window.empty()) return;
    const Lease lease(*this);
    Reader& reader = *lease;
    const auto n = static_cast<std::size_t>(window.posts());
    const bool narrow =
        facts_.type == GDT_Byte || facts_.type == GDT_Int16 || facts_.type == GDT_UInt16 || facts_.type == GDT_Int32;
    if (narrow) {
        read(reader, window, out, GDT_Int32, 0);
        if (facts_.signed_byte)
            for (std::size_t i = 0; i < n; ++i) out[i] = out[i] > 127 ? out[i] - 256 : out[i];
        if (facts_.has_no_data && facts_.no_data >= INT32_MIN && facts_.no_data <= INT32_MAX &&
            facts_.no_data == std::trunc(facts_.no_data)) {
            const auto none = static_cast<std::int32_t>(facts_.no_data);
            for (std::size_t i = 0; i < n; ++i) out[i] = out[i] == none ? void_code : out[i];
        }
    } else {
        reader.wide.resize(n);
        read(reader, window, reader.wide.data(), GDT_Float64, 0);
        const double none = facts_.type == GDT_Float32 ? static_cast<double>(no_data_) : facts_.no_data;
        for (std::size_t i = 0; i < n; ++i) {
            const double v = reader.wide[i];
            if (std::isnan(v) || (facts_.has_no_data && (v == none || (no_data_is_huge_ && v * none > 1e60)))) {
                out[i] = void_code;
            } else if (v > INT32_MIN && v <= INT32_MAX && v == std::trunc(v)) {
                out[i] = static_cast<std::int32_t>(v);
            } else {
                const auto at = static_cast<std::int64_t>(i);
                throw DataError(text(
                    facts_.named(), ": code at column ", window.columns.begin + at % window.columns.size(), ", row ",
                    window.rows.begin + at / window.columns.size(), " is ", v, "; accepted: whole numbers of 32 bits"));
            }
        }
        reader.wide.clear();
        reader.wide.shrink_to_fit();
    }
    if (read_mask(reader, window))
        for (std::size_t i = 0; i < n; ++i) out[i] = reader.mask[i] == 0 ? void_code : out[i];
}

void for_each_window(const RasterFacts& facts, std::int64_t columns, std::int64_t most_posts,
                     const std::function<void(const Window&)>& body) {
    // As many whole blocks side by side as fit; then as many rows of blocks; cut blocks only if one alone is too large.
    const std::int64_t block_rows = std::min(facts.block_rows, facts.rows);
    const std::int64_t block_columns = std::min(facts.block_columns, columns);
    std::int64_t wide = std::clamp(most_posts / block_rows / block_columns * block_columns, block_columns, columns);
    if (wide > most_posts) wide = most_posts;
    std::int64_t high = most_posts / wide;
    if (high >= block_rows) high = high / block_rows * block_rows;
    high = std::clamp<std::int64_t>(high, 1, facts.rows);
    for (std::int64_t r = 0; r < facts.rows; r += high)
        for (std::int64_t c = 0; c < columns; c += wide)
            body({{c, std::min(c + wide, columns)}, {r, std::min(r + high, facts.rows)}});
}

}  // namespace wedgescope
