#include "tiles/detail_map_file.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

static_assert(sizeof(Residuals) == 60, "a block of the detail map has 60 bytes");

constexpr std::size_t blocks_of_page = detail_page_blocks * detail_page_blocks,
                      block_bytes = 3 * DetailLevels::most * sizeof(float);

using Numbers = std::array<float, 3 * DetailLevels::most>;

Residuals decode(const std::byte* from) {
    Numbers n;
    std::memcpy(n.data(), from, block_bytes);
    Residuals out;
    for (std::size_t k = 0; k < DetailLevels::most; ++k) {
        out.rms_m[k] = n[3 * k];
        out.peak_m[k] = n[3 * k + 1];
        out.cube_m[k] = n[3 * k + 2];
    }
    return out;
}

void encode(const Residuals& r, std::byte* to) {
    Numbers n;
    for (std::size_t k = 0; k < DetailLevels::most; ++k) {
        n[3 * k] = r.rms_m[k];
        n[3 * k + 1] = r.peak_m[k];
        n[3 * k + 2] = r.cube_m[k];
    }
    std::memcpy(to, n.data(), block_bytes);
}

std::uint64_t number(const DetailMapShape& shape, std::int64_t column, std::int64_t row) {
    return static_cast<std::uint64_t>(row * shape.page_columns() + column);
}

std::string page_name(const PagedFile& file, std::int64_t column, std::int64_t row) {
    constexpr std::int64_t posts = DetailMapShape::page_posts;
    return text(file.named(), ": the page of columns ", column * posts, " to ", (column + 1) * posts - 1, ", rows ",
                row * posts, " to ", (row + 1) * posts - 1);
}

}  // namespace

PageLayout DetailMapShape::layout() const {
    return {"detail map",
            "wedgescope-detail-2\n",
            {columns, rows, detail_posts},
            blocks_of_page * block_bytes,
            static_cast<std::uint64_t>(page_columns() * page_rows())};
}

DetailMapWriter::DetailMapWriter(FilePart part, DetailMapShape shape)
    : shape_(shape), file_(std::move(part), shape.layout(), PagedFile::Use::make) {}

void DetailMapWriter::write(std::int64_t column, std::int64_t row, const DetailPage& page) {
    PageBytes bytes(page.size() * block_bytes);
    for (std::size_t i = 0; i < page.size(); ++i) encode(page[i], bytes.data() + i * block_bytes);
    file_.write(number(shape_, column, row), bytes);
}

bool DetailMapWriter::holds(std::int64_t column, std::int64_t row) const {
    PageBytes bytes;
    return file_.read(number(shape_, column, row), bytes) == PagedFile::State::whole;
}

DetailMapFile::DetailMapFile(FilePart part, DetailMapShape shape, std::unique_ptr<BlockMap> bounds, Missing missing)
    : shape_(shape), bounds_(std::move(bounds)), file_(std::move(part), shape.layout(), PagedFile::Use::read),
      cache_(file_, most_pages), missing_(missing) {}

std::vector<Residuals> DetailMapFile::read(const Window& blocks) {
    std::vector<Residuals> out(static_cast<std::size_t>(blocks.posts()));
    if (blocks.empty()) return out;
    constexpr std::int64_t side = detail_page_blocks;
    for (std::int64_t pr = blocks.rows.begin / side; pr <= (blocks.rows.end - 1) / side; ++pr)
        for (std::int64_t pc = blocks.columns.begin / side; pc <= (blocks.columns.end - 1) / side; ++pc) {
            const auto bytes = cache_.page(number(shape_, pc, pr), missing_ == Missing::voids,
                                           [&] { return page_name(file_, pc, pr); });
            if (!bytes) continue;
            const Interval columns = intersection(blocks.columns, {pc * side, (pc + 1) * side}),
                           rows = intersection(blocks.rows, {pr * side, (pr + 1) * side});
            for (std::int64_t r = rows.begin; r < rows.end; ++r)
                for (std::int64_t c = columns.begin; c < columns.end; ++c)
                    out[blocks.at(c, r)] = decode(
                        bytes->data() + static_cast<std::size_t>((r - pr * side) * side + c - pc * side) * block_bytes);
        }
    return out;
}

void check_detail_map(const std::string& path, DetailMapShape shape,
                      const std::function<void(const std::string&)>& damaged) {
    const PagedFile file(whole_file(path, PlainFile::Use::read), shape.layout(), PagedFile::Use::read);
    PageBytes bytes;
    for (std::int64_t r = 0; r < shape.page_rows(); ++r)
        for (std::int64_t c = 0; c < shape.page_columns(); ++c)
            if (file.read(number(shape, c, r), bytes) != PagedFile::State::whole)
                damaged(page_name(file, c, r) + " is damaged");
}

void find_residuals(const Window& own, const Window& given, const float* terrain, const Window& page_posts,
                    DetailPage& page) {
    const std::int64_t width = given.columns.size();
    for (std::int64_t r = own.rows.begin; r < own.rows.end; r += detail_posts)
        for (std::int64_t c = own.columns.begin; c < own.columns.end; c += detail_posts) {
            const std::int64_t x = (c - page_posts.columns.begin) / detail_posts,
                               y = (r - page_posts.rows.begin) / detail_posts;
            page[static_cast<std::size_t>(y * detail_page_blocks + x)] = residuals(
                terrain + (r - given.rows.begin) * width + c - given.columns.begin, width,
                std::min(given.columns.end - c, detail_posts + 1), std::min(given.rows.end - r, detail_posts + 1));
        }
}

}  // namespace wedgescope
