// The slow reference: echo, power and state image of a radar scene by brute force in double precision.
// It shares no code with lib/, tiles/ or tools/, and leaves receiver, noise, rain and gases to others.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace wedgescope::reference {

enum class Geometry { geodesic, grid };
enum class ElevationPattern { gaussian, csc2, cos_csc2 };
enum class AzimuthPattern { gaussian, uniform };

/// No wall reflectivity of its own, or no echo at all.
inline constexpr double none = std::numeric_limits<double>::quiet_NaN();

/// Reflectivity of one class at 10 GHz, in dB.
struct Gamma {
    double ground_db = none;  ///< none: returns nothing (calm water)
    double wall_db = none;    ///< none: walls take ground_db
};

/// One radar scene. Plain numbers; the unit is in the name; angles in degrees.
struct Scene {
    // Data base. Paths of any GDAL raster; empty: there is none. All in the CRS of the terrain.
    std::string dem;
    std::string culture;                ///< class codes
    std::string culture_height;         ///< height of what stands on the terrain
    double culture_height_scale = 1.0;  ///< metres in one unit of culture_height
    std::map<int, int> class_of_code;   ///< a code of a cell that is not in it is an error
    int default_class = 4;              ///< no culture, its no-data, outside it
    std::map<int, Gamma> gamma;         ///< by class; each class that occurs must be in it

    // Sensor. By WGS84 latitude and longitude, or by x, y of the terrain's CRS.
    bool by_xy = false;
    double lat_deg = 0, lon_deg = 0;
    double x = 0, y = 0;
    double height_msl_m = 0;

    // Earth.
    Geometry geometry = Geometry::geodesic;
    bool flat_earth = false;
    double earth_k = 4.0 / 3.0;

    // Radar.
    double frequency_ghz = 16.5;
    double transmit_power_w = 50e3;
    double gain_db = 34;
    double losses_db = 6;
    double pulse_s = 0.5e-6;
    double beamwidth_deg = 1.5;  ///< azimuth, one way, 3 dB
    AzimuthPattern azimuth_pattern = AzimuthPattern::gaussian;
    ElevationPattern elevation_pattern = ElevationPattern::csc2;
    double knee_deg = 5;    ///< depression of the nose before tilt (of the Gaussian pattern too)
    double width_deg = 12;  ///< elevation beamwidth, one way, 3 dB (above the knee if shaped)
    double exponent = 0.5;  ///< of the cosine; cos_csc2 only
    double floor_db = -60;  ///< of g_el
    double tilt_deg = 0;    ///< positive down
    bool beam = true;       ///< false: what the beam collects falls into its own bin
    bool pulse = true;      ///< false: what the pulse collects falls into its own bin

    // Bins. Azimuth bin 0 starts at north and range bin 0 at 0 m.
    int azimuth_bins = 960;     ///< in the full circle
    int first_azimuth_bin = 0;  ///< any integer, modulo azimuth_bins
    int azimuth_count = 240;    ///< 1 .. azimuth_bins
    int range_bins = 1000;
    double range_bin_m = 18.737028625;  ///< c tau / 8 for 0.5 us

    // Sampling. The defaults are converged to 0.01 dB RMS of the power image on the project's real scenes with
    // 0.375 degree bins out to 30 km, for 6 to 18 CPU seconds a 90 degree sector; 24 rays to 0.03 dB for half of it.
    int rays_per_bin = 48;             ///< evenly spaced inside each azimuth bin
    double step_posts = 0.125;         ///< longest step along a ray, in posts (the smaller posting at the nadir)
    bool split_steps = true;           ///< end steps also at the edges of terrain cells and culture cells
    double position_tolerance = 1e-4;  ///< posts, of the interpolated positions
    /// Instead of rays: so many posts between samples on an even grid over the ground. Each stands for the square around
    /// it, by a sight line of its own, and falls whole into the bin of its middle. Sight lines look over voids. Not of
    /// rasters that go round the earth.
    std::optional<double> uniform_posts;
    int threads = 2;  ///< never changes a bit of the result
};

enum State : std::uint8_t { no_data = 0, shadow = 1, seen = 2, unknown = 3, outside = 4 };

/// Images: row-major, azimuth_count rows of range_bins.
struct Result {
    int azimuth_count = 0, range_bins = 0;
    std::vector<double> echo_w;       ///< before beam and pulse
    std::vector<double> power_w;      ///< after
    std::vector<std::uint8_t> state;  ///< State
    // What was found on the way.
    double lat_deg = 0, lon_deg = 0;  ///< NaN where the raster has no CRS
    double x = 0, y = 0;
    double reference_height_m = 0;    ///< bare terrain at the nadir, 0 where there is none
    double post_m = 0;                ///< posting that step_posts refers to
    double position_error_posts = 0;  ///< largest found at the middles of the interpolated pieces
    double cpu_s = 0;                 ///< all threads

    std::size_t index(int azimuth, int range) const {
        return static_cast<std::size_t>(azimuth) * static_cast<std::size_t>(range_bins) +
               static_cast<std::size_t>(range);
    }
};

/// Runs the scene. std::runtime_error if a raster cannot be read or the scene makes no sense.
Result simulate(const Scene&);

/// The project's class table (physics.md 7.4) and legends: code -> class.
std::map<int, Gamma> project_gamma();
std::map<int, Gamma> constant_gamma(double db, int default_class = 4);  ///< walls too
std::map<int, int> fbfm40_classes();
std::map<int, int> nlcd_classes();

/// One-way elevation pattern at a depression angle, and two-way azimuth pattern (g_az squared).
double elevation_gain(const Scene&, double depression_rad);
double azimuth_gain_two_way(const Scene&, double offset_rad);

/// kT0BF with T0 = 290 K.
double noise_w(double bandwidth_hz, double noise_figure_db);

/// Errors of a test image against a reference image, in dB, over the cells above the noise in either,
/// noise added to both.
struct Comparison {
    double rms_db = 0, p99_db = 0, median_db = 0, max_db = 0;  ///< median is signed: test minus reference
    std::size_t count = 0;
};
Comparison compare(const std::vector<double>& test_w, const std::vector<double>& reference_w, double noise_w);

/// Share of cells whose states differ.
double state_difference(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b);

}  // namespace wedgescope::reference
