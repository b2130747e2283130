// Raster dataset: the steps in which GDAL makes a raster of a content, the same in earnest and in a trial. For the .cpp files of this
// folder only. Leaves their order to raster_writer.hpp and driver_trial.hpp.
#pragma once
#include <cpl_string.h>

#include <string>

#include "tiles/gdal_handle.hpp"
#include "tiles/raster_content.hpp"

namespace wedgescope {

/// A file of all the content's bands, described, without cells; null where the driver makes none. IoError where it makes fewer bands.
DatasetHandle created_dataset(GDALDriver& driver, const std::string& path, const std::string& final_path,
                              const RasterContent& content, const CPLStringList& options,
                              const CPLStringList& geolocation = {});
/// A whole file, by a driver that only copies others; null where it makes none.
DatasetHandle copied_dataset(GDALDriver& driver, const std::string& path, const RasterContent& content,
                             const CPLStringList& options);

/// What a file may lack without being wrong: drivers that cannot hold it say so, nobody listens.
void describe_dataset(GDALDataset& dataset, const RasterContent& content, const CPLStringList& geolocation);

/// While one stands no thread writes another thread's blocks: GDAL's cache is everybody's, and who needs room in it would
/// write what another one's file still lacks, while that one closes it.
class OwnBlocks {
public:
    OwnBlocks() { GDALRasterBlock::EnterDisableDirtyBlockFlush(); }
    ~OwnBlocks() { GDALRasterBlock::LeaveDisableDirtyBlockFlush(); }
    OwnBlocks(const OwnBlocks&) = delete;
    OwnBlocks& operator=(const OwnBlocks&) = delete;
};
/// Block after block, each of them in the file before the next: none waits in the cache. IoError as of fail_to_write().
void write_bands(GDALDataset& dataset, const RasterContent& content, const std::string& final_path,
                 const std::string& written_path, const GdalErrors& errors);

/// Does a band declare as no data what means something?
bool declares_meaning_void(GDALDataset& dataset, const RasterContent& content);
/// Drivers with a no-data value of their own: where that is one of the values that mean something, the file is to declare none, or
/// one of no meaning. False: the driver keeps to its own.
bool set_no_data_apart(GDALDataset& dataset, const RasterContent& content);
[[noreturn]] void refuse_no_data(GDALDriver& driver, const std::string& final_path);  ///< InputError

/// The IoError of outputs that GDAL writes; `written_path`: the temporary one, which the user does not know.
[[noreturn]] void fail_to_write(const std::string& final_path, const std::string& written_path,
                                const GdalErrors& errors);

}  // namespace wedgescope
