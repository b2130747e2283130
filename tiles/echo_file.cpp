#include "tiles/echo_file.hpp"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <vector>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/raster_driver.hpp"

namespace wedgescope {
namespace {

std::string named(const std::string& path) { return text("echo image '", path, "'"); }

constexpr const char* wanted = "; a file that simulate --echo has written is needed";

DatasetHandle opened(const std::string& path, int threads, GdalErrors& errors) {
    if (std::error_code ignored; std::filesystem::is_fifo(path, ignored))  // opened again it would be waited for
        throw IoError(text(named(path), " is a pipe", wanted));
    // Packed tiles are decoded side by side; drivers that cannot do so warn at the most.
    const std::string together = "NUM_THREADS=" + (threads > 0 ? std::to_string(threads) : "ALL_CPUS");
    const char* const options[] = {together.c_str(), nullptr};
    DatasetHandle dataset = by_usual_or_all_drivers([&] {
        return DatasetHandle(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR,
                                               nullptr, options));
    });
    if (!dataset) throw IoError(text(named(path), " cannot be opened: ", errors.reason_beside(path)));
    return dataset;
}

}  // namespace

std::uint64_t echo_checksum(const PolarImage<float>& echo_w, const PolarImage<std::uint8_t>& state,
                            std::string_view said) {
    Checksum sum;
    sum.add(echo_w.cells.data(), echo_w.cells.size() * sizeof(float));
    sum.add(state.cells.data(), state.cells.size());
    sum.add(said.data(), said.size());
    return sum.value();
}

struct EchoFile::Dataset {
    DatasetHandle handle;
};

EchoFile::EchoFile(const std::string& path, int threads) : path_(path) {
    GdalErrors errors;
    dataset_ = std::make_unique<Dataset>(Dataset{opened(path, threads, errors)});
    GDALDataset& file = *dataset_->handle;
    const char* json = file.GetMetadataItem("SCENE_JSON");
    if (!json) throw DataError(text(named(path), " holds no SCENE_JSON", wanted));
    scene_json_ = json;
    const auto is = [&](int band, const char* name) {
        return file.GetRasterCount() >= band && std::string(file.GetRasterBand(band)->GetDescription()) == name &&
               file.GetRasterBand(band)->GetRasterDataType() == GDT_Float32;
    };
    if (file.GetRasterCount() != 2 || !is(1, "echo") || !is(2, "state")) {
        const std::string first = file.GetRasterCount() > 0 ? file.GetRasterBand(1)->GetDescription() : "";
        throw DataError(text(named(path), " is none: its bands are not echo and state as 32-bit floats, but ",
                             file.GetRasterCount(), ", the first '", first, "'", wanted));
    }
}

EchoFile::~EchoFile() = default;

void check_echo_format(const OutputFile& file, RasterFormat format) {
    namespace fs = std::filesystem;
    const fs::path path = file.final_path();
    if (is_usual_geotiff(file.final_path(), format)) return;
    RunResult run;
    run.scene.swept = run.scene.shown = PolarGrid{8, 100, {0, 8}, {0, 4}};
    run.scene.scene.geometry = Geometry::grid;
    run.echo_w = PolarImage<float>(run.scene.swept);
    run.echo_state = PolarImage<std::uint8_t>(run.scene.swept);
    for (std::size_t i = 0; i < run.echo_w.cells.size(); ++i) {
        run.echo_w.cells[i] = 1.1e-17F * static_cast<float>(i);
        run.echo_state.cells[i] = static_cast<std::uint8_t>(i % state_count);
    }
    const std::string said = R"({"trial": "of a format, with 'quotes' = and; others"})";
    const std::uint64_t sum = echo_checksum(run.echo_w, run.echo_state, said);
    format.scene_json = said;
    std::string why = "numbers, names or metadata are lost";
    try {
        const std::string name = path.filename().string();
        constexpr std::size_t long_name = 200;
        OutputFile trial(
            (path.parent_path() / ("trial_of_" + (name.size() < long_name ? name : "it" + path.extension().string())))
                .string(),
            true);
        write_echo(run, trial, format);
        const EchoFile back(trial.temporary_path(), 1);
        if (back.scene_json() == said && back.columns() == 4 && back.rows() == 8) {
            PolarImage<float> echo_w(run.scene.swept);
            PolarImage<std::uint8_t> state(run.scene.swept);
            back.read(echo_w, state, sum, said);
            return;
        }
    } catch (const InputError&) {
        throw;
    } catch (const Error& e) {  // nor can it be written
        const std::string words = e.what();
        constexpr std::string_view before = "cannot be written: ";
        if (const std::size_t at = words.find(before); at != std::string::npos) why = words.substr(at + before.size());
    }
    if (!format.creation.empty()) {
        RasterFormat plain = format;
        plain.creation.clear();
        check_echo_format(file, plain);  // or it is not by them
        std::string options;
        for (const std::string& option : format.creation) options += (options.empty() ? "" : " ") + option;
        throw InputError(text("echo is '", file.final_path(), "', and with co ", options,
                              " it does not give back what an echo image is: ", why, "; accepted: options that do"));
    }
    throw InputError(text("echo is '", file.final_path(), "', and a file of ",
                          format.driver.empty() ? "that ending" : format.driver.c_str(),
                          " does not give back what an echo image is; accepted: .tif, .img, .bil and others that keep "
                          "two bands of 32-bit floats, their names and metadata"));
}

std::int64_t EchoFile::columns() const { return dataset_->handle->GetRasterXSize(); }
std::int64_t EchoFile::rows() const { return dataset_->handle->GetRasterYSize(); }

void EchoFile::read(PolarImage<float>& echo_w, PolarImage<std::uint8_t>& state, std::uint64_t checksum,
                    std::string_view said) const {
    if (echo_w.grid.range_bins.size() != columns() || echo_w.grid.azimuth_bins.size() != rows() ||
        state.grid != echo_w.grid)
        throw Error(text(named(path_), ": has other cells than asked for"));
    const int wide = static_cast<int>(columns()), high = static_cast<int>(rows());
    // What threads of GDAL's own met, they do not say.
    const auto reason = [&](int number) {
        GdalErrors errors;
        const DatasetHandle alone = opened(path_, 1, errors);
        std::vector<float> line(static_cast<std::size_t>(wide));
        for (int row = 0; row < high; ++row)
            if (alone->GetRasterBand(number)->RasterIO(GF_Read, 0, row, wide, 1, line.data(), wide, 1, GDT_Float32, 0,
                                                       0, nullptr) != CE_None)
                break;
        return errors.reason();
    };
    const auto band = [&](int number, GDALDataType type, void* cells) {
        GdalErrors errors;
        if (dataset_->handle->GetRasterBand(number)->RasterIO(GF_Read, 0, 0, wide, high, cells, wide, high, type, 0, 0,
                                                              nullptr) != CE_None ||
            errors.failed())
            throw IoError(text(named(path_), " cannot be read: ", reason(number),
                               "; it is damaged or cut short: simulate again"));
    };
    band(1, GDT_Float32, echo_w.cells.data());
    band(2, GDT_Byte, state.cells.data());
    std::uint8_t most = 0;  // a plain maximum: vector code
    for (const std::uint8_t s : state.cells) most = std::max(most, s);
    if (echo_checksum(echo_w, state, said) != checksum || most >= state_count)
        throw DataError(
            text(named(path_),
                 " is damaged, or was changed: its cells, or the values of its SCENE_JSON, are not those that "
                 "were written; simulate again"));
}

}  // namespace wedgescope
