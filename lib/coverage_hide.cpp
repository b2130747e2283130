#include "lib/coverage_work.hpp"

#include "lib/post_extremes.hpp"

namespace wedgescope::covering {

/// Bounds of the blocks under a window, from the source's map; none across the seam of a cyclic raster, where blocks do
/// not meet.
void Cover::ask_map(const Side& side, Interval major, Interval minor, Blocks& blocks) {
    blocks.bounds.clear();
    BlockMap* map = params_.cull ? source_.block_map() : nullptr;
    const bool columns = lines_are_columns(side.quadrant);
    const Window window = columns ? Window{major, minor} : Window{minor, major};
    if (!map || window.columns.begin < 0 || window.columns.end > db_.columns) return;
    const BlockWindow known = map->read(0, blocks_of(window));
    blocks.majors = columns ? known.blocks.columns : known.blocks.rows;
    blocks.minors = columns ? known.blocks.rows : known.blocks.columns;
    for (std::int64_t i = blocks.majors.begin; i < blocks.majors.end; ++i)
        for (std::int64_t j = blocks.minors.begin; j < blocks.minors.end; ++j)
            blocks.bounds.push_back(columns ? known.at(i, j) : known.at(j, i));
}

/// What of some rows of blocks need not be read. `only`: the row that counts alone, of the others what its cells reach.
void Cover::leave_out(bool columns, const Blocks& blocks, Interval majors, std::optional<std::int64_t> only,
                      ChunkRequest& request) {
    request.blocks = columns ? Window{majors, blocks.minors} : Window{blocks.minors, majors};
    for (std::int64_t r = request.blocks.rows.begin; r < request.blocks.rows.end; ++r)
        for (std::int64_t c = request.blocks.columns.begin; c < request.blocks.columns.end; ++c) {
            const std::size_t at = columns ? blocks.at(c, r) : blocks.at(r, c);
            const bool counts = !only || *only == (columns ? c : r), all_void = blocks.bounds[at].voids == Voids::all;
            request.skip.push_back(counts ? blocks.skip[at] : all_void ? Skip::voids : Skip::range);
            request.fill_m.push_back(all_void ? nan_f : blocks.bounds[at].lowest_m);
        }
}

/// As ask_map(), of posts that were read.
void Cover::look_at(const Chunk& chunk, Interval major, Interval minor, Blocks& blocks) const {
    blocks.bounds.clear();
    if (!hides_ || chunk.flat) return;
    blocks.majors = {block_along(major.begin), block_along(major.end - 1) + 1};
    blocks.minors = {block_along(minor.begin), block_along(minor.end - 1) + 1};
    for (std::int64_t i = blocks.majors.begin; i < blocks.majors.end; ++i)
        for (std::int64_t j = blocks.minors.begin; j < blocks.minors.end; ++j) {
            const Interval lines = intersection(major, {i * block_posts, (i + 1) * block_posts + 1}),
                           posts = intersection(minor, {j * block_posts, (j + 1) * block_posts + 1});
            const PostExtremes extremes = post_extremes(
                chunk.surface_m.data() + (lines.begin - major.begin) * minor.size() + posts.begin - minor.begin,
                static_cast<std::size_t>(minor.size()), static_cast<std::size_t>(lines.size()),
                static_cast<std::size_t>(posts.size()));
            BlockBounds b;
            b.lowest_m = extremes.lowest_m;
            b.highest_m = extremes.highest_m;
            b.voids = b.lowest_m > b.highest_m ? Voids::all : extremes.voids > 0 ? Voids::some : Voids::none;
            blocks.bounds.push_back(b);
        }
}

/// What blocks of a row are before any horizon hides them.
void Cover::begin_row(std::int64_t major, bool all_posts, Blocks& blocks) const {
    for (std::int64_t j = blocks.minors.begin; j < blocks.minors.end; ++j)
        blocks.skip[blocks.at(major, j)] = blocks.bounds[blocks.at(major, j)].voids == Voids::all ? Skip::voids
                                           : all_posts                                            ? Skip::none
                                                                                                  : Skip::range;
    // A void's horizon comes from the posts round it: what lies beside one is read, and so is the void itself, so that it is for
    // the lines next to it.
    const auto beside_void = [&](std::int64_t j) {
        for (std::int64_t i = std::max(major - 1, blocks.majors.begin); i < std::min(major + 2, blocks.majors.end); ++i)
            for (std::int64_t k = std::max(j - 1, blocks.minors.begin); k < std::min(j + 2, blocks.minors.end); ++k)
                if (blocks.bounds[blocks.at(i, k)].voids != Voids::none) return true;
        return false;
    };
    if (voids_)
        for (std::int64_t j = blocks.minors.begin; j < blocks.minors.end; ++j)
            if (beside_void(j)) blocks.skip[blocks.at(major, j)] = Skip::none;
}

/// Which blocks stay below the spokes of each group that comes by, and which groups meet none that does not. Lines as in hide(), knots of
/// the nearest and of the farthest in `desk`.
void Cover::judge(const Side& side, const LineForm& near, Interval lines, std::int64_t major, Interval in_fan,
                  Desk& desk) const {
    Blocks& blocks = desk.blocks;
    const Spokes& s = desk.spokes;
    const Quadrant q = side.quadrant;
    const std::int64_t groups = s.range.size() / knot;
    desk.row.least.resize(static_cast<std::size_t>(groups));
    least_of_groups(s.horizon.data(), desk.row.least.size(), desk.row.least.data());
    // Far above what float's rounding, and straight lines between knots, make of a tangent.
    constexpr double slack = 0x1p-14;
    const double spokes = static_cast<double>(s.of),
                 bow = std::abs(bow_per_slope(near)) * (0.25 * knot * knot) / (spokes * spokes);
    const double raised_m = params_.target_m + blocks.cell_relief_m() * static_cast<double>(place_slack);
    desk.row.block_w.clear();
    for (std::int64_t j = blocks.minors.begin; j < blocks.minors.end; ++j) {
        const BlockBounds& b = blocks.bounds[blocks.at(major, j)];
        const double top_m = static_cast<double>(b.highest_m) + static_cast<double>(b.culture_m) + raised_m,
                     w = (top_m - static_cast<double>(lift_.sensor_m)) /
                         (1 + top_m * static_cast<double>(lift_.inverse_radius));
        desk.row.block_w.push_back(b.voids == Voids::none ? w : std::numeric_limits<double>::infinity());
    }
    const std::int64_t spare = 3 + ceil_i(map_.sag(q, static_cast<double>(lines.size() + 2)));
    desk.row.touched.assign(static_cast<std::size_t>(groups), {});
    desk.row.quiet.assign(static_cast<std::size_t>(groups), 0);
    for (std::int64_t g = 0; g < groups; ++g) {
        const auto i = static_cast<std::size_t>(g);
        const Interval touched =
            intersection({block_along(floor_i(std::min(desk.fan.at[i], desk.row.far_at[i])) - spare),
                          block_along(ceil_i(std::max(desk.fan.at[i + 1], desk.row.far_at[i + 1])) + spare) + 1},
                         blocks.minors);
        desk.row.touched[i] = touched;
        if (!in_fan.contains(g)) continue;
        float least = desk.row.least[static_cast<std::size_t>(g)];
        for (const std::int64_t beside : {g - 1, g + 1})
            if (in_fan.contains(beside)) least = std::min(least, desk.row.least[static_cast<std::size_t>(beside)]);
        const double steep = static_cast<double>(std::max(desk.fan.lift[i], desk.fan.lift[i + 1])),
                     gentle = static_cast<double>(std::min(desk.row.far_lift[i], desk.row.far_lift[i + 1])),
                     drop = static_cast<double>(std::min(desk.fan.drop[i], desk.fan.drop[i + 1])) - bow;
        bool judged = hides_ && has(least);
        if (judged && scene_.range_limited) {
            // All that a block holds must be in range, whatever its height.
            const auto metres = [&](std::int64_t k) {
                const double m = static_cast<double>(k) / spokes;
                return std::sqrt(quadratic(side.square, m));
            };
            const std::int64_t k = s.range.begin + g * knot;
            const double arc = 1.03 * std::max(metres(k), metres(k + knot)) / gentle;
            judged = arc * (1 + arc * scene_.earth.inverse_radius()) + 2 * std::abs(scene_.sensor_m) +
                         2 * blocks.most_m + params_.target_m <
                     *scene_.scene.range_m;
        }
        bool quiet = judged;
        for (std::int64_t j = touched.begin; j < touched.end; ++j) {
            Skip& skip = blocks.skip[blocks.at(major, j)];
            if (skip == Skip::voids || (skip == Skip::none && !quiet)) continue;
            const double w = desk.row.block_w[static_cast<std::size_t>(j - blocks.minors.begin)],
                         highest = w * (w > 0 ? steep : gentle) - drop + slack * (std::abs(w) * steep + drop);
            const bool below = judged && highest < static_cast<double>(least);
            quiet = quiet && below;
            if (skip != Skip::none) skip = below ? Skip::hidden : Skip::none;
        }
        desk.row.quiet[i] = quiet ? 1 : 0;
    }
}

/// Those that come by something else than hidden blocks, and those whose horizons nobody knows.
void Cover::gather_groups(std::int64_t major, Interval counted, Interval in_fan, Desk& desk) {
    const Blocks& blocks = desk.blocks;
    desk.row.groups.clear();
    for (std::int64_t g = counted.begin; g < counted.end; ++g) {
        const auto i = static_cast<std::size_t>(g);
        const Interval touched = desk.row.touched[i];
        bool rises = !in_fan.contains(g);
        for (std::int64_t j = touched.begin; j < touched.end && !rises && !desk.row.quiet[i]; ++j)
            rises = blocks.skip[blocks.at(major, j)] == Skip::none;
        if (!rises) continue;
        // Runs that all but meet are one.
        if (!desk.row.groups.empty() && g - desk.row.groups.back().end < 4)
            desk.row.groups.back().end = g + 1;
        else
            desk.row.groups.push_back({g, g + 1});
    }
}

/// Judges the blocks of one row, of which `lines` are to come, by the horizons that the desk's spokes have now: these
/// only rise, and a spoke between two never gets less than the lower of them. A block is hidden if its highest ground,
/// with a target on it, stays below the spokes that come by, and those beside them: then no sample of it raises a
/// horizon, and no post of it is seen. Heights from the lowest to the highest give the same answers then, so what is
/// not read may have any of them. Leaves the groups of spokes that come by something else; `core`: the run's own spokes.
void Cover::hide(const Side& side, Interval lines, std::int64_t major, Interval core, bool all_posts, Desk& desk) {
    Blocks& blocks = desk.blocks;
    const Spokes& s = desk.spokes;
    const Quadrant q = side.quadrant;
    begin_row(major, all_posts, blocks);
    const auto expose = [&](std::int64_t j) {
        Skip& skip = blocks.skip[blocks.at(major, j)];
        if (skip != Skip::voids) skip = Skip::none;
    };
    // A line more on either side, for the cells that reach into the row.
    if (lines.begin < 1 || grid_.distance(q, lines.begin) < 3) {
        for (std::int64_t j = blocks.minors.begin; j < blocks.minors.end; ++j) expose(j);
        desk.row.groups = {{0, s.range.size() / knot}};
        desk.row.touched.assign(static_cast<std::size_t>(s.range.size() / knot), blocks.minors);
        return;
    }
    const LineForm near = form(side, grid_.distance(q, lines.begin) - 1),
                   far = form(side, grid_.distance(q, lines.end - 1) + 1);
    const std::int64_t growth = s.of / side.spokes.of, groups = s.range.size() / knot;
    place_knots(side, far, {0, groups}, desk);
    std::swap(desk.fan.at, desk.row.far_at);
    std::swap(desk.fan.lift, desk.row.far_lift);
    place_knots(side, near, {0, groups}, desk);
    // Spokes beyond the fan are nobody's; nor are those that doublings brought beyond it, of which the last has one parent.
    const Interval carried =
        intersection({side.spokes.range.begin * growth, side.spokes.range.end * growth}, fan(side, s.of));
    // Of the run's neighbours one group on either side counts: at a doubling those outside have only one parent.
    const Interval counted =
        intersection({(core.begin - s.range.begin) / knot - 1, (core.end - s.range.begin) / knot + 1}, {0, groups});
    const auto first_from = [&](std::int64_t spoke) { return -floor_to(s.range.begin - spoke, knot) / knot; };
    const Interval in_fan = intersection(counted, {first_from(carried.begin), first_from(carried.end)});
    judge(side, near, lines, major, in_fan, desk);
    gather_groups(major, counted, in_fan, desk);
}

/// Of the row of blocks that was judged last: posts along its lines that those which test themselves, and spokes that may be
/// raised, look at.
Interval Cover::looked_at_part(std::int64_t row, const Desk& desk) {
    const Blocks& blocks = desk.blocks;
    Interval found;
    for (std::int64_t j = blocks.minors.begin; j < blocks.minors.end; ++j)
        if (blocks.skip[blocks.at(row, j)] == Skip::none) found = hull(found, {j, j + 1});
    for (const Interval& part : desk.row.groups)
        for (std::int64_t g = part.begin; g < part.end; ++g)
            found = hull(found, desk.row.touched[static_cast<std::size_t>(g)]);
    constexpr std::int64_t beside = 4;
    return found.empty() ? found : Interval{found.begin * block_posts - beside, found.end * block_posts + beside};
}

/// Parts of the posts of a row of blocks, with why they need no test; beyond the blocks there is no reason.
void Cover::part_row(std::int64_t row, Desk& desk) {
    const Blocks& blocks = desk.blocks;
    constexpr std::int64_t far = std::numeric_limits<std::int64_t>::max();
    desk.row_parts = {{{-far, blocks.empty() ? far : blocks.minors.begin * block_posts}, Skip::none}};
    if (blocks.empty()) return;
    const auto add = [&](std::int64_t end, Skip why) {
        if (desk.row_parts.back().second == why)
            desk.row_parts.back().first.end = end;
        else
            desk.row_parts.push_back({{desk.row_parts.back().first.end, end}, why});
    };
    for (std::int64_t j = blocks.minors.begin; j < blocks.minors.end; ++j)
        add((j + 1) * block_posts, blocks.skip[blocks.at(row, j)]);
    add(far, Skip::none);
}

/// The same of a line's posts.
void Cover::part_line(Interval posts, Desk& desk) {
    desk.parts.clear();
    for (const auto& [part, why] : desk.row_parts) {
        if (part.begin >= posts.end) break;
        if (const Interval own = intersection(part, posts); !own.empty()) desk.parts.push_back({own, why});
    }
}

}  // namespace wedgescope::covering
