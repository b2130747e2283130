#include "lib/coverage_work.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "lib/facet.hpp"

namespace wedgescope::covering {
namespace {

/// Of a surface that rises so much from post to post along and across a line, by the metric of index space: |(a, b)|^2 = g0 a^2 +
/// g1 a b + g2 b^2, the gradient's square by its inverse.
double secant_of(const std::array<double, 3>& square, double along_m, double across_m) {
    const auto& [g0, g1, g2] = square;
    const double steep =
        (g2 * along_m * along_m - g1 * along_m * across_m + g0 * across_m * across_m) / (g0 * g2 - 0.25 * g1 * g1);
    return std::sqrt(1 + steep);
}

float degrees_of_sine(double sine) {
    return static_cast<float>(rounded(std::asin(std::clamp(sine, -1.0, 1.0)) * (180 / std::numbers::pi), 30));
}

}  // namespace

/// Does the sensor stand right above one? It lies on no line.
bool Cover::post_below() const {
    const std::int64_t c = floor_i(scene_.nadir.column), r = floor_i(scene_.nadir.row);
    const bool on_post = static_cast<double>(c) == scene_.nadir.column && static_cast<double>(r) == scene_.nadir.row;
    const Window& patch = scene_.nadir_patch.window;
    return on_post && r >= 0 && r < db_.rows && patch.contains(c, r);
}

void Cover::put_nadir(Strip& strip) {
    if (!post_below()) return;
    const std::int64_t c = floor_i(scene_.nadir.column), r = floor_i(scene_.nadir.row);
    const float z = scene_.nadir_patch.surface_m[scene_.nadir_patch.window.at(c, r)];
    // A void lies at the height of reference, as in finish_line().
    const double above_m = scene_.sensor_m - (z == z ? static_cast<double>(z) : scene_.reference_m) - params_.target_m;
    const double depression_deg = above_m < 0 ? -90 : 90;  // a target may stand above the sensor
    State state = z == z ? State::seen : State::no_data;
    if (with_range_ && !(std::abs(above_m) <= *scene_.scene.range_m &&
                         std::abs(above_m) >= scene_.scene.range_start_m && scene_.scene.ground_start_m == 0))
        state = State::outside;
    if (params_.elevation && state == State::seen &&
        (params_.elevation->first.deg() > -depression_deg + 1e-9 ||
         params_.elevation->second.deg() < -depression_deg - 1e-9))
        state = State::outside;
    float value = nan_f;
    if (state == State::seen) {
        switch (params_.layer) {
            case CoverageLayer::height:
                value = 0;
                break;
            case CoverageLayer::range:
                value = static_cast<float>(std::abs(above_m));
                break;
            case CoverageLayer::grazing:
                value = degrees_of_sine(nadir_facet(c, r, above_m).sine);
                break;
            case CoverageLayer::response:
                value = nadir_response(c, r, above_m);
                break;
            default:
                value = static_cast<float>(depression_deg);
        }
    }
    for (std::int64_t column : same_columns(db_.real_column(c))) {
        CoverageTiles::Tile& tile = *strip.tiles.at({r / tile_edge, column / tile_edge});
        const std::int64_t at = (r % tile_edge) * tile_edge + column % tile_edge;
        if (bytes_)
            tiles_.buffer<std::uint8_t>(tile)[at] = byte_of(state);
        else
            tiles_.buffer<float>(tile)[at] = value;
        ++desks_.local().states[static_cast<std::size_t>(state)];
    }
}

/// The surface at the post right below, which the ray meets from straight above (or below): by the mean of the slopes on both sides.
Cover::Facet Cover::nadir_facet(std::int64_t column, std::int64_t row, double above_m) const {
    const auto height = [&](std::int64_t c, std::int64_t r) {
        const Window& patch = scene_.nadir_patch.window;
        if (!patch.contains(c, r)) return std::numeric_limits<double>::quiet_NaN();
        return static_cast<double>(scene_.nadir_patch.surface_m[patch.at(c, r)]);
    };
    const double z = height(column, row);
    const auto slope = [z](double before, double after) {
        const double rise = std::isnan(before) ? after - z : std::isnan(after) ? z - before : 0.5 * (after - before);
        return std::isnan(rise) ? 0 : rise;
    };
    const double secant = secant_of(sides_[0].square, slope(height(column - 1, row), height(column + 1, row)),
                                    slope(height(column, row - 1), height(column, row + 1)));
    return {(above_m < 0 ? -1 : 1) / secant, secant};
}

float Cover::nadir_response(std::int64_t column, std::int64_t row, double above_m) {
    Desk& desk = desks_.local();
    if (desk.culture) desk.culture->forget();  // as a run does
    const Chunk& patch = scene_.nadir_patch;
    desk.culture_m = {};
    if (!patch.culture_height_m.empty()) {
        desk.culture_m = std::span(patch.culture_height_m).subspan(patch.window.at(column, row), 1);
        desk.culture_begin = row;
    }
    const SightLine down{-above_m, 0, std::abs(above_m), above_m > 0 ? -1.0 : 1.0};
    return response(sides_[0], 0, column, row, nadir_facet(column, row, above_m), down, scene_.earth.inverse_radius(),
                    desk);
}

Cover::Facet Cover::facet(const Side& side, const LineForm& line, double slope, double z, double behind, double beside,
                          double arc_m, double inverse_radius, const SightLine& sight) {
    // The gradient of the own cell at the post, by the metric at the sensor.
    const double along = z - behind, across = slope < 0 ? beside - z : z - beside;
    const double along_z = along == along ? along : 0, across_z = across == across ? across : 0;
    // The rise along the ray by the arc of one line.
    const double rise = (along_z + slope * across_z) * line.distance / arc_m;
    // The ray at the post: depression less the angle between the two verticals.
    const double angle = std::atan2(-sight.up_m, sight.out_m) - arc_m * inverse_radius;
    const double secant = secant_of(side.square, along_z, across_z);
    return {facet_sine(std::sin(angle), std::cos(angle), rise, secant), secant};
}

float Cover::response(const Side& side, double slope, std::int64_t index, std::int64_t post, const Facet& facet,
                      const SightLine& sight, double inverse_radius, Desk& desk) const {
    if (!(facet.sine > 0)) return nan_f;
    Culture& culture = culture_of(desk);
    const bool columns = lines_are_columns(side.quadrant);
    const double column = static_cast<double>(columns ? index : post),
                 row = static_cast<double>(columns ? post : index);
    const std::int64_t cell_column = floor_i(culture.cell_column(column)), cell_row = floor_i(culture.cell_row(row));
    const ClassId id = culture.at(cell_column, cell_row);
    if (id == unknown_class) throw unknown_class_error(db_, culture.code(cell_column, cell_row));
    const bool wall =
        !desk.culture_m.empty() && desk.culture_m[static_cast<std::size_t>(post - desk.culture_begin)] > 0;
    const ClassLaws& laws = tables_->laws;
    const double variable = law_variable(facet.sine);
    double factor;
    if (laws.directional()) {
        const double azimuth = map_.azimuth_rad(side.quadrant, slope), east = rounded(std::sin(azimuth), angle_bits),
                     north = rounded(std::cos(azimuth), angle_bits);
        factor = wall ? laws.wall(id, east, north) : laws.ground(id, variable, east, north);
    } else {
        factor = wall ? laws.wall(id) : laws.ground(id, variable);
    }
    const double g0 = side.square[0], g1 = side.square[1], g2 = side.square[2];
    const double sigma = factor * facet.sine * std::sqrt(g0 * g2 - 0.25 * g1 * g1) * facet.secant,
                 r2 = std::max(1.0, sight.range_m * sight.range_m);
    double power = radar_constant_ * tables_->pattern.at(sight.sine) * sigma / (r2 * r2);
    if (loss_) power *= loss_->factor(sight.range_m, sight.sine, inverse_radius);
    if (!(power > 0)) return nan_f;
    return static_cast<float>(rounded(10 * std::log10(power) + 30, 20));
}

/// What lies within range and sector of those posts of a line whose knots stand on the desk: of all of them, or of groups, that is mostly
/// known without any post.
class Cover::View {
public:
    /// `posts`: empty if no part is asked for.
    View(const Cover& cover, const Side& side, Desk& desk, const float* heights, Interval posts)
        : cover_(cover), side_(side), desk_(desk), limits_(cover.with_range_ && !posts.empty()) {
        if (posts.empty()) return;
        const auto [least, most] = std::minmax_element(desk.posts.slope.begin(), desk.posts.slope.begin() + knots());
        all_.slopes = {*least, *most};
        if (!limits_) return;
        double lowest = cover.scene_.reference_m, highest = lowest;
        const double target = cover.params_.target_m;
        if (const Blocks& blocks = desk.blocks; !blocks.empty()) {
            lowest = std::min(lowest, blocks.lowest_m + target);
            highest = std::max(highest, blocks.highest_m + target);
        } else {
            for (std::int64_t j = posts.begin; j < posts.end; ++j) {
                const double z = static_cast<double>(heights[j]) + target;
                lowest = z < lowest ? z : lowest;
                highest = z > highest ? z : highest;
            }
        }
        desk.posts.arc.resize(desk.posts.groups + 1);
        for (std::size_t g = 0; g <= desk.posts.groups; ++g)
            desk.posts.arc[g] = desk.posts.along[g] * std::sqrt(quadratic(side.square, desk.posts.slope[g]));
        double apart = 0;
        for (std::size_t g = 0; g < desk.posts.groups; ++g)
            apart = std::max(apart, std::abs(desk.posts.arc[g + 1] - desk.posts.arc[g]));
        const auto [nearest, farthest] = std::minmax_element(desk.posts.arc.begin(), desk.posts.arc.end());
        // Between two knots: twice the way from one to the next, by the metric at the sensor and, as near a pole posts stand farther
        // apart elsewhere, by what these knots have.
        between_m_ = 2 * std::max(1.25 * static_cast<double>(knot) * std::sqrt(side.square[2]), 2 * apart);
        all_.arcs = {std::max(0.0, *nearest - between_m_), *farthest + between_m_};
        // Bounds of out / arc, and of what stands above or below the sensor's level.
        const double low = lowest - 1, high = highest + 1, theta = all_.arcs.most * side.most_bent,
                     drop = 0.6 * all_.arcs.most * theta * (1 + std::abs(high) * side.most_bent);
        least_out_ = (1 - theta * theta) * (1 - std::abs(low) * side.most_bent);
        most_out_ = 1 + std::abs(high) * side.most_bent;
        most_up_ = std::max(std::abs(low - cover.scene_.sensor_m), std::abs(high - cover.scene_.sensor_m)) + drop;
    }

