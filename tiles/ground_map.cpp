#include "tiles/ground_map.hpp"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <limits>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

#include "lib/error.hpp"
#include "lib/stop.hpp"
#include "lib/threads.hpp"
#include "tiles/block_map_file.hpp"
#include "tiles/checksum.hpp"
#include "tiles/detail_map_file.hpp"
#include "tiles/file_stamp.hpp"
#include "tiles/needed_posts.hpp"
#include "tiles/output_file.hpp"
#include "tiles/registered_layer.hpp"
#include "tiles/sources.hpp"
#include "tiles/spill.hpp"
#include "tiles/tiff_layer.hpp"
#include "tiles/tile_store.hpp"

namespace wedgescope {
namespace {

constexpr char magic[] = "wedgescope-ground-2\n";
constexpr std::uint64_t header_bytes = 128;

/// True if a file was to be a ground map, of any version: it begins as one does, as far as it goes. An empty one does.
bool begins_as_map(const PlainFile& file) {
    constexpr std::string_view name = "wedgescope-ground-";
    static_assert(std::string_view(magic).starts_with(name));
    std::array<char, name.size()> found{};
    const auto there = static_cast<std::size_t>(std::min<std::uint64_t>(file.bytes(), name.size()));
    file.read(0, found.data(), there);
    return std::string_view(found.data(), there) == name.substr(0, there);
}

struct Header {
    char magic[32];
    std::int64_t columns, rows;
    std::uint64_t terrain, culture_height;  ///< checksums of their files' stamps; 0: none
    std::uint64_t any_valid, void_posts;
    double lowest_m, highest_m;
    std::uint64_t zeros[3];
    std::uint64_t sum;
};
static_assert(sizeof(Header) == header_bytes, "the header of a ground map has 128 bytes");

std::uint64_t sum_of(const Header& h) { return checksum(&h, header_bytes - sizeof(h.sum)); }

std::uint64_t stamp(const std::string& path) { return path.empty() ? 0 : stamps_checksum(file_stamps(path)); }

std::unique_ptr<RasterLayer> open_terrain(const DataBaseParams& rasters, const std::shared_ptr<TileCache>& cache) {
    if (is_tile_store(rasters.dem)) return TileStore(rasters.dem, cache).layer(StoreLayerKind::dem);
    return open_raster("dem", rasters.dem, cache);
}

/// Reads ground, page by page of the detail map, into both maps.
class GroundSurvey {
public:
    GroundSurvey(const DataBaseParams& rasters, const GroundMap::MakeParams& params)
        : params_(params), tiles_(std::make_shared<TileCache>(rasters.cache_bytes / 2)),
          terrain_(open_terrain(rasters, tiles_)), facts_(terrain_->facts()) {
        if (!rasters.culture_height.empty())
            height_ = std::make_unique<RegisteredLayer>(
                open_raster("culture-height", rasters.culture_height, tiles_), facts_);
    }

    const RasterFacts& facts() const { return facts_; }

    void run(BlockMapWriter& blocks, DetailMapWriter& detail) {
        const Window all{{0, facts_.columns}, {0, facts_.rows}},
            wanted = params_.posts ? intersection(*params_.posts, all) : all;
        Pages pages;
        for (std::int64_t r = wanted.rows.begin / side * side; r < wanted.rows.end; r += side)
            for (std::int64_t c = wanted.columns.begin / side * side; c < wanted.columns.end; c += side)
                pages.windows.push_back(intersection({{c, c + side}, {r, r + side}}, all));
        if (pages.windows.empty()) return;
        for (const Window& page : pages.windows)
            pages.strips += static_cast<std::size_t>((page.rows.size() + detail_posts - 1) / detail_posts);
        Threads(threads()).execute([&] {
            if (reads_bands(pages)) return survey_bands(pages, blocks, detail);
            oneapi::tbb::parallel_for(
                oneapi::tbb::blocked_range<std::size_t>(0, pages.windows.size(), 1),
                [&](const auto& part) {
                    for (std::size_t i = part.begin(); i < part.end(); ++i) {
                        Page page(pages.windows[i]);
                        for (std::int64_t r = page.posts.rows.begin; r < page.posts.rows.end; r += detail_posts) {
                            survey(page, r, nullptr);
                            progress(pages);
                        }
                        page.write(blocks, detail);
                    }
                },
                oneapi::tbb::simple_partitioner());
        });
    }

