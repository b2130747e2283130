#include "lib/track.hpp"

#include <GeographicLib/Geodesic.hpp>
#include <GeographicLib/GeodesicLine.hpp>

#include <utility>

#include "lib/error.hpp"

namespace wedgescope {

Track::Track(bool lat_lon, AltitudeAbove altitude, std::vector<TrackPoint> points)
    : lat_lon_(lat_lon), altitude_(altitude), points_(std::move(points)) {
    if (points_.empty()) throw Error("a track has at least one point");
    for (std::size_t i = 1; i < points_.size(); ++i)
        if (!(points_[i].time_s > points_[i - 1].time_s)) throw Error("the times of a track grow");
}

PlatformParams Track::at(const PlatformParams& base, std::size_t point) const {
    const TrackPoint& p = points_.at(point);
    PlatformParams out = base;
    out.latlon.reset();
    out.xy.reset();
    if (lat_lon_)
        out.latlon = LatLon{p.first, p.second};
    else
        out.xy = PointXY{p.first, p.second};
    out.altitude_above = altitude_;
    out.altitude_m = p.altitude_m;
    out.heading = p.heading;
    return out;
}

PlatformParams Track::after(const PlatformParams& base, std::size_t point, double seconds) const {
    PlatformParams out = at(base, point);
    if (!(seconds > 0) || points_.size() < 2) return out;
    const double time_s = points_[point].time_s + seconds;
    std::size_t from = point;
    while (from + 2 < points_.size() && points_[from + 1].time_s <= time_s) ++from;
    if (from + 1 == points_.size()) --from;
    const TrackPoint &a = points_[from], &b = points_[from + 1];
    const double part = (time_s - a.time_s) / (b.time_s - a.time_s);
    out.altitude_m = a.altitude_m + part * (b.altitude_m - a.altitude_m);
    const bool stands = a.first == b.first && a.second == b.second;
    if (!lat_lon_) {
        out.xy = stands ? PointXY{a.first, a.second}
                        : PointXY{a.first + part * (b.first - a.first), a.second + part * (b.second - a.second)};
    } else if (stands) {
        out.latlon = LatLon{a.first, a.second};
    } else {
        const GeographicLib::GeodesicLine leg =
            GeographicLib::Geodesic::WGS84().InverseLine(a.first, a.second, b.first, b.second);
        LatLon place;
        leg.Position(part * leg.Distance(), place.lat_deg, place.lon_deg);
        out.latlon = place;
    }
    return out;
}

}  // namespace wedgescope
