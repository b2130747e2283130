// Side file: what a raster's own format cannot hold, in the .aux.xml beside it, as GDAL keeps and reads it. For pictures that
// are written without GDAL. For the .cpp files of this folder only. Leaves what is said to raster_content.hpp.
#pragma once
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace wedgescope {

struct RasterContent;

/// Words as text of XML, or (`quoted`) as the value of an attribute.
std::string xml_words(std::string_view words, bool quoted = false);

/// To `path` + ".aux.xml"; `geolocation`: items of that domain. IoError, which names the output as `final_path`.
void write_side_file(const RasterContent& content, const std::vector<std::pair<std::string, std::string>>& geolocation,
                     const std::string& path, const std::string& final_path);

}  // namespace wedgescope
