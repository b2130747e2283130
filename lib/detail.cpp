#include "lib/detail.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "lib/bright_echo.hpp"
#include "lib/class_laws.hpp"
#include "lib/lanes.hpp"
#include "lib/raised_source.hpp"
#include "lib/rounding.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {
namespace {

constexpr int levels = DetailLevels::most;
constexpr int fans_each = 8;
constexpr std::int64_t border_posts = std::int64_t{1} << levels;  // borders stand at multiples of these

constexpr std::size_t spread_lanes = 16;

/// Sums of squares and cubes, and largest sizes, in lanes whose order is fixed, so that the bits are.
struct Spread {
    std::array<float, spread_lanes> squares{}, cubes{}, most{};
};

/// The surface of a level on one of its rows: straight from every `edge`-th post to the next; n a multiple of `edge`.
template <std::size_t edge>
WEDGESCOPE_LANES_PART void fill_line(std::size_t n, const float* __restrict from, float* __restrict out) noexcept {
    constexpr float share = 1.0F / static_cast<float>(edge);
    for (std::size_t c = 0; c < n; c += edge) {
        const float a = from[c], slope = (from[c + edge] - a) * share;
        for (std::size_t k = 0; k < edge; ++k) out[c + k] = a + static_cast<float>(k) * slope;
    }
}

WEDGESCOPE_LANES_PART bool has_void(std::size_t n, const float* row) noexcept {
    int voids = 0;
    for (std::size_t i = 0; i < n; ++i) voids |= row[i] != row[i] ? 1 : 0;
    return voids != 0;
}

/// Adds what `edge` rows of posts, `stride` apart, lie off the straight way from `near` to near + step; n a multiple of
/// spread_lanes.
template <std::size_t edge>
WEDGESCOPE_LANES_PART void add_rows(std::size_t n, const float* __restrict rows, std::size_t stride,
                                    const float* __restrict near, const float* __restrict step,
                                    Spread& spread) noexcept {
    constexpr float share = 1.0F / static_cast<float>(edge);
    float squares[spread_lanes] = {}, cubes[spread_lanes] = {}, most[spread_lanes] = {};
    for (std::size_t r = 0; r < edge; ++r) {
        const float* __restrict row = rows + r * stride;
        const float part = static_cast<float>(r) * share;
        for (std::size_t i = 0; i < n; i += spread_lanes)
            for (std::size_t k = 0; k < spread_lanes; ++k) {
                const float off = row[i + k] - (near[i + k] + part * step[i + k]), size = off < 0 ? -off : off;
                const float square = off * off;
                squares[k] += square;
                cubes[k] += square * size;
                most[k] = size > most[k] ? size : most[k];
            }
    }
    for (std::size_t k = 0; k < spread_lanes; ++k) {
        spread.squares[k] = squares[k];
        spread.cubes[k] = cubes[k];
        spread.most[k] = most[k];
    }
}

/// Of one level; `wide` x `high` cells of posts, both multiples of `edge`, and one post beyond them.
template <std::size_t edge>
void find_level(const float* posts, std::size_t stride, std::size_t wide, std::size_t high, std::size_t at,
                Residuals& found) {
    using Line = std::array<float, detail_posts>;
    // Whole lanes: what is beyond is 0 in all lines.
    const std::size_t lanes = (wide + spread_lanes - 1) / spread_lanes * spread_lanes;
    Line near{}, far{}, step{};
    std::array<float, edge * detail_posts> copied{};
    double sum = 0, cubes = 0;
    float most = 0;
    on_target<fill_line<edge>>(wide, posts, far.data());
    for (std::size_t r = 0; r < high; r += edge) {
        std::swap(near, far);
        on_target<fill_line<edge>>(wide, posts + (r + edge) * stride, far.data());
        for (std::size_t i = 0; i < lanes; ++i) step[i] = far[i] - near[i];
        Spread spread;
        if (wide == lanes) {
            on_target<add_rows<edge>>(lanes, posts + r * stride, stride, near.data(), step.data(), spread);
        } else {
            for (std::size_t k = 0; k < edge; ++k)
                std::copy_n(posts + (r + k) * stride, wide, copied.data() + k * detail_posts);
            on_target<add_rows<edge>>(lanes, copied.data(), detail_posts, near.data(), step.data(), spread);
        }
        for (std::size_t k = 0; k < spread_lanes; ++k) {
            sum += static_cast<double>(spread.squares[k]);
            cubes += static_cast<double>(spread.cubes[k]);
            most = std::max(most, spread.most[k]);
        }
    }
    const auto cells = static_cast<double>(wide * high);
    found.rms_m[at] = static_cast<float>(std::sqrt(sum / cells));
    found.cube_m[at] = static_cast<float>(std::cbrt(cubes / cells));
    found.peak_m[at] = most;
}

}  // namespace

