#include "tiles/coverage_raster.hpp"

#include <cstddef>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "lib/error.hpp"
#include "tiles/place_trial.hpp"
#include "tiles/raster_dataset.hpp"
#include "tiles/raster_driver.hpp"
#include "tiles/raster_layer.hpp"
#include "tiles/raster_metadata.hpp"
#include "tiles/raster_writer.hpp"
#include "tiles/tiff_file.hpp"

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

/// Of a tile's cells, those in the window; `even`: all are as the first.
bool all_zero(const Window& window, const void* cells, std::size_t cell_bytes, bool even) {
    const std::size_t used = even ? cell_bytes : static_cast<std::size_t>(window.columns.size()) * cell_bytes,
                      line_bytes = static_cast<std::size_t>(CoverageTile::edge) * cell_bytes;
    const std::int64_t lines = even ? 1 : window.rows.size();
    const auto* line = static_cast<const unsigned char*>(cells);
    for (std::int64_t r = 0; r < lines; ++r, line += line_bytes)
        if (line[0] != 0 || std::memcmp(line, line + 1, used - 1) != 0) return false;
    return true;
}

}  // namespace

/// A raster's file, written by GDAL or not.
class CoverageFile::Open {
public:
    Open() = default;
    virtual ~Open() = default;
    Open(const Open&) = delete;
    Open& operator=(const Open&) = delete;

    virtual bool by_tiles() const = 0;
    /// `cells`: its rows are `stride` cells apart; `even`: all are as the first.
    virtual void write(const Window& window, const void* cells, std::int64_t stride, bool even) = 0;
    virtual void close(std::optional<double> no_data) = 0;
};

namespace {

/// A value that the mask does not have.
std::uint8_t unused(const MaskValues& mask) {
    std::uint8_t value = 0;
    while (value == mask.seen || value == mask.hidden || value == mask.no_data || value == mask.outside) ++value;
    return value;
}

std::int64_t tiles(std::int64_t posts) { return (posts - 1) / CoverageTile::edge + 1; }

}  // namespace

/// Any format, type and CRS.
class CoverageFile::ByGdal : public CoverageFile::Open {
public:
    /// `fills_with_zero`: GDAL's close would fill tiles with 0, so that those of 0 may be left to it. `no_data`: what close() may
    /// declare.
    ByGdal(const RasterContent& content, const OutputFile& file, const RasterFormat& format, bool fills_with_zero,
           std::optional<double> no_data)
        : final_path_(file.final_path()), type_(content.type), tiles_across_(tiles(content.columns)),
          dataset_(create_raster(content, file, format)) {
        // What a GeoTIFF's close finds unwritten it fills with 0, or with the no-data value, and packs once.
        if (ByGdal::by_tiles() && EQUAL(dataset_->GetDriverName(), "GTiff") && fills_with_zero)
            blank_.resize(static_cast<std::size_t>(tiles_across_ * tiles(content.rows)));
        // It stores no chunk of 0 alone, and reads as what is declared what it has not stored.
        if (no_data && EQUAL(dataset_->GetDriverName(), "Zarr")) dataset_->GetRasterBand(1)->SetNoDataValue(*no_data);
    }

    bool by_tiles() const override {
        int columns = 0, rows = 0;
        dataset_->GetRasterBand(1)->GetBlockSize(&columns, &rows);
        return columns == CoverageTile::edge && rows == CoverageTile::edge;
    }

