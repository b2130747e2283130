// AttributeTable: the legend that a culture raster carries itself, as GDAL's raster attribute table.
// Leaves other legends to lib/material.hpp.
#pragma once
#include <string>

#include "lib/material.hpp"

namespace wedgescope {

/// The table of the raster's first band: codes from the column of usage MinMax (else one called value, code or pixel value;
/// else those of usages Min and Max: all whole numbers from one to the other), names from the column of usage Name (else one
/// called class name, class, material, name or label), in any case of letters. A row without a name names nothing; a code may
/// stand twice with one name. The legend is called "rat". IoError; InputError naming raster and row where there is no table, no
/// such column, or a name that is no material.
Legend attribute_table_legend(const std::string& path, const Materials& materials);

}  // namespace wedgescope