Residuals residuals(const float* posts, std::int64_t stride, std::int64_t columns, std::int64_t rows) {
    Residuals found;
    const std::int64_t all_wide = std::min(columns, detail_posts + 1), all_high = std::min(rows, detail_posts + 1);
    for (std::int64_t r = 0; r < all_high; ++r)
        if (on_target<has_void>(static_cast<std::size_t>(all_wide), posts + r * stride)) return found;
    const auto find = [&]<std::size_t level>() {
        constexpr std::size_t edge = std::size_t{1} << level;
        const auto whole = [](std::int64_t side) {
            return side > 1 ? static_cast<std::size_t>(side - 1) / edge * edge : 0;
        };
        const std::size_t wide = whole(all_wide), high = whole(all_high);
        if (wide > 0 && high > 0)
            find_level<edge>(posts, static_cast<std::size_t>(stride), wide, high, level - 1, found);
    };
    [&]<std::size_t... k>(std::index_sequence<k...>) { (find.template operator()<k + 1>(), ...); }
    (std::make_index_sequence<levels>());
    return found;
}

double detail_rms_db(Quality quality) {
    switch (quality) {
        case Quality::draft:
            return 0.25;
        case Quality::normal:
            return 0.06;
        case Quality::fine:
        case Quality::exact:
            break;
    }
    return 0;
}

namespace {

constexpr double db_of_log = 4.342944819032518;  // 10 / ln 10

/// Share of the ground facing the sensor that other ground hides, of slopes of chance with an RMS of `slope`. Source: Smith (1967), docs/engine.md.
double hidden_share(double slope, double grazing_rad) {
    if (!(slope > 0)) return 0;
    const double ratio = grazing_rad / slope,
                 lambda = 0.5 * (std::sqrt(2 / std::numbers::pi) / ratio * std::exp(-0.5 * ratio * ratio) -
                                 std::erfc(ratio / std::numbers::sqrt2));
    return lambda > 0 ? rounded_significand(lambda / (1 + lambda), 30) : 0;
}

/// RMS error in dB by where shadows end, which a crest off by h moves by h over the grazing angle. Of a cell that is lit in part p,
/// with P over the noise, a part `moved` comes or goes: 4.34 moved / p dB where p is more than that, and all of its 10 lg(1 + p P)
/// where it is less. How often p is small is a matter of the beam: where it is narrow one edge crosses the cell anywhere, where it
/// is wide the edge wanders through many portions of it, of which all but little must be hidden at once: p^(portions - 1).
double shadow_ends_db(const DetailPlace& place, double across_m, double rms_m) {
    // Fits to shipped and drawn terrain, docs/engine.md.
    constexpr double crest = 2;                 // a crest is off by, in RMS of all posts,
    constexpr double alike = 10;                // over so many posts of the level alike
    constexpr double straight_m = 200;          // an edge is, at least
    constexpr double met = 0.5, apart_m = 300;  // edges that a pulse meets, of what is hidden
    constexpr double most_over_noise = 1e6;     // also for what nobody knows
    const double hidden = hidden_share(place.steepness, place.grazing_rad),
                 edges = met * hidden * std::min(1.0, place.pulse_m / apart_m),
                 moved = std::min(1.0, crest * rms_m / (place.grazing_rad * place.pulse_m));
    if (!(edges > 0) || !(moved > 0)) return 0;
    const double portions = std::max(1.0, place.beam_m / std::max(place.pulse_m, straight_m)), power = portions - 2,
                 log = std::log(moved),
                 gone_db = db_of_log * std::log1p(moved * std::min(place.over_noise, most_over_noise));
    // The integral of p^(portions - 3) from `moved` to 1.
    const double weaker = power == 0 ? -log : -std::expm1(power * log) / power,
                 together = portions > 1 ? std::min(1.0, alike * across_m / place.beam_m) : 1;
    const double square = portions * db_of_log * db_of_log * moved * moved * weaker * together +
                          std::exp(portions * log) * gone_db * gone_db;
    return std::sqrt(rounded_significand(edges * square, 30));
}

}  // namespace

