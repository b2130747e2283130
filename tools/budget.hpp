// Budget: does a command fit into the memory granted, asked before any work; and if not, what is the smallest that would
// do. Found by trying the very checks that a run makes at growing budgets: shares of the budget, held blocks and the
// choice of a source follow no formula. Leaves what each stage holds to the stages.
#pragma once
#include <cstddef>
#include <functional>
#include <memory>

#include "lib/coverage.hpp"
#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "tiles/shared_source.hpp"
#include "tools/settings.hpp"

namespace wedgescope {

/// Throws TooLittleMemory if a budget does not do.
using Attempt = std::function<void(std::size_t memory_bytes)>;

/// `e` with the smallest budget of whole MiB above `memory_bytes` at which `attempt` passes.
[[noreturn]] void refuse(const TooLittleMemory& e, std::size_t memory_bytes, const Attempt& attempt);

/// Runs the attempt at the budget granted, and refuses that with the smallest that would do.
void check_budget(const Settings& settings, const Attempt& attempt);

/// What is granted, and the same settings with another budget.
std::size_t memory_bytes(const Settings& settings);
Settings with_memory(const Settings& settings, std::size_t memory_bytes);

/// TooLittleMemory if a source's cache and one reader do not fit: then not a single post can be read.
void check_reader(const WedgeSource& source, std::size_t memory_bytes);

/// The data base for many scenes or observers side by side: in memory where it takes little of what is granted, else read as ever.
/// Errors as of open_direct_source and check_reader.
std::unique_ptr<SharedSource> open_shared_source(const Settings& granted, const Stop& stop);

/// Where windows read its rasters badly and they do not stay in memory, a line that says so: for a remark before the work. Else empty.
std::string hard_to_read(const Settings& settings, const SharedSource& source, const Stop& stop);

/// Plans the scene as simulate would run it with so much memory, without reading posts (but those of a kept spill's
/// index). `range_given`: else the scene's range is a guess.
Attempt simulation(const Settings& settings, const ResolvedScene& scene, bool range_given, const Stop& stop,
                   WedgeArchive* archive = nullptr);

/// What --ground adds to a scene: the layer response on the raster's own posts, from the scene's own source, in what the images
/// leave of the budget.
struct GroundWork {
    ResolvedScene scene;
    CoverageParams params;
};
/// TooLittleMemory where that is too little.
GroundWork ground_work(const Settings& settings, const ResolvedScene& scene, WedgeSource& source);

/// Before simulate reads more than the posts below the sensor. Where the range follows from the terrain, the scene is
/// refused if it does not fit at the least range that this may be, and the budget named does for the largest.
/// Where only sorting the rasters would take too much the source becomes direct_for_memory.
void check_simulation(Settings& settings, const Stop& stop);
/// The same of a scene whose range is given, or of a part of it.
void check_scene(Settings& settings, const ResolvedScene& scene, const Stop& stop);

/// Before coverage reads more than the posts below the sensor, of `direct`, the rasters as they are.
void check_coverage_budget(Settings& settings, const CoverageParams& params, WedgeSource& direct, const Stop& stop);

/// Before `info` counts a raster, or resolves a scene on one.
void check_summary(const Settings& settings, const std::string& path);

}  // namespace wedgescope
