// What this process holds in memory (under a sanitizer with what that holds of its own), and what it has read.
#pragma once
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>

namespace wedgescope::test {

inline std::size_t resident_bytes() {
    std::size_t pages = 0, resident = 0;
    std::ifstream("/proc/self/statm") >> pages >> resident;
    return resident * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

/// By system calls, all threads together.
inline std::uint64_t bytes_read() {
    std::ifstream io("/proc/self/io");
    std::string word;
    std::uint64_t bytes = 0;
    while (io >> word)
        if (word == "rchar:") io >> bytes;
    return bytes;
}

}  // namespace wedgescope::test
