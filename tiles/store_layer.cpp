#include "tiles/store_layer.hpp"

#include <algorithm>
#include <cstring>
#include <filesystem>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"
#include "tiles/plain_file.hpp"

namespace wedgescope {

DatasetHandle open_sheet(const std::string& path) {
    // No list of the folder's files: it may be long, and nothing beside the sheet counts.
    const char* const drivers[] = {"GTiff", nullptr};
    const char* const siblings[] = {nullptr};
    return DatasetHandle(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR,
                                           drivers, nullptr, siblings));
}

namespace {

SheetSums sums_of(const std::string& folder, const StoreLayerEntry& layer, const StoreSheet& sheet) {
    const std::string path = (std::filesystem::path(folder) / sheet.sums).string();
    SheetSums sums = read_sums(path, sheet.sums_checksum);
    const Window posts = layer.posts(sheet.column, sheet.row);
    if (sums.columns != posts.columns.size() || sums.rows != posts.rows.size() ||
        sums.tile != layer.facts.block_columns || sums.file_bytes != sheet.bytes)
        throw DataError(text("checksum file '", path, "' belongs to another sheet"));
    sums.codes = {};  // for the writer alone
    return sums;
}

}  // namespace

SheetReader::SheetReader(const std::string& folder, const StoreLayerEntry& layer, const StoreSheet& sheet, By by)
    : SheetReader((std::filesystem::path(folder) / sheet.file).string(), layer.facts,
                  layer.posts(sheet.column, sheet.row), sums_of(folder, layer, sheet), by) {}

SheetReader::SheetReader(std::string path, const RasterFacts& layer, const Window& posts, SheetSums sums, By by)
    : path_(std::move(path)), facts_(layer), sums_(std::move(sums)), posts_(posts) {
    if (const std::uint64_t bytes = file_bytes(path_); bytes != sums_.file_bytes)
        throw DataError(
            text("sheet '", path_, "' has ", bytes, " bytes; it had ", sums_.file_bytes, " when the store was made"));
    if (by == By::whatever_is_fastest) {
        // One that is not as the manifest says is left to GDAL, and to messages.
        auto index = TiffIndex::of(path_);
        const bool whole = index && index->levels.size() == static_cast<std::size_t>(sums_.levels()) &&
                           index->levels[0].columns == sums_.columns && index->levels[0].rows == sums_.rows &&
                           index->levels[0].tile_columns == static_cast<std::uint64_t>(sums_.tile);
        if (whole) decoder_ = TileDecoder::of(path_, std::move(*index), static_cast<std::size_t>(facts_.type_bytes));
    }
    if (!decoder_) open();
}

void SheetReader::open() {
    if (dataset_) return;
    GdalErrors errors;
    dataset_ = open_sheet(path_);
    if (!dataset_) throw DataError(text("sheet '", path_, "' is damaged, it cannot be opened: ", errors.reason()));
    int wide = 0, high = 0;
    GDALRasterBand* band = dataset_->GetRasterBand(1);
    if (band) band->GetBlockSize(&wide, &high);
    if (!band || dataset_->GetRasterXSize() != sums_.columns || dataset_->GetRasterYSize() != sums_.rows ||
        wide != sums_.tile || high != sums_.tile || band->GetRasterDataType() != facts_.type)
        throw DataError(text("sheet '", path_, "' is damaged: its size, type or tiles are not those of the manifest"));
}

