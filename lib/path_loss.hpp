// Path loss: what gases, rain, cloud and fog take from a wave on its way to the ground and back: the exact integral
// along the ray, and a table of it that costs a few lookups for a piece of ground.
// Leaves the media to atmosphere.hpp and rain.hpp and the rain's own echo to rain_echo.hpp.
//
// The ray is the straight one over the effective earth (physics "Effective earth"): at the distance t from a sensor
// at height hs, for elevation e at the sensor and c = 1 / Re,
//   h(t) = hs + u / (sqrt(S^2 + c u) + S)     u = c t^2 + 2 S t sin e     S = 1 + c hs
// Heights are above the sea-level surface, ranges slant ranges, losses in dB of both ways together.
#pragma once
#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "lib/angle.hpp"
#include "lib/earth.hpp"
#include "lib/rain.hpp"

namespace wedgescope {

/// What is between the radar and the ground; without anything set, nothing.
struct WeatherParams {
    std::optional<double>
        vapour_g_m3{};             ///< gases: water vapour at sea level, 0 to 100; none: no gases, no oxygen either
    double rain_mm_h = 0;          ///< 0 to 500, below the rain's top
    double rain_top_m = 3000;      ///< -1000 to 20000
    double liquid_water_g_m3 = 0;  ///< of cloud or fog, 0 to 10, from base to top
    double cloud_base_m = 0, cloud_top_m = 1000;  ///< -1000 to 20000, top above base where there is any water
    Angle tilt = horizontal_tilt;              ///< of the polarisation: 0 H, 90 V, 45 circular
};
/// InputError naming what was found and what is accepted; `frequency_hz` is checked against the ranges of what is on:
/// 1 GHz to 1000 GHz for gases and rain, to 200 GHz for cloud.
void validate(const WeatherParams& weather, double frequency_hz);

/// gamma(h) of the gases, dB/km one way, as cubics between heights; 0 above 100 km. Entries are rounded to float.
class GasProfile {
public:
    /// InputError as gas_attenuation and standard_air.
    GasProfile(double frequency_hz, double vapour_g_m3);
    /// Below lowest_air_m the air of lowest_air_m.
    double db_km(double height_m) const noexcept;
    /// Largest |db_km - exact| half-way between entries, found when it is built, relative to the exact value or to a hundredth
    /// of the largest of all heights, whichever is more.
    double error() const { return error_; }
    /// Heights, upwards, where gamma bends; the last is top_m.
    std::vector<double> bends_m() const;

    static constexpr double top_m = 100e3;

private:
    // Cubics never reach over the heights where the reference atmosphere changes its law.
    struct Layer {
        double bottom_m, top_m;
        double per_metre;
        std::size_t first, intervals;
    };
    std::vector<Layer> layers_;
    std::vector<float> values_;
    double error_ = 0;
};

/// Weather as a radar of one frequency feels it: what does not depend on where the radar is, made once for many scenes.
class Weather {
public:
    /// InputError as validate().
    Weather(const WeatherParams& params, double frequency_hz);

    const WeatherParams& params() const { return params_; }
    double frequency_hz() const { return frequency_hz_; }
    bool clear() const { return !gases_ && params_.rain_mm_h == 0 && params_.liquid_water_g_m3 == 0; }
    const GasProfile* gases() const { return gases_.get(); }

