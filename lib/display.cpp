#include "lib/display.hpp"

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>

#include "lib/display_lanes.hpp"
#include "lib/error.hpp"
#include "lib/length.hpp"
#include "lib/pixel_fill.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {
namespace {

constexpr double full_turn = 2 * std::numbers::pi;

constexpr double ring_grey = 96;  ///< added to the picture: seen on black, no more than a brighter trace on ground
constexpr double edge_grey = 96;
constexpr double line_grey = 96;
constexpr double mark_grey = 144;

/// The angle, turned into [0, 2 pi).
double wrapped(double angle_rad) {
    const double turned = angle_rad - full_turn * std::floor(angle_rad / full_turn);
    return turned < full_turn ? turned : 0;
}

double largest_radius_m(const DisplaySetting& setting) {
    const std::optional<double> radius = display_radius_m(setting, setting.range_m);
    if (!radius || !(*radius > 0)) {
        const bool delayed = setting.params.kind == DisplayKind::tdppi;
        throw InputError(
            fmt::format("range is {:.1f} m; display {} shows nothing nearer than {}, {:.1f} m (give a larger "
                        "range, or display ppi)",
                        setting.range_m, word(setting.params.kind),
                        delayed ? "its sweep delay" : "the sensor's height above the reference height",
                        delayed ? setting.sweep_delay_m : setting.sensor_m - setting.reference_m));
    }
    return *radius;
}

/// Step of the range rings: the least of 1, 2, 5 x 10^n nautical miles with fewer than ten rings, one on the rim left out; then
/// there are at least four.
double ring_step_m(double radius_m) {
    for (double decade = 1e-6; decade < 1e9; decade *= 10)
        for (const double digit : {1.0, 2.0, 5.0})
            if (radius_m * (1 - 1e-9) < 10 * digit * decade * nautical_mile_m) return digit * decade * nautical_mile_m;
    return radius_m;
}

/// Share of a pixel that a line one pixel wide covers whose middle passes at this distance.
double coverage(double distance_pixels) { return std::max(0.0, 1 - std::abs(distance_pixels)); }

/// Light that rings, marks and the sector's edges add to a pixel.
class Graticule {
public:
    Graticule(const DisplaySetting& setting, const Frame& frame) : metres_per_pixel_(frame.metres_per_pixel) {
        radius_m_ = largest_radius_m(setting);
        ring_step_m_ = ring_step_m(radius_m_);
        if (setting.params.rings && setting.params.ring_spacing_m) ring_step_m_ = *setting.params.ring_spacing_m;
        // A ring that coincides with the rim is left out.
        rings_ = static_cast<int>(std::floor(radius_m_ / ring_step_m_ * (1 - 1e-9)));
        short_mark_m_ = std::max(4 * metres_per_pixel_, 0.015 * radius_m_);
        long_mark_m_ = 2 * short_mark_m_;
        up_rad_ = frame.up_azimuth_rad;
        sector_ = !setting.shown.full_circle();
        const double step = setting.shown.azimuth_step_rad();
        width_rad_ = static_cast<double>(setting.shown.azimuth_bins.size()) * step;
        rings_shown_ = setting.params.rings;
        if (setting.params.azimuth_marks_rad) {
            constexpr double apart_pixels = 4;
            line_step_rad_ = *setting.params.azimuth_marks_rad;
            last_line_ = std::floor(0.5 * full_turn / line_step_rad_ * (1 + 1e-12));
            heading_rad_ = setting.heading.rad();
            lines_from_m_ = apart_pixels * metres_per_pixel_ / line_step_rad_;
        }
    }

    std::vector<double> ring_radii_m() const {
        std::vector<double> radii;
        for (int k = 1; k <= rings_; ++k) radii.push_back(k * ring_step_m_);
        return radii;
    }

    double ring_step() const { return ring_step_m_; }
    /// Marks begin here.
    double mark_radius_m() const { return radius_m_ - long_mark_m_; }
    double sector_rad() const { return sector_ ? width_rad_ : 0; }

