#include "tiles/driver_trial.hpp"

#include <cpl_vsi.h>

#include <filesystem>

#include "lib/error.hpp"
#include "tiles/raster_dataset.hpp"
#include "tiles/raster_driver.hpp"

namespace wedgescope {
namespace {

[[noreturn]] void refuse_lost(GDALDriver& driver, const std::string& final_path) {
    const std::string own = std::filesystem::path(final_path).extension().string();
    std::string others;
    const char* const known = driver.GetMetadataItem(GDAL_DMD_EXTENSIONS);
    const CPLStringList endings(CSLTokenizeString(known ? known : ""));
    for (int i = 0; i < endings.size(); ++i)
        if (const std::string one = text(".", endings[i]); !EQUAL(one.c_str(), own.c_str())) others += one + ", ";
    throw InputError(text("output '", final_path, "': driver ", driver.GetDescription(),
                          " makes no raster that is found under this name; accepted: ", others,
                          "or another driver, such as GTiff"));
}

}  // namespace

Trial try_driver(GDALDriver& driver, const CPLStringList& options, const RasterContent& content,
                 const std::string& final_path, const std::function<bool(GDALDataset&)>& good) {
    Trial trial;
    trial.kept = !has_capability(driver, GDAL_DCAP_VIRTUALIO);
    if (trial.kept) return trial;
    // Some drivers know their files by the ending.
    const std::string path = text("/vsimem/wedgescope_trial_", reinterpret_cast<std::uintptr_t>(&content),
                                  std::filesystem::path(final_path).extension().string());
    bool lost = false;
    GdalErrors errors;
    const auto create = [&] {
        if (!has_capability(driver, GDAL_DCAP_CREATE)) return copied_dataset(driver, path, content, options);
        DatasetHandle made = created_dataset(driver, path, final_path, content, options);
        if (!made) return made;
        trial.meant_void = !set_no_data_apart(*made, content);
        write_bands(*made, content, path, path, errors);
        return made;
    };
    try {
        DatasetHandle written = create();
        if (!written && errors.failed()) {
            trial.refused = errors.reason_of_writing(path);
            // Some open their file again before they hand it out.
            lost = errors.reason().find("not recognized as a supported file format") != std::string::npos;
        }
        trial.read_back = written != nullptr;
        trial.kept = written && good(*written);
        if (written) written->FlushCache(true);
    } catch (const IoError&) {  // nor can it be written
        trial.read_back = false;
        trial.refused = errors.failed() ? errors.reason_of_writing(path) : "it is not written";
    }
    if (trial.kept) {
        const DatasetHandle back = open_dataset(path);
        trial.read_back = back != nullptr;
        lost = !back && !errors.failed();
        trial.kept = back && good(*back);
        if (back && !trial.meant_void) trial.meant_void = declares_meaning_void(*back, content);
    }
    driver.QuietDelete(path.c_str());
    // Of a file too broken for its driver to know it something is left, and the next trial may have its name.
    VSIUnlink(path.c_str());
    if (lost) refuse_lost(driver, final_path);
    return trial;
}

void check_made(const Trial& trial, GDALDriver& driver, const RasterFormat& format, const std::string& final_path) {
    if (trial.refused.empty() || format.creation.empty()) return;
    throw InputError(
        text("output '", final_path, "' cannot be made by ", driver_words(driver, format), ": ", trial.refused));
}

std::string driver_words(GDALDriver& driver, const RasterFormat& format) {
    return text("driver ", driver.GetDescription(), format.creation.empty() ? "" : " with these creation options");
}

TrialCells::TrialCells(const std::vector<std::uint8_t>& values) : cells(static_cast<std::size_t>(side * side)) {
    std::uint32_t random = 1;
    for (std::uint8_t& cell : cells) cell = values[((random = random * 1664525 + 1013904223) >> 16) % values.size()];
}

RasterContent TrialCells::content() const {
    RasterContent out;
    out.columns = out.rows = side;
    out.type = GDT_Byte;
    out.bands = {{cells.data(), "", "", {}, {}}};
    return out;
}

}  // namespace wedgescope
