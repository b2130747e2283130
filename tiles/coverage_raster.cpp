#include "tiles/coverage_raster.hpp"

#include <cstddef>
#include <limits>

#include "lib/error.hpp"
#include "tiles/raster_writer.hpp"

namespace wedgescope {
namespace {

struct Words {
    const char *description, *unit;
};

Words words(CoverageLayer layer) {
    switch (layer) {
        case CoverageLayer::mask:
            return {"visibility", ""};
        case CoverageLayer::states:
            return {"state", ""};
        case CoverageLayer::height:
            return {"height to be raised to be seen", "m"};
        case CoverageLayer::range:
            return {"slant range", "m"};
        case CoverageLayer::grazing:
            return {"grazing angle", "deg"};
        case CoverageLayer::depression:
            return {"depression angle", "deg"};
        case CoverageLayer::response:
            return {"response", "dBm"};
    }
    return {"", ""};
}

/// Of a tile's cells, those in the window.
bool all_zero(const Window& window, const void* cells, std::size_t cell_bytes) {
    const std::size_t used = static_cast<std::size_t>(window.columns.size()) * cell_bytes,
                      line_bytes = static_cast<std::size_t>(CoverageTile::edge) * cell_bytes;
    const auto* line = static_cast<const unsigned char*>(cells);
    for (std::int64_t r = 0; r < window.rows.size(); ++r, line += line_bytes) {
        unsigned char any = 0;
        for (std::size_t i = 0; i < used; ++i) any |= line[i];
        if (any != 0) return false;
    }
    return true;
}

}  // namespace

struct CoverageFile::Open {
    Layer layer;
    std::string final_path;
    DatasetHandle dataset;
    std::vector<bool> blank = {};  ///< tiles left to GDAL, row after row; empty: none are
    GDALDataType type() const { return layer.counts ? GDT_UInt16 : is_bytes(layer.kind) ? GDT_Byte : GDT_Float32; }
    std::int64_t tiles_across() const { return (dataset->GetRasterXSize() - 1) / CoverageTile::edge + 1; }
    void write_tile(std::int64_t column, std::int64_t row, const void* cells) {
        GdalErrors errors;
        if (dataset->GetRasterBand(1)->WriteBlock(static_cast<int>(column), static_cast<int>(row),
                                                  const_cast<void*>(cells)) != CE_None)
            throw IoError(text("output '", final_path, "' cannot be written: ", errors.reason()));
    }
};

CoverageFile::CoverageFile(const ResolvedScene& scene, const DataBase& db, const Layer& layer, const OutputFile& file,
                           const RasterFormat& format)
    : open_(new Open{layer, file.final_path(), nullptr}) {
    create(db, file, format, scene_metadata(scene, format));
}

CoverageFile::CoverageFile(std::size_t observers, const DataBase& db, const Layer& layer, const OutputFile& file,
                           const RasterFormat& format)
    : open_(new Open{layer, file.final_path(), nullptr}) {
    Items items = run_metadata(format);
    items.emplace_back("OBSERVERS", std::to_string(observers));
    create(db, file, format, items);
}

void CoverageFile::create(const DataBase& db, const OutputFile& file, const RasterFormat& format,
                          const Items& metadata) {
    const Layer& layer = open_->layer;
    RasterContent content;
    content.columns = db.columns;
    content.rows = db.rows;
    content.type = open_->type();
    content.patches = layer.counts || is_bytes(layer.kind);
    content.bands.resize(1);
    content.bands[0].description = layer.counts ? "observers that see the post" : words(layer.kind).description;
    content.bands[0].unit = layer.counts ? "" : words(layer.kind).unit;
    if (layer.kind == CoverageLayer::states)
        content.bands[0].categories.assign(std::begin(state_names), std::end(state_names));
    content.metadata = metadata;
    content.crs = db.crs_wkt;
    if (db.has_geotransform)
        content.geotransform = {db.origin_x - 0.5 * db.step_x, db.step_x, 0,
                                db.origin_y - 0.5 * db.step_y, 0,         db.step_y};
    open_->dataset = create_raster(content, file, format);
    // What a GeoTIFF's close finds unwritten it fills with 0, or with the no-data value, and packs once.
    if (by_tiles() && EQUAL(open_->dataset->GetDriverName(), "GTiff") && declared(0).value_or(0) == 0)
        open_->blank.resize(static_cast<std::size_t>(open_->tiles_across() * ((db.rows - 1) / CoverageTile::edge + 1)));
}

CoverageFile::~CoverageFile() = default;

bool CoverageFile::by_tiles() const {
    int columns = 0, rows = 0;
    open_->dataset->GetRasterBand(1)->GetBlockSize(&columns, &rows);
    return columns == CoverageTile::edge && rows == CoverageTile::edge;
}

void CoverageFile::write(const CoverageTile& tile) {
    const bool bytes = is_bytes(open_->layer.kind);
    write_cells(tile.window, bytes ? static_cast<const void*>(tile.bytes) : static_cast<const void*>(tile.values),
                tile.stride);
}

void CoverageFile::write(const Window& window, const std::uint16_t* counts) {
    write_cells(window, counts, CoverageTile::edge);
}

void CoverageFile::write_cells(const Window& window, const void* cells, std::int64_t stride) {
    const GDALDataType type = open_->type();
    const GSpacing step = GDALGetDataTypeSizeBytes(type);
    if (by_tiles() && stride == CoverageTile::edge) {
        // A tile is a block: past GDAL's cache, so that blocks stand in the file in the order they come.
        const std::int64_t column = window.columns.begin / CoverageTile::edge,
                           row = window.rows.begin / CoverageTile::edge;
        if (open_->blank.empty() || !all_zero(window, cells, static_cast<std::size_t>(step)))
            return open_->write_tile(column, row, cells);
        open_->blank[static_cast<std::size_t>(row * open_->tiles_across() + column)] = true;
        return;
    }
    GdalErrors errors;
    const int columns = static_cast<int>(window.columns.size()), rows = static_cast<int>(window.rows.size());
    GDALRasterBand& band = *open_->dataset->GetRasterBand(1);
    if (band.RasterIO(GF_Write, static_cast<int>(window.columns.begin), static_cast<int>(window.rows.begin), columns,
                      rows, const_cast<void*>(cells), columns, rows, type, step, step * static_cast<GSpacing>(stride),
                      nullptr) != CE_None)
        throw IoError(text("output '", open_->final_path, "' cannot be written: ", errors.reason()));
}

/// The value that says no data, where the file declares one.
std::optional<double> CoverageFile::declared(std::uint64_t void_posts) const {
    const Layer& layer = open_->layer;
    if (layer.kind == CoverageLayer::mask && !layer.counts && layer.no_data) return *layer.no_data;
    if (layer.kind == CoverageLayer::response && !layer.counts) return std::numeric_limits<double>::quiet_NaN();
    if (void_posts == 0) return std::nullopt;
    if (layer.counts) return no_count;
    if (layer.kind == CoverageLayer::mask) {
        if (layer.undeclared) return std::nullopt;
        return layer.mask.no_data;
    }
    if (is_bytes(layer.kind)) return std::nullopt;
    return std::numeric_limits<double>::quiet_NaN();
}

void CoverageFile::write_blank_tiles() {
    const auto bytes = static_cast<std::size_t>(GDALGetDataTypeSizeBytes(open_->type()));
    const std::vector<std::byte> zeros(static_cast<std::size_t>(CoverageTile::edge * CoverageTile::edge) * bytes);
    const std::int64_t across = open_->blank.empty() ? 1 : open_->tiles_across();
    for (std::size_t i = 0; i < open_->blank.size(); ++i)
        if (open_->blank[i])
            open_->write_tile(static_cast<std::int64_t>(i) % across, static_cast<std::int64_t>(i) / across,
                              zeros.data());
}

void CoverageFile::close(std::uint64_t void_posts) {
    GDALRasterBand& band = *open_->dataset->GetRasterBand(1);
    if (const std::optional<double> no_data = declared(void_posts)) {
        {
            GdalErrors quiet;
            band.SetNoDataValue(*no_data);
        }
        // GDAL's close would fill with it.
        if (*no_data != 0) write_blank_tiles();
    }
    close_raster(std::move(open_->dataset), open_->final_path);
}

}  // namespace wedgescope
