// What becomes of visible pieces: their backscatter, by class, wall and shore, and their echo into the cells.
#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "lib/front.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {
namespace {

// In place of a piece's backscatter: put() has to find it.
constexpr float left_to_put = -1;

/// What lies from `from` to `to` of the way, 0..1; nothing if that is no share of it. A part of a parabola is one too.
std::optional<WedgeCells::Portion> part_of(const WedgeCells::Portion& whole, double from, double to) {
    const double length = to - from, share = length * (1 + whole.bow * (1 - from - to));
    if (!(share > 0)) return std::nullopt;
    const double way = whole.x1 - whole.x0;
    return WedgeCells::Portion{whole.x0 + from * way, whole.x0 + to * way, whole.power * share,
                               whole.bow * length * length / share};
}

/// Backscatter of what also lies behind water, by lanes and one by one.
float brightened(float gamma, double bright) { return gamma * static_cast<float>(bright); }
double brightened(double gamma, double bright) {
    return static_cast<double>(brightened(static_cast<float>(gamma), bright));
}

}  // namespace

// ---- plain pieces, many at once ----

void Front::keep_pieces(std::size_t n, std::size_t lane, const SampleLanes& from, const SampleLanes& to,
                        const Plain& plain) {
    using P = VisiblePieces;
    P::Tile tile{};
    const auto keep = [&](P::Column at, const auto* column) { tile[at] = column; };
    keep(P::lane, lanes_.number.data() + lane), keep(P::origin, lanes_.origin.data() + lane);
    keep(P::share0, lanes_.share0.data() + lane), keep(P::share1, lanes_.share1.data() + lane);
    keep(P::horizon, plain.sine0.data()), keep(P::sine, to.sine);
    keep(P::range0, from.range_m), keep(P::range1, to.range_m);
    keep(P::rise, plain.rise.data()), keep(P::swing, plain.swing.data());
    if (scene_->range_is_ground) keep(P::x0, from.x), keep(P::x1, to.x);
    std::array<double, tile_lanes> major0, major1;
    if (!plain_ground_ || at_once_) {
        between_lanes(n, between_.behind_major, between_.ahead_major, from.part, major0.data());
        between_lanes(n, between_.behind_major, between_.ahead_major, to.part, major1.data());
        keep(P::major0, major0.data()), keep(P::major1, major1.data());
        keep(P::minor0, from.minor), keep(P::minor1, to.minor);
    }
    if (needs_facets_ || shore_) {
        keep(P::up0, from.up_m), keep(P::up1, to.up_m);
        keep(P::out0, from.out_m), keep(P::out1, to.out_m);
        keep(P::height0, from.height_m), keep(P::height1, to.height_m);
        keep(P::arc0, from.arc_m), keep(P::arc1, to.arc_m);
    }
    if (needs_facets_) {
        keep(P::part0, from.part), keep(P::part1, to.part);
        keep(P::behind, posts_.data()), keep(P::ahead, posts_.data() + 2 * tile_lanes);
    }
    if (shore_) keep(P::sine0, from.sine);
    pieces_.add(n, plain.code.data(), tile);
}

void Front::keep_piece(std::size_t lane, std::size_t i, const Way& way, const PieceEnd& first, const PieceEnd& last,
                       double bow) {
    using P = VisiblePieces;
    assert(parts_wait_);
    if (pieces_.size() == VisiblePieces::most) put_pieces();
    const std::size_t at = pieces_.add_one();
    const auto keep = [&](P::Column column, auto value) { pieces_.set(column, at, value); };
    keep(P::lane, lanes_.number[lane]), keep(P::origin, lanes_.origin[lane]);
    keep(P::share0, lanes_.share0[lane]), keep(P::share1, lanes_.share1[lane]);
    keep(P::horizon, first.sine), keep(P::sine, last.sine);
    keep(P::range0, first.range_m), keep(P::range1, last.range_m);
    keep(P::rise, 1.0), keep(P::swing, bow);  // what counts is one over the other
    if (scene_->range_is_ground) keep(P::x0, first.x), keep(P::x1, last.x);
    if (needs_facets_) {
        const double a = first.part, b = last.part;
        keep(P::up0, way.up_m(a)), keep(P::up1, way.up_m(b));
        keep(P::out0, way.out_m(a)), keep(P::out1, way.out_m(b));
        keep(P::height0, way.height_m(a)), keep(P::height1, way.height_m(b));
        keep(P::arc0, way.arc_m(a)), keep(P::arc1, way.arc_m(b));
        keep(P::part0, way.part(a)), keep(P::part1, way.part(b));
        pieces_.set_pair(P::behind, at, posts_.data() + 2 * i);
        pieces_.set_pair(P::ahead, at, posts_.data() + 2 * tile_lanes + 2 * i);
    }
    if (plain_ground_) return;
    const Track along = track(way, first, last);
    keep(P::major0, along.major0), keep(P::minor0, along.minor0);
    keep(P::major1, along.major1), keep(P::minor1, along.minor1);
}

