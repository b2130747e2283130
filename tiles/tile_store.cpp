#include "tiles/tile_store.hpp"

#include <filesystem>

#include "lib/error.hpp"
#include "tiles/store_layer.hpp"
#include "tiles/store_manifest.hpp"

namespace wedgescope {

bool is_tile_store(const std::string& path) {
    if (path.empty()) return false;  // not the current folder
    std::error_code ignored;
    return std::filesystem::is_regular_file(std::filesystem::path(path) / manifest_name, ignored);
}

std::string store_classes(const std::string& store) {
    const std::filesystem::path path = std::filesystem::path(store) / store_classes_name;
    std::error_code ignored;
    return is_tile_store(store) && std::filesystem::is_regular_file(path, ignored) ? path.string() : "";
}

std::optional<double> store_height_scale(const std::string& store) {
    return is_tile_store(store) ? read_manifest(store).height_scale : std::nullopt;
}

TileStore::TileStore(std::string path, std::shared_ptr<TileCache> cache)
    : path_(std::move(path)), manifest_(std::make_unique<StoreManifest>(read_manifest(path_))),
      cache_(cache ? std::move(cache) : std::make_shared<TileCache>(0)) {}

TileStore::~TileStore() = default;

std::unique_ptr<RasterLayer> TileStore::layer(StoreLayerKind kind) const {
    const StoreLayerEntry* entry = manifest_->layer(kind);
    if (!entry) return nullptr;
    return std::make_unique<StoreLayer>(path_, *entry, cache_);
}

std::unique_ptr<BlockMap> TileStore::block_map(double scale) const { return bounds(scale, BlockMapFile::most_pages); }

bool TileStore::has_detail_map() const { return !manifest_->detail_map.empty(); }

std::unique_ptr<DetailMap> TileStore::detail_map(double scale) const {
    auto map = std::make_unique<DetailMapFile>(inside(manifest_->detail_map), manifest_->detail_shape(),
                                               bounds(scale, DetailMapFile::bounds_pages));
    require(map->imprint(), manifest_->detail_map_imprint, "detail map", manifest_->detail_map);
    return map;
}

FilePart TileStore::inside(const std::string& name) const {
    return whole_file((std::filesystem::path(path_) / name).string(), PlainFile::Use::read);
}

std::unique_ptr<BlockMapFile> TileStore::bounds(double scale, std::size_t kept) const {
    auto map = std::make_unique<BlockMapFile>(inside(manifest_->block_map), manifest_->map_shape(), scale, kept);
    require(map->imprint(), manifest_->block_map_imprint, "block map", manifest_->block_map);
    return map;
}

void TileStore::require(std::uint64_t found, const std::optional<std::uint64_t>& named, const char* what,
                        const std::string& name) const {
    if (named && *named != found)
        throw DataError(text(what, " '", (std::filesystem::path(path_) / name).string(),
                             "' is damaged, or not the one that the store's manifest names"));
}

std::optional<Legend> TileStore::legend(const Materials& materials) const {
    if (manifest_->legend_name.empty()) return std::nullopt;
    if (manifest_->legend_csv.empty()) return Legend::built_in(manifest_->legend_name);
    try {
        return Legend::from_csv(manifest_->legend_name, manifest_->legend_csv, materials);
    } catch (const InputError& e) {
        const std::string own = store_classes(path_);
        if (manifest_->class_table && own.empty())
            throw DataError(text("class table '", (std::filesystem::path(path_) / store_classes_name).string(),
                                 "' is missing, in which the store's own classes stand"));
        throw InputError(text("tile store '", path_, "': legend ", e.what(),
                              own.empty() ? ""
                                          : text(" (the classes of its features are in '", own,
                                                 "'; a class-table given needs their rows too)")));
    }
}

Extremes TileStore::terrain_extremes() const {
    const RasterFacts& facts = manifest_->layers[0].facts;
    const ValueFacts& values = manifest_->layers[0].values;
    Extremes out;
    out.void_posts = values.voids;
    out.any_valid = values.voids < static_cast<std::uint64_t>(facts.own_columns() * facts.rows);
    if (!out.any_valid) return out;
    out.lowest_m = values.lowest;
    out.highest_m = values.highest;
    return out;
}

}  // namespace wedgescope
