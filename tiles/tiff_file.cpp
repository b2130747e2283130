#include "tiles/tiff_file.hpp"

#include <fcntl.h>
#include <geotiffio.h>
#include <tiffio.h>
#include <unistd.h>
#include <xtiffio.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <iterator>
#include <numbers>
#include <string_view>
#include <system_error>

#include "lib/error.hpp"
#include "tiles/claim.hpp"
#include "tiles/crs.hpp"
#include "tiles/side_file.hpp"

namespace wedgescope {
namespace {

constexpr int degree = 9102;

int number(const char* code) {
    int value = 0;
    if (!code) return 0;
    const std::string_view words(code);
    const auto [end, error] = std::from_chars(words.data(), words.data() + words.size(), value);
    return error == std::errc() && end == words.data() + words.size() ? value : 0;
}

bool is_epsg(const char* authority) {
    return authority && (std::string_view(authority) == "EPSG" || std::string_view(authority) == "epsg");
}

/// EPSG's code of the unit of a CRS's first axis, if it is a usual one; 0 if not, or if the CRS has not two axes. A unit in a
/// WKT seldom comes with its code.
int unit_of(PJ_CONTEXT* context, const PJ* crs) {
    const ProjObject axes(proj_crs_get_coordinate_system(context, crs));
    double size = 0;
    const char* name = nullptr;
    if (!axes || proj_cs_get_axis_count(context, axes.get()) != 2 ||
        !proj_cs_get_axis_info(context, axes.get(), 0, nullptr, nullptr, nullptr, &size, &name, nullptr, nullptr) ||
        !name)
        return 0;
    struct Unit {
        const char* name;
        double size;
        int code;
    };
    static constexpr Unit usual[] = {{"degree", std::numbers::pi / 180, degree},
                                     {"metre", 1, 9001},
                                     {"foot", 0.3048, 9002},
                                     {"US survey foot", 1200.0 / 3937, 9003}};
    for (const Unit& unit : usual)
        if (name == std::string_view(unit.name) && std::fabs(size - unit.size) < 1e-10) return unit.code;
    return 0;
}

/// Is a projected CRS's method one that GDAL too names by the CRS's code alone? Others it keeps in a file beside.
bool is_usual_method(PJ_CONTEXT* context, const PJ* crs) {
    // Transverse Mercator and facing south; Lambert conformal conic with one parallel, two, Belgium's, and facing west;
    // Albers; Cassini-Soldner; polar stereographic A and B; oblique stereographic; oblique Mercator A and B; Lambert
    // azimuthal; Mercator A, B and the web's; polyconic; Krovak and facing north; New Zealand's grid.
    static constexpr int usual[] = {9807, 9808, 9801, 9802, 9803, 9826, 9822, 9806, 9810, 9829, 9809,
                                    9812, 9815, 9820, 9804, 9805, 1024, 9818, 9819, 1041, 9811};
    const ProjObject way(proj_crs_get_coordoperation(context, crs));
    const char *authority = nullptr, *code = nullptr;
    return way && proj_coordoperation_get_method_info(context, way.get(), nullptr, &authority, &code) &&
           is_epsg(authority) && std::find(std::begin(usual), std::end(usual), number(code)) != std::end(usual);
}

std::optional<TiffCrs> find_crs(PJ_CONTEXT* context, const std::string& wkt) {
    const ProjObject crs(proj_create(context, wkt.c_str()));
    if (!crs || !is_epsg(proj_get_id_auth_name(crs.get(), 0))) return std::nullopt;
    TiffCrs found;
    found.epsg = number(proj_get_id_code(crs.get(), 0));
    // Above stands what GeoTIFF leaves to users.
    if (found.epsg < 1024 || found.epsg > 32766) return std::nullopt;
    const PJ_TYPE type = proj_get_type(crs.get());
    // One derived from another comes with the way from there.
    found.geographic =
        type == PJ_TYPE_GEOGRAPHIC_2D_CRS && !ProjObject(proj_crs_get_coordoperation(context, crs.get()));
    if (!found.geographic && type != PJ_TYPE_PROJECTED_CRS) return std::nullopt;
    const ProjObject geodetic(proj_crs_get_geodetic_crs(context, crs.get()));
    if (!geodetic || proj_get_type(geodetic.get()) != PJ_TYPE_GEOGRAPHIC_2D_CRS) return std::nullopt;
    const ProjObject ellipsoid(proj_get_ellipsoid(context, geodetic.get()));
    if (!ellipsoid || !proj_ellipsoid_get_parameters(context, ellipsoid.get(), &found.semi_major_m, nullptr, nullptr,
                                                     &found.inverse_flattening))
        return std::nullopt;
    found.geographic_name = proj_get_name(geodetic.get());
    if (unit_of(context, geodetic.get()) != degree) return std::nullopt;
    if (found.geographic) return found;
    found.name = proj_get_name(crs.get());
    found.linear_unit = unit_of(context, crs.get());
    if (found.linear_unit == 0 || found.linear_unit == degree || !is_usual_method(context, crs.get()))
        return std::nullopt;
    return found;
}

}  // namespace

std::optional<TiffCrs> tiff_crs(const std::string& wkt) {
    std::optional<TiffCrs> found;
    with_proj([&](PJ_CONTEXT* context) { found = find_crs(context, wkt); });
    return found;
}

namespace {

constexpr std::uint32_t gdal_metadata = 42112, gdal_no_data = 42113;

/// What GDAL and libgeotiff tell libtiff once for the whole process is told here for each file.
const TIFFFieldInfo own_fields[] = {
    {TIFFTAG_GEOPIXELSCALE, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, const_cast<char*>("GeoPixelScale")},
    {TIFFTAG_GEOTIEPOINTS, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, const_cast<char*>("GeoTiePoints")},
    {TIFFTAG_GEOTRANSMATRIX, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, const_cast<char*>("GeoTransformationMatrix")},
    {TIFFTAG_GEOKEYDIRECTORY, -1, -1, TIFF_SHORT, FIELD_CUSTOM, 1, 1, const_cast<char*>("GeoKeyDirectory")},
    {TIFFTAG_GEODOUBLEPARAMS, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, const_cast<char*>("GeoDoubleParams")},
    {TIFFTAG_GEOASCIIPARAMS, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, const_cast<char*>("GeoASCIIParams")},
    {gdal_metadata, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, const_cast<char*>("GDALMetadata")},
    {gdal_no_data, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, const_cast<char*>("GDALNoDataValue")},
};

/// What went wrong first, as libtiff says it while the system's own reason can still be asked.
struct Trouble {
    int system = 0;
    char words[200] = {};
};

int note(TIFF*, void* trouble, const char*, const char* format, std::va_list more) {
    auto& first = *static_cast<Trouble*>(trouble);
    if (first.words[0] == 0) {
        first.system = errno;
        std::vsnprintf(first.words, sizeof first.words, format, more);
    }
    return 1;  // and nobody else hears it
}

int say_nothing(TIFF*, void*, const char*, const char*, std::va_list) { return 1; }

void keep_silent(GTIF*, int, const char*, ...) {}

struct CleanUp {
    void operator()(TIFF* tiff) const noexcept { TIFFCleanup(tiff); }  // the file itself is not closed
};
struct FreeOptions {
    void operator()(TIFFOpenOptions* options) const noexcept { TIFFOpenOptionsFree(options); }
};
struct FreeKeys {
    void operator()(GTIF* keys) const noexcept { GTIFFree(keys); }
};

/// GDAL's own list: sorted by names in upper case, its values made XML twice. Empty if there is nothing to tell.
std::string metadata_xml(const TiffContent& content) {
    auto items = content.metadata;
    const auto upper = [](unsigned char c) { return std::toupper(c); };
    std::stable_sort(items.begin(), items.end(), [&](const auto& a, const auto& b) {
        return std::lexicographical_compare(
            a.first.begin(), a.first.end(), b.first.begin(), b.first.end(), [&](char x, char y) {
                return upper(static_cast<unsigned char>(x)) < upper(static_cast<unsigned char>(y));
            });
    });
    std::string lines;
    const auto add = [&](const std::string& name, const char* more, const std::string& value) {
        lines += "  <Item name=\"" + xml_words(name, true) + "\"" + more + ">" +
                 xml_words(xml_words(value, true), false) + "</Item>\n";
    };
    for (const auto& [name, value] : items) add(name, "", value);
    if (!content.description.empty()) add("DESCRIPTION", R"( sample="0" role="description")", content.description);
    return lines.empty() ? "" : "<GDALMetadata>\n" + lines + "</GDALMetadata>\n";
}

bool set_keys(TIFF* tiff, const TiffCrs& crs) {
    const std::unique_ptr<GTIF, FreeKeys> owner(GTIFNewEx(tiff, keep_silent, nullptr));
    GTIF* const keys = owner.get();
    if (!keys) return false;
    const auto code = [&](geokey_t key, int value) { return GTIFKeySet(keys, key, TYPE_SHORT, 1, value) != 0; };
    const auto size = [&](geokey_t key, double value) { return GTIFKeySet(keys, key, TYPE_DOUBLE, 1, value) != 0; };
    const auto words = [&](geokey_t key, const std::string& value) {
        return GTIFKeySet(keys, key, TYPE_ASCII, 0, value.c_str()) != 0;
    };
    bool good = code(GTRasterTypeGeoKey, RasterPixelIsArea) &&
                code(GTModelTypeGeoKey, crs.geographic ? ModelTypeGeographic : ModelTypeProjected) &&
                code(GeogAngularUnitsGeoKey, Angular_Degree);
    if (crs.geographic)
        good = good && code(GeographicTypeGeoKey, crs.epsg) &&
               (crs.inverse_flattening == 0 || size(GeogInvFlatteningGeoKey, crs.inverse_flattening)) &&
               size(GeogSemiMajorAxisGeoKey, crs.semi_major_m);
    else
        good = good && code(ProjectedCSTypeGeoKey, crs.epsg) && code(ProjLinearUnitsGeoKey, crs.linear_unit) &&
               words(GTCitationGeoKey, crs.name);
    return good && words(GeogCitationGeoKey, crs.geographic_name) && GTIFWriteKeys(keys) != 0;
}

}  // namespace

struct TiffFile::Open {
    std::string final_path;
    Trouble trouble;  // outlives `tiff`, which may have something to say at its end
    Descriptor file;
    std::unique_ptr<TIFF, CleanUp> tiff;
    std::uint32_t tiles_across = 0;
    std::vector<bool> written;  ///< tiles, row after row

