#include "tiles/tiff_layer.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string_view>
#include <utility>

#include "lib/error.hpp"
#include "tiles/file_stamp.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/raster_file.hpp"
#include "tiles/tiff_handle.hpp"
#include "tiles/tiff_index.hpp"

namespace wedgescope {
namespace {

/// A short field as the file has it, or as the standard says it is where the file has none.
std::uint16_t word(TIFF* file, std::uint32_t tag, std::uint16_t without) {
    std::uint16_t value = 0;
    return TIFFGetFieldDefaulted(file, tag, &value) == 1 ? value : without;
}

/// A tag of GeoTIFF's or GDAL's: libtiff knows it only if it was told of it, by whomever; else it takes it as it comes.
template <class T>
struct Values {
    const T* begin = nullptr;
    std::uint32_t count = 0;
    explicit operator bool() const { return begin != nullptr; }
    const T& operator[](std::size_t i) const { return begin[i]; }
};
template <class T>
Values<T> values(TIFF* file, std::uint32_t tag, TIFFDataType type) {
    const TIFFField* field = TIFFFindField(file, tag, TIFF_ANY);
    if (!field || TIFFFieldDataType(field) != type) return {};
    Values<T> found;
    const void* begin = nullptr;
    if (!TIFFFieldPassCount(field)) {
        if (type != TIFF_ASCII || TIFFGetField(file, tag, &begin) != 1 || !begin) return {};
        found.count = static_cast<std::uint32_t>(std::strlen(static_cast<const char*>(begin)));
    } else if (TIFFFieldReadCount(field) == TIFF_VARIABLE2) {
        if (TIFFGetField(file, tag, &found.count, &begin) != 1 || !begin) return {};
    } else {
        std::uint16_t count = 0;
        if (TIFFGetField(file, tag, &count, &begin) != 1 || !begin) return {};
        found.count = count;
    }
    found.begin = static_cast<const T*>(begin);
    return found;
}
/// Empty where there is none.
std::string words(TIFF* file, std::uint32_t tag) {
    const auto found = values<char>(file, tag, TIFF_ASCII);
    std::string all = found ? std::string(found.begin, found.count) : std::string();
    all.resize(std::min(all.size(), all.find('\0')));
    return all;
}

GDALDataType type_of(TIFF* file) {
    const std::uint16_t bits = word(file, TIFFTAG_BITSPERSAMPLE, 1);
    switch (word(file, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT)) {
        case SAMPLEFORMAT_UINT:
            return bits == 8 ? GDT_Byte : bits == 16 ? GDT_UInt16 : bits == 32 ? GDT_UInt32 : GDT_Unknown;
        case SAMPLEFORMAT_INT:  // signed bytes GDAL tells from others by a word beside them
            return bits == 16 ? GDT_Int16 : bits == 32 ? GDT_Int32 : GDT_Unknown;
        case SAMPLEFORMAT_IEEEFP:
            return bits == 32 ? GDT_Float32 : GDT_Unknown;
        default:
            return GDT_Unknown;
    }
}

/// As GDAL names it; null: unpacked by GDAL alone, or not as it was packed.
const char* compression_name(std::uint16_t compression) {
    switch (compression) {
        case COMPRESSION_NONE:
            return "";
        case COMPRESSION_LZW:
            return "LZW";
        case COMPRESSION_ADOBE_DEFLATE:
        case COMPRESSION_DEFLATE:
            return "DEFLATE";
        case COMPRESSION_PACKBITS:
            return "PACKBITS";
        case COMPRESSION_ZSTD:
            return "ZSTD";
        default:
            return nullptr;
    }
}

/// Are there none of the files from which GDAL would read more: what it or others keep beside a raster, a mask?
bool is_alone(const std::string& path) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) return false;
    const std::string stem = std::filesystem::path(path).replace_extension().string();
    for (const std::string& base : {path, stem})
        for (const char* more : {".aux.xml", ".AUX.XML", ".aux", ".AUX", ".msk", ".MSK"})
            if (::access((base + more).c_str(), F_OK) == 0) return false;
    return true;
}

