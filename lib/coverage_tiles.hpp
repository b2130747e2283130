// CoverageTiles: tiles of coverage's output on their way out: made when a strip first meets them, filled by its runs,
// handed out when all their posts are known.
// Leaves which posts there are, and when they are known, to coverage_strips.cpp.
#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "lib/coverage.hpp"

namespace wedgescope {

class CoverageTiles {
public:
    static constexpr std::int64_t edge = CoverageTile::edge;
    using Key = std::pair<std::int64_t, std::int64_t>;  ///< row, column

    struct Tile {
        std::once_flag made;
        std::vector<std::uint8_t> bytes;
        std::vector<float> values;
        std::int64_t left = 0;  ///< posts not known yet
    };
    struct Done {
        Key key;
        std::unique_ptr<Tile> tile;
    };

    /// Of a raster of so many posts; `bytes` or floats; a post that no run writes is `outside`, or NaN. `reached_only`:
    /// a tile without a buffer is not handed out.
    CoverageTiles(std::int64_t columns, std::int64_t rows, bool bytes, std::uint8_t outside, bool reached_only)
        : columns_(columns), rows_(rows), bytes_(bytes), outside_(outside), reached_only_(reached_only) {}

    /// In place of `outside`; before there is any tile.
    void begin_as(std::uint8_t byte) { outside_ = byte; }
    std::size_t tile_bytes() const { return static_cast<std::size_t>(edge * edge) * (bytes_ ? 1 : sizeof(float)); }

    // From one thread at a time:

    /// Stays where it is until all its posts are known.
    Tile& at(Key key);
    /// So many posts more of a tile are known. std::logic_error if it has not that many.
    void known(Key key, std::int64_t posts);
    /// Tiles all of whose posts are known, in the order they became so.
    std::vector<Done> take_done() { return std::exchange(done_, {}); }
    bool any_done() const { return !done_.empty(); }
    std::size_t done_count() const { return done_.size(); }
    std::size_t unfinished() const { return tiles_.size(); }

    // From any thread:

    /// Its buffer of edge x edge posts, all as tiles begin at first. A tile that no run reaches needs none.
    template <class T>
    T* buffer(Tile& tile) {
        std::call_once(tile.made, [&] { make(tile); });
        if constexpr (std::is_same_v<T, float>)
            return tile.values.data();
        else
            return tile.bytes.data();
    }
    /// Writes tiles and keeps their buffers for others.
    void hand_out(std::vector<Done> tiles, const std::function<void(const CoverageTile&)>& write);

private:
    template <class T>
    const T* cells(Tile& tile, CoverageTile& out);
    void make(Tile& tile);
    std::int64_t columns_, rows_;
    bool bytes_;
    std::uint8_t outside_;
    bool reached_only_;
    Tile even_;  ///< stands for those that no run reached
    std::map<Key, std::unique_ptr<Tile>> tiles_;
    std::vector<Done> done_;
    std::mutex spare_mutex_;  ///< of the two below
    std::vector<std::vector<std::uint8_t>> spare_bytes_;
    std::vector<std::vector<float>> spare_values_;
};

}  // namespace wedgescope
