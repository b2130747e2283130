#include "lib/coverage_work.hpp"

#include <type_traits>

#include "lib/stopwatch.hpp"
#include "lib/transpose.hpp"

namespace wedgescope::covering {

namespace {

PieceForm piece_form(const SpokeMap::LinePiece& piece) {
    return {piece.middle, piece.scale, piece.bend, piece.stretch};
}

/// Twice as many: even spokes are their parents, odd ones stand between two; where one of these has met no ground, at
/// the raster's edge, the child has met none either.
void double_spokes(Spokes& s, Spokes& scratch) {
    const std::size_t n = s.count();
    scratch.resize(2 * s.of, {2 * s.range.begin, 2 * s.range.end}, !s.voids.empty());
    for (std::size_t i = 0; i < n; ++i) {
        const float a = s.horizon[i], b = i + 1 < n ? s.horizon[i + 1] : no_horizon_f;
        scratch.horizon[2 * i] = a;
        scratch.horizon[2 * i + 1] = has(a) && has(b) ? 0.5F * (a + b) : no_horizon_f;
    }
    if (!s.voids.empty())
        for (std::size_t i = 0; i < n; ++i) {
            const std::size_t next = std::min(i + 1, n - 1);
            for (std::size_t child : {2 * i, 2 * i + 1}) {
                scratch.voids.tangent[child] = s.voids.tangent[i];
                scratch.voids.top[child] = s.voids.top[i];
                scratch.voids.lift[child] = s.voids.lift[i];
                scratch.voids.drop[child] = s.voids.drop[i];
            }
            scratch.voids.tangent[2 * i + 1] = std::max(s.voids.tangent[i], s.voids.tangent[next]);
        }
    std::swap(s, scratch);
}

}  // namespace

LineForm Cover::form(const Side& side, double distance) const {
    return {distance, map_.nadir_minor(side.quadrant), side.square, side.curvature};
}

/// What the desk's spokes have on every line.
void Cover::place_fan(const Side& side, Desk& desk) {
    const Spokes& s = desk.spokes;
    const auto all = static_cast<std::size_t>(s.range.size() / knot + 1);
    for (auto* v : {&desk.slope, &desk.turn, &desk.curvature}) v->resize(all);
    const LineForm any{1, 0, side.square, side.curvature};
    spoke_fan(any, s.of, s.range.begin, all, {desk.slope.data(), desk.turn.data(), desk.curvature.data()});
}

/// Knots of some groups of the desk's spokes, where they stand among all of them.
void Cover::place_knots(const Side& side, const LineForm& line, Interval groups, Desk& desk) const {
    const std::size_t all = desk.slope.size();
    desk.at.resize(all);
    desk.lift.resize(all);
    desk.drop.resize(all);
    auto i = static_cast<std::size_t>(groups.begin);
    const auto n = static_cast<std::size_t>(groups.end) + 1;
    map_.line(side.quadrant, line.distance, desk.slope[i], desk.slope[n - 1], desk.pieces);
    for (std::size_t p = 0; p < desk.pieces.size(); ++p) {
        const SpokeMap::LinePiece& piece = desk.pieces[p];
        std::size_t end = n;
        if (p + 1 < desk.pieces.size())
            for (end = i; end < n && desk.slope[end] < piece.slope_end;) ++end;
        spoke_knots(
            line, piece_form(piece), {desk.slope.data() + i, desk.turn.data() + i, desk.curvature.data() + i}, end - i,
            {desk.at.data() + i, nullptr, nullptr, desk.lift.data() + i, desk.drop.data() + i, nullptr, nullptr});
        i = end;
    }
}

void Cover::place_posts(const Side& side, const LineForm& line, std::int64_t k, Interval own, Interval posts,
                        Desk& desk) {
    const std::int64_t first = floor_to(posts.begin, knot), groups = (floor_to(posts.end - 1, knot) - first) / knot + 1;
    const auto n = static_cast<std::size_t>(groups + 1);
    desk.post_groups = static_cast<std::size_t>(groups);
    const auto make_room = [n](auto& v) {
        if (v.size() < n) v.resize(n);
    };
    for (auto* v : {&desk.from, &desk.post_at, &desk.post_slope, &desk.post_along}) make_room(*v);
    for (auto* v : {&desk.post_lift, &desk.post_drop, &desk.post_ray, &desk.post_rise}) make_room(*v);
    const double begin = static_cast<double>(first), least = static_cast<double>(own.begin),
                 most = static_cast<double>(own.end - 1);
    double* from = desk.from.data();
    for (int i = 0; i < static_cast<int>(n); ++i)
        from[i] = std::min(std::max(begin + static_cast<double>(i * static_cast<int>(knot)), least), most);
    map_.line(side.quadrant, line.distance, -1, 1, desk.pieces);
    std::size_t i = 0;
    for (std::size_t p = 0; p < desk.pieces.size(); ++p) {
        const SpokeMap::LinePiece& piece = desk.pieces[p];
        std::size_t end = n;
        if (p + 1 < desk.pieces.size()) {
            const double u = (piece.slope_end - piece.middle) * piece.scale;
            const double border = line.nadir_minor + piece.slope_end * line.distance + piece.bend[0] +
                                  u * (piece.bend[1] + u * (piece.bend[2] + u * (piece.bend[3] + u * piece.bend[4])));
            for (end = i; end < n && desk.from[end] < border;) ++end;
        }
        post_knots(
            line, piece_form(piece), k, desk.from.data() + i, end - i,
            {desk.post_at.data() + i, desk.post_slope.data() + i, desk.post_along.data() + i, desk.post_lift.data() + i,
             desk.post_drop.data() + i, desk.post_ray.data() + i, desk.post_rise.data() + i});
        i = end;
    }
}

double Cover::spoke_at(const Side& side, const LineForm& line, std::int64_t k, double minor) const {
    const double guess = std::clamp((minor - line.nadir_minor) / line.distance, -1.0, 1.0);
    double at = 0, slope = 0, along = 0;
    float lift = 0, drop = 0, ray = 0, rise = 0;
    post_knots(line, piece_form(map_.line_piece(side.quadrant, line.distance, guess)), k, &minor, 1,
               {&at, &slope, &along, &lift, &drop, &ray, &rise});
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
        const double y = desk.at[g] + part * (desk.at[g + 1] - desk.at[g]);
        const std::int64_t c = floor_i(y), next = y > static_cast<double>(c) ? c + 1 : c;
        if (!inside(c) || !inside(next)) continue;  // ground outside the data base hides nothing
        const auto is_void = [](float z) { return z != z; };
        const bool now = is_void(line[c]) || is_void(line[next]);
        float& top = s.voids.top[i];
        const bool open = top == top && (top > -std::numeric_limits<float>::infinity() || s.voids.lift[i] > 0);
        if (!now && !open) continue;
        const float lift = desk.lift[g] + static_cast<float>(part) * (desk.lift[g + 1] - desk.lift[g]),
                    drop = desk.drop[g] + static_cast<float>(part) * (desk.drop[g + 1] - desk.drop[g]);
        if (!open) s.voids.lift[i] = lift, s.voids.drop[i] = drop;
        for (std::int64_t j : {c, next})
            if (!is_void(line[j])) top = std::max(top, line[j]);
        if (behind) {
            const double y0 = desk.at_behind[g] + part * (desk.at_behind[g + 1] - desk.at_behind[g]);
            const std::int64_t b = floor_i(y0);
            for (std::int64_t j : {b, y0 > static_cast<double>(b) ? b + 1 : b})
                if (inside(j) && !is_void(before[j])) top = std::max(top, before[j]);
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
    test.groups = desk.post_groups;
    test.origin = window.begin - line_margin;
    test.first = floor_to(posts.begin, knot);
    test.from = desk.from.data();
    test.at = desk.post_at.data();
    test.lift = desk.post_lift.data();
    test.drop = desk.post_drop.data();
    test.ray = desk.post_ray.data();
    test.rise = desk.post_rise.data();
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

void Cover::sweep(Strip& strip, std::size_t run) {
    if (params_.stop) params_.stop->check();
    const Side& side = *strip.side;
    const Interval lines = strip.lines, spokes = strip.runs[run];
    const std::vector<Interval>& own = strip.own;
    const bool first = run == 0, last = run + 1 == strip.runs.size();
    Spokes& after = strip.after;
    const Quadrant q = side.quadrant;
    const bool columns = lines_are_columns(q);
    Desk& desk = desks_.local();
    QuadrantReport& did = desk.did[static_cast<std::size_t>(q)];
    ++did.runs;
    if (desk.culture) desk.culture->forget();  // what is read shall not hang on who sweeps which run
    const Span span(params_.timeline, "run", "wedge", static_cast<std::int64_t>(q));
    const Stopwatch all_of_it;
    double load_s = 0;
    // One group of neighbours on either side.
    Spokes& s = desk.spokes;
    s.resize(side.spokes.of, {spokes.begin - knot, spokes.end + knot}, voids_);
    {
        const Interval mine = intersection(s.range, side.spokes.range);
        const auto to = static_cast<std::ptrdiff_t>(mine.begin - s.range.begin),
                   from = static_cast<std::ptrdiff_t>(mine.begin - side.spokes.range.begin);
        const auto take = [&](const std::vector<float>& a, std::vector<float>& b) {
            std::copy(a.begin() + from, a.begin() + from + static_cast<std::ptrdiff_t>(mine.size()), b.begin() + to);
        };
        take(side.spokes.horizon, s.horizon);
        if (voids_) {
            take(side.spokes.voids.tangent, s.voids.tangent);
            take(side.spokes.voids.top, s.voids.top);
            take(side.spokes.voids.lift, s.voids.lift);
            take(side.spokes.voids.drop, s.voids.drop);
        }
    }
    place_fan(side, desk);
    // Posts that the spokes can touch.
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    for (std::int64_t line : {lines.begin, lines.end - 1}) {
        const double d = grid_.distance(q, line);
        const LineForm at = form(side, d);
        place_knots(side, at, {0, s.range.size() / knot}, desk);
        lo = std::min(lo, *std::min_element(desk.at.begin(), desk.at.end()));
        hi = std::max(hi, *std::max_element(desk.at.begin(), desk.at.end()));
    }
    const std::int64_t sag = ceil_i(map_.sag(q, static_cast<double>(lines.size())));
    Interval window = intersection({floor_i(lo) - 4 - sag, ceil_i(hi) + 5 + sag}, side.minor);
    for (std::size_t l = 0; l < static_cast<std::size_t>(lines.size()); ++l)
        if (first && last) window = hull(window, own[l]);
    desk.own.assign(static_cast<std::size_t>(lines.size()), {});
    desk.blank.assign(desk.own.size(), 0);
    const auto state_of = [](Skip why) {
        return static_cast<std::uint8_t>(why == Skip::voids ? State::no_data : State::shadow);
    };
    // The line behind the strip too, if the raster has it.
    std::int64_t before = grid_.line_index(q, lines.begin) - outward(q);
    const bool has_before = (db_.cyclic && columns) || (before >= 0 && before < (columns ? db_.columns : db_.rows));
    const std::int64_t a = has_before ? before : before + outward(q), b = grid_.line_index(q, lines.end - 1);
    const Interval major{std::min(a, b), std::max(a, b) + 1};
    // Of a row of blocks the lines that are swept here; where it is only the line behind, that one.
    const auto row_lines = [&](std::int64_t row) {
        const Interval part = intersection({row * block_posts, (row + 1) * block_posts}, major);
        const std::int64_t zero = grid_.line_index(q, 0);
        return outward(q) > 0 ? Interval{part.begin - zero, part.end - zero}
                              : Interval{zero - part.end + 1, zero - part.begin + 1};
    };
    Blocks& blocks = desk.blocks;
    blocks.bounds.clear();
    Chunk chunk;
    Interval held, held_posts;  // lines of the chunk, as the raster counts them, and which posts of each
    const auto rectangle = [&](Interval of_lines, Interval posts) {
        return columns ? Window{of_lines, posts} : Window{posts, of_lines};
    };
    const auto load = [&](Interval of_lines, ChunkRequest request) {
        request.window = rectangle(of_lines, window);
        request.lines_are_columns = columns;
        Span reading(params_.timeline, "load", "wedge", static_cast<std::int64_t>(q));
        const Stopwatch watch;
        chunk = {};
        chunk = source_.load(request);
        reading.add_bytes(chunk.bytes_read);
        const Stopwatch::Took took = watch.took();
        load_s += took.cpu_s;
        did.disk_wait_s += took.wait_s;
        did.posts_read += chunk.posts_read;
        did.bytes_read += chunk.bytes_read;
        did.bytes_spilled += chunk.bytes_spilled;
        held = of_lines;
        held_posts = columns ? chunk.window.rows : chunk.window.columns;
        if (!tables_) return;
        if (db_.has_culture) culture_of(desk).open(request.window, false);
    };
    // With a map each row of blocks is read when its turn comes, and what is hidden by then is not.
    bool mapped = false;
    if (!window.empty()) {
        ask_map(side, major, window, blocks);
        mapped = !blocks.empty();
        if (!mapped) {
            load(major, {});
            look_at(chunk, major, window, blocks);
        }
        blocks.measure();
    }
    const auto width = static_cast<std::size_t>(window.size());
    for (auto* v : {&desk.line, &desk.behind, &desk.raise_m, &desk.tangent})
        v->assign(width + 2 * static_cast<std::size_t>(line_margin), nan_f);
    desk.state.assign(desk.line.size(), 0);
    if (bytes_)
        desk.bytes.resize(width * static_cast<std::size_t>(lines.size()));
    else
        desk.values.resize(width * static_cast<std::size_t>(lines.size()));
    const auto take_line = [&](std::int64_t index, std::vector<float>& to) {
        if (held_posts.empty()) return;
        const std::int64_t at = chunk.flat ? 0 : index - held.begin, n = held_posts.size();
        const float* from = chunk.surface_m.data() + at * n;
        std::copy(from, from + n, to.begin() + line_margin + (held_posts.begin - window.begin));
    };
    const auto take_culture = [&](std::int64_t index) {
        desk.culture_m = {};
        if (chunk.culture_height_m.empty() || held_posts.empty()) return;
        const auto at = static_cast<std::size_t>(chunk.flat ? 0 : index - held.begin),
                   n = static_cast<std::size_t>(held_posts.size());
        desk.culture_m = std::span(chunk.culture_height_m).subspan(at * n, n);
        desk.culture_begin = held_posts.begin;
    };
    // Which line of the raster each buffer holds, if any: lines that nothing comes of are not copied.
    constexpr std::int64_t no_line = std::numeric_limits<std::int64_t>::min();
    std::int64_t in_line = no_line, in_behind = no_line;
    const auto hold = [&](std::int64_t index, std::vector<float>& buffer, std::int64_t& of) {
        if (of != index && index != no_line) take_line(index, buffer);
        of = index;
    };

    Interval core = spokes;
    const auto& rings = grid_.rings(q);
    std::size_t ring = 0;
    while (ring + 1 < rings.size() && rings[ring + 1].lines.begin <= lines.begin) ++ring;
    const double nadir = map_.nadir_minor(q);
    std::int64_t row = block_along(grid_.line_index(q, lines.begin)) - outward(q);  // of blocks
    bool row_has_voids = true;
    for (std::int64_t line = lines.begin; line < lines.end; ++line) {
        const std::int64_t index = grid_.line_index(q, line), index_behind = line > lines.begin ? index - outward(q)
                                                                             : has_before       ? before
                                                                                                : no_line;
        while (ring + 1 < rings.size() && rings[ring + 1].lines.begin <= line) ++ring;
        const double d = grid_.distance(q, line);
        const bool next_row = block_along(index) != row;
        if (next_row) {
            const std::int64_t row_behind = row;
            row = block_along(index);
            if (!blocks.empty()) {
                const bool behind_counts = crosses(d) && index_behind != no_line;
                if (mapped && line == lines.begin && behind_counts && row_behind == block_along(index_behind))
                    hide(side, row_lines(row_behind), row_behind, core, first && last, desk);
                hide(side, intersection(row_lines(row), lines), row, core, first && last, desk);
                const auto from =
                    blocks.bounds.begin() + static_cast<std::ptrdiff_t>(blocks.at(row, blocks.minors.begin));
                row_has_voids = std::any_of(from, from + static_cast<std::ptrdiff_t>(blocks.minors.size()),
                                            [](const BlockBounds& bounds) { return bounds.voids != Voids::none; });
                if (mapped) {
                    const Interval band = intersection(row_lines(row), lines);
                    const std::int64_t near = index_behind != no_line ? index_behind : index,
                                       far = grid_.line_index(q, band.end - 1);
                    const Interval of_lines{std::min(near, far), std::max(near, far) + 1};
                    ChunkRequest request;
                    leave_out(columns, blocks, {block_along(of_lines.begin), block_along(of_lines.end - 1) + 1},
                              behind_counts ? std::nullopt : std::optional(row), request);
                    if (narrows_ && !crosses(d)) request.looked_at = rectangle(of_lines, looked_at_part(row, desk));
                    load(of_lines, std::move(request));
                    // Of the last row's lines the buffers hold what was needed then.
                    in_line = in_behind = no_line;
                }
            }
            part_row(row, desk);
        }
        bool doubled = line == lines.begin;
        const bool too_few = s.of < rings[ring].spokes;
        while (s.of < rings[ring].spokes) {
            double_spokes(s, desk.scratch);
            core = {2 * core.begin, 2 * core.end};
            for (Interval& groups : desk.groups) groups = {2 * groups.begin, 2 * groups.end};
            doubled = true;
        }
        if (too_few) place_fan(side, desk);
        const LineForm here = form(side, d);
        // On the first line of a row of blocks cells of the last one lie behind.
        const Between between = looked_at_between(d);
        const bool cross = between != Between::nothing && (line > 0 || between == Between::course),
                   everywhere = blocks.empty() || voids_ || (cross && next_row);
        desk.every_group = {{0, s.range.size() / knot}};
        const std::vector<Interval>& groups = everywhere ? desk.every_group : desk.groups;
        if (cross || voids_) {
            if (line > 0 && (doubled || next_row))
                for (const Interval& part : groups) place_knots(side, form(side, d - 1), part, desk);
            std::swap(desk.at, desk.at_behind);
        }
        for (const Interval& part : groups) place_knots(side, here, part, desk);
        if (line == 0 && cross) {
            // The line behind lies behind the sensor.
            desk.at_behind.resize(desk.at.size());
            for (std::size_t i = 0; i < desk.at.size(); ++i) desk.at_behind[i] = desk.at[i] - desk.slope[i];
        }

        const auto l = static_cast<std::size_t>(line - lines.begin);
        const Interval all = own[l];
        const auto edge = [&](std::int64_t k) {
            const double slope = static_cast<double>(k) / static_cast<double>(s.of);
            return ceil_i(spoke_place(here, piece_form(map_.line_piece(q, d, slope)), slope));
        };
        const Interval posts{first ? all.begin : std::clamp(edge(core.begin), all.begin, all.end),
                             last ? all.end : std::clamp(edge(core.end), all.begin, all.end)};
        desk.parts.clear();
        if (!posts.empty()) {
            desk.own[l] = posts;
            part_line(posts, desk);
        }
        const bool blank = std::all_of(desk.parts.begin(), desk.parts.end(), [&](const auto& part) {
            return part.second != Skip::none && byte_of(state_of(part.second)) == blank_;
        });
        desk.blank[l] = blank ? 1 : 0;
        const bool looked_at = std::any_of(desk.parts.begin(), desk.parts.end(),
                                           [&](const auto& part) { return with_posts_ || part.second == Skip::none; });
        if (looked_at || !groups.empty()) {
            if (in_line == index_behind) {
                std::swap(desk.line, desk.behind);
                std::swap(in_line, in_behind);
            }
            hold(index_behind, desk.behind, in_behind);
            hold(index, desk.line, in_line);
        }
        if (tables_ && looked_at) take_culture(index);
        for (const auto& [part, why] : desk.parts) {
            const std::size_t out = l * width + static_cast<std::size_t>(part.begin - posts.begin);
            if (why != Skip::none) {
                did.posts_passed += static_cast<std::uint64_t>(part.size());
                const std::uint8_t state = state_of(why);
                if (!with_posts_) {
                    desk.states[state] += static_cast<std::uint64_t>(part.size());
                    if (blank) continue;
                    std::fill_n(desk.bytes.begin() + static_cast<std::ptrdiff_t>(out), part.size(), byte_of(state));
                    continue;
                }
                std::fill_n(desk.state.begin() + (part.begin - window.begin + line_margin), part.size(), state);
            }
            place_posts(side, here, s.of, all, part, desk);
            if (why == Skip::none) test_part(here, s, part, window, desk);
            finish_line(side, here, index, part, window, desk, out);
        }
        if (width > 0) {
            if (voids_ && (row_has_voids || next_row)) pass_voids(desk, window, line > 0);
            RaiseLanes raise{};
            raise.origin = window.begin - line_margin;
            raise.posts = desk.line.data();
            raise.behind = desk.behind.data();
            raise.distance = static_cast<float>(d);
            raise.bow =
                static_cast<float>(bow_per_slope(here) / (static_cast<double>(s.of) * static_cast<double>(s.of)));
            for (const Interval& part : groups) {
                // Groups that touch the window; the others meet no ground.
                auto g = static_cast<std::size_t>(part.begin), end = static_cast<std::size_t>(part.end);
                while (g < end && desk.at[g + 1] <= static_cast<double>(window.begin - 1)) ++g;
                while (end > g && desk.at[end - 1] >= static_cast<double>(window.end)) --end;
                raise.groups = end - g;
                raise.at = desk.at.data() + g;
                raise.at_behind = cross ? desk.at_behind.data() + g : raise.at;
                raise.lift = desk.lift.data() + g;
                raise.drop = desk.drop.data() + g;
                raise.horizon = s.horizon.data() + g * knot_step;
                raise_lanes(raise, lift_, cross ? between : Between::nothing);
            }
        }
        // Where spokes leave the raster, the first one outside is a neighbour of the last posts inside: it follows.
        const auto follow = [&](std::int64_t outside, std::int64_t inside) {
            if (s.range.contains(outside) && s.range.contains(inside))
                s.horizon[static_cast<std::size_t>(outside - s.range.begin)] =
                    s.horizon[static_cast<std::size_t>(inside - s.range.begin)];
        };
        if (!(db_.cyclic && !columns)) {
            if (window.begin == side.minor.begin && nadir >= 0 && nadir < d * 1.5) {
                const std::int64_t outside = ceil_i(spoke_at(side, here, s.of, 0)) - 1;
                follow(outside, outside + 1);
            }
            const auto top = static_cast<double>(side.minor.end - 1);
            if (window.end == side.minor.end && nadir <= top && top - nadir < d * 1.5) {
                const std::int64_t outside = floor_i(spoke_at(side, here, s.of, top)) + 1;
                follow(outside, outside - 1);
            }
        }
    }
    // The run's own spokes go on to the next strip.
    const Interval mine = intersection(core, after.range);
    const auto from = static_cast<std::ptrdiff_t>(mine.begin - s.range.begin),
               to = static_cast<std::ptrdiff_t>(mine.begin - after.range.begin);
    const auto give = [&](const std::vector<float>& x, std::vector<float>& y) {
        if (!mine.empty())
            std::copy(x.begin() + from, x.begin() + from + static_cast<std::ptrdiff_t>(mine.size()), y.begin() + to);
    };
    give(s.horizon, after.horizon);
    if (voids_) {
        give(s.voids.tangent, after.voids.tangent);
        give(s.voids.top, after.voids.top);
        give(s.voids.lift, after.voids.lift);
        give(s.voids.drop, after.voids.drop);
    }
    copy_out(strip, window, desk);
    if (desk.culture) {
        const Culture::Cost& cost = desk.culture->cost();
        load_s += cost.cpu_s - desk.counted.cost.cpu_s;
        did.disk_wait_s += cost.wait_s - desk.counted.cost.wait_s;
        did.bytes_read += desk.culture->bytes_read() - desk.counted.bytes_read;
        did.bytes_spilled += desk.culture->bytes_spilled() - desk.counted.bytes_spilled;
        desk.counted = {cost, desk.culture->bytes_read(), desk.culture->bytes_spilled()};
    }
    did.load_s += load_s;
    did.sweep_s += all_of_it.cpu_s() - load_s;
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
                           across = tile_of(columns ? real_column(first) : first);
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
                         same_columns(real_column(grid_.line_index(side.quadrant, lines.begin + i)))) {
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
            const std::int64_t real = real_column(j);
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
