#include "tools/budget.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "lib/plan.hpp"
#include "tiles/raster.hpp"

namespace wedgescope {
namespace {

constexpr std::size_t mebibyte = std::size_t{1} << 20;

/// Flat ground that serves to place the sensor.
float any_ground_m(const Scene& scene) {
    return scene.platform.altitude_above == AltitudeAbove::ground ? 0 : std::numeric_limits<float>::quiet_NaN();
}

/// The least and the largest range that the terrain may give a scene without one; nothing where none can be found.
std::optional<std::pair<double, double>> ranges(const Scene& scene, const DataBaseParams& layers, float ground_m) {
    const float known = std::isnan(ground_m) ? 0 : ground_m;
    constexpr float lowest_m = -500, highest_m = 9000;
    std::optional<std::pair<double, double>> found;
    for (const auto& [low, high] :
         {std::pair{known, known}, {lowest_m, known}, {lowest_m, highest_m}, {std::min(known, 0.0F), highest_m}}) {
        try {
            const auto unread = open_unread_source(layers, ground_m, {low, high, 0, true});
            const double range = resolve(scene, *unread).scene.range_m.value_or(0);
            found = found ? std::pair{std::min(found->first, range), std::max(found->second, range)}
                          : std::pair{range, range};
        } catch (const InputError&) {  // too far for this earth: the run says so when it knows
        }
    }
    return found;
}

ResolvedScene at_range(Scene scene, double range_m, WedgeSource& source) {
    scene.range_m = range_m;
    return resolve(scene, source);
}

}  // namespace

std::size_t memory_bytes(const Settings& settings) { return static_cast<std::size_t>(settings.memory_bytes); }

Settings with_memory(const Settings& settings, std::size_t memory_bytes) {
    Settings other = settings;
    other.memory_bytes = memory_bytes;
    return other;
}

void refuse(const TooLittleMemory& e, std::size_t memory_bytes, const Attempt& attempt) {
    const auto does = [&](std::size_t mib) {
        try {
            attempt(mib * mebibyte);
            return true;
        } catch (const TooLittleMemory&) {
            return false;
        }
    };
    constexpr std::size_t most = std::size_t{1} << 24;
    std::size_t too_little = memory_bytes / mebibyte, enough = std::max<std::size_t>(1, 2 * too_little);
    while (!does(enough)) {
        too_little = enough;
        enough *= 2;
        if (enough > most) throw e;
    }
    while (enough - too_little > 1) {
        const std::size_t middle = too_little + (enough - too_little) / 2;
        (does(middle) ? enough : too_little) = middle;
    }
    throw e.with(memory_bytes, enough * mebibyte);
}

void check_budget(const Settings& settings, const Attempt& attempt) {
    try {
        attempt(memory_bytes(settings));
    } catch (const TooLittleMemory& e) {
        refuse(e, memory_bytes(settings), attempt);
    }
}

void check_reader(const WedgeSource& source, std::size_t memory_bytes) {
    const std::size_t needed = source.cache_bytes() + source.reader_bytes();
    if (needed > memory_bytes) {
        const DataBase& db = source.data_base();
        throw TooLittleMemory(memory_bytes, needed, text("reading '", db.name, "'"),
                              text(" (blocks of ", db.block_columns, " x ", db.block_rows, " posts)"));
    }
}

std::unique_ptr<SharedSource> open_shared_source(const Settings& granted, const Stop& stop) {
    auto direct = open_direct_source(data_base_params(granted, cache_bytes(granted), stop));
    check_reader(*direct, memory_bytes(granted));
    return std::make_unique<SharedSource>(std::move(direct), memory_bytes(granted));
}

std::string hard_to_read(const Settings& settings, const SharedSource& source, const Stop& stop) {
    if (source.keeps()) return "";
    const SourceChoice choice = choose_source(data_base_params(settings, cache_bytes(settings), stop),
                                              SourceKind::automatic, settings.scene, memory_bytes(settings));
    if (!choice.spilled || choice.kept) return "";
    return text("'", source.data_base().name, "' and what belongs to it take long to read for many scenes (",
                choice.why, "); wedgescope tile makes a store of them that does not, or give more memory");
}

namespace {

/// The source that a run with these settings would take; a pass is forecast, not made.
std::unique_ptr<WedgeSource> source_at(const DataBaseParams& layers, const Settings& granted,
                                       const ResolvedScene& scene, bool range_given, const SpillOptions& options) {
    // A post is read in any case.
    auto direct = open_direct_source(layers);
    check_reader(*direct, memory_bytes(granted));
    const SourceChoice choice = choose_source(layers, granted.source, granted.scene, memory_bytes(granted));
    if (!choice.spilled) return direct;
    return choice.kept ? open_source(choice, layers, granted.scene, options)
                       : forecast_spilled_source(layers, scene, range_given, options);
}

/// The source with which check(settings) finds room: as it is asked for; where automatic takes one that is only the faster one,
/// and that does not fit, windows of the rasters. TooLittleMemory.
template <class Check>
SourceKind fitting_source(const Settings& granted, const Stop& stop, const Check& check) {
    try {
        check(granted);
        return granted.source;
    } catch (const TooLittleMemory&) {
        const bool only_faster = granted.source == SourceKind::automatic &&
                                 choose_source(data_base_params(granted, cache_bytes(granted), stop), granted.source,
                                               granted.scene, memory_bytes(granted))
                                     .only_faster;
        if (!only_faster) throw;
    }
    Settings direct = granted;
    direct.source = SourceKind::direct_for_memory;
    check(direct);
    return direct.source;
}

void plan_simulation(const Settings& granted, const ResolvedScene& scene, bool range_given, const Stop& stop,
                     WedgeArchive* archive) {
    const DataBaseParams layers = data_base_params(granted, cache_bytes(granted), stop);
    const SpillOptions options = spill_options(granted);
    const auto source = source_at(layers, granted, scene, range_given, options);
    EngineParams params = engine_params(granted);
    params.archive = archive;
    plan(scene, *source, params);
    if (!granted.ground_file.empty()) ground_work(granted, scene, *source);
}

}  // namespace

Attempt simulation(const Settings& settings, const ResolvedScene& scene, bool range_given, const Stop& stop,
                   WedgeArchive* archive) {
    return [&settings, &scene, range_given, &stop, archive](std::size_t memory) {
        stop.check();  // a refusal makes some dozens of attempts
        fitting_source(with_memory(settings, memory), stop,
                       [&](const Settings& granted) { plan_simulation(granted, scene, range_given, stop, archive); });
    };
}

GroundWork ground_work(const Settings& settings, const ResolvedScene& scene, WedgeSource& source) {
    Scene same = settings.scene;
    if (scene.scene.display.kind == DisplayKind::gpi_true) {  // whose ranges count along the ground
        same.range_m.reset();
        same.ground_range_m = scene.scene.range_m;
        same.ground_start_m = std::exchange(same.range_start_m, 0);
    } else {
        same.range_m = scene.scene.range_m;
    }
    GroundWork ground{resolve_coverage(same, source), {}};
    CoverageParams& params = ground.params;
    params.layer = CoverageLayer::response;
    params.cull = !settings.no_cull;
    params.threads = thread_count(settings);
    const std::size_t images = image_bytes(scene, draws(settings)), all = memory_bytes(settings);
    params.memory_bytes = all - std::min(all, images);
    const std::size_t least =
        images + coverage_bytes(ground.scene, source, params) + source.cache_bytes() + source.reader_bytes();
    if (least > all) throw TooLittleMemory(all, least, "this scene with ground");
    return ground;
}

void check_simulation(Settings& settings, const Stop& stop) {
    const std::size_t memory = memory_bytes(settings);
    const DataBaseParams layers = data_base_params(settings, cache_bytes(settings), stop);
    const bool range_given = settings.scene.range_m.has_value();
    const auto direct = open_direct_source(layers);
    const bool readable = direct->cache_bytes() + direct->reader_bytes() <= memory;
    const bool map_to_come = settings.expects_ground && !settings.ground;
    if (readable && range_given && !map_to_come &&
        !choose_source(layers, settings.source, settings.scene, memory).spilled)
        return;  // the run itself refuses before it reads more
    // The ground below the sensor is the only height known so far.
    float ground_m = any_ground_m(settings.scene);
    Scene place = settings.scene;
    if (!range_given) place.range_m = place.range_start_m + 1;
    if (readable) {
        const ResolvedScene s = resolve(place, *direct);
        if (s.nadir_on_data) ground_m = static_cast<float>(s.reference_m);
    }
    const auto unread = open_unread_source(layers, ground_m, {});
    WedgeSource& ground = readable ? *direct : *unread;
    ResolvedScene least, largest;
    if (range_given) {
        least = largest = resolve(settings.scene, ground);
    } else {
        const auto found = ranges(settings.scene, layers, ground_m);
        if (!found) return;
        least = at_range(settings.scene, found->first, ground);
        largest = at_range(settings.scene, found->second, ground);
    }
    try {
        settings.source = fitting_source(
            settings, stop, [&](const Settings& own) { plan_simulation(own, least, range_given, stop, nullptr); });
    } catch (const TooLittleMemory& e) {
        // A small raster is soon read: then the range is known.
        constexpr std::int64_t small_posts = std::int64_t{1} << 24;
        const DataBase& db = direct->data_base();
        if (readable && !range_given && db.columns * db.rows <= small_posts) largest = resolve(settings.scene, *direct);
        try {
            refuse(e, memory, simulation(settings, largest, range_given, stop));
        } catch (const DataError&) {  // nobody can look so far there
            refuse(e, memory, simulation(settings, least, range_given, stop));
        }
    }
}

void check_scene(Settings& settings, const ResolvedScene& scene, const Stop& stop) {
    try {
        settings.source = fitting_source(
            settings, stop, [&](const Settings& own) { plan_simulation(own, scene, true, stop, nullptr); });
    } catch (const TooLittleMemory& e) {
        refuse(e, memory_bytes(settings), simulation(settings, scene, true, stop));
    }
}

void check_coverage_budget(Settings& settings, const CoverageParams& params, WedgeSource& direct, const Stop& stop) {
    std::unique_ptr<WedgeSource> unread;
    if (direct.cache_bytes() + direct.reader_bytes() > memory_bytes(settings))
        unread = open_unread_source(data_base_params(settings, cache_bytes(settings), stop),
                                    any_ground_m(settings.scene), {});
    const ResolvedScene scene = resolve_coverage(settings.scene, unread ? *unread : direct);
    const auto check = [&](const Settings& granted) {
        const DataBaseParams layers = data_base_params(granted, cache_bytes(granted), stop);
        SpillOptions options = spill_options(granted);
        options.all_round = options.all_of_it = true;
        const auto source = source_at(layers, granted, scene, granted.scene.range_m.has_value(), options);
        CoverageParams own = params;
        own.memory_bytes = memory_bytes(granted);
        check_coverage(scene, *source, own);
    };
    try {
        settings.source = fitting_source(settings, stop, check);
    } catch (const TooLittleMemory& e) {
        refuse(e, memory_bytes(settings), [&](std::size_t memory) {
            stop.check();
            fitting_source(with_memory(settings, memory), stop, check);
        });
    }
}

void check_summary(const Settings& settings, const std::string& path) {
    const std::size_t own = summary_bytes(path);
    check_budget(settings, [&](std::size_t memory) {
        const std::size_t needed = own + cache_bytes(with_memory(settings, memory));
        if (needed > memory) throw TooLittleMemory(memory, needed, text("reading '", path, "'"));
    });
}

}  // namespace wedgescope
