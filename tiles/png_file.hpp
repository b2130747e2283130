// PNG file: a grey picture, packed by zlib as suits what a scope shows, by several threads, and framed by libpng. GDAL's driver leaves
// libpng to try five filters a row and zlib to look for repeats: twice the time, for more bytes.
// Leaves names to raster_writer.hpp, and metadata to side_file.hpp.
#pragma once
#include <cstdint>
#include <span>
#include <string>

namespace wedgescope {

/// `bands`: one of grey, or grey and alpha, each [rows][columns]. The same bytes for any number of `threads`. IoError, which names
/// the output as `final_path`.
void write_png(const std::string& path, std::int64_t columns, std::int64_t rows,
               std::span<const std::uint8_t* const> bands, int threads, const std::string& final_path);

}  // namespace wedgescope
