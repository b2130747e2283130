#include "lib/surroundings.hpp"

#include <GeographicLib/Geodesic.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "lib/rounding.hpp"

namespace wedgescope {
namespace {

/// What a metre to the east and one to the north are on the grid, near the nadir; none if that cannot be said.
std::optional<std::array<IndexPosition, 2>> metre_on_grid(const ResolvedScene& s, const DataBase& db) {
    if (s.geometry == Geometry::grid)
        return std::array<IndexPosition, 2>{
            {{1 / (db.step_x * db.metres_per_unit), 0}, {0, 1 / (db.step_y * db.metres_per_unit)}}};
    std::array<IndexPosition, 2> metre;
    constexpr double far_m = 1000;
    for (const std::size_t north : {0, 1}) {
        double lat = 0, lon = 0;
        GeographicLib::Geodesic::WGS84().Direct(s.lat_deg, s.lon_deg, north ? 0 : 90, far_m, lat, lon);
        const IndexPosition there = db.locate(lat, lon);
        metre[north] = {db.columns_between(s.nadir.column, there.column) / far_m, (there.row - s.nadir.row) / far_m};
        if (!std::isfinite(metre[north].column) || !std::isfinite(metre[north].row)) return std::nullopt;
    }
    return metre;
}

/// Bare terrain of many windows, read in the order of the file's blocks: of packed ones that no cache can hold each is decoded once
/// or twice, not for every window.
class GroundSamples {
public:
    /// Its number.
    std::size_t add(const Window& window) {
        windows_.push_back(window);
        begins_.push_back(begins_.back() + static_cast<std::size_t>(window.posts()));
        return windows_.size() - 1;
    }
    void read(WedgeSource& source) {
        const DataBase& db = source.data_base();
        std::vector<std::pair<std::pair<std::int64_t, std::int64_t>, std::size_t>> order;
        for (std::size_t i = 0; i < windows_.size(); ++i)
            order.push_back(
                {{windows_[i].rows.begin / db.block_rows, db.real_column(windows_[i].columns.begin) / db.block_columns},
                 i});
        std::sort(order.begin(), order.end());
        heights_m_.resize(begins_.back());
        for (const auto& [block, i] : order) source.read_bare_terrain(windows_[i], heights_m_.data() + begins_[i]);
    }
    const Window& window(std::size_t i) const { return windows_[i]; }
    /// After read(): row after row.
    const float* heights_m(std::size_t i) const { return heights_m_.data() + begins_[i]; }

private:
    std::vector<Window> windows_;
    std::vector<std::size_t> begins_{0};
    std::vector<float> heights_m_;
};

/// Sums of z00 - z10 - z01 + z11 over the cells of windows.
class Saddles {
public:
    /// What lies round a post, as wide as reading it costs little: a few rows of a tile.
    static Window round(const DataBase& db, std::int64_t column, std::int64_t row) {
        Interval columns{column - width / 2, column + width / 2};
        if (!db.cyclic) columns = intersection(columns, {0, db.columns});
        return {columns, intersection({row - height / 2, row + height / 2}, {0, db.rows})};
    }
    void add(const Window& window, const float* heights_m) {
        const std::int64_t columns = window.columns.size();
        for (std::int64_t j = 1; j < window.rows.size(); ++j)
            for (std::int64_t i = 1; i < columns; ++i) {
                const float *here = heights_m + j * columns + i, *above = here - columns;
                const double saddle = static_cast<double>(here[0]) - static_cast<double>(here[-1]) -
                                      static_cast<double>(above[0]) + static_cast<double>(above[-1]);
                if (!(std::abs(saddle) < infinite)) continue;  // of a void
                sum_ += saddle * saddle;
                ++cells_;
            }
    }
    double rms_m() const { return cells_ > 0 ? std::sqrt(sum_ / static_cast<double>(cells_)) : 0; }

private:
    static constexpr std::int64_t width = 32, height = 4;
    double sum_ = 0;
    std::int64_t cells_ = 0;
};

struct Post {
    std::int64_t column, row;
};
/// Nothing outside the raster, or where a place is none.
std::optional<Post> nearest_post(const DataBase& db, IndexPosition place) {
    if (!std::isfinite(place.column) || !std::isfinite(place.row)) return {};
    const auto nearest = [](double at) {
        return static_cast<std::int64_t>(std::floor(rounded(at, position_bits) + 0.5));
    };
    const Post post{nearest(place.column), nearest(place.row)};
    if (post.row < 0 || post.row >= db.rows || (!db.cyclic && (post.column < 0 || post.column >= db.columns)))
        return {};
    return post;
}

constexpr double degree_rad = std::numbers::pi / 180;

/// The post nearest to what lies in a direction at a distance on the ground; nothing outside the raster.
std::optional<Post> post_at(const ResolvedScene& s, const DataBase& db, double azimuth_rad, double arc_m) {
    IndexPosition there;
    if (s.geometry == Geometry::grid) {
        there = {s.nadir.column + arc_m * std::sin(azimuth_rad) / (db.step_x * db.metres_per_unit),
                 s.nadir.row + arc_m * std::cos(azimuth_rad) / (db.step_y * db.metres_per_unit)};
    } else {
        double lat = 0, lon = 0;
        GeographicLib::Geodesic::WGS84().Direct(s.lat_deg, s.lon_deg, azimuth_rad / degree_rad, arc_m, lat, lon);
        there = db.locate(lat, lon);
    }
    return nearest_post(db, there);
}

}  // namespace

void look_around(ResolvedScene& s, WedgeSource& source) {
    const DataBase& db = source.data_base();
    const auto metre = metre_on_grid(s, db);
    if (!metre) return;
    constexpr int rings = 12, rays = 32;
    constexpr double most_posts = 640;
    const double reach_m = std::min(*s.scene.range_m, most_posts * s.longer_post_m), step = s.shown.azimuth_step_rad(),
                 from = static_cast<double>(s.shown.azimuth_bins.begin) * step,
                 width = static_cast<double>(s.shown.azimuth_bins.size()) * step;
    GroundSamples samples;
    std::vector<std::size_t> posts, surroundings;
    for (int ring = 0; ring < rings; ++ring)
        for (int ray = 0; ray < rays; ++ray) {
            const double distance = reach_m * std::sqrt((ring + 0.5) / rings),  // each stands for as much ground
                azimuth = from + width * (ray + (ring % 2 ? 0.75 : 0.25)) / rays, east = distance * std::sin(azimuth),
                         north = distance * std::cos(azimuth);
            const auto post = nearest_post(db, {s.nadir.column + east * (*metre)[0].column + north * (*metre)[1].column,
                                                s.nadir.row + east * (*metre)[0].row + north * (*metre)[1].row});
            if (!post) continue;
            const auto [column, row] = *post;
            posts.push_back(samples.add({{column, column + 1}, {row, row + 1}}));
            if ((ray + 3 * ring) % 8 == 0)  // of four rays a ring, others each time
                surroundings.push_back(samples.add(Saddles::round(db, column, row)));
        }
    samples.read(source);
    std::vector<float> heights_m;
    for (const std::size_t i : posts)
        if (const float height = *samples.heights_m(i); height == height) heights_m.push_back(height);
    Saddles saddles;
    for (const std::size_t i : surroundings) saddles.add(samples.window(i), samples.heights_m(i));
    s.roughness = saddles.rms_m() / (4 * s.longer_post_m);
    if (heights_m.empty()) return;
    const auto highest = heights_m.end() - 1 - static_cast<std::ptrdiff_t>(heights_m.size() / 100);
    std::nth_element(heights_m.begin(), highest, heights_m.end());
    s.clearance_m = s.sensor_m - static_cast<double>(*highest);
}

namespace {

/// How low rain is seen along one azimuth.
class RainRay {
public:
    explicit RainRay(const ResolvedScene& s) : s_(&s) {
        if (!s.nadir_on_data) return;
        ground_m_ = s.reference_m;
        floor_.push_back({std::abs(s.sensor_m - s.reference_m), s.reference_m});
    }
    /// Outwards; a height that nobody knows is that of the ground before it.
    void pass(double arc_m, std::optional<double> height_m) {
        ground_m_ = height_m.value_or(ground_m_);
        if (std::isnan(ground_m_)) return;
        constexpr int height_bits = 2;
        const Earth::Sight to = s_->earth.sight(s_->sensor_m, ground_m_, arc_m);
        const bool seen = to.depression_rad <= depression_rad_;
        if (seen) depression_rad_ = to.depression_rad;
        const double lowest_m =
            seen ? ground_m_ : s_->earth.ray_point(s_->sensor_m, depression_rad_, to.slant_range_m).height_m;
        const RainFloor knot{rounded(to.slant_range_m, height_bits), rounded(lowest_m, height_bits)};
        // Ground that comes no later than ground nearer to the nadir, as the rim of a pit does, cuts the rays off first.
        while (!floor_.empty() && floor_.back().range_m >= knot.range_m) floor_.pop_back();
        floor_.push_back(knot);
    }
    std::vector<RainFloor>&& floor() && { return std::move(floor_); }

private:
    const ResolvedScene* s_;
    double ground_m_ = NAN, depression_rad_ = std::numbers::pi / 2;
    std::vector<RainFloor> floor_;
};

}  // namespace

std::vector<std::vector<RainFloor>> rain_floor(const ResolvedScene& s, WedgeSource& source) {
    constexpr double first_m = 64, wider = 1.1;
    constexpr std::size_t rays = 32;
    GroundSamples posts;
    std::vector<std::optional<std::size_t>> samples;  // of ray after ray, ring after ring; none outside the raster
    bool within = true;
    for (double arc_m = first_m; within; arc_m *= wider) {
        within = arc_m < *s.scene.range_m;
        for (std::size_t ray = 0; ray < rays; ++ray) {
            const double azimuth = 2 * std::numbers::pi * static_cast<double>(ray) / static_cast<double>(rays);
            const auto post = post_at(s, source.data_base(), azimuth, arc_m);
            samples.push_back(
                post ? std::optional(posts.add({{post->column, post->column + 1}, {post->row, post->row + 1}}))
                     : std::nullopt);
        }
    }
    posts.read(source);

    std::vector<std::vector<RainFloor>> floors;
    for (std::size_t ray = 0; ray < rays; ++ray) {
        RainRay along(s);
        double arc_m = first_m;
        for (std::size_t i = ray; i < samples.size(); i += rays, arc_m *= wider) {
            std::optional<double> height_m;
            if (samples[i])
                if (const float post_m = *posts.heights_m(*samples[i]); post_m == post_m)
                    height_m = static_cast<double>(post_m);
            along.pass(arc_m, height_m);
        }
        floors.push_back(std::move(along).floor());
    }
    if (std::all_of(floors.begin(), floors.end(), [&](const auto& floor) { return floor == floors[0]; }))
        floors.resize(floors[0].empty() ? 0 : 1);
    return floors;
}

}  // namespace wedgescope
