// Coverage raster: a layer of coverage as a raster file with the grid of its terrain, written tile by tile.
// Leaves what the values are to lib/coverage.hpp.
//
// A mask as a GeoTIFF, in a CRS of the EPSG's or in none, is written without GDAL, which is then never called; all else by GDAL.
//
// Memory: GDAL's block cache and a bit a tile, no more: tiles are the file's own blocks (256 x 256 in a GeoTIFF) and
// come once each. Of a GeoTIFF those of nothing but 0 (hidden ground) are left to its close, which packs one for them all.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lib/coverage.hpp"
#include "tiles/output_file.hpp"
#include "tiles/raster_format.hpp"

namespace wedgescope {

class CoverageFile {
public:
    struct Layer {
        CoverageLayer kind = CoverageLayer::mask;
        /// Mask: declared as no-data in any case; else the values of no data and out of range if they occur.
        std::optional<std::uint8_t> no_data;
        bool undeclared = false;  ///< mask: nothing is declared unless `no_data` is
        MaskValues mask;
        bool counts = false;  ///< instead of `kind`: how many observers see a post, UInt16
    };
    static constexpr std::uint16_t no_count = 65535;  ///< of counts: no data; declared if it occurs

    /// InputError for a driver, extension or creation option that will not do; IoError if it cannot be made.
    CoverageFile(const ResolvedScene& scene, const DataBase& data_base, const Layer& layer, const OutputFile& file,
                 const RasterFormat& format);
    /// Of many observers: their counts or a mask.
    CoverageFile(std::size_t observers, const DataBase& data_base, const Layer& layer, const OutputFile& file,
                 const RasterFormat& format);
    ~CoverageFile();
    CoverageFile(const CoverageFile&) = delete;
    CoverageFile& operator=(const CoverageFile&) = delete;

    /// Are the file's blocks the tiles of coverage? Others are written in parts, which takes far longer.
    bool by_tiles() const;
    /// What the driver does not keep, for a remark; empty: nothing.
    const std::string& losses() const { return losses_; }
    /// IoError naming the file.
    void write(const CoverageTile& tile);
    void write(const Window& window, const std::uint16_t* counts);  ///< rows CoverageTile::edge apart
    /// Writes what is left; `void_posts`: posts without data or out of range. The caller commits the file. IoError.
    void close(std::uint64_t void_posts);

private:
    class Open;
    class ByGdal;
    class ByTiff;
    using Items = std::vector<std::pair<std::string, std::string>>;
    void create(const DataBase& data_base, const OutputFile& file, const RasterFormat& format, const Items& metadata);
    std::optional<double> declared(std::uint64_t void_posts) const;

    Layer layer_;
    std::string losses_;
    std::unique_ptr<Open> open_;
};

}  // namespace wedgescope
