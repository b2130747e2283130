#include "tiles/polar_raster.hpp"

#include <algorithm>
#include <cmath>

#include "lib/error.hpp"
#include "tiles/geolocation_array.hpp"
#include "tiles/raster_writer.hpp"

namespace wedgescope {
namespace {

constexpr std::int64_t most_nodes = 200000;  ///< of a geolocation array: 3.2 MiB

GeolocationGrid polar_geolocation(const RunResult& run, const PolarGrid& grid, const RasterFormat& format) {
    const std::int64_t azimuths = grid.azimuth_bins.size(), ranges = grid.range_bins.size();
    const double step = grid.azimuth_step_rad();
    // GDAL interpolates between nodes along straight lines: their sagitta at the far edge, r (1 - cos(step / 2)), stays
    // within a quarter of a range bin. Not denser than that: near the nadir narrow cells are hard for GDAL to find.
    const double far = static_cast<double>(grid.range_bins.end) * grid.range_bin_m;
    const double widest = 2 * std::acos(std::clamp(1 - 0.25 * grid.range_bin_m / far, 0.5, 1.0));
    std::int64_t row_step = std::clamp<std::int64_t>(static_cast<std::int64_t>(widest / step), 1, azimuths);
    if (grid.full_circle())
        while (azimuths % row_step != 0) --row_step;  // so that the last node stands on the first
    const std::int64_t rows = azimuths / row_step + 2;
    const std::int64_t column_step = (ranges * rows + most_nodes - 1) / most_nodes;
    GeolocationGrid out = geolocation_grid(ranges, azimuths, column_step, row_step);
    std::vector<double> arcs_m(static_cast<std::size_t>(out.columns));
    for (std::size_t i = 0; i < arcs_m.size(); ++i) {
        const auto bin = grid.range_bins.begin + static_cast<std::int64_t>(i) * out.column_step;
        arcs_m[i] = ground_arc_m(run.scene, static_cast<double>(bin) * grid.range_bin_m);
    }
    const Ground ground(run.scene, format, arcs_m.back(), place_error * grid.range_bin_m);
    out.closed = grid.full_circle();
    out.crs = ground.crs();
    out.threads = run.report.threads;
    const auto first = static_cast<double>(grid.azimuth_bins.begin);
    out.find_row = [arcs_m = std::move(arcs_m), ground, first, step](double row, Place* places) {
        const double azimuth = (first + row) * step, sine = std::sin(azimuth), cosine = std::cos(azimuth);
        for (std::size_t i = 0; i < arcs_m.size(); ++i) places[i] = ground.at(arcs_m[i] * sine, arcs_m[i] * cosine);
    };
    return out;
}

RasterContent polar_content(const RunResult& run, const PolarGrid& grid, const RasterFormat& format) {
    RasterContent content;
    content.columns = grid.range_bins.size();
    content.rows = grid.azimuth_bins.size();
    content.metadata = polar_metadata(run.scene, grid, format);
    content.geolocation = polar_geolocation(run, grid, format);
    return content;
}

template <class T>
void check(const PolarImage<T>& image, const char* what, const OutputFile& file) {
    if (image.cells.empty() || image.cells.size() != image.grid.cells())
        throw Error(text("output '", file.final_path(), "': the run holds no ", what));
}

std::string state_legend() {
    std::string words;
    for (int code = 0; code < state_count; ++code) words += text(code ? ", " : "", code, " ", state_names[code]);
    return words;
}

}  // namespace

float power_in_dbm(float watts) {
    return watts > 0 ? static_cast<float>(rounded_dbm(static_cast<double>(watts))) : no_dbm;
}

Metadata polar_metadata(const ResolvedScene& scene, const PolarGrid& grid, const RasterFormat& format) {
    const double circle = static_cast<double>(grid.circle_bins);
    Metadata items = scene_metadata(scene, format);
    items.emplace_back(
        "AZIMUTH_START_DEG",
        fifteen_digits(std::fmod(static_cast<double>(grid.azimuth_bins.begin % grid.circle_bins) * 360 / circle, 360)));
    items.emplace_back("AZIMUTH_STEP_DEG", fifteen_digits(360 / circle));
    items.emplace_back("RANGE_START_M", fifteen_digits(static_cast<double>(grid.range_bins.begin) * grid.range_bin_m));
    items.emplace_back("RANGE_STEP_M", fifteen_digits(grid.range_bin_m));
    items.emplace_back("RANGE_KIND", scene.scene.display.kind == DisplayKind::gpi_true ? "ground" : "slant");
    return items;
}

void write_echo(const RunResult& run, OutputFile& file, const RasterFormat& format) {
    check(run.echo_w, "echo", file);
    check(run.echo_state, "echo states", file);
    const std::vector<float> states(run.echo_state.cells.begin(), run.echo_state.cells.end());
    RasterContent content = polar_content(run, run.echo_w.grid, format);
    content.type = GDT_Float32;
    content.quick_to_read = true;
    content.metadata.emplace_back("STATE_CODES", state_legend());
    content.bands.push_back({run.echo_w.cells.data(), "echo", "W", {}, {}});
    content.bands.push_back({states.data(), "state", "", {}, {}});
    write_raster(content, file, format);
}

void write_power(const RunResult& run, PowerUnit unit, OutputFile& file, const RasterFormat& format) {
    check(run.power_w, "power", file);
    RasterContent content = polar_content(run, run.power_w.grid, format);
    content.type = GDT_Float32;
    if (unit == PowerUnit::watt) {
        content.bands.push_back({run.power_w.cells.data(), "power", "W", {}, {}});
        write_raster(content, file, format);
        return;
    }
    std::vector<float> dbm(run.power_w.cells.size());
    std::transform(run.power_w.cells.begin(), run.power_w.cells.end(), dbm.begin(), power_in_dbm);
    content.bands.push_back({dbm.data(), "power", "dBm", static_cast<double>(no_dbm), {}});
    write_raster(content, file, format);
}

void write_states(const RunResult& run, OutputFile& file, const RasterFormat& format) {
    check(run.state, "states", file);
    RasterContent content = polar_content(run, run.state.grid, format);
    content.type = GDT_Byte;
    set_states(content);
    content.metadata.emplace_back("STATE_CODES", state_legend());
    content.bands.push_back(
        {run.state.cells.data(), "state", "", {}, {std::begin(state_names), std::end(state_names)}});
    write_raster(content, file, format);
}

}  // namespace wedgescope
