#include "lib/coverage_work.hpp"

#include <numbers>

#include "lib/facet.hpp"

namespace wedgescope::covering {

/// Does the sensor stand right above one? It lies on no line.
bool Cover::post_below() const {
    const std::int64_t c = floor_i(scene_.nadir.column), r = floor_i(scene_.nadir.row);
    const bool on_post = static_cast<double>(c) == scene_.nadir.column && static_cast<double>(r) == scene_.nadir.row;
    const Window& patch = scene_.nadir_patch.window;
    return on_post && r >= 0 && r < db_.rows && patch.columns.contains(c) && patch.rows.contains(r);
}

void Cover::put_nadir(Strip& strip) {
    if (!post_below()) return;
    const std::int64_t c = floor_i(scene_.nadir.column), r = floor_i(scene_.nadir.row);
    const Window& patch = scene_.nadir_patch.window;
    const float z = scene_.nadir_patch.surface_m[static_cast<std::size_t>(
        (r - patch.rows.begin) * patch.columns.size() + c - patch.columns.begin)];
    // A void lies at the height of reference, as in finish_line().
    const double above_m = scene_.sensor_m - (z == z ? static_cast<double>(z) : scene_.reference_m) - params_.target_m;
    const double depression_deg = above_m < 0 ? -90 : 90;  // a target may stand above the sensor
    State state = z == z ? State::seen : State::no_data;
    if (with_range_ && !(std::abs(above_m) <= *scene_.scene.range_m && std::abs(above_m) >= scene_.scene.range_start_m))
        state = State::outside;
    if (params_.elevation && state == State::seen &&
        (params_.elevation->first.deg() > -depression_deg + 1e-9 ||
         params_.elevation->second.deg() < -depression_deg - 1e-9))
        state = State::outside;
    float value = nan_f;
    if (state == State::seen) {
        value = params_.layer == CoverageLayer::height     ? 0.0F
                : params_.layer == CoverageLayer::range    ? static_cast<float>(std::abs(above_m))
                : params_.layer == CoverageLayer::response ? nadir_response(c, r, above_m)
                                                           : static_cast<float>(depression_deg);
    }
    for (std::int64_t column : same_columns(real_column(c))) {
        CoverageTiles::Tile& tile = *strip.tiles.at({r / tile_edge, column / tile_edge});
        const std::int64_t at = (r % tile_edge) * tile_edge + column % tile_edge;
        if (bytes_)
            tiles_.buffer<std::uint8_t>(tile)[at] = byte_of(static_cast<std::uint8_t>(state));
        else
            tiles_.buffer<float>(tile)[at] = value;
        ++desks_.local().states[static_cast<std::size_t>(state)];
    }
}

/// Of the post right below: as of level ground.
float Cover::nadir_response(std::int64_t column, std::int64_t row, double above_m) {
    Desk& desk = desks_.local();
    if (desk.culture) desk.culture->forget();  // as a run does
    desk.culture_m = {};
    const SightLine down{-above_m, 0, std::abs(above_m), above_m > 0 ? -1.0 : 1.0};
    return response(sides_[0], 0, column, row, {1, 1}, down, scene_.earth.inverse_radius(), desk);
}

Cover::Facet Cover::facet(const Side& side, const LineForm& line, double slope, double z, double behind, double beside,
                          double arc_m, double inverse_radius, const SightLine& sight) {
    // The gradient of the own cell at the post, by the metric at the sensor.
    const double along = z - behind, across = slope < 0 ? beside - z : z - beside;
    const double along_z = along == along ? along : 0, across_z = across == across ? across : 0;
    // Metric of index space: |(a, b)|^2 = g0 a^2 + g1 a b + g2 b^2; gradient squared is by its
    // inverse; the rise along the ray by the arc of one line.
    const double g0 = side.square[0], g1 = side.square[1], g2 = side.square[2];
    const double det = g0 * g2 - 0.25 * g1 * g1;
    const double steep = (g2 * along_z * along_z - g1 * along_z * across_z + g0 * across_z * across_z) / det;
    const double rise = (along_z + slope * across_z) * line.distance / arc_m;
    // The ray at the post: depression less the angle between the two verticals.
    const double angle = std::atan2(-sight.up_m, sight.out_m) - arc_m * inverse_radius;
    const double secant = std::sqrt(1 + steep);
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
    if (id == unknown_class) {
        const std::int32_t code = culture.code(cell_column, cell_row);
        if (!desk.unknown_code || code < *desk.unknown_code) desk.unknown_code = code;
        return nan_f;
    }
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
        const auto [least, most] = std::minmax_element(desk.post_slope.begin(), desk.post_slope.begin() + knots());
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
        desk.post_arc.resize(desk.post_groups + 1);
        for (std::size_t g = 0; g <= desk.post_groups; ++g)
            desk.post_arc[g] = desk.post_along[g] * std::sqrt(quadratic(side.square, desk.post_slope[g]));
        double apart = 0;
        for (std::size_t g = 0; g < desk.post_groups; ++g)
            apart = std::max(apart, std::abs(desk.post_arc[g + 1] - desk.post_arc[g]));
        const auto [nearest, farthest] = std::minmax_element(desk.post_arc.begin(), desk.post_arc.end());
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
        const auto [least, most] = std::minmax(desk_.post_slope[g], desk_.post_slope[g + 1]);
        Bounds bounds{{least, most}, {}};
        if (limits_) {
            const auto [nearer, farther] = std::minmax(desk_.post_arc[g], desk_.post_arc[g + 1]);
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
    std::ptrdiff_t knots() const { return static_cast<std::ptrdiff_t>(desk_.post_groups) + 1; }
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
            if (least > *scene.range_m || of.arcs.least > cover_.farthest_m_ || most < scene.range_start_m)
                return Part::none;
            all = all && most <= *scene.range_m && of.arcs.most <= cover_.farthest_m_ && least >= scene.range_start_m;
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
void Cover::finish_line(const Side& side, const LineForm& line, std::int64_t index, Interval posts, Interval window,
                        Desk& desk, std::size_t out) {
    const std::int64_t first = floor_to(posts.begin, knot);
    std::uint8_t* state = desk.state.data() + line_margin - window.begin;
    const float* height = desk.line.data() + line_margin - window.begin;
    const float* back = desk.behind.data() + line_margin - window.begin;
    const float* raise = desk.raise_m.data() + line_margin - window.begin;
    const float* tangent = desk.tangent.data() + line_margin - window.begin;
    std::uint8_t* bytes = bytes_ ? desk.bytes.data() + out : nullptr;
    float* values = bytes_ ? nullptr : desk.values.data() + out;
    constexpr auto outside = static_cast<std::uint8_t>(State::outside), seen = static_cast<std::uint8_t>(State::seen),
                   no_data = static_cast<std::uint8_t>(State::no_data);
    if (values && !limited_ && params_.layer == CoverageLayer::height) {
        for (std::int64_t j = posts.begin; j < posts.end; ++j)
            values[j - posts.begin] = state[j] == no_data ? nan_f : raise[j];
    } else if (with_posts_ || voids_) {
        const bool by_groups = bytes_ && limited_ && !params_.elevation && !uneven_;
        if (uneven_) place_each(side, line, posts, desk);
        const View view(*this, side, desk, height, by_groups ? posts : Interval{});
        // Need no post of these be looked at?
        const auto settled = [&](View::Part part, std::int64_t begin, std::int64_t end) {
            if (part == View::Part::none) std::fill(state + begin, state + end, outside);
            return part == View::Part::none || (part == View::Part::all && !voids_);
        };
        View::Part in_view = by_groups ? view.whole() : View::Part::some;
        for (std::int64_t j = settled(in_view, posts.begin, posts.end) ? posts.end : posts.begin; j < posts.end; ++j) {
            if (by_groups && (j == posts.begin || (j - first) % knot == 0)) {
                const std::int64_t group = (j - first) / knot, end = std::min(posts.end, first + (group + 1) * knot);
                in_view = view.part(static_cast<std::size_t>(group));
                if (settled(in_view, j, end)) {
                    j = end - 1;
                    continue;
                }
            }
            const auto g = static_cast<std::size_t>((j - first) / knot);
            const double width = desk.from[g + 1] - desk.from[g],
                         part = width > 0 ? (static_cast<double>(j) - desk.from[g]) / width : 0;
            const auto between = [&](const auto& v) {
                return static_cast<double>(v[g]) + part * (static_cast<double>(v[g + 1]) - static_cast<double>(v[g]));
            };
            const auto own = static_cast<std::size_t>(j - posts.begin);
            std::uint8_t& s = state[j];
            if (voids_ && s == seen) {
                const double place = uneven_ ? desk.each_at[own] : between(desk.post_at),
                             k = place - static_cast<double>(desk.spokes.range.begin);
                const auto at =
                    static_cast<std::size_t>(std::clamp<std::int64_t>(floor_i(k), 0, desk.spokes.range.size() - 2));
                const float f = static_cast<float>(k - static_cast<double>(at)), a = desk.spokes.voids.tangent[at],
                            b = desk.spokes.voids.tangent[at + 1];
                const float bar = has(a) && has(b) ? a + f * (b - a) : std::max(a, b);
                if (tangent[j] < bar) s = static_cast<std::uint8_t>(State::unknown);
            }
            if (!with_posts_ || in_view == View::Part::all) continue;
            const double m = uneven_ ? desk.each_slope[own] : between(desk.post_slope),
                         along = uneven_ ? desk.each_along[own] : between(desk.post_along);
            if (scene_.scene.sector) {
                bool in = false;
                for (const auto& [lo, hi] : side.sector) in = in || (m >= lo && m <= hi);
                if (!in) s = outside;
            }
            const double z = static_cast<double>(height[j]);
            const double squared = quadratic(side.square, m), bent = quadratic(side.curvature, m);
            const double inverse_radius = bent / squared, arc = along * std::sqrt(squared);
            // A void's place in range is that of the level surface at the reference height.
            const double top = s == no_data || z != z ? scene_.reference_m : z + params_.target_m;
            const SightLine sight = sight_line(scene_.sensor_m, arc, top, inverse_radius);
            if (with_range_ && !(sight.range_m <= *scene_.scene.range_m &&
                                 sight.range_m >= scene_.scene.range_start_m && arc <= farthest_m_))
                s = outside;
            if (params_.elevation && s != no_data &&
                !(sight.up_m >= least_tangent_ * sight.out_m && sight.up_m <= most_tangent_ * sight.out_m))
                s = outside;
            if (bytes_) continue;
            float value = nan_f;
            if (s != outside && s != no_data) switch (params_.layer) {
                    case CoverageLayer::height:
                        value = raise[j];
                        break;
                    case CoverageLayer::range:
                        value = static_cast<float>(sight.range_m);
                        break;
                    case CoverageLayer::depression:
                        value = static_cast<float>(
                            rounded(std::atan2(-sight.up_m, sight.out_m) * (180 / std::numbers::pi), 30));
                        break;
                    case CoverageLayer::response:
                        if (s == static_cast<std::uint8_t>(State::shadow)) break;
                        [[fallthrough]];
                    case CoverageLayer::grazing: {
                        const double slope = (static_cast<double>(j) - line.nadir_minor) / line.distance;
                        const double beside = static_cast<double>(slope < 0 ? height[j + 1] : height[j - 1]);
                        const Facet face = facet(side, line, slope, z, static_cast<double>(back[j]), beside, arc,
                                                 inverse_radius, sight);
                        value = params_.layer == CoverageLayer::response
                                    ? response(side, m, index, j, face, sight, inverse_radius, desk)
                                    : static_cast<float>(rounded(
                                          std::asin(std::clamp(face.sine, -1.0, 1.0)) * (180 / std::numbers::pi), 30));
                        break;
                    }
                    default:
                        break;
                }
            values[own] = value;
        }
    }
    const std::uint8_t* from = state + posts.begin;
    const auto n = static_cast<std::size_t>(posts.size());
    count_states(from, n, desk.states);
    if (const Interval again = repeated(side.quadrant, index, posts); !again.empty())
        count_states(state + again.begin, static_cast<std::size_t>(again.size()), desk.states);
    if (!bytes_) return;
    if (params_.layer == CoverageLayer::states)
        std::copy(from, from + n, bytes);
    else
        paint_mask(from, n, {byte_of(0), byte_of(1), byte_of(2), byte_of(3), byte_of(4)}, bytes);
}

}  // namespace wedgescope::covering
