#include "tiles/tiff_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <iterator>

#include "lib/error.hpp"
#include "tiles/claim.hpp"
#include "tiles/pack_bits.hpp"
#include "tiles/side_file.hpp"
#include "tiles/tiff_handle.hpp"

namespace wedgescope {
namespace {

/// Of GeoTIFF's and GDAL's own libtiff knows nothing until it is told, here for each file.
const TIFFFieldInfo own_fields[] = {
    {pixel_scale, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, const_cast<char*>("GeoPixelScale")},
    {tie_points, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, const_cast<char*>("GeoTiePoints")},
    {transformation, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, const_cast<char*>("GeoTransformationMatrix")},
    {key_directory, -1, -1, TIFF_SHORT, FIELD_CUSTOM, 1, 1, const_cast<char*>("GeoKeyDirectory")},
    {key_doubles, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, const_cast<char*>("GeoDoubleParams")},
    {key_words, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, const_cast<char*>("GeoASCIIParams")},
    {gdal_metadata, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, const_cast<char*>("GDALMetadata")},
    {gdal_no_data, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, const_cast<char*>("GDALNoDataValue")},
};

struct CleanUp {
    void operator()(TIFF* tiff) const noexcept { TIFFCleanup(tiff); }  // the file itself is not closed
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

/// GeoTIFF's keys (OGC 19-008r4, 7): each four numbers in the directory, what is no short in a list beside it.
class GeoKeys {
public:
    explicit GeoKeys(const GeoTiffCrs& crs) {
        enum : std::uint16_t { projected = 1, geographic = 2, area = 1 };
        code(1024, crs.geographic ? geographic : projected);  // GTModelType
        code(1025, area);                                     // GTRasterType
        if (!crs.geographic) words(1026, crs.name);           // GTCitation
        if (crs.geographic) code(2048, crs.epsg);             // GeodeticCRS
        words(2049, crs.geographic_name);                     // GeodeticCitation
        code(2054, 9102);                                     // GeogAngularUnits: degrees
        if (crs.geographic) size(2057, crs.semi_major_m);     // EllipsoidSemiMajorAxis
        if (crs.geographic && crs.inverse_flattening != 0) size(2059, crs.inverse_flattening);
        if (crs.geographic) return;
        code(3072, crs.epsg);         // ProjectedCRS
        code(3076, crs.linear_unit);  // ProjLinearUnits
    }

    /// In the order of the keys, behind version 1, revision 1.0, and their number.
    std::vector<std::uint16_t> directory() const {
        std::vector<std::uint16_t> out{1, 1, 0, static_cast<std::uint16_t>(keys_.size() / 4)};
        out.insert(out.end(), keys_.begin(), keys_.end());
        return out;
    }
    const std::vector<double>& sizes() const { return sizes_; }
    const std::string& words() const { return words_; }

private:
    void add(std::uint16_t key, std::uint32_t list, std::size_t count, std::size_t value) {
        for (const std::size_t number : {std::size_t{key}, std::size_t{list}, count, value})
            keys_.push_back(static_cast<std::uint16_t>(number));
    }
    void code(std::uint16_t key, int value) { add(key, 0, 1, static_cast<std::size_t>(value)); }
    void size(std::uint16_t key, double value) {
        add(key, key_doubles, 1, sizes_.size());
        sizes_.push_back(value);
    }
    /// What ends a word in the list must not stand in it.
    void words(std::uint16_t key, std::string value) {
        std::replace(value.begin(), value.end(), '|', ' ');
        add(key, key_words, value.size() + 1, words_.size());
        words_ += value + '|';
    }

    std::vector<std::uint16_t> keys_;
    std::vector<double> sizes_;
    std::string words_;
};

}  // namespace

struct TiffFile::Open {
    std::string final_path;
    TiffTrouble trouble;  // outlives `tiff`, which may have something to say at its end
    Descriptor file;
    std::unique_ptr<TIFF, CleanUp> tiff;
    std::uint32_t tiles_across = 0;
    std::vector<bool> written;  ///< tiles, row after row
    std::vector<std::uint8_t> packed = std::vector<std::uint8_t>(edge * most_packed(edge));

    [[noreturn]] void fail(int system, const char* words = "") const {
        throw IoError(
            text("output '", final_path, "' cannot be written: ", system != 0 ? system_reason(system) : words));
    }
    [[noreturn]] void fail() const {
        fail(trouble.system, trouble.words[0] ? trouble.words : "libtiff gives no reason");
    }
    /// What libtiff answers.
    void require(bool good) const {
        if (!good) fail();
    }
    template <class... Values>
    void set(std::uint32_t tag, Values... values) {
        require(TIFFSetField(tiff.get(), tag, values...) == 1);
    }
    template <class Number>
    void set(std::uint32_t tag, const std::vector<Number>& values) {
        set(tag, static_cast<int>(values.size()), values.data());
    }
};

TiffFile::TiffFile(const std::string& path, TiffContent content, std::string final_path) : open_(new Open) {
    Open& o = *open_;
    o.final_path = std::move(final_path);
    o.file = Descriptor(::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
    if (!o.file) o.fail(errno);
    const TiffOptions options = tiff_options(note_trouble, &o.trouble);
    if (!options) o.fail(ENOMEM);
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
            o.set(pixel_scale, std::vector{x_column, -y_row, 0.0});
            o.set(tie_points, std::vector{0.0, 0.0, 0.0, x, y, 0.0});
        } else {
            // A scale cannot say that y grows downward.
            o.set(transformation, std::vector{x_column, x_row, 0.0, x, y_column, y_row, 0.0, y,  //
                                              0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0});
        }
    }
    if (content.crs) {
        const GeoKeys keys(*content.crs);
        o.set(key_directory, keys.directory());
        if (!keys.sizes().empty()) o.set(key_doubles, keys.sizes());
        o.set(key_words, keys.words().c_str());
    }
    const std::string xml = metadata_xml(content);
    if (!xml.empty()) o.set(gdal_metadata, xml.c_str());
}

TiffFile::~TiffFile() = default;

void TiffFile::write_tile(std::int64_t column, std::int64_t row, const std::uint8_t* cells) {
    Open& o = *open_;
    const std::uint32_t tile = static_cast<std::uint32_t>(row) * o.tiles_across + static_cast<std::uint32_t>(column);
    std::uint8_t* end = o.packed.data();
    for (std::int64_t r = 0; r < edge; ++r) end = pack_bits(cells + r * edge, edge, end);
    errno = 0;
    o.require(TIFFWriteRawTile(o.tiff.get(), tile, o.packed.data(), end - o.packed.data()) >= 0);
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