    /// Grey to add at a radius and azimuth; `into_rad` is the angle from the sector's first edge.
    double light(double radius_m, double azimuth_rad, double into_rad) const {
        return std::max(rings_shown_ ? ring_light(radius_m, azimuth_rad, into_rad) : 0,
                        line_step_rad_ > 0 ? line_light(radius_m, azimuth_rad) : 0);
    }

private:
    double ring_light(double radius_m, double azimuth_rad, double into_rad) const {
        double grey = 0;
        const double ring = std::round(radius_m / ring_step_m_);
        if (ring >= 1 && ring <= rings_)
            grey = ring_grey * coverage((radius_m - ring * ring_step_m_) / metres_per_pixel_);
        if (radius_m > radius_m_ - long_mark_m_) {
            constexpr double ten_degrees = full_turn / 36;
            const double tens = std::round((azimuth_rad - up_rad_) / ten_degrees);
            const bool is_long = std::fmod(tens, 3) == 0;
            if (is_long || radius_m > radius_m_ - short_mark_m_) {
                const double off_rad = azimuth_rad - up_rad_ - tens * ten_degrees;
                grey = std::max(grey, mark_grey * coverage(radius_m * off_rad / metres_per_pixel_));
            }
        }
        if (sector_) {
            // A pixel within: what falls on pixels outside is not drawn.
            const double off_rad = std::min(into_rad, width_rad_ - into_rad);
            grey = std::max(grey, edge_grey * coverage(radius_m * off_rad / metres_per_pixel_ - 1));
        }
        return grey;
    }

    double line_light(double radius_m, double azimuth_rad) const {
        if (radius_m < lines_from_m_) return 0;
        const double off_rad = std::remainder(azimuth_rad - heading_rad_, full_turn);
        const double line = std::clamp(std::round(off_rad / line_step_rad_), -last_line_, last_line_);
        return line_grey * coverage(radius_m * (off_rad - line * line_step_rad_) / metres_per_pixel_);
    }

    bool rings_shown_ = true;
    double line_step_rad_ = 0, last_line_ = 0, heading_rad_ = 0, lines_from_m_ = 0;  // step 0: no lines
    double metres_per_pixel_ = 1, radius_m_ = 0, ring_step_m_ = 0, short_mark_m_ = 0, long_mark_m_ = 0;
    double up_rad_ = 0, width_rad_ = 0;
    int rings_ = 0;
    bool sector_ = false;
};

}  // namespace

std::optional<double> display_radius_m(const DisplaySetting& setting, double range_m) {
    switch (setting.params.kind) {
        case DisplayKind::gpi:
            return setting.earth.arc_m(setting.sensor_m, setting.reference_m, range_m);
        case DisplayKind::tdppi:
            if (range_m < setting.sweep_delay_m) return std::nullopt;
            return range_m - setting.sweep_delay_m;
        case DisplayKind::ppi:
        case DisplayKind::gpi_true:
            break;
    }
    if (range_m < 0) return std::nullopt;
    return range_m;
}

std::optional<double> display_range_m(const DisplaySetting& setting, double radius_m) {
    if (radius_m < 0) return std::nullopt;
    switch (setting.params.kind) {
        case DisplayKind::gpi:
            return setting.earth.slant_range_m(setting.sensor_m, setting.reference_m, radius_m);
        case DisplayKind::tdppi:
            return radius_m + setting.sweep_delay_m;
        case DisplayKind::ppi:
        case DisplayKind::gpi_true:
            break;
    }
    return radius_m;
}

