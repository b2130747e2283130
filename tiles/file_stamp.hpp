// FileStamp: size and time of last change of every file that a raster is made of, to tell whether it is still the same.
// For the .cpp files of this folder only.
#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tiles/raster_layer.hpp"

class GDALDataset;

namespace wedgescope {

struct FileStamp {
    std::string file;
    std::uint64_t bytes = 0;
    std::int64_t changed_s = 0, changed_ns = 0;
    friend bool operator==(const FileStamp&, const FileStamp&) = default;
};

/// Takes the files that GDAL reads a raster from, itself first: side files, parts of a mosaic, each followed by what is behind it if
/// it is a VRT itself, at any depth. Until `take` returns true; then so does this.
bool find_file_behind(GDALDataset& dataset, const std::function<bool(const std::string& file)>& take);
/// All of them.
std::vector<std::string> files_behind(GDALDataset& dataset);

/// Of those that are files, in a folder or where else GDAL looks.
std::vector<FileStamp> file_stamps(const std::vector<std::string>& files);
/// As GDAL lists the files of a raster; none where it cannot open `path`.
std::vector<FileStamp> file_stamps(const std::string& path);

/// Of the names without their folders, sizes and times, in the order of the names: the same wherever they lie.
std::uint64_t stamps_checksum(std::vector<FileStamp> stamps);

/// Of what is known of a raster, and of paths, sizes and times of change of the files that its posts are read from, those in archives
/// and elsewhere as GDAL finds them: changes when a post or its place may have changed, and is the same in another process otherwise.
/// Statistics that a program leaves beside it (`.aux.xml`) change nothing.
std::uint64_t raster_fingerprint(const RasterFacts& facts, const std::vector<std::string>& files);

}  // namespace wedgescope