void Front::wait_for_line(std::size_t n, int pieces, const Samples& next) {
    if (waiting_ == 0) {
        std::swap(plain_, crossed_);
        std::copy_n(now_.range.begin(), n, waiting_range_.begin());
        std::copy_n(now_.x.begin(), n, waiting_x_.begin());
        waiting_ = pieces;
        return;
    }
    // The others go on waiting.
    for (std::size_t i = 0; i < n; ++i) {
        if (now_.arc[i] == next.arc[i]) continue;
        for (auto column : {&Plain::rise, &Plain::swing, &Plain::sine0, &Plain::code})
            (crossed_.*column)[i] = (plain_.*column)[i];
        waiting_range_[i] = now_.range[i];
        waiting_x_[i] = now_.x[i];
    }
    waiting_ += pieces;
}

void Front::keep_crossed(std::size_t n, std::size_t lane) {
    assert(joins_);
    make_room();
    SampleLanes from = crossing_.lanes(0);
    from.range_m = waiting_range_.data();
    from.x = waiting_x_.data();
    keep_pieces(n, lane, from, now_.lanes(0), crossed_);
    make_room();  // others may follow before the line ahead
    waiting_ = 0;
}

void Front::keep_crossing_again(std::size_t n, std::size_t lane) {
    int others = 0;
    LaneArray& kept = plain_.code;
    for (std::size_t i = 0; i < n; ++i) {
        const bool again = crossing_.arc[i] != now_.arc[i];
        kept[i] = again ? 0 : crossed_.code[i];
        crossed_.code[i] = again ? crossed_.code[i] : 0;
        others += kept[i] == 1 ? 1 : 0;
    }
    if (others != waiting_) keep_crossed(n, lane);
    std::swap(plain_.code, crossed_.code);
    waiting_ = others;
}

void Front::keep_joined(std::size_t n, std::size_t lane, SampleLanes from, const SampleLanes& to) {
    const auto part = [](Plain& plain) {
        return JoinLanes::Part{plain.sine0.data(), plain.rise.data(), plain.swing.data(), plain.code.data()};
    };
    waiting_ =
        join_lanes(n, {part(crossed_), part(plain_), waiting_range_.data(), waiting_x_.data(), from.range_m, from.x,
                       to.range_m, to.sine, to.x, start_range_.data(), start_x_.data(), scene_->pattern->lobe()});
    if (waiting_ > 0) keep_crossed(n, lane);
    make_room();
    from.range_m = start_range_.data();
    from.x = start_x_.data();
    keep_pieces(n, lane, from, to, plain_);
}

SampleLanes Front::starts_of_pieces(std::size_t i) {
    using P = VisiblePieces;
    const auto at = [&](P::Column column) { return pieces_.numbers(column) + i; };
    return {at(P::part0), at(P::minor0), at(P::arc0),  at(P::height0), at(P::up0),
            at(P::out0),  at(P::range0), at(P::sine0), at(P::x0)};
}

SampleLanes Front::ends_of_pieces(std::size_t i) {
    using P = VisiblePieces;
    const auto at = [&](P::Column column) { return pieces_.numbers(column) + i; };
    return {at(P::part1), at(P::minor1), at(P::arc1), at(P::height1), at(P::up1),
            at(P::out1),  at(P::range1), at(P::sine), at(P::x1)};
}

