// RasterLayer: values of one raster layer, wherever they are kept, as heights in metres or as codes.
// For the .cpp files of this folder only. Leaves where the values come from to raster_file.hpp, tiff_layer.hpp and store_layer.hpp.
#pragma once
#include <gdal.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lib/interval.hpp"
#include "tiles/crs.hpp"

namespace wedgescope {

/// |z| above this is no height on earth.
inline constexpr float highest_height_m = 1e5F;
/// Marks a culture cell without data.
inline constexpr std::int32_t void_code = INT32_MIN;

/// What GDALGetDataTypeName and its kind say, without GDAL where posts are of a usual type.
std::string type_name(GDALDataType type);
GDALDataType type_by_name(const std::string& name);
int type_bytes(GDALDataType type);

/// Turns n values of one type into as many of another, as GDALCopyWords would; both aligned. They may lie in one place, those at its end.
using Widening = void (*)(const std::byte* from, std::byte* to, std::size_t n);
/// For what is read most, in lanes; null: GDAL does it, one value at a time, which takes as long as reading them.
Widening widening(GDALDataType from, GDALDataType to);
/// Turns `count` values into as many elsewhere: by a Widening, or GDAL, which is loaded for it, does it.
void convert(const std::byte* from, GDALDataType from_type, std::byte* to, GDALDataType to_type, std::int64_t count);

struct RasterFacts {
    std::string role;  ///< for messages: "dem", "culture", "culture-height"
    std::string path;
    std::string driver;
    int bands = 1;  ///< all but the first are left aside
    std::int64_t columns = 0, rows = 0, block_columns = 0, block_rows = 0;
    GDALDataType type = GDT_Unknown;
    int type_bytes = 0;
    bool signed_byte = false;           ///< Byte whose values are -128..127 (PIXELTYPE=SIGNEDBYTE)
    bool has_geotransform = false;      ///< else the lower left cell's centre is 0, 0 and cells are 1 x 1
    double corner_x = 0, corner_y = 0;  ///< outer corner of the first cell, CRS units
    double step_x = 1, step_y = -1;
    std::shared_ptr<const Crs> crs;  ///< null: none
    bool geographic = false;
    bool wgs84_lat_lon = false;
    double metres_per_unit = 1;    ///< of x and y, if not geographic
    double scale = 1, offset = 0;  ///< value = (stored * scale + offset) * unit_m
    std::string unit;
    double unit_m = 1;
    bool has_no_data = false;
    double no_data = 0;
    bool has_mask = false;  ///< a mask or alpha band that must be read beside the values
    bool fractions = false;   ///< of a VRT whose type is of whole numbers: what is read of it as floats may not be
    std::string compression;  ///< empty or "NONE": none

    /// Strips as they are: of a row any part is read alone, so nothing speaks for whole ones.
    bool rows_in_parts = false;

    /// What is best read together: blocks, or squares of what need not be read by blocks.
    std::int64_t unit_columns() const { return rows_in_parts ? std::min(columns, part_posts) : block_columns; }
    std::int64_t unit_rows() const { return rows_in_parts ? std::min(rows, part_posts) : block_rows; }
    static constexpr std::int64_t part_posts = 256;

    /// Of a VRT: the largest block of the rasters that it is made of, and whether one of these is packed.
    std::int64_t behind_columns = 0, behind_rows = 0;
    bool behind_packed = false;
    /// What is decoded together.
    std::int64_t decoded_columns() const { return std::max(unit_columns(), behind_columns); }
    std::int64_t decoded_rows() const { return std::max(unit_rows(), behind_rows); }

    bool packed() const { return !compression.empty() && !EQUAL(compression.c_str(), "NONE"); }
    /// Lines of words, one a row, which are found one after the other.
    bool is_text() const { return driver == "AAIGrid" || driver == "GRASSASCIIGrid" || driver == "ISG"; }
    /// An image packed as a whole: a row is decoded behind all above it.
    bool packed_as_a_whole() const {
        return driver == "PNG" || driver == "GIF" || driver == "BIGGIF" || driver == "JPEG";
    }
    double edge_x() const { return corner_x + static_cast<double>(columns) * step_x; }
    double edge_y() const { return corner_y + static_cast<double>(rows) * step_y; }
    std::string named() const { return role + " '" + path + "'"; }
    /// Columns of the circle of longitude; 0 where the raster does not span it. With one column more, the last
    /// repeats the first.
    std::int64_t cycle_columns() const;
    /// Columns without that one.
    std::int64_t own_columns() const;
};

/// A no-data value as large as this stands for all values beyond it: programs round it differently.
inline constexpr double huge_no_data = 1e30;
/// Of a raster with such a one: a value v is void where v times this is more than that. Else 0.
double huge_no_data_sign(const RasterFacts& facts);

/// Of a layer of culture heights in units of `scale` metres: the largest value that is none too high.
inline float highest_culture(double scale) {
    return scale > 1 ? static_cast<float>(static_cast<double>(highest_height_m) / scale) : highest_height_m;
}
/// DataError that names the cell and what it holds: below 0, or above highest_culture().
[[noreturn]] void refuse_culture(const RasterFacts& facts, std::int64_t column, std::int64_t row, float value,
                                 double scale);

/// DataError for fewer posts than a terrain must have.
void check_terrain_size(const RasterFacts& facts);

inline constexpr const char* warped_hint =
    "gdalwarp makes such a raster of it (with -dstnodata, where it has no no-data value)";
/// Takes corner and steps from a geotransform in GDAL's order. DataError for one that is none of ours.
void set_grid(RasterFacts& facts, const std::array<double, 6>& geotransform);
/// Takes CRS, kind of CRS and its units from `given`. DataError for a CRS that is none of ours.
void set_crs(RasterFacts& facts, std::shared_ptr<const Crs> given);
/// Metres of a height unit, 1 of none; nothing for what is no unit of length that we know.
std::optional<double> unit_in_metres(std::string unit);

/// What a thread holds that reads from a layer, beside GDAL's cache: a file is decoded block by block.
struct ReaderBytes {
    std::size_t decoded = 0;  ///< the block in use, which stays even where the cache is smaller
    std::size_t packed = 0;   ///< what its handles keep of blocks as the file holds them
};

class RasterLayer {
public:
    virtual ~RasterLayer() = default;
    const RasterFacts& facts() const { return facts_; }
    virtual ReaderBytes reader_bytes() const { return {}; }
    /// Held between reads, at the most: files that wait open.
    virtual std::size_t idle_bytes() const { return 0; }

