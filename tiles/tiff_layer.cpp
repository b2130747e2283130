#include "tiles/tiff_layer.hpp"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "lib/error.hpp"
#include "tiles/file_stamp.hpp"
#include "tiles/raster_file.hpp"
#include "tiles/tiff_handle.hpp"

namespace wedgescope {
namespace {

constexpr const char* ends_early = "the file ends before it does";

}  // namespace

std::unique_ptr<TiffLayer> TiffLayer::of(const std::string& role, const std::string& path,
                                         std::shared_ptr<TileCache> cache) {
    auto found = PlainTiff::of(role, path);
    if (!found) return nullptr;
    if (!cache) cache = std::make_shared<TileCache>(0);
    std::unique_ptr<TiffLayer> layer(new TiffLayer(std::move(*found), std::move(cache)));
    // A tile that the cache does not keep would be unpacked for each window of it; GDAL keeps the one in use, however large.
    const bool left =
        layer->fills_tile_cache() && layer->cache_->most_bytes() > 0 && !layer->cache_->keeps(layer->tile_bytes());
    return left ? nullptr : std::move(layer);
}

TiffLayer::TiffLayer(PlainTiff plain, std::shared_ptr<TileCache> cache)
    : cache_(std::move(cache)), cached_as_(cache_->new_layer()), index_(std::move(plain.tiles)) {
    facts_ = std::move(plain.facts);
    const auto whole = [&](std::uint64_t bytes) { return bytes == 0 || bytes == tile_bytes(); };
    if (plain.swapped) {
        // libtiff turns them
    } else if (facts_.compression.empty() &&
               std::all_of(index_.byte_counts.begin(), index_.byte_counts.end(), whole)) {
        file_ = std::make_unique<PlainFile>(facts_.path, PlainFile::Use::read);
    } else {
        decoder_ = TileDecoder::of(facts_.path, TiffIndex{{index_}}, static_cast<std::size_t>(facts_.type_bytes));
    }
    prepare();
}

std::size_t TiffLayer::tile_bytes() const {
    return static_cast<std::size_t>(facts_.block_columns) * static_cast<std::size_t>(facts_.block_rows) *
           static_cast<std::size_t>(facts_.type_bytes);
}

ReaderBytes TiffLayer::reader_bytes() const {
    if (file_) return {rows_at_a_time() * row_bytes(), 0};
    // As the file holds it: what does not shrink may grow a little. Beside it ZSTD has its window; libtiff, which may be asked too, a
    // codec, and where all tiles lie.
    const std::size_t tile = tile_bytes(), packed = tile + tile / 64;
    constexpr std::size_t context = std::size_t{1} << 14, codec = std::size_t{1} << 16;
    if (decoder_) return {tile, packed + (facts_.compression.empty() ? 0 : tile + context) + 2 * index_bytes()};
    return {tile, packed + codec + 2 * index_bytes()};
}

std::uint64_t TiffLayer::fingerprint(const std::vector<Window>&) { return files_fingerprint(PlainTiff::files(facts_.path)); }

/// libtiff's handle, for one thread at a time.
struct TiffLayer::Reader {
    TiffTrouble trouble;  // outlives `file`, which may have something to say at its end
    TiffReader file;
    explicit Reader(const std::string& path) : file(read_tiff(path, note_trouble, say_nothing, &trouble)) {}
};

TiffLayer::~TiffLayer() = default;

std::unique_ptr<TiffLayer::Reader> TiffLayer::lend() {
    {
        const std::lock_guard lock(mutex_);
        if (!free_.empty()) {
            auto reader = std::move(free_.back());
            free_.pop_back();
            reader->trouble = {};  // of another tile
            return reader;
        }
    }
    return std::make_unique<Reader>(facts_.path);
}

/// By the decoder; where it cannot, by libtiff, which also says what is wrong. Rows below the raster are as they come: some programs
/// leave them out. IoError.
void TiffLayer::unpack(std::int64_t column, std::int64_t row, RawVector<std::byte>& values) {
    try {
        if (decoder_ && decoder_->decode(0, column, row, values, [] { return true; })) return;
    } catch (const IoError&) {  // libtiff says it again
    }
    auto reader = lend();
    const auto x = static_cast<std::uint32_t>(column * facts_.block_columns),
               y = static_cast<std::uint32_t>(row * facts_.block_rows);
    TIFF* const file = reader->file.get();
    const std::int64_t rows = std::min(facts_.block_rows, facts_.rows - row * facts_.block_rows);
    const auto bytes = static_cast<tmsize_t>(static_cast<std::size_t>(rows) * row_bytes());
    if (!file || TIFFTileSize(file) != static_cast<tmsize_t>(values.size()) ||
        TIFFReadEncodedTile(file, TIFFComputeTile(file, x, y, 0, 0), values.data(), bytes) != bytes) {
        const std::size_t number = tile_number(column, row);
        std::error_code error;
        const std::uintmax_t end = std::filesystem::file_size(facts_.path, error);
        if (!error && index_.offsets[number] + index_.byte_counts[number] > end) fail(column, row, ends_early);
        const char* const words = reader->trouble.words;
        fail(column, row, words[0] ? words : "the file was changed while it was read");
    }
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(reader));
}