void Front::put_pieces() {
    using P = VisiblePieces;
    const std::size_t n = pieces_.size();
    if (n == 0) return;
    assert(at_once_ || (between_.ahead_culture.empty() && between_.behind_culture.empty()));
    cost_.clock.enter(StageClock::shade);
    const auto column = [&](P::Column of) { return pieces_.numbers(of); };
    // Without a branch: a third of the spokes may be straddlers.
    const double* const second = column(P::share1);
    straddling_ = 0;
    for (std::size_t i = 0; i < n; ++i) {
        straddlers_[straddling_] = static_cast<std::int32_t>(i);
        straddling_ += second[i] > 0 ? 1 : 0;
    }
    const Shading shading{column(P::horizon),      column(P::sine), column(P::range0),
                          column(P::range1),       column(P::rise), column(P::swing),
                          scene_->range_is_ground, power_.data(),   bow_.data()};
    power_lanes(whole_registers(n), shading, *scene_->pattern, scene_->constant);
    const auto of_spokes = [&](const LaneArray& from, LaneArray& to) {
        for (std::size_t i = 0; i < n; ++i) to[i] = from[lane_of_piece(i)];
        return to.data();
    };
    if (scene_->loss) weaken_lanes(n, shading, of_spokes(lanes_.inverse_radius, inverse_radius_), *scene_->loss);
    if (needs_facets_)
        facet_lanes(n, {starts_of_pieces(0), ends_of_pieces(0), pieces_.pairs(P::behind), pieces_.pairs(P::ahead),
                        of_spokes(lanes_.across, across_), of_spokes(lanes_.slant, slant_), minor_post_m_ * post_,
                        facet_.data()});
    cost_.clock.enter(StageClock::deposit);
    if (put_plain()) {
        const auto [x0, x1, bins] = range_of_pieces();
        for (std::size_t i = 0; i < n; ++i) {
            const std::size_t lane = lane_of_piece(i);
            if (gamma_[2][i] != left_to_put || (lanes_.row[lane] < 0 && !shore_)) continue;
            const SampleLanes first = starts_of_pieces(i), last = ends_of_pieces(i);
            put(lane, {{x0[i] * bins, x1[i] * bins, power_[i], static_cast<double>(bow_[i])},
                       {pieces_.numbers(P::major0)[i], *first.minor, pieces_.numbers(P::major1)[i], *last.minor},
                       pieces_.numbers(P::horizon)[i],
                       *last.sine,
                       facet_[i],
                       &first,
                       &last,
                       0,
                       1});
        }
    }
    pieces_.clear();
    leave_out_culture();
}

Front::RangeOfPieces Front::range_of_pieces() {
    using P = VisiblePieces;
    if (scene_->range_is_ground) return {pieces_.numbers(P::x0), pieces_.numbers(P::x1), 1};
    return {pieces_.numbers(P::range0), pieces_.numbers(P::range1), bins_per_metre_};
}

bool Front::put_plain() {
    using P = VisiblePieces;
    const std::size_t n = pieces_.size();
    float* const gamma = gamma_[2].data();
    if (scene_->with_depression) {
        std::fill_n(gamma, n, left_to_put);
        return true;
    }
    const bool classes = !plain_ground_ && between_.in_chunk;
    const bool left = classes && find_gammas();
    if (!classes && (!plain_ground_ || needs_facets_ || directional_))
        for (std::size_t i = 0; i < n; ++i)
            gamma[i] = static_cast<float>(ground_gamma(scene_->data_base->default_class, facet_[i], lane_of_piece(i)));
    const auto [x0, x1, bins] = range_of_pieces();
    cells_->add_lanes(n, {pieces_.integers(P::origin),
                          pieces_.numbers(P::share0),
                          pieces_.numbers(P::share1),
                          {straddlers_.data(), straddling_},
                          x0,
                          x1,
                          bins,
                          power_.data(),
                          bow_.data(),
                          {gamma_[0].data(), gamma_[1].data(), gamma},
                          classes ? found_.to_second : nullptr,
                          found_.to_third});
    return left;
}

CulturePieces Front::culture_pieces() {
    using P = VisiblePieces;
    CulturePieces pieces{pieces_.numbers(P::major0), pieces_.numbers(P::minor0), pieces_.numbers(P::major1),
                         pieces_.numbers(P::minor1)};
    if (between_.ahead_culture.empty() && between_.behind_culture.empty()) return pieces;
    const CellLanes corners{culture_cell_.data(), culture_posts_.data(),
                            culture_posts_.data() + 2 * VisiblePieces::most};
    cell_lanes(between_.adjacent ? between_.behind_culture : no_posts(), between_.ahead_culture, pieces_.size(),
               pieces.minor0, pieces.minor1, corners);
    pieces.cell = corners.cell;
    pieces.behind_m = corners.behind;
    pieces.ahead_m = corners.ahead;
    return pieces;
}