double detail_error_db(const DetailPlace& place, int level, double rms_m, double excess_m3) {
    const auto posts = static_cast<double>(std::int64_t{1} << level);
    const double along = place.along_m * posts, across = place.across_m * posts;
    if (2 * along > place.pulse_m || 2 * across > place.beam_m || !(place.grazing_rad > 0)) return infinite;
    // What a cell returns is the rise of the sine of the elevation over the pulse: a wrong height at either end of it
    // counts. Where all ground is seen, posts beside each other in the beam err on their own.
    constexpr double ends = 1.4142135623730951;
    const double a_metre = db_of_log * ends / (place.grazing_rad * place.pulse_m),
                 alone = rms_m * std::sqrt(1.44 * across / place.beam_m);
    // What stands out, all along the beam if it is a dike or a wall: a height h that the level leaves out (or keeps, and so
    // widens) is a shadow of length h / psi too short or too long, in which the horizon is off by h down to 0.
    const double lines = std::sqrt(excess_m3 / (3 * place.grazing_rad * place.along_m));
    return std::hypot(a_metre * alone, a_metre * lines, shadow_ends_db(place, across, rms_m));
}

double excess_m3(const Residuals& residuals, int level) {
    // Mean cubes over the RMS cubed: 1.6 of a normal distribution, 1.6 to 3 of nearly all blocks of natural terrain.
    constexpr double chance = 3;
    const auto at = static_cast<std::size_t>(level - 1);
    const auto rms = static_cast<double>(residuals.rms_m[at]), cube = static_cast<double>(residuals.cube_m[at]);
    return std::max(0.0, cube * cube * cube - chance * rms * rms * rms);
}

namespace {

/// Variance of the slopes along either axis that a level leaves out, with posts `post_m` apart: of each octave that of the residuals
/// which it adds, `squared` of each level on the mean, over the distance of its posts. Of noise from post to post it is 1.4 times
/// those over the square of that, of parabolas from post to post of the level 10.
double lost_slopes(const std::array<double, levels>& squared, int level, double post_m) {
    constexpr double octave = 2;
    double sum = 0, before = 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(level); ++i, post_m *= 2) {
        sum += octave * std::max(0.0, squared[i] - before) / (post_m * post_m);
        before = std::max(before, squared[i]);
    }
    return sum;
}

