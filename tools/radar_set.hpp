// Radar sets: the shipped ones, files of keys that are built into the program, so that a program moved elsewhere has them.
// Leaves reading their lines, and the users' own files, to key_file.hpp.
#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace wedgescope {

struct RadarSet {
    std::string name;
    std::string content;  ///< of the file, as it stands in tools/sets

    /// What it is: the first line's comment.
    std::string summary() const;
};
const std::vector<RadarSet>& shipped_sets();
/// None: a file is meant.
const RadarSet* shipped_set(std::string_view name);
/// "f111a, ku-mapping, x-navigation".
std::string shipped_set_names();

}  // namespace wedgescope
