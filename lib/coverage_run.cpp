// A run: some neighbouring spokes of a strip, carried over its lines. Leaves where spokes and posts stand on a line, and what
// posts find there, to coverage_sweep.cpp, and which blocks need not be looked at to coverage_hide.cpp.
#include <utility>

#include "lib/coverage_work.hpp"
#include "lib/stopwatch.hpp"

namespace wedgescope::covering {

namespace {

/// Which line of the raster a buffer holds: none.
constexpr std::int64_t no_line = std::numeric_limits<std::int64_t>::min();

/// Twice as many: even ones go on as they are; odd ones take the mean of the horizons beside them, the one that is where
/// the other spoke has met no ground, and of the two gaps the one that may hide more.
void double_spokes(Spokes& s, Spokes& scratch) {
    const std::size_t n = s.count();
    scratch.resize(2 * s.of, {2 * s.range.begin, 2 * s.range.end}, !s.voids.empty());
    for (std::size_t i = 0; i < n; ++i) {
        const float a = s.horizon[i], b = i + 1 < n ? s.horizon[i + 1] : no_horizon_f;
        scratch.horizon[2 * i] = a;
        scratch.horizon[2 * i + 1] = has(a) && has(b) ? 0.5F * (a + b) : std::max(a, b);
    }
    if (!s.voids.empty())
        for (std::size_t i = 0; i < n; ++i) {
            const std::size_t next = std::min(i + 1, n - 1);
            const VoidLanes& voids = s.voids;
            const auto gap = [&voids](std::size_t spoke) { return std::pair(voids.top[spoke], voids.lift[spoke]); };
            scratch.voids.copy(voids, i, 2 * i);
            scratch.voids.copy(voids, gap(next) > gap(i) ? next : i, 2 * i + 1);
            scratch.voids.tangent[2 * i + 1] = std::max(voids.tangent[i], voids.tangent[next]);
        }
    std::swap(s, scratch);
}

/// What the spokes of `common` hold, from one run of spokes to another.
void copy_spokes(const Spokes& from, Spokes& to, Interval common) {
    if (common.empty()) return;
    const auto take = [&](const std::vector<float>& a, std::vector<float>& b) {
        const auto first = a.begin() + static_cast<std::ptrdiff_t>(common.begin - from.range.begin);
        std::copy(first, first + static_cast<std::ptrdiff_t>(common.size()),
                  b.begin() + static_cast<std::ptrdiff_t>(common.begin - to.range.begin));
    };
    take(from.horizon, to.horizon);
    if (from.voids.empty()) return;
    take(from.voids.tangent, to.voids.tangent);
    take(from.voids.top, to.voids.top);
    take(from.voids.lift, to.voids.lift);
    take(from.voids.drop, to.voids.drop);
}

State state_of(Skip why) { return why == Skip::voids ? State::no_data : State::shadow; }

}  // namespace

class Cover::Run {
public:
    Run(Cover& cover, Strip& strip, std::size_t run)
        : cover_(cover), strip_(strip), side_(*strip.side), desk_(cover.desks_.local()), spokes_(desk_.spokes),
          blocks_(desk_.blocks), quadrant_(side_.quadrant), columns_(lines_are_columns(quadrant_)), first_(run == 0),
          last_(run + 1 == strip.runs.size()), lines_(strip.lines), core_(strip.runs[run]),
          did_(desk_.did[static_cast<std::size_t>(quadrant_)]) {}

    void sweep();

private:
    Window rectangle(Interval of_lines, Interval posts) const {
        return columns_ ? Window{of_lines, posts} : Window{posts, of_lines};
    }
    Interval every_group() const { return {0, spokes_.range.size() / knot}; }
    std::int64_t index_behind(std::int64_t line) const {
        const std::int64_t index = cover_.grid_.line_index(quadrant_, line);
        return line > lines_.begin || has_before_ ? index - outward(quadrant_) : no_line;
    }

    /// The ring that a line lies in; lines come outward.
    void enter_ring(std::int64_t line) {
        const auto& rings = cover_.grid_.rings(quadrant_);
        while (ring_ + 1 < rings.size() && rings[ring_ + 1].lines.begin <= line) ++ring_;
    }
    std::int64_t spokes_wanted() const { return cover_.grid_.rings(quadrant_)[ring_].spokes; }
    bool is_out_of_view() const;
    void pass_by();
    void take_spokes();
    void find_window();
    Interval row_lines(std::int64_t row) const;
    void look_at_blocks();
    void make_room();
    void load(Interval of_lines, ChunkRequest request);
    void take_line(std::int64_t index, std::vector<float>& to) const;
    void take_culture(std::int64_t index);
    void hold(std::int64_t index, std::vector<float>& buffer, std::int64_t& of) const;

