// Features: what `tile` burns over its culture: points, lines and areas of a vector file (as DFAD's), with a material, a side that
// reflects and a height.
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
    int axis_step_deg = 0;     ///< degrees that axes are rounded to; 0: features' directivities are not looked at
};

/// The same with a class more in `materials` for each class with a directivity and axis of its own that a feature has: `metal`
/// looking to 90 degrees is `metal-uni-090`, the row of metal but for its side. Axes are rounded to as few degrees as leave room
/// for all these classes: 1, or the next divisor of 90. Reads the attributes of all features. InputError where no step does;
/// DataError naming the feature; IoError.
FeatureParams with_sides(FeatureParams params);

/// Codes that stand for the classes of features burnt over a raster of codes: this + ClassId. Without such a raster: ClassId.
inline constexpr std::int32_t first_feature_code = 30000;

/// A legend with the codes of features; none: of a layer that holds nothing else. InputError where `legend` names one of them.
Legend with_features(const std::optional<Legend>& legend, const Materials& materials);

}  // namespace wedgescope
