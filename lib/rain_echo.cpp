#include "lib/rain_echo.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "lib/rounding.hpp"

namespace wedgescope {
namespace {

// Gauss-Legendre, 8 points: the positive abscissas on [-1, 1] and their weights (Abramowitz & Stegun, table 25.4).
constexpr std::array<double, 4> gauss8_x{0.183434642495649805, 0.525532409916328986, 0.796666477413626740,
                                         0.960289856497536232};
constexpr std::array<double, 4> gauss8_w{0.362683783378361983, 0.313706645877887287, 0.222381034453374471,
                                         0.101228536290376259};

/// Sines of elevation, ascending, at which the elevation pattern changes its course: what a panel of the quadrature must not hide.
struct PatternSines {
    std::vector<double> always;
    std::vector<double> points;  ///< of a pattern of points

    explicit PatternSines(const AntennaParams& antenna) {
        const double nose = antenna.knee.rad() + antenna.tilt.rad(), width = antenna.width.rad(),
                     knee = antenna.knee.rad();
        const auto add = [](std::vector<double>& sines, double depression) {
            if (std::abs(depression) < 0.5 * std::numbers::pi)
                sines.push_back(-rounded_significand(std::sin(depression), 24));
        };
        always = {-0.5 * std::numbers::sqrt3, 0.5 * std::numbers::sqrt3};  // where the widening ends
        if (antenna.elevation == ElevationPattern::points) {
            for (const PatternPoint& point : antenna.points) add(points, point.depression.rad() + antenna.tilt.rad());
        } else {
            for (const double widths : {0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.25}) {
                add(always, nose - widths * width);
                if (antenna.elevation == ElevationPattern::gaussian) add(always, nose + widths * width);
            }
            if (antenna.elevation != ElevationPattern::gaussian)  // csc^2 falls with the ratio to the knee
                for (double beta = 1.5 * knee; beta < std::numbers::pi; beta *= 1.5)
                    add(always, beta + antenna.tilt.rad());
        }
        std::sort(always.begin(), always.end());
        std::sort(points.begin(), points.end());
    }

    /// Those between two sines. Of many points some, as the pattern runs so nearly straight over several of them that a panel of the
    /// many will do; the first and the last always, as beyond them it may drop to the floor.
    void put_between(double low, double high, std::vector<double>& into) const {
        constexpr std::ptrdiff_t most_points = 256;
        const auto inside = [&](const std::vector<double>& sines) {
            const auto first = std::upper_bound(sines.begin(), sines.end(), low);
            return std::pair(first, std::lower_bound(first, sines.end(), high));
        };
        const auto [always_first, always_last] = inside(always);
        into.insert(into.end(), always_first, always_last);
        const auto [first, last] = inside(points);
        const std::ptrdiff_t n = last - first, step = 1 + n / most_points;
        for (std::ptrdiff_t i = 0; i < n; i += step) into.push_back(first[i]);
        if (n > 1 && (n - 1) % step != 0) into.push_back(first[n - 1]);
    }
};

/// Between which sines of elevation a range is wet.
struct Wet {
    const RainEchoParams& params;
    double top_m;

