// RasterFile: one raster, opened and checked, and a pool of handles that threads read its first band through.
// For the .cpp files of this folder only. Leaves what the values mean to raster_layer.hpp, chunks to raster_source.cpp
// and counting to raster.cpp.
//
// Memory: one GDAL handle per thread that reads at the same time; a handle goes back to the pool with its lease. The
// pool grows to the largest number of readers at a time and never waits. What each holds: reader_bytes().
#pragma once
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tiles/gdal_handle.hpp"
#include "tiles/raster_layer.hpp"

namespace wedgescope {

class RasterFile final : public RasterLayer {
public:
    /// IoError if it cannot be opened, DataError if it is nothing we can work with (rotated, complex, empty, ...).
    RasterFile(std::string role, std::string path);

    void read_values(const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) override;
    ReaderBytes reader_bytes() const override { return reader_bytes_; }
    /// By paths, sizes and times of change of all files that GDAL reads it from, whatever the windows.
    std::uint64_t fingerprint(const std::vector<Window>& cells) override;
    /// Closes the handles that nobody reads through just now; the next reader opens one again.
    void close_idle();

protected:
    bool read_mask(const Window& window, std::vector<std::uint8_t>& masks) override;

private:
    struct Reader {
        DatasetHandle dataset;
        GDALRasterBand* band = nullptr;
        std::int64_t lines_found = 0;  ///< of a text or an image packed as a whole: so many from the top have been read
        std::thread::id last;          ///< who read through it last
    };
    void find_lines(Reader& reader, std::int64_t line) const;
    void decode_lines(Reader& reader, std::int64_t end) const;
    class Lease;

    std::mutex mutex_;
    std::mutex alone_;  ///< held by whoever reads an image packed as a whole, which is decoded once for all
    std::vector<std::unique_ptr<Reader>> free_;
    std::vector<std::string> files_;  ///< itself, side files, a mosaic's parts
    ReaderBytes reader_bytes_;
};

}  // namespace wedgescope
