#include "tiles/paged_file.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"

namespace wedgescope {
namespace {

static_assert(std::endian::native == std::endian::little, "maps are little-endian");

constexpr std::size_t page_header_bytes = 64, sum_bytes = sizeof(std::uint64_t);

using PageHeader = std::array<char, page_header_bytes>;

PageHeader header(const PageLayout& layout) {
    PageHeader out{};
    std::memcpy(out.data(), layout.magic, std::strlen(layout.magic));
    std::memcpy(out.data() + 32, layout.numbers.data(), sizeof(layout.numbers));
    const std::uint64_t sum = checksum(out.data(), page_header_bytes - sum_bytes);
    std::memcpy(out.data() + page_header_bytes - sum_bytes, &sum, sum_bytes);
    return out;
}

}  // namespace

FilePart whole_file(const std::string& path, PlainFile::Use use) { return {std::make_shared<PlainFile>(path, use)}; }

std::uint64_t PageLayout::file_bytes() const { return page_header_bytes + pages * (content_bytes + sum_bytes); }

std::uint64_t PagedFile::offset(std::uint64_t page) const {
    return part_.begin + page_header_bytes + page * (layout_.content_bytes + sum_bytes);
}

std::string PagedFile::named() const { return text(layout_.what, " ", part_.file->named()); }

PagedFile::PagedFile(FilePart part, const PageLayout& layout, Use use) : part_(std::move(part)), layout_(layout) {
    PlainFile& file = *part_.file;
    const std::uint64_t end = part_.begin + layout_.file_bytes(), bytes = file.bytes();
    const PageHeader head = header(layout_);
    if (use == Use::make) {
        if (part_.whole && bytes != end) file.resize(0);
        if (part_.whole ? bytes != end : bytes < end) file.resize(end);
        file.write(part_.begin, head.data(), head.size());
        return;
    }
    if (part_.whole ? bytes != end : bytes < end)
        throw DataError(text(named(), " has ", bytes, " bytes; accepted: ", end));
    PageHeader found{};
    file.read(part_.begin, found.data(), found.size());
    if (found != head)
        throw DataError(text(named(), ": its header is damaged or of another raster than ", layout_.numbers[0], " x ",
                             layout_.numbers[1], " posts"));
}

void PagedFile::write(std::uint64_t page, const PageBytes& content) {
    PageBytes bytes = content;
    const std::uint64_t sum = checksum(content.data(), content.size(), page);
    bytes.resize(content.size() + sum_bytes);
    std::memcpy(bytes.data() + content.size(), &sum, sum_bytes);
    part_.file->write(offset(page), bytes.data(), bytes.size());
}

PagedFile::State PagedFile::read(std::uint64_t page, PageBytes& content) const {
    content.resize(layout_.content_bytes + sum_bytes);
    part_.file->read(offset(page), content.data(), content.size());
    std::uint64_t sum = 0;
    std::memcpy(&sum, content.data() + layout_.content_bytes, sum_bytes);
    content.resize(layout_.content_bytes);
    if (sum == checksum(content.data(), content.size(), page)) return State::whole;
    const bool zeros =
        sum == 0 && std::all_of(content.begin(), content.end(), [](std::byte b) { return b == std::byte{0}; });
    return zeros ? State::never_written : State::damaged;
}

std::uint64_t PagedFile::imprint() const {
    std::vector<std::uint64_t> sums(layout_.pages);
    for (std::uint64_t page = 0; page < layout_.pages; ++page)
        part_.file->read(offset(page) + layout_.content_bytes, &sums[page], sum_bytes);
    return checksum(sums.data(), sums.size() * sum_bytes);
}

std::shared_ptr<const PageBytes> PageCache::page(std::uint64_t number, bool sparse,
                                                 const std::function<std::string()>& name) {
    const auto kept = [&]() -> std::shared_ptr<const PageBytes> {
        for (auto it = recent_.begin(); it != recent_.end(); ++it)
            if (it->first == number) {
                recent_.splice(recent_.begin(), recent_, it);
                return it->second;
            }
        return nullptr;
    };
    {
        const std::lock_guard lock(mutex_);
        if (auto found = kept()) return found;
    }
    auto bytes = std::make_shared<PageBytes>();
    const PagedFile::State state = file_.read(number, *bytes);
    if (state == PagedFile::State::never_written && sparse) return nullptr;
    if (state != PagedFile::State::whole) throw DataError(name() + " is damaged" + file_.remedy());
    const std::lock_guard lock(mutex_);
    if (auto found = kept()) return found;  // another thread read it meanwhile
    recent_.emplace_front(number, bytes);
    if (recent_.size() > most_) recent_.pop_back();
    return bytes;
}

}  // namespace wedgescope
