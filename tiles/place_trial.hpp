// Place trial: does a driver put a raster where it should lie? For the .cpp files of this folder only. Leaves its values to
// value_trial.hpp.
#pragma once
#include <string>

#include "tiles/output_file.hpp"
#include "tiles/raster_content.hpp"
#include "tiles/raster_format.hpp"

namespace wedgescope {

/// What of its place such a raster would not keep, in words that go on from its name; empty: nothing, or nobody can say. InputError
/// where it would lie elsewhere.
std::string place_losses(const RasterContent& content, const OutputFile& file, const RasterFormat& format);

}  // namespace wedgescope