    enum class Part { all, none, some };
    Part whole() const { return judge(all_); }
    /// Of the posts between two knots.
    Part part(std::size_t g) const {
        const auto [least, most] = std::minmax(desk_.posts.slope[g], desk_.posts.slope[g + 1]);
        Bounds bounds{{least, most}, {}};
        if (limits_) {
            const auto [nearer, farther] = std::minmax(desk_.posts.arc[g], desk_.posts.arc[g + 1]);
            bounds.arcs = {std::max(0.0, farther - between_m_), nearer + between_m_};
        }
        return judge(bounds);
    }

private:
    struct Between {
        double least = 0, most = 0;
    };
    struct Bounds {
        Between slopes, arcs;
    };
    std::ptrdiff_t knots() const { return static_cast<std::ptrdiff_t>(desk_.posts.groups) + 1; }
    Part judge(const Bounds& of) const {
        const Scene& scene = cover_.scene_.scene;
        bool all = true;
        if (scene.sector) {
            constexpr double rounding = 1e-12;  // of slopes between the knots'
            bool in = false, touched = false;
            for (const auto& [lo, hi] : side_.sector) {
                in = in || (of.slopes.least >= lo + rounding && of.slopes.most <= hi - rounding);
                touched = touched || (of.slopes.most >= lo - rounding && of.slopes.least <= hi + rounding);
            }
            if (!touched) return Part::none;
            all = in;
        }
        if (limits_) {
            const double out = of.arcs.most * most_out_, least = of.arcs.least * least_out_,
                         most = std::sqrt(out * out + most_up_ * most_up_) + 1;
            if (least > *scene.range_m || of.arcs.least > cover_.farthest_m_ || most < scene.range_start_m ||
                of.arcs.most < scene.ground_start_m)
                return Part::none;
            all = all && most <= *scene.range_m && of.arcs.most <= cover_.farthest_m_ && least >= scene.range_start_m &&
                  of.arcs.least >= scene.ground_start_m;
        }
        return all ? Part::all : Part::some;
    }