    void write(const Window& window, const void* cells, std::int64_t stride, bool even) override {
        const auto step = static_cast<GSpacing>(type_bytes(type_));
        if (by_tiles() && stride == CoverageTile::edge) {
            // A tile is a block: past GDAL's cache, so that blocks stand in the file in the order they come.
            const std::int64_t column = window.columns.begin / CoverageTile::edge,
                               row = window.rows.begin / CoverageTile::edge;
            if (blank_.empty() || !all_zero(window, cells, static_cast<std::size_t>(step), even))
                return write_tile(column, row, cells);
            blank_[static_cast<std::size_t>(row * tiles_across_ + column)] = true;
            return;
        }
        GdalErrors errors;
        const int columns = static_cast<int>(window.columns.size()), rows = static_cast<int>(window.rows.size());
        GDALRasterBand& band = *dataset_->GetRasterBand(1);
        if (band.RasterIO(GF_Write, static_cast<int>(window.columns.begin), static_cast<int>(window.rows.begin),
                          columns, rows, const_cast<void*>(cells), columns, rows, type_, step,
                          step * static_cast<GSpacing>(stride), nullptr) != CE_None)
            fail_to_write(final_path_, dataset_->GetDescription(), errors);
    }

    void close(std::optional<double> no_data) override {
        if (no_data) {
            {
                GdalErrors quiet;
                dataset_->GetRasterBand(1)->SetNoDataValue(*no_data);
            }
            // GDAL's close would fill with it.
            if (*no_data != 0) write_blank_tiles();
        }
        close_raster(std::move(dataset_), final_path_);
    }

private:
    void write_tile(std::int64_t column, std::int64_t row, const void* cells) {
        GdalErrors errors;
        if (dataset_->GetRasterBand(1)->WriteBlock(static_cast<int>(column), static_cast<int>(row),
                                                   const_cast<void*>(cells)) != CE_None)
            fail_to_write(final_path_, dataset_->GetDescription(), errors);
    }

    void write_blank_tiles() {
        const auto bytes = static_cast<std::size_t>(type_bytes(type_));
        const std::vector<std::byte> zeros(static_cast<std::size_t>(CoverageTile::edge * CoverageTile::edge) * bytes);
        for (std::size_t i = 0; i < blank_.size(); ++i)
            if (blank_[i])
                write_tile(static_cast<std::int64_t>(i) % tiles_across_, static_cast<std::int64_t>(i) / tiles_across_,
                           zeros.data());
    }

    std::string final_path_;
    GDALDataType type_;
    std::int64_t tiles_across_;
    DatasetHandle dataset_;
    std::vector<bool> blank_;  ///< tiles left to GDAL, row after row; empty: none are
};

/// Bytes as a GeoTIFF as it is by default, in a CRS of the EPSG's or in none.
class CoverageFile::ByTiff : public CoverageFile::Open {
public:
    ByTiff(TiffContent content, const OutputFile& file)
        : file_(file.temporary_path(), std::move(content), file.final_path()) {}

    bool by_tiles() const override { return true; }

    void write(const Window& window, const void* cells, std::int64_t stride, bool even) override {
        static_assert(TiffFile::edge == CoverageTile::edge);
        if (stride != TiffFile::edge) throw std::logic_error("a tile of coverage has rows of another length");
        if (all_zero(window, cells, 1, even)) return;
        file_.write_tile(window.columns.begin / TiffFile::edge, window.rows.begin / TiffFile::edge,
                         static_cast<const std::uint8_t*>(cells));
    }

    void close(std::optional<double> no_data) override {
        file_.close(no_data ? std::optional(static_cast<std::uint8_t>(*no_data)) : std::nullopt);
    }

private:
    TiffFile file_;
};

CoverageFile::CoverageFile(const ResolvedScene& scene, const DataBase& db, const Layer& layer, const OutputFile& file,
                           const RasterFormat& format)
    : layer_(layer) {
    create(db, file, format, scene_metadata(scene, format));
}

CoverageFile::CoverageFile(std::size_t observers, const DataBase& db, const Layer& layer, const OutputFile& file,
                           const RasterFormat& format)
    : layer_(layer) {
    Items items = run_metadata(format);
    items.emplace_back("OBSERVERS", std::to_string(observers));
    create(db, file, format, items);
}