constexpr std::uint32_t pixel_scale = 33550, tie_points = 33922, transformation = 34264, key_directory = 34735,
                        key_doubles = 34736, key_words = 34737, gdal_metadata = 42112, gdal_no_data = 42113,
                        rational_coefficients = 50844;

/// What GeoTIFF's keys say (OGC 19-008r4, 7).
struct Keys {
    int epsg = 0;
    bool posts = false;  ///< the tie point is where a post is, not a cell's corner
};
/// Nothing where they are more than a code.
std::optional<Keys> keys_of(TIFF* file) {
    const auto directory = values<std::uint16_t>(file, key_directory, TIFF_SHORT);
    if (!directory || directory.count < 4 || directory[0] != 1 || directory[1] != 1) return std::nullopt;
    const std::size_t count = directory[3];
    if (directory.count < 4 * (count + 1)) return std::nullopt;
    const auto doubles = values<double>(file, key_doubles, TIFF_DOUBLE);
    const std::string text_list = words(file, key_words);
    constexpr int projected = 1, geographic = 2;
    Keys keys;
    int model = 0, geodetic = 0, plane = 0;
    for (std::size_t i = 1; i <= count; ++i) {
        const std::uint16_t key = directory[4 * i], list = directory[4 * i + 1], n = directory[4 * i + 2],
                            value = directory[4 * i + 3];
        const bool code = list == 0 && n == 1;
        const auto size = [&](double is) {
            return list == key_doubles && n == 1 && doubles && value < doubles.count &&
                   std::fabs(doubles[value] - is) <= 1e-9 * is;
        };
        switch (key) {
            case 1024:  // GTModelType
                if (!code) return std::nullopt;
                model = value;
                break;
            case 1025:  // GTRasterType: cells (1) or points (2)
                if (!code || (value != 1 && value != 2)) return std::nullopt;
                keys.posts = value == 2;
                break;
            case 1026:  // the citations
            case 2049:
            case 3073: {
                // Some programs keep a whole definition there: it is in letters and signs that no name has.
                if (list != key_words || std::size_t{value} + n > text_list.size() + 1) return std::nullopt;
                if (std::string_view(text_list).substr(value, n).find_first_of("=[]{}") != std::string_view::npos)
                    return std::nullopt;
                break;
            }
            case 2048:  // GeodeticCRS
                if (!code) return std::nullopt;
                geodetic = value;
                break;
            case 2050:  // GeodeticDatum
                if (!code || value != 6326) return std::nullopt;
                break;
            case 2054:  // GeogAngularUnits
                if (!code || value != 9102) return std::nullopt;
                break;
            case 2056:  // Ellipsoid
                if (!code || value != 7030) return std::nullopt;
                break;
            case 2057:  // EllipsoidSemiMajorAxis
                if (!size(6378137)) return std::nullopt;
                break;
            case 2059:  // EllipsoidInvFlattening
                if (!size(298.257223563)) return std::nullopt;
                break;
            case 3072:  // ProjectedCRS
                if (!code) return std::nullopt;
                plane = value;
                break;
            case 3076:  // ProjLinearUnits
                if (!code || value != 9001) return std::nullopt;
                break;
            default:
                return std::nullopt;
        }
    }
    constexpr int wgs84 = 4326;
    if (geodetic != 0 && geodetic != wgs84) return std::nullopt;
    if (model == geographic && plane == 0) keys.epsg = geodetic;
    if (model == projected) keys.epsg = plane;
    return keys.epsg != 0 ? std::optional(keys) : std::nullopt;
}

/// As GDAL reads it; nothing for words that are no plain number, and for one so large that a float is not it.
std::optional<double> number(std::string_view words) {
    while (!words.empty() && words.front() == ' ') words.remove_prefix(1);
    while (!words.empty() && words.back() == ' ') words.remove_suffix(1);
    if (words == "nan") return std::numeric_limits<double>::quiet_NaN();
    double value = 0;
    const auto [end, error] = std::from_chars(words.data(), words.data() + words.size(), value);
    if (error != std::errc() || end != words.data() + words.size() || !(std::fabs(value) < 1e30)) return std::nullopt;
    return value;
}