/// What the mean echo of ground changes by where slopes are taken from it, under laws that bend with the angle: sloping ground
/// returns on the mean what its slopes do, and not what their mean does.
class BentLaws {
public:
    /// Of the ground's classes: the one there is without culture; with it all of them but water, which lies level there.
    BentLaws(const ResolvedScene& scene, const DataBase& db) {
        const ClassLawParams params = laws_of(scene.scene);
        if (!may_need_facets(params)) return;
        const std::vector<Material>& materials = params.materials.rows();
        for (std::size_t id = 0; id < materials.size(); ++id) {
            if (db.has_culture ? is_of_water(materials[id]) : id != db.default_class) continue;
            const BackscatterLaw law = class_law(materials[id], params);
            if (law.gamma()) continue;
            std::array<double, intervals + 1>& factors = factors_.emplace_back();
            for (std::size_t i = 0; i < factors.size(); ++i)
                factors[i] =
                    rounded_significand(law.factor(Angle::radians(most_rad * static_cast<double>(i) / intervals)), 30);
        }
    }
    /// The largest change of a class, dB: of ground with slopes of chance of an RMS of `slope` each way, `lost` of their variance
    /// taken.
    double change_db(double grazing_rad, double slope, double lost) const {
        if (!(lost > 0)) return 0;
        double most = 0;
        for (const auto& factors : factors_) {
            const double with = mean(factors, grazing_rad, slope * slope + lost),
                         without = mean(factors, grazing_rad, slope * slope);
            most = with > 0 && without > 0 ? std::max(most, std::abs(db_of_log * std::log(with / without))) : infinite;
        }
        return rounded_significand(most, 24);
    }

private:
    static constexpr std::size_t intervals = 256;
    static constexpr double most_rad = std::numbers::pi / 2;

    static double at(const std::array<double, intervals + 1>& factors, double sine) {
        const double place = std::asin(std::min(1.0, sine)) * (intervals / most_rad);
        const std::size_t i = std::min(intervals - 1, static_cast<std::size_t>(place));
        return factors[i] + (place - static_cast<double>(i)) * (factors[i + 1] - factors[i]);
    }
    /// Of the factor over the ground as it shows itself; by Gauss and Hermite, 7 points towards the sensor, 3 across (Abramowitz &
    /// Stegun, table 25.10).
    static double mean(const std::array<double, intervals + 1>& factors, double grazing_rad, double variance) {
        struct Point {
            double at, weight;
        };
        constexpr std::array<Point, 7> towards{{{0, 0.457142857142857},
                                                {1.154405394739968, 0.240123178605013},
                                                {-1.154405394739968, 0.240123178605013},
                                                {2.366759410734541, 0.030757123967586},
                                                {-2.366759410734541, 0.030757123967586},
                                                {3.750439717725742, 0.000548268855972},
                                                {-3.750439717725742, 0.000548268855972}}};
        constexpr std::array<Point, 2> aside{{{0, 2.0 / 3}, {1.7320508075688772, 1.0 / 3}}};
        const double rms = std::sqrt(variance), sine = std::sin(grazing_rad), cosine = std::cos(grazing_rad);
        double sum = 0;
        for (const Point& x : towards)
            for (const Point& y : aside) {
                const double a = x.at * rms, b = y.at * rms, shown = sine + a * cosine;
                if (shown > 0) sum += x.weight * y.weight * shown * at(factors, shown / std::sqrt(1 + a * a + b * b));
            }
        return sum;
    }

    std::vector<std::array<double, intervals + 1>> factors_;  // of the grazing angle, those that bend
};

/// What is known of the ground of one fan between two borders.
struct Ground {
    double blocks = 0, height_m = 0, relief_squared = 0;
    std::array<double, levels> squared{}, excess_m3{}, peak_m{};
    bool every_post = false;  ///< voids or culture heights: no level

    void add(const BlockBounds& bounds, const Residuals& r) {
        if (bounds.voids == Voids::all) return;
        every_post = every_post || bounds.voids == Voids::some || bounds.culture_m > 0;
        const auto low = static_cast<double>(bounds.lowest_m), high = static_cast<double>(bounds.highest_m);
        blocks += 1;
        height_m += 0.5 * (low + high);
        relief_squared += (high - low) * (high - low);
        for (std::size_t i = 0; i < levels; ++i) {
            const auto rms = static_cast<double>(r.rms_m[i]);
            squared[i] += rms * rms;
            excess_m3[i] += wedgescope::excess_m3(r, static_cast<int>(i) + 1);
            peak_m[i] = std::max(peak_m[i], static_cast<double>(r.peak_m[i]));
        }
    }
};

