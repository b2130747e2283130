// Output check: before there is anything to write, whether a layer could be written so, and what of it would be lost.
// Leaves an echo image's values to echo_file.hpp, and coverage to coverage_raster.hpp, which checks as it makes the file.
#pragma once
#include <string>

#include "tiles/output_file.hpp"
#include "tiles/raster_format.hpp"

namespace wedgescope {

enum class OutputLayer { scope, masked_scope, echo, power, states };
/// InputError where a layer could not be written so: driver, extension, type of values, creation option, a picture in grey, with an
/// alpha channel if it is a masked scope, or codes (states) that a driver with loss would change.
void check_output(const OutputFile& file, OutputLayer layer, const RasterFormat& format);

/// What a power image would not keep in such a file, in words that go on from its name; empty: nothing. InputError where GDAL
/// refuses the creation options.
std::string power_losses(const OutputFile& file, const RasterFormat& format);

}  // namespace wedgescope