TileCache::Tile TiffLayer::tile(std::int64_t column, std::int64_t row) {
    const TileCache::Key key{cached_as_, tile_number(column, row)};
    if (auto found = cache_->find(key)) return found;
    RawVector<std::byte> values(tile_bytes());
    unpack(column, row, values);
    auto kept = std::make_shared<const RawVector<std::byte>>(std::move(values));
    cache_->add(key, kept);
    return kept;
}

void TiffLayer::fail(std::int64_t column, std::int64_t row, const std::string& reason) const {
    const std::int64_t x = column * facts_.block_columns, y = row * facts_.block_rows;
    throw IoError(text(facts_.named(), ": ",
                       place({{x, std::min(facts_.columns, x + facts_.block_columns)},
                              {y, std::min(facts_.rows, y + facts_.block_rows)}}),
                       " cannot be read: ", reason));
}

void TiffLayer::read_values(const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) {
    if (window.empty()) return;
    const std::int64_t wide = facts_.block_columns, high = facts_.block_rows, size = wedgescope::type_bytes(type),
                       bytes = facts_.type_bytes;
    RawVector<std::byte> some;  // rows of a tile as they are, or one of no data
    for (std::int64_t tr = window.rows.begin / high; tr <= (window.rows.end - 1) / high; ++tr)
        for (std::int64_t tc = window.columns.begin / wide; tc <= (window.columns.end - 1) / wide; ++tc) {
            const Interval columns = intersection(window.columns, {tc * wide, (tc + 1) * wide}),
                           rows = intersection(window.rows, {tr * high, (tr + 1) * high});
            const auto take = [&](const std::byte* row, std::int64_t r) {
                convert(row + (columns.begin - tc * wide) * bytes, facts_.type,
                        static_cast<std::byte*>(out) + (r - window.rows.begin) * line_bytes +
                            (columns.begin - window.columns.begin) * size,
                        type, columns.size());
            };
            if (is_blank(tc, tr)) {
                some.resize(row_bytes());
                fill_no_data(facts_, some.data(), static_cast<std::size_t>(wide));
                for (std::int64_t r = rows.begin; r < rows.end; ++r) take(some.data(), r);
                continue;
            }
            if (!file_) {
                const TileCache::Tile values = tile(tc, tr);
                for (std::int64_t r = rows.begin; r < rows.end; ++r)
                    take(values->data() + (r - tr * high) * wide * bytes, r);
                continue;
            }
            const auto most = static_cast<std::int64_t>(rows_at_a_time());
            for (std::int64_t r = rows.begin; r < rows.end;) {
                const Interval part{r, std::min(rows.end, r + most)};
                some.resize(static_cast<std::size_t>(part.size()) * row_bytes());
                const std::uint64_t at =
                    index_.offsets[tile_number(tc, tr)] + static_cast<std::uint64_t>(r - tr * high) * row_bytes();
                try {
                    file_->read(at, some.data(), some.size());
                } catch (const IoError& e) {
                    fail(tc, tr, at + some.size() > file_->bytes() ? ends_early : e.what());
                }
                for (; r < part.end; ++r) take(some.data() + static_cast<std::size_t>(r - part.begin) * row_bytes(), r);
            }
        }
}

std::unique_ptr<RasterLayer> open_raster(const std::string& role, const std::string& path,
                                         std::shared_ptr<TileCache> cache) {
    if (auto plain = TiffLayer::of(role, path, std::move(cache))) return plain;
    return std::make_unique<RasterFile>(role, path);
}

}  // namespace wedgescope
