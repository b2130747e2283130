/// What one run of the engine sets up before its wedges are swept, and all of them share: where the spokes lie, the tables, the
/// sizes of quanta. What a wedge does with it is in wedges.cpp.
#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <optional>

#include "lib/deposit.hpp"
#include "lib/engine.hpp"
#include "lib/front.hpp"
#include "lib/refine.hpp"
#include "lib/spoke_grid.hpp"
#include "lib/spoke_map.hpp"

namespace wedgescope {

/// Where the spokes of a scene lie: all that a plan asks for. Nothing here grows with the number of range bins, so that a scene
/// with too many of them is refused at once.
struct SpokeSetting {
    SpokeMap map;
    DetailLevels levels;
    Sampling sampling;
    SpokeGrid grid;

    SpokeSetting(const ResolvedScene& s, WedgeSource& source);
    SpokeSetting(const SpokeSetting&) = delete;  // the grid looks at the map
    SpokeSetting& operator=(const SpokeSetting&) = delete;
};

/// Everything the wedges of one run share, and never change.
struct RunSetting : SpokeSetting {
    const ResolvedScene& scene;
    const DataBase& data_base;
    std::shared_ptr<const SceneTables> tables;
    Quanta cells;
    Refinement refinement;
    SweepScene sweep;

    /// `made`: the tables of all frames of a track, or null. `loss`: null in clear air; it outlives the setting, as the scene does.
    RunSetting(const ResolvedScene& s, WedgeSource& source, std::shared_ptr<const SceneTables> made,
               const PathLossTable* loss);
    /// Of the first sweep of a wedge, round 0, and of what is swept again: made when it is first asked for.
    const SweepScene& sweep_of(int round) const;
    const SpokeGrid& grid_of(int round) const { return *sweep_of(round).grid; }

private:
    struct Finer {
        std::once_flag made;
        std::optional<SpokeGrid> grid;
        SweepScene sweep;
    };
    mutable std::array<Finer, Refinement::most_rounds> finer_;
};

}  // namespace wedgescope
