// WedgeSource: the one interface through which the engine reads terrain and culture, chunk by chunk.
// Leaves files, tiles, spill and caches to whoever implements it.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "lib/block_map.hpp"
#include "lib/error.hpp"
#include "lib/interval.hpp"
#include "lib/material.hpp"
#include "lib/post_extremes.hpp"
#include "lib/raw_vector.hpp"

namespace wedgescope {

/// A place between posts: post (c, r) stands at column c, row r.
struct IndexPosition {
    double column = 0;
    double row = 0;
};

/// The grid of the terrain posts and of the culture cells, and where they lie on earth.
struct DataBase {
    std::string name;          ///< for messages: the terrain raster's path
    std::int64_t columns = 0;  ///< posts; at least 2 x 2
    std::int64_t rows = 0;
    bool has_crs = false;
    bool has_geotransform = true;  ///< else x and y are columns and rows
    bool crs_in_metres = false;    ///< x and y are metres (or scaled to them) on a plane: grid geometry is possible
    std::string crs_wkt;           ///< empty without a CRS
    double origin_x = 0, origin_y = 0;  ///< of post (0, 0), in CRS units
    double step_x = 0, step_y = 0;      ///< from post to post, in CRS units; step_y below 0 for north-up rasters
    double metres_per_unit = 1;         ///< of x and y on a plane
    double metres_per_height = 1;       ///< of the terrain file's own unit; the heights that load() gives are metres
    /// Metres in a unit of x and y: of a degree, those at the equator. For sizes that need not be exact.
    double metres_a_unit() const { return metres_per_unit * (crs_in_metres ? 1 : 111320); }
    double longer_post_m() const { return std::max(std::abs(step_x), std::abs(step_y)) * metres_a_unit(); }
    bool cyclic = false;             ///< columns span the whole circle of longitude
    std::int64_t cycle_columns = 0;  ///< columns of the circle, if cyclic
    /// The same column within the circle.
    std::int64_t real_column(std::int64_t column) const {
        if (!cyclic) return column;
        const std::int64_t rest = column % cycle_columns;
        return rest < 0 ? rest + cycle_columns : rest;
    }
    /// How far one column that locate() gave lies from another: where columns go round the earth the short way.
    double columns_between(double from, double to) const {
        const double circle = cyclic ? static_cast<double>(cycle_columns) : circle_columns ? circle_columns() : 0;
        return circle > 0 ? std::remainder(to - from, circle) : to - from;
    }
    /// Whether a place lies in one of the terrain's cells.
    bool holds(IndexPosition p) const {
        return (cyclic || (p.column >= -0.5 && p.column <= static_cast<double>(columns) - 0.5)) && p.row >= -0.5 &&
               p.row <= static_cast<double>(rows) - 0.5;
    }

    /// WGS84 latitude and longitude (degrees) -> place on the grid, exact (PROJ). Only where has_crs.
    /// Called from one thread at a time. Columns of a lat/lon raster come out nearest to its middle.
    std::function<IndexPosition(double lat_deg, double lon_deg)> locate;
    /// Columns round the earth, whether the raster goes all the way or not; 0 where they do not go round. After locate().
    std::function<double()> circle_columns;
    /// The inverse; nothing where PROJ has no answer.
    std::function<std::optional<std::pair<double, double>>(double column, double row)> lat_lon;

    /// Tiles (or strips) of the terrain file: the unit it is read in.
    std::int64_t block_columns = 256, block_rows = 256;

    std::int64_t post_bytes = 4;  ///< of one post, decoded, in all layers that load() reads

