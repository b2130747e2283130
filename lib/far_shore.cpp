#include "lib/far_shore.hpp"

#include <algorithm>
#include <cmath>

#include "lib/scene.hpp"
#include "lib/sea.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {
namespace {

constexpr int intervals = 4096;

struct Image {
    double up_m, out_m;
    double sine() const { return up_m / std::sqrt(up_m * up_m + out_m * out_m); }
};
/// A point's image in the level of the water: as far below it as the point is above, along the vertical of the place.
Image image_of(const ShorePoint& p, double level_m) {
    const double x = p.theta * p.theta, cosine = 1 - 0.5 * x * (1 - x * (1.0 / 12)),
                 sine = p.theta * (1 - x * (1.0 / 6) * (1 - x * (1.0 / 20)));
    const double twice = 2 * (p.height_m - level_m);
    return {p.up_m - twice * cosine, p.out_m - twice * sine};
}

/// Neither image is below the window: then nor is any between, for what is above a ray is one side of a straight line.
/// Without a root or a division.
bool above(const ShoreWindow& window, const Image& a, const Image& b) {
    if (!(window.top < 0)) return false;
    const double square = window.top * window.top;
    const auto is_above = [square](const Image& image) {
        const double up2 = image.up_m * image.up_m;
        return !(image.up_m < 0) || !(up2 > square * (up2 + image.out_m * image.out_m));
    };
    return is_above(a) && is_above(b);
}

}  // namespace

bool lights_far_shores(const Scene& scene, const DataBase& data_base) {
    return scene.far_shore && data_base.has_culture;
}

ShoreWindow ShoreWindow::between(const ShoreWindow& a, const ShoreWindow& b) {
    if (a.state == none || b.state == none) return {};
    ShoreWindow c;
    c.state = a.state == in_water || b.state == in_water ? in_water : on_land;
    c.from = std::max(a.from, b.from);
    c.top = std::min(a.top, b.top);
    c.level_m = 0.5 * (a.level_m + b.level_m);
    return c;
}

FarShore::FarShore(const ClassLawParams& params) {
    if (!params.far_shore || params.gamma) return;
    const std::vector<Material>& classes = params.materials.rows();
    std::transform(classes.begin(), classes.end(), water_.begin(), is_of_water);
    const bool calm = params.water == WaterModel::calm || params.sea_state == 0;
    const Permittivity water = water_permittivity(params.frequency_hz, calm ? fresh_water : Water{});
    const double rms_m = calm ? 0 : rms_wave_height_m(params.sea_state);
    const auto exact = [&](double root) {
        return far_shore_gain(water, params.frequency_hz, params.polarisation, rms_m,
                              Angle::radians(std::asin(std::min(1.0, root * root))));
    };
    for (int i = 0; i <= intervals; ++i)
        entries_.push_back(static_cast<float>(exact(static_cast<double>(i) / intervals)));
    most_ = static_cast<double>(*std::max_element(entries_.begin(), entries_.end()));
    for (int i = 0; i < intervals; ++i) {
        const double root = (i + 0.5) / intervals;
        error_ = std::max(error_, std::abs(gain(root * root) / exact(root) - 1));
    }
}

FarShore FarShore::without_gain() const {
    FarShore plain = *this;
    std::fill(plain.entries_.begin(), plain.entries_.end(), 1.0F);
    plain.most_ = 1;
    return plain;
}

double FarShore::gain(double sine) const noexcept {
    if (!(sine > 0)) return 1;
    const double place = std::sqrt(sine < 1 ? sine : 1.0) * intervals;
    const int whole = static_cast<int>(place), i = whole < intervals ? whole : intervals - 1;
    const double a = static_cast<double>(entries_[static_cast<std::size_t>(i)]),
                 b = static_cast<double>(entries_[static_cast<std::size_t>(i) + 1]);
    return a + (place - i) * (b - a);
}

void FarShore::pass_water(ShoreWindow& window, const ShorePoint& a, const ShorePoint& b) noexcept {
    if (window.state != ShoreWindow::in_water) window.from = a.sine;
    window.state = ShoreWindow::in_water;
    window.top = b.sine;
    window.level_m = b.height_m;
}

bool FarShore::clear_of(const ShoreWindow& window, const ShorePoint& a, const ShorePoint& b) noexcept {
    return above(window, image_of(a, window.level_m), image_of(b, window.level_m));
}

double FarShore::pass_land(ShoreWindow& window, const ShorePoint& a, const ShorePoint& b) const noexcept {
    if (window.state == ShoreWindow::none) return 1;
    window.state = ShoreWindow::on_land;
    const Image first = image_of(a, window.level_m), last = image_of(b, window.level_m);
    if (above(window, first, last)) return 1;
    const double near = first.sine(), far = last.sine();
    const double high = near < window.top ? near : window.top, low = far > window.from ? far : window.from;
    const double lowest = near < far ? near : far;
    if (lowest < window.top) window.top = lowest;
    if (!(window.top > window.from)) window.state = ShoreWindow::none;
    if (!(high > low) || !(near > far)) return 1;
    // The grazing angle of the middle ray: its depression less what the vertical turns by.
    const double middle = 0.5 * (high + low), theta = 0.5 * (a.theta + b.theta), x = theta * theta,
                 level = std::sqrt(1 - middle * middle);
    const double grazing =
        -(middle * (1 - 0.5 * x * (1 - x * (1.0 / 12))) + level * theta * (1 - x * (1.0 / 6) * (1 - x * (1.0 / 20))));
    return 1 + (high - low) / (near - far) * (gain(grazing) - 1);
}

}  // namespace wedgescope
