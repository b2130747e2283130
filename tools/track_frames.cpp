#include "tools/track_frames.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string>

namespace wedgescope {

namespace {

/// The path with the frame's number (from 1) before its ending: scope.png, 7, 4 digits -> scope_0007.png.
std::string numbered(const std::string& path, std::size_t frame, int digits) {
    const std::filesystem::path p(path);
    return (p.parent_path() / fmt::format("{}_{:0{}}{}", p.stem().string(), frame, digits, p.extension().string()))
        .string();
}

}  // namespace

TrackFrames::TrackFrames(const Settings& settings, const Track& track)
    : settings_(settings), track_(track), digits_(std::max(4, static_cast<int>(std::to_string(track.size()).size()))) {}

Settings TrackFrames::settings(std::size_t frame) const {
    Settings own = settings_;
    own.track.clear();
    own.scene = scene(frame);
    own.altitude_given = true;
    for (std::string* path : {&own.output, &own.echo, &own.power, &own.states})
        if (!path->empty()) *path = numbered(*path, frame + 1, digits_);
    return own;
}

Scan TrackFrames::scan(std::size_t frame, const ResolvedScene& whole, WedgeSource& source) const {
    return scan_along(track_, frame, *settings_.scan_step, *settings_.scan_period_s, whole, source);
}

void TrackFrames::check_scan(std::size_t frame, const ResolvedScene& whole, WedgeSource& source) const {
    const Interval bins = whole.shown.azimuth_bins;
    const std::int64_t step = *settings_.scan_step;
    scan(frame, whole, source).at({bins.begin + (bins.size() - 1) / step * step, bins.end});
}

void TrackFrames::for_each_part(std::size_t frame, const ResolvedScene& whole, WedgeSource& source,
                                const std::function<void(const ResolvedScene&)>& use) const {
    const Scan groups = scan(frame, whole, source);
    const Interval bins = whole.shown.azimuth_bins;
    for (std::int64_t first = bins.begin; first < bins.end; first += groups.step)
        use(groups.at({first, std::min(first + groups.step, bins.end)}));
}

ResolvedScene TrackFrames::first_part(const ResolvedScene& whole) const {
    ResolvedScene part = whole;
    if (scans())
        look_at(part, {whole.shown.azimuth_bins.begin,
                       std::min(whole.shown.azimuth_bins.end, whole.shown.azimuth_bins.begin + *settings_.scan_step)});
    return part;
}

std::string TrackFrames::words(std::size_t frame) const {
    return text("track ", in_quotes(settings_.track), ", line ", track_[frame].line, " (frame ", frame + 1, ")");
}

Scene TrackFrames::scene(std::size_t frame) const {
    Scene own = settings_.scene;
    own.platform = track_.at(settings_.scene.platform, frame);
    // What fluctuates is another draw in each frame.
    if (own.receiver.noise || own.receiver.speckle_looks > 0) own.receiver.seed += frame;
    return own;
}

}  // namespace wedgescope