    void advance(std::int64_t line);
    void enter_row(std::int64_t line, double distance);
    void read_row(std::int64_t line, double distance);
    bool add_spokes(std::int64_t line);
    const std::vector<Interval>& place_spokes(std::int64_t line, const LineForm& here, bool moved, bool cross,
                                              bool next_row);
    Interval own_posts(std::int64_t line, const LineForm& here) const;
    void test_posts(std::int64_t line, const LineForm& here, Interval posts, bool blank);
    void raise_spokes(const LineForm& here, const std::vector<Interval>& groups, Between between);
    void follow_edges(const LineForm& here);
    void follow(std::int64_t outside, std::int64_t inside);
    void count_culture();

    Cover& cover_;
    Strip& strip_;
    const Side& side_;
    Desk& desk_;
    Spokes& spokes_;
    Blocks& blocks_;
    Quadrant quadrant_;
    bool columns_;       // lines are columns of the raster
    bool first_, last_;  // of the strip's runs
    Interval lines_;
    Interval core_;  // its own spokes; the desk holds a group of neighbours on either side too
    QuadrantReport& did_;
    double load_s_ = 0;
    bool has_before_ = false;  // the raster has the line behind the strip
    Interval window_;          // posts of a line that the spokes can touch
    Interval major_;           // lines of the raster, with the one behind
    bool mapped_ = false;      // each row of blocks is read when its turn comes, and what is hidden by then is not
    Chunk chunk_;
    Interval held_, held_posts_;  // lines of the chunk, as the raster counts them, and which posts of each
    std::int64_t in_line_ = no_line, in_behind_ = no_line;  // lines that nothing comes of are not copied
    std::size_t ring_ = 0;
    std::int64_t row_ = 0;  // of blocks
    bool row_has_voids_ = true;
};

void Cover::sweep(Strip& strip, std::size_t run) {
    if (params_.stop) params_.stop->check();
    Run(*this, strip, run).sweep();
}

void Cover::Run::sweep() {
    ++did_.runs;
    if (desk_.culture) desk_.culture->forget();  // what is read shall not hang on who sweeps which run
    const Span span(cover_.params_.timeline, "run", "wedge", static_cast<std::int64_t>(quadrant_));
    const Stopwatch all_of_it;
    if (is_out_of_view()) {
        pass_by();
        did_.sweep_s += all_of_it.cpu_s();
        return;
    }
    take_spokes();
    find_window();
    look_at_blocks();
    make_room();
    enter_ring(lines_.begin);
    row_ = block_along(cover_.grid_.line_index(quadrant_, lines_.begin)) - outward(quadrant_);
    for (std::int64_t line = lines_.begin; line < lines_.end; ++line) advance(line);
    // The run's own spokes go on to the next strip.
    copy_spokes(spokes_, strip_.after, intersection(core_, strip_.after.range));
    cover_.copy_out(strip_, window_, desk_);
    if (desk_.culture) count_culture();
    did_.load_s += load_s_;
    did_.sweep_s += all_of_it.cpu_s() - load_s_;
}

/// Is the sector so far off that nothing its posts are judged by comes from these spokes? A post is judged by the two spokes beside it.
/// What is left behind here begins two groups beyond the sector; where spokes double it spreads by less than one of the coarser ring,
/// however often they do, and two more at the raster's edge (follow()). Its horizons are too low, so that no block is hidden by them.
bool Cover::Run::is_out_of_view() const {
    if (!cover_.scene_.scene.sector) return false;
    const auto k = static_cast<double>(side_.spokes.of);
    const double lo = static_cast<double>(core_.begin - 2 * knot) / k,
                 hi = static_cast<double>(core_.end + 2 * knot) / k;
    return std::none_of(side_.sector.begin(), side_.sector.end(),
                        [&](const auto& part) { return part.first <= hi && part.second >= lo; });
}

/// All its posts are outside, as tiles begin.
void Cover::Run::pass_by() {
    spokes_.of = side_.spokes.of;
    std::uint64_t posts = 0;
    for (std::int64_t line = lines_.begin; line < lines_.end; ++line) {
        enter_ring(line);
        for (; spokes_.of < spokes_wanted(); spokes_.of *= 2) core_ = {2 * core_.begin, 2 * core_.end};
        const LineForm here = cover_.form(side_, cover_.grid_.distance(quadrant_, line));
        posts += static_cast<std::uint64_t>(own_posts(line, here).size());
    }
    desk_.states[static_cast<std::size_t>(State::outside)] += posts;
}

void Cover::Run::take_spokes() {
    spokes_.resize(side_.spokes.of, {core_.begin - knot, core_.end + knot}, cover_.voids_);
    copy_spokes(side_.spokes, spokes_, intersection(spokes_.range, side_.spokes.range));
    place_fan(side_, desk_);
}

void Cover::Run::find_window() {
    const SpokeGrid& grid = cover_.grid_;
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    for (std::int64_t line : {lines_.begin, lines_.end - 1}) {
        cover_.place_knots(side_, cover_.form(side_, grid.distance(quadrant_, line)), every_group(), desk_);
        lo = std::min(lo, *std::min_element(desk_.fan.at.begin(), desk_.fan.at.end()));
        hi = std::max(hi, *std::max_element(desk_.fan.at.begin(), desk_.fan.at.end()));
    }
    const std::int64_t sag = ceil_i(cover_.map_.sag(quadrant_, static_cast<double>(lines_.size())));
    window_ = intersection({floor_i(lo) - 4 - sag, ceil_i(hi) + 5 + sag}, side_.minor);
    if (first_ && last_)
        for (const Interval& own : strip_.own) window_ = hull(window_, own);
    // The line behind the strip too, if the raster has it.
    const DataBase& db = cover_.db_;
    const std::int64_t before = grid.line_index(quadrant_, lines_.begin) - outward(quadrant_);
    has_before_ = (db.cyclic && columns_) || (before >= 0 && before < (columns_ ? db.columns : db.rows));
    const std::int64_t a = has_before_ ? before : before + outward(quadrant_),
                       b = grid.line_index(quadrant_, lines_.end - 1);
    major_ = {std::min(a, b), std::max(a, b) + 1};
}

/// Of a row of blocks the lines that are swept here; where it is only the line behind, that one.
Interval Cover::Run::row_lines(std::int64_t row) const {
    const Interval part = intersection({row * block_posts, (row + 1) * block_posts}, major_);
    const std::int64_t zero = cover_.grid_.line_index(quadrant_, 0);
    return outward(quadrant_) > 0 ? Interval{part.begin - zero, part.end - zero}
                                  : Interval{zero - part.end + 1, zero - part.begin + 1};
}

void Cover::Run::look_at_blocks() {
    blocks_.bounds.clear();
    if (window_.empty()) return;
    cover_.ask_map(side_, major_, window_, blocks_);
    mapped_ = !blocks_.empty();
    if (!mapped_) {
        load(major_, {});
        cover_.look_at(chunk_, major_, window_, blocks_);
    }
    blocks_.measure();
}

void Cover::Run::make_room() {
    const auto lines = static_cast<std::size_t>(lines_.size()), width = static_cast<std::size_t>(window_.size());
    desk_.own.assign(lines, {});
    desk_.blank.assign(lines, 0);
    for (auto* v : {&desk_.line, &desk_.behind, &desk_.raise_m, &desk_.tangent})
        v->assign(width + 2 * static_cast<std::size_t>(line_margin), nan_f);
    desk_.state.assign(desk_.line.size(), 0);
    if (cover_.bytes_)
        desk_.bytes.resize(width * lines);
    else
        desk_.values.resize(width * lines);
}

void Cover::Run::load(Interval of_lines, ChunkRequest request) {
    request.window = rectangle(of_lines, window_);
    request.lines_are_columns = columns_;
    Span reading(cover_.params_.timeline, "load", "wedge", static_cast<std::int64_t>(quadrant_));
    const Stopwatch watch;
    chunk_ = {};
    chunk_ = cover_.source_.load(request);
    reading.add_bytes(chunk_.bytes_read);
    const Stopwatch::Took took = watch.took();
    load_s_ += took.cpu_s;
    did_.disk_wait_s += took.wait_s;
    did_.posts_read += chunk_.posts_read;
    did_.bytes_read += chunk_.bytes_read;
    did_.bytes_spilled += chunk_.bytes_spilled;
    held_ = of_lines;
    held_posts_ = columns_ ? chunk_.window.rows : chunk_.window.columns;
    if (cover_.tables_ && cover_.db_.has_culture) cover_.culture_of(desk_).open(request.window, false);
}

void Cover::Run::take_line(std::int64_t index, std::vector<float>& to) const {
    if (held_posts_.empty()) return;
    const std::int64_t at = chunk_.flat ? 0 : index - held_.begin, n = held_posts_.size();
    const float* from = chunk_.surface_m.data() + at * n;
    std::copy(from, from + n, to.begin() + line_margin + (held_posts_.begin - window_.begin));
}

void Cover::Run::take_culture(std::int64_t index) {
    desk_.culture_m = {};
    if (chunk_.culture_height_m.empty() || held_posts_.empty()) return;
    const auto at = static_cast<std::size_t>(chunk_.flat ? 0 : index - held_.begin),
               n = static_cast<std::size_t>(held_posts_.size());
    desk_.culture_m = std::span(chunk_.culture_height_m).subspan(at * n, n);
    desk_.culture_begin = held_posts_.begin;
}

void Cover::Run::hold(std::int64_t index, std::vector<float>& buffer, std::int64_t& of) const {
    if (of != index && index != no_line) take_line(index, buffer);
    of = index;
}

// ---- one line ----

void Cover::Run::advance(std::int64_t line) {
    enter_ring(line);
    const std::int64_t index = cover_.grid_.line_index(quadrant_, line), behind = index_behind(line);
    const double d = cover_.grid_.distance(quadrant_, line);
    const bool next_row = block_along(index) != row_;
    if (next_row) enter_row(line, d);
    const bool moved = add_spokes(line);
    const LineForm here = cover_.form(side_, d);
    // On the first line of a row of blocks cells of the last one lie behind.
    const Between between = cover_.looked_at_between(d);
    const bool cross = between != Between::nothing && (line > 0 || between == Between::course);
    const std::vector<Interval>& groups = place_spokes(line, here, moved, cross, next_row);

    const Interval posts = own_posts(line, here);
    const auto l = static_cast<std::size_t>(line - lines_.begin);
    desk_.parts.clear();
    if (!posts.empty()) {
        desk_.own[l] = posts;
        part_line(posts, desk_);
    }
    const bool blank = std::all_of(desk_.parts.begin(), desk_.parts.end(), [&](const auto& part) {
        return part.second != Skip::none && cover_.byte_of(state_of(part.second)) == cover_.blank_;
    });
    desk_.blank[l] = blank ? 1 : 0;
    const bool looked_at = std::any_of(desk_.parts.begin(), desk_.parts.end(), [&](const auto& part) {
        return cover_.with_posts_ || part.second == Skip::none;
    });
    if (looked_at || !groups.empty()) {
        if (in_line_ == behind) {
            std::swap(desk_.line, desk_.behind);
            std::swap(in_line_, in_behind_);
        }
        hold(behind, desk_.behind, in_behind_);
        hold(index, desk_.line, in_line_);
    }
    if (cover_.tables_ && looked_at) take_culture(index);
    test_posts(line, here, posts, blank);
    if (!window_.empty()) {
        if (cover_.voids_ && (row_has_voids_ || next_row)) cover_.pass_voids(desk_, window_, line > 0);
        raise_spokes(here, groups, cross ? between : Between::nothing);
    }
    follow_edges(here);
}

/// The next row of blocks.
void Cover::Run::enter_row(std::int64_t line, double distance) {
    const std::int64_t row_behind = row_, behind = index_behind(line);
    row_ = block_along(cover_.grid_.line_index(quadrant_, line));
    if (!blocks_.empty()) {
        const bool all_posts = first_ && last_;
        if (mapped_ && line == lines_.begin && cover_.crosses(distance) && behind != no_line &&
            row_behind == block_along(behind))
            cover_.hide(side_, row_lines(row_behind), row_behind, core_, all_posts, desk_);
        cover_.hide(side_, intersection(row_lines(row_), lines_), row_, core_, all_posts, desk_);
        const auto from = blocks_.bounds.begin() + static_cast<std::ptrdiff_t>(blocks_.at(row_, blocks_.minors.begin));
        row_has_voids_ = std::any_of(from, from + static_cast<std::ptrdiff_t>(blocks_.minors.size()),
                                     [](const BlockBounds& bounds) { return bounds.voids != Voids::none; });
        if (mapped_) read_row(line, distance);
    }
    part_row(row_, desk_);
}

void Cover::Run::read_row(std::int64_t line, double distance) {
    const SpokeGrid& grid = cover_.grid_;
    const Interval band = intersection(row_lines(row_), lines_);
    const std::int64_t behind = index_behind(line),
                       near = behind != no_line ? behind : grid.line_index(quadrant_, line),
                       far = grid.line_index(quadrant_, band.end - 1);
    const Interval of_lines{std::min(near, far), std::max(near, far) + 1};
    ChunkRequest request;
    leave_out(columns_, blocks_, {block_along(of_lines.begin), block_along(of_lines.end - 1) + 1},
              cover_.crosses(distance) && behind != no_line ? std::nullopt : std::optional(row_), request);
    if (cover_.narrows_ && !cover_.crosses(distance))
        request.looked_at = rectangle(of_lines, looked_at_part(row_, desk_));
    load(of_lines, std::move(request));
    // Of the last row's lines the buffers hold what was needed then.
    in_line_ = in_behind_ = no_line;
}

/// As many as the line's ring has. True if the line behind has none of them yet.
bool Cover::Run::add_spokes(std::int64_t line) {
    const std::int64_t wanted = spokes_wanted();
    if (spokes_.of >= wanted) return line == lines_.begin;
    while (spokes_.of < wanted) {
        double_spokes(spokes_, desk_.scratch);
        core_ = {2 * core_.begin, 2 * core_.end};
        for (Interval& groups : desk_.row.groups) groups = {2 * groups.begin, 2 * groups.end};
    }
    place_fan(side_, desk_);
    return true;
}

/// Where they cross the line, and the one behind it where that counts: those that may rise here, which are returned.
const std::vector<Interval>& Cover::Run::place_spokes(std::int64_t line, const LineForm& here, bool moved, bool cross,
                                                      bool next_row) {
    desk_.row.every_group = {every_group()};
    const bool everywhere = blocks_.empty() || cover_.voids_ || (cross && next_row);
    const std::vector<Interval>& groups = everywhere ? desk_.row.every_group : desk_.row.groups;
    if (cross || cover_.voids_) {
        if (line > 0 && (moved || next_row))
            for (const Interval& part : groups)
                cover_.place_knots(side_, cover_.form(side_, here.distance - 1), part, desk_);
        std::swap(desk_.fan.at, desk_.fan.at_behind);
    }
    for (const Interval& part : groups) cover_.place_knots(side_, here, part, desk_);
    if (line == 0 && cross) {
        // The line behind lies behind the sensor.
        desk_.fan.at_behind.resize(desk_.fan.at.size());
        for (std::size_t i = 0; i < desk_.fan.at.size(); ++i)
            desk_.fan.at_behind[i] = desk_.fan.at[i] - desk_.fan.slope[i];
    }
    return groups;
}

Interval Cover::Run::own_posts(std::int64_t line, const LineForm& here) const {
    const Interval all = strip_.own[static_cast<std::size_t>(line - lines_.begin)];
    const auto edge = [&](std::int64_t k) {
        const double slope = static_cast<double>(k) / static_cast<double>(spokes_.of);
        const double place =
            spoke_place(here, piece_form(cover_.map_.line_piece(quadrant_, here.distance, slope)), slope);
        return std::clamp(ceil_i(place), all.begin, all.end);
    };
    return {first_ ? all.begin : edge(core_.begin), last_ ? all.end : edge(core_.end)};
}

void Cover::Run::test_posts(std::int64_t line, const LineForm& here, Interval posts, bool blank) {
    const auto l = static_cast<std::size_t>(line - lines_.begin), width = static_cast<std::size_t>(window_.size());
    const std::int64_t index = cover_.grid_.line_index(quadrant_, line);
    for (const auto& [part, why] : desk_.parts) {
        const std::size_t out = l * width + static_cast<std::size_t>(part.begin - posts.begin);
        if (why != Skip::none) {
            did_.posts_passed += static_cast<std::uint64_t>(part.size());
            const State state = state_of(why);
            if (!cover_.with_posts_) {
                desk_.states[static_cast<std::size_t>(state)] +=
                    static_cast<std::uint64_t>(part.size() + cover_.repeated(quadrant_, index, part).size());
                if (blank) continue;
                std::fill_n(desk_.bytes.begin() + static_cast<std::ptrdiff_t>(out), part.size(), cover_.byte_of(state));
                continue;
            }
            std::fill_n(desk_.state.begin() + (part.begin - window_.begin + line_margin), part.size(),
                        static_cast<std::uint8_t>(state));
        }
        cover_.place_posts(side_, here, spokes_.of, strip_.own[l], part, desk_);
        if (why == Skip::none) cover_.test_part(here, spokes_, part, window_, desk_);
        cover_.finish_line(side_, here, index, part, window_, desk_, out);
    }
}

void Cover::Run::raise_spokes(const LineForm& here, const std::vector<Interval>& groups, Between between) {
    RaiseLanes raise{};
    raise.origin = window_.begin - line_margin;
    raise.posts = desk_.line.data();
    raise.behind = desk_.behind.data();
    raise.distance = static_cast<float>(here.distance);
    raise.bow =
        static_cast<float>(bow_per_slope(here) / (static_cast<double>(spokes_.of) * static_cast<double>(spokes_.of)));
    for (const Interval& part : groups) {
        // Groups that touch the window; the others meet no ground.
        auto g = static_cast<std::size_t>(part.begin), end = static_cast<std::size_t>(part.end);
        while (g < end && desk_.fan.at[g + 1] <= static_cast<double>(window_.begin - 1)) ++g;
        while (end > g && desk_.fan.at[end - 1] >= static_cast<double>(window_.end)) --end;
        raise.groups = end - g;
        raise.at = desk_.fan.at.data() + g;
        raise.at_behind = between != Between::nothing ? desk_.fan.at_behind.data() + g : raise.at;
        raise.lift = desk_.fan.lift.data() + g;
        raise.drop = desk_.fan.drop.data() + g;
        raise.horizon = spokes_.horizon.data() + g * knot_step;
        raise_lanes(raise, cover_.lift_, between);
    }
}

/// Where spokes leave the raster, the first one outside is a neighbour of the last posts inside: it follows.
void Cover::Run::follow_edges(const LineForm& here) {
    if (cover_.db_.cyclic && !columns_) return;
    const double d = here.distance, nadir = here.nadir_minor, top = static_cast<double>(side_.minor.end - 1);
    if (window_.begin == side_.minor.begin && nadir >= 0 && nadir < d * 1.5) {
        const std::int64_t outside = ceil_i(cover_.spoke_at(side_, here, spokes_.of, 0)) - 1;
        follow(outside, outside + 1);
    }
    if (window_.end == side_.minor.end && nadir <= top && top - nadir < d * 1.5) {
        const std::int64_t outside = floor_i(cover_.spoke_at(side_, here, spokes_.of, top)) + 1;
        follow(outside, outside - 1);
    }
}

/// It goes straight on from the last two spokes inside where their horizons fall outwards, else it has the last one's; as of all
/// spokes its horizon never sinks.
void Cover::Run::follow(std::int64_t outside, std::int64_t inside) {
    const Interval& range = spokes_.range;
    if (!range.contains(outside) || !range.contains(inside)) return;
    const auto horizon = [&](std::int64_t k) -> float& {
        return spokes_.horizon[static_cast<std::size_t>(k - range.begin)];
    };
    const std::int64_t deeper = 2 * inside - outside;
    const float beside = horizon(inside), farther_in = range.contains(deeper) ? horizon(deeper) : beside;
    const float falls = has(beside) && has(farther_in) ? std::max(farther_in - beside, 0.0F) : 0.0F;
    horizon(outside) = std::max(horizon(outside), beside - falls);
}

/// What reading classes took since it was counted last.
void Cover::Run::count_culture() {
    const Culture& culture = *desk_.culture;
    load_s_ += culture.cost().cpu_s - desk_.counted.cost.cpu_s;
    did_.disk_wait_s += culture.cost().wait_s - desk_.counted.cost.wait_s;
    did_.bytes_read += culture.bytes_read() - desk_.counted.bytes_read;
    did_.bytes_spilled += culture.bytes_spilled() - desk_.counted.bytes_spilled;
    desk_.counted = {culture.cost(), culture.bytes_read(), culture.bytes_spilled()};
}

}  // namespace wedgescope::covering
