#include "tiles/companion_files.hpp"

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <system_error>

#include "lib/lower_case.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/plain_tiff.hpp"

namespace wedgescope {
namespace {

namespace fs = std::filesystem;

bool is_file(const std::string& path) {
    std::error_code error;
    return fs::is_regular_file(path, error);
}

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
    const auto open = [&] {
        return DatasetHandle(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_VECTOR | GDAL_OF_READONLY));
    };
    register_usual_drivers();
    DatasetHandle dataset = open();
    if (!dataset) {
        register_all_drivers();
        dataset = open();
    }
    char** const list = dataset ? dataset->GetFileList() : nullptr;
    for (char** file = list; file && *file; ++file) files.emplace_back(*file);
    CSLDestroy(list);
}

struct DriverNames {
    std::string_view driver, endings;  ///< in small letters; endings between commas
    std::vector<std::string_view> for_stem;
};
const DriverNames* names_of(const std::string& driver, const std::string& ending) {
    static const std::vector<DriverNames> all{{"aaigrid", ",.asc,", {".prj"}},
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
                                              {"isis3", ",.lbl,", {".lbl", ".cub"}}};
    const auto found = std::find_if(all.begin(), all.end(), [&](const DriverNames& names) {
        if (!driver.empty()) return names.driver == driver;
        return !ending.empty() && names.endings.find("," + ending + ",") != std::string_view::npos;
    });
    return found == all.end() ? nullptr : &*found;
}

}  // namespace

std::string file_behind(const std::string& name) {
    return name.starts_with("/vsi") ? file_on_the_way(behind_prefixes(name)) : behind_subdataset(name);
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
