// GDAL's handles and errors, for the .cpp files of this folder only: no header that others read includes it.
#pragma once
#include <cpl_error.h>
#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <cerrno>
#include <memory>
#include <string>

#include "tiles/crs.hpp"

namespace wedgescope {

struct CloseDataset {
    void operator()(GDALDataset* dataset) const noexcept { GDALClose(dataset); }
};
using DatasetHandle = std::unique_ptr<GDALDataset, CloseDataset>;
/// To be read, by the drivers that are registered; null: by none of them.
inline DatasetHandle open_dataset(const std::string& path) {
    return DatasetHandle(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY));
}

/// Registers the drivers of usual files; once.
void register_usual_drivers();
/// Registers all of GDAL's drivers; once. They take 7 MiB: only for files that the usual ones do not know.
void register_all_drivers();

/// A CRS for GDAL, x (longitude) first, and from GDAL: null where that is empty; DataError where PROJ cannot write it.
OGRSpatialReference in_gdal(const Crs& crs);
std::shared_ptr<const Crs> from_gdal(const OGRSpatialReference& crs);
/// Of places: null too where the layer says that it is undefined.
std::shared_ptr<const Crs> crs_of(OGRLayer& layer);

/// Keeps what GDAL says on this thread while it lives, instead of letting it be printed.
class GdalErrors {
public:
    GdalErrors() {
        errno = 0;
        CPLPushErrorHandlerEx(&GdalErrors::hear, this);
    }
    ~GdalErrors() { CPLPopErrorHandler(); }
    GdalErrors(const GdalErrors&) = delete;
    GdalErrors& operator=(const GdalErrors&) = delete;

    /// Keeps errno if it tells of the disk, and clears it: after a call of GDAL that may say only that it cannot.
    void note_disk();

    bool failed() const { return failed_; }
    bool warned() const { return !warning_.empty(); }
    /// The first failures (or else the first warning) in one line; "GDAL gives no reason" if there was none.
    std::string reason() const;
    /// The same without the path that GDAL may begin with.
    std::string reason_beside(const std::string& path) const;
    /// Of a file that is written under a temporary name: the system's reason where the disk is at fault, else the same as reason()
    /// without that name and libtiff's functions.
    std::string reason_of_writing(const std::string& written_path) const;

private:
    static void CPL_STDCALL hear(CPLErr level, CPLErrorNum number, const char* message);

    bool failed_ = false;
    int disk_error_ = 0;  ///< errno of the last call that told of the disk
    std::string failure_, last_, warning_;
};

/// What `open`, which gives a DatasetHandle, opens by the drivers of usual files or else by all of them; what GDAL says is of the
/// last attempt. Null: by none.
template <class Open>
DatasetHandle by_usual_or_all_drivers(Open&& open) {
    register_usual_drivers();
    {
        GdalErrors quiet;
        if (DatasetHandle dataset = open()) return dataset;
        register_all_drivers();
    }
    return open();
}

}  // namespace wedgescope