/// No level is coarser than a cell of the culture, nor one of which a side of the raster has few posts: its edges are
/// sampled as the ground is, and there must be little of them.
int coarsest(const DataBase& db) {
    constexpr std::int64_t few = 128;
    int most = levels;
    while (most > 0 && std::min(db.columns, db.rows) < few << most) --most;
    if (!db.has_culture) return most;
    const double cells = std::max(std::abs(db.culture_column_scale), std::abs(db.culture_row_scale));
    while (most > 0 && cells * static_cast<double>(std::int64_t{1} << most) > 1.001) --most;
    return most;
}

/// Length in range of what a cell gathers. Exaggeration is the picture's: it makes no level coarser.
double pulse_m(const ResolvedScene& scene) {
    const RadarParams& radar = scene.scene.radar;
    return std::max(radar.pulse_length_error ? radar.pulse_extent_m() * std::min(1.0, radar.pulse_length_scale) : 0.0,
                    scene.swept.range_bin_m);
}

/// Width in azimuth of what a cell gathers.
double beam_rad(const ResolvedScene& scene) {
    const RadarParams& radar = scene.scene.radar;
    return std::max(radar.beam_width_error ? radar.antenna.beam.rad() * std::min(1.0, radar.beam_width_scale) : 0.0,
                    2 * std::numbers::pi / static_cast<double>(scene.swept.circle_bins));
}

/// Posts outwards that a scene may reach, with a tenth to spare for what is not level or not square.
double reach_posts(const SpokeMap& map, Quadrant q) { return map.params().max_arc_m / map.metres_per_post(q, 0) * 1.1; }

class Chooser {
public:
    Chooser(const ResolvedScene& scene, WedgeSource& source, const SpokeMap& map)
        : scene_(scene), db_(source.data_base()), bounds_(source.detail_map()->bounds()), detail_(*source.detail_map()),
          map_(map), bright_(scene, db_), bent_(may_need_facets(laws_of(scene.scene))), laws_(scene, db_) {}

    DetailLevels operator()() const {
        DetailLevels chosen;
        chosen.fans = fans_each;
        chosen.steps.resize(all_quadrants.size() * fans_each);
        const int most = coarsest(db_);
        double all = 0, saved = 0;  // of the ground in range, squared posts
        for (const Quadrant q : all_quadrants) {
            if (most == 0) break;
            const std::vector<std::int64_t> borders = borders_of(q);
            if (borders.size() < 2) continue;
            const std::vector<Ground> ground = survey(q, borders);
            for (std::size_t fan = 0; fan < fans_each; ++fan) {
                int before = 0;
                std::vector<DetailLevels::Step>& steps = chosen.steps[static_cast<std::size_t>(q) * fans_each + fan];
                for (std::size_t band = 0; band + 1 < borders.size(); ++band) {
                    const int level = level_of(q, static_cast<int>(fan), borders[band], borders[band + 1],
                                               ground[band * fans_each + fan], most);
                    if (level != before) steps.push_back({borders[band], level});
                    before = level;
                    const double from = distance(q, borders[band]), to = distance(q, borders[band + 1]),
                                 area = to * to - from * from;
                    all += area;
                    saved += area * (1 - 1 / static_cast<double>(std::int64_t{1} << (2 * level)));
                }
            }
        }
        // Fans read and sweep some posts beside each other twice.
        constexpr double worth_it = 0.1;
        if (!(saved > worth_it * all)) chosen.steps.clear();
        return chosen;
    }

private:
    double distance(Quadrant q, std::int64_t index) const {
        return std::abs(static_cast<double>(index) - map_.nadir_major(q));
    }

