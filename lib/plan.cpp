#include "lib/plan.hpp"

#include <algorithm>
#include <cmath>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

/// The most a wedge of so many azimuth bins holds: cells, the largest chunk, the front's spokes.
std::size_t wedge_bytes(const ResolvedScene& scene, const DataBase& db, const SpokeGrid& grid, std::int64_t bins,
                        std::int64_t strip_lines) {
    const double cells = static_cast<double>(bins + 1) * static_cast<double>(scene.swept.range_bins.size()) * 9;
    double chunk = 0, spokes = 0;
    for (Quadrant q : all_quadrants) {
        const std::int64_t lines = grid.line_count(q);
        const double across = static_cast<double>(lines_are_columns(q) ? db.rows : db.columns);
        const double reach = lines ? grid.distance(q, lines - 1) : 0;
        // What the wedge spans in slope, 2 being the whole quadrant.
        const double slopes =
            std::min(2.0, static_cast<double>(bins) * grid.azimuth_step_rad() * grid.map().slope_per_azimuth(q));
        const double width =
            std::min(across, reach * grid.map().spacing_slack() * slopes + 16 + 2 * static_cast<double>(strip_lines));
        double layers = sizeof(float);
        if (db.has_culture_height) layers += sizeof(float);
        // While a chunk is read its posts stand in the order of the file and in that of the lines.
        double bytes =
            2 * layers * width * static_cast<double>(std::min(strip_lines, std::max<std::int64_t>(lines, 1)));
        if (db.has_culture)
            bytes += 5 * (width + 4) * (static_cast<double>(strip_lines) + 4) *
                     std::abs(db.culture_column_scale * db.culture_row_scale);
        chunk = std::max(chunk, bytes);
        const double k = static_cast<double>(grid.rings(q).back().spokes);
        spokes = std::max(spokes, std::min(2 * k + 1, k * slopes + 64));
    }
    return static_cast<std::size_t>(cells + chunk + spokes * 1.5 * 180 + 512 * 1024);
}

}  // namespace

Plan plan(const ResolvedScene& scene, const WedgeSource& source, const SpokeGrid& grid, const EngineParams& params,
          int threads) {
    const DataBase& db = source.data_base();
    Plan p;
    const std::int64_t block = std::min(db.block_columns, db.block_rows);
    p.strip_lines = block < 32 ? 64 : std::min<std::int64_t>(block, 256);
    const auto size = static_cast<double>(scene.scene.display.size);
    p.fixed_bytes = static_cast<std::size_t>(static_cast<double>(scene.swept.cells()) * 5 +
                                             static_cast<double>(scene.shown.cells()) * (4 + 4 + 1) + 2 * size * size) +
                    source.cache_bytes();
    if (scene.scene.receiver.speckle_looks > 0 || scene.scene.receiver.noise) p.fixed_bytes += scene.swept.cells() * 24;

    const std::int64_t bins = scene.swept.azimuth_bins.size();
    std::int64_t count = std::clamp<std::int64_t>(std::max<std::int64_t>(params.wedges, 1), 1, bins);
    if (params.wedges == 0) count = std::min<std::int64_t>(bins, threads > 1 ? 8 * threads : 4);
    const auto bytes = [&](std::int64_t n) { return wedge_bytes(scene, db, grid, (bins + n - 1) / n, p.strip_lines); };
    const auto fits = [&](std::int64_t n, int in_flight) {
        return p.fixed_bytes + bytes(n) * static_cast<std::size_t>(in_flight) <= params.memory_bytes;
    };
    p.in_flight = threads;
    while (!fits(count, p.in_flight) && count < bins) count = std::min(bins, count * 2);
    while (p.in_flight > 1 && !fits(count, p.in_flight)) --p.in_flight;
    if (!fits(count, 1)) {
        constexpr std::size_t mebibyte = std::size_t{1} << 20;
        // The source's cache grows with the budget.
        const double cache = static_cast<double>(source.cache_bytes()),
                     share = cache / static_cast<double>(params.memory_bytes),
                     rest = static_cast<double>(p.fixed_bytes + bytes(bins)) - cache;
        const auto least =
            static_cast<std::size_t>(std::ceil(std::max(rest / (1 - std::min(share, 0.9)), rest + cache) / mebibyte));
        throw InputError(text("memory is ", params.memory_bytes / mebibyte, " MiB; this scene needs at least ", least,
                              " MiB (", scene.swept.azimuth_bins.size(), " x ", scene.swept.range_bins.size(),
                              " cells)"));
    }
    p.wedge_bytes = bytes(count);
    for (std::int64_t i = 0; i < count; ++i)
        p.wedges.push_back({scene.swept.azimuth_bins.begin + bins * i / count,
                            scene.swept.azimuth_bins.begin + bins * (i + 1) / count});
    return p;
}

}  // namespace wedgescope
