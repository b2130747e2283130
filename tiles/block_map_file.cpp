#include "tiles/block_map_file.hpp"

#include <algorithm>
#include <cstring>

#include "lib/error.hpp"
#include "lib/post_extremes.hpp"

namespace wedgescope {
namespace {

constexpr std::size_t block_bytes = 16;

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

std::string page_name(const PagedFile& file, int level, std::int64_t column, std::int64_t row) {
    return text(file.named(), ": the page of level ", level, ", block columns ", column * page_blocks, " to ",
                (column + 1) * page_blocks - 1, ", block rows ", row * page_blocks, " to ",
                (row + 1) * page_blocks - 1);
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

PageLayout BlockMapShape::layout() const {
    return {"block map",
            "wedgescope-blocks-1\n",
            {columns, rows, levels()},
            page_blocks * page_blocks * block_bytes,
            page(levels(), 0, 0)};
}

BlockMapWriter::BlockMapWriter(FilePart part, BlockMapShape shape, Missing missing)
    : shape_(shape), file_(std::move(part), shape.layout(), PagedFile::Use::make), missing_(missing) {}

void BlockMapWriter::write(int level, std::int64_t column, std::int64_t row, const BlockPage& page) {
    PageBytes bytes(page.size() * block_bytes);
    for (std::size_t i = 0; i < page.size(); ++i) encode(page[i], bytes.data() + i * block_bytes);
    file_.write(shape_.page(level, column, row), bytes);
}

std::optional<BlockPage> BlockMapWriter::read(int level, std::int64_t column, std::int64_t row) const {
    PageBytes bytes;
    const PagedFile::State state = file_.read(shape_.page(level, column, row), bytes);
    if (state == PagedFile::State::damaged && missing_ == Missing::voids)
        throw DataError(page_name(file_, level, column, row) + " is damaged");
    if (state != PagedFile::State::whole) return std::nullopt;
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
                bool any = false;
                // The children's pages, one after the other.
                for (std::int64_t child = 0; child < 4; ++child) {
                    const std::int64_t cc = 2 * pc + child % 2, cr = 2 * pr + child / 2;
                    if (cc >= shape_.page_columns(level - 1) || cr >= shape_.page_rows(level - 1)) continue;
                    auto below = read(level - 1, cc, cr);
                    if (!below && missing_ == Missing::damage)
                        throw DataError(page_name(file_, level - 1, cc, cr) + " is damaged");
                    any = any || below.has_value();
                    if (!below) below.emplace(page_blocks * page_blocks);
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
                if (any) write(level, pc, pr, page);
            }
    file_.sync();
}

BlockMapFile::BlockMapFile(FilePart part, BlockMapShape shape, double scale, std::size_t kept, Missing missing)
    : shape_(shape), scale_(scale), file_(std::move(part), shape.layout(), PagedFile::Use::read), cache_(file_, kept),
      missing_(missing) {}

BlockWindow BlockMapFile::read(int level, const Window& blocks) {
    BlockWindow out{blocks, std::vector<BlockBounds>(static_cast<std::size_t>(blocks.posts()))};
    if (blocks.empty()) return out;
    for (std::int64_t pr = blocks.rows.begin / page_blocks; pr <= (blocks.rows.end - 1) / page_blocks; ++pr)
        for (std::int64_t pc = blocks.columns.begin / page_blocks; pc <= (blocks.columns.end - 1) / page_blocks; ++pc) {
            const auto bytes = cache_.page(shape_.page(level, pc, pr), missing_ == Missing::voids,
                                           [&] { return page_name(file_, level, pc, pr); });
            if (!bytes) continue;
            const Interval columns = intersection(blocks.columns, {pc * page_blocks, (pc + 1) * page_blocks});
            const Interval rows = intersection(blocks.rows, {pr * page_blocks, (pr + 1) * page_blocks});
            for (std::int64_t r = rows.begin; r < rows.end; ++r)
                for (std::int64_t c = columns.begin; c < columns.end; ++c) {
                    const std::int64_t in_page = (r - pr * page_blocks) * page_blocks + c - pc * page_blocks;
                    BlockBounds b = decode(bytes->data() + static_cast<std::size_t>(in_page) * block_bytes);
                    b.culture_m = static_cast<float>(scale_ * static_cast<double>(b.culture_m));
                    out.bounds[blocks.at(c, r)] = b;
                }
        }
    return out;
}

void check_block_map(const std::string& path, BlockMapShape shape,
                     const std::function<void(const std::string&)>& damaged) {
    const PagedFile file(whole_file(path, PlainFile::Use::read), shape.layout(), PagedFile::Use::read);
    PageBytes bytes;
    for (int level = 0; level < shape.levels(); ++level)
        for (std::int64_t r = 0; r < shape.page_rows(level); ++r)
            for (std::int64_t c = 0; c < shape.page_columns(level); ++c)
                if (file.read(shape.page(level, c, r), bytes) != PagedFile::State::whole)
                    damaged(page_name(file, level, c, r) + " is damaged");
}

void bound_blocks(const Window& own, const Window& given, const float* terrain, const float* culture,
                  const std::function<BlockBounds&(std::int64_t column, std::int64_t row)>& block) {
    const Window blocks = blocks_of(own);
    for (std::int64_t br = blocks.rows.begin; br < blocks.rows.end; ++br)
        for (std::int64_t bc = blocks.columns.begin; bc < blocks.columns.end; ++bc) {
            const Window posts = intersection(given, {{bc * block_posts, (bc + 1) * block_posts + 1},
                                                      {br * block_posts, (br + 1) * block_posts + 1}});
            const PostExtremes ground = post_extremes(terrain, given, posts);
            BlockBounds b;
            b.lowest_m = ground.lowest_m;
            b.highest_m = ground.highest_m;
            if (culture) b.culture_m = std::max(b.culture_m, post_extremes(culture, given, posts).highest_m);
            b.voids = ground.voids == 0                                         ? Voids::none
                      : ground.voids == static_cast<std::size_t>(posts.posts()) ? Voids::all
                                                                                : Voids::some;
            block(bc, br) = b;
        }
}

}  // namespace wedgescope