    /// Borders where the level may change, outwards: wider apart with range. The last one is the end of the raster or of
    /// the range. Lines beyond the last whole cell of the coarsest level are a band of their own.
    std::vector<std::int64_t> borders_of(Quadrant q) const {
        constexpr double first = 64, growth = 1.19;
        const std::int64_t out = outward(q), side = lines_are_columns(q) ? db_.columns : db_.rows;
        const double nadir = map_.nadir_major(q), edge = out > 0 ? static_cast<double>(side - 1) - nadir : nadir,
                     most = std::min(edge, reach_posts(map_, q));
        std::vector<std::int64_t> borders;
        const double least = out > 0 ? -nadir : nadir - static_cast<double>(side - 1);  // where the raster begins
        for (double d = std::max(first, least + first); d < most; d *= growth) {
            const double at = (nadir + static_cast<double>(out) * d) / static_cast<double>(border_posts);
            const auto border = static_cast<std::int64_t>(out > 0 ? std::ceil(at) : std::floor(at)) * border_posts;
            if (border < 0 || border >= side) break;
            if (borders.empty() || borders.back() != border) borders.push_back(border);
        }
        if (borders.empty()) return borders;
        const auto end = static_cast<std::int64_t>(out > 0 ? std::ceil(nadir + most) : std::floor(nadir - most));
        const std::int64_t tail = (side - 1) / border_posts * border_posts;
        if (out > 0 && end > tail && borders.back() < tail) borders.push_back(tail);
        borders.push_back(std::clamp<std::int64_t>(end, 0, side - 1));
        return borders;
    }

    /// [band * fans + fan]
    std::vector<Ground> survey(Quadrant q, const std::vector<std::int64_t>& borders) const {
        std::vector<Ground> ground((borders.size() - 1) * fans_each);
        const bool columns = lines_are_columns(q);
        const auto out = static_cast<double>(outward(q));
        const double reach = std::min(reach_posts(map_, q), distance(q, borders.back())) + 2;
        const double bend = map_.straight() ? 0 : map_.most_bend(q), nadir = map_.nadir_major(q),
                     beside = map_.nadir_minor(q);
        // Blocks that the quadrant may touch.
        const auto blocks = [](double from, double to, std::int64_t posts) {
            const auto a = static_cast<std::int64_t>(std::floor(from / detail_posts)),
                       b = static_cast<std::int64_t>(std::floor(to / detail_posts)) + 1;
            return intersection({a, b}, {0, (posts + detail_posts - 1) / detail_posts});
        };
        const double far = nadir + out * reach;
        const Interval major = blocks(std::min(nadir, far), std::max(nadir, far), columns ? db_.columns : db_.rows),
                       minor = blocks(beside - reach - bend, beside + reach + bend, columns ? db_.rows : db_.columns);
        const Window window = columns ? Window{major, minor} : Window{minor, major};
        for (std::int64_t row = window.rows.begin; row < window.rows.end; ++row) {
            const Window line{window.columns, {row, row + 1}};
            const BlockWindow bounds = read_bounds(bounds_, 2, line, db_.columns, db_.rows);
            const std::vector<Residuals> found = detail_.read(line);
            for (std::int64_t column = line.columns.begin; column < line.columns.end; ++column) {
                const auto at = static_cast<std::size_t>(column - line.columns.begin);
                const auto a = static_cast<double>((columns ? column : row) * detail_posts),
                           b = static_cast<double>((columns ? row : column) * detail_posts);
                // Posts of a level beside a spoke may lie in the next block.
                const double edge = detail_posts, margin = border_posts;
                // From the nadir, outwards and beside.
                const double near_d = std::max(1.0, std::min(out * (a - nadir), out * (a + edge - nadir)) - margin),
                             far_d = std::max(out * (a - nadir), out * (a + edge - nadir)) + margin;
                if (far_d < 1) continue;
                const double lo_m = b - beside - bend - margin, hi_m = b + edge - beside + bend + margin;
                const double lo = std::min(lo_m / near_d, lo_m / far_d), hi = std::max(hi_m / near_d, hi_m / far_d);
                if (lo > 1 || hi < -1) continue;
                const auto fan_of = [](double slope) {
                    return std::clamp(static_cast<int>((std::clamp(slope, -1.0, 1.0) + 1) / 2 * fans_each), 0,
                                      fans_each - 1);
                };
                for (std::size_t band = 0; band + 1 < borders.size(); ++band) {
                    if (distance(q, borders[band]) > far_d || distance(q, borders[band + 1]) < near_d) continue;
                    for (int fan = fan_of(lo); fan <= fan_of(hi); ++fan)
                        ground[band * fans_each + static_cast<std::size_t>(fan)].add(bounds.bounds[at], found[at]);
                }
            }
        }
        return ground;
    }

