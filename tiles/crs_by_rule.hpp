// What PROJ would answer of the CRS that most data bases come in, told by rule: so that a run over such a raster needs
// neither PROJ nor its data base. For the .cpp files of this folder only. Leaves every other CRS to crs.cpp.
#pragma once
#include <optional>

#include "tiles/crs.hpp"

namespace wedgescope {

/// EPSG's code of WGS84 in degrees.
inline constexpr int wgs84_code = 4326;

/// Of EPSG's code: WGS84 in degrees (4326) and its UTM zones (32601..32660 north, 32701..32760 south); nothing of another.
/// But for the area of use and the datum's realisations, which no coordinate hangs on, as PROJ's data base has them.
std::optional<CrsFacts> facts_by_rule(int epsg);

}  // namespace wedgescope
