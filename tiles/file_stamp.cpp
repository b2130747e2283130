#include "tiles/file_stamp.hpp"

#include <cpl_vsi.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "tiles/checksum.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/tiff_layer.hpp"

namespace wedgescope {

std::vector<FileStamp> file_stamps(const std::string& path) {
    std::vector<std::string> files;
    if (reads_without_gdal(path)) {
        files.push_back(path);
    } else {
        GdalErrors quiet;
        const DatasetHandle dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY));
        if (dataset) {
            char** list = dataset->GetFileList();
            for (char** f = list; f && *f; ++f) files.emplace_back(*f);
            CSLDestroy(list);
        }
    }
    std::vector<FileStamp> found;
    for (const std::string& file : files) {
        struct stat plain {};
        if (::stat(file.c_str(), &plain) == 0) {
            found.push_back(
                {file, static_cast<std::uint64_t>(plain.st_size), plain.st_mtim.tv_sec, plain.st_mtim.tv_nsec});
            continue;
        }
        VSIStatBufL facts{};
        if (VSIStatExL(file.c_str(), &facts, VSI_STAT_EXISTS_FLAG | VSI_STAT_SIZE_FLAG) != 0) continue;
        found.push_back({file, static_cast<std::uint64_t>(facts.st_size), facts.st_mtim.tv_sec, facts.st_mtim.tv_nsec});
    }
    return found;
}

std::uint64_t stamps_checksum(std::vector<FileStamp> stamps) {
    for (FileStamp& s : stamps) s.file = std::filesystem::path(s.file).filename().string();
    std::sort(stamps.begin(), stamps.end(), [](const auto& a, const auto& b) { return a.file < b.file; });
    Checksum sum;
    for (const FileStamp& s : stamps) {
        sum.add(s.file);
        sum.add(s.bytes);
        sum.add(static_cast<std::uint64_t>(s.changed_s));
        sum.add(static_cast<std::uint64_t>(s.changed_ns));
    }
    return sum.value();
}

std::uint64_t files_fingerprint(const std::vector<std::string>& files) {
    Checksum sum;
    for (const std::string& path : files) {
        struct stat plain {};
        VSIStatBufL other{};
        if (::stat(path.c_str(), &plain) == 0) {
            // The same file from any folder.
            std::error_code error;
            sum.add(std::filesystem::absolute(path, error).lexically_normal().string());
            sum.add(static_cast<std::uint64_t>(plain.st_size));
            sum.add(static_cast<std::uint64_t>(plain.st_mtim.tv_sec));
            sum.add(static_cast<std::uint64_t>(plain.st_mtim.tv_nsec));
        } else if (VSIStatExL(path.c_str(), &other, VSI_STAT_EXISTS_FLAG | VSI_STAT_SIZE_FLAG) == 0) {  // /vsizip/ ...
            sum.add(path);
            sum.add(static_cast<std::uint64_t>(other.st_size));
            sum.add(static_cast<std::uint64_t>(other.st_mtime));
        } else {
            sum.add(path + " is gone");
        }
    }
    return sum.value();
}

}  // namespace wedgescope