CultureScene Front::culture_scene() const {
    const DataBase& db = *scene_->data_base;
    return {
        lines_are_columns(quadrant_),    between_.behind_major, between_.ahead_major,         db.culture_column_offset,
        db.culture_column_scale * post_, db.culture_row_offset, db.culture_row_scale * post_, {}};
}

Front::Classes Front::classes_under(std::size_t i, const ClassId* classes) const {
    return {{classes[found_.first[i]], classes[found_.second[i]], classes[found_.third[i]]},
            found_.to_second[i],
            found_.to_third[i]};
}

void Front::find_angular_gamma(std::size_t i, const Classes& under) {
    const std::size_t lane = lane_of_piece(i);
    const WedgeCells::Stretches s =
        found_.kind[i] == CultureParts::wall
            ? WedgeCells::Stretches::one(wall_gamma(under.id[0], lane))
            : under.stretches([&](double, double, ClassId id) { return ground_gamma(id, facet_[i], lane); });
    for (std::size_t k = 0; k < gamma_.size(); ++k) gamma_[k][i] = s.gamma[k];
}

bool Front::find_class_gammas(const ClassId* classes, bool walls) {
    const std::size_t n = pieces_.size();
    // Without a branch on classes, for hardly two neighbours are alike.
    std::array<float*, 3> gamma{gamma_[0].data(), gamma_[1].data(), gamma_[2].data()};
    // As bits: what is below 0 is of no class.
    std::uint32_t signs = 0;
    const auto look_up = [&](auto place) {
        for (std::size_t i = 0; i < n; ++i) {
            const std::int32_t* const cell[] = {found_.first, found_.second, found_.third};
            for (std::size_t k = 0; k < 3; ++k) {
                const float g = class_gammas_[place(classes[cell[k][i]], i)];
                gamma[k][i] = g;
                signs |= std::bit_cast<std::uint32_t>(g);
            }
        }
    };
    // Ground and walls by turns.
    if (walls)
        look_up([&](std::size_t id, std::size_t i) {
            return 2 * id + (found_.kind[i] == CultureParts::wall ? std::size_t{1} : std::size_t{0});
        });
    else
        look_up([](std::size_t id, std::size_t) { return 2 * id; });
    return (signs >> 31) != 0;
}

bool Front::find_gammas() {
    const std::size_t n = pieces_.size();
    const CulturePieces pieces = culture_pieces();
    CultureScene scene = culture_scene();
    // All in the tile that the first one lies in: mostly there is no other.
    const Found cells = find_cells(0, pieces, scene);
    const ClassId* classes = cells.classes;
    const bool some_unknown = find_class_gammas(classes, pieces.cell != nullptr);
    std::array<std::uint8_t, CulturePieces::most> odd;
    std::size_t odd_count = 0;
    for (std::size_t i = 0; (shore_ || cells.odd || some_unknown) && i < n; ++i) {
        const Classes under = classes_under(i, classes);
        if (found_.kind[i] > CultureParts::wall || !under.known() || (shore_ && !under.same()))
            odd[odd_count++] = static_cast<std::uint8_t>(i);
    }
    if (needs_facets_ || directional_)
        for (std::size_t i = 0; i < n; ++i) {
            const std::int32_t kind = found_.kind[i];
            if (kind == CultureParts::parts || kind == CultureParts::wall)
                find_angular_gamma(i, classes_under(i, classes));
        }
    bool left = false;
    if (shore_) {
        for (std::size_t k = 0; k < odd_count; ++k) gamma_[2][odd[k]] = left_to_put;
        left = pass_shores(classes);
    }
    for (std::size_t k = 0; k < odd_count; ++k) {
        const std::size_t i = odd[k];
        if (found_.kind[i] == CultureParts::elsewhere) classes = find_cells(i, pieces, scene).classes;
        const Classes under = classes_under(i, classes);
        // Where these are not all of its classes put() finds them; no window goes by before.
        if (found_.kind[i] > CultureParts::wall || !under.known() || (shore_ && needs_shore(i, under.id))) {
            gamma_[2][i] = left_to_put;
            left = true;
        } else {
            find_angular_gamma(i, under);
        }
    }
    return left;
}

