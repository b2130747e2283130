// Raster metadata: what every output tells of the program and its scene. Leaves what one kind tells besides to polar_raster.hpp,
// picture.hpp and coverage_raster.hpp.
#pragma once
#include <string>
#include <utility>
#include <vector>

namespace wedgescope {

struct RasterFormat;
struct ResolvedScene;

using Metadata = std::vector<std::pair<std::string, std::string>>;

/// At most 15 significant digits, as metadata have them.
std::string fifteen_digits(double value);

/// Version and scene: what every output tells.
Metadata run_metadata(const RasterFormat& format);
/// And of one sensor where it stands.
Metadata scene_metadata(const ResolvedScene& scene, const RasterFormat& format);

}  // namespace wedgescope
