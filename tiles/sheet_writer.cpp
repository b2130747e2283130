#include "tiles/sheet_writer.hpp"

#include <cpl_string.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "lib/error.hpp"
#include "lib/lanes.hpp"
#include "tiles/checksum.hpp"
#include "tiles/plain_file.hpp"
#include "tiles/store_layer.hpp"

namespace wedgescope {
namespace {

/// Voids of one stored type, as reading takes them.
template <class T>
struct Void {
    explicit Void(const RasterFacts& facts)
        : has(facts.has_no_data), huge_sign(huge_no_data_sign(facts)), no_data(facts.no_data) {
        GDALCopyWords(&no_data, GDT_Float64, 0, &as_float, GDT_Float32, 0, 1);
        GDALCopyWords(&no_data, GDT_Float64, 0, &value, facts.type, 0, 1);
        if (!has && std::is_floating_point_v<T>) value = static_cast<T>(std::nan(""));
    }
    bool operator()(T v) const {
        if constexpr (std::is_floating_point_v<T>) {
            if (std::isnan(v)) return true;
            if (huge_sign != 0) return static_cast<double>(v) * huge_sign > huge_no_data;
        }
        return has && static_cast<float>(v) == as_float;
    }
    bool has = false;
    double huge_sign = 0, no_data = 0;
    float as_float = 0;
    T value{};
};

template <class T>
T most_frequent(const T* valid, int count) {
    int best = 0, votes = 0;
    for (int i = 0; i < count; ++i) {
        const int n = static_cast<int>(std::count(valid, valid + count, valid[i]));
        if (n > votes) {
            best = i;
            votes = n;
        }
    }
    return valid[best];
}

/// `to` may lie in `from`, before what is still to be read.
template <class T>
WEDGESCOPE_LANES_PART void every_second(std::size_t n, const T* from, T* to) noexcept {
    for (std::size_t i = 0; i < n; ++i) to[i] = from[2 * i];
}

/// `from` (wide x high posts, rows `stride` apart) into halves, rows `to_stride` apart: of heights every second post.
template <class T>
void halve(const RasterFacts& facts, bool codes, const std::byte* from_bytes, std::int64_t wide, std::int64_t high,
           std::int64_t stride, std::byte* to_bytes, std::int64_t to_stride) {
    const auto* from = reinterpret_cast<const T*>(from_bytes);
    auto* to = reinterpret_cast<T*>(to_bytes);
    if (!codes) {
        for (std::int64_t r = 0; r < high; r += 2)
            on_target<every_second<T>>(static_cast<std::size_t>(wide + 1) / 2, from + r * stride,
                                       to + r / 2 * to_stride);
        return;
    }
    const Void<T> is_void(facts);
    for (std::int64_t r = 0; r < high; r += 2)
        for (std::int64_t c = 0; c < wide; c += 2) {
            T valid[4];
            int count = 0;
            for (std::int64_t y = r; y < std::min(r + 2, high); ++y)
                for (std::int64_t x = c; x < std::min(c + 2, wide); ++x)
                    if (const T v = from[y * stride + x]; !is_void(v)) valid[count++] = v;
            to[r / 2 * to_stride + c / 2] = count == 0 ? is_void.value : most_frequent(valid, count);
        }
}

using Halve = decltype(&halve<float>);
Halve halver(GDALDataType type) {
    switch (type) {
        case GDT_Byte:
            return halve<std::uint8_t>;
        case GDT_Int16:
            return halve<std::int16_t>;
        case GDT_UInt16:
            return halve<std::uint16_t>;
        case GDT_Int32:
            return halve<std::int32_t>;
        case GDT_UInt32:
            return halve<std::uint32_t>;
        case GDT_Int64:
            return halve<std::int64_t>;
        case GDT_UInt64:
            return halve<std::uint64_t>;
        case GDT_Float64:
            return halve<double>;
        default:
            return halve<float>;
    }
}

/// Of these GDAL 3.6 never ends writing a file that gets overviews after its no-data value.
bool is_of_64_bits(GDALDataType type) { return type == GDT_Int64 || type == GDT_UInt64; }

}  // namespace

std::size_t sheet_writer_bytes(const RasterFacts& facts) {
    const std::int64_t half = SheetSums::side(std::min(sheet_posts, facts.columns), 1) *
                              SheetSums::side(std::min(sheet_posts, facts.rows), 1);
    // Two tiles of ours; about four more pass through GDAL and libtiff while one is packed.
    return static_cast<std::size_t>((half + 6 * facts.block_columns * facts.block_columns) * facts.type_bytes);
}

SheetWriter::SheetWriter(const RasterFacts& facts, bool codes, const Window& posts, std::string path,
                         const std::vector<std::string>& creation)
    : facts_(facts), codes_(codes), posts_(posts), path_(std::move(path)) {
    sums_.columns = posts.columns.size();
    sums_.rows = posts.rows.size();
    sums_.tile = facts.block_columns;
    sums_.tiles.resize(sums_.tile_count());
    CPLStringList options;
    for (const std::string& option : creation) options.AddString(option.c_str());
    const std::string edge = std::to_string(sums_.tile);
    options.SetNameValue("TILED", "YES");
    options.SetNameValue("BLOCKXSIZE", edge.c_str());
    options.SetNameValue("BLOCKYSIZE", edge.c_str());
    GdalErrors errors;
    GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("GTiff");
    if (driver)
        dataset_.reset(driver->Create(path_.c_str(), static_cast<int>(sums_.columns), static_cast<int>(sums_.rows), 1,
                                      facts.type, options.List()));
    if (!dataset_ || errors.failed())
        throw IoError(text("sheet '", path_, "' cannot be made: ", errors.reason_of_writing(path_)));
    // GDAL only warns of an option or a value that it does not know, and writes something else.
    if (errors.warned()) throw InputError(text("co: ", errors.reason()));
    if (facts.has_geotransform) {
        double g[6] = {facts.corner_x + static_cast<double>(posts.columns.begin) * facts.step_x,
                       facts.step_x,
                       0,
                       facts.corner_y + static_cast<double>(posts.rows.begin) * facts.step_y,
                       0,
                       facts.step_y};
        dataset_->SetGeoTransform(g);
    }
    if (facts.crs) {
        const OGRSpatialReference crs = in_gdal(*facts.crs);
        dataset_->SetSpatialRef(&crs);
    }
    GDALRasterBand* band = dataset_->GetRasterBand(1);
    if (facts.has_no_data && !is_of_64_bits(facts.type)) band->SetNoDataValue(facts.no_data);
    if (facts.scale != 1) band->SetScale(facts.scale);
    if (facts.offset != 0) band->SetOffset(facts.offset);
    if (!facts.unit.empty()) band->SetUnitType(facts.unit.c_str());
    if (errors.failed()) throw IoError(text("sheet '", path_, "' cannot be made: ", errors.reason_of_writing(path_)));
    half_.resize(static_cast<std::size_t>(SheetSums::side(sums_.columns, 1) * SheetSums::side(sums_.rows, 1) *
                                          facts.type_bytes));
}

SheetWriter::~SheetWriter() {
    GdalErrors quiet;
    dataset_.reset();
}

void SheetWriter::write_tile(int level, std::int64_t column, std::int64_t row, const std::byte* values,
                             std::int64_t stride) {
    const std::int64_t edge = sums_.tile, size = facts_.type_bytes;
    const std::int64_t wide = std::min(edge, SheetSums::side(sums_.columns, level) - column * edge),
                       high = std::min(edge, SheetSums::side(sums_.rows, level) - row * edge);
    tile_.resize(static_cast<std::size_t>(edge * edge * size));
    // Packed for the checksum, then spread with voids beyond the sheet.
    for (std::int64_t r = 0; r < high; ++r)
        std::memcpy(tile_.data() + r * wide * size, values + r * stride * size, static_cast<std::size_t>(wide * size));
    sums_.tiles[sums_.index(level, column, row)] = checksum(tile_.data(), static_cast<std::size_t>(wide * high * size));
    if (wide < edge || high < edge) {
        fill_no_data(facts_, tile_.data(), static_cast<std::size_t>(edge * edge));
        for (std::int64_t r = 0; r < high; ++r)
            std::memcpy(tile_.data() + r * edge * size, values + r * stride * size,
                        static_cast<std::size_t>(wide * size));
    }
    GdalErrors errors;
    GDALRasterBand* band = dataset_->GetRasterBand(1);
    if (level > 0) band = band->GetOverview(level - 1);
    if (!band || band->WriteBlock(static_cast<int>(column), static_cast<int>(row), tile_.data()) != CE_None ||
        errors.failed())
        throw IoError(text("sheet '", path_, "' cannot be written: ", errors.reason_of_writing(path_)));
}

void SheetWriter::write(std::int64_t column, std::int64_t row, const std::byte* values, std::int64_t stride) {
    write_tile(0, column, row, values, stride);
    const std::int64_t edge = sums_.tile, across = SheetSums::side(sums_.columns, 1);
    halver(facts_.type)(facts_, codes_, values, std::min(edge, sums_.columns - column * edge),
                        std::min(edge, sums_.rows - row * edge), stride,
                        half_.data() + (row * edge / 2 * across + column * edge / 2) * facts_.type_bytes, across);
}

SheetSums SheetWriter::finish() {
    const auto failed = [&](const GdalErrors& errors) {
        return IoError(text("sheet '", path_, "' cannot be written: ", errors.reason_of_writing(path_)));
    };
    if (const int levels = sums_.levels() - 1; levels > 0) {
        GdalErrors errors;
        std::vector<int> factors;
        for (int k = 1; k <= levels; ++k) factors.push_back(1 << k);
        CPLSetThreadLocalConfigOption("GDAL_TIFF_OVR_BLOCKSIZE", std::to_string(sums_.tile).c_str());
        const CPLErr made = dataset_->BuildOverviews("NONE", levels, factors.data(), 0, nullptr, nullptr, nullptr);
        CPLSetThreadLocalConfigOption("GDAL_TIFF_OVR_BLOCKSIZE", nullptr);
        if (made != CE_None || errors.failed() || dataset_->GetRasterBand(1)->GetOverviewCount() != levels)
            throw failed(errors);
        for (int k = 1; k <= levels; ++k) {
            const std::int64_t wide = SheetSums::side(sums_.columns, k), high = SheetSums::side(sums_.rows, k);
            for (std::int64_t r = 0; r < sums_.down(k); ++r)
                for (std::int64_t c = 0; c < sums_.across(k); ++c)
                    write_tile(k, c, r, half_.data() + (r * sums_.tile * wide + c * sums_.tile) * facts_.type_bytes,
                               wide);
            // In place: what is written never passes what is still to be read.
            if (k < levels)
                halver(facts_.type)(facts_, codes_, half_.data(), wide, high, wide, half_.data(), (wide + 1) / 2);
        }
    }
    {
        GdalErrors errors;
        if (facts_.has_no_data && is_of_64_bits(facts_.type)) {
            // Opened anew: what is 0 all over a tile waits to be written until a file is closed, and would be no data then.
            dataset_.reset();
            dataset_.reset(GDALDataset::Open(path_.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
            if (!dataset_) throw failed(errors);
            GDALRasterBand* band = dataset_->GetRasterBand(1);
            if (facts_.type == GDT_Int64)
                band->SetNoDataValueAsInt64(whole_no_data<std::int64_t>(facts_));
            else
                band->SetNoDataValueAsUInt64(whole_no_data<std::uint64_t>(facts_));
        }
        dataset_->FlushCache(true);
        dataset_.reset();
        if (errors.failed()) throw failed(errors);
    }
    begin_sync(path_);
    sums_.file_bytes = file_bytes(path_);
    sums_.file_checksum = file_checksum(path_);
    // What was written is what will be read, whatever the creation options and the disk did.
    SheetReader reader(path_, facts_, posts_, sums_);
    for (int k = 0; k < sums_.levels(); ++k)
        for (std::int64_t r = 0; r < sums_.down(k); ++r)
            for (std::int64_t c = 0; c < sums_.across(k); ++c) try {
                    reader.tile(k, c, r);
                } catch (const DataError& e) {
                    throw IoError(text(e.what(), " right after it was written; do the creation options lose bits?"));
                }
    sync_file(path_);
    return sums_;
}

}  // namespace wedgescope