    int level_of(Quadrant q, int fan, std::int64_t from, std::int64_t to, const Ground& g, int most) const {
        if (g.blocks == 0 || g.every_post) return 0;
        constexpr double steepest =
            0.7;  // below the sensor what counts is not the rise of the sine but the range itself
        const double slope = (2.0 * fan + 1) / fans_each - 1,
                     end = std::min(distance(q, to), map_.params().max_arc_m / map_.metres_per_post(q, slope)),
                     middle = 0.5 * (distance(q, from) + std::max(distance(q, from), end));
        const double arc = map_.place(q, slope, middle).arc_m, height = scene_.sensor_m - g.height_m / g.blocks;
        DetailPlace place;
        place.range_m = std::sqrt(arc * arc + height * height);
        place.grazing_rad = height / place.range_m - 0.5 * arc * map_.inverse_radius(q, slope);
        if (place.grazing_rad > steepest) return 0;
        place.pulse_m = pulse_m(scene_);
        place.beam_m = arc * beam_rad(scene_);
        place.along_m = map_.metres_per_post(q, 0);
        place.across_m = map_.metres_per_post(lines_are_columns(q) ? Quadrant::south : Quadrant::east, 0);
        // Mountains are about so long from foot to crest: a larger block holds several, and is no flatter for that.
        constexpr double slope_m = 1000;
        place.steepness = std::sqrt(g.relief_squared / g.blocks) / std::min(place.along_m * detail_posts, slope_m);
        place.over_noise = bright_.over_noise(place.range_m);
        // Far cells may be off by more than near ones: these cover most of the ground, and no more of the image.
        const double share = std::min(1.0, place.range_m / *scene_.scene.range_m),
                     allowed = detail_rms_db(scene_.scene.quality) * std::sqrt(2 * share);
        // A crest that sinks or rises shifts where its shadow ends by so much over the grazing angle.
        constexpr double crest = 0.5;
        // Of a constant gamma a cell returns its rise, whatever the slopes between its ends; a law that bends with the angle sees
        // these too, and what a level leaves out of them. Measured on shipped terrain: 1.3 to 5 times the error, and beside it
        // what all cells are off by alike.
        const double weight = bent_ ? 3 : 1;
        std::array<double, levels> squared = g.squared;
        for (double& s : squared) s /= g.blocks;
        for (int level = most; level > 0; --level) {
            const auto i = static_cast<std::size_t>(level - 1);
            if (!whole(q, fan, from, to, level) || g.peak_m[i] > crest * place.grazing_rad * place.pulse_m) continue;
            const double error_db =
                weight * detail_error_db(place, level, std::sqrt(squared[i]), g.excess_m3[i] / g.blocks);
            if (error_db > allowed) continue;
            const double lost = lost_slopes(squared, level, std::min(place.along_m, place.across_m));
            if (std::hypot(error_db, laws_.change_db(place.grazing_rad, place.steepness, lost)) <= allowed)
                return level;
        }
        return 0;
    }