    /// Rows that are decoded for one that is asked for.
    virtual std::int64_t rows_decoded_together() const { return facts_.block_rows; }
    /// Posts that windows decode for each that they ask for, if none stays decoded.
    double decoded_a_post() const { return decoded_a_post(facts_.unit_columns(), rows_decoded_together()); }
    /// The same, if the file were cut into such blocks.
    double decoded_a_post(std::int64_t block_columns, std::int64_t block_rows) const;
    /// Beyond this a pass through all of the file costs less.
    static constexpr double most_decoded_a_post = 4;
    /// In whole blocks.
    double all_bytes() const;
    /// Are its tiles kept in a TileCache of its source's? Else in GDAL's cache.
    virtual bool fills_tile_cache() const { return false; }
    virtual bool fills_gdal_cache() const { return !fills_tile_cache(); }

    /// Heights in metres, row after row, NaN = void; `window` inside the raster. Rows lie `stride` floats apart.
    /// IoError if it cannot be read; DataError naming the post if one is infinite or above highest_height_m.
    /// May be called from several threads at once.
    virtual void read_heights(const Window& window, float* out, std::int64_t stride);
    /// The same of the posts that a level of detail keeps; `window` in these. As read_heights() otherwise.
    virtual void read_level(int level, const Window& window, float* out, std::int64_t stride);
    /// Decoded bytes that read_level() holds for itself.
    virtual std::size_t level_bytes() const { return level_slab_posts * sizeof(float); }
    /// Codes, row after row; void_code where there is none. DataError for a value that is no whole number.
    virtual void read_codes(const Window& window, std::int32_t* out);
    /// Values as stored, or converted as GDAL does; rows `line_bytes` apart. IoError.
    virtual void read_values(const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) = 0;
    /// A number that changes when the cells of these windows (inside the raster; none: all) may have changed, and is the
    /// same in another process otherwise. May be called from several threads at once.
    virtual std::uint64_t fingerprint(const std::vector<Window>& cells) = 0;
    using Fingerprint = std::function<std::uint64_t(const std::vector<Window>& cells)>;
    /// fingerprint() of what the raster is now, to be asked also when this layer is gone. Here: one for all cells.
    virtual Fingerprint fingerprint_now() {
        return [all = fingerprint({})](const std::vector<Window>&) { return all; };
    }

protected:
    static constexpr std::int64_t level_slab_posts = std::int64_t{1} << 18;
    /// Stored values, read as floats into `out`, become heights; `window` counts the posts of a level of detail.
    void make_heights(const Window& window, float* out, std::int64_t stride, int level = 0);
    /// The mask of a window: 0 void. False if nothing there is.
    virtual bool read_mask(const Window&, std::vector<std::uint8_t>&) { return false; }
    /// To be called once facts_ is complete.
    void prepare();

    RasterFacts facts_;

private:
    bool may_be_void_ = false;      ///< some test for void is needed
    bool may_be_wild_ = false;      ///< the type can hold heights that are none
    float no_data_ = 0;             ///< as GDAL converts it
    double huge_sign_ = 0;          ///< huge_no_data_sign()
};

/// The no-data value (else 0) `count` times, as stored.
void fill_no_data(const RasterFacts& facts, std::byte* out, std::size_t count);
/// The no-data value of a raster of 64-bit integers: of those that a double does not hold the ends of T are told right.
template <class T>
T whole_no_data(const RasterFacts& facts) {
    using Limits = std::numeric_limits<T>;
    if (facts.no_data >= static_cast<double>(Limits::max())) return Limits::max();
    if (facts.no_data <= static_cast<double>(Limits::min())) return Limits::min();
    return static_cast<T>(facts.no_data);
}

/// Calls `body` for windows of at most `most_posts`, made of whole blocks where they fit, row by row of blocks.
void for_each_window(const RasterFacts& facts, std::int64_t columns, std::int64_t most_posts,
                     const std::function<void(const Window&)>& body);

/// "columns 3 to 5, rows 0 to 9".
std::string place(const Window& window);

}  // namespace wedgescope
