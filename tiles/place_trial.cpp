#include "tiles/place_trial.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "lib/error.hpp"
#include "tiles/driver_trial.hpp"
#include "tiles/raster_driver.hpp"

namespace wedgescope {
namespace {

enum class PlaceBack { kept, lost, elsewhere };

/// Of the first cell and behind the last one.
using Corners = std::array<std::array<double, 2>, 2>;

Corners corners(const std::array<double, 6>& place, int side) {
    const auto at = [&](double n) {
        return std::array{place[0] + n * (place[1] + place[2]), place[3] + n * (place[4] + place[5])};
    };
    return {at(0), at(side)};
}

/// Within half a post: what digits of a text lose does not show.
bool lie_together(const Corners& own, const Corners& meant, int side) {
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const double half_post = 0.5 * std::abs(meant[1][axis] - meant[0][axis]) / side;
        for (std::size_t i = 0; i < 2; ++i)
            if (!(std::abs(own[i][axis] - meant[i][axis]) <= half_post)) return false;
    }
    return true;
}

/// Longitudes and latitudes of the CRS's own datum.
bool to_degrees(const OGRSpatialReference& crs, Corners& corners) {
    OGRSpatialReference from(crs);
    const std::unique_ptr<OGRSpatialReference> to(from.CloneGeogCS());
    if (!to) return false;
    for (OGRSpatialReference* one : {&from, to.get()}) one->SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    const std::unique_ptr<OGRCoordinateTransformation> way(OGRCreateCoordinateTransformation(&from, to.get()));
    return way && std::all_of(corners.begin(), corners.end(),
                              [&](auto& corner) { return way->Transform(1, &corner[0], &corner[1]) != 0; });
}

/// Of a raster of trial cells: do these lie where they should, rows turned with their place or not, in another CRS or not?
PlaceBack place_of(GDALDataset& dataset, const RasterContent& wanted, const std::vector<std::uint8_t>& cells) {
    constexpr int side = TrialCells::side;
    std::array<double, 6> found{};
    const std::array<double, 6> none{0, 1, 0, 0, 0, 1};
    if (dataset.GetGeoTransform(found.data()) != CE_None || found == none) return PlaceBack::lost;
    std::array<double, 6> place = *wanted.geotransform;
    std::vector<std::uint8_t> turned;
    for (int row = side; row-- > 0;)
        turned.insert(turned.end(), cells.begin() + row * side, cells.begin() + (row + 1) * side);
    if (!are_in_band(dataset, cells, GDT_Byte, side) && are_in_band(dataset, turned, GDT_Byte, side)) {
        place[3] += side * place[5];
        place[5] = -place[5];
    }
    Corners own = corners(found, side), meant = corners(place, side);
    if (lie_together(own, meant, side)) return PlaceBack::kept;
    // Some write in a CRS of their own.
    const OGRSpatialReference* const crs = dataset.GetSpatialRef();
    OGRSpatialReference wanted_crs;
    if (!crs || wanted.crs.empty() || wanted_crs.importFromWkt(wanted.crs.c_str()) != OGRERR_NONE ||
        !to_degrees(*crs, own) || !to_degrees(wanted_crs, meant))
        return PlaceBack::elsewhere;
    return lie_together(own, meant, side) ? PlaceBack::kept : PlaceBack::elsewhere;
}

}  // namespace

std::string place_losses(const RasterContent& wanted, const OutputFile& file, const RasterFormat& format) {
    const std::string& final_path = file.final_path();
    if (!wanted.geotransform || is_usual_geotiff(final_path, format)) return {};
    GDALDriver& driver = driver_for(final_path, wanted.type, format);
    const TrialCells trial({3, 200});
    std::vector<std::uint64_t> cells(trial.cells.size());  // of the widest type
    GDALCopyWords64(trial.cells.data(), GDT_Byte, 1, cells.data(), wanted.type, GDALGetDataTypeSizeBytes(wanted.type),
                    static_cast<GPtrDiff_t>(trial.cells.size()));
    RasterContent content = trial.content();
    content.type = wanted.type;
    content.bands[0].cells = cells.data();
    content.crs = wanted.crs;
    content.geotransform = wanted.geotransform;
    PlaceBack place = PlaceBack::kept;
    bool crs = true;
    const Trial tried =
        try_driver(driver, creation_options(driver, wanted.type, {}, format), content, final_path, [&](GDALDataset& d) {
            place = place_of(d, wanted, trial.cells);
            crs = wanted.crs.empty() || d.GetSpatialRef();
            return true;
        });
    if (!tried.read_back) return {};  // makes no file in memory
    const std::string by = driver_words(driver, format);
    if (place == PlaceBack::elsewhere)
        throw InputError(text("output '", final_path, "' would lie elsewhere than the terrain",
                              (*wanted.geotransform)[5] > 0 ? ", whose rows run north" : "", ": ", by,
                              " does not keep its place; accepted: .tif, .img and others that do"));
    if (place == PlaceBack::kept && crs) return {};
    return text("is written by ", by, ", which does not keep ",
                crs                        ? "its place"
                : place == PlaceBack::kept ? "its CRS"
                                           : "its place, nor its CRS",
                "; .tif does");
}

}  // namespace wedgescope
