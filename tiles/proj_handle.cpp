#include "tiles/proj_handle.hpp"

#include <mutex>

namespace wedgescope {
namespace {

struct Common {
    std::mutex mutex;
    ProjContext context;
    std::string reason;
};

/// Never destroyed: to close PROJ's data base takes 5 ms, and at the end of a process the system does it.
Common& common() {
    static Common& one = *new Common;
    return one;
}

}  // namespace

ProjContext quiet_context(std::string& reason) {
    ProjContext context(proj_context_create());
    proj_context_set_enable_network(context.get(), 0);
    proj_log_func(context.get(), &reason, [](void* first, int level, const char* message) {
        if (level > PJ_LOG_ERROR) return;
        if (auto& words = *static_cast<std::string*>(first); words.empty()) words = message;
    });
    return context;
}

std::string with_proj(const std::function<void(PJ_CONTEXT*)>& body) {
    Common& one = common();
    const std::lock_guard lock(one.mutex);
    if (!one.context) one.context = quiet_context(one.reason);
    one.reason.clear();
    body(one.context.get());
    return one.reason;
}

}  // namespace wedgescope
