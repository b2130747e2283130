// Echo file: the echo image that write_echo() wrote, opened, checked and read again. Leaves what its SCENE_JSON says to tools.
//
// Memory: the two images that read() makes, and while it runs GDAL's cache.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "lib/polar.hpp"
#include "tiles/polar_raster.hpp"

namespace wedgescope {

/// Of the cells, their states and `said`, the words and numbers that go with them, to find damage.
std::uint64_t echo_checksum(const PolarImage<float>& echo_w, const PolarImage<std::uint8_t>& state,
                            std::string_view said);

class EchoFile {
public:
    /// IoError if it cannot be opened, DataError if it is no echo image. Within a GdalSession. `threads` decode packed tiles;
    /// 0: as many as the machine has.
    explicit EchoFile(const std::string& path, int threads = 0);
    ~EchoFile();
    EchoFile(const EchoFile&) = delete;
    EchoFile& operator=(const EchoFile&) = delete;

    std::int64_t columns() const;  ///< range bins
    std::int64_t rows() const;     ///< azimuth bins
    const std::string& scene_json() const { return scene_json_; }

    /// All cells; the images' grids are columns() x rows(). IoError; DataError where a value is none of an echo image or
    /// they and `said` are not those of `checksum` (echo_checksum()).
    void read(PolarImage<float>& echo_w, PolarImage<std::uint8_t>& state, std::uint64_t checksum,
              std::string_view said) const;

private:
    struct Dataset;
    std::string path_, scene_json_;
    std::unique_ptr<Dataset> dataset_;
};

/// Before there is anything to write: tries whether a format, where it is not GeoTIFF, gives back what write_echo() puts into it.
/// InputError where it does not.
void check_echo_format(const OutputFile& file, RasterFormat format);

}  // namespace wedgescope
