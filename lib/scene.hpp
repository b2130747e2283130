// Scene: sensor position and look, data-base conventions, display: all that `run` needs beside the
// wedge source. Holds no file names: those belong to tools and tiles.
#pragma once
#include <cstdint>
#include <optional>
#include <vector>

#include "lib/angle.hpp"
#include "lib/class_laws.hpp"
#include "lib/decibel.hpp"
#include "lib/material.hpp"
#include "lib/path_loss.hpp"
#include "lib/sensor.hpp"

namespace wedgescope {

enum class Geometry { geodesic, grid };
enum class DisplayKind { gpi, gpi_true, ppi, tdppi };
enum class Orientation { north, heading };
enum class Quality { exact, fine, normal, draft };
/// What a pixel shows: power between cell centres, or the cells whose centres fall on it. Pixels without one, holes, then
/// take the mean of those beside them, or stay black.
enum class PixelFill { interpolate, holes, none };

struct LatLon {
    double lat_deg = 0;
    double lon_deg = 0;
};
struct PointXY {
    double x = 0;  ///< raster CRS, its own units
    double y = 0;
};

enum class AltitudeAbove { sea_level, ground, ellipsoid };

/// Where the sensor stands, as asked; exactly one of latlon and xy.
struct PlatformParams {
    std::optional<LatLon> latlon;
    std::optional<PointXY> xy;
    AltitudeAbove altitude_above = AltitudeAbove::sea_level;
    double altitude_m = 0;
    std::optional<double>
        geoid_offset_m;  ///< geoid (sea level) above the ellipsoid at the sensor; needed for `ellipsoid`
    Angle heading{};
};

/// In fractions of half a side, from the middle of the picture.
struct TubePlace {
    double x = 0;  ///< to the right
    double y = 0;  ///< up
};

struct DisplayParams {
    DisplayKind kind = DisplayKind::gpi;
    std::optional<double> sweep_delay_m;  ///< tdppi: slant range of the centre; none: altitude above the nadir
    std::int64_t size = 1024;             ///< pixels of the longer side
    Orientation orientation = Orientation::north;
    std::optional<TubePlace> centre;  ///< where the sensor stands on a square tube; none: the frame fits the sector
    bool rings = true;
    std::optional<double> ring_spacing_m;     ///< of the display's own radius; none: a round number of nautical miles
    std::optional<double> azimuth_marks_rad;  ///< step of radial lines, from the heading both ways; none: no lines
    PixelFill pixel_fill = PixelFill::interpolate;
    bool alpha = false;  ///< the picture's file has a channel that is transparent where the data base has no data
    bool legend = false;
};

struct Sector {
    static constexpr double least_width_deg = 1e-9;
    Angle from;  ///< relative to heading
    Angle to;    ///< clockwise from `from`, so not below it; a width of 360 degrees is the full circle
};

struct Scene {
    PlatformParams platform;
    std::optional<Geometry> geometry;         ///< none: geodesic where the raster has a CRS
    std::optional<double> earth_k = 4.0 / 3;  ///< none: flat
    std::optional<Sector> sector;             ///< none: the full circle
    static constexpr double most_range_m = 1e7;
    std::optional<double> range_m;            ///< largest slant range; none: what the data base and the horizon allow
    double range_start_m = 0;
    std::optional<double> ground_range_m;      ///< coverage only: largest distance along the ground; none: no limit
    double ground_start_m = 0;                 ///< coverage only: least distance along the ground
    std::optional<std::int64_t> azimuth_bins;  ///< in the circle; none: 4 a beamwidth
    std::optional<double> range_bin_m;         ///< none: c tau / 8
    RadarParams radar;
    ReceiverParams receiver;
    DisplayParams display;
    Materials materials;           ///< what the classes of the ground return
    std::optional<Decibel> gamma;  ///< one constant gamma at 10 GHz for everything
    LandModel land = LandModel::constant_gamma;
    WaterModel water = WaterModel::nrl;
    double sea_state = 0;            ///< Douglas, 0 to 6
    std::optional<Angle> wind_from;  ///< azimuth, from north; none: the mean over wind directions
    bool far_shore = false;          ///< banks across water are lit by way of the water too
    Walls walls = Walls::resolved;
    WeatherParams weather;  ///< its tilt is that of the radar's polarisation: weather_of()
    Quality quality = Quality::normal;
    std::optional<double> max_error_db;  ///< asked for in place of a quality, which is then what keeps it
    bool detail = true;                  ///< levels of detail where the quality's promise allows them
    // In place of what the quality says.
    std::optional<double> spokes_per_post;
    std::optional<double> spokes_per_bin;  ///< of azimuth
    std::optional<double> spoke_lead;   ///< how many times their distance ahead spokes double
    std::optional<bool> crossings;      ///< sampled where spokes cross the other axis' lines too
    bool refine = true;                 ///< bins in doubt are swept again (refine.hpp)
    std::optional<bool> curved_course;  ///< the surface's course inside a cell, not a straight line
};

/// What shading takes of a scene; InputError, when they are used, where a model does not reach the frequency.
ClassLawParams laws_of(const Scene& scene);
WeatherParams weather_of(const Scene& scene);
/// By class, what statistical walls raise its ground by, metres; empty: none is raised.
std::vector<float> raises_m(const Scene& scene);

/// Of the power image against a converged one, dB, over the cells that reach the thermal noise in either, with it added to both.
struct PowerError {
    double rms_db = 0, p99_db = 0;
};
/// What a quality promises at the most where c tau / 2 and beam are two posts or more and a beam has four azimuth bins or more,
/// as `auto` makes them.
PowerError promised_error(Quality);
/// The quickest quality that promises at most so much RMS; nothing where none does.
std::optional<Quality> quality_within(double rms_db);

/// Checks all that can be checked without the data base; InputError naming the key.
void validate(const Scene&);

const char* word(Geometry);
const char* word(DisplayKind);
const char* word(Orientation);
const char* word(Quality);
const char* word(ElevationPattern);
const char* word(AzimuthPattern);
const char* word(LandModel);
const char* word(WaterModel);
const char* word(Walls);

}  // namespace wedgescope