    Extremes extremes() const { return extremes_of(extremes_); }

private:
    static constexpr std::int64_t side = DetailMapShape::page_posts;

    /// All pages, row after row of them.
    struct Pages {
        std::vector<Window> windows;
        std::size_t strips = 0, done = 0;  ///< of detail_posts rows
        std::mutex mutex;
    };
    void progress(Pages& pages) const {
        const std::lock_guard lock(pages.mutex);
        if (params_.progress) params_.progress(static_cast<double>(++pages.done) / static_cast<double>(pages.strips));
    }

    /// One page of the detail map, and those of the block map below it, in the making.
    struct Page {
        Window posts, block_pages;
        std::vector<BlockPage> bounds;
        DetailPage found = DetailPage(detail_page_blocks * detail_page_blocks);

        explicit Page(const Window& window)
            : posts(window), block_pages{{window.columns.begin / block_page_posts, up(window.columns.end)},
                                         {window.rows.begin / block_page_posts, up(window.rows.end)}},
              bounds(static_cast<std::size_t>(block_pages.posts()), BlockPage(page_blocks * page_blocks)) {}
        BlockPage& block_page(std::int64_t column, std::int64_t row) { return bounds[block_pages.at(column, row)]; }
        BlockBounds& bound_at(std::int64_t c, std::int64_t r) {
            return block_page(
                c / page_blocks,
                r / page_blocks)[static_cast<std::size_t>(r % page_blocks * page_blocks + c % page_blocks)];
        }
        void write(BlockMapWriter& blocks, DetailMapWriter& detail) {
            for (std::int64_t r = block_pages.rows.begin; r < block_pages.rows.end; ++r)
                for (std::int64_t c = block_pages.columns.begin; c < block_pages.columns.end; ++c)
                    blocks.write(0, c, r, block_page(c, r));
            detail.write(posts.columns.begin / side, posts.rows.begin / side, found);
        }
    };

    /// Heights of a window, and culture's where there are any.
    struct Heights {
        Window window;
        std::vector<float> posts, culture;
        void resize(bool with_culture) {
            posts.resize(static_cast<std::size_t>(window.posts()));
            if (with_culture) culture.resize(posts.size());
        }
    };

    static constexpr std::size_t strip_bytes =
        static_cast<std::size_t>((detail_posts + 1) * (side + 1)) * sizeof(float);
    std::size_t thread_bytes() const {
        return 3 * strip_bytes + terrain_->reader_bytes().decoded + terrain_->reader_bytes().packed;
    }
    /// As many as have room for what each holds.
    int threads() const {
        const std::size_t room = params_.memory_bytes / 2 / thread_bytes();
        return std::clamp(static_cast<int>(std::min<std::size_t>(room, 1024)), 1, std::max(1, params_.threads));
    }

    /// Of blocks wider than a page (strips) all pages of a row ask for the same, and would unpack it each for itself: rows are read
    /// once for all of them, where there is room for a band.
    bool reads_bands(const Pages& pages) const {
        const Interval columns = across(pages);
        const std::size_t band = static_cast<std::size_t>((detail_posts + 1) * (columns.size() + 1)) * sizeof(float),
                          page =
                              sizeof(BlockBounds) * static_cast<std::size_t>(side * side / block_posts / block_posts),
                          needed = band * (height_ ? 2 : 1) +
                                   page * static_cast<std::size_t>(columns.size() / side + 1) +
                                   static_cast<std::size_t>(threads()) * thread_bytes();
        return facts_.block_columns > side && columns.size() > side && needed <= params_.memory_bytes / 2;
    }
    static Interval across(const Pages& pages) {
        return {pages.windows.front().columns.begin, pages.windows.back().columns.end};
    }

