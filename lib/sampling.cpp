// sampling_of(): how densely a scene is sampled, by what is known of its ground and of its echoes.
#include <algorithm>
#include <array>
#include <cmath>

#include "lib/bright_echo.hpp"
#include "lib/engine.hpp"
#include "lib/raised_source.hpp"
#include "lib/rounding.hpp"
#include "lib/spoke_grid.hpp"

namespace wedgescope {
namespace {

/// Sampling::quiet_posts. What may hang on the angle or shine by way of water is never quiet.
std::array<double, 4> quiet_posts(const ResolvedScene& s, const DataBase& db) {
    std::array<double, 4> quiet = Sampling{}.quiet_posts;
    const double post_m = s.shorter_post_m, h = s.sensor_m - s.reference_m;
    const BrightEcho bright(s, db);
    if (!bright.known() || !(post_m > 0)) return quiet;
    const auto ratio_at = [&](double posts) {
        return rounded_significand(bright.over_noise(std::hypot(posts * post_m, h)), 30);
    };
    const auto look = [&](double posts, double ratio) {
        for (std::size_t i = 0; i < quiet.size(); ++i) {
            if (ratio >= Sampling::quiet_above[i])
                quiet[i] = infinite;
            else if (quiet[i] == infinite)
                quiet[i] = posts;
        }
    };
    // To 2 %, where one of the borders lies between two places.
    constexpr double first = 16, far = 1.125, near = 1.02;
    double last = 0;
    for (double posts = first; posts * post_m < *s.scene.range_m; posts *= far) {
        const double ratio = ratio_at(posts);
        const auto crossed = [&](double above) { return (last >= above) != (ratio >= above); };
        if (posts > first && std::any_of(Sampling::quiet_above.begin(), Sampling::quiet_above.end(), crossed))
            for (double between = posts / far * near; between < posts; between *= near)
                look(between, ratio_at(between));
        look(posts, ratio);
        last = ratio;
    }
    return quiet;
}

/// What part of its height a sensor counts as high over ground of a roughness: single posts that stand out throw shadows as
/// long as ground of usual relief does from lower down. 1 for relief as mountains have it at 30 m.
double lower_for(double roughness) {
    constexpr double usual = 0.1, needles = 0.16, at_needles = 0.085;
    static const double power = std::log(at_needles) / std::log(usual / needles);
    if (roughness <= usual) return 1;
    return rounded_significand(
        roughness < needles ? std::pow(usual / roughness, power) : at_needles * needles / roughness, 30);
}

/// As how many posts high a sensor counts at the least: what lies nearer than a post is smooth, and shows no finer features to one
/// that is lower. Unless something stands there; and borders between classes ask for some more.
double lowest_counted(Quality quality, GroundCover cover) {
    if (cover == GroundCover::bare) return quality == Quality::draft ? 0.5 : 1;
    return cover == GroundCover::classes && (quality == Quality::normal || quality == Quality::fine) ? 0.5 : 0;
}

/// Spokes a post, at least, where what stands around says more than the ground below.
double least_beside_mountains(Quality quality) {
    switch (quality) {
        case Quality::draft:
            return 0.9;
        case Quality::normal:
            return 1.2;
        case Quality::fine:
            return 2;
        case Quality::exact:
            return 2.75;
    }
    return 0;
}

}  // namespace

Sampling sampling_of(const ResolvedScene& scene, const DataBase& db) {
    // Where statistical walls raise the ground it steps from class to class.
    const bool steps = db.has_culture_height || (db.has_culture && !raises_m(scene.scene, db).empty());
    const GroundCover cover = steps ? GroundCover::heights : db.has_culture ? GroundCover::classes : GroundCover::bare;
    // Beside mountains the ground below says little; where they stand as high as the sensor, as if it were 2 posts up, or 5 over
    // heights, whose bins take many spokes anyway. A tenth more of clearance: ground that is about level stands above the nadir here
    // and there.
    const double above = (scene.sensor_m - scene.reference_m) / scene.longer_post_m,
                 over_most = std::max(steps ? 5.0 : 2.0, 1.1 * scene.clearance_m / scene.longer_post_m);
    const double counted =
        std::max(lowest_counted(scene.scene.quality, cover), std::min(above, over_most)) * lower_for(scene.roughness);
    Sampling own = sampling(scene.scene, cover, counted);
    // There crests hide ground far off too, where bins are wide and only spokes a post count.
    if (counted < std::min(above, 40.0) && !scene.scene.spokes_per_post)
        own.spokes_per_post = std::max(own.spokes_per_post, least_beside_mountains(scene.scene.quality));
    if (!scene.nadir_on_data) own.above_posts = 0;  // nobody knows above what
    if (own.above_posts > 0) own.quiet_posts = quiet_posts(scene, db);
    return own;
}

}  // namespace wedgescope