    const Cover& cover_;
    const Side& side_;
    const Desk& desk_;
    bool limits_;
    Bounds all_;
    double between_m_ = 0, least_out_ = 0, most_out_ = 0, most_up_ = 0;
};

/// The run's posts of a line, from their state to what the layer holds.
class Cover::LinePosts {
public:
    LinePosts(const Cover& cover, const Side& side, const LineForm& line, std::int64_t index, Interval posts,
              Interval window, Desk& desk, std::size_t out)
        : cover_(cover), side_(side), line_(line), index_(index), posts_(posts),
          first_knot_(floor_to(posts.begin, knot)), desk_(desk), state_(of_line(desk.state, window)),
          height_(of_line(desk.line, window)), back_(of_line(desk.behind, window)),
          raise_(of_line(desk.raise_m, window)), tangent_(of_line(desk.tangent, window)),
          bytes_(cover.bytes_ ? desk.bytes.data() + out : nullptr),
          values_(cover.bytes_ ? nullptr : desk.values.data() + out) {}

    void finish() {
        if (values_ && !cover_.limited_ && cover_.params_.layer == CoverageLayer::height)
            take_heights();
        else if (cover_.with_posts_ || cover_.voids_)
            look_at_posts();
        count();
        if (bytes_) paint();
    }

private:
    static constexpr auto no_data = static_cast<std::uint8_t>(State::no_data),
                          shadow = static_cast<std::uint8_t>(State::shadow),
                          seen = static_cast<std::uint8_t>(State::seen),
                          unknown = static_cast<std::uint8_t>(State::unknown),
                          outside = static_cast<std::uint8_t>(State::outside);

