#include "lib/culture.hpp"

#include <cmath>

namespace wedgescope {
namespace {

std::int64_t tile_index(std::int64_t cell, std::int64_t edge) { return (cell >= 0 ? cell : cell - edge + 1) / edge; }

/// Tiles under the cells from one place to another, either way round.
Interval tiles_between(double a, double b, std::int64_t edge) {
    const double low = std::floor(std::min(a, b)), high = std::floor(std::max(a, b));
    return {tile_index(static_cast<std::int64_t>(low), edge), tile_index(static_cast<std::int64_t>(high), edge) + 1};
}

}  // namespace

void Culture::open(const Window& posts) {
    // Pieces of ground between the line before the window and its first line lie outside of it.
    constexpr double margin = 2;
    const auto first = [](Interval i) { return static_cast<double>(i.begin) - margin; };
    const auto last = [](Interval i) { return static_cast<double>(i.end - 1) + margin; };
    tiles_ = {
        tiles_between(cell_column(first(posts.columns)), cell_column(last(posts.columns)), db_.culture_tile_columns),
        tiles_between(cell_row(first(posts.rows)), cell_row(last(posts.rows)), db_.culture_tile_rows)};
    cells_.clear();
    cells_.resize(static_cast<std::size_t>(tiles_.posts()));
    beyond_ = {};
    last_ = nullptr;
    bytes_ = 0;
}

const CultureCells& Culture::find(std::int64_t cell_column, std::int64_t cell_row) {
    const std::int64_t wide = db_.culture_tile_columns, high = db_.culture_tile_rows;
    const std::int64_t column = tile_index(cell_column, wide), row = tile_index(cell_row, high);
    const bool inside = tiles_.columns.contains(column) && tiles_.rows.contains(row);
    CultureCells& tile = inside ? cells_[index(tiles_, column, row)] : beyond_;
    const Window window{{column * wide, (column + 1) * wide}, {row * high, (row + 1) * high}};
    if (tile.window != window) {
        if (!inside) bytes_ -= tile.bytes();
        tile = source_->load_classes(window);
        bytes_read_ += tile.bytes_read;
        bytes_ += tile.bytes();
    }
    last_ = &tile;
    return tile;
}

}  // namespace wedgescope