constexpr std::size_t most_tiles = std::size_t{1} << 18;

/// Does the band hold what its posts are, and nothing beside?
bool is_plain(TIFF* file) {
    const std::uint16_t photometric = word(file, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    return TIFFIsTiled(file) && TIFFNumberOfTiles(file) <= most_tiles && word(file, TIFFTAG_SAMPLESPERPIXEL, 1) == 1 &&
           (photometric == PHOTOMETRIC_MINISBLACK || photometric == PHOTOMETRIC_PALETTE) &&
           word(file, TIFFTAG_FILLORDER, FILLORDER_MSB2LSB) == FILLORDER_MSB2LSB &&
           word(file, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT) == ORIENTATION_TOPLEFT &&
           !values<double>(file, transformation, TIFF_DOUBLE) &&
           !values<double>(file, rational_coefficients, TIFF_DOUBLE);
}

/// False where it is not by a scale and one tie point alone.
bool find_grid(TIFF* file, bool posts, RasterFacts& facts) {
    const auto scale = values<double>(file, pixel_scale, TIFF_DOUBLE);
    const auto tie = values<double>(file, tie_points, TIFF_DOUBLE);
    if (!scale || scale.count < 2 || !(scale[0] > 0) || !(scale[1] > 0) || !tie || tie.count != 6) return false;
    std::array<double, 6> g{0, scale[0], 0, 0, 0, -scale[1]};
    g[0] = tie[3] - tie[0] * g[1];
    g[3] = tie[4] - tie[1] * g[5];
    if (posts) {
        g[0] -= g[1] * 0.5;
        g[3] -= g[5] * 0.5;
    }
    for (const double term : g)
        if (!std::isfinite(term)) return false;
    set_grid(facts, g);
    return true;
}

}  // namespace

struct TiffLayer::Contents {
    RasterFacts facts;
    TiffIndex index;
    bool swapped = false;  ///< of the other order of bytes
};

std::optional<TiffLayer::Contents> TiffLayer::contents(const std::string& role, const std::string& path) {
    if (GdalSession::configured() || !is_alone(path)) return std::nullopt;
    const TiffReader file = read_tiff(path);
    if (!file || !is_plain(file.get())) return std::nullopt;
    Contents found;
    RasterFacts& facts = found.facts;
    facts.role = role;
    facts.path = path;
    facts.driver = "GTiff";
    facts.type = type_of(file.get());
    const auto keys = keys_of(file.get());
    const char* const compression = compression_name(word(file.get(), TIFFTAG_COMPRESSION, COMPRESSION_NONE));
    // Items with a role are of the band: scale, offset, unit.
    const std::string metadata = words(file.get(), gdal_metadata), no_data = words(file.get(), gdal_no_data);
    if (facts.type == GDT_Unknown || !keys || !compression || metadata.find("role=") != std::string::npos ||
        metadata.find("domain=") != std::string::npos)
        return std::nullopt;
    facts.type_bytes = type_bytes(facts.type);
    facts.compression = compression;
    const auto crs = Crs::by_rule(keys->epsg);
    if (!crs) return std::nullopt;
    if (!no_data.empty()) {
        const auto value = number(no_data);
        // Of a float with a fraction GDAL takes the shortest number that it stands for.
        if (!value || (facts.type == GDT_Float32 && *value != std::trunc(*value) && !std::isnan(*value)))
            return std::nullopt;
        facts.has_no_data = true;
        facts.no_data = *value;
    }
    std::uint32_t columns = 0, rows = 0;
    TIFFGetField(file.get(), TIFFTAG_IMAGEWIDTH, &columns);
    TIFFGetField(file.get(), TIFFTAG_IMAGELENGTH, &rows);
    constexpr std::uint32_t most = std::numeric_limits<std::int32_t>::max();
    if (columns < 1 || columns > most || rows < 1 || rows > most) return std::nullopt;
    facts.columns = columns;
    facts.rows = rows;
    if (!find_grid(file.get(), keys->posts, facts)) return std::nullopt;
    set_crs(facts, crs);
    found.swapped = TIFFIsByteSwapped(file.get()) != 0;
    auto index = TiffIndex::of(file.get());
    if (!index || index->has_mask) return std::nullopt;
    const TiffIndex::Level& own = index->levels[0];
    facts.block_columns = own.tile_columns;
    facts.block_rows = own.tile_rows;
    index->levels.resize(1);
    found.index = std::move(*index);
    return found;
}