    /// A post, and where it stands between two knots.
    struct Post {
        std::int64_t minor;
        std::size_t own;  ///< from the first of these posts on
        std::size_t group;
        double part;
    };
    /// As the sensor looks at it.
    struct Look {
        double slope, arc_m, inverse_radius;
        SightLine sight;
    };

    /// By the post's place on the line.
    template <class T>
    static T* of_line(std::vector<T>& of_window, Interval window) {
        return of_window.data() + line_margin - window.begin;
    }

    void take_heights() {
        for (std::int64_t j = posts_.begin; j < posts_.end; ++j)
            values_[j - posts_.begin] = state_[j] == no_data ? nan_f : raise_[j];
    }

    void look_at_posts() {
        const bool by_groups = bytes_ && cover_.limited_ && !cover_.params_.elevation && !cover_.uneven_;
        if (cover_.uneven_) cover_.place_each(side_, line_, posts_, desk_);
        const View view(cover_, side_, desk_, height_, by_groups ? posts_ : Interval{});
        const View::Part whole = by_groups ? view.whole() : View::Part::some;
        if (settle(whole, posts_)) return;
        if (!by_groups) return look_at(posts_, whole);
        for (std::int64_t begin = posts_.begin, end; begin < posts_.end; begin = end) {
            const std::int64_t group = (begin - first_knot_) / knot;
            end = std::min(posts_.end, first_knot_ + (group + 1) * knot);
            const View::Part in_view = view.part(static_cast<std::size_t>(group));
            if (!settle(in_view, {begin, end})) look_at({begin, end}, in_view);
        }
    }
    /// Need no post of these be looked at?
    bool settle(View::Part in_view, Interval posts) {
        if (in_view == View::Part::none) std::fill(state_ + posts.begin, state_ + posts.end, outside);
        return in_view == View::Part::none || (in_view == View::Part::all && !cover_.voids_);
    }
    void look_at(Interval posts, View::Part in_view) {
        for (std::int64_t j = posts.begin; j < posts.end; ++j) {
            const Post post = post_at(j);
            std::uint8_t& s = state_[j];
            if (cover_.voids_ && s == seen && tangent_[j] < void_tangent(post)) s = unknown;
            if (!cover_.with_posts_ || in_view == View::Part::all) continue;
            const Look look = look_to(post);
            if (!in_sector(look) || !in_range(look) || !in_elevation(post, look)) s = outside;
            if (values_) values_[post.own] = s == outside || s == no_data ? nan_f : value(post, look);
        }
    }

    Post post_at(std::int64_t minor) const {
        const auto group = static_cast<std::size_t>((minor - first_knot_) / knot);
        const double width = desk_.posts.minor[group + 1] - desk_.posts.minor[group];
        return {minor, static_cast<std::size_t>(minor - posts_.begin), group,
                width > 0 ? (static_cast<double>(minor) - desk_.posts.minor[group]) / width : 0};
    }
    /// Of the post itself where posts stand by themselves; else between the knots beside it.
    double of_post(const Post& post, const std::vector<double>& each, const std::vector<double>& knots) const {
        if (cover_.uneven_) return each[post.own];
        return knots[post.group] + post.part * (knots[post.group + 1] - knots[post.group]);
    }

    /// f tan e of the highest that may stand in the voids before a post.
    float void_tangent(const Post& post) const {
        const Spokes& spokes = desk_.spokes;
        const double k = of_post(post, desk_.each.at, desk_.posts.at) - static_cast<double>(spokes.range.begin);
        const auto at = static_cast<std::size_t>(std::clamp<std::int64_t>(floor_i(k), 0, spokes.range.size() - 2));
        const float f = static_cast<float>(k - static_cast<double>(at)), a = spokes.voids.tangent[at],
                    b = spokes.voids.tangent[at + 1];
        return has(a) && has(b) ? a + f * (b - a) : std::max(a, b);
    }

