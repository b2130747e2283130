// Radar parameters: the set, its antenna, receiver and pulse, with defaults and checks.
// Leaves where it stands and what it looks at to scene.hpp.
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "lib/angle.hpp"
#include "lib/decibel.hpp"
#include "lib/polarisation.hpp"

namespace wedgescope {

enum class ElevationPattern { gaussian, csc2, cos_csc2, points };
enum class AzimuthPattern { gaussian, uniform };

/// A point of a measured elevation pattern.
struct PatternPoint {
    Angle depression;  ///< in the antenna's frame, positive down
    Decibel gain;      ///< one-way, relative to the peak gain
    friend bool operator==(const PatternPoint&, const PatternPoint&) = default;
};

/// Antenna patterns of physics "Antenna patterns": one-way power, relative to the peak gain.
struct AntennaParams {
    ElevationPattern elevation = ElevationPattern::csc2;
    Angle knee = Angle::degrees(5);  ///< depression of the nose in the antenna's frame; above 0 for the shaped ones
    Angle width =
        Angle::degrees(12);  ///< between half-power points of the Gaussian (above the knee for the shaped ones)
    double exponent = 0.5;   ///< p of cos-csc2; used by cos_csc2 only
    std::vector<PatternPoint> points;  ///< used by `points` only: linear in dB between them, the floor beyond
    Decibel floor{-60};                ///< least g_el
    Angle tilt{};                      ///< positive down; the nose is at knee + tilt
    AzimuthPattern azimuth = AzimuthPattern::gaussian;
    Angle beam = Angle::degrees(1.5);  ///< azimuth, between half-power points, one-way
};

struct RadarParams {
    double frequency_hz = 16.5e9;
    double transmit_power_w = 50e3;  ///< peak
    Decibel gain{34};                ///< peak, one-way
    Decibel losses{6};               ///< all system losses together
    double pulse_s = 0.5e-6;         ///< (compressed) length
    Decibel noise_figure{8};
    std::optional<double> bandwidth_hz;  ///< none: 1.2 / pulse
    Polarisation polarisation = Polarisation::hh;
    AntennaParams antenna;
    bool beam_width_error = true;    ///< BWE: spread over the azimuth beam; off: same total in the own bin
    bool pulse_length_error = true;  ///< PLE: spread over c tau/2 away from the radar; off: same total in the own bin
    // Both errors exaggerated (above 1) or understated: so many times as wide, with the same total. Off stays off.
    double beam_width_scale = 1;
    double pulse_length_scale = 1;

    double wavelength_m() const;
    double noise_bandwidth_hz() const;
    /// Mean thermal noise k T0 B F, watts. Source: physics "Noise and MDS".
    double noise_power_w() const;
    /// c tau / 2, metres.
    double pulse_extent_m() const;
};

/// IF log amplifier, video and display of physics "IF log amplifier, video, display", and STC.
struct ReceiverParams {
    Decibel if_gain{50};
    Decibel video_gain{4};
    std::optional<double> stc_range_m;  ///< none: no STC
    double stc_exponent = 4;
    Decibel stc_max{40};
    Decibel dynamic_range{20};
    std::optional<double> mds_dbm;                ///< none: k T0 B F
    std::optional<double> minimum_range_m = 0.0;  ///< slant; nearer the receiver is blanked; none: c tau / 2
    double display_gamma = 1;
    bool noise = false;     ///< fluctuating thermal noise; its mean is always there
    int speckle_looks = 0;  ///< 0: none
    std::uint64_t seed = 1;

    /// Is anything drawn?
    bool fluctuates() const { return speckle_looks > 0 || noise; }
};

/// Bins that are taken where none are asked for: four a beamwidth round the circle, c tau/8 in slant range.
std::int64_t default_azimuth_bins(const RadarParams&);
double default_range_bin_m(const RadarParams&);

/// What is wrong with points of a pattern, and with which of them.
struct PatternFault {
    std::size_t point = 0;
    std::string what;  ///< found and accepted, in one line
};
/// At most so many points, so far apart at the least: what a PatternTable resolves.
inline constexpr std::size_t most_pattern_points = 4096;
inline constexpr double least_pattern_step_deg = 0.001;
/// The first fault; none: at least two points, depressions ascending from -90 to 90 degrees, gains from -200 to 0 dB.
std::optional<PatternFault> pattern_fault(std::span<const PatternPoint> points);

/// InputError naming the key (as on the command line), the value and what is accepted.
void validate(const RadarParams&);
void validate(const ReceiverParams&);

/// The checks of one number that `validate` is made of, here and in scene.cpp: InputError such as
/// "range is 0 m; it must be above 0". NaN and infinity never pass.
void require_above(const char* key, double value, double low, const char* unit);
void require_within(const char* key, double value, double low, double high, const char* unit);    ///< low and high pass
void require_above_to(const char* key, double value, double low, double high, const char* unit);  ///< low does not pass

inline constexpr double speed_of_light_m_s = 299792458.0;
inline constexpr double boltzmann_j_k = 1.380649e-23;
inline constexpr double standard_temperature_k = 290.0;

}  // namespace wedgescope
