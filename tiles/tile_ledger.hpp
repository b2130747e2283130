// TileLedger: which tiles of a raster's file a run has touched, and why not the others.
// For the .cpp files of this folder only. Leaves what may be skipped to the engine.
//
// Memory: one byte a tile of the file, held as long as its source and part of what the source says it holds.
#pragma once
#include <algorithm>
#include <atomic>
#include <vector>

#include "lib/wedge_source.hpp"
#include "tiles/raster_layer.hpp"

namespace wedgescope {

class TileLedger {
public:
    explicit TileLedger(const RasterFacts& facts)
        : wide_(facts.unit_columns()), high_(facts.unit_rows()), columns_(facts.columns), rows_(facts.rows),
          across_((columns_ + wide_ - 1) / wide_), type_bytes_(static_cast<std::uint64_t>(facts.type_bytes)),
          tiles_(static_cast<std::size_t>(across_ * ((rows_ + high_ - 1) / high_))) {}

    /// Some of these cells were read.
    void touch(const Window& cells) { mark(cells, touched); }
    /// These cells were not needed. Of several reasons for one tile the last of the enumeration stays, so that no
    /// order of threads or wedges shows; none is "not asked for yet".
    void pass(const Window& cells, Skip reason) { mark(cells, static_cast<std::uint8_t>(reason)); }

    /// All tiles: those that were touched under Skip::none.
    void add_to(Skipped& sum) const {
        for (std::size_t i = 0; i < tiles_.size(); ++i) {
            const std::uint8_t state = tiles_[i].load(std::memory_order_relaxed);
            const auto at = static_cast<std::int64_t>(i);
            const std::int64_t c = at % across_ * wide_, r = at / across_ * high_;
            const auto posts = static_cast<std::uint64_t>(std::min(wide_, columns_ - c) * std::min(high_, rows_ - r));
            const auto unasked = static_cast<std::uint8_t>(Skip::range), read = static_cast<std::uint8_t>(Skip::none);
            SkipCount& count = sum[state == 0 ? unasked : state == touched ? read : state];
            count.posts += posts;
            count.tiles += 1;
            count.bytes += posts * type_bytes_;
        }
    }
    std::size_t bytes() const { return tiles_.size(); }

private:
    static constexpr std::uint8_t touched = 255;

    void mark(const Window& cells, std::uint8_t state) {
        const Interval columns = intersection(cells.columns, {0, columns_}),
                       rows = intersection(cells.rows, {0, rows_});
        if (columns.empty() || rows.empty()) return;
        for (std::int64_t r = rows.begin / high_; r <= (rows.end - 1) / high_; ++r)
            for (std::int64_t c = columns.begin / wide_; c <= (columns.end - 1) / wide_; ++c) {
                std::atomic<std::uint8_t>& tile = tiles_[static_cast<std::size_t>(r * across_ + c)];
                std::uint8_t before = tile.load(std::memory_order_relaxed);
                while (before < state && !tile.compare_exchange_weak(before, state, std::memory_order_relaxed)) {
                }
            }
    }

    std::int64_t wide_, high_, columns_, rows_, across_;
    std::uint64_t type_bytes_;
    std::vector<std::atomic<std::uint8_t>> tiles_;
};

}  // namespace wedgescope