    void survey_bands(Pages& pages, BlockMapWriter& blocks, DetailMapWriter& detail) {
        const Interval columns = across(pages);
        const std::size_t a_row = static_cast<std::size_t>((columns.end - 1) / side - columns.begin / side + 1);
        Heights band;
        for (std::size_t first = 0; first < pages.windows.size(); first += a_row) {
            std::vector<Page> row(pages.windows.begin() + static_cast<std::ptrdiff_t>(first),
                                  pages.windows.begin() + static_cast<std::ptrdiff_t>(first + a_row));
            const Interval rows = row.front().posts.rows;
            for (std::int64_t r = rows.begin; r < rows.end; r += detail_posts) {
                const std::int64_t end = std::min(r + detail_posts, rows.end);
                band.window = {{columns.begin, std::min(columns.end + 1, facts_.columns)},
                               {r, std::min(end + 1, facts_.rows)}};
                read_band(band);
                oneapi::tbb::parallel_for(
                    oneapi::tbb::blocked_range<std::size_t>(0, a_row, 1),
                    [&](const auto& part) {
                        for (std::size_t i = part.begin(); i < part.end(); ++i) {
                            survey(row[i], r, &band);
                            progress(pages);
                        }
                    },
                    oneapi::tbb::simple_partitioner());
            }
            for (Page& page : row) page.write(blocks, detail);
        }
    }

    /// Rows of one block, or of several, by one thread.
    void read_band(Heights& band) {
        const std::int64_t width = band.window.columns.size(), least = 8,
                           together = std::max(terrain_->rows_decoded_together(), least);
        band.resize(height_ != nullptr);
        const Interval groups{band.window.rows.begin / together, (band.window.rows.end - 1) / together + 1};
        oneapi::tbb::parallel_for(
            oneapi::tbb::blocked_range<std::int64_t>(groups.begin, groups.end, 1),
            [&](const auto& part) {
                for (std::int64_t g = part.begin(); g < part.end(); ++g) {
                    const Window some{band.window.columns,
                                      intersection({g * together, (g + 1) * together}, band.window.rows)};
                    const std::int64_t at = (some.rows.begin - band.window.rows.begin) * width;
                    read(some, band.posts.data() + at, height_ ? band.culture.data() + at : nullptr);
                }
            },
            oneapi::tbb::simple_partitioner());
    }

    /// The rows of a page from `r` on that residuals are found for together. `band`: holds them; null: they are read.
    void survey(Page& page, std::int64_t r, const Heights* band) {
        if (params_.stop) params_.stop->check();
        const auto bound_at = [&](std::int64_t column, std::int64_t row) -> BlockBounds& {
            return page.bound_at(column, row);
        };
        const Window own{page.posts.columns, {r, std::min(r + detail_posts, page.posts.rows.end)}};
        Heights given;
        given.window = {{own.columns.begin, std::min(own.columns.end + 1, facts_.columns)},
                        {own.rows.begin, std::min(own.rows.end + 1, facts_.rows)}};
        take(given, band);
        const auto culture = [&] { return height_ ? given.culture.data() : nullptr; };
        note(own, given.window, given.posts);
        bound_blocks(own, given.window, given.posts.data(), culture(), bound_at);
        find_residuals(own, given.window, given.posts.data(), page.posts, page.found);
        if (facts_.cycle_columns() != facts_.columns || page.posts.columns.end != facts_.columns) return;
        // The post after the last column is column 0: it widens the bounds of the last blocks.
        const Window as_if{{facts_.columns, facts_.columns + 1}, given.window.rows},
            last{{(facts_.columns - 1) / block_posts * block_posts, facts_.columns}, own.rows};
        given.window.columns = {0, 1};
        take(given, band);
        std::vector<BlockBounds> edge(static_cast<std::size_t>(blocks_of(last).rows.size()));
        const std::int64_t top = blocks_of(last).rows.begin;
        bound_blocks(last, as_if, given.posts.data(), culture(), [&](std::int64_t, std::int64_t row) -> BlockBounds& {
            return edge[static_cast<std::size_t>(row - top)];
        });
        for (std::size_t i = 0; i < edge.size(); ++i)
            bound_at(blocks_of(last).columns.begin, top + static_cast<std::int64_t>(i)).add(edge[i]);
    }