bool Front::needs_shore(std::size_t i, const std::array<ClassId, 3>& classes) {
    if (std::any_of(classes.begin(), classes.end(), [&](ClassId id) { return shore_->is_water(id); })) return true;
    const std::size_t lane = lane_of_piece(i);
    ShoreWindow& window = lanes_.shore[lane];
    if (window.state == ShoreWindow::none) return false;
    const SampleLanes from = starts_of_pieces(i), to = ends_of_pieces(i);
    if (!FarShore::clear_of(window, shore_point(lane, from, to, 0), shore_point(lane, from, to, 1))) return true;
    window.state = ShoreWindow::on_land;
    return false;
}

bool Front::pass_shores(const ClassId* classes) {
    const std::size_t n = pieces_.size();
    const std::int32_t *const cell = found_.first, *const kind = found_.kind;
    // Mostly there is none, and none was.
    bool some = false;
    for (std::size_t i = 0; i < n; ++i)
        some |= (lanes_.shore[lane_of_piece(i)].state != ShoreWindow::none) | shore_->is_water(classes[cell[i]]);
    if (!some) return false;
    bool left = false;
    for (std::size_t i = 0; i < n; ++i) {
        if (gamma_[2][i] == left_to_put) continue;
        const std::size_t lane = lane_of_piece(i);
        const bool water = kind[i] == CultureParts::parts && shore_->is_water(classes[cell[i]]);
        ShoreWindow& window = lanes_.shore[lane];
        if (!water && window.state == ShoreWindow::none) continue;
        const SampleLanes from = starts_of_pieces(i), to = ends_of_pieces(i);
        if (water && *to.height_m > *from.height_m) {  // a bank perhaps
            gamma_[2][i] = left_to_put;
            left = true;
            continue;
        }
        const ShorePoint a = shore_point(lane, from, to, 0), b = shore_point(lane, from, to, 1);
        if (water)
            FarShore::pass_water(window, a, b);
        else
            for (const double bright = shore_->pass_land(window, a, b); auto& gamma : gamma_)
                gamma[i] = brightened(gamma[i], bright);
    }
    return left;
}

ShorePoint Front::shore_point(std::size_t lane, const SampleLanes& from, const SampleLanes& to, double u) const {
    const double inverse = lanes_.inverse_radius[lane];
    if (u == 0) return {*from.sine, *from.up_m, *from.out_m, *from.height_m, *from.arc_m * inverse};
    if (u == 1) return {*to.sine, *to.up_m, *to.out_m, *to.height_m, *to.arc_m * inverse};
    return {linear(*from.sine, *to.sine, u), linear(*from.up_m, *to.up_m, u), linear(*from.out_m, *to.out_m, u),
            linear(*from.height_m, *to.height_m, u), linear(*from.arc_m, *to.arc_m, u) * inverse};
}

Front::Found Front::find_cells(std::size_t i, const CulturePieces& pieces, CultureScene& scene) {
    const std::size_t n = pieces_.size();
    if (!scene_->data_base->has_culture) {  // one cell for all
        scene.column_offset = scene.row_offset = 0.5;
        scene.column_scale = scene.row_scale = 0;
        scene.tile = {{0, 1}, {0, 1}};
        const bool odd = culture_lanes(n, scene, pieces, found_);
        return {&scene_->data_base->default_class, odd};
    }
    const double major = pieces.major0[i], minor = pieces.minor0[i];
    const bool columns = scene.lines_are_columns;
    const CultureCells& tile =
        culture_.tile_of(floor_of(cell_column(columns ? major : minor)), floor_of(cell_row(columns ? minor : major)));
    scene.tile = tile.window;
    const bool odd = culture_lanes(n, scene, pieces, found_);
    return {tile.classes.data(), odd};
}

// ---- one piece ----

