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
    }
    return {"", ""};
}

}  // namespace

struct CoverageFile::Open {
    Layer layer;
    std::string final_path;
    DatasetHandle dataset;
};

CoverageFile::CoverageFile(const ResolvedScene& scene, const DataBase& db, const Layer& layer, const OutputFile& file,
                           const RasterFormat& format)
    : open_(new Open{layer, file.final_path(), nullptr}) {
    RasterContent content;
    content.columns = db.columns;
    content.rows = db.rows;
    content.type = is_bytes(layer.kind) ? GDT_Byte : GDT_Float32;
    content.patches = is_bytes(layer.kind);
    content.bands.resize(1);
    content.bands[0].description = words(layer.kind).description;
    content.bands[0].unit = words(layer.kind).unit;
    if (layer.kind == CoverageLayer::states)
        content.bands[0].categories.assign(std::begin(state_names), std::end(state_names));
    content.metadata = scene_metadata(scene, format);
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
    GdalErrors errors;
    const bool bytes = is_bytes(open_->layer.kind);
    const void* cells = bytes ? static_cast<const void*>(tile.bytes) : static_cast<const void*>(tile.values);
    const int columns = static_cast<int>(tile.window.columns.size()), rows = static_cast<int>(tile.window.rows.size());
    const GSpacing step = bytes ? 1 : sizeof(float);
    GDALRasterBand& band = *open_->dataset->GetRasterBand(1);
    if (by_tiles() && tile.stride == CoverageTile::edge) {
        // A tile is a block: past GDAL's cache, so that blocks stand in the file in the order they come.
        if (band.WriteBlock(static_cast<int>(tile.window.columns.begin / CoverageTile::edge),
                            static_cast<int>(tile.window.rows.begin / CoverageTile::edge),
                            const_cast<void*>(cells)) != CE_None)
            throw IoError(text("output '", open_->final_path, "' cannot be written: ", errors.reason()));
        return;
    }
    if (band.RasterIO(GF_Write, static_cast<int>(tile.window.columns.begin), static_cast<int>(tile.window.rows.begin),
                      columns, rows, const_cast<void*>(cells), columns, rows, bytes ? GDT_Byte : GDT_Float32, step,
                      step * static_cast<GSpacing>(tile.stride), nullptr) != CE_None)
        throw IoError(text("output '", open_->final_path, "' cannot be written: ", errors.reason()));
}

void CoverageFile::close(std::uint64_t void_posts) {
    GdalErrors errors;
    GDALRasterBand& band = *open_->dataset->GetRasterBand(1);
    const Layer& layer = open_->layer;
    {
        GdalErrors quiet;
        if (layer.kind == CoverageLayer::mask) {
            if (layer.no_data)
                band.SetNoDataValue(*layer.no_data);
            else if (void_posts > 0 && !layer.undeclared)
                band.SetNoDataValue(layer.mask.no_data);
        } else if (!is_bytes(layer.kind) && void_posts > 0) {
            band.SetNoDataValue(std::numeric_limits<double>::quiet_NaN());
        }
    }
    close_raster(std::move(open_->dataset), open_->final_path);
}

}  // namespace wedgescope
