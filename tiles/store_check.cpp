#include "tiles/store_check.hpp"

#include <filesystem>

#include "lib/error.hpp"
#include "lib/material.hpp"
#include "tiles/checksum.hpp"
#include "tiles/kept_description.hpp"
#include "tiles/plain_file.hpp"
#include "tiles/sources.hpp"
#include "tiles/spill.hpp"
#include "tiles/store_layer.hpp"
#include "tiles/store_manifest.hpp"
#include "tiles/store_vrt.hpp"
#include "tiles/tile_store.hpp"

namespace wedgescope {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_vrt_bytes = std::size_t{1} << 28;

class Verifier {
public:
    Verifier(const std::string& path, const Stop* stop, const std::function<void(double)>& progress)
        : path_(path), stop_(stop), progress_(progress) {}

    StoreVerdict run() {
        try {
            manifest_ = read_manifest(path_);
        } catch (const Error& e) {
            verdict_.damage.emplace_back(e.what());
            return verdict_;
        }
        count(inside(manifest_name));
        std::size_t sheets = 0, done = 0;
        for (const StoreLayerEntry& layer : manifest_.layers) sheets += layer.sheets.size();
        for (const StoreLayerEntry& layer : manifest_.layers) {
            tried([&] {
                count(inside(layer.vrt));
                const double scale =
                    layer.kind == StoreLayerKind::culture_height ? manifest_.height_scale.value_or(1) : 1;
                if (file_checksum(inside(layer.vrt)) != layer.vrt_checksum &&
                    !is_vrt_of(file_text(inside(layer.vrt), most_vrt_bytes), layer, scale))
                    throw DataError(text("'", inside(layer.vrt), "' is damaged"));
            });
            for (const StoreSheet& sheet : layer.sheets) {
                if (stop_) stop_->check();
                tried([&] { check(layer, sheet); });
                if (progress_) progress_(static_cast<double>(++done) / static_cast<double>(sheets));
            }
        }
        tried([&] { check_map(); });
        tried([&] { check_detail_map(); });
        tried([&] {
            count(inside(manifest_.plan));
            if (file_checksum(inside(manifest_.plan)) != manifest_.plan_checksum)
                throw DataError(text("'", inside(manifest_.plan), "' is damaged"));
        });
        tried([&] { check_class_table(); });
        check_kept();
        return verdict_;
    }

private:
    std::string inside(const std::string& file) const { return (fs::path(path_) / file).string(); }
    void count(const std::string& path) {
        ++verdict_.files;
        verdict_.bytes += file_bytes(path);
    }
    template <class Body>
    void tried(Body&& body) {
        try {
            body();
        } catch (const DataError& e) {
            verdict_.damage.emplace_back(e.what());
        } catch (const IoError& e) {
            verdict_.damage.emplace_back(e.what());
        }
    }

    void check(const StoreLayerEntry& layer, const StoreSheet& sheet) {
        const std::string path = inside(sheet.file), sums_path = inside(sheet.sums);
        count(sums_path);
        const SheetSums sums = read_sums(sums_path, sheet.sums_checksum);
        count(path);
        if (file_bytes(path) == sums.file_bytes && file_checksum(path) == sums.file_checksum) return;
        // Something in the file is not as it was: which tiles?
        const std::size_t before = verdict_.damage.size();
        tried([&] {
            SheetReader reader(path_, layer, sheet);
            for (int k = 0; k < sums.levels(); ++k)
                for (std::int64_t r = 0; r < sums.down(k); ++r)
                    for (std::int64_t c = 0; c < sums.across(k); ++c) tried([&] { reader.tile(k, c, r); });
        });
        if (verdict_.damage.size() == before)
            throw DataError(text("sheet '", path, "' is damaged outside its tiles (header, tags or padding)"));
    }

    void check_map() {
        const std::string path = inside(manifest_.block_map);
        count(path);
        const std::size_t before = verdict_.damage.size();
        check_block_map(path, manifest_.map_shape(), [&](const std::string& line) { verdict_.damage.push_back(line); });
        if (verdict_.damage.size() == before && file_checksum(path) != manifest_.block_map_checksum)
            throw DataError(text("block map '", path, "' is not the one that the manifest names"));
    }

    void check_detail_map() {
        if (manifest_.detail_map.empty()) return;
        const std::string path = inside(manifest_.detail_map);
        count(path);
        const std::size_t before = verdict_.damage.size();
        wedgescope::check_detail_map(path, manifest_.detail_shape(),
                                     [&](const std::string& line) { verdict_.damage.push_back(line); });
        if (verdict_.damage.size() == before && file_checksum(path) != manifest_.detail_map_checksum)
            throw DataError(text("detail map '", path, "' is not the one that the manifest names"));
    }