    /// From the band, or else by reading.
    void take(Heights& heights, const Heights* band) {
        if (!band || intersection(heights.window, band->window) != heights.window) {
            heights.resize(height_ != nullptr);
            return read(heights.window, heights.posts.data(), heights.culture.data());
        }
        const Window &window = heights.window, &all = band->window;
        const auto part_of = [&](const std::vector<float>& from, std::vector<float>& to) {
            to.clear();
            for (std::int64_t r = window.rows.begin; r < window.rows.end; ++r) {
                const auto begin = from.begin() + static_cast<std::ptrdiff_t>(all.at(window.columns.begin, r));
                to.insert(to.end(), begin, begin + window.columns.size());
            }
        };
        part_of(band->posts, heights.posts);
        if (height_) part_of(band->culture, heights.culture);
    }

    /// Row after row.
    void read(const Window& window, float* posts, float* culture) {
        terrain_->read_heights(window, posts, window.columns.size());
        if (!height_) return;
        const ChunkRequest everything;
        std::vector<float> scratch;
        height_->read_heights(height_->plan(window.columns), window.rows, 1, NeededPosts(everything), culture, scratch);
    }

    /// Extremes of what is the page's own; the column that repeats the first is nobody's.
    void note(const Window& own, const Window& given, const std::vector<float>& posts) {
        const PostExtremes found =
            post_extremes(posts.data(), given, {intersection(own.columns, {0, facts_.own_columns()}), own.rows});
        const std::lock_guard lock(mutex_);
        extremes_.add(found);
    }

    static constexpr std::int64_t block_page_posts = page_blocks * block_posts;
    static std::int64_t up(std::int64_t post) { return (post + block_page_posts - 1) / block_page_posts; }

