// RegisteredLayer: a raster (culture, culture height) registered by coordinate to the terrain's posts.
// For the .cpp files of this folder only. Leaves the terrain itself and chunks to raster_source.cpp.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tiles/needed_posts.hpp"
#include "tiles/raster_layer.hpp"
#include "tiles/tile_ledger.hpp"

namespace wedgescope {

/// Posts read at a time, at most; and of what is then turned or scaled, while the near caches hold it.
inline constexpr std::int64_t slab_posts = std::int64_t{1} << 20;
inline constexpr std::int64_t near_posts = slab_posts / 8;

/// Part of a row of wanted columns that one window reads: `count` wanted from `at` on lie in source columns `source`.
struct Run {
    std::int64_t at = 0, count = 0;
    Interval source;
};
/// Cuts a list of source columns (-1: nowhere) where it jumps by more than `step` or turns.
std::vector<Run> runs(const std::vector<std::int64_t>& source, std::int64_t step);

/// Cell = floor(offset + scale * index) of the terrain's columns or rows.
struct Axis {
    double offset = 0.5, scale = 1;
    std::int64_t cells = 0;
    double circle = 0;  ///< cells in 360 degrees, 0 where there is no circle

    std::int64_t cell(std::int64_t index) const;
    /// The cell of the raster that holds what lies in cell `i`, whole circles away if need be; -1 if none does.
    std::int64_t inside(std::int64_t i) const;
    /// Cells that the terrain posts of `posts` and all between them lie in.
    Interval under(Interval posts) const;
};

class RegisteredLayer {
public:
    /// DataError if it is in another CRS than the terrain or nowhere near it.
    RegisteredLayer(std::unique_ptr<RasterLayer> raster, const RasterFacts& terrain);

    RasterLayer& raster() { return *raster_; }
    const RasterFacts& facts() const { return raster_->facts(); }
    const Axis& columns() const { return columns_; }
    const Axis& rows() const { return rows_; }
    TileLedger& ledger() { return *ledger_; }
    const TileLedger& ledger() const { return *ledger_; }
    /// The same posts from somewhere else, and a new ledger for its tiles; returns what they came from before.
    std::unique_ptr<RasterLayer> replace(std::unique_ptr<RasterLayer> raster) {
        std::swap(raster_, raster);
        ledger_ = std::make_unique<TileLedger>(raster_->facts());
        return raster;
    }

    /// As if nothing had been read yet.
    void forget() { ledger_ = std::make_unique<TileLedger>(raster_->facts()); }

    /// What is needed to read heights under a run of terrain columns.
    struct Plan {
        Interval columns;
        std::vector<std::int64_t> cells;  ///< of each column; -1: none
        std::vector<Run> runs;
        std::int64_t widest = 1;
    };
    Plan plan(Interval columns) const;

    /// Scaled heights at the posts of `rows`, row after row; 0 where none is known or, up to the file's tiles, none is
    /// needed. Returns posts read. DataError naming a cell below 0.
    std::int64_t read_heights(const Plan& plan, Interval rows, double scale, const NeededPosts& needed, float* out,
                              std::vector<float>& scratch);

    /// Calls body(row, at, codes, n) for every run of cells in the window that the raster holds; returns cells read.
    template <class Body>
    std::int64_t read_codes(const Window& window, Body&& body) {
        std::vector<std::int32_t> codes;
        return for_each_slab(window, [&](const Window& part, std::int64_t at) {
            codes.resize(static_cast<std::size_t>(part.posts()));
            raster_->read_codes(part, codes.data());
            for (std::int64_t y = 0; y < part.rows.size(); ++y)
                body(part.rows.begin + y - window.rows.begin, at, codes.data() + y * part.columns.size(),
                     part.columns.size());
        });
    }
    /// As if their codes had been read; returns how many there are.
    std::int64_t touch_codes(const Window& window) {
        return for_each_slab(window, [](const Window&, std::int64_t) {});
    }

    /// Notes in the ledger that the cells under these posts were passed by.
    void pass(const Window& posts, Skip reason);

private:
    /// Notes in the ledger what of a window the raster holds and calls slab(part, its first column in the window's count) for
    /// each part that is read at a time; returns cells.
    template <class Slab>
    std::int64_t for_each_slab(const Window& window, Slab&& slab) {
        std::vector<std::int64_t> cells(static_cast<std::size_t>(window.columns.size()));
        for (std::size_t i = 0; i < cells.size(); ++i)
            cells[i] = columns_.inside(window.columns.begin + static_cast<std::int64_t>(i));
        const Interval inside = intersection(window.rows, {0, rows_.cells});
        const std::int64_t block = facts().unit_rows();
        std::int64_t all = 0;
        for (const Run& run : runs(cells, 1))
            for (std::int64_t r = inside.begin; r < inside.end;) {
                std::int64_t end = r + std::max<std::int64_t>(1, slab_posts / run.source.size());
                if (end - r >= block) end -= end % block;
                end = std::min(end, inside.end);
                const Window part{run.source, {r, end}};
                ledger_->touch(part);
                slab(part, run.at);
                all += part.posts();
                r = end;
            }
        return all;
    }
    void check_heights(const Window& window, const float* values, std::int64_t stride, double scale) const;

    std::unique_ptr<RasterLayer> raster_;
    Axis columns_, rows_;
    std::unique_ptr<TileLedger> ledger_;
};

/// DataError with the gdalwarp line to use if both rasters have a CRS and these differ. `dem`: word for the second.
void refuse_other_crs(const RasterFacts& layer, const RasterFacts& terrain, const std::string& dem);
/// DataError where the band's own scale or offset would make other numbers of codes.
void refuse_scaled_codes(const RasterFacts& layer);

}  // namespace wedgescope
