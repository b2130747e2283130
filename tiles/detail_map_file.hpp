// DetailMapFile: a detail map on disk, read page by page.
// For the .cpp files of this folder only. Leaves what residuals mean to lib/detail.hpp.
//
// Format: paged_file.hpp's; magic "wedgescope-detail-2\n"; columns, rows, posts of a block; pages row after row. A page
// holds 32 x 32 blocks (a sheet's) of 60 bytes: RMS, peak and cube of the residuals of levels 1 to 5 by turns, metres, as
// floats.
// Memory: readers keep `most_pages` pages (2 MiB), and a MiB of a block map of their own.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "lib/detail.hpp"
#include "tiles/block_map_file.hpp"
#include "tiles/paged_file.hpp"

namespace wedgescope {

inline constexpr std::int64_t detail_page_blocks = 32;
inline constexpr int detail_map_format = 2;

struct DetailMapShape {
    std::int64_t columns = 0, rows = 0;  ///< posts

    std::int64_t page_columns() const { return (columns + page_posts - 1) / page_posts; }
    std::int64_t page_rows() const { return (rows + page_posts - 1) / page_posts; }
    PageLayout layout() const;
    std::uint64_t file_bytes() const { return layout().file_bytes(); }

    static constexpr std::int64_t page_posts = detail_page_blocks * detail_posts;
};

using DetailPage = std::vector<Residuals>;  ///< detail_page_blocks squared, row after row

class DetailMapWriter {
public:
    /// Makes the file with all its pages, or opens it with those that it has. IoError.
    DetailMapWriter(FilePart part, DetailMapShape shape);
    /// From several threads at once, each its own pages.
    void write(std::int64_t column, std::int64_t row, const DetailPage& page);
    /// True if the page is whole.
    bool holds(std::int64_t column, std::int64_t row) const;
    void sync() { file_.sync(); }

private:
    DetailMapShape shape_;
    PagedFile file_;
};

class DetailMapFile final : public DetailMap {
public:
    /// DataError if the file is no map of that shape.
    DetailMapFile(FilePart part, DetailMapShape shape, std::unique_ptr<BlockMap> bounds,
                  Missing missing = Missing::damage);
    BlockMap& bounds() override { return *bounds_; }
    std::uint64_t imprint() const { return file_.imprint(); }
    std::vector<Residuals> read(const Window& blocks) override;

    static constexpr std::size_t most_pages = 32;
    static constexpr std::size_t bounds_pages = 16;  ///< that its block map may keep
    static constexpr std::size_t most_bytes =
        most_pages * detail_page_blocks * detail_page_blocks * sizeof(Residuals) + (std::size_t{1} << 20) + 1024;

private:
    DetailMapShape shape_;
    std::unique_ptr<BlockMap> bounds_;
    PagedFile file_;
    PageCache cache_;
    Missing missing_;
};

/// Calls damaged(words) for each page that is not as its checksum says. DataError for the header.
void check_detail_map(const std::string& path, DetailMapShape shape,
                      const std::function<void(const std::string&)>& damaged);

/// Residuals of the blocks that begin in `own`: heights of the posts of `given`, row after row, which reaches one post
/// beyond `own` to the right and below where the raster goes on. Into the page
/// that holds `page_posts`.
void find_residuals(const Window& own, const Window& given, const float* terrain, const Window& page_posts,
                    DetailPage& page);

}  // namespace wedgescope
