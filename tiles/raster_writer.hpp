// Raster writer: arrays in memory -> one raster file of any GDAL driver, with a geolocation array beside it if asked.
// For the .cpp files of this folder only. Leaves what the arrays mean to polar_raster.cpp and picture.cpp.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lib/engine.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/ground_places.hpp"
#include "tiles/output_file.hpp"
#include "tiles/polar_raster.hpp"

namespace wedgescope {

struct BandContent {
    const void* cells = nullptr;  ///< rows x columns, row after row
    std::string description, unit;
    std::optional<double> no_data;
    std::vector<std::string> categories;
    bool alpha = false;  ///< 0 transparent, 255 opaque
};

/// Node (i, j) of the array stands at the corner of cells at column `i * column_step`, row `j * row_step` of the
/// raster: GDAL's default convention. Corners, not centres: so the array of a full circle closes.
struct GeolocationGrid {
    std::int64_t columns = 0, rows = 0;
    std::int64_t column_step = 1, row_step = 1;
    /// Writes the places of the `columns` nodes at a row of the raster; asked for several rows at once.
    std::function<void(double row, Place* places)> find_row;
    bool packed = true;   ///< else as it is: packing takes longer than finding the places
    bool closed = false;  ///< the last row of nodes stands where the first one does
    int threads = 1;      ///< that find the places, each on its own
    std::string crs;      ///< anything GDAL understands; empty: a plane that is nowhere on earth
};
/// The grid for a raster of so many cells, with steps of at most these.
GeolocationGrid geolocation_grid(std::int64_t columns, std::int64_t rows, std::int64_t column_step,
                                 std::int64_t row_step);

struct RasterContent {
    std::int64_t columns = 0, rows = 0;
    GDALDataType type = GDT_Float32;
    /// Codes and counts that stay the same over many posts. Bytes, as a mask's, are packed by runs, which every reader of TIFF
    /// knows and which takes a tenth of DEFLATE's time; others by DEFLATE at its fastest.
    bool patches = false;
    /// Floats without the prediction of neighbours, which takes as long to undo as all other unpacking: for what is read again and
    /// again and mostly empty, so that it hardly takes more room.
    bool quick_to_read = false;
    std::vector<std::uint8_t> codes;  ///< all values of a band of codes, which nothing may change; else empty
    /// Is it a value of the bands that says something, and so may not be declared as no data, as some drivers do by themselves?
    std::function<bool(double value)> means_something;  ///< none: floats, which drivers leave alone
    double means_nothing = 0;                           ///< one that does not; with means_something
    std::vector<BandContent> bands;
    Metadata metadata;
    std::optional<std::array<double, 6>> geotransform;
    std::string crs;  ///< anything GDAL understands; empty: none
    std::optional<GeolocationGrid> geolocation;
    int threads = 1;  ///< that may pack it
};

/// Does a GeoTIFF with that ENDIANNESS hold bytes in another order than this machine's? GDAL 3.6 writes floats with PREDICTOR=3 so and
/// reads something else.
bool swaps_bytes(const std::string& endianness);
/// InputError for that predictor, where the user gave it.
[[noreturn]] void refuse_predictor(const std::string& endianness);

/// Of such a file ("PNG", "GTiff") is nothing asked that GDAL's own driver would have to do?
bool needs_no_driver(const char* driver, const std::string& final_path, const RasterFormat& format);

/// To file.temporary_path() and its side files; the caller commits. InputError for a driver, extension or creation
/// option that will not do; IoError naming the final file if anything was not written.
void write_raster(const RasterContent& content, const OutputFile& file, const RasterFormat& format);

/// What of its place such a raster would not keep, in words that go on from its name; empty: nothing, or nobody can say. InputError
/// where it would lie elsewhere.
std::string place_losses(const RasterContent& content, const OutputFile& file, const RasterFormat& format);

/// The same, but empty, to be written piece by piece; closed by close_raster. `cells` of the bands are not used; neither is
/// a geolocation grid. InputError too for a driver that writes whole rasters only.
DatasetHandle create_raster(const RasterContent& content, const OutputFile& file, const RasterFormat& format);
/// The IoError of outputs that GDAL writes; `written_path`: the temporary one, which the user does not know.
[[noreturn]] void fail_to_write(const std::string& final_path, const std::string& written_path,
                                const GdalErrors& errors);
/// IoError naming the final file if anything was not written.
void close_raster(DatasetHandle dataset, const std::string& final_path);

/// That a band holds the codes of states.
void set_states(RasterContent& content);

/// Version and scene: what every output tells.
Metadata run_metadata(const RasterFormat& format);
/// And of one sensor where it stands.
Metadata scene_metadata(const ResolvedScene& scene, const RasterFormat& format);

}  // namespace wedgescope
