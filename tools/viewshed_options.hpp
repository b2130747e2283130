// gdal_viewshed's options, as whole words in GDAL's units, turned into those of `coverage`.
// Leaves what they mean to keys.hpp.
#pragma once
#include <string>
#include <vector>

namespace wedgescope {

struct ViewshedArguments {
    std::vector<std::string> words;  ///< in coverage's own options
    bool gdal_style = false;         ///< -ox and -oy were given: plane, posts and defaults as gdal_viewshed's
};

/// Words that are none of gdal_viewshed's stay as they are. InputError for its options that coverage does not have, and
/// for values that are none.
ViewshedArguments translate_viewshed(const std::vector<std::string>& arguments);

}  // namespace wedgescope