Frame frame(const DisplaySetting& setting) {
    Frame result;
    result.up_azimuth_rad = setting.params.orientation == Orientation::heading ? wrapped(setting.heading.rad()) : 0;
    const double radius_m = largest_radius_m(setting);
    require_rings(setting);
    const auto size = static_cast<double>(setting.params.size);
    if (const std::optional<TubePlace>& centre = setting.params.centre) {
        const double farthest_side = 1 + std::max(std::abs(centre->x), std::abs(centre->y));  // in halves of a side
        result.width = result.height = setting.params.size;
        result.metres_per_pixel = rounded_significand(2 * radius_m / farthest_side / size, 32);
        result.centre_column = rounded((1 + centre->x) / 2 * size, 20);
        result.centre_row = rounded((1 - centre->y) / 2 * size, 20);
        return result;
    }

    // The sector's box in units of the radius, the centre always inside.
    double left = 0, right = 0, bottom = 0, top = 0;
    if (setting.shown.full_circle()) {
        left = bottom = -1;
        right = top = 1;
    } else {
        const double step = setting.shown.azimuth_step_rad();
        const double from =
            wrapped(static_cast<double>(setting.shown.azimuth_bins.begin) * step - result.up_azimuth_rad);
        const double to = from + static_cast<double>(setting.shown.azimuth_bins.size()) * step;
        const auto hold = [&](double x, double y) {
            left = std::min(left, x);
            right = std::max(right, x);
            bottom = std::min(bottom, y);
            top = std::max(top, y);
        };
        hold(std::sin(from), std::cos(from));
        hold(std::sin(to), std::cos(to));
        constexpr double axis_x[] = {0, 1, 0, -1};
        constexpr double axis_y[] = {1, 0, -1, 0};
        for (int quarter = 0; quarter < 8; ++quarter) {
            const double axis = quarter * full_turn / 4;
            if (axis >= from && axis <= to) hold(axis_x[quarter % 4], axis_y[quarter % 4]);
        }
    }

    const double longer = std::max(right - left, top - bottom);
    const auto pixels = [&](double length) {
        return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(length / longer * size - 1e-6)));
    };
    result.width = pixels(right - left);
    result.height = pixels(top - bottom);
    // libm's last bit must not move a pixel: 2^-32 of the scale and 2^-20 of a pixel are far finer than one.
    result.metres_per_pixel = rounded_significand(longer * radius_m / size, 32);
    result.centre_column = rounded(-left / longer * size, 20);
    result.centre_row = rounded(top / longer * size, 20);
    return result;
}

void require_rings(const DisplaySetting& setting) {
    constexpr double most = 200;
    if (!setting.params.rings || !setting.params.ring_spacing_m) return;
    const std::optional<double> radius = display_radius_m(setting, setting.range_m);
    if (radius && *radius > most * *setting.params.ring_spacing_m)
        throw InputError(
            fmt::format("ring-spacing is {:.12g} m; with a radius of {:.1f} m on the tube it must be at "
                        "least {:.1f} m, which makes {:.0f} rings",
                        *setting.params.ring_spacing_m, *radius, *radius / most, most));
}

std::size_t bytes_a_pixel(const DisplayParams& params) {
    const std::size_t picture = 2 + (params.alpha ? 1 : 0);
    switch (params.pixel_fill) {
        case PixelFill::interpolate:
            return picture;
        case PixelFill::none:
            return picture + paint_bytes_a_pixel;
        case PixelFill::holes:
            return picture + fill_bytes_a_pixel;
    }
    return picture;
}

