// What this process holds in memory. Under a sanitizer with what that holds of its own.
#pragma once
#include <unistd.h>

#include <cstddef>
#include <fstream>

namespace wedgescope::test {

inline std::size_t resident_bytes() {
    std::size_t pages = 0, resident = 0;
    std::ifstream("/proc/self/statm") >> pages >> resident;
    return resident * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

}  // namespace wedgescope::test