    Look look_to(const Post& post) const {
        const double slope = of_post(post, desk_.each.slope, desk_.posts.slope),
                     along = of_post(post, desk_.each.along, desk_.posts.along);
        const double squared = quadratic(side_.square, slope), bent = quadratic(side_.curvature, slope);
        const double inverse_radius = bent / squared, arc = along * std::sqrt(squared);
        // A void's place in range is that of the level surface at the reference height.
        const ResolvedScene& scene = cover_.scene_;
        const double z = static_cast<double>(height_[post.minor]);
        const double top = state_[post.minor] == no_data || z != z ? scene.reference_m : z + cover_.params_.target_m;
        return {slope, arc, inverse_radius, sight_line(scene.sensor_m, arc, top, inverse_radius)};
    }
    bool in_sector(const Look& look) const {
        const auto holds = [&](const std::pair<double, double>& part) {
            return look.slope >= part.first && look.slope <= part.second;
        };
        return !cover_.scene_.scene.sector || std::any_of(side_.sector.begin(), side_.sector.end(), holds);
    }
    bool in_range(const Look& look) const {
        const Scene& scene = cover_.scene_.scene;
        const double range_m = look.sight.range_m;
        return !cover_.with_range_ || (range_m <= *scene.range_m && range_m >= scene.range_start_m &&
                                       look.arc_m <= cover_.farthest_m_ && look.arc_m >= scene.ground_start_m);
    }
    bool in_elevation(const Post& post, const Look& look) const {
        if (!cover_.params_.elevation || state_[post.minor] == no_data) return true;
        const SightLine& sight = look.sight;
        return sight.up_m >= cover_.least_tangent_ * sight.out_m && sight.up_m <= cover_.most_tangent_ * sight.out_m;
    }

    float value(const Post& post, const Look& look) const {
        const SightLine& sight = look.sight;
        switch (cover_.params_.layer) {
            case CoverageLayer::height:
                return raise_[post.minor];
            case CoverageLayer::range:
                return static_cast<float>(sight.range_m);
            case CoverageLayer::depression:
                return static_cast<float>(rounded(std::atan2(-sight.up_m, sight.out_m) * (180 / std::numbers::pi), 30));
            case CoverageLayer::grazing:
                return degrees_of_sine(face(post, look).sine);
            case CoverageLayer::response:
                if (state_[post.minor] == shadow) return nan_f;
                return cover_.response(side_, look.slope, index_, post.minor, face(post, look), sight,
                                       look.inverse_radius, desk_);
            default:
                return nan_f;
        }
    }
    Facet face(const Post& post, const Look& look) const {
        const std::int64_t j = post.minor;
        const double slope = (static_cast<double>(j) - line_.nadir_minor) / line_.distance;
        const double beside = static_cast<double>(slope < 0 ? height_[j + 1] : height_[j - 1]);
        return facet(side_, line_, slope, static_cast<double>(height_[j]), static_cast<double>(back_[j]), beside,
                     look.arc_m, look.inverse_radius, look.sight);
    }

    void count() {
        const auto add = [this](Interval posts) {
            count_states(state_ + posts.begin, static_cast<std::size_t>(posts.size()), desk_.states);
        };
        add(posts_);
        if (const Interval again = cover_.repeated(side_.quadrant, index_, posts_); !again.empty()) add(again);
    }
    void paint() {
        const std::uint8_t* from = state_ + posts_.begin;
        const auto n = static_cast<std::size_t>(posts_.size());
        if (cover_.params_.layer == CoverageLayer::states)
            std::copy(from, from + n, bytes_);
        else
            paint_mask(from, n,
                       {cover_.byte_of(State::no_data), cover_.byte_of(State::shadow), cover_.byte_of(State::seen),
                        cover_.byte_of(State::unknown), cover_.byte_of(State::outside)},
                       bytes_);
    }

    const Cover& cover_;
    const Side& side_;
    const LineForm& line_;
    std::int64_t index_;
    Interval posts_;
    std::int64_t first_knot_;  ///< at or before the first post
    Desk& desk_;
    std::uint8_t* state_;
    const float *height_, *back_, *raise_, *tangent_;
    std::uint8_t* bytes_;  ///< of a mask or of states; else null
    float* values_;        ///< of other layers; else null
};

void Cover::finish_line(const Side& side, const LineForm& line, std::int64_t index, Interval posts, Interval window,
                        Desk& desk, std::size_t out) const {
    LinePosts(*this, side, line, index, posts, window, desk, out).finish();
}

}  // namespace wedgescope::covering
