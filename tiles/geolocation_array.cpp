#include "tiles/geolocation_array.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <vector>

#include "lib/error.hpp"
#include "lib/threads.hpp"
#include "tiles/raster_dataset.hpp"
#include "tiles/raster_driver.hpp"

namespace wedgescope {
namespace {

constexpr double no_place = -1e30;  ///< no-data value of geolocation arrays

}  // namespace

GeolocationGrid geolocation_grid(std::int64_t columns, std::int64_t rows, std::int64_t column_step,
                                 std::int64_t row_step) {
    GeolocationGrid grid;
    grid.column_step = std::clamp<std::int64_t>(column_step, 1, columns);
    grid.row_step = std::clamp<std::int64_t>(row_step, 1, rows);
    grid.columns = (columns + grid.column_step - 1) / grid.column_step + 1;
    grid.rows = (rows + grid.row_step - 1) / grid.row_step + 1;
    return grid;
}

void write_geolocation(const GeolocationGrid& grid, const std::string& path, const std::string& final_path) {
    // Round a full circle one row without places in front and behind: else GDAL goes on past the ends, over the rows
    // of the other end.
    const std::int64_t margin = grid.closed ? 1 : 0, rows = grid.rows + 2 * margin;
    std::vector<double> x(static_cast<std::size_t>(grid.columns * rows), no_place), y = x;
    const auto columns = static_cast<std::size_t>(grid.columns);
    constexpr std::int64_t a_piece = 1 << 15;  // places, a millisecond; fewer are not worth another thread
    const std::int64_t rows_a_piece = std::max<std::int64_t>(16, a_piece / grid.columns);
    Threads(at_hand(grid.threads), false).execute([&] {
        tbb::parallel_for(tbb::blocked_range<std::int64_t>(0, grid.rows, rows_a_piece), [&](const auto& some) {
            std::vector<Place> places(columns);
            for (std::int64_t j = some.begin(); j < some.end(); ++j) {
                grid.find_row(static_cast<double>(j * grid.row_step), places.data());
                const std::size_t node = static_cast<std::size_t>(j + margin) * columns;
                for (std::size_t i = 0; i < columns; ++i) {
                    x[node + i] = places[i].x;
                    y[node + i] = places[i].y;
                }
            }
        });
    });
    RasterContent content;
    content.columns = grid.columns;
    content.rows = rows;
    content.type = GDT_Float64;
    content.crs = grid.crs;
    content.bands.resize(2);
    content.bands[0] = {x.data(), "x", "", no_place, {}};
    content.bands[1] = {y.data(), "y", "", no_place, {}};
    GDALDriver& driver = *GetGDALDriverManager()->GetDriverByName("GTiff");
    CPLStringList options = creation_options(driver, GDT_Float64, {}, {});
    if (!grid.packed) {
        options.Clear();
        options.SetNameValue("INTERLEAVE", "BAND");
    }
    GdalErrors errors;
    DatasetHandle dataset(driver.Create(path.c_str(), static_cast<int>(content.columns), static_cast<int>(content.rows),
                                        2, GDT_Float64, options.List()));
    if (!dataset) fail_to_write(final_path, path, errors);
    describe_dataset(*dataset, content, {});
    write_bands(*dataset, content, final_path, path, errors);
    dataset.reset();
    if (errors.failed()) fail_to_write(final_path, path, errors);
}

Metadata geolocation_metadata(const GeolocationGrid& grid, const std::string& final_path) {
    const std::string side = std::filesystem::path(final_path).filename().string() + ".geoloc.tif";
    // By name beside the raster, wherever the two are moved together.
    Metadata items{{"X_DATASET", side},
                   {"X_DATASET_RELATIVE_TO_SOURCE", "YES"},
                   {"X_BAND", "1"},
                   {"Y_DATASET", side},
                   {"Y_DATASET_RELATIVE_TO_SOURCE", "YES"},
                   {"Y_BAND", "2"},
                   {"PIXEL_OFFSET", "0"},
                   {"LINE_OFFSET", text(grid.closed ? -grid.row_step : 0)},
                   {"PIXEL_STEP", text(grid.column_step)},
                   {"LINE_STEP", text(grid.row_step)},
                   {"GEOREFERENCING_CONVENTION", "TOP_LEFT_CORNER"}};
    OGRSpatialReference crs;
    GdalErrors quiet;
    if (grid.crs.empty())
        crs.SetLocalCS("grid");
    else if (crs.SetFromUserInput(grid.crs.c_str()) != OGRERR_NONE)
        throw IoError(text("output '", final_path, "': its CRS is not known to PROJ (", quiet.reason(), ")"));
    char* wkt = nullptr;
    if (crs.exportToWkt(&wkt) == OGRERR_NONE && wkt) items.emplace_back("SRS", wkt);
    CPLFree(wkt);
    return items;
}

}  // namespace wedgescope
