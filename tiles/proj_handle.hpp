// PROJ's objects in owning pointers, and the one PROJ context that whatever reads or compares CRS uses in turn: each of its
// own would open PROJ's data base again, 8 ms.
// For the .cpp files of this folder only.
#pragma once
#include <proj.h>

#include <functional>
#include <memory>
#include <string>

namespace wedgescope {

struct DestroyProj {
    void operator()(PJ* object) const noexcept { proj_destroy(object); }
    void operator()(PJ_CONTEXT* context) const noexcept { proj_context_destroy(context); }
};
using ProjObject = std::unique_ptr<PJ, DestroyProj>;
using ProjContext = std::unique_ptr<PJ_CONTEXT, DestroyProj>;

/// A context with the network off, which keeps in `reason`, which must stay where it is, the first thing that PROJ complains of
/// while that is empty.
ProjContext quiet_context(std::string& reason);

/// Calls `body` with the common context, the network off, while no other thread has it; returns what PROJ complained of
/// first, empty if of nothing. Not to be called from within `body`.
std::string with_proj(const std::function<void(PJ_CONTEXT*)>& body);

}  // namespace wedgescope
