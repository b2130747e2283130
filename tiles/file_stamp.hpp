// FileStamp: size and time of last change of every file that a raster is made of, to tell whether it is still the same.
// For the .cpp files of this folder only.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

class GDALDataset;

namespace wedgescope {

struct FileStamp {
    std::string file;
    std::uint64_t bytes = 0;
    std::int64_t changed_s = 0, changed_ns = 0;
    friend bool operator==(const FileStamp&, const FileStamp&) = default;
};

/// The files that GDAL reads a raster from, itself first: side files, parts of a mosaic, and what is behind those parts that are
/// VRTs themselves, at any depth.
std::vector<std::string> files_behind(GDALDataset& dataset);

/// As GDAL lists the files; none where it cannot open `path` or they are no files.
std::vector<FileStamp> file_stamps(const std::string& path);

/// Of the names without their folders, sizes and times, in the order of the names: the same wherever they lie.
std::uint64_t stamps_checksum(std::vector<FileStamp> stamps);

/// Of paths, sizes and times of change of files that a raster is read from, those in archives and elsewhere as GDAL finds them:
/// changes when one of them may have changed, and is the same in another process otherwise.
std::uint64_t files_fingerprint(const std::vector<std::string>& files);

}  // namespace wedgescope
