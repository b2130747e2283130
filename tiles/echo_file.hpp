// Echo file: the echo image that write_echo() wrote, opened, checked and read again. Leaves what its SCENE_JSON says to tools.
//
// Memory: the two images that read() makes, and while it runs GDAL's cache.
#pragma once
#include <cstdint>
#include <memory>
#include <string>

#include "lib/polar.hpp"

namespace wedgescope {

/// Of the cells and their states, to find damage.
std::uint64_t echo_checksum(const PolarImage<float>& echo_w, const PolarImage<std::uint8_t>& state);

class EchoFile {
public:
    /// IoError if it cannot be opened, DataError if it is no echo image. Within a GdalSession.
    explicit EchoFile(const std::string& path);
    ~EchoFile();
    EchoFile(const EchoFile&) = delete;
    EchoFile& operator=(const EchoFile&) = delete;

    std::int64_t columns() const;  ///< range bins
    std::int64_t rows() const;     ///< azimuth bins
    const std::string& scene_json() const { return scene_json_; }

    /// All cells; the images' grids are columns() x rows(). IoError; DataError where a value is none of an echo image or the
    /// cells are not those of `checksum`.
    void read(PolarImage<float>& echo_w, PolarImage<std::uint8_t>& state, std::uint64_t checksum) const;

private:
    struct Dataset;
    std::string path_, scene_json_;
    std::unique_ptr<Dataset> dataset_;
};

}  // namespace wedgescope
