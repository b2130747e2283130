// Features: what `tile` burns over its culture: points, lines and areas of a vector file (as DFAD's), with a material and a height.
// Leaves reading them to feature_file.hpp and cells to burnt_layer.hpp.
#pragma once
#include <cstdint>
#include <optional>
#include <string>

#include "lib/material.hpp"

namespace wedgescope {

struct FeatureParams {
    std::string path;
    std::string layer;  ///< empty: all of them, a later one over those before
    bool touch =
        false;  ///< every cell that a line or area touches; else lines one cell wide, and cells whose centre lies in an area
    Legend legend;  ///< of whole numbers in a field of material
    Materials materials;
    double height_unit_m = 1;  ///< metres in one unit of the culture height: culture-height-scale
};

/// Codes that stand for the classes of features burnt over a raster of codes: this + ClassId. Without such a raster: ClassId.
inline constexpr std::int32_t first_feature_code = 30000;

/// A legend with the codes of features; none: of a layer that holds nothing else. InputError where `legend` names one of them.
Legend with_features(const std::optional<Legend>& legend, const Materials& materials);

}  // namespace wedgescope
