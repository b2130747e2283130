// gdal_viewshed's options, as whole words in GDAL's units, turned into keys of `coverage`; messages name what was written.
// Leaves what keys mean and accept to keys.hpp.
#pragma once
#include <string>
#include <vector>

#include "lib/wedge_source.hpp"
#include "tools/keys.hpp"
#include "tools/settings.hpp"

namespace wedgescope {

struct ViewshedArguments {
    std::vector<std::string> words;  ///< the others
    std::vector<Given> given;        ///< each under its own name
    std::vector<Given> defaults;     ///< gdal_viewshed's, where coverage's are others
    bool gdal_style = false;         ///< -ox and -oy were given: plane, posts and defaults as gdal_viewshed's
};

/// Words that are none of gdal_viewshed's stay as they are. InputError for its options that coverage does not have, and
/// for values that are none.
ViewshedArguments translate_viewshed(const std::vector<std::string>& arguments);

/// Lengths that were given in gdal_viewshed's words, or are its defaults, read as metres so far: its heights are in the unit of
/// the terrain's heights, its distance in that of x and y (metres over degrees, where it makes no sense of them). Once a run.
void take_units_of(const DataBase& terrain, Settings& settings);

}  // namespace wedgescope
