#include "lib/coverage_work.hpp"

#include <type_traits>

#include "lib/transpose.hpp"

namespace wedgescope::covering {

LineForm Cover::form(const Side& side, double distance) const {
    return {distance, map_.nadir_minor(side.quadrant), side.square, side.curvature};
}

/// What the desk's spokes have on every line.
void Cover::place_fan(const Side& side, Desk& desk) {
    const Spokes& s = desk.spokes;
    const auto all = static_cast<std::size_t>(s.range.size() / knot + 1);
    for (auto* v : {&desk.fan.slope, &desk.fan.turn, &desk.fan.curvature}) v->resize(all);
    const LineForm any{1, 0, side.square, side.curvature};
    spoke_fan(any, s.of, s.range.begin, all, {desk.fan.slope.data(), desk.fan.turn.data(), desk.fan.curvature.data()});
}

/// Knots of some groups of the desk's spokes, where they stand among all of them.
void Cover::place_knots(const Side& side, const LineForm& line, Interval groups, Desk& desk) const {
    const std::size_t all = desk.fan.slope.size();
    desk.fan.at.resize(all);
    desk.fan.lift.resize(all);
    desk.fan.drop.resize(all);
    auto i = static_cast<std::size_t>(groups.begin);
    const auto n = static_cast<std::size_t>(groups.end) + 1;
    map_.line(side.quadrant, line.distance, desk.fan.slope[i], desk.fan.slope[n - 1], desk.pieces);
    for (std::size_t p = 0; p < desk.pieces.size(); ++p) {
        const SpokeMap::LinePiece& piece = desk.pieces[p];
        std::size_t end = n;
        if (p + 1 < desk.pieces.size())
            for (end = i; end < n && desk.fan.slope[end] < piece.slope_end;) ++end;
        spoke_knots(line, piece_form(piece),
                    {desk.fan.slope.data() + i, desk.fan.turn.data() + i, desk.fan.curvature.data() + i}, end - i,
                    {desk.fan.at.data() + i, nullptr, nullptr, desk.fan.lift.data() + i, desk.fan.drop.data() + i,
                     nullptr, nullptr});
        i = end;
    }
}

void Cover::place_posts(const Side& side, const LineForm& line, std::int64_t k, Interval own, Interval posts,
                        Desk& desk) {
    const std::int64_t first = floor_to(posts.begin, knot), groups = (floor_to(posts.end - 1, knot) - first) / knot + 1;
    const auto n = static_cast<std::size_t>(groups + 1);
    desk.posts.groups = static_cast<std::size_t>(groups);
    const auto make_room = [n](auto& v) {
        if (v.size() < n) v.resize(n);
    };
    for (auto* v : {&desk.posts.minor, &desk.posts.at, &desk.posts.slope, &desk.posts.along}) make_room(*v);
    for (auto* v : {&desk.posts.lift, &desk.posts.drop, &desk.posts.ray, &desk.posts.rise}) make_room(*v);
    const double begin = static_cast<double>(first), least = static_cast<double>(own.begin),
                 most = static_cast<double>(own.end - 1);
    double* from = desk.posts.minor.data();
    for (int i = 0; i < static_cast<int>(n); ++i)
        from[i] = std::min(std::max(begin + static_cast<double>(i * static_cast<int>(knot)), least), most);
    solve_posts(side, line, k, {desk.posts.minor.data(), n}, desk,
                {desk.posts.at.data(), desk.posts.slope.data(), desk.posts.along.data(), desk.posts.lift.data(),
                 desk.posts.drop.data(), desk.posts.ray.data(), desk.posts.rise.data()});
}

/// Of places of a line, in order.
void Cover::solve_posts(const Side& side, const LineForm& line, std::int64_t k, std::span<const double> minor,
                        Desk& desk, const KnotLanes& out) const {
    map_.line(side.quadrant, line.distance, -1, 1, desk.pieces);
    const std::size_t n = minor.size();
    std::size_t i = 0;
    for (std::size_t p = 0; p < desk.pieces.size(); ++p) {
        const SpokeMap::LinePiece& piece = desk.pieces[p];
        std::size_t end = n;
        if (p + 1 < desk.pieces.size()) {
            const double u = (piece.slope_end - piece.middle) * piece.scale;
            const double border = line.nadir_minor + piece.slope_end * line.distance + quartic_at(piece.bend, u);
            for (end = i; end < n && minor[end] < border;) ++end;
        }
        post_knots(line, piece_form(piece), k, minor.data() + i, end - i, out.from(i));
        i = end;
    }
}

/// Slope and way of each post, where those between two knots are off by too much.
void Cover::place_each(const Side& side, const LineForm& line, Interval posts, Desk& desk) const {
    const auto n = static_cast<std::size_t>(posts.size());
    for (auto* v : {&desk.each.minor, &desk.each.at, &desk.each.slope, &desk.each.along})
        if (v->size() < n) v->resize(n);
    for (std::size_t i = 0; i < n; ++i) desk.each.minor[i] = static_cast<double>(posts.begin) + static_cast<double>(i);
    solve_posts(side, line, desk.spokes.of, {desk.each.minor.data(), n}, desk,
                {desk.each.at.data(), desk.each.slope.data(), desk.each.along.data()});
}

double Cover::spoke_at(const Side& side, const LineForm& line, std::int64_t k, double minor) const {
    const double guess = std::clamp((minor - line.nadir_minor) / line.distance, -1.0, 1.0);
    double at = 0, slope = 0, along = 0;
    post_knots(line, piece_form(map_.line_piece(side.quadrant, line.distance, guess)), k, &minor, 1,
               {&at, &slope, &along});
    return at;
}

/// Carries the void state of every spoke over a line, by the positions on it and on the line behind.
void Cover::pass_voids(Desk& desk, Interval window, bool behind) {
    Spokes& s = desk.spokes;
    const float* line = desk.line.data() + line_margin - window.begin;
    const float* before = desk.behind.data() + line_margin - window.begin;
    const auto inside = [&](std::int64_t j) { return j >= window.begin && j < window.end; };
    for (std::size_t i = 0; i < s.count(); ++i) {
        const std::size_t g = i / knot_step;
        const double part = static_cast<double>(i % knot_step) / knot_step;
        const double y = desk.fan.at[g] + part * (desk.fan.at[g + 1] - desk.fan.at[g]);
        const std::int64_t c = floor_i(y), next = y > static_cast<double>(c) ? c + 1 : c;
        if (!inside(c) || !inside(next)) continue;  // ground outside the data base hides nothing
        const auto is_void = [](float z) { return z != z; };
        const bool now = is_void(line[c]) || is_void(line[next]);
        float& top = s.voids.top[i];
        const bool open = top == top && (top > -std::numeric_limits<float>::infinity() || s.voids.lift[i] > 0);
        if (!now && !open) continue;
        const float lift = desk.fan.lift[g] + static_cast<float>(part) * (desk.fan.lift[g + 1] - desk.fan.lift[g]),
                    drop = desk.fan.drop[g] + static_cast<float>(part) * (desk.fan.drop[g + 1] - desk.fan.drop[g]);
        if (!open) s.voids.lift[i] = lift, s.voids.drop[i] = drop;
        // The corners of the cells on the way from the line behind: of one that it leaves by a side those too between which it
        // passes neither line.
        std::int64_t first = c, last = next;
        if (behind) {
            const double y0 = desk.fan.at_behind[g] + part * (desk.fan.at_behind[g + 1] - desk.fan.at_behind[g]);
            const std::int64_t b = floor_i(y0);
            first = std::min(first, b);
            last = std::max(last, y0 > static_cast<double>(b) ? b + 1 : b);
        }
        first = std::max(first, window.begin);
        last = std::min(last, window.end - 1);
        for (std::int64_t j = first; j <= last; ++j) {
            if (!is_void(line[j])) top = std::max(top, line[j]);
            if (behind && !is_void(before[j])) top = std::max(top, before[j]);
        }
        if (top > -std::numeric_limits<float>::infinity()) {
            const float w = lift_.w(top - lift_.sensor_m);
            s.voids.tangent[i] = std::max({s.voids.tangent[i], w * lift - drop, w * s.voids.lift[i] - s.voids.drop[i]});
        }
        if (!now) {
            top = -std::numeric_limits<float>::infinity();
            s.voids.lift[i] = 0;
        }
    }
}

/// Posts of a line, whose knots stand on the desk, test themselves.
void Cover::test_part(const LineForm& line, const Spokes& s, Interval posts, Interval window, Desk& desk) const {
    TestLanes test{};
    test.groups = desk.posts.groups;
    test.origin = window.begin - line_margin;
    test.first = floor_to(posts.begin, knot);
    test.from = desk.posts.minor.data();
    test.at = desk.posts.at.data();
    test.lift = desk.posts.lift.data();
    test.drop = desk.posts.drop.data();
    test.ray = desk.posts.ray.data();
    test.rise = desk.posts.rise.data();
    test.nadir = line.nadir_minor;
    test.distance = line.distance;
    test.bow = bow_per_slope(line) / (static_cast<double>(s.of) * static_cast<double>(s.of));
    test.posts = desk.line.data();
    test.behind = desk.behind.data();
    test.horizon = s.horizon.data();
    test.first_spoke = s.range.begin;
    test.spokes = static_cast<std::int32_t>(s.range.size());
    test.nearest = line.distance <= 1;
    if (!desk.blocks.empty()) test.most_relief_m = static_cast<float>(desk.blocks.cell_relief_m());
    test.target_m = static_cast<float>(params_.target_m);
    test.state = desk.state.data();
    test.raise_m = params_.layer == CoverageLayer::height || voids_ ? desk.raise_m.data() : nullptr;
    test.tangent = voids_ ? desk.tangent.data() : nullptr;
    test_lanes(test, lift_);
}

/// From the desk into the tiles. Runs own different posts, so nobody waits.
void Cover::copy_out(const Strip& strip, Interval window, Desk& desk) {
    const Side& side = *strip.side;
    const Interval lines = strip.lines;
    const auto width = static_cast<std::size_t>(window.size());
    const bool columns = lines_are_columns(side.quadrant);
    const auto copy = [&]<class T>(const T* from) {
        // All tiles of a strip lie beside one another, but where it closes the circle.
        const std::int64_t first = grid_.line_index(side.quadrant, lines.begin),
                           across = tile_of(columns ? db_.real_column(first) : first);
        std::vector<T*> along(static_cast<std::size_t>(tile_of((columns ? db_.rows : db_.columns) - 1) + 1));
        const auto tile = [&](std::int64_t row, std::int64_t column) {
            const CoverageTiles::Key key{row / tile_edge, column / tile_edge};
            const auto look_up = [&] { return tiles_.buffer<T>(*strip.tiles.find(key)->second); };
            if ((columns ? key.second : key.first) != across) return look_up();
            T*& known = along[static_cast<std::size_t>(columns ? key.first : key.second)];
            if (!known) known = look_up();
            return known;
        };
        if (columns)
            copy_columns(side, lines, from, width, tile, desk);
        else
            copy_rows(side, lines, from, width, tile, desk);
    };
    if (bytes_)
        copy(static_cast<const std::uint8_t*>(desk.bytes.data()));
    else
        copy(static_cast<const float*>(desk.values.data()));
}

/// Some rows of all lines, then the next ones: so a tile's rows stay in the cache.
template <class T, class TileOf>
void Cover::copy_columns(const Side& side, Interval lines, const T* from, std::size_t width, TileOf&& tile,
                         const Desk& desk) const {
    constexpr std::int64_t together = 64;
    const std::array<std::uint8_t, together> blank_row = [&] {
        std::array<std::uint8_t, together> bytes;
        bytes.fill(blank_.value_or(0));
        return bytes;
    }();
    const auto is_blank = [&](std::int64_t line) { return desk.blank[static_cast<std::size_t>(line)] != 0; };
    const auto source = [&](std::int64_t line, std::int64_t row) {
        const auto l = static_cast<std::size_t>(line);
        return from + l * width + (row - desk.own[l].begin);
    };
    Interval rows;
    for (const Interval& own : desk.own)
        if (!own.empty()) rows = rows.empty() ? own : hull(rows, own);
    for (std::int64_t row = rows.begin; row < rows.end;) {
        const std::int64_t end = std::min(rows.end, floor_to(row, together) + together);
        for (std::int64_t l = 0; l < lines.size(); l += 16) {
            const std::int64_t l_end = std::min(lines.size(), l + 16);
            if (std::all_of(desk.blank.begin() + l, desk.blank.begin() + l_end, [](std::uint8_t b) { return b != 0; }))
                continue;
            Interval all = {row, end};  // that each of the lines has
            for (std::int64_t i = l; i < l_end; ++i) all = intersection(all, desk.own[static_cast<std::size_t>(i)]);
            if (!std::is_same_v<T, std::uint8_t> || db_.cyclic || l_end - l < 16 || all.empty()) all = {row, row};
            if constexpr (std::is_same_v<T, std::uint8_t>)
                if (!all.empty()) {
                    std::array<const std::uint8_t*, 16> side_by_side;
                    const std::int64_t first = std::min(grid_.line_index(side.quadrant, lines.begin + l),
                                                        grid_.line_index(side.quadrant, lines.begin + l_end - 1));
                    for (std::int64_t i = l; i < l_end; ++i)
                        side_by_side[static_cast<std::size_t>(grid_.line_index(side.quadrant, lines.begin + i) -
                                                              first)] =
                            is_blank(i) ? blank_row.data() : source(i, all.begin);
                    transpose_bytes(side_by_side, static_cast<std::size_t>(all.size()),
                                    tile(row, first) + (all.begin % tile_edge) * tile_edge + first % tile_edge,
                                    static_cast<std::size_t>(tile_edge));
                }
            for (std::int64_t i = l; i < l_end; ++i) {
                if (is_blank(i)) continue;
                const Interval own = intersection(desk.own[static_cast<std::size_t>(i)], {row, end});
                for (const Interval part : {Interval{own.begin, std::min(own.end, all.begin)},
                                            Interval{std::max(own.begin, all.end), own.end}}) {
                    if (part.empty()) continue;
                    const T* cells = source(i, part.begin);
                    for (std::int64_t column :
                         same_columns(db_.real_column(grid_.line_index(side.quadrant, lines.begin + i)))) {
                        T* cell = tile(row, column) + (part.begin % tile_edge) * tile_edge + column % tile_edge;
                        for (std::int64_t j = 0; j < part.size(); ++j) cell[j * tile_edge] = cells[j];
                    }
                }
            }
        }
        row = end;
    }
}

template <class T, class TileOf>
void Cover::copy_rows(const Side& side, Interval lines, const T* from, std::size_t width, TileOf&& tile,
                      const Desk& desk) const {
    for (std::int64_t l = 0; l < lines.size(); ++l) {
        if (desk.blank[static_cast<std::size_t>(l)]) continue;
        const Interval own = desk.own[static_cast<std::size_t>(l)];
        const T* source = from + static_cast<std::size_t>(l) * width;
        const std::int64_t index = grid_.line_index(side.quadrant, lines.begin + l),
                           row = (index % tile_edge) * tile_edge;
        for (std::int64_t j = own.begin; j < own.end;) {
            const std::int64_t real = db_.real_column(j);
            std::int64_t end = std::min(own.end, j + tile_edge - real % tile_edge);
            if (db_.cyclic) end = std::min(end, j + db_.cycle_columns - real);
            std::copy(source + (j - own.begin), source + (end - own.begin), tile(index, real) + row + real % tile_edge);
            if (db_.cyclic && real == 0 && db_.columns > db_.cycle_columns)
                tile(index, db_.cycle_columns)[row + db_.cycle_columns % tile_edge] = source[j - own.begin];
            j = end;
        }
    }
}

}  // namespace wedgescope::covering