RawVector<std::byte> SheetReader::tile(int level, std::int64_t column, std::int64_t row) {
    const std::int64_t edge = sums_.tile;
    const auto bytes = static_cast<std::size_t>(facts_.type_bytes);
    const std::uint64_t expected = sums_.tiles[sums_.index(level, column, row)];
    const std::int64_t wide = std::min(edge, SheetSums::side(sums_.columns, level) - column * edge),
                       high = std::min(edge, SheetSums::side(sums_.rows, level) - row * edge);
    const auto named = [&](const std::string& what) {
        std::string where = text("sheet '", path_, "': ");
        if (level > 0) where += text("overview ", level, ", ");
        const std::int64_t c = posts_.columns.begin + ((column * edge) << level),
                           r = posts_.rows.begin + ((row * edge) << level);
        return text(where, "tile ", column, ", ", row, " (",
                    place({{c, std::min(posts_.columns.end, c + (edge << level))},
                           {r, std::min(posts_.rows.end, r + (edge << level))}}),
                    " of the layer) ", what);
    };
    RawVector<std::byte> values(static_cast<std::size_t>(edge * edge) * bytes);
    const auto right = [&] {
        Checksum sum;
        if (wide == edge) return checksum(values.data(), static_cast<std::size_t>(wide * high) * bytes) == expected;
        for (std::int64_t r = 0; r < high; ++r)
            sum.add(values.data() + static_cast<std::size_t>(r * edge) * bytes, static_cast<std::size_t>(wide) * bytes);
        return sum.value() == expected;
    };
    if (!decoded_here(level, column, row, values, right)) {
        open();
        GdalErrors errors;
        GDALRasterBand* band = dataset_->GetRasterBand(1);
        if (level > 0) band = band->GetOverview(level - 1);
        int block_wide = 0, block_high = 0;
        if (band) band->GetBlockSize(&block_wide, &block_high);
        // An overview has a directory of its own, which damage may give another type: its blocks would not fit in here.
        if (!band || block_wide != edge || block_high != edge || band->GetRasterDataType() != facts_.type)
            throw DataError(named("cannot be read: " + errors.reason()));
        if (band->ReadBlock(static_cast<int>(column), static_cast<int>(row), values.data()) != CE_None)
            throw DataError(named("cannot be read: " + errors.reason()));
        if (!right()) throw DataError(named("is damaged"));
    }
    if (wide < edge)
        for (std::int64_t r = 1; r < high; ++r)
            std::memmove(values.data() + static_cast<std::size_t>(r * wide) * bytes,
                         values.data() + static_cast<std::size_t>(r * edge) * bytes,
                         static_cast<std::size_t>(wide) * bytes);
    values.resize(static_cast<std::size_t>(wide * high) * bytes);
    return values;
}

/// False where GDAL must look.
bool SheetReader::decoded_here(int level, std::int64_t column, std::int64_t row, RawVector<std::byte>& values,
                               const std::function<bool()>& right) {
    if (!decoder_) return false;
    try {
        if (decoder_->decode(level, column, row, values, right)) return true;
    } catch (const IoError&) {  // GDAL says which tile
    }
    // Another layout than it seemed, or damage: either way once is enough.
    decoder_.reset();
    return false;
}

StoreLayer::StoreLayer(std::string folder, const StoreLayerEntry& entry, std::shared_ptr<TileCache> cache)
    : folder_(std::move(folder)), entry_(std::make_shared<StoreLayerEntry>(entry)), cache_(std::move(cache)),
      cached_as_(cache_->new_layer()) {
    facts_ = entry_->facts;
    for (const StoreSheet& sheet : entry_->sheets) sheets_[{sheet.column, sheet.row}] = &sheet;
    prepare();
}

std::uint64_t StoreLayer::fingerprint(const std::vector<Window>& cells) { return fingerprint(*entry_, sheets_, cells); }

RasterLayer::Fingerprint StoreLayer::fingerprint_now() {
    return [entry = entry_, sheets = sheets_](const std::vector<Window>& cells) {
        return fingerprint(*entry, sheets, cells);
    };
}

std::uint64_t StoreLayer::fingerprint(const StoreLayerEntry& entry, const Sheets& sheets,
                                      const std::vector<Window>& cells) {
    Checksum sum;
    sum.add(static_cast<std::uint64_t>(entry.facts.columns));
    sum.add(static_cast<std::uint64_t>(entry.facts.rows));
    for (const auto& [place, sheet] : sheets) {
        const Window posts = entry.posts(place.first, place.second);
        const bool met =
            std::any_of(cells.begin(), cells.end(), [&](const Window& w) { return !intersection(w, posts).empty(); });
        if (!met && !cells.empty()) continue;
        sum.add(static_cast<std::uint64_t>(place.first));
        sum.add(static_cast<std::uint64_t>(place.second));
        sum.add(sheet->bytes);
        sum.add(sheet->sums_checksum);
    }
    return sum.value();
}

