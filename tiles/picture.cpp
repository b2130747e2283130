#include "tiles/picture.hpp"

#include <algorithm>
#include <cmath>

#include "lib/error.hpp"
#include "tiles/geolocation_array.hpp"
#include "tiles/raster_writer.hpp"

namespace wedgescope {
namespace {

/// Column and row -> x and y of a plane round (x0, y0), `unit` metres a unit.
std::array<double, 6> affine(const Frame& frame, double x0, double y0, double unit) {
    const double scale = frame.metres_per_pixel / unit;
    // Exactly 0 and 1 where up is north.
    const double c = frame.up_azimuth_rad == 0 ? scale : scale * std::cos(frame.up_azimuth_rad);
    const double s = frame.up_azimuth_rad == 0 ? 0 : scale * std::sin(frame.up_azimuth_rad);
    return {x0 - c * frame.centre_column + s * frame.centre_row, c,        -s + 0.0,
            y0 + s * frame.centre_column + c * frame.centre_row, -s + 0.0, -c};
}

/// ppi and tdppi: the radius on the tube is slant range, less the delay.
GeolocationGrid tube_geolocation(const RunResult& run, const RasterFormat& format) {
    const Frame frame = run.scope.frame;
    const ResolvedScene& scene = run.scene;
    const double delay = scene.scene.display.kind == DisplayKind::tdppi ? scene.sweep_delay_m : 0;
    // Pixels from node to node: GDAL goes straight between them where slant range bends into ground range. n pixels beyond the
    // altitude hole that is 1 / n of a pixel off at the most. At most 512 x 512 nodes, whatever the picture's size.
    const std::int64_t step = std::max<std::int64_t>(4, (std::max(frame.width, frame.height) + 510) / 511);
    GeolocationGrid grid = geolocation_grid(frame.width, frame.height, step, step);
    const auto last = [](std::int64_t nodes, std::int64_t apart) { return static_cast<double>((nodes - 1) * apart); };
    const double farthest = std::hypot(std::max(frame.centre_column, last(grid.columns, step) - frame.centre_column),
                                       std::max(frame.centre_row, last(grid.rows, step) - frame.centre_row)) *
                            frame.metres_per_pixel;
    const Ground ground(scene, format, ground_arc_m(scene, farthest + delay), place_error * frame.metres_per_pixel);
    grid.packed = false;
    grid.crs = ground.crs();
    grid.threads = run.report.threads;
    const double sine = std::sin(frame.up_azimuth_rad), cosine = std::cos(frame.up_azimuth_rad);
    grid.find_row = [=, &scene, columns = grid.columns](double row, Place* places) {
        const double up = frame.centre_row - row;
        for (std::int64_t i = 0; i < columns; ++i) {
            const double right = static_cast<double>(i * step) - frame.centre_column,
                         pixels = std::sqrt(right * right + up * up),
                         arc = ground_arc_m(scene, pixels * frame.metres_per_pixel + delay);
            // In the very middle of a delayed sweep the way up is as good as any.
            const double along = pixels > 0 ? up / pixels : 1, across = pixels > 0 ? right / pixels : 0;
            places[i] = ground.at(arc * (sine * along + cosine * across), arc * (cosine * along - sine * across));
        }
    };
    return grid;
}

}  // namespace

void write_scope(const RunResult& run, OutputFile& file, const RasterFormat& format) {
    const Picture& picture = run.scope;
    const Frame& frame = picture.frame;
    if (frame.width < 1 || frame.height < 1 ||
        picture.grey.size() != static_cast<std::size_t>(frame.width * frame.height))
        throw Error(text("output '", file.final_path(), "': the run holds no scope picture"));
    const ResolvedScene& scene = run.scene;
    const DisplayParams& display = scene.scene.display;

    RasterContent content;
    content.columns = frame.width;
    content.rows = frame.height;
    content.type = GDT_Byte;
    content.threads = run.report.threads;
    content.bands.push_back({picture.grey.data(), "scope", "", {}, {}});
    std::vector<std::uint8_t> alpha;
    if (display.alpha) {
        alpha.resize(picture.state.size());
        std::transform(picture.state.begin(), picture.state.end(), alpha.begin(), [](std::uint8_t state) {
            return static_cast<std::uint8_t>(state == static_cast<std::uint8_t>(State::no_data) ? 0 : 255);
        });
        content.bands.push_back({alpha.data(), "alpha", "", {}, {}, true});
    }
    content.metadata = scene_metadata(scene, format);
    content.metadata.emplace_back("DISPLAY", word(display.kind));
    content.metadata.emplace_back("METRES_PER_PIXEL", fifteen_digits(frame.metres_per_pixel));
    content.metadata.emplace_back("CENTRE_COLUMN", fifteen_digits(frame.centre_column));
    content.metadata.emplace_back("CENTRE_ROW", fifteen_digits(frame.centre_row));
    content.metadata.emplace_back("UP_AZIMUTH_DEG", fifteen_digits(Angle::radians(frame.up_azimuth_rad).deg()));

    const bool map = display.kind == DisplayKind::gpi || display.kind == DisplayKind::gpi_true;
    if (!map) {
        content.geolocation = tube_geolocation(run, format);
    } else if (!display.rings && !display.azimuth_marks_rad) {
        if (scene.geometry == Geometry::geodesic) {
            content.crs = crs_round_sensor(scene, "m");
            content.geotransform = affine(frame, 0, 0, 1);
        } else {
            content.crs = format.crs_wkt;
            content.geotransform = affine(frame, scene.x, scene.y, format.metres_per_unit);
        }
    }
    write_raster(content, file, format);
}

}  // namespace wedgescope
