#include "tiles/file_stamp.hpp"

#include <cpl_vsi.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>

#include "lib/lower_case.hpp"
#include "tiles/checksum.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/plain_tiff.hpp"

namespace wedgescope {
namespace {

/// Nothing if there is no such file, in a folder or where else GDAL looks: /vsizip/ ...
std::optional<FileStamp> stamp_of(const std::string& file) {
    // Of the packed file: GDAL says another size of what is in it once it has read it through.
    if (const std::string_view packed = "/vsigzip/"; file.starts_with(packed)) {
        auto stamp = stamp_of(file.substr(packed.size()));
        if (stamp) stamp->file = file;
        return stamp;
    }
    struct stat plain {};
    if (::stat(file.c_str(), &plain) == 0)
        return FileStamp{file, static_cast<std::uint64_t>(plain.st_size), plain.st_mtim.tv_sec, plain.st_mtim.tv_nsec};
    VSIStatBufL other{};
    if (VSIStatExL(file.c_str(), &other, VSI_STAT_EXISTS_FLAG | VSI_STAT_SIZE_FLAG) != 0) return std::nullopt;
    return FileStamp{file, static_cast<std::uint64_t>(other.st_size), other.st_mtim.tv_sec, other.st_mtim.tv_nsec};
}

bool may_be_vrt(const std::string& file) {
    if (lower_case(std::filesystem::path(file).extension().string()) == ".vrt") return true;
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) return false;
    std::string begin(256, '\0');
    std::ifstream in(file, std::ios::binary);
    in.read(begin.data(), static_cast<std::streamsize>(begin.size()));
    return begin.find("<VRTDataset") != std::string::npos;
}

}  // namespace

std::vector<std::string> files_behind(GDALDataset& dataset) {
    std::vector<std::string> found;
    std::set<std::string> known;
    const auto add = [&](GDALDataset& of) {
        char** const list = of.GetFileList();
        for (char** file = list; file && *file; ++file)
            if (known.insert(*file).second) found.emplace_back(*file);
        CSLDestroy(list);
    };
    add(dataset);
    if (!dataset.GetDriver() || !EQUAL(dataset.GetDriver()->GetDescription(), "VRT")) return found;
    GdalErrors quiet;
    for (std::size_t i = 1; i < found.size(); ++i)  // it grows
        if (may_be_vrt(found[i]))
            if (const DatasetHandle part(GDALDataset::Open(found[i].c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY)); part)
                add(*part);
    return found;
}

std::vector<FileStamp> file_stamps(const std::string& path) {
    std::vector<std::string> files;
    if (PlainTiff::of("raster", path)) {
        files = PlainTiff::files(path);
    } else {
        GdalErrors quiet;
        const DatasetHandle dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY));
        if (dataset) files = files_behind(*dataset);
    }
    std::vector<FileStamp> found;
    for (const std::string& file : files)
        if (const auto stamp = stamp_of(file)) found.push_back(*stamp);
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
        const auto stamp = stamp_of(path);
        if (!stamp) {
            sum.add(path + " is gone");
            continue;
        }
        // The same file from any folder.
        std::error_code error;
        const bool elsewhere = path.starts_with("/vsi");
        sum.add(elsewhere ? path : std::filesystem::absolute(path, error).lexically_normal().string());
        sum.add(stamp->bytes);
        sum.add(static_cast<std::uint64_t>(stamp->changed_s));
        sum.add(static_cast<std::uint64_t>(stamp->changed_ns));
    }
    return sum.value();
}

}  // namespace wedgescope
