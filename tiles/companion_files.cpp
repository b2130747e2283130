#include "tiles/companion_files.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "lib/lower_case.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/plain_tiff.hpp"

namespace wedgescope {
namespace {

namespace fs = std::filesystem;

/// The first file that a path leads through: an archive's of a path in it.
std::string file_on_the_way(const std::string& path) {
    for (std::size_t end = 0; end != std::string::npos;) {
        end = path.find('/', end + 1);
        if (std::string front = path.substr(0, end); is_file(front)) return front;
    }
    return {};
}

/// /vsizip/a.zip/b.hgt, /vsizip/{a.zip}/b.hgt, /vsizip//vsitar/a.tar/..., /vsisubfile/0_100,a.tif
std::string behind_prefixes(std::string path) {
    while (path.starts_with("/vsi")) {
        const bool part = path.starts_with("/vsisubfile/");
        const std::size_t slash = path.find(part ? ',' : '/', 1);
        if (slash == std::string::npos) break;
        path.erase(0, slash + 1);
        std::erase_if(path, [](char c) { return c == '{' || c == '}'; });
    }
    return path;
}

/// NETCDF:"a.nc":band, HDF5:a.h5://band, GTIFF_DIR:2:a.tif
std::string behind_subdataset(const std::string& path) {
    std::vector<std::size_t> colons;
    for (std::size_t at = 0; (at = path.find(':', at)) != std::string::npos; ++at) colons.push_back(at);
    colons.push_back(path.size());
    for (std::size_t i = 0; i + 1 < colons.size(); ++i)
        for (std::size_t j = colons.size(); --j > i;) {
            std::string between = path.substr(colons[i] + 1, colons[j] - colons[i] - 1);
            std::erase(between, '"');
            if (std::string file = file_on_the_way(behind_prefixes(between)); !file.empty()) return file;
        }
    return {};
}

void add_listed(const std::string& path, std::vector<std::string>& files) {
    GdalErrors quiet;
    const DatasetHandle dataset = by_usual_or_all_drivers([&] {
        return DatasetHandle(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_VECTOR | GDAL_OF_READONLY));
    });
    char** const list = dataset ? dataset->GetFileList() : nullptr;
    for (char** file = list; file && *file; ++file) files.emplace_back(*file);
    CSLDestroy(list);
}

struct DriverNames {
    std::string_view driver, endings;  ///< in small letters; endings between commas
    std::vector<std::string_view> for_stem;
};
const DriverNames* names_of(const std::string& driver, const std::string& ending) {
    static const std::vector<DriverNames> all{
        {"aaigrid", ",.asc,", {".prj"}},
        {"hfa", ",.img,", {".ige", ".rde", ".rrd"}},
        {"envi", "", {".hdr"}},
        {"ehdr", ",.bil,", {".hdr", ".prj", ".clr", ".stx"}},
        {"saga", ",.sdat,.sg-grd-z,", {".sgrd", ".sdat", ".prj", ".mgrd"}},
        {"rst", ",.rst,", {".rdc", ".ref", ".smp"}},
        {"ers", ",.ers,", {".ers", ""}},
        {"ilwis", ",.mpr,.mpl,", {".mpr", ".mp#", ".grf", ".csy"}},
        {"mff", "", {".hdr", ".b00"}},
        {"rraster", ",.grd,", {".grd", ".gri"}},
        {"isis2", "", {".lbl"}},
        {"pds4", "", {".img"}},
        {"mrf", ",.mrf,", {".idx", ".ppg", ".pjg", ".ptf", ".til", ".tst", ".pzp", ".lrc", ".zst"}},
        {"isis3", ",.lbl,", {".lbl", ".cub"}}};
    const auto found = std::find_if(all.begin(), all.end(), [&](const DriverNames& names) {
        if (!driver.empty()) return names.driver == driver;
        return !ending.empty() && names.endings.find("," + ending + ",") != std::string_view::npos;
    });
    return found == all.end() ? nullptr : &*found;
}

/// A value of XML without its entities.
std::string plain_words(std::string words) {
    const std::pair<std::string_view, std::string_view> entities[] = {
        {"&lt;", "<"}, {"&gt;", ">"}, {"&quot;", "\""}, {"&apos;", "'"}, {"&amp;", "&"}};
    for (const auto& [entity, sign] : entities)
        for (std::size_t at = 0; (at = words.find(entity, at)) != std::string::npos; at += sign.size())
            words.replace(at, entity.size(), sign);
    return words;
}

/// Of a VRT its whole text; empty: it is none.
std::string vrt_text(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    std::string words(1024, '\0');
    in.read(words.data(), static_cast<std::streamsize>(words.size()));
    words.resize(static_cast<std::size_t>(in.gcount()));
    if (words.find("<VRTDataset") == std::string::npos) return {};
    words.append(std::istreambuf_iterator<char>(in), {});
    return words;
}

void add_vrt_parts(const std::string& path, std::set<std::string>& looked_into, std::vector<std::string>& parts) {
    std::error_code error;
    if (!is_file(path) || !looked_into.insert(fs::weakly_canonical(path, error).string()).second) return;
    const std::string words = vrt_text(path);
    for (const std::string_view tag : {"<SourceFilename", "<SourceDataset"})
        for (std::size_t at = 0; (at = words.find(tag, at)) != std::string::npos; at += tag.size()) {
            const std::size_t begin = words.find('>', at), end = words.find('<', begin);
            if (end == std::string::npos) break;
            const bool beside = words.substr(at, begin - at).find("relativeToVRT=\"1\"") != std::string::npos;
            const fs::path part = plain_words(words.substr(begin + 1, end - begin - 1));
            parts.push_back(beside ? fs::path(path).parent_path() / part : part);
            add_vrt_parts(std::string(parts.back()), looked_into, parts);
        }
}

}  // namespace