    [[noreturn]] void fail(int system, const char* words = "") const {
        throw IoError(text("output '", final_path, "' cannot be written: ",
                           system != 0 ? std::error_code(system, std::generic_category()).message() : words));
    }
    [[noreturn]] void fail() const {
        fail(trouble.system, trouble.words[0] ? trouble.words : "libtiff gives no reason");
    }
    /// What libtiff or libgeotiff answers.
    void require(bool good) const {
        if (!good) fail();
    }
    template <class... Values>
    void set(std::uint32_t tag, Values... values) {
        require(TIFFSetField(tiff.get(), tag, values...) == 1);
    }
    void set(std::uint32_t tag, const std::vector<double>& values) {
        set(tag, static_cast<int>(values.size()), values.data());
    }
};

TiffFile::TiffFile(const std::string& path, TiffContent content, std::string final_path) : open_(new Open) {
    Open& o = *open_;
    o.final_path = std::move(final_path);
    o.file = Descriptor(::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
    if (!o.file) o.fail(errno);
    const std::unique_ptr<TIFFOpenOptions, FreeOptions> options(TIFFOpenOptionsAlloc());
    if (!options) o.fail(ENOMEM);
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), note, &o.trouble);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), say_nothing, nullptr);
    const std::int64_t across = (content.columns - 1) / edge + 1, down = (content.rows - 1) / edge + 1;
    // As GDAL's BIGTIFF=IF_SAFER: by the bytes of all tiles before they are packed.
    const bool big = static_cast<double>(across * edge) * static_cast<double>(down * edge) > 2e9;
    errno = 0;
    o.tiff.reset(TIFFFdOpenExt(o.file.get(), path.c_str(), big ? "w8" : "w4", options.get()));
    o.require(o.tiff != nullptr);
    o.require(TIFFMergeFieldInfo(o.tiff.get(), own_fields, std::size(own_fields)) == 0);
    o.tiles_across = static_cast<std::uint32_t>(across);
    o.written.resize(static_cast<std::size_t>(across * down));

    o.set(TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(content.columns));
    o.set(TIFFTAG_IMAGELENGTH, static_cast<std::uint32_t>(content.rows));
    o.set(TIFFTAG_BITSPERSAMPLE, 8);
    o.set(TIFFTAG_COMPRESSION, COMPRESSION_PACKBITS);
    o.set(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    o.set(TIFFTAG_SAMPLESPERPIXEL, 1);
    o.set(TIFFTAG_PLANARCONFIG, PLANARCONFIG_SEPARATE);
    o.set(TIFFTAG_TILEWIDTH, static_cast<std::uint32_t>(edge));
    o.set(TIFFTAG_TILELENGTH, static_cast<std::uint32_t>(edge));
    o.set(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT);
    if (content.geotransform) {
        const auto& [x, x_column, x_row, y, y_column, y_row] = *content.geotransform;
        if (x_row == 0 && y_column == 0 && y_row < 0) {
            o.set(TIFFTAG_GEOPIXELSCALE, {x_column, -y_row, 0});
            o.set(TIFFTAG_GEOTIEPOINTS, {0, 0, 0, x, y, 0});
        } else {
            // A scale cannot say that y grows downward.
            o.set(TIFFTAG_GEOTRANSMATRIX, {x_column, x_row, 0, x, y_column, y_row, 0, y, 0, 0, 0, 0, 0, 0, 0, 1});
        }
    }
    if (content.crs && !set_keys(o.tiff.get(), *content.crs)) o.fail(o.trouble.system, "libgeotiff refuses the CRS");
    const std::string xml = metadata_xml(content);
    if (!xml.empty()) o.set(gdal_metadata, xml.c_str());
}

