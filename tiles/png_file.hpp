// PNG file: a grey picture, written by libpng with settings that suit what a scope shows. GDAL's driver leaves libpng to try
// five filters a row and zlib to look for repeats: twice the time, for more bytes.
// Leaves names and metadata to raster_writer.hpp.
#pragma once
#include <cstdint>
#include <span>
#include <string>

namespace wedgescope {

/// `bands`: one of grey, or grey and alpha, each [rows][columns]. IoError, which names the output as `final_path`.
void write_png(const std::string& path, std::int64_t columns, std::int64_t rows,
               std::span<const std::uint8_t* const> bands, const std::string& final_path);

}  // namespace wedgescope