    std::string culture_name, legend_name;  ///< for messages
    std::uint64_t legend_sum = 0;           ///< of what its codes stand for; 0: there is none
    bool has_culture = false;
    bool has_culture_height = false;
    ClassId default_class = 4;  ///< where there is no culture: the key `material`
    /// Culture cell of a place on the terrain grid: column = floor(offset + scale * column), same for rows.
    double culture_column_offset = 0.5, culture_column_scale = 1;
    double culture_row_offset = 0.5, culture_row_scale = 1;
    std::int64_t culture_columns = 0, culture_rows = 0;
    /// Tiles of the culture file: the unit its classes are asked in.
    std::int64_t culture_tile_columns = 256, culture_tile_rows = 256;
};

/// Why something was not read.
enum class Skip : std::uint8_t {
    none = 0,  ///< it was
    range,     ///< outside range or sector
    horizon,   ///< below the horizon of a smooth earth at the data base's lowest height
    hidden,    ///< behind nearer terrain
    voids,     ///< nothing but voids
    culture,   ///< culture of ground that nothing sees
    detail,    ///< finer than the scope resolves
};
inline constexpr std::size_t skip_count = 7;
/// As reports call them, by Skip.
inline constexpr std::array<const char*, skip_count> skip_names = {"none",  "range",   "horizon", "hidden",
                                                                   "voids", "culture", "detail"};

struct SkipCount {
    std::uint64_t posts = 0, tiles = 0, bytes = 0;  ///< bytes as decoded
};
using Skipped = std::array<SkipCount, skip_count>;

/// A rectangle of posts, and what of it need not be read. At level L of detail all indices count the posts that this level
/// keeps: post (c, r) is the raster's (c 2^L, r 2^L), and a block is as many of these wide as any.
struct ChunkRequest {
    Window window;                   ///< inside the raster (columns taken modulo the cycle if cyclic)
    bool lines_are_columns = false;  ///< quadrants E and W: a line is a column of posts
    /// Blocks that cover the window, with a reason for each that is not needed; empty: all are needed. A post must be
    /// read if it lies in a needed block or within `margin` posts of one, either way. Any other may have `fill_m` of
    /// its own block for its surface (NaN: void) and 0 for its culture height.
    static constexpr std::int64_t margin = 2;
    Window blocks;
    std::vector<Skip> skip;
    std::vector<float> fill_m;
    int level = 0;  ///< of detail; 0: every post. Above 0 only where the source has a detail map
    /// All of the window that anything looks at: a source may leave the rest out of the chunk. None: the whole window.
    std::optional<Window> looked_at;

    /// The height to fill all of it with, if none of its posts must be read and none need be void.
    std::optional<float> flat_m() const {
        float lowest = std::numeric_limits<float>::infinity();
        for (std::size_t i = 0; i < skip.size(); ++i) {
            if (skip[i] == Skip::none || skip[i] == Skip::voids) return std::nullopt;
            lowest = fill_m[i] < lowest ? fill_m[i] : lowest;
        }
        if (!(lowest < std::numeric_limits<float>::infinity())) return std::nullopt;
        return lowest;
    }
};

/// One rectangle of posts, as the spokes of a quadrant cross it: line by line.
struct Chunk {
    Window window;  ///< of the request, or less of it that holds what is looked at
    bool lines_are_columns = false;
    /// Surface height (terrain + culture height), metres, NaN = void: line-major, the lines in raster
    /// order, `minor_count()` posts a line in raster order.
    RawVector<float> surface_m;
    bool flat = false;  ///< nothing of it was needed: the first line stands for all
    /// Culture height (scaled), metres, at the same posts; empty where none stands in the window.
    RawVector<float> culture_height_m;

    std::uint64_t posts_read = 0;     ///< in the tiles of the file that were needed, whether each of them was or not
    std::uint64_t bytes_read = 0;     ///< of these, decoded
    std::uint64_t bytes_spilled = 0;  ///< read for it from a spill's file, as stored there: whole packed blocks