std::unique_ptr<TiffLayer> TiffLayer::of(const std::string& role, const std::string& path,
                                         std::shared_ptr<TileCache> cache) {
    auto found = contents(role, path);
    if (!found) return nullptr;
    if (!cache) cache = std::make_shared<TileCache>(0);
    const double room = static_cast<double>(cache->most_bytes());
    std::unique_ptr<TiffLayer> layer(new TiffLayer(std::move(*found), std::move(cache)));
    // A tile that the cache does not take would be unpacked for each window of it; GDAL keeps the one in use, however large.
    constexpr double few = 16;
    const bool kept = few * static_cast<double>(layer->tile_bytes()) <= room;
    return layer->fills_tile_cache() && room > 0 && !kept ? nullptr : std::move(layer);
}

TiffLayer::TiffLayer(Contents contents, std::shared_ptr<TileCache> cache)
    : cache_(std::move(cache)), cached_as_(cache_->new_layer()), index_(contents.index.levels[0]) {
    facts_ = std::move(contents.facts);
    const auto whole = [&](std::uint64_t bytes) { return bytes == 0 || bytes == tile_bytes(); };
    if (contents.swapped) {
        // libtiff turns them
    } else if (facts_.compression.empty() &&
               std::all_of(index_.byte_counts.begin(), index_.byte_counts.end(), whole)) {
        file_ = std::make_unique<PlainFile>(facts_.path, PlainFile::Use::read);
    } else {
        decoder_ = TileDecoder::of(facts_.path, std::move(contents.index), static_cast<std::size_t>(facts_.type_bytes));
    }
    prepare();
}

std::size_t TiffLayer::tile_bytes() const {
    return static_cast<std::size_t>(facts_.block_columns) * static_cast<std::size_t>(facts_.block_rows) *
           static_cast<std::size_t>(facts_.type_bytes);
}

ReaderBytes TiffLayer::reader_bytes() const {
    if (file_) return {rows_at_a_time() * row_bytes(), 0};
    // As the file holds it: what does not shrink may grow a little. Beside it ZSTD has its window; libtiff a codec, and where all
    // tiles lie.
    const std::size_t tile = tile_bytes(), packed = tile + tile / 64;
    constexpr std::size_t context = std::size_t{1} << 14, codec = std::size_t{1} << 16;
    if (decoder_) return {tile, packed + (facts_.compression.empty() ? 0 : tile + context)};
    return {tile, packed + codec + 2 * index_bytes()};
}

std::uint64_t TiffLayer::fingerprint(const std::vector<Window>&) { return files_fingerprint({facts_.path}); }

/// libtiff's handle, for one thread at a time.
struct TiffLayer::Reader {
    TiffTrouble trouble;  // outlives `file`, which may have something to say at its end
    TiffReader file;
    explicit Reader(const std::string& path) : file(read_tiff(path, note_trouble, &trouble)) {}
};

TiffLayer::~TiffLayer() = default;

std::unique_ptr<TiffLayer::Reader> TiffLayer::lend() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return std::make_unique<Reader>(facts_.path);
    auto reader = std::move(free_.back());
    free_.pop_back();
    return reader;
}

