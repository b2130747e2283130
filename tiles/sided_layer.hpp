// SidedLayer: a culture raster whose cells take their side from another raster of the same grid: codes of classes with a
// directivity of their own where that says so, as they are elsewhere. For the .cpp files of this folder only.
// Leaves which classes there are to features.hpp, and features over it to burnt_layer.hpp.
#pragma once
#include <map>
#include <memory>
#include <set>

#include "tiles/feature_file.hpp"
#include "tiles/features.hpp"
#include "tiles/raster_layer.hpp"

namespace wedgescope {

class SidedLayer final : public RasterLayer {
public:
    /// DataError where the grids are not one.
    SidedLayer(std::unique_ptr<RasterLayer> culture, SideRasterParams params);

    void read_codes(const Window& window, std::int32_t* out) override;
    /// Not as a file's.
    void read_values(const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) override;
    ReaderBytes reader_bytes() const override;
    std::uint64_t fingerprint(const std::vector<Window>& cells) override;

    const SideRasterParams& params() const { return params_; }
    /// Of all cells. DataError naming a cell.
    std::set<FeatureFile::Side> sides();

private:
    /// Calls body(index, class, value) for each cell that has a side and a class, unknown codes left out.
    template <class Body>
    void each_sided(const std::int32_t* codes, const std::vector<std::int32_t>& values, Body&& body) const;
    /// Nothing: the class has it already.
    std::optional<FeatureFile::Side> side(ClassId id, std::int32_t value) const;
    /// Both layers of a window; DataError for a value that is none.
    void read(const Window& window, std::int32_t* codes, std::vector<std::int32_t>& values);

    std::unique_ptr<RasterLayer> culture_, sides_;
    SideRasterParams params_;
};

}  // namespace wedgescope
