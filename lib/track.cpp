#include "lib/track.hpp"

#include <fmt/format.h>
#include <GeographicLib/Geodesic.hpp>
#include <GeographicLib/GeodesicLine.hpp>

#include <cmath>
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

PlatformParams Track::after(const PlatformParams& base, std::size_t point, double seconds, double x_circle) const {
    PlatformParams out = at(base, point);
    if (!(seconds > 0) || points_.size() < 2) return out;
    const double time_s = points_[point].time_s + seconds;
    std::size_t from = point;
    while (from + 2 < points_.size() && points_[from + 1].time_s <= time_s) ++from;
    if (from + 1 == points_.size()) --from;
    const TrackPoint &a = points_[from], &b = points_[from + 1];
    const double part = (time_s - a.time_s) / (b.time_s - a.time_s);
    out.altitude_m = a.altitude_m + part * (b.altitude_m - a.altitude_m);
    const auto x_way = [&](double way) { return x_circle > 0 ? std::remainder(way, x_circle) : way; };
    const double across = lat_lon_ ? b.first - a.first : x_way(b.first - a.first);
    const bool stands = across == 0 && a.second == b.second;
    if (!lat_lon_) {
        const double turns = x_circle > 0 ? std::round((a.first - points_[point].first) / x_circle) : 0;
        out.xy = PointXY{a.first - turns * x_circle, a.second};
        if (!stands) out.xy = PointXY{out.xy->x + part * across, a.second + part * (b.second - a.second)};
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

Scan scan_along(const Track& track, std::size_t point, std::int64_t step, double period_s, const ResolvedScene& whole,
                WedgeSource& source) {
    const DataBase& db = source.data_base();
    const double x_circle = db.has_crs && !db.crs_in_metres ? 360 : 0;
    return {step, [&track, point, period_s, &whole, &source, x_circle](Interval bins) {
                const double seconds = static_cast<double>(bins.begin - whole.shown.azimuth_bins.begin) /
                                       static_cast<double>(whole.shown.circle_bins) * period_s;
                const auto place = [&] {
                    Scene own = whole.scene;
                    own.platform = track.after(whole.scene.platform, point, seconds, x_circle);
                    ResolvedScene there = resolve(own, source);
                    look_at(there, bins);
                    return there;
                };
                return seconds > 0 ? with_context(fmt::format("{:.6g} s after the row's time", seconds), place)
                                   : place();
            }};
}

}  // namespace wedgescope
