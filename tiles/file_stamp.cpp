#include "tiles/file_stamp.hpp"

#include <cpl_vsi.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>

#include "lib/lower_case.hpp"
#include "tiles/checksum.hpp"
#include "tiles/companion_files.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/plain_file.hpp"
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
    // What is in an archive has the time that was written there, often the same for all.
    if (const std::string archive = file_behind(file); !archive.empty() && ::stat(archive.c_str(), &plain) == 0)
        return FileStamp{file, static_cast<std::uint64_t>(other.st_size), plain.st_mtim.tv_sec, plain.st_mtim.tv_nsec};
    return FileStamp{file, static_cast<std::uint64_t>(other.st_size), other.st_mtim.tv_sec, other.st_mtim.tv_nsec};
}

constexpr const char* vrt_connection = "vrt://";

/// By its name or its first words.
bool may_be_vrt(const std::string& file) {
    if (file.starts_with(vrt_connection)) return true;
    if (lower_case(std::filesystem::path(file).extension().string()) == ".vrt") return true;
    return file_begin(file, 256).find("<VRTDataset") != std::string::npos;
}

bool is_vrt(GDALDataset& dataset) { return dataset.GetDriver() && EQUAL(dataset.GetDriver()->GetDescription(), "VRT"); }

using TakeFile = std::function<bool(const std::string& file)>;
bool find_file_behind(GDALDataset& dataset, std::set<std::string>& known, const TakeFile& take) {
    const std::string own = dataset.GetDescription();
    std::vector<std::string> files;
    // `vrt://FILE?options` does not list FILE itself.
    if (own.starts_with(vrt_connection)) {
        const std::size_t begin = std::strlen(vrt_connection);
        files.push_back(own.substr(begin, own.find('?') - begin));
    }
    char** const list = dataset.GetFileList();
    for (char** file = list; file && *file; ++file) files.emplace_back(*file);
    CSLDestroy(list);
    const bool vrt = is_vrt(dataset);
    for (const std::string& file : files) {
        if (!known.insert(file).second) continue;
        if (take(file)) return true;
        if (!vrt || file == own || !may_be_vrt(file)) continue;
        const DatasetHandle part = open_dataset(file);
        if (part && is_vrt(*part) && find_file_behind(*part, known, take)) return true;
    }
    return false;
}

/// Statistics and the like, which any program that shows a raster may leave there. What it says of posts stands among the facts.
bool is_told(const std::string& file) { return lower_case(file).ends_with(".aux.xml"); }

}  // namespace

bool find_file_behind(GDALDataset& dataset, const TakeFile& take) {
    GdalErrors quiet;
    std::set<std::string> known;
    return find_file_behind(dataset, known, take);
}

std::vector<std::string> files_behind(GDALDataset& dataset) {
    std::vector<std::string> found;
    std::set<std::string> known;
    const auto take = [&](const std::string& file) {
        if (known.insert(file).second) found.push_back(file);
        return false;
    };
    find_file_behind(dataset, take);
    if (!is_vrt(dataset)) return found;
    // GDAL lists parts that are files by their names, not those that a driver finds in one (NETCDF:"x.nc":z), nor what lies beside
    // a part.
    std::vector<std::string> parts = found;
    for (const std::string& part : vrt_parts(dataset.GetDescription())) {
        const std::string file = is_file(part) ? part : file_behind(part);
        if (!file.empty()) parts.push_back(file);
    }
    for (const std::string& part : parts) {
        take(part);
        const std::string stem = std::filesystem::path(part).replace_extension().string();
        for (const std::string& beside : {part + ".msk", part + ".hdr", stem + ".hdr", stem + ".ige"})
            if (is_file(beside)) take(beside);
    }
    return found;
}

std::vector<FileStamp> file_stamps(const std::vector<std::string>& files) {
    std::vector<FileStamp> found;
    for (const std::string& file : files)
        if (const auto stamp = stamp_of(file)) found.push_back(*stamp);
    return found;
}

std::vector<FileStamp> file_stamps(const std::string& path) {
    std::vector<std::string> files;
    if (PlainTiff::of("raster", path)) {
        files = PlainTiff::files(path);
    } else {
        GdalErrors quiet;
        const DatasetHandle dataset = by_usual_or_all_drivers([&] { return open_dataset(path); });
        if (dataset) files = files_behind(*dataset);
    }
    return file_stamps(files);
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

std::uint64_t raster_fingerprint(const RasterFacts& facts, const std::vector<std::string>& files) {
    Checksum sum;
    sum.add(fmt::format("{} {} {} {} {} {} {} {} {} {} {} {}", static_cast<int>(facts.type), facts.signed_byte,
                        facts.scale, facts.offset, facts.unit_m, facts.has_no_data, facts.no_data, facts.has_mask,
                        facts.corner_x, facts.corner_y, facts.step_x, facts.step_y));
    if (facts.crs) sum.add(facts.crs->wkt());
    for (const std::string& path : files) {
        if (is_told(path)) continue;
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
