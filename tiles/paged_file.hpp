// PagedFile: a header and pages of one size with a checksum each, of what is known of a raster; read page by page.
// For the .cpp files of this folder only. Leaves what a page holds to block_map_file.hpp and detail_map_file.hpp.
//
// Format: a header of 64 bytes (a magic line, zeros to byte 32, three 64-bit integers, XXH3 of all that), then the pages:
// content and 8 bytes of XXH3, seeded with the page's number. Little-endian. A page never written is all zeros: damaged,
// or nothing, as the reader chooses.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "tiles/plain_file.hpp"

namespace wedgescope {

/// Where a PagedFile lies: a whole file, or the part of one from `begin` on.
struct FilePart {
    std::shared_ptr<PlainFile> file;
    std::uint64_t begin = 0;
    bool whole = true;  ///< nothing else is in the file
    const char* remedy = "";  ///< for the end of a message on damage
};
/// A whole file of that name.
FilePart whole_file(const std::string& path, PlainFile::Use use);

struct PageLayout {
    const char* what = "";   ///< for messages: "block map"
    const char* magic = "";  ///< at most 32 bytes
    std::array<std::int64_t, 3> numbers{};
    std::size_t content_bytes = 0;
    std::uint64_t pages = 0;

    std::uint64_t file_bytes() const;
};

using PageBytes = std::vector<std::byte>;

class PagedFile {
public:
    enum class Use {
        make,  ///< all pages, those not written yet all zeros; those of a file of the same size stay
        read   ///< DataError if the file is no such file
    };
    PagedFile(FilePart part, const PageLayout& layout, Use use);

    std::string named() const;  ///< "block map 'path'"
    const char* remedy() const { return part_.remedy; }
    /// From several threads at once, each its own pages.
    void write(std::uint64_t page, const PageBytes& content);
    enum class State { whole, damaged, never_written };
    State read(std::uint64_t page, PageBytes& content) const;
    void sync() { part_.file->sync(); }
    std::uint64_t pages() const { return layout_.pages; }
    /// XXH3 of all pages' sums, which tells one file from any other without its content being read.
    std::uint64_t imprint() const;

private:
    std::uint64_t offset(std::uint64_t page) const;

    FilePart part_;
    PageLayout layout_;
};

/// The pages used last, for readers in several threads.
class PageCache {
public:
    PageCache(const PagedFile& file, std::size_t most) : file_(file), most_(most) {}
    /// Null: never written, where `sparse`. DataError with name() where it is damaged.
    std::shared_ptr<const PageBytes> page(std::uint64_t number, bool sparse, const std::function<std::string()>& name);

private:
    const PagedFile& file_;
    std::size_t most_;
    std::mutex mutex_;
    std::list<std::pair<std::uint64_t, std::shared_ptr<const PageBytes>>> recent_;  ///< the last used in front
};

}  // namespace wedgescope
