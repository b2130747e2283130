// Promise: how far the power image of a scene may be off, by its quality, and where that holds.
// Leaves how a quality keeps it to spoke_grid.hpp (sampling) and detail.hpp (levels of detail).
#pragma once
#include <string>
#include <vector>

#include "lib/scene.hpp"

namespace wedgescope {

struct DataBase;
struct ResolvedScene;

struct Promise {
    PowerError error;
    double from_m = 0;               ///< range from which on the beam is two posts wide
    std::vector<std::string> lacks;  ///< why nothing is promised of this scene; empty: it is
};

/// What the scene's quality promises where c tau / 2 and beam are two posts or more, four bins or more lie in each, both are
/// drawn, and nothing replaces what the quality says of the sampling. Source: docs/accuracy.md.
Promise promise_of(const ResolvedScene& scene);

}  // namespace wedgescope
