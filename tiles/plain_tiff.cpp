#include "tiles/plain_tiff.hpp"

#include <cpl_conv.h>
#include <cpl_string.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdarg>
#include <cstring>
#include <filesystem>
#include <limits>
#include <span>
#include <string_view>
#include <utility>

#include "lib/lower_case.hpp"
#include "tiles/crs_by_rule.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/tiff_handle.hpp"

namespace wedgescope {
namespace {

/// A short field as the file has it, or as the standard says it is where the file has none.
std::uint16_t tag_value(TIFF* file, std::uint32_t tag, std::uint16_t without) {
    std::uint16_t value = 0;
    return TIFFGetFieldDefaulted(file, tag, &value) == 1 ? value : without;
}

/// libtiff has something to say of a file that is not as it should be: what it makes of it then, GDAL may take otherwise.
struct Doubts {
    bool any = false;
    static int hear_error(TIFF*, void* doubts, const char*, const char*, std::va_list) {
        static_cast<Doubts*>(doubts)->any = true;
        return 1;
    }
    static int hear_warning(TIFF*, void* doubts, const char*, const char* format, std::va_list) {
        // GeoTIFF's tags and GDAL's it knows only when told of them.
        if (std::string_view(format).find("Unknown field") == std::string_view::npos)
            static_cast<Doubts*>(doubts)->any = true;
        return 1;
    }
};

/// A tag of GeoTIFF's or GDAL's: libtiff knows it only if it was told of it, by whomever; else it takes it as it comes.
template <class T>
struct Values {
    const T* begin = nullptr;
    std::uint32_t count = 0;
    explicit operator bool() const { return begin != nullptr; }
    const T& operator[](std::size_t i) const { return begin[i]; }
};
/// Of another type, or more than GDAL counts, they are in doubt.
template <class T>
Values<T> values(TIFF* file, std::uint32_t tag, TIFFDataType type, Doubts& doubts) {
    const TIFFField* field = TIFFFindField(file, tag, TIFF_ANY);
    if (!field) return {};
    if (TIFFFieldDataType(field) != type) {
        doubts.any = true;
        return {};
    }
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
    doubts.any |= found.count > std::numeric_limits<std::uint16_t>::max();
    return found;
}
/// Empty where there is none.
std::string words(TIFF* file, std::uint32_t tag, Doubts& doubts) {
    const auto found = values<char>(file, tag, TIFF_ASCII, doubts);
    std::string all = found ? std::string(found.begin, found.count) : std::string();
    all.resize(std::min(all.size(), all.find('\0')));
    return all;
}

GDALDataType type_of(TIFF* file) {
    const std::uint16_t bits = tag_value(file, TIFFTAG_BITSPERSAMPLE, 1);
    switch (tag_value(file, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT)) {
        case SAMPLEFORMAT_UINT:
            return bits == 8 ? GDT_Byte : bits == 16 ? GDT_UInt16 : bits == 32 ? GDT_UInt32 : GDT_Unknown;
        case SAMPLEFORMAT_INT:  // signed bytes GDAL tells from others by a word beside them
            return bits == 16 ? GDT_Int16 : bits == 32 ? GDT_Int32 : GDT_Unknown;
        case SAMPLEFORMAT_IEEEFP:
            return bits == 32 ? GDT_Float32 : bits == 64 ? GDT_Float64 : GDT_Unknown;
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

/// Are there none of the files from which GDAL would read more: what it or others keep beside a raster, a mask? It lists the folder
/// and takes any letters for small; where that is too large, it asks for names in small and in large ones.
bool is_alone(const std::string& path) {
    constexpr const char *beside[] = {".aux.xml", ".aux", ".msk"}, *large[] = {".AUX.XML", ".AUX", ".MSK"};
    std::error_code error;
    const std::filesystem::path file(path);
    if (!std::filesystem::is_regular_file(file, error)) return false;
    const std::string name = lower_case(file.filename().string()), stem = lower_case(file.stem().string());
    constexpr int most_listed = 1000;
    int listed = 0;
    const std::filesystem::path folder = file.parent_path().empty() ? "." : file.parent_path();
    std::filesystem::directory_iterator at(folder, error), end;
    for (; !error && at != end && listed < most_listed; at.increment(error), ++listed) {
        const std::string other = lower_case(at->path().filename().string());
        if (!other.starts_with(stem)) continue;
        for (const char* more : beside)
            if (other == name + more || other == stem + more) return false;
    }
    if (!error && listed < most_listed) return true;
    const std::string whole_stem = std::filesystem::path(file).replace_extension().string();
    for (const std::string& base : {path, whole_stem})
        for (const auto& words : {std::span(beside), std::span(large)})
            for (const char* more : words)
                if (::access((base + more).c_str(), F_OK) == 0) return false;
    return true;
}

constexpr std::uint32_t rational_coefficients = 50844;

/// What GeoTIFF's keys say (OGC 19-008r4, 7).
struct Keys {
    int epsg = 0;
    bool posts = false;  ///< the tie point is where a post is, not a cell's corner
};
/// Nothing where they are more than a code.
std::optional<Keys> keys_of(TIFF* file, Doubts& doubts) {
    const auto directory = values<std::uint16_t>(file, key_directory, TIFF_SHORT, doubts);
    if (!directory || directory.count < 4 || directory[0] != 1 || directory[1] != 1) return std::nullopt;
    const std::size_t count = directory[3];
    if (directory.count < 4 * (count + 1)) return std::nullopt;
    const auto doubles = values<double>(file, key_doubles, TIFF_DOUBLE, doubts);
    const std::string text_list = words(file, key_words, doubts);
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
                if (list != key_words || value > text_list.size() || std::size_t{value} + n > text_list.size() + 1)
                    return std::nullopt;
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
    if (geodetic != 0 && geodetic != wgs84_code) return std::nullopt;
    if (model == geographic && plane == 0) keys.epsg = geodetic;
    if (model == projected) keys.epsg = plane;
    return keys.epsg != 0 ? std::optional(keys) : std::nullopt;
}

/// As GDAL reads it; nothing for words that are no plain number below huge_no_data.
std::optional<double> number(std::string_view words) {
    while (!words.empty() && words.front() == ' ') words.remove_prefix(1);
    while (!words.empty() && words.back() == ' ') words.remove_suffix(1);
    if (words == "nan") return std::numeric_limits<double>::quiet_NaN();
    double value = 0;
    const auto [end, error] = std::from_chars(words.data(), words.data() + words.size(), value);
    if (error != std::errc() || end != words.data() + words.size() || !(std::fabs(value) < huge_no_data))
        return std::nullopt;
    return value;
}

constexpr std::uint32_t most_tiles = std::uint32_t{1} << 18;

/// Does the band hold what its posts are, and nothing beside?
bool is_plain(TIFF* file) {
    const std::uint16_t photometric = tag_value(file, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    return (TIFFIsTiled(file) ? TIFFNumberOfTiles(file) : TIFFNumberOfStrips(file)) <= most_tiles &&
           tag_value(file, TIFFTAG_SAMPLESPERPIXEL, 1) == 1 &&
           (photometric == PHOTOMETRIC_MINISBLACK || photometric == PHOTOMETRIC_PALETTE) &&
           tag_value(file, TIFFTAG_FILLORDER, FILLORDER_MSB2LSB) == FILLORDER_MSB2LSB &&
           tag_value(file, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT) == ORIENTATION_TOPLEFT;
}

/// Where the posts lie and how they are packed, of the type that the facts have; false where libtiff alone cannot tell.
bool find_tiles(TIFF* file, PlainTiff& found) {
    RasterFacts& facts = found.facts;
    const char* const compression = compression_name(tag_value(file, TIFFTAG_COMPRESSION, COMPRESSION_NONE));
    auto tiles = TiffIndex::level_of(file);
    if (facts.type == GDT_Unknown || !compression || !tiles) return false;
    facts.type_bytes = type_bytes(facts.type);
    facts.compression = compression;
    constexpr std::int64_t most = std::numeric_limits<std::int32_t>::max();
    const std::int64_t wide = tiles->tile_columns, high = tiles->tile_rows;
    if (tiles->columns < 1 || tiles->columns > most || tiles->rows < 1 || tiles->rows > most || wide < 1 ||
        wide > most || high < 1 || high > most / wide / facts.type_bytes)
        return false;
    facts.columns = tiles->columns;
    facts.rows = tiles->rows;
    facts.block_columns = wide;
    facts.block_rows = high;
    for (std::size_t i = 0; i < tiles->offsets.size(); ++i) {
        constexpr auto end = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
        if (tiles->offsets[i] > end || tiles->byte_counts[i] > end - tiles->offsets[i]) return false;
    }
    const int predictor = tiles->predictor;
    const bool floats = facts.type == GDT_Float32 || facts.type == GDT_Float64;
    if (predictor != PREDICTOR_NONE && predictor != PREDICTOR_HORIZONTAL &&
        !(predictor == PREDICTOR_FLOATINGPOINT && floats))
        return false;
    found.swapped = TIFFIsByteSwapped(file) != 0;
    found.tiles = std::move(*tiles);
    return true;
}

/// False where it is not by a scale and one tie point alone.
bool find_grid(TIFF* file, bool posts, RasterFacts& facts, Doubts& doubts) {
    const auto scale = values<double>(file, pixel_scale, TIFF_DOUBLE, doubts);
    const auto tie = values<double>(file, tie_points, TIFF_DOUBLE, doubts);
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

/// The no-data value in GDAL's tag, if there is one; false for words that GDAL may read otherwise.
bool find_no_data(const std::string& words, RasterFacts& facts) {
    if (words.empty()) return true;
    const auto value = number(words);
    if (!value) return false;
    // Of a float GDAL takes the shortest number that it stands for.
    const bool whole = *value == std::trunc(*value) && *value == static_cast<double>(static_cast<float>(*value));
    if (facts.type == GDT_Float32 && !whole && !std::isnan(*value)) return false;
    facts.has_no_data = true;
    facts.no_data = *value;
    return true;
}

/// The band's unit as GDAL writes it into its metadata, which is left without it; false for a unit that may be none of length.
bool take_unit(std::string& metadata, RasterFacts& facts) {
    constexpr std::string_view head = R"(<Item name="UNITTYPE" sample="0" role="unittype">)", tail = "</Item>";
    const std::size_t at = metadata.find(head);
    if (at == std::string::npos) return true;
    const std::size_t begin = at + head.size(), end = metadata.find(tail, begin);
    if (end == std::string::npos || end == begin) return false;
    const std::string unit = metadata.substr(begin, end - begin);
    const auto plain = [](unsigned char c) { return std::isalnum(c) || c == ' ' || c == '_' || c == '-'; };
    const auto metres = unit_in_metres(unit);
    if (!metres || !std::all_of(unit.begin(), unit.end(), plain) || unit.front() == ' ' || unit.back() == ' ')
        return false;
    facts.unit = unit;
    facts.unit_m = *metres;
    metadata.erase(at, end + tail.size() - at);
    return true;
}

/// Is another directory the mask of this one? Many are in doubt. Leaves the file at its last.
bool has_mask(TIFF* file, Doubts& doubts) {
    constexpr int most = 64;
    for (int directory = 1; TIFFReadDirectory(file); ++directory) {
        std::uint32_t kind = 0;
        TIFFGetFieldDefaulted(file, TIFFTAG_SUBFILETYPE, &kind);
        if ((kind & FILETYPE_MASK) != 0) return true;
        if (directory == most) doubts.any = true;
        if (doubts.any) return false;
    }
    return false;
}

}  // namespace

std::optional<PlainTiff> PlainTiff::of(const std::string& role, const std::string& path) {
    if (GdalSession::configured() || !is_alone(path)) return std::nullopt;
    Doubts doubts;
    const TiffReader opened = read_tiff(path, Doubts::hear_error, Doubts::hear_warning, &doubts);
    TIFF* const file = opened.get();
    if (!file || !is_plain(file) || values<double>(file, transformation, TIFF_DOUBLE, doubts) ||
        values<double>(file, rational_coefficients, TIFF_DOUBLE, doubts))
        return std::nullopt;
    PlainTiff found;
    RasterFacts& facts = found.facts;
    facts.role = role;
    facts.path = path;
    facts.driver = "GTiff";
    facts.type = type_of(file);
    const auto keys = keys_of(file, doubts);
    std::string metadata = words(file, gdal_metadata, doubts);
    if (!take_unit(metadata, facts)) return std::nullopt;
    // Other items with a role are of the band too: scale, offset.
    metadata = lower_case(std::move(metadata));
    const std::string no_data = words(file, gdal_no_data, doubts);
    if (!keys || metadata.find("role") != std::string::npos || metadata.find("domain") != std::string::npos ||
        !find_no_data(no_data, facts) || !find_tiles(file, found))
        return std::nullopt;
    const auto crs = Crs::by_rule(keys->epsg);
    if (!crs || !find_grid(file, keys->posts, facts, doubts)) return std::nullopt;
    set_crs(facts, crs);
    if (has_mask(file, doubts) || doubts.any) return std::nullopt;
    return found;
}

std::optional<PlainTiff> PlainTiff::as_told(const RasterFacts& told) {
    std::error_code error;
    if (told.driver != "GTiff" || told.has_mask || told.signed_byte ||
        CPLTestBool(CPLGetConfigOption("GTIFF_IGNORE_READ_ERRORS", "NO")) ||
        !std::filesystem::is_regular_file(told.path, error))
        return std::nullopt;
    Doubts doubts;
    const TiffReader opened = read_tiff(told.path, Doubts::hear_error, Doubts::hear_warning, &doubts);
    TIFF* const file = opened.get();
    if (!file || !is_plain(file) || type_of(file) != told.type) return std::nullopt;
    PlainTiff found;
    found.facts = told;
    if (!find_tiles(file, found) || found.facts.columns != told.columns || found.facts.rows != told.rows || doubts.any)
        return std::nullopt;
    return found;
}

std::vector<std::string> PlainTiff::files(const std::string& path) {
    std::vector<std::string> found{path};
    if (std::string overviews = path + ".ovr"; ::access(overviews.c_str(), F_OK) == 0)
        found.push_back(std::move(overviews));
    return found;
}

}  // namespace wedgescope
