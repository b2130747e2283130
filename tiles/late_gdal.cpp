// What stands behind the stand-ins that late_gdal.cmake writes: GDAL is loaded when one of them is called first.
// For the program itself only; tests and benchmarks, which call GDAL themselves, are linked with it.
#include <dlfcn.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <string>

#include "tiles/gdal_session.hpp"

extern "C" {
extern const char* const wedgescope_late_gdal_library;
extern const char* const wedgescope_late_gdal_folder;
extern const char* const wedgescope_late_gdal_names[];
extern std::atomic<void*> wedgescope_late_gdal_slots[];
void* wedgescope_late_gdal_find(unsigned long number) noexcept;
bool wedgescope_late_gdal_loaded() noexcept;
}

namespace {

std::atomic<void*> library = nullptr;

/// There is no way back from a stand-in that could not be served, as there is none where a program's library is missing.
[[noreturn]] void give_up() {
    const char* why = ::dlerror();
    std::fprintf(stderr, "wedgescope: GDAL cannot be loaded: %s\n", why ? why : wedgescope_late_gdal_library);
    std::_Exit(1);
}

void load() {
    void* found = ::dlopen(wedgescope_late_gdal_library, RTLD_LAZY | RTLD_LOCAL);
    // Where the system does not look, GDAL lies where it lay when this was built.
    if (!found)
        found = ::dlopen((std::string(wedgescope_late_gdal_folder) + '/' + wedgescope_late_gdal_library).c_str(),
                         RTLD_LAZY | RTLD_LOCAL);
    if (!found) give_up();
    library = found;
    wedgescope::GdalSession::settle();
}

}  // namespace

bool wedgescope_late_gdal_loaded() noexcept { return library.load() != nullptr; }

void* wedgescope_late_gdal_find(unsigned long number) noexcept {
    // Whoever comes meanwhile waits until the session is settled, for which this thread calls GDAL itself.
    static std::recursive_mutex mutex;
    const std::lock_guard lock(mutex);
    if (!library) load();
    void* const function = ::dlsym(library, wedgescope_late_gdal_names[number]);
    if (!function) give_up();
    wedgescope_late_gdal_slots[number] = function;
    return function;
}
