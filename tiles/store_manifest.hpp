// StoreManifest: the small JSON file that names everything a version of a tile store is made of, and SheetSums: the
// checksums of one sheet's tiles. Formats: docs/formats.md.
// For the .cpp files of this folder only. Leaves reading tiles to store_layer.hpp and making them to sheet_writer.hpp.
#pragma once
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "tiles/block_map_file.hpp"
#include "tiles/code_counts.hpp"
#include "tiles/detail_map_file.hpp"
#include "tiles/raster_layer.hpp"
#include "tiles/tile_store.hpp"

namespace wedgescope {

inline constexpr const char* manifest_name = "manifest.json";
inline constexpr std::int64_t sheet_posts = 4096;  ///< a side, at the most

/// A raster the store was made from, as it was then.
struct StoreSource {
    std::string path;
    std::uint64_t bytes = 0;
    std::int64_t mtime_s = 0;
};
/// Without bytes and time where it is no plain file.
StoreSource source_of(const std::string& path);

/// What the values of a sheet, or a layer, are; heights in metres, of own columns (without a repeated last one).
struct ValueFacts {
    float lowest = std::numeric_limits<float>::infinity(), highest = -std::numeric_limits<float>::infinity();
    std::uint64_t voids = 0;
    void add(const ValueFacts& other);
};

/// Posts that rasters hold with unlike heights.
struct Disagreement {
    std::uint64_t posts = 0;                     ///< each once, however many rasters are unlike there
    float largest_m = 0;                         ///< above 0 where there are any
    std::int64_t column = 0, row = 0;            ///< of the largest
    std::int64_t kept_file = 0, other_file = 0;  ///< numbers in the order given
    std::uint64_t interpolated = 0;              ///< of the posts, those that are no post of one of the rasters
    void add(const Disagreement& other);
};

struct StoreSheet {
    std::int64_t column = 0, row = 0;  ///< of sheets
    std::string file, sums;            ///< paths inside the store
    std::uint64_t bytes = 0, sums_checksum = 0;
};

struct StoreLayerEntry {
    StoreLayerKind kind = StoreLayerKind::dem;
    RasterFacts facts;  ///< of the layer; block_columns = block_rows = tile
    std::string vrt;
    std::uint64_t vrt_checksum = 0;
    std::vector<StoreSource> sources;
    ValueFacts values;
    std::vector<StoreSheet> sheets;  ///< row after row; one that is not named is void

    std::int64_t sheet_columns() const { return (facts.columns + sheet_posts - 1) / sheet_posts; }
    std::int64_t sheet_rows() const { return (facts.rows + sheet_posts - 1) / sheet_posts; }
    /// Posts of a sheet.
    Window posts(std::int64_t column, std::int64_t row) const;
};

struct StoreManifest {
    std::int64_t version = 1;  ///< of the data base
    std::string software;
    std::vector<StoreLayerEntry> layers;  ///< dem first
    std::string block_map;
    std::uint64_t block_map_checksum = 0;
    std::optional<std::uint64_t> block_map_imprint;  ///< PagedFile::imprint; none: of a build that wrote none
    std::string detail_map;  ///< empty: none, and overviews of heights are no posts of theirs
    std::uint64_t detail_map_checksum = 0;
    std::optional<std::uint64_t> detail_map_imprint;
    std::string plan;  ///< the file that tells what the store was made of and with
    std::uint64_t plan_checksum = 0;
    std::string legend_name, legend_csv;
    std::optional<double> height_scale;  ///< metres in one unit of culture height; none: nobody said
    bool class_table = false;            ///< one in store_classes_name belongs to it, which may be edited

    const StoreLayerEntry* layer(StoreLayerKind kind) const;
    BlockMapShape map_shape() const { return {layers[0].facts.columns, layers[0].facts.rows}; }
    DetailMapShape detail_shape() const { return {layers[0].facts.columns, layers[0].facts.rows}; }
};

std::string manifest_text(const StoreManifest& manifest);
/// IoError; DataError if it is damaged or of another format.
StoreManifest read_manifest(const std::string& folder);

/// Overviews of a sheet of so many posts: halves until the longer side fits into a tile.
int overview_count(std::int64_t columns, std::int64_t rows, std::int64_t tile);

struct SheetSums {
    std::int64_t columns = 0, rows = 0, tile = 0;
    std::uint64_t file_bytes = 0, file_checksum = 0;
    ValueFacts values;
    Disagreement disagreement;
    CodeCounts codes;  ///< that the legend does not know
    /// XXH3 of the stored values of each tile, without what lies beyond the sheet: level 0 (the sheet) row after row,
    /// then its overviews.
    std::vector<std::uint64_t> tiles;

    static std::int64_t side(std::int64_t posts, int level) {
        return (posts + (std::int64_t{1} << level) - 1) >> level;
    }
    std::int64_t across(int level) const { return (side(columns, level) + tile - 1) / tile; }
    std::int64_t down(int level) const { return (side(rows, level) + tile - 1) / tile; }
    int levels() const { return 1 + overview_count(columns, rows, tile); }
    std::size_t index(int level, std::int64_t column, std::int64_t row) const;
    std::size_t tile_count() const { return index(levels(), 0, 0); }
};

std::string sums_text(const SheetSums& sums);
/// DataError naming `path` if it is damaged. `expected`: checksum of the whole file, if known.
SheetSums read_sums(const std::string& path, std::optional<std::uint64_t> expected);

}  // namespace wedgescope
