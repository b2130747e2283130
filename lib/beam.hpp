// Beam and pulse: echo image -> power image, the radar's own resolution (BWE and PLE).
// Leaves fluctuation (speckle, noise) to fluctuation.hpp and levels to receiver.hpp.
#pragma once
#include <functional>
#include <span>
#include <vector>

#include "lib/earth.hpp"
#include "lib/polar.hpp"
#include "lib/sensor.hpp"
#include "lib/stop.hpp"

namespace wedgescope {

/// What beam and pulse need of the scene.
struct BeamSetting {
    AntennaParams antenna;
    bool beam_width_error = true;
    bool pulse_length_error = true;
    double beam_width_scale = 1;    ///< the beam drawn so many times as wide, with the same total; BWE only
    double pulse_length_scale = 1;  ///< the pulse drawn so many times as long, with the same total; PLE only
    double pulse_extent_m = 0;      ///< c tau / 2
    double sensor_m = 0;            ///< height above sea level
    double reference_m = 0;         ///< level surface of d_j
    Earth earth;                    ///< K sqrt(MN), K R1 or the plane
    bool range_is_ground = false;   ///< gpi-true: range bins are arcs, the pulse lies on them as on level ground
};

/// Two-way power pattern g_az^2 at azimuth offset phi: peak 1, exactly 0 beyond 2.24 beamwidths (Gaussian)
/// or the fifth null (uniform aperture); and g_az, the one-way one. Source: physics "Antenna patterns".
double two_way_azimuth_pattern(const AntennaParams& antenna, double offset_rad);
double one_way_azimuth_pattern(const AntennaParams& antenna, double offset_rad);

/// Half-width of the skirt in azimuth bins that power in one bin can come from (with cos d at its least, 0.5);
/// 0 with BWE off. At most what fits once round the circle.
std::int64_t skirt_bins(const BeamSetting& setting, std::int64_t circle_bins);
/// Range bins in front of a bin that the pulse reaches back to, wherever it reaches back farthest; 0 with PLE off.
std::int64_t lead_in_bins(const BeamSetting& setting, double range_bin_m);
/// Length on the level surface, metres of arc, of a pulse `scale` times as long whose far end is at arc `arc_m`: back to the arc
/// at slant range r - scale c tau/2, or to the nadir if the surface is not so near.
double pulse_on_ground_m(const BeamSetting& setting, double scale, double arc_m);

/// Echo that changes little from azimuth to azimuth (rain): watts in each range bin of an image, at azimuths an equal part of the circle
/// apart, from north on, and straight between two. One: the same everywhere. None: there is no such echo.
struct EchoAround {
    std::vector<std::vector<float>> rays;  ///< those that no row of the image lies beside may be empty