    const GroundMap::MakeParams& params_;
    std::shared_ptr<TileCache> tiles_;
    std::unique_ptr<RasterLayer> terrain_;
    std::unique_ptr<RegisteredLayer> height_;
    const RasterFacts facts_;
    std::mutex mutex_;
    PostExtremes extremes_;
};

}  // namespace

GroundMap::GroundMap(std::unique_ptr<FilePart> blocks, std::int64_t columns, std::int64_t rows, bool partial)
    : part_(std::move(blocks)), columns_(columns), rows_(rows), partial_(partial) {}

GroundMap::~GroundMap() = default;

std::unique_ptr<BlockMap> GroundMap::block_map(double scale) const {
    return std::make_unique<BlockMapFile>(*part_, BlockMapShape{columns_, rows_}, scale, BlockMapFile::most_pages,
                                          partial_ ? Missing::voids : Missing::damage);
}

std::unique_ptr<DetailMap> GroundMap::detail_map(double scale) const {
    const BlockMapShape shape{columns_, rows_};
    const Missing missing = partial_ ? Missing::voids : Missing::damage;
    FilePart after = *part_;
    after.begin += shape.file_bytes();
    return std::make_unique<DetailMapFile>(
        after, DetailMapShape{columns_, rows_},
        std::make_unique<BlockMapFile>(*part_, shape, scale, DetailMapFile::bounds_pages, missing), missing);
}

std::string GroundMap::kept_path(const DataBaseParams& rasters) {
    std::string path = rasters.dem;
    while (path.size() > 1 && path.back() == '/') path.pop_back();
    return path + ".ground";
}

std::shared_ptr<const GroundMap> GroundMap::make(const DataBaseParams& rasters, const MakeParams& params) {
    // Before the rasters are opened to be read: who opens one goes on reading it, whatever comes in its place.
    const std::array<std::uint64_t, 2> stamps{stamp(rasters.dem), stamp(rasters.culture_height)};
    GroundSurvey survey(rasters, params);
    const RasterFacts& facts = survey.facts();
    const BlockMapShape shape{facts.columns, facts.rows};
    const DetailMapShape detail_shape{facts.columns, facts.rows};
    std::optional<OutputFile> output;
    if (params.keep) output.emplace(kept_path(rasters), true);
    auto file = output
                    ? std::make_shared<PlainFile>(output->temporary_path(), PlainFile::Use::write, output->final_path())
                    : std::make_shared<PlainFile>(PlainFile::Unnamed{
                          params.temp_folder.empty() ? temporary_folder() : params.temp_folder, "the ground map"});
    const bool partial = params.posts.has_value();
    const FilePart part{file, header_bytes, false};
    const FilePart after{file, header_bytes + shape.file_bytes(), false};
    {
        BlockMapWriter blocks(part, shape, partial ? Missing::voids : Missing::damage);
        DetailMapWriter detail(after, detail_shape);
        survey.run(blocks, detail);
        blocks.finish();
        detail.sync();
    }
    if (stamps != std::array<std::uint64_t, 2>{stamp(rasters.dem), stamp(rasters.culture_height)})
        throw DataError(text("'", rasters.dem,
                             "' or its culture height changed while it was read; run again when it is "
                             "at rest"));
    const Extremes extremes = survey.extremes();
    if (output) {
        Header h{};
        std::memcpy(h.magic, magic, sizeof(magic) - 1);
        h.columns = facts.columns;
        h.rows = facts.rows;
        h.terrain = stamps[0];
        h.culture_height = stamps[1];
        h.any_valid = extremes.any_valid ? 1 : 0;
        h.void_posts = extremes.void_posts;
        h.lowest_m = static_cast<double>(extremes.lowest_m);
        h.highest_m = static_cast<double>(extremes.highest_m);
        h.sum = sum_of(h);
        file->write(0, &h, sizeof h);
        file->sync();
        output->commit();
        return kept(rasters);
    }
    std::shared_ptr<GroundMap> made(
        new GroundMap(std::make_unique<FilePart>(part), facts.columns, facts.rows, partial));
    if (!partial) made->extremes_ = extremes;
    return made;
}

void GroundMap::check_place(const DataBaseParams& rasters) {
    const std::string path = kept_path(rasters);
    OutputFile::check(path, true);
    if (!std::filesystem::exists(path)) return;
    const PlainFile file(path, PlainFile::Use::read);
    if (!begins_as_map(file))
        throw InputError(text("keep-map: '", path, "' is a file of ", file.bytes(),
                              " bytes that is no ground map; move it away, or add --overwrite"));
}

bool GroundMap::whole(const Stop& stop) const {
    const BlockMapShape shape{columns_, rows_};
    FilePart after = *part_;
    after.begin += shape.file_bytes();
    PageBytes bytes;
    for (const PagedFile& file : {PagedFile(*part_, shape.layout(), PagedFile::Use::read),
                                  PagedFile(after, DetailMapShape{columns_, rows_}.layout(), PagedFile::Use::read)})
        for (std::uint64_t page = 0; page < file.pages(); ++page) {
            stop.check();
            if (file.read(page, bytes) != PagedFile::State::whole) return false;
        }
    return true;
}

std::shared_ptr<const GroundMap> GroundMap::kept(const DataBaseParams& rasters, std::string* unfit) {
    const std::string path = kept_path(rasters);
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(path, ignored)) return nullptr;
    const auto refuse = [&](const std::string& why) {
        if (unfit) *unfit = text("the ground map '", path, "' ", why, " (keep-map makes it anew)");
        return nullptr;
    };
    try {
        auto file = std::make_shared<PlainFile>(path, PlainFile::Use::read);
        Header h{};
        if (!begins_as_map(*file)) {
            if (unfit) *unfit = text("'", path, "', which is no ground map");
            return nullptr;
        }
        if (file->bytes() < header_bytes) return refuse("is damaged");
        file->read(0, &h, sizeof h);
        if (std::memcmp(h.magic, magic, sizeof(magic) - 1) != 0 || h.sum != sum_of(h))
            return refuse("is damaged or of another version");
        if (h.terrain != stamp(rasters.dem) || h.culture_height != stamp(rasters.culture_height))
            return refuse("is of other rasters, or of these before they were changed");
        FilePart part{std::move(file), header_bytes, false};
        part.remedy = "; remove that file, or let keep-map make it anew";
        std::shared_ptr<GroundMap> found(
            new GroundMap(std::make_unique<FilePart>(std::move(part)), h.columns, h.rows, false));
        found->extremes_ =
            Extremes{static_cast<float>(h.lowest_m), static_cast<float>(h.highest_m), h.void_posts, h.any_valid != 0};
        found->path_ = path;
        found->detail_map(1);  // DataError unless both maps are there
        return found;
    } catch (const DataError&) {
        return refuse("is damaged");
    } catch (const IoError& e) {
        return refuse(text("cannot be read: ", e.what()));
    }
}

}  // namespace wedgescope
