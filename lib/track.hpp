// Track: where a moving sensor is, from its places at some times, and the scan that it makes on its way.
// Leaves reading a file of places to tools/track_file.hpp, and the sweep to engine.hpp.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "lib/engine.hpp"
#include "lib/scene.hpp"

namespace wedgescope {

struct TrackPoint {
    double time_s = 0;
    double first = 0, second = 0;  ///< latitude and longitude, degrees, or x and y of the raster
    double altitude_m = 0;
    Angle heading{};
    std::int64_t line = 0;  ///< of the file, for messages
};

class Track {
public:
    /// At least one point, times growing. `lat_lon`: else x and y.
    Track(bool lat_lon, AltitudeAbove altitude, std::vector<TrackPoint> points);

    std::size_t size() const { return points_.size(); }
    const TrackPoint& operator[](std::size_t i) const { return points_[i]; }
    bool lat_lon() const { return lat_lon_; }
    std::size_t bytes() const { return points_.capacity() * sizeof(TrackPoint); }

    /// The sensor at a point; what a track does not say (the geoid's height) as in `base`.
    PlatformParams at(const PlatformParams& base, std::size_t point) const;
    /// And so many seconds (not below 0) after it, with the point's heading. Between two points it moves evenly: along the
    /// WGS84 geodesic, or the straight line in x and y, its altitude in proportion. Past the last point the last leg goes on.
    /// Where two points are the same place it stands there, to the last bit. `x_circle`: what x repeats after (360 where x
    /// and y are degrees, 0: nothing): of the two ways round it moves the shorter one, and its x is the nearest to the point's.
    PlatformParams after(const PlatformParams& base, std::size_t point, double seconds, double x_circle = 0) const;

private:
    bool lat_lon_;
    AltitudeAbove altitude_;
    std::vector<TrackPoint> points_;
};

/// The scan of the scene `whole`, seen from a point of the track on, by an antenna that turns the whole circle in `period_s`:
/// so many azimuth bins (`step`) from each place. All but the numbers must outlive it. What at() throws says how long after
/// the point's time.
Scan scan_along(const Track& track, std::size_t point, std::int64_t step, double period_s, const ResolvedScene& whole,
                WedgeSource& source);

}  // namespace wedgescope