    /// True if all ground of the fan between the borders lies in cells of the level that have four posts: the last up to
    /// 2^L - 1 columns and rows of a raster may not.
    bool whole(Quadrant q, int fan, std::int64_t from, std::int64_t to, int level) const {
        const bool columns = lines_are_columns(q);
        const std::int64_t side = columns ? db_.columns : db_.rows, beside = columns ? db_.rows : db_.columns;
        const auto last = [&](std::int64_t posts) { return (posts - 1) >> level << level; };
        if (std::max(from, to) > last(side)) return false;
        const std::int64_t edge = last(beside);
        if (edge == beside - 1) return true;
        const double slope = 2.0 * (fan + 1) / fans_each - 1, most = map_.nadir_minor(q) +
                                                                     slope * distance(q, slope > 0 ? to : from) +
                                                                     (map_.straight() ? 0 : map_.most_bend(q));
        return most <= static_cast<double>(edge);
    }

    const ResolvedScene& scene_;
    const DataBase& db_;
    BlockMap& bounds_;
    DetailMap& detail_;
    const SpokeMap& map_;
    const BrightEcho bright_;
    bool bent_;  // some law depends on the angle
    BentLaws laws_;
};

}  // namespace

double detail_post_m(const ResolvedScene& scene, const DataBase& db) {
    // What raises the ground is no part of the maps.
    if (!raises_m(scene.scene, db).empty()) return infinite;
    if (!scene.scene.detail || detail_rms_db(scene.scene.quality) == 0 || db.cyclic || coarsest(db) == 0)
        return infinite;
    // What detail_error_db() asks for at the least, with the sides of a post as they may be anywhere in range.
    double column_m = std::abs(db.step_x) * db.metres_a_unit(), row_m = std::abs(db.step_y) * db.metres_a_unit();
    if (!db.crs_in_metres) {
        constexpr double a_metre_deg = 1 / 110000.0, pole_deg = 89.9;
        const double most_deg = std::min(pole_deg, std::abs(scene.lat_deg) + *scene.scene.range_m * a_metre_deg);
        column_m *= std::cos(Angle::degrees(most_deg).rad());
    }
    constexpr double slack = 0.9;  // scale of projections
    return slack * std::min(column_m, row_m);
}

namespace {

bool gathers_posts(const ResolvedScene& scene, double post_m) {
    return 4 * post_m <= pulse_m(scene) && 4 * post_m <= *scene.scene.range_m * beam_rad(scene);
}

}  // namespace

bool detail_possible(const ResolvedScene& scene, const DataBase& db) {
    return gathers_posts(scene, detail_post_m(scene, db));
}

bool same_levels(const ResolvedScene& before, bool levels, double post_m, const ResolvedScene& after) {
    const double pulse = pulse_m(before), beam = beam_rad(before), new_pulse = pulse_m(after),
                 new_beam = beam_rad(after);
    if (new_pulse == pulse && new_beam == beam) return true;
    if (levels) return false;
    // The error of a level never falls as the beam narrows; as the pulse does it may, for then shadows' edges wander through more
    // portions of a cell.
    return (new_pulse == pulse && new_beam <= beam) || !gathers_posts(after, post_m);
}

Window detail_window(const ResolvedScene& scene, const DataBase& db) {
    const SpokeMap map(db, swept_map_params(scene, db));
    const auto around = [&](Quadrant major, Quadrant other, std::int64_t posts) {
        // Quadrants beside each other reach as far across as along; and whole blocks.
        const double bend = map.straight() ? 0 : map.most_bend(other), margin = 2 + detail_posts,
                     farthest = std::max(reach_posts(map, major), reach_posts(map, other)) + bend + margin,
                     nadir = map.nadir_major(major);
        return intersection({static_cast<std::int64_t>(std::floor(nadir - farthest)),
                             static_cast<std::int64_t>(std::ceil(nadir + farthest)) + 1},
                            {0, posts});
    };
    return {around(Quadrant::east, Quadrant::south, db.columns), around(Quadrant::south, Quadrant::east, db.rows)};
}

DetailLevels choose_levels(const ResolvedScene& scene, WedgeSource& source, const SpokeMap& map) {
    if (!detail_possible(scene, source.data_base()) || !source.detail_map()) return {};
    return Chooser(scene, source, map)();
}

}  // namespace wedgescope
