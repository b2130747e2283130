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
    return of(PlainTiff::of(role, path), std::move(cache));
}

std::unique_ptr<TiffLayer> TiffLayer::of(std::unique_ptr<RasterFile>& told, std::shared_ptr<TileCache> cache) {
    auto layer = of(PlainTiff::as_told(told->facts()), std::move(cache));
    if (layer) {
        told->close_idle();
        layer->told_by_ = std::move(told);
    }
    return layer;
}

std::unique_ptr<TiffLayer> TiffLayer::of(std::optional<PlainTiff> found, std::shared_ptr<TileCache> cache) {
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
    const std::int64_t across = (facts_.columns - 1) / facts_.block_columns + 1;
    const auto whole = [&] {
        for (std::size_t i = 0; i < index_.byte_counts.size(); ++i) {
            const std::uint64_t bytes = index_.byte_counts[i];
            const std::int64_t rows =
                index_.strips ? rows_in(static_cast<std::int64_t>(i) / across) : facts_.block_rows;
            if (bytes != 0 && bytes != static_cast<std::size_t>(rows) * row_bytes()) return false;
        }
        return true;
    };
    if (plain.swapped) {
        // libtiff turns them
    } else if (facts_.compression.empty() && whole()) {
        file_ = std::make_unique<PlainFile>(facts_.path, PlainFile::Use::read);
        facts_.rows_in_parts = index_.strips;
    } else if (!index_.strips) {
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

std::uint64_t TiffLayer::fingerprint(const std::vector<Window>& cells) {
    return told_by_ ? told_by_->fingerprint(cells) : raster_fingerprint(facts_, PlainTiff::files(facts_.path));
}

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
    const auto bytes = static_cast<tmsize_t>(static_cast<std::size_t>(rows_in(row)) * row_bytes());
    const auto all_read = [&] {
        if (index_.strips)
            return !TIFFIsTiled(file) && TIFFStripSize(file) == static_cast<tmsize_t>(values.size()) &&
                   TIFFReadEncodedStrip(file, static_cast<std::uint32_t>(row), values.data(), bytes) == bytes;
        return TIFFTileSize(file) == static_cast<tmsize_t>(values.size()) &&
               TIFFReadEncodedTile(file, TIFFComputeTile(file, x, y, 0, 0), values.data(), bytes) == bytes;
    };
    if (!file || !all_read()) {
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

/// One row's part, or whole rows.
void TiffLayer::read_as_is(std::int64_t column, std::int64_t row, const Window& part, RawVector<std::byte>& values) {
    values.resize(static_cast<std::size_t>(part.posts() * facts_.type_bytes));
    const auto skipped = static_cast<std::uint64_t>((part.rows.begin - row * facts_.block_rows) * facts_.block_columns +
                                                    part.columns.begin - column * facts_.block_columns);
    const std::uint64_t at =
        index_.offsets[tile_number(column, row)] + skipped * static_cast<std::uint64_t>(facts_.type_bytes);
    try {
        file_->read(at, values.data(), values.size());
    } catch (const IoError& e) {
        fail(column, row, at + values.size() > file_->bytes() ? ends_early : e.what());
    }
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
            const std::int64_t left_out = (columns.begin - tc * wide) * bytes;
            const auto take = [&](const std::byte* values, std::int64_t r) {
                convert(values, facts_.type,
                        static_cast<std::byte*>(out) + (r - window.rows.begin) * line_bytes +
                            (columns.begin - window.columns.begin) * size,
                        type, columns.size());
            };
            if (is_blank(tc, tr)) {
                some.resize(row_bytes());
                fill_no_data(facts_, some.data(), static_cast<std::size_t>(wide));
                for (std::int64_t r = rows.begin; r < rows.end; ++r) take(some.data() + left_out, r);
                continue;
            }
            if (!file_) {
                const TileCache::Tile values = tile(tc, tr);
                for (std::int64_t r = rows.begin; r < rows.end; ++r)
                    take(values->data() + (r - tr * high) * wide * bytes + left_out, r);
                continue;
            }
            const bool in_parts = facts_.rows_in_parts && columns.size() < wide;
            const Interval across = in_parts ? columns : Interval{tc * wide, (tc + 1) * wide};
            const std::int64_t most = in_parts ? 1 : static_cast<std::int64_t>(rows_at_a_time());
            for (std::int64_t r = rows.begin; r < rows.end;) {
                const Interval part{r, std::min(rows.end, r + most)};
                read_as_is(tc, tr, {across, part}, some);
                for (; r < part.end; ++r)
                    take(some.data() + ((r - part.begin) * across.size() + columns.begin - across.begin) * bytes, r);
            }
        }
}

std::unique_ptr<RasterLayer> open_raster(const std::string& role, const std::string& path,
                                         std::shared_ptr<TileCache> cache) {
    if (auto plain = TiffLayer::of(role, path, cache)) return plain;
    auto by_gdal = std::make_unique<RasterFile>(role, path);
    if (auto posts = TiffLayer::of(by_gdal, std::move(cache))) return posts;
    return by_gdal;
}

}  // namespace wedgescope
