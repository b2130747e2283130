// Legend: a panel with text beside the scope picture. The text is set here; letters are drawn by the helper program
// wedgescope_picture (OpenImageIO), which is started only for this and talks through two pipes, without files.
#pragma once
#include <string>

#include "tools/settings.hpp"

namespace wedgescope {

/// Path of the helper program: beside this program, else in PATH. IoError naming it.
std::string find_picture_helper();

/// Adds the panel to the right of the picture, or below one that is wide and low. The picture's own pixels, its
/// frame and so its georeference stay. IoError.
void add_legend(const std::string& helper, const Settings& settings, const ResolvedScene& scene, Picture& picture);

}  // namespace wedgescope
