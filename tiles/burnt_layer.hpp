// BurntLayer: a culture layer with features burnt over it, as one raster: codes or heights of another layer, or of none, and the
// features' where they lie. For the .cpp files of this folder only. Leaves the features' cells to feature_file.hpp.
//
// Codes: those of the layer below as they are, features as first_feature_code + ClassId, 32 bits (16 over a layer of bytes), so
// that no code of the layer below can be one of theirs; with no layer below, a byte, the ClassId, 255 where there is nothing.
// Heights: Float32, in the units of culture-height-scale; 0 where nothing stands.
#pragma once
#include <cstddef>
#include <memory>
#include <vector>

#include "tiles/feature_file.hpp"
#include "tiles/raster_layer.hpp"

namespace wedgescope {

class BurntLayer final : public RasterLayer {
public:
    /// `below`: null: none, and `grid` is that of the terrain. `features`: null: none, over a SidedLayer. `unit_m`: metres in one
    /// unit of the heights, culture-height-scale.
    BurntLayer(StoreLayerKind kind, std::unique_ptr<RasterLayer> below, const RasterFacts& grid,
               std::shared_ptr<FeatureFile> features, double unit_m);

    void read_heights(const Window& window, float* out, std::int64_t stride) override;
    void read_codes(const Window& window, std::int32_t* out) override;
    /// As stored: codes or heights, in facts().type or converted.
    void read_values(const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) override;
    /// What was read, as it is stored.
    void store(const std::vector<std::int32_t>& codes, std::vector<std::byte>& stored) const;
    void store(const std::vector<float>& heights, std::vector<std::byte>& stored) const;
    ReaderBytes reader_bytes() const override;
    std::uint64_t fingerprint(const std::vector<Window>& cells) override;

    const RasterLayer* below() const { return below_.get(); }

private:
    bool codes_;
    double unit_m_;
    std::unique_ptr<RasterLayer> below_;
    std::shared_ptr<FeatureFile> features_;
};

}  // namespace wedgescope
