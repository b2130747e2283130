// Driver trial: a small raster that a driver writes in memory and reads again. No driver says beforehand what it takes and keeps: that
// tells. For the .cpp files of this folder only. Leaves what is looked for to value_trial.hpp, place_trial.hpp and output_check.hpp.
#pragma once
#include <cpl_string.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tiles/gdal_handle.hpp"
#include "tiles/raster_content.hpp"
#include "tiles/raster_format.hpp"

namespace wedgescope {

/// What a driver did with a small raster.
struct Trial {
    bool kept = false;
    std::string refused;      ///< why it was not made, in GDAL's words; empty: it was
    bool read_back = false;   ///< it was made, and opened again
    bool meant_void = false;  ///< what means something is declared as no data
};

/// What comes back of the content goes to `good`, once as it was written and, if that will do, once as it is opened again. Kept too where
/// a driver cannot write in memory. InputError where it writes files of other names than the one given: nobody finds a raster then.
Trial try_driver(GDALDriver& driver, const CPLStringList& options, const RasterContent& content,
                 const std::string& final_path, const std::function<bool(GDALDataset&)>& good);
/// Creation options may be at fault that a raster was not made: InputError.
void check_made(const Trial& trial, GDALDriver& driver, const RasterFormat& format, const std::string& final_path);
/// "driver ENVI", or "driver ENVI with these creation options".
std::string driver_words(GDALDriver& driver, const RasterFormat& format);

/// Does the first band, `side` x `side`, hold just these?
template <class Cell>
bool are_in_band(GDALDataset& dataset, const std::vector<Cell>& cells, GDALDataType type, int side) {
    std::vector<Cell> back(cells.size());
    return dataset.GetRasterXSize() == side && dataset.GetRasterYSize() == side &&
           dataset.GetRasterBand(1)->RasterIO(GF_Read, 0, 0, side, side, back.data(), side, side, type, 0, 0,
                                              nullptr) == CE_None &&
           back == cells;
}

/// A trial's bytes: these values by lot, neighbours as unlike as they may be.
struct TrialCells {
    static constexpr int side = 64;
    std::vector<std::uint8_t> cells;
    explicit TrialCells(const std::vector<std::uint8_t>& values);
    RasterContent content() const;  ///< which refers to `cells`
    bool are_in(GDALDataset& dataset) const { return are_in_band(dataset, cells, GDT_Byte, side); }
};

}  // namespace wedgescope
