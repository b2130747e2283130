#include "tiles/raster_file.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <system_error>
#include <thread>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "tiles/file_stamp.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/store_manifest.hpp"

namespace wedgescope {
namespace {

/// Formats whose files are HDF5.
bool by_hdf5(const std::string& driver) {
    return driver == "netCDF" || driver == "BAG" || driver == "KEA" || driver.starts_with("HDF5");
}

/// HDF5 prints whatever fails in it, also what its user expects to fail, in each thread that has not asked it to be quiet; GDAL asks
/// in the thread that loads it alone.
void quiet_hdf5(const std::string& driver) {
    if (!by_hdf5(driver)) return;
    using SetPrinting = int (*)(std::int64_t stack, void* printing, void* data);
    static const auto set_printing = reinterpret_cast<SetPrinting>(GdalSession::function("H5Eset_auto2"));
    thread_local bool quiet = false;
    if (set_printing && !quiet) set_printing(0, nullptr, nullptr);
    quiet = true;
}

DatasetHandle open(const RasterFacts& facts) {
    // Opened a second time, as GDAL does, it would be waited for without end.
    if (std::error_code ignored; std::filesystem::is_fifo(facts.path, ignored))
        throw IoError(text(facts.named(), " is a pipe; accepted: a file, for a raster is not read from front to end"));
    GdalErrors errors;
    DatasetHandle dataset = by_usual_or_all_drivers([&] {
        return DatasetHandle(
            GDALDataset::Open(facts.path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR));
    });
    // A VRT may be made of anything.
    if (dataset && dataset->GetDriver() && EQUAL(dataset->GetDriver()->GetDescription(), "VRT")) register_all_drivers();
    if (!dataset && is_tile_store(facts.path)) {
        std::string layer = facts.role;
        std::replace(layer.begin(), layer.end(), '-', '_');
        throw IoError(text(facts.named(), " is a tile store; accepted: a raster, such as ",
                           in_quotes((std::filesystem::path(facts.path) / (layer + ".vrt")).string())));
    }
    if (std::error_code ignored; !dataset && std::filesystem::is_directory(facts.path, ignored))
        throw IoError(
            text(facts.named(), " is a folder without ", manifest_name,
                 ", so no tile store, and no raster that GDAL knows; accepted: a raster, or a folder that tile made"));
    if (!dataset) throw IoError(text(facts.named(), " cannot be opened: ", errors.reason_beside(facts.path)));
    return dataset;
}

void inspect_grid(GDALDataset& dataset, RasterFacts& facts) {
    std::array<double, 6> g{};
    if (dataset.GetGeoTransform(g.data()) == CE_None) return set_grid(facts, g);
    if (dataset.GetGCPCount() > 0)
        throw DataError(text(facts.named(), " has ", dataset.GetGCPCount(),
                             " ground control points and no geotransform; accepted: north-up rasters; ", warped_hint));
    facts.corner_x = -0.5;
    facts.corner_y = static_cast<double>(facts.rows) - 0.5;
}

/// Of heights, as the CRS of a raster says it whose band says nothing: a mosaic that gdalbuildvrt made, NetCDF, ENVI. Empty for
/// metres, and where the CRS has no heights.
std::string vertical_unit(const OGRSpatialReference* crs) {
    if (!crs || !crs->IsVertical()) return {};
    const char* name = nullptr;
    const double metres = crs->GetTargetLinearUnits("VERT_CS", &name);
    return std::fabs(metres - 1) < 1e-12 || !name ? std::string() : name;
}

/// DataError where the CRS counts down.
void refuse_depths(const OGRSpatialReference* crs, const RasterFacts& facts) {
    if (!crs || !crs->IsVertical()) return;
    OGRAxisOrientation orientation = OAO_Up;
    crs->GetAxis("VERT_CS", 0, &orientation);
    if (orientation != OAO_Down) return;
    const char* const name = crs->GetAttrValue("VERT_CS");
    throw DataError(
        text(facts.named(), " holds depths, which its vertical CRS ", in_quotes(name ? name : ""),
             " counts downwards; accepted: heights, upwards (gdal_calc.py --calc=-A turns them, and gdal_edit.py "
             "-a_srs says that they are)"));
}

/// DataError for an alpha that GDAL takes for no mask: what gdalwarp fills with 0 would be ground, or class 0.
void refuse_alpha(GDALDataset& dataset, const RasterFacts& facts) {
    for (int b = 2; b <= dataset.GetRasterCount(); ++b) {
        GDALRasterBand& band = *dataset.GetRasterBand(b);
        if (band.GetColorInterpretation() != GCI_AlphaBand) continue;
        throw DataError(text(facts.named(), " has an alpha, of type ", type_name(band.GetRasterDataType()), " in band ",
                             b, " of ", dataset.GetRasterCount(),
                             ", which GDAL takes for no mask; accepted: Byte or UInt16 in the second of 2 bands, "
                             "or a no-data value (gdalwarp -dstnodata in place of -dstalpha)"));
    }
}

/// DataError for a coloured picture, whose red is no height.
void refuse_colours(GDALDataset& dataset, const RasterFacts& facts) {
    if (dataset.GetRasterCount() < 3 || dataset.GetRasterBand(1)->GetColorInterpretation() != GCI_RedBand ||
        dataset.GetRasterBand(2)->GetColorInterpretation() != GCI_GreenBand)
        return;
    throw DataError(text(facts.named(),
                         " is a picture, red, green and blue; accepted: heights in the first band "
                         "(gdal_translate -b takes one band of several)"));
}

// What a raster is asked for decides what of it is refused.
bool is_of_heights(const std::string& role) { return role == "dem" || role == "culture-height"; }
bool is_looked_into(const std::string& role) {
    return is_of_heights(role) || role == "culture" || role == "directivity";
}

/// Whether a VRT may make fractions of whole numbers: it scales, interpolates or computes, or what it is made of may.
bool makes_fractions(GDALDataset& dataset) {
    const char* const* const xml = dataset.GetMetadata("xml:VRT");
    if (!xml || !*xml) return false;
    const std::string words = lower_case(*xml);
    for (const char* sign :
         {"<scaleratio>", "<scaleoffset>", "<exponent>", "<lut>", "<kernelfilteredsource", "<averagedsource",
          "vrtderivedrasterband", "vrtpansharpeneddataset", ".vrt</sourcefilename>"})
        if (words.find(sign) != std::string::npos) return true;
    constexpr std::string_view way = "resampling=\"";
    for (std::size_t at = 0; (at = words.find(way, at)) != std::string::npos; at += way.size())
        if (words.compare(at + way.size(), 4, "near") != 0) return true;
    return false;
}

void inspect_band(GDALDataset& dataset, RasterFacts& facts) {
    GDALRasterBand& band = *dataset.GetRasterBand(1);
    facts.type = band.GetRasterDataType();
    facts.type_bytes = type_bytes(facts.type);
    if (facts.type == GDT_Unknown || GDALDataTypeIsComplex(facts.type))
        throw DataError(text(facts.named(), " holds ", type_name(facts.type),
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
    if (facts.unit.empty()) facts.unit = vertical_unit(dataset.GetSpatialRef());
    const bool heights = is_of_heights(facts.role);
    if (heights) refuse_depths(dataset.GetSpatialRef(), facts);
    const std::optional<double> metres = unit_in_metres(facts.unit);
    if (!metres && heights)
        throw DataError(text(facts.named(), " has heights in the unit '", facts.unit,
                             "'; accepted: m, ft, US survey ft, yd, km, dm, cm, mm (gdal_edit.py -units m sets it)"));
    facts.unit_m = metres.value_or(1);

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
    if (is_looked_into(facts.role) && !facts.has_mask && !facts.has_no_data) refuse_alpha(dataset, facts);
    if (is_of_heights(facts.role)) refuse_colours(dataset, facts);
    if (const char* compression = dataset.GetMetadataItem("COMPRESSION", "IMAGE_STRUCTURE"))
        facts.compression = compression;
    const bool whole = facts.type != GDT_Float32 && facts.type != GDT_Float64;
    facts.fractions = whole && facts.driver == "VRT" && makes_fractions(dataset);
}

RasterFacts inspect(GDALDataset& dataset, RasterFacts facts) {
    GdalErrors quiet;
    facts.driver = dataset.GetDriver() ? dataset.GetDriver()->GetDescription() : "";
    facts.columns = dataset.GetRasterXSize();
    facts.rows = dataset.GetRasterYSize();
    if (dataset.GetRasterCount() < 1) {
        const char* first = CSLFetchNameValue(dataset.GetMetadata("SUBDATASETS"), "SUBDATASET_1_NAME");
        throw DataError(
            text(facts.named(), " holds no band",
                 first ? text("; accepted: one of its subdatasets, such as '", first, "'") : std::string()));
    }
    facts.bands = dataset.GetRasterCount();
    inspect_grid(dataset, facts);
    if (const OGRSpatialReference* crs = dataset.GetSpatialRef()) set_crs(facts, Crs::in_usual_words(from_gdal(*crs)));
    inspect_band(dataset, facts);
    return facts;
}

/// Of one band: its block, and the largest as the file holds it. Only GeoTIFF tells how large those are.
ReaderBytes block_bytes(GDALRasterBand& band, bool tiff) {
    int wide = 0, high = 0;
    band.GetBlockSize(&wide, &high);
    ReaderBytes bytes;
    bytes.decoded = static_cast<std::size_t>(std::max(1, wide)) * static_cast<std::size_t>(std::max(1, high)) *
                    static_cast<std::size_t>(type_bytes(band.GetRasterDataType()));
    // What does not shrink may grow a little.
    bytes.packed = bytes.decoded + bytes.decoded / 64 + 1024;
    constexpr std::size_t small = std::size_t{1} << 20;
    constexpr std::int64_t most_asked = 1 << 14;
    if (!tiff || bytes.decoded < small) return bytes;
    const std::int64_t across = (band.GetXSize() + wide - 1) / wide, down = (band.GetYSize() + high - 1) / high;
    if (across * down > most_asked) return bytes;
    std::size_t largest = 0;
    for (std::int64_t r = 0; r < down; ++r)
        for (std::int64_t c = 0; c < across; ++c)
            if (const char* size = band.GetMetadataItem(text("BLOCK_SIZE_", c, '_', r).c_str(), "TIFF"))
                largest = std::max(largest, static_cast<std::size_t>(CPLAtoGIntBig(size)));
    constexpr std::size_t handle = std::size_t{1} << 18;  // measured beside the buffer itself
    if (largest > 0) bytes.packed = std::min(bytes.packed, largest + largest / 64 + handle);
    return bytes;
}

std::size_t raster_bytes(GDALRasterBand& band) {
    return static_cast<std::size_t>(band.GetXSize()) * static_cast<std::size_t>(band.GetYSize()) *
           static_cast<std::size_t>(type_bytes(band.GetRasterDataType()));
}

ReaderBytes dataset_bytes(GDALDataset& dataset) {
    GdalErrors quiet;
    const bool tiff = dataset.GetDriver() && EQUAL(dataset.GetDriver()->GetDescription(), "GTiff");
    GDALRasterBand& band = *dataset.GetRasterBand(1);
    ReaderBytes bytes = block_bytes(band, tiff);
    const char* compression = dataset.GetMetadataItem("COMPRESSION", "IMAGE_STRUCTURE");
    constexpr std::size_t zstd_window = std::size_t{8} << 20;  // up to level 19
    if (compression && EQUAL(compression, "ZSTD")) bytes.packed += std::min(bytes.decoded, zstd_window);
    // Of decoded chunks netCDF keeps so many for itself, and the libraries take what others do not.
    constexpr std::size_t chunk_cache = std::size_t{16} << 20, libraries = std::size_t{4} << 20;
    if (dataset.GetDriver() && by_hdf5(dataset.GetDriver()->GetDescription()))
        bytes.packed += libraries + std::min(chunk_cache, raster_bytes(band));
    // Bands that lie post by post beside one another are decoded together, and once more apart.
    const char* order = dataset.GetMetadataItem("INTERLEAVE", "IMAGE_STRUCTURE");
    const int bands = dataset.GetRasterCount();
    if (bands > 1 && order && EQUAL(order, "PIXEL")) {
        bytes.decoded *= 2 * static_cast<std::size_t>(bands);
        bytes.packed *= static_cast<std::size_t>(bands);
    }
    const int flags = band.GetMaskFlags();
    if ((flags & (GMF_ALL_VALID | GMF_NODATA)) == 0)
        if (GDALRasterBand* mask = band.GetMaskBand()) {
            const ReaderBytes more = block_bytes(*mask, tiff);
            bytes.decoded += more.decoded;
            bytes.packed += more.packed;
        }
    return bytes;
}

/// Of the rasters that a VRT is made of, of which GDAL holds some open: takes their blocks into `facts`.
ReaderBytes vrt_bytes(const std::vector<std::string>& files, ReaderBytes bytes, RasterFacts& facts) {
    constexpr std::size_t most_asked = 64;  // of a large mosaic's parts these stand for all
    GdalErrors quiet;
    ReaderBytes largest;
    std::size_t parts = 0;
    for (const std::string& file : files) {
        if (parts >= most_asked) break;
        const DatasetHandle part = open_dataset(file);
        if (!part || part->GetRasterCount() < 1 || EQUAL(part->GetDriver()->GetDescription(), "VRT")) continue;
        ++parts;
        int columns = 0, rows = 0;
        part->GetRasterBand(1)->GetBlockSize(&columns, &rows);
        if (std::int64_t{columns} * rows > facts.behind_columns * facts.behind_rows) {
            facts.behind_columns = columns;
            facts.behind_rows = rows;
        }
        const bool tiff = EQUAL(part->GetDriver()->GetDescription(), "GTiff");
        facts.behind_packed |= !tiff || part->GetMetadataItem("COMPRESSION", "IMAGE_STRUCTURE") != nullptr;
        const ReaderBytes own = dataset_bytes(*part);
        largest = {std::max(largest.decoded, own.decoded), std::max(largest.packed, own.packed)};
    }
    bytes.decoded += largest.decoded;
    constexpr std::size_t decoder = std::size_t{1} << 17;  // its tables and buffers beside the block, as measured
    bytes.packed += (largest.packed + decoder) * std::min(files.size(), GdalSession::most_parts_open());
    return bytes;
}

/// Which state of which file.
struct FileState {
    dev_t device;
    ino_t number;
    off_t size;
    std::int64_t changed_s, changed_ns;
    bool operator==(const FileState&) const = default;
};
std::optional<FileState> state_of(const std::string& path) {
    struct stat s {};
    if (::stat(path.c_str(), &s) != 0 || !S_ISREG(s.st_mode)) return std::nullopt;
    return FileState{s.st_dev, s.st_ino, s.st_size, s.st_mtim.tv_sec, s.st_mtim.tv_nsec};
}

/// What was found out about rasters, for those that are opened again: a run looks at each several times before it
/// reads it, and to ask GDAL and PROJ takes milliseconds. A mosaic is not remembered, for its parts may change.
struct Inspected {
    RasterFacts facts;
    std::vector<std::string> files;
    std::vector<std::optional<FileState>> states;  ///< of each
    ReaderBytes reader_bytes;
};
std::vector<std::optional<FileState>> states_of(const std::vector<std::string>& files) {
    std::vector<std::optional<FileState>> states;
    for (const std::string& file : files) states.push_back(state_of(file));
    return states;
}
struct Memory {
    std::mutex mutex;
    std::uint64_t session = 0;
    std::map<std::string, std::pair<FileState, Inspected>> known;
};
Memory& memory() {
    static Memory all;
    return all;
}

std::optional<Inspected> recall(const std::string& path) {
    Memory& all = memory();
    const std::lock_guard lock(all.mutex);
    if (all.session != GdalSession::number()) return std::nullopt;
    const auto found = all.known.find(path);
    if (found == all.known.end() || state_of(path) != found->second.first) return std::nullopt;
    const Inspected& known = found->second.second;
    if (states_of(known.files) != known.states) return std::nullopt;  // a side file tells something else
    return known;
}

void remember(const FileState& when, Inspected found) {
    constexpr std::size_t most = 64;
    Memory& all = memory();
    const std::lock_guard lock(all.mutex);
    // Another session may read with other options.
    if (all.session != GdalSession::number() || all.known.size() >= most) all.known.clear();
    all.session = GdalSession::number();
    const std::string path = found.facts.path;
    all.known.insert_or_assign(path, std::pair(when, std::move(found)));
}

}  // namespace

std::uint64_t RasterFile::fingerprint(const std::vector<Window>&) { return raster_fingerprint(facts_, files_); }

/// A reader for as long as it is needed.
class RasterFile::Lease {
public:
    explicit Lease(RasterFile& file) : file_(file) {
        quiet_hdf5(file_.facts_.driver);
        if (file_.facts_.packed_as_a_whole()) alone_ = std::unique_lock(file_.alone_);
        {
            const std::lock_guard lock(file_.mutex_);
            if (auto& free = file_.free_; !free.empty()) {
                // What it decoded is of use to who read through it last.
                const auto own = std::find_if(free.rbegin(), free.rend(), [](const std::unique_ptr<Reader>& reader) {
                    return reader->last == std::this_thread::get_id();
                });
                if (own != free.rend()) std::swap(*own, free.back());
                reader_ = std::move(free.back());
                free.pop_back();
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
        reader_->last = std::this_thread::get_id();
        const std::lock_guard lock(file_.mutex_);
        file_.free_.push_back(std::move(reader_));
    }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    Reader& operator*() const { return *reader_; }

private:
    RasterFile& file_;
    std::unique_lock<std::mutex> alone_;
    std::unique_ptr<Reader> reader_;
};

RasterFile::RasterFile(std::string role, std::string path) {
    if (auto known = recall(path); known && is_of_heights(known->facts.role) == is_of_heights(role) &&
                                   is_looked_into(known->facts.role) == is_looked_into(role)) {
        facts_ = std::move(known->facts);
        facts_.role = std::move(role);
        files_ = std::move(known->files);
        reader_bytes_ = known->reader_bytes;
        prepare();
        return;
    }
    facts_.role = std::move(role);
    facts_.path = std::move(path);
    const std::optional<FileState> before = state_of(facts_.path);
    DatasetHandle dataset = open(facts_);
    facts_ = inspect(*dataset, std::move(facts_));
    files_ = files_behind(*dataset);
    reader_bytes_ = dataset_bytes(*dataset);
    if (facts_.driver == "VRT") {
        reader_bytes_ = vrt_bytes(files_, reader_bytes_, facts_);
    } else if (before) {
        remember(*before, {facts_, files_, states_of(files_), reader_bytes_});
    }

    prepare();
    auto reader = std::make_unique<Reader>();
    reader->dataset = std::move(dataset);
    reader->band = reader->dataset->GetRasterBand(1);
    free_.push_back(std::move(reader));
}

void RasterFile::close_idle() {
    std::vector<std::unique_ptr<Reader>> closed;
    const std::lock_guard lock(mutex_);
    closed.swap(free_);
}

/// Where a line of a text begins is known when all before it are read. GDAL looks for each line anew where one of these fails, which
/// in a file cut short takes for ever.
void RasterFile::find_lines(Reader& reader, std::int64_t line) const {
    if (!facts_.is_text()) return;
    std::vector<std::byte> values(static_cast<std::size_t>(facts_.block_columns * facts_.type_bytes));
    for (; reader.lines_found < line; ++reader.lines_found)
        if (GdalErrors errors;
            reader.band->ReadBlock(0, static_cast<int>(reader.lines_found), values.data()) != CE_None)
            throw IoError(text(facts_.named(), ": row ", reader.lines_found, " cannot be read: ", errors.reason()));
}

/// Into GDAL's cache, each line once: asked for the lines of a window from below it would begin at the top for each of them.
void RasterFile::decode_lines(Reader& reader, std::int64_t end) const {
    if (!facts_.packed_as_a_whole()) return;
    for (; reader.lines_found < end; reader.lines_found += facts_.block_rows) {
        const int row = static_cast<int>(reader.lines_found / facts_.block_rows);
        GdalErrors errors;
        GDALRasterBlock* const block = reader.band->GetLockedBlockRef(0, row);
        if (!block)
            throw IoError(text(facts_.named(), ": row ", reader.lines_found, " cannot be read: ", errors.reason()));
        block->DropLock();
    }
}

void RasterFile::read_values(const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) {
    if (window.empty()) return;
    const Lease lease(*this);
    find_lines(*lease, window.rows.begin);
    decode_lines(*lease, window.rows.end);
    GdalErrors errors;
    const int columns = static_cast<int>(window.columns.size()), rows = static_cast<int>(window.rows.size());
    // A VRT computes in the type that is asked for: fractions of scaled or interpolated sources are none of its band's type.
    const Widening widen = facts_.driver == "VRT" || facts_.type == type ? nullptr : widening(facts_.type, type);
    const GDALDataType read = widen ? facts_.type : type;
    const auto n = static_cast<std::size_t>(columns);
    auto* const bytes = static_cast<std::byte*>(out);
    const std::size_t beside = n * static_cast<std::size_t>(type_bytes(type) - type_bytes(read));
    if ((*lease).band->RasterIO(GF_Read, static_cast<int>(window.columns.begin), static_cast<int>(window.rows.begin),
                                columns, rows, bytes + beside, columns, rows, read, 0, line_bytes, nullptr) != CE_None)
        throw IoError(text(facts_.named(), ": ", place(window), " cannot be read: ", errors.reason()));
    for (int r = 0; widen && r < rows; ++r) widen(bytes + r * line_bytes + beside, bytes + r * line_bytes, n);
}

bool RasterFile::read_mask(const Window& window, std::vector<std::uint8_t>& masks) {
    if (!facts_.has_mask) return false;
    masks.resize(static_cast<std::size_t>(window.posts()));
    const Lease lease(*this);
    GdalErrors errors;
    const int columns = static_cast<int>(window.columns.size()), rows = static_cast<int>(window.rows.size());
    GDALRasterBand* mask = (*lease).band->GetMaskBand();
    if (!mask || mask->RasterIO(GF_Read, static_cast<int>(window.columns.begin), static_cast<int>(window.rows.begin),
                                columns, rows, masks.data(), columns, rows, GDT_Byte, 0, 0, nullptr) != CE_None)
        throw IoError(text(facts_.named(), ": the mask of ", place(window), " cannot be read: ", errors.reason()));
    return std::any_of(masks.begin(), masks.end(), [](std::uint8_t m) { return m == 0; });
}

}  // namespace wedgescope