void Front::put(std::size_t lane, const Piece& piece) {
    double depression = 0;
    if (scene_->with_depression)
        depression = std::max(0.0, -std::asin(0.5 * (piece.sine0 + piece.sine1)) / (std::numbers::pi / 2));
    if (shore_) return put_by_shore(lane, piece, depression);
    const WedgeCells::Target target = lanes_.target(lane);
    const auto add_one = [&](double gamma) {
        cells_->add(target, piece.portion, WedgeCells::Stretches::one(gamma), &depression);
    };
    if (plain_ground_ || !between_.in_chunk)
        return add_one(ground_gamma(scene_->data_base->default_class, piece.variable, lane));
    if (const auto post = wall_of(piece.track))
        return add_one(wall_gamma(class_at(floor_of(cell_column(post->column)), floor_of(cell_row(post->row))), lane));
    if (!scene_->data_base->has_culture)
        return add_one(ground_gamma(scene_->data_base->default_class, piece.variable, lane));
    const auto class_of = [&](std::int64_t column, std::int64_t row) { return class_at(column, row); };
    const auto gamma_of = [&](double, double, ClassId id) { return ground_gamma(id, piece.variable, lane); };
    if (const auto under = few_classes(piece.track, class_of))
        return cells_->add(target, piece.portion, under->stretches(gamma_of), &depression);
    class_runs(piece.track, class_of, [&](double from, double to, ClassId id) {
        if (const auto part = part_of(piece.portion, from, to))
            cells_->add(target, *part, WedgeCells::Stretches::one(gamma_of(from, to, id)), &depression);
    });
}

ClassId Front::class_at(std::int64_t cell_column, std::int64_t cell_row) {
    const ClassId id = culture_.at(cell_column, cell_row);
    if (id == unknown_class) {
        const std::int32_t code = culture_.code(cell_column, cell_row);
        if (!unknown_code_ || code < *unknown_code_) unknown_code_ = code;
    }
    return id;
}

template <class Accept>
std::optional<IndexPosition> Front::highest_corner(const Track& track, const LinePosts& behind, const LinePosts& ahead,
                                                   const Accept& accept) const {
    const bool columns = lines_are_columns(quadrant_);
    const std::int64_t j = floor_of(0.5 * (track.minor0 + track.minor1));
    double most = -std::numeric_limits<double>::infinity();
    std::optional<IndexPosition> best;
    const auto corner = [&](const LinePosts& line, double major, std::int64_t at) {
        if (!line.has(at)) return;
        const double h = static_cast<double>(line.at(at)), minor = static_cast<double>(at);
        if (!(h >= most)) return;
        const IndexPosition here = columns ? IndexPosition{major, minor} : IndexPosition{minor, major};
        if (best && h == most && (here.row > best->row || (here.row == best->row && here.column > best->column)))
            return;
        if (!accept(h, here)) return;
        most = h;
        best = here;
    };
    for (std::int64_t at = j; at <= j + 1; ++at) {
        corner(ahead, between_.ahead_major, at);
        if (between_.adjacent) corner(behind, between_.behind_major, at);
    }
    return best;
}

std::optional<IndexPosition> Front::wall_of(const Track& track) const {
    if (between_.ahead_culture.empty() && between_.behind_culture.empty()) return std::nullopt;
    return highest_corner(track, between_.behind_culture, between_.ahead_culture,
                          [](double h, const IndexPosition&) { return h > 0; });
}

ClassId Front::land_of_cell(const Track& track) {
    ClassId id = unknown_class;
    highest_corner(track, between_.behind, between_.ahead, [&](double, const IndexPosition& post) {
        const ClassId here = culture_.at(floor_of(cell_column(post.column)), floor_of(cell_row(post.row)));
        if (here == unknown_class || shore_->is_water(here)) return false;
        id = here;
        return true;
    });
    return id;
}

template <class ClassOf>
std::optional<Front::Classes> Front::few_classes(const Track& t, const ClassOf& class_of) const {
    // As culture_lanes(), number by number.
    const bool columns = lines_are_columns(quadrant_);
    const double column0 = cell_column(columns ? t.major0 : t.minor0),
                 column1 = cell_column(columns ? t.major1 : t.minor1);
    const double row0 = cell_row(columns ? t.minor0 : t.major0), row1 = cell_row(columns ? t.minor1 : t.major1);
    const std::int64_t first_column = floor_of(column0), last_column = floor_of(column1), first_row = floor_of(row0),
                       last_row = floor_of(row1);
    if (std::abs(last_column - first_column) > 1 || std::abs(last_row - first_row) > 1) return std::nullopt;
    const auto cut = [](std::int64_t first, std::int64_t last, double from, double to) {
        return first == last ? 0.0F
                             : static_cast<float>(static_cast<double>(std::max(first, last)) - from) /
                                   static_cast<float>(to - from);
    };
    const float at_column = cut(first_column, last_column, column0, column1),
                at_row = cut(first_row, last_row, row0, row1);
    const bool column_first = at_column <= at_row;
    const float to_second = std::min(at_column, at_row), to_third = std::max(at_column, at_row);
    struct Cell {
        std::int64_t column, row;
    };
    Cell first{first_column, first_row}, third{last_column, last_row},
        second{column_first ? last_column : first_column, column_first ? first_row : last_row};
    if (to_second == to_third) second = to_second <= 0 ? third : first;
    if (to_third >= 1) third = second;
    if (to_second <= 0) first = second;
    return Classes{
        {class_of(first.column, first.row), class_of(second.column, second.row), class_of(third.column, third.row)},
        to_second,
        to_third};
}

