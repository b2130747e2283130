// The wedges of one run on their way through the graph: chunk after chunk is loaded and swept, bins in doubt are swept again, and
// what is found goes into the images. What comes before and after all wedges is in engine.cpp.
#pragma once

#include "lib/engine.hpp"
#include "lib/plan.hpp"
#include "lib/run_setting.hpp"
#include "lib/threads.hpp"

namespace wedgescope {

/// Sweeps all wedges of a plan, or those of params.only_wedges, into the echo and state images of `result`, which have the swept
/// grid, and tells of them in its report. `data`: the source's fingerprint before any of it was read; a wedge that was swept of
/// anything else is not kept. DataError of that, or of a culture code that no class has; what the source throws; Interrupted.
void sweep_wedges(const RunSetting& setting, WedgeSource& source, std::uint64_t data, const Plan& plan,
                  const EngineParams& params, int threads, Threads& crew, RunResult& result);

}  // namespace wedgescope
