// DetailMapFile: the detail map of a tile store on disk, in pages with a checksum each, read page by page.
// For the .cpp files of this folder only. Leaves what residuals mean to lib/detail.hpp.
//
// Format: a header of 64 bytes ("wedgescope-detail-1\n", zeros to byte 32, columns, rows and posts of a block as 64-bit
// integers, XXH3 of all that), then pages, row after row. A page holds 32 x 32 blocks (a sheet's) of 40 bytes: RMS and peak
// residual of levels 1 to 5 by turns, metres, as floats; then 8 bytes of XXH3, seeded with the page's number. Little-endian.
// Memory: readers keep `most_pages` pages (1.3 MiB), and a MiB of a block map of their own.
#pragma once
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "lib/detail.hpp"
#include "tiles/plain_file.hpp"

namespace wedgescope {

inline constexpr std::int64_t detail_page_blocks = 32;

struct DetailMapShape {
    std::int64_t columns = 0, rows = 0;  ///< posts

    std::int64_t page_columns() const { return (columns + page_posts - 1) / page_posts; }
    std::int64_t page_rows() const { return (rows + page_posts - 1) / page_posts; }
    std::uint64_t file_bytes() const;

    static constexpr std::int64_t page_posts = detail_page_blocks * detail_posts;
};

using DetailPage = std::vector<Residuals>;  ///< detail_page_blocks squared, row after row

class DetailMapWriter {
public:
    /// Opens or makes the file with all its pages, those not written yet damaged. IoError.
    DetailMapWriter(std::string path, DetailMapShape shape);
    /// From several threads at once, each its own pages.
    void write(std::int64_t column, std::int64_t row, const DetailPage& page);
    /// True if the page is whole.
    bool holds(std::int64_t column, std::int64_t row) const;
    void sync() { file_.sync(); }

private:
    DetailMapShape shape_;
    PlainFile file_;
};

class DetailMapFile final : public DetailMap {
public:
    /// `levels`: that the store's tiles hold. DataError if the file is no map of that shape.
    DetailMapFile(const std::string& path, DetailMapShape shape, int levels, std::unique_ptr<BlockMap> bounds);
    int levels() const override { return levels_; }
    BlockMap& bounds() override { return *bounds_; }
    std::vector<Residuals> read(const Window& blocks) override;

    static constexpr std::size_t most_pages = 32;
    static constexpr std::size_t bounds_pages = 16;  ///< that its block map may keep
    static constexpr std::size_t most_bytes =
        most_pages * detail_page_blocks * detail_page_blocks * sizeof(Residuals) + (std::size_t{1} << 20) + 1024;

private:
    std::shared_ptr<const DetailPage> page(std::int64_t column, std::int64_t row);

    DetailMapShape shape_;
    int levels_;
    std::unique_ptr<BlockMap> bounds_;
    PlainFile file_;
    std::mutex mutex_;
    std::list<std::pair<std::uint64_t, std::shared_ptr<const DetailPage>>> recent_;  ///< the last used in front
};

/// Calls damaged(words) for each page that is not as its checksum says. DataError for the header.
void check_detail_map(const std::string& path, DetailMapShape shape,
                      const std::function<void(const std::string&)>& damaged);

}  // namespace wedgescope
