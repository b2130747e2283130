#include "tools/ground.hpp"

#include <algorithm>
#include <optional>

#include "lib/detail.hpp"
#include "tiles/ground_map.hpp"
#include "tiles/sources.hpp"
#include "tiles/tile_store.hpp"
#include "tools/terminal.hpp"

namespace wedgescope {
namespace {

/// The posts that levels of detail ask for; nothing where there are no levels. Without a range all posts count.
std::optional<Window> posts_for_levels(const Settings& settings, WedgeSource& source) {
    const DataBase& db = source.data_base();
    Scene scene = settings.scene;
    constexpr double any_range_m = 1e5;
    if (!scene.range_m) scene.range_m = std::min(std::max(any_range_m, 2 * scene.range_start_m), Scene::most_range_m);
    try {
        const ResolvedScene resolved = resolve(scene, source);
        if (!detail_possible(resolved, db)) return std::nullopt;
        return settings.scene.range_m ? detail_window(resolved, db) : Window{{0, db.columns}, {0, db.rows}};
    } catch (const InputError&) {  // the run says so, and where
        return std::nullopt;
    }
}

/// A tile store with nothing beside it has maps of its own.
bool knows_its_ground(const Settings& settings) {
    return is_tile_store(settings.dem) && settings.culture_height.empty();
}

/// Of a raster that is kept in memory for all scenes (tiles/shared_source.hpp).
bool stays(const Settings& settings, const DataBase& db) {
    constexpr std::uint64_t least_memory = std::uint64_t{64} << 20;
    return settings.memory_bytes >= least_memory &&
           4.0 * sizeof(float) * static_cast<double>(db.columns) * static_cast<double>(db.rows) <=
               static_cast<double>(settings.memory_bytes);
}

/// InputError where a file that is not ours stands in the way of the map to keep.
void check_place(const Settings& settings, const DataBaseParams& layers) {
    if (settings.keep_map && !settings.overwrite) GroundMap::check_place(layers);
}

}  // namespace

bool expects_ground(const Settings& settings, GroundUse use, const Stop& stop) {
    if (knows_its_ground(settings)) return false;
    const DataBaseParams layers = data_base_params(settings, cache_bytes(settings), stop);
    check_place(settings, layers);
    if (settings.keep_map || GroundMap::kept(layers)) return true;
    if (!use.levels) return false;
    constexpr float any_ground_m = 0;
    const auto unread = open_unread_source(layers, any_ground_m, {any_ground_m, any_ground_m, 0, true});
    return posts_for_levels(settings, *unread).has_value();
}

std::string find_ground(Settings& settings, GroundUse use, const Stop& stop) {
    std::string unfit;
    settings.ground = nullptr;
    if (knows_its_ground(settings)) return unfit;
    const DataBaseParams layers = data_base_params(settings, cache_bytes(settings), stop);
    check_place(settings, layers);
    settings.ground = GroundMap::kept(layers, &unfit);
    if (settings.keep_map && settings.ground && !settings.ground->whole(stop)) settings.ground = nullptr;
    if (settings.ground) return unfit;
    GroundMap::MakeParams params;
    bool only_for_speed = false;
    params.keep = settings.keep_map;
    if (!params.keep) {
        const auto source = open_direct_source(layers);
        const DataBase& db = source->data_base();
        const Window everything{{0, db.columns}, {0, db.rows}};
        if (use.levels) params.posts = posts_for_levels(settings, *source);
        only_for_speed = !params.posts;
        if (only_for_speed && use.many && stays(settings, db)) params.posts = everything;
        if (!params.posts) return unfit;
        if (use.whole || *params.posts == everything) params.posts.reset();
    }
    params.temp_folder = settings.temp_dir;
    params.memory_bytes = static_cast<std::size_t>(settings.memory_bytes);
    params.threads = thread_count(settings);
    params.stop = &stop;
    Progress mapping(settings.quiet);
    params.progress = [&](double fraction) { mapping.report(fraction); };
    try {
        settings.ground = GroundMap::make(layers, params);
    } catch (const IoError&) {  // no room for it, or a post that no scene may ask for
        if (!only_for_speed) throw;
    } catch (const DataError&) {
        if (!only_for_speed) throw;
    }
    mapping.done();
    if (params.keep) unfit.clear();
    return unfit;
}

}  // namespace wedgescope