TileCache::Tile StoreLayer::tile(int level, std::int64_t column, std::int64_t row) {
    const std::int64_t edge = facts_.block_columns, a_sheet = (sheet_posts >> level) / edge;
    const std::int64_t columns = SheetSums::side(facts_.columns, level), rows = SheetSums::side(facts_.rows, level);
    const std::int64_t across = (columns + edge - 1) / edge;
    const TileCache::Key key{cached_as_ + level, static_cast<std::uint64_t>(row * across + column)};
    if (auto found = cache_->find(key)) return found;
    const auto place = sheets_.find({column / a_sheet, row / a_sheet});
    RawVector<std::byte> values;
    if (place == sheets_.end()) {
        const std::int64_t wide = std::min(edge, columns - column * edge), high = std::min(edge, rows - row * edge);
        values.resize(static_cast<std::size_t>(wide * high * facts_.type_bytes));
        fill_no_data(facts_, values.data(), static_cast<std::size_t>(wide * high));
    } else {
        const StoreSheet* sheet = place->second;
        std::unique_ptr<SheetReader> reader;
        {
            const std::lock_guard lock(mutex_);
            const auto waiting =
                std::find_if(idle_.begin(), idle_.end(), [&](const auto& entry) { return entry.first == sheet; });
            if (waiting != idle_.end()) {
                reader = std::move(waiting->second);
                idle_.erase(waiting);
            }
        }
        if (!reader)
            reader = std::make_unique<SheetReader>(folder_, *entry_, *sheet, SheetReader::By::whatever_is_fastest);
        // A small sheet has fewer overviews: its last one is a single tile.
        const int own = std::min(level, reader->sums().levels() - 1);
        values = reader->tile(own, column % a_sheet, row % a_sheet);
        if (own < level) thin(values, reader->sums(), own, level);
        std::unique_ptr<SheetReader> closed;
        const std::lock_guard lock(mutex_);
        idle_.emplace_front(sheet, std::move(reader));
        if (idle_.size() > most_idle()) {
            closed = std::move(idle_.back().second);
            idle_.pop_back();
        }
    }
    auto kept = std::make_shared<const RawVector<std::byte>>(std::move(values));
    cache_->add(key, kept);
    return kept;
}

int StoreLayer::deepest() const {
    int level = 0;
    while ((sheet_posts >> (level + 1)) >= facts_.block_columns) ++level;
    return level;
}

void StoreLayer::read_level(int level, const Window& window, float* out, std::int64_t stride) {
    if (window.empty()) return;
    const int own = std::min(level, deepest()), thinner = level - own;
    if (thinner == 0) {
        read_values(level, window, out, GDT_Float32, stride * static_cast<std::int64_t>(sizeof(float)));
    } else {
        // Of the coarsest overview that has whole tiles in whole sheets, what the level keeps.
        std::vector<float> line(level_line);
        const std::int64_t post = std::int64_t{1} << thinner, most = level_line >> thinner;
        for (std::int64_t r = window.rows.begin; r < window.rows.end; ++r)
            for (std::int64_t c = window.columns.begin; c < window.columns.end; c += most) {
                const std::int64_t end = std::min(c + most, window.columns.end), n = (end - 1 - c) * post + 1;
                read_values(own, {{c * post, c * post + n}, {r * post, r * post + 1}}, line.data(), GDT_Float32, 0);
                float* to = out + (r - window.rows.begin) * stride + c - window.columns.begin;
                for (std::int64_t i = 0; i < end - c; ++i) to[i] = line[static_cast<std::size_t>(i * post)];
            }
    }
    make_heights(window, out, stride, level);
}

/// In place, from a sheet's single tile of overview `own` to the posts of a coarser level.
void StoreLayer::thin(RawVector<std::byte>& values, const SheetSums& sums, int own, int level) const {
    const std::int64_t wide = SheetSums::side(sums.columns, own), post = std::int64_t{1} << (level - own),
                       columns = SheetSums::side(sums.columns, level), rows = SheetSums::side(sums.rows, level),
                       bytes = facts_.type_bytes;
    for (std::int64_t r = 0; r < rows; ++r)
        for (std::int64_t c = 0; c < columns; ++c)
            std::memmove(values.data() + (r * columns + c) * bytes,
                         values.data() + (r * post * wide + c * post) * bytes, static_cast<std::size_t>(bytes));
    values.resize(static_cast<std::size_t>(columns * rows * bytes));
}

void StoreLayer::read_values(int level, const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) {
    if (window.empty()) return;
    const std::int64_t edge = facts_.block_columns;
    const int size = type_bytes(type);
    for (std::int64_t tr = window.rows.begin / edge; tr <= (window.rows.end - 1) / edge; ++tr)
        for (std::int64_t tc = window.columns.begin / edge; tc <= (window.columns.end - 1) / edge; ++tc) {
            const TileCache::Tile values = tile(level, tc, tr);
            const std::int64_t wide = std::min(edge, SheetSums::side(facts_.columns, level) - tc * edge);
            const Interval columns = intersection(window.columns, {tc * edge, tc * edge + wide}),
                           rows = intersection(window.rows, {tr * edge, (tr + 1) * edge});
            for (std::int64_t r = rows.begin; r < rows.end; ++r)
                convert(values->data() + ((r - tr * edge) * wide + columns.begin - tc * edge) * facts_.type_bytes,
                        facts_.type,
                        static_cast<std::byte*>(out) + (r - window.rows.begin) * line_bytes +
                            (columns.begin - window.columns.begin) * size,
                        type, columns.size());
        }
}

}  // namespace wedgescope