    /// k R^alpha of the rain for a ray of this elevation at the sensor, dB/km one way (taken for all of its way [P]).
    double rain_db_km(double sine) const;
    /// K_l M, with the temperature of the reference atmosphere half-way between base and top [P].
    double cloud_db_km() const { return cloud_db_km_; }
    /// The same rain as a cubic in sin^2, and how far that is from it, relative.
    const std::array<float, 4>& rain_cubic() const { return rain_cubic_; }
    double rain_cubic_error() const { return rain_cubic_error_; }

private:
    WeatherParams params_;
    double frequency_hz_;
    std::shared_ptr<const GasProfile> gases_;
    double cloud_db_km_ = 0;
    std::array<float, 4> rain_cubic_{};
    double rain_cubic_error_ = 0;
};

/// Length in metres of the ray from the sensor to `range_m` that runs below `height_m`: the closed form.
double length_below_m(const Earth& earth, double sensor_m, double range_m, double sine, double height_m);

struct PathLoss {
    double gases_db = 0, rain_db = 0, cloud_db = 0;
    double db() const { return gases_db + rain_db + cloud_db; }
};
/// Two-way loss to the point at slant range `range_m` (above 0) under an elevation of this sine at the sensor, exact:
/// gases by 16-point Gauss-Legendre line by line on `panels` equal parts of the way (0: as many as it takes, 1e-5 dB in 100),
/// cut where the reference atmosphere changes its law; layers by closed form. Slow (milliseconds).
/// InputError for a range that is not above 0 and finite, a sine outside [-1, 1], a sensor outside -1000 m to 1e6 m.
PathLoss path_loss(const Weather& weather, const Earth& earth, double sensor_m, double range_m, double sine,
                   int panels = 0);

/// Where the rays of a table go.
struct PathLossRays {
    Earth earth{};            ///< as of most rays; those of other azimuths may differ by 1 % in radius
    double sensor_m = 0;      ///< -1000 to 1e6
    double most_range_m = 0;  ///< above 0; beyond, the gases' mean of this range is taken
    double lowest_m = -500;   ///< of the points looked at; those below or above are taken to be there for the gases
    double highest_m = 9000;
};

/// The factor 1 / L_a by which power is less on both ways, by table. With r the range and e the elevation,
///   gases   2 r m(s, v)    s = c r^2    v = r sin e + s / (2 S)
/// where m, the mean of gamma over the way, is smooth in s and v down to r = 0: s / 8 is the sag of the ray, v nearly how far the point
/// lies above the sensor. So a small table linear in s and v does, for every azimuth's radius.
/// Rain and cloud are their length by closed form times a constant (a cubic in sin^2 e for the rain), so their edges are exact.
class PathLossTable {
public:
    /// InputError as path_loss, or unless lowest is below highest.
    PathLossTable(const Weather& weather, const PathLossRays& rays);

    /// Bounds |table - exact| in dB where the loss is at most 100 dB, and per 100 dB of loss above; from the largest
    /// difference at the middles of cells, found when it is built (0.005 wanted).
    double error_db() const { return error_db_; }
    std::size_t bytes() const { return gases_.size() * sizeof(float); }
    /// Nothing is lost anywhere: factors are all exactly 1.
    bool clear() const { return clear_; }

    /// Of one point; `inverse_radius` of its own azimuth. The bits of factor_lanes.
    double factor(double range_m, double sine, double inverse_radius) const noexcept;
    /// -10 log10 of it, for reports.
    double loss_db(double range_m, double sine, double inverse_radius) const noexcept;

private:
    friend struct PathLossLanes;
    struct Boundary {
        double height_m, octaves_per_m;  // for what is below; negative: takes away again
    };
    void tabulate(const GasProfile& profile, const PathLossRays& rays);

    bool clear_ = true, has_gases_ = false, has_rain_ = false, has_cloud_ = false;
    double sensor_m_ = 0;
    double half_scale_ = 0.5;  // 1 / (2 S)
    // Two-way mean of the gases in octaves (factors of 2) per metre, [sag][rise].
    std::vector<float> gases_;
    double sags_per_m_ = 0, rise0_m_ = 0, rises_per_m_ = 0;
    int sags_ = 0, rises_ = 0;      // intervals
    std::array<double, 4> rain_{};  // two-way octaves per metre below the rain's top, cubic in sin^2
    double rain_top_m_ = 0;
    std::array<Boundary, 2> cloud_{};
    double error_db_ = 0;
};

/// factor[i] = 1 / L_a of the points at range_m[i] (metres), sine[i], inverse_radius[i] (1/m), for n of them. What comes out for
/// numbers that are none means nothing. Never throws or allocates; + - * / sqrt only: the same bits everywhere.
void factor_lanes(std::size_t n, const double* range_m, const double* sine, const double* inverse_radius,
                  const PathLossTable& table, double* factor) noexcept;

}  // namespace wedgescope