namespace {

PixelScene pixel_scene(const DisplaySetting& setting, const Frame& f, const Graticule& graticule) {
    const PolarGrid& grid = setting.shown;
    PixelScene s;
    s.centre_column = f.centre_column;
    s.metres_per_pixel = f.metres_per_pixel;
    s.up_azimuth_rad = f.up_azimuth_rad;
    s.chord = setting.params.kind == DisplayKind::gpi;
    s.inverse_radius = setting.earth.inverse_radius();
    s.rise_m = setting.sensor_m - setting.reference_m;
    s.growth = (1 + setting.sensor_m * s.inverse_radius) * (1 + setting.reference_m * s.inverse_radius);
    s.delay_m = setting.params.kind == DisplayKind::tdppi ? setting.sweep_delay_m : 0;
    s.least_range_m = setting.range_start_m;
    s.most_range_m = setting.range_m;
    s.most_radius_m = largest_radius_m(setting);
    s.bins_per_metre = 1 / grid.range_bin_m;
    s.bins_per_radian = static_cast<double>(grid.circle_bins) / full_turn;
    s.first_azimuth = static_cast<double>(grid.azimuth_bins.begin);
    s.first_range = static_cast<double>(grid.range_bins.begin);
    s.circle_bins = static_cast<std::int32_t>(grid.circle_bins);
    s.azimuth_bins = static_cast<std::int32_t>(grid.azimuth_bins.size());
    s.range_bins = static_cast<std::int32_t>(grid.range_bins.size());
    s.wraps = grid.full_circle();
    s.light = setting.params.rings;
    s.ring_step_m = graticule.ring_step();
    s.mark_radius_m = graticule.mark_radius_m();
    s.sector_rad = graticule.sector_rad();
    return s;
}

/// Of a row whose pixels' middles lie `y_m` above the centre, those that lie within the radius, and few others.
Interval columns_within(const Frame& f, double radius_m, double y_m) {
    const double half = std::sqrt(std::max(0.0, radius_m * radius_m - y_m * y_m)) / f.metres_per_pixel + 1;
    const auto column = [&](double at) {
        return static_cast<std::int64_t>(std::clamp(at, 0.0, static_cast<double>(f.width)));
    };
    return {column(f.centre_column - half), column(f.centre_column + half + 1)};
}

/// Pixels without power that lie in the picture's range and sector, row after row.
std::vector<std::uint32_t> holes(const std::vector<double>& painted_w, const Frame& f, const PixelScene& scene) {
    std::vector<std::uint8_t> hole(painted_w.size(), 0);
    oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::int64_t>(0, f.height, 8), [&](const auto& rows) {
        const auto pixels = std::make_unique<PixelRow>();
        for (std::int64_t row = rows.begin(); row < rows.end(); ++row) {
            const double y = (f.centre_row - (static_cast<double>(row) + 0.5)) * f.metres_per_pixel;
            const Interval columns = columns_within(f, scene.most_radius_m, y);
            for (std::int64_t column = columns.begin; column < columns.end; column += std::int64_t{pixel_lanes}) {
                const auto n = static_cast<std::size_t>(std::min(columns.end - column, std::int64_t{pixel_lanes}));
                place_pixels(n, column, y, scene, *pixels);
                const auto first = static_cast<std::size_t>(row * f.width + column);
                for (std::size_t i = 0; i < n; ++i) hole[first + i] = pixels->shown[i] && painted_w[first + i] < 0;
            }
        }
    });
    std::vector<std::uint32_t> places;
    places.reserve(static_cast<std::size_t>(std::count(hole.begin(), hole.end(), 1)));
    for (std::size_t i = 0; i < hole.size(); ++i)
        if (hole[i]) places.push_back(static_cast<std::uint32_t>(i));
    return places;
}

}  // namespace