bool is_file(const std::string& path) {
    std::error_code error;
    return fs::is_regular_file(path, error);
}

std::string file_behind(const std::string& name) {
    return name.starts_with("/vsi") ? file_on_the_way(behind_prefixes(name)) : behind_subdataset(name);
}

std::vector<std::string> vrt_parts(const std::string& path) {
    std::set<std::string> looked_into;
    std::vector<std::string> parts;
    add_vrt_parts(path, looked_into, parts);
    return parts;
}

std::vector<std::string> files_of_input(const std::string& path) {
    std::vector<std::string> files;
    const bool named = is_file(path);
    // To open a pipe would take what is in it.
    if (std::error_code error; !named && fs::exists(path, error)) return files;
    if (!named)
        if (const std::string file = file_behind(path); !file.empty()) files.push_back(file);
    const std::string stem = fs::path(path).replace_extension().string();
    for (const char* more : {".aux.xml", ".aux", ".ovr", ".msk", ".msk.ovr", ".geoloc.tif"})
        files.push_back(path + more);
    for (const char* more : {".aux", ".tfw", ".tifw", ".tiffw", ".wld"}) files.push_back(stem + more);
    if (!named || !PlainTiff::of("raster", path)) add_listed(path, files);
    std::erase_if(files, [](const std::string& file) { return !is_file(file); });
    return files;
}

std::vector<std::string> names_beside_raster(const std::string& path, const std::string& driver) {
    const std::string stem = fs::path(path).replace_extension().string();
    std::vector<std::string> names{path + ".aux.xml", path + ".geoloc.tif"};
    const DriverNames* known = names_of(lower_case(driver), lower_case(fs::path(path).extension().string()));
    if (!known) return names;
    for (const std::string_view more : known->for_stem) names.push_back(stem + std::string(more));
    if (known->driver == "envi") names.push_back(path + ".hdr");
    return names;
}

}  // namespace wedgescope
