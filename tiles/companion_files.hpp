// Companion files: what a raster or a vector file is made of beside the name by which it is given, and what drivers write beside
// a raster. Leaves what may replace what to tools/run_files.hpp.
#pragma once
#include <string>
#include <vector>

namespace wedgescope {

/// A plain file on disk, or a link to one.
bool is_file(const std::string& path);

/// Files on disk that an input is made of: the archive behind a /vsi path, the file behind a subdataset's name, and what its
/// driver lists (a shapefile's .dbf, a .hdr, a .tfw, overviews). GDAL is not asked about a GeoTIFF that is read without it,
/// nor about a folder or a pipe. Of what cannot be opened, those that its name tells.
std::vector<std::string> files_of_input(const std::string& path);

/// Files that a VRT is made of, and those that these are made of, by their own words, which take no GDAL; none of what is
/// no VRT.
std::vector<std::string> vrt_parts(const std::string& path);

/// The file on disk that a name which is no file's leads to, by its words alone: an archive, the file of a subdataset; empty: none.
std::string file_behind(const std::string& name);

/// Names that a raster's driver may write to beside it, whether they stand or not. `driver`: GDAL's name; empty: by the ending.
std::vector<std::string> names_beside_raster(const std::string& path, const std::string& driver);

}  // namespace wedgescope
