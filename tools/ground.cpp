#include "tools/ground.hpp"

#include <optional>

#include "lib/detail.hpp"
#include "tiles/ground_map.hpp"
#include "tiles/sources.hpp"
#include "tiles/tile_store.hpp"
#include "tools/terminal.hpp"

namespace wedgescope {
namespace {

/// The posts that levels of detail ask for; nothing where there are no levels. Without a range all posts count.
std::optional<Window> posts_for_levels(const Settings& settings, const DataBaseParams& layers) {
    const auto source = open_direct_source(layers);
    const DataBase& db = source->data_base();
    const Window everything{{0, db.columns}, {0, db.rows}};
    Scene scene = settings.scene;
    constexpr double any_range_m = 1e5;
    if (!scene.range_m) scene.range_m = std::max(any_range_m, 2 * scene.range_start_m);
    const ResolvedScene resolved = resolve(scene, *source);
    if (!detail_possible(resolved, db)) return std::nullopt;
    return settings.scene.range_m ? detail_window(resolved, db) : everything;
}

}  // namespace

std::string find_ground(Settings& settings, GroundUse use, bool all, const Stop& stop) {
    std::string unfit;
    settings.ground = nullptr;
    if (is_tile_store(settings.dem) && settings.culture_height.empty()) return unfit;
    const DataBaseParams layers = data_base_params(settings, cache_bytes(settings), stop);
    settings.ground = GroundMap::kept(layers, &unfit);
    if (settings.ground || use == GroundUse::look) return unfit;
    GroundMap::MakeParams params;
    params.keep = settings.keep_map;
    if (!params.keep) {
        if (use != GroundUse::levels) return unfit;
        params.posts = posts_for_levels(settings, layers);
        if (!params.posts) return unfit;
        const auto source = open_direct_source(layers);
        const DataBase& db = source->data_base();
        if (all || *params.posts == Window{{0, db.columns}, {0, db.rows}}) params.posts.reset();
    }
    params.temp_folder = settings.temp_dir;
    params.memory_bytes = static_cast<std::size_t>(settings.memory_bytes);
    params.threads = spill_options(settings).threads;
    params.stop = &stop;
    Progress mapping(settings.quiet);
    params.progress = [&](double fraction) { mapping.report(fraction); };
    settings.ground = GroundMap::make(layers, params);
    mapping.done();
    if (params.keep) unfit.clear();
    return unfit;
}

}  // namespace wedgescope
