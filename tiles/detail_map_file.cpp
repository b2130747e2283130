#include "tiles/detail_map_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <optional>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"

namespace wedgescope {
namespace {

static_assert(std::endian::native == std::endian::little, "the store's files are little-endian");
static_assert(sizeof(Residuals) == 40, "a block of the detail map has 40 bytes");

constexpr std::size_t header_bytes = 64, blocks_of_page = detail_page_blocks * detail_page_blocks,
                      block_bytes = 2 * DetailLevels::most * sizeof(float),
                      content_bytes = blocks_of_page * block_bytes, page_bytes = content_bytes + sizeof(std::uint64_t);
constexpr char magic[] = "wedgescope-detail-1\n";

using Header = std::array<char, header_bytes>;

Header header(const DetailMapShape& shape) {
    Header out{};
    std::memcpy(out.data(), magic, sizeof(magic) - 1);
    const std::int64_t numbers[] = {shape.columns, shape.rows, detail_posts};
    std::memcpy(out.data() + 32, numbers, sizeof(numbers));
    const std::uint64_t sum = checksum(out.data(), header_bytes - sizeof(std::uint64_t));
    std::memcpy(out.data() + header_bytes - sizeof(sum), &sum, sizeof(sum));
    return out;
}

std::uint64_t number(const DetailMapShape& shape, std::int64_t column, std::int64_t row) {
    return static_cast<std::uint64_t>(row * shape.page_columns() + column);
}
std::uint64_t offset(std::uint64_t page) { return header_bytes + page * page_bytes; }

/// Nothing if its checksum does not fit.
std::optional<DetailPage> read_page(const PlainFile& file, std::uint64_t page) {
    std::vector<std::byte> bytes(page_bytes);
    file.read(offset(page), bytes.data(), bytes.size());
    std::uint64_t sum = 0;
    std::memcpy(&sum, bytes.data() + content_bytes, sizeof(sum));
    if (sum != checksum(bytes.data(), content_bytes, page)) return std::nullopt;
    DetailPage out(blocks_of_page);
    std::array<float, 2 * DetailLevels::most> pairs;
    for (std::size_t i = 0; i < out.size(); ++i) {
        std::memcpy(pairs.data(), bytes.data() + i * block_bytes, block_bytes);
        for (std::size_t k = 0; k < DetailLevels::most; ++k) {
            out[i].rms_m[k] = pairs[2 * k];
            out[i].peak_m[k] = pairs[2 * k + 1];
        }
    }
    return out;
}

std::string page_name(const std::string& path, std::int64_t column, std::int64_t row) {
    constexpr std::int64_t posts = DetailMapShape::page_posts;
    return text("detail map '", path, "': the page of columns ", column * posts, " to ", (column + 1) * posts - 1,
                ", rows ", row * posts, " to ", (row + 1) * posts - 1);
}

void check_header(const PlainFile& file, const DetailMapShape& shape) {
    if (const std::uint64_t bytes = file.bytes(); bytes != shape.file_bytes())
        throw DataError(text("detail map '", file.path(), "' has ", bytes, " bytes; accepted: ", shape.file_bytes()));
    Header found{};
    file.read(0, found.data(), found.size());
    if (found != header(shape))
        throw DataError(text("detail map '", file.path(), "': its header is damaged or of another raster than ",
                             shape.columns, " x ", shape.rows, " posts"));
}

}  // namespace

std::uint64_t DetailMapShape::file_bytes() const {
    return offset(static_cast<std::uint64_t>(page_columns() * page_rows()));
}

DetailMapWriter::DetailMapWriter(std::string path, DetailMapShape shape)
    : shape_(shape), file_(std::move(path), PlainFile::Use::write) {
    if (file_.bytes() != shape_.file_bytes()) {
        file_.resize(0);
        file_.resize(shape_.file_bytes());
    }
    const Header head = header(shape_);
    file_.write(0, head.data(), head.size());
}

void DetailMapWriter::write(std::int64_t column, std::int64_t row, const DetailPage& page) {
    std::vector<std::byte> bytes(page_bytes);
    std::array<float, 2 * DetailLevels::most> pairs;
    for (std::size_t i = 0; i < page.size(); ++i) {
        for (std::size_t k = 0; k < DetailLevels::most; ++k) {
            pairs[2 * k] = page[i].rms_m[k];
            pairs[2 * k + 1] = page[i].peak_m[k];
        }
        std::memcpy(bytes.data() + i * block_bytes, pairs.data(), block_bytes);
    }
    const std::uint64_t at = number(shape_, column, row), sum = checksum(bytes.data(), content_bytes, at);
    std::memcpy(bytes.data() + content_bytes, &sum, sizeof(sum));
    file_.write(offset(at), bytes.data(), bytes.size());
}

bool DetailMapWriter::holds(std::int64_t column, std::int64_t row) const {
    return read_page(file_, number(shape_, column, row)).has_value();
}

DetailMapFile::DetailMapFile(const std::string& path, DetailMapShape shape, int levels,
                             std::unique_ptr<BlockMap> bounds)
    : shape_(shape), levels_(levels), bounds_(std::move(bounds)), file_(path, PlainFile::Use::read) {
    check_header(file_, shape_);
}

std::shared_ptr<const DetailPage> DetailMapFile::page(std::int64_t column, std::int64_t row) {
    const std::uint64_t at = number(shape_, column, row);
    const std::lock_guard lock(mutex_);
    for (auto it = recent_.begin(); it != recent_.end(); ++it)
        if (it->first == at) {
            recent_.splice(recent_.begin(), recent_, it);
            return it->second;
        }
    auto found = read_page(file_, at);
    if (!found) throw DataError(page_name(file_.path(), column, row) + " is damaged");
    recent_.emplace_front(at, std::make_shared<const DetailPage>(std::move(*found)));
    if (recent_.size() > most_pages) recent_.pop_back();
    return recent_.front().second;
}

std::vector<Residuals> DetailMapFile::read(const Window& blocks) {
    std::vector<Residuals> out(static_cast<std::size_t>(blocks.posts()));
    if (blocks.empty()) return out;
    constexpr std::int64_t side = detail_page_blocks;
    for (std::int64_t pr = blocks.rows.begin / side; pr <= (blocks.rows.end - 1) / side; ++pr)
        for (std::int64_t pc = blocks.columns.begin / side; pc <= (blocks.columns.end - 1) / side; ++pc) {
            const auto found = page(pc, pr);
            const Interval columns = intersection(blocks.columns, {pc * side, (pc + 1) * side}),
                           rows = intersection(blocks.rows, {pr * side, (pr + 1) * side});
            for (std::int64_t r = rows.begin; r < rows.end; ++r)
                std::copy_n(found->begin() + ((r - pr * side) * side + columns.begin - pc * side), columns.size(),
                            out.begin() + ((r - blocks.rows.begin) * blocks.columns.size() + columns.begin -
                                           blocks.columns.begin));
        }
    return out;
}

void check_detail_map(const std::string& path, DetailMapShape shape,
                      const std::function<void(const std::string&)>& damaged) {
    const PlainFile file(path, PlainFile::Use::read);
    check_header(file, shape);
    for (std::int64_t r = 0; r < shape.page_rows(); ++r)
        for (std::int64_t c = 0; c < shape.page_columns(); ++c)
            if (!read_page(file, number(shape, c, r))) damaged(page_name(path, c, r) + " is damaged");
}

}  // namespace wedgescope