/// By the decoder; where it cannot, by libtiff, which also says what is wrong. IoError.
void TiffLayer::unpack(std::int64_t column, std::int64_t row, RawVector<std::byte>& values) {
    try {
        if (decoder_ && decoder_->decode(0, column, row, values, [] { return true; })) return;
    } catch (const IoError&) {  // libtiff says it again
    }
    auto reader = lend();
    const auto x = static_cast<std::uint32_t>(column * facts_.block_columns),
               y = static_cast<std::uint32_t>(row * facts_.block_rows);
    TIFF* const file = reader->file.get();
    const auto bytes = static_cast<tmsize_t>(values.size());
    if (!file || TIFFTileSize(file) != bytes ||
        TIFFReadEncodedTile(file, TIFFComputeTile(file, x, y, 0, 0), values.data(), bytes) != bytes) {
        const char* const words = reader->trouble.words;
        fail(column, row, words[0] ? words : "the file was changed while it was read");
    }
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(reader));
}

TileCache::Tile TiffLayer::tile(std::int64_t column, std::int64_t row) {
    const TileCache::Key key{cached_as_, tile_number(column, row)};
    if (auto found = cache_->find(key)) return found;
    RawVector<std::byte> values(tile_bytes());
    if (is_blank(column, row))
        fill_no_data(facts_, values.data(), values.size() / static_cast<std::size_t>(facts_.type_bytes));
    else
        unpack(column, row, values);
    auto kept = std::make_shared<const RawVector<std::byte>>(std::move(values));
    cache_->add(key, kept);
    return kept;
}

void TiffLayer::fail(std::int64_t column, std::int64_t row, const std::string& reason) const {
    const std::int64_t x = column * facts_.block_columns, y = row * facts_.block_rows;
    throw IoError(text(facts_.named(), ": ",
                       place({{x, std::min(facts_.columns, x + facts_.block_columns)},
                              {y, std::min(facts_.rows, y + facts_.block_rows)}}),
                       " cannot be read: ", reason));
}

void TiffLayer::read_values(const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) {
    if (window.empty()) return;
    const std::int64_t wide = facts_.block_columns, high = facts_.block_rows, size = wedgescope::type_bytes(type),
                       bytes = facts_.type_bytes;
    RawVector<std::byte> some;  // rows of a tile as they are
    for (std::int64_t tr = window.rows.begin / high; tr <= (window.rows.end - 1) / high; ++tr)
        for (std::int64_t tc = window.columns.begin / wide; tc <= (window.columns.end - 1) / wide; ++tc) {
            const Interval columns = intersection(window.columns, {tc * wide, (tc + 1) * wide}),
                           rows = intersection(window.rows, {tr * high, (tr + 1) * high});
            const auto take = [&](const std::byte* row, std::int64_t r) {
                convert(row + (columns.begin - tc * wide) * bytes, facts_.type,
                        static_cast<std::byte*>(out) + (r - window.rows.begin) * line_bytes +
                            (columns.begin - window.columns.begin) * size,
                        type, columns.size());
            };
            if (!file_ || is_blank(tc, tr)) {
                const TileCache::Tile values = tile(tc, tr);
                for (std::int64_t r = rows.begin; r < rows.end; ++r)
                    take(values->data() + (r - tr * high) * wide * bytes, r);
                continue;
            }
            const auto most = static_cast<std::int64_t>(rows_at_a_time());
            for (std::int64_t r = rows.begin; r < rows.end;) {
                const Interval part{r, std::min(rows.end, r + most)};
                some.resize(static_cast<std::size_t>(part.size()) * row_bytes());
                try {
                    file_->read(index_.offsets[tile_number(tc, tr)] + static_cast<std::uint64_t>(r - tr * high) * row_bytes(),
                                some.data(), some.size());
                } catch (const IoError& e) {
                    fail(tc, tr, e.what());
                }
                for (; r < part.end; ++r) take(some.data() + static_cast<std::size_t>(r - part.begin) * row_bytes(), r);
            }
        }
}

bool reads_without_gdal(const std::string& path) { return TiffLayer::of("raster", path) != nullptr; }

std::unique_ptr<RasterLayer> open_raster(const std::string& role, const std::string& path,
                                         std::shared_ptr<TileCache> cache) {
    if (auto plain = TiffLayer::of(role, path, std::move(cache))) return plain;
    return std::make_unique<RasterFile>(role, path);
}

}  // namespace wedgescope
