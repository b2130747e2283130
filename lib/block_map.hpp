// BlockMap: what is known of the terrain without reading it: bounds over blocks of 32 x 32 posts and over coarser ones.
// Leaves what may be skipped to cull.hpp, and where the map comes from to the wedge source.
#pragma once
#include <cstdint>
#include <limits>
#include <vector>

#include "lib/interval.hpp"

namespace wedgescope {

inline constexpr std::int64_t block_posts = 32;

enum class Voids : std::uint8_t { none = 0, some = 1, all = 2 };

/// Over the posts of a block and the first ones beyond it: (32 << level) + 1 posts a side, cut at the raster's edge.
/// So a cell of four posts belongs to just one block. In a cyclic raster the post after the last column is column 0.
struct BlockBounds {
    float lowest_m = std::numeric_limits<float>::infinity();    ///< bare terrain, valid posts; +inf: all void
    float highest_m = -std::numeric_limits<float>::infinity();  ///< bare terrain, valid posts; -inf: all void
    float culture_m = 0;                                        ///< highest culture height, scaled; 0: none
    Voids voids = Voids::all;

    /// Of two blocks together.
    void add(const BlockBounds& other) {
        lowest_m = other.lowest_m < lowest_m ? other.lowest_m : lowest_m;
        highest_m = other.highest_m > highest_m ? other.highest_m : highest_m;
        culture_m = other.culture_m > culture_m ? other.culture_m : culture_m;
        voids = voids == other.voids ? voids : Voids::some;
    }
    friend bool operator==(const BlockBounds&, const BlockBounds&) = default;
};

/// Rows of bounds, of the blocks `blocks` of one level.
struct BlockWindow {
    Window blocks;
    std::vector<BlockBounds> bounds;
    const BlockBounds& at(std::int64_t column, std::int64_t row) const { return bounds[blocks.at(column, row)]; }
};

class BlockMap {
public:
    virtual ~BlockMap() = default;
    /// 0: 32 x 32 posts; each further one twice as wide. At least 1; the last has 64 x 64 blocks at the most.
    virtual int levels() const = 0;
    /// `blocks` inside the raster's (columns of a cyclic raster too). From several threads at once. IoError, DataError.
    virtual BlockWindow read(int level, const Window& blocks) = 0;
};

/// The block, `side` posts wide, that a post, or the cell that begins with it, lies in.
constexpr std::int64_t block_along(std::int64_t post, std::int64_t side = block_posts) {
    return (post >= 0 ? post : post - side + 1) / side;
}
/// The blocks that posts in a row lie in.
constexpr Interval blocks_along(Interval posts, std::int64_t side = block_posts) {
    return posts.empty() ? Interval{} : Interval{block_along(posts.begin, side), block_along(posts.end - 1, side) + 1};
}
/// The blocks of a level that hold the posts of a window.
constexpr Window blocks_of(const Window& posts, int level = 0) {
    return {blocks_along(posts.columns, block_posts << level), blocks_along(posts.rows, block_posts << level)};
}

/// The block, `side` posts wide, of the cells that begin at line `from`, outwards (`out`: 1 or -1), and its far border, or
/// line `last` before that.
struct CellsAhead {
    std::int64_t block, to;
};
constexpr CellsAhead cells_ahead(std::int64_t from, std::int64_t last, std::int64_t out,
                                 std::int64_t side = block_posts) {
    const std::int64_t block = block_along(out > 0 ? from : from - 1, side), near = block * side;
    if (out > 0) return {block, near + side < last ? near + side : last};
    return {block, near > last ? near : last};
}

/// As BlockMap::read, of any level: what is coarser than the map's last one is put together. `columns`, `rows`: posts.
inline BlockWindow read_bounds(BlockMap& map, int level, const Window& blocks, std::int64_t columns,
                               std::int64_t rows) {
    if (level < map.levels() || blocks.empty()) return map.read(level, blocks);
    const auto count = [&](std::int64_t posts) {
        const std::int64_t edge = block_posts << (level - 1);
        return (posts + edge - 1) / edge;
    };
    const Interval across = intersection({2 * blocks.columns.begin, 2 * blocks.columns.end}, {0, count(columns)}),
                   down = intersection({2 * blocks.rows.begin, 2 * blocks.rows.end}, {0, count(rows)});
    const BlockWindow finer = read_bounds(map, level - 1, {across, down}, columns, rows);
    BlockWindow out{blocks, std::vector<BlockBounds>(static_cast<std::size_t>(blocks.posts()))};
    std::vector<bool> begun(out.bounds.size());
    for (std::int64_t r = down.begin; r < down.end; ++r)
        for (std::int64_t c = across.begin; c < across.end; ++c) {
            const auto at = blocks.at(c / 2, r / 2);
            if (begun[at])
                out.bounds[at].add(finer.at(c, r));
            else
                out.bounds[at] = finer.at(c, r);
            begun[at] = true;
        }
    return out;
}

}  // namespace wedgescope