Picture picture(const ReceivedPower& received, const PolarImage<std::uint8_t>& state, const DisplaySetting& setting,
                const Receiver& receiver, Picture&& used, const Stop* stop) {
    const PolarGrid& grid = setting.shown;
    if (received.grid() != grid || state.grid != grid || grid.cells() == 0)
        throw std::invalid_argument("picture: power, states and display have different grids, or empty ones");

    Picture result;
    result.frame = frame(setting);
    result.grey = std::move(used.grey);
    result.state = std::move(used.state);
    const Frame& f = result.frame;
    const Graticule graticule(setting, f);
    if (setting.params.rings) result.ring_range_m = graticule.ring_radii_m();
    result.grey.assign(static_cast<std::size_t>(f.width * f.height), 0);
    result.state.assign(static_cast<std::size_t>(f.width * f.height), static_cast<std::uint8_t>(State::outside));

    const PixelScene scene = pixel_scene(setting, f, graticule);
    std::vector<double> painted_w;
    if (setting.params.pixel_fill != PixelFill::interpolate) painted_w = paint_cells(received, setting, f);
    if (setting.params.pixel_fill == PixelFill::holes) fill_holes(painted_w, f, holes(painted_w, f, scene), stop);
    const bool lines = setting.params.azimuth_marks_rad.has_value();
    std::atomic<std::uint64_t> lit = 0;
    const bool ground_bins = setting.params.kind == DisplayKind::gpi_true;
    // cell_w(cell, its range bin): watts. By value: what bytes are written to could be anything that is not.
    const auto draw_row = [&](const auto cell_w, std::int64_t row, PixelRow& pixels) {
        const std::size_t width = grid.range_count();
        const std::uint8_t* const state_of = state.cells.data();
        std::uint64_t lit_here = 0;
        const double y = (f.centre_row - (static_cast<double>(row) + 0.5)) * f.metres_per_pixel;
        // A cell at the rim may fall on a pixel whose own middle lies outside.
        const Interval columns = painted_w.empty() ? columns_within(f, scene.most_radius_m, y) : Interval{0, f.width};
        for (std::int64_t column = columns.begin; column < columns.end; column += std::int64_t{pixel_lanes}) {
            const auto n = static_cast<std::size_t>(std::min(columns.end - column, std::int64_t{pixel_lanes}));
            place_pixels(n, column, y, scene, pixels);
            std::uint8_t* const greys = result.grey.data() + row * f.width + column;
            std::uint8_t* const states = result.state.data() + row * f.width + column;
            const double* const painted = painted_w.empty() ? nullptr : painted_w.data() + row * f.width + column;
            const auto index = [](std::int32_t bin) { return static_cast<std::size_t>(bin); };
            // Of all, shown or not, their bins are some of the image's: quicker than asking.
            std::array<double, pixel_lanes> watts;
            for (std::size_t i = 0; !painted && i < n; ++i) {
                const std::size_t near = index(pixels.range.first[i]), far = index(pixels.range.second[i]);
                const double along = pixels.range.share[i], across = pixels.azimuth.share[i];
                const auto between = [&](std::int32_t azimuth) {
                    const std::size_t at = index(azimuth) * width;
                    return (1 - along) * cell_w(at + near, near) + along * cell_w(at + far, far);
                };
                watts[i] = (1 - across) * between(pixels.azimuth.first[i]) + across * between(pixels.azimuth.second[i]);
            }
            for (std::size_t i = 0; i < n; ++i) {
                const bool hole = painted && painted[i] < 0;
                if (!pixels.shown[i] && (!painted || hole)) continue;
                const double power_w = painted ? painted[i] : watts[i];
                const double slant_m =
                    ground_bins ? setting.earth.slant_range_m(setting.sensor_m, setting.reference_m, pixels.range_m[i])
                                : pixels.range_m[i];
                int grey = hole ? 0 : receiver.grey(power_w, slant_m);
                lit_here += grey > 0 ? 1 : 0;
                if (pixels.shown[i] && (lines || (scene.light && pixels.light[i]))) {
                    const double light = graticule.light(pixels.radius_m[i], pixels.azimuth_rad[i],
                                                         pixels.azimuth_position[i] * grid.azimuth_step_rad());
                    grey = std::min(255, grey + static_cast<int>(light + 0.5));
                }
                greys[i] = static_cast<std::uint8_t>(grey);
                if (pixels.shown[i])
                    states[i] = state_of[index(pixels.azimuth.nearest[i]) * width + index(pixels.range.nearest[i])];
            }
        }
        lit += lit_here;
    };
    oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::int64_t>(0, f.height, 8), [&](const auto& rows) {
        const auto pixels = std::make_unique<PixelRow>();
        if (stop) stop->check();
        for (std::int64_t row = rows.begin(); row < rows.end(); ++row) {
            if (received.plain())
                draw_row(
                    [cells = received.cells()](std::size_t at, std::size_t) { return static_cast<double>(cells[at]); },
                    row, *pixels);
            else
                draw_row([received](std::size_t at,
                                    std::size_t range) { return static_cast<double>(received.watts(at, range)); },
                         row, *pixels);
        }
    });
    result.lit = lit;
    return result;
}

}  // namespace wedgescope