    std::int64_t line_count() const { return lines_are_columns ? window.columns.size() : window.rows.size(); }
    std::int64_t minor_count() const { return lines_are_columns ? window.rows.size() : window.columns.size(); }
    std::size_t bytes() const { return (surface_m.size() + culture_height_m.size()) * sizeof(float); }
};

/// Class of a culture cell whose code no legend entry names.
inline constexpr ClassId unknown_class = std::numeric_limits<ClassId>::max();

/// Classes of a rectangle of culture cells, row after row.
struct CultureCells {
    Window window;  ///< in the culture raster's own columns and rows; may reach beyond it: default class there
    std::vector<ClassId> classes;
    /// Raw codes beside `classes`, kept only where some code has no class (class unknown_class).
    std::vector<std::int32_t> codes;
    std::uint64_t bytes_read = 0;
    std::uint64_t bytes_spilled = 0;  ///< as a Chunk's
    std::size_t bytes() const { return classes.size() * sizeof(ClassId) + codes.size() * sizeof(std::int32_t); }
};

/// What a load comes to.
struct LoadCost {
    std::uint64_t posts = 0, bytes = 0;  ///< as Chunk counts them
    std::size_t chunk_bytes = 0;         ///< of the chunk, at the most
    std::size_t beside_bytes = 0;        ///< held beside it while it is read, at the most
};

struct Extremes {
    float lowest_m = 0;
    float highest_m = 0;  ///< surface: terrain + culture height
    std::uint64_t void_posts = 0;
    bool any_valid = false;
};
/// Of these posts.
inline Extremes extremes_of(const PostExtremes& posts) {
    Extremes e{0, 0, posts.voids, posts.lowest_m <= posts.highest_m};
    if (e.any_valid) {
        e.lowest_m = posts.lowest_m;
        e.highest_m = posts.highest_m;
    }
    return e;
}

/// What a source did beside the chunks it handed out, the partition of a spilled one; and what stood out in them.
struct SourceReport {
    std::string kind = "direct";
    double partition_s = 0;                                                ///< wall seconds of the pass
    std::uint64_t partition_bytes = 0;                                     ///< decoded bytes that the pass read
    std::uint64_t held_bytes = 0;                                          ///< blocks that stayed in memory
    std::uint64_t spilled_bytes = 0;                                       ///< written to the spill file
    std::uint64_t spill_read_bytes = 0;                                    ///< read from it again
    std::uint64_t planned_partition_bytes = 0, planned_spilled_bytes = 0;  ///< as forecast before the pass
    std::size_t pass_peak_bytes = 0, planned_pass_peak_bytes = 0;  ///< the most that the pass held, and may hold
    std::string kept;  ///< path of the kept spill that served instead of a pass; empty: none
    /// Of some of the posts that were loaded, each time they were: the lowest (+infinity: none), those on which anything stands, and
    /// how high it does on average.
    double lowest_m = std::numeric_limits<double>::infinity();
    std::uint64_t raised_posts = 0;
    double mean_culture_m = 0;
};

class DetailMap;

class WedgeSource {
public:
    virtual ~WedgeSource() = default;
    virtual const DataBase& data_base() const = 0;
    /// Reads one rectangle. May be called from several threads at once. IoError, DataError.
    virtual Chunk load(const ChunkRequest& request) = 0;
    Chunk load(const Window& window, bool lines_are_columns) {
        return load({window, lines_are_columns, {}, {}, {}, 0, {}});
    }
    /// What load() of the same would come to, without reading.
    virtual LoadCost cost(const ChunkRequest& request) const {
        const auto posts = static_cast<std::uint64_t>(request.window.posts());
        const std::size_t layers = data_base().has_culture_height ? 2 : 1;
        return {posts, posts * layers * sizeof(float), posts * layers * sizeof(float), 0};
    }
    /// Decoded bytes that load_classes() of these would read.
    virtual std::uint64_t class_bytes(const Window& cells) const {
        const DataBase& d = data_base();
        return static_cast<std::uint64_t>(intersection(cells.columns, {0, d.culture_columns}).size() *
                                          intersection(cells.rows, {0, d.culture_rows}).size());
    }
    /// Classes of culture cells; only with culture. May be called from several threads at once. IoError, DataError.
    virtual CultureCells load_classes(const Window& cells) = 0;
    /// Null where nothing is known without reading.
    virtual BlockMap* block_map() { return nullptr; }
    /// What is known of levels of detail; null where load() gives none.
    virtual DetailMap* detail_map() { return nullptr; }
    /// Tiles of all layers, those that a load has touched so far under Skip::none; of several reasons given for another the
    /// highest of Skip stays (range: none was given), so that no order of threads or wedges shows.
    virtual Skipped skipped() const { return {}; }
    /// Bare terrain of `posts`, row after row, NaN = void; outside the raster is an error of the caller's. Columns of a cyclic
    /// raster may go on over its seam.
    virtual void read_bare_terrain(const Window& posts, float* heights_m) = 0;
    /// The same at one post.
    float bare_terrain_m(std::int64_t column, std::int64_t row) {
        float height_m = 0;
        read_bare_terrain({{column, column + 1}, {row, row + 1}}, &height_m);
        return height_m;
    }
    /// Over the whole raster (one pass the first time). For the default range.
    virtual Extremes extremes() = 0;
    virtual SourceReport report() const { return {}; }
    /// A number that changes when what load() and load_classes() give for these posts may have changed, and is the same
    /// in another process otherwise; none: for the whole data base. 0: it never changes. From several threads at once.
    /// IoError.
    virtual std::uint64_t fingerprint(const std::vector<Window>& posts) {
        (void)posts;
        return 0;
    }
    /// Memory the source itself holds beside the chunks it hands out (caches).
    virtual std::size_t cache_bytes() const = 0;
    /// Of these, what it holds after reads of so many decoded bytes, and what it holds now: a cache may not fill.
    virtual std::size_t filled_bytes(std::uint64_t bytes_read) const {
        (void)bytes_read;
        return cache_bytes();
    }
    virtual std::size_t held_bytes() const { return cache_bytes(); }
    /// And for each thread that reads at the same time: a block as it is decoded, and packed. Part of what cost() says.
    virtual std::size_t reader_bytes() const { return 0; }
};

/// DataError if the data base is no longer the one that had this fingerprint.
inline void check_unchanged(WedgeSource& source, std::uint64_t fingerprint) {
    if (source.fingerprint({}) != fingerprint)
        throw DataError(text("the data base '", source.data_base().name, "' changed while it was read"));
}

}  // namespace wedgescope