    struct Sines {
        double low, high;
    };
    Sines at(double range_m) const {
        const double c = params.earth.inverse_radius(), sensor_m = params.sensor_m, scale = 1 + sensor_m * c,
                     floor_m = floor_at(range_m);
        const auto u_of = [&](double height_m) { return (height_m - sensor_m) * (2 + c * (sensor_m + height_m)); };
        const auto sine = [&](double height_m) {
            return std::clamp((u_of(height_m) - c * range_m * range_m) / (2 * scale * range_m), -1.0, 1.0);
        };
        Sines wet{sine(floor_m), sine(top_m)};
        if (!params.floor.empty()) return wet;
        // Beyond the tangent to the level surface below, what is under it is hidden.
        if (const double d = -c * u_of(floor_m); d > 0)
            if (const double tangent = std::sqrt(d); c * range_m > tangent) wet.low = std::max(-tangent / scale, -1.0);
        return wet;
    }

private:
    double floor_at(double range_m) const {
        const std::vector<RainFloor>& floor = params.floor;
        if (floor.empty()) return params.reference_m;
        const auto after = std::upper_bound(floor.begin(), floor.end(), range_m,
                                            [](double r, const RainFloor& knot) { return r < knot.range_m; });
        if (after == floor.begin()) return after->height_m;
        if (after == floor.end()) return floor.back().height_m;
        const RainFloor& before = *(after - 1);
        return before.height_m +
               (after->height_m - before.height_m) * (range_m - before.range_m) / (after->range_m - before.range_m);
    }
};

constexpr double widest_panel = 0.1;  // of the sine
constexpr double least_cosine = 0.5;  // as the beam's

}  // namespace

double lowest_rain_m(const std::vector<RainFloor>& floor, double reference_m) {
    const auto lower = [](const RainFloor& a, const RainFloor& b) { return a.height_m < b.height_m; };
    return floor.empty() ? reference_m : std::min_element(floor.begin(), floor.end(), lower)->height_m;
}

RainEcho::RainEcho(const Weather& weather, const PathLossTable& loss, const PatternTable& pattern,
                   const RainEchoParams& params) {
    validate(params.radar);
    require_within("sensor height", params.sensor_m, -1000, 1e6, "m");
    require_within("reference height", params.reference_m, -1e5, 1e5, "m");
    require_above("range", params.most_range_m, 0, "m");
    const WeatherParams& rain = weather.params();
    const double pulse_m = params.radar.pulse_extent_m();
    if (rain.rain_mm_h == 0 || rain.rain_top_m <= lowest_rain_m(params.floor, params.reference_m) ||
        params.most_range_m <= pulse_m)
        return;

    double constant =
        radar_constant(params.radar) * rain_cross_section_per_m(params.radar.frequency_hz, rain.rain_mm_h);
    if (params.radar.polarisation == Polarisation::circular) constant /= rain_cancellation(rain.rain_mm_h).ratio();
    constant = rounded_significand(constant, 24);  // libm's last bits stay out

    // Knots close enough for what falls with range and by attenuation: at most a 128th of the range and 50 m apart, so that
    // the linear course between them is right to 2e-5, and to 0.5 % where rain takes 18 dB a kilometre. Where it bends, as the wet
    // rays first meet the top of the rain or the ground below, it may begin from nothing: from there on ever wider, so that it
    // is right to 0.5 % of itself. Coarser where the largest range is beyond what pays: never more than 20000 of them.
    constexpr double by = 1.0 / 128, widest_m = 50;
    const double most_step = std::max(widest_m, params.most_range_m / 16000);
    for (double range = pulse_m; range < params.most_range_m; range += std::min(by * range, most_step))
        range_m_.push_back(range);
    range_m_.push_back(params.most_range_m);
    for (const double height_m :
         {params.floor.empty() ? params.reference_m : params.floor.front().height_m, rain.rain_top_m})
        for (const double beyond : {0.0, 1.0 / 64, 1.0 / 16, 1.0 / 4}) {
            const double bend = std::abs(params.sensor_m - height_m) * (1 + by * beyond);
            if (!(bend > pulse_m && bend < params.most_range_m)) continue;
            if (const auto at = std::lower_bound(range_m_.begin(), range_m_.end(), bend); *at != bend)
                range_m_.insert(at, bend);
        }

    const PatternSines cuts(params.radar.antenna);
    const Wet wet{params, rain.rain_top_m};
    const double c = params.earth.inverse_radius();
    const double rain_nepers_m = 2e-3 * 0.23026 * rounded_significand(weather.rain_db_km(0), 24);
    std::vector<double> edges, sines, weights, ranges, inverse, factors;
    for (const double range : range_m_) {
        const Wet::Sines sector = wet.at(range);
        edges.clear(), sines.clear(), weights.clear();
        if (sector.low < sector.high) {
            edges.push_back(sector.low);
            cuts.put_between(sector.low, sector.high, edges);
            // From above, the rain that the lowest rays pass through may be many times what a ray near the top does: the
            // echo then comes from the top of the sector, and panels halve towards it until each holds a neper or so.
            double nepers =
                params.sensor_m > rain.rain_top_m
                    ? rain_nepers_m * length_below_m(params.earth, params.sensor_m, range, sector.low, rain.rain_top_m)
                    : 0;
            for (double part = 0.5; nepers > 2 && part > 1e-4; part *= 0.5, nepers *= 0.5)
                edges.push_back(sector.high - part * (sector.high - sector.low));
            edges.push_back(sector.high);
            std::sort(edges.begin(), edges.end());
        }
        for (std::size_t e = 1; e < edges.size(); ++e) {
            const int panels = 1 + static_cast<int>((edges[e] - edges[e - 1]) / widest_panel);
            const double half = 0.5 * (edges[e] - edges[e - 1]) / panels;
            for (int p = 0; p < panels; ++p) {
                const double middle = edges[e - 1] + (2 * p + 1) * half;
                for (std::size_t i = 0; i < gauss8_x.size(); ++i)
                    for (const double sign : {-1.0, 1.0}) {
                        sines.push_back(middle + sign * half * gauss8_x[i]);
                        weights.push_back(half * gauss8_w[i]);
                    }
            }
        }
        ranges.assign(sines.size(), range);
        inverse.assign(sines.size(), c);
        factors.resize(sines.size());
        factor_lanes(sines.size(), ranges.data(), sines.data(), inverse.data(), loss, factors.data());
        double sum = 0;
        for (std::size_t i = 0; i < sines.size(); ++i) {
            const double cosine = std::sqrt(std::max(0.0, (1 - sines[i]) * (1 + sines[i])));
            sum += weights[i] * factors[i] * pattern.at(sines[i]) / std::max(cosine, least_cosine);
        }
        wet_w_m_rad_.push_back(constant * sum);
    }
}

double RainEcho::density_w_m_rad(double range_m) const {
    if (range_m_.empty() || !(range_m >= range_m_.front()) || range_m > range_m_.back()) return 0;
    const auto after = std::upper_bound(range_m_.begin() + 1, range_m_.end() - 1, range_m);
    const auto k = static_cast<std::size_t>(after - range_m_.begin()) - 1;
    const double part = (range_m - range_m_[k]) / (range_m_[k + 1] - range_m_[k]);
    return (wet_w_m_rad_[k] + part * (wet_w_m_rad_[k + 1] - wet_w_m_rad_[k])) / (range_m * range_m);
}

double RainEcho::between_w_rad(double near_m, double far_m) const {
    if (range_m_.empty()) return 0;
    double begin = std::max(near_m, range_m_.front());
    const double end = std::min(far_m, range_m_.back());
    double sum = 0;
    auto k =
        static_cast<std::size_t>(std::upper_bound(range_m_.begin() + 1, range_m_.end() - 1, begin) - range_m_.begin()) -
        1;
    for (; begin < end && k + 1 < range_m_.size(); ++k) {
        const double stop = std::min(end, range_m_[k + 1]);
        // p r^2 is linear between two knots: its middle value m times the integral of 1 / r^2, and its slope times that of
        // (r - m) / r^2, ln(stop / begin) - 2 q / (1 - q^2) with q = (stop - begin) / (stop + begin), to q^5.
        const double slope = (wet_w_m_rad_[k + 1] - wet_w_m_rad_[k]) / (range_m_[k + 1] - range_m_[k]);
        const double middle = wet_w_m_rad_[k] + slope * (0.5 * (begin + stop) - range_m_[k]);
        const double q = (stop - begin) / (stop + begin);
        sum += middle * (stop - begin) / (begin * stop) - slope * (4.0 / 3) * (q * q * q);
        begin = stop;
    }
    return sum;
}

std::vector<float> RainEcho::cells_w(std::span<const double> edges_m, double azimuth_step_rad) const {
    std::vector<float> cells(edges_m.empty() ? 0 : edges_m.size() - 1);
    for (std::size_t j = 0; j < cells.size(); ++j)
        cells[j] = static_cast<float>(azimuth_step_rad * between_w_rad(edges_m[j], edges_m[j + 1]));
    return cells;
}

}  // namespace wedgescope
