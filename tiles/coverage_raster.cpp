#include "tiles/coverage_raster.hpp"

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

}  // namespace

struct CoverageFile::Open {
    Layer layer;
    std::string final_path;
    DatasetHandle dataset;
    GDALDataType type() const { return layer.counts ? GDT_UInt16 : is_bytes(layer.kind) ? GDT_Byte : GDT_Float32; }
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
    GdalErrors errors;
    const int columns = static_cast<int>(window.columns.size()), rows = static_cast<int>(window.rows.size());
    GDALRasterBand& band = *open_->dataset->GetRasterBand(1);
    if (by_tiles() && stride == CoverageTile::edge) {
        // A tile is a block: past GDAL's cache, so that blocks stand in the file in the order they come.
        if (band.WriteBlock(static_cast<int>(window.columns.begin / CoverageTile::edge),
                            static_cast<int>(window.rows.begin / CoverageTile::edge),
                            const_cast<void*>(cells)) != CE_None)
            throw IoError(text("output '", open_->final_path, "' cannot be written: ", errors.reason()));
        return;
    }
    const GDALDataType type = open_->type();
    const GSpacing step = GDALGetDataTypeSizeBytes(type);
    if (band.RasterIO(GF_Write, static_cast<int>(window.columns.begin), static_cast<int>(window.rows.begin), columns,
                      rows, const_cast<void*>(cells), columns, rows, type, step, step * static_cast<GSpacing>(stride),
                      nullptr) != CE_None)
        throw IoError(text("output '", open_->final_path, "' cannot be written: ", errors.reason()));
}

void CoverageFile::close(std::uint64_t void_posts) {
    GdalErrors errors;
    GDALRasterBand& band = *open_->dataset->GetRasterBand(1);
    const Layer& layer = open_->layer;
    {
        GdalErrors quiet;
        if (layer.counts) {
            if (void_posts > 0) band.SetNoDataValue(no_count);
        } else if (layer.kind == CoverageLayer::mask) {
            if (layer.no_data)
                band.SetNoDataValue(*layer.no_data);
            else if (void_posts > 0 && !layer.undeclared)
                band.SetNoDataValue(layer.mask.no_data);
        } else if (!is_bytes(layer.kind) && (void_posts > 0 || layer.kind == CoverageLayer::response)) {
            band.SetNoDataValue(std::numeric_limits<double>::quiet_NaN());
        }
    }
    close_raster(std::move(open_->dataset), open_->final_path);
}

}  // namespace wedgescope
