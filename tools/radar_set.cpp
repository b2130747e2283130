#include "tools/radar_set.hpp"

namespace wedgescope {

std::string RadarSet::summary() const {
    std::string line = content.substr(0, content.find('\n'));
    return line.starts_with("# ") ? line.substr(2) : line;
}

const RadarSet* shipped_set(std::string_view name) {
    for (const RadarSet& set : shipped_sets())
        if (set.name == name) return &set;
    return nullptr;
}

std::string shipped_set_names() {
    std::string names;
    for (const RadarSet& set : shipped_sets()) names += (names.empty() ? "" : ", ") + set.name;
    return names;
}

}  // namespace wedgescope
