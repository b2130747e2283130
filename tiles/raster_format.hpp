// Raster format: how a raster is to be written, as the user asks for it. Names no GDAL type, so that other folders can use it.
// Leaves which driver that is to raster_driver.hpp, and whether it will do to output_check.hpp.
#pragma once
#include <string>
#include <vector>

namespace wedgescope {

struct RasterFormat {
    std::string driver;                 ///< empty: from the file name's extension
    std::vector<std::string> creation;  ///< K=V
    bool reproducible = false;          ///< no driver that writes the time
    std::string version;                ///< of the program, for metadata
    std::string scene_json;             ///< SCENE_JSON
    std::string crs_wkt;                ///< DataBase::crs_wkt, for grid geometry; empty: none
    double metres_per_unit = 1;         ///< DataBase::metres_per_unit
};

}  // namespace wedgescope
