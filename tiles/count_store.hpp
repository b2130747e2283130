// Count store: how many observers see each post of a raster (lib/seen_counts.hpp), tile by tile, in memory as far as its
// share reaches and in a scratch file beyond. Leaves the masks to lib/coverage.hpp and what is made of the counts to others.
//
// Memory: `memory_bytes` of tiles (a byte a post for up to 253 observers, two for more), at least two tiles; and
// index_bytes() for the table of tiles. A tile takes room from its first post on. When there is none, one picked at random
// goes to the file: observers cross the raster in like orders, so the one that was not used for longest would be the next to
// be asked for. A tile that comes back from the file must have the checksum that it went with.
#pragma once
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "lib/seen_counts.hpp"
#include "tiles/scratch_file.hpp"

namespace wedgescope {

class CountStore {
public:
    static constexpr std::int64_t edge = CoverageTile::edge;

    /// Of a raster of so many posts. IoError where a file is needed and `temp_folder` (empty: the system's) will not do.
    CountStore(std::int64_t columns, std::int64_t rows, std::size_t observers, std::size_t memory_bytes,
               const std::string& temp_folder);

    static std::size_t tile_bytes(std::size_t observers);
    static std::size_t index_bytes(std::int64_t columns, std::int64_t rows);
    /// Of all tiles in memory.
    static std::size_t all_bytes(std::int64_t columns, std::int64_t rows, std::size_t observers);
    static std::size_t least_bytes(std::size_t observers) { return 2 * tile_bytes(observers); }

    /// A tile of one observer's mask of observer_codes. From any thread. IoError, DataError.
    void add(const CoverageTile& mask);
    /// The numbers of a tile, rows `edge` apart, and their room back; after the last add(), from one thread. False where no
    /// observer looked: all of them are 0.
    bool take(std::int64_t column, std::int64_t row, std::span<std::uint16_t> numbers);

    std::uint64_t written_bytes() const { return written_; }  ///< to the file
    std::uint64_t read_bytes() const { return read_; }        ///< from it

private:
    struct Slot {
        std::unique_ptr<std::byte[]> cells;  ///< none: in the file, or nowhere yet
        std::uint64_t sum = 0;               ///< of what is in the file
        bool in_file = false;
        bool busy = false;  ///< of one thread
    };

    std::unique_ptr<std::byte[]> room(std::unique_lock<std::mutex>& lock);
    void fetch(std::size_t at, std::byte* cells) const;
    void let_go(std::size_t at);

    std::int64_t tiles_across_;
    bool wide_;
    std::size_t tile_bytes_, most_tiles_;
    ScratchFile file_;
    std::mutex mutex_;  ///< of what follows
    std::condition_variable changed_;
    std::vector<Slot> slots_;
    std::vector<std::size_t> resident_;  ///< tiles in memory
    std::size_t held_ = 0;               ///< of tiles that have room or are about to
    std::uint64_t random_ = 1;
    std::uint64_t written_ = 0;
    std::uint64_t read_ = 0;
};

}  // namespace wedgescope