    bool empty() const { return rays.empty(); }
    /// Between which two the middle of an azimuth bin lies, and how far from the first to the second.
    struct Place {
        std::size_t first, second;
        float part;
    };
    Place at(std::int64_t azimuth_bin, std::int64_t circle_bins) const;
};

/// P(i,j) = sum_k E(k,j) g_az((az_i - az_k) cos d_j)^2, d_j the depression of a level surface at the reference
/// height at the middle of range bin j, cos d_j at least 0.5; each bin at most once round the circle. Then the
/// one-sided pulse: cell j is the mean over the bin of the sum of the echoes in (r - c tau/2, r]: weights
/// w_m = H(m) - H(m - w), w = c tau / (2 dr), H the integral of the unit hat; m = 0.. bins nearer. On bins of ground range the
/// same mean of the sum over (s - pulse_on_ground_m(s), s], whose near end goes evenly from bin's edge to bin's edge, of echoes
/// that grow as s within their bin.
/// Switched off, the same total weight falls into the own bin (on ground range that of c tau/2 sec d_j, of any d_j); scaled, it is spread over
/// a beam (a pulse) so many times as wide, whose weights are divided by how much more they add up to. InputError if `echo` does not hold what `shown` needs.
/// `echo` (watts) covers at least `shown` plus skirt and lead-in where the circle and range 0 allow; the result
/// covers `shown`. Every output is a sum in a fixed order: the same bits for any number of threads. `used`: an image whose
/// memory may serve again.
///   around  echo on top of that image (rain), in its range bins
///   stop  looked at between rows: Interrupted
PolarImage<float> power_image(const PolarImage<float>& echo, const PolarGrid& shown, const BeamSetting& setting,
                              PolarImage<float>&& used = {}, const EchoAround& around = {}, const Stop* stop = nullptr);

/// The same bits for an echo image of which all is shown; in its own memory, with less than half as much beside it, unless it has
/// few range bins.
PolarImage<float> power_in_place(PolarImage<float>&& echo, const BeamSetting& setting, const EchoAround& around = {},
                                 const Stop* stop = nullptr);

/// cos d_j as the beam uses it: of the level surface at range `range_m` (arc where range bins are ground), at least
/// 0.5.
double level_cosine(const BeamSetting& setting, double range_m);

/// Which parts of an echo image's rows hold anything but zeros.
class FilledParts {
public:
    explicit FilledParts(const PolarImage<float>& image);
    /// From range bin `begin` to before `end`, those of the image's grid; any azimuth (modulo the circle) that the image has.
    bool any(std::int64_t azimuth_bin, std::int64_t begin, std::int64_t end) const {
        const std::uint8_t* const parts = filled_.data() + grid_.row_of(azimuth_bin) * parts_;
        const std::int64_t last = (end - 1 - grid_.range_bins.begin) / bins;
        for (std::int64_t part = (begin - grid_.range_bins.begin) / bins; part <= last; ++part)
            if (parts[part]) return true;
        return false;
    }

private:
    static constexpr std::int64_t bins = 256;
    PolarGrid grid_;
    std::size_t parts_;
    std::vector<std::uint8_t> filled_;
};

/// The weights of beam and pulse for a run of range bins, computed once (libm's results rounded to float), and
/// what they make of one row. `amplitude`: square roots of the power weights, for fields instead of powers.
class Resolution {
public:
    enum class Of { power, amplitude };
    Resolution(const BeamSetting& setting, std::int64_t circle_bins, double range_bin_m, Interval outputs, Of of);

    const Interval& outputs() const { return outputs_; }  ///< range bins that row() makes
    const Interval& sources() const { return sources_; }  ///< range bins they are made from
    std::int64_t skirt() const { return skirt_; }         ///< azimuth bins a side

    /// A row of the source image, from range bin sources().begin on, for any azimuth bin (modulo the circle).
    using SourceRow = std::function<const float*(std::int64_t azimuth_bin)>;
    /// Writes outputs().size() sums. Const and without shared state: rows may be made side by side. With `filled`, of the image
    /// that the source rows are those of, what is empty is passed over; the sums are the same.
    void row(std::int64_t azimuth_bin, const SourceRow& source, std::vector<double>& scratch, std::span<double> out,
             const FilledParts* filled = nullptr) const;

private:
    std::int64_t circle_bins_ = 0;
    Interval outputs_, sources_;
    std::int64_t skirt_ = 0;
    bool pulse_per_bin_ = false;
    std::vector<float> azimuth_;              ///< [azimuth offset][source bin]
    std::vector<std::size_t> reach_;          ///< [azimuth offset]: one past the last source bin of weight above 0
    std::vector<std::vector<double>> pulse_;  ///< [bins nearer], for all output bins or for each
};

/// InputError unless an echo image on `echo` holds what `resolution` needs to make `shown`.
void require_sources(const PolarGrid& echo, const PolarGrid& shown, const Resolution& resolution);

/// Range bins at a time, so that `rows` rows of `bytes_per_cell` and the weights stay within a few MiB, whatever the
/// image's size.
std::int64_t strip_bins(const BeamSetting& setting, const PolarGrid& grid, std::int64_t rows,
                        std::int64_t bytes_per_cell);

/// What the weights of a strip of `grid` take while a power image is made: a few MiB, unless a wide beam holds many azimuth
/// bins and a long pulse many range bins.
std::size_t weight_bytes(const BeamSetting& setting, const PolarGrid& grid);

/// One range weight for each m = 0.. of the pulse, in the order above (double, the last one > 0).
std::vector<double> pulse_weights(double width_bins);

}  // namespace wedgescope