TiffFile::~TiffFile() = default;

void TiffFile::write_tile(std::int64_t column, std::int64_t row, const std::uint8_t* cells) {
    Open& o = *open_;
    const std::uint32_t tile = static_cast<std::uint32_t>(row) * o.tiles_across + static_cast<std::uint32_t>(column);
    errno = 0;
    // Only packings other than this one would change the cells.
    o.require(TIFFWriteEncodedTile(o.tiff.get(), tile, const_cast<std::uint8_t*>(cells), edge * edge) >= 0);
    o.written[tile] = true;
}

void TiffFile::close(std::optional<std::uint8_t> no_data) {
    Open& o = *open_;
    // 128 times 0, again and again: no run is longer, and none goes on in the next row.
    static_assert(edge % 128 == 0);
    std::array<std::uint8_t, edge * edge / 128 * 2> blank{};
    for (std::size_t i = 0; i < blank.size(); i += 2) blank[i] = static_cast<std::uint8_t>(1 - 128);
    errno = 0;
    for (std::size_t tile = 0; tile < o.written.size(); ++tile)
        if (!o.written[tile])
            o.require(TIFFWriteRawTile(o.tiff.get(), static_cast<std::uint32_t>(tile), blank.data(), blank.size()) >=
                      0);
    if (no_data) o.set(gdal_no_data, std::to_string(*no_data).c_str());
    o.require(TIFFWriteDirectory(o.tiff.get()) == 1);
    o.tiff.reset();
    if (o.trouble.words[0]) o.fail();
    if (::close(o.file.release()) != 0) o.fail(errno);
}

}  // namespace wedgescope