void CoverageFile::create(const DataBase& db, const OutputFile& file, const RasterFormat& format,
                          const Items& metadata) {
    const std::string description = layer_.counts ? "observers that see the post" : words(layer_.kind).description;
    std::optional<std::array<double, 6>> geotransform;
    if (db.has_geotransform)
        geotransform = {db.origin_x - 0.5 * db.step_x, db.step_x, 0, db.origin_y - 0.5 * db.step_y, 0, db.step_y};

    if (layer_.kind == CoverageLayer::mask && !layer_.counts && needs_no_driver("GTiff", file.final_path(), format)) {
        std::string reason;
        const auto crs = db.crs_wkt.empty() ? nullptr : Crs::read(db.crs_wkt, reason);
        if (db.crs_wkt.empty() || (crs && crs->in_geotiff())) {
            open_ = std::make_unique<ByTiff>(TiffContent{db.columns, db.rows, description, metadata, geotransform,
                                                         crs ? crs->in_geotiff() : std::nullopt},
                                             file);
            return;
        }
    }

    RasterContent content;
    content.columns = db.columns;
    content.rows = db.rows;
    content.type = layer_.counts ? GDT_UInt16 : is_bytes(layer_.kind) ? GDT_Byte : GDT_Float32;
    content.patches = layer_.counts || is_bytes(layer_.kind);
    if (layer_.counts) {
        content.means_something = [](double value) { return value >= 0 && value < no_count; };
        content.means_nothing = no_count;
    } else if (layer_.kind == CoverageLayer::states) {
        set_states(content);
    } else if (layer_.kind == CoverageLayer::mask) {
        const MaskValues& mask = layer_.mask;
        content.codes = {mask.seen, mask.hidden, mask.no_data, mask.outside};
        const std::optional<double> ours = declared(1);
        content.means_something = [mask, ours](double value) {
            return value != ours && (value == mask.seen || value == mask.hidden);
        };
        content.means_nothing = ours ? *ours : unused(mask);
    }
    content.bands.resize(1);
    content.bands[0].description = description;
    content.bands[0].unit = layer_.counts ? "" : words(layer_.kind).unit;
    if (layer_.kind == CoverageLayer::states)
        content.bands[0].categories.assign(std::begin(state_names), std::end(state_names));
    content.metadata = metadata;
    content.crs = db.crs_wkt;
    content.geotransform = geotransform;
    if (const std::string lost = place_losses(content, file, format); !lost.empty())
        losses_ = text("'", file.final_path(), "' ", lost);
    open_ = std::make_unique<ByGdal>(content, file, format, declared(0).value_or(0) == 0, declared(1));
}

CoverageFile::~CoverageFile() = default;

bool CoverageFile::by_tiles() const { return open_->by_tiles(); }

void CoverageFile::write(const CoverageTile& tile) {
    const bool bytes = is_bytes(layer_.kind);
    open_->write(tile.window, bytes ? static_cast<const void*>(tile.bytes) : static_cast<const void*>(tile.values),
                 tile.stride, tile.even);
}

void CoverageFile::write(const Window& window, const std::uint16_t* counts) {
    open_->write(window, counts, CoverageTile::edge, false);
}

/// The value that says no data, where the file declares one.
std::optional<double> CoverageFile::declared(std::uint64_t void_posts) const {
    if (layer_.kind == CoverageLayer::mask && !layer_.counts && layer_.no_data) return *layer_.no_data;
    if (layer_.kind == CoverageLayer::response && !layer_.counts) return std::numeric_limits<double>::quiet_NaN();
    if (void_posts == 0) return std::nullopt;
    if (layer_.counts) return no_count;
    if (layer_.kind == CoverageLayer::mask) {
        if (layer_.undeclared) return std::nullopt;
        return layer_.mask.no_data;
    }
    if (is_bytes(layer_.kind)) return std::nullopt;
    return std::numeric_limits<double>::quiet_NaN();
}

void CoverageFile::close(std::uint64_t void_posts) { open_->close(declared(void_posts)); }

}  // namespace wedgescope
