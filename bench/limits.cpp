// limits [FOLDER]: what this machine does at the most, one thread: reading memory, reading and writing a file in FOLDER
// (.) that fits into memory, decoding tiles. `wedgescope ... --profile` measures the same beside what a run reached.
#include <fmt/format.h>

#include <cstdio>
#include <exception>

#include "tools/limits.hpp"

int main(int argc, char** argv) {
    if (argc > 2) {
        fmt::print(stderr, "usage: limits [FOLDER]\n");
        return 2;
    }
    try {
        for (const std::size_t mib : {8, 32, 256})
            fmt::print(
                "{:>4} MiB: {}", mib,
                wedgescope::limits_line(wedgescope::measure_limits(argc > 1 ? argv[1] : ".", mib << 20, "FOLDER")));
    } catch (const std::exception& e) {
        fmt::print(stderr, "limits: {}\n", e.what());
        return 1;
    }
}
