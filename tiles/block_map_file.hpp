// BlockMapFile: a block map on disk, read page by page.
// For the .cpp files of this folder only. Leaves what bounds mean to lib/block_map.hpp.
//
// Format: paged_file.hpp's; magic "wedgescope-blocks-1\n"; columns, rows, levels; the pages of level 0, row after row,
// those of level 1, and so on. A page holds 64 x 64 blocks of 16 bytes (lowest, highest, culture as floats; voids; three
// zeros).
// Memory: readers keep `most_pages` pages (4 MiB); the writer one page and its four children.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "lib/block_map.hpp"
#include "tiles/paged_file.hpp"

namespace wedgescope {

inline constexpr std::int64_t page_blocks = 64;
/// The pages of level 0 that hold the blocks of a window of posts.
constexpr Window block_pages_of(const Window& posts) {
    return {blocks_along(posts.columns, page_blocks * block_posts),
            blocks_along(posts.rows, page_blocks * block_posts)};
}

struct BlockMapShape {
    std::int64_t columns = 0, rows = 0;  ///< posts

    int levels() const;
    std::int64_t block_columns(int level) const;
    std::int64_t block_rows(int level) const;
    std::int64_t page_columns(int level) const { return (block_columns(level) + page_blocks - 1) / page_blocks; }
    std::int64_t page_rows(int level) const { return (block_rows(level) + page_blocks - 1) / page_blocks; }
    /// Number of a page in the file.
    std::uint64_t page(int level, std::int64_t column, std::int64_t row) const;
    PageLayout layout() const;
    std::uint64_t file_bytes() const { return layout().file_bytes(); }
};

/// Pages that were never written: a map that is not whole, or ground outside what the map was made for, all void.
enum class Missing { damage, voids };

using BlockPage = std::vector<BlockBounds>;  ///< page_blocks x page_blocks, row after row

class BlockMapWriter {
public:
    /// Makes the file with all its pages, or opens it with those that it has. IoError.
    BlockMapWriter(FilePart part, BlockMapShape shape, Missing missing = Missing::damage);
    /// From several threads at once, each its own pages.
    void write(int level, std::int64_t column, std::int64_t row, const BlockPage& page);
    /// True if the page is whole.
    bool holds(int level, std::int64_t column, std::int64_t row) const;
    void sync() { file_.sync(); }
    /// Levels above 0 from those below, and to disk. DataError if a page of level 0 is damaged or, unless such are voids,
    /// missing.
    void finish();

private:
    std::optional<BlockPage> read(int level, std::int64_t column, std::int64_t row) const;

    BlockMapShape shape_;
    PagedFile file_;
    Missing missing_;
};

class BlockMapFile final : public BlockMap {
public:
    /// `scale`: metres in one unit of stored culture height. DataError if the file is no map of that shape.
    /// Keeps at most `kept` pages.
    BlockMapFile(FilePart part, BlockMapShape shape, double scale, std::size_t kept = most_pages,
                 Missing missing = Missing::damage);
    int levels() const override { return shape_.levels(); }
    std::uint64_t imprint() const { return file_.imprint(); }
    BlockWindow read(int level, const Window& blocks) override;

    /// Most that all readers of one map hold.
    static constexpr std::size_t most_pages = 64;

private:
    BlockMapShape shape_;
    double scale_;
    PagedFile file_;
    PageCache cache_;
    Missing missing_;
};

/// Calls damaged(words) for each page that is not as its checksum says, or once for the header.
void check_block_map(const std::string& path, BlockMapShape shape,
                     const std::function<void(const std::string&)>& damaged);

/// Bounds of the blocks of level 0 that begin in `own`: heights and culture heights (or null) of the posts of `given`,
/// row after row, which reaches one post beyond `own` to the right and below where the raster goes on.
void bound_blocks(const Window& own, const Window& given, const float* terrain, const float* culture,
                  const std::function<BlockBounds&(std::int64_t column, std::int64_t row)>& block);

}  // namespace wedgescope