template <class ClassOf, class Run>
void Front::class_runs(const Track& t, const ClassOf& class_of, const Run& run) {
    const bool columns = lines_are_columns(quadrant_);
    const double column0 = cell_column(columns ? t.major0 : t.minor0),
                 column1 = cell_column(columns ? t.major1 : t.minor1);
    const double row0 = cell_row(columns ? t.minor0 : t.major0), row1 = cell_row(columns ? t.minor1 : t.major1);
    breaks_.clear();
    const auto cut = [&](double from, double to) {
        const double lo = std::min(from, to), hi = std::max(from, to);
        for (auto border = static_cast<double>(floor_of(lo) + 1); border < hi; border += 1)
            breaks_.push_back((border - from) / (to - from));
    };
    cut(column0, column1);
    cut(row0, row1);
    if (breaks_.size() > 1) std::sort(breaks_.begin(), breaks_.end());
    breaks_.push_back(1);
    double from = 0, start = 0;
    std::optional<ClassId> open;
    for (const double to : breaks_) {
        const double middle = 0.5 * (from + to);
        const ClassId id =
            class_of(floor_of(column0 + middle * (column1 - column0)), floor_of(row0 + middle * (row1 - row0)));
        if (open && id != *open) {
            run(start, from, *open);
            start = from;
        }
        open = id;
        from = to;
    }
    run(start, 1.0, *open);
}

void Front::put_by_shore(std::size_t lane, const Piece& piece, double depression) {
    const bool own = lanes_.row[lane] >= 0;
    ShoreWindow& window = lanes_.shore[lane];
    const auto class_of = [&](std::int64_t column, std::int64_t row) {
        return own ? class_at(column, row) : culture_.at(column, row);
    };
    const auto point = [&](double u) {
        return shore_point(lane, *piece.from, *piece.to, piece.begin + u * (piece.end - piece.begin));
    };
    const auto land = [&](double from, double to) {
        return piece.from && window.state != ShoreWindow::none ? shore_->pass_land(window, point(from), point(to))
                                                               : 1.0;
    };
    const auto add = [&](double from, double to, double gamma) {
        if (!own) return;
        std::optional<WedgeCells::Portion> part = piece.portion;
        if (from > 0 || to < 1) part = part_of(piece.portion, from, to);
        if (part) cells_->add(lanes_.target(lane), *part, WedgeCells::Stretches::one(gamma), &depression);
    };
    if (const auto post = wall_of(piece.track)) {
        const ClassId id = class_of(floor_of(cell_column(post->column)), floor_of(cell_row(post->row)));
        return add(0, 1, brightened(wall_gamma(id, lane), land(0, 1)));
    }
    if (!between_.in_chunk) return add(0, 1, ground_gamma(scene_->data_base->default_class, piece.variable, lane));
    const bool rises = piece.from && *piece.to->height_m > *piece.from->height_m;
    const auto gamma_of = [&](double from, double to, ClassId id) {
        if (!(to > from)) return 0.0;
        if (shore_->is_water(id)) {
            // Heights ramp from the last post of water to the first of land, and the class changes on the way: the bank is
            // land from its foot.
            const ClassId bank = rises ? land_of_cell(piece.track) : unknown_class;
            if (bank == unknown_class) {
                if (piece.from) FarShore::pass_water(window, point(from), point(to));
                return ground_gamma(id, piece.variable, lane);
            }
            id = bank;
        }
        return brightened(ground_gamma(id, piece.variable, lane), land(from, to));
    };
    if (const auto under = few_classes(piece.track, class_of)) {
        const WedgeCells::Stretches stretches = under->stretches(gamma_of);
        if (own) cells_->add(lanes_.target(lane), piece.portion, stretches, &depression);
        return;
    }
    class_runs(piece.track, class_of,
               [&](double from, double to, ClassId id) { add(from, to, gamma_of(from, to, id)); });
}

}  // namespace wedgescope
