#include "tiles/output_check.hpp"

#include <cstddef>
#include <vector>

#include "lib/error.hpp"
#include "tiles/driver_trial.hpp"
#include "tiles/raster_content.hpp"
#include "tiles/raster_driver.hpp"
#include "tiles/value_trial.hpp"

namespace wedgescope {
namespace {

void check_picture(GDALDriver& driver, const CPLStringList& options, const RasterFormat& format, bool alpha,
                   const std::string& final_path) {
    const TrialCells trial({0, 255});
    RasterContent content = trial.content();
    if (alpha) content.bands.push_back({trial.cells.data(), "", "", {}, {}, true});
    const Trial tried = try_driver(driver, options, content, final_path, [&](GDALDataset& written) {
        return written.GetRasterCount() == (alpha ? 2 : 1) &&
               (!alpha || written.GetRasterBand(2)->GetColorInterpretation() == GCI_AlphaBand);
    });
    if (tried.kept) return;
    check_made(tried, driver, format, final_path);
    if (!alpha)
        throw InputError(text("driver ", driver.GetDescription(), " of output '", final_path,
                              "' takes no grey picture; accepted: .png, .tif, .jpg, ..."));
    throw InputError(text("alpha is on, and driver ", driver.GetDescription(), " of output '", final_path,
                          "' takes no grey picture with an alpha channel; accepted: .png, .tif, ..., or alpha off"));
}

}  // namespace

void check_output(const OutputFile& file, OutputLayer layer, const RasterFormat& format) {
    const bool bytes =
        layer == OutputLayer::scope || layer == OutputLayer::masked_scope || layer == OutputLayer::states;
    const GDALDataType type = bytes ? GDT_Byte : GDT_Float32;
    if (bytes && layer != OutputLayer::states && needs_no_driver("PNG", file.final_path(), format)) return;
    GDALDriver& driver = driver_for(file.final_path(), type, format);
    const CPLStringList options = creation_options(driver, type, {}, format);
    const bool known = is_usual_geotiff(file.final_path(), format);
    if (layer == OutputLayer::states) {
        RasterContent states;
        set_states(states);
        if (!known && !keeps_codes(driver, options, format, states, file.final_path()))
            refuse_codes(driver, format, file.final_path(), "does not say whether it keeps them as they are");
    } else if (bytes && (!known || layer == OutputLayer::masked_scope)) {
        check_picture(driver, options, format, layer == OutputLayer::masked_scope, file.final_path());
    }
}

std::string power_losses(const OutputFile& file, const RasterFormat& format) {
    const std::string& final_path = file.final_path();
    if (is_usual_geotiff(final_path, format)) return {};
    GDALDriver& driver = driver_for(final_path, GDT_Float32, format);
    // Watts, and dBm: each by itself, for what rounds the small ones away may see in both together that it must not. As unlike as
    // neighbours may be.
    constexpr int side = 64;
    bool values = true, words = true;  // are kept, by what was closed and opened again
    for (const float step : {1.1e-17F, -0.0301F}) {
        std::vector<float> cells(static_cast<std::size_t>(side * side));
        for (std::size_t i = 0; i < cells.size(); ++i) cells[i] = step * static_cast<float>(i * 1009 % cells.size());
        RasterContent content;
        content.columns = content.rows = side;
        content.bands = {{cells.data(), "power", "W", {}, {}}};
        content.metadata = {{"SCENE_JSON", R"({"trial": "with 'quotes' = and; others"})"}};
        bool same = true;
        const Trial tried = try_driver(driver, creation_options(driver, GDT_Float32, {}, format), content, final_path,
                                       [&](GDALDataset& d) {
                                           same = are_in_band(d, cells, GDT_Float32, side);
                                           const auto& [key, value] = content.metadata.front();
                                           const char* const said = d.GetMetadataItem(key.c_str());
                                           words = said && value == said;
                                           return true;
                                       });
        values &= same;
        check_made(tried, driver, format, final_path);
        if (!tried.kept || !has_capability(driver, GDAL_DCAP_VIRTUALIO))  // makes no file in memory
            return text("is written by driver ", driver.GetDescription(),
                        ", which may not keep its values, its place and what the image tells of its scene; .tif does");
    }
    if (values && words) return {};
    return text("is written by ", driver_words(driver, format), ", which does not keep ",
                values  ? "what the image tells of its scene"
                : words ? "its values as they are"
                        : "its values as they are, nor what the image tells of its scene",
                "; .tif does");
}

}  // namespace wedgescope
