// Culture: classes of culture cells as a front needs them: a tile is read when ground in it is first seen.
// Leaves what a class returns to material.hpp and reading to the wedge source.
#pragma once
#include <cstdint>
#include <vector>

#include "lib/interval.hpp"
#include "lib/material.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

/// Tiles of the culture raster under one chunk, each empty until something in it is asked for; of the chunk before, those
/// under both stay.
class Culture {
public:
    Culture(const DataBase& data_base, WedgeSource* source) : db_(data_base), source_(source) {}

    /// Tiles of the culture raster under these posts and a little round them.
    static Window tiles_under(const DataBase& data_base, const Window& posts);
    static Window cells_of_tile(const DataBase& db, std::int64_t column, std::int64_t row) {
        const std::int64_t wide = db.culture_tile_columns, high = db.culture_tile_rows;
        return {{column * wide, (column + 1) * wide}, {row * high, (row + 1) * high}};
    }

    /// Makes room for what lies under these posts, and forgets all else that was read; `all`: reads it at once.
    void open(const Window& posts, bool all);
    void forget();

    double cell_column(double column) const { return db_.culture_column_offset + db_.culture_column_scale * column; }
    double cell_row(double row) const { return db_.culture_row_offset + db_.culture_row_scale * row; }

    /// The tile that a culture cell lies in; until the next one is asked for.
    const CultureCells& tile_of(std::int64_t cell_column, std::int64_t cell_row) {
        if (last_ && last_->window.contains(cell_column, cell_row)) return *last_;
        return find(cell_column, cell_row);
    }
    /// Class of a culture cell; the default class beyond the culture raster and where there is none.
    ClassId at(std::int64_t cell_column, std::int64_t cell_row) {
        if (!db_.has_culture) return db_.default_class;
        const CultureCells& tile = tile_of(cell_column, cell_row);
        return tile.classes[tile.window.at(cell_column, cell_row)];
    }
    /// Raw code of a cell whose class is unknown.
    std::int32_t code(std::int64_t cell_column, std::int64_t cell_row) {
        const CultureCells& tile = tile_of(cell_column, cell_row);
        return tile.codes.empty() ? 0 : tile.codes[tile.window.at(cell_column, cell_row)];
    }

    std::uint64_t bytes_read() const { return bytes_read_; }
    std::uint64_t bytes_spilled() const { return bytes_spilled_; }  ///< read from a spill's file
    /// What reading took so far.
    struct Cost {
        double cpu_s = 0, wait_s = 0;  ///< wait: wall less CPU seconds
        std::uint64_t ticks = 0;
    };
    const Cost& cost() const { return cost_; }
    std::size_t bytes() const { return bytes_; }

private:
    const CultureCells& find(std::int64_t cell_column, std::int64_t cell_row);

    const DataBase& db_;
    WedgeSource* source_;
    Window tiles_;  ///< in tiles
    std::vector<CultureCells> cells_;
    CultureCells beyond_;  ///< one tile that lies outside of `tiles_`
    const CultureCells* last_ = nullptr;
    std::uint64_t bytes_read_ = 0, bytes_spilled_ = 0;
    Cost cost_;
    std::size_t bytes_ = 0;
};

/// What to say of a code on seen ground that no legend entry names.
DataError unknown_class_error(const DataBase& data_base, std::int32_t code);

}  // namespace wedgescope
