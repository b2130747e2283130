// What stands behind the stand-ins that late_libraries.cmake writes: a library is loaded when one of its functions is called first.
// For the program itself only; tests and benchmarks, which call these libraries themselves, are linked with them.
#include "tiles/late_libraries.hpp"

#include <dlfcn.h>

#include <atomic>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>

#include "tiles/gdal_session.hpp"

extern "C" {
extern std::atomic<void*> wedgescope_late_slots[];
void* wedgescope_late_find(unsigned long number) noexcept;
bool wedgescope_late_gdal_loaded() noexcept;
void* wedgescope_late_gdal_function(const char* name) noexcept;
}

namespace {

constexpr std::size_t most_libraries = 8;

std::atomic<void*> loaded[most_libraries] = {};
std::atomic<bool> gdal_is_loaded = false;

/// There is no way back from a stand-in that could not be served, as there is none where a program's library is missing.
[[noreturn]] void give_up(const WedgescopeLateLibrary& library, const std::string& why) {
    std::fprintf(stderr, "wedgescope: %s cannot be loaded: %s\n", library.name, why.c_str());
    std::_Exit(1);
}

std::string reason() {
    const char* why = ::dlerror();
    return why ? why : "no reason given";
}

void load(unsigned number) {
    const WedgescopeLateLibrary& library = wedgescope_late_libraries[number];
    void* found = ::dlopen(library.file, RTLD_LAZY | RTLD_LOCAL);
    // Where the system does not look, it lies where it lay when this was built.
    if (!found) {
        const std::string first = reason();
        found = ::dlopen((std::string(library.folder) + '/' + library.file).c_str(), RTLD_LAZY | RTLD_LOCAL);
        if (!found) give_up(library, first + "; " + reason());
    }
    loaded[number] = found;
    if (std::strcmp(library.name, "GDAL") == 0) {
        gdal_is_loaded = true;
        wedgescope::GdalSession::settle();
    }
}

}  // namespace

bool wedgescope_late_gdal_loaded() noexcept { return gdal_is_loaded; }

void* wedgescope_late_find(unsigned long number) noexcept {
    // Whoever comes meanwhile waits until the session is settled, for which this thread calls GDAL itself.
    static std::recursive_mutex mutex;
    const std::lock_guard lock(mutex);
    const auto [name, library] = wedgescope_late_functions[number];
    if (!loaded[library]) load(library);
    void* const function = ::dlsym(loaded[library], name);
    if (!function) give_up(wedgescope_late_libraries[library], reason());
    wedgescope_late_slots[number] = function;
    return function;
}

void* wedgescope_late_gdal_function(const char* name) noexcept {
    for (std::size_t i = 0; i < most_libraries; ++i)
        if (void* const library = loaded[i]; library && std::strcmp(wedgescope_late_libraries[i].name, "GDAL") == 0)
            return ::dlsym(library, name);
    return nullptr;
}
