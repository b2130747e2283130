// Coverage raster: a layer of coverage as a raster file with the grid of its terrain, written tile by tile.
// Leaves what the values are to lib/coverage.hpp.
//
// Memory: GDAL's block cache, no more: tiles are the file's own blocks (256 x 256 in a GeoTIFF) and come once each.
#pragma once
#include <memory>
#include <optional>
#include <string>

#include "lib/coverage.hpp"
#include "tiles/output_file.hpp"
#include "tiles/polar_raster.hpp"

namespace wedgescope {

class CoverageFile {
public:
    struct Layer {
        CoverageLayer kind = CoverageLayer::mask;
        /// Mask: declared as no-data in any case; else the values of no data and out of range if they occur.
        std::optional<std::uint8_t> no_data;
        bool undeclared = false;  ///< mask: nothing is declared unless `no_data` is
        MaskValues mask;
    };

    /// InputError for a driver, extension or creation option that will not do; IoError if it cannot be made.
    CoverageFile(const ResolvedScene& scene, const DataBase& data_base, const Layer& layer, const OutputFile& file,
                 const RasterFormat& format);
    ~CoverageFile();
    CoverageFile(const CoverageFile&) = delete;
    CoverageFile& operator=(const CoverageFile&) = delete;

    /// Are the file's blocks the tiles of coverage? Others are written in parts, which takes far longer.
    bool by_tiles() const;
    /// IoError naming the file.
    void write(const CoverageTile& tile);
    /// Writes what is left; `void_posts`: posts without data or out of range. The caller commits the file. IoError.
    void close(std::uint64_t void_posts);

private:
    struct Open;
    std::unique_ptr<Open> open_;
};

}  // namespace wedgescope
