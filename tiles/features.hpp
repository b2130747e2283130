// Features: what `tile` burns over its culture: points, lines and areas of a vector file (as DFAD's), with a material, a side that
// reflects and a height.
// Leaves reading them to feature_file.hpp and cells to burnt_layer.hpp.
#pragma once
#include <cstdint>
#include <optional>
#include <string>

#include "lib/material.hpp"
#include "lib/stop.hpp"

namespace wedgescope {

struct FeatureParams {
    std::string path;
    std::string layer;  ///< empty: all of them, a later one over those before
    bool touch =
        false;  ///< every cell that a line or area touches; else lines one cell wide, and cells whose centre lies in an area
    Legend legend;  ///< of whole numbers in a field of material
    Materials materials;
    int axis_step_deg = 0;  ///< degrees that axes are rounded to; 0: features' directivities are not looked at
};

/// A raster over the culture raster, on its grid, that says which side of each cell reflects: 0 to 359: uni, the azimuth of its
/// outward normal, degrees; 360 to 539: bi, that azimuth and 360 more; 540: omni; no data: the side of its class.
struct SideRasterParams {
    std::string path;
    std::string culture;    ///< the raster below
    Legend legend;          ///< of its codes
    Materials materials{};  ///< and axis_step_deg: as FeatureParams'
    int axis_step_deg = 0;
    const Stop* stop = nullptr;  ///< looked at while all cells are read
};

/// Classes of features and cells with a directivity and an axis of their own.
struct SidedClasses {
    Materials materials;
    int axis_step_deg = 0;  ///< that axes are rounded to; 0: there are none
    std::size_t sides = 0;  ///< classes with a side of their own, those that the materials had already included
};
/// The same materials with a class more for each class with a directivity and axis of its own that a feature or a cell has: `metal`
/// looking to 90 degrees is `metal-uni-090`, the row of metal but for its side. Axes are rounded to as few degrees as leave room
/// for all these classes: 1, or the next divisor of 90. Reads the attributes of all features, and all cells. InputError where no
/// step does, where a class of that name looks another way, or where the name grows too long; water has no side. DataError naming the feature or the cell; IoError.
SidedClasses sided_classes(const Materials& materials, const std::optional<FeatureParams>& features,
                           const std::optional<SideRasterParams>& raster);

/// Codes that stand for the classes of features burnt over a raster of codes: this + ClassId. Without such a raster: ClassId.
inline constexpr std::int32_t first_feature_code = 30000;

/// A legend with the codes of features; none: of a layer that holds nothing else. InputError where `legend` names one of them.
Legend with_features(const std::optional<Legend>& legend, const Materials& materials);

}  // namespace wedgescope
