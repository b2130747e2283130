#include "tools/track_stack.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "tiles/raster_metadata.hpp"
#include "tools/scene_json.hpp"
#include "tools/side_by_side.hpp"

namespace wedgescope {
namespace {

/// Of a polar raster's metadata what all frames of one size have alike; SCENE_JSON stands for itself.
bool of_all_frames(const std::string& name) {
    constexpr std::array<std::string_view, 5> names = {"SOFTWARE", "AZIMUTH_STEP_DEG", "RANGE_START_M", "RANGE_STEP_M",
                                                       "RANGE_KIND"};
    return std::find(names.begin(), names.end(), name) != names.end();
}

Metadata metadata(const ResolvedScene& scene, bool of_all) {
    RasterFormat format;
    format.version = version();
    Metadata items = polar_metadata(scene, scene.shown, format);
    std::erase_if(items, [&](const auto& item) { return of_all_frames(item.first) != of_all; });
    return items;
}

const char* altitude_name(AltitudeAbove above) {
    switch (above) {
        case AltitudeAbove::ground:
            return "ALTITUDE_AGL_M";
        case AltitudeAbove::ellipsoid:
            return "ALTITUDE_HAE_M";
        default:
            return "ALTITUDE_MSL_M";
    }
}

}  // namespace

void TrackStack::check(const Settings& settings, std::size_t frames) {
    const std::string& path = settings.power_stack;
    const std::string ending = lower_case(std::filesystem::path(path).extension().string());
    if (ending != ".tif" && ending != ".tiff")
        throw InputError(text("power-stack is ", in_quotes(path),
                              "; it is a GeoTIFF: accepted is a name that ends in .tif or .tiff"));
    if (frames > PowerStack::most_bands)
        throw InputError(text("power-stack is given, and track ", in_quotes(settings.track), " has ", frames,
                              " rows; a GeoTIFF has at most ", PowerStack::most_bands,
                              " bands (give the rows in several tracks)"));
    if (!settings.output.empty() || !settings.echo.empty() || !settings.power.empty() || !settings.states.empty())
        return;
    if (const char* idle = !settings.driver.empty() ? "of" : !settings.creation.empty() ? "co" : nullptr)
        throw InputError(text(idle, " is given, and power-stack is the only raster; it is always a plain GeoTIFF"));
}

void TrackStack::check_bins(const ResolvedScene& first, const ResolvedScene& scene) {
    const PolarGrid &a = first.shown, &b = scene.shown;
    if (a.azimuth_count() == b.azimuth_count() && a.range_count() == b.range_count()) return;
    throw InputError(text("power-stack: the power image has ", b.azimuth_count(), " x ", b.range_count(),
                          " bins (azimuth, range), that of frame 1 ", a.azimuth_count(), " x ", a.range_count(),
                          "; all must have as many ",
                          a.range_count() != b.range_count()
                              ? "(give range)"
                              : "(leave sector out, or let headings lie whole azimuth bins apart)"));
}

std::size_t TrackStack::bytes(int threads) {
    return (static_cast<std::size_t>(threads) + 2) * PowerStack::buffer_bytes +
           InOrder<Words>::most_ahead * PowerStack::band_words;
}

void TrackStack::begin(const Settings& first, const ResolvedScene& scene, std::size_t frames) {
    scene_ = scene_object(first, scene);
    StackContent content;
    content.columns = scene.shown.range_bins.size();
    content.rows = scene.shown.azimuth_bins.size();
    content.bands = frames;
    content.unit = first.power_unit;
    content.metadata = metadata(scene, true);
    content.metadata.emplace_back("SCENE_JSON", json_line(scene_));
    stack_ = std::make_unique<PowerStack>(content, file_);
}

TrackStack::Words TrackStack::write(std::size_t frame, const TrackPoint& point, const Settings& settings,
                                    const RunResult& result) {
    stack_->write(frame, result.power_w.cells);
    const PlatformParams& platform = settings.scene.platform;
    Words words;
    words.description = text("frame ", frame + 1, ", ", fifteen_digits(point.time_s), " s");
    words.items = {{"FRAME", text(frame + 1)},
                   {"TRACK_LINE", text(point.line)},
                   {"TIME_S", fifteen_digits(point.time_s)},
                   {altitude_name(platform.altitude_above), fifteen_digits(platform.altitude_m)},
                   {"HEADING_DEG", fifteen_digits(platform.heading.deg())}};
    for (auto& item : metadata(result.scene, false)) words.items.push_back(std::move(item));
    words.items.emplace_back("SCENE_JSON", json_line(scene_difference(scene_, scene_object(settings, result.scene))));
    return words;
}

void TrackStack::put(const Words& words) { stack_->describe(words.description, words.items); }

void TrackStack::close() { stack_->close(); }

}  // namespace wedgescope
