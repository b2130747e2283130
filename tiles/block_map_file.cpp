#include "tiles/block_map_file.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <functional>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"

namespace wedgescope {
namespace {

static_assert(std::endian::native == std::endian::little, "the store's files are little-endian");

constexpr std::size_t header_bytes = 64, block_bytes = 16;
constexpr std::size_t content_bytes = page_blocks * page_blocks * block_bytes;
constexpr std::size_t page_bytes = content_bytes + sizeof(std::uint64_t);
constexpr char magic[] = "wedgescope-blocks-1\n";

using Header = std::array<char, header_bytes>;

Header header(const BlockMapShape& shape) {
    Header out{};
    std::memcpy(out.data(), magic, sizeof(magic) - 1);
    const std::int64_t numbers[] = {shape.columns, shape.rows, shape.levels()};
    std::memcpy(out.data() + 32, numbers, sizeof(numbers));
    const std::uint64_t sum = checksum(out.data(), header_bytes - sizeof(std::uint64_t));
    std::memcpy(out.data() + header_bytes - sizeof(sum), &sum, sizeof(sum));
    return out;
}

std::uint64_t offset(std::uint64_t page) { return header_bytes + page * page_bytes; }

void encode(const BlockBounds& b, std::byte* to) {
    const float heights[] = {b.lowest_m, b.highest_m, b.culture_m};
    std::memcpy(to, heights, sizeof(heights));
    to[12] = static_cast<std::byte>(b.voids);
    to[13] = to[14] = to[15] = std::byte{0};
}

BlockBounds decode(const std::byte* from) {
    float heights[3];
    std::memcpy(heights, from, sizeof(heights));
    return {heights[0], heights[1], heights[2], static_cast<Voids>(from[12])};
}

bool whole(const std::vector<std::byte>& page, std::uint64_t number) {
    std::uint64_t sum = 0;
    std::memcpy(&sum, page.data() + content_bytes, sizeof(sum));
    return sum == checksum(page.data(), content_bytes, number);
}

std::string page_name(const std::string& path, int level, std::int64_t column, std::int64_t row) {
    return text("block map '", path, "': the page of level ", level, ", block columns ", column * page_blocks, " to ",
                (column + 1) * page_blocks - 1, ", block rows ", row * page_blocks, " to ",
                (row + 1) * page_blocks - 1);
}

void check_header(const PlainFile& file, const BlockMapShape& shape) {
    const std::uint64_t bytes = file.bytes();
    if (bytes != shape.file_bytes())
        throw DataError(text("block map '", file.path(), "' has ", bytes, " bytes; accepted: ", shape.file_bytes()));
    Header found{};
    file.read(0, found.data(), found.size());
    if (found != header(shape))
        throw DataError(text("block map '", file.path(), "': its header is damaged or of another raster than ",
                             shape.columns, " x ", shape.rows, " posts"));
}

}  // namespace

std::int64_t BlockMapShape::block_columns(int level) const {
    const std::int64_t edge = block_posts << level;
    return (columns + edge - 1) / edge;
}

std::int64_t BlockMapShape::block_rows(int level) const {
    const std::int64_t edge = block_posts << level;
    return (rows + edge - 1) / edge;
}

int BlockMapShape::levels() const {
    int level = 0;
    while (block_columns(level) > page_blocks || block_rows(level) > page_blocks) ++level;
    return level + 1;
}

std::uint64_t BlockMapShape::page(int level, std::int64_t column, std::int64_t row) const {
    std::int64_t before = 0;
    for (int k = 0; k < level; ++k) before += page_columns(k) * page_rows(k);
    return static_cast<std::uint64_t>(before + row * page_columns(level) + column);
}

std::uint64_t BlockMapShape::file_bytes() const { return offset(page(levels(), 0, 0)); }

BlockMapWriter::BlockMapWriter(std::string path, BlockMapShape shape)
    : shape_(shape), file_(std::move(path), PlainFile::Use::write) {
    if (file_.bytes() != shape_.file_bytes()) {
        file_.resize(0);
        file_.resize(shape_.file_bytes());
    }
    const Header head = header(shape_);
    file_.write(0, head.data(), head.size());
}

void BlockMapWriter::write(int level, std::int64_t column, std::int64_t row, const BlockPage& page) {
    std::vector<std::byte> bytes(page_bytes);
    for (std::size_t i = 0; i < page.size(); ++i) encode(page[i], bytes.data() + i * block_bytes);
    const std::uint64_t number = shape_.page(level, column, row), sum = checksum(bytes.data(), content_bytes, number);
    std::memcpy(bytes.data() + content_bytes, &sum, sizeof(sum));
    file_.write(offset(number), bytes.data(), bytes.size());
}

std::optional<BlockPage> BlockMapWriter::read(int level, std::int64_t column, std::int64_t row) const {
    std::vector<std::byte> bytes(page_bytes);
    const std::uint64_t number = shape_.page(level, column, row);
    file_.read(offset(number), bytes.data(), bytes.size());
    if (!whole(bytes, number)) return std::nullopt;
    BlockPage page(page_blocks * page_blocks);
    for (std::size_t i = 0; i < page.size(); ++i) page[i] = decode(bytes.data() + i * block_bytes);
    return page;
}

bool BlockMapWriter::holds(int level, std::int64_t column, std::int64_t row) const {
    return read(level, column, row).has_value();
}

void BlockMapWriter::finish() {
    for (int level = 1; level < shape_.levels(); ++level)
        for (std::int64_t pr = 0; pr < shape_.page_rows(level); ++pr)
            for (std::int64_t pc = 0; pc < shape_.page_columns(level); ++pc) {
                BlockPage page(page_blocks * page_blocks);
                std::vector<bool> begun(page.size());
                // The children's pages, one after the other.
                for (std::int64_t child = 0; child < 4; ++child) {
                    const std::int64_t cc = 2 * pc + child % 2, cr = 2 * pr + child / 2;
                    if (cc >= shape_.page_columns(level - 1) || cr >= shape_.page_rows(level - 1)) continue;
                    const auto below = read(level - 1, cc, cr);
                    if (!below) throw DataError(page_name(file_.path(), level - 1, cc, cr) + " is damaged");
                    for (std::int64_t y = 0; y < page_blocks; ++y)
                        for (std::int64_t x = 0; x < page_blocks; ++x) {
                            if (cc * page_blocks + x >= shape_.block_columns(level - 1) ||
                                cr * page_blocks + y >= shape_.block_rows(level - 1))
                                continue;
                            const std::int64_t up =
                                (child / 2 * page_blocks + y) / 2 * page_blocks + (child % 2 * page_blocks + x) / 2;
                            const auto at = static_cast<std::size_t>(up);
                            const BlockBounds& b = (*below)[static_cast<std::size_t>(y * page_blocks + x)];
                            if (begun[at])
                                page[at].add(b);
                            else
                                page[at] = b;
                            begun[at] = true;
                        }
                }
                write(level, pc, pr, page);
            }
    file_.sync();
}

BlockMapFile::BlockMapFile(const std::string& path, BlockMapShape shape, double scale, std::size_t kept)
    : shape_(shape), scale_(scale), kept_(kept), file_(path, PlainFile::Use::read) {
    check_header(file_, shape_);
}

std::shared_ptr<const BlockMapFile::Bytes> BlockMapFile::page(int level, std::int64_t column, std::int64_t row) {
    const std::uint64_t number = shape_.page(level, column, row);
    {
        const std::lock_guard lock(mutex_);
        for (auto it = recent_.begin(); it != recent_.end(); ++it)
            if (it->first == number) {
                recent_.splice(recent_.begin(), recent_, it);
                return it->second;
            }
    }
    auto bytes = std::make_shared<Bytes>(page_bytes);
    file_.read(offset(number), bytes->data(), bytes->size());
    if (!whole(*bytes, number)) throw DataError(page_name(file_.path(), level, column, row) + " is damaged");
    const std::lock_guard lock(mutex_);
    recent_.emplace_front(number, bytes);
    if (recent_.size() > kept_) recent_.pop_back();
    return bytes;
}

BlockWindow BlockMapFile::read(int level, const Window& blocks) {
    BlockWindow out{blocks, std::vector<BlockBounds>(static_cast<std::size_t>(blocks.posts()))};
    if (blocks.empty()) return out;
    for (std::int64_t pr = blocks.rows.begin / page_blocks; pr <= (blocks.rows.end - 1) / page_blocks; ++pr)
        for (std::int64_t pc = blocks.columns.begin / page_blocks; pc <= (blocks.columns.end - 1) / page_blocks; ++pc) {
            const auto bytes = page(level, pc, pr);
            const Interval columns = intersection(blocks.columns, {pc * page_blocks, (pc + 1) * page_blocks});
            const Interval rows = intersection(blocks.rows, {pr * page_blocks, (pr + 1) * page_blocks});
            for (std::int64_t r = rows.begin; r < rows.end; ++r)
                for (std::int64_t c = columns.begin; c < columns.end; ++c) {
                    const std::int64_t in_page = (r - pr * page_blocks) * page_blocks + c - pc * page_blocks;
                    BlockBounds b = decode(bytes->data() + static_cast<std::size_t>(in_page) * block_bytes);
                    b.culture_m = static_cast<float>(scale_ * static_cast<double>(b.culture_m));
                    out.bounds[static_cast<std::size_t>((r - blocks.rows.begin) * blocks.columns.size() + c -
                                                        blocks.columns.begin)] = b;
                }
        }
    return out;
}

void check_block_map(const std::string& path, BlockMapShape shape,
                     const std::function<void(const std::string&)>& damaged) {
    const PlainFile file(path, PlainFile::Use::read);
    check_header(file, shape);
    std::vector<std::byte> bytes(page_bytes);
    for (int level = 0; level < shape.levels(); ++level)
        for (std::int64_t r = 0; r < shape.page_rows(level); ++r)
            for (std::int64_t c = 0; c < shape.page_columns(level); ++c) {
                const std::uint64_t number = shape.page(level, c, r);
                file.read(offset(number), bytes.data(), bytes.size());
                if (!whole(bytes, number)) damaged(page_name(path, level, c, r) + " is damaged");
            }
}

void bound_blocks(const Window& own, const Window& given, const float* terrain, const float* culture,
                  const std::function<BlockBounds&(std::int64_t column, std::int64_t row)>& block) {
    const std::int64_t width = given.columns.size();
    const Window blocks = blocks_of(own);
    for (std::int64_t br = blocks.rows.begin; br < blocks.rows.end; ++br)
        for (std::int64_t bc = blocks.columns.begin; bc < blocks.columns.end; ++bc) {
            const Interval columns = intersection(given.columns, {bc * block_posts, (bc + 1) * block_posts + 1});
            const Interval rows = intersection(given.rows, {br * block_posts, (br + 1) * block_posts + 1});
            BlockBounds b;
            std::int64_t none = 0;
            for (std::int64_t r = rows.begin; r < rows.end; ++r) {
                const std::int64_t first = (r - given.rows.begin) * width + columns.begin - given.columns.begin;
                for (std::int64_t i = first; i < first + columns.size(); ++i) {
                    const float z = terrain[i];
                    none += z != z;
                    b.lowest_m = z < b.lowest_m ? z : b.lowest_m;
                    b.highest_m = z > b.highest_m ? z : b.highest_m;
                }
                if (culture)
                    for (std::int64_t i = first; i < first + columns.size(); ++i)
                        b.culture_m = culture[i] > b.culture_m ? culture[i] : b.culture_m;
            }
            b.voids = none == 0 ? Voids::none : none == columns.size() * rows.size() ? Voids::all : Voids::some;
            block(bc, br) = b;
        }
}

}  // namespace wedgescope