    /// It may be edited, so it is as it should be where scenes can take it and the legend finds its classes.
    void check_class_table() {
        const std::string path = store_classes(path_);
        if (path.empty() && !manifest_.class_table) return;
        if (path.empty())
            throw DataError(text("class table '", inside(store_classes_name),
                                 "' is missing, in which the store's own classes stand"));
        count(path);
        constexpr std::size_t most = std::size_t{1} << 20;  // as of any class table
        try {
            const Materials materials = Materials::from_csv(text("class table '", path, "'"), file_text(path, most));
            if (manifest_.class_table) TileStore(path_).legend(materials);
        } catch (const InputError& e) {
            throw DataError(e.what());
        }
    }

    void check_kept() {
        const std::string path = inside(kept_spill_name);
        std::error_code ignored;
        if (!fs::exists(path, ignored)) return;
        tried([&] {
            count(path);
            const std::unique_ptr<Spill> spill = Spill::open_kept(path);
            std::vector<std::byte> buffer;
            for (std::size_t layer = 0; layer < spill->layer_count(); ++layer) {
                const Window& blocks = spill->layer(layer).blocks;
                for (std::int64_t r = blocks.rows.begin; r < blocks.rows.end; ++r) {
                    if (stop_) stop_->check();
                    for (std::int64_t c = blocks.columns.begin; c < blocks.columns.end; ++c)
                        tried([&] { spill->get(layer, c, r, buffer); });
                }
            }
        });
    }

    const std::string& path_;
    const Stop* stop_;
    const std::function<void(double)>& progress_;
    StoreManifest manifest_;
    StoreVerdict verdict_;
};

std::optional<StoreDescription::Kept> describe_kept(const std::string& path) {
    std::error_code ignored;
    if (!fs::exists(path, ignored)) return std::nullopt;
    StoreDescription::Kept kept;
    try {
        kept.bytes = file_bytes(path);
        const KeptDescription made = KeptDescription::of(*Spill::open_kept(path));
        kept.latlon = made.latlon;
        kept.nadir = made.nadir;
    } catch (const Error& e) {
        kept.damage = e.what();
    }
    return kept;
}

}  // namespace

StoreDescription describe_store(const std::string& path) {
    const StoreManifest m = read_manifest(path);
    StoreDescription out;
    out.path = path;
    out.software = m.software;
    out.version = m.version;
    out.legend = m.legend_name;
    out.culture_height_scale = m.height_scale;
    out.block_levels = m.map_shape().levels();
    out.block_map_bytes = m.map_shape().file_bytes();
    for (const StoreLayerEntry& entry : m.layers) {
        const RasterFacts& f = entry.facts;
        StoreDescription::Layer layer;
        layer.name = name(entry.kind);
        layer.type = type_name(f.type);
        layer.compression = f.compression;
        layer.unit = f.unit;
        layer.has_crs = f.crs != nullptr;
        layer.geographic = f.geographic;
        if (f.crs) layer.crs_name = f.crs->titled();
        layer.has_no_data = f.has_no_data;
        layer.no_data = f.no_data;
        layer.columns = f.columns;
        layer.rows = f.rows;
        layer.tile = f.block_columns;
        layer.origin_x = f.corner_x;
        layer.origin_y = f.corner_y;
        layer.step_x = f.step_x;
        layer.step_y = f.step_y;
        layer.sheets = entry.sheets.size();
        for (const StoreSheet& sheet : entry.sheets) {
            const Window posts = entry.posts(sheet.column, sheet.row);
            const auto along = [&](Interval side) { return (side.size() + layer.tile - 1) / layer.tile; };
            layer.tiles += static_cast<std::uint64_t>(along(posts.columns) * along(posts.rows));
            layer.bytes += sheet.bytes;
        }
        layer.void_posts = entry.values.voids;
        layer.lowest = static_cast<double>(entry.values.lowest);
        layer.highest = static_cast<double>(entry.values.highest);
        for (const StoreSource& source : entry.sources) layer.sources.push_back(source.path);
        out.layers.push_back(layer);
    }
    out.kept = describe_kept((fs::path(path) / kept_spill_name).string());
    return out;
}

StoreVerdict verify_store(const std::string& path, const Stop* stop, const std::function<void(double)>& progress) {
    return Verifier(path, stop, progress).run();
}

}  // namespace wedgescope
