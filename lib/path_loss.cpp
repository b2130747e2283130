#include "lib/path_loss.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "lib/atmosphere.hpp"
#include "lib/error.hpp"
#include "lib/lanes.hpp"
#include "lib/rounding.hpp"
#include "lib/sensor.hpp"

namespace wedgescope {
namespace {

// Abramowitz & Stegun, table 25.4, n = 16: the positive abscissas on [-1, 1] and their weights.
constexpr std::array<double, 8> gauss16_x{0.095012509837637440185, 0.281603550779258913230, 0.458016777657227386342,
                                          0.617876244402643748447, 0.755404408355003033895, 0.865631202387831743880,
                                          0.944575023073232576078, 0.989400934991649932596};
constexpr std::array<double, 8> gauss16_w{0.189450610455068496285, 0.182603415044923588867, 0.169156519395002538189,
                                          0.149595988816576732081, 0.124628971255533872052, 0.095158511682492784810,
                                          0.062253523938647892863, 0.027152459411754094852};

/// The integral of f over [a, b], 16 points on each of `panels` equal parts.
template <class F>
double integral(double a, double b, int panels, const F& f) {
    double sum = 0;
    const double half = 0.5 * (b - a) / panels;
    for (int p = 0; p < panels; ++p) {
        const double middle = a + (2 * p + 1) * half;
        for (std::size_t i = 0; i < gauss16_x.size(); ++i)
            sum += gauss16_w[i] * (f(middle - half * gauss16_x[i]) + f(middle + half * gauss16_x[i]));
    }
    return sum * half;
}

constexpr double octaves_per_db = 0.33219280948873623479;  // log2(10) / 10
/// Factors of 2 a metre, both ways, of dB a kilometre one way.
constexpr double octaves_m_of_db_km = 2e-3 * octaves_per_db;

/// Geopotential heights at which the reference atmosphere changes its law.
constexpr std::array<double, 4> air_changes_m{11e3, 20e3, 32e3, 47e3};

/// Height gained over the sensor where (Re + h)^2 - (Re + hs)^2 = Re u.
double height_gain_m(double u, double scale, double inverse_radius) {
    return u / (std::sqrt(std::max(0.0, scale * scale + inverse_radius * u)) + scale);
}

/// The inverse: u of a height.
double u_of_height(double sensor_m, double height_m, double inverse_radius) {
    return (height_m - sensor_m) * (2 + inverse_radius * (sensor_m + height_m));
}

/// Length of the ray below a height, without calls of libm but sqrt. `above_sensor`: that height is higher than the
/// sensor, which then is below it from the start.
template <bool above_sensor, class Real>
WEDGESCOPE_LANES_PART Real length_below(Real range, Real sine, Real c, Real sensor, Real height) noexcept {
    // Roots of c t^2 + 2 S t sin e - d = 0, each in the form that does not cancel and knows the plane.
    const Real d = (height - sensor) * (2 + c * (sensor + height)), p = (1 + sensor * c) * sine, square = p * p + c * d,
               q = std::sqrt(square > 0 ? square : Real{0});
    if constexpr (above_sensor) {
        const Real out = d / (p + q);  // infinite where the plane's ray goes down
        return out < range ? out : range;
    } else {
        const Real in = d / (p - q), out = (q - p) / c, end = out < range ? out : range, inside = end - in;
        // One selection after the other: so they run in lanes everywhere.
        const Real some = inside > 0 ? inside : Real{0}, crossed = square > 0 ? some : Real{0};
        return sine < 0 ? crossed : Real{0};
    }
}

void require_way(double sensor_m, double range_m) {
    require_within("sensor height", sensor_m, lowest_air_m, 1e6, "m");
    require_above("range", range_m, 0, "m");
}

}  // namespace

void validate(const WeatherParams& weather, double frequency_hz) {
    if (weather.vapour_g_m3) {
        require_within("humidity", *weather.vapour_g_m3, 0, most_vapour_g_m3, "g/m^3");
        require_within("frequency with gases", frequency_hz / 1e9, 1, 1000, "GHz");
    }
    require_within("rain", weather.rain_mm_h, 0, most_rain_mm_h, "mm/h");
    require_within("rain-top", weather.rain_top_m, lowest_air_m, 20e3, "m");
    require_within("polarisation tilt", weather.tilt.deg(), -90, 90, "deg");
    if (weather.rain_mm_h > 0) require_within("frequency with rain", frequency_hz / 1e9, 1, 1000, "GHz");
    require_within("liquid-water", weather.liquid_water_g_m3, 0, 10, "g/m^3");
    if (weather.liquid_water_g_m3 > 0) {
        require_within("cloud-base", weather.cloud_base_m, lowest_air_m, 20e3, "m");
        if (!(weather.cloud_top_m > weather.cloud_base_m && weather.cloud_top_m <= 20e3))
            throw InputError(text("cloud-top is ", weather.cloud_top_m, " m; it must be above cloud-base, which is ",
                                  weather.cloud_base_m, " m, and at most 20000 m"));
        require_within("frequency with cloud", frequency_hz / 1e9, 1, 200, "GHz");
    }
}

GasProfile::GasProfile(double frequency_hz, double vapour_g_m3) {
    const auto exact = [&](double height_m) {
        return gas_attenuation(frequency_hz, standard_air(height_m, vapour_g_m3)).db_km();
    };
    // Where vapour reaches its least mixing ratio its fall has a bend: the exponential falls faster than the pressure.
    const auto above_least = [&](double height_m) {
        return standard_air(height_m, vapour_g_m3).vapour_g_m3 > 1.0000001 * standard_air(height_m, 0).vapour_g_m3;
    };
    std::vector<double> edges{lowest_air_m};
    for (const double change : air_changes_m) edges.push_back(geometric_height_m(change));
    edges.push_back(top_m);
    if (above_least(edges.front())) {
        double low = edges.front(), high = top_m;
        while (high - low > 1) (above_least(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
        const double bend = std::nearbyint(low);
        const auto above = std::upper_bound(edges.begin(), edges.end(), bend);
        if (above != edges.end() && *above - bend > 10 && bend - above[-1] > 10) edges.insert(above, bend);
    }
    for (std::size_t e = 1; e < edges.size(); ++e) {
        const double length = edges[e] - edges[e - 1], wanted_step = edges[e] < 12e3   ? 200
                                                                     : edges[e] < 48e3 ? 400
                                                                                       : 1000;
        const auto intervals = static_cast<std::size_t>(std::max(3.0, std::ceil(length / wanted_step)));
        const double step = length / static_cast<double>(intervals);
        layers_.push_back({edges[e - 1], edges[e], 1 / step, values_.size(), intervals});
        for (std::size_t i = 0; i <= intervals; ++i)
            values_.push_back(static_cast<float>(exact(edges[e - 1] + static_cast<double>(i) * step)));
    }
    // What is thinner than a hundredth of the densest part does not count in any sum.
    const double least = 1e-2 * static_cast<double>(*std::max_element(values_.begin(), values_.end()));
    for (const Layer& layer : layers_)
        for (std::size_t i = 0; i < layer.intervals; ++i) {
            const double height = layer.bottom_m + (static_cast<double>(i) + 0.5) / layer.per_metre,
                         truth = exact(height);
            error_ = std::max(error_, std::abs(db_km(height) - truth) / std::max(truth, least));
        }
}

std::vector<double> GasProfile::bends_m() const {
    std::vector<double> bends;
    for (const Layer& layer : layers_) bends.push_back(layer.top_m);
    return bends;
}

double GasProfile::db_km(double height_m) const noexcept {
    if (height_m > top_m) return 0;
    const Layer* layer = layers_.data();
    while (height_m > layer->top_m) ++layer;
    const double x = std::max(0.0, (height_m - layer->bottom_m) * layer->per_metre);
    // The cubic through the two entries on either side, or the nearest four of the layer.
    const auto own = static_cast<std::size_t>(x);
    const std::size_t begin = std::min(own > 0 ? own - 1 : 0, layer->intervals - 3);
    const float* const y = values_.data() + layer->first + begin;
    const double y0 = static_cast<double>(y[0]), y1 = static_cast<double>(y[1]), y2 = static_cast<double>(y[2]),
                 y3 = static_cast<double>(y[3]), t = x - static_cast<double>(begin);
    const double first = y1 - y0, second = y2 - 2 * y1 + y0, third = y3 - 3 * (y2 - y1) - y0;
    const double value = y0 + t * (first + 0.5 * (t - 1) * (second + (t - 2) * (1.0 / 3) * third));
    return value > 0 ? value : 0;
}

Weather::Weather(const WeatherParams& params, double frequency_hz) : params_(params), frequency_hz_(frequency_hz) {
    validate(params, frequency_hz);
    if (params.vapour_g_m3) gases_ = std::make_shared<const GasProfile>(frequency_hz, *params.vapour_g_m3);
    if (params.liquid_water_g_m3 > 0) {
        const Air middle = standard_air(0.5 * (params.cloud_base_m + params.cloud_top_m), normal_vapour_g_m3);
        cloud_db_km_ = cloud_attenuation_db_km(frequency_hz, middle.temperature_k) * params.liquid_water_g_m3;
    }
    if (params.rain_mm_h == 0) return;
    // gamma depends on the elevation by cos^2 = 1 - z alone: the cubic in z = sin^2 through Chebyshev's four points, by
    // divided differences.
    std::array<double, 4> z{}, d{};
    for (std::size_t i = 0; i < 4; ++i) {
        constexpr std::array<double, 4> cosines{0.92387953251128674, 0.38268343236508977, -0.38268343236508977,
                                                -0.92387953251128674};
        z[i] = 0.5 + 0.5 * cosines[i];
        d[i] = rain_db_km(std::sqrt(z[i]));
    }
    for (std::size_t order = 1; order < 4; ++order)
        for (std::size_t i = 3; i >= order; --i) d[i] = (d[i] - d[i - 1]) / (z[i] - z[i - order]);
    // d0 + (x - z0) (d1 + (x - z1) (d2 + (x - z2) d3)) by powers of x.
    std::array<double, 4> power{d[3], 0, 0, 0};
    for (std::size_t step = 3; step-- > 0;) {
        for (std::size_t i = 3; i > 0; --i) power[i] = power[i - 1] - z[step] * power[i];
        power[0] = d[step] - z[step] * power[0];
    }
    for (std::size_t i = 0; i < 4; ++i) rain_cubic_[i] = static_cast<float>(power[i]);
    for (int i = 0; i <= 64; ++i) {
        const double x = i / 64.0, truth = rain_db_km(std::sqrt(x));
        double cubic = 0;
        for (std::size_t k = 4; k-- > 0;) cubic = cubic * x + static_cast<double>(rain_cubic_[k]);
        rain_cubic_error_ = std::max(rain_cubic_error_, std::abs(cubic / truth - 1));
    }
}

double Weather::rain_db_km(double sine) const {
    if (params_.rain_mm_h == 0) return 0;
    return rain_attenuation_db_km(frequency_hz_, params_.rain_mm_h, Angle::radians(std::asin(sine)), params_.tilt);
}

double length_below_m(const Earth& earth, double sensor_m, double range_m, double sine, double height_m) {
    const double c = earth.inverse_radius();
    return height_m > sensor_m ? length_below<true>(range_m, sine, c, sensor_m, height_m)
                               : length_below<false>(range_m, sine, c, sensor_m, height_m);
}

PathLoss path_loss(const Weather& weather, const Earth& earth, double sensor_m, double range_m, double sine,
                   int panels) {
    require_way(sensor_m, range_m);
    require_within("sine of the elevation", sine, -1, 1, "");
    const WeatherParams& params = weather.params();
    const double c = earth.inverse_radius(), scale = 1 + sensor_m * c;
    PathLoss loss;
    if (params.vapour_g_m3) {
        const auto gamma = [&](double t) {
            const double height = sensor_m + height_gain_m(t * (t * c + 2 * scale * sine), scale, c);
            return gas_attenuation(weather.frequency_hz(), standard_air(std::min(height, 1e6), *params.vapour_g_m3))
                .db_km();
        };
        std::vector<double> cuts{0, range_m};
        const auto cut_at = [&](double height_m) {
            const double d = u_of_height(sensor_m, height_m, c), p = scale * sine, square = p * p + c * d;
            if (!(square >= 0)) return;
            const double q = p < 0 ? p - std::sqrt(square) : p + std::sqrt(square);  // the sum that does not cancel
            for (const double t : {d / q, -q / c})
                if (t > 0 && t < range_m) cuts.push_back(t);
        };
        for (const double change : air_changes_m) cut_at(geometric_height_m(change));
        cut_at(GasProfile::top_m);
        cut_at(lowest_air_m);
        std::sort(cuts.begin(), cuts.end());
        for (std::size_t i = 1; i < cuts.size(); ++i) {
            const double length = cuts[i] - cuts[i - 1];
            // 16 points follow several scale heights (2 km for vapour) to 1e-12; sag over 100 km is 150 m.
            const int parts =
                panels > 0 ? panels
                           : 1 + static_cast<int>(std::min(length / 100e3 + length * std::abs(sine) / 4e3, 200.0));
            if (length > 0) loss.gases_db += 2e-3 * integral(cuts[i - 1], cuts[i], parts, gamma);
        }
    }
    const auto below = [&](double height_m) { return length_below_m(earth, sensor_m, range_m, sine, height_m); };
    if (params.rain_mm_h > 0) loss.rain_db = 2e-3 * weather.rain_db_km(sine) * below(params.rain_top_m);
    if (params.liquid_water_g_m3 > 0)
        loss.cloud_db = 2e-3 * weather.cloud_db_km() * (below(params.cloud_top_m) - below(params.cloud_base_m));
    return loss;
}

PathLossTable::PathLossTable(const Weather& weather, const PathLossRays& rays) : sensor_m_(rays.sensor_m) {
    require_way(rays.sensor_m, rays.most_range_m);
    require_within("highest point", rays.highest_m, lowest_air_m, 100e3, "m");
    if (!(rays.lowest_m < rays.highest_m))
        throw InputError(
            text("lowest point is ", rays.lowest_m, " m; it must be below the highest, ", rays.highest_m, " m"));
    half_scale_ = 0.5 / (1 + rays.sensor_m * rays.earth.inverse_radius());
    clear_ = weather.clear();
    if (clear_) return;

    // Rounded once more here and there, in double: nothing. Floats that enter: 6e-8 each.
    double relative = 3e-7;
    const WeatherParams& params = weather.params();
    has_rain_ = params.rain_mm_h > 0;
    has_cloud_ = params.liquid_water_g_m3 > 0;
    if (has_rain_) {
        rain_top_m_ = params.rain_top_m;
        for (std::size_t i = 0; i < 4; ++i)
            rain_[i] = octaves_m_of_db_km * static_cast<double>(weather.rain_cubic()[i]);
        relative += weather.rain_cubic_error();
    }
    if (has_cloud_) {
        const double octaves = octaves_m_of_db_km * rounded_significand(weather.cloud_db_km(), 24);
        cloud_ = {Boundary{params.cloud_top_m, octaves}, Boundary{params.cloud_base_m, -octaves}};
    }
    const GasProfile* const profile = weather.gases();
    if (profile) relative += profile->error();
    error_db_ = 100 * relative;
    if (profile) tabulate(*profile, rays);
}

void PathLossTable::tabulate(const GasProfile& profile, const PathLossRays& rays) {
    has_gases_ = true;
    const double c = rays.earth.inverse_radius(), scale = 1 + rays.sensor_m * c;
    // The mean of gamma over the way, dB/km one way: with x = t / r, u = s x^2 + (2 S v - s) x.
    const std::vector<double> bends = profile.bends_m();
    const auto mean = [&](double sag, double rise, int finer) {
        const double b = 2 * scale * rise - sag;
        const auto height = [&](double x) { return rays.sensor_m + height_gain_m(x * (sag * x + b), scale, c); };
        double sum = 0, begin = 0;
        const auto add_to = [&](double end) {
            const double part = end - begin, change = std::abs(height(end) - height(begin)) + sag * part * part / 8;
            const int panels = finer * (1 + static_cast<int>(std::min(change / 8000, 100.0)));
            sum += integral(begin, end, panels, [&](double x) { return profile.db_km(height(x)); });
            begin = end;
        };
        // On its way down from above, from bend to bend of gamma; nothing above the air.
        for (auto bend = bends.rbegin(); bend != bends.rend(); ++bend) {
            if (*bend >= rays.sensor_m) continue;
            const double d = u_of_height(rays.sensor_m, *bend, c), square = b * b + 4 * sag * d;
            const double x = square > 0 && b < 0 ? -2 * d / (std::sqrt(square) - b) : 1;
            if (!(x > begin)) continue;
            if (*bend == GasProfile::top_m)
                begin = std::min(x, 1.0);
            else
                add_to(std::min(x, 1.0));
        }
        if (begin < 1) add_to(1);
        return sum;
    };

    const auto rise_of = [&](double height_m) { return half_scale_ * u_of_height(rays.sensor_m, height_m, c); };
    rise0_m_ = rise_of(rays.lowest_m);
    const double rises_m = rise_of(rays.highest_m) - rise0_m_;
    // No ray that is above the lowest point all the way is longer than the tangents to it from both ends.
    double longest = rays.most_range_m;
    if (c > 0) {
        const auto tangent = [&](double height_m) {
            return std::sqrt(std::max(0.0, u_of_height(rays.lowest_m, height_m, c) / c));
        };
        longest = std::min(longest, tangent(rays.sensor_m) + tangent(rays.highest_m));
    }
    constexpr double other_radii = 1.01;
    const double sags_m = other_radii * c * longest * longest;

    double sag_step = 0, rise_step = 0;
    const auto fill = [&](int sags, int rises) {
        sags_ = sags, rises_ = rises;
        sag_step = sags_m / sags, rise_step = rises_m / rises;
        sags_per_m_ = sags_m > 0 ? 1 / sag_step : 0;
        rises_per_m_ = 1 / rise_step;
        gases_.clear();
        for (int j = 0; j <= sags; ++j)
            for (int i = 0; i <= rises; ++i)
                gases_.push_back(
                    static_cast<float>(octaves_m_of_db_km * mean(j * sag_step, rise0_m_ + i * rise_step, 1)));
    };
    /// Largest error at the middles of cells' edges or of cells: half a step off along the sag, the rise, or both.
    /// The function is smooth, so some thirty cells each way show it.
    const auto error = [&](double sag_part, double rise_part) {
        double most = 0;
        const auto next = [](int i, int count) { return std::max(i + 1, std::min(i + 1 + count / 32, count - 1)); };
        for (int j = 0; j < sags_; j = next(j, sags_))
            for (int i = 0; i < rises_; i = next(i, rises_)) {
                const double sag = (j + sag_part) * sag_step, rise = rise0_m_ + (i + rise_part) * rise_step;
                const double range = c > 0 ? std::min(longest, std::sqrt((j + 1) * sag_step / c)) : longest;
                // No ray goes farther down than its length, nor (a cell's width aside) below the lowest ground.
                const double b = 2 * scale * rise - sag;
                const double deepest = sag > 0 && b < 0 && -b < 2 * sag ? -b * b / (4 * sag) : 0;
                if (rise < -range - rise_step || rise > range + rise_step ||
                    rays.sensor_m + height_gain_m(deepest, scale, c) < rays.lowest_m - 100)
                    continue;
                const float* const at = gases_.data() +
                                        static_cast<std::size_t>(j) * (static_cast<std::size_t>(rises_) + 1) +
                                        static_cast<std::size_t>(i);
                const auto value = [&](int dj, int di) { return static_cast<double>(at[dj * (rises_ + 1) + di]); };
                const double near = value(0, 0) + rise_part * (value(0, 1) - value(0, 0)),
                             far = value(1, 0) + rise_part * (value(1, 1) - value(1, 0));
                const double truth = 2e-3 * range * mean(sag, rise, 2),
                             table = range * (near + sag_part * (far - near)) / octaves_per_db;
                most = std::max(most, std::abs(table - truth) / std::max(1.0, truth / 100));
            }
        return most;
    };
    // Steps from what a coarse table shows: an error of linear steps goes with their square.
    constexpr double slack = 1.1;
    // The other errors come from libm: few of their digits, so that its last bits never choose the steps.
    const double wanted_db = std::max(0.001, (0.0049 - rounded_significand(error_db_, 8)) / slack);
    constexpr int most_sags = 1024, most_rises = 4096;
    const auto finer = [](int count, double by, int most) {
        return static_cast<int>(
            std::clamp(std::ceil(count * by), static_cast<double>(count), static_cast<double>(most)));
    };
    fill(sags_m > 0 ? 6 : 1, 24);
    int sags = finer(sags_, sags_m > 0 ? std::sqrt(error(0.5, 0) / (0.5 * wanted_db)) : 1, most_sags),
        rises = finer(rises_, std::sqrt(error(0, 0.5) / (0.5 * wanted_db)), most_rises);
    for (double before = std::numeric_limits<double>::infinity();;) {
        fill(sags, rises);
        const double found = error(0.5, 0.5);
        // Or where finer steps no longer help.
        if (found <= wanted_db || found > 0.8 * before || (sags == most_sags && rises == most_rises)) {
            error_db_ += slack * found;
            return;
        }
        before = found;
        const double by = 1.05 * std::sqrt(found / wanted_db);
        if (sags_m > 0) sags = finer(sags, by, most_sags);
        rises = finer(rises, by, most_rises);
    }
}

/// In floats: six digits of a loss are far below what the table promises.
struct PathLossLanes {
    static constexpr std::size_t block = 64;

    static WEDGESCOPE_LANES_PART void factors(std::size_t n, const double* range_m, const double* sines,
                                              const double* inverse_radius, const PathLossTable& table,
                                              double* factor) noexcept {
        const auto sensor = static_cast<float>(table.sensor_m_);
        float range[block], sine[block], inverse[block], octaves[block];
        for (std::size_t at = 0; at < n; at += block) {
            const std::size_t m = std::min(block, n - at);
            WEDGESCOPE_INDEPENDENT
            for (std::size_t i = 0; i < m; ++i) {
                range[i] = static_cast<float>(range_m[at + i]);
                sine[i] = static_cast<float>(sines[at + i]);
                inverse[i] = static_cast<float>(inverse_radius[at + i]);
                octaves[i] = 0;
            }
            if (table.has_gases_) gases(m, range, sine, inverse, table, octaves);
            if (table.has_rain_) {
                const auto part = [&](std::size_t k) { return static_cast<float>(table.rain_[k]); };
                const float r0 = part(0), r1 = part(1), r2 = part(2), r3 = part(3);
                const auto rate = [=](float z) { return r0 + z * (r1 + z * (r2 + z * r3)); };
                below(m, range, sine, inverse, sensor, static_cast<float>(table.rain_top_m_), rate, octaves);
            }
            if (table.has_cloud_)
                for (const PathLossTable::Boundary& boundary : table.cloud_) {
                    const auto weight = static_cast<float>(boundary.octaves_per_m);
                    below(
                        m, range, sine, inverse, sensor, static_cast<float>(boundary.height_m),
                        [=](float) { return weight; }, octaves);
                }
            half_to_the(m, octaves, factor + at);
        }
    }

private:
    static WEDGESCOPE_LANES_PART void gases(std::size_t m, const float* __restrict range, const float* __restrict sine,
                                            const float* __restrict inverse, const PathLossTable& table,
                                            float* __restrict octaves) noexcept {
        float sag_part[block], rise_part[block];
        std::int32_t index[block];
        float pairs[4 * block];
        const auto half_scale = static_cast<float>(table.half_scale_),
                   sags_per_m = static_cast<float>(table.sags_per_m_),
                   rises_per_m = static_cast<float>(table.rises_per_m_), rise0 = static_cast<float>(table.rise0_m_);
        const std::int32_t sags = table.sags_, rises = table.rises_, stride = rises + 1;
        const auto most_sag = static_cast<float>(sags), most_rise = static_cast<float>(rises);
        const float* __restrict entries = table.gases_.data();
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            const float sag = range[i] * range[i] * inverse[i], rise = range[i] * sine[i] + sag * half_scale;
            float x = sag * sags_per_m, y = (rise - rise0) * rises_per_m;
            x = x > 0 ? x : 0.0F;
            x = x < most_sag ? x : most_sag;
            y = y > 0 ? y : 0.0F;
            y = y < most_rise ? y : most_rise;
            auto j = static_cast<std::int32_t>(x), k = static_cast<std::int32_t>(y);
            j = j < sags ? j : sags - 1;
            k = k < rises ? k : rises - 1;
            index[i] = j * stride + k;
            sag_part[i] = x - static_cast<float>(j);
            rise_part[i] = y - static_cast<float>(k);
        }
        for (std::size_t i = 0; i < m; ++i) {
            std::memcpy(pairs + 2 * i, entries + index[i], 2 * sizeof(float));
            std::memcpy(pairs + 2 * (block + i), entries + index[i] + stride, 2 * sizeof(float));
        }
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            const float a = pairs[2 * i], b = pairs[2 * i + 1], c = pairs[2 * (block + i)],
                        d = pairs[2 * (block + i) + 1];
            const float near = a + rise_part[i] * (b - a), far = c + rise_part[i] * (d - c);
            octaves[i] += range[i] * (near + sag_part[i] * (far - near));
        }
    }

    template <class Rate>
    static WEDGESCOPE_LANES_PART void below(std::size_t m, const float* __restrict range, const float* __restrict sine,
                                            const float* __restrict inverse, float sensor, float height,
                                            const Rate& rate, float* __restrict octaves) noexcept {
        if (height > sensor) {
            WEDGESCOPE_INDEPENDENT
            for (std::size_t i = 0; i < m; ++i)
                octaves[i] +=
                    rate(sine[i] * sine[i]) * length_below<true>(range[i], sine[i], inverse[i], sensor, height);
        } else {
            WEDGESCOPE_INDEPENDENT
            for (std::size_t i = 0; i < m; ++i)
                octaves[i] +=
                    rate(sine[i] * sine[i]) * length_below<false>(range[i], sine[i], inverse[i], sensor, height);
        }
    }

    /// 2^-octaves, 0 to 1000 of them, to 2e-7 of itself (a whole number more of octaves: 6e-8 of that more): 1 for 0.
    static WEDGESCOPE_LANES_PART void half_to_the(std::size_t m, const float* __restrict octaves,
                                                  double* __restrict factor) noexcept {
        // Adding this leaves the nearest whole number in the last bits.
        constexpr float whole = 12582912;  // 1.5 2^23
        // ln(2)^k / k!
        constexpr float c1 = 0.693147181F, c2 = 0.240226507F, c3 = 0.0555041087F, c4 = 0.00961812911F,
                        c5 = 0.00133335581F, c6 = 0.000154035304F;
        WEDGESCOPE_INDEPENDENT
        for (std::size_t i = 0; i < m; ++i) {
            float x = octaves[i] > 0 ? octaves[i] : 0.0F;
            x = x < 1000 ? -x : -1000.0F;
            const float shifted = x + whole, f = x - (shifted - whole);
            const float series = 1 + f * (c1 + f * (c2 + f * (c3 + f * (c4 + f * (c5 + f * c6)))));
            const std::int64_t power = std::bit_cast<std::int32_t>(shifted) - std::bit_cast<std::int32_t>(whole);
            factor[i] = static_cast<double>(series) * std::bit_cast<double>((power + 1023) << 52);
        }
    }
};

void factor_lanes(std::size_t n, const double* range_m, const double* sine, const double* inverse_radius,
                  const PathLossTable& table, double* factor) noexcept {
    if (table.clear())
        std::fill_n(factor, n, 1.0);
    else
        on_target<PathLossLanes::factors>(n, range_m, sine, inverse_radius, table, factor);
}

double PathLossTable::factor(double range_m, double sine, double inverse_radius) const noexcept {
    double factor = 1;
    if (!clear_) PathLossLanes::factors(1, &range_m, &sine, &inverse_radius, *this, &factor);
    return factor;
}

double PathLossTable::loss_db(double range_m, double sine, double inverse_radius) const noexcept {
    return 0 - 10 * std::log10(factor(range_m, sine, inverse_radius));
}

}  // namespace wedgescope
