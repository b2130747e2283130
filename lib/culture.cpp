#include "lib/culture.hpp"

#include <cmath>
#include <utility>

#include "lib/stopwatch.hpp"
#include "lib/ticks.hpp"

namespace wedgescope {
namespace {

std::int64_t tile_index(std::int64_t cell, std::int64_t edge) { return (cell >= 0 ? cell : cell - edge + 1) / edge; }

/// Tiles under the cells from one place to another, either way round.
Interval tiles_between(double a, double b, std::int64_t edge) {
    const double low = std::floor(std::min(a, b)), high = std::floor(std::max(a, b));
    return {tile_index(static_cast<std::int64_t>(low), edge), tile_index(static_cast<std::int64_t>(high), edge) + 1};
}

}  // namespace

Window Culture::tiles_under(const DataBase& db, const Window& posts) {
    // Pieces of ground between the line before the window and its first line lie outside of it.
    constexpr double margin = 2;
    const auto under = [&](Interval i, double offset, double scale, std::int64_t edge) {
        return tiles_between(offset + scale * (static_cast<double>(i.begin) - margin),
                             offset + scale * (static_cast<double>(i.end - 1) + margin), edge);
    };
    return {under(posts.columns, db.culture_column_offset, db.culture_column_scale, db.culture_tile_columns),
            under(posts.rows, db.culture_row_offset, db.culture_row_scale, db.culture_tile_rows)};
}

void Culture::open(const Window& posts, bool all) {
    const Window before = std::exchange(tiles_, tiles_under(db_, posts));
    std::vector<CultureCells> tiles(static_cast<std::size_t>(tiles_.posts()));
    bytes_ = 0;
    const Window kept = intersection(before, tiles_);
    for (std::int64_t row = kept.rows.begin; row < kept.rows.end; ++row)
        for (std::int64_t column = kept.columns.begin; column < kept.columns.end; ++column) {
            CultureCells& tile = tiles[tiles_.at(column, row)];
            tile = std::move(cells_[before.at(column, row)]);
            bytes_ += tile.bytes();
        }
    cells_ = std::move(tiles);
    beyond_ = {};
    last_ = nullptr;
    if (!all) return;
    for (std::int64_t row = tiles_.rows.begin; row < tiles_.rows.end; ++row)
        for (std::int64_t column = tiles_.columns.begin; column < tiles_.columns.end; ++column)
            find(column * db_.culture_tile_columns, row * db_.culture_tile_rows);
}

void Culture::forget() {
    tiles_ = {};
    cells_.clear();
    beyond_ = {};
    last_ = nullptr;
    bytes_ = 0;
}

const CultureCells& Culture::find(std::int64_t cell_column, std::int64_t cell_row) {
    const std::int64_t column = tile_index(cell_column, db_.culture_tile_columns),
                       row = tile_index(cell_row, db_.culture_tile_rows);
    const bool inside = tiles_.contains(column, row);
    CultureCells& tile = inside ? cells_[tiles_.at(column, row)] : beyond_;
    const Window window = cells_of_tile(db_, column, row);
    if (tile.window != window) {
        if (!inside) bytes_ -= tile.bytes();
        const Stopwatch watch;
        const std::uint64_t clock = ticks();
        tile = source_->load_classes(window);
        const Stopwatch::Took took = watch.took();
        cost_.cpu_s += took.cpu_s;
        cost_.wait_s += took.wait_s;
        cost_.ticks += ticks() - clock;
        bytes_read_ += tile.bytes_read;
        bytes_spilled_ += tile.bytes_spilled;
        bytes_ += tile.bytes();
    }
    last_ = &tile;
    return tile;
}

DataError unknown_class_error(const DataBase& db, std::int32_t code) {
    return DataError(text("'", db.culture_name, "': code ", code, " on seen ground is not in the legend '",
                          db.legend_name,
                          "'; give a culture-legend that names it (info lists all codes of a culture raster)"));
}

}  // namespace wedgescope
